"""Simulations and solutions of programs in JAX, differentiated by the adjoints of the library.

    import jax, switchback_control as swb, switchback_control.jax

    jax.config.update("jax_enable_x64", True)

    def loss(p):
        return ((swb.jax.simulate(model, x0, 2.0, p=p) - goal) ** 2).sum()

    jax.grad(loss)(p)

`simulate` is differentiated through switches and sliding modes, `solution` along the active set of a program with complementarity
constraints. Works under `jit`, `grad` and `vmap`, which simulates and differentiates on several threads. Numbers have the precision of `x0`: without x64 that is
single precision. Needs JAX: pip install jax.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy
from jax.custom_derivatives import SymbolicZero

from ._ffi import Sides
from ._flow import Flow
from .errors import ArgumentError, NumericError
from .mpcc import Mpcc, MpccResult

__all__ = ["KinkWarning", "simulate", "solution"]


class KinkWarning(UserWarning):
    """A gradient has derivatives that hold on one side only, or that are not known and NaN: the message says of which parameters."""


def simulate(
    system: Any, x0: Any, t_span: Any, *, p: Any = None, u: Any = None, at: Sequence[float] | None = None, **options: Any
) -> Any:
    """The state at the end of `t_span`, or where an event of `Model.stop_at` ends the run, [nx], or at the rising times `at`, [times, nx], as a function of initial state `x0`,
    parameters `p` and constant controls `u` that JAX can differentiate backwards, and forwards over that: `jax.jvp(jax.grad(loss), ...)` is the product of a Hessian with a direction, without `at`. `options` are those of `Integrator`.

    Errors: what `Integrator` raises, wrapped by JAX where it calls back; NumericError where the simulation ends early."""
    flow = Flow(system, t_span, at, options)
    state = jnp.asarray(x0)
    kind = state.dtype if jnp.issubdtype(state.dtype, jnp.floating) else jnp.result_type(float)
    inputs = tuple(jnp.asarray(v if v is not None else numpy.zeros(0), dtype=kind) for v in (state, p, u))
    shapes = [v.shape for v in inputs]
    ends = numpy.cumsum([0, *(v.size for v in inputs)])
    n, m = int(ends[-1]), math.prod(flow.shape)

    # every array that goes to a callback or comes from one costs as much as a short run: all numbers are in one. Under vmap it has dimensions before its own
    def called(work: Any, length: int, *parts: Any) -> Any:
        def call(given: Any) -> Any:
            rows = numpy.asarray(given)
            out = work(rows) if rows.ndim == 1 else work(rows.reshape((-1, rows.shape[-1]))).reshape((*rows.shape[:-1], length))
            return numpy.asarray(out, dtype=kind)

        packed = parts[0] if len(parts) == 1 else jnp.concatenate(parts)
        return jax.pure_callback(call, jax.ShapeDtypeStruct((length,), kind), packed, vmap_method="expand_dims")

    def split(z: Any) -> list[Any]:
        return [z[..., a:b] for a, b in zip(ends, ends[1:])]

    def run(z: Any) -> Any:
        return flow(*split(z)).ravel() if z.ndim == 1 else flow.several(*split(z))

    def back(both: Any) -> Any:
        w, z = both[..., :m], both[..., m:]
        found = flow.gradient(w, *split(z)) if z.ndim == 1 else flow.gradients(w, *split(z))
        return numpy.concatenate(found, axis=-1)

    def bend(all: Any) -> Any:
        # only single times have second derivatives
        def one(row: Any) -> Any:
            w, z, along = row[:m], row[m : m + n], row[m + n :]
            gradient, moved = flow.curvature(w, split(along), *split(z))
            return numpy.concatenate([*gradient, moved])

        return one(all) if all.ndim == 1 else numpy.array([one(row) for row in all]).reshape((len(all), n + m))

    def curvature(weights: Any, given: Any, direction: Any) -> tuple[Any, Any]:
        along = jnp.zeros_like(given) if isinstance(direction, SymbolicZero) else direction
        both = called(bend, n + m, weights, given, along)
        return both[:n], both[n:]

    @jax.custom_jvp
    def value(z: Any) -> Any:
        return called(run, m, z)

    @jax.custom_jvp
    def gradient(weights: Any, z: Any) -> Any:
        return called(back, n, weights, z)

    def value_along(given: Any, direction: Any) -> Any:
        return value(*given), curvature(jnp.zeros(m, kind), *given, *direction)[1]

    def gradient_along(given: Any, direction: Any) -> Any:
        (weights, z), (change, along) = given, direction
        bent = curvature(weights, z, along)[0]
        return gradient(weights, z), bent if isinstance(change, SymbolicZero) else bent + gradient(change, z)

    value.defjvp(value_along, symbolic_zeros=True)
    gradient.defjvp(gradient_along, symbolic_zeros=True)

    @jax.custom_vjp
    def end(z: Any) -> Any:
        return value(z)

    def forward(z: Any) -> Any:
        return value(z), z

    def backward(z: Any, weights: Any) -> Any:
        return (gradient(weights, z),)

    end.defvjp(forward, backward)
    return end(jnp.concatenate([v.ravel() for v in inputs])).reshape(flow.shape)


class _Solutions:
    """A program at parameters: solved again only where these are others, or someone else has solved it."""

    def __init__(self, program: Mpcc, kinks: str):
        if not isinstance(program, Mpcc):
            raise ArgumentError(f"program must be an Mpcc or Nlp, not {type(program).__name__}")
        if kinks not in ("warn", "error"):
            raise ArgumentError(f"kinks must be 'warn' or 'error', not {kinks!r:.40}")
        self.program, self.kinks = program, kinks
        self.p: Any = None
        self.last: Any = None

    def at(self, p: Any) -> MpccResult:
        program, now = self.program, None
        if self.last is not None:
            now = numpy.empty(program.n)
            program._do("get_solution", now.ctypes.data, program.n)
        if now is None or not (numpy.array_equal(p, self.p) and numpy.array_equal(now, self.last.x)):
            self.last = None
            program.set_params(p)
            found = program.solve()
            if not found.success:
                raise NumericError(f"the program has no solution at these parameters: {found!r}")
            self.p, self.last = numpy.array(p), found
        return self.last

    def value(self, p: Any) -> Any:
        found = self.at(p)
        return numpy.append(found.x, found.objective)

    def gradient(self, p: Any, weights: Any) -> Any:
        self.at(p)
        found = self.program.vjp(weights[:-1], weights[-1])
        kinked = [k for k, s in enumerate(found.sides) if s != Sides.BOTH]
        if kinked:
            text = ", ".join(f"{k} ({found.sides[k].name.lower()})" for k in kinked[:5]) + ", ..." * (len(kinked) > 5)
            text = f"the solution has a kink: derivatives hold on one side, or are NaN on neither, for the parameters {text}"
            if self.kinks == "error":
                raise NumericError(text)
            warnings.warn(text, KinkWarning, stacklevel=2)
        return found.p


def solution(program: Mpcc, p: Any, *, kinks: str = "warn") -> tuple[Any, Any]:
    """The solution x [n] of a program and its objective, as functions of the parameters `p` [np] that JAX can differentiate backwards.

    A solve begins at the start that the program was given, so that the same p has the same solution. The program keeps the
    parameters, and must not be used elsewhere at the same time. Where bounds or pairs are active without a multiplier the
    gradient holds on one side of some parameters, and a `KinkWarning` says of which; it is NaN where nothing is known. `kinks="error"` makes an
    error of both.

    Errors: NumericError where the program has no solution, or none that is isolated; StateError where it is not exact. JAX wraps
    them where it calls back."""
    held = _Solutions(program, kinks)
    array = jnp.asarray(p)
    kind = array.dtype if jnp.issubdtype(array.dtype, jnp.floating) else jnp.result_type(float)
    array = array.astype(kind).ravel()
    n, np = program.n, program.np

    def called(work: Any, length: int, *given: Any) -> Any:
        def call(*rows: Any) -> Any:
            return numpy.asarray(work(*(numpy.asarray(r, float) for r in rows)), dtype=kind)

        return jax.pure_callback(call, jax.ShapeDtypeStruct((length,), kind), *given, vmap_method="sequential")

    @jax.custom_vjp
    def both(z: Any) -> Any:
        return called(held.value, n + 1, z)

    def forward(z: Any) -> Any:
        return both(z), z

    def backward(z: Any, weights: Any) -> Any:
        return (called(held.gradient, np, z, weights),)

    both.defvjp(forward, backward)
    found = both(array)
    return found[:n], found[n]
