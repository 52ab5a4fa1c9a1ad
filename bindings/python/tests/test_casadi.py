"""Functions of CasADi, compiled and interpreted: the same numbers, the same solutions, refusals."""

import subprocess
import sys

import casadi as ca
import models
import numpy as np
import pytest
import switchback_control as swb

HOW = ["compile", "interpret"]
AT = {"x": [0.7, -1.3], "u": [0.9], "p": [5.0], "t": 0.4}


def sx_function():
    """(x0 u + sin(x1 t), x1^2, 0), with the inputs in another order."""
    t, x, u = ca.SX.sym("t"), ca.SX.sym("x", 2), ca.SX.sym("u")
    return ca.Function(
        "f", [t, x, u], [x[0] * u + ca.sin(x[1] * t), ca.vertcat(x[1] ** 2, ca.SX(1, 1))], ["t", "x", "u"], ["a", "b"]
    )


@pytest.mark.parametrize("how", HOW)
def test_exact_derivatives_and_patterns(how, live):
    before = live()
    f = swb.casadi.function(sx_function(), 2, 1, 1, how=how)
    assert (f.n_out, f.sizes, f.name) == (3, {"x": 2, "u": 1, "p": 1}, "f")
    s, c = np.sin(-0.52), np.cos(-0.52)
    assert np.allclose(f(**AT), [0.63 + s, 1.69, 0.0], rtol=0, atol=1e-15)
    jacobian = [[0.9, 0.4 * c, 0.7, 0, -1.3 * c], [0, -2.6, 0, 0, 0], [0] * 5]
    assert np.allclose(f.jacobian(**AT), jacobian, rtol=0, atol=1e-15)
    w = [0.8, -1.1, 2.0]
    hessian = np.zeros((5, 5))
    hessian[0, 2] = hessian[2, 0] = 0.8
    hessian[1, 1] = -0.8 * s * 0.16 - 2.2
    hessian[1, 4] = hessian[4, 1] = 0.8 * (c - s * -0.52)
    hessian[4, 4] = -0.8 * s * 1.69
    assert np.allclose(f.hessian(**AT, weights=w), hessian, rtol=0, atol=1e-15)
    assert len(f.jacobian_pattern[0]) == 5 and len(f.hessian_pattern[0]) == 4
    assert f.check_derivatives(**AT)
    f.close()
    assert live() == before


@pytest.mark.parametrize("how", HOW)
def test_solvers_inside(how):
    y, a = ca.MX.sym("y"), ca.MX.sym("a")
    solve = ca.rootfinder("solve", "fast_newton", {"x": y, "p": a, "g": y**3 + y - a}, {"abstol": 1e-15})
    x = ca.MX.sym("x")
    f = swb.casadi.function(ca.Function("root", [x], [solve(0, x) ** 2], ["x"], ["y"]), how=how)
    assert f.sizes == {"x": 1, "u": 0, "p": 0}
    assert f(x=10.0) == pytest.approx(4.0, abs=1e-14)
    # y = 2, y' = 1/13, y'' = -6 y y'^3
    assert f.jacobian(x=10.0)[0, 0] == pytest.approx(4 / 13, abs=1e-14)
    assert f.hessian(x=10.0)[0, 0] == pytest.approx(2 / 169 - 48 / 2197, abs=1e-14)


def oscillator():
    x = ca.SX.sym("x", 2)
    inside, outside = (
        ca.Function(name, [x], [ca.DM(a) @ x], ["x"], ["f"]) for name, a in (("f1", models.A_IN), ("f2", models.A_OUT))
    )
    circle = ca.Function("circle", [x], [ca.sumsqr(x) - 1], ["x"], ["c"])
    return inside, outside, circle


def test_functions_as_they_are():
    by_hand = swb.simulate_fesd(models.oscillator(), models.OSCILLATOR_X0, models.OSCILLATOR_T, 10, n_s=5)
    inside, outside, circle = oscillator()
    x = ca.SX.sym("x", 2)
    matrix = ca.Function("F", [x], [ca.horzcat(inside(x), outside(x))], ["x"], ["F"])
    for modes in ([inside, outside], matrix):
        system = models.oscillator(modes, circle)
        result = swb.simulate_fesd(system, models.OSCILLATOR_X0, models.OSCILLATOR_T, 10, n_s=5)
        assert np.allclose(result.state, by_hand.state, rtol=0, atol=1e-10)
        assert [s.t for s in result.trajectory.switches] == pytest.approx([1.0], abs=1e-7)


