#!/usr/bin/env python3
"""Leave out calls of a run that fails, as long as it fails with the same words.

usage: minimise.py FUZZ SEED [CALLS]
"""

from __future__ import annotations

import re
import subprocess
import sys

SIGNS = (r"DEFECT seed \d+ call \S+ (.*)", r"SUMMARY: AddressSanitizer: (\S+ \S+)")


def sign(program: str, seed: int, calls: int, kept: list[int]) -> str | None:
    """What the run fails with if only these calls are made; None if it does not."""
    skipped, last = [], -1
    for call in [*kept, calls]:
        if call > last + 1:
            skipped += ["--skip", f"{last + 1}-{call - 1}"]
        last = call
    command = [program, "--replay", str(seed), "--calls", str(calls), "--quiet", *skipped]
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=600, check=False)
    if done.returncode == 0:
        return None
    for pattern in SIGNS:
        found = re.search(pattern, done.stderr)
        if found:
            return re.sub(r"\d+", "N", found[1])
    return f"exit code {done.returncode}"


def minimise(program: str, seed: int, calls: int) -> list[int]:
    kept = list(range(calls))
    wanted = sign(program, seed, calls, kept)
    if wanted is None:
        raise SystemExit("the run does not fail")
    print(f"fails with: {wanted}", file=sys.stderr)
    piece = max(len(kept) // 2, 1)
    while kept:
        at = 0
        while at < len(kept):
            fewer = kept[:at] + kept[at + piece :]
            if sign(program, seed, calls, fewer) == wanted:
                kept = fewer
                print(f"{len(kept)} calls", file=sys.stderr)
            else:
                at += piece
        if piece == 1:
            break
        piece //= 2
    return kept


def main(arguments: list[str]) -> int:
    program, seed = arguments[0], int(arguments[1])
    calls = int(arguments[2]) if len(arguments) > 2 else 1500
    kept = minimise(program, seed, calls)
    print("calls that are needed: " + (", ".join(map(str, kept)) or "none: the world alone"))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
