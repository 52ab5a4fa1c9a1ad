"""Many surfaces that slide at once, chains of blocks with friction and rows of rooms with ideal thermostats, and a stiff rod with
one thermostat, beside CVODE.

CVODE (Adams; for the rod BDF with a banded Jacobian) has the modes written by hand in C (sliding_scaling.c) and steps short
enough to find all switches; the engine has the model as expressions, the same tolerance; the shortest CPU time of several rounds of
five runs, in turns, since a machine is faster at one time than at another.

    python sliding_scaling.py [--sundials PREFIX] [--kinds chain,rooms,rod] [--sizes 3,10,30] [--rounds 6] [--rtol 1e-6]
"""

import argparse
import math
import os
import subprocess
import tempfile
import time
from pathlib import Path

import switchback_control as swb
from switchback_control.expr import Model, sign, sin

HERE = Path(__file__).resolve().parent
SIZES = {"chain": [3, 10, 30, 100, 300], "rooms": [5, 20, 100, 300], "rod": [50, 100, 200, 400]}
LONGEST = {"chain": 0.1, "rooms": 0.05, "rod": 0.05}


def chain(n):
    """Blocks on a belt, coupled by springs, with friction that falls with the speed."""
    m = Model(2 * n)
    x, rates = m.x, []
    for i in range(n):
        pull = 0 * x[0]
        if i:
            pull = pull + x[2 * i - 2] - x[2 * i]
        if i < n - 1:
            pull = pull + x[2 * i + 2] - x[2 * i]
        slip = 0.1 - x[2 * i + 1]
        friction = (1 + 0.02 * (i % 7)) * sign(slip) / (1 + 2.5 * abs(slip))
        rates += [x[2 * i + 1], 2 * pull - x[2 * i] + friction]
    m.derivatives = rates
    return m, [v for i in range(n) for v in (0.3 * math.sin(1.7 * i + 0.3), 0.0)], 8.0


def rooms(n):
    """Rooms that lose heat to each other and to the outside, each with a thermostat."""
    m = Model(n)
    x, rates, outside = m.x, [], 8 + 10 * sin(1.3 * m.t)
    for i in range(n):
        exchange = 0 * x[0]
        if i:
            exchange = exchange + x[i - 1] - x[i]
        if i < n - 1:
            exchange = exchange + x[i + 1] - x[i]
        level = 20 + 0.1 * (i % 4) + 0.01 * math.sin(i)
        heating = (9 + 0.3 * (i % 3)) * (1 - sign(x[i] - level))
        rates.append((1 + 0.05 * (i % 5)) * (outside - x[i]) + 0.5 * exchange + heating)
    m.derivatives = rates
    return m, [18 + 2 * math.sin(2.1 * i) for i in range(n)], 6.0


def rod(n):
    """A rod that is insulated at its beginning and as warm as the air at its end, with a heater and a thermostat at a quarter."""
    m = Model(n)
    x, rates, air = m.x, [], 8 + 14 * sin(1.3 * m.t)
    for i in range(n):
        before = x[i - 1] if i else x[i]
        behind = x[i + 1] if i < n - 1 else air
        rate = 0.2 * n * n * (before - 2 * x[i] + behind) + 0.3 * (air - x[i])
        rates.append(rate + 2.0 * n * (1 - sign(x[i] - 20)) if i == n // 4 else rate)
    m.derivatives = rates
    return m, [15.0] * n, 12.0


MODELS = {"chain": chain, "rooms": rooms, "rod": rod}


def engine(integrator, start, end):
    """Seconds, switches, sum of the states at the end."""
    best = math.inf
    for _ in range(5):
        integrator.reinit(start)
        clock = time.process_time()
        integrator.advance(end)
        best = min(best, time.process_time() - clock)
    return best, integrator.stats.switches, float(sum(integrator.state))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sundials", type=Path, default=HERE.parents[2] / "build/sundials/usr", help="prefix of SUNDIALS")
    parser.add_argument("--kinds", default="chain,rooms,rod", help="which models, with commas; all by default")
    parser.add_argument("--sizes", help="numbers of surfaces, with commas; all by default")
    parser.add_argument("--rounds", type=int, default=6, help="how often the two take turns")
    parser.add_argument("--rtol", type=float, default=1e-6, help="relative tolerance of both")
    arguments = parser.parse_args()
    prefix = arguments.sundials.resolve()
    library = next(prefix.rglob("libsundials_cvode.so*")).parent
    with tempfile.TemporaryDirectory() as folder:
        peer = os.path.join(folder, "peer")
        names = ["cvode", "nvecserial", "sunnonlinsolfixedpoint", "sunlinsolband", "sunmatrixband"]
        command = ["cc", "-O3", "-o", peer, str(HERE / "sliding_scaling.c"), f"-I{prefix / 'include'}", f"-L{library}"]
        command += [f"-Wl,-rpath,{library}", *(f"-lsundials_{name}" for name in names), "-lm"]
        subprocess.run(command, check=True)
        for kind in arguments.kinds.split(","):
            sizes = [int(n) for n in arguments.sizes.split(",")] if arguments.sizes else SIZES[kind]
            print(f"{kind:6} {'switches':>9} {'CVODE':>7} {'ms':>9} {'CVODE':>9} {'ratio':>6}   difference of the sums")
            times = []
            for n in sizes:
                model, start, end = MODELS[kind](n)
                integrator = swb.Integrator(model, rtol=arguments.rtol, atol=0.01 * arguments.rtol)
                command = [peer, kind, str(n), str(LONGEST[kind]), str(arguments.rtol)]
                own = (math.inf,)
                seconds = math.inf
                for _ in range(arguments.rounds):
                    out = subprocess.run(command, check=True, capture_output=True, text=True)
                    of_round, switches, total = (float(v) for v in out.stdout.split())
                    seconds = min(seconds, of_round)
                    own = min(own, engine(integrator, start, end))
                times.append(own[0])
                print(
                    f"{n:6} {own[1]:9} {switches:7.0f} {1e3 * own[0]:9.2f} {1e3 * seconds:9.2f} {own[0] / seconds:6.2f}"
                    f"   {own[2] - total:.1e}",
                    flush=True,
                )
            if len(sizes) > 1:
                exponent = math.log(times[-1] / times[0]) / math.log(sizes[-1] / sizes[0])
                print(f"exponent of the time from {sizes[0]} to {sizes[-1]}: {exponent:.2f}")


if __name__ == "__main__":
    main()
