"""Controllers and estimators as C files: code, memory, and instructions on emulated processors.

usage: nmpc_c.py [--out FILE] [--folder FOLDER]

Every one is written by `write_c`, compiled without an operating system in mind, and repeats its recorded loop: on this machine, by qemu-aarch64, and by
qemu-system-arm on a Cortex-M4 with a unit for single precision (board mps2-an386). Programs that are not installed are left out. Debian: qemu-user,
gcc-aarch64-linux-gnu, libc6-dev-arm64-cross, qemu-system-arm, gcc-arm-none-eabi, libnewlib-arm-none-eabi. Instructions are counted by the emulator, one of
them a nanosecond of its clock: a processor needs some more cycles.
"""

from __future__ import annotations

import argparse
import datetime
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import switchback_control as swb

ROOT = Path(__file__).resolve().parents[3]
sys.path[:0] = [str(ROOT / "examples/python"), str(ROOT / "bindings/python/benchmarks")]
import diesel  # noqa: E402
from nmpc_loops import Tracking  # noqa: E402

M4 = ["-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"]

START = """
#include <stdint.h>
extern int _start(void);
void _init(void) {}
void _fini(void) {}
void reset(void) {
    *(volatile uint32_t *)0xE000ED88 |= 0xFu << 20; /* the unit for single precision */
    __asm volatile("dsb\\n isb");
    *(volatile uint32_t *)0xE000E014 = 0xFFFFFF; /* the timer of the system, 25 MHz */
    *(volatile uint32_t *)0xE000E018 = 0;
    *(volatile uint32_t *)0xE000E010 = 5;
    _start();
    for (;;) {}
}
static void hang(void) { for (;;) {} }
__attribute__((section(".vectors"), used)) void *const vectors[16] = {(void *)0x203ffff0, reset, hang, hang, hang, hang, hang, 0,
    0, 0, 0, hang, hang, 0, hang, hang};
uint32_t ticks(void) { return *(volatile uint32_t *)0xE000E018; }
"""

LINK = """
MEMORY { FLASH (rx) : ORIGIN = 0, LENGTH = 4M  RAM (rwx) : ORIGIN = 0x20000000, LENGTH = 4M }
ENTRY(reset)
SECTIONS {
  .text : { KEEP(*(.vectors)) *(.text*) KEEP(*(.init)) KEEP(*(.fini)) *(.rodata*) } > FLASH
  .ARM.exidx : { __exidx_start = .; *(.ARM.exidx*) __exidx_end = .; } > FLASH
  .data : { *(.data*) . = ALIGN(8); __preinit_array_start = .; __preinit_array_end = .; __init_array_start = .; KEEP(*(.init_array*))
    __init_array_end = .; __fini_array_start = .; __fini_array_end = .; } > RAM
  .bss : { __bss_start__ = .; *(.bss*) *(COMMON) . = ALIGN(8); __bss_end__ = .; } > RAM
  end = .; __end__ = .; _end = .;
  __stack = 0x203ffff0; PROVIDE(__HeapLimit = 0x20380000);
}
"""

MAIN = """
#include "unit.h"
#include "unit_record.h"
#include <stdint.h>
#include <stdio.h>
uint32_t ticks(void);
static uint32_t since(uint32_t t) { return (t - ticks()) & 0xFFFFFF; }
int main(void) {
    uint32_t sum[2] = {0, 0}, most[2] = {0, 0};
    int k, i, other = 0;
    for (k = 0; k < SAMPLES; k++) {
        unit_real out[64];
        uint32_t d[2], t = ticks();
        PREPARE;
        d[0] = since(t);
        t = ticks();
        other += FEEDBACK != RECORD_SOURCE[k];
        d[1] = since(t);
        for (i = 0; i < 2; i++) {
            sum[i] += d[i];
            most[i] = d[i] > most[i] ? d[i] : most[i];
        }
    }
    printf("%d %lu %lu %lu %lu\\n", other, (unsigned long)(sum[0] / SAMPLES), (unsigned long)most[0], (unsigned long)(sum[1] / SAMPLES), (unsigned long)most[1]);
    return 0;
}
"""


def arm():
    m = swb.Model(states="angle speed", controls="torque", name="arm")
    m.derivatives = [m.speed, m.torque - swb.sin(m.angle) - 0.1 * m.speed]
    ocp = swb.Ocp(m, 2.0, 20, rk_family="explicit", n_s=4, n_fe=1, control_bounds=(-1.5, 1.5))
    ocp.add_least_squares(m.function([m.angle, m.speed, m.torque]), [1, 0.1, 0.05], [1.0, 0, 0])
    ocp.add_least_squares(m.function([m.angle, m.speed]), [10, 1], [1.0, 0], at="terminal")
    ocp.set_state_bounds([-2, -0.8], [2, 0.8])
    c = swb.Nmpc(ocp, "rti", shift=True, qp_solver="stagewise")
    c.initialise([0.0, 0.0])
    return c


