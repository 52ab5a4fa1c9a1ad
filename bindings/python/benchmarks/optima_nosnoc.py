"""Problems of `optima_problems.py` beside nosnoc_py: seconds and simulated cost, in one run.

usage: optima_nosnoc.py [NAME ...] [--max-time S] [--repeat N] [--json FILE]

pip install nosnoc==0.2.0 casadi scipy. A problem is translated from its document: the same control stages, finite elements and
stage points (Radau IIA), bounds and functions; nosnoc solves it with the settings of its own optimal control example (Scholtes
homotopy by factors of ten to 1e-9, IPOPT with MUMPS). Problems that it cannot state are left out: several references, costs at the
ends of the stages, controls that are linear in a stage, free lengths of single stages, inequalities at the end.

Both sides are measured by the wall clock, from the model to the answer: ours with everything that a default solve does, its search
and its comparison with a simulation included; nosnoc with its building, and without that (`solve`). What an answer is worth is
what its controls lead to: the cost of their simulation by events (`optima_peers.Descent`), and by how much that simulation
misses the constraints. `ratio` is seconds of nosnoc over ours, building included; of N runs of ours the median counts. Every solve of
nosnoc has a process of its own and ends after --max-time seconds.
"""

from __future__ import annotations

import argparse
import json
import math
import multiprocessing
import sys
import time
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import optima_peers
import optima_problems
from optima_peers import INF, Array, Descent, Statement

import switchback_control as swb

#: Problems of all kinds that nosnoc can state, from small to large.
USUAL = [
    "snell_2", "snell_3", "zermelo_river", "friction_move_05", "two_surfaces", "slide_through", "landing", "gearbox_time",
    "gearbox_fuel", "pendulum", "cart_pole", "arm_2", "two_masses", "thermostat", "tanks", "motor",
]  # fmt: skip
#: Costs that differ by less, relative, are equal; simulations that miss constraints by less meet them.
SAME, MET = 1e-3, 1e-3


class Untranslatable(Exception):
    """nosnoc has no words for this problem."""


def _fields(s: Statement, horizon: Any) -> tuple[list[Any], list[Any], list[Any], bool]:
    """Fields, switching functions and sign matrices of the subsystems; do all modes name all signs?"""
    system = s.data["system"]
    x, u, p, t = s.at
    if any(ca.depends_on(f(x, u, p, t), t) for f in (s.end, s.path, s.terminal)):
        raise Untranslatable("time in costs or constraints")
    inputs = (optima_peers._split(x), optima_peers._split(u), optima_peers._split(p), t)
    of = lambda f: optima_peers._casadi(f, *inputs)
    common = ca.vertcat(*of(system["f0"])) if system.get("f0") else ca.SX.zeros(s.nx)
    fields, surfaces, signs, named = [], [], [], True
    for k, sub in enumerate(system.get("subsystems", [])):
        if "signs" not in sub["regions"]:
            raise Untranslatable("indicator functions")
        psi, modes = of(sub["regions"]["signs"]["psi"]), of(sub["modes"])
        table = np.array(sub["regions"]["signs"]["signs"]).reshape(sub["n_modes"], len(psi))
        named &= bool(np.all(table != 0))
        columns = []
        for i in range(sub["n_modes"]):
            f = ca.SX.zeros(s.nx)
            for j, row in enumerate(sub["rows"]):
                f[row] = modes[i * len(sub["rows"]) + j]
            # what is common to all modes belongs to the first subsystem
            columns.append(horizon * (f + common if k == 0 else f))
        fields.append(ca.horzcat(*columns))
        surfaces.append(ca.vertcat(*psi))
        signs.append(table)
    if any(ca.depends_on(f, t) for f in [*fields, *surfaces]):
        raise Untranslatable("time in the model")
    return fields, surfaces, signs, named


