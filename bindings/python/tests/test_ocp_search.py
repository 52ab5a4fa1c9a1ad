"""Mode sequences, several starts and adapted grids of optimal control problems."""

import numpy as np
import pytest
from models import tutorial

import switchback_control as swb
from switchback_control.expr import Model, sign


def controlled(lagrange=None, **options):
    """From 1 to -1 against x' = u - sign x, by expressions but for `lagrange`."""
    m = Model(states="x", controls="u")
    m.derivatives = [m.u[0] - sign(m.x[0])]
    effort = lagrange or m.function([m.u[0] * m.u[0] + m.x[0] * m.x[0]])
    options = {"n_fe": 2, **options}
    ocp = swb.Ocp(m, 4.0, 4, lagrange=effort, initial_state=[1.0], control_bounds=(-3, 3), **options)
    ocp.add_terminal(m.function([m.x[0]]), -1.0, -1.0)
    return ocp


def test_modes_lead_back_to_the_solution():
    ocp = tutorial(n_stages=4, n_fe=2)
    first = ocp.solve()
    modes = ocp.modes
    assert modes.times[0] == 0 and modes.modes.shape == (len(modes.times), 2) and modes.modes.any(axis=1).all()
    ocp.set_modes(modes)
    again = ocp.solve()
    assert again.success and np.isclose(again.cost, first.cost, rtol=1e-9)
    assert np.array_equal(ocp.modes.modes, modes.modes)
    # two phases by hand: left of the switch, then right of it
    switch = first.trajectory.switches[0].t
    ocp.set_modes(swb.Modes([0.0, switch], [modes.modes[0], modes.modes[-1]]))
    assert np.isclose(ocp.solve().cost, first.cost, rtol=1e-9)
    ocp.set_modes(None)
    assert ocp.solve().cost == first.cost
    with pytest.raises(swb.RangeError):
        ocp.set_modes(swb.Modes([0.5], [modes.modes[0]]))
    with pytest.raises(swb.DimensionError):
        ocp.set_modes(swb.Modes([0.0, 1.0], [modes.modes[0]]))


def test_starts_do_not_depend_on_the_number_of_threads():
    with pytest.raises(swb.DimensionError):
        controlled().solve_starts(np.zeros((2, 2, 1)))
    results = []
    for threads in (1, 3):
        ocp = controlled()
        u = ocp.random_starts(4, seed=3)
        assert u.shape == (4, 4, 1) and np.array_equal(u, ocp.random_starts(4, seed=3)) and (abs(u) <= 3).all()
        s = ocp.solve_starts(u, threads=threads)
        assert len(s.starts) == 4 and ocp.result.cost == s.starts[s.best].cost == min(k.cost for k in s.starts)
        results.append([(k.cost, k.controls.tobytes()) for k in s.starts])
    assert results[0] == results[1]


def test_starts_with_python_functions_run_on_the_thread_of_the_caller():
    import threading

    seen = set()

    def cost(u):
        seen.add(threading.get_ident())
        return u[0] ** 2

    ocp = controlled(lagrange=cost)
    s = ocp.solve_starts(3, threads=2)
    assert all(k.error is None for k in s.starts) and seen == {threading.get_ident()}
    steps = []
    ocp.on_iteration(lambda i: steps.append(i) or len(steps) > 3)
    s = ocp.solve_starts(3)
    assert len(steps) == 4 and all(k.outcome == swb.Outcome.STOPPED for k in s.starts)

    def broken(u):
        raise ValueError("no cost today")

    with pytest.raises(ValueError, match="no cost today"):
        controlled(lagrange=broken).solve_starts(2)


def test_the_grid_follows_the_error():
    ocp = controlled(adapt_tol=1e-9, n_s=2)
    r = ocp.solve()
    a = r.adaptation
    assert a.reached and r.accuracy.worst <= 1e-9 and a.rounds[a.kept].error <= 1e-9
    assert a.rounds[0].elements == [2, 2, 2, 2] and len(a.rounds) > 1
    ocp.set(adapt_tol=0.0)
    assert ocp.solve().adaptation is None


def test_modes_of_a_smooth_system_are_none_and_can_be_given():
    m = Model(states="x", controls="u")
    m.derivatives = [m.u[0] - m.x[0]]
    ocp = swb.Ocp(m, 1.0, 4, lagrange=m.function(m.u[0] ** 2 + m.x[0] ** 2), initial_state=[1.0])
    first = ocp.solve()
    assert ocp.modes.modes.shape[1] == 0
    ocp.set_modes(ocp.modes)
    assert ocp.solve().cost == pytest.approx(first.cost, rel=1e-9)
    # of a system that switches they are not enough
    other = controlled()
    with pytest.raises(swb.DimensionError):
        other.set_modes(ocp.modes)
        other.solve()


def test_grids_of_projected_systems_are_adapted_in_words():
    m = swb.Projected("q v", u="u", name="play")
    q, v = m.x
    m.f([v, m.u[0] - q])
    m.constraint("wall", q - 0.5)
    options = {"adapt_tol": 1e-6, "n_fe": 1, "n_s": 2, "initial_state": [1.0, -0.5], "control_bounds": (-2, 2)}
    r = swb.Ocp(m, 1.2, 4, lagrange=m.function(q**2 + v**2 + m.u[0] ** 2), **options).solve()
    assert r.success and r.adaptation.rounds
    assert r.adaptation.reached == (r.accuracy.worst <= 1e-6)
