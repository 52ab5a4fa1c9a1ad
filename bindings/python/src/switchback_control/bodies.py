"""Worlds: rigid bodies of simple shapes with contacts, written down as a scene."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy

from . import _spatial as sp
from ._arrays import Array, number, real, vector
from ._ffi import ImpactLaw
from ._pairs import all_pairs, check_shapes
from ._world_scene import layout_of, write
from .errors import ArgumentError, DimensionError, RangeError, StateError, UnsupportedError
from .multibody import SIZES, Joint
from .scene import Scene
from .shapes import Body, Fixed, Motion, Shape, States, _Pair, _Power, inertia_of, place_of, positive, rotation, unit

if TYPE_CHECKING:
    from .runs import Run

__all__ = ["World"]


@dataclass(frozen=True)
class _Placed:
    position: tuple[float, ...]
    velocity: tuple[float, ...]
    angle: float
    omega: Any
    turn: Any = None


class World:
    """Rigid bodies with contacts: discs, ellipses, superellipses, boxes, rods, capsules and points in the plane; spheres, boxes, capsules, cylinders,
    ellipsoids, points and links of several shapes in space, with joints; and planes that they do not pass. It writes the expressions of a
    `Scene`, which is there as `scene`.

        w = swb.World(e=0.8)
        ball, floor = w.disc(0.1, mass=1.0, name="ball"), w.floor()
        w.place(ball, y=1.0)
        run = w.simulate(5.0)
        w.trajectory(run, ball).y

    `gravity` points down the last axis, or is a vector. `mu` and `e` are friction and restitution of all contacts that
    have none of their own: numbers, or functions of `States` that return an expression. `controls` and `parameters` are
    numbers or names, as in a scene; `impact_law` is "newton" or "sequential" (see `Scene.impact_law`).

    Angles and angular velocities are counter-clockwise. A disc or sphere without friction does not need its rotation: it is
    left out. Other bodies in space have a quaternion. Only its direction counts, so its length needs no care. Their velocities
    in the scene are that of the centre of mass, along the axes of the world, and the angular velocity along those of the body.
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
        self.joints: list[Joint] = []
        self._constraints: list[tuple[str, Callable[[States], Any]]] = []
        self._pairs: list[_Pair] | None = None
        self._forces: dict[str, list[Callable[[States], Any]]] = {}
        self._families: list[set[str]] = []  # names of bodies of one file, which touch each other only where it is said
        self._placed: dict[str, _Placed] = {}
        self._placed_joints: dict[str, tuple[list[float], list[float]]] = {}
        self._scene: Scene | None = None

    @classmethod
    def from_urdf(cls, source: Any, floating: bool = False, ignore: Sequence[str] = (), **keywords: Any) -> World:
        """A world in space with a robot that an URDF describes: a path, or the text.

        floating   the first link moves freely and is placed by its centre of mass; else its frame is that of the world
        ignore     what to leave out of what is not taken, by name: "mesh", "mimic", "transmission", ...
        keywords   those of `World`: friction, restitution, gravity, controls

        Links are bodies about their centres of mass, in the axes of the links. Spheres, boxes, capsules and cylinders as collision
        shapes touch planes of the world; contacts of links with each other are named (`contacts`). Limits are stops without
        restitution, damping and friction are those of the file, a joint that mimics is a constraint. A joint with the name of a
        link is called "NAME joint". Bounds of effort and speed bound what drives a joint, and nothing does here. Errors:
        `UnsupportedError` for anything else, by name, `RangeError` for numbers and trees that are none.
        """
        from .robots import read_urdf

        return read_urdf(cls(space=True, **keywords), source, bool(floating), ignore)

    @classmethod
    def from_mjcf(cls, source: Any, ignore: Sequence[str] = (), **keywords: Any) -> World:
        """A world in space with the bodies of a model of MuJoCo: a path, or the text. MuJoCo reads it (`pip install mujoco`).

        `ignore` and `keywords` as in `from_urdf`; gravity is that of the model unless it is given. Bodies with a free joint are
        placed as the model has them. Planes, spheres, boxes, capsules, cylinders and ellipsoids are taken, hinges, slides and balls, also
        several of one body, with limits, damping, armature, springs and friction loss. Friction and restitution of contacts
        are `mu` and `e` of the world: those of the model belong to its soft contacts.
        """
        from .robots import read_mjcf

        return read_mjcf(cls(space=True, **keywords), source, ignore, "gravity" not in keywords)

    # --- what there is ------------------------------------------------------------------------------------

    def _name(self, name: str | None, shape: str) -> str:
        taken = {b.name for b in self.bodies} | {f.name for f in self.fixed} | {j.name for j in self.joints}
        if name is None:
            same = (f"{shape} {k}" if k > 1 else shape for k in range(1, len(taken) + 2))
            return next(n for n in same if n not in taken)
        if not isinstance(name, str) or not name or "\n" in name:
            raise ArgumentError(f"the name of a body must be a text in one line, not {name!r:.40}")
        if name in taken:
            raise ArgumentError(f"there is a body '{name}' already")
        return name

    def _add(self, shape: str, name: str | None, mass: Any, inertia: Any, own: float, **sizes: Any) -> Body:
        if self.space:
            there = "spheres, boxes, capsules, cylinders, ellipsoids, points, links and planes"
            raise UnsupportedError(f"this world is in space: it has {there}, not {shape}s")
        name = self._name(name, shape)
        m = positive(mass, f"the mass of {name}")
        j = m * own if inertia is None else positive(inertia, f"the inertia of {name}")
        return self._took(Body(name, shape, m, j, **sizes))

    def _add_in_space(
        self, shape: str, name: str | None, mass: Any, inertia: Any, own: Any, shapes: Sequence[Shape], **sizes: Any
    ) -> Body:
        """Add a body; `own` are the moments of inertia of a homogeneous one of mass one about its axes."""
        if not self.space:
            there = "discs, ellipses, superellipses, boxes, rods, capsules, points and planes"
            raise UnsupportedError(f"this world is in the plane: it has {there}, not {shape}s")
        name = self._name(name, shape)
        m = positive(mass, f"the mass of {name}")
        if inertia is None and any(any(s.at) for s in shapes):
            raise ArgumentError(f"{name} has its centre of mass beside the middle: give its inertia")
        j = inertia_of(m * numpy.asarray(own) if inertia is None else inertia, f"the inertia of {name}")
        return self._took(Body(name, shape, m, j, shapes=tuple(shapes), **sizes))

    def _took(self, body: Body) -> Body:
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
        r = positive(radius, "the radius of a disc")
        return self._add("disc", name, mass, inertia, 0.5 * r * r, radius=r, turns=turns)

    def box(
        self,
        width: float,
        height: float,
        mass: float,
        inertia: Any = None,
        name: str | None = None,
        *,
        depth: float | None = None,
        centre: Any = (0.0, 0.0, 0.0),
        rounding: float = 0.0,
    ) -> Body:
        """Add a box; without `inertia` it is homogeneous. In space its width is along x, its `depth` along y and its height along
        z; `inertia` is then a matrix, or moments about three axes, and `centre` its middle, from the centre of mass.

        `rounding` is the radius of its corners and edges, within its width and height. Boxes touch planes, and bodies that have
        a radius or a rounding, as far as `contacts` says: with sharp corners on both sides there is no direction of the distance.
        """
        r = number(rounding, "the rounding of a box")
        w, h = positive(width, "the width of a box"), positive(height, "the height of a box")
        if not self.space:
            if depth is not None:
                raise UnsupportedError("a box in the plane has no depth")
            if not 0.0 <= 2.0 * r < min(w, h):
                raise RangeError(f"the rounding of a box is {r:g}: it must be less than half of its least width")
            return self._add("box", name, mass, inertia, (w * w + h * h) / 12.0, size=(w, h), radius=r, turns=True)
        if depth is None:
            raise ArgumentError("a box in space needs a depth: box(width, height, mass, depth=...)")
        d = positive(depth, "the depth of a box")
        own = (d * d + h * h) / 12.0, (w * w + h * h) / 12.0, (w * w + d * d) / 12.0
        shape = Shape("box", (w, d, h), r, at=place_of(centre, "centre"))
        return self._add_in_space("box", name, mass, inertia, own, [shape], radius=r, size=(w, d, h), turns=True)

    def ellipse(self, a: float, b: float, mass: float, inertia: float | None = None, name: str | None = None) -> Body:
        """Add an ellipse with semi-axes along x and y where it is not turned, in the plane; without `inertia` it is homogeneous."""
        semi = positive(a, "the semi-axis a of an ellipse"), positive(b, "the semi-axis b of an ellipse")
        own = 0.25 * (semi[0] ** 2 + semi[1] ** 2)
        return self._add("ellipse", name, mass, inertia, own, size=semi, turns=True)

    def superellipse(
        self,
        a: float,
        b: float,
        exponent: float,
        mass: float,
        inertia: float | None = None,
        name: str | None = None,
        flat: float = 0.02,
    ) -> Body:
        """Add a superellipse |x/a|^exponent + |y/b|^exponent <= 1, in the plane, with an exponent of 2 or more: an ellipse that is
        nearly a box. Without `inertia` it is homogeneous.

        The middles of its sides have no curvature, and two such sides no point of contact. So they are bent a little: `flat` is the
        share of the length of a direction that counts across, between 0 and 1, and the semi-axes stay as they are. It is a support
        function (`signed_distance`) that is stated, and nothing else is approximated.
        """
        semi = positive(a, "the semi-axis a of a superellipse"), positive(b, "the semi-axis b of a superellipse")
        p, share = number(exponent, "the exponent of a superellipse"), number(flat, "flat of a superellipse")
        if not 2.0 <= p < math.inf:
            raise RangeError(f"the exponent of a superellipse is {p:g}: it must be 2 or more")
        if not 0.0 < share < 1.0:
            raise RangeError(f"flat of a superellipse is {share:g}: it must be between 0 and 1")
        x, y = _Power.of(semi, p, share).outline(20000).T
        cross = x * numpy.roll(y, -1) - y * numpy.roll(x, -1)
        squares = sum(c * c + c * numpy.roll(c, -1) + numpy.roll(c, -1) ** 2 for c in (x, y))
        own = float(numpy.sum(cross * squares) / (6.0 * numpy.sum(cross)))
        return self._add("superellipse", name, mass, inertia, own, size=semi, turns=True, power=(p, share))

    def rod(self, length: float, mass: float, inertia: float | None = None, name: str | None = None) -> Body:
        """Add a thin rod, whose ends touch planes; it is horizontal at angle 0. Without `inertia` it is homogeneous."""
        n = positive(length, "the length of a rod")
        return self._add("rod", name, mass, inertia, n * n / 12.0, size=(n, 0.0), turns=True)

    def capsule(
        self,
        length: float,
        radius: float,
        mass: float,
        inertia: Any = None,
        name: str | None = None,
        *,
        centre: Any = (0.0, 0.0, 0.0),
    ) -> Body:
        """Add a rod with round ends, `length` between their centres, along x where it is not turned.
        Without `inertia` it is homogeneous. `centre`, in space: see `box`."""
        n, r = positive(length, "the length of a capsule"), positive(radius, "the radius of a capsule")
        if self.space:
            # a cylinder and two half balls, whose centres of mass are 3/8 r outside of its ends
            middle, ends = n / (n + 4.0 / 3.0 * r), 4.0 / 3.0 * r / (n + 4.0 / 3.0 * r)
            along = middle * 0.5 * r * r + ends * 0.4 * r * r
            across = middle * (0.25 * r * r + n * n / 12.0) + ends * (0.4 * r * r + 0.25 * n * n + 0.375 * n * r)
            shape = Shape("capsule", (n,), r, place_of(centre, "centre"))
            own3 = along, across, across
            return self._add_in_space("capsule", name, mass, inertia, own3, [shape], radius=r, size=(n,), turns=True)
        middle, ends = 2.0 * r * n, math.pi * r * r
        j_middle = (n * n + 4.0 * r * r) / 12.0
        j_ends = 0.5 * r * r + 0.25 * n * n + n * 4.0 * r / (3.0 * math.pi)
        own = (middle * j_middle + ends * j_ends) / (middle + ends)
        return self._add("capsule", name, mass, inertia, own, radius=r, size=(n, 0.0), turns=True)

    def cylinder(
        self,
        length: float,
        radius: float,
        mass: float,
        inertia: Any = None,
        name: str | None = None,
        *,
        centre: Any = (0.0, 0.0, 0.0),
        rounding: float = 0.0,
    ) -> Body:
        """Add a cylinder in space, along x where it is not turned. Without `inertia` it is homogeneous. `centre`: see `box`.

        `rounding` is the radius of its rims, within its length and radius: less than half of the length, and than the radius.
        With sharp rims it touches planes, and bodies that have a radius or a rounding.
        """
        n, r = positive(length, "the length of a cylinder"), positive(radius, "the radius of a cylinder")
        edge = number(rounding, "the rounding of a cylinder")
        shape = Shape("cylinder", (n, r), edge, place_of(centre, "centre"))
        across = 0.25 * r * r + n * n / 12.0
        own = 0.5 * r * r, across, across
        return self._add_in_space("cylinder", name, mass, inertia, own, [shape], radius=edge, size=(n, r), turns=True)

    def point(self, mass: float, name: str | None = None) -> Body:
        """Add a point, which does not turn by itself."""
        if self.space:
            return self._add_in_space("point", name, mass, 0.0, 0.0, [Shape("point")], turns=False)
        return self._add("point", name, mass, None, 1.0, turns=False)

    def sphere(
        self,
        radius: float,
        mass: float,
        inertia: Any = None,
        name: str | None = None,
        turns: bool | None = None,
        *,
        centre: Any = (0.0, 0.0, 0.0),
    ) -> Body:
        """Add a sphere, in space; without `inertia` it is homogeneous. With friction its angular velocity is part of
        the scene (three more velocities and no coordinates: a sphere looks the same from everywhere). Where its inertia is a
        matrix or three moments, or its `centre` beside the centre of mass, it has an orientation too."""
        r = positive(radius, "the radius of a sphere")
        shape = Shape("sphere", (), r, place_of(centre, "centre"))
        body = self._add_in_space("sphere", name, mass, inertia, 0.4 * r * r, [shape], radius=r, turns=turns)
        if numpy.ndim(body.inertia) or any(shape.at):
            if turns is False:
                self.bodies.pop()
                raise ArgumentError(f"{body.name} has axes of its own: it turns")
            self.bodies[-1] = body = replace(body, turns=True)
        return body

    def ellipsoid(
        self,
        a: float,
        b: float,
        c: float,
        mass: float,
        inertia: Any = None,
        name: str | None = None,
        *,
        centre: Any = (0.0, 0.0, 0.0),
    ) -> Body:
        """Add an ellipsoid with semi-axes along x, y and z, in space. Without `inertia` it is homogeneous.
        `centre`: see `box`."""
        semi = tuple(positive(s, f"the semi-axis {n} of an ellipsoid") for n, s in zip("abc", (a, b, c)))
        x, y, z = (s * s / 5.0 for s in semi)
        shape = Shape("ellipsoid", semi, at=place_of(centre, "centre"))
        return self._add_in_space("ellipsoid", name, mass, inertia, (y + z, x + z, x + y), [shape], size=semi, turns=True)

    def link(self, mass: float, inertia: Any, shapes: Sequence[Shape] = (), name: str | None = None) -> Body:
        """Add a body of any shapes, or of none, in space: `shapes` are `Shape`s, `inertia` a matrix, or moments about three axes,
        in the axes of the body about its centre of mass."""
        listed = [shapes] if isinstance(shapes, Shape) else list(shapes)
        for shape in listed:
            if not isinstance(shape, Shape):
                raise ArgumentError(f"the shapes of a link are a list of Shape, not {shape!r:.40}")
        if inertia is None:
            raise ArgumentError("a link needs an inertia: a matrix, or moments about three axes")
        j = inertia_of(inertia, "the inertia of a link")
        whole = j if numpy.ndim(j) else j * numpy.eye(3)
        return self._add_in_space("link", name, mass, whole, 0.0, listed, turns=True)

    def plane(
        self, normal: Any, offset: Any = 0.0, name: str | None = None, speed: float = 0.0, on: Any = None
    ) -> Fixed:
        """Add a plane, in the plane a line: bodies stay where normal . position >= offset. The normal is made a unit
        vector. `offset` may be a function of `States`, of time and parameters; `speed` is that of a belt (`Fixed`). With a
        body `on` it is a side of this body that goes on for ever, with normal and offset in its axes, from its centre of
        mass: the pad of a gripper, a tray."""
        n = vector(normal, self._n, "normal")
        length = float(numpy.linalg.norm(n))
        if not (length > 0.0 and math.isfinite(length)):
            raise RangeError(f"the normal of a plane is {normal}: it needs a direction")
        moved = number(speed, "speed")
        if moved and self.space:
            raise UnsupportedError("the surface of a plane in space does not move along itself")
        at = offset if callable(offset) else number(offset, "offset")
        made = Fixed(self._name(name, "plane"), tuple((n / length).tolist()), at, moved, None if on is None else self._body(on))
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

        All shapes touch planes. In the plane discs, ellipses, boxes, rods and capsules touch each other where there are no sharp
        corners on both sides: give boxes a rounding. In space it is the same. A box or capsule has a contact for each corner or end of
        one body with the other, and in space for each two edges. Ellipsoids have one contact with whatever they touch, and
        cylinders some with all but balls.
        Bodies that joints connect are no pairs unless they are named.
        """
        mu, e = (self.mu if mu is None else mu), (self.e if e is None else e)
        old = list(self._pairs or [])
        new = []
        if not pairs:
            known = {frozenset((p.a.name, p.b.name)) for p in old}
            pairs = tuple(p for p in all_pairs(self) if frozenset((p[0].name, p[1].name)) not in known)
        for pair in pairs:
            if not isinstance(pair, (tuple, list)) or len(pair) != 2:
                raise ArgumentError(f"a pair is a tuple of two bodies, or of a body and a plane, not {pair!r:.60}")
            a, b = (self._thing(thing) for thing in pair)
            if isinstance(a, Fixed):
                a, b = b, a
            if isinstance(a, Fixed) or a is b or getattr(b, "on", None) is a:
                raise ArgumentError(f"{pair[0]!r} and {pair[1]!r} do not move against each other")
            if any({p.a, p.b} == {a, b} for p in old + new):
                raise ArgumentError(f"{a.name} and {b.name} are a pair already")
            check_shapes(a, b)
            new.append(_Pair(a, b, mu, e))
        self._pairs = old + new
        self._scene = None

    def force(self, body: Any, f: Callable[[States], Any]) -> None:
        """Add a force on a body, beside its weight: `f` is a function of `States` that returns its components along the axes of
        the world, expressions or numbers; in the plane a third one is a torque, in space three more are. At a hinge or slider
        it is one, the torque or force along it.

            w.force(block, lambda s: [-k * s["block"].x + s.u[0], 0.0])
            w.force(hinge, lambda s: s.u[0] - 0.1 * s[hinge].v)
        """
        if not callable(f):
            raise ArgumentError(f"a force is a function of the states, not {type(f).__name__}: lambda s: [fx, fy]")
        joint = self._joint(body)
        if joint is not None and (joint.loop or joint.kind not in ("hinge", "slider")):
            raise UnsupportedError(f"{joint.name} has no single coordinate: give its bodies forces and torques")
        self._forces.setdefault(self._body(body).name if joint is None else joint.name, []).append(f)
        self._scene = None

    # --- joints -------------------------------------------------------------------------------------------

    def joint(
        self,
        kind: str,
        parent: Any,
        body: Any,
        at: Any = (0.0, 0.0, 0.0),
        to: Any = (0.0, 0.0, 0.0),
        axis: Any = (0.0, 0.0, 1.0),
        *,
        turn: Any = None,
        limits: tuple[Any, Any] | None = None,
        e: Any = 0.0,
        damping: Any = 0.0,
        friction: Any = 0.0,
        stiction: Any = None,
        armature: Any = 0.0,
        loop: bool | None = None,
        name: str | None = None,
    ) -> Joint:
        """Add a joint between two bodies in space: "hinge", "slider", "ball" or "fixed".

        parent, body   `parent` is None for the world
        at, to         the point of the joint on each, from its centre of mass, in its axes
        axis           of hinges and sliders, in the axes of `body`
        turn           rotation of `body` against `parent` at zero: a quaternion (w, x, y, z), three angles about the fixed
                       axes x, y, z, or a matrix; none by default
        limits, e      of a hinge or slider: stops at the least and the largest value, contacts with restitution `e`
        damping, friction, stiction, armature   of a hinge or slider: force per rate, dry friction, what holds at rest, and
                       inertia beside that of the bodies
        loop           True for constraints between bodies that have coordinates of their own. By default that is what a joint
                       becomes where its body hangs on another one already, or the loop closes; else the body moves in the
                       coordinate of the joint, and is placed by it (`set`)

        Numbers of a joint may be functions of `States`, of time and parameters.
        """
        if not self.space:
            raise UnsupportedError("joints are for worlds in space; in the plane add constraints to a Scene")
        kinds = [k for k in SIZES if k not in ("free", "round", "point")]
        if kind not in kinds:
            raise ArgumentError(f"a joint is one of {', '.join(kinds)}, not {kind!r:.40}")
        b, a = self._body(body), None if parent is None else self._body(parent)
        if a is b:
            raise ArgumentError(f"{b.name} cannot be joined to itself")
        if a is not None and a.shape == "point":
            raise UnsupportedError(f"{a.name} is a point, which does not turn: nothing is joined to it")
        closes = any(j.body is b and not j.loop for j in self.joints) or self._hangs_on(a, b)
        if loop is False and closes:
            raise ArgumentError(f"{b.name} is held already, or {a.name if a else 'the world'} hangs on it: this joint closes a loop")
        looped = closes if loop is None else bool(loop)
        if looped and b.shape == "point" and kind != "ball":
            raise UnsupportedError(f"{b.name} is a point, which does not turn: join it by a ball")
        own = {"damping": damping, "friction": friction, "armature": armature}
        extra = [n for n, value in own.items() if callable(value) or number(value, n) != 0.0] + ["limits"] * (limits is not None)
        if extra and (looped or kind not in ("hinge", "slider")):
            raise UnsupportedError(f"{extra[0]} is for hinges and sliders that are no constraint: this joint has no coordinate")
        for n, value in own.items():
            if not callable(value) and not number(value, n) >= 0.0:
                raise RangeError(f"{n} is {value}: it must not be negative")
        made = Joint(
            self._name(name, kind), kind, a, b, place_of(at, "at"), place_of(to, "to"), unit(axis, "axis"),
            rotation(turn, "turn"), looped, _limits(limits), e, damping, friction, stiction, armature,
        )  # fmt: skip
        self.joints.append(made)
        self._scene = None
        return made

    def _hangs_on(self, a: Body | None, b: Body) -> bool:
        """Does a move with b?"""
        while a is not None:
            if a is b:
                return True
            a = next((j.parent for j in self.joints if j.body is a and not j.loop), None)
        return False

    def _joint(self, joint: Any) -> Joint | None:
        return next((j for j in self.joints if j is joint or (isinstance(joint, str) and j.name == joint)), None)

    def constraint(self, name: str, zero: Callable[[States], Any]) -> None:
        """Add a constraint (`Scene.constraint`): `zero` is a function of `States` that returns the expression.

        w.constraint("gear", lambda s: s[first].q - 3.0 * s[second].q)
        """
        if not callable(zero):
            raise ArgumentError(f"a constraint is a function of the states, not {type(zero).__name__}: lambda s: s[joint].q")
        self._constraints.append((self._name(name, "constraint"), zero))
        self._scene = None

    # --- the scene ----------------------------------------------------------------------------------------

    @property
    def scene(self) -> Scene:
        """The scene as it stands. What is added to the world later makes a new one."""
        if self._scene is None:
            self._scene = self._write()
        return self._scene

    @property
    def states(self) -> States:
        """Expressions of the scene as it stands, for costs and constraints of optimal control: `states[body].position`,
        `states[joint].q`, in the units of the world. Those of an older scene belong to no newer one."""
        return self.scene._layout.read(self.scene.x, self.scene.u, self.scene.p, self.scene.t)

    def _stated(self) -> list[_Pair]:
        if self._pairs is not None:
            return self._pairs
        for a, b in all_pairs(self):
            check_shapes(a, b)
        return [_Pair(a, b, self.mu, self.e) for a, b in all_pairs(self)]

    def _write(self) -> Scene:
        if not self.bodies:
            raise StateError("there are no bodies in this world")
        return write(self, self._stated())

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
        turn: Any = None,
    ) -> None:
        """Place the centre of mass of a body where a simulation begins, with its velocity. In space `omega` are three
        numbers along the axes of the world, and `turn` is the orientation: a quaternion (w, x, y, z), three angles about
        the fixed axes x, y, z, one after the other, or a matrix."""
        b = self._body(body)
        named = {"x": x, "y": y, "z": z, "vx": vx, "vy": vy, "vz": vz, "angle": angle}
        n = {name: number(value, f"{name} of {b.name}") for name, value in named.items()}
        if not self.space and (n["z"] or n["vz"]):
            raise UnsupportedError("this world is in the plane: there is no z")
        if not self.space and turn is not None:
            raise UnsupportedError("this world is in the plane: a body is turned by its angle")
        if self.space and n["angle"]:
            raise UnsupportedError("bodies have no angle in space: give turn, a quaternion or three angles")
        held = next((j for j in self.joints if j.body is b and not j.loop), None)
        if held is not None:
            raise StateError(f"{b.name} is where its joint is: set({held.name!r}, ...)")
        if self.space:
            none = numpy.ndim(omega) == 0 and not omega
            moves: Any = numpy.zeros(3) if none else vector(omega, 3, f"omega of {b.name}")
        else:
            moves = number(omega, f"omega of {b.name}")
        position, velocity = (n["x"], n["y"], n["z"])[: self._n], (n["vx"], n["vy"], n["vz"])[: self._n]
        turned = rotation(turn, f"turn of {b.name}")
        self._placed[b.name] = _Placed(position, velocity, n["angle"], moves, turned)

    def set(self, joint: Any, q: Any, v: Any = 0.0) -> None:
        """Set where a joint is when a simulation begins, and its rate: angle or way, and of a ball joint `turn` as in `place`, and
        an angular velocity along the axes of the second body. Joints that are not set begin at zero."""
        j = self._joint(joint)
        if j is None:
            known = ", ".join(j.name for j in self.joints) or "none"
            raise ArgumentError(f"{joint!r} is no joint of this world, which has {known}")
        if j.loop or j.kind == "fixed":
            raise UnsupportedError(f"{j.name} has no coordinate: its bodies are placed")
        if j.kind == "ball":
            still = numpy.ndim(v) == 0 and not v
            rate = [0.0] * 3 if still else vector(v, 3, f"the rate of {j.name}").tolist()
            self._placed_joints[j.name] = sp.quaternion_of(rotation(q, f"the turn of {j.name}")), rate
        else:
            self._placed_joints[j.name] = [number(q, f"q of {j.name}")], [number(v, f"v of {j.name}")]

    def _placed_of(self, name: str) -> _Placed:
        if name not in self._placed:
            raise StateError(f"{name} is not placed: say where it begins (place)")
        return self._placed[name]

    def start(self) -> tuple[Array, Array]:
        """Coordinates and velocities of the scene as the bodies are placed."""
        scene = self.scene
        x = numpy.zeros(scene.nx)
        scene._layout.put(x)
        return x[: scene.n_q], x[scene.n_q :]

    def _states_at(self, q: Any, v: Any) -> States:
        """The states of all bodies at coordinates and velocities."""
        return self.scene._layout.read(numpy.concatenate([q, v]), None, None, 0.0)

    def simulate(self, t_span: Any, **keywords: Any) -> Run:
        """Simulate from where the bodies are placed; see `switchback_control.simulate` for the rest."""
        run = self.scene.simulate(*self.start(), t_span, **keywords)
        run._placed = dict(self._placed)
        return run

    def _states(self, run: Run, t: Array, after: bool = False) -> States:
        """The states of all bodies at times of a run, as numbers; with `after` behind the impacts at these times."""
        layout = layout_of(run)
        if layout is None or layout.world is not self:
            raise ArgumentError("this is no run of this world")
        times = numpy.clip(numpy.nextafter(t, numpy.inf), run.t_start, run.t_end) if after else t
        x = numpy.moveaxis(run(times), -1, 0)
        p = None if run._p is None else run._p
        return layout.read(x, None, p, times)

    def trajectory(self, run: Run, body: Any, t: Any = None) -> Any:
        """The way of a body in a run of this world, at times (by default those of the run's steps): a `Motion`. Of a joint it is
        a `JointState` of arrays."""
        joint = self._joint(body)
        b = None if joint is not None else self._body(body)
        times = run.t if t is None else real(t, "t")
        s = self._states(run, times)[joint if b is None else b]
        if b is None:
            return s
        if self.space:
            return self._way_in_space(run, b, s, times)
        placed = getattr(run, "_placed", self._placed).get(b.name)
        angle, omega = s.angle, s.omega
        if omega is None and placed is not None:
            omega = numpy.broadcast_to(placed.omega, times.shape).copy()
            angle = placed.angle + placed.omega * (times - run.t_start)
        return Motion(times, s.x, s.y, s.vx, s.vy, angle, omega)

    def _way_in_space(self, run: Run, b: Body, s: Any, times: Array) -> Motion:
        def full(c: Any) -> Array:
            return numpy.broadcast_to(numpy.asarray(c, dtype=float), times.shape).copy()

        placed = getattr(run, "_placed", self._placed).get(b.name)
        omega = quaternion = None
        if s.omega is not None:
            omega = numpy.stack([full(c) for c in s.omega], axis=-1)
        elif placed is not None:
            omega = numpy.broadcast_to(placed.omega, (*times.shape, 3)).copy()
        if s.rotation is not None:
            rows = numpy.stack([numpy.stack([full(c) for c in row], axis=-1) for row in s.rotation], axis=-2)
            found = [sp.quaternion_of(m) for m in rows.reshape(-1, 3, 3)]
            quaternion = _continued(numpy.array(found)).reshape(*times.shape, 4)
        x, y, z, vx, vy, vz = (full(c) for c in (*s.position, *s.velocity))
        return Motion(times, x, y, vx, vy, None, omega, z, vz, quaternion)

    def animate(self, run: Run, path: Any, **keywords: Any) -> None:
        """See `switchback_control.animate`."""
        from .animation import animate

        animate(run, path, **keywords)

    def picture(self, run: Run, t: float, ax: Any = None, limits: Any = None) -> Any:
        """Draw the bodies of a world in space at a time of a run, on axes of matplotlib in three dimensions (`ax`, by default
        new ones), and return the axes. `limits` are the least and the largest x, y and z. In the plane see `animate`."""
        from ._space_pictures import picture

        if not self.space:
            raise UnsupportedError("pictures are for worlds in space; in the plane use animate")
        return picture(run, t, ax, limits)

    def __repr__(self) -> str:
        return f"<World '{self.name}': {len(self.bodies)} bodies, {len(self.fixed)} planes>"


def _limits(given: Any) -> tuple[Any, Any]:
    if given is None:
        return -math.inf, math.inf
    if not isinstance(given, (tuple, list)) or len(given) != 2:
        raise ArgumentError(f"limits are the least and the largest value of a joint, not {given!r:.40}")
    low, high = (v if callable(v) else float(v) for v in given)
    if not callable(low) and not callable(high) and not low < high:
        raise RangeError(f"limits are {given}: the first must be less than the second")
    return low, high


def _continued(q: Array) -> Array:
    """Quaternions with signs such that each is near the one before."""
    turns = numpy.where(numpy.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0)
    return q * numpy.concatenate([[1.0], numpy.cumprod(turns)])[:, None] if len(q) else q
