"""Controls that are on or off in a stage: linear systems, fishing, heating, a mixer of two valves. The optimum is that of all sequences.

Where models have free choices (`Model.choice`) they are used; else 0 <= u, 1 - u >= 0 is a complementarity of every stage.
"""

import itertools

import numpy as np

from .statement import Statement, around, derive, model, pick, plain, whole

#: Steps of the fourth-order Runge-Kutta method in a stage.
STEPS = 24


def draw(rng):
    kind, valves = pick(rng, "linear", "linear", "fishing", "heating", "mixer"), 1
    d = {"kind": kind, "horizon": float(rng.uniform(3.0, 6.0)), "factors": [around(rng, 1.0, 1.5) for _ in range(6)]}
    if kind == "linear":
        n = whole(rng, 1, 3)
        shape = rng.normal(size=(n, n))
        drift = shape - shape.T - np.diag(rng.uniform(0.2, 1.0, n))
        d |= {"A": drift.tolist(), "B": rng.normal(size=n).tolist(), "x0": rng.normal(size=n).tolist(), "aim": rng.normal(scale=0.4, size=n).tolist()}
    else:
        n = 2 if kind != "heating" else 1
        d["x0"] = {"fishing": [0.5, 0.7], "heating": [0.3], "mixer": [0.4, 0.6]}[kind]
        valves = 2 if kind == "mixer" else 1
    d["stages"] = whole(rng, 4, 6) if valves == 2 else whole(rng, 5, 12)
    units = plain(rng, n, valves)
    d["units"] = units | {"u": [1.0] * valves}
    d["price"] = pick(rng, 0.0, 0.02, 0.1)
    d["guess"] = rng.integers(0, 2, (d["stages"], valves)).astype(float).tolist()
    d["bounds"] = [[0.0] * valves, [1.0] * valves]
    return d


def rates(d, x, u):
    """Derivatives and running cost without units, of expressions as of arrays of numbers."""
    a, b, c, e, f, g = d["factors"]
    used = d["price"] * sum(u)
    if d["kind"] == "linear":
        n = len(x)
        flow = [sum(d["A"][i][j] * x[j] for j in range(n)) + d["B"][i] * u[0] for i in range(n)]
        return flow, sum((x[i] - d["aim"][i]) ** 2 for i in range(n)) + used
    if d["kind"] == "fishing":
        flow = [x[0] * (a - b * x[1] - 0.4 * c * u[0]), x[1] * (-e + f * x[0] - 0.2 * g * u[0])]
        return flow, (x[0] - e / f) ** 2 + (x[1] - a / b) ** 2 + used
    if d["kind"] == "heating":
        return [2.0 * a * u[0] - b * x[0] - 0.2 * c * x[0] ** 3], 4.0 * (x[0] - 0.6 * e) ** 2 + used
    flow = [a * u[0] - b * x[0], c * u[1] - e * x[1] - 0.5 * x[0] * x[1]]
    return flow, (x[0] - 0.4 * f) ** 2 + (x[1] - 0.5 * g) ** 2 + used


def state(d):
    m, x, u = model(d, f"on/off, {d['kind']}")
    flow, cost = rates(d, x, u)
    derive(d, m, flow)
    chosen = hasattr(m, "choice")
    if chosen:
        for j in range(len(u)):
            m.choice(j, [0, 1])
    return Statement(m, lagrange=cost, pairs=() if chosen else range(len(u)), options={"n_s": 3, "n_fe": 2})


def costs(d, u):
    """Costs of sequences of controls, an array (sequences, stages, controls); no library has a part in it."""
    h = d["horizon"] / d["stages"] / STEPS
    z = [np.full(len(u), value) for value in d["x0"]] + [np.zeros(len(u))]

    def right(z, k):
        flow, cost = rates(d, z[:-1], u[:, k].T)
        return [*flow, cost]

    def moved(z, by, s):
        return [a + s * b for a, b in zip(z, by)]

    for k in range(d["stages"]):
        for _ in range(STEPS):
            k1 = right(z, k)
            k2 = right(moved(z, k1, h / 2), k)
            k3 = right(moved(z, k2, h / 2), k)
            k4 = right(moved(z, k3, h), k)
            z = [a + h / 6 * (p + 2 * q + 2 * r + s) for a, p, q, r, s in zip(z, k1, k2, k3, k4)]
    return z[-1] * d["units"]["cost"]


def optimum(d):
    """The least cost of all sequences."""
    valves = len(d["units"]["u"])
    every = np.array(list(itertools.product((0.0, 1.0), repeat=d["stages"] * valves))).reshape(-1, d["stages"], valves)
    return float(costs(d, every).min())


def accept(d, run):
    return bool(np.all(np.isfinite(run.x_end)))
