"""Keywords of other simulation packages: accepted under their names, or answered with what is asked for here."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .errors import ArgumentError

__all__ = ["method", "translated"]

#: Keywords that mean an option of this library.
_SAME = {"max_step": "h_max", "first_step": "h_init"}

#: Keywords that have no counterpart of their own, and what to do instead.
_INSTEAD = {
    "t_eval": "the whole solution is kept: call the result, run(t_eval), for the states at these times",
    "args": "parameters of the model are p=[...], or p={'name': value} where they have names",
    "events": "what switches is part of the model: comparisons in a Model, switching functions of a System, transitions",
    "jac": "derivatives belong to the functions: expressions and traced callables have exact ones, others take jacobian=",
    "vectorized": "functions are called with one state at a time; simulate_batch runs many starts",
    "dense_output": "the solution is known everywhere unless dense=False is given",
    "n_steps": "simulate takes (system, x0, t_span); equal steps of finite elements are simulate_fesd",
    "duration": "simulate takes (system, x0, t_span); equal steps of finite elements are simulate_fesd",
    "y0": "the initial state is x0",
    "tspan": "the time is t_span, its end or (start, end)",
    "t_end": "the time is t_span, its end or (start, end)",
    "params": "parameters are p",
    "controls": "controls are u",
}


#: Methods of SciPy.
_METHODS = {"RK45": "dp5", "DOP853": "dop853", "Radau": "radau5", "RK23": "dp5", "BDF": "radau5", "LSODA": "auto"}


def method(name: Any) -> Any:
    """The method of this library for one of SciPy; other names as they are."""
    return _METHODS.get(name, name) if isinstance(name, str) else name


def translated(options: Mapping[str, Any]) -> dict[str, Any]:
    """Options of a simulation under the names they have here; raises ArgumentError for those that have none."""
    found = {}
    for name, value in options.items():
        if name in _INSTEAD:
            raise ArgumentError(f"there is no keyword '{name}': {_INSTEAD[name]}")
        own = _SAME.get(name, name)
        if own in found or (own != name and own in options):
            raise ArgumentError(f"'{name}' is '{own}' here, which is given too")
        found[own] = value
    return found
