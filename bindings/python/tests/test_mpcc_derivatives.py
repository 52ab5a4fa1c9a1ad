"""Derivatives of solutions by parameters: closed forms, central differences of programs solved again, kinks."""

import numpy as np
import pytest

import switchback_control as swb
from switchback_control import Sides

INF = np.inf


def solved(*args, **kwargs):
    program = swb.Mpcc(*args, **kwargs)
    assert program.solve().success, program.result.report
    return program


def test_a_quadratic_program_with_equations_in_closed_form():
    rng = np.random.default_rng(3)
    n, m, k = 6, 2, 4
    a = rng.normal(size=(n, n))
    q, b, rows, c = a @ a.T + np.eye(n), rng.normal(size=(n, k)), rng.normal(size=(m, n)), rng.normal(size=(m, k))
    p = rng.normal(size=k)
    program = solved(
        n, lambda x, p: 0.5 * x @ q @ x - (b @ p) @ x, lambda x, p: rows @ x - c @ p, m, k, constraint_bounds=(0, 0),
        params=p,
    )  # fmt: skip
    kkt = np.block([[q, rows.T], [rows, np.zeros((m, m))]])
    exact = np.linalg.solve(kkt, np.vstack([b, c]))
    x, y = program.result.x, program.result.y
    t = program.tangents()
    assert np.allclose(t.x, exact[:n], atol=1e-8) and t.sides == (Sides.BOTH,) * k
    assert np.allclose(t.objective, -b.T @ x - c.T @ y, atol=1e-8)  # the envelope theorem
    weights = rng.normal(size=n)
    w = program.vjp(weights, 0.7)
    assert np.allclose(w.p, weights @ exact[:n] + 0.7 * t.objective, atol=1e-8) and w.sides == t.sides
    assert np.allclose(program.vjp(objective=1.0).p, t.objective, atol=1e-8)


def test_a_bound_held_and_one_that_is_free():
    program = solved(
        2, lambda x, p: (x[0] - p[0]) ** 2 + (x[1] - p[0] * p[1]) ** 2, np=2, bounds=([0, 0], INF), params=[-1.0, -3.0]
    )
    t = program.tangents()
    assert np.allclose(t.x, [[0, 0], [-3, -1]], atol=1e-9)
    assert np.allclose(t.objective, [-2, 0], atol=1e-9)  # (0 + 1)**2 falls by 2 for a unit of p0


def drawn(seed):
    """A convex quadratic objective over pairs and a constraint, all of which depend on four parameters."""
    rng = np.random.default_rng(seed)
    n, k = int(rng.integers(2, 6)), 4
    a = rng.normal(size=(2 * n, 2 * n))
    q, b, c = a @ a.T / n + np.eye(2 * n), rng.normal(size=(2 * n, k)), 2 * rng.normal(size=2 * n)
    row, by = rng.normal(size=2 * n), rng.normal(size=k)

    def f(x, p):
        bent = 0.1 * (p[0] * x[0]) ** 2 + 0.05 * np.exp(0.3 * p[1]) * x[1] ** 2
        return 0.5 * x @ q @ x - (c + b @ p) @ x + bent

    def g(x, p):
        return [row @ x + by @ p + 0.1 * p[2] * x[0], x[0] * x[1] * p[3] + x[n] - 4.0]

    pairs, p = [(i, n + i) for i in range(n)], rng.normal(size=k)
    program = swb.Mpcc(
        2 * n, f, g, 2, k, pairs=pairs, bounds=(0, 5), constraint_bounds=(-INF, 1.0), params=p,
        start=np.full(2 * n, 0.5), tol=1e-10, portfolio="off", branch_work=0.0,
    )  # fmt: skip
    return program, p, rng


def near_kink(r):
    """Is a bound, a row or a pair nearly active, or active with hardly a multiplier? Differences may cross a kink there."""
    between = (np.abs(r.z) > 1e-2) | (r.x < 5 - 1e-2)
    rows = (np.abs(r.y) > 1e-2) | (r.constraints < 1 - 1e-2)
    return not (np.all(np.maximum(r.g, r.h) > 1e-2) and between.all() and rows.all())