def tracking(name):
    p = Tracking(name)
    c = swb.Nmpc(p.ocp(), "rti", qp_solver="stagewise", shift=True)
    c.initialise(p.x0, 200)
    return c


def quadrotor(n=20):
    """Position, velocity, angles, rates; thrust and three torques, past a column."""
    m = swb.Model(12, 4, name="quadrotor")
    (phi, theta, psi), (p, q, r) = m.x[6:9], m.x[9:12]
    s, c, f = swb.sin, swb.cos, 9.81 + m.u[0]
    m.derivatives = [
        *m.x[3:6],
        f * (c(phi) * s(theta) * c(psi) + s(phi) * s(psi)), f * (c(phi) * s(theta) * s(psi) - s(phi) * c(psi)), f * c(phi) * c(theta) - 9.81,
        p + (q * s(phi) + r * c(phi)) * s(theta) / c(theta), q * c(phi) - r * s(phi), (q * s(phi) + r * c(phi)) / c(theta),
        m.u[1] - 0.3 * q * r, m.u[2] + 0.3 * p * r, m.u[3],
    ]
    ocp = swb.Ocp(m, 0.1 * n, n, rk_family="explicit", n_s=4, n_fe=1, control_bounds=([-5, -8, -8, -2], [5, 8, 8, 2]))
    ocp.add_least_squares(m.function([*m.x, *m.u]), [4, 4, 4, 1, 1, 1, 0.5, 0.5, 2, 0.1, 0.1, 0.1, 0.05, 0.02, 0.02, 0.02], np.zeros(16))
    ocp.add_least_squares(m.function(list(m.x)), [40, 40, 40, 8, 8, 8, 4, 4, 8, 1, 1, 1], np.zeros(12), at="terminal")
    free = [np.inf] * 6
    ocp.set_state_bounds([-v for v in free] + [-0.7, -0.7] + [-np.inf] * 4, free + [0.7, 0.7] + [np.inf] * 4)
    ocp.add_relaxed(m.function([(m.x[0] + 1) ** 2 + (m.x[1] - 0.1) ** 2]), [0.16], [np.inf], at="control_grid", norm="l1", weight=500.0)
    controller = swb.Nmpc(ocp, "rti", shift=True, qp_solver="stagewise")
    controller.initialise([-2.0, 0.3, 0.5, *[0.0] * 9])
    return controller


def generator(n=40):
    """The diesel generator, with explicit steps that its fastest time constant of 9 ms allows."""
    for name, load in diesel.LOADS.items():
        diesel.STEADY_INPUTS[name] = tuple(diesel.steady(load)[1])
    x, u = diesel.steady(diesel.LOADS["start"])
    ocp = diesel.problem(n)
    ocp.set_state_guess([0.0], [x])
    ocp.set_control_guess(np.tile(u, (n, 1)))
    ocp.set_params([*diesel.LOADS["start"], *u])
    c = swb.Nmpc(ocp, "rti", shift=True, qp_solver="stagewise", rk_family="explicit", n_s=4, steps=20)
    c.initialise(x)
    return c


def friction():
    """Angle, speed and a constant friction of a pendulum, with a bound of the speed."""
    m = swb.Model(3, 1, name="friction")
    m.derivatives = [m.x[1], m.u[0] - 2 * swb.sin(m.x[0]) - m.x[2] * m.x[1], 0.0]
    ocp = swb.Ocp(m, 1.2, 12)
    ocp.set_initial_state([0.3, 0.0, 0.1])
    ocp.set_state_bounds([-4, -0.35, -1], [4, 0.35, 1])
    seen = m.function([swb.sin(m.x[0]), m.x[1]])
    return swb.Mhe(ocp, seen, initial=[0.3, 0.3, 0.1], process=[0.01, 0.1, 0.002], measurement=[0.02, 0.1], rk_family="explicit", n_s=4)


PROBLEMS = {
    "arm, N = 20": arm,
    "pendulum, N = 40": lambda: tracking("pendulum"),
    "chain3, N = 40": lambda: tracking("chain3"),
    "quadrotor, N = 20": quadrotor,
    "diesel, N = 40": generator,
    "estimator, N = 12": friction,
}


def run(folder, *command):
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{command}: {done.stdout}{done.stderr}")
    return done.stdout


def size(folder, program, file):
    text, data, bss = run(folder, program, file).split("\n")[1].split()[:3]
    return int(text) + int(data), int(bss)


def says(text):
    return float(re.search(r"difference (\S+) of", text)[1])


