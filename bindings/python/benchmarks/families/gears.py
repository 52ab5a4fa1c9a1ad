"""A vehicle whose drive depends on its speed, by gears, over hills: to a place, and to a speed."""

import numpy as np

from .statement import Statement, around, derive, mechanical, model, pick, pieces, running, timed, whole
from switchback_control import where
from switchback_control.expr import step_table


def draw(rng):
    n, stages = whole(rng, 2, 5), whole(rng, 6, 16)
    breaks = np.cumsum([around(rng, 0.5) for _ in range(n - 1)]).tolist()
    falls = rng.random() < 0.7
    gains = [around(rng, 1.0 / (1 + 0.6 * i) if falls else 1.0 + 0.8 * i, 1.2) for i in range(n)]
    hill = [float(rng.uniform(0.5, 2.0)), around(rng, 1.0), float(rng.uniform(0.1, 0.4)) * pick(rng, -1, 1)] if rng.random() < 0.5 else None
    d = {
        "breaks": breaks, "gains": gains, "hill": hill, "drag": pick(rng, 0.0, 0.05, 0.15), "stages": stages,
        "horizon": float(rng.uniform(3.0, 6.0)), "x0": [0.0, 0.0], "units": mechanical(rng, 1, 1), "at_rest": bool(rng.random() < 0.6),
        "bounds": [[-1.0], [1.0]], "limit": None, "room": pick(rng, 0.0, 0.0, 0.02),
    }  # fmt: skip
    ahead = max(1, int(stages * rng.uniform(0.4, 0.7)))
    d["guess"] = [[u] for u in pieces(rng, ahead, 0.5, 1.0) + pieces(rng, stages - ahead, -0.8, 0.2)]
    if rng.random() < 0.3:
        d["limit"] = float(breaks[-1] * rng.uniform(1.1, 1.8))
    timed(rng, d, ("energy", "time", "time", "fuel"))
    return d


def state(d):
    m, (q, v), (u,) = model(d, "gears")
    rate = step_table(v, d["breaks"], d["gains"]) * u - d["drag"] * v**2
    if d["hill"]:
        at, wide, slope = d["hill"]
        rate = rate - where(q > at, slope, 0.0) + where(q > at + wide, slope, 0.0)
    derive(d, m, [v, rate])
    goal = [0, 1] if d["at_rest"] else [0]
    path = [([v], [0.0], [d["limit"]])] if d["limit"] else []
    return Statement(
        m, lagrange=running(d, [u]), goal=[m.x[i] for i in goal], goal_sizes=[d["units"]["x"][i] for i in goal], path=path,
        options={"n_s": 3, "n_fe": 3},
    )  # fmt: skip


def accept(d, run):
    """It never goes back, gets beyond the first gear, and is slow in the end where that is to be."""
    x = run(np.linspace(0.0, run.t_end, 200)) / d["units"]["x"]
    return x[1:, 1].min() > 0 and x[:, 1].max() > 1.1 * d["breaks"][0] and x[-1, 0] > 0.5
