"""Algebraic states and inclusions beside contacts, joints, constraints, transitions and clocks; transitions of projected systems.

References are closed forms, and SciPy between events that are found by hand; derivatives are compared with differences of these.
"""

import numpy as np
import pytest
import switchback_control as swb
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

TIGHT = {"rtol": 1e-11, "atol": 1e-13}
SEEDS = range(6)


def run(system, x0, t_end, p=(), **options):
    r = swb.simulate(system, x0, t_end, p=p, **{**TIGHT, **options})
    assert r.success, r.reason
    return r


def gradient(system, x0, t_end, p, weights):
    """Gradient of `weights` times the final state by start and parameters, by the adjoint."""
    with swb.Integrator(system, adjoint=True, **TIGHT) as i:
        i.set_params(p)
        i.reinit(x0, 0.0)
        i.advance(t_end)
        assert i.run.success, i.reason
        return i.adjoint(weights)


def check_derivatives(system, x0, t_end, p, end, free, tolerance=2e-6, h=1e-5):
    """Forward and adjoint derivatives against central differences of `end(x0, p)`, the reference; `free` are states whose start may change."""
    x0, p = np.asarray(x0, dtype=float), np.asarray(p, dtype=float)
    r = run(system, x0, t_end, p, sensitivity=True)
    n = end(x0, p).size
    steps = np.eye(p.size) * h
    by_p = np.stack([(end(x0, p + d) - end(x0, p - d)) / (2 * h) for d in steps], axis=1)
    steps = np.eye(x0.size)[list(free)] * h
    by_x = np.stack([(end(x0 + d, p) - end(x0 - d, p)) / (2 * h) for d in steps], axis=1)
    scale = max(1.0, np.abs(by_p).max(), np.abs(by_x).max())
    assert np.allclose(r.dx_dp[:n], by_p, rtol=0, atol=tolerance * scale)
    assert np.allclose(r.dx_dx0[:n, list(free)], by_x, rtol=0, atol=tolerance * scale)
    weights = np.cos(np.arange(r.x_end.size) + 0.3)
    weights[n:] = 0.0
    g = gradient(system, x0, t_end, p, weights)
    assert np.allclose(g.p, weights[:n] @ by_p, rtol=0, atol=3 * tolerance * scale)
    assert np.allclose(g.x0[list(free)], weights[:n] @ by_x, rtol=0, atol=3 * tolerance * scale)


def flow(f, t0, t1, x, events=()):
    """SciPy from t0 to t1, or to the first event."""
    for e in events:
        e.terminal = True
    return solve_ivp(f, (t0, t1), x, method="DOP853", rtol=1e-12, atol=1e-14, events=list(events) or None, dense_output=True)


def directed(g, direction):
    def event(t, x):
        return g(t, x)

    event.direction = direction
    return event


def root_of_cubic(v, a):
    """The y of y + a y³ = v."""
    y = v
    for _ in range(60):
        y -= (y + a * y**3 - v) / (1 + 3 * a * y**2)
    return y


# --- inclusions alone -----------------------------------------------------------------------------


def quadratic_step():
    """x' = c - a α - b α², y' = α with α in the step of x: from x < 0 it slides where α solves a quadratic."""
    m = swb.Model(states="x y", parameters="c a b")
    m.derivatives = [0, 0]
    s = m.system()
    x = m.graph.inputs("x", 3)
    c, a, b = m.p[0], m.p[1], m.p[2]
    f = m.graph.function([c - a * x[2] - b * x[2] ** 2, x[2] + 0 * x[0]], 3, 0, 3, "f")
    s.add_inclusion(f, m.graph.function(x[0], 2, 0, 3, "psi"), 1)
    return s


def quadratic_end(x0, p, t_end=2.0):
    c, a, b = p
    alpha = (-a + np.sqrt(a * a + 4 * b * c)) / (2 * b)
    hit = -x0[0] / c
    return np.array([0.0, x0[1] + alpha * (t_end - hit)])


def test_a_weight_that_holds_its_surface_is_a_root():
    s, p, x0 = quadratic_step(), [0.7, 0.4, 0.9], [-0.5, 0.1]
    r = run(s, x0, 2.0, p)
    assert np.allclose(r.x_end, quadratic_end(np.array(x0), p), atol=1e-10)
    assert [(e.before, e.after, e.unique) for e in r.switches] == [((1,), (0, 1), True)]
    assert r.switches[0].t == pytest.approx(0.5 / 0.7, abs=1e-10)
    assert r.n_modes == (2,)
    check_derivatives(s, x0, 2.0, p, quadratic_end, free=(0, 1))


