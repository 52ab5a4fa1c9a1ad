"""A block rocks from corner to corner on a floor that is rough enough; every landing takes the same share of its speed.

usage: rocking_block.py FOLDER_FOR_PLOTS
"""

import sys
from math import cos, sin
from pathlib import Path

import switchback_control as swb

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)

width, height, tilt = 0.2, 0.8, -0.15
w = swb.World(mu=1.0)
block, floor = w.box(width, height, mass=1.0, name="block"), w.floor()
w.place(block, y=0.5 * (height * cos(tilt) - width * sin(tilt)), angle=tilt)
run = w.simulate(4.0, rtol=1e-10, atol=1e-10)

b2, h2 = width**2 / 4, height**2 / 4
print(f"share of the speed that is left, exact: {(h2 - b2 / 2) / (b2 + h2):.10f}")  # of R^2 - 3/2 b^2 over R^2
speeds = []
for t in sorted({i.t for i in run.impacts}):
    omega = [float(w.trajectory(run, block, s).omega) for s in (t, t + 1e-12)]
    print(f"t = {t:.6f}: {omega[0]:+.6f} -> {omega[1]:+.6f}, share {omega[1] / omega[0]:.10f}")
    if len(speeds) > 4:
        break
    speeds.append(omega[1])
run.plot_contacts(folder / "python_rocking_block_contacts.svg", title="A rocking block: its corners")
run.plot_phase(folder / "python_rocking_block.svg", states=[2, 5], title="A rocking block")
run.animate(folder / "python_rocking_block.gif", fps=5, size=(3.6, 3.0), forces=True)
print("python_rocking_block.gif: arrows are the forces of the floor.")