def microcontroller(folder, estimator):
    """Instructions of both phases on a Cortex-M4: mean and most, other sources; code and memory."""
    for name, text in (("start.c", START), ("link.ld", LINK), ("m4.c", MAIN)):
        (folder / name).write_text(text)
    calls = (
        ["-DPREPARE=if(k>0)unit_prepare(&RECORD_U[k*unit_nu])", "-DFEEDBACK=unit_estimate(&RECORD_Y[k*unit_ny],out)"]
        if estimator
        else ["-DPREPARE=unit_prepare()", "-DFEEDBACK=unit_feedback(&RECORD_X[k*unit_nx],out)"]
    )
    cc = ["arm-none-eabi-gcc", *M4, "-O2", "-ffp-contract=off"]
    run(folder, *cc, "-std=c99", "-Wall", "-Werror", "-c", "unit.c", "-o", "m4.o")
    crt = run(folder, *cc, "-print-file-name=rdimon-crt0.o").strip()
    run(folder, *cc, *calls, "start.c", "m4.c", "m4.o", crt, "--specs=rdimon.specs", "-nostartfiles", "-T", "link.ld", "-lm", "-o", "m4.elf")
    out = run(folder, "qemu-system-arm", "-M", "mps2-an386", "-nographic", "-icount", "shift=0", "-semihosting-config", "enable=on,target=native", "-kernel", "m4.elf")
    other, *ticks = (int(v) for v in out.split())
    # 25 MHz of a clock on which an instruction is a nanosecond
    return [40 * t / 1000 for t in ticks], other, size(folder, "arm-none-eabi-size", "m4.o")


def line(name, make, precision, folder):
    estimator = "estimator" in name
    with make() as c:
        c.write_c(folder, "unit", precision)
    run(folder, "make", "-s", "unit_main")
    # what single precision makes of it is said, not asked for
    off = says(subprocess.run(["./unit_main"], cwd=folder, capture_output=True, text=True).stdout)
    text, ram = size(folder, "size", "unit.o")
    out = f"{name:18} {precision:6} {text / 1e3:6.1f} {ram / 1e3:7.1f} {off:8.1e}"
    if shutil.which("qemu-aarch64") and shutil.which("aarch64-linux-gnu-gcc"):
        run(folder, "make", "-s", "clean")
        run(folder, "make", "-s", "unit_main", "CC=aarch64-linux-gnu-gcc")
        out += f" {says(subprocess.run(['qemu-aarch64', '-L', '/usr/aarch64-linux-gnu', './unit_main'], cwd=folder, capture_output=True, text=True).stdout):8.1e}"
    else:
        out += f" {'-':>8}"
    if precision == "float" and shutil.which("qemu-system-arm") and shutil.which("arm-none-eabi-gcc"):
        t, other, (text, _) = microcontroller(folder, estimator)
        out += f" {text / 1e3:6.1f} {t[0]:9.1f} {t[1]:9.1f} {t[2]:9.1f} {t[3]:9.1f} {other:5}"
    print(out, flush=True)
    return out


PAGE = """# Controllers and estimators as C files

| date | machine | command |
|---|---|---|
| {date} | one core of a shared machine | `bindings/python/benchmarks/nmpc_c.py` |

Every file repeats its recorded loop. "Text" is code with its constants, "RAM" all memory, in kB, of gcc with `-O2`. "Off" is the largest difference to the library, relative to
the largest control or state: on this machine, and by qemu on a Cortex-A53 (aarch64). Instructions are thousands on a Cortex-M4 with a unit for single precision, as qemu counts them: mean and most of
preparation and feedback. The processor needs some more cycles. "Other" counts samples whose control has another source than in the library.

```
{table}
```

Single precision is not enough for the pendulum: over two seconds upright the plant multiplies what rounding changes by ten thousand. Double precision is slow on this
processor, which has no unit for it.

`nm` finds no functions but those of the mathematical library, `memcpy` and `memset`. All files are compiled with `-std=c99 -Wall -Werror -ffreestanding`.
"""


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "docs/benchmarks/nmpc_c.md")
    parser.add_argument("--folder", type=Path)
    args = parser.parse_args()
    table = [f"{'':25}   this machine             aarch64 Cortex-M4{'prepare':>18}{'feedback':>20}", f"{'':18} {'':6} {'text':>6} {'RAM':>7} {'off':>8} {'off':>8} {'text':>6} {'mean':>9} {'most':>9} {'mean':>9} {'most':>9} other"]
    print("\n".join(table))
    for name, make in PROBLEMS.items():
        for precision in ("double", "float"):
            with tempfile.TemporaryDirectory(dir=args.folder) as folder:
                table.append(line(name, make, precision, Path(folder)))
    args.out.write_text(PAGE.format(date=datetime.date.today().isoformat(), table="\n".join(v.rstrip() for v in table)))


if __name__ == "__main__":
    main()
