"""Mode sequences of optimal control problems, several starts, adapted grids."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, field
from typing import Any

import numpy

from ._arrays import Array, address, index, real, seen
from ._ffi import Outcome, Polished
from ._solver import Solver
from .errors import DimensionError, RangeError, StateError, SwitchbackError
from .function import Function
from .results import outcome_of, polished_of


@dataclass(frozen=True)
class ModeTransition:
    """A transition of a mode sequence: time from the start of the horizon, its number in the order the model has them, the control
    stage it is made in. `at_once`: its guard does not pass zero, it is beyond zero where its discrete state begins or where the control
    changes."""

    t: float
    transition: int
    stage: int
    at_once: bool = False


@dataclass(frozen=True, eq=False)
class Modes:
    """The active modes phase by phase: a row for each phase, which begin at `times` from the start of the horizon. Several
    modes of a subsystem are active while it slides. `cells` are the sign patterns the modes consist of; None where the
    modes say all. `transitions` are the transitions that are made, of models that have some, in the order of time."""

    times: Array
    modes: Any
    cells: Any = None
    transitions: tuple[ModeTransition, ...] = ()

    def __eq__(self, other: object) -> bool:
        """The same phases, times and transitions."""
        if not isinstance(other, Modes):
            return NotImplemented

        def same(a: Any, b: Any) -> bool:
            return a is b if a is None or b is None else numpy.array_equal(a, b)

        parts = ((self.times, other.times), (self.modes, other.modes), (self.cells, other.cells))
        return all(same(a, b) for a, b in parts) and tuple(self.transitions) == tuple(other.transitions)

    __hash__ = None  # type: ignore[assignment]

    def __str__(self) -> str:
        """Phases and transitions, a line for each."""
        lines: list[tuple[float, int, str]] = []
        rows = numpy.asarray(self.modes).reshape(len(self.times), -1)
        for t, row in zip(self.times, rows):
            text = "".join("1" if active else "0" for active in row)
            if text and (not lines or lines[-1][2] != f"modes {text}"):
                lines.append((float(t), 1, f"modes {text}"))
        for a in self.transitions:
            lines.append((a.t, 0, f"transition {a.transition} in stage {a.stage}" + (" at once" if a.at_once else "")))
        return "\n".join(f"{t:14.8g}  {text}" for t, _, text in sorted(lines, key=lambda e: e[:2])) or "no modes and no transitions"


@dataclass(frozen=True)
class Start:
    """Result of one start; `error` is why it could not be solved."""

    outcome: Outcome | None
    polished: Polished | None
    cost: float
    controls: Array | None = field(default=None, repr=False)
    error: SwitchbackError | None = None


@dataclass(frozen=True)
class Starts:
    """Results of several starts; the problem has the result of the one that is `best`."""

    best: int
    starts: list[Start]


@dataclass(frozen=True)
class Round:
    """One solve on the way to an adapted grid: elements of every stage, error as `accuracy.worst`."""

    elements: list[int]
    n_variables: int
    iterations: int
    error: float
    cost: float


@dataclass(frozen=True)
class Adaptation:
    """How a grid was adapted: the solves, which of them was kept, and whether its error is as small as asked for."""

    rounds: list[Round]
    kept: int
    reached: bool


class OcpSearch(Solver):
    """Methods of `Ocp` about mode sequences, several starts and adapted grids."""

    nu: int
    n_stages: int
    _functions: list[Function]

    @property
    def modes(self) -> Modes:
        """Mode sequence of the last solution: a phase for every finite element that has a length, and its transitions."""
        sizes = [ctypes.c_int64() for _ in range(3)]
        self._do("mode_sizes", *map(ctypes.byref, sizes))
        n, n_modes, n_cells = (s.value for s in sizes)
        times = numpy.empty(n)
        modes = numpy.empty((n, n_modes), dtype=numpy.int32)
        cells = numpy.empty((n, n_cells), dtype=numpy.int32)
        self._do("get_modes", address(times), n, address(modes), modes.size, address(cells), cells.size)
        return Modes(times, modes.astype(bool), cells.astype(bool), self._mode_transitions())

    def _mode_transitions(self) -> tuple[ModeTransition, ...]:
        count = ctypes.c_int64()
        self._do("jump_count", ctypes.byref(count))
        n = count.value
        if n == 0:
            return ()
        times, which, stages = numpy.empty(n), numpy.empty(n, dtype=numpy.int64), numpy.empty(n, dtype=numpy.int64)
        at_once = numpy.empty(n, dtype=numpy.int32)
        self._do("get_mode_transitions", address(times), address(which), address(stages), address(at_once), n)
        rows = zip(times.tolist(), which.tolist(), stages.tolist(), at_once.tolist())
        return tuple(ModeTransition(t, k, stage, bool(now)) for t, k, stage, now in rows)

    def set_modes(self, modes: Modes | None) -> None:
        """Give the order of modes: the next solves start with it, from the guesses of states and controls, and follow the
        homotopy only where it has no solution; None forgets it. Orders next to it are tried within the budget of the
        option mode_search only. Where simulations alone follow the system, as they do where it has transitions, only motions with this
        order of modes and transitions count; times and stages say nothing."""
        if modes is None:
            self._do("set_modes", None, 0, None, 0, None, 0)
            return
        times = numpy.atleast_1d(seen(modes.times, "times"))
        if times.ndim != 1 or times.size == 0:
            raise DimensionError("a mode sequence needs a start for every phase")
        for name, value in (("modes", modes.modes), ("cells", modes.cells)):
            if value is not None and seen(value, name).shape[:1] != times.shape:
                wanted = f"a row for each of {len(times)} phases"
                raise DimensionError(f"{name} has shape {seen(value, name).shape}, expected {wanted}")
        times = real(times, "times")

        def flags(value: Any, name: str) -> Any:
            array = numpy.ascontiguousarray(numpy.asarray(value), dtype=numpy.int32)
            if array.ndim != 2 or len(array) != len(times):
                raise DimensionError(f"{name} has shape {array.shape}, expected a row for each of {len(times)} phases")
            return array

        active = flags(modes.modes, "modes")
        cells = numpy.empty(0, dtype=numpy.int32) if modes.cells is None else flags(modes.cells, "cells")
        given = list(modes.transitions)
        n = len(given)
        at = real([a.t for a in given], "times of the transitions")
        which = numpy.array([index(a.transition, "transition") for a in given], dtype=numpy.int64)
        stages = numpy.array([index(a.stage, "stage") for a in given], dtype=numpy.int64)
        at_once = numpy.array([bool(a.at_once) for a in given], dtype=numpy.int32)
        self._do("set_modes", address(times), times.size, address(active), active.size, address(cells), cells.size)
        if n == 0:
            return
        try:
            self._do("set_mode_transitions", address(at), address(which), address(stages), address(at_once), n)
        except SwitchbackError:
            # half of a sequence says something else
            self.set_modes(None)
            raise

    def random_starts(self, n: int, seed: int = 0) -> Array:
        """Controls to start from, of the shape (n, n_stages, nu): the guess a solve starts from, then random ones within the
        bounds; the same for the same seed."""
        count, value = index(n, "n"), index(seed, "seed")
        if count < 1 or value < 0:
            raise RangeError("at least one start, and a seed that is not negative")
        u = numpy.empty((count, self.n_stages, self.nu))
        self._do("random_starts", value, address(u), u.size)
        return u

    def solve_starts(self, starts: Any, threads: int | None = None) -> Starts:
        """Solve from several guesses of the controls, (n, n_stages, nu), or from so many random ones; the problem keeps the
        best solution. `threads`: None and 0 for one on each processor; models with functions written in Python are solved on one.
        The results do not depend on it."""
        u = self.random_starts(starts) if numpy.ndim(starts) == 0 else seen(starts, "starts")
        if u.ndim != 3 or u.shape[1:] != (self.n_stages, self.nu):
            raise DimensionError(f"starts has shape {u.shape}, expected (n, {self.n_stages}, {self.nu})")
        flat = real(u, "starts").reshape(len(u), self.n_stages * self.nu)
        count = 0 if threads is None else index(threads, "threads")
        best = ctypes.c_int64()
        arguments = (address(flat), flat.size, count, ctypes.byref(best))
        self._do("solve_starts", *arguments, interruptible=True)
        return Starts(best.value, [self._start(k) for k in range(len(flat))])

    def _start(self, k: int) -> Start:
        outcome, polished, cost = ctypes.c_int32(), ctypes.c_int32(), ctypes.c_double()
        u = numpy.empty((self.n_stages, self.nu))
        numbers = map(ctypes.byref, (outcome, polished, cost))
        try:
            self._do("get_start", k, *numbers, address(u), u.size)
        except SwitchbackError as error:
            return Start(None, None, float("nan"), None, error)
        return Start(outcome_of(outcome.value), polished_of(polished.value), cost.value, u)

    def _adaptation(self) -> Adaptation | None:
        n, kept, reached = ctypes.c_int64(), ctypes.c_int64(), ctypes.c_int32()
        try:
            self._do("get_adaptation", *map(ctypes.byref, (n, kept, reached)))
        except StateError:
            return None
        return Adaptation([self._round(k) for k in range(n.value)], kept.value, bool(reached.value))

    def _round(self, k: int) -> Round:
        elements = numpy.empty(self.n_stages, dtype=numpy.int64)
        variables, iterations = ctypes.c_int64(), ctypes.c_int64()
        error, cost = ctypes.c_double(), ctypes.c_double()
        numbers = map(ctypes.byref, (variables, iterations, error, cost))
        self._do("get_round", k, address(elements), elements.size, *numbers)
        return Round(elements.tolist(), variables.value, iterations.value, error.value, cost.value)
