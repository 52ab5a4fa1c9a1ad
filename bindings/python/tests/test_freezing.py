"""Time-freezing of scenes from Python."""

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

import switchback_control as swb

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "examples" / "python"))
time_freezing = importlib.import_module("time_freezing")


def test_particle_with_friction():
    scene = time_freezing.particle()
    m = scene.freeze(step=0.1, speed=4.4, a_n=9.81)
    assert m.clock == 4 and len(m.depths) == 0 and len(m.costs) == 0 and m.speed is None
    assert "floor: inelastic, friction in the plane" in m.freeze_report
    results = time_freezing.simulate(m, 10)
    assert all(r.success for r in results)
    x = results[-1].state
    assert x[m.clock] == pytest.approx(2.25, abs=1e-7)
    assert x[:4] == pytest.approx([6.424125, 1.37953125, 8.3925, 5.518125], abs=1e-5)
    tau, states = time_freezing.sampled(results)
    t, physical = m.physical(tau, states)
    assert np.all(np.diff(t) >= -1e-9) and physical.shape[1] == 4
    # both sides of the impact, and nothing in between
    near = physical[np.abs(t - 0.4515236409857309) < 1e-6]
    assert near[0, 3] < -4.3 and near[-1, 3] > -0.1 and len(near) <= 4


def test_restitution_costs_and_speed_of_time():
    s = swb.Scene("y", u="f", name="ball")
    s.inertia([2.0])
    s.force([2.0 * (s.u[0] - 9.81)])
    s.contact("floor", gap=s.q[0], e=0.5)
    m = s.freeze(step=0.2, costs=[s.u[0] ** 2, 1.0], speed_of_time=True)
    assert (m.nx, m.nu, m.clock, list(m.depths), list(m.costs)) == (6, 2, 3, [2], [4, 5])
    r = swb.simulate_fesd(m, m.start([1, 0]), 0.35, 14, u=[0.5, 2.0], n_s=3, n_fe=2)
    run = s.simulate([1], [0], r.state[m.clock], u=[0.5], rtol=1e-10, atol=1e-10)
    assert len(run.impacts) == 1 and r.state[:2] == pytest.approx(run.x_end, abs=1e-4)
    assert r.state[4] == pytest.approx(0.25 * r.state[3]) and r.state[5] == pytest.approx(r.state[3])


def test_wrong_input():
    s = time_freezing.particle()
    with pytest.raises(swb.RangeError, match="step"):
        s.freeze(step=0)
    with pytest.raises(swb.DimensionError):
        s.freeze(at=[0.0])
    with pytest.raises(swb.DimensionError):
        s.freeze(costs=[s.q])
    m = s.freeze()
    with pytest.raises(swb.DimensionError):
        m.physical([0.0], np.zeros((1, 2)))
    with pytest.raises(swb.DimensionError):
        m.start([0.0])
