"""The quadratic programs of closed loops, for solvers of CasADi: the same solutions, and times.

usage: nmpc_dumps.py [--out FILE] [--repeat N]

The loops are those of nmpc_loops.py under the RTI scheme. Before every feedback the program is written down apart from the controller: the
plan is linearised by CasADi (classical Runge-Kutta steps, differentiated), with the Hessian of the least-squares terms, the bounds of
the controls and the measured state. Solved by HPIPM on its stages, by DAQP and qpOASES on the program in the controls alone (states
eliminated here, which does not count into their times), it must give the controls of the feedback. PIQP and Clarabel (packages `piqp`, `clarabel`,
where they are installed) have the stages through their own interfaces. Differences are relative to the
largest control; times are those of the calls as CasADi makes them (HPIPM, DAQP and qpOASES begin without a guess), ours those of
`feedback`, which begins with the last active set, and of `prepare` with linearisation and factors.
"""

from __future__ import annotations

import argparse
import datetime
import time
from pathlib import Path

import casadi as ca
import numpy as np
import scipy.sparse as sp
from nmpc_loops import ROOT, Tracking

import switchback_control as swb


class Dumped:
    """Programs of one problem in the form of CasADi's conic solvers."""

    def __init__(self, p):
        self.p, nx, nu, n = p, p.nx, p.nu, p.n
        x, u = ca.SX.sym("x", nx), ca.SX.sym("u", nu)
        f = ca.Function("f", [x, u], [ca.vertcat(*p.rates([x[i] for i in range(nx)], [u[j] for j in range(nu)], ca))])
        h, y = p.ts / p.model_steps, x
        for _ in range(p.model_steps):
            a = f(y, u)
            b = f(y + h / 2 * a, u)
            c = f(y + h / 2 * b, u)
            y = y + h / 6 * (a + 2 * b + 2 * c + f(y + h * c, u))
        self.step = ca.Function("step", [x, u], [y, ca.jacobian(y, x), ca.jacobian(y, u)]).map(n)
        w = nx + nu
        # x_0, u_0, x_1, ...: the order that HPIPM finds its stages in
        self.x_at = [np.arange(k * w, k * w + nx) for k in range(n + 1)]
        self.u_at = [np.arange(k * w + nx, (k + 1) * w) for k in range(n)]
        self.size = n * w + nx
        diagonal = np.concatenate([np.tile(np.concatenate([p.ts * p.q, p.ts * p.r]), n), p.qn])
        self.weight = diagonal
        h_pattern = ca.Sparsity.diag(self.size)
        rows, columns = [], []
        for k in range(n):
            for i in range(nx):
                rows += [k * nx + i] * (w + 1)
                columns += [*self.x_at[k], *self.u_at[k], self.x_at[k + 1][i]]
        self.rows, self.columns = np.array(rows), np.array(columns)
        a_pattern = ca.Sparsity.triplet(n * nx, self.size, rows, columns)
        # residuals that 64 bits allow: larger replacements of infinite bounds spoil them
        tol = {"hpipm": dict.fromkeys(("res_g_max", "res_b_max", "res_d_max", "res_m_max"), 1e-13) | {"iter_max": 40, "mu0": 1e2}, "inf": 1e4}
        quiet = {"print_time": False, "error_on_fail": False}
        self.hpipm = ca.conic("h", "hpipm", {"h": h_pattern, "a": a_pattern}, quiet | tol)
        # for times: residuals of 1e-8 as it has them by default
        self.quick = ca.conic("t", "hpipm", {"h": h_pattern, "a": a_pattern}, quiet | {"inf": 1e4})
        dense = {"h": ca.Sparsity.dense(n * nu, n * nu), "a": ca.Sparsity(0, n * nu)}
        self.dense = {
            "daqp": ca.conic("d", "daqp", dense, quiet | {"daqp": {"primal_tol": 1e-12, "dual_tol": 1e-12}}),
            "qpoases": ca.conic("q", "qpoases", dense, quiet | {"printLevel": "none", "terminationTolerance": 1e-12}),
        }

    def program(self, plan, measured):
        p, nx, nu, n = self.p, self.p.nx, self.p.nu, self.p.n
        nxt, a, b = (np.array(v) for v in self.step(plan.x[:-1].T, plan.u.T))
        a = [a[:, k * nx : (k + 1) * nx] for k in range(n)]
        b = [b[:, k * nu : (k + 1) * nu] for k in range(n)]
        gap = nxt.T - plan.x[1:]
        point, ref = np.zeros(self.size), np.zeros(self.size)
        for k in range(n + 1):
            point[self.x_at[k]], ref[self.x_at[k]] = plan.x[k], p.ref
        for k in range(n):
            point[self.u_at[k]] = plan.u[k]
        return a, b, gap, self.weight * (point - ref), measured - plan.x[0]

    def stages(self, plan, data):
        a, b, gap, g, dx = data
        p, n, nx = self.p, self.p.n, self.p.nx
        values = np.concatenate([np.column_stack([a[k], b[k], -np.ones(nx)]).ravel() for k in range(n)])
        order = np.lexsort((self.rows, self.columns))
        lo, hi = np.full(self.size, -np.inf), np.full(self.size, np.inf)
        lo[self.x_at[0]] = hi[self.x_at[0]] = dx
        for k in range(n):
            lo[self.u_at[k]], hi[self.u_at[k]] = p.lower - plan.u[k], p.upper - plan.u[k]
        matrix = ca.DM(self.hpipm.sparsity_in("a"), values[order])
        return {"h": ca.diag(ca.DM(self.weight)), "g": g, "a": matrix, "lba": -gap.ravel(), "uba": -gap.ravel(), "lbx": lo, "ubx": hi}

    def condensed(self, plan, data):
        a, b, gap, g, dx = data
        p, nx, nu, n = self.p, self.p.nx, self.p.nu, self.p.n
        big, free = np.zeros((nx, n * nu)), dx
        h = np.diag(np.concatenate([self.weight[at] for at in self.u_at]))
        grad = np.concatenate([g[at] for at in self.u_at])
        for k in range(n + 1):
            q = self.weight[self.x_at[k]]
            h += big.T @ (q[:, None] * big)
            grad = grad + big.T @ (q * free + g[self.x_at[k]])
            if k < n:
                big = a[k] @ big
                big[:, k * nu : (k + 1) * nu] += b[k]
                free = a[k] @ free + gap[k]
        return {"h": h, "g": grad, "lbx": np.tile(p.lower, n) - plan.u.ravel(), "ubx": np.tile(p.upper, n) - plan.u.ravel()}


