"""Optimal control through impacts and friction: scenes solved from their default starts, all times physical.

What is printed of every problem: the outcome, the cost, how far an event-driven simulation of the controls is from the answer,
impacts, iterations and the time; then its phases and impacts. A picture of coordinates, velocities with their jumps, controls and
contact forces is written of every answer.

usage: jump_gallery.py FOLDER_FOR_PLOTS [NAME ...]
"""

import math
import sys
import time
from pathlib import Path

import numpy as np

import switchback_control as swb
from switchback_control import cos, sin, sqrt

G = 9.81


def puck(**options):
    """Example 8.19 of A. Nurkanović's thesis: a block falls on a rough floor, is pushed along it, and has to be at rest at
    x = 3 after two seconds; exactly 72.639278346281."""
    s = swb.Scene("x y", u="ux", name="puck")
    x, y = s.q
    s.force([s.u[0], -G])
    s.contact("floor", gap=y, tangents=[x], mu=0.6)
    ocp = swb.Ocp(s, 2.0, 20, n_s=2, n_fe=1, initial_state=[0, 1, 0, 0], control_bounds=(-10, 10), **options)
    ocp.set_lagrange(s.function(s.u[0] ** 2))
    ocp.add_terminal(s.function([x, y, *s.v]), [3, 0, 0, 0], [3, 0, 0, 0])
    return s, ocp


def box(turns=3, **options):
    """Section 8.6.1: a ball with a thrust of 50 at most follows a reference on a circle, which a box cuts off; with three half
    turns a second bouncing off the walls is better than flying along."""
    w, a = -turns * math.pi, math.pi / 4
    s = swb.Scene("x y", u="ux uy", name="ball in a box")
    x, y = s.q
    s.force([s.u[0], s.u[1]])
    for name, gap in (("bottom", y + 1.05), ("right", 1.1 - x), ("top", 1.15 - y), ("left", x + 1.2)):
        s.contact(name, gap=gap, e=1.0)
    start = [math.sin(a), math.cos(a), w * math.cos(a), -w * math.sin(a)]
    ocp = swb.Ocp(s, 4 * math.pi / abs(w), 40, n_s=2, n_fe=1, initial_state=start, control_bounds=(-50, 50), **options)
    ocp.set_lagrange(s.function((x - sin(w * s.t + a)) ** 2 + (y - cos(w * s.t + a)) ** 2))
    ocp.add_path(s.function([s.u[0] ** 2 + s.u[1] ** 2]), None, [2500.0])
    return s, ocp


def slow_box(**options):
    """The same with two half turns a second, which the thrust can follow."""
    return box(2, **options)


def two_carts(**options):
    """Only the first cart is driven; the second is to be one further and the first back, after three seconds."""
    s = swb.Scene("x1 x2", u="F", name="two carts")
    (x1, x2), (v1, v2) = s.q, s.v
    s.inertia([1, 2])
    s.force([s.u[0] - 0.1 * v1, -0.5 * v2])
    s.contact("carts", gap=x2 - x1 - 0.2, e=0.5)
    ocp = swb.Ocp(s, 3.0, 15, n_s=2, n_fe=2, initial_state=[0, 1, 0, 0], control_bounds=(-20, 20), **options)
    ocp.set_lagrange(s.function(s.u[0] ** 2))
    ocp.add_terminal(s.function([x1, x2]), [0, 2], [0, 2])
    return s, ocp


def three_carts(**options):
    """The third cart is moved by the second, which the first hits; the contacts differ in restitution."""
    s = swb.Scene("x1 x2 x3", u="F", name="three carts")
    (x1, x2, x3), (v1, v2, v3) = s.q, s.v
    s.force([s.u[0] - 0.1 * v1, -0.3 * v2, -0.3 * v3])
    s.contact("1-2", gap=x2 - x1 - 0.2, e=0.9)
    s.contact("2-3", gap=x3 - x2 - 0.2, e=0.3)
    ocp = swb.Ocp(s, 3.0, 15, n_s=2, n_fe=2, initial_state=[0, 1, 2, 0, 0, 0], control_bounds=(-20, 20), **options)
    ocp.set_lagrange(s.function(s.u[0] ** 2))
    ocp.add_terminal(s.function([x1, x3]), [0, 3], [0, 3])
    return s, ocp


