"""What a solve says about itself."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Callable

from . import _ffi
from ._ffi import Outcome, Polished
from ._library import lib

__all__ = ["Accuracy", "Iteration", "LinearStats", "Residuals", "Stats", "print_iteration"]


class _FromStruct:
    @classmethod
    def _of(cls, c: Any) -> Any:
        return cls(**{f.name: getattr(c, f.name) for f in fields(cls)})  # type: ignore[arg-type]


@dataclass(frozen=True)
class Residuals(_FromStruct):
    """Residuals of the optimality conditions, unscaled, maximum norm."""

    primal: float
    dual: float
    complementarity: float
    pair_product: float
    pair_min: float


@dataclass(frozen=True)
class Stats(_FromStruct):
    """Work and time of a solve, or of all steps of a simulation; times in seconds."""

    iterations: int
    factorisations: int
    evaluations: int
    restoration_iterations: int
    polish_iterations: int
    max_delta_w: float
    time_eval: float
    time_linalg: float
    time_total: float
    time_build: float
    n_variables: int
    n_constraints: int
    n_pairs: int
    n_steps: int
    n_homotopies: int
    moved_bounds: int


@dataclass(frozen=True)
class Accuracy(_FromStruct):
    """Comparison of an optimal control with an independent simulation of its controls: largest differences of a state over
    the ends of the control stages and at the end, violation of the terminal constraints, cost and its error. NaN where
    the simulation did not get. `along_violation` is the largest violation of a path constraint (number `along_constraint`,
    row `along_row`) or of a bound of a state (-1, the state) along the simulation, at the time `along_time`; -2 for none."""

    reached: bool
    n_switches: int
    worst: float
    terminal: float
    terminal_violation: float
    cost: float
    cost_error: float
    along_violation: float
    along_time: float
    along_constraint: int
    along_row: int

    @classmethod
    def _of(cls, c: Any) -> Accuracy:
        values = {f.name: getattr(c, f.name) for f in fields(cls)}
        return cls(**{**values, "reached": bool(c.reached)})


@dataclass(frozen=True)
class LinearStats(_FromStruct):
    """Sizes, pivots and work of the linear systems since the program was built."""

    n: int
    nnz_k: int
    nnz_l: int
    flops: float
    min_abs_pivot: float
    max_abs_pivot: float
    shift: float
    factorisations: int
    solves: int
    refinement_steps: int
    equilibrations: int


@dataclass(frozen=True)
class Iteration:
    """One iteration of a solve. `phase` is ' ' main, 'r' restoration, 'p' polish, 'j' relaxation raised, 's' a step that
    lowers the error as a whole, 'c' a linear program of a certificate, numbered on its own. `incumbent` is the cost of the
    best solution that a search around this solve has verified so far, infinite where there is none."""

    iter: int
    objective: float
    inf_pr: float
    inf_du: float
    mu: float
    sigma: float
    inf_cc: float
    step: float
    delta_w: float
    alpha_du: float
    alpha_pr: float
    trials: int
    phase: str
    incumbent: float

    @classmethod
    def _of(cls, c: _ffi.swb_iteration_info) -> Iteration:
        values = {f.name: getattr(c, f.name) for f in fields(cls)}
        values["phase"] = chr(c.phase) if 0 < c.phase < 128 else " "
        return cls(**values)


def print_iteration(i: Iteration) -> None:
    """Print an iteration as one line; give it as `on_iteration`."""
    if i.iter % 20 == 0:
        print("  iter     objective    inf_pr    inf_du    inf_cc     sigma        mu  alpha_pr", flush=True)
    print(
        f"{i.iter:5d}{i.phase} {i.objective: .6e} {i.inf_pr:9.2e} {i.inf_du:9.2e} {i.inf_cc:9.2e} "
        f"{i.sigma:9.2e} {i.mu:9.2e} {i.alpha_pr:9.2e}",
        flush=True,
    )


OnIteration = Callable[[Iteration], Any]
OnLog = Callable[[str, str], Any]


class HasOutcome:
    """Common part of all results."""

    outcome: Outcome

    @property
    def success(self) -> bool:
        """True where the problem was solved."""
        return self.outcome == Outcome.SOLVED

    @property
    def message(self) -> str:
        """The outcome in words."""
        return outcome_name(self.outcome) + before_first_iterate(self.outcome, getattr(self, "stats", None))


def before_first_iterate(outcome: int, stats: Any) -> str:
    """The end of a message about a solve whose time was over before it had an iterate, with what to do; else ""."""
    if outcome != Outcome.MAX_TIME or stats is None or stats.iterations or getattr(stats, "n_steps", 0):
        return ""
    return ", before the first iterate: what is given here is the starting point; raise the option max_time"


def outcome_name(outcome: int) -> str:
    """An outcome in words."""
    return (lib.swb_outcome_name(int(outcome)) or b"unknown").decode()


def outcome_of(number: int) -> Outcome:
    """An outcome, also one that this package does not know."""
    try:
        return Outcome(number)
    except ValueError:
        return number  # type: ignore[return-value]


def polished_of(number: int) -> Polished:
    try:
        return Polished(number)
    except ValueError:
        return number  # type: ignore[return-value]
