"""Expressions of CasADi, read instruction by instruction as expressions of a model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy

from . import expr
from .errors import ArgumentError, UnsupportedError
from .expr import Expr, Graph

__all__ = ["names_of", "read", "stacked"]


def stacked(value: Any) -> list[Any]:
    """The symbols of a block: a symbol, a column of them, a list, or None."""
    if value is None:
        return []
    return list(value) if isinstance(value, (list, tuple)) else [value]


def names_of(symbols: Sequence[Any]) -> list[str]:
    """Names of the entries of symbols; "" for all where two are the same."""
    names: list[str] = []
    for s in symbols:
        n = s.numel()
        if s.type_name() == "SX":
            names += [s[i].name() for i in range(n)]
        else:
            names += [s.name()] if n == 1 else [f"{s.name()}_{i}" for i in range(n)]
    names = ["".join(c if c.isalnum() or c == "_" else "_" for c in n) for n in names]
    return names if len(set(names)) == len(names) else [""] * len(names)


def read(graph: Graph, blocks: Sequence[tuple[Sequence[Any], Expr]], outputs: Sequence[Any]) -> list[Expr]:
    """Expressions of CasADi as flat arrays of a graph: an array for each of `outputs`, where the symbols of every block, by
    columns, are the entries of an array of the graph."""
    import casadi as ca

    symbols = [s for group, _ in blocks for s in group]
    values = [e[i] for group, e in blocks for i in range(sum(s.numel() for s in group))]
    try:
        columns = [ca.vec(ca.densify(y)) for y in outputs]
        f = ca.Function("model", symbols, columns)
    except (RuntimeError, NotImplementedError) as error:
        reason = str(error).splitlines()[-1] if str(error) else type(error).__name__
        raise ArgumentError(
            f"the expressions depend on other symbols than those given, or these are no symbols ({reason:.200}): give x, u, p and t as "
            "symbols or lists of symbols"
        ) from None
    if f.class_name() == "MXFunction":
        try:
            f = f.expand()
        except RuntimeError as error:
            raise UnsupportedError(
                f"the expressions call functions that cannot be written out in scalars ({str(error).splitlines()[-1]:.200}): make a "
                "System of casadi.Function objects instead, which may call root finders and tables"
            ) from None
    return _Reader(graph, f).run(values)


class _Reader:
    """Follows the instructions of an SX function."""

    def __init__(self, graph: Graph, f: Any):
        import casadi as ca

        self.graph, self.f = graph, f
        self.names = {getattr(ca, n): n[3:] for n in dir(ca) if n.startswith("OP_")}
        self.work: dict[int, Expr] = {}
        #: For values that are `a where c, else 0`: condition and value.
        self.chosen: dict[int, tuple[Expr, Expr]] = {}

    def run(self, values: Sequence[Expr]) -> list[Expr]:
        f = self.f
        sizes = [f.numel_in(i) for i in range(f.n_in())]
        starts = numpy.concatenate([[0], numpy.cumsum(sizes)]).astype(int)
        out: list[list[Any]] = [[0.0] * f.numel_out(i) for i in range(f.n_out())]
        for k in range(f.n_instructions()):
            name = self.names[f.instruction_id(k)]
            source, target = f.instruction_input(k), f.instruction_output(k)
            if name == "OUTPUT":
                out[target[0]][target[1]] = self._value(self.work[source[0]])
                continue
            if name == "INPUT":
                made = values[starts[source[0]] + source[1]]
            elif name == "CONST":
                made = self.graph.constant(f.instruction_constant(k))
            else:
                made = self._apply(name, list(source))
            choice = self._choice(name, list(source))
            self.work[target[0]] = made
            self.chosen.pop(target[0], None)
            if choice is not None:
                self.chosen[target[0]] = choice
        return [self.graph.of(o) if o else self.graph.constant([]) for o in out]

    def _value(self, a: Expr) -> Expr:
        """A condition as 1 or 0."""
        return expr.where(a, 1.0, 0.0) if a._condition else a

    def _condition(self, a: Expr) -> Expr:
        if a._condition:
            return a
        raise UnsupportedError(
            "a number is used as a condition: compare it, if_else(a > 0, ...), for what is zero or not is no region"
        )

    def _choice(self, name: str, source: list[int]) -> tuple[Expr, Expr] | None:
        if name != "IF_ELSE_ZERO":
            return None
        return self._condition(self.work[source[0]]), self._value(self.work[source[1]])

    def _apply(self, name: str, source: list[int]) -> Expr:
        a = self.work[source[0]]
        b = self.work[source[1]] if len(source) > 1 else None
        if name in ("LT", "LE"):
            return self._value(b) > self._value(a)  # type: ignore[arg-type]
        if name == "NOT":
            return ~self._condition(a)
        if name in ("AND", "OR"):
            left, right = self._condition(a), self._condition(b)  # type: ignore[arg-type]
            return left & right if name == "AND" else left | right
        if name == "IF_ELSE_ZERO":
            return expr.where(self._condition(a), self._value(b), 0.0)  # type: ignore[arg-type]
        if name == "ADD" and source[0] in self.chosen and source[1] in self.chosen:
            (c, left), (d, right) = self.chosen[source[0]], self.chosen[source[1]]
            if d == ~c or c == ~d:  # if_else: both sides of one condition
                return expr.where(c, left, right)
        if name == "MUL" and b is not None and a._condition != b._condition:
            return expr.where(a, b, 0.0) if a._condition else expr.where(b, a, 0.0)
        f = _OPERATORS.get(name)
        if f is None:
            hint = "; it jumps at infinitely many places" if name in ("FLOOR", "CEIL", "FMOD", "REMAINDER") else ""
            hint = "; equality holds on a surface only, compare by < or >" if name in ("EQ", "NE") else hint
            raise UnsupportedError(f"the expressions contain the operator {name.lower()} of CasADi, which a model does not have{hint}")
        return f(*(self._value(self.work[i]) for i in source))


_OPERATORS: dict[str, Callable[..., Expr]] = {
    "ASSIGN": lambda a: a,
    "LIFT": lambda a, b: a,
    "ADD": lambda a, b: a + b,
    "SUB": lambda a, b: a - b,
    "MUL": lambda a, b: a * b,
    "DIV": lambda a, b: a / b,
    "NEG": lambda a: -a,
    "INV": lambda a: 1.0 / a,
    "SQ": lambda a: a**2,
    "TWICE": lambda a: 2.0 * a,
    "POW": lambda a, b: a**b,
    "CONSTPOW": lambda a, b: a**b,
    "SQRT": expr.sqrt,
    "EXP": expr.exp,
    "EXPM1": lambda a: expr.exp(a) - 1.0,
    "LOG": expr.log,
    "LOG1P": lambda a: expr.log(1.0 + a),
    "SIN": expr.sin,
    "COS": expr.cos,
    "TAN": expr.tan,
    "ASIN": expr.asin,
    "ACOS": expr.acos,
    "ATAN": expr.atan,
    "SINH": expr.sinh,
    "COSH": expr.cosh,
    "TANH": expr.tanh,
    "ASINH": lambda a: expr.log(a + expr.sqrt(a**2 + 1.0)),
    "ACOSH": lambda a: expr.log(a + expr.sqrt(a**2 - 1.0)),
    "ATANH": lambda a: 0.5 * expr.log((1.0 + a) / (1.0 - a)),
    "ERF": expr.erf,
    "ATAN2": expr.atan2,
    "HYPOT": lambda a, b: expr.sqrt(a**2 + b**2),
    "FABS": abs,
    "SIGN": expr.sign,
    "FMIN": expr.minimum,
    "FMAX": expr.maximum,
    "COPYSIGN": lambda a, b: abs(a) * expr.sign(b),
}
