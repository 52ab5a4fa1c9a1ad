"""Cells of the matrix of ingredients by tasks, drawn anew every day: none is wrong, and none that the page calls done is not."""

import datetime
import os
import sys
from pathlib import Path

import numpy as np
import pytest
import switchback_control as swb

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "bindings" / "python" / "benchmarks"))

import matrix  # noqa: E402

#: Set it to draw the cells of a failure again.
SEED = int(os.environ.get("SWITCHBACK_MATRIX_SEED", datetime.date.today().toordinal()))
CELLS = 300


def on_the_page():
    """What the page says of every cell."""
    lines = (ROOT / "docs" / "benchmarks" / "matrix.md").read_text(encoding="utf-8").splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith("| ingredients |"))
    tasks = [cell.strip() for cell in lines[start].split("|")[2:-1]]
    said = {}
    for line in lines[start + 2 :]:
        if not line.startswith("|"):
            break
        name, *signs = [cell.strip() for cell in line.split("|")[1:-1]]
        said.update({(tuple(name.split(" + ")), task): sign for task, sign in zip(tasks, signs, strict=True)})
    return said


def test_the_page_has_all_cells():
    assert set(on_the_page()) == {(parts, task) for parts in matrix.rows() for task in matrix.TASKS}
    assert set(on_the_page().values()) <= set(matrix.SIGNS.values())


def test_cells_drawn_today():
    said = on_the_page()
    found = matrix.cells(matrix.sample(CELLS, SEED))
    bad = []
    for (parts, task), (kind, text) in found.items():
        sign = said[parts, task]
        if kind == matrix.WRONG:
            bad.append(f"{' + '.join(parts)}: {task} is wrong: {text}")
        elif sign == matrix.SIGNS[matrix.WORKS] and kind != matrix.WORKS:
            bad.append(f"{' + '.join(parts)}: {task} is said to work, but {kind}: {text}")
    assert len(found) == CELLS
    assert not bad, f"SWITCHBACK_MATRIX_SEED={SEED}:\n" + "\n".join(bad)


def test_samples_are_those_of_their_seed():
    assert matrix.sample(20, 1) == matrix.sample(20, 1) != matrix.sample(20, 2)


@pytest.mark.parametrize(
    "task, part, change",
    [
        ("simulate", "end", lambda x: x + 1e-3),
        ("forward", "end", lambda x: 1.01 * x),
        ("batch", "end", lambda x: np.nextafter(x, 9.0)),
        ("solve", "cost", lambda c: 1.01 * c),
        ("verdict", "cost", None),
        ("sens", "_slope", lambda s: 1.1 * s + 0.2),
    ],
)
def test_checks_see_what_is_wrong(task, part, change, monkeypatch):
    bench = matrix.Bench(("switch",))
    assert matrix.judge(bench, task) == (matrix.WORKS, "")
    own, calls = getattr(bench, part), []

    def other(*given, **named):
        calls.append(1)
        found = own(*given, **named)
        return found / len(calls) if change is None else change(found)

    monkeypatch.setattr(bench, part, other)
    kind, text = matrix.judge(bench, task)
    assert kind == matrix.WRONG and text.startswith("AssertionError: ") and calls


def test_errors_are_told_apart(monkeypatch):
    bench = matrix.Bench(("flow",))
    for error, kind in (
        (swb.UnsupportedError("not that"), matrix.REFUSED),
        (swb.InternalError("a defect"), matrix.WRONG),
        (KeyError("a defect"), matrix.WRONG),
        (matrix.Refusal("not that"), matrix.REFUSED),
    ):

        def fails(_, error=error):
            raise error

        monkeypatch.setitem(matrix.TASKS, "solve", (fails, ""))
        assert matrix.judge(bench, "solve")[0] == kind
