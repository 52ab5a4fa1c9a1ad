"""Optimal control of systems that switch: each problem in a few lines, solved from its default start.

What is printed: the cost, how the problem ended, the largest residual, how far a simulation of the controls is from the
goal, and where the time went. A plot of every solution is written.

usage: optimal_gallery.py FOLDER_FOR_PLOTS [NAME ...]
"""

import sys
import time
from pathlib import Path

import numpy as np

import switchback as swb
from switchback import cos, sign, sin, where
from switchback.expr import Model


def turbo_car():
    """Time-optimal: the car gets over 15 m/s as soon as it can, where the turbo triples its acceleration, and brakes late."""
    m = Model(states="q v", controls="u")
    (q, v), u = m.x, m.u[0]
    m.derivatives = [v, where(v > 15, 3 * u, u)]
    ocp = swb.Ocp(m.system(), 10.0, 10, n_fe=3, initial_state=[0, 0], control_bounds=(-5, 5))
    ocp.set_state_bounds([-np.inf, -25], [np.inf, 25])
    ocp.set_lagrange(m.function([1.0]))
    ocp.add_terminal(m.function([q, v]), [200, 0], [200, 0])
    ocp.set_free_time("horizon", 1, 40)
    return ocp


def cart_pole():
    """Swing-up with dry friction under the cart: it rests in between only where the force is too small to move it."""
    m = Model(states="q a v w", controls="force")
    (q, a, v, w), force = m.x, m.u[0]
    mass, pole, length, g, friction = 1.0, 0.1, 1.0, 9.81, 2.0
    push = force - friction * sign(v) + pole * sin(a) * (length * w**2 + g * cos(a))
    reach = mass + pole * sin(a) ** 2
    turn = -(cos(a) * (force - friction * sign(v) + pole * length * w**2 * sin(a)) + (mass + pole) * g * sin(a))
    m.derivatives = [v, w, push / reach, turn / (length * reach)]
    ocp = swb.Ocp(m.system(), 4.0, 20, n_s=3, n_fe=2, initial_state=[1, 0, 0, 0], control_bounds=(-30, 30))
    goal = [0, np.pi, 0, 0]
    states = m.function([q, a, v, w])
    ocp.add_least_squares(states, [1, 100, 1, 1], goal)
    ocp.add_least_squares(m.function([force]), [1.0], [0.0])
    ocp.add_least_squares(states, [100, 100, 10, 10], goal, at="terminal")
    return ocp


def motor():
    """A motor drives a load over a spring; dry friction holds the load until the spring is wound up."""
    m = Model(states="a b va vb current", controls="voltage")
    (a, b, va, vb, current), voltage = m.x, m.u[0]
    spring = 8 * (a - b) + 0.2 * (va - vb)
    m.derivatives = [va, vb, 5 * current - spring, spring - 0.8 * sign(vb), 10 * (voltage - va - 0.5 * current)]
    ocp = swb.Ocp(m.system(), 3.0, 12, n_s=3, n_fe=3, initial_state=np.zeros(5), control_bounds=(-4, 4))
    ocp.set_lagrange(m.function([voltage**2 + 0.1 * current**2]))
    ocp.add_terminal(m.function([a, b, va, vb, current]), [1, 1, 0, 0, 0], [1, 1, 0, 0, 0])
    return ocp


def blocks():
    """Three blocks with dry friction on a chain: the force on the last one drags the others along, one after the other."""
    m = Model(states=6, controls="force")
    q, v = m.x[:3], m.x[3:]
    springs = [-2 * q[0] + q[1], q[0] - 2 * q[1] + q[2], q[1] - q[2] + m.u[0]]
    m.derivatives = [*v, *[s - w - 0.3 * sign(w) for s, w in zip(springs, v)]]
    ocp = swb.Ocp(m.system(), 5.0, 10, n_s=3, n_fe=4, initial_state=[-1, 1, -1, -1, 1, 1], control_bounds=(-10, 10))
    goal = [-1, 0, 1, 0, 0, 0]
    ocp.add_least_squares(m.function([m.u[0]]), [1.0], 0.0)
    ocp.add_least_squares(m.function([*q, *v]), 6 * [1.0], goal)
    ocp.add_least_squares(m.function([*q, *v]), 6 * [100.0], goal, at="terminal")
    return ocp


def tanks():
    """Two tanks with overflows: the first one is filled past its brim as the only way to the second."""
    m = Model(states="upper lower", controls="inflow")
    (upper, lower), inflow = m.x, m.u[0]
    over = where(upper > 1, 4 * (upper - 1), 0)
    m.derivatives = [inflow - over - 0.1 * upper, over - 0.3 * lower]
    ocp = swb.Ocp(m.system(), 10.0, 10, n_s=3, n_fe=2, initial_state=[0.2, 0.0], control_bounds=(0, 1))
    ocp.add_least_squares(m.function([lower]), [10.0], 0.8)
    ocp.add_least_squares(m.function([inflow]), [0.1], 0.0)
    return ocp


def friction_from_measurements():
    """The friction coefficient of a sliding block from measurements of its position: the sticking part tells the most."""
    m = Model(states="q v", controls=0, parameters="mu")
    q, v = m.x
    m.derivatives = [v, -m.p[0] * sign(v)]
    mu, n = 0.37, 8
    t = 4 * np.arange(1, n + 1) / n
    data = np.where(t < 1 / mu, t - mu * t**2 / 2, 0.5 / mu)
    ocp = swb.Ocp(m.system(), 4.0, n, n_fe=2, initial_state=[0, 1], params=[0.6])
    ocp.set_param_bounds(0.05, 2.0)
    ocp.add_least_squares(m.function([q]), [1.0], data.reshape(-1, 1), at="control_grid")
    return ocp


PROBLEMS = [turbo_car, cart_pole, motor, blocks, tanks, friction_from_measurements]


def main() -> int:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    folder.mkdir(parents=True, exist_ok=True)
    chosen = [p for p in PROBLEMS if len(sys.argv) < 3 or p.__name__ in sys.argv[2:]]
    print(
        f"{'problem':<28}{'cost':>14}{'outcome':>10}{'polished':>10}{'primal':>9}{'E(T)':>9}{'seconds':>9}  iterations"
    )
    failed = 0
    for problem in chosen:
        ocp = problem()
        start = time.perf_counter()
        r = ocp.solve()
        seconds = time.perf_counter() - start
        error = r.accuracy.terminal if r.accuracy else float("nan")
        print(
            f"{problem.__name__:<28}{r.cost:14.8f}{r.outcome!s:>10}{r.polished!s:>10}{r.residuals.primal:9.1e}{error:9.1e}"
            f"{seconds:9.3f}  {r.stats.iterations}"
        )
        print(f"    {problem.__doc__}")
        r.plot(folder / f"optimal-{problem.__name__}.svg")
        failed += not r.success
    return failed


if __name__ == "__main__":
    sys.exit(main())
