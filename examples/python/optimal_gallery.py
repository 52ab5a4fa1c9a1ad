"""Optimal control of systems that switch: each problem in a few lines, solved from its default start.

What is printed: the cost, how the problem ended, the type of stationarity, the largest residual, how far a simulation of
the controls is from the answer, and the time. A plot of every solution is written. The problems and their costs are those
of the C gallery (`examples/c/gallery.c`) and of `report gallery`.

usage: optimal_gallery.py FOLDER_FOR_PLOTS [NAME ...]
"""

import sys
import time
from pathlib import Path
from typing import NamedTuple

import limit_cycles
import numpy as np

import switchback_control as swb
from switchback_control import cos, sign, sin, where
from switchback_control.expr import Model


class Problem(NamedTuple):
    """A problem, and the names of its states and controls."""

    ocp: swb.Ocp
    states: list[str]
    controls: list[str] = []


def sliding_mode():
    """Two curves catch the state one after the other, and let it go again."""
    m = Model(states="q1 q2 v1 v2", controls="u1 u2")
    (q1, q2, v1, v2), (u1, u2) = m.x, m.u
    m.derivatives = [v1 - sign(q1 + 0.15 * q2**2), v2 - sign(q2 - 0.05 * q1**3), u1, u2]
    start = [2 * np.pi / 3, np.pi / 3, 0, 0]
    ocp = swb.Ocp(m, 4.0, 6, n_s=3, n_fe=4, initial_state=start, control_bounds=(-10, 10))
    ocp.set_state_bounds([-np.inf, -np.inf, -2, -2], [np.inf, np.inf, 2, 2])
    ocp.set_lagrange(m.function([u1**2 + u2**2 + v1**2 + v2**2]))
    goal = [-np.pi / 6, -np.pi / 4]
    ocp.add_terminal(m.function([q1, q2]), goal, goal)
    return Problem(ocp, *m.names[:2])


def turbo_car():
    """Time-optimal: the car gets over 15 m/s as soon as it can, where the turbo triples its acceleration, and brakes late."""
    m = Model(states="q v", controls="u")
    (q, v), u = m.x, m.u[0]
    m.derivatives = [v, where(v > 15, 3 * u, u)]
    ocp = swb.Ocp(m, 10.0, 10, n_fe=3, initial_state=[0, 0], control_bounds=(-5, 5))
    ocp.set_state_bounds([-np.inf, -25], [np.inf, 25])
    ocp.set_lagrange(m.function([1.0]))
    ocp.add_terminal(m.function([q, v]), [200, 0], [200, 0])
    ocp.set_free_time("horizon", 1, 40)
    return Problem(ocp, *m.names[:2])


def cart_pole():
    """Swing-up with dry friction under the cart: it rests in between only where the force is too small to move it."""
    m = Model(states="q a v w", controls="force")
    (q, a, v, w), force = m.x, m.u[0]
    mass, pole, length, g, friction = 1.0, 0.1, 1.0, 9.81, 2.0
    push = force - friction * sign(v) + pole * sin(a) * (length * w**2 + g * cos(a))
    reach = mass + pole * sin(a) ** 2
    turn = -(cos(a) * (force - friction * sign(v) + pole * length * w**2 * sin(a)) + (mass + pole) * g * sin(a))
    m.derivatives = [v, w, push / reach, turn / (length * reach)]
    ocp = swb.Ocp(m, 4.0, 40, n_s=5, n_fe=2, initial_state=[1, 0, 0, 0], control_bounds=(-30, 30))
    goal = [0, np.pi, 0, 0]
    ocp.set_state_guess([0, 1, 4], [[1, 0, 0, 0], goal, goal])  # the pole is up soon
    states = m.function([q, a, v, w])
    ocp.add_least_squares(states, [1, 100, 1, 1], goal)
    ocp.add_least_squares(m.function([force]), [1.0], [0.0])
    ocp.add_least_squares(states, [100, 100, 10, 10], goal, at="terminal")
    return Problem(ocp, *m.names[:2])


