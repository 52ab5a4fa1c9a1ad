"""The code in Python on the page about modelling languages."""

import os
import re
from pathlib import Path


def test_the_page_runs(program, monkeypatch, capsys):
    page = Path(__file__).resolve().parents[3] / "docs" / "ampl.md"
    monkeypatch.setenv("PATH", f"{Path(program).parent}:{os.environ['PATH']}")
    blocks = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.S)
    assert blocks
    for block in blocks:
        exec(compile(block, str(page), "exec"), {"__name__": "page"})
    assert "B-stationary" in capsys.readouterr().out
