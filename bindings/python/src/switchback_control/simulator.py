"""Simulation by finite elements whose boundaries move onto the switches (FESD)."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, field
from typing import Any, Iterable, Mapping

import numpy

from ._arrays import Array, address, index, number, table
from ._call import text
from ._document import Reader
from ._ffi import Outcome
from ._library import lib
from ._logs import monitors, take_verbose
from ._names import named_vector
from ._solver import Solver
from .expr import Model, system_of
from .function import Function
from .recorded import EndState, OverElements
from .results import HasOutcome, OnIteration, OnLog, Residuals, Stats, outcome_name
from .settings import Settings
from .system import System
from .trajectory import Trajectory

__all__ = ["SimulationResult", "Simulator", "simulate_fesd"]


class Simulator(Solver):
    """Simulator of a system: time, state, and the trajectory since the state was set.

    Options by `settings` or by keyword: `Simulator(system, n_s=4, n_fe=3)`.
    """

    _kind = "simulator"

    def __init__(
        self,
        system: System | Model,
        settings: Settings | Mapping[str, Any] | None = None,
        *,
        on_iteration: OnIteration | None = None,
        on_log: OnLog | None = None,
        **options: Any,
    ):
        system = system_of(system)
        self.nx, self.nu, self.np = system.nx, system.nu, system.np
        self._names = system._names
        self._system: System | None = system
        verbose = take_verbose(options)
        chosen = Settings._from(settings, options)
        on_log, on_iteration = monitors(chosen, verbose, on_log, on_iteration)
        self._create(system, ctypes.byref(chosen._c))
        self._functions = list(system._functions)
        self._monitors(on_iteration, on_log)

    def to_json(self, duration: float, n_steps: int) -> str:
        """The simulation that starts here as a document in JSON: for bug reports and replay. Callbacks are named only."""
        return text(lib.swb_simulator_to_json, self, number(duration, "duration"), index(n_steps, "n_steps"))

    @classmethod
    def from_json(cls, document: str, functions: Iterable[Function] = ()) -> tuple[Simulator, float, int]:
        """A simulator that stands where a document begins, with duration and number of steps of the run. Callbacks
        that the document names are supplied, and found by name."""
        reader = Reader(document, functions)
        simulator = cls.__new__(cls)
        duration, n_steps = ctypes.c_double(), ctypes.c_int64()
        places = ctypes.byref(duration), ctypes.byref(n_steps)
        simulator._make(lib.swb_simulator_from_json, *reader.arguments, *places)
        data = reader.data()["simulation"]["system"]
        simulator.nx, simulator.nu, simulator.np = (data[key] for key in ("states", "controls", "parameters"))
        simulator._names = ((), (), ())
        simulator._system = None
        simulator._functions = list(reader.functions)
        simulator._monitors(None, None)
        return simulator, duration.value, n_steps.value

    def set_state(self, x: Any, t: float = 0.0) -> None:
        """Set state and time, and begin a new trajectory."""
        array = named_vector(x, self._names[0], self.nx, "x")
        self._do("set_state", number(t, "t"), address(array), len(array))

    def set_controls(self, u: Any) -> None:
        """Set the controls, constant from now on."""
        array = named_vector(u, self._names[1], self.nu, "u")
        self._do("set_controls", address(array), len(array))

    def set_params(self, p: Any) -> None:
        """Set the parameters."""
        array = named_vector(p, self._names[2], self.np, "p")
        self._do("set_params", address(array), len(array))

    def run(self, duration: float, n_steps: int) -> Outcome:
        """Simulate over a duration in equal steps of n_fe finite elements each, from where the last call ended. It
        ends early where a step fails."""
        return self._solve("run", number(duration, "duration"), index(n_steps, "n_steps"))

    def step(self, h: float) -> Outcome:
        """Simulate one step of n_fe finite elements over the duration h."""
        return self._solve("step", number(h, "h"))

    def clear(self) -> None:
        """Forget trajectory and statistics; time and state stay."""
        self._do("clear")

    @property
    def time(self) -> float:
        """Time reached."""
        return self._get("get_time", ctypes.c_double)

    @property
    def state(self) -> Array:
        """State reached."""
        out = numpy.empty(self.nx)
        self._do("get_state", address(out), out.size)
        return out

    @property
    def trajectory(self) -> Trajectory:
        """A copy of the trajectory since the state was set."""
        return Trajectory._take(self)

    def __repr__(self) -> str:
        return "<Simulator, closed>" if self.closed else f"<Simulator at t={self.time:g}>"


@dataclass(frozen=True, repr=False)
class SimulationResult(OverElements, HasOutcome):
    """Result of a simulation; `controls` has a row for each step, which last from `control_times` on. `result["q"]` are the
    values of a state or a control, by its name, at the boundaries of the finite elements. It can be copied, pickled, and written by
    `save` (see `switchback_control.load`)."""

    outcome: Outcome
    time: float
    state: Any = EndState()
    trajectory: Trajectory
    residuals: Residuals
    stats: Stats
    controls: Array = field(repr=False)
    control_times: Array = field(repr=False)
    #: The system that was simulated.
    system: Any = field(default=None, repr=False)

    def _early(self) -> str:
        given = self.__dict__
        if given.get("outcome", Outcome.SOLVED) == Outcome.SOLVED:
            return ""
        return f"at t = {given['time']:.9g}: {self.message}"

    def _facts(self) -> dict[str, Any]:
        return {
            "outcome": outcome_name(self.outcome),
            "success": self.success,
            "time": self.time,
            "state": self.__dict__["state"],
            "switch_times": self.trajectory.switch_times,
            "iterations": self.stats.iterations,
            "time_total": self.stats.time_total,
        }

    def __repr__(self) -> str:
        n = self.trajectory.n_elements
        return f"<SimulationResult {outcome_name(self.outcome)} at t={self.time:g}, {n} elements, {len(self.trajectory.switches)} switches>"


def simulate_fesd(
    system: System | Model,
    x0: Any,
    duration: float,
    n_steps: int,
    *,
    t0: float = 0.0,
    u: Any = None,
    p: Any = None,
    settings: Settings | Mapping[str, Any] | None = None,
    on_iteration: OnIteration | None = None,
    on_log: OnLog | None = None,
    **options: Any,
) -> SimulationResult:
    """Simulate a system from x0 over a duration in equal steps of finite elements, by the equations an optimal control
    problem has. For accurate trajectories `simulate` is faster.

    `u` are constant controls, or with a row for each step those of the steps. Look at `result.success`: the
    simulation ends early where a step fails. For going on, stopping and changing things use a `Simulator`.
    """
    with Simulator(system, settings, on_iteration=on_iteration, on_log=on_log, **options) as sim:
        start, steps, span = number(t0, "t0"), index(n_steps, "n_steps"), number(duration, "duration")
        sim.set_state(x0, start)
        if p is not None or sim.np:
            sim.set_params(p)
        if numpy.ndim(u) == 2 and steps > 0:
            controls = table(u, steps, sim.nu, "u")
            control_times = start + span / steps * numpy.arange(steps + 1)
            outcome = Outcome.SOLVED
            for row in controls:
                sim.set_controls(row)
                outcome = sim.step(span / steps)
                if outcome != Outcome.SOLVED:
                    break
        else:
            if u is not None or sim.nu:
                sim.set_controls(u)
            given = numpy.empty(0) if u is None else named_vector(u, sim._names[1], sim.nu, "u")
            controls = given.reshape(1, -1).copy()
            control_times = numpy.array([start, start + span])
            outcome = sim.run(span, steps)
        return SimulationResult(
            outcome, sim.time, sim.state, sim.trajectory, sim.residuals, sim.stats, controls, control_times, sim._system
        )
