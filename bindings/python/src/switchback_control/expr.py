"""Models written as expressions: exact derivatives, and operators that switch become modes.

from switchback_control.expr import Model, sign, sin

m = Model(states="x")
m.derivatives = [-sign(m.x[0]) + 0.2 * sin(5 * m.t)]
print(m.report())
run = swb.simulate(m, x0=[-0.5], t_span=2.0)
"""

from __future__ import annotations

import ctypes
import html
import json
import math
import operator
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Callable, Iterable, Iterator, Sequence

import numpy

from . import _ffi
from ._arrays import address, index, number, real
from ._call import Handle, call, encode, text
from ._document import Reader
from ._ffi import Direction, Effect, Trigger
from ._library import file_of, lib
from ._names import Named, nearest, split
from ._trace import check_captured
from .errors import ArgumentError, DimensionError, RangeError, SwitchbackError, UnsupportedError
from .function import Function
from .system import System

__all__ = [
    "Counts",
    "Expr",
    "Graph",
    "Model",
    "acos",
    "asin",
    "atan",
    "atan2",
    "clip",
    "concatenate",
    "cos",
    "cosh",
    "dead_zone",
    "erf",
    "exp",
    "external",
    "floor",
    "implicit",
    "inner_minimum",
    "jacobian",
    "log",
    "maximum",
    "minimum",
    "mod",
    "norm",
    "relay",
    "sign",
    "signed_distance",
    "sin",
    "sinh",
    "solve",
    "sqrt",
    "step_table",
    "table",
    "tan",
    "tanh",
    "where",
]

_Op = _ffi.Operator
_TABLES = {"steps": _ffi.Table.STEPS, "lines": _ffi.Table.LINES, "spline": _ffi.Table.SPLINE}
_CONDITIONS = {_Op.POSITIVE, _Op.NOT, _Op.AND, _Op.OR}


def _packed(ids: numpy.ndarray) -> numpy.ndarray:
    """A copy in rows; numpy.ascontiguousarray would make a list of a single number."""
    return numpy.array(ids, order="C")


_SMOOTH = (
    "A cost is stated with a further state instead: make it the derivative of that state, and its value at the end the cost (set_mayer). "
    "A constraint may have an additional control s in its place: for abs(a), bound s - a and s + a below by 0 (add_path)"
)


class Graph(Handle):
    """Holds expressions; equal expressions are one."""

    _kind = "expr"
    _tracing = False  # a callable is called with these expressions just now, and may do nothing that hides a branch

    def __init__(self) -> None:
        self._functions: list[Function] = []  # their callbacks are called as long as the graph is there
        self._create()

    def _expr(self, ids: numpy.ndarray, condition: bool = False) -> Expr:
        e = Expr.__new__(Expr)
        e._graph, e._ids, e._condition = self, ids, condition
        e._margin = None
        return e

    def _positive(self, margin: Expr) -> Expr:
        """The condition that a value is positive, which remembers the value."""
        e = self._apply(_Op.POSITIVE, margin)
        e._margin = margin
        return e

    def constant(self, value: Any) -> Expr:
        """A constant, or an array of them."""
        numbers = real(value, "constant")
        ids = numpy.empty(numbers.shape, dtype=numpy.int64)
        self._do("constants", address(numbers), numbers.size, address(ids), ids.size)
        return self._expr(ids)

    def inputs(self, block: str, n: int, first: int = 0) -> Expr:
        """Inputs `first` to `first + n - 1` of a block: "x", "u", "p" or "t"."""
        flags = {"x": _ffi.Input.X, "u": _ffi.Input.U, "p": _ffi.Input.P, "t": _ffi.Input.T}
        if block not in flags:
            raise RangeError(f"there is no block '{block}', only x, u, p, t")
        ids = numpy.empty(max(index(n, "n"), 0), dtype=numpy.int64)
        self._do("inputs", flags[block], index(first, "first"), address(ids), index(n, "n"))
        return self._expr(ids)

    def of(self, value: Any) -> Expr:
        """An expression of this graph: an expression, numbers, or a nested list of both."""
        if isinstance(value, Expr):
            if value._graph is not self:
                raise ArgumentError("expressions of two graphs cannot be combined")
            return value
        if isinstance(value, _Identity):
            value._refuse()
        objects = isinstance(value, numpy.ndarray) and value.dtype == object and value.ndim > 0
        if objects or (
            isinstance(value, (list, tuple)) and any(isinstance(v, (Expr, list, tuple, numpy.ndarray)) for v in value)
        ):
            parts = [self.of(v) for v in value]
            if not parts:
                return self.constant([])
            if len({p._condition for p in parts}) > 1:
                raise DimensionError("a list holds conditions and values: choose values with where")
            if len({p.shape for p in parts}) != 1:
                raise DimensionError("a list of expressions must hold arrays of one shape")
            return self._expr(numpy.stack([p._ids for p in parts]), parts[0]._condition)
        return self.constant(value)

    def _apply(self, op: int, *operands: Any) -> Expr:
        ids = [self.of(o)._ids for o in operands]
        try:
            ids = [_packed(i) for i in numpy.broadcast_arrays(*ids)]
        except ValueError:
            shapes = ", ".join(str(i.shape) for i in ids)
            raise DimensionError(f"shapes {shapes} do not fit") from None
        out = numpy.empty(ids[0].shape, dtype=numpy.int64)
        places = [address(i) for i in ids] + [None] * (3 - len(ids))
        if out.size:
            self._do("apply", op, *places, address(out), out.size)
        return self._expr(out, op in _CONDITIONS)

    def function(self, outputs: Any, nx: int, nu: int = 0, np: int = 0, name: str = "f") -> Function:
        """A function with exact derivatives: for costs and constraints."""
        outputs = self.of(outputs)
        flat = _packed(numpy.atleast_1d(outputs._ids))
        f = Function.__new__(Function)
        f.name, f.shape = name, flat.shape
        f.sizes = {"x": index(nx, "nx"), "u": index(nu, "nu"), "p": index(np, "np")}
        f.inputs = ("x", "u", "p", "t")
        self._fill(f, flat, encode(name, "name"))
        return f

    def _fill(self, f: Function, ids: numpy.ndarray, name: bytes) -> None:
        """Make a function, whose sizes are known, of expressions by their numbers."""
        f._callbacks = list(self._functions)
        s = f.sizes
        try:
            f._make(lib.swb_expr_function, self, name, s["x"], s["u"], s["p"], address(ids), ids.size)
        except UnsupportedError as error:
            raise UnsupportedError(f"{error}. {_SMOOTH}") from None


