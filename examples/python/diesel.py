"""Diesel generator, line and load under model predictive control (section 10.5): an unforeseen loss of load, a scheduled rise.

17 differential states of generator (Kundur), governor DEGOV1 and voltage regulator AC5A; 18 algebraic states of the machine and the
network, either in the integrator ("dae") or eliminated in closed form ("ode"). Everything is per unit on 325 kVA; data of
the OpenIPSL diesel set, CIM and IEEE 421.5 typical values. The costs are those of another implementation of the same schemes.

usage: diesel.py FOLDER_FOR_PLOTS [--quick]
"""

import sys
from pathlib import Path

import numpy as np

import switchback_control as swb

S_N, V_B, W0 = 325e3, 400.0, 2 * np.pi * 50
H, R_A, X_L, X_D, X_Q, X_D1, X_D2 = 1.07, 0.0036, 0.052, 1.56, 1.06, 0.296, 0.177
X_Q2, T_D01, T_D02, T_Q02 = 0.177, 3.7, 0.05, 0.05
T_1, T_2, T_3, K_G, T_4, T_5, T_6, T_D = 0.01, 0.02, 0.2, 40.0, 0.25, 0.009, 0.0384, 0.024
R_D, T_E, T_R, K_A, T_A, K_E, T_EX = 0.02, 0.05, 0.02, 100.0, 0.02, 1.0, 0.8
K_F, T_F1, T_F2, T_F3, S_E1, E_1, S_E2, E_2 = 0.03, 1.0, 0.02, 0.0, 0.86, 5.6, 0.5, 4.2
L_AD, L_AQ = X_D - X_L, X_Q - X_L
L_FD = L_AD * (X_D1 - X_L) / (X_D - X_D1)
L_1D = (X_D1 - X_L) * (X_D2 - X_L) / (X_D1 - X_D2)
L_1Q = L_AQ * (X_Q2 - X_L) / (X_Q - X_Q2)
R_FD = (L_AD + L_FD) / (W0 * T_D01)
R_1D = (L_1D + X_D1 - X_L) / (W0 * T_D02)
R_1Q = (L_AQ + L_1Q) / (W0 * T_Q02)
G_12, B_12 = 137.93 * V_B**2 / S_N, -344.83 * V_B**2 / S_N
B_S = np.log(S_E1 / S_E2) / (E_1 - E_2)
A_S = S_E2 * np.exp(-B_S * E_2)

LOADS = {"start": (300e3 / S_N, 100e3 / S_N), "lost": (30e3 / S_N, 10e3 / S_N), "late": (305e3 / S_N, 100e3 / S_N)}
STEADY_INPUTS = {}  # filled by `steady`


def network(psi_fd, psi_1d, psi_1q, p_l, q_l, m):
    """Voltages, powers, torque and currents from fluxes and load, in closed form: the machine is a Thevenin source behind X''.
    `m` has sqrt, for numbers or for expressions."""
    x2 = X_D2 - X_L
    ed, eq = x2 * (psi_fd / L_FD + psi_1d / L_1D), x2 * psi_1q / L_1Q
    e2 = ed * ed + eq * eq
    z = 1.0 / complex(G_12, B_12)
    r12, x12 = z.real, z.imag
    r, x, s2 = r12 + R_A, x12 + X_D2, p_l * p_l + q_l * q_l
    beta = e2 - 2.0 * (r * p_l + x * q_l)
    v2s = 0.5 * (beta + m.sqrt(beta * beta - 4.0 * (r * r + x * x) * s2))
    v1s = v2s + 2.0 * (r12 * p_l + x12 * q_l) + (r12**2 + x12**2) * s2 / v2s
    p1, q1 = p_l + r12 * s2 / v2s, q_l + x12 * s2 / v2s
    torque = p_l + r * s2 / v2s
    # A = V_2^2 + (R + jX)(P - jQ); V_2 = conj(A / (psi_d'' + j psi_q'')), q axis real; I = conj((P + jQ) / V_2)
    a_re, a_im = v2s + r * p_l + x * q_l, x * p_l - r * q_l
    v_re, v_im = (a_re * ed + a_im * eq) / e2, -(a_im * ed - a_re * eq) / e2
    i_re, i_im = (p_l * v_re + q_l * v_im) / v2s, -(q_l * v_re - p_l * v_im) / v2s
    i_q, i_d = i_re, -i_im
    psi_ad, psi_aq = ed - x2 * i_d, eq - x2 * i_q
    currents = (psi_fd - psi_ad) / L_FD, (psi_1d - psi_ad) / L_1D, (psi_1q - psi_aq) / L_1Q
    return m.sqrt(v1s), m.sqrt(v2s), p1, q1, torque, currents


