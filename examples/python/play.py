"""Play between two parts: the output follows the input once the slack is used up; the loop that this makes.

A projected system: the output is pushed by the two ends of its play, and by nothing else.

usage: play.py FOLDER_FOR_PLOTS
"""

import sys
from pathlib import Path

import numpy as np

import switchback_control as swb

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)

r = 0.5
m = swb.Projected("input output", name="play")
x, y = m.x
m.f([2.0 * swb.cos(m.t), 0.0])  # the input is 2 sin t; as a state it is there for the picture
drive = 2.0 * swb.sin(m.t)
m.constraint("upper", drive - y + r)
m.constraint("lower", y - drive + r)
run = swb.simulate(m, [0.0, 0.0], 2 * np.pi * 2, rtol=1e-10, atol=1e-11)
print("the output starts or stops to move at", np.round(run.switch_times, 8))
print("exact: moves first at", np.round(np.arcsin(r / 2), 8), "and rests from pi/2 to", np.round(np.pi - np.arcsin(1 - 2 * r / 2), 8))
t = np.linspace(2 * np.pi, 4 * np.pi, 20001)
a, b = run(t).T
area = abs(np.trapezoid(b, a)) if hasattr(np, "trapezoid") else abs(np.trapz(b, a))
print(f"area of the loop: {area:.6f} (exact: {2 * r * 2 * (2 - r):.6f})")
run.plot(folder / "python_play.svg", title="Play")
run.plot_phase(folder / "python_play_loop.svg", title="Play: output over input")
