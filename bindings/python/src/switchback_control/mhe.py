"""Moving horizon estimation: states and constant parameters from the measurements of the last samples."""

from __future__ import annotations

import ctypes
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy

from . import _ffi
from ._arrays import Array, address, choice, index, number, real, vector
from ._call import Handle, check
from ._ffi import CReal, NmpcQpStatus, NmpcSource, RkFamily
from ._library import lib
from .errors import ArgumentError
from .function import Function
from .ocp import Ocp

__all__ = ["Estimate", "Mhe"]


@dataclass(frozen=True)
class Estimate:
    """Result of an estimate: where it comes from, and how its last quadratic program ended.

    source      QP, SOFT_QP where bounds cannot all be met, TANGENT where the deadline came first, PLAN where the state is a prediction,
                since functions have no value
    status      how the quadratic program ended
    iterations  iterations of Gauss and Newton
    time        seconds
    """

    source: NmpcSource
    status: NmpcQpStatus
    iterations: int
    time: float


class Mhe(Handle):
    """An estimator for the states of a system: `prepare` with the control of a sample, then `estimate` with its measurements.

    ocp          the system, its bounds of states, and an initial state, which is the mean before the first measurement. Its stages are the
                 samples of the window. It has no costs
    measured     what is measured, as expressions of the model or a function of it [ny]; controls in it are those of the stage before
    initial      standard deviations of the state before the first measurement [nx], positive
    process      standard deviations of what is added to the states in every stage [nx]; 0 for none
    measurement  standard deviations of the measurements [ny], positive
    iterations   iterations of Gauss and Newton per sample at most
    tol          they end where a step is below this share of the initial deviations
    deadline     seconds an estimate may take
    rk_family, n_s, steps   the Runge-Kutta method and its steps in every stage; by default as the settings of the problem say

    A single number stands for all. A constant parameter is estimated as a state whose derivative is zero: it has no process noise where it is constant, and some where it
    wanders. Samples that leave the window stay in the arrival cost, a mean with a covariance; for linear systems without bounds the
    estimate is that of the Kalman filter. Systems that switch are simulated by events.
    """

    _kind = "mhe"

    def __init__(
        self,
        ocp: Ocp,
        measured: Any,
        *,
        initial: Any,
        process: Any,
        measurement: Any,
        iterations: int = 1,
        tol: float = 1e-8,
        deadline: float = numpy.inf,
        rk_family: str | RkFamily | None = None,
        n_s: int = 0,
        steps: int = 0,
    ):
        if not isinstance(ocp, Ocp):
            raise ArgumentError(f"an estimator takes an Ocp, not {type(ocp).__name__}")
        options = _ffi.swb_mhe_options()
        check(lib.swb_mhe_options_init(ctypes.byref(options), ctypes.sizeof(options)))
        options.iterations, options.tol, options.deadline = index(iterations, "iterations"), number(tol, "tol"), number(deadline, "deadline")
        options.rk_family = -1 if rk_family is None else int(choice(RkFamily, rk_family, "rk_family"))
        options.n_s, options.steps = index(n_s, "n_s"), index(steps, "steps")
        f = ocp._expressions(measured, "measured")
        given = numpy.atleast_1d(real(measurement, "measurement"))
        ny = f.n_out if isinstance(f, Function) else given.size
        function = ocp._function(f, ny, "measured")

        def all_of(values: Any, n: int, name: str) -> Array:
            return numpy.full(n, float(values)) if numpy.ndim(values) == 0 else vector(values, n, name)

        sigma = [all_of(initial, ocp.nx, "initial"), all_of(process, ocp.nx, "process"), all_of(measurement, ny, "measurement")]
        pairs = [a for s in sigma for a in (address(s), s.size)]
        self._create(ocp, function, *pairs, ctypes.byref(options))
        self._functions = [*ocp._functions, function]
        self.np = ocp.np
        sizes = [ctypes.c_int64() for _ in range(5)]
        self._do("sizes", *(ctypes.byref(s) for s in sizes))
        self.n, self.nx, self.nu, self.ny, self.nw = (s.value for s in sizes)
        self._info = _ffi.swb_nmpc_info()
        self._x = numpy.empty(self.nx)

    def prepare(self, u: Any = ()) -> bool:
        """Go to the next sample under the control `u` [nu], and do everything for it that needs no measurement. False where functions
        have no value at the estimate: the next one is a prediction."""
        given, i = vector(u, self.nu, "u"), self._info
        self._do("prepare", address(given), given.size, ctypes.byref(i), ctypes.sizeof(i))
        return bool(i.ready)

    def estimate(self, y: Any) -> tuple[Array, Estimate]:
        """The state [nx] at the sample of the last `prepare`, or at the start, from its measurements [ny]; NaN for what was not
        measured."""
        given, i, x = numpy.ascontiguousarray(numpy.atleast_1d(numpy.asarray(y, dtype=float))), self._info, self._x
        self._do("estimate", address(given), given.size, address(x), x.size, ctypes.byref(i), ctypes.sizeof(i))
        return x.copy(), Estimate(NmpcSource(i.source), NmpcQpStatus(i.qp_status), i.inner, i.time)

    def set_params(self, p: Any) -> None:
        """Set the parameters [np] from the next `prepare` on; samples that were keep theirs."""
        given = vector(p, self.np, "p")
        self._do("set_params", address(given), given.size)

    def reset(self, x0: Any) -> None:
        """Back to the start with the mean `x0` [nx]: nothing was measured."""
        given = vector(x0, self.nx, "x0")
        self._do("reset", address(given), given.size)

    def write_c(self, folder: str | os.PathLike, prefix: str = "estimator", precision: str | CReal = "double") -> list[Path]:
        """Write the estimator as C files (C99) without heap, threads or a clock, and return their paths: `prefix.h`, `prefix.c`,
        `prefix_main.c`, `prefix_record.h` and `Makefile`.

        folder     is made if it is not there
        prefix     what names begin with
        precision  "double" or "float"

        The estimator in C begins with the initial state and the present parameters. `make test` in the folder repeats estimates that are recorded
        here, from simulated measurements of which some are missing; this estimator is afterwards as after `reset`. It takes models that do not
        switch, expressions, explicit methods, and no deadline.
        """
        folder = Path(folder)
        kind = int(choice(CReal, precision, "precision"))
        self._do("write_c", os.fsencode(folder), str(prefix).encode(), kind)
        return [folder / name for name in (f"{prefix}.h", f"{prefix}.c", f"{prefix}_main.c", f"{prefix}_record.h", "Makefile")]

    def _window(self) -> tuple[Array, Array, int]:
        x, w, filled = numpy.empty((self.n + 1, self.nx)), numpy.empty((self.n, self.nw)), ctypes.c_int64()
        self._do("get_window", address(x), x.size, address(w) if w.size else None, w.size, ctypes.byref(filled))
        return x, w, filled.value

    @property
    def states(self) -> Array:
        """States of the samples of the window [samples, nx], the last one at the end; as many as there were until it is full."""
        x, _, filled = self._window()
        return x[self.n - filled :]

    @property
    def noise(self) -> Array:
        """Process noise of the stages between them [samples - 1, nw], of the states that have any."""
        _, w, filled = self._window()
        return w[self.n - filled :]

    @property
    def covariance(self) -> Array:
        """The covariance of the last state [nx, nx] by the linearisation of the last program, without regard of bounds."""
        p = numpy.empty((self.nx, self.nx))
        self._do("get_covariance", address(p), p.size)
        return p

    def interrupt(self) -> None:
        """End the call that runs now, or the next one; from any thread."""
        self._do("interrupt")
