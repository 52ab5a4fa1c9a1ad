"""Are the claims of our MPCC solver true? A judge that shares nothing with it but the functions of the problems.

usage: mpcc_judge.py [--problems DIR] [--set-of NAME] [--only REGEX] [--limit SECONDS] [--lib FILE] [--set NAME=VALUE ...]
                     [--ipopt-cache FILE] [--json FILE]

Every problem is solved, and what the solver says of its point is checked with functions and derivatives evaluated anew
and programs of scipy's HiGHS:

solved      bounds, rows and signs of the pairs are violated by at most 1e-6 of their size, products are at most 1e-7.
B           no step that is feasible to first order lowers the objective. Steps are bounded by 1e-3 of the size of the
            variables; at pairs with two zero members either of them may grow, which is a mixed-integer linear program over
            all branches. A fall of more than 1e-4 of the largest one that the gradient allows refutes the claim.
S           the same for the program in which both members may grow.
infeasible  no such step lowers the violation of the rows, where it is measured as docs/mpcc_method.md says; and no solution is
            known, nor found by IPOPT where `--ipopt-cache` has its answers, in whatever mode (`mpcc_train.py` writes it).

A gradient counts from 1e-8 of its terms, the second derivatives of the objective times the variables (or 1): what is left
of it at the minimum of a sum of squares is rounding. So the objective may have any unit.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import sys
import tempfile
from pathlib import Path

import numpy as np
import scipy.optimize
import scipy.sparse

import mpcc_switchback
import mpcc_train
from mpcc_problems import Problem

VIOLATION, PRODUCT = 1e-6, 1e-7
RADIUS = 1e-3  # of a step, relative to max(1, |x|)
FALL = 1e-4  # of what a step of that radius can gain at most
GRADIENT = 1e-8  # of its terms
ZERO = 1e-6  # a member of a pair, relative to the size of its terms
SECONDS = 30.0  # of one linear program


class Point:
    """Functions and derivatives of a problem at a point."""

    def __init__(self, problem: Problem, x: np.ndarray):
        p = self.problem = problem
        raw = p.raw
        rows = np.ctypeslib.as_array(raw.jac_row, (raw.jac_nnz,)) if raw.jac_nnz else np.empty(0, int)
        cols = np.ctypeslib.as_array(raw.jac_col, (raw.jac_nnz,)) if raw.jac_nnz else np.empty(0, int)
        self.x = x
        self.gradient = p._call("grad", x, None, p.n)
        self.con = p._call("con", x, None, p.rows)
        values = p._call("jac", x, None, raw.jac_nnz)
        self.jac = scipy.sparse.csr_matrix((values, (rows, cols)), shape=(p.rows, p.n))
        hess = p._call("hess", x, np.concatenate([[1.0], np.zeros(p.rows)]), raw.hess_nnz)
        h = scipy.sparse.coo_matrix((np.abs(hess), (p.hess_row, p.hess_col)), shape=(p.n, p.n)).tocsr()
        size = np.maximum(1.0, np.abs(x))
        self.rounding = GRADIENT * (h @ size + h.T @ size)
        self.terms = np.abs(self.jac) @ np.abs(x) + np.abs(self.con)
        self.radius = RADIUS * np.maximum(1.0, np.abs(x))


def bounded(low: np.ndarray, high: np.ndarray, value: np.ndarray, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of a step, which allow none at all even where the point is a little outside."""
    return np.clip(low - value, -radius, 0.0), np.clip(high - value, 0.0, radius)