def test_it_leaves_where_the_weight_comes_to_its_end():
    # x' = sin t + 0.2 - α: slides until the drift is below zero, and returns
    m = swb.Model(states="x")
    m.derivatives = [swb.sin(m.t) + 0.2]
    s = m.system()
    x = m.graph.inputs("x", 2)
    s.add_inclusion(m.graph.function(-0.5 * x[1] - 0.5 * x[1] ** 3, 2, 0, 0, "f"), m.graph.function(x[0], 1, 0, 0, "psi"), 1)
    r = run(s, [0.0], 5.0)
    on = np.arcsin(0.8)
    times = [e.t for e in r.switches]
    # held from the start (0.2 > 0); left upwards where sin t + 0.2 = 1
    assert times[0] == pytest.approx(on, abs=1e-9) and r.switches[0].after == (0,)

    def above(t):
        return np.cos(on) - np.cos(t) - 0.8 * (t - on)

    back = brentq(above, on + 0.5, 4.5)
    assert times[1] == pytest.approx(back, abs=1e-9)
    drift = np.sin(back) + 0.2
    assert (r.switches[1].after == (0, 1)) == (0 < drift < 1)
    # below the surface nothing holds it back
    assert r.x_end[0] < 0.0
    assert r.switches[-1].t == pytest.approx(max(back, np.pi + np.arcsin(0.2)), abs=1e-8)


def test_two_ways_on_are_named():
    def system(f):
        s = swb.System(1)
        s.add_inclusion(f, lambda x, u, p, t: [x[0]], 1)
        return s

    two_roots = system(lambda x, u, p, t: [1 - 6 * x[1] * (1 - x[1])])
    r = run(two_roots, [-1.0], 2.0)
    assert [e.unique for e in r.switches] == [False] and r.one_sided
    with pytest.warns(swb.EarlyEndWarning):
        stopped = swb.simulate(two_roots, [-1.0], 2.0, ambiguity="stop").x_end
    assert stopped[0] == pytest.approx(0.0, abs=1e-9)
    r = swb.simulate(two_roots, [-1.0], 2.0, ambiguity="stop")
    assert r.outcome == swb.RunOutcome.AMBIGUOUS and "not unique" in r.reason
    apart = system(lambda x, u, p, t: [2 * x[1] - 1])
    r = swb.simulate(apart, [0.0], 1.0, ambiguity="stop")
    assert r.outcome == swb.RunOutcome.AMBIGUOUS
    one_root = system(lambda x, u, p, t: [1 - 3 * x[1] ** 3])
    assert all(e.unique for e in run(one_root, [-1.0], 2.0).switches)


def test_products_of_steps_agree_with_finite_elements():
    # gene regulation: each of two is made where the other one is scarce
    s = swb.System(2)
    s.set_f0(lambda x, u, p, t: [-x[0], -x[1]])
    f = lambda x, u, p, t: [2.1 * (1 - x[3]) * (0.3 + x[2]), 1.7 * (1 - x[2] * x[3])]  # noqa: E731
    s.add_inclusion(f, lambda x, u, p, t: [x[0] - 0.8, x[1] - 0.7], 2)
    r = run(s, [0.2, 0.1], 2.0)
    e = swb.simulate_fesd(s, [0.2, 0.1], 2.0, 40, n_s=3)
    assert e.success and np.allclose(r.x_end, e.state, atol=1e-6)


# --- beside contacts ------------------------------------------------------------------------------


def falling(step=False, cubic=True):
    """A ball in air whose drag y solves y + a y³ = v, over a floor; with an inclusion that pulls below half a metre."""
    s = swb.Scene("h", p="g a e", states="drag", name="ball")
    y = s.states[0]
    s.force([-s.p[0] - 0.8 * y])
    s.state_rates([y + s.p[1] * y**3 - s.v[0]])
    s.contact("floor", gap=s.q[0], e=s.p[2])
    system = s.system()
    system.set_algebraic(1)
    if step:
        x = s.graph.inputs("x", 4)
        pull = s.graph.function(-1.5 * (1 - x[3]) - 0.5 * (1 - x[3]) ** 2, 4, 0, 3, "pull")
        system.add_inclusion(pull, s.graph.function(x[0] - 0.5, 3, 0, 3, "half way"), 1, rows=[1])
    return system


