"""A ball that bounces until it rests: infinitely many impacts in finite time.

    y'' = -g,   y >= 0,   after an impact the speed is e times what it was

usage: bouncing_ball.py FOLDER_FOR_PLOTS
"""

import sys
from pathlib import Path

import numpy as np

import switchback_control as swb

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)

s = swb.Scene("y", name="ball")
s.force([-9.81])
floor = s.contact("floor", gap=s.q[0], e=0.8)
run = s.simulate([1.0], [0.0], 5.0, rtol=1e-10, atol=1e-10, sensitivity=True)
print(f"{len(run.impacts)} impacts, then at rest from t = {run.accumulations[0].t:.8f} on")
print(f"exact: {np.sqrt(2 / 9.81) * (1 + 0.8) / (1 - 0.8):.8f}; at the end the floor carries {run.force(floor, 5.0)[0]:.4f}")
run.plot(folder / "python_bouncing_ball.svg", title="A ball that bounces, and rests")
run.plot_phase(folder / "python_bouncing_ball_phase.svg", title="Height and speed: impacts are dotted")

print("time of the third impact with respect to height and speed at the start:", run.impact_derivatives[2])
