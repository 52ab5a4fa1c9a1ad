"""Plots of states, controls, step sizes, active modes, switches and switching surfaces."""

from __future__ import annotations

import textwrap
from typing import Any, Sequence

import numpy

from ._arrays import index
from ._ffi import EventKind
from .errors import ArgumentError, DimensionError, StateError
from .integrator import Run
from .trajectory import Trajectory

__all__ = ["plot", "plot_phase", "plot_run"]

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
    _states(ax, trajectory, names, states, points)
    if has_controls:
        ax = next(panels)
        for column, label in zip(controls.T, _labels(control_names, "u", controls.shape[1])):
            ax.stairs(column, result.control_times, baseline=None, label=label, linewidth=1.5)
        ax.set_ylabel("controls")
        _legend(ax, controls.shape[1])
    ax = next(panels)
    ax.stairs(trajectory.steps, trajectory.times, baseline=None, color="0.3", linewidth=1.2)
    ax.set_ylim(bottom=0.0)
    ax.set_ylabel("step sizes")
    if n_modes:
        _modes(next(panels), trajectory)
    for ax in axes[:, 0]:
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


def _curve(run: Run, points: int) -> tuple[numpy.ndarray, numpy.ndarray]:
    """Times and states along a run, some in every step; at a jump the time twice, with the states before and behind."""
    if len(run.t) < 2:
        raise StateError("the run has no dense output: simulate with dense=True, over some time")
    between = numpy.linspace(0.0, 1.0, max(points, 1) + 1)[:-1]
    t = numpy.append((run.t[:-1, None] + numpy.diff(run.t)[:, None] * between).ravel(), run.t[-1])
    x = run(numpy.clip(t, run.t_start, run.t_end))
    if run.jumps:
        places = numpy.searchsorted(t, [j.t for j in run.jumps], side="right")
        t = numpy.insert(t, places, [j.t for j in run.jumps])
        x = numpy.insert(x, places, [j.after for j in run.jumps], axis=0)
    return t, x


def plot_run(
    run: Run,
    path: Any = None,
    *,
    names: Sequence[str] | None = None,
    states: Sequence[int] | None = None,
    title: str | None = None,
    points: int = 12,
) -> Any:
    """Plot the states of an event-driven simulation over time, with a mark at every switch (circle: crossing, square: a
    sliding mode begins, triangle: it ends, star: not forced), and the active modes as bands, several of them while
    sliding.

    `states` chooses states, `names` label them, `points` are drawn in every step. With `path` the figure is saved there.
    Returns the matplotlib figure.
    """
    t, x = _curve(run, points)
    plt = _pyplot()
    n_modes = sum(run.n_modes)
    heights = [3.2] + ([0.5 + 0.22 * n_modes] if n_modes else [])
    figure, axes = plt.subplots(
        len(heights),
        1,
        sharex=True,
        squeeze=False,
        figsize=(8.0, 0.8 + sum(heights)),
        gridspec_kw={"height_ratios": heights},
        layout="constrained",
    )
    ax = axes[0, 0]
    chosen = list(range(run.nx)) if states is None else [index(i, "states") for i in states]
    labels = _labels(names, "x", len(chosen) if names is not None else run.nx)
    for i, label in zip(chosen, labels if names is not None else [labels[i] for i in chosen]):
        (line,) = ax.plot(t, x[:, i], label=label, linewidth=1.5)
        for s in run.switches:
            ax.plot(s.t, run(s.t)[i], _MARKS[s.kind], color=line.get_color(), markersize=5)
    ax.set_ylabel("states")
    _legend(ax, len(chosen))
    if n_modes:
        _bands(axes[1, 0], run)
    for ax in axes[:, 0]:
        ax.grid(**_GRID)
        ax.set_axisbelow(True)
        for switch_time in run.switch_times:
            ax.axvline(switch_time, color="0.5", linestyle=":", linewidth=0.8)
    axes[-1, 0].set_xlabel("time")
    axes[-1, 0].set_xlim(run.t_start, run.t_end)
    if title:
        figure.suptitle(title)
    return _finish(figure, path)


