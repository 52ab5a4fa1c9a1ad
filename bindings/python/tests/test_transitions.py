"""Transitions: guards with resets, discrete states, hysteresis."""

from __future__ import annotations

import math

import numpy
import pytest

import switchback_control as swb
from switchback_control.expr import Model


def ball(e=0.9):
    m = Model(states="q v")
    q, v = m.x
    m.derivatives = [v, -9.81]
    m.transition(q < 0, reset={v: -e * v})
    return m


def test_a_ball_that_bounces():
    run = swb.simulate(ball(), [1.0, 0.0], 3.0, rtol=1e-11, atol=1e-11, sensitivity=True)
    assert run.success and run.stats.jumps == len(run.jumps) == 4
    times = [0.45152364098573090, 1.2642661947600465, 1.9957344931569306, 2.6540559617141263]
    assert numpy.allclose([j.t for j in run.jumps], times, rtol=0, atol=1e-12)
    assert numpy.allclose(run.x_end, [0.41835172208395643, -0.48755089263868119], atol=1e-10)
    expected = [[1.1496780610419782, 0.049699377435135697], [14.471224553680659, 1.0]]
    assert numpy.allclose(run.dx_dx0, expected, rtol=1e-9)
    assert numpy.allclose(run.jump_derivatives[3], [1.327027980857063, 0.1019367991845056], rtol=1e-10)
    first = run.jumps[0]
    assert first.after[1] == -0.9 * first.before[1] and first.rate > 0 and not first.simultaneous
    # the dense output ends before the jump and begins behind it
    assert math.isclose(run(first.t)[1], first.before[1]) and run(first.t + 1e-9)[1] > 0


def test_plots_show_both_sides_of_a_jump():
    from switchback_control.plot import _curve

    run = swb.simulate(ball(), [1.0, 0.0], 3.0)
    t, x, jumps = _curve(run, 12)
    assert (numpy.diff(t) >= 0).all() and x[:, 1].max() == max(j.after[1] for j in run.jumps)
    for j in run.jumps:
        here = x[t == j.t]
        assert numpy.allclose(here[0], j.before, atol=1e-12) and (here[-1] == j.after).all()


def thermostat():
    m = Model(states="x", parameters="k P")
    x = m.x[0]
    heat = m.hysteresis(-x, on=-18, off=-20, name="heat")
    m.derivative(x, -m.p[0] * x + m.p[1] * heat)
    return m


def test_hysteresis():
    m = thermostat()
    run = swb.simulate(m, [15.0], 12.0, p=[0.2, 5.0], rtol=1e-11, atol=1e-11)
    assert run.jumps[0].t == 0.0 and math.isnan(run.jumps[0].rate)  # too cold at the start
    times = [3.465735902799726547, 3.992538481088858053, 5.674899664194922706, 6.201702242484054212]
    assert numpy.allclose([j.t for j in run.jumps[1:5]], times, rtol=0, atol=1e-11)
    assert numpy.allclose(run.x_end, [19.68827786379199706, 1.0], atol=1e-10)
    batch = swb.simulate_batch(m, [[15.0], [19.0]], 12.0, p=[0.2, 5.0], rtol=1e-11, atol=1e-11)
    assert (batch.x[0] == run.x_end).all()
    assert (swb.simulate(m, [19.0, 1.0], 0.1, p=[0.2, 5.0]).x_end[1]) == 1.0


def test_a_system_of_functions():
    s = swb.System(2, f0=lambda x: [x[1], -9.81])
    k = s.add_transition(lambda x: x[0], "falling", reset=lambda x: [x[0], -0.9 * x[1]])
    assert k == 0
    run = swb.simulate(s, [1.0, 0.0], 3.0, rtol=1e-10, atol=1e-10)
    assert numpy.allclose(run.x_end, [0.41835172208395643, -0.48755089263868119], atol=1e-8)
    s = swb.System(2, f0=lambda x: [1.0, 0.0])
    s.add_transition(lambda x: x[0] - 1, when={1: 0}, to={1: 5})
    run = swb.simulate(s, [0.0, 0.0], 3.0)
    assert numpy.allclose(run.x_end, [3.0, 5.0], rtol=1e-14)


def test_exceptions_of_guards_and_resets():
    class Mine(Exception):
        pass

    def fails(x):
        raise Mine("from a reset")

    s = swb.System(1, f0=lambda x: [1.0])
    s.add_transition(lambda x: x[0] - 1, reset=fails)
    with pytest.raises(Mine, match="from a reset"):
        swb.simulate(s, [0.0], 3.0)
    s = swb.System(1, f0=lambda x: [1.0])
    s.add_transition(lambda x: x[0] - 1, reset=lambda x: [math.nan])
    run = swb.simulate(s, [0.0], 3.0)
    assert run.outcome == swb.RunOutcome.NO_CONTINUATION and "transition 0" in run.reason
    assert math.isclose(run.t_end, 1.0)


def test_nonsense():
    m = Model(states="q v")
    q, v = m.x
    m.derivatives = [v, -1.0]
    w = m.discrete("w")
    for call, word in [
        (lambda: m.transition(q), "changes nothing"),
        (lambda: m.transition(q < 0, reset={v: (q < 0) & (v < 0)}), "a condition"),
        (lambda: m.transition(q < 0, reset=[v, -v]), "dictionary"),
        (lambda: m.transition(q < 0, reset={"speed": -v}), "no state"),
        (lambda: m.transition(q < 0, to={w: "x"}), "to"),
        (lambda: m.transition(m.x < 0, to={w: 1}), "one value"),
        (lambda: m.hysteresis(q, on=1, off=2), "negate"),
        (lambda: m.hysteresis(q, on=2, off=1, initial=3), "0 or 1"),
        (lambda: m.discrete("w"), "already"),
        (lambda: m.discrete(3), "text"),
    ]:
        with pytest.raises(swb.ArgumentError, match=word):
            call()
            m.system()
        m._transitions.clear()
    s = swb.System(2, f0=lambda x: [1.0, 0.0])
    for keywords in ({"to": {5: 1.0}}, {"to": {-1: 1.0}}, {"to": {1: math.nan}}, {"to": [1]}, {}):
        with pytest.raises(swb.SwitchbackError):
            s.add_transition(lambda x: x[0], **keywords)
    with pytest.raises(swb.ArgumentError, match="falling"):
        s.add_transition(lambda x: x[0], "up", to={1: 1})
    stops = swb.Model(states="q")
    stops.derivatives = [1]
    stops.stop_at(stops.q > 1)
    with pytest.raises(swb.UnsupportedError, match="event-driven"):
        swb.Simulator(stops.system())
