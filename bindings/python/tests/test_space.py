"""Bodies in space: boxes, capsules, ellipsoids and spheres against closed forms, conservation, and another integrator."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import switchback_control as swb
from models import example

G = 9.81
TIGHT = {"rtol": 1e-10, "atol": 1e-11}


def matrix(q):
    """Rotation of a unit quaternion (w, x, y, z)."""
    w, v = q[0], np.asarray(q[1:])
    skew = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.eye(3) + 2 * w * skew + 2 * skew @ skew


def test_a_tumbling_body():
    """Euler's equations and the quaternion by another integrator; about the middle axis, where it turns over."""
    moments = np.array([1.0, 2.0, 3.0])
    w = swb.World(0.0, space=True)
    body = w.link(2.0, moments, name="body")
    start = np.array([0.9, 0.3, -0.2, 0.1]) / np.linalg.norm([0.9, 0.3, -0.2, 0.1])
    omega = np.array([0.02, 2.0, 0.01])
    w.place(body, vx=1.0, turn=3.0 * start, omega=matrix(start) @ omega)
    run = w.simulate(12.0, rtol=1e-12, atol=1e-13)

    def rates(t, x):
        q, o = x[:4], x[4:]
        dq = 0.5 * np.r_[-q[1:] @ o, q[0] * o + np.cross(q[1:], o)]
        return np.r_[dq, -np.cross(o, moments * o) / moments]

    t = np.array([3.0, 7.0, 12.0])
    other = solve_ivp(rates, (0, 12), np.r_[start, omega], t_eval=t, method="DOP853", rtol=1e-12, atol=1e-13).y.T
    way = w.trajectory(run, body, t)
    for mine, o, its in zip(way.quaternion, way.omega, other):
        assert matrix(mine) == pytest.approx(matrix(its[:4]), abs=1e-8)
        assert o == pytest.approx(matrix(its[:4]) @ its[4:], abs=1e-8)
    assert way.x == pytest.approx(t) and np.linalg.norm(way.quaternion, axis=1) == pytest.approx(1.0)


def test_the_length_of_a_quaternion_means_nothing():
    w = swb.World(space=True, mu=0.3, e=0.2)
    box, _ = w.box(0.4, 0.2, 1.0, depth=0.3, name="box"), w.floor()
    w.place(box, z=0.5, turn=[0.9, 0.3, 0.2, 0.1], omega=[1.0, 2.0, 0.5])
    q, v = w.start()
    ends = []
    for factor in (1.0, 7.0):
        q[3:] *= factor
        run = w.scene.simulate(q, v, 0.6, **TIGHT)
        assert run.impacts
        ends.append(np.r_[run.x_end[:3], run.x_end[3:7] / np.linalg.norm(run.x_end[3:7]), run.x_end[7:]])
    assert ends[0] == pytest.approx(ends[1], abs=1e-6)


@pytest.mark.parametrize("factor", [0.95, 1.05])
def test_a_box_on_a_slope_holds_or_slides(factor):
    angle, turn = 0.4, 0.7
    mu = factor * np.tan(angle)
    w = swb.World(space=True, mu=mu)
    box = w.box(0.4, 0.1, 2.0, depth=0.3, name="box")
    rotation = matrix([np.cos(turn / 2), 0, 0, np.sin(turn / 2)]) @ matrix([np.cos(angle / 2), 0, np.sin(angle / 2), 0])
    normal, down = rotation[:, 2], rotation[:, 0]
    w.plane(normal, name="slope")
    w.place(box, *(0.05 * normal)[:2], z=0.05 * normal[2], turn=rotation)
    run = w.simulate(1.5, **TIGHT)
    assert run.success, run.reason
    way = w.trajectory(run, box, 1.5)
    a = max(G * (np.sin(angle) - mu * np.cos(angle)), 0.0)
    assert [way.x, way.y, way.z] == pytest.approx(0.05 * normal + 0.5 * a * 1.5**2 * down, abs=1e-8)
    corners = [c.name for c in w.scene.contacts if "lower" in c.name]
    assert sum(run.force(n, 1.0)[0] for n in corners) == pytest.approx(2 * G * np.cos(angle), abs=1e-7)