def falling_end(x0, p, t_end=0.9, step=False):
    g, a, e = p
    t, x, low = 0.0, np.array(x0[:2], dtype=float), x0[0] < 0.5
    for _ in range(40):
        f = lambda t, x: [x[1], -g - 0.8 * root_of_cubic(x[1], a) - (2.0 if step and low else 0.0)]  # noqa: B023, E731
        events = [directed(lambda t, x: x[0], -1)]
        if step:
            events.append(directed(lambda t, x: x[0] - 0.5, 1 if low else -1))
        r = flow(f, t, t_end, x, events)
        t, x = r.t[-1], r.y[:, -1].copy()
        if r.status == 0:
            break
        if r.t_events[0].size:
            x = np.array([0.0, -e * x[1]])
        else:
            low = not low
            x[0] = 0.5
    return np.array([*x, root_of_cubic(x[1], a)])


@pytest.mark.parametrize("step", [False, True])
def test_drag_by_an_equation_and_impacts(step):
    s, x0, p = falling(step), [1.0, 0.0, 0.3], [9.81, 0.2, 0.6]
    r = run(s, x0, 0.9, p)
    assert len(r.impacts) >= 1
    assert np.allclose(r.x_end, falling_end(x0, p, step=step), atol=1e-9)
    # the equation holds at every point of the result, also on both sides of an impact
    t = np.linspace(0, 0.9, 200)
    x = r(t)
    assert np.abs(x[:, 2] + 0.2 * x[:, 2] ** 3 - x[:, 1]).max() < 1e-8
    check_derivatives(s, x0, 0.9, p, lambda x0, p: falling_end(x0, p, step=step), free=(0, 1), tolerance=1e-5)


def test_forces_of_contacts_see_the_equation():
    # a mass that a spring pulls to the ground; the force of the spring solves an equation
    s = swb.Scene("h", p="k", states="pull", name="mass")
    y = s.states[0]
    s.force([-1.0 - y])
    s.state_rates([y + y**3 - s.p[0] - 0.5 * swb.sin(s.t)])
    s.contact("ground", gap=s.q[0])
    system = s.system()
    system.set_algebraic(1)
    r = run(system, [0.0, 0.0, 0.0], 2.0, [0.7])
    t = np.linspace(0.1, 1.9, 9)
    expected = [1.0 + brentq(lambda y, t=t: y + y**3 - 0.7 - 0.5 * np.sin(t), -3, 3) for t in t]
    assert np.allclose(r.force("ground", t)[:, 0], expected, atol=1e-8)


def driven_joint(step=False):
    """A mass with dry friction whose bound and drive contain y, y + 0.3 y³ = q + t."""
    s = swb.Scene("pos", p="mu a", states="y", name="mass")
    y = s.states[0]
    s.force([2.0 * swb.sin(2.0 * s.t) - s.p[1] * y])
    s.state_rates([y + 0.3 * y**3 - s.q[0] - 0.2 * s.t])
    s.friction("joint", s.v[0], s.p[0])
    system = s.system()
    system.set_algebraic(1)
    return system


def joint_end(x0, p, t_end=2.4):
    mu, a = p
    y = lambda t, q: root_of_cubic(q + 0.2 * t, 0.3)  # noqa: E731
    drive = lambda t, q: 2 * np.sin(2 * t) - a * y(t, q)  # noqa: E731
    t, x = 0.0, np.array(x0[:2], dtype=float)
    for _ in range(40):
        if x[1] == 0.0:
            # sticks until the drive is beyond the bound
            if abs(drive(t, x[0])) <= mu:
                ts = np.linspace(t, t_end, 4001)
                beyond = np.flatnonzero([abs(drive(s, x[0])) > mu for s in ts])
                if not beyond.size:
                    return np.array([*x, y(t_end, x[0])])
                k = beyond[0]
                t = brentq(lambda s: abs(drive(s, x[0])) - mu, ts[k - 1], ts[k], xtol=1e-14)  # noqa: B023
                sign = np.sign(drive(ts[k], x[0]))
            else:
                sign = np.sign(drive(t, x[0]))
        else:
            sign = np.sign(x[1])
        f = lambda t, x, sign=sign: [x[1], drive(t, x[0]) - sign * mu]
        # leaves the rest before it may come back to it
        first = flow(f, t, min(t + 1e-3, t_end), x)
        t, x = first.t[-1], first.y[:, -1]
        r = flow(f, t, t_end, x, [directed(lambda t, x: x[1], -sign)])
        t, x = r.t[-1], r.y[:, -1].copy()
        if r.status == 0:
            break
        x[1] = 0.0
    return np.array([*x, y(t, x[0])])


def test_friction_at_a_joint_and_an_equation():
    s, x0, p = driven_joint(), [0.1, 0.4, 0.0], [1.3, 0.6]
    r = run(s, x0, 2.4, p)
    assert len(r.switches) >= 2
    assert np.allclose(r.x_end, joint_end(x0, p), atol=1e-8)
    check_derivatives(s, x0, 2.4, p, joint_end, free=(0, 1), tolerance=2e-5)


