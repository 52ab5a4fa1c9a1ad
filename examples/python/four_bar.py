"""A four-bar linkage in space with a stop: a motor swings the crank, and the rocker hits a stop.

Its last hinge closes a loop: it becomes constraints. Three of the five are kept by the other hinges already, and are left
out. The place of the rocker is compared with the closed form.

usage: four_bar.py FOLDER_FOR_PLOTS
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import switchback_control as swb

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)

crank, coupler, rocker, base = 0.2, 0.6, 0.45, 0.6


def closed(angle):
    """Angles of coupler and rocker for one of the crank, all against the base, by the law of cosines."""
    x, z = crank * np.cos(angle), crank * np.sin(angle)
    d = np.hypot(base - x, z)
    towards = np.arctan2(-z, base - x)
    up = towards + np.arccos((d**2 + coupler**2 - rocker**2) / (2 * d * coupler))
    return up, np.arctan2(z + coupler * np.sin(up), x + coupler * np.cos(up) - base)


w = swb.World(space=True, name="four-bar")
bars = {n: w.capsule(length, 0.015, 2 * length, name=n) for n, length in (("crank", crank), ("coupler", coupler), ("rocker", rocker))}
axis = [0, -1, 0]  # so that angles are from x to z


def end(length, sign):
    return [sign * length / 2, 0, 0]


w.joint("hinge", None, "crank", to=end(crank, -1), axis=axis, name="motor")
w.joint("hinge", "crank", "coupler", at=end(crank, 1), to=end(coupler, -1), axis=axis, name="elbow")
w.joint("hinge", None, "rocker", at=[base, 0, 0], to=end(rocker, -1), axis=axis, limits=(-np.inf, 2.35), e=0.4, name="pivot")
w.joint("hinge", "coupler", "rocker", at=end(coupler, 1), to=end(rocker, 1), axis=axis, name="closing")
w.force("motor", lambda s: 4.0 * swb.cos(4.0 * s.t) - 0.3 * s["motor"].v)
up, back = closed(0.3)
w.set("motor", 0.3), w.set("elbow", up - 0.3), w.set("pivot", back)
run = w.simulate(3.0, rtol=1e-9, atol=1e-10)
print(f"success: {run.success} {run.reason}")

t = np.linspace(0, 3, 601)
motor, pivot = w.trajectory(run, "motor", t), w.trajectory(run, "pivot", t)
error = np.abs(pivot.q - closed(motor.q)[1]).max()
print(f"{len(run.impacts)} impacts at the stop, the first at {run.impacts[0].t:.6f}, redundant: {run.redundant}")
print(f"distance of the rocker from the closed form: {error:.1e}")
figure = plt.figure(figsize=(9, 3.6), layout="constrained")
ax = figure.add_subplot(1, 2, 2)
ax.plot(t, pivot.q, label="rocker")
ax.plot(t, pivot.v / 10, label="its rate / 10")
ax.axhline(2.35, color="0.6", linewidth=0.8)
ax.set_xlabel("time")
ax.legend()
w.picture(run, 1.0, figure.add_subplot(1, 2, 1, projection="3d")).view_init(15, -75)
figure.savefig(folder / "python_four_bar.svg")
