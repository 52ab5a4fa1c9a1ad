"""Nonlinear programs with and without complementarity constraints."""

from __future__ import annotations

import ctypes
import json
from dataclasses import dataclass, field
from typing import Any, Callable, Iterable, Mapping, NamedTuple, Sequence

import numpy

from . import _ffi, casadi
from ._arrays import Array, address, bounds, index, real, seen, vector
from ._call import encode, failed, text
from ._ffi import Item, Member, Outcome, Polished, Sides
from ._library import lib
from ._logs import monitors, take_verbose
from ._solver import Solver
from .errors import ArgumentError, DimensionError, UnsupportedError
from .function import Function, _arguments, _Entries, _numbers, _pointer, _reader, _view, sparse_entries
from .recorded import facts_html
from .results import HasOutcome, LinearStats, OnIteration, OnLog, Residuals, Stats, outcome_name, polished_of
from .settings import Settings

__all__ = [
    "Certificate",
    "Conflict",
    "Mpcc",
    "MpccResult",
    "MpccTangents",
    "MpccWeights",
    "Multipliers",
    "Nlp",
    "PairMember",
    "ProgramItem",
    "constraint",
    "mcp",
    "minimize_mpcc",
    "variable",
]


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


class ProgramItem(NamedTuple):
    """A variable, constraint, pair or box, and by how much it is violated or how much it weighs."""

    kind: Item
    index: int
    name: str
    value: float


class Conflict(NamedTuple):
    """Constraints, bounds and pairs of an infeasible program that contradict each other, with weights, the heaviest
    first. Their weighted sum exceeds what the bounds allow by `gap`, with a gradient that bounds hold up to `residual`.
    """

    items: tuple[ProgramItem, ...]
    gap: float
    residual: float


@dataclass(frozen=True)
class Certificate:
    """Knowledge of a point: the strongest type of stationarity ("S", "M", "C", "A", "W", "none", "unknown") for
    which multipliers are known, `sharp` if there are none of a stronger type; `b_stationary` None if undecided, and
    `doubt` what that failed at. Without pairs "S" is a point of Karush, Kuhn and Tucker. `biactive` pairs have both members zero; `strict` if none of their multipliers is."""

    stationarity: str
    sharp: bool
    b_stationary: bool | None
    doubt: str
    biactive: int
    min_multiplier: float
    strict: bool
    lps: int
    lp_iterations: int
    nodes: int
    #: "strict_minimum", "saddle", "undecided", or "unknown" where the type of stationarity is not S or was not asked for.
    second_order: str
    #: Active constraints and bounds whose gradients depend on those of others.
    dependent: int
    #: No point of the program has a lower objective than this, as branch and bound has shown (option `branch_work`); -inf where
    #: nothing is shown.
    bound: float

    @classmethod
    def _of(cls, c: Any) -> Certificate:
        return cls(
            (lib.swb_stationarity_name(c.stationarity) or b"unknown").decode(),
            bool(c.sharp),
            {0: True, 1: False}.get(c.b_stationarity),
            (lib.swb_doubt_name(c.doubt) or b"unknown").decode(),
            c.biactive,
            c.min_multiplier,
            bool(c.strict),
            c.lps,
            c.lp_iterations,
            c.nodes,
            (lib.swb_second_order_name(c.second_order) or b"unknown").decode(),
            c.dependent,
            c.bound,
        )


class MpccTangents(NamedTuple):
    """Derivatives of a solution with respect to its parameters: of the point [n, np] and the objective [np]. Each holds on the `sides`
    of its parameter (`Sides`); where that is `Sides.NEITHER` it is not known and NaN."""

    x: Array
    objective: Array
    sides: tuple[Sides, ...]


class MpccWeights(NamedTuple):
    """The derivative of a solution with respect to its parameters, multiplied from the left by weights of point and objective: [np].
    Each holds on the `sides` of its parameter; where that is `Sides.NEITHER` it is not known and NaN."""

    p: Array
    sides: tuple[Sides, ...]


class Multipliers(NamedTuple):
    """Multipliers: grad f + J' constraints - bounds = 0; `g`, `h` are those of the members of the pairs."""

    constraints: Array
    bounds: Array
    g: Array
    h: Array


