"""Programs with complementarity pairs in other units: objective, rows, members of pairs and variables multiplied by numbers.

usage: mpcc_units.py [--changes N] [--exponent K] [--only-what objective|rows|members|variables] [options of mpcc_train.py]

Every problem is solved as it is and N times with its objective, every row and every member of a pair multiplied by
2^k, each with a k of its own between -K and K; with `--only-what variables` every variable is multiplied by 10^k, K being 3
by default, which is not done beside the others. Nothing about the problem has changed, so the optimum is to be the same,
and the iterations as many. Members that are variables are given as rows (`--members rows`), so that they can be
multiplied. Asked: the same optimum (within 1e-5 max(1, |f|)) in at least 99 % of the changes, iterations within 10 %
in geometric mean.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

import mpcc_compare
import mpcc_train
from mpcc_problems import Problem

WHAT = ("objective", "rows", "members")
VARIABLES = "variables"
EXPONENT = {2.0: 20, 10.0: 3}  # the largest by default


def units(problem: Problem, seed: int, exponent: int, what: tuple[str, ...]) -> np.ndarray:
    """[1 + rows] powers of two; seed 0 is none."""
    k = np.random.default_rng(seed).integers(-exponent, exponent + 1, 1 + problem.rows) if seed else 0
    changed = np.repeat([w in what for w in WHAT], [1, problem.m, 2 * problem.c])
    return np.where(changed, 2.0**k, 1.0)


class Units(mpcc_train.Changed):
    """Problems in other units."""

    def __init__(self, arguments: argparse.Namespace, folder: Path):
        super().__init__(arguments, folder)
        self.what = tuple(arguments.only_what or WHAT)
        base = 10.0 if VARIABLES in self.what else 2.0
        self.exponent = EXPONENT[base] if arguments.exponent is None else arguments.exponent

    def changed(self, path: Path, change: int) -> Problem:
        problem = Problem(self.code, path)
        problem.units = units(problem, change, self.exponent, self.what)
        if VARIABLES in self.what:
            k = np.random.default_rng(change).integers(-self.exponent, self.exponent + 1, problem.n) if change else 0
            problem.sizes = np.full(problem.n, 10.0) ** k
        return problem


def same(a: dict, b: dict) -> bool:
    """Do two results say the same?"""
    if not (a["solved"] and b["solved"]):
        return a["solved"] == b["solved"]
    if a["outcome"] != "solved":
        return a["outcome"] == b["outcome"]
    return abs(mpcc_compare.distance(a["objective"], b["objective"])) <= mpcc_compare.RELATIVE


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    mpcc_train.add_arguments(parser)
    parser.add_argument("--changes", type=int, default=2, metavar="N", help="of every problem")
    parser.add_argument("--exponent", type=int, metavar="K", help="largest power of two (20), or of ten for variables (3)")
    parser.add_argument("--only-what", action="append", choices=(*WHAT, VARIABLES), help="multiply only these")
    parser.set_defaults(members="rows", ipopt=False)
    arguments = parser.parse_args()
    problems = mpcc_train.chosen(arguments)
    if problems is None:
        return 0
    if not problems or arguments.changes < 1:
        print(f"nothing to compare: {len(problems)} problems of {arguments.set_of} match '{arguments.only}', {arguments.changes} changes each")
        return 1
    found = mpcc_train.run_changed(Units, arguments, problems, arguments.changes)
    agree, ratios, total = 0, [], 0
    for name, (own, *others) in found.items():
        for other in others:
            total += 1
            agree += same(own, other)
            ratios.append(max(other["iterations"], 1) / max(own["iterations"], 1))
            if not same(own, other):
                print(
                    f"{name}: {own['outcome']} {own['objective']} in {own['iterations']} iterations, "
                    f"{other['outcome']} {other['objective']} in {other['iterations']}"
                )
    mean = mpcc_compare.geometric_mean(ratios)
    print(f"{agree} of {total} the same ({agree / total:.1%}), iterations {mpcc_compare.number(mean, '.3f')}")
    print(f"solved as they are: {sum(r[0]['solved'] for r in found.values())} of {len(found)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