def push_box(**options):
    """A pusher gives a box on a rough table a push; the box is to stop after one meter, by friction alone."""
    s = swb.Scene("xp xb yb", u="F", name="push box")
    xp, xb, yb = s.q
    s.force([s.u[0], 0, -G])
    s.contact("pusher", gap=xb - xp - 0.1)
    s.contact("table", gap=yb, tangents=[xb], mu=0.3)
    ocp = swb.Ocp(s, 2.0, 16, n_s=2, n_fe=2, initial_state=[-0.5, 0, 0, 0, 0, 0], control_bounds=(-20, 20), **options)
    ocp.set_lagrange(s.function(s.u[0] ** 2))
    ocp.add_terminal(s.function([xb, s.v[1]]), [1, 0], [1, 0])
    return s, ocp


def two_discs(**options):
    """Section 8.6.3: only the first disc is driven; the discs swap places around a round obstacle."""
    s = swb.Scene("x1 y1 x2 y2", u="ux uy", name="two discs")
    (x1, y1, x2, y2), v = s.q, s.v

    def drag(a, b):
        speed = sqrt(a * a + b * b + 0.01)
        return -2 * a / speed, -2 * b / speed

    (ax, ay), (bx, by) = drag(v[0], v[1]), drag(v[2], v[3])
    s.inertia([2, 2, 1, 1])
    s.force([s.u[0] + ax, s.u[1] + ay, bx, by])
    s.contact("discs", gap=(x1 - x2) ** 2 + (y1 - y2) ** 2 - 0.25)
    goal, weights = [2, 0, -2, 0, 0, 0, 0, 0], [10] * 4 + [0.01] * 4
    miss = sum(w * (z - r) * (z - r) for w, z, r in zip(weights, s.x, goal))
    ocp = swb.Ocp(s, 5.0, 25, n_s=1, n_fe=3, initial_state=[-2, 0, 2, 0, 0, 0, 0, 0], control_bounds=(-30, 30), **options)
    ocp.set_state_bounds([-10] * 4 + [-5] * 4, [10] * 4 + [5] * 4)
    ocp.set_lagrange(s.function(miss + 0.1 * (s.u[0] ** 2 + s.u[1] ** 2)))
    ocp.set_mayer(s.function(100 * miss))
    ocp.add_path(s.function([x1**2 + y1**2 - 1.3**2, x2**2 + y2**2 - 1.2**2]), [0, 0], None, at="elements")
    return s, ocp


def cart_pole(**options):
    """A pole on a cart between two walls that its tip may lean against: upright again with little force."""
    cart, tip, length = 1.0, 0.2, 0.5
    s = swb.Scene("x a", u="F", name="cart-pole with walls")
    (x, a), (vx, w) = s.q, s.v
    coupling = tip * length * cos(a)
    s.inertia([[cart + tip, coupling], [coupling, tip * length**2]])
    s.force([s.u[0] + tip * length * sin(a) * w**2, tip * length * G * sin(a)])
    reach = x + length * sin(a)
    s.contact("left", gap=reach + 0.3)
    s.contact("right", gap=0.3 - reach)
    ocp = swb.Ocp(s, 2.0, 20, n_s=2, n_fe=2, initial_state=[0, 0.3, 0, 0.5], control_bounds=(-3, 3), **options)
    ocp.set_lagrange(s.function(s.u[0] ** 2 + 10 * a**2 + x**2))
    ocp.add_terminal(s.function([x, a, vx, w]), [0] * 4, [0] * 4)
    return s, ocp


def ball_in_cup(**options):
    """A ball on a string that only pulls, below a cup that is driven: it is to be above the cup at the end."""
    s = swb.Scene("cx cy x y", u="fx fy", name="ball in cup")
    cx, cy, x, y = s.q
    s.inertia([1, 1, 0.1, 0.1])
    s.force([s.u[0], s.u[1], 0, -0.1 * G])
    s.contact("string", gap=0.25 - (x - cx) ** 2 - (y - cy) ** 2)
    start = [0, 0, 0, -0.5, 0, 0, 0, 0]
    ocp = swb.Ocp(s, 1.5, 15, n_s=2, n_fe=2, initial_state=start, control_bounds=(-15, 15), **options)
    ocp.set_lagrange(s.function(s.u[0] ** 2 + s.u[1] ** 2))
    ocp.add_terminal(s.function([x - cx, y - cy]), [0, 0.1], [0, 0.1])
    return s, ocp


