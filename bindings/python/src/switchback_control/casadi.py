"""Functions of CasADi as functions of a model, without Python in the loop.

    import casadi as ca, switchback_control as swb

    x = ca.SX.sym("x", 2)
    psi = ca.Function("psi", [x], [ca.sumsqr(x) - 1], ["x"], ["c"])
    system.add_subsystem(modes, psi, signs=[-1, 1])   # or swb.casadi.function(psi), to say how

The inputs are named x (or w), u, p and t, those that are needed. The value is all outputs, one after the other, by
columns: the modes of a subsystem are the columns of a matrix, or several outputs. Derivatives are made by CasADi. The
code is compiled where there is a C compiler (the variable CC, or cc); else CasADi evaluates it.

Functions of a model are smooth: what jumps or has a kink is stated by modes and switching functions. A function with
`sign`, `fabs`, `if_else`, `fmin`, `floor` and the like inside, applied to anything but parameters, is refused; with
`smooth=True` it is taken as it is. Code that is loaded from a shared library cannot be looked into.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from ._arrays import index
from ._call import encode
from ._casadi_model import names_of, read, stacked
from ._casadi_switches import refuse
from ._library import lib
from .errors import ArgumentError, DimensionError, LibraryError
from .expr import Graph
from .function import Function
from .system import System

__all__ = ["function", "generate", "load", "system"]

_HOW = ("compile", "interpret")
_BLOCKS = ("x", "u", "p", "t")


def is_function(f: Any) -> bool:
    """True for a function of CasADi. Answers without importing CasADi."""
    return type(f).__name__ == "Function" and type(f).__module__.split(".")[0] == "casadi"


def function(
    f: Any,
    nx: int | None = None,
    nu: int | None = None,
    np: int | None = None,
    n_out: int | tuple[int, ...] | None = None,
    *,
    inputs: Sequence[str] | None = None,
    how: str | None = None,
    smooth: bool = False,
) -> Function:
    """A function of CasADi, or several with outputs one after the other, as a `Function` with exact derivatives.

    `inputs` says what the inputs are, such as ["x", "u"], where they have other names. Sizes that are not given are
    those of the inputs. `how` is "compile" or "interpret"; None compiles if that works. `smooth=True` says that operators
    such as `if_else` and `fmax` inside of it are used where they do no harm (beyond the domain of a square root, say).
    """
    if how not in (None, *_HOW):
        raise ArgumentError(f"how must be 'compile', 'interpret' or None, not {how!r}")
    parts = list(f) if isinstance(f, (list, tuple)) else [f]
    if not parts or not all(is_function(part) for part in parts):
        raise ArgumentError(f"expected a function of CasADi, not {f!r:.60}")
    bundle, sizes, total = _with_derivatives(parts, inputs, smooth)
    given = {"x": nx, "u": nu, "p": np}
    sizes = {key: sizes.get(key, 0) if n is None else index(n, f"n{key}") for key, n in given.items()}
    shape = (
        (total,) if n_out is None else tuple(n_out) if isinstance(n_out, (tuple, list)) else (index(n_out, "n_out"),)
    )
    wanted = 1
    for n in shape:
        wanted *= n
    if wanted != total:
        raise DimensionError(f"function '{bundle[0].name()}' has {total} outputs, expected {wanted}")
    if how != "interpret":
        try:
            return _compiled(bundle, sizes, shape)
        except (OSError, subprocess.CalledProcessError) as error:
            if how == "compile":
                said = getattr(error, "stderr", None) or str(error)
                raise LibraryError(f"'{bundle[0].name()}' cannot be compiled: {said}") from None
    return _interpreted(bundle, sizes, shape)


def system(x: Any, F: Any, S: Any, c: Any, u: Any = None, p: Any = None, t: Any = None, f0: Any = None) -> System:
    """A system stated as for nosnoc, by expressions of CasADi: `F` is a matrix with a column for each mode, `c` are switching
    functions, and mode i is active where S[i, j] c[j] > 0 for every j with S[i, j] != 0. Several subsystems are lists of these
    three. `x`, `u`, `p`, `t` are the symbols, or lists of symbols; `f0` is added to every mode."""
    fields, signs, surfaces = (list(v) if isinstance(F, (list, tuple)) else [v] for v in (F, S, c))
    if not len(fields) == len(signs) == len(surfaces):
        raise DimensionError(f"{len(fields)} matrices F, {len(signs)} S and {len(surfaces)} c: one of each for a subsystem")
    groups = [stacked(v) for v in (x, u, p)]
    made = System(*(names_of(g) or 0 for g in groups))
    sizes = made.nx, made.nu, made.np
    graph = Graph()
    blocks = [(g, graph.inputs(name, n)) for g, name, n in zip(groups, "xup", sizes)] + [(stacked(t), graph.inputs("t", 1))]
    if f0 is not None:
        made.set_f0(graph.function(read(graph, blocks, [f0])[0], *sizes, name="f0"))
    for f, s, psi in zip(fields, signs, surfaces):
        if f.size1() != made.nx:
            raise DimensionError(f"F has {f.size1()} rows, expected one for each of the {made.nx} states")
        modes, functions = read(graph, blocks, [f, psi])
        made.add_subsystem(graph.function(modes, *sizes, name="modes"), graph.function(functions, *sizes, name="c"), s)
    return made


def load(
    path: str | os.PathLike,
    name: str,
    nx: int,
    nu: int = 0,
    np: int = 0,
    *,
    inputs: Sequence[str] | None = None,
) -> Function:
    """A function of a shared library made of code that CasADi generated, with the derivatives that are there; see
    `generate`, and `swb_function_from_casadi_library` in the header for their names."""
    sizes = {"x": index(nx, "nx"), "u": index(nu, "nu"), "p": index(np, "np")}
    return _made("library", [str(path)], name, " ".join(inputs) if inputs else None, sizes, None)


def generate(functions: Any, path: str | os.PathLike, *, smooth: bool = False) -> None:
    """Write C code of functions of CasADi with their derivatives, to be compiled and used by `load`, or from C; `smooth`
    as in `function`."""
    import casadi as ca

    path = Path(path)
    generator = ca.CodeGenerator(path.name)
    for f in functions if isinstance(functions, (list, tuple)) else [functions]:
        for part in _with_derivatives([f], None, smooth)[0]:
            generator.add(part)
    folder = str(path.parent)
    generator.generate(folder + os.sep)


def _with_derivatives(
    parts: list[Any], inputs: Sequence[str] | None, smooth: bool
) -> tuple[list[Any], dict[str, int], int]:
    """Function, Jacobian and Hessian of the weighted sum under the names the library looks for; sizes of the inputs;
    number of outputs."""
    import casadi as ca

    names: list[str] = []
    for part in parts:
        own = list(inputs) if inputs is not None else [part.name_in(k) for k in range(part.n_in())]
        if len(own) != part.n_in():
            raise ArgumentError(f"function '{part.name()}' has {part.n_in()} inputs, {len(own)} are listed")
        own = ["x" if n == "w" else n for n in own]
        for n in own:
            if n not in _BLOCKS:
                raise ArgumentError(
                    f"function '{part.name()}' has an input '{n}': name the inputs x, u, p and t, or say what they are: "
                    "inputs=['x', 'u']"
                )
        names.append(" ".join(own))
    if not smooth:
        refuse(parts, [own.split() for own in names])
    used = [n for n in _BLOCKS if any(n in own.split() for own in names)]
    shapes: dict[str, tuple[int, int]] = {}
    for part, own in zip(parts, names):
        for k, n in enumerate(own.split()):
            shape = part.size_in(k)
            if shapes.setdefault(n, shape) != shape:
                raise DimensionError(f"the functions disagree about the shape of {n}: {shapes[n]} and {shape}")

    def expressions(kind: Any, functions: list[Any]) -> tuple[list[Any], list[Any]]:
        symbols = {n: kind.sym(n, *shapes[n]) for n in used}
        outputs: list[Any] = []
        for part, own in zip(functions, names):
            outputs += part.call([symbols[n] for n in own.split()])
        return [symbols[n] for n in used], [ca.vec(ca.densify(y)) for y in outputs]

    kind = ca.SX
    try:
        arguments, outputs = expressions(kind, [part.expand() for part in parts])
    except RuntimeError:  # operations that scalars do not have
        kind = ca.MX
        arguments, outputs = expressions(kind, parts)
    name = parts[0].name()
    value = ca.vertcat(*outputs)
    f = ca.Function(name, arguments, [value], used, ["y"])
    n, m = f.nnz_in(), f.numel_out(0)
    if n == 0:
        return [f], {key: shapes[key][0] * shapes[key][1] for key in used}, m
    # One vector of all inputs, to which the derivatives belong.
    z, w = kind.sym("z", n), kind.sym("w", m)
    ends = [0]
    for a in arguments:
        ends.append(ends[-1] + a.numel())
    blocks = [ca.reshape(b, a.shape) for a, b in zip(arguments, ca.vertsplit(z, ends))]
    y = f.call(blocks, True, False)[0]
    jacobian = ca.Function("of_z", [z], [ca.jacobian(y, z)])
    hessian = ca.Function("of_z", [z, w], [ca.triu(ca.hessian(ca.dot(w, y), z)[0])])
    all_in_one = ca.vertcat(*[ca.vec(a) for a in arguments])
    return (
        [
            f,
            ca.Function("jac_" + name, arguments, jacobian.call([all_in_one], True, False), used, ["jac"]),
            ca.Function(
                "hess_" + name, [*arguments, w], hessian.call([all_in_one, w], True, False), [*used, "w"], ["hess"]
            ),
        ],
        {key: shapes[key][0] * shapes[key][1] for key in used},
        m,
    )


def _compiled(bundle: list[Any], sizes: dict[str, int], shape: tuple[int, ...]) -> Function:
    import casadi as ca

    compiler = os.environ.get("CC") or shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if not compiler:
        raise OSError("there is no C compiler: install one, or name it in the variable CC")
    with _folder() as folder:
        generator = ca.CodeGenerator("code")
        for f in bundle:
            generator.add(f)
        generator.generate(folder + os.sep)
        source, library = os.path.join(folder, "code.c"), os.path.join(folder, "code.so")
        command = [*compiler.split(), "-O2", "-fPIC", "-shared", "-o", library, source, "-lm"]
        subprocess.run(command, check=True, capture_output=True, text=True)
        # The loader keeps the file when its name is gone.
        return _made("library", [library], bundle[0].name(), None, sizes, shape)


@contextlib.contextmanager
def _folder() -> Iterator[str]:
    """A folder for a library that stays open: Windows keeps such files, and the system's cleaning removes them."""
    folder = tempfile.mkdtemp(prefix="switchback")
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=sys.platform == "win32")


