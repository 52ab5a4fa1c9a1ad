# make demo      the first pictures, within three minutes after the build: in out/
# make examples  all examples, in C and Python: tables on the terminal, plots in out/
# make benchmarks  the reports on accuracy and speed, and whether the figures on the pages are theirs; takes long
# make site      the documentation as web pages, in build/site; the playground in them needs the target wasm32-wasip1 of Rust
# make pictures  run the examples in Python and the recipes, and write their pictures into docs/pictures
# make check     everything that must hold before a commit; what .ci/run runs. Of a library without link-time optimisation, which two
#                processors build in half of the time; make check PROFILE=release checks what is shipped
# make quick     formatting, layers and unit tests, while one works: under a minute after a change of one line, on two cores
# make install   library, header, CMake and pkg-config files, and the solver for AMPL, into PREFIX
# make header    write what is made of options.toml of the settings, include/switchback.h, include/api.json, and from that what Python and Julia declare
# make platforms  build for aarch64, musl, Windows, WebAssembly and macOS, and run the C tests there where this machine can; takes long
# make release   the wheel, the source distribution and the crates of this version, in dist/, tried in empty environments; takes long
# make release-wheel  a wheel that needs nothing of the system, and a source distribution, into build/dist
# make fuzz      try to break the library for FUZZ_SECONDS, from SEED on; see fuzz/README.md
# make nightly   what takes too long for every commit: the shipped library in all tests, an hour of fuzzing, every fault, the site, the wheel
# make docs      write docs/errors.md from the tables
# make deps      install what is missing (Debian packages, SUNDIALS, Python modules)
# make fuzz-faults  refuse every single request for memory of every scenario once
# make clean     remove build/, dist/, out/ and target/

PREFIX ?= /usr/local
LIBDIR ?= lib
CARGO ?= cargo
CMAKE ?= cmake
PYTHON ?= python3
JOBS ?= $(shell nproc 2>/dev/null || echo 2)

TARGET := $(abspath $(or $(CARGO_TARGET_DIR),target))
BUILD := $(abspath build)
OUT := $(abspath out)
DIST := $(abspath dist)
VENV := $(BUILD)/venv
SUNDIALS := $(BUILD)/sundials
# The profile of Cargo.toml of the library that is installed, packed and tested.
PROFILE ?= release
LIBRARY = $(TARGET)/$(PROFILE)
HEADER = $(CARGO) run --quiet --locked --manifest-path tools/header/Cargo.toml --target-dir $(TARGET)/header --

.NOTPARALLEL:
.PHONY: all build demo examples benchmarks site pictures check quick nightly install header docs deps clean fuzz \
	demo-report demo-c demo-python stage stage-examples \
	check-format check-lint check-rust check-header check-stage check-c check-examples check-pkgconfig check-python \
	check-julia check-hostile check-crate check-ampl

all: build

build:
	$(CARGO) build --profile $(PROFILE)

header:
	$(HEADER) .
	$(PYTHON) bindings/python/tools/gen_ffi.py
	$(PYTHON) bindings/julia/gen/generate.py

docs:
	SWB_WRITE_DOCS=1 $(CARGO) test --quiet --profile unit --lib docs::

deps:
	sh scripts/deps.sh $(BUILD)

install: build
	$(CMAKE) -DPREFIX=$(abspath $(PREFIX)) -DLIBDIR=$(LIBDIR) -DBUILD_DIR=$(LIBRARY) -P cmake/install.cmake

# The library under AddressSanitizer, with everything that callers can do wrong.
FUZZ = $(MAKE) -C fuzz TARGET=$(TARGET)/fuzz BUILD=$(BUILD)/fuzz VENV=$(VENV) CARGO="$(CARGO)"

fuzz: deps
	$(FUZZ) fuzz

nightly: FUZZ_SECONDS ?= 3600
nightly: SEED ?= $(shell date +%j)
nightly:
	$(MAKE) check PROFILE=release
	$(MAKE) fuzz FUZZ_SECONDS=$(FUZZ_SECONDS) SEED=$(SEED)
	$(MAKE) fuzz-faults
	$(MAKE) site
	$(MAKE) release-wheel

clean:
	rm -rf $(BUILD) $(DIST) $(OUT) $(TARGET)

# --- the gallery ----------------------------------------------------------------------------------

# Of a library without link-time optimisation, which is there sooner.
demo: PROFILE = tests
demo: deps build
	$(MAKE) PROFILE=$(PROFILE) wheel
	MPLBACKEND=Agg $(VENV)/bin/python scripts/demo.py $(OUT)

examples: deps build
	mkdir -p $(OUT)
	$(MAKE) demo-c demo-python
	@echo "plots and tables: $(OUT)"

