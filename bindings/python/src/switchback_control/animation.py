"""Animations of scenes: bodies at the times of frames, impacts as flashes, forces as arrows."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from typing import Any

import numpy

from ._arrays import Array, number, vector
from .errors import ArgumentError, RangeError, StateError, UnsupportedError
from .plot import _pyplot
from .runs import Run
from ._gaps import _Touch
from .shapes import Body, Fixed, Motion, States
from ._space_pictures import frames
from ._world_scene import layout_of

__all__ = ["animate"]

_FLASH = 0.15  # seconds for which an impact is shown
_MOST_FRAMES = 5000

Draw = Callable[[Any, Array, float], Any]


def animate(
    run: Run,
    path: Any,
    draw: Draw | None = None,
    *,
    fps: float = 30.0,
    speed: float = 1.0,
    size: Sequence[float] = (6.4, 4.8),
    forces: bool = False,
    limits: Sequence[float] | None = None,
    title: str | None = None,
) -> None:
    """Animate a run of a scene: a GIF, with ffmpeg an MP4, or a page where `path` ends in .html.

    The bodies of a `World` are drawn as they are; in the plane with impacts as stars, and with `forces` the contact forces as
    arrows. Of another scene `draw(axes, q, t)` draws what there is to see at coordinates `q`, on axes that are empty
    again; without it there is a point at (q[0], q[1]), or at (0, q[0]).

    `fps` are frames per second, `speed` is the time of the run that passes in a second, `size` is in inches (of 100
    pixels), `limits` are (left, right, bottom, top), in space the least and the largest x, y and z; by default everything is inside.
    Errors: `ImportError` without matplotlib or pillow, `StateError` for runs without dense output, `UnsupportedError` for
    `forces` in space.
    """
    plt = _pyplot()
    scene = getattr(run.system, "_scene", None)
    if scene is None:
        raise ArgumentError("the run is not that of a scene")
    if draw is not None and not callable(draw):
        raise ArgumentError(f"draw must be a function of (axes, q, t), not {type(draw).__name__}")
    if len(run.t) < 2:
        raise StateError("the run has no dense output: simulate with dense=True, over some time")
    rate, pace = number(fps, "fps"), number(speed, "speed")
    if not (rate > 0.0 and pace > 0.0 and math.isfinite(rate) and math.isfinite(pace)):
        raise RangeError(f"fps is {fps} and speed is {speed}: both must be positive")
    count = (run.t_end - run.t_start) * rate / pace
    if count > _MOST_FRAMES:
        raise RangeError(f"these are {count:.0f} frames, more than {_MOST_FRAMES}: choose a larger speed or fewer fps")
    times = run.t_start + numpy.arange(int(count) + 1) * (pace / rate)
    times = numpy.append(times, run.t_end) if times[-1] < run.t_end - 1e-9 * pace / rate else times
    times = numpy.clip(times, run.t_start, run.t_end)
    inches = vector(size, 2, "size")
    if not numpy.all((inches > 0.5) & (inches < 100.0)):
        raise RangeError(f"size is {size}: width and height in inches")
    layout = layout_of(run)
    writer = _writer(path, rate)
    in_space = draw is None and layout is not None and layout.world.space
    if in_space and forces:
        raise UnsupportedError("forces are drawn in the plane only")
    axes = {"projection": "3d"} if in_space else {}
    figure, ax = plt.subplots(figsize=tuple(inches), dpi=100, layout="constrained", subplot_kw=axes)
    try:
        view = None if limits is None or in_space else vector(limits, 4, "limits")
        if view is not None and not (view[0] < view[1] and view[2] < view[3]):
            raise RangeError(f"limits are {limits}: left, right, bottom, top")
        frame: Callable[[int], Any]
        if in_space:
            frame = frames(ax, run, layout, times, limits)
        elif draw is None and layout is not None:
            frame = _bodies(ax, run, times, view, forces, pace)
        else:
            frame = _drawn(ax, run, times, view, draw, scene.n_q, pace)
        if title:
            figure.suptitle(title)
        # the layout is found once: finding it for every frame takes most of the time
        frame(0)
        figure.canvas.draw()
        figure.set_layout_engine("none")
        _save(figure, path, writer, frame, len(times), rate)
    finally:
        plt.close(figure)


def _writer(path: Any, fps: float) -> str:
    """How a file is written, by its name."""
    end = os.path.splitext(os.fspath(path))[1].lower()
    if end == ".gif":
        try:
            import PIL  # noqa: F401
        except ImportError as error:
            raise ImportError("animations as GIF need pillow: pip install pillow") from error
        return "pillow"
    if end == ".mp4":
        from matplotlib.animation import writers

        if not writers.is_available("ffmpeg"):
            raise UnsupportedError("animations as MP4 need the program ffmpeg, which is not here: choose .gif or .html")
        return "ffmpeg"
    if end in (".html", ".htm"):
        return "html"
    raise ArgumentError(f"animations are .gif, .mp4 or .html, not '{end}'")


def _save(figure: Any, path: Any, writer: str, frame: Callable[[int], Any], n: int, fps: float) -> None:
    from matplotlib.animation import FuncAnimation

    made = FuncAnimation(figure, frame, frames=n, init_func=lambda: [], interval=1000.0 / fps, blit=False)
    if writer == "html":
        with open(path, "w", encoding="utf-8") as file:
            file.write(made.to_jshtml(fps=fps))
    else:
        made.save(os.fspath(path), writer=writer, fps=fps)


def _fit(ax: Any, view: Any, low: Array, high: Array) -> None:
    """Limits around everything, wide enough for the shape of the figure."""
    if view is None:
        room = 0.06 * max(float(numpy.max(high - low)), 1e-9)
        view = (low[0] - room, high[0] + room, low[1] - room, high[1] + room)
    ax.set_aspect("equal", adjustable="box")
    ax.set_xlim(view[0], view[1])
    ax.set_ylim(view[2], view[3])
    ax.set_xlabel("x")
    ax.set_ylabel("y")


def _clock(ax: Any) -> Any:
    """Where the time is shown: above the picture, where nothing moves."""
    return ax.set_title(" ", loc="left", fontsize="small")


# --- scenes ---------------------------------------------------------------------------------------------


def _drawn(
    ax: Any, run: Run, times: Array, view: Any, draw: Draw | None, n_q: int, pace: float
) -> Callable[[int], Any]:
    """Frames that a function draws, or a point."""
    q = run(times)[:, :n_q]
    point = q[:, :2] if n_q > 1 else numpy.column_stack([numpy.zeros(len(q)), q[:, 0]])
    low, high = point.min(axis=0), point.max(axis=0)
    struck = numpy.array([i.t for i in run.impacts])

    def frame(k: int) -> None:
        t = times[k]
        ax.clear()
        if draw is None:
            hit = bool(numpy.any((struck <= t) & (struck > t - _FLASH * pace)))
            ax.plot(*point[k], "o", markersize=9, color="C3" if hit else "C0")
            _fit(ax, view, low - 0.05 * (high - low).max(), high + 0.05 * (high - low).max())
        else:
            draw(ax, q[k], float(t))
            if view is not None:
                _fit(ax, view, low, high)
        _clock(ax).set_text(f"t = {t:.2f}")

    return frame


# --- worlds ---------------------------------------------------------------------------------------------


def _outline(body: Body) -> Array:
    """The outline of a body about its centre, at angle 0."""
    if body._half is not None and body.radius == 0.0:
        return numpy.array([s.at for s in body._spots])
    # between the directions of the axes, so that every point belongs to one corner
    a = numpy.linspace(0.0, 2.0 * math.pi, 49)[:-1] + 1e-6
    circle = numpy.column_stack([numpy.cos(a), numpy.sin(a)])
    if body.shape == "ellipse":
        return circle * body.size
    if body._power is not None:
        return body._power.outline(96)
    return body.radius * circle + numpy.sign(circle) * (body._half or (0.0, 0.0))


def _placed(outline: Array, way: Motion) -> Array:
    """The outline at all times, [times, points, 2]."""
    angle = numpy.zeros(len(way.t)) if way.angle is None else way.angle
    c, d = numpy.cos(angle)[:, None], numpy.sin(angle)[:, None]
    x, y = outline[:, 0], outline[:, 1]
    return numpy.stack([way.x[:, None] + c * x - d * y, way.y[:, None] + d * x + c * y], axis=2)


def _line_of(fixed: Fixed, s: States, k: int, low: Array, high: Array) -> tuple[Array, Array]:
    """Two points of a line far outside the picture, and two beyond it, at time number k."""
    normal = numpy.array(fixed.normal)
    along = numpy.array(fixed._tangents[0])
    offset = fixed.offset(s) if callable(fixed.offset) else fixed.offset
    offset = float(numpy.broadcast_to(numpy.asarray(offset, dtype=float), numpy.shape(s.t))[k])
    middle, far = 0.5 * (low + high), 2.0 * float(numpy.linalg.norm(high - low)) + 1.0
    foot = middle + (offset - normal @ middle) * normal
    return numpy.array([foot - far * along, foot + far * along]), -far * normal


def _bodies(
    ax: Any, run: Run, times: Array, view: Any, forces: bool, pace: float
) -> Callable[[int], Any]:
    """Frames of the bodies of a world."""
    layout = layout_of(run)
    assert layout is not None
    world = layout.world
    s = world._states(run, times)
    ways = {b.name: world.trajectory(run, b, times) for b in world.bodies if b in layout.bodies}
    bodies = [b for b in world.bodies if b in layout.bodies]
    outlines = {b.name: _placed(_outline(b), ways[b.name]) for b in bodies}
    everywhere = numpy.vstack([o.reshape(-1, 2) for o in outlines.values()])
    low, high = everywhere.min(axis=0), everywhere.max(axis=0)
    scale = float(numpy.max(high - low))
    if scale == 0.0:
        low, high, scale = low - 1.0, high + 1.0, 2.0
    # a picture of a motion along a line still has two dimensions
    thin = 0.5 * numpy.maximum(0.5 * scale - (high - low), 0.0)
    low, high = low - thin, high + thin
    if view is not None:
        low, high = numpy.array([view[0], view[2]]), numpy.array([view[1], view[3]])
    _fit(ax, view, low, high)
    grounds = []
    for f in layout.fixed:
        (edge,) = ax.plot([], [], color="0.35", linewidth=1.5, zorder=1)
        (fill,) = ax.fill([0.0], [0.0], facecolor="0.88", edgecolor="none", zorder=0)
        grounds.append((f, edge, fill))
    shapes = []
    for i, b in enumerate(bodies):
        color = f"C{i % 10}"
        mark = None
        if b.shape == "point":
            (shape,) = ax.plot([], [], "o", color=color, markersize=6, zorder=3)
        elif b.shape == "rod":
            (shape,) = ax.plot([], [], "-", color=color, linewidth=3.0, solid_capstyle="round", zorder=3)
        else:
            (shape,) = ax.fill([0.0], [0.0], facecolor=color, edgecolor="0.2", alpha=0.85, linewidth=0.8, zorder=3)
            if b.shape == "disc":
                (mark,) = ax.plot([], [], color="0.2", linewidth=0.8, zorder=4)
        shapes.append((b, shape, mark))
    flashes = _flashes(run, layout.touches)
    stars = ax.scatter([], [], marker="*", color="gold", edgecolors="C3", linewidths=0.8, zorder=6)
    arrows, tails, heads = None, None, None
    if forces:
        tails, heads = _arrows(run, layout.touches, s, times, scale)
        hidden = numpy.zeros((tails.shape[1], 2))
        arrows = ax.quiver(
            hidden[:, 0], hidden[:, 1], hidden[:, 0], hidden[:, 1],
            angles="xy", scale_units="xy", scale=1.0, color="C3", width=0.009, zorder=5,
        )  # fmt: skip
    clock = _clock(ax)

    def frame(k: int) -> None:
        for f, edge, fill in grounds:
            line, beyond = _line_of(f, s, k, low, high)
            edge.set_data(line[:, 0], line[:, 1])
            fill.set_xy(numpy.vstack([line, line[::-1] + beyond]))
        for b, shape, mark in shapes:
            outline = outlines[b.name][k]
            centre = ways[b.name].x[k], ways[b.name].y[k]
            if b.shape == "point":
                shape.set_data([centre[0]], [centre[1]])
            elif b.shape == "rod":
                shape.set_data(outline[:, 0], outline[:, 1])
            else:
                shape.set_xy(outline)
            if mark is not None:
                mark.set_data([centre[0], outline[0, 0]], [centre[1], outline[0, 1]])
        t = times[k]
        now = [f for f in flashes if f[0] <= t < f[0] + _FLASH * pace]
        stars.set_offsets(numpy.array([f[1] for f in now]).reshape(-1, 2))
        stars.set_sizes(numpy.array([f[2] for f in now]))
        if arrows is not None:
            arrows.set_offsets(tails[k])
            arrows.set_UVC(heads[k, :, 0], heads[k, :, 1])
        clock.set_text(f"t = {t:.2f}")

    return frame


def _flashes(run: Run, touches: list[_Touch]) -> list[tuple[float, Array, float]]:
    """Times, places and sizes of the stars of impacts."""
    layout = layout_of(run)
    assert layout is not None
    if not run.impacts:
        return []
    by_name = {touch.name: touch for touch in touches}
    struck = numpy.array([i.t for i in run.impacts])
    largest = max(math.hypot(i.normal, *i.tangential) for i in run.impacts)
    out = []
    for name in {i.name for i in run.impacts}:
        own = [j for j, i in enumerate(run.impacts) if i.name == name]
        s = layout.world._states(run, struck[own])
        _, _, _, point = by_name[name].geometry(s)
        places = numpy.column_stack([numpy.broadcast_to(c, len(own)) for c in point])
        for place, j in zip(places, own):
            i = run.impacts[j]
            out.append((i.t, place, 260.0 * math.sqrt(math.hypot(i.normal, *i.tangential) / (largest or 1.0))))
    return out


def _arrows(run: Run, touches: list[_Touch], s: States, times: Array, scale: float) -> tuple[Array, Array]:
    """Tails and vectors of the contact forces, [times, arrows, 2]: the force on the first body, and on the second if it
    moves; the largest is a quarter of the picture."""
    all = run._forces(times)
    kept = {c[0]: k for k, c in enumerate(run.system._contacts)}
    tails, heads = [], []
    for touch in touches:
        if touch.name not in kept:
            continue
        k = kept[touch.name]
        _, normal, _, point = touch.geometry(s)
        n = numpy.column_stack([numpy.broadcast_to(c, len(times)) for c in normal])
        place = numpy.column_stack([numpy.broadcast_to(c, len(times)) for c in point])
        along = numpy.column_stack([n[:, 1], -n[:, 0]])
        force = all[:, k, :1] * n + all[:, k, 1:2] * along
        for sign in (1.0,) if isinstance(touch.b, Fixed) else (1.0, -1.0):
            tails.append(place)
            heads.append(sign * force)
    if not tails:
        return numpy.zeros((len(times), 0, 2)), numpy.zeros((len(times), 0, 2))
    vectors = numpy.stack(heads, axis=1)
    lengths = numpy.linalg.norm(vectors, axis=2)
    largest = float(numpy.max(lengths))
    return numpy.stack(tails, axis=1), vectors * (0.25 * scale / largest if largest > 0.0 else 0.0)
