"""Event-driven simulation: every switch located, sliding modes as the equations they are."""

from __future__ import annotations

import contextlib
import ctypes
from typing import Any, Callable, Iterator, Mapping, Sequence

import numpy

from . import _ffi
from ._arrays import Array, address, index, number, one_or, real, table, vector
from ._call import Handle, frame, text
from ._ffi import ProgressKind, RunOutcome
from ._foreign import Hints, translated
from ._library import lib
from ._logs import monitors, take_verbose
from ._progress import Progress
from ._run_options import _chosen, _differentiated, _span
from ._solver import OnLog, _log_callback
from .batches import Batch, simulate_batch
from .errors import ArgumentError, DimensionError, RangeError
from .expr import Model, system_of
from .runs import (
    Accumulation,
    Branching,
    BranchPoint,
    Contact,
    Event,
    Gradient,
    Jump,
    Noted,
    Run,
    RunStats,
    Step,
    _numbers,
)
from .scene import Scene
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
    "Jump",
    "Noted",
    "Run",
    "RunStats",
    "Step",
    "simulate",
    "simulate_batch",
]

# to look a member up takes less than to call its enumeration
_KINDS = {int(k): k for k in ProgressKind}
_OUTCOMES = {int(o): o for o in RunOutcome}

OnStep = Callable[[Step], Any]
OnBranching = Callable[[Branching], Any]


def _poll(_: Any) -> int:
    """Stops after Ctrl-C: Python looks for signals only where it runs."""
    current = frame()
    try:
        return 1 if current.stop or current.error is not None else 0
    except BaseException as error:
        if current.error is None:
            current.error = error
        return 1


_POLL = _ffi.swb_poll_fn(_poll)


def _step_callback(f: OnStep | None) -> Any:
    """Asks every step whether to go on, by the wish of the user."""
    if f is None:
        return _ffi.swb_progress_fn(0)

    def progress(info: int, _: Any) -> int:
        current = frame()
        try:
            if current.stop or current.error is not None:
                return 1
            c = _ffi.swb_progress.from_address(info)
            x = _numbers(c.x, (c.nx,), ctypes.c_double)
            return 1 if f(Step(c.t, x, ProgressKind(c.kind), c.steps, c.switches)) else 0
        except BaseException as error:
            if current.error is None:
                current.error = error
            return 1

    return _ffi.swb_progress_fn(progress)


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


class Integrator(Hints, Handle, HasSettings):
    """Event-driven integrator of a system or model, step by step, in the vocabulary of SUNDIALS.

    `rtol` and `atol` are one number, or one for each state; `method` is "auto", "dp5", "dop853" or "radau5". Options
    that change later are taken over by the next `reinit`, or at once before the first step.
    """

    _kind = "integrator"

    _instead = {
        "t": "the time reached is integrator.time, the state integrator.state",
        "t_eval": "sample(t) integrates to the last of the times and returns the states at all of them",
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
        self._room = numpy.empty(self.nx)
        self._room_at = address(self._room)
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
        self._do("set_poll", _POLL, None)
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
        return _KINDS[kind.value]

    def advance(self, t: float) -> RunOutcome:
        """Integrate to the time `t`, exactly."""
        outcome = ctypes.c_int32()
        self._do("advance", number(t, "t"), ctypes.byref(outcome), interruptible=True)
        return _OUTCOMES[outcome.value]

    def sample(self, t: Any) -> Array:
        """Integrate to the last of the times, which increase, and return the states at all of them, [n, nx]. No step ends for them: they
        are on the dense output of the steps, which is not kept for that. At a switch the state before it counts; NaN at times that
        were not reached, see `outcome`."""
        times = numpy.atleast_1d(real(t, "t"))
        if times.ndim != 1:
            raise DimensionError(f"t has shape {times.shape}, expected (n,)")
        out = numpy.empty((times.size, self.nx))
        self._do("sample", address(times), times.size, address(out), out.size, None, interruptible=True)
        return out

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

    def hvp(self, v: Any, *, x0: Any = None, p: Any = None, u: Any = None) -> tuple[Gradient, Array]:
        """Derivative of the gradient by `adjoint` in the direction (`x0`, `p`, `u`), each zero if it is not given: the product of the Hessian with it, where `v` does
        not change, [nx], [np] and [nu]. What `v` changes by adds a gradient of its own. And the derivative of the state reached, [nx]. Needs the option `adjoint`.

        The derivative has about half of the digits, and costs about ten gradients. Errors: UnsupportedError where the run has implicit steps, contacts, zeros of higher
        order, or transitions that follow another event at the same time."""
        final = vector(v, self.nx, "v")
        sizes = ((x0, self.nx, "x0"), (p, self.np, "p"), (u, self.nu, "u"))
        given = [numpy.zeros(n) if d is None else vector(d, n, what) for d, n, what in sizes]
        found = Gradient(*(numpy.empty(n) for _, n, _ in sizes))
        along = numpy.empty(self.nx)
        self._do("adjoint_along", *(a for array in (final, *given, *found, along) for a in (address(array), array.size)))
        return found, along

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
        out = ctypes.c_double()
        self._read(lib.swb_integrator_get_time, ctypes.byref(out))
        return out.value

    def _state(self, function: Callable[..., int]) -> Array:
        if self._finalizer is None:
            raise self._unmade()
        # room whose address is known, since to ask an array for it takes as long as the call; another thread may write to it
        with self._lock:
            self._read(function, self._room_at, self.nx)
            return self._room.copy()

    @property
    def state(self) -> Array:
        """State reached."""
        return self._state(lib.swb_integrator_get_state)

    @property
    def derivative(self) -> Array:
        """Derivative of the state under the present active modes."""
        return self._state(lib.swb_integrator_get_derivative)

    @property
    def outcome(self) -> RunOutcome:
        """How the simulation stands."""
        out = ctypes.c_int32()
        self._read(lib.swb_integrator_get_outcome, ctypes.byref(out))
        return _OUTCOMES[out.value]

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