def test_boxes_dropped_at_random_come_to_rest():
    # 15, 19 and 44 rock from edge to edge before they rest
    for seed in (*range(20), 44):
        rng = np.random.default_rng(seed)
        w = swb.World(space=True, mu=0.4, e=0.3)
        box, _ = w.box(0.4, 0.2, 1.0, depth=0.3, name="box"), w.floor()
        w.place(box, z=0.5, turn=rng.normal(size=4), omega=rng.uniform(-5, 5, 3), vx=0.3)
        run = w.simulate(3.0)
        assert run.success, (seed, run.reason)
        way = w.trajectory(run, box, 3.0)
        assert abs(run.x_end[7:]).max() < 1e-9
        assert min(abs(way.z - h) for h in (0.1, 0.15, 0.2)) < 1e-7
        assert sum(run.force(c, 3.0)[0] for c in w.scene.contacts) == pytest.approx(G, abs=1e-6)


def test_a_capsule_rolls_about_its_axis():
    length, r, mu, v0 = 0.6, 0.1, 0.2, 2.0
    w = swb.World(space=True, mu=mu)
    log, _ = w.capsule(length, r, 3.0, name="log"), w.floor()
    w.place(log, z=r, vy=v0)
    run = w.simulate(3.0, **TIGHT)
    share = 1.0 / (1.0 + log.inertia[0, 0] / (3.0 * r * r))
    way = w.trajectory(run, log, 3.0)
    assert way.vy == pytest.approx(v0 * share, abs=1e-9)
    assert way.omega == pytest.approx([-v0 * share / r, 0, 0], abs=1e-8)
    assert run.switches[0].t == pytest.approx((1 - share) * v0 / (mu * G), abs=1e-9)


def test_moments_of_inertia():
    """By summing up squares over points of a grid."""
    w = swb.World(space=True)
    x, y, z = np.meshgrid(*[np.linspace(-1, 1, 161)] * 3, indexing="ij")
    n, r = 0.8, 0.4
    shapes = (
        (w.box(0.8, 0.4, 1.0, depth=0.6), (abs(x) <= 0.4) & (abs(y) <= 0.3) & (abs(z) <= 0.2)),
        (w.capsule(n, r, 1.0), np.maximum(abs(x) - n / 2, 0) ** 2 + y**2 + z**2 <= r * r),
        (w.cylinder(0.9, 0.5, 1.0), (abs(x) <= 0.45) & (y**2 + z**2 <= 0.25)),
        (w.ellipsoid(0.9, 0.5, 0.3, 1.0), (x / 0.9) ** 2 + (y / 0.5) ** 2 + (z / 0.3) ** 2 <= 1),
    )
    for body, inside in shapes:
        a, b, c = (np.mean(s[inside] ** 2) for s in (x, y, z))
        # the grid has 80 points across a half of one
        assert np.diag(body.inertia) == pytest.approx([b + c, a + c, a + b], rel=0.03)
        assert body.inertia == pytest.approx(np.diag(np.diag(body.inertia)))
    assert w.sphere(0.3, 2.0).inertia == pytest.approx(0.4 * 2.0 * 0.09)


def test_an_ellipsoid_touches_where_it_is_lowest():
    from switchback_control.shapes import BodyState, States

    rng = np.random.default_rng(4)
    w = swb.World(space=True)
    semi = np.array([0.5, 0.3, 0.2])
    egg, floor = w.ellipsoid(*semi, 1.0, [1, 2, 2.5], centre=[0.1, -0.05, 0.02], name="egg"), w.floor()
    touch = w.scene._layout.touches[0]
    sphere = rng.normal(size=(200000, 3))
    sphere /= np.linalg.norm(sphere, axis=1)[:, None]
    for _ in range(5):
        q = rng.normal(size=4)
        rotation = matrix(q / np.linalg.norm(q))
        s = States(w, {"egg": BodyState([1.0, 2.0, 3.0], [0.0] * 3, None, [0.0] * 3, rotation.tolist())}, None, None, 0.0)
        gap, _, _, point = touch.geometry(s)
        lowest = 3.0 + ((sphere * semi + [0.1, -0.05, 0.02]) @ rotation.T)[:, 2].min()
        assert gap == pytest.approx(lowest, abs=2e-4) and point[2] == pytest.approx(gap, abs=1e-12)


