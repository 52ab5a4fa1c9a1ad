"""A hand pushes a box over a rough floor, from rest to rest. The hand can only push: friction alone slows the box down.

The least effort is that of a blow: the hand swings back and strikes the box. Where the hand may not be pulled back it stays at the box. While the hand touches the box and the box slides, both are one mass under a constant force. The push of the least mean square over some stages is then the shortest
solution of two linear equations. Friction makes it dear to move all the time: the best stages are found by trying all. The answer may cost less than that, as the box may
also come to rest inside of a stage.

usage: pushed_box.py FOLDER_FOR_PLOTS
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import switchback_control as swb

BOX, HAND, MU, G, WAY, HORIZON, STAGES = 2.0, 0.5, 0.3, 9.81, 0.5, 1.2, 10


def problem(stages=STAGES, swings=True, **options):
    """The scene and the problem: positions of the box and of the hand behind it. `swings`: may the hand be pulled back?"""
    s = swb.Scene("box hand", u="push")
    s.inertia([BOX, HAND])
    s.force([0.0, s.push])
    s.friction("floor", s.q[0], MU * BOX * G)
    s.contact("touch", s.q[0] - s.q[1])
    ocp = swb.Ocp(s, HORIZON, stages, initial_state=[0.0, 0.0, 0.0, 0.0], **options)
    if swings:
        # a guess: the hand is pulled back, then both come to the goal
        ocp.set_state_guess([0.0, 0.4, 0.7, HORIZON], [[0, 0, 0, 0], [0, -0.1, 0, 0], [0, 0, 0, 1], [WAY, WAY, 0, 0]])
    else:
        ocp.set_control_bounds([0.0], [np.inf])
    ocp.set_lagrange(s.push**2)
    ocp.add_terminal([s.q[0], s.v[0]], [WAY, 0.0], [WAY, 0.0])
    return s, ocp


def together(stages=STAGES, whole=False):
    """The least cost with which both move as one mass from the start of a stage to the end of a stage, all the time if `whole`, and the push."""
    h, mass, drag = HORIZON / stages, BOX + HAND, MU * BOX * G
    best = np.inf, None
    for first in range(stages):
        for n in range(2, stages - first + 1):
            if whole and n < stages:
                continue
            t = n * h
            ends = np.vstack([h * (t - (np.arange(n) + 0.5) * h), np.full(n, h)]) / mass
            u = np.linalg.lstsq(ends, [WAY + drag / mass * t**2 / 2, drag / mass * t], rcond=None)[0]
            pushes = BOX / mass * (u - drag) + drag  # on the box: its inertia, and friction
            if np.all(pushes >= 0.0) and h * u @ u < best[0]:
                best = h * u @ u, np.concatenate([np.zeros(first), u, np.zeros(stages - first - n)])
    return best


def main(folder):
    s, ocp = problem()
    r = ocp.solve()
    print(f"{r.outcome.name}: cost {r.cost:.6f}, verdict {r.optimality.verdict}")
    stays = problem(swings=False)[1].solve()
    cost, u = together()
    print(f"without a swing {stays.cost:.6f}, verdict {stays.optimality.verdict}; as one mass {cost:.6f}")
    run = s.simulate([0.0, 0.0], [0.0, 0.0], HORIZON, u=r.controls, rtol=1e-9, atol=1e-10)
    t = np.linspace(0.0, HORIZON, 401)
    x = run(t)
    figure, axes = plt.subplots(1, 3, figsize=(11, 3.2), layout="constrained")
    for row, name in enumerate(("box", "hand")):
        axes[0].plot(t, x[:, row], label=name)
        axes[1].plot(t, x[:, 2 + row], label=name)
    axes[2].stairs(r.controls[:, 0], np.linspace(0.0, HORIZON, STAGES + 1), label="found")
    axes[2].stairs(u, np.linspace(0.0, HORIZON, STAGES + 1), linestyle="--", label="as one mass")
    for ax, word in zip(axes, ("position", "velocity", "push")):
        ax.set(xlabel="time", ylabel=word)
        ax.legend()
    figure.savefig(folder / "python_pushed_box.svg")


if __name__ == "__main__":
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    folder.mkdir(parents=True, exist_ok=True)
    main(folder)
