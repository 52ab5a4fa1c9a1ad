"""Contraction of multi-level iterations and advanced steps beside the estimates of the theory, as a page of docs/benchmarks.

usage: nmpc_contraction.py [--out FILE]

Problems and notation are those of nmpc_loops.py and of section 10.4 of A. Nurkanović's thesis: z are states and controls of the
horizon, z̄(x) the solution for an initial state x, errors are Euclidean. Three tables:

 1. iterations of every level for one initial state: errors, and the smallest κ and ω/2 with |e_{j+1}| <= (κ + ω/2 |e_j|) |e_j| (10.18)
    in all of them;
 2. advanced steps in closed loop for inner iterations of every level and samples of several lengths, on the grid of the same problem:
    largest error along the loop, and the largest bound (10.24) with the constants of the first table;
 3. the tangential predictor: errors of the feedback for states at a distance from the one that was prepared for.
"""

from __future__ import annotations

import argparse
import datetime
from pathlib import Path

import numpy as np
from nmpc_loops import ROOT, Tracking
from scipy.optimize import linprog

import switchback_control as swb
from switchback_control.nmpc import Plan

# errors of solutions, relative: smaller differences say nothing
FLOOR = 1e-9
# where the loops begin and which way states are off: two problems whose solutions change their active set, as usual
PROBLEMS = {
    "pendulum": (np.array([0.3, 0.15, 0.0, 0.0]), np.array([0.02, 0.03, -0.02, 0.05]), [0.1, 0.05, 0.025, 0.0125]),
    "chain3": (None, None, [0.4, 0.2, 0.1, 0.05]),
}
ROWS = [("RTI", "rti", "d", 0), ("A", "as_rti", "a", 1)]
ROWS += [(f"{level.upper()}-{j}", "as_rti", level, j) for level in "bcd" for j in (1, 2, 3)]


def of_plan(c):
    plan = c.plan
    return np.concatenate([plan.x.ravel(), plan.u.ravel()])


class Exact:
    """Solutions to rounding, from the plan of another controller."""

    def __init__(self, problem):
        self.c = swb.Nmpc(problem.ocp(), "rti", "d")
        self.rest = Plan(np.tile(problem.ref, (problem.n + 1, 1)), np.zeros((problem.n, problem.nu)))

    def solve(self, x, start=None):
        """From a plan, or from rest at the reference: the same local solution for all states."""
        start = start or self.rest
        self.c.set_iterate(start.x, start.u)
        self.c.initialise(x, 300)
        return of_plan(self.c)


def constants(runs):
    """κ and ω/2 with which (10.18) holds for all errors: those with the least sum of what they are too large."""
    ratio, size = [], []
    for errors in runs:
        e = np.array(errors)
        e = e[: next((i for i, v in enumerate(e) if v < 1e2 * FLOOR * e[0]), len(e))]
        ratio.append(e[1:] / e[:-1]), size.append(e[:-1])
    ratio, size = np.concatenate(ratio), np.concatenate(size)
    weight = np.array([len(size), size.sum()])
    found = linprog(weight, A_ub=-np.column_stack([np.ones_like(size), size]), b_ub=-ratio, bounds=[(0, None), (0, None)])
    return float(found.x[0]), float(found.x[1])


def fixed(problem, x0, away, level, exact, steps=12):
    """Errors of the iterations of a level for the state x0 + away from the solution for x0; of level B from the point it ends at."""
    x = x0 + away
    exact.solve(x0)
    start, iterates = exact.c.plan, []
    with swb.Nmpc(problem.ocp(), "mli", level) as c:
        # the matrices and multipliers of that solution
        c.set_iterate(start.x, start.u)
        for _ in range(1 if level in "bc" else 4):
            c.prepare()
            c.feedback(x0)
        iterates.append(of_plan(c))
        for _ in range(60 if level == "b" else steps):
            c.prepare()
            c.feedback(x)
            iterates.append(of_plan(c))
    goal = iterates[-1] if level == "b" else exact.solve(x, start)
    return [np.linalg.norm(z - goal) for z in iterates[: steps + 1]]


