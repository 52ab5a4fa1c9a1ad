"""Our solver beside IPOPT's homotopy on programs with complementarity pairs, both on the same C callbacks.

usage: mpcc_train.py [--problems DIR] [--set-of NAME] [--only REGEX] [--limit SECONDS] [--json FILE|-] [--lib FILE]
                     [--set NAME=VALUE ...] [--members auto|rows] [--move-start SEED] [--no-ipopt] [--ipopt-mode scholtes|linf]
                     [--ipopt-cache FILE]

The problems are a folder with mpcc_problem.h, mpcc_vm.c, NAME.json (train.json, unless said otherwise) and the files it names (bindings/python/tests/collection
is a small one); by default the one that the environment variable SWITCHBACK_MPCC_PROBLEMS names. Collections that may not
be copied are no part of this repository: without a folder nothing is done, which is no failure.

The peer is IPOPT with MUMPS, called through its C interface (pip install casadi): the homotopy of Scholtes,
G_i H_i <= sigma, or the elastic mode in the maximum norm, min f + s / sigma with G_i H_i <= s and 0 <= s <= 10, for
sigma = 1, 0.1, ..., 1e-9, each program solved to 1e-8 from the point before, until one is solved with all products at
most 1e-7. Bounds are not relaxed. `--ipopt-variant monotone` has IPOPT's default barrier update,
`adaptive` (the default here, and the stronger one: a third of the iterations) the one of nosnoc: mu_strategy adaptive,
mu_oracle quality-function.

A problem counts as solved if the solver says so and the point, evaluated anew, violates nothing by more than 1e-6 and
has no product above 1e-7; where no solution exists, if the solver says that (infeasible, or diverging). CPU seconds are
those of the thread inside the solver, the best of some runs; each problem has a process of its own, so that a crash or
a hang is one result among others.

The peer's point fulfils a relaxation: with products of 1e-7 its objective can be below that of every point that is
complementary. So objectives are compared with what its point is worth: the program in which the smaller member of each
pair is zero is solved from there, by IPOPT again and not counted in its time. Ours is no worse if it is within
1e-5 max(1, |f|) of that; the comparison with the relaxed objective is reported too.
"""

from __future__ import annotations

import argparse
import datetime
import json
import math
import multiprocessing
import multiprocessing.connection
import os
import re
import resource
import signal
import sys
import tempfile
import time
from dataclasses import asdict
from pathlib import Path

import numpy as np

import mpcc_compare
import mpcc_ipopt
import mpcc_switchback
from mpcc_problems import PROBLEMS, Code, Problem, collection

VIOLATION, PRODUCT = 1e-6, 1e-7
ENOUGH = 0.3  # seconds of runs after which no further one is made
GRACE = 5.0  # CPU seconds beyond twice its limit after which a process hangs
PATIENCE = 10  # times as many seconds it may wait for its turn


def measured(problem: Problem, run, repeat: int, expect: str) -> dict:
    """The fastest of some runs, with the point measured by the problem's own functions."""
    best, spent = None, 0.0
    for _ in range(repeat):
        result = run()
        spent += result["cpu"]
        if best is None or result["cpu"] < best["cpu"]:
            best = result
        if spent > ENOUGH:
            break
    point = problem.measure(best["x"])
    claimed = best.pop("solved")
    if expect == "infeasible":
        solved = best["outcome"] == "infeasible"
    elif expect == "unbounded":
        solved = best["outcome"] == "diverging"
    else:
        solved = claimed and point.violation <= VIOLATION and point.product <= PRODUCT
    return {"solved": bool(solved), "claimed": bool(claimed), **asdict(point), **best, "x": best["x"].tolist()}


class Bench:
    """What every process of a problem needs; loaded before they are forked."""

    def __init__(self, arguments: argparse.Namespace, folder: Path, with_ours: bool = True):
        self.code = Code(arguments.problems, folder)
        self.problems = arguments.problems
        self.limit, self.repeat, self.members = arguments.limit, arguments.repeat, arguments.members
        self.variant, self.mode, self.seed = arguments.ipopt_variant, arguments.ipopt_mode, arguments.move_start
        self.swb = mpcc_switchback.load(arguments.lib) if with_ours else None
        self.ipopt = mpcc_ipopt.Ipopt() if arguments.ipopt else None

    def run(self, solver: str, entry: dict, options: dict) -> dict:
        problem = Problem(self.code, self.problems / entry["file"], self.seed)
        expect = entry.get("known", {}).get("expect", "optimal")
        if solver == "ipopt":

            def run(count: bool = False) -> dict:
                return self.ipopt.homotopy(problem, self.variant, self.limit, self.mode, count)
        else:

            def run(count: bool = False) -> dict:
                return mpcc_switchback.solve(self.swb, problem, self.members, options, self.limit, count)

        result = measured(problem, run, self.repeat, expect)
        if result["solved"]:
            # in a run of its own, as to count takes time itself
            result["functions"] = run(True)["functions"]
        if solver == "ipopt":
            result["version"] = f"{self.ipopt.version} ({self.ipopt.origin})"
            if result["claimed"]:
                x = np.array(result["x"])
                result["branch"] = self.ipopt.branch_objective(problem, x, self.variant, self.limit)
        return result


