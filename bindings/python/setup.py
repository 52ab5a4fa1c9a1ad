"""Puts the library into the wheel: the file $SWITCHBACK_LIBRARY, else what cargo built in this repository."""

import os
import shutil
from pathlib import Path

from setuptools import Distribution, setup
from setuptools.command.build_py import build_py

try:
    from setuptools.command.bdist_wheel import bdist_wheel
except ImportError:  # before setuptools 70.1
    from wheel.bdist_wheel import bdist_wheel

HERE = Path(__file__).resolve().parent


def library() -> Path:
    chosen = os.environ.get("SWITCHBACK_LIBRARY")
    target = os.environ.get("CARGO_TARGET_DIR") or HERE.parents[1] / "target"
    path = Path(chosen) if chosen else Path(target) / "release" / "libswitchback.so"
    if not path.is_file():
        raise SystemExit(
            f"switchback: there is no library {path}; build it with 'cargo build --release', "
            "or set SWITCHBACK_LIBRARY to where it is"
        )
    return path


class BuildWithLibrary(build_py):
    def run(self):
        editable = getattr(self, "editable_mode", False)
        destination = HERE / "src" / "switchback" if editable else Path(self.build_lib) / "switchback"
        if not editable:
            shutil.rmtree(destination, ignore_errors=True)  # of an earlier build
        super().run()
        shutil.copyfile(library(), destination / "libswitchback.so")


class Platform(Distribution):
    """Belongs to a platform, although nothing is compiled here."""

    def has_ext_modules(self):
        return True


class PlatformWheel(bdist_wheel):
    """One wheel for every Python of the platform: the library does not know Python."""

    def get_tag(self):
        return "py3", "none", super().get_tag()[2]


setup(cmdclass={"build_py": BuildWithLibrary, "bdist_wheel": PlatformWheel}, distclass=Platform)
