"""Limit cycles of systems that switch, found in three ways.

A long simulation comes close to a cycle; Newton's method on one period makes it exact (shooting), and the derivatives of the
simulation tell by their eigenvalues, the Floquet multipliers, whether it is stable: one is 1 along the cycle, the others must
be smaller. A sliding mode forgets where it was entered, which gives multipliers of zero. At last the cycle is found again as
an optimal control problem with a free horizon, which knows nothing of the other two but where to start.

usage: limit_cycles.py FOLDER_FOR_PLOTS [NAME ...]
"""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import switchback_control as swb
from switchback_control import sign, where
from switchback_control.expr import Model


@dataclass
class Cycle:
    """Where to look: `flip` is -1 where the second half of a period is the negative of the first, and half is enough."""

    model: Model
    start: list[float]
    long: float
    n_stages: int
    n_s: int
    n_fe: int
    flip: int = 1


def _relay(omega: float) -> Model:
    """Relay feedback of a plant with a resonance at `omega` (di Bernardo, Johansson, Vasca 2001)."""
    m = Model(states="y a b")
    y, a, b = m.x
    zeta, s = 0.05, sign(y)
    m.derivatives = [
        -(2 * zeta * omega + 1) * y + a - s,
        -(2 * zeta * omega + omega**2) * y + b + 2 * s,
        -(omega**2) * y - s,
    ]
    return m


def relay_cycle() -> Cycle:
    """Relay feedback: in each half of the period the output slides along zero twice."""
    return Cycle(_relay(10.0), [0, -0.001, -0.02], 60.0, 8, 6, 4, flip=-1)


def relay_cycle_25() -> Cycle:
    """Relay feedback as in the article: seven slides in each half, the shortest for 0.002; by shooting alone."""
    return Cycle(_relay(25.0), [0, -0.001, -0.02], 60.0, 0, 0, 0, flip=-1)


def _friction(v: Any, strength: float) -> Any:
    """Between a block of speed v and a belt of speed 0.2: it falls with the speed of slip."""
    return where(v > 0.2, -strength / (0.8 + v), strength / (1.2 - v))


def stick_slip() -> Cycle:
    """A block on a belt (Dieci and Lopez 2009): it sticks until the spring tears it off."""
    m = Model(states="q v")
    q, v = m.x
    m.derivatives = [v, -q + _friction(v, 1.0)]
    # the problem has two local optima, with switches in other elements; with six stages one of them is off by 7e-9
    return Cycle(m, [-0.8, -1.0], 60.0, 6, 7, 3)


def stick_slip_2() -> Cycle:
    """Two blocks on a belt with a spring between them: for a part of the period both stick."""
    m = Model(states="q1 q2 v1 v2")
    q1, q2, v1, v2 = m.x
    first = -q1 + 0.2 * (q2 - q1) + _friction(v1, 1.0)
    m.derivatives = [v1, v2, first, -q2 + 0.2 * (q1 - q2) + _friction(v2, 1.3)]
    return Cycle(m, [0.5, 0.3, 0.2, 0.2], 400.0, 10, 6, 2)


@dataclass
class Orbit:
    """A cycle seen in a simulation: from `start` on it lasts `length`."""

    run: swb.Run
    start: float
    length: float

    def __call__(self, t: Any, k: int = 0) -> np.ndarray:
        """States, or their derivatives, at times since the start."""
        return self.run(self.start + np.asarray(t), k)


def observe(c: Cycle) -> Orbit:
    """Simulates until the last switch is one that has been seen before."""
    run = swb.simulate(c.model, c.start, c.long, rtol=1e-12, atol=1e-13)
    *earlier, last = run.switches
    there = run(last.t)

    def again(s: swb.Event) -> bool:
        return (s.before, s.after) == (last.before, last.after) and np.linalg.norm(run(s.t) - there) < 1e-6

    first = next((s.t for s in reversed(earlier) if again(s)), None)
    if first is None:
        raise RuntimeError("the simulation has found no cycle")
    period = last.t - first
    # begin away from switches: in the middle of the longest time without one
    t = np.array([s.t for s in run.switches if s.t >= first])
    k = int(np.argmax(np.diff(t)))
    return Orbit(run, 0.5 * (t[k] + t[k + 1]) - period, period / 2 if c.flip < 0 else period)


def shoot(c: Cycle, seen: Orbit) -> tuple[np.ndarray, float, np.ndarray]:
    """Newton's method for x(T) = x(0): initial state, length, multipliers of the whole period."""
    x0, along = seen(0.0), seen(0.0, 1)
    x, length = x0, seen.length
    with swb.Integrator(c.model, rtol=1e-13, atol=1e-14, sensitivity=1) as i:
        for _ in range(8):
            i.reinit(x)
            i.advance(length)
            m = i.run.dx_dx0
            closing = np.column_stack([m - c.flip * np.eye(len(x)), i.derivative])
            matrix = np.vstack([closing, np.append(along, 0.0)])
            step = np.linalg.solve(matrix, np.append(c.flip * x - i.state, along @ (x0 - x)))
            x, length = x + step[:-1], length + step[-1]
    multipliers = np.linalg.eigvals(c.flip * m)
    return x, length, multipliers**2 if c.flip < 0 else multipliers


def problem(c: Cycle, seen: Orbit) -> swb.Ocp:
    """The cycle as a problem with a free horizon. What it needs beside equal ends: a condition that says where on the cycle
    to begin, and a cost that keeps it near what was seen, for an equilibrium is periodic, too."""
    m, n, length = c.model, c.n_stages, seen.length
    x0, along = seen(0.0), seen(0.0, 1)
    references = seen(length * np.arange(1, n + 1) / n)
    ocp = swb.Ocp(m, length, n, n_s=c.n_s, n_fe=c.n_fe)
    ocp.set_free_time("horizon", 0.8 * length, 1.25 * length)
    ocp.add_boundary(m.between_ends(lambda start, end: end - c.flip * start), m.nx * [0.0], m.nx * [0.0])
    ocp.add_boundary(m.between_ends(lambda start, end: along @ (start - x0)), 0.0, 0.0)
    ocp.add_least_squares(m.function(m.x), m.nx * [1.0], references, at="control_grid")
    t = np.linspace(0.0, length, 401)
    ocp.set_state_guess(t, seen(t))
    return ocp


CYCLES = [relay_cycle, relay_cycle_25, stick_slip, stick_slip_2]


def main() -> int:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    folder.mkdir(parents=True, exist_ok=True)
    failed = 0
    for make in [c for c in CYCLES if len(sys.argv) < 3 or c.__name__ in sys.argv[2:]]:
        c = make()
        seen = observe(c)
        x, length, multipliers = shoot(c, seen)
        print(f"{make.__name__}: {make.__doc__}")
        print(f"    {'half ' if c.flip < 0 else ''}period {length:.12f}")
        if c.n_stages:
            r = problem(c, seen).solve()
            difference = float(np.sum(r.durations)) - length
            print(f"    by optimal control: {difference:+.1e} ({r.outcome.name}, {r.stats.iterations} iterations)")
            failed += int(not r.success or abs(difference) > 1e-9)
        print("    multipliers", " ".join(f"{v:.2e}" for v in sorted(np.abs(multipliers), reverse=True)))
        whole = swb.simulate(c.model, x, 2 * length if c.flip < 0 else length, rtol=1e-12, atol=1e-13)
        figure = folder / f"cycle-{make.__name__}.svg"
        whole.plot(figure, names=c.model.names[0], title=f"{make.__name__}: one period")
    return failed


if __name__ == "__main__":
    sys.exit(main())
