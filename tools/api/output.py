"""The command line of what is made from the interface: [--check] [INTERFACE [OUTPUT]]."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path


def main(generate: Callable[[str], str], interface: Path, output: Path, arguments: list[str]) -> int:
    """Writes what `generate` makes of the interface; with --check compares it with what is there. The exit code."""
    check = "--check" in arguments
    paths = [Path(a) for a in arguments if a != "--check"]
    interface = paths[0] if paths else interface
    output = paths[1] if len(paths) > 1 else output
    text = generate(interface.read_text(encoding="utf-8"))
    if check:
        same = output.exists() and output.read_text(encoding="utf-8") == text
        if not same:
            print(f"{output} does not match {interface}: run {Path(sys.argv[0]).name}", file=sys.stderr)
        return 0 if same else 1
    output.write_text(text, encoding="utf-8")
    return 0
