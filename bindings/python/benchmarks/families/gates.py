"""Systems whose controls pass thresholds of their own: gates that remember it, levers that do not."""

from .statement import Statement, derive, model, pick, plain, whole
from switchback_control import where


def draw(rng):
    kind, stages, second = pick(rng, "gate", "lever"), whole(rng, 4, 9), rng.random() < 0.5
    on = float(rng.uniform(0.6, 1.6))
    return {
        "kind": kind, "stages": stages, "horizon": float(rng.uniform(1.0, 3.0)), "on": on, "off": on * float(rng.uniform(0.1, 0.6)),
        "strong": float(rng.uniform(1.0, 4.0)), "weak": float(rng.uniform(0.05, 0.4)), "loss": float(rng.uniform(0.0, 0.4)),
        "x0": [0.0] * (2 if second else 1), "bounds": [[0.0], [3.0 * on]], "units": plain(rng, 2 if second else 1, 1),
        "guess": [[float(on * rng.uniform(1.0, 2.0) if k == 0 or rng.random() < 0.5 else on * rng.uniform(0.0, 1.0))] for k in range(stages)],
    }  # fmt: skip


def state(d):
    m, x, (u,) = model(d, d["kind"], len(d["x0"]))
    if d["kind"] == "gate":
        push = (d["weak"] + d["strong"] * m.hysteresis(u, on=d["on"], off=d["off"], name="open")) * u
    else:
        push = where(u > d["on"], d["strong"] * u, d["weak"] * u)
    derive(d, m, [*x[1:], push - d["loss"] * x[-1]])
    return Statement(m, lagrange=u**2, goal=[m.x[0]], goal_sizes=d["units"]["x"][:1], options={"n_fe": 2})


def accept(d, run):
    """It is moved."""
    return abs(run.x_end[0] / d["units"]["x"][0]) > 1e-2
