"""What is asked of answers with transitions besides controls: multipliers, derivatives, sequences that are given, grids, further costs."""

import numpy as np
import pytest

import switchback_control as swb

HORIZON, STAGES = 1.2, 4
TIGHT = {"rtol": 1e-11, "atol": 1e-13}


def mass(seed=0):
    """A mass on a spring; where it falls below a position, it loses a share of its speed and is pushed from then on. Both depend on parameters."""
    rng = np.random.default_rng(seed)
    drag, push = rng.uniform(0.3, 0.5), rng.uniform(0.2, 0.4)
    m = swb.Model(states="q v", controls="u", parameters="load brake where", name="mass")
    (q, v), u, (load, brake, where) = m.x, m.u[0], m.p
    braked = m.discrete("braked", 0)
    m.transition(q < where, when={braked: 0}, reset={v: brake * v + 0.05 * u}, to={braked: 1})
    m.derivatives = [v, u + load - q - drag * v + push * braked]
    return m


P0, X0 = np.array([0.3, 0.6, 0.62]), np.array([1.0, -0.5])


def problem(m, x0=X0, p=P0, **options):
    q, v, u = m.x[0], m.x[1], m.u[0]
    ocp = swb.Ocp(m, HORIZON, STAGES, params=p, control_bounds=(-2, 2), initial_state=x0, **{"n_fe": 2, "n_s": 3, **options})
    ocp.set_lagrange(m.function(q**2 + 0.5 * v**2 + 0.2 * u**2 + 0.1 * m.p[0] * q))
    ocp.set_mayer(m.function(2.0 * (q - 0.2) ** 2))
    return ocp


def solved(ocp, **options):
    r = ocp.solve(**options)
    assert r.success, r.message
    return r


def cost(m, controls, x0=X0, p=P0, lag=lambda q, v, u, p: q**2 + 0.5 * v**2 + 0.2 * u**2 + 0.1 * p[0] * q):
    """By a simulation and sums over 24 000 points."""
    run = swb.simulate(m, x0, HORIZON, u=controls, p=p, **TIGHT)
    n = 24000
    t = HORIZON * (np.arange(n) + 0.5) / n
    x, u = run(t), controls[np.minimum((t / HORIZON * STAGES).astype(int), STAGES - 1), 0]
    return lag(x[:, 0], x[:, 1], u, p).mean() * HORIZON + 2.0 * (run.x_end[0] - 0.2) ** 2, run


def slope(m, given, h, x=(0, 0), p=(0, 0, 0), then=lambda r: r.cost):
    """Central difference of what the optimum of a sequence has, along a change of start and parameters."""
    found = []
    for s in (1, -1):
        ocp = problem(m, X0 + s * h * np.array(x), P0 + s * h * np.array(p), tol=1e-11)
        ocp.set_modes(given)
        found.append(then(solved(ocp)))
    return (found[0] - found[1]) / (2 * h)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_derivatives_are_differences_of_optima(seed):
    m = mass(seed)
    ocp = problem(m, tol=1e-11)
    r = solved(ocp)
    assert len(r.jumps) == 1 and 0.01 < r.jumps[0].t % 0.3 < 0.29
    s, h = ocp.sensitivity(), 1e-4
    for i in range(2):
        e = np.eye(2)[i]
        assert s.cost_x0[i] == pytest.approx(slope(m, ocp.modes, h, x=e), rel=1e-5, abs=1e-6)
        assert s.controls_x0[..., i] == pytest.approx(slope(m, ocp.modes, h, x=e, then=lambda r: r.controls), rel=1e-4, abs=1e-4)
    for i in range(3):
        e = np.eye(3)[i]
        assert s.cost_p[i] == pytest.approx(slope(m, ocp.modes, h, p=e), rel=1e-5, abs=1e-6)
        assert s.controls_p[..., i] == pytest.approx(slope(m, ocp.modes, h, p=e, then=lambda r: r.controls), rel=1e-4, abs=1e-4)
    # a discrete state is no datum
    assert s.cost_x0[2] == 0.0


