"""Balls and blocks that bounce: in a box, off posts, through a hole, in a row, thrown by a hand; to a place."""

import numpy as np

from .statement import Statement, around, events, forces, mechanical, pick, pieces, running, scene, timed, whole
from switchback_control import sqrt


def draw(rng):
    kind = pick(rng, "box", "posts", "hole", "row", "throw")
    stages = whole(rng, 8, 16)
    d = {"kind": kind, "stages": stages, "gravity": pick(rng, 0.0, 1.0), "e": float(rng.uniform(0.4, 1.0)), "room": pick(rng, 0.0, 0.0, 0.01)}
    if kind in ("box", "posts", "hole"):
        d |= {"masses": [1.0, 1.0], "drag": pick(rng, 0.0, 0.1), "horizon": float(rng.uniform(2.0, 4.0)), "walls": rng.uniform(0.7, 1.3, 4).tolist()}
        d["x0"] = [float(rng.uniform(-0.5, 0.5)), float(rng.uniform(-0.5, 0.5)), *rng.uniform(-1.2, 1.2, 2).tolist()]
        d["posts"] = [[*rng.uniform(-1.0, 1.0, 2).tolist(), float(rng.uniform(0.1, 0.4))] for _ in range(whole(rng, 1, 3))]
        if kind == "hole":
            at, high, wide, r = rng.uniform(0.3, 0.8), rng.uniform(-0.4, 0.4), rng.uniform(0.1, 0.3), rng.uniform(0.3, 0.8)
            d["posts"] = [[float(at), float(high + way * (r + wide)), float(r)] for way in (-1, 1)]
            d["x0"][0], d["x0"][2] = float(at - r - rng.uniform(0.1, 0.6)), float(rng.uniform(0.0, 1.0))
        rows = [pieces(rng, stages, -0.8, 0.8, 4), pieces(rng, stages, -0.8, 0.8 + 0.8 * d["gravity"], 4)]
        most = [2.0, 2.0]
    elif kind == "row":
        n = whole(rng, 2, 4)
        gaps = rng.uniform(0.1, 0.5, n - 1)
        d |= {"masses": [around(rng, 1.0, 2.0) for _ in range(n)], "drag": float(rng.uniform(0.1, 0.6)), "horizon": float(rng.uniform(3.0, 5.0))}
        d["x0"] = [0.0, *np.cumsum(gaps).tolist(), *[0.0] * n]
        d["gravity"], ahead = 0.0, max(1, stages // 3)
        rows = [pieces(rng, ahead, 0.5, 3.0) + pieces(rng, stages - ahead, -1.5, 0.5)]
        most = [6.0]
    else:
        ball = around(rng, 0.2, 2.0)
        d |= {"masses": [1.0, 1.0, ball, ball], "mu": float(rng.uniform(0.4, 1.0)), "horizon": float(rng.uniform(1.0, 2.0)), "gravity": 1.0}
        d |= {"x0": [0.0] * 8, "e": pick(rng, 0.0, 0.3)}
        lifts, falls = max(1, stages // 4), max(1, stages // 4)
        rest = stages - lifts - falls
        rows = [
            pieces(rng, lifts, 0.0, 1.0) + pieces(rng, falls, -2.0, 0.0) + pieces(rng, rest, -0.5, 0.5),
            pieces(rng, lifts, 3.0, 6.0) + pieces(rng, falls, -4.0, 0.0) + pieces(rng, rest, -0.5, 0.5),
        ]
        most = [8.0, 8.0]
    d["guess"] = [list(row) for row in zip(*rows)]
    d["bounds"] = [[-m for m in most], most]
    d["units"] = mechanical(rng, len(d["masses"]), len(most))
    timed(rng, d, ("energy", "energy", "energy", "time"))
    return d


def state(d):
    s, q, v, u = scene(d, f"walls, {d['kind']}", d["masses"])
    length, path = d["units"]["length"], []
    if d["kind"] in ("box", "posts", "hole"):
        x, y = q
        forces(d, s, [u[0] - d["drag"] * v[0], u[1] - d["drag"] * v[1] - d["gravity"]])
        if d["kind"] == "box":
            for name, gap in zip(("left", "right", "floor", "ceiling"), (x + d["walls"][0], d["walls"][1] - x, y + d["walls"][2], d["walls"][3] - y)):
                s.contact(name, gap=gap * length, e=d["e"])
        else:
            for i, (a, b, r) in enumerate(d["posts"]):
                s.contact(f"post {i}", gap=(sqrt((x - a) ** 2 + (y - b) ** 2 + 1e-12) - r) * length, e=d["e"])
        goal = [0, 1]
    elif d["kind"] == "row":
        n = len(q)
        forces(d, s, [u[0] - 0.1 * v[0], *(-d["drag"] * w for w in v[1:])])
        for i in range(n - 1):
            s.contact(f"{i}-{i + 1}", gap=(q[i + 1] - q[i]) * length, e=d["e"])
        goal = [0, n - 1]
    else:
        xh, yh, xb, yb = q
        forces(d, s, [u[0], u[1] - 1.0, 0.0, -d["masses"][2]])
        s.contact("hand", gap=(yb - yh) * length, tangents=[(xb - xh) * length], mu=d["mu"], e=d["e"])
        path = [([xh, yh], [-1.5, -1.5], [1.5, 1.5])]
        goal = [2, 3]
    return Statement(
        s, lagrange=running(d, u), goal=[s.q[i] for i in goal], goal_sizes=[length] * len(goal), path=path, options={"n_s": 2, "n_fe": 1}
    )


def accept(d, run):
    """Something bounces, or the ball leaves the hand and is on its way."""
    end = run.x_end / d["units"]["x"]
    if d["kind"] == "throw":
        return 0.15 < end[3] - end[1] and 0.2 < abs(end[2]) < 4 and events(run) < 12
    if d["kind"] == "row":
        return end[len(d["masses"]) - 1] > d["x0"][len(d["masses"]) - 1] + 0.2 and events(run) < 15
    if d["kind"] in ("posts", "hole"):
        through = d["kind"] == "posts" or (end[0] > d["posts"][0][0] + 0.1 and abs(end[1]) < 3)
        near = min(np.hypot(d["x0"][0] - a, d["x0"][1] - b) - r for a, b, r in d["posts"])
        return through and near > 0.05 and (d["kind"] == "hole" or events(run) > 0) and events(run) < 10
    return 0 < events(run) < 10
