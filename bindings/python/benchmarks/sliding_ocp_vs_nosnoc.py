"""Time of the optimal control problem through two sliding modes, (7.51) of the literature, against nosnoc.

    q' = -sign c(q) + v,  v' = u,  c = (q1 + 0.15 q2^2, q2 - 0.05 q1^3),  q, v, u in R^2
    min of the integral of |u|^2 + |v|^2 over [0, 4],  q(0) = (2 pi/3, pi/3),  q(4) = -(pi/6, pi/4),
    |v| <= 2, |u| <= 10,  6 control stages of 6 finite elements, Radau IIA with 2 and 3 stage points

usage: sliding_ocp_vs_nosnoc.py [--repeat N] [--n-s 2 3] [--json FILE]

The peer: pip install nosnoc==0.2.0 (brings CasADi with IPOPT and MUMPS). Its settings are those of its own example
sliding_mode_ocp. Its times are that of building the problem, CPU seconds inside IPOPT, and of all. Ours are seconds of
wall time for building and solving, evaluations of the model included: with models compiled from C, with models as
expressions, as the peer has them, and for information with Python callables, with and without derivatives. Ratios are also given in CPU
seconds of the process, which do not depend on what else the machine does.
E(T) is the distance from the goal when the controls found are simulated in fine steps of high order, for both.
Without nosnoc or without a C compiler that part is left out. Of N runs the medians count.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from importlib import metadata
from pathlib import Path
from typing import Callable

import numpy as np

import switchback_control as swb

HORIZON, STAGES, ELEMENTS = 4.0, 6, 6
X0 = np.array([2 * np.pi / 3, np.pi / 3, 0.0, 0.0])
GOAL = np.array([-np.pi / 6, -np.pi / 4])
V_MAX, U_MAX = 2.0, 10.0

MODEL = r"""
typedef struct { double t; const double *x, *u, *p; } point;
#define VALUE(f) int f(const point *at, double *out, void *data)
#define HESSIAN(f) int f(const point *at, const double *w, double *out, void *data)
#define X at->x
#define U at->u
#define UNUSED (void)at, (void)data

