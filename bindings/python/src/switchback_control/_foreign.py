"""Keywords of other simulation packages: accepted under their names, or answered with what is asked for here."""

from __future__ import annotations

import difflib
import functools
from collections.abc import Mapping
from typing import Any, Callable, ClassVar

from .errors import ArgumentError

__all__ = ["Hints", "method", "of_ocp", "refuse_of_solve", "translated"]

#: Keywords that mean one of this library, in simulations and in optimal control problems.
_SAME = {"max_step": "h_max", "first_step": "h_init"}
_SAME_OCP = {
    "T": "horizon",
    "tf": "horizon",
    "t_f": "horizon",
    "N": "n_stages",
    "N_stages": "n_stages",
    "N_finite_elements": "n_fe",
    "x0": "initial_state",
    "t0": "initial_time",
    "p": "params",
    "u_bounds": "control_bounds",
    "x_bounds": "state_bounds",
    "x0_bounds": "initial_bounds",
    "f_q": "lagrange",
    "running_cost": "lagrange",
    "stage_cost": "lagrange",
    "f_q_T": "mayer",
    "terminal_cost": "mayer",
}

_STOP = (
    "a run ends at an event of the model, m.stop_at(m.q < 0, name='landed'); or where on_step, which is called with a Step after each, returns "
    "True, as in on_step=lambda s: s.x[0] < 0"
)

#: Keywords that have no counterpart of their own, and what to do instead.
_INSTEAD = {
    "t_eval": "the whole solution is kept: call the result, run(t_eval), for the states at these times",
    "args": "parameters of the model are p=[...], or p={'name': value} where they have names",
    "events": "events are part of the model: m.note(m.q < 0, name='low') finds them, m.stop_at(...) ends the run, m.transition(...) jumps; "
    "their times are in run.t_events",
    **dict.fromkeys(("stop", "terminal", "terminate", "callback", "callbacks"), _STOP),
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

_INSTEAD_OCP = {
    "constraints": "add_path(f, lower, upper) holds along the horizon, add_terminal at its end, add_boundary at both ends",
    "terminal": "add_terminal(f, lower, upper) adds constraints at the end; the terminal cost is mayer",
    "terminal_state": "add_terminal([m.q, m.v], [1, 0], [1, 0]) sets states at the end",
    "u0": "set_control_guess gives the controls to start from",
    "guess": "set_state_guess and set_control_guess give the point to start from",
    "dt": "give horizon and n_stages, or set_durations",
    "time_steps": "give horizon and n_stages, or set_durations",
    **dict.fromkeys(("stop", "callback"), "on_iteration, which hears of each iteration, ends a solve by returning True; limits are max_iter and max_time"),
    "solver": "there is one solver; options are keywords, swb.options() lists them",
    "ipopt": "there is one solver; options are keywords, swb.options() lists them",
    "method": "the Runge-Kutta method is rk_family and n_s, such as rk_family='gauss_legendre', n_s=3",
    "dcs_mode": "the form is dcs_form: 'auto', 'stewart' or 'heaviside'",
    "progress": "verbose=True shows the iterations, on_iteration takes a function that hears of each",
}

#: What belongs to the problem and not to its solve.
_INSTEAD_SOLVE = {
    "verbose": "Ocp(..., verbose=True) shows the iterations",
    "x0": "set_initial_state, or initial_state= of Ocp; a solve starts from set_state_guess and set_control_guess",
    "stop": "on_iteration= of Ocp is a function that ends the solve by returning True; limits are the options max_iter and max_time",
    "callback": "on_iteration= of Ocp is a function that hears of each iteration",
    "p": "set_params, or params= of Ocp",
    "u0": _INSTEAD_OCP["u0"],
    "guess": _INSTEAD_OCP["guess"],
    "warm_start": "solve(warm=True) starts from the last solution",
}


#: Methods of SciPy.
_METHODS = {"RK45": "dp5", "DOP853": "dop853", "Radau": "radau5", "RK23": "dp5", "BDF": "radau5", "LSODA": "auto"}


def method(name: Any) -> Any:
    """The method of this library for one of SciPy; other names as they are."""
    return _METHODS.get(name, name) if isinstance(name, str) else name


def translated(options: Mapping[str, Any], ocp: bool = False) -> dict[str, Any]:
    """Keywords of a simulation, or of an optimal control problem, under the names they have here; raises ArgumentError for those
    that have none."""
    found = {}
    same, instead = (_SAME_OCP, _INSTEAD_OCP) if ocp else (_SAME, _INSTEAD)
    for name, value in options.items():
        if name in instead:
            raise ArgumentError(f"there is no keyword '{name}': {instead[name]}")
        own = same.get(name, name)
        if own in found or (own != name and own in options):
            raise ArgumentError(f"'{name}' is '{own}' here, which is given too")
        found[own] = value
    return found


def refuse_of_solve(keywords: Mapping[str, Any]) -> None:
    """Raises ArgumentError for the first keyword of a solve that does not belong there, with what to do instead."""
    for name in keywords:
        instead = _INSTEAD_SOLVE.get(name, f"options are set before, as in ocp.set({name}=...)")
        raise ArgumentError(f"solve has no keyword '{name}': {instead}")


def of_ocp(init: Callable[..., None]) -> Callable[..., None]:
    """A constructor of optimal control problems that understands the keywords of other packages."""

    @functools.wraps(init)
    def understood(self: Any, *arguments: Any, **keywords: Any) -> None:
        init(self, *arguments, **translated(keywords, ocp=True))

    return understood


class Hints:
    """Says what to use in the place of attributes that other packages have."""

    #: Attribute and what to do instead.
    _instead: ClassVar[Mapping[str, str]] = {}

    def __getattr__(self, name: str) -> Any:
        kind = type(self)
        if name.startswith("_"):
            raise AttributeError(f"{kind.__name__} has no '{name}'")
        if hasattr(kind, name):  # a property that failed: its own words
            return object.__getattribute__(self, name)
        if name in self._instead:
            raise AttributeError(f"{kind.__name__} has no '{name}': {self._instead[name]}")
        close = difflib.get_close_matches(name, [n for n in dir(self) if not n.startswith("_")], 1, 0.7)
        raise AttributeError(f"{kind.__name__} has no '{name}'" + (f": did you mean '{close[0]}'?" if close else ""))
