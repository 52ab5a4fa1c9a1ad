"""Are the answers optimal? Problems of `optima_problems.py` from the default start, one line each.

usage: optima.py [NAME ...] [--configurations] [--max-time S] [--json FILE]

A line has outcome, whether the modes were polished, the certificate, the cost, the cost and the distance at the end when
the controls are simulated by events, iterations and seconds. `gap` is the distance from the exact or the best known cost,
relative, where there is one. `--configurations` solves from other starts too: forms, first relaxations and guesses.
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

from switchback import SwitchbackError

#: What other starts are made of; the first one is the default.
CONFIGURATIONS = [
    {"dcs_form": form, "sigma_init": sigma, "initial_guess": guess}
    for guess, form, sigma in itertools.product(
        ("constant", "simulation", "smoothed", "time_stepping"), ("stewart", "heaviside"), (1.0, 10.0, 100.0)
    )
]
#: Costs this close to the best known, relative, are as good, and so are differences that are as small as the second number.
SAME, TINY = 1e-3, 1e-7
#: A simulation that ends this close to the answer confirms it.
CONFIRMED = 1e-5
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
    good = sum(r["solved"] and gap(r["cost"], b) <= SAME for r, b in rated)
    stable = [r for r in solved if optima_problems.PROBLEMS[r["name"]].stable]
    seconds = [r["seconds"] for r in found if "seconds" in r]
    mean = math.exp(sum(map(math.log, seconds)) / len(seconds)) if seconds else math.nan
    return (
        f"{n} problems: {len(solved)} solved, {sum(r['polished'] == 'done' for r in solved)} polished, "
        f"{good} of {len(rated)} within {SAME:.1%} of the exact or best known cost, "
        f"E(T) <= {CONFIRMED:g} in {sum(r['error'] <= CONFIRMED for r in stable)} of {len(stable)} stable ones, "
        f"{sum(r.get('iterations', 0) for r in found)} iterations, {sum(seconds):.1f} s, geometric mean {mean:.3f} s"
    )


def plain(r: dict[str, Any]) -> dict[str, Any]:
    """What of a solve can be written down."""
    kept = {k: v for k, v in r.items() if k not in ("ocp", "result")}
    return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in kept.items()}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="problems; none: all")
    parser.add_argument("--configurations", action="store_true", help="solve from other starts too")
    parser.add_argument("--max-time", type=float, default=60.0, help="seconds for one solve")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    arguments = parser.parse_args()
    names = arguments.names or list(optima_problems.PROBLEMS)
    for name in names:
        if name not in optima_problems.PROBLEMS:
            parser.error(f"there is no problem '{name}'")

    store, record = known(), []
    print(
        f"{'problem':<22}{'outcome':<12}{'polished':<14}{'certificate':<15}{'cost':>14}{'simulated':>14}{'E(T)':>9}"
        f"{'it':>6}{'seconds':>8}{'gap':>11}"
    )
    found = []
    for name in names:
        r = solve(name, arguments.max_time)
        found.append(r)
        record.append(plain(r) | {"configuration": {}})
        print(line(r, reference(name, store)), flush=True)
        for options in CONFIGURATIONS if arguments.configurations else []:
            r = solve(name, arguments.max_time, **options)
            record.append(plain(r) | {"configuration": options})
            text = f"{options['initial_guess']} {options['dcs_form']} {options['sigma_init']:g}"
            print(f"{line(r, reference(name, store))}  {text}", flush=True)
    print(summary(found, store))
    if arguments.json:
        arguments.json.write_text(json.dumps({"solves": record}, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
