"""Quadratic programs of controllers over the length of the horizon, beside HPIPM and DAQP as CasADi's wheel has them.

usage: nmpc_horizon.py [--out FILE] [--longest N]

A chain of three masses between springs with two forces, sampled at 0.1 s: 6 states, 2 controls with bounds, bounds of the velocities that may not be
violated. The state of every sample is that of the plant with random blows. HPIPM has the stages, without a guess; DAQP has the program in the
controls, without the time of eliminating the states. Times are those of calls: the median over the samples, in microseconds.

Then, for every length, states from which the bounds of the velocities cannot be met.
"""

from __future__ import annotations

import argparse
import datetime
import time
from pathlib import Path

import casadi as ca
import numpy as np

import switchback_control as swb

ROOT = Path(__file__).resolve().parents[3]
H, NX, NU, LIMIT, FASTEST = 0.1, 6, 2, 0.5, 0.6
Q, R, QN = np.array([1.0, 1, 1, 0.1, 0.1, 0.1]), np.array([0.05, 0.05]), np.array([5.0, 5, 5, 1, 1, 1])


def rates(x, u):
    q, v = x[:3], x[3:]
    a = [q[1] - 2 * q[0] + u[0], q[0] - 2 * q[1] + q[2], q[1] - 2 * q[2] + u[1]]
    return [*v, *a]


def discrete():
    """The classical Runge-Kutta step of the linear system."""
    x, u = ca.SX.sym("x", NX), ca.SX.sym("u", NU)
    f = ca.vertcat(*rates([x[i] for i in range(NX)], [u[j] for j in range(NU)]))
    a, b = (np.array(ca.DM(ca.jacobian(f, v))) for v in (x, u))
    z, i = H * a, np.eye(NX)
    phi = i + z + z @ z / 2 + z @ z @ z / 6 + z @ z @ z @ z / 24
    return phi, H * (i + z / 2 + z @ z / 6 + z @ z @ z / 24) @ b


A, B = discrete()


def controller(n, method):
    m = swb.Model(NX, NU)
    x, u = list(m.x), list(m.u)
    m.derivatives = rates(x, u)
    ocp = swb.Ocp(m, n * H, n, rk_family="explicit", n_s=4, n_fe=1, control_bounds=(-LIMIT, LIMIT))
    ocp.add_least_squares(m.function(x + u), np.concatenate([Q, R]) / 2, np.zeros(NX + NU))
    ocp.add_least_squares(m.function(x), QN / 2, np.zeros(NX), at="terminal")
    ocp.set_state_bounds([-np.inf] * 3 + [-FASTEST] * 3, [np.inf] * 3 + [FASTEST] * 3)
    return swb.Nmpc(ocp, "rti", qp_solver=method)


def samples(count, blow):
    """States of a closed loop with a blow every ten samples, whose velocities are within their bounds."""
    r = np.random.default_rng(3)
    with controller(20, "condensing") as c:
        x, out = np.zeros(NX), []
        for k in range(count):
            if k % 10 == 0:
                x = x + blow * np.concatenate([r.standard_normal(3), 0.5 * r.standard_normal(3)])
            x[3:] = np.clip(x[3:], -0.95 * FASTEST, 0.95 * FASTEST)
            out.append(x.copy())
            c.prepare()
            u, _ = c.feedback(x)
            x = A @ x + B @ u + 0.005 * r.standard_normal(NX)
    return out


def loop(n, method, xs):
    """Seconds of preparations and feedbacks, steps, controls and whether rows were met, for every state."""
    with controller(n, method) as c:
        rows = []
        for x in xs:
            prepared = c.prepare()
            u, info = c.feedback(x)
            c.finish()
            rows.append((1e6 * prepared.time, 1e6 * info.time, info.iterations, u, info.source is swb.NmpcSource.QP))
    return rows