def drone(**options):
    """A drone lifts a load off the ground by a tether that is slack at first, and brings it to rest in the air; the drone itself stays
    above 0.3."""
    s = swb.Scene("xd yd xl yl", u="ux uy", name="drone with a tether")
    (xd, yd, xl, yl), v = s.q, s.v
    s.inertia([1, 1, 0.3, 0.3])
    s.force([s.u[0] - 0.1 * v[0], s.u[1] - G - 0.1 * v[1], -0.1 * v[2], -0.3 * G - 0.1 * v[3]])
    s.contact("tether", gap=1 - (xd - xl) ** 2 - (yd - yl) ** 2)
    s.contact("ground", gap=yl, tangents=[xl], mu=0.5)
    start = [0, 0.5, 0, 0, 0, 0, 0, 0]
    ocp = swb.Ocp(s, 3.0, 15, n_s=2, n_fe=2, initial_state=start, control_bounds=(-20, 20), **options)
    ocp.set_lagrange(s.function(s.u[0] ** 2 + (s.u[1] - G) ** 2))
    ocp.add_path(s.function([yd]), [0.3])
    ocp.add_terminal(s.function([xl, yl, v[2], v[3]]), [2, 1, 0, 0], [2, 1, 0, 0])
    return s, ocp


def billiard(**options):
    """A driven ball hits another one, which is to be at a place that no straight shot from there reaches."""
    s = swb.Scene("x1 y1 x2 y2", u="fx fy", name="billiard")
    (x1, y1, x2, y2), v = s.q, s.v
    s.force([s.u[0] - 0.3 * v[0], s.u[1] - 0.3 * v[1], -0.3 * v[2], -0.3 * v[3]])
    s.contact("balls", gap=sqrt((x1 - x2) ** 2 + (y1 - y2) ** 2) - 0.1, e=0.95)
    s.contact("cushion", gap=1 - y2, e=0.8)
    start = [0, 0, 1, 0.2, 0, 0, 0, 0]
    ocp = swb.Ocp(s, 2.0, 20, n_s=2, n_fe=2, initial_state=start, control_bounds=(-15, 15), **options)
    ocp.set_lagrange(s.function(s.u[0] ** 2 + s.u[1] ** 2))
    ocp.add_terminal(s.function([x2, y2]), [1.5, -0.5], [1.5, -0.5])
    return s, ocp


def jumper(**options):
    """Two masses with an actuator between them, on a floor: the lower one is to be high up in between, and both at rest at the end."""
    s = swb.Scene("yb yf", u="F", name="jumper")
    (yb, yf), (vb, vf) = s.q, s.v
    s.inertia([2, 0.5])
    s.force([s.u[0] - 2 * G, -s.u[0] - 0.5 * G])
    s.contact("floor", gap=yf)
    ocp = swb.Ocp(s, 1.5, 20, n_s=2, n_fe=2, initial_state=[0.5, 0, 0, 0], control_bounds=(-80, 80), **options)
    ocp.add_path(s.function([yb - yf]), [0.2], [0.8])
    ocp.set_lagrange(s.function(0.01 * s.u[0] ** 2 - 10 * yf))
    ocp.add_terminal(s.function([yb, yf, vb, vf]), [0.5, 0, 0, 0], [0.5, 0, 0, 0])
    return s, ocp


