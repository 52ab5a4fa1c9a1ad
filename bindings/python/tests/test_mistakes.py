"""Mistakes of the first hour, and what is said about them: the message names what is wrong and what to do."""

import math
import re

import numpy as np
import pytest

import switchback_control as swb
from models import A_IN, oscillator
from switchback_control.expr import Model, sign, solve


def spring():
    m = Model(states="q v", controls="F", parameters="k")
    m.derivatives = [m.v, -m.k * m.q - sign(m.v) + m.F]
    return m


def simulated(x0=(1.0, 0.0), t_span=1.0, u=(0.0,), p=(1.0,), **keywords):
    return swb.simulate(spring(), x0, t_span, u=u, p=p, **keywords)


def no_derivative():
    m = Model(states="q v")
    m.derivative("q", m.v)
    return swb.simulate(m, [1, 0], 1.0)


def swing():
    m = Model(states="q v", controls="F")
    m.derivatives = [m.v, m.F - m.q]
    return swb.Ocp(m, horizon=1.0, n_stages=2, lagrange=m.F**2, initial_state=[1.0, 0.0])


def swing_of(of, constraint=False):
    m = Model(states="q v", controls="F")
    m.derivatives = [m.v, m.F - m.q]
    ocp = swb.Ocp(m, horizon=1.0, n_stages=2, initial_state=[1.0, 0.0])
    return ocp.add_path(of(m.F), None, [1.0]) if constraint else ocp.set_lagrange(of(m.q))


def between():
    m = Model(states="q")
    m.derivatives = [-m.q]
    return swb.Ocp(m, 1.0, 1).add_boundary(m.q, 0, 0)


def first_order(value):
    m = Model(states="q")
    m.derivatives = [value(m)]
    return m


def named_like_all():
    m = Model(states="x", controls="u")
    m.derivatives = [m.u - m.x]
    return m


