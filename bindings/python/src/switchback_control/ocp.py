"""Optimal control."""

from __future__ import annotations

import ctypes
import warnings
from dataclasses import dataclass, field
from typing import Any, Iterable, Mapping, NamedTuple, Sequence

import numpy

from ._arrays import Array, address, bounds, choice, index, number, real, table, vector
from ._call import text
from ._document import Reader
from ._ffi import Jumps, MultipliersOf, Outcome, PathAt, Polished, swb_accuracy, swb_kink, swb_ocp_jump, swb_optimality
from ._foreign import Hints, of_ocp, refuse_of_solve
from ._library import lib
from ._logs import monitors, take_verbose
from ._names import filled, named_vector, pairs_by_name
from ._ocp_contacts import OcpContacts
from ._ocp_search import Adaptation, OcpSearch
from ._ocp_terms import OcpTerms
from .errors import ArgumentError, DimensionError, StateError
from .expr import Model, system_of
from .function import Function
from .recorded import OverElements, facts_html
from .results import Accuracy, HasOutcome, OnIteration, OnLog, Residuals, Stats, before_first_iterate, outcome_name, polished_of
from .settings import Settings
from .system import System
from .trajectory import Trajectory

__all__ = ["Kink", "Multipliers", "Ocp", "OcpJump", "OcpMultipliers", "OcpResult", "OcpSensitivity", "Optimality", "UnsetWarning"]


class UnsetWarning(UserWarning):
    """Something of an optimal control problem that is seldom meant to be free was not set."""


class OcpJump(NamedTuple):
    """A transition of an optimal control: states before and after. `at_once`: its guard was beyond zero where its discrete
    state began, or where the control changed."""

    t: float
    transition: int
    stage: int
    before: Array
    after: Array
    at_once: bool


class Kink(NamedTuple):
    """A switch that lies exactly between two control stages, where the cost has a kink."""

    #: The control stage behind it, the number of stages at the end of the horizon; or the one in which a surface is touched.
    stage: int
    t: float
    #: Derivatives of the cost towards a switch in the stage before and in the stage behind, relative: negative where that
    #: lowers the cost, NaN where there is no such switch.
    before: float
    after: float
    #: Nothing switches, but a surface is touched and left again: `before` is the derivative away from it, `after` that of a
    #: moment behind it.
    touch: bool


@dataclass(frozen=True)
class Optimality:
    """An optimal control as a point of the control problem: derivatives of event-driven simulations of the controls, with the
    multipliers of the constraints, independent of the discretisation."""

    #: "local_optimum", "kink", "not_optimal", "unknown", or "global" where an exact search over all choices proves it.
    verdict: str
    #: Largest first-order change of the cost by one quantity within its bounds, relative; up to 1e-3 counts as none.
    residual: float
    #: Derivatives of the cost with respect to the controls, a row for each control stage.
    gradient: Array = field(repr=False)
    kinks: list[Kink]
    #: Changes of the controls that lower the cost to first order where the verdict is "not_optimal", zeros otherwise.
    descent: Array = field(repr=False)
    #: Why the verdict is "unknown".
    reason: str = ""
    #: Largest share of the cost by which an answer with other choices may be cheaper; NaN where that is not known.
    gap: float = numpy.nan