class Expr:
    """An array of expressions, or of conditions, of one graph; with the operators and functions of numpy."""

    _graph: Graph
    _ids: numpy.ndarray
    _condition: bool
    _margin: Expr | None  # of a comparison: what is positive where it holds

    def __init__(self) -> None:
        raise TypeError("expressions come from the variables of a Model or a Graph")

    @property
    def shape(self) -> tuple[int, ...]:
        """Lengths of the dimensions."""
        return self._ids.shape

    @property
    def ndim(self) -> int:
        """Number of dimensions."""
        return self._ids.ndim

    @property
    def size(self) -> int:
        """Number of expressions."""
        return self._ids.size

    @property
    def T(self) -> Expr:
        """Transposed."""
        return self._graph._expr(self._ids.T, self._condition)

    def reshape(self, *shape: Any) -> Expr:
        """Expressions in another shape."""
        return self._graph._expr(self._ids.reshape(*shape), self._condition)

    def ravel(self) -> Expr:
        """Expressions in one row."""
        return self.reshape(-1)

    flatten = ravel

    def copy(self) -> Expr:
        """The array itself: its expressions never change."""
        return self

    def dot(self, other: Any) -> Expr:
        """Product of matrices or vectors, as `@`."""
        return self @ other

    def __len__(self) -> int:
        if self.ndim == 0:
            raise TypeError("a single expression has no length")
        return len(self._ids)

    def __getitem__(self, key: Any) -> Expr:
        return self._graph._expr(numpy.asarray(self._ids[key]), self._condition)

    def __iter__(self) -> Iterator[Expr]:
        return (self[i] for i in range(len(self)))

    def __repr__(self) -> str:
        def one(i: int) -> str:
            return text(lib.swb_expr_text, self._graph, int(i))

        if self.ndim == 0:
            return one(self._ids)
        texts = numpy.array([one(i) for i in self._ids.ravel()] or [""], dtype=object)
        return str(texts.reshape(self.shape).tolist()) if self.size else "[]"

    def __bool__(self) -> bool:
        raise TypeError("a condition is not known before the model runs: use where, &, | and ~, not if, and, or, not")

    def __hash__(self) -> int:
        return hash((id(self._graph), self._ids.tobytes(), self.shape))

    def __float__(self) -> float:
        raise TypeError(
            "an expression is no number yet: use swb.sin or numpy.sin instead of math.sin, and collect results in a list, "
            "[a, b], instead of an array of numbers"
        )

    __int__ = __index__ = __complex__ = __float__  # type: ignore[assignment]

    def __setitem__(self, key: Any, value: Any) -> None:
        raise TypeError("expressions cannot be changed in place: collect the new ones in a list, [a, b]")

    def __eq__(self, other: Any) -> Any:
        return self._identity(other, "==")

    def __ne__(self, other: Any) -> Any:
        return self._identity(other, "!=")

    def _identity(self, other: Any, sign: str) -> Any:
        """Whether another one is the same expression, for sets and dictionaries; refused where values are meant."""
        if self._graph._tracing:
            raise TypeError("whether a value equals another one is not known before the model runs")
        if isinstance(other, Expr):
            same = other._graph is self._graph and other.shape == self.shape and bool((other._ids == self._ids).all())
            return _Identity(self, sign, same == (sign == "=="))
        if numpy.asarray(other).dtype.kind in "fiub" or _graph_among((other,)) is not None:
            raise TypeError(_no_equality(self, sign))
        return NotImplemented

    def sum(self, axis: int | None = None) -> Expr:
        """Sum of all, or along a dimension."""
        parts = self.reshape(-1) if axis is None else self._graph._expr(numpy.moveaxis(self._ids, axis, 0))
        shape = parts.shape[1:]
        total = self._graph.constant(numpy.zeros(shape))
        for part in parts:
            total = total + part
        return total

    def __matmul__(self, other: Any) -> Expr:
        return _matmul(self._graph, self, self._graph.of(other))

    def __rmatmul__(self, other: Any) -> Expr:
        return _matmul(self._graph, self._graph.of(other), self)

    def __pos__(self) -> Expr:
        return self

    def __gt__(self, other: Any) -> Expr:
        return self._graph._positive(self - other)

    def __lt__(self, other: Any) -> Expr:
        return self._graph._positive(other - self)

    __ge__ = __gt__
    __le__ = __lt__

    def _unknown(self, *_: Any) -> Any:
        raise TypeError(_UNKNOWN["trunc"])

    def __floor__(self) -> Any:
        return floor(self)

    def __mod__(self, other: Any) -> Any:
        return mod(self, other)

    def __rmod__(self, other: Any) -> Any:
        return mod(other, self)

    def __floordiv__(self, other: Any) -> Any:
        return floor(self / other)

    def __rfloordiv__(self, other: Any) -> Any:
        return floor(other / self)

    __divmod__ = __rdivmod__ = __ceil__ = __trunc__ = __round__ = _unknown

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **keywords: Any) -> Any:
        """Functions of numpy, and operators with an array on the left."""
        if ufunc.__name__ in ("equal", "not_equal"):
            raise TypeError(_no_equality(self, "==" if ufunc.__name__ == "equal" else "!="))
        f = _UFUNCS.get(ufunc.__name__)
        if f is not None and method == "__call__" and not keywords:
            return f(*inputs)
        if f is None:
            raise TypeError(_UNKNOWN.get(ufunc.__name__) or f"numpy.{ufunc.__name__} is not known for expressions{_known_instead(ufunc.__name__)}")
        return NotImplemented

    def __array_function__(self, function: Any, types: Any, inputs: Any, keywords: Any) -> Any:
        """Other functions of numpy: where, clip, dot, sum, concatenate, linalg.norm, linalg.solve."""
        f = _FUNCTIONS.get(function)
        if f is not None:
            return f(*inputs, **keywords)
        if function in (numpy.isclose, numpy.allclose, numpy.array_equal, numpy.array_equiv):
            raise TypeError(_no_equality(_graph_of(*inputs).of(inputs[0]), "=="))
        if function not in _ARRANGING:
            raise TypeError(f"numpy.{function.__name__} is not known for expressions{_known_instead(function.__name__)}")
        graph = _graph_of(*inputs)
        return graph.of(function(*(_objects(i) for i in inputs), **keywords))


class _Identity:
    """What `a == b` is of two expressions: true where they are the same one, and no condition of a model."""

    def __init__(self, left: Expr, sign: str, holds: bool):
        self._left, self._sign, self._holds = left, sign, holds

    def __bool__(self) -> bool:
        return self._holds

    def _refuse(self, *_: Any, **__: Any) -> Any:
        raise TypeError(_no_equality(self._left, self._sign))

    __and__ = __rand__ = __or__ = __ror__ = __xor__ = __rxor__ = __invert__ = _refuse
    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = __rtruediv__ = _refuse
    __gt__ = __lt__ = __ge__ = __le__ = __neg__ = __abs__ = __float__ = __array_ufunc__ = __array_function__ = _refuse

    def __repr__(self) -> str:
        return repr(self._holds)


def _no_equality(value: Expr, sign: str) -> str:
    """Why a comparison of values by == or != is no condition, and what to write instead."""
    return (
        f"{value!r:.60} {sign} ...: values are equal at single moments only, where a model cannot switch. Compare by < or >: "
        "where(a > b, ...) on either side of a value, where(abs(a - b) < width, ...) near it, where(w > 0.5, ...) for a discrete "
        "state w; what happens as a value is reached is a transition(a > b, reset={...}), what must be equal at an end is add_terminal(a, b, b)"
    )


_STEPS = (
    "it jumps without end, which no finite number of modes describes: a value that starts again is a state with a transition, "
    "m.transition(phase > 1, reset={phase: phase - 1}); a given function of time that repeats is a sine or a step_table; a value that is "
    "rounded at single times is floor in a reset, m.every or m.hold of a Model"
)
_UNKNOWN = {
    "heaviside": "numpy.heaviside is not known for expressions: use relay(a, 1, 0) or where(a > 0, 1, 0); the value at zero itself plays no role",
    **dict.fromkeys(("remainder", "fmod", "mod", "divmod", "floor_divide"), f"% and // of expressions are not known: {_STEPS}"),
    **{name: f"numpy.{name} of an expression is not known: {_STEPS}" for name in ("floor", "ceil", "trunc", "rint")},
}


def _known_instead(name: str) -> str:
    """The end of a message about a function of numpy that expressions do not have."""
    close = {"hypot": "sqrt(a**2 + b**2)", "cbrt": "sign(a) * abs(a)**(1/3)", "fmax": "maximum", "fmin": "minimum", "fabs": "abs"}
    close |= {"expm1": "exp(a) - 1", "log1p": "log(1 + a)", "exp2": "2**a", "log2": "log(a) / log(2)", "log10": "log(a) / log(10)"}
    close |= {"arcsinh": "log(a + sqrt(a**2 + 1))", "reciprocal": "1 / a", "float_power": "a**b", "deg2rad": "a * pi / 180", "rad2deg": "a * 180 / pi"}
    if name in close:
        return f": use {close[name]}"
    return ": known are + - * / **, comparisons, and the functions of switchback_control.expr"


