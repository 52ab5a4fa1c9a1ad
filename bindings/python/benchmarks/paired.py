"""Two builds, or two settings of one, on problems drawn freshly: is the one better than the other?

usage: paired.py --base LIB.so [--new LIB.so] [--set OPTION=VALUE ...] [--families a,b] [--count 100] [--seed S] [--limit SECONDS] [--json FILE]
       paired.py --base LIB.so --sources [--families a,b] [--count 10] [--seed S] [--limit SECONDS] [--json FILE]
       paired.py --table FILE.json

Problems are those of the package `families`, drawn by the base. Without a seed they are new at every use; the seed is printed, and gives the same ones
again. `--set` are options of the new arm, `--set-base` those of the base, `guess=on` gives the known controls as a guess. Every solve is a process of
its own: at `--limit` CPU seconds it is interrupted, and its best answer counts. The arms take turns in who is first.

A problem counts as solved where the answer is exact and a simulation of its controls by events ends where it does, to 1e-2 of the units of the problem.
Of two costs one is lower by more than 1 %, or they are the same; no answer is worse than any. The sign test is the exact binomial one, on both sides.
Ratios of work (factorisations) and of CPU time, new to base, are geometric means over what both have solved, with the interval of 95 % of a bootstrap.

`--sources` compares the default with every single way that the library has, and with the best of all of them, the known controls and, where there is
one, the optimum of an enumeration.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import os
import resource
import secrets
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any, Iterable, Iterator

import numpy as np

#: Costs that differ by more than this, relative, differ; and so much of the cost of the known controls is nothing.
SAME, TINY = 0.01, 1e-6
#: A simulation that ends this close, in units of the problem, follows the answer.
FOLLOWS = 1e-2
#: Samples of the bootstrap.
SAMPLES = 4000
#: CPU seconds after the interrupt after which a process is ended.
GRACE = 10.0
SCENES = ("walls", "pushing", "hopping")
#: The single ways to solutions: those of scenes, and those of all else.
SOURCES: dict[bool, dict[str, dict[str, Any]]] = {
    True: {
        "modes": {"jumps": "modes"},
        "steps": {"jumps": "steps"},
        "shots": {"jumps": "shots"},
        "fesd_j": {"jumps": "fesd_j"},
        "freezing": {"jumps": "freezing"},
        "guess": {"jumps": "modes", "guess": "on"},
        "default_guess": {"guess": "on"},
    },
    False: {
        "homotopy": {"ocp_start": "homotopy"},
        "smoothing": {"ocp_start": "smoothing"},
        "time_stepping": {"ocp_start": "homotopy", "initial_guess": "time_stepping"},
        "guess": {"ocp_start": "homotopy", "initial_guess": "simulation", "guess": "on"},
        "default_guess": {"guess": "on"},
    },
}


# --- statistics -----------------------------------------------------------------------------------


def sign_test(better: int, worse: int) -> float:
    """How likely it is, if neither arm is better, that the counts differ at least so much."""
    n = better + worse
    tail = sum(math.comb(n, k) for k in range(min(better, worse) + 1))
    return min(1.0, 2.0 * tail / 2.0**n)


def geometric(ratios: Iterable[float], samples: int = SAMPLES) -> tuple[float, float, float]:
    """Geometric mean with the interval in which 95 % of the means of resampled ratios are."""
    logs = np.log(np.array(list(ratios), float))
    if not len(logs):
        return math.nan, math.nan, math.nan
    drawn = np.random.default_rng(0).integers(0, len(logs), (samples, len(logs)))
    low, high = np.quantile(logs[drawn].mean(axis=1), (0.025, 0.975))
    return tuple(float(np.exp(v)) for v in (logs.mean(), low, high))  # type: ignore[return-value]


def lower(a: float | None, b: float | None, scale: float) -> bool:
    """Is the first of two costs lower than the other one? No answer costs more than any."""
    if a is None:
        return False
    return b is None or b - a > max(SAME * max(abs(a), abs(b)), TINY * abs(scale))


def cost_of(record: dict[str, Any]) -> float | None:
    return record["cost"] if record.get("solved") else None


# --- one solve, in a process of its own -----------------------------------------------------------


def replay(problem: Any, result: Any) -> float:
    """How far from the answer a simulation of its controls ends, in units of the problem."""
    import switchback_control as swb

    d, times = problem.data, result.control_times
    n, system = len(d["units"]["x"]), problem.state().system
    x = np.array(result.trajectory(times[0]))
    for k, u in enumerate(result.controls):
        if times[k + 1] > times[k]:
            run = swb.simulate(system, x, (times[k], times[k + 1]), u=u)
            if not run.success:
                return math.inf
            x, last = run.x_end, run(times[k + 1] - 1e-9 * (times[k + 1] - times[k]))
    # an impact may be just at the end, where rounding decides on which side of it either ends
    ends = [result.trajectory(t) for t in (times[-1], np.nextafter(times[-1], np.inf))]
    return float(min(np.max(abs(one[:n] - end[:n]) / d["units"]["x"]) for one in (x, last) for end in ends))


def solve(family: str, data: dict[str, Any], options: dict[str, Any], limit: float) -> dict[str, Any]:
    import families

    problem = families.Problem(family, data)
    how = {k: v for k, v in options.items() if k != "guess"}
    ocp = problem.make(**how)
    if options.get("guess") == "on":
        ocp.set_control_guess(problem.guess)
    over, cut = threading.Event(), threading.Event()
    clock = time.process_time()

    def watch() -> None:
        while not over.wait(0.05):
            if time.process_time() - clock > limit:
                cut.set()
                ocp.interrupt()
                return

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        r = ocp.solve()
    finally:
        over.set()
        watcher.join()
    cpu = time.process_time() - clock
    record = {
        "outcome": r.outcome.name.lower(), "polished": str(r.polished), "verdict": r.certificate, "cost": r.cost_reached, "cpu": round(cpu, 4),
        "simulated": r.accuracy.cost if r.accuracy else None, "iterations": r.stats.iterations, "work": r.stats.factorisations,
        "evaluations": r.stats.evaluations, "cut": cut.is_set(), "answer": bool(r.success or (r.polished.name == "DONE" and math.isfinite(r.cost_reached))),
    }  # fmt: skip
    try:
        record["deviation"] = replay(problem, r)
    except Exception as error:
        record |= {"deviation": math.inf, "message": f"{type(error).__name__}: {error}"[:200]}
    record["solved"] = record["answer"] and record["deviation"] <= FOLLOWS
    return record


def do(task: dict[str, Any]) -> dict[str, Any]:
    if task["do"] == "draw":
        import families

        return families.instance(task["family"], families.generator(task["family"], task["seed"], task["number"])).data
    return solve(task["family"], task["data"], task["options"], task["limit"])


def finite(value: Any) -> Any:
    """Without numbers that JSON does not have."""
    if isinstance(value, dict):
        return {k: finite(v) for k, v in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value


def worker() -> None:
    """Takes tasks, a line each, and does every one in a copy of itself, which has the library loaded already."""
    import families  # noqa: F401

    print("ready", flush=True)
    for line in sys.stdin:
        task = json.loads(line)
        read, write = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(read)
            limit = math.ceil(task.get("limit", 600.0) + GRACE)
            resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 1))
            clock = time.process_time()
            try:
                answer = do(task)
            except Exception as error:
                answer = {"outcome": type(error).__name__, "message": str(error)[:200], "solved": False, "cpu": time.process_time() - clock}
            with os.fdopen(write, "w") as pipe:
                json.dump(finite(answer), pipe)
            os._exit(0)
        os.close(write)
        with os.fdopen(read) as pipe:
            text = pipe.read()
        _, status, usage = os.wait4(child, 0)
        if not text:
            ended = {"outcome": "killed", "message": f"signal {os.WTERMSIG(status)}" if os.WIFSIGNALED(status) else "", "solved": False}
            text = json.dumps(ended | {"cpu": usage.ru_utime + usage.ru_stime})
        print(text, flush=True)


class Arm:
    """A build with options, and the process that solves with it."""

    def __init__(self, name: str, library: str, package: str | None, options: dict[str, Any]):
        self.name, self.options = name, options
        environment = {**os.environ, "SWITCHBACK_LIBRARY": str(Path(library).resolve()) if Path(library).is_file() else library}
        if package:
            environment["PYTHONPATH"] = package + os.pathsep + environment.get("PYTHONPATH", "")
        command = [sys.executable, str(Path(__file__).resolve()), "--worker"]
        self.process = subprocess.Popen(command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        if self.process.stdout.readline().strip() != "ready":
            raise SystemExit(f"{library} cannot be used, see above")

    def ask(self, **task: Any) -> dict[str, Any]:
        self.process.stdin.write(json.dumps(task) + "\n")
        self.process.stdin.flush()
        line = self.process.stdout.readline()
        if not line:
            raise SystemExit(f"the process of {self.name} has ended")
        return json.loads(line)

    def close(self) -> None:
        self.process.stdin.close()
        self.process.wait()


# --- a comparison ---------------------------------------------------------------------------------


def compare(records: list[dict[str, Any]]) -> dict[str, Any]:
    """What the two arms `base` and `new` have in common and what not, over these instances."""
    pairs = [(r, r["arms"]["base"], r["arms"]["new"]) for r in records]
    costs = [(cost_of(b), cost_of(n), r["guess_cost"]) for r, b, n in pairs]
    better, worse = sum(lower(n, b, s) for b, n, s in costs), sum(lower(b, n, s) for b, n, s in costs)
    both = [(b, n) for _, b, n in pairs if b["solved"] and n["solved"]]
    return {
        "instances": len(records), "solved": [sum(b["solved"] for _, b, _ in pairs), sum(n["solved"] for _, _, n in pairs)],
        "better": better, "worse": worse, "p": sign_test(better, worse),
        "above_guess": [sum(lower(s, b, s) for b, _, s in costs), sum(lower(s, n, s) for _, n, s in costs)],
        "work": geometric(max(1, n["work"]) / max(1, b["work"]) for b, n in both),
        "cpu": geometric(max(1e-3, n["cpu"]) / max(1e-3, b["cpu"]) for b, n in both),
        "verdicts": {v: [sum(b.get("verdict", b["outcome"]) == v for _, b, _ in pairs), sum(n.get("verdict", n["outcome"]) == v for _, _, n in pairs)]
                     for v in sorted({x.get("verdict", x["outcome"]) for _, *two in pairs for x in two})},
    }  # fmt: skip


def interval(r: Any) -> str:
    return "–" if r[0] is None or not math.isfinite(r[0]) else f"{r[0]:.2f} ({r[1]:.2f} to {r[2]:.2f})"


def by_family(records: list[dict[str, Any]]) -> Iterator[tuple[str, list[dict[str, Any]]]]:
    for family in dict.fromkeys(r["family"] for r in records):
        yield family, [r for r in records if r["family"] == family]
    yield "all", records


def comparison_tables(records: list[dict[str, Any]]) -> str:
    lines = ["| family | instances | solved, base | new | lower cost, new | base | p | above the guess, base | new | work, new to base | CPU time |"]
    lines.append("|" + "---|" * 11)
    for family, of in by_family(records):
        c = compare(of)
        lines.append(
            f"| {family} | {c['instances']} | {c['solved'][0]} | {c['solved'][1]} | {c['better']} | {c['worse']} | {c['p']:.2g} | {c['above_guess'][0]} "
            f"| {c['above_guess'][1]} | {interval(c['work'])} | {interval(c['cpu'])} |"
        )
    lines += ["", "| verdict | base | new |", "|---|---|---|"]
    lines += [f"| `{v}` | {b} | {n} |" for v, (b, n) in compare(records)["verdicts"].items()]
    differ = [r for r in records for b, n in [[cost_of(r["arms"][a]) for a in ("base", "new")]] if lower(b, n, r["guess_cost"]) or lower(n, b, r["guess_cost"])]
    if differ:
        lines += ["", "| family | seed | number | cost, base | new |", "|---|---|---|---|---|"]
    for r in differ:
        base, new = (cost_of(r["arms"][a]) for a in ("base", "new"))
        lines.append(f"| {r['family']} | {r['seed']} | {r['number']} | {shown(base)} | {shown(new)} |")
    return "\n".join(lines)


def shown(cost: float | None) -> str:
    return "–" if cost is None else f"{cost:.7g}"


# --- all sources ----------------------------------------------------------------------------------


def least(record: dict[str, Any]) -> float:
    """The least cost that is known of an instance: of all arms, of the known controls, of an enumeration."""
    costs = [cost_of(a) for a in record["arms"].values()] + [record["guess_cost"], record.get("optimum")]
    return min(c for c in costs if c is not None)


def judged(records: list[dict[str, Any]], arm: str) -> dict[str, Any]:
    """What one arm is worth over the instances that it was asked for."""
    of = [(r, r["arms"][arm]) for r in records if arm in r["arms"]]
    solved = [(r, a) for r, a in of if a["solved"]]
    ratios = [a["cost"] / least(r) for r, a in solved if least(r) > TINY * r["guess_cost"]]
    return {
        "asked": len(of), "answers": sum(a.get("answer", False) for _, a in of), "solved": len(solved),
        "near": sum(not lower(least(r), a["cost"], r["guess_cost"]) for r, a in solved),
        "above_guess": sum(lower(r["guess_cost"], cost_of(a), r["guess_cost"]) for r, a in of),
        "median": float(np.median(ratios)) if ratios else None, "worst": max(ratios, default=None),
        "cpu": sum(a["cpu"] for _, a in of), "iterations": sum(a.get("iterations", 0) for _, a in of),
        "cut": sum(a.get("cut", a["outcome"] == "killed") for _, a in of),
        "unknown": sum(a.get("verdict", "unknown") == "unknown" for _, a in solved),
    }  # fmt: skip


def source_tables(records: list[dict[str, Any]]) -> str:
    lines = [
        "| family | way | instances | exact | solved | within 1 % of the least | above the guess | largest ratio | verdict unknown | cut | iterations | CPU s |",
        "|" + "---|" * 12,
    ]
    for family, of in by_family(records):
        for arm in dict.fromkeys(a for r in of for a in r["arms"]):
            j = judged(of, arm)
            worst = "–" if j["worst"] is None else f"{j['worst']:.4g}"
            lines.append(
                f"| {family} | `{arm}` | {j['asked']} | {j['answers']} | {j['solved']} | {j['near']} | {j['above_guess']} | {worst} | {j['unknown']} "
                f"| {j['cut']} | {j['iterations']} | {j['cpu']:.0f} |"
            )
    lines += ["", "| family | number | least cost | of | default | ratio |", "|---|---|---|---|---|---|"]
    for r in records:
        best, cost = least(r), cost_of(r["arms"]["default"])
        if lower(best, cost, r["guess_cost"]):
            ways = [a for a, found in r["arms"].items() if cost_of(found) == best] or ["known controls" if best == r["guess_cost"] else "enumeration"]
            what = "no solution" if cost is None else shown(cost)
            ratio = "–" if cost is None or best <= 0 else f"{cost / best:.4g}"
            lines.append(f"| {r['family']} | {r['number']} | {best:.7g} | {ways[0]} | {what} | {ratio} |")
    return "\n".join(lines)


# --- the program ----------------------------------------------------------------------------------


def option(text: str) -> tuple[str, Any]:
    """Name and value of an option given as NAME=VALUE."""
    name, equals, value = text.partition("=")
    if not equals:
        raise argparse.ArgumentTypeError(f"'{text}' is not of the form OPTION=VALUE")
    for kind in (int, float):
        with contextlib.suppress(ValueError):
            return name, kind(value)
    return name, value


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--base", help="the library of the base")
    parser.add_argument("--new", help="the other library; that of the base if only options differ")
    parser.add_argument("--base-package", help="folder with the Python package of the base, where that is another one")
    parser.add_argument("--new-package", help="the same of the other library")
    parser.add_argument("--set", type=option, action="append", default=[], metavar="OPTION=VALUE", help="an option of the new arm")
    parser.add_argument("--set-base", type=option, action="append", default=[], metavar="OPTION=VALUE", help="an option of the base")
    parser.add_argument("--sources", action="store_true", help="the default against every single way")
    parser.add_argument("--families", default="", help="names, with commas; all of them otherwise")
    parser.add_argument("--numbers", default="", help="these numbers of instances alone, with commas")
    parser.add_argument("--count", type=int, default=100, help="instances of a family")
    parser.add_argument("--seed", type=int, help="the same problems as before")
    parser.add_argument("--limit", type=float, default=60.0, help="CPU seconds of a solve")
    parser.add_argument("--json", type=Path, help="write what was found to this file, while it is found")
    parser.add_argument("--markdown", type=Path, help="write the tables to this file, too")
    parser.add_argument("--table", type=Path, help="only make the tables of such a file")
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.worker:
        worker()
        return 0
    if arguments.table:
        stored = json.loads(arguments.table.read_text())
        print((source_tables if stored["sources"] else comparison_tables)(stored["instances"]))
        return 0
    if not arguments.base:
        parser.error("--base says which library")
    return run(arguments)


def run(arguments: argparse.Namespace) -> int:
    seed = secrets.randbits(31) if arguments.seed is None else arguments.seed
    names = arguments.families.split(",") if arguments.families else FAMILIES
    numbers = [int(n) for n in arguments.numbers.split(",")] if arguments.numbers else range(arguments.count)
    print(f"seed {seed}", flush=True)
    base = Arm("base", arguments.base, arguments.base_package, dict(arguments.set_base))
    arms = {"base": base}
    if not arguments.sources:
        arms["new"] = Arm("new", arguments.new or arguments.base, arguments.new_package or arguments.base_package, dict(arguments.set))
    stored = {
        "sources": arguments.sources, "seed": seed, "limit": arguments.limit, "options": [dict(arguments.set_base), dict(arguments.set)],
        "instances": [],
    }  # fmt: skip
    tables = source_tables if arguments.sources else comparison_tables
    try:
        for number in numbers:
            for family in names:
                data = base.ask(do="draw", family=family, seed=seed, number=number)
                if "units" not in data:
                    raise SystemExit(f"{family} {number}: {data.get('message', data)}")
                ways: dict[str, tuple[Arm, dict[str, Any]]] = {name: (arm, arm.options) for name, arm in arms.items()}
                if arguments.sources:
                    ways = {"default": (base, base.options)} | {w: (base, base.options | o) for w, o in SOURCES[family in SCENES].items()}
                record = {"family": family, "seed": seed, "number": number, "kind": data.get("kind"), "guess_cost": data["guess_cost"], "arms": {}}
                record |= {"optimum": data["optimum"]} if "optimum" in data else {}
                order = list(ways) if number % 2 == 0 else list(ways)[::-1]
                found = {w: ways[w][0].ask(do="solve", family=family, data=data, options=ways[w][1], limit=arguments.limit) for w in order}
                record["arms"] = {w: found[w] for w in ways}
                stored["instances"].append(record)
                print(f"{family:11}{number:4}  guess {shown(record['guess_cost'])}" + "".join(
                    f"   {w} {shown(cost_of(a))} {a['cpu']:.1f} s" + ("" if a["solved"] else f" {a['outcome']}") for w, a in record["arms"].items()
                ), flush=True)  # fmt: skip
                if arguments.json and len(stored["instances"]) % 10 == 0:
                    write(arguments.json, stored)
    except KeyboardInterrupt:
        print("interrupted: tables of what there is")
    finally:
        for arm in arms.values():
            arm.close()
    order = {name: k for k, name in enumerate(names)}
    stored["instances"].sort(key=lambda r: (order[r["family"]], r["number"]))
    if arguments.json:
        write(arguments.json, stored)
    text = tables(stored["instances"])
    print(text)
    if arguments.markdown:
        arguments.markdown.write_text(text + "\n")
    return 0


def rounded(value: Any) -> Any:
    """With ten digits, which is what a comparison needs."""
    if isinstance(value, dict):
        return {k: rounded(v) for k, v in value.items()}
    if isinstance(value, list):
        return [rounded(v) for v in value]
    return float(f"{value:.10g}") if isinstance(value, float) else value


def write(path: Path, stored: dict[str, Any]) -> None:
    """As JSON, a line for an instance."""
    path.write_text(json.dumps(rounded(stored), separators=(",", ":")).replace('{"family"', '\n{"family"') + "\n")


#: Names of the families: the program itself loads no library.
FAMILIES = ["friction", "gears", "regions", "tanks", "walls", "pushing", "hysteresis", "onoff", "hopping", "projected", "affine", "horizons", "gates", "lines"]

if __name__ == "__main__":
    sys.exit(main())
