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

from ._flow import Flow

__all__ = ["simulate"]


def simulate(
    system: Any, x0: Any, t_span: Any, *, p: Any = None, u: Any = None, at: Sequence[float] | None = None, **options: Any
) -> Any:
    """The state at the end of `t_span`, or where an event of `Model.stop_at` ends the run, [nx], or at the rising times `at`, [times, nx], as a function of initial state `x0`,
    parameters `p` and constant controls `u` that JAX can differentiate once, backwards. `options` are those of `Integrator`.

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

    @jax.custom_vjp
    def end(*given: Any) -> Any:
        return jax.pure_callback(run, result, *given, vmap_method="expand_dims")

    def forward(*given: Any) -> Any:
        return end(*given), given

    def backward(given: Any, weights: Any) -> Any:
        return jax.pure_callback(back, places, weights, *given, vmap_method="expand_dims")

    end.defvjp(forward, backward)
    return end(*inputs)
