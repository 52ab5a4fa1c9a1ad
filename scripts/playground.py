"""usage: playground.py FOLDER    build the playground of the site into FOLDER/playground: the library as a WebAssembly module, and its scripts

The module has the functions that web/switchback.mjs calls, and no others: the linker leaves out what they do not need. interface.mjs is what
include/api.json says of these functions, with sizes and offsets of records for pointers of four bytes. Where the target wasm32-wasip1 of
Rust is missing, nothing is built, and a line says so. PLAYGROUND_OPT: level of optimisation, "s" unless given: with "z" the
README's optimal control problem takes 2.2 times as long, and the module has 0.87 of the size; with "3" 0.93 of the time, and 1.24 times the size.
Where there is a wasm-opt (binaryen), it makes the module a few per cent smaller.
"""

import gzip
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
WEB = ROOT / "web"
TARGET = "wasm32-wasip1"
#: Size and kind of the types of fields; a pointer has four bytes.
KINDS = {"double": (8, "f64"), "int64_t": (8, "i64"), "uint64_t": (8, "u64"), "int32_t": (4, "i32"), "uint32_t": (4, "i32")}


def used() -> set[str]:
    """Names of the library in the module."""
    names = set(re.findall(r"\bswb_\w+", (WEB / "switchback.mjs").read_text(encoding="utf-8")))
    # called as `swb_settings_set_${kind}`
    return names - {"swb_settings_set_"} | {f"swb_settings_set_{kind}" for kind in ("int", "double", "string")}


def layout(record: dict) -> dict:
    """Size and offsets of a record by the rules of C: a field begins at a multiple of its size."""
    offset, largest, fields = 0, 1, {}
    for field in record["fields"]:
        size, kind = (4, "i32") if field["type"]["stars"] else KINDS[field["type"]["base"]]
        offset = -(-offset // size) * size
        fields[field["name"]] = [offset, kind]
        offset, largest = offset + size, max(largest, size)
    return {"size": -(-offset // largest) * largest, "fields": fields}


def interface() -> tuple[str, list[str]]:
    """The module interface.mjs, and the functions in it."""
    api = json.loads((ROOT / "include" / "api.json").read_text(encoding="utf-8"))
    names = used()
    signatures = {
        f["name"]: "".join("l" if not p["type"]["stars"] and p["type"]["base"] in ("int64_t", "uint64_t") else "n" for p in f["parameters"])
        for f in api["functions"]
        if f["name"] in names
    }
    records = {r["name"]: layout(r) for r in api["records"] if r["name"] in names}
    enums = {e["name"]: e["values"] for e in api["enums"] if e["name"] in names}
    prefixes = {name: "SWB_" if name == "swb_status" else f"{name.upper()}_" for name in enums}
    values = {name: {v["name"].removeprefix(prefixes[name]): v["value"] for v in found} for name, found in enums.items()}
    objects = {o["name"] for o in api["objects"]}
    unknown = names - signatures.keys() - records.keys() - enums.keys() - objects
    assert not unknown, f"not in include/api.json: {sorted(unknown)}"
    text = "// Made by scripts/playground.py of include/api.json: functions (l: an integer of 64 bits), records, enumerations.\n"
    for name, value in (("SIGNATURES", signatures), ("RECORDS", records), ("ENUMS", values)):
        text += f"export const {name} = {json.dumps(value, sort_keys=False)};\n"
    return text, sorted(signatures)


def missing(rustc: str | None) -> str:
    """What is not there to build the module with, or nothing."""
    if not rustc or not shutil.which(os.environ.get("CARGO", "cargo")):
        return "Rust"
    sysroot = Path(subprocess.run([rustc, "--print", "sysroot"], check=True, capture_output=True, text=True, cwd=ROOT).stdout.strip())
    return "" if (sysroot / "lib" / "rustlib" / TARGET).is_dir() else f"target {TARGET} of Rust (rustup target add {TARGET})"


def build(folder: Path, exports: list[str], rustc: str) -> Path:
    """The module, linked from the static library."""
    target = folder / "playground_target"
    environment = {
        **os.environ,
        "CARGO_TARGET_DIR": str(target),
        "CARGO_PROFILE_RELEASE_OPT_LEVEL": os.environ.get("PLAYGROUND_OPT", "s"),
        "CARGO_PROFILE_RELEASE_DEBUG": "false",
    }
    command = [os.environ.get("CARGO", "cargo"), "rustc", "--quiet", "--locked", "--package=switchback-capi", "--lib", "--release", "--target", TARGET]
    subprocess.run([*command, "--no-default-features", "--crate-type", "staticlib"], check=True, cwd=ROOT, env=environment)
    rustlib = Path(subprocess.run([rustc, "--print", "target-libdir"], check=True, capture_output=True, text=True, cwd=ROOT).stdout.strip()).parent
    own = rustlib.parent / TARGET / "lib" / "self-contained"
    module = folder / "playground" / "switchback.wasm"
    linker = [str(rustlib / "bin" / "rust-lld"), "-flavor", "wasm", str(own / "crt1-reactor.o")]
    linker += [str(target / TARGET / "release" / "libswitchback.a"), str(own / "libc.a"), "--gc-sections", "--strip-all", "-O2"]
    # the stack comes first, so that its end is a fault and not the end of something else
    linker += ["--stack-first", "-z", "stack-size=8388608", "--entry=_initialize", *(f"--export={n}" for n in [*exports, "malloc", "free"])]
    subprocess.run([*linker, "-o", str(module)], check=True)
    shrink = shutil.which("wasm-opt")
    if shrink:
        # what Rust's target has beyond the first version of WebAssembly
        features = [f"--enable-{f}" for f in ("bulk-memory", "nontrapping-float-to-int", "sign-ext", "mutable-globals")]
        smaller = module.with_suffix(".smaller")
        if subprocess.run([shrink, "-Os", *features, str(module), "-o", str(smaller)]).returncode == 0:
            smaller.replace(module)
        else:
            print("left out: a smaller module for the playground: wasm-opt does not understand this one")
            smaller.unlink(missing_ok=True)
    return module


def main() -> int:
    folder = Path(sys.argv[1]).resolve()
    made = folder / "playground"
    shutil.rmtree(made, ignore_errors=True)
    rustc = shutil.which(os.environ.get("RUSTC", "rustc"))
    lost = missing(rustc)
    if lost:
        print(f"left out: playground: there is no {lost} here")
        return 0
    made.mkdir(parents=True)
    text, exports = interface()
    (made / "interface.mjs").write_text(text, encoding="utf-8")
    for source in [*WEB.glob("*.mjs"), *WEB.glob("*.css")]:
        if not source.name.startswith("test_"):
            shutil.copyfile(source, made / source.name)
    module = build(folder, exports, rustc)
    data = module.read_bytes()
    print(f"playground: {len(exports)} functions, {len(data) / 1e6:.2f} MB, {len(gzip.compress(data, 9)) / 1e6:.2f} MB with gzip: {module}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
