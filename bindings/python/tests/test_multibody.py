"""Joints in space: dynamics of trees against a projection of Newton's and Euler's equations, closed forms, and loops."""

import numpy as np
import pytest

import switchback_control as swb
from switchback_control.multibody import Trees

G = 9.81
TIGHT = {"rtol": 1e-10, "atol": 1e-11}


def random_tree(seed, n=7, free=True, gravity=(0.3, -0.2, -9.81)):
    """Bodies of any inertia with joints of all kinds at any places."""
    rng = np.random.default_rng(seed)
    w = swb.World(gravity, space=True)

    def body(k):
        a = rng.normal(size=(3, 3))
        return w.link(rng.uniform(0.5, 2), a @ a.T + 0.5 * np.eye(3), name=f"b{k}")

    def anywhere():
        return dict(at=rng.normal(size=3), to=rng.normal(size=3), axis=rng.normal(size=3), turn=rng.normal(size=4))

    bodies = [body(0)]
    if not free:
        w.joint("hinge", None, bodies[0], name="j0", **anywhere())
    for k in range(1, n):
        bodies.append(body(k))
        kind = ("hinge", "slider", "ball", "fixed", "hinge")[rng.integers(5)]
        w.joint(kind, bodies[rng.integers(k)], bodies[k], name=f"j{k}", **anywhere())
    return w


def central(f, h):
    """A difference of order four."""
    return (8 * (f(h) - f(-h)) - (f(2 * h) - f(-2 * h))) / (12 * h)


@pytest.mark.parametrize("seed", range(6))
def test_dynamics_are_those_of_the_single_bodies(seed):
    """M = J' m J and the forces beside it, with J and its rate from where the bodies are: no recursion."""
    w = random_tree(seed, free=seed % 2 == 0)
    trees = Trees.of(w.bodies, w.joints, {b.name: "free" for b in w.bodies})
    rng = np.random.default_rng(seed + 100)
    q, v = rng.normal(size=trees.n_q), rng.normal(size=trees.n_v)

    def flow(h):
        def rates(x):
            return np.array(trees.rates(x, v), dtype=float)

        a = rates(q)
        b = rates(q + h / 2 * a)
        c = rates(q + h / 2 * b)
        return q + h / 6 * (a + 2 * b + 2 * c + rates(q + h * c))

    def velocities(q, v):
        states, _ = trees.states(q, v)
        return np.concatenate([[*states[b.name].velocity, *states[b.name].omega] for b in w.bodies]).astype(float)

    def positions(q):
        states, _ = trees.states(q, v)
        return np.concatenate([states[b.name].position for b in w.bodies]).astype(float)

    def turns(q):
        states, _ = trees.states(q, v)
        return np.array([states[b.name].rotation for b in w.bodies], dtype=float)

    now = velocities(q, v).reshape(-1, 6)
    assert central(lambda h: positions(flow(h)), 1e-4) == pytest.approx(now[:, :3].ravel(), abs=1e-8)
    for r, rate, omega in zip(turns(q), central(lambda h: turns(flow(h)), 1e-4), now[:, 3:]):
        spin = rate @ r.T
        assert [spin[2, 1], spin[0, 2], spin[1, 0]] == pytest.approx(omega, abs=1e-8)
    j = np.array([velocities(q, e) for e in np.eye(trees.n_v)]).T
    bias = central(lambda h: velocities(flow(h), v), 1e-4)
    n = 6 * len(w.bodies)
    m, f = np.zeros((n, n)), np.zeros(n)
    for k, (body, r, state) in enumerate(zip(w.bodies, turns(q), now)):
        a, b = slice(6 * k, 6 * k + 3), slice(6 * k + 3, 6 * k + 6)
        inertia = r @ body.inertia @ r.T
        m[a, a], m[b, b] = body.mass * np.eye(3), inertia
        f[a], f[b] = body.mass * np.array(w.gravity), -np.cross(state[3:], inertia @ state[3:])
    frames = trees.frames(q, v)
    mine = np.array(trees.inertia(frames), dtype=float)
    assert mine == pytest.approx(j.T @ m @ j, rel=1e-12, abs=1e-12)
    force = np.array(trees.force(frames, v, w.gravity, {}), dtype=float)
    assert force == pytest.approx(j.T @ (f - m @ bias), rel=1e-7, abs=1e-7)


