"""Programs with complementarity pairs from other starting points.

usage: mpcc_starts.py [--count N] [--starts K] [options of mpcc_train.py]

N problems spread evenly over the set, by default 20, each from K starting points, by default 10: every number of the given
start is moved by a tenth of 1 + its size times a normal random number, inside its bounds. Solved means what it means for
`mpcc_train.py`. Asked: 195 of 200.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import mpcc_compare
import mpcc_train
from mpcc_problems import Problem


class Starts(mpcc_train.Changed):
    """Problems from other starts."""

    def changed(self, path: Path, change: int) -> Problem:
        return Problem(self.code, path, change)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    mpcc_train.add_arguments(parser)
    parser.add_argument("--count", type=int, default=20, metavar="N", help="problems")
    parser.add_argument("--starts", type=int, default=10, metavar="K", help="of every problem")
    parser.set_defaults(ipopt=False)
    arguments = parser.parse_args()
    problems = mpcc_train.chosen(arguments)
    if problems is None:
        return 0
    every = list(problems)
    count = min(arguments.count, len(every))
    names = [every[k * len(every) // count] for k in range(count)]
    found = mpcc_train.run_changed(Starts, arguments, {n: problems[n] for n in names}, arguments.starts)
    solved = total = 0
    for name, (own, *others) in found.items():
        total += len(others)
        solved += sum(r["solved"] for r in others)
        values = [r["objective"] for r in (own, *others) if r["solved"] and r["outcome"] == "solved"]
        least = min(values, default=0.0)
        alike = sum(abs(mpcc_compare.distance(v, least)) <= 1e-3 for v in values)
        missed = ", ".join(f"{k}: {r['outcome']}" for k, r in enumerate(others, 1) if not r["solved"])
        print(f"{name}: {sum(r['solved'] for r in others)} of {len(others)}, {alike} of {len(values)} as good as the best {missed}")
    print(f"solved {solved} of {total}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
