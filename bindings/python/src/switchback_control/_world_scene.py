"""The scene that a world writes: its coordinates, inertia, forces and contacts, and where the bodies are in its states."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy

from . import _spatial as sp
from ._arrays import number
from .errors import ArgumentError, DimensionError
from .expr import Expr
from .multibody import Joint, Trees, loop
from .scene import Scene
from ._gaps import _Touch, expressions_of, separation_of, touches_of
from .shapes import Body, BodyState, Fixed, States, _Pair, _value

if TYPE_CHECKING:
    from .bodies import World
    from .runs import Run


@dataclass(frozen=True, eq=False)
class Layout:
    """Where the bodies are in the states of a scene: `read(states, u, p, t)`, for expressions and arrays alike."""

    world: World
    touches: list[_Touch]
    bodies: list[Body]
    read: Callable[[Any, Any, Any, Any], States]
    put: Callable[[Any], None]  # writes the start into an array of states
    fixed: list[Fixed] = field(default_factory=list)


def layout_of(run: Run) -> Layout | None:
    return getattr(getattr(run.system, "_scene", None), "_layout", None)


def rough(mu: Any) -> bool:
    """Is there friction?"""
    return callable(mu) or isinstance(mu, Expr) or number(mu, "mu") != 0.0


def write(world: World, pairs: list[_Pair]) -> Scene:
    """The scene of a world with these pairs of things that may touch."""
    turns = {b.name: _turns(b, pairs) for b in world.bodies}
    scene, read, put = (_in_space if world.space else _in_the_plane)(world, turns)
    states = read(scene.x, scene.u, scene.p, scene.t)
    found = [touches_of(p) for p in pairs]
    touches = [touch for group in found for touch in group]
    apart = [a for p, group in zip(pairs, found) for a in [separation_of(p, group, states)] * len(group)]
    for touch, (gap, sliding), far in zip(touches, expressions_of(touches, states), apart):
        tangents = sliding if rough(touch.mu) else []
        scene.contact(touch.name, gap, tangents, mu=_value(touch.mu, states), e=_value(touch.e, states), separation=far)
    for joint in world.joints:
        _hold(scene, joint, states)
    for name, zero in world._constraints:
        scene.constraint(name, zero(states))
    scene.impact_law(world.impact_law)
    scene._layout = Layout(world, touches, list(world.bodies), read, put, list(world.fixed))
    return scene


def _turns(body: Body, pairs: list[_Pair]) -> bool:
    if body.turns is not None:
        return body.turns
    return any(rough(p.mu) for p in pairs if body is p.a or body is p.b or body is getattr(p.b, "on", None))


def _parts(body: Body, given: Any, n: int, turning: int) -> list[Any]:
    """The components of a force, `n` of them and `turning` of a torque."""
    try:
        parts = list(given)
    except TypeError:
        raise ArgumentError(f"the force on {body.name} must be a list of components, not {given!r:.60}") from None
    if not turning and len(parts) == n + (3 if n == 3 else 1):
        raise ArgumentError(f"there is a torque on {body.name}, which does not turn: make it with turns=True")
    if len(parts) not in (n, n + turning):
        raise DimensionError(f"the force on {body.name} has {len(parts)} components, expected {n}")
    return parts + [0.0] * (n + turning - len(parts))


# --- in the plane ---------------------------------------------------------------------------------------


def _in_the_plane(world: World, turns: dict[str, bool]) -> tuple[Scene, Any, Any]:
    q: list[str] = []
    v: list[str] = []
    places = {}
    for body in world.bodies:
        n = 3 if turns[body.name] else 2
        places[body.name] = len(q), n
        q += [f"{body.name}.{c}" for c in ("x", "y", "angle")[:n]]
        v += [f"{body.name}.{c}" for c in ("vx", "vy", "omega")[:n]]
    scene = Scene(q, v, world._controls, world._parameters, name=world.name)
    n_q = len(q)

    def read(x: Any, u: Any, p: Any, t: Any) -> States:
        bodies = {}
        for name, (at, n) in places.items():
            here, moves = [x[at + i] for i in range(n)], [x[n_q + at + i] for i in range(n)]
            bodies[name] = BodyState(here[:2], moves[:2], *((here[2], moves[2]) if n == 3 else ()))
        return States(world, bodies, u, p, t)

    def put(x: Any) -> None:
        for name, (at, n) in places.items():
            placed = world._placed_of(name)
            x[at : at + n] = (*placed.position, placed.angle)[:n]
            x[n_q + at : n_q + at + n] = (*placed.velocity, placed.omega)[:n]

    states = read(scene.x, scene.u, scene.p, scene.t)
    inertia, force = numpy.zeros(n_q), [scene.graph.constant(0.0)] * n_q
    for body in world.bodies:
        at, n = places[body.name]
        inertia[at : at + n] = (body.mass, body.mass, body.inertia)[:n]
        for i, g in enumerate(world.gravity):
            force[at + i] = scene.graph.constant(body.mass * g)
        for f in world._forces.get(body.name, []):
            for i, part in enumerate(_parts(body, f(states), 2, n - 2)):
                force[at + i] = force[at + i] + part
    scene.inertia(inertia)
    scene.force(force)
    return scene, read, put


# --- in space -------------------------------------------------------------------------------------------


def _kind(body: Body, turns: bool, held: bool) -> str:
    if body.shape == "point" and not held:
        return "point"
    plain = numpy.ndim(body.inertia) == 0 and body.shape == "sphere" and not any(body.shapes[0].at)
    if plain and not held:
        return "round" if turns else "point"
    return "free"


def _in_space(world: World, turns: dict[str, bool]) -> tuple[Scene, Any, Any]:
    held = {b.name for j in world.joints for b in (j.parent, j.body) if b is not None}
    held |= {f.on.name for f in world.fixed if f.on is not None}
    kinds = {b.name: _kind(b, turns[b.name], b.name in held) for b in world.bodies}
    trees = Trees.of(world.bodies, world.joints, kinds)
    names = [h.names for h in trees.held]
    q, v = ([n for group in names for n in group[i]] for i in (0, 1))
    scene = Scene(q, v, world._controls, world._parameters, name=world.name)

    def read(x: Any, u: Any, p: Any, t: Any) -> States:
        bodies, joints = trees.states(*_both(x, trees))
        return States(world, bodies, u, p, t, joints)

    def put(x: Any) -> None:
        for h in trees.held:
            x[h.q : h.q + h.n_q], x[trees.n_q + h.v : trees.n_q + h.v + h.n_v] = _start(world, h)

    states = read(scene.x, scene.u, scene.p, scene.t)
    here, moves = list(scene.q), list(scene.v)
    frames = trees.frames(here, moves)
    pushes: dict[str, tuple[Any, Any]] = {}
    for body in world.bodies:
        for f in world._forces.get(body.name, []):
            parts = _parts(body, f(states), 3, 0 if kinds[body.name] == "point" and body.name not in held else 3)
            parts = parts + [0.0] * (6 - len(parts))
            old = pushes.get(body.name, (sp.ZERO, sp.ZERO))
            pushes[body.name] = sp.add(old[0], parts[:3]), sp.add(old[1], parts[3:])
    force = trees.force(frames, moves, world.gravity, pushes)
    inertia = trees.inertia(frames)
    for h in trees.held:
        if h.joint is not None and h.n_v == 1:
            _drive(world, h.joint, states, force, inertia, h.v)
    if len(q) != len(v) or any(h.n_q != h.n_v for h in trees.held):
        scene.rates(trees.rates(here, moves))
    diagonal = all(sp._is(m, 0.0) for i, row in enumerate(inertia) for j, m in enumerate(row) if i != j)
    scene.inertia([row[i] for i, row in enumerate(inertia)] if diagonal else inertia)
    scene.force(force)
    return scene, read, put


def _both(x: Any, trees: Trees) -> tuple[list[Any], list[Any]]:
    return [x[i] for i in range(trees.n_q)], [x[trees.n_q + i] for i in range(trees.n_v)]


def _start(world: World, h: Any) -> tuple[list[float], list[float]]:
    """Coordinates and velocities where a body, or its joint, is placed."""
    if h.joint is not None:
        return world._placed_joints.get(h.joint.name, ([1.0, 0.0, 0.0, 0.0][: h.n_q] if h.n_q > 1 else [0.0] * h.n_q, [0.0] * h.n_v))
    placed = world._placed_of(h.body.name)
    q, v = list(placed.position), list(placed.velocity)
    if h.kind == "round":
        v += list(placed.omega)
    if h.kind == "free":
        q += sp.quaternion_of(placed.turn)
        v += list(numpy.array(placed.turn).T @ placed.omega)
    return q, v


def _drive(world: World, joint: Joint, s: States, force: list[Any], inertia: Any, at: int) -> None:
    """What acts along the coordinate of a joint."""
    armature = _value(joint.armature, s)
    inertia[at][at] = sp.plus(inertia[at][at], armature)
    damping = _value(joint.damping, s)
    force[at] = sp.minus(force[at], sp.times(damping, s[joint].v))
    for f in world._forces.get(joint.name, []):
        given = f(s)
        if isinstance(given, (list, tuple)) and len(given) != 1:
            raise DimensionError(f"the force at {joint.name} has {len(given)} components, expected one")
        force[at] = sp.plus(force[at], given[0] if isinstance(given, (list, tuple)) else given)


def _hold(scene: Scene, joint: Joint, s: States) -> None:
    """Constraints of a loop; stops and dry friction of a joint."""
    if joint.loop:
        for name, zero in loop(joint, None if joint.parent is None else s[joint.parent], s[joint.body]):
            # what the coordinates hold already, as hinges with parallel axes do in a plane, needs no constraint
            if not sp._is(zero, 0.0):
                scene.constraint(f"{joint.name} {name}", zero)
        return
    if joint.kind not in ("hinge", "slider"):
        return
    q, bounds = s[joint].q, joint.limits
    for word, bound, sign in (("lower", bounds[0], 1.0), ("upper", bounds[1], -1.0)):
        value = _value(bound, s)
        if isinstance(value, Expr) or math.isfinite(value):
            scene.contact(f"{joint.name} {word}", sign * (q - value), e=_value(joint.e, s))
    if rough(joint.friction):
        stiction = None if joint.stiction is None else _value(joint.stiction, s)
        scene.friction(joint.name, q, _value(joint.friction, s), stiction)
