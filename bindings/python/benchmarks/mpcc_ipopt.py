"""IPOPT with MUMPS through its C interface, and two homotopies around it: Scholtes' relaxation, and the elastic mode in
the maximum norm."""

from __future__ import annotations

import ctypes
import os
import time
from ctypes import POINTER, byref, c_char_p, c_double, c_int, c_void_p
from pathlib import Path

import numpy as np

from mpcc_problems import Problem

SIGMA = [10.0**-k for k in range(10)]
PRODUCT = 1e-7

# Of both variants: solve every program to 1e-8, keep bounds as they are (a relaxed product would miss the tolerance).
COMMON = {
    "linear_solver": "mumps",
    "tol": 1e-8,
    "bound_relax_factor": 0.0,
    "max_iter": 3000,
    "print_level": 0,
    "sb": "yes",
}
VARIANTS = {
    "monotone": {},
    "adaptive": {"mu_strategy": "adaptive", "mu_oracle": "quality-function"},
}
# scholtes: G_i H_i <= sigma. linf: min f + s / sigma, G_i H_i <= s, with one variable s of these bounds and this start.
MODES = ("scholtes", "linf")
ELASTIC_MAX, ELASTIC_START = 10.0, 1.0
SOLVED = (0, 1)
STATUS = {
    0: "solved", 1: "acceptable", 2: "infeasible", 3: "step too small", 4: "diverging", 5: "time", 6: "feasible point",
    -1: "max_iter", -2: "restoration failed", -3: "step failed", -4: "time", -5: "time", -10: "too few variables",
    -11: "invalid problem", -12: "invalid option", -13: "invalid number", -100: "exception", -101: "exception",
    -102: "memory", -199: "internal error",
}  # fmt: skip


class Ipopt:
    """The library: that of the CasADi wheel, or libipopt of the system."""

    def __init__(self) -> None:
        places = []
        try:
            import casadi

            places += sorted(Path(casadi.__file__).parent.glob("libipopt.so.3"))
            casadi_version = casadi.__version__
        except ImportError:
            casadi_version = None
        for place in [*map(str, places), "libipopt.so.3"]:
            try:
                self.library = library = ctypes.CDLL(place)
                break
            except OSError:
                continue
        else:
            raise SystemExit("IPOPT is missing: pip install casadi, or give --no-ipopt")
        version = [c_int() for _ in range(3)]
        library.GetIpoptVersion(*map(byref, version))
        self.version = ".".join(str(v.value) for v in version)
        self.origin = f"CasADi {casadi_version}" if places else "system"
        doubles = POINTER(c_double)
        library.CreateIpoptProblem.restype = c_void_p
        library.CreateIpoptProblem.argtypes = [
            c_int, doubles, doubles, c_int, doubles, doubles, c_int, c_int, c_int, *[c_void_p] * 5
        ]  # fmt: skip
        library.FreeIpoptProblem.restype, library.FreeIpoptProblem.argtypes = None, [c_void_p]
        for kind, number in (("Str", c_char_p), ("Num", c_double), ("Int", c_int)):
            f = getattr(library, f"AddIpopt{kind}Option")
            f.restype, f.argtypes = ctypes.c_bool, [c_void_p, c_char_p, number]
        library.SetIntermediateCallback.restype = ctypes.c_bool
        library.SetIntermediateCallback.argtypes = [c_void_p, c_void_p]
        library.IpoptSolve.restype = c_int
        library.IpoptSolve.argtypes = [c_void_p, *[doubles] * 6, c_void_p]

    def _option(self, problem: int, name: str, value: object) -> None:
        kind = "Str" if isinstance(value, str) else "Int" if isinstance(value, int) else "Num"
        given = value.encode() if isinstance(value, str) else value
        if not getattr(self.library, f"AddIpopt{kind}Option")(problem, name.encode(), given):
            raise SystemExit(f"IPOPT does not know the option {name}={value}")

    def _create(self, problem: Problem, adapter: int, lbx, ubx, lower, upper, variant: str) -> int:
        code = problem.library
        arrays = [np.clip(v, -2e19, 2e19) for v in (lbx, ubx, lower, upper)]
        xl, xu, gl, gu = (v.ctypes.data_as(POINTER(c_double)) for v in arrays)
        callbacks = [ctypes.cast(getattr(code, f"scholtes_{f}"), c_void_p) for f in ("f", "g", "grad", "jac", "hess")]
        made = self.library.CreateIpoptProblem(
            len(lbx), xl, xu, len(lower), gl, gu, code.adapter_scholtes_n_jac(adapter),
            code.adapter_scholtes_n_hess(adapter), 0, *callbacks,
        )  # fmt: skip
        if not made:
            raise RuntimeError("IPOPT refuses the problem")
        for name, value in (COMMON | VARIANTS[variant]).items():
            self._option(made, name, value)
        self.library.SetIntermediateCallback(made, ctypes.cast(code.scholtes_iteration, c_void_p))
        return made

    def _solve(self, made: int, adapter: int, x: np.ndarray) -> int:
        at = x.ctypes.data_as(POINTER(c_double))
        return self.library.IpoptSolve(made, at, None, byref(c_double()), None, None, None, adapter)

    def homotopy(
        self, problem: Problem, variant: str, limit: float, mode: str = "scholtes", count: bool = False
    ) -> dict:
        """Solve for falling sigma, each program from the point before, until one is solved and all products are small.
        CPU time is that inside IPOPT; making the problem is not part of it. Seconds in the functions are counted on demand."""
        code = problem.library
        program = Relaxed(problem, mode == "linf")
        adapter = program.adapter
        made = self._create(problem, adapter, *program.bounds(), variant)
        code.adapter_set_deadline(adapter, limit)
        code.adapter_count(adapter, count)
        x = program.start()
        iterations, cpu, solves, solved, status = 0, 0.0, 0, False, "none"
        try:
            for sigma in SIGMA:
                code.adapter_set_sigma(adapter, sigma)
                code.adapter_reset(adapter)
                clock = time.thread_time()
                number = self._solve(made, adapter, x)
                cpu += time.thread_time() - clock
                iterations += code.adapter_iterations(adapter)
                solves += 1
                status = STATUS.get(number, str(number))
                solved = number in SOLVED and problem.measure(x[: problem.n]).product <= PRODUCT
                if solved or status == "time":
                    break
        finally:
            self.library.FreeIpoptProblem(made)
        return {
            "solved": solved, "outcome": status, "x": x[: problem.n], "iterations": iterations, "cpu": cpu, "solves": solves,
            "sigma": sigma, "functions": code.adapter_functions(adapter) if count else None,
        }  # fmt: skip

    def branch_objective(self, problem: Problem, x: np.ndarray, variant: str, limit: float) -> float | None:
        """Objective of the program in which the smaller member of each pair at x is zero, solved from x; None if that
        fails. A relaxation is below what any point without it reaches; this is what the point is worth."""
        program = Relaxed(problem)
        made = self._create(problem, program.adapter, *program.branch(x), variant)
        problem.library.adapter_set_deadline(program.adapter, limit)
        y = x.copy()
        try:
            number = self._solve(made, program.adapter, y)
        finally:
            self.library.FreeIpoptProblem(made)
        point = problem.measure(y)
        return point.objective if number in SOLVED and max(point.violation, point.product) <= 1e-8 else None


