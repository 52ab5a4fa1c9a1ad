"""Verdicts of answers whose constraints depend on each other: many multipliers belong to one point, and the verdict is of the point."""

import numpy as np
import pytest

import switchback as swb
from switchback import sign, where

TOLERANCE = 1e-4  # first-order changes that count as none, relative to what single controls change the cost by
STARTS = ({}, {"ocp_start": "homotopy"}, {"guess": 1}, {"guess": -1})


class Drawn:
    """A chain of integrators that a piecewise constant control drives, with a convex cost: everything is linear or convex in the controls,
    and a point that no small change betters is the best one. The constraints are given twice, in other units, as bounds and as path
    constraints, and those at the end are redundant."""

    def __init__(self, seed):
        g = np.random.default_rng(seed)
        self.n, self.T, self.order = int(g.integers(4, 9)), g.uniform(1, 3), int(g.integers(1, 3))
        self.x0 = g.normal(size=self.order)
        self.target, self.price = g.normal(), g.uniform(0.05, 1)
        self.box = g.uniform(1.5, 3)
        self.corner = g.uniform(0.1, 0.5) * (g.random() < 0.5)
        self.copies = int(g.integers(1, 4))
        self.factors = g.uniform(0.2, 5, size=self.copies) * g.choice([-1, 1], size=self.copies)
        self.ends = bool(g.random() < 0.5)
        self.as_bound = bool(g.random() < 0.5)
        self.h = self.T / self.n
        # effects of the controls on the states on the grid
        A = np.eye(self.order) if self.order == 1 else np.array([[1, self.h], [0, 1]])
        B = np.array([self.h]) if self.order == 1 else np.array([self.h**2 / 2, self.h])
        self.free, self.effect = [self.x0], [np.zeros((self.order, self.n))]
        for k in range(self.n):
            self.free.append(A @ self.free[-1])
            effect = A @ self.effect[-1]
            effect[:, k] += B
            self.effect.append(effect)
        # some controls meet all constraints
        some = g.uniform(-0.7, 0.7, size=self.n) * self.box
        first = np.array([(f + e @ some)[0] for f, e in zip(self.free, self.effect)])
        self.level = max(first) + g.choice([0.0, 0.1]) if self.target > self.x0[0] else None
        self.end = first[-1]

    def solve(self, start):
        options = dict(start)
        guess = options.pop("guess", 0)
        m = swb.Model(states=["q", "v"][: self.order], controls="u")
        x, u = m.x, m.u[0]
        m.derivatives = [u] if self.order == 1 else [x[1], u]
        ocp = swb.Ocp(m, self.T, self.n, n_fe=1, n_s=3, initial_state=self.x0, control_bounds=(-self.box, self.box), **options)
        kink = where(u > 0, u, -u) if self.corner else 0.0
        ocp.set_lagrange(m.function([self.price * u**2 + self.corner * kink]))
        ocp.set_mayer(m.function([(x[0] - self.target) ** 2 + 0.1 * (x[-1] - 0.2) ** 2]))
        if self.level is not None:
            for f in self.factors:
                low, high = sorted([f * self.level, -np.inf * f])
                ocp.add_path(m.function([f * x[0]]), low, high)
            if self.as_bound:
                ocp.set_state_bounds([-np.inf] * self.order, [self.level] + [np.inf] * (self.order - 1))
        for f in self.factors:
            ocp.add_path(m.function([f * u]), -abs(f) * self.box, abs(f) * self.box)
        if self.ends:
            for f in self.factors:
                ocp.add_terminal(m.function([f * x[0]]), f * self.end, f * self.end)
        if guess:
            ocp.set_control_guess(np.full((self.n, 1), 0.5 * guess * self.box))
        return ocp.solve()

    def misses(self, u):
        """By how much the conditions of optimality are missed with the best multipliers: a linear program of its own."""
        linprog = pytest.importorskip("scipy.optimize").linprog
        x = [f + e @ u for f, e in zip(self.free, self.effect)]
        g = 2 * self.price * u * self.h + 2 * (x[-1][0] - self.target) * self.effect[-1][0]
        g = g + 0.2 * (x[-1][-1] - 0.2) * self.effect[-1][-1]
        low, high = g.copy(), g.copy()
        at = np.abs(u) < 1e-6 * self.box
        low += np.where(at, -1, np.sign(u)) * self.corner * self.h
        high += np.where(at, 1, np.sign(u)) * self.corner * self.h
        columns = []
        if self.level is not None:
            columns += [e[0] for xk, e in zip(x[1:], self.effect[1:]) if xk[0] > self.level - 1e-6]
        free = len(columns)
        if self.ends:
            columns.append(self.effect[-1][0])
        c = np.array(columns).reshape(-1, self.n).T
        scale = np.abs(self.box * g).max()
        # low + c y <= r where u may grow less..., high + c y >= -r
        up, down = u < self.box * (1 - 1e-6), u > -self.box * (1 - 1e-6)
        ones = np.ones((self.n, 1))
        A = np.vstack([np.hstack([-c, -ones])[up], np.hstack([c, -ones])[down]])
        b = np.concatenate([high[up], -low[down]])
        bounds = [(0, None)] * free + [(None, None)] * (c.shape[1] - free) + [(0, None)]
        found = linprog(np.eye(c.shape[1] + 1)[-1], A_ub=A, b_ub=b, bounds=bounds)
        assert found.status == 0
        return self.box * found.fun / scale


