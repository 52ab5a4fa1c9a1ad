"""Hybrid systems with algebraic equations next to SUNDIALS IDAS, with the logic of the modes written by hand.

The systems are those of `tests/test_algebraic.py`: circuits with diodes and relays, hydraulics, machines, a grid. Their modes are made into C by
CasADi, residuals with exact Jacobians, and `dae_idas.c` follows them with IDAS. The reference is SciPy's DOP853 at 1e-11 with Newton's method for
the algebraic states.

    python dae_idas.py --sundials FOLDER [--rtol 1e-8] [--runs 20] [--json FILE] [NAME ...]
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import switchback_control as swb

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tests"))
import test_algebraic as problems  # noqa: E402


def generate(problem: Any, folder: Path) -> None:
    """Functions of all modes as C, and the table of the modes."""
    hand = problem.hand
    nx, nz, names = hand.nx, hand.nz, list(hand.rates)
    y, yp, t, c = ca.SX.sym("y", nx + nz), ca.SX.sym("yp", nx + nz), ca.SX.sym("t"), ca.SX.sym("c")
    x, z = y[:nx], y[nx:]
    code = ca.CodeGenerator("modes.c", {"with_header": True})
    rows, unused = [], ca.SX.sym("unused")
    for k, name in enumerate(names):
        rate, (alg, jac) = hand.rates[name](x, z, t), hand.equations[name](x, z, t)
        residual = ca.vertcat(rate - yp[:nx], alg)
        exits = hand.exits.get(name, [])
        guards = ca.vertcat(*[g(x, z, t) for g in hand.guards[name]])
        full = ca.densify(ca.jacobian(residual, y) + c * ca.jacobian(residual, yp))
        made = {
            "F": ([y, yp, t], residual),
            "J": ([y, yp, t, c], full),
            "X": ([y, unused, t], ca.vertcat(rate, ca.solve(jac, -(ca.jtimes(alg, x, rate) + ca.jacobian(alg, t))))),
            "S": ([y, unused, t], ca.solve(jac, -alg) if nz else ca.SX(0)),
        }
        if exits:
            made["G"] = ([y, unused, t], guards)
        resets = []
        for j, reset in enumerate(hand.resets[name]):
            resets.append(f"R{j}_{k}" if reset else "NULL")
            if reset:
                made[f"R{j}"] = ([y, unused, t], reset(x, z))
        for letter, (inputs, output) in made.items():
            code.add(ca.Function(f"{letter}_{k}", inputs, [ca.densify(output)]))
        guess = next((v for start, v in hand.guess.items() if name.startswith(start)), None)
        if guess is not None:
            rows.insert(0, f"static const double guess_{k}[] = {{{', '.join(map(repr, map(float, guess)))}}};")
        following = ", ".join(str(names.index(e[1])) for e in exits)
        rows.append(
            f"    {{F_{k}, J_{k}, X_{k}, S_{k}, {f'G_{k}' if exits else 'NULL'}, {len(exits)}, {{{following or 0}}}, "
            f"{{{', '.join(resets) or 'NULL'}}}, {f'guess_{k}' if guess is not None else 'NULL'}}},"
        )
    code.generate(f"{folder}/")
    most = max(1, max(len(hand.exits.get(n, [])) for n in names))
    guesses, table = [r for r in rows if r.startswith("static")], [r for r in rows if not r.startswith("static")]
    start = [*problem.x0, *problem.z0]
    text = [
        '#include "modes.h"',
        "typedef int (*function)(const double **, double **, long long *, double *, int);",
        f"enum {{ N_X = {nx}, N_Z = {nz}, MAX_GUARDS = {most}, FIRST = {names.index(problem.start)} }};",
        f"static const double END = {float(problem.end)!r};",
        f"static const double START[] = {{{', '.join(map(repr, map(float, start)))}}};",
        "struct mode {",
        "    function residual, jacobian, rates, step, guards;",
        "    int n_guards, next[MAX_GUARDS];",
        "    function resets[MAX_GUARDS];",
        "    const double *guess;",
        "};",
        *guesses,
        "static const struct mode modes[] = {",
        *table,
        "};",
    ]
    (folder / "table.h").write_text("\n".join(text) + "\n")


def idas(problem: Any, sundials: Path, rtol: float, runs: int) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        generate(problem, folder)
        found = next(sundials.rglob("libsundials_idas.a")).parent
        include = next(sundials.rglob("idas/idas.h")).parents[1]
        parts = ["idas", "nvecserial", "sunmatrixdense", "sunlinsoldense"]
        libraries = [str(p) for part in [*parts, "core"] for p in found.glob(f"libsundials_{part}.a")]
        command = ["gcc", "-O3", f"-I{folder}", f"-I{include}", str(HERE / "dae_idas.c"), f"{folder}/modes.c", *libraries, *libraries, "-lm"]
        subprocess.run([*command, "-o", f"{folder}/run"], check=True)
        done = subprocess.run([f"{folder}/run", repr(rtol), str(runs)], capture_output=True, text=True)
        return json.loads(done.stdout) if done.returncode == 0 else {"error": f"{done.returncode}: {done.stderr}"}


def ours(problem: Any, rtol: float, runs: int) -> dict[str, Any]:
    start = [*problem.x0, *problem.z0]
    best = np.inf
    with swb.Integrator(problem.model, rtol=rtol, atol=1e-2 * rtol) as i:
        begin = i.system._start(start, "x0")
        for _ in range(runs):
            before = time.perf_counter()
            i.reinit(begin)
            i.advance(problem.end)
            best = min(best, time.perf_counter() - before)
        run = i.run
        found = [s.t for s in run.switches] + [j.t for j in run.jumps]
        times = sorted({round(t, 9) for t in found if t not in problem.skip})
        return {"microseconds": 1e6 * best, "x": list(i.state[: problem.hand.nx + problem.hand.nz]), "events": times}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="systems, all of them if there are none")
    parser.add_argument("--sundials", type=Path, default=Path("build/sundials"), help="folder with SUNDIALS")
    parser.add_argument("--rtol", type=float, default=1e-8)
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--json", type=Path, help="write what was found to this file")
    a = parser.parse_args()
    print("errors relative to rtol: of states relative to the largest one or 1, of events relative to the length of the run")
    print("'as good' is IDAS with the first of rtol / 10, / 100, / 1000 whose errors are not larger than ours, or else with the last of them")
    print(f"{'':18}  {'ours':27}{'IDAS':36}{'as good':16}")
    print(f"{'system':18}{'events':>7}{'state':>9}{'times':>9}{'us':>7}{'state':>9}{'times':>9}{'us':>8}{'ratio':>7}{'us':>8}{'ratio':>7}")
    rows, good = [], True
    for name in a.names or problems.ALL:
        q = problems.ALL[name]()
        x, z, events = q.hand.run(q.start, q.x0, q.z0, q.end)
        exact = np.concatenate([x, z])

        def errors(r: dict[str, Any]) -> tuple[float, float]:
            if "error" in r or len(r["events"]) != len(events):
                return np.inf, np.inf
            state = np.abs(np.array(r["x"]) - exact).max() / max(1, np.abs(exact).max())
            return state / a.rtol, np.abs(np.subtract(r["events"], events)).max(initial=0) / q.end / a.rtol

        own, other = ours(q, a.rtol, a.runs), idas(q, a.sundials, a.rtol, a.runs)
        (s1, t1), (s2, t2) = errors(own), errors(other)
        fine = other
        for share in (1, 10, 100, 1000):
            fine = idas(q, a.sundials, a.rtol / share, a.runs) if share > 1 else other
            if max(errors(fine)) <= max(s1, t1):
                break
        time_of = lambda r: r.get("microseconds", np.nan)  # noqa: E731
        ratios = [own["microseconds"] / time_of(r) for r in (other, fine)]
        good &= s1 <= 100 and t1 <= 100
        rows.append({"system": name, "events": len(events), "errors": [s1, t1, s2, t2], "ours": own, "idas": other, "as good": fine, "ratios": ratios})
        print(
            f"{name:18}{len(events):7}{s1:9.2g}{t1:9.2g}{own['microseconds']:7.0f}{s2:9.2g}{t2:9.2g}{time_of(other):8.0f}{ratios[0]:7.2f}"
            f"{time_of(fine):8.0f}{ratios[1]:7.2f}",
            flush=True,
        )
    for k, what in enumerate(("at one rtol", "as good")):
        all_ = np.array([r["ratios"][k] for r in rows])
        known = all_[np.isfinite(all_)]
        print(f"{what}: geometric mean of the ratios {np.exp(np.log(known).mean()):.2f}, largest {known.max():.2f}, {len(all_) - len(known)} without")
    if a.json:
        a.json.write_text(json.dumps(rows, indent=1, default=float) + "\n")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