def test_a_cylinder_touches_where_it_is_lowest():
    from switchback_control.shapes import BodyState, States

    rng = np.random.default_rng(14)
    for rounding in (0.0, 0.1):
        w = swb.World(space=True)
        can, floor = w.cylinder(1.0, 0.4, 1.0, rounding=rounding, name="can"), w.floor()
        touches = w.scene._layout.touches
        assert len(touches) == 2 * (1 + 4)
        for k in range(20):
            q = rng.normal(size=4)
            rotation = matrix(q / np.linalg.norm(q))
            if k < 6:  # upright and lying
                rotation = np.roll(np.eye(3), k, axis=0)
            s = States(w, {"can": BodyState([1.0, 2.0, 3.0], [0.0] * 3, None, [0.0] * 3, rotation.tolist())}, None, None, 0.0)
            lowest = min(float(t.geometry(s)[0]) for t in touches)
            down = rotation[2, 0]
            exact = 3.0 - (0.5 - rounding) * abs(down) - (0.4 - rounding) * np.sqrt(max(1.0 - down**2, 0.0)) - rounding
            assert lowest == pytest.approx(exact, abs=1e-8)
            for t in touches:
                gap, _, _, point = t.geometry(s)
                assert point[2] == pytest.approx(gap, abs=1e-8)


def test_a_cylinder_rolls_down():
    """Without sliding its acceleration is two thirds of that along the slope, and it needs a third of it as friction."""
    slope, r = 0.3, 0.2
    w = swb.World([G * np.sin(slope), 0.0, -G * np.cos(slope)], space=True, mu=0.2)
    can, _ = w.cylinder(0.5, r, 2.0, name="can"), w.floor()
    w.place(can, z=r, turn=[0, 0, np.pi / 2])
    run = w.simulate(1.0, **TIGHT)
    way = w.trajectory(run, can, [1.0])
    assert way.x == pytest.approx(G * np.sin(slope) / 3, rel=1e-7)
    assert way.omega[0] == pytest.approx([0.0, 2 / 3 * G * np.sin(slope) / r, 0.0], abs=1e-6)
    assert len(run.impacts) == 0


def test_a_cylinder_stands_and_falls():
    """Pushed at half of its height h by F: it stands where F h / 2 < m g r, slides where F > mu m g, and tips over its rim else."""
    ends = []
    for push in (1.0, 3.0):
        w = swb.World(space=True, mu=0.5)
        can, _ = w.cylinder(1.0, 0.1, 1.0, name="can"), w.floor()
        w.place(can, z=0.5, turn=[0, -np.pi / 2, 0])
        w.force(can, lambda s, push=push: [push, 0.0, 0.0])
        steps = w.scene.simulate_steps(*w.start(), 0.5, 1e-3)
        ends.append(steps.x[-1, 2:7])
    up = [abs(matrix(e[1:] / np.linalg.norm(e[1:]))[2, 0]) for e in ends]
    assert up[0] == pytest.approx(1.0, abs=1e-6) and ends[0][0] == pytest.approx(0.5, abs=1e-5)
    # about the point of the rim that stays
    inertia = 0.01 / 4 + 1 / 12 + 0.01 + 0.25

    def turning(t, y):
        c, s = np.cos(y[0]), np.sin(y[0])
        return [y[1], (3.0 * (0.5 * c + 0.1 * s) - G * (0.1 * c - 0.5 * s)) / inertia]

    tilt = solve_ivp(turning, (0.0, 0.5), [0.0, 0.0], rtol=1e-9, atol=1e-12).y[0, -1]
    assert np.arccos(up[1]) == pytest.approx(tilt, abs=2e-3)


def test_an_ellipsoid_rocks():
    """Small oscillations without sliding: omega^2 = m g (a^2 / c - c) / (I + m c^2)."""
    a, c, tilt = 0.3, 0.1, 1e-3
    w = swb.World(space=True, mu=5.0)
    egg, _ = w.ellipsoid(a, 0.2, c, 2.0, name="egg"), w.floor()
    w.place(egg, z=np.hypot(c * np.cos(tilt), a * np.sin(tilt)), turn=[0, tilt, 0])
    rate = np.sqrt(2.0 * G * (a * a / c - c) / (egg.inertia[1, 1] + 2.0 * c * c))
    run = w.simulate(2 * np.pi / rate, **TIGHT)
    t = np.linspace(0, run.t_end, 9)
    way = w.trajectory(run, egg, t)
    # the amplitude's square is what the linear motion leaves out
    assert 2 * way.quaternion[:, 2] == pytest.approx(tilt * np.cos(rate * t), abs=10 * tilt**2)


