"""Families of optimal control problems that switch, drawn from seeds.

`instance(family, rng)` is a problem drawn at random: structure, sizes, units, horizon, cost, and a goal that known controls reach, so that it
has a solution. `Problem.data` are numbers and words that say all of it, and go through JSON; `Problem(family, data)` is the same problem again,
without drawing, for another build of the library. A module of this folder is a family and has

- `draw(rng)`, the data without units, with `guess`, controls that lead somewhere;
- `state(data)`, the `Statement`;
- `accept(data, run)`, whether the simulation of the guess shows what the family is about.

The goal is where the simulation of the guess ends, exactly or with room around it.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import switchback_control as swb
from switchback_control import SwitchbackError

from . import affine, friction, gates, gears, hopping, horizons, hysteresis, lines, onoff, projected, pushing, regions, tanks, walls
from .statement import Statement, function_of, without_noise

__all__ = ["FAMILIES", "Problem", "Statement", "generator", "instance"]

FAMILIES: dict[str, Any] = {
    m.__name__.rpartition(".")[2]: m
    for m in (friction, gears, regions, tanks, walls, pushing, hysteresis, onoff, hopping, projected, affine, horizons, gates, lines)
}
#: Draws of one structure without a usable one among them after which another structure is drawn, and of such structures that mean that a family is wrong.
DRAWS, STRUCTURES = 200, 20
#: Points of a control stage at which a path constraint is looked at and the cost is summed (Simpson's rule: an even number of pieces).
POINTS = 32


@dataclass(frozen=True)
class Problem:
    """A drawn problem: `data` says all of it."""

    family: str
    data: dict[str, Any] = field(repr=False)

    @property
    def guess(self) -> np.ndarray:
        """Controls that reach the goal, a row for each stage."""
        return np.array(self.data["guess"]) * np.array(self.data["units"]["u"])

    @property
    def guess_cost(self) -> float:
        """What these controls cost, to about three digits."""
        return self.data["guess_cost"]

    @property
    def optimum(self) -> float | None:
        """The least cost of all sequences, where they can be enumerated."""
        return self.data.get("optimum")

    def state(self) -> Statement:
        return FAMILIES[self.family].state(self.data)

    def make(self, **options: Any) -> swb.Ocp:
        """The problem, to be solved with these options."""
        d, s = self.data, self.state()
        start = {"initial_bounds": initial_bounds(d)} if "start" in d else {"initial_state": initial_state(d)}
        how = {**start, "control_bounds": s.control_bounds(d), **s.options, **options}
        ocp = swb.Ocp(s.system, d["horizon"] * d["units"]["t"], d["stages"], **how)
        if s.lagrange is not None:
            ocp.set_lagrange(s.system.function(s.lagrange * (d["units"]["cost"] / d["units"]["t"])))
        if s.mayer is not None:
            ocp.set_mayer(s.system.function(s.mayer * d["units"]["cost"]))
        if s.goal:
            ocp.add_terminal(s.system.function(list(s.goal)), d["goal"][0], d["goal"][1])
        for outputs, lower, upper in s.path:
            ocp.add_path(s.system.function(list(outputs)), lower, upper)
        if d.get("free"):
            ocp.set_free_time(d["free"]["what"], *(d["units"]["t"] * np.array(d["free"]["bounds"])))
        for on in s.pairs:
            ocp.add_complementarity(lambda u, on=on: u[on], lambda u, on=on: 1.0 - u[on])
        return ocp

    def simulate(self) -> Any:
        """The simulation of the guess, by events."""
        d = self.data
        return swb.simulate(self.state().system, initial_state(d), d["horizon"] * d["units"]["t"], u=self.guess)

    def violation(self, run: Any) -> float:
        """How far a simulation of the guess is from its goal and constraints, relative to the size of every quantity."""
        s, d = self.state(), self.data
        worst = 0.0
        if s.goal:
            end = evaluate(s, s.goal, run, np.array([run.t_end]), self.guess[-1])[0]
            worst = beyond(end, *d["goal"])
        for outputs, lower, upper in s.path:
            for times, u in stages(d, self.guess):
                values = evaluate(s, outputs, run, times, u)
                worst = max(worst, *(beyond(v, lower, upper) for v in values))
        return worst


def generator(family: str, seed: int, number: int = 0) -> np.random.Generator:
    """The generator of an instance of a family: the number-th one of a seed."""
    return np.random.default_rng([zlib.crc32(family.encode()), seed, number])


def instance(family: str, rng: np.random.Generator) -> Problem:
    """A problem of the family: numbers are drawn until the simulation of the guess shows what it should, those of the structure drawn first, so that
    what is seldom of use is not seldom among the problems."""
    for _ in range(STRUCTURES):
        wanted = structure(FAMILIES[family].draw(rng))
        usable = (d for d in (FAMILIES[family].draw(rng) for _ in range(50 * DRAWS)) if structure(d) == wanted)
        for _, d in zip(range(DRAWS), usable):
            problem = Problem(family, d)
            if complete(problem):
                return problem
    raise RuntimeError(f"no problem of the family {family} in {STRUCTURES} times {DRAWS} draws")


def structure(d: dict[str, Any]) -> tuple[Any, ...]:
    """What of a problem is not a number."""
    return d.get("kind"), len(d["x0"])


def initial_state(d: dict[str, Any]) -> list[float]:
    return [x * unit for x, unit in zip(d["x0"], d["units"]["x"])]


def initial_bounds(d: dict[str, Any]) -> tuple[list[float], list[float]]:
    """Of a start that is free."""
    low, high = ([x * unit for x, unit in zip(side, d["units"]["x"])] for side in d["start"])
    return low, high


def stages(d: dict[str, Any], guess: np.ndarray) -> Any:
    """Times within every stage, and its controls."""
    ends = np.linspace(0.0, d["horizon"] * d["units"]["t"], d["stages"] + 1)
    for a, b, u in zip(ends, ends[1:], guess):
        yield np.linspace(a, b, POINTS + 1), u


def evaluate(s: Statement, outputs: Any, run: Any, times: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Values of expressions at times of a simulation, a row for each."""
    return np.array([np.atleast_1d(function_of(s, outputs)(x=x, u=u, t=t)) for x, t in zip(run(times), times)])


