"""Hard bounds that contradict each other: plans against an independent solver of the program with prices."""

from __future__ import annotations

import numpy as np
import pytest

import switchback_control as swb

ca = pytest.importorskip("casadi")
N, H, PRICE = 20, 0.1, 1e3


def masses():
    """Three masses between springs, whose speeds are bounded."""
    m = swb.Model(6, 2)
    x, u = list(m.x), list(m.u)
    rates = [*x[3:], x[1] - 2 * x[0] + u[0], x[0] - 2 * x[1] + x[2], x[1] - 2 * x[2] + u[1]]
    return m, rates, [1, 1, 1, 0.1, 0.1, 0.1], [0.05] * 2, 0.5, [np.inf] * 3 + [0.6] * 3


def cart():
    """A cart between walls."""
    m = swb.Model(2, 1)
    return m, [m.x[1], m.u[0]], [1, 0.1], [0.1], 1.0, [1.0, 1.5]


class Case:
    def __init__(self, make):
        m, rates, q, r, most, bound = make()
        self.nx, self.nu, self.most = len(q), len(r), most
        m.derivatives = rates
        ocp = swb.Ocp(m, N * H, N, rk_family="explicit", n_s=4, n_fe=1, control_bounds=(-most * np.ones(self.nu), most * np.ones(self.nu)))
        ocp.add_least_squares(m.function([*m.x, *m.u]), np.array([*q, *r]) / 2, np.zeros(self.nx + self.nu))
        ocp.add_least_squares(m.function(list(m.x)), np.array(q) / 2, np.zeros(self.nx), at="terminal")
        ocp.set_state_bounds(-np.array(bound), bound)
        self.ocp, self.q, self.r, self.bound = ocp, np.array(q, float), np.array(r, float), np.array(bound)
        x, u = ca.SX.sym("x", self.nx), ca.SX.sym("u", self.nu)

        def f(x, u):
            if self.nx == 2:
                return ca.vertcat(x[1], u[0])
            return ca.vertcat(x[3], x[4], x[5], x[1] - 2 * x[0] + u[0], x[0] - 2 * x[1] + x[2], x[1] - 2 * x[2] + u[1])

        a = f(x, u)
        b = f(x + H / 2 * a, u)
        c = f(x + H / 2 * b, u)
        y = x + H / 6 * (a + 2 * b + 2 * c + f(x + H * c, u))
        step = ca.Function("step", [x, u], [ca.jacobian(y, x), ca.jacobian(y, u)])
        self.phi, self.gamma = (np.array(v) for v in step(np.zeros(self.nx), np.zeros(self.nu)))

    def cost(self, x, u):
        """The cost with prices of violations, of a plan."""
        total = 0.0
        for k in range(N + 1):
            q = self.q / 2 * (H if k < N else 1.0)
            total += q @ x**2 + (PRICE * np.maximum(np.abs(x) - self.bound, 0.0).sum() if k > 0 else 0.0)
            if k < N:
                total += H * self.r / 2 @ u[k] ** 2
                x = self.phi @ x + self.gamma @ u[k]
        return total

    def least(self, start, first=None):
        """The least cost with prices, by a solver of CasADi; the first control may be given."""
        u, s, x = ca.SX.sym("u", self.nu, N), ca.SX.sym("s", self.nx, N), ca.DM(start)
        cost, rows = 0, []
        for k in range(N):
            cost += H / 2 * (ca.dot(self.q, x**2) + ca.dot(self.r, u[:, k] ** 2))
            x = self.phi @ x + self.gamma @ u[:, k]
            cost += PRICE * ca.sum1(s[:, k])
            rows += [x - s[:, k], -x - s[:, k]]
        cost += ca.dot(self.q, x**2) / 2
        bound = np.minimum(self.bound, 1e6)
        lower = -self.most * np.ones((self.nu, N))
        upper = -lower
        if first is not None:
            lower[:, 0] = upper[:, 0] = first
        solver = ca.qpsol("qp", "daqp", {"x": ca.vertcat(ca.vec(u), ca.vec(s)), "f": cost, "g": ca.vertcat(*rows)}, {"error_on_fail": False, "print_time": False})
        found = solver(
            lbx=ca.vertcat(lower.ravel("F"), np.zeros(self.nx * N)),
            ubx=ca.vertcat(upper.ravel("F"), np.inf * np.ones(self.nx * N)),
            lbg=-np.inf,
            ubg=np.tile(np.concatenate([bound, bound]), N),
        )
        controls = np.clip(np.array(found["x"])[: self.nu * N].reshape(N, self.nu), -self.most, self.most)
        return self.cost(np.array(start), controls)


@pytest.mark.parametrize("make", [cart, masses])
@pytest.mark.parametrize("method, most", [("condensing", 0), ("stagewise", 0), ("condensing", 5), ("stagewise", 2)])
def test_violations_cost_least(make, method, most):
    case, random = Case(make), np.random.default_rng(11)
    soft = 0
    with swb.Nmpc(case.ocp, "rti", shift=True, qp_solver=method, elastic_price=PRICE, max_changes=most) as c:
        for _ in range(25):
            x = 1.6 * random.uniform(-1, 1, case.nx) * np.minimum(case.bound, 1.0)
            c.set_iterate(np.zeros((N + 1, case.nx)), np.zeros((N, case.nu)))
            c.prepare()
            u, info = c.feedback(x)
            cut = info.status is swb.NmpcQpStatus.OUT_OF_TIME
            assert not cut or (most and info.source is swb.NmpcSource.TANGENT)
            soft += info.source is swb.NmpcSource.SOFT_QP or cut
            plan = c.plan
            assert np.allclose(plan.u[0], u, atol=1e-12)
            own, least = case.cost(x, plan.u), case.least(x, u if cut else None)
            assert own <= least * (1 + 1e-6) + 1e-9, (own, least)
    assert soft >= 10
