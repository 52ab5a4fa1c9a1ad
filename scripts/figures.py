"""Compares the figures on the pages with what the benchmarks have printed.

usage: figures.py [--times] [DATA ...]

docs/benchmarks/figures.tsv lists figures: the page, a piece of text of the page that the figure stands in (`{}` in its place, `*` for any word), a key, and what
kind of figure it is. Files with data are JSON; a key is `FILE:PATH`, the path the names and numbers of members, separated by dots, or
`LIST[NAME=VALUE,...].MEMBER` for the entry of a list with these values. Counts and costs have to be equal to the digits that the
page gives; times may differ by the factor 1.5, and are compared with `--times` only, for data that was made on an idle machine. DATA
are folders searched for the files in the order given; docs/benchmarks/data alone without any.
"""

import json
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FACTOR = 1.5
NUMBER = r"(-?\d[\d ]*\.?\d*(?:e-?\d+)?)"


def listed():
    """The figures: page, text with `{}`, key, kind."""
    lines = (ROOT / "docs/benchmarks/figures.tsv").read_text(encoding="utf-8").splitlines()
    return [line.split("\t") for line in lines if line and not line.startswith("#")]


def on_page(page, text):
    """The figure as the page has it, once; spaces of the page are one."""
    content = re.sub(r"\s+", " ", (ROOT / page).read_text(encoding="utf-8"))
    before, after = (re.escape(re.sub(r"\s+", " ", part)).replace(r"\*", r"\S+") for part in text.split("{}"))
    found = re.findall(before + NUMBER + after, content)
    if len(found) != 1:
        raise LookupError(f"{page}: {len(found)} places like '{text}'")
    return found[0].strip()


def in_data(key, folders):
    """The number that a key stands for."""
    name, path = key.split(":", 1)
    files = [Path(folder) / name for folder in folders]
    value = json.loads(next(f for f in files if f.exists()).read_text(encoding="utf-8"))
    for step in re.findall(r"(\w+)(?:\[([^\]]*)\])?", path):
        value = value[int(step[0])] if isinstance(value, list) else value[step[0]]
        if step[1]:
            wanted = dict(pair.split("=", 1) for pair in step[1].split(","))
            value = next(e for e in value if all(str(e[k]) == v for k, v in wanted.items()))
    return float(value)


def agrees(shown, value, kind, factor=FACTOR):
    """Does the figure of a page say what the data says?"""
    number = float(shown.replace(" ", ""))
    if kind == "time":
        return number > 0 and value > 0 and 1 / factor <= number / value <= factor
    mantissa = shown.split("e")[0]
    digits = len(mantissa.split(".")[1]) if "." in mantissa else 0
    unit = 10.0 ** (int(shown.split("e")[1]) if "e" in shown else 0) * 10.0**-digits
    return abs(number - value) <= 0.501 * unit


def main():
    arguments = [a for a in sys.argv[1:] if a != "--times"]
    folders = arguments or [ROOT / "docs/benchmarks/data"]
    wrong = 0
    for page, text, key, kind in listed():
        if kind == "time" and "--times" not in sys.argv:
            continue
        shown, value = on_page(page, text), in_data(key, folders)
        if not agrees(shown, value, kind):
            wrong += 1
            print(f"{page}: '{text.format(shown)}', but {key} is {value:.6g}")
    print(f"{wrong} figures do not agree" if wrong else "all figures agree")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