@pytest.mark.parametrize("kind", ["algebraic", "inclusion"])
def test_constraints(kind):
    """Two masses on a gear, q2 = 2 q1: with unit inertia (1 + 4) q1'' = f1 + 2 f2."""
    s = swb.Scene("a b", p="load", states="y" if kind == "algebraic" else 0, name="gear")
    q, v = s.q, s.v
    first = s.p[0] - q[0]
    if kind == "algebraic":
        first = first - s.states[0]
        s.state_rates([s.states[0] + 0.4 * s.states[0] ** 3 - v[1]])
    s.force([first, -0.1 * v[1]])
    s.constraint("gear", q[1] - 2 * q[0])
    system = s.system()
    if kind == "algebraic":
        system.set_algebraic(1)
    else:
        x = s.graph.inputs("x", 5)
        f = s.graph.function(-0.3 * x[4] - 0.4 * x[4] ** 2, 5, 0, 1, "f")
        system.add_inclusion(f, s.graph.function(x[1] - 0.6, 4, 0, 1, "psi"), 1, rows=[3])

    def end(x0, p, t_end=1.5):
        t, x, high = 0.0, np.array([x0[0], x0[2]]), x0[0] > 0.3

        def f(t, x):
            f1, f2 = p[0] - x[0], -0.2 * x[1]
            if kind == "algebraic":
                f1 -= root_of_cubic(2 * x[1], 0.4)
            elif high:
                f2 -= 0.7
            return [x[1], (f1 + 2 * f2) / 5]

        for _ in range(9):
            events = [] if kind == "algebraic" else [directed(lambda t, x: x[0] - 0.3, -1 if high else 1)]
            r = flow(f, t, t_end, x, events)
            t, x = r.t[-1], r.y[:, -1]
            if r.status == 0:
                break
            high = not high
        both = [x[0], 2 * x[0], x[1], 2 * x[1]]
        return np.array(both + ([root_of_cubic(2 * x[1], 0.4)] if kind == "algebraic" else []))

    x0 = [0.2, 0.4, 0.5, 1.0] + ([0.0] if kind == "algebraic" else [])
    r = run(system, x0, 1.5, [0.8])
    assert np.allclose(r.x_end, end(x0, [0.8]), atol=1e-9)
    h = 1e-5
    by_p = (end(x0, [0.8 + h]) - end(x0, [0.8 - h])) / (2 * h)
    assert np.allclose(run(system, x0, 1.5, [0.8], sensitivity=True).dx_dp[:, 0], by_p, atol=1e-6)
    w = np.cos(np.arange(len(x0)) + 0.3)
    assert gradient(system, x0, 1.5, [0.8], w).p[0] == pytest.approx(w @ by_p, abs=1e-6)


def relay(kind, inclusion, scene=swb.Scene):
    """A mass under a relay of its velocity, as a switch of the scene or as an inclusion."""
    s = scene("pos", p="load a", name="mass")
    q, v = s.q[0], s.v[0]
    force = swb.sin(3 * s.t) + s.p[0]
    if not inclusion:
        force = force - s.p[1] * swb.sign(v - 0.1) - 0.3 * swb.where(v > -0.4, 1, 0) * q
    s.force([force])
    if kind == "joint":
        s.friction("joint", v, 0.3)
    else:
        s.contact("stop", gap=q + 0.3, e=0.5)
    system = s.system()
    if inclusion:
        x = s.graph.inputs("x", 4)
        f = s.graph.function(s.p[1] * (1 - 2 * x[2]) - 0.3 * x[3] * x[0], 4, 0, 2, "relays")
        psi = s.graph.function([x[1] - 0.1, x[1] + 0.4], 2, 0, 2, "psi")
        system.add_inclusion(f, psi, 2, rows=[1])
    return system


