#!/bin/sh
# usage: deps.sh BUILD    install what the build, the tests and the demo need and the system lacks
#
# Debian packages through apt, if there is root or sudo; SUNDIALS (tests only) unpacked into
# BUILD/sundials, because the package pulls in hundreds of MB; Python modules into BUILD/venv.
# Only what the library itself needs is an error when it cannot be had.
set -eu
build=$1
mkdir -p "$build"

say() { echo "deps: $*"; }

. "$(dirname "$0")/root.sh"

have_header() { echo "#include <$1>" | cc -E -x c - > /dev/null 2>&1; }
have_program() { command -v "$1" > /dev/null; }

# --- Debian packages ---
required=""
optional=""
have_program cc || required="$required gcc libc6-dev"
have_program c++ || required="$required g++"
have_program cmake || required="$required cmake"
have_header suitesparse/ldl.h || required="$required libsuitesparse-dev"
have_program pkg-config || optional="$optional pkg-config"
have_program valgrind || optional="$optional valgrind"
python3 -c "import ensurepip, venv" 2> /dev/null || optional="$optional python3-venv"

if [ -n "$required$optional" ]; then
    say "missing packages:$required$optional"
    if ! have_program apt-get; then
        say "no apt-get here: please install them by the means of this system"
    elif [ "$root" = none ]; then
        say "neither root nor sudo: please run  apt-get install$required$optional"
    else
        $root apt-get update -qq
        # shellcheck disable=SC2086
        DEBIAN_FRONTEND=noninteractive $root apt-get install -y -qq --no-install-recommends $required $optional
    fi
    have_program cc && have_program cmake && have_header suitesparse/ldl.h || {
        say "the library cannot be built without:$required"
        exit 1
    }
fi

# --- SUNDIALS, for the comparison with IDAS ---
if ! have_header idas/idas.h && [ ! -e "$build/sundials/usr/include/idas/idas.h" ]; then
    if have_program apt-get && have_program dpkg; then
        say "unpacking SUNDIALS into $build/sundials"
        packages="libsundials-dev libsundials-arkode5 libsundials-cvode6 libsundials-idas5 libsundials-nvecserial6 libsundials-sunlinsol3 libsundials-sunmatrix4"
        mkdir -p "$build/sundials/deb"
        # shellcheck disable=SC2086
        download() { (cd "$build/sundials/deb" && apt-get download -qq $packages); }
        if { download 2> /dev/null || { [ "$root" != none ] && $root apt-get update -qq && download; }; }; then
            for deb in "$build"/sundials/deb/*.deb; do dpkg -x "$deb" "$build/sundials"; done
        else
            say "left out: comparison with IDAS: SUNDIALS cannot be had"
        fi
        rm -rf "$build/sundials/deb"
    fi
fi

# --- Python ---
if [ ! -x "$build/venv/bin/python" ]; then
    python3 -m venv "$build/venv" || say "left out: Python tests and plots: no Python environment"
fi
if [ -x "$build/venv/bin/python" ] &&
    ! "$build/venv/bin/python" -c "import numpy, scipy, matplotlib, pytest, setuptools, wheel, casadi, hypothesis, pyomo, fmpy" 2> /dev/null; then
    say "installing Python modules into $build/venv"
    "$build/venv/bin/pip" install --quiet --disable-pip-version-check numpy scipy matplotlib pytest setuptools wheel casadi hypothesis pyomo fmpy
fi
