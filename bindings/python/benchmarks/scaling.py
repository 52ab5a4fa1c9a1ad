"""Many units that switch, beside CVODE with the logic of modes by hand: what a switch costs as their number grows.

Kinds: chain (blocks with friction on a belt), rooms (in a row, ideal thermostats: they slide), apart and row (rooms with thermostats
with hysteresis, by themselves and in a row), ring and hub (neurons that move their neighbours, and all of them one neuron), rod (a stiff rod
of heat with one thermostat, by its nodes).

CVODE (Adams; for the rod BDF with a banded Jacobian) has the modes in C (scaling.c), and for the first three kinds steps short enough to find all
switches. The engine has the model as expressions and the same tolerance. Times are the shortest of several rounds, in turns, since a machine is
faster at one time than at another. Errors are the largest ones of the times of all switches, against CVODE with a tolerance of 1e-11.
Where the engine is more accurate than CVODE, `equal` is the ratio with the loosest tolerance of CVODE that is as accurate.

    python scaling.py [--sundials PREFIX] [--kinds rooms,ring] [--sizes 10,100,300] [--rounds 6] [--rtol 1e-6] [--peer 300]
"""

from __future__ import annotations

import argparse
import math
import subprocess
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import switchback_control as swb
from switchback_control.expr import Model, sign, sin

HERE = Path(__file__).resolve().parent
SIZES = {
    "chain": [3, 10, 30, 100, 300],
    "rooms": [10, 20, 30, 100, 300, 1000, 3000],
    "apart": [10, 100, 300, 1000, 3000],
    "row": [10, 100, 300, 1000, 3000],
    "ring": [10, 100, 300, 1000, 3000, 10000],
    "hub": [10, 100, 300, 1000, 3000],
    "rod": [50, 100, 200, 400],
}
LONGEST = {"chain": 0.1, "rooms": 0.05, "rod": 0.05}
#: Tolerance of the reference.
SHARP = 1e-11

#: A model, the state it begins with, the time at its end.
Problem = tuple[Model, list[float], float]


def part(i: int, of: int) -> float:
    """Numbers between 0 and 1, the same as in scaling.c."""
    return math.fmod(0.61803398875 * (i + 1) * (of + 1) + 0.31 * of, 1.0)


def neighbours(x: Any, n: int, i: int) -> Any:
    """Differences to the neighbours in a row."""
    terms = [x[j] - x[i] for j in (i - 1, i + 1) if 0 <= j < n]
    return sum(terms) if terms else 0 * x[i]


def chain(n: int) -> Problem:
    """Blocks on a belt, coupled by springs, with friction that falls with the speed."""
    m = Model(2 * n)
    x, rates = m.x, []
    for i in range(n):
        pull = neighbours([x[2 * k] for k in range(n)], n, i)
        slip = 0.1 - x[2 * i + 1]
        friction = (1 + 0.02 * (i % 7)) * sign(slip) / (1 + 2.5 * abs(slip))
        rates += [x[2 * i + 1], 2 * pull - x[2 * i] + friction]
    m.derivatives = rates
    return m, [v for i in range(n) for v in (0.3 * math.sin(1.7 * i + 0.3), 0.0)], 8.0


def rooms(n: int) -> Problem:
    """Rooms that lose heat to each other and to the outside, each with an ideal thermostat."""
    m = Model(n)
    x, rates, outside = m.x, [], 8 + 10 * sin(1.3 * m.t)
    for i in range(n):
        level = 20 + 0.1 * (i % 4) + 0.01 * math.sin(i)
        heating = (9 + 0.3 * (i % 3)) * (1 - sign(x[i] - level))
        rates.append((1 + 0.05 * (i % 5)) * (outside - x[i]) + 0.5 * neighbours(x, n, i) + heating)
    m.derivatives = rates
    return m, [18 + 2 * math.sin(2.1 * i) for i in range(n)], 6.0


def rod(n: int) -> Problem:
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