@pytest.mark.parametrize("kind", ["joint", "stop"])
@pytest.mark.parametrize("a", [0.5, 1.4])
def test_contacts_that_push_what_a_step_holds(kind, a):
    """The weight that holds the velocity is found with the forces: as with a switch that the scene states itself."""
    x0, p = [0.1, 0.3], [0.1, a]
    one, other = (run(relay(kind, i), x0, 4.0, p, sensitivity=True) for i in (True, False))
    assert [e.after for e in one.switches] == [e.after for e in other.switches]
    assert [e.t for e in one.switches] == pytest.approx([e.t for e in other.switches], abs=1e-9)
    assert a < 1.0 or any(1 in e.after for e in one.switches if e.subsystem > 0)
    assert np.allclose(one.x_end, other.x_end, atol=1e-10)
    assert np.allclose(one.dx_dp, other.dx_dp, atol=1e-8) and np.allclose(one.dx_dx0, other.dx_dx0, atol=1e-8)
    t = np.linspace(0.05, 3.9, 23)
    assert np.allclose(one.force(kind, t), other.force(kind, t), atol=1e-8)
    w = np.array([0.4, -1.0])
    g, h = (gradient(relay(kind, i), x0, 4.0, p, w) for i in (True, False))
    assert np.allclose(g.p, h.p, atol=1e-8) and np.allclose(g.x0, h.x0, atol=1e-8)


def test_a_step_holds_a_further_state_beside_impacts():
    """A heater with a quadratic valve keeps a temperature, while the ball it stands on jumps; closed form of both."""
    s = swb.Scene("h", p="g c", states="heat", name="ball")
    s.force([-s.p[0]])
    s.state_rates([s.p[1]])
    s.contact("floor", gap=s.q[0], e=1.0)
    system = s.system()
    x = s.graph.inputs("x", 4)
    f = s.graph.function(-x[3] - x[3] ** 2, 4, 0, 2, "valve")
    system.add_inclusion(f, s.graph.function(x[2] - 1.0, 3, 0, 2, "psi"), 1, rows=[2])
    r = run(system, [1.0, 0.0, 0.4], 2.0, [2.0, 0.9])
    # up at 0.9 to 1, then held; the ball falls in 1, and is back on top at 2
    assert np.allclose(r.x_end, [1.0, 0.0, 1.0], atol=1e-9)
    step = [e for e in r.switches if e.subsystem == 1]
    assert [e.after for e in step] == [(0, 1)] and step[0].t == pytest.approx(0.6 / 0.9, abs=1e-9)
    r = run(system, [1.0, 0.0, 0.4], 2.0, [2.0, 2.5])
    # too much for the valve: it stays open, 0.4 + 2.5 t to 1 and then 0.5 t
    assert r.x_end[2] == pytest.approx(1.0 + 0.5 * (2.0 - 0.6 / 2.5), abs=1e-9)


# --- beside projected systems -----------------------------------------------------------------------


def test_a_projected_system_and_an_equation():
    """x' = y - 0.5, y + 0.2 y³ = p - x..., held at x <= 1: the multiplier is what would leave."""
    s = swb.Projected("x w y", p="c", name="held")
    x, w, y = s.x[0], s.x[1], s.x[2]
    s.f([y, 0.3 - x, y + 0.2 * y**3 - s.p[0] + 0.1 * w])
    s.constraint("wall", 1.0 - x)
    system = s.system()
    system.set_algebraic(1)

    def end(x0, p, t_end=2.0):
        y = lambda w: root_of_cubic(p[0] - 0.1 * w, 0.2)  # noqa: E731
        free = lambda t, x: [y(x[1]), 0.3 - x[0]]  # noqa: E731
        r = flow(free, 0.0, t_end, x0[:2], [directed(lambda t, x: x[0] - 1.0, 1)])
        t, x = r.t[-1], r.y[:, -1]
        if r.status == 1:
            x = np.array([1.0, x[1] - 0.7 * (t_end - t)])
        return np.array([*x, y(x[1])])

    x0, p = [0.2, 0.5, 0.0], [1.1]
    r = run(system, x0, 2.0, p)
    assert np.allclose(r.x_end, end(x0, p), atol=1e-10)
    assert np.allclose(r.force("wall", [1.8])[0, 0], r(1.8)[2], atol=1e-8)
    check_derivatives(system, x0, 2.0, p, end, free=(0, 1), tolerance=1e-6)


@pytest.mark.parametrize("a", [0.4, 1.3])
def test_a_projected_system_and_a_step(a):
    """x' = a - α(2 - α)/2 in the step of x + w, w' = 0.5: it crosses or is held at the wall."""
    s = swb.Projected("x w", p="a", name="held")
    s.f([s.p[0], 0.5])
    s.constraint("wall", 1.0 - s.x[0])
    system = s.system()
    z = s.graph.inputs("x", 3)
    f = s.graph.function(-0.5 * z[2] - 0.25 * z[2] ** 2, 3, 0, 1, "f")
    system.add_inclusion(f, s.graph.function(z[1] - 0.6, 2, 0, 1, "psi"), 1, rows=[0])

    def end(x0, p, t_end=1.6):
        cross = (0.6 - x0[1]) / 0.5
        x = min(1.0, x0[0] + p[0] * cross)
        return np.array([min(1.0, x + (p[0] - 0.75) * (t_end - cross)), x0[1] + 0.5 * t_end])

    x0 = [0.7, 0.2]
    r = run(system, x0, 1.6, [a])
    assert np.allclose(r.x_end, end(x0, [a]), atol=1e-10)
    check_derivatives(system, x0, 1.6, [a], end, free=(0, 1), tolerance=1e-6)


