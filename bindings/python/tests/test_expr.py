"""Models written as expressions."""

import numpy as np
import pytest
import switchback_control as swb
from switchback_control import expr
from switchback_control.expr import Counts, Model, clip, cos, jacobian, maximum, sign, sin, solve, table, where


def evaluate(model, e, x, u=(), p=(), t=0.0):
    """Value of expressions at a point."""
    return model.function(e)(np.asarray(x, float), np.asarray(u, float), np.asarray(p, float), t)


# --- the models that must be short ---------------------------------------------------------------


def test_driven_switch():
    m = Model(states="x")
    m.derivatives = [-sign(m.x[0]) + 0.2 * sin(5 * m.t)]
    result = swb.simulate_fesd(m.system(), x0=[-0.5], duration=2.0, n_steps=10)
    assert m.counts() == Counts(1, 1, 2, 5, 2)
    assert result.trajectory.switches[0].t == pytest.approx(0.43695503338596907, abs=1e-5)
    assert m.report_data()["clock"] is True


def test_dry_friction_oscillator():
    m = Model(states="q v")
    q, v = m.x
    m.derivative(q, v)
    m.derivative(v, -q - 0.4 * sign(v) + cos(0.5 * m.t))
    assert m.counts() == Counts(1, 1, 2, 5, 2)
    by_hand = swb.System(nx=2, f0=lambda x, t: [x[1], -x[0] + np.cos(0.5 * t)])
    by_hand.add_subsystem(modes=[[-0.4], [0.4]], psi=lambda x: x[1], signs=[1, -1], rows=[1])
    runs = [swb.simulate_fesd(s, x0=[1.0, 0.0], duration=3.0, n_steps=15) for s in (m.system(), by_hand)]
    ends = [r.trajectory(3.0) for r in runs]
    assert np.allclose(*ends, atol=1e-6)


def test_three_blocks():
    m = Model(states=6)
    q, v = m.x[:3], m.x[3:]
    k = np.array([[-2.0, 1.0, 0.0], [1.0, -2.0, 1.0], [0.0, 1.0, -1.0]])
    m.derivatives = [*v, *(k @ q - v - 0.3 * sign(v))]
    assert m.counts() == Counts(3, 3, 6, 15, 6)


def test_turbo_car():
    m = Model(states="q v", controls="a")
    (q, v), a = m.x, m.u[0]
    m.derivatives = [v, where(v > 10, 3 * a, a)]
    assert m.counts() == Counts(1, 1, 2, 5, 2)


def test_two_genes():
    m = Model(states="x y")
    x, y = m.x
    m.derivatives = [40 * where((x > 4) & (y < 8), 1, 0) - 4.5 * x, 40 * where((x < 8) & (y > 4), 1, 0) - 1.5 * y]
    assert m.counts().switching_functions == 4
    assert m.counts().subsystems == 2


def test_gear_box_by_a_table():
    m = Model(states="v", controls="u")
    v, u = m.x[0], m.u[0]
    m.derivatives = [expr.step_table(v, [5, 10, 20], [4 * u, 2 * u, u, 0.5 * u]) - 0.1 * v]
    assert m.counts() == Counts(1, 3, 4, 9, 4)
    with pytest.raises(swb.DimensionError):
        expr.step_table(v, [1, 2], [1, 2])
    with pytest.raises(swb.RangeError):
        expr.step_table(v, [2, 1], [1, 2, 3])


def test_smooth_model_has_no_pairs():
    m = Model(states="q v")
    q, v = m.x
    m.derivatives = [v, -q]
    assert m.counts() == Counts(0, 0, 0, 0, 0)
    end = swb.simulate_fesd(m.system(), x0=[1.0, 0.0], duration=1.0, n_steps=20).trajectory(1.0)
    assert end[0] == pytest.approx(np.cos(1.0), abs=1e-5)


def test_optimal_control_with_expressions():
    m = Model(states="x")
    m.derivatives = [2 - sign(m.x[0])]
    by_hand = swb.System(nx=1)
    by_hand.add_subsystem(modes=[[1.0], [3.0]], psi=lambda x: x[0], signs=[1, -1])
    x = m.x[0]
    costs = [
        (m.system(), m.function(x**2, "L"), m.function((x - 5 / 3) ** 2, "M")),
        (by_hand, lambda x: x[0] ** 2, lambda x: (x[0] - 5 / 3) ** 2),
    ]
    results = []
    for system, lagrange, mayer in costs:
        problem = swb.Ocp(system, 2.0, 1, lagrange=lagrange, mayer=mayer, initial_bounds=(-2.0, -0.5))
        results.append(problem.solve())
    assert [r.outcome for r in results] == [swb.Outcome.SOLVED] * 2
    assert results[0].cost == pytest.approx(results[1].cost, abs=1e-8)
    assert results[0].cost == pytest.approx(1.5237727753749573, abs=1e-3)


