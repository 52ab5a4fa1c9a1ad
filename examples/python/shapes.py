"""Rounded boxes, ellipses, capsules and discs fall into a bin and come to rest on each other.

usage: shapes.py FOLDER_FOR_PLOTS
"""

import sys
from pathlib import Path

import switchback_control as swb

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)

w = swb.World(mu=0.4, e=0.1)
w.floor(), w.wall(-1.2), w.wall(1.2, free="left")
shapes = [
    w.box(0.8, 0.5, mass=1.0, rounding=0.05, name="box"),
    w.ellipse(0.45, 0.25, mass=0.5, name="ellipse"),
    w.capsule(0.5, 0.15, mass=0.5, name="capsule"),
    w.disc(0.25, mass=0.5, name="disc"),
    w.ellipse(0.3, 0.2, mass=0.5, name="egg"),
    w.box(0.5, 0.5, mass=1.0, rounding=0.1, name="cube"),
]
for k, body in enumerate(shapes):
    w.place(body, x=0.5 * (-1) ** k, y=0.5 + 0.6 * k, angle=0.4 * k)
run = w.simulate(4.0)
print(f"{len(w.scene.contacts)} contacts, {len(run.impacts)} impacts; {run.stats.steps} steps in {run.stats.time_total:.2f} s")
for body in shapes:
    way = w.trajectory(run, body, [4.0])
    print(f"{body.name:8} x {way.x[0]:6.3f}  y {way.y[0]:6.3f}  speed {abs(way.vx[0]) + abs(way.vy[0]):.0e}")
run.animate(folder / "python_shapes.gif", fps=20, size=(3.2, 4.0), limits=(-1.3, 1.3, -0.1, 4.0))
