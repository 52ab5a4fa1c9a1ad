"""usage: left_out.py LOG ALLOWED    which tests a run of `make check` left out, and whether it may

Finds skipped tests of pytest (-rs), ignored ones of cargo, skipped or missing ones of ctest, and the lines
`left out: what: why` with which every part of this project says that it does less than it could. Prints them; exits with 1
where one of them matches no regular expression of ALLOWED."""

import re
import sys
from pathlib import Path

PATTERNS = (
    re.compile(r"^SKIPPED \[\d+\] (.*)"),
    re.compile(r"^test (.*) \.\.\. ignored"),
    re.compile(r"^\s*\d+/\d+ Test\s+#\d+: (\S+) \.+\**(?:Skipped|Not Run|Disabled).*"),
    re.compile(r"^(?:.*\s)?left out: (.*)"),
)


def left_out(log: str) -> list[str]:
    """What the lines of a log say was left out, each once, in order."""
    found = (p.match(line) for line in log.splitlines() for p in PATTERNS)
    return list(dict.fromkeys(m[1].strip() for m in found if m))


def allowed(text: str) -> list[re.Pattern]:
    lines = (line.split(" # ")[0].strip() for line in text.splitlines() if not line.startswith("#"))
    return [re.compile(line) for line in lines if line]


def main() -> int:
    log, may = (Path(name).read_text(encoding="utf-8", errors="replace") for name in sys.argv[1:3])
    patterns = allowed(may)
    bad = 0
    for what in left_out(log):
        fine = any(p.search(what) for p in patterns)
        bad += not fine
        print(f"{'left out, as listed' if fine else 'LEFT OUT'}: {what}")
    if bad:
        print(f"{bad} tests or checks were left out that {sys.argv[2]} does not list")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
