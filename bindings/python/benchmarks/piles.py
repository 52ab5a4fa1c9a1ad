"""Piles that are dropped into narrow bins, drawn at random, and simulated from event to event until they rest.

Discs of several sizes fall between two walls and lock each other by friction: forces are not unique there, chains of bodies clamp each other, and many
contacts change at one time. How the runs end, what is left of the motion, and what energy they gained is printed; a pile that gains energy is wrong.

    python piles.py [--seed 1] [--draws 50] [--bodies 6] [--restitution 0] [--seconds 4] [--limit 60]
"""

from __future__ import annotations

import argparse
import collections
import time

import numpy as np
import switchback_control as swb


def drawn(rng: np.random.Generator, bodies: int, restitution: float) -> tuple[swb.World, float]:
    """A bin with discs above it, and its width."""
    width = rng.uniform(0.9, 1.6)
    w = swb.World(mu=rng.uniform(0.2, 0.7), e=restitution)
    w.floor(), w.wall(0.0), w.wall(width, free="left")
    for k in range(bodies):
        disc = w.disc(rng.uniform(0.15, 0.25), mass=rng.uniform(0.5, 2.0), name=f"{k}")
        w.place(disc, x=width * rng.uniform(0.3, 0.7), y=0.5 + 0.6 * k, angle=rng.uniform(-1, 1))
    return w, width


def energy(w: swb.World, x: np.ndarray) -> float:
    """Kinetic and potential energy of all discs."""
    q, v = (part.reshape(-1, 3) for part in np.split(x[: 2 * w.scene.n_q], 2))
    pairs = zip(w.bodies, q, v)
    return sum(b.mass * (9.81 * at[1] + 0.5 * rate[:2] @ rate[:2]) + 0.5 * b.inertia * rate[2] ** 2 for b, at, rate in pairs)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--draws", type=int, default=50)
    parser.add_argument("--bodies", type=int, default=6)
    parser.add_argument("--restitution", type=float, default=0.0)
    parser.add_argument("--seconds", type=float, default=4.0, help="simulated time of a run")
    parser.add_argument("--limit", type=float, default=60.0, help="seconds after which a run is stopped")
    a = parser.parse_args()
    outcomes: collections.Counter[str] = collections.Counter()
    gained, took = 0, []
    for seed in range(a.seed, a.seed + a.draws):
        w, width = drawn(np.random.default_rng(seed), a.bodies, a.restitution)
        start = np.concatenate(w.start())
        begin = time.perf_counter()
        with swb.Integrator(w.scene.system(), rtol=1e-6, atol=1e-8) as i:
            i.reinit(start)
            ended = True
            while ended and i.time < a.seconds:
                i.step(a.seconds)
                if str(i.outcome) != "reached":
                    break
                ended = time.perf_counter() - begin < a.limit
            x, t = np.array(i.state), i.time
            word = str(i.outcome) if ended else "stopped"
            reason, count = i.reason, i.stats
        took.append(time.perf_counter() - begin)
        speed = np.abs(x[w.scene.n_q :]).max()
        rests = word == "reached" and speed < 1e-6
        outcomes["at rest" if rests else "moves" if word == "reached" else word] += 1
        more = energy(w, x) > energy(w, start) * (1 + 1e-5)
        gained += more
        if not rests or more:
            print(f"seed {seed}: width {width:.3f}, {word} at t = {t:.4f}, speed {speed:.1e}, {count.impacts} impacts{', energy gained' if more else ''} {reason}")
    print(f"{a.bodies} discs, restitution {a.restitution}: {dict(outcomes)}, energy gained {gained}, median {np.median(took):.2f} s, longest {max(took):.1f} s")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
