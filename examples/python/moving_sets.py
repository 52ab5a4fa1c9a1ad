"""Optimal control of projected systems: bodies without inertia that push each other, and a vehicle in a frame that moves.

A projected system follows its own velocity where that leads nowhere forbidden, and the nearest possible one elsewhere: x' = f + sum of
gradient(c) * multiplier with multiplier >= 0 and c >= 0, one of them zero. Nothing is said of when bodies touch: finite elements find it, with
the accuracy of the method. What is printed of every problem: the outcome, the cost, how far an event-driven simulation of the controls is from
the answer, iterations and the time. A picture of every answer is written.

usage: moving_sets.py FOLDER_FOR_PLOTS [NAME ...]
"""

import sys
import time
from pathlib import Path

import numpy as np

import switchback_control as swb


def discs(**options):
    """A disc with a control pushes two others, which nothing else moves, to the right."""
    m = swb.Projected("x0 y0 x1 y1 x2 y2", u="ux uy", name="discs")
    x, u = m.x, m.u
    m.f([u[0], u[1], 0, 0, 0, 0])
    for i in range(3):
        for j in range(i):
            square = (x[2 * i] - x[2 * j]) ** 2 + (x[2 * i + 1] - x[2 * j + 1]) ** 2
            m.constraint(f"{j}-{i}", (square - 1) / 2)  # discs of the radius 1/2
    ocp = swb.Ocp(m, 5.0, 20, initial_state=[-1.5, 0.05, 0, 0.4, 0.4, -0.9], control_bounds=(-2, 2), **options)
    ocp.set_lagrange(m.function(u[0] ** 2 + u[1] ** 2))
    ocp.add_terminal(m.function([x[2], x[4]]), [1.2, 1.4], [1.2, 1.4])
    return m, ocp


def gate(**options):
    """A gate that hangs at the origin and is pushed open; it falls back by itself, slowly, and has a stop."""
    m = swb.Projected("x y angle", u="ux uy", name="gate")
    (x, y, a), u = m.x, m.u
    m.f([u[0], u[1], -0.4 * a])
    m.constraint("leaf", y * swb.sin(a) - x * swb.cos(a) - 0.1)  # a body of the radius 0.1 in front of it
    m.constraint("stop", a + 0.02)
    ocp = swb.Ocp(m, 3.0, 15, initial_state=[-1.0, 0.8, 0], control_bounds=(-2, 2), **options)
    ocp.set_lagrange(m.function(u[0] ** 2 + u[1] ** 2))
    ocp.add_terminal(m.function(a), [0.9], [np.inf])
    return m, ocp


def vehicle(**options):
    """A vehicle with little power in a frame that turns and swings: it is carried along, and has to be at a place in the end."""
    m = swb.Projected("x y", u="ux uy", name="vehicle")
    (x, y), u, t = m.x, m.u, m.t
    m.f([u[0], u[1]])
    right, c, s = x - 0.9 * swb.sin(1.3 * t), swb.cos(0.4 * t), swb.sin(0.4 * t)
    along, across = right * c + y * s, y * c - right * s
    for name, gap in (("right", 0.5 - along), ("left", 0.5 + along), ("top", 0.3 - across), ("bottom", 0.3 + across)):
        m.constraint(name, gap)
    ocp = swb.Ocp(m, 4.0, 20, initial_state=[0, 0], control_bounds=(-0.3, 0.3), **options)
    ocp.set_lagrange(m.function(u[0] ** 2 + u[1] ** 2))
    ocp.add_terminal(m.function([x, y]), [-0.55, 0.3], [-0.55, 0.3])
    return m, ocp


PROBLEMS = [discs, gate, vehicle]


def replay(m, r):
    """The controls of an answer simulated by events: the largest difference of a state at the end of a control stage."""
    x, worst = r.trajectory(r.trajectory.t_start), 0.0
    for k, u in enumerate(r.controls):
        x = swb.simulate(m, x, (r.control_times[k], r.control_times[k + 1]), u=u, rtol=1e-10, atol=1e-10).x_end
        worst = max(worst, np.abs(x - r.trajectory(r.control_times[k + 1])).max())
    return worst


def picture(m, r, path):
    """Where the bodies are at equal times, the later the darker, and the states over time."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, (plane, states) = plt.subplots(1, 2, figsize=(10, 4))
    t = r.trajectory
    fine = np.linspace(t.t_start, t.t_end, 400)
    x = t(fine)
    for k, time_ in enumerate(np.linspace(t.t_start, t.t_end, 5)):
        look, z = {"color": plt.cm.viridis(k / 5), "linewidth": 1.2}, t(time_)
        if m.name == "discs":
            for i in range(3):
                plane.add_patch(plt.Circle(z[2 * i : 2 * i + 2], 0.5, fill=i == 0, alpha=0.5 if i == 0 else 1, **look))
        elif m.name == "gate":
            plane.plot([0, 1.2 * np.sin(z[2])], [0, 1.2 * np.cos(z[2])], **look)
            plane.add_patch(plt.Circle(z[:2], 0.1, **look))
        else:
            turn = np.array([[np.cos(0.4 * time_), -np.sin(0.4 * time_)], [np.sin(0.4 * time_), np.cos(0.4 * time_)]])
            corners = turn @ np.array([[0.5, -0.5, -0.5, 0.5, 0.5], [0.3, 0.3, -0.3, -0.3, 0.3]])
            plane.plot(corners[0] + 0.9 * np.sin(1.3 * time_), corners[1], **look)
            plane.plot(*z, "o", color=look["color"])
    for i in range(0, 6 if m.name == "discs" else 2, 2):
        plane.plot(x[:, i], x[:, i + 1], color="grey", linewidth=0.8)
    plane.set_aspect("equal")
    plane.set_title(m.name)
    for i, name in enumerate(m.names[0]):
        states.plot(fine, x[:, i], label=name)
    for switch in t.switches:
        states.axvline(switch.t, color="grey", linestyle=":", linewidth=0.8)
    states.legend(fontsize=7)
    states.set_xlabel("time")
    figure.savefig(path, bbox_inches="tight")
    plt.close(figure)


def main():
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    folder.mkdir(parents=True, exist_ok=True)
    names = sys.argv[2:]
    for problem in PROBLEMS:
        if names and problem.__name__ not in names:
            continue
        m, ocp = problem(max_time=60.0)
        clock = time.perf_counter()
        r = ocp.solve()
        seconds = time.perf_counter() - clock
        print(
            f"{problem.__name__:8} {r.outcome.name.lower()} {r.polished.name.lower()} cost {r.cost_reached:.10g}, "
            f"replay {replay(m, r):.1e}, {len(r.trajectory.switches)} switches, {r.stats.iterations} iterations, {seconds:.2f} s"
        )
        if r.message:
            print("  " + r.message)
        picture(m, r, folder / f"moving_sets_{problem.__name__}.svg")


if __name__ == "__main__":
    main()