def _graph_of(*operands: Any) -> Graph:
    graph = _graph_among(operands)
    if graph is not None:
        return graph
    raise ArgumentError("there is no expression among the operands, only numbers: use the function of numpy for these")


def _graph_among(operands: Iterable[Any]) -> Graph | None:
    """The graph of the first expression among operands, also in lists and arrays of objects; None if there is none."""
    for o in operands:
        if isinstance(o, Expr):
            return o._graph
        objects = isinstance(o, numpy.ndarray) and o.dtype == object
        if objects or isinstance(o, (list, tuple)):
            graph = _graph_among(o.flat if objects else o)
            if graph is not None:
                return graph
    return None


_LARGE_PRODUCT = 100_000  # multiplications of a matrix product that are slower as expressions than in NumPy


def _matmul(graph: Graph, a: Expr, b: Expr) -> Expr:
    if a.ndim not in (1, 2) or b.ndim not in (1, 2) or a.shape[-1] != b.shape[0]:
        raise DimensionError(f"matrices of shapes {a.shape} and {b.shape} cannot be multiplied")
    left, right = numpy.atleast_2d(a._ids), b._ids.reshape(b.shape[0], -1)
    m, k, n = left.shape[0], left.shape[1], right.shape[1]
    if graph._tracing and m * k * n > _LARGE_PRODUCT:
        raise UnsupportedError(f"a matrix product of {m} by {k} by {n} is faster in NumPy")
    x, y = (_packed(v.T) for v in (left, right))  # by columns
    out = numpy.empty((n, m), dtype=numpy.int64)
    graph._do("matmul", m, k, n, address(x), x.size, address(y), y.size, address(out), out.size)
    return graph._expr(out.T.reshape(a.shape[:-1] + b.shape[1:]))


def _function(op: int, name: str, doc: str, numbers: Callable[..., Any]) -> Callable[..., Any]:
    def f(*operands: Any) -> Any:
        graph = _graph_among(operands)
        return numbers(*operands) if graph is None else graph._apply(op, *operands)

    f.__name__ = f.__qualname__ = name
    f.__doc__ = doc
    return f


sqrt = _function(_Op.SQRT, "sqrt", "Square root.", numpy.sqrt)
exp = _function(_Op.EXP, "exp", "Exponential.", numpy.exp)
log = _function(_Op.LOG, "log", "Natural logarithm.", numpy.log)
sin = _function(_Op.SIN, "sin", "Sine.", numpy.sin)
cos = _function(_Op.COS, "cos", "Cosine.", numpy.cos)
tan = _function(_Op.TAN, "tan", "Tangent.", numpy.tan)
asin = _function(_Op.ASIN, "asin", "Inverse sine.", numpy.arcsin)
acos = _function(_Op.ACOS, "acos", "Inverse cosine.", numpy.arccos)
atan = _function(_Op.ATAN, "atan", "Inverse tangent.", numpy.arctan)
sinh = _function(_Op.SINH, "sinh", "Hyperbolic sine.", numpy.sinh)
cosh = _function(_Op.COSH, "cosh", "Hyperbolic cosine.", numpy.cosh)
tanh = _function(_Op.TANH, "tanh", "Hyperbolic tangent.", numpy.tanh)
erf = _function(_Op.ERF, "erf", "Error function.", numpy.vectorize(math.erf))
atan2 = _function(_Op.ATAN2, "atan2", "Angle of the point (x, y), called as atan2(y, x).", numpy.arctan2)
sign = _function(_Op.SIGN, "sign", "Sign. This and those below switch: for the derivatives of models only.", numpy.sign)
minimum = _function(_Op.MIN, "minimum", "The smaller one.", numpy.minimum)
maximum = _function(_Op.MAX, "maximum", "The larger one.", numpy.maximum)
clip = _function(_Op.CLIP, "clip", "clip(a, low, high): the nearest value between them.", numpy.clip)
relay = _function(_Op.RELAY, "relay", "relay(a, on, off): on where a > 0, else off.", lambda a, on, off: numpy.where(numpy.asarray(a) > 0, on, off))
dead_zone = _function(_Op.DEAD_ZONE, "dead_zone", "dead_zone(a, w): the distance of a from [-w, w], with sign.", lambda a, w: a - numpy.clip(a, -w, w))
_where = _function(_Op.WHERE, "where", "", numpy.where)


_floor = _function(_Op.FLOOR, "floor", "", numpy.floor)


def floor(a: Any) -> Any:
    """The largest whole number that is not larger. It jumps again and again, so it is for what is evaluated at single times: resets of
    transitions, `Model.every` and `Model.hold`. Its derivative is zero."""
    graph = _graph_among((a,))
    if graph is not None and graph._tracing:
        raise TypeError(_UNKNOWN["floor"])
    return _floor(a)


def mod(a: Any, b: Any) -> Any:
    """The rest of a division, `a - b * floor(a / b)`, as `a % b`: for what is evaluated at single times, see `floor`."""
    graph = _graph_among((a, b))
    if graph is None:
        return numpy.mod(a, b)
    if graph._tracing:
        raise TypeError(_UNKNOWN["remainder"])
    return graph.of(a) - graph.of(b) * floor(graph.of(a) / b)


def where(condition: Any, a: Any, b: Any) -> Any:
    """where(condition, a, b): a where the condition holds, else b."""
    for value in (condition, a, b):
        if isinstance(value, _Identity):
            value._refuse()
    return _where(condition, a, b)


def _power(a: Any, b: Any) -> Expr:
    return _graph_of(a, b)._apply(_Op.POW, a, b)


def _binary(op: int) -> tuple[Callable[..., Expr], Callable[..., Expr]]:
    def left(self: Expr, other: Any) -> Expr:
        return self._graph._apply(op, self, other)

    def right(self: Expr, other: Any) -> Expr:
        return self._graph._apply(op, other, self)

    return left, right


for _name, _op in {
    "add": _Op.ADD,
    "sub": _Op.SUB,
    "mul": _Op.MUL,
    "truediv": _Op.DIV,
    "pow": _Op.POW,
    "and": _Op.AND,
    "or": _Op.OR,
}.items():
    _left, _right = _binary(_op)
    setattr(Expr, f"__{_name}__", _left)
    setattr(Expr, f"__r{_name}__", _right)
for _name, _op in {"neg": _Op.NEG, "abs": _Op.ABS, "invert": _Op.NOT}.items():
    setattr(Expr, f"__{_name}__", lambda self, op=_op: self._graph._apply(op, self))

_UFUNCS: dict[str, Callable[..., Any]] = {
    "add": lambda a, b: _graph_of(a, b)._apply(_Op.ADD, a, b),
    "subtract": lambda a, b: _graph_of(a, b)._apply(_Op.SUB, a, b),
    "multiply": lambda a, b: _graph_of(a, b)._apply(_Op.MUL, a, b),
    "divide": lambda a, b: _graph_of(a, b)._apply(_Op.DIV, a, b),
    "power": _power,
    "matmul": lambda a, b: _matmul(_graph_of(a, b), _graph_of(a, b).of(a), _graph_of(a, b).of(b)),
    "greater": lambda a, b: _graph_of(a, b).of(a) > b,
    "greater_equal": lambda a, b: _graph_of(a, b).of(a) > b,
    "less": lambda a, b: _graph_of(a, b).of(a) < b,
    "less_equal": lambda a, b: _graph_of(a, b).of(a) < b,
    "logical_and": lambda a, b: _graph_of(a, b)._apply(_Op.AND, a, b),
    "logical_or": lambda a, b: _graph_of(a, b)._apply(_Op.OR, a, b),
    "logical_not": operator.invert,
    "bitwise_and": lambda a, b: _graph_of(a, b)._apply(_Op.AND, a, b),
    "bitwise_or": lambda a, b: _graph_of(a, b)._apply(_Op.OR, a, b),
    "invert": operator.invert,
    "negative": operator.neg,
    "absolute": abs,
    "square": lambda a: a**2,
    "sqrt": sqrt,
    "exp": exp,
    "log": log,
    "sin": sin,
    "cos": cos,
    "tan": tan,
    "arcsin": asin,
    "arccos": acos,
    "arctan": atan,
    "arctan2": atan2,
    "sinh": sinh,
    "cosh": cosh,
    "tanh": tanh,
    "sign": sign,
    "minimum": minimum,
    "maximum": maximum,
    "floor": floor,
    "remainder": mod,
    "floor_divide": lambda a, b: floor(_graph_of(a, b).of(a) / b),
}


