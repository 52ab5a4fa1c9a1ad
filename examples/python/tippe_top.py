"""A tippe top: a ball that is heavy at its bottom, spins fast, and turns itself upside down.

It is spun about the vertical with its axis a little tilted. The friction at its lowest point lifts the middle of its mass, which costs spin. Whatever the friction is, Jellett's constant stays: the
angular momentum along the line from the middle of mass to the point that touches (J. H. Jellett, *A treatise on the theory of friction*, 1872).

usage: tippe_top.py FOLDER_FOR_PLOTS
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import switchback_control as swb

RADIUS, MASS, LIFT, SPIN, TILT = 0.02, 0.02, 0.006, 180.0, 0.1


def turned(q, v):
    """Vectors of the body in space: `q` has the quaternions as rows."""
    p, u = q[:, :1], q[:, 1:]
    return v + 2 * p * np.cross(u, v) + 2 * np.cross(u, np.cross(u, v))


def spun(end, **tolerances):
    """The world and a run of the top; at 400 times the vertical part of its axis, Jellett's constant, the energy, and its way."""
    w = swb.World(space=True, mu=0.3, name="tippe top")
    top = w.sphere(RADIUS, MASS, 0.4 * MASS * RADIUS**2 * np.ones(3), centre=[0, 0, LIFT], name="top")
    w.floor()
    w.place(top, z=RADIUS - LIFT * np.cos(TILT), turn=[TILT, 0, 0], omega=[0, 0, SPIN])
    run = w.simulate(end, **tolerances)
    way = w.trajectory(run, top, np.linspace(0, end, 400))
    axis = turned(way.quaternion, np.tile([0.0, 0.0, 1.0], (400, 1)))
    # round inertia: momentum is along the spin
    momentum = 0.4 * MASS * RADIUS**2 * way.omega
    jellett = (momentum * (LIFT * axis - [0, 0, RADIUS])).sum(1)
    speed = np.array([way.vx, way.vy, way.vz])
    energy = 0.5 * MASS * (speed**2).sum(0) + 0.5 * (momentum * way.omega).sum(1) + 9.81 * MASS * way.z
    return w, run, axis[:, 2], jellett, energy, way


if __name__ == "__main__":
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    folder.mkdir(parents=True, exist_ok=True)
    end = 4.0
    w, run, height, jellett, energy, way = spun(end, rtol=1e-7, atol=1e-9)
    print(f"axis {height[0]:.3f} at the start and {height[-1]:.3f} at the end, {run.stats.steps} steps")
    print(f"Jellett's constant changes by {np.ptp(jellett) / abs(jellett[0]):.0e} of itself, energy falls from {energy[0]:.4f} to {energy[-1]:.4f} J")
    figure = plt.figure(figsize=(9, 3.6), layout="constrained")
    ax = figure.add_subplot(1, 2, 2)
    t = np.linspace(0, end, 400)
    ax.plot(t, height, label="axis, vertical part")
    ax.plot(t, way.omega[:, 2] / SPIN, label="spin, part of the first one")
    ax.axhline(0.0, color="0.6", linewidth=0.8)
    ax.set_xlabel("time in s")
    ax.legend()
    w.picture(run, end, figure.add_subplot(1, 2, 1, projection="3d"))
    figure.savefig(folder / "python_tippe_top.svg")
