"""Names of states, controls and parameters: vectors given by name, variables as attributes, what was meant by a typo."""

from __future__ import annotations

import difflib
import warnings
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy

from ._arrays import Array, index, vector
from .errors import ArgumentError, DimensionError, NullError

__all__ = ["NameWarning", "Named", "filled", "named_vector", "nearest", "pairs_by_name", "rows", "split"]

_ATTRIBUTES = {
    "x": "all states",
    "u": "all controls",
    "p": "all parameters",
    "t": "the time",
    "q": "all coordinates",
    "v": "all velocities",
}
_BLOCKS = {"x": "state", "u": "control", "p": "parameter"}


def split(given: int | str | Sequence[str], what: str) -> list[str]:
    """Names from "q v", a list, or a number of variables without names."""
    if isinstance(given, str):
        return given.replace(",", " ").split()
    if isinstance(given, (list, tuple)):
        return [str(name) for name in given]
    n = index(given, what)
    if n < 0:
        raise DimensionError(f"{what} is negative: {n}")
    return [""] * n


def nearest(name: Any, known: Iterable[str]) -> str:
    """The end of a message about an unknown name: what may have been meant, or what there is."""
    names = [n for n in known if n]
    close = difflib.get_close_matches(str(name), names, 1, 0.5)
    if close:
        return f": did you mean '{close[0]}'?"
    return f", only {', '.join(names)}" if names else "; the model has no names for them"


def filled(value: Any, names: Sequence[str], what: str, missing: Any = None) -> Any:
    """A dictionary from names to numbers as an array in the order of the names; any other value as it is. `missing` are the
    numbers of what is not named, NaN where it must be."""
    if not isinstance(value, Mapping):
        return value
    if not any(names):
        raise ArgumentError(f"{what} is a dictionary, but the model has no names for these numbers: give an array")
    for key in value:
        if not key or key not in names:
            raise ArgumentError(f"{what} has no '{key}'{nearest(key, names)}")
    out = numpy.full(len(names), numpy.nan) if missing is None else numpy.array(missing, dtype=float)
    forgotten = [n or f"number {i}" for i, n in enumerate(names) if n not in value and numpy.isnan(out[i])]
    if forgotten:
        raise ArgumentError(f"{what} says nothing of {', '.join(forgotten)}")
    for i, n in enumerate(names):
        if n in value:
            entry = numpy.asarray(value[n])
            if entry.size != 1 or entry.dtype.kind not in "fiub":
                raise ArgumentError(f"{what}: the value of '{n}' must be a number, not {value[n]!r:.60}")
            out[i] = entry.item()
    return out


def rows(value: Any, names: Sequence[str], what: str) -> Any:
    """A dictionary from names to numbers as one row, one from names to arrays of one length as a table with a row for each of
    their places; any other value as it is."""
    if not isinstance(value, Mapping) or all(numpy.ndim(v) == 0 for v in value.values()):
        return filled(value, names, what)
    try:
        columns = numpy.broadcast_arrays(*(numpy.atleast_1d(v) for v in value.values()))
    except ValueError:
        raise DimensionError(f"{what}: the arrays have different lengths") from None
    if not columns or columns[0].ndim != 1:
        raise DimensionError(f"{what}: give a number or a flat array for each name")
    return numpy.array([filled(dict(zip(value, row)), names, what) for row in zip(*columns)])


def named_vector(value: Any, names: Sequence[str], n: int, block: str, missing: Any = None) -> Array:
    """`n` numbers of a block, "x", "u" or "p", given as an array or by names."""
    if value is None and n:
        known = f" ({', '.join(names)})" if any(names) else ""
        plural = "s" if n > 1 else ""
        raise NullError(f"{block} is missing: the model has {n} {_BLOCKS.get(block[0], 'value')}{plural}{known}, give {block}=[...]")
    if callable(value):
        raise ArgumentError(
            f"{block} is a function: give numbers; what varies in time is part of the model, written with its time t, or is a table of u"
        )
    return vector(filled(value, names, block, missing), n, block)


