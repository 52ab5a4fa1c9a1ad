"""What Pyomo reads besides values: statuses, messages, dual values, suffixes; and options."""

import math
import subprocess

import problems
import pyomo.environ as pyo
import pytest
from pyomo.opt import SolverStatus, TerminationCondition


def hs071():
    """Problem 71 of Hock and Schittkowski, Test examples for nonlinear programming codes (1981)."""
    m = pyo.ConcreteModel()
    x = problems.variables(m, "x", [1, 5, 5, 1], 1, 5)
    m.f = pyo.Objective(expr=x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2])
    m.product = pyo.Constraint(expr=x[0] * x[1] * x[2] * x[3] >= 25)
    m.sphere = pyo.Constraint(expr=sum(v**2 for v in x) == 40)
    return m


def test_nonlinear_program_with_dual_values(solve):
    m = hs071()
    m.dual, m.bound_dual = pyo.Suffix(direction=pyo.Suffix.IMPORT), pyo.Suffix(direction=pyo.Suffix.IMPORT)
    result = solve(m)
    assert result.solver.id == 0 and "strict local optimum" in result.solver.message
    assert pyo.value(m.f) == pytest.approx(17.0140172892, abs=1e-8)
    assert [m.dual[m.product], m.dual[m.sphere]] == pytest.approx([0.5522936594, -0.1614685641], abs=1e-7)
    assert m.bound_dual[m.x[0]] == pytest.approx(1.0878712072, abs=1e-7)


def test_dual_values_are_sensitivities(solve):
    """The change of the optimum with the right-hand side, minimised and maximised."""

    def best(cap, sense):
        m = pyo.ConcreteModel()
        m.x, m.y = pyo.Var(bounds=(0.1, 9), initialize=1), pyo.Var(bounds=(0.1, 9), initialize=1)
        sign = 1 if sense == pyo.maximize else -1
        m.f = pyo.Objective(expr=sign * (pyo.log(m.x) + 2 * pyo.sqrt(m.y)), sense=sense)
        m.cap = pyo.Constraint(expr=pyo.inequality(-5, m.x + 2 * m.y, cap))
        m.dual = pyo.Suffix(direction=pyo.Suffix.IMPORT)
        assert solve(m).solver.id == 0
        return pyo.value(m.f), m.dual[m.cap]

    for sense in (pyo.minimize, pyo.maximize):
        slope = (best(3.001, sense)[0] - best(2.999, sense)[0]) / 0.002
        assert best(3.0, sense)[1] == pytest.approx(slope, rel=1e-5)


def test_infeasible(solve):
    m = pyo.ConcreteModel()
    m.x, m.y = pyo.Var(bounds=(0, None), initialize=1), pyo.Var(bounds=(0, None), initialize=1)
    m.f = pyo.Objective(expr=m.x + m.y)
    problems.pair(m, "p", m.x >= 0, m.y >= 0)
    m.both = pyo.Constraint([0, 1], rule=lambda _, k: (m.x, m.y)[k] >= 1)
    result = solve(m, load=False)
    assert result.solver.termination_condition == TerminationCondition.infeasible and result.solver.id == 200


def test_unbounded_and_limits(solve):
    m = pyo.ConcreteModel()
    m.x, m.y = pyo.Var(bounds=(0, None), initialize=1), pyo.Var(bounds=(0, None), initialize=1)
    m.f = pyo.Objective(expr=m.x + m.y, sense=pyo.maximize)
    problems.pair(m, "p", m.x >= 0, m.y >= 0)
    assert solve(m, load=False).solver.termination_condition == TerminationCondition.unbounded
    result = solve(hs071(), load=False, max_iter=2)
    assert result.solver.termination_condition == TerminationCondition.maxIterations and result.solver.id == 400


def test_kinks_and_conditions(solve):
    m = pyo.ConcreteModel()
    m.x, m.y = pyo.Var(initialize=2.0), pyo.Var(bounds=(-1, 4), initialize=0.3)
    data = [-3.0, 0.25, 7.0]
    m.f = pyo.Objective(expr=sum(abs(m.x - d) for d in data) + (m.y - 2) ** 2)
    # Huber's function, which is smooth although its formula has a condition
    huber = pyo.Expr_if(m.y <= 1, 0.5 * m.y**2, m.y - 0.5)
    m.c = pyo.Constraint(expr=huber <= 1.0)
    assert solve(m).solver.id == 0
    assert [m.x(), m.y()] == pytest.approx([0.25, 1.5], abs=1e-7)


def test_integers_are_refused_or_relaxed(solve):
    m = pyo.ConcreteModel()
    m.x = pyo.Var(within=pyo.Integers, bounds=(0, 9))
    m.f = pyo.Objective(expr=(m.x - 2.5) ** 2)
    result = solve(m, load=False)
    assert result.solver.status == SolverStatus.error and "1 variables must be integers" in result.solver.message
    assert solve(m, load=False, relax_integrality=1).solver.id == 0


def test_named_defined_expressions_and_fixed_variables(solve):
    m = pyo.ConcreteModel()
    x = problems.variables(m, "x", [0.5, 0.5, 0.5])
    m.e = pyo.Expression(expr=pyo.sin(x[0]) + x[1] ** 2)
    m.f = pyo.Objective(expr=m.e**2 + (m.e - x[2]) ** 2 + (x[0] - 1) ** 2)
    m.g = pyo.Constraint(expr=m.e + x[2] >= 2)
    m.x[1].fix(0.5)
    assert solve(m).solver.id == 0
    e = pyo.value(m.e)
    assert e + x[2]() >= 2 - 1e-9 and pyo.value(m.f) < 2.0


def test_options_of_the_environment(program, tmp_path, monkeypatch):
    m = hs071()
    stub = tmp_path / "hs071.nl"
    m.write(str(stub))
    monkeypatch.setenv("switchback_mpcc_ampl_options", "max_iter=1")
    run = [program, str(tmp_path / "hs071"), "-s"]
    assert "limit of iterations" in subprocess.run(run, capture_output=True, text=True, check=True).stdout
    assert "objno 0 400" in (tmp_path / "hs071.sol").read_text()
    # the command line comes later
    run.append("max_iter=100")
    assert "strict local optimum" in subprocess.run(run, capture_output=True, text=True, check=True).stdout
    run[-1] = "max_itre=100"
    failed = subprocess.run(run, capture_output=True, text=True)
    assert failed.returncode == 1 and "did you mean 'max_iter'?" in failed.stderr


def test_absolute_values_are_those_of_a_linear_program(solve):
    """The fit of least absolute deviations, by kinks and by inequalities."""
    xs = [math.sin(7.0 * k) for k in range(60)]
    ys = [1 + 2 * x - x * x + (3.0 if k % 3 == 0 else 0.1) * math.cos(11.0 * k) for k, x in enumerate(xs)]

    def fit(kinks):
        m = pyo.ConcreteModel()
        a = problems.variables(m, "a", [0, 0, 0])
        m.t = pyo.Var(range(60), initialize=1)
        left = [a[0] + a[1] * x + a[2] * x * x - y for x, y in zip(xs, ys)]
        if kinks:
            m.f = pyo.Objective(expr=sum(abs(e) for e in left))
        else:
            m.f = pyo.Objective(expr=sum(m.t[k] for k in range(60)))
            m.above = pyo.Constraint(range(60), rule=lambda m, k: m.t[k] >= left[k])
            m.below = pyo.Constraint(range(60), rule=lambda m, k: m.t[k] >= -left[k])
        assert solve(m).solver.id == 0
        return [v() for v in a]

    assert fit(True) == pytest.approx(fit(False), abs=1e-8)
