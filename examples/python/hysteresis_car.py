"""A car whose engine has three times its force from a speed of 15 until the speed falls below 10: the least time for 150 m.

The turbo is a discrete state with hysteresis. Which control stages it goes on and off in is found by a search of sequences of
transitions; for a given sequence the problem is smooth. With ten stages the exact optimum is 10.22925791133 s (A. Nurkanovic,
Numerical Methods for Optimal Control of Nonsmooth Dynamical Systems, section 9.4, has 10.26 s by time-freezing).

usage: hysteresis_car.py FOLDER_FOR_PLOTS
"""

import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

import switchback_control as swb

INFINITY = float("inf")


def car(n_stages: int, on: float = 15, off: float = 10, factor: float = 3, distance: float = 150) -> tuple[swb.Ocp, Any]:
    """The problem, and its discrete state."""
    m = swb.Model(states="q v", controls="u", name="car with hysteresis")
    (q, v), u = m.x, m.u[0]
    turbo = m.hysteresis(v, on=on, off=off, name="turbo")
    m.derivatives = [v, (1 + (factor - 1) * turbo) * u]
    ocp = swb.Ocp(m, horizon=10.0, n_stages=n_stages, n_fe=1, initial_state=[0, 0], control_bounds=(-5, 5))
    ocp.set_state_bounds([-INFINITY, -25], [INFINITY, 25])
    ocp.set_free_time("horizon", 1, 60)
    ocp.set_mayer(m.function([m.t]))
    ocp.add_terminal(m.function([q, v]), [distance, 0], [distance, 0])
    return ocp, turbo


def draw(result: swb.OcpResult, turbo: Any, path: Path) -> None:
    """Speed with the thresholds, control, and where the turbo is on."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    times = np.linspace(result.control_times[0], result.control_times[-1], 600)
    speed = np.array([result.trajectory(t)[1] for t in times])
    figure, (above, below) = pyplot.subplots(2, 1, sharex=True, figsize=(7, 5), constrained_layout=True)
    above.plot(times, speed)
    for level in (10, 15):
        above.axhline(level, color="0.7", linewidth=0.8, linestyle="--")
    above.set_ylabel("v")
    below.stairs(result.controls[:, 0], result.control_times, baseline=None)
    below.set_ylabel("u")
    below.set_xlabel("t")
    for i in result.discrete(turbo):
        if i.value == 1:
            for ax in (above, below):
                ax.axvspan(i.start, i.end, color="tab:orange", alpha=0.15)
    figure.savefig(path)
    pyplot.close(figure)


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
    folder.mkdir(parents=True, exist_ok=True)
    print(f"{'stages':>6} {'T':>18} {'on in':>6} {'off in':>6} {'error':>9} {'seconds':>8}")
    for n_stages in (10, 20, 40):
        ocp, turbo = car(n_stages)
        clock = time.perf_counter()
        result = ocp.solve()
        seconds = time.perf_counter() - clock
        stages = [j.stage for j in result.jumps]
        error = result.accuracy.terminal if result.accuracy else float("nan")
        print(f"{n_stages:6} {result.cost:18.13f} {stages[0]:6} {stages[-1]:6} {error:9.1e} {seconds:8.3f}")
        if n_stages == 10:
            draw(result, turbo, folder / "hysteresis_car.svg")


if __name__ == "__main__":
    main()