# --- arrays of expressions -----------------------------------------------------------------------


def test_operators_broadcast_and_slice():
    m = Model(states=4)
    x = np.array([0.5, -1.0, 2.0, 3.0])
    cases = [
        (m.x + 1, x + 1),
        (1 - m.x, 1 - x),
        (m.x * x, x * x),
        (x * m.x, x * x),
        (x / (m.x + 5), x / (x + 5)),
        (m.x[::2] ** 2, x[::2] ** 2),
        (2.0 ** m.x, 2.0**x),
        (m.x.reshape(2, 2) @ np.array([1.0, 2.0]), x.reshape(2, 2) @ [1.0, 2.0]),
        (m.x.reshape(2, 2).T @ m.x.reshape(2, 2), x.reshape(2, 2).T @ x.reshape(2, 2)),
        (np.eye(4)[1:] @ m.x, x[1:]),
        (m.x @ m.x, x @ x),
        (m.x.sum(), x.sum()),
        (m.x.reshape(2, 2).sum(axis=0), x.reshape(2, 2).sum(axis=0)),
        (np.sin(m.x) + np.exp(m.x), np.sin(x) + np.exp(x)),
        (np.arctan2(m.x[0], m.x[1]), np.arctan2(x[0], x[1])),
        (np.sqrt(m.x[2:]), np.sqrt(x[2:])),
        (expr.norm(m.x), np.linalg.norm(x)),
        (expr.concatenate([m.x[3], m.x[:2]]), x[[3, 0, 1]]),
        (-m.x[-1], -x[-1]),
        (np.dot(m.x, x), np.dot(x, x)),
        (np.sum(m.x), np.sum(x)),
        (np.sum(m.x.reshape(2, 2), axis=1), np.sum(x.reshape(2, 2), axis=1)),
        (np.concatenate([m.x[:1], m.x[2:]]), x[[0, 2, 3]]),
        (np.linalg.norm(m.x), np.linalg.norm(x)),
        (np.linalg.solve(np.eye(4) + 0 * m.x, m.x), x),
    ]
    for k, (e, exact) in enumerate(cases):
        assert e.shape == np.shape(exact), k
        assert np.allclose(evaluate(m, e.reshape(-1), x), np.ravel(exact), rtol=1e-14), k


def test_conditions_like_those_of_numpy():
    m = Model(states="x y")
    x, y = m.x
    pairs = [
        (where((x > 0) & (y < 1), 2, 3), np.where(np.logical_and(x > 0, np.less(y, 1)), 2, 3)),
        (where((x > 0) | ~(y >= 1), x, y), np.where(np.logical_or(0 < x, np.logical_not(np.greater_equal(y, 1))), x, y)),
        (clip(x, -1, 1), np.clip(x, -1, 1)),
        (where(m.x > 0, m.x, [3.0, 4.0]), np.where(np.array([0.0, 0.0]) < m.x, m.x, [3.0, 4.0])),
        (abs(x) + sign(y), np.abs(x) + np.sign(y)),
        (maximum(m.x, 0), np.maximum(0, m.x)),
    ]
    for k, (a, b) in enumerate(pairs):
        assert a == b, k
    assert swb.where is where and swb.sign is sign
    for wrong in (lambda: np.where(x, 1, 0), lambda: (x > 0) & True, lambda: (x > 0) + 1):
        with pytest.raises(swb.RangeError, match="condition"):
            wrong()
    with pytest.raises(TypeError):
        np.arccosh(x)
    with pytest.raises(TypeError):
        np.sort(m.x)


def test_linear_systems_tables_and_jacobians():
    m = Model(states=3)
    x = np.array([0.5, 1.5, 2.0])
    a = expr.concatenate([m.x[0] + 2, m.x[1], m.x[1], m.x[2]]).reshape(2, 2)
    exact = np.linalg.solve([[2.5, 1.5], [1.5, 2.0]], [x[0], 1.0])
    assert np.allclose(evaluate(m, solve(a, [m.x[0], 1.0]), x), exact, rtol=1e-14)
    assert solve(a, np.eye(2) + 0 * a).shape == (2, 2)
    points = np.linspace(0, 2, 9)
    assert evaluate(m, table(m.x[:1], points, points**3), x) == pytest.approx([0.125], abs=1e-13)
    assert evaluate(m, table(m.x[:1], [0.4], [1.0, 2.0], "steps"), x) == [2.0]
    j = jacobian([m.x[0] * m.x[1], sin(m.x[2])], m.x)
    assert j.shape == (2, 3)
    assert np.allclose(evaluate(m, j.reshape(-1), x).reshape(2, 3), [[1.5, 0.5, 0], [0, 0, np.cos(2.0)]])
    assert jacobian(m.x[0] ** 2, m.x).shape == (3,)


