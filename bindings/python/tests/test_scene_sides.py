"""Derivatives of scenes where contacts close at one time, and where a gap is only touched: those of one side, said so, or not known."""

import numpy as np
import pytest

import switchback_control as swb
from switchback_control import cos, sin
from switchback_control.expr import Model, where

TOLERANCES = {"rtol": 1e-11, "atol": 1e-12}
FINE = {"rtol": 1e-13, "atol": 1e-14}
STEP = 1e-6
N = 30


def sides(scene, x, t, middle):
    """Differences to either side of a state reached, one column for each initial value; NaN where bodies overlap at the start."""
    n = len(x) // 2

    def end(x):
        try:
            run = scene.simulate(x[:n], x[n:], t, **FINE)
        except swb.RangeError:
            return np.full(2 * n, np.nan)
        assert run.success, run.reason
        return run.x_end

    units = STEP * np.eye(2 * n)
    right = [(end(x + d) - middle) / STEP for d in units]
    left = [(middle - end(x - d)) / STEP for d in units]
    return np.array(right).T, np.array(left).T


def adjoint(scene, x, t):
    """The rows of the derivative by the adjoint."""
    with swb.Integrator(scene, adjoint=1, **TOLERANCES) as i:
        i.reinit(x)
        i.advance(t)
        return np.array([i.adjoint(row).x0 for row in np.eye(len(x))])


def check(scene, x, t, two_sided=None, endless=False):
    """A column that is known is one of the sides, both unless `one_sided` is set; one that is not has no sides, as the motion jumps, or is
    that of `endless` impacts in no time."""
    x = np.array(x, dtype=float)
    n = len(x) // 2
    run = scene.simulate(x[:n], x[n:], t, sensitivity=True, **TOLERANCES)
    assert run.success, run.reason
    own = run.dx_dx0
    right, left = sides(scene, x, t, run.x_end)
    known = np.isfinite(own).all(axis=0)
    for c in range(2 * n):
        size = 1e-3 * (1 + np.max(np.abs(own[:, c])))
        near = [bool(np.max(np.abs(own[:, c] - side[:, c])) < size) for side in (right, left)]
        if known[c]:
            assert any(near) and (run.one_sided or all(near)), (c, own[:, c], right[:, c], left[:, c])
        else:
            jumps = [np.isnan(side[0, c]) or np.max(np.abs(side[:, c])) > 1e-3 / STEP for side in (right, left)]
            assert run.one_sided and (endless or all(jumps)), (c, own[:, c], right[:, c], left[:, c])
    if two_sided is not None:
        assert run.one_sided != two_sided and (not two_sided or known.all())
    rows = adjoint(scene, x, t)
    assert rows == pytest.approx(own, rel=1e-9, abs=1e-9, nan_ok=True)
    return run, known


def corner(rng, normals, masses, e, law="newton"):
    """A particle that comes to the point where two walls meet, under a constant force, and a scene of it."""
    s = swb.Scene("x y", name="corner")
    force = rng.uniform(-1, 1, 2)
    s.inertia(list(masses))
    s.force(list(force))
    s.impact_law(law)
    point = rng.uniform(-1, 1, 2)
    for k in range(2):
        a, b = normals[k]
        s.contact(f"wall{k}", gap=a * (s.q[0] - point[0]) + b * (s.q[1] - point[1]), e=e[k])
    # it comes with these rates of the gaps
    arrival = np.linalg.solve(normals, -rng.uniform(0.5, 2, 2))
    a, t = force / masses, rng.uniform(0.3, 1)
    start = arrival - a * t
    return s, [*(point - start * t - 0.5 * a * t**2), *start], t


