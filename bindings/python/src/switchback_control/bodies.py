"""Worlds: rigid bodies of simple shapes with contacts, written down as a scene."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy

from ._arrays import Array, number, real, vector
from ._ffi import ImpactLaw
from .errors import ArgumentError, DimensionError, RangeError, StateError, UnsupportedError
from .expr import Expr
from .scene import Scene

if TYPE_CHECKING:
    from .runs import Run

__all__ = ["Body", "BodyState", "Fixed", "Motion", "States", "World"]


@dataclass(frozen=True, eq=False)
class Body:
    """A body that moves, as `World.disc` and its like return it.

    name, shape    "disc", "box", "rod", "capsule", "point" in the plane, "sphere", "point" in space
    mass, inertia  inertia about the centre of mass
    radius         of discs, spheres and capsules, else 0
    size           width and height of a box, length of a rod or between the ends of a capsule, and 0
    """

    name: str
    shape: str
    mass: float
    inertia: float
    radius: float = 0.0
    size: tuple[float, float] = (0.0, 0.0)
    turns: bool | None = None

    @property
    def _spots(self) -> list[tuple[str, float, float]]:
        """What can touch a plane: names and places on the body of corners, ends and centres, all with its radius."""
        a, b = 0.5 * self.size[0], 0.5 * self.size[1]
        if self.shape == "box":
            return [("lower left", -a, -b), ("lower right", a, -b), ("upper right", a, b), ("upper left", -a, b)]
        if self.shape in ("rod", "capsule"):
            return [("left", -a, 0.0), ("right", a, 0.0)]
        return [("", 0.0, 0.0)]

    @property
    def _round(self) -> bool:
        return self.shape in ("disc", "point", "sphere")

    def __repr__(self) -> str:
        return f"<Body '{self.name}': {self.shape}>"


@dataclass(frozen=True, eq=False)
class Fixed:
    """A plane that bodies do not pass, in the plane a line: they are where normal . position >= offset.

    `offset` is a number or a function of `States` (time, parameters); `speed` is the speed of its surface, a number, in
    the plane along the normal turned by 90 degrees clockwise (to the right on a floor), a belt.
    """

    name: str
    normal: tuple[float, ...]
    offset: Any
    speed: float = 0.0

    @property
    def _tangents(self) -> list[tuple[float, ...]]:
        n = self.normal
        if len(n) == 2:
            return [(n[1], -n[0])]
        # the axis the normal is farthest from, made perpendicular, and the third direction
        k = int(numpy.argmin(numpy.abs(n)))
        a = numpy.eye(3)[k] - n[k] * numpy.array(n)
        a /= numpy.linalg.norm(a)
        return [tuple(a.tolist()), tuple(numpy.cross(n, a).tolist())]

    def __repr__(self) -> str:
        return f"<Fixed '{self.name}'>"


def _component(of: str, i: int) -> Any:
    return property(lambda self: getattr(self, of)[i], doc=f"Component {i} of the {of}.")


@dataclass(frozen=True)
class BodyState:
    """Position and velocity of a body: expressions, or arrays of numbers. `angle` and `omega` are None where the
    rotation is not part of the scene; in space there is no angle, and `omega` are three numbers; in the plane no `z`
    and `vz`."""

    position: Any
    velocity: Any
    angle: Any = None
    omega: Any = None

    x = _component("position", 0)
    y = _component("position", 1)
    z = _component("position", 2)
    vx = _component("velocity", 0)
    vy = _component("velocity", 1)
    vz = _component("velocity", 2)


class States:
    """The expressions of a world, for forces, moving planes, friction and restitution given as functions: `s[body]` is
    a `BodyState`, the body given by itself or its name; `s.t` is the time, `s.u` and `s.p` are controls and
    parameters."""

    def __init__(self, world: World, states: dict[str, BodyState], u: Any, p: Any, t: Any):
        self._world, self._states = world, states
        self.u, self.p, self.t = u, p, t

    def __getitem__(self, body: Any) -> BodyState:
        return self._states[self._world._body(body).name]


@dataclass(frozen=True)
class Motion:
    """The way of a body: arrays over the times `t`. `z` and `vz` are None in the plane, `angle` in space, where `omega`
    has a column for each direction. Bodies whose rotation is not part of the scene turn as they began."""

    t: Array
    x: Array
    y: Array
    vx: Array
    vy: Array
    angle: Array | None = None
    omega: Array | None = None
    z: Array | None = None
    vz: Array | None = None


@dataclass(frozen=True)
class _Placed:
    position: tuple[float, ...]
    velocity: tuple[float, ...]
    angle: float
    omega: Any


@dataclass(frozen=True, eq=False)
class _Pair:
    """Two things that may touch."""

    a: Body
    b: Body | Fixed
    mu: Any
    e: Any


@dataclass(frozen=True, eq=False)
class _Touch:
    """A contact of the scene: a spot of a body with a plane or with a round body."""

    name: str
    a: Body
    spot: int
    b: Body | Fixed
    mu: Any
    e: Any

    def geometry(self, s: States) -> tuple[Any, list[Any], list[Any], list[Any]]:
        """Gap, normal from the other body to the first, sliding velocities, and the point of contact on the first. The
        same lines make expressions and numbers, as the states are."""
        a, radius = s[self.a], self.a.radius
        _, bx, by = self.a._spots[self.spot]
        centre, velocity = list(a.position), list(a.velocity)
        if bx or by:
            c, d = numpy.cos(a.angle), numpy.sin(a.angle)
            ax, ay = c * bx - d * by, d * bx + c * by
            centre = [a.x + ax, a.y + ay]
            velocity = [a.vx - a.omega * ay, a.vy + a.omega * ax]
        if isinstance(self.b, Fixed):
            normal: list[Any] = list(self.b.normal)
            gap = _dot(normal, centre) - radius - _value(self.b.offset, s)
            sliding = [_dot(t, velocity) - self.b.speed for t in self.b._tangents]
        else:
            b = s[self.b]
            between = [i - j for i, j in zip(centre, b.position)]
            distance = numpy.sqrt(_dot(between, between))
            normal = [d / distance for d in between]
            gap = distance - radius - self.b.radius
            relative = [i - j for i, j in zip(velocity, b.velocity)]
            tangent = [normal[1], -normal[0]]
            sliding = [_dot(tangent, relative)] if len(normal) == 2 else []
            if sliding and b.omega is not None:
                sliding[0] = sliding[0] + self.b.radius * b.omega
        if a.omega is not None and radius:
            if len(normal) == 2:
                sliding[0] = sliding[0] + radius * a.omega
            else:
                tangents = self.b._tangents if isinstance(self.b, Fixed) else []
                sliding = [v - radius * _dot(a.omega, numpy.cross(normal, t)) for v, t in zip(sliding, tangents)]
        point = [i - radius * j for i, j in zip(centre, normal)]
        return gap, normal, sliding, point


@dataclass(frozen=True, eq=False)
class _Layout:
    """Where the bodies are in the states of a scene."""

    world: World
    touches: list[_Touch]
    columns: dict[str, tuple[list[int], list[int], int | None, Any]]
    fixed: list[Fixed] = field(default_factory=list)


def _dot(a: Any, b: Any) -> Any:
    out: Any = 0.0
    for i, j in zip(a, b):
        out = out + i * j
    return out


def _value(given: Any, s: States) -> Any:
    return given(s) if callable(given) else given


def _positive(value: Any, name: str) -> float:
    given = number(value, name)
    if not (given > 0.0 and math.isfinite(given)):
        raise RangeError(f"{name} is {given:g}: it must be positive")
    return given


class World:
    """Rigid bodies with contacts: discs, boxes, rods, capsules and points in the plane, spheres and points in space,
    and planes that they do not pass. It writes the expressions of a `Scene`, which is there as `scene`.

        w = swb.World(e=0.8)
        ball, floor = w.disc(0.1, mass=1.0, name="ball"), w.floor()
        w.place(ball, y=1.0)
        run = w.simulate(5.0)
        w.trajectory(run, ball).y

    `gravity` points down the last axis, or is a vector. `mu` and `e` are friction and restitution of all contacts that
    have none of their own: numbers, or functions of `States` that return an expression. `controls` and `parameters` are
    numbers or names, as in a scene; `impact_law` is "newton" or "sequential" (see `Scene.impact_law`).

    Angles and angular velocities are counter-clockwise. A disc without friction does not need its angle: it is left
    out.
    """

    def __init__(
        self,
        gravity: Any = 9.81,
        *,
        space: bool = False,
        mu: Any = 0.0,
        e: Any = 0.0,
        controls: int | str | Sequence[str] = 0,
        parameters: int | str | Sequence[str] = 0,
        impact_law: str | ImpactLaw = "newton",
        name: str = "world",
    ):
        self.name, self.space = name, bool(space)
        self._n = 3 if space else 2
        if numpy.ndim(gravity) == 0:
            self.gravity = (0.0,) * (self._n - 1) + (-number(gravity, "gravity"),)
        else:
            self.gravity = tuple(vector(gravity, self._n, "gravity").tolist())
        self.mu, self.e, self.impact_law = mu, e, impact_law
        self._controls, self._parameters = controls, parameters
        self.bodies: list[Body] = []
        self.fixed: list[Fixed] = []
        self._pairs: list[_Pair] | None = None
        self._forces: dict[str, list[Callable[[States], Any]]] = {}
        self._placed: dict[str, _Placed] = {}
        self._scene: Scene | None = None

    # --- what there is ------------------------------------------------------------------------------------

    def _name(self, name: str | None, shape: str) -> str:
        taken = {b.name for b in self.bodies} | {f.name for f in self.fixed}
        if name is None:
            same = (f"{shape} {k}" if k > 1 else shape for k in range(1, len(taken) + 2))
            return next(n for n in same if n not in taken)
        if not isinstance(name, str) or not name or "\n" in name:
            raise ArgumentError(f"the name of a body must be a text in one line, not {name!r:.40}")
        if name in taken:
            raise ArgumentError(f"there is a body '{name}' already")
        return name

    def _add(self, shape: str, name: str | None, mass: Any, inertia: Any, own: float, **sizes: Any) -> Body:
        if self.space != (shape == "sphere") and shape != "point":
            there = "spheres, points and planes" if self.space else "discs, boxes, rods, capsules, points and planes"
            raise UnsupportedError(f"this world is {'in space' if self.space else 'in the plane'}: it has {there}")
        name = self._name(name, shape)
        m = _positive(mass, f"the mass of {name}")
        j = m * own if inertia is None else _positive(inertia, f"the inertia of {name}")
        body = Body(name, shape, m, j, **sizes)
        self.bodies.append(body)
        self._scene = None
        return body

    def disc(
        self,
        radius: float,
        mass: float,
        inertia: float | None = None,
        name: str | None = None,
        turns: bool | None = None,
    ) -> Body:
        """Add a disc; without `inertia` it is homogeneous. Its rotation is part of the scene where a contact of it has
        friction, or as `turns` says."""
        r = _positive(radius, "the radius of a disc")
        return self._add("disc", name, mass, inertia, 0.5 * r * r, radius=r, turns=turns)

    def box(
        self, width: float, height: float, mass: float, inertia: float | None = None, name: str | None = None
    ) -> Body:
        """Add a box, whose four corners touch planes; without `inertia` it is homogeneous."""
        w, h = _positive(width, "the width of a box"), _positive(height, "the height of a box")
        return self._add("box", name, mass, inertia, (w * w + h * h) / 12.0, size=(w, h), turns=True)

    def rod(self, length: float, mass: float, inertia: float | None = None, name: str | None = None) -> Body:
        """Add a thin rod, whose ends touch planes; it is horizontal at angle 0. Without `inertia` it is homogeneous."""
        n = _positive(length, "the length of a rod")
        return self._add("rod", name, mass, inertia, n * n / 12.0, size=(n, 0.0), turns=True)

    def capsule(
        self, length: float, radius: float, mass: float, inertia: float | None = None, name: str | None = None
    ) -> Body:
        """Add a rod with round ends, `length` between their centres, which touch planes; horizontal at angle 0. Without
        `inertia` it is homogeneous."""
        n, r = _positive(length, "the length of a capsule"), _positive(radius, "the radius of a capsule")
        middle, ends = 2.0 * r * n, math.pi * r * r
        j_middle = (n * n + 4.0 * r * r) / 12.0
        j_ends = 0.5 * r * r + 0.25 * n * n + n * 4.0 * r / (3.0 * math.pi)
        own = (middle * j_middle + ends * j_ends) / (middle + ends)
        return self._add("capsule", name, mass, inertia, own, radius=r, size=(n, 0.0), turns=True)

    def point(self, mass: float, name: str | None = None) -> Body:
        """Add a point, which does not turn."""
        return self._add("point", name, mass, None, 1.0, turns=False)

    def sphere(
        self,
        radius: float,
        mass: float,
        inertia: float | None = None,
        name: str | None = None,
        turns: bool | None = None,
    ) -> Body:
        """Add a sphere, in space; without `inertia` it is homogeneous. With friction its angular velocity is part of
        the scene (three more velocities and no coordinates: a sphere looks the same from everywhere)."""
        r = _positive(radius, "the radius of a sphere")
        return self._add("sphere", name, mass, inertia, 0.4 * r * r, radius=r, turns=turns)

    def plane(self, normal: Any, offset: Any = 0.0, name: str | None = None, speed: float = 0.0) -> Fixed:
        """Add a plane, in the plane a line: bodies stay where normal . position >= offset. The normal is made a unit
        vector. `offset` may be a function of `States`, of time and parameters; `speed` is that of a belt (`Fixed`)."""
        n = vector(normal, self._n, "normal")
        length = float(numpy.linalg.norm(n))
        if not (length > 0.0 and math.isfinite(length)):
            raise RangeError(f"the normal of a plane is {normal}: it needs a direction")
        moved = number(speed, "speed")
        if moved and self.space:
            raise UnsupportedError("the surface of a plane in space does not move along itself")
        at = offset if callable(offset) else number(offset, "offset")
        made = Fixed(self._name(name, "plane"), tuple((n / length).tolist()), at, moved)
        self.fixed.append(made)
        self._scene = None
        return made

    def _up(self) -> tuple[float, ...]:
        return (0.0,) * (self._n - 1) + (1.0,)

    def floor(self, height: Any = 0.0, name: str | None = None, speed: float = 0.0) -> Fixed:
        """Add a floor; bodies stay above it. `height` may be a function of `States`: a shaken table."""
        return self.plane(self._up(), height, self._name(name, "floor"), speed)

    def ceiling(self, height: float, name: str | None = None) -> Fixed:
        """Add a ceiling; bodies stay below it."""
        down = tuple(-c for c in self._up())
        return self.plane(down, -number(height, "height"), self._name(name, "ceiling"))

    def wall(self, x: float, free: str = "right", name: str | None = None) -> Fixed:
        """Add a vertical wall; bodies stay on the side `free`, "right" or "left"."""
        if free not in ("left", "right"):
            raise ArgumentError(f"free must be 'left' or 'right', the side where the bodies are, not {free!r:.40}")
        side = 1.0 if free == "right" else -1.0
        return self.plane((side,) + (0.0,) * (self._n - 1), side * number(x, "x"), self._name(name, "wall"))

    def _body(self, body: Any) -> Body:
        found = [b for b in self.bodies if b is body or (isinstance(body, str) and b.name == body)]
        if not found:
            known = ", ".join(b.name for b in self.bodies) or "none"
            raise ArgumentError(f"{body!r} is no body of this world, which has {known}")
        return found[0]

    def _thing(self, thing: Any) -> Body | Fixed:
        for f in self.fixed:
            if f is thing or (isinstance(thing, str) and f.name == thing):
                return f
        return self._body(thing)

    # --- contacts and forces ------------------------------------------------------------------------------

    def contacts(self, *pairs: tuple[Any, Any], mu: Any = None, e: Any = None) -> None:
        """Say which pairs may touch: tuples of two bodies, or of a body and a plane, by themselves or by name; without
        any, all pairs that are not named yet. `mu` and `e` are their friction and restitution. A world of which this is
        never said has contacts of all pairs.

        A box, rod or capsule touches planes only: the distance of its side from another body is not smooth where the
        nearest point passes a corner. Without friction, or with it in the plane, round bodies touch each other.
        """
        mu, e = (self.mu if mu is None else mu), (self.e if e is None else e)
        old = list(self._pairs or [])
        new = []
        if not pairs:
            known = {frozenset((p.a.name, p.b.name)) for p in old}
            pairs = tuple(p for p in self._all_pairs() if frozenset((p[0].name, p[1].name)) not in known)
        for pair in pairs:
            if not isinstance(pair, (tuple, list)) or len(pair) != 2:
                raise ArgumentError(f"a pair is a tuple of two bodies, or of a body and a plane, not {pair!r:.60}")
            a, b = (self._thing(thing) for thing in pair)
            if isinstance(a, Fixed):
                a, b = b, a
            if isinstance(a, Fixed) or a is b:
                raise ArgumentError(f"{pair[0]!r} and {pair[1]!r} do not move against each other")
            if any({p.a, p.b} == {a, b} for p in old + new):
                raise ArgumentError(f"{a.name} and {b.name} are a pair already")
            self._check_shapes(a, b, mu)
            new.append(_Pair(a, b, mu, e))
        self._pairs = old + new
        self._scene = None

    def _all_pairs(self) -> list[tuple[Body, Body | Fixed]]:
        planes = [(a, f) for a in self.bodies for f in self.fixed]
        return planes + [(a, b) for i, a in enumerate(self.bodies) for b in self.bodies[i + 1 :]]

    def _check_shapes(self, a: Body, b: Body | Fixed, mu: Any) -> None:
        if isinstance(b, Fixed):
            return
        if not (a._round and b._round):
            raise UnsupportedError(
                f"{a.name} ({a.shape}) and {b.name} ({b.shape}): the distance of sides and corners is not smooth; "
                "boxes, rods and capsules touch planes only. Name the pairs that may touch, without this one"
            )
        if not a.radius and not b.radius:
            raise UnsupportedError(
                f"{a.name} and {b.name} are points: they do not touch. Name the pairs that may touch, without this one"
            )
        if self.space and _rough(mu):
            raise UnsupportedError(
                f"{a.name} and {b.name}: friction of two spheres needs two tangents that turn with the normal, and "
                "there are no smooth ones for every direction; give this pair mu=0"
            )

    def force(self, body: Any, f: Callable[[States], Any]) -> None:
        """Add a force on a body, beside its weight: `f` is a function of `States` that returns its components,
        expressions or numbers; in the plane a third one is a torque.

            w.force(block, lambda s: [-k * s["block"].x + s.u[0], 0.0])
        """
        if not callable(f):
            raise ArgumentError(f"a force is a function of the states, not {type(f).__name__}: lambda s: [fx, fy]")
        self._forces.setdefault(self._body(body).name, []).append(f)
        self._scene = None

    # --- the scene ----------------------------------------------------------------------------------------

    @property
    def scene(self) -> Scene:
        """The scene as it stands. What is added to the world later makes a new one."""
        if self._scene is None:
            self._scene = self._write()
        return self._scene

    def _stated(self) -> list[_Pair]:
        if self._pairs is not None:
            return self._pairs
        for a, b in self._all_pairs():
            self._check_shapes(a, b, self.mu)
        return [_Pair(a, b, self.mu, self.e) for a, b in self._all_pairs()]

    def _turns(self, body: Body, pairs: list[_Pair]) -> bool:
        if body.turns is not None:
            return body.turns
        return any(_rough(p.mu) for p in pairs if body is p.a or body is p.b)

    def _write(self) -> Scene:
        if not self.bodies:
            raise StateError("there are no bodies in this world")
        pairs = self._stated()
        axes = ("x", "y", "z")[: self._n]
        q, v, columns = [], [], {}
        for body in self.bodies:
            turns = self._turns(body, pairs)
            at = list(range(len(q), len(q) + self._n))
            move = list(range(len(v), len(v) + self._n))
            q += [f"{body.name}.{c}" for c in axes]
            v += [f"{body.name}.v{c}" for c in axes]
            angle = omega = None
            if turns and self.space:
                omega = list(range(len(v), len(v) + 3))
                v += [f"{body.name}.omega_{c}" for c in axes]
            elif turns:
                angle, omega = len(q), len(v)
                q.append(f"{body.name}.angle")
                v.append(f"{body.name}.omega")
            columns[body.name] = (at, move, angle, omega)
        scene = Scene(q, v, self._controls, self._parameters, name=self.name)
        shift = {n: (at, [len(q) + i for i in move], a, _shifted(o, len(q))) for n, (at, move, a, o) in columns.items()}
        states = States(
            self, {n: _state(scene.x, where) for n, where in shift.items()}, scene.u, scene.p, scene.t
        )
        inertia, force = numpy.zeros(len(v)), [scene.graph.constant(0.0)] * len(v)
        rates: list[Any] = [None] * len(q)
        for body in self.bodies:
            at, move, angle, omega = columns[body.name]
            inertia[move] = body.mass
            for i, j, g in zip(at, move, self.gravity):
                force[j] = scene.graph.constant(body.mass * g)
                rates[i] = scene.v[j]
            places = move + ([] if omega is None else list(numpy.atleast_1d(omega)))
            inertia[places[self._n :]] = body.inertia
            if angle is not None:
                rates[angle] = scene.v[omega]
            for f in self._forces.get(body.name, []):
                self._add_force(force, places, body, f(states))
        if len(q) != len(v):
            scene.rates(rates)
        scene.inertia(inertia)
        scene.force(force)
        touches = []
        for p in pairs:
            for k, (spot, _, _) in enumerate(p.a._spots):
                name = f"{p.a.name} {spot}-{p.b.name}" if spot else f"{p.a.name}-{p.b.name}"
                touch = _Touch(name, p.a, k, p.b, p.mu, p.e)
                gap, _, sliding, _ = touch.geometry(states)
                tangents = sliding if _rough(p.mu) else []
                scene.contact(name, gap, tangents, mu=_value(p.mu, states), e=_value(p.e, states))
                touches.append(touch)
        scene.impact_law(self.impact_law)
        scene._layout = _Layout(self, touches, shift, list(self.fixed))
        return scene

    def _add_force(self, force: list[Any], places: list[int], body: Body, given: Any) -> None:
        try:
            parts = list(given)
        except TypeError:
            raise ArgumentError(f"the force on {body.name} must be a list of components, not {given!r:.60}") from None
        if len(parts) > len(places) and len(parts) == self._n + (3 if self.space else 1):
            raise ArgumentError(f"there is a torque on {body.name}, which does not turn: make it with turns=True")
        if len(parts) not in (self._n, len(places)):
            raise DimensionError(f"the force on {body.name} has {len(parts)} components, expected {self._n}")
        for i, part in zip(places, parts):
            force[i] = force[i] + part

    # --- runs ---------------------------------------------------------------------------------------------

    def place(
        self,
        body: Any,
        x: float = 0.0,
        y: float = 0.0,
        angle: float = 0.0,
        vx: float = 0.0,
        vy: float = 0.0,
        omega: Any = 0.0,
        *,
        z: float = 0.0,
        vz: float = 0.0,
    ) -> None:
        """Place the centre of a body where a simulation begins, with its velocity; in space `omega` are three
        numbers."""
        b = self._body(body)
        named = {"x": x, "y": y, "z": z, "vx": vx, "vy": vy, "vz": vz, "angle": angle}
        n = {name: number(value, f"{name} of {b.name}") for name, value in named.items()}
        if not self.space and (n["z"] or n["vz"]):
            raise UnsupportedError("this world is in the plane: there is no z")
        if self.space and n["angle"]:
            raise UnsupportedError("spheres have no angle in space")
        if self.space:
            none = numpy.ndim(omega) == 0 and not omega
            turn: Any = numpy.zeros(3) if none else vector(omega, 3, f"omega of {b.name}")
        else:
            turn = number(omega, f"omega of {b.name}")
        position, velocity = (n["x"], n["y"], n["z"])[: self._n], (n["vx"], n["vy"], n["vz"])[: self._n]
        self._placed[b.name] = _Placed(position, velocity, n["angle"], turn)

    def start(self) -> tuple[Array, Array]:
        """Coordinates and velocities of the scene as the bodies are placed."""
        scene = self.scene
        x = numpy.zeros(scene.nx)
        for body in self.bodies:
            if body.name not in self._placed:
                raise StateError(f"{body.name} is not placed: say where it begins (place)")
            at, move, angle, omega = scene._layout.columns[body.name]
            placed = self._placed[body.name]
            x[at], x[move] = placed.position, placed.velocity
            if angle is not None:
                x[angle] = placed.angle
            if omega is not None:
                x[omega] = placed.omega
        return x[: scene.n_q], x[scene.n_q :]

    def simulate(self, t_span: Any, **keywords: Any) -> Run:
        """Simulate from where the bodies are placed; see `switchback_control.simulate` for the rest."""
        run = self.scene.simulate(*self.start(), t_span, **keywords)
        run._placed = dict(self._placed)
        return run

    def _states(self, run: Run, t: Array, after: bool = False) -> States:
        """The states of all bodies at times of a run, as numbers; with `after` behind the impacts at these times."""
        layout = _layout(run)
        if layout is None or layout.world is not self:
            raise ArgumentError("this is no run of this world")
        times = numpy.clip(numpy.nextafter(t, numpy.inf), run.t_start, run.t_end) if after else t
        x = numpy.moveaxis(run(times), -1, 0)
        p = None if run._p is None else run._p
        return States(self, {n: _state(x, where) for n, where in layout.columns.items()}, None, p, times)

    def trajectory(self, run: Run, body: Any, t: Any = None) -> Motion:
        """The way of a body in a run of this world, at times (by default those of the run's steps)."""
        b = self._body(body)
        times = run.t if t is None else real(t, "t")
        s = self._states(run, times)[b]
        placed = getattr(run, "_placed", self._placed).get(b.name)
        angle, omega = s.angle, s.omega
        if self.space:
            omega = numpy.moveaxis(numpy.asarray(omega), 0, -1) if omega is not None else None
        if omega is None and placed is not None:
            omega = numpy.broadcast_to(placed.omega, (*times.shape, 3) if self.space else times.shape).copy()
            angle = None if self.space else placed.angle + placed.omega * (times - run.t_start)
        z, vz = (s.z, s.vz) if self.space else (None, None)
        return Motion(times, s.x, s.y, s.vx, s.vy, angle, omega, z, vz)

    def animate(self, run: Run, path: Any, **keywords: Any) -> None:
        """See `switchback_control.animate`."""
        from .animation import animate

        animate(run, path, **keywords)

    def __repr__(self) -> str:
        return f"<World '{self.name}': {len(self.bodies)} bodies, {len(self.fixed)} planes>"


def _rough(mu: Any) -> bool:
    """Is there friction?"""
    return callable(mu) or isinstance(mu, Expr) or number(mu, "mu") != 0.0


def _shifted(omega: Any, by: int) -> Any:
    if omega is None:
        return None
    return [i + by for i in omega] if isinstance(omega, list) else omega + by


def _state(x: Any, where: tuple[list[int], list[int], int | None, Any]) -> BodyState:
    at, move, angle, omega = where
    turn = None if omega is None else ([x[i] for i in omega] if isinstance(omega, list) else x[omega])
    return BodyState([x[i] for i in at], [x[i] for i in move], None if angle is None else x[angle], turn)


def _layout(run: Run) -> _Layout | None:
    return getattr(getattr(run.system, "_scene", None), "_layout", None)
