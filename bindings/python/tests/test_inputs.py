"""Inputs that would be wrong without a word: constants that stay cheap, equality, names, starts, ends, constants for functions."""

import math
import warnings

import numpy as np
import pytest

import switchback_control as swb
from switchback_control.expr import where


def moved(x, high, low, t):
    """x' = high where x > 0, low where x < 0, after a time, by hand."""
    rate = high if x > 0 else low
    if rate * x >= 0 or abs(x) >= abs(rate) * t:
        return x + rate * t
    t -= abs(x / rate)
    return 0.0 if high < 0 < low else rate_behind(rate, high, low) * t


def rate_behind(rate, high, low):
    return low if rate < 0 else high


def given(rng, value):
    """A constant mode as people write it."""
    return [[value], np.array([value]), lambda: value, lambda x, value=value: value + 0.0 * x, lambda: [value], (value,)][rng.integers(6)]


def test_constants_and_mixtures_run_without_python():
    rng = np.random.default_rng(7)
    for _ in range(30):
        high, low = rng.choice([-1, 1], 2) * rng.uniform(0.3, 3, 2)
        if high > 0 > low:  # not unique at zero
            high = -high
        system = swb.System(1, f0=[0.0] if rng.random() < 0.3 else None)
        kind = rng.integers(3)
        modes = [[[high], [low]], np.array([[high], [low]]), [given(rng, high), given(rng, low)]][kind]
        system.add_subsystem(modes=modes, psi=lambda x: x[0], signs=[1, -1])
        assert not any(f._in_python for f in system._functions)
        x0 = rng.choice([-1, 1]) * rng.uniform(0.2, 1)
        assert swb.simulate(system, [x0], 2.0).x_end[0] == pytest.approx(moved(x0, high, low, 2.0), abs=1e-9)


def test_affine_functions_are_expressions_with_their_patterns():
    rng = np.random.default_rng(8)
    for _ in range(30):
        n, nx, nu, np_ = rng.integers(1, 4), *rng.integers(1, 4, 3)
        width = rng.choice([nx, nx + nu, nx + nu + np_, nx + nu + np_ + 1])
        a, b = np.round(rng.normal(size=(n, width)) * (rng.random((n, width)) < 0.6), 2), rng.normal(size=n)
        f = swb.Function.affine(b, a, nx=nx, nu=nu, np=np_)
        z = rng.normal(size=nx + nu + np_ + 1)
        point = z[:nx], z[nx : nx + nu], z[nx + nu : -1], z[-1]
        np.testing.assert_allclose(f(*point), b + a @ z[:width], rtol=1e-13, atol=1e-13)
        assert not f._in_python and len(f.hessian_pattern[0]) == 0
        wide = np.zeros((n, len(z)))
        wide[:, :width] = a
        np.testing.assert_array_equal(f.jacobian(*point), wide)
        assert set(zip(*f.jacobian_pattern)) == set(zip(*np.nonzero(wide)))


def test_expressions_are_functions_of_a_system():
    m = swb.Model(states="q v")
    system = swb.System(2)
    system.add_subsystem(modes=[[m.v, -1], [m.v, 1.0]], psi=m.q - 0.5, signs=[1, -1])
    assert not any(f._in_python for f in system._functions)
    assert swb.simulate(system, [0, 0], 1.0).x_end == pytest.approx([0.5, 1.0], abs=1e-9)
    with pytest.raises(swb.ArgumentError, match="is a condition"):
        system.add_transition(m.q > 1)


def equalities(m, rng):
    """A comparison by == or != in one of the ways it is written."""
    a = m.x[rng.integers(3)] * rng.normal() + rng.normal()
    b = [0, 1.5, np.float64(2.0), m.x[rng.integers(3)] ** 2, np.zeros(3)][rng.integers(5)]
    a = m.x if isinstance(b, np.ndarray) else a
    left, right = (a, b) if rng.random() < 0.5 else (b, a)
    return lambda: left == right if rng.random() < 0.5 else left != right


USES = [
    lambda m, c: where(c(), 1, 2),
    lambda m, c: np.where(c(), 1.0, m.q),
    lambda m, c: where(c() & (m.q > 0), 1, 2),
    lambda m, c: where((m.q > 0) | c(), 1, 2),
    lambda m, c: where(~c(), m.q, 2),
    lambda m, c: m.transition(c(), reset={m.q: 0}),
    lambda m, c: m.derivative("q", c()),
    lambda m, c: 2.0 * c(),
]


