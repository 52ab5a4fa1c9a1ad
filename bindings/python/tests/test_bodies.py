"""Worlds: the scenes that bodies become, against closed forms, conservation and scenes written by hand; animations and plots."""

import numpy as np
import pytest

import switchback_control as swb

G = 9.81
TIGHT = {"rtol": 1e-11, "atol": 1e-12}


def momentum(world, run, t):
    """Momentum and angular momentum about the origin of bodies in the plane."""
    ways = [(b, world.trajectory(run, b, np.array(t))) for b in world.bodies]
    px = sum(b.mass * w.vx for b, w in ways)
    py = sum(b.mass * w.vy for b, w in ways)
    turning = sum(b.mass * (w.x * w.vy - w.y * w.vx) + b.inertia * w.omega for b, w in ways)
    return np.array([px, py, turning])


def energy(world, run, t):
    ways = [(b, world.trajectory(run, b, np.array(t))) for b in world.bodies]
    return sum(0.5 * b.mass * (w.vx**2 + w.vy**2) + 0.5 * b.inertia * w.omega**2 for b, w in ways)


def test_a_ball_bounces_to_rest():
    e = 0.5
    w = swb.World(e=e)
    ball, floor = w.disc(0.1, mass=2.0, name="ball"), w.floor()
    w.place(ball, x=0.3, y=1.1, vx=0.2, omega=2.0)
    run = w.simulate(2.0, **TIGHT)
    first = np.sqrt(2.0 / G)
    assert run.impacts[0].name == "ball-floor" and run.impacts[0].t == pytest.approx(first, abs=1e-12)
    assert run.impacts[0].normal == pytest.approx(2.0 * (1 + e) * G * first, abs=1e-10)
    rests = first * (1 + 2 * e / (1 - e))
    assert run.accumulations[0].t == pytest.approx(rests, abs=1e-6)
    assert w.scene.names == [["ball.x", "ball.y"], ["ball.vx", "ball.vy"], [], []]  # nothing rubs: no angle
    way = w.trajectory(run, "ball", [0.0, 1.0, 2.0])
    assert way.y[2] == pytest.approx(0.1, abs=1e-12) and way.x == pytest.approx([0.3, 0.5, 0.7], abs=1e-12)
    assert list(way.angle) == [0.0, 2.0, 4.0] and list(way.omega) == [2.0, 2.0, 2.0]
    assert way.z is None and way.vz is None
    assert run.force("ball-floor", 1.9) == pytest.approx([2.0 * G], abs=1e-9)  # weight


def test_a_disc_starts_to_roll():
    v0, mu, r = 3.0, 0.25, 0.3
    w = swb.World(mu=mu)
    w.place(w.disc(r, 1.0, name="disc"), y=r, vx=v0)
    w.floor()
    run = w.simulate(1.5, **TIGHT)
    assert run.switches[0].t == pytest.approx(v0 / (3 * mu * G), abs=1e-10)
    way = w.trajectory(run, "disc", 1.5)
    assert way.vx == pytest.approx(2.0, abs=1e-10) and way.omega == pytest.approx(-2.0 / r, abs=1e-9)
    assert run.mode("disc-floor", [0.1, 1.0]).tolist() == [swb.ContactMode.SLIDES, swb.ContactMode.CLOSED]


def test_a_belt_takes_along():
    mu, speed = 0.3, 1.5
    w = swb.World(mu=mu)
    w.place(w.point(1.0), y=0.0)
    w.floor(speed=speed)
    run = w.simulate(2.0, **TIGHT)
    t = speed / (mu * G)
    way = w.trajectory(run, "point", 2.0)
    assert way.vx == pytest.approx(speed, abs=1e-10)
    assert way.x == pytest.approx(speed * (2.0 - 0.5 * t), abs=1e-9)


def test_a_sphere_starts_to_roll():
    w = swb.World(space=True, mu=0.2)
    ball = w.sphere(0.2, 3.0, name="ball")
    w.floor()
    w.place(ball, z=0.2, vx=1.0, vy=-2.0)
    run = w.simulate(2.0, **TIGHT)
    assert w.scene.n_q == 3 and w.scene.n_v == 6
    way = w.trajectory(run, ball, 2.0)
    assert [way.vx, way.vy] == pytest.approx([5 / 7, -10 / 7], abs=1e-9)
    assert way.omega == pytest.approx([10 / 7 / 0.2, 5 / 7 / 0.2, 0.0], abs=1e-8)
    assert way.z == pytest.approx(0.2, abs=1e-12) and way.angle is None


