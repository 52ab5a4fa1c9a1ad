"""Collections of programs with complementarity constraints, solved by this library and by homotopies around IPOPT.

usage: mpcc_collections.py NAME... [--seed N] [--count N] [--limit SECONDS] [--solvers NAME,...] [--lib FILE] [--set NAME=VALUE ...]
                           [--json FILE] [--profile FILE.svg]

A NAME is one of the collections of mpcc_statements.py (textbook, quadratic, bilevel, bent, boxes), of which all but the first are drawn
from the seed, --count of each; or a folder of files .nl of AMPL. Problems of both kinds are formulas, which the library
traces and CasADi differentiates: no Python runs inside a solve. Files with what the reader does not know are listed.

Solvers: switchback; and around IPOPT (pip install casadi; without it the library runs alone), with sigma = 1, 0.1, ..., 1e-9 and every
program solved to 1e-8 from the point before, until one is solved with all products at most 1e-7,
  scholtes   G H <= sigma                            (S. Scholtes, SIAM J. Optim. 11, 2001)
  elastic    min f + s / sigma, G H <= s, 0 <= s <= 10  (M. Anitescu, SIAM J. Optim. 15, 2005)
  smoothing  G + H = sqrt((G - H)^2 + 4 sigma^2)     (C. Kanzow, SIAM J. Matrix Anal. Appl. 17, 1996)
IPOPT has its adaptive barrier, and bounds are not relaxed.

A problem counts as solved if the solver says so and the point, evaluated by CasADi, violates nothing by more than 1e-6 and has no
product above 1e-7. Points of relaxations may lie below every point that is complementary. So the best objective is the least one of
points of which all pairs are zero to 1e-6, and of all points where there is none; within 1e-4 max(1, |f|) of it one counts as best. Every solver has a
process of its own, which is begun again after a crash. CPU seconds are those of the thread inside the solver."""

from __future__ import annotations

import argparse
import datetime
import json
import math
import os
import platform
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, Iterator

import numpy as np

import mpcc_profile
from mpcc_compare import distance, finite, geometric_mean, number
from mpcc_statements import GENERATORS, Statement, folder
from mpcc_switchback import load

SIGMA = [10.0**-k for k in range(10)]
PRODUCT, VIOLATION, EXACT, BEST = 1e-7, 1e-6, 1e-6, 1e-4
IPOPT = {
    "print_level": 0, "sb": "yes", "tol": 1e-8, "bound_relax_factor": 0.0, "max_iter": 3000, "mu_strategy": "adaptive",
    "mu_oracle": "quality-function",
}  # fmt: skip
BASELINES = ("scholtes", "elastic", "smoothing")
IDLE = 20.0  # times the limit of all problems that are left after which a process hangs


def statements(names: list[str], seed: int, count: int) -> Iterator[Statement | tuple[str, str]]:
    for name in names:
        if name in GENERATORS:
            yield from GENERATORS[name](seed, count)
        elif Path(name).is_dir():
            yield from folder(Path(name))
        else:
            raise SystemExit(f"{name} is neither a folder nor one of {', '.join(GENERATORS)}")


def sides(s: Statement) -> Iterator[tuple[int, int, bool, bool]]:
    """Boxes with the bounds that are finite and take part."""
    low, high = s.bounds
    for j, i, lower, upper in s.boxes:
        yield j, i, lower and low[j] > -math.inf, upper and high[j] < math.inf


# --- this library ---------------------------------------------------------------------------------------------


def switchback(swb: Any, s: Statement, options: dict[str, str], limit: float) -> dict:
    """Solve once with the library. Boxes in which a finite bound takes no part are pairs with a row more."""
    low, high = s.bounds
    whole, apart = [], []
    for (j, i, lower, upper), given in zip(sides(s), s.boxes):
        same = (lower, upper) == (low[j] > -math.inf, high[j] < math.inf)
        (whole if same else apart).append((j, i, lower, upper))

    def rows(x: Any) -> list[Any]:
        out = list(s.formulas(x, np)[1])
        for j, i, lower, upper in apart:
            # with one bound: F, or -F, and the distance from it; an equation without
            out[i] = -out[i] if upper and not lower else out[i]
            if lower or upper:
                out.append(x[j] - low[j] if lower else high[j] - x[j])
        return out

    row_low, row_high = (list(v) for v in s.rows)
    pairs = [tuple(swb.variable(i) if kind == "x" else swb.constraint(i) for kind, i in pair) for pair in s.pairs]
    for j, i, lower, upper in apart:
        if lower or upper:
            pairs.append((swb.constraint(i), swb.constraint(len(row_low))))
            row_low.append(0.0)
            row_high.append(math.inf)
    program = swb.Mpcc(
        s.n, lambda x: s.formulas(x, np)[0], rows if row_low else None, len(row_low) if row_low else None, bounds=s.bounds,
        constraint_bounds=(row_low, row_high) if row_low else None, pairs=pairs, boxes=[(j, i) for j, i, _, _ in whole],
        start=s.start, settings={"max_time": limit, **options},
    )  # fmt: skip
    clock = time.thread_time()
    r = program.solve()
    cpu = time.thread_time() - clock
    return {"claimed": r.success, "outcome": str(r.outcome), "x": r.x.tolist(), "iterations": r.stats.iterations, "cpu": cpu}


