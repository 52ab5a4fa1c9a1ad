"""Models that switch, each in a few lines, with what it becomes.

Every function returns a model, its initial state, a duration, and the controls.

usage: gallery.py FOLDER_FOR_PLOTS
"""

import sys
from pathlib import Path

import numpy as np

import switchback_control as swb
from switchback_control import clip, cos, maximum, relay, sign, sin, sqrt, where
from switchback_control.expr import Model


def driven_switch():
    """Slides along 0 while the drive is weaker than the switch."""
    m = Model(states="x")
    x = m.x[0]
    m.derivatives = [-sign(x) + 0.2 * sin(5 * m.t)]
    return m, [-0.5], 2.0, []


def dry_friction():
    """Driven oscillator with dry friction: slips, sticks."""
    m = Model(states="q v")
    q, v = m.x
    m.derivatives = [v, -q - 0.4 * sign(v) + cos(0.5 * m.t)]
    return m, [1.0, 0.0], 6.0, []


def stick_slip():
    """A block on a moving belt whose friction falls with the sliding speed."""
    m = Model(states="q v")
    q, v = m.x
    m.derivatives = [v, -q + where(v > 0.2, -1 / (0.8 + v), 1 / (1.2 - v))]
    return m, [0.5, 0.0], 6.0, []


def turbo_car():
    """Above a speed of 10 the turbo triples the acceleration."""
    m = Model(states="q v", controls="a")
    (q, v), a = m.x, m.u[0]
    m.derivatives = [v, where(v > 10, 3 * a, a)]
    return m, [0.0, 0.0], 14.0, [1.0]


def two_genes():
    """Two genes, each expressed in a band of both concentrations."""
    m = Model(states="a b")
    a, b = m.x
    m.derivative(a, 40 * where((a > 4) & (b < 8), 1, 0) - 4.5 * a)
    m.derivative(b, 40 * where((a < 8) & (b > 4), 1, 0) - 1.5 * b)
    return m, [5.0, 5.0], 1.0, []


def three_blocks():
    """Blocks on a chain of springs with dry friction; the laws add."""
    m = Model(states=6)
    q, v = m.x[:3], m.x[3:]
    springs = np.array([[-2, 1, 0], [1, -2, 1], [0, 1, -1]])
    m.derivatives = [*v, *(springs @ q - v - 0.3 * sign(v))]
    return m, [-1, 1, -1, 1, 1, 0.5], 3.0, []


def relay_feedback():
    """Three lags in a loop with a relay: a limit cycle."""
    m = Model(states="x y z")
    x, y, z = m.x
    m.derivatives = [relay(z, -1, 1) - x, x - y, y - z]
    return m, [0.0, 0.0, 0.2], 12.0, []


def tank_cascade():
    """Three tanks in a row that spill over above level 1."""
    m = Model(states=3, controls="inflow")
    h = m.x
    out = 0.6 * sqrt(h) + 2 * maximum(h - 1, 0)
    m.derivatives = [m.u[0] - out[0], out[0] - out[1], out[1] - out[2]]
    return m, [0.4, 0.9, 0.5], 8.0, [1.0]


def motor():
    """A motor under a saturated position controller, with dry friction."""
    m = Model(states="angle speed current")
    angle, speed, current = m.x
    voltage = clip(12 * (1 - angle) - 2 * speed, -6, 6)
    m.derivative(angle, speed)
    m.derivative(speed, 5 * current - 0.1 * speed - 0.8 * sign(speed))
    m.derivative(current, 10 * (voltage - current) - 2 * speed)
    return m, [0.0, 0.0, 0.0], 4.0, []


def pendulum():
    """Nothing switches: plain collocation."""
    m = Model(states="angle speed")
    angle, speed = m.x
    m.derivatives = [speed, -9.81 * sin(angle)]
    return m, [1.0, 0.0], 2.0, []


GALLERY = (
    driven_switch,
    dry_friction,
    stick_slip,
    turbo_car,
    two_genes,
    three_blocks,
    relay_feedback,
    tank_cascade,
    motor,
    pendulum,
)


def main():
    import matplotlib.pyplot as plt

    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    folder.mkdir(parents=True, exist_ok=True)
    figure, axes = plt.subplots(5, 2, figsize=(9, 11), layout="constrained")
    print(f"{'model':15} {'groups':>6} {'psi':>4} {'modes':>6} {'pairs':>6} {'switches':>9}  end")
    for make, ax in zip(GALLERY, axes.flat):
        model, x0, duration, u = make()
        r = swb.simulate_fesd(model.system(), x0, duration, n_steps=40, n_s=3, n_fe=3, u=u or None)
        c = model.counts()
        end = " ".join(f"{v:.6f}" for v in r.state)
        switches = len(r.trajectory.switches)
        print(
            f"{make.__name__:15} {c.subsystems:6} {c.switching_functions:4} {c.regions:6} {c.pairs:6} {switches:9}"
            f"  {end} {r.message}"
        )
        t = np.linspace(0, duration, 600)
        ax.plot(t, r.trajectory(t))
        ax.set_title(make.__name__)
    figure.savefig(folder / "python_gallery.svg")


if __name__ == "__main__":
    main()