@dataclass(frozen=True, repr=False)
class OcpResult(Hints, OverElements, HasOutcome):
    """Result of a solve; `controls` has a row for each control stage, which last from `control_times` on. `result["q"]` are the
    values of a state or a control, by its name, at the boundaries of the finite elements. It can be copied, pickled, and written by
    `save` (see `switchback_control.load`)."""

    _instead = {
        "objective": "it is result.cost",
        "f": "it is result.cost",
        "x": "states are result['name'], or result.trajectory.states; result.trajectory(times) are those in between",
        "u": "controls are result['name'], or result.controls with a row for each stage",
        "t": "times are result.trajectory.times, those of the control stages result.control_times",
        "y": "multipliers are ocp.multipliers()",
        "multipliers": "they are a method of the problem, ocp.multipliers()",
        "costates": "they are ocp.multipliers().costates",
        "status": "result.outcome says how it ended, result.success whether it is a solution",
        "switches": "they are result.trajectory.switches",
    }

    outcome: Outcome
    polished: Polished
    #: Cost of the solution; NaN unless the problem is solved.
    cost: float
    controls: Array
    control_times: Array = field(repr=False)
    trajectory: Trajectory
    residuals: Residuals
    stats: Stats
    #: Comparison with a simulation of the controls; None with the option accuracy off.
    accuracy: Accuracy | None = None
    #: Largest difference of a state at the end of every control stage.
    mismatch: Array | None = field(default=None, repr=False)
    #: Parameters, those that were free as they were found.
    params: Array | None = field(default=None, repr=False)
    #: Lengths of the control stages.
    durations: Array | None = field(default=None, repr=False)
    #: Controls at the end of every stage: others than at its start where they are linear.
    control_ends: Array | None = field(default=None, repr=False)
    #: Largest violation of a relaxed constraint.
    violation: float = 0.0
    #: Why there is no exact solution, in the words of the model, and why the comparison `accuracy` says nothing, or what
    #: brings the answer closer to the simulation where they are far apart; empty where there is nothing to say. Stages,
    #: elements, rows and states are counted from 0.
    message: str = ""
    #: How the grid was adapted; None with the option adapt_tol at 0.
    adaptation: Adaptation | None = field(default=None, repr=False)
    #: What the point costs that is given here, solution or not. One that is none need not satisfy dynamics and
    #: constraints, and its cost may lie on either side of that of a solution.
    cost_reached: float = field(default=float("nan"), repr=False)
    #: The transitions, for models with hysteresis or automata, in the order of time.
    jumps: list[OcpJump] = field(default_factory=list, repr=False)
    #: The system of the problem; None for a problem from a document.
    system: System | None = field(default=None, repr=False)
    #: What the answer is as a point of the control problem; None with the option accuracy off.
    optimality: Optimality | None = field(default=None, repr=False)
    #: What the contacts of a scene do; None for other systems.
    contacts: OcpContacts | None = field(default=None, repr=False)

    def discrete(self, state: Any) -> list[Any]:
        """The values of a discrete state in their order, with their times: a list of `Interval(start, end, value)`.

        `state` is an `Automaton`, whose states are named then, or a discrete state by name, place or as an expression.
        """
        from .automaton import Automaton, place_of

        if isinstance(state, Automaton):
            return state.sequence(self)
        system = self.system
        place = place_of(system, state) if system is not None else index(state, "state")
        return self._intervals(place)

    def _intervals(self, place: int) -> list[Any]:
        from .automaton import intervals_of

        times = self.control_times
        return intervals_of(self.jumps, place, float(times[0]), float(times[-1]), self.trajectory(times[-1]))

    def table(self) -> str:
        """The transitions as text: time, transition, control stage."""
        lines = [f"{'t':>22}  {'transition':>10}  {'stage':>5}"]
        for j in self.jumps:
            lines.append(f"{j.t:22.15g}  {j.transition:>10}  {j.stage:>5}" + ("  at once" if j.at_once else ""))
        return "\n".join(lines)

    @property
    def certificate(self) -> str:
        """"local_optimum", "kink" (switches lie between control stages, and the cost rises towards either side),
        "not_optimal", "global" or "unknown"; see `optimality`."""
        return self.optimality.verdict if self.optimality else "unknown"

    def _facts(self) -> dict[str, Any]:
        facts = {
            "outcome": outcome_name(self.outcome),
            "success": self.success,
            "cost": self.cost,
            "certificate": self.certificate,
            "switch_times": self.trajectory.switch_times,
            "control_times": self.control_times,
            "params": self.params,
            "iterations": self.stats.iterations,
            "time_total": self.stats.time_total,
            "message": self.message,
        }
        return {k: v for k, v in facts.items() if v is not None and not (hasattr(v, "__len__") and len(v) == 0)}

    def __repr__(self) -> str:
        t = self.trajectory
        switches = f"{len(t.switches)} switches" + (f", {len(self.jumps)} transitions" if self.jumps else "")
        more = f": {self.message}" if self.message else ""
        outcome = outcome_name(self.outcome)
        return f"<OcpResult {outcome}, cost {self.cost:.9g}, {t.n_elements} elements, {switches}, {self.certificate}{more}>"


