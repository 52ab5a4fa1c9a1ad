"""Two tanks in a row: a pump fills the first, which runs into the second; both have a switch with hysteresis.

    h1' = 1.5 pump - 0.7 sqrt(h1),   h2' = 0.7 sqrt(h1) - 0.5 sqrt(h2) - 0.4 valve
    pump:  on from h1 < 1 until h1 > 2, both 0.25 lower while the valve is open
    valve: open from h2 > 1.4 until h2 < 0.9

The run comes to a cycle, whose length and its derivative with respect to the flow of the pump are differences of switching
times and of their derivatives.

usage: two_tanks.py FOLDER_FOR_PLOTS
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import switchback_control as swb
from switchback_control.expr import Model, sqrt

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)

m = Model(states="h1 h2", parameters="flow")
h1, h2 = m.x
valve = m.hysteresis(h2, on=1.4, off=0.9, name="valve")
pump = m.hysteresis(-h1, on=0.25 * valve - 1, off=0.25 * valve - 2, name="pump")
through = 0.7 * sqrt(h1)
m.derivatives = [m.p[0] * pump - through, through - 0.5 * sqrt(h2) - 0.4 * valve]
run = swb.simulate(m, [1.5, 0.2], 60.0, p=[1.5], rtol=1e-11, atol=1e-11, sensitivity=True)

opened = [i for i, j in enumerate(run.jumps) if j.transition == 0]
period = np.diff([run.jumps[i].t for i in opened])
by_flow = np.diff(run.jump_derivatives[opened, -1])
print(f"{len(run.jumps)} switches in {run.stats.steps} steps; the valve opens {len(opened)} times")
print("time between two openings:", np.array2string(period, precision=8))
print(f"the last of them is {period[-1]:.10f}, and {by_flow[-1]:.6f} for one unit more of the flow")

figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.5), width_ratios=[3, 2], layout="constrained")
t = np.linspace(0, 30, 2000)
x = run(t)
left.plot(t, x[:, 0], label="level 1")
left.plot(t, x[:, 1], label="level 2")
for k, name in enumerate(["valve open", "pump on"]):
    on = [(i.start, i.end - i.start) for i in run.discrete(2 + k) if i.value == 1.0]
    left.broken_barh(on, (-0.25 - 0.3 * k, 0.2), color=f"C{2 + k}", label=name)
left.set(xlim=(0, 30), xlabel="time", ylabel="level", title="Levels, pump and valve")
left.legend(ncols=4, loc="upper center", fontsize="small", bbox_to_anchor=(0.5, -0.13))
for stay in run.discrete("valve"):
    at = run(np.linspace(stay.start, stay.end, 200))
    right.plot(at[:, 0], at[:, 1], color="C2" if stay.value else "0.5", linewidth=1.2)
right.set(xlabel="level 1", ylabel="level 2", title="The cycle (green: valve open)")
figure.savefig(folder / "python_two_tanks.svg")
print("python_two_tanks.svg: the thresholds of the pump are lower while the valve is open.")