class Changed(Bench):
    """Our solver alone, on problems that are changed as options say."""

    def changed(self, path: Path, change: int) -> Problem:
        """The problem of a file after change number `change`; 0 is none."""
        raise NotImplementedError

    def run(self, solver: str, entry: dict, options: dict) -> dict:
        problem = self.changed(self.problems / entry["file"], options["change"])
        expect = entry.get("known", {}).get("expect", "optimal")
        return measured(problem, lambda: mpcc_switchback.solve(self.swb, problem, self.members, {}, self.limit), 1, expect)


def _child(bench: Bench, solver: str, entry: dict, options: dict, limit: float, pipe) -> None:
    try:
        resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(2 * limit + GRACE), resource.RLIM_INFINITY))
        pipe.send(bench.run(solver, entry, options))
    except BaseException as error:
        pipe.send({"outcome": "exception", "message": f"{type(error).__name__}: {error}"})
    pipe.close()


def nothing(outcome: str, message: str = "") -> dict:
    """The result of a run that gave none."""
    missing = ("objective", "violation", "product", "pair_min", "cpu")
    return {
        "solved": False, "claimed": False, "iterations": 0, "outcome": outcome, "message": message,
    } | dict.fromkeys(missing)  # fmt: skip


class Running:
    """A solver on a problem in a process of its own."""

    def __init__(self, bench: Bench, solver: str, name: str, entry: dict, options: dict, limit: float):
        context = multiprocessing.get_context("fork")
        self.solver, self.name = solver, name
        self.pipe, other = context.Pipe(duplex=False)
        self.process = context.Process(target=_child, args=(bench, solver, entry, options, limit, other))
        self.process.start()
        other.close()
        self.end = time.monotonic() + PATIENCE * (2 * limit + GRACE)

    def poll(self) -> dict | None:
        """The result if there is one."""
        result = None
        if self.pipe.poll():
            try:
                result = self.pipe.recv()
            except EOFError:
                self.process.join()
                code = self.process.exitcode
                result = nothing("hang" if code == -signal.SIGXCPU else "crash", f"exit code {code}")
            if "solved" not in result:
                result = nothing(result["outcome"], result["message"])
        elif time.monotonic() > self.end:
            self.process.kill()
            result = nothing("hang")
        if result is not None:
            self.process.join()
            self.pipe.close()
        return result


def run_all(bench: Bench, tasks: list[tuple[str, str, dict, dict]], jobs: int, limit: float, done=None) -> list[dict]:
    """Results of tasks (solver, name, entry, options) in their order; `done(i, result)` is told of each."""
    results: list[dict] = [{}] * len(tasks)
    waiting, running = list(enumerate(tasks)), {}
    while waiting or running:
        while waiting and len(running) < jobs:
            i, (solver, name, entry, options) = waiting.pop(0)
            running[i] = Running(bench, solver, name, entry, options, limit)
        multiprocessing.connection.wait([r.pipe for r in running.values()], timeout=0.5)
        for i, r in list(running.items()):
            result = r.poll()
            if result is not None:
                results[i] = result
                del running[i]
                if done is not None:
                    done(i, result)
    return results


def run_changed(
    kind: type[Changed], arguments: argparse.Namespace, problems: dict[str, dict], changes: int
) -> dict[str, list[dict]]:
    """Results of every problem: as it is, then after every change."""
    mpcc_ipopt.single_thread()
    with tempfile.TemporaryDirectory() as folder:
        bench = kind(arguments, Path(folder))
        tasks = [("switchback", n, p, {"change": k}) for n, p in problems.items() for k in range(changes + 1)]
        results = run_all(bench, tasks, arguments.jobs, arguments.limit)
    found: dict[str, list[dict]] = {}
    for (_, name, _, _), result in zip(tasks, results):
        found.setdefault(name, []).append(result)
    return found


def progress(result: dict) -> str:
    return f"{result['outcome']}, {result['iterations']} iterations, {1e3 * (result['cpu'] or 0.0):.2f} ms"


def ipopt_key(arguments: argparse.Namespace, name: str) -> str:
    moved = f"/start {arguments.move_start}" if arguments.move_start else ""
    mode = "" if arguments.ipopt_mode == "scholtes" else f"{arguments.ipopt_mode}/"
    return f"{mode}{arguments.ipopt_variant}{moved}/{name}"