@pytest.mark.parametrize("seed", range(30))
def test_the_verdict_is_of_the_point(seed):
    problem = Drawn(seed)
    verdicts = {}
    for start in STARTS:
        r = problem.solve(start)
        if not r.success:
            continue
        u = np.asarray(r.controls)[:, 0]
        misses = problem.misses(u)
        optimal = r.certificate in ("local_optimum", "kink")
        assert optimal == (misses < TOLERANCE), (start, r.certificate, misses, r.optimality.residual)
        for other, verdict in verdicts.values():
            if np.abs(other - u).max() < 1e-6 * problem.box:
                assert verdict == r.certificate, (start, verdict, r.certificate)
        verdicts[str(start)] = (u, r.certificate)
    assert len(verdicts) == len(STARTS)


def switched(seed):
    """A mass with friction or a lever, held by constraints along the path and at the end that are given several times; some of them keep it on
    the surface where it switches."""
    g = np.random.default_rng(seed)
    kind, n, T = seed % 4, int(g.integers(4, 11)), g.uniform(1.5, 4)
    mu, price = g.uniform(0.1, 0.6), g.uniform(0.02, 0.3)
    copies = int(g.integers(1, 4))
    factors = g.uniform(0.2, 5, size=copies) * g.choice([-1, 1], size=copies)
    q1 = g.uniform(0.4, 1.2)
    fastest, level, held, twice = g.uniform(0.5, 1) * 2 * q1 / T, g.uniform(0.3, 0.9) * q1, g.random() < 0.5, g.random() < 0.6
    a, b = g.uniform(0.3, 1.5, size=2)

    def solve(**options):
        m = swb.Model(states="q v" if kind < 3 else "q", controls="u")
        x, u = m.x, m.u[0]
        behind = x[0] > level
        m.derivatives = (
            [x[-1], 3 * u - mu * sign(x[-1])],
            [x[-1], where(behind, a, b) * u * 3],
            [x[-1], 3 * u - mu * sign(x[-1]) - where(behind, 0.4, 0.0)],
            [u * 3 * where(behind, a, b)],
        )[kind]
        nx = 2 if kind < 3 else 1
        p = swb.Ocp(m, T, n, initial_state=[0] * nx, control_bounds=(-1.5, 1.5), n_fe=2, **options)
        p.set_lagrange(m.function([price * u**2 + (0.1 * (x[0] - q1) ** 2)]))
        ends = [x[0] - q1, *x[1:]] if held else []
        if not held:
            p.set_mayer(m.function([5 * (x[0] - q1) ** 2]))
        for f in factors if twice else factors[:1]:
            for e in ends:
                p.add_terminal(m.function([f * e]), 0, 0)
        for f in factors:
            if nx == 2:
                p.add_path(m.function([f * x[1]]), *sorted([f * fastest, -np.inf * f]))
            elif not held:
                p.add_path(m.function([f * x[0]]), *sorted([f * 0.95 * q1, -np.inf * f]))
        if nx == 2:
            p.add_path(m.function([factors[0] * x[1]]), *sorted([0.0, np.inf * factors[0]]))
            if twice:
                p.set_state_bounds([-np.inf, 0], [np.inf, fastest])
        return p.solve()

    return solve