def test_equality_is_no_condition():
    rng = np.random.default_rng(9)
    m = swb.Model(states="q v w")
    for k in range(48):
        with pytest.raises(TypeError, match=r"[!=]= .*Compare by < or >"):
            USES[k % len(USES)](m, equalities(m, rng))


def test_the_same_expression_is_found_in_sets_and_dictionaries():
    m = swb.Model(states="q v")
    assert m.q == m["q"] and not m.q == m.v and m.q != m.v and not m.q != m["q"]
    assert {m.q: 1}[m["q"]] == 1 and m.v in [m.q, m.v] and len({m.q, m.x[0], m.v}) == 2
    assert m.q != "q" and m.q != None  # noqa: E711


@pytest.mark.parametrize("f", [round, math.ceil, np.trunc, lambda q: divmod(q, 1)])
def test_remainders_say_that_a_transition_starts_again(f):
    with pytest.raises(TypeError, match="a state with a transition"):
        f(swb.Model(states="q").q)


@pytest.mark.parametrize("f", [lambda q: q % 1, lambda q: 7 // q, np.floor, lambda q: np.mod(q, 2), math.floor])
def test_remainders_are_for_resets_and_no_derivatives(f):
    m = swb.Model(states="q")
    m.derivatives = [f(m.q)]
    with pytest.raises(swb.UnsupportedError, match="a clock or a transition resets"):
        m.system()
    m = swb.Model(states="q")
    m.derivatives = [0 * m.q + 1]
    m.transition(m.t > 0.5, reset={m.q: f(m.q)})
    assert swb.simulate(m, [2.5], 1.0).success


def test_functions_of_numpy_that_are_not_known_say_what_is():
    q = swb.Model(states="q").q
    for f, said in ((lambda a: np.heaviside(a, 0.5), r"relay\(a, 1, 0\)"), (lambda a: np.hypot(a, 1), "sqrt"), (np.log10, "log"), (np.sinc, "not known for expressions")):
        with pytest.raises(TypeError, match=said):
            f(q)
    with pytest.raises(TypeError, match="Compare by"):
        np.isclose(q, 0)


def named(model):
    """Names that warnings are about."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        model()
    return {str(w.message).split("'")[1] for w in said if w.category is swb.NameWarning}


def test_names_that_mean_something_else():
    rng = np.random.default_rng(10)
    pool = ["x", "u", "p", "t", "name", "report", "nx", "q", "angle", "speed"]
    for _ in range(40):
        names = list(rng.permutation(pool)[:5])
        parts = names[:3], names[3:4], names[4:]
        hidden = {n for n in names if n in ("t", "name", "report", "nx")}
        hidden |= {n for n, own in (("x", parts[0]), ("u", parts[1]), ("p", parts[2])) if n in names and (n not in own or len(own) > 1)}
        assert named(lambda: swb.Model(*parts)) == hidden
    assert named(lambda: swb.Model("x", "u", "p")) == set()  # m.x holds x alone
    assert named(lambda: swb.Scene("x y", u="f")) == set() and named(lambda: swb.Scene("t y")) == {"t"}


def test_names_given_twice():
    rng = np.random.default_rng(11)
    for _ in range(30):
        names = [f"a{i}" for i in range(6)]
        i, j = rng.permutation(6)[:2]
        names[i] = names[j]
        cuts = sorted(rng.integers(1, 7, 2))
        with pytest.raises(swb.ArgumentError, match="two variables are called"):
            swb.Model(names[: cuts[0]], names[cuts[0] : cuts[1]], names[cuts[1] :])


def test_all_states_are_not_the_one_called_x():
    with pytest.warns(swb.NameWarning):
        m = swb.Model(states="x v", controls="u")
    m.derivatives = [m.x[1], m.u[0]]
    ocp = swb.Ocp(m, 1.0, 2, initial_state=[0, 0])
    with pytest.raises(swb.ArgumentError, match=r"write model\['x'\]"):
        ocp.add_path(m.x, -1, 1.2)
    ocp.add_path(m["x"], -1, 1.2)
    ocp.add_path(m.u, -1, 1.2)  # one control, which is called u


def growing(rng):
    """x' = a x^2 from x0, which has no value from 1 / (a x0) on."""
    a, x0 = rng.uniform(0.5, 2, 2)
    m = swb.Model(states="z")
    m.derivatives = [a * m.z**2]
    return m, x0, 1.0 / (a * x0)


def test_the_state_of_a_run_that_ended_early():
    rng = np.random.default_rng(12)
    for _ in range(15):
        m, x0, end = growing(rng)
        run = swb.simulate(m, [x0], 2 * end)
        with pytest.warns(swb.EarlyEndWarning, match="ended early, step_too_small"):
            run.x_end
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            assert repr(run) and run.to_dict() and run.t_end < 1.01 * end
            assert swb.simulate(m, [x0], 0.5 * end).x_end[0] == pytest.approx(2 * x0, rel=1e-6)
            swb.simulate(m, [x0], 0.5 * end, on_step=lambda step: True).x_end  # who stops it knows
    result = swb.simulate_fesd(m, [x0], 2 * end, 6)
    assert not result.success
    with pytest.warns(swb.EarlyEndWarning):
        result.state


def test_nothing_said_of_the_initial_state():
    m = swb.Model(states="q", controls="F")
    m.derivatives = [m.F]
    starts = dict(initial_state=[0.0]), dict(initial_bounds=([0.0], [1.0]))
    for said in starts:
        ocp = swb.Ocp(m, 1.0, 2, lagrange=m.F**2, **said)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            assert ocp.solve().success
    ocp = swb.Ocp(m, 1.0, 2, lagrange=m.F**2 + m.q**2)
    with pytest.warns(swb.UnsetWarning, match="give initial_state"):
        ocp.solve()


def test_constants_in_the_place_of_functions():
    m = swb.Model(states="q v", controls="F")
    m.derivatives = [m.v, m.F]
    ocp = swb.Ocp(m, 1.0, 2, initial_state=[0, 0])
    rng = np.random.default_rng(13)
    for k in range(32):
        c = round(float(rng.normal()), 3)
        constant = [c, [c], np.array([c]), lambda: c, m.graph.constant(c), 0 * m.q + c, m.q * 0.0, lambda x: 0 * x[0] + c][k % 8]
        wrong = [
            lambda: ocp.add_path(constant, 0, 1),
            lambda: ocp.add_terminal(constant, 0, 1),
            lambda: ocp.add_relaxed(constant, 0, 1),
            lambda: swb.System(2).add_subsystem([[1, 1], [2, 2]], constant, [1, -1]),
            lambda: swb.System(2).add_transition(constant),
            lambda: ocp.set_mayer(c if k % 8 == 0 else constant),
        ][rng.integers(6)]
        with pytest.raises(swb.ArgumentError, match="constant"):
            wrong()
    with pytest.raises(swb.ArgumentError, match=r"terminal\[1\] is a constant"):
        ocp.add_terminal([m.q, 2.0], [0, 0], [1, 1])
    ocp.set_mayer(0)
    with pytest.raises(swb.ArgumentError, match="never passes zero"):
        m.transition(True)


def test_words_of_other_packages():
    m = swb.Model(states="q v", controls="F")
    m.derivatives = [m.v, m.F]
    for wrong, said in (
        (lambda: swb.simulate(m, [0, 0], 1.0, u=[0], stop=lambda s: True), "where on_step"),
        (lambda: swb.simulate(m, [0, 0], 1.0, u=lambda t: t), "u is a function: give numbers"),
        (lambda: swb.Ocp(m, 1.0, 2, stop=1), "ends a solve by returning True"),
        (lambda: swb.Ocp(m, 1.0, 2).solve(stop=1), "ends the solve by returning True"),
        (lambda: swb.Ocp(m, 1.0, 2).add_terminal("q", 1, 1), "give the expression, model.q"),
    ):
        with pytest.raises(swb.ArgumentError, match=said):
            wrong()
    result = swb.Ocp(m, 1.0, 2, initial_state=[1, 0], lagrange=m.F**2 + m.q**2, max_time=1e-9).solve()
    assert "before the first iterate" in result.message and "raise the option max_time" in result.message
