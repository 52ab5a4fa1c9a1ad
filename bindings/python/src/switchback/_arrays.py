"""Arrays on their way in and out."""

from __future__ import annotations

import operator
from typing import Any

import numpy

from .errors import DimensionError, NullError, RangeError

Array = numpy.ndarray


def real(value: Any, name: str) -> Array:
    """An array of numbers as the library takes them."""
    if value is None:
        raise NullError(f"{name} must be numbers, not None")
    try:
        array = numpy.asarray(value)
    except ValueError as error:
        raise DimensionError(f"{name} is no regular array: {error}") from None
    if array.dtype.kind not in "fiub":
        try:
            if array.dtype.kind == "c":
                raise TypeError
            array = array.astype(numpy.float64)
        except (TypeError, ValueError):
            raise RangeError(f"{name} must be real numbers, not {value!r:.60}") from None
    return numpy.asarray(array, dtype=numpy.float64, order="C")


def vector(value: Any, n: int, name: str) -> Array:
    """`n` numbers; a number alone if `n` is 1."""
    array = numpy.atleast_1d(real(value, name))
    if array.shape == (n, 1) or array.shape == (1, n):
        array = array.reshape(n)
    if array.shape != (n,):
        raise DimensionError(f"{name} has shape {array.shape}, expected ({n},)")
    return array


def table(value: Any, rows: int | None, columns: int, name: str) -> Array:
    """`rows` times `columns` numbers; a flat array will do if there is one column."""
    array = real(value, name)
    if array.ndim == 1 and columns == 1:
        array = array.reshape(-1, 1)
    if array.ndim != 2 or array.shape[1] != columns or (rows is not None and array.shape[0] != rows):
        wanted = f"({'any' if rows is None else rows}, {columns})"
        raise DimensionError(f"{name} has shape {array.shape}, expected {wanted}")
    return array


def bound(value: Any, n: int, default: float, name: str) -> Array:
    """`n` bounds; None is no bound, one number is for all."""
    if value is None:
        return numpy.full(n, default)
    array = real(value, name)
    if array.ndim == 0:
        return numpy.full(n, float(array))
    return vector(array, n, name)


def bounds(lower: Any, upper: Any, n: int, name: str) -> tuple[Array, Array]:
    return bound(lower, n, -numpy.inf, f"lower {name}"), bound(upper, n, numpy.inf, f"upper {name}")


def index(value: Any, name: str) -> int:
    """An integer that fits into 64 bits."""
    try:
        number = operator.index(value)
    except TypeError:
        raise RangeError(f"{name} must be an integer, not {value!r:.60}") from None
    if not -(2**63) <= number < 2**63:
        raise RangeError(f"{name} is too large: {number}")
    return number


def number(value: Any, name: str) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        raise RangeError(f"{name} must be a number, not {value!r:.60}") from None


def address(array: Array) -> int | None:
    """Where the numbers are; None if there are none."""
    return array.ctypes.data if array.size else None
