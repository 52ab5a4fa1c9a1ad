"""Event-driven simulation: every switch located, sliding modes as the equations they are."""

from __future__ import annotations

import contextlib
import ctypes
import threading
from dataclasses import dataclass, field, fields
from typing import Any, Callable, Iterator, Mapping, NamedTuple, Sequence

import numpy

from . import _ffi
from ._arrays import Array, address, choice, index, number, one_or, real, seen, table, vector
from ._call import Handle, aside, frame, text
from ._ffi import EventKind, ProgressKind, RunOutcome, Sensitivity
from ._foreign import Hints, translated
from ._foreign import method as method_of
from ._library import lib
from ._logs import monitors, take_verbose
from ._names import named_vector, rows
from ._progress import Progress
from ._solver import OnLog, _log_callback
from .errors import ArgumentError, DimensionError, RangeError
from .expr import Model, system_of
from .recorded import Recorded, labels
from .scene import Impact, ImpactKind, Scene, SceneContact
from .settings import HasSettings, Settings
from .system import System

__all__ = [
    "Accumulation",
    "Batch",
    "BranchPoint",
    "Branching",
    "Contact",
    "Event",
    "Gradient",
    "Integrator",
    "Run",
    "RunStats",
    "Step",
    "simulate",
    "simulate_batch",
]


class Event(NamedTuple):
    """A change of the active set of a subsystem. `rate` is the speed at which what vanishes (a difference of indicators,
    or the weight of a mode) goes through zero before the switch, `transversality` the cosine between gradient of the
    surface and velocity: near zero the contact is grazing."""

    t: float
    kind: EventKind
    subsystem: int
    before: tuple[int, ...]
    after: tuple[int, ...]
    simultaneous: bool
    unique: bool
    rate: float
    transversality: float


class Jump(NamedTuple):
    """A transition that was made: states before and after. `rate` is the speed at which its guard passes zero, NaN where
    the guard held when its discrete state began."""

    t: float
    transition: int
    before: Array
    after: Array
    simultaneous: bool
    rate: float


class Step(NamedTuple):
    """An accepted step, for `on_step`."""

    t: float
    x: Array
    kind: ProgressKind
    steps: int
    switches: int


class Branching(NamedTuple):
    """A point from which several solutions go on, for `on_branching`: active modes of every subsystem before and in every
    continuation, `active[continuation][subsystem]`, and the derivatives of the state, a row for each continuation."""

    t: float
    x: Array
    before: list[tuple[int, ...]]
    active: list[list[tuple[int, ...]]]
    velocity: Array


class BranchPoint(NamedTuple):
    """A point from which several solutions go on, and which one was taken; None where the run stopped."""

    t: float
    n_continuations: int
    taken: int | None


class Contact(NamedTuple):
    """A surface that is only touched, see `Event`."""

    t: float
    subsystem: int
    rate: float
    transversality: float


class Accumulation(NamedTuple):
    """Accumulating switches: where, until when they were passed, by how many steps of `zeno="time_stepping"`, and what
    these added to the error relative to the tolerance."""

    t: float
    until: float
    steps: int
    error: float


class Gradient(NamedTuple):
    """Gradient with respect to initial state, parameters and controls."""

    x0: Array
    p: Array
    u: Array


@dataclass(frozen=True)
class RunStats:
    """Work of a run; time in seconds."""

    steps: int
    rejections: int
    relocations: int
    evaluations: int
    jacobians: int
    newton: int
    factorisations: int
    switches: int
    accumulations: int
    time_total: float
    jumps: int
    impacts: int

    @classmethod
    def _of(cls, c: Any) -> RunStats:
        return cls(**{f.name: getattr(c, f.name) for f in fields(cls)})


OnStep = Callable[[Step], Any]
OnBranching = Callable[[Branching], Any]


def _step_callback(f: OnStep | None) -> Any:
    """Asks every step whether to go on: after Ctrl-C, or by the wish of the user. It is there in any case, because
    Python looks for signals only where it runs."""

    def progress(info: int, _: Any) -> int:
        current = frame()
        try:
            if current.stop or current.error is not None:
                return 1
            if f is None:
                return 0
            c = _ffi.swb_progress.from_address(info)
            x = _numbers(c.x, (c.nx,), ctypes.c_double)
            return 1 if f(Step(c.t, x, ProgressKind(c.kind), c.steps, c.switches)) else 0
        except BaseException as error:
            if current.error is None:
                current.error = error
            return 1

    return _ffi.swb_progress_fn(progress)


def _numbers(address: int, shape: tuple[int, ...], kind: Any) -> Array:
    """A copy of numbers of the library."""
    if not all(shape):
        return numpy.empty(shape, dtype=kind)
    return numpy.ctypeslib.as_array(ctypes.cast(address, ctypes.POINTER(kind)), shape).copy()


