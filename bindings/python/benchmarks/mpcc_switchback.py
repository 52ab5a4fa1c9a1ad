"""Our solver on a problem of C callbacks: no Python inside a solve."""

from __future__ import annotations

import ctypes
import importlib.util
import json
import os
import sys
import time
from typing import Any, Mapping

import numpy as np

from mpcc_problems import HERE, ROOT, Problem


def load(library: str | None) -> Any:
    """The package that is installed, or that of this repository where none is, or where a library is given."""
    if library or importlib.util.find_spec("switchback_control") is None:
        sys.path.insert(0, str(HERE.parent / "src"))
        built = ROOT / "target" / "release" / "libswitchback.so"
        if library or ("SWITCHBACK_LIBRARY" not in os.environ and built.is_file()):
            os.environ["SWITCHBACK_LIBRARY"] = os.path.abspath(library or built)
    import switchback_control

    return switchback_control


def functions(swb: Any, problem: Problem, adapter: int) -> tuple[Any, Any, np.ndarray]:
    """Objective and constraints without second derivatives, and the row of each row of con among the constraints
    (-1: none)."""
    code, n = problem.library, problem.n
    n_kept, n_jac = code.adapter_n_kept(adapter), code.adapter_n_jac(adapter)
    kept = np.array(code.adapter_kept(adapter)[:n_kept], dtype=int)
    position = np.full(problem.rows, -1)
    position[kept] = np.arange(n_kept)

    def make(name: str, n_out: int, jacobian: tuple) -> Any:
        return swb.Function.from_pointers(
            getattr(code, f"adapter_{name}"), n, n_out=n_out, jacobian=getattr(code, f"adapter_{name}_jac"),
            jacobian_pattern=jacobian, inputs="x", user_data=adapter, name=name, keep=code, linear=True,
        )  # fmt: skip

    objective = make("f", 1, (np.zeros(n, dtype=int), np.arange(n)))
    if not n_kept:
        return objective, None, position
    rows, cols = (np.array(f(adapter)[:n_jac], dtype=int) for f in (code.adapter_jac_row, code.adapter_jac_col))
    return objective, make("c", n_kept, (rows, cols)), position


def program(swb: Any, problem: Problem, members: str, options: Mapping[str, str]) -> tuple[Any, int]:
    """The problem as an Mpcc, and its adapter. `members`: "auto", members that are variables are given as such;
    "rows", as rows."""
    member = problem.variable_members() & (members == "auto")
    adapter = problem.adapter(member)
    objective, constraints, position = functions(swb, problem, adapter)
    rows = position >= 0
    lower = np.concatenate([problem.lbg, np.zeros(2 * problem.c)])[rows]
    upper = np.concatenate([problem.ubg, np.full(2 * problem.c, np.inf)])[rows]
    if problem.units is not None:
        units = np.ascontiguousarray(problem.units)
        problem.library.adapter_set_units(adapter, units.ctypes.data_as(ctypes.POINTER(ctypes.c_double)))
        lower, upper = lower * units[1:][rows], upper * units[1:][rows]
    sizes = np.ones(problem.n) if problem.sizes is None else np.ascontiguousarray(problem.sizes)
    if problem.sizes is not None:
        problem.library.adapter_set_sizes(adapter, sizes.ctypes.data_as(ctypes.POINTER(ctypes.c_double)))

    def of(i: int) -> Any:
        return swb.variable(problem.pair_variables[i]) if member[i] else swb.constraint(position[problem.m + i])

    mpcc = swb.Mpcc(
        problem.n, objective, constraints, pairs=[(of(i), of(problem.c + i)) for i in range(problem.c)],
        bounds=(problem.lbx * sizes, problem.ubx * sizes), constraint_bounds=(lower, upper) if rows.any() else None,
        start=problem.x0 * sizes, settings=options,
    )  # fmt: skip
    if not (problem.is_linear(objective=True) and problem.is_linear(objective=False)):
        pattern = (problem.hess_row, problem.hess_col)
        mpcc.set_hessian(problem.library.adapter_hess, pattern, user_data=adapter, keep=problem.library)
    return mpcc, adapter


def solve(
    swb: Any, problem: Problem, members: str, options: Mapping[str, str], limit: float, count: bool = False
) -> dict:
    """Solve once; after `limit` CPU seconds an iteration is the last one. CPU time is that of the one call that solves,
    which builds and orders the program as well; `functions` are the seconds in the functions of the problem, where they are
    counted (`count`), which takes time itself; `setup` is that of describing the program to the library, with what the
    Python package adds."""
    from switchback_control._library import lib

    clock = time.thread_time()
    mpcc, adapter = program(swb, problem, members, options)
    setup = time.thread_time() - clock
    watch = ctypes.cast(problem.library.adapter_iteration, swb._ffi.swb_iteration_fn)
    lib.swb_mpcc_set_iteration(mpcc._handle, watch, adapter)
    problem.library.adapter_set_deadline(adapter, limit)
    problem.library.adapter_count(adapter, count)
    outcome = ctypes.c_int32()
    clock = time.thread_time()
    status = lib.swb_mpcc_solve(mpcc._handle, ctypes.byref(outcome))
    cpu = time.thread_time() - clock
    in_functions = problem.library.adapter_functions(adapter) if count else None
    if status != 0:
        message = lib.swb_last_error().decode("utf-8", "replace")
        return {
            "solved": False, "outcome": f"error {status}", "message": message, "x": problem.x0, "iterations": 0,
            "cpu": cpu, "functions": in_functions,
        }  # fmt: skip
    r = mpcc.result
    stats = r.stats
    x = r.x if problem.sizes is None else r.x / problem.sizes
    return {
        "solved": r.success, "outcome": str(r.outcome), "polished": str(r.polished), "x": x,
        "iterations": stats.iterations, "polish_iterations": stats.polish_iterations,
        "restoration_iterations": stats.restoration_iterations, "factorisations": stats.factorisations,
        "evaluations": stats.evaluations, "max_delta_w": stats.max_delta_w, "cpu": cpu, "functions": in_functions, "eval": stats.time_eval,
        "linalg": stats.time_linalg, "build": stats.time_build, "n": stats.n_variables, "m": stats.n_constraints,
        "pairs": stats.n_pairs, "setup": setup, "dual": r.residuals.dual, "stationarity": r.stationarity,
        "b_stationary": r.b_stationary, "found_by": json.loads(r.to_json())["stats"].get("found_by", "path"),
    }  # fmt: skip
