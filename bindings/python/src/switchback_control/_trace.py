"""Callables as expressions: called once with symbols, they become functions that run without Python.

A callable of a model is called with expressions in the place of numbers. Where that works, and the expressions agree with
the callable at random points, the expressions are used: they are evaluated by the library, with exact derivatives. Where it
does not, the callable stays what it is, and a `TraceWarning` names the line.
"""

from __future__ import annotations

import contextlib
import dis
import inspect
import linecache
import os
import threading
import warnings
from typing import Any, Callable, Iterator, NamedTuple, Sequence

import numpy

from ._arrays import Array
from .errors import NonfiniteError, SwitchbackError

__all__ = ["TraceWarning", "tracing"]

_HERE = os.path.dirname(__file__) + os.sep
_NUMPY = os.path.dirname(numpy.__file__) + os.sep


class TraceWarning(UserWarning):
    """A callable stays a function in Python, which is slow: the text says why, and at which line."""


class _Switch(threading.local):
    on = True


_switch = _Switch()


@contextlib.contextmanager
def tracing(on: bool) -> Iterator[None]:
    """Whether callables that are given to models in this block, on this thread, are traced; they are by default."""
    before, _switch.on = _switch.on, bool(on)
    try:
        yield
    finally:
        _switch.on = before


def is_on() -> bool:
    """True while callables are traced."""
    return _switch.on


class Part(NamedTuple):
    """A callable, the names of its arguments, and what it is called in messages."""

    f: Callable[..., Any]
    names: Sequence[str]
    what: str


class Captured(NamedTuple):
    """A number that a traced callable took from around itself: its name, how to read it, and its value then."""

    name: str
    read: Callable[[], Any]
    value: Any

    def changed(self) -> bool:
        """Has it another value now?"""
        try:
            now = self.read()
            return now is not self.value and not numpy.array_equal(now, self.value, equal_nan=True)
        except Exception:
            return True


class Outcome(NamedTuple):
    """What came of it: expressions and their graph, or None and a reason with its place; the reason is empty where the
    callable fails with numbers too, for its own message is the better one."""

    graph: Any
    ids: Array | None
    captured: list[Captured]
    reason: str = ""
    file: str = ""
    line: int = 0


_SHAPE = "its result has another shape than expected"
_MOST_NUMBERS = 100_000  # inputs and outputs of a function that is traced


class _Refused(Exception):
    """A callable cannot be traced; `silent` where its own error says more."""

    def __init__(self, reason: str, silent: bool = False):
        super().__init__(reason)
        self.silent = silent


# --- what a callable has around itself ----------------------------------------------------------------


def _code(f: Any) -> Any:
    """The function behind a callable that has code of its own: a method, or an object with __call__."""
    for _ in range(8):
        f = getattr(f, "__wrapped__", None) or getattr(f, "func", None) or f
        if hasattr(f, "__code__"):
            return f
        f = getattr(f, "__func__", None) or getattr(type(f), "__call__", None)
    return None


def _surroundings(function: Any) -> dict[str, Callable[[], Any]]:
    """Variables outside of a function that it reads, and how to read them."""
    if function is None:
        return {}
    code, found = function.__code__, {}
    for name, cell in zip(code.co_freevars, function.__closure__ or ()):
        found[name] = lambda cell=cell: cell.cell_contents
    for name in code.co_names:
        if name in function.__globals__:
            found[name] = lambda name=name: function.__globals__[name]
    return found


def _writes(function: Any) -> str | None:
    """The name of something outside of itself that a function assigns to."""
    if function is None:
        return None
    free = set(function.__code__.co_freevars)
    for step in dis.get_instructions(function):
        if step.opname in ("STORE_GLOBAL", "STORE_ATTR") or (step.opname == "STORE_DEREF" and step.argval in free):
            return str(step.argval)
    return None


