"""Nonlinear programs with and without complementarity: problems of the literature."""

import numpy as np
import pytest

import switchback_control as swb
from switchback_control import constraint as c
from switchback_control import variable as v

INF = np.inf

PROBLEMS = {
    # B-stationary, not S-stationary: no multipliers of the right sign exist
    "scheel_scholtes": dict(
        n=3, f=lambda x: x[0] + x[1] - x[2], g=lambda x: [4 * x[0] - x[2], 4 * x[1] - x[2]],
        limits=(0.0, [INF, INF]), pairs=[(0, 1)], start=[1, 1, 1], x=[0, 0, 0], best=0.0,
    ),
    # (0, 0) is M-stationary with a direction of descent
    "leyffer_munson": dict(
        n=2, f=lambda x: (x[0] - 1) ** 2 + x[1] ** 2 * (x[1] + 1), pairs=[(v(0), v(1))],
        start=[0.1, 0.1], x=[1, 0], best=0.0,
    ),
    "kth2": dict(n=2, f=lambda x: x[0] + (x[1] - 1) ** 2, pairs=[(0, 1)], start=[1, 0.5], x=[0, 1], best=0.0),
    "ralph1": dict(
        n=2, f=lambda x: 2 * x[0] - x[1], g=[lambda x: x[1] - x[0]], bounds=([0, -INF], None), pairs=[(v(1), c(0))],
        start=[1, 1], x=[0, 0], best=0.0,
    ),
    "jr1": dict(
        n=2, f=lambda w: (w[0] - 1) ** 2 + w[1] ** 2, g=[lambda w: w[1] - w[0]], pairs=[(1, c(0))], start=[0, 0],
        x=[0.5, 0.5], best=0.5,
    ),
    "bard1": dict(
        n=5, f=lambda x: (x[0] - 5) ** 2 + (2 * x[1] + 1) ** 2,
        g=lambda x: [
            2 * (x[1] - 1) - 1.5 * x[0] + x[2] - 0.5 * x[3] + x[4],
            3 * x[0] - x[1] - 3, -x[0] + 0.5 * x[1] + 4, -x[0] - x[1] + 7,
        ],
        bounds=([0, 0, -INF, -INF, -INF], None), limits=([0, 0, 0, 0], [0, INF, INF, INF]),
        pairs=[(c(1), v(2)), (c(2), v(3)), (c(3), v(4))], start=[1] * 5, x=[1, 0, 3.5, 0, 0], best=17.0,
    ),
    "hs71": dict(
        n=4, f=lambda x: x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2], g=lambda x: [np.prod(x), x @ x], bounds=(1, 5),
        limits=([25, 40], [INF, 40]), start=[1, 5, 5, 1],
        x=[1, 4.742999644, 3.821149978, 1.379408295], best=17.0140172891,
    ),
    "rosenbrock": dict(
        n=2, f=lambda x: 100 * (x[1] - x[0] ** 2) ** 2 + (1 - x[0]) ** 2, start=[-1.2, 1], x=[1, 1], best=0.0
    ),
}  # fmt: skip


def make(p, **options):
    kind = swb.Mpcc if p.get("pairs") else swb.Nlp
    return kind(
        p["n"], p["f"], p.get("g"), bounds=p.get("bounds"), constraint_bounds=p.get("limits"), pairs=p.get("pairs", ()),
        start=p["start"], **options,
    )  # fmt: skip


@pytest.mark.parametrize("name", PROBLEMS)
def test_textbook(name):
    p = PROBLEMS[name]
    program = make(p)
    r = program.solve()
    assert r.success and r.objective == pytest.approx(p["best"], abs=1e-6)
    assert np.allclose(r.x, p["x"], atol=2e-5)
    k, m = len(p.get("pairs", ())), program.m
    assert [len(a) for a in (r.g, r.h, r.nu, r.xi, r.constraints, r.y, r.z)] == [k, k, k, k, m, m, p["n"]]
    if k:
        assert r.g.min() > -1e-7 and r.h.min() > -1e-7 and np.minimum(r.g, r.h).max() < 1e-4
    assert r.residuals.primal < 1e-8 and r.stats.n_pairs == k
    assert f"{k} pairs" in repr(program)


def test_multipliers():
    nlp = swb.Nlp(
        2,
        lambda x: (x[0] - 1) ** 2 + x[1] ** 2,
        lambda x: x.sum(),
        1,
        bounds=([-INF, 2], None),
        constraint_bounds=(3, 3),
    )
    r = nlp.solve()
    assert np.allclose(r.y, 0.0, atol=1e-6) and np.allclose(r.z, [0.0, 4.0], atol=1e-6)
    with pytest.raises(swb.UnsupportedError):
        nlp.add_pair(0, 1)