def test_a_hundred_random_programs_agree_with_differences():
    h, compared, seed = 1e-5, 0, 0
    while compared < 100:
        program, p, rng = drawn(seed)
        seed += 1
        assert seed < 300
        first = program.solve()
        if not first.success or first.polished != swb.Polished.DONE or near_kink(first):
            continue
        t, weights = program.tangents(), rng.normal(size=program.n)
        w = program.vjp(weights, 0.3)
        assert t.sides == w.sides == (Sides.BOTH,) * 4, seed
        dx, df = np.empty_like(t.x), np.empty(4)
        for k in range(4):
            moved = []
            for step in (h, -h):
                program.set_params(p + step * np.eye(4)[k])
                program.set_warm_start(first.x, first.y, first.z)
                r = program.solve()
                # the solution next to it is the same one, moved
                assert r.success and np.array_equal(r.g > r.h, first.g > first.h), seed
                moved.append((r.x, r.objective))
            dx[:, k] = (moved[0][0] - moved[1][0]) / (2 * h)
            df[k] = (moved[0][1] - moved[1][1]) / (2 * h)
        scale = 1 + np.max(np.abs(dx))
        assert np.max(np.abs(t.x - dx)) < 1e-5 * scale, seed
        assert np.max(np.abs(t.objective - df)) < 1e-5 * (1 + np.max(np.abs(df))), seed
        expected = weights @ t.x + 0.3 * t.objective
        assert np.max(np.abs(w.p - expected)) < 1e-9 * scale * (1 + np.abs(weights).sum()), seed
        compared += 1


@pytest.mark.parametrize("seed", range(20))
def test_solutions_of_complementarity_problems_follow_their_load(seed):
    rng = np.random.default_rng(seed)
    n = 6
    a, skew = rng.normal(size=(n, n)), rng.normal(size=(n, n))
    m = a @ a.T / n + 0.3 * np.eye(n) + skew - skew.T
    lower, upper, load = np.full(n, -0.5), np.where(rng.random(n) < 0.5, 0.7, INF), 3 * rng.normal(size=n)
    with swb.Mpcc(
        n, 0.0, lambda x, p: m @ x + x**3 - p, n, n, boxes=[(i, i) for i in range(n)], bounds=(lower, upper), params=load
    ) as program:
        r = program.solve()
        assert r.success
        t = program.tangents()
        free = (r.x > lower + 1e-6) & (r.x < upper - 1e-6)
        exact = np.zeros((n, n))
        exact[np.ix_(free, free)] = np.linalg.inv((m + np.diag(3 * r.x**2))[np.ix_(free, free)])
        assert np.allclose(t.x, exact, atol=1e-7) and set(t.sides) == {Sides.BOTH}
        weights = rng.normal(size=n)
        assert np.allclose(program.vjp(weights).p, weights @ exact, atol=1e-7)


def test_kinks_have_derivatives_of_one_side_that_is_named():
    # x = max(p, 0), y = min(q, 1), at p = 0 and q = 1
    program = solved(
        2, lambda x, p: (x[0] - p[0]) ** 2 + (x[1] - p[1]) ** 2, np=2, bounds=([0, -INF], [INF, 1]), params=[0.0, 1.0]
    )
    t = program.tangents()
    for k, of_side in ((0, {Sides.RISING: 1.0, Sides.FALLING: 0.0}), (1, {Sides.RISING: 0.0, Sides.FALLING: 1.0})):
        assert t.sides[k] in of_side
        assert abs(t.x[k, k] - of_side[t.sides[k]]) < 1e-9
        assert abs(t.objective[k]) < 1e-9  # both sides have it
    w = program.vjp([1.0, 2.0])
    assert w.sides == t.sides and np.allclose(w.p, [1, 2] @ t.x)


def test_a_kink_that_no_side_keeps_is_not_known():
    # x = max(p, 0), y = max(-p, 0): at p = 0 one of them starts to move on either side
    program = solved(2, lambda x, p: (x[0] - p[0]) ** 2 + (x[1] + p[0]) ** 2, np=1, bounds=(0, INF), params=[0.0])
    t = program.tangents()
    assert t.sides == (Sides.NEITHER,) and np.isnan(t.x).all() and np.isnan(t.objective).all()
    w = program.vjp([1.0, 0.0])
    assert w.sides == (Sides.NEITHER,) and np.isnan(w.p).all()