class Piqp:
    """PIQP on the stages: the structure once, values at every sample."""

    def __init__(self):
        import piqp

        self.solver, self.ready = piqp.SparseSolver(), False
        self.solver.settings.eps_abs = self.solver.settings.eps_rel = 1e-9

    def __call__(self, h, g, a, b, lo, hi, inputs):
        call = self.solver.update if self.ready else self.solver.setup
        call(h, g, a, b, x_l=lo, x_u=hi)
        self.ready = True
        status = self.solver.solve()
        return np.array(self.solver.result.x), status.name == "PIQP_SOLVED"


class Clarabel:
    """Clarabel on the stages; every sample is a new object, as its structure and values are one."""

    def __init__(self):
        import clarabel

        self.lib, self.options = clarabel, clarabel.DefaultSettings()
        self.options.verbose = False

    def __call__(self, h, g, a, b, lo, hi, inputs):
        m = len(inputs)
        pick = sp.csc_matrix((np.ones(m), (np.arange(m), inputs)), shape=(m, len(g)))
        rows, right = sp.vstack([a, pick, -pick], format="csc"), np.concatenate([b, hi[inputs], -lo[inputs]])
        cones = [self.lib.ZeroConeT(len(b)), self.lib.NonnegativeConeT(2 * m)]
        found = self.lib.DefaultSolver(sp.triu(h, format="csc"), g, rows, right, cones, self.options).solve()
        return np.array(found.x), str(found.status) == "Solved"


def others():
    """The solvers that are installed."""
    found = {}
    for name, kind in (("piqp", Piqp), ("clarabel", Clarabel)):
        try:
            found[name] = kind()
        except ImportError:
            pass
    return found


def native(stage, d):
    """The stages with the initial state as equations: objective, equations, bounds, places of the controls."""
    nx = d.p.nx
    eye = sp.csc_matrix((np.ones(nx), (np.arange(nx), d.x_at[0])), shape=(nx, d.size))
    a = sp.vstack([eye, stage["a"].sparse()], format="csc")
    lo, hi = stage["lbx"].copy(), stage["ubx"].copy()
    b = np.concatenate([lo[d.x_at[0]], np.array(stage["uba"]).ravel()])
    lo[d.x_at[0]], hi[d.x_at[0]] = -np.inf, np.inf
    return sp.diags(d.weight, format="csc"), stage["g"], a, b, lo, hi, np.concatenate(d.u_at)


