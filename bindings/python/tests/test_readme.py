"""The code of the package's README and of the tutorials runs, block after block, as a reader would type it."""

import re
from pathlib import Path

import numpy as np
import pytest

README = Path(__file__).resolve().parents[1] / "README.md"
BLOCKS = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.S)


def test_blocks_run(tmp_path, monkeypatch, capsys):
    pytest.importorskip("casadi")
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "readme"}
    assert len(BLOCKS) >= 8
    for block in BLOCKS:
        exec(compile(block.replace("executor=2, ", ""), str(README), "exec"), names)  # processes are in test_sweep
    out = capsys.readouterr().out
    assert "[-1.59746038 -0.76149362]" in out and "1.52377277" in out
    assert {"oscillator.svg", "phase.svg", "run.npz", "sweep.sqlite"} <= {p.name for p in tmp_path.iterdir()}
    assert len(names["found"]) == 200 and np.isfinite(names["found"]["q_end"]).all()


DOCS = Path(__file__).resolve().parents[3] / "docs"


def test_the_first_program_runs(tmp_path, monkeypatch, capsys):
    pytest.importorskip("matplotlib")
    page = DOCS.parent / "README.md"
    if not page.is_file():
        pytest.skip("no pages here")
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "readme"}
    (block,) = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.S)
    exec(compile(block, str(page), "exec"), names)
    # what its comments say
    out = capsys.readouterr().out
    assert "7.1805" in out and "8.4283" in out and "cost 5.47972" in out and "2 switches" in out
    assert {"belt.svg", "best.svg"} <= {p.name for p in tmp_path.iterdir()}


@pytest.mark.parametrize("page", ["tutorial", "models", "mpcc"])
def test_tutorials_run(page, tmp_path, monkeypatch, capsys):
    pytest.importorskip("matplotlib")
    file = DOCS / f"{page}.md"
    if not file.is_file():
        pytest.skip("no pages here")
    monkeypatch.chdir(tmp_path)
    names = {"__name__": page}
    blocks = re.findall(r"```python\n(.*?)```", file.read_text(encoding="utf-8"), re.S)
    assert blocks
    for block in blocks:
        exec(compile(block, str(file), "exec"), names)
    if page == "tutorial":
        assert {"belt.svg", "best.svg", "belt.sqlite"} <= {p.name for p in tmp_path.iterdir()}
        assert "sliding (1 - v > 0, 1 - v < 0) -> 1 - v > 0" in capsys.readouterr().out
