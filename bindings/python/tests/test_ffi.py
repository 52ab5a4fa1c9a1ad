"""The generated declarations: do they match the description of the interface, that the header, and the layout that a C compiler gives it?"""

import ctypes
import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import switchback_control as swb
from switchback_control import _ffi

ROOT = Path(__file__).resolve().parents[3]
INTERFACE = ROOT / "include" / "api.json"
HEADER = ROOT / "include" / "switchback.h"
GENERATOR = Path(__file__).resolve().parents[1] / "tools" / "gen_ffi.py"

needs_header = pytest.mark.skipif(not HEADER.exists(), reason="no header here")


def generator():
    spec = importlib.util.spec_from_file_location("gen_ffi", GENERATOR)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@needs_header
def test_generated_from_this_interface():
    text = generator().generate(INTERFACE.read_text(encoding="utf-8"))
    assert Path(_ffi.__file__).read_text(encoding="utf-8") == text, "run tools/gen_ffi.py"


@needs_header
def test_the_description_says_what_the_header_says():
    # the one is read from the sources in Rust, the other from what cbindgen makes of them
    described = generator().load(INTERFACE.read_text(encoding="utf-8"))
    sys.path.insert(0, str(ROOT / "tools" / "api"))
    declared = importlib.import_module("header").parse(HEADER.read_text(encoding="utf-8"))
    for function in described.functions.values():
        for p in function.parameters:
            # whose an object is follows from its type; the header does not say it
            assert (p.object is not None) == (p.type.base in described.objects), (function.name, p.name)
            p.object = None
    assert described == declared


@needs_header
def test_the_interface_is_understood():
    api = generator().load(INTERFACE.read_text(encoding="utf-8"))
    jacobian = api.functions["swb_function_set_jacobian"]
    assert [p.length for p in jacobian.parameters] == [None, "n_col_ptr", None, "nnz", None, None]
    assert jacobian.parameters[5].nullable and not jacobian.parameters[1].nullable
    solve = api.functions["swb_ocp_solve_warm"].parameters
    assert (solve[1].direction, solve[1].type.stars) == ("out", 1)
    assert api.functions["swb_mpcc_get_name"].parameters[1].enum == "swb_item"
    assert "swb_ocp" in api.objects and api.records["swb_switch"].fields[0].name == "struct_size"
    assert api.enums["swb_status"].values[0][:2] == ("SWB_OK", 0)
    assert solve[0].object == "exclusive" and api.functions["swb_ocp_free"].parameters[0].object == "freed"
    create = {p.name: p.object for p in api.functions["swb_ocp_create"].parameters}
    assert create["out"] == "new" and create["system"] == "shared"


@needs_header
def test_every_function_is_declared():
    text = HEADER.read_text(encoding="utf-8")
    assert len(_ffi.FUNCTIONS) == sum(line.startswith(("SWB_API", "SWB_NODISCARD SWB_API")) for line in text.splitlines()) > 100


@needs_header
@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler here")
def test_layout(tmp_path):
    structs = {n: s for n, s in vars(_ffi).items() if n.startswith("swb_") and isinstance(s, type(ctypes.Structure))}
    assert len(structs) >= 7
    lines, expected = [], []
    for name, struct in structs.items():
        lines.append(f'printf("{name} %zu\\n", sizeof({name}));')
        expected.append(f"{name} {ctypes.sizeof(struct)}")
        for field, _ in struct._fields_:
            lines.append(f'printf("{name}.{field} %zu\\n", offsetof({name}, {field}));')
            expected.append(f"{name}.{field} {getattr(struct, field).offset}")
    for enum in vars(_ffi).values():
        if isinstance(enum, type) and issubclass(enum, _ffi.Names) and enum is not _ffi.Names:
            prefix = enum.__doc__.split()[1].upper()
            for value in enum:
                symbol = f"SWB_{'ERR_' if value and prefix == 'SWB_STATUS' else ''}{value.name}"
                plain = prefix in ("SWB_STATUS", "SWB_FUNCTION_FLAG")  # their constants do not have the name of the type
                symbol = symbol if plain else f"{prefix}_{value.name}"
                lines.append(f'printf("{symbol} %d\\n", (int){symbol});')
                expected.append(f"{symbol} {int(value)}")
    program = tmp_path / "layout.c"
    body = "\n".join(lines)
    program.write_text(
        f"#include <stddef.h>\n#include <stdio.h>\n#include <switchback.h>\nint main(void) {{\n{body}\nreturn 0; }}\n"
    )
    subprocess.run(["cc", "-I", HEADER.parent, program, "-o", tmp_path / "layout"], check=True)
    out = subprocess.run([tmp_path / "layout"], check=True, capture_output=True, text=True).stdout
    assert out.split("\n")[:-1] == expected


def run(code, **variables):
    environment = {**os.environ, **variables}
    return subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)


def test_library_that_is_not_there(tmp_path):
    done = run("import switchback_control", SWITCHBACK_LIBRARY=str(tmp_path / "nowhere.so"))
    assert done.returncode == 1
    assert "ImportError: switchback: the library cannot be loaded" in done.stderr and "nowhere.so" in done.stderr


def test_library_of_something_else():
    import ctypes.util

    other = ctypes.util.find_library("m") or ctypes.util.find_library("c")
    done = run("import switchback_control", SWITCHBACK_LIBRARY=other)
    assert done.returncode == 1 and "is no switchback library" in done.stderr


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler here")
def test_library_of_another_version(tmp_path):
    source = tmp_path / "old.c"
    source.write_text(
        "int swb_check_version(int a, int b) { return a + b > 0 ? -5 : 0; }\n"
        'const char *swb_version(void) { return "0.0.7"; }\n'
    )
    subprocess.run(["cc", "-shared", "-fPIC", source, "-o", tmp_path / "old.so"], check=True)
    done = run("import switchback_control", SWITCHBACK_LIBRARY=str(tmp_path / "old.so"))
    assert done.returncode == 1 and "has version 0.0.7" in done.stderr and "0.2.0" in done.stderr


def test_where_it_comes_from():
    assert Path(swb.library_path).name.startswith("libswitchback")
    assert swb.library_version == swb.__version__
    assert (Path(swb.__file__).parent / "py.typed").exists()


def test_matplotlib_is_lazy():
    done = run("import sys, switchback_control; sys.exit('matplotlib' in sys.modules)")
    assert done.returncode == 0, done.stderr


def test_interpreter_ends_with_objects_alive():
    done = run(
        "import switchback_control as s; m = s.Mpcc(1, lambda x: x[0]**2); m.solve(); m.cycle = m\n"
        "t = s.simulate_fesd(s.System(1, f0=lambda x: -x), [1.0], 1.0, 3).trajectory"
    )
    assert done.returncode == 0 and done.stderr == ""
