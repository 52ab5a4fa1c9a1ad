"""Gradients of simulations in JAX and PyTorch: those of the adjoint, and of finite differences."""

import numpy as np
import pytest

import switchback_control as swb
from switchback_control._flow import Flow
from switchback_control.expr import Model, sign, where

X0, P, U, T = np.array([1.0, 0.2]), np.array([1.3, 0.3]), np.array([0.2]), 4.0
OPTIONS = {"rtol": 1e-11, "atol": 1e-12}
AT = [0.0, 1.5, 4.0]


def spring():
    """A spring with friction that holds at the end, and a push where q > 0.5."""
    m = Model(states="q v", controls="F", parameters="k mu")
    m.derivatives = [m.v, -m.k * m.q - m.mu * sign(m.v) + where(m.q > 0.5, m.F, 0)]
    return m


def adjoint(weights):
    """Gradient by the adjoint engine itself, for weights of the states at the end."""
    with swb.Integrator(spring(), adjoint=1, **OPTIONS) as i:
        i.set_params(P)
        i.set_controls(U)
        i.reinit(X0)
        i.advance(T)
        assert len(i.run.switches) > 1
        return i.adjoint(weights)


def test_a_flow_has_the_gradient_of_differences():
    flow = Flow(spring(), T, AT, OPTIONS)
    weights = np.array([[1.0, 2.0], [0.5, -1.0], [2.0, 1.0]])
    values = flow(X0, P, U)
    assert values.shape == (3, 2) and np.array_equal(values[0], X0)
    found = np.concatenate(flow.gradient(weights, X0, P, U))
    at = np.concatenate([X0, P, U])

    def total(z):
        return (flow(z[:2], z[2:4], z[4:]) * weights).sum()

    h = 1e-5
    differences = [(total(at + h * e) - total(at - h * e)) / (2 * h) for e in np.eye(5)]
    assert found == pytest.approx(differences, rel=1e-6, abs=1e-6)
    assert np.array_equal(np.concatenate(flow.gradient(weights, X0, P, U)), found)  # made again, for it was used up


def test_many_flows_are_single_ones():
    flow = Flow(spring(), T, None, OPTIONS)
    x0, p = np.array([X0, 2 * X0, -X0]), np.array([P, 1.1 * P, 0.9 * P])
    u = np.tile(U, (3, 1))
    each = [flow(*one) for one in zip(x0, p, u)]
    assert np.allclose(flow.several(x0, p, u), each, atol=1e-8)  # steps of single ones are limited by derivatives, too
    assert np.array_equal(Flow(spring(), T, AT, OPTIONS).several(x0, p, u)[:, -1], [Flow(spring(), T, AT, OPTIONS)(*one)[-1] for one in zip(x0, p, u)])
    one_each = Flow(spring(), T, None, {"rtol": [1e-11] * 2, "atol": 1e-12})
    assert np.allclose(one_each.several(x0, p, u), each, atol=1e-8)
    with pytest.raises(swb.NumericError, match="simulation 1 ended"):
        Flow(swb.System(1, f0=lambda x: [x[0] ** 2]), 2.0, None, {}).several([[0.1], [1.0]], np.empty((2, 0)), np.empty((2, 0)))


def test_gradients_of_many_are_those_of_single_ones():
    flow = Flow(spring(), T, None, OPTIONS)
    x0, p, w = np.array([X0, 2 * X0, -X0]), np.array([P, 1.1 * P, 0.9 * P]), np.array([[1.0, 2.0], [0.5, -1.0], [0.0, 1.0]])
    each = [flow.gradient(*one, U) for one in zip(w, x0, p)]
    for found, exact in zip(flow.gradients(w, x0, p, np.tile(U, (3, 1))), zip(*each)):
        assert np.array_equal(found, exact)
    assert len(flow._free) >= 1  # simulations that are not asked any more serve the next ones
    slow = Flow(swb.System(1, f0=lambda x: [-x[0]]), 1.0, None, OPTIONS)  # Python is called by one thread
    assert slow.gradients([[1.0], [2.0]], [[1.0], [1.0]], np.empty((2, 0)), np.empty((2, 0))).x0.ravel() == pytest.approx(
        [np.exp(-1), 2 * np.exp(-1)]
    )


