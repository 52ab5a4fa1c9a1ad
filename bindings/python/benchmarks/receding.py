"""Is a solve that starts from the last plan, one stage later, as good as one from scratch, and how much faster is it?

usage: receding.py [--samples N] [--json FILE] [names ...]

In every sample the state is measured with noise, the problem is solved, and the first control acts on a plant whose friction is
10 % off. Each problem runs once with solves from scratch ("cold") and once with `shift` and warm solves; the same noise, the same
plant. Shown: cost of the closed loops, median and largest milliseconds of a solve, and samples without a solution.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any, Callable

import numpy as np

import switchback_control as swb
from switchback_control import sign
from switchback_control.expr import Model, sin

#: Share of the usual size of a state that a measurement is off by.
NOISE = 0.005
#: Friction of the plant over that of the model.
MISMATCH = 1.1


class Case:
    """A model with its friction, states to reach, weights, interval and number of stages."""

    def __init__(
        self, model: Callable[..., Any], target: list[float], weights: list[float], interval: float, stages: int
    ):
        self.model, self.target, self.weights = model, np.array(target), np.array(weights)
        self.interval, self.stages = interval, stages

    def rate(self, m: Model) -> Any:
        terms = [w * (x - t) ** 2 for x, t, w in zip(m.x, self.target, self.weights)]
        return sum(terms[1:], terms[0]) + 0.05 * m.u[0] ** 2

    def problem(self) -> swb.Ocp:
        m = self.model(1.0)
        ocp = swb.Ocp(m, self.stages * self.interval, self.stages, control_bounds=(-3, 3))
        ocp.set_initial_state([0.0] * len(self.target))
        ocp.set_lagrange(m.function([self.rate(m)]))
        terms = [2 * w * (x - t) ** 2 for x, t, w in zip(m.x, self.target, self.weights)]
        ocp.set_mayer(m.function([sum(terms[1:], terms[0])]))
        return ocp

    def plant(self) -> swb.System:
        """With the cost as the last state."""
        wide = Model(states=len(self.target) + 1, controls=1)
        inner = self.model(MISMATCH, wide)
        wide.derivatives = [*inner, self.rate(wide)]
        return wide.system()


def block(friction: float, m: Model | None = None) -> Any:
    """A mass on a rough surface, held by a spring."""
    own = m or Model(states=2, controls=1)
    q, v = own.x[0], own.x[1]
    rates = [v, own.u[0] - 0.5 * q - 0.5 * friction * sign(v)]
    return _done(own, rates, m)


def joint(friction: float, m: Model | None = None) -> Any:
    """A pendulum with dry friction in its joint, to be held aside."""
    own = m or Model(states=2, controls=1)
    q, w = own.x[0], own.x[1]
    rates = [w, own.u[0] - 2 * sin(q) - 0.3 * friction * sign(w)]
    return _done(own, rates, m)


def masses(friction: float, m: Model | None = None) -> Any:
    """Two masses on a rough surface with a spring between them; the first is pushed."""
    own = m or Model(states=4, controls=1)
    a, b, v, w = (own.x[i] for i in range(4))
    pull = 4 * (b - a)
    rates = [v, w, own.u[0] + pull - 0.3 * friction * sign(v), -pull - 0.2 * friction * sign(w)]
    return _done(own, [rates[0], rates[1], rates[2], rates[3]], m)


def _done(own: Model, rates: list[Any], given: Model | None) -> Any:
    if given is not None:
        return rates
    own.derivatives = rates
    return own


CASES = {
    "block": Case(block, [1, 0], [10, 1], 0.2, 10),
    "joint": Case(joint, [0.8, 0], [10, 1], 0.15, 12),
    "masses": Case(masses, [1, 1, 0, 0], [4, 4, 1, 1], 0.25, 12),
}


def loop(case: Case, samples: int, warm: bool) -> tuple[float, np.ndarray, int]:
    """Cost of the closed loop, milliseconds of the solves, samples without a solution."""
    rng = np.random.default_rng(7)
    ocp, plant, n = case.problem(), case.plant(), len(case.target)
    state, ms, unsolved, u = np.zeros(n + 1), [], 0, np.zeros(1)
    size = np.maximum(np.abs(case.target), 0.3)
    for k in range(samples):
        if k == samples // 2:
            state[0] -= 0.4  # a push
        ocp.set_initial_state(state[:n] + NOISE * size * rng.standard_normal(n))
        clock = time.perf_counter()
        if k and warm:
            ocp.shift()
        r = ocp.solve(warm=warm and k > 0)
        ms.append(1e3 * (time.perf_counter() - clock))
        unsolved += not r.success
        if r.success:
            u = r.controls[0]
        state = swb.simulate(plant, state, case.interval, u=u, rtol=1e-8, atol=1e-10).x_end
    return float(state[-1]), np.array(ms), unsolved


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--samples", type=int, default=50)
    parser.add_argument("--json")
    args = parser.parse_args()
    found = []
    print("problem     cost cold       warm      diff    ms cold    worst    ms warm    worst   unsolved")
    for name in args.names or CASES:
        cold, warm = (loop(CASES[name], args.samples, w) for w in (False, True))
        diff = (warm[0] - cold[0]) / abs(cold[0])
        print(
            f"{name:8s} {cold[0]:12.6f} {warm[0]:10.6f} {100 * diff:8.3f}% {np.median(cold[1]):9.1f} {cold[1].max():9.1f}"
            f" {np.median(warm[1][1:]):9.1f} {warm[1][1:].max():9.1f}  {cold[2]:3d} {warm[2]:3d}",
            flush=True,
        )
        found.append({"problem": name, "cold": cold[0], "warm": warm[0], "ms_cold": float(np.median(cold[1]))})
        found[-1] |= {"ms_warm": float(np.median(warm[1][1:])), "unsolved": [cold[2], warm[2]]}
    if args.json:
        Path(args.json).write_text(json.dumps(found, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
