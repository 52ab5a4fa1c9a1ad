"""Optimal control problems of systems that switch, to be solved from the default start with default options.

`PROBLEMS` has them all: `PROBLEMS["snell_2"].make(**options)` returns the `Ocp`. Where `exact` is a number, it is the optimal
cost on the grid of the problem, derived in the docstring. `stable` is false where the motion is unstable, so that small
errors of the discretisation grow when the controls are simulated.

usage: optima_problems.py --write | --check

The same problems are documents, `benches/optima/NAME.json`, for those who do without Python: `--write` writes them, `--check`
says which are not what is written here. Of the options they hold those that are not the default.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Callable

import numpy as np

import switchback_control as swb
from switchback_control import clip, cos, dead_zone, exp, maximum, minimum, sign, sin, where
from switchback_control.expr import Model, solve, step_table

INF = np.inf
DOCUMENTS = Path(__file__).resolve().parents[3] / "benches" / "optima"


@dataclass(frozen=True)
class Problem:
    """How to state it, what kind it is, its optimal cost where that is known from elsewhere."""

    name: str
    category: str
    make: Callable[..., swb.Ocp]
    exact: float | None
    note: str
    stable: bool


PROBLEMS: dict[str, Problem] = {}


def problem(category: str, exact: float | None = None, stable: bool = True) -> Callable[..., Any]:
    """Registers a function that returns an `Ocp`; the first line of its docstring is the note."""

    def register(make: Callable[..., swb.Ocp]) -> Callable[..., swb.Ocp]:
        note = (make.__doc__ or "").strip().splitlines()[0]
        PROBLEMS[make.__name__] = Problem(make.__name__, category, make, exact, note, stable)
        return make

    return register


def _root(f: Callable[[float], float], a: float, b: float) -> float:
    """Where f changes its sign between a and b."""
    sign_a = f(a) > 0
    for _ in range(200):
        c = (a + b) / 2
        a, b = (c, b) if (f(c) > 0) == sign_a else (a, c)
    return (a + b) / 2


def _lowest(f: Callable[[float], float], a: float, b: float) -> float:
    """The smallest value of a function with one minimum between a and b."""
    golden = (math.sqrt(5) - 1) / 2
    for _ in range(200):
        c, d = b - golden * (b - a), a + golden * (b - a)
        a, b = (a, d) if f(c) < f(d) else (c, b)
    return f((a + b) / 2)


def _reach(ocp: swb.Ocp, m: Model, goal: Any) -> swb.Ocp:
    """All states have these values in the end."""
    ocp.add_terminal(m.function([*m.x]), goal, goal)
    return ocp


def _fastest(ocp: swb.Ocp, m: Model, what: str, lower: float, upper: float) -> swb.Ocp:
    ocp.set_lagrange(m.function([1.0]))
    ocp.set_free_time(what, lower, upper)
    return ocp


def _on(condition: Any) -> Any:
    return where(condition, 1, 0)


# --- refraction -----------------------------------------------------------------------------------


def _snell_exact(heights: list[float], speeds: list[float], width: float) -> float:
    """Least time through layers: cos(heading) / speed is the same in all of them; the constant is found by bisection."""

    def reach(k: float) -> float:
        return sum(h * k * c / math.sqrt(1 - (k * c) ** 2) for h, c in zip(heights, speeds)) - width

    k = _root(reach, 0.0, (1 - 1e-15) / max(speeds))
    return sum(h / (c * math.sqrt(1 - (k * c) ** 2)) for h, c in zip(heights, speeds))


def _layers(heights: list[float], speeds: list[float]) -> Model:
    m = Model(states="x y", controls="heading")
    y, a = m.x[1], m.u[0]
    breaks = [float(b) for b in np.cumsum(heights)[:-1]]
    c = step_table(y, breaks, speeds)
    m.derivatives = [c * cos(a), c * sin(a)]
    return m


def _snell(heights: list[float], speeds: list[float], width: float, n: int, free: str, **o: Any) -> swb.Ocp:
    m = _layers(heights, speeds)
    ocp = swb.Ocp(m, 5.0, n, initial_state=[0, 0], control_bounds=(-0.5, 3.5), **o)
    _fastest(ocp, m, free, *((0.05, 20.0) if free == "stages" else (1.0, 20.0)))
    return _reach(ocp, m, [width, sum(heights)])


SNELL_2 = ([1.0, 1.0], [1.0, 0.4])
SNELL_3 = ([1.0, 0.5, 1.0], [1.0, 2.0, 0.7])
SNELL_5 = ([0.5, 0.5, 0.5, 0.5, 0.5], [1.0, 1.3, 0.6, 1.6, 0.9])


@problem("refraction", _snell_exact(*SNELL_2, 2.0))
def snell_2(**o):
    """Fastest way through two media, a heading for each of two stages of free length.

    Headings are constant inside a medium and change where the speed does, so two stages are enough. Snell's law has
    one unknown, which is found by bisection."""
    return _snell(*SNELL_2, 2.0, 2, "stages", **o)


@problem("refraction", _snell_exact(*SNELL_3, 2.0))
def snell_3(**o):
    """Fastest way through three media with three free stages; the middle one is fast. Snell's law, by bisection."""
    return _snell(*SNELL_3, 2.0, 3, "stages", **o)


@problem("refraction", _snell_exact(*SNELL_5, 2.0))
def snell_5(**o):
    """Fastest way through five media with five free stages. Snell's law, by bisection."""
    return _snell(*SNELL_5, 2.0, 5, "stages", **o)


@problem("refraction")
def snell_grid(**o):
    """Fastest way through two media, ten stages of equal length: no stage ends where the speed changes."""
    return _snell(*SNELL_2, 2.0, 10, "horizon", **o)


def _slanted_exact(h: float = 1.0, c1: float = 0.5, c2: float = 1.0, end: float = 3.0) -> float:
    a2 = math.pi / 4
    a1 = math.acos(c1 / c2 * math.cos(a2))
    return h / (c1 * math.sin(a1)) + (end - h / math.tan(a1)) / math.sqrt(2) / c2


@problem("refraction", _slanted_exact())
def snell_free_end(**o):
    """Fastest way from a slow medium to a line in a fast one; the end point is free.

    The line x + y = 3 is reached at a right angle; Snell's law then gives the heading in the slow medium, y < 0."""
    m = Model(states="x y", controls="heading")
    (x, y), a = m.x, m.u[0]
    c = where(y > 0, 1.0, 0.5)
    m.derivatives = [c * cos(a), c * sin(a)]
    ocp = swb.Ocp(m, 4.0, 2, initial_state=[0, -1], control_bounds=(-1, 3), **o)
    _fastest(ocp, m, "stages", 0.05, 20)
    ocp.add_terminal(m.function([x + y]), [3.0], [3.0])
    return ocp


RIVER = ([1.0, 1.0, 1.0], [0.0, 0.6, 0.2])


def _river_exact(width: float = -1.0) -> float:
    """With speed 1 and current c the adjoint of x is cos(heading) / (1 + c cos(heading)), the same in all layers."""

    def headings(k: float) -> list[float]:
        return [math.acos(k / (1 - k * c)) for c in RIVER[1]]

    def reach(k: float) -> float:
        return sum(h * (math.cos(a) + c) / math.sin(a) for h, c, a in zip(*RIVER, headings(k))) - width

    k = _root(reach, -0.62, 0.5)
    return sum(h / math.sin(a) for h, a in zip(RIVER[0], headings(k)))


def _river(n: int, free: str, **o: Any) -> swb.Ocp:
    m = Model(states="x y", controls="heading")
    y, a = m.x[1], m.u[0]
    m.derivatives = [cos(a) + step_table(y, [1.0, 2.0], RIVER[1]), sin(a)]
    ocp = swb.Ocp(m, 5.0, n, initial_state=[0, 0], control_bounds=(0, math.pi), **o)
    _fastest(ocp, m, free, *((0.05, 20.0) if free == "stages" else (1.0, 20.0)))
    return _reach(ocp, m, [-1.0, 3.0])


@problem("refraction", _river_exact())
def zermelo_river(**o):
    """Fastest crossing of a river with three regions of current, three free stages.

    The adjoint of x is the same in all regions (there is no jump along the river), which gives each heading; its value
    is found by bisection."""
    return _river(3, "stages", **o)


@problem("refraction")
def zermelo_grid(**o):
    """The same river with twelve stages of equal length."""
    return _river(12, "horizon", **o)


