"""Bodies of convex shapes that touch each other, and inner problems in expressions: against closed forms, SciPy and conservation."""

import ctypes
import subprocess

import numpy as np
import pytest
from scipy.optimize import brentq, minimize

import switchback_control as swb
from switchback_control import _gaps, _world_scene
from switchback_control.expr import Graph, implicit, inner_minimum, norm, signed_distance, sqrt

TIGHT = {"rtol": 1e-10, "atol": 1e-11}


def turned(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def momentum_and_energy(world, run, t):
    ways = [(b, world.trajectory(run, b, np.array(t))) for b in world.bodies]
    p = [sum(b.mass * v for b, v in zip(world.bodies, (getattr(w, c) for _, w in ways))) for c in ("vx", "vy")]
    turning = sum(b.mass * (w.x * w.vy - w.y * w.vx) + b.inertia * w.omega for b, w in ways)
    energy = sum(0.5 * b.mass * (w.vx**2 + w.vy**2) + 0.5 * b.inertia * w.omega**2 for b, w in ways)
    return np.array([*p, turning, energy])


# --- inner problems -------------------------------------------------------------------------------------


def test_an_inverse_function_and_a_least_value():
    g = Graph()
    x = g.inputs("x", 2)
    w = implicit(lambda w: w**3 + w - x[0], start=x[0])
    least, at = inner_minimum(lambda w: 0.25 * w**4 - x[1] * w, start=1.0, graph=g)
    f = g.function([w**3 + w, least, at], nx=2)
    for a, b in ((0.3, 2.0), (-4.0, 0.1), (1e3, 7.0)):
        assert f([a, b]) == pytest.approx([a, -0.75 * b ** (4 / 3), b ** (1 / 3)], rel=1e-12)
        jacobian = np.array([[1.0, 0.0], [0.0, -(b ** (1 / 3))], [0.0, b ** (-2 / 3) / 3]])
        assert np.asarray(f.jacobian([a, b]))[:, :2] == pytest.approx(jacobian, rel=1e-10)
    model = swb.Model(states="x")
    model.derivatives = [-implicit(lambda w: w**5 + w - model.x[0], start=0.0, graph=model.graph)]
    # x = w^5 + w, so (5 w^4 + 1) w' = -w: t = 5/4 (w0^4 - w^4) + log(w0/w)
    run = swb.simulate(model, [2.0], 1.0, **TIGHT)
    end = brentq(lambda w: 1.25 * (1.0 - w**4) - np.log(w) - 1.0, 1e-3, 1.0)
    assert run.x[-1] == pytest.approx([end**5 + end], abs=1e-9)
    again = swb.Model.from_json(model.to_json())
    assert swb.simulate(again, [2.0], 1.0, **TIGHT).x[-1] == pytest.approx(run.x[-1], abs=1e-14)


def test_inner_problems_that_are_none():
    g = Graph()
    x = g.inputs("x", 2)
    for call, error, words in (
        (lambda: implicit(lambda w: w - x[0], start=0.0), swb.ArgumentError, "graph=model.graph"),
        (lambda: implicit(lambda w: [w[0]], start=[x[0], x[1]]), swb.DimensionError, "1 equations for 2 unknowns"),
        (lambda: implicit(lambda w: np.sign(w - x[0]), start=x[0]), swb.UnsupportedError, "does not switch"),
        (lambda: implicit(lambda w: x[0], start=x[0]), swb.RangeError, "does not occur"),
        (lambda: inner_minimum(lambda w: [w, w], start=x[0]), swb.DimensionError, "one expression"),
        (lambda: signed_distance([x[0], x[1]], norm, start=[1.0]), swb.DimensionError, "the way between"),
        (lambda: signed_distance([x[0], x[1]], norm, size=0.0), swb.RangeError, "must be positive"),
    ):
        with pytest.raises(error, match=words):
            call()
    # a root that is not there is no value
    f = g.function([implicit(lambda w: w**2 + x[0], start=1.0, graph=g)], nx=2)
    assert f([-4.0, 0.0]) == pytest.approx([2.0], rel=1e-14)
    with pytest.raises(swb.SwitchbackError):
        f([4.0, 0.0])


def ellipsoids(c, a, b):
    """Gap and normal of ellipsoids with these matrices of squared semi-axes, `c` apart."""
    form = [(0.0, tuple(map(tuple, m.tolist())), None) for m in (a, b)]
    n = len(c)
    f = _gaps._numbers_of(tuple(form), n, 1.0)
    return f(np.concatenate([c, np.eye(n).ravel(), np.eye(n).ravel()]))


# --- gaps -----------------------------------------------------------------------------------------------


def apart(c, a, b):
    """Distance of two ellipsoids, by SciPy: least distance of points z of unit balls, a z and c + b z."""
    n = len(c)
    inside = [{"type": "ineq", "fun": lambda z, k=k: 1.0 - z[k : k + n] @ z[k : k + n]} for k in (0, n)]
    best = min(
        (
            minimize(lambda z: np.sum((c + a @ z[:n] - b @ z[n:]) ** 2), start, constraints=inside, method="SLSQP", options={"ftol": 1e-15, "maxiter": 500})
            for start in (np.zeros(2 * n), np.concatenate([-c, c]) / np.linalg.norm(c))
        ),
        key=lambda r: r.fun,
    )
    return np.sqrt(best.fun)


@pytest.mark.parametrize("n", [2, 3])
def test_the_gap_of_ellipsoids_is_their_distance(n):
    r = np.random.default_rng(53)
    seen = 0
    for _ in range(40):
        a, b = (np.linalg.qr(r.normal(size=(n, n)))[0] * r.uniform(0.2, 2.0, n) for _ in range(2))
        c = r.normal(size=n) * r.uniform(1.0, 5.0)
        found = ellipsoids(c, a @ a.T, b @ b.T)
        if found[0] < 0.01:
            # the normal is a direction in which the bodies overlap that much, and no direction near it has less overlap
            d = found[1:]
            assert found[0] == pytest.approx(d @ c - np.linalg.norm(a.T @ d) - np.linalg.norm(b.T @ d), abs=1e-12)
            continue
        seen += 1
        assert found[0] == pytest.approx(apart(c, a, b), abs=2e-6)
    assert seen > 15


def test_derivatives_of_gaps_are_those_of_differences():
    g = Graph()
    q = g.inputs("x", 6)
    gap, normal = signed_distance(
        [q[0] - q[3], q[1] - q[4]],
        lambda d: sqrt((np.cos(q[2]) * d[0] + np.sin(q[2]) * d[1]) ** 2 + 0.09 * (np.cos(q[2]) * d[1] - np.sin(q[2]) * d[0]) ** 2)
        + sqrt(0.25 * (np.cos(q[5]) * d[0] + np.sin(q[5]) * d[1]) ** 2 + 0.64 * (np.cos(q[5]) * d[1] - np.sin(q[5]) * d[0]) ** 2),
    )
    f = g.function([gap, normal[0]], nx=6)
    r = np.random.default_rng(7)
    for reach in (3.0, 1.2, 1.05):
        at = np.concatenate([reach * np.array([0.8, 0.4]), r.normal(size=1), [0.0, 0.0], r.normal(size=1)])
        exact, h = np.asarray(f.jacobian(at))[:, :6], 1e-5
        differences = np.array([(f(at + h * e) - f(at - h * e)) / (2 * h) for e in np.eye(6)]).T
        assert exact == pytest.approx(differences, abs=1e-7)
        assert np.hypot(*exact[0, :2]) == pytest.approx(1.0, abs=1e-13)  # the gradient of a distance is a unit vector
        hessian = np.asarray(f.hessian(at, weights=[1.0, 0.0]))[:6, :6]
        slopes = np.array([(np.asarray(f.jacobian(at + h * e))[0, :6] - np.asarray(f.jacobian(at - h * e))[0, :6]) / (2 * h) for e in np.eye(6)])
        assert hessian == pytest.approx(slopes, abs=1e-7)


@pytest.mark.parametrize("exponent, flat", [(2.0, 0.1), (3.0, 0.02), (6.0, 1e-3)])
def test_gaps_of_superellipses_are_the_distance_of_their_outlines(exponent, flat):
    w = swb.World()
    a, b = w.superellipse(0.8, 0.4, exponent, mass=1.0, flat=flat), w.superellipse(0.3, 0.5, 4.0, mass=1.0, flat=flat)
    outline = [body._power.outline(4000) for body in (a, b)]
    assert outline[0].max(axis=0) == pytest.approx([0.8, 0.4], abs=1e-12)
    near = np.abs(outline[0] / [0.8, 0.4]) ** exponent @ [1.0, 1.0]
    assert 1.0 - 2.0 * flat**0.8 < near.min() and near.max() < 1.0 + 1e-9
    (touch,) = [t for p in w._stated() for t in _gaps.touches_of(p)]
    r = np.random.default_rng(2)
    for _ in range(10):
        q = np.array([0.0, 0.0, r.normal(), *(r.normal(size=2) * 1.5), r.normal()])
        gap, normal, _, point = touch.geometry(w.scene._layout.read(np.concatenate([q, np.zeros(6)]), None, None, 0.0))
        placed = [line @ turned(angle).T + at for line, at, angle in zip(outline, (q[:2], q[3:5]), (q[2], q[5]))]
        n = np.array([float(c) for c in normal])
        # along the normal the outlines are that far apart
        assert float(gap) == pytest.approx((placed[0] @ n).min() - (placed[1] @ n).max(), abs=1e-5)
        if float(gap) > 0.01:
            distance = np.sqrt(((placed[0][::4, None] - placed[1][None, ::4]) ** 2).sum(axis=2).min())
            # between points of the outlines, which are 5e-3 apart
            assert distance - 1e-3 < float(gap) < distance + 1e-9
            foot = np.array([float(c) for c in point])
            assert np.linalg.norm(placed[0] - foot, axis=1).min() < 2e-3


def corners_of(x, y, angle, w, h):
    return np.array([x, y]) + np.array([[-w, -h], [w, -h], [w, h], [-w, h]]) / 2 @ turned(angle).T


def test_gaps_of_rounded_boxes_are_the_distance_of_their_cores():
    w = swb.World()
    a, b = w.box(1.0, 0.6, mass=1.0, rounding=0.1, name="a"), w.box(0.8, 0.9, mass=1.0, rounding=0.05, name="b")
    touches = [t for p in w._stated() for t in _gaps.touches_of(p)]
    assert len(touches) == 8
    r = np.random.default_rng(3)
    for _ in range(30):
        q = np.array([*r.normal(size=2), r.normal(), *(3 * r.normal(size=2)), r.normal()])
        x = np.concatenate([q, np.zeros(6)])
        least = min(float(t.geometry(w.scene._layout.read(x, None, None, 0.0))[0]) for t in touches)
        p1, p2 = corners_of(*q[:3], 0.8, 0.4), corners_of(*q[3:], 0.7, 0.8)
        simplex = [{"type": "eq", "fun": lambda z: z[:4].sum() - 1}, {"type": "eq", "fun": lambda z: z[4:].sum() - 1}]
        found = minimize(
            lambda z: np.sum((z[:4] @ p1 - z[4:] @ p2) ** 2), np.full(8, 0.25), bounds=[(0, 1)] * 8, constraints=simplex, options={"ftol": 1e-15, "maxiter": 500}
        )
        if found.fun > 1e-4:
            assert least == pytest.approx(np.sqrt(found.fun) - 0.15, abs=1e-5)


@pytest.mark.parametrize("shapes", [("box", "box"), ("capsule", "box"), ("capsule", "capsule")])
def test_gaps_in_space_are_the_distance_of_cores(shapes):
    w = swb.World(space=True)
    make = {
        "box": lambda: w.box(1.0, 0.6, mass=1.0, depth=0.8, rounding=0.1),
        "capsule": lambda: w.capsule(1.2, 0.1, mass=1.0),
    }
    a, b = (make[s]() for s in shapes)
    touches = [t for p in w._stated() for t in _gaps.touches_of(p)]
    assert len(touches) == {"bb": 16 + 144, "cb": 10 + 12, "cc": 4 + 1}[shapes[0][0] + shapes[1][0]]
    half = {"box": np.array([0.4, 0.3, 0.2]), "capsule": np.array([0.6, 0.0, 0.0])}
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
    r, seen = np.random.default_rng(5), 0
    for k in range(15):
        placed = [(r.normal(size=3) * scale, r.normal(size=4)) for scale in (0.0, 1.2)]
        points, x = [], []
        for shape, (at, q) in zip(shapes, placed):
            turn = np.array(_gaps.sp.of_quaternion((q / np.linalg.norm(q)).tolist()))
            points.append(at + signs * half[shape] @ turn.T)
            x += [*at, *q]
        state = w.scene._layout.read(np.concatenate([x, np.zeros(12)]), None, None, 0.0)
        least = min(float(t.geometry(state)[0]) for t in touches)
        simplex = [{"type": "eq", "fun": lambda z, k=k: z[k : k + 8].sum() - 1} for k in (0, 8)]
        found = minimize(
            lambda z: np.sum((z[:8] @ points[0] - z[8:] @ points[1]) ** 2), np.full(16, 0.125), bounds=[(0, 1)] * 16, constraints=simplex, options={"ftol": 1e-15, "maxiter": 500}
        )
        if found.fun > 1e-3:
            seen += 1
            assert least == pytest.approx(np.sqrt(found.fun) - 0.2, abs=1e-5)
    assert seen > 5


HALF = {"box": (0.4, 0.3, 0.2), "capsule": (0.6, 0.0, 0.0), "cylinder": (0.4, 0.3, 0.3), "ellipsoid": (0.6, 0.4, 0.2), "sphere": (0.0, 0.0, 0.0)}


def solid(world, kind):
    """A body of that kind, rounded by 0.1 where it has edges; `HALF` is what is left without the radius."""
    return {
        "box": lambda: world.box(1.0, 0.6, mass=1.0, depth=0.8, rounding=0.1),
        "capsule": lambda: world.capsule(1.2, 0.1, mass=1.0),
        "cylinder": lambda: world.cylinder(1.0, 0.4, mass=1.0, rounding=0.1),
        "ellipsoid": lambda: world.ellipsoid(*HALF["ellipsoid"], mass=1.0),
        "sphere": lambda: world.sphere(0.1, mass=1.0, inertia=[1, 1, 1]),
    }[kind]()


def inside(kind, z):
    """Functions that are positive in a core."""
    half = np.array(HALF[kind])
    if kind == "ellipsoid":
        return np.array([1.0 - np.sum((z / half) ** 2)])
    if kind == "cylinder":
        return np.array([half[0] - z[0], half[0] + z[0], half[1] ** 2 - z[1] ** 2 - z[2] ** 2])
    return np.concatenate([half - z, half + z])


def apart_in_space(kinds, placed, turns):
    """Distance of two cores, by SciPy: least distance of points of each."""
    limits = [{"type": "ineq", "fun": lambda z, i=i, k=k: inside(k, z[3 * i : 3 * i + 3])} for i, k in enumerate(kinds)]
    way = placed[0] - placed[1]
    found = [
        minimize(lambda z: np.sum((way + turns[0] @ z[:3] - turns[1] @ z[3:]) ** 2), start, constraints=limits, method="SLSQP", options={"ftol": 1e-16, "maxiter": 1000})
        for start in (np.zeros(6), np.concatenate([-way @ turns[0], way @ turns[1]]) / 4)
    ]
    return np.sqrt(min((r.fun for r in found if r.success), default=np.nan))


@pytest.mark.parametrize(
    "kinds", [("ellipsoid", k) for k in ("box", "capsule", "cylinder", "sphere")] + [("cylinder", k) for k in ("sphere", "capsule", "box", "cylinder")]
)
def test_gaps_of_ellipsoids_and_cylinders_are_distances(kinds):
    w = swb.World(space=True)
    bodies = [solid(w, k) for k in kinds]
    touches = [t for p in w._stated() for t in _gaps.touches_of(p)]
    number = {"sphere": 1, "capsule": 2 + 8 + 3, "box": 8 + 8 + 3, "cylinder": 8 + 8 + 5}[kinds[1]]
    assert len(touches) == len(w.scene.contacts) == (1 if kinds[0] == "ellipsoid" else number)
    radius = sum(b.radius for b in bodies)
    f = w.scene.graph.function([c.gap for c in w.scene.contacts], nx=w.scene.nx)
    r, seen = np.random.default_rng(61), 0
    for k in range(60):
        turns = [np.linalg.qr(r.normal(size=(3, 3)))[0] for _ in range(2)]
        if k % 4 == 0:  # axes along each other
            turns[1] = turns[0] @ np.eye(3)[r.permutation(3)]
        turns = [t * np.linalg.det(t) for t in turns]
        placed = [np.zeros(3), r.normal(size=3) * r.uniform(0.3, 1.5)]
        x = np.concatenate([c for at, t in zip(placed, turns) for c in (at, _gaps.sp.quaternion_of(t))])
        state = w.scene._layout.read(np.concatenate([x, np.zeros(12)]), None, None, 0.0)
        exact = apart_in_space(kinds, placed, turns)
        if not exact > 0.02:
            continue
        seen += 1
        all = [t.geometry(state) for t in touches]
        gap, normal, _, point = min(all, key=lambda g: float(g[0]))
        assert float(gap) == pytest.approx(exact - radius, abs=2e-7)
        # the point of contact is on the first body of the contact, and the other one as far away as the gap says
        first = touches[[g[0] for g in all].index(gap)].a
        i = bodies.index(first)
        own = (np.array(point, dtype=float) + np.array(normal, dtype=float) * first.radius - placed[i]) @ turns[i]
        assert inside(kinds[i], own).min() > -1e-6
        # the expressions of the scene say the same, with their derivatives
        full = np.concatenate([x, np.zeros(12)])
        assert f(full) == pytest.approx([float(g[0]) for g in all], abs=1e-12)
        move = np.concatenate([r.normal(size=14), np.zeros(12)])
        slope = (f(full + 1e-6 * move) - f(full - 1e-6 * move)) / 2e-6
        near = [i for i, g in enumerate(all) if g[0] < gap + 1e-3]
        if k % 4:
            assert (np.asarray(f.jacobian(full))[:, :26] @ move)[near] == pytest.approx(slope[near], abs=1e-6)
    assert seen > 10


DRIVER = """
#include "model.c"
int run(const double *x, const double *w, double *v, double *j, double *h) {
    double values[100000];
    int c, k, code = f0_value(0.0, x, 0, 0, v);
    if (code || (code = f0_jacobian(0.0, x, 0, 0, values)))
        return code;
    for (c = 0; c < f0_nx; c++)
        for (k = (int)f0_jacobian_col_ptr[c]; k < f0_jacobian_col_ptr[c + 1]; k++)
            j[f0_jacobian_row_idx[k] * f0_nx + c] = values[k];
    code = f0_hessian(0.0, x, 0, 0, w, values);
    for (c = 0; c < f0_nx && !code; c++)
        for (k = (int)f0_hessian_col_ptr[c]; k < f0_hessian_col_ptr[c + 1]; k++)
            h[f0_hessian_row_idx[k] * f0_nx + c] = values[k];
    return code;
}
"""


@pytest.mark.parametrize("kinds", [("ellipsoid", "box"), ("cylinder", "cylinder"), ("ellipsoid", "ellipsoid")])
def test_c_code_of_gaps_is_the_library(kinds, tmp_path):
    """Gaps as rates of a model, compiled by gcc without a heap: values, first and second derivatives at random points."""
    w = swb.World(space=True)
    a, b = (solid(w, k) for k in kinds)
    touch = [t for p in w._stated() for t in _gaps.touches_of(p)][-1]
    m = swb.Model(states=[f"x{k}" for k in range(14)])
    parts = [[m.x[7 * i + k] for k in range(7)] for i in (0, 1)]
    bodies = {n.name: swb.BodyState(q[:3], [0.0] * 3, None, [0.0] * 3, _gaps.sp.of_quaternion(q[3:])) for n, q in zip((a, b), parts)}
    gap, normal, _, _ = touch.geometry(swb.States(w, bodies, None, None, 0.0))
    m.derivatives = [gap, normal[0] if kinds == ("ellipsoid", "ellipsoid") else 0.0] + [0.0] * 12
    code = m.c_code()
    assert "alloc" not in code
    (tmp_path / "model.c").write_text(code)
    (tmp_path / "driver.c").write_text(DRIVER)
    strict = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror"]
    subprocess.run(["gcc", *strict, "-O1", "-ffp-contract=off", "-shared", "-fPIC", "-o", "model.so", "driver.c", "-lm"], cwd=tmp_path, check=True)
    run = ctypes.CDLL(str(tmp_path / "model.so")).run
    f = m.graph.function(m.derivatives, nx=14)
    r, seen = np.random.default_rng(), 0
    for _ in range(40):
        x = np.concatenate([r.normal(size=7), r.normal(size=3) * 2.0, r.normal(size=4)])
        weights = np.concatenate([r.normal(size=2), np.zeros(12)])
        v, j, h = np.zeros(14), np.zeros((14, 14)), np.zeros((14, 14))
        failed = run(*(c.ctypes.data_as(ctypes.c_void_p) for c in (x, weights, v, j, h)))
        try:
            exact = f(x), np.asarray(f.jacobian(x))[:, :14], np.asarray(f.hessian(x, weights=weights))[:14, :14]
        except swb.SwitchbackError:
            assert failed
            continue
        assert not failed
        # next to each other, and where they overlap, derivatives are large and have fewer digits
        if exact[0][0] < 0.05:
            continue
        seen += 1
        for got, known in zip((v, j, np.triu(h) + np.triu(h, 1).T), exact):
            full = known if known.ndim < 2 or known is exact[1] else np.triu(known) + np.triu(known, 1).T
            assert got == pytest.approx(full, rel=1e-9, abs=1e-11 * max(1.0, np.abs(full).max()))
    assert seen > 5


# --- motions --------------------------------------------------------------------------------------------


def test_round_ellipses_are_discs():
    runs = []
    for shape in ("disc", "ellipse"):
        w = swb.World(gravity=1.0, e=0.7, mu=0.3)
        w.floor(0.0)
        make = {"disc": lambda r, **k: w.disc(r, turns=True, **k), "ellipse": lambda r, **k: w.ellipse(r, r, **k)}[shape]
        a, b = make(0.5, mass=1.0, name="a"), make(0.3, mass=2.0, name="b")
        w.place(a, y=1.0, omega=2.0)
        w.place(b, x=0.2, y=2.5, vx=0.1)
        run = w.simulate(2.5, **TIGHT)
        runs.append((run, [w.trajectory(run, n, np.linspace(0, 2.5, 40)) for n in "ab"]))
    assert len(runs[0][0].impacts) == len(runs[1][0].impacts) > 2
    for one, other in zip(runs[0][1], runs[1][1]):
        for c in ("x", "y", "angle", "vx"):
            assert getattr(one, c) == pytest.approx(getattr(other, c), abs=1e-6)


def test_elastic_ellipses_keep_momentum_and_energy():
    w = swb.World(gravity=0.0, e=1.0)
    r = np.random.default_rng(11)
    for k in range(4):
        b = w.ellipse(*r.uniform(0.2, 0.6, 2), mass=r.uniform(0.5, 2.0))
        w.place(b, x=2.0 * np.cos(k * np.pi / 2), y=2.0 * np.sin(k * np.pi / 2), angle=r.normal(), omega=r.normal(), vx=-np.cos(k * np.pi / 2), vy=-np.sin(k * np.pi / 2) + 0.1 * k)
    run = w.simulate(5.0, **TIGHT)
    assert len(run.impacts) >= 3
    all = momentum_and_energy(w, run, np.linspace(0, 5, 60))
    assert np.abs(all - all[:, :1]).max() < 1e-9


def test_an_ellipse_bounces_on_a_fixed_one_as_by_hand():
    """A light ellipse falls on a heavy one that nothing moves: flight in closed form, the impact by the gap of SciPy."""
    heavy = 1e9
    w = swb.World(gravity=[0.0, 0.0], e=0.8)
    top, low = w.ellipse(0.5, 0.2, mass=1.0, name="top"), w.ellipse(1.5, 0.7, mass=heavy, name="low")
    w.place(top, x=0.4, y=3.0, angle=0.4, vy=-2.0, omega=1.0)
    w.place(low)
    run = w.simulate(2.0, **TIGHT)
    hit = run.impacts[0]

    def gap(t):
        a = turned(0.4 + t) * [0.5, 0.2]
        return apart(np.array([0.4, 3.0 - 2.0 * t]), a, np.diag([1.5, 0.7]))

    t = brentq(lambda t: gap(t) - 0.05, 0.5, hit.t - 1e-3)
    a = turned(0.4 + t) * [0.5, 0.2]
    heavy_one = np.diag([2.25, 0.49])
    assert ellipsoids([0.4, 3.0 - 2.0 * t], a @ a.T, heavy_one)[0] == pytest.approx(0.05, abs=1e-6)
    # the impact: impulse along the normal at the point of contact
    a = turned(0.4 + hit.t) * [0.5, 0.2]
    c = np.array([0.4, 3.0 - 2.0 * hit.t])
    found = ellipsoids(c, a @ a.T, heavy_one)
    assert found[0] == pytest.approx(0.0, abs=1e-9)
    n = found[1:]
    arm = -a @ a.T @ n / np.linalg.norm(a.T @ n)
    lever = arm[0] * n[1] - arm[1] * n[0]
    rate = n @ [0.0, -2.0] + lever
    impulse = -1.8 * rate / (1.0 + lever**2 / top.inertia)
    assert hit.normal == pytest.approx(impulse, rel=1e-7)
    way = w.trajectory(run, top, [1.9])
    assert [way.vx[0], way.vy[0], way.omega[0]] == pytest.approx([impulse * n[0], -2.0 + impulse * n[1], 1.0 + lever * impulse / top.inertia], abs=1e-7)


@pytest.mark.parametrize("shape", ["ellipse", "superellipse", "box", "capsule"])
def test_dropped_bodies_come_to_rest_on_each_other(shape):
    w = swb.World(mu=0.5, e=0.1)
    w.floor(), w.wall(-0.9), w.wall(0.9, free="left")
    make = {
        "ellipse": lambda: w.ellipse(0.5, 0.3, mass=1.0),
        "superellipse": lambda: w.superellipse(0.5, 0.3, 4.0, mass=1.0),
        "box": lambda: w.box(0.8, 0.5, mass=1.0, rounding=0.05),
        "capsule": lambda: w.capsule(0.6, 0.2, mass=1.0),
    }[shape]
    bodies = [make() for _ in range(3)]
    for k, b in enumerate(bodies):
        w.place(b, x=0.15 * (-1) ** k, y=0.7 + 1.0 * k, angle=0.3 * k)
    steps = w.scene.simulate_steps(*w.start(), 6.0, 1e-3)
    touches = w.scene._layout.touches
    end = steps.x[-1]
    s = w.scene._layout.read(end, None, None, 6.0)
    assert min(float(t.geometry(s)[0]) for t in touches) > -1e-4
    # what rolls without sliding loses nothing: round bodies and corners go on rocking a little
    assert np.abs(end[w.scene.n_q :]).max() < 0.05
    assert all(end[1:9:3] > 0.19)


def test_a_disc_rolls_round_the_corner_of_a_box():
    """A disc on a fixed box without friction: over the edge its centre goes along an arc, until it leaves as in the textbook."""
    r, rounding, v0 = 0.2, 0.1, 0.3
    w = swb.World()
    box, ball = w.box(2.0, 1.0, mass=1e9, rounding=rounding, name="box"), w.disc(r, mass=1.0, name="ball")
    floor = w.plane([0.0, 1.0], -0.5)
    w.place(box), w.place(ball, x=0.45, y=0.5 + r, vx=v0)
    w.contacts((box, floor), (ball, box))
    run = w.simulate(2.0, **TIGHT)
    # leaves where m g cos a = m v^2 / R with v^2 = v0^2 + 2 g R (1 - cos a)
    arc = r + rounding
    cosine = (v0**2 / (9.81 * arc) + 2.0) / 3.0
    way = w.trajectory(run, ball, [1.0, 1.9, 2.0])
    assert way.vx[0] == pytest.approx(v0, abs=1e-12) and way.y[0] == pytest.approx(0.5 + r, abs=1e-12)
    assert way.vx[1:] == pytest.approx(np.sqrt(9.81 * arc * cosine) * cosine, rel=1e-7)


def test_ellipsoids_in_space_keep_momentum_and_energy():
    w = swb.World(space=True, gravity=0.0, e=1.0)
    a, b = w.ellipsoid(0.5, 0.3, 0.2, mass=1.0, name="a"), w.ellipsoid(0.4, 0.4, 0.7, mass=2.0, name="b")
    ball = w.sphere(0.3, mass=0.5, name="ball")
    w.place(a, x=-1.5, vx=1.0, omega=[0.3, 1.0, -0.4], turn=[0.2, 0.5, 0.1])
    w.place(b, x=1.0, y=0.2, vx=-0.5, turn=[0.4, -0.3, 0.1])
    w.place(ball, x=3.0, vx=-2.0)
    run = w.simulate(3.0, **TIGHT)
    assert len(run.impacts) >= 2
    t = np.linspace(0, 3, 50)
    ways = [w.trajectory(run, x, t) for x in (a, b, ball)]
    p = sum(x.mass * np.array([y.vx, y.vy, y.vz]) for x, y in zip((a, b, ball), ways))
    assert np.abs(p - p[:, :1]).max() < 1e-9
    energy = sum(0.5 * x.mass * (y.vx**2 + y.vy**2 + y.vz**2) for x, y in zip((a, b, ball), ways))
    for x, y in zip((a, b), ways):
        s = w._states(run, t)[x]
        own = np.stack([np.broadcast_to(c, t.shape) for c in s.back(list(y.omega.T))])
        energy = energy + 0.5 * np.einsum("it,ij,jt->t", own, np.asarray(x.inertia), own)
    assert np.abs(energy - energy[0]).max() < 1e-8


@pytest.mark.parametrize("kind", ["box", "capsule", "cylinder"])
def test_round_ellipsoids_are_balls(kind):
    """A ball that drops on a turned body and bounces off it, written as an ellipsoid and as a sphere."""
    ends = []
    for egg in (True, False):
        w = swb.World(gravity=[0.0, 0.0, -1.0], space=True, mu=0.3, e=0.7)
        body = solid(w, kind)
        ball = w.ellipsoid(0.2, 0.2, 0.2, mass=0.5) if egg else w.sphere(0.2, mass=0.5, inertia=[0.008] * 3)
        w.place(body, turn=[0.3, 0.2, 0.5], omega=[0.1, 0.2, 0.3], vz=1.0)
        w.place(ball, 0.15, 0.05, z=1.2, omega=[1.0, 0.0, 2.0])
        run = w.simulate(2.0, **TIGHT)
        ends.append([len(run.impacts) > 0, *run.x[-1]])
    assert ends[0][0] and ends[0] == pytest.approx(ends[1], abs=1e-6)


@pytest.mark.parametrize("kinds", [("ellipsoid", "box"), ("ellipsoid", "cylinder"), ("cylinder", "cylinder"), ("cylinder", "box"), ("cylinder", "capsule")])
def test_elastic_bodies_in_space_keep_momentum_and_energy(kinds):
    w = swb.World(gravity=0.0, space=True, e=1.0)
    bodies = [solid(w, k) for k in kinds]
    r = np.random.default_rng(23)
    for sign, b in zip((-1.0, 1.0), bodies):
        w.place(b, sign, 0.1 * sign, vx=-sign, turn=r.normal(size=4), omega=r.normal(size=3))
    run = w.simulate(1.5, **TIGHT)
    assert len(run.impacts) > 0
    before, after = (_all_in_space(w, run, t) for t in (0.0, 1.5))
    assert after == pytest.approx(before, abs=1e-8)


def test_cylinders_rest_on_each_other():
    """One on a box and one on that, upright, and three logs, two between walls and one on both, parallel to each other."""
    w = swb.World(space=True, mu=0.6)
    w.floor()
    low, can, top = w.box(1.0, 0.4, mass=3.0, depth=1.0, rounding=0.02), w.cylinder(0.5, 0.2, mass=1.0, rounding=0.02), w.cylinder(0.4, 0.15, mass=0.5, rounding=0.02)
    w.place(low, z=0.2)
    w.place(can, 0.1, 0.05, z=0.66, turn=[0, -np.pi / 2, 0])
    w.place(top, 0.12, 0.05, z=1.12, turn=[0, -np.pi / 2, 0])
    end = w.scene.simulate_steps(*w.start(), 1.5, 1e-3).x[-1]
    assert end[[2, 9, 16]] == pytest.approx([0.2, 0.65, 1.1], abs=1e-4) and np.abs(end[w.scene.n_q :]).max() < 1e-6
    w = swb.World(space=True, mu=0.6)
    w.floor(), w.wall(-0.405), w.wall(0.405, free="left")
    for x, z in ((-0.2, 0.2), (0.2, 0.2), (0.0, 0.2 + 0.2 * np.sqrt(3.0))):
        w.place(w.cylinder(1.0, 0.2, mass=1.0, rounding=0.02), x, z=z + 0.003, turn=[0, 0, np.pi / 2])
    end = w.scene.simulate_steps(*w.start(), 2.0, 1e-3).x[-1]
    assert end[16] == pytest.approx(0.2 + 0.2 * np.sqrt(3.0), abs=3e-3) and np.abs(end[w.scene.n_q :]).max() < 1e-5


def _all_in_space(w, run, t):
    p, turning, energy = np.zeros(3), np.zeros(3), 0.0
    for b in w.bodies:
        way = w.trajectory(run, b, [t])
        v, at = np.array([way.vx[0], way.vy[0], way.vz[0]]), np.array([way.x[0], way.y[0], way.z[0]])
        turn = np.array(_gaps.sp.of_quaternion(way.quaternion[0].tolist()))
        inertia = turn @ np.array(b.inertia) @ turn.T
        p = p + b.mass * v
        turning = turning + b.mass * np.cross(at, v) + inertia @ way.omega[0]
        energy += 0.5 * b.mass * v @ v + 0.5 * way.omega[0] @ inertia @ way.omega[0]
    return np.array([*p, *turning, energy])


def test_crossed_capsules_bounce_like_their_middle_lines():
    """One falls across another that is heavy and rests: the impact is along the vertical, at the crossing."""
    w = swb.World(space=True, e=0.5, gravity=0.0)
    top, low = w.capsule(1.0, 0.1, mass=1.0, name="top"), w.capsule(1.0, 0.2, mass=1e9, name="low")
    w.contacts((top, low))
    w.place(low)
    w.place(top, x=0.1, y=0.2, z=1.0, vz=-1.0, turn=[0.0, 0.0, np.pi / 2])
    run = w.simulate(0.8, **TIGHT)
    (hit,) = run.impacts
    assert hit.name == "top edge-low edge" and hit.t == pytest.approx(0.7, abs=1e-10)
    # the arm from the centre of the top one is -0.2 along its axis, and its moment across is the second one
    across = np.asarray(top.inertia)[1, 1]
    assert hit.normal == pytest.approx(1.5 / (1.0 + 0.04 / across), rel=1e-9)


def test_reports_say_what_gaps_solve_for():
    w = swb.World()
    a, b = w.ellipse(0.5, 0.2, mass=1.0, name="a"), w.ellipse(0.6, 0.4, mass=2.0, name="b")
    w.contacts((a, b), (a, w.floor()))
    assert [c["inner_unknowns"] for c in w.scene.report_data()["contacts"]] == [2, 0]
    assert "its gap solves for 2 unknowns" in w.scene.report()


def test_pairs_that_are_far_apart_are_not_evaluated(monkeypatch):
    """Boxes, eggs and cylinders on a floor, far from each other but for two: the same motion as without bounds, to the last bit."""

    def run(spheres):
        if not spheres:
            monkeypatch.setattr(_world_scene, "separation_of", lambda *_: None)
        w = swb.World(space=True, mu=0.5)
        w.floor()
        kinds = ["box", "cylinder", "ellipsoid", "box"]
        places = [(0.0, 0.0), (20.0, 0.0), (0.0, 20.0), (1.2, 0.1)]
        for k, (kind, (x, y)) in enumerate(zip(kinds, places)):
            w.place(solid(w, kind), x, y, z=0.8, turn=[0.1 * k, 0.2, 0.3], vx=-1.0 if k == 3 else 0.0)
        return w, w.scene.simulate_steps(*w.start(), 0.4, 1e-3)

    (w, one), (_, other) = run(True), run(False)
    assert np.array_equal(one.x, other.x)
    # those of four bodies with the floor, and of the pair that is near
    assert one.stats.gaps / one.stats.steps < 36 + 160 and one.stats.bounds < 0.5 * other.stats.bounds
    report = w.scene.report_data()["contacts"]
    assert len({c["group"] for c in report} - {None}) == 3 + 6  # three bodies with the floor that have several contacts, and six pairs
    assert "160 contacts from box lower front left-box 2 side to box z++ edge-box 2 z++ edge: each friction in space" in w.scene.report()
    again = swb.Scene.from_json(w.scene.to_json()).simulate_steps(*w.start(), 0.4, 1e-3)
    assert np.array_equal(one.x, again.x) and again.stats.gaps == one.stats.gaps


def test_pairs_that_are_far_apart_are_not_evaluated_by_events(monkeypatch):
    runs = []
    for spheres in (True, False):
        if not spheres:
            monkeypatch.setattr(_world_scene, "separation_of", lambda *_: None)
        w = swb.World(gravity=1.0, e=0.5)
        w.floor()
        for k in range(5):
            w.place(w.box(0.5, 0.3, mass=1.0, rounding=0.02), x=0.7 * k, y=0.5 + 0.2 * k, angle=0.3 * k, vx=-0.1 * k)
        runs.append(w.simulate(1.5))
    assert len(runs[0].impacts) > 3
    assert [i.name for i in runs[0].impacts] == [i.name for i in runs[1].impacts]
    assert runs[0].x[-1] == pytest.approx(runs[1].x[-1], abs=1e-12)


def test_a_separation_that_is_none():
    for given, error, words in (
        (lambda s: s.v[0], swb.RangeError, "depends on velocities"),
        (lambda s: "x", swb.ArgumentError, "separation of contact"),
        (lambda s: s.q, swb.DimensionError, "array"),
    ):
        s = swb.Scene("x", "v")
        s.force([-1.0])
        with pytest.raises(error, match=words):
            s.contact("floor", s.q[0], separation=given(s))
            s.system()


def test_documents_hold_shapes():
    w = swb.World(gravity=1.0, e=0.8, mu=0.2)
    a, b = w.ellipse(0.5, 0.2, mass=1.0, name="a"), w.superellipse(0.6, 0.4, 4.0, mass=2.0, name="b")
    w.floor()
    w.place(a, x=0.1, y=2.0, angle=0.5), w.place(b, y=0.8)
    one = w.simulate(1.6)
    other = swb.Scene.from_json(w.scene.to_json()).simulate(*w.start(), 1.6)
    assert len(one.impacts) == len(other.impacts) > 2 and list(one.x_end) == list(other.x_end)


def test_derivatives_through_impacts_of_ellipses():
    w = swb.World(gravity=1.0, e=0.8, controls="F")
    a, b = w.ellipse(0.5, 0.2, mass=1.0, name="a"), w.ellipse(0.6, 0.4, mass=2.0, name="b")
    w.floor()
    w.force(a, lambda s: [s.u[0], 0.0])
    w.place(a, x=0.1, y=2.0, angle=0.5)
    w.place(b, y=0.8)
    x0, scene = np.concatenate(w.start()), w.scene
    n = scene.n_q

    def end(x, u):
        return scene.simulate(x[:n], x[n:], 1.6, u=[u], **TIGHT).x_end

    run = scene.simulate(x0[:n], x0[n:], 1.6, u=[0.1], sensitivity=True, **TIGHT)
    assert {i.name for i in run.impacts} == {"a-b", "b-floor"}
    h = 1e-6
    differences = np.array([(end(x0 + h * e, 0.1) - end(x0 - h * e, 0.1)) / (2 * h) for e in np.eye(2 * n)]).T
    scale = np.abs(differences).max()
    assert run.dx_dx0 == pytest.approx(differences, abs=1e-5 * scale)
    assert run.dx_du[:, 0] == pytest.approx((end(x0, 0.1 + h) - end(x0, 0.1 - h)) / (2 * h), abs=1e-5 * scale)


def test_an_ellipse_is_pushed_by_another_at_least_effort():
    w = swb.World(gravity=0.0, e=0.5, controls="Fx Fy")
    a, b = w.ellipse(0.5, 0.2, mass=1.0, name="a"), w.ellipse(0.6, 0.4, mass=1.0, name="b")
    w.force(a, lambda s: [s.u[0], s.u[1], 0.0])
    w.place(a, x=-2.0, y=0.1, angle=0.5)
    w.place(b)
    scene, states = w.scene, w.states
    effort = scene.function(scene.u[0] ** 2 + scene.u[1] ** 2, "effort")
    ocp = swb.Ocp(scene, 2.0, 8, initial_state=np.concatenate(w.start()), control_bounds=(-5, 5), lagrange=effort)
    ocp.add_terminal(scene.function([states[b].x], "place"), [0.5], [0.5])
    result = ocp.solve()
    assert "solved" in repr(result) and "local_optimum" in repr(result)
    assert result["b.x"][-1] == pytest.approx(0.5, abs=1e-6)


def test_shapes_without_a_distance_are_refused():
    w = swb.World()
    box, other, rounded = w.box(1, 1, mass=1.0), w.box(1, 1, mass=1.0), w.box(1, 1, mass=1.0, rounding=0.1)
    ellipse, point = w.ellipse(1.0, 0.5, mass=1.0), w.point(1.0)
    with pytest.raises(swb.UnsupportedError, match="rounding"):
        w.contacts((box, other))
    with pytest.raises(swb.UnsupportedError, match="rounding"):
        w.contacts((box, point))
    with pytest.raises(swb.UnsupportedError, match="rounding"):
        w.contacts((box, ellipse))
    w.contacts((box, rounded), (rounded, ellipse), (ellipse, point))
    for given, words in (({"exponent": 1.5}, "exponent"), ({"flat": 0.0}, "flat"), ({"flat": 1.0}, "flat"), ({"b": 1e-4, "flat": 0.5}, "slender")):
        with pytest.raises(swb.RangeError, match=words):
            w.superellipse(**{"a": 1.0, "b": 0.5, "exponent": 4.0, "mass": 1.0, **given})
    for rounding in (-0.1, 0.5, np.nan):
        with pytest.raises(swb.RangeError, match="rounding"):
            w.box(1, 1, mass=1.0, rounding=rounding)
    with pytest.raises(swb.RangeError):
        w.ellipse(1.0, -0.5, mass=1.0)
    space = swb.World(space=True)
    with pytest.raises(swb.UnsupportedError, match="ellipse"):
        space.ellipse(1.0, 0.5, mass=1.0)
    sharp, egg = space.cylinder(1.0, 0.2, mass=1.0), space.ellipsoid(1, 1, 2, mass=1.0)
    for other in (egg, space.box(1, 1, mass=1.0, depth=1), space.point(1.0)):
        with pytest.raises(swb.UnsupportedError, match="rounding"):
            space.contacts((sharp, other))
    space.contacts((sharp, space.sphere(0.1, mass=1.0)))
    for rounding in (-0.1, 0.2, 0.5, np.nan):
        with pytest.raises(swb.RangeError, match="rims"):
            space.cylinder(1.0, 0.2, mass=1.0, rounding=rounding)
    with pytest.raises(swb.UnsupportedError, match="in the plane"):
        w.cylinder(1.0, 0.2, mass=1.0)
