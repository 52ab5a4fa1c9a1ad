"""Write src/switchback_control/_ffi.py from include/api.json.

usage: gen_ffi.py [--check] [INTERFACE [OUTPUT]]

With --check nothing is written; the exit code is 1 if the file is not what would be written.
"""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[2]
sys.path.insert(0, str(ROOT / "tools" / "api"))

from api import Api, Parameter, Type, load  # noqa: E402
import output  # noqa: E402

INTERFACE = ROOT / "include" / "api.json"
OUTPUT = HERE.parent / "src" / "switchback_control" / "_ffi.py"

SCALARS = {
    "void": "None",
    "double": "c_double",
    "int8_t": "c_int8",
    "int32_t": "c_int32",
    "int64_t": "c_int64",
    "uint64_t": "c_uint64",
    "swb_status": "c_int32",
}


def kind_of(api: Api, of: Type, callback: bool = False) -> str:
    """ctypes type. Pointers to numbers and objects are c_void_p: that takes addresses, references and arrays, and is
    quick."""
    if of.stars == 0:
        return of.base if of.base in api.callbacks else SCALARS[of.base]
    if of == Type("char", 1, const=True):
        return "c_char_p"
    if of.base in api.records and not callback:
        return f"POINTER({of.base})"
    return "c_void_p"


def kinds(api: Api, parameters: list[Parameter], callback: bool = False) -> list[str]:
    return [kind_of(api, p.type, callback) for p in parameters]


def python_name(name: str) -> str:
    """swb_switch_kind -> SwitchKind"""
    return "".join(part.capitalize() for part in name.removeprefix("swb_").split("_"))


def generate(text: str) -> str:
    api = load(text)
    out = [
        '"""The C interface, generated from include/api.json by tools/gen_ffi.py; do not edit."""',
        "",
        "# fmt: off",
        "from ctypes import CFUNCTYPE, POINTER, Structure, c_char_p, c_double, c_int32, c_int64, c_uint64, c_void_p",
        "from enum import IntEnum",
        "",
        f"VERSION = {api.version!r}",
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
    for name, enum in api.enums.items():
        prefix = "SWB_ERR_" if name == "swb_status" else f"{name.upper()}_"
        out += ["", f"class {python_name(name)}(Names):", f'    """enum {name}"""', ""]
        out += [f"    {k.removeprefix(prefix).removeprefix('SWB_')} = {v}" for k, v, _ in enum.values]
        out += [""]
    out += [""]
    for name, callback in api.callbacks.items():
        arguments = [SCALARS[callback.result.base]] + kinds(api, callback.parameters, callback=True)
        out += [f"{name} = CFUNCTYPE({', '.join(arguments)})"]
    out += [""]
    for name, record in api.records.items():
        out += ["", f"class {name}(Structure):", "    _fields_ = ["]
        out += [f'        ("{f.name}", {kind_of(api, f.type)}),' for f in record.fields]
        out += ["    ]", ""]
    out += ["", "# name: (result, arguments)", "FUNCTIONS = {"]
    for name, function in api.functions.items():
        arguments = ", ".join(kinds(api, function.parameters))
        out += [f'    "{name}": ({kind_of(api, function.result)}, [{arguments}]),']
    out += ["}", "", "", "def declare(library):", '    """Give the functions of the loaded library their types."""']
    out += ["    for name, (result, arguments) in FUNCTIONS.items():", "        function = getattr(library, name)"]
    out += ["        function.restype = result", "        function.argtypes = arguments", "    return library", ""]
    return "\n".join(out)


def main(arguments: list[str]) -> int:
    return output.main(generate, INTERFACE, OUTPUT, arguments)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
