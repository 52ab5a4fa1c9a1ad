"""States from which bounds cannot be met: times of the feedback, its source, and violations compared with the least ones.

usage: nmpc_infeasible.py [--out FILE] [--states N] [--problems NAME,NAME]

Four controllers with hard bounds of states. Each is started at its goal; states are drawn around it until there are as many infeasible ones as
asked, and every one is a sample of its own: preparation at the goal, feedback without a guess of the active set. Whether a
state is feasible is said by a linear program of HiGHS (scipy) on the linearisation by CasADi, which also gives the least sum of violations.
Violations of a control are those of the plan that the controller has afterwards. Infeasible are states whose least sum is above 1e-6 of the range of the bounds,
feasible ones those with none; between the two rounding decides, and they are left out. In the second table feedbacks have a bound on their changes.
"""

from __future__ import annotations

import argparse
import datetime
from pathlib import Path

import casadi as ca
import numpy as np
from scipy import optimize

import switchback_control as swb

REPEAT = 5  # the shortest of so many equal calls: a shared machine interrupts some
ROOT = Path(__file__).resolve().parents[3]
INF = np.inf


class Problem:
    """Rates, stage length and count, weights, bounds, and how far states are drawn around the goal at zero."""

    def __init__(self, rates, h, n, q, r, qn, u, lower, upper, draw):
        self.rates, self.h, self.n = rates, h, n
        self.q, self.r, self.qn = (np.array(v, float) for v in (q, r, qn))
        self.u, self.lower, self.upper, self.draw = (np.array(v, float) for v in (u, lower, upper, draw))
        self.nx, self.nu = len(self.q), len(self.r)


def masses(x, u, m):
    return [*x[3:], x[1] - 2 * x[0] + u[0], x[0] - 2 * x[1] + x[2], x[1] - 2 * x[2] + u[1]]


def cart(x, u, m):
    return [x[1], u[0]]


def pendulum(x, u, m):
    s, c = m.sin(x[1]), m.cos(x[1])
    a = (u[0] + 0.1 * s * (0.5 * x[3] * x[3] - 9.81 * c)) / (1.0 + 0.1 * s * s)
    return [x[2], x[3], a, 2.0 * (9.81 * s - a * c)]


def quadrotor(x, u, m):
    lift = 9.81 + u[0] + u[1]
    return [x[3], x[4], x[5], -lift * m.sin(x[2]), lift * m.cos(x[2]) - 9.81, 20.0 * (u[0] - u[1])]


PROBLEMS = {
    "cart": Problem(cart, 0.1, 30, [1, 0.1], [0.1], [5, 1], [1], [-1, -1.5], [1, 1.5], [1.0, 1.5]),
    "masses": Problem(masses, 0.1, 20, [1, 1, 1, 0.1, 0.1, 0.1], [0.05] * 2, [5, 5, 5, 1, 1, 1], [0.5] * 2, [-INF] * 3 + [-0.6] * 3, [INF] * 3 + [0.6] * 3, [1.5] * 3 + [0.6] * 3),
    "pendulum": Problem(pendulum, 0.05, 40, [1, 1, 0.1, 0.1], [0.01], [5, 5, 1, 1], [10], [-1, -0.5, -INF, -INF], [1, 0.5, INF, INF], [1.0, 0.3, 1.5, 1.5]),
    "quadrotor": Problem(quadrotor, 0.05, 20, [1, 1, 0.1, 0.1, 0.1, 0.01], [0.05] * 2, [5, 5, 1, 1, 1, 0.1], [4] * 2, [-1, -1, -0.5, -3, -3, -INF], [1, 1, 0.5, 3, 3, INF], [1.0, 1.0, 0.5, 3.0, 3.0, 3.0]),
}


def controller(p, method, most):
    m = swb.Model(p.nx, p.nu)
    x, u = list(m.x), list(m.u)
    m.derivatives = p.rates(x, u, swb)
    ocp = swb.Ocp(m, p.n * p.h, p.n, rk_family="explicit", n_s=4, n_fe=1, control_bounds=(-p.u, p.u))
    ocp.add_least_squares(m.function(x + u), np.concatenate([p.q, p.r]) / 2, np.zeros(p.nx + p.nu))
    ocp.add_least_squares(m.function(x), p.qn / 2, np.zeros(p.nx), at="terminal")
    ocp.set_state_bounds(p.lower, p.upper)
    return swb.Nmpc(ocp, "rti", shift=True, qp_solver=method, max_changes=most)


