"""Figures that docs/benchmarks/figures.tsv lists are on their pages, and are those of the data."""

import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]


def _script():
    spec = importlib.util.spec_from_file_location("figures", ROOT / "scripts/figures.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_listed_figure_is_on_its_page_and_in_the_data():
    figures = _script()
    entries = figures.listed()
    assert len(entries) >= 160
    for page, text, key, kind in entries:
        shown = figures.on_page(page, text)
        # page and data were written by one run: times agree to the digits, too
        assert figures.agrees(shown, figures.in_data(key, [ROOT / "docs/benchmarks/data"]), "value"), (page, text, key)
        assert kind in ("value", "time")


@pytest.mark.parametrize(
    "shown, value, kind, expected",
    [
        ("46.9", 46.94, "value", True),
        ("46.9", 46.99, "value", False),
        ("1e-3", 0.00123, "value", True),
        ("1e-3", 0.002, "value", False),
        ("0.1", 0.62, "time", False),
        ("0.5", 0.62, "time", True),
        ("0.93", 0.62, "time", True),
        ("0.94", 0.62, "time", False),
    ],
)
def test_figures_agree_within_their_digits_and_times_within_the_factor(shown, value, kind, expected):
    assert _script().agrees(shown, value, kind) is expected


def test_a_figure_that_is_not_on_the_page_is_an_error():
    with pytest.raises(LookupError, match="0 places"):
        _script().on_page("README.md", "no such text {} ")