@dataclass(frozen=True)
class OcpSensitivity:
    """Derivatives of an optimum. `controls` have the shape (n_stages, nu, nx) and (n_stages, nu, np); on a `one_sided`
    solution a bound is active without a multiplier, and on its other side the derivatives are others."""

    cost_x0: Array
    cost_p: Array
    controls_x0: Array = field(repr=False)
    controls_p: Array = field(repr=False)
    one_sided: bool


@dataclass(frozen=True)
class Multipliers:
    """Multipliers at points of time: `values` has a row for each of `times`."""

    times: Array
    values: Array


@dataclass(frozen=True)
class OcpMultipliers:
    """Multipliers of an optimum. Those of bounds and constraints are positive where an upper bound is active and negative where a
    lower one is: raising that bound by d changes the optimal cost by -d times the multiplier, to first order.

    `costates` (n_stages + 1, nx) are, at the start of every stage, the derivatives of the cost that is still to come, constraints
    behind that time included, with respect to the state, and at the end of the horizon those of terminal cost and constraints.
    `path`, `terminal`, `boundary` and `relaxed` have an entry for each constraint in the order in which they were added; the
    multipliers of a path constraint at all its points add up to the effect of its bound.
    """

    costates: Array
    initial_state: Array
    controls: Array
    params: Array
    states: Multipliers = field(repr=False)
    path: list[Multipliers]
    terminal: list[Array]
    boundary: list[Array]
    relaxed: list[Multipliers]


