"""Quadratic programs of controllers beside DAQP, qrqp and IPOPT as CasADi's wheel has them.

    python nmpc_qp.py [programs]

Random linear systems with bounds of controls, bounds of states and prices of violations: a controller's plan is the solution of one
quadratic program, which the others solve with states and slacks as variables. Printed are the largest differences of the controls,
relative to the largest control, and seconds: of ours the feedback alone and with its preparation, of theirs the call.
"""

import sys
import time

import casadi as ca
import numpy as np

import switchback_control as swb

H = 0.1


def system(r, nx, nu):
    a = 0.6 * r.standard_normal((nx, nx)) / np.sqrt(nx)
    return a - 0.1 * np.eye(nx), r.standard_normal((nx, nu))


def discrete(a, b):
    """The classical Runge-Kutta step of x' = a x + b u."""
    n, i = len(a), np.eye(len(a))
    z = H * a
    phi = i + z + z @ z / 2 + z @ z @ z / 6 + z @ z @ z @ z / 24
    psi = H * (i + z / 2 + z @ z / 6 + z @ z @ z / 24)
    return phi, psi @ b, n


def controller(a, b, n, q, r, qn, limit, box, price):
    nx, nu = b.shape
    m = swb.Model(nx, nu)
    x, u = list(m.x), list(m.u)
    m.derivatives = [sum(a[i, j] * x[j] for j in range(nx)) + sum(b[i, j] * u[j] for j in range(nu)) for i in range(nx)]
    ocp = swb.Ocp(m, n * H, n, rk_family="explicit", n_s=4, n_fe=1, control_bounds=(-limit, limit))
    ocp.add_least_squares(m.function(x + u), np.concatenate([q, r]), np.zeros(nx + nu))
    ocp.add_least_squares(m.function(x), qn, np.zeros(nx), at="terminal")
    if price is None:
        if np.isfinite(box):
            ocp.set_state_bounds(np.full(nx, -box), np.full(nx, box))
    else:
        f = m.function(x)
        for norm, weight in zip(("l1", "l2"), price):
            if weight > 0:
                ocp.add_relaxed(f, np.full(nx, -box), np.full(nx, box), at="control_grid", norm=norm, weight=weight)
    return swb.Nmpc(ocp)