def hystereses(n: int, coupling: float) -> Problem:
    """Rooms with a thermostat with hysteresis each."""
    m = Model(n)
    heaters = [m.discrete(f"heater {i}") for i in range(n)]
    x, rates, outside = m.x, [], 8 + 10 * sin(1.3 * m.t)
    levels = [18 + 4 * part(i, 0) for i in range(n)]
    for i, on in enumerate(heaters):
        rate = (0.8 + 0.4 * part(i, 1)) * (outside - x[i]) + 25.0 * on
        rates.append(rate + coupling * neighbours(x, n, i) if coupling else rate)
        m.transition(levels[i] - x[i] > 0.5, when={on: 0}, to={on: 1})
        m.transition(x[i] - levels[i] > 0.5, when={on: 1}, to={on: 0})
    m.derivatives = rates
    return m, [levels[i] + 0.8 * part(i, 2) - 0.4 for i in range(n)] + [0.0] * n, 2.0


def neurons(n: int, targets: Callable[[int], list[int]]) -> Problem:
    """Integrate-and-fire neurons that move others when they fire."""
    m = Model(n)
    v = m.x
    m.derivatives = [(1.05 + 0.3 * part(i, 0) - v[i]) * (1 / (1 + 0.2 * part(i, 1))) for i in range(n)]
    for i in range(n):
        moved = {j: v[j] + 0.02 * (part(i + j, 2) - 0.5) for j in targets(i) if j != i}
        m.transition(v[i] > 1, reset={v[i]: v[i] - 1, **{v[j]: r for j, r in moved.items()}})
    return m, [part(i, 3) for i in range(n)], 10.0


MODELS: dict[str, Callable[[int], Problem]] = {
    "chain": chain,
    "rooms": rooms,
    "apart": lambda n: hystereses(n, 0.0),
    "row": lambda n: hystereses(n, 0.1),
    "ring": lambda n: neurons(n, lambda i: [(i + n - 1) % n, (i + 1) % n]),
    "hub": lambda n: neurons(n, lambda i: [0]),
    "rod": rod,
}
#: Transitions of a unit.
TRANSITIONS = {"apart": 2, "row": 2}

#: Of every unit the times at which it switches.
Times = dict[int, list[float]]


