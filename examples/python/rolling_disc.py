"""A disc that slides, and starts to roll; one with backspin comes back; and both push each other.

usage: rolling_disc.py FOLDER_FOR_PLOTS
"""

import sys
from pathlib import Path

import switchback_control as swb

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)

v, mu, r, g = 3.0, 0.25, 0.3, 9.81
w = swb.World(gravity=g, mu=mu)
slides, spins = w.disc(r, mass=1.0, name="slides"), w.disc(r, mass=1.0, name="spins")
floor = w.floor()
w.contacts((slides, floor), (spins, floor))
w.contacts((slides, spins), mu=0.0, e=0.5)
w.place(slides, x=0.0, y=r, vx=v)
w.place(spins, x=4.0, y=r, vx=1.0, omega=15.0)
run = w.simulate(3.0, rtol=1e-10, atol=1e-10)
for s in run.switches:
    what = f"{w.scene.contacts[s.subsystem].name} {swb.ContactMode(s.after[0]).name.lower()}"
    print(f"t = {s.t:.8f}: {what}")
print(f"exact time when the first starts to roll: {v / (3 * mu * g):.8f}")
for i in run.impacts:
    print(f"t = {i.t:.8f}: {i.name}, impulse {i.normal:.6f}")
run.plot(folder / "python_rolling_disc.svg", title="Discs that slide and roll")
run.plot_contacts(folder / "python_rolling_disc_contacts.svg", title="Discs that slide and roll: contacts")
