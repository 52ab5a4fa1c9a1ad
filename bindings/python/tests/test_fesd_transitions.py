"""Transitions in simulations by finite elements, against closed forms and simulations by events."""

import numpy as np
import pytest
import switchback_control as swb

G = 9.81


def ball(e=0.8):
    m = swb.Model(states="y v")
    m.transition(m.y < 0, when={}, reset={m.y: 0.0, m.v: -e * m.v})
    m.derivatives = [m.v, -G]
    return m


def test_a_ball_bounces():
    e = 0.8
    r = swb.simulate_fesd(ball(e), [1.0, 0.0], 1.5, 6, n_s=3)
    assert r.success
    # times of the bounces, and the parabola behind the last one
    hits = [np.sqrt(2 / G)]
    v = e * G * hits[0]
    while hits[-1] + 2 * v / G < 1.5:
        hits.append(hits[-1] + 2 * v / G)
        v *= e
    t = 1.5 - hits[-1]
    np.testing.assert_allclose(r.state, [v * t - G * t**2 / 2, v - G * t], atol=1e-9)


@pytest.mark.parametrize("n_s", [2, 3])
def test_the_order_of_the_method_goes_through_a_transition(n_s):
    """Radau IIA of n_s stages has order 2 n_s - 1, also of the state behind a jump."""
    m = swb.Model(states="pos v")
    m.transition(m.pos > 0.5, when={}, reset={m.pos: 0.0, m.v: 0.5 * m.v + 0.3})
    m.derivatives = [m.v, -swb.sin(3 * m.pos) - 0.2 * m.v + 1.0]
    exact = swb.simulate(m, [0.0, 1.0], 1.7, rtol=1e-12, atol=1e-13)
    assert len(exact.jumps) >= 2
    steps = np.array([4, 8, 16])
    errors = []
    for n in steps:
        r = swb.simulate_fesd(m, [0.0, 1.0], 1.7, int(n), n_s=n_s)
        assert r.success
        errors.append(np.abs(r.state - exact.x_end).max())
    slope = -np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert slope > 2 * n_s - 1.6, (errors, slope)


@pytest.mark.parametrize("seed", range(8))
def test_random_automata(seed):
    rng = np.random.default_rng(seed)
    m = swb.Model(states="T w", controls="push")
    on = m.discrete("on", 0)
    low, high = sorted(rng.uniform(-0.5, 0.5, 2))
    high += 0.3
    m.transition(m.T < low, when={on: 0}, to={on: 1})
    m.transition(m.T > high, when={on: 1}, to={on: 0})
    m.every(rng.uniform(0.3, 0.6), reset={m.w: 0.5 * m.w + 0.2})
    k, heat = rng.uniform(0.5, 1.5), rng.uniform(2.0, 3.0)
    friction = swb.sign(m.w) if seed % 2 else 0.0
    m.derivatives = [-k * (m.T + 1.0) + heat * on + 0.2 * m.w, m.push - 0.6 * friction - 0.1 * m.w]
    s = m.system()
    x0 = s._start([0.1, 0.4], "x0")
    u = [rng.uniform(-0.4, 0.4)]
    exact = swb.simulate(m, [0.1, 0.4], 2.5, u=u, rtol=1e-11, atol=1e-12)
    r = swb.simulate_fesd(s, x0, 2.5, 20, u=u, n_s=3)
    assert exact.success and r.success and len(exact.jumps) >= 4
    np.testing.assert_allclose(r.state[:2], exact.x_end[:2], atol=1e-6)
    np.testing.assert_array_equal(np.round(r.state[2:]), exact.x_end[2:])


def test_a_transition_at_the_start_and_one_behind_it():
    m = swb.Model(states="pos")
    a = m.discrete("a", 0)
    m.transition(m.pos > 0.5, when={a: 0}, to={a: 1}, reset={m.pos: 2.0 * m.pos})
    m.transition(m.pos > 1.5, when={a: 1}, to={a: 2}, reset={m.pos: m.pos - 1.0})
    m.derivatives = [-m.pos * 0.0]
    s = m.system()
    r = swb.simulate_fesd(s, s._start([0.9], "x0"), 1.0, 1)
    np.testing.assert_allclose(r.state, [0.8, 2.0])


def test_what_it_does_not_follow_it_says():
    m = swb.Model(states="pos")
    m.stop_at(m.pos > 0.5)
    m.derivatives = [1.0 + 0 * m.pos]
    with pytest.raises(swb.UnsupportedError, match="transition 0 is no comparison"):
        swb.simulate_fesd(m, [0.0], 1.0, 2)
    # transitions that follow each other for ever
    m = swb.Model(states="pos")
    a = m.discrete("a", 0)
    m.transition(m.pos > 0.5, when={a: 0}, to={a: 1})
    m.transition(m.pos > 0.5, when={a: 1}, to={a: 0})
    m.derivatives = [1.0 + 0 * m.pos]
    s = m.system()
    assert not swb.simulate_fesd(s, s._start([0.0], "x0"), 1.0, 2).success


def test_a_guard_that_goes_back_behind_another_passage_is_not_back():
    """A count is made once while its condition holds, though the same step goes on to where it does not."""
    m = swb.Model(states="down up count")
    d = m.discrete("d", 0)
    m.transition(m.down > 0.5, when={}, reset={m.count: m.count + 1})
    m.transition(m.up > 0.2, when={d: 0}, to={d: 1})
    m.derivatives = [-1.0 + 0 * m.down, 1.0 + 0 * m.up, 0 * m.count]
    s = m.system()
    x0 = s._start([1.0, 0.0, 0.0], "x0")
    exact = swb.simulate(m, [1.0, 0.0, 0.0], 1.0)
    for steps in (1, 2, 3):
        r = swb.simulate_fesd(s, x0, 1.0, steps)
        assert r.success
        np.testing.assert_allclose(r.state, exact.x_end, atol=1e-9)
    assert exact.x_end[2] == 1.0