def test_a_step_that_the_wall_pushes():
    """x' = 1 - 2α in the step of x - w, while w pushes x from below: held by both."""
    s = swb.Projected("x w", name="held")
    s.f([0.5, 1.0])
    s.constraint("floor", s.x[0] - s.x[1] + 1.0)
    system = s.system()
    z = s.graph.inputs("x", 3)
    system.add_inclusion(s.graph.function(-z[2], 3, 0, 0, "f"), s.graph.function(z[0] - 0.4, 2, 0, 0, "psi"), 1, rows=[0])
    r = run(system, [0.0, 0.0], 3.0)
    # 0.4 is reached at 0.8 and held with α = 1/2, until the floor, which pushes x with half of what w loses, arrives at w = 1.4
    assert r(1.2)[0] == pytest.approx(0.4, abs=1e-9)
    x, w = r.x_end
    assert x - w + 1.0 == pytest.approx(0.0, abs=1e-8)
    # both are pushed apart by one multiplier l: x' = 0.5 - α + l, w' = 1 - l, x' = w'
    start = 1.4
    rate = 0.5 * (0.5 - 1.0 + 1.0)
    assert x == pytest.approx(0.4 + rate * (3.0 - start), abs=1e-8)


def test_transitions_of_projected_systems():
    """A state that is held, and sent back by a reset wherever the other one comes to one; closed form."""
    s = swb.Projected("x y", p="a b", name="sent back")
    gear = s.discrete("gear", 1)
    s.f([gear * s.p[0], 1.0])
    s.constraint("wall", 0.5 - s.x[0])
    for k in (1, 2):
        back = {s.x[0]: s.x[0] - s.p[1], s.x[1]: 0.0}
        s.transition(s.x[1] > 1.0, when={gear: k}, reset=back, to={gear: k + 1}, name=f"back {k}")
    system = s.system()

    def end(x0, p, t_end=2.7):
        a, b = p
        first = 1.0 - x0[1]
        x = min(0.5, x0[0] + a * first) - b
        x = min(0.5, x + 2 * a) - b
        return np.array([min(0.5, x + 3 * a * (t_end - first - 1)), t_end - first - 1])

    x0, p = [0.0, 0.2, 1.0], [0.7, 0.9]
    r = run(system, x0, 2.7, p)
    assert len(r.jumps) == 2 and np.allclose(r.x_end[:2], end(x0, p), atol=1e-10)
    assert r.mode("wall", [0.75, 0.9, 1.75, 2.65]).tolist() == [1, 0, 1, 1]
    check_derivatives(system, x0, 2.7, p, end, free=(0, 1), tolerance=1e-6)
    # every start without the discrete state begins with its initial value
    assert np.allclose(swb.simulate(system, x0[:2], 2.7, p=p, **TIGHT).x_end, r.x_end, atol=1e-12)


def test_a_reset_out_of_the_set_says_so():
    s = swb.Projected("x", name="held")
    s.f([1.0])
    s.constraint("wall", 1.0 - s.x[0])
    s.transition(s.t > 0.25, reset={s.x[0]: 2.0}, name="out", when={s.discrete("done"): 0}, to={s.x[1]: 1})
    r = swb.simulate(s, [0.0], 1.0)
    assert not r.success and "leaves the set" in r.reason and "wall" in r.reason


def test_clocks_of_projected_systems():
    """A sampled push: held between the strikes of a clock."""
    s = swb.Projected("x", p="k", name="sampled")
    push = s.hold(s.p[0] - s.x[0], 0.25, name="push")
    s.f([push])
    s.constraint("wall", 0.6 - s.x[0])
    system = s.system()

    def end(x0, p):
        x = x0[0]
        for _ in range(6):
            x = min(0.6, x + 0.25 * (p[0] - x))
        return np.array([x])

    for k in (0.5, 1.2):
        r = run(system, [0.0], 1.5, [k])
        assert r.x_end[0] == pytest.approx(end([0.0], [k])[0], abs=1e-10)
        h = 1e-6
        by_p = (end([0.0], [k + h]) - end([0.0], [k - h])) / (2 * h)
        assert run(system, [0.0], 1.5, [k], sensitivity=True).dx_dp[0, 0] == pytest.approx(by_p[0], abs=1e-7)