def test_exact_derivatives():
    f = swb.Function(
        lambda w: 100 * (w[1] - w[0] ** 2) ** 2 + (1 - w[0]) ** 2,
        2,
        jacobian=lambda w: [-400 * w[0] * (w[1] - w[0] ** 2) - 2 * (1 - w[0]), 200 * (w[1] - w[0] ** 2)],
        hessian=lambda w, weights: (
            weights[0] * np.array([[1200 * w[0] ** 2 - 400 * w[1] + 2, -400 * w[0]], [-400 * w[0], 200.0]])
        ),
    )
    assert f.check_derivatives([-1.2, 1.0])
    assert np.allclose(swb.Nlp(2, f, start=[-1.2, 1]).solve().x, [1, 1])


def test_parameters():
    program = swb.Mpcc(2, lambda x, p: (x - p) @ (x - p), np=2, pairs=[(0, 1)], params=[3.0, 1.0])
    assert np.allclose(program.solve().x, [3, 0], atol=1e-6)
    program.set_params([3.0, 7.0])
    r = program.solve()
    assert np.allclose(r.x, [0, 7], atol=1e-6) and r.stats.time_build == 0.0


def test_undefined_points():
    def log(x):
        if x[0] <= 0:
            raise swb.Undefined("the logarithm of a negative number")
        return x[0] - np.log(x[0])

    for f in (log, lambda x: x[0] - (np.log(x[0]) if x[0] > 0 else np.nan)):
        program = swb.Nlp(1, f, start=[5.0])
        assert program.solve().x[0] == pytest.approx(1.0, abs=1e-6)
        program.set_start([-1.0])
        with pytest.raises(swb.NonfiniteError, match="objective") as caught:
            program.solve()
        if f is log:
            assert isinstance(caught.value.__cause__, swb.Undefined)
        assert program.outcome == swb.Outcome.FAILED
        program.set_start([2.0])
        assert program.solve().success


def test_no_solution():
    r = swb.Mpcc(
        2, lambda x: -x.sum(), lambda x: x, 2, constraint_bounds=(1.0, 9.0), pairs=[(0, 1)], start=[1, 1]
    ).solve()
    assert not r.success and r.message != "solved"


def test_refusals():
    f = PROBLEMS["bard1"]["f"]
    program = make(PROBLEMS["bard1"])
    one = swb.Function(lambda x: x[0], 5)
    for call in (
        lambda: swb.Mpcc(5, None),
        lambda: swb.Mpcc(4, one),
        lambda: swb.Mpcc(-1, lambda x: 0.0),
        lambda: swb.Mpcc(2, lambda u: 0.0, np=-1),
        lambda: swb.Mpcc(2, f, lambda x: x),
        lambda: swb.Mpcc(2, f, lambda x: x, 2.5),
        lambda: swb.Mpcc(2, f, bounds=3),
        lambda: swb.Mpcc(2, f, pairs=[3]),
        lambda: swb.Mpcc(2, f, pairs=[(0, 1, 2)]),
        lambda: program.add_pair(5, 0),
        lambda: program.add_pair(0, c(-1)),
        lambda: program.add_pair((2, 0), 0),
        lambda: program.add_pair(0, 0),
        lambda: program.add_pair(0, c(1)),  # is in a pair
        lambda: program.add_pair("a", 0),
        lambda: program.add_pair(None, 0),
        lambda: program.set_bounds(1.0, 0.0),
        lambda: program.set_bounds([0.0] * 4, None),
        lambda: program.set_bounds([np.nan] * 5, None),
        lambda: program.set_constraint_bounds([0.0] * 5, None),
        lambda: program.set_params([1.0]),
        lambda: program.set_start([0.0] * 4),
        lambda: program.set_start([np.nan] * 5),
        lambda: program.set_start(None),
        lambda: program.result,
    ):
        with pytest.raises(swb.ArgumentError) as caught:
            call()
        assert len(str(caught.value)) > 10
    assert program.solve().success


def test_member_bounded_away_from_zero():
    program = swb.Mpcc(2, lambda x: x @ x, pairs=[(0, 1)], bounds=([0.5, 0], [0.5, 1]))
    with pytest.raises(swb.UnsupportedError):
        program.solve()