def best_step(at: Point, strong: bool) -> float | None:
    """The largest fall of the objective over steps that are feasible to first order, relative to the largest the gradient
    allows; None where the program is not solved. `strong`: both members of a pair may grow where both are zero."""
    p = at.problem
    reach = np.abs(at.gradient) @ at.radius
    if np.all(np.abs(at.gradient) <= at.rounding.max(initial=0.0)):
        return 0.0
    lower, upper = bounded(p.lbx, p.ubx, at.x, at.radius)
    g, pairs = at.con[: p.m], at.con[p.m :]
    row_low, row_high = np.minimum(p.lbg - g, 0.0), np.maximum(p.ubg - g, 0.0)
    zero = np.abs(pairs) <= ZERO * np.maximum(1.0, at.terms[p.m :])
    biactive = zero[: p.c] & zero[p.c :]
    pair_low = np.minimum(-pairs, 0.0)
    pair_high = np.full(2 * p.c, np.inf)
    held = np.where(np.tile(biactive, 2), False, np.concatenate([pairs[: p.c] <= pairs[p.c :], pairs[: p.c] > pairs[p.c :]]))
    pair_high[held] = 0.0
    pair_low[held] = 0.0
    rows, low, high = at.jac, np.concatenate([row_low, pair_low]), np.concatenate([row_high, pair_high])
    which = np.flatnonzero(biactive) if not strong else np.empty(0, int)
    k = len(which)
    cost, integrality = np.concatenate([at.gradient, np.zeros(k)]), np.concatenate([np.zeros(p.n), np.ones(k)])
    constraints = [(scipy.sparse.hstack([rows, scipy.sparse.csr_matrix((p.rows, k))]), low, high)]
    if k:
        # a member grows by at most `most`; of every pair one does, by its binary variable
        first, second = at.jac[p.m + which], at.jac[p.m + p.c + which]
        sign = ((first, -1.0, 0.0), (second, 1.0, 1.0))
        for member, factor, shift in sign:
            most = np.abs(member) @ at.radius
            matrix = scipy.sparse.hstack([member, scipy.sparse.diags(factor * most)])
            constraints.append((matrix, np.full(k, -np.inf), shift * most))
    # in steps of size one: the tolerances of the solver are absolute, and times multipliers they count as a fall
    unit = np.concatenate([np.full(p.n, RADIUS), np.ones(k)])
    columns = scipy.sparse.diags(unit)
    result = scipy.optimize.milp(
        cost * unit / reach,
        constraints=[
            scipy.optimize.LinearConstraint((m @ columns / RADIUS).tocsr(), lo / RADIUS, hi / RADIUS)
            for m, lo, hi in constraints
            if m.shape[0]
        ],
        bounds=scipy.optimize.Bounds(np.concatenate([lower, np.zeros(k)]) / unit, np.concatenate([upper, np.ones(k)]) / unit),
        integrality=integrality,
        options={"time_limit": SECONDS},
    )
    return None if result.x is None else max(0.0, -float(result.fun))


def weights(problem: Problem) -> np.ndarray:
    """Those of the rows in the violation, as docs/mpcc_method.md says: powers of two that make the largest derivative at the start 1 to
    2, where a violation there counts by its 1024th part, and a function in a pair that has no derivatives by its value."""
    start = Point(problem, problem.x0)
    steepest = np.asarray(np.abs(start.jac).max(axis=1).todense()).ravel() if problem.rows else np.empty(0)
    low = np.concatenate([problem.lbg, np.zeros(2 * problem.c)])
    high = np.concatenate([problem.ubg, np.full(2 * problem.c, np.inf)])
    member = np.arange(problem.rows) >= problem.m
    flat = member & (steepest == 0.0)
    steepest[flat] = np.abs(start.con[flat]) * (np.abs(start.con[flat]) > 1e-8)
    beyond = np.maximum(low - start.con, start.con - high)
    steepest = np.maximum(steepest, np.where(member, 0.0, beyond / 1024.0))
    out = np.ones(problem.rows)
    some = steepest > 0.0
    out[some] = np.exp2(-np.floor(np.log2(steepest[some])))
    return out