class Peers:
    def __init__(self, n):
        self.n, w = n, NX + NU
        size = n * w + NX
        self.x_at = [np.arange(k * w, k * w + NX) for k in range(n + 1)]
        self.u_at = [np.arange(k * w + NX, (k + 1) * w) for k in range(n)]
        self.weight = np.concatenate([np.tile(np.concatenate([H * Q, H * R]), n), QN])
        rows, cols, vals = [], [], []
        for k in range(n):
            for i in range(NX):
                rows += [k * NX + i] * (w + 1)
                cols += [*self.x_at[k], *self.u_at[k], self.x_at[k + 1][i]]
                vals += [*A[i], *B[i], -1.0]
        a = ca.Sparsity.triplet(n * NX, size, rows, cols)
        order = np.lexsort((np.array(rows), np.array(cols)))
        self.a = ca.DM(a, np.array(vals)[order])
        quiet = {"print_time": False, "error_on_fail": False}
        patterns = {"h": ca.Sparsity.diag(size), "a": a}
        self.hpipm = ca.conic("h", "hpipm", patterns, quiet | {"inf": 1e4})
        # for the differences: residuals that 64 bits allow
        tight = dict.fromkeys(("res_g_max", "res_b_max", "res_d_max", "res_m_max"), 1e-12) | {"iter_max": 60, "mu0": 1e2}
        self.tight = ca.conic("g", "hpipm", patterns, quiet | {"inf": 1e4, "hpipm": tight})
        self.lo, self.hi = np.full(size, -np.inf), np.full(size, np.inf)
        for k in range(n + 1):
            self.lo[self.x_at[k][3:]], self.hi[self.x_at[k][3:]] = -FASTEST, FASTEST
        for k in range(n):
            self.lo[self.u_at[k]], self.hi[self.u_at[k]] = -LIMIT, LIMIT
        self.daqp = None
        if n <= 160:
            self.dense(quiet)

    def dense(self, quiet):
        n = self.n
        big, free = np.zeros((NX, n * NU)), np.eye(NX)
        self.h, self.g = np.diag(np.tile(H * R, n)), np.zeros((n * NU, NX))
        rows, offsets = [], []
        for k in range(n + 1):
            q = self.weight[self.x_at[k]]
            self.h += big.T @ (q[:, None] * big)
            self.g += big.T @ (q[:, None] * free)
            if k > 0:
                rows.append(big[3:].copy())
                offsets.append(free[3:].copy())
            if k < n:
                big = A @ big
                big[:, k * NU : (k + 1) * NU] += B
                free = A @ free
        self.rows, self.offsets = np.vstack(rows), np.vstack(offsets)
        dense = {"h": ca.Sparsity.dense(n * NU, n * NU), "a": ca.Sparsity.dense(*self.rows.shape)}
        self.daqp = ca.conic("d", "daqp", dense, quiet)

    def solve(self, x):
        self.lo[self.x_at[0]] = self.hi[self.x_at[0]] = x
        zero = np.zeros(self.n * NX)
        data = {"h": ca.diag(ca.DM(self.weight)), "g": np.zeros(len(self.weight)), "a": self.a, "lba": zero, "uba": zero, "lbx": self.lo, "ubx": self.hi}
        t = time.perf_counter()
        self.hpipm(**data)
        hpipm = time.perf_counter() - t
        first, daqp = np.array(self.tight(**data)["x"]).ravel()[self.u_at[0]], np.nan
        if self.daqp is not None:
            off = self.offsets @ x
            n = self.n
            data = {"h": self.h, "g": self.g @ x, "a": self.rows, "lba": -FASTEST - off, "uba": FASTEST - off}
            data |= {"lbx": np.full(n * NU, -LIMIT), "ubx": np.full(n * NU, LIMIT)}
            t = time.perf_counter()
            self.daqp(**data)
            daqp = time.perf_counter() - t
        return first, hpipm, daqp


PAGE = """# Quadratic programs of control over the length of the horizon

| date | machine | command |
|---|---|---|
| {date} | one core of a shared machine | `bindings/python/benchmarks/nmpc_horizon.py` |

Three masses between springs with two forces: 6 states, 2 controls with bounds, bounds of the velocities that may not be violated. A blow
comes every ten samples. HPIPM and DAQP are those of CasADi's wheel, called through CasADi without a guess; DAQP gets the program in the controls, without
the time of eliminating the states. Times are medians over the samples in microseconds. The difference is that of the first control to HPIPM with
residuals of 1e-12.

```
{table}
```

With larger blows there are states from which the bounds cannot be met. Means and longest feedbacks of samples where they are met and where
they are not:

```
{soft}
```

Both phases of `stagewise` take about twice as long for twice the horizon, also where bounds cannot be met. Condensing has the faster feedback while its
active set changes little. Its preparation grows faster than the second power of the horizon, and so do large changes of the active set.
"""


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "docs/benchmarks/nmpc_horizon.md")
    parser.add_argument("--longest", type=int, default=640)
    args = parser.parse_args()
    calm, hard = samples(80, 0.15), samples(80, 0.6)
    lines = ["        condensing          stagewise               HPIPM     DAQP", "   N  prepare feedback   prepare feedback steps     call     call difference"]
    soft = ["        condensing          stagewise", "   N      met  worst  unmet   worst      met  worst   unmet   worst"]
    for n in [n for n in (10, 20, 40, 80, 160, 320, 640) if n <= args.longest]:
        methods = ("condensing", "stagewise") if n <= 320 else ("stagewise",)
        ours = {m: loop(n, m, calm) for m in methods}
        peers = Peers(n)
        found = [peers.solve(x) for x in calm]
        off = max(np.abs(f[0] - r[3]).max() for f, r in zip(found, ours["stagewise"]) if r[4])
        hpipm, daqp = (1e6 * np.median([f[i] for f in found]) for i in (1, 2))
        line, bad = f"{n:4d}", f"{n:4d}"
        for m in ("condensing", "stagewise"):
            rows = ours.get(m, [(np.nan, np.nan, np.nan, None, True)])
            line += f" {np.median([r[0] for r in rows]):8.1f} {np.median([r[1] for r in rows]):8.1f} "
            worse = loop(n, m, hard) if m in ours else rows
            for met in (True, False):
                t = [r[1] for r in worse if r[4] is met] or [np.nan]
                bad += f" {np.mean(t):8.0f} {max(t):6.0f}"
        steps = np.mean([r[2] for r in ours["stagewise"]])
        lines.append(f"{line}{steps:5.1f} {hpipm:8.1f} {daqp:8.1f} {off:10.1e}")
        soft.append(bad)
        print(lines[-1], "|", bad, flush=True)
    page = PAGE.format(date=datetime.date.today().isoformat(), table="\n".join(lines), soft="\n".join(soft))
    args.out.write_text(page.replace(" nan", "   -"))


if __name__ == "__main__":
    main()