def rates(x, u, torque, currents, p1, v1, e_g, t_m, v_x):
    """Derivatives of the 17 states."""
    omega, psi_fd, psi_1d, psi_1q, g1, g2, g3, g4, g5, g6, g7, g8, a1, a2, a3, a4, a5 = x
    i_fd, i_1d, i_1q = currents
    v_f = a5 + T_F3 / T_F2 * (K_F * (a3 - a4) / T_F1 - a5)
    return [
        (t_m - torque) / (2 * H),
        W0 * (R_FD / L_AD * a3 - R_FD * i_fd),
        -W0 * R_1D * i_1d,
        -W0 * R_1Q * i_1q,
        g2,
        (e_g - g1 - T_1 * g2) / (T_1 * T_2),
        (K_G * (g1 + T_3 * g2) - g3) / T_5,
        (g3 - g4) / T_6,
        g4,
        (p1 - g6) / T_E,
        g8,
        12.0 / T_D**2 * (g5 + T_4 * g4 - g7 - T_D / 2 * g8),
        (v1 - a1) / T_R,
        (K_A * (u[1] - a1 - v_f) - a2) / T_A,
        (a2 - K_E * a3 - v_x) / T_EX,
        (a3 - a4) / T_F1,
        (K_F * (a3 - a4) / T_F1 - a5) / T_F2,
    ]


def right_hand_side(x, u, p_l, q_l, m=np):
    """Rates with the algebraic states eliminated; also V_1, V_2, P_1, Q_1."""
    v1, v2, p1, q1, torque, currents = network(x[1], x[2], x[3], p_l, q_l, m)
    e_g = (1.0 - x[0]) + R_D * (u[0] - x[9])
    t_m = x[8] + T_4 * x[7] - T_D * x[11]
    v_x = A_S * m.exp(B_S * x[14]) * x[14]
    return rates(x, u, torque, currents, p1, v1, e_g, t_m, v_x), (v1, v2, p1, q1)


def residuals(x, z, u, p_l, q_l, m):
    """Rates and the 18 algebraic equations with all variables."""
    e_d, e_q, i_d, i_q, psi_d, psi_q, i_fd, i_1d, i_1q, p1, q1, e_g, t_m, v_x, v1, th1, v2, th2 = z
    omega, psi_fd, psi_1d, psi_1q = x[:4]
    c, s = m.cos(th1 - th2), m.sin(th1 - th2)
    torque = psi_d * i_q - psi_q * i_d
    dx = rates(x, u, torque, (i_fd, i_1d, i_1q), p1, v1, e_g, t_m, v_x)
    return dx + [
        psi_d + (L_AD + X_L) * i_d - L_AD * i_fd - L_AD * i_1d,
        psi_q + (L_AQ + X_L) * i_q - L_AQ * i_1q,
        psi_fd - (L_FD + L_AD) * i_fd - L_AD * i_1d + L_AD * i_d,
        psi_1d - L_AD * i_fd - (L_1D + L_AD) * i_1d + L_AD * i_d,
        psi_1q - (L_1Q + L_AQ) * i_1q + L_AQ * i_q,
        e_d + psi_q + R_A * i_d,
        e_q - psi_d + R_A * i_q,
        e_d + v1 * m.sin(th1),
        e_q - v1 * m.cos(th1),
        p1 - e_d * i_d - e_q * i_q,
        q1 - e_q * i_d + e_d * i_q,
        e_g - (1.0 - omega) - R_D * (u[0] - x[9]),
        t_m - (x[8] + T_4 * x[7]) + T_D * x[11],
        v_x - A_S * m.exp(B_S * x[14]) * x[14],
        p1 - v1 * v1 * G_12 + v1 * v2 * (G_12 * c + B_12 * s),
        q1 + v1 * v1 * B_12 + v1 * v2 * (G_12 * s - B_12 * c),
        p_l + v2 * v2 * G_12 - v1 * v2 * (G_12 * c - B_12 * s),
        q_l - v2 * v2 * B_12 + v1 * v2 * (G_12 * s + B_12 * c),
    ]