class Least:
    """The least sum of violations over all controls within their bounds, for the linearisation at the goal."""

    def __init__(self, p):
        x, u = ca.SX.sym("x", p.nx), ca.SX.sym("u", p.nu)
        f = ca.Function("f", [x, u], [ca.vertcat(*p.rates([x[i] for i in range(p.nx)], [u[j] for j in range(p.nu)], ca))])
        h = p.h
        a = f(x, u)
        b = f(x + h / 2 * a, u)
        c = f(x + h / 2 * b, u)
        y = x + h / 6 * (a + 2 * b + 2 * c + f(x + h * c, u))
        step = ca.Function("step", [x, u], [ca.jacobian(y, x), ca.jacobian(y, u)])
        phi, gamma = (np.array(v) for v in step(np.zeros(p.nx), np.zeros(p.nu)))
        big, free, rows, offsets, bounds = np.zeros((p.nx, p.n * p.nu)), np.eye(p.nx), [], [], []
        has = np.isfinite(p.upper)
        for k in range(p.n):
            big = phi @ big
            big[:, k * p.nu : (k + 1) * p.nu] += gamma
            free = phi @ free
            rows.append(big[has])
            offsets.append(free[has])
            bounds.append(p.upper[has])
        self.rows, self.offsets, self.bound = np.vstack(rows), np.vstack(offsets), np.concatenate(bounds)
        n_u, m = p.n * p.nu, len(self.bound)
        one = np.hstack([self.rows, -np.eye(m)])
        self.a = np.vstack([one, np.hstack([-self.rows, -np.eye(m)])])
        self.cost = np.concatenate([np.zeros(n_u), np.ones(m)])
        self.limits = [(-b, b) for b in np.tile(p.u, p.n)] + [(0, None)] * m

    def of(self, x):
        v = self.offsets @ x
        found = optimize.linprog(self.cost, self.a, np.concatenate([self.bound - v, self.bound + v]), bounds=self.limits, method="highs")
        return found.fun

    def violation(self, x, u):
        v = self.rows @ u.ravel() + self.offsets @ x
        return np.maximum(np.abs(v) - self.bound, 0.0).sum()


def draws(p, least, count):
    """States with their least violations, until there are enough of both kinds."""
    r = np.random.default_rng(5)
    out, kinds = [], [0, 0]
    while min(kinds) < count and len(out) < 200 * count:
        x = p.draw * r.uniform(-1, 1, p.nx)
        v = least.of(x)
        kind = 0 if v <= 1e-12 else 1 if v > 1e-6 * least.bound.max() else None
        if kind is not None and kinds[kind] < count:
            kinds[kind] += 1
            out.append((x, v, kind == 1))
    return out


def run(name, method, states, least, most=0):
    p = PROBLEMS[name]
    rows = []
    with controller(p, method, most) as c:
        zero = (np.zeros((p.n + 1, p.nx)), np.zeros((p.n, p.nu)))
        for x, v, bad in states:
            best, then = INF, INF
            for _ in range(REPEAT):
                c.set_iterate(*zero)
                c.prepare()
                u, info = c.feedback(x)
                best = min(best, 1e6 * info.time)
                plan = c.plan
                # the sample after it, at the state that was predicted
                c.prepare()
                _, after = c.feedback(plan.x[1])
                then = min(then, 1e6 * after.time)
            cut = info.source is swb.NmpcSource.TANGENT and info.status is swb.NmpcQpStatus.OUT_OF_TIME
            said = info.source is swb.NmpcSource.SOFT_QP or (cut and bad)
            again = after.source is swb.NmpcSource.SOFT_QP
            rows.append((bad, best, info.iterations, said, int(info.source) > 1, least.violation(x, plan.u) - v, v, then if again else np.nan, after.iterations, *u))
    return rows


def line(name, method, rows):
    t = np.array(rows, float)
    good, bad = t[t[:, 0] == 0], t[t[:, 0] == 1]
    mean = good[:, 1].mean()
    wrong = int((t[:, 3] != t[:, 0]).sum())
    share, allowed = bad[:, 5].sum() / bad[:, 6].sum(), (bad[:, 5] / bad[:, 6]).max()
    times = f"{mean:7.1f} {good[:, 1].max():7.1f} {good[:, 2].mean():6.1f}  {bad[:, 1].mean():7.1f} {bad[:, 1].max():7.1f} {bad[:, 2].mean():6.1f} {bad[:, 2].max():5.0f}"
    after = bad[np.isfinite(bad[:, 7])]
    again = f"{after[:, 7].mean():7.1f} {np.quantile(after[:, 7], 0.99):7.1f} {after[:, 8].mean():6.1f} {after[:, 7].mean() / mean:5.1f}"
    ratios = f"{bad[:, 1].mean() / mean:5.1f} {bad[:, 1].max() / mean:5.1f}"
    return f"{name:10} {method:10}  {times}  {ratios}  {wrong:4} {int(t[:, 4].sum()):5}  {share:8.1e} {allowed:7.1e}  {again}"


