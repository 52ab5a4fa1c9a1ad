"""What two solvers did on the same problems: figures of each problem, of each family and of all."""

from __future__ import annotations

import math
from typing import Any, Iterable

RELATIVE = 1e-5
EXACT = 1e-10


def family(name: str) -> str:
    return name.partition(":")[0]


def distance(f: float, reference: float) -> float:
    """How much worse f is than a reference, relative to max(1, |reference|)."""
    return (f - reference) / max(1.0, abs(reference))


def against_known(result: dict, known: dict) -> str:
    """ "" nothing known or not solved; "global", "local" (listed), "worse", "below" a global minimum, "better" than a
    local one, "right" where no solution exists."""
    if not result["solved"]:
        return ""
    if known.get("expect", "optimal") != "optimal":
        return "right"
    if "f" not in known:
        return ""
    f, best = result["objective"], known["f"]
    if abs(distance(f, best)) <= RELATIVE:
        return "global" if known.get("global", True) else "known"
    if f < best:
        return "below" if known.get("global", True) else "better"
    return "local" if any(abs(distance(f, g)) <= RELATIVE for g in known.get("local", [])) else "worse"


def row(name: str, entry: dict, ours: dict, peer: dict | None) -> dict:
    known = entry.get("known", {})
    out = {"name": name, "family": family(name), "expect": known.get("expect", "optimal"), "ours": ours, "peer": peer}
    out["known"] = against_known(ours, known)
    if peer:
        out["known_peer"] = against_known(peer, known)
    if peer and ours["solved"] and peer["solved"]:
        out["both"] = True
        out["cpu_ratio"] = peer["cpu"] / max(ours["cpu"], 1e-9)
        without = [r["cpu"] - r["functions"] for r in (peer, ours) if r.get("functions") is not None]
        if len(without) == 2:
            out["solver_ratio"] = max(without[0], 1e-9) / max(without[1], 1e-9)
        out["iteration_ratio"] = max(peer["iterations"], 1) / max(ours["iterations"], 1)
        if out["expect"] == "optimal":
            worth = peer["objective"] if peer.get("branch") is None else peer["branch"]
            out["worse_by"] = distance(ours["objective"], worth)
            out["no_worse"] = out["worse_by"] <= RELATIVE
            out["no_worse_than_relaxed"] = distance(ours["objective"], peer["objective"]) <= RELATIVE
    return out


def without_point(result: dict | None) -> dict | None:
    return None if result is None else {k: v for k, v in result.items() if k != "x"}