def jacobian(f, x):
    """Central differences, all columns at once."""
    h = 1e-6 * np.maximum(1.0, np.abs(x))
    up, down = f(x[:, None] + np.diag(h)), f(x[:, None] - np.diag(h))
    return (up - down) / (2 * h)


def steady(load):
    """Steady state with omega = V_2 = 1 under a load, and its inputs."""
    x = np.array([1, 1.25, 0.85, -0.55, 0, 0, 0, 0, 0.9, 0.9, 0.9, 0, 1.0, 2.5, 2.05, 2.05, 0.0, 0.9, 1.03])

    def f(v):
        dx, (_, v2, _, _) = right_hand_side(v[:17], v[17:], *load)
        return np.array([d + 0 * v[0] for d in dx[:8] + dx[9:]] + [v[0] - 1, v2 - 1, v[7] + 0 * v[0]])[:19]

    for _ in range(50):
        step = np.linalg.lstsq(jacobian(f, x), -f(x), rcond=None)[0]
        x = x + step
        if np.abs(step).max() < 1e-14:
            break
    return x[:17], x[17:]


def algebraic(x, u, load):
    """The 18 algebraic states that belong to states, by Newton's method."""
    v1, v2, p1, q1, torque, (i_fd, i_1d, i_1q) = network(x[1], x[2], x[3], *load, np)
    z = np.array([0.6, 0.8, 0.8, 0.56, 0.8, -0.6, i_fd, i_1d, i_1q, p1, q1, 0, 0.9, 0.4, v1, -0.63, v2, -0.63])

    class Numbers:
        cos, sin, exp, sqrt = np.cos, np.sin, np.exp, np.sqrt

    def f(z):
        return np.array([r + 0 * z[0] for r in residuals(x, z, u, *load, Numbers)[17:]])

    for _ in range(50):
        step = np.linalg.solve(jacobian(f, z), -f(z))
        z = z + step
        if np.abs(step).max() < 1e-13:
            break
    return z


class Plant:
    """The generator over one sample: 20 steps of the Gauss-Legendre method of order four."""

    C = np.sqrt(3) / 6
    A = np.array([[0.25, 0.25 - C], [0.25 + C, 0.25]])

    def __init__(self, sample):
        self.h, self.cost = sample / 20, 0.0

    def __call__(self, x, u, load, t):
        for _ in range(20):
            v2 = right_hand_side(x, u, *load)[1][1]
            self.cost += self.h * ((x[0] - 1) ** 2 + (v2 - 1) ** 2)
            f = lambda y: np.array([r + 0 * y[0] for r in right_hand_side(y, u, *load)[0]])  # noqa: E731
            k = np.tile(f(x), (2, 1))
            jac = jacobian(f, x)
            system = np.eye(34) - self.h * np.kron(self.A, jac)
            for _ in range(30):
                stages = x + self.h * self.A @ k
                r = (np.array([f(s) for s in stages]) - k).ravel()
                step = np.linalg.solve(system, r).reshape(2, 17)
                k = k + step
                if np.abs(self.h * step).max() < 1e-13:
                    break
            x = x + self.h * k.sum(0) / 2
        return x


def problem(n, form="ode"):
    """The optimal control problem over 10 s; parameters: load and its steady inputs."""
    names = "omega psi_fd psi_1d psi_1q g1 g2 g3 g4 g5 g6 g7 g8 a1 a2 a3 a4 a5"
    extra = "e_d e_q i_d i_q psi_d psi_q i_fd i_1d i_1q P1 Q1 e_g T_m V_x V1 th1 V2 th2"
    m = swb.Model(states=names + (" " + extra if form == "dae" else ""), controls="P_ref V_ref", parameters="P_L Q_L P_ss V_ss")
    x, u, p = list(m.x), list(m.u), list(m.p)
    if form == "dae":
        z = x[17:]
        m.derivatives = residuals(x[:17], z, u, p[0], p[1], swb)
        v1, v2, p1, q1 = z[14], z[16], z[9], z[10]
    else:
        m.derivatives, (v1, v2, p1, q1) = right_hand_side(x, u, p[0], p[1], swb)
    system = m.system()
    if form == "dae":
        system.set_algebraic(18)
    ocp = swb.Ocp(system, 10.0, n, rk_family="gauss_legendre", n_s=2, n_fe=1)
    ocp.set_control_bounds([0, 0.9], [1.1, 1.1])
    tracking = m.function([x[0] - 1, v2 - 1, 1e-2 * (u[0] - p[2]), 1e-2 * (u[1] - p[3])])
    ocp.add_least_squares(tracking, np.ones(4), np.zeros(4))
    ocp.add_least_squares(m.function([x[0] - 1, v2 - 1]), np.ones(2), np.zeros(2), at="terminal")
    limits = m.function([v1, v2, x[0], p1 * p1 + q1 * q1])
    for at in ("control_grid", "terminal"):
        for norm, weight in (("l1", 10.0), ("l2", 50.0)):
            ocp.add_relaxed(limits, [0.9, 0.9, 0.95, -np.inf], [1.1, 1.1, 1.05, 1.0], at=at, norm=norm, weight=weight)
    return ocp


