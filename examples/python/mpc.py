"""Model predictive control of a block with dry friction: every control interval an optimal control problem is solved for the
state that was measured, and its first control is applied. The plant has more friction than the model knows.

Printed: derivatives of the optimum against differences, and what a solve costs from scratch ("cold"), from the last solution
moved on by one interval ("shift"), and with the active set of the last solution tried first ("warm"). That set has its
switches in the stages where they were: the best start for another state over the same horizon, as for the differences, while
over a horizon that moves on it keeps a switch behind its time, at the price of a worse optimum. Plotted: the closed loop.

usage: mpc.py FOLDER_FOR_PLOTS
"""

import sys
import time
from pathlib import Path

import numpy as np

import switchback_control as swb
from switchback_control import sign
from switchback_control.expr import Model

STAGES, INTERVAL, STEPS = 10, 0.2, 25


def block(friction):
    """A mass on a surface, with a position-dependent spring of its own."""
    m = Model(states="position speed", controls="force")
    (q, v), force = m.x, m.u[0]
    m.derivatives = [v, force - 0.5 * q - friction * sign(v)]
    return m


def problem():
    """From the state measured to the position 1, in 10 intervals."""
    m = block(0.5)
    q, v = m.x
    ocp = swb.Ocp(m, STAGES * INTERVAL, STAGES, n_s=3, n_fe=2, control_bounds=(-3, 3))
    ocp.set_initial_state([0, 0])
    ocp.add_least_squares(m.function([q, v]), [10, 1], [1, 0])
    ocp.add_least_squares(m.function([m.u[0]]), [0.05], 0.0)
    ocp.add_least_squares(m.function([q, v]), [20, 5], [1, 0], at="terminal")
    return ocp


def check_sensitivity(ocp, x):
    """Largest difference of the derivatives of cost and controls to central differences."""

    def solve(dx):
        ocp.set_initial_state(x + dx)
        return ocp.solve(warm=True)

    solve(np.zeros(2))
    s, worst, h = ocp.sensitivity(), 0.0, 1e-6
    for i, e in enumerate(np.eye(2)):
        up, down = solve(h * e), solve(-h * e)
        by_cost = (up.cost - down.cost) / (2 * h) - s.cost_x0[i]
        by_controls = (up.controls - down.controls) / (2 * h) - s.controls_x0[..., i]
        worst = max(worst, abs(by_cost), np.abs(by_controls).max())
    return worst


def loop(how):
    """Times, states, controls of the closed loop and seconds of the solves; `how` a solve starts: "cold", "shift", "warm"."""
    plant = block(0.55).system()
    ocp, x = problem(), np.array([0.0, 0.0])
    t, states, controls, seconds = [0.0], [x], [], []
    for k in range(STEPS):
        if k == 12:
            x = x + [-0.4, 0.0]  # someone pushes the block back
        ocp.set_initial_state(x)
        if k and how == "shift":
            ocp.shift()
        start = time.perf_counter()
        r = ocp.solve(warm=how == "warm")
        seconds.append(time.perf_counter() - start)
        if not r.success:
            raise RuntimeError(f"interval {k}: {r.message}")
        run = swb.simulate(plant, x, INTERVAL, u=r.controls[0])
        inside = np.linspace(0, INTERVAL, 9)[1:]
        t.extend(k * INTERVAL + inside)
        states.extend(run(inside))
        controls.append(r.controls[0, 0])
        x = run.x_end
    return np.array(t), np.array(states), np.array(controls), np.array(seconds)


def main() -> int:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    folder.mkdir(parents=True, exist_ok=True)
    worst = check_sensitivity(problem(), np.array([0.3, 0.4]))
    print(f"derivatives of cost and controls with respect to the state: {worst:.1e} off differences")
    print("start    first ms   median ms   worst ms   off the target")
    for how in ("warm", "shift", "cold"):
        t, x, u, seconds = loop(how)
        ms = 1e3 * seconds
        print(f"{how:<6}{ms[0]:11.1f}{np.median(ms[1:]):12.1f}{ms[1:].max():11.1f}{abs(x[-1, 0] - 1):17.1e}")

    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(3, 1, sharex=True, figsize=(8, 7), layout="constrained")
    axes[0].plot(t, x[:, 0], label="position")
    axes[0].plot(t, x[:, 1], label="speed")
    axes[0].axhline(1.0, color="0.6", linestyle=":", label="target")
    axes[0].legend()
    axes[0].set_title("The block moves to 1 and sticks there; at 2.4 someone pushes it back")
    edges = INTERVAL * np.arange(STEPS + 1)
    axes[1].stairs(u, edges, baseline=None)
    axes[1].set_ylabel("force")
    axes[2].bar(edges[:-1], ms, INTERVAL, align="edge", edgecolor="white")
    axes[2].set(ylabel="solve / ms", xlabel="time")
    for ax in axes:
        ax.grid(color="0.9")
        ax.set_axisbelow(True)
    figure.savefig(folder / "mpc.svg")
    return int(worst > 1e-4)


if __name__ == "__main__":
    sys.exit(main())