@dataclass(frozen=True, repr=False)
class MpccResult(HasOutcome):
    """Result of a solve. Multipliers: grad f + J' y - z = 0; those of a pair (G, H) are nu and xi."""

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
    scaled_residuals: Residuals = field(repr=False)
    linear_stats: LinearStats = field(repr=False)
    certificate: Certificate = field(repr=False)
    conflict: Conflict | None = field(repr=False)
    violations: tuple[ProgramItem, ...] = field(repr=False)
    report: str = field(repr=False)
    _json: str = field(repr=False)

    def _repr_html_(self) -> str:
        facts = {
            "outcome": outcome_name(self.outcome),
            "success": self.success,
            "objective": self.objective,
            "variables, constraints, pairs": f"{len(self.x)}, {len(self.constraints)}, {len(self.g)}",
            "stationarity": self.stationarity,
            "iterations": self.stats.iterations,
        }
        return facts_html(type(self).__name__, facts)

    def __repr__(self) -> str:
        n = f"{len(self.x)} variables, {len(self.constraints)} constraints, {len(self.g)} pairs"
        kind = f", {self.stationarity}-stationary" if len(self.g) and self.stationarity not in ("none", "unknown") else ""
        return f"<MpccResult {outcome_name(self.outcome)}, objective {self.objective:.9g}, {n}{kind}>"

    @property
    def multipliers(self) -> Multipliers:
        """All multipliers together."""
        return Multipliers(self.y, self.z, self.nu, self.xi)

    @property
    def stationarity(self) -> str:
        """The strongest type of stationarity known, such as "S"; see `certificate`."""
        return self.certificate.stationarity

    @property
    def b_stationary(self) -> bool | None:
        """True where there is no descent to first order. None if that is not decided."""
        return self.certificate.b_stationary

    def worst(self, k: int = 5) -> tuple[ProgramItem, ...]:
        """The k constraints, bounds and pairs that are violated most, with their violations."""
        return self.violations[: max(index(k, "k"), 0)]

    @property
    def warnings(self) -> list[str]:
        """Doubts about the program: gradients that are zero, dependent or badly scaled."""
        return json.loads(self._json)["warnings"]

    def to_json(self) -> str:
        """Everything but the point, as the JSON text described in docs/mpcc.md."""
        return self._json


def _lagrangian(f: Callable[..., Any], entries: _Entries, n: int, np: int, m: int) -> Any:
    """The callback of a Hessian of the Lagrangian."""
    what = "hessian of the Lagrangian"
    names = _arguments(f, ("x", "p", "weight", "y"), what)
    read = _reader([k for k in names if k in ("x", "p")], {"x": n, "p": np})
    places = [(names.index(k), k) for k in names if k in ("weight", "y")]
    rows, columns, order, pointers, listed = (
        entries.rows,
        entries.columns,
        entries.order,
        entries.pointers,
        entries.listed,
    )
    nnz = len(rows)
    outputs: dict[int, Array] = {}
    multipliers: dict[int, Array] = {}

    def take(result: Any) -> Array:
        sparse = hasattr(result, "tocsr")
        if not sparse:
            result = _numbers(result, what)
            if listed and result.shape == (nnz,):
                return result[order]
        if result.shape != (n, n):
            expected = f"({n}, {n})" + (f" or {nnz} values" if listed else "")
            raise DimensionError(f"{what} returned an array of shape {result.shape}, expected {expected}")
        return sparse_entries(result, rows, columns, pointers) if sparse else result[rows, columns]

    def fill(at: int, weight: float, y: int | None, out: int | None, _: Any) -> int:
        try:
            values = read(at)
            for place, name in places:
                if name == "weight":
                    values.insert(place, weight)
                else:
                    values.insert(place, _view(multipliers, y, m).copy() if y and m else numpy.empty(0))
            taken = take(f(*values))
            if nnz and out:
                _view(outputs, out, nnz)[:] = taken
            return 0
        except BaseException as error:
            return failed(error)

    return _ffi.swb_lagrangian_fn(fill)


