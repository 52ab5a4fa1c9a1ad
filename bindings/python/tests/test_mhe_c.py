"""Estimators as C files: the states of the library, strict C, nothing called but mathematics."""

import shutil
import subprocess

import pytest

import switchback_control as swb

needs_tools = pytest.mark.skipif(not all(map(shutil.which, ("make", "cc", "nm"))), reason="no compiler")


def estimator(states, controls, rates, measured, x0, n, *, params=None, bounds=None, **options):
    m = swb.Model(states=states, controls=controls, parameters=0 if params is None else len(params), name="m")
    m.derivatives = rates(m)
    ocp = swb.Ocp(m, 0.1 * n, n, params=params)
    ocp.set_initial_state(x0)
    if bounds is not None:
        ocp.set_state_bounds(*bounds)
    return swb.Mhe(ocp, m.function(measured(m)), rk_family="explicit", n_s=4, **options)


def linear(**options):
    return estimator(
        "q v", 1, lambda m: [m.x[1], m.u[0] - m.x[0] - 0.2 * m.x[1]], lambda m: [m.x[0]], [0.5, 0.0], 8,
        initial=[0.5, 0.5], process=[0.0, 0.05], measurement=0.05, **options,
    )


def pendulum(bounds=([-4, -0.35, -1], [4, 0.35, 1]), **options):
    """Angle, speed, and a constant friction; a bound of the speed that is active; two measurements, one of them of the control before."""
    return estimator(
        "angle speed friction", 1, lambda m: [m.x[1], m.u[0] - m.p[0] * swb.sin(m.x[0]) - m.x[2] * m.x[1], 0.0],
        lambda m: [swb.sin(m.x[0]), m.x[1] + 0.1 * m.u[0]], [0.3, 0.0, 0.1], 12, params=[2.0],
        bounds=bounds, initial=[0.3, 0.3, 0.1], process=[0.01, 0.1, 0.002], measurement=[0.02, 0.1], **options,
    )


def held(**options):
    """The same with a friction whose bounds are narrow: it is at one of them most of the time."""
    return pendulum(([-4, -5, 0.098], [4, 5, 0.102]), **options)


def constant(**options):
    """States without noise at all, and a measurement that depends on time."""
    return estimator(
        "a b", 0, lambda m: [-0.3 * m.x[0] + swb.sin(m.t) * m.x[1], 0.0], lambda m: [m.x[0] * m.x[0] + 0.1 * m.t], [1.0, 0.4], 10,
        initial=[0.3, 0.3], process=0.0, measurement=0.05, **options,
    )


ALL = {"linear": linear, "pendulum": pendulum, "held": held, "constant": constant}


def build(e, folder, name, precision="double", flags=()):
    written = e.write_c(folder, name, precision)
    assert all(p.is_file() for p in written) and len(written) == 5
    done = subprocess.run(["make", "-s", "test", *flags], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    called = subprocess.run(["nm", "-u", f"{name}.o"], cwd=folder, check=True, capture_output=True, text=True).stdout.split()
    assert set(called) <= {"U", "sin", "cos", "sincos", "sqrt", "sinf", "cosf", "sincosf", "sqrtf", "memcpy", "memset", "memmove"}, called
    return done.stdout


@needs_tools
@pytest.mark.parametrize("iterations", [1, 3])
@pytest.mark.parametrize("name", ALL)
def test_states_are_those_of_the_library(name, iterations, tmp_path):
    with ALL[name](iterations=iterations) as e:
        assert build(e, tmp_path, name).startswith("60 samples")


@needs_tools
def test_single_precision(tmp_path):
    with linear() as e:
        build(e, tmp_path, "linear", "float")


def test_what_an_estimator_in_c_is_not(tmp_path):
    with linear(deadline=0.1) as e, pytest.raises(swb.UnsupportedError, match="clock"):
        e.write_c(tmp_path)
    with linear() as e, pytest.raises(swb.RangeError, match="prefix|names"):
        e.write_c(tmp_path, "no name")
    m = swb.Model(1)
    m.derivatives = [-swb.sign(m.x[0])]
    ocp = swb.Ocp(m, 1.0, 10)
    ocp.set_initial_state([1.0])
    with swb.Mhe(ocp, m.function([m.x[0]]), initial=0.1, process=0.1, measurement=0.1) as e, pytest.raises(swb.UnsupportedError, match="switch"):
        e.write_c(tmp_path)
