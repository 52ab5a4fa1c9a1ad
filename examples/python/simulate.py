"""Event-driven simulation: a block on a moving belt, held by a spring, with dry friction.

    q' = v,  v' = -q - F sign(v - belt) / (1 + |v - belt|)

The block sticks to the belt until the spring pulls harder than friction holds, slips back, and sticks again. Sticking is
integrated as the sliding mode it is, its ends are located to rounding, and the derivatives of state and switching times
with respect to initial state and parameters go through them.

usage: simulate.py FOLDER_FOR_PLOTS
"""

import sys
from pathlib import Path

import numpy as np

import switchback_control as swb
from switchback_control.expr import Model, sign

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)

block = Model(states="q v", parameters="F belt")
(q, v), (force, belt) = block.x, block.p
block.derivatives = [v, -q - force * sign(v - belt) / (1.0 + (v - belt) * sign(v - belt))]
P = [1.0, 0.3]

run = swb.simulate(block, [0.0, 0.0], 30.0, p=P, rtol=1e-10, atol=1e-10, sensitivity=True)
print(run.table())
print(f"\n{run.stats.steps} steps, {run.stats.evaluations} evaluations, {1e6 * run.stats.time_total:.0f} microseconds")
print("derivatives of the first switching time with respect to q0, v0, F, belt:", run.switch_derivatives[0])

run.plot(folder / "python_simulate.svg", names=["position", "velocity"], title="Block on a belt: sticks and slips")
print("python_simulate.svg: both modes are active while the velocity is that of the belt: the block sticks.")
run.plot_phase(folder / "python_simulate_phase.svg", names=["position", "velocity"], p=P, title="The same, phase plane")
print("python_simulate_phase.svg: the trajectory runs along the dashed surface, leaves it and comes back: a limit cycle.")

# the same from many starting points at once: all end in the limit cycle, or stick for ever at its centre
starts = np.array([[a, 0.0] for a in np.linspace(-3.0, 3.0, 25)])
batch = swb.simulate_batch(block, starts, 60.0, p=P, rtol=1e-9, atol=1e-9)
print(f"\n{len(batch)} starting points: {batch.success.sum()} runs to the end, |x| there between "
      f"{np.hypot(*batch.x.T).min():.3f} and {np.hypot(*batch.x.T).max():.3f}")