# --- beside transitions, clocks and choices ---------------------------------------------------------


@pytest.mark.parametrize("algebraic", [False, True])
def test_steps_beside_transitions_and_clocks(algebraic):
    """A quadratic valve holds a level; a transition raises the level that it holds, a clock counts."""
    m = swb.Model(states="x y" + (" z" if algebraic else ""), parameters="c")
    level = m.discrete("level", 0)
    ticks = m.hold(m.x[1], 0.5, name="ticks")
    z = m.x[2] if algebraic else m.p[0]
    m.derivatives = [z, 1.0 + 0 * ticks] + ([z + 0.2 * z**3 - m.p[0]] if algebraic else [])
    m.transition(m.x[1] > 1.2, when={level: 0}, to={level: 1}, name="raise")
    s = m.system()
    if algebraic:
        s.set_algebraic(1)
    n = s.nx
    x = m.graph.inputs("x", n + 1)
    place = 3 if algebraic else 2
    f = m.graph.function(-x[n] - x[n] ** 2, n + 1, 0, 1, "valve")
    s.add_inclusion(f, m.graph.function(x[0] - 0.5 - 0.4 * x[place], n, 0, 1, "psi"), 1, rows=[0])

    def end(x0, p, t_end=2.5):
        c = root_of_cubic(p[0], 0.2) if algebraic else p[0]
        up = 1.2 - x0[1]
        x = min(0.5, x0[0] + c * up)
        return np.array([min(0.9, x + c * (t_end - up)), x0[1] + t_end])

    for c in (0.3, 0.9):
        x0 = [0.2, 0.1] + ([0.0] if algebraic else [])
        r = swb.simulate(s, x0, 2.5, p=[c], sensitivity=True, **TIGHT)
        assert r.success, r.reason
        assert np.allclose(r.x_end[:2], end(x0, [c]), atol=1e-9)
        h = 1e-6
        by_p = (end(x0, [c + h]) - end(x0, [c - h])) / (2 * h)
        assert np.allclose(r.dx_dp[:2, 0], by_p, atol=1e-6)


# --- nonsense -----------------------------------------------------------------------------------------


def ball(equation, contact=lambda s: 0.0 * s.q[0] + s.q[0]):
    s = swb.Scene("h", states="z", name="ball")
    s.force([-9.81 - 0.3 * s.states[0]])
    s.state_rates([equation(s, s.states[0])])
    s.contact("floor", gap=contact(s), e=0.5)
    system = s.system()
    system.set_algebraic(1)
    return system


def test_equations_that_are_none_are_refused_in_words():
    with pytest.raises(swb.StateError, match="not of index 1"):
        swb.simulate(ball(lambda s, z: s.v[0] - 1.0), [1.0, 0.0, 0.0], 1.0)
    with pytest.raises(swb.NumericError, match="no consistent start.*singular"):
        swb.simulate(ball(lambda s, z: (z - 1) ** 2), [1.0, 0.0, 1.0], 1.0)
    with pytest.raises(swb.NumericError, match="no consistent start"):
        swb.simulate(ball(lambda s, z: z**2 + 1), [1.0, 0.0, 1.0], 1.0)
    # behind the impact the equation has no solution
    r = swb.simulate(ball(lambda s, z: z**2 + s.v[0] - 1), [1.0, -1.0, 1.0], 1.0)
    assert not r.success and "algebraic equations were not solved" in r.reason


def test_what_algebraic_states_may_not_do():
    s = swb.Scene("h", name="ball")
    s.force([-9.81])
    system = s.system()
    with pytest.raises(swb.SwitchbackError, match="index 1|further states"):
        system.set_algebraic(1)
        swb.simulate(system, [1.0, 0.0], 1.0)
    s = swb.Projected("x y", name="held")
    s.f([1.0, s.x[1] - s.x[0]])
    s.constraint("wall", 1 - s.x[1])
    system = s.system()
    system.set_algebraic(1)
    with pytest.raises(swb.UnsupportedError, match="algebraic state 1"):
        swb.simulate(system, [0.0, 0.0], 1.0)
    with pytest.raises(swb.UnsupportedError, match="by events"):
        swb.simulate_fesd(system, [0.0, 0.0], 1.0, 4)


