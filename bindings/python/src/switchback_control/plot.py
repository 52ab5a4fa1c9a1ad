"""Plots of states, controls, step sizes, active modes, switches and switching surfaces, and of contacts."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from typing import Any, Sequence

import numpy

from ._ffi import ContactMode, EventKind
from ._names import filled
from ._regions import mode_names
from .automaton import place_of
from .errors import ArgumentError, DimensionError, StateError
from .runs import Run
from .trajectory import Trajectory

__all__ = ["plot", "plot_contacts", "plot_phase", "plot_run"]

_GRID = {"color": "0.9", "linewidth": 0.6}


def _pyplot() -> Any:
    try:
        import matplotlib.pyplot
    except ImportError as error:
        raise ImportError("plots need matplotlib: pip install matplotlib") from error
    return matplotlib.pyplot


def _labels(names: Sequence[str] | None, letter: str, count: int) -> list[str]:
    if names is None:
        return [f"${letter}_{{{i + 1}}}$" for i in range(count)]
    if len(names) != count:
        raise ArgumentError(f"{len(names)} names for {count} curves: {list(names)}")
    return list(names)


_MARKS = {EventKind.CROSS: "o", EventKind.ENTER: "s", EventKind.LEAVE: "^", EventKind.SPONTANEOUS: "*"}


def plot(
    result: Any,
    path: Any = None,
    *,
    names: Sequence[str] | None = None,
    control_names: Sequence[str] | None = None,
    states: Sequence[int] | None = None,
    title: str | None = None,
    points: int = 12,
) -> Any:
    """Plot a trajectory, or the result of a simulation or an optimal control problem: states, controls, step
    sizes and active modes over time, with the switches as dotted lines.

    `states` chooses states, `names` and `control_names` label them, `points` are drawn for each finite element. With
    `path` the figure is saved there. Returns the matplotlib figure.
    """
    trajectory = result if isinstance(result, Trajectory) else getattr(result, "trajectory", None)
    if not isinstance(trajectory, Trajectory):
        raise ArgumentError(f"there is no trajectory in {type(result).__name__}")
    if trajectory.n_elements == 0:
        raise StateError("the trajectory is empty")
    plt = _pyplot()
    controls = getattr(result, "controls", None)
    controls = numpy.empty((1, 0)) if controls is None else controls
    has_controls = controls.size > 0
    n_modes = sum(trajectory.n_modes)

    heights = [3.0] + ([1.8] if has_controls else []) + [1.4] + ([0.5 + 0.22 * n_modes] if n_modes else [])
    figure, axes = plt.subplots(
        len(heights),
        1,
        sharex=True,
        squeeze=False,
        figsize=(8.0, 0.8 + sum(heights)),
        gridspec_kw={"height_ratios": heights},
        layout="constrained",
    )
    panels = iter(axes[:, 0])

    ax = next(panels)
    system = getattr(result, "system", None)
    _states(ax, trajectory, _default_labels(system, "x", trajectory.nx) if names is None else names, states, points)
    if has_controls:
        n = controls.shape[1]
        known = _default_labels(system, "u", n) if control_names is None else _labels(control_names, "u", n)
        _steps(next(panels), result.control_times, controls, known)
    ax = next(panels)
    ax.stairs(trajectory.steps, trajectory.times, baseline=None, color="0.3", linewidth=1.2)
    ax.set_ylim(bottom=0.0)
    ax.set_ylabel("step sizes")
    if n_modes:
        _modes(next(panels), trajectory, mode_names(system, trajectory.n_modes))
    sliding = _sliding_elements(trajectory)
    for ax in axes[:, 0]:
        _shade(ax, sliding)
        ax.grid(**_GRID)
        ax.set_axisbelow(True)
        for t in trajectory.switch_times:
            ax.axvline(t, color="0.5", linestyle=":", linewidth=0.8)
    axes[-1, 0].set_xlabel("time")
    axes[-1, 0].set_xlim(trajectory.t_start, trajectory.t_end)
    lines = [title] if title else []
    lines += textwrap.wrap(getattr(result, "message", ""), 100)
    if lines:
        figure.suptitle("\n".join(lines), fontsize=None if title and len(lines) == 1 else "small")
    return _finish(figure, path)


def _finish(figure: Any, path: Any) -> Any:
    if path is not None:
        try:
            figure.savefig(path, dpi=150)
        finally:
            _pyplot().close(figure)
    return figure


def _curve(run: Run, points: int) -> tuple[numpy.ndarray, numpy.ndarray, numpy.ndarray]:
    """Times and states along a run, some in every step; at a jump the time twice, with the states before and behind,
    and which places are the first of the two."""
    if len(run.t) < 2:
        raise StateError("the run has no dense output: simulate with dense=True, over some time")
    between = numpy.linspace(0.0, 1.0, max(points, 1) + 1)[:-1]
    t = numpy.append((run.t[:-1, None] + numpy.diff(run.t)[:, None] * between).ravel(), run.t[-1])
    if run.impacts:
        # bodies that fly have long steps, whatever the curve
        t = numpy.union1d(t, numpy.linspace(run.t_start, run.t_end, 400))
    x = run(numpy.clip(t, run.t_start, run.t_end))
    jumps = [(j.t, j.after) for j in run.jumps]
    if run.impacts:
        times = numpy.unique([i.t for i in run.impacts])
        times = times[times < run.t_end]
        jumps += zip(times, run(numpy.nextafter(times, numpy.inf)))
        if run.impacts[-1].t == run.t_end:
            jumps.append((run.t_end, run._last))
        jumps.sort(key=lambda j: j[0])
    places = numpy.searchsorted(t, [j[0] for j in jumps], side="right")
    if jumps:
        t = numpy.insert(t, places, [j[0] for j in jumps])
        x = numpy.insert(x, places, [j[1] for j in jumps], axis=0)
    return t, x, places + numpy.arange(len(places)) - 1


def _line(ax: Any, a: numpy.ndarray, b: numpy.ndarray, jumps: numpy.ndarray, **style: Any) -> Any:
    """A curve that is dotted where it jumps."""
    whole = [numpy.insert(c, jumps + 1, numpy.nan) for c in (a, b)] if len(jumps) else [a, b]
    (line,) = ax.plot(*whole, linewidth=1.5, **style)
    if len(jumps):
        gaps = numpy.full((len(jumps), 1), numpy.nan)
        dotted = [numpy.hstack([c[jumps, None], c[jumps + 1, None], gaps]).ravel() for c in (a, b)]
        ax.plot(*dotted, linestyle=":", linewidth=0.9, color=line.get_color())
    return line


def _default_labels(system: Any, block: str, n: int) -> list[str]:
    """Names of the states, "x", or of the controls, "u", where the system has any."""
    known = () if system is None else system._names["xup".index(block)]
    return [(known[i] if i < len(known) else "") or label for i, label in enumerate(_labels(None, block, n))]


def _steps(ax: Any, times: numpy.ndarray, controls: numpy.ndarray, names: Sequence[str]) -> None:
    """Controls that are constant between times."""
    for column, label in zip(controls.T, names):
        ax.stairs(column, times, baseline=None, label=label, linewidth=1.5)
    ax.set_ylabel("controls" if len(names) != 1 else f"control {names[0]}")
    if len(names) > 1:
        _legend(ax, len(names))


#: Switches, and intervals of a mode, that are drawn one by one. More cannot be told apart in a picture of this width: their
#: marks are left out, and intervals less than a pixel apart are drawn as one.
_MOST_MARKS = 400
_PIXELS = 1000  # across a panel


def _marks(ax: Any, run: Run, at: numpy.ndarray, chosen: Sequence[int], colors: Sequence[Any]) -> None:
    """A mark at every switch on the curves of the chosen states; `at` are the states there."""
    for kind, mark in _MARKS.items():
        own = [i for i, s in enumerate(run.switches) if s.kind == kind]
        for i, color in zip(chosen if own else (), colors):
            ax.plot(run.switch_times[own], at[own, i], mark, color=color, markersize=5, linestyle="none")


def _finest(run: Run, count: int) -> float:
    """The shortest gap between intervals that is drawn, where there are `count` of them."""
    return (run.t_end - run.t_start) / _PIXELS if count > _MOST_MARKS else 0.0


def _joined(spans: Sequence[tuple[float, float]], width: float) -> list[tuple[float, float]]:
    """Intervals, as start and length, less than `width` apart as one."""
    joined: list[tuple[float, float]] = []
    for start, length in spans:
        if joined and start - sum(joined[-1]) <= width:
            joined[-1] = joined[-1][0], start + length - joined[-1][0]
        else:
            joined.append((start, length))
    return joined


def _shade(ax: Any, spans: Sequence[tuple[float, float]]) -> None:
    """Grey where a subsystem slides."""
    for a, b in spans:
        ax.axvspan(a, b, color="0.5", alpha=0.12, linewidth=0.0)


def _sliding(run: Run) -> list[tuple[float, float]]:
    """Intervals in which several modes of a subsystem are active."""
    found: list[tuple[float, float]] = []
    for k in range(len(run.n_modes)):
        own = [(a, b - a) for a, b, modes in run.active(k) if len(modes) > 1]
        found += [(a, a + length) for a, length in (_joined(own, _finest(run, len(own))) if len(own) > _MOST_MARKS else own)]
    return found


def plot_run(
    run: Run,
    path: Any = None,
    *,
    names: Sequence[str] | None = None,
    states: Sequence[Any] | None = None,
    title: str | None = None,
    points: int = 12,
) -> Any:
    """Plot the states of an event-driven simulation over time, with a mark at every switch (circle: crossing, square: a
    sliding mode begins, triangle: it ends, star: not forced), and the active modes as bands, several of them while
    sliding, which is shaded. Controls that change are steps. Where states jump they are dotted.

    Of a scene coordinates and velocities have a panel each, the marks are impacts, and the bands are the modes of the
    contacts that close: closed, or with friction sticks, slides along the tangent, slides back.

    `states` chooses states by number, name or expression, `names` label them, `points` are drawn in every step. With
    `path` the figure is saved there. Returns the matplotlib figure.
    """
    t, x, jumps = _curve(run, points)
    plt = _pyplot()
    scene = getattr(run.system, "_scene", None)
    chosen = list(range(run.nx)) if states is None else [place_of(run.system, i) for i in states]
    known = _default_labels(run.system, "x", run.nx)
    if names is not None and len(names) == run.nx:
        known = list(names)
    elif names is not None:
        known = dict(zip(chosen, _labels(names, "x", len(chosen))))  # type: ignore[assignment]
    groups = [("states", chosen)]
    if scene is not None and scene.n_q:
        n_q, behind = scene.n_q, scene.n_q + (getattr(scene, "n_v", None) or run.nx)
        parts = (
            [i for i in chosen if i < n_q],
            [i for i in chosen if n_q <= i < behind],
            [i for i in chosen if i >= behind],
        )
        groups = [g for g in zip(("coordinates", "velocities", "states"), parts) if g[1]]
    bands = _contact_bands(run, None) if scene is not None else None
    # subsystems whose modes are known: of those that never switch they are not, where a transition may have changed them
    shown = [k for k in range(len(run.n_modes)) if run.active(k)]
    n_modes = len(bands) if bands is not None else sum(run.n_modes[k] for k in shown)
    control_times, controls = run.controls
    with_controls = [1.6] if controls.shape[1] and len(controls) > 1 else []
    heights = [3.2 if len(groups) == 1 else 2.4] * len(groups) + with_controls + ([0.5 + 0.22 * n_modes] if n_modes else [])
    figure, axes = plt.subplots(
        len(heights),
        1,
        sharex=True,
        squeeze=False,
        figsize=(8.0, 0.8 + sum(heights)),
        gridspec_kw={"height_ratios": heights},
        layout="constrained",
    )
    marks = sorted({i.t for i in run.impacts})
    before = run(numpy.array(marks)) if marks else None
    few = len(run.switches) <= _MOST_MARKS
    at = run(run.switch_times) if scene is None and run.switches and few else None
    for ax, (what, own) in zip(axes[:, 0], groups):
        lines = [_line(ax, t, x[:, i], jumps, label=known[i]) for i in own]
        colors = [line.get_color() for line in lines]
        if at is not None:
            _marks(ax, run, at, own, colors)
        elif before is not None:
            for i, color in zip(own, colors):
                ax.plot(marks, before[:, i], "o", color=color, markersize=3)
        ax.set_ylabel(what)
        _legend(ax, len(own))
    if bands is not None and n_modes:
        _draw_contact_bands(axes[-1, 0], run, bands)
    elif n_modes:
        _bands(axes[-1, 0], run, shown)
    if with_controls:
        _steps(axes[len(groups), 0], control_times, controls, _default_labels(run.system, "u", controls.shape[1]))
    sliding = _sliding(run) if scene is None else []
    for ax in axes[:, 0]:
        ax.grid(**_GRID)
        ax.set_axisbelow(True)
        _shade(ax, sliding)
        if scene is None and few:
            for switch_time in run.switch_times:
                ax.axvline(switch_time, color="0.5", linestyle=":", linewidth=0.8)
    axes[-1, 0].set_xlabel("time")
    axes[-1, 0].set_xlim(run.t_start, run.t_end)
    said = [] if few or scene is not None else [f"{len(run.switches)} switches, without marks"]
    if title or said:
        figure.suptitle("\n".join([title] * bool(title) + said), fontsize=None if title else "small")
    return _finish(figure, path)


_MODE_STYLE = {
    ContactMode.CLOSED: ("C0", "sticks"),
    ContactMode.SLIDES: ("C1", "slides"),
    ContactMode.SLIDES_BACK: ("C3", "slides back"),
}


def _contact_bands(run: Run, contacts: Sequence[Any] | None) -> list[tuple[str, list[tuple[float, float, int]], list]]:
    """Of contacts (None: those that close or have impulses) the name, intervals in which they are not open with their
    mode, and times of impacts."""
    cuts = numpy.unique([run.t_start, *run.switch_times, *(i.t for i in run.impacts), run.t_end])
    names = [c[0] for c in run.system._contacts]
    chosen = list(range(len(names))) if contacts is None else [run._contact(c) for c in contacts]
    if not chosen:
        return []
    struck: dict[int, list[float]] = {}
    for i in run.impacts:
        struck.setdefault(i.contact, []).append(i.t)
    middle = 0.5 * (cuts[:-1] + cuts[1:])
    modes = run._modes(middle)
    out = []
    for k in chosen:
        spans: list[tuple[float, float, int]] = []
        for a, b, mode in zip(cuts, cuts[1:], modes[:, k]):
            if mode == ContactMode.OPEN:
                continue
            if spans and spans[-1][1] == a and spans[-1][2] == mode:
                spans[-1] = (spans[-1][0], b, int(mode))
            else:
                spans.append((a, b, int(mode)))
        if contacts is not None or spans or k in struck:
            out.append((names[k], spans, struck.get(k, [])))
    return out


def _draw_contact_bands(ax: Any, run: Run, bands: list[tuple[str, list[tuple[float, float, int]], list]]) -> None:
    import matplotlib.lines
    import matplotlib.patches

    seen, marked = set(), False
    # what closed means: nothing slides without friction, and constraints of projected systems are no contacts
    of_bodies = run.system._scene.n_q > 0
    rough = any(n for _, n in run.system._contacts)
    closed = ("sticks" if rough else "closed") if of_bodies else "active"
    for row, (_, spans, impacts) in enumerate(bands):
        for mode, (color, _) in _MODE_STYLE.items():
            own = [(a, b - a) for a, b, m in spans if m == mode]
            if own:
                ax.broken_barh(own, (row - 0.35, 0.7), facecolor=color, alpha=0.8)
                seen.add(mode)
        if impacts:
            ax.plot(impacts, [row] * len(impacts), "|", color="black", markersize=6, markeredgewidth=0.8)
            marked = True
    ax.set_yticks(range(len(bands)), [name for name, _, _ in bands], fontsize="x-small")
    ax.set_ylim(len(bands) - 0.4, -0.6)
    ax.set_ylabel("contacts" if of_bodies else "constraints")
    handles: list[Any] = [
        matplotlib.patches.Patch(color=color, alpha=0.8, label=closed if mode == ContactMode.CLOSED else label)
        for mode, (color, label) in _MODE_STYLE.items()
        if mode in seen
    ]
    if marked:
        line = matplotlib.lines.Line2D([], [], color="black", marker="|", linestyle="", label="impact")
        handles.append(line)
    if handles:
        ax.legend(handles=handles, loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize="small", frameon=False)


def plot_contacts(
    run: Run,
    path: Any = None,
    *,
    contacts: Sequence[Any] | None = None,
    p: Any = None,
    title: str | None = None,
    points: int = 12,
) -> Any:
    """Plot the contacts of a scene, or the constraints of a projected system, over time: gaps, normal forces, friction
    (dashed: the second tangent), and modes as bands. Impulses are marks in the bands: they are no forces.

    `contacts` chooses contacts by `SceneContact`, name or number; by default they are those that close or have
    impulses, at most twelve of them in the panels of curves. `p` are the parameters, by default those of the run. With
    `path` the figure is saved there. Returns the matplotlib figure.
    """
    scene = getattr(run.system, "_scene", None)
    if scene is None:
        raise ArgumentError("the run is not that of a scene")
    t, x, jumps = _curve(run, points)
    bands = _contact_bands(run, contacts)
    if not bands:
        raise ArgumentError("no contact closes in this run: choose contacts to see their gaps")
    plt = _pyplot()
    drawn = [name for name, _, _ in bands][:12]
    by_name = {c.name: c for c in scene.contacts}
    # a switch has no gap
    none = scene.graph.of(0.0)
    gaps = scene.function([by_name[name].gap if name in by_name else none for name in drawn], "gaps")
    given = p if p is not None else run._p
    u = numpy.zeros(scene.nu)
    values = numpy.array([gaps(state, u, given, time) for state, time in zip(x, t)])
    # forces jump at events: a little before and behind each of them
    events = numpy.unique([*run.switch_times, *(i.t for i in run.impacts)])
    events = events[(events > run.t_start) & (events < run.t_end)]
    times = numpy.concatenate([t, numpy.nextafter(events, numpy.inf)])
    times.sort()
    forces = run._forces(numpy.clip(times, run.t_start, run.t_end))
    friction = any(run._n_tangents(run._contact(name)) for name in drawn)
    heights = [2.0, 2.0] + ([2.0] if friction else []) + [0.5 + 0.22 * len(bands)]
    figure, axes = plt.subplots(
        len(heights),
        1,
        sharex=True,
        squeeze=False,
        figsize=(8.0, 0.8 + sum(heights)),
        gridspec_kw={"height_ratios": heights},
        layout="constrained",
    )
    for i, name in enumerate(drawn):
        k = run._contact(name)
        axes[0, 0].plot(t, values[:, i], linewidth=1.5, label=name, color=f"C{i % 10}")
        axes[1, 0].plot(times, forces[:, k, 0], linewidth=1.5, color=f"C{i % 10}")
        for j in range(run._n_tangents(k)):
            axes[2, 0].plot(times, forces[:, k, 1 + j], ["-", "--"][j], linewidth=1.5, color=f"C{i % 10}")
    axes[0, 0].set_ylabel("gap" if scene.n_q else "constraint")
    axes[1, 0].set_ylabel("normal force" if scene.n_q else "multiplier")
    if friction:
        axes[2, 0].set_ylabel("friction")
    _legend(axes[0, 0], max(len(drawn), 2))
    _draw_contact_bands(axes[-1, 0], run, bands)
    for ax in axes[:, 0]:
        ax.grid(**_GRID)
        ax.set_axisbelow(True)
    axes[-1, 0].set_xlabel("time")
    axes[-1, 0].set_xlim(run.t_start, run.t_end)
    if title:
        figure.suptitle(title)
    return _finish(figure, path)


def _mode_label(words: Sequence[Sequence[str]], k: int, i: int) -> str:
    """A mode by its name, or by its number, behind that of the subsystem where there are several."""
    name = words[k][i]
    return f"{k}: {i}" if name == str(i) and len(words) > 1 else name


def _bands(ax: Any, run: Run, subsystems: Sequence[int]) -> None:
    labels: list[str] = []
    words = run.mode_names
    for k in subsystems:
        spans = run.active(k)
        for i in range(run.n_modes[k]):
            own = _joined([(a, b - a) for a, b, on in spans if i in on], _finest(run, len(spans)))
            ax.broken_barh(own, (len(labels) - 0.4, 0.8), facecolor=f"C{k % 10}", alpha=0.8)
            labels.append(_mode_label(words, k, i))
    ax.set_yticks(range(len(labels)), labels, fontsize="x-small")
    ax.set_ylim(-0.6, len(labels) - 0.4)
    ax.set_ylabel("modes")


def plot_phase(
    run: Run,
    path: Any = None,
    *,
    states: Sequence[Any] = (0, 1),
    names: Sequence[str] | None = None,
    title: str | None = None,
    points: int = 12,
    grid: int = 160,
    u: Any = None,
    p: Any = None,
) -> Any:
    """Plot two states of an event-driven simulation against each other, over the switching surfaces: the zeros of the
    switching functions where the other states, controls `u`, parameters `p` and the time are those of the end of the run. The
    marks are those of `plot_run`, a cross is the start; jumps, and impacts of a scene, are dotted.

    `states` are numbers, names or expressions; `grid` is the number of points in each direction where the surfaces are
    evaluated. With `path` the figure is saved
    there. Returns the matplotlib figure.
    """
    chosen = [place_of(run.system, i) for i in states]
    if len(chosen) != 2:
        raise DimensionError(f"states must be two of the {run.nx} states, not {list(states)}")
    _, x, jumps = _curve(run, points)
    plt = _pyplot()
    u = run._u[-1] if u is None and run._u is not None and len(run._u) else u
    p = run._p if p is None else p
    if isinstance(u, Mapping) or isinstance(p, Mapping):
        u, p = (filled(v, known, what) for v, known, what in ((u, run.system._names[1], "u"), (p, run.system._names[2], "p")))
    figure, ax = plt.subplots(figsize=(6.4, 5.6), layout="constrained")
    a, b = chosen
    _line(ax, x[:, a], x[:, b], jumps, color="C0")
    ax.plot(x[0, a], x[0, b], "x", color="C0", markersize=7)
    if getattr(run.system, "_scene", None) is not None:
        ax.plot(x[jumps, a], x[jumps, b], "o", color="C3", markersize=3)
    if getattr(run.system, "_scene", None) is None and 0 < len(run.switches) <= _MOST_MARKS:
        at = run(run.switch_times)
        for kind, mark in _MARKS.items():
            own = [i for i, s in enumerate(run.switches) if s.kind == kind]
            ax.plot(at[own, a], at[own, b], mark, color="C3", markersize=5, linestyle="none")
    ax.margins(0.12)
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    horizontal, vertical = numpy.linspace(left, right, grid), numpy.linspace(bottom, top, grid)
    for k in range(run.system.n_subsystems):
        values = []
        for v in vertical:
            row = []
            for h in horizontal:
                point = run._last.copy()
                point[[a, b]] = h, v
                row.append(run.system.surfaces(point, u, p, run.t_end, subsystem=k))
            values.append(row)
        for level in numpy.moveaxis(numpy.array(values), 2, 0):
            finite = level[numpy.isfinite(level)]
            if finite.size and finite.min() < 0.0 < finite.max():
                ax.contour(horizontal, vertical, level, levels=[0.0], colors="0.35", linestyles="--", linewidths=1.0)
    labels = _labels(names, "x", 2) if names is not None else [_default_labels(run.system, "x", run.nx)[i] for i in chosen]
    ax.set_xlabel(labels[0])
    ax.set_ylabel(labels[1])
    ax.grid(**_GRID)
    ax.set_axisbelow(True)
    if title:
        ax.set_title(title)
    return _finish(figure, path)


def _states(ax: Any, r: Trajectory, names: Sequence[str] | None, states: Sequence[int] | None, points: int) -> None:
    chosen = list(range(r.nx)) if states is None else list(states)
    between = numpy.linspace(0.0, 1.0, max(points, 1) + 1)[:-1]
    t = numpy.append((r.times[:-1, None] + r.steps[:, None] * between).ravel(), r.t_end)
    x = r(numpy.clip(t, r.t_start, r.t_end))
    labels = _labels(names, "x", len(chosen) if names is not None and len(names) != r.nx else r.nx)
    if len(labels) == r.nx:
        labels = [labels[i] for i in chosen]
    for i, label in zip(chosen, labels):
        (line,) = ax.plot(t, x[:, i], label=label, linewidth=1.5)
        ax.plot(r.times, r.states[:, i], ".", color=line.get_color(), markersize=3)
    ax.set_ylabel("states")
    _legend(ax, len(chosen))


def _sliding_elements(r: Trajectory) -> list[tuple[float, float]]:
    """Intervals of elements in which several modes of a subsystem are active."""
    spans: list[tuple[float, float]] = []
    for k in range(len(r.n_modes)):
        several = r.active_modes(k).sum(axis=1) > 1
        for a, b, on in zip(r.times, r.times[1:], several):
            if on and spans and spans[-1][1] == a:
                spans[-1] = (spans[-1][0], b)
            elif on:
                spans.append((a, b))
    return spans


def _modes(ax: Any, r: Trajectory, words: Sequence[Sequence[str]]) -> None:
    labels: list[str] = []
    for k, n in enumerate(r.n_modes):
        for i in range(n):
            active = r.active_modes(k)[:, i]
            spans = [(t, h) for t, h, on in zip(r.times, r.steps, active) if on]
            ax.broken_barh(spans, (len(labels) - 0.4, 0.8), facecolor=f"C{k % 10}", alpha=0.8)
            labels.append(_mode_label(words, k, i))
    ax.set_yticks(range(len(labels)), labels, fontsize="x-small")
    ax.set_ylim(-0.6, len(labels) - 0.4)
    ax.set_ylabel("modes")


def _legend(ax: Any, count: int) -> None:
    if 0 < count <= 12:
        ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize="small", frameon=False)
