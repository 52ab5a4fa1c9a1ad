"""Controllers of the size of applications as C files: a quadrotor in space and a diesel generator."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))
from nmpc_c import generator, quadrotor  # noqa: E402

needs_tools = pytest.mark.skipif(not all(map(shutil.which, ("make", "cc", "nm", "size"))), reason="no compiler")
MATHEMATICS = {"sin", "cos", "tan", "sincos", "sqrt", "exp", "pow", "log", "fabs", "memcpy", "memset", "memmove"}


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
