"""Simulations in JAX programs, differentiated by the adjoint of the library through switches and sliding modes.

    import jax, switchback_control as swb, switchback_control.jax

    jax.config.update("jax_enable_x64", True)

    def loss(p):
        return ((swb.jax.simulate(model, x0, 2.0, p=p) - goal) ** 2).sum()

    jax.grad(loss)(p)

Works under `jit`, `grad` and `vmap`, which simulates on several threads; gradients of many are made one after the other. Numbers have the precision of `x0`: without x64 that is
single precision. Needs JAX: pip install jax.
"""

from __future__ import annotations

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

    def run(*given: Any) -> Any:
        shapes = [numpy.shape(v)[:-1] for v in given]
        if not any(shapes):
            return numpy.asarray(flow(*given), dtype=kind)
        # under vmap: dimensions in front, of length one where an input has none of its own
        many = numpy.broadcast_shapes(*shapes)
        flat = [numpy.broadcast_to(v, (*many, numpy.shape(v)[-1])).reshape(-1, numpy.shape(v)[-1]) for v in given]
        return numpy.asarray(flow.several(*flat), dtype=kind).reshape((*many, *flow.shape))

    def back(weights: Any, *given: Any) -> Any:
        parts = flow.gradient(weights, *given)
        return tuple(numpy.asarray(g, dtype=kind).reshape(place.shape) for g, place in zip(parts, places))

    @jax.custom_vjp
    def end(*given: Any) -> Any:
        return jax.pure_callback(run, result, *given, vmap_method="expand_dims")

    def forward(*given: Any) -> Any:
        return end(*given), given

    def backward(given: Any, weights: Any) -> Any:
        return jax.pure_callback(back, places, weights, *given, vmap_method="sequential")

    end.defvjp(forward, backward)
    return end(*inputs)