def test_a_round_ellipsoid_is_a_sphere():
    ends = []
    for egg in (True, False):
        w = swb.World(space=True, mu=0.2)
        ball = w.ellipsoid(0.2, 0.2, 0.2, 3.0, name="ball") if egg else w.sphere(0.2, 3.0, name="ball")
        w.floor()
        w.place(ball, z=0.2, vx=1.0, omega=[0.3, -0.2, 1.0])
        way = w.trajectory(w.simulate(1.0, **TIGHT), ball, 1.0)
        ends.append([way.x, way.y, way.z, way.vx, way.vy, *way.omega])
    assert np.array(ends[0]) == pytest.approx(np.array(ends[1]), abs=1e-8)


@pytest.mark.parametrize("mu", [0.03, 2.0])
def test_spheres_with_friction_keep_momentum(mu):
    w = swb.World(0.0, space=True, mu=mu, e=0.7)
    a, b = w.sphere(0.3, 1.0, name="a"), w.sphere(0.2, 2.0, name="b")
    w.place(a, -1.0, 0.1, vx=1.3, omega=[3.0, -1.0, 2.0])
    w.place(b, 0.4, -0.1, z=0.1, vy=0.1, omega=[0.5, 0.2, -1.0])
    run = w.simulate(2.0, **TIGHT)
    assert [i.name for i in run.impacts] == ["a-b"]

    def kept(t):
        p, spin = np.zeros(3), np.zeros(3)
        for body in (a, b):
            m = w.trajectory(run, body, t)
            v = body.mass * np.array([m.vx, m.vy, m.vz])
            p += v
            spin += np.cross([m.x, m.y, m.z], v) + body.inertia * m.omega
        return np.r_[p, spin]

    assert kept(2.0) == pytest.approx(kept(0.0), abs=1e-10)
    i = run.impacts[0]
    assert i.rate_after == pytest.approx(-0.7 * i.rate_before, abs=1e-11)
    size = np.hypot(*i.tangential)
    assert size == pytest.approx(mu * i.normal) if mu < 1 else size < mu * i.normal


def test_a_ball_rolls_on_a_ball():
    """7/10 (R + r)^2 rate^2 = g (R + r) (cos of the start - cos), until it slides."""
    big, r, start = 1.0, 0.1, 0.3
    w = swb.World(space=True, mu=3.0)
    below, ball = w.sphere(big, 1.0, name="below"), w.sphere(r, 0.5, name="ball")
    w.joint("fixed", None, below)
    d, way = big + r, np.array([0.6, 0.8])
    w.place(ball, *(d * np.sin(start) * way), z=d * np.cos(start))
    run = w.simulate(0.8, **TIGHT)
    assert run.mode("below-ball", 0.7) == swb.ContactMode.CLOSED
    m = w.trajectory(run, ball, np.array([0.4, 0.7]))
    speed = m.vx**2 + m.vy**2 + m.vz**2
    assert 0.7 * speed == pytest.approx(G * (d * np.cos(start) - m.z), rel=1e-8)
    assert np.sqrt(m.x**2 + m.y**2 + m.z**2) == pytest.approx(d)
    assert np.linalg.norm(m.omega, axis=1) == pytest.approx(np.sqrt(speed) / r)


@pytest.mark.parametrize("shape, share", [("box", 1.02), ("sphere", 1.02), ("sphere", 0.9)])
def test_a_gripper_holds_or_lets_slip(shape, share):
    """Two pads press a part: it is held, without creeping, where 2 mu F >= m g, and else falls with g - 2 mu F / m. How a box
    that slips divides its load among its corners, rigid bodies do not say; a sphere has one point on each side."""
    mu, mass = 0.5, 0.4
    press = share * mass * G / (2 * mu)
    w = swb.World(space=True, mu=mu)
    part = w.box(0.06, 0.05, mass, depth=0.04, name="part") if shape == "box" else w.sphere(0.03, mass, name="part")
    sides = []
    for name, sign in (("left", -1.0), ("right", 1.0)):
        finger = w.link(0.2, [1e-4] * 3, name=name)
        slide = w.joint("slider", None, finger, at=[sign * 0.05, 0, 1], axis=[-sign, 0, 0], name=f"{name} slide")
        pad = w.plane([-sign, 0, 0], 0.01, on=finger, name=f"{name} pad")
        w.force(slide, lambda s: press)
        w.set(slide, 0.01)
        sides.append((part, pad))
    w.contacts(*sides)
    w.place(part, z=1.0)
    run = w.simulate(0.5, **TIGHT)
    assert run.success, run.reason
    way = w.trajectory(run, part, 0.5)
    fall = G - 2 * mu * press / mass if share < 1 else 0.0
    assert way.z == pytest.approx(1.0 - 0.5 * fall * 0.25, abs=1e-10)
    assert way.vz == pytest.approx(-0.5 * fall, abs=1e-10)
    assert abs(w.trajectory(run, "left slide", 0.5).q - 0.01) < 1e-10


