"""Vectors and rotations in space as nested lists: of expressions, of numbers, and of arrays over times, by the same lines.

What is known to be zero or one is left out while expressions are written, so a hinge along an axis costs what it must.
"""

from __future__ import annotations

import math
from typing import Any

import numpy

Vector = list[Any]
Matrix = list[list[Any]]

ZERO: Vector = [0.0, 0.0, 0.0]
EYE: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]


def _is(a: Any, value: float) -> bool:
    return isinstance(a, (int, float)) and a == value


def plus(a: Any, b: Any) -> Any:
    return b if _is(a, 0.0) else a if _is(b, 0.0) else a + b


def minus(a: Any, b: Any) -> Any:
    return a if _is(b, 0.0) else -b if _is(a, 0.0) else a - b


def times(a: Any, b: Any) -> Any:
    if _is(a, 0.0) or _is(b, 0.0):
        return 0.0
    if _is(a, 1.0):
        return b
    if _is(b, 1.0):
        return a
    return -b if _is(a, -1.0) else -a if _is(b, -1.0) else a * b


def add(*vectors: Vector) -> Vector:
    out = list(vectors[0])
    for v in vectors[1:]:
        out = [plus(a, b) for a, b in zip(out, v)]
    return out


def subtract(a: Vector, b: Vector) -> Vector:
    return [minus(i, j) for i, j in zip(a, b)]


def scale(factor: Any, a: Vector) -> Vector:
    return [times(factor, i) for i in a]


def dot(a: Vector, b: Vector) -> Any:
    out: Any = 0.0
    for i, j in zip(a, b):
        out = plus(out, times(i, j))
    return out


def cross(a: Vector, b: Vector) -> Vector:
    return [
        minus(times(a[1], b[2]), times(a[2], b[1])),
        minus(times(a[2], b[0]), times(a[0], b[2])),
        minus(times(a[0], b[1]), times(a[1], b[0])),
    ]


def apply(m: Matrix, a: Vector) -> Vector:
    return [dot(row, a) for row in m]


def back(m: Matrix, a: Vector) -> Vector:
    """The transposed matrix times a vector."""
    return [dot([m[j][i] for j in range(3)], a) for i in range(3)]


def transposed(m: Matrix) -> Matrix:
    return [[m[j][i] for j in range(3)] for i in range(3)]


def product(a: Matrix, b: Matrix) -> Matrix:
    columns = transposed(b)
    return [[dot(row, column) for column in columns] for row in a]


def constants(m: Any) -> Any:
    """Numbers of a vector or a matrix as lists, what is rounding next to the largest as zero and one exactly."""
    a = numpy.array(m, dtype=float)
    near = 8.0 * numpy.finfo(float).eps * max(float(numpy.max(numpy.abs(a))), 1e-300)
    a[numpy.abs(a) <= near] = 0.0
    a[numpy.abs(a - 1.0) <= near] = 1.0
    a[numpy.abs(a + 1.0) <= near] = -1.0
    return a.tolist()


def about(axis: Vector, c: Any, s: Any) -> Matrix:
    """Rodrigues' rotation about a unit vector of numbers, by an angle of cosine `c` and sine `s`."""
    k = numpy.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    once, twice = constants(k), constants(k @ k)
    versine = minus(1.0, c)
    # along an axis of coordinates 1 - (1 - c) is c itself
    return [
        [
            c if i == j and _is(twice[i][j], -1.0) else plus(
                plus(EYE[i][j], times(once[i][j], s)), times(twice[i][j], versine)
            )
            for j in range(3)
        ]
        for i in range(3)
    ]  # fmt: skip


def of_quaternion(q: Vector) -> Matrix:
    """The rotation of a quaternion (w, x, y, z) of any length but zero: q and 2 q are the same rotation.

    So its length, which rounding and tolerances move, is not in what it means: nothing has to hold it at one.
    """
    w, x, y, z = q
    f = 2.0 / (w * w + x * x + y * y + z * z)
    fx, fy, fz = f * x, f * y, f * z
    return [
        [1.0 - (fy * y + fz * z), fx * y - fz * w, fx * z + fy * w],
        [fx * y + fz * w, 1.0 - (fx * x + fz * z), fy * z - fx * w],
        [fx * z - fy * w, fy * z + fx * w, 1.0 - (fx * x + fy * y)],
    ]


def quaternion_rates(q: Vector, omega: Vector) -> Vector:
    """Rates of a quaternion of any length, for an angular velocity along the axes of the body."""
    w, x, y, z = q
    a, b, c = (0.5 * o for o in omega)
    return [
        -(x * a + y * b + z * c),
        w * a + y * c - z * b,
        w * b + z * a - x * c,
        w * c + x * b - y * a,
    ]


def quaternion_of(m: Any) -> list[float]:
    """The unit quaternion of a rotation of numbers (S. W. Shepperd, Quaternion from rotation matrix, 1978)."""
    m = numpy.asarray(m, dtype=float)
    squares = numpy.array(
        [
            1.0 + m[0, 0] + m[1, 1] + m[2, 2],
            1.0 + m[0, 0] - m[1, 1] - m[2, 2],
            1.0 - m[0, 0] + m[1, 1] - m[2, 2],
            1.0 - m[0, 0] - m[1, 1] + m[2, 2],
        ]
    )
    a, b, c = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
    d, e, f = m[1, 0] + m[0, 1], m[0, 2] + m[2, 0], m[2, 1] + m[1, 2]
    k = int(numpy.argmax(squares))
    rows = [[squares[0], a, b, c], [a, squares[1], d, e], [b, d, squares[2], f], [c, e, f, squares[3]]]
    q = numpy.array(rows[k])
    q /= numpy.linalg.norm(q)
    return (q if q[0] >= 0.0 else -q).tolist()


def of_angles(roll: float, pitch: float, yaw: float) -> Matrix:
    """Turned about the fixed x, y and z axes, one after the other."""
    out = numpy.eye(3)
    for axis, angle in (([1.0, 0, 0], roll), ([0, 1.0, 0], pitch), ([0, 0, 1.0], yaw)):
        out = numpy.array(about([float(i) for i in axis], math.cos(angle), math.sin(angle))) @ out
    return constants(out)


def perpendicular(normal: Any) -> list[list[float]]:
    """Two unit vectors of numbers, perpendicular to a third and to each other; the three are right-handed."""
    n = numpy.array(normal, dtype=float)
    k = int(numpy.argmin(numpy.abs(n)))
    a = numpy.eye(3)[k] - n[k] * n
    a /= numpy.linalg.norm(a)
    return [a.tolist(), numpy.cross(n, a).tolist()]


# No frame of tangents is smooth for every direction of a normal. This one is smooth but for the opposite of the direction
# below, which is along no axis, diagonal or simple fraction of one, so that arrangements that people make do not meet it.
_POLE = numpy.array([0.2741, 0.5103, 0.8151]) / numpy.linalg.norm([0.2741, 0.5103, 0.8151])
_POLE_FRAME = perpendicular(_POLE)


def tangents_of(normal: Vector) -> list[Vector]:
    """Two unit vectors perpendicular to a unit vector of expressions: those of the pole, turned with it to the normal."""
    pole = _POLE.tolist()
    both = [i + j for i, j in zip(pole, normal)]
    share = 1.0 / (1.0 + dot(pole, normal))
    out = []
    for t in _POLE_FRAME:
        along = share * dot(normal, t)
        out.append([i - along * j for i, j in zip(t, both)])
    return out
