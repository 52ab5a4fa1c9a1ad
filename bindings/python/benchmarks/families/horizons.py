"""Long horizons: one or two carts on dry friction whose controls may change many times."""

from . import friction
from .friction import accept, state
from .statement import pieces, pick, whole

__all__ = ["accept", "draw", "state"]


def draw(rng):
    d = friction.draw(rng)
    while len(d["masses"]) > 2:
        d = friction.draw(rng)
    stages = whole(rng, 60, 200) // len(d["masses"])
    most = 3.0 * sum(d["friction"])
    moves = int(pick(rng, 0.5, 0.7) * stages)
    rows = [pieces(rng, moves, -0.3 * most, 0.8 * most, stages // 6) + [0.0] * (stages - moves) for _ in d["drives"]]
    return d | {"stages": stages, "guess": [list(row) for row in zip(*rows)]}
