"""Nonlinear programs with and without complementarity constraints."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, field
from typing import Any, Iterable, Mapping, NamedTuple

import numpy

from ._arrays import Array, address, bounds, index, real, vector
from ._ffi import Member, Outcome, Polished
from ._solver import Solver
from .errors import ArgumentError, DimensionError, UnsupportedError
from .function import Function
from .results import HasOutcome, OnIteration, OnLog, Residuals, Stats, polished_of
from .settings import Settings

__all__ = ["Mpcc", "MpccResult", "Nlp", "PairMember", "constraint", "variable"]


class PairMember(NamedTuple):
    """A member of a complementarity pair; see `variable` and `constraint`."""

    kind: Member
    position: int


def variable(i: int) -> PairMember:
    """Variable i as a member of a pair; its lower bound becomes zero."""
    return PairMember(Member.VARIABLE, i)


def constraint(i: int) -> PairMember:
    """Row i of the constraints as a member of a pair; its own bounds are not used."""
    return PairMember(Member.CONSTRAINT, i)


@dataclass(frozen=True)
class MpccResult(HasOutcome):
    """What a solve found. Multipliers: grad f + J' y - z = 0; those of a pair (G, H) are nu and xi."""

    outcome: Outcome
    polished: Polished
    objective: float
    x: Array
    constraints: Array = field(repr=False)
    y: Array = field(repr=False)
    z: Array = field(repr=False)
    g: Array = field(repr=False)
    h: Array = field(repr=False)
    nu: Array = field(repr=False)
    xi: Array = field(repr=False)
    residuals: Residuals = field(repr=False)
    stats: Stats = field(repr=False)


class Mpcc(Solver):
    """Minimise f(x, p) subject to bounds on x and c(x, p), and 0 <= G _|_ H >= 0 for pairs of variables or rows of c.

    The functions may call the variables x or w. `n_constraints` is needed if the constraints are a callable and their
    bounds do not tell it. Bounds are (lower, upper), None is no bound, one number is for all. A member of a pair is
    `variable(i)`, or just i, or `constraint(i)`. Options by `settings` or by keyword.
    """

    _kind = "mpcc"

    def __init__(
        self,
        n: int,
        objective: Any,
        constraints: Any = None,
        n_constraints: int | None = None,
        np: int = 0,
        settings: Settings | Mapping[str, Any] | None = None,
        *,
        pairs: Iterable[tuple[Any, Any]] = (),
        bounds: tuple[Any, Any] | None = None,
        constraint_bounds: tuple[Any, Any] | None = None,
        start: Any = None,
        params: Any = None,
        on_iteration: OnIteration | None = None,
        on_log: OnLog | None = None,
        **options: Any,
    ):
        self.n, self.np = index(n, "n"), index(np, "np")
        for pair, name in ((bounds, "bounds"), (constraint_bounds, "constraint_bounds")):
            if pair is not None and (not isinstance(pair, (tuple, list)) or len(pair) != 2):
                raise DimensionError(f"{name} must be (lower, upper)")
        sizes = (self.n, 0, self.np)
        f = Function._of(objective, sizes, 1, "objective")
        c = None
        self.m = 0
        if constraints is not None:
            c = Function._of(
                constraints, sizes, self._rows(constraints, n_constraints, constraint_bounds), "constraints"
            )
            self.m = c.n_out
        chosen = Settings._from(settings, options)
        self._create(self.n, self.np, f, c, ctypes.byref(chosen._c))
        self._functions = [f, c]
        self.n_pairs = 0
        self._monitors(on_iteration, on_log)
        for pair in pairs:
            if not isinstance(pair, (tuple, list)) or len(pair) != 2:
                raise DimensionError(f"a pair must have two members, not {pair!r:.60}")
            self.add_pair(*pair)
        if bounds is not None:
            self.set_bounds(*bounds)
        if constraint_bounds is not None:
            self.set_constraint_bounds(*constraint_bounds)
        if params is not None:
            self.set_params(params)
        if start is not None:
            self.set_start(start)

    @staticmethod
    def _rows(constraints: Any, n: int | None, limits: Any) -> int:
        if n is not None:
            return index(n, "n_constraints")
        if isinstance(constraints, Function):
            return constraints.n_out
        if isinstance(constraints, (list, tuple)) and all(callable(g) for g in constraints):
            return len(constraints)
        sizes = {real(b, "constraint_bounds").size for b in limits or () if b is not None and numpy.ndim(b) > 0}
        if len(sizes) == 1:
            return sizes.pop()
        raise ArgumentError("n_constraints: the number of constraints must be given")

    @staticmethod
    def _member(member: Any) -> tuple[int, int]:
        if isinstance(member, tuple):
            if len(member) != 2:
                raise ArgumentError(f"a member of a pair is variable(i) or constraint(i), not {member!r:.60}")
            return index(member[0], "kind of a member"), index(member[1], "index of a member")
        return int(Member.VARIABLE), index(member, "index of a variable")

    def add_pair(self, g: Any, h: Any) -> None:
        """Add the pair 0 <= G _|_ H >= 0 of `variable(i)`, or just i, and `constraint(j)`."""
        self._do("add_pair", *self._member(g), *self._member(h))
        self.n_pairs += 1

    def set_bounds(self, lower: Any = None, upper: Any = None) -> None:
        """Set bounds of the variables."""
        low, high = bounds(lower, upper, self.n, "bounds")
        self._do("set_bounds", address(low), self.n, address(high), self.n)

    def set_constraint_bounds(self, lower: Any = None, upper: Any = None) -> None:
        """Set bounds of the constraints; equal bounds make an equation."""
        low, high = bounds(lower, upper, self.m, "bounds of the constraints")
        self._do("set_constraint_bounds", address(low), self.m, address(high), self.m)

    def set_params(self, p: Any) -> None:
        """Set the parameters."""
        array = vector(p, self.np, "p")
        self._do("set_params", address(array), len(array))

    def set_start(self, x: Any) -> None:
        """Set the point to start from."""
        array = vector(x, self.n, "start")
        self._do("set_start", address(array), len(array))

    def solve(self) -> MpccResult:
        """Solve. Look at `result.success`: the outcome may be another one than solved."""
        self._solve("solve")
        return self.result

    @property
    def result(self) -> MpccResult:
        """What the last solve found."""
        n, m, k = self.n, self.m, self.n_pairs
        x, z, c, y = numpy.empty(n), numpy.empty(n), numpy.empty(m), numpy.empty(m)
        g, h, nu, xi = (numpy.empty(k) for _ in range(4))
        self._do("get_solution", address(x), n)
        self._do("get_constraints", address(c), m)
        self._do("get_multipliers", address(y), m, address(z), n)
        self._do("get_pairs", address(g), address(h), address(nu), address(xi), k)
        return MpccResult(
            self.outcome,
            polished_of(self._get("get_polished", ctypes.c_int32)),
            self._get("get_objective", ctypes.c_double),
            x,
            c,
            y,
            z,
            g,
            h,
            nu,
            xi,
            self.residuals,
            self.stats,
        )

    def __repr__(self) -> str:
        return f"<{type(self).__name__} n={self.n} m={self.m}, {self.n_pairs} pairs>"


class Nlp(Mpcc):
    """A nonlinear program: an `Mpcc` without pairs."""

    def add_pair(self, g: Any, h: Any) -> None:
        raise UnsupportedError("a nonlinear program has no pairs: use Mpcc")