def _numbers_around(surroundings: dict[str, Callable[[], Any]]) -> list[Captured]:
    found = []
    for name, read in surroundings.items():
        try:
            value = read()
        except ValueError:  # an empty cell
            continue
        if isinstance(value, numpy.ndarray) and value.dtype.kind in "fiub" and value.size <= 10_000:
            found.append(Captured(name, read, value.copy()))
        elif isinstance(value, (bool, int, float, numpy.number)):
            found.append(Captured(name, read, value))
        elif isinstance(value, (list, tuple)) and all(isinstance(v, (int, float)) for v in value):
            found.append(Captured(name, read, list(value)))
    return found


def _lengths(surroundings: dict[str, Callable[[], Any]]) -> dict[str, int]:
    """Lengths of the containers around a function: one that changes shows that calls are recorded."""
    found = {}
    for name, read in surroundings.items():
        try:
            value = read()
            if isinstance(value, (list, dict, set, bytearray)):
                found[name] = len(value)
        except Exception:
            continue
    return found


# --- the call -----------------------------------------------------------------------------------------


def _call(graph: Any, part: Part, inputs: dict[str, Any], shape: tuple[int, ...]) -> tuple[Array, list[Captured]]:
    """Numbers of the expressions that a callable returns, in the shape expected of it."""
    function = _code(part.f)
    written = _writes(function)
    if written is not None:
        raise _Refused(f"it assigns to '{written}' outside of itself")
    around = _surroundings(function)
    lengths = _lengths(around)
    result = part.f(*(inputs[n] for n in part.names))
    for name, n in _lengths(around).items():
        if n != lengths.get(name, n):
            raise _Refused(f"it changes '{name}' outside of itself")
    n_out = int(numpy.prod(shape))
    shapes = {shape, (n_out,)} | ({()} if n_out == 1 else set())
    if isinstance(result, numpy.ndarray) and result.shape not in shapes:  # before a look at its numbers: there may be many
        raise _Refused(_SHAPE, silent=True)
    try:
        outputs = graph.of(result)
    except SwitchbackError as error:
        raise _Refused(str(error), silent=True) from None
    if outputs._condition:
        raise _Refused("it returns a condition")
    if outputs.shape not in shapes:
        raise _Refused(_SHAPE, silent=True)
    return outputs._ids.ravel(), _numbers_around(around)


def _place(error: BaseException, f: Any) -> tuple[str, int]:
    """File and line of the user's code that an exception went through last, else where the callable begins."""
    place = None
    trace = error.__traceback__
    while trace is not None:
        file = trace.tb_frame.f_code.co_filename
        if not file.startswith((_HERE, _NUMPY)) and not file.startswith("<frozen"):
            place = file, trace.tb_lineno
        trace = trace.tb_next
    return _begin(f) if place is None else place


def _begin(f: Any) -> tuple[str, int]:
    """File and line where a callable begins; "" and 0 where it is no code in Python."""
    function = _code(f)
    return ("", 0) if function is None else (function.__code__.co_filename, function.__code__.co_firstlineno)