class Ocp(Hints, OcpTerms, OcpSearch):
    """Optimal control problem of a system: piecewise constant controls on an equidistant grid of stages.

    Bounds are infinite, the initial state is free, the initial time is zero, parameters have no values, without which a problem that
    has any is not solved, and there is no cost, until they are set, by keyword or by the methods. Options by `settings` or by keyword. Costs and constraints are functions, or,
    for the system of a `Model`, its expressions: `lagrange=m.F**2`.

    A `Scene` stands where a system does: its contacts close, slide, stick and bounce in physical time, and the answer says
    when (`OcpResult.contacts`). `jumps` says how that is found: "modes" from a simulation of the guess and the orders of
    contacts next to it, "steps" by time stepping, "shots" by descents on simulations, from the guess and from controls drawn at random, "fesd_j" by finite
    elements with jumps, "freezing" by time-freezing, "auto" by "shots" and "steps", and by "modes" and "fesd_j" where the former finds nothing.
    """

    _kind = "ocp"
    _system: System | None = None
    _x0: Array | None = None  # initial state and parameters where they were given
    _p: Array | None = None
    _starts = False  # was anything said of the initial state?
    _contacts: tuple[Any, ...] | None = None

    _instead = {
        "subject_to": "constraints are add_path(f, lower, upper), add_terminal and add_boundary",
        "minimize": "the cost is lagrange= (a rate) and mayer= (at the end), or set_lagrange and set_mayer",
        "set_initial": "guesses are set_state_guess and set_control_guess",
        "set_value": "parameters are set_params",
        "add_constraint": "constraints are add_path(f, lower, upper), add_terminal and add_boundary",
        "set_cost": "the cost is set_lagrange (a rate) and set_mayer (at the end)",
        "save": "ocp.to_json() is the problem as a document, Ocp.from_json reads it; results have save",
        "set_horizon": "the horizon is given where the problem is made; set_free_time makes it a variable",
    }

    @of_ocp
    def __init__(
        self,
        system: System | Model,
        horizon: float,
        n_stages: int,
        settings: Settings | Mapping[str, Any] | None = None,
        *,
        lagrange: Any = None,
        mayer: Any = None,
        initial_state: Any = None,
        initial_time: float | None = None,
        initial_bounds: Sequence[Any] | None = None,
        state_bounds: Sequence[Any] | None = None,
        control_bounds: Sequence[Any] | None = None,
        params: Any = None,
        nominal: Mapping[str, Any] | None = None,
        jumps: Jumps | str = Jumps.AUTO,
        on_iteration: OnIteration | None = None,
        on_log: OnLog | None = None,
        **options: Any,
    ):
        system = system_of(system)
        self.nx, self.nu, self.np = system.nx, system.nu, system.np
        self.horizon, self.n_stages = number(horizon, "horizon"), index(n_stages, "n_stages")
        self.initial_time = 0.0
        verbose = take_verbose(options)
        chosen = Settings._from(settings, options)
        on_log, on_iteration = monitors(chosen, verbose, on_log, on_iteration)
        self._create(system, self.horizon, self.n_stages, ctypes.byref(chosen._c))
        self._functions = list(system._functions)
        self._system = system
        # a projected system has constraints, and nothing that jumps
        self._contacts = system._contacts if getattr(system._scene, "n_q", 0) else None
        self._do("set_jumps", choice(Jumps, jumps, "jumps"))
        self._monitors(on_iteration, on_log)
        for value, method in (
            (lagrange, self.set_lagrange),
            (mayer, self.set_mayer),
            (initial_state, self.set_initial_state),
            (initial_time, self.set_initial_time),
            (params, self.set_params),
            (nominal, self.set_nominal),
        ):
            if value is not None:
                method(value)
        for pair, name, set_bounds in (
            (initial_bounds, "initial_bounds", self.set_initial_bounds),
            (state_bounds, "state_bounds", self.set_state_bounds),
            (control_bounds, "control_bounds", self.set_control_bounds),
        ):
            if pair is not None:
                pair = (pair,) if isinstance(pair, Mapping) else pair
                if not isinstance(pair, tuple) and not (isinstance(pair, list) and len(pair) == 2) or len(pair) > 2:
                    raise DimensionError(f"{name} must be (lower, upper), or a dictionary from names to such pairs")
                set_bounds(*pair)

    def _repr_html_(self) -> str:
        names = zip(("states", "controls", "parameters"), (self.nx, self.nu, self.np), self._system._names if self._system else ((),) * 3)
        facts = {what: f"{n}: {', '.join(own)}" if any(own) else n for what, n, own in names}
        return facts_html("Ocp", {**facts, "horizon": self.horizon, "stages": self.n_stages})

    def to_json(self) -> str:
        """The problem as a document in JSON: for bug reports and replay. Callbacks are named only."""
        return text(lib.swb_ocp_to_json, self)

    @classmethod
    def from_json(cls, document: str, functions: Iterable[Function] = ()) -> Ocp:
        """A problem from a document. Callbacks that it names are supplied, and found by name."""
        reader = Reader(document, functions)
        ocp = cls.__new__(cls)
        ocp._make(lib.swb_ocp_from_json, *reader.arguments)
        data = reader.data()["ocp"]
        ocp.nx, ocp.nu, ocp.np = (data["system"][key] for key in ("states", "controls", "parameters"))
        ocp.horizon, ocp.n_stages, ocp.initial_time = float(data["horizon"]), data["n_stages"], float(data["t0"])
        ocp._functions = list(reader.functions)
        ocp._system = None
        contacts = data["system"].get("mechanics", {"projected": True})
        ocp._contacts = None if contacts.get("projected") else tuple((c["name"], c["tangents"]) for c in contacts.get("contacts", ()))
        ocp._starts = True  # what a document does not say was meant
        ocp._monitors(None, None)
        return ocp

    def set_lagrange(self, f: Any) -> None:
        """Set the cost rate, one output: its integral over the horizon is minimised. Expressions may have `abs`, `minimum` and `maximum` of
        controls in it where these point down, as `abs(u)` does: each is a variable of the program, without modes."""
        function = self._function(f, 1, "lagrange")
        self._do("set_lagrange", function)
        self._functions.append(function)

    def set_mayer(self, f: Any) -> None:
        """Set the terminal cost, one output; its control is that of the last stage."""
        function = self._function(f, 1, "mayer")
        if not isinstance(f, Function) and not (numpy.isscalar(f) and f == 0):  # 0: no cost
            function._require_rows("mayer", "the cost at the end is an expression or function of the model, as mayer=m.q**2")
        self._do("set_mayer", function)
        self._functions.append(function)

    def add_path(self, f: Any, lower: Any = None, upper: Any = None, at: PathAt | str = PathAt.CONTROL_GRID) -> None:
        """Add the constraint lower <= f(x, u, p, t) <= upper along the horizon: at "control_grid", "elements" or
        "stage_points". The bounds tell the number of outputs."""
        f = self._expressions(f, "path")
        n = self._rows(f, lower, upper, "path constraint")
        function = self._constraint(f, n, "path")
        low, high = bounds(lower, upper, n, "bounds of a path constraint")
        self._do("add_path", function, address(low), n, address(high), n, choice(PathAt, at, "at"))
        self._functions.append(function)

    def add_terminal(self, f: Any, lower: Any = None, upper: Any = None) -> None:
        """Add the constraint lower <= f(x, u, p, t) <= upper at the end of the horizon."""
        f = self._expressions(f, "terminal")
        n = self._rows(f, lower, upper, "terminal constraint")
        function = self._constraint(f, n, "terminal")
        low, high = bounds(lower, upper, n, "bounds of a terminal constraint")
        self._do("add_terminal", function, address(low), n, address(high), n)
        self._functions.append(function)

    def _named(self, block: int) -> tuple[str, ...]:
        """Names of states (0), controls (1) or parameters (2); () for a problem from a document."""
        return () if self._system is None else self._system._names[block]

    def _bounds(self, name: str, lower: Any, upper: Any, n: int, what: str) -> None:
        names = self._named(int(name == "set_control_bounds"))
        if isinstance(lower, Mapping):
            lower = filled(lower, names, f"lower {what}", [-numpy.inf] * n)
        if isinstance(upper, Mapping):
            upper = filled(upper, names, f"upper {what}", [numpy.inf] * n)
        low, high = bounds(lower, upper, n, what)
        self._do(name, address(low), n, address(high), n)

    def set_state_bounds(self, lower: Any = None, upper: Any = None) -> None:
        """Set bounds of the states after the initial time; None is no bound, one number is for all, and a dictionary from names
        to numbers, or one from names to pairs in the place of both, bounds these. The discrete states of a
        model may be left out; bounds of theirs are bounds of the values they may take."""
        lower, upper = pairs_by_name(lower, upper)
        n = len(self._system._discrete) if self._system is not None else 0
        low, high = (
            value if not n or isinstance(value, Mapping) or numpy.ndim(value) != 1 or numpy.size(value) != self.nx - n else numpy.append(value, n * [free])
            for value, free in ((lower, -numpy.inf), (upper, numpy.inf))
        )
        self._bounds("set_state_bounds", low, high, self.nx, "bounds of the states")

    def set_initial_bounds(self, lower: Any = None, upper: Any = None) -> None:
        """Set bounds of the initial state; equal bounds fix it."""
        lower, upper = pairs_by_name(lower, upper)
        self._starts = True
        self._bounds("set_initial_bounds", lower, upper, self.nx, "bounds of the initial state")

    def set_control_bounds(self, lower: Any = None, upper: Any = None) -> None:
        """Set bounds of the controls."""
        lower, upper = pairs_by_name(lower, upper)
        self._bounds("set_control_bounds", lower, upper, self.nu, "bounds of the controls")

    def set_nominal(self, sizes: Mapping[str, Any]) -> None:
        """Say how large quantities usually are, by their names (of states, controls, parameters) or as lists under "x", "u" and "p"
        (NaN where nothing is known): `{"q": 1e-3, "force": 50}`. The solver measures variables by that; what is not given it takes
        from bounds, initial values, guesses and simulations."""
        if not isinstance(sizes, Mapping):
            raise ArgumentError("nominal must be a dictionary from names to sizes, as {'q': 1e-3}")
        counts = (self.nx, self.nu, self.np)
        names = tuple(name for block in range(3) for name in self._named(block))
        lists = {key: sizes[key] for key in "xup" if key in sizes and key not in names}
        named = {key: value for key, value in sizes.items() if key not in lists}
        unknown = [numpy.inf] * sum(counts)
        values = numpy.array(filled(named, names, "nominal", unknown) if named else unknown, dtype=float)
        values[values == numpy.inf] = numpy.nan
        arrays = numpy.split(values, numpy.cumsum(counts)[:2])
        for key, array, n in zip("xup", arrays, counts):
            if key in lists:
                given = numpy.asarray(lists[key], dtype=float)
                if given.shape != (n,):
                    raise DimensionError(f"nominal sizes {key!r} must be {n} numbers")
                array[:] = numpy.where(numpy.isnan(given), array, given)
        arrays = [numpy.ascontiguousarray(array) for array in arrays]
        self._do("set_nominal", *(part for array in arrays for part in (address(array), len(array))))

    def set_initial_state(self, x0: Any) -> None:
        """Fix the initial state; the discrete states of a model may be left out."""
        system = self._system
        array = vector(x0, self.nx, "x0") if system is None else system._start(x0, "x0")
        self._do("set_initial_state", address(array), len(array))
        self._starts = True
        self._x0 = array.copy()

    def set_initial_time(self, t0: float) -> None:
        """Set the initial time."""
        t = number(t0, "t0")
        self._do("set_initial_time", t)
        self.initial_time = t

    def set_params(self, p: Any) -> None:
        """Set the parameters."""
        array = named_vector(p, self._named(2), self.np, "p")
        self._do("set_params", address(array), len(array))
        self._p = array.copy()

    def set_state_guess(self, times: Any, x: Any) -> None:
        """Give states to start from, a row for each of the rising times, linear in between."""
        t = numpy.atleast_1d(real(times, "times"))
        if t.ndim != 1:
            raise DimensionError(f"times has shape {t.shape}, expected one dimension")
        array = table(x, len(t), self.nx, "x")
        self._do("set_state_guess", address(t), len(t), address(array), array.size)

    def set_control_guess(self, u: Any) -> None:
        """Give controls to start from, a row for each stage."""
        array = table(u, self.n_stages, self.nu, "u")
        self._do("set_control_guess", address(array), array.size)

    def solve(self, warm: bool = False, **unknown: Any) -> OcpResult:
        """Solve; `warm`: from the last solution, whose active set is tried first. Look at `result.success`: the outcome may be
        another one than solved. Other keywords are refused, with what to use instead."""
        refuse_of_solve(unknown)
        if not self._starts:
            self._starts = True  # once
            warnings.warn(
                "nothing is said of the initial state, so the solver chooses it: give initial_state=[...], or initial_bounds=(lower, upper) where "
                "it is free",
                UnsetWarning,
                stacklevel=2,
            )
        self._solve("solve_warm" if warm else "solve")
        return self.result

    @property
    def result(self) -> OcpResult:
        """Result of the last solve."""
        u = numpy.empty((self.n_stages, self.nu))
        self._do("get_controls", address(u), u.size)
        durations = self._vector("get_durations", self.n_stages)
        times = self.initial_time + numpy.concatenate(([0.0], numpy.cumsum(durations)))
        trajectory = Trajectory._take(self)
        return OcpResult(
            self.outcome,
            polished_of(self._get("get_polished", ctypes.c_int32)),
            self._get("get_cost", ctypes.c_double),
            u,
            times,
            trajectory,
            self.residuals,
            self.stats,
            *self._accuracy(),
            self._vector("get_params", self.np),
            durations,
            self._vector("get_control_ends", u.size).reshape(u.shape),
            self._violation(),
            text(lib.swb_ocp_get_message, self) + before_first_iterate(self.outcome, self.stats),
            self._adaptation(),
            self._get("get_cost_reached", ctypes.c_double),
            self._jumps(),
            self._system,
            self._optimality(),
            contacts=None if self._contacts is None else OcpContacts(self, trajectory),
        )

    def _jumps(self) -> list[OcpJump]:
        n = self._get("jump_count", ctypes.c_int64)
        found = (swb_ocp_jump * max(n, 1))()
        self._do("jumps", found if n else None, n, ctypes.sizeof(swb_ocp_jump))
        jumps = []
        for i, j in enumerate(found[:n]):
            before, after = numpy.empty(self.nx), numpy.empty(self.nx)
            self._do("jump_states", i, address(before), address(after), self.nx)
            jumps.append(OcpJump(j.t, j.transition, j.stage, before, after, bool(j.at_once)))
        return jumps

    def _accuracy(self) -> tuple[Accuracy | None, Array | None]:
        mismatch = numpy.empty(self.n_stages)
        try:
            c = self._struct("get_accuracy", swb_accuracy)
        except StateError:
            return None, None
        self._do("get_mismatch", address(mismatch), len(mismatch))
        return Accuracy._of(c), mismatch

    def _optimality(self) -> Optimality | None:
        try:
            c = self._struct("get_optimality", swb_optimality)
        except StateError:
            return None
        kinks = []
        for i in range(c.n_kinks):
            k = swb_kink()
            self._do("get_kink", i, ctypes.byref(k), ctypes.sizeof(k))
            kinks.append(Kink(k.stage, k.t, k.before, k.after, bool(k.touch)))
        names = ("get_reduced_gradient", "get_descent")
        gradient, descent = (self._vector(n, self.n_stages * self.nu).reshape(self.n_stages, self.nu) for n in names)
        verdict = (lib.swb_verdict_name(c.verdict) or b"unknown").decode()
        reason = text(lib.swb_ocp_get_optimality_reason, self)
        return Optimality(verdict, c.residual, gradient, kinks, descent, reason, c.gap)

    def sensitivity(self) -> OcpSensitivity:
        """Derivatives of the last solution with respect to initial state and parameters, while the order of modes stays
        as it is. Components of the initial state that are free have zeros."""
        n = self.nx + self.np
        cost, u = numpy.empty(n), numpy.empty((n, self.n_stages, self.nu))
        one_sided = ctypes.c_int32()
        self._do("get_sensitivity", address(cost), cost.size, address(u), u.size, ctypes.byref(one_sided))
        by_datum = numpy.moveaxis(u, 0, -1)
        return OcpSensitivity(
            cost[: self.nx], cost[self.nx :], by_datum[..., : self.nx], by_datum[..., self.nx :], bool(one_sided.value)
        )

    def _multipliers(self, of: int, index: int = 0) -> Multipliers:
        n, width = ctypes.c_int64(), ctypes.c_int64()
        self._do("multiplier_sizes", of, index, ctypes.byref(n), ctypes.byref(width))
        times, values = numpy.empty(n.value), numpy.empty((n.value, width.value))
        self._do("get_multipliers", of, index, address(times), times.size, address(values), values.size)
        return Multipliers(times, values)

    def multipliers(self) -> OcpMultipliers:
        """Multipliers of bounds and constraints of the last solution, which must be exact, and costates."""

        def every(of: int) -> list[Multipliers]:
            n = ctypes.c_int64()
            self._do("count_multipliers", of, ctypes.byref(n))
            return [self._multipliers(of, k) for k in range(n.value)]

        return OcpMultipliers(
            self._multipliers(MultipliersOf.COSTATES).values,
            self._multipliers(MultipliersOf.INITIAL_STATE).values[0],
            self._multipliers(MultipliersOf.CONTROLS).values,
            self._multipliers(MultipliersOf.PARAMS).values[0],
            self._multipliers(MultipliersOf.STATES),
            every(MultipliersOf.PATH),
            [m.values[0] for m in every(MultipliersOf.TERMINAL)],
            [m.values[0] for m in every(MultipliersOf.BOUNDARY)],
            every(MultipliersOf.RELAXED),
        )

    def __repr__(self) -> str:
        return f"<Ocp nx={self.nx} nu={self.nu} horizon={self.horizon:g} n_stages={self.n_stages}>"
