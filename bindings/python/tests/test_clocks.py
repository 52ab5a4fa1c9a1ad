"""Known times: clocks, lists of times, sample and hold, pulse-width modulation."""

import math

import numpy as np
import pytest

import switchback_control as swb


@pytest.mark.parametrize("period, offset", [(0.1, 0.05), (1e-4, 0.0), (1 / 3, 0.1), (0.007, -0.003), (250.0, 1.0)])
def test_a_clock_strikes_at_the_times_of_its_formula(period, offset):
    m = swb.Model(states="q")
    m.derivatives = [1.0]
    k = m.every(period, {m.q: 0.0}, offset=offset)
    first = 0 if offset >= 0 else 1
    end = offset + (first + 999.5) * period
    run = swb.simulate(m, {"q": 0.0}, end)
    times = [offset + period * i for i in range(first, first + 1000)]
    # a run that begins later begins with the number of times before it
    assert [j.t for j in run.jumps][-1000:] == times
    assert run.x_end[1] == first + 1000 and abs(run.x_end[0] - 0.5 * period) < 1e-12 * end
    assert k.ndim == 0


@pytest.mark.parametrize("period", [1e-4, 0.01, 1 / 3])
def test_pulses_begin_at_the_times_of_the_clock(period):
    m = swb.Model(states="q", parameters="duty")
    m.derivatives = [m.pwm(m.duty, period)]
    run = swb.simulate(m, {"q": 0.0}, 100.25 * period, p=[0.3])
    edges = np.array([j.t for j in run.jumps])
    assert np.array_equal(edges[0::2], period * np.arange(101))
    assert np.all(np.abs(edges[1::2] - period * (np.arange(100) + 0.3)) <= np.spacing(edges[1::2]))


def test_a_sampled_controller_is_the_linear_recursion():
    # x' = u held, u = -2 x at samples: x_{k+1} = (1 - 2 T) x_k
    m = swb.Model(states="q")
    u = m.hold(-2 * m.q, 0.125, name="u")
    m.derivative(m.q, u)
    run = swb.simulate(m, {"q": 1.0}, 10.0)
    assert abs(run.x_end[0] / 0.75**80 - 1) < 1e-9


def test_derivatives_go_through_samples():
    m = swb.Model(states="q", parameters="gain")
    u = m.hold(-m.gain * m.q, 0.125)
    m.derivative(m.q, u)
    # the last sample is not at the end
    end = 10 * 0.125 + 0.05
    run = swb.simulate(m, {"q": 1.0}, end, p=[2.0], sensitivity=True)
    q, last = 1 - 0.125 * 2, 1 - 0.05 * 2
    exact = q**10 * last
    by_gain = 10 * q**9 * -0.125 * last + q**10 * -0.05
    assert abs(run.x_end[0] - exact) < 1e-10
    assert abs(run.dx_dx0[0, 0] - exact) < 1e-9 and abs(run.dx_dp[0, 0] - by_gain) < 1e-9


@pytest.mark.parametrize("duty", [0.0, 0.3, 1.0])
def test_pulses_have_their_width(duty):
    m = swb.Model(states="q")
    s = m.pwm(duty, 0.01)
    m.derivative(m.q, s)
    run = swb.simulate(m, {"q": 0.0}, 1.0 - 1e-9)
    assert abs(run.x_end[0] - duty) < 1e-8


def test_a_pulse_ends_where_the_ramp_reaches_the_duty():
    m = swb.Model(states="q")
    s = m.pwm(0.5 * (1 + swb.sin(m.t)), 0.01)
    m.derivative(m.q, s)
    run = swb.simulate(m, {"q": 0.0}, math.pi)
    assert abs(run.x_end[0] - 0.5 * (math.pi + 2)) < 0.01


def test_a_list_of_times():
    m = swb.Model(states="q")
    m.derivatives = [0.0]
    n = m.at_times([0.5, 0.7, 2.0], {m.q: m.q + 1})
    run = swb.simulate(m, {"q": 0.0}, 1.0)
    assert [j.t for j in run.jumps] == [0.5, 0.7] and run.x_end[0] == 2 and run.x_end[1] == 2
    assert n.ndim == 0


@pytest.mark.parametrize(
    "call, word",
    [
        (lambda m: m.every(0.0), "positive"),
        (lambda m: m.every("a"), "period"),
        (lambda m: m.every(1.0, 3), "dictionary"),
        (lambda m: m.every(1.0, {"y": 0}), "y"),
        (lambda m: m.every(1.0, offset=math.nan), "offset"),
        (lambda m: m.at_times([]), "increase"),
        (lambda m: m.at_times([1.0, 1.0]), "increase"),
        (lambda m: m.at_times(["a"]), "times"),
        (lambda m: m.pwm(1.5, 1.0), "between"),
        (lambda m: m.pwm(0.5, -1.0), "positive"),
        (lambda m: m.at_times([math.nan]), "increase"),
        (lambda m: m.hold(m.x[0], math.inf), "period"),
    ],
)
def test_what_makes_no_sense_is_refused(call, word):
    m = swb.Model(states="q")
    with pytest.raises(swb.ArgumentError, match=word):
        call(m)


def test_many_units_are_those_of_single_ones():
    """Thermostats whose set points are changed by a clock, many of them: with and without dense output."""
    m = swb.Model(states=24)
    heat = [m.hysteresis(20 + 0.1 * i - m.x[i], on=0.5, off=-0.5) for i in range(24)]
    for i in range(24):
        m.derivative(m.x[i], (1 + 0.01 * i) * (8 - m.x[i]) + 25 * heat[i])
    start = [19.9 + 0.1 * i for i in range(24)]
    many = swb.simulate(m, start, 3.0)
    for i in (0, 7, 23):
        one = swb.Model(states="q")
        h = one.hysteresis(20 + 0.1 * i - one.x[0], on=0.5, off=-0.5)
        one.derivative(one.x[0], (1 + 0.01 * i) * (8 - one.x[0]) + 25 * h)
        alone = swb.simulate(one, [start[i]], 3.0)
        times = np.linspace(0.01, 2.99, 57)
        assert np.abs(many(times)[:, i] - alone(times)[:, 0]).max() < 1e-6
        own = [j for j in many.jumps if j.transition in (2 * i, 2 * i + 1)]
        assert len(own) == len(alone.jumps)
        for a, b in zip(own, alone.jumps):
            assert abs(a.t - b.t) < 1e-7 and abs(a.before[i] - b.before[0]) < 1e-6
            assert np.isfinite(a.after).all()
    light = swb.simulate(m, start, 3.0, dense=False)
    assert np.array_equal(light.x_end, many.x_end)
    assert np.isnan(light.jumps[0].before).any() and np.isfinite(many.jumps[0].before).all()


def test_a_duty_that_switches_is_to_be_held():
    m = swb.Model(states="q")
    m.derivatives = [m.pwm(swb.clip(1 - m.q, 0, 1), 0.1)]
    with pytest.raises(swb.UnsupportedError, match="clock hold the value"):
        m.system()
    h = swb.Model(states="q")
    h.derivatives = [h.pwm(h.hold(swb.clip(1 - h.q, 0, 1), 0.1), 0.1)]
    run = swb.simulate(h, {"q": 0.0}, 1.0)
    # what is left falls by a tenth in every period
    assert abs(run.x_end[0] - (1 - 0.9**10)) < 1e-9