benchmarks: deps build
	mkdir -p $(OUT)
	$(MAKE) demo-report
	PYTHONPATH=bindings/python/src SWITCHBACK_LIBRARY=$(LIBRARY)/libswitchback.so \
		$(VENV)/bin/python bindings/python/benchmarks/nmpc_loops.py --out $(OUT)/benchmarks
	$(VENV)/bin/python scripts/figures.py --times $(OUT)/benchmarks/data

# Of a library without link-time optimisation, which is there sooner.
site pictures: PROFILE = tests
site: deps
	$(MAKE) PROFILE=$(PROFILE) wheel
	sh scripts/site_deps.sh $(BUILD)
	$(VENV)/bin/python scripts/playground.py $(BUILD)
	$(VENV)/bin/python scripts/site.py $(BUILD)
	$(VENV)/bin/python scripts/site_look.py $(BUILD)/site $(BUILD)/site_pictures
	$(VENV)/bin/python scripts/playground_look.py $(BUILD)/site $(BUILD)/site_pictures

pictures: deps
	$(MAKE) PROFILE=$(PROFILE) wheel
	$(VENV)/bin/python scripts/site_pictures.py docs/pictures

# Rust: one program knows every example.
demo-report:
ifneq ($(wildcard examples/report.rs examples/report/main.rs),)
	$(CARGO) run --release --example report -- all --plot $(OUT)
endif