def test_an_inclined_plane_in_space():
    """A point slides down along the steepest line, whatever the tangents are."""
    angle, turn, mu = 0.6, 0.8, 0.3
    normal = np.array([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)])
    w = swb.World(space=True, mu=mu)
    w.plane(3.0 * normal, 0.0, name="slope")
    w.place(w.point(2.0))
    run = w.simulate(1.0, **TIGHT)
    a = G * (np.sin(angle) - mu * np.cos(angle))
    down = np.array([np.cos(angle) * np.cos(turn), np.cos(angle) * np.sin(turn), -np.sin(angle)])
    way = w.trajectory(run, "point", 1.0)
    assert [way.x, way.y, way.z] == pytest.approx(0.5 * a * down, abs=1e-9)
    f = run.force("point-slope", 0.5)
    assert np.hypot(f[1], f[2]) == pytest.approx(mu * f[0], abs=1e-9) and f[0] == pytest.approx(2 * G * np.cos(angle))


@pytest.mark.parametrize("mu", [0.0, 0.1, 2.0])
def test_discs_keep_momentum(mu):
    w = swb.World(0.0, mu=mu, e=0.7)
    a, b = w.disc(0.3, 1.0, name="a"), w.disc(0.2, 2.0, name="b")
    w.place(a, -1.0, 0.1, vx=1.3, omega=3.0)
    w.place(b, 0.4, -0.1, vy=0.1, omega=-1.0)
    run = w.simulate(2.0, **TIGHT)
    assert [i.name for i in run.impacts] == ["a-b"]
    kept = momentum(w, run, [0.0, 2.0])
    assert kept[:, 1] == pytest.approx(kept[:, 0], abs=1e-10)
    before, after = energy(w, run, [0.0, 2.0])
    assert after < before
    i = run.impacts[0]
    assert i.rate_after == pytest.approx(-0.7 * i.rate_before, abs=1e-12)
    if mu == 0.1:
        assert abs(i.tangential[0]) == pytest.approx(0.1 * i.normal)
    assert w.scene.n_q == (6 if mu else 4)


@pytest.mark.parametrize("shape", ["box", "rod", "capsule"])
def test_bodies_lie_on_the_floor(shape):
    """The forces of a body that rests carry its weight and its moment, wherever it begins."""
    w = swb.World(mu=0.4)
    make = {"box": lambda: w.box(0.6, 0.2, 3.0), "rod": lambda: w.rod(0.6, 3.0), "capsule": lambda: w.capsule(0.6, 0.1, 3.0)}
    body, floor = make[shape](), w.floor(height=0.5)
    w.place(body, y=0.65, angle=0.04, vx=0.1)
    run = w.simulate(4.0)
    assert run.success, run.reason
    way = w.trajectory(run, body, 4.0)
    assert abs(way.vx) + abs(way.vy) + abs(way.omega) < 1e-7 and abs(way.angle) < 1e-7
    names = [c.name for c in w.scene.contacts if c.name.startswith(f"{shape} l") or c.name == f"{shape} right-floor"]
    lower = [n for n in names if "upper" not in n]
    assert len(lower) == 2
    assert sum(run.force(n, 4.0)[0] for n in lower) == pytest.approx(3.0 * G, abs=1e-7)


def test_corners_are_where_the_block_has_them():
    """The rocking block of the references, written with a box."""
    from test_scene import reference

    r = reference("rocking_block.json")["slender"]
    b, h, th = float(r["b"]), float(r["h"]), -float(r["x0"][0])
    w = swb.World(mu=10.0)
    block, floor = w.box(2 * b, 2 * h, 1.0, name="block"), w.floor()
    w.place(block, y=-(b * np.sin(th) - h * np.cos(th)), angle=th)
    run = w.simulate(float(r["T"]), **TIGHT)
    way = w.trajectory(run, block, run.t_end)
    assert [-way.angle, -way.omega] == pytest.approx([float(v) for v in r["th_w_T"]], abs=1e-9)


