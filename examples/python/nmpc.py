"""Swing-up of a pendulum by feedback in real time: schemes of chapter 10 beside each other, with noise and kicks.

usage: nmpc.py FOLDER_FOR_PLOTS
"""

import sys
from pathlib import Path

import numpy as np

import switchback_control as swb

SAMPLE, STAGES, SAMPLES = 0.05, 40, 120
START = [0.0, np.pi, 0.0, 0.0]
WEIGHTS, END = np.array([10, 10, 0.1, 0.1, 0.01]), np.array([100, 100, 10, 10])


def model():
    m = swb.Model(states="p theta v omega", controls="F", name="pendulum")
    (p, th, v, om), F = m.x, m.u[0]
    mc, mp, length, g = 1.0, 0.1, 0.5, 9.81
    d = mc + mp * swb.sin(th) ** 2
    t = F + mp * length * om**2 * swb.sin(th)
    dv = (t - mp * g * swb.sin(th) * swb.cos(th)) / d
    dom = ((mc + mp) * g * swb.sin(th) - t * swb.cos(th)) / (length * d)
    m.derivatives = [v, om, dv, dom]
    return m


def problem(m):
    p, th, v, om = m.x
    ocp = swb.Ocp(m, STAGES * SAMPLE, STAGES, rk_family="explicit", n_s=4, n_fe=1, control_bounds=(-12, 12))
    ocp.add_least_squares(m.function([p, th, v, om, m.u[0]]), WEIGHTS / 2, np.zeros(5))
    ocp.add_least_squares(m.function([p, th, v, om]), END / 2, np.zeros(4), at="terminal")
    ocp.set_state_guess([0, STAGES * SAMPLE], [START, [0, 0, 0, 0]])
    return ocp


def disturbances():
    """Noise by a generator anybody can repeat, and two kicks."""
    s, amplitude, table = 1, [0.0, 0.0, 0.02, 0.05], np.zeros((SAMPLES, 4))
    for k in range(SAMPLES):
        for j in range(4):
            s = (6364136223846793005 * s + 1442695040888963407) % 2**64
            table[k, j] = amplitude[j] * (2 * (s >> 11) / 2**53 - 1)
    table[60] += [0, 0, 0, 2]
    table[90] += [0, 0, -0.8, -1.5]
    return table


def cost(x, u, t):
    return SAMPLE * 0.5 * (WEIGHTS @ np.concatenate([x, u]) ** 2)


def main():
    import matplotlib.pyplot as plt

    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    folder.mkdir(parents=True, exist_ok=True)
    figure, (angles, forces) = plt.subplots(2, 1, sharex=True, figsize=(8, 6), layout="constrained")
    m = model()
    ocp, noise = problem(m), disturbances()
    print(f"{'scheme':12} {'cost':>10} {'preparation':>12} {'feedback':>9} {'worst':>7}   (microseconds)")
    for name, scheme, level, inner in [
        ("RTI", "rti", "d", 0),
        ("AS-RTI-A", "as_rti", "a", 1),
        ("AS-RTI-B-3", "as_rti", "b", 3),
        ("AS-RTI-C-3", "as_rti", "c", 3),
        ("AS-RTI-D-1", "as_rti", "d", 1),
        ("AS-RTI-D-2", "as_rti", "d", 2),
        ("ASC", "asc", "d", 50),
    ]:
        with swb.Nmpc(ocp, scheme, level, inner) as c:
            c.initialise(START)
            loop = swb.closed_loop(c, m, START, SAMPLES, noise=lambda k: noise[k], cost=cost)
        us = 1e6
        print(
            f"{name:12} {loop.cost:10.5f} {us * np.median(loop.preparation):12.1f} {us * np.median(loop.feedback):9.2f} "
            f"{us * loop.feedback.max():7.1f}"
        )
        angles.plot(loop.t, loop.x[:, 1], label=name)
        forces.step(loop.t[:-1], loop.u[:, 0], where="post")
    angles.set_ylabel("angle")
    angles.legend(ncols=4, fontsize="small")
    forces.set_ylabel("force")
    forces.set_xlabel("time")
    figure.savefig(folder / "python_nmpc.svg")
    return loop


if __name__ == "__main__":
    main()
