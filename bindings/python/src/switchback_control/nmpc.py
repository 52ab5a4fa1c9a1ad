"""Model predictive control in real time."""

from __future__ import annotations

import ctypes
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Callable, Mapping

import numpy

from . import _ffi
from ._arrays import Array, address, choice, index, number, real, table, vector
from ._call import Handle, aside, check
from ._ffi import CReal, NmpcLevel, NmpcQp, NmpcQpStatus, NmpcScheme, NmpcSource, RkFamily
from ._library import lib
from ._progress import Progress
from .errors import ArgumentError, DimensionError
from .expr import Model, system_of
from .integrator import Integrator
from .mhe import Mhe
from .ocp import Ocp
from .recorded import Recorded, labels
from .system import System

__all__ = ["ClosedLoop", "Feedback", "Monitor", "Nmpc", "Plan", "PlanMultipliers", "Preparation", "closed_loop"]

_LEVELS = {"d": "d0"}


@dataclass(frozen=True)
class Preparation:
    """Result of a preparation.

    ready  there is a quadratic program for the next sample
    inner  inner iterations
    time   seconds
    """

    ready: bool
    inner: int
    time: float


@dataclass(frozen=True)
class Feedback:
    """Result of a feedback: the source of the control, and how its quadratic program ended.

    source      where the control comes from: QP, SOFT_QP, TANGENT, PLAN or HOLD, the best that was there in time
    status      how the quadratic program ended
    iterations  changes of its active set
    time        seconds
    """

    source: NmpcSource
    status: NmpcQpStatus
    iterations: int
    time: float


@dataclass(frozen=True)
class Plan:
    """States [n + 1, nx] and controls [n, nu] from the last sample on."""

    x: Array
    u: Array


@dataclass(frozen=True)
class Monitor:
    """Counts and times of a controller's own work since it was made or reset; evaluations are counted for the whole horizon at once.

    kappa, omega   estimates of (10.18) from the inner steps: they contract where kappa is below 1; NaN without enough of them
    step           the last inner step, relative to the size of states and controls
    prediction     distance of the last measured from the predicted state, relative to the size of the states
    preparations, feedbacks    how many, and the seconds of the last, of all and of the longest
    values, jacobians, adjoints, hessians    evaluations, and those of the last preparation alone (`last_...`)
    qps, qp_iterations         quadratic programs, and their iterations
    failed_linearisations      linearisations whose functions had no value, or whose program was not convex
    from_...                   feedbacks by their source
    alternatives, flips        systems that switch: alternatives to plans that were prepared, and those that were taken
    """

    kappa: float
    omega: float
    step: float
    prediction: float
    preparations: int
    preparation_last: float
    preparation_total: float
    preparation_worst: float
    feedbacks: int
    feedback_last: float
    feedback_total: float
    feedback_worst: float
    values: int
    jacobians: int
    adjoints: int
    hessians: int
    last_values: int
    last_jacobians: int
    last_adjoints: int
    last_hessians: int
    qps: int
    qp_iterations: int
    failed_linearisations: int
    from_qp: int
    from_soft_qp: int
    from_tangent: int
    from_plan: int
    from_hold: int
    alternatives: int
    flips: int


@dataclass(frozen=True)
class PlanMultipliers:
    """Multipliers of a plan: those of bounds and rows are positive at upper and negative at lower bounds.

    dynamics  [n + 1, nx] the first of the initial value: the derivative of the cost by it
    controls  [n, nu] of the bounds of the controls
    rows      of the rows of constraints, node by node: bounds of states, then constraints
    nodes     their nodes
    """

    dynamics: Array
    controls: Array
    rows: Array
    nodes: Array


