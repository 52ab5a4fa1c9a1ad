"""Programs with complementarity pairs as C data and C callbacks (mpcc_problem.h), compiled adapter, and the measure
of a point that does not ask a solver."""

from __future__ import annotations

import ctypes
import json
import os
import shutil
import subprocess
from ctypes import POINTER, Structure, c_char_p, c_double, c_int, c_int32, c_void_p
from dataclasses import dataclass
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[2]
PROBLEMS = "SWITCHBACK_MPCC_PROBLEMS"  # environment variable: the folder of the problems

FUNCTION = ctypes.CFUNCTYPE(c_int, POINTER(c_double), c_void_p, POINTER(c_double), c_void_p)


class Raw(Structure):
    """struct mpcc_problem"""

    _fields_ = [
        *((name, c_int32) for name in ("abi", "n", "m", "c", "jac_nnz", "hess_nnz")),
        ("name", c_char_p),
        *((name, POINTER(c_double)) for name in ("x0", "lbx", "ubx", "lbg", "ubg")),
        *((f"{of}_{name}", POINTER(c_int32)) for of in ("jac", "hess") for name in ("colptr", "row", "col")),
        ("G_var", POINTER(c_int32)),
        ("H_var", POINTER(c_int32)),
        *((name, FUNCTION) for name in ("f", "grad", "con", "jac", "hess")),
        ("user", c_void_p),
    ]


class Code:
    """The interpreter of the problem files and the adapter, compiled into `folder`."""

    def __init__(self, problems: Path, folder: Path):
        compiler = os.environ.get("CC") or shutil.which("cc") or shutil.which("gcc")
        if compiler is None:
            raise SystemExit("a C compiler is needed: none of $CC, cc and gcc is there")
        target = folder / "libmpcc.so"
        subprocess.run(
            [compiler, "-O2", "-fPIC", "-shared", f"-I{problems}", f"-I{ROOT / 'include'}",
             problems / "mpcc_vm.c", HERE / "mpcc_adapter.c", "-o", target, "-lm"],
            check=True,
        )  # fmt: skip
        self.library = library = ctypes.CDLL(str(target))
        library.mpcc_open.restype, library.mpcc_open.argtypes = POINTER(Raw), [c_char_p]
        library.adapter_open.restype, library.adapter_open.argtypes = c_void_p, [POINTER(Raw), c_char_p]
        for name in ("n_kept", "n_jac", "scholtes_n_jac", "scholtes_n_hess", "iterations"):
            f = getattr(library, f"adapter_{name}")
            f.restype, f.argtypes = c_int, [c_void_p]
        for name in ("kept", "jac_row", "jac_col"):
            f = getattr(library, f"adapter_{name}")
            f.restype, f.argtypes = POINTER(c_int32), [c_void_p]
        for name in ("set_sigma", "set_deadline"):
            f = getattr(library, f"adapter_{name}")
            f.restype, f.argtypes = None, [c_void_p, c_double]
        for name in ("set_units", "set_sizes"):
            f = getattr(library, f"adapter_{name}")
            f.restype, f.argtypes = None, [c_void_p, POINTER(c_double)]
        for name in ("set_elastic", "count"):
            f = getattr(library, f"adapter_{name}")
            f.restype, f.argtypes = None, [c_void_p, c_int]
        library.adapter_functions.restype, library.adapter_functions.argtypes = c_double, [c_void_p]
        library.adapter_reset.restype, library.adapter_reset.argtypes = None, [c_void_p]


def numbers(pointer, n: int) -> np.ndarray:
    return np.ctypeslib.as_array(pointer, (n,)).copy() if n else np.empty(0)


@dataclass(frozen=True)
class Measured:
    """A point as the problem's own functions see it: violation of bounds, rows and signs of the pairs, the largest
    product of a pair and the largest of the smaller members."""

    objective: float
    violation: float
    product: float
    pair_min: float


