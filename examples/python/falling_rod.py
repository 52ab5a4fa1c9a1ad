"""A rod that is dropped on a rough floor: its end sticks, slips, sticks; then the other end lands.

usage: falling_rod.py FOLDER_FOR_PLOTS
"""

import sys
from math import pi, sin
from pathlib import Path

import switchback_control as swb

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)

w = swb.World(mu=0.9)
rod, floor = w.rod(1.0, mass=1.0, name="rod"), w.floor()
w.place(rod, y=0.2 + 0.5 * sin(1.1), angle=pi - 1.1, vx=0.3, omega=0.5)
run = w.simulate(1.2, rtol=1e-10, atol=1e-10)
print(run)
for i in run.impacts:
    print(f"t = {i.t:.6f}: {i.name}, impulses {i.normal:.4f} up, {i.tangential[0]:+.4f} along the floor")
for s in run.switches:
    if any(i.t == s.t for i in run.impacts):
        continue
    name = w.scene.contacts[s.subsystem].name
    print(f"t = {s.t:.6f}: {name} from {swb.ContactMode(s.before[0]).name.lower()} to {swb.ContactMode(s.after[0]).name.lower()}")
run.plot(folder / "python_falling_rod.svg", title="A rod that falls")
run.plot_contacts(folder / "python_falling_rod_contacts.svg", title="A rod that falls: its ends")
