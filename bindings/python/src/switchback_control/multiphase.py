"""Optimal control in phases: each with its own system, horizon, costs and constraints, linked at their ends."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, field
from typing import Any, Sequence

from ._arrays import address, bounds, index
from ._call import Handle, text
from ._ffi import Outcome, Polished, swb_multiphase_info
from ._library import lib
from ._solver import iteration_callback
from .errors import ArgumentError, StateError
from .function import Function
from .ocp import Ocp, OcpResult
from .results import HasOutcome, OnIteration, outcome_of, polished_of

__all__ = ["MultiPhase", "MultiPhaseResult"]


@dataclass(frozen=True)
class MultiPhaseResult(HasOutcome):
    """Result of a solve of several phases; outcome, residuals and statistics of the phases are those of all."""

    outcome: Outcome
    polished: Polished
    #: Sum of the costs of the phases; NaN unless the problem is solved.
    cost: float
    phases: Sequence[OcpResult] = field(repr=False)
    #: Largest violation of a link.
    link_violation: float
    #: Largest difference of a state at the end of a phase from the simulation of its controls; NaN without one.
    error: float
    iterations: int
    time_total: float
    #: Why there is no exact solution; empty where there is one.
    message: str = ""


class MultiPhase(Handle):
    """Phases, one after the other: problems as they are stated when this is made. The initial state of a phase is free unless
    its problem bounds it; links tie it to the end of the phase before. A function of time sees the time from the start of
    the first phase on."""

    _kind = "multiphase"

    def __init__(self, phases: Sequence[Ocp], on_iteration: OnIteration | None = None):
        self._phases = list(phases)
        for p in self._phases:
            if not isinstance(p, Ocp):
                raise ArgumentError(f"phases must be problems (Ocp), not {type(p).__name__}")
            p._hold()
        try:
            handles = (ctypes.c_void_p * len(self._phases))(*(p._handle for p in self._phases))
            self._create(handles, len(self._phases), None)
        finally:
            for p in self._phases:
                p._release()
        self._functions: list[Function] = [f for p in self._phases for f in p._functions]
        self._iteration = iteration_callback(on_iteration)
        self._do("set_iteration", self._iteration, None)
        self._result: MultiPhaseResult | None = None

    def link(self, phase: int, f: Any, lower: Any = 0.0, upper: Any = 0.0, n: int = 1) -> None:
        """Require lower <= f(x) <= upper between a phase, counted from 0, and the next one: x holds the states at the end of
        the phase, then those at the start of the next. `n` is the number of outputs of a callable where the bounds do
        not tell it."""
        k = index(phase, "phase")
        if not 0 <= k < len(self._phases) - 1:
            raise ArgumentError(f"phase must be one of 0 to {len(self._phases) - 2}, not {k}")
        sizes = [len(b) for b in (lower, upper) if hasattr(b, "__len__")]
        n = f.n_out if isinstance(f, Function) else sizes[0] if sizes else index(n, "n")
        function = Function._of(f, (self._phases[k].nx + self._phases[k + 1].nx, 0, 0), n, "link")
        low, high = bounds(lower, upper, n, "bounds of a link")
        self._do("link", k, function, address(low), n, address(high), n)
        self._functions.append(function)

    def link_reset(self, phase: int, f: Any) -> None:
        """The next phase begins at f(x), a function of the states at the end of this phase, counted from 0, with a value for each state
        of the next: what a stage that drops off, a docking or a planned impact does to the states."""
        k = index(phase, "phase")
        if not 0 <= k < len(self._phases) - 1:
            raise ArgumentError(f"phase must be one of 0 to {len(self._phases) - 2}, not {k}")
        function = Function._of(f, (self._phases[k].nx, 0, 0), self._phases[k + 1].nx, "reset")
        self._do("link_reset", k, function)
        self._functions.append(function)

    def link_continuous(self, phase: int) -> None:
        """The next phase begins where this one, counted from 0, ends, in all states."""
        self._do("link_continuous", index(phase, "phase"))

    def solve(self) -> MultiPhaseResult:
        """Solve. Look at `result.success`: the outcome may be another one than solved."""
        outcome = ctypes.c_int32()
        self._do("solve", ctypes.byref(outcome), interruptible=True)
        info = self._struct("get_info", swb_multiphase_info)
        self._result = MultiPhaseResult(
            outcome_of(info.outcome),
            polished_of(info.polished),
            info.cost,
            [self._phase(k).result for k in range(len(self._phases))],
            info.link_violation,
            info.error,
            info.iterations,
            info.time_total,
            text(lib.swb_multiphase_get_message, self),
        )
        return self._result

    def _phase(self, k: int) -> Ocp:
        """A copy of a phase with its part of the solution."""
        given = self._phases[k]
        ocp = Ocp.__new__(Ocp)
        ocp._make(lib.swb_multiphase_get_phase, self, k)
        ocp.nx, ocp.nu, ocp.np, ocp.n_stages = given.nx, given.nu, given.np, given.n_stages
        ocp.horizon, ocp._functions = given.horizon, given._functions
        ocp.initial_time = 0.0
        ocp.initial_time = float(ocp.result.trajectory.t_start)
        return ocp

    @property
    def result(self) -> MultiPhaseResult:
        """Result of the last solve."""
        if self._result is None:
            raise StateError("there is no result: call solve first")
        return self._result

    def interrupt(self) -> None:
        """Stop the call that runs now, or the next one; from any thread and from signal handlers."""
        self._hold()
        try:
            lib.swb_multiphase_interrupt(self._handle)
        finally:
            self._release()

    def __repr__(self) -> str:
        return f"<MultiPhase of {len(self._phases)} phases>"