def peer(name, a, b, n, q, r, qn, limit, box, price, x0):
    """The same program for a solver of CasADi: x, u, slacks by node."""
    phi, psi, nx = discrete(a, b)
    nu = b.shape[1]
    soft = price is not None
    x, u = ca.SX.sym("x", nx, n + 1), ca.SX.sym("u", nu, n)
    s = ca.SX.sym("s", nx, n + 1) if soft else ca.SX(nx, n + 1)
    cost, g, lg, ug = 0, [], [], []
    for k in range(n):
        cost += H * (ca.dot(ca.DM(q), x[:, k] ** 2) + ca.dot(ca.DM(r), u[:, k] ** 2))
        g.append(ca.mtimes(phi, x[:, k]) + ca.mtimes(psi, u[:, k]) - x[:, k + 1])
        lg.append(np.zeros(nx)), ug.append(np.zeros(nx))
        if soft and k > 0:
            cost += H * (price[0] * ca.sum1(s[:, k]) + price[1] * ca.dot(s[:, k], s[:, k]))
            g.append(x[:, k] - s[:, k]), lg.append(np.full(nx, -np.inf)), ug.append(np.full(nx, box))
            g.append(x[:, k] + s[:, k]), lg.append(np.full(nx, -box)), ug.append(np.full(nx, np.inf))
    cost += ca.dot(ca.DM(qn), x[:, n] ** 2)
    if soft:
        cost += 1e-3 * (ca.dot(s[:, 0], s[:, 0]) + ca.dot(s[:, n], s[:, n]))
    w = ca.vertcat(ca.vec(x), ca.vec(u), ca.vec(s) if soft else ca.SX(0, 1))
    lo, hi = np.full(w.numel(), -np.inf), np.full(w.numel(), np.inf)
    lo[:nx], hi[:nx] = x0, x0
    if not soft and np.isfinite(box):
        lo[nx : nx * (n + 1)], hi[nx : nx * (n + 1)] = -box, box
    at = nx * (n + 1)
    lo[at : at + nu * n], hi[at : at + nu * n] = -limit, limit
    if soft:
        lo[at + nu * n :] = 0.0
    options = {"print_time": 0, "error_on_fail": False}
    if name == "ipopt":
        options |= {"ipopt.print_level": 0, "ipopt.tol": 1e-12, "ipopt.bound_relax_factor": 0.0, "ipopt.mu_target": 0.0, "ipopt.sb": "yes"}
        solver = ca.nlpsol("s", "ipopt", {"x": w, "f": cost, "g": ca.vertcat(*g)}, options)
    else:
        if name == "daqp":
            options |= {"daqp": {"primal_tol": 1e-11, "dual_tol": 1e-11}}
        if name == "hpipm":
            tol = dict.fromkeys(("tol_stat", "tol_eq", "tol_ineq", "tol_comp"), 1e-11)
            options |= {"hpipm": tol | {"iter_max": 200}}
        if name == "qrqp":
            options |= {"print_iter": False, "print_header": False, "print_info": False}
        solver = ca.qpsol("s", name, {"x": w, "f": cost, "g": ca.vertcat(*g)}, options)
    best = np.inf
    for _ in range(3):
        t = time.perf_counter()
        found = solver(lbx=lo, ubx=hi, lbg=np.concatenate(lg), ubg=np.concatenate(ug))
        best = min(best, time.perf_counter() - t)
    # a method that says it failed is not compared
    good = solver.stats()["success"]
    return (np.array(found["x"]).ravel()[at : at + nu * n] if good else None), best


def main():
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 40
    r = np.random.default_rng(1)
    names = ["daqp", "qrqp", "ipopt"]
    worst, ours = {name: [] for name in names}, []
    kinds = [(np.inf, None), (1.0, (2.0, 0.0)), (1.0, (0.0, 5.0)), (1.0, (1.0, 3.0)), (3.0, None)]
    for case in range(count):
        nx, nu, n = int(r.integers(2, 7)), int(r.integers(1, 4)), int(r.integers(5, 20))
        box, price = kinds[case % len(kinds)]
        a, b = system(r, nx, nu)
        q, w, qn = 0.1 + r.random(nx), 0.05 + 0.2 * r.random(nu), 1.0 + r.random(nx)
        x0 = r.standard_normal(nx) * (1.0 if box == np.inf else 0.9 * min(box, 1.5))
        args = (a, b, n, q, w, qn, 0.6, box, price)
        with controller(*args) as c:
            prepared = c.prepare()
            _, info = c.feedback(x0)
            if info.source != swb.NmpcSource.QP:
                continue
            u = c.plan.u.ravel()
            best = [prepared.time, info.time]
            for _ in range(3):
                c.reset()
                best = np.minimum(best, [c.prepare().time, c.feedback(x0)[1].time])
        ours.append(best)
        for name in names:
            v, seconds = peer(name, *args, x0)
            if v is not None:
                worst[name].append((np.abs(u - v).max() / np.abs(u).max(), seconds))
    ours = np.array(ours)
    print(f"{len(ours)} programs; preparation {1e6 * ours[:, 0].mean():.1f} us, feedback {1e6 * ours[:, 1].mean():.2f} us (cold)")
    for name in names:
        d = np.array(worst[name])
        print(f"{name:6} solves {len(d)}: largest difference {d[:, 0].max():.1e}, median {np.median(d[:, 0]):.1e}, call {1e6 * d[:, 1].mean():.0f} us")


if __name__ == "__main__":
    main()
