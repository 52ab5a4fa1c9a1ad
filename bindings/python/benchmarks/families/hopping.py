"""Bodies that move by their contacts with the ground: a leg hops up, a foot hops along and over holes, two feet crawl."""

import numpy as np

from .statement import Statement, around, events, forces, mechanical, pick, pieces, running, scene, timed, whole


def draw(rng):
    kind = pick(rng, "up", "along", "crawl")
    stages = whole(rng, 10, 16) if kind != "crawl" else whole(rng, 6, 12)
    d = {"kind": kind, "stages": stages, "mu": float(rng.uniform(0.4, 1.0)), "room": pick(rng, 0.01, 0.03), "hole": None}
    body, foot = around(rng, 1.0, 1.3), around(rng, 0.25, 1.4)
    d["stiff"], d["damping"] = around(rng, 15.0, 1.5), float(rng.uniform(0.3, 1.0))
    if kind == "up":
        d |= {"masses": [body, foot], "horizon": float(rng.uniform(2.0, 3.5)), "x0": [1.0 - body / d["stiff"], 0.0, 0.0, 0.0]}
        down, push = whole(rng, 1, 3), whole(rng, 2, 4)
        rows = [pieces(rng, down, -0.8, 0.0) + pieces(rng, push, 1.5, 4.0) + pieces(rng, stages - down - push, -1.0, 0.5)]
        most = [5.0]
    elif kind == "along":
        d |= {"masses": [body, body, foot, foot], "horizon": float(rng.uniform(2.0, 3.5)), "x0": [0.0, 1.0 - body / d["stiff"], 0.0, 0.0] + [0.0] * 4}
        push = whole(rng, 2, 4)
        rest = stages - push
        rows = [pieces(rng, push, 0.2, 1.2) + pieces(rng, rest, -1.0, 0.2), pieces(rng, push, 1.5, 4.0) + pieces(rng, rest, -1.0, 1.0)]
        most = [3.0, 5.0]
    else:
        one, two = around(rng, 1.0, 1.3), around(rng, 1.0, 1.3)
        d |= {"masses": [one, one, two, two], "horizon": float(rng.uniform(3.0, 5.0)), "x0": [0.0, 0.0, 1.0] + [0.0] * 5}
        signs = np.resize(np.repeat([1.0, -1.0], whole(rng, 1, 2)), stages)
        strong = d["mu"] * min(one, two)
        rows = [(signs * rng.uniform(0.6, 1.4) * strong).tolist(), (signs * rng.uniform(0.4, 0.8) * min(one, two)).tolist()]
        most = [3.0 * strong, 0.9 * min(one, two)]
        d["stiff"] = around(rng, 1.0, 2.0)
    d["guess"] = [list(row) for row in zip(*rows)]
    d["bounds"] = [[-m for m in most], most]
    d["units"] = mechanical(rng, len(d["masses"]), len(most))
    if kind == "along" and rng.random() < 0.5:
        d["hole"] = [float(rng.uniform(0.15, 0.4)), float(rng.uniform(0.05, 0.15)), 0.08]
    timed(rng, d, ("energy",))
    return d


def state(d):
    s, q, v, u = scene(d, f"hopping, {d['kind']}", d["masses"])
    length, k, c, masses, path = d["units"]["length"], d["stiff"], d["damping"], d["masses"], []
    if d["kind"] == "up":
        leg = u[0] + k * (1.0 - (q[0] - q[1])) - c * (v[0] - v[1])
        forces(d, s, [leg - masses[0], -leg - masses[1]])
        s.contact("floor", gap=q[1] * length)
        path.append(([q[0] - q[1]], [0.3], [1.6]))
        goal = [s.q[0]]
    elif d["kind"] == "along":
        xb, yb, xf, yf = q
        fx = u[0] - 0.5 * k * (xb - xf) - c * (v[0] - v[2])
        fy = u[1] + k * (1.0 - (yb - yf)) - c * (v[1] - v[3])
        forces(d, s, [fx, fy - masses[0], -fx, -fy - masses[2]])
        s.contact("foot", gap=yf * length, tangents=[xf * length], mu=d["mu"])
        path.append(([yb - yf, xb - xf], [0.3, -0.7], [1.6, 0.7]))
        if d["hole"]:
            at, wide, deep = d["hole"]
            path.append(([((xf - at) / wide) ** 2 + (yf / deep) ** 2], [1.0], None))
        goal = [s.q[0], s.q[1]]
    else:
        x1, y1, x2, y2 = q
        pull = u[0] - 0.3 * c * (v[0] - v[2]) + k * (x2 - x1 - 1.0)
        forces(d, s, [pull, u[1] - masses[0], -pull, -u[1] - masses[2]])
        s.contact("one", gap=y1 * length, tangents=[x1 * length], mu=d["mu"])
        s.contact("two", gap=y2 * length, tangents=[x2 * length], mu=d["mu"])
        path.append(([x2 - x1], [0.2], [1.8]))
        goal = [s.q[0], s.q[2]]
    return Statement(s, lagrange=running(d, u), goal=goal, goal_sizes=[length] * len(goal), path=path, options={"n_s": 3, "n_fe": 1})


def accept(d, run):
    """It was in the air, or has come along."""
    x = run(np.linspace(0.0, run.t_end, 300)) / d["units"]["x"]
    if events(run) > 25:
        return False
    if d["kind"] == "up":
        return x[:, 1].max() > 0.1 and x[-1, 0] > 1.05
    if d["kind"] == "along":
        return x[:, 3].max() > 0.05 and x[-1, 2] > 0.3 and (d["hole"] is None or x[-1, 2] > d["hole"][0] + d["hole"][1])
    return abs(x[-1, 0] - d["x0"][0]) > 0.1 and abs(x[-1, 2] - d["x0"][2]) > 0.1