class Engine:
    """Our side."""

    def __init__(self, kind: str, n: int, rtol: float):
        model, self.start, self.end = MODELS[kind](n)
        self.kind = kind
        clock = time.process_time()
        self.integrator = swb.Integrator(model, rtol=rtol, atol=0.01 * rtol)
        self.build = time.process_time() - clock

    def seconds(self) -> float:
        """The shortest time of five runs, or of those that a fifth of a second is enough for."""
        taken: list[float] = []
        while len(taken) < 5 and sum(taken) < 0.2:
            self.integrator.reinit(self.start)
            clock = time.process_time()
            self.integrator.advance(self.end)
            taken.append(time.process_time() - clock)
        return min(taken)

    @property
    def switches(self) -> int:
        """Of the last run."""
        stats = self.integrator.stats
        return stats.switches + stats.jumps

    def times(self) -> Times:
        """Of the last run."""
        run, out = self.integrator.run, defaultdict(list)
        for s in run.switches:
            out[s.subsystem].append(s.t)
        for j in run.jumps:
            out[j.transition // TRANSITIONS.get(self.kind, 1)].append(j.t)
        return out


class Peer:
    """CVODE."""

    def __init__(self, prefix: Path, folder: Path):
        self.program, self.log = folder / "peer", folder / "times"
        library = next(prefix.rglob("libsundials_cvode.so*")).parent
        names = ["cvode", "nvecserial", "sunnonlinsolfixedpoint", "sunlinsolband", "sunmatrixband"]
        command = ["cc", "-O3", "-o", str(self.program), str(HERE / "scaling.c"), f"-I{prefix / 'include'}", f"-L{library}"]
        command += [f"-Wl,-rpath,{library}", *(f"-lsundials_{name}" for name in names), "-lm"]
        subprocess.run(command, check=True)

    def run(self, kind: str, n: int, rtol: float, log: bool = False) -> tuple[float, int, float]:
        """Seconds, switches, sum of the states at the end."""
        command = [str(self.program), kind, str(n), str(LONGEST.get(kind, 0.0)), str(rtol)]
        out = subprocess.run(command + [str(self.log)] * log, check=True, capture_output=True, text=True).stdout.split()
        return float(out[0]), int(out[1]), float(out[2])

    def times(self, kind: str, n: int, rtol: float) -> Times:
        """Of a run with this tolerance."""
        self.run(kind, n, rtol, log=True)
        out = defaultdict(list)
        for line in self.log.read_text().splitlines():
            unit, t = line.split()
            out[int(unit)].append(float(t))
        return out


def error(times: Times, reference: Times) -> float:
    """The largest difference of the times; infinite where a unit has more or fewer of them."""
    if any(len(times.get(k, [])) != len(reference.get(k, [])) for k in {*times, *reference}):
        return math.inf
    return max((abs(a - b) for k, own in reference.items() for a, b in zip(times[k], own)), default=0.0)


def as_accurate(peer: Peer, kind: str, n: int, reference: Times, rtol: float, goal: float) -> float | None:
    """The loosest tolerance in steps of the root of ten, from `rtol` down, with which CVODE has that error; none down to the tolerance of the reference."""
    while rtol > 10 * SHARP:
        if error(peer.times(kind, n, rtol), reference) <= goal:
            return rtol
        rtol *= math.sqrt(0.1)
    return None


def report(kind: str, n: int, rtol: float, rounds: int, peer: Peer | None) -> float:
    """One line; returns the seconds a switch takes."""
    own = Engine(kind, n, rtol)
    best = own.seconds()
    if peer is None:
        best = min([best, *(own.seconds() for _ in range(rounds - 1 if best < 1 else 0))])
        print(f"{n:6} {own.switches:8} {own.build:7.2f} {1e3 * best:9.2f} {1e6 * best / own.switches:9.2f}", flush=True)
        return best / own.switches
    reference = peer.times(kind, n, SHARP)
    errors = error(own.times(), reference), error(peer.times(kind, n, rtol), reference)
    same = as_accurate(peer, kind, n, reference, rtol, max(errors[0], 10 * SHARP)) if errors[0] < errors[1] else rtol
    theirs = equal = math.inf
    for _ in range(rounds):
        theirs = min(theirs, peer.run(kind, n, rtol)[0])
        equal = min(equal, peer.run(kind, n, same)[0]) if same and same != rtol else theirs
        best = min(best, own.seconds())
    each = best / own.switches
    print(
        f"{n:6} {own.switches:8} {own.build:7.2f} {1e3 * best:9.2f} {1e6 * each:9.2f} {1e3 * theirs:9.2f} {best / theirs:6.2f}"
        f" {errors[0]:9.1e} {errors[1]:9.1e} {best / equal if same else math.nan:6.2f} {same or math.nan:8.0e}",
        flush=True,
    )
    return each


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sundials", type=Path, default=HERE.parents[2] / "build/sundials/usr", help="prefix of SUNDIALS")
    parser.add_argument("--kinds", default=",".join(SIZES), help="which models, with commas; all by default")
    parser.add_argument("--sizes", help="numbers of units, with commas; all by default")
    parser.add_argument("--rounds", type=int, default=6, help="how often the two take turns")
    parser.add_argument("--rtol", type=float, default=1e-6, help="relative tolerance of both")
    parser.add_argument("--peer", type=int, default=300, help="the largest number of units that CVODE has; 0: none")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        peer = Peer(arguments.sundials.resolve(), Path(folder)) if arguments.peer > 0 else None
        for kind in arguments.kinds.split(","):
            sizes = [int(n) for n in arguments.sizes.split(",")] if arguments.sizes else SIZES[kind]
            head = f"{kind:>6} {'switches':>8} {'build s':>7} {'ms':>9} {'us/switch':>9}"
            print(head + f" {'CVODE ms':>9} {'ratio':>6} {'error':>9} {'CVODE':>9} {'equal':>6} {'its rtol':>8}" * (peer is not None))
            each = [report(kind, n, arguments.rtol, arguments.rounds, peer if n <= arguments.peer else None) for n in sizes]
            if len(sizes) > 1:
                exponent = math.log(each[-1] / each[0]) / math.log(sizes[-1] / sizes[0])
                print(f"exponent of the cost of a switch from {sizes[0]} to {sizes[-1]}: {exponent:.2f}")


if __name__ == "__main__":
    main()
