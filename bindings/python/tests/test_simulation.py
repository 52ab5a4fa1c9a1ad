"""Simulation: reference values, sliding modes, trajectories, going on, refusals."""

import numpy as np
import pytest

import switchback_control as swb
from models import A_IN, A_OUT, OSCILLATOR_T, OSCILLATOR_X0, OSCILLATOR_XT, oscillator, sides


def test_oscillator():
    r = swb.simulate_fesd(oscillator(), OSCILLATOR_X0, OSCILLATOR_T, 10, n_s=5, n_fe=2)
    assert r.success and r.outcome == swb.Outcome.SOLVED and r.message == "solved"
    assert np.allclose(r.state, OSCILLATOR_XT, atol=1e-10) and r.time == pytest.approx(OSCILLATOR_T, abs=1e-14)
    t = r.trajectory
    assert len(t.switches) == 1
    s = t.switches[0]
    assert s.t == pytest.approx(1.0, abs=1e-10) and (s.before, s.after) == ((0,), (1,))
    assert s.kind == swb.SwitchKind.CROSS and s.subsystem == 0 and t.times[s.element] == pytest.approx(s.t)
    assert len(t) == t.n_elements == 20 and t.n_modes == (2,)
    assert t.times.shape == (21,) and t.states.shape == (21, 2) and t.steps.shape == (20,)
    assert np.allclose(np.diff(t.times), t.steps)
    assert t.active.shape == (20, 2) and t.active.sum(axis=1).tolist() == [1] * 20
    assert t.active_modes(0)[:, 0].sum() == s.element
    assert t.stage_times.shape == (20, 5) and t.stage_states.shape == (20, 5, 2) and t.stage_theta.shape == (20, 5, 2)
    assert np.allclose(t.stage_states[:, -1], t.states[1:]) and np.allclose(t.stage_theta.sum(axis=2), 1.0)
    assert r.stats.n_steps == 10 and r.stats.time_total > 0 and r.residuals.primal < 1e-8
    assert "switches" in repr(t)
    # dense output
    assert np.hypot(*t(0.3)) == pytest.approx(np.exp(-0.7), abs=1e-5)
    assert t([0.1, 0.2, 0.3]).shape == (3, 2) and t([[0.1], [0.2]]).shape == (2, 1, 2) and t([]).shape == (0, 2)
    assert np.allclose(t(t.times), t.states, atol=1e-12)
    for wrong in (1, -1, None, "a"):
        with pytest.raises(swb.ArgumentError):
            t.active_modes(wrong)
    for outside in (-0.1, 2.0, np.nan, None, "a"):
        with pytest.raises(swb.ArgumentError):
            t(outside)


@pytest.mark.parametrize(
    "modes",
    [
        lambda x: [A_IN @ x, A_OUT @ x],
        lambda x: np.concatenate([A_IN @ x, A_OUT @ x]),
        swb.Function(lambda x: [A_IN @ x, A_OUT @ x], 2, n_out=(2, 2), jacobian=lambda x: np.vstack([A_IN, A_OUT])),
        swb.Function.affine(np.zeros(4), np.vstack([A_IN, A_OUT]), nx=2),
    ],
)
def test_ways_to_give_modes(modes):
    r = swb.simulate_fesd(oscillator(modes), OSCILLATOR_X0, OSCILLATOR_T, 10, n_s=4)
    assert np.allclose(r.state, OSCILLATOR_XT, atol=1e-7)


def test_indicators():
    system = swb.System(2)
    system.add_subsystem_indicators(
        [lambda x: A_IN @ x, lambda x: A_OUT @ x], [lambda x: x @ x - 1, lambda x: 1 - x @ x]
    )
    r = swb.simulate_fesd(system, OSCILLATOR_X0, OSCILLATOR_T, 10, n_s=5)
    assert np.allclose(r.state, OSCILLATOR_XT, atol=1e-9)
    with pytest.raises(swb.ArgumentError, match="n_modes"):
        system.add_subsystem_indicators(lambda x: x, lambda x: x)


