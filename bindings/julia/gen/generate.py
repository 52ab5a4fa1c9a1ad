"""Write src/Lib.jl, the C interface as Julia functions, from include/api.json.

usage: generate.py [--check] [INTERFACE [OUTPUT]]

With --check nothing is written; the exit code is 1 if the file is not what would be written.
"""

from __future__ import annotations

import sys
import textwrap
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[2]
sys.path.insert(0, str(ROOT / "tools" / "api"))

from api import Api, Function, Type, load  # noqa: E402
import output  # noqa: E402

INTERFACE = ROOT / "include" / "api.json"
OUTPUT = HERE.parent / "src" / "Lib.jl"

# C name: (Julia name, bytes)
SCALARS = {
    "double": ("Cdouble", 8),
    "char": ("UInt8", 1),
    "int8_t": ("Int8", 1),
    "int32_t": ("Int32", 4),
    "int64_t": ("Int64", 8),
    "uint64_t": ("UInt64", 8),
    "void": ("Cvoid", 0),
}
POINTER = 8
# words that Julia keeps for itself
KEYWORDS = {"begin", "end", "function", "module", "struct", "type", "where", "let", "local", "global"}

PREAMBLE = '''\
# The C interface, generated from include/api.json by gen/generate.py; do not edit.
"""
The functions of the library as they are in C: `Switchback.Lib.swb_version()`.

Indices count from 0, matrices are stored by columns, sizes follow their arrays. A function whose result is a
`swb_status` returns 0 or a negative code; `swb_last_error` has the message. Arrays, `Ref`s, strings, `C_NULL` and the
objects of `Switchback` can be given as arguments. Nothing is checked here: a wrong length is a crash.
"""
module Lib

# Addresses of the functions in the loaded library, in the order of NAMES. They are looked up when the package is
# loaded, not when it is precompiled.
const ADDRESSES = Ptr{Cvoid}[]
address(i) = @inbounds ADDRESSES[i]
'''


def julia_type(api: Api, kind: Type) -> str:
    """The type of an argument, a field or a result in `ccall`."""
    if kind.base in api.callbacks or kind.base == "swb_code":
        return "Ptr{" * kind.stars + "Ptr{Cvoid}" + "}" * kind.stars
    if kind.base == "char" and kind.stars > 0 and kind.const:
        return "Ptr{" * (kind.stars - 1) + "Cstring" + "}" * (kind.stars - 1)
    base = SCALARS[kind.base][0] if kind.base in SCALARS else kind.base
    return "Ptr{" * kind.stars + base + "}" * kind.stars


def size(api: Api, kind: Type) -> int:
    """Bytes of a field."""
    if kind.stars or kind.base in api.callbacks:
        return POINTER
    return 4 if kind.base == "swb_status" else SCALARS[kind.base][1]


def record_size(api: Api, name: str) -> int:
    """sizeof a struct in C: fields at multiples of their size, the whole a multiple of the largest."""
    end, largest = 0, 1
    for field in api.records[name].fields:
        n = size(api, field.type)
        end = -(-end // n) * n + n
        largest = max(largest, n)
    return -(-end // largest) * largest


def docstring(text: str, signature: str = "") -> list[str]:
    """A text as a docstring of Julia."""
    body = (f"    {signature}\n\n" if signature else "") + text
    body = body.replace("\\", "\\\\").replace("$", "\\$").replace('"', '\\"')
    return ['"""', *body.splitlines(), '"""']


def safe(name: str) -> str:
    return name + "_" if name in KEYWORDS else name


def enum_lines(api: Api) -> list[str]:
    out = ["", "# --- enumerations: plain integers, so that numbers of a newer library are no error ---", ""]
    width = {name: "Int64" for name in api.enums}
    width.update({"swb_status": "Int32"})
    for name, enum in api.enums.items():
        out += [*docstring(enum.doc + "\n\n" + "\n".join(f"- `{v}`: {' '.join(d.split())}" for v, _, d in enum.values))]
        out += [f"const {name} = {width[name]}"]
        out += [f"const {v} = {name}({number})" for v, number, _ in enum.values]
        prefix = "SWB_ERR_" if name == "swb_status" else f"{name.upper()}_"
        pairs = ", ".join(f":{v.removeprefix(prefix).removeprefix('SWB_').lower()} => {n}" for v, n, _ in enum.values)
        out += [f"const NAMES_{name} = [{pairs}]", ""]
    return out


def record_lines(api: Api) -> list[str]:
    out = ["# --- structs ---", ""]
    for name, doc in api.objects.items():
        out += [*docstring(doc), f"mutable struct {name} end", ""]
    for name, record in api.records.items():
        fields = "\n".join(f"- `{f.name}`: {' '.join(f.doc.split())}" for f in record.fields)
        out += [*docstring(record.doc + "\n\n" + fields), f"struct {name}"]
        out += [f"    {safe(f.name)}::{julia_type(api, f.type)}" for f in record.fields]
        out += ["end", f'sizeof({name}) == {record_size(api, name)} || error("{name} has another size than in C")', ""]
    return out


def function_lines(api: Api, function: Function, number: int) -> list[str]:
    names = [safe(p.name) for p in function.parameters]
    result = julia_type(api, function.result)
    kinds = [julia_type(api, p.type) for p in function.parameters]
    signature = f"{function.name}({', '.join(names)})"
    types = "(" + ", ".join(kinds) + ("," if len(kinds) == 1 else "") + ")"
    arguments = "".join(", " + n for n in names)
    call = f"ccall(address({number}), {result}, {types}{arguments})"
    out = docstring(function.doc, f"{signature} -> {result}")
    if len(signature) + len(call) + 3 <= 120:
        return [*out, f"{signature} = {call}", ""]
    wrapped = textwrap.wrap(call, 116, initial_indent="    ", subsequent_indent="        ", break_long_words=False)
    head = textwrap.wrap(f"{signature} =", 120, subsequent_indent="    ", break_long_words=False)
    return [*out, *head, *wrapped, ""]


def generate(text: str) -> str:
    api = load(text)
    out = [PREAMBLE, f"const HEADER_VERSION = v\"{'.'.join(map(str, api.version))}\"", *enum_lines(api)]
    out += record_lines(api)
    out += ["# --- functions ---", "", "const NAMES = ["]
    out += [f"    :{name}," for name in api.functions]
    out += ["]", ""]
    for number, function in enumerate(api.functions.values(), 1):
        out += function_lines(api, function, number)
    out += ["end # module", ""]
    return "\n".join(out)


def main(arguments: list[str]) -> int:
    return output.main(generate, INTERFACE, OUTPUT, arguments)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
