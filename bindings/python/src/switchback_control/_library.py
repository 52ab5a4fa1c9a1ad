"""Finds, loads and checks the library."""

from __future__ import annotations

import ctypes
import ctypes.util
import os
import sys
from pathlib import Path

from . import _ffi


def _names() -> tuple[str, str]:
    """What the library is called on this platform, and with the number of its ABI."""
    major, minor, _ = _ffi.VERSION
    number = f"0.{minor}" if major == 0 else f"{major}"
    if sys.platform == "win32":
        return "switchback.dll", f"switchback-{number}.dll"
    if sys.platform == "darwin":
        return "libswitchback.dylib", f"libswitchback.{number}.dylib"
    return "libswitchback.so", f"libswitchback.so.{number}"


def _load() -> tuple[ctypes.CDLL, str]:
    chosen = os.environ.get("SWITCHBACK_LIBRARY")
    name, numbered = _names()
    bundled = Path(__file__).resolve().parent / name
    if chosen:
        places = [chosen]
    else:
        places = [str(bundled)] if bundled.is_file() else []
        places += [numbered, name]
        found = ctypes.util.find_library("switchback")
        places += [found] if found else []
    failures = []
    for place in places:
        try:
            return ctypes.CDLL(place), place
        except OSError as error:
            failures.append(str(error))
    raise ImportError(
        "switchback: the library cannot be loaded (the variable SWITCHBACK_LIBRARY may say where it is):\n  "
        + "\n  ".join(failures)
    )


def _check(library: ctypes.CDLL, place: str) -> None:
    major, minor, patch = _ffi.VERSION
    try:
        check = library.swb_check_version
        check.restype, check.argtypes = ctypes.c_int32, [ctypes.c_int32, ctypes.c_int32]
        library.swb_version.restype, library.swb_version.argtypes = ctypes.c_char_p, []
        other = library.swb_version().decode()
    except AttributeError as error:
        raise ImportError(f"switchback: {place} is no switchback library: {error}") from None
    if check(major, minor) != 0:
        raise ImportError(
            f"switchback: this package is for version {major}.{minor}.{patch} of the library, "
            f"but {place} has version {other}"
        )


def _open() -> tuple[ctypes.CDLL, str]:
    library, place = _load()
    _check(library, place)
    try:
        return _ffi.declare(library), place
    except AttributeError as error:
        raise ImportError(f"switchback: {place} does not match this package: {error}") from None


lib, path = _open()
version: str = lib.swb_version().decode()


def file_of() -> str:
    """The file of the library: where it was found by its name alone, among those that the process has mapped."""
    if os.path.exists(path):
        return os.path.realpath(path)
    try:
        with open("/proc/self/maps") as maps:
            mapped = [line.split()[-1] for line in maps]
    except OSError:
        mapped = []
    return next((file for file in mapped if os.path.basename(file).startswith(_names()[0])), path)