def finite(value: Any) -> Any:
    """A record for JSON, which has no numbers that are not finite: null instead."""
    if isinstance(value, dict):
        return {k: finite(v) for k, v in value.items()}
    if isinstance(value, list):
        return [finite(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def geometric_mean(values: Iterable[float]) -> float | None:
    logs = [math.log(v) for v in values if v > 0.0]
    return math.exp(sum(logs) / len(logs)) if logs else None


def share(flags: Iterable[bool]) -> float | None:
    flags = list(flags)
    return sum(flags) / len(flags) if flags else None


def share_of(rows: list[dict], whose: str) -> float | None:
    """Share of CPU seconds that are spent in the functions of the problems."""
    timed = [r[whose] for r in rows if r[whose].get("functions") is not None]
    return sum(r["functions"] for r in timed) / max(sum(r["cpu"] for r in timed), 1e-9) if timed else None


def summary(rows: list[dict]) -> dict:
    """Figures of some rows; None where there is nothing to count."""
    solved = [r["ours"] for r in rows if r["ours"]["solved"]]
    with_peer = [r for r in rows if r["peer"]]
    both = [r for r in rows if r.get("both")]
    points = [r for r in rows if r["ours"]["solved"] and r["expect"] == "optimal"]
    identified = [r for r in points if r["ours"].get("polished") == "done"]
    return {
        "problems": len(rows),
        "solved": len(solved),
        "peer_solved": sum(r["peer"]["solved"] for r in with_peer),
        "peer_problems": len(with_peer),
        "only_peer": [r["name"] for r in with_peer if r["peer"]["solved"] and not r["ours"]["solved"]],
        "only_ours": [r["name"] for r in with_peer if r["ours"]["solved"] and not r["peer"]["solved"]],
        "neither": [r["name"] for r in with_peer if not r["ours"]["solved"] and not r["peer"]["solved"]],
        "no_worse": share(r["no_worse"] for r in both if "no_worse" in r),
        "no_worse_than_relaxed": share(r["no_worse_than_relaxed"] for r in both if "no_worse" in r),
        "better": [r["name"] for r in both if r.get("worse_by", 0.0) < -RELATIVE],
        "worse": [r["name"] for r in both if not r.get("no_worse", True)],
        "cpu_ratio": geometric_mean(r["cpu_ratio"] for r in both),
        "solver_ratio": geometric_mean(r.get("solver_ratio", 0.0) for r in both),
        "functions_share": share_of(both, "ours"),
        "functions_share_peer": share_of(both, "peer"),
        "iteration_ratio": geometric_mean(r["iteration_ratio"] for r in both),
        "cpu_ours": sum(r["ours"]["cpu"] for r in both),
        "cpu_peer": sum(r["peer"]["cpu"] for r in both),
        "iterations_ours": sum(r["ours"]["iterations"] for r in both),
        "iterations_peer": sum(r["peer"]["iterations"] for r in both),
        "identified": share(r in identified for r in points),
        "exact": share(r["ours"]["pair_min"] <= EXACT for r in points),
        "exact_of_identified": share(r["ours"]["pair_min"] <= EXACT for r in identified),
        "claimed_but_not_solved": [
            r["name"] for r in rows
            if r["expect"] == "optimal" and r["ours"]["claimed"] and not r["ours"]["solved"]
        ],
        "known": {
            kind: [r["name"] for r in rows if r["known"] == kind]
            for kind in ("global", "known", "better", "local", "right", "worse", "below")
        },
    }  # fmt: skip


def compare(problems: dict[str, dict], ours: dict[str, dict], peer: dict[str, dict]) -> dict:
    """Rows and summaries; the peer may have run on none or some of the problems."""
    rows = [row(n, entry, without_point(ours[n]), without_point(peer.get(n))) for n, entry in problems.items()]
    families = sorted({r["family"] for r in rows})
    return {
        "problems": rows,
        "summary": summary(rows),
        "families": {f: summary([r for r in rows if r["family"] == f]) for f in families},
    }


def number(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)


def milliseconds(result: dict | None) -> float | None:
    return None if result is None or result["cpu"] is None else 1e3 * result["cpu"]


def table(record: dict) -> str:
    """The record as text."""
    lines = [
        f"{'problem':<50} {'ours':>10} {'peer':>10} {'objective':>15} {'worse by':>9} {'viol':>7} {'product':>7} "
        f"{'min(G,H)':>8} {'it':>5} {'peer':>5} {'ms':>9} {'peer':>9} {'ratio':>6}  known"
    ]
    for r in record["problems"]:
        ours, peer = r["ours"], r["peer"]
        how = ("" if ours["solved"] else "!") + ours["outcome"]
        polish = {"done": "*", "rejected": "-"}.get(ours.get("polished", ""), " ")
        other = ("" if peer["solved"] else "!") + peer["outcome"] if peer else "-"
        lines.append(
            f"{r['name'][:50]:<50} {how[:9]:>9}{polish} {other[:10]:>10} {number(ours['objective'], '15.8e'):>15} "
            f"{number(r.get('worse_by'), '9.1e'):>9} {number(ours['violation'], '7.0e'):>7} "
            f"{number(ours['product'], '7.0e'):>7} {number(ours['pair_min'], '8.0e'):>8} {ours['iterations']:>5} "
            f"{peer['iterations'] if peer else '-':>5} {number(milliseconds(ours), '9.3f'):>9} "
            f"{number(milliseconds(peer), '9.2f'):>9} {number(r.get('cpu_ratio'), '6.1f'):>6}  {r['known']}"
        )
    lines += [
        "",
        "ours: ! not solved, * active set identified, - branch rejected",
        "worse by: objective against what the peer's point is worth, relative",
        "solver: CPU ratio without the time in functions, whose share of all seconds is func",
        "",
        "family     problems  ours  peer CPU ratio   solver it. ratio no worse  relaxed identified  exact  CPU ours      peer   func  peer",
    ]
    for name, s in [*record["families"].items(), ("all", record["summary"])]:
        lines.append(
            f"{name:<10} {s['problems']:>8} {s['solved']:>5} {s['peer_solved']:>5} {number(s['cpu_ratio'], '9.2f'):>9} "
            f"{number(s['solver_ratio'], '8.2f'):>8} {number(s['iteration_ratio'], '9.2f'):>9} {number(s['no_worse'], '8.1%'):>8} "
            f"{number(s['no_worse_than_relaxed'], '8.1%'):>8} "
            f"{number(s['identified'], '10.1%'):>10} {number(s['exact'], '6.1%'):>6} {s['cpu_ours']:>9.3f} "
            f"{s['cpu_peer']:>9.3f} {number(s['functions_share'], '6.1%'):>6} {number(s['functions_share_peer'], '5.1%'):>5}"
        )
    s = record["summary"]
    lines.append("")
    for key, text in (
        ("only_peer", "solved by the peer alone"),
        ("only_ours", "solved by us alone"),
        ("neither", "solved by neither"),
        ("claimed_but_not_solved", "claimed, but the point is none"),
        ("worse", "objective worse"),
        ("better", "objective better"),
    ):
        if s[key]:
            lines.append(f"{text} ({len(s[key])}): {', '.join(s[key])}")
    lines.append("against known answers: " + ", ".join(f"{k} {len(v)}" for k, v in s["known"].items() if v))
    for kind in ("local", "worse", "below"):
        if s["known"][kind]:
            lines.append(f"  {kind}: {', '.join(s['known'][kind])}")
    return "\n".join(lines)
