"""How a solve says what its answer is worth: searches that were cut, answers that no motion has, rounds of adapted grids."""

import numpy as np
import pytest

import switchback_control as swb
from switchback_control.expr import Model, sign, where


def random_problem(seed, **options):
    """Two states with friction that switches, from a random start, some of them to a point."""
    g = np.random.default_rng(seed)
    n = int(g.integers(3, 5))
    m = Model(states="y v", controls="u")
    (y, v), u = m.x, m.u[0]
    k, w, s = g.uniform(0.2, 1), g.uniform(0.3, 1.2), g.uniform(-0.5, 0.5)
    drag = [k * sign(v), where(y > s, k, -0.3 * k), where(v > 0.5, k * v, 0.2 * v) + where(y > s + 0.3, k, 0)]
    m.derivatives = [v, u - w * y - drag[int(g.integers(3))]]
    start = [float(g.uniform(-2, 2)), float(g.uniform(-1, 1))]
    effort = m.function([0.1 * u * u + y * y + 0.1 * v * v])
    ocp = swb.Ocp(m, float(g.uniform(2, 4)), n, lagrange=effort, initial_state=start, control_bounds=(-3, 3), **options)
    if g.random() < 0.6:
        ocp.add_terminal(m.function([y, v]), [1.0, 0.0], [1.0, 0.0])
    return ocp


@pytest.mark.parametrize("seed", [0, 2])
def test_a_search_that_is_cut_says_so_and_loses_no_answer(seed):
    def solve(stop=10**9):
        seen = []

        def monitor(*_):
            seen.append(1)
            return len(seen) >= stop

        return random_problem(seed, on_iteration=monitor).solve(), len(seen)

    whole, count = solve()
    assert whole.success
    cuts, best = 0, np.inf
    for share in (0.3, 0.6, 0.8, 0.9, 0.95, 1.0):
        r, _ = solve(int(share * count))
        assert r.outcome == swb.Outcome.STOPPED
        assert ("interrupted" in r.message) == bool(np.isfinite(r.cost))
        # what a longer search returns is never dearer
        assert not np.isfinite(best) or r.cost <= best + 1e-6 * abs(best)
        best = min(best, r.cost) if np.isfinite(r.cost) else best
        cuts += bool(np.isfinite(r.cost))
    assert cuts > 0 and whole.cost <= best + 1e-6 * abs(best)


@pytest.mark.parametrize("seed", [1])
def test_an_answer_within_max_time_is_compared_or_not_certified(seed):
    cut, limit, r = 0, 0.002, None
    while r is None or not r.success:
        ocp = random_problem(seed)
        ocp.set(max_time=limit)
        r = ocp.solve()
        if not r.success:
            assert r.outcome == swb.Outcome.MAX_TIME and "max_time" in r.message
            cut += 1
        assert np.isfinite(r.accuracy.terminal) or r.certificate == "unknown"
        limit *= 3
        assert limit < 1e4
    assert cut > 0 and np.isfinite(r.accuracy.terminal)


def oscillator(frequency, n_fe, n_s):
    m = Model(states="q v", controls="u")
    m.derivatives = [m.x[1], -frequency * frequency * m.x[0] + m.u[0]]
    cost = m.function([m.u[0] ** 2 + m.x[0] ** 2])
    start = [1.0, 0.0]
    return swb.Ocp(m, 2.0, 4, lagrange=cost, initial_state=start, control_bounds=(-1, 1), n_fe=n_fe, n_s=n_s)


def test_an_answer_that_no_motion_has_is_no_solution():
    """One implicit Euler step for many periods: the answer comes to rest, which q = cos(w t) does not."""
    g = np.random.default_rng(0)
    for w in g.uniform(20, 120, size=8):
        r = oscillator(w, 1, 1).solve()
        assert r.outcome == swb.Outcome.NOT_FOLLOWED and not r.success
        assert "simulation of the controls" in r.message and r.certificate == "unknown"
    assert oscillator(1.3, 4, 3).solve().success