# Arrays of objects, such as numpy.array([q, v]), call methods of their elements.
for _name in "sqrt exp log sin cos tan arcsin arccos arctan sinh cosh tanh sign square floor".split():
    setattr(Expr, _name, lambda self, f=_UFUNCS[_name]: f(self))


def norm(a: Any) -> Any:
    """Euclidean norm; it has no derivative at zero."""
    if not isinstance(a, Expr):
        graph = _graph_among((a,))
        if graph is None:
            return numpy.linalg.norm(real(a, "a"))
        a = graph.of(a)
    flat = a.reshape(-1)
    return sqrt(flat @ flat)


def concatenate(parts: Sequence[Any]) -> Any:
    """One flat array of all parts, in order."""
    graph = _graph_among(parts)
    if graph is None:
        return numpy.concatenate([real(p, "part").ravel() for p in parts])
    return graph._expr(numpy.concatenate([graph.of(p)._ids.ravel() for p in parts]))


def solve(matrix: Any, rhs: Any) -> Any:
    """Solution of a small linear system; the matrix is decomposed numerically, not symbolically. With several
    right-hand sides, a matrix with a column for each. Of numbers alone the solution is numbers."""
    graph = _graph_among((matrix, rhs))
    if graph is None:
        return numpy.linalg.solve(real(matrix, "matrix"), real(rhs, "rhs"))
    a, b = graph.of(matrix), graph.of(rhs)
    if a.ndim != 2 or a.shape[0] != a.shape[1] or b.ndim not in (1, 2) or b.shape[0] != a.shape[0]:
        raise DimensionError(f"no linear system: matrix of shape {a.shape}, right-hand side of shape {b.shape}")
    columns = _packed(a._ids.T)
    right = b._ids.reshape(len(b), -1)
    out = numpy.empty(right.shape, dtype=numpy.int64)
    for j in range(right.shape[1]):
        r = _packed(right[:, j])
        x = numpy.empty_like(r)
        graph._do("solve", address(columns), columns.size, address(r), address(x), len(r))
        out[:, j] = x
    return graph._expr(out.reshape(b.shape))


def _unknowns(start: Any, graph: Graph | None, what: str) -> tuple[Graph, Expr, Expr, bool]:
    """Unknowns for an inner problem, with where they are looked for, as lists; and whether that is a single one."""
    found = _graph_among((start,)) or graph
    if found is None:
        raise ArgumentError(f"the start of {what} consists of numbers: say of which model it is, {what}(..., graph=model.graph)")
    first = found.of(start)
    if first.ndim > 1 or first.size == 0:
        raise DimensionError(f"the start of {what} is a list of numbers or expressions, not an array of shape {first.shape}")
    ids = numpy.empty(first.size, dtype=numpy.int64)
    found._do("unknowns", address(ids), ids.size)
    return found, first.reshape(-1), found._expr(ids), first.ndim == 0


def implicit(equations: Callable[[Any], Any], start: Any, graph: Graph | None = None) -> Expr:
    """The solution w of equations G(w) = 0, as an expression: found by a damped Newton method where it is evaluated.

        w = implicit(lambda w: w**3 + w - x[0], start=x[0])  # the inverse of w + w**3

    `equations` is a function of w that returns as many expressions as `start` has. Derivatives are exact and of any order
    (implicit function theorem). Where no solution is found the expression is not defined, as a root of a negative number is not.
    Errors: `UnsupportedError` for operators that switch, `RangeError`, `DimensionError`.
    """
    g, first, w, scalar = _unknowns(start, graph, "implicit")
    zero = g.of(equations(w[0] if scalar else w)).reshape(-1)
    if zero.size != w.size:
        raise DimensionError(f"there are {zero.size} equations for {w.size} unknowns: there must be as many")
    out = numpy.empty(w.size, dtype=numpy.int64)
    given = [_packed(e._ids) for e in (zero, w, first)]
    g._do("implicit", *(address(i) for i in given), address(out), out.size)
    found = g._expr(out)
    return found[0] if scalar else found


def inner_minimum(cost: Callable[[Any], Any], start: Any, graph: Graph | None = None) -> tuple[Expr, Expr]:
    """The least value of a function near a start, and where it is, as expressions.

        least, w = inner_minimum(lambda w: w**4 / 4 - x[0] * w, start=1.0, graph=m.graph)

    Newton's method descends in every step where the expressions are evaluated. Derivatives are exact and of any order where the
    second derivatives of the cost are positive definite. Errors as `implicit`.
    """
    g, first, w, scalar = _unknowns(start, graph, "inner_minimum")
    value = g.of(cost(w[0] if scalar else w)).reshape(-1)
    if value.size != 1:
        raise DimensionError(f"a cost is one expression, not {value.size}")
    out, least = numpy.empty(w.size, dtype=numpy.int64), numpy.empty(1, dtype=numpy.int64)
    unknowns, begin = _packed(w._ids), _packed(first._ids)
    g._do("inner_minimum", int(value._ids[0]), address(unknowns), address(begin), address(least), address(out), out.size)
    found = g._expr(out)
    return g._expr(least)[0], found[0] if scalar else found


def signed_distance(
    between: Any, support: Callable[[Any], Any], start: Any = None, size: float = 1.0
) -> tuple[Expr, Expr]:
    """Signed distance of two strictly convex bodies A and B, and the unit normal from B to A, as expressions.

        gap, normal = signed_distance([x - 2.0, y], lambda d: sqrt(4 * d[0] ** 2 + d[1] ** 2) + 0.5 * norm(d))

    between   the way from the origin of B to that of A, two or three expressions
    support   a function of a direction d: the support function of A at -d plus that of B at d. That of a body is the largest value
              of d . x over its points x, from its origin: r norm(d) of a circle, sqrt(d . S d) of an ellipse with the matrix S of
              squared semi-axes
    start     a first guess of the normal, by default `between`
    size      a length of the order of the bodies, which scales the iteration

    The gap is the largest value of d . between - support(d) over unit vectors. Negative values say how far the bodies have to be
    moved apart. It is smooth through zero, down to an overlap of the sum of the radii of curvature. Errors as `implicit`.
    """
    g, first, d, _ = _unknowns(between if start is None else start, _graph_among((between,)), "signed_distance")
    way = g.of(between).reshape(-1)
    if way.size != d.size:
        raise DimensionError(f"the start has {d.size} components, the way between the bodies {way.size}")
    h = g.of(support(d)).reshape(-1)
    if h.size != 1:
        raise DimensionError(f"a support function is one expression, not {h.size}")
    out, gap = numpy.empty(d.size, dtype=numpy.int64), numpy.empty(1, dtype=numpy.int64)
    c, unknowns, begin = (_packed(e._ids) for e in (way, d, first))
    ids = address(unknowns), address(begin)
    g._do("signed_distance", address(c), int(h._ids[0]), *ids, number(size, "size"), address(gap), address(out), out.size)
    return g._expr(gap)[0], g._expr(out)