def test_inclusions_of_coordinates_and_of_what_no_weight_holds():
    s = swb.Scene("h", name="ball")
    s.force([-1.0])
    s.friction("joint", s.v[0], 0.1)
    x = s.graph.inputs("x", 3)
    f, of_v = s.graph.function(4 * (1 - x[2]) ** 3, 3, 0, 0, "f"), s.graph.function(x[1] + 0.5, 2, 0, 0, "psi")
    system = s.system()
    system.add_inclusion(f, of_v, 1, rows=[0])
    with pytest.raises(swb.UnsupportedError, match="coordinates move with the velocities"):
        swb.simulate(system, [1.0, 0.0], 1.0)
    # not affine, and friction acts on its function
    system = s.system()
    system.add_inclusion(f, of_v, 1, rows=[1])
    r = swb.simulate(system, [1.0, 0.0], 1.0)
    assert r.outcome == swb.RunOutcome.NO_CONTINUATION and "its weight cannot hold it" in r.reason


def test_callbacks_that_fail_beside_contacts():
    def system(fails):
        s = swb.Scene("h", name="ball")
        s.force([-9.81])
        s.contact("floor", gap=s.q[0], e=0.5)
        made = s.system()
        with swb.tracing(False):
            made.add_inclusion(fails, lambda x, u, p, t: [x[0] - 0.5], 1, rows=[1])
        return made

    def raises(x, u, p, t):
        if t > 0.2:
            raise ValueError("not today")
        return [-x[2]]

    with pytest.raises(ValueError, match="not today"):
        swb.simulate(system(raises), [1.0, 0.0], 1.0)
    r = swb.simulate(system(lambda x, u, p, t: [np.nan if t > 0.2 else -x[2]]), [1.0, 0.0], 1.0)
    assert not r.success and "not finite" in r.reason


# --- a random family ----------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", SEEDS)
def test_random_scenes(seed):
    """A chain of masses on springs over a floor, with a nonlinear damper by an equation and a step in a position."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 4))
    k, c, a, e = rng.uniform(0.5, 3, n), rng.uniform(0.1, 0.8, n), rng.uniform(0.1, 1.0), rng.uniform(0.3, 0.9)
    at, push, bend = rng.uniform(0.2, 0.7), rng.uniform(0.3, 1.5), rng.uniform(0.0, 1.0)
    x0 = np.concatenate([rng.uniform(0.4, 1.2, n), rng.uniform(-1.5, 0.5, n)])
    s = swb.Scene(n, p="g", states="y", name="chain")
    q, v, y = s.q, s.v, s.states[0]
    force = [-s.p[0] - c[i] * (y if i == 0 else v[i]) - (k[i] * (q[i] - q[i - 1]) if i else 0) for i in range(n)]
    force = [f + (k[i + 1] * (q[i + 1] - q[i]) if i + 1 < n else 0) for i, f in enumerate(force)]
    s.force(force)
    s.state_rates([y + a * y**3 - v[0]])
    s.contact("floor", gap=q[0], e=e)
    system = s.system()
    system.set_algebraic(1)
    x = s.graph.inputs("x", 2 * n + 2)
    m = 2 * n + 1
    f = s.graph.function(push * (1 - x[m]) + bend * (1 - x[m]) ** 2, m + 1, 0, 1, "push")
    system.add_inclusion(f, s.graph.function(x[n - 1] - at, m, 0, 1, "psi"), 1, rows=[2 * n - 1])

    def end(x0, p, t_end=0.8):
        t, x, low = 0.0, np.array(x0, dtype=float), x0[n - 1] < at

        def rates(t, x):
            q, v = x[:n], x[n:]
            f = -p[0] - c * np.concatenate([[root_of_cubic(v[0], a)], v[1:]])
            for i in range(1, n):
                f[i] -= k[i] * (q[i] - q[i - 1])
                f[i - 1] += k[i] * (q[i] - q[i - 1])
            f[n - 1] += (push + bend) if low else 0.0
            return np.concatenate([v, f])

        for _ in range(60):
            events = [directed(lambda t, x: x[0], -1), directed(lambda t, x: x[n - 1] - at, 1 if low else -1)]
            r = flow(rates, t, t_end, x, events)
            t, x = r.t[-1], r.y[:, -1].copy()
            if r.status == 0:
                break
            if r.t_events[0].size:
                x[0], x[n] = 0.0, -e * x[n]
            else:
                low = not low
                x[n - 1] = at
        return np.array([*x, root_of_cubic(x[n], a)])

    start = np.array([*x0, 0.0])
    r = run(system, start, 0.8, [2.0])
    assert np.allclose(r.x_end, end(x0, [2.0]), atol=1e-7)
    check_derivatives(system, start, 0.8, [2.0], lambda x0, p: end(x0[:-1], p), free=range(2 * n), tolerance=1e-5)
