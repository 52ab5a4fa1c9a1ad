"""Event-driven simulation: known solutions, stepping, derivatives, batches, plots, refusals."""

import math
import threading

import numpy as np
import pytest

import switchback_control as swb
from models import OMEGA, OSCILLATOR_T, OSCILLATOR_X0, OSCILLATOR_XT, oscillator, sides
from switchback_control.expr import Model, sign, sin


def oscillator_model():
    m = Model(states="x y")
    x, y = m.x
    m.derivatives = [x - OMEGA * y * sign(x * x + y * y - 1), y + OMEGA * x * sign(x * x + y * y - 1)]
    return m


@pytest.mark.parametrize("make", [oscillator, oscillator_model])
def test_oscillator(make):
    r = swb.simulate(make(), OSCILLATOR_X0, OSCILLATOR_T, rtol=1e-11, atol=1e-11)
    assert r.success and r.outcome == swb.RunOutcome.REACHED and r.reason == ""
    assert np.allclose(r.x_end, OSCILLATOR_XT, atol=1e-9)
    (s,) = r.switches
    assert s.t == pytest.approx(1.0, abs=1e-10) and s.kind == swb.EventKind.CROSS
    assert {s.before, s.after} == {(0,), (1,)} and s.unique and not s.simultaneous and s.subsystem == 0
    assert abs(s.transversality) == pytest.approx(1 / np.hypot(1, OMEGA), abs=1e-9)
    assert r.t[0] == 0.0 and r.t[-1] == OSCILLATOR_T and r.x.shape == (len(r.t), 2) and s.t in r.t
    assert np.allclose(r.x[-1], r.x_end, atol=1e-14) and np.allclose(r.x[0], OSCILLATOR_X0)
    t = np.linspace(0.0, OSCILLATOR_T, 50)
    radius = np.where(t < 1.0, np.exp(t - 1.0), np.exp(t - 1.0))
    assert np.allclose(np.hypot(*r(t).T), radius, atol=1e-9)
    assert np.allclose(r([[0.3], [0.4]], 1).shape, (2, 1, 2))
    assert r.active() == [(0.0, s.t, s.before), (s.t, OSCILLATOR_T, s.after)]
    assert r.stats.steps == len(r.t) - 1 and r.stats.switches == 1
    assert r.table().count("\n") == 1 and "cross" in r.table() and "1 switch" in repr(r)


def test_sliding_and_one_sided_numbers():
    r = swb.simulate(sides(1.0, -1.0, f0=lambda t: 0.6 * t), [-0.5], (0.0, 3.0), rtol=1e-10)
    kinds = [s.kind for s in r.switches]
    assert kinds == [swb.EventKind.ENTER, swb.EventKind.LEAVE]
    # the weight of the mode below vanishes where 0.6 t = 1
    assert r.switch_times[1] == pytest.approx(1 / 0.6, abs=1e-9)
    assert r(1.0)[0] == pytest.approx(0.0, abs=1e-13)
    assert [m for _, _, m in r.active()] == [(0,), (0, 1), (1,)]