@problem("refraction")
def sailing(**o):
    """A boat with inertia of its heading through two currents: the rudder turns the rate of turn."""
    m = Model(states="x y a w", controls="rudder")
    (x, y, a, w), r = m.x, m.u[0]
    m.derivatives = [cos(a) + where(y > 1, -0.6, 0.3) * where(x > 2, 0.5, 1.0), sin(a), w, 2 * r - w]
    ocp = swb.Ocp(m, 5.0, 15, initial_state=[0, 0, 0.5, 0], control_bounds=(-1, 1), **o)
    ocp.set_lagrange(m.function([1 + 0.05 * r**2]))
    ocp.set_free_time("horizon", 1, 20)
    ocp.add_terminal(m.function([x, y]), [3, 2], [3, 2])
    return ocp


# --- bang-bang, singular, sliding: known answers --------------------------------------------------


def _bang_bang(distance: float, a: float, b: float) -> float:
    """Rest to rest with acceleration a, then deceleration b."""
    return math.sqrt(2 * distance * (a + b) / (a * b))


def _friction_move(mu: float, n: int, **o: Any) -> swb.Ocp:
    m = Model(states="q v", controls="force")
    v = m.x[1]
    m.derivatives = [v, m.u[0] - mu * sign(v)]
    ocp = swb.Ocp(m, 2.0, n, initial_state=[0, 0], control_bounds=(-1, 1), **o)
    _fastest(ocp, m, "stages", 0.01, 10)
    return _reach(ocp, m, [1, 0])


@problem("bang-bang", _bang_bang(1, 0.8, 1.2))
def friction_move_02(**o):
    """Fastest move of a mass with dry friction 0.2, two free stages: full force 1 - mu forward, then 1 + mu back."""
    return _friction_move(0.2, 2, **o)


@problem("bang-bang", _bang_bang(1, 0.5, 1.5))
def friction_move_05(**o):
    """Fastest move of a mass with dry friction 0.5, two free stages; see friction_move_02."""
    return _friction_move(0.5, 2, **o)


@problem("bang-bang", _bang_bang(1, 0.2, 1.8))
def friction_move_08(**o):
    """Fastest move of a mass with dry friction 0.8, two free stages; see friction_move_02."""
    return _friction_move(0.8, 2, **o)


@problem("bang-bang", _bang_bang(1, 0.7, 1.3))
def friction_move_many(**o):
    """Fastest move of a mass with dry friction 0.3, ten free stages, of which two would do; see friction_move_02."""
    return _friction_move(0.3, 10, **o)


def _regions_exact(a: float = 0.7, g1: float = 1.0, g2: float = 3.0) -> float:
    # the work of both halves is equal: accelerate to s (in the second region), brake from there
    s = (a + 1.0) / 2 - a * g1 / (2 * g2)
    v1 = math.sqrt(2 * g1 * a)
    v2 = math.sqrt(v1**2 + 2 * g2 * (s - a))
    return v1 / g1 + (v2 - v1) / g2 + v2 / g2


@problem("bang-bang", _regions_exact())
def gain_regions(**o):
    """Fastest move where the force counts three times beyond 0.7, two free stages.

    Full force to a point s, full brake from there; in the second region v(s)^2 / 2 = g1 a + g2 (s - a) = g2 (1 - s)."""
    m = Model(states="q v", controls="force")
    q, v = m.x
    m.derivatives = [v, where(q > 0.7, 3.0, 1.0) * m.u[0]]
    ocp = swb.Ocp(m, 2.0, 2, initial_state=[0, 0], control_bounds=(-1, 1), **o)
    _fastest(ocp, m, "stages", 0.01, 10)
    return _reach(ocp, m, [1, 0])


def _turbo(n: int, free: str, **o: Any) -> swb.Ocp:
    m = Model(states="q v", controls="u")
    (_, v), u = m.x, m.u[0]
    m.derivatives = [v, where(v > 15, 3 * u, u)]
    ocp = swb.Ocp(m, 10.0, n, initial_state=[0, 0], control_bounds=(-5, 5), **o)
    ocp.set_state_bounds([-INF, -25], [INF, 25])
    _fastest(ocp, m, free, *((0.1, 20) if free == "stages" else (1, 40)))
    return _reach(ocp, m, [200, 0])


@problem("bang-bang", 2 * (15 / 5 + 10 / 15) + (200 - 2 * (15**2 / 10 + (25**2 - 15**2) / 30)) / 25)
def turbo_3(**o):
    """A car with a turbo above 15 m/s and a limit of 25 m/s, three free stages.

    Full acceleration to 25 m/s (3 s and 2/3 s), constant speed, full brake: times and distances add up."""
    return _turbo(3, "stages", **o)


@problem("bang-bang")
def turbo_car(**o):
    """The car with a turbo on ten stages of equal length."""
    return _turbo(10, "horizon", **o)


def _gears_exact(distance: float = 60.0) -> float:
    v = math.sqrt(100 + 6 * (distance / 2 - 25 / 10 - 75 / 8))
    return 2 * (5 / 5 + 5 / 4 + (v - 10) / 3)


@problem("bang-bang", _gears_exact())
def gears_time(**o):
    """Fastest drive with three gears, ten stages of equal length.

    The gain of the pedal is the same for acceleration and brake, so the first half mirrors the second, and the pedal
    changes in the middle, where a stage ends: (v^2 - 100) / 6 + 75 / 8 + 25 / 10 is half of the distance."""
    m = Model(states="q v", controls="pedal")
    v = m.x[1]
    m.derivatives = [v, step_table(v, [5.0, 10.0], [5.0, 4.0, 3.0]) * m.u[0]]
    ocp = swb.Ocp(m, 10.0, 10, initial_state=[0, 0], control_bounds=(-1, 1), **o)
    _fastest(ocp, m, "horizon", 1, 40)
    return _reach(ocp, m, [60, 0])


@problem("bang-bang", math.log(4 / 3) / 1.0 + math.log((4 - 1.5) / (4 - 1.5 * 2)) / 1.5)
def heating(**o):
    """Fastest heating of a body whose losses rise when a valve opens at 1.

    Full power 4 all the time; x' = 4 - x up to 1, then x' = 4 - 1.5 x up to 2."""
    m = Model(states="x", controls="power")
    x = m.x[0]
    m.derivatives = [m.u[0] - where(x > 1, 1.5 * x, x)]
    ocp = swb.Ocp(m, 2.0, 10, initial_state=[0], control_bounds=(0, 4), **o)
    _fastest(ocp, m, "horizon", 0.1, 10)
    return _reach(ocp, m, [2])


@problem("bang-bang", math.sqrt(2 * 0.5 / (1 - 0.5)))
def fuel_friction(**o):
    """Least fuel for a move with dry friction in 4 s, three free stages: a push, coasting, rest.

    Fuel of a push with full force t1: distance 1 = t1^2 (1 - mu) / (2 mu) with mu = 0.5. A brake at the end of length d
    saves d / mu of the moving time, that is d of the fuel against friction, and costs 2 d."""
    m = Model(states="q v", controls="forward backward")
    v, (f, b) = m.x[1], m.u
    m.derivatives = [v, f - b - 0.5 * sign(v)]
    ocp = swb.Ocp(m, 4.0, 3, initial_state=[0, 0], control_bounds=(0, 1), **o)
    ocp.set_lagrange(m.function([f + b]))
    ocp.set_free_time("stages", 0.01, 4)
    ocp.add_horizon(4, 4)
    return _reach(ocp, m, [1, 0])


@problem("energy", 12 * 1.0**2 / (0.2**3 * 10 * 99) + 0.2**2 * 2)
def friction_energy(**o):
    """Least energy for a move with dry friction 0.2 in 2 s, ten stages; it never rests.

    With w = u - mu the integral of u^2 is that of w^2 plus mu^2 T, because w integrates to zero. On n stages of length h
    the least sum of h w^2 with the moment d is 12 d^2 / (h^3 n (n^2 - 1)). The last force is below -mu, so it cannot stop
    earlier, and rest pays only for T above sqrt(6 d / mu)."""
    m = Model(states="q v", controls="force")
    v, u = m.x[1], m.u[0]
    m.derivatives = [v, u - 0.2 * sign(v)]
    ocp = swb.Ocp(m, 2.0, 10, initial_state=[0, 0], control_bounds=(-5, 5), **o)
    ocp.set_lagrange(m.function([u**2]))
    return _reach(ocp, m, [1, 0])


