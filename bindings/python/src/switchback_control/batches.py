"""Simulations from many starts at once."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, field
from typing import Any, Iterator, Mapping, Sequence

import numpy

from ._arrays import Array, address, index, table, vector
from ._call import Handle, aside
from ._ffi import RunOutcome
from ._foreign import translated
from ._library import lib
from ._names import named_vector, rows
from ._run_options import _chosen, _differentiated, _span
from .errors import ArgumentError, DimensionError
from .expr import Model, system_of
from .runs import Run
from .settings import Settings
from .system import System

__all__ = ["Batch", "simulate_batch"]


@dataclass(frozen=True)
class Batch(Sequence[Run]):
    """Results of a batch: `x` are the final states, [n, nx], NaN for runs that failed; `batch[i]` is a `Run`, or raises
    what the run failed with."""

    x: Array
    success: Array
    _owner: Any = field(repr=False)

    def __len__(self) -> int:
        return len(self.x)

    def __getitem__(self, i: Any) -> Any:
        k = index(i, "index")
        if not -len(self) <= k < len(self):
            raise IndexError(f"there is no run {k}, the batch has {len(self)}")
        return self._owner._run(k % len(self))

    def __iter__(self) -> Iterator[Run]:
        return (self[i] for i in range(len(self)))


class _Batch(Handle):
    _kind = "batch"

    def __init__(self, system: System, settings: Settings):
        self.system = system
        self._functions = list(system._functions)
        self._create(system, ctypes.byref(settings._c))

    def _interrupt(self) -> None:
        lib.swb_batch_interrupt(self._handle)

    def _run(self, i: int) -> Run:
        s = self.system
        return Run._take(self, (s.nx, s.np, s.nu), s, i)


def simulate_batch(
    system: System | Model,
    x0: Any,
    t_span: Any,
    *,
    u: Any = None,
    p: Any = None,
    threads: int = 0,
    rtol: float | None = None,
    atol: float | None = None,
    method: str | None = None,
    dense: bool = False,
    sensitivity: bool | str = False,
    settings: Settings | Mapping[str, Any] | None = None,
    **options: Any,
) -> Batch:
    """Simulate from every row of `x0`, [n, nx], on several threads (0: one for each processor).

    `u` and `p` are one row for all runs, or one for each. All three may be dictionaries from names to numbers, or to arrays with
    a number for each run. The results are those of single runs to the last bit,
    whatever the number of threads. Functions written in Python are called by one thread only.
    """
    s = system_of(system)
    options = translated(options)
    x0, u, p = (rows(value, names, what) for value, names, what in zip((x0, u, p), s._names, ("x0", "u", "p")))
    smooth = s.nx - len(s._discrete)
    if s._discrete and numpy.ndim(x0) == 2 and numpy.shape(x0)[1] == smooth:
        given = table(x0, None, smooth, "x0")
        starts = numpy.hstack([given, numpy.tile(s._discrete, (len(given), 1))])
    else:
        starts = table(x0, None, s.nx, "x0")
    if len(starts) == 0:
        raise DimensionError("x0 has no rows")

    def inputs(value: Any, width: int, name: str) -> Array:
        if value is None:
            if width:
                named_vector(None, s._names["xup".index(name)], width, name)
            return numpy.empty(0)
        one = numpy.ndim(value) < 2 and not (width == 1 and numpy.ndim(value) == 1 and numpy.size(value) == len(starts))
        return vector(value, width, name) if one else table(value, len(starts), width, name)

    controls, params = inputs(u, s.nu, "u"), inputs(p, s.np, "p")
    options |= {"dense": int(bool(dense)), "sensitivity": _differentiated(sensitivity)}
    chosen, each = _chosen(settings, {"rtol": rtol, "atol": atol, "method": method}, options)
    if each is not None:
        raise ArgumentError("a batch takes one rtol and one atol for all states")
    start, end = _span(t_span)
    batch = _Batch(s, chosen)
    given = (address(starts), starts.size, address(controls), controls.size, address(params), params.size)
    n_threads = index(threads, "threads")
    if any(f._in_python for f in s._functions):
        batch._do("run", start, end, *given, n_threads, interruptible=True)
    else:
        aside(lambda: batch._do("run", start, end, *given, n_threads), batch._interrupt)
    x, outcomes = numpy.empty(starts.shape), numpy.empty(len(starts), dtype=numpy.int32)
    batch._do("states", address(x), x.size)
    batch._do("outcomes", address(outcomes), outcomes.size)
    return Batch(x, (outcomes == RunOutcome.REACHED) | (outcomes == RunOutcome.EVENT), batch)
