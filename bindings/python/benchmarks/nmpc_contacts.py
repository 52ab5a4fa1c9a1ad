"""Feedback through contacts with a plant that differs: a leg that hops on the spot, a ball on a paddle.

usage: nmpc_contacts.py [--out FILE] [--samples N] [--loops NAME,NAME] [--off SHARE]

Every combination of signs of the differences is one closed loop. The same loop is run with plans that are solved to the end at every sample: from the plan that the
controller would begin with, until no step lowers the cost. Costs are sums over the samples of what the controller minimises along its horizon.
"""

from __future__ import annotations

import argparse
import datetime
import itertools
import time
from pathlib import Path

import numpy as np

import switchback_control as swb

ROOT = Path(__file__).resolve().parents[3]
G = 9.81


class Loop:
    """A scene by what may differ, its controller, and what a sample costs."""

    def __init__(self, scene, off, ocp, start, sample, cost, fallen, **options):
        self.scene, self.off, self.ocp, self.start, self.sample, self.cost, self.fallen = scene, off, ocp, start, sample, cost, fallen
        self.options = options

    def controller(self):
        c = swb.Nmpc(self.ocp, "as_rti", shift=True, **self.options)
        c.initialise(self.start, 200)
        return c


def paddle():
    """A paddle that is accelerated keeps a ball at a height: its energy is the one that belongs to that, whenever it is hit."""

    def scene(restitution=1.0, mass=1.0):
        s = swb.Scene("ball paddle", u="push", name="ball and paddle")
        s.inertia([0.1, 0.4 * mass])
        s.force([-0.1 * G, 0.4 * s.u[0]])
        s.contact("hit", gap=s.q[0] - s.q[1], e=0.8 * restitution)
        return s

    s, h, n, height = scene(), 0.05, 20, 0.6
    (q, p), (v, w), u = s.q, s.v, s.u[0]
    top = q + v * v / (2 * G) - height
    ocp = swb.Ocp(s, n * h, n, control_bounds=(-30, 30))
    ocp.add_least_squares(s.function([top, p, w, u]), [20.0, 5.0, 0.2, 0.002], np.zeros(4))
    ocp.add_least_squares(s.function([top, p, w]), [10.0, 2.0, 0.1], np.zeros(3), at="terminal")

    def cost(x, u):
        return h * (20 * (x[0] + x[2] ** 2 / (2 * G) - height) ** 2 + 5 * x[1] ** 2 + 0.2 * x[3] ** 2 + 0.002 * u[0] ** 2)

    # a ball that is no longer thrown lies on the paddle
    return Loop(scene, ["restitution", "mass"], ocp, [height, 0, 0, 0], h, cost, lambda x: x[:, 0].max() < 0.5 * height, inner=4)


def leg():
    """A body and a foot with a spring between them hop: the energy of the body with its spring is that of a height."""
    rest, k, m = 0.5, 800.0, 2.0

    def scene(stiffness=1.0, mass=1.0):
        s = swb.Scene("body foot", u="push", name="leg")
        s.inertia([m * mass, 0.3])
        force = s.u[0] + k * stiffness * (rest - (s.q[0] - s.q[1])) - 4.0 * (s.v[0] - s.v[1])
        s.force([force - m * mass * G, -force - 0.3 * G])
        s.contact("floor", gap=s.q[1])
        return s

    s, h, n, height = scene(), 0.025, 20, 0.65
    (y, f), (v, w), u = s.q, s.v, s.u[0]
    top = y + v * v / (2 * G) + k / (2 * m * G) * (rest - (y - f)) ** 2 - height
    ocp = swb.Ocp(s, n * h, n, control_bounds=(-40, 40))
    ocp.add_least_squares(s.function([top, y - f - rest, v - w, u]), [20.0, 0.2, 0.002, 0.0002], np.zeros(4))

    def cost(x, u):
        top = x[0] + x[2] ** 2 / (2 * G) + k / (2 * m * G) * (rest - (x[0] - x[1])) ** 2 - height
        return h * (20 * top**2 + 0.2 * (x[0] - x[1] - rest) ** 2 + 0.002 * (x[2] - x[3]) ** 2 + 0.0002 * u[0] ** 2)

    # a leg that no longer hops stands, and one that falls is short
    return Loop(scene, ["stiffness", "mass"], ocp, [0.6, 0.1, 0, 0], h, cost, lambda x: x[:, 1].max() < 0.02 or x[:, 0].min() < 0.2, inner=4)


