"""Outcomes of programs with pairs against their branches, which are enumerated by another linear programming code."""

import itertools

import numpy as np
import pytest

import switchback_control as swb

INF = np.inf
linprog = pytest.importorskip("scipy.optimize").linprog


def draw(seed):
    """min ½xᵀHx + cᵀx, rows and bounds of 2 to 6 variables, and 1 to 4 pairs of affine functions, with small integers."""
    r = np.random.default_rng(seed)
    n = int(r.integers(2, 7))
    k, m = int(r.integers(1, min(4, n) + 1)), int(r.integers(0, 4))

    def some(*shape):
        return r.integers(-3, 4, shape) * (r.random(shape) < 0.6)

    A, inside = some(m, n).astype(float), r.integers(0, 4, n)
    b, kind = A @ inside + r.integers(-3, 4, m), r.integers(0, 3, m)
    low, high = np.where(kind == 1, -INF, b), np.where(kind == 2, INF, b)
    G = np.where(r.random((2 * k, 1)) < 0.5, np.eye(n)[r.integers(0, n, 2 * k)], some(2 * k, n))
    g = np.where(r.random(2 * k) < 0.5, r.integers(-4, 5, 2 * k), 0.0)
    L = some(n, n).astype(float) * (r.random() < 0.4)
    L[:, n // 2 :] = 0.0
    bounds = np.where(r.random(n) < 0.7, 0.0, -INF), np.where(r.random(n) < 0.3, 5.0, INF)
    return dict(A=A, rows=(low, high), bounds=bounds, G=G, g=g, c=r.integers(-3, 4, n).astype(float), H=L @ L.T)


def other_units(d, seed):
    """The same in variables, rows, members and an objective multiplied by powers of ten."""
    r = np.random.default_rng(seed)
    x, row, member, cost = (10.0 ** r.integers(-3, 4, size) for size in (len(d["c"]), len(d["A"]), len(d["g"]), 1))
    return dict(
        A=d["A"] * x * row[:, None], rows=[b * row for b in d["rows"]], bounds=[b / x for b in d["bounds"]],
        G=d["G"] * x * member[:, None], g=d["g"] * member, c=cost * d["c"] * x, H=cost * d["H"] * x * x[:, None], x=x,
    )  # fmt: skip


def least(c, A, low, high, bounds):
    """Status (0 solved, 2 infeasible) and the least value of cᵀx."""
    up, down = np.isfinite(high), np.isfinite(low)
    rows, limits = np.vstack([A[up], -A[down]]), np.r_[high[up], -low[down]]
    given = dict(A_ub=rows, b_ub=limits) if len(rows) else {}
    for options in ({}, {"presolve": False}):
        r = linprog(c, bounds=np.transpose(bounds), method="highs", options=options, **given)
        if r.status in (0, 2):
            break
    return r.status, r.fun


def directions(low, high):
    return np.where(np.isfinite(low), 0.0, -INF), np.where(np.isfinite(high), 0.0, INF)


def branch(d, sides):
    high = np.full(len(d["g"]), INF)
    high[2 * np.arange(len(sides)) + sides] = 0.0
    return np.vstack([d["A"], d["G"]]), np.r_[d["rows"][0], -d["g"]], np.r_[d["rows"][1], high - d["g"]]


def truth(d):
    """Has a branch a point, and has one of them none and a ray along which the objective falls?"""
    feasible = unbounded = False
    n = len(d["c"])
    for sides in itertools.product((0, 1), repeat=len(d["g"]) // 2):
        A, low, high = branch(d, np.array(sides))
        if least(np.zeros(n), A, low, high, d["bounds"])[0] == 2:
            continue
        feasible = True
        low, high = directions(low, high)
        inside = [np.clip(b, -1, 1) for b in directions(*d["bounds"])]
        flat = np.vstack([A, d["H"]]), np.r_[low, np.zeros(n)], np.r_[high, np.zeros(n)]
        unbounded |= least(d["c"], *flat, inside)[1] < -1e-9
    return feasible, unbounded


def holds(d, x, room=1e-6):
    """Do bounds, rows and pairs hold at x?"""
    rows, members = d["A"] @ x, d["G"] @ x + d["g"]
    (low, high), (first, last) = d["rows"], d["bounds"]
    inside = np.r_[low - rows, rows - high, first - x, x - last, -members]
    return inside.max() <= room and np.minimum(members[::2], members[1::2]).max() <= room


def solve(d, **options):
    m, k, n = len(d["A"]), len(d["g"]) // 2, len(d["c"])
    C, offset = np.vstack([d["A"], d["G"]]), np.r_[np.zeros(m), d["g"]]
    return swb.Mpcc(
        n, lambda x: 0.5 * (x @ (d["H"] @ x)) + d["c"] @ x, lambda x: C @ x + offset, n_constraints=m + 2 * k,
        bounds=d["bounds"], constraint_bounds=(np.r_[d["rows"][0], np.zeros(2 * k)], np.r_[d["rows"][1], np.full(2 * k, INF)]),
        pairs=[(swb.constraint(m + 2 * i), swb.constraint(m + 2 * i + 1)) for i in range(k)],
        start=np.clip(np.ones(n), *d["bounds"]), **options,
    ).solve()  # fmt: skip


def test_words_are_true():
    seen = set()
    for seed in range(30):
        own = draw(seed)
        feasible, unbounded = truth(own)
        for d in (own, other_units(own, seed)):
            r = solve(d)
            word = str(r.outcome)
            seen.add(word)
            assert word in ("solved", "infeasible", "locally_infeasible", "diverging", "stalled"), (seed, word)
            assert word != "solved" or (holds(d, r.x) and r.b_stationary is not False), seed
            assert word != "infeasible" or not feasible, seed
            # a ray starts at a point
            assert word != "diverging" or (unbounded and r.residuals.pair_min == 0.0), seed
    assert {"solved", "infeasible", "diverging"} <= seen


@pytest.mark.parametrize(
    "row, high", [(lambda x: x[1] * (1 + x[0]) - 1, INF), (lambda x: x[1] * (1 + x[0] ** 2) - 1, 0.0), (lambda x: x[1] - 1e-3, INF)]
)
def test_relaxations_without_a_lower_bound_do_not_speak_for_the_program(row, high):
    """x1 > 0 by the row, so that x0 = 0; products up to σ leave x0 without a limit."""
    r = swb.Mpcc(
        2, lambda x: -x[0], lambda x: [row(x)], n_constraints=1, constraint_bounds=(0, high), pairs=[(0, 1)], start=[1, 1]
    ).solve()  # fmt: skip
    assert r.success and r.x[0] == 0.0 and r.x[1] >= 1e-3 - 1e-9


def test_what_cannot_be_proved_is_local():
    """x0 x1 >= 1 of a pair contradicts it, which no linear row says."""
    r = swb.Mpcc(
        2, lambda x: x[0] + x[1], lambda x: [x[0] * x[1]], n_constraints=1, constraint_bounds=(1, INF), pairs=[(0, 1)], start=[1, 1]
    ).solve()  # fmt: skip
    assert r.outcome == swb.Outcome.LOCALLY_INFEASIBLE and not r.success and r.residuals.pair_min == 0.0