def jacobian(outputs: Any, inputs: Expr) -> Expr:
    """Derivatives of expressions with respect to inputs, as expressions: for energies and Lagrangians."""
    f, x = inputs._graph.of(outputs), _packed(inputs._ids.ravel())
    flat = _packed(f._ids.ravel())
    out = numpy.empty((x.size, flat.size), dtype=numpy.int64)
    inputs._graph._do("jacobian", address(flat), flat.size, address(x), x.size, address(out), out.size)
    return inputs._graph._expr(out.T.reshape(f.shape + inputs.shape))


def _objects(value: Any) -> Any:
    """Expressions as an array of objects, also in lists."""
    if isinstance(value, Expr):
        out = numpy.empty(value.shape, dtype=object)
        for place in numpy.ndindex(value.shape):
            out[place] = value[place]
        return out
    if isinstance(value, (list, tuple)) and any(isinstance(v, (Expr, list, tuple)) for v in value):
        return type(value)(_objects(v) for v in value)
    return value


# Functions of numpy that arrange, add and multiply what is in arrays: they work on arrays of objects.
_ARRANGING = {
    getattr(numpy, name)
    for name in (
        "append atleast_1d atleast_2d broadcast_to column_stack cross cumsum diag diagonal diff dstack expand_dims flip "
        "flipud fliplr hstack inner kron mean moveaxis outer prod ravel repeat reshape roll squeeze stack swapaxes take tensordot "
        "tile trace transpose vdot vstack einsum"
    ).split()
    if hasattr(numpy, name)
}


_FUNCTIONS: dict[Any, Callable[..., Expr]] = {
    numpy.zeros_like: lambda a, **_: numpy.zeros(a.shape, dtype=object),
    numpy.ones_like: lambda a, **_: numpy.ones(a.shape, dtype=object),
    numpy.empty_like: lambda a, **_: numpy.zeros(a.shape, dtype=object),
    numpy.where: where,
    numpy.clip: clip,
    numpy.dot: lambda a, b: _graph_of(a, b).of(a) @ b,
    numpy.sum: lambda a, axis=None: a.sum(axis),
    numpy.concatenate: concatenate,
    numpy.linalg.norm: norm,
    numpy.linalg.solve: solve,
}


def table(a: Expr, points: Any, values: Any, kind: str = "spline") -> Expr:
    """Values of a table at `a`: "spline" through points, "lines", or "steps" between breaks (one value more)."""
    if kind not in _TABLES:
        raise RangeError(f"there is no table '{kind}', only {', '.join(_TABLES)}")
    p, v = real(points, "points"), real(values, "values")
    ids = _packed(a._ids)
    out = numpy.empty(ids.shape, dtype=numpy.int64)
    where_ids, where_out = address(ids), address(out)
    a._graph._do("table", _TABLES[kind], address(p), p.size, address(v), v.size, where_ids, where_out, ids.size)
    return a._graph._expr(out)


def step_table(a: Expr, breaks: Sequence[float], values: Sequence[Any]) -> Expr:
    """A table of steps with a switching function at each break: values[i] between breaks[i - 1] and breaks[i]."""
    if len(values) != len(breaks) + 1:
        raise DimensionError(f"{len(breaks)} breaks and {len(values)} values: one value more than breaks")
    if list(breaks) != sorted(set(breaks)):
        raise RangeError("breaks must increase")
    out = a._graph.of(values[0])
    for b, value in zip(breaks, values[1:]):
        out = where(a > b, value, out)
    return out


def external(f: Function, x: Any = (), u: Any = (), p: Any = (), t: Any = 0.0) -> Expr:
    """Outputs of a function at expressions; derivatives are those of the function."""
    graph = _graph_of(x, u, p, t)
    parts = [graph.of(v)._ids.ravel() for v in (x, u, p, t) if not (isinstance(v, (tuple, list)) and len(v) == 0)]
    args = _packed(numpy.concatenate(parts))
    out = numpy.empty(f.n_out, dtype=numpy.int64)
    graph._do("call", f, address(args), args.size, address(out), out.size)
    graph._functions.append(f)
    return graph._expr(out.reshape(f.shape))


@dataclass(frozen=True)
class Counts:
    """Sizes of a model; algebraic variables and pairs are counted at one point."""

    subsystems: int
    switching_functions: int
    regions: int
    algebraic: int
    pairs: int


@dataclass(frozen=True)
class _Transition:
    guard: Expr
    direction: Direction
    when: dict[int, float]
    reset: dict[int, Expr]
    to: dict[int, float]
    name: str = ""
    effect: Effect = Effect.JUMP
    trigger: Trigger = Trigger.LEVEL

    def add_to(self, built: Any, graph: Graph) -> None:
        """Add it to a model or a scene of the library."""

        reset = {state: int(value._ids) for state, value in self.reset.items()}
        arrays: list[numpy.ndarray] = []
        for given, kind in ((self.when, float), (reset, numpy.int64), (self.to, float)):
            arrays += [numpy.array(list(given), numpy.int64), numpy.array(list(given.values()), kind)]
        places = [v for a in arrays for v in (address(a), a.size)]
        rule = encode(self.name, "name"), self.effect, self.trigger
        built._do("add_event", graph, *rule, int(self.guard._ids), self.direction, *places, None)

    @classmethod
    def saved(cls, t: Any, roots: Iterator[Expr]) -> _Transition:
        """A transition of a document; its guard and what its reset makes of states are the next of `roots`."""
        guard, rule = next(roots), t.get("rule", {})
        reset = {state: next(roots) for state in t.get("reset", ())}
        when, to = ({v["state"]: float(v["value"]) for v in t.get(key, ())} for key in ("from", "to"))
        effect, trigger = Effect[rule.get("effect", "jump").upper()], Trigger[rule.get("trigger", "level").upper()]
        return cls(guard, Direction[t["direction"].upper()], when, reset, to, rule.get("name", ""), effect, trigger)

    @classmethod
    def read(cls, built: _Built, graph: Graph, index: int) -> _Transition:
        """A transition of a model of the library."""
        sizes = [ctypes.c_int64() for _ in range(3)]
        built._do("transition_sizes", index, *(ctypes.byref(n) for n in sizes))
        guard, direction = ctypes.c_int64(), ctypes.c_int32()
        found, places = [], []
        for n, kind in zip(sizes, (float, numpy.int64, float)):
            states, values = numpy.empty(n.value, numpy.int64), numpy.empty(n.value, kind)
            found.append((states, values))
            places += [address(states), n.value, address(values), n.value]
        built._do("get_transition", index, ctypes.byref(guard), ctypes.byref(direction), *places)
        when, reset, to = ({int(s): v for s, v in zip(states, values)} for states, values in found)
        effect, trigger = ctypes.c_int32(), ctypes.c_int32()
        name = text(lib.swb_model_get_rule, built, index, ctypes.byref(effect), ctypes.byref(trigger))
        return cls(
            graph._expr(numpy.array(guard.value)),
            Direction(direction.value),
            {state: float(v) for state, v in when.items()},
            {state: graph._expr(numpy.array(v)) for state, v in reset.items()},
            {state: float(v) for state, v in to.items()},
            name,
            Effect(effect.value),
            Trigger(trigger.value),
        )


def _clock(period: Any, offset: Any) -> tuple[float, float]:
    """Period and offset of a clock."""
    every, first = number(period, "period"), number(offset, "offset")
    if not (every > 0 and math.isfinite(every)):
        raise ArgumentError(f"period is {every}: it must be positive and finite")
    if not math.isfinite(first):
        raise ArgumentError(f"offset is {first}: it must be finite")
    return every, first


class _Built(Handle):
    _kind = "model"


