"""Carts in a row, joined by springs, on dry friction: from rest to rest at another place."""

from .statement import Statement, around, decades, derive, mechanical, model, pick, pieces, running, timed, whole
from switchback_control import sign


def draw(rng):
    n = pick(rng, 1, 1, 1, 2, 2, 3, 4)
    drives = [0] if n == 1 or rng.random() < 0.7 else [0, n - 1]
    d = {
        "masses": [around(rng, 1.0, 2.5) for _ in range(n)], "friction": [decades(rng, 0.1, 0.8) for _ in range(n)],
        "springs": [decades(rng, 0.5, 5.0) for _ in range(n - 1)], "drag": pick(rng, 0.0, 0.1, 0.4), "drives": drives,
        "stages": whole(rng, 6, 8 + 8 // n), "horizon": float(rng.uniform(3.0, 7.0)), "x0": [0.0] * (2 * n),
        "units": mechanical(rng, n, len(drives)), "ends": pick(rng, "all", "last"),
    }  # fmt: skip
    most = 3.0 * sum(d["friction"])
    moves = max(2, int(0.6 * d["stages"]))
    rows = [pieces(rng, moves, -0.3 * most, 0.8 * most) + [0.0] * (d["stages"] - moves) for _ in drives]
    d |= {"guess": [list(row) for row in zip(*rows)], "bounds": [[-most] * len(drives), [most] * len(drives)]}
    timed(rng, d, ("energy", "energy", "time", "fuel"))
    return d


def state(d):
    n, k, drag = len(d["masses"]), d["springs"], d["drag"]
    m, x, u = model(d, "friction")
    q, v = x[:n], x[n:]
    rates = []
    for i in range(n):
        force = -drag * v[i] - d["friction"][i] * sign(v[i])
        if i in d["drives"]:
            force = force + u[d["drives"].index(i)]
        if i > 0:
            force = force - k[i - 1] * (q[i] - q[i - 1])
        if i < n - 1:
            force = force + k[i] * (q[i + 1] - q[i])
        rates.append(force / d["masses"][i])
    derive(d, m, [*v, *rates])
    goal = list(range(2 * n)) if d["ends"] == "all" else [n - 1, 2 * n - 1]
    return Statement(
        m, lagrange=running(d, u, max(d["bounds"][1])), goal=[m.x[i] for i in goal], goal_sizes=[d["units"]["x"][i] for i in goal],
        options={"n_s": 3, "n_fe": 3},
    )  # fmt: skip


def accept(d, run):
    """Every cart has moved and is at rest."""
    n = len(d["masses"])
    end = run.x_end / d["units"]["x"]
    return min(abs(end[:n])) > 0.05 and max(abs(end[:n])) < 20 and max(abs(end[n:])) < 1e-9