def beyond(values: np.ndarray, lower: Any, upper: Any) -> float:
    """How far values are beyond their bounds, at most, each relative to its size or that of its bounds."""
    low = np.full(len(values), -np.inf) if lower is None else np.array(lower, float)
    high = np.full(len(values), np.inf) if upper is None else np.array(upper, float)
    size = np.maximum(1e-3, np.maximum(np.where(np.isfinite(low), abs(low), 0), np.where(np.isfinite(high), abs(high), 0)))
    return float(np.max(np.maximum(low - values, values - high) / size, initial=0.0))


def complete(problem: Problem) -> bool:
    """Writes the goal and the cost of the guess into the data; False where the guess is of no use."""
    d, s = problem.data, problem.state()
    try:
        run = problem.simulate()
    except SwitchbackError:
        return False
    if not run.success or not FAMILIES[problem.family].accept(d, run):
        return False
    if s.goal:
        end = evaluate(s, s.goal, run, np.array([run.t_end]), problem.guess[-1])[0]
        sizes = np.array(s.goal_sizes if s.goal_sizes else [1.0] * len(end))
        end = np.where(abs(end) < 1e-9 * sizes, 0.0, end)
        room = d.get("room", 0.0) * sizes
        d["goal"] = [(end - room).tolist(), (end + room).tolist()]
    d["guess_cost"] = 0.0
    if problem.violation(run) > 1e-9:
        return False
    cost = 0.0
    if s.lagrange is not None:
        weights = np.ones(POINTS + 1)
        weights[1:-1:2], weights[2:-1:2] = 4.0, 2.0
        for times, u in stages(d, problem.guess):
            rate = evaluate(s, [s.lagrange], run, times, u)[:, 0]
            cost += weights @ rate * (times[1] - times[0]) / 3 / d["units"]["t"]
    if s.mayer is not None:
        cost += evaluate(s, [s.mayer], run, np.array([run.t_end]), problem.guess[-1])[0, 0]
    d["guess_cost"] = float(cost * d["units"]["cost"])
    if not without_noise(d):
        return False
    if hasattr(FAMILIES[problem.family], "optimum"):
        d["optimum"] = FAMILIES[problem.family].optimum(d)
    return True
