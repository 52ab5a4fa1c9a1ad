"""usage: pairs.py [--sample N] [--seed S] [--starts K] [--page]    a control problem of every pair of ingredients, against a search that knows simulations alone

Each problem (matrix_models.py, three control stages, its start and its parameter drawn) is solved by default. Then scipy minimises the cost of
simulations, which Gauss quadrature integrates between all steps and events: from the solution, and from K random controls. Controls that choose are
enumerated. Nothing of that uses what the solver knows.

    off        the cost that is reported, and that of a simulation of the controls
    gain       what the minimisation from the solution gains, relative to the cost
    best       the lowest cost of all starts, relative to that of the solution: below -1e-6 it is lower
    verdict    what the solver says

--sample N     N rows, drawn with the seed
--starts K     random starts of the search, 6
--page         the page docs/benchmarks/pairs.md
"""

import argparse
import datetime
import itertools
import platform
import random
import sys
import time
import warnings
from pathlib import Path

import numpy as np
import switchback_control as swb
from scipy.optimize import minimize

sys.path.insert(0, str(Path(__file__).resolve().parent))

from matrix import TIGHT, Bench  # noqa: E402
from matrix_models import HORIZON, P0, CannotBeStated, rows  # noqa: E402

STAGES, BOUND = 3, 2.0
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(6)


class Problem:
    """The control problem of one row with a start and a parameter of its own."""

    def __init__(self, parts, seed):
        self.bench, self.case = Bench(parts), None
        self.case = self.bench.case
        rng = np.random.default_rng(seed)
        self.by, self.p = rng.uniform(-0.15, 0.15), P0 + rng.uniform(-0.05, 0.05)
        self.velocity = 2 if "bilateral" in parts else 1
        self.chooses = "choice" in parts

    def ocp(self):
        grid = {"n_fe": 4, "n_s": 4}
        ocp = self.bench.problem(p=self.p, by=self.by, stages=STAGES, **grid)
        return ocp

    def cost(self, u):
        """Of controls [stages, nu], by a simulation; infinite where that does not get to the end."""
        c = self.case
        run = swb.simulate(c.system, c.start(self.by), HORIZON, u=u, p=[self.p], **TIGHT)
        if not run.success:
            return np.inf
        times = np.unique(np.concatenate([run.t, HORIZON * np.arange(STAGES + 1) / STAGES]))
        left, length = times[:-1], np.diff(times)
        t = (left[:, None] + length[:, None] * (0.5 + 0.5 * _NODES)).ravel()
        w = (length[:, None] * 0.5 * _WEIGHTS).ravel()
        x = run(t)
        now = u[np.minimum((t / HORIZON * STAGES).astype(int), STAGES - 1)]
        rate = x[:, 0] ** 2 + 0.5 * x[:, self.velocity] ** 2 + 0.2 * now[:, 0] ** 2
        rate += 0.1 * now[:, 1] if self.chooses else 0.0
        return w @ rate + 2.0 * (run.x_end[0] - 0.2) ** 2

    def minimise(self, start, choice):
        """The end of a minimisation over the controls that do not choose."""

        def f(v):
            return self.cost(np.column_stack([v, choice]) if self.chooses else v[:, None])

        options = {"xatol": 1e-7, "fatol": 1e-10, "maxfev": 1200, "initial_simplex": simplex(start)}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return minimize(f, start, method="Nelder-Mead", bounds=[(-BOUND, BOUND)] * STAGES, options=options).fun

    def choices(self):
        return list(itertools.product((0.0, 1.0), repeat=STAGES)) if self.chooses else [None]


def simplex(start):
    """One around a point, within the bounds."""
    points = [start]
    for k in range(start.size):
        p = start.copy()
        p[k] += 0.2 if p[k] < BOUND - 0.2 else -0.2
        points.append(p)
    return np.array(points)


def judge(parts, seed, starts):
    """A row: costs, gains, verdict and seconds; a text where there is none."""
    try:
        problem = Problem(parts, seed)
        ocp = problem.ocp()
        begin = time.process_time()
        r = ocp.solve()
        seconds = time.process_time() - begin
    except CannotBeStated:
        return None
    except swb.SwitchbackError as error:
        return str(error)
    if not r.success:
        return r.message or r.outcome.name.lower()
    u = np.array(r.controls)
    own = problem.cost(u)
    scale = max(1e-3, abs(own))
    known = problem.minimise(u[:, 0], u[:, 1] if problem.chooses else None)
    rng, best = np.random.default_rng(seed), known
    for choice in problem.choices():
        for _ in range(max(1, starts // len(problem.choices()))):
            best = min(best, problem.minimise(rng.uniform(-BOUND, BOUND, STAGES), choice))
    verdict = r.optimality.verdict if r.optimality else "none"
    return {"off": (r.cost - own) / scale, "gain": (own - known) / scale, "best": (best - own) / scale, "verdict": verdict, "seconds": seconds, "cost": own}


def line(parts, found):
    name = " + ".join(parts)
    if isinstance(found, str):
        return f"| {name} | | | | | {found.split(':')[0][:60]} | |"
    f = found
    return f"| {name} | {f['cost']:.6f} | {abs(f['off']):.1e} | {max(f['gain'], 0):.1e} | {f['best']:.1e} | {f['verdict']} | {f['seconds']:.2f} |"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sample", type=int)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--starts", type=int, default=6)
    parser.add_argument("--page", action="store_true")
    args = parser.parse_args()
    wanted = rows()
    if args.sample:
        wanted = random.Random(args.seed).sample(wanted, args.sample)
    lines, found = [], []
    for k, parts in enumerate(wanted):
        row = judge(parts, 1000 * args.seed + k, args.starts)
        if row is None:
            continue
        found.append(row)
        lines.append(line(parts, row))
        print(lines[-1], flush=True, file=sys.stderr if args.page else sys.stdout)
    solved = [f for f in found if isinstance(f, dict)]
    exact = sum(abs(f["off"]) <= 1e-6 for f in solved)
    local = sum(f["gain"] <= 1e-6 for f in solved)
    lowest = sum(f["best"] >= -1e-6 for f in solved)
    certified = [f for f in solved if f["verdict"] in ("local_optimum", "kink", "global")]
    false = sum(f["gain"] > 1e-6 for f in certified)
    text = (
        f"{len(found)} problems: {len(solved)} solved. The cost is that of a simulation to 1e-6 in {exact}; the minimisation gains less than 1e-6 in {local}; "
        f"no start ends lower in {lowest}. {len(certified)} are certified, of which the minimisation betters {false}."
    )
    if not args.page:
        print(text)
        return
    head = __doc__.splitlines()
    page = [
        "# A control problem of every pair",
        "",
        "| date | machine | command |",
        "|---|---|---|",
        f"| {datetime.date.today()} | one core of a shared server, {platform.machine()} | `bindings/python/benchmarks/pairs.py --page --seed {args.seed}` |",
        "",
        *(h.strip() for h in head[2:5]),
        "",
        text,
        "",
        "| column | is |",
        "|---|---|",
        "| off | the relative difference of the cost that is reported from that of a simulation of the controls |",
        "| gain | what the minimisation from the solution gains, relative to the cost |",
        "| best | the lowest cost of all starts minus that of the solution, relative to it; below zero a start ends lower |",
        "| CPU s | of the solve |",
        "",
        "| ingredients | cost | off | gain | best | verdict | CPU s |",
        "|---|---|---|---|---|---|---|",
        *lines,
        "",
    ]
    Path(__file__).resolve().parents[3].joinpath("docs/benchmarks/pairs.md").write_text("\n".join(page))


if __name__ == "__main__":
    main()