def parse(argv: list[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    add_arguments(parser)
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="option of our solver")
    parser.add_argument("--json", help="write all numbers to this file; - for the terminal, without the table")
    return parser.parse_args(argv)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Those that the ablation has too."""
    parser.add_argument("--problems", type=Path, default=os.environ.get(PROBLEMS), help=f"their folder; default: ${PROBLEMS}")
    parser.add_argument("--set-of", default="train", metavar="NAME", help="the problems of NAME.json in that folder")
    parser.add_argument("--only", default="", metavar="REGEX", help="problems whose name matches")
    parser.add_argument("--limit", type=float, default=60.0, metavar="SECONDS", help="of one solve")
    parser.add_argument("--repeat", type=int, default=5, help="runs of which the fastest counts, for short ones")
    parser.add_argument("--lib", metavar="FILE", help="libswitchback.so; default: $SWITCHBACK_LIBRARY, or cargo's")
    parser.add_argument("--members", choices=("auto", "rows"), default="auto", help="variables in pairs as rows?")
    parser.add_argument("--move-start", type=int, default=0, metavar="SEED", help="another start, of both; 0: as given")
    parser.add_argument("--jobs", type=int, default=1, help="problems at the same time; 1 for honest times")
    parser.add_argument("--ipopt", action=argparse.BooleanOptionalAction, default=True, help="run the peer")
    parser.add_argument("--ipopt-variant", choices=tuple(mpcc_ipopt.VARIANTS), default="adaptive")
    parser.add_argument("--ipopt-mode", choices=mpcc_ipopt.MODES, default="scholtes", help="relaxation, or elastic mode")
    parser.add_argument("--ipopt-cache", type=Path, metavar="FILE", help="results of the peer, read and written")


def options_of(settings: list[str]) -> dict[str, str]:
    options = {}
    for setting in settings:
        name, equals, value = setting.partition("=")
        if not equals:
            raise SystemExit(f"--set {setting}: expected NAME=VALUE")
        options[name] = value
    return options


def chosen(arguments: argparse.Namespace) -> dict[str, dict] | None:
    """The problems, or None with a message where there are none."""
    if arguments.problems is None or not (arguments.problems / f"{arguments.set_of}.json").is_file():
        where = "without a folder of problems" if arguments.problems is None else f"no problems in {arguments.problems}"
        print(f"left out: {where} ({PROBLEMS} or --problems says where they are)")
        return None
    every = collection(arguments.problems, arguments.set_of)
    return {name: entry for name, entry in every.items() if re.search(arguments.only, name)}


def peer_results(arguments: argparse.Namespace, bench: Bench, problems: dict[str, dict]) -> dict[str, dict]:
    """IPOPT's results, from the cache where they are there."""
    path = arguments.ipopt_cache
    cache = json.loads(path.read_text()) if path and path.is_file() else {}
    found = {n: cache[ipopt_key(arguments, n)] for n in problems if ipopt_key(arguments, n) in cache}
    found = {n: r | {"cached": True} for n, r in found.items()}
    missing = [n for n in problems if n not in found] if arguments.ipopt else []

    def done(i: int, result: dict) -> None:
        say(f"ipopt {missing[i]}: {progress(result)}")

    tasks = [("ipopt", n, problems[n], {}) for n in missing]
    for name, result in zip(missing, run_all(bench, tasks, arguments.jobs, arguments.limit, done)):
        found[name] = result
        cache[ipopt_key(arguments, name)] = result
    if path and missing:
        path.write_text(json.dumps(cache, indent=1) + "\n")
    return found


def say(text: str) -> None:
    """Progress, beside what is printed."""
    print(text, file=sys.stderr, flush=True)


def description(arguments: argparse.Namespace, peer: dict[str, dict], options: dict[str, str]) -> dict:
    """How a run was made."""
    versions = {r.get("version") for r in peer.values()} - {None}
    return {
        "ipopt": ", ".join(sorted(versions)), "ipopt_variant": arguments.ipopt_variant,
        "ipopt_mode": arguments.ipopt_mode, "set_of": arguments.set_of, "options": options,
        "ipopt_cached": any(r.get("cached", False) for r in peer.values()),
        "members": arguments.members, "move_start": arguments.move_start, "limit": arguments.limit,
        "repeat": arguments.repeat, "date": datetime.date.today().isoformat(),
    }  # fmt: skip


def main() -> int:
    arguments = parse()
    problems = chosen(arguments)
    if problems is None:
        return 0
    options = options_of(arguments.set)
    quiet = arguments.json == "-"

    mpcc_ipopt.single_thread()
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(arguments, Path(folder))
        peer = peer_results(arguments, bench, problems)
        names = list(problems)

        def done(i: int, result: dict) -> None:
            say(f"{names[i]}: {progress(result)}")

        tasks = [("switchback", n, problems[n], options) for n in names]
        ours = dict(zip(names, run_all(bench, tasks, arguments.jobs, arguments.limit, done)))
    record = mpcc_compare.compare(problems, ours, peer)
    record["run"] = description(arguments, peer, options)
    text = json.dumps(mpcc_compare.finite(record), indent=1)
    if quiet:
        print(text)
        return 0
    if arguments.json:
        Path(arguments.json).write_text(text + "\n")
    print(mpcc_compare.table(record))
    return 0


if __name__ == "__main__":
    sys.exit(main())
