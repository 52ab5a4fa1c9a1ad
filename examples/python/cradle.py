"""Newton's cradle without threads: five discs that touch, and one that arrives.

Where several contacts close at once the law of impacts decides. Newton's, for all contacts in one problem, shares the impulse
among all discs; one after the other, the last disc flies off alone, as with steel balls.

usage: cradle.py FOLDER_FOR_PLOTS
"""

import sys
from pathlib import Path

import numpy as np

import switchback_control as swb

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)

r, n = 0.1, 5
for law in ("newton", "sequential"):
    w = swb.World(gravity=0.0, e=1.0, impact_law=law, name=f"cradle, {law}")
    discs = [w.disc(r, mass=1.0, name=f"{k}") for k in range(n)]
    w.contacts(*zip(discs, discs[1:]))
    for k, disc in enumerate(discs):
        w.place(disc, x=2 * r * k - (0.3 if k == 0 else 0.0), vx=1.0 if k == 0 else 0.0)
    run = w.simulate(0.8, rtol=1e-10, atol=1e-10)
    v = np.array([w.trajectory(run, disc, run.t_end).vx for disc in discs])
    print(f"{law:10}: velocities {np.array2string(v, precision=6, suppress_small=True)}")
    print(f"            momentum {v.sum():.12f}, energy {0.5 * v @ v:.12f} (0.5 before)")
    run.plot(
        folder / f"python_cradle_{law}.svg",
        states=[2 * k for k in range(n)],
        names=[f"disc {k}" for k in range(n)],
        title=f"Five discs, law of impacts: {law}",
    )
