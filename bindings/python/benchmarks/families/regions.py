"""Ways through regions with a field of their own: layers, patches, currents, wind; the fastest one, or the one of least effort."""

import math

import numpy as np

from .statement import Statement, around, decades, derive, events, model, pick, pieces, running, whole
from switchback_control import cos, sin, where
from switchback_control.expr import step_table


def draw(rng):
    kind, stages = pick(rng, "layers", "layers", "patches", "current", "wind"), whole(rng, 4, 12)
    size = decades(rng, 0.03, 30.0)
    tilt = float(rng.uniform(-0.6, 0.6))
    n = whole(rng, 2, 5) if kind != "patches" else whole(rng, 1, 3)
    d = {
        "kind": kind, "stages": stages, "x0": [0.0, 0.0], "horizon": float(rng.uniform(2.0, 4.0)), "normal": [math.sin(tilt), math.cos(tilt)],
        "breaks": np.cumsum([around(rng, 0.6) for _ in range(n - 1)]).tolist(), "values": [decades(rng, 0.3, 3.0) for _ in range(n)],
        "patches": [[float(rng.uniform(-1, 1)), float(rng.uniform(0.5, 2.5)), float(rng.uniform(0.2, 0.8))] for _ in range(n)],
        "steered": pick(rng, "heading", "heading", "velocity") if kind != "wind" else "heading", "room": pick(rng, 0.0, 0.0, 0.01),
    }  # fmt: skip
    if kind == "current":
        d["values"] = rng.uniform(-0.7, 0.7, n).tolist()
    if kind == "wind":
        d["values"] = np.cumsum(rng.uniform(-0.8, 0.8, n)).tolist()
    t, cost = decades(rng, 0.03, 30.0), decades(rng, 0.03, 30.0)
    turned = float(rng.uniform(0.7, 2.4))
    if d["steered"] == "heading":
        d |= {"units": {"t": t, "x": [size] * 2, "u": [1.0], "cost": cost}, "bounds": [[turned - 2.0], [turned + 2.0]], "cost": "time"}
        width = 0.9 if kind == "wind" else 0.4
        d["guess"] = [[turned + w] for w in pieces(rng, stages, -width, width, 4)]
        d["free"] = {"what": "horizon", "bounds": [0.2 * d["horizon"], 3.0 * d["horizon"]]}
        if stages <= 6 and rng.random() < 0.5:
            d["free"] = {"what": "stages", "bounds": [0.02 * d["horizon"] / stages, 5.0 * d["horizon"] / stages]}
    else:
        d |= {"units": {"t": t, "x": [size] * 2, "u": [size / t] * 2, "cost": cost}, "bounds": [[-3.0] * 2, [3.0] * 2], "cost": "energy"}
        rows = pieces(rng, stages, -0.5, 0.5), pieces(rng, stages, 0.4, 1.2)
        d["guess"] = [list(row) for row in zip(*rows)]
    return d


def state(d):
    m, (x, y), u = model(d, "regions")
    across = d["normal"][0] * x + d["normal"][1] * y
    go = [cos(u[0]), sin(u[0])] if d["steered"] == "heading" else u
    if d["kind"] == "layers":
        speed = step_table(across, d["breaks"], d["values"])
        rates = [speed * g for g in go]
    elif d["kind"] == "patches":
        speed = 1.0
        for (a, b, r), value in zip(d["patches"], d["values"]):
            speed = speed + where((x - a) ** 2 + (y - b) ** 2 < r**2, 0.4 * (value - 1.0), 0.0)
        rates = [speed * g for g in go]
    elif d["kind"] == "current":
        stream = step_table(across, d["breaks"], d["values"])
        rates = [go[0] + stream * d["normal"][1], go[1] - stream * d["normal"][0]]
    else:  # the wind blows down the y-axis, turned by an angle of each region; towards it a boat stands still
        c = step_table(across, d["breaks"], [math.cos(a) for a in d["values"]])
        s = step_table(across, d["breaks"], [math.sin(a) for a in d["values"]])
        along = go[0] * s + go[1] * c
        speed = 0.05 + (1.0 - along) * (1.0 - 0.4 * along)
        rates = [speed * g for g in go]
    derive(d, m, rates)
    return Statement(
        m, lagrange=1.0 + 0.0 * u[0] if d["cost"] == "time" else running(d, u), goal=[m.x[0], m.x[1]], goal_sizes=d["units"]["x"],
        options={"n_s": 2, "n_fe": 3},
    )  # fmt: skip


def accept(d, run):
    """At least one region is left on the way."""
    end = run.x_end / d["units"]["x"]
    return events(run) > 0 and np.hypot(*end) > 0.7
