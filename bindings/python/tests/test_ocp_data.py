"""What is set on a problem counts in every solve after it: cold, warm, and warm after a shift; what is not set is said."""

import numpy as np
import pytest

import switchback_control as swb
from switchback_control import maximum, sign, sqrt, where


def slider(kind):
    """A mass with friction that follows a set point."""
    m = swb.Model(states="q v", controls="F", parameters="ref mu")
    (q, v), F = m.x, m.u[0]
    m.derivatives = [v, F - m.p[1] * sign(v)]
    ocp = swb.Ocp(m, 2.0, 4, n_fe=2, initial_state=[0, 0], control_bounds=(-3, 3), params=[1.0, 0.5])
    ocp.set_lagrange(m.function([10 * (q - m.p[0]) ** 2 + 0.1 * F**2]))
    ocp.add_least_squares(m.function([v]), [0.3], [0.2])
    if kind == "free horizon":
        ocp.set_free_time("horizon", 1.0, 3.0)
    return ocp


def simulated(r, params, x0, wanted=0.2):
    """The cost of the controls by small steps of constant acceleration, which stick where friction holds."""
    q, v, cost, steps = *x0, 0.0, 2000
    for u, length in zip(r.controls[:, 0], r.durations):
        h = length / steps
        for _ in range(steps):
            ref, mu = params
            a = u - mu * np.sign(v) if v else (0.0 if abs(u) <= mu else u - mu * np.sign(u))
            w = v + h * a
            if v * w < 0 and abs(u) <= mu:
                w = 0.0
            moved = q + h * (v + w) / 2
            rate = [10 * (x - ref) ** 2 + 0.1 * u**2 + 0.3 * (y - wanted) ** 2 for x, y in ((q, v), (moved, w))]
            cost += h * sum(rate) / 2
            q, v = moved, w
    return cost


def changed(ocp, what):
    """Changes a datum; params, initial state and reference that are then valid."""
    params, x0, wanted = [1.0, 0.5], [0.0, 0.0], 0.2
    if what == "params":
        params = [2.0, 0.8]
        ocp.set_params(params)
    elif what == "free parameter, fixed again":
        ocp.set_param_bounds([0.5, 0.5], [1.5, 0.5])
        params = [2.0, 0.5]
        ocp.set_params(params)
        ocp.set_param_bounds(params, params)
    elif what == "initial state":
        x0 = [0.3, 0.4]
        ocp.set_initial_state(x0)
    elif what == "control bounds":
        ocp.set_control_bounds(-1.0, 1.2)
    elif what == "references":
        wanted = 0.9
        ocp.set_references(0, [wanted])
    elif what == "lengths":
        ocp.set_durations([0.3, 0.3, 0.5, 0.9])
    elif what == "bounds of the horizon":
        ocp.set_free_time("horizon", 0.5, 0.8)
    return params, x0, wanted


CHANGES = ["params", "free parameter, fixed again", "initial state", "control bounds", "references", "lengths"]


@pytest.mark.parametrize("kind, changes", [("fixed", CHANGES), ("free horizon", ["params", "bounds of the horizon"])])
def test_what_is_set_counts_in_warm_solves(kind, changes):
    base = slider(kind)
    first = base.solve()
    for k, what in enumerate(changes):
        for shifted in (False, True):
            ocp = slider(kind)
            ocp.set_control_guess(first.controls)
            ocp.solve()
            if shifted and k % 2:
                ocp.shift()
            params, x0, wanted = changed(ocp, what)
            if shifted and not k % 2:
                ocp.shift()
            r = ocp.solve(warm=True)
            assert r.success and np.allclose(r.params, params), (what, shifted, r)
            assert np.isclose(r.cost, simulated(r, params, x0, wanted), rtol=5e-3, atol=1e-3), (what, shifted, r)
            if what == "control bounds":
                assert r.controls.min() >= -1 - 1e-7 and r.controls.max() <= 1.2 + 1e-7
            if what == "lengths":
                assert np.allclose(r.durations, [0.3, 0.3, 0.5, 0.9])
            if what == "bounds of the horizon":
                assert 0.5 - 1e-7 <= r.durations.sum() <= 0.8 + 1e-7