def test_parameters_controls_forces():
    """Friction, restitution, a shaken table and forces as functions; derivatives go through."""
    w = swb.World(parameters="e a", controls="f")
    ball = w.point(2.0, name="ball")
    w.floor(height=lambda s: s.p[1] * swb.sin(10 * s.t))
    w.contacts(e=lambda s: s.p[0])
    w.force("ball", lambda s: [s.u[0] - s[ball].vx, 0.0])
    w.place(ball, y=0.5)
    run = lambda e, a, f: w.simulate(1.0, p=[e, a], u=[f], sensitivity=True, **TIGHT)  # noqa: E731
    r = run(0.7, 0.05, 1.0)
    assert r.impacts and w.trajectory(r, ball, 1.0).vx == pytest.approx(1 - np.exp(-0.5), abs=1e-9)
    for k, column in enumerate((r.dx_dp[:, 0], r.dx_dp[:, 1], r.dx_du[:, 0])):
        d = [1e-6 * (i == k) for i in range(3)]
        up, down = (run(0.7 + s * d[0], 0.05 + s * d[1], 1.0 + s * d[2]).x_end for s in (1, -1))
        assert column == pytest.approx((up - down) / 2e-6, rel=1e-4, abs=1e-6)


def test_inertia():
    w = swb.World()
    assert w.disc(0.2, 3.0).inertia == pytest.approx(0.5 * 3.0 * 0.04)
    assert w.box(0.2, 0.4, 3.0).inertia == pytest.approx(3.0 * 0.2 / 12)
    assert w.rod(2.0, 3.0).inertia == pytest.approx(1.0)
    assert w.disc(0.2, 3.0, inertia=7.0).inertia == 7.0
    # a capsule by summing up squares
    n, r = 0.8, 0.3
    x, y = np.meshgrid(np.linspace(-1, 1, 2001), np.linspace(-1, 1, 2001))
    inside = np.maximum(np.abs(x) - n / 2, 0) ** 2 + y**2 <= r * r
    mean = np.mean((x**2 + y**2)[inside])
    assert w.capsule(n, r, 1.0).inertia == pytest.approx(mean, rel=1e-3)
    assert [b.name for b in w.bodies] == ["disc", "box", "rod", "disc 2", "capsule"]


def test_what_is_added_later_makes_a_new_scene():
    w = swb.World(e=0.5)
    ball = w.disc(0.1, 1.0, name="ball")
    w.floor()
    w.place(ball, y=1.0)
    run = w.simulate(0.3)
    old = w.scene
    assert w.scene is old
    w.place(w.disc(0.1, 1.0, name="other"), x=1.0, y=1.0)
    assert w.scene is not old and w.scene.n_q == 4
    assert [c.name for c in w.scene.contacts] == ["ball-floor", "other-floor", "ball-other"]
    assert w.trajectory(run, ball, 0.3).y == pytest.approx(1.0 - 0.5 * G * 0.09)  # the old run is still read


def test_pairs_are_chosen():
    w = swb.World(mu=0.1)
    a, b, floor = w.disc(0.1, 1.0, name="a"), w.disc(0.1, 1.0, name="b"), w.floor()
    w.contacts((a, "floor"), e=0.5)
    assert [c.name for c in w.scene.contacts] == ["a-floor"]
    assert w.scene.names[0] == ["a.x", "a.y", "a.angle", "b.x", "b.y"]  # b touches nothing
    w.contacts(mu=0.0)
    assert [c.name for c in w.scene.contacts] == ["a-floor", "b-floor", "a-b"]
    with pytest.raises(swb.ArgumentError, match="a and floor are a pair already"):
        w.contacts((floor, a))


