"""A tower of nineteen discs is hit by one more: 210 contacts, impacts that go through chains of discs at once.

usage: pile_of_discs.py FOLDER_FOR_PLOTS
"""

import sys
from pathlib import Path

import switchback_control as swb

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)

r = 0.2
w = swb.World(e=0.0)
floor = w.floor()
discs = [w.disc(r, mass=1.0, name=f"{k}") for k in range(20)]
for k, disc in enumerate(discs[:-1]):
    w.place(disc, y=r * (2 * k + 1))
w.place(discs[-1], x=-2.2, y=7.4, vx=10.0)
run = w.simulate(0.3, rtol=1e-9, atol=1e-9)
print(f"{len(w.scene.contacts)} contacts; {run.stats.steps} steps in {run.stats.time_total:.2f} s; {run.outcome.name} {run.reason}")
times = sorted({i.t for i in run.impacts})
for t in times[:3]:
    struck = [i for i in run.impacts if i.t == t]
    print(f"t = {t:.10f}: {len(struck)} impulses, the largest {max(i.normal for i in struck):.8f} ({max(struck, key=lambda i: i.normal).name})")
before = run.force("0-floor", 0.1)[0]
print(f"before, the floor carries {before:.8f} (weight of 19 discs: {19 * 9.81:.8f}), and the highest pair {run.force('17-18', 0.1)[0]:.8f}")
run.animate(folder / "python_pile_of_discs.gif", fps=20, speed=0.3, size=(2.6, 4.0))
