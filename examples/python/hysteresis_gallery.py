"""Optimal control of systems whose discrete states remember: a car with a turbo, a gear box with hysteresis, a room with a thermostat.

In which control stages discrete states change is found by a search of sequences; for a given sequence the problem is smooth. What is
printed of every problem: the outcome, the cost, how far an event-driven simulation of the controls is from the answer, transitions,
iterations and the time. A picture of the continuous states, of the controls and of the discrete state is written of every answer.

usage: hysteresis_gallery.py FOLDER_FOR_PLOTS [NAME ...]
"""

import math
import sys
import time
from pathlib import Path
from typing import Any

import hysteresis_car
import numpy as np

import switchback_control as swb

INFINITY = float("inf")


def turbo_car() -> tuple[swb.Ocp, Any, list[str]]:
    """The least time for 150 m: the engine has three times its force above a speed of 15, until the speed falls below 10."""
    ocp, turbo = hysteresis_car.car(10)
    return ocp, turbo, ["way", "speed"]


def gear_box(**options: Any) -> tuple[swb.Ocp, Any, list[str]]:
    """Three gears that change up at 6 and 12 and down at 4 and 9: a hundred meters from rest to rest in 16 seconds, with the least of the
    control squared. High gears have less force."""
    m = swb.Model(states="q v", controls="u", name="gear box with hysteresis")
    (q, v), u = m.x, m.u[0]
    gear = swb.Automaton(m, states="first second third")
    for low, high, up, down in (("first", "second", 6, 4), ("second", "third", 12, 9)):
        gear.edge(low, high, when=v > up)
        gear.edge(high, low, when=v < down)
    m.derivatives = [v, u * gear.choose({"first": 3.0, "second": 2.0, "third": 1.0}) - 0.05 * v]
    ocp = swb.Ocp(m, 16.0, 12, n_fe=2, initial_state=[0, 0], control_bounds=(-2, 2), **options)
    ocp.set_lagrange(m.function([u**2]))
    ocp.add_terminal(m.function([q, v]), [100, 0], [100, 0])
    return ocp, gear, ["way", "speed"]


def thermostat(**options: Any) -> tuple[swb.Ocp, Any, list[str]]:
    """A radiator that a thermostat turns on below 19 degrees and off above 21; the temperature of its water is the control, and costs.
    The room is to be comfortable while the night gets colder."""
    m = swb.Model(states="room energy", controls="water", name="thermostat with energy cost")
    (room, _), water = m.x, m.u[0]
    on = m.hysteresis(-room, on=-19, off=-21, name="radiator")
    outside = 8 - 6 * swb.sin(0.3 * m.t)
    heat = on * 0.3 * (water - room)
    m.derivatives = [0.15 * (outside - room) + heat, heat]
    ocp = swb.Ocp(m, 5.0, 10, n_fe=1, initial_state=[20, 0], control_bounds=(35, 60), **options)
    ocp.set_lagrange(m.function([(room - 20) ** 2 + 0.002 * (water - 20) ** 2]))
    ocp.set_mayer(m.function([0.05 * m.x[1]]))
    return ocp, on, ["room", "energy"]


PROBLEMS = [turbo_car, gear_box, thermostat]


def picture(name: str, ocp: swb.Ocp, r: swb.OcpResult, discrete: Any, states: list[str], path: Path) -> None:
    """States, controls and the discrete state over time; transitions are dotted lines."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    t = np.linspace(r.control_times[0], r.control_times[-1], 600)
    x = np.array([r.trajectory(s) for s in t])
    figure, axes = pyplot.subplots(len(states) + 2, 1, sharex=True, figsize=(7, 7), constrained_layout=True)
    for i, what in enumerate(states):
        axes[i].plot(t, x[:, i])
        axes[i].set_ylabel(what)
    axes[-2].stairs(r.controls[:, 0], r.control_times, baseline=None)
    axes[-2].set_ylabel("control")
    stays = r.discrete(discrete)
    levels = list(dict.fromkeys(stay.value for stay in stays))
    axes[-1].step([s.start for s in stays] + [stays[-1].end], [str(s.value) for s in stays] + [str(stays[-1].value)], where="post")
    axes[-1].set_ylabel("discrete state" if len(levels) else "")
    axes[-1].set_xlabel("time")
    for jump in r.jumps:
        for a in axes:
            a.axvline(jump.t, color="grey", linestyle=":", linewidth=0.8)
    axes[0].set_title(name.replace("_", " "))
    figure.savefig(path)
    pyplot.close(figure)


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    folder.mkdir(parents=True, exist_ok=True)
    names = sys.argv[2:]
    for problem in PROBLEMS:
        name = problem.__name__
        if names and name not in names:
            continue
        ocp, discrete, states = problem()
        clock = time.perf_counter()
        r = ocp.solve()
        seconds = time.perf_counter() - clock
        error = r.accuracy.terminal if r.accuracy else math.nan
        print(
            f"{name:12} {r.outcome.name.lower():9} cost {r.cost_reached:.10g}, replay {error:.1e}, {len(r.jumps)} transitions, "
            f"{r.stats.iterations} iterations, {seconds:.2f} s"
        )
        if not r.success:
            print("  " + r.message)
            continue
        for stay in r.discrete(discrete):
            print(f"  {stay.value!s:>8} from {stay.start:8.4f} to {stay.end:8.4f}")
        picture(name, ocp, r, discrete, states, folder / f"hysteresis_{name}.svg")


if __name__ == "__main__":
    main()
