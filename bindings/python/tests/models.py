"""Models of the tests, and the examples as modules."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

import switchback_control as swb

EXAMPLES = Path(__file__).resolve().parents[3] / "examples" / "python"

OMEGA = 2 * np.pi
OSCILLATOR_X0 = [np.exp(-1.0), 0.0]
OSCILLATOR_T = np.pi / 2
OSCILLATOR_XT = [-1.5974603774506984, -0.7614936206060108]
A_IN = np.array([[1.0, OMEGA], [-OMEGA, 1.0]])
A_OUT = np.array([[1.0, -OMEGA], [OMEGA, 1.0]])

TUTORIAL_X0 = (9 - np.sqrt(417)) / 8
TUTORIAL_COST = 1.5237727753749573


def example(name):
    """An example as a module, whose figures are not drawn yet."""
    pytest.importorskip("matplotlib")
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def oscillator(modes=None, psi=None):
    """x' = A1 x inside the unit circle, A2 x outside; the switch is at t = 1."""
    system = swb.System(2)
    system.add_subsystem(
        modes or [lambda x: A_IN @ x, lambda x: A_OUT @ x], psi or (lambda x: x @ x - 1.0), signs=[-1, 1]
    )
    return system


def sides(left, right, f0=None):
    """A state with one slope for x < 0 and one for x > 0."""
    system = swb.System(1, f0=f0)
    system.add_subsystem([[left], [right]], lambda x: x[0], signs=[-1, 1])
    return system


def tutorial(n_stages=1, **options):
    """min of the integral of x^2 plus (x(2) - 5/3)^2, x' in 2 - sign x, over the initial state."""
    options = {"n_fe": 4, **options}
    return swb.Ocp(
        sides(3.0, 1.0),
        2.0,
        n_stages,
        lagrange=lambda x: x[0] ** 2,
        mayer=lambda x: (x[0] - 5 / 3) ** 2,
        initial_bounds=(-5.0, 5.0),
        **options,
    )