def test_sliding():
    # x' in -sign(x) + 0.2 sin(5 t): slides on x = 0 from t = 0.3 or so on
    r = swb.simulate_fesd(sides(1.0, -1.0, f0=lambda t: 0.2 * np.sin(5 * t)), [-0.3], 2.0, 20, n_s=3)
    assert r.success and r.state[0] == pytest.approx(0.0, abs=1e-9)
    assert [s.kind for s in r.trajectory.switches] == [swb.SwitchKind.ENTER]
    assert r.trajectory.switches[0].after == (0, 1) and r.trajectory.active[-1].all()
    t = r.trajectory.switches[0].t
    assert -0.3 + t + 0.2 / 5 * (1 - np.cos(5 * t)) == pytest.approx(0.0, abs=1e-7)


def test_sliding_mode_that_ends():
    # x' in t - sign(x) + ...: slides until the drift is stronger than the modes, at t = 1
    r = swb.simulate_fesd(sides(1.0, -1.0, f0=lambda t: t), [0.0], 2.0, 10, n_s=3)
    assert [s.kind for s in r.trajectory.switches][-1] == swb.SwitchKind.LEAVE
    assert r.trajectory.switches[-1].t == pytest.approx(1.0, abs=1e-8)
    assert r.state[0] == pytest.approx(0.5, abs=1e-8)


def test_going_on():
    with swb.Simulator(oscillator(), n_s=3) as sim:
        sim.set_state(OSCILLATOR_X0)
        assert sim.time == 0.0 and np.allclose(sim.state, OSCILLATOR_X0)
        assert sim.trajectory.n_elements == 0 and np.isnan(sim.trajectory.t_start)
        assert "empty" in repr(sim.trajectory)
        with pytest.raises(swb.StateError):
            sim.trajectory([0.0])
        with pytest.raises(swb.StateError):
            sim.trajectory.plot()
        for _ in range(4):
            assert sim.step(0.125) == swb.Outcome.SOLVED
        assert sim.run(0.75, 6) == swb.Outcome.SOLVED
        parts = sim.state
        assert sim.time == 1.25 and sim.stats.n_steps == 10 and sim.outcome == swb.Outcome.SOLVED
        sim.set_state(OSCILLATOR_X0, t=0.0)
        sim.run(1.25, 10)
        assert np.allclose(parts, sim.state, atol=1e-9)
        sim.set(n_s=2, cross="stage", tol=1e-8)
        assert sim.settings.n_s == 2 and sim.settings.cross == "stage"
        sim.settings = {"n_s": 4}
        assert sim.settings.cross == swb.Settings().cross
        kept = sim.trajectory
        sim.clear()
        assert len(sim.trajectory) == 0 and len(kept) > 0
        assert "t=1.25" in repr(sim)
    assert sim.closed and "closed" in repr(sim)
    sim.close()
    with pytest.raises(swb.StateError, match="closed"):
        sim.step(0.1)
    assert kept(0.5).shape == (2,)  # it is a copy


def test_time_controls_and_parameters():
    system = swb.System(1, 1, 1, f0=lambda x, u, p, t: u * p * np.cos(t) - x)
    r = swb.simulate_fesd(system, [0.5], 1.0, 5, t0=1.0, u=[2.0], p=[3.0], n_s=4)
    expected = 3 * (np.cos(2) + np.sin(2)) + (0.5 - 3 * (np.cos(1) + np.sin(1))) * np.exp(-1)
    assert r.state[0] == pytest.approx(expected, abs=1e-9)
    # controls of the steps
    u = [[2.0], [2.0], [0.0]]
    r = swb.simulate_fesd(swb.System(1, 1, f0=lambda x, u: u), [0.0], 3.0, 3, u=u)
    assert r.state[0] == pytest.approx(4.0) and r.controls.tolist() == u and r.control_times.tolist() == [0, 1, 2, 3]


@pytest.mark.parametrize("family", ["radau_iia", "gauss_legendre", "explicit"])
def test_families(family):
    r = swb.simulate_fesd(oscillator(), OSCILLATOR_X0, OSCILLATOR_T, 20, rk_family=family, n_s=4)
    assert r.success and np.allclose(r.state, OSCILLATOR_XT, atol=1e-3)


@pytest.mark.parametrize(
    "x0", [[1.0], [1.0, 2.0, 3.0], [np.nan, 0.0], [np.inf, 0.0], None, "ab", [None, 1], 1j, [[1.0, [2.0]]], {}]
)
def test_wrong_states(x0):
    with pytest.raises(swb.ArgumentError):
        swb.simulate_fesd(oscillator(), x0, 1.0, 10)


