#!/bin/sh
# usage: platforms.sh BUILD [PLATFORM...]    build the library for other platforms and run its C tests there, as far as this machine can
#
# Platforms: aarch64, musl, windows, wasm, macos; all of them where none is named. Everything but Linux with SuiteSparse is built with
# the library's own factorisation. What is needed and missing is said, and left out:
#
#   all       rustup target add aarch64-unknown-linux-gnu x86_64-unknown-linux-musl x86_64-pc-windows-gnu wasm32-wasip1 \
#                 x86_64-apple-darwin aarch64-apple-darwin
#   aarch64   gcc-aarch64-linux-gnu libc6-dev-arm64-cross qemu-user-static
#   musl      musl-tools
#   windows   gcc-mingw-w64-x86-64 wine64
#   wasm      clang wasi-libc nodejs
#
# PLATFORMS_OPT: level of optimisation, unless given 0, and 1 for aarch64: a solve that takes more than 100 s in qemu without optimisation takes
# 25 s then, and the build two minutes longer. PLATFORMS_SECONDS: how long one test may take.
set -eu
mkdir -p "$1"
build=$(cd "$1" && pwd)
shift
[ $# -gt 0 ] || set -- aarch64 musl windows wasm macos
here=$(pwd)
work=$build/platforms
target=$build/platforms_target
seconds=${PLATFORMS_SECONDS:-300}
sysroot=$(rustc --print sysroot)
failed=0
mkdir -p "$work"

export CARGO_TARGET_DIR="$target" CARGO_PROFILE_DEV_DEBUG=false
export CARGO_PROFILE_DEV_DEBUG_ASSERTIONS=false CARGO_PROFILE_DEV_OVERFLOW_CHECKS=false
export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=aarch64-linux-gnu-gcc CARGO_TARGET_X86_64_UNKNOWN_LINUX_MUSL_LINKER=musl-gcc

# All of these words, programs and targets of Rust, or one line that says what is missing.
have() {
    platform=$1
    shift
    for what in "$@"; do
        case $what in
        *-*-*-gnu | *-musl | *-wasip1 | *-darwin) [ -d "$sysroot/lib/rustlib/$what" ] || missing="the target $what of Rust" ;;
        *) command -v "$what" > /dev/null || missing=$what ;;
        esac
        [ -z "${missing:-}" ] || {
            echo "left out: $platform: no $missing here"
            missing=""
            return 1
        }
    done
}

library() { # TARGET CRATE-TYPES
    echo "== $1"
    case $1 in aarch64-*linux*) level=1 ;; *) level=0 ;; esac
    CARGO_PROFILE_DEV_OPT_LEVEL=${PLATFORMS_OPT:-$level} cargo rustc --quiet --locked --package switchback-capi --lib --target "$1" --no-default-features --features allocator --crate-type "$2"
}

# COMPILE and RUN are functions: of a source and a program, of a program. SKIP are tests that the platform cannot have.
tests() { # PLATFORM SKIP
    out=$work/$1
    rm -rf "$out"
    mkdir -p "$out"
    passed=0
    for source in capi_tests/test_*.c; do
        name=$(basename "$source" .c)
        case " $2 " in *" $name "*) continue ;; esac
        if ! "compile_$1" "$source" "$out/$name" > "$out/$name.log" 2>&1; then
            echo "$1: $name: not compiled: $(grep -m 1 -E 'error|undefined' "$out/$name.log" || true)"
            failed=1
        elif timeout "$seconds" "run_$1.sh" "$out/$name" > "$out/$name.out" 2>&1; then
            passed=$((passed + 1))
        else
            code=$?
            # 124 is that of `timeout`
            [ $code = 124 ] && echo "$1: $name: not done after $seconds s" || echo "$1: $name: ended with $code: $(head -n 1 "$out/$name.out")"
            failed=1
        fi
    done
    echo "$1: $passed programs of C passed${2:+; left out: $2}"
}

# Programs that run a program of a platform, since `timeout` takes no function.
PATH=$work/bin:$PATH
runner() { # PLATFORM COMMANDS
    mkdir -p "$work/bin"
    printf '#!/bin/sh\n%s\n' "$2" > "$work/bin/run_$1.sh"
    chmod +x "$work/bin/run_$1.sh"
}

compile_aarch64() {
    aarch64-linux-gnu-gcc -std=gnu99 -O1 -Iinclude "$1" -o "$2" \
        "$target/aarch64-unknown-linux-gnu/debug/libswitchback.a" -lpthread -ldl -lm
}

# Threads of musl have a stack of 128 KB unless the program says more.
compile_musl() {
    musl-gcc -static -std=gnu99 -O1 -Wl,-z,stack-size=2097152 -Iinclude "$1" -o "$2" \
        "$target/x86_64-unknown-linux-musl/debug/libswitchback.a" \
        "$sysroot/lib/rustlib/x86_64-unknown-linux-musl/lib/self-contained/libunwind.a" -lm
}

compile_windows() {
    x86_64-w64-mingw32-gcc-posix -std=c99 -O1 -D__USE_MINGW_ANSI_STDIO=1 -Iinclude "$1" -o "$2.exe" \
        "$target/x86_64-pc-windows-gnu/debug/libswitchback.dll.a" -static -lpthread -lm
}

