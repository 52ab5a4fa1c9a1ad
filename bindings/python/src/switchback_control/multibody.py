"""Bodies in space that joints hold: their motion and their dynamics, in the coordinates of the joints.

Every body moves relative to another one, or to the world: freely, or as a joint lets it. Forces and inertia follow by
recursions along these trees: Newton's and Euler's equations outwards and inwards (J. Y. S. Luh, M. W. Walker,
R. P. C. Paul, 1980), and the inertia of composite bodies (M. W. Walker, D. E. Orin, 1982). Vectors of a body are in its axes,
about its centre of mass; accelerations are those of points, so a free body has no terms of its own for a moving frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy

from . import _spatial as sp
from .shapes import Body, BodyState, JointState

__all__ = ["Joint"]

# Numbers of coordinates and velocities of what holds a body to the one before. "free", "round" (it turns, and looks the same
# from everywhere) and "point" are against the world.
SIZES = {
    "fixed": (0, 0), "hinge": (1, 1), "slider": (1, 1), "ball": (4, 3),
    "free": (7, 6), "round": (3, 6), "point": (3, 3),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint of two bodies in space, as `World.joint` returns it.

    name, kind    "hinge", "slider", "ball", "fixed"
    parent        the first body, None for the world
    body          the second one
    at, to        the point of the joint, from the centre of mass of each of them, in their axes
    axis          of hinges and sliders, a unit vector in the axes of the second body
    turn          rotation of the second body against the first where the joint is at zero
    loop          it is a constraint between bodies that move by other coordinates
    limits, e     of a hinge or slider: the least and the largest value, -inf or inf where there is none, and restitution
    damping, friction, stiction, armature   of a hinge or slider: torque or force per rate, dry friction, what holds at rest
                  (None: the same), and inertia of a motor
    """

    name: str
    kind: str
    parent: Body | None
    body: Body
    at: tuple[float, ...]
    to: tuple[float, ...]
    axis: tuple[float, ...]
    turn: Any
    loop: bool = False
    limits: tuple[Any, Any] = (-numpy.inf, numpy.inf)
    e: Any = 0.0
    damping: Any = 0.0
    friction: Any = 0.0
    stiction: Any = None
    armature: Any = 0.0

    @property
    def _names(self) -> tuple[list[str], list[str]]:
        if self.kind == "ball":
            return [f"{self.name}.q{c}" for c in "wxyz"], [f"{self.name}.omega_{i}" for i in "123"]
        return ([self.name], [f"{self.name}.v"]) if SIZES[self.kind][0] else ([], [])

    def __repr__(self) -> str:
        return f"<Joint '{self.name}': {self.kind}>"


@dataclass(frozen=True, eq=False)
class _Held:
    """A body and what holds it: where its coordinates and velocities begin, and the place of the body it moves against."""

    body: Body
    kind: str
    q: int
    v: int
    parent: int = -1
    joint: Joint | None = None

    @property
    def names(self) -> tuple[list[str], list[str]]:
        if self.joint is not None:
            return self.joint._names
        n, axes = self.body.name, "xyz"
        q, v = [f"{n}.{c}" for c in axes], [f"{n}.v{c}" for c in axes]
        if self.kind == "round":
            v += [f"{n}.omega_{c}" for c in axes]
        if self.kind == "free":
            q += [f"{n}.q{c}" for c in "wxyz"]
            v += [f"{n}.omega_{i}" for i in "123"]
        return q, v

    @property
    def n_q(self) -> int:
        return SIZES[self.kind][0]

    @property
    def n_v(self) -> int:
        return SIZES[self.kind][1]


@dataclass(frozen=True)
class _Frame:
    """Where a body is at a state. `turn`, `way`, `arm` are against the body before: rotation, its point of the joint in the
    axes of that body, and from there to the centre of mass in the own axes."""

    rotation: Any
    position: Any
    turn: Any
    way: Any
    arm: Any
    omega: Any  # in the own axes, for round bodies in those of the world
    velocity: Any  # in the axes of the world