class Mpcc(Solver):
    """Minimise f(x, p) subject to bounds on x and c(x, p), 0 <= G _|_ H >= 0 for pairs of variables or rows of c, and boxes
    lower <= x_i <= upper _|_ c_j.

    The functions may call the variables x or w. `n_constraints` is needed if the constraints are a callable and their
    bounds do not tell it. Bounds are (lower, upper), None is no bound, one number is for all. A member of a pair is
    `variable(i)`, or just i, or `constraint(i)`. A box is (i, j), the numbers of a variable and a constraint. Options by
    `settings` or by keyword.

    Derivatives of callables: `gradient` of the objective; `jacobian` of the constraints, dense or of scipy.sparse, with
    a row for each and a column for each of x; `hessian(x, weight, y)` of weight times the objective plus y times the
    constraints, n by n, in place of those of the functions (`set_hessian`). What is missing is made by differences.
    Patterns are those of `Function`; entries outside are taken as zero.
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
        gradient: Callable[..., Any] | None = None,
        gradient_pattern: Any = None,
        jacobian: Callable[..., Any] | None = None,
        jacobian_pattern: Any = None,
        hessian: Callable[..., Any] | None = None,
        hessian_pattern: Any = None,
        pairs: Iterable[tuple[Any, Any]] = (),
        boxes: Iterable[tuple[int, int]] = (),
        bounds: tuple[Any, Any] | None = None,
        constraint_bounds: tuple[Any, Any] | None = None,
        start: Any = None,
        params: Any = None,
        names: Sequence[str | None] | None = None,
        constraint_names: Sequence[str | None] | None = None,
        pair_names: Sequence[str | None] | None = None,
        box_names: Sequence[str | None] | None = None,
        on_iteration: OnIteration | None = None,
        on_log: OnLog | None = None,
        **options: Any,
    ):
        self.n, self.np = index(n, "n"), index(np, "np")
        for pair, name in ((bounds, "bounds"), (constraint_bounds, "constraint_bounds")):
            if pair is not None and (not isinstance(pair, (tuple, list)) or len(pair) != 2):
                raise DimensionError(f"{name} must be (lower, upper)")
        whole = hessian is not None
        f = self._function(objective, 1, "objective", gradient, gradient_pattern, whole)
        c = None
        self.m = 0
        if constraints is not None:
            rows = self._rows(constraints, n_constraints, constraint_bounds)
            c = self._function(constraints, rows, "constraints", jacobian, jacobian_pattern, whole)
            self.m = c.n_out
        elif jacobian is not None or jacobian_pattern is not None:
            raise ArgumentError("jacobian: there are no constraints")
        verbose = take_verbose(options)
        chosen = Settings._from(settings, options)
        on_log, on_iteration = monitors(chosen, verbose, on_log, on_iteration)
        self._create(self.n, self.np, f, c, ctypes.byref(chosen._c))
        self._functions = [f, c]
        self.n_pairs = self.n_boxes = 0
        self._hessian: Any = None
        if whole:
            self.set_hessian(hessian, hessian_pattern)
        elif hessian_pattern is not None:
            raise ArgumentError("hessian_pattern without hessian: give the patterns of the functions' own Hessians")
        self._monitors(on_iteration, on_log)
        for pair in pairs:
            if not isinstance(pair, (tuple, list)) or len(pair) != 2:
                raise DimensionError(f"a pair must have two members, not {pair!r:.60}")
            self.add_pair(*pair)
        for box in boxes:
            if not isinstance(box, (tuple, list)) or len(box) != 2:
                raise DimensionError(f"a box must have a variable and a constraint, not {box!r:.60}")
            self.add_box(*box)
        if bounds is not None:
            self.set_bounds(*bounds)
        if constraint_bounds is not None:
            self.set_constraint_bounds(*constraint_bounds)
        if params is not None:
            self.set_params(params)
        if start is not None:
            self.set_start(start)
        kinds = (Item.VARIABLE, Item.CONSTRAINT, Item.PAIR, Item.BOX)
        for kind, given in zip(kinds, (names, constraint_names, pair_names, box_names)):
            if given is not None:
                self.set_names(kind, given)

    def _function(self, f: Any, n_out: int, name: str, jacobian: Any, pattern: Any, linear: bool) -> Function:
        """Objective or constraints. With a Hessian of the Lagrangian no second derivatives of their own are made."""
        sizes = (self.n, 0, self.np)
        if not callable(f) or isinstance(f, Function) or casadi.is_function(f):
            if jacobian is not None or pattern is not None:
                which = "gradient" if name == "objective" else "jacobian"
                raise ArgumentError(f"{which}: {name} is no callable of Python; give its derivatives to Function")
            return Function._of(f, sizes, n_out, name)
        return Function(f, *sizes, n_out, jacobian=jacobian, jacobian_pattern=pattern, linear=linear, name=name)

    @staticmethod
    def _rows(constraints: Any, n: int | None, limits: Any) -> int:
        if n is not None:
            return index(n, "n_constraints")
        if isinstance(constraints, Function):
            return constraints.n_out
        if casadi.is_function(constraints):
            return sum(constraints.numel_out(k) for k in range(constraints.n_out()))
        if isinstance(constraints, (list, tuple)) and all(callable(g) for g in constraints):
            return len(constraints)
        sizes = {seen(b, "constraint_bounds").size for b in limits or () if b is not None and numpy.ndim(b) > 0}
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

    def add_box(self, i: int, j: int) -> None:
        """Add the box lower <= x_i <= upper _|_ c_j of variable i and constraint j: the constraint is not negative where the
        variable is at its lower bound, not positive at its upper bound, and zero between them. Infinite bounds take no part."""
        self._do("add_box", index(i, "index of a variable"), index(j, "index of a constraint"))
        self.n_boxes += 1

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

    def set_hessian(self, hessian: Any, pattern: Any = None, *, user_data: int | None = None, keep: Any = None) -> None:
        """Give second derivatives in one piece, in place of those of objective and constraints; None takes them away.

        `hessian` is a callable of those of x, p, weight and y that it needs, which returns the symmetric n by n matrix
        of second derivatives of weight * objective + y @ constraints, dense or of scipy.sparse, or its upper triangle;
        or a pointer to a swb_lagrangian_fn. `pattern`: rows and columns of the upper triangle as a tuple, and then
        the callable may return the values in this order; or a matrix that is zero where the Hessian always is; dense
        without one. A pointer writes the entries column by column; `keep` is kept alive with it.
        """
        if hessian is None:
            self._do("set_hessian", None, 0, None, 0, _ffi.swb_lagrangian_fn(0), None)
            self._hessian = None
            return
        what = "hessian of the Lagrangian"
        full = numpy.ones((self.n, self.n)) if pattern is None else pattern
        entries = _Entries(full, self.n, self.n, True, what)
        compiled = isinstance(hessian, (int, ctypes._CFuncPtr))  # type: ignore[attr-defined]
        if compiled:
            callback = _pointer(_ffi.swb_lagrangian_fn, hessian, what)
        else:
            callback = _lagrangian(hessian, entries, self.n, self.np, self.m)
        pointers, rows = entries.pointers, numpy.ascontiguousarray(entries.rows)
        self._do(
            "set_hessian", address(pointers), len(pointers), address(rows), len(rows), callback, user_data
        )
        self._hessian = (callback, keep)

    def set_names(self, kind: Item, names: Sequence[str | None]) -> None:
        """Name all variables, constraints, pairs or boxes; None for no name. Reports and the log use them."""
        texts = [None if name is None else encode(name, "name") for name in names]
        self._do("set_names", int(kind), (ctypes.c_char_p * len(texts))(*texts), len(texts))

    def set_name(self, kind: Item, i: int, name: str | None) -> None:
        """Name a variable, a constraint, a pair or a box."""
        self._do("set_name", int(kind), index(i, "index"), None if name is None else encode(name, "name"))

    def name(self, kind: Item, i: int) -> str:
        """Name of a variable, a constraint, a pair or a box, such as "variable 3" without one."""
        return text(lib.swb_mpcc_get_name, self, int(kind), index(i, "index"))

    def _items(self, which: str, *more: Any) -> tuple[ProgramItem, ...]:
        found = ctypes.c_int64()
        self._do(which, None, None, None, 0, ctypes.byref(found), *(None for _ in more))
        n = found.value
        kinds, places, values = numpy.empty(n, numpy.int32), numpy.empty(n, numpy.int64), numpy.empty(n)
        self._do(which, address(kinds), address(places), address(values), n, None, *more)
        return tuple(
            ProgramItem(Item(k), i, self.name(k, i), v)
            for k, i, v in zip(kinds.tolist(), places.tolist(), values.tolist())
        )

    def _conflict(self) -> Conflict | None:
        gap, residual = ctypes.c_double(), ctypes.c_double()
        items = self._items("get_conflict", ctypes.byref(gap), ctypes.byref(residual))
        return Conflict(items, gap.value, residual.value) if items else None

    def set_warm_start(self, x: Any, y: Any = None, z: Any = None) -> None:
        """Start the next solves from a point with multipliers of the constraints and of the bounds, as a result of a
        program nearby has them; `set_start` goes back to a point alone."""
        point = vector(x, self.n, "x")
        y_array = numpy.empty(0) if y is None else vector(y, self.m, "y")
        z_array = numpy.empty(0) if z is None else vector(z, self.n, "z")
        self._do(
            "set_warm_start", address(point), self.n, address(y_array), len(y_array), address(z_array), len(z_array)
        )

    def tangents(self) -> MpccTangents:
        """Derivatives of the last solution with respect to all parameters, while active bounds and the sides of pairs stay as they are.
        The solution must be exact (`result.polished` is done, or there are no pairs), or StateError; derivatives that callables
        have must be those by the parameters as well, or NumericError. NumericError too if the solution is not isolated."""
        x, f, sides = numpy.empty((self.np, self.n)), numpy.empty(self.np), numpy.empty(self.np, numpy.int32)
        self._do("get_tangents", address(x), x.size, address(f), f.size, address(sides), sides.size)
        return MpccTangents(x.T.copy(), f, tuple(Sides(s) for s in sides.tolist()))

    def vjp(self, x: Any = None, objective: float = 0.0) -> MpccWeights:
        """The derivative of the last solution with respect to its parameters from the left (a vector-Jacobian product): the derivatives of
        a number that depends on point and objective, of which `x` [n] and `objective` are the derivatives by these. One solve for all
        parameters where the solution is differentiable. Errors: those of `tangents`."""
        given = numpy.empty(0) if x is None else vector(x, self.n, "x")
        p, sides = numpy.empty(self.np), numpy.empty(self.np, numpy.int32)
        weight = real(objective, "objective")
        if weight.ndim:
            raise DimensionError("objective: its weight is a number")
        self._do("vjp", address(given), given.size, float(weight), address(p), p.size, address(sides), sides.size)
        return MpccWeights(p, tuple(Sides(s) for s in sides.tolist()))

    def resolve(self) -> MpccResult:
        """Solve from the last solution and its multipliers, as after a change of parameters or bounds."""
        self._solve("resolve")
        return self.result

    def solve(self) -> MpccResult:
        """Solve. Look at `result.success`: the outcome may be another one than solved."""
        self._solve("solve")
        return self.result

    @property
    def result(self) -> MpccResult:
        """Result of the last solve."""
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
            Residuals._of(self._struct("get_scaled_residuals", _ffi.swb_residuals)),
            LinearStats._of(self._struct("get_linear_stats", _ffi.swb_linear_stats)),
            Certificate._of(self._struct("get_certificate", _ffi.swb_certificate)),
            self._conflict(),
            self._items("get_worst"),
            text(lib.swb_mpcc_report_text, self),
            text(lib.swb_mpcc_statistics_json, self),
        )

    def __repr__(self) -> str:
        boxes = f", {self.n_boxes} boxes" if self.n_boxes else ""
        return f"<{type(self).__name__} n={self.n} m={self.m}, {self.n_pairs} pairs{boxes}>"


class Nlp(Mpcc):
    """A nonlinear program: an `Mpcc` without pairs."""

    def add_pair(self, g: Any, h: Any) -> None:
        raise UnsupportedError("a nonlinear program has no pairs: use Mpcc")

    def add_box(self, i: int, j: int) -> None:
        raise UnsupportedError("a nonlinear program has no boxes: use Mpcc")


def minimize_mpcc(
    objective: Any, x0: Any, pairs: Iterable[tuple[Any, Any]] = (), constraints: Any = None, **arguments: Any
) -> MpccResult:
    """Minimise a function once from x0; all other arguments are those of `Mpcc`."""
    start = numpy.atleast_1d(real(x0, "x0"))
    with Mpcc(start.size, objective, constraints, pairs=pairs, start=start, **arguments) as program:
        return program.solve()


def mcp(f: Any, lower: Any, upper: Any = None, x0: Any = None, **arguments: Any) -> MpccResult:
    """Solve a mixed complementarity problem: the point x at which every row of f(x, p) is not negative where its variable is
    at its lower bound, not positive at its upper bound, and zero between them.

    `f` has a row for every variable: a callable, expressions, a `Function`. `lower` and `upper` are [n], None or infinite for
    no bound, one number for all if the other or `x0` has n numbers. lower = 0 without upper bounds is a nonlinear
    complementarity problem, and a linear one if f is `Function.affine(q, M, nx=n)`. The start is the point between the bounds that is
    nearest to zero if it is not given. All other arguments are those of `Mpcc`: `jacobian` is that of f. The result has f at x as
    `constraints`."""
    for name in ("pairs", "boxes", "bounds", "constraint_bounds", "n_constraints", "start"):
        if name in arguments:
            raise ArgumentError(f"{name}: a complementarity problem has none of its own; use Mpcc with boxes")
    sizes = {seen(b, "a bound or x0").size for b in (lower, upper, x0) if b is not None and numpy.ndim(b) > 0}
    if len(sizes) != 1:
        found = f"sizes {sorted(sizes)}" if sizes else "one number for all"
        raise DimensionError(f"lower, upper and x0 must tell the number of variables, and have {found}: give arrays of one length")
    n = sizes.pop()
    low, high = bounds(lower, upper, n, "bounds")
    start = numpy.clip(0.0, low, high) if x0 is None else x0
    rows = [(i, i) for i in range(n)]
    with Mpcc(n, 0.0, f, n, boxes=rows, bounds=(low, high), start=start, **arguments) as program:
        return program.solve()
