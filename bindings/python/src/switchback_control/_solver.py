"""What simulator, optimal control problem and program have in common: options, monitors, solving."""

from __future__ import annotations

import ctypes
from typing import Any

from . import _ffi
from ._call import Handle, frame
from ._library import lib
from .errors import ArgumentError
from .results import Iteration, OnIteration, OnLog, Residuals, Stats, outcome_of
from .settings import HasSettings

_LEVELS = {int(v): v.name.lower() for v in _ffi.LogLevel}


def iteration_callback(f: OnIteration | None) -> Any:
    """Asks every iteration whether to go on: after Ctrl-C, or by the wish of the user. It is there in any case,
    because Python looks for signals only where it runs."""

    def iteration(info: int, _: Any) -> int:
        current = frame()
        try:
            if current.stop or current.error is not None:
                return 1
            if f is None:
                return 0
            return 1 if f(Iteration._of(_ffi.swb_iteration_info.from_address(info))) else 0
        except BaseException as error:
            if current.error is None:
                current.error = error
            return 1

    return _ffi.swb_iteration_fn(iteration)


def _log_callback(f: OnLog | None) -> Any:
    if f is None:
        return _ffi.swb_log_fn(0)

    def log(level: int, line: bytes, _: Any) -> None:
        current = frame()
        try:
            if current.error is None:
                f(_LEVELS.get(level, str(level)), line.decode("utf-8", "replace"))
        except BaseException as error:
            if current.error is None:
                current.error = error

    return _ffi.swb_log_fn(log)


class Solver(Handle, HasSettings):
    """Options, monitors and interrupts of an object that solves."""

    def _monitors(self, on_iteration: OnIteration | None, on_log: OnLog | None) -> None:
        self.on_iteration(on_iteration)
        self.on_log(on_log)

    def on_iteration(self, f: OnIteration | None) -> None:
        """Set who is called with an `Iteration` once per iteration; a true answer stops the solve."""
        if f is not None and not callable(f):
            raise ArgumentError(f"on_iteration must be a function, not {type(f).__name__}")
        callback = iteration_callback(f)
        self._do("set_iteration", callback, None)
        self._iteration = callback

    def on_log(self, f: OnLog | None) -> None:
        """Set who is called with (level, line) of the log; how much comes is the option log_level."""
        if f is not None and not callable(f):
            raise ArgumentError(f"on_log must be a function, not {type(f).__name__}")
        callback = _log_callback(f)
        self._do("set_log", callback, None)
        self._log = callback

    def interrupt(self) -> None:
        """Stop the call that runs now, or the next one; from any thread and from signal handlers."""
        self._hold()
        try:
            getattr(lib, f"swb_{self._kind}_interrupt")(self._handle)
        finally:
            self._release()

    def _solve(self, name: str, *arguments: Any) -> Any:
        outcome = ctypes.c_int32()
        self._do(name, *arguments, ctypes.byref(outcome), interruptible=True)
        return outcome_of(outcome.value)

    @property
    def outcome(self) -> Any:
        """How the last solve ended."""
        return outcome_of(self._get("get_outcome", ctypes.c_int32))

    @property
    def residuals(self) -> Residuals:
        """Residuals of the last solve."""
        return Residuals._of(self._struct("get_residuals", _ffi.swb_residuals))

    @property
    def stats(self) -> Stats:
        """Work and time of the last solve."""
        return Stats._of(self._struct("get_stats", _ffi.swb_stats))
