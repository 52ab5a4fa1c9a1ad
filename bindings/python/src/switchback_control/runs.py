"""What came out of an event-driven simulation."""

from __future__ import annotations

import ctypes
import threading
from dataclasses import dataclass, fields
from typing import Any, NamedTuple, Sequence

import numpy

from . import _ffi
from ._arrays import Array, address, index, real
from ._call import Handle, text
from ._ffi import EventKind, ProgressKind, RunOutcome
from ._foreign import Hints
from ._library import lib
from ._names import named_vector, nearest
from .errors import ArgumentError, DimensionError, StateError
from .recorded import EndState, Recorded, labels
from .scene import Impact, ImpactKind, SceneContact
from .system import System

__all__ = [
    "Accumulation",
    "BranchPoint",
    "Branching",
    "Contact",
    "Event",
    "Gradient",
    "Jump",
    "Noted",
    "Run",
    "RunStats",
    "Step",
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


class Noted(NamedTuple):
    """What an event of `Model.note` wrote down: the number of the event, the state, and the rate at which its guard passes zero, NaN where a jump of
    the state has made its condition true."""

    t: float
    event: int
    x: Array
    rate: float


class ByEvent(Sequence[Array]):
    """An array for each event of a model, in the order they were added, then for each subsystem that switches: `run.t_events[0]`, and
    `run.t_events["landed"]` by the name of an event, or `run.t_events["subsystem 0"]`."""

    def __init__(self, names: Sequence[str], arrays: Sequence[Array]):
        self._names, self._arrays = tuple(names), tuple(arrays)

    def keys(self) -> tuple[str, ...]:
        """Names, in the order of the arrays."""
        return self._names

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, str):
            if key not in self._names:
                raise KeyError(f"there is no event '{key}'{nearest(key, self._names)}")
            return self._arrays[self._names.index(key)]
        return self._arrays[key]

    def __contains__(self, key: object) -> bool:
        return key in self._names

    def __len__(self) -> int:
        return len(self._arrays)

    def __repr__(self) -> str:
        return "{" + ", ".join(f"{n!r}: {a!r}" for n, a in zip(self._names, self._arrays)) + "}"


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
    notes: int = 0

    @classmethod
    def _of(cls, c: Any) -> RunStats:
        return cls(**{f.name: getattr(c, f.name) for f in fields(cls)})


def _numbers(address: int, shape: tuple[int, ...], kind: Any) -> Array:
    """A copy of numbers of the library."""
    if not all(shape):
        return numpy.empty(shape, dtype=kind)
    return numpy.ctypeslib.as_array(ctypes.cast(address, ctypes.POINTER(kind)), shape).copy()


