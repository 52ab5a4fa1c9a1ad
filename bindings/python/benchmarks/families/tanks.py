"""Tanks in a row with overflows, and valves that open at a level: to levels, at the least effort or near a level."""

import numpy as np

from .statement import Statement, around, derive, events, model, pick, pieces, plain, whole
from switchback_control import where


def draw(rng):
    n, stages = whole(rng, 2, 4), whole(rng, 6, 14)
    d = {
        "areas": [around(rng, 1.0, 2.0) for _ in range(n)], "drains": [around(rng, 0.3, 2.0) for _ in range(n)],
        "brims": [float(rng.uniform(0.4, 1.0)) for _ in range(n)], "spills": [around(rng, 4.0, 3.0) for _ in range(n)],
        "valves": [[float(rng.uniform(0.2, 0.6)), float(rng.uniform(0.1, 0.5))] if rng.random() < 0.4 else None for _ in range(n)],
        "stages": stages, "horizon": float(rng.uniform(3.0, 8.0)), "x0": rng.uniform(0.0, 0.4, n).tolist(), "units": plain(rng, n, 1),
        "bounds": [[0.0], [2.0]], "room": pick(rng, 0.0, 0.02), "cost": pick(rng, "energy", "near", "both"),
        "ends": pick(rng, "last", "last", "all") if n == 2 else "last",
    }  # fmt: skip
    d["aim"] = around(rng, d["brims"][-1], 1.2)
    d["guess"] = [[u] for u in pieces(rng, stages, 0.0, 1.6)]
    return d


def state(d):
    n = len(d["areas"])
    m, h, (u,) = model(d, "tanks")
    comes, rates = u, []
    for i in range(n):
        over = where(h[i] > d["brims"][i], d["spills"][i] * (h[i] - d["brims"][i]), 0.0)
        leaves = d["drains"][i] * h[i]
        if d["valves"][i]:
            level, flow = d["valves"][i]
            leaves = leaves + where(h[i] > level, flow, 0.0)
        rates.append((comes - over - leaves) / d["areas"][i])
        comes = over + 0.3 * d["drains"][i] * h[i]
    derive(d, m, rates)
    near = 4.0 * (h[-1] - d["aim"]) ** 2
    goal = range(n) if d["ends"] == "all" else [n - 1]
    return Statement(
        m, lagrange={"energy": u**2, "near": near + 1e-3 * u**2, "both": near + 0.2 * u**2}[d["cost"]], goal=[m.x[i] for i in goal],
        goal_sizes=[d["units"]["x"][i] for i in goal], options={"n_s": 3, "n_fe": 3},
    )  # fmt: skip


def accept(d, run):
    """Something overflows or a valve opens, and the last tank is not empty."""
    return events(run) > 0 and run.x_end[-1] > 0.05 * d["units"]["x"][-1] and np.all(np.isfinite(run.x_end))
