"""Mixed complementarity problems and boxes in programs: closed forms, the literature, and a semismooth Newton method of the test."""

import numpy as np
import pytest
from scipy.optimize import brentq

import switchback_control as swb
from switchback_control.expr import Graph

INF = np.inf


def residual(x, f, lower, upper):
    """How far a point is from a solution: zero there and nowhere else."""
    return np.max(np.abs(x - np.clip(x - f, lower, upper)))


def semismooth(f, jacobian, lower, upper, x):
    """Zero of x - mid(lower, x - f(x), upper) by Newton steps on one element of its generalised Jacobian, damped.

    The reference of the tests. It shares nothing with the library."""
    for _ in range(200):
        y = f(x)
        r = x - np.clip(x - y, lower, upper)
        if np.max(np.abs(r)) < 1e-13 * (1 + np.max(np.abs(x))):
            return x
        free = (x - y > lower) & (x - y < upper)
        step = np.linalg.solve(np.where(free[:, None], jacobian(x), np.eye(len(x))), -r)
        t = 1.0
        while t > 1e-10:
            z = x + t * step
            if np.linalg.norm(z - np.clip(z - f(z), lower, upper)) < (1 - 1e-4 * t) * np.linalg.norm(r):
                break
            t /= 2
        x = x + t * step
    return None