LOOPS = {"paddle": paddle, "leg": leg}


def replanned(loop, plant, samples):
    """The loop with plans that are solved to the end: states, cost, seconds of the plans."""
    total, x, states, times = 0.0, np.array(loop.start, float), [], []
    simulator = swb.Integrator(plant.system(), rtol=1e-9, atol=1e-12)
    with loop.controller() as c:
        for _ in range(samples):
            c.prepare()
            c.feedback(x)
            begun = time.perf_counter()
            c.initialise(x, 500)
            times.append(time.perf_counter() - begun)
            u = c.plan.u[0]
            total += loop.cost(x, u)
            states.append(x)
            simulator.set_controls(u)
            simulator.reinit(x, 0.0)
            simulator.advance(loop.sample)
            x = np.array(simulator.state)
    return np.array(states), total, np.array(times)


def compare(name, off, samples):
    """Lines of the table."""
    loop = LOOPS[name]()
    for signs in itertools.product((1, -1), repeat=len(loop.off)):
        factors = {what: 1 + sign * off for what, sign in zip(loop.off, signs)}
        plant = loop.scene(**factors)
        with loop.controller() as c:
            own = swb.closed_loop(c, plant, loop.start, samples, cost=lambda x, u, t: loop.cost(x, u))
        states, least, plans = replanned(loop, plant, samples)
        falls = sum(loop.fallen(own.x[k : k + 100]) for k in range(0, samples, 100)), sum(loop.fallen(states[k : k + 100]) for k in range(0, samples, 100))
        what = ", ".join(f"{w} {f:.2f}" for w, f in factors.items())
        prepared, fed = 1e3 * own.preparation, 1e6 * own.feedback
        times = f"{np.median(prepared):6.2f} {np.quantile(prepared, 0.99):6.2f}   {np.median(fed):6.1f} {np.quantile(fed, 0.99):6.1f}   {1e3 * np.median(plans):6.1f} {1e3 * np.quantile(plans, 0.99):6.1f}"
        yield f"{name:7} {what:30} {own.cost:9.4f} {least:9.4f} {100 * (own.cost / least - 1):+6.1f} %   {falls[0]} {falls[1]}   {times}"


HEAD = [
    "                                              cost             to      falls   preparation ms   feedback us        plan ms",
    "        plant                            feedback replanned replanned          median   99%   median    99%   median    99%",
]

PAGE = """# Feedback through contacts

| date | machine | command |
|---|---|---|
| {date} | one core of a shared machine | `bindings/python/benchmarks/nmpc_contacts.py` |

A paddle keeps a ball at a height of 0.6 m. A leg with a spring hops on the spot. Both costs ask for an energy, so that nothing says when a contact closes.
Models and plants differ by {off:.0%}, in all combinations of signs: restitution and mass of the paddle, stiffness and mass of the leg.
Loops have {samples} samples of 50 ms (paddle) and 25 ms (leg), horizons 20 of them. The controller is `Nmpc(ocp, "as_rti", inner=4, shift=True)`.

"Replanned" solves every plan to the end at the measured state, from where the controller would begin. "Falls" counts the hundreds of samples in which the ball is not thrown
or the leg does not hop, of both loops.

```
{table}
```

The steps of `inner` are what a plan needs when a contact comes earlier or later than it was predicted.
Feedbacks solve one quadratic program. Simulations of contacts are part of the preparation. Other programs shared the cores while this was measured: the slowest
percent of times is theirs.
"""


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "docs/benchmarks/nmpc_contacts.md")
    parser.add_argument("--samples", type=int, default=1000)
    parser.add_argument("--loops", default=",".join(LOOPS))
    parser.add_argument("--off", type=float, default=0.05)
    args = parser.parse_args()
    lines = HEAD[:]
    print("\n".join(HEAD))
    for name in args.loops.split(","):
        for line in compare(name, args.off, args.samples):
            lines.append(line)
            print(line, flush=True)
    args.out.write_text(PAGE.format(date=datetime.date.today().isoformat(), samples=args.samples, off=args.off, table="\n".join(lines)))


if __name__ == "__main__":
    main()
