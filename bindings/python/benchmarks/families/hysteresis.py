"""Systems that remember on which side of two thresholds they came: rooms, gates, drives, tanks, two relays."""

from .statement import Statement, around, derive, model, pick, pieces, plain, whole

RANGES = {"room": (0.0, 1.0), "gate": (-1.0, 3.0), "turbo": (-1.5, 2.0), "tanks": (0.0, 1.0), "relays": (-1.0, 1.0), "battery": (-1.0, 2.0)}


def draw(rng):
    kind, stages = pick(rng, *RANGES), whole(rng, 8, 16)
    low, high = RANGES[kind]
    d = {
        "kind": kind, "stages": stages, "factors": [around(rng, 1.0, 1.4) for _ in range(6)], "units": plain(rng, 2, 1), "bounds": [[low], [high]],
        "weight": pick(rng, 0.0, 0.05, 0.3), "room": pick(rng, 0.0, 0.02, 0.05),
        "x0": {"room": [2.0, 1.0], "tanks": [0.5, 0.5], "relays": [-0.5, 0.0], "battery": [0.0, 0.5]}.get(kind, [0.0, 0.0]),
        "horizon": float(rng.uniform(3.0, 5.0)) * (1.6 if kind in ("room", "tanks") else 1.0),
    }  # fmt: skip
    d["guess"] = [[u] for u in pieces(rng, stages, low, high)]
    if rng.random() < 0.25:
        d["free"] = {"what": "horizon", "bounds": [0.5 * d["horizon"], 1.6 * d["horizon"]]}
    return d


def state(d):
    a, b, c, e, f, g = d["factors"]
    m, (x, y), (u,) = model(d, f"hysteresis, {d['kind']}")
    relays = []

    def relay(value, on, off):
        """Beyond `on` it is on, until it is below `off`."""
        relays.append(m.hysteresis(value, on=on, off=off, name=f"relay{len(relays)}"))
        return relays[-1]

    goal = [0, 1]
    if d["kind"] == "room":
        heats = relay(-x, -1.8 * a, -2.1 * a)
        rates = [-0.3 * b * (x - y) + 0.4 * c * heats + 0.6 * u, 0.2 * (x - y) - 0.1 * e * y]
        cost, goal = u**2 + 0.3 * heats + d["weight"] * (x - 2) ** 2, [0]
    elif d["kind"] == "gate":
        holds = relay(x, 0.6 * a, 0.3 * a * min(b, 1.0))
        rates = [y, u - 0.3 * c * y - 1.5 * e * holds]
        cost = u**2 + d["weight"] * holds
    elif d["kind"] == "turbo":
        boost = relay(y, 1.5 * a, 0.8 * a)
        rates = [y, (1 + 1.5 * b * boost) * u - 0.2 * c * y]
        cost = u**2 + d["weight"] * boost
    elif d["kind"] == "tanks":
        pump = relay(y, 0.8 * a, 0.4 * a)
        rates = [u - 0.4 * b * x, 0.4 * b * x - 0.5 * c * pump]
        cost = u**2 + d["weight"] * (y - 0.9) ** 2
    elif d["kind"] == "relays":
        first, second = relay(x, 0.5 * a, -0.2 * a), relay(y, 0.4 * b, -0.1 * b)
        rates = [y - 0.5 * c * first + u, -x + 0.8 * e * second - 0.3 * f * y]
        cost = u**2 + d["weight"] * (x**2 + y**2)
    else:
        fan = relay(y, 1.0 * a, 0.6 * a)
        rates = [u, 0.5 * b * u**2 - (0.2 * c + 0.8 * e * fan) * y]
        cost, goal = 0.1 * u**2 + 0.4 * fan + 0.2 * g * y, [0]
    derive(d, m, [*rates])
    if d.get("free"):
        cost = cost + 0.2
    return Statement(
        m, lagrange=cost, goal=[m.x[i] for i in goal], goal_sizes=[d["units"]["x"][i] for i in goal], options={"n_s": 3, "n_fe": 2}
    )


def accept(d, run):
    """At least one relay switches, and not many times."""
    return 0 < len(run.jumps) <= 8 and max(abs(run.x_end[:2] / d["units"]["x"])) > 0.1
