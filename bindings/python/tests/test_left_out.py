"""What a run of `make check` left out is found in its output, and compared with what may be."""

import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).resolve().parents[3] / "scripts" / "left_out.py"

LOG = """
test a::b ... ignored
test c::d ... ok
SKIPPED [1] tests/test_x.py:12: no scipy
 3/55 Test  #3: memcheck_test_a ...........***Skipped   0.00 sec
 4/55 Test  #4: test_b .......   Passed    0.00 sec
-- left out: comparison with IDAS: SUNDIALS not found
-- left out: comparison with IDAS: SUNDIALS not found
"""


def run(tmp_path, allowed):
    (tmp_path / "log").write_text(LOG)
    (tmp_path / "allowed").write_text(allowed)
    return subprocess.run(
        [sys.executable, SCRIPT, tmp_path / "log", tmp_path / "allowed"], capture_output=True, text=True
    )


def test_everything_that_is_left_out_is_found_and_fails(tmp_path):
    found = run(tmp_path, "# nothing\n")
    assert found.returncode == 1 and "4 tests or checks" in found.stdout
    for what in ("a::b", "no scipy", "memcheck_test_a", "comparison with IDAS"):
        assert found.stdout.count(what) == 1
    assert "c::d" not in found.stdout and "test_b" not in found.stdout


def test_what_is_listed_passes(tmp_path):
    allowed = "^a::b$ # slow\nscipy # optional\nmemcheck_\nIDAS # no package\n"
    assert run(tmp_path, allowed).returncode == 0
    assert run(tmp_path, allowed.replace("IDAS", "IDAS2")).returncode == 1
