"""Programs with complementarity constraints as formulas that numpy, CasADi and the library's expressions evaluate: textbook
problems, random ones from seeds, and files of AMPL."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Callable, Iterator

import numpy as np

INF = math.inf
Member = tuple[str, int]  # ("x", i) a variable, ("c", i) a row


@dataclass
class Statement:
    """min f(x) subject to bounds on x and the rows, 0 <= G _|_ H >= 0 for pairs of variables or rows that are bounded by zero
    alone, and boxes: (variable, row, does the lower bound take part, does the upper one).

    `formulas(x, functions)` returns the objective and a list of rows; `functions` has exp, log, sin and others."""

    name: str
    formulas: Callable[[Any, Any], tuple[Any, list[Any]]]
    start: np.ndarray
    bounds: tuple[np.ndarray, np.ndarray]
    rows: tuple[np.ndarray, np.ndarray]
    pairs: list[tuple[Member, Member]] = field(default_factory=list)
    boxes: list[tuple[int, int, bool, bool]] = field(default_factory=list)

    @property
    def n(self) -> int:
        return len(self.start)

    @property
    def m(self) -> int:
        return len(self.rows[0])


def stated(name: str, n: int, f: Any, rows: Any = None, limits: Any = ((), ()), pairs: Any = (), lower: Any = -INF,
           upper: Any = INF, start: Any = 0.0) -> Statement:  # fmt: skip
    def full(v: Any, k: int) -> np.ndarray:
        return np.broadcast_to(np.asarray(v, float), k).copy()

    m = len(limits[0])
    return Statement(
        name, lambda x, o: (f(x), list(rows(x)) if rows else []), full(start, n), (full(lower, n), full(upper, n)),
        (full(limits[0], m), full(limits[1], m)), list(pairs),
    )  # fmt: skip


def x(i: int) -> Member:
    return ("x", i)


def c(i: int) -> Member:
    return ("c", i)


# --- problems of the literature (S. Leyffer, MacMPEC, and the papers it cites) ---------------------------------


def textbook(_: int, __: int) -> Iterator[Statement]:
    yield stated("kth1", 2, lambda w: w[0] + w[1], pairs=[(x(0), x(1))], lower=0, start=[1, 1])
    yield stated("kth2", 2, lambda w: w[0] + (w[1] - 1) ** 2, pairs=[(x(0), x(1))], lower=0, start=[1, 0.5])
    yield stated("kth3", 2, lambda w: 0.5 * (w[0] - 1) ** 2 + (w[1] - 1) ** 2, pairs=[(x(0), x(1))], lower=0, start=[1, 1])
    yield stated("scale", 2, lambda w: (100 * w[0] - 1) ** 2 + (w[1] - 1) ** 2, pairs=[(x(0), x(1))], lower=0, start=[1, 1])
    yield stated("leyffer-munson", 2, lambda w: (w[0] - 1) ** 2 + w[1] ** 2 * (w[1] + 1), pairs=[(x(0), x(1))], lower=0, start=[0.1, 0.1])
    low = ([0], [INF])
    yield stated("ralph1", 2, lambda w: 2 * w[0] - w[1], lambda w: [w[1] - w[0]], low, [(x(1), c(0))], lower=[0, 0], start=[1, 1])
    yield stated("ralph2", 2, lambda w: w[0] ** 2 + w[1] ** 2 - 4 * w[0] * w[1], pairs=[(x(0), x(1))], lower=0, start=[1, 1])
    yield stated("jr1", 2, lambda w: (w[0] - 1) ** 2 + w[1] ** 2, lambda w: [w[1] - w[0]], low, [(x(1), c(0))], lower=[-INF, 0])
    yield stated("jr2", 2, lambda w: (w[1] - 1) ** 2 + w[0] ** 2, lambda w: [w[1] - w[0]], low, [(x(1), c(0))], lower=[-INF, 0])
    yield stated(
        "scheel-scholtes", 3, lambda w: w[0] + w[1] - w[2], lambda w: [4 * w[0] - w[2], 4 * w[1] - w[2]],
        ([0, 0], [INF, INF]), [(x(0), x(1))], lower=[0, 0, -INF], start=[1, 1, 1],
    )  # fmt: skip
    yield stated(
        "bard1", 5, lambda w: (w[0] - 5) ** 2 + (2 * w[1] + 1) ** 2,
        lambda w: [2 * (w[1] - 1) - 1.5 * w[0] + w[2] - 0.5 * w[3] + w[4], 3 * w[0] - w[1] - 3, -w[0] + 0.5 * w[1] + 4, -w[0] - w[1] + 7],
        ([0, 0, 0, 0], [0, INF, INF, INF]), [(c(1), x(2)), (c(2), x(3)), (c(3), x(4))], lower=[0, 0, 0, 0, 0], start=1,
    )  # fmt: skip
    yield stated(
        "gauvin-savard", 3, lambda w: w[0] ** 2 + (w[1] - 10) ** 2, lambda w: [4 * (w[0] + 2 * w[1] - 30) + w[2], 20 - w[0] - w[1]],
        ([0, 0], [INF, INF]), [(x(1), c(0)), (x(2), c(1))], lower=0, upper=[15, INF, INF], start=[0, 1, 1],
    )  # fmt: skip


# --- random problems ------------------------------------------------------------------------------------------


def quadratic(seed: int, count: int) -> Iterator[Statement]:
    """Quadratic objective over an affine complementarity problem with a positive definite matrix (H. Jiang, D. Ralph, Comput.
    Optim. Appl. 13, 1999, in outline): parameters u with bounds, 0 <= y _|_ N u + M y + q >= 0."""
    for k in range(count):
        rng = np.random.default_rng([seed, 1, k])
        nu, ny = int(rng.integers(2, 9)), int(rng.integers(5, 31))
        n = nu + ny
        a, b = rng.normal(size=(n, n)), rng.normal(size=(ny, ny))
        q, lin = a @ a.T / n, rng.normal(size=n)
        matrix = b @ b.T / ny + 0.1 * np.eye(ny)
        rows = np.hstack([rng.normal(size=(ny, nu)), matrix])
        shift = rng.normal(size=ny)
        yield stated(
            f"quadratic-{seed}-{k}", n, lambda w, q=q, lin=lin: 0.5 * w @ q @ w + lin @ w,
            lambda w, rows=rows, shift=shift: rows @ w + shift, (np.zeros(ny), np.full(ny, INF)),
            [(x(nu + i), c(i)) for i in range(ny)], np.r_[np.full(nu, -2.0), np.zeros(ny)], np.r_[np.full(nu, 2.0), np.full(ny, INF)],
        )  # fmt: skip


def bilevel(seed: int, count: int) -> Iterator[Statement]:
    """A leader chooses u, a follower y = argmin of a strictly convex quadratic function under A y <= b + B u: the conditions of
    Karush, Kuhn and Tucker take its place."""
    for k in range(count):
        rng = np.random.default_rng([seed, 2, k])
        nu, ny, m = (int(v) for v in rng.integers([1, 2, 3], [5, 9, 13]))
        n = nu + ny + m
        g = rng.normal(size=(ny, ny))
        q, by = g @ g.T / ny + 0.5 * np.eye(ny), rng.normal(size=(ny, nu))
        a, b, shift = rng.normal(size=(m, ny)), rng.uniform(0.1, 2, m), rng.normal(size=(m, nu))
        goal = 2 * rng.normal(size=nu + ny)

        def rows(w: Any, nu=nu, ny=ny, q=q, by=by, a=a, b=b, shift=shift) -> list[Any]:
            u, y, mu = w[:nu], w[nu : nu + ny], w[nu + ny :]
            return [*(q @ y + by @ u + a.T @ mu), *(b + shift @ u - a @ y)]

        yield stated(
            f"bilevel-{seed}-{k}", n, lambda w, goal=goal: sum((w[i] - t) ** 2 for i, t in enumerate(goal)), rows,
            (np.zeros(ny + m), np.r_[np.zeros(ny), np.full(m, INF)]), [(x(nu + ny + i), c(ny + i)) for i in range(m)],
            np.r_[np.full(nu, -3.0), np.full(ny, -INF), np.zeros(m)], np.r_[np.full(nu, 3.0), np.full(ny + m, INF)],
        )  # fmt: skip


def bent(seed: int, count: int) -> Iterator[Statement]:
    """A nonconvex objective over a nonlinear complementarity problem with exponentials."""
    for k in range(count):
        rng = np.random.default_rng([seed, 3, k])
        nu, ny = int(rng.integers(1, 5)), int(rng.integers(3, 16))
        n = nu + ny
        a, b = rng.normal(size=(n, n)), rng.normal(size=(ny, ny))
        q, lin = 0.5 * (a + a.T) / math.sqrt(n), rng.normal(size=n)
        matrix, skew = b @ b.T / ny + 0.2 * np.eye(ny), 0.3 * (b - b.T)
        of_u, shift, rate = rng.normal(size=(ny, nu)), 2 * rng.normal(size=ny), rng.uniform(0.1, 0.5, ny)

        def formulas(w: Any, o: Any, nu=nu, q=q, lin=lin, m=matrix + skew, of_u=of_u, shift=shift, rate=rate) -> Any:
            u, y = w[:nu], w[nu:]
            f = 0.5 * w @ q @ w + lin @ w + 0.05 * sum(w[i] ** 4 for i in range(len(lin)))
            force = m @ y + of_u @ u + shift
            return f, [force[i] + o.exp(rate[i] * y[i]) - 1 for i in range(len(rate))]

        yield Statement(
            f"bent-{seed}-{k}", formulas, np.zeros(n), (np.r_[np.full(nu, -2.0), np.zeros(ny)], np.r_[np.full(nu, 2.0), np.full(ny, 20.0)]),
            (np.zeros(ny), np.full(ny, INF)), [(x(nu + i), c(i)) for i in range(ny)],
        )  # fmt: skip


def boxes(seed: int, count: int) -> Iterator[Statement]:
    """An objective over a mixed complementarity problem with a monotone affine function; of the bounds some are infinite."""
    for k in range(count):
        rng = np.random.default_rng([seed, 4, k])
        nu, ny = int(rng.integers(1, 5)), int(rng.integers(3, 21))
        n = nu + ny
        b, skew = rng.normal(size=(ny, ny)), rng.normal(size=(ny, ny))
        rows = np.hstack([rng.normal(size=(ny, nu)), b @ b.T / ny + 0.2 * np.eye(ny) + 0.3 * (skew - skew.T)])
        shift, goal = 2 * rng.normal(size=ny), rng.normal(size=n)
        low, high = -rng.uniform(0.1, 1, ny), rng.uniform(0.1, 1, ny)
        kind = rng.integers(0, 4, ny)
        low[kind == 1], high[kind == 2] = -INF, INF
        made = stated(
            f"boxes-{seed}-{k}", n, lambda w, goal=goal: sum((w[i] - t) ** 2 for i, t in enumerate(goal)),
            lambda w, rows=rows, shift=shift: rows @ w + shift, (np.zeros(ny), np.zeros(ny)),
            (), np.r_[np.full(nu, -2.0), low], np.r_[np.full(nu, 2.0), high],
        )  # fmt: skip
        made.boxes = [(nu + i, i, True, True) for i in range(ny)]
        yield made


# --- files of AMPL --------------------------------------------------------------------------------------------

UNARY = {
    15: "fabs", 37: "tanh", 38: "tan", 39: "sqrt", 40: "sinh", 41: "sin", 43: "log", 44: "exp", 45: "cosh", 46: "cos",
    49: "arctan", 51: "arcsin", 53: "arccos",
}  # fmt: skip
BINARY = {
    0: lambda a, b: a + b, 1: lambda a, b: a - b, 2: lambda a, b: a * b, 3: lambda a, b: a / b, 5: lambda a, b: a**b,
    76: lambda a, b: a**b, 78: lambda a, b: a**b,
}  # fmt: skip


class Unsupported(Exception):
    """A file has what this reader does not know: operators with kinks, integers, functions of libraries."""


class _Lines:
    def __init__(self, path: Path):
        self.lines = [line.split("#")[0].strip() for line in path.read_text(encoding="latin-1").splitlines()]
        self.at = 0

    def next(self) -> str:
        self.at += 1
        return self.lines[self.at - 1]

    def left(self) -> bool:
        return self.at < len(self.lines)

    def tree(self) -> Any:
        """An expression: a number, ("v", i), or (operator, operands)."""
        line = self.next()
        if line[0] == "n":
            return float(line[1:])
        if line[0] == "v":
            return ("v", int(line[1:]))
        if line[0] != "o":
            raise Unsupported(f"expression {line!r}")
        op = int(line[1:])
        if op == 54:
            return (op, [self.tree() for _ in range(int(self.next()))])
        if op in BINARY:
            return (op, [self.tree(), self.tree()])
        if op in UNARY or op in (16, 77):
            return (op, [self.tree()])
        raise Unsupported(f"operator {op}")


def nl(path: Path) -> Statement:
    """A text file of AMPL's format .nl (D. M. Gay, Writing .nl Files, 2005)."""
    source = _Lines(path)
    if not source.next().startswith("g"):
        raise Unsupported("a binary file")
    header = [[int(v) for v in source.next().split()] for _ in range(9)]
    n, m = header[0][:2]
    if sum(header[5]) > 0:
        raise Unsupported("variables that are integers")
    trees: dict[tuple[str, int], Any] = {}
    linear: dict[tuple[str, int], list[tuple[int, float]]] = {}
    maximise, start = False, np.zeros(n)
    bounds = {"r": np.tile([-INF, INF], (m, 1)), "b": np.tile([-INF, INF], (n, 1))}
    taking_part: list[tuple[int, int, bool, bool]] = []

    def pairs(count: int) -> list[tuple[int, float]]:
        lines = [source.next().split() for _ in range(count)]
        return [(int(a), float(b)) for a, b in lines]

    while source.left():
        line = source.next()
        if not line:
            continue
        kind, numbers = line[0], line[1:].split()
        if kind == "C":
            trees["C", int(numbers[0])] = source.tree()
        elif kind == "O":
            tree = source.tree()
            if int(numbers[0]) == 0:
                trees["O", 0], maximise = tree, numbers[1] == "1"
        elif kind == "V":
            i = int(numbers[0])
            linear["V", i] = pairs(int(numbers[1]))
            trees["V", i] = source.tree()
        elif kind in "JG":
            linear["C" if kind == "J" else "O", int(numbers[0])] = pairs(int(numbers[1]))
        elif kind == "x":
            for i, v in pairs(int(numbers[0])):
                start[i] = v
        elif kind == "d":
            pairs(int(numbers[0]))
        elif kind == "S":
            pairs(int(numbers[1]))
        elif kind == "k":
            for _ in range(int(numbers[0])):
                source.next()
        elif kind in "rb":
            for i in range(m if kind == "r" else n):
                how, *values = source.next().split()
                if how == "5":
                    flags, j = int(values[0]), int(values[1]) - 1
                    taking_part.append((j, i, bool(flags & 1), bool(flags & 2)))
                    bounds[kind][i] = 0.0, 0.0
                    continue
                v = [float(value) for value in values]
                bounds[kind][i] = {"0": v, "1": [-INF, *v], "2": [*v, INF], "3": [-INF, INF], "4": v * 2}[how]
        else:
            raise Unsupported(f"segment {kind}")

    def formulas(x: Any, o: Any) -> tuple[Any, list[Any]]:
        defined: dict[int, Any] = {}

        def value(tree: Any) -> Any:
            if isinstance(tree, float):
                return tree
            op, operands = tree
            if op == "v":
                if operands < n:
                    return x[operands]
                if operands not in defined:
                    defined[operands] = total(("V", operands))
                return defined[operands]
            if op == 54:
                return sum(value(t) for t in operands)
            v = [value(t) for t in operands]
            if op in BINARY:
                return BINARY[op](*v)
            if op == 16:
                return -v[0]
            return v[0] * v[0] if op == 77 else getattr(o, UNARY[op])(v[0])

        def total(key: tuple[str, int]) -> Any:
            return value(trees.get(key, 0.0)) + sum(a * x[j] for j, a in linear.get(key, ()))

        objective = total(("O", 0))
        return -objective if maximise else objective, [total(("C", i)) for i in range(m)]

    split = [(v[:, 0].copy(), v[:, 1].copy()) for v in (bounds["b"], bounds["r"])]
    return Statement(path.stem, formulas, start, split[0], split[1], boxes=taking_part)


def folder(path: Path) -> Iterator[Statement | tuple[str, str]]:
    """The problems of a folder, or the names of those that cannot be read, and why."""
    for file in sorted(path.rglob("*.nl")):
        try:
            yield nl(file)
        except (Unsupported, ValueError, IndexError, KeyError) as error:
            yield file.stem, str(error) or type(error).__name__


GENERATORS = {"textbook": textbook, "quadratic": quadratic, "bilevel": bilevel, "bent": bent, "boxes": boxes}
