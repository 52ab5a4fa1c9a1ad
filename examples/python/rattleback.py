"""A rattleback: a stone whose spin turns back, soon from one direction and late from the other.

It is half an ellipsoid, whose axes of inertia are not those of its surface. When spun it begins to rattle, stops, and turns
the other way. It rolls without sliding, so its energy is kept.

usage: rattleback.py FOLDER_FOR_PLOTS
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import switchback_control as swb

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)

a, b, c, lift, skew = 0.2, 0.03, 0.02, 0.01, 0.1
turn = np.array([[np.cos(skew), -np.sin(skew), 0], [np.sin(skew), np.cos(skew), 0], [0, 0, 1]])
inertia = turn @ np.diag([2e-4, 1.6e-3, 1.7e-3]) @ turn.T
w = swb.World(space=True, mu=2.0, name="rattleback")
stone = w.ellipsoid(a, b, c, 1.0, inertia, centre=[0, 0, lift], name="stone")
w.floor()
t = np.linspace(0, 8, 1601)
figure = plt.figure(figsize=(9, 3.6), layout="constrained")
ax = figure.add_subplot(1, 2, 2)
for spin in (3.0, -3.0):
    tilt = 0.005
    w.place(stone, z=np.hypot(c * np.cos(tilt), b * np.sin(tilt)) - lift * np.cos(tilt) + 1e-9, turn=[tilt, 0, 0], omega=[0, 0, spin])
    run = w.simulate(8.0, rtol=1e-8, atol=1e-10)
    way = w.trajectory(run, stone, t)
    energy = []
    for k in (20, -1):
        v, o = np.array([way.vx[k], way.vy[k], way.vz[k]]), way.omega[k]
        p, q = way.quaternion[k][0], way.quaternion[k][1:]
        own = o - 2 * p * np.cross(q, o) + 2 * np.cross(q, np.cross(q, o))  # along the axes of the stone
        energy.append(0.5 * v @ v + 0.5 * own @ inertia @ own + 9.81 * way.z[k])
    print(f"spin {spin:4.1f}: {way.omega[-1, 2]:6.3f} after 8 s, energy {energy[0]:.9f} and {energy[1]:.9f}")
    ax.plot(t, way.omega[:, 2], label=f"begins with {spin:g} rad/s")
ax.axhline(0.0, color="0.6", linewidth=0.8)
ax.set_xlabel("time")
ax.set_ylabel("spin in rad/s")
ax.legend()
w.picture(run, 1.0, figure.add_subplot(1, 2, 1, projection="3d"))
figure.savefig(folder / "python_rattleback.svg")
