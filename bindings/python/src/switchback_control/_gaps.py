"""What a contact of two things of a world measures: gap, normal, sliding velocities and the point of contact."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy

from . import _spatial as sp
from ._solids import clamped, distance, nearest
from .expr import Graph, _graph_among, signed_distance, solve
from .expr import sqrt as _sqrt
from .function import Function
from .shapes import Body, BodyState, Fixed, States, _Pair, _Spot, _value

# Every bodies' touch is one of few: a spot (a corner, an end, a centre with its radius, or an ellipsoid) with a plane, with another round
# spot or ellipsoid, or with the core of a box or capsule, which is what is left of it without its radius.

_LEAST = 1e-300  # nothing next to the square of any length


@dataclass(frozen=True)
class _Core:
    """A box of half widths about a place of a body, with a radius around it; some may be zero, as those of a capsule are. It may be another
    body of `nearest`: a cylinder, its ends, or an ellipsoid.

    `side` is the axis and sign of a side: what touches an ellipse there is the point of it that is deepest below that side.
    """

    name: str
    at: tuple[float, ...]
    half: tuple[float, ...]
    radius: float
    turn: Any = None
    side: tuple[int, float] | None = None
    kind: str = "box"

    def frame(self, body: Any) -> list[list[Any]]:
        """Rows of its rotation, those of the body at a time."""
        turn = sp.EYE if self.turn is None else self.turn
        return sp.transposed([body.turned([row[i] for row in turn]) for i in range(3)])


@dataclass(frozen=True)
class _Edge:
    """An edge of a box, or the middle line of a capsule, in space: a place, a direction, half of its length and a radius around it."""

    name: str
    at: tuple[float, ...]
    along: tuple[float, ...]
    half: float
    radius: float
    squares: Any = None


# Lines of two edges that are nearer to parallel than the root of this, in radians, have no nearest places that could be told from others:
# the middle is taken then, and the ends of the edges are contacts of their own.
_PARALLEL = 1e-8


@dataclass(frozen=True)
class _Frame:
    """The rotation of a body as a matrix, where it is all that is known of it."""

    rows: Any

    def turned(self, v: Any) -> list[Any]:
        return [sp.dot(row, v) for row in self.rows]

    def back(self, v: Any) -> list[Any]:
        return [sp.dot([row[i] for row in self.rows], v) for i in range(len(v))]


def _support(spot: _Spot, body: Any, matrix: Any) -> Callable[[Any], Any] | None:
    """The support function of an ellipsoid or superellipse, of directions along the axes of the world; none of a ball."""
    if matrix is None:
        return None
    if spot.power is None:
        return lambda d: _sqrt(sp.dot(list(d), sp.apply(matrix, list(d))))
    power = spot.power
    return lambda d: power.support(body.back(list(d)))


def _smooth_gap(between: list[Any], spots: list[_Spot], bodies: list[Any], size: float) -> tuple[Any, list[Any]]:
    """Gap of balls, ellipsoids and superellipses, and the normal to the first, as expressions."""
    n = len(between)
    matrices = [_matrix(spot, body) for spot, body in zip(spots, bodies)]
    parts = [f for f in (_support(*all) for all in zip(spots, bodies, matrices)) if f is not None]
    # the normal of the ellipsoid with the sum of the matrices, in the direction of the other body: right for bodies of one form
    around = sum(spot.radius * spot.radius for spot in spots)
    total = [[around if i == j else 0.0 for j in range(n)] for i in range(n)]
    for m in matrices:
        if m is not None:
            total = [[sp.plus(i, j) for i, j in zip(a, b)] for a, b in zip(total, m)]
    ahead = solve(total, between)
    length = _sqrt(ahead @ ahead)
    gap, normal = signed_distance(between, lambda d: sum(f(d) for f in parts), [ahead[i] / length for i in range(n)], size)
    return gap - sum(spot.radius for spot in spots), [normal[i] for i in range(n)]


@lru_cache(maxsize=64)
def _numbers_of(forms: tuple[Any, ...], n: int, size: float) -> Function:
    """The same as a function of the way between the two and of their rotations, for shapes of these forms (`_form`)."""
    g = Graph()
    x = g.inputs("x", n + 2 * n * n)
    frames = [_Frame([[x[first + n * i + j] for j in range(n)] for i in range(n)]) for first in (n, n + n * n)]
    spots = [_Spot("", (), radius, squares and [list(row) for row in squares], power) for radius, squares, power in forms]
    gap, normal = _smooth_gap([x[i] for i in range(n)], spots, frames, size)
    return g.function([gap, *normal], nx=x.size, name="gap")


def _form(spot: _Spot) -> Any:
    return spot.radius, spot.squares and tuple(map(tuple, spot.squares)), spot.power


def _smooth(between: list[Any], spots: list[_Spot], bodies: list[Any], size: float) -> tuple[Any, list[Any]]:
    """The same of expressions, or of arrays of numbers."""
    if _graph_among(between) is not None:
        return _smooth_gap(between, spots, bodies, size)
    n = len(between)
    f = _numbers_of(tuple(_form(spot) for spot in spots), n, size)
    parts = list(between)
    for body in bodies:
        columns = [body.turned([float(i == j) for i in range(n)]) for j in range(n)]
        parts += [columns[j][i] for i in range(n) for j in range(n)]
    columns = numpy.broadcast_arrays(*[numpy.asarray(c, dtype=float) for c in parts])
    points = numpy.stack(columns, axis=-1)
    values = numpy.array([f(x) for x in points.reshape(-1, len(parts))]).reshape(*points.shape[:-1], 1 + n)
    return values[..., 0], [values[..., 1 + i] for i in range(n)]


@dataclass(frozen=True, eq=False)
class _Touch:
    """A contact of the scene: a spot of a body with a plane, with a spot of another body, or with its core."""

    name: str
    a: Body
    spot: _Spot | _Edge | _Core
    b: Body | Fixed
    other: _Spot | _Core | _Edge | None
    mu: Any
    e: Any
    size: float = field(default=1.0)

    def geometry(self, s: States) -> tuple[Any, list[Any], list[Any], list[Any]]:
        """Gap, normal from the other body to the first, sliding velocities along `tangents`, and the point of contact on
        the first. The same lines make expressions and numbers, as the states are."""
        if not isinstance(self.b, Fixed):
            return self.measure(s[self.a], s[self.b])
        return self.measure(s[self.a], None if self.b.on is None else s[self.b.on], s)

    def measure(self, a: BodyState, b: Any, s: Any = None) -> tuple[Any, list[Any], list[Any], list[Any]]:
        """The same for the states of the two bodies, none for a plane of the world."""
        spot = self.spot
        arm = a.turned(spot.at)
        centre = sp.add(list(a.position), arm)
        velocity = sp.add(list(a.velocity), a.swept(arm))
        if isinstance(self.b, Fixed):
            gap, normal, tangents, out = self._with_plane(s, a, b, centre)
            foot, speed = None, self.b.speed
        else:
            speed = 0.0
            with_: Any = self._with_core if isinstance(self.other, _Core) else self._with_spot
            with_ = self._with_edge if isinstance(self.other, _Edge) else self._of_cores if isinstance(spot, _Core) else with_
            gap, normal, out, foot = with_(a, b, centre)
            tangents = [[normal[1], -normal[0]]] if len(normal) == 2 else sp.tangents_of(normal)
        point = sp.add(centre, out)
        relative = sp.add(velocity, a.swept(out))
        if b is not None:
            foot = sp.subtract(point, list(b.position)) if foot is None else foot
            relative = sp.subtract(relative, sp.add(list(b.velocity), b.swept(foot)))
        sliding = [sp.dot(t, relative) for t in tangents]
        if speed:
            sliding = [v - speed for v in sliding]
        return gap, normal, sliding, point

    def _with_plane(self, s: Any, a: BodyState, b: Any, centre: list[Any]) -> tuple[Any, list[Any], list[Any], list[Any]]:
        plane: Any = self.b
        normal = list(plane.normal) if b is None else b.turned(plane.normal)
        tangents = [list(t) if b is None else b.turned(t) for t in plane._tangents]
        out, reach = _out(self.spot, a, sp.scale(-1.0, normal))
        origin = [0.0] * len(normal) if b is None else list(b.position)
        gap = sp.dot(normal, sp.subtract(centre, origin)) - reach - _value(plane.offset, s)
        return gap, normal, tangents, out

    def _with_spot(self, a: BodyState, b: BodyState, centre: list[Any]) -> tuple[Any, list[Any], list[Any], list[Any]]:
        """With a round spot, or an ellipsoid."""
        other: Any = self.other
        foot = b.turned(other.at)
        between = sp.subtract(centre, sp.add(list(b.position), foot))
        if self.spot.squares is None and other.squares is None:
            distance = numpy.sqrt(sp.dot(between, between))
            normal = [d / distance for d in between]
            gap = distance - self.spot.radius - other.radius
        else:
            gap, normal = _smooth(between, [self.spot, other], [a, b], self.size)
        out, _ = _out(self.spot, a, sp.scale(-1.0, normal))
        return gap, normal, out, sp.add(foot, _out(other, b, normal)[0])

    def _with_edge(self, a: BodyState, b: BodyState, centre: list[Any]) -> tuple[Any, list[Any], list[Any], list[Any]]:
        """Of two edges: the distance of the nearest places of their lines, as far as these are on the edges. Where one is not, an end is nearer,
        and is a contact of its own. So the least of all is the distance, and each has one continuous derivative."""
        mine: Any = self.spot
        theirs: Any = self.other
        u, v = a.turned(mine.along), b.turned(theirs.along)
        foot = b.turned(theirs.at)
        way = sp.subtract(centre, sp.add(list(b.position), foot))
        cosine, on_u, on_v = sp.dot(u, v), sp.dot(u, way), sp.dot(v, way)
        share = 1.0 / (1.0 - cosine * cosine + _PARALLEL)
        s = clamped((cosine * on_v - on_u) * share, mine.half)
        t = clamped((on_v - cosine * on_u) * share, theirs.half)
        at, foot = sp.scale(s, u), sp.add(foot, sp.scale(t, v))
        between = sp.subtract(sp.add(way, at), sp.scale(t, v))
        distance = numpy.sqrt(sp.dot(between, between) + _LEAST)
        normal = [c / distance for c in between]
        gap = distance - mine.radius - theirs.radius
        return gap, normal, sp.subtract(at, sp.scale(mine.radius, normal)), sp.add(foot, sp.scale(theirs.radius, normal))

    def _of_cores(self, a: BodyState, b: BodyState, centre: list[Any]) -> tuple[Any, list[Any], list[Any], list[Any]]:
        """Of two cores by an inner problem: of an ellipsoid, or of a cylinder or an end of it, with what is no ball."""
        mine: Any = self.spot
        theirs: Any = self.other
        middle = b.turned(theirs.at)
        between = sp.subtract(centre, sp.add(list(b.position), middle))
        forms = [(core.kind, core.half) for core in (mine, theirs)]
        apart, first, second = distance(forms, between, [mine.frame(a), theirs.frame(b)])
        away = sp.subtract(first, second)
        length = numpy.sqrt(sp.dot(away, away) + _LEAST)
        normal = [c / length for c in away]
        out = sp.subtract(sp.subtract(first, between), sp.scale(mine.radius, normal))
        return apart - mine.radius - theirs.radius, normal, out, sp.add(sp.add(middle, second), sp.scale(theirs.radius, normal))

    def _with_core(self, a: BodyState, b: BodyState, centre: list[Any]) -> tuple[Any, list[Any], list[Any], list[Any]]:
        """With the core of a box or capsule: the distance from its nearest point, which has one continuous derivative."""
        core: Any = self.other
        n = len(centre)

        def turned(v: list[Any]) -> list[Any]:
            return b.turned(v if core.turn is None else sp.apply(core.turn, v))

        def back(v: list[Any]) -> list[Any]:
            v = b.back(v)
            return v if core.turn is None else sp.back(core.turn, v)

        middle = b.turned(core.at)
        out: list[Any] = [0.0] * n
        radius = self.spot.radius
        if core.side is not None:
            axis, sign = core.side
            out, _ = _out(self.spot, a, turned([-sign if i == axis else 0.0 for i in range(n)]))
        place = back(sp.subtract(sp.add(centre, out), sp.add(list(b.position), middle)))
        near = nearest(core.kind, core.half, place)
        away = sp.subtract(place, near)
        # the least number keeps derivatives finite inside of the core, where the bodies overlap and are refused
        distance = numpy.sqrt(sp.dot(away, away) + _LEAST)
        normal = turned([c / distance for c in away])
        if core.side is None:
            out = sp.scale(-radius, normal)
        foot = sp.add(sp.add(middle, turned(near)), sp.scale(core.radius, normal))
        return distance - radius - core.radius, normal, out, foot


def separation_of(pair: _Pair, touches: list[_Touch], s: States) -> Any:
    """The distance of spheres around two bodies, or of one from a plane, which none of their gaps is less than. None where it is no cheaper than
    they are."""
    first = touches[0] if touches else None
    if first is None or (len(touches) == 1 and isinstance(first.spot, _Spot) and first.spot.squares is None and first.other is not None):
        return None
    at, reach = list(s[pair.a].position), pair.a._reach
    if isinstance(pair.b, Fixed):
        if len(touches) == 1:
            return None
        on = None if pair.b.on is None else s[pair.b.on]
        normal = list(pair.b.normal) if on is None else on.turned(pair.b.normal)
        way = at if on is None else sp.subtract(at, list(on.position))
        return sp.dot(normal, way) - reach - _value(pair.b.offset, s)
    way = sp.subtract(at, list(s[pair.b].position))
    return numpy.sqrt(sp.dot(way, way)) - (reach + pair.b._reach)


def expressions_of(touches: list[_Touch], s: States) -> list[tuple[Any, list[Any]]]:
    """Gaps and sliding velocities. Corners, edges and cores of one form are written together, as arrays, in space those of one pair: there may
    be very many."""
    out: list[Any] = [None] * len(touches)
    alike: dict[Any, list[int]] = {}
    for k, touch in enumerate(touches):
        form = _form_of(touch, s)
        if form is None:
            gap, _, sliding, _ = touch.geometry(s)
            out[k] = gap, sliding
        else:
            alike.setdefault(form, []).append(k)
    for places in alike.values():
        group = [touches[k] for k in places]
        first, ends = group[0], [[t.spot for t in group], [t.other for t in group]]
        many = replace(first, spot=_many(ends[0]), other=_many(ends[1]))
        if first.a.shapes:
            bodies = [s[first.a], s[first.b]]
        else:
            bodies = [_side_by_side([s[body] for body in those]) for those in ([t.a for t in group], [t.b for t in group])]
        gap, _, sliding, _ = many.measure(*bodies)
        for k, place in enumerate(places):
            out[place] = gap[k], [v[k] for v in sliding]
    return out


def _form_of(touch: _Touch, s: States) -> Any:
    """What contacts that are written together have in common; none of one that is written alone."""
    spot, other = touch.spot, touch.other
    if isinstance(spot, _Edge) and isinstance(other, _Edge):
        return touch.a.name, touch.b.name, spot.half, spot.radius, other.half, other.radius
    if not isinstance(other, _Core) or not isinstance(spot, _Spot):
        return None
    form = other.half, other.radius, other.side, spot.radius, str((spot.squares, spot.power))
    if touch.a.shapes:
        return touch.a.name, touch.b.name, str(other), form
    return *form, s[touch.a].angle is None, s[touch.b].angle is None


def _many(parts: list[Any]) -> Any:
    """Parts of one form as one with arrays for places and directions."""
    arrays = {"at": tuple(numpy.array([p.at for p in parts]).T)}
    if isinstance(parts[0], _Edge):
        arrays["along"] = tuple(numpy.array([p.along for p in parts]).T)
    return replace(parts[0], **arrays)


def _side_by_side(bodies: list[BodyState]) -> BodyState:
    """The states of several bodies in the plane, as one of arrays."""

    def together(parts: list[Any]) -> Any:
        if any(p is None for p in parts):
            return None
        return parts[0]._graph._expr(numpy.array([int(p._ids) for p in parts], dtype=numpy.int64))

    position, velocity = ([together([getattr(b, of)[i] for b in bodies]) for i in (0, 1)] for of in ("position", "velocity"))
    return BodyState(position, velocity, together([b.angle for b in bodies]), together([b.omega for b in bodies]))


def touches_of(pair: _Pair) -> list[_Touch]:
    """The contacts of two things.

    Two convex bodies of which one is a box or a capsule are nearest at a corner of one of them, or an edge of each: so a corner or an end
    of each is a contact with the core of the other. Where an ellipse is in it, the corners touch the ellipse, and each side the point of it
    that is deepest below. In space see `_in_space`.
    """
    a, b = pair.a, pair.b
    if isinstance(b, Fixed):
        return [_Touch(f"{_named(a, spot)}-{b.name}", a, spot, b, None, pair.mu, pair.e) for spot in a._spots]
    out: list[Any] = []
    if a.shapes:
        out = [touch for first in _solids_of(a) for second in _solids_of(b) for touch in _in_space(a, first, b, second)]
        return [_Touch(f"{_named(x, s)}-{_named(y, o)}", x, s, y, o, pair.mu, pair.e, n) for x, s, y, o, n in out]
    for first, mine in _shapes_of(a):
        for second, theirs in _shapes_of(b):
            size = _size(first + second)
            if not mine and not theirs:
                out += [(a, s, b, o, size) for s in first for o in second]
                continue
            out += [(a, s, b, c, size) for c in theirs for s in first if s.squares is None]
            out += [(b, s, a, c, size) for c in mine for s in second if s.squares is None]
            for body, spots, other, cores, corners in ((a, first, b, theirs, second), (b, second, a, mine, first)):
                bent = [s for s in spots if s.squares is not None]
                out += [(body, s, other, o, size) for s in bent if cores for o in corners]
                out += [(body, s, other, side, size) for s in bent for c in cores for side in _sides(c)]
    return [_Touch(f"{_named(x, s)}-{_named(y, o)}", x, s, y, o, pair.mu, pair.e, n) for x, s, y, o, n in out]


def _named(body: Body, part: _Spot | _Core) -> str:
    return f"{body.name} {part.name}".strip()


def _shapes_of(body: Body) -> list[tuple[list[_Spot], list[_Core]]]:
    """Spots of every shape of a body in the plane, and its core if it has one."""
    half = body._half
    return [(body._spots, [] if half is None else [_Core("side", (0.0, 0.0), half, body.radius)])]


@dataclass(frozen=True)
class _Solid:
    """A shape of a body in space: its kind, what of it touches the cores of others, and its own core, none of a ball."""

    kind: str
    spots: list[_Spot]
    core: _Core | None


def _solids_of(body: Body) -> list[_Solid]:
    out, begin = [], 0
    for n, shape in enumerate(body.shapes, 1):
        spots = body._spots[begin : begin + len(shape._spots)]
        begin += len(spots)
        turn = sp.constants(shape.turn)
        name = "side" if len(body.shapes) == 1 else f"{n} side"
        kind = shape.kind if shape.kind in ("cylinder", "ellipsoid") else "box"
        core = shape._half and _Core(name, tuple(shape.at), shape._half, shape.radius, None if turn == sp.EYE else turn, kind=kind)
        out.append(_Solid(shape.kind, [s for s in spots if s.rim is None], core or None))
    return out


def _in_space(a: Body, first: _Solid, b: Body, second: _Solid) -> list[Any]:
    """Contacts of two shapes in space.

    Balls and ellipsoids have one smooth gap with each other, and so has a ball with a core. Of a box and a capsule see `touches_of`: two edges
    may be nearest too. What is left has an inner problem:

    - An ellipsoid touches any core in one point.
    - A cylinder and another core have one gap for the whole, and one for each end of the cylinder. Where they touch along a line, its ends
      are on those, or at a corner. Where they touch in an area, points of the ends and corners are contacts that hold it.

    The least gap of all is that of the two shapes.
    """
    size = _size(first.spots + second.spots)
    mine, theirs = first.core, second.core
    bent = "ellipsoid" in (first.kind, second.kind)
    if bent and mine is not None and theirs is not None and first.kind != second.kind:
        return [(a, mine, b, theirs, size)]
    if bent or (mine is None and theirs is None):
        return [(a, s, b, o, size) for s in first.spots for o in second.spots]
    out: list[Any] = [(a, s, b, theirs, size) for s in first.spots if theirs is not None]
    out += [(b, s, a, mine, size) for s in second.spots if mine is not None]
    if mine is None or theirs is None:
        return out
    if "cylinder" not in (first.kind, second.kind):
        ours, others = (_edges_of(c, c.name.removesuffix("side").strip()) for c in (mine, theirs))
        return out + [(a, i, b, j, size) for i in ours for j in others]
    out.append((a, mine, b, theirs, size))
    out += [(a, end, b, theirs, size) for end in _ends(mine)]
    return out + [(b, end, a, mine, size) for end in _ends(theirs)]


def _ends(core: _Core) -> list[_Core]:
    """The two ends of a cylinder, which are cylinders without a length; none of others."""
    if core.kind != "cylinder":
        return []
    along = numpy.array([core.half[0], 0.0, 0.0])
    way = along if core.turn is None else numpy.array(core.turn) @ along
    name = core.name.removesuffix("side")
    return [
        replace(core, name=f"{name}{word}", at=tuple(sp.constants(numpy.array(core.at) + sign * way)), half=(0.0, *core.half[1:]))
        for word, sign in (("left", -1.0), ("right", 1.0))
    ]


def _sides(core: _Core) -> list[_Core]:
    words = (("left", "right"), ("lower", "upper"))
    return [
        _Core(f"{word} {core.name}", core.at, core.half, core.radius, core.turn, (axis, sign))
        for axis, pair in enumerate(words)
        for word, sign in zip(pair, (-1.0, 1.0))
        if any(h > 0.0 for i, h in enumerate(core.half) if i != axis)
    ]


def _size(spots: list[_Spot]) -> float:
    """A length of the order of shapes that are no points."""
    return max((float(numpy.sqrt(numpy.max(s.squares))) if s.squares is not None else s.radius for s in spots), default=0.0) or 1.0


def _edges_of(core: _Core, name: str) -> list[_Edge]:
    """Edges of a box in space, or the middle line of a capsule."""
    turn = numpy.eye(3) if core.turn is None else numpy.array(core.turn)
    middle, half = numpy.array(core.at), numpy.array(core.half)
    out = []
    for axis in range(3):
        others = [i for i in range(3) if i != axis]
        if half[axis] == 0.0:
            continue
        # corners of the section across, each once where the section is a point
        signs = [(i, j) for i in ((-1, 1) if half[others[0]] else (0,)) for j in ((-1, 1) if half[others[1]] else (0,))]
        for i, j in signs:
            place = numpy.zeros(3)
            place[others] = i * half[others[0]], j * half[others[1]]
            word = f"{name} {'xyz'[axis]}{'-+'[i > 0]}{'-+'[j > 0]} edge" if len(signs) > 1 else f"{name} edge"
            at, along = sp.constants(middle + turn @ place), sp.constants(turn[:, axis])
            out.append(_Edge(word.strip(), tuple(at), tuple(along), float(half[axis]), core.radius))
    return out


def _matrix(spot: _Spot, body: Any) -> Any:
    """The matrix of an ellipsoid in the axes of the world; none of a ball."""
    if spot.squares is None:
        return None
    n = len(spot.squares)
    columns = [body.turned([spot.squares[i][j] for i in range(n)]) for j in range(n)]
    # R S Rᵀ, as (R (R S)ᵀ)ᵀ, which is symmetric
    rows = [body.turned([columns[j][i] for j in range(n)]) for i in range(n)]
    return [[rows[min(i, j)][max(i, j)] for j in range(n)] for i in range(n)]


def _out(spot: _Spot, body: Any, direction: list[Any]) -> tuple[list[Any], Any]:
    """The way from the spot to the farthest point in the direction of a unit vector, and how far that is along it.

    Of an ellipsoid with the matrix S of squared semi-axes it is S d / sqrt(d . S d), the gradient of the support function."""
    if spot.squares is None and spot.rim is None:
        return sp.scale(spot.radius, direction), spot.radius
    d = body.back(direction)
    if spot.rim is not None:
        place, reach = spot.rim.farthest(d)
        return sp.add(body.turned(place), sp.scale(spot.radius, direction)), reach + spot.radius
    if spot.power is not None:
        place, reach = spot.power.farthest(d)
        return body.turned(place), reach
    support = sp.apply(spot.squares, d)
    reach = numpy.sqrt(sp.dot(d, support))
    return body.turned([c / reach for c in support]), reach