class Trees:
    """Bodies in an order in which each one follows the body it moves against."""

    def __init__(self, held: list[_Held]):
        self.held = held
        self.place = {h.body.name: k for k, h in enumerate(held)}
        self.n_q = sum(h.n_q for h in held)
        self.n_v = sum(h.n_v for h in held)

    @classmethod
    def of(cls, bodies: list[Body], joints: list[Joint], kinds: dict[str, str]) -> Trees:
        """The trees of bodies; `kinds` says how those move that no joint holds."""
        by = {j.body.name: j for j in joints if not j.loop}
        held: list[_Held] = []
        place: dict[str, int] = {}
        sizes = [0, 0]

        def take(body: Body) -> int:
            chain = []
            while body.name not in place:  # a loop over parents: a chain may be longer than the stack is deep
                chain.append(body)
                joint = by.get(body.name)
                if joint is None or joint.parent is None:
                    break
                body = joint.parent
            for b in reversed(chain):
                joint = by.get(b.name)
                kind = kinds[b.name] if joint is None else joint.kind
                parent = -1 if joint is None or joint.parent is None else place[joint.parent.name]
                place[b.name] = len(held)
                held.append(_Held(b, kind, sizes[0], sizes[1], parent, joint))
                sizes[0] += SIZES[kind][0]
                sizes[1] += SIZES[kind][1]
            return 0

        for body in bodies:
            take(body)
        return cls(held)

    # --- motion -------------------------------------------------------------------------------------------

    def frames(self, q: Any, v: Any) -> list[_Frame]:
        """Where all bodies are, and how they move."""
        out: list[_Frame] = []
        for h in self.held:
            if h.joint is None:
                out.append(self._root(h, q, v))
                continue
            before = out[h.parent] if h.parent >= 0 else _WORLD
            turn, way, omega, own = self._step(h, q, v)
            arm = [-c for c in sp.constants(h.joint.to)]
            rotation = sp.product(before.rotation, turn)
            inner = sp.add(sp.back(turn, before.omega), omega)
            velocity = sp.add(sp.cross(before.omega, way), own)
            world = sp.add(before.velocity, sp.apply(before.rotation, velocity), sp.apply(rotation, sp.cross(inner, arm)))
            position = sp.add(before.position, sp.apply(before.rotation, way), sp.apply(rotation, arm))
            out.append(_Frame(rotation, position, turn, way, arm, inner, world))
        return out

    def _root(self, h: _Held, q: Any, v: Any) -> _Frame:
        position, velocity = [q[h.q + i] for i in range(3)], [v[h.v + i] for i in range(3)]
        omega = [v[h.v + i] for i in range(3, 6)] if h.n_v == 6 else sp.ZERO
        rotation = sp.of_quaternion([q[h.q + i] for i in range(3, 7)]) if h.kind == "free" else sp.EYE
        return _Frame(rotation, position, rotation, sp.ZERO, sp.ZERO, omega, velocity)

    def _step(self, h: _Held, q: Any, v: Any) -> tuple[Any, Any, Any, Any]:
        """Rotation and way of a joint, its angular velocity in the axes of the second body, and its velocity in those of the
        first."""
        joint = h.joint
        fixed, at = sp.constants(joint.turn), sp.constants(joint.at)
        axis = sp.constants(joint.axis)
        if h.kind == "hinge":
            turn = sp.product(fixed, sp.about(axis, numpy.cos(q[h.q]), numpy.sin(q[h.q])))
            return turn, at, sp.scale(v[h.v], axis), sp.ZERO
        if h.kind == "slider":
            along = sp.apply(fixed, axis)
            return fixed, sp.add(at, sp.scale(q[h.q], along)), sp.ZERO, sp.scale(v[h.v], along)
        if h.kind == "ball":
            turn = sp.product(fixed, sp.of_quaternion([q[h.q + i] for i in range(4)]))
            return turn, at, [v[h.v + i] for i in range(3)], sp.ZERO
        return fixed, at, sp.ZERO, sp.ZERO

    def rates(self, q: Any, v: Any) -> list[Any]:
        """Rates of the coordinates."""
        out: list[Any] = []
        for h in self.held:
            if h.kind in ("free", "ball"):
                way = h.n_q - 4
                out += [v[h.v + i] for i in range(way)]
                out += sp.quaternion_rates([q[h.q + way + i] for i in range(4)], [v[h.v + way + i] for i in range(3)])
            else:
                out += [v[h.v + i] for i in range(h.n_q)]
        return out

    def states(self, q: Any, v: Any) -> tuple[dict[str, BodyState], dict[str, JointState]]:
        """What is said of bodies and joints outside."""
        frames, bodies, joints = self.frames(q, v), {}, {}
        for h, f in zip(self.held, frames):
            rotation = None if h.kind in ("point", "round") else f.rotation
            omega = None if h.kind == "point" else f.omega if rotation is None else sp.apply(rotation, f.omega)
            bodies[h.body.name] = BodyState(f.position, f.velocity, None, omega, rotation)
            if h.joint is not None and h.n_q:
                here, moves = [q[h.q + i] for i in range(h.n_q)], [v[h.v + i] for i in range(h.n_v)]
                joints[h.joint.name] = JointState(here, moves) if h.n_q > 1 else JointState(here[0], moves[0])
        return bodies, joints

    # --- dynamics -----------------------------------------------------------------------------------------

    def force(self, frames: list[_Frame], v: Any, gravity: Any, pushes: dict[str, tuple[Any, Any]]) -> list[Any]:
        """All that stands beside M v': weight, the forces that come from moving, and pushes: force and torque on a body, in the
        axes of the world."""
        rates, accelerations = [], []
        down = sp.constants(gravity)
        for h, f in zip(self.held, frames):
            if h.joint is None:
                turning, moving = sp.ZERO, sp.back(f.rotation, [-g for g in down])
            else:
                before = frames[h.parent] if h.parent >= 0 else _WORLD
                wd = rates[h.parent] if h.parent >= 0 else sp.ZERO
                a = accelerations[h.parent] if h.parent >= 0 else [-g for g in down]
                turning, moving = self._outwards(h, f, before, v, wd, a)
            rates.append(turning)
            accelerations.append(moving)
        loads = []
        for h, f, turning, moving in zip(self.held, frames, rates, accelerations):
            inertia = _inertia(h.body)
            load = sp.scale(h.body.mass, moving)
            if h.kind == "point":
                moment = sp.ZERO
            elif h.kind == "round":
                moment = sp.ZERO
            else:
                moment = sp.add(sp.apply(inertia, turning), sp.cross(f.omega, sp.apply(inertia, f.omega)))
            if h.body.name in pushes:
                push, torque = pushes[h.body.name]
                load = sp.subtract(load, sp.back(f.rotation, push))
                moment = sp.subtract(moment, sp.back(f.rotation, torque))
            loads.append((load, moment))
        out: list[Any] = [0.0] * self.n_v
        for k in range(len(self.held) - 1, -1, -1):
            h = self.held[k]
            parts, handed = self._inwards(h, frames[k], *loads[k])
            for i, part in enumerate(parts):
                out[h.v + i] = sp.minus(0.0, part)
            if h.parent >= 0:
                loads[h.parent] = tuple(sp.add(a, b) for a, b in zip(loads[h.parent], handed))
        return out

    def _outwards(
        self, h: _Held, f: _Frame, before: _Frame, v: Any, rate: Any, acceleration: Any
    ) -> tuple[Any, Any]:
        """Angular acceleration, and acceleration of the centre of mass, where the joint does not accelerate."""
        w = before.omega
        carried = sp.add(acceleration, sp.cross(rate, f.way), sp.cross(w, sp.cross(w, f.way)))
        turning = sp.back(f.turn, rate)
        if h.kind == "slider":
            along = sp.apply(sp.constants(h.joint.turn), sp.constants(h.joint.axis))
            carried = sp.add(carried, sp.scale(2.0, sp.cross(w, sp.scale(v[h.v], along))))
        elif h.kind in ("hinge", "ball"):
            inner = sp.back(f.turn, w)
            turning = sp.add(turning, sp.cross(inner, sp.subtract(f.omega, inner)))
        moving = sp.add(sp.back(f.turn, carried), sp.cross(turning, f.arm), sp.cross(f.omega, sp.cross(f.omega, f.arm)))
        return turning, moving

    def _inwards(self, h: _Held, f: _Frame, load: Any, moment: Any) -> tuple[list[Any], tuple[Any, Any]]:
        """The parts of a load on a body along the velocities of its joint, and what the body before has to bear."""
        if h.joint is None:
            parts = sp.apply(f.rotation, load)
            return (parts if h.kind == "point" else parts + list(moment)), (sp.ZERO, sp.ZERO)
        about = sp.add(moment, sp.cross(f.arm, load))
        axis = sp.constants(h.joint.axis)
        parts = {"hinge": lambda: [sp.dot(axis, about)], "slider": lambda: [sp.dot(axis, load)], "ball": lambda: about}
        outer = sp.apply(f.turn, load)
        handed = outer, sp.add(sp.apply(f.turn, about), sp.cross(f.way, outer))
        return (parts[h.kind]() if h.n_v else []), handed

    def inertia(self, frames: list[_Frame]) -> Any:
        """The inertia matrix, rows of expressions, without armatures."""
        whole = [(h.body.mass, sp.ZERO, _inertia(h.body)) for h in self.held]
        for k in range(len(self.held) - 1, -1, -1):
            h = self.held[k]
            if h.parent >= 0:
                whole[h.parent] = _joined(whole[h.parent], _moved(whole[k], frames[k]))
        m: list[list[Any]] = [[0.0] * self.n_v for _ in range(self.n_v)]
        for k, h in enumerate(self.held):
            for i in range(h.n_v):
                turning, moving = self._unit(h, frames[k], i)
                mass, first, second = whole[k]
                load = sp.add(sp.scale(mass, moving), sp.cross(turning, first))
                moment = sp.add(sp.apply(second, turning), sp.cross(first, moving))
                at: int = k
                while at >= 0:
                    one = self.held[at]
                    parts, (load, moment) = self._inwards(one, frames[at], load, moment)
                    for j, part in enumerate(parts):
                        if at < k or j <= i:
                            m[h.v + i][one.v + j] = m[one.v + j][h.v + i] = part
                    at = one.parent
        return m

    def _unit(self, h: _Held, f: _Frame, i: int) -> tuple[Any, Any]:
        """Angular acceleration and acceleration of the centre of mass for a unit acceleration of the joint."""
        if h.joint is None:
            unit = [1.0 if j == i % 3 else 0.0 for j in range(3)]
            return (sp.ZERO, sp.back(f.rotation, unit)) if i < 3 else (unit, sp.ZERO)
        if h.kind == "slider":
            return sp.ZERO, sp.constants(h.joint.axis)
        axis = sp.constants(h.joint.axis) if h.kind == "hinge" else [1.0 if j == i else 0.0 for j in range(3)]
        return axis, sp.cross(axis, f.arm)


