"""Trajectories of simulations and optimal control problems."""

from __future__ import annotations

import ctypes
import threading
from dataclasses import dataclass
from typing import Any

import numpy

from . import _ffi
from ._arrays import Array, address, index, real
from ._call import Handle
from ._ffi import SwitchKind
from .errors import DimensionError
from .recorded import Recorded, labels

__all__ = ["Switch", "Trajectory"]


@dataclass(frozen=True)
class Switch:
    """A change of the active set of a subsystem: the modes active before and after, and the element that begins."""

    t: float
    element: int
    subsystem: int
    kind: SwitchKind
    before: tuple[int, ...]
    after: tuple[int, ...]


class Trajectory(Recorded, Handle):
    """Finite elements, each a polynomial, that end where the system switches. Call it for the states at any times. It can be
    copied, pickled, and written by `save` (see `switchback_control.load`).

    times           [n_elements + 1] element boundaries
    states          [n_elements + 1, nx] states there
    steps           [n_elements] lengths of the elements
    control_stages  [n_elements] control stages the elements belong to; 0 in simulations
    n_modes         numbers of modes of the subsystems that can switch
    active          [n_elements, sum of n_modes] which modes are active, one alone or several in a sliding mode
    stage_times     [n_elements, n_s] stage points
    stage_states    [n_elements, n_s, nx] states there
    stage_theta     [n_elements, n_s, sum of n_modes] convex multipliers of the modes there
    switches        in the order of time
    """

    _kind = "trajectory"

    times: Array
    states: Array
    steps: Array
    control_stages: Array
    n_modes: tuple[int, ...]
    active: Array
    stage_times: Array
    stage_states: Array
    stage_theta: Array
    switches: list[Switch]

    @classmethod
    def _take(cls, source: Handle) -> Trajectory:
        self = cls.__new__(cls)
        self._lock, self._uses = threading.RLock(), 0
        handle = ctypes.c_void_p()
        source._do("get_trajectory", ctypes.byref(handle))
        self._own(handle.value)
        self._read()
        return self

    def __init__(self) -> None:
        raise TypeError("trajectories come from a simulation or an optimal control problem")

    def _array(self, name: str, shape: tuple[int, ...], kind: Any = numpy.float64) -> Array:
        out = numpy.empty(shape, dtype=kind)
        self._do(name, address(out), out.size)
        return out

    def _read(self) -> None:
        info = self._struct("get_info", _ffi.swb_trajectory_info)
        n, n_s, nx, modes = info.n_elements, info.n_s, info.nx, info.n_modes
        nodes = n + 1 if n else 0
        self.nx, self.n_elements, self.n_s = nx, n, n_s
        self.t_start, self.t_end = info.t_start, info.t_end
        self.times = self._array("times", (nodes,))
        self.states = self._array("states", (nodes, nx))
        self.steps = self._array("steps", (n,))
        self.control_stages = self._array("control_stages", (n,), numpy.int64)
        self.n_modes = tuple(int(k) for k in self._array("modes", (info.n_subsystems,), numpy.int64))
        self.active = self._array("active", (n, modes), numpy.int32).astype(bool)
        self.stage_times = self._array("stage_times", (n, n_s))
        self.stage_states = self._array("stage_states", (n, n_s, nx))
        self.stage_theta = self._array("stage_theta", (n, n_s, modes))
        found = (_ffi.swb_switch * max(info.n_switches, 1))()
        self._do("switches", found if info.n_switches else None, info.n_switches, ctypes.sizeof(_ffi.swb_switch))
        self.switches = [self._switch(found[i]) for i in range(info.n_switches)]

    def _switch(self, s: Any) -> Switch:
        n = self.n_modes[s.subsystem]
        if n <= 64:
            before, after = (tuple(i for i in range(n) if mask >> i & 1) for mask in (s.before, s.after))
        else:
            before, after = (
                tuple(int(i) for i in numpy.flatnonzero(self.active_modes(s.subsystem)[e]))
                for e in (s.element - 1, s.element)
            )
        return Switch(s.t, s.element, s.subsystem, SwitchKind(s.kind), before, after)

    def active_modes(self, subsystem: int) -> Array:
        """[n_elements, modes of the subsystem] which modes are active."""
        k = index(subsystem, "subsystem")
        if not 0 <= k < len(self.n_modes):
            raise DimensionError(f"there is no subsystem {k} that switches, their number is {len(self.n_modes)}")
        start = sum(self.n_modes[:k])
        return self.active[:, start : start + self.n_modes[k]]

    @property
    def switch_times(self) -> Array:
        """Times of the switches."""
        return numpy.array([s.t for s in self.switches])

    def __call__(self, t: Any) -> Array:
        """States at any times between start and end: an array with one more dimension than `t`."""
        times = real(t, "t")
        flat = numpy.ascontiguousarray(times.ravel())
        out = numpy.empty((flat.size, self.nx))
        self._do("state_at", address(flat), flat.size, address(out), out.size)
        return out.reshape((*numpy.shape(t), self.nx))

    def __len__(self) -> int:
        return self.n_elements

    def _series(self) -> tuple[Array, dict[str, Array]]:
        return self.times, dict(zip(labels((), "x", self.nx), self.states.T))

    def _facts(self) -> dict[str, Any]:
        return {"t_start": self.t_start, "t_end": self.t_end, "elements": self.n_elements, "switch_times": self.switch_times}

    def __reduce__(self) -> Any:
        from .saved import SavedTrajectory

        return SavedTrajectory._of(self).__reduce__()

    def plot(self, path: Any = None, **keywords: Any) -> Any:
        """See `switchback_control.plot`."""
        from .plot import plot

        return plot(self, path, **keywords)

    def __repr__(self) -> str:
        if not self.n_elements:
            return "<Trajectory, empty>"
        return (
            f"<Trajectory from {self.t_start:g} to {self.t_end:g}, {self.n_elements} elements, "
            f"{len(self.switches)} switches>"
        )