def nosnoc_solve(name: str, answer: Any = None) -> dict[str, Any]:
    """What nosnoc makes of a problem: seconds, iterations, controls, length of the horizon."""
    import nosnoc

    clock = time.perf_counter()
    s = Statement(optima_problems.PROBLEMS[name].make())
    if s.linear or s.free == "stages" or s.grid_refs.shape[1] or len(s.boundary_bounds[0]):
        raise Untranslatable("linear controls, free stages, costs on the control grid, or rows of both ends")
    if np.any(s.x0_bounds[0] < s.x0_bounds[1]) or np.any(s.p_bounds[0] < s.p_bounds[1]):
        raise Untranslatable("free initial states or parameters")
    if not np.allclose(s.durations, s.durations[0]) or np.any(s.refs != s.refs[:1]):
        raise Untranslatable("stages of different lengths or references")
    if np.any(s.terminal_bounds[0] < s.terminal_bounds[1]):
        raise Untranslatable("inequalities at the end")
    if not s.data["system"].get("subsystems"):
        raise Untranslatable("nothing switches")
    x, u, p, t = s.at
    free = s.free == "horizon"
    length = ca.SX.sym("length") if free else ca.SX.sym("length", 0, 1)
    horizon = length if free else 1.0
    fields, surfaces, signs, named = _fields(s, horizon)
    substituted = lambda e: ca.substitute(e, p, ca.DM(s.params)) if s.np else e
    fields, surfaces = [substituted(f) for f in fields], [substituted(c) for c in surfaces]
    rate = horizon * substituted(s.rate(x, u, p, t, s.refs[0]))
    if ca.depends_on(rate, t):
        raise Untranslatable("time in the cost")
    extra: dict[str, Any] = {}
    if free:
        extra = {"lbv_global": np.array([s.time_bounds[0]]), "ubv_global": np.array([s.time_bounds[1]])}
        extra["v_global_guess"] = np.array([s.durations.sum()])
    if len(s.path_bounds[0]):
        extra |= {"g_path": substituted(s.path(x, u, p, t)), "lbg": s.path_bounds[0], "ubg": s.path_bounds[1]}
    model = nosnoc.NosnocModel(
        x=x, u=u, x0=s.x0_bounds[0].copy(), F=fields, S=signs, c=surfaces, **({"v_global": length} if free else {})
    )
    ocp = nosnoc.NosnocOcp(
        lbu=s.u_bounds[0], ubu=s.u_bounds[1], u_guess=s.middle()[0], lbx=s.x_bounds[0], ubx=s.x_bounds[1], f_q=rate,
        f_terminal=substituted(s.end(x, u, p, t)), g_terminal=substituted(s.terminal(x, u, p, t)) - s.terminal_bounds[0],
        **extra,
    )  # fmt: skip
    opts = nosnoc.NosnocOpts()
    opts.irk_scheme = nosnoc.IrkSchemes.RADAU_IIA
    opts.irk_representation = nosnoc.IrkRepresentation.DIFFERENTIAL
    opts.pss_mode = nosnoc.PssMode.STEWART if named else nosnoc.PssMode.STEP
    opts.comp_tol = 1e-9
    opts.homotopy_update_slope = 0.1
    opts.step_equilibration = nosnoc.StepEquilibrationMode.HEURISTIC_MEAN
    opts.n_s, opts.N_stages = 3, s.n
    opts.N_finite_elements = s.data.get("settings", {}).get("n_fe", 3)
    opts.terminal_time = 1.0 if free else float(s.durations.sum())
    solver = nosnoc.NosnocSolver(opts, model, ocp)
    build = time.perf_counter() - clock
    r = solver.solve()
    found = {
        "build": build,
        "seconds": time.perf_counter() - clock,
        "iterations": int(sum(n for n in r["nlp_iter"] if n)),
        "outcome": r["status"].name.lower(),
        "controls": np.array(r["u_list"]).reshape(s.n, s.nu).tolist(),
        "horizon": float(np.ravel(r["v_global"])[0]) if free else float(s.durations.sum()),
    }
    if answer is not None:
        answer.put(found)
    return found


def _answer(name: str, queue: Any) -> None:
    try:
        nosnoc_solve(name, queue)
    except Exception as e:  # whatever the peer raises is its answer
        kind = "left out" if isinstance(e, (Untranslatable, NotImplementedError)) else "failed"
        queue.put({"outcome": kind, "why": f"{e}"[:100]})


