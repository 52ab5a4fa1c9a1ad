"""The solver as Pyomo calls it: the program that was built, named by SWITCHBACK_MPCC_AMPL or on the PATH."""

import os
import shutil

import pytest
from pyomo.environ import SolverFactory


@pytest.fixture(scope="session")
def program():
    """Path of the solver."""
    found = os.environ.get("SWITCHBACK_MPCC_AMPL") or shutil.which("switchback-mpcc-ampl")
    assert found and os.access(found, os.X_OK), "build switchback-mpcc-ampl and name it in SWITCHBACK_MPCC_AMPL"
    return found


@pytest.fixture
def solve(program):
    """Solves a model; options by name."""

    def run(model, load=True, **options):
        solver = SolverFactory("asl", solver=program)
        return solver.solve(model, options=options, load_solutions=load)

    return run