def less_violated(at: Point) -> float | None:
    """By how much a step can lower the violation to first order, relative to what it is and can become: the sum over rows, and
    over pairs of functions the distance from the axes in the 1-norm. Variables in one pair stay on the axes."""
    p = at.problem
    w = weights(p)
    member = p.variable_members()
    lower, upper = bounded(p.lbx, p.ubx, at.x, at.radius)
    v = p.pair_variables
    lower[v[member]] = np.maximum(lower[v[member]], -at.x[v[member]])
    n, rows, c = p.n, p.rows, p.c
    # variables: step, over and under of every row, value of every member, side of every pair
    total = n + 2 * rows + 2 * c + c
    columns = {name: slice(*ends) for name, ends in
               (("d", (0, n)), ("over", (n, n + rows)), ("under", (n + rows, n + 2 * rows)),
                ("value", (n + 2 * rows, n + 2 * rows + 2 * c)), ("side", (n + 2 * rows + 2 * c, total)))}  # fmt: skip
    eye = scipy.sparse.identity(rows, format="csr")
    first = scipy.sparse.vstack([scipy.sparse.csr_matrix((p.m, 2 * c)), -scipy.sparse.identity(2 * c)]) if c else scipy.sparse.csr_matrix((rows, 0))
    matrix = scipy.sparse.hstack([at.jac, -eye, eye, first, scipy.sparse.csr_matrix((rows, c))]).tocsr()
    low = np.concatenate([p.lbg, np.zeros(2 * c)]) - at.con
    high = np.concatenate([p.ubg, np.zeros(2 * c)]) - at.con
    cost = np.zeros(total)
    cost[columns["over"]] = cost[columns["under"]] = w
    lo, hi = np.zeros(total), np.full(total, np.inf)
    lo[columns["d"]], hi[columns["d"]] = lower, upper
    # members that are variables of one pair are met exactly; of several, every pair has a copy, which is a function
    used = np.bincount(v[member], minlength=p.n)
    exact = np.concatenate([np.zeros(p.m, bool), member & (np.where(member, used[v], 0) == 1)])
    hi[columns["over"]][exact] = hi[columns["under"]][exact] = 0.0
    most = np.maximum(at.con[p.m :], 0.0) + np.abs(at.jac[p.m :]) @ at.radius + 1.0 if c else np.empty(0)
    hi[columns["value"]] = most
    hi[columns["side"]] = 1.0
    constraints = [scipy.optimize.LinearConstraint(matrix, low, high)]
    if c:
        # value of G at most (1 - side) times its largest, value of H at most side times its largest
        g = scipy.sparse.hstack([scipy.sparse.csr_matrix((c, n + 2 * rows)), scipy.sparse.identity(c),
                                 scipy.sparse.csr_matrix((c, c)), scipy.sparse.diags(most[:c])])  # fmt: skip
        h = scipy.sparse.hstack([scipy.sparse.csr_matrix((c, n + 2 * rows + c)), scipy.sparse.identity(c),
                                 scipy.sparse.diags(-most[c:])])  # fmt: skip
        constraints += [scipy.optimize.LinearConstraint(g.tocsr(), -np.inf, most[:c]),
                        scipy.optimize.LinearConstraint(h.tocsr(), -np.inf, 0.0)]  # fmt: skip
    integrality = np.zeros(total)
    integrality[columns["side"]] = 1.0

    def least(radius: float) -> float | None:
        """A side that is an integer to within a tolerance lets both members grow a little: sides are fixed, and members
        that have to be zero are."""
        lo[columns["d"]], hi[columns["d"]] = radius * lower, radius * upper
        result = scipy.optimize.milp(
            cost, constraints=constraints, bounds=scipy.optimize.Bounds(lo, hi), integrality=integrality,
            options={"time_limit": SECONDS},
        )  # fmt: skip
        if result.x is None:
            return None
        second = result.x[columns["side"]] > 0.5
        fixed = hi.copy()
        fixed[columns["value"]] = np.where(np.concatenate([second, ~second]), 0.0, most)
        fixed[columns["side"]] = 1.0
        # the binaries take no part any more
        result = scipy.optimize.milp(cost, constraints=constraints[:1], bounds=scipy.optimize.Bounds(lo, fixed))
        return None if result.x is None else float(result.fun)

    here, there = least(0.0), least(1.0)
    if here is None or there is None:
        return None
    reach = float(w @ (np.abs(at.jac) @ at.radius))
    return max(0.0, here - there) / max(min(here, reach), 1e-300)


def known_feasible(entry: dict) -> bool:
    """Has anybody a solution, as recorded with the problem?"""
    if entry.get("known", {}).get("expect") == "infeasible":
        return False
    return "f" in entry.get("known", {}) or any(isinstance(v, dict) and v.get("solved") for v in entry.values())


def with_peers(entry: dict, name: str, cache: dict[str, dict]) -> dict:
    """The problem with IPOPT's answers to it."""
    return entry | {f"ipopt {key}": result for key, result in cache.items() if key.endswith(f"/{name}")}