# C: built like a user would, against an installed prefix; each program takes the folder for its plots.
demo-c:
ifneq ($(wildcard examples/c/CMakeLists.txt),)
	$(MAKE) stage
	$(CMAKE) -S examples/c -B $(BUILD)/examples_c -DCMAKE_BUILD_TYPE=Release -DCMAKE_PREFIX_PATH=$(BUILD)/prefix
	$(CMAKE) --build $(BUILD)/examples_c --parallel $(JOBS)
	set -e; for source in examples/c/*.c; do \
		echo "== $$source"; $(BUILD)/examples_c/$$(basename $$source .c) $(OUT); \
	done
endif

# Python: each script takes the folder for its plots.
demo-python:
ifneq ($(wildcard examples/python/*.py),)
	$(MAKE) wheel
	set -e; for script in examples/python/*.py; do \
		echo "== $$script"; MPLBACKEND=Agg $(VENV)/bin/python $$script $(OUT); \
	done
endif

# --- the suites in full ---------------------------------------------------------------------------

.PHONY: fuzz-faults
# Every request for memory of every scenario is refused once, and with all later ones.
fuzz-faults: stage
	$(CMAKE) -S capi_tests -B $(BUILD)/faults -DCMAKE_PREFIX_PATH=$(BUILD)/prefix -DSWITCHBACK_LINK=static
	$(CMAKE) --build $(BUILD)/faults --parallel $(JOBS) --target faults limits
	$(BUILD)/faults/limits
	$(BUILD)/faults/faults 0

# --- the checks -----------------------------------------------------------------------------------

# What is checked once the library, the Python package and the examples in C are there, the longest first: as many at a time as there are
# processors. INSTALLED says so to steps that would make them themselves.
STEPS := rust hostile python c julia lint crate ampl examples header pkgconfig

# Each step writes into its own file, which follows when it has ended, with how long it took.
check: PROFILE = tests
check: deps
	$(MAKE) check-format
	$(MAKE) PROFILE=$(PROFILE) check-stage wheel stage-examples
	printf '%s\n' $(STEPS) | xargs -P $(JOBS) -n 1 sh scripts/check_step.sh "$(MAKE) PROFILE=$(PROFILE) INSTALLED=yes" $(BUILD)
	@echo "all checks passed"

# What a change of one line can break at once; built anew by increments, without optimisation.
quick: check-format
	CARGO_INCREMENTAL=1 $(CARGO) test --quiet --profile unit --features faer --lib --test layers --test readme

check-format:
	$(CARGO) fmt --all --check
	$(CARGO) fmt --check --manifest-path tools/header/Cargo.toml

check-lint:
	$(PYTHON) scripts/prose.py
	$(PYTHON) scripts/versions.py
	$(CARGO) clippy --workspace --all-targets -- -D warnings
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc --quiet --no-deps

# Tests of all crates, which are the default members of the workspace. Unit tests with the backend on faer in the library, which it is shipped without, as all other tests have it; they compute little and are
# not optimised. What is in examples/ is compiled by check-lint.
check-rust:
	$(CARGO) test --profile tests --test '*'
	$(CARGO) test --profile tests --doc
	$(CARGO) test --profile unit --features faer --lib

# What crates.io would get, and programs that depend on it.
check-crate:
	sh scripts/try_crate.sh $(BUILD)

check-header:
	$(HEADER) --check .
	$(CARGO) test --quiet --locked --manifest-path tools/header/Cargo.toml --target-dir $(TARGET)/header
	$(PYTHON) bindings/python/tools/gen_ffi.py --check

# Install, then move: nothing may remember where it was installed.
stage: build
	rm -rf $(BUILD)/prefix
	$(MAKE) install PREFIX=$(BUILD)/prefix > /dev/null

check-stage: stage
	rm -rf $(BUILD)/moved
	mv $(BUILD)/prefix $(BUILD)/moved

# The C tests see the package only: shared and static library, refused versions, header, symbols,
# valgrind, and IDAS if there is one.
check-c:
	rm -rf $(BUILD)/capi
	$(CMAKE) -S capi_tests -B $(BUILD)/capi -DCMAKE_PREFIX_PATH=$(BUILD)/moved -DSUNDIALS_ROOT=$(SUNDIALS)
	$(CMAKE) --build $(BUILD)/capi --parallel $(JOBS)
	ctest --test-dir $(BUILD)/capi --output-on-failure --no-tests=error --parallel $(JOBS)

# The examples in C, for check-examples and for the Python tests that compare with them.
stage-examples:
	$(CMAKE) -S examples/c -B $(BUILD)/examples_c_check -DCMAKE_BUILD_TYPE=Release -DCMAKE_PREFIX_PATH=$(BUILD)/moved
	$(CMAKE) --build $(BUILD)/examples_c_check --parallel $(JOBS)

check-examples:
	$(if $(INSTALLED),,$(MAKE) stage-examples)
	set -e; for source in examples/c/*.c; do \
		$(BUILD)/examples_c_check/$$(basename $$source .c) $(BUILD)/examples_c_check > /dev/null; \
	done

check-pkgconfig:
	sh scripts/check_pkgconfig.sh $(BUILD)/moved $(LIBDIR) $(BUILD)/pkgconfig

# The Python tests see the installed wheel only.
.PHONY: wheel
wheel: build
ifneq ($(wildcard bindings/python/pyproject.toml),)
	rm -rf $(BUILD)/wheel
	SWITCHBACK_LIBRARY=$(LIBRARY)/libswitchback.so $(VENV)/bin/pip wheel --quiet --no-deps \
		--no-build-isolation --wheel-dir $(BUILD)/wheel ./bindings/python
	$(VENV)/bin/pip install --quiet --no-deps --force-reinstall $(BUILD)/wheel/*.whl
endif

# A wheel for other machines: own build, SuiteSparse inside, tried in an empty environment.
.PHONY: release-wheel
release-wheel: deps
	sh scripts/release_wheel.sh $(BUILD)

# All that is handed out, of one version: the scripts try what they have made.
.PHONY: release
release: deps
	$(PYTHON) scripts/versions.py
	sh scripts/release_wheel.sh $(BUILD) $(DIST)
	sh scripts/try_crate.sh $(BUILD) $(DIST)
	cd $(DIST) && sha256sum * > $(BUILD)/SHA256SUMS && mv $(BUILD)/SHA256SUMS .
	ls -l $(DIST)

.PHONY: platforms
platforms:
	sh scripts/platforms.sh $(BUILD)

check-python:
ifneq ($(wildcard bindings/python/pyproject.toml),)
	$(if $(INSTALLED),,$(MAKE) wheel)
	cd $(BUILD) && MPLBACKEND=Agg $(VENV)/bin/python -m pytest -q -rfEs --durations=12 -p no:cacheprovider $(CURDIR)/bindings/python/tests
endif

# Problems that Pyomo writes and the solver for AMPL solves; the installed one where there is one.
check-ampl:
	$(if $(INSTALLED),,$(MAKE) build)
	SWITCHBACK_MPCC_AMPL=$(if $(INSTALLED),$(BUILD)/moved/bin,$(LIBRARY))/switchback-mpcc-ampl \
		$(VENV)/bin/python -m pytest -q -rs -p no:cacheprovider crates/switchback-mpcc-ampl/pyomo

check-hostile:
	$(FUZZ) check

# The Julia package on the installed library, with the julia on the PATH or one unpacked into build/; compared with what
# Python finds with the same library. -O0: the tests compile much and compute little.
check-julia:
	$(PYTHON) bindings/julia/gen/generate.py --check
	$(if $(INSTALLED),,$(MAKE) wheel)
	@if julia=$$(sh scripts/get_julia.sh $(BUILD)/julia); then \
		SWITCHBACK_LIBRARY=$(LIBRARY)/libswitchback.so \
			$(VENV)/bin/python bindings/julia/test/reference.py $(BUILD)/julia_reference.json && \
		SWITCHBACK_LIBRARY=$(BUILD)/moved/$(LIBDIR)/libswitchback.so SWITCHBACK_REFERENCE=$(BUILD)/julia_reference.json \
			JULIA_DEPOT_PATH=$(BUILD)/julia_depot \
			$$julia -O0 --startup-file=no --project=$(CURDIR)/bindings/julia bindings/julia/test/runtests.jl; \
	else \
		echo "left out: tests of the Julia package: there is no julia here and none could be unpacked"; \
	fi