def pairs_by_name(lower: Any, upper: Any) -> tuple[Any, Any]:
    """Bounds given as one dictionary from names to (lower, upper) as two; others as they are."""
    if upper is not None or not isinstance(lower, Mapping) or not any(isinstance(v, (tuple, list)) for v in lower.values()):
        return lower, upper
    for name, pair in lower.items():
        if not isinstance(pair, (tuple, list)) or len(pair) != 2:
            raise ArgumentError(f"bounds of '{name}' must be (lower, upper), as those of the others, not {pair!r:.60}")
    return tuple({n: (free if v[k] is None else v[k]) for n, v in lower.items()} for k, free in ((0, -numpy.inf), (1, numpy.inf)))


class NameWarning(UserWarning):
    """The name of a variable means something else where it is written as an attribute."""


class Named:
    """Variables by their names: `model.q` and `model["q"]` for what was declared as "q"; attributes that do not exist cannot be
    set."""

    names: list[list[str]]

    def _refuse_twice(self) -> None:
        """Raises ArgumentError where two variables have one name."""
        given = [name for names in self.names for name in names if name]
        for name in given:
            if given.count(name) > 1:
                raise ArgumentError(f"two variables are called '{name}': states, controls and parameters need different names")

    def _warn_hidden(self, besides: Sequence[str] = ()) -> None:
        """Warn of variables that are no attributes because something else has the name: `model.t` is the time, also where
        a state is called t. A block that holds nothing but the variable of its name hides nothing."""
        found = self._variables()
        kind = type(self).__name__
        for name, variable in found.items():
            other = self.__dict__.get(name, getattr(type(self), name, None))
            if name in besides or other is None or numpy.array_equal(getattr(other, "_ids", ()), [variable._ids]):
                continue
            what = _ATTRIBUTES.get(name, f"something else of the {kind}")
            warnings.warn(
                f"'{name}' is the name of a variable, but .{name} is {what}: write model['{name}'] for the variable, or call it "
                "otherwise",
                NameWarning,
                stacklevel=3,
            )

    def _variables(self) -> dict[str, Any]:
        """Expressions of all variables that have names."""
        blocks = getattr(self, "_blocks")()
        return {name: block[i] for names, block in zip(self.names, blocks) for i, name in enumerate(names) if name}

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or "names" not in self.__dict__ or "t" not in self.__dict__:
            raise AttributeError(name)
        found = self._variables()
        if name not in found:
            public = [n for n in dir(type(self)) if not n.startswith("_")]
            raise AttributeError(f"{type(self).__name__} has no '{name}'{_meant(name, [*found, *public])}", name=name, obj=None)
        return found[name]

    def __getitem__(self, name: str) -> Any:
        found = self._variables()
        if name not in found:
            raise KeyError(f"there is no variable '{name}'{nearest(name, found)}")
        return found[name]

    __iter__ = None  # variables have names, not numbers

    def __contains__(self, name: object) -> bool:
        return name in self._variables()

    def __setattr__(self, name: str, value: Any) -> None:
        if self.__dict__.get("_complete") and not name.startswith("_") and name not in self.__dict__:
            declared = any(name in c.__dict__.get("__annotations__", {}) for c in type(self).__mro__)
            if not declared and not hasattr(type(self), name):
                raise AttributeError(_refusal(self, name))
        object.__setattr__(self, name, value)


def _meant(name: str, known: Iterable[str]) -> str:
    close = difflib.get_close_matches(name, list(known), 1, 0.6)
    return f": did you mean '{close[0]}'?" if close else ""


_DERIVATIVES = {"rhs", "f", "ode", "dx", "xdot", "dxdt", "dynamics", "equations", "derivs"}


def _refusal(model: Any, name: str) -> str:
    """Why an attribute cannot be set."""
    kind = type(model).__name__
    states = model.names[0]
    if name in model._variables():
        if name in states and hasattr(type(model), "derivatives"):
            return f"'{name}' is a state: set its derivative by model.derivative(model.{name}, ...), or all of them by model.derivatives"
        return f"'{name}' is a variable and cannot be set"
    if name in _DERIVATIVES and hasattr(type(model), "derivatives"):
        return f"{kind} has no '{name}': set model.derivatives = [...], an expression for each state"
    public = [n for n in dir(type(model)) if not n.startswith("_")]
    return f"{kind} has no '{name}'{_meant(name, public)}"