class Problem:
    """min f(x) subject to bounds of x and of g(x), and 0 <= G(x) _|_ H(x) >= 0."""

    def __init__(self, code: Code, path: Path, seed: int = 0):
        self.library = code.library
        self.pointer = code.library.mpcc_open(os.fsencode(path))
        if not self.pointer:
            raise SystemExit(f"{path} is no problem of this version")
        raw = self.raw = self.pointer.contents
        self.n, self.m, self.c = raw.n, raw.m, raw.c
        self.rows = raw.m + 2 * raw.c
        self.x0, self.lbx, self.ubx = (numbers(v, self.n) for v in (raw.x0, raw.lbx, raw.ubx))
        self.lbg, self.ubg = numbers(raw.lbg, self.m), numbers(raw.ubg, self.m)
        self.pair_variables = np.concatenate([numbers(raw.G_var, self.c), numbers(raw.H_var, self.c)]).astype(int)
        if seed:
            self.x0 = self._moved(seed)
        self.units: np.ndarray | None = None  # [1 + rows] what our solver sees objective and rows multiplied by
        self.sizes: np.ndarray | None = None  # [n] what it sees variables multiplied by
        self.hess_row, self.hess_col = (numbers(v, raw.hess_nnz) for v in (raw.hess_row, raw.hess_col))

    def _moved(self, seed: int) -> np.ndarray:
        """Another start: numbers moved by a tenth of 1 + their size, inside the bounds."""
        shift = 0.1 * (1 + np.abs(self.x0)) * np.random.default_rng(seed).standard_normal(self.n)
        return np.clip(self.x0 + shift, self.lbx, self.ubx)

    def _call(self, name: str, x: np.ndarray, y: np.ndarray | None, n_out: int) -> np.ndarray:
        out = np.empty(max(n_out, 1))
        x = np.ascontiguousarray(x, dtype=float)
        weights = None if y is None else np.ascontiguousarray(y, dtype=float).ctypes.data
        at, to = (v.ctypes.data_as(POINTER(c_double)) for v in (x, out))
        getattr(self.raw, name)(at, weights, to, self.raw.user)
        return out[:n_out]

    def pair_values(self, x: np.ndarray) -> np.ndarray:
        """[2, c] G and H at x."""
        return self._call("con", x, None, self.rows)[self.m :].reshape(2, self.c)

    def measure(self, x: np.ndarray) -> Measured:
        f = float(self._call("f", x, None, 1)[0])
        con = self._call("con", x, None, self.rows)
        g, pairs = con[: self.m], con[self.m :].reshape(2, self.c)
        over = [self.lbx - x, x - self.ubx, self.lbg - g, g - self.ubg, -pairs.ravel(), np.zeros(1)]
        violation = max(float(v.max()) for v in over if v.size)
        if not self.c:
            return Measured(f, violation, 0.0, 0.0)
        return Measured(f, violation, float(np.abs(pairs.prod(axis=0)).max()), float(np.abs(pairs.min(axis=0)).max()))

    def is_linear(self, objective: bool) -> bool:
        """Are the second derivatives of the objective, or of the rows, zero at points around the start?"""
        rng = np.random.default_rng(1)
        for _ in range(3):
            y = np.zeros(1 + self.rows)
            y[: 1 if objective else None] = 1.0 if objective else rng.uniform(1, 2, 1 + self.rows)
            y[0] = float(objective)
            x = self.x0 + rng.uniform(-1, 1, self.n) * (1 + np.abs(self.x0))
            if np.any(self._call("hess", x, y, self.raw.hess_nnz) != 0.0):
                return False
        return True

    def variable_members(self) -> np.ndarray:
        """[2 c] is a member a variable of its own that may be zero? Then it needs no row."""
        v = self.pair_variables
        inside = np.where(v >= 0, (self.lbx[v] <= 0.0) & (self.ubx[v] > 0.0), False)
        same = np.tile((v[: self.c] == v[self.c :]) & (v[: self.c] >= 0), 2)
        return inside & ~same

    def adapter(self, member: np.ndarray) -> int:
        """A new adapter; it lives as long as the process."""
        made = self.library.adapter_open(self.pointer, member.astype(np.uint8).tobytes())
        if not made:
            raise MemoryError
        return made


def collection(folder: Path, name: str = "train") -> dict[str, dict]:
    """The problems that `name`.json lists: the file, what is known, and what solvers did where that is recorded."""
    return json.loads((folder / f"{name}.json").read_text())
