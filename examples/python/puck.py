"""A puck in space on a rough table, pushed by a force that grows and turns: it sticks until the force is too strong, then
friction opposes the velocity in any direction.

usage: puck.py FOLDER_FOR_PLOTS
"""

import sys
from pathlib import Path

import numpy as np

import switchback_control as swb

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)

mu, g, push, turn = 0.3, 9.81, 4.0, 3.0
s = swb.Scene("x y z", name="puck")
x, y, z = s.q
strength = push * (1 - swb.exp(-s.t))
s.force([strength * swb.cos(turn * s.t), strength * swb.sin(turn * s.t), -g])
table = s.contact("table", gap=z, tangents=[x, y], mu=mu)
run = s.simulate([0.0, 0.0, 0.0], [0.0, 0.0, 0.0], 8.0, rtol=1e-9, atol=1e-9)
print(run)
exact = -np.log(1 - mu * g / push)
print(f"it slides from t = {run.switch_times[0]:.10f} on, exactly {exact:.10f}, where the push is {mu * g:.3f}, all that friction can hold")
t = np.linspace(2.0, 8.0, 9)
force, v = run.force(table, t), run(t)[:, 3:5]
speed = np.linalg.norm(v, axis=1)
print("friction over mu times normal force:", np.hypot(force[:, 1], force[:, 2]) / (mu * force[:, 0]))
print("cosine between friction and velocity:", np.sum(force[:, 1:] * v, axis=1) / (speed * mu * g))
run.plot_contacts(folder / "python_puck_contacts.svg", title="A puck on a table")
run.plot_phase(folder / "python_puck.svg", states=[0, 1], title="Its way, seen from above")
