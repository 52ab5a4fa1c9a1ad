"""Optimal control by shooting: what only simulations follow, against programs in closed form."""

import numpy as np
import pytest
import switchback_control as swb

N, T = 6, 1.5
H = T / N


def moves(gain=1.0):
    """End of a double integrator as a linear function of its controls, at rest at first: position and velocity."""
    k = np.arange(N)
    return gain * np.vstack([H * (T - (k + 0.5) * H), np.full(N, H)])


def least(ends, target, offset=0.0):
    """Controls with the least sum of squares that lead to the target, under a constant force."""
    free = offset * np.array([T**2 / 2, T])
    u = np.linalg.lstsq(ends, target - free, rcond=None)[0]
    return u, H * np.sum(u**2)


def rest_to_rest(scene, q, v, at=1.0, **options):
    ocp = swb.Ocp(scene, T, N, **options)
    ocp.set_initial_state(np.zeros(ocp.nx))
    ocp.set_lagrange(scene.u[0] ** 2)
    ocp.add_terminal([q, v], [at, 0.0], [at, 0.0])
    return ocp


@pytest.mark.parametrize("bound", [0.1, 0.4, 0.9])
def test_a_dry_joint_is_a_constant_force_while_it_slides(bound):
    s = swb.Scene("x", u="push")
    s.force([s.push])
    s.friction("guide", s.q[0], bound)
    r = rest_to_rest(s, s.q[0], s.v[0]).solve()
    u, cost = least(moves(), [1.0, 0.0], -bound)
    # a mass that moves to one side all the time; it may be held by friction at the end, which costs less
    assert r.success and r.cost <= cost * (1 + 1e-6)
    run = swb.simulate(s, [0.0, 0.0], T, u=r.controls)
    np.testing.assert_allclose(run.x_end, [1.0, 0.0], atol=1e-5)
    np.testing.assert_allclose(r.cost, H * np.sum(r.controls**2), rtol=1e-8)
    assert r.optimality.verdict in ("local_optimum", "kink")


def test_two_masses_with_a_gear_are_one():
    s = swb.Scene("a b", u="push")
    s.force([s.push, 0.0])
    s.constraint("gear", s.q[1] - 2.0 * s.q[0])
    ocp = rest_to_rest(s, s.q[0], s.v[0])
    r = ocp.solve()
    # the second mass moves twice as far: 1 + 2² of inertia
    u, cost = least(moves(0.2), [1.0, 0.0])
    np.testing.assert_allclose(r.cost, cost, rtol=1e-7)
    np.testing.assert_allclose(r.controls[:, 0], u, atol=1e-4)
    assert r.optimality.verdict == "local_optimum"
    # raising a bound of the end by d changes the cost by -d times the multiplier
    more = [(least(moves(0.2), e)[1] - least(moves(0.2), -np.array(e) + [2.0, 0.0])[1]) / 2e-4 for e in ([1.0 + 1e-4, 0.0], [1.0, 1e-4])]
    np.testing.assert_allclose(-ocp.multipliers().terminal[0].ravel(), more, rtol=1e-3)


def test_a_transition_beside_an_algebraic_equation():
    m = swb.Model(states="pos v z", controls="push")
    fast = m.discrete("fast", 0)
    m.transition(m.pos > 0.5, when={fast: 0}, to={fast: 1})
    m.derivatives = [m.v, m.z, m.z - m.push * (1.0 + fast)]
    system = m.system()
    system.set_algebraic(1)
    ocp = swb.Ocp(system, T, N)
    ocp.set_initial_state([0.0, 0.0, 0.0, 0.0])
    ocp.set_lagrange(m.push**2)
    ocp.add_terminal([m.pos, m.v], [1.0, 0.0], [1.0, 0.0])
    r = ocp.solve()
    assert r.success and len(r.jumps) == 1
    # the same motion by hand: the control counts twice behind the transition
    x, v, cost = 0.0, 0.0, 0.0
    for u in r.controls[:, 0]:
        left, gain = H, 2.0 if x > 0.5 else 1.0
        if gain == 1.0:
            roots = np.roots([0.5 * u, v, x - 0.5])
            hits = [t.real for t in roots if abs(t.imag) < 1e-12 and 0 < t.real < H]
            if hits:
                t = min(hits)
                x, v, left, gain = 0.5, v + u * t, H - t, 2.0
        x, v = x + v * left + 0.5 * gain * u * left**2, v + gain * u * left
        cost += H * u**2
    np.testing.assert_allclose([x, v, cost], [1.0, 0.0, r.cost], atol=1e-6)