class Jumping:
    """What models and scenes share: discrete states, transitions, clocks."""

    graph: Graph
    x: Expr
    t: Expr
    _transitions: list[_Transition]
    _what = "model"

    def discrete(self, name: str = "", initial: float = 0.0) -> Expr:
        raise NotImplementedError

    def _state_names(self) -> list[str]:
        """Names of all states, "" where one has none."""
        raise NotImplementedError

    def _take(self, transition: _Transition) -> None:
        """A transition is added: what has been made without it is old."""
        raise NotImplementedError

    def _state(self, state: Any, what: str) -> int:
        """The place of a state that is given as an expression or by its name."""
        if isinstance(state, Expr) and state.ndim == 0:
            places = numpy.flatnonzero(self.x._ids == state._ids)
        else:
            places = [i for i, name in enumerate(self._state_names()) if name and name == state]
        if len(places) != 1:
            raise ArgumentError(f"{what}: {state!r} is no state of the {self._what}{nearest(state, self._state_names())}")
        return int(places[0])

    def _values(self, given: Any, what: str) -> dict[int, float]:
        if given is None:
            return {}
        if not hasattr(given, "items"):
            raise ArgumentError(f"{what} must be a dictionary from discrete states to values, not {type(given).__name__}")
        return {self._state(state, what): number(value, what) for state, value in given.items()}

    def transition(
        self, guard: Any, *, when: Any = None, reset: Any = None, to: Any = None, name: str = "", edge: bool = False
    ) -> int:
        """Add a jump of the state, for event-driven simulation, and return its number.

        `guard` is a comparison, such as `v > 15`, comparisons joined by `&`, `|` and `~`, or an expression; the jump happens where the
        condition becomes true, or the expression positive. `when` are discrete states and the values they must have for that; `reset` are
        states and what they become, expressions of the state before, which may switch and jump (`clip`, `where`, `floor`); `to` are discrete
        states and the values they get. All three are dictionaries; what is not named stays as it is. `name` is that of its times in
        `Run.t_events`.

        A guard that holds when its discrete states begin (at the start, too) acts at once; with `edge=True` it has to be false before. Of
        several at one time the first that was added comes first. A transition that leaves its own guard true is watched again when the
        guard has been false.
        """
        after: dict[int, Expr] = {}
        if reset is not None:
            if not hasattr(reset, "items"):
                raise ArgumentError(f"reset must be a dictionary from states to expressions, not {type(reset).__name__}")
            after = {self._state(state, "reset"): self.graph.of(value) for state, value in reset.items()}
        for state, value in after.items():
            if value.ndim or value._condition:
                what = "a condition" if value._condition else f"an array of shape {value.shape}"
                raise DimensionError(f"reset of {self._state_names()[state] or self.x[state]!r} is {what}: it becomes one value")
        trigger = Trigger.EDGE if edge else Trigger.LEVEL
        return self._add_event(guard, self._values(when, "when"), after, self._values(to, "to"), name, Effect.JUMP, trigger)

    def stop_at(self, guard: Any, *, when: Any = None, name: str = "") -> int:
        """End runs where a condition becomes true, or an expression positive, and return the number of the event.

        `guard`, `when` and `name` are those of `transition`. A condition that is true at the start has to be false first. `Run.stopped_by` says
        which event ended a run, and `Run.outcome` is EVENT. Derivatives of the last state include that of the time of the end.
        """
        return self._add_event(guard, self._values(when, "when"), {}, {}, name, Effect.STOP, Trigger.EDGE)

    def note(self, guard: Any, *, when: Any = None, name: str = "") -> int:
        """Note where a condition becomes true, or an expression positive, and return the number of the event.

        `guard`, `when` and `name` are those of `transition`. Times and states are in `Run.t_events` and `Run.y_events`, as accurate as those of
        transitions. No step ends for that. A condition that is true at the start has to be false first.
        """
        return self._add_event(guard, self._values(when, "when"), {}, {}, name, Effect.NOTE, Trigger.EDGE)

    def _add_event(
        self,
        guard: Any,
        when: dict[int, float],
        reset: dict[int, Expr],
        to: dict[int, float],
        name: str,
        effect: Effect,
        trigger: Trigger,
    ) -> int:
        g = self.graph.of(guard)
        if g.size and not isinstance(guard, Expr):
            raise ArgumentError(f"the guard is {guard!r:.40}, which never passes zero: give a comparison of variables, as in m.q > 1")
        if g.ndim:
            raise DimensionError(f"a guard is one value, not an array of shape {g.shape}")
        if g._condition and g._margin is not None:
            g = g._margin
        if not isinstance(name, str):
            raise ArgumentError(f"the name of an event must be a text, not {type(name).__name__}")
        if name and any(name == t.name for t in self._transitions):
            raise ArgumentError(f"there is an event '{name}' already: give this one another name")
        made = _Transition(g, Direction.RISING, when, reset, to, name, effect, trigger)
        self._take(made)
        self._transitions.append(made)
        return len(self._transitions) - 1

    def hysteresis(self, value: Any, on: Any, off: Any, initial: int = 0, name: str = "") -> Expr:
        """A discrete value that becomes 1 where `value` exceeds `on` and 0 where it falls below `off`, which is smaller.

        It is a new discrete state (see `discrete`). For a heater, which goes on below a threshold, negate all three.
        """
        if initial not in (0, 1):
            raise ArgumentError(f"initial is {initial!r}: the value is 0 or 1")
        high, low = self.graph.of(on), self.graph.of(off)
        if not isinstance(on, Expr) and not isinstance(off, Expr) and not number(off, "off") < number(on, "on"):
            raise ArgumentError(
                f"on is {on} and off is {off}: off must be smaller; for what goes on below a threshold negate value, on and off"
            )
        w = self.discrete(name, initial)
        self.transition(self.graph.of(value) > high, when={w: 0}, to={w: 1})
        self.transition(self.graph.of(value) < low, when={w: 1}, to={w: 0})
        return w

    def every(self, period: float, reset: Any = None, *, to: Any = None, offset: float = 0.0, name: str = "") -> Expr:
        """A clock: a transition at the times `offset`, `offset + period`, and so on. `reset` and `to` are those of `transition`.

        Returns the number of times the clock has struck, a new discrete state (see `discrete`). The times are those of the formula to the last
        digit, however many there are. A run that begins later begins with the number of times before it.
        """
        every, first = _clock(period, offset)
        count = self.discrete(name, 0)
        given = {} if reset is None else reset
        if not hasattr(given, "items"):
            raise ArgumentError(f"reset must be a dictionary from states to expressions, not {type(reset).__name__}")
        self.transition(self.t > first + every * count, reset={count: count + 1, **given}, to=to)
        return count

    def at_times(self, times: Any, reset: Any = None, *, to: Any = None, name: str = "") -> Expr:
        """Transitions at given times, which increase. `reset` and `to` are those of `transition`, the same at all times; their expressions may
        depend on how many of the times are over, which is the discrete state that is returned."""
        all = [number(t, "times") for t in times]
        if not all or not math.isfinite(all[-1]) or not math.isfinite(all[0]) or any(not b > a for a, b in zip(all, all[1:])):
            raise ArgumentError(f"times must be numbers that increase, at least one: {all[:8]}")
        count = self.discrete(name, 0)
        for k, t in enumerate(all):
            self.transition(self.t > t, when={count: k}, reset=reset, to={**({} if to is None else to), count: k + 1})
        return count

    def hold(self, value: Any, period: float, *, offset: float = 0.0, initial: float = 0.0, name: str = "") -> Expr:
        """Sample and hold: the value that an expression had at the last of the times `offset`, `offset + period`, and so on; `initial` before
        the first one. It is a new discrete state (see `discrete`)."""
        _clock(period, offset)
        held = self.discrete(name, initial)
        self.every(period, {held: value}, offset=offset)
        return held

    def pwm(self, duty: Any, period: float, *, offset: float = 0.0, name: str = "") -> Expr:
        """Pulse-width modulation: 1 from every multiple of `period` on until a part `duty` of the period is over, then 0.

        `duty` may be an expression: the pulse ends where the ramp reaches it. Of a value that is held (see `hold`) it is that of the start. The
        pulse is a new discrete state (see `discrete`).
        """
        if not isinstance(duty, Expr) and not 0 <= number(duty, "duty") <= 1:
            raise ArgumentError(f"duty is {duty}: a part of the period is between 0 and 1")
        every, first = _clock(period, offset)
        pulse = self.discrete(name, 0)
        count = self.every(every, to={pulse: 1}, offset=first)
        self.transition(self.t - first - every * (count - 1) > every * self.graph.of(duty), when={pulse: 1}, to={pulse: 0})
        return pulse