@problem("energy", 16 / 9)
def friction_energy_rest(**o):
    """Least energy for a move with dry friction 2/3 in 5 s with linear controls: it moves for 3 s and rests.

    A move in the time s costs 12 d^2 / s^3 + mu^2 s, least at s = sqrt(6 d / mu) = 3, where 4 mu^2 s / 3 is left; its
    force falls from 2 mu to 0, which is continuous with rest and linear on stages of 0.5 s."""
    m = Model(states="q v", controls="force")
    v, u = m.x[1], m.u[0]
    m.derivatives = [v, u - 2 / 3 * sign(v)]
    ocp = swb.Ocp(m, 5.0, 10, initial_state=[0, 0], control_bounds=(-5, 5), **o)
    ocp.set_linear_controls()
    ocp.set_lagrange(m.function([u**2]))
    return _reach(ocp, m, [1, 0])


def _headwind_exact(total: float = 3.0) -> float:
    # speeds 1 / t1 outside, 1 / t2 + 1 inside of the band; 2 t1 + t2 is given
    return _lowest(lambda t1: 2 / t1 + (1 + 1 / (total - 2 * t1)) ** 2 * (total - 2 * t1), 0.05, total / 2 - 0.01)


@problem("energy", _headwind_exact())
def headwind(**o):
    """Least energy through a band of headwind, three free stages, 3 s in all.

    The speed is constant in each region, times t1, t2, t1 for a distance of 1 each; a cost with one unknown is left."""
    m = Model(states="q", controls="u")
    q, u = m.x[0], m.u[0]
    m.derivatives = [u - where((q > 1) & (q < 2), 1.0, 0.0)]
    ocp = swb.Ocp(m, 3.0, 3, initial_state=[0], control_bounds=(-5, 5), **o)
    ocp.set_lagrange(m.function([u**2]))
    ocp.set_free_time("stages", 0.05, 3)
    ocp.add_horizon(3, 3)
    return _reach(ocp, m, [3])


@problem("energy", 16 * 0.2**2 * (math.pi / 6) / (2 * 12 * math.sin(math.pi / 12) ** 2))
def resonance(**o):
    """Least energy that keeps an oscillator with dry friction 0.2 going for a period, twelve stages.

    Friction is a square wave s with the velocity, whose sign changes in the middle. The end is the start if the force
    u has the same moments with sin and cos as the friction, 4 mu and 0: u is proportional to a, the integrals of sin
    over the stages, whose squares sum to 24 sin(h / 2)^2, and costs 16 mu^2 h / 24 / sin(h / 2)^2. The adjoint of v vanishes where
    v does, so that moving the switch gains nothing."""
    m = Model(states="q v", controls="force")
    (q, v), u = m.x, m.u[0]
    m.derivatives = [v, -q - 0.2 * sign(v) + u]
    ocp = swb.Ocp(m, 2 * math.pi, 12, initial_state=[1, 0], control_bounds=(-2, 2), **o)
    ocp.set_lagrange(m.function([u**2]))
    return _reach(ocp, m, [1, 0])


@problem("sliding", 4.0)
def slide_through(**o):
    """From 1 to -1 against a relay in 3 s: it drifts to zero, slides there for a second, and leaves.

    x' = u - sign x. Drift and sliding cost nothing with u = 0. Leaving in t seconds needs u = -1 - 1 / t, which costs
    t + 2 + 1 / t: one second. Stages of 0.25 s."""
    m = Model(states="x", controls="u")
    x, u = m.x[0], m.u[0]
    m.derivatives = [u - sign(x)]
    ocp = swb.Ocp(m, 3.0, 12, initial_state=[1], control_bounds=(-5, 5), **o)
    ocp.set_lagrange(m.function([u**2]))
    return _reach(ocp, m, [-1])


@problem("sliding", 2 / 9)
def singular_slide(**o):
    """To zero as fast as possible, and there a singular arc on the surface, with any control that holds it.

    x' = u - 0.5 sign x, cost x^2: full control moves at 1.5, so the integral of x^2 is 1 / (3 * 1.5)."""
    m = Model(states="x", controls="u")
    x, u = m.x[0], m.u[0]
    m.derivatives = [u - 0.5 * sign(x)]
    ocp = swb.Ocp(m, 2.0, 12, initial_state=[1], control_bounds=(-1, 1), **o)
    ocp.set_lagrange(m.function([x**2]))
    return ocp


def _stewart_exact() -> float:
    t = (-6 + math.sqrt(36 + 32 * 14 / 3)) / 16
    return 3 * t**3 + (2 - t) ** 3 / 3 + (1 / 3 - t) ** 2


@problem("textbook", _stewart_exact())
def stewart(**o):
    """The free initial state of a system with a kink (Stewart, Anitescu 2010).

    x' = 2 - sign x, cost of x^2 over [0, 2] and (x(2) - 5/3)^2. With the switch at t the start is -3 t, the cost
    3 t^3 + (2 - t)^3 / 3 + (1/3 - t)^2, and 8 t^2 + 6 t = 14/3."""
    m = Model(states="x", controls=0)
    x = m.x[0]
    m.derivatives = [2 - sign(x)]
    ocp = swb.Ocp(m, 2.0, 10, initial_bounds=(-5, 5), **o)
    ocp.set_lagrange(m.function([x**2]))
    ocp.set_mayer(m.function([(x - 5 / 3) ** 2]))
    return ocp


@problem("parameters", _bang_bang(3, 1, 2))
def brake_point(**o):
    """Where to brake: a threshold that is a state of its own, with a free start.

    Acceleration 1 before the threshold and -2 behind it, rest at 3: bang-bang with given rates."""
    m = Model(states="q v c", controls=0)
    q, v, c = m.x
    m.derivatives = [v, where(q < c, 1, -2), 0]
    ocp = swb.Ocp(m, 3.0, 10, initial_bounds=([0, 0, 0], [0, 0, 3]), **o)
    _fastest(ocp, m, "horizon", 0.5, 10)
    ocp.add_terminal(m.function([q, v]), [3, 0], [3, 0])
    return ocp


def _estimation_data() -> tuple[np.ndarray, np.ndarray]:
    t = np.arange(1, 11) * 0.4
    mu = 0.37
    q = np.where(t < 1 / mu, t - mu * t**2 / 2, 0.5 / mu)
    return t, q + 0.02 * np.array([1, -2, 0.5, 1.5, -1, 2, -0.5, 1, 0.3, -1.2])


def _estimation_exact() -> float:
    t, data = _estimation_data()
    cost = lambda mu: float(np.sum((np.where(t < 1 / mu, t - mu * t**2 / 2, 0.5 / mu) - data) ** 2))
    return min(_lowest(cost, a, a + 0.01) for a in np.arange(0.05, 1.0, 0.01))


@problem("parameters", _estimation_exact())
def friction_estimation(**o):
    """Least squares for the friction coefficient of a block that slides to rest, from noisy positions.

    The position is known: t - mu t^2 / 2 up to 1 / mu, then 0.5 / mu. A cost with one unknown is left."""
    m = Model(states="q v", controls=0, parameters="mu")
    q, v = m.x
    m.derivatives = [v, -m.p[0] * sign(v)]
    ocp = swb.Ocp(m, 4.0, 10, initial_state=[0, 1], params=[0.6], **o)
    ocp.set_param_bounds(0.05, 2.0)
    ocp.add_least_squares(m.function([q]), [1.0], _estimation_data()[1].reshape(-1, 1), at="control_grid")
    return ocp


# --- textbook problems with regions ---------------------------------------------------------------


@problem("textbook")
def two_surfaces(**o):
    """Two curves catch the state one after the other, and let it go again."""
    m = Model(states="q1 q2 v1 v2", controls="u1 u2")
    (q1, q2, v1, v2), (u1, u2) = m.x, m.u
    m.derivatives = [v1 - sign(q1 + 0.15 * q2**2), v2 - sign(q2 - 0.05 * q1**3), u1, u2]
    start = [2 * np.pi / 3, np.pi / 3, 0, 0]
    ocp = swb.Ocp(m, 4.0, 10, initial_state=start, control_bounds=(-10, 10), **o)
    ocp.set_state_bounds([-INF, -INF, -2, -2], [INF, INF, 2, 2])
    ocp.set_lagrange(m.function([u1**2 + u2**2 + v1**2 + v2**2]))
    goal = [-np.pi / 6, -np.pi / 4]
    ocp.add_terminal(m.function([q1, q2]), goal, goal)
    return ocp


