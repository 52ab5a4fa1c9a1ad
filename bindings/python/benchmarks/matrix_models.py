"""Small models for matrix.py: every ingredient of a hybrid system beside a flow, and every pair of them.

A mass on a spring with a damper, `q' = v`, `v' = u + p - q - 0.4 v`, is the flow of all. An ingredient adds its part to it, in the
statement that can write it: a `Model`, a `Scene` where there are contacts, friction at joints or constraints, a `Projected` where a state
is held. What a statement has no method for is asked of its `System`.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
import switchback_control as swb

INGREDIENTS = (
    "flow",
    "algebraic",
    "switch",
    "inclusion",
    "unilateral",
    "contact",
    "joint",
    "bilateral",
    "transition",
    "clock",
    "choice",
)

HORIZON, STAGES = 1.2, 4
#: Start, parameter and constant control of the simulations.
Q0, V0, P0, U0 = 1.0, -0.5, 0.3, 0.2
#: What the transition makes of the velocity, and where.
BRAKE, GUARD = 0.6, 0.62


#: Ingredients that are stated in a scene.
MECHANICAL = {"contact", "joint", "bilateral"}


class CannotBeStated(Exception):
    """The statements of the library have no place for it; the message says why."""


def rows():
    """The ingredients alone, then their pairs, as tuples. A flow is in all of them, so a pair with it is the other one alone."""
    return [(a,) for a in INGREDIENTS] + list(combinations(INGREDIENTS[1:], 2))


@dataclass
class Case:
    """A model of the matrix: its statement, whose `function` makes costs, the system, and where a run begins."""

    parts: tuple
    statement: object
    system: swb.System
    x0: np.ndarray  # states without discrete ones
    u: np.ndarray  # constant controls
    q: object
    v: object
    #: A change of the start that keeps constraints, in the states without discrete ones.
    along: np.ndarray

    @property
    def name(self):
        return " + ".join(self.parts)

    def lagrange(self):
        s = self.statement
        return self.q**2 + 0.5 * self.v**2 + 0.2 * s.u[0] ** 2 + (0.1 * s.u[1] if "choice" in self.parts else 0.0)

    def mayer(self):
        return 2.0 * (self.q - 0.2) ** 2

    def start(self, by=0.0):
        return self.x0 + by * self.along


def can_be_stated(parts):
    """Whether one model has these ingredients: a set that holds a state is no part of a scene."""
    return "unilateral" not in parts or not MECHANICAL & set(parts)


def build(parts):
    """The model of one or two ingredients. Raises CannotBeStated, or what the library raises where the parts are put together."""
    have = set(parts)
    mechanical = have & MECHANICAL
    if not can_be_stated(parts):
        raise CannotBeStated(f"a Scene has no set that holds a state, a Projected has no {' and '.join(sorted(mechanical))}")
    kind = "scene" if mechanical else "projected" if "unilateral" in have else "model"
    s, q, v, z = _states(kind, have)
    force, equation = _force(kind, s, q, v, z, have)
    if kind == "scene":
        system = _scene(s, q, v, z, force, equation, have)
    elif kind == "projected":
        system = _projected(s, q, v, force, equation, have)
    else:
        system = _model(s, q, v, force, equation, have)
    if "algebraic" in have:
        system.set_algebraic(1)
    if "inclusion" in have:
        _inclusion(s, system, [1] if kind != "scene" else [2 if "bilateral" in have else 1])
    if "choice" in have and kind != "model":
        system.add_choice(1, [0.0, 1.0])
    two = "bilateral" in have
    x0 = [Q0, 2.0 * Q0, V0, 2.0 * V0] if two else [Q0, V0]
    along = [1.0, 2.0, 0.0, 0.0] if two else [1.0, 0.0]
    if "algebraic" in have:
        x0, along = [*x0, 0.7], [*along, 0.0]
    u = [U0, 1.0] if "choice" in have else [U0]
    return Case(parts, s, system, np.array(x0), np.array(u), q, v, np.array(along))


def _states(kind, have):
    """The statement with its variables, the position, the velocity, and what equations determine (None without)."""
    u = "push on" if "choice" in have else "push"
    extra = "algebraic" in have
    if kind == "scene":
        s = swb.Scene("pos gear" if "bilateral" in have else "pos", u=u, p="load", name="mass", states="flow" if extra else 0)
        return s, s.q[0], s.v[0], s.states[0] if extra else None
    states = "pos speed flow" if extra else "pos speed"
    if kind == "projected":
        s = swb.Projected(states, u=u, p="load", name="mass")
    else:
        s = swb.Model(states=states, controls=u, parameters="load", name="mass")
    return s, s.x[0], s.x[1], s.x[2] if extra else None


def _force(kind, s, q, v, z, have):
    """What accelerates the mass, and the algebraic equation (None without)."""
    force = s.u[0] + s.p[0] - q - 0.4 * v
    if "algebraic" in have:
        force = force - 0.5 * z
    if "switch" in have:
        force = force - 0.4 * swb.sign(v + 0.8)
    if "choice" in have:
        force = force + 0.5 * s.u[1]
    if "clock" in have:
        force = force + s.hold(-0.5 * v, 0.25, name="held")
    return force, z + 0.2 * z**3 - q if "algebraic" in have else None


def _jump(s, q, v):
    """A guard that brakes the mass once; a discrete state counts it, and pushes from then on."""
    braked = s.discrete("braked", 0)
    speeds = s.v if isinstance(s, swb.Scene) else [v]
    s.transition(q < GUARD, when={braked: 0}, reset={w: BRAKE * w for w in speeds}, to={braked: 1}, name="brake")
    return 0.3 * braked


def _model(s, q, v, force, equation, have):
    if "transition" in have:
        force = force + _jump(s, q, v)
    s.derivatives = [v, force] if equation is None else [v, force, equation]
    if "choice" in have:
        s.choice("on", [0, 1])
    return s.system()


def _scene(s, q, v, z, force, equation, have):
    if "transition" in have:
        force = force + _jump(s, q, v)
    s.force([force, 0.1 * s.v[1]] if "bilateral" in have else [force])
    if equation is not None:
        s.state_rates([equation])
    if "contact" in have:
        s.contact("stop", gap=q - 0.45, e=0.5)
    if "joint" in have:
        s.friction("joint", q, 0.25)
    if "bilateral" in have:
        s.constraint("gear", s.q[1] - 2.0 * q)
    return s.system()


def _projected(s, q, v, force, equation, have):
    if "transition" in have:
        force = force + _jump(s, q, v)
    s.f([v, force] if equation is None else [v, force, equation])
    s.constraint("wall", q - 0.55)
    return s.system()


def _inclusion(s, system, rows):
    """A force that is not linear in a set-valued step of the position."""
    n = system.nx
    x = s.graph.inputs("x", n + 1)
    f = s.graph.function(-0.3 * x[n] - 0.1 * x[n] ** 2, n + 1, s.nu, s.np, "inclusion")
    psi = s.graph.function(x[0] - 0.7, n, s.nu, s.np, "psi")
    system.add_inclusion(f, psi, 1, rows=rows)
