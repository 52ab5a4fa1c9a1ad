"""A hundred boxes, dropped at random with spin: each bounces on its corners and edges, and comes to rest on one of its faces.

Every box is a world of its own. Its impacts accumulate before it rests: those of one corner, of an edge, and of two edges
in turn.

usage: dropped_boxes.py FOLDER_FOR_PLOTS
"""

import sys
import time
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import switchback_control as swb

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)

w = swb.World(space=True, mu=0.4, e=0.3, name="dropped boxes")
box = w.box(0.4, 0.2, 1.0, depth=0.3, name="box")
w.floor()
runs = []
began = time.perf_counter()
for seed in range(100):
    rng = np.random.default_rng(seed)
    w.place(box, z=0.5, turn=rng.normal(size=4), omega=rng.uniform(-5, 5, 3), vx=0.3)
    runs.append(w.simulate(3.0))
took = time.perf_counter() - began
rest = [r.success and np.abs(r.x_end[7:]).max() < 1e-8 for r in runs]
heights = [r.x_end[2] for r in runs if r.success]
faces = {h: sum(abs(z - h) < 1e-6 for z in heights) for h in (0.1, 0.15, 0.2)}
print(f"{sum(rest)} of {len(runs)} at rest after 3 s, {took / len(runs):.3f} s each")
print(f"impacts of a box: {min(len(r.impacts) for r in runs)} to {max(len(r.impacts) for r in runs)}")
print(f"on faces at half heights {faces}")

figure = plt.figure(figsize=(9, 3.0), layout="constrained")
ax = figure.add_subplot(1, 3, 3)
for run in runs[:30]:
    t = np.linspace(0, 1.5, 400)
    ax.plot(t, w.trajectory(run, box, t).z, linewidth=0.6)
ax.set_xlabel("time")
ax.set_ylabel("height of the centre")
for k, t in enumerate((0.2, 3.0)):
    way = w.trajectory(runs[3], box, t)
    ax = figure.add_subplot(1, 3, k + 1, projection="3d")
    w.picture(runs[3], t, ax, limits=[way.x - 0.3, way.x + 0.3, way.y - 0.3, way.y + 0.3, 0, 0.6])
    ax.set(title=f"t = {t}", xticks=[], yticks=[], zticks=[0, 0.3, 0.6])
figure.savefig(folder / "python_dropped_boxes.svg")
