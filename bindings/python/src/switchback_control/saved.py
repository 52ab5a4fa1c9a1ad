"""Results without the library's objects: what copies, pickles and files of them become."""

from __future__ import annotations

from typing import Any

import numpy

from ._arrays import Array, real
from ._pieces import Pieces
from .errors import StateError
from .recorded import SystemInfo
from .runs import Run
from .scene import SceneContact
from .trajectory import Trajectory

__all__ = ["SavedRun", "SavedTrajectory"]

_RUN_DEGREE = 9  # dense output of the integrators has degree 7 at most
_TRAJECTORY_DEGREE = 11  # finite elements have up to 10 stages


class _Saved:
    """Has no object of the library to close."""

    closed = False

    def close(self) -> None:
        """Nothing is left to free."""

    def __reduce__(self) -> Any:
        return _restored, (type(self).__name__, dict(self.__dict__))

    def _hold(self) -> None:
        raise StateError("a result that was copied or loaded has lost its connection to the library")

    @classmethod
    def _restore(cls, state: dict[str, Any]) -> Any:
        self = cls.__new__(cls)
        self.__dict__.update(state)
        return self


def _restored(kind: str, state: dict[str, Any]) -> Any:
    return {"SavedRun": SavedRun, "SavedTrajectory": SavedTrajectory}[kind]._restore(state)


def _public(result: Any) -> dict[str, Any]:
    return {k: v for k, v in result.__dict__.items() if k not in ("_lock", "_uses", "_handle", "_finalizer", "system")}


class SavedRun(_Saved, Run):
    """A `Run` that was copied, pickled or loaded: the same numbers, and states at any time from polynomials that are those of the
    dense output to rounding. Forces of contacts are interpolated."""

    _dense: Pieces | None
    _contact_modes: tuple[Array, Array] | None
    _contact_forces: Pieces | None

    @classmethod
    def _of(cls, run: Run) -> SavedRun:
        state = _public(run)
        state["system"] = SystemInfo.of(run.system, run.n_modes)
        state.update(_dense=None, _contact_modes=None, _contact_forces=None)
        if len(run.t) > 1:
            state["_dense"] = Pieces.of(run, run.t, _RUN_DEGREE)
            n = len(run.system._contacts)
            if n:
                cuts = numpy.unique([run.t_start, *run.switch_times, *(i.t for i in run.impacts), run.t_end])
                state["_contact_modes"] = cuts, run._modes(0.5 * (cuts[1:] + cuts[:-1]))
                state["_contact_forces"] = Pieces.of(run._forces, run.t, _RUN_DEGREE)
        return cls._restore(state)

    def __call__(self, t: Any, k: int = 0) -> Array:
        times = real(t, "t")
        if self._dense is None:
            raise StateError("the run has no dense output: simulate with dense=True, over some time")
        return self._dense(times.ravel(), k).reshape((*times.shape, self.nx))

    def _contact(self, contact: Any) -> int:
        return super()._contact(contact.name if isinstance(contact, SceneContact) else contact)

    def _modes(self, times: Array) -> Array:
        if self._contact_modes is None:
            raise StateError("modes of contacts are known between times of a dense run only")
        cuts, modes = self._contact_modes
        place = numpy.clip(numpy.searchsorted(cuts, times, side="left") - 1, 0, len(modes) - 1)
        return modes[place]

    def _forces(self, times: Array) -> Array:
        if self._contact_forces is None:
            raise StateError("forces of contacts are known between times of a dense run only")
        return self._contact_forces(times.ravel()).reshape((*times.shape, len(self.system._contacts), 3))


class SavedTrajectory(_Saved, Trajectory):
    """A `Trajectory` that was copied, pickled or loaded: the same numbers, and states at any time."""

    _dense: Pieces | None

    @classmethod
    def _of(cls, trajectory: Trajectory) -> SavedTrajectory:
        state = _public(trajectory)
        some = trajectory.n_elements > 0
        state["_dense"] = Pieces.of(trajectory, trajectory.times, _TRAJECTORY_DEGREE) if some else None
        return cls._restore(state)

    def __call__(self, t: Any) -> Array:
        times = real(t, "t")
        if self._dense is None:
            raise StateError("the trajectory is empty")
        return self._dense(times.ravel()).reshape((*times.shape, self.nx))