def test_corners_whose_walls_do_not_feel_each_other():
    """Both sides are the same, as the impacts commute."""
    rng = np.random.default_rng(1)
    for _ in range(N):
        masses, angle = rng.uniform(0.3, 3, 2), rng.uniform(0, 2 * np.pi)
        first = np.array([np.cos(angle), np.sin(angle)])
        second = np.array([-masses[0] * first[1], masses[1] * first[0]])
        s, x, t = corner(rng, np.array([first, second / np.hypot(*second)]), masses, rng.uniform(0.1, 1, 2))
        run, _ = check(s, x, t + 0.1, two_sided=True)
        assert len(run.impacts) == 2


def test_a_ball_into_a_right_angle():
    """It comes back along the way it came: `x(2) = e`, `dx(2)/dx(0) = -e`."""
    s = swb.Scene("x y")
    s.force([0, 0])
    for name, q in zip(("wall", "floor"), s.q):
        s.contact(name, gap=q, e=0.5)
    run = s.simulate([1, 1], [-1, -1], 2.0, sensitivity=True, **TOLERANCES)
    assert not run.one_sided and run.dx_dx0[0] == pytest.approx([-0.5, 0, -1, 0], abs=1e-9)
    assert all(i.simultaneous for i in run.impacts)
    assert run.impact_derivatives[:, :2] == pytest.approx(np.eye(2), abs=1e-9)


@pytest.mark.parametrize("law", ["newton", "sequential"])
def test_corners_of_any_angle(law):
    rng = np.random.default_rng(2)
    found = 0
    for k in range(N):
        # one after the other they come to no end where they close tightly
        angle, wide = rng.uniform(0, 2 * np.pi), rng.uniform(0.4, 2.7 if law == "newton" else 2.0)
        e = rng.uniform(0.3, 1, 2) if k % 3 or law != "newton" else np.zeros(2)
        normals = np.array([[np.cos(a), np.sin(a)] for a in (angle, angle + wide)])
        s, x, t = corner(rng, normals, rng.uniform(0.3, 3, 2), e, law)
        _, known = check(s, x, t + 0.05, endless=not e.any())
        found += known.all()
    assert found > 0


def test_flat_landings():
    """What turns the box parts its corners, and the motion jumps; what does not has a derivative."""
    rng = np.random.default_rng(3)
    for k in range(N):
        w, h, y, g = rng.uniform(0.05, 0.5), rng.uniform(0.05, 0.5), rng.uniform(0.1, 1), rng.uniform(1, 10)
        mu, e = (rng.uniform(0.1, 1) if k % 2 else 0.0), (0.0 if k % 5 == 0 else rng.uniform(0.1, 0.9))
        s = swb.Scene("x y a")
        s.inertia([1, 1, (w * w + h * h) / 3])
        s.force([0, -g, 0])
        _, q, a = s.q
        for name, c in (("left", -w), ("right", w)):
            slides = s.q[0] + c * cos(a) + h * sin(a)
            s.contact(name, gap=q + c * sin(a) - h * cos(a), tangents=[slides] if mu else [], mu=mu, e=e)
        t = np.sqrt(2 * (y - h) / g) if y > h else 0.0
        if t < 0.05:
            y, t = h + 0.1, np.sqrt(0.2 / g)
        _, known = check(s, [0, y, 0, rng.uniform(-1, 1), 0, 0], t + 0.3 * t * max(e, 0.1), endless=e == 0)
        assert known[[0, 1, 3, 4]].all()