def test_derivatives():
    # x' = p + u - sign x from below: the surface is reached at -x0 / (p + u + 1)
    m = Model(states="x", controls="u", parameters="p")
    m.derivatives = [m.p[0] + m.u[0] - sign(m.x[0])]
    r = swb.simulate(m, [-1.0], 2.0, u=[1.0], p=[2.0], rtol=1e-12, atol=1e-12, sensitivity=True)
    assert r.x_end[0] == pytest.approx(2.0 * (2.0 - 0.25), abs=1e-11)
    assert r.dx_dx0[0, 0] == pytest.approx(0.5, abs=1e-11)
    assert np.allclose(r.switch_derivatives, [[-0.25, -1 / 16, -1 / 16]], atol=1e-11)
    slope = 2.0 - 0.25 + 2.0 / 16
    assert r.dx_dp[0, 0] == pytest.approx(slope, abs=1e-10) and r.dx_du[0, 0] == pytest.approx(slope, abs=1e-10)
    inputs = swb.simulate(m, [-1.0], 2.0, u=[1.0], p=[2.0], rtol=1e-12, atol=1e-12, sensitivity="inputs")
    assert inputs.dx_dx0 is None and inputs.dx_dp == r.dx_dp and inputs.dx_du == r.dx_du
    assert (inputs.switch_derivatives == r.switch_derivatives[:, 1:]).all()
    with pytest.raises(swb.ArgumentError, match="off, on, inputs"):
        swb.simulate(m, [-1.0], 2.0, u=[1.0], p=[2.0], sensitivity="parameters")
    # a model without inputs has derivatives by them too: those without columns
    alone = swb.Model("x")
    alone.derivatives = [-1.0 * alone.x[0]]
    none = swb.simulate(alone, [1.0], 1.0, sensitivity="inputs")
    assert none.dx_dx0 is None and none.dx_dp is None and none.dx_du is None
    none._do("sensitivity", None, 0)
    with pytest.raises(swb.DimensionError):
        none._do("sensitivity", np.empty(1).ctypes.data, 1)
    for nonsense in (3, -1, 0.5, [1]):
        with pytest.raises(swb.ArgumentError):
            swb.simulate(m, [-1.0], 2.0, u=[1.0], p=[2.0], sensitivity=nonsense)
    with swb.Integrator(m, rtol=1e-12, atol=1e-12, adjoint="on") as i:
        i.set_controls([1.0])
        i.set_params(2.0)
        i.reinit([-1.0])
        i.advance(2.0)
        g = i.adjoint([1.0])
        assert np.allclose([g.x0, g.p, g.u], [[0.5], [slope], [slope]], atol=1e-10)
        g = i.adjoint([0.0], switches={0: 1.0})
        assert np.allclose([g.x0, g.p, g.u], [[-0.25], [-1 / 16], [-1 / 16]], atol=1e-10)
        with pytest.raises(swb.RangeError):
            i.adjoint([0.0], switches={3: 1.0})
        with pytest.raises(swb.RangeError):
            i.adjoint([0.0], at=[(0.123, [1.0])])
    assert swb.simulate(m, [-1.0], 2.0, u=[1.0], p=[2.0]).dx_dx0 is None


def test_stepping():
    seen = []
    with swb.Integrator(oscillator(), h_max=0.2, on_step=seen.append) as i:
        assert i.active() == ()
        i.reinit(OSCILLATOR_X0)
        assert i.step(OSCILLATOR_T) == swb.ProgressKind.STEPPED and i.time > 0.0
        t = i.time
        assert np.allclose(i.get_dky(t), i.state, atol=1e-13) and np.allclose(i.get_dky(t, 1), i.derivative, atol=1e-5)
        i.set_stop_times([0.5, 0.25])
        assert i.advance(0.75) == swb.RunOutcome.REACHED and i.time == 0.75 and i.active() == (0,)
        assert [s.t for s in seen if s.kind == swb.ProgressKind.STOP_TIME] == [0.25, 0.5]
        assert i.advance(OSCILLATOR_T) == swb.RunOutcome.REACHED
        assert sum(s.kind == swb.ProgressKind.SWITCHED for s in seen) == 1 and i.active() == (1,)
        assert len(seen) == i.stats.steps == seen[-1].steps
        assert np.allclose(i.state, OSCILLATOR_XT, atol=1e-6)
        with pytest.raises(swb.RangeError):
            i.advance(0.1)
        run = i.run
    assert run.t.tolist() == [OSCILLATOR_T] and len(run.switches) == 1
    with pytest.raises(swb.StateError):
        run(0.5)


