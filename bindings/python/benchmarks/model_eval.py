"""Ways to evaluate a model: the library's tapes and C code, callbacks, CasADi's virtual machine and its C code.

    python model_eval.py --report target/release/examples/report [--json FILE] [--plot FILE] [--folder DIR]

Writes the models of the report `model-eval` with CasADi into a folder, as C code compiled with -O2 and as files for the
virtual machine, then runs the report, which times all ways in one process through one interface. Prints its table;
`--json` keeps the figures, `--plot` draws them.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import casadi as ca

from switchback_control import casadi as bridge

WAYS = ["callback", "own C", "CasADi C", "tape", "batch", "CasADi VM"]
KINDS = ["value_ns", "jacobian_ns", "hessian_ns"]


def models() -> dict[str, list[tuple[list[tuple[str, ca.SX]], ca.SX]]]:
    """Inputs and value of every function, in the order smooth part, modes and switching function of each subsystem."""
    x2, x4, x6 = (ca.SX.sym("x", n) for n in (2, 4, 6))
    u, t = ca.SX.sym("u", 2), ca.SX.sym("t")
    turn = 2 * ca.pi
    of = {n: [("x", x)] for n, x in ((2, x2), (4, x4), (6, x6))}

    def sides(n: int, force: float) -> tuple[list[tuple[str, ca.SX]], ca.SX]:
        return of[n], ca.SX([[-force, force]])

    q, v = x6[:3], x6[3:]
    springs = ca.vertcat(q[1] - 2 * q[0], q[0] - 2 * q[1] + q[2], q[1] - q[2])
    b, d = 0.5 * ca.cos(x4[1]), 0.4
    mass = ca.vertcat(ca.horzcat(1.2 + 2 * b, d + b), ca.horzcat(d + b, d))
    swirl = 0.5 * ca.sin(x4[1])
    lower = 2 * ca.sin(x4[0] + x4[1])
    force = ca.vertcat(
        swirl * (2 * x4[2] * x4[3] + x4[3] ** 2) - (6 * ca.sin(x4[0]) + lower), -swirl * x4[2] ** 2 - lower
    )
    friction = [ca.solve(mass, ca.DM(e)) * 0.2 for e in ([1, 0], [0, 1])]
    return {
        "oscillator": [
            (of[2], x2),
            (of[2], ca.horzcat(*(s * turn * ca.vertcat(-x2[1], x2[0]) for s in (1, -1)))),
            (of[2], ca.sumsqr(x2) - 1),
        ],
        "sliding_mode": [
            ([("x", x4), ("u", u)], ca.vertcat(x4[2:], u)),
            sides(4, 1.0),
            (of[4], x4[0] + 0.15 * x4[1] ** 2),
            sides(4, 1.0),
            (of[4], x4[1] - 0.05 * x4[0] ** 3),
        ],
        "blocks": [(of[6], ca.vertcat(v, springs - v))]
        + [part for k in range(3) for part in (sides(6, 0.3), (of[6], v[k]))],
        "coulomb": [
            ([("x", x2), ("t", t)], ca.vertcat(x2[1], ca.cos(0.5 * t) - x2[0])),
            sides(2, 0.4),
            (of[2], x2[1]),
        ],
        "stick_slip": [
            (of[2], ca.vertcat(x2[1], -x2[0])),
            (of[2], ca.horzcat(-1 / (0.8 + x2[1]), 1 / (1.2 - x2[1]))),
            (of[2], x2[1] - 0.2),
        ],
        "arm": [(of[4], ca.vertcat(x4[2:], ca.solve(mass, force)))]
        + [part for k in range(2) for part in ((of[4], ca.horzcat(-friction[k], friction[k])), (of[4], x4[2 + k]))],
    }


def write(folder: Path) -> None:
    """The files that the report reads."""
    generator = ca.CodeGenerator("models")
    for model, functions in models().items():
        for k, (inputs, value) in enumerate(functions):
            names, symbols = zip(*inputs)
            f = ca.Function(f"{model}_{k}", list(symbols), [value], list(names), ["y"])
            bundle = bridge._with_derivatives([f], None, smooth=False)[0]
            for part in bundle:
                generator.add(part)
            serializer = ca.FileSerializer(str(folder / f"{f.name()}.casadi"))
            serializer.pack(bundle)
            del serializer
    generator.generate(f"{folder}/")
    (folder / "library.txt").write_text(bridge._casadi_library())
    command = ["cc", "-O2", "-fPIC", "-shared", "-o", folder / "models.so", folder / "models.c", "-lm"]
    subprocess.run(command, check=True)


def table(records: list[dict]) -> str:
    """Nanoseconds by model and way; solves as ratios to the tape."""
    lines = [f"{'model':14}{'way':11}{'value':>7}{'Jacobian':>10}{'Hessian':>9}{'sum':>7}{'solve':>8}"]
    for r in records:
        if "way" not in r:
            continue
        times = [r[k] for k in KINDS] if KINDS[0] in r else None
        numbers = "".join(f"{v:{w}.0f}" for v, w in zip([*times, sum(times)], (7, 10, 9, 7))) if times else " " * 33
        ratio = f"{r['solve_ratio']:8.3f}" if "solve_ratio" in r else ""
        lines.append(f"{r['model']:14}{r['way']:11}{numbers}{ratio}".rstrip())
    shares = [f"{r['model']} {100 * r['evaluation_share']:.1f} %" for r in records if "evaluation_share" in r]
    return "\n".join(lines) + "\n\nevaluation of tapes in a simulation: " + ", ".join(shares)


def plot(records: list[dict], path: Path) -> None:
    """Bars of the sums, by model and way."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    sums = {(r["model"], r["way"]): [r[k] for k in KINDS] for r in records if KINDS[0] in r}
    names = list(dict.fromkeys(model for model, _ in sums))
    ways = [way for way in WAYS if any(key[1] == way for key in sums)]
    figure, axes = pyplot.subplots(figsize=(9, 4))
    width = 0.8 / len(ways)
    for k, way in enumerate(ways):
        places = [i + (k - (len(ways) - 1) / 2) * width for i in range(len(names))]
        axes.bar(places, [sum(sums.get((name, way), [float("nan")])) for name in names], width, label=way)
    axes.set_xticks(range(len(names)), names)
    axes.set_yscale("log")
    axes.set_ylabel("values, Jacobians and Hessians [ns per point]")
    axes.grid(axis="y", alpha=0.3)
    axes.legend(ncol=3, fontsize="small")
    figure.tight_layout()
    figure.savefig(path, metadata={"Date": None})


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--report", type=Path, help="the built example `report`")
    parser.add_argument("--folder", type=Path, help="keep the files of CasADi here")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--plot", type=Path)
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.folder or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        write(folder)
        if options.report is None:
            return 0
        command = [options.report, "model-eval", "--json", "--casadi", folder]
        output = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout
    records = [json.loads(line) for line in output.splitlines()]
    print(table(records))
    if options.json:
        options.json.write_text(output)
    if options.plot:
        plot(records, options.plot)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
