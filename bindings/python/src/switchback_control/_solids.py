"""Distances of convex bodies in space that have no closed form, by the point between them."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy

from . import _spatial as sp
from .expr import Expr, Graph, _graph_among, implicit, inner_minimum, table
from .function import Function

# For points p of A and q of B and any x, |p - q|² <= 2 (|p - x|² + |x - q|²), and equality where x is in the middle. So
#
#     distance(A, B)² = 2 min over x of (distance(x, A)² + distance(x, B)²).
#
# Squares of distances of points from convex bodies are convex with one continuous derivative, so Newton's method with descent finds the least
# value. Its derivative is that of the cost at x (envelope theorem), and is continuous too. See Bauschke and Combettes, Convex Analysis and Monotone
# Operator Theory, corollary 12.31 and example 12.32. Bodies with flat sides or straight lines may have many such points: the nearest of them to a first guess is taken.

_ALIKE = 1e-9  # weight of the way from the first guess, next to one of each square
_ROUNDS = 2  # projections to each body for the first guess; Newton's method does the rest
_LEAST = 1e-300  # nothing next to the square of any length


def clamped(a: Any, half: float) -> Any:
    """The nearest value between minus and plus a half width."""
    if half == 0.0:
        return 0.0
    return table(a, [-half, half], [-half, half], "lines") if isinstance(a, Expr) else numpy.clip(a, -half, half)


def _rim(place: list[Any], radius: float) -> Any:
    """The larger one of the radius and the distance of a place from the first axis."""
    square, half = place[1] * place[1] + place[2] * place[2], 0.5 * radius * radius
    return numpy.sqrt(square + half - clamped(square - half, half))


def nearest(kind: str, half: tuple[float, ...], place: list[Any]) -> list[Any]:
    """The point of a body that is nearest to a place in its axes.

    kind, half   "box" and its half widths; "cylinder" along the first axis, half of its length and twice its radius; "ellipsoid" and its
                 semi-axes, of expressions alone
    """
    if kind == "box":
        return [clamped(c, h) for c, h in zip(place, half)]
    if kind == "cylinder":
        share = half[1] / _rim(place, half[1])
        return [clamped(place[0], half[0]), share * place[1], share * place[2]]
    # It is s x / (s + r) by components, with squares s of the semi-axes, and r >= 0 is the solution of |x sqrt(s) / (s + r)| = 1. The inverse of that
    # length is concave in r, so that Newton's method from r = 0 neither goes too far nor back (Moré and Sorensen 1983). Where x is inside, it has
    # a further component that puts it on the surface, where r is zero.
    squares = [h * h for h in half]
    least = min(squares)
    far = sum(c * c / s for c, s in zip(place, squares))
    missing = 0.5 - clamped(far - 0.5, 0.5)

    def equation(w: Any) -> Any:
        r = least * (w - 1.0)
        length = sum(s * (c / (s + r)) ** 2 for c, s in zip(place, squares)) + missing / (w * w)
        return 1.0 / numpy.sqrt(length) - 1.0

    r = least * (implicit(equation, start=1.0, graph=_graph_among(place)) - 1.0)
    return [s * c / (s + r) for c, s in zip(place, squares)]


def _square(kind: str, half: tuple[float, ...], place: list[Any]) -> Any:
    """The square of the distance of a place from a body."""
    if kind == "cylinder":
        along, across = sp.minus(place[0], clamped(place[0], half[0])), _rim(place, half[1]) - half[1]
        return along * along + across * across
    away = sp.subtract(place, nearest(kind, half, place))
    return sp.dot(away, away)


def _distance(forms: list[Any], between: list[Any], frames: list[Any]) -> list[Any]:
    """See `distance`, for expressions."""

    def there(x: list[Any]) -> list[Any]:
        return sp.back(frames[0], sp.subtract(x, between))

    def on_first(x: list[Any]) -> list[Any]:
        return sp.add(between, sp.apply(frames[0], nearest(*forms[0], there(x))))

    def on_second(x: list[Any]) -> list[Any]:
        return sp.apply(frames[1], nearest(*forms[1], sp.back(frames[1], x)))

    first = on_first(between)
    for _ in range(_ROUNDS):
        second = on_second(first)
        first = on_first(second)
    guess = [0.5 * (i + j) for i, j in zip(first, second)]

    def cost(w: Any) -> Any:
        x = list(w)
        off = sp.subtract(x, guess)
        return _square(*forms[0], there(x)) + _square(*forms[1], sp.back(frames[1], x)) + _ALIKE * sp.dot(off, off)

    least, found = inner_minimum(cost, start=guess)
    x = list(found)
    return [numpy.sqrt(2.0 * least + _LEAST), *on_first(x), *on_second(x)]


@lru_cache(maxsize=64)
def _numbers(forms: tuple[Any, ...]) -> Function:
    g = Graph()
    x = g.inputs("x", 21)
    frames = [[[x[k + 3 * i + j] for j in range(3)] for i in range(3)] for k in (3, 12)]
    return g.function(_distance(list(forms), [x[i] for i in range(3)], frames), nx=x.size, name="distance")


def distance(forms: list[Any], between: list[Any], frames: list[Any]) -> tuple[Any, list[Any], list[Any]]:
    """Distance of two bodies, and their nearest points, from the centre of the second along the axes of the world.

    forms     kind and half widths of each, as in `nearest`
    between   the way from the centre of the second body to that of the first
    frames    the rotation of each as rows

    Expressions, or arrays of numbers. Bodies that overlap have no distance: it is nearly zero then.
    """
    if _graph_among((between, *frames)) is not None:
        out = _distance(forms, between, frames)
    else:
        parts = [*between, *(c for frame in frames for row in frame for c in row)]
        columns = numpy.broadcast_arrays(*[numpy.asarray(c, dtype=float) for c in parts])
        points = numpy.stack(columns, axis=-1)
        f = _numbers(tuple(forms))
        values = numpy.array([f(x) for x in points.reshape(-1, len(parts))]).reshape(*points.shape[:-1], 7)
        out = [values[..., i] for i in range(7)]
    return out[0], out[1:4], out[4:]