class Run(Hints, Recorded, Handle):
    """Result of a simulation. Call it for the states at any times, if it was made with `dense`; `run["q"]` are the values of a
    state at the times `t`. It can be copied, pickled, and written by `save` (see `switchback_control.load`).

    t, x               starts and ends of the steps, [n] and [n, nx]; without `dense` the end only
    y                  the states the other way round, [nx, n]: a view of x
    t_events, y_events times of every event, and the states just before, [n, nx]: by the name of an event or its number
    t_start, t_end     from when to when
    x_end              [nx] state reached
    switches           in the order of time, a list of `Event`
    jumps              the transitions in the order of time, a list of `Jump`; what ended the run is the last one
    notes              what `Model.note` wrote down, a list of `Noted`
    stopped_by         the event that ended the run, by its name, else its number; None if none did
    outcome, success   how it ended; did it reach its time, or an event that ends it?
    reason             why it ended early, in words; if it did not, what is not known to the tolerances, or ""
    stats              work
    n_modes            numbers of modes of the subsystems that can switch
    dx_dx0, dx_dp, dx_du   derivatives of the state reached, [nx, nx], [nx, np], [nx, nu], or None; with
                           sensitivity="inputs" without dx_dx0, and below without the first nx columns
    switch_derivatives     those of the switching times, [n_switches, nx + np + nu], or None
    jump_derivatives       those of the times of the transitions, [n_jumps, nx + np + nu], or None
    note_derivatives       those of the times of the notes, [n_notes, nx + np + nu], or None; NaN where a step was implicit
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
        "sol": "the run itself is the dense output: run(times)",
        "message": "run.reason says why it ended early",
        "status": "run.outcome says how it ended, run.success whether it reached its time",
        "nfev": "run.stats.evaluations",
        "njev": "run.stats.jacobians",
        "sensitivity": "run.dx_dx0, run.dx_dp, run.dx_du, with the option sensitivity=True",
        "u": "controls are inputs of a simulation; those of an optimal control problem are result.controls",
    }
    outcome: RunOutcome
    t: Array
    x: Array
    x_end = EndState()
    switches: list[Event]
    jumps: list[Jump]
    notes: list[Noted]
    stopped_by: str | int | None
    stats: RunStats
    dx_dx0: Array | None
    dx_dp: Array | None
    dx_du: Array | None
    switch_derivatives: Array | None
    jump_derivatives: Array | None
    note_derivatives: Array | None
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
        self.success = self.outcome in (RunOutcome.REACHED, RunOutcome.EVENT)
        self.stopped_by = None if info.stopped_by < 0 else dict(enumerate(self._names_of_events())).get(info.stopped_by) or info.stopped_by
        self.t_start, self.t_end = info.t_start, info.t_end
        self.reason = text(lib.swb_run_reason, self)
        self.stats = RunStats._of(self._struct("get_stats", _ffi.swb_run_stats))
        self.n_modes = self._sizes_of_subsystems(info.n_subsystems)
        self._n_contacts = int(info.n_scene_contacts)
        self.x_end = self._array("state", (self.nx,))
        self.switches = [self._event(i, e) for i, e in enumerate(self._structs("events", _ffi.swb_event, n))]
        made = self._structs("jumps", _ffi.swb_jump, info.n_jumps)
        self.jumps = [self._jump(i, j) for i, j in enumerate(made)]
        noted = self._structs("notes", _ffi.swb_note, info.n_notes)
        self.notes = [Noted(c.t, c.transition, self._array("note_state", (self.nx,), i), c.rate) for i, c in enumerate(noted)]
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
            self.t, self.x = numpy.array([self.t_end]), self._last.reshape(1, -1).copy()
        self.one_sided = bool(info.one_sided)
        self.redundant = bool(info.redundant)
        self.dx_dx0 = self.dx_dp = self.dx_du = None
        self.switch_derivatives = self.jump_derivatives = self.note_derivatives = self.impact_derivatives = None
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
            rows = [self._array("note_sensitivity", (info.n_columns,), i) for i in range(len(self.notes))]
            self.note_derivatives = numpy.array(rows).reshape(len(rows), info.n_columns)
            rows = [self._array("impact_sensitivity", (info.n_columns,), i) for i in range(len(self.impacts))]
            self.impact_derivatives = numpy.array(rows).reshape(len(rows), info.n_columns)

    def _early(self) -> str:
        """Why the run ended before its time, where nobody asked for it; else ""."""
        given = self.__dict__
        if given.get("outcome", RunOutcome.REACHED) in (RunOutcome.REACHED, RunOutcome.STOPPED, RunOutcome.EVENT):
            return ""
        return f"{given['outcome']} at t = {given['t_end']:.9g}: {given['reason']:.300}"

    @property
    def _last(self) -> Array:
        """The last state, wherever the run ended."""
        return self.__dict__["x_end"]

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
        n = self._n_contacts  # of the scene, and steps of inclusions behind them that are found with their forces
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
        n = self._n_contacts  # of the scene, and steps of inclusions behind them that are found with their forces
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

    def jvp(self, x0: Any = None, p: Any = None, u: Any = None) -> Array:
        """The derivative of the last state in a direction, [nx]: `x0`, `p` and `u` are the changes of initial state, parameters and controls,
        none where they are left out. Needs `sensitivity=True`; "inputs" is enough for `p` and `u`."""
        out = numpy.zeros(self.nx)
        states, controls, parameters = self.system._names
        blocks = (("x0", x0, self.dx_dx0, states), ("p", p, self.dx_dp, parameters), ("u", u, self.dx_du, controls))
        for name, change, matrix, names in blocks:
            if change is None:
                continue
            if matrix is None:
                raise StateError(f"the derivatives by {name} are not there: simulate with sensitivity=True")
            out += matrix @ named_vector(change, names, matrix.shape[1], name)
        return out

    @property
    def y(self) -> Array:
        """States at the times `t`, [nx, n]: a view of `x`."""
        return self.x.T

    def _names_of_events(self) -> list[str]:
        """Names of the transitions of the system, "" where they have none, as far as they are known."""
        return list(getattr(self.system, "_events", ()))

    def _by_event(self, of_jump: Any, of_note: Any, of_switch: Any, shape: tuple[int, ...]) -> ByEvent:
        if self.stats.notes > len(self.notes) or self.stats.jumps > len(self.jumps) or self.stats.switches > len(self.switches):
            raise StateError("the run has more events than its lists: raise max_switches")
        names = self._names_of_events()
        last = max((*(j.transition for j in self.jumps), *(n.event for n in self.notes), -1))
        names += [""] * (last + 1 - len(names))
        found: list[list[tuple[float, Any]]] = [[] for _ in names]
        for j in self.jumps:
            found[j.transition].append((j.t, of_jump(j)))
        for n in self.notes:
            found[n.event].append((n.t, of_note(n)))
        switching: list[list[tuple[float, Any]]] = [[] for _ in self.n_modes]
        for s in self.switches:
            switching[s.subsystem].append((s.t, of_switch(s)))
        words = [name or f"event {k}" for k, name in enumerate(names)] + [f"subsystem {k}" for k in range(len(self.n_modes))]
        return ByEvent(words, [numpy.array([v for _, v in own], dtype=float).reshape(-1, *shape) for own in (*found, *switching)])

    @property
    def t_events(self) -> ByEvent:
        """Times of every event, by its name or number, then of the switches of every subsystem: `run.t_events["landed"]`, `run.t_events[0]`,
        `run.t_events["subsystem 0"]`. Error: StateError if there are more than the option max_switches."""
        return self._by_event(lambda j: j.t, lambda n: n.t, lambda s: s.t, ())

    @property
    def y_events(self) -> ByEvent:
        """States at the times `t_events`, [n, nx], just before what happens there. Those of switches are on the dense output; without that they are
        NaN."""
        known = len(self.t) > 1
        lost = numpy.full(self.nx, numpy.nan)
        return self._by_event(lambda j: j.before, lambda n: n.x, lambda s: self(s.t) if known else lost, (self.nx,))

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
            "x_end": self._last,
            "switch_times": self.switch_times,
            "steps": self.stats.steps,
            "time_total": self.stats.time_total,
        }
        more = {
            "jump_times": numpy.array([j.t for j in self.jumps]),
            "note_times": numpy.array([n.t for n in self.notes]),
            "impact_times": numpy.array([i.t for i in self.impacts]),
            "reason": self.reason,
        }
        return {**facts, **{k: v for k, v in more.items() if len(v)}}

    def __reduce__(self) -> Any:
        from .saved import SavedRun

        return SavedRun._of(self).__reduce__()

    def table(self) -> str:
        """Switches, transitions and impacts as text, in the order of time: kind, number of the subsystem, transition or contact,
        and what changed."""
        words = self.mode_names
        rows = [(s.t, s.kind.name.lower(), s.subsystem, _change(s, words[s.subsystem])) for s in self.switches]
        rows += [(j.t, "transition", j.transition, self._reset(j)) for j in self.jumps]
        rows += [(i.t, "impact", i.contact, f"{i.name}: rate {i.rate_before:g} -> {i.rate_after:g}") for i in self.impacts]
        lines = [f"{'t':>22}  {'kind':<11} {'number':>9}  change"]
        # the sort is stable: rows of one time stay in their order
        lines += [f"{t:22.15g}  {kind:<11} {number:>9}  {change}" for t, kind, number, change in sorted(rows, key=lambda row: row[0])]
        return "\n".join(lines)

    def _reset(self, j: Jump) -> str:
        """The states that a transition changed, in words."""
        names = labels(self.system._names[0], "x", self.nx)
        changed = [f"{n}: {a:g} -> {b:g}" for n, a, b in zip(names, j.before, j.after) if a != b]
        return ", ".join(changed) or "no state"

    def plot(self, path: Any = None, **keywords: Any) -> Any:
        """See `switchback_control.plot_run`."""
        from .plot import plot_run

        return plot_run(self, path, **keywords)

    def plot_phase(self, path: Any = None, **keywords: Any) -> Any:
        """See `switchback_control.plot_phase`."""
        from .plot import plot_phase

        return plot_phase(self, path, **keywords)

    def plot_contacts(self, path: Any = None, **keywords: Any) -> Any:
        """See `switchback_control.plot_contacts`."""
        from .plot import plot_contacts

        return plot_contacts(self, path, **keywords)

    def animate(self, path: Any, **keywords: Any) -> None:
        """See `switchback_control.animate`."""
        from .animation import animate

        animate(self, path, **keywords)

    def __repr__(self) -> str:
        if self.closed:
            return "<Run, closed>"
        n = len(self.switches)
        counts = [f"{n} switch{'' if n == 1 else 'es'}"]
        others = (("transition", len(self.jumps)), ("impact", len(self.impacts)))
        counts += [f"{k} {word}{'' if k == 1 else 's'}" for word, k in others if k]
        return f"<Run from {self.t_start:g} to {self.t_end:g}, {self.outcome}, {', '.join(counts)}>"


def _change(s: Event, names: Sequence[str]) -> str:
    """Active modes before and after a switch, by their numbers and, where they have names, in words."""
    notes = [w for w, on in (("simultaneous", s.simultaneous), ("not unique", not s.unique)) if on]
    change = f"{_set(s.before)} -> {_set(s.after)}" + (f"  ({', '.join(notes)})" if notes else "")
    return change if names[0] == "0" else change + "  " + " -> ".join(_words(names, modes) for modes in (s.before, s.after))


def _words(names: Sequence[str], modes: Sequence[int]) -> str:
    """Active modes in words."""
    return " and ".join(names[m] for m in modes) if len(modes) < 2 else f"sliding ({', '.join(names[m] for m in modes)})"


def _set(modes: Sequence[int]) -> str:
    return "{" + ", ".join(map(str, modes)) + "}"
