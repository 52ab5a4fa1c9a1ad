"""Simulation of an oscillator that turns one way inside the unit circle and the other way outside.

    x' = A1 x if |x| < 1, A2 x if |x| > 1,  x(0) = (1/e, 0)

The solution is known: the switch is at t = 1. Halving the steps shows the full order 2 n_s - 1 of Radau IIA, because
the elements end exactly where the system switches; with fixed elements the order is one.

usage: oscillator.py FOLDER_FOR_PLOTS
"""

import sys
from pathlib import Path

import numpy as np

import switchback_control as swb

OMEGA, T = 2 * np.pi, np.pi / 2
INSIDE = np.array([[1.0, OMEGA], [-OMEGA, 1.0]])
OUTSIDE = np.array([[1.0, -OMEGA], [OMEGA, 1.0]])
X0 = [np.exp(-1.0), 0.0]
EXACT = np.exp(T - 1) * np.array([np.cos(OMEGA * (T - 1)), np.sin(OMEGA * (T - 1))])

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)

system = swb.System(nx=2)
modes = swb.Function.affine(np.zeros((2, 2)), np.vstack([INSIDE, OUTSIDE]), nx=2, name="modes")
psi = system.function(lambda x: x @ x - 1, jacobian=lambda x: 2 * x, hessian=lambda weights: 2 * weights[0] * np.eye(2))
system.add_subsystem(modes, psi, signs=[-1, 1])

result = swb.simulate_fesd(system, X0, T, n_steps=10, n_s=4, n_fe=2)
switch = result.trajectory.switches[0]
print(f"x(pi/2) = {result.state}, error {np.abs(result.state - EXACT).max():.1e}")
print(f"switch at t = {switch.t:.12f} from mode {switch.before[0]} to mode {switch.after[0]}")
result.plot(folder / "python_oscillator.svg", title="Oscillator with a switch at t = 1")

print("\nerror at the end by number of steps, Radau IIA, 2 elements in each step")
print(f"{'steps':>8}" + "".join(f"{f'n_s={n_s}':>12}" for n_s in (2, 3, 4)) + f"{'n_s=4, fixed':>16}")
for n_steps in (9, 18, 36, 72):
    errors = []
    for options in ({"n_s": 2}, {"n_s": 3}, {"n_s": 4}, {"n_s": 4, "discretisation": "standard"}):
        r = swb.simulate_fesd(system, X0, T, n_steps, n_fe=2, **options)
        errors.append(np.abs(r.state - EXACT).max() if r.success else np.nan)
    print(f"{n_steps:>8}" + "".join(f"{e:12.1e}" for e in errors[:3]) + f"{errors[3]:16.1e}")