@problem("textbook")
def switched_lq(**o):
    """Linear-quadratic in each half plane: a stable focus on one side, an unstable one on the other."""
    m = Model(states="x y", controls="u")
    (x, y), u = m.x, m.u[0]
    m.derivatives = [where(x > 0, 0.5 * x + 2 * y, -x + 2 * y), where(x > 0, -2 * x + 0.5 * y, -2 * x - y) + u]
    ocp = swb.Ocp(m, 4.0, 20, initial_state=[1.0, 1.0], control_bounds=(-4, 4), **o)
    ocp.set_lagrange(m.function([x**2 + y**2 + 0.2 * u**2]))
    ocp.set_mayer(m.function([5 * (x**2 + y**2)]))
    return ocp


@problem("textbook")
def tanks(**o):
    """Two tanks with overflows: the first one is filled past its brim as the only way to the second."""
    m = Model(states="upper lower", controls="inflow")
    (upper, lower), inflow = m.x, m.u[0]
    over = where(upper > 1, 4 * (upper - 1), 0)
    m.derivatives = [inflow - over - 0.1 * upper, over - 0.3 * lower]
    ocp = swb.Ocp(m, 10.0, 10, initial_state=[0.2, 0.0], control_bounds=(0, 1), **o)
    ocp.add_least_squares(m.function([lower]), [10.0], 0.8)
    ocp.add_least_squares(m.function([inflow]), [0.1], 0.0)
    return ocp


@problem("textbook")
def relay_plant(**o):
    """A relay in the loop, whose set point is steered: the output follows a step, the relay slides."""
    m = Model(states="x y r", controls="rate")
    (x, y, r), u = m.x, m.u[0]
    m.derivatives = [y, -0.5 * x - y - 1.5 * sign(x - r + 0.4 * y), u]
    ocp = swb.Ocp(m, 5.0, 15, initial_state=[0, 0, 0], control_bounds=(-2, 2), **o)
    ocp.add_least_squares(m.function([x]), [10.0], 1.0)
    ocp.add_least_squares(m.function([u]), [0.2], 0.0)
    return ocp


@problem("textbook")
def brachistochrone(**o):
    """Chords of steepest time where gravity trebles below a depth of 0.5."""
    m = Model(states="x y v", controls="angle")
    (x, y, v), a = m.x, m.u[0]
    g = where(y > 0.5, 3.0, 1.0)
    m.derivatives = [v * cos(a), v * sin(a), g * sin(a)]
    ocp = swb.Ocp(m, 2.5, 15, initial_state=[0, 0, 0], control_bounds=(-1.5, 1.57), **o)
    _fastest(ocp, m, "horizon", 0.5, 10)
    ocp.add_terminal(m.function([x, y]), [2, 1], [2, 1])
    return ocp


@problem("textbook")
def oscillator_time(**o):
    """Time-optimal stop of an oscillator with dry friction, ten free stages."""
    m = Model(states="q v", controls="force")
    (q, v), u = m.x, m.u[0]
    m.derivatives = [v, -q - 0.3 * sign(v) + u]
    ocp = swb.Ocp(m, 5.0, 10, initial_state=[3, 0], control_bounds=(-1, 1), **o)
    _fastest(ocp, m, "stages", 0.01, 3)
    return _reach(ocp, m, [0, 0])


@problem("textbook")
def thermostat(**o):
    """Two rooms with ideal thermostats, whose set points move: comfort against energy, counted by a state."""
    m = Model(states="a b s energy", controls="rate")
    (a, b, s, energy), u = m.x, m.u[0]
    heat_a, heat_b = 8 * _on(a < s), 6 * _on(b < s - 1)
    m.derivatives = [0.3 * (5 - a) + 0.2 * (b - a) + heat_a, 0.2 * (5 - b) + 0.2 * (a - b) + heat_b, u, heat_a + heat_b]
    ocp = swb.Ocp(m, 6.0, 12, initial_state=[15, 14, 16, 0], control_bounds=(-3, 3), **o)
    ocp.add_least_squares(m.function([a, b]), [1.0, 1.0], np.repeat([[17.0, 16.0], [21.0, 20.0]], 6, axis=0))
    ocp.add_least_squares(m.function([u]), [0.1], 0.0)
    ocp.set_mayer(m.function([0.5 * energy]))
    return ocp


@problem("textbook")
def sign_tracking(**o):
    """A restoring force of constant size: position follows a sine."""
    m = Model(states="q v", controls="u")
    (q, v), u = m.x, m.u[0]
    m.derivatives = [v, u - 2 * sign(q) - 0.2 * v]
    ocp = swb.Ocp(m, 6.0, 20, initial_state=[0.5, 0], control_bounds=(-6, 6), **o)
    t = (np.arange(20) + 0.5) * 0.3
    ocp.add_least_squares(m.function([q]), [20.0], np.sin(2 * t).reshape(-1, 1))
    ocp.add_least_squares(m.function([u]), [0.05], 0.0)
    return ocp


@problem("textbook")
def speeding(**o):
    """A drive in given time: speed above 12 is fined, the fine is a state; a hill lies in between."""
    m = Model(states="q v fine", controls="u")
    (q, v, fine), u = m.x, m.u[0]
    slope = where((q > 30) & (q < 60), 1.5, 0.0)
    m.derivatives = [v, u - slope - 0.05 * v, maximum(v - 12, 0)]
    ocp = swb.Ocp(m, 13.0, 20, initial_state=[0, 0, 0], control_bounds=(-4, 4), **o)
    ocp.set_lagrange(m.function([u**2]))
    ocp.set_mayer(m.function([3 * fine]))
    ocp.add_terminal(m.function([q, v]), [100, 0], [100, 0])
    return ocp


# --- friction -------------------------------------------------------------------------------------


@problem("friction")
def voice_coil(**o):
    """A voice-coil motor with Coulomb friction, 10 mm in least time, in SI units (Christiansen, Maurer, Zirn 2008)."""
    m1, m2, k, umax, resistance, inductance, kf, ks, fr = 1.03, 0.56, 2.4e3, 5.0, 2.0, 2e-3, 12.0, 12.0, 2.1
    m = Model(states="x1 v1 x2 v2 I", controls="U")
    (x1, v1, x2, v2, i), u = m.x, m.u[0]
    spring = k * (x1 - x2)
    m.derivatives = [
        v1,
        (kf * i - spring - fr * sign(v1)) / m1,
        v2,
        spring / m2,
        (u - resistance * i - ks * v1) / inductance,
    ]
    ocp = swb.Ocp(m, 0.09, 30, initial_state=np.zeros(5), control_bounds=(-umax, umax), **o)
    _fastest(ocp, m, "horizon", 0.02, 0.3)
    return _reach(ocp, m, [0.01, 0, 0.01, 0, 0])


def _arm(n: int, **o: Any) -> swb.Ocp:
    m = Model(2 * n, controls=n)
    q, w, u = m.x[:n], m.x[n:], m.u
    zero, length = 0 * q[0], 1.0 / n

    def total(terms: Any) -> Any:
        return sum(terms, zero)

    angle = [total(q[: i + 1]) for i in range(n)]
    rate = [total(w[: i + 1]) for i in range(n)]
    mass = [[zero] * n for _ in range(n)]
    bias = [zero] * n
    for k in range(n):  # unit masses at the ends of the links
        jx = [-total(length * sin(angle[j]) for j in range(i, k + 1)) for i in range(n)]
        jy = [total(length * cos(angle[j]) for j in range(i, k + 1)) for i in range(n)]
        ax = -total(length * cos(angle[j]) * rate[j] ** 2 for j in range(k + 1))
        ay = -total(length * sin(angle[j]) * rate[j] ** 2 for j in range(k + 1))
        for i in range(n):
            bias[i] = bias[i] + jx[i] * ax + jy[i] * (ay + 9.81)
            for j in range(n):
                mass[i][j] = mass[i][j] + jx[i] * jx[j] + jy[i] * jy[j]
    rhs = [u[i] - bias[i] - 0.1 * w[i] - 0.3 * sign(w[i]) for i in range(n)]
    m.derivatives = list(w) + list(solve(mass, rhs))
    ocp = swb.Ocp(m, 1.5, 20, initial_state=np.zeros(2 * n), control_bounds=(-60, 60), **({"n_fe": 2} | o))
    ocp.add_least_squares(m.function(list(u)), [1e-3] * n, 0.0)
    return _reach(ocp, m, [0.6] * n + [0] * n)