MISTAKES = {
    "controls left out": (lambda: simulated(u=None), swb.NullError, r"u is missing: the model has 1 control \(F\), give u=\[\.\.\.\]"),
    "parameters left out": (lambda: simulated(p=None), swb.NullError, r"p is missing: the model has 1 parameter \(k\)"),
    "initial state left out": (lambda: simulated(x0=None), swb.NullError, r"x0 is missing: the model has 2 states \(q, v\)"),
    "typo in a name": (lambda: simulated(p={"kk": 1.0}), swb.ArgumentError, r"p has no 'kk': did you mean 'k'\?"),
    "a state forgotten": (lambda: simulated(x0={"q": 1.0}), swb.ArgumentError, r"x0 says nothing of v"),
    "typo in an attribute": (lambda: first_order(lambda m: m.qq), AttributeError, r"Model has no 'qq': did you mean 'q'\?"),
    "rhs instead of derivatives": (lambda: setattr(spring(), "rhs", []), AttributeError, r"set model.derivatives = \[\.\.\.\]"),
    "a state is assigned": (lambda: setattr(spring(), "q", 1), AttributeError, r"'q' is a state: set its derivative by"),
    "two models mixed": (lambda: spring().function(spring().q ** 2), swb.ArgumentError, r"expressions of two graphs"),
    "a derivative forgotten": (no_derivative, swb.ArgumentError, r"no derivative is given for v"),
    "a state named x": (lambda: named_like_all().system(), swb.DimensionError, r"the derivative of x is an array.*write model\['u'\] for that one"),
    "math.sin": (lambda: first_order(lambda m: math.sin(m.q)), TypeError, r"use swb.sin or numpy.sin instead of math.sin"),
    "if in a model": (lambda: first_order(lambda m: 1 if m.q > 0 else 2), TypeError, r"use where, &, \| and ~, not if"),
    "sign in a cost": (lambda: (lambda m: m.function(swb.sign(m.q)))(spring()), swb.UnsupportedError, r"sums of smooth terms.*a further state"),
    "abs of a state in a cost": (lambda: swing_of(abs), swb.UnsupportedError, r"the derivative of a further state"),
    "abs in a constraint": (lambda: swing_of(abs, constraint=True), swb.UnsupportedError, r"abs\(a\) <= b as -b <= a <= b"),
    "t_eval": (lambda: simulated(t_eval=[0.5]), swb.ArgumentError, r"call the result, run\(t_eval\)"),
    "args": (lambda: simulated(args=(1,)), swb.ArgumentError, r"parameters of the model are p="),
    "typo in an option": (lambda: simulated(rtoll=1e-6), swb.OptionError, r"unknown option 'rtoll'; did you mean 'rtol'\?"),
    "wrong size": (lambda: simulated(x0=[1.0]), swb.DimensionError, r"x0 has shape \(1,\), expected \(2,\)"),
    "time runs back": (lambda: simulated(t_span=(1.0, 0.0)), swb.RangeError, r"the end must not lie before the start"),
    "a result before a solve": (lambda: swb.Nlp(1, lambda x: x @ x).result, swb.StateError, r"there is no result: call solve first"),
    "a function that returns nothing": (lambda: swb.Function(lambda x: None, 1)([1.0]), TypeError, r"returned None: is a return missing\?"),
    "states called y": (
        lambda: swb.System(2, f0=lambda t, y: [y[1], -y[0]]), swb.ArgumentError, r"no input 'y': states are x, as in lambda t, x"
    ),
    "order of solve_ivp": (lambda: simulated(x0=(0.0, 6.0), t_span=(1.0, 0.0)), swb.RangeError, r"the order is \(system, x0, t_span\)"),
    "a typo in a result": (lambda: simulated().outcom, AttributeError, r"did you mean 'outcome'\?"),
    "constraints of an Opti stack": (lambda: swing().subject_to(1), AttributeError, r"constraints are add_path\(f, lower, upper\)"),
    "a comparison as constraint": (lambda: swing().add_terminal(1 == 2), swb.ArgumentError, r"give the expression and its bounds"),
    "expressions of another model": (lambda: swing().set_mayer(spring().q), swb.ArgumentError, r"mayer: these are not expressions of the model"),
    "expressions at both ends": (lambda: between(), swb.ArgumentError, r"model.between_ends"),
    "ipopt": (lambda: swb.Ocp(spring(), T=1.0, N=2, ipopt={}), swb.ArgumentError, r"there is one solver"),
    "verbose in a solve": (lambda: swing().solve(verbose=True), swb.ArgumentError, r"Ocp\(..., verbose=True\) shows the iterations"),
    "an option in a solve": (lambda: swing().solve(tol=1e-6), swb.ArgumentError, r"as in ocp.set\(tol=...\)"),
    "multipliers of a result": (lambda: swing().solve().multipliers, AttributeError, r"ocp.multipliers\(\)"),
    "a batch without controls": (
        lambda: swb.simulate_batch(spring(), np.ones((3, 2)), 1.0, p=[1.0]), swb.NullError, r"u is missing: the model has 1 control \(F\)"
    ),
    "time before state": (lambda: swb.Integrator(spring()).reinit(0.0, [1.0, 0.0]), swb.ArgumentError, r"the state comes first: reinit\(x, t\)"),
    "no such argument": (lambda: swb.Function(lambda state: state, 1), swb.ArgumentError, r"there is no input 'state'"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_what_is_said(mistake):
    do, error, message = MISTAKES[mistake]
    with pytest.raises(error, match=message) as caught:
        do()
    assert not re.search(r"\bswb_|\bNULL\b", str(caught.value)), "names of C in a message for Python"


def test_functions_of_expressions_take_numbers():
    """What a callable uses is called with expressions and with numbers."""
    a = np.array([[2.0, 1.0], [1.0, 3.0]])
    assert np.allclose(a @ solve(a, [1.0, 2.0]), [1.0, 2.0])
    assert swb.sin(0.5) == math.sin(0.5) and swb.erf(0.5) == math.erf(0.5) and swb.atan2(1.0, 2.0) == math.atan2(1.0, 2.0)
    assert swb.maximum(1.0, 2.0) == 2.0 and swb.dead_zone(3.0, 1.0) == 2.0 and swb.relay(-1.0, 5.0, 7.0) == 7.0
    f = swb.Function(lambda x: solve(a, x) * swb.exp(x[0]), 2, n_out=2)
    assert f.traced and np.allclose(f([0.3, 0.4]), np.linalg.solve(a, [0.3, 0.4]) * np.exp(0.3))


def test_names_of_scipy_are_understood():
    assert np.array_equal(simulated(max_step=0.1, method="RK45").x_end, simulated(h_max=0.1, method="dp5").x_end)
    with pytest.raises(swb.ArgumentError, match="'max_step' is 'h_max' here"):
        simulated(max_step=0.1, h_max=0.2)


def test_constants_among_modes():
    system = swb.System(2)
    system.add_subsystem([lambda x: A_IN @ x, [1.0, 0.0]], lambda x: x @ x - 1.0, signs=[-1, 1])
    assert swb.simulate(system, [0.5, 0.0], 0.1).success and oscillator().n_subsystems == 1


def test_words_of_other_packages_for_optimal_control():
    m = Model(states="q v", controls="F")
    m.derivatives = [m.v, m.F - 0.3 * sign(m.v)]
    end = dict(lower=[1.0, 0.0], upper=[1.0, 0.0])
    own = swb.Ocp(m, horizon=2.0, n_stages=4, lagrange=m.function(m.F**2), initial_state=[0.0, 0.0], control_bounds=(-3, 3))
    own.add_terminal(m.function([m.q, m.v]), **end)
    other = swb.Ocp(m, T=2.0, N=4, running_cost=m.F**2, x0=[0.0, 0.0], u_bounds={"F": (-3, 3)})
    other.add_terminal([m.q, m.v], **end)
    other.set_state_bounds({"v": (None, 100.0)})
    assert own.solve().cost == pytest.approx(other.solve().cost, rel=1e-9)
    assert "horizon" in other._repr_html_() and "q, v" in other._repr_html_()
    with pytest.raises(swb.ArgumentError, match="'N' is 'n_stages' here"):
        swb.Ocp(m, T=2.0, N=4, n_stages=4)


def test_how_far_a_simulation_is():
    said = []
    run = simulated(t_span=(1.0, 7.0), h_max=0.1, progress=lambda done, total: said.append((done, total)))
    assert said[-1] == (100, 100) and said == sorted(said) and len(said) > 20
    assert repr(run) == f"<Run from 1 to 7, reached, {len(run.switches)} switch{'' if len(run.switches) == 1 else 'es'}>"
    steps = []
    assert np.array_equal(simulated(progress=lambda *_: None, on_step=steps.append).x_end, simulated().x_end) and steps
    html = spring()._repr_html_()
    assert "2: q, v" in html and "switching function" in html
