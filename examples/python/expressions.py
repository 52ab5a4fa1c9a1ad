"""Models written with operators: derivatives, switching functions and modes come from the library.

usage: expressions.py FOLDER_FOR_PLOTS
"""

import sys
from pathlib import Path

import switchback_control as swb
from switchback_control.expr import Model, clip, cos, sign, sin, solve

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)

# A mass with dry friction, driven.
oscillator = Model(states="q v", name="oscillator")
q, v = oscillator.x
oscillator.derivatives = [v, -q - 0.4 * sign(v) + cos(0.5 * oscillator.t)]
print(oscillator.report())
result = swb.simulate_fesd(oscillator.system(), x0=[1.0, 0.0], duration=12.0, n_steps=60)
print(f"oscillator: {result.outcome}, {len(result.trajectory.switches)} switches")
result.plot(folder / "expressions-oscillator.svg")

# A double pendulum with friction in both joints and a limited motor in the first.
arm = Model(states="a b va vb", controls="torque", parameters="friction", name="arm")
(a, b), (va, vb) = arm.x[:2], arm.x[2:]
c, s = cos(a - b), sin(a - b)
motor = clip(arm.u[0] - 2.0 * a, -3.0, 3.0)
mass = [[2.0, c], [c, 1.0]]
forces = [-s * vb**2 - 19.62 * sin(a) + motor, s * va**2 - 9.81 * sin(b)]
friction = arm.p[0] * sign(arm.x[2:])
arm.derivatives = [va, vb, *solve(mass, forces - friction)]
print(arm.report())
