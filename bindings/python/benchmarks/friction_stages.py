"""Does the time of a solve grow no faster than the problem, its certificate included?

usage: friction_stages.py [--stages N ...] [--ways homotopy search] [--limit SECONDS] [--json FILE]

A mass with dry friction, q' = v, v' = u - 0.3 sign v, is moved by 1 within 4 s at the least cost of u^2, with ever more control
stages. `homotopy` starts from the guess alone, `search` is the default. Shown for each: processor seconds of the solve, of its
certificate (the difference to a solve without one), iterations, factorisations, and the exponent with which seconds grow between
the row above and this one.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from pathlib import Path
from typing import Any

import switchback_control as swb
from switchback_control import sign
from switchback_control.expr import Model


def problem(stages: int, way: str, certify: bool, limit: float) -> swb.Ocp:
    m = Model(states="q v", controls="u")
    (_, v), u = m.x, m.u[0]
    m.derivatives = [v, u - 0.3 * sign(v)]
    start = "homotopy" if way == "homotopy" else "portfolio"
    options = {"certify": "on" if certify else "off", "max_time": limit, "ocp_start": start}
    ocp = swb.Ocp(m, 4.0, stages, initial_state=[0, 0], control_bounds=(-2, 2), **options)
    ocp.set_lagrange(m.function([u * u]))
    ocp.add_terminal(m.function([m.x[0], v]), [1, 0], [1, 0])
    return ocp


def measure(stages: int, way: str, certify: bool, limit: float) -> dict[str, Any]:
    ocp = problem(stages, way, certify, limit)
    wall, cpu = time.perf_counter(), time.process_time()
    r = ocp.solve()
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    s = r.stats
    return {
        "stages": stages,
        "way": way,
        "certify": certify,
        "outcome": str(r.outcome),
        "cost": r.cost,
        "variables": s.n_variables,
        "iterations": s.iterations,
        "factorisations": s.factorisations,
        "evaluations": s.evaluations,
        "cpu": cpu,
        "wall": wall,
        "certificate": str(r.certificate),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--stages", type=int, nargs="+", default=[100, 500, 1000, 2000])
    parser.add_argument("--ways", nargs="+", default=["homotopy", "search"], choices=["homotopy", "search"])
    parser.add_argument("--limit", type=float, default=120.0, help="seconds for one solve")
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    rows = []
    print(f"{'way':10} {'stages':>6} {'outcome':>10} {'cost':>10} {'iter':>6} {'fact':>6} {'cpu s':>8} {'without':>8} {'share':>6} {'exp':>5}")
    for way in args.ways:
        before = None
        for stages in args.stages:
            with_it, without = (measure(stages, way, c, args.limit) for c in (True, False))
            row = {**with_it, "cpu_without_certificate": without["cpu"]}
            rows.append(row)
            share = 1 - without["cpu"] / row["cpu"]
            slope = math.log(row["cpu"] / before["cpu"]) / math.log(stages / before["stages"]) if before else math.nan
            print(
                f"{way:10} {stages:6} {row['outcome']:>10} {row['cost']:10.6f} {row['iterations']:6} "
                f"{row['factorisations']:6} {row['cpu']:8.2f} {without['cpu']:8.2f} {share:6.1%} {slope:5.2f}",
                flush=True,
            )
            before = row
    if args.json:
        args.json.write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