_WORLD = _Frame(sp.EYE, sp.ZERO, sp.EYE, sp.ZERO, sp.ZERO, sp.ZERO, sp.ZERO)


def _inertia(body: Body) -> Any:
    if numpy.ndim(body.inertia) == 2:
        return sp.constants(body.inertia)
    return [[body.inertia if i == j else 0.0 for j in range(3)] for i in range(3)]


def _moved(whole: tuple[Any, Any, Any], f: _Frame) -> tuple[Any, Any, Any]:
    """Mass, first and second moments about the centre of mass of the body before, in its axes."""
    mass, first, second = whole
    h = sp.apply(f.turn, first)
    r = sp.add(f.way, sp.apply(f.turn, f.arm))
    turned = sp.product(sp.product(f.turn, second), sp.transposed(f.turn))
    lift = sp.add(sp.scale(2.0, h), sp.scale(mass, r))  # 2 h + m r
    round_ = sp.dot(r, lift)
    out = []
    for i in range(3):
        row = []
        for j in range(3):
            cell = sp.plus(turned[i][j], round_ if i == j else 0.0)
            mixed = sp.plus(sp.times(r[i], h[j]), sp.times(h[i], r[j]))
            row.append(sp.minus(sp.minus(cell, mixed), sp.times(mass, sp.times(r[i], r[j]))))
        out.append(row)
    return mass, sp.add(h, sp.scale(mass, r)), out


