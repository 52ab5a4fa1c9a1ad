"""A hundred rounded boxes fall into one bin and come to rest on each other: 40 800 contacts, by time stepping.

Of all corners that may touch another box few are near. The others cost a bound now and then.

usage: pile_of_boxes.py FOLDER_FOR_PLOTS [BOXES]
"""

import sys
import time
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import switchback_control as swb

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)
count = int(sys.argv[2]) if len(sys.argv) > 2 else 100

rng = np.random.default_rng(0)
began = time.perf_counter()
w = swb.World(mu=0.5, name="pile of boxes")
w.floor(), w.wall(-3.0), w.wall(3.0, free="left")
boxes = [w.box(0.5, 0.3, mass=1.0, rounding=0.02, name=f"{k}") for k in range(count)]
for k, box in enumerate(boxes):
    w.place(box, x=-2.4 + k % 8 * 0.68 + 0.02 * rng.normal(), y=0.4 + 0.65 * (k // 8), angle=rng.uniform(-1, 1))
scene = w.scene
scene.system()
built = time.perf_counter()
run = scene.simulate_steps(*w.start(), 5.0, 2e-3)
took = time.perf_counter() - built
n = scene.n_q
print(f"{len(scene.contacts)} contacts, written in {built - began:.1f} s; {run.stats.steps} steps in {took:.1f} s, {run.stats.most_contacts} closed at most")
print(f"gaps looked at in a step: {run.stats.gaps / run.stats.steps:.0f}; bounds: {run.stats.bounds / run.stats.steps:.0f}")
print(f"fastest at the end: {np.abs(run.x[-1, n:]).max():.0e}")

figure, ax = plt.subplots(figsize=(4.4, 3.4), layout="constrained")
s = np.linspace(0.0, 2.0 * np.pi, 41)[:-1] + 1e-6
circle = np.array([np.cos(s), np.sin(s)])
line = np.sign(circle) * [[0.25 - 0.02], [0.15 - 0.02]] + 0.02 * circle
for x, y, a in run.x[-1, :n].reshape(-1, 3):
    turn = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
    ax.fill(*(turn @ line + [[x], [y]]), alpha=0.7)
ax.plot([-3, -3, 3, 3], [4.5, 0, 0, 4.5], color="0.3")
ax.set_aspect("equal")
figure.savefig(folder / "python_pile_of_boxes.svg")
