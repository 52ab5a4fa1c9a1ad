"""Four rooms with a thermostat each, and a boiler that is an automaton: hysteresis that drives an automaton.

    room i:   T' = (outside - T)/8 + (neighbours)/4 + w (B - T)/8,      w = 1 from T < 19.5 until T > 20.5
    water:    B' = power/4 - (B - 20)/20 - sum of w (B - T)/6
    boiler:   off, low or high: on below 45 degrees of the water, off above 65; high while more than two rooms ask for heat

usage: thermostats.py FOLDER_FOR_PLOTS
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import switchback_control as swb
from switchback_control.expr import Model, sin

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)
rooms = ["north", "hall", "kitchen", "south"]

m = Model(states=[*rooms, "water", "energy"], parameters="goal")
T, water = [m.x[i] for i in range(4)], m.x[4]
heat = [m.hysteresis(-t, on=-(m.p[0] - 0.5), off=-(m.p[0] + 0.5), name=f"heat {name}") for t, name in zip(T, rooms)]
asking = sum(heat)
boiler = swb.Automaton(m, states="off low high", name="boiler")
boiler.edge("off", "low", when=water < 45)
boiler.edge(["low", "high"], "off", when=water > 65)
boiler.edge("low", "high", when=asking > 2.5)
boiler.edge("high", "low", when=asking < 2.5)

outside = 2 + 6 * sin(2 * np.pi / 24 * (m.t - 9))
power = boiler.choose({"off": 0.0, "low": 60.0, "high": 160.0})
for i, t in enumerate(T):
    neighbours = sum(T[k] - t for k in (i - 1, i + 1) if 0 <= k < 4)
    m.derivative(t, (outside - t) / (8 + i) + neighbours / 4 + heat[i] * (water - t) / 8)
m.derivative(water, power / 4 - (water - 20) / 20 - sum(h * (water - t) / 6 for h, t in zip(heat, T)))
m.derivative(m.x[5], power)

run = swb.simulate(m, [17.0, 18.0, 19.0, 20.0, 40.0, 0.0], 24.0, p=[20.0], rtol=1e-8, atol=1e-8, sensitivity=True)
together = sum(j.simultaneous for j in run.jumps)
print(f"{len(run.jumps)} transitions, {together} of them at one time with others, {run.stats.steps} steps")
print(f"energy of a day {run.x_end[5]:.1f}; for one degree more, in the same order of switches, {run.dx_dp[5, 0]:.2f} more")

t = np.linspace(0, 24, 3000)
x = run(t)
figure, axes = plt.subplots(3, 1, sharex=True, figsize=(9, 7), height_ratios=[3, 1.6, 2], layout="constrained")
for i, name in enumerate(rooms):
    axes[0].plot(t, x[:, i], label=name)
axes[0].set(ylim=(16.5, 22), ylabel="rooms", title="Four rooms, four thermostats, one boiler")
axes[0].legend(ncols=4, loc="upper right")
axes[1].plot(t, x[:, 4], "tab:red")
axes[1].set_ylabel("water")
for k, which in enumerate([boiler, *heat]):
    for stay in run.discrete(which):
        alpha = {"low": 0.5, "high": 1.0, 1.0: 1.0}.get(stay.value, 0.0)
        axes[2].broken_barh([(stay.start, stay.end - stay.start)], (k - 0.4, 0.8), color=f"C{(k - 1) % 4}", alpha=alpha)
axes[2].set(yticks=range(5), yticklabels=["boiler (light: low)", *rooms], xlabel="hours")
figure.savefig(folder / "python_thermostats.svg")