@pytest.mark.parametrize(
    "duration, n_steps",
    [
        (np.nan, 10),
        (np.inf, 10),
        (-1.0, 10),
        (1.0, -1),
        (1.0, 0),
        (None, 10),
        (1.0, None),
        (1.0, 2.5),
        ("a", 1),
        (1.0, 2**80),
    ],
)
def test_wrong_steps(duration, n_steps):
    with pytest.raises(swb.ArgumentError):
        swb.simulate_fesd(oscillator(), OSCILLATOR_X0, duration, n_steps)


def test_wrong_controls_and_parameters():
    system = swb.System(1, 2, 1, f0=lambda x, u: u[:1])
    for keywords in (
        {},
        {"u": [1.0]},
        {"u": [1, 2]},
        {"u": [1, 2], "p": [1, 2]},
        {"u": [1, np.nan], "p": [1]},
        {"u": [[1, 2]] * 3, "p": [1]},
    ):
        with pytest.raises(swb.ArgumentError):
            swb.simulate_fesd(system, [0.0], 1.0, 2, **keywords)


def test_wrong_systems():
    for system in (None, "system", oscillator):
        with pytest.raises(swb.ArgumentError, match="must be a System"):
            swb.simulate_fesd(system, [0.0], 1.0, 1)
    with pytest.raises(swb.StateError):
        swb.Simulator(swb.System(2))  # without dynamics
    for sizes in ((0,), (-1,), (1, -1), ("",), ("a a",), (1.5,), (None,)):
        with pytest.raises(swb.ArgumentError):
            swb.System(*sizes)
    system = swb.System(2)
    f, psi = [lambda x: x, lambda x: -x], lambda x: x[0]
    for arguments in (
        (f, psi, [-1, 2]),
        (f, psi, [1, 1]),
        (f, psi, [[-1, 1, 0]]),
        (f, psi, [[-1], [1, 2]]),
        (f, psi, "ab"),
        (f, psi, None),
        (f, psi, [-1, 1], [0, 0]),
        (f, psi, [-1, 1], [0, 2]),
        (f, psi, [-1, 1], [0.5]),
        (f, None, [-1, 1]),
        (None, psi, [-1, 1]),
        (f[:1], psi, [-1, 1]),
        (f * 2, psi, [-1, 1]),
        ([[1, 2, 3], [4, 5, 6]], psi, [-1, 1]),
    ):
        with pytest.raises(swb.ArgumentError):
            system.add_subsystem(*arguments)
    assert system.n_subsystems == 0 and system.add_subsystem(f, psi, [-1, 1]) == 0


def test_modes_that_return_too_much():
    system = swb.System(2)
    system.add_subsystem([lambda x: [1, 2, 3], lambda x: x], lambda x: x[0], [-1, 1])
    with pytest.raises(swb.DimensionError, match=r"modes\[0\]"):
        swb.simulate_fesd(system, [1.0, 1.0], 1.0, 2)


def test_inclusion_in_steps():
    # x reaches 0 at 0.3 and slides with alpha = 2/3
    system = swb.System(2)
    system.add_inclusion(lambda x: [1 - 1.5 * x[2], x[2] * x[3] - 0.5], lambda x: [x[0], x[1]], n_psi=2)
    r = swb.simulate_fesd(system, [-0.3, 0.4], 1.5, 5, n_fe=3)
    assert r.state == pytest.approx([0, 0.45], abs=1e-8)
    assert [s.t for s in r.trajectory.switches] == pytest.approx([0.3], abs=1e-8)


def test_algebraic_equation():
    # x' = z, 0 = z + x
    system = swb.System(2, f0=lambda x: [x[1], 0])
    system.set_algebraic(1, lambda x: [x[0] + x[1]])
    r = swb.simulate_fesd(system, [1.0, 0.0], 1.0, 10, n_s=3)
    assert r.state == pytest.approx([np.exp(-1), -np.exp(-1)], abs=1e-9)
    with pytest.raises(swb.DimensionError, match="one at least must have a derivative"):
        system.set_algebraic(2)