# --- CasADi and IPOPT -----------------------------------------------------------------------------------------


class Symbolic:
    """A statement in CasADi: pairs (G, H), and what measures a point. A box with both bounds has variables p, q of its own, for
    F = p - q."""

    def __init__(self, ca: Any, s: Statement):
        self.ca, self.s = ca, s
        x = ca.SX.sym("x", s.n)
        f, rows = s.formulas(np.array(ca.vertsplit(x), dtype=object), ca)
        low, high = (v.copy() for v in s.rows)
        pairs = [tuple(x[i] if kind == "x" else rows[i] for kind, i in pair) for pair in s.pairs]
        extra: list[Any] = []
        measures = [ca.fmin(g, h) for g, h in pairs]
        for j, i, lower, upper in sides(s):
            left, right, row = x[j] - s.bounds[0][j], s.bounds[1][j] - x[j], rows[i]
            if lower and upper:
                p, q = ca.SX.sym(f"p{i}"), ca.SX.sym(f"q{i}")
                extra += [p, q]
                rows[i], low[i], high[i] = row - p + q, 0.0, 0.0
                pairs += [(left, p), (right, q)]
                # what the program itself says of F: its positive part belongs to the lower bound
                measures += [ca.fmin(left, ca.fmax(row, 0)), ca.fmin(right, ca.fmax(-row, 0))]
            elif lower or upper:
                pair = (left, row) if lower else (right, -row)
                low[i], high[i] = (0.0, math.inf) if lower else (-math.inf, 0.0)
                pairs.append(pair)
                measures.append(ca.fmin(*pair))
            else:
                low[i], high[i] = 0.0, 0.0
        self.x, self.f = ca.vertcat(x, *extra), ca.SX(f)
        self.rows, self.low, self.high = ca.vertcat(*rows) if rows else ca.SX(0, 1), low, high
        self.g, self.h = (ca.vertcat(*(pair[k] for pair in pairs)) if pairs else ca.SX(0, 1) for k in (0, 1))
        self.extra = len(extra)
        plain = s.formulas(np.array(ca.vertsplit(x), dtype=object), ca)[1]
        free = {i for _, i, _, _ in s.boxes}
        kept = [i for i in range(s.m) if i not in free]
        at = [
            ca.SX(f), ca.vertcat(*(plain[i] for i in kept)) if kept else ca.SX(0, 1),
            ca.vertcat(*(ca.SX(v) for pair in pairs[: len(s.pairs)] for v in pair)) if s.pairs else ca.SX(0, 1),
            ca.vertcat(*measures) if measures else ca.SX(0, 1),
            ca.vertcat(*(plain[i] for j, i, a, b in sides(s) if not (a or b))) if free else ca.SX(0, 1),
        ]  # fmt: skip
        self.point, self.kept = ca.Function("point", [x], at), kept

    def measure(self, x: np.ndarray) -> tuple[float, float, float]:
        """Objective, violation, and the largest of the smaller members of pairs, of a point of the statement."""
        f, rows, members, least, equations = (np.asarray(v, float).ravel() for v in self.point(x))
        (l, u), (cl, cu) = self.s.bounds, self.s.rows
        over = [l - x, x - u, cl[self.kept] - rows, rows - cu[self.kept], -members, np.abs(equations), -least, np.zeros(1)]
        return float(f[0]), max(float(v.max()) for v in over if v.size), float(np.max(least, initial=0.0))

    def homotopy(self, mode: str, limit: float) -> dict:
        ca, s = self.ca, self.s
        sigma, variables, f = ca.SX.sym("sigma"), [self.x], self.f
        lbx, ubx = (np.r_[b, fill] for b, fill in zip(s.bounds, (np.zeros(self.extra), np.full(self.extra, math.inf))))
        start = np.r_[np.clip(s.start, *s.bounds), np.zeros(self.extra)]
        rows, low, high = [self.rows], [self.low], [self.high]
        k = self.g.numel()
        if mode == "smoothing":
            rows.append(self.g + self.h - ca.sqrt((self.g - self.h) ** 2 + 4 * sigma**2))
            low.append(np.zeros(k))
            high.append(np.zeros(k))
        else:
            product, bound = self.g * self.h, sigma
            if mode == "elastic":
                slack = ca.SX.sym("s")
                variables.append(slack)
                f, bound = f + slack / sigma, slack
                lbx, ubx, start = np.r_[lbx, 0.0], np.r_[ubx, 10.0], np.r_[start, 1.0]
            rows += [self.g, self.h, product - bound]
            low += [np.zeros(k), np.zeros(k), np.full(k, -math.inf)]
            high += [np.full(k, math.inf), np.full(k, math.inf), np.zeros(k)]
        options = {"ipopt": IPOPT | {"max_cpu_time": limit}, "print_time": False, "error_on_fail": False}
        nlp = {"x": ca.vertcat(*variables), "p": sigma, "f": f, "g": ca.vertcat(*rows)}
        solver = ca.nlpsol("homotopy", "ipopt", nlp, options)
        box = {"lbx": lbx, "ubx": ubx, "lbg": np.concatenate(low), "ubg": np.concatenate(high)}
        iterations, cpu, claimed, status, x = 0, 0.0, False, "none", start
        products = ca.Function("products", [self.x], [self.g * self.h])
        for value in SIGMA:
            clock = time.thread_time()
            found = solver(x0=x, p=value, **box)
            cpu += time.thread_time() - clock
            stats = solver.stats()
            iterations += stats["iter_count"]
            status = stats["return_status"]
            x = np.asarray(found["x"], float).ravel()
            small = float(np.max(np.asarray(products(x[: self.x.numel()]), float), initial=0.0)) <= PRODUCT
            claimed = status in ("Solve_Succeeded", "Solved_To_Acceptable_Level") and small
            if claimed or cpu > limit:
                break
        return {"claimed": claimed, "outcome": status, "x": x[: s.n].tolist(), "iterations": iterations, "cpu": cpu}