def loop(problem, x0, ts, row, exact, duration):
    """Errors along a loop with samples of length ts, with the sizes that (10.24) needs."""
    _, scheme, level, inner = row
    x, out = x0, []
    rng = np.random.default_rng(1)
    off = None
    with swb.Nmpc(problem.ocp(), scheme, level, inner) as c:
        exact.solve(x0)
        c.set_iterate(exact.c.plan.x, exact.c.plan.u)
        c.initialise(x0, 300)
        last = None
        steps = max(2, round(problem.model_steps * ts / problem.ts))
        u, _ = None, None
        before, e_before = None, 0.0
        for _k in range(round(duration / ts)):
            predicted = x if u is None else problem.over(before, u, ts, steps)
            c.prepare(predicted)
            u, info = c.feedback(x)
            assert info.source is swb.NmpcSource.QP
            z = of_plan(c)
            goal = exact.solve(x, c.plan)
            e = np.linalg.norm(z - goal)
            if before is not None:
                moved = np.linalg.norm(x - before)
                rate = np.linalg.norm(goal - last) / moved if moved > 0 else 0.0
                out.append((e, e_before, np.linalg.norm(predicted - before), np.linalg.norm(x - predicted), rate))
            before, e_before, last = x, e, goal
            off = rng.uniform(-1, 1, problem.nx) * problem.amplitude * ts
            x = problem.over(x, u, ts, problem.plant_steps * steps) + off
    return np.array(out)


def bound(data, inner, j, outer, gamma):
    """The right-hand side of (10.24) for every sample, with κ and ω/2 of inner and outer iterations."""
    (k_in, w_in), (k_out, w_out) = inner, outer
    e, step, gap = data[:, 1], data[:, 2], data[:, 3]
    c = lambda k, w: (2 * w * gamma, w, k * gamma, w * gamma**2)  # noqa: E731  Lemma 10.6; w is ω/2
    c1, c2, c3, c4 = c(k_in, w_in)
    d1, d2, d3, d4 = c(k_out, w_out)
    e0 = (k_in + c1 * step + c2 * e) * e + (c3 + c4 * step) * step
    alpha = (k_in + w_in * e0) ** j
    nu_hat = k_out + d1 * gap + d2 * alpha * e0
    eta = d3 + d4 * gap
    # the first inner iteration is that of (10.29)
    alpha = (k_in + w_in * e0) ** max(j - 1, 0)
    return alpha * nu_hat * e0 + eta * gap if j > 0 else (k_out + d1 * step + d2 * e) * e + (d3 + d4 * step) * step


def tangent(problem, x0, way, level, exact, sizes):
    """Errors of the controls of the horizon by the tangential predictor."""
    errors = []
    exact.solve(x0)
    start = exact.c.plan
    with swb.Nmpc(problem.ocp(), "asc", level, 300) as c:
        for size in sizes:
            c.set_iterate(start.x, start.u)
            c.prepare(x0)
            c.feedback(x0 + size * way)
            exact.solve(x0 + size * way, start)
            errors.append(np.linalg.norm(c.plan.u - exact.c.plan.u))
    return errors