def motor():
    """A motor drives a load over a spring; dry friction holds the load until the spring is wound up."""
    m = Model(states="a b va vb current", controls="voltage")
    (a, b, va, vb, current), voltage = m.x, m.u[0]
    spring = 8 * (a - b) + 0.2 * (va - vb)
    m.derivatives = [va, vb, 5 * current - spring, spring - 0.8 * sign(vb), 10 * (voltage - va - 0.5 * current)]
    ocp = swb.Ocp(m, 3.0, 12, n_s=4, n_fe=3, initial_state=np.zeros(5), control_bounds=(-4, 4))
    ocp.set_lagrange(m.function([voltage**2 + 0.1 * current**2]))
    ocp.add_terminal(m.function([a, b, va, vb, current]), [1, 1, 0, 0, 0], [1, 1, 0, 0, 0])
    return Problem(ocp, *m.names[:2])


def blocks():
    """Three blocks with dry friction on a chain: the force on the last one drags the others along, one after the other."""
    m = Model(states="q1 q2 q3 v1 v2 v3", controls="force")
    q, v = m.x[:3], m.x[3:]
    springs = [-2 * q[0] + q[1], q[0] - 2 * q[1] + q[2], q[1] - q[2] + m.u[0]]
    m.derivatives = [*v, *[s - w - 0.3 * sign(w) for s, w in zip(springs, v)]]
    ocp = swb.Ocp(m, 5.0, 10, n_s=3, n_fe=4, initial_state=[-1, 1, -1, -1, 1, 1], control_bounds=(-10, 10))
    goal = [-1, 0, 1, 0, 0, 0]
    ocp.add_least_squares(m.function([m.u[0]]), [1.0], 0.0)
    ocp.add_least_squares(m.function([*q, *v]), 6 * [1.0], goal)
    ocp.add_least_squares(m.function([*q, *v]), 6 * [100.0], goal, at="terminal")
    return Problem(ocp, *m.names[:2])


def tanks():
    """Two tanks with overflows: the first one is filled past its brim as the only way to the second."""
    m = Model(states="upper lower", controls="inflow")
    (upper, lower), inflow = m.x, m.u[0]
    over = where(upper > 1, 4 * (upper - 1), 0)
    m.derivatives = [inflow - over - 0.1 * upper, over - 0.3 * lower]
    ocp = swb.Ocp(m, 10.0, 10, n_s=4, n_fe=3, initial_state=[0.2, 0.0], control_bounds=(0, 1))
    ocp.add_least_squares(m.function([lower]), [10.0], 0.8)
    ocp.add_least_squares(m.function([inflow]), [0.1], 0.0)
    return Problem(ocp, *m.names[:2])


def friction():
    """The friction coefficient of a sliding block from measurements of its position: the sticking part tells the most."""
    m = Model(states="q v", controls=0, parameters="mu")
    q, v = m.x
    m.derivatives = [v, -m.p[0] * sign(v)]
    mu, n = 0.37, 8
    t = 4 * np.arange(1, n + 1) / n
    data = np.where(t < 1 / mu, t - mu * t**2 / 2, 0.5 / mu)
    ocp = swb.Ocp(m, 4.0, n, n_fe=2, initial_state=[0, 1], params=[0.6])
    ocp.set_param_bounds(0.05, 2.0)
    ocp.add_least_squares(m.function([q]), [1.0], data.reshape(-1, 1), at="control_grid")
    return Problem(ocp, *m.names[:2])


def _cycle(make):
    c = make()
    return Problem(limit_cycles.problem(c, limit_cycles.observe(c)), c.model.names[0])


def relay_cycle():
    """Half a limit cycle of a relay feedback: twice the output slides along zero. The length is free, there is no control."""
    return _cycle(limit_cycles.relay_cycle)


def stick_slip():
    """A limit cycle: a block sticks to a belt until the spring tears it off."""
    return _cycle(limit_cycles.stick_slip)


def stick_slip_2():
    """A limit cycle of two blocks on a belt: between the slips of one and of the other both stick."""
    return _cycle(limit_cycles.stick_slip_2)


