"""Feedback through contacts: a leg hops on the spot, a paddle keeps a ball in the air. Both plants differ from their models by 5 %.

Costs ask for an energy, so that nothing says when a contact closes: the controller finds that itself, and again where the plant is early or late.

usage: hopping.py FOLDER_FOR_PLOTS
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import switchback_control as swb

G = 9.81
folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)


def paddle(restitution):
    s = swb.Scene("ball paddle", u="push", name="ball and paddle")
    s.inertia([0.1, 0.4])
    s.force([-0.1 * G, 0.4 * s.u[0]])
    s.contact("hit", gap=s.q[0] - s.q[1], e=restitution)
    return s


def leg(stiffness):
    s = swb.Scene("body foot", u="push", name="leg")
    s.inertia([2.0, 0.3])
    force = s.u[0] + stiffness * (0.5 - (s.q[0] - s.q[1])) - 4.0 * (s.v[0] - s.v[1])
    s.force([force - 2.0 * G, -force - 0.3 * G])
    s.contact("floor", gap=s.q[1])
    return s


def play(model, plant, sample, residuals, weights, limit, start, samples):
    """A closed loop with a horizon of 20 samples; weights of residuals and the control along it."""
    ocp = swb.Ocp(model, 20 * sample, 20, control_bounds=(-limit, limit))
    ocp.add_least_squares(model.function([*residuals, model.u[0]]), weights, np.zeros(len(weights)))
    ocp.add_least_squares(model.function(residuals), weights[:-1], np.zeros(len(residuals)), at="terminal")
    with swb.Nmpc(ocp, "as_rti", inner=4, shift=True) as c:
        c.initialise(start, 200)
        loop = swb.closed_loop(c, plant, start, samples)
    print(f"{model.name}: preparation {1e3 * np.median(loop.preparation):.1f} ms, feedback {1e6 * np.median(loop.feedback):.1f} us")
    return loop


def motion(plant, loop, count=20):
    """The plant between the samples."""
    run = swb.Integrator(plant.system(), rtol=1e-9, atol=1e-12)
    times, states = [], []
    for t, x, u in zip(loop.t, loop.x, loop.u):
        run.set_controls(u)
        run.reinit(x, t)
        for i in range(count):
            run.advance(t + (i + 1) / count * (loop.t[1] - loop.t[0]))
            times.append(run.time)
            states.append(run.state.copy())
    return np.array(times), np.array(states)


s = paddle(0.8)
(q, p), (v, w) = s.q, s.v
plants = [paddle(0.84)]
loops = [play(s, plants[0], 0.05, [q + v * v / (2 * G) - 0.6, p, w], [20.0, 5.0, 0.2, 0.002], 30.0, [0.6, 0, 0, 0], 100)]

s = leg(800.0)
(y, f), (v, w) = s.q, s.v
energy = y + v * v / (2 * G) + 800.0 / (4.0 * G) * (0.5 - (y - f)) ** 2
plants.append(leg(760.0))
loops.append(play(s, plants[1], 0.025, [energy - 0.65, y - f - 0.5, v - w], [20.0, 0.2, 0.002, 0.0002], 40.0, [0.6, 0.1, 0, 0], 120))

figure, axes = plt.subplots(2, 2, figsize=(9, 5), layout="constrained")
for column, plant, loop, names in zip(axes.T, plants, loops, (["ball", "paddle"], ["body", "foot"])):
    t, x = motion(plant, loop)
    for i, name in enumerate(names):
        column[0].plot(t, x[:, i], label=name)
    column[0].legend(loc="right")
    column[1].stairs(loop.u[:, 0], loop.t, baseline=None)
    column[1].set_xlabel("time")
axes[0, 0].set_ylabel("height")
axes[1, 0].set_ylabel("push")
figure.savefig(folder / "hopping.png", dpi=120)
assert loops[0].x[60:, 0].max() > 0.5 and loops[1].x[80:, 1].max() > 0.05
