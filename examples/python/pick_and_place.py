"""An arm with seven hinges moves a ball over a table: it begins and ends in contact, and every hinge has dry friction.

The arm is `robots/arm.urdf`. Torques are constant on eight stages. The first guess of the torques is made by inverse dynamics along a smooth way of the hinges.
The answer is simulated again, and drawn.

usage: pick_and_place.py FOLDER_FOR_PLOTS
"""

import sys
import time
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import switchback_control as swb

HINGES = [f"j{k}" for k in range(1, 8)]
TORQUES = np.array([60.0, 60.0, 30.0, 30.0, 8.0, 8.0, 4.0])  # bounds, in N m
RADIUS = 0.04


def arm(friction=True, contact=True):
    """The arm with a table. Its controls are shares of the largest torques."""
    path = Path(__file__).resolve().parent / "robots/arm.urdf"
    w = swb.World.from_urdf(path, ignore=[] if friction else ["friction"], controls=7, name="arm")
    w.floor(name="table")
    w.contacts(*([("load", "table")] if contact else []))
    for k, hinge in enumerate(HINGES):
        w.force(hinge, lambda s, k=k: TORQUES[k] * s.u[k])
    return w


def reach(w, place):
    """Angles with which the hand points down at a place: steps of Gauss and Newton."""
    hand = w.states["load"]
    f = w.scene.function([*hand.position, hand.rotation[0][2], hand.rotation[1][2]])
    q = np.array([np.arctan2(place[1], place[0]), 0.5, 0.0, -1.6, 0.0, 1.0, 0.0])
    for _ in range(50):
        x = np.concatenate([q, np.zeros(7)])
        off = np.array([*place, 0.0, 0.0]) - f(x, np.zeros(7))
        if np.abs(off).max() < 1e-13:
            break
        by = np.asarray(f.jacobian(x, np.zeros(7)))[:, :7]
        q = q + np.clip(np.linalg.lstsq(by, off, rcond=None)[0], -0.3, 0.3)
    return q


def problem(w, start, end, horizon=1.2, stages=8, **options):
    """From rest at a place on the table to rest at another one with the least sum of squares of the torques' shares."""
    scene = w.scene
    rest = np.zeros(7)
    ocp = swb.Ocp(scene, horizon, stages, initial_state=[*reach(w, [*start, RADIUS]), *rest], control_bounds=(-np.ones(7), np.ones(7)), **options)
    ocp.set_lagrange(sum(u**2 for u in scene.u))
    goal = [*end, RADIUS, *rest]
    ocp.add_terminal([*w.states["load"].position, *scene.v], goal, goal)
    return ocp


def main(folder):
    w = arm()
    ocp = problem(w, [0.5, -0.3], [0.35, 0.35])
    begin = time.process_time()
    r = ocp.solve()
    spent = time.process_time() - begin
    print(f"{r.outcome.name}: cost {r.cost:.6f}, verdict {r.optimality.verdict}, {spent:.1f} s of CPU time")
    x0 = r.trajectory(0.0)
    run = w.scene.simulate(x0[:7], x0[7:], 1.2, u=r.controls, rtol=1e-9, atol=1e-10)
    t = np.linspace(0.0, 1.2, 241)
    load = w.trajectory(run, "load", t)
    print(f"the load ends at {load.x[-1]:.6f}, {load.y[-1]:.6f}, {load.z[-1]:.6f}, and is at most {load.z.max() - RADIUS:.4f} above the table")
    figure = plt.figure(figsize=(11, 6), layout="constrained")
    for k, s in enumerate((0.0, 0.6, 1.2)):
        ax = figure.add_subplot(2, 3, k + 1, projection="3d")
        w.picture(run, s, ax, limits=[-0.3, 0.7, -0.5, 0.5, 0.0, 1.0]).view_init(20, -60)
        places = np.array([[getattr(w.trajectory(run, b, s), c) for c in "xyz"] for b in w.bodies])
        ax.plot(*places.T, "o-", color="C0", linewidth=3, markersize=4)
        ax.plot(load.x, load.y, load.z, color="C3", linewidth=1)
        ax.set_title(f"t = {s}")
    ax = figure.add_subplot(2, 3, 4)
    ax.plot(load.x, load.y)
    ax.set(xlabel="x of the load", ylabel="y", aspect="equal")
    ax = figure.add_subplot(2, 3, 5)
    for hinge in HINGES:
        ax.plot(t, w.trajectory(run, hinge, t).v, label=hinge)
    ax.set(xlabel="time", ylabel="rates of the hinges")
    ax.legend(fontsize=7)
    ax = figure.add_subplot(2, 3, 6)
    ax.stairs(r.controls[:, 1] * TORQUES[1], np.linspace(0.0, 1.2, 9), label="j2")
    ax.stairs(r.controls[:, 3] * TORQUES[3], np.linspace(0.0, 1.2, 9), label="j4")
    ax.set(xlabel="time", ylabel="torque")
    ax.legend()
    figure.savefig(folder / "python_pick_and_place.svg")


if __name__ == "__main__":
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    folder.mkdir(parents=True, exist_ok=True)
    main(folder)
