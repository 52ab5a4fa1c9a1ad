"""What worlds are made of: bodies and their shapes, planes, the states of both, and what a contact of them measures."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy

from . import _spatial as sp
from ._arrays import Array, number, real, vector
from .errors import DimensionError, RangeError, UnsupportedError

if TYPE_CHECKING:
    from .bodies import World

__all__ = ["Body", "BodyState", "Fixed", "JointState", "Motion", "Shape", "States"]


def rotation(given: Any, what: str) -> Any:
    """The matrix of a rotation that is given as a quaternion (w, x, y, z), as three angles about the fixed axes x, y and z, one
    after the other, as a matrix, or as None."""
    if given is None:
        return numpy.eye(3)
    r = real(given, what)
    if r.shape == (3,):
        return numpy.array(sp.of_angles(*r.tolist()))
    if r.shape == (4,) and float(numpy.linalg.norm(r)) > 0.0:
        return numpy.array(sp.of_quaternion((r / numpy.linalg.norm(r)).tolist()))
    if r.shape != (3, 3):
        raise DimensionError(f"{what} is a quaternion, three angles or a matrix, not an array of shape {r.shape}")
    # digits of a file, no more: a matrix that is no rotation would stretch the body
    if float(numpy.max(numpy.abs(r @ r.T - numpy.eye(3)))) > 1e-6 or numpy.linalg.det(r) < 0.0:
        raise RangeError(f"{what} is no rotation: its rows must be perpendicular unit vectors, right-handed")
    return numpy.array(sp.of_quaternion(sp.quaternion_of(r)))


def positive(value: Any, name: str) -> float:
    given = number(value, name)
    if not (given > 0.0 and math.isfinite(given)):
        raise RangeError(f"{name} is {given:g}: it must be positive")
    return given


def place_of(value: Any, name: str) -> tuple[float, ...]:
    return tuple(vector(value, 3, name).tolist())


def unit(value: Any, name: str) -> tuple[float, ...]:
    given = vector(value, 3, name)
    length = float(numpy.linalg.norm(given))
    if not (length > 0.0 and math.isfinite(length)):
        raise RangeError(f"{name} is {given}: it needs a direction")
    return tuple((given / length).tolist())


def inertia_of(given: Any, name: str) -> Any:
    """A moment of inertia for all axes, or a matrix."""
    if numpy.ndim(given) == 0:
        value = number(given, name)
        if not (value >= 0.0 and math.isfinite(value)):
            raise RangeError(f"{name} is {value:g}: it must be positive")
        return value
    m = real(given, name)
    m = numpy.diag(m) if m.shape == (3,) else m
    if m.shape != (3, 3):
        raise DimensionError(f"{name} has shape {m.shape}: it is a number, three moments, or a matrix of three rows")
    largest = float(numpy.max(numpy.abs(m)))
    # by rounding of what a file has with six digits, and not by more
    if not numpy.all(numpy.isfinite(m)) or float(numpy.max(numpy.abs(m - m.T))) > 1e-6 * largest:
        raise RangeError(f"{name} is not a symmetric matrix of finite numbers")
    m = 0.5 * (m + m.T)
    moments = numpy.linalg.eigvalsh(m)
    # none about one axis is a thin rod, none at all a point; joints may hold both
    if not moments[0] >= -1e-6 * moments[2]:
        raise RangeError(f"{name} is not positive: its moments are {moments}")
    return m


@dataclass(frozen=True, eq=False)
class Shape:
    """A shape in space, fixed to a body.

    kind     "point", "sphere", "box", "capsule", "cylinder", "ellipsoid"
    size     full width, depth and height of a box; length of a capsule between the centres of its ends, along its x axis;
             length of a cylinder along its x axis and its radius; semi-axes of an ellipsoid
    radius   of spheres and capsules, of the edges and corners of a box, and of the rims of a cylinder, else 0
    at       its centre, from the centre of mass, in the axes of the body
    turn     its rotation against the body: a quaternion (w, x, y, z), three angles about fixed axes x, y, z, or a matrix
    """

    kind: str
    size: tuple[float, ...] = ()
    radius: float = 0.0
    at: tuple[float, ...] = (0.0, 0.0, 0.0)
    turn: Any = None

    def __post_init__(self) -> None:
        sizes = {"point": 0, "sphere": 0, "box": 3, "capsule": 1, "cylinder": 2, "ellipsoid": 3}
        if self.kind not in sizes:
            raise UnsupportedError(f"a shape is one of {', '.join(sizes)}, not {self.kind!r:.40}")
        n = sizes[self.kind]
        size = vector(self.size, n, f"size of a {self.kind}") if n else numpy.zeros(0)
        radius = number(self.radius, f"radius of a {self.kind}")
        round_ = self.kind in ("sphere", "capsule")
        if self.kind == "box" and not 0.0 <= 2.0 * radius < min(size):
            raise RangeError(f"a box of size {self.size} has edges of radius {self.radius}: it must be less than half of its least width")
        if self.kind == "cylinder" and not 0.0 <= 2.0 * radius < min(size[0], 2.0 * size[1]):
            raise RangeError(f"a cylinder of size {self.size} has rims of radius {self.radius}: it must be less than half of its length, and its radius")
        if not numpy.all((size > 0.0) & numpy.isfinite(size)) or (round_ and not 0.0 < radius < numpy.inf):
            raise RangeError(f"a {self.kind} has size {self.size} and radius {self.radius}: they must be positive")
        object.__setattr__(self, "size", tuple(size.tolist()))
        object.__setattr__(self, "radius", radius if round_ or self.kind in ("box", "cylinder") else 0.0)
        object.__setattr__(self, "at", tuple(vector(self.at, 3, f"place of a {self.kind}").tolist()))
        object.__setattr__(self, "turn", rotation(self.turn, f"turn of a {self.kind}"))

    @property
    def _spots(self) -> list[_Spot]:
        turn = sp.constants(self.turn)

        def spot(name: str, place: list[float], semi: Any = None, rim: _Rim | None = None) -> _Spot:
            at = sp.constants(numpy.array(self.at) + numpy.array(turn) @ place)
            return _Spot(name, tuple(at), self.radius, semi, rim=rim)

        if self.kind == "box":
            a, b, c = (0.5 * s - self.radius for s in self.size)
            words = (("lower", -c), ("upper", c)), (("front", -b), ("back", b)), (("left", -a), ("right", a))
            return [spot(f"{i} {j} {k}", [x, y, z]) for i, z in words[0] for j, y in words[1] for k, x in words[2]]
        if self.kind == "capsule":
            return [spot("left", [-0.5 * self.size[0], 0.0, 0.0]), spot("right", [0.5 * self.size[0], 0.0, 0.0])]
        if self.kind == "cylinder":
            half, radius = 0.5 * self.size[0] - self.radius, self.size[1] - self.radius
            out = []
            for word, sign in (("left", -1.0), ("right", 1.0)):
                axis = tuple(sign * row[0] for row in turn)
                out.append(spot(f"{word} rim", [sign * (half - _THIN * radius), 0.0, 0.0], rim=_Rim(axis, radius)))
                for name, y, z in (("front", -1.0, 0.0), ("back", 1.0, 0.0), ("lower", 0.0, -1.0), ("upper", 0.0, 1.0)):
                    out.append(spot(f"{word} {name}", [sign * half, y * _INSIDE * radius, z * _INSIDE * radius]))
            return out
        if self.kind == "ellipsoid":
            squares = numpy.array(turn) @ numpy.diag(numpy.square(self.size)) @ numpy.array(turn).T
            return [spot("", [0.0, 0.0, 0.0], sp.constants(0.5 * (squares + squares.T)))]
        return [spot("", [0.0, 0.0, 0.0])]

    @property
    def _reach(self) -> float:
        """Radius of a ball around its centre that holds it."""
        if self.kind == "ellipsoid":
            return max(self.size)
        half = self._half or (0.0,)
        return math.hypot(*half[: 2 if self.kind == "cylinder" else 3]) + self.radius

    @property
    def _half(self) -> tuple[float, ...] | None:
        """Half widths of a box, capsule, cylinder or ellipsoid without its radius; none of balls and points."""
        if self.kind == "box":
            return tuple(0.5 * s - self.radius for s in self.size)
        if self.kind == "cylinder":
            across = self.size[1] - self.radius
            return 0.5 * self.size[0] - self.radius, across, across
        if self.kind == "ellipsoid":
            return self.size
        return (0.5 * self.size[0], 0.0, 0.0) if self.kind == "capsule" else None


@dataclass(frozen=True)
class _Power:
    """A superellipse by its support function, of directions in its axes, with the conjugate exponent q:

    h(d) = (sum over i of (scales[i] (d[i]^2 + flat^2 |d|^2))^(q/2))^(1/q)

    Each term is the support function of an ellipse, so this is one of a convex body. With `flat` zero it is the superellipse, whose sides
    have no curvature in their middles. That is why there is a little of it.
    """

    scales: tuple[float, float]
    q: float
    flat: float

    @staticmethod
    def of(semi: tuple[float, float], exponent: float, flat: float) -> _Power:
        """With these semi-axes: the powers of the scales solve two linear equations."""
        q = exponent / (exponent - 1.0)
        own, other = (1.0 + flat * flat) ** (0.5 * q), flat**q
        powers = numpy.linalg.solve([[own, other], [other, own]], [s**q for s in semi])
        if not numpy.all(powers > 0.0):
            raise RangeError(f"a superellipse with semi-axes {semi} is too slender for flat={flat:g}: take a smaller one")
        return _Power(tuple((powers ** (2.0 / q)).tolist()), q, flat)

    def _terms(self, d: Any) -> list[Any]:
        square = self.flat * self.flat * (d[0] * d[0] + d[1] * d[1])
        return [s * (c * c + square) for s, c in zip(self.scales, d)]

    def support(self, d: Any) -> Any:
        x, y = self._terms(d)
        return (x ** (0.5 * self.q) + y ** (0.5 * self.q)) ** (1.0 / self.q)

    def farthest(self, d: Any) -> tuple[list[Any], Any]:
        """The point that is farthest in a direction, and how far that is."""
        x, y = self._terms(d)
        h = self.support(d)
        slopes = [s * t ** (0.5 * self.q - 1.0) for s, t in zip(self.scales, (x, y))]
        both = self.flat * self.flat * (slopes[0] + slopes[1])
        return [(s + both) * c * h ** (1.0 - self.q) for s, c in zip(slopes, d)], h

    def outline(self, n: int) -> Array:
        """Points of the boundary, [n, 2]."""
        a = numpy.linspace(0.0, 2.0 * math.pi, n + 1)[:-1]
        # directions where the boundary is flat stand close to each other
        d = numpy.array([numpy.sign(numpy.cos(a)) * numpy.abs(numpy.cos(a)) ** 3, numpy.sign(numpy.sin(a)) * numpy.abs(numpy.sin(a)) ** 3])
        return numpy.stack(self.farthest(d)[0], axis=-1)


# No finite set of smooth gaps is that of a disc and a plane. This one is: the deepest point of the rim, of a disc that is an ellipsoid as thin as rounding
# lets it be, and four points that hold the disc where it is flat. They are inside of the rim, so that a cylinder that rolls does not graze them.
_THIN = 1e-8  # thickness of the ellipsoid, as a share of its radius; it is inside of the cylinder
_INSIDE = 0.95  # place of the four points, as a share of the radius


@dataclass(frozen=True)
class _Rim:
    """The end of a cylinder with its outward axis, as an ellipsoid with semi-axes of the radius and of nearly nothing."""

    axis: tuple[float, ...]
    radius: float

    def farthest(self, d: Any) -> tuple[list[Any], Any]:
        """The point that is farthest in a direction, and how far that is."""
        along = sp.dot(list(d), list(self.axis))
        across = sp.subtract(list(d), sp.scale(along, list(self.axis)))
        root = numpy.sqrt(sp.dot(across, across) + _THIN * _THIN * along * along)
        place = sp.add(across, sp.scale(_THIN * _THIN * along, list(self.axis)))
        return sp.scale(self.radius / root, place), self.radius * root


@dataclass(frozen=True)
class _Spot:
    """What can touch a plane: a point of a body with its radius, or a centre with the matrix of squared semi-axes of an ellipsoid."""

    name: str
    at: tuple[float, ...]
    radius: float
    squares: Any = None
    power: _Power | None = None
    rim: _Rim | None = None


@dataclass(frozen=True, eq=False)
class Body:
    """A body that moves, as `World.disc` and its like return it.

    name, shape    "disc", "ellipse", "superellipse", "box", "rod", "capsule", "point" in the plane; "sphere", "box", "capsule", "cylinder", "ellipsoid",
                   "point" or "link" (of any shapes) in space
    mass, inertia  inertia about the centre of mass; in space three rows in the axes of the body, or one number for all axes
    radius         of discs, spheres and capsules, of the corners of a box, and of the rims of a cylinder, else 0
    power          exponent and flatness of a superellipse
    size           width and height of a box, semi-axes of an ellipse, length of a rod or between the ends of a capsule, and 0; in
                   space that of `Shape`
    shapes         the shapes of a body in space
    """

    name: str
    shape: str
    mass: float
    inertia: Any
    radius: float = 0.0
    size: tuple[float, ...] = (0.0, 0.0)
    turns: bool | None = None
    shapes: tuple[Shape, ...] = ()
    power: tuple[float, float] | None = None

    @property
    def _reach(self) -> float:
        """Radius of a ball around its centre of mass that holds it."""
        if self.shapes:
            return max(math.dist(s.at, (0.0, 0.0, 0.0)) + s._reach for s in self.shapes)
        half = self.size if self.shape in ("ellipse", "superellipse") else self._half or (0.0, 0.0)
        return (max(half) if self.shape == "ellipse" else math.hypot(*half)) + self.radius

    @property
    def _power(self) -> _Power | None:
        return None if self.power is None else _Power.of((self.size[0], self.size[1]), *self.power)

    @property
    def _spots(self) -> list[_Spot]:
        """What can touch a plane: corners, ends and centres."""
        if self.shapes:
            found = [(n, s) for n, shape in enumerate(self.shapes, 1) for s in shape._spots]
            if len(self.shapes) == 1:
                return [s for _, s in found]
            return [replace(s, name=f"{n} {s.name}".strip()) for n, s in found]
        if self.shape == "link":
            return []
        if self.shape in ("ellipse", "superellipse"):
            a, b = self.size
            return [_Spot("", (0.0, 0.0), 0.0, [[a * a, 0.0], [0.0, b * b]], self._power)]
        a, b = self._half or (0.0, 0.0)
        places = [("", 0.0, 0.0)]
        if self.shape == "box":
            places = [("lower left", -a, -b), ("lower right", a, -b), ("upper right", a, b), ("upper left", -a, b)]
        if self.shape in ("rod", "capsule"):
            places = [("left", -a, 0.0), ("right", a, 0.0)]
        return [_Spot(name, (x, y), self.radius) for name, x, y in places]

    @property
    def _half(self) -> tuple[float, float] | None:
        """Half widths of a box, capsule or rod in the plane without its radius; none of round bodies."""
        if self.shape == "box":
            return 0.5 * self.size[0] - self.radius, 0.5 * self.size[1] - self.radius
        return (0.5 * self.size[0], 0.0) if self.shape in ("rod", "capsule") else None

    def __repr__(self) -> str:
        return f"<Body '{self.name}': {self.shape}>"


@dataclass(frozen=True, eq=False)
class Fixed:
    """A plane that bodies do not pass, in the plane a line: they are where normal . position >= offset.

    `offset` is a number or a function of `States` (time, parameters); `speed` is the speed of its surface, a number, in
    the plane along the normal turned by 90 degrees clockwise (to the right on a floor), a belt. With a body `on` the plane
    is a side of it: normal and offset are in its axes, from its centre of mass.
    """

    name: str
    normal: tuple[float, ...]
    offset: Any
    speed: float = 0.0
    on: Body | None = None

    @property
    def _tangents(self) -> list[tuple[float, ...]]:
        n = self.normal
        if len(n) == 2:
            return [(n[1], -n[0])]
        return [tuple(t) for t in sp.perpendicular(n)]

    def __repr__(self) -> str:
        return f"<Fixed '{self.name}'>"


def _component(of: str, i: int) -> Any:
    return property(lambda self: getattr(self, of)[i], doc=f"Component {i} of the {of}.")


@dataclass(frozen=True)
class BodyState:
    """Position and velocity of a body's centre of mass: expressions, or arrays of numbers. `angle` and `omega` are None where
    the rotation is not part of the scene; in the plane there is no `z` and `vz`. In space there is no angle, `omega` are three
    numbers along the axes of the world, and `rotation` has three rows: it turns the axes of the body to those of the world.
    It is None where no orientation is part of the scene, as that of a sphere."""

    position: Any
    velocity: Any
    angle: Any = None
    omega: Any = None
    rotation: Any = None

    x = _component("position", 0)
    y = _component("position", 1)
    z = _component("position", 2)
    vx = _component("velocity", 0)
    vy = _component("velocity", 1)
    vz = _component("velocity", 2)

    def turned(self, vector: Any) -> list[Any]:
        """A vector of the body, such as the way from the centre of mass to a point of it, in the axes of the world."""
        a = [float(c) if isinstance(c, (int, float)) else c for c in vector]
        if self.angle is not None:
            c, s = numpy.cos(self.angle), numpy.sin(self.angle)
            return [c * a[0] - s * a[1], s * a[0] + c * a[1]]
        return a if self.rotation is None else sp.apply(self.rotation, a)

    def back(self, vector: Any) -> list[Any]:
        """A vector along the axes of the world in those of the body."""
        a = list(vector)
        if self.angle is not None:
            c, s = numpy.cos(self.angle), numpy.sin(self.angle)
            return [c * a[0] + s * a[1], c * a[1] - s * a[0]]
        return a if self.rotation is None else sp.back(self.rotation, a)

    def swept(self, arm: Any) -> list[Any]:
        """The velocity that the rotation gives to a point at `arm` from the centre of mass, in the axes of the world."""
        if self.omega is None:
            return [0.0] * len(arm)
        if len(arm) == 2:
            return [-self.omega * arm[1], self.omega * arm[0]]
        return sp.cross(list(self.omega), list(arm))


@dataclass(frozen=True)
class JointState:
    """Angle or way `q` and its rate `v` of a hinge or slider; of a ball joint a quaternion and three numbers along the axes of
    the second body. Expressions, or arrays of numbers."""

    q: Any
    v: Any


class States:
    """The expressions of a world, for forces, moving planes, friction and restitution given as functions: `s[body]` is
    a `BodyState`, the body given by itself or its name; `s[joint]` is a `JointState`; `s.t` is the time, `s.u` and `s.p` are
    controls and parameters."""

    def __init__(
        self, world: World, states: dict[str, BodyState], u: Any, p: Any, t: Any, joints: dict[str, JointState] | None = None
    ):
        self._world, self._states, self._joints = world, states, joints or {}
        self.u, self.p, self.t = u, p, t

    def __getitem__(self, thing: Any) -> Any:
        name = thing if isinstance(thing, str) else getattr(thing, "name", None)
        if name in self._joints and any(j is thing or j.name == thing for j in self._world.joints):
            return self._joints[name]
        return self._states[self._world._body(thing).name]


@dataclass(frozen=True)
class Motion:
    """The way of a body: arrays over the times `t`. `z` and `vz` are None in the plane, `angle` in space, where `omega`
    has a column for each axis of the world, and `quaternion` (w, x, y, z; of length one) is there for bodies whose orientation
    is part of the scene. Bodies whose rotation is not part of the scene turn as they began."""

    t: Array
    x: Array
    y: Array
    vx: Array
    vy: Array
    angle: Array | None = None
    omega: Array | None = None
    z: Array | None = None
    vz: Array | None = None
    quaternion: Array | None = None


@dataclass(frozen=True, eq=False)
class _Pair:
    """Two things that may touch."""

    a: Body
    b: Body | Fixed
    mu: Any
    e: Any


def _value(given: Any, s: States) -> Any:
    return given(s) if callable(given) else given


Force = Callable[[States], Any]
