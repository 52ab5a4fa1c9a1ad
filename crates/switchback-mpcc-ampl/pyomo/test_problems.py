"""Problems with known solutions, written by Pyomo and solved as AMPL's solvers are called."""

import problems
import pyomo.environ as pyo
import pytest
from pyomo.opt import TerminationCondition


@pytest.mark.parametrize("make", problems.ALL, ids=lambda f: f.__name__)
def test_known_value(make, solve):
    m, value = make()
    result = solve(m)
    assert result.solver.termination_condition == TerminationCondition.optimal
    # 0: exact, and shown to be B-stationary
    assert result.solver.id == 0, result.solver.message
    assert pyo.value(m.f) == pytest.approx(value, rel=2e-5, abs=1e-6)
    for c in m.component_data_objects(pyo.Constraint, active=True, descend_into=True):
        if hasattr(c, "_complementarity"):
            continue
        body = pyo.value(c.body)
        assert c.lower is None or body >= pyo.value(c.lower) - 1e-8, c.name
        assert c.upper is None or body <= pyo.value(c.upper) + 1e-8, c.name
