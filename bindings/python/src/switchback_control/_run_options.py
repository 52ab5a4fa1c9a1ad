"""What simulations are asked for, by single runs and by batches."""

from __future__ import annotations

from typing import Any, Mapping

import numpy

from ._arrays import choice, real, seen
from ._ffi import Sensitivity
from ._foreign import method as method_of
from .errors import DimensionError
from .settings import Settings


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
