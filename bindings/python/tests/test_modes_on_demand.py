"""Models whose modes are formed on demand, and tables with many pieces."""

import math

import numpy as np
import pytest
import switchback_control as swb
from switchback_control import maximum, minimum, sign, sin
from switchback_control.expr import Model, step_table


def weights(h, n, seed):
    """Two layers of h rectifiers over n inputs, one output."""
    rng = np.random.default_rng(seed)
    return [
        (rng.normal(size=(h, n)), 0.3 * rng.normal(size=h)),
        (rng.normal(size=(h, h)) / math.sqrt(h), 0.3 * rng.normal(size=h)),
        (rng.normal(size=(1, h)) / math.sqrt(h), np.zeros(1)),
    ]


def evaluate(layers, x, rectify):
    """The network, of numbers or of expressions."""
    values = list(x)
    for k, (a, b) in enumerate(layers):
        values = [sum(float(w) * v for w, v in zip(row, values)) + float(c) for row, c in zip(a, b)]
        if k + 1 < len(layers):
            values = [rectify(v) for v in values]
    return values[0]


def pendulum(h, seed=3):
    """An inverted pendulum with a network in its controller."""
    layers = weights(h, 2, seed)
    m = Model(states="angle speed")
    angle, speed = m.x
    torque = -14 * angle - 3 * speed + 2 * evaluate(layers, m.x, lambda v: maximum(v, 0))
    m.derivatives = [speed, 9.81 * sin(angle) + torque]

    def f(x):
        u = -14 * x[0] - 3 * x[1] + 2 * evaluate(layers, x, lambda v: max(v, 0.0))
        return np.array([x[1], 9.81 * math.sin(x[0]) + u])

    return m, f


def small_steps(f, x, t, n):
    """Classical Runge-Kutta steps."""
    h, x = t / n, np.array(x, float)
    for _ in range(n):
        a = f(x)
        b = f(x + h / 2 * a)
        c = f(x + h / 2 * b)
        x = x + h / 6 * (a + 2 * b + 2 * c + f(x + h * c))
    return x


def test_a_pendulum_with_a_network_for_a_controller():
    m, f = pendulum(16)
    assert "32 switching functions are coupled" in str(m.report())
    run = swb.simulate(m, [0.4, -0.5], 1.0, rtol=1e-8, atol=1e-10)
    assert run.success and len(run.switches) > 3
    assert np.abs(run.x_end - small_steps(f, [0.4, -0.5], 1.0, 4000)).max() < 1e-6


def test_what_needs_all_modes_refuses_at_once():
    m, _ = pendulum(16)
    with pytest.raises(swb.UnsupportedError, match="terms that switch separately"):
        swb.simulate_fesd(m.system(), x0=[0.4, 0.0], duration=1.0, n_steps=5)
    with pytest.raises(swb.UnsupportedError, match="derivatives"):
        swb.simulate(m, [0.4, 0.0], 1.0, sensitivity=True)
    with pytest.raises(swb.UnsupportedError, match="terms that switch separately"):
        swb.Ocp(m, 1.0, 5)


def test_saturations_in_a_cascade():
    """Twelve saturated integrators one behind the other, each with the output of the one before inside of its own."""
    n = 12
    m = Model(n)
    clip = lambda e: minimum(maximum(e, -1), 1)
    inner, rates = clip(2 - m.x[0]), []
    for k in range(n):
        rates.append(inner)
        inner = clip(2 * inner - m.x[(k + 1) % n])
    m.derivatives = rates

    def f(x):
        limit = lambda v: min(max(v, -1.0), 1.0)
        inner, out = limit(2 - x[0]), []
        for k in range(n):
            out.append(inner)
            inner = limit(2 * inner - x[(k + 1) % n])
        return np.array(out)

    x0 = np.linspace(-1, 1, n)
    run = swb.simulate(m, x0, 3.0, rtol=1e-8, atol=1e-10)
    assert run.success
    assert np.abs(run.x_end - small_steps(f, x0, 3.0, 3000)).max() < 1e-5


@pytest.mark.parametrize("n", [40, 300])
def test_tables_of_hundreds_of_steps(n):
    """The time in every piece is its length over its speed."""
    breaks, speeds = np.linspace(-5, 5, n), 1.1 + np.cos(np.linspace(0, 9, n + 1))
    m = Model(1)
    m.derivatives = [step_table(m.x[0], list(breaks), list(speeds))]
    run = swb.simulate(m, [-6.0], 3.0, rtol=1e-9, atol=1e-11)
    left, at, k = 3.0, -6.0, 0
    while k < n and (breaks[k] - at) / speeds[k] < left:
        left -= (breaks[k] - at) / speeds[k]
        at, k = breaks[k], k + 1
    assert len(run.switches) == k
    assert run.x_end[0] == pytest.approx(at + left * speeds[k], abs=1e-8)


def test_a_continuum_is_named():
    m = Model(3)
    s, r = sign(m.x[0]), sign(m.x[1])
    m.derivatives = [-2 * r - 0.7 * s, 2 * s - 0.7 * r, 1 + 0.3 * s * r]
    assert str(m.report()).count("continuum") == 1
    for rtol in (1e-4, 1e-8):
        # both means are zero, so is their product; the extreme velocities are far from that
        run = swb.simulate(m, [1, 0.2, 0], 3.0, rtol=rtol, atol=1e-2 * rtol)
        behind = run.x_end[2] - 3.0
        extreme = swb.simulate(m, [1, 0.2, 0], 3.0, rtol=rtol, atol=1e-2 * rtol, selection="fewest")
        assert abs(behind - 0.06) < 10 * rtol and abs(extreme.x_end[2] - 3.06) > 0.5
        assert not run.switches[-1].unique and len(run.switches[-1].after) == 4
    m.derivatives = [-2 * r - 0.7 * s, 2 * s - 0.7 * r, 1 + 0.3 * s]
    assert "continuum" not in str(m.report())
