"""Three blocks on a chain of springs with dry friction: sticking and slipping.

    q'' = K q - q' - 0.3 sign(q') + (0, 0, cos(pi t)),  q(0) = (-1, 1, -1),  q'(0) = (-1, 1, 1)

Each block is a subsystem with two modes. While a block sticks both of its modes are active, and the convex
combination of the friction forces is the force that holds it.

usage: blocks.py FOLDER_FOR_PLOTS
"""

import sys
from pathlib import Path

import numpy as np

import switchback_control as swb

FRICTION, T = 0.3, 12.0
SPRINGS = np.array([[-2.0, 1.0, 0.0], [1.0, -2.0, 1.0], [0.0, 1.0, -1.0]])

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)


def smooth_part(x, t):
    q, v = x[:3], x[3:]
    return np.concatenate([v, SPRINGS @ q - v + [0.0, 0.0, np.cos(np.pi * t)]])


def smooth_jacobian(x, t):
    j = np.zeros((6, 7))  # columns for x and t
    j[:3, 3:6] = np.eye(3)
    j[3:, :3], j[3:, 3:6] = SPRINGS, -np.eye(3)
    j[5, 6] = -np.pi * np.sin(np.pi * t)
    return j


system = swb.System(nx=6)
system.set_f0(system.function(smooth_part, 6, jacobian=smooth_jacobian, name="f0"))
for block in range(3):
    velocity = swb.Function.affine(0.0, np.eye(6)[3 + block], nx=6, name=f"v{block + 1}")
    system.add_subsystem([[-FRICTION], [FRICTION]], velocity, signs=[1, -1], rows=[3 + block])

result = swb.simulate_fesd(system, [-1, 1, -1, -1, 1, 1], T, n_steps=60, n_s=3, n_fe=3)
print(f"{result.message}; state at t = {result.time:g}: {np.round(result.state, 6)}")
for s in result.trajectory.switches:
    what = {"cross": "turns round", "enter": "sticks", "leave": "slips"}[str(s.kind)]
    print(f"  t = {s.t:9.6f}  block {s.subsystem + 1} {what}")

names = [f"{letter}{i}" for letter in "qv" for i in (1, 2, 3)]
result.plot(
    folder / "python_blocks.svg", states=[3, 4, 5], names=names, title="Velocities of three blocks with friction"
)
