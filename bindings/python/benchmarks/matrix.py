"""usage: matrix.py [--sample N] [--seed S] [--refusals] [--json] [--page]    every ingredient and pair by every task

For each cell one small model (matrix_models.py), one task, and a check that does not use the answer of the task alone:

    works     the task is done and the check holds
    refused   the library says in an error, an outcome or a verdict what it does not do
    wrong     a check fails, or an error is not one of the library
    -         the model cannot be stated

--sample N    N cells drawn with the seed S, the others are not run
--refusals    every distinct text of a refusal with the number of its cells
--json        the cells as JSON
--page        the page docs/benchmarks/matrix.md
"""

import argparse
import datetime
import json
import platform
import random
import re
import sys
import warnings
from collections import Counter
from pathlib import Path

import numpy as np
import switchback_control as swb

sys.path.insert(0, str(Path(__file__).resolve().parent))

from matrix_models import HORIZON, P0, STAGES, CannotBeStated, build, rows  # noqa: E402

WORKS, REFUSED, WRONG, UNSTATED = "works", "refused", "wrong", "-"
#: Numbers and times in a text, which are not part of what it says.
_NUMBER = re.compile(r"[-+]?\d+(\.\d*)?(e[-+]?\d+)?")
TIGHT = {"rtol": 1e-11, "atol": 1e-13}
#: Finite elements of every control stage, and points of each.
GRID = {"n_fe": 2, "n_s": 3}


class Refusal(Exception):
    """The library says in a result, not in an error, that it did not do it."""


def agree(found, expected, tolerance, what):
    """Fails unless two arrays differ by the tolerance at most, relative to the larger one where that is above 1."""
    a, b = np.asarray(found, dtype=float), np.asarray(expected, dtype=float)
    assert a.shape == b.shape, f"{what}: shapes {a.shape} and {b.shape}"
    assert np.all(np.isfinite(a)), f"{what}: {a} is not finite"
    scale = max(1.0, np.abs(b).max(initial=0.0))
    gap = np.abs(a - b).max(initial=0.0) / scale
    assert gap <= tolerance, f"{what}: off by {gap:.2g}, found {a.round(6)}, expected {b.round(6)}"


