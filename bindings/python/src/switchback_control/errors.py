"""Exceptions: one class for each family of status codes."""

from __future__ import annotations

from ._ffi import Status

__all__ = [
    "ArgumentError",
    "DimensionError",
    "InternalError",
    "InterruptedSolve",
    "LibraryError",
    "NonfiniteError",
    "NullError",
    "NumericError",
    "OptionError",
    "RangeError",
    "StateError",
    "SwitchbackError",
    "Undefined",
    "UnsupportedError",
    "UserError",
]


class SwitchbackError(Exception):
    """A call could not do its work; `status` says why."""

    status: Status = Status.INTERNAL

    def __init__(self, message: str, status: Status | int | None = None):
        super().__init__(message)
        if status is not None:
            try:
                self.status = Status(status)
            except ValueError:
                self.status = status  # type: ignore[assignment]  # of a newer library


class ArgumentError(SwitchbackError, ValueError):
    """An argument does not fit."""

    status = Status.RANGE


class NullError(ArgumentError):
    """A required argument is missing."""

    status = Status.NULL


class DimensionError(ArgumentError):
    """A size or an index does not fit."""

    status = Status.DIMENSION


class RangeError(ArgumentError):
    """A value is outside its range."""

    status = Status.RANGE


class StateError(ArgumentError):
    """The call does not fit the state of the object."""

    status = Status.STATE


class UnsupportedError(ArgumentError):
    """The combination is not supported."""

    status = Status.UNSUPPORTED


class OptionError(ArgumentError):
    """Unknown option, or a value of the wrong type."""

    status = Status.OPTION


class UserError(SwitchbackError):
    """A user function returned the negative `code`."""

    status = Status.USER
    code: int = 0


class NonfiniteError(UserError):
    """A user function has no finite value where one is needed."""

    status = Status.NONFINITE


class InterruptedSolve(SwitchbackError):
    """Interrupted; the object can be used again."""

    status = Status.INTERRUPTED


class NumericError(SwitchbackError):
    """The numerical method cannot go on and there is no usable result."""

    status = Status.NUMERIC


class LibraryError(SwitchbackError):
    """A foreign library failed, or a resource is missing."""

    status = Status.LIBRARY


class InternalError(SwitchbackError):
    """A defect of the library; the object can only be closed."""

    status = Status.INTERNAL


class Undefined(Exception):
    """Raise it in a function of the model that is not defined at the point: the solver tries another one."""


_CLASSES: dict[int, type[SwitchbackError]] = {
    c.status: c
    for c in (
        NullError,
        DimensionError,
        RangeError,
        StateError,
        UnsupportedError,
        OptionError,
        UserError,
        NonfiniteError,
        InterruptedSolve,
        NumericError,
        LibraryError,
        InternalError,
    )
}


def from_status(status: int, message: str, user_code: int = 0) -> SwitchbackError:
    """The exception of a status code."""
    kind = _CLASSES.get(status)
    if kind is None:  # a number of a newer library: the family at least
        kind = ArgumentError if -20 < status < 0 else UserError if -30 < status < 0 else SwitchbackError
    error = kind(message, status)
    if isinstance(error, UserError):
        error.code = user_code
    return error