def _decide_callback(f: OnBranching | None, n_modes: Sequence[int]) -> Any:
    if f is None:
        return _ffi.swb_decide_fn(0)
    ends = numpy.cumsum([0, *n_modes])

    def modes(flags: Array) -> list[tuple[int, ...]]:
        parts = [flags[a:b] for a, b in zip(ends, ends[1:])]
        return [tuple(int(m) for m in numpy.flatnonzero(part)) for part in parts]

    def decide(info: int, _: Any) -> int:
        current = frame()
        try:
            if current.error is not None:
                return -1
            b = _ffi.swb_branching.from_address(info)
            active = _numbers(b.active, (b.n_continuations, b.n_modes), ctypes.c_int32)
            velocity = _numbers(b.velocity, (b.n_continuations, b.nx), ctypes.c_double)
            x = _numbers(b.x, (b.nx,), ctypes.c_double)
            before = modes(_numbers(b.before, (b.n_modes,), ctypes.c_int32))
            taken = f(Branching(b.t, x, before, [modes(row) for row in active], velocity))
            return -1 if taken is None else index(taken, "what on_branching returns")
        except BaseException as error:
            if current.error is None:
                current.error = error
            return -1

    return _ffi.swb_decide_fn(decide)


def _differentiated(sensitivity: Any) -> int:
    """The option `sensitivity`: a truth value, or what derivatives are by."""
    if sensitivity is None or isinstance(sensitivity, (bool, numpy.bool_)):
        return int(bool(sensitivity))
    return int(choice(Sensitivity, sensitivity, "sensitivity"))


def _span(t_span: Any) -> tuple[float, float]:
    """A duration from 0 on, or start and end."""
    shape = seen(t_span, "t_span").shape
    if shape not in ((), (2,)):
        raise DimensionError(f"t_span has shape {shape}: give the end, or start and end")
    values = real(t_span, "t_span")
    if values.ndim == 0:
        return 0.0, float(values)
    return float(values[0]), float(values[1])


