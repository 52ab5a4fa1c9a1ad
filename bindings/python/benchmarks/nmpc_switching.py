"""Preparations of controllers for systems that switch: closed loops with dry friction, relays and a gear, with and without noise.

usage: nmpc_switching.py [--out FILE] [--repeat N] [--loops NAME,NAME]

Of every sample the shortest of some repetitions counts. A second controller gets the same states, so that all repetitions prepare for the same.
"""

from __future__ import annotations

import argparse
import datetime
from pathlib import Path

import nmpc_untuned
import numpy as np

import switchback_control as swb

ROOT = Path(__file__).resolve().parents[3]
STAGES, SAMPLE = 10, 0.1


def two_masses(p1, p2, v1, v2, force):
    """A spring between two masses on a dry track; the force acts on the first."""
    spring = 15 * (p1 - p2)
    return [v1, v2, force - spring - swb.sign(v1), spring - swb.sign(v2)]


def cart_pole(p, th, v, om, force):
    """A pole on a cart on a dry track; pi is upright."""
    m, length, g = 0.1, 1.0, 9.81
    cart = force - 3.0 * swb.sign(v) + m * length * om**2 * swb.sin(th)
    pole = -m * g * length * swb.sin(th)
    a, b, d = 1.0 + m, m * length * swb.cos(th), m * length**2
    return [v, om, (d * cart - b * pole) / (a * d - b * b), (a * pole - b * cart) / (a * d - b * b)]


def stick_slip(dynamics, weights, effort, end, limit, start, goal):
    m = swb.Model(states="x1 x2 x3 x4", controls="F", name=dynamics.__name__)
    m.derivatives = dynamics(*m.x, m.u[0])
    ocp = swb.Ocp(m, STAGES * SAMPLE, STAGES, control_bounds=(-limit, limit), settings={"rtol": 1e-6, "atol": 1e-8})
    ocp.add_least_squares(m.function([*m.x, m.u[0]]), [*weights, effort], [*goal, 0.0])
    ocp.add_least_squares(m.function([*m.x]), end, goal, at="terminal")
    ocp.set_state_guess([0.0], [start])
    return ocp, m


def loops():
    """Names, problems, plants, starts, samples, options, noise."""
    masses = two_masses, [10, 10, 1, 1], 1.0, [100, 100, 10, 10], 5.0, [-1.0, 1.0, 0.5, -0.5], [0.0] * 4
    cart = cart_pole, [1, 10, 1, 1], 0.1, [1000, 1000, 1, 1], 20.0, [1.0, 0.0, 0.0, 0.0], [0.0, np.pi, 0.0, 0.0]
    for problem, samples in [(masses, 60), (cart, 100)]:
        for scheme, inner in [("rti", 0), ("as_rti", 1), ("as_rti", 3)]:
            options = {"scheme": scheme, **({"inner": inner} if inner else {})}
            yield f"{problem[0].__name__} {scheme} {inner}", *stick_slip(*problem), problem[5], samples, options, 0.0
        yield f"{problem[0].__name__} noise", *stick_slip(*problem), problem[5], samples, {"scheme": "as_rti"}, 1e-3
    for make in nmpc_untuned.LOOPS:
        ocp, plant, start, samples, options, noise, *_ = make()
        if options.get("shift"):
            yield make.__name__, ocp, plant, start, samples, {"scheme": "as_rti", **options}, np.array(noise)


def measure(ocp, plant, start, samples, options, noise, repeat):
    """Preparations, feedbacks and alternatives of every sample."""
    r = np.random.default_rng(1)
    loop = None
    times = np.full((2, samples), np.inf)
    for _ in range(repeat):
        with swb.Nmpc(ocp, shift=True, **{k: v for k, v in options.items() if k != "shift"}) as c:
            c.initialise(start, 200)
            if loop is None:
                loop = swb.closed_loop(c, plant, start, samples, noise=lambda k: noise * r.uniform(-1, 1, len(start)))
                c.reset()
                c.initialise(start, 200)
            prepared = [c.monitor.alternatives]
            for k, x in enumerate(loop.measured):
                times[0, k] = min(times[0, k], c.prepare().time)
                times[1, k] = min(times[1, k], c.feedback(x)[1].time)
                prepared.append(c.monitor.alternatives)
    return 1e6 * times, np.diff(prepared)


HEAD = [
    "                          samples        preparation us         feedback us",
    "loop                  all  with four      mean  with four  worst     mean  worst",
]


def line(name, times, alternatives):
    four = alternatives >= 4
    mean = f"{times[0][four].mean():9.0f}" if four.any() else "        -"
    return (
        f"{name:20} {times.shape[1]:5} {four.sum():10} {times[0].mean():9.0f}  {mean} {times[0].max():6.0f} "
        f"{times[1].mean():8.1f} {times[1].max():6.1f}"
    )


PAGE = """# Feedback for systems that switch

| date | machine | command |
|---|---|---|
| {date} | one core of a shared machine | `bindings/python/benchmarks/nmpc_switching.py` |

Two masses on a spring and a pole on a cart have dry friction. Their stages are 0.1 s long, ten of them. The other loops are those of
`nmpc_untuned.py`: a pendulum and a crane on dry tracks, rooms with a relay, a car that changes gears. "Noise" adds up to 1e-3 to every measured state.

Plans that stick get four alternatives. Every plan is simulated and linearised, improved and simulated again, with switches and exact derivatives.
Of every sample the shortest of {repeat} repetitions counts.

```
{table}
```

Where the two masses rest, nothing moves in the plan, and all of its stages are one. With friction alone no preparation allocates memory, unless rates leave
the modes in doubt.
"""


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "docs/benchmarks/nmpc_switching.md")
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--loops", default="")
    args = parser.parse_args()
    lines = HEAD[:]
    print("\n".join(HEAD))
    for name, *rest in loops():
        if args.loops and not any(part in name for part in args.loops.split(",")):
            continue
        lines.append(line(name, *measure(*rest, args.repeat)))
        print(lines[-1], flush=True)
    args.out.write_text(PAGE.format(date=datetime.date.today().isoformat(), repeat=args.repeat, table="\n".join(lines)))


if __name__ == "__main__":
    main()
