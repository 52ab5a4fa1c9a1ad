"""Phases and given modes of problems that only simulations follow."""

import numpy as np
import pytest
import switchback_control as swb

G = 9.81


def rail(bound=0.3):
    """A mass with friction at its joint, pushed by a control."""
    s = swb.Scene("x", u="push")
    s.force([s.push])
    s.friction("guide", s.q[0], bound)
    return s


def problem(s, horizon, n, x0=None, target=None):
    ocp = swb.Ocp(s, horizon, n)
    # a mass that rests at first has local optima of its own
    ocp.set_control_guess(np.ones((n, 1)))
    if x0 is not None:
        ocp.set_initial_state(x0)
    ocp.set_lagrange(s.u[0] ** 2)
    if target is not None:
        ocp.add_terminal([s.q[0], s.v[0]], target, target)
    return ocp


@pytest.mark.parametrize("seed", range(6))
def test_a_horizon_in_two_phases_is_one_horizon(seed):
    rng = np.random.default_rng(seed)
    s = rail(rng.uniform(0.1, 0.5))
    target = [rng.uniform(0.6, 1.2), rng.uniform(0.2, 0.8)]
    cut, n = int(rng.integers(1, 5)), 6
    h = 0.25
    one = problem(s, n * h, n, [0.0, 0.0], target).solve()
    both = swb.MultiPhase([problem(s, cut * h, cut, [0.0, 0.0]), problem(s, (n - cut) * h, n - cut, None, target)])
    both.link_continuous(0)
    r = both.solve()
    assert one.success and r.success and r.link_violation == 0.0
    np.testing.assert_allclose(r.cost, one.cost, rtol=1e-6)
    controls = np.vstack([p.controls for p in r.phases])
    np.testing.assert_allclose(controls, one.controls, atol=1e-3)
    assert r.error < 1e-6 and r.phases[1].trajectory.times[0] == pytest.approx(cut * h)


def test_a_link_that_is_a_constraint_leads_to_the_same():
    s = rail()
    reset = swb.MultiPhase([problem(s, 0.75, 3, [0.0, 0.0]), problem(s, 0.75, 3, None, [1.0, 0.5])])
    reset.link_reset(0, lambda x: (x[0], 0.5 * x[1]))
    a = reset.solve()
    rows = swb.MultiPhase([problem(s, 0.75, 3, [0.0, 0.0]), problem(s, 0.75, 3, None, [1.0, 0.5])])
    rows.link(0, lambda x: (x[2] - x[0], x[3] - 0.5 * x[1]), [0, 0], [0, 0])
    b = rows.solve()
    assert a.success and b.success and b.link_violation < 1e-5
    np.testing.assert_allclose(b.cost, a.cost, rtol=1e-5)
    before, behind = (p.trajectory.states[k] for p, k in zip(a.phases, (-1, 0), strict=True))
    np.testing.assert_allclose(behind, [before[0], 0.5 * before[1]], atol=1e-8)
    # a mass that slides one way all the time: a constant force, and a program of least squares
    bound, h, k = 0.3, 0.25, np.arange(3)
    one = np.vstack([h * (0.75 - (k + 0.5) * h), np.full(3, h)])
    drag = -bound * np.array([0.75**2 / 2, 0.75])
    step = np.array([[1.0, 0.75], [0.0, 1.0]]) @ np.diag([1.0, 0.5])
    ends, free = np.hstack([step @ one, one]), step @ drag + drag
    u = np.linalg.lstsq(ends, np.array([1.0, 0.5]) - free, rcond=None)[0]
    np.testing.assert_allclose(a.cost, h * np.sum(u**2), rtol=1e-6)


def test_a_ball_that_bounces_and_then_flies_without_ground():
    """The length of the second phase is free, and its clock is that of both."""
    ground = swb.Scene("y", u="lift")
    ground.force([ground.lift - G])
    ground.contact("floor", ground.q[0], e=0.6)
    down = swb.Ocp(ground, 0.6, 2)
    down.set_initial_state([1.0, 0.0])
    down.set_control_bounds([0.0], [0.0])
    m = swb.Model(states="y v", controls="lift")
    m.derivatives = [m.v, m.lift - G]
    up = swb.Ocp(m, 0.1, 1)
    up.set_free_time("horizon", 0.01, 1.0)
    up.set_control_bounds([0.0], [0.0])
    up.add_terminal(m.v, 0.0, 0.0)
    up.set_mayer(-m.y)
    both = swb.MultiPhase([down, up])
    both.link_continuous(0)
    r = both.solve()
    hit = np.sqrt(2.0 / G)
    speed = 0.6 * G * hit
    assert r.success
    np.testing.assert_allclose(r.phases[1].durations.sum(), hit + speed / G - 0.6, atol=1e-6)
    np.testing.assert_allclose(r.cost, -(speed**2) / (2 * G), atol=1e-6)
    np.testing.assert_allclose(r.phases[1].trajectory.times[0], 0.6, atol=1e-9)


