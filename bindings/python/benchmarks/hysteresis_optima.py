"""How often control problems with hysteresis end more than 1 % above the least cost of all runs, without a guess and from random ones.

Six problems, four sets of figures each: a heated room, a gate that lets go, a car with a turbo, two tanks with a pump, two relays, a battery with a
fan. `--without` leaves the second look at sequences elsewhere out (`ocp_start="homotopy"`); run both to compare, least costs are those of one run.

usage: hysteresis_optima.py [--without] [NAME ...]
"""

import sys
import time

import numpy as np

import switchback_control as swb

PROBLEMS = {}
DEAR = 1.01


def problem(make):
    PROBLEMS[make.__name__] = make
    return make


@problem
def room(vary, **options):
    """A heater that goes on below 18 and off above 21 and a second one that is controlled, at the least effort near 20."""
    m = swb.Model(states="T W", controls="u", name="room")
    (air, wall), u = m.x, m.u[0]
    heater = m.hysteresis(-air, on=-18.0, off=-21.0, name="heater")
    m.derivatives = [-0.3 * (air - wall) + 3 * heater + 2 * u, 0.1 * (air - wall) - 0.05 * (wall - 5)]
    ocp = swb.Ocp(m, 8 * vary(), 16, n_s=2, n_fe=2, initial_state=[19, 15], control_bounds=(0, 1), **options)
    ocp.set_lagrange(m.function(u**2 + 0.05 * (air - 20) ** 2))
    ocp.add_terminal(m.function([air]), [19.5], [20.5])
    return ocp


@problem
def gate(vary, **options):
    """A mass that a gate holds back from 0.6 on until it has gone back to 0.3; to 1, at rest."""
    m = swb.Model(states="q v", controls="u", name="gate")
    (q, v), u = m.x, m.u[0]
    holds = m.hysteresis(q, on=0.6 * vary(), off=0.3, name="gate")
    m.derivatives = [v, u - 0.3 * v - 1.5 * holds]
    ocp = swb.Ocp(m, 4 * vary(), 16, n_s=2, n_fe=2, initial_state=[0, 0], control_bounds=(-3, 3), **options)
    ocp.set_lagrange(m.function(u**2))
    ocp.add_terminal(m.function([q, v]), [1, 0], [1, 0])
    return ocp


@problem
def turbo(vary, **options):
    """A car whose drive is stronger between two speeds, and dearer; to 6, at rest."""
    m = swb.Model(states="q v", controls="u", name="turbo")
    (_, v), u = m.x, m.u[0]
    boost = m.hysteresis(v, on=1.5 * vary(), off=0.8, name="boost")
    m.derivatives = [v, (1 + 1.5 * boost) * u - 0.2 * v]
    ocp = swb.Ocp(m, 5 * vary(), 20, n_s=2, n_fe=2, initial_state=[0, 0], control_bounds=(-2, 2), **options)
    ocp.set_lagrange(m.function(u**2 + 0.1 * boost))
    ocp.add_terminal(m.function(m.x), [6, 0], [6, 0])
    return ocp


@problem
def tanks(vary, **options):
    """A pump empties the second of two tanks between two levels; from levels to levels."""
    m = swb.Model(states="h1 h2", controls="u", name="tanks")
    (h1, h2), u = m.x, m.u[0]
    pump = m.hysteresis(h2, on=0.8 * vary(), off=0.4, name="pump")
    m.derivatives = [u - 0.4 * h1, 0.4 * h1 - 0.5 * pump]
    ocp = swb.Ocp(m, 6 * vary(), 18, n_s=2, n_fe=2, initial_state=[0.5, 0.5], control_bounds=(0, 1), **options)
    ocp.set_lagrange(m.function(u**2 + 0.2 * (h2 - 0.9) ** 2))
    ocp.add_terminal(m.function([h1, h2]), [0.6, 0.6], [0.6, 0.6])
    return ocp


@problem
def relays(vary, **options):
    """An oscillator with a relay on its position and one on its velocity."""
    m = swb.Model(states="x y", controls="u", name="relays")
    (x, y), u = m.x, m.u[0]
    a = m.hysteresis(x, on=0.5 * vary(), off=-0.2, name="a")
    b = m.hysteresis(y, on=0.4 * vary(), off=-0.1, name="b")
    m.derivatives = [y - 0.5 * a + u, -x + 0.8 * b - 0.3 * y]
    ocp = swb.Ocp(m, 4 * vary(), 16, n_s=2, n_fe=2, initial_state=[-0.5, 0], control_bounds=(-1, 1), **options)
    ocp.set_lagrange(m.function(u**2 + 0.3 * x**2 + 0.3 * y**2))
    ocp.add_terminal(m.function([x, y]), [0.3, 0.2], [0.3, 0.2])
    return ocp


@problem
def battery(vary, **options):
    """A charge whose losses heat, with a fan that costs and goes on and off by the temperature."""
    m = swb.Model(states="E T", controls="p", name="battery")
    (_, heat), p = m.x, m.u[0]
    fan = m.hysteresis(heat, on=1.0 * vary(), off=0.6, name="fan")
    m.derivatives = [p, 0.5 * p**2 - (0.2 + 0.8 * fan) * heat]
    ocp = swb.Ocp(m, 5 * vary(), 20, n_s=2, n_fe=2, initial_state=[0, 0.5], control_bounds=(-2, 2), **options)
    ocp.set_lagrange(m.function(0.1 * p**2 + 0.4 * fan + 0.2 * heat))
    ocp.add_terminal(m.function([m.x[0]]), [4], [4])
    return ocp


def runs(make, figures, options):
    """Cost, iterations and CPU seconds without a guess and from two random ones."""
    for k in range(3):
        factors = iter(figures)
        ocp = make(lambda: next(factors), **options)
        if k:
            ocp.set_control_guess(ocp.random_starts(1 + k)[k])
        clock = time.process_time()
        result = ocp.solve()
        yield result.cost if result.success else np.inf, result.stats.iterations, time.process_time() - clock


def main(arguments):
    options = {"ocp_start": "homotopy"} if "--without" in arguments else {}
    names = [a for a in arguments if not a.startswith("-")] or list(PROBLEMS)
    dear, count, iterations, seconds = np.zeros(2, int), np.zeros(2, int), 0, 0.0
    for name in names:
        for seed in range(4):
            figures = np.random.default_rng(seed).uniform(0.8, 1.25, 12) if seed else np.ones(12)
            found = list(runs(PROBLEMS[name], figures, options))
            least = min(f[0] for f in found)
            for k, (cost, its, took) in enumerate(found):
                dear[int(k > 0)] += not cost <= DEAR * least
                count[int(k > 0)] += 1
                iterations, seconds = iterations + its, seconds + took
            print(f"{name:8} {seed}  " + "  ".join(f"{c:12.8g} {i:6} {s:6.2f} s" for c, i, s in found), flush=True)
    print(f"dear: {dear[0]} of {count[0]} without a guess, {dear[1]} of {count[1]} from random ones; {iterations} iterations, {seconds:.1f} s")


if __name__ == "__main__":
    main(sys.argv[1:])