VALUE(f0) { UNUSED; out[0] = X[2]; out[1] = X[3]; out[2] = U[0]; out[3] = U[1]; return 0; }
VALUE(f0_jac) { UNUSED; out[0] = out[1] = out[2] = out[3] = 1; return 0; }
VALUE(modes) { UNUSED; out[0] = -1; out[1] = 1; return 0; }
VALUE(c1) { UNUSED; out[0] = X[0] + 0.15 * X[1] * X[1]; return 0; }
VALUE(c1_jac) { UNUSED; out[0] = 1; out[1] = 0.3 * X[1]; return 0; }
HESSIAN(c1_hess) { UNUSED; out[0] = 0.3 * w[0]; return 0; }
VALUE(c2) { UNUSED; out[0] = X[1] - 0.05 * X[0] * X[0] * X[0]; return 0; }
VALUE(c2_jac) { UNUSED; out[0] = -0.15 * X[0] * X[0]; out[1] = 1; return 0; }
HESSIAN(c2_hess) { UNUSED; out[0] = -0.3 * X[0] * w[0]; return 0; }
VALUE(rate) { UNUSED; out[0] = U[0] * U[0] + U[1] * U[1] + X[2] * X[2] + X[3] * X[3]; return 0; }
VALUE(rate_jac) { UNUSED; out[0] = 2 * X[2]; out[1] = 2 * X[3]; out[2] = 2 * U[0]; out[3] = 2 * U[1]; return 0; }
HESSIAN(rate_hess) { UNUSED; out[0] = out[1] = out[2] = out[3] = 2 * w[0]; return 0; }
VALUE(end) { UNUSED; out[0] = X[0]; out[1] = X[1]; return 0; }
VALUE(end_jac) { UNUSED; out[0] = out[1] = 1; return 0; }
"""


def compile_model(folder: str) -> ctypes.CDLL | None:
    compiler = os.environ.get("CC") or shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        return None
    source, target = Path(folder) / "model.c", Path(folder) / "model.so"
    source.write_text(MODEL)
    subprocess.run([compiler, "-O2", "-shared", "-fPIC", source, "-o", target], check=True)
    return ctypes.CDLL(str(target))


def compiled_functions(code: ctypes.CDLL) -> dict[str, swb.Function]:
    def make(name, n_out, inputs, jacobian=None, hessian=None):
        keywords = {"linear": True} if hessian is None else {
            "hessian": getattr(code, name + "_hess"), "hessian_pattern": hessian
        }  # fmt: skip
        if jacobian:
            keywords |= {"jacobian": getattr(code, name + "_jac"), "jacobian_pattern": jacobian}
        return swb.Function.from_pointers(
            getattr(code, name), 4, 2, 0, n_out, inputs=inputs, name=name, keep=code, **keywords
        )

    return {
        "f0": make("f0", 4, "xu", ([0, 1, 2, 3], [2, 3, 4, 5])),
        "modes": make("modes", 2, ""),
        "c1": make("c1", 1, "x", ([0, 0], [0, 1]), ([1], [1])),
        "c2": make("c2", 1, "x", ([0, 0], [0, 1]), ([0], [0])),
        "rate": make("rate", 1, "xu", ([0] * 4, [2, 3, 4, 5]), ([2, 3, 4, 5], [2, 3, 4, 5])),
        "end": make("end", 2, "x", ([0, 1], [0, 1])),
    }


def python_functions() -> dict[str, object]:
    return {
        "f0": lambda x, u: (x[2], x[3], u[0], u[1]),
        "modes": [[-1.0], [1.0]],
        "c1": lambda x: x[0] + 0.15 * x[1] ** 2,
        "c2": lambda x: x[1] - 0.05 * x[0] ** 3,
        "rate": lambda x, u: u[0] ** 2 + u[1] ** 2 + x[2] ** 2 + x[3] ** 2,
        "end": lambda x: x[:2],
    }


def differentiated_functions() -> dict[str, swb.Function]:
    f = python_functions()
    gradient = {"jacobian_pattern": ([0] * 4, [2, 3, 4, 5]), "hessian_pattern": ([2, 3, 4, 5], [2, 3, 4, 5])}
    return {
        "f0": swb.Function.affine(np.zeros(4), np.eye(4, 6, k=2), nx=4, nu=2),
        "modes": f["modes"],
        "c1": swb.Function(
            f["c1"], 4, 2, jacobian=lambda x: (1.0, 0.3 * x[1]), jacobian_pattern=([0, 0], [0, 1]),
            hessian=lambda weights: 0.3 * weights, hessian_pattern=([1], [1]),
        ),
        "c2": swb.Function(
            f["c2"], 4, 2, jacobian=lambda x: (-0.15 * x[0] ** 2, 1.0), jacobian_pattern=([0, 0], [0, 1]),
            hessian=lambda x, weights: -0.3 * x[0] * weights, hessian_pattern=([0], [0]),
        ),
        "rate": swb.Function(
            f["rate"], 4, 2, jacobian=lambda x, u: (2 * x[2], 2 * x[3], 2 * u[0], 2 * u[1]),
            hessian=lambda weights: np.full(4, 2 * weights[0]), **gradient,
        ),
        "end": swb.Function.affine(np.zeros(2), np.eye(2, 4), nx=4, nu=2),
    }  # fmt: skip


def of_functions(functions: dict) -> tuple:
    """System, cost rate and terminal constraint of functions."""
    system = swb.System(4, 2, f0=functions["f0"])
    system.add_subsystem(functions["modes"], functions["c1"], [1, -1], rows=[0])
    system.add_subsystem(functions["modes"], functions["c2"], [1, -1], rows=[1])
    return system, functions["rate"], functions["end"]


def of_expressions() -> tuple:
    """The same, of expressions: the signs become modes."""
    m = swb.Model(states=4, controls=2)
    (q1, q2, v1, v2), u = m.x, m.u
    m.derivatives = [v1 - swb.sign(q1 + 0.15 * q2**2), v2 - swb.sign(q2 - 0.05 * q1**3), u[0], u[1]]
    return m.system(), m.function([u @ u + v1**2 + v2**2]), m.function([q1, q2])


def ours(problem: Callable[[], tuple], n_s: int) -> dict:
    wall, cpu = time.perf_counter(), time.process_time()
    system, rate, end = problem()
    inf = np.inf
    ocp = swb.Ocp(
        system, HORIZON, STAGES, n_s=n_s, n_fe=ELEMENTS, lagrange=rate, initial_state=X0,
        state_bounds=([-inf, -inf, -V_MAX, -V_MAX], [inf, inf, V_MAX, V_MAX]), control_bounds=(-U_MAX, U_MAX),
    )  # fmt: skip
    ocp.add_terminal(end, GOAL, GOAL)
    r = ocp.solve()
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    return {
        "error": miss(r.controls),
        "total_s": wall, "cpu_s": cpu, "build_s": r.stats.time_build, "eval_s": r.stats.time_eval,
        "iterations": r.stats.iterations, "cost": r.cost, "outcome": str(r.outcome), "polished": str(r.polished),
        "pair_min": r.residuals.pair_min, "primal": r.residuals.primal,
    }  # fmt: skip


def miss(controls: np.ndarray) -> float:
    """Largest component of the distance from the goal when these controls are simulated."""
    functions = differentiated_functions()
    system = swb.System(4, 2, f0=functions["f0"])
    system.add_subsystem(functions["modes"], functions["c1"], [1, -1], rows=[0])
    system.add_subsystem(functions["modes"], functions["c2"], [1, -1], rows=[1])
    steps = 20
    r = swb.simulate_fesd(
        system,
        X0,
        HORIZON,
        STAGES * steps,
        u=np.repeat(np.reshape(controls, (STAGES, 2)), steps, axis=0),
        n_s=4,
        n_fe=3,
    )
    if not r.success:
        return float("nan")
    x = r.state
    return float(np.max(np.abs(x[:2] - GOAL)))


def peer(n_s: int) -> dict:
    import casadi as ca
    import nosnoc

    wall, cpu = time.perf_counter(), time.process_time()
    q1, q2, v1, v2 = (ca.SX.sym(n) for n in ("q1", "q2", "v1", "v2"))
    u = ca.SX.sym("u", 2)
    x = ca.vertcat(q1, q2, v1, v2)
    fields = [[ca.vertcat(s + v1, 0, u[0], u[1]) for s in (-1, 1)], [ca.vertcat(0, s + v2, 0, 0) for s in (-1, 1)]]
    model = nosnoc.NosnocModel(
        x=x, u=u, x0=X0, F=[ca.horzcat(*f) for f in fields], S=[np.array([[1], [-1]])] * 2,
        c=[q1 + 0.15 * q2**2, q2 - 0.05 * q1**3],
    )  # fmt: skip
    inf = np.inf
    ocp = nosnoc.NosnocOcp(
        lbu=-U_MAX * np.ones(2), ubu=U_MAX * np.ones(2), lbx=np.array([-inf, -inf, -V_MAX, -V_MAX]),
        ubx=np.array([inf, inf, V_MAX, V_MAX]), f_q=ca.sumsqr(u) + v1**2 + v2**2, g_terminal=x[:2] - GOAL,
    )  # fmt: skip
    opts = nosnoc.NosnocOpts()
    opts.irk_scheme = nosnoc.IrkSchemes.RADAU_IIA
    opts.irk_representation = nosnoc.IrkRepresentation.DIFFERENTIAL
    opts.comp_tol = 1e-9
    opts.homotopy_update_slope = 0.1
    opts.step_equilibration = nosnoc.StepEquilibrationMode.HEURISTIC_MEAN
    opts.rho_h = 1e1
    opts.n_s, opts.N_stages, opts.N_finite_elements, opts.terminal_time = n_s, STAGES, ELEMENTS, HORIZON
    solver = nosnoc.NosnocSolver(opts, model, ocp)
    build = time.perf_counter() - wall
    wall = time.perf_counter()
    r = solver.solve()
    solve, cpu = time.perf_counter() - wall, time.process_time() - cpu
    h = np.array(r["w_sol"])[solver.problem.ind_h] if hasattr(solver.problem, "ind_h") else np.array([])
    # the cost that it reports contains the equilibration of the steps
    equilibration = 0.0
    if h.size:
        equilibration = opts.rho_h * float(np.sum((h - HORIZON / STAGES / ELEMENTS) ** 2))
    return {
        "build_s": build, "ipopt_cpu_s": sum(t for t in r["cpu_time_nlp"] if t), "solve_s": solve,
        "total_s": build + solve, "cpu_s": cpu, "iterations": int(sum(n for n in r["nlp_iter"] if n)),
        "cost_with_equilibration": float(r["cost_val"]), "cost": float(r["cost_val"]) - equilibration,
        "outcome": r["status"].name.lower(), "error": miss(np.array(r["u_list"])),
    }  # fmt: skip


def median(runs: list[dict]) -> dict:
    """The numbers' medians; what is no number, of the last run."""
    return {
        key: float(np.median([r[key] for r in runs])) if isinstance(value, float) else value
        for key, value in runs[-1].items()
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeat", type=int, default=3, help="runs of which the medians count")
    parser.add_argument("--n-s", type=int, nargs="+", default=[2, 3], help="stage points")
    parser.add_argument("--json", type=Path, help="write the numbers to this file")
    arguments = parser.parse_args()

    try:
        version = metadata.version("nosnoc")
    except metadata.PackageNotFoundError:
        version = None
        print("nosnoc is not installed (pip install nosnoc==0.2.0): only our own numbers\n")
    with tempfile.TemporaryDirectory() as folder:
        code = compile_model(folder)
    if code is None:
        print("no C compiler: only models in Python\n")

    record = {"switchback": swb.library_version, "nosnoc": version, "cases": []}
    print(
        f"{'n_s':>3} {'package':<32} {'total':>9} {'build':>9} {'IPOPT CPU':>9} {'it':>5} {'cost':>12} {'E(T)':>8}  outcome"
    )
    for n_s in arguments.n_s:
        case: dict = {"n_s": n_s}
        if version:
            case["nosnoc"] = median([peer(n_s) for _ in range(arguments.repeat)])
        if code is not None:
            compiled = compiled_functions(code)
            case["compiled"] = median([ours(lambda: of_functions(compiled), n_s) for _ in range(arguments.repeat)])
        ways = {
            "expressions": of_expressions,
            "derivatives": lambda: of_functions(differentiated_functions()),
            "python": lambda: of_functions(python_functions()),
        }
        for name, problem in ways.items():
            case[name] = median([ours(problem, n_s) for _ in range(arguments.repeat)])
        labels = {
            "nosnoc": f"nosnoc {version}",
            "compiled": "switchback, C model",
            "expressions": "switchback, expressions",
            "derivatives": "switchback, Python + derivatives",
            "python": "switchback, Python",
        }
        for name, label in labels.items():
            if name in case:
                r = case[name]
                ipopt = f"{r['ipopt_cpu_s']:9.4f}" if "ipopt_cpu_s" in r else 9 * " "
                print(
                    f"{n_s:>3} {label:<32} {r['total_s']:9.4f} {r['build_s']:9.4f} {ipopt} {r['iterations']:>5} "
                    f"{r['cost']:12.6f} {r['error']:8.1e}  {r['outcome']}"
                )
        if version:
            case["ratios"] = {
                name: {
                    "ipopt_cpu_over_ours": case["nosnoc"]["ipopt_cpu_s"] / case[name]["cpu_s"],
                    "total_over_ours": case["nosnoc"]["total_s"] / case[name]["total_s"],
                    "cpu_over_ours": case["nosnoc"]["cpu_s"] / case[name]["cpu_s"],
                }
                for name in ("compiled", "expressions", "derivatives", "python")
                if name in case
            }
            for name, ratio in case["ratios"].items():
                print(
                    f"    ours, {name}: nosnoc takes {ratio['ipopt_cpu_over_ours']:.1f} times as long inside IPOPT, "
                    f"{ratio['total_over_ours']:.1f} times with building, {ratio['cpu_over_ours']:.1f} times in CPU seconds"
                )
        record["cases"].append(case)
    if arguments.json:
        arguments.json.write_text(json.dumps(record, indent=2) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