def test_a_biactive_pair():
    # a = max(p, 0), b = max(-p, 0) as a pair: the solution follows another branch on each side
    program = solved(2, lambda x, p: (x[0] - p[0]) ** 2 + (x[1] + p[0]) ** 2, np=1, pairs=[(0, 1)], params=[0.0], start=[0.1, 0.1])
    assert np.allclose(program.result.x, 0, atol=1e-12)
    t = program.tangents()
    expected = {Sides.RISING: [1, 0], Sides.FALLING: [0, -1]}
    assert t.sides[0] in expected
    assert np.allclose(t.x[:, 0], expected[t.sides[0]], atol=1e-9)
    # both multipliers positive: the corner stays
    corner = solved(2, lambda x, p: (x[0] + 1) ** 2 + (x[1] + p[0]) ** 2, np=1, pairs=[(0, 1)], params=[2.0], start=[0.1, 0.1])
    t = corner.tangents()
    assert t.sides == (Sides.BOTH,) and np.allclose(t.x, 0) and np.allclose(t.objective, 4)


def test_dependent_constraints_say_that_nothing_is_known():
    # x >= p0 and x >= p1 are both active: x = max(p0, p1) has a kink in either, and a derivative in p2
    program = solved(
        1, lambda x, p: x[0] ** 2, lambda x, p: [x[0] - p[0] - p[2], x[0] - p[1] - p[2]], 2, 3,
        constraint_bounds=(0, INF), params=[1.0, 1.0, 0.0],
    )  # fmt: skip
    t = program.tangents()
    assert t.sides == (Sides.NEITHER, Sides.NEITHER, Sides.BOTH)
    assert np.isnan(t.x[0, :2]).all() and abs(t.x[0, 2] - 1) < 1e-9 and abs(t.objective[2] - 2) < 1e-8
    w = program.vjp([1.0])
    assert w.sides == t.sides and np.isnan(w.p[:2]).all() and abs(w.p[2] - 1) < 1e-9


def test_a_hessian_in_one_piece_and_one_by_differences():
    f, g = (lambda x, p: np.exp(p[0] * x[0]) + x[1] ** 2), (lambda x, p: [x[0] * p[1] + x[1] - p[0]])
    traced = solved(2, f, g, 1, 2, constraint_bounds=(0, 0), params=[0.5, -1.0])
    exact = traced.tangents()

    def hessian(x, p, weight, y):
        return weight * np.diag([p[0] ** 2 * np.exp(p[0] * x[0]), 2.0])

    whole = solved(
        2, f, g, 1, 2, constraint_bounds=(0, 0), params=[0.5, -1.0], hessian=hessian,
        gradient=lambda x, p: [p[0] * np.exp(p[0] * x[0]), 2 * x[1], x[0] * np.exp(p[0] * x[0]), 0],
        jacobian=lambda x, p: [[p[1], 1, -1, x[0]]],
    )  # fmt: skip
    assert np.allclose(whole.tangents().x, exact.x, atol=1e-6)
    plain = [swb.Function(h, 2, np=2, n_out=1, trace=False) for h in (f, g)]
    differences = solved(2, *plain, np=2, constraint_bounds=(0, 0), params=[0.5, -1.0])
    assert np.allclose(differences.tangents().x, exact.x, atol=1e-3)


def test_columns_of_parameters_that_were_left_out_are_noticed():
    g = swb.Function(
        lambda x, p: [x[0] - p[0]], 1, np=1, n_out=1, jacobian=lambda x: [1.0], jacobian_pattern=([0], [0]),
        hessian=lambda x, weights: [0.0], hessian_pattern=([0], [0]),
    )  # fmt: skip
    program = solved(1, lambda x, p: x[0] ** 2, g, np=1, constraint_bounds=(0, INF), params=[1.0])
    with pytest.raises(swb.NumericError, match="columns of the"):
        program.tangents()
    with pytest.raises(swb.NumericError, match="columns of the"):
        program.vjp([1.0])


