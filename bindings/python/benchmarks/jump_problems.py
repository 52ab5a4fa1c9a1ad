"""What benchmarks of dear answers of scenes share: sets of scenes with figures drawn from a seed, their table of best known costs, one run of all
of them, and the searches for better ones."""

import argparse
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import switchback_control as swb

PIECE = 4


@dataclass
class Problems:
    """Scenes with figures of their own, how many sets of them, the table of the best known costs, and the random guesses that look for better ones."""

    scenes: list
    variants: int
    table: Path
    guesses: int

    def variant(self, scene, number, **options):
        """A scene with the figures of a number: those of its text by 0, each within 30 % of them by others."""
        numbers = np.random.default_rng([number, self.scenes.index(scene)])
        return scene(lambda value: value * (1.0 if number == 0 else numbers.uniform(0.7, 1.3)), **options)

    def known(self):
        """Best costs that were found so far, by scene and number."""
        if not self.table.exists():
            return {}
        rows = (line.split("\t") for line in self.table.read_text().splitlines())
        return {(row[0], int(row[1])): (float(row[2]), row[3]) for row in rows}

    def save(self, costs):
        lines = (f"{name}\t{number}\t{cost:.9g}\t{how}" for (name, number), (cost, how) in sorted(costs.items()))
        self.table.write_text("\n".join(lines) + "\n")


def believable(r):
    """Is it a solution whose simulation, by events, is the same motion?"""
    return r.success and r.accuracy is not None and r.accuracy.terminal < 5e-3


def keep(problems, costs, key, r, how):
    """Writes an answer into the table where it costs less than what stands there."""
    if believable(r) and (key not in costs or r.cost_reached < costs[key][0] * (1 - 1e-6)):
        costs[key] = r.cost_reached, how
        problems.save(costs)


def look_for_better(problems, scene, number, seconds, costs):
    """Every search, and the default one from random guesses."""
    key = scene.__name__, number
    model, _ = problems.variant(scene, number)
    methods = ("auto", "steps", "shots", "fesd_j", "freezing") if isinstance(model, swb.Scene) else ("auto",)
    ways = [(method, None) for method in methods]
    ways += [("auto", seed) for seed in range(problems.guesses)]
    for method, seed in ways:
        how = {} if method == "auto" else {"jumps": method}
        _, ocp = problems.variant(scene, number, max_time=seconds, **how)
        if seed is not None:
            drawn = ocp.random_starts(1 + problems.guesses)[1 + seed]
            ocp.set_control_guess(np.repeat(drawn[::PIECE], PIECE, axis=0)[: ocp.n_stages])
        r = ocp.solve()
        keep(problems, costs, key, r, method if seed is None else f"guess {seed}")


def main(problems):
    arguments = argparse.ArgumentParser()
    arguments.add_argument("--best", action="store_true")
    arguments.add_argument("--keep", action="store_true")
    arguments.add_argument("--max-time", type=float, default=30.0)
    arguments.add_argument("--only", default="")
    given = arguments.parse_args()
    costs = problems.known()
    dear = solved = all_of_them = iterations = 0
    began = time.process_time()
    for scene in problems.scenes:
        for number in range(problems.variants):
            name = scene.__name__
            if given.only not in f"{name} {number}":
                continue
            if given.best:
                look_for_better(problems, scene, number, given.max_time, costs)
                print(name, number, *costs.get((name, number), ("unsolved",)), flush=True)
                continue
            _, ocp = problems.variant(scene, number, max_time=given.max_time)
            clock = time.process_time()
            r = ocp.solve()
            if given.keep:
                keep(problems, costs, (name, number), r, "auto")
            best = costs.get((name, number), (np.nan,))[0]
            ratio = r.cost_reached / best if r.success else np.inf
            dear += ratio > 1.01
            solved += r.success
            all_of_them += 1
            iterations += r.stats.iterations
            print(
                f"{name:16} {number} {r.cost_reached:12.6g} of {best:12.6g}, {ratio:8.4f} {'DEAR' if ratio > 1.01 else '    '} "
                f"{r.stats.iterations:6} iterations, {time.process_time() - clock:6.2f} CPU s {r.optimality.verdict if r.optimality else ''}",
                flush=True,
            )
    if not given.best:
        print(f"{solved} of {all_of_them} solved, {dear} dear, {iterations} iterations, {time.process_time() - began:.1f} CPU s")
