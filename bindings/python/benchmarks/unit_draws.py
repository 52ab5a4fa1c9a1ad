"""Systems of many units that switch, drawn freshly: two builds of the library are compared on the same ones.

usage: unit_draws.py --measure FILE.json [--count 100] [--seed S] [--most 64]
       unit_draws.py --compare BASE.json NEW.json

Units are rooms with ideal thermostats, rooms with hysteresis, neurons, or blocks with dry friction on springs. They stand in a row, in a ring, or anywhere in
a graph with a few neighbours each; number, rates, coupling and tolerance are drawn. Without a seed the systems are new at every use; the seed is
stored, and gives the same ones again.

`--measure` simulates each one with the library that is loaded. Work is evaluations of single velocities (evaluations times states). Errors are the largest ones of
the times of switches, against steps that end at every switch at a tolerance of 1e-10, relative to the tolerance and the whole time. `--compare` prints ratios of work, of CPU
time and of errors, new to base, as geometric means with the interval of 95 % of a bootstrap, and the sign test of the work, by kind.
"""

from __future__ import annotations

import argparse
import json
import math
import random
import secrets
import time
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import switchback_control as swb
from paired import geometric, sign_test
from switchback_control.expr import Model, sign, sin

KINDS = ("relays", "hystereses", "neurons", "blocks")
#: Tolerance of the reference.
SHARP = 1e-10
#: Errors below this are rounding of the reference.
ROUNDING = 1e-9
#: Switches after which a run ends at the latest, from the rate of the first part of it.
SWITCHES = 600