def _bands(ax: Any, run: Run) -> None:
    labels: list[str] = []
    for k, n in enumerate(run.n_modes):
        spans = run.active(k)
        for i in range(n):
            ax.broken_barh(
                [(a, b - a) for a, b, on in spans if i in on],
                (len(labels) - 0.4, 0.8),
                facecolor=f"C{k % 10}",
                alpha=0.8,
            )
            labels.append(f"{k}: {i}" if len(run.n_modes) > 1 else str(i))
    ax.set_yticks(range(len(labels)), labels, fontsize="x-small")
    ax.set_ylim(-0.6, len(labels) - 0.4)
    ax.set_ylabel("modes")


def plot_phase(
    run: Run,
    path: Any = None,
    *,
    states: Sequence[int] = (0, 1),
    names: Sequence[str] | None = None,
    title: str | None = None,
    points: int = 12,
    grid: int = 160,
    u: Any = None,
    p: Any = None,
) -> Any:
    """Plot two states of an event-driven simulation against each other, over the switching surfaces: the zeros of the
    switching functions where the other states, controls `u`, parameters `p` and the time are those of the end. The marks
    are those of `plot_run`, a cross is the start.

    `grid` is the number of points in each direction where the surfaces are evaluated. With `path` the figure is saved
    there. Returns the matplotlib figure.
    """
    chosen = [index(i, "states") for i in states]
    if len(chosen) != 2 or any(not 0 <= i < run.nx for i in chosen):
        raise DimensionError(f"states must be two of the {run.nx} states, not {list(states)}")
    _, x = _curve(run, points)
    plt = _pyplot()
    figure, ax = plt.subplots(figsize=(6.4, 5.6), layout="constrained")
    a, b = chosen
    ax.plot(x[:, a], x[:, b], linewidth=1.5, color="C0")
    ax.plot(x[0, a], x[0, b], "x", color="C0", markersize=7)
    for s in run.switches:
        at = run(s.t)
        ax.plot(at[a], at[b], _MARKS[s.kind], color="C3", markersize=5)
    ax.margins(0.12)
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    horizontal, vertical = numpy.linspace(left, right, grid), numpy.linspace(bottom, top, grid)
    for k in range(run.system.n_subsystems):
        values = []
        for v in vertical:
            row = []
            for h in horizontal:
                point = run.x_end.copy()
                point[[a, b]] = h, v
                row.append(run.system.surfaces(point, u, p, run.t_end, subsystem=k))
            values.append(row)
        for level in numpy.moveaxis(numpy.array(values), 2, 0):
            finite = level[numpy.isfinite(level)]
            if finite.size and finite.min() < 0.0 < finite.max():
                ax.contour(horizontal, vertical, level, levels=[0.0], colors="0.35", linestyles="--", linewidths=1.0)
    labels = _labels(names, "x", 2 if names is not None else run.nx)
    ax.set_xlabel(labels[0 if names is not None else a])
    ax.set_ylabel(labels[1 if names is not None else b])
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


def _modes(ax: Any, r: Trajectory) -> None:
    labels: list[str] = []
    for k, n in enumerate(r.n_modes):
        for i in range(n):
            active = r.active_modes(k)[:, i]
            spans = [(t, h) for t, h, on in zip(r.times, r.steps, active) if on]
            ax.broken_barh(spans, (len(labels) - 0.4, 0.8), facecolor=f"C{k % 10}", alpha=0.8)
            labels.append(f"{k}: {i}" if len(r.n_modes) > 1 else str(i))
    ax.set_yticks(range(len(labels)), labels, fontsize="x-small")
    ax.set_ylim(-0.6, len(labels) - 0.4)
    ax.set_ylabel("modes")


def _legend(ax: Any, count: int) -> None:
    if 1 < count <= 12:
        ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize="small", frameon=False)