class Problem(Tracking):
    def __init__(self, name):
        super().__init__(name)
        start, self.away, self.lengths = PROBLEMS[name]
        self.start = self.x0 if start is None else start
        if self.away is None:
            self.away = 0.05 * np.where(np.arange(self.nx) >= self.nx // 2, 1.0, 0.0) * np.resize([1.0, -2.0, 1.0], self.nx)
        self.amplitude = np.abs(self.away)

    def places(self, exact):
        """The first states of the plan of the first one, far enough apart."""
        exact.solve(self.start)
        return exact.c.plan.x[[0, 2, 6]]

    def over(self, x, u, length, steps):
        """The state after a time, by small steps."""
        h = length / steps
        f = lambda y: np.array(self.rates(y, u), dtype=float)  # noqa: E731
        for _ in range(steps):
            a = f(x)
            b = f(x + h / 2 * a)
            c = f(x + h / 2 * b)
            x = x + h / 6 * (a + 2 * b + 2 * c + f(x + h * c))
        return x


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "docs/benchmarks/nmpc_contraction.md")
    args = parser.parse_args()
    parts = {"fixed": [], "loops": [], "tangent": []}
    for name in PROBLEMS:
        p = Problem(name)
        exact = Exact(p)
        rates = {}
        for level in ("b", "c", "d0", "d1", "d2"):
            runs = [fixed(p, x, way, level, exact) for x in p.places(exact) for way in (p.away, -p.away, 0.3 * p.away)]
            e, rates[level] = runs[0], constants(runs)
            shown = " ".join(f"{v:8.1e}" for v in e[:8])
            parts["fixed"].append(f"{name:9} {level.upper():3} {rates[level][0]:8.4f} {rates[level][1]:8.4f}   {shown}")
            print(parts["fixed"][-1], flush=True)
        head = "  ".join(f"{ts:<17g}" for ts in p.lengths)
        parts["loops"].append(f"{'samples':14}  {head}".rstrip())
        for row in ROWS:
            cells = []
            for ts in p.lengths:
                data = loop(p, p.start, ts, row, exact, p.lengths[0] * 12)
                gamma = data[:, 4].max()
                # iterations of levels A and B do not end at the solution
                level = {"a": None, "b": None, "d": "d0"}.get(row[2], row[2])
                cell = f"{data[:, 0].max():8.1e}"
                if level is None:
                    cell += " " * 9
                else:
                    b = bound(data, rates[level], row[3], rates["d0"], gamma)
                    good = np.all(data[:, 0] <= b * (1 + 1e-6) + FLOOR)
                    cell += f" {b.max():7.0e}{' ' if good else '!'}"
                cells.append(cell)
            parts["loops"].append(f"{name:9} {row[0]:4} " + "  ".join(cells))
            print(parts["loops"][-1], flush=True)
        sizes = [0.2, 0.1, 0.05, 0.025, 0.0125]
        # where no active set changes on the way
        at = exact.c.plan.x[10] if name == "chain3" else np.array([0.02, 0.04, 0.0, -0.02])
        for level in ("d0", "d2"):
            e = tangent(p, at, p.away, level, exact, sizes)
            slope = np.polyfit(np.log(sizes), np.log(e), 1)[0]
            parts["tangent"].append(f"{name:9} {level.upper():3} {slope:6.2f}   " + " ".join(f"{v:8.1e}" for v in e))
            print(parts["tangent"][-1], flush=True)
    args.out.write_text(PAGE.format(date=datetime.date.today().isoformat(), **{k: "\n".join(v) for k, v in parts.items()}))


PAGE = """# Contraction of multi-level iterations and advanced steps

| date | machine | command |
|---|---|---|
| {date} | any: errors, no times | `bindings/python/benchmarks/nmpc_contraction.py` |

The problems are those of [closed loops](nmpc.md), near their references. Errors are Euclidean distances of states and controls of the horizon from the
solution for the same state. Equations and sections are those of A. Nurkanović's thesis.

## Iterations for one state

The state jumps, and iterations of one level follow; levels B and C keep the matrices of the solution before. κ and ω/2 are such that (10.18),
`|e_next| <= (κ + ω/2 |e|) |e|`, holds in nine runs from three states in three directions. Errors are those of one run; those of level B are
distances from the feasible point where it ends.

```
problem   level      κ     ω/2    errors before and after iterations 1 to 7
{fixed}
```

C contracts as D0 does, at a fraction of the cost. D2 converges at the second order with the pendulum, and linearly with the chain, where its
Hessians are made convex node by node.

## Advanced steps

Loops of advanced steps with 0 (RTI) to 3 inner iterations of every level, with samples of four lengths on the same grid of the horizon. A pair is the
largest error along the loop and the largest bound (10.24), with κ and ω/2 of the table above and the largest γ of (10.17) along the loop.
An exclamation mark says that an error was larger than its bound at some sample, where iterations contract less than where κ was measured.
Iterations of A and B have no bound, because they do not end at the solution.

```
{loops}
```

Errors fall with the length of the samples and with inner iterations, down to the last term of (10.24): the distance of the state from its
prediction.

## The tangential predictor

A controller has solved the problem for one state; the table has errors of its feedback to states at a distance of 0.2 to 0.0125 of the jump, and the
slope that is fitted to them. With the exact Hessian (D2, pendulum) errors are of second order, because the program is the derivative of the solution
(section 10.2). With the Hessian of Gauss and Newton, or one that was made convex (D2, chain), a share κ of the step is wrong.

```
problem   level slope  errors
{tangent}
```

By Proposition 10.1 a level-A iteration with a perfect prediction leads to the linearisation points of the RTI scheme. It holds to 1e-12
(`cargo test --test nmpc level_a`).
"""


if __name__ == "__main__":
    main()
