"""A straight line that motions lead away from on both sides: next to it, or with a start that is free on either side."""

from .statement import Statement, derive, model, pieces, plain, whole
from switchback_control import where


def draw(rng):
    stages, free = whole(rng, 5, 11), rng.random() < 0.6
    d = {
        "slope": float(rng.uniform(0.2, 1.0)), "away": rng.uniform(0.5, 1.5, 2).tolist(), "drift": float(rng.uniform(0.05, 0.4)),
        "loss": float(rng.uniform(0.1, 0.5)), "aim": rng.uniform(-1.0, 1.5, 2).tolist(), "x0": rng.uniform(-1.0, 1.0, 2).tolist(),
        "stages": stages, "horizon": float(rng.uniform(1.5, 4.0)), "units": plain(rng, 2, 1), "bounds": [[-1.0], [1.0]],
        "guess": [[u] for u in pieces(rng, stages, -1.0, 1.0)],
    }  # fmt: skip
    return d | {"start": [[-2.0, -1.0], [2.0, 1.0]]} if free else d


def state(d):
    m, (x, y), (u,) = model(d, "line")
    down, up = d["away"]
    derive(d, m, [where(y > d["slope"] * x, -down, up) + d["drift"] * y, u - d["loss"] * y])
    (a, b) = d["aim"]
    return Statement(m, lagrange=0.1 * u**2 + 0.05 * x**2, mayer=(x - a) ** 2 + (y - b) ** 2)


def accept(d, run):
    """It stays of a usual size."""
    return max(abs(run.x_end[:2] / d["units"]["x"])) < 10
