"""Time stepping of scenes with many contacts."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy

from . import _ffi
from ._arrays import Array, address, choice, index, number, vector
from ._call import Handle, aside, check
from ._ffi import ImpactLaw
from ._library import lib
from .errors import ArgumentError
from .expr import system_of
from .system import System

if TYPE_CHECKING:
    from .scene import Scene

__all__ = ["StepStats", "Stepper", "Steps", "simulate_steps"]


@dataclass(frozen=True)
class StepStats:
    """Counts of the steps since the state was set, and how they went.

    steps          steps
    gaps, bounds   gaps evaluated, and bounds of gaps over boxes, which say how long a contact needs not be looked at
    contacts       closed contacts, summed over the steps
    most_contacts  most of them at once
    sweeps, gradients   sweeps over the contacts, steps of conjugate gradients
    unconverged    steps whose impulses were not found to the tolerance
    worst_change   the largest relative change left in such a step
    penetration    the deepest penetration seen, of the order of h times a speed
    deepest        number of the contact it was at, -1 if there was none
    """

    steps: int
    gaps: int
    bounds: int
    contacts: int
    most_contacts: int
    sweeps: int
    gradients: int
    unconverged: int
    worst_change: float
    penetration: float
    deepest: int


@dataclass(frozen=True)
class Steps:
    """States after steps.

    t         [n] times, the first is the start
    x         [n, nx] states: coordinates, velocities, then the states beside them
    impulses  [n, contacts, 3] impulses of the steps that end at these times: normal, then along the tangents there are;
              None if they were not asked for
    names     names of the contacts, in the order of the impulses
    stats     what it cost and how it went
    n_q       number of coordinates
    n_v       number of velocities
    """

    t: Array
    x: Array
    impulses: Array | None
    names: tuple[str, ...]
    stats: StepStats
    n_q: int
    n_v: int | None = None

    @property
    def q(self) -> Array:
        """[n, n_q] coordinates."""
        return self.x[:, : self.n_q]

    @property
    def v(self) -> Array:
        """[n, n_v] velocities."""
        return self.x[:, self.n_q :] if self.n_v is None else self.x[:, self.n_q : self.n_q + self.n_v]

    @property
    def states(self) -> Array:
        """[n, n_states] states beside coordinates and velocities."""
        return self.x[:, self.n_q + self.v.shape[1] :]


class Stepper(Handle):
    """Makes steps of a scene by the theta-method of Moreau and Jean: impacts are not located, any number of them may fall
    into a step, and the error is of order 1 in `h`.

    h               length of a step
    theta           where in a step functions are evaluated: 1/2 in its middle, 1 at its start
    tolerance       impulses of a step are found to this share of them
    max_iterations  sweeps over the contacts and steps of conjugate gradients in a step at most; a step that needs more goes
                    on with the impulses it has and is counted in `stats.unconverged`
    law             "newton" or "sequential"; by default that of the scene
    correct         shift back what came to rest too deep
    look_at_all     look at all contacts in every step: the result is the same to the last bit, for checks

    Forces are taken at the start of a step, so `h` must resolve springs (shorter than 2/omega) and dampers.
    """

    _kind = "stepper"

    def __init__(
        self,
        scene: Scene | System,
        h: float = 1e-3,
        *,
        theta: float = 0.5,
        tolerance: float = 1e-8,
        max_iterations: int = 1000,
        law: str | ImpactLaw | None = None,
        correct: bool = True,
        look_at_all: bool = False,
    ):
        system = system_of(scene)
        options = _ffi.swb_step_options()
        check(lib.swb_step_options_init(ctypes.byref(options), ctypes.sizeof(options)))
        options.h = number(h, "h")
        options.theta = number(theta, "theta")
        options.tolerance = number(tolerance, "tolerance")
        options.max_iterations = index(max_iterations, "max_iterations")
        options.law = -1 if law is None else int(choice(ImpactLaw, law, "law"))
        options.correct, options.look_at_all = int(bool(correct)), int(bool(look_at_all))
        self._create(system, ctypes.byref(options))
        self._functions = list(system._functions)
        self.nx, self.nu, self.np = system.nx, system.nu, system.np
        self._system = system
        count = ctypes.c_int64()
        self._do("sizes", None, None, None, ctypes.byref(count))
        self.n_contacts = count.value
        self.contacts = tuple(name for name, _ in getattr(system, "_contacts", ()))

    def set_state(self, x: Any, t: float = 0.0) -> None:
        """Set the state, coordinates and then velocities, and the time. Set the parameters first."""
        given = self._system._start(x, "x")
        self._do("set_state", number(t, "t"), address(given), given.size)

    def set_controls(self, u: Any) -> None:
        """Set the controls, constant from now on."""
        given = self._system._controls(u)
        self._do("set_controls", address(given), given.size)

    def set_params(self, p: Any) -> None:
        """Set the parameters, constant from now on."""
        given = self._system._params(p)
        self._do("set_params", address(given), given.size)

    def step(self) -> None:
        """Make one step of length h."""
        self._do("step", interruptible=True)

    def advance(self, t: float) -> None:
        """Make equal steps, not longer than h, that end at time t. Ctrl-C ends them after a step."""
        end = number(t, "t")
        self._long(lambda: self._do("advance", end))

    def run(self, t: float, every: int = 1, impulses: bool = False) -> Steps:
        """Make equal steps, not longer than h, that end at time t, and keep the state after `every` of them."""
        end, every, count = number(t, "t"), index(every, "every"), ctypes.c_int64()
        self._do("count", end, every, ctypes.byref(count))
        n = count.value
        times, states = numpy.empty(n), numpy.empty((n, self.nx))
        kept = numpy.empty((n, self.n_contacts, 3)) if impulses else None
        given = (None, 0) if kept is None else (address(kept), kept.size)
        self._long(lambda: self._do("run", end, every, address(times), n, address(states), states.size, *given))
        return Steps(times, states, kept, self.contacts, self.stats, getattr(self, "_n_q", self.nx // 2), getattr(self, "_n_v", None))

    def _long(self, work: Any) -> None:
        if any(f._in_python for f in self._functions):
            work()
        else:
            aside(work, self.interrupt)

    def interrupt(self) -> None:
        """Stop the call that runs now, or the next one, after the step it is at; from any thread."""
        self._do("interrupt")

    @property
    def t(self) -> float:
        """Time reached."""
        t = ctypes.c_double()
        self._do("get_time", ctypes.byref(t))
        return t.value

    @property
    def x(self) -> Array:
        """[nx] state reached: coordinates, then velocities."""
        x = numpy.empty(self.nx)
        self._do("get_state", address(x), x.size)
        return x

    @property
    def impulses(self) -> Array:
        """[contacts, 3] impulses of the last step, not forces: normal, then along the tangents there are."""
        out = numpy.empty((self.n_contacts, 3))
        self._do("get_impulses", address(out), out.size)
        return out

    @property
    def stats(self) -> StepStats:
        """Counts of the steps since the state was set, and how they went."""
        s = _ffi.swb_step_stats()
        self._do("get_stats", ctypes.byref(s), ctypes.sizeof(s))
        return StepStats(*(getattr(s, name) for name in StepStats.__dataclass_fields__))


def simulate_steps(
    scene: Scene,
    q0: Any,
    v0: Any,
    t_span: Any,
    h: float = 1e-3,
    *,
    u: Any = None,
    p: Any = None,
    every: int = 1,
    impulses: bool = False,
    states: Any = (),
    **options: Any,
) -> Steps:
    """Simulate a scene with many contacts by time stepping, from coordinates `q0` and velocities `v0` over `t_span`: the
    end, or (start, end).

    The state is kept after `every` steps, with the impulses if asked for. `u` are constant controls, `p` parameters, `states` the
    states beside coordinates and velocities at the start; for
    further options see `Stepper`. The error is of order 1 in `h`; look at `stats.penetration` and compare two steps. For
    accurate simulation of a few contacts use `Scene.simulate`.
    """
    from ._run_options import _span
    from .scene import Scene

    if not isinstance(scene, Scene):
        raise ArgumentError(f"simulate_steps takes a scene, not {type(scene).__name__}: a Stepper takes systems of scenes too")
    start, end = _span(t_span)
    x0 = scene._start(q0, v0, states)
    with Stepper(scene.system(), h, **options) as s:
        s._n_q, s._n_v = scene.n_q, scene.n_v
        if p is not None or s.np:
            s.set_params(p)
        if u is not None or s.nu:
            s.set_controls(u)
        s.set_state(x0, start)
        return s.run(end, every, impulses)
