"""Simulations in JAX programs, differentiated by the adjoint of the library through switches and sliding modes.

    import jax, switchback_control as swb, switchback_control.jax

    jax.config.update("jax_enable_x64", True)

    def loss(p):
        return ((swb.jax.simulate(model, x0, 2.0, p=p) - goal) ** 2).sum()

    jax.grad(loss)(p)

Works under `jit`, `grad` and `vmap`, which simulates and differentiates on several threads. Numbers have the precision of `x0`: without x64 that is
single precision. Needs JAX: pip install jax.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy
from jax.custom_derivatives import SymbolicZero

from ._flow import Flow

__all__ = ["simulate"]


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
    result = jax.ShapeDtypeStruct(flow.shape, kind)
    places = tuple(jax.ShapeDtypeStruct(v.shape, kind) for v in inputs)

    def rows(dims: int, *given: Any) -> tuple[tuple[int, ...], list[Any]]:
        """Under vmap there are dimensions before the own ones, which the first array has `dims` of; of length one where an array has none. All of them, and
        the arrays with one in their place."""
        own = [dims] + [1] * (len(given) - 1)
        many = numpy.broadcast_shapes(*(numpy.shape(v)[: numpy.ndim(v) - k] for v, k in zip(given, own)))
        shapes = [numpy.shape(v)[numpy.ndim(v) - k :] for v, k in zip(given, own)]
        return many, [numpy.broadcast_to(v, (*many, *s)).reshape((math.prod(many), *s)) for v, s in zip(given, shapes)]

    def run(*given: Any) -> Any:
        many, flat = rows(1, *given)
        values = flow.several(*flat) if many else flow(*given)
        return numpy.asarray(values, dtype=kind).reshape((*many, *flow.shape))

    def back(weights: Any, *given: Any) -> Any:
        many, flat = rows(len(flow.shape), weights, *given)
        parts = flow.gradients(*flat) if many else flow.gradient(weights, *given)
        return tuple(numpy.asarray(g, dtype=kind).reshape((*many, *place.shape)) for g, place in zip(parts, places))

    def bend(weights: Any, *both: Any) -> Any:
        # the own dimension of every one is the last: only single times have second derivatives
        many, flat = rows(1, weights, *both)
        each = [flow.curvature(w, row[3:], *row[:3]) for w, *row in zip(*flat)]
        parts = [numpy.array([e[0][k] for e in each]) for k in range(3)] + [numpy.array([e[1] for e in each])]
        shapes = [place.shape for place in places] + [flow.shape]
        return tuple(numpy.asarray(part, dtype=kind).reshape((*many, *shape)) for part, shape in zip(parts, shapes))

    def curvature(weights: Any, given: Any, direction: Any) -> Any:
        full = [jnp.zeros_like(g) if isinstance(d, SymbolicZero) else d for g, d in zip(given, direction)]
        return jax.pure_callback(bend, (*places, result), weights, *given, *full, vmap_method="expand_dims")

    @jax.custom_jvp
    def value(*given: Any) -> Any:
        return jax.pure_callback(run, result, *given, vmap_method="expand_dims")

    @jax.custom_jvp
    def gradient(weights: Any, *given: Any) -> Any:
        return jax.pure_callback(back, places, weights, *given, vmap_method="expand_dims")

    def value_along(given: Any, direction: Any) -> Any:
        return value(*given), curvature(jnp.zeros(flow.shape, kind), given, direction)[3]

    def gradient_along(given: Any, direction: Any) -> Any:
        (weights, *inputs), (change, *along) = given, direction
        bent = curvature(weights, inputs, along)[:3]
        own = bent if isinstance(change, SymbolicZero) else tuple(a + b for a, b in zip(bent, gradient(change, *inputs)))
        return gradient(weights, *inputs), own

    value.defjvp(value_along, symbolic_zeros=True)
    gradient.defjvp(gradient_along, symbolic_zeros=True)

    @jax.custom_vjp
    def end(*given: Any) -> Any:
        return value(*given)

    def forward(*given: Any) -> Any:
        return value(*given), given

    def backward(given: Any, weights: Any) -> Any:
        return gradient(weights, *given)

    end.defvjp(forward, backward)
    return end(*inputs)