# The C library for WASI that comes with Rust is the one that is linked; that of the system has the headers.
compile_wasm() {
    rust=$sysroot/lib/rustlib/wasm32-wasip1/lib/self-contained
    "$clang" --target=wasm32-wasi --sysroot=/usr -isystem /usr/include/wasm32-wasi -std=c99 -O1 -Iinclude -c "$1" -o "$2.o"
    "$sysroot"/lib/rustlib/*/bin/rust-lld -flavor wasm "$rust/crt1-command.o" "$2.o" \
        "$target/wasm32-wasip1/debug/libswitchback.a" "$rust/libc.a" --stack-first -z stack-size=8388608 -o "$2"
}

for platform in "$@"; do
    case $platform in
    aarch64)
        have aarch64 aarch64-unknown-linux-gnu aarch64-linux-gnu-gcc qemu-aarch64-static || continue
        library aarch64-unknown-linux-gnu cdylib,staticlib
        runner aarch64 'exec qemu-aarch64-static -L /usr/aarch64-linux-gnu "$1"'
        tests aarch64 ""
        ;;
    musl)
        have musl x86_64-unknown-linux-musl musl-gcc || continue
        # Debian has no libgcc_s of musl, which a shared library needs
        library x86_64-unknown-linux-musl staticlib
        runner musl 'exec "$1"'
        # the text of a refusal where nothing can be loaded
        tests musl "test_casadi"
        ;;
    windows)
        have windows x86_64-pc-windows-gnu x86_64-w64-mingw32-gcc-posix || continue
        library x86_64-pc-windows-gnu cdylib,staticlib
        wine=$(command -v wine64 || ls /usr/lib/wine/wine64 2> /dev/null || true)
        if [ -n "$wine" ]; then
            # Rust asks this library for random numbers; Wine has it from version 9 on.
            mkdir -p "$work/dll"
            cp "$target/x86_64-pc-windows-gnu/debug/switchback.dll" "$work/dll/"
            if ! ls /usr/lib/x86_64-linux-gnu/wine/x86_64-windows/bcryptprimitives.dll > /dev/null 2>&1; then
                printf '%s\n' '#include <windows.h>' 'BOOLEAN NTAPI SystemFunction036(PVOID, ULONG);' \
                    '__declspec(dllexport) BOOL WINAPI ProcessPrng(PBYTE p, SIZE_T n) { return SystemFunction036(p, (ULONG)n); }' |
                    x86_64-w64-mingw32-gcc-posix -x c - -shared -o "$work/dll/bcryptprimitives.dll" -ladvapi32
            fi
            # not in this tree: its folder has a link to the root of the file system, which cargo would follow
            prefix=$(mktemp -d)
            trap 'rm -rf "$prefix"' EXIT
            runner windows "export WINEPREFIX=$prefix WINEDEBUG=-all WINEPATH=$work/dll
exec $wine \"\$1.exe\""
            # processes that fork, and signals
            tests windows "test_handles"
        else
            echo "left out: tests on Windows: no wine64 here"
        fi
        if [ -x "$build/venv/bin/python" ]; then
            (cd bindings/python && SWITCHBACK_LIBRARY="$target/x86_64-pc-windows-gnu/debug/switchback.dll" \
                "$build/venv/bin/python" setup.py --quiet bdist_wheel --plat-name win_amd64 --dist-dir "$work/wheel" \
                > "$work/wheel.log" 2>&1 && rm -rf build switchback_control.egg-info src/switchback_control.egg-info)
            rm -rf "$work/unpacked"
            python3 -m zipfile -e "$work"/wheel/*win_amd64.whl "$work/unpacked"
            cmp "$work/unpacked/switchback_control/switchback.dll" "$target/x86_64-pc-windows-gnu/debug/switchback.dll"
            echo "windows: $(ls "$work"/wheel) has the library just built; left out: running it: no Python for Windows here"
        else
            echo "left out: the wheel for Windows: make deps makes the environment of Python for it"
        fi
        ;;
    wasm)
        clang=$(ls /usr/bin/clang /usr/bin/clang-[0-9]* 2> /dev/null | head -n 1)
        have wasm wasm32-wasip1 "${clang:-clang}" node || continue
        library wasm32-wasip1 cdylib,staticlib
        runner wasm "exec node --no-warnings $here/scripts/run_wasi.mjs \"\$1\""
        # threads; sizes of pointers of 8 bytes; libraries that are loaded
        tests wasm "test_border test_callbacks test_errors test_event test_handles test_mpcc_report test_nmpc_worker test_layout test_casadi"
        ;;
    macos)
        for t in x86_64-apple-darwin aarch64-apple-darwin; do
            have macos "$t" || continue
            echo "== $t"
            cargo check --quiet --locked --lib --target "$t"
            cargo check --quiet --locked --lib --target "$t" --no-default-features --features allocator
            echo "macos: $t compiles with SuiteSparse and without; left out: linking and running: no macOS here"
        done
        ;;
    *)
        echo "no platform $platform: aarch64, musl, windows, wasm, macos"
        exit 1
        ;;
    esac
done
exit $failed