@pytest.mark.parametrize("how", HOW)
def test_optimal_control(how):
    x, u = ca.MX.sym("x"), ca.MX.sym("u")
    expressions = {"f0": u, "lagrange": x**2 + u**2, "mayer": (x - 1) ** 2}
    parts = {name: ca.Function(name, [x, u], [value], ["x", "u"], ["y"]) for name, value in expressions.items()}
    of_casadi = {name: swb.casadi.function(f, 1, 1, how=how) for name, f in parts.items()}
    by_hand = {
        "f0": lambda u: u,
        "lagrange": lambda x, u: x[0] ** 2 + u[0] ** 2,
        "mayer": lambda x: (x[0] - 1) ** 2,
    }
    costs = []
    for get in (of_casadi, by_hand):
        system = swb.System(1, 1, f0=get["f0"])
        system.add_subsystem([[1.0], [-1.0]], lambda x: x[0], signs=[-1, 1])
        ocp = swb.Ocp(system, 1.0, 4, lagrange=get["lagrange"], mayer=get["mayer"], initial_state=[-0.4])
        costs.append(ocp.solve().cost)
    assert costs[0] == pytest.approx(costs[1], rel=1e-7)


def test_functions_inside_expressions():
    from switchback_control.expr import Model, external, sign

    x = ca.SX.sym("x", 2)
    pull = swb.casadi.function(ca.Function("pull", [x], [-ca.sin(x[0])], ["x"], ["y"]))
    m = Model(states="q v")
    q, v = m.x
    m.derivatives = [v, external(pull, x=[q, v])[0] - 0.3 * sign(v)]
    n = Model(states="q v")
    n.derivatives = [n.x[1], -np.sin(n.x[0]) - 0.3 * sign(n.x[1])]
    ends = [swb.simulate_fesd(model.system(), x0=[1.0, 0.1], duration=2.0, n_steps=10).state for model in (m, n)]
    assert np.allclose(*ends, rtol=0, atol=1e-10)


def test_code_that_was_generated_before(tmp_path):
    inside, _, circle = oscillator()
    swb.casadi.generate([inside, circle], tmp_path / "model.c")
    subprocess.run(["cc", "-shared", "-fPIC", "-o", tmp_path / "model.so", tmp_path / "model.c", "-lm"], check=True)
    f = swb.casadi.load(tmp_path / "model.so", "circle", 2)
    (tmp_path / "model.so").unlink()
    assert f(x=[3.0, 4.0]) == pytest.approx(24.0)
    assert np.allclose(f.hessian(x=[3.0, 4.0]), np.diag([2.0, 2.0, 0.0]))
    f.close()  # while it is open, its name finds it
    with pytest.raises(swb.LibraryError, match="model.so"):
        swb.casadi.load(tmp_path / "model.so", "circle", 2)


def test_refusals(monkeypatch):
    x, y = ca.SX.sym("x", 2), ca.SX.sym("y")
    unnamed = ca.Function("g", [x, y], [x * y])
    with pytest.raises(swb.ArgumentError, match="input 'i0'"):
        swb.casadi.function(unnamed, 2, 1)
    with pytest.raises(swb.ArgumentError, match="has 2 inputs, 1 are listed"):
        swb.casadi.function(unnamed, 2, 1, inputs=["x"])
    assert swb.casadi.function(unnamed, 2, 1, inputs=["x", "u"])([1.0, 2.0], [3.0]) == pytest.approx([3.0, 6.0])
    with pytest.raises(swb.DimensionError, match="has 2 entries, expected 3"):
        swb.casadi.function(unnamed, 3, 1, inputs=["x", "u"])
    with pytest.raises(swb.DimensionError, match="has 2 outputs, expected 3"):
        swb.casadi.function(unnamed, 2, 1, n_out=3, inputs=["x", "u"])
    with pytest.raises(swb.ArgumentError, match="not <function"):
        swb.casadi.function(lambda x: x, 1)
    with pytest.raises(swb.ArgumentError, match="how must be"):
        swb.casadi.function(unnamed, 2, 1, how="guess")
    f, g = (ca.Function("f", [ca.SX.sym("x", n)], [ca.SX(1)], ["x"], ["y"]) for n in (1, 2))
    with pytest.raises(swb.DimensionError, match="disagree about the shape of x"):
        swb.casadi.function([f, g], 1)
    monkeypatch.setenv("CC", "/no/such/compiler")
    with pytest.raises(swb.LibraryError, match="/no/such/compiler"):
        swb.casadi.function(oscillator()[2], how="compile")
    assert swb.casadi.function(oscillator()[2])(x=[3.0, 4.0]) == pytest.approx(24.0)