def test_states_at_times():
    run = swb.simulate(oscillator(), OSCILLATOR_X0, OSCILLATOR_T)
    with swb.Integrator(oscillator()) as i:
        i.reinit(OSCILLATOR_X0)
        times = [0.0, 0.3, 0.3, 1.0, 1.2, OSCILLATOR_T]
        x = i.sample(times)
        assert x.shape == (6, 2) and np.array_equal(x[0], OSCILLATOR_X0) and i.time == OSCILLATOR_T
        assert np.allclose(x, run(times), rtol=0, atol=1e-13) and np.allclose(x[-1], i.state, rtol=0, atol=1e-13)
        assert i.stats.steps == run.stats.steps  # none ends for them
        assert i.sample([]).shape == (0, 2) and i.sample(OSCILLATOR_T + 0.1).shape == (1, 2)
        for nonsense in ([0.1], [9.0, 8.0], [np.nan]):
            with pytest.raises(swb.RangeError):
                i.sample(nonsense)
        with pytest.raises(swb.DimensionError):
            i.sample([[9.0]])
        with pytest.raises(AttributeError, match="sample"):
            i.t_eval
    # what is not reached is not known
    with swb.Integrator(oscillator(), h_max=0.1, on_step=lambda s: s.t > 0.4) as i:
        i.reinit(OSCILLATOR_X0)
        x = i.sample([0.2, 1.0])
        assert i.outcome == swb.RunOutcome.STOPPED and np.isfinite(x[0]).all() and np.isnan(x[1]).all()
    # pieces of one step: impacts that accumulate are passed by time stepping, states that jump are those before
    m = swb.Model(states=["q", "v"])
    m.derivatives = [m.v, -1.0]
    m.transition(m.q < 0, reset={m.v: -0.5 * m.v})
    starts, times = [0.5, 0.0], np.linspace(0.0, 5.0, 101)
    run = swb.simulate(m, starts, 5.0)
    with swb.Integrator(m) as i:
        i.reinit(starts)
        x = i.sample(times)
        assert i.outcome == run.outcome
        known = times <= i.time
        assert np.allclose(x[known], run(times[known]), rtol=0, atol=1e-9) and np.isnan(x[~known]).all()


def test_stops():
    r = swb.simulate(oscillator(), OSCILLATOR_X0, 1.0, on_step=lambda s: s.t > 0.4, h_max=0.1)
    assert not r.success and r.outcome == swb.RunOutcome.STOPPED and 0.4 < r.t_end < 0.6 and r.reason
    with swb.Integrator(sides(1.0, 1.0), h_max=1e-4) as i:
        i.reinit([0.0])
        timer = threading.Timer(0.1, i.interrupt)
        timer.start()
        assert i.advance(1e6) == swb.RunOutcome.STOPPED
        timer.join()
        assert i.advance(i.time + 1e-3) == swb.RunOutcome.REACHED

    def broken(step):
        raise ZeroDivisionError("mine")

    with pytest.raises(ZeroDivisionError, match="mine"):
        swb.simulate(oscillator(), OSCILLATOR_X0, 1.0, on_step=broken)


def test_early_ends_say_why():
    r = swb.simulate(swb.System(1, f0=lambda x: x * x), [1.0], 2.0)
    assert r.outcome == swb.RunOutcome.STEP_TOO_SMALL and r.t_end == pytest.approx(1.0, abs=1e-4)
    assert "rounding" in r.reason
    r = swb.simulate(oscillator(), OSCILLATOR_X0, 1.0, max_steps=3)
    assert r.outcome == swb.RunOutcome.MAX_STEPS and "3 steps" in r.reason
    r = swb.simulate(sides(-1.0, 1.0), [0.0], 1.0, ambiguity="stop")
    assert r.outcome == swb.RunOutcome.AMBIGUOUS and r.t_end == 0.0


def test_choices():
    system = sides(-1.0, 1.0)
    assert swb.simulate(system, [0.0], 1.0, preferred={0: [1]}).x_end[0] == pytest.approx(1.0)
    assert swb.simulate(system, [0.0], 1.0, preferred={0: [0]}).x_end[0] == pytest.approx(-1.0)
    seen = []

    def up(b):
        seen.append(b)
        return b.active.index([(1,)])

    r = swb.simulate(system, [0.0], 1.0, on_branching=up)
    assert r.x_end[0] == pytest.approx(1.0) and len(seen) == 1 and seen[0].x.tolist() == [0.0]
    assert seen[0].velocity.shape == (len(seen[0].active), 1)
    (b,) = r.branch_points
    assert b.t == 0.0 and b.n_continuations == len(seen[0].active) and seen[0].active[b.taken] == [(1,)]
    r = swb.simulate(system, [0.0], 1.0, on_branching=lambda b: None)
    assert r.outcome == swb.RunOutcome.AMBIGUOUS and r.branch_points[0].taken is None

    def broken(b):
        raise ZeroDivisionError("mine")

    with pytest.raises(ZeroDivisionError):
        swb.simulate(system, [0.0], 1.0, on_branching=broken)
    with pytest.raises(swb.RangeError):
        swb.simulate(system, [0.0], 1.0, preferred={0: [2]})
    with pytest.raises(swb.DimensionError):
        swb.simulate(system, [0.0], 1.0, preferred={1: [0]})