def test_transitions_in_one_of_two_phases():
    m = swb.Model(states="at v", controls="push")
    fast = m.discrete("fast", 0)
    m.transition(m.at > 0.5, when={fast: 0}, to={fast: 1})
    m.derivatives = [m.v, m.push * (1.0 + fast)]

    def part(n, x0=None, target=None):
        ocp = swb.Ocp(m, 0.3 * n, n)
        if x0 is not None:
            ocp.set_initial_state(x0)
        ocp.set_lagrange(m.push**2)
        if target is not None:
            ocp.add_terminal([m.at, m.v], target, target)
        return ocp

    one = part(4, [0.0, 0.0, 0.0], [1.0, 0.0]).solve()
    both = swb.MultiPhase([part(2, [0.0, 0.0, 0.0]), part(2, None, [1.0, 0.0])])
    both.link_continuous(0)
    r = both.solve()
    assert one.success and r.success
    np.testing.assert_allclose(r.cost, one.cost, rtol=1e-5)
    assert sum(len(p.jumps) for p in r.phases) == len(one.jumps) == 1


def brake():
    """Friction stops a mass on its way, or not, by what the control does."""
    s = rail(0.5)
    ocp = swb.Ocp(s, 2.0, 4)
    ocp.set_initial_state([0.0, 1.0])
    ocp.set_control_bounds([-1.0], [1.0])
    ocp.set_lagrange(0.1 * s.u[0] ** 2 + (s.q[0] - 0.4) ** 2)
    return s, ocp


def test_given_modes_are_kept():
    rng = np.random.default_rng(3)
    orders = {}
    for _ in range(30):
        _, ocp = brake()
        ocp.set_control_guess(rng.uniform(-1, 1, (4, 1)))
        r = ocp.solve()
        if r.success:
            key = np.asarray(ocp.modes.modes).tobytes()
            orders.setdefault(key, []).append((r.cost, r.controls, ocp.modes))
    assert len(orders) >= 1
    best = min(o[0] for all_of in orders.values() for o in all_of)
    for all_of in orders.values():
        cost, controls, modes = min(all_of, key=lambda o: o[0])
        _, ocp = brake()
        ocp.set_modes(modes)
        ocp.set_control_guess(controls)
        r = ocp.solve()
        assert r.success and best - 1e-8 <= r.cost <= cost + 1e-8
        np.testing.assert_array_equal(ocp.modes.modes, modes.modes)


def test_an_order_that_costs_more_is_kept_too():
    s, ocp = brake()
    free = ocp.solve()
    # pushed all the way it never stops, which costs more
    _, pushed = brake()
    pushed.set_control_bounds([0.6], [1.0])
    never = pushed.solve()
    assert never.success and np.asarray(pushed.modes.modes).shape[0] == 1
    _, kept = brake()
    kept.set_modes(pushed.modes)
    kept.set_control_guess(never.controls)
    r = kept.solve()
    assert r.success and free.cost < r.cost <= never.cost
    np.testing.assert_array_equal(kept.modes.modes, pushed.modes.modes)
    speed = r.trajectory.states[:, 1]
    assert speed.min() > -1e-6


def test_modes_that_cannot_be_say_so():
    _, ocp = brake()
    r = ocp.solve()
    assert r.success
    modes = np.asarray(ocp.modes.modes)
    _, other = brake()
    # a mass that moves forwards at first and is said to slide backwards
    back = np.zeros((1, modes.shape[1]), dtype=int)
    back[0, 2 if modes[0, 3] else 3] = 1
    other.set_modes(swb.Modes(np.array([0.0]), back, np.zeros((1, 0), dtype=int)))
    with pytest.raises(swb.NumericError, match="modes that are given"):
        other.solve()
    other.set_modes(swb.Modes(np.array([0.0]), np.ones((1, 7), dtype=int), np.zeros((1, 0), dtype=int)))
    with pytest.raises(swb.DimensionError, match="7 modes"):
        other.solve()


@pytest.mark.parametrize("seed", range(4))
def test_choices_in_two_phases_are_those_of_an_enumeration(seed):
    rng = np.random.default_rng(seed)
    a, price, target = rng.uniform(0.5, 1.5), rng.uniform(0.05, 0.4), rng.uniform(0.5, 1.0)

    def part(n, x0=None):
        m = swb.Model(states="level", controls="on")
        m.derivatives = [-a * m.level + 2.0 * m.on]
        m.choice("on", [0, 1])
        ocp = swb.Ocp(m, 0.4 * n, n, control_bounds=([0.0], [1.0]))
        if x0 is not None:
            ocp.set_initial_state(x0)
        ocp.set_lagrange((m.level - target) ** 2 + price * m.on)
        return ocp

    both = swb.MultiPhase([part(2, [0.2]), part(3)])
    both.link_reset(0, lambda x: [0.7 * x[0]])
    r = both.solve()
    assert r.success

    def cost(on):
        x, total = 0.2, 0.0
        for k, u in enumerate(on):
            if k == 2:
                x *= 0.7
            rest = 2.0 * u / a
            c, h = x - rest, 0.4
            # the integral of (rest + c e^(-a t) - target)², in closed form
            d = rest - target
            total += d**2 * h + 2 * d * c * (1 - np.exp(-a * h)) / a + c**2 * (1 - np.exp(-2 * a * h)) / (2 * a) + price * u * h
            x = rest + c * np.exp(-a * h)
        return total

    every = [[(k >> j) & 1 for j in range(5)] for k in range(32)]
    best = min(every, key=cost)
    np.testing.assert_allclose(r.cost, cost(best), rtol=1e-6)
    np.testing.assert_array_equal(np.round(np.concatenate([p.controls[:, 0] for p in r.phases])), best)