@pytest.mark.parametrize("seed", [0, 2])
def test_a_tree_that_flies_keeps_its_momentum(seed):
    w = random_tree(seed, n=4, gravity=(0, 0, 0))
    w.place("b0", turn=[0.3, 0.1, 0.2], omega=[0.3, -0.2, 0.5], vx=0.2)
    for j in w.joints:
        if j.kind in ("hinge", "slider"):
            w.set(j, 0.2, 0.4)
        elif j.kind == "ball":
            w.set(j, [0.1, 0.2, 0.3], [0.3, 0.2, -0.1])
    run = w.simulate(1.5, **TIGHT)

    def kept(t):
        p, spin, energy = np.zeros(3), np.zeros(3), 0.0
        s = w._states(run, np.array(t))
        for b in w.bodies:
            x, v, o = (np.array(a, dtype=float) for a in (s[b].position, s[b].velocity, s[b].omega))
            r = np.array(s[b].rotation, dtype=float)
            inertia = r @ b.inertia @ r.T
            p += b.mass * v
            spin += b.mass * np.cross(x, v) + inertia @ o
            energy += 0.5 * b.mass * v @ v + 0.5 * o @ inertia @ o
        return np.r_[p, spin, energy]

    assert kept(1.5) == pytest.approx(kept(0.0), abs=1e-7)


def test_a_heavy_top_precesses_steadily():
    """A W^2 cos(tilt) - C n W + m g l = 0, with the spin n along the axis."""
    m, length, a, c, tilt, n = 1.5, 0.3, 0.02, 0.03, 0.6, 60.0
    w = swb.World(space=True)
    top = w.link(m, [a, a, c], name="top")
    ball = w.joint("ball", None, top, to=[0, 0, -length], name="tip")
    about = a + m * length**2
    rate = np.roots([about * np.cos(tilt), -c * n, m * G * length]).real.min()
    # angular velocity in the axes of the body: along its axis n, and across it the rate of precession
    w.set(ball, [tilt, 0, 0], [0, rate * np.sin(tilt), n])
    run = w.simulate(2.0, **TIGHT)
    t = np.linspace(0, 2, 7)
    way = w.trajectory(run, top, t)
    assert way.z == pytest.approx(np.full(7, length * np.cos(tilt)), abs=1e-7)
    phase = -np.pi / 2 + rate * t
    assert way.x == pytest.approx(length * np.sin(tilt) * np.cos(phase), abs=1e-6)


