"""A driven oscillator with a stop: impacts, and what happens where the orbit hardly touches the stop.

    x'' + 2 z x' + x = F cos(w t),   x <= stop

Where it grazes, derivatives grow like one over the speed of the impact, and the library reports the depth of the impact.

usage: impact_oscillator.py FOLDER_FOR_PLOTS
"""

import sys
from pathlib import Path

import numpy as np

import switchback_control as swb

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)

z, f, w, e = 0.1, 1.0, 1.2, 0.7
s = swb.Scene("x", p="stop", name="oscillator")
x, v = s.q[0], s.v[0]
s.force([f * swb.cos(w * s.t) - x - 2 * z * v])
s.contact("stop", gap=s.p[0] - x, e=e)

# without a stop the orbit is A cos(w t - phase)
amplitude = f / np.hypot(1 - w**2, 2 * z * w)
phase = np.arctan2(2 * z * w, 1 - w**2)
q0, v0 = [amplitude * np.cos(phase)], [amplitude * w * np.sin(phase)]
print("stop below the amplitude   speed of the impact   depth       |dx/dx0|   speed times derivative")
for below in (1e-2, 1e-4, 1e-6):
    run = s.simulate(q0, v0, 6.0, p=[amplitude - below], rtol=1e-12, atol=1e-13, sensitivity=True)
    i, size = run.impacts[0], np.linalg.norm(run.dx_dx0)
    print(f"{below:24.0e}   {-i.rate_before:19.6f}   {i.depth:.3e}   {size:8.2f}   {-i.rate_before * size:.5f}")

run = s.simulate(q0, v0, 60.0, p=[0.8 * amplitude], rtol=1e-10, atol=1e-10)
print(f"stop at 0.8 of the amplitude: {len(run.impacts)} impacts, the last at the speed {-run.impacts[-1].rate_before:.6f}")
run.plot_phase(folder / "python_impact_oscillator.svg", title="An oscillator with a stop")
run.plot(folder / "python_impact_oscillator_time.svg", title="An oscillator with a stop")