class Bench:
    """The tasks of one model; what several of them need is made once."""

    def __init__(self, parts):
        self.case = build(parts)
        self._solved = None

    # --- simulation -------------------------------------------------------------------------------

    def run(self, p=P0, by=0.0, u=None, horizon=HORIZON, **options):
        """A run that got to its end."""
        c = self.case
        run = swb.simulate(c.system, c.start(by), horizon, u=c.u if u is None else u, p=[p], **{**TIGHT, **options})
        if not run.success:
            raise Refusal(run.reason) if run.reason else AssertionError(f"ended at {run.t_end:g} without a reason")
        return run

    def end(self, **given):
        """Positions, velocities and the other states at the end, discrete ones left out."""
        return self.run(**given).x_end[: self.case.x0.size]

    def simulate(self):
        run = self.run()
        agree(self.end(method="radau5", rtol=1e-9, atol=1e-11), run.x_end[: self.case.x0.size], 1e-5, "end by another method")

    def forward(self):
        run, n = self.run(sensitivity=True), self.case.x0.size
        h = 1e-5
        agree(run.dx_dp[:n, 0], (self.end(p=P0 + h) - self.end(p=P0 - h)) / (2 * h), 1e-4, "derivative by the parameter")
        agree(run.dx_dx0[:n, :n] @ self.case.along, (self.end(by=h) - self.end(by=-h)) / (2 * h), 1e-4, "derivative by the start")

    def adjoint(self):
        c, h = self.case, 1e-5
        with swb.Integrator(c.system, adjoint=True, **TIGHT) as i:
            i.set_params([P0])
            i.set_controls(c.u)
            i.reinit(i.system._start(c.x0, "x0"), 0.0)
            i.advance(HORIZON)
            if not i.run.success:
                raise Refusal(i.reason)
            v = np.zeros(c.system.nx)
            v[0] = 1.0
            g = i.adjoint(v)
        agree(g.p[0], (self.end(p=P0 + h) - self.end(p=P0 - h))[0] / (2 * h), 1e-4, "gradient by the parameter")
        agree(g.x0[: c.x0.size] @ c.along, (self.end(by=h) - self.end(by=-h))[0] / (2 * h), 1e-4, "gradient by the start")

    def fesd(self):
        c = self.case
        r = swb.simulate_fesd(c.system, c.system._start(c.x0, "x0"), HORIZON, 8, u=c.u, p=[P0], n_s=3)
        if not r.success:
            raise Refusal(f"finite elements end with {r.outcome.name.lower()}")
        x = r.state[: c.x0.size]
        agree(x, self.end(), 1e-4, "end by events")

    def batch(self):
        c = self.case
        p = np.array([[P0], [P0 + 0.05], [P0 - 0.05]])
        b = swb.simulate_batch(c.system, np.tile(c.x0, (3, 1)), HORIZON, u=c.u, p=p, **TIGHT)
        for k, run in enumerate(p[:, 0]):
            agree(b.x[k][: c.x0.size], self.end(p=run, dense=False), 0.0, f"run {k}")

    # --- optimal control --------------------------------------------------------------------------

    def sum_of_starts(self, u):
        """The cost that a controller sees: its rate summed over the starts of the stages, (10.1)."""
        q, v = 0, 2 if "bilateral" in self.case.parts else 1
        run, h = self.run(u=u), HORIZON / len(u)
        x = run(h * np.arange(len(u)))
        rate = x[:, q] ** 2 + 0.5 * x[:, v] ** 2 + 0.2 * u[:, 0] ** 2
        return h * rate.sum() + 2.0 * (run.x_end[q] - 0.2) ** 2

    def problem(self, p=P0, by=0.0, horizon=HORIZON, stages=STAGES, mayer=True, fixed=True, **options):
        c = self.case
        # control_bounds of a choice are those of its values
        upper = [2.0, 1.0] if "choice" in c.parts else [2.0]
        lower = [-2.0, 0.0] if "choice" in c.parts else [-2.0]
        ocp = swb.Ocp(c.system, horizon, stages, params=[p], control_bounds=(lower, upper), **{**GRID, **options})
        if fixed:
            ocp.set_initial_state(c.start(by))
        ocp.set_lagrange(c.lagrange())
        if mayer:
            ocp.set_mayer(c.mayer())
        return ocp

    @staticmethod
    def solution(ocp, warm=False):
        """A result that is a solution."""
        r = ocp.solve(warm=warm)
        if not r.success:
            raise Refusal(r.message or f"no solution: {r.outcome.name.lower()}") if r.message else AssertionError(f"{r.outcome.name} without a message")
        assert np.isfinite(r.cost)
        return r

    def solved(self):
        """The problem of most tasks with its solution, solved once."""
        if self._solved is None:
            try:
                ocp = self.problem()
                self._solved = ocp, self.solution(ocp)
            except Exception as error:
                self._solved = error
        if isinstance(self._solved, Exception):
            raise self._solved
        return self._solved

    def cost(self, u, by=0.0, p=P0, horizon=HORIZON, grid=False):
        """Cost of controls by a simulation by events and sums over 12 000 points; with the positions at the ends of stages squared, if asked for."""
        c, q, v = self.case, 0, 2 if "bilateral" in self.case.parts else 1
        run = self.run(u=np.asarray(u), by=by, p=p, horizon=horizon)
        end = run.x_end
        n = 12000
        t = horizon * (np.arange(n) + 0.5) / n
        x = run(t)
        every = np.asarray(u)[np.minimum((t / horizon * len(u)).astype(int), len(u) - 1)]
        rate = x[:, q] ** 2 + 0.5 * x[:, v] ** 2 + 0.2 * every[:, 0] ** 2 + (0.1 * every[:, 1] if "choice" in c.parts else 0.0)
        total = rate.mean() * horizon + 2.0 * (end[q] - 0.2) ** 2
        if grid:
            total += np.sum(run(horizon * np.arange(1, len(u) + 1) / len(u))[:, q] ** 2)
        return total

    def solve(self):
        _, r = self.solved()
        agree(r.cost, self.cost(r.controls), 1e-3, "cost of a simulation")

    def verdict(self):
        _, r = self.solved()
        o = r.optimality
        if o is None or o.verdict == "unknown":
            raise Refusal(f"verdict unknown: {o.reason if o else 'none'}")
        if o.verdict == "not_optimal":
            raise Refusal(f"verdict not_optimal: {r.message}")
        best = self.cost(r.controls)
        for k in range(STAGES):
            for by in (-0.02, 0.02):
                u = r.controls.copy()
                u[k, 0] = np.clip(u[k, 0] + by, -2.0, 2.0)
                other = self.cost(u)
                assert other >= best - 1e-4 * max(1.0, abs(best)), f"{o.verdict}, but control {k} by {by} costs {other:.7g}, not {best:.7g}"

    def accuracy(self):
        _, r = self.solved()
        if r.accuracy is None or not r.accuracy.reached:
            raise Refusal(f"no accuracy: {r.message}")
        x = self.run(u=r.controls).x_end[: self.case.x0.size]
        gap = np.abs(x - r.trajectory(HORIZON)[: self.case.x0.size])
        differential = np.arange(gap.size) < (gap.size - 1 if "algebraic" in self.case.parts else gap.size)
        assert gap[differential].max() <= 2 * r.accuracy.worst + 1e-6, f"the end is off by {gap.max():.2g}, accuracy says {r.accuracy.worst:.2g}"

    def least_squares(self):
        ocp = self.problem()
        ocp.add_least_squares(self.case.q, [1.0], 0.0, at="control_grid")
        r = self.solution(ocp)
        agree(r.cost, self.cost(r.controls, grid=True), 1e-3, "cost of a simulation")

    def linear(self):
        ocp = self.problem()
        ocp.set_linear_controls([True, False] if "choice" in self.case.parts else True)
        r = self.solution(ocp)
        agree(r.control_ends[:-1, 0], r.controls[1:, 0], 1e-7, "controls at the ends of stages")
        assert r.accuracy is not None and (not r.accuracy.reached or r.accuracy.worst < 1e-2), f"accuracy {r.accuracy}"

    def free_time(self):
        _, fixed = self.solved()
        ocp = self.problem()
        ocp.set_free_time("horizon", 0.9, 1.5)
        r = self.solution(ocp)
        length = r.durations.sum()
        assert 0.9 - 1e-6 <= length <= 1.5 + 1e-6, f"length {length}"
        assert r.cost <= fixed.cost + 1e-3 * max(1.0, fixed.cost), f"{r.cost:.6g} with a free length, {fixed.cost:.6g} with a fixed one"

    def path(self):
        c, low = self.case, -0.6
        ocp = self.problem()
        ocp.add_path(c.v, low, np.inf)
        r = self.solution(ocp)
        t = HORIZON * np.arange(1, STAGES) / STAGES
        at = 2 if "bilateral" in c.parts else 1
        # where a jump is at the end of a stage, the constraint holds on one of its sides
        sides = np.stack([r.trajectory(t * (1 + by))[:, at] for by in (-1e-9, 1e-9)])
        found = sides.max(axis=0).min()
        assert found >= low - 1e-4, f"velocity {found:.6g} below its bound"
        if r.accuracy is None or not r.accuracy.reached:
            raise Refusal(f"no accuracy: {r.message}")
        least = self.run(u=r.controls)(np.linspace(0.0, HORIZON, 2001))[:, at].min()
        agree(max(r.accuracy.along_violation, 0.0), max(low - least, 0.0), 2e-3, "violation along the horizon")

    def _relaxed(self, norm):
        c = self.case
        ocp = self.problem()
        low = 1.3
        ocp.add_relaxed(c.q, low, np.inf, at="control_grid", norm=norm, weight=5.0)
        r = self.solution(ocp)
        found = r.trajectory(HORIZON * np.arange(STAGES + 1) / STAGES)[:, 0]
        agree(r.violation, max(low - found.min(), 0.0), 1e-2, "violation")

    def relaxed(self):
        self._relaxed("l1")

    def relaxed_linf(self):
        self._relaxed("linf")

    def warm(self):
        ocp, first = self.solved()
        agree(self.solution(ocp, warm=True).cost, first.cost, 1e-5, "cost of the second solve")

    def shift(self):
        ocp = self.problem()
        first = self.solution(ocp)
        x = first.trajectory(HORIZON / STAGES)
        ocp.shift()
        ocp.set_initial_time(HORIZON / STAGES)
        ocp.set_initial_state(x)
        r = self.solution(ocp, warm=True)
        # algebraic states are determined by the others
        agree(r.trajectory(HORIZON / STAGES)[:2], x[:2], 1e-6, "start of the next solve")

    def adapted(self):
        r = self.solution(self.problem(adapt_tol=1e-5, n_fe=1, n_s=2))
        if r.adaptation is None:
            raise AssertionError("no adaptation, and no word of it")
        if not r.adaptation.reached:
            raise Refusal(f"the grid is not as fine as asked for: {r.message}")
        agree(r.cost, self.cost(r.controls), 1e-4, "cost of a simulation")

    def phases(self):
        _, one = self.solved()
        first = self.problem(horizon=HORIZON / 2, stages=STAGES // 2, mayer=False)
        last = self.problem(horizon=HORIZON / 2, stages=STAGES // 2, fixed=False)
        both = swb.MultiPhase([first, last])
        both.link_continuous(0)
        r = both.solve()
        if not r.success:
            raise Refusal(r.message) if r.message else AssertionError(f"{r.outcome.name} without a message")
        controls = np.vstack([phase.controls for phase in r.phases])
        agree(r.cost, self.cost(controls), 1e-3, "cost of a simulation")
        # another local optimum may cost more, though not much
        assert r.cost <= one.cost + 5e-2 * max(1.0, abs(one.cost)), f"{r.cost:.6g} in two phases, {one.cost:.6g} in one"

    def _slope(self, h=2e-3, **which):
        """Derivative of the optimal cost by differences of solves, in the parameter or along the start."""
        costs = []
        for sign in (1, -1):
            ocp = self.problem(p=P0 + sign * h) if "p" in which else self.problem(by=sign * h)
            ocp.set_control_guess(self.solved()[1].controls)
            if self.solved()[1].jumps:  # the derivative is that of the sequence found
                ocp.set_modes(self.solved()[0].modes)
            costs.append(self.solution(ocp).cost)
        return (costs[0] - costs[1]) / (2 * h)

    def sensitivity(self):
        ocp, _ = self.solved()
        s = ocp.sensitivity()
        agree(s.cost_p[0], self._slope(p=True), 2e-2, "derivative of the cost by the parameter")

    def multipliers(self):
        ocp, _ = self.solved()
        m = ocp.multipliers()
        agree(m.costates[0][: self.case.x0.size] @ self.case.along, self._slope(), 2e-2, "costate at the start")

    def modes(self):
        ocp, first = self.solved()
        other = self.problem()
        other.set_modes(ocp.modes)
        other.set_control_guess(first.controls)
        agree(self.solution(other).cost, first.cost, 1e-3, "cost with the modes given")
        smooth = {"flow", "algebraic", "choice"}  # which have none
        jumps = bool(ocp.modes.transitions) or not first.jumps  # an order without transitions says so
        switches = ocp.modes.modes.shape[1] > 0 or set(self.case.parts) <= smooth | {"transition", "clock"}
        assert jumps and switches, "the modes given say nothing of what switches"

    def feedback(self):
        c = self.case
        ocp = self.problem()
        with swb.Nmpc(ocp) as controller:
            x = c.x0[: controller.nx] if controller.nx < c.x0.size else c.system._start(c.x0, "x0")
            controller.initialise(x)
            controller.prepare()
            u, _ = controller.feedback(x)
            plan = controller.plan
        assert np.all(np.isfinite(u)) and np.all(np.abs(u) <= 2.0 + 1e-9), f"control {u}"
        controls = np.asarray(plan.u)[:STAGES]
        zero = np.zeros_like(controls)
        assert self.sum_of_starts(controls) <= self.sum_of_starts(zero) + 1e-6, "the plan costs more than no control"
        agree(plan.x[-1][:2], self.run(u=controls).x_end[:2], 3e-2, "end of the plan")

    def document(self):
        ocp, first = self.solved()
        again = swb.Ocp.from_json(ocp.to_json())
        agree(self.solution(again).cost, first.cost, 1e-6, "cost of the problem read back")


#: Names of columns: the task, and what it does and checks in words.
TASKS = {
    "simulate": (Bench.simulate, "simulation by events, the end by another method"),
    "forward": (Bench.forward, "derivatives by parameter and start, differences"),
    "adjoint": (Bench.adjoint, "the same by adjoints, differences"),
    "fesd": (Bench.fesd, "simulation by finite elements, the end by events"),
    "batch": (Bench.batch, "three runs, bit by bit those alone"),
    "solve": (Bench.solve, "optimal control, its cost in a simulation"),
    "verdict": (Bench.verdict, "a verdict, no control next to it is cheaper"),
    "accuracy": (Bench.accuracy, "the comparison with a simulation, another simulation"),
    "lsq": (Bench.least_squares, "least squares at the grid, the cost in a simulation"),
    "linear": (Bench.linear, "linear controls, continuous"),
    "free": (Bench.free_time, "a free horizon, in its bounds and not more costly"),
    "path": (Bench.path, "a path constraint, met at the grid and reported between"),
    "relaxed": (Bench.relaxed, "a relaxed constraint, its violation from the states"),
    "linf": (Bench.relaxed_linf, "the same in the largest violation along the horizon"),
    "warm": (Bench.warm, "a second solve, the same cost"),
    "shift": (Bench.shift, "a receding horizon, from the state reached"),
    "adapt": (Bench.adapted, "an adapted grid, the cost in a simulation"),
    "phases": (Bench.phases, "the horizon in two phases, the cost in a simulation"),
    "sens": (Bench.sensitivity, "derivative of the optimum, differences of solves"),
    "mult": (Bench.multipliers, "costates, differences of solves"),
    "modes": (Bench.modes, "the modes of the solution given, the same cost"),
    "nmpc": (Bench.feedback, "a feedback, its plan in a simulation"),
    "json": (Bench.document, "the problem as a document and back, the same cost"),
}


def judge(bench, task):
    """What a cell is, and the text that goes with it."""
    if isinstance(bench, CannotBeStated | swb.SwitchbackError):
        return UNSTATED, str(bench)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            TASKS[task][0](bench)
        return WORKS, ""
    except Refusal as refusal:
        return REFUSED, str(refusal)
    except (swb.ArgumentError, swb.NumericError) as error:
        return REFUSED, f"{type(error).__name__}: {error}"
    except Exception as error:  # an assertion, an error of Python, a defect of the library
        return WRONG, f"{type(error).__name__}: {error}"


def made(parts):
    """The tasks of a model, or why it cannot be stated."""
    try:
        return Bench(parts)
    except (CannotBeStated, swb.ArgumentError) as error:
        return error


def cells(wanted=None, progress=False):
    """Judges cells, pairs of a row and a task (None: all). Returns a dictionary to (class, text)."""
    found = {}
    for parts in rows():
        tasks = [t for t in TASKS if wanted is None or (parts, t) in wanted]
        bench = made(parts) if tasks else None
        for task in tasks:
            found[parts, task] = judge(bench, task)
        if progress and tasks:
            print(" + ".join(parts), " ".join(SIGNS[found[parts, t][0]] for t in tasks), file=sys.stderr, flush=True)
    return found


def sample(n, seed):
    """Cells drawn without repetition."""
    return set(random.Random(seed).sample([(r, t) for r in rows() for t in TASKS], n))


SIGNS = {WORKS: "yes", REFUSED: "no", WRONG: "**?**", UNSTATED: "-"}


def table(found):
    """The matrix in Markdown."""
    lines = ["| ingredients | " + " | ".join(TASKS) + " |", "|---" * (len(TASKS) + 1) + "|"]
    for parts in rows():
        if any((parts, t) in found for t in TASKS):
            signs = [SIGNS[found[parts, t][0]] if (parts, t) in found else " " for t in TASKS]
            lines.append(f"| {' + '.join(parts)} | " + " | ".join(signs) + " |")
    return "\n".join(lines)


def counts(found):
    """How many cells are of each class, in words."""
    c = Counter(kind for kind, _ in found.values())
    stated = sum(c.values()) - c[UNSTATED]
    share = 100 * c[WORKS] / max(stated, 1)
    whole = 100 * c[WORKS] / max(len(found), 1)
    return (
        f"{len(found)} cells: {c[WORKS]} work, {c[REFUSED]} are refused, {c[WRONG]} are wrong, {c[UNSTATED]} cannot be stated. "
        f"That is {share:.1f} % of what can be stated, and {whole:.1f} % of all."
    )


def texts(found, kind):
    """Distinct texts of a class with their numbers of cells and one of these, the most frequent first."""
    seen = {}
    for (parts, task), (k, text) in found.items():
        if k == kind:
            seen.setdefault(_NUMBER.sub("N", text) if kind != WRONG else text, []).append((parts, task))
    return sorted(((len(v), k, v) for k, v in seen.items()), key=lambda e: (-e[0], e[1]))


def shares(found):
    """Per task how many of the cells that can be stated work, as a table."""
    lines = ["| task | does and checks | works | of |", "|---|---|---|---|"]
    for task, (_, what) in TASKS.items():
        kinds = [k for (_, t), (k, _) in found.items() if t == task and k != UNSTATED]
        lines.append(f"| {task} | {what} | {kinds.count(WORKS)} | {len(kinds)} |")
    return "\n".join(lines)


def page(found):
    """The page docs/benchmarks/matrix.md."""
    refusals = [f"| {n} | {' + '.join(w[0][0])}: {w[0][1]} | `{text.replace('|', '/')}` |" for n, text, w in texts(found, REFUSED)]
    unstated = [f"| {n} | {' + '.join(w[0][0])} | `{text.replace('|', '/')}` |" for n, text, w in texts(found, UNSTATED)]
    wrong = [f"| {' + '.join(w[0][0])}: {w[0][1]} | `{text.replace('|', '/')}` |" for _, text, w in texts(found, WRONG)]
    parts = [
        "# Every ingredient by every task",
        f"| date | machine | command |\n|---|---|---|\n| {datetime.date.today()} | one core of a shared server, {platform.machine()} "
        "| `bindings/python/benchmarks/matrix.py --page` |",
        _PAGE_INTRODUCTION,
        counts(found),
        "## Tasks",
        shares(found),
        "## Cells",
        "A flow is part of every model, so its pair with another ingredient is the row of that one alone.",
        table(found),
        "## What the refusals say",
        "Numbers in the texts are replaced by `N`. The second column is one of the cells.",
        "| cells | such as | text |\n|---|---|---|\n" + "\n".join(refusals),
    ]
    if wrong:
        parts += ["## What is wrong", "| cell | what |\n|---|---|\n" + "\n".join(wrong)]
    parts += ["## What cannot be stated", "| cells | ingredients | why |\n|---|---|---|\n" + "\n".join(unstated)]
    return "\n\n".join(parts)


_PAGE_INTRODUCTION = """Each row is one small model: a mass on a spring with a damper, and one or two ingredients added to it. Each column is a task, followed by a check
that does not use the result of the task alone. `matrix_models.py` has the models, `matrix.py` the tasks. `make check` judges cells that are drawn
anew every day, and fails where one is wrong or where this page says more than holds.

| cell | means |
|---|---|
| yes | the task is done, and the check holds |
| no | the library says that it does not do it, in an error, an outcome or a verdict |
| **?** | the check fails, or the error is not one of the library |
| - | no statement of the library can write the model |"""


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sample", type=int)
    parser.add_argument("--seed", type=int, default=0)
    for flag in ("refusals", "json", "page", "progress"):
        parser.add_argument(f"--{flag}", action="store_true")
    parser.add_argument("--only", help="a part of the name of the rows")
    given = parser.parse_args()
    wanted = sample(given.sample, given.seed) if given.sample else None
    if given.only:
        wanted = {(r, t) for r in rows() for t in TASKS if given.only in " + ".join(r)}
    found = cells(wanted, given.progress)
    if given.page:
        print(page(found))
        return
    if given.json:
        print(json.dumps([{"parts": p, "task": t, "class": k, "text": text} for (p, t), (k, text) in found.items()], indent=1))
        return
    print(table(found), "", counts(found), sep="\n")
    for kind in (WRONG, *((REFUSED, UNSTATED) if given.refusals else ())):
        for n, text, where in texts(found, kind):
            print(f"\n{kind}, {n} cells ({' + '.join(where[0][0])}: {where[0][1]}, ...): {text}")


if __name__ == "__main__":
    main()
