"""Checks that everything has the version of Cargo.toml: crates, Python, Julia, header, CMake, citation, changelog."""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
#: Where a version is written, and how; @ is the version, @MINOR@ the version without its last number.
PLACES = {
    "Cargo.toml": [r'^switchback = { version = "=@"', r'^switchback-mpcc = { version = "=@"'],
    "CITATION.cff": [r"^version: @$"],
    "CHANGELOG.md": [r"^## @, \d{4}-\d\d-\d\d$"],
    "README.md": [r"find_package\(switchback @MINOR@ ", r"^Version @MINOR@,"],
    "bindings/julia/Project.toml": [r'^version = "@"$'],
    "bindings/julia/packaging/build_tarballs.jl": [r'^version = v"@"$'],
    "bindings/julia/src/Lib.jl": [r'HEADER_VERSION = v"@"'],
    "bindings/python/pyproject.toml": [r'^version = "@"$'],
    "bindings/python/src/switchback_control/__init__.py": [r'^__version__ = "@"$'],
    "capi_tests/CMakeLists.txt": [r"find_package\(switchback @MINOR@ "],
    "docs/c.md": [r"find_package\(switchback @MINOR@ "],
    "docs/cpp.md": [r"find_package\(switchback @MINOR@ "],
    "docs/limits.md": [r"The version is @MINOR@:"],
    "examples/c/CMakeLists.txt": [r"find_package\(switchback @MINOR@ "],
    "include/api.json": [r'"version": "@"'],
    "include/switchback.h": [r'^#define SWB_VERSION "@"$'],
}


def main() -> int:
    found = re.search(r'^version = "(\d+\.\d+)(\.\d+)"$', (ROOT / "Cargo.toml").read_text(encoding="utf-8"), re.M)
    if not found:
        print("no version in Cargo.toml")
        return 1
    minor, version = re.escape(found[1]), re.escape(found[1] + found[2])
    wrong = []
    for name, patterns in PLACES.items():
        text = (ROOT / name).read_text(encoding="utf-8")
        for pattern in patterns:
            if not re.search(pattern.replace("@MINOR@", minor).replace("@", version), text, re.M):
                wrong.append(f"{name}: nothing like {pattern}, where @ is {found[1] + found[2]}")
    print("\n".join(wrong) if wrong else f"everything has the version {found[1] + found[2]}")
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
