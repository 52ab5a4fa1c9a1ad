"""Control of systems with dry friction: a pole on a cart is swung up, two masses on a spring are brought to rest.

The cart sticks where the force on it is smaller than the friction, and no derivative says that a larger one would move it: the
controller prepares plans that break away besides. Costs are integrated along the plant, which is simulated by events.

usage: stick_slip.py FOLDER_FOR_PLOTS
"""

import sys
from pathlib import Path

import numpy as np

import switchback_control as swb

N, H = 10, 0.1
folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)


def cart_pole(p, th, v, om, force, friction):
    """States: position, angle (pi is upright), velocities."""
    m1, m2, length, g = 1.0, 0.1, 1.0, 9.81
    cart = force - friction * swb.sign(v) + m2 * length * om**2 * swb.sin(th)
    pole = -m2 * g * length * swb.sin(th)
    a, b, d = m1 + m2, m2 * length * swb.cos(th), m2 * length**2
    return [v, om, (d * cart - b * pole) / (a * d - b * b), (a * pole - b * cart) / (a * d - b * b)]


def two_masses(p1, p2, v1, v2, force, friction):
    """The force acts on the first mass; both stand on the dry track."""
    spring = 15 * (p1 - p2)
    return [v1, v2, force - spring - friction * swb.sign(v1), spring - friction * swb.sign(v2)]


def controller(dynamics, friction, q, r, qn, limit, x0, **options):
    m = swb.Model(states="x1 x2 x3 x4", controls="F", name=dynamics.__name__)
    m.derivatives = dynamics(*m.x, m.u[0], friction)
    ocp = swb.Ocp(m, N * H, N, control_bounds=(-limit, limit), settings={"rtol": 1e-6, "atol": 1e-8})
    ocp.add_least_squares(m.function([*m.x, m.u[0]]), [*q, r], np.zeros(5))
    ocp.add_least_squares(m.function([*m.x]), qn, np.zeros(4), at="terminal")
    ocp.set_state_guess([0.0], [x0])
    return swb.Nmpc(ocp, "as_rti", shift=True, **options)


def plant(dynamics, friction, q, r):
    """The running cost is the fifth state; its references are the parameters."""
    m = swb.Model(states="x1 x2 x3 x4 cost", controls="F", parameters="r1 r2 r3 r4", name="plant")
    x = m.x[:4]
    cost = r * m.u[0] ** 2
    for weight, value, reference in zip(q, x, m.p):
        cost = cost + weight * (value - reference) ** 2
    m.derivatives = [*dynamics(*x, m.u[0], friction), cost]
    return m


def run(name, dynamics, friction, q, r, qn, limit, x0, samples, reference, kick=None, names=None):
    c = controller(dynamics, friction, q, r, qn, limit, x0)

    def refer(c, k, t):
        c.set_references(0, [*reference(t), 0])
        c.set_references(1, reference(t))

    refer(c, 0, 0.0)
    c.initialise(x0)
    loop = swb.closed_loop(
        c, plant(dynamics, friction, q, r), [*x0, 0.0], samples, p=reference, before=refer, measure=lambda x, t: x[:4],
        noise=kick or (lambda k: np.zeros(5)), rtol=1e-10, atol=1e-12,
    )  # fmt: skip
    monitor = c.monitor
    print(
        f"{name}: cost {loop.x[-1, 4]:.2f}, {monitor.alternatives} alternatives prepared, {monitor.flips} taken, "
        f"{sum(s is not swb.NmpcSource.QP for s in loop.sources)} samples without a solution, "
        f"preparation {1e3 * loop.preparation.mean():.2f} ms, feedback {1e6 * loop.feedback.mean():.1f} us"
    )
    shown = swb.ClosedLoop(loop.t, loop.x[:, :4], loop.measured, loop.u, loop.sources, loop.cost, loop.preparation, loop.feedback)
    shown.plot(folder / f"{name}.svg", names)
    return loop


# the cart is sent to the other side after 6 s, and the pole is pushed over at 10 s
up = run(
    "cart_pole", cart_pole, 3.0, [1, 10, 1, 1], 0.1, [1000, 1000, 1, 1], 20.0, [1.0, 0.0, 0.0, 0.0], 160,
    reference=lambda t: np.array([0.0 if t < 6 - H / 2 else -1.0, np.pi, 0.0, 0.0]),
    kick=lambda k: np.array([0.0, -1.0, 0.0, 0.0, 0.0]) if k == 99 else np.zeros(5),
    names=["position", "angle", "velocity", "angular velocity"],
)  # fmt: skip
assert np.allclose(up.x[-1, :2], [-1, np.pi], atol=0.1)

rest = run(
    "two_masses", two_masses, 1.0, [10, 10, 1, 1], 1.0, [100, 100, 10, 10], 5.0, [-1.0, 1.0, 0.5, -0.5], 60,
    reference=lambda t: np.zeros(4), names=["position 1", "position 2", "velocity 1", "velocity 2"],
)  # fmt: skip
assert np.allclose(rest.x[-1, :4], 0, atol=0.1)