def test_forces_and_torques_along_the_axes_of_the_world():
    w = swb.World(0.0, space=True, parameters="f")
    body = w.link(2.0, [1.0, 1.0, 1.0], name="body")
    w.force(body, lambda s: [s.p[0], 0, 0, 0, 0, 3.0])
    w.place(body, turn=[0.3, 0.2, 0.1])
    run = w.simulate(1.0, p=[4.0], **TIGHT)
    way = w.trajectory(run, body, 1.0)
    assert [way.x, way.vx] == pytest.approx([1.0, 2.0]) and way.omega == pytest.approx([0, 0, 3.0], abs=1e-9)


def test_bad_input_in_space():
    w = swb.World(space=True)
    box, floor = w.box(0.1, 0.1, 1.0, depth=0.1, name="box"), w.floor()
    ball, bare = w.sphere(0.1, 1.0, name="ball"), w.link(1.0, [1, 1, 1], name="bare")
    plane = swb.World()
    disc = plane.disc(0.1, 1.0)
    for call, error, words in (
        (lambda: w.disc(0.1, 1.0), swb.UnsupportedError, "not discs"),
        (lambda: w.rod(0.1, 1.0), swb.UnsupportedError, "not rods"),
        (lambda: w.box(0.1, 0.1, 1.0), swb.ArgumentError, "needs a depth"),
        (lambda: w.box(0.1, 0.1, 1.0, depth=-1), swb.RangeError, "depth of a box"),
        (lambda: w.box(0.1, 0.1, 1.0, depth=0.1, centre=[0, 0, 1]), swb.ArgumentError, "give its inertia"),
        (lambda: w.box(0.1, 0.1, 1.0, [1, 2], depth=0.1), swb.DimensionError, "three moments"),
        (lambda: w.box(0.1, 0.1, 1.0, [1, 2, -3], depth=0.1), swb.RangeError, "not positive"),
        (lambda: w.box(0.1, 0.1, 1.0, [[1, 2, 0], [0, 1, 0], [0, 0, 1]], depth=0.1), swb.RangeError, "not a symmetric"),
        (lambda: w.box(0.1, 0.1, 1.0, float("nan"), depth=0.1), swb.RangeError, "inertia of box 2"),
        (lambda: w.ellipsoid(0.1, 0.0, 0.1, 1.0), swb.RangeError, "semi-axis b"),
        (lambda: w.sphere(0.1, 1.0, [1, 1, 1], turns=False), swb.ArgumentError, "axes of its own"),
        (lambda: w.link(1.0, None), swb.ArgumentError, "needs an inertia"),
        (lambda: w.link(1.0, 1.0, ["sphere"]), swb.ArgumentError, "list of Shape"),
        (lambda: swb.Shape("cone"), swb.UnsupportedError, "'cone'"),
        (lambda: swb.Shape("cylinder", [1.0]), swb.DimensionError, "size of a cylinder"),
        (lambda: swb.Shape("cylinder", [1.0, -0.1]), swb.RangeError, "rims"),
        (lambda: w.cylinder(0.0, 0.1, 1.0), swb.RangeError, "length of a cylinder"),
        (lambda: w.cylinder(0.1, 0.1, 1.0, centre=[0, 0, 1]), swb.ArgumentError, "give its inertia"),
        (lambda: swb.Shape("box", [1, 1]), swb.DimensionError, "size of a box"),
        (lambda: swb.Shape("sphere", radius=0), swb.RangeError, "must be positive"),
        (lambda: swb.Shape("sphere", radius=1, turn=[1, 2]), swb.DimensionError, "quaternion"),
        (lambda: w.place(box, angle=1.0), swb.UnsupportedError, "give turn"),
        (lambda: w.place(box, turn=np.diag([1, 1, -1])), swb.RangeError, "no rotation"),
        (lambda: w.place(box, turn=[0, 0, 0, 0]), swb.DimensionError, "quaternion"),
        (lambda: w.place(box, omega=[1, 2]), swb.DimensionError, "omega of box"),
        (lambda: plane.place(disc, turn=[1, 0, 0, 0]), swb.UnsupportedError, "by its angle"),
        (lambda: plane.box(1, 1, 1.0, depth=1), swb.UnsupportedError, "no depth"),
        (lambda: plane.ellipsoid(1, 1, 1, 1.0), swb.UnsupportedError, "in the plane"),
        (lambda: w.contacts((box, w.ellipsoid(1, 1, 1, 1.0, name="egg"))), swb.UnsupportedError, "sharp corners"),
        (lambda: w.contacts((bare, floor)), swb.UnsupportedError, "has no shape"),
        (lambda: w.contacts((box, w.plane([1, 0, 0], on=box, name="side"))), swb.ArgumentError, "do not move"),
        (lambda: w.plane([1, 0, 0], on="nobody"), swb.ArgumentError, "'nobody' is no body"),
    ):
        with pytest.raises(error, match=words):
            call()
    assert [b.name for b in w.bodies] == ["box", "ball", "bare", "egg"]