class Run(Hints, Recorded, Handle):
    """Result of a simulation. Call it for the states at any times, if it was made with `dense`; `run["q"]` are the values of a
    state at the times `t`. It can be copied, pickled, and written by `save` (see `switchback.load`).

    t, x               starts and ends of the steps, [n] and [n, nx]; without `dense` the end only
    t_start, t_end     from when to when
    x_end              [nx] state reached
    switches           in the order of time, a list of `Event`
    jumps              the transitions in the order of time, a list of `Jump`
    outcome, success   how it ended; did it reach its time?
    reason             why it ended early, in words
    stats              work
    n_modes            numbers of modes of the subsystems that can switch
    dx_dx0, dx_dp, dx_du   derivatives of the state reached, [nx, nx], [nx, np], [nx, nu], or None; with
                           sensitivity="inputs" without dx_dx0, and below without the first nx columns
    switch_derivatives     those of the switching times, [n_switches, nx + np + nu], or None
    jump_derivatives       those of the times of the transitions, [n_jumps, nx + np + nu], or None
    impacts            of a scene in the order of time, a list of `Impact`, one for every contact with an impulse
    impact_derivatives     those of the times of the impacts, [n_impacts, nx + np + nu], or None
    one_sided          the derivatives hold for one side only
    redundant          contacts of a scene were redundant: the motion is unique, the forces are those of least norm
    branch_points      points with several continuations
    contacts           surfaces only touched
    accumulations      points at which switches accumulate
    """

    _kind = "run"
    _instead = {
        "y": "states are run['name'], or run.x with a row for each of the times run.t; run(times) are those in between",
        "sol": "the run itself is the dense output: run(times)",
        "message": "run.reason says why it ended early",
        "status": "run.outcome says how it ended, run.success whether it reached its time",
        "nfev": "run.stats.evaluations",
        "njev": "run.stats.jacobians",
        "t_events": "run.switch_times, and run.switches with what happened",
        "y_events": "run(run.switch_times)",
        "sensitivity": "run.dx_dx0, run.dx_dp, run.dx_du, with the option sensitivity=True",
        "u": "controls are inputs of a simulation; those of an optimal control problem are result.controls",
    }
    outcome: RunOutcome
    t: Array
    x: Array
    x_end: Array
    switches: list[Event]
    jumps: list[Jump]
    stats: RunStats
    dx_dx0: Array | None
    dx_dp: Array | None
    dx_du: Array | None
    switch_derivatives: Array | None
    jump_derivatives: Array | None
    impacts: list[Impact]
    impact_derivatives: Array | None
    _p: Array | None = None  # parameters, where they are known
    _u: Array | None = None  # controls, a row for each of equal pieces of the time span
    _span: tuple[float, float] = (0.0, 0.0)
    _steady: dict[int, tuple[int, ...]]  # modes of subsystems that never switched, where they are known

    def __init__(self) -> None:
        raise TypeError("runs come from a simulation")

    @classmethod
    def _of(cls, source: Handle, *arguments: Any) -> Run:
        """The run of an object, of which nothing is read yet."""
        self = cls.__new__(cls)
        self._lock, self._uses = threading.RLock(), 0
        handle = ctypes.c_void_p()
        source._do("get_run", *arguments, ctypes.byref(handle))
        self._own(handle.value)
        return self

    @classmethod
    def _take(cls, source: Handle, sizes: tuple[int, int, int], system: System, *arguments: Any) -> Run:
        self = cls._of(source, *arguments)
        self.system, self._steady = system, {}
        self._read(sizes)
        return self

    def _sizes_of_subsystems(self, n: int) -> tuple[int, ...]:
        return tuple(int(k) for k in self._array("modes", (n,), kind=numpy.int64))

    def _array(self, name: str, shape: tuple[int, ...], *first: Any, kind: Any = numpy.float64) -> Array:
        out = numpy.empty(shape, dtype=kind)
        self._do(name, *first, address(out), out.size)
        return out

    def _read(self, sizes: tuple[int, int, int]) -> None:
        info = self._struct("get_info", _ffi.swb_run_info)
        self.nx, n = info.nx, info.n_events
        self.outcome = RunOutcome(info.outcome)
        self.success = self.outcome == RunOutcome.REACHED
        self.t_start, self.t_end = info.t_start, info.t_end
        self.reason = text(lib.swb_run_reason, self)
        self.stats = RunStats._of(self._struct("get_stats", _ffi.swb_run_stats))
        self.n_modes = self._sizes_of_subsystems(info.n_subsystems)
        self.x_end = self._array("state", (self.nx,))
        self.switches = [self._event(i, e) for i, e in enumerate(self._structs("events", _ffi.swb_event, n))]
        made = self._structs("jumps", _ffi.swb_jump, info.n_jumps)
        self.jumps = [self._jump(i, j) for i, j in enumerate(made)]
        struck = self._structs("impacts", _ffi.swb_impact, info.n_impacts)
        self.impacts = [self._impact(i) for i in struck]
        points = self._structs("branch_points", _ffi.swb_branch_point, info.n_branch_points)
        self.branch_points = [BranchPoint(b.t, b.n_continuations, b.taken if b.taken >= 0 else None) for b in points]
        touched = self._structs("contacts", _ffi.swb_contact, info.n_contacts)
        self.contacts = [Contact(c.t, c.subsystem, c.rate, c.transversality) for c in touched]
        limits = self._structs("accumulations", _ffi.swb_accumulation, info.n_accumulations)
        self.accumulations = [Accumulation(a.t, a.until, a.steps, a.error) for a in limits]
        if info.n_pieces > 0:
            self.t = self._array("times", (info.n_pieces + 1,))
            self.x = self(self.t)
        else:
            self.t, self.x = numpy.array([self.t_end]), self.x_end.reshape(1, -1).copy()
        self.one_sided = bool(info.one_sided)
        self.redundant = bool(info.redundant)
        self.dx_dx0 = self.dx_dp = self.dx_du = None
        self.switch_derivatives = self.jump_derivatives = self.impact_derivatives = None
        if info.n_columns:
            nx, np, nu = sizes
            starts = info.n_columns - np - nu
            s = self._array("sensitivity", (info.n_columns, nx)).T
            self.dx_dx0 = s[:, :starts] if starts else None
            self.dx_dp, self.dx_du = s[:, starts : starts + np], s[:, starts + np :]
            rows = [self._array("event_sensitivity", (info.n_columns,), i) for i in range(n)]
            self.switch_derivatives = numpy.array(rows).reshape(n, info.n_columns)
            rows = [self._array("jump_sensitivity", (info.n_columns,), i) for i in range(len(self.jumps))]
            self.jump_derivatives = numpy.array(rows).reshape(len(rows), info.n_columns)
            rows = [self._array("impact_sensitivity", (info.n_columns,), i) for i in range(len(self.impacts))]
            self.impact_derivatives = numpy.array(rows).reshape(len(rows), info.n_columns)

    def _structs(self, name: str, kind: Any, n: int) -> list[Any]:
        if n == 0:
            return []
        found = (kind * n)()
        self._do(name, found, n, ctypes.sizeof(kind))
        return list(found)

    def _jump(self, i: int, j: Any) -> Jump:
        before, after = numpy.empty(self.nx), numpy.empty(self.nx)
        self._do("jump_states", i, address(before), address(after), self.nx)
        return Jump(j.t, j.transition, before, after, bool(j.simultaneous), j.rate)

    def _impact(self, i: Any) -> Impact:
        n = self._n_tangents(i.contact)
        return Impact(
            i.t,
            i.contact,
            self.system._contacts[i.contact][0],
            ImpactKind(i.kind),
            i.rate_before,
            i.rate_after,
            i.normal,
            (i.tangential, i.tangential2)[:n],
            i.depth,
            bool(i.simultaneous),
            bool(i.unique),
        )

    def _n_tangents(self, contact: int) -> int:
        return self.system._contacts[contact][1]

    def _contact(self, contact: Any) -> int:
        names = [c[0] for c in self.system._contacts]
        if self.system._scene is None:
            raise ArgumentError("the run is not that of a scene: it has no contacts of bodies")
        own = getattr(self.system._scene, "contacts", [])
        if isinstance(contact, SceneContact) and not any(contact is c for c in own):
            raise ArgumentError(f"contact '{contact.name}' is one of another scene")
        name = contact.name if isinstance(contact, SceneContact) else contact
        if isinstance(name, str):
            if name not in names:
                raise ArgumentError(f"there is no contact '{name}' in this run, only {', '.join(names) or 'none'}")
            return names.index(name)
        k = index(contact, "contact")
        if not 0 <= k < len(names):
            raise DimensionError(f"there is no contact {k}, their number is {len(names)}")
        return k

    def mode(self, contact: Any, t: Any = None) -> Array:
        """Modes of a contact of a scene, a `SceneContact`, its name or its number, at times (`t` of the run by default):
        integers of `ContactMode`. At the time of an event they are those before it."""
        k = self._contact(contact)
        return self._modes(self.t if t is None else real(t, "t"))[..., k]

    def _modes(self, times: Array) -> Array:
        """Modes of all contacts, [..., contacts]."""
        flat = numpy.ascontiguousarray(times.reshape(-1))
        n = len(self.system._contacts)
        out = numpy.empty((flat.size, n), dtype=numpy.int64)
        self._do("contact_modes", address(flat), flat.size, address(out), out.size)
        return out.reshape((*times.shape, n))

    def force(self, contact: Any, t: Any = None) -> Array:
        """Forces of a contact of a scene at times (`t` of the run by default), [..., 1 + number of tangents]: the normal force,
        then those along the tangents. Forces, not impulses, which are in `impacts`."""
        k = self._contact(contact)
        return self._forces(self.t if t is None else real(t, "t"))[..., k, : 1 + self._n_tangents(k)]

    def _forces(self, times: Array) -> Array:
        """Forces of all contacts, [..., contacts, 3]."""
        flat = numpy.ascontiguousarray(times.reshape(-1))
        n = len(self.system._contacts)
        out = numpy.empty((flat.size, n, 3))
        self._do("contact_forces", address(flat), flat.size, address(out), out.size)
        return out.reshape((*times.shape, n, 3))

    def _event(self, i: int, e: Any) -> Event:
        n = self.n_modes[e.subsystem]
        before, after = numpy.empty(n, dtype=numpy.int32), numpy.empty(n, dtype=numpy.int32)
        self._do("event_modes", i, address(before), address(after), n)
        modes = [tuple(int(m) for m in numpy.flatnonzero(flags)) for flags in (before, after)]
        return Event(
            e.t,
            EventKind(e.kind),
            e.subsystem,
            modes[0],
            modes[1],
            bool(e.simultaneous),
            bool(e.unique),
            e.rate,
            e.transversality,
        )

    @property
    def switch_times(self) -> Array:
        """Times of the switches."""
        return numpy.array([s.t for s in self.switches])

    def __call__(self, t: Any, k: int = 0) -> Array:
        """States at times between start and end, [..., nx], or their `k`-th derivatives. At a switch the step before it
        counts."""
        times = real(t, "t")
        flat = numpy.ascontiguousarray(times.reshape(-1))
        out = numpy.empty((flat.size, self.nx))
        self._do("evaluate", address(flat), flat.size, index(k, "k"), address(out), out.size)
        return out.reshape((*times.shape, self.nx))

    def active(self, subsystem: int = 0) -> list[tuple[float, float, tuple[int, ...]]]:
        """Intervals (start, end, active modes) between the switches of a subsystem. Of one that never switches they are known
        where the run comes from `simulate` or an `Integrator`; otherwise the list is empty."""
        k = index(subsystem, "subsystem")
        if not 0 <= k < len(self.n_modes):
            raise DimensionError(f"there is no subsystem {k} that switches, their number is {len(self.n_modes)}")
        own = [s for s in self.switches if s.subsystem == k]
        if not own and k in self._steady:
            return [(self.t_start, self.t_end, self._steady[k])] if self.t_end > self.t_start else []
        starts = [self.t_start] + [s.t for s in own]
        ends = [s.t for s in own] + [self.t_end]
        modes = [s.before for s in own[:1]] + [s.after for s in own]
        return [(a, b, m) for a, b, m in zip(starts, ends, modes) if b > a]

    def discrete(self, state: Any) -> list[Any]:
        """The values of a discrete state in their order, with their times: a list of `Interval(start, end, value)`.

        `state` is an `Automaton`, whose states are named then, or a discrete state by name, place or as an expression.
        """
        from .automaton import Automaton, intervals, place_of

        if isinstance(state, Automaton):
            return state.sequence(self)
        return intervals(self, place_of(self.system, state))

    @property
    def mode_names(self) -> list[list[str]]:
        """Names of the modes of every subsystem: sides of the switching functions such as "q > 0.5" for a model, else numbers."""
        from ._regions import mode_names

        return mode_names(self.system, self.n_modes)

    def _series(self) -> tuple[Array, dict[str, Array]]:
        columns = dict(zip(labels(self.system._names[0], "x", self.nx), self.x.T))
        if self._u is not None:
            times, rows = self.controls
            place = numpy.clip(numpy.searchsorted(times, self.t, side="right") - 1, 0, len(rows) - 1)
            columns.update(zip(labels(self.system._names[1], "u", rows.shape[1]), rows[place].T))
        return self.t, columns

    @property
    def controls(self) -> tuple[Array, Array]:
        """Times between which the controls were constant, [n + 1], and the controls there, [n, nu]; without rows where the run
        does not come from `simulate`."""
        if self._u is None:
            return numpy.array([self.t_start, self.t_end]), numpy.empty((1, 0))
        return numpy.linspace(*self._span, len(self._u) + 1), self._u

    def _facts(self) -> dict[str, Any]:
        facts = {
            "outcome": self.outcome.name.lower(),
            "success": self.success,
            "t_start": self.t_start,
            "t_end": self.t_end,
            "x_end": self.x_end,
            "switch_times": self.switch_times,
            "steps": self.stats.steps,
            "time_total": self.stats.time_total,
        }
        more = {
            "jump_times": numpy.array([j.t for j in self.jumps]),
            "impact_times": numpy.array([i.t for i in self.impacts]),
            "reason": self.reason,
        }
        return {**facts, **{k: v for k, v in more.items() if len(v)}}

    def __reduce__(self) -> Any:
        from .saved import SavedRun

        return SavedRun._of(self).__reduce__()

    def table(self) -> str:
        """The switches as text."""
        lines = [f"{'t':>22}  {'kind':<11} {'subsystem':>9}  modes"]
        words = self.mode_names
        for s in self.switches:
            notes = [w for w, on in (("simultaneous", s.simultaneous), ("not unique", not s.unique)) if on]
            change = f"{_set(s.before)} -> {_set(s.after)}" + (f"  ({', '.join(notes)})" if notes else "")
            own = words[s.subsystem]
            if own[0] != "0":
                change += "  " + " -> ".join(_words(own, modes) for modes in (s.before, s.after))
            lines.append(f"{s.t:22.15g}  {s.kind.name.lower():<11} {s.subsystem:>9}  {change}")
        return "\n".join(lines)

    def plot(self, path: Any = None, **keywords: Any) -> Any:
        """See `switchback.plot_run`."""
        from .plot import plot_run

        return plot_run(self, path, **keywords)

    def plot_phase(self, path: Any = None, **keywords: Any) -> Any:
        """See `switchback.plot_phase`."""
        from .plot import plot_phase

        return plot_phase(self, path, **keywords)

    def plot_contacts(self, path: Any = None, **keywords: Any) -> Any:
        """See `switchback.plot_contacts`."""
        from .plot import plot_contacts

        return plot_contacts(self, path, **keywords)

    def animate(self, path: Any, **keywords: Any) -> None:
        """See `switchback.animate`."""
        from .animation import animate

        animate(self, path, **keywords)

    def __repr__(self) -> str:
        if self.closed:
            return "<Run, closed>"
        n = len(self.switches)
        return f"<Run from {self.t_start:g} to {self.t_end:g}, {self.outcome}, {n} switch{'' if n == 1 else 'es'}>"