def test_refusals():
    w = swb.World()
    ball, floor = w.disc(0.1, 1.0, name="ball"), w.floor()
    point = w.point(1.0)
    for call, error, words in (
        (lambda: w.disc(-0.1, 1.0), swb.RangeError, "radius of a disc is -0.1"),
        (lambda: w.disc(0.1, 0.0), swb.RangeError, "mass of disc is 0"),
        (lambda: w.disc(0.1, 1.0, inertia=float("nan")), swb.RangeError, "inertia of disc is nan"),
        (lambda: w.disc(0.1, 1.0, name="ball"), swb.ArgumentError, "there is a body 'ball' already"),
        (lambda: w.disc(0.1, 1.0, name=""), swb.ArgumentError, "name of a body"),
        (lambda: w.sphere(0.1, 1.0), swb.UnsupportedError, "in the plane"),
        (lambda: w.plane([0.0, 0.0]), swb.RangeError, "needs a direction"),
        (lambda: w.plane([0.0, 0.0, 1.0]), swb.DimensionError, "normal"),
        (lambda: w.wall(1.0, free="up"), swb.ArgumentError, "'left' or 'right'"),
        (lambda: w.contacts(ball, floor), swb.ArgumentError, "tuple of two bodies"),
        (lambda: w.contacts((ball, "wall")), swb.ArgumentError, "'wall' is no body of this world"),
        (lambda: w.contacts((ball, ball)), swb.ArgumentError, "do not move against each other"),
        (lambda: w.place("bal", 0, 1), swb.ArgumentError, "has ball, point"),
        (lambda: w.place(ball, z=1.0), swb.UnsupportedError, "in the plane"),
        (lambda: w.place(ball, y="high"), swb.RangeError, "y of ball"),
        (lambda: w.force(ball, [0.0, 1.0]), swb.ArgumentError, "function of the states"),
        (lambda: w.simulate(1.0), swb.StateError, "ball is not placed"),
        (lambda: swb.World().scene, swb.StateError, "no bodies"),
        (lambda: swb.World([1.0, 2.0, 3.0]), swb.DimensionError, "gravity"),
    ):
        with pytest.raises(error, match=words):
            call()
    w.force(ball, lambda s: [0.0, 0.0, 1.0])
    with pytest.raises(swb.ArgumentError, match="turns=True"):
        w.scene
    other = swb.World()
    other.place(other.point(1.0))
    with pytest.raises(swb.ArgumentError, match="no run of this world"):
        w.trajectory(other.simulate(0.1), ball)
    box = swb.World()
    box.box(1.0, 1.0, 1.0)
    box.box(1.0, 1.0, 1.0)
    with pytest.raises(swb.UnsupportedError, match="sharp corners"):
        box.scene


# --- pictures -------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def tumbling():
    w = swb.World(mu=0.3)
    box, ball = w.box(0.2, 0.8, 1.0), w.disc(0.1, 1.0, name="ball")
    w.floor(), w.wall(2.0, free="left")
    w.contacts((box, "floor"), (ball, "floor"), (ball, "wall"))
    w.place(box, y=0.45, angle=0.1, vx=0.3)
    w.place(ball, x=1.2, y=0.1, vx=1.0)
    return w, w.simulate(1.0)


def test_animations(tumbling, tmp_path):
    image = pytest.importorskip("PIL.Image")
    world, run = tumbling
    run.animate(tmp_path / "a.gif", fps=10, size=(3.2, 2.4), forces=True, title="Tumbling")
    with image.open(tmp_path / "a.gif") as gif:
        assert gif.n_frames == 11 and gif.size == (320, 240)
        frames = []
        for k in (0, 10):
            gif.seek(k)
            frames.append(np.asarray(gif.convert("RGB")))
        assert (frames[0] != frames[1]).mean() > 0.01  # something moved
    world.animate(run, tmp_path / "a.html", fps=3, size=(2, 2), limits=(-1, 2, 0, 1))
    assert "<img" in (tmp_path / "a.html").read_text()
    seen = []

    def draw(axes, q, t):
        seen.append((t, *q))
        axes.plot(q[0], q[1], "o")

    s = swb.Scene("x y")
    s.force([0.0, -G])
    s.contact("floor", s.q[1], e=0.5)
    plain = s.simulate([0.0, 0.3], [1.0, 0.0], 0.5)
    plain.animate(tmp_path / "b.gif", draw=draw, fps=4, size=(2, 2))
    assert {t for t, *_ in seen} == {0.0, 0.25, 0.5} and seen[-1][1] == pytest.approx(0.5)
    plain.animate(tmp_path / "c.gif", fps=4, size=(2, 2))
    assert (tmp_path / "c.gif").stat().st_size > 500
    import matplotlib.pyplot as plt

    assert not plt.get_fignums()


