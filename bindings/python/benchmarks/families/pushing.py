"""A pusher and boxes on a rough table, a box on a driven tray: boxes come to rest at places."""

import numpy as np

from .statement import Statement, around, forces, mechanical, pick, pieces, running, scene, timed, whole


def draw(rng):
    kind, stages = pick(rng, "one", "one", "two", "tray"), whole(rng, 8, 14)
    boxes = 2 if kind == "two" else 1
    d = {"kind": kind, "stages": stages, "mu": float(rng.uniform(0.15, 0.6)), "e": pick(rng, 0.0, 0.2, 0.5), "tilt": float(rng.uniform(-0.1, 0.1))}
    d["masses"] = [around(rng, 1.0, 2.0)] + [m for _ in range(boxes) for m in [around(rng, 1.0, 2.0)] * 2]
    gaps = [float(rng.uniform(0.1, 0.4)) for _ in range(boxes)]
    n = len(d["masses"])
    d |= {"horizon": float(rng.uniform(2.5, 5.0)), "units": mechanical(rng, n, 1), "room": pick(rng, 0.0, 0.0, 0.01)}
    if kind == "tray":
        d["x0"] = [0.0] * (2 * n)
        moves = int(0.7 * stages)
        heavy = sum(d["masses"][:2])
        d["guess"] = [[u * heavy] for u in pieces(rng, moves, -2.0, 2.0, 2) + [0.0] * (stages - moves)]
        most = 3.0 * heavy
    else:
        d["x0"] = [-gaps[0]] + [c for i in range(boxes) for c in (sum(gaps[1 : i + 1]), 0.0)] + [0.0] * n
        ahead = max(2, int(stages * rng.uniform(0.2, 0.45)))
        strong = d["mu"] * sum(d["masses"][1::2]) + d["masses"][0]
        d["guess"] = [[u * strong] for u in pieces(rng, ahead, 0.6, 1.6) + pieces(rng, stages - ahead, -0.6, -0.05)]
        most = 3.0 * strong
    d["bounds"] = [[-most], [most]]
    timed(rng, d, ("energy", "energy", "energy", "time"))
    return d


def state(d):
    s, q, v, u = scene(d, f"pushing, {d['kind']}", d["masses"])
    length, mu, masses = d["units"]["length"], d["mu"], d["masses"]
    n = len(masses)
    down = [f for m in masses[1::2] for f in (-d["tilt"] * m, -m)]
    if d["kind"] == "tray":
        xt, xb, yb = q
        forces(d, s, [u[0] - 0.2 * v[0], 0.0, -masses[1]])
        s.contact("tray", gap=yb * length, tangents=[(xb - xt) * length], mu=mu)
        goal, sizes = [s.q[1], s.v[0], s.v[1]], [length, *[length / d["units"]["t"]] * 2]
    else:
        forces(d, s, [u[0], *down])
        x, y = q[1::2], q[2::2]
        s.contact("pusher", gap=(x[0] - q[0]) * length, e=d["e"])
        for i, (a, b) in enumerate(zip(x, x[1:])):
            s.contact(f"boxes {i}", gap=(b - a) * length, e=d["e"])
        for i in range(len(x)):
            s.contact(f"table {i}", gap=y[i] * length, tangents=[x[i] * length], mu=mu)
        goal = [s.q[i] for i in range(1, n, 2)] + [s.v[i] for i in range(1, n, 2)]
        sizes = [length] * len(x) + [length / d["units"]["t"]] * len(x)
    return Statement(s, lagrange=running(d, u, d["bounds"][1][0]), goal=goal, goal_sizes=sizes, options={"n_s": 2, "n_fe": 1})


def accept(d, run):
    """Boxes have moved and rest; on a tray the box has slid, and both may go on."""
    n = len(d["masses"])
    end = run.x_end / d["units"]["x"]
    if d["kind"] == "tray":
        return abs(end[1] - end[0]) > 0.03 and abs(end[1]) < 10
    boxes = np.arange(1, n, 2)
    moved = end[boxes] - np.array(d["x0"])[boxes]
    return moved.min() > 0.1 and moved.max() < 5 and max(abs(end[n + boxes])) < 1e-9