class Nmpc(Handle):
    """A controller for an optimal control problem: `prepare` between samples, `feedback` at them.

    scheme         "rti": one linearisation per sample. "mli": one iteration of a level per sample. "as_rti": inner iterations
                   of a level on the problem with the predicted state, then a linearisation. "asc": that problem is solved
    level          "a", "b", "c", "d0" (or "d"), "d1", "d2": what an iteration evaluates
    inner          inner iterations per sample
    shift          the iterate moves by one stage at every sample
    deadline       seconds a feedback may take
    tol            "asc" ends its iterations where states and controls change by less than this share of their size, "as_rti" where they
                   would change by less from then on, by the estimated contraction
    max_changes    changes of the active set a feedback may make ("stagewise": Newton steps); 0: as many as it needs. What is left of them is
                   made in the next preparation
    elastic_price  price of violations where constraints cannot all be met; 0: chosen by the controller
    qp_solver      "condensing": states eliminated, quadratic programs of short horizons. "stagewise": work linear in the number of
                   stages. "auto": the one with fewer operations
    rk_family, n_s, steps   the Runge-Kutta method of the predictions and its steps in every stage; by default as the settings
                   of the problem say, with its finite elements as steps
    flips          systems that switch: alternatives to the plan at most, where a control moves nothing since the system sticks; other
                   sequences of controls that choose
    hysteresis     they are taken where their predicted cost is lower than that of the plan by more than this share

    The problem is copied as it is stated now. Costs along the horizon are summed over the starts of the stages, path constraints
    hold there. Controls that choose (`Model.choice`) keep to their values and dwell times; a sample counts as long as the first stage. Stages of
    systems that switch or choose are simulated by events, with `rtol` and `atol` of the problem's settings;
    they take level "d0" and every scheme but "mli". After an algebraic elimination `nx` counts the states that have a derivative: they are what is measured.
    """

    _kind = "nmpc"

    def __init__(
        self,
        ocp: Ocp,
        scheme: str | NmpcScheme = "rti",
        level: str | NmpcLevel = "d0",
        inner: int = 1,
        *,
        shift: bool = False,
        deadline: float = numpy.inf,
        tol: float = 1e-8,
        elastic_price: float = 0.0,
        qp_solver: str | NmpcQp = "auto",
        rk_family: str | RkFamily | None = None,
        n_s: int = 0,
        steps: int = 0,
        flips: int = 4,
        hysteresis: float = 0.01,
        max_changes: int = 0,
    ):
        if not isinstance(ocp, Ocp):
            raise ArgumentError(f"a controller takes an Ocp, not {type(ocp).__name__}")
        options = _ffi.swb_nmpc_options()
        check(lib.swb_nmpc_options_init(ctypes.byref(options), ctypes.sizeof(options)))
        if isinstance(level, str):
            level = _LEVELS.get(level.lower(), level)
        options.scheme = int(choice(NmpcScheme, scheme, "scheme"))
        options.level = int(choice(NmpcLevel, level, "level"))
        options.qp_solver = int(choice(NmpcQp, qp_solver, "qp_solver"))
        options.inner, options.shift = index(inner, "inner"), int(bool(shift))
        options.rk_family = -1 if rk_family is None else int(choice(RkFamily, rk_family, "rk_family"))
        options.n_s, options.steps = index(n_s, "n_s"), index(steps, "steps")
        options.tol, options.deadline = number(tol, "tol"), number(deadline, "deadline")
        options.elastic_price = number(elastic_price, "elastic_price")
        options.flips, options.hysteresis = index(flips, "flips"), number(hysteresis, "hysteresis")
        options.max_changes = index(max_changes, "max_changes")
        self._create(ocp, ctypes.byref(options))
        self._functions = list(ocp._functions)
        self.np, self.horizon = ocp.np, ocp.horizon
        sizes = [ctypes.c_int64() for _ in range(3)]
        self._do("sizes", *(ctypes.byref(s) for s in sizes))
        self.n, self.nx, self.nu = (s.value for s in sizes)
        self._info = _ffi.swb_nmpc_info()
        self._u = numpy.empty(self.nu)

    def _long(self, work: Callable[[], None]) -> None:
        if any(f._in_python for f in self._functions):
            work()
        else:
            aside(work, self.interrupt)

    def initialise(self, x0: Any, max_iter: int = 100) -> int:
        """Solve the problem for `x0` to convergence from the present iterate: the start of a closed loop. Returns the steps made."""
        given, done = vector(x0, self.nx, "x0"), ctypes.c_int64()
        most = index(max_iter, "max_iter")
        self._long(lambda: self._do("initialise", address(given), given.size, most, ctypes.byref(done)))
        return done.value

    def prepare(self, x_predicted: Any = None) -> Preparation:
        """Do everything for the next sample that needs no measurement. `x_predicted` is the state it will find, where that is known
        better than by one step of the model."""
        given = None if x_predicted is None else vector(x_predicted, self.nx, "x_predicted")
        at = (None, 0) if given is None else (address(given), given.size)
        i = self._info
        self._do("prepare", *at, ctypes.byref(i), ctypes.sizeof(i))
        return Preparation(bool(i.ready), i.inner, i.time)

    def prepare_async(self, x_predicted: Any = None) -> bool:
        """Begin a preparation on a thread of the controller and return at once: `feedback` takes what was prepared, all other calls wait
        for it. False where one is running already, which goes on. Models with functions in Python are prepared before the call
        returns, since one thread only may call them."""
        given = None if x_predicted is None else vector(x_predicted, self.nx, "x_predicted")
        at, started = (None, 0) if given is None else (address(given), given.size), ctypes.c_int64()
        self._do("prepare_async", *at, ctypes.byref(started))
        return bool(started.value)

    def wait(self) -> Preparation:
        """Wait for the preparation that `prepare_async` has begun; raises what it failed with."""
        i = self._info
        self._long(lambda: self._do("wait", ctypes.byref(i), ctypes.sizeof(i)))
        return Preparation(bool(i.ready), i.inner, i.time)

    def feedback(self, x: Any) -> tuple[Array, Feedback]:
        """The control [nu] for a measured state, and where it comes from. There always is one, also for a state that is not
        finite."""
        given, i = vector(x, self.nx, "x"), self._info
        u = self._u
        self._do("feedback", address(given), given.size, address(u), u.size, ctypes.byref(i), ctypes.sizeof(i))
        info = Feedback(NmpcSource(i.source), NmpcQpStatus(i.qp_status), i.qp_iterations, i.time)
        return u.copy(), info

    def finish(self) -> None:
        """Do what belongs to the last sample and can wait until its control is out. Every other call does it where it is needed."""
        self._do("finish")

    def set_params(self, p: Any) -> None:
        """Set the parameters: [np], [n, np] for the stages or [n + 1, np] for the nodes. Between a preparation and its feedback they
        enter the prepared program by one evaluation of the model; for systems that switch they count from the next preparation on."""
        given = real(p, "p")
        if given.size not in (self.np, self.n * self.np, (self.n + 1) * self.np):
            raise DimensionError(f"p has shape {given.shape}, expected ({self.np},), ({self.n}, {self.np}) or one row more")
        self._do("set_params", address(given), given.size)

    def set_references(self, term: int, y: Any) -> None:
        """Set the references of a least-squares term, in the order they were added: one for all its nodes, or a row for each. Between
        a preparation and its feedback they enter the prepared program."""
        given = numpy.atleast_1d(real(y, "y"))
        self._do("set_references", index(term, "term"), address(given), given.size)

    def set_weights(self, term: int, w: Any) -> None:
        """Set the weights of a least-squares term, in the order they were added: the diagonal, or the matrix. They count from the next
        preparation on."""
        given = numpy.atleast_1d(real(w, "w"))
        self._do("set_weights", index(term, "term"), address(given), given.size)

    def set_control_bounds(self, lower: Any, upper: Any) -> None:
        """Set the bounds [nu] of the controls, infinite for none. Between a preparation and its feedback they count at once."""
        lower, upper = vector(lower, self.nu, "lower"), vector(upper, self.nu, "upper")
        self._do("set_control_bounds", address(lower), address(upper), self.nu)

    def set_state_bounds(self, lower: Any, upper: Any) -> None:
        """Set the bounds [nx] of the measured states, infinite for none: of those that have a bound in the problem. Between a preparation
        and its feedback they count at once."""
        lower, upper = vector(lower, self.nx, "lower"), vector(upper, self.nx, "upper")
        self._do("set_state_bounds", address(lower), address(upper), self.nx)

    def set_time(self, t0: float) -> None:
        """Set the time of the first node."""
        self._do("set_time", number(t0, "t0"))

    def set_deadline(self, seconds: float) -> None:
        """Set the seconds a feedback may take."""
        self._do("set_deadline", number(seconds, "seconds"))

    def set_iterate(self, x: Any, u: Any) -> None:
        """Set states [n + 1, nx] and controls [n, nu] as the iterate."""
        x, u = table(x, self.n + 1, self.nx, "x"), table(u, self.n, self.nu, "u")
        self._do("set_iterate", address(x), x.size, address(u), u.size)

    def write_c(self, folder: str | os.PathLike, prefix: str = "controller", precision: str | CReal = "double") -> list[Path]:
        """Write the controller as C files (C99) without heap, threads or a clock, and return their paths: `prefix.h`, `prefix.c`,
        `prefix_main.c`, `prefix_record.h`, `prefix_fmu.c`, `modelDescription.xml`, `modelDescription_fmi3.xml`, `buildDescription.xml` and
        `Makefile`.

        folder     is made if it is not there
        prefix     what names begin with
        precision  "double" or "float"

        The controller in C begins with the present plan, parameters and references: call `initialise` before. `make test` in the folder repeats a
        closed loop that is recorded here; this controller is afterwards as after `set_iterate` with its plan. `make fmu` makes a unit for
        co-simulation (FMI 2.0), `make fmu3` one of FMI 3.0. It takes smooth problems from expressions with least squares, explicit methods, schemes "rti" and "as_rti" with level "d0", and `qp_solver="stagewise"`.
        """
        folder = Path(folder)
        kind = int(choice(CReal, precision, "precision"))
        self._do("write_c", os.fsencode(folder), str(prefix).encode(), kind)
        own = [f"{prefix}{end}" for end in (".h", ".c", "_main.c", "_record.h", "_fmu.c")]
        others = ("modelDescription.xml", "modelDescription_fmi3.xml", "buildDescription.xml", "Makefile")
        return [folder / name for name in (*own, *others)]

    def reset(self) -> None:
        """Back to the start: the guess of the problem, nothing measured."""
        self._do("reset")

    @property
    def plan(self) -> Plan:
        """States and controls from the last sample on."""
        x, u = numpy.empty((self.n + 1, self.nx)), numpy.empty((self.n, self.nu))
        self._do("get_plan", address(x), x.size, address(u), u.size)
        return Plan(x, u)

    @property
    def objective(self) -> float:
        """Cost of the plan with the prices of its violations, summed over the nodes. Costs and constraints are evaluated."""
        value = ctypes.c_double()
        self._do("get_objective", ctypes.byref(value))
        return value.value

    @property
    def gain(self) -> Array:
        """Feedback gain [nu, nx] of the first stage of the prepared program, where no constraint is active: `u = u0 + gain @ (x - x0)`."""
        out = numpy.empty((self.nu, self.nx))
        self._do("get_gain", address(out), out.size)
        return out

    @property
    def multipliers(self) -> PlanMultipliers:
        """Multipliers of the plan."""
        rows = ctypes.c_int64()
        self._do("count_rows", ctypes.byref(rows))
        dynamics, controls = numpy.empty((self.n + 1, self.nx)), numpy.empty((self.n, self.nu))
        of_rows, nodes = numpy.empty(rows.value), numpy.empty(rows.value, dtype=numpy.int64)
        arrays = (dynamics, controls, of_rows, nodes)
        self._do("get_multipliers", *(a for v in arrays for a in (address(v), v.size)))
        return PlanMultipliers(*arrays)

    @property
    def monitor(self) -> Monitor:
        """Contraction, times and counts."""
        m = _ffi.swb_nmpc_monitor()
        self._do("get_monitor", ctypes.byref(m), ctypes.sizeof(m))
        return Monitor(*(getattr(m, name) for name in Monitor.__dataclass_fields__))

    def interrupt(self) -> None:
        """End the call that runs now, or the next one; from any thread."""
        self._do("interrupt")


