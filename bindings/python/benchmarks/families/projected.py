"""States that are held inside of a set by the least push: play in a chain, reservoirs that are full or empty, a point in a disc."""

import numpy as np

import switchback_control as swb

from .statement import Statement, around, events, pick, pieces, plain, whole


def draw(rng):
    kind, stages = pick(rng, "play", "reservoirs", "disc"), whole(rng, 5, 12)
    d = {"kind": kind, "stages": stages, "horizon": float(rng.uniform(2.0, 5.0)), "room": pick(rng, 0.0, 0.02), "controls": 1}
    n = 2
    if kind == "play":
        n = whole(rng, 2, 4)
        d |= {"width": [float(rng.uniform(0.1, 0.4)) for _ in range(n - 1)], "x0": [0.0] * n, "bounds": [[-2.0], [2.0]]}
        rows = [pieces(rng, stages, -1.0, 1.0)]
    elif kind == "reservoirs":
        n = whole(rng, 1, 3)
        d |= {"cap": [around(rng, 1.0) for _ in range(n)], "loss": rng.uniform(0.1, 0.6, n).tolist(), "x0": rng.uniform(0.1, 0.5, n).tolist()}
        d["bounds"] = [[0.0], [2.0]]
        rows = [pieces(rng, stages, 0.0, 1.6)]
    else:
        d |= {"turn": float(rng.uniform(-1.0, 1.0)), "drift": rng.uniform(-0.5, 0.5, 2).tolist(), "x0": rng.uniform(-0.5, 0.5, 2).tolist(), "controls": 2}
        d["bounds"] = [[-1.5] * 2, [1.5] * 2]
        rows = [pieces(rng, stages, -1.0, 1.0), pieces(rng, stages, -1.0, 1.0)]
    d["guess"] = [list(row) for row in zip(*rows)]
    units = plain(rng, n, d["controls"])
    d["units"] = units | {"x": units["x"][:1] * n}  # one size: the push is along gradients
    d["cost"] = pick(rng, "energy", "near")
    d["aim"] = rng.uniform(-0.5, 0.5, n).tolist()
    return d


def state(d):
    size, time, n = d["units"]["x"][0], d["units"]["t"], len(d["x0"])
    m = swb.Projected(n, u=d["controls"], name=f"projected, {d['kind']}")
    x, u = [m.x[i] / size for i in range(n)], [m.u[j] / unit for j, unit in enumerate(d["units"]["u"])]
    if d["kind"] == "play":
        rates = [u[0]] + [0.0 * u[0]] * (n - 1)
        # the push acts on both: the others are dragged along, and slow down the first
        for i, w in enumerate(d["width"]):
            m.constraint(f"above {i}", (x[i] - x[i + 1] + w) * size)
            m.constraint(f"below {i}", (x[i + 1] - x[i] + w) * size)
    elif d["kind"] == "reservoirs":
        rates, comes = [], u[0]
        for i in range(n):
            rates.append(comes - d["loss"][i] - 0.1 * x[i])
            comes = 0.3 + 0.5 * x[i]
            m.constraint(f"empty {i}", x[i] * size)
            m.constraint(f"full {i}", (d["cap"][i] - x[i]) * size)
    else:
        rates = [u[0] - d["turn"] * x[1] + d["drift"][0], u[1] + d["turn"] * x[0] + d["drift"][1]]
        m.constraint("disc", (1.0 - x[0] ** 2 - x[1] ** 2) * size)
    m.f([r * (size / time) for r in rates])
    effort = sum(w**2 for w in u)
    near = sum((x[i] - d["aim"][i]) ** 2 for i in range(n))
    goal = [n - 1] if d["kind"] != "disc" else [0, 1]
    return Statement(
        m, lagrange=effort if d["cost"] == "energy" else near + 0.05 * effort, goal=[m.x[i] for i in goal], goal_sizes=[size] * len(goal),
        options={"n_s": 2, "n_fe": 3},
    )  # fmt: skip


def accept(d, run):
    """A constraint becomes active."""
    end = np.array(run.x_end) / d["units"]["x"]
    return 0 < events(run) < 20 and max(abs(end - np.array(d["x0"]))) > 0.1