@pytest.mark.parametrize("law", ["newton", "sequential"])
def test_cradles_that_touch(law):
    rng = np.random.default_rng(4)
    for k in range(N // 2):
        s = swb.Scene("a b c")
        s.inertia(list(rng.uniform(0.3, 3, 3)))
        s.force([0, 0, 0])
        s.impact_law(law)
        e = (1.0, rng.uniform(0.5, 0.9), 0.0 if law == "newton" else 0.8)[k % 3]
        for i in (0, 1):
            s.contact(f"{i}", gap=s.q[i + 1] - s.q[i] - 1, e=e)
        run, known = check(s, [-0.5, 1, 2, 1, 0, 0], 0.6)
        assert run.one_sided and known[[0, 3]].all()


def test_grazing_orbits():
    """`x = a sin(w t)` below a stop: where it touches, the side without an impact, and `one_sided`."""
    rng = np.random.default_rng(5)
    for _ in range(N):
        w, stop, e = rng.uniform(0.5, 2), rng.uniform(0.2, 3), rng.uniform(0.1, 1)
        s = swb.Scene("x")
        s.force([-w * w * s.q[0]])
        s.contact("stop", gap=stop - s.q[0], e=e)
        t = rng.uniform(2, 4) / w
        free = np.array([[np.cos(w * t), np.sin(w * t) / w], [-w * np.sin(w * t), np.cos(w * t)]])
        for off in (0.0, -1e-6, -(10.0 ** rng.uniform(-6, -1)), 1e-6, 10.0 ** rng.uniform(-6, -1)):
            run = s.simulate([0], [w * stop * (1 + off)], t, sensitivity=True, rtol=1e-10, atol=1e-12)
            assert run.one_sided == (off == 0.0), off
            if off < 0 or not run.impacts:
                assert off <= 0 and run.dx_dx0 == pytest.approx(free, abs=1e-6)


def test_guards_and_surfaces_that_are_touched():
    rng = np.random.default_rng(6)
    for k in range(N):
        w, level = rng.uniform(0.5, 2), rng.uniform(0.2, 3)
        m = Model(states="position v n")
        x, v, n = m.x
        if k % 2:
            m.transition(x > level, reset={n: n + 1})
            m.derivatives = [v, -w * w * x, 0]
        else:
            m.derivatives = [v, -w * w * x, where(x > level, 1, 0)]
        for off in (0.0, -1e-6, -(10.0 ** rng.uniform(-6, -1)), 1e-6):
            run = swb.simulate(m, [0, w * level * (1 + off), 0], 3 / w, sensitivity=True, rtol=1e-10, atol=1e-12)
            assert run.success and run.one_sided == (off == 0.0), (k, off)


def test_transitions_at_one_time():
    """Two guards vanish at once, each on its own: the derivatives are those of the side on which they do so in the order of the log."""
    rng = np.random.default_rng(7)
    for _ in range(N):
        m = Model(states="a b va vb")
        a, b, va, vb = m.x
        e, mix, force = rng.uniform(0.3, 1, 2), rng.uniform(-0.3, 0.3), rng.uniform(-1, 0, 2)
        m.transition(a < 0, reset={va: -e[0] * va, vb: vb + mix * va})
        m.transition(b < 0, reset={vb: -e[1] * vb})
        m.derivatives = [va, vb, *force]
        t, arrival = rng.uniform(0.3, 1), -rng.uniform(1, 2, 2)
        start = arrival - force * t
        x = np.array([*(-start * t - 0.5 * force * t**2), *start])
        run = swb.simulate(m, x, t + 0.05, sensitivity=True, **TOLERANCES)
        order = [j.transition for j in run.jumps]
        at_once = run.jumps[0].t == run.jumps[1].t
        assert run.success and (run.one_sided or not at_once) and sorted(order) == [0, 1]
        # first one and then the other, each at its own time
        s, v = np.eye(4) + np.diag([t, t], 2), arrival
        for i, k in enumerate(order):
            by = ([[-e[0], 0], [mix, 1]], [[1, 0], [0, -e[1]]])[k]
            f, dt = np.array([*v, *force]), -s[k] / v[k]
            reset, v = np.eye(4), np.array(by) @ v
            reset[2:, 2:] = by
            s = reset @ (s + np.outer(f, dt)) - np.outer([*v, *force], dt)
            assert run.jump_derivatives[i] == pytest.approx(dt, abs=1e-8)
        wanted = (np.eye(4) + np.diag([0.05, 0.05], 2)) @ s
        assert run.dx_dx0 == pytest.approx(wanted, abs=1e-8)
        assert adjoint(m, x, t + 0.05) == pytest.approx(wanted, abs=1e-8)