@dataclass(frozen=True, repr=False)
class ClosedLoop(Recorded):
    """Record of a closed loop. It can be copied, pickled, and written by `save` (see `switchback_control.load`).

    t         [steps + 1] times of the samples
    x         [steps + 1, nx] states of the plant at them
    measured  [steps, nx] what the controller saw: with noise. With an estimator [steps, its ny]: what that saw
    estimates [steps, its nx] what the estimator found; empty without one
    u         [steps, nu] controls that acted on the plant
    sources   where each came from
    cost      sum of the costs of the samples; NaN without `cost`
    preparation, feedback    [steps] seconds; those of the estimator are in the feedback
    names     names of the plant's states and controls, as far as it has any
    """

    t: Array
    x: Array
    measured: Array = field(repr=False)
    u: Array
    sources: list[NmpcSource] = field(repr=False)
    cost: float
    preparation: Array = field(repr=False)
    feedback: Array = field(repr=False)
    names: tuple[list[str], list[str]] = field(default=([], []), repr=False)
    estimates: Array = field(default_factory=lambda: numpy.empty((0, 0)), repr=False)

    def _series(self) -> tuple[Array, dict[str, Array]]:
        controls = numpy.vstack([self.u, self.u[-1:]]) if len(self.u) else self.u
        names = labels(self.names[0], "x", self.x.shape[1]), labels(self.names[1], "u", self.u.shape[1])
        return self.t, {**dict(zip(names[0], self.x.T)), **dict(zip(names[1], controls.T))}

    def _facts(self) -> dict[str, Any]:
        worst = {"preparation_worst": self.preparation.max(initial=0.0), "feedback_worst": self.feedback.max(initial=0.0)}
        return {"samples": len(self.u), **({} if numpy.isnan(self.cost) else {"cost": self.cost}), **worst}

    def __repr__(self) -> str:
        priced = "" if numpy.isnan(self.cost) else f", cost {self.cost:.6g}"
        return f"<ClosedLoop of {len(self.u)} samples from {self.t[0]:g} to {self.t[-1]:g}{priced}>"

    def plot(self, path: Any = None, names: Any = None) -> Any:
        """States above controls over time, written to `path` if one is given; `names` are those of the states in the place of the plant's.
        Needs matplotlib."""
        import matplotlib.pyplot as plt

        figure, axes = plt.subplots(2, 1, sharex=True, figsize=(7, 5))
        states = labels(names or self.names[0], "x", self.x.shape[1])
        controls = labels(self.names[1], "u", self.u.shape[1])
        for i in range(self.x.shape[1]):
            axes[0].plot(self.t, self.x[:, i], label=states[i])
        for j in range(self.u.shape[1]):
            axes[1].step(self.t, numpy.append(self.u[:, j], self.u[-1, j]), where="post", label=controls[j])
        for a in axes:
            a.legend(loc="best", fontsize="small")
            a.grid(alpha=0.3)
        axes[1].set_xlabel("time")
        figure.tight_layout()
        if path is not None:
            figure.savefig(path)
            plt.close(figure)
        return figure