def test_external_functions():
    f = swb.Function(lambda x: [x[0] * x[1]], nx=2, jacobian=lambda x: [[x[1], x[0]]], name="product")
    m = Model(states=2)
    y = expr.external(f, x=m.x)
    assert evaluate(m, y**2, [2.0, 3.0]) == [36.0]
    m.derivatives = [y[0], -m.x[0]]
    end = swb.simulate_fesd(m.system(), x0=[1.0, 0.5], duration=0.1, n_steps=2).trajectory(0.1)
    assert np.isfinite(end).all()


def test_report_and_code():
    m = Model(states="q v", name="slider")
    q, v = m.x
    m.derivatives = [v, -q - clip(v, -1, 1) + maximum(q**2 + 1, 0)]
    text = m.report()
    assert "slider: 2 states" in text and "v switch with" in text
    data = m.report_data()
    assert data["groups"][0]["cells"] == 3
    assert any("never negative" in n["text"] for n in data["notes"] if n["kind"] == "dropped")
    assert "modes0_value" in m.c_code()
    m.try_at([0.0, 0.0])
    assert "not defined" not in m.report()
    assert repr(q) == "x[0]" and repr(m.x) == "['x[0]', 'x[1]']"


# --- refusals ------------------------------------------------------------------------------------


def test_refusals():
    m = Model(states="q v")
    q, v = m.x
    other = Model(states=1)
    with pytest.raises(swb.ArgumentError, match="two graphs"):
        q + other.x[0]
    with pytest.raises(TypeError, match="use where"):
        if q > 0:
            pass
    with pytest.raises(swb.RangeError, match="condition"):
        sin(q > 0)
    with pytest.raises(swb.DimensionError, match="do not fit"):
        m.x + np.zeros(3)
    with pytest.raises(swb.DimensionError):
        m.x @ np.zeros((3, 2))
    with pytest.raises(swb.ArgumentError, match="v: set it to 0"):
        m.derivative(q, v)
        m.system()
    with pytest.raises(swb.ArgumentError, match="no state"):
        m.derivative(m.t, q)
    with pytest.raises(swb.DimensionError):
        m.derivatives = [q]
    with pytest.raises(swb.UnsupportedError, match="nowhere else"):
        m.function(swb.sign(q))
    with pytest.raises(swb.UnsupportedError, match="not evaluated"):
        m.function([abs(q), q])
    with pytest.raises(swb.NonfiniteError):
        m.function(q * float("nan"))
    with pytest.raises(swb.RangeError, match="no table"):
        table(q, [0.0], [1.0], "curve")
    with pytest.raises(swb.DimensionError):
        solve(m.x, [1.0])
    with pytest.raises(swb.StateError, match="derivatives"):
        m.function(q)._do("set_linear")


def test_nothing_leaks(live):
    before = live()
    m = Model(states=1)
    m.derivatives = [-sign(m.x[0])]
    system = m.system()
    f = m.function(m.x[0])
    assert sum(live().values()) > sum(before.values())
    del m, system, f
    assert live() == before


# --- what looks wrong ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    "rhs, said",
    [
        (lambda m: where((m.x[0] > 2) & (m.x[0] < 1), 1, m.x[1]), "never taken"),
        (lambda m: sign(m.x[0] ** 2 - m.x[1] ** 2), "no gradient where it vanishes"),
        (lambda m: sign(m.p[0]), "cannot be crossed"),
        (lambda m: sign(m.x[0] - m.u[0]), "depends on a control"),
        (lambda m: expr.log(m.x[0] - 1), "not defined at the trial point"),
        (lambda m: where(m.x[0] > 5, expr.sqrt(m.x[0] - 7), 0), "some mode of y is not defined"),
        (lambda m: -m.x[0] * sign(m.x[1]), "singular"),
        (lambda m: table(m.x[0], [0.0], [1.0, 2.0], "steps"), "not found as switches"),
    ],
)
def test_lints(rhs, said):
    m = Model(states="x y", controls="u", parameters="p")
    m.derivatives = [1.0, rhs(m)]
    m.try_at([0.0, 0.0], p=[0.5])
    warnings = [n["text"] for n in m.report_data()["notes"] if n["kind"] == "warning"]
    assert any(said in w for w in warnings), warnings
    assert all(w in m.report() for w in warnings)


def test_a_model_that_is_fine_has_no_warnings():
    m = Model(states="x y", controls="u", parameters="p")
    m.derivatives = [m.x[1], m.u[0] - m.p[0] * sign(m.x[1]) - clip(m.x[0], -1, 1)]
    m.try_at([0.0, 0.0], p=[0.5])
    assert not [n for n in m.report_data()["notes"] if n["kind"] == "warning"]
