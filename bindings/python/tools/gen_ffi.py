"""Write src/switchback/_ffi.py from include/switchback.h.

usage: gen_ffi.py [--check] [HEADER [OUTPUT]]

With --check nothing is written; the exit code is 1 if the file is not what would be written.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
HEADER = HERE.parents[2] / "include" / "switchback.h"
OUTPUT = HERE.parent / "src" / "switchback" / "_ffi.py"

SCALARS = {
    "void": "None",
    "double": "c_double",
    "int8_t": "c_int8",
    "int32_t": "c_int32",
    "int64_t": "c_int64",
    "uint64_t": "c_uint64",
    "swb_status": "c_int32",
}


def strip(text: str) -> str:
    """Without comments; of conditional lines only those of C without fixed enumeration types."""
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.S)
    lines, skip = [], []
    for line in re.sub(r"//.*", "", text).splitlines():
        word = line.split()[:1]
        if word in (["#if"], ["#ifdef"]):
            skip.append(True)
        elif word == ["#ifndef"]:
            skip.append(False)
        elif word == ["#else"]:
            skip[-1] = not skip[-1]
        elif word == ["#endif"]:
            skip.pop()
        elif not any(skip):
            lines.append(line)
    return "\n".join(lines)


class Header:
    """What the header declares, as Python text."""

    def __init__(self, text: str):
        text = strip(text)
        self.version = tuple(
            int(re.search(rf"#define SWB_VERSION_{part}\s+(\d+)", text)[1]) for part in ("MAJOR", "MINOR", "PATCH")
        )
        self.enums = {
            name: [(k, int(v)) for k, v in re.findall(r"(\w+)\s*=\s*(-?\d+)", body)]
            for name, body in re.findall(r"\benum\s+(\w+)\s*\{(.*?)\}\s*;", text, flags=re.S)
        }
        self.structs = re.findall(r"typedef struct (\w+)\s*\{(.*?)\}\s*\1\s*;", text, flags=re.S)
        self.struct_names = {name for name, _ in self.structs}
        self.callbacks = re.findall(r"typedef\s+(\w+)\s*\(\s*\*\s*(\w+)\s*\)\s*\((.*?)\)\s*;", text, flags=re.S)
        self.callback_names = {name for _, name, _ in self.callbacks}
        self.functions = re.findall(r"SWB_API\s+([\w\s]+?[\s*]+)(swb_\w+)\s*\((.*?)\)\s*;", text, flags=re.S)

    def type_of(self, declaration: str, callback: bool = False) -> str:
        """ctypes type of a declaration with or without name. Pointers to numbers and objects are c_void_p:
        that takes addresses, references and arrays, and is quick."""
        words = declaration.replace("*", " * ").replace("const", " ").replace("struct", " ").split()
        stars = words.count("*")
        base = next(w for w in words if w not in ("*", "enum"))
        if stars == 0:
            return base if base in self.callback_names else SCALARS[base]
        if base == "char" and "const" in declaration and stars == 1:
            return "c_char_p"
        if base in self.struct_names and not callback:
            return f"POINTER({base})"
        return "c_void_p"

    def types(self, arguments: str, callback: bool = False) -> list[str]:
        parts = [a.strip() for a in arguments.replace("\n", " ").split(",")]
        return [] if parts == ["void"] else [self.type_of(a, callback) for a in parts]

    def fields(self, body: str) -> list[tuple[str, str]]:
        found = [d.strip() for d in body.split(";") if d.strip()]
        return [(re.search(r"(\w+)$", d)[1], self.type_of(d)) for d in found]


def python_name(name: str) -> str:
    """swb_switch_kind -> SwitchKind"""
    return "".join(part.capitalize() for part in name.removeprefix("swb_").split("_"))


def generate(text: str) -> str:
    h = Header(text)
    out = [
        '"""The C interface, generated from include/switchback.h by tools/gen_ffi.py; do not edit."""',
        "",
        "# fmt: off",
        "from ctypes import CFUNCTYPE, POINTER, Structure, c_char_p, c_double, c_int32, c_int64, c_uint64, c_void_p",
        "from enum import IntEnum",
        "",
        f"VERSION = {h.version!r}",
        "",
        "",
        "class Names(IntEnum):",
        '    """Numbers that print as their names."""',
        "",
        "    def __str__(self):",
        "        return self.name.lower()",
        "",
        "    def __format__(self, spec):",
        "        return format(str(self), spec)",
        "",
    ]
    for name, values in h.enums.items():
        prefix = "SWB_ERR_" if name == "swb_status" else f"{name.upper()}_"
        out += ["", f"class {python_name(name)}(Names):", f'    """enum {name}"""', ""]
        out += [f"    {k.removeprefix(prefix).removeprefix('SWB_')} = {v}" for k, v in values]
        out += [""]
    out += [""]
    for result, name, arguments in h.callbacks:
        out += [f"{name} = CFUNCTYPE({', '.join([SCALARS[result]] + h.types(arguments, callback=True))})"]
    out += [""]
    for name, body in h.structs:
        out += ["", f"class {name}(Structure):", "    _fields_ = ["]
        out += [f'        ("{field}", {kind}),' for field, kind in h.fields(body)]
        out += ["    ]", ""]
    out += ["", "# name: (result, arguments)", "FUNCTIONS = {"]
    for result, name, arguments in h.functions:
        kinds = ", ".join(h.types(arguments))
        out += [f'    "{name}": ({h.type_of(result)}, [{kinds}]),']
    out += ["}", "", "", "def declare(library):", '    """Give the functions of the loaded library their types."""']
    out += ["    for name, (result, arguments) in FUNCTIONS.items():", "        function = getattr(library, name)"]
    out += ["        function.restype = result", "        function.argtypes = arguments", "    return library", ""]
    return "\n".join(out)


def main(arguments: list[str]) -> int:
    check = "--check" in arguments
    paths = [Path(a) for a in arguments if a != "--check"]
    header = paths[0] if paths else HEADER
    output = paths[1] if len(paths) > 1 else OUTPUT
    text = generate(header.read_text(encoding="utf-8"))
    if check:
        same = output.exists() and output.read_text(encoding="utf-8") == text
        if not same:
            print(f"{output} does not match {header}: run {Path(__file__).name}", file=sys.stderr)
        return 0 if same else 1
    output.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