def _on(condition):
    return where(condition, 1, 0)


def two_genes(**options):
    """Two genes, each made in a band of both concentrations: a pulse of the inducer lets the first win the race to 8, where
    it shuts the other one off (Acary, de Jong, Brogliato 2014)."""
    m = Model(states="a b", controls="inducer")
    (a, b), inducer = m.x, m.u[0]
    m.derivatives = [40 * _on((a > 4) & (b < 8)) - 4.5 * a + inducer, 40 * _on((a < 8) & (b > 4)) - 1.5 * b]
    # distances to thresholds are of the size 10, and so are their products with weights at the start
    chosen = {"n_s": 4, "n_fe": 2, "sigma_init": 10.0} | options
    ocp = swb.Ocp(m, 0.5, 10, initial_state=[5, 5], control_bounds=(0, 40), **chosen)
    ocp.add_least_squares(m.function([inducer]), [0.001], 0.0)
    ocp.add_least_squares(m.function([a, b]), [1, 1], [8.5, 0])
    return Problem(ocp, *m.names[:2])


def irma(**options):
    """Five genes of yeast that switch one another (IRMA): a little inducer keeps CBF1 above its threshold longer, so SWI5
    falls later. Concentrations in 0.01, time in minutes."""
    m = Model(states="CBF1 GAL4 SWI5 GAL80 ASH1", controls="inducer")
    (cbf1, gal4, swi5, gal80, ash1), inducer = m.x, m.u[0]
    m.derivatives = [
        0.011 + 0.09 * _on(gal80 > 4) + inducer - 0.05 * cbf1,
        0.03 + 15 * _on(cbf1 > 1) - 0.04 * gal4,
        0.06 + 1.8 * _on(gal4 > 6) - 0.05 * swi5,
        _on(gal4 > 1) * (0.05 + 3 * (1 - _on(swi5 > 3.5))) - 0.02 * gal80,
        0.075 + 1.5 * _on(gal4 > 8) - 0.6 * ash1,
    ]
    chosen = {"n_s": 4, "n_fe": 2, "sigma_init": 10.0, "dcs_form": "heaviside"} | options
    ocp = swb.Ocp(m, 160.0, 8, initial_state=[1.1, 9, 4, 5, 1.5], control_bounds=(0, 0.1), **chosen)
    ocp.add_least_squares(m.function([inducer]), [1000.0], 0.0)
    ocp.add_least_squares(m.function([swi5]), [1.0], 20.0, at="terminal")
    return Problem(ocp, *m.names[:2])


PROBLEMS = [
    sliding_mode,
    turbo_car,
    cart_pole,
    motor,
    blocks,
    tanks,
    friction,
    relay_cycle,
    stick_slip,
    stick_slip_2,
    two_genes,
    irma,
]


def main() -> int:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    folder.mkdir(parents=True, exist_ok=True)
    chosen = [p for p in PROBLEMS if len(sys.argv) < 3 or p.__name__ in sys.argv[2:]]
    print(
        f"{'problem':<16}{'cost':>14}{'outcome':>10}{'polished':>10}{'type':>6}"
        f"{'primal':>9}{'E(T)':>9}{'seconds':>9}  iterations"
    )
    failed = 0
    for problem in chosen:
        ocp, states, controls = problem()
        start = time.perf_counter()
        r = ocp.solve()
        seconds = time.perf_counter() - start
        error = r.accuracy.terminal if r.accuracy else float("nan")
        print(
            f"{problem.__name__:<16}{r.cost:14.8f}{r.outcome!s:>10}{r.polished!s:>10}{ocp.certificate.stationarity:>6}"
            f"{r.residuals.primal:9.1e}{error:9.1e}{seconds:9.3f}  {r.stats.iterations}"
        )
        print(f"    {problem.__doc__}")
        figure = folder / f"optimal-{problem.__name__}.svg"
        r.plot(figure, names=states, control_names=controls, title=problem.__name__)
        failed += not r.success
    return failed


if __name__ == "__main__":
    sys.exit(main())