def drawn(seed):
    """A strongly monotone function and bounds of which some are infinite and some equal."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 9))
    a, skew = rng.normal(size=(n, n)), rng.normal(size=(n, n))
    m = a @ a.T / n + 0.3 * np.eye(n) + skew - skew.T
    q, cubic = 4 * rng.normal(size=n), rng.uniform(0, 1, n) * rng.integers(0, 2, n)
    lower, upper = rng.normal(size=n) - 0.5, np.zeros(n)
    upper[:] = lower + rng.uniform(0.1, 2, n)
    kind = rng.integers(0, 5, n)  # both, lower, upper, none, equal
    lower[(kind == 2) | (kind == 3)] = -INF
    upper[(kind == 1) | (kind == 3)] = INF
    upper[kind == 4] = lower[kind == 4]
    return n, m, q, cubic, lower, upper


@pytest.mark.parametrize("seed", range(60))
def test_random_monotone_boxes_agree_with_a_semismooth_newton_method(seed):
    n, m, q, cubic, lower, upper = drawn(seed)
    reference = semismooth(
        lambda x: m @ x + q + cubic * x**3, lambda x: m + np.diag(3 * cubic * x**2), lower, upper,
        np.clip(np.zeros(n), lower, upper),
    )  # fmt: skip
    assert reference is not None
    found = swb.mcp(lambda x: m @ x + q + cubic * x**3, lower, upper)
    assert found.success, found.report
    assert np.max(np.abs(found.x - reference)) < 1e-6 * (1 + np.max(np.abs(reference)))
    assert residual(found.x, found.constraints, lower, upper) < 1e-6
    assert np.allclose(found.constraints, m @ found.x + q + cubic * found.x**3, atol=1e-9)


def obstacle(cells, depth, load):
    """A string between its ends, pushed up on the left half and down on the right one, between two obstacles: Jacobian and
    load of the equilibrium by second differences, and the solution, which is parabolas and lines and exact for them."""
    h, points = 1 / cells, np.arange(1, cells) / cells
    matrix = (2 * np.eye(cells - 1) - np.eye(cells - 1, k=1) - np.eye(cells - 1, k=-1)) / h**2
    reach = np.sqrt(2 * depth / load)  # where the string touches: u' = 0 there

    def half(x):
        return depth - load / 2 * np.maximum(0, reach - np.minimum(x, 0.5 - x)) ** 2

    exact = np.where(points <= 0.5, half(points), -half(1 - points))
    return matrix, load * np.sign(0.5 - points), exact, reach * cells


def test_a_string_between_two_obstacles():
    matrix, load, exact, place = obstacle(80, 0.05, 10.0)
    assert abs(place - round(place)) < 1e-12  # the free boundary is a grid point: differences of parabolas are exact
    found = swb.mcp(swb.Function.affine(-load, matrix, nx=79), -0.05, 0.05, np.zeros(79))
    assert found.success and found.stationarity == "S"
    assert np.max(np.abs(found.x - exact)) < 1e-9
    assert np.sum(np.abs(exact) > 0.05 - 1e-12) == 2 * 25  # 8 of 40 cells at each end of a half are free


def test_obstacle_in_the_plane_agrees_with_projected_relaxation():
    n = 12
    line = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    a = np.kron(line, np.eye(n)) + np.kron(np.eye(n), line)
    s = np.arange(1, n + 1) / (n + 1)
    hill = (0.3 - 2 * ((s[:, None] - 0.5) ** 2 + (s[None] - 0.4) ** 2)).ravel()
    u = np.maximum(0.0, hill)
    for _ in range(2000):  # projected Gauss-Seidel
        for i in range(n * n):
            u[i] = max(hill[i], u[i] - a[i] @ u / a[i, i])
    found = swb.mcp(lambda x: a @ x, hill)
    assert found.success
    assert np.max(np.abs(found.x - u)) < 1e-8


def test_braess_network():
    # D. Braess, Unternehmensforschung 12 (1968): six units of traffic, two routes at a cost of 83; with the road between
    # them all three routes carry two units at a cost of 92
    def costs(routes):
        def f(x):
            h, least = x[:routes], x[routes]
            last = h[2] if routes == 3 else 0.0 * h[0]
            first, second = 10 * (h[0] + last), 10 * (h[1] + last)
            c = [first + 50 + h[0], 50 + h[1] + second, first + 10 + last + second][:routes]
            return [ci - least for ci in c] + [h[0] + h[1] + last - 6.0]

        return f

    two = swb.mcp(costs(2), [0, 0, -INF])
    assert two.success and np.allclose(two.x, [3, 3, 83], atol=1e-7)
    three = swb.mcp(costs(3), [0, 0, 0, -INF])
    assert three.success and np.allclose(three.x, [2, 2, 2, 92], atol=1e-7)


def test_kojima_and_shindo():
    # M. Kojima, S. Shindo, J. Oper. Res. Soc. Japan 29 (1986): the two solutions
    def f(x):
        a, b, c, d = x
        return [
            3 * a**2 + 2 * a * b + 2 * b**2 + c + 3 * d - 6,
            2 * a**2 + a + b**2 + 10 * c + 2 * d - 2,
            3 * a**2 + a * b + 2 * b**2 + 2 * c + 9 * d - 9,
            a**2 + 3 * b**2 + 2 * c + 3 * d - 3,
        ]

    solutions = [np.array([np.sqrt(6) / 2, 0, 0, 0.5]), np.array([1.0, 0, 3, 0])]
    for start in ([0, 0, 0, 0], [1, 1, 1, 1], [1, 0, 3, 0], [2, 0, 0, 1]):
        found = swb.mcp(f, 0, None, start)
        assert found.success
        assert min(np.max(np.abs(found.x - s)) for s in solutions) < 1e-6


C, BETA, K, GAMMA = np.array([10.0, 8, 6, 4, 2]), np.array([1.2, 1.1, 1.0, 0.9, 0.8]), 5.0, 1.1


def cournot(x):
    total = sum(x)
    price = (5000 / total) ** (1 / GAMMA)
    return [c + (v / k) ** (1 / b) - price * (1 - v / (GAMMA * total)) for c, b, k, v in zip(C, BETA, [K] * 5, x)]


def test_oligopoly_of_five_firms():
    # F. H. Murphy, H. D. Sherali, A. L. Soyster, Math. Programming 24 (1982), with this solution
    published = [36.9318, 41.8175, 43.7060, 42.6588, 39.1786]
    found = swb.mcp(cournot, 0, None, np.full(5, 10.0))
    assert found.success and np.allclose(found.x, published, rtol=2e-4)


def test_oligopoly_with_capacities():
    upper = np.array([INF, 40.0, 40.0, 60.0, 5.0])
    found = swb.mcp(cournot, 1.0, upper, np.full(5, 3.0))
    assert found.success
    # the test lets every firm choose its best answer to the others, one after the other, until nobody moves
    x = np.full(5, 3.0)
    for _ in range(500):
        for i in range(5):
            own = lambda v: cournot(np.r_[x[:i], v, x[i + 1 :]])[i]  # noqa: B023, E731
            high = min(upper[i], 1e3)
            x[i] = 1.0 if own(1.0) >= 0 else high if own(high) <= 0 else brentq(own, 1.0, high, xtol=1e-13)
    assert np.allclose(found.x, x, rtol=1e-8)
    assert found.x[4] == 5.0 and found.constraints[4] < 0  # more would be worth its cost


def test_expressions_functions_and_callables_are_the_same():
    g = Graph()
    x = g.inputs("x", 2)
    rows = [x[0] ** 3 + x[1] - 2, x[1] - x[0]]
    forms = [rows, g.function(rows, 2), lambda x: [x[0] ** 3 + x[1] - 2, x[1] - x[0]]]
    for f in forms:
        found = swb.mcp(f, [0, 0], [INF, 0.5])
        assert found.success
        # x1 at its upper bound, x0**3 = 1.5
        assert np.allclose(found.x, [1.5 ** (1 / 3), 0.5], atol=1e-8)


def test_a_jacobian_and_parameters():
    f = lambda x, p: p[0] * x - p[1:]  # noqa: E731
    by_x_and_p = lambda x, p: np.column_stack([p[0] * np.eye(2), x, -np.eye(2)])  # noqa: E731
    found = swb.mcp(f, [0, 0], [1, 1], np=3, params=[2.0, 1.0, 5.0], jacobian=by_x_and_p)
    assert found.success and np.allclose(found.x, [0.5, 1.0], atol=1e-9)
    assert np.allclose(found.constraints, [0.0, -3.0], atol=1e-9)


@pytest.mark.parametrize("target, point", [((2.0, 0.3), (2.0, 1.0)), ((-1.0, 0.2), (-1.0, 0.0)), ((0.4, 0.6), (0.5, 0.5))])
def test_a_program_below_which_there_is_a_projection(target, point):
    # y = clip(x, 0, 1) as a box below a distance
    found = swb.minimize_mpcc(
        lambda w: (w[0] - target[0]) ** 2 + (w[1] - target[1]) ** 2, [0.3, 0.3], (), lambda w: [w[1] - w[0]],
        boxes=[(1, 0)], bounds=([-INF, 0], [INF, 1]), n_constraints=1,
    )  # fmt: skip
    assert found.success and np.allclose(found.x, point, atol=1e-7)
    assert found.b_stationary


def test_bounds_that_change_between_solves():
    f = swb.Function(lambda x: [x[0] - 2.0], 1)
    with swb.Mpcc(1, 0.0, f, boxes=[(0, 0)], start=[0.0]) as program:
        assert program.n_boxes == 1 and "1 boxes" in repr(program)
        for lower, upper, expected in [
            (-INF, INF, 2), (0, INF, 2), (0, 1, 1), (3, 5, 3), (-INF, 1, 1), (0.5, 0.5, 0.5), (-5, -4, -4), (-INF, INF, 2),
        ]:  # fmt: skip
            program.set_bounds([lower], [upper])
            for solve in (program.solve, program.resolve):
                found = solve()
                assert found.success, (lower, upper)
                assert abs(found.x[0] - expected) < 1e-7
                assert abs(found.constraints[0] - (expected - 2)) < 1e-7


def test_warm_starts_keep_multipliers_of_boxes():
    # at the optimum x = 1 is held by the box of y at its upper bound
    program = swb.Mpcc(
        2, lambda w: (w[0] - 3) ** 2 + (w[1] - 4) ** 2, lambda w: [w[1] - w[0]], 1, boxes=[(1, 0)], bounds=([-INF, -2], [2.5, 1]),
        start=[0, 0],
    )  # fmt: skip
    first = program.solve()
    assert first.success and np.allclose(first.x, [2.5, 1]) and np.allclose(first.z, [-1, -6], atol=1e-6)
    program.set_warm_start(first.x, first.y, first.z)
    again = program.solve()
    assert again.success and again.stats.iterations <= 3 and np.allclose(again.x, first.x)


def test_names_and_reports():
    program = swb.Mpcc(
        1, 0.0, lambda x: [x[0] ** 2 + 1], 1, boxes=[(0, 0)], bounds=(-1, 1), start=[0.5], box_names=["gate"]
    )
    assert program.name(swb.Item.BOX, 0) == "gate"
    found = program.solve()
    assert found.success and abs(found.x[0] + 1) < 1e-8
    assert "1 boxes" in found.report and '"boxes":1' in found.to_json().replace(" ", "")
    nothing = swb.mcp(lambda x: [x[0] ** 2 + 1], [-INF])  # a root that does not exist
    assert not nothing.success


def test_nonsense_is_refused():
    f = lambda x: [x[0], x[1]]  # noqa: E731
    with pytest.raises(swb.RangeError, match="above"):
        swb.mcp(f, [0, 2], [1, 1])
    with pytest.raises(swb.RangeError, match="NaN"):
        swb.mcp(f, [0, np.nan])
    with pytest.raises(swb.RangeError, match="NaN"):
        swb.mcp(f, [0, 0], [1, np.nan])
    with pytest.raises(swb.SwitchbackError):
        swb.mcp(f, [0, 0], None, [np.nan, 0])
    with pytest.raises(swb.SwitchbackError):
        swb.mcp(f, [0, INF], [1, INF])
    with pytest.raises(swb.DimensionError, match="one length"):
        swb.mcp(f, [0, 0], [1, 1, 1])
    with pytest.raises(swb.DimensionError, match="one number for all"):
        swb.mcp(f, 0, 1)
    with pytest.raises(swb.SwitchbackError):
        swb.mcp(f, [0, 0, 0])
    with pytest.raises(swb.SwitchbackError):
        swb.mcp(f, [])
    with pytest.raises(swb.ArgumentError, match="boxes"):
        swb.mcp(f, [0, 0], boxes=[(0, 0)])
    with pytest.raises(swb.DimensionError):
        swb.Mpcc(2, 0.0, f, 2, boxes=[(0, 2)])
    with pytest.raises(swb.DimensionError):
        swb.Mpcc(2, 0.0, f, 2, boxes=[(-1, 0)])
    with pytest.raises(swb.DimensionError, match="variable and a constraint"):
        swb.Mpcc(2, 0.0, f, 2, boxes=[3])
    with pytest.raises(swb.RangeError, match="already"):
        swb.Mpcc(2, 0.0, f, 2, boxes=[(0, 0), (1, 0)])
    with pytest.raises(swb.RangeError, match="already"):
        swb.Mpcc(2, 0.0, f, 2, pairs=[(0, swb.constraint(1))], boxes=[(1, 1)])
    with pytest.raises(swb.UnsupportedError):
        swb.Nlp(2, 0.0, f, 2).add_box(0, 0)
