"""Do units matter? Problems of `optima_problems.py` stated again in random units: states, controls, parameters, time, cost,
constraints and switching functions multiplied by factors between 1e-6 and 1e6.

usage: units.py [NAME ...] [--changes N] [--decades D] [--seed S] [--json FILE]

A line has the problem, the cost in its own units, the changes with the same cost to 1e-6 (relative) and the same
certificate, and the smallest and largest iterations as multiples of those in its own units. The documents in
`benches/optima` are changed, so that nothing of the change is left to the library.
"""

from __future__ import annotations

import argparse
import copy
import json
import math
import random
import sys
from pathlib import Path
from typing import Any

import switchback_control as swb
from switchback_control import SwitchbackError

DOCUMENTS = Path(__file__).resolve().parents[3] / "benches" / "optima"
#: Of several kinds: free and fixed time, sliding, terminal constraints, bounds, least squares, parameters.
NAMES = [
    "snell_3", "gearbox_fuel", "landing", "voice_coil", "switched_lq", "thermostat", "relay_estimation", "lane_change",
    "two_masses", "blocks",
]  # fmt: skip
#: Costs that differ by less, relative, are the same.
SAME = 1e-6


class Units:
    """Factors that numbers in the new units have over those in the old ones."""

    def __init__(self, ocp: dict[str, Any], rng: random.Random, decades: float) -> None:
        def factor() -> float:
            return 10.0 ** rng.uniform(-decades, decades)

        system = ocp["system"]
        self.x = [factor() for _ in range(system["states"])]
        self.u = [factor() for _ in range(system["controls"])]
        self.p = [factor() for _ in range(system["parameters"])]
        self.t, self.cost = factor(), factor()
        self.factor = factor


def rewritten(f: dict[str, Any], units: Units, outputs: list[float]) -> None:
    """The function of inputs in the new units, its outputs multiplied by factors."""
    expressions = f["expressions"]
    nodes: list[list[Any]] = []
    place: list[int] = []

    def add(node: list[Any]) -> int:
        nodes.append(node)
        return len(nodes) - 1

    def times(at: int, factor: float) -> int:
        return add(["*", add(["const", factor]), at])

    for node in expressions["nodes"]:
        kind = node[0]
        if kind in ("x", "u", "p", "t"):
            factor = units.t if kind == "t" else getattr(units, kind)[node[1]]
            place.append(times(add(list(node)), 1.0 / factor))
        elif kind == "const":
            place.append(add(list(node)))
        elif kind == "powi":
            place.append(add([kind, place[node[1]], node[2]]))
        elif kind in ("+", "-", "*", "/", "neg", "sin", "cos", "exp"):
            place.append(add([kind, *(place[a] for a in node[1:])]))
        else:
            raise ValueError(f"{kind} is not known here")
    expressions["roots"] = [times(place[r], k) for r, k in zip(expressions["roots"], outputs)]
    expressions["nodes"] = nodes


def multiply(bounds: dict[str, list[Any]], factors: list[float]) -> None:
    for side in ("lower", "upper"):
        bounds[side] = [v * k if isinstance(v, float) and math.isfinite(v) else v for v, k in zip(bounds[side], factors)]


def in_units(document: dict[str, Any], units: Units) -> dict[str, Any]:
    """The same problem in other units."""
    out = copy.deepcopy(document)
    ocp = out["ocp"]
    system = ocp["system"]
    rates = [x / units.t for x in units.x]
    if "f0" in system:
        rewritten(system["f0"], units, rates)
    for s in system["subsystems"]:
        rewritten(s["modes"], units, [rates[r] for r in s["rows"]] * s["n_modes"])
        psi = s["regions"]["signs"]["psi"]
        rewritten(psi, units, [units.factor() for _ in range(psi["signature"]["outputs"])])
    if "lagrange" in ocp:
        rewritten(ocp["lagrange"], units, [units.cost / units.t])
    if "mayer" in ocp:
        rewritten(ocp["mayer"], units, [units.cost])
    for term in ocp.get("least_squares", []):
        # an integral has the unit of time in it, a sum has not
        cost = units.cost / (units.t if term["place"] == "running" else 1.0)
        factors = [units.factor() for _ in range(term["f"]["signature"]["outputs"])]
        rewritten(term["f"], units, factors)
        term["weights"] = [w * cost / k**2 for w, k in zip(term["weights"], factors)]
        references = term["references"]
        term["references"] = [r * factors[i % len(factors)] for i, r in enumerate(references)]
    for c in ocp.get("constraints", []):
        factors = [units.factor() for _ in range(c["f"]["signature"]["outputs"])]
        if c["at"] == "both_ends":
            raise ValueError("constraints of both ends are not known here")
        rewritten(c["f"], units, factors)
        multiply(c["bounds"], factors)
    for name, factors in [("state_bounds", units.x), ("initial_bounds", units.x), ("param_bounds", units.p)]:
        if name in ocp:
            multiply(ocp[name], factors)
    multiply(ocp["control_bounds"], units.u)
    ocp["params"] = [v * k for v, k in zip(ocp["params"], units.p)]
    ocp["horizon"] *= units.t
    ocp["t0"] *= units.t
    time = ocp.get("time", {})
    if time:
        time["durations"] = [v * units.t for v in time["durations"]]
        if "bounds" in time:
            multiply(time["bounds"], [units.t] * len(time["bounds"]["lower"]))
    return out


def solve(document: dict[str, Any]) -> dict[str, Any]:
    ocp = swb.Ocp.from_json(json.dumps(document))
    try:
        r = ocp.solve()
    except SwitchbackError as e:
        return {"outcome": type(e).__name__, "cost": math.nan, "iterations": 0, "certificate": "unknown"}
    return {
        "outcome": r.outcome.name.lower(),
        "cost": r.cost,
        "iterations": r.stats.iterations,
        "certificate": str(r.certificate),
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", default=NAMES)
    parser.add_argument("--changes", type=int, default=40)
    parser.add_argument("--decades", type=float, default=6.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json")
    args = parser.parse_args()
    report: dict[str, Any] = {}
    good = close = total = 0
    for name in args.names:
        document = json.loads((DOCUMENTS / f"{name}.json").read_text())
        own = solve(document)
        rng = random.Random(f"{name} {args.seed}")
        changes = []
        for _ in range(args.changes):
            units = Units(document["ocp"], rng, args.decades)
            one = solve(in_units(document, units))
            one["cost"] /= units.cost
            one["same"] = abs(one["cost"] - own["cost"]) <= SAME * abs(own["cost"])
            one["ratio"] = one["iterations"] / max(own["iterations"], 1)
            changes.append(one)
        same = sum(c["same"] for c in changes)
        alike = sum(0.7 <= c["ratio"] <= 1.3 for c in changes)
        verdicts = sum(c["certificate"] == own["certificate"] for c in changes)
        ratios = [c["ratio"] for c in changes]
        good, close, total = good + same, close + alike, total + len(changes)
        print(
            f"{name:20s} {own['outcome']:10s} {own['cost']:14.8f}  same cost {same}/{len(changes)}"
            f"  same certificate {verdicts}  iterations {own['iterations']} x {min(ratios):.2f} to {max(ratios):.2f}"
            f"  ({alike} within 30%)",
            flush=True,
        )
        report[name] = {"own": own, "changes": changes}
    print(f"{total} changes of units: the same optimum in {good / total:.1%}, iterations within 30% in {close / total:.1%}")
    if args.json:
        Path(args.json).write_text(json.dumps(report, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