def test_accumulating_switches():
    # every round about the origin takes a fixed part of the time of the one before
    m = Model(states="x y")
    x, y = m.x
    m.derivatives = [-sign(x) + 2 * sign(y), -2 * sign(x) - sign(y)]
    r = swb.simulate(m, [1.0, 0.3], 5.0, zeno="stop")
    assert r.outcome == swb.RunOutcome.ZENO and r.t_end == pytest.approx(0.65, abs=1e-9) and "accumulate" in r.reason
    assert all(a.t == pytest.approx(0.65, abs=1e-9) for a in r.accumulations) and r.stats.accumulations == 1
    r = swb.simulate(m, [1.0, 0.3], 5.0)
    assert r.success and np.allclose(r.x_end, 0.0, atol=1e-9) and len(r.active(0)[-1][2]) == 2
    limited = swb.simulate(m, [1.0, 0.3], 5.0, max_switches=4)
    assert len(limited.switches) == 4 and limited.stats.switches == r.stats.switches


def test_user_functions_that_fail():
    def f0(x):
        if x[0] > 0.5:
            raise KeyError("beyond")
        return 1.0

    with pytest.raises(KeyError, match="beyond"):
        swb.simulate(swb.System(1, f0=f0), [0.0], 1.0)


def test_controls_in_pieces():
    system = swb.System(1, 1, f0=lambda u: u)
    r = swb.simulate(system, [0.0], 3.0, u=[[1.0], [-2.0], [0.5]])
    assert r.x_end[0] == pytest.approx(-0.5, abs=1e-13) and r(1.0)[0] == pytest.approx(1.0, abs=1e-13)


def test_tolerances_state_by_state():
    r = swb.simulate(oscillator(), OSCILLATOR_X0, 0.5, rtol=[1e-4, 1e-10], atol=1e-10)
    loose = swb.simulate(oscillator(), OSCILLATOR_X0, 0.5, rtol=1e-4, atol=1e-4)
    assert r.stats.steps > loose.stats.steps
    assert swb.simulate(oscillator(), OSCILLATOR_X0, 0.5, method="radau5").stats.newton > 0
    logged = []
    swb.simulate(oscillator(), OSCILLATOR_X0, 1.5, log_level="debug", on_log=lambda *a: logged.append(a))
    assert [level for level, _ in logged] == ["debug", "info"] and logged[0][1].startswith("switch t = ")


def test_batch():
    m = oscillator_model()
    starts = np.array([[np.exp(-1.0) * a, 0.0] for a in np.linspace(0.5, 1.5, 9)])
    batches = [swb.simulate_batch(m, starts, 1.5, threads=n, rtol=1e-9) for n in (1, 2, 0)]
    for b in batches[1:]:
        assert np.array_equal(b.x, batches[0].x)
    assert batches[0].success.all() and len(batches[0]) == 9 and len(list(batches[0])) == 9
    one = swb.simulate(m, starts[3], 1.5, rtol=1e-9)
    assert np.array_equal(one.x_end, batches[0].x[3]) and batches[0][3].switches == one.switches
    with pytest.raises(IndexError):
        batches[0][9]
    system = swb.System(1, 0, 1, f0=lambda p: p)
    b = swb.simulate_batch(system, [[0.0], [1.0]], 2.0, p=[3.0, 4.0], threads=2)
    assert np.allclose(b.x, [[6.0], [9.0]])
    assert np.allclose(swb.simulate_batch(system, [[0.0], [1.0]], 2.0, p=[3.0]).x, [[6.0], [7.0]])
    late = Model(states="x")
    late.derivatives = [late.x[0] ** 2]
    b = swb.simulate_batch(late, [[0.1], [1.0]], 2.0)
    assert b.success.tolist() == [True, False] and b[1].outcome == swb.RunOutcome.STEP_TOO_SMALL


