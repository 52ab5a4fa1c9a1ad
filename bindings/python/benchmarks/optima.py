"""Are the answers optimal? Problems of `optima_problems.py` from the default start, one line each.

usage: optima.py [NAME ...] [--configurations] [--peers] [--max-time S] [--set OPTION=VALUE ...] [--json FILE]

A line has outcome, whether the modes were polished, the certificate, the cost, the cost and the distance at the end when
the controls are simulated by events, iterations and seconds. `gap` is the distance from the exact or the best known cost,
relative, where there is one. `--configurations` solves from other starts too: forms, first relaxations and guesses.

`--set` changes options of all solves, e.g. `--set ocp_start=homotopy --set n_s=2`.

`--peers` looks for lower costs (pip install casadi scipy): smoothing with IPOPT, and descents on simulations by events from
its controls and from answers of ours from several starts. The best known cost is the exact one where there is one, else the
lowest cost in a simulation that meets all constraints to 1e-5. It goes to `docs/benchmarks/data/optima.json` and, with the
names alone, to `benches/optima/costs.tsv`; what is on record there is replaced by what is lower only.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import sys
import time
from pathlib import Path
from typing import Any

import optima_problems

from switchback_control import SwitchbackError

#: What other starts are made of; the first one is the default.
CONFIGURATIONS = [
    {"dcs_form": form, "sigma_init": sigma, "initial_guess": guess}
    for guess, form, sigma in itertools.product(
        ("constant", "simulation", "smoothed", "time_stepping"), ("stewart", "heaviside"), (1.0, 10.0, 100.0)
    )
]
#: Costs this close to the best known, relative, are as good, and so are differences that are as small as the second number.
#: Costs that are below it by more than the third one are made by errors of the discretisation.
SAME, TINY, BELOW = 1e-3, 1e-7, 1e-2
#: A simulation that ends this close to the answer confirms it.
CONFIRMED = 1e-5
#: Starts of ours that descents go on from.
STARTS: list[dict[str, Any]] = [
    {},
    {"dcs_form": "heaviside"},
    {"sigma_init": 10.0},
    {"sigma_init": 100.0},
    {"initial_guess": "time_stepping"},
    {"dcs_form": "heaviside", "sigma_init": 10.0, "initial_guess": "time_stepping"},
]
COSTS = optima_problems.DOCUMENTS / "costs.tsv"
STORE = Path(__file__).resolve().parents[3] / "docs" / "benchmarks" / "data" / "optima.json"


def known() -> dict[str, dict[str, Any]]:
    """Best known costs that are on record."""
    if not STORE.exists():
        return {}
    return {p["name"]: p for p in json.loads(STORE.read_text())["problems"]}


def reference(name: str, store: dict[str, dict[str, Any]]) -> float | None:
    """The exact cost, or the best known one."""
    exact = optima_problems.PROBLEMS[name].exact
    return exact if exact is not None else store.get(name, {}).get("best")


def solve(name: str, max_time: float = math.inf, **options: Any) -> dict[str, Any]:
    """One solve of the problem; the answer is under "ocp" and "result"."""
    clock = time.perf_counter()
    try:
        ocp = optima_problems.PROBLEMS[name].make(**({"max_time": max_time} | options))
        r = ocp.solve()
    except SwitchbackError as error:  # a problem that cannot be stated or solved is a line of its own
        return {
            "name": name,
            "outcome": f"{type(error).__name__}: {error}",
            "polished": "",
            "certificate": "",
            "solved": False,
        }
    seconds = time.perf_counter() - clock
    verdict = getattr(r, "certificate", None)
    a = r.accuracy
    return {
        "name": name,
        "ocp": ocp,
        "result": r,
        "solved": bool(r.success),
        "outcome": str(r.outcome),
        "polished": str(r.polished),
        "certificate": str(verdict) if verdict is not None else ocp.certificate.stationarity,
        "cost": r.cost,
        "simulated": a.cost if a else math.nan,
        "error": a.terminal if a else math.nan,
        "violation": a.terminal_violation if a else math.nan,
        "iterations": r.stats.iterations,
        "seconds": seconds,
        "message": r.message,
    }  # fmt: skip


def gap(cost: float, best: float | None) -> float:
    """How far a cost is above the best one, relative; what is too small to count is 0."""
    if best is None or not math.isfinite(cost):
        return math.nan
    return 0.0 if abs(cost - best) <= TINY else (cost - best) / max(abs(best), 1e-300)


def line(r: dict[str, Any], best: float | None) -> str:
    if "cost" not in r:
        return f"{r['name']:<22}{r['outcome']}"
    return (
        f"{r['name']:<22}{r['outcome']:<12}{r['polished']:<14}{r['certificate']:<15}{r['cost']:14.8f}{r['simulated']:14.8f}"
        f"{r['error']:9.1e}{r['iterations']:6d}{r['seconds']:8.2f}{gap(r['cost'], best):11.1e}"
        + (f"  {r['message']}" if r["message"] else "")
    )


def summary(found: list[dict[str, Any]], store: dict[str, dict[str, Any]]) -> str:
    n = len(found)
    solved = [r for r in found if r["solved"]]
    rated = [(r, reference(r["name"], store)) for r in found]
    rated = [(r, b) for r, b in rated if b is not None]
    good = sum(r["solved"] and -BELOW <= gap(r["cost"], b) <= SAME for r, b in rated)
    stable = [r for r in solved if optima_problems.PROBLEMS[r["name"]].stable]
    seconds = [r["seconds"] for r in found if "seconds" in r]
    mean = math.exp(sum(map(math.log, seconds)) / len(seconds)) if seconds else math.nan
    return (
        f"{n} problems: {len(solved)} solved, {sum(r['polished'] == 'done' for r in solved)} polished, "
        f"{good} of {len(rated)} within {SAME:.1%} of the exact or best known cost, "
        f"E(T) <= {CONFIRMED:g} in {sum(r['error'] <= CONFIRMED for r in stable)} of {len(stable)} stable ones, "
        f"{sum(r.get('iterations', 0) for r in found)} iterations, {sum(seconds):.1f} s, geometric mean {mean:.3f} s"
    )


def improve(name: str, seconds: float) -> dict[str, Any]:
    """The lowest cost that several ways lead to, and how."""
    import optima_peers

    found: list[tuple[str, float, float]] = []
    p = optima_problems.PROBLEMS[name]
    statement = optima_peers.Statement(p.make())
    descent = optima_peers.Descent(statement)
    starts = []
    for options in STARTS:
        r = solve(name, seconds, **options)
        label = ", ".join(str(v) for v in options.values()) or "default"
        if r["solved"]:
            z = descent.of_result(r["result"])
            try:
                cost, _, c, _, low, high = descent.run(z)
            except (FloatingPointError, SwitchbackError):
                continue
            found.append((f"ours, {label}", cost, descent.violation(c, low, high)))
            starts.append((cost + 1e3 * found[-1][2], f"ours, {label}", z))
    starts = sorted(starts, key=lambda s: s[0])
    starts = [s for i, s in enumerate(starts) if i == 0 or abs(s[0] - starts[i - 1][0]) > 1e-5 * (1 + abs(s[0]))][:2]
    guesses = [(label, z) for _, label, z in starts]
    smooth = optima_peers.smoothed(statement, budget=1.5 * seconds)
    if smooth is not None:
        guesses.append(("smoothing", descent.pack(*smooth)))
    if not guesses:
        z = descent.pack(statement.middle(), statement.durations, statement.params, statement.start())
        guesses.append(("middle of the bounds", z))
    for label, z in guesses:
        best = descent.minimise(z, seconds)
        if best is not None:
            found.append((f"descent from {label}", best[0], best[1]))
    met = [(cost, how) for how, cost, violation in found if violation < CONFIRMED]
    cost, how = min(met) if met else (None, "")
    return {
        "name": name, "category": p.category, "note": p.note, "stable": p.stable, "exact": p.exact, "best": cost, "found_by": how,
        "ways": [{"way": w, "cost": float(c), "violation": float(v)} for w, c, v in found],
    }  # fmt: skip


def keep(entry: dict[str, Any]) -> None:
    """Puts an entry on record, and the lower one of two costs."""
    store = known()
    old = store.get(entry["name"], {})
    if old.get("best") is not None and (entry["best"] is None or old["best"] < entry["best"]):
        entry |= {"best": old["best"], "found_by": old["found_by"]}
    store[entry["name"]] = entry
    listed = [store[name] for name in optima_problems.PROBLEMS if name in store]
    STORE.write_text(json.dumps({"problems": listed}, indent=1) + "\n")
    write_costs()


def costs() -> list[list[str]]:
    """The table that goes with the documents."""
    store, rows = known(), [["problem", "cost", "known", "motion"]]
    for name, p in optima_problems.PROBLEMS.items():
        cost = reference(name, store)
        kind, motion = "found" if p.exact is None else "exact", "stable" if p.stable else "unstable"
        rows.append([name, "" if cost is None else repr(float(cost)), kind, motion])
    return rows


def write_costs() -> None:
    COSTS.write_text("".join("\t".join(row) + "\n" for row in costs()))


def search(names: list[str], seconds: float) -> int:
    """Best known costs of these problems."""
    try:
        import optima_peers  # noqa: F401
    except ImportError as error:
        print(f"{error.name} is not installed: no peers")
        return 0
    for name in names:
        clock = time.perf_counter()
        try:
            entry = improve(name, seconds)
        except NotImplementedError as error:
            print(f"{name:<22}not for the peers: {error}")
            continue
        keep(entry)
        exact, best = entry["exact"], entry["best"]
        print(
            f"{name:<22}{best if best is not None else math.nan:14.8f}  {time.perf_counter() - clock:5.0f} s  {entry['found_by']}"
            + (f"  exact {exact:.8f}" if exact is not None else ""),
            flush=True,
        )
        for w in entry["ways"]:
            print(f"    {w['way']:<50}{w['cost']:14.8f}{w['violation']:9.1e}", flush=True)
    return 0


def plain(r: dict[str, Any]) -> dict[str, Any]:
    """What of a solve can be written down."""
    kept = {k: v for k, v in r.items() if k not in ("ocp", "result")}
    return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in kept.items()}


def option(parser: argparse.ArgumentParser, text: str) -> tuple[str, Any]:
    """Name and value of an option given as NAME=VALUE."""
    name, equals, value = text.partition("=")
    if not equals:
        parser.error(f"'{text}' is not of the form OPTION=VALUE")
    for kind in (int, float):
        try:
            return name, kind(value)
        except ValueError:
            continue
    return name, value


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="problems; none: all")
    parser.add_argument("--configurations", action="store_true", help="solve from other starts too")
    parser.add_argument("--peers", action="store_true", help="look for lower costs by other ways")
    parser.add_argument("--max-time", type=float, default=60.0, help="seconds for one solve")
    parser.add_argument("--set", action="append", default=[], metavar="OPTION=VALUE", help="an option of all solves")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    arguments = parser.parse_args()
    names = arguments.names or list(optima_problems.PROBLEMS)
    for name in names:
        if name not in optima_problems.PROBLEMS:
            parser.error(f"there is no problem '{name}'")

    options = dict(option(parser, text) for text in arguments.set)
    if arguments.peers:
        return search(names, min(arguments.max_time, 60.0))
    store, record = known(), []
    print(
        f"{'problem':<22}{'outcome':<12}{'polished':<14}{'certificate':<15}{'cost':>14}{'simulated':>14}{'E(T)':>9}"
        f"{'it':>6}{'seconds':>8}{'gap':>11}"
    )
    found = []
    for name in names:
        r = solve(name, arguments.max_time, **options)
        found.append(r)
        record.append(plain(r) | {"configuration": options})
        print(line(r, reference(name, store)), flush=True)
        for other in CONFIGURATIONS if arguments.configurations else []:
            r = solve(name, arguments.max_time, **options | other)
            record.append(plain(r) | {"configuration": other})
            text = f"{other['initial_guess']} {other['dcs_form']} {other['sigma_init']:g}"
            print(f"{line(r, reference(name, store))}  {text}", flush=True)
    print(summary(found, store))
    if arguments.json:
        arguments.json.write_text(json.dumps({"solves": record}, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