@problem("friction")
def arm_2(**o):
    """A planar arm of two links with friction in both joints, rest to rest."""
    return _arm(2, **o)


@problem("friction")
def arm_3(**o):
    """A planar arm of three links with friction in all joints, rest to rest."""
    return _arm(3, **o)


@problem("friction")
def arm_4(**o):
    """A planar arm of four links with friction in all joints, rest to rest."""
    return _arm(4, **o)


@problem("friction")
def arm_short(**o):
    """The arm of two links in half a second with another measure of masses: hardly any time to rest."""
    m = Model(4, controls=2)
    q, w, u = m.x[:2], m.x[2:], m.u
    a, b = q[0], q[0] + q[1]
    wa, wb = w[0], w[0] + w[1]
    m11 = 0.25 * (2 + 2 * cos(q[1]) + 1)
    m12 = 0.25 * (1 + cos(q[1]))
    h = 0.25 * sin(q[1])
    rhs = [
        u[0] - 9.81 * 0.5 * (2 * cos(a) + cos(b)) + h * (wb**2 - wa**2) - 0.1 * w[0] - 0.3 * sign(w[0]),
        u[1] - 9.81 * 0.5 * cos(b) - h * wa**2 - 0.1 * w[1] - 0.3 * sign(w[1]),
    ]
    m.derivatives = [*w, *solve([[m11, m12], [m12, 0.25 + 0 * a]], rhs)]
    ocp = swb.Ocp(m, 0.5, 10, initial_state=[0.0] * 4, control_bounds=(-60, 60), **o)
    ocp.add_least_squares(m.function(list(u)), [1e-3] * 2, 0.0)
    return _reach(ocp, m, [0.6, 0.6, 0, 0])


@problem("friction", stable=False)
def acrobot(**o):
    """Swing-up of a double pendulum with limited torques and dry friction in both joints."""
    m1, m2, l1, l2, g, b, mu = 1.0, 1.2, 1.0, 1.2, 9.81, 0.3, 0.7
    m = Model(states="q1 q2 w1 w2", controls="t1 t2")
    (q1, q2, w1, w2), (t1, t2) = m.x, m.u
    m11 = m1 * l1**2 / 3 + m2 * (l1**2 + l2**2 / 3 + l1 * l2 * cos(q2))
    m12 = m2 * (l2**2 / 3 + l1 * l2 * cos(q2) / 2)
    m22 = m2 * l2**2 / 3
    f1 = t1 + m2 * l1 * l2 * sin(q2) * (2 * w1 * w2 + w2**2) / 2 - b * w1 - mu * sign(w1)
    f1 = f1 - g * (m1 * l1 / 2 + m2 * l1) * sin(q1) - g * m2 * l2 / 2 * sin(q1 + q2)
    f2 = t2 - m2 * l1 * l2 * sin(q2) * w1**2 / 2 - b * w2 - mu * sign(w2) - g * m2 * l2 / 2 * sin(q1 + q2)
    det = m11 * m22 - m12**2
    m.derivatives = [w1, w2, (m22 * f1 - m12 * f2) / det, (m11 * f2 - m12 * f1) / det]
    ocp = swb.Ocp(m, 4.0, 40, initial_state=np.zeros(4), control_bounds=(-10, 10), **o)
    ocp.set_state_bounds([-np.pi, -np.pi, -INF, -INF], [np.pi, np.pi, INF, INF])
    goal = [np.pi, 0, 0, 0]
    ocp.add_least_squares(m.function([*m.x]), [10, 10, 1, 1], goal)
    ocp.add_least_squares(m.function([t1, t2]), [0.1, 0.1], 0.0)
    ocp.add_least_squares(m.function([*m.x]), [100, 100, 10, 10], goal, at="terminal")
    return ocp


@problem("friction", stable=False)
def pendulum(**o):
    """Swing-up of a pendulum with dry friction in its bearing and a torque that cannot hold it."""
    m = Model(states="a w", controls="torque")
    (a, w), u = m.x, m.u[0]
    m.derivatives = [w, u - 9.81 * sin(a) - 0.4 * sign(w) - 0.1 * w]
    ocp = swb.Ocp(m, 3.5, 25, initial_state=[0, 0], control_bounds=(-5, 5), **o)
    ocp.set_lagrange(m.function([u**2]))
    return _reach(ocp, m, [np.pi, 0])


@problem("friction", stable=False)
def cart_pole(**o):
    """Swing-up with dry friction under the cart."""
    m = Model(states="q a v w", controls="force")
    (q, a, v, w), force = m.x, m.u[0]
    mass, pole, length, g, friction = 1.0, 0.1, 1.0, 9.81, 2.0
    push = force - friction * sign(v) + pole * sin(a) * (length * w**2 + g * cos(a))
    reach = mass + pole * sin(a) ** 2
    turn = -(cos(a) * (force - friction * sign(v) + pole * length * w**2 * sin(a)) + (mass + pole) * g * sin(a))
    m.derivatives = [v, w, push / reach, turn / (length * reach)]
    ocp = swb.Ocp(m, 4.0, 30, initial_state=[1, 0, 0, 0], control_bounds=(-30, 30), **o)
    goal = [0, np.pi, 0, 0]
    ocp.add_least_squares(m.function([q, a, v, w]), [1, 100, 1, 1], goal)
    ocp.add_least_squares(m.function([force]), [1.0], [0.0])
    ocp.add_least_squares(m.function([q, a, v, w]), [100, 100, 10, 10], goal, at="terminal")
    return ocp


@problem("friction")
def crane(**o):
    """A crane moves its load 3 m, rest to rest, with dry friction in the trolley."""
    m = Model(states="q v a w", controls="force")
    (_, v, a, w), u = m.x, m.u[0]
    acceleration = (u - 0.8 * sign(v) + 0.5 * sin(a) * (2 * w**2 + 9.81 * cos(a))) / (1 + 0.5 * sin(a) ** 2)
    m.derivatives = [v, acceleration, w, -(acceleration * cos(a) + 9.81 * sin(a)) / 2]
    ocp = swb.Ocp(m, 4.0, 20, initial_state=np.zeros(4), control_bounds=(-8, 8), **o)
    ocp.set_lagrange(m.function([u**2]))
    return _reach(ocp, m, [3, 0, 0, 0])


@problem("friction")
def motor(**o):
    """A motor drives a load over a spring; dry friction holds the load until the spring is wound up."""
    m = Model(states="a b va vb current", controls="voltage")
    (a, b, va, vb, current), voltage = m.x, m.u[0]
    spring = 8 * (a - b) + 0.2 * (va - vb)
    m.derivatives = [va, vb, 5 * current - spring, spring - 0.8 * sign(vb), 10 * (voltage - va - 0.5 * current)]
    ocp = swb.Ocp(m, 3.0, 12, initial_state=np.zeros(5), control_bounds=(-4, 4), **o)
    ocp.set_lagrange(m.function([voltage**2 + 0.1 * current**2]))
    return _reach(ocp, m, [1, 1, 0, 0, 0])


@problem("friction")
def blocks(**o):
    """Three blocks with dry friction on a chain: the force on the last one drags the others along."""
    m = Model(states="q1 q2 q3 v1 v2 v3", controls="force")
    q, v = m.x[:3], m.x[3:]
    springs = [-2 * q[0] + q[1], q[0] - 2 * q[1] + q[2], q[1] - q[2] + m.u[0]]
    m.derivatives = [*v, *[s - w - 0.3 * sign(w) for s, w in zip(springs, v)]]
    ocp = swb.Ocp(m, 5.0, 10, initial_state=[-1, 1, -1, -1, 1, 1], control_bounds=(-10, 10), **o)
    goal = [-1, 0, 1, 0, 0, 0]
    ocp.add_least_squares(m.function([m.u[0]]), [1.0], 0.0)
    ocp.add_least_squares(m.function([*q, *v]), 6 * [1.0], goal)
    ocp.add_least_squares(m.function([*q, *v]), 6 * [100.0], goal, at="terminal")
    return ocp