def test_transitions_follow_new_parameters_and_times():
    m = swb.Model(states="x", controls="u", parameters="k")
    x = m.x[0]
    heat = m.hysteresis(-x, on=-18, off=-20, name="heat")
    m.derivative(x, -m.p[0] * (x - 10) + 5 * heat + 0 * m.u[0])
    ocp = swb.Ocp(m, 3.0, 3, n_fe=2, initial_state=[19.0], control_bounds=(0, 1), params=[0.2], lagrange=m.function([m.u[0] ** 2]))
    ocp.solve()
    for k, t0 in ((0.3, 0.0), (0.25, 2.0)):
        ocp.set_params([k])
        ocp.set_initial_time(t0)
        r = ocp.solve(warm=True)
        exact = np.log(9 / 8) / k
        assert r.success and np.allclose(r.params, [k]) and np.isclose(r.jumps[0].t, t0 + exact, rtol=1e-6), r


def test_parameters_without_values_are_an_error():
    m = swb.Model(states="q v", controls="F", parameters="k mu")
    m.derivatives = [m.v, m.F - m.k * m.q - m.mu * sign(m.v)]
    ocp = swb.Ocp(m, 1.0, 3, initial_state=[0, 0], control_bounds=(-5, 5), lagrange=m.F**2)
    with pytest.raises(swb.StateError, match="parameter 0, 1 has no value.*set_params"):
        ocp.solve()
    with swb.Ocp.from_json(ocp.to_json()) as copy, pytest.raises(swb.StateError, match="parameter 0, 1"):
        copy.solve()
    ocp.set_param_bounds([1.0, -np.inf], [2.0, np.inf])
    assert ocp.solve().params[0] >= 1.0
    with pytest.raises(swb.StateError, match="no values"), swb.Nmpc(swb.Ocp(m, 1.0, 3, lagrange=m.F**2)) as c:
        c.prepare()


def test_max_iter_bounds_the_call():
    m = swb.Model(states="a b", controls="F")
    m.derivatives = [m.b, m.F - sign(m.b)]
    for most in (0, 1, 7, 40, 150):
        ocp = swb.Ocp(m, 3.0, 6, n_fe=2, lagrange=m.F**2, initial_state=[0, 0], control_bounds=(-5, 5), max_iter=most)
        ocp.add_terminal([m.a, m.b], [1, 0], [1, 0])
        r = ocp.solve()
        assert r.stats.iterations <= most, (most, r)
        assert r.success or (r.outcome == swb.Outcome.MAX_ITER and "max_iter" in r.message), (most, r)
    assert r.success


def test_controls_that_choose_are_named():
    laws = [(lambda u: where(u > 0.5, 1.0, 0.0), True), (lambda u: where(u > 0.3, u, -u), True), (lambda u: maximum(u - 0.5, 0.0), False), (abs, False)]
    for law, chooses in laws:
        m = swb.Model(states="x", controls="u")
        x = m.x[0]
        m.derivatives = [-0.5 * x + 2 * law(m.u[0])]
        ocp = swb.Ocp(m, 2.0, 4, n_fe=2, control_bounds=(-1, 1), initial_state=[0.2])
        ocp.add_least_squares(m.function([x]), [1.0], [0.8])
        r = ocp.solve()
        assert ("decides a mode by itself" in r.message) == chooses, r
        if "border" in r.message:
            assert r.certificate == "unknown" and "border" in r.optimality.reason, r


def test_pairs_of_controls_are_named():
    m = swb.Model(states="x", controls="u w")
    m.derivatives = [-0.5 * m.x[0] + 2 * m.u[0]]
    ocp = swb.Ocp(m, 2.0, 4, control_bounds=(0, 1), initial_state=[0.2])
    ocp.add_path(m.function([m.u[0] + m.u[1]]), 1, 1)
    ocp.add_complementarity(m.function([m.u[0]]), m.function([m.u[1]]))
    ocp.add_least_squares(m.function([m.x[0]]), [1.0], [0.8])
    r = ocp.solve()
    assert r.success and "is a choice in every stage" in r.message, r


def test_weirs_and_orifices():
    """Open channels: no depth makes the discharge undefined. At rest the depth over the crest is where discharge and inflow are equal."""
    rng = np.random.default_rng(10)
    for law in (lambda h, c: c * maximum(h - 1, 0) ** 1.5, lambda h, c: where(h > 1, c * sqrt(h - 1), 0), lambda h, c: c * sqrt(maximum(h - 1, 0) + 1e-3)):
        c = rng.uniform(0.5, 1.5)
        m = swb.Model(states="h", controls="u")
        h, u = m.x[0], m.u[0]
        m.derivatives = [u - law(h, c)]
        ocp = swb.Ocp(m, 4.0, 4, initial_state=[0.5], control_bounds=(0, 2), lagrange=m.function([(h - 1.4) ** 2 + 0.1 * u**2]))
        r = ocp.solve()
        assert r.success and np.isclose(r.cost, r.accuracy.cost, rtol=1e-3), r