def test_programs_of_casadi_functions():
    """(x0 - 2)^2 + (x1 - 1)^2 on 0 <= x0 _|_ x1 >= 0 with x0 + x1 <= 3: the projection (2, 0) is the nearer branch."""
    x = ca.SX.sym("x", 2)
    cost = ca.Function("cost", [x], [(x[0] - 2) ** 2 + (x[1] - 1) ** 2], ["x"], ["f"])
    rows = ca.Function("rows", [x], [x[0] + x[1]], ["x"], ["c"])
    program = swb.Mpcc(2, cost, rows, pairs=[(0, 1)], constraint_bounds=(None, [3.0]), start=[0.5, 0.4])
    result = program.solve()
    assert result.success and result.stationarity == "S"
    assert np.allclose(result.x, [2.0, 0.0], rtol=0, atol=1e-9)
    with pytest.raises(swb.SwitchbackError, match="no callable of Python"):
        swb.Mpcc(2, cost, gradient=lambda x: x)


def test_the_package_does_not_need_casadi():
    code = "import sys; sys.modules['casadi'] = None; import switchback_control as swb; swb.Function(lambda x: x, 1)(x=[1.0])"
    subprocess.run([sys.executable, "-c", code], check=True)


def switching_functions():
    """(what the message must name, function)"""
    x, u, p, t = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("p"), ca.SX.sym("t")
    big_x, big_y = ca.MX.sym("x", 2), ca.MX.sym("y")
    scalar = {
        "sign": ca.sign(x[0]),
        "fabs": ca.fabs(x[1]),
        "fmin": ca.fmin(x[0], u),
        "fmax": ca.fmax(x[0] * p, 0),
        "floor": ca.floor(t),
        "ceil": ca.ceil(x[0]),
        "fmod": ca.fmod(t, 1.0),
        "if_else": ca.if_else(x[0] > 0, x[0], -x[0]),
        "<": x[0] < x[1],
        "logic_and": ca.logic_and(x[0] > 0, x[1] > 0),
    }
    for words, e in scalar.items():
        yield words, ca.Function("f", [x, u, p, t], [x, e], ["x", "u", "p", "t"], ["smooth", "y"])
    inner = ca.Function("inner", [big_x], [big_x**2, ca.norm_1(big_x)], {"never_inline": True})
    yield "norm_1", ca.Function("f", [big_x], [big_x, inner(big_x)[1]], ["x"], ["smooth", "y"])
    yield "mmax", ca.Function("f", [big_x], [big_x, ca.mmax(big_x)], ["x"], ["smooth", "y"])
    a = ca.MX.sym("a")
    solve = ca.rootfinder("solve", "fast_newton", {"x": big_y, "p": a, "g": big_y**3 + big_y - ca.fabs(a)})
    yield "fabs", ca.Function("f", [big_x], [big_x, solve(0, big_x[0])], ["x"], ["smooth", "y"])
    choice = ca.Function.if_else("c", *(ca.Function(n, [a], [s * a]) for n, s in (("up", 1), ("down", -1))))
    yield "a choice", ca.Function("f", [big_x], [big_x, choice(big_x[0] > 0, big_x[1])], ["x"], ["smooth", "y"])
    lines = ca.interpolant("lines", "linear", [[0, 1, 2]], [0, 1, 0])
    yield "a table", ca.Function("f", [big_x], [big_x, lines(big_x[0])], ["x"], ["smooth", "y"])
    each = ca.Function("each", [a], [ca.sign(a)]).map(2)
    yield "sign", ca.Function("f", [big_x], [big_x, each(big_x.T).T], ["x"], ["smooth", "y"])


@pytest.mark.parametrize("words, f", list(switching_functions()), ids=lambda v: v if isinstance(v, str) else "")
def test_what_switches_is_refused_in_words(words, f):
    with pytest.raises(swb.UnsupportedError, match="output 1") as caught:
        swb.casadi.function(f)
    message = str(caught.value)
    assert words in message and "'f'" in message and "add_subsystem" in message and "smooth=True" in message
    with pytest.raises(swb.UnsupportedError, match="modes"):
        swb.System(2, 1, 1).set_f0(f)