def in_a_process(name: str, limit: float) -> dict[str, Any]:
    """The same in a process of its own, which is ended after `limit` seconds."""
    queue: Any = multiprocessing.Queue()
    process = multiprocessing.Process(target=_answer, args=(name, queue))
    process.start()
    try:
        return queue.get(timeout=limit)
    except Exception:  # the queue stayed empty
        return {"outcome": "out of time", "seconds": limit}
    finally:
        process.kill()
        process.join()


def worth(descent: Descent, z: Array) -> tuple[float, float]:
    """Simulated cost of controls, and by how much they miss the constraints."""
    try:
        cost, _, c, _, low, high = descent.run(z)
    except (FloatingPointError, swb.SwitchbackError):
        return math.nan, math.inf
    return float(cost), descent.violation(c, low, high)


def compare(name: str, limit: float, repeat: int) -> dict[str, Any]:
    theirs = in_a_process(name, limit)
    if theirs["outcome"] == "left out":
        return {"name": name, "left_out": theirs["why"]}
    runs = []
    for _ in range(repeat):
        clock = time.perf_counter()
        ocp = optima_problems.PROBLEMS[name].make(max_time=limit)
        r = ocp.solve()
        runs.append(time.perf_counter() - clock)
    s = Statement(optima_problems.PROBLEMS[name].make())
    descent = Descent(s)
    cost, missed = worth(descent, descent.of_result(r))
    ours = {
        "seconds": float(np.median(runs)),
        "iterations": r.stats.iterations,
        "outcome": r.outcome.name.lower(),
        "certificate": str(r.certificate),
        "cost": cost,
        "missed": missed,
    }
    if "controls" in theirs:
        h = s.durations * theirs["horizon"] / s.durations.sum()
        z = descent.pack(np.array(theirs["controls"]), h, s.params, s.x0_bounds[0])
        theirs["cost"], theirs["missed"] = worth(descent, z)
    return {"name": name, "ours": ours, "nosnoc": theirs, "ratio": theirs.get("seconds", math.nan) / ours["seconds"]}


def line(f: dict[str, Any]) -> str:
    o, n = f["ours"], f["nosnoc"]
    number = lambda r, k: r.get(k, math.nan)
    return (
        f"{f['name']:<20}{o['seconds']:8.2f}{o['iterations']:7d}{o['cost']:13.6f}{o['missed']:9.1e} |"
        f"{number(n, 'seconds'):8.2f}{number(n, 'build'):7.2f}{number(n, 'iterations'):7.0f}{number(n, 'cost'):13.6f}"
        f"{number(n, 'missed'):9.1e} {n['outcome']:<12}{f['ratio']:7.1f}"
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="problems; none: a selection")
    parser.add_argument("--max-time", type=float, default=120.0, help="seconds for one solve")
    parser.add_argument("--repeat", type=int, default=3, help="runs of ours, of which the median counts")
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    found = []
    print(
        f"{'problem':<20}{'ours s':>8}{'it':>7}{'simulated':>13}{'missed':>9} |{'nosnoc':>8}{'build':>7}{'it':>7}{'simulated':>13}"
        f"{'missed':>9} {'outcome':<12}{'ratio':>7}"
    )
    for name in args.names or USUAL:
        f = compare(name, args.max_time, args.repeat)
        print(f"{name:<20}left out: {f['left_out']}" if "left_out" in f else line(f), flush=True)
        found.append(f)
    rated = [f for f in found if "ratio" in f and math.isfinite(f["ratio"])]
    if rated:
        as_good = 0
        for f in rated:
            n, o = f["nosnoc"], f["ours"]
            met = n.get("missed", INF) <= MET
            as_good += o["missed"] <= MET and (not met or o["cost"] <= n["cost"] + SAME * abs(n["cost"]))
        mean = math.exp(sum(math.log(f["ratio"]) for f in rated) / len(rated))
        print(
            f"{len(rated)} problems: ratio of times {min(f['ratio'] for f in rated):.1f} at least, {mean:.1f} geometric mean; "
            f"ours is as good or better by simulation in {as_good}"
        )
    if args.json:
        args.json.write_text(json.dumps(found, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