def _words(names: Sequence[str], modes: Sequence[int]) -> str:
    """Active modes in words."""
    return " and ".join(names[m] for m in modes) if len(modes) < 2 else f"sliding ({', '.join(names[m] for m in modes)})"


def _set(modes: Sequence[int]) -> str:
    return "{" + ", ".join(map(str, modes)) + "}"


def _chosen(settings: Any, named: Mapping[str, Any], options: Mapping[str, Any]) -> tuple[Settings, Any]:
    """Settings, and tolerances state by state if there are any."""
    values = dict(options)
    if named["method"] is not None:
        values["integration"] = method_of(named["method"])
    tolerances = {name: named[name] for name in ("rtol", "atol") if named[name] is not None}
    each = any(numpy.ndim(v) > 0 for v in tolerances.values())
    if not each:
        values.update(tolerances)
    chosen = Settings._from(settings, values)
    if not each:
        return chosen, None
    get = lambda name: seen(tolerances.get(name, getattr(chosen, name)), name)  # noqa: E731
    return chosen, (get("rtol"), get("atol"))


class Integrator(Hints, Handle, HasSettings):
    """Event-driven integrator of a system or model, step by step, in the vocabulary of SUNDIALS.

    `rtol` and `atol` are one number, or one for each state; `method` is "auto", "dp5", "dop853" or "radau5". Options
    that change later are taken over by the next `reinit`, or at once before the first step.
    """

    _kind = "integrator"

    _instead = {
        "t": "the time reached is integrator.time, the state integrator.state",
        "x": "the state reached is integrator.state, the time integrator.time",
        "y": "the state reached is integrator.state, the time integrator.time",
        "solve": "advance(t) integrates to a time, step(t) does one step",
        "integrate": "advance(t) integrates to a time, step(t) does one step",
    }

    def __init__(
        self,
        system: System | Model,
        settings: Settings | Mapping[str, Any] | None = None,
        *,
        rtol: Any = None,
        atol: Any = None,
        method: str | None = None,
        preferred: Mapping[int, Sequence[int]] | None = None,
        on_step: OnStep | None = None,
        on_branching: OnBranching | None = None,
        on_log: OnLog | None = None,
        **options: Any,
    ):
        self.system = system_of(system)
        self.nx, self.nu, self.np = self.system.nx, self.system.nu, self.system.np
        verbose = take_verbose(options)
        chosen, tolerances = _chosen(settings, {"rtol": rtol, "atol": atol, "method": method}, options)
        on_log, _ = monitors(chosen, verbose, on_log)
        self._p: Array | None = None
        self._create(self.system, ctypes.byref(chosen._c))
        self._functions = list(self.system._functions)
        if tolerances is not None:
            self.set_tolerances(*tolerances)
        with Run._of(self) as nothing:
            n_subsystems = nothing._struct("get_info", _ffi.swb_run_info).n_subsystems
            self._n_modes: tuple[int, ...] = nothing._sizes_of_subsystems(n_subsystems)
        for subsystem, modes in (preferred or {}).items():
            self.set_preferred(subsystem, modes)
        if preferred is not None:
            self.set(ambiguity="prefer")
        self.on_step(on_step)
        self.on_branching(on_branching)
        self.on_log(on_log)

    def on_step(self, f: OnStep | None) -> None:
        """Set who is called with a `Step` once per accepted step; a true answer stops."""
        if f is not None and not callable(f):
            raise ArgumentError(f"on_step must be a function, not {type(f).__name__}")
        callback = _step_callback(f)
        self._do("set_progress", callback, None)
        self._progress = callback

    def on_log(self, f: OnLog | None) -> None:
        """Set who is called with (level, line) of the log; how much comes is the option log_level."""
        if f is not None and not callable(f):
            raise ArgumentError(f"on_log must be a function, not {type(f).__name__}")
        callback = _log_callback(f)
        self._do("set_log", callback, None)
        self._log = callback

    def on_branching(self, f: OnBranching | None) -> None:
        """Set who is called with a `Branching` where the continuation is not unique, before the option ambiguity decides:
        returns the number of the continuation to take, or None to stop."""
        if f is not None and not callable(f):
            raise ArgumentError(f"on_branching must be a function, not {type(f).__name__}")
        callback = _decide_callback(f, self._n_modes)
        self._do("set_decider", callback, None)
        self._decider = callback

    def set_preferred(self, subsystem: int, modes: Sequence[int]) -> None:
        """Set the modes a subsystem should take where the continuation is not unique, the preferred first, for the option
        ambiguity="prefer"."""
        array = numpy.array([index(m, "modes") for m in modes], dtype=numpy.int64)
        self._do("set_preferred", index(subsystem, "subsystem"), address(array), array.size)

    def set_tolerances(self, rtol: Any, atol: Any) -> None:
        """Set tolerances of the local error, one number or one for each state."""
        r, a = (one_or(v, self.nx, name) for v, name in ((rtol, "rtol"), (atol, "atol")))
        self._do("set_tolerances", address(r), r.size, address(a), a.size)

    def reinit(self, x: Any, t: float = 0.0) -> None:
        """Set state and time, and begin anew: log, statistics, derivatives and dense output are cleared."""
        if numpy.ndim(x) == 0 and not isinstance(x, Mapping) and numpy.ndim(t) == 1:
            raise ArgumentError("the state comes first: reinit(x, t)")
        array = self.system._start(x, "x")
        self._do("reinit", number(t, "t"), address(array), array.size)

    def set_controls(self, u: Any) -> None:
        """Set the controls, constant from now on."""
        array = self.system._controls(u)
        self._do("set_controls", address(array), array.size)

    def set_params(self, p: Any) -> None:
        """Set the parameters."""
        array = self.system._params(p)
        self._do("set_params", address(array), array.size)
        self._p = array.copy()

    def set_stop_times(self, t: Any) -> None:
        """Set times at which steps end, in any order."""
        array = numpy.atleast_1d(real(t, "t"))
        self._do("set_stop_times", address(array), array.size)

    def step(self, t_stop: float) -> ProgressKind:
        """Do one step, not beyond `t_stop` nor a stop time."""
        kind = ctypes.c_int32()
        self._do("step", number(t_stop, "t_stop"), ctypes.byref(kind), interruptible=True)
        return ProgressKind(kind.value)

    def advance(self, t: float) -> RunOutcome:
        """Integrate to the time `t`, exactly."""
        outcome = ctypes.c_int32()
        self._do("advance", number(t, "t"), ctypes.byref(outcome), interruptible=True)
        return RunOutcome(outcome.value)

    def get_dky(self, t: float, k: int = 0) -> Array:
        """`k`-th derivative of the dense output at a time in the last step."""
        out = numpy.empty(self.nx)
        self._do("get_dky", number(t, "t"), index(k, "k"), address(out), out.size)
        return out

    def adjoint(
        self,
        v: Any,
        at: Sequence[tuple[float, Any]] = (),
        switches: Mapping[int, float] | None = None,
    ) -> Gradient:
        """Gradient of a function of the run, with the option `adjoint`: `v` is its derivative with respect to the state
        reached, `at` has pairs of a time where the run had stopped and the derivative with respect to the state there,
        `switches` the derivatives with respect to switching times by their number."""
        final = vector(v, self.nx, "v")
        pairs = list(at)
        times = real([t for t, _ in pairs], "at")
        states = numpy.array([vector(w, self.nx, "at") for _, w in pairs], dtype=float).reshape(len(pairs), self.nx)
        chosen = dict(switches or {})
        events = numpy.array([index(i, "switches") for i in chosen], dtype=numpy.int64)
        weights = real(list(chosen.values()), "switches")
        g = Gradient(numpy.empty(self.nx), numpy.empty(self.np), numpy.empty(self.nu))
        inputs = [a for array in (final, times, states, events, weights) for a in (address(array), array.size)]
        outputs = [a for array in g for a in (address(array), array.size)]
        self._do("adjoint", *inputs, *outputs)
        return g

    def active(self, subsystem: int = 0) -> tuple[int, ...]:
        """Active modes of a subsystem, counted among those that can switch; none before the first step."""
        k = index(subsystem, "subsystem")
        flags = numpy.empty(self._n_modes[k] if 0 <= k < len(self._n_modes) else 0, dtype=numpy.int32)
        self._do("get_active", k, address(flags), flags.size)
        return tuple(int(m) for m in numpy.flatnonzero(flags))

    def interrupt(self) -> None:
        """Stop the call that runs now, or the next one; from any thread and from signal handlers."""
        self._hold()
        try:
            lib.swb_integrator_interrupt(self._handle)
        finally:
            self._release()

    @property
    def time(self) -> float:
        """Time reached."""
        return self._get("get_time", ctypes.c_double)

    def _state(self, name: str) -> Array:
        out = numpy.empty(self.nx)
        self._do(name, address(out), out.size)
        return out

    @property
    def state(self) -> Array:
        """State reached."""
        return self._state("get_state")

    @property
    def derivative(self) -> Array:
        """Derivative of the state under the present active modes."""
        return self._state("get_derivative")

    @property
    def outcome(self) -> RunOutcome:
        """How the simulation stands."""
        return RunOutcome(self._get("get_outcome", ctypes.c_int32))

    @property
    def reason(self) -> str:
        """Why it ended early, in words."""
        return text(lib.swb_integrator_get_reason, self)

    @property
    def stats(self) -> RunStats:
        """Work since the last `reinit`."""
        return RunStats._of(self._struct("get_stats", _ffi.swb_run_stats))

    @property
    def run(self) -> Run:
        """A copy of the result since the last `reinit`."""
        run = Run._take(self, (self.nx, self.np, self.nu), self.system)
        run._p = self._p
        switched = {s.subsystem for s in run.switches}
        if run.jumps:  # a jump may lead to other modes
            return run
        still = ((k, self.active(k)) for k in range(len(self._n_modes)) if k not in switched)
        run._steady = {k: modes for k, modes in still if modes}
        return run

    def __repr__(self) -> str:
        return "<Integrator, closed>" if self.closed else f"<Integrator at t={self.time:g}>"