def test_pictures_in_space(tmp_path):
    image = pytest.importorskip("PIL.Image")
    plt = pytest.importorskip("matplotlib.pyplot")
    w = swb.World(space=True, mu=0.3)
    box, ball = w.box(0.4, 0.2, 1.0, depth=0.3, name="box"), w.sphere(0.1, 1.0, name="ball")
    w.floor()
    w.contacts((box, "floor"), (ball, "floor"))
    rod = w.link(0.1, [1e-3] * 3, name="rod")
    w.joint("ball", box, rod, at=[0, 0, 0.1], to=[0, 0, -0.2])
    w.place(box, z=0.3, vx=0.5), w.place(ball, x=0.6, z=0.1, vy=0.4)
    run = w.simulate(0.4)
    ax = w.picture(run, 0.0)
    # the floor, six sides in one collection, and the ball
    assert len(ax.collections) == 3 and len(ax.lines) == 1
    low, high = ax.get_zlim()
    assert low < 0 and high > 0.6
    plt.close(ax.figure)
    run.animate(tmp_path / "a.gif", fps=5, size=(2, 2))
    with image.open(tmp_path / "a.gif") as gif:
        assert gif.n_frames == 3
        seen = [np.asarray(gif.convert("RGB"))]
        gif.seek(2)
        assert (seen[0] != np.asarray(gif.convert("RGB"))).mean() > 0.01
    _, flat = plt.subplots()
    with pytest.raises(swb.ArgumentError, match="three dimensions"):
        w.picture(run, 0.0, flat)
    with pytest.raises(swb.RangeError, match="least and the largest"):
        w.picture(run, 0.0, limits=[0, 1, 0, 1, 1, 0])
    with pytest.raises(swb.UnsupportedError, match="use animate"):
        swb.World().picture(run, 0.0)
    plt.close("all")


def test_a_tippe_top_turns_upside_down():
    """Against equations of motion written by hand while it slides, and by Jellett's constant to the end."""
    top = example("tippe_top")
    up, mu, moment = np.array([0.0, 0.0, 1.0]), 0.3, 0.4 * top.MASS * top.RADIUS**2

    def rates(_, y):
        v, omega, axis = y[:3], y[3:6], y[6:]
        arm = top.LIFT * axis - top.RADIUS * up
        slide = v + np.cross(omega, arm)
        push = up - mu * slide * [1, 1, 0] / np.hypot(slide[0], slide[1])
        # the point that touches neither rises nor sinks
        per_force = push[2] / top.MASS + np.cross(np.cross(arm, push), arm)[2] / moment
        force = (G - top.LIFT * np.cross(omega, np.cross(omega, axis))[2]) / per_force
        return np.concatenate([force * push / top.MASS - G * up, force * np.cross(arm, push) / moment, np.cross(omega, axis)])

    start = [0, 0, 0, 0, 0, top.SPIN, 0, -np.sin(top.TILT), np.cos(top.TILT)]
    exact = solve_ivp(rates, (0, 0.5), start, method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
    _, _, height, _, _, way = top.spun(0.5, rtol=1e-9, atol=1e-11)
    assert height[-1] == pytest.approx(exact[8], abs=1e-6) and exact[8] < 0.8
    np.testing.assert_allclose(way.omega[-1], exact[3:6], rtol=1e-6, atol=1e-4)
    _, run, height, jellett, energy, way = top.spun(3.0, rtol=1e-8, atol=1e-10)
    assert run.success and height[0] > 0.99 and height[-1] < -0.9
    assert np.ptp(jellett) < 1e-7 * abs(jellett[0]) and np.all(np.diff(energy) < 1e-9 * energy[0])
    assert 0.0 < way.omega[-1, 2] < 0.6 * top.SPIN
