"""Piecewise affine systems with one or two straight surfaces, every number at random: to a place, or close to one."""

import numpy as np

from .statement import Statement, derive, events, model, pick, pieces, plain, whole
from switchback_control import where


def draw(rng):
    n, stages = whole(rng, 2, 3), whole(rng, 3, 8)
    return {
        "A": (0.7 * rng.normal(size=(2, n, n))).tolist(), "b": (0.7 * rng.normal(size=(2, n))).tolist(), "B": rng.normal(size=(2, n)).tolist(),
        "surface": [*rng.normal(size=n).tolist(), float(0.5 * rng.normal())],
        "push": [rng.normal(size=n).tolist(), [*rng.normal(size=n).tolist(), float(0.5 * rng.normal())]] if rng.random() < 0.5 else None,
        "x0": rng.normal(size=n).tolist(), "aim": rng.normal(size=n).tolist(), "weight": float(rng.uniform(0.0, 1.0)),
        "ends": pick(rng, "near", "near", "first"), "stages": stages, "horizon": float(rng.uniform(1.0, 3.0)), "units": plain(rng, n, 1),
        "guess": [[u] for u in pieces(rng, stages, -1.5, 1.5)], "bounds": [[-2.0], [2.0]],
    }  # fmt: skip


def state(d):
    m, x, (u,) = model(d, "affine")
    n = len(x)

    def side(s):
        return [sum(d["A"][s][i][j] * x[j] for j in range(n)) + d["b"][s][i] + d["B"][s][i] * u for i in range(n)]

    def surface(c):
        return sum(c[j] * x[j] for j in range(n)) + c[n]

    psi = surface(d["surface"])
    rates = [where(psi > 0, p, q) for p, q in zip(side(0), side(1))]
    if d["push"]:
        other = surface(d["push"][1])
        rates = [r + where(other > 0, p, -p) for r, p in zip(rates, d["push"][0])]
    derive(d, m, rates)
    s = Statement(m, lagrange=0.1 * u**2 + d["weight"] * sum(w**2 for w in x), options={"n_s": 3, "n_fe": 3})
    if d["ends"] == "near":
        s.mayer = 5.0 * sum((w - a) ** 2 for w, a in zip(x, d["aim"]))
    else:
        s.goal, s.goal_sizes = [m.x[0]], d["units"]["x"][:1]
    return s


def accept(d, run):
    """A surface is reached, and the state stays of a usual size."""
    return events(run) > 0 and max(abs(run.x_end / d["units"]["x"])) < 10 and np.all(np.isfinite(run.x_end))