def believed(k, ts, n):
    """Parameters of the nodes at sample k: the loss is known one sample late, the rise from the start."""
    rows = []
    for i in range(n + 1):
        t = k * ts + i * ts
        name = "late" if t >= 4 - 1e-9 else ("lost" if k * ts >= 1 + ts - 1e-9 else "start")
        rows.append([*LOADS[name], *STEADY_INPUTS[name]])
    return np.array(rows)


def true_load(k, ts):
    t = k * ts
    return LOADS["late" if t >= 4 - 1e-9 else ("lost" if t >= 1 - 1e-9 else "start")]


def run(n, form, scheme, level="d", inner=1, ideal=False, **options):
    """The closed loop over 8 s: cost, monitor, seconds of preparation and feedback, states. `ideal`: the next state is known."""
    ts = 10.0 / n
    for name, load in LOADS.items():
        STEADY_INPUTS[name] = tuple(steady(load)[1])
    x, u = steady(LOADS["start"])
    start = x if form == "ode" else np.concatenate([x, algebraic(x, u, LOADS["start"])])
    ocp = problem(n, form)
    ocp.set_state_guess([0.0], [start])
    ocp.set_control_guess(np.tile(u, (n, 1)))
    ocp.set_params([*LOADS["start"], *u])
    plant, times, states = Plant(ts), [], [x]
    with swb.Nmpc(ocp, scheme, level, inner, **options) as c:
        c.set_params(believed(0, ts, n))
        c.initialise(x)
        for k in range(round(8 / ts)):
            c.set_params(believed(k, ts, n))
            prepared = c.prepare(x if ideal else None)
            u, info = c.feedback(x)
            c.finish()
            times.append((prepared.time, info.time))
            x = plant(x, u, true_load(k, ts), k * ts)
            states.append(x)
        return plant.cost, c.monitor, np.array(times), np.array(states)


def main():
    import matplotlib.pyplot as plt

    quick = "--quick" in sys.argv
    folder = Path(next((a for a in sys.argv[1:] if not a.startswith("-")), "."))
    folder.mkdir(parents=True, exist_ok=True)
    figure, ax = plt.subplots(figsize=(8, 4), layout="constrained")
    table = [("rti", "d", 0, 0.00553285), ("as_rti", "d", 1, 0.00304997), ("as_rti", "d", 2, 0.0030377), ("asc", "d", 60, 0.00301974)]
    for n, form, rows in ((50, "ode", table), (50, "dae", table[:2]), (40, "dae", [("rti", "d", 0, 0.0070286), ("as_rti", "d", 1, 0.0042589)])):
        for scheme, level, inner, known in rows[: 1 if quick else None]:
            cost, monitor, times, states = run(n, form, scheme, level, inner, ideal=scheme == "asc")
            prep, feed = 1e3 * np.median(times, axis=0)
            print(f"N={n} {form} {scheme:7}{level}-{inner}: J = {cost:.8f} (known {known:.8f}), prepare {prep:.2f} ms, feedback {feed:.4f} ms")
            if (n, form) == (50, "ode"):
                ax.plot(np.linspace(0, 8, len(states)), states[:, 0], label=f"{scheme} {level}-{inner}")
    ax.set_xlabel("time in s: the load is lost at 1 s and rises at 4 s")
    ax.set_ylabel("speed of the generator")
    ax.legend()
    figure.savefig(folder / "python_diesel.svg")


if __name__ == "__main__":
    main()
