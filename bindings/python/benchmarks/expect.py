"""What usual tasks take: seconds of processor time, the least of several repetitions, as rows of docs/expect.md.

usage: expect.py
"""

from __future__ import annotations

import platform
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import switchback_control as swb
from switchback_control import cos, sign, sin


def belt() -> swb.Model:
    m = swb.Model(states="q v", controls="F", name="belt")
    slip = 1 - m.v
    m.derivatives = [m.v, m.F - m.q + sign(slip) / (1 + abs(slip))]
    return m


def buck() -> swb.Model:
    m = swb.Model(states="i v ramp", parameters="duty", name="buck")
    on = swb.where(m.ramp < m.duty, 1, 0)
    m.derivatives = [(24 * on - m.v) / 1e-3, (m.i - m.v / 10) / 1e-4, 1e4]
    m.transition(m.ramp > 1, reset={m.ramp: m.ramp - 1})
    return m


def pendulum() -> swb.Model:
    m = swb.Model(states="pos th v om", controls="F", name="cart and pole")
    d = 1 + 0.1 * sin(m.th) ** 2
    t = m.F + 0.05 * m.om**2 * sin(m.th)
    m.derivatives = [m.v, m.om, (t - 0.981 * sin(m.th) * cos(m.th)) / d, (10.791 * sin(m.th) - t * cos(m.th)) / (0.5 * d)]
    return m


def dragged(stages: int, **options: Any) -> swb.Ocp:
    """The first program of the README with another grid: a switching function, and an optimum that slides by."""
    m = belt()
    ocp = swb.Ocp(m, horizon=2, n_stages=stages, lagrange=m.F**2, initial_state=[0, 0], control_bounds=(-3, 3), **options)
    ocp.add_terminal([m.q, m.v], [2, 0], [2, 0])
    return ocp


def swing_up(stages: int) -> swb.Ocp:
    m = pendulum()
    ocp = swb.Ocp(m, horizon=2, n_stages=stages, lagrange=m.F**2, initial_state=[0, np.pi, 0, 0], control_bounds=(-30, 30))
    ocp.add_terminal([*m.x], [0, 0, 0, 0], [0, 0, 0, 0])
    return ocp


def two_blocks(stages: int) -> swb.Ocp:
    """Two switching functions: a force pulls a block with friction, which pulls another one by a spring."""
    m = swb.Model(states="q1 q2 v1 v2", controls="F", name="two blocks")
    pull = m.q1 - m.q2
    m.derivatives = [m.v1, m.v2, m.F - pull - 0.3 * sign(m.v1), pull - 0.3 * sign(m.v2)]
    ocp = swb.Ocp(m, horizon=4, n_stages=stages, lagrange=m.F**2, initial_state=[0, 0, 0, 0], control_bounds=(-5, 5))
    ocp.add_terminal([*m.x], [1, 1, 0, 0], [1, 1, 0, 0])
    return ocp


def turbo(stages: int) -> swb.Ocp:
    m = swb.Model(states="q v", controls="F", name="turbo")
    on = m.hysteresis(m.v, on=15, off=10)
    m.derivatives = [m.v, (1 + 2 * on) * m.F]
    ocp = swb.Ocp(m, horizon=10, n_stages=stages, n_fe=1, initial_state=[0, 0], control_bounds=(-5, 5))
    ocp.set_state_bounds([-np.inf, -25], [np.inf, 25])
    ocp.set_free_time("horizon", 1, 40)
    ocp.set_mayer(m.t)
    ocp.add_terminal([m.q, m.v], [150, 0], [150, 0])
    return ocp


def leg(stages: int) -> swb.Ocp:
    """The recipe docs/howto/leg.md."""
    s = swb.Scene("body foot", u="F", name="leg")
    (body, foot), F = s.q, s.u[0]
    s.inertia([2.0, 0.5])
    s.force([F - 2.0 * 9.81, -F - 0.5 * 9.81])
    s.contact("floor", gap=foot)
    ocp = swb.Ocp(s, horizon=1.0, n_stages=stages, n_s=2, n_fe=2, initial_state=[0.5, 0, 0, 0], control_bounds=(-80, 80))
    ocp.add_path(s.function([body - foot]), [0.2], [0.8])
    ocp.set_lagrange(s.function(0.001 * F**2 - 100 * foot))
    ocp.add_terminal(s.function([body, foot, *s.v]), [0.5, 0, 0, 0], [0.5, 0, 0, 0])
    return ocp


def ball() -> swb.Scene:
    s = swb.Scene("y", name="ball")
    s.force([-9.81])
    s.contact("floor", gap=s.q[0], e=0.8)
    return s


def column(n: int) -> swb.Scene:
    s = swb.Scene(n, name="column")
    s.force([-9.81] * n)
    for i in range(n):
        s.contact(f"{i}", gap=s.q[i] - (s.q[i - 1] if i else -0.5) - 0.5)
    return s