def test_a_flow_ends_at_an_event():
    m = Model(states="y v", parameters="c")
    m.derivatives = [m.v, m.c * m.v**2 - 9.81]
    m.stop_at(m.y < 0)
    flow = Flow(m, 100.0, None, OPTIONS)
    speed = lambda c: flow([10.0, 0.0], [c], [])[1]
    found = flow.gradient([0.0, 1.0], [10.0, 0.0], [0.1], [])
    assert found.p[0] == pytest.approx((speed(0.1 + 1e-5) - speed(0.1 - 1e-5)) / 2e-5, rel=1e-7)
    with pytest.raises(swb.NumericError, match="ended at t = "):
        Flow(m, 100.0, [50.0, 100.0], OPTIONS)([10.0, 0.0], [0.1], [])


def test_derivatives_in_a_direction():
    run = swb.simulate(spring(), X0, T, p=P, u=U, sensitivity=True, **OPTIONS)
    dx0, dp, du = np.array([0.3, -0.2]), np.array([0.1, 0.05]), np.array([0.2])
    end = lambda h: swb.simulate(spring(), X0 + h * dx0, T, p=P + h * dp, u=U + h * du, **OPTIONS).x_end
    h = 1e-5
    assert run.jvp(dx0, dp, du) == pytest.approx((end(h) - end(-h)) / (2 * h), rel=1e-6, abs=1e-7)
    assert np.array_equal(run.jvp(p={"k": 1, "mu": 0}), run.dx_dp[:, 0]) and not run.jvp().any()
    inputs = swb.simulate(spring(), X0, T, p=P, u=U, sensitivity="inputs")
    with pytest.raises(swb.StateError, match="by x0"):
        inputs.jvp(x0=dx0)
    with pytest.raises(swb.DimensionError):
        run.jvp(p=[1.0])


def test_the_derivative_of_a_gradient_is_that_of_differences():
    flow, weights = Flow(spring(), T, None, OPTIONS), np.array([1.0, -2.0])
    turn, h = (np.array([0.3, -0.2]), np.array([0.1, 0.05]), np.array([0.2])), 1e-4
    found, state = flow.curvature(weights, turn, X0, P, U)
    at = lambda by: [v + by * h * d for v, d in zip((X0, P, U), turn)]
    a, b, c, d = (np.concatenate(flow.gradient(weights, *at(by))) for by in (-2, -1, 1, 2))
    assert np.concatenate(found) == pytest.approx((a - 8 * b + 8 * c - d) / (12 * h), rel=1e-6, abs=1e-6)
    assert state == pytest.approx((flow(*at(1)) - flow(*at(-1))) / (2 * h), rel=1e-6, abs=1e-7)
    with pytest.raises(swb.ArgumentError, match="leave out at"):
        Flow(spring(), T, AT, OPTIONS).curvature(weights, turn, X0, P, U)
    with swb.Integrator(spring(), adjoint=1, method="radau5", **OPTIONS) as i:
        i.set_params(P)
        i.set_controls(U)
        i.reinit(X0)
        i.advance(0.1)
        with pytest.raises(swb.UnsupportedError, match="implicit"):
            i.hvp(weights, x0=[1.0, 0.0])
        with pytest.raises(swb.DimensionError):
            i.hvp([1.0])


def test_flows_refuse():
    with pytest.raises(swb.RangeError, match="rising times"):
        Flow(spring(), T, [2.0, 1.0], {})
    with pytest.raises(swb.RangeError, match="within t_span"):
        Flow(spring(), T, [5.0], {})
    with pytest.raises(swb.NumericError, match="ended at t = "):
        Flow(swb.System(1, f0=lambda x: [x[0] ** 2]), 2.0, None, {})([1.0], [], [])