@contextlib.contextmanager
def _closing(bar: Progress | None) -> Iterator[None]:
    try:
        yield
    finally:
        if bar is not None:
            bar.close()


def _with_progress(wanted: Any, on_step: OnStep | None, start: float, end: float) -> tuple[OnStep | None, Any]:
    """What hears of steps where progress is to be shown too, and what ends that."""
    if not wanted or not end > start:
        return on_step, _closing(None)
    bar = Progress(wanted, 0, 100, "%")
    said = 0

    def both(step: Step) -> Any:
        nonlocal said
        now = int(100 * (step.t - start) / (end - start))
        if now > said:
            bar.add(now - said)
            said = now
        return on_step(step) if on_step is not None else None

    return both, _closing(bar)


def simulate(
    system: System | Model | Scene,
    x0: Any,
    t_span: Any,
    *,
    u: Any = None,
    p: Any = None,
    rtol: Any = None,
    atol: Any = None,
    method: str | None = None,
    dense: bool = True,
    sensitivity: bool | str = False,
    stop_times: Any = None,
    preferred: Mapping[int, Sequence[int]] | None = None,
    settings: Settings | Mapping[str, Any] | None = None,
    on_step: OnStep | None = None,
    on_branching: OnBranching | None = None,
    on_log: OnLog | None = None,
    progress: Any = None,
    **options: Any,
) -> Run:
    """Simulate a system, model or scene from x0 over `t_span`: the end, or (start, end).

    `u` are constant controls, or with several rows those of equal pieces of the time span; `p` are parameters. `rtol`
    and `atol` are one number, or one for each state (1e-8 and 1e-10), `method` is "auto", "dp5", "dop853" or "radau5".
    Where the continuation is not unique `on_branching` decides, or the lists of modes in `preferred`, by subsystem, or the
    option `ambiguity`. `sensitivity=True` asks for derivatives by initial state, parameters and controls, "inputs" for those by parameters and
    controls only. Look at `run.success`: a simulation may end early, `run.reason` says why. `progress=True` shows a bar
    (of tqdm, where it is installed), a function is called with the percentage done and 100. For stepping use an `Integrator`, for the
    discretisation with complementarity constraints `simulate_fesd`.
    """
    options = translated(options)
    options |= {"dense": int(bool(dense)), "sensitivity": _differentiated(sensitivity)}
    start, end = _span(t_span)
    on_step, done = _with_progress(progress, on_step, start, end)
    with done, Integrator(
        system,
        settings,
        rtol=rtol,
        atol=atol,
        method=method,
        preferred=preferred,
        on_step=on_step,
        on_branching=on_branching,
        on_log=on_log,
        **options,
    ) as i:
        if p is not None or i.np:
            i.set_params(p)
        pieces = numpy.empty((1, 0))
        if u is not None or i.nu:
            pieces = table(u, None, i.nu, "u") if numpy.ndim(u) == 2 else i.system._controls(u).reshape(1, -1)
        if len(pieces) == 0:
            raise DimensionError("u has no rows")
        if stop_times is not None:
            i.set_stop_times(stop_times)
        i.reinit(i.system._start(x0, "x0"), start)
        if not end >= start:
            raise RangeError(f"t_span is {start:g} to {end:g}: the end must not lie before the start; the order is (system, x0, t_span)")
        for k, row in enumerate(pieces):
            if row.size:
                i.set_controls(row)
            last = k + 1 == len(pieces)
            if i.advance(end if last else start + (end - start) * (k + 1) / len(pieces)) != RunOutcome.REACHED:
                break
        run = i.run
        run._u = pieces if i.nu else None
        run._span = start, end
        return run


