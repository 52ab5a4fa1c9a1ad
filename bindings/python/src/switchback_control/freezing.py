"""Time-freezing: scenes as piecewise smooth models in numerical time."""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, Any, Iterable

import numpy

from ._arrays import Array, address, number, vector
from ._call import text
from ._ffi import swb_freeze_layout, swb_freeze_options
from ._library import lib
from .errors import DimensionError
from .expr import Expr, Model, _Built

if TYPE_CHECKING:
    from .scene import Scene

__all__ = ["FrozenModel"]


class FrozenModel(Model):
    """A scene in numerical time, as `Scene.freeze` makes it: a model whose states are those of the scene, then the depths of
    contacts with restitution, the clock, and integrals of costs. Where the clock runs its states over `physical_time` are those
    of the scene.

    physical_time   the clock, an expression
    clock           its place among the states
    depths, costs   places of the depths and of the integrals
    speed           the control that is the speed of time, an expression, or None
    freeze_report   what became of the contacts, with warnings, as text
    """

    physical_time: Expr
    clock: int
    depths: range
    costs: range
    speed: Expr | None
    freeze_report: str

    def start(self, x: Any) -> Array:
        """The state in numerical time of a state of the scene, at physical time 0."""
        given = vector(x, self.depths.start, "x")
        return numpy.concatenate([given, numpy.zeros(self.nx - given.size)])

    def physical(self, times: Any, states: Any) -> tuple[Array, Array]:
        """States of the scene over physical time, from rows of states in numerical time; both sides of a jump are there, at one
        time, and nothing in between."""
        rows = numpy.asarray(states, dtype=float)
        if rows.ndim != 2 or rows.shape[1] != self.nx or len(rows) != len(numpy.asarray(times)):
            raise DimensionError(f"states have shape {rows.shape}, expected ({len(numpy.asarray(times))}, {self.nx})")
        t = rows[:, self.clock]
        scale = max(float(t[-1] - t[0]), numpy.finfo(float).tiny) if len(t) else 1.0
        still = numpy.diff(t, prepend=-numpy.inf) <= 1e-9 * scale
        # a row is inside of a jump if the clock stands still before and behind it
        inside = still & numpy.append(still[1:], False)
        return t[~inside], rows[~inside, : self.depths.start]


def freeze(
    scene: Scene,
    step: float,
    speed: float,
    a_n: float,
    stiffness: float,
    creep: float,
    speed_of_time: bool,
    costs: Iterable[Any],
    at: Any,
) -> FrozenModel:
    """See `Scene.freeze`."""
    options = swb_freeze_options()
    lib.swb_freeze_options_init(ctypes.byref(options), ctypes.sizeof(options))
    for name, value in (("step", step), ("speed", speed), ("a_n", a_n), ("stiffness", stiffness), ("creep", creep)):
        setattr(options, name, number(value, name))
    options.speed_of_time = int(bool(speed_of_time))
    given = [scene.graph.of(c) for c in costs]
    if any(c.ndim for c in given):
        raise DimensionError("costs are a list of single expressions")
    ids = numpy.array([int(c._ids) for c in given], dtype=numpy.int64)
    place = numpy.empty(0) if at is None else vector(at, scene.nx, "at")
    layout = swb_freeze_layout()
    made = _Built.__new__(_Built)
    made._make(
        lib.swb_scene_freeze,
        scene._made,
        scene.graph,
        ctypes.byref(options),
        address(place),
        place.size,
        address(ids),
        ids.size,
        ctypes.byref(layout),
        ctypes.sizeof(layout),
    )
    model = FrozenModel.from_json(text(lib.swb_model_to_json, made), scene.graph._functions)
    assert isinstance(model, FrozenModel)
    model.clock = layout.clock
    model.depths = range(layout.first_depth, layout.first_depth + layout.n_depths)
    model.costs = range(layout.first_cost, layout.first_cost + layout.n_costs)
    model.physical_time = model.x[layout.clock]
    model.speed = model.u[layout.speed] if layout.speed >= 0 else None
    model.freeze_report = text(lib.swb_scene_freeze_report, scene._made)
    return model