def test_runs_of_a_batch_do_not_depend_on_those_before():
    """Runs that turn stiff, slide with order two, and end early, one engine after the other: the bits of single runs."""
    stiff = Model(states=3, parameters=1)
    x, p = stiff.x, stiff.p
    stiff.derivatives = [x[1], -sign(x[0]) - 2 * p[0] * sign(x[1]) + 0.1 * x[2], 1e4 * (sin(x[0]) - x[2])]
    late = Model(states=2, parameters=1)
    late.derivatives = [late.x[0] ** 2 * late.p[0], -3 * sign(late.x[1])]
    for m, dims, end in ((stiff, 3, 6.0), (late, 2, 2.0)):
        system = m.system()
        starts = [[math.cos(1.3 * i + 2.1 * j) for j in range(dims)] for i in range(12)]
        params = [[0.05 + 0.03 * (i % 5)] for i in range(12)]
        for options in ({"dense": False}, {"dense": False, "sensitivity": True}, {"dense": True}):
            given = {"rtol": 1e-7, **options}
            batches = [swb.simulate_batch(system, starts, end, p=params, threads=n, **given) for n in (1, 2)]
            for i, (start, p) in enumerate(zip(starts, params)):
                one = swb.simulate(system, start, end, p=p, **given)
                for batch in batches:
                    assert np.array_equal(batch.x[i], one.x_end) and batch[i].switches == one.switches
                    assert batch[i].stats.evaluations == one.stats.evaluations
                    if "sensitivity" in options:
                        assert np.array_equal(batch[i].dx_dp, one.dx_dp, equal_nan=True)


def test_surfaces():
    assert oscillator().surfaces([0.5, 0.5]) == pytest.approx([-0.5])
    system = swb.System(1)
    system.add_subsystem_indicators([[1.0], [2.0], [3.0]], lambda x: [x[0], -x[0], 9.0])
    assert np.allclose(system.surfaces([1.0]), [2.0, np.nan, np.nan], equal_nan=True)
    with pytest.raises(swb.DimensionError):
        system.surfaces([1.0], subsystem=1)


def test_plots(tmp_path):
    plt = pytest.importorskip("matplotlib.pyplot")
    r = swb.simulate(oscillator(), OSCILLATOR_X0, OSCILLATOR_T)
    r.plot(tmp_path / "time.svg", names=["a", "b"], title="over time")
    r.plot_phase(tmp_path / "phase.svg", grid=40)
    figure = r.plot_phase(grid=40)
    # the surface is a circle of radius one
    plt.close(figure)
    lines = [p.vertices for c in figure.axes[0].collections for p in c.get_paths() if len(p.vertices)]
    assert len(lines) == 1 and np.allclose(np.hypot(*lines[0].T), 1.0, atol=2e-2)
    assert (tmp_path / "time.svg").stat().st_size > 1000 and (tmp_path / "phase.svg").stat().st_size > 1000
    with pytest.raises(swb.StateError):
        swb.simulate(oscillator(), OSCILLATOR_X0, 1.0, dense=False).plot()
    with pytest.raises(swb.DimensionError):
        r.plot_phase(states=[0, 5])