def test_multipliers_are_prices():
    m = mass(4)
    q, v = m.x[0], m.x[1]

    slow = np.array([1.0, -0.3])

    def bounded(low=-0.5, end=-0.2, most=0.2, x0=slow, far=None):
        ocp = problem(m, x0, tol=1e-11)
        if far is not None:
            # how far it is from where it began
            x = m.graph.inputs("x", 2 * 3)
            ocp.add_boundary(m.graph.function(x[3] - x[0], 6, 1, 3, "way"), far, far)
            return ocp
        ocp.add_path(m.function(v), low, np.inf, at="control_grid")
        ocp.add_terminal(m.function(v), end, end)
        ocp.set_control_bounds(-2, most)
        return ocp

    ocp = bounded()
    r = solved(ocp)
    found, h = ocp.multipliers(), 1e-4
    given = ocp.modes

    def difference(**moved):
        ends = []
        for sign in (1, -1):
            o = bounded(**{k: value + sign * h * along for k, (value, along) in moved.items()})
            o.set_modes(given)
            ends.append(solved(o).cost)
        return (ends[0] - ends[1]) / (2 * h)

    assert len(r.jumps) == 1
    for i in range(2):
        price = difference(x0=(slow, np.eye(2)[i]))
        assert found.costates[0][i] == pytest.approx(price, rel=1e-5, abs=1e-6)
        assert -found.initial_state[i] == pytest.approx(price, rel=1e-5, abs=1e-6)
    assert found.terminal[0].ravel() == pytest.approx([-difference(end=(-0.2, 1))], rel=1e-5)
    assert abs(found.terminal[0].ravel()[0]) > 0.01
    path = found.path[0].values
    assert path.sum() == pytest.approx(-difference(low=(-0.5, 1)), rel=1e-5) and abs(path.sum()) > 0.01
    assert found.controls.sum() == pytest.approx(-difference(most=(0.2, 1)), rel=1e-5, abs=1e-7) and found.controls.max() > 0.01
    # a stage that is cut has one multiplier, a path constraint of the grid both ends of every stage
    assert found.controls.shape == (STAGES, 1)
    assert found.path[0].times == pytest.approx(HORIZON * ((np.arange(2 * STAGES) + 1) // 2) / STAGES, abs=1e-9)
    # a constraint between both ends, which are in different parts
    far = r.trajectory(HORIZON)[0] - slow[0] - 0.02
    ocp = bounded(far=far)
    r = solved(ocp)
    given, found = ocp.modes, ocp.multipliers()
    assert len(r.jumps) == 1
    assert found.boundary[0].ravel() == pytest.approx([-difference(far=(far, 1))], rel=1e-5)
    assert found.costates[0][0] == pytest.approx(difference(x0=(slow, np.array([1.0, 0.0])), far=(far, 0)), rel=1e-5)


def test_costates_are_slopes_of_the_cost_to_come():
    """From a state at the start of a stage the rest of the horizon costs more by the costate, before the transition and behind it."""
    m = mass(5)
    ocp = problem(m, tol=1e-11)
    r = solved(ocp)
    costates, h = ocp.multipliers().costates, 1e-4
    assert costates.shape == (STAGES + 1, 3)
    (jump,) = r.jumps
    for k in range(1, STAGES):
        start = r.trajectory(HORIZON * k / STAGES)
        for i in range(2):
            ends = []
            for sign in (1, -1):
                rest = swb.Ocp(m, HORIZON * (1 - k / STAGES), STAGES - k, params=P0, control_bounds=(-2, 2), n_fe=2, n_s=3, tol=1e-11)
                rest.set_initial_state(start + sign * h * np.eye(3)[i])
                rest.set_lagrange(m.function(m.x[0] ** 2 + 0.5 * m.x[1] ** 2 + 0.2 * m.u[0] ** 2 + 0.1 * m.p[0] * m.x[0]))
                rest.set_mayer(m.function(2.0 * (m.x[0] - 0.2) ** 2))
                at = [swb.ModeTransition(jump.t - HORIZON * k / STAGES, 0, jump.stage - k)] if jump.stage >= k else []
                rest.set_modes(swb.Modes(np.zeros(1), np.zeros((1, 0)), None, tuple(at)))
                ends.append(solved(rest).cost)
            assert costates[k][i] == pytest.approx((ends[0] - ends[1]) / (2 * h), rel=1e-5, abs=1e-6), f"stage {k}, state {i}"
    x = r.trajectory(HORIZON)
    assert costates[-1][:2] == pytest.approx([4.0 * (x[0] - 0.2), 0.0], abs=1e-6)


def test_a_sequence_is_printed_compared_and_given_back():
    m = mass(6)
    ocp = problem(m)
    r = solved(ocp)
    modes = ocp.modes
    (jump,) = modes.transitions
    assert (jump.t, jump.transition, jump.stage) == (r.jumps[0].t, 0, r.jumps[0].stage)
    assert f"transition 0 in stage {jump.stage}" in str(modes)
    assert modes == ocp.modes and modes != swb.Modes(modes.times, modes.modes, modes.cells)
    other = problem(m)
    other.set_modes(modes)
    again = solved(other)
    assert again.cost == pytest.approx(r.cost, rel=1e-8) and other.modes.transitions[0].stage == jump.stage
    # the sequence is part of a document
    read = swb.Ocp.from_json(other.to_json())
    assert solved(read).cost == again.cost
    # what is given is what is solved, also where something else is better
    none = problem(m)
    none.set_modes(swb.Modes(np.zeros(1), np.zeros((1, 0))))
    without = none.solve()
    assert not without.success or not without.jumps or without.cost <= r.cost + 1e-6
    worse = problem(m)
    stage = next(k for k in range(STAGES) if k != jump.stage and abs(k - jump.stage) == 1)
    worse.set_modes(swb.Modes(np.zeros(1), np.zeros((1, 0)), None, (swb.ModeTransition(0.3 * stage + 0.15, 0, stage),)))
    found = solved(worse)
    assert found.cost >= r.cost - 1e-8
    worse.set_modes(None)
    assert solved(worse).cost == pytest.approx(r.cost, rel=1e-8)


def test_a_sequence_that_cannot_be_is_refused():
    m = mass()
    ocp = problem(m)
    one = np.zeros(1), np.zeros((1, 0))
    with pytest.raises(swb.RangeError, match="1 transitions"):
        ocp.set_modes(swb.Modes(*one, None, (swb.ModeTransition(0.5, 1, 1),)))
    with pytest.raises(swb.RangeError, match="4 stages"):
        ocp.set_modes(swb.Modes(*one, None, (swb.ModeTransition(0.5, 0, 4),)))
    with pytest.raises(swb.RangeError, match="earlier stage"):
        ocp.set_modes(swb.Modes(*one, None, (swb.ModeTransition(0.5, 0, 2), swb.ModeTransition(0.5, 0, 1))))
    # the transition arms nothing that would make it twice
    ocp.set_modes(swb.Modes(*one, None, (swb.ModeTransition(0.4, 0, 1), swb.ModeTransition(0.7, 0, 2))))
    with pytest.raises(swb.RangeError, match="cannot follow"):
        ocp.solve()
    ocp.set_modes(None)
    assert solved(ocp).jumps
    smooth = swb.Model(states="x", controls="u")
    smooth.derivatives = [smooth.u[0]]
    with pytest.raises(swb.RangeError, match="0 transitions"):
        swb.Ocp(smooth, 1.0, 2).set_modes(swb.Modes(*one, None, (swb.ModeTransition(0.5, 0, 1),)))


def test_a_sequence_with_modes_between_its_transitions():
    m = swb.Model(states="q v", controls="u")
    (q, v), u = m.x, m.u[0]
    braked = m.discrete("braked", 0)
    m.transition(q < 0.62, when={braked: 0}, reset={v: 0.6 * v}, to={braked: 1})
    m.derivatives = [v, u - q - 0.4 * v - 0.4 * swb.sign(v + 0.55) + 0.3 * braked]
    ocp = swb.Ocp(m, 1.2, 4, control_bounds=(-2, 2), initial_state=X0, n_fe=3, n_s=3)
    ocp.set_lagrange(m.function(q**2 + 0.5 * v**2 + 0.2 * u**2))
    r = solved(ocp)
    assert r.trajectory.switches and r.jumps
    modes = ocp.modes
    other = swb.Ocp(m, 1.2, 4, control_bounds=(-2, 2), initial_state=X0, n_fe=3, n_s=3)
    other.set_lagrange(m.function(q**2 + 0.5 * v**2 + 0.2 * u**2))
    other.set_control_guess(r.controls)
    other.set_modes(modes)
    again = solved(other)
    assert again.cost == pytest.approx(r.cost, rel=1e-7)
    assert again.stats.iterations < r.stats.iterations


def test_least_squares_at_the_grid_count_once_for_every_stage():
    m = mass(7)
    rng = np.random.default_rng(7)
    references = rng.uniform(0.4, 0.9, STAGES)
    ocp = problem(m, n_fe=4)
    ocp.add_least_squares(m.function(m.x[0]), [3.0], references[:, None], at="control_grid")
    r = solved(ocp)
    assert len(r.jumps) == 1
    base, run = cost(m, r.controls)
    ends = run(HORIZON * np.arange(1, STAGES + 1) / STAGES)[:, 0]
    assert r.cost == pytest.approx(base + 3.0 * np.sum((ends - references) ** 2), rel=1e-5)
    assert abs(r.accuracy.cost_error) < 1e-7


@pytest.mark.parametrize("norm, weight", [("linf", 0.2), ("l1", 0.2), ("l2", 2.0)])
def test_relaxed_constraints_of_the_grid_have_their_price(norm, weight):
    """A stage that a transition cuts has one price, and no constraint at the cut."""
    m = mass(8)
    slow, low = np.array([1.0, -0.3]), -0.35
    ocp = problem(m, slow, n_fe=4)
    ocp.add_relaxed(m.function(m.x[1]), low, np.inf, at="control_grid", norm=norm, weight=weight)
    r = solved(ocp)
    assert len(r.jumps) == 1 and 0.01 < r.jumps[0].t % 0.3 < 0.29

    def priced(controls):
        base, run = cost(m, controls, slow)
        v = np.concatenate([[slow[1]], run(HORIZON * np.arange(1, STAGES + 1) / STAGES)[:, 1]])
        missed = np.maximum(low - v, 0.0)
        by_stage = np.maximum(missed[:-1], missed[1:])
        prices = {"linf": missed.max(), "l1": by_stage.sum() * HORIZON / STAGES, "l2": (by_stage**2).sum() * HORIZON / STAGES}
        return base, weight * prices[norm], missed.max()

    base, price, violation = priced(r.controls)
    assert r.violation == pytest.approx(violation, abs=1e-6) and violation > 0.01
    assert r.cost == pytest.approx(base, rel=1e-5)
    rng = np.random.default_rng(8)
    for size in (1e-2, 1e-1):
        for _ in range(4):
            moved = priced(r.controls + size * rng.standard_normal(r.controls.shape))
            assert moved[0] + moved[1] > base + price


def test_a_grid_is_made_as_fine_as_asked_for():
    m = mass(9)
    coarse = problem(m, n_fe=1, n_s=2)
    first = solved(coarse)
    ocp = problem(m, n_fe=1, n_s=2, adapt_tol=1e-7)
    r = solved(ocp)
    # its states are simulated, so that the coarsest grid will do
    assert r.adaptation.reached and max(r.accuracy.worst, first.accuracy.worst) <= 1e-7
    base, run = cost(m, r.controls)
    assert r.cost == pytest.approx(base, rel=1e-5)
    assert np.abs(run.x_end[:2] - r.trajectory(HORIZON)[:2]).max() <= 2e-7
    # derivatives and warm starts are those of the grid that was reached
    assert np.isfinite(ocp.sensitivity().cost_p).all()
    again = solved(ocp, warm=True)
    assert again.cost == pytest.approx(r.cost, rel=1e-6) and again.accuracy.worst <= 1e-7
