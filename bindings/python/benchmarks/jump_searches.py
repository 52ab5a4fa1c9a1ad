"""Every search for the order of contacts on the gallery of scenes in optimal control, each from five guesses of the controls.

    python jump_searches.py [--only TEXT] [--searches NAMES] [--starts N] [--max-time SECONDS] [--json FILE]
    python jump_searches.py --table FILE

The first guess is none, the others are controls at random within 30 % of their bounds; nothing is known of contacts. Answers are solutions of
their contact mode programs, followed by an event-driven simulation. `--json` adds a line for every solve to a file and leaves out solves that are
in it; `--table` makes the tables of such a file. Seconds are CPU seconds; the limit is on the clock.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[3] / "examples" / "python"))
import jump_gallery

SEARCHES = ["auto", "modes", "steps", "shots", "fesd_j", "freezing"]
SHARE = 0.3
# Share by which a cost may be above the least that any search has found and is not dear.
SAME = 1e-3


def solve(problem, search, start, seconds):
    """One solve, as a record."""
    how = {} if search == "auto" else {"jumps": search}
    _, ocp = problem(max_time=seconds, **how)
    if start:
        ocp.set_control_guess(SHARE * ocp.random_starts(1 + start)[start])
    record = {"problem": problem.__name__, "search": search, "start": start}
    clock = time.process_time()
    try:
        r = ocp.solve()
    except Exception as error:  # a limit that ends before anything is found, say, is a result too
        return record | {"outcome": type(error).__name__, "cpu_s": time.process_time() - clock}
    return record | {
        "outcome": r.outcome.name.lower(),
        "cost": r.cost_reached if r.success else None,
        "replay": r.accuracy.terminal if r.success and r.accuracy else None,
        "verdict": str(r.optimality.verdict) if r.success and r.optimality else None,
        "impacts": len(r.contacts.impacts) if r.contacts else 0,
        "iterations": r.stats.iterations,
        "cpu_s": round(time.process_time() - clock, 3),
    }


def tables(records):
    """By problem and search, and by search."""
    least = {}
    for r in records:
        if r.get("cost") is not None:
            least[r["problem"]] = min(least.get(r["problem"], np.inf), r["cost"])
    lines = ["| problem | search | solved | least cost | largest | worst replay | iterations | CPU s |", "|---|---|---|---|---|---|---|---|"]
    sums = {s: [0, 0, 0, 0, 0, 0.0] for s in SEARCHES}
    for problem in dict.fromkeys(r["problem"] for r in records):
        for search in SEARCHES:
            of = [r for r in records if (r["problem"], r["search"]) == (problem, search)]
            if not of:
                continue
            costs = [r["cost"] for r in of if r.get("cost") is not None]
            replays = [r["replay"] for r in of if r.get("replay") is not None]
            iterations = statistics.median(r.get("iterations", 0) for r in of)
            seconds = statistics.median(r["cpu_s"] for r in of)
            span = f"{min(costs):.9g} | {max(costs):.9g}" if costs else "– | –"
            worst = f"{max(replays):.0e}" if replays else "–"
            lines.append(
                f"| {problem} | `{search}` | {len(costs)} of {len(of)} | {span} | {worst} | {iterations:.0f} | {seconds:.2f} |"
            )
            best = least.get(problem, np.inf)
            cheap = sum(c <= best + SAME * abs(best) for c in costs)
            parts = len(of), len(costs), cheap, len(costs) == len(of), sum(r.get("iterations", 0) for r in of)
            sums[search] = [a + b for a, b in zip(sums[search], (*parts, sum(r["cpu_s"] for r in of)))]
    lines += ["", "| search | solved | within 0.1 % of the least cost of the problem | problems solved from every start | iterations | CPU s |"]
    lines.append("|---|---|---|---|---|---|")
    for search, (n, solved, cheap, every, iterations, seconds) in sums.items():
        if n:
            lines.append(f"| `{search}` | {solved} of {n} | {cheap} | {every} | {iterations} | {seconds:.0f} |")
    return "\n".join(lines)


def main():
    arguments = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    arguments.add_argument("--only", default="")
    arguments.add_argument("--searches", default=",".join(SEARCHES))
    arguments.add_argument("--starts", type=int, default=5)
    arguments.add_argument("--max-time", type=float, default=20.0)
    arguments.add_argument("--json", type=Path)
    arguments.add_argument("--table", type=Path)
    given = arguments.parse_args()
    file = given.table or given.json
    records = [json.loads(line) for line in file.read_text().splitlines()] if file and file.exists() else []
    if not given.table:
        known = {(r["problem"], r["search"], r["start"]) for r in records}
        problems = [p for p in jump_gallery.PROBLEMS if not given.only or p.__name__ in given.only.split(",")]
        for problem in problems:
            for search in given.searches.split(","):
                for start in range(given.starts):
                    if (problem.__name__, search, start) in known:
                        continue
                    records.append(solve(problem, search, start, given.max_time))
                    if given.json:
                        with given.json.open("a") as to:
                            to.write(json.dumps(records[-1]) + "\n")
    print(tables(records))


if __name__ == "__main__":
    main()
