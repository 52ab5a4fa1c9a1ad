"""Time stepping of scenes."""

import threading

import numpy
import pytest

import switchback_control as swb


def ball(e=0.0):
    s = swb.Scene("y", name="ball")
    s.force([-9.81])
    s.contact("floor", gap=s.q[0], e=e)
    return s


def test_ball_comes_to_rest():
    run = swb.simulate_steps(ball(), [1.0], [0.0], 1.0, h=1e-3, every=10, impulses=True)
    assert run.t[0] == 0.0 and run.t[-1] == 1.0 and run.x.shape == (101, 2)
    assert run.names == ("floor",) and run.q.shape == (101, 1) and run.v[-1, 0] == 0.0
    assert abs(run.q[-1, 0]) < 1e-5
    assert run.impulses.shape == (101, 1, 3) and abs(run.impulses[-1, 0, 0] - 9.81e-3) < 1e-9
    assert run.stats.steps == 1000 and run.stats.unconverged == 0 and 0 < run.stats.penetration < 5e-3


def test_stepper():
    with swb.Stepper(ball(0.5), h=1e-2) as s:
        with pytest.raises(swb.StateError, match="set its state first"):
            s.step()
        s.set_state([1.0, 0.0], 2.0)
        s.step()
        assert s.t == pytest.approx(2.01) and s.x[1] == pytest.approx(-0.0981)
        s.advance(2.6)
        assert s.t == 2.6 and s.impulses.shape == (1, 3) and s.stats.steps == 60


def test_piles_on_threads_give_the_same():
    s = swb.Scene(10, name="column")
    s.force([-9.81] * 10)
    for i in range(10):
        below = s.q[i - 1] if i else -0.5
        s.contact(f"{i}", gap=s.q[i] - below - 0.5)
    q0 = 0.6 * numpy.arange(10)
    runs = [None] * 3

    def work(k):
        runs[k] = s_systems[k].run(1.0)

    s_systems = [swb.Stepper(s) for _ in range(3)]
    for one in s_systems:
        one.set_state(numpy.concatenate([q0, numpy.zeros(10)]))
    threads = [threading.Thread(target=work, args=(k,)) for k in range(3)]
    [t.start() for t in threads]
    [t.join() for t in threads]
    assert all((r.x == runs[0].x).all() for r in runs)
    assert numpy.abs(runs[0].v[-1]).max() < 1e-9
    all_looked = swb.simulate_steps(s, q0, numpy.zeros(10), 1.0, look_at_all=True)
    assert (all_looked.x == runs[0].x).all()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"h": 0.0}, "the step h is 0"),
        ({"h": float("nan")}, "the step h is NaN"),
        ({"theta": 0.1}, "theta is 0.1"),
        ({"max_iterations": 0}, "max_iterations"),
    ],
)
def test_options_out_of_range(options, message):
    with pytest.raises(swb.RangeError, match=message):
        swb.Stepper(ball(), **options)


def test_bad_input():
    with pytest.raises(swb.RangeError, match="the gap of contact floor is -1"):
        swb.simulate_steps(ball(), [-1.0], [0.0], 1.0)
    with pytest.raises(swb.DimensionError):
        swb.simulate_steps(ball(), [1.0, 2.0], [0.0], 1.0)
    with pytest.raises(swb.RangeError, match="steps go forward"):
        swb.simulate_steps(ball(), [1.0], [0.0], (1.0, 0.0))
    system = swb.System(nx=1)
    system.add_subsystem(modes=[[3.0], [1.0]], psi=lambda x: x[0], signs=[-1, 1])
    with pytest.raises(swb.StateError, match="no scene"):
        swb.Stepper(system)
    with pytest.raises(swb.ArgumentError, match="takes a scene"):
        swb.simulate_steps(system, [1.0], [0.0], 1.0)


def slider():
    s = swb.Scene("x y", u="f", p="mu", name="slider")
    s.force([s.u[0], -9.81])
    s.contact("floor", gap=s.q[1], tangents=s.q[0], mu=s.p[0])
    return s


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"q0": [0.0, numpy.nan]}, swb.RangeError, "state 1 is NaN"),
        ({"v0": [numpy.inf, 0.0]}, swb.RangeError, "state 2 is inf"),
        ({"v0": [0.0]}, swb.DimensionError, r"v0 has shape \(1,\)"),
        ({"p": [-0.1]}, swb.RangeError, "friction of contact floor is -0.1"),
        ({"p": [numpy.nan]}, swb.RangeError, "NaN"),
        ({"p": None}, swb.ArgumentError, "p"),
        ({"u": [1.0, 2.0]}, swb.DimensionError, r"u has shape \(2,\)"),
        ({"every": 0}, swb.RangeError, "every"),
        ({"t_span": numpy.nan}, swb.RangeError, "t"),
        ({"law": "poisson"}, swb.ArgumentError, "newton, sequential"),
    ],
)
def test_bad_input_of_whole_runs(change, error, message):
    given = {"q0": [0.0, 0.0], "v0": [1.0, 0.0], "t_span": 0.1, "u": [0.0], "p": [0.3]}
    assert swb.simulate_steps(slider(), **given).t[-1] == 0.1
    with pytest.raises(error, match=message):
        swb.simulate_steps(slider(), **{**given, **change})


def test_a_closed_stepper_and_a_body_without_mass():
    s = swb.Stepper(ball())
    s.close()
    with pytest.raises(swb.StateError, match="closed"):
        s.set_state([1.0, 0.0])
    light = ball()
    light.inertia([0.0])
    with pytest.raises(swb.SwitchbackError, match="positive definite"):
        swb.simulate_steps(light, [1.0], [0.0], 1.0)
    with pytest.raises(swb.UnsupportedError, match="projected"):
        m = swb.Projected("x")
        m.f([1.0])
        m.constraint("wall", 1.0 - m.x[0])
        swb.Stepper(m)