def test_a_double_pendulum():
    """Two equal rods, against the equations of the book."""
    from scipy.integrate import solve_ivp

    m, length = 1.3, 0.7
    w = swb.World(space=True)
    j = m * length**2 / 12
    rods = [w.capsule(length, 0.01, m, [1e-5, j, j], name=n) for n in "ab"]
    left, right = [-length / 2, 0, 0], [length / 2, 0, 0]
    w.joint("hinge", None, rods[0], to=left, axis=[0, 1, 0], name="first")
    w.joint("hinge", rods[0], rods[1], at=right, to=left, axis=[0, 1, 0], name="second")
    w.set("first", 0.3), w.set("second", 0.5, 0.2)
    run = w.simulate(3.0, rtol=1e-11, atol=1e-12)

    def rates(t, x):
        # angles of both rods downwards from the x axis
        a, b, da, db = x
        k = 0.5 * m * length**2
        mass = np.array([[4 / 3 * m * length**2, k * np.cos(a - b)], [k * np.cos(a - b), m * length**2 / 3]])
        s = k * np.sin(a - b)
        g = 0.5 * m * G * length
        return np.r_[da, db, np.linalg.solve(mass, [-s * db**2 + 3 * g * np.cos(a), s * da**2 + g * np.cos(b)])]

    end = solve_ivp(rates, (0, 3), [0.3, 0.8, 0.0, 0.2], method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    assert w.trajectory(run, "first", 3.0).q == pytest.approx(end[0], abs=1e-7)
    assert w.trajectory(run, "second", 3.0).q == pytest.approx(end[1] - end[0], abs=1e-7)
    other = w.trajectory(run, "b", 3.0)
    assert other.x == pytest.approx(length * np.cos(end[0]) + length / 2 * np.cos(end[1]), abs=1e-7)


def wheel(**of_joint):
    w = swb.World(0.0, space=True, parameters="k")
    w.link(1.0, [1.0, 1.0, 0.5], name="wheel")
    w.joint("hinge", None, "wheel", name="axle", **of_joint)
    return w


def test_damping_armature_and_dry_friction():
    w = wheel(damping=lambda s: s.p[0], armature=0.3)
    w.set("axle", 0.0, 2.0)
    run = w.simulate(1.0, p=[0.4], **TIGHT)
    assert w.trajectory(run, "axle", 1.0).v == pytest.approx(2 * np.exp(-0.5), abs=1e-9)
    w = wheel(friction=0.25)
    w.set("axle", 0.0, 2.0)
    run = w.simulate(6.0, p=[0.0], **TIGHT)
    assert run.switches[0].t == pytest.approx(4.0, abs=1e-9) and w.trajectory(run, "axle", 6.0).q == pytest.approx(4.0)
    w = wheel(friction=0.25, stiction=0.5)
    w.force("axle", lambda s: s.p[0] * s.t)
    run = w.simulate(2.0, p=[0.4], **TIGHT)
    assert run.switches[0].t == pytest.approx(1.25, abs=1e-9)


def test_stops_are_contacts():
    w = wheel(limits=(-0.5, 1.0), e=0.5)
    w.set("axle", 0.0, 2.0)
    run = w.simulate(2.5, p=[0.0], **TIGHT)
    assert [(i.name, round(i.t, 9)) for i in run.impacts] == [("axle upper", 0.5), ("axle lower", 2.0)]
    assert w.trajectory(run, "axle", 2.5).q == pytest.approx(-0.5 + 0.5 * 0.5)


def chain(loop, kind="hinge"):
    """Two bodies on a hinge each; the second is held to the first by coordinates, or by constraints."""
    w = swb.World(space=True)
    a, b = w.link(1.0, [0.1, 0.2, 0.25], name="a"), w.link(0.7, [0.1, 0.15, 0.2], name="b")
    w.joint("ball", None, a, to=[-0.5, 0.1, 0], name="root")
    w.joint(kind, a, b, at=[0.5, 0, 0.1], to=[-0.4, 0, 0], axis=[0, 0.6, 0.8], turn=[0.2, 0.1, 0], loop=loop, name="held")
    w.set("root", [0.0, 0.2, 0.1], [0.1, 0.3, 0.2])
    return w


@pytest.mark.parametrize("kind", ["hinge", "slider", "ball", "fixed"])
def test_a_joint_by_constraints_moves_as_one_by_coordinates(kind):
    tree, looped = chain(False, kind), chain(True, kind)
    start = tree._states_at(*tree.start())["b"]
    rotation = np.array(start.rotation, dtype=float)
    looped.place("b", *start.position[:2], z=start.position[2], turn=rotation, omega=start.omega,
                 **{f"v{c}": float(v) for c, v in zip("xyz", start.velocity)})  # fmt: skip
    ends = []
    for w in (tree, looped):
        run = w.simulate(0.8, rtol=1e-9, atol=1e-10)
        way = w.trajectory(run, "b", 0.8)
        ends.append([way.x, way.y, way.z, way.vx, way.vy, way.vz, *way.omega])
    assert np.array(ends[1], dtype=float) == pytest.approx(np.array(ends[0], dtype=float), abs=1e-6)


def test_a_parallelogram_of_four_bars():
    """In space its hinges hold more than they need to. It is a pendulum of both cranks and a coupler that does not turn."""
    m, crank, base = 0.5, 0.4, 1.0
    w = swb.World(space=True)
    j = m * crank**2 / 12
    sides = [w.link(m, [j, j, 1e-3], name=n) for n in ("left", "right")]
    bar = w.link(2.0, [0.01, 0.2, 0.2], name="bar")
    top, bottom = [0, 0, crank / 2], [0, 0, -crank / 2]
    for x, side in ((0.0, sides[0]), (base, sides[1])):
        w.joint("hinge", None, side, at=[x, 0, 0], to=top, axis=[0, 1, 0], name=f"{side.name} crank")
    w.joint("hinge", sides[0], bar, at=bottom, to=[-base / 2, 0, 0], axis=[0, 1, 0], name="one")
    closing = w.joint("hinge", sides[1], bar, at=bottom, to=[base / 2, 0, 0], axis=[0, 1, 0], name="two")
    assert closing.loop
    angle = 0.7
    w.set("left crank", angle), w.set("right crank", angle), w.set("one", -angle)
    run = w.simulate(1.0, **TIGHT)
    assert run.success, run.reason
    inertia = 2 * m * crank**2 / 3 + 2.0 * crank**2
    s = w.trajectory(run, "left crank", 1.0)
    lost = (2 * m * crank / 2 + 2.0 * crank) * G * (np.cos(s.q) - np.cos(angle))
    assert 0.5 * inertia * s.v**2 == pytest.approx(lost, rel=1e-8)
    assert w.trajectory(run, "right crank", 1.0).q == pytest.approx(s.q, abs=1e-9)
    assert w.trajectory(run, "one", 1.0).q == pytest.approx(-s.q, abs=1e-9)


def test_gears_by_a_constraint():
    w = swb.World(0.0, space=True)
    for n, inertia in (("a", 0.5), ("b", 0.2)):
        w.link(1.0, [1, 1, inertia], name=n)
        w.joint("hinge", None, n, name=f"{n} axle")
    w.constraint("gear", lambda s: s["a axle"].q - 3.0 * s["b axle"].q)
    w.force("a axle", lambda s: 2.0)
    run = w.simulate(1.0, **TIGHT)
    assert w.trajectory(run, "a axle", 1.0).v == pytest.approx(2.0 / (0.5 + 0.2 / 9), abs=1e-9)


def test_bad_joints():
    w = swb.World(space=True)
    a, b, point = w.link(1.0, [1, 1, 1], name="a"), w.link(1.0, [1, 1, 1], name="b"), w.point(1.0, name="point")
    hinge = w.joint("hinge", a, b, name="hinge")
    closing = w.joint("ball", a, b, name="closing")
    for call, error, words in (
        (lambda: swb.World().joint("hinge", None, a), swb.UnsupportedError, "in space"),
        (lambda: w.joint("screw", a, b), swb.ArgumentError, "fixed, hinge, slider, ball"),
        (lambda: w.joint("hinge", a, "c"), swb.ArgumentError, "'c' is no body"),
        (lambda: w.joint("hinge", a, a), swb.ArgumentError, "to itself"),
        (lambda: w.joint("hinge", a, b, name="hinge"), swb.ArgumentError, "'hinge' already"),
        (lambda: w.joint("hinge", a, b, axis=[0, 0, 0]), swb.RangeError, "needs a direction"),
        (lambda: w.joint("hinge", a, b, at=[0, 0]), swb.DimensionError, "at"),
        (lambda: w.joint("hinge", a, b, loop=False), swb.ArgumentError, "closes a loop"),
        (lambda: w.joint("hinge", b, a, loop=False), swb.ArgumentError, "closes a loop"),
        (lambda: w.joint("hinge", a, b, damping=1.0), swb.UnsupportedError, "damping is for"),
        (lambda: w.joint("ball", None, a, limits=(0, 1)), swb.UnsupportedError, "limits is for"),
        (lambda: w.joint("hinge", None, a, limits=(1, 0)), swb.RangeError, "less than"),
        (lambda: w.joint("hinge", None, a, limits=1.0), swb.ArgumentError, "limits"),
        (lambda: w.joint("hinge", None, a, friction=-1.0), swb.RangeError, "friction is -1"),
        (lambda: w.joint("hinge", point, a), swb.UnsupportedError, "point"),
        (lambda: w.joint("hinge", a, point, loop=True), swb.UnsupportedError, "ball"),
        (lambda: w.set("elbow", 1.0), swb.ArgumentError, "has hinge, closing"),
        (lambda: w.set(closing, 1.0), swb.UnsupportedError, "no coordinate"),
        (lambda: w.set(hinge, [1.0, 2.0]), swb.SwitchbackError, "q of hinge"),
        (lambda: w.place(b, 1.0), swb.StateError, r"set\('hinge', ...\)"),
        (lambda: w.force(closing, lambda s: 1.0), swb.UnsupportedError, "no single coordinate"),
        (lambda: w.constraint("c", 1.0), swb.ArgumentError, "function of the states"),
        (lambda: w.simulate(1.0), swb.StateError, "a is not placed"),
    ):
        with pytest.raises(error, match=words):
            call()
    assert [j.name for j in w.joints] == ["hinge", "closing"]
    w.force(hinge, lambda s: [1.0, 2.0])
    with pytest.raises(swb.DimensionError, match="expected one"):
        w.scene
