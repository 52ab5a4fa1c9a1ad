"""Optimal control of robots by shooting, and how its cost grows with bodies and stages.

usage: robots.py [--page] [--scale] [--draws SEED COUNT]

Without options the problems of the examples; `--scale` a chain of carts with dry friction, with 4 to 32 carts and 20 to 320 stages. `--page` prints the tables as
they stand in docs/benchmarks/robots.md. `--draws` solves chains drawn at random, within 8 s each; with the library of another build
(SWITCHBACK_LIBRARY) both can be compared.
"""

from __future__ import annotations

import argparse
import importlib.util
import time
from pathlib import Path
from typing import Any

import numpy as np

import switchback_control as swb

EXAMPLES = Path(__file__).resolve().parents[3] / "examples" / "python"


def example(name: str) -> Any:
    """A program of the examples as a module."""
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def chain(carts: int, stages: int, **options: Any) -> tuple[swb.Scene, swb.Ocp]:
    """Carts with springs between them and dry friction, pushed at both ends, from rest to rest: a stage lasts 0.1, and the way is as long as the horizon allows."""
    s = swb.Scene(carts, u="left right")
    force = [0.0 * s.u[0]] * carts
    for i in range(carts - 1):
        pull = 40.0 * (s.q[i + 1] - s.q[i]) + 4.0 * (s.v[i + 1] - s.v[i])
        force[i], force[i + 1] = force[i] + pull, force[i + 1] - pull
    force[0], force[-1] = force[0] + s.u[0], force[-1] + s.u[1]
    s.force(force)
    for i in range(carts):
        s.friction(f"cart {i + 1}", s.q[i], 0.2)
    ocp = swb.Ocp(s, 0.1 * stages, stages, initial_state=np.zeros(2 * carts), **options)
    ocp.set_lagrange(s.u[0] ** 2 + s.u[1] ** 2)
    way = np.ones(carts) * 0.05 * stages
    ocp.add_terminal([*s.q, *s.v], [*way, *np.zeros(carts)], [*way, *np.zeros(carts)])
    return s, ocp


def drawn(seed: int) -> swb.Ocp:
    """A chain of one to four carts with masses, springs, friction, horizon, stages and bounds at random."""
    draw = np.random.default_rng(seed)
    n, stages, horizon = int(draw.integers(1, 5)), int(draw.integers(5, 25)), draw.uniform(1.0, 4.0)
    s = swb.Scene(n, u=1 if n == 1 else 2)
    spring, damper, masses = draw.uniform(1.0, 50.0), draw.uniform(0.1, 4.0), draw.uniform(0.5, 2.0, n)
    s.inertia(np.diag(masses))
    force = [0.0 * s.u[0]] * n
    for i in range(n - 1):
        pull = spring * (s.q[i + 1] - s.q[i]) + damper * (s.v[i + 1] - s.v[i])
        force[i], force[i + 1] = force[i] + pull, force[i + 1] - pull
    force[0] = force[0] + s.u[0]
    if n > 1:
        force[-1] = force[-1] + s.u[1]
    s.force(force)
    for i in range(n):
        s.friction(f"cart {i + 1}", s.q[i], draw.uniform(0.05, 1.0))
    tracks = draw.integers(3) == 1
    draw.uniform()
    ocp = swb.Ocp(s, horizon, stages, initial_state=np.zeros(2 * n), max_time=8.0)
    ocp.set_lagrange(sum(u**2 for u in s.u) + (0.1 * s.q[0] ** 2 if tracks else 0.0))
    at = draw.uniform(0.3, 2.0)
    goal = [*[at] * n, *[0.0] * n]
    ocp.add_terminal([*s.q, *s.v], goal, goal)
    if draw.random() < 0.5:
        ocp.set_control_bounds([-30.0] * len(s.u), [30.0] * len(s.u))
    return ocp


def draws(seed: int, count: int) -> None:
    head(["seed", "cost", "verdict", "CPU s", "simulations"])
    for k in range(seed, seed + count):
        r, spent = solved(drawn(k))
        row([k, f"{r.cost:.6g}", r.optimality.verdict if r.success else "no solution", f"{spent:.2f}", r.stats.iterations])


def solved(ocp: swb.Ocp) -> tuple[Any, float]:
    """The result and the CPU time that it took."""
    begin = time.process_time()
    r = ocp.solve()
    return r, time.process_time() - begin


def rollout(s: swb.Scene, r: Any, horizon: float, derivatives: bool) -> float:
    """CPU milliseconds of a simulation of an answer, the least of three."""
    x0 = r.trajectory(0.0)
    times = []
    for _ in range(3):
        begin = time.process_time()
        s.simulate(x0[: s.n_q], x0[s.n_q :], horizon, u=r.controls, rtol=1e-8, atol=1e-8, sensitivity=derivatives, dense=False)
        times.append(1e3 * (time.process_time() - begin))
    return min(times)


def row(cells: list[Any]) -> None:
    print("| " + " | ".join(str(c) for c in cells) + " |")


def head(cells: list[str]) -> None:
    row(cells)
    print("|" + "---|" * len(cells))


def problems() -> None:
    pick, push = example("pick_and_place"), example("pushed_box")
    arm = pick.arm()
    cases = [
        ("arm with seven hinges, over a table", arm.scene, pick.problem(arm, [0.5, -0.3], [0.35, 0.35]), 1.2),
        ("pushed box, the hand swings", *push.problem(), push.HORIZON),
        ("pushed box, the hand stays", *push.problem(swings=False), push.HORIZON),
    ]
    head(["problem", "controls", "cost", "verdict", "CPU s", "simulations", "ms each", "with derivatives"])
    for name, scene, ocp, horizon in cases:
        r, spent = solved(ocp)
        times = [f"{rollout(scene, r, horizon, d):.1f}" for d in (False, True)] if r.success else ["", ""]
        verdict = r.optimality.verdict if r.success else "no solution"
        row([name, ocp.nu * ocp.n_stages, f"{r.cost:.6g}", verdict, f"{spent:.1f}", r.stats.iterations, *times])


def scale() -> None:
    head(["carts", "stages", "controls", "cost", "verdict", "CPU s", "simulations", "CPU ms each", "simulation ms", "with derivatives"])
    cases = [(4, n) for n in (20, 40, 80, 160, 320)] + [(n, 40) for n in (8, 16, 32)]
    for carts, stages in cases:
        s, ocp = chain(carts, stages, max_time=120.0)
        r, spent = solved(ocp)
        times = [f"{rollout(s, r, 0.1 * stages, d):.1f}" for d in (False, True)] if r.success else ["", ""]
        verdict = r.optimality.verdict if r.success else "no solution"
        row([carts, stages, 2 * stages, f"{r.cost:.6g}", verdict, f"{spent:.1f}", r.stats.iterations, f"{1e3 * spent / max(r.stats.iterations, 1):.1f}", *times])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--page", action="store_true", help="both tables")
    parser.add_argument("--scale", action="store_true", help="the chain of carts")
    parser.add_argument("--draws", nargs=2, type=int, metavar=("SEED", "COUNT"), help="chains drawn at random")
    given = parser.parse_args()
    if given.draws:
        draws(*given.draws)
        return
    if given.page or not given.scale:
        problems()
        print()
    if given.page or given.scale:
        scale()


if __name__ == "__main__":
    main()
