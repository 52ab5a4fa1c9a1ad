"""Verdicts of answers whose constraints depend on each other: many multipliers belong to one point."""

import numpy as np
import pytest

import switchback_control as swb
from switchback_control import sign, where

TOLERANCE = 1e-4  # first-order changes that count as none, relative to what single controls change the cost by
STARTS = ({}, {"ocp_start": "homotopy"}, {"guess": 1}, {"guess": -1})


class Drawn:
    """A chain of integrators that a piecewise constant control drives, with a convex cost: everything is linear or
    convex in the controls, and a point that no small change betters is the best one. The constraints are given several
    times, in other units, as bounds and as path constraints, and those at the end are redundant."""

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
        ocp = swb.Ocp(m, self.T, self.n, n_fe=1, n_s=3, initial_state=self.x0, **options)
        ocp.set_control_bounds(-self.box, self.box)
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
        """By how much the conditions of optimality are missed with the best multipliers."""
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
        # a control that may grow does not lower the cost by more than r, nor one that may fall
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


class Switched:
    """A mass with friction or a lever, held by constraints along the path and at the end that are given several times;
    some of them keep it on the surface where it switches."""

    SIZE = 1.5

    def __init__(self, seed):
        g = np.random.default_rng(seed)
        self.kind, self.n, self.T = seed % 4, int(g.integers(4, 11)), g.uniform(1.5, 4)
        self.mu, self.price = g.uniform(0.1, 0.6), g.uniform(0.02, 0.3)
        copies = int(g.integers(1, 4))
        self.factors = g.uniform(0.2, 5, size=copies) * g.choice([-1, 1], size=copies)
        self.q1 = g.uniform(0.4, 1.2)
        self.fastest, self.level = g.uniform(0.5, 1) * 2 * self.q1 / self.T, g.uniform(0.3, 0.9) * self.q1
        self.held, self.twice = g.random() < 0.5, g.random() < 0.6
        self.pace = g.uniform(0.3, 1.5, size=2)
        self.nx = 2 if self.kind < 3 else 1
        self.simulated = self.model(True)[0]

    def model(self, cost):
        names = "q v"[: 2 * self.nx - 1]
        m = swb.Model(states=names + " c" if cost else names, controls="u")
        x, u = m.x, m.u[0]
        v, behind = x[self.nx - 1], x[0] > self.level
        running = self.price * u**2 + 0.1 * (x[0] - self.q1) ** 2
        motion = (
            [v, 3 * u - self.mu * sign(v)],
            [v, where(behind, *self.pace) * u * 3],
            [v, 3 * u - self.mu * sign(v) - where(behind, 0.4, 0.0)],
            [u * 3 * where(behind, *self.pace)],
        )[self.kind]
        m.derivatives = [*motion, running] if cost else motion
        return m, running

    def solve(self, **options):
        m, running = self.model(False)
        x = m.x
        p = swb.Ocp(m, self.T, self.n, initial_state=[0] * self.nx, n_fe=2, **options)
        p.set_control_bounds(-self.SIZE, self.SIZE)
        p.set_lagrange(m.function([running]))
        if not self.held:
            p.set_mayer(m.function([5 * (x[0] - self.q1) ** 2]))
        for f in self.factors if self.twice else self.factors[:1]:
            for e in [x[0] - self.q1, *x[1:]] if self.held else []:
                p.add_terminal(m.function([f * e]), 0, 0)
        for f in self.factors:
            if self.nx == 2:
                p.add_path(m.function([f * x[1]]), *sorted([f * self.fastest, -np.inf * f]))
            elif not self.held:
                p.add_path(m.function([f * x[0]]), *sorted([f * 0.95 * self.q1, -np.inf * f]))
        if self.nx == 2:
            f = self.factors[0]
            p.add_path(m.function([f * x[1]]), *sorted([0.0, np.inf * f]))
            if self.twice:
                p.set_state_bounds([-np.inf, 0], [np.inf, self.fastest])
        return p.solve()

    def cost(self, u):
        """Of a simulation, and the largest violation on the grid and at the end."""
        z, off = np.zeros(self.nx + 1), 0.0
        for uk in u:
            z = swb.simulate(self.simulated, z, self.T / self.n, u=[uk]).x_end
            if self.nx == 2:
                off = max(off, z[1] - self.fastest, -z[1])
            elif not self.held:
                off = max(off, z[0] - 0.95 * self.q1)
        if self.held:
            return z[-1], max(off, abs(z[0] - self.q1), abs(z[1]) if self.nx == 2 else 0)
        return z[-1] + 5 * (z[0] - self.q1) ** 2, off

    def falls(self, u, other):
        """How fast the cost falls from controls towards others, relative to what single ones change it by; nothing
        where constraints are in the way."""
        t, d = 1e-3, np.asarray(other) - u
        (here, _), (there, off) = self.cost(u), self.cost(u + t * d)
        one = [self.cost(u + 1e-4 * e)[0] - here for e in np.eye(self.n)]
        scale = self.SIZE * np.abs(one).max() / 1e-4
        return (here - there) / t / (scale * np.abs(d).sum() / self.SIZE) if off < 1e-7 else 0.0


@pytest.mark.parametrize("seed", range(0, 36, 3))
def test_switched_motions_with_constraints_that_depend_on_each_other(seed):
    problem = Switched(seed)
    answers = []
    for options in ({}, {"ocp_start": "homotopy"}, {"ocp_start": "homotopy", "sigma_init": 0.1}):
        r = problem.solve(**options)
        if r.success:
            answers.append((np.asarray(r.controls)[:, 0], r))
    for u, r in answers:
        optimal = r.certificate in ("local_optimum", "kink")
        for other, o in answers:
            if np.abs(other - u).max() < 1e-6:
                assert not (optimal and o.certificate == "not_optimal"), (r.optimality, o.optimality)
            elif optimal and o.cost < r.cost:
                assert problem.falls(u, other) < 10 * TOLERANCE, (r.optimality, o.cost, r.cost)
