"""Puts the library into the wheel: the file $SWITCHBACK_LIBRARY, else what cargo built in this repository, else, in a source
distribution, what cargo builds of the crates in it. Source distributions hold the crates."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

from setuptools import Distribution, setup
from setuptools.command.build_py import build_py
from setuptools.command.sdist import sdist

try:
    from setuptools.command.bdist_wheel import bdist_wheel
except ImportError:  # before setuptools 70.1
    from wheel.bdist_wheel import bdist_wheel

HERE = Path(__file__).resolve().parent
CRATE = HERE / "crate"  # in a source distribution
# What cargo and the package call the library, by what its name ends with.
NAMES = {".so": "libswitchback.so", ".dylib": "libswitchback.dylib", ".dll": "switchback.dll"}
NAME = NAMES[{"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")]


def build_crate() -> Path:
    """The library, built of the crates of a source distribution; without SuiteSparse on Windows, and where SWITCHBACK_SUITESPARSE is 0."""
    target = Path(os.environ.get("CARGO_TARGET_DIR") or CRATE / "target")
    linked = os.environ.get("SWITCHBACK_SUITESPARSE", "0" if sys.platform == "win32" else "1") != "0"
    features = [] if linked else ["--no-default-features", "--features", "allocator"]
    try:
        subprocess.run(["cargo", "build", "--release", "--locked", "--lib", *features], cwd=CRATE, check=True)
    except FileNotFoundError:
        raise SystemExit("switchback: building from source needs Rust (https://rustup.rs): there is no cargo here") from None
    except subprocess.CalledProcessError:
        raise SystemExit(
            "switchback: cargo could not build the library; where the linker found no ldl or amd, install SuiteSparse "
            "(apt-get install libsuitesparse-dev), or set SUITESPARSE_LIB_DIR to where it is, or SWITCHBACK_SUITESPARSE=0 "
            "to build without it"
        ) from None
    return target / "release" / NAME


def library() -> Path:
    chosen = os.environ.get("SWITCHBACK_LIBRARY")
    if not chosen and (CRATE / "Cargo.toml").is_file():
        return build_crate()
    target = os.environ.get("CARGO_TARGET_DIR") or HERE.parents[1] / "target"
    path = Path(chosen) if chosen else Path(target) / "release" / NAME
    if not path.is_file():
        raise SystemExit(
            f"switchback: there is no library {path}; build it with 'cargo build --release', "
            "or set SWITCHBACK_LIBRARY to where it is"
        )
    return path


class BuildWithLibrary(build_py):
    def run(self):
        editable = getattr(self, "editable_mode", False)
        destination = HERE / "src" / "switchback_control" if editable else Path(self.build_lib) / "switchback_control"
        if not editable:
            shutil.rmtree(destination, ignore_errors=True)  # of an earlier build
        super().run()
        source = library()
        # of another platform where that is what --plat-name says
        copy = destination / NAMES.get(source.suffix, NAME)
        shutil.copyfile(source, copy)
        strip = shutil.which("strip")
        if strip and copy.suffix == ".so":  # 24 MB with names of lines, 6 MB without
            subprocess.run([strip, "--strip-unneeded", str(copy)], check=True)


class SourceWithCrate(sdist):
    def make_release_tree(self, base_dir, files):
        super().make_release_tree(base_dir, files)
        root, crate = HERE.parents[1], Path(base_dir) / "crate"
        if CRATE.is_dir():
            shutil.copytree(CRATE, crate, ignore=shutil.ignore_patterns("target"))
            return
        for part in (".", "crates/switchback-mpcc", "crates/switchback-capi", "crates/switchback-mpcc-ampl"):
            (crate / part).mkdir(parents=True)
            for name in ("Cargo.lock", "build.rs", "LICENSE", "README.md"):
                if (root / part / name).is_file():
                    shutil.copyfile(root / part / name, crate / part / name)
            # the tests stay at home
            manifest = (root / part / "Cargo.toml").read_text(encoding="utf-8")
            (crate / part / "Cargo.toml").write_text(manifest.split("[[test]]")[0], encoding="utf-8")
            shutil.copytree(root / part / "src", crate / part / "src")


class Platform(Distribution):
    """Belongs to a platform, although nothing is compiled here."""

    def has_ext_modules(self):
        return True


class PlatformWheel(bdist_wheel):
    """One wheel for every Python of the platform: the library does not know Python."""

    def get_tag(self):
        return "py3", "none", super().get_tag()[2]


setup(
    cmdclass={"build_py": BuildWithLibrary, "bdist_wheel": PlatformWheel, "sdist": SourceWithCrate},
    distclass=Platform,
)
