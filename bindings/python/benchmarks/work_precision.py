"""Work against precision on converters and a relay (affine_modes.py): the library, CVODE and SciPy.

The error is the largest one of the states, relative to their usual sizes, at ten times; the reference is made of exponentials
of matrices and shares nothing with any of the three (affine_modes.json, made anew by --reference). CVODE has the modes with
Jacobian, root functions, restarts and the ticks of the clock by hand (affine_modes.c); the library has the circuits as
expressions. "Finds" is the number of times at which modes change, of how many. CPU time, the shortest of several runs, with the
library and CVODE in turns, since a machine is faster at one time than at another; each is called once for all ten times, the library
from Python.

    python work_precision.py [--sundials PREFIX] [--problems buck,boost,relay] [--rounds 4] [--no-scipy] [--plot DIR] [--json FILE]
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import tempfile
import time
from functools import partial
from pathlib import Path

import numpy as np
from affine_modes import PROBLEMS, Problem, model, reference

HERE = Path(__file__).resolve().parent
REFERENCE = HERE / "affine_modes.json"
TOLERANCES = [10.0 ** (-0.5 * e) for e in range(6, 23)]
SCIPY_TOLERANCES = [1e-4, 1e-6, 1e-8]
SMALL = 1e-2  # the absolute tolerance relative to the other one and to the sizes of the states


def library(p: Problem, tol: float) -> tuple[float, int, np.ndarray]:
    import switchback_control as swb

    atol = [SMALL * tol * s for s in p.sizes] + [SMALL * tol] * len(p.extra)
    integrator = swb.Integrator(model(p.name), rtol=tol, atol=atol)
    best, states = math.inf, np.empty(0)
    for _ in range(5):
        integrator.reinit([*p.start, *p.extra])
        clock = time.process_time()
        states = integrator.sample(p.times())
        best = min(best, time.process_time() - clock)
    run = swb.simulate(model(p.name), [*p.start, *p.extra], p.end, rtol=tol, atol=atol)
    times = np.sort([s.t for s in run.switches] + [j.t for j in run.jumps])
    # a transition and the modes it changes are one event, and so are a mode on a surface that is passed through and the next one
    return best, 1 + int(np.count_nonzero(np.diff(times) > 1e-9 * p.end)), states[:, : len(p.start)]


def cvode(peer: str, p: Problem, tol: float) -> tuple[float, int, np.ndarray] | None:
    command = [peer, p.method, repr(tol), repr(p.longest), "5"]
    out = subprocess.run(command, input=p.table(), capture_output=True, text=True)
    if out.returncode:
        return None
    values = out.stdout.split()
    return float(values[0]), int(values[1]), np.array(values[3:], float).reshape(p.checks, -1)


def scipy(p: Problem, tol: float) -> tuple[float, int, np.ndarray]:
    """As a user of `solve_ivp` does it: events that end the integration, and the next mode from there."""
    from scipy.integrate import solve_ivp

    def margin(w, t, x, tick):
        return w.weights @ x + w.constant + w.slope * (t - tick)

    def enter(mode: int, t: float, x: np.ndarray, tick: float) -> int:
        for _ in range(2 * len(p.modes)):
            if p.modes[mode].zero >= 0:
                x[p.modes[mode].zero] = 0.0
            # the location of the event may be on either side of it, by rounding
            size = lambda w: np.abs(w.weights) @ np.abs(x) + abs(w.constant) + abs(w.slope) * (t - tick)  # noqa: E731
            after = next((w.target for w in p.modes[mode].ways if margin(w, t, x, tick) < -1e-12 * size(w)), mode)
            if after == mode:
                break
            mode = after
        return mode

    clock = time.process_time()
    x, t, tick, ticks, switches, states = p.start.copy(), 0.0, 0.0, 0, 0, []
    mode = enter(p.first, t, x, tick)
    for at in p.times():
        while t < at:
            m = p.modes[mode]
            coming = (ticks + 1) * p.period if p.period else math.inf
            stop = min(coming, at)
            events = []
            for w in m.ways:
                event = lambda t, x, w=w, tick=tick: margin(w, t, x, tick)  # noqa: E731
                event.terminal, event.direction = True, -1
                events.append(event)
            jacobian = {"jac": m.a} if p.method == "bdf" else {}
            run = solve_ivp(
                lambda t, x, m=m: m.a @ x + m.b, (t, stop), x, "BDF" if jacobian else "DOP853", events=events, rtol=tol,
                atol=SMALL * tol * p.sizes, **jacobian
            )  # fmt: skip
            t, x, before = run.t[-1], run.y[:, -1].copy(), mode
            if run.status == 1:
                mode = enter(next(w.target for w, e in zip(m.ways, run.t_events) if e.size), t, x, tick)
            elif run.status < 0:
                raise RuntimeError(run.message)
            elif t == coming:
                ticks, tick = ticks + 1, t
                mode = enter(mode if m.tick < 0 else m.tick, t, x, tick)
            switches += mode != before
        states.append(x.copy())
    return time.process_time() - clock, switches, np.array(states)


def to_reach(samples: list[dict], error: float) -> float:
    """The least time for an error, between samples by powers, as a work-precision line is read."""
    points = sorted((s["error"], s["ms"]) for s in samples if s["finds_all"])
    best = min((ms for e, ms in points if e <= error), default=math.inf)
    for (e0, t0), (e1, t1) in zip(points, points[1:]):
        if e0 < error < e1:
            share = math.log(error / e0) / math.log(e1 / e0)
            best = min(best, t0 * (t1 / t0) ** share)
    return best


def plot(name: str, samples: dict[str, list[dict]], folder: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    plt.rcParams["svg.hashsalt"] = "switchback"
    figure, axes = plt.subplots(figsize=(6, 4.2), layout="constrained")
    for (who, list_of), mark in zip(samples.items(), "os^"):
        list_of = [s for s in list_of if s["error"] > 0]
        x, y = [s["ms"] for s in list_of], [s["error"] for s in list_of]
        line = axes.loglog(x, y, "-", marker=mark, label=who)[0]
        missed = [s for s in list_of if not s["finds_all"]]
        axes.loglog([s["ms"] for s in missed], [s["error"] for s in missed], mark, color="white", mec=line.get_color())
    axes.set(xlabel="milliseconds of CPU time", ylabel="error", title=f"{name} (empty marks: not all switches found)")
    axes.grid(True, alpha=0.3)
    axes.legend()
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / f"work-precision-{name}.svg", metadata={"Date": None})
    plt.close(figure)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sundials", type=Path, default=HERE.parents[2] / "build/sundials/usr", help="prefix of SUNDIALS")
    parser.add_argument("--problems", default=",".join(PROBLEMS))
    parser.add_argument("--rounds", type=int, default=4, help="how often the library and CVODE take turns")
    parser.add_argument("--no-scipy", action="store_true", help="it takes minutes")
    parser.add_argument("--reference", action="store_true", help="make the reference anew")
    parser.add_argument("--plot", type=Path, help="folder for the plots")
    parser.add_argument("--json", type=Path, help="file for all samples")
    arguments = parser.parse_args()
    problems = [PROBLEMS[name]() for name in arguments.problems.split(",")]
    known = json.loads(REFERENCE.read_text()) if REFERENCE.exists() else {}
    if arguments.reference:
        for p in problems:
            states, switches = reference(p)
            known[p.name] = {"switches": int(switches), "states": states.tolist()}
        REFERENCE.write_text(json.dumps(known, indent=1) + "\n")
        return
    prefix = arguments.sundials.resolve()
    folder = next(prefix.rglob("libsundials_cvode.so*")).parent
    everything = {}
    with tempfile.TemporaryDirectory() as temporary:
        peer = str(Path(temporary) / "peer")
        names = ["cvode", "nvecserial", "sunnonlinsolfixedpoint", "sunlinsoldense", "sunmatrixdense"]
        command = ["cc", "-O3", "-o", peer, str(HERE / "affine_modes.c"), f"-I{prefix / 'include'}", f"-L{folder}"]
        subprocess.run([*command, f"-Wl,-rpath,{folder}", *(f"-lsundials_{n}" for n in names), "-lm"], check=True)
        for p in problems:
            states, switches = np.array(known[p.name]["states"]), known[p.name]["switches"]
            samples: dict[str, list[dict]] = {"switchback": [], f"CVODE {p.method}": [], "SciPy": []}
            first, second, third = samples
            solvers = {first: library, second: partial(cvode, peer), third: scipy}
            runs = [((first, second), tol, arguments.rounds) for tol in TOLERANCES]
            runs += [((third,), tol, 1) for tol in SCIPY_TOLERANCES if not arguments.no_scipy]
            print(f"\n{p.name}: {switches} switches\n{'':12} {'rtol':>8} {'ms':>9} {'finds':>6} {'error':>9}")
            for several, tol, rounds in runs:
                found = [[solvers[who](p, tol) for who in several] for _ in range(rounds)]
                for who, of_rounds in zip(several, zip(*found)):
                    if None in of_rounds:
                        print(f"{who:12} {tol:8.0e} fails")
                        continue
                    seconds, n, x = min(of_rounds, key=lambda f: f[0])
                    error = float(np.abs((x - states) / p.sizes).max())
                    samples[who].append({"rtol": tol, "ms": 1e3 * seconds, "finds_all": n == switches, "error": error})
                    print(f"{who:12} {tol:8.0e} {1e3 * seconds:9.2f} {n:6} {error:9.1e}", flush=True)
            ours, theirs = list(samples.values())[:2]
            print("  error   CVODE / switchback at equal error, all switches found")
            for error in (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8):
                print(f"{error:7.0e}   {to_reach(theirs, error) / to_reach(ours, error):.1f}")
            everything[p.name] = samples
            if arguments.plot:
                plot(p.name, samples, arguments.plot)
    if arguments.json:
        arguments.json.write_text(json.dumps(everything, indent=1) + "\n")


if __name__ == "__main__":
    main()