# --- processes ------------------------------------------------------------------------------------------------


def work(args: argparse.Namespace, skip: int) -> None:
    """What a process does: a line of JSON for every problem from the `skip`-th on."""
    try:
        import casadi as ca
    except ImportError:
        ca = None
    swb = load(args.lib) if args.solver == "switchback" else None
    options = dict(o.split("=", 1) for o in args.set)
    for k, s in enumerate(statements(args.names, args.seed, args.count)):
        if k < skip:
            continue
        if isinstance(s, tuple):
            print(json.dumps({"at": k, "name": s[0], "unread": s[1]}), flush=True)
            continue
        try:
            symbolic = Symbolic(ca, s) if ca else None
            if swb:
                r = switchback(swb, s, options, args.limit)
            else:
                r = symbolic.homotopy(args.solver, args.limit)
            r["solved"] = r["claimed"]
            if symbolic:
                r["objective"], r["violation"], r["pair_min"] = symbolic.measure(np.array(r["x"]))
                r["solved"] = r["claimed"] and r["violation"] <= VIOLATION and r["pair_min"] <= math.sqrt(PRODUCT)
        except Exception as error:  # one result among others
            r = {"solved": False, "claimed": False, "outcome": f"{type(error).__name__}: {error}"[:200], "iterations": 0, "cpu": 0.0}
        r.pop("x", None)
        size = {"n": s.n, "m": s.m, "pairs": len(s.pairs) + len(s.boxes)}
        print(json.dumps(finite({"at": k, "name": s.name, **size, **r})), flush=True)


def run(args: argparse.Namespace, solver: str, given: list[str], total: int) -> list[dict]:
    """All results of one solver, from a process that is begun again after the problem at which it died."""
    found: dict[int, dict] = {}
    while len(found) < total:
        skip = max(found, default=-1) + 1
        command = [sys.executable, __file__, *given, "--solver", solver, "--skip", str(skip)]
        try:
            done = subprocess.run(
                command, stdout=subprocess.PIPE, text=True, timeout=IDLE * args.limit * (total - skip), check=False
            ).stdout
        except subprocess.TimeoutExpired as late:
            done = late.stdout.decode() if isinstance(late.stdout, bytes) else late.stdout or ""
        for line in done.splitlines():
            if line.startswith("{"):
                r = json.loads(line)
                found[r["at"]] = r
        at = max(found, default=-1) + 1
        if at < total and at not in found:
            found[at] = {"at": at, "name": f"problem {at}", "solved": False, "outcome": "crash", "iterations": 0, "cpu": 0.0}
    return [found[k] for k in range(total)]


