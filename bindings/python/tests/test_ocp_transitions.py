"""Optimal control with hysteresis, automata and resets from Python."""

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

import switchback_control as swb

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "examples" / "python"))
hysteresis_car = importlib.import_module("hysteresis_car")


def test_car_with_hysteresis(tmp_path):
    ocp, turbo = hysteresis_car.car(10)
    r = ocp.solve()
    assert r.success and r.cost == pytest.approx(10.22925791133135711, abs=1e-9)
    assert [(j.transition, j.stage) for j in r.jumps] == [(0, 2), (1, 8)]
    assert r.accuracy.terminal < 1e-9
    off, on, again = r.discrete(turbo)
    assert (off.value, on.value, again.value) == (0, 1, 0)
    assert on.start == pytest.approx(3.0, abs=1e-9) and on.end == r.jumps[1].t
    assert r.jumps[0].before[2] == 0 and r.jumps[0].after[2] == 1
    assert len(r.table().splitlines()) == 3
    # the states of the answer say the same
    assert r.trajectory(5.0)[2] == 1.0 and r.trajectory(9.0)[2] == 0.0
    hysteresis_car.draw(r, turbo, tmp_path / "car.svg")
    assert (tmp_path / "car.svg").stat().st_size > 1000
    again = ocp.solve(warm=True)
    assert again.cost == pytest.approx(r.cost, abs=1e-9)


def test_automaton_and_gears_that_are_forbidden():
    m = swb.Model(states="q v", controls="u")
    (q, v), u = m.x, m.u[0]
    gear = swb.Automaton(m, states="first second third")
    for low, high, up, down in (("first", "second", 6, 4), ("second", "third", 12, 9)):
        gear.edge(low, high, when=v > up)
        gear.edge(high, low, when=v < down)
    m.derivatives = [v, u * gear.choose({"first": 3.0, "second": 2.0, "third": 1.0}) - 0.05 * v]

    def solve(highest):
        ocp = swb.Ocp(m, 12.0, 10, n_fe=2, initial_state=[0, 0], control_bounds=(-2, 2))
        ocp.set_state_bounds([-np.inf] * 3, [np.inf, np.inf, highest])
        ocp.set_free_time("horizon", 1, 60)
        ocp.set_mayer(m.function([m.t]))
        ocp.add_terminal(m.function([q, v]), [100, 0], [100, 0])
        return ocp.solve()

    free, bounded = solve(np.inf), solve(1)
    assert free.success and bounded.success and free.cost < bounded.cost
    assert "third" in [i.value for i in free.discrete(gear)]
    assert {i.value for i in bounded.discrete(gear)} <= {"first", "second"}


def test_documents_keep_the_problem():
    ocp, _ = hysteresis_car.car(10)
    again = swb.Ocp.from_json(ocp.to_json())
    r = again.solve()
    assert r.cost == ocp.solve().cost
    assert [i.value for i in r.discrete(2)] == [0, 1, 0]


def test_systems_without_transitions_have_none():
    m = swb.Model(states="x", controls="u")
    m.derivatives = [m.u[0]]
    ocp = swb.Ocp(m, 1.0, 2, initial_state=[0])
    ocp.set_lagrange(m.function([m.u[0] ** 2]))
    ocp.add_terminal(m.function([m.x[0]]), [1], [1])
    r = ocp.solve()
    assert r.jumps == [] and r.success


def test_wrong_input():
    ocp, _ = hysteresis_car.car(5)
    with pytest.raises(swb.DimensionError):
        ocp.set_initial_state([0.0])
    with pytest.raises(swb.DimensionError):
        ocp.set_state_bounds([0.0] * 4)
    ocp.set_initial_bounds([0, 0, 0], [0, 0, 1])
    with pytest.raises(swb.StateError, match="discrete"):
        ocp.solve()
    with pytest.raises(swb.StateError, match="discrete"):
        swb.MultiPhase([ocp]).solve()


def heating(cost_as_state):
    """A heater in a room whose cooler has a thermostat of its own."""
    m = swb.Model(states="T R c" if cost_as_state else "T R", controls="u")
    t, r, u = m.x[0], m.x[1], m.u[0]
    cooler = m.hysteresis(t, on=22, off=18)
    cost = 0.1 * u * u + (r - 19) ** 2
    m.derivatives = [-0.2 * (t - 15) + u - 2.0 * cooler, 0.3 * (t - r), *([cost] if cost_as_state else [])]
    return m, cost


def test_an_answer_with_hysteresis_is_certified():
    """What is called a local optimum is one: simulations of controls close to it cost more."""
    m, cost = heating(cost_as_state=False)
    ocp = swb.Ocp(m, 15.0, 15, n_fe=4, n_s=3, initial_state=[15, 15], control_bounds=(0, 3))
    ocp.set_lagrange(m.function(cost))
    r = ocp.solve()
    assert r.success and r.optimality.verdict == "local_optimum" and not r.optimality.kinks
    with_cost, _ = heating(cost_as_state=True)

    def simulated(u):
        return swb.simulate(with_cost, [15, 15, 0], 15.0, u=u, rtol=1e-10, atol=1e-10).x_end[2]

    best, rng = simulated(r.controls), np.random.default_rng(3)
    assert best == pytest.approx(r.cost, rel=1e-7)
    for size in (1e-3, 1e-2, 1e-1):
        for _ in range(5):
            moved = np.clip(r.controls + size * rng.standard_normal(r.controls.shape), 0, 3)
            assert simulated(moved) > best


def test_a_clock_at_the_start_leaves_a_verdict():
    # what comes before it has no length and no cost: the size of the cost is that of the whole horizon
    m = swb.Model(states="q v", controls="F", name="sampled")
    m.derivatives = [m.v, m.F - m.q + m.hold(-0.5 * m.v, 0.25)]
    ocp = swb.Ocp(m, 1.2, 4, lagrange=m.function(m.q**2 + m.F**2), initial_state=[1.0, -0.5], control_bounds=(-2, 2))
    r = ocp.solve()
    assert r.success and r.jumps[0].t == 0.0
    assert r.certificate == "local_optimum", r.optimality.reason