def trace(parts: Sequence[Part], sizes: dict[str, int], shape: tuple[int, ...]) -> Outcome:
    """Call callables with expressions, each for its share of outputs of a `shape`."""
    from .expr import Graph

    if sum(sizes.values()) > _MOST_NUMBERS or numpy.prod(shape, dtype=float) > _MOST_NUMBERS:
        return Outcome(None, None, [])
    graph = Graph()
    inputs: dict[str, Any] = {n: graph.inputs(n, sizes[n]) for n in ("x", "u", "p")}
    inputs["t"] = graph.inputs("t", 1)[0]
    each = shape if len(parts) == 1 else (int(numpy.prod(shape)) // len(parts),)
    found, captured = [], []
    for part in parts:
        graph._tracing = True
        try:
            with numpy.errstate(all="ignore"):
                ids, numbers = _call(graph, part, inputs, each)
        except Exception as error:
            silent = isinstance(error, _Refused) and error.silent
            said = (str(error) or type(error).__name__).rstrip(".")
            if said.startswith("setting an array element"):
                said = "an array of numbers holds no expressions: begin with numpy.zeros_like(x), or return a list, [a, b]"
            elif not isinstance(error, (_Refused, TypeError, SwitchbackError)):
                said = f"{type(error).__name__}: {said}"
            return Outcome(None, None, [], "" if silent else said, *_place(error, part.f))
        finally:
            graph._tracing = False
        found.append(ids)
        captured += numbers
    return Outcome(graph, numpy.concatenate(found), captured, "", *_begin(parts[0].f))


# --- the check ----------------------------------------------------------------------------------------


def _points(sizes: dict[str, int]) -> Iterator[dict[str, Any]]:
    """Points of several kinds: of both signs, positive, large. Always the same ones."""
    rng = numpy.random.default_rng(20)
    for draw in (*[rng.standard_normal] * 3, *[rng.random] * 2, lambda n: 100.0 * rng.standard_normal(n)):
        yield {**{n: draw(size) for n, size in sizes.items()}, "t": float(abs(draw(1)[0]))}


def disagreement(function: Any, parts: Sequence[Part], sizes: dict[str, int]) -> str | None:
    """Why expressions cannot stand for the callables: None where both have the same values at some points.

    Differences of 1e-9 are allowed, relative to the largest output of the callable there: the order of operations may
    differ, and what cancels may lose digits. Points where a callable raises do not count; "" if there are no others."""
    compared = 0
    for point in _points(sizes):
        try:
            with numpy.errstate(all="ignore"), warnings.catch_warnings():
                warnings.simplefilter("ignore")
                rows = [numpy.asarray(p.f(*(_copy(point[n]) for n in p.names)), dtype=float).ravel() for p in parts]
        except Exception:
            continue
        wanted = numpy.concatenate(rows)
        compared += 1
        try:
            values = function(point["x"], point["u"], point["p"], point["t"]).ravel()
        except NonfiniteError:
            values = numpy.full(wanted.shape, numpy.nan)
        finite = numpy.isfinite(wanted)
        if not finite.all() or not numpy.isfinite(values).all():
            if finite.all():
                return f"its expressions have no value at x = {point['x']}, where it has one"
            continue
        scale = numpy.abs(wanted).max(initial=0.0)
        if numpy.abs(values - wanted).max(initial=0.0) > 1e-9 * scale:
            return f"called with expressions it is another function: at x = {point['x']} it returns {wanted}, not {values}"
    return None if compared else ""


def _copy(value: Any) -> Any:
    return value.copy() if isinstance(value, numpy.ndarray) else value


# --- what is said -------------------------------------------------------------------------------------

_said: dict[Any, Any] = {}  # what was said already, for the filters of Python


def warn(what: str, outcome: Outcome) -> None:
    """Say why a callable was not traced, at its place: once for each, as Python does."""
    source = linecache.getline(outcome.file, outcome.line).strip()
    at = f"line {outcome.line}" + (f", `{source:.80}`" if source else "") + ": " if outcome.line else ""
    message = (
        f"{what} stays a function in Python, which is slow: {at}{outcome.reason}. It can be meant: then pass "
        "Function(f, ..., trace=False), or state the model within `with swb.tracing(False):`"
    )
    warnings.warn_explicit(message, TraceWarning, outcome.file or "switchback", outcome.line or 1, registry=_said)


def check_captured(functions: Sequence[Any]) -> None:
    """Warn where numbers that traced callables took from around themselves have changed since."""
    for f in functions:
        changed = [c.name for c in getattr(f, "_captured", ()) if c.changed()]
        if changed:
            warnings.warn(
                f"function '{f.name}' was declared with another value of {', '.join(changed)}, and keeps it: declare the "
                "model again, or make it a parameter p",
                TraceWarning,
                stacklevel=4,
            )
