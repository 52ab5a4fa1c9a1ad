"""Projected systems whose flow switches: relays that slide while constraints push."""

import itertools

import numpy as np
import pytest
import switchback_control as swb

TIGHT = {"rtol": 1e-11, "atol": 1e-12}


def follower():
    """A relay makes y follow a reference, and y >= 0 stops it: y = max(0, reference) once it has caught up."""
    m = swb.Projected("y", p="level", name="follower")
    reference = 0.5 * swb.sin(m.t) + m.level
    m.f([1 - 2 * swb.sign(m.y - reference)])
    m.constraint("floor", m.y)
    return m


def test_a_relay_and_a_constraint_take_over_from_each_other():
    m = follower()
    switch = m.report_data()["contacts"][1]["name"]
    for level in (0.1, 0.0, -0.2):
        run = swb.simulate(m, [1.0], 9.0, p=[level], **TIGHT)
        assert run.success, run.reason
        t = np.linspace(3, 9, 61)
        reference = 0.5 * np.sin(t) + level
        assert np.allclose(run(t)[:, 0], np.maximum(0, reference), rtol=0, atol=1e-10)
        for time, r in zip(t, reference):
            if abs(r) < 1e-3:
                continue
            weight, push = run.force(switch, time)[1], run.force("floor", time)[0]
            # it slides with 1 - 2 w = rate of the reference; on the floor the relay pulls by 1
            expected = ((1 - 0.5 * np.cos(time)) / 2, 0) if r > 0 else (1, 1)
            assert (weight, push) == pytest.approx(expected, abs=1e-8)


def steps(a, b, e, rows, c, x0, end, n):
    """Implicit steps of x' = a x + b w + e sin 2t + c' λ with w in Sign(rows x) and 0 <= λ ⊥ c x + 1 >= 0, by trial of all cases."""
    h, x, k, last = end / n, np.array(x0, float), len(b[0]), None
    m = len(c)
    inverse = np.linalg.inv(np.eye(len(a)) - h * a)
    reach = h * inverse @ np.hstack([b, c.T])
    what = np.vstack([rows, c])
    q_of = what @ reach
    for i in range(n):
        free = inverse @ (x + h * e * np.sin(2 * (i + 1) * h))
        base = what @ free + np.concatenate([np.zeros(k), np.ones(m)])
        cases = itertools.product(*[[-1, 0, 1]] * k, *[[0, 1]] * m)
        for case in itertools.chain([last] if last else [], cases):
            on = np.array(case)
            hold = np.concatenate([on[:k] == 0, on[k:] == 1])
            w = np.concatenate([on[:k], np.zeros(m)]).astype(float)
            w[hold] = 0
            if hold.any():
                matrix = q_of[np.ix_(hold, hold)]
                if np.linalg.cond(matrix) > 1e12:
                    continue  # more is held than there are states
                w[hold] = np.linalg.solve(matrix, -(base + q_of @ w)[hold])
            v = base + q_of @ w
            good = (np.abs(w[:k]) <= 1 + 1e-9).all() and (w[k:] >= -1e-9).all() and (v[k:] >= -1e-9).all()
            if good and (v[:k] * on[:k] >= -1e-9).all():
                x, last = free + reach @ w, case
                break
        else:
            raise AssertionError("no case fits")
    return x


@pytest.mark.parametrize("seed", range(8))
def test_next_to_implicit_steps(seed):
    """Random systems with one or two relays and constraints; implicit steps have order one, which is extrapolated."""
    r = np.random.default_rng(seed)
    n, k, m = 3, int(r.integers(1, 3)), int(r.integers(1, 3))
    a = r.normal(size=(n, n)) - 2 * np.eye(n)
    rows, c = r.normal(size=(k, n)), r.normal(size=(m, n))
    # relays that act against their functions
    b = -rows.T + 0.2 * r.normal(size=(n, k))
    e, x0 = 4 * r.normal(size=n), 0.2 * r.normal(size=n)
    system = swb.Projected([f"x{i}" for i in range(n)], name="random")
    x = np.array(system.x)
    signs = np.array([swb.sign(v) for v in rows @ x])
    system.f(list(a @ x + b @ signs + e * swb.sin(2 * system.t)))
    for i, v in enumerate(c @ x + 1):
        system.constraint(f"c{i}", v)
    run = swb.simulate(system, x0, 3.0, **TIGHT)
    assert run.success, run.reason
    assert any(s.subsystem >= m for s in run.switches)
    coarse, fine = (steps(a, b, e, rows, c, x0, 3.0, n) for n in (3000, 6000))
    assert np.allclose(run.x_end, 2 * fine - coarse, rtol=0, atol=1e-3 * max(1, np.abs(run.y).max()))


def play():
    """Two relays push a point that walls hold, one of which moves."""
    m = swb.Projected("a b", u="wish", p="gain wall", name="pushed")
    relay = swb.sign(m.a - m.wish - 0.3 * swb.sin(3 * m.t))
    m.f([0.4 * m.b - m.gain * relay, swb.cos(2 * m.t) - swb.sign(m.b + 0.5 * m.a) - 0.3 * m.b])
    m.constraint("left", m.a + m.wall)
    m.constraint("below", m.b + 0.2 * m.a + 0.1 + 0.3 * swb.cos(m.t))
    return m


@pytest.mark.parametrize("method", ["dop853", "radau5"])
def test_derivatives_three_ways(method):
    m = play()
    x0, u, p, end = np.array([0.7, 0.5]), np.array([-0.4]), np.array([1.4, 0.45]), 4.3
    how = TIGHT | {"integration": method}

    def run(d):
        r = swb.simulate(m, d[:2], end, u=d[2:3], p=d[3:], **how)
        assert r.success, r.reason
        return r.x_end

    with swb.Integrator(m, adjoint=True, sensitivity=True, **how) as i:
        i.set_controls(u)
        i.set_params(p)
        i.reinit(x0)
        i.advance(end)
        kinds = {(s.subsystem, s.after[0]) for s in i.run.switches}
        assert {(0, 1), (1, 1), (2, 1), (3, 1)} <= kinds
        forward = np.hstack([i.run.dx_dx0, i.run.dx_du, i.run.dx_dp])
        rows = [i.adjoint(np.eye(2)[k]) for k in range(2)]
    adjoint = np.array([np.concatenate([r.x0, r.u, r.p]) for r in rows])
    assert np.allclose(forward, adjoint, rtol=1e-9, atol=1e-10)
    d, h = np.concatenate([x0, u, p]), 1e-4
    for c in range(5):
        e = h * np.eye(5)[c]
        differences = (run(d - 2 * e) - 8 * run(d - e) + 8 * run(d + e) - run(d + 2 * e)) / (12 * h)
        assert np.allclose(forward[:, c], differences, rtol=1e-6, atol=1e-7)


def test_what_is_refused():
    m = follower()
    with pytest.raises(swb.UnsupportedError, match="switch"):
        swb.simulate_fesd(m, [1.0], 1.0, 4, p=[0.0])
    m = swb.Projected("y", name="wrong")
    m.f([1.0])
    m.constraint("c", swb.sign(m.y))
    with pytest.raises(swb.UnsupportedError, match="switches"):
        swb.simulate(m, [1.0], 1.0)
    m = swb.Projected("y", name="wrong")
    m.f([m.y > 0])
    with pytest.raises(swb.SwitchbackError):
        swb.simulate(m, [1.0], 1.0)
