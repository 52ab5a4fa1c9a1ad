"""Bodies in space on axes of matplotlib in three dimensions: at one time, or in the frames of an animation."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy

from . import _spatial as sp
from ._arrays import Array, number, vector
from ._world_scene import Layout, layout_of
from .errors import ArgumentError, RangeError
from .shapes import Body, Fixed, Shape, States

if TYPE_CHECKING:
    from .runs import Run

_ROUND = 18  # facets around a sphere


def _round(shape: Shape) -> Array:
    """Quadrilaterals of a sphere, an ellipsoid or a capsule, [faces, corners, 3]."""
    a = numpy.linspace(0.0, 2.0 * numpy.pi, _ROUND + 1)
    b = numpy.linspace(-0.5 * numpy.pi, 0.5 * numpy.pi, _ROUND // 2 + 2)  # an even number: no row at the equator
    along = numpy.sin(b)[:, None] * numpy.ones_like(a)
    points = numpy.stack([along, numpy.outer(numpy.cos(b), numpy.cos(a)), numpy.outer(numpy.cos(b), numpy.sin(a))], axis=-1)
    points = points * (shape.size if shape.kind == "ellipsoid" else shape.radius)
    if shape.kind == "capsule":
        points[..., 0] += numpy.sign(along) * 0.5 * shape.size[0]
    corners = [points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]]
    return numpy.stack(corners, axis=2).reshape(-1, 4, 3)


def _cylinder(shape: Shape) -> Array:
    """Quadrilaterals of a cylinder with its rounding, [faces, corners, 3]."""
    half, radius, edge = 0.5 * shape.size[0], shape.size[1], shape.radius
    bend = numpy.linspace(0.0, 0.5 * numpy.pi, 4 if edge else 1)
    x = numpy.concatenate([[half], half - edge + edge * numpy.cos(bend)])
    r = numpy.concatenate([[0.0], radius - edge + edge * numpy.sin(bend)])
    x, r = numpy.concatenate([x, -x[::-1]]), numpy.concatenate([r, r[::-1]])
    a = numpy.linspace(0.0, 2.0 * numpy.pi, _ROUND + 1)
    points = numpy.stack([x[:, None] * numpy.ones_like(a), numpy.outer(r, numpy.cos(a)), numpy.outer(r, numpy.sin(a))], axis=-1)
    corners = [points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]]
    return numpy.stack(corners, axis=2).reshape(-1, 4, 3)


def _faces(shape: Shape) -> Array:
    """Faces of a shape in the axes of its body, [faces, corners, 3]."""
    if shape.kind == "box":
        sides = []
        for k in range(3):
            for sign in (-1.0, 1.0):
                face = numpy.zeros((4, 3))
                face[:, k] = sign
                face[:, (k + 1) % 3], face[:, (k + 2) % 3] = (-1.0, 1.0, 1.0, -1.0), (-1.0, -1.0, 1.0, 1.0)
                sides.append(face)
        faces = 0.5 * numpy.array(sides) * numpy.array(shape.size)
    elif shape.kind == "point":
        return numpy.zeros((0, 4, 3))
    else:
        faces = _cylinder(shape) if shape.kind == "cylinder" else _round(shape)
    return faces @ numpy.array(shape.turn).T + numpy.array(shape.at)


def _lines(layout: Layout, body: Body) -> list[Array]:
    """From the centre of mass of a body to its joints, where it has no shape."""
    if body.shapes:
        return []
    ends = [j.to for j in layout.world.joints if j.body is body] + [j.at for j in layout.world.joints if j.parent is body]
    return [numpy.array([[0.0, 0.0, 0.0], e]) for e in ends]


def _moved(points: Array, s: States, body: Body) -> Array:
    state = s[body]
    rotation = numpy.eye(3) if state.rotation is None else numpy.array(state.rotation, dtype=float)
    return points @ rotation.T + numpy.array([float(c) for c in state.position])


def _cut(fixed: Fixed, s: States, low: Array, high: Array) -> Array | None:
    """The polygon in which a plane cuts the picture."""
    normal = numpy.array(fixed.normal)
    offset = float(fixed.offset(s) if callable(fixed.offset) else fixed.offset)
    corners = [numpy.array([(low, high)[i][0], (low, high)[j][1], (low, high)[k][2]]) for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    found = []
    for i in range(8):
        for bit in (1, 2, 4):
            if not i & bit:
                a, b = corners[i], corners[i | bit]
                da, db = normal @ a - offset, normal @ b - offset
                if da * db <= 0.0 and da != db:
                    found.append(a + da / (da - db) * (b - a))
    if len(found) < 3:
        return None
    points = numpy.array(found)
    first, second = (numpy.array(t) for t in sp.perpendicular(fixed.normal))
    middle = points - points.mean(axis=0)
    return points[numpy.argsort(numpy.arctan2(middle @ second, middle @ first))]


def _box_of(layout: Layout, states: list[States]) -> tuple[Array, Array]:
    """A cube around all bodies at some states."""
    points = [
        _moved(part.reshape(-1, 3), s, b)
        for s in states
        for b in layout.bodies
        for part in [*(_faces(shape) for shape in b.shapes), *_lines(layout, b), numpy.zeros((1, 3))]
    ]
    everything = numpy.vstack(points)
    low, high = everything.min(axis=0), everything.max(axis=0)
    half = 0.53 * max(float(numpy.max(high - low)), 1e-9)
    middle = 0.5 * (low + high)
    return middle - half, middle + half


def _draw(ax: Any, layout: Layout, s: States, low: Array, high: Array) -> None:
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    # matplotlib sorts by the nearest corner, which of a large plane is nearer than any body: the order is told here
    ax.computed_zorder = False
    e, a = numpy.radians(ax.elev), numpy.radians(ax.azim)
    eye = numpy.array([numpy.cos(e) * numpy.cos(a), numpy.cos(e) * numpy.sin(a), numpy.sin(e)])
    depth = {b.name: float(sum(c * d for c, d in zip(s[b].position, eye))) for b in layout.bodies}
    order = {name: 2 + k for k, name in enumerate(sorted(depth, key=lambda name: depth[name]))}
    for fixed in layout.fixed:
        polygon = _cut(fixed, s, low, high) if fixed.on is None else None
        if polygon is not None:
            before = 1 if numpy.dot(fixed.normal, eye) >= 0.0 else 2 + len(order)
            ax.add_collection3d(Poly3DCollection([polygon], facecolors="0.85", edgecolors="0.6", alpha=0.35, zorder=before))
    for i, body in enumerate(layout.bodies):
        color = f"C{i % 10}"
        for shape in body.shapes:
            faces = _faces(shape)
            if len(faces):
                sides = Poly3DCollection(
                    list(_moved(faces.reshape(-1, 3), s, body).reshape(faces.shape)),
                    facecolors=color, edgecolors="0.25", linewidths=0.3, alpha=0.9, shade=True,
                    zorder=order[body.name],
                )  # fmt: skip
                ax.add_collection3d(sides)
            else:
                ax.plot(*_moved(numpy.zeros((1, 3)), s, body).T, "o", color=color, markersize=5, zorder=order[body.name])
        for line in _lines(layout, body):
            ax.plot(*_moved(line, s, body).T, "-o", color=color, linewidth=2.5, markersize=3, zorder=order[body.name])
    ax.set_xlim(low[0], high[0])
    ax.set_ylim(low[1], high[1])
    ax.set_zlim(low[2], high[2])
    ax.set_box_aspect((1, 1, 1))


def _view(limits: Any) -> tuple[Array, Array] | None:
    if limits is None:
        return None
    v = vector(limits, 6, "limits")
    if not numpy.all(v[::2] < v[1::2]):
        raise RangeError(f"limits are {limits}: the least and the largest x, then y, then z")
    return v[::2], v[1::2]


def picture(run: Run, t: Any, ax: Any, limits: Any) -> Any:
    """See `World.picture`."""
    from .plot import _pyplot

    layout = layout_of(run)
    assert layout is not None
    time = number(t, "t")
    view = _view(limits)
    if ax is not None and not hasattr(ax, "get_zlim"):
        raise ArgumentError("bodies in space are drawn on axes in three dimensions: subplots(subplot_kw={'projection': '3d'})")
    s = layout.world._states(run, numpy.array(time))
    low, high = view if view is not None else _box_of(layout, [s])
    if ax is None:
        ax = _pyplot().figure(layout="constrained").add_subplot(projection="3d")
    _draw(ax, layout, s, low, high)
    return ax


def frames(ax: Any, run: Run, layout: Layout, times: Array, limits: Any) -> Callable[[int], None]:
    """The function that draws a frame of an animation."""
    states = [layout.world._states(run, numpy.array(t)) for t in times]
    view = _view(limits)
    low, high = view if view is not None else _box_of(layout, states[:: max(1, len(states) // 40)])

    def frame(k: int) -> None:
        ax.clear()
        _draw(ax, layout, states[k], low, high)
        ax.set_title(f"t = {times[k]:.2f}", loc="left", fontsize="small")

    return frame