def called(solver, data, repeat):
    best = np.inf
    for _ in range(repeat):
        t = time.perf_counter()
        x, good = solver(*data)
        best = min(best, time.perf_counter() - t)
    return x, best, good


def timed(solver, data, repeat):
    best = np.inf
    for _ in range(repeat):
        t = time.perf_counter()
        found = solver(**data)
        best = min(best, time.perf_counter() - t)
    return np.array(found["x"]).ravel(), best, bool(solver.stats()["success"])


def run(name, repeat):
    p = Tracking(name)
    d, x = Dumped(p), p.x0
    peers = others()
    errors = {k: [] for k in ("hpipm", "daqp", "qpoases", *peers)}
    seconds, ours, failed = {k: [] for k in errors}, [], dict.fromkeys(errors, 0)
    with swb.Nmpc(p.ocp(), "rti", "d") as c:
        c.initialise(p.x0, 200)
        for k in range(p.samples):
            plan = c.plan
            prepared = c.prepare()
            u, info = c.feedback(x)
            ours.append((prepared.time, info.time))
            solution = c.plan.u.ravel() - plan.u.ravel()
            data = d.program(plan, x)
            stage, dense = d.stages(plan, data), d.condensed(plan, data)
            size = np.abs(c.plan.u).max()
            for solver in errors:
                if solver == "hpipm":
                    found, best, good = timed(d.hpipm, stage, 1)
                    best, good = timed(d.quick, stage, repeat)[1:]
                    found = np.concatenate([found[at] for at in d.u_at])
                elif solver in peers:
                    found, best, good = called(peers[solver], native(stage, d), repeat)
                    found = np.concatenate([found[at] for at in d.u_at])
                else:
                    found, best, good = timed(d.dense[solver], dense, repeat)
                failed[solver] += not good
                if np.all(np.isfinite(found)):
                    errors[solver].append(np.abs(found - solution).max() / size)
                    seconds[solver].append(best)
            x = p.step(x, u, p.plant_steps) + p.noise[k]
    ours = 1e6 * np.array(ours)
    lines = [f"{name:9} {len(ours):4} programs   ours: feedback {ours[:, 1].mean():7.1f} us, preparation {ours[:, 0].mean():8.1f} us"]
    for solver in errors:
        e, t = np.array(errors[solver]), 1e6 * np.array(seconds[solver])
        lines.append(f"          {solver:8} largest difference {e.max():7.1e}, median {np.median(e):7.1e}, call {t.mean():8.1f} us, not solved {failed[solver]}")
    print("\n".join(lines), flush=True)
    return lines


PAGE = """# Quadratic programs of control compared with HPIPM, DAQP, qpOASES, PIQP and Clarabel

| date | machine | command |
|---|---|---|
| {date} | one core of a shared machine | `bindings/python/benchmarks/nmpc_dumps.py` |

The programs are those of [closed loops](nmpc.md) under the RTI scheme, one for every sample, with derivatives of CasADi. HPIPM of CasADi's wheel has the
stages; DAQP and qpOASES have the program in the controls, without the time of eliminating the states. PIQP and Clarabel have the
stages, too, through their own packages; PIQP keeps its structure from sample to sample. Differences are those of the controls of the horizon, relative to the largest control.

```
{table}
```

HPIPM has residuals of 1e-13 for the differences and its default of 1e-8 for the times. The condensed program of the upright pendulum is badly
conditioned over two seconds: DAQP and qpOASES solve it to 1e-5 of the control and worse, at any tolerance. The library condenses the controlled system,
which is stable.

PIQP has tolerances of 1e-9, Clarabel its own of 1e-8. Calls through CasADi copy data and begin without an active set. A feedback of the library uses factors of its preparation, and a preparation includes
the linearisation. The times are those of a sample, and do not compare the methods on the same work.
"""


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "docs/benchmarks/nmpc_qp.md")
    parser.add_argument("--repeat", type=int, default=3)
    args = parser.parse_args()
    table = [line for name in ("pendulum", "chain3", "chain6") for line in run(name, args.repeat)]
    args.out.write_text(PAGE.format(date=datetime.date.today().isoformat(), table="\n".join(table)))


if __name__ == "__main__":
    main()