def test_jax():
    jax = pytest.importorskip("jax")
    import switchback_control.jax

    jax.config.update("jax_enable_x64", True)
    model, weights = spring(), np.array([1.0, -2.0])

    def loss(x0, p, u):
        return (swb.jax.simulate(model, x0, T, p=p, u=u, **OPTIONS) * weights).sum()

    wanted = adjoint(weights)
    for gradient in (jax.grad(loss, (0, 1, 2)), jax.jit(jax.grad(loss, (0, 1, 2)))):
        for found, exact in zip(gradient(X0, P, U), wanted):
            assert np.allclose(found, exact, rtol=1e-10, atol=1e-10)
    several = jax.vmap(lambda x: loss(x, P, U))(np.array([X0, 2 * X0]))
    assert several[0] == pytest.approx(float(loss(X0, P, U)), rel=1e-12)
    p = np.array([P, 1.1 * P])
    both = jax.vmap(lambda x, p: loss(x, p, U))(np.array([X0, 2 * X0]), p)
    assert both[1] == pytest.approx(float(loss(2 * X0, p[1], U)), rel=1e-12)
    nested = jax.jit(jax.vmap(lambda x: jax.vmap(lambda q: loss(x, q, U))(jax.numpy.asarray(p))))(np.array([X0, 2 * X0]))
    assert nested.shape == (2, 2) and nested[1, 1] == pytest.approx(float(both[1]), rel=1e-12)
    gradients = jax.vmap(jax.grad(lambda x: loss(x, P, U)))(np.array([X0, 2 * X0]))
    assert np.allclose(gradients[0], wanted.x0, rtol=1e-10, atol=1e-10)
    alone = Model(states="level", parameters="k")
    alone.derivatives = [-alone.k * alone.level]
    decay = jax.vmap(jax.grad(lambda k: swb.jax.simulate(alone, [1.0], 1.0, p=k, **OPTIONS).sum()))(np.array([[1.0], [2.0]]))
    assert decay.ravel() == pytest.approx([-np.exp(-1), -np.exp(-2)])  # without controls
    energy = jax.grad(lambda x, p: (swb.jax.simulate(model, x, T, p=p, u=U, **OPTIONS) ** 2).sum(), (0, 1))
    turn, h = (np.array([0.3, -0.2]), np.array([0.1, 0.4])), 1e-4
    for product in (jax.jvp, jax.jit(lambda *a: jax.jvp(energy, *a)).__call__):
        bent = product(energy, (X0, P), turn)[1] if product is jax.jvp else product((X0, P), turn)[1]
        ends = [energy(X0 + by * h * turn[0], P + by * h * turn[1]) for by in (-2, -1, 1, 2)]
        for part, a, b, c, d in zip(bent, *ends):
            assert np.allclose(part, (a - 8 * b + 8 * c - d) / (12 * h), rtol=1e-6, atol=1e-6)
    inside = swb.jax.simulate(model, X0, T, p=P, u=U, at=AT, **OPTIONS)
    assert np.allclose(inside, Flow(model, T, AT, OPTIONS)(X0, P, U), rtol=1e-12)


def test_torch():
    torch = pytest.importorskip("torch")
    import switchback_control.torch

    weights = np.array([1.0, -2.0])
    x0, p, u = (torch.tensor(v, dtype=torch.float64, requires_grad=True) for v in (X0, P, U))
    (swb.torch.simulate(spring(), x0, T, p=p, u=u, **OPTIONS) * torch.tensor(weights)).sum().backward()
    for found, exact in zip((x0.grad, p.grad, u.grad), adjoint(weights)):
        assert np.allclose(found.numpy(), exact, rtol=1e-10, atol=1e-10)
