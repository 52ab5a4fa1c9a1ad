"""A car with three gears and a driver: two automata, one of which asks for the state of the other, with resets.

    v' = force(gear) [the driver drives] - 0.1 v
    up at v > 10 and v > 18, only while the driver drives: the clutch takes 3 percent of the speed and wears by v^2/100
    down at v < 7 and v < 13;  the driver coasts from v > 24 until v < 6

usage: gear_box.py FOLDER_FOR_PLOTS
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import switchback_control as swb
from switchback_control.expr import Model

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)

m = Model(states="v way wear", parameters="engine loss")
(v, _, wear), (engine, loss) = m.x, m.p
gear = swb.Automaton(m, states="first second third", name="gear")
driver = swb.Automaton(m, states="drives coasts", name="driver")
up = {v: (1 - loss) * v, wear: wear + v**2 / 100}
gear.edge("first", "second", when=v > 10, given={driver: "drives"}, reset=up)
gear.edge("second", "third", when=v > 18, given={driver: "drives"}, reset=up)
gear.edge("third", "second", when=v < 13)
gear.edge("second", "first", when=v < 7)
driver.edge("drives", "coasts", when=v > 24)
driver.edge("coasts", "drives", when=v < 6)
force = engine * gear.choose({"first": 3.0, "second": 1.5, "third": 1.0}) * driver.is_in("drives")
m.derivatives = [force - 0.1 * v, v, 0.0]

run = swb.simulate(m, [1.0, 0.0, 0.0], 60.0, p=[4.0, 0.03], rtol=1e-10, atol=1e-10, sensitivity=True)
for stay in gear.sequence(run)[:5]:
    print(f"{stay.value:>7} gear from {stay.start:9.6f} to {stay.end:9.6f}")
print(f"way {run.x_end[1]:.6f}, and {run.dx_dp[1, 0]:.4f} for one unit more of the engine; wear {run.x_end[2]:.4f}")
print(f"{len(run.jumps)} transitions, {run.stats.steps} steps, {1e6 * run.stats.time_total:.0f} microseconds")

figure, (top, bottom) = plt.subplots(2, 1, sharex=True, figsize=(9, 6), height_ratios=[3, 1], layout="constrained")
for a, b in zip([0.0, *(j.t for j in run.jumps)], [*(j.t for j in run.jumps), run.t_end]):
    t = np.linspace(a, b, 60)[1:]  # at its start the speed before the jump counts
    top.plot(t, run(t)[:, 0], color="C0")
for speed in (7, 10, 13, 18):
    top.axhline(speed, color="0.8", linewidth=0.8, zorder=0)
top.set(ylabel="speed", title="A gear box with hysteresis; the lines are its thresholds")
for k, name in enumerate(gear.states):
    bottom.broken_barh([(i.start, i.end - i.start) for i in gear.sequence(run) if i.value == name], (k - 0.4, 0.8), color=f"C{k}")
bottom.broken_barh([(i.start, i.end - i.start) for i in driver.sequence(run) if i.value == "drives"], (2.6, 0.8), color="0.4")
bottom.set(yticks=range(4), yticklabels=[*(f"{name} gear" for name in gear.states), "driver drives"], xlabel="time", xlim=(0, 60))
figure.savefig(folder / "python_gear_box.svg")
print("python_gear_box.svg: speed, gears, driver.")