@dataclass(frozen=True)
class Batch(Sequence[Run]):
    """Results of a batch: `x` are the final states, [n, nx], NaN for runs that failed; `batch[i]` is a `Run`, or raises
    what the run failed with."""

    x: Array
    success: Array
    _owner: Any = field(repr=False)

    def __len__(self) -> int:
        return len(self.x)

    def __getitem__(self, i: Any) -> Any:
        k = index(i, "index")
        if not -len(self) <= k < len(self):
            raise IndexError(f"there is no run {k}, the batch has {len(self)}")
        return self._owner._run(k % len(self))

    def __iter__(self) -> Iterator[Run]:
        return (self[i] for i in range(len(self)))


class _Batch(Handle):
    _kind = "batch"

    def __init__(self, system: System, settings: Settings):
        self.system = system
        self._functions = list(system._functions)
        self._create(system, ctypes.byref(settings._c))

    def _interrupt(self) -> None:
        lib.swb_batch_interrupt(self._handle)

    def _run(self, i: int) -> Run:
        s = self.system
        return Run._take(self, (s.nx, s.np, s.nu), s, i)


def simulate_batch(
    system: System | Model,
    x0: Any,
    t_span: Any,
    *,
    u: Any = None,
    p: Any = None,
    threads: int = 0,
    rtol: float | None = None,
    atol: float | None = None,
    method: str | None = None,
    dense: bool = False,
    sensitivity: bool | str = False,
    settings: Settings | Mapping[str, Any] | None = None,
    **options: Any,
) -> Batch:
    """Simulate from every row of `x0`, [n, nx], on several threads (0: one for each processor).

    `u` and `p` are one row for all runs, or one for each. All three may be dictionaries from names to numbers, or to arrays with
    a number for each run. The results are those of single runs to the last bit,
    whatever the number of threads. Functions written in Python are called by one thread only.
    """
    s = system_of(system)
    options = translated(options)
    x0, u, p = (rows(value, names, what) for value, names, what in zip((x0, u, p), s._names, ("x0", "u", "p")))
    smooth = s.nx - len(s._discrete)
    if s._discrete and numpy.ndim(x0) == 2 and numpy.shape(x0)[1] == smooth:
        given = table(x0, None, smooth, "x0")
        starts = numpy.hstack([given, numpy.tile(s._discrete, (len(given), 1))])
    else:
        starts = table(x0, None, s.nx, "x0")
    if len(starts) == 0:
        raise DimensionError("x0 has no rows")

    def inputs(value: Any, width: int, name: str) -> Array:
        if value is None:
            if width:
                named_vector(None, s._names["xup".index(name)], width, name)
            return numpy.empty(0)
        one = numpy.ndim(value) < 2 and not (width == 1 and numpy.ndim(value) == 1 and numpy.size(value) == len(starts))
        return vector(value, width, name) if one else table(value, len(starts), width, name)

    controls, params = inputs(u, s.nu, "u"), inputs(p, s.np, "p")
    options |= {"dense": int(bool(dense)), "sensitivity": _differentiated(sensitivity)}
    chosen, each = _chosen(settings, {"rtol": rtol, "atol": atol, "method": method}, options)
    if each is not None:
        raise ArgumentError("a batch takes one rtol and one atol for all states")
    start, end = _span(t_span)
    batch = _Batch(s, chosen)
    given = (address(starts), starts.size, address(controls), controls.size, address(params), params.size)
    n_threads = index(threads, "threads")
    if any(f._in_python for f in s._functions):
        batch._do("run", start, end, *given, n_threads, interruptible=True)
    else:
        aside(lambda: batch._do("run", start, end, *given, n_threads), batch._interrupt)
    x, outcomes = numpy.empty(starts.shape), numpy.empty(len(starts), dtype=numpy.int32)
    batch._do("states", address(x), x.size)
    batch._do("outcomes", address(outcomes), outcomes.size)
    return Batch(x, outcomes == RunOutcome.REACHED, batch)
