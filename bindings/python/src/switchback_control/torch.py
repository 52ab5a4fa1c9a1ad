"""Simulations in PyTorch programs, differentiated by the adjoint of the library through switches and sliding modes.

    import torch, switchback_control as swb, switchback_control.torch

    p = torch.tensor([1.0], dtype=torch.float64, requires_grad=True)
    loss = ((swb.torch.simulate(model, x0, 2.0, p=p) - goal) ** 2).sum()
    loss.backward()

Simulations run on the processor, in double precision; results have the type and the device of `x0`. Needs PyTorch: pip install torch.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch

from ._flow import Flow

__all__ = ["simulate"]


class _Simulation(torch.autograd.Function):
    @staticmethod
    def forward(context: Any, flow: Flow, *inputs: Any) -> Any:
        context.flow = flow
        context.save_for_backward(*inputs)
        return inputs[0].new_tensor(flow(*(v.detach().cpu().numpy() for v in inputs)))

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(context: Any, weights: Any) -> Any:
        inputs = context.saved_tensors
        parts = context.flow.gradient(weights.detach().cpu().numpy(), *(v.detach().cpu().numpy() for v in inputs))
        return None, *(v.new_tensor(g).reshape(v.shape) for v, g in zip(inputs, parts))


def simulate(
    system: Any, x0: Any, t_span: Any, *, p: Any = None, u: Any = None, at: Sequence[float] | None = None, **options: Any
) -> Any:
    """The state at the end of `t_span`, [nx], or at the rising times `at`, [times, nx], as a function of initial state `x0`,
    parameters `p` and constant controls `u` that PyTorch can differentiate once. `options` are those of `Integrator`.

    Errors: what `Integrator` raises; NumericError where the simulation ends early."""
    state = x0 if isinstance(x0, torch.Tensor) else torch.tensor(x0, dtype=torch.float64)
    rest = [state.new_zeros(0) if v is None else torch.as_tensor(v, dtype=state.dtype, device=state.device) for v in (p, u)]
    return _Simulation.apply(Flow(system, t_span, at, options), state, *rest)