@problem("friction")
def belt(**o):
    """A block on a belt with friction that falls with speed, held at a place by a spring and a force."""
    m = Model(states="q v", controls="force")
    (q, v), u = m.x, m.u[0]
    slip = 0.5 - v
    m.derivatives = [v, u - q + sign(slip) * (0.4 + 0.6 / (1 + 3 * abs(slip)))]
    ocp = swb.Ocp(m, 6.0, 15, initial_state=[-0.5, 0.5], control_bounds=(-2, 2), **o)
    ocp.set_lagrange(m.function([4 * (q - 0.3) ** 2 + v**2 + u**2]))
    return ocp


@problem("friction")
def drill(**o):
    """A drill string with friction at the bit: start it, and keep it turning at 2 rad/s."""
    m = Model(states="twist top bit", controls="torque")
    (twist, top, bit), u = m.x, m.u[0]
    m.derivatives = [top - bit, u - 3 * twist - 0.2 * top, 3 * twist - sign(bit) * (0.6 + 0.6 / (1 + abs(bit)))]
    ocp = swb.Ocp(m, 8.0, 20, initial_state=[0, 0, 0], control_bounds=(0, 5), **o)
    ocp.add_least_squares(m.function([top, bit]), [1.0, 4.0], 2.0)
    ocp.add_least_squares(m.function([u]), [0.1], 1.4)
    return ocp


@problem("friction")
def crawler(**o):
    """Two masses with rough scales: back is harder than forth. A muscle between them crawls as far as it can."""
    m = Model(states="x1 x2 v1 v2", controls="muscle")
    (x1, x2, v1, v2), u = m.x, m.u[0]
    scales = [where(v > 0, -0.3, 1.5) for v in (v1, v2)]
    spring = 4 * (x2 - x1 - 1) + u
    m.derivatives = [v1, v2, spring - v1 + scales[0], -spring - v2 + scales[1]]
    ocp = swb.Ocp(m, 6.0, 20, initial_state=[0, 0.3, 0, 0], control_bounds=(-3, 3), **o)
    ocp.set_lagrange(m.function([0.02 * u**2]))
    ocp.set_mayer(m.function([-x1 - x2]))
    return ocp


@problem("friction")
def two_masses(**o):
    """Two masses, a spring and friction of different size: the far one is put to rest at a distance, by linear controls."""
    m = Model(states="q1 q2 v1 v2", controls="force")
    (q1, q2, v1, v2), u = m.x, m.u[0]
    spring = 10 * (q1 - q2)
    m.derivatives = [v1, v2, u - spring - 0.2 * sign(v1), spring - 0.5 * sign(v2)]
    ocp = swb.Ocp(m, 3.0, 15, initial_state=np.zeros(4), control_bounds=(-6, 6), **o)
    ocp.set_linear_controls()
    ocp.set_lagrange(m.function([u**2]))
    ocp.add_terminal(m.function([q2, v1, v2]), [1, 0, 0], [1, 0, 0])
    return ocp


# --- vehicles -------------------------------------------------------------------------------------


@problem("vehicles")
def landing(**o):
    """A planar quadrotor lands at rest; the ground adds thrust below 0.5 m, hot air takes some beyond 1 m."""
    m = Model(states="x z th vx vz w", controls="f1 f2")
    (x, z, th, vx, vz, w), (f1, f2) = m.x, m.u
    f = (f1 + f2) * (1 + where(z < 0.5, 0.6 * (0.5 - z), 0.0))
    f = f * where(x > 1.0, 0.9, 1.0)
    m.derivatives = [vx, vz, w, -f * sin(th), f * cos(th) - 9.81 - 0.1 * vz, 10 * (f1 - f2)]
    ocp = swb.Ocp(m, 3.0, 20, initial_state=[2, 2, 0, 0, 0, 0], control_bounds=(0, 10), **({"n_fe": 2} | o))
    ocp.set_lagrange(m.function([(f1 - 4.9) ** 2 + (f2 - 4.9) ** 2 + 0.1 * w**2]))
    return _reach(ocp, m, np.zeros(6))


def _gearbox(n: int, horizon: float) -> tuple[Model, Callable[..., swb.Ocp]]:
    m = Model(states="q v", controls="pedal")
    v, u = m.x[1], m.u[0]
    m.derivatives = [v, step_table(v, [5.0, 10.0, 16.0, 24.0], [5.0, 4.0, 3.0, 2.2, 1.6]) * u - 0.0008 * v**2]
    return m, lambda **o: swb.Ocp(m, horizon, n, initial_state=[0, 0], control_bounds=(-1, 1), **o)


@problem("vehicles")
def gearbox_fuel(**o):
    """500 m in 45 s with five gears and drag, with the least use of pedals."""
    m, make = _gearbox(20, 45.0)
    ocp = make(**o)
    ocp.set_lagrange(m.function([m.u[0] ** 2]))
    return _reach(ocp, m, [500, 0])


@problem("vehicles")
def gearbox_time(**o):
    """500 m in the least time with five gears and drag, fifteen stages of equal length."""
    m, make = _gearbox(15, 30.0)
    return _reach(_fastest(make(**o), m, "horizon", 5, 60), m, [500, 0])


@problem("vehicles")
def lane_change(**o):
    """A car on tyres that saturate: lateral motion, 20 m/s, a lane of 3.5 m in 2 s, least steering."""
    m = Model(states="y psi vy r steer", controls="rate")
    (_, psi, vy, r, steer), u = m.x, m.u[0]
    speed, reach = 20.0, 1.4
    front = clip(steer - (vy + reach * r) / speed, -0.04, 0.04)
    rear = clip(-(vy - reach * r) / speed, -0.04, 0.04)
    m.derivatives = [vy + speed * psi, r, 80 * (front + rear) - speed * r, 60 * (front - rear), u]
    ocp = swb.Ocp(m, 2.0, 20, initial_state=np.zeros(5), control_bounds=(-1, 1), **o)
    ocp.set_lagrange(m.function([u**2 + 10 * steer**2]))
    return _reach(ocp, m, [3.5, 0, 0, 0, 0])


@problem("vehicles")
def slip_vehicle(**o):
    """A wheel on ice behind 20 m: drive torque turns the wheel, the road carries a saturating part of its slip."""
    m = Model(states="q v wheel", controls="torque")
    (q, v, wheel), u = m.x, m.u[0]
    grip = clip(2 * (wheel - v), -1, 1) * where(q > 20, 1.0, 3.0)
    m.derivatives = [v, grip, 5 * (u - grip)]
    ocp = swb.Ocp(m, 10.0, 20, initial_state=[0, 0, 0], control_bounds=(-4, 4), **o)
    ocp.set_lagrange(m.function([1 + 0.05 * u**2]))
    ocp.set_free_time("horizon", 2, 40)
    return _reach(ocp, m, [40, 0, 0])


@problem("vehicles")
def drone_wind(**o):
    """A drone through two zones of wind, from rest to rest, with drag relative to the air."""
    m = Model(states="x y vx vy", controls="ax ay")
    (x, y, vx, vy), (ax, ay) = m.x, m.u
    wx = where(y > 1, -3.0, 0.0)
    wy = where(x > 2, 2.0, 0.0)
    m.derivatives = [vx, vy, ax - 0.5 * (vx - wx), ay - 0.5 * (vy - wy)]
    ocp = swb.Ocp(m, 5.0, 15, initial_state=np.zeros(4), control_bounds=(-5, 5), **o)
    ocp.set_lagrange(m.function([ax**2 + ay**2]))
    return _reach(ocp, m, [4, 3, 0, 0])


@problem("vehicles")
def mud(**o):
    """Around an obstacle, where one of the ways leads through mud: a path constraint and a region."""
    m = Model(states="x y vx vy", controls="ax ay")
    (x, y, vx, vy), (ax, ay) = m.x, m.u
    drag = where(y > 0.5, 1.0, 0.1)
    m.derivatives = [vx, vy, ax - drag * vx, ay - drag * vy]
    ocp = swb.Ocp(m, 6.0, 20, initial_state=[0, 0, 0, 0], control_bounds=(-3, 3), **o)
    ocp.set_lagrange(m.function([ax**2 + ay**2]))
    ocp.add_path(m.function([(x - 2) ** 2 + (y + 0.2) ** 2]), [0.64], [INF])
    return _reach(ocp, m, [4, 0, 0, 0])