def hopper(reach=1.0, horizon=1.0, stages=10, holes=(0.5,), **options):
    """Section 8.6.2: the one-legged robot Capler hops over holes in the ground. The figures are those of nosnoc's model of it (a point mass at
    the hip, two links with their inertias); a hole is an ellipse half a unit wide that the foot keeps out of. One hop of one unit here; the
    thesis has three, `hopper(3.0, 2.5, 20, (0.5, 1.5, 2.5))`."""
    hip, thigh, shank, length = 3.975, 1.782, 0.548, 0.2
    s_thigh, s_shank, i_thigh, i_shank = 0.016, 0.1, 0.001, 0.0032
    s = swb.Scene("x z hip knee", u="u_hip u_knee", name="hopper")
    (x, z, a, b), v = s.q, s.v
    c = a + b
    mass, first, second = hip + thigh + shank, thigh * s_thigh + shank * length, shank * s_shank
    own = [thigh * s_thigh**2 + shank * length**2 + i_thigh, shank * s_shank**2 + i_shank]
    both = shank * length * s_shank * cos(b)
    xa, xc, za, zc = -first * cos(a), -second * cos(c), first * sin(a), second * sin(c)
    s.inertia(
        [
            [mass, 0, xa + xc, xc],
            [0, mass, za + zc, zc],
            [xa + xc, za + zc, own[0] + own[1] + 2 * both, both + own[1]],
            [xc, zc, both + own[1], own[1]],
        ]
    )
    wa, wc = v[2], v[2] + v[3]
    turn = shank * length * s_shank * sin(b)
    qa, qc = -turn * wc**2 + first * G * sin(a), turn * wa**2 + second * G * sin(c)
    push = [
        first * sin(a) * wa**2 + second * sin(c) * wc**2,
        first * cos(a) * wa**2 + second * cos(c) * wc**2 + mass * G,
        qa + qc - s.u[0],
        qc - s.u[1],
    ]
    s.force([-f for f in push])
    knee = x - length * sin(a), z - length * cos(a)
    foot = knee[0] - length * sin(c), knee[1] - length * cos(c)
    s.contact("foot", gap=foot[1], tangents=[foot[0]], mu=0.8)
    options = {"n_s": 3, "n_fe": 3, **options}
    start = [0, 0.4, 0, 0, 0, 0, 0, 0]
    ocp = swb.Ocp(s, horizon, stages, initial_state=start, control_bounds=(-60, 60), **options)
    ocp.set_lagrange(s.function(s.u[0] ** 2 + s.u[1] ** 2))
    kinematic = s.function([x, foot[0], knee[0], z, a, b, knee[1], foot[1]])
    hip_most, knee_most = 3 * math.pi / 8, math.pi / 2
    lower = [-0.05, -0.05, -0.05, 0.2, -hip_most, -knee_most, 0.05, -0.005]
    upper = [math.inf] * 3 + [0.55, hip_most, knee_most, math.inf, 0.2]
    ocp.add_path(kinematic, lower, upper)
    outside = [((foot[0] - at) / 0.25) ** 2 + (foot[1] / 0.1) ** 2 for at in holes]
    ocp.add_path(s.function(outside), [1.0] * len(holes))
    ocp.add_terminal(s.function(s.q), [reach, 0.4, 0, 0], [reach, 0.4, 0, 0])
    return s, ocp


PROBLEMS = [
    puck,
    slow_box,
    box,
    two_carts,
    three_carts,
    push_box,
    cart_pole,
    ball_in_cup,
    drone,
    billiard,
    jumper,
    two_discs,
    hopper,
]


def picture(s, ocp, r, path):
    """Coordinates, velocities, controls and normal forces over time; impacts are dotted lines."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(4, 1, sharex=True, figsize=(7, 8))
    t = r.trajectory
    # both limits at jumps: the start of an element is behind, its end is before
    starts = np.nextafter(t.times[:-1], np.inf)
    times = np.concatenate([[a, *row] for a, row in zip(starts, t.stage_times)])
    states = t(times)
    for i, name in enumerate(s.names[0]):
        axes[0].plot(times, states[:, i], label=name)
    for i, name in enumerate(s.names[1]):
        axes[1].plot(times, states[:, s.n_q + i], label=name)
    for i, name in enumerate(s.names[2]):
        axes[2].stairs(r.controls[:, i], r.control_times, label=name, baseline=None)
    fine = np.linspace(t.t_start, t.t_end, 800)
    for name in r.contacts.names:
        axes[3].plot(fine, r.contacts.force(name, fine)[:, 0], label=name)
    for impact in r.contacts.impacts:
        for a in axes:
            a.axvline(impact.t, color="grey", linestyle=":", linewidth=0.8)
    for a, what in zip(axes, ("coordinates", "velocities", "controls", "normal forces")):
        a.set_ylabel(what)
        a.legend(loc="upper right", fontsize=7)
    axes[0].set_title(s.name)
    axes[3].set_xlabel("time")
    figure.savefig(path, bbox_inches="tight")
    plt.close(figure)


def main():
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    folder.mkdir(parents=True, exist_ok=True)
    names = sys.argv[2:]
    for problem in PROBLEMS:
        if names and problem.__name__ not in names:
            continue
        s, ocp = problem(max_time=60.0)
        clock = time.perf_counter()
        r = ocp.solve()
        seconds = time.perf_counter() - clock
        error = r.accuracy.terminal if r.accuracy else math.nan
        print(
            f"{problem.__name__:12} {r.outcome.name.lower():9} cost {r.cost_reached:.10g}, replay {error:.1e}, "
            f"{len(r.contacts.impacts)} impacts, {r.stats.iterations} iterations, {seconds:.2f} s"
        )
        if not r.success:
            print("  " + r.message)
            continue
        print("\n".join("  " + line for line in r.contacts.table().splitlines()))
        picture(s, ocp, r, folder / f"jumps_{problem.__name__}.svg")


if __name__ == "__main__":
    main()
