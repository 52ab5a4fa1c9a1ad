"""Is the certificate of the control problem right? Random small problems, and descents on simulations from their answers.

usage: optima_random.py [--problems N] [--seed S] [--seconds S] [--json FILE]

A problem has two states, one control in bounds, one or two straight surfaces with a linear system on every side, a quadratic
running cost and a quadratic cost at the end, and three to five control stages. From every certified answer a descent on
event-driven simulations (`optima_peers.Descent`, which knows nothing of the certificate) looks for a lower cost. `gain` is what it
found, relative; certified answers should have none above 1e-6, the others may.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import optima_peers

import switchback_control as swb
from switchback_control import SwitchbackError, where
from switchback_control.expr import Model

#: Gains above this contradict a certificate.
NONE = 1e-6


def problem(seed: int) -> swb.Ocp:
    rng = np.random.default_rng(seed)
    m = Model(states="x y", controls="u")
    x, u = m.x, m.u[0]

    def linear() -> list[Any]:
        a, b = rng.normal(size=(2, 2)), rng.normal(size=2)
        c = rng.normal(size=2)
        return [a[i, 0] * x[0] + a[i, 1] * x[1] + b[i] + c[i] * u for i in range(2)]

    def surface() -> Any:
        n, d = rng.normal(size=2), 0.5 * rng.normal()
        return n[0] * x[0] + n[1] * x[1] + d

    fields = [linear() for _ in range(2)]
    psi = surface()
    m.derivatives = [where(psi > 0, fields[0][i], fields[1][i]) for i in range(2)]
    if rng.random() < 0.5:
        push, other = rng.normal(size=2), surface()
        m.derivatives = [d + where(other > 0, p, -p) for d, p in zip(m.derivatives, push)]
    n = int(rng.integers(3, 6))
    ocp = swb.Ocp(m, float(rng.uniform(1.0, 2.0)), n, initial_state=list(rng.normal(size=2)), control_bounds=(-2.0, 2.0))
    goal = rng.normal(size=2)
    ocp.set_lagrange(m.function([0.1 * u**2 + float(rng.uniform(0.0, 1.0)) * (x[0] ** 2 + x[1] ** 2)]))
    ocp.set_mayer(m.function([5.0 * ((x[0] - goal[0]) ** 2 + (x[1] - goal[1]) ** 2)]))
    return ocp


def one(seed: int, seconds: float) -> dict[str, Any]:
    found: dict[str, Any] = {"seed": seed, "gain": math.nan, "cost": math.nan, "simulated": math.nan}
    ocp = problem(seed)
    clock = time.perf_counter()
    try:
        r = ocp.solve()
    except SwitchbackError as e:
        return found | {"outcome": type(e).__name__, "certificate": "unknown", "seconds": time.perf_counter() - clock}
    found |= {"outcome": r.outcome.name.lower(), "certificate": str(r.certificate), "cost": r.cost}
    found |= {"iterations": r.stats.iterations, "seconds": time.perf_counter() - clock}
    if r.outcome.name != "SOLVED":
        return found
    descent = optima_peers.Descent(optima_peers.Statement(problem(seed)))
    z = descent.of_result(r)
    try:
        start = descent.run(z)
    except (FloatingPointError, SwitchbackError) as e:  # of such an answer nothing is known
        return found | {"note": str(e)}
    best = descent.minimise(z, seconds)
    found["simulated"] = start[0]
    found["gain"] = max(0.0, (start[0] - best[0]) / max(abs(start[0]), 1e-12)) if best else 0.0
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--problems", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=3.0, help="for one descent")
    parser.add_argument("--json")
    args = parser.parse_args()
    all_found = []
    for seed in range(args.seed, args.seed + args.problems):
        f = one(seed, args.seconds)
        all_found.append(f)
        print(
            f"{seed:5d} {f['outcome']:10s} {f['certificate']:14s} cost {f['cost']:14.8f} simulated {f['simulated']:14.8f}"
            f" gain {f['gain']:.1e} {f['seconds']:6.2f} s {f.get('note', '')}",
            flush=True,
        )
    certified = [f for f in all_found if f["certificate"] in ("local_optimum", "kink")]
    wrong = [f["seed"] for f in certified if f["gain"] > NONE]
    others = [f for f in all_found if f["certificate"] == "not_optimal"]
    shown = sum(f["gain"] > NONE for f in others)
    solved = sum(f["outcome"] == "solved" for f in all_found)
    print(
        f"{len(all_found)} problems: {solved} solved, {len(certified)} certified, of which descents bettered {len(wrong)} {wrong};"
        f" {len(others)} not optimal, of which descents bettered {shown}"
    )
    if args.json:
        Path(args.json).write_text(json.dumps(all_found, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