@problem("vehicles")
def goddard(**o):
    """A rocket that leaves the dense air at 0.1: height at burn-out of given fuel, free time; drag falls by steps."""
    m = Model(states="h v m", controls="thrust")
    (h, v, mass), u = m.x, m.u[0]
    drag = step_table(h, [0.02, 0.1], [8.0, 3.0, 0.2]) * v**2
    m.derivatives = [v, (u - drag) / mass - 1, -u / 0.5]
    ocp = swb.Ocp(m, 0.3, 20, initial_state=[0, 0, 1], control_bounds=(0, 3.5), **o)
    ocp.set_state_bounds([0, 0, 0.6], [INF, INF, 1])
    ocp.set_free_time("horizon", 0.05, 1.0)
    ocp.set_mayer(m.function([-h]))
    return ocp


@problem("vehicles")
def regenerative(**o):
    """An electric car: the battery takes back half of the power, which is a state and steered by its rate."""
    m = Model(states="q v force charge", controls="rate")
    (q, v, force, charge), u = m.x, m.u[0]
    m.derivatives = [v, force - 0.02 * v, u, where(force > 0, 1.1, 0.5) * force * v]
    ocp = swb.Ocp(m, 20.0, 20, initial_state=[0, 0, 0, 0], control_bounds=(-1, 1), **o)
    ocp.set_state_bounds([-INF, 0, -2, -INF], [INF, INF, 2, INF])
    ocp.set_lagrange(m.function([u**2]))
    ocp.set_mayer(m.function([charge]))
    ocp.add_terminal(m.function([q, v]), [100, 0], [100, 0])
    return ocp


@problem("vehicles")
def power_split(**o):
    """Engine and battery share a demand that rises and falls: the engine is worse below 0.4, the battery limited."""
    m = Model(states="engine soc fuel", controls="rate")
    (engine, soc, fuel), u = m.x, m.u[0]
    demand = 0.6 + 0.5 * sin(m.t)
    m.derivatives = [u, minimum(engine - demand, 0.85 * (engine - demand)), maximum(engine, 0.4) + 0.3 * engine**2]
    ocp = swb.Ocp(m, 8.0, 16, initial_state=[0.5, 0.5, 0], control_bounds=(-1, 1), **o)
    ocp.set_state_bounds([0, 0, -INF], [1, 1, INF])
    ocp.set_lagrange(m.function([0.1 * u**2]))
    ocp.set_mayer(m.function([fuel]))
    ocp.add_terminal(m.function([soc]), [0.5], [INF])
    return ocp


@problem("vehicles")
def target_disc(**o):
    """Into a disc with little speed in the least time, with dry friction in the plane that is rough beyond x = 1."""
    m = Model(states="x y vx vy", controls="ax ay")
    (x, y, vx, vy), (ax, ay) = m.x, m.u
    rough = where(x > 1, 0.5, 0.1)
    m.derivatives = [vx, vy, ax - rough * vx, ay - rough * vy - 0.2 * sign(vy)]
    ocp = swb.Ocp(m, 4.0, 15, initial_state=[0, 0, 0, 0], control_bounds=(-1, 1), **o)
    ocp.set_lagrange(m.function([1 + 0.1 * (ax**2 + ay**2)]))
    ocp.set_free_time("horizon", 1, 20)
    goal = m.function([(x - 3) ** 2 + (y - 1) ** 2, vx**2 + vy**2])
    ocp.add_terminal(goal, [0, 0], [0.04, 0.01])
    return ocp


@problem("vehicles")
def hovercraft(**o):
    """A unicycle with slip: side friction of constant size holds it to its heading."""
    m = Model(states="x y a v s w", controls="push turn")
    (x, y, a, v, s, w), (push, turn) = m.x, m.u
    m.derivatives = [
        v * cos(a) - s * sin(a),
        v * sin(a) + s * cos(a),
        w,
        push - 0.2 * v + s * w,
        -v * w - 1.0 * sign(s),
        turn - w,
    ]
    ocp = swb.Ocp(m, 4.0, 16, initial_state=np.zeros(6), control_bounds=(-3, 3), **o)
    ocp.set_lagrange(m.function([push**2 + turn**2]))
    ocp.add_terminal(m.function([x, y, a, s]), [2, 2, np.pi / 2, 0], [2, 2, np.pi / 2, 0])
    return ocp


# --- machines, circuits ---------------------------------------------------------------------------


@problem("circuits")
def buck(**o):
    """A buck converter with an ideal diode, averaged: start from zero; the current cannot turn back."""
    m = Model(states="i v", controls="duty")
    (i, v), d = m.x, m.u[0]
    m.derivatives = [4 * (10 * d - v) + 60 * _on(i < 0), 2 * (i - v)]
    ocp = swb.Ocp(m, 2.0, 20, initial_state=[0, 0], control_bounds=(0, 1), **o)
    ocp.add_least_squares(m.function([v]), [1.0], np.repeat([[5.0], [2.0]], 10, axis=0))
    ocp.add_least_squares(m.function([d]), [0.1], 0.3)
    return ocp


@problem("circuits")
def diode_charge(**o):
    """A capacitor behind a diode that conducts above 0.5: charge it in 3 s with the least loss."""
    m = Model(states="source store", controls="rate")
    (source, store), u = m.x, m.u[0]
    current = 2 * maximum(source - store - 0.5, 0)
    m.derivatives = [u - current, current - 0.1 * store]
    ocp = swb.Ocp(m, 3.0, 15, initial_state=[0, 0], control_bounds=(-5, 5), **o)
    ocp.set_lagrange(m.function([u**2]))
    ocp.add_terminal(m.function([source, store]), [0, 1], [0, INF])
    return ocp


@problem("circuits")
def saturated(**o):
    """An integrator chain behind a saturated actuator: a triangle is followed."""
    m = Model(states="q v f", controls="u")
    (q, v, f), u = m.x, m.u[0]
    m.derivatives = [v, clip(f, -1, 1) - 0.2 * v, 5 * (u - f)]
    ocp = swb.Ocp(m, 6.0, 18, initial_state=[0, 0, 0], control_bounds=(-3, 3), **o)
    t = (np.arange(18) + 0.5) / 3
    ocp.add_least_squares(m.function([q]), [10.0], (1 - np.abs(t / 1.5 % 2 - 1)).reshape(-1, 1))
    ocp.add_least_squares(m.function([u]), [0.05], 0.0)
    return ocp


@problem("circuits")
def gear_play(**o):
    """A load behind a shaft with play: no torque passes inside of the gap."""
    m = Model(states="a va b vb", controls="torque")
    (a, va, b, vb), u = m.x, m.u[0]
    shaft = 20 * dead_zone(a - b, 0.1)
    m.derivatives = [va, u - shaft - 0.3 * va, vb, shaft - 0.3 * vb]
    ocp = swb.Ocp(m, 3.0, 20, initial_state=np.zeros(4), control_bounds=(-6, 6), **o)
    ocp.set_lagrange(m.function([u**2]))
    ocp.add_terminal(m.function([va, b, vb]), [0, 1, 0], [0, 1, 0])
    return ocp


@problem("circuits")
def engine_table(**o):
    """An engine with a table of torque by speed starts a load with friction and takes it to 30 rad/s."""
    m = Model(states="engine load", controls="throttle clutch")
    (engine, load), (throttle, clutch) = m.x, m.u
    torque = step_table(engine, [10.0, 20.0, 30.0], [4.0, 6.0, 5.0, 3.0])
    passed = clutch * sign(engine - load)
    m.derivatives = [torque * throttle - 0.05 * engine - passed, passed - 0.5 * sign(load) - 0.02 * load]
    ocp = swb.Ocp(m, 20.0, 20, initial_state=[12, 0], control_bounds=([0, 0], [1, 5]), **o)
    ocp.set_lagrange(m.function([throttle**2 + 0.1 * clutch**2]))
    ocp.add_terminal(m.function([engine, load]), [30, 28], [40, 40])
    return ocp


@problem("circuits")
def swing_cycle(**o):
    """A swing with dry friction is kept going: the same state after every period, least energy, free start and period."""
    m = Model(states="a w", controls="torque")
    (a, w), u = m.x, m.u[0]
    m.derivatives = [w, -4 * sin(a) - 0.3 * sign(w) + u]
    ocp = swb.Ocp(m, 3.3, 12, initial_bounds=([0.8, 0], [1.2, 0]), control_bounds=(-2, 2), **o)
    ocp.set_free_time("horizon", 2.5, 4.5)
    ocp.set_lagrange(m.function([u**2]))
    ocp.add_periodic()
    return ocp


# --- kinetics -------------------------------------------------------------------------------------