def edges(rng: random.Random, n: int) -> list[list[int]]:
    """Of every unit its neighbours: each is one of the other, too."""
    kind = rng.choice(["row", "ring", "graph"])
    if kind == "row":
        pairs = {(i, i + 1) for i in range(n - 1)}
    elif kind == "ring":
        pairs = {tuple(sorted((i, (i + 1) % n))) for i in range(n)}
    else:
        degree = rng.randint(1, 4)
        pairs = {tuple(sorted(rng.sample(range(n), 2))) for _ in range(n * degree // 2)}
    out: list[list[int]] = [[] for _ in range(n)]
    for i, j in sorted(pairs):
        out[i].append(j)
        out[j].append(i)
    return out


def log_uniform(rng: random.Random, low: float, high: float) -> float:
    """A number whose logarithm is uniform."""
    return math.exp(rng.uniform(math.log(low), math.log(high)))


def drawn(seed: int, most: int) -> tuple[str, Model, list[float], float, float]:
    """Kind, model, initial state, end, tolerance."""
    rng = random.Random(seed)
    kind, n = rng.choice(KINDS), round(log_uniform(rng, 8, most))
    near, coupling = edges(rng, n), log_uniform(rng, 0.01, 5)
    rtol = log_uniform(rng, 1e-8, 1e-3)

    def jitter(i: int) -> float:
        return 1 + 0.3 * random.Random(seed * 1000003 + i).uniform(-1, 1)

    def flows(x: Any, i: int) -> Any:
        return sum((x[j] - x[i] for j in near[i]), 0.0)

    if kind == "blocks":
        m = Model(2 * n)
        x, v = [m.x[2 * i] for i in range(n)], [m.x[2 * i + 1] for i in range(n)]
        speed, rates = log_uniform(rng, 0.05, 1), []
        for i in range(n):
            slip = v[i] - speed
            rates += [v[i], coupling * flows(x, i) - jitter(i) * x[i] - 0.1 * v[i] - jitter(n + i) * sign(slip)]
        m.derivatives = rates
        start = [rng.uniform(-1, 1) if k % 2 == 0 else 0.0 for k in range(2 * n)]
        return kind, m, start, 6.0, rtol
    m = Model(n)
    if kind == "neurons":
        v, kick = m.x, log_uniform(rng, 1e-3, 0.1)
        leak = log_uniform(rng, 0.01, 1) if rng.random() < 0.5 else 0.0
        m.derivatives = [(1.1 * jitter(i) + 0.4 - v[i]) * jitter(n + i) + leak * flows(v, i) for i in range(n)]
        for i in range(n):
            m.transition(v[i] > 1, reset={v[i]: v[i] - 1, **{v[j]: v[j] + kick * rng.uniform(-1, 1) for j in near[i]}})
        return kind, m, [rng.random() for _ in range(n)], 6.0, rtol
    x, outside = m.x, 8 + 10 * sin(1.3 * m.t)
    levels = [19 + 2 * rng.random() for _ in range(n)]
    if kind == "relays":
        heat = [20 * jitter(2 * n + i) * (1 - sign(x[i] - levels[i])) for i in range(n)]
    else:
        width = log_uniform(rng, 0.05, 1)
        on = [m.discrete(f"heater {i}") for i in range(n)]
        heat = [25 * jitter(2 * n + i) * on[i] for i in range(n)]
        for i in range(n):
            m.transition(levels[i] - x[i] > width, when={on[i]: 0}, to={on[i]: 1})
            m.transition(x[i] - levels[i] > width, when={on[i]: 1}, to={on[i]: 0})
    m.derivatives = [jitter(i) * (outside - x[i]) + coupling * flows(x, i) + heat[i] for i in range(n)]
    return kind, m, [levels[i] + rng.uniform(-2, 2) for i in range(n)] + [0.0] * (n if kind == "hystereses" else 0), 4.0, rtol


def times(integrator: swb.Integrator) -> dict[str, list[float]]:
    """Of every source the times at which it switches."""
    run, out = integrator.run, defaultdict(list)
    for s in run.switches:
        out[f"surface {s.subsystem}"].append(s.t)
    for j in run.jumps:
        out[f"transition {j.transition}"].append(j.t)
    return out


def difference(a: dict[str, list[float]], b: dict[str, list[float]]) -> float:
    """The largest one of the times; infinite where a source has more or fewer of them."""
    if any(len(a.get(k, [])) != len(b.get(k, [])) for k in {*a, *b}):
        return math.inf
    return max((abs(x - y) for k, own in b.items() for x, y in zip(a[k], own)), default=0.0)


def measured(seed: int, most: int) -> dict[str, Any]:
    """One system."""
    kind, model, start, end, rtol = drawn(seed, most)
    integrator = swb.Integrator(model, rtol=rtol, atol=0.1 * rtol)
    integrator.reinit(start)
    integrator.advance(0.1 * end)
    rate = 10 * (integrator.stats.switches + integrator.stats.jumps)
    end *= min(1.0, SWITCHES / max(rate, 1))
    seconds = math.inf
    for _ in range(3):
        integrator.reinit(start)
        clock = time.process_time()
        outcome = integrator.advance(end)
        seconds = min(seconds, time.process_time() - clock)
    stats, own = integrator.stats, times(integrator)
    sharp = swb.Integrator(model, rtol=SHARP, atol=0.1 * SHARP, max_steps=200_000)
    sharp.reinit(start)
    while sharp.step(end) != swb.ProgressKind.DONE:
        pass
    return {
        "seed": seed,
        "kind": kind,
        "states": len(start),
        "rtol": rtol,
        "outcome": outcome.name,
        "switches": stats.switches + stats.jumps,
        "steps": stats.steps,
        "work": stats.evaluations * len(start),
        "seconds": seconds,
        "error": difference(own, times(sharp)) / (rtol * end),
    }


def compare(base: list[dict[str, Any]], new: list[dict[str, Any]]) -> Iterator[str]:
    """Lines of a table."""
    known = {r["seed"]: r for r in base}
    pairs = [(known[r["seed"]], r) for r in new if r["seed"] in known]
    yield f"{'kind':12} {'n':>4} {'work':>6} {'95 %':>13} {'less':>5} {'more':>5} {'p':>7} {'time':>6} {'error':>6} {'95 %':>13} {'lost':>9}"
    for kind in (*KINDS, "all"):
        own = [(a, b) for a, b in pairs if kind in (a["kind"], "all") and a["switches"] > 0]
        if not own:
            continue
        work = [b["work"] / a["work"] for a, b in own]
        less, more = sum(r < 0.98 for r in work), sum(r > 1.02 for r in work)
        floor = {r["seed"]: ROUNDING / r["rtol"] for r, _ in own}
        both = [(a, b) for a, b in own if math.isfinite(a["error"]) and math.isfinite(b["error"])]
        errors = [max(b["error"], floor[a["seed"]]) / max(a["error"], floor[a["seed"]]) for a, b in both]
        lost = [sum(not math.isfinite(r["error"]) for r in arm) for arm in zip(*own)]
        w, e, t = geometric(work), geometric(errors), geometric([b["seconds"] / a["seconds"] for a, b in own])
        yield (
            f"{kind:12} {len(own):4} {w[0]:6.3f} {w[1]:6.3f}-{w[2]:6.3f} {less:5} {more:5} {sign_test(less, more):7.4f} {t[0]:6.3f}"
            f" {e[0]:6.2f} {e[1]:6.2f}-{e[2]:6.2f} {lost[0]:4}-{lost[1]:4}"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--measure", type=Path, help="where to store what is measured")
    parser.add_argument("--compare", type=Path, nargs=2, help="what was measured with both builds")
    parser.add_argument("--count", type=int, default=100, help="systems")
    parser.add_argument("--seed", type=int, help="of the first system")
    parser.add_argument("--most", type=int, default=64, help="units at most")
    arguments = parser.parse_args()
    if arguments.measure:
        first = secrets.randbelow(10**9) if arguments.seed is None else arguments.seed
        records = [measured(first + k, arguments.most) for k in range(arguments.count)]
        arguments.measure.write_text(json.dumps(records, indent=0))
        print(f"seed {first}: {len(records)} systems, {sum(r['switches'] for r in records)} switches")
    if arguments.compare:
        base, new = (json.loads(p.read_text()) for p in arguments.compare)
        print("\n".join(compare(base, new)))


if __name__ == "__main__":
    main()
