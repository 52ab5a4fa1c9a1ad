"""A gripper that holds a ball without creeping, and lets it slip at the force that Coulomb's law says.

Two fingers on slides press with a force that falls with time. The ball begins to slip where twice the friction is its weight.

usage: gripper.py FOLDER_FOR_PLOTS
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import switchback_control as swb

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)

mu, mass, g, first, rate = 0.5, 0.4, 9.81, 6.0, 1.0
w = swb.World(space=True, mu=mu, name="gripper")
ball = w.sphere(0.03, mass, name="ball")
pads = []
for name, side in (("left", -1.0), ("right", 1.0)):
    shape = swb.Shape("box", (0.01, 0.04, 0.06))
    finger = w.link(0.2, [1e-4, 1e-4, 1e-4], [shape], name=f"{name} finger")
    slide = w.joint("slider", None, finger, at=[side * 0.07, 0, 1], axis=[-side, 0, 0], name=f"{name} slide")
    pads.append((ball, w.plane([-side, 0, 0], 0.005, on=finger, name=f"{name} pad")))
    w.force(slide, lambda s: first - rate * s.t)
    w.set(slide, 0.035)
w.contacts(*pads)
w.place(ball, z=1.0)
run = w.simulate(2.4, rtol=1e-10, atol=1e-12)

slips = (first - mass * g / (2 * mu)) / rate
print(f"slips at {run.switches[0].t:.12f}, by Coulomb's law at {slips:.12f}")
held = w.trajectory(run, ball, np.linspace(0, slips - 1e-6, 50))
print(f"creep until then: {np.abs(held.z - 1.0).max():.1e}")
t = np.linspace(0, 2.4, 481)
fallen = w.trajectory(run, ball, t).z
# the friction that is missing grows with time
exact = 1.0 - np.where(t > slips, mu * rate * np.maximum(t - slips, 0.0) ** 3 / (3 * mass), 0.0)
print(f"distance from the closed form: {np.abs(fallen - exact).max():.1e}")

figure = plt.figure(figsize=(9, 3.6), layout="constrained")
w.picture(run, 0.0, figure.add_subplot(1, 3, 1, projection="3d"), limits=[-0.08, 0.08, -0.08, 0.08, 0.92, 1.08])
ax = figure.add_subplot(1, 3, 2)
ax.plot(t, fallen, label="height of the ball")
ax.axvline(slips, color="0.6", linewidth=0.8)
ax.set_xlabel("time")
ax.legend()
ax = figure.add_subplot(1, 3, 3)
force = run.force("ball-left pad", t)
ax.plot(t, mu * force[:, 0], label="what friction can hold")
ax.plot(t, np.hypot(force[:, 1], force[:, 2]), "--", label="friction")
ax.set_xlabel("time")
ax.legend()
figure.savefig(folder / "python_gripper.svg")