def _plant(plant: System | Model | Callable[..., Any], sample: float, options: Mapping[str, Any]) -> Callable[..., Array]:
    """One sample of a plant: a function of (x, u, p, t), or a system that is simulated by events."""
    if callable(plant) and not isinstance(plant, (System, Model)):
        return lambda x, u, p, t: numpy.asarray(plant(x, u, p, t), dtype=float)
    system = system_of(plant)
    settings = {"rtol": 1e-9, "atol": 1e-12, **options}
    integrator = Integrator(system, **settings)

    def step(x: Array, u: Array, p: Array | None, t: float) -> Array:
        if p is not None and system.np:
            integrator.set_params(p)
        if system.nu:
            integrator.set_controls(u)
        integrator.reinit(x, t)
        integrator.advance(t + sample)
        if integrator.time < t + sample * (1 - 1e-9):
            raise ArgumentError(f"the plant cannot be simulated from t = {t:.6g}: {integrator.reason}")
        return integrator.state

    return step


def closed_loop(
    controller: Nmpc,
    plant: System | Model | Callable[..., Any],
    x0: Any,
    steps: int,
    *,
    sample: float | None = None,
    t0: float = 0.0,
    noise: Any = None,
    measure: Callable[[Array, float], Any] | None = None,
    estimator: Mhe | None = None,
    delay: int = 0,
    p: Any = None,
    cost: Callable[..., float] | None = None,
    before: Callable[[Nmpc, int, float], None] | None = None,
    predict: Callable[[Array, Array, float], Any] | None = None,
    progress: Any = False,
    **options: Any,
) -> ClosedLoop:
    """Let a controller act on a plant for a number of samples.

    plant    a system or model, simulated by events (`options` are those of an `Integrator`), also one with contacts or switches that
             the controller does not know; or a function (x, u, p, t) that gives the state one sample later
    sample   length of a sample; by default that of the first stage of an even grid
    noise    added to the state of the plant after every sample: amplitudes [nx] of uniform numbers that are the same in every run,
             or a function of the number of the sample
    measure  (x, t) -> what the controller sees, [its nx]; by default the state itself. With an estimator: what that sees, [its ny]
    estimator  an `Mhe` between the measurements and the controller, which gets the first of its states; the others are parameters.
             Its model may be another one. `before` may read its `states` and tell the controller of them
    delay    samples that a control is late; the state is then predicted over the delay with the controls that are under way, by
             `predict`, a function (x, u, t) of one sample, or by the plant itself
    p        parameters of the plant: [np], or a function of time
    cost     (x, u, t) -> cost of a sample, with the state at its start
    progress True: how far it is, by tqdm where it is installed, else in lines; or a function of (done, total)
    before   called with (controller, number, time) before every preparation: for references, parameters, deadlines

    The controller should have been initialised for `x0`.
    """
    steps, delay = index(steps, "steps"), index(delay, "delay")
    if steps < 1 or delay < 0:
        raise DimensionError("a closed loop has at least one sample and no negative delay")
    ts = number(sample, "sample") if sample is not None else controller.horizon / controller.n
    advance = _plant(plant, ts, options)
    foresee = predict or (lambda x, u, t: advance(x, u, parameters(t), t))
    parameters = p if callable(p) else (lambda t: None if p is None else numpy.atleast_1d(real(p, "p")))
    seen = measure or (lambda x, t: x)
    x = numpy.array(real(x0, "x0"), dtype=float).ravel()
    amplitude = None if noise is None or callable(noise) else vector(noise, x.size, "noise")
    generator = numpy.random.Generator(numpy.random.PCG64(0))
    states, measured, controls, sources = [x], [], [], []
    times = numpy.zeros((2, steps))
    total = 0.0 if cost is not None else float("nan")
    waiting = [numpy.zeros(controller.nu)] * delay
    report = Progress(progress, 0, steps, "samples")
    estimates: list[Array] = []
    for k in range(steps):
        t = t0 + k * ts
        if before is not None:
            before(controller, k, t)
        times[0, k] = controller.prepare().time
        if estimator is not None and k > 0:
            estimator.prepare(controls[-1])
        y = numpy.asarray(seen(x, t), dtype=float)
        measured.append(y)
        ahead = y
        if estimator is not None:
            found, estimate = estimator.estimate(y)
            times[1, k] = estimate.time
            estimates.append(found)
            ahead = found[: controller.nx]
        for i, u in enumerate(waiting):
            ahead = numpy.asarray(foresee(ahead, u, t + i * ts), dtype=float)
        u, info = controller.feedback(ahead)
        times[1, k] += info.time
        sources.append(info.source)
        waiting.append(u)
        u = waiting.pop(0)
        controls.append(u)
        controller.finish()
        if cost is not None:
            total += float(cost(x, u, t))
        x = numpy.array(advance(x, u, parameters(t), t), dtype=float)
        if callable(noise):
            x = x + numpy.asarray(noise(k), dtype=float)
        elif amplitude is not None:
            x = x + amplitude * (2.0 * generator.random(x.size) - 1.0)
        states.append(x)
        report.add()
    report.close()
    grid = t0 + ts * numpy.arange(steps + 1)
    known = system_of(plant)._names if isinstance(plant, (System, Model)) else ((), ())
    names = list(known[0]), list(known[1])
    return ClosedLoop(grid, numpy.array(states), numpy.array(measured), numpy.array(controls), sources, total, *times, names, numpy.array(estimates) if estimates else numpy.empty((0, 0)))
