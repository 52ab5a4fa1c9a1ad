"""What an optimal control problem can be made of beside costs and constraints of one kind; free lengths, parameters."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy

from ._arrays import address, bounds, choice, index, number, real, seen, table, vector
from ._ffi import CostAt, FreeTime, Norm, PathAt, swb_certificate
from ._solver import Solver
from .errors import ArgumentError, DimensionError
from .expr import _graph_among
from .function import Function
from .mpcc import Certificate

class OcpTerms(Solver):
    """Methods of `Ocp` that state the problem further."""

    nx: int
    nu: int
    np: int
    n_stages: int
    _functions: list[Function]
    _system: Any

    def _function(self, f: Any, n_out: int, name: str) -> Function:
        return Function._of(self._expressions(f, name), (self.nx, self.nu, self.np), n_out, name)

    def _constraint(self, f: Any, n_out: int, name: str) -> Function:
        """A function that is bounded: constants are what they are."""
        made = self._function(f, n_out, name)
        if not isinstance(f, Function) or f.name == name:
            made._require_rows(name, "give an expression or function of the model and its bounds, as in add_terminal(m.q, 1, 1)")
        return made

    def _expressions(self, f: Any, name: str) -> Any:
        """Expressions of the model as a function; anything else as it is."""
        graph = _graph_among((f,))
        if graph is None:
            return f
        origin = self._system._origin if self._system is not None else None
        if origin is None or origin[0] is not graph:
            raise ArgumentError(f"{name}: these are not expressions of the model of this problem")
        self._refuse_block(f, name)
        return graph.function(f, self.nx, self.nu, self.np, name)

    def _refuse_block(self, f: Any, name: str) -> None:
        """Raises ArgumentError where all states stand in the place of the one called x, or controls or parameters likewise."""
        ids = getattr(f, "_ids", None)
        for names, block, what in zip(self._system._names, "xup", ("states", "controls", "parameters")):
            if len(names) > 1 and block in names and ids is not None and ids.shape == (len(names),):
                if (ids == self._system._origin[0].inputs(block, len(names))._ids).all():
                    raise ArgumentError(
                        f"{name}: this is the array of all {what}, not '{block}': write model['{block}'] for that, list(model.{block}) for all"
                    )

    @staticmethod
    def _rows(f: Any, lower: Any, upper: Any, name: str) -> int:
        if isinstance(f, Function):
            return f.n_out
        sizes = {seen(b, name).size for b in (lower, upper) if b is not None and numpy.ndim(b) > 0}
        if len(sizes) > 1:
            raise DimensionError(f"bounds of {name}: {' and '.join(map(str, sorted(sizes)))} numbers")
        return sizes.pop() if sizes else 1

    def add_boundary(self, f: Any, lower: Any = None, upper: Any = None) -> None:
        """Add the constraint lower <= f(x, u, p, t) <= upper between both ends of the horizon: x holds the initial state, then
        the final one."""
        if _graph_among((f,)) is not None:
            raise ArgumentError("a boundary constraint knows two states: give model.between_ends(lambda start, end: ...)")
        n = self._rows(f, lower, upper, "boundary constraint")
        function = Function._of(f, (2 * self.nx, self.nu, self.np), n, "boundary")
        if not isinstance(f, Function):
            function._require_rows("boundary", "give a function of both states, as model.between_ends(lambda start, end: end[0] - start[0])")
        low, high = bounds(lower, upper, n, "bounds of a boundary constraint")
        self._starts = True
        self._do("add_boundary", function, address(low), n, address(high), n)
        self._functions.append(function)

    def add_periodic(self, states: Any = None) -> None:
        """Require that states (their indices; None: all) have the same values at both ends of the horizon."""
        chosen = range(self.nx) if states is None else states
        array = numpy.array([index(i, "states") for i in chosen], dtype=numpy.int64)
        self._starts = True
        self._do("add_periodic", address(array), len(array))

    def add_least_squares(self, f: Any, weights: Any, references: Any = 0.0, at: CostAt | str = "running") -> None:
        """Add (f - y)' W (f - y) to the cost: integrated ("running"), summed over the ends of the control stages
        ("control_grid") or at the end ("terminal"). `weights` is the diagonal of W or all of it, `references` is y or has a
        row for every stage."""
        shape = seen(weights, "weights").shape or (1,)
        f = self._expressions(f, "least_squares")
        n = f.n_out if isinstance(f, Function) else shape[0]
        if shape not in ((n,), (n, n)) and not (n == 1 and seen(weights, "weights").size == 1):
            raise DimensionError(f"weights has shape {shape}, expected ({n},) or ({n}, {n})")
        function = self._function(f, n, "least_squares")
        w = numpy.atleast_1d(real(weights, "weights"))
        y = self._references(references, (1, n, self.n_stages * n))
        if y.size == 1:
            y = numpy.full(n, y.item())
        place = choice(CostAt, at, "at")
        self._do("add_least_squares", function, address(w), w.size, address(y), y.size, place)
        self._functions.append(function)

    @staticmethod
    def _references(references: Any, sizes: tuple[int, ...]) -> Any:
        array = seen(references, "references")
        if array.size not in sizes:
            wanted = " or ".join(map(str, dict.fromkeys(sizes)))
            raise DimensionError(f"references has shape {array.shape}, expected {wanted} numbers")
        return numpy.atleast_1d(real(array, "references"))

    def set_references(self, term: int, references: Any) -> None:
        """Change the references of a least-squares term, counted from 0 in the order they were added."""
        y = numpy.ascontiguousarray(numpy.atleast_1d(real(references, "references")))
        self._do("set_references", index(term, "term"), address(y), y.size)

    def add_relaxed(
        self,
        f: Any,
        lower: Any = None,
        upper: Any = None,
        at: PathAt | str = "terminal",
        norm: Norm | str = "l1",
        weight: float = 1e3,
    ) -> None:
        """Add a constraint that may be violated at the price `weight` times the norm ("l1", "l2", "linf") of the violation,
        at "terminal" or as in `add_path`. `result.violation` tells what is left; the cost is reported without the price."""
        f = self._expressions(f, "relaxed")
        n = self._rows(f, lower, upper, "relaxed constraint")
        function = self._constraint(f, n, "relaxed")
        low, high = bounds(lower, upper, n, "bounds of a relaxed constraint")
        place = -1 if at == "terminal" else int(choice(PathAt, at, "at"))
        kind = choice(Norm, norm, "norm")
        price = number(weight, "weight")
        self._do("add_relaxed", function, address(low), n, address(high), n, place, kind, price)
        self._functions.append(function)

    def add_complementarity(self, a: Any, b: Any, at: PathAt | str = PathAt.CONTROL_GRID, n: int = 1) -> None:
        """Add 0 <= a(x, u, p, t) and b(x, u, p, t) >= 0, one of which is zero, for each of their `n` outputs (callables only;
        functions know their number): at the ends of stages ("control_grid"), of "elements", or at "stage_points". Pairs
        of controls alone belong to the control grid."""
        a, b = self._expressions(a, "a"), self._expressions(b, "b")
        n = next((f.n_out for f in (a, b) if isinstance(f, Function)), index(n, "n"))
        first, second = self._function(a, n, "a"), self._function(b, n, "b")
        self._do("add_complementarity", first, second, choice(PathAt, at, "at"))
        self._functions += [first, second]

    def set_elements(self, n_fe: Any) -> None:
        """Set the number of finite elements of every control stage."""
        array = numpy.array([index(n, "n_fe") for n in n_fe], dtype=numpy.int64)
        self._do("set_elements", address(array), len(array))

    def set_durations(self, durations: Any) -> None:
        """Set the lengths of the control stages; where they are free, those to start from."""
        array = vector(durations, self.n_stages, "durations")
        self._do("set_durations", address(array), len(array))

    def set_free_time(self, what: FreeTime | str, lower: float, upper: float) -> None:
        """Let the optimiser choose the length of the "horizon" or of all "stages", between bounds of the horizon or of a
        stage."""
        self._do("set_free_time", choice(FreeTime, what, "what"), number(lower, "lower"), number(upper, "upper"))

    def add_horizon(self, lower: float, upper: float) -> None:
        """Bound the length of the horizon where those of the stages are free."""
        self._do("add_horizon", number(lower, "lower"), number(upper, "upper"))

    def set_linear_controls(self, linear: Any = True) -> None:
        """Make controls continuous and linear on every stage: True for all, or one truth value for each."""
        array = seen(linear, "linear")
        if array.shape not in ((), (1,), (self.nu,)):
            raise DimensionError(f"linear has shape {array.shape}, expected one truth value or ({self.nu},)")
        flags = numpy.broadcast_to(array.astype(bool), (self.nu,)).astype(numpy.int32)
        self._do("set_linear_controls", address(flags), len(flags))

    def set_param_bounds(self, lower: Any, upper: Any) -> None:
        """Make parameters with a lower bound below the upper one variables, which start at the values set."""
        low, high = bounds(lower, upper, self.np, "bounds of the parameters")
        self._do("set_param_bounds", address(low), self.np, address(high), self.np)

    def set_stage_params(self, p: Any) -> None:
        """Set parameters that change from stage to stage, a row for each."""
        array = table(p, self.n_stages, self.np, "p")
        self._do("set_stage_params", address(array), array.size)

    def shift(self) -> None:
        """Make the last solution, one control stage later, the guess of the next solve. `solve(warm=True)` then simulates it from
        the initial state that is set by then, and starts from its modes and switching times."""
        self._do("shift")

    @property
    def certificate(self) -> Certificate:
        """Knowledge of the last solution as a point of the discretised program; unknown unless it was polished."""
        return Certificate._of(self._struct("get_certificate", swb_certificate))

    def _vector(self, name: str, n: int) -> Any:
        out = numpy.empty(n)
        self._do(name, address(out), out.size)
        return out

    def _violation(self) -> float:
        return self._get("get_violation", ctypes.c_double)
