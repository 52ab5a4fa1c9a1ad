"""Arrays on their way in and out."""

from __future__ import annotations

import operator
from enum import IntEnum
from typing import Any, TypeVar

import numpy

from .errors import ArgumentError, DimensionError, NullError, RangeError

Array = numpy.ndarray
E = TypeVar("E", bound=IntEnum)


def seen(value: Any, name: str) -> Array:
    """What numpy makes of it, for a look at its shape: numbers of other types are not converted yet, views of a few
    numbers that pretend to be many are not written out."""
    if value is None:
        raise NullError(f"{name} must be numbers, not None")
    if isinstance(value, numpy.ma.MaskedArray) and numpy.ma.is_masked(value):
        raise RangeError(f"{name} has masked entries: fill them in")
    try:
        return numpy.asarray(value)
    except ValueError as error:
        raise DimensionError(f"{name} is no regular array: {error}") from None


def real(value: Any, name: str) -> Array:
    """An array of numbers as the library takes them. Where its shape is known, `vector` or `table` look at it first."""
    array = seen(value, name)
    if array.dtype.kind not in "fiub":
        try:
            if array.dtype.kind == "c" or any(numpy.iscomplexobj(v) for v in array.flat):
                raise TypeError
            array = array.astype(numpy.float64)
        except (TypeError, ValueError):
            raise RangeError(f"{name} must be real numbers, not {_short(value, array)}") from None
    return numpy.asarray(array, dtype=numpy.float64, order="C")


def _short(value: Any, array: Array) -> str:
    """A few words about a value; the text of a large one takes long to make."""
    if array.size > 100:
        return f"an array of shape {array.shape} and type {array.dtype}"
    return f"{value!r:.60}"


def vector(value: Any, n: int, name: str) -> Array:
    """`n` numbers; a number alone if `n` is 1."""
    array = seen(value, name)
    shape = array.shape or (1,)
    if shape not in ((n,), (n, 1), (1, n)):
        raise DimensionError(f"{name} has shape {shape}, expected ({n},)")
    return real(array, name).reshape(n)


def table(value: Any, rows: int | None, columns: int, name: str) -> Array:
    """`rows` times `columns` numbers; a flat array will do if there is one column."""
    array = seen(value, name)
    shape = (*array.shape, 1) if array.ndim == 1 and columns == 1 else array.shape
    if len(shape) != 2 or shape[1] != columns or (rows is not None and shape[0] != rows):
        wanted = f"({'any' if rows is None else rows}, {columns})"
        raise DimensionError(f"{name} has shape {shape}, expected {wanted}")
    return real(array, name).reshape(shape)


def one_or(value: Any, n: int, name: str) -> Array:
    """One number for all, or `n`."""
    array = seen(value, name)
    if array.size not in (1, n):
        raise DimensionError(f"{name} has shape {array.shape}, expected one number or ({n},)")
    return numpy.atleast_1d(real(array, name))


def bound(value: Any, n: int, default: float, name: str) -> Array:
    """`n` bounds; None is no bound, one number is for all."""
    if value is None:
        return numpy.full(n, default)
    if seen(value, name).ndim == 0:
        return numpy.full(n, float(real(value, name)))
    return vector(value, n, name)


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


def choice(kind: type[E], value: Any, name: str) -> E:
    """A value of an enumeration by itself, its name or its number."""
    if isinstance(value, str):
        try:
            return kind[value.upper()]
        except KeyError:
            known = ", ".join(v.name.lower() for v in kind)
            raise ArgumentError(f"{name} must be one of {known}, not '{value}'") from None
    try:
        return kind(index(value, name))
    except ValueError as error:
        raise ArgumentError(f"{name}: {error}") from None