@problem("kinetics")
def tumour(**o):
    """A drug works above a threshold only, and harms healthy cells: doses against growth."""
    m = Model(states="tumour healthy drug", controls="dose")
    (n, healthy, drug), u = m.x, m.u[0]
    effect = where(drug > 0.5, 1.2 * (drug - 0.5), 0.0)
    m.derivatives = [0.3 * n * (1 - 0.2 * n) - effect * n, 0.5 * (1 - healthy) - 0.4 * drug * healthy, u - 0.8 * drug]
    ocp = swb.Ocp(m, 8.0, 16, initial_state=[1, 1, 0], control_bounds=(0, 2), **o)
    ocp.set_state_bounds([0, 0.55, 0], [INF, INF, INF])
    ocp.set_lagrange(m.function([n + 0.1 * u**2]))
    ocp.set_mayer(m.function([5 * n]))
    return ocp


@problem("kinetics")
def reactor(**o):
    """An exothermic reactor that boils at 1.2: boiling cools, but loses product; the jacket is steered."""
    m = Model(states="a b temperature", controls="cooling")
    (a, b, temperature), u = m.x, m.u[0]
    rate = 2 * a * exp(3 - 3 / temperature)
    boil = maximum(temperature - 1.2, 0)
    m.derivatives = [-rate, rate - 0.4 * b * boil, 0.8 * rate - u * (temperature - 0.8) - 3 * boil]
    ocp = swb.Ocp(m, 4.0, 16, initial_state=[1, 0, 0.9], control_bounds=(0, 3), **o)
    ocp.set_state_bounds([-INF, -INF, 0.5], [INF, INF, 2])
    ocp.set_lagrange(m.function([0.02 * u**2]))
    ocp.set_mayer(m.function([-b]))
    return ocp


@problem("kinetics")
def stirred_tank(**o):
    """A reactor with a catalyst that works above a temperature: from cold to a steady product, switched on the way."""
    m = Model(states="c temperature", controls="heat")
    (c, temperature), u = m.x, m.u[0]
    k = where(temperature > 350, 0.8, 0.1)
    m.derivatives = [0.5 * (1 - c) - k * c, 0.5 * (300 - temperature) + 50 * k * c + u]
    ocp = swb.Ocp(m, 10.0, 20, initial_state=[1, 300], control_bounds=(0, 60), **o)
    ocp.add_least_squares(m.function([c]), [100.0], 0.5)
    ocp.add_least_squares(m.function([u]), [0.001], 0.0)
    return ocp


@problem("kinetics")
def two_genes(**o):
    """Two genes, each made in a band of both concentrations; a pulse lets one win (Acary, de Jong, Brogliato 2014)."""
    m = Model(states="a b", controls="inducer")
    (a, b), inducer = m.x, m.u[0]
    m.derivatives = [40 * _on((a > 4) & (b < 8)) - 4.5 * a + inducer, 40 * _on((a < 8) & (b > 4)) - 1.5 * b]
    ocp = swb.Ocp(m, 0.5, 10, initial_state=[5, 5], control_bounds=(0, 40), **o)
    ocp.add_least_squares(m.function([inducer]), [0.001], 0.0)
    ocp.add_least_squares(m.function([a, b]), [1, 1], [8.5, 0])
    return ocp


@problem("kinetics")
def irma(**o):
    """Five genes of yeast that switch one another (IRMA): a little inducer keeps SWI5 up."""
    m = Model(states="CBF1 GAL4 SWI5 GAL80 ASH1", controls="inducer")
    (cbf1, gal4, swi5, gal80, ash1), inducer = m.x, m.u[0]
    m.derivatives = [
        0.011 + 0.09 * _on(gal80 > 4) + inducer - 0.05 * cbf1,
        0.03 + 15 * _on(cbf1 > 1) - 0.04 * gal4,
        0.06 + 1.8 * _on(gal4 > 6) - 0.05 * swi5,
        _on(gal4 > 1) * (0.05 + 3 * (1 - _on(swi5 > 3.5))) - 0.02 * gal80,
        0.075 + 1.5 * _on(gal4 > 8) - 0.6 * ash1,
    ]
    ocp = swb.Ocp(m, 160.0, 10, initial_state=[1.1, 9, 4, 5, 1.5], control_bounds=(0, 0.1), **o)
    ocp.add_least_squares(m.function([inducer]), [1000.0], 0.0)
    ocp.add_least_squares(m.function([swi5]), [1.0], 20.0, at="terminal")
    return ocp


@problem("kinetics")
def fishery(**o):
    """A stock that grows slowly below a critical size is harvested: smooth harvest against what is left."""
    m = Model(states="stock", controls="harvest")
    x, u = m.x[0], m.u[0]
    m.derivatives = [where(x > 0.5, 1.0, 0.3) * x * (1 - x) - u * x]
    ocp = swb.Ocp(m, 10.0, 20, initial_state=[0.3], control_bounds=(0, 2), **o)
    ocp.set_lagrange(m.function([-u * x + 0.1 * u**2]))
    ocp.set_mayer(m.function([-x]))
    return ocp


@problem("parameters")
def relay_estimation(**o):
    """Gain and decay of a relay feedback from noisy measurements of its output: two free parameters."""
    m = Model(states="x y", controls=0, parameters="gain decay")
    x, y = m.x
    gain, decay = m.p
    m.derivatives = [y, -x - decay * y - gain * sign(x)]
    times = np.arange(1, 21) * 0.3
    model = Model(states="x y")
    x, y = model.x
    model.derivatives = [y, -x - 0.3 * y - 0.7 * sign(x)]
    run = swb.simulate(model, [1.0, 0.0], 6.0, rtol=1e-10)
    data = run(times)[:, 0] + 0.02 * np.sin(37.0 * np.arange(20) ** 1.5)
    ocp = swb.Ocp(m, 6.0, 20, initial_state=[1, 0], params=[0.4, 0.5], **o)
    ocp.set_param_bounds([0.05, 0.0], [3.0, 3.0])
    ocp.add_least_squares(m.function([m.x[0]]), [1.0], np.round(data, 6).reshape(-1, 1), at="control_grid")
    return ocp


# --- documents ------------------------------------------------------------------------------------


def _default_settings() -> dict[str, Any]:
    m = Model(states=1)
    m.derivatives = [-m.x[0]]
    return json.loads(swb.Ocp(m, 1.0, 1).to_json())["ocp"]["settings"]


def documents() -> dict[str, dict[str, Any]]:
    """All problems as data. Options that have their default are left out: the defaults of whoever reads them hold."""
    usual, found = _default_settings(), {}
    for name, p in PROBLEMS.items():
        data = json.loads(p.make().to_json())
        settings = data["ocp"]["settings"]
        data["ocp"]["settings"] = {key: value for key, value in settings.items() if value != usual[key]}
        found[name] = data
    return found


def same(a: Any, b: Any) -> bool:
    """Equal data, numbers but for the rounding of another machine."""
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(same(a[k], b[k]) for k in a)
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, float) and isinstance(b, float):
        return math.isclose(a, b, rel_tol=1e-12, abs_tol=1e-14)
    return bool(a == b)


def differences() -> list[str]:
    """Documents that are not those of the problems: missing, of no problem, or with something else in them."""
    stored = {f.stem: json.loads(f.read_text()) for f in DOCUMENTS.glob("*.json")}
    wanted = documents()
    changed = [name for name in wanted if name in stored and not same(wanted[name]["ocp"], stored[name].get("ocp"))]
    return sorted(wanted.keys() ^ stored.keys()) + changed


def write_documents() -> None:
    DOCUMENTS.mkdir(parents=True, exist_ok=True)
    wanted, other = documents(), set(differences())
    for name in other:
        file = DOCUMENTS / f"{name}.json"
        if name in wanted:
            file.write_text(json.dumps(wanted[name], separators=(",", ":")) + "\n")
        else:
            file.unlink()


def main() -> int:
    parser = argparse.ArgumentParser(description="Documents of the problems.")
    choice = parser.add_mutually_exclusive_group(required=True)
    choice.add_argument("--write", action="store_true", help="write the documents that differ")
    choice.add_argument("--check", action="store_true", help="say which documents differ")
    if parser.parse_args().write:
        write_documents()
    other = differences()
    if other:
        print(f"not as the problems are, run optima_problems.py --write: {', '.join(other)}")
    return 1 if other else 0


if __name__ == "__main__":
    sys.exit(main())