def verdicts(problem: Problem, entry: dict, claim: dict) -> dict[str, str]:
    """For every claim: true, FALSE, or unknown, with the figure that decided."""
    out: dict[str, str] = {}
    at = Point(problem, np.array(claim["x"]))
    if claim["outcome"] == "infeasible":
        gain = less_violated(at)
        wrong = known_feasible(entry) or (gain is not None and gain > FALL)
        out["infeasible"] = "unknown" if gain is None and not wrong else ("FALSE" if wrong else "true") + f" {gain}"
        return out
    if not claim["claimed"]:
        return out
    point = problem.measure(at.x)
    size = max(1.0, float(at.terms.max(initial=0.0)))
    ok = point.violation <= VIOLATION * size and point.product <= PRODUCT
    if entry.get("known", {}).get("expect", "optimal") == "infeasible":
        ok = False
    out["solved"] = f"{'true' if ok else 'FALSE'} {point.violation:.1e} {point.product:.1e}"
    claimed = {"B": claim["b"], "S": claim["type"] == "S"}
    falls = {"S": best_step(at, True) if any(claimed.values()) else None, "B": best_step(at, False) if claimed["B"] else None}
    if None not in falls.values():
        # the steps of a branch are among those of S, whose program is linear: what a branch gains beyond is the tolerance
        # of its binary variables
        falls["B"] = min(falls.values())
    for name in (name for name in claimed if claimed[name]):
        fall = falls[name]
        out[name] = "unknown" if fall is None else f"{'true' if fall <= FALL else 'FALSE'} {fall:.1e}"
    return out


def judged(bench: mpcc_train.Bench, entry: dict, options: dict, limit: float, pipe) -> None:
    problem = Problem(bench.code, bench.problems / entry["file"], bench.seed)
    try:
        claim = mpcc_switchback.solve(bench.swb, problem, bench.members, options, limit)
        claim = {
            "outcome": claim["outcome"], "claimed": claim["solved"], "x": claim["x"], "type": claim.get("stationarity", ""),
            "b": claim.get("b_stationary"),
        }  # fmt: skip
        pipe.send({"outcome": claim["outcome"], "verdicts": verdicts(problem, entry, claim)})
    except BaseException as error:
        pipe.send({"outcome": f"{type(error).__name__}: {error}", "verdicts": {}})


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    mpcc_train.add_arguments(parser)
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="option of our solver")
    parser.add_argument("--json", help="write all verdicts to this file")
    arguments = parser.parse_args()
    arguments.ipopt = False
    problems = mpcc_train.chosen(arguments)
    if problems is None:
        return 0
    cache = json.loads(arguments.ipopt_cache.read_text()) if arguments.ipopt_cache else {}
    record = {}
    with tempfile.TemporaryDirectory() as folder:
        bench = mpcc_train.Bench(arguments, Path(folder))
        for name, entry in problems.items():
            here, there = multiprocessing.Pipe(duplex=False)
            options = mpcc_train.options_of(arguments.set)
            entry = with_peers(entry, name, cache)
            process = multiprocessing.get_context("fork").Process(
                target=judged, args=(bench, entry, options, arguments.limit, there)
            )
            process.start()
            there.close()
            record[name] = here.recv() if here.poll(10 * arguments.limit + 4 * SECONDS) else {"outcome": "hang", "verdicts": {}}
            process.kill()
            process.join()
            text = ", ".join(f"{k} {v}" for k, v in record[name]["verdicts"].items())
            print(f"{name:<55} {record[name]['outcome']:<11} {text}", flush=True)
    if arguments.json:
        Path(arguments.json).write_text(json.dumps(record, indent=1) + "\n")
    of = [(k, v.split()[0]) for r in record.values() for k, v in r["verdicts"].items()]
    for kind in ("solved", "B", "S", "infeasible"):
        count = {how: sum(k == kind and v == how for k, v in of) for how in ("true", "FALSE", "unknown")}
        print(f"{kind:<11} {count['true']} true, {count['FALSE']} false, {count['unknown']} not decided")
    return int(any(v == "FALSE" for _, v in of))


if __name__ == "__main__":
    sys.exit(main())
