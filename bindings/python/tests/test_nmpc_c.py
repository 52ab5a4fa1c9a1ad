"""Controllers of the size of applications as C files: a quadrotor in space and a diesel generator."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import switchback_control as swb

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "examples/python"))
import diesel  # noqa: E402

needs_tools = pytest.mark.skipif(not all(map(shutil.which, ("make", "cc", "nm", "size"))), reason="no compiler")
MATHEMATICS = {"sin", "cos", "tan", "sincos", "sqrt", "exp", "pow", "log", "fabs", "memcpy", "memset", "memmove"}


def quadrotor(n=20):
    """Position, velocity, angles, rates; thrust and three torques. It flies past a column."""
    m = swb.Model(states="x y z u v w roll pitch yaw p q r", controls="thrust l m n", name="quadrotor")
    phi, theta, psi = (m[k] for k in ("roll", "pitch", "yaw"))
    p, q, r = (m[k] for k in "pqr")
    s, c = swb.sin, swb.cos
    f = 9.81 + m["thrust"]
    m.derivatives = [
        m["u"], m["v"], m["w"],
        f * (c(phi) * s(theta) * c(psi) + s(phi) * s(psi)), f * (c(phi) * s(theta) * s(psi) - s(phi) * c(psi)), f * c(phi) * c(theta) - 9.81,
        p + (q * s(phi) + r * c(phi)) * s(theta) / c(theta), q * c(phi) - r * s(phi), (q * s(phi) + r * c(phi)) / c(theta),
        m["l"] - 0.3 * q * r, m["m"] + 0.3 * p * r, m["n"],
    ]
    ocp = swb.Ocp(m, 0.1 * n, n, rk_family="explicit", n_s=4, n_fe=1, control_bounds=([-5, -8, -8, -2], [5, 8, 8, 2]))
    goal = np.zeros(12)
    ocp.add_least_squares(m.function([*m.x, *m.u]), [4, 4, 4, 1, 1, 1, 0.5, 0.5, 2, 0.1, 0.1, 0.1, 0.05, 0.02, 0.02, 0.02], np.zeros(16))
    ocp.add_least_squares(m.function(list(m.x)), [40, 40, 40, 8, 8, 8, 4, 4, 8, 1, 1, 1], goal, at="terminal")
    ocp.set_state_bounds([-np.inf] * 6 + [-0.7, -0.7] + [-np.inf] * 4, [np.inf] * 6 + [0.7, 0.7] + [np.inf] * 4)
    ocp.add_relaxed(m.function([(m["x"] + 1) ** 2 + (m["y"] - 0.1) ** 2]), [0.16], [np.inf], at="control_grid", norm="l1", weight=500.0)
    c_ = swb.Nmpc(ocp, "rti", shift=True, qp_solver="stagewise")
    c_.initialise([-2.0, 0.3, 0.5, *[0.0] * 9])
    return c_


def generator(n=40):
    """The generator with its algebraic states eliminated, by explicit steps that its fastest time constant of 9 ms allows."""
    for name, load in diesel.LOADS.items():
        diesel.STEADY_INPUTS[name] = tuple(diesel.steady(load)[1])
    x, u = diesel.steady(diesel.LOADS["start"])
    ocp = diesel.problem(n)
    ocp.set_state_guess([0.0], [x])
    ocp.set_control_guess(np.tile(u, (n, 1)))
    ocp.set_params([*diesel.LOADS["start"], *u])
    c = swb.Nmpc(ocp, "rti", shift=True, qp_solver="stagewise", rk_family="explicit", n_s=4, steps=20)
    c.initialise(x)
    return c


@needs_tools
@pytest.mark.parametrize("make, text, ram", [(quadrotor, 50e3, 260e3), (generator, 60e3, 680e3)])
def test_controllers_of_applications(make, text, ram, tmp_path):
    with make() as c:
        c.write_c(tmp_path, "unit")
    done = subprocess.run(["make", "-s", "test"], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.startswith("60 samples")
    called = subprocess.run(["nm", "-u", "unit.o"], cwd=tmp_path, check=True, capture_output=True, text=True).stdout.split()
    assert set(called) - {"U"} <= MATHEMATICS, called
    sizes = subprocess.run(["size", "unit.o"], cwd=tmp_path, check=True, capture_output=True, text=True).stdout.split("\n")[1].split()
    print(make.__name__, done.stdout.strip(), "text", sizes[0], "bss", sizes[2])
    assert int(sizes[0]) < text and int(sizes[2]) < ram