def test_what_cannot_be_met_says_so():
    s = swb.Scene("x", u="push")
    s.force([s.push])
    s.friction("guide", s.q[0], 0.5)
    ocp = rest_to_rest(s, s.q[0], s.v[0], control_bounds=([-0.4], [0.4]))
    r = ocp.solve()
    assert not r.success and "terminal constraint 0" in r.message


def test_what_is_refused():
    s = swb.Scene("x", u="push")
    s.force([s.push])
    s.friction("guide", s.q[0], 0.5)
    ocp = rest_to_rest(s, s.q[0], s.v[0])
    with pytest.raises(swb.StateError, match="solve"):
        ocp.sensitivity()
    ocp.add_complementarity(s.u[0], s.u[0])
    with pytest.raises(swb.UnsupportedError, match="complementarity"):
        ocp.solve()


def test_discrete_states_have_no_multipliers():
    s = swb.Scene("x", u="push")
    hit = s.discrete("hit", 0)
    s.transition(s.q[0] > 0.4, when={hit: 0}, to={hit: 1})
    s.force([s.push + 0.3 * hit])
    ocp = rest_to_rest(s, s.q[0], s.v[0])
    assert ocp.solve().success
    m = ocp.multipliers()
    assert np.all(m.costates[:, 2] == 0) and np.all(m.costates[:, :2] != 0)
    assert m.initial_state.ravel()[2] == 0 and ocp.sensitivity().cost_x0[2] == 0


@pytest.mark.parametrize("seed", range(20))
def test_random_masses_with_gears_drag_and_two_forces(seed):
    """A linear chain held together by gears is one mass with drag: the least effort is a least-norm solution of two equations."""
    draw = np.random.default_rng(seed)
    n, horizon, drag, at = int(draw.integers(3, 9)), draw.uniform(0.5, 3.0), draw.uniform(0.0, 1.0), draw.uniform(0.3, 2.0)
    ratio, masses = draw.uniform(0.5, 2.0, 2), draw.uniform(0.5, 2.0, 3)
    s = swb.Scene("a b c", u="first last")
    s.inertia(np.diag(masses))
    s.force([s.first - drag * s.v[0], 0.0, s.last])
    s.constraint("gear", s.q[1] - ratio[0] * s.q[0])
    s.constraint("belt", s.q[2] - ratio[1] * s.q[0])
    ocp = swb.Ocp(s, horizon, n)
    ocp.set_initial_state(np.zeros(6))
    ocp.set_lagrange(s.u[0] ** 2 + s.u[1] ** 2)
    ocp.add_terminal([s.q[0], s.v[0]], [at, 0.0], [at, 0.0])
    r = ocp.solve()
    mass, h = masses @ np.array([1.0, *ratio**2]), horizon / n
    rate = drag / mass

    def behind(t):
        """Velocity and position that a force of 1 over one stage leaves, a time t after its end."""
        left = np.exp(-rate * h)
        v, x = ((1 - left) / drag, (h - (1 - left) / rate) / drag) if rate > 0 else (h / mass, h**2 / (2 * mass))
        return [x + v * ((1 - np.exp(-rate * t)) / rate if rate > 0 else t), v * np.exp(-rate * t)]

    ends = np.array([behind(horizon - (k + 1) * h) for k in range(n)]).T
    u = np.linalg.lstsq(np.hstack([ends, ratio[1] * ends]), [at, 0.0], rcond=None)[0]
    np.testing.assert_allclose(r.cost, h * u @ u, rtol=1e-6)
    assert r.optimality.verdict == "local_optimum"