def test_animations_refuse(tumbling, tmp_path):
    world, run = tumbling
    smooth = swb.simulate(swb.System(1, f0=lambda x: -x), [1.0], 1.0)
    bare = world.simulate(0.1, dense=False)
    space = swb.World(space=True)
    space.place(space.point(1.0))
    for call, error, words in (
        (lambda: run.animate(tmp_path / "a.avi"), swb.ArgumentError, "'.avi'"),
        (lambda: run.animate(tmp_path / "a.gif", fps=0), swb.RangeError, "fps is 0"),
        (lambda: run.animate(tmp_path / "a.gif", speed=1e-6), swb.RangeError, "frames"),
        (lambda: run.animate(tmp_path / "a.gif", size=(3, -1)), swb.RangeError, "size"),
        (lambda: run.animate(tmp_path / "a.gif", limits=(1, 0, 0, 1)), swb.RangeError, "left, right"),
        (lambda: run.animate(tmp_path / "a.gif", draw=3), swb.ArgumentError, "function of"),
        (lambda: smooth.animate(tmp_path / "a.gif"), swb.ArgumentError, "not that of a scene"),
        (lambda: bare.animate(tmp_path / "a.gif"), swb.StateError, "dense"),
        (lambda: space.simulate(0.1).animate(tmp_path / "a.gif", forces=True), swb.UnsupportedError, "in the plane only"),
        (lambda: space.simulate(0.1).animate(tmp_path / "a.gif", limits=(0, 1)), swb.DimensionError, "limits"),
    ):
        with pytest.raises(error, match=words):
            call()
    from matplotlib.animation import writers

    if not writers.is_available("ffmpeg"):
        with pytest.raises(swb.UnsupportedError, match="ffmpeg"):
            run.animate(tmp_path / "a.mp4")


def test_without_matplotlib_or_pillow(tumbling, tmp_path, monkeypatch):
    import sys

    _, run = tumbling
    monkeypatch.setitem(sys.modules, "PIL", None)
    with pytest.raises(ImportError, match="pip install pillow"):
        run.animate(tmp_path / "a.gif")
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)
    with pytest.raises(ImportError, match="pip install matplotlib"):
        run.animate(tmp_path / "a.gif")


def test_plots(tumbling, tmp_path):
    plt = pytest.importorskip("matplotlib.pyplot")
    world, run = tumbling
    figure = run.plot()
    assert [a.get_ylabel() for a in figure.axes] == ["coordinates", "velocities", "contacts"]
    closed = [label.get_text() for label in figure.axes[2].get_yticklabels()]
    assert closed == [name for name in closed if np.any(run.mode(name)) or name in {i.name for i in run.impacts}]
    assert "ball-floor" in closed and "box upper left-floor" not in closed
    labels = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert labels == ["box.x", "box.y", "box.angle", "ball.x", "ball.y", "ball.angle"][: len(labels)] and len(labels) >= 5
    plt.close(figure)
    figure = run.plot_contacts(contacts=["ball-floor", "ball-wall"])
    assert [a.get_ylabel() for a in figure.axes][:2] == ["gap", "normal force"]
    curve = figure.axes[1].get_lines()[0].get_ydata()
    assert max(curve) == pytest.approx(G, abs=1e-6)
    plt.close(figure)
    figure = run.plot_phase(states=[3, 3 + world.scene.n_q])
    dotted = [line for line in figure.axes[0].get_lines() if line.get_linestyle() == ":"]
    assert len(dotted) == 1 and np.isnan(dotted[0].get_ydata()[2])
    plt.close(figure)
    run.plot_contacts(tmp_path / "contacts.svg")
    assert (tmp_path / "contacts.svg").stat().st_size > 1000 and not plt.get_fignums()
    with pytest.raises(swb.ArgumentError, match="no contact 'floor'"):
        run.plot_contacts(contacts=["floor"])
    with pytest.raises(swb.ArgumentError, match="not that of a scene"):
        swb.plot_contacts(swb.simulate(swb.System(1, f0=lambda x: -x), [1.0], 1.0))
    with pytest.raises(swb.DimensionError, match="there is no state 99"):
        run.plot(states=[99])
    with pytest.raises(swb.ArgumentError, match="'height' is no state"):
        run.plot_phase(states=["height", 0])
