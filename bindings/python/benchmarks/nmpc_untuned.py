"""Five closed loops that nothing was tuned for: what the defaults of a controller do with them.

usage: nmpc_untuned.py [--out FOLDER]

Weights are round numbers of the kind a user would begin with; they, the horizons and the options were set once and not changed after the
first run. The plant differs from the model (mass, friction, losses), measurements have noise, and every loop has an event in the
middle. Printed are where it ended, where controls came from, how often the control turned round in the last quarter, and times;
plots are written to the folder.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import switchback_control as swb


def squares(ocp, m, outputs, weights, target, end):
    ocp.add_least_squares(m.function([*outputs, *m.u]), [*weights, *end[1]], [*target, *np.zeros(len(end[1]))])
    ocp.add_least_squares(m.function(list(outputs)), end[0], target, at="terminal")


def pendulum(mass=0.25, friction=0.6):
    """A pendulum on a cart with dry friction, to be swung up; the plant has another mass and more friction."""
    m = swb.Model(states="p a v w", controls="F", name="pendulum")
    p, a, v, w = m.x
    mc, length, g = 1.2, 0.6, 9.81
    force = m.u[0] - friction * swb.sign(v)
    d = mc + mass * swb.sin(a) ** 2
    t = force + mass * length * w**2 * swb.sin(a)
    acc = (t - mass * g * swb.sin(a) * swb.cos(a)) / d
    m.derivatives = [v, w, acc, (g * swb.sin(a) - acc * swb.cos(a)) / length]
    return m


def dry_pendulum():
    m = pendulum()
    ocp = swb.Ocp(m, 1.5, 15, control_bounds=(-15, 15), settings={"rtol": 1e-6, "atol": 1e-8})
    squares(ocp, m, m.x, [2, 10, 0.1, 0.1], np.zeros(4), ([50, 100, 5, 5], [0.01]))
    def push(x, k):
        return x + (np.array([0, 0, 0, 1.5]) if k == 50 else 0)
    return ocp, pendulum(0.3, 0.8), [0, np.pi, 0, 0], 90, {"shift": True}, [1e-3, 1e-3, 5e-3, 5e-3], push, lambda x: abs(x[1]) < 0.1 and abs(x[0]) < 0.2


def rooms(loss=0.12):
    """Two rooms and a heater that switches itself off above its own limit, on below (a relay without hysteresis)."""
    m = swb.Model(states="a b h", controls="power", name="rooms")
    a, b, h = m.x
    relay = 0.5 * (1 - swb.sign(h - 3.0))
    m.derivatives = [0.3 * (h - a) - 0.2 * (a - b) - loss * a, 0.2 * (a - b) - loss * b, m.u[0] * (0.2 + 0.8 * relay) - 0.5 * (h - a)]
    return m


def heated_rooms():
    m = rooms()
    ocp = swb.Ocp(m, 6.0, 12, control_bounds=(0, 3), settings={"rtol": 1e-6, "atol": 1e-8})
    squares(ocp, m, [m.x[0], m.x[1]], [1, 2], [1.2, 0.6], ([5, 10], [0.02]))
    def window(x, k):
        return x - (np.array([0.5, 0.1, 0]) if k == 40 else 0)
    return ocp, rooms(0.16), [0.2, 0, 0.5], 80, {"shift": True}, [5e-3, 5e-3, 5e-3], window, lambda x: abs(x[0] - 1.2) < 0.4


def car(mass=1.0):
    """A car that shifts up at 10 m/s: less force of the same pedal, less drag of the engine."""
    m = swb.Model(states="s v", controls="pedal", name="car")
    s, v = m.x
    low, high = [v, (6 * m.u[0] - 0.25 * v) / mass], [v, (3.5 * m.u[0] - 0.08 * v) / mass]
    up = 0.5 * (1 + swb.sign(v - 10))
    m.derivatives = [v, low[1] * (1 - up) + high[1] * up]
    return m


def shifting_car():
    m = car()
    ocp = swb.Ocp(m, 6.0, 12, control_bounds=(-1, 1), settings={"rtol": 1e-6, "atol": 1e-8})
    squares(ocp, m, m.x, [0.02, 0.1], [100.0, 0.0], ([0.5, 2], [0.5]))
    def gust(x, k):
        return x - (np.array([0, 2.0]) if k == 15 else 0)
    return ocp, car(1.15), [0, 0], 60, {"shift": True}, [0.02, 0.02], gust, lambda x: abs(x[0] - 100) < 2 and abs(x[1]) < 0.5


def rotor(mass=0.5):
    """A quadrotor in the plane: smooth."""
    m = swb.Model(states="x z a vx vz w", controls="l r", name="rotor")
    a = m.x[2]
    thrust, torque = m.u[0] + m.u[1], m.u[1] - m.u[0]
    m.derivatives = [m.x[3], m.x[4], m.x[5], -thrust * swb.sin(a) / mass, thrust * swb.cos(a) / mass - 9.81, torque * 0.15 / 0.01]
    return m


def quadrotor():
    m = rotor()
    ocp = swb.Ocp(m, 1.5, 30, rk_family="explicit", n_s=4, n_fe=1, control_bounds=([0, 0], [6, 6]))
    squares(ocp, m, m.x, [4, 4, 0.5, 0.2, 0.2, 0.05], np.zeros(6), ([20, 20, 2, 2, 2, 0.2], [0.05, 0.05]))
    def wind(x, k):
        return x + (np.array([0, 0, 0.8, 1.5, -1.0, 4.0]) if k == 60 else 0)
    return ocp, rotor(0.55), [2, -1, 0, 0, 0, 0], 120, {"scheme": "as_rti"}, [2e-3] * 6, wind, lambda x: np.hypot(x[0], x[1]) < 0.5


def crane(load=0.8, friction=0.9):
    """A trolley with dry friction and a load on a rope, bounded in place and in the angle of the rope."""
    m = swb.Model(states="p a v w", controls="F", name="crane")
    p, a, v, w = m.x
    mt, rope, g = 2.0, 1.0, 9.81
    force = m.u[0] - friction * swb.sign(v)
    d = mt + load * swb.sin(a) ** 2
    acc = (force + load * swb.sin(a) * (rope * w**2 + g * swb.cos(a))) / d
    m.derivatives = [v, w, acc, -(acc * swb.cos(a) + g * swb.sin(a)) / rope - 0.1 * w]
    return m


def dry_crane():
    m = crane()
    ocp = swb.Ocp(m, 2.0, 16, control_bounds=(-12, 12), settings={"rtol": 1e-6, "atol": 1e-8})
    squares(ocp, m, m.x, [4, 2, 0.2, 0.2], [1.5, 0, 0, 0], ([40, 20, 4, 4], [0.01]))
    ocp.set_state_bounds([-0.5, -0.35, -np.inf, -np.inf], [1.6, 0.35, np.inf, np.inf])
    def swing(x, k):
        return x + (np.array([0, 0, 0, 0.8]) if k == 45 else 0)
    return ocp, crane(1.0, 1.1), [0, 0, 0, 0], 80, {"shift": True}, [1e-3, 1e-3, 2e-3, 2e-3], swing, lambda x: abs(x[0] - 1.5) < 0.15 and abs(x[1]) < 0.1


LOOPS = [dry_pendulum, heated_rooms, shifting_car, quadrotor, dry_crane]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out"))
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    for make in LOOPS:
        ocp, plant, x0, steps, options, noise, event, good = make()
        r = np.random.default_rng(1)
        disturb = lambda k: np.array(noise) * r.uniform(-1, 1, len(noise)) + event(np.zeros(len(noise)), k)  # noqa: B023, E731
        with swb.Nmpc(ocp, **{"scheme": "as_rti", **options}) as c:
            try:
                c.initialise(x0)
                start = "initialised"
            except swb.SwitchbackError as e:
                start = f"not initialised ({e})"
            loop = swb.closed_loop(c, plant, x0, steps, noise=disturb)
            m = c.monitor
        turns = [int(np.sum((np.diff(np.sign(u)) != 0) & (np.minimum(abs(u[1:]), abs(u[:-1])) > 0.05 * np.ptp(loop.u)))) for u in loop.u[-steps // 4 :].T]
        sources = {s.name: sum(q is s for q in loop.sources) for s in set(loop.sources)}
        print(f"{make.__name__}: {start}; ends at {np.round(loop.x[-1], 3)}, {'good' if good(loop.x[-1]) else 'BAD'}; {sources}; turns {turns}")
        print(
            f"    preparation {1e3 * loop.preparation.mean():.2f} ms (worst {1e3 * loop.preparation.max():.2f}), "
            f"feedback {1e6 * loop.feedback.mean():.1f} us (worst {1e6 * loop.feedback.max():.1f}); alternatives {m.alternatives}, taken {m.flips}, "
            f"failed linearisations {m.failed_linearisations}",
            flush=True,
        )
        try:
            loop.plot(args.out / f"nmpc_{make.__name__}.png", names=[str(n) for n in plant.names[0]] if hasattr(plant, "names") else None)
        except ImportError:
            pass


if __name__ == "__main__":
    main()
