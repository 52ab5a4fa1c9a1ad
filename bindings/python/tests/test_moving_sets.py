"""Projected systems by finite elements and in optimal control, beside the event engine."""

import csv
import importlib
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import switchback_control as swb

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "examples" / "python"))
moving_sets = importlib.import_module("moving_sets")


@pytest.mark.parametrize("problem", moving_sets.PROBLEMS, ids=lambda p: p.__name__)
def test_gallery(problem, tmp_path):
    m, ocp = problem()
    r = ocp.solve()
    assert r.success, r.message
    assert r.contacts is None
    assert r.polished == swb.Polished.DONE
    assert moving_sets.replay(m, r) < 1e-5
    assert r.optimality.verdict == "local_optimum", r.optimality.reason
    moving_sets.picture(m, r, tmp_path / "picture.svg")
    assert (tmp_path / "picture.svg").stat().st_size > 1000


def test_an_answer_that_is_no_optimum_is_not_certified():
    # implicit Euler on a coarse grid: the descent on simulations is followed, and its end is dearer than the optimum, too
    _, best = moving_sets.gate()
    _, ocp = moving_sets.gate(n_s=1, n_fe=2)
    r = ocp.solve()
    assert r.success and r.cost > 1.001 * best.solve().cost
    assert r.optimality.verdict == "not_optimal" and "off by" in r.message


def test_the_costs_are_those_in_c(tmp_path):
    program = Path(__file__).resolve().parents[3] / "build" / "examples_c_check" / "moving_sets"
    if not program.is_file():
        pytest.skip("the examples in C are not built: make check-examples")
    subprocess.run([program, tmp_path], check=True, capture_output=True)
    with (tmp_path / "c_moving_sets.csv").open(encoding="utf-8") as table:
        rows = list(csv.DictReader(table))
    assert [r["problem"] for r in rows] == [p.__name__ for p in moving_sets.PROBLEMS]
    for row, problem in zip(rows, moving_sets.PROBLEMS):
        assert float(row["cost"]) == pytest.approx(problem()[1].solve().cost, rel=1e-6), row["problem"]


def test_finite_elements_follow_the_events():
    m = swb.Projected("y", name="play")
    y, push = m.x[0], swb.sin(2 * m.t)
    m.f([0])
    m.constraint("upper", push - y + 0.5)
    m.constraint("lower", y - push + 0.5)
    exact = swb.simulate(m, [0.0], 6.0, rtol=1e-11, atol=1e-11)
    run = swb.simulate_fesd(m, [0.0], 6.0, 30)
    assert run.state[0] == pytest.approx(exact.x_end[0], abs=1e-6)
    assert len(run.trajectory.switches) == len(exact.switches)


def test_reset_maps_between_phases():
    def fall(states, f, horizon, stages, start=None):
        m = swb.Model(states=states, name="fall")
        m.derivatives = f(m.x)
        ocp = swb.Ocp(m, horizon, stages, initial_state=start) if start else swb.Ocp(m, horizon, stages)
        return m, ocp

    m, first = fall("h v", lambda x: [x[1], -9.81], 1.0, 1, [2.0, 0.0])
    first.set_free_time("stages", 0.1, 5.0)
    first.add_terminal(m.function(m.x[0]), [0.0], [0.0])
    _, second = fall("w", lambda x: [-9.81 + 0 * x[0]], 0.2, 2)
    both = swb.MultiPhase([first, second])
    with pytest.raises(swb.ArgumentError, match="phase must be"):
        both.link_reset(1, lambda x: x)
    both.link_reset(0, lambda x: [-0.5 * x[1]])
    r = both.solve()
    speed = np.sqrt(2 * 9.81 * 2.0)
    assert r.phases[1].trajectory(r.phases[1].trajectory.t_start)[0] == pytest.approx(0.5 * speed, abs=1e-7)