def _interpreted(bundle: list[Any], sizes: dict[str, int], shape: tuple[int, ...]) -> Function:
    import casadi as ca

    with tempfile.TemporaryDirectory(prefix="switchback") as folder:
        file = os.path.join(folder, "functions.casadi")
        serializer = ca.FileSerializer(file)
        serializer.pack(bundle)
        del serializer
        return _made("file", [_casadi_library(), file], bundle[0].name(), None, sizes, shape)


def _casadi_library() -> str:
    """The library that the imported CasADi uses."""
    import casadi as ca

    folder = Path(ca.__file__).parent
    for pattern in ("libcasadi.so*", "libcasadi*.dylib", "libcasadi.dll"):
        for candidate in sorted(folder.glob(pattern)):
            return str(candidate)
    if sys.platform == "linux":
        with open("/proc/self/maps", encoding="utf-8") as maps:
            for line in maps:
                if "/libcasadi.so" in line:
                    return line[line.index("/") :].strip()
    raise LibraryError("the library of CasADi cannot be found")


def _made(
    source: str,
    places: list[str],
    name: str,
    inputs: str | None,
    sizes: dict[str, int],
    shape: tuple[int, ...] | None,
) -> Function:
    """A function that the library makes of code."""
    self = Function.__new__(Function)
    self.name = name
    self.sizes = sizes
    self.inputs = _BLOCKS
    self._callbacks = []
    arguments = [encode(place, "path") for place in places]
    self._make(
        getattr(lib, f"swb_function_from_casadi_{source}"),
        *arguments,
        encode(name, "name"),
        None if inputs is None else encode(inputs, "inputs"),
        sizes["x"],
        sizes["u"],
        sizes["p"],
    )
    n_out = ctypes.c_int64()
    self.shape = ()
    self._do("sizes", None, None, None, ctypes.byref(n_out), None, None)
    self.shape = (n_out.value,) if shape is None else shape
    return self