def bounded_line(name, method, most, rows, whole):
    """As `line`, where feedbacks have a bound, with what the unbounded ones say."""
    t, w = np.array(rows, float), np.array(whole, float)
    bad, good = t[:, 0] == 1, t[:, 0] == 0
    mean = w[good, 1].mean()
    apart = np.abs(t[:, 9:] - w[:, 9:]).max(1) > 1e-3 * PROBLEMS[name].u.max()
    more, allowed = t[bad, 5].sum() / t[bad, 6].sum(), (t[bad, 5] / t[bad, 6]).max()
    again = t[bad & np.isfinite(t[:, 7]), 7]
    times = f"{t[good, 1].mean():7.1f} {t[good, 1].max():7.1f} {t[good, 4].mean():5.2f} {apart[good].mean():5.2f}"
    bads = f"{t[bad, 1].mean():7.1f} {t[bad, 1].max():7.1f} {t[bad, 4].mean():5.2f} {apart[bad].mean():5.2f}"
    return f"{name:10} {method:10} {most:4}  {times}  {bads}  {t[bad, 1].max() / mean:5.1f}  {more:8.1e} {allowed:7.1e}  {again.mean():7.1f} {again.max() / mean:5.1f}"


BOUNDS = {"condensing": 5, "stagewise": 2}
BOUNDED_HEAD = [
    "                            feasible                     infeasible                   over   violation         the sample after it",
    "                       most    mean   worst   cut other     mean   worst   cut other  mean     sum   worst     mean  ratio",
]
HEAD = [
    "                       feasible                infeasible                   over mean   source  not  violation         the sample after it",
    "                          mean   worst  steps     mean   worst  steps  most   mean worst  wrong solved   sum   worst     mean     99%  steps ratio",
]

PAGE = """# Feedback where bounds cannot be met

| date | machine | command |
|---|---|---|
| {date} | one core of a shared machine | `bindings/python/benchmarks/nmpc_infeasible.py` |

Four controllers at their goals, with hard bounds of states and controls: a cart, three masses between springs, a pendulum on a cart, a planar quadrotor.
States are drawn at random, {states} of each kind, and every one is a sample without a guess of the active set. Times are microseconds of the feedback.
Whether a state is feasible, and the least sum of violations, is said by a linear program of HiGHS. Ratios are those to the mean of the feasible states. "Violation" is what
the plans violate in sum beyond the least sum, relative to it: in all states together, and in the worst one.

```
{table}
```

Plans violate more than the least in states that are hardly infeasible. There the price of violations, a thousand times what it costs to meet rows one by one,
trades a millionth of a bound for the cost of the others.

Most feasible states have few active constraints. In infeasible ones most bounds of controls are active, and most rows of the first stages are violated. A dual method has to find them
one by one, and an interior point needs as many iterations as it does without a guess.

"The sample after it" begins at the state that was predicted, where that is infeasible, too. The preparation has solved its program for that state, and leaves the feedback one or two
changes.

## With a bound on the changes of a feedback

`max_changes` bounds the work of a feedback ("most"). "Cut" is the share of states in which it comes first, and `status` says so. The control then is the cheapest of three, by the
program: that of the unfinished solution, of the law without constraints, of the plan. "Other" is the share in which it is another control than without the bound. The next preparation solves the program to its end, with
the control that was given. "Violation" is that of these plans: what it exceeds the least by is what the bound costs.

```
{bounded}
```
"""


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "docs/benchmarks/nmpc_infeasible.md")
    parser.add_argument("--states", type=int, default=1000)
    parser.add_argument("--problems", default=",".join(PROBLEMS))
    args = parser.parse_args()
    lines, bounded = HEAD[:], BOUNDED_HEAD[:]
    print("\n".join(HEAD))
    for name in args.problems.split(","):
        least = Least(PROBLEMS[name])
        states = draws(PROBLEMS[name], least, args.states)
        for method in ("condensing", "stagewise"):
            whole = run(name, method, states, least)
            lines.append(line(name, method, whole))
            print(lines[-1], flush=True)
            bounded.append(bounded_line(name, method, BOUNDS[method], run(name, method, states, least, BOUNDS[method]), whole))
    print("\n".join(bounded))
    args.out.write_text(PAGE.format(date=datetime.date.today().isoformat(), states=args.states, table="\n".join(lines), bounded="\n".join(bounded)))


if __name__ == "__main__":
    main()
