"""A puck in space on a rough table, pushed by a force that turns: friction opposes the velocity in any direction.

usage: puck.py FOLDER_FOR_PLOTS
"""

import sys
from pathlib import Path

import numpy as np

import switchback as swb

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)

mu, g, push, turn = 0.3, 9.81, 4.0, 3.0
s = swb.Scene("x y z", name="puck")
x, y, z = s.q
s.force([push * swb.cos(turn * s.t), push * swb.sin(turn * s.t), -g])
table = s.contact("table", gap=z, tangents=[x, y], mu=mu)
run = s.simulate([0.0, 0.0, 0.0], [0.0, 0.0, 0.0], 6.0, rtol=1e-9, atol=1e-9)
print(run)
print(f"the table can hold {mu * g:.3f}, the push is {push}: it slides from the start on")
t = np.linspace(2.0, 6.0, 9)
force, v = run.force(table, t), run(t)[:, 3:5]
speed = np.linalg.norm(v, axis=1)
print("friction over mu times normal force:", np.hypot(force[:, 1], force[:, 2]) / (mu * force[:, 0]))
print("cosine between friction and velocity:", np.sum(force[:, 1:] * v, axis=1) / (speed * mu * g))
run.plot_contacts(folder / "python_puck_contacts.svg", title="A puck on a table")
run.plot_phase(folder / "python_puck.svg", states=[0, 1], title="Its way, seen from above")
