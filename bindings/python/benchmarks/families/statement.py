"""What the families share: units, numbers drawn over decades, models and scenes whose expressions have no units."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import switchback_control as swb


@dataclass
class Statement:
    """A problem but for its numbers at the ends, which the data have.

    `lagrange` and `mayer` have no units. `goal` are expressions whose values at the end are given, `goal_sizes` their sizes, relative to which there
    may be room. `pairs` are places of controls that are 0 or 1 by a complementarity of a stage.
    """

    system: Any
    lagrange: Any = None
    mayer: Any = None
    goal: Any = ()
    goal_sizes: Any = ()
    path: Any = ()
    pairs: Any = ()
    options: dict[str, Any] = field(default_factory=dict)
    functions: dict[int, Any] = field(default_factory=dict)

    def control_bounds(self, d: dict[str, Any]) -> tuple[list[float], list[float]]:
        unit = np.array(d["units"]["u"])
        return (np.array(d["bounds"][0]) * unit).tolist(), (np.array(d["bounds"][1]) * unit).tolist()


def function_of(s: Statement, outputs: Any) -> Any:
    """The function of these outputs; it is made once."""
    key = id(outputs)
    if key not in s.functions:
        s.functions[key] = outputs, s.system.function(list(outputs))
    return s.functions[key][1]


def without_noise(d: dict[str, Any]) -> bool:
    """Is the cost of the guess a number that says something?"""
    return math.isfinite(d["guess_cost"]) and abs(d["guess_cost"]) > 1e-6 * d["units"]["cost"]


def decades(rng: np.random.Generator, low: float, high: float) -> float:
    """A number between low and high, every decade as likely as another."""
    return float(10 ** rng.uniform(math.log10(low), math.log10(high)))


def around(rng: np.random.Generator, value: float, factor: float = 1.5) -> float:
    """A number within a factor of a value."""
    return float(value * factor ** rng.uniform(-1, 1))


def pick(rng: np.random.Generator, *of: Any) -> Any:
    """One of several, each as likely."""
    return of[int(rng.integers(len(of)))]


def whole(rng: np.random.Generator, low: int, high: int) -> int:
    """A whole number from low to high."""
    return int(rng.integers(low, high + 1))


def pieces(rng: np.random.Generator, stages: int, low: float, high: float, longest: int = 3) -> list[float]:
    """A control that stays for some stages at a number between low and high."""
    values: list[float] = []
    while len(values) < stages:
        values += [float(rng.uniform(low, high))] * whole(rng, 1, longest)
    return values[:stages]


def mechanical(rng: np.random.Generator, n: int, controls: int) -> dict[str, Any]:
    """Units of n lengths and n speeds, with forces as controls."""
    length, time, mass = (decades(rng, 0.03, 30.0) for _ in range(3))
    force = mass * length / time**2
    return {
        "length": length, "t": time, "mass": mass, "force": force, "x": [length] * n + [length / time] * n, "u": [force] * controls,
        "cost": decades(rng, 0.03, 30.0),
    }  # fmt: skip


def plain(rng: np.random.Generator, n: int, controls: int) -> dict[str, Any]:
    """Units of n states, each its own, and of controls."""
    return {
        "t": decades(rng, 0.03, 30.0), "x": [decades(rng, 0.1, 10.0) for _ in range(n)], "u": [decades(rng, 0.1, 10.0) for _ in range(controls)],
        "cost": decades(rng, 0.03, 30.0),
    }  # fmt: skip


def model(d: dict[str, Any], name: str, states: int | None = None) -> tuple[Any, list[Any], list[Any]]:
    """A model with its states and controls without units."""
    n = states or len(d["units"]["x"])
    m = swb.Model(n, len(d["units"]["u"]), name=name)
    return m, [m.x[i] / d["units"]["x"][i] for i in range(n)], [m.u[j] / unit for j, unit in enumerate(d["units"]["u"])]


def derive(d: dict[str, Any], m: Any, rates: Any) -> None:
    """Sets derivatives that have no units."""
    m.derivatives = [r * (unit / d["units"]["t"]) for r, unit in zip(rates, d["units"]["x"])]


def scene(d: dict[str, Any], name: str, masses: Any) -> tuple[Any, list[Any], list[Any], list[Any]]:
    """A scene with its coordinates, speeds and controls without units."""
    units, n = d["units"], len(masses)
    s = swb.Scene(n, u=len(units["u"]), name=name)
    s.inertia([m * units["mass"] for m in masses])
    q = [s.q[i] / units["x"][i] for i in range(n)]
    v = [s.v[i] / units["x"][n + i] for i in range(n)]
    return s, q, v, [s.u[j] / unit for j, unit in enumerate(units["u"])]


def forces(d: dict[str, Any], s: Any, values: Any) -> None:
    """Sets forces that have no units."""
    s.force([f * d["units"]["force"] for f in values])


def events(run: Any) -> int:
    """How often a simulation switches, bounces and jumps; many, where that accumulates."""
    return len(run.switches) + len(run.impacts) + len(run.jumps) + 1000 * len(run.accumulations)


def timed(rng: np.random.Generator, d: dict[str, Any], kinds: tuple[str, ...]) -> None:
    """Draws the kind of cost; where time is a cost the horizon is free."""
    d["cost"] = pick(rng, *kinds)
    if d["cost"] == "time":
        d["free"] = {"what": "horizon", "bounds": [0.3 * d["horizon"], 2.0 * d["horizon"]]}


def running(d: dict[str, Any], u: Any, unit: float = 1.0) -> Any:
    """The running cost of that kind, of controls relative to a unit."""
    square = sum((w / unit) ** 2 for w in u)
    if d["cost"] == "time":
        return 1.0 + 0.02 * square
    if d["cost"] == "fuel":
        return sum(abs(w / unit) for w in u)
    return square