class Relaxed:
    """The relaxation as IPOPT gets it: variables, rows that are no products, products minus sigma (or minus the last
    variable, where that is elastic)."""

    def __init__(self, problem: Problem, elastic: bool = False):
        code = problem.library
        self.problem, self.elastic = problem, elastic
        self.member = problem.variable_members()
        self.adapter = problem.adapter(self.member)
        code.adapter_set_elastic(self.adapter, int(elastic))
        self.kept = np.array(code.adapter_kept(self.adapter)[: code.adapter_n_kept(self.adapter)], dtype=int)

    def start(self) -> np.ndarray:
        x = self.problem.x0.copy()
        return np.append(x, ELASTIC_START) if self.elastic else x

    def bounds(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Lower and upper bounds of the variables and of the rows."""
        p = self.problem
        lower = np.concatenate([p.lbg, np.zeros(2 * p.c)])[self.kept]
        upper = np.concatenate([p.ubg, np.full(2 * p.c, np.inf)])[self.kept]
        lbx = p.lbx.copy()
        variables = p.pair_variables[self.member]
        lbx[variables] = np.maximum(lbx[variables], 0.0)
        ubx = p.ubx.copy()
        if self.elastic:
            lbx, ubx = np.append(lbx, 0.0), np.append(ubx, ELASTIC_MAX)
        products = np.full(p.c, np.inf), np.zeros(p.c)
        return lbx, ubx, np.concatenate([lower, -products[0]]), np.concatenate([upper, products[1]])

    def branch(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """The same with the smaller members at x zero, and no products."""
        p = self.problem
        lbx, ubx, lower, upper = self.bounds()
        pairs = p.pair_values(x)
        zero = np.concatenate([pairs[0] <= pairs[1], pairs[0] > pairs[1]])
        ubx[p.pair_variables[self.member & zero]] = 0.0
        row = np.full(p.rows, -1)
        row[self.kept] = np.arange(len(self.kept))
        upper[row[p.m :][~self.member & zero]] = 0.0
        upper[len(self.kept) :] = np.inf
        return lbx, ubx, lower, upper


def single_thread() -> None:
    """Before the library is loaded: one thread for BLAS and OpenMP."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"
