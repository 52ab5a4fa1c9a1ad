"""Polynomials in pieces: what is left of a trajectory when the library's object is gone."""

from __future__ import annotations

from collections.abc import Callable

import numpy
from numpy.polynomial import chebyshev

from ._arrays import Array
from .errors import RangeError

__all__ = ["Pieces"]


class Pieces:
    """Values over time, a polynomial between two breaks, as Chebyshev coefficients [pieces, degree + 1, width].

    They are exact for polynomials up to the degree, and interpolate other functions that are smooth between the breaks. At a
    break the piece before it counts.
    """

    def __init__(self, breaks: Array, coefficients: Array):
        self.breaks, self.coefficients = breaks, coefficients

    @classmethod
    def of(cls, f: Callable[[Array], Array], breaks: Array, degree: int) -> Pieces:
        """Of a function that takes times inside of the pieces and returns a row for each."""
        nodes = chebyshev.chebpts1(degree + 1)
        middle, half = 0.5 * (breaks[1:] + breaks[:-1]), 0.5 * numpy.diff(breaks)
        times = numpy.clip(middle[:, None] + half[:, None] * nodes, breaks[:-1, None], breaks[1:, None])
        values = f(times.ravel()).reshape(len(middle), degree + 1, -1)
        # Chebyshev polynomials are orthogonal over these nodes
        basis = chebyshev.chebvander(nodes, degree) * numpy.where(numpy.arange(degree + 1) == 0, 1.0, 2.0) / (degree + 1)
        return cls(breaks, numpy.einsum("ij,pik->pjk", basis, values))

    def __call__(self, t: Array, k: int = 0) -> Array:
        """Values, or `k`-th derivatives, at times: [n, width]."""
        if t.size and not (t.min() >= self.breaks[0] and t.max() <= self.breaks[-1]):
            raise RangeError(f"times must lie between {self.breaks[0]:g} and {self.breaks[-1]:g}")
        piece = numpy.clip(numpy.searchsorted(self.breaks, t, side="left") - 1, 0, len(self.coefficients) - 1)
        length = self.breaks[piece + 1] - self.breaks[piece]
        safe = numpy.where(length > 0.0, length, 1.0)
        place = numpy.clip(2.0 * (t - self.breaks[piece]) / safe - 1.0, -1.0, 1.0)
        c = self.coefficients if k == 0 else chebyshev.chebder(self.coefficients, k, axis=1)
        basis = chebyshev.chebvander(place, c.shape[1] - 1)
        return numpy.einsum("nj,njw->nw", basis, c[piece]) * (2.0 / safe[:, None]) ** k