def table(results: dict[str, list[dict]], n: int) -> list[str]:
    """Rows of a page: of every solver what it solved, how often best, and ratios to the first solver."""
    first = next(iter(results))
    best = []
    for k in range(n):
        points = [r[k] for r in results.values() if r[k]["solved"] and r[k].get("objective") is not None]
        exact = [r for r in points if r["pair_min"] <= EXACT]
        best.append(min((r["objective"] for r in exact or points), default=None))
    lines = ["| solver | solved | best objective | only here | iterations | CPU seconds | iteration ratio | CPU ratio |", "|---|---|---|---|---|---|---|---|"]
    for name, rows in results.items():
        solved = [k for k in range(n) if rows[k]["solved"]]
        good = sum(best[k] is not None and distance(rows[k]["objective"], best[k]) <= BEST for k in solved)
        alone = sum(not any(r[k]["solved"] for other, r in results.items() if other != name) for k in solved)
        both = [k for k in solved if results[first][k]["solved"]]
        ratio = lambda of, least: geometric_mean(  # noqa: E731
            max(rows[k][of], least) / max(results[first][k][of], least) for k in both  # noqa: B023
        )
        lines.append(
            f"| {name} | {len(solved)} of {n} | {good} | {alone} | {sum(rows[k]['iterations'] for k in both)} | "
            f"{sum(rows[k]['cpu'] for k in both):.2f} | {number(ratio('iterations', 1), '.2f')} | {number(ratio('cpu', 1e-6), '.2f')} |"
        )
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="+", metavar="NAME")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--limit", type=float, default=10.0)
    parser.add_argument("--solvers", default=",".join(("switchback", *BASELINES)))
    parser.add_argument("--lib")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--profile", type=Path)
    parser.add_argument("--solver", help=argparse.SUPPRESS)
    parser.add_argument("--skip", type=int, default=0, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.solver:
        work(args, args.skip)
        return
    solvers = args.solvers.split(",")
    unknown = set(solvers) - {"switchback", *BASELINES}
    if unknown:
        parser.error(f"no solver {', '.join(sorted(unknown))}: there are switchback, {', '.join(BASELINES)}")
    try:
        import casadi  # noqa: F401
    except ImportError:
        print("CasADi is missing: the library runs alone, and its points are not measured anew")
        solvers = [s for s in solvers if s == "switchback"]
    total = sum(1 for _ in statements(args.names, args.seed, args.count))
    if not total:
        raise SystemExit("there are no problems")
    given = [*args.names, "--seed", str(args.seed), "--count", str(args.count), "--limit", str(args.limit)]
    given += [f"--set={o}" for o in args.set] + (["--lib", os.path.abspath(args.lib)] if args.lib else [])
    results = {s: run(args, s, given, total) for s in solvers}
    unread = [r for r in next(iter(results.values())) if "unread" in r]
    kept = [k for k in range(total) if all("unread" not in r[k] for r in results.values())]
    results = {s: [r[k] for k in kept] for s, r in results.items()}
    for k in range(len(kept)):
        row = [r[k] for r in results.values()]
        cells = (
            f"{'' if r['solved'] else '!'}{number(r.get('objective'), '.6e')} {r['iterations']:4d} {1e3 * r['cpu']:8.1f} ms"
            for r in row
        )
        print(f"{row[0]['name'][:24]:<24} " + " | ".join(cells))
    for r in unread:
        print(f"{r['name'][:24]:<24} not read: {r['unread']}")
    print(f"\n{datetime.date.today()}, {platform.machine()}, {os.cpu_count()} cores, {' '.join(given)}\n")
    print("\n".join(table(results, len(kept))))
    for name, rows in results.items():
        missed = [r["name"] for r in rows if not r["solved"]]
        if missed:
            print(f"\nnot solved by {name} ({len(missed)}): {', '.join(missed)}")
    if args.json:
        args.json.write_text(json.dumps({"command": given, "results": results, "unread": unread}, indent=1) + "\n")
    if args.profile and results:
        costs = {s: [max(r["iterations"], 1) if r["solved"] else None for r in rows] for s, rows in results.items()}
        mpcc_profile.write(args.profile, f"{len(kept)} programs", "iterations", costs)


if __name__ == "__main__":
    main()