class Model(Jumping, Named):
    """A model made of expressions: variables `x`, `u`, `p` and the time `t`, and the derivatives of the states.

    Variables are given by names, "q v", or by their number; those with names are attributes, `model.q`, too. Setting `derivatives` to a list of expressions, one for
    each state, or `derivative` state by state, completes the model.
    """

    def __init__(
        self,
        states: int | str | Sequence[str],
        controls: int | str | Sequence[str] = 0,
        parameters: int | str | Sequence[str] = 0,
        name: str = "model",
        *,
        _graph: Graph | None = None,
    ):
        self.name = name
        self.names = [split(states, "states"), split(controls, "controls"), split(parameters, "parameters")]
        self._refuse_twice()
        self.nx, self.nu, self.np = (len(n) for n in self.names)
        self.graph = Graph() if _graph is None else _graph
        self.x, self.u, self.p = (self.graph.inputs(b, n) for b, n in zip("xup", (self.nx, self.nu, self.np)))
        self.t = self.graph.inputs("t", 1)[0]
        self._rhs: list[Expr | None] = [None] * self.nx
        self._trial: Any = None
        self._made: _Built | None = None
        self._transitions: list[_Transition] = []
        self._choices: list[tuple[int, tuple[float, ...], float]] = []  # control, values, dwell time
        self._discrete: list[float] = []  # initial values of the last states
        self._value_names: dict[int, tuple[str, ...]] = {}  # of discrete states, by their place among all states
        self._complete = True
        if _graph is None:
            self._warn_hidden()

    def _blocks(self) -> tuple[Expr, ...]:
        return self.x, self.u, self.p

    def derivative(self, state: Expr | str, rhs: Any) -> None:
        """Set the derivative of a state, given as an expression or by its name."""
        self._rhs[self._state(state, "derivative")] = self.graph.of(rhs)
        self._made = None

    def discrete(self, name: str = "", initial: float = 0.0) -> Expr:
        """Add a discrete state: only transitions change it. It is the last state, and where an initial state is given
        without the discrete ones they begin with `initial`. Add discrete states before functions of the model are made."""
        start = number(initial, "initial")
        if not isinstance(name, str):
            raise ArgumentError(f"the name of a discrete state must be a text, not {type(name).__name__}")
        if name and any(name in names for names in self.names):
            raise ArgumentError(f"there is a variable '{name}' already: give the discrete state another name")
        self.names[0].append(name)
        self.nx += 1
        self.x = self.graph.inputs("x", self.nx)
        self._rhs.append(self.graph.constant(0.0))
        self._discrete.append(start)
        self._made = None
        return self.x[self.nx - 1]

    def _state_names(self) -> list[str]:
        return self.names[0]

    def _take(self, transition: _Transition) -> None:
        self._made = None

    def choice(self, control: Any, values: Any, dwell: float = 0.0) -> None:
        """Say that a control chooses among values: on or off, a gear, a number of machines.

        `control` is a name, a number, or an expression `m.u[0]`. An optimal control problem (`Ocp`) searches the best value for every control
        stage. With a `dwell` time each value that is chosen holds for that long at least; the value at the start may be left at any time, and the
        end of the horizon may cut the last one short. Simulations take any value of the control.
        """
        given = tuple(float(v) for v in numpy.atleast_1d(numpy.asarray(values, dtype=float)).ravel())
        self._choices.append((self._control(control), given, number(dwell, "dwell")))
        self._made = None

    def _control(self, control: Any) -> int:
        """The place of a control that is given as an expression, by its name or by its number."""
        if isinstance(control, Expr) and control.ndim == 0:
            places = [int(i) for i in numpy.flatnonzero(self.u._ids == control._ids)]
        elif isinstance(control, str):
            places = [i for i, name in enumerate(self.names[1]) if name and name == control]
        else:
            places = [index(control, "control")]
        if len(places) != 1:
            raise ArgumentError(f"choice: {control!r} is no control of the model{nearest(control, self.names[1])}")
        return places[0]

    @property
    def derivatives(self) -> list[Expr | None]:
        """Derivatives of the states, in order; None where one is missing."""
        return list(self._rhs)

    @derivatives.setter
    def derivatives(self, rhs: Any) -> None:
        all = [self.graph.of(r) for r in rhs]
        smooth = self.nx - len(self._discrete)
        if len(all) not in (self.nx, smooth):
            raise DimensionError(f"{len(all)} derivatives for {smooth} states")
        self._rhs = list(all) + self._rhs[len(all) :]
        self._made = None

    def try_at(self, x: Any, u: Any = None, p: Any = None, t: float = 0.0) -> None:
        """A point where everything should be defined; the report says what is not."""
        from ._arrays import vector

        def zero(v: Any, n: int, what: str) -> numpy.ndarray:
            return numpy.zeros(n) if v is None else vector(v, n, what)

        self._trial = (float(t), vector(x, self.nx, "x"), zero(u, self.nu, "u"), zero(p, self.np, "p"))
        self._made = None

    def _build(self) -> _Built:
        if self._made is None:
            missing = [i for i, r in enumerate(self._rhs) if r is None]
            if missing:
                names = ", ".join(self.names[0][i] or f"x[{i}]" for i in missing)
                raise ArgumentError(f"no derivative is given for {names}: set it to 0 if it is constant")
            for i, r in enumerate(self._rhs):
                if r.ndim:  # type: ignore[union-attr]
                    what = self.names[0][i] or f"x[{i}]"
                    raise DimensionError(
                        f"the derivative of {what} is an array of shape {r.shape}, not one expression; x, u and p of a model are arrays "  # type: ignore[union-attr]
                        "of all states, controls and parameters, also where one of them has that name: write model['u'] for that one"
                    )
            ids = numpy.array([int(r._ids) for r in self._rhs], dtype=numpy.int64)  # type: ignore[union-attr]
            trial = None
            if self._trial is not None:
                t, x, u, p = self._trial
                trial = ctypes.byref(_ffi.swb_point(t, address(x), address(u), address(p)))
            made = _Built.__new__(_Built)
            made._make(
                lib.swb_model_create,
                self.graph,
                encode(self.name, "name"),
                self.nx,
                self.nu,
                self.np,
                address(ids),
                encode("\n".join(n for group in self.names for n in group), "names"),
                trial,
            )
            if self._discrete:
                initial = numpy.array(self._discrete)
                made._do("set_discrete", address(initial), initial.size)
            for place, values in self._value_names.items():
                made._do("set_value_names", place - (self.nx - initial.size), encode("\n".join(values), "names"))
            for t in self._transitions:
                t.add_to(made, self.graph)
            for control, values, dwell in self._choices:
                given = numpy.array(values)
                made._do("add_choice", control, address(given), given.size, dwell, None)
            self._made = made
        return self._made

    def system(self) -> System:
        """The system, for simulation and optimal control."""
        s = System.__new__(System)
        s.nx, s.nu, s.np = self.nx, self.nu, self.np
        s._functions = list(self.graph._functions)
        s._make(lib.swb_model_system, self._build())
        s.n_subsystems = self.counts().subsystems
        s._discrete = list(self._discrete)
        s._names = tuple(tuple(names) for names in self.names)
        s._events = [t.name for t in self._transitions]
        s._built = self._build()
        s._origin = self.graph, self.x._ids, tuple(self.names[0])
        return s

    def function(self, outputs: Any, name: str = "f") -> Function:
        """A function of the variables of the model with exact derivatives: for costs and constraints. One output may have `abs`, `minimum`
        and `maximum` in it where these point down (`abs(u)`, `maximum(u, 0)**2`): it is a cost, of `Ocp.set_lagrange` or `set_mayer`, and nothing
        else."""
        return self.graph.function(outputs, self.nx, self.nu, self.np, name)

    def between_ends(self, outputs: Callable[[Expr, Expr], Any], name: str = "ends") -> Function:
        """A function of the initial and the final state, for `Ocp.add_boundary`: `outputs(start, end)` are expressions."""
        start, end = (self.graph.inputs("x", self.nx, first) for first in (0, self.nx))
        return self.graph.function(outputs(start, end), 2 * self.nx, self.nu, self.np, name)

    def counts(self) -> Counts:
        """How large the model is."""
        numbers = [ctypes.c_int64() for _ in range(5)]
        call(lib.swb_model_counts, self._build(), *(ctypes.byref(n) for n in numbers))
        return Counts(*(n.value for n in numbers))

    def report(self) -> str:
        """Parts of the model, their costs, what was dropped and why, and what looks wrong."""
        return text(lib.swb_model_report, self._build(), 0)

    def report_data(self) -> dict[str, Any]:
        """The report as data."""
        return json.loads(text(lib.swb_model_report, self._build(), 1))

    def c_code(self) -> str:
        """C code of all functions of the model with their derivatives."""
        return text(lib.swb_model_write_c, self._build())

    def write_fmu(
        self,
        path: str | os.PathLike,
        x0: Any,
        *,
        controls: Any = None,
        params: Any = None,
        version: int = 2,
        rtol: float = 1e-8,
        atol: float = 1e-10,
        duration: float = 1.0,
    ) -> Path:
        """Write the model as a functional mock-up unit (FMI), which simulators of other tools import, and return its path.

        path              of the file; its name without `.fmu` is that of the unit, a C identifier
        x0                states at the start; discrete states may be left out
        controls, params  values at the start, zeros where they are left out; controls are inputs, parameters can be tuned
        version           2 for FMI 2.0, 3 for FMI 3.0
        rtol, atol        tolerances of co-simulation; importers may ask for another relative one
        duration          usual length of a simulation

        One file serves model exchange and co-simulation. In co-simulation the engine of the library makes the steps. In model exchange the importer
        does: event indicators stay positive as long as the modes hold, and behind an event the library says which modes follow, with
        transitions, resets and sliding modes. The unit holds a copy of the shared library, for this platform. Raises `StateError` where the model
        calls functions of its own. FMI: Functional Mock-up Interface, versions 2.0.4 and 3.0.2, Modelica Association.
        """
        s = self.system()
        path = Path(path)
        x = s._start(x0, "x0")
        u = numpy.zeros(self.nu) if controls is None else s._controls(controls)
        p = numpy.zeros(self.np) if params is None else s._params(params)
        self._build()._do(
            "write_fmu",
            os.fsencode(path),
            os.fsencode(file_of()),
            index(version, "version"),
            *(part for v in (x, u, p) for part in (address(v), v.size)),
            number(rtol, "rtol"),
            number(atol, "atol"),
            number(duration, "duration"),
        )
        return path

    def to_json(self) -> str:
        """The model as a document in JSON: for bug reports, and to pass it on; with its transitions, with its discrete
        states, the values they begin with, and the names of the states of an `Automaton` (see `Automaton.of`)."""
        return text(lib.swb_model_to_json, self._build())

    @classmethod
    def from_json(cls, document: str, functions: Iterable[Function] = ()) -> Model:
        """A model from a document. Functions that it calls are not in it: they are supplied, and found by name."""
        reader = Reader(document, functions)
        saved: Any = reader.data().get("model")
        try:
            n = len(saved["derivatives"]["roots"])
        except (TypeError, KeyError):
            n = 0  # the library says what is wrong
        graph = Graph()
        graph._functions.extend(reader.functions)
        rhs = numpy.empty(n, dtype=numpy.int64)
        made = _Built.__new__(_Built)
        made._make(lib.swb_model_from_json, graph, *reader.arguments, address(rhs), rhs.size)
        names = saved.get("names") or {}

        def named(block: str, n: int) -> list[str]:
            given = names.get(block, [])[:n]
            return given + [""] * (n - len(given))

        n_controls, n_parameters = saved["controls"], saved["parameters"]
        groups = named("states", rhs.size), named("controls", n_controls), named("parameters", n_parameters)
        model = cls(*groups, name=saved["name"], _graph=graph)
        model._rhs = [graph._expr(numpy.array(i)) for i in rhs]
        trial = saved.get("trial")
        if trial is not None:
            model.try_at(trial["x"], trial["u"], trial["p"], trial["t"])
        counts = [ctypes.c_int64(), ctypes.c_int64()]
        made._do("transition_counts", *(ctypes.byref(n) for n in counts))
        initial = numpy.empty(counts[0].value)
        made._do("get_discrete", address(initial), initial.size)
        model._discrete = initial.tolist()
        for k in range(initial.size):
            values = text(lib.swb_model_get_value_names, made, k)
            if values:
                model._value_names[model.nx - initial.size + k] = tuple(values.split("\n"))
        model._transitions = [_Transition.read(made, graph, k) for k in range(counts[1].value)]
        model._choices = [(c["control"], tuple(c["values"]), c.get("dwell", 0.0)) for c in saved.get("choices", ())]
        model._made = made
        return model

    @classmethod
    def from_casadi(
        cls, x: Any, u: Any = None, p: Any = None, rhs: Any = None, t: Any = None, name: str = "model"
    ) -> Model:
        """A model from expressions of CasADi (SX or MX): symbols of states, controls, parameters and the time, or lists of
        symbols, and the derivatives of the states. `sign`, `fabs`, `fmin`, `fmax`, `if_else` and comparisons become modes; the
        names of the symbols become those of the variables.

        Expressions are read operator by operator. Functions that cannot be written out in scalars, such as root finders and
        tables, are refused: `casadi.Function` objects with these are functions of a `System`."""
        from . import _casadi_model as reader

        groups = [reader.stacked(v) for v in (x, u, p)]
        model = cls(*(reader.names_of(g) for g in groups), name=name)
        time = reader.stacked(t)
        blocks = [*zip(groups, (model.x, model.u, model.p)), (time, model.t.reshape(1))]
        given = reader.read(model.graph, blocks, reader.stacked(rhs))
        model.derivatives = [e for part in given for e in part]
        return model

    def __reduce__(self) -> Any:
        if self.graph._functions:
            raise TypeError("a model that calls functions cannot be pickled: use to_json, and from_json with the functions")
        return Model.from_json, (self.to_json(),)

    def __repr__(self) -> str:
        return f"<Model '{self.name}': {self.nx} states, {self.nu} controls, {self.np} parameters>"

    def _repr_html_(self) -> str:
        from .recorded import facts_html

        sizes = (("states", self.nx), ("controls", self.nu), ("parameters", self.np))
        facts = {what: f"{n}: {', '.join(own)}" if any(own) else n for (what, n), own in zip(sizes, self.names)}
        try:
            report = str(self.report())
        except SwitchbackError:  # not finished yet
            report = ""
        return facts_html(f"Model {self.name}", facts) + (f"<pre>{html.escape(report)}</pre>" if report else "")


def system_of(system: Any) -> System:
    """A system, or that of a model or a scene."""
    from .scene import Projected, Scene

    if isinstance(system, (Model, Projected, Scene)):
        return system.system()
    if not isinstance(system, System):
        raise ArgumentError(f"system must be a System, a Model or a Scene, not {type(system).__name__}")
    check_captured(system._functions)
    return system
