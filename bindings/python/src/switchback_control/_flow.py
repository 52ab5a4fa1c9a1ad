"""Simulations as functions that can be differentiated backwards: what JAX and PyTorch have in common."""

from __future__ import annotations

import os
import threading
from collections import OrderedDict
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy

from ._arrays import Array, real
from ._run_options import _span
from ._ffi import RunOutcome
from .batches import simulate_batch
from .errors import ArgumentError, NumericError, RangeError
from .expr import system_of
from .integrator import Integrator
from .runs import Gradient

__all__ = ["Flow"]

_KEPT = 8  # simulations whose adjoint may be asked for


class Flow:
    """States of a system at times, or where an event ends it, as a function of initial state, parameters and controls, with its adjoint.

    `at` are the times, rising, within the time span; None is its end alone. Initial state, parameters and controls are flat
    arrays, the latter constant. The last simulations are kept for their adjoints; another one is made again for it."""

    def __init__(self, system: Any, t_span: Any, at: Sequence[float] | None, options: dict[str, Any]):
        self.system = system_of(system)
        self.start, self.end = _span(t_span)
        self.times = [self.end] if at is None else real(at, "at").ravel().tolist()
        self.single = at is None
        if self.times != sorted(set(self.times)) or not self.times or self.times[0] < self.start or self.times[-1] > self.end:
            raise RangeError("at must be rising times within t_span")
        self._options = {**options, "adjoint": 1}
        self._kept: OrderedDict[bytes, Integrator] = OrderedDict()
        self._free: list[Integrator] = []
        self._lock = threading.Lock()

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the result: [nx], or [times, nx] where times were given."""
        return (self.system.nx,) if self.single else (len(self.times), self.system.nx)

    def _simulated(self, inputs: Sequence[Array]) -> tuple[Integrator, Array]:
        x0, p, u = inputs
        with self._lock:
            i = self._free.pop() if self._free else None
        i = i or Integrator(self.system, **self._options)
        if i.np:
            i.set_params(p)
        if i.nu:
            i.set_controls(u)
        i.reinit(x0, self.start)
        states = numpy.empty((len(self.times), i.nx))
        for k, t in enumerate(self.times):
            if t > self.start:
                i.advance(t)
                # a run that an event ends has its state there, whose derivatives have the time of the end in them
                if i.time != t and not (self.single and i.outcome == RunOutcome.EVENT):
                    raise NumericError(f"the simulation ended at t = {i.time:g}, before {t:g}: {i.reason}")
            states[k] = i.state
        return i, states

    def __call__(self, *inputs: Any) -> Array:
        """States for initial state, parameters and controls."""
        arrays = [numpy.array(a, dtype=float).ravel() for a in inputs]
        i, states = self._simulated(arrays)
        with self._lock:
            self._kept[_key(arrays)] = i
            while len(self._kept) > _KEPT:
                self._release(self._kept.popitem(last=False)[1])
        return states.reshape(self.shape)

    def _release(self, i: Integrator) -> None:
        """What is not asked any more may be used again; with the lock."""
        if len(self._free) < _KEPT:
            self._free.append(i)

    def several(self, *inputs: Any) -> Array:
        """States at the end for many inputs, whose first dimension they share: on several threads."""
        x0, p, u = (numpy.array(a, dtype=float) for a in inputs)
        alone = any(k in self._options for k in ("preferred", "on_step", "on_branching", "on_log"))
        alone |= any(numpy.ndim(self._options.get(k)) for k in ("rtol", "atol"))  # a batch takes one for all states
        if not self.single or len(x0) == 0 or alone:
            each = [self(*one) for one in zip(x0, p, u)]
            return numpy.array(each, dtype=float).reshape((len(x0), *self.shape))
        options = {k: v for k, v in self._options.items() if k != "adjoint"}
        given = {"u": u.reshape(len(x0), -1), "p": p.reshape(len(x0), -1)}
        rows = {name: a for name, a in given.items() if a.shape[1]}
        batch = simulate_batch(self.system, x0.reshape(len(x0), -1), (self.start, self.end), **rows, **options)
        if not batch.success.all():
            first = int(numpy.flatnonzero(~batch.success)[0])
            run = batch[first]
            raise NumericError(f"simulation {first} ended at t = {run.t_end:g}, before {self.end:g}: {run.reason}")
        return batch.x

    def gradient(self, weights: Any, *inputs: Any) -> Gradient:
        """Gradient of the sum of the states times `weights`, an array of their shape."""
        arrays = [numpy.array(a, dtype=float).ravel() for a in inputs]
        with self._lock:
            i = self._kept.pop(_key(arrays), None)
        if i is None:
            i, _ = self._simulated(arrays)
        w = numpy.array(weights, dtype=float).reshape(len(self.times), -1)
        pairs = [(t, row) for t, row in zip(self.times, w) if self.start < t < self.times[-1]]
        if self.times[-1] == self.start:
            found = Gradient(w[-1].copy(), numpy.zeros(i.np), numpy.zeros(i.nu))
        else:
            found = i.adjoint(w[-1], at=pairs)
        with self._lock:
            self._release(i)
        if self.single or self.times[-1] == self.start:
            return found
        return found._replace(x0=found.x0 + w[0]) if self.times[0] == self.start else found

    def curvature(self, weights: Any, direction: Sequence[Any], *inputs: Any) -> tuple[Gradient, Array]:
        """Derivative of the gradient of the sum of the states at the end times `weights`, in a direction of the inputs; and that of the states."""
        if not self.single:
            raise ArgumentError("second derivatives are those of the state at the end: leave out at")
        arrays = [numpy.array(a, dtype=float).ravel() for a in inputs]
        x0, p, u = (numpy.array(d, dtype=float).ravel() for d in direction)
        i, _ = self._simulated(arrays)
        found = i.hvp(numpy.array(weights, dtype=float).ravel(), x0=x0, p=p, u=u)
        with self._lock:
            self._release(i)
        return found

    def gradients(self, weights: Any, *inputs: Any) -> Gradient:
        """Gradients for many inputs and weights, whose first dimension they share: on several threads, where no function of the model is written in
        Python."""
        rows = list(zip(weights, *inputs))
        threads = 1 if self._in_python() else min(os.cpu_count() or 1, len(rows))
        if threads < 2:
            found = [self.gradient(*row) for row in rows]
        else:
            with ThreadPoolExecutor(threads) as pool:
                found = list(pool.map(lambda row: self.gradient(*row), rows))
        return Gradient(*(numpy.array(part) for part in zip(*found)))

    def _in_python(self) -> bool:
        given = ("preferred", "on_step", "on_branching", "on_log")
        return any(k in self._options for k in given) or any(f._in_python for f in self.system._functions)


def _key(arrays: Sequence[Array]) -> bytes:
    return b"".join(a.tobytes() for a in arrays)