def test_the_solution_that_is_differentiated_is_the_last_one():
    program = swb.Mpcc(1, lambda x, p: (x[0] - p[0] ** 2) ** 2, np=1, bounds=(0, 3), params=[1.0])
    with pytest.raises(swb.StateError):
        program.tangents()
    program.solve()
    program.set_params([5.0])
    program.set_bounds([2.0], [3.0])
    assert abs(program.tangents().x[0, 0] - 2) < 1e-8
    assert abs(program.resolve().x[0] - 3) < 1e-8 and abs(program.vjp([1.0]).p[0]) < 1e-9
    other = swb.Mpcc(2, lambda x, p: (x[0] - p[0]) ** 2 + x[1] ** 2, np=1, params=[1.0])
    other.solve()
    other.add_pair(0, 1)
    with pytest.raises(swb.StateError):
        other.tangents()


def test_solutions_that_are_not_isolated_have_none():
    program = solved(2, lambda x, p: (x[0] - p[0]) ** 2, np=1, params=[1.0])
    with pytest.raises(swb.NumericError):
        program.tangents()


def test_nonsense_is_refused():
    program = solved(1, lambda x, p: (x[0] - p[0]) ** 2, np=1, params=[1.0])
    with pytest.raises(swb.DimensionError):
        program.vjp([1.0, 2.0])
    with pytest.raises(swb.SwitchbackError):
        program.vjp([np.nan])
    with pytest.raises(swb.RangeError):
        program.vjp([1.0], np.inf)
    with pytest.raises(swb.DimensionError):
        program.vjp([1.0], [1.0, 2.0])
    nothing = solved(1, lambda x: x[0] ** 2)
    assert nothing.tangents().x.shape == (1, 0) and nothing.vjp([1.0]).p.shape == (0,)


def test_jax():
    jax = pytest.importorskip("jax")
    import switchback_control.jax

    jax.config.update("jax_enable_x64", True)
    # x = clip(p0, 0, 1), y = p1 - x
    program = swb.Mpcc(
        2, lambda x, p: (x[0] - p[0]) ** 2, lambda x, p: [x[0] + x[1] - p[1]], 1, 2, bounds=([0, -INF], [1, INF]),
        constraint_bounds=(0, 0),
    )  # fmt: skip

    def loss(p):
        x, f = swb.jax.solution(program, p)
        return x[0] ** 2 + 3 * x[1] + f

    def exact(p):  # and its gradient
        x = min(max(p[0], 0), 1)
        slope = float(0 < p[0] < 1)
        return x**2 + 3 * (p[1] - x) + (x - p[0]) ** 2, [(2 * x - 3) * slope + 2 * (p[0] - x), 3.0]

    points = np.array([[0.4, 1.0], [-2.0, 0.5], [1.7, -1.0]])
    for gradient in (jax.value_and_grad(loss), jax.jit(jax.value_and_grad(loss))):
        for p in points:
            value, slope = gradient(p)
            assert abs(value - exact(p)[0]) < 1e-8 and np.allclose(slope, exact(p)[1], atol=1e-7)
    many = jax.vmap(jax.grad(loss))(points)
    assert np.allclose(many, [exact(p)[1] for p in points], atol=1e-7)
    # someone else solves the program between value and gradient
    value, pull = jax.vjp(loss, points[0])
    program.set_params([9.0, 9.0])
    program.solve()
    assert np.allclose(pull(1.0)[0], exact(points[0])[1], atol=1e-7)
    with pytest.warns(swb.jax.KinkWarning, match="0 .(rising|falling)."):
        kinked = jax.grad(lambda p: swb.jax.solution(program, p)[0][0])(np.array([0.0, 1.0]))
    side = program.vjp([1.0, 0.0]).sides[0]
    assert np.allclose(kinked, [{Sides.RISING: 1, Sides.FALLING: 0}[side], 0], atol=1e-9)
    with pytest.raises(Exception, match="kink"):
        jax.grad(lambda p: swb.jax.solution(program, p, kinks="error")[0][0])(np.array([0.0, 1.0]))
    with pytest.raises(swb.ArgumentError):
        swb.jax.solution(program, points[0], kinks="never")
    with pytest.raises(swb.ArgumentError):
        swb.jax.solution(3, points[0])
    nothing = swb.Mpcc(1, lambda x, p: x[0] - p[0] * x[0], np=1)
    with pytest.raises(Exception, match="no solution"):
        swb.jax.solution(nothing, np.array([0.0]))[0].block_until_ready()
