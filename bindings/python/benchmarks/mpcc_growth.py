"""How does the time of an iteration grow with a program that is banded along time?

usage: mpcc_growth.py [--sizes N ...] [--problems NAME ...] [--limit SECONDS] [--json FILE]

Sizes are numbers of variables, roughly. `pendulum` swings a pendulum up by the implicit midpoint rule (no pairs); `friction` moves a
mass with dry friction by time stepping (two pairs a step); `relay` is a pendulum with dry friction in its joint, which is pushed
(nonlinear, two pairs a step). Every program is solved twice, and the second solve counts. Shown for an iteration, the certificate left out: processor milliseconds in all, in functions, in linear algebra
and elsewhere, factorisations, solutions and steps of refinement for each of them; then the exponents with which times grow, by least
squares in logarithms.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from pathlib import Path
from typing import Any, Callable

import numpy as np

import switchback_control as swb
from switchback_control.expr import sin

#: Length of the horizon.
HORIZON = 4.0


def pendulum(n: int, options: dict[str, Any]) -> swb.Mpcc:
    """Angle, speed, torque in every step."""
    steps = max(n // 3, 2)
    h = HORIZON / steps
    q, w, u = (np.arange(steps) + k * steps for k in range(3))

    def rows(x: Any) -> list[Any]:
        out = []
        for k in range(steps):
            q0, w0 = (x[q[k - 1]], x[w[k - 1]]) if k else (0.0, 0.0)
            out.append(x[q[k]] - q0 - 0.5 * h * (x[w[k]] + w0))
            out.append(x[w[k]] - w0 - h * (x[u[k]] - sin(0.5 * (x[q[k]] + q0))))
        return [*out, x[q[-1]] - math.pi, x[w[-1]]]

    return swb.Mpcc(
        3 * steps,
        lambda x: sum(h * x[j] * x[j] for j in u),
        rows,
        n_constraints=2 * steps + 2,
        constraint_bounds=(0.0, 0.0),
        bounds=(np.repeat([-10.0, -10.0, -2.0], steps), np.repeat([10.0, 10.0, 2.0], steps)),
        start=np.concatenate([np.linspace(0, math.pi, steps), np.zeros(2 * steps)]),
        settings=options,
    )


def stick_slip(n: int, options: dict[str, Any], swings: bool) -> swb.Mpcc:
    """Position, speed, control, the share of the friction that acts forwards, what is left of it, speed forwards and backwards."""
    steps = max(n // 7, 2)
    h = HORIZON / steps
    q, v, u, a, b, forwards, backwards = (np.arange(steps) + k * steps for k in range(7))

    def rows(x: Any) -> list[Any]:
        out = []
        for k in range(steps):
            q0, v0 = (x[q[k - 1]], x[v[k - 1]]) if k else (0.0, 0.0)
            pull = 2 * sin(q0) if swings else 0.0
            out.append(x[q[k]] - q0 - h * x[v[k]])
            out.append(x[v[k]] - v0 - h * (x[u[k]] - pull - 0.3 * (x[a[k]] - x[b[k]])))
            out.append(x[a[k]] + x[b[k]] - 1.0)
            out.append(x[v[k]] - x[forwards[k]] + x[backwards[k]])
        return [*out, x[q[-1]] - 1.0, x[v[-1]]]

    free, positive = [-10.0, -10.0, -5.0], [0.0] * 4
    return swb.Mpcc(
        7 * steps,
        lambda x: sum(h * x[j] * x[j] for j in u),
        rows,
        n_constraints=4 * steps + 2,
        constraint_bounds=(0.0, 0.0),
        pairs=[(int(j), int(k)) for j, k in [*zip(b, forwards), *zip(a, backwards)]],
        bounds=(np.repeat([*free, *positive], steps), np.repeat([10.0, 10.0, 5.0] + [np.inf] * 4, steps)),
        start=np.concatenate([np.linspace(0, 1, steps), np.zeros(2 * steps), np.full(2 * steps, 0.5), np.zeros(2 * steps)]),
        settings=options,
    )


PROBLEMS: dict[str, Callable[[int, dict[str, Any]], swb.Mpcc]] = {
    "pendulum": pendulum,
    "friction": lambda n, options: stick_slip(n, options, False),
    "relay": lambda n, options: stick_slip(n, options, True),
}


def measure(name: str, size: int, limit: float) -> dict[str, Any]:
    with PROBLEMS[name](size, {"certify": "off", "portfolio": "off", "max_time": limit}) as program:
        first = program.solve().linear_stats
        clock = time.thread_time()
        r = program.solve()
        cpu = time.thread_time() - clock
    s, l = r.stats, r.linear_stats
    its = max(s.iterations, 1)
    # parts are measured by the clock on the wall; on a machine with other work only their shares count
    share = cpu / max(s.time_total, 1e-9)
    solves, refined = l.solves - first.solves, l.refinement_steps - first.refinement_steps
    return {
        "problem": name,
        "n": s.n_variables,
        "m": s.n_constraints,
        "order": l.n,
        "nnz_l": l.nnz_l,
        "outcome": str(r.outcome),
        "polished": str(r.polished),
        "iterations": s.iterations,
        "ms": 1e3 * cpu / its,
        "ms_functions": 1e3 * share * s.time_eval / its,
        "ms_linear_algebra": 1e3 * share * s.time_linalg / its,
        "ms_other": 1e3 * share * (s.time_total - s.time_eval - s.time_linalg) / its,
        "factorisations": s.factorisations / its,
        "solves": solves / its,
        "refinement": refined / max(solves, 1),
        "equilibrations": (l.equilibrations - first.equilibrations) / its,
        "delta_w": s.max_delta_w,
    }


HEAD = (
    f"{'program':<9} {'n':>6} {'its':>5} {'all':>8} {'func':>7} {'linalg':>7} {'other':>7} {'fact':>5} {'solve':>5} "
    f"{'refine':>6} {'nnz(L)/n':>8}  outcome"
)


def line(r: dict[str, Any]) -> str:
    return (
        f"{r['problem']:<9} {r['n']:6} {r['iterations']:5} {r['ms']:8.3f} {r['ms_functions']:7.3f} "
        f"{r['ms_linear_algebra']:7.3f} {r['ms_other']:7.3f} {r['factorisations']:5.2f} {r['solves']:5.2f} "
        f"{r['refinement']:6.2f} {r['nnz_l'] / r['n']:8.1f}  {r['outcome']}"
    )


def table(rows: list[dict[str, Any]]) -> str:
    return "\n".join([HEAD, *map(line, rows)])


def exponent(rows: list[dict[str, Any]], key: str) -> float:
    n, t = (np.log([max(r[k], 1e-9) for r in rows]) for k in ("n", key))
    return float(np.polyfit(n, t, 1)[0])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", type=int, nargs="+", default=[100, 200, 500, 1000, 2000, 5000, 10000, 20000])
    parser.add_argument("--problems", nargs="+", default=list(PROBLEMS), choices=list(PROBLEMS))
    parser.add_argument("--limit", type=float, default=120.0, help="seconds for one solve")
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    everything = []
    print(HEAD)
    for name in args.problems:
        rows = []
        for size in args.sizes:
            r = measure(name, size, args.limit)
            rows.append(r)
            print(line(r), flush=True)
        if len(rows) > 1:
            keys = ("ms", "ms_functions", "ms_linear_algebra", "ms_other")
            print("exponents: " + ", ".join(f"{k} {exponent(rows, k):.2f}" for k in keys))
        everything += rows
    if args.json:
        args.json.write_text(json.dumps(everything, indent=1) + "\n")


if __name__ == "__main__":
    main()
