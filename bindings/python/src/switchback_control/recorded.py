"""What results over time have in common: columns by name, tables, files, copies."""

from __future__ import annotations

import html
import os
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy

from ._arrays import Array
from ._names import nearest

__all__ = ["EarlyEndWarning", "EndState", "Recorded", "SystemInfo"]


class EarlyEndWarning(UserWarning):
    """The last state of a simulation that ended before its time was read."""


class EndState:
    """The attribute of a result that is its last state: who reads it of a simulation that ended early is warned.

    The result says by `_early()` why it ended early, in words; "" where it did not."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, result: Any, owner: Any = None) -> Any:
        if result is None:
            raise AttributeError(self._name)  # a field without a default, for dataclasses
        early = result._early()
        if early:
            warnings.warn(f"{self._name} is the state where the simulation ended early, {early}; see .success", EarlyEndWarning, stacklevel=2)
        try:
            return result.__dict__[self._name]
        except KeyError:
            raise AttributeError(self._name) from None

    def __set__(self, result: Any, value: Any) -> None:
        result.__dict__[self._name] = value


@dataclass
class SystemInfo:
    """Facts of its system that a result knows that was copied or loaded: sizes and names."""

    nx: int
    nu: int
    np: int
    _names: tuple[tuple[str, ...], ...]
    _mode_names: tuple[tuple[str, ...], ...] | None = None
    _contacts: tuple[tuple[str, int], ...] = ()
    _scene: Any = None
    _origin: Any = field(default=None, repr=False)
    n_subsystems: int = 0
    _events: list[str] = field(default_factory=list)

    @classmethod
    def of(cls, system: Any, n_modes: tuple[int, ...] = ()) -> SystemInfo | None:
        """Of a system."""
        from ._regions import mode_names

        if system is None or isinstance(system, SystemInfo):
            return system
        scene = getattr(system, "_scene", None)
        names = tuple(tuple(m) for m in mode_names(system, n_modes))
        origin = getattr(system, "_origin", None)
        return cls(
            system.nx,
            system.nu,
            system.np,
            tuple(system._names),
            names,
            tuple(tuple(c) for c in system._contacts),
            None if scene is None else SceneInfo(scene.n_q, n_v=getattr(scene, "n_v", None)),
            None if origin is None else (None, numpy.empty(0), tuple(origin[2])),
            _events=list(getattr(system, "_events", ())),
        )


@dataclass
class SceneInfo:
    """Facts of the scene of a result that was copied or loaded."""

    n_q: int
    contacts: tuple[Any, ...] = ()
    n_v: int | None = None


def labels(names: Iterable[str], letter: str, n: int) -> list[str]:
    """Names of columns: "x0", "x1", ... where there are none."""
    known = list(names)
    return [(known[i] if i < len(known) else "") or f"{letter}{i}" for i in range(n)]


def facts_html(title: str, facts: Mapping[str, Any]) -> str:
    """Facts of an object as a table for notebooks."""
    rows = "".join(
        f"<tr><th style='text-align:left'>{html.escape(str(k))}</th><td style='text-align:left'>{html.escape(_short(v))}</td></tr>"
        for k, v in facts.items()
    )
    return f"<table><caption>{html.escape(title)}</caption>{rows}</table>"


class Recorded:
    """A result over time: columns by name, `to_dict`, `to_pandas`, `save`."""

    def _series(self) -> tuple[Array, dict[str, Array]]:
        """Times, and a column of values at them for each name."""
        raise NotImplementedError

    def _facts(self) -> dict[str, Any]:
        """What else is known, in numbers and words."""
        return {}

    def __getitem__(self, name: str) -> Array:
        columns = self._series()[1]
        if name not in columns:
            raise KeyError(f"there is no column '{name}'{nearest(name, columns)}")
        return columns[name]

    __iter__ = None  # columns have names, not numbers

    def __contains__(self, name: object) -> bool:
        return name in self._series()[1]

    def to_dict(self) -> dict[str, Any]:
        """Times "t", a column for each state and control by its name, or "x0", "x1", ..., "u0", ..., and what else is known:
        plain numbers, texts and arrays."""
        t, columns = self._series()
        return {"t": t, **columns, **{k: v for k, v in self._facts().items() if k not in columns}}

    def to_pandas(self) -> Any:
        """The columns as a DataFrame over the time. Needs pandas."""
        try:
            import pandas
        except ImportError as error:
            raise ImportError("to_pandas needs pandas: pip install pandas; to_dict has the same columns as arrays") from error
        t, columns = self._series()
        return pandas.DataFrame(columns, index=pandas.Index(t, name="t"))

    def save(self, path: str | os.PathLike) -> None:
        """Write it to a file, which `switchback_control.load` reads: NumPy's .npz, or .json."""
        from ._store import save

        save(self, path)

    def _repr_html_(self) -> str:
        return facts_html(type(self).__name__, self._facts())


class OverElements(Recorded):
    """A result with a trajectory of finite elements, and controls that are constant from each of `control_times` on."""

    trajectory: Any
    controls: Array
    control_times: Array
    system: Any

    def _series(self) -> tuple[Array, dict[str, Array]]:
        """A control at a boundary of elements is that of the element that begins, at the end that of the last one."""
        states, controls = ((), ()) if self.system is None else self.system._names[:2]
        trajectory, n = self.trajectory, self.controls.shape[1]
        columns = dict(zip(labels(states, "x", trajectory.nx), trajectory.states.T))
        if n and trajectory.n_elements:
            place = numpy.searchsorted(self.control_times, 0.5 * (trajectory.times[1:] + trajectory.times[:-1])) - 1
            place = numpy.clip(numpy.append(place, place[-1]), 0, len(self.controls) - 1)
            columns.update(zip(labels(controls, "u", n), self.controls[place].T))
        return trajectory.times, columns

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "system": SystemInfo.of(self.system, self.trajectory.n_modes)}

    def plot(self, path: Any = None, **keywords: Any) -> Any:
        """See `switchback_control.plot`."""
        from .plot import plot

        return plot(self, path, **keywords)


def _short(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, numpy.ndarray):
        text = numpy.array2string(value.ravel()[:8], precision=5, separator=", ")
        return text if value.size <= 8 else f"{text[:-1]}, ... ({value.size} numbers)]"
    if isinstance(value, (list, tuple)) and len(value) > 4:
        return f"{len(value)} entries"
    return str(value)