def test_what_does_not_switch_is_taken():
    x, p = ca.SX.sym("x", 2), ca.SX.sym("p")
    constant = ca.fabs(p) + ca.if_else(p > 1, 2, 3)
    f = ca.Function("f", [x, p], [constant * x + ca.norm_2(x), ca.sqrt(x[0]), ca.atan2(x[0], x[1])], ["x", "p"], list("abc"))
    assert np.allclose(swb.casadi.function(f, how="interpret")([3.0, 4.0], p=[-2.0])[:2], [20.0, 25.0])
    y = ca.MX.sym("x", 2)
    curve = ca.interpolant("curve", "bspline", [[0, 1, 2, 3, 4]], [0, 1, 0, 1, 0])
    f = ca.Function("f", [y], [curve(y[0]), ca.logsumexp(y)], ["x"], ["a", "b"])
    assert swb.casadi.function(f, how="interpret")([1.0, 0.0])[0] == pytest.approx(1.0)
    guarded = ca.Function("f", [x], [ca.sqrt(ca.fmax(x[0], 1e-9))], ["x"], ["a"])
    assert swb.casadi.function(guarded, how="interpret", smooth=True)([4.0, 0.0])[0] == pytest.approx(2.0)


# --- models -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [ca.SX, ca.MX])
def test_models_are_those_of_expressions(kind):
    """if_else, sign, fmax and fabs become the modes that where, sign, maximum and abs have, to the last bit."""
    from switchback_control.expr import Model, maximum, sign, where

    x, u, p, t = kind.sym("x", 2), kind.sym("F"), kind.sym("k"), kind.sym("t")
    q, v = x[0], x[1]
    force = ca.if_else(q > 0.3, -p * q, -2 * p * q) - 0.3 * ca.sign(v) + u * ca.sin(t) + ca.fmax(q, 0) - ca.fabs(v)
    read = swb.Model.from_casadi(x, u, p, ca.vertcat(v, force), t=t)
    m = Model("q v", "F", "k")
    m.derivatives = [
        m.v,
        where(m.q > 0.3, -m.k * m.q, -2 * m.k * m.q) - 0.3 * sign(m.v) + m.F * swb.sin(m.t) + maximum(m.q, 0) - abs(m.v),
    ]
    assert read.counts() == m.counts() and read.names == [["x_0", "x_1"], ["F"], ["k"]]
    runs = [swb.simulate(k, [1.0, 0.0], 6.0, u=[0.5], p=[1.3], rtol=1e-11) for k in (read, m)]
    assert np.array_equal(runs[0].x_end, runs[1].x_end) and len(runs[0].switches) == len(runs[1].switches) >= 3


def test_models_from_lists_of_symbols_and_conditions_as_numbers():
    a, b = ca.MX.sym("a"), ca.MX.sym("b", 2)
    m = swb.Model.from_casadi([a, b], rhs=[(a > 0) * b[0], ca.logic_and(b[0] > 0, b[1] < 1), -b[1]])
    assert m.names[0] == ["a", "b_0", "b_1"] and m.counts().switching_functions == 3
    assert swb.simulate(m, [1.0, 2.0, 0.5], 1.0).x_end == pytest.approx([3.5, 3.0, 0.5 * np.exp(-1)], abs=1e-7)


def test_systems_stated_for_nosnoc():
    x = ca.SX.sym("x", 2)
    F = ca.horzcat(ca.DM(models.A_IN) @ x, ca.DM(models.A_OUT) @ x)
    system = swb.casadi.system(x, F, np.array([[-1], [1]]), ca.sumsqr(x) - 1)
    run = swb.simulate(system, models.OSCILLATOR_X0, models.OSCILLATOR_T, rtol=1e-10)
    assert run.x_end == pytest.approx(models.OSCILLATOR_XT, abs=1e-8) and run["x_0"][0] == models.OSCILLATOR_X0[0]
    two = swb.casadi.system(x, [F / 2, F / 2], [[-1, 1]] * 2, [ca.sumsqr(x) - 1] * 2)
    assert two.n_subsystems == 2


@pytest.mark.parametrize(
    "expression, error, message",
    [
        (lambda x: ca.floor(x[0]), swb.UnsupportedError, "operator floor"),
        (lambda x: x[0] == 1, swb.UnsupportedError, "compare by < or >"),
        (lambda x: ca.if_else(x[0], 1, 2), swb.UnsupportedError, "a number is used as a condition"),
        (lambda x: ca.SX.sym("z"), swb.ArgumentError, "other symbols than those given"),
        (lambda x: ca.vertcat(x, x), swb.DimensionError, "5 derivatives for 2 states"),
    ],
)
def test_models_that_cannot_be_read(expression, error, message):
    x = ca.SX.sym("x", 2)
    with pytest.raises(error, match=message):
        swb.Model.from_casadi(x, rhs=ca.vertcat(expression(x), 0))