def shown(seconds: float) -> str:
    for unit, factor in (("µs", 1e6), ("ms", 1e3), ("s", 1.0)):
        if seconds * factor < 1000 or unit == "s":
            return f"{seconds * factor:.2g} {unit}" if seconds * factor < 100 else f"{seconds * factor:.0f} {unit}"
    raise AssertionError


def row(task: str, do: Callable[[], Any], about: Callable[[Any], str], repeat: int = 3, calls: int = 1) -> None:
    taken = []
    for _ in range(repeat):
        start = time.process_time()
        for _ in range(calls):
            found = do()
        taken.append((time.process_time() - start) / calls)
    print(f"| {task} | {about(found)} | {shown(min(taken))} |", flush=True)


def of_solve(r: Any) -> str:
    return f"{r.stats.iterations} iterations, {r.optimality.verdict if r.optimality else r.outcome.name.lower()}"


def main() -> None:
    model = next((line.split(":")[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name")), platform.processor())
    print(f"{model}, {time.strftime('%Y-%m-%d')}, switchback {swb.library_version}\n\n## Models and simulations\n")
    print("| task | what came out | time |\n|---|---|---|")
    row("state the belt and find its modes", lambda: belt().system(), lambda s: "2 modes", calls=20)
    m = belt()
    switches = lambda r: f"{len(r.switches)} switches"  # noqa: E731
    row("simulate the belt for 20 units of time", lambda: swb.simulate(m, [0, 0], 20, u=[0]), switches, calls=20)
    row("the same with derivatives", lambda: swb.simulate(m, [0, 0], 20, u=[0], sensitivity=True), switches, calls=20)
    row("the same at tolerances of 1e-12", lambda: swb.simulate(m, [0, 0], 20, u=[0], rtol=1e-12, atol=1e-12), switches, calls=20)
    row("the same by finite elements, 100 steps", lambda: swb.simulate_fesd(m, [0, 0], 20, 100, u=[0]), lambda r: f"{len(r.trajectory.switches)} switches")
    b = buck()
    both = lambda r: f"{len(r.switches) + len(r.jumps)} switches and transitions"  # noqa: E731
    row("simulate 1000 periods of a buck converter", lambda: swb.simulate(b, [0, 0, 0], 0.1, p=[0.5]), both)
    s = ball()
    row("a ball that bounces until it rests", lambda: s.simulate([1.0], [0.0], 5.0), lambda r: f"{len(r.impacts)} impacts", calls=20)
    c, start = column(20), [0.6 * i for i in range(20)]
    row("20 balls in a column, 2000 steps", lambda: swb.simulate_steps(c, start, [0.0] * 20, 2.0, h=1e-3), lambda r: "all at rest")
    print("\n## Optimal control\n\n| problem | what came out | time |\n|---|---|---|")
    for stages in (10, 20, 40, 80):
        row(f"smooth: swing-up of a pole on a cart, {stages} stages", lambda: swing_up(stages).solve(), of_solve)
    for stages in (10, 20, 40, 80):
        row(f"one switching function: the belt, {stages} stages", lambda: dragged(stages).solve(), of_solve)
    row("the same, 20 stages, the homotopy alone", lambda: dragged(20, ocp_start="homotopy").solve(), of_solve)
    again = dragged(20)
    again.solve()
    row("the same, 20 stages, solved again with `warm=True`", lambda: again.solve(warm=True), of_solve)
    for stages in (10, 20):
        row(f"two switching functions: two blocks with friction, {stages} stages", lambda: two_blocks(stages).solve(), of_solve, repeat=2)
    for stages in (10, 20):
        row(f"hysteresis: the car with a turbo, {stages} stages", lambda: turbo(stages).solve(), of_solve, repeat=2)
    for stages in (12, 24):
        row(f"a contact: the leg that hops, {stages} stages", lambda: leg(stages).solve(), of_solve, repeat=2)
    print("\n## Feedback\n\n| controller | what came out | time |\n|---|---|---|")
    m = pendulum()
    ocp = swb.Ocp(m, 2.0, 40, rk_family="explicit", n_s=4, n_fe=1, control_bounds=(-12, 12))
    ocp.add_least_squares(m.function([*m.x, m.F]), [5, 5, 0.05, 0.05, 0.005], np.zeros(5))
    ocp.add_least_squares(m.function([*m.x]), [50, 50, 5, 5], np.zeros(4), at="terminal")
    ocp.set_state_guess([0, 2], [[0, np.pi, 0, 0], [0, 0, 0, 0]])
    with swb.Nmpc(ocp, "rti") as controller:
        controller.initialise([0, np.pi, 0, 0])
        loop = swb.closed_loop(controller, m, [0, np.pi, 0, 0], 100)
    for what, times in (("preparation", loop.preparation), ("feedback", loop.feedback)):
        print(f"| pole on a cart, 40 stages, real-time iteration: {what} | median of 100 samples | {shown(float(np.median(times)))} |")


if __name__ == "__main__":
    main()
