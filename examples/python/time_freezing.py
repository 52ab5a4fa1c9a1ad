"""A particle that falls on a rough floor, slides and is lifted again, in numerical time and in physical time.

Time-freezing makes the scene a piecewise smooth system with a clock: in numerical time all states are continuous, in physical
time the velocities jump (A. Nurkanovic, Numerical Methods for Optimal Control of Nonsmooth Dynamical Systems, Example 8.17).
The event-driven simulation of the scene is drawn beside.

usage: time_freezing.py FOLDER_FOR_PLOTS
"""

import sys
from pathlib import Path

import numpy as np

import switchback_control as swb

GRAVITY = 9.81
#: Numerical times: the contact ends at 2.75.
MIDDLE, END = 2.0, 3.5


def particle(friction: float = 0.6) -> swb.Scene:
    """A push to the right; with the control at 1 a lift that grows with the physical time."""
    s = swb.Scene("x y", u="lift", name="particle")
    (x, y), lift = s.q, s.u[0]
    s.force([7.0, lift * 2 * GRAVITY * (s.t - 1) - GRAVITY])
    s.contact("floor", gap=y, tangents=[x], mu=friction)
    return s


def simulate(model: swb.FrozenModel, n: int) -> list[swb.SimulationResult]:
    """Both halves of the example with `n` steps for a unit of numerical time."""
    keywords = dict(n_s=3, n_fe=2, dcs_form="heaviside")
    first = swb.simulate_fesd(model, model.start([0, 1, 0, 0]), MIDDLE, int(MIDDLE * n), u=[0], **keywords)
    rest = END - MIDDLE
    return [first, swb.simulate_fesd(model, first.state, rest, int(rest * n), t0=MIDDLE, u=[1], **keywords)]


def sampled(results: list[swb.SimulationResult]) -> tuple[np.ndarray, np.ndarray]:
    """Numerical times and states."""
    parts = [np.linspace(a, b, 400) for a, b in ((0, MIDDLE), (MIDDLE, END))]
    states = [np.array([r.trajectory(t) for t in p]) for r, p in zip(results, parts)]
    return np.concatenate(parts), np.vstack(states)


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
    folder.mkdir(parents=True, exist_ok=True)
    scene = particle()
    model = scene.freeze(step=0.1, speed=4.4, a_n=GRAVITY)
    print(model.freeze_report)
    results = simulate(model, 10)
    state = results[-1].state
    exact = [6.424125, 1.37953125, 8.3925, 5.518125]
    print("state at physical time", state[model.clock], state[:4], "error", np.abs(state[:4] - exact).max())

    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    tau, states = sampled(results)
    t, physical = model.physical(tau, states)
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(10, 4), constrained_layout=True)
    for k, name in ((2, "v_x"), (3, "v_y")):
        left.plot(tau, states[:, k], label=name)
        right.plot(t, physical[:, k], label=name)
    left.plot(tau, states[:, model.clock], "k--", label="physical time")
    left.set_xlabel("numerical time")
    right.set_xlabel("physical time")
    for ax in (left, right):
        ax.legend()
    figure.savefig(folder / "time_freezing.svg")


if __name__ == "__main__":
    main()