@pytest.mark.parametrize(
    "error, arguments, keywords",
    [
        (swb.DimensionError, ([1.0], 1.0), {}),
        (swb.RangeError, ([np.nan, 0.0], 1.0), {}),
        (swb.RangeError, (OSCILLATOR_X0, (1.0, 0.5)), {}),
        (swb.RangeError, (OSCILLATOR_X0, np.nan), {}),
        (swb.DimensionError, (OSCILLATOR_X0, (0.0, 1.0, 2.0)), {}),
        (swb.RangeError, (OSCILLATOR_X0, 1.0), {"rtol": -1.0}),
        (swb.RangeError, (OSCILLATOR_X0, 1.0), {"rtol": [1e-3, -1.0]}),
        (swb.DimensionError, (OSCILLATOR_X0, 1.0), {"atol": [1e-3, 1e-3, 1e-3]}),
        (swb.OptionError, (OSCILLATOR_X0, 1.0), {"method": "euler"}),
        (swb.OptionError, (OSCILLATOR_X0, 1.0), {"rtoll": 1e-3}),
        (swb.ArgumentError, (OSCILLATOR_X0, 1.0), {"n_steps": 10}),
        (swb.DimensionError, (OSCILLATOR_X0, 1.0), {"p": [1.0]}),
        (swb.ArgumentError, (OSCILLATOR_X0, 1.0), {"on_step": 3}),
        (swb.RangeError, (OSCILLATOR_X0, 1.0), {"stop_times": [np.inf]}),
    ],
)
def test_refusals(error, arguments, keywords):
    with pytest.raises(error):
        swb.simulate(oscillator(), *arguments, **keywords)


def test_refusals_of_other_things():
    with pytest.raises(swb.ArgumentError):
        swb.simulate("system", [0.0], 1.0)
    with pytest.raises(TypeError):
        swb.Run()
    with pytest.raises(swb.DimensionError):
        swb.simulate_batch(oscillator(), np.empty((0, 2)), 1.0)
    with pytest.raises(swb.ArgumentError):
        swb.simulate_batch(oscillator(), [OSCILLATOR_X0], 1.0, rtol=[1e-3, 1e-4])


def test_a_switch_next_to_the_end_does_not_pass_it():
    m = Model(states="s v w", controls="torque")
    (_, v, w), u = m.x, m.u[0]
    slip = v - 0.3 * w
    mu = swb.clip(0.9 * slip / 1.5, 0, 0.9) - swb.clip(0.3 * (slip - 1.5) / 6, 0, 0.3)
    m.derivatives = [v, -9.81 * mu, 3 * 9.81 * mu * 4 - 60 * u]
    x0, end = [20.040208964524517, 7.6572096359751445, 20.52403211991809], 0.23903435000647089
    for duration in (end, 2 * end):
        assert swb.simulate(m, x0, duration, u=[2.2563]).success


@pytest.mark.parametrize("rudder", [0.0, 1.4e-16, -3.4e-17, -1e-16, -1e-12])
def test_a_state_rests_on_a_surface(rudder):
    m = Model(states="course speed", controls="rudder")
    (a, v), u = m.x, m.u[0]
    m.derivatives = [u, swb.where(swb.cos(a) > np.cos(np.deg2rad(40)), -0.5 * v, 1.0 - v)]
    for start in (np.deg2rad(40), 0.6981317007977318, 0.6981317007977317):
        r = swb.simulate(m, [start, 1.0], 0.5, u=[rudder])
        assert r.success and r.reason == ""


def test_expressions_say_where_they_are_not_defined():
    m = Model(states="h")
    m.derivatives = [-0.3 * swb.sqrt(m.x[0])]
    r = swb.simulate(m, [0.04], 5.0)
    assert r.outcome == swb.RunOutcome.STEP_TOO_SMALL
    assert "is not finite" in r.reason and "output 0 is NaN" in r.reason and "x = [-" in r.reason


def test_a_jump_in_a_smooth_function_is_named():
    s = swb.System(1)
    s.set_f0(swb.Function(lambda x: [-np.sign(x[0])], 1, n_out=1))
    r = swb.simulate(s, [0.5], 100.0)
    assert r.outcome == swb.RunOutcome.STEP_TOO_SMALL and "looks discontinuous near t = 0.5" in r.reason


def test_functions_in_python_depend_on_the_parameters_they_take():
    s = swb.System(1, np=1)
    s.set_f0(swb.Function(lambda x, p: [-p[0] * x[0] ** 2], 1, np=1, n_out=1))
    r = swb.simulate(s, [2.0], 1.5, p=[0.5], rtol=1e-11, atol=1e-11, sensitivity=True)
    # x = x0 / (1 + p x0 t)
    assert r.x_end[0] == pytest.approx(0.8, abs=1e-9)
    assert r.dx_dp[0, 0] == pytest.approx(-1.5 * 0.8**2, abs=1e-7)