def _joined(a: tuple[Any, Any, Any], b: tuple[Any, Any, Any]) -> tuple[Any, Any, Any]:
    return a[0] + b[0], sp.add(a[1], b[1]), [sp.add(i, j) for i, j in zip(a[2], b[2])]


def loop(joint: Joint, first: BodyState | None, second: BodyState) -> list[tuple[str, Any]]:
    """Expressions that are zero where two bodies are as a joint holds them."""
    one = BodyState(sp.ZERO, sp.ZERO) if first is None else first
    at = sp.add(list(one.position), one.turned(joint.at))
    to = sp.add(list(second.position), second.turned(joint.to))
    between = sp.subtract(to, at)
    fixed, axis = sp.constants(joint.turn), sp.constants(joint.axis)
    base = sp.EYE if one.rotation is None else one.rotation
    own = sp.EYE if second.rotation is None else second.rotation
    if joint.kind == "ball":
        return list(zip("xyz", between))
    sides = sp.perpendicular(axis)

    def outer(direction: Any) -> Any:
        return sp.apply(base, sp.apply(fixed, direction))

    if joint.kind == "hinge":
        along = sp.apply(own, axis)
        return [*zip("xyz", between), *((f"turn {i}", sp.dot(outer(s), along)) for i, s in enumerate(sides, 1))]
    # of three axes each, one is perpendicular to the next of the other body
    axes = [sp.EYE[1], sp.EYE[2], sp.EYE[0]]
    turns = [(f"turn {c}", sp.dot(outer(e), sp.apply(own, n))) for c, e, n in zip("xyz", sp.EYE, axes)]
    if joint.kind == "fixed":
        return [*zip("xyz", between), *turns]
    return [*((f"side {i}", sp.dot(outer(s), between)) for i, s in enumerate(sides, 1)), *turns]
