"""Algebraic equations of index 1: hybrid systems next to SciPy and Newton's method, with the logic written by hand."""

import itertools

import casadi as ca
import numpy as np
import pytest
import scipy.integrate
import switchback_control as swb

RTOL = 1e-8


class Ops:
    """Functions of one side: of models here, or of CasADi."""

    def __init__(self, side):
        self.sin, self.cos, self.exp, self.sqrt = side.sin, side.cos, side.exp, side.sqrt


HERE, THERE = Ops(swb), Ops(ca)


class Hand:
    """A hybrid system by hand. `modes` name a function of (o, x, z, t) that gives derivatives and equations; `exits` of a mode are guards, what
    follows where they become positive, and resets. The equations are solved by Newton's method wherever SciPy asks for derivatives, from `guess`, by
    the first letters of a mode, where they jump."""

    def __init__(self, nx, nz, modes, exits, guess=None):
        self.nx, self.nz, self.exits, self.guess = nx, nz, exits, guess or {}
        x, z, t = ca.SX.sym("x", nx), ca.SX.sym("z", nz), ca.SX.sym("t")
        self.equations, self.rates, self.guards, self.resets = {}, {}, {}, {}
        for name, f in modes.items():
            args = (THERE, ca.vertsplit(x), ca.vertsplit(z))
            ode, alg = (ca.vertcat(*part) for part in f(*args, t))
            ways = exits.get(name, [])
            self.equations[name] = ca.Function("h", [x, z, t], [alg, ca.jacobian(alg, z)])
            self.rates[name] = ca.Function("f", [x, z, t], [ode])
            self.guards[name] = [ca.Function("g", [x, z, t], [g(*args, t)]) for g, _, _ in ways]
            self.resets[name] = [ca.Function("r", [x, z], [ca.vertcat(*r(*args))]) if r else None for _, _, r in ways]

    def solve(self, mode, x, t):
        """Algebraic states, from the last ones."""
        z, last = self.z, np.inf
        for _ in range(200):
            h, jac = (np.array(v) for v in self.equations[mode](x, z, t))
            step = np.linalg.solve(jac, -h.ravel())
            size = np.abs(step).max()
            if size <= 1e-9 * max(1, np.abs(z).max()) and size >= last / 2:
                break
            z, last = z + step * min(1, 1 / max(size, 1e-300)), size
        self.z = z
        return z

    def run(self, mode, x, z, end):
        """State at the end, and times of all exits."""
        t, events = 0.0, []
        x, self.z = np.array(x, float), np.array(z, float)
        while t < end:
            crossings = []
            for guard in self.guards[mode]:
                g = lambda t, x, guard=guard, mode=mode: float(guard(x, self.solve(mode, x, t), t))  # noqa: E731
                g.terminal, g.direction = True, 1
                crossings.append(g)
            rates = lambda t, x, mode=mode: np.array(self.rates[mode](x, self.solve(mode, x, t), t)).ravel()  # noqa: E731
            r = scipy.integrate.solve_ivp(
                rates, (t, end), x, method="DOP853", rtol=1e-11, atol=1e-12, events=crossings, max_step=end / 100
            )
            assert r.success, r.message
            t, x = r.t[-1], r.y[:, -1]
            found = [k for k, times in enumerate(r.t_events or []) if len(times)]
            if not found:
                break
            events.append(t)
            z = self.solve(mode, x, t)
            reset = self.resets[mode][found[0]]
            x = x if reset is None else np.array(reset(x, z)).ravel()
            mode = self.exits[mode][found[0]][1]
            self.z = next((np.array(v, float) for k, v in self.guess.items() if mode.startswith(k)), self.z)
            for k, guard in enumerate(self.guards[mode]):
                # what holds already follows at once
                if float(guard(x, self.solve(mode, x, t), t)) > 1e-3:
                    mode = self.exits[mode][k][1]
                    break
        return x, self.solve(mode, x, t), events


class Problem:
    """One system: its model, the same by hand, and where both begin."""

    def __init__(self, model, hand, x0, z0, end, start, skip=()):
        self.model, self.hand, self.x0, self.z0, self.end, self.start, self.skip = model, hand, x0, z0, end, start, skip


def system(m, equations, nz):
    m.derivatives = equations
    s = m.system()
    s.set_algebraic(nz)
    return s


def tank():
    """A tank that is filled between two levels; what flows out: q² + q / 2 = 20 h."""

    def f(inflow):
        return lambda o, x, z, t: ([inflow - 0.5 * z[0]], [z[0] ** 2 + 0.5 * z[0] - 20 * x[0]])

    m = swb.Model(states="h q")
    full = m.hysteresis(m.h, 1.2, 0.4)
    (dh,), (eq,) = f(4.0 * (1 - full))(HERE, [m.h], [m.q], m.t)
    exits = {"open": [(lambda o, x, z, t: x[0] - 1.2, "shut", None)], "shut": [(lambda o, x, z, t: 0.4 - x[0], "open", None)]}
    hand = Hand(1, 1, {"open": f(4.0), "shut": f(0.0)}, exits)
    return Problem(system(m, [dh, eq], 1), hand, [0.5], [1.0], 4.0, "open")


def relaxation():
    """A capacitor that is emptied, by a reset that knows the current, where that has fallen."""

    def f(o, x, z, t):
        return [z[0]], [z[0] + 0.2 * z[0] ** 3 - (1.5 - x[0])]

    m = swb.Model(states="v i")
    m.transition(m.i < 0.4, reset={m.v: 0.3 * m.i})
    rhs, eq = f(HERE, [m.v], [m.i], m.t)
    exits = {"charge": [(lambda o, x, z, t: 0.4 - z[0], "charge", lambda o, x, z: [0.3 * z[0]])]}
    return Problem(system(m, rhs + eq, 1), Hand(1, 1, {"charge": f}, exits), [0.0], [1.0], 6.0, "charge")


def thermostat():
    """A room whose wall radiates, heated between two temperatures of the wall."""

    def f(heat):
        return lambda o, x, z, t: ([heat - 2 * (x[0] - z[0])], [2 * (x[0] - z[0]) - z[0] ** 4 + 0.1 * o.sin(t)])

    m = swb.Model(states="T wall")
    warm = m.hysteresis(m.wall, 1.1, 0.9)
    rhs, eq = f(3.0 * (1 - warm))(HERE, [m.T], [m.wall], m.t)
    exits = {"on": [(lambda o, x, z, t: z[0] - 1.1, "off", None)], "off": [(lambda o, x, z, t: 0.9 - z[0], "on", None)]}
    return Problem(system(m, rhs + eq, 1), Hand(1, 1, {"on": f(3.0), "off": f(0.0)}, exits), [0.8], [0.7], 8.0, "on")


def pendulum():
    """A pendulum by its accelerations, with the force in the rod; it hits a wall."""

    def f(o, x, z, t):
        a, b, va, vb = x
        return [va, vb, -z[0] * a, -z[0] * b - 9.81], [va * va + vb * vb - z[0] * (a * a + b * b) - 9.81 * b]

    m = swb.Model(states="a b va vb force")
    m.transition((m.a > 0.5) & (m.va > 0), reset={m.va: -0.8 * m.va, m.vb: -0.8 * m.vb})
    rhs, eq = f(HERE, list(m.x[:4]), [m.force], m.t)
    exits = {"swing": [(lambda o, x, z, t: x[0] - 0.5, "swing", lambda o, x, z: [x[0], x[1], -0.8 * x[2], -0.8 * x[3]])]}
    return Problem(system(m, rhs + eq, 1), Hand(4, 1, {"swing": f}, exits), [-0.8, -0.6, 0, 0], [1.0], 3.0, "swing")


def machine():
    """A generator behind a line, with the voltage of its bus: a fault from 1 to 1.15."""

    def f(share):
        return lambda o, x, z, t: (
            [x[1], 4 * (0.8 - share * 1.6 * z[0] * o.sin(x[0]) - 0.3 * x[1])],
            [z[0] ** 2 - (0.7 + 0.4 * o.cos(x[0])) * z[0] - 0.1 + 0.02 * x[1]],
        )

    m = swb.Model(states="angle speed voltage")
    fault = swb.where(m.t < 1, 0, swb.where(m.t < 1.15, 1, 0))
    rhs, eq = f(1 - 0.9 * fault)(HERE, list(m.x[:2]), [m.voltage], m.t)
    exits = {"good": [(lambda o, x, z, t: t - 1, "bad", None)], "bad": [(lambda o, x, z, t: t - 1.15, "cleared", None)]}
    hand = Hand(2, 1, {"good": f(1.0), "bad": f(0.1), "cleared": f(1.0)}, exits)
    return Problem(system(m, rhs + eq, 1), hand, [0.6, 0.0], [1.0], 5.0, "good")


def motor():
    """A motor with dry friction whose winding has no inductance: it sticks and slips."""

    def winding(o, x, z, t):
        return 1.5 * z[0] + 0.1 * z[0] ** 3 + 0.8 * x[0] - 3 * o.sin(t)

    def f(friction):
        return lambda o, x, z, t: ([2 * z[0] - friction], [winding(o, x, z, t)])

    m = swb.Model(states="w i")
    m.derivatives = [2 * m.i - 1.2 * swb.sign(m.w), winding(HERE, [m.w], [m.i], m.t)]
    s = m.system()
    s.set_algebraic(1)
    stick = lambda o, x, z, t: ([0 * x[0]], [winding(o, x, z, t)])  # noqa: E731
    exits = {
        "stick": [(lambda o, x, z, t: 2 * z[0] - 1.2, "ahead", None), (lambda o, x, z, t: -2 * z[0] - 1.2, "back", None)],
        "ahead": [(lambda o, x, z, t: -x[0], "stick", None)],
        "back": [(lambda o, x, z, t: x[0], "stick", None)],
    }
    hand = Hand(1, 1, {"stick": stick, "ahead": f(1.2), "back": f(-1.2)}, exits)
    return Problem(s, hand, [0.0], [0.0], 9.0, "stick")


def junction():
    """Two tanks that feed one pump through pipes; the pump works between two levels."""

    def f(pump):
        return lambda o, x, z, t: (
            [0.3 - z[0], 0.2 - z[1]],
            [x[0] - z[2] - z[0] - z[0] ** 3, x[1] - z[2] - z[1] - 2 * z[1] ** 3, z[0] + z[1] - pump],
        )

    m = swb.Model(states="a b qa qb pressure")
    on = m.hysteresis(m.a + m.b, 3.0, 2.0)
    rhs, eq = f(1.0 * on)(HERE, list(m.x[:2]), list(m.x[2:5]), m.t)
    exits = {
        "off": [(lambda o, x, z, t: x[0] + x[1] - 3, "on", None)],
        "on": [(lambda o, x, z, t: 2 - x[0] - x[1], "off", None)],
    }
    hand = Hand(2, 3, {"off": f(0.0), "on": f(1.0)}, exits)
    return Problem(system(m, rhs + eq, 3), hand, [1.5, 1.0], [0.0, 0.0, 1.0], 8.0, "off")


def rectifier(law, limit):
    """A rectifier with a diode by its exponential law; its load is taken off where the current was too large."""

    def f(load):
        return lambda o, x, z, t: (
            [(z[0] - load * x[0] / 2) / 0.2],
            [z[0] + law - law * o.exp((5 * o.sin(6.28 * t) - x[0] - 0.2 * z[0]) / 0.05)],
        )

    m = swb.Model(states="v i")
    off = m.discrete("off")
    m.transition(m.i > limit, when={off: 0}, to={off: 1})
    rhs, eq = f(1 - off)(HERE, [m.v], [m.i], m.t)
    exits = {"on": [(lambda o, x, z, t: z[0] - limit, "off", None)]}
    return Problem(system(m, rhs + eq, 1), Hand(1, 1, {"on": f(1.0), "off": f(0.0)}, exits), [0.0], [0.0], 2.0, "on")


def buck():
    """A buck converter with every pulse; the diode has its exponential law, and the node between both has no capacitance."""
    period = 0.05

    def f(closed):
        return lambda o, x, z, t: (
            [(z[0] - x[1]) / 0.05, (x[0] - x[1] / 2) / 0.02],
            [closed * (10 - z[0]) / 0.05 + 1e-4 * (o.exp(-z[0] / 0.1) - 1) - x[0]],
        )

    m = swb.Model(states="i v node")
    pulse = m.pwm(0.4, period)
    rhs, eq = f(1.0 * pulse)(HERE, list(m.x[:2]), [m.node], m.t)
    modes, exits = {}, {}
    for k in range(8):
        modes |= {f"on{k}": f(1.0), f"off{k}": f(0.0)}
        exits[f"on{k}"] = [(lambda o, x, z, t, k=k: t - (k + 0.4) * period, f"off{k}", None)]
        exits[f"off{k}"] = [(lambda o, x, z, t, k=k: t - (k + 1) * period, f"on{k + 1}", None)]
    modes["on8"] = f(1.0)
    return Problem(system(m, rhs + eq, 1), Hand(2, 1, modes, exits, {"on": [9.0], "off": [-0.5]}), [0.5, 1.0], [9.0], 0.39, "on0", skip=(0.0,))


def relay():
    """A relay on an algebraic state: it slides on a surface that moves."""

    def equation(o, x, z, t):
        return z[0] + 0.3 * z[0] ** 3 - x[0] - 0.5 * o.sin(t)

    def f(sign):
        return lambda o, x, z, t: ([x[1] - sign, 0.4 * o.cos(2 * t)], [equation(o, x, z, t)])

    m = swb.Model(states="a b c")
    m.derivatives = [m.x[1] - swb.sign(m.x[2]), 0.4 * swb.cos(2 * m.t), equation(HERE, list(m.x[:2]), [m.x[2]], m.t)]
    s = m.system()
    s.set_algebraic(1)
    slide = lambda o, x, z, t: ([-0.5 * o.cos(t), 0.4 * o.cos(2 * t)], [equation(o, x, z, t)])  # noqa: E731
    exits = {
        "above": [(lambda o, x, z, t: -z[0], "slide", None)],
        "slide": [
            (lambda o, x, z, t: x[1] + 0.5 * o.cos(t) - 1, "above", None),
            (lambda o, x, z, t: -x[1] - 0.5 * o.cos(t) - 1, "below", None),
        ],
        "below": [(lambda o, x, z, t: z[0], "slide", None)],
    }
    hand = Hand(2, 1, {"above": f(1), "slide": slide, "below": f(-1)}, exits)
    return Problem(s, hand, [1.0, 0.3], [0.5], 8.0, "above")


def diode():
    """A half-wave rectifier with an ideal diode and a resistance."""

    def on(o, x, z, t):
        return [z[0] - x[0]], [x[0] + 0.1 * z[0] - 2 * o.sin(3 * t)]

    def off(o, x, z, t):
        return [-x[0]], [z[0]]

    m = swb.Model(states="v i")
    m.derivatives = [m.i - m.v, swb.minimum(m.i, m.v + 0.1 * m.i - 2 * swb.sin(3 * m.t))]
    s = m.system()
    s.set_algebraic(1)
    exits = {
        "on": [(lambda o, x, z, t: -z[0], "off", None)],
        "off": [(lambda o, x, z, t: 2 * o.sin(3 * t) - x[0], "on", None)],
    }
    return Problem(s, Hand(1, 1, {"on": on, "off": off}, exits), [0.5], [0.0], 6.0, "off")


def doubler():
    """Villard's doubler: two ideal diodes, two capacitors, a source with a resistance."""

    def source(o, t):
        return 3 * o.sin(4 * t)

    def f(first, second):
        def g(o, x, z, t):
            node = source(o, t) - x[0] - 0.2 * (z[1] - z[0])
            eq1 = (-node - 0.1 * z[0]) if first else z[0]
            eq2 = (node - x[1] - 0.1 * z[1]) if second else z[1]
            return [z[1] - z[0], (z[1] - x[1] / 4)], [eq1, eq2]

        return g

    def voltages(o, x, z, t):
        node = source(o, t) - x[0] - 0.2 * (z[1] - z[0])
        return node + 0.1 * z[0], x[1] - node + 0.1 * z[1]

    m = swb.Model(states="a b i j")
    w = voltages(HERE, list(m.x[:2]), list(m.x[2:]), m.t)
    m.derivatives = [m.j - m.i, m.j - m.b / 4, swb.minimum(m.i, w[0]), swb.minimum(m.j, w[1])]
    s = m.system()
    s.set_algebraic(2)
    exits = {
        "none": [
            (lambda o, x, z, t: -voltages(o, x, z, t)[0], "first", None),
            (lambda o, x, z, t: -voltages(o, x, z, t)[1], "second", None),
        ],
        "first": [(lambda o, x, z, t: -z[0], "none", None), (lambda o, x, z, t: -voltages(o, x, z, t)[1], "both", None)],
        "second": [(lambda o, x, z, t: -z[1], "none", None), (lambda o, x, z, t: -voltages(o, x, z, t)[0], "both", None)],
        "both": [(lambda o, x, z, t: -z[0], "second", None), (lambda o, x, z, t: -z[1], "first", None)],
    }
    modes = {"none": f(0, 0), "first": f(1, 0), "second": f(0, 1), "both": f(1, 1)}
    return Problem(s, Hand(2, 2, modes, exits), [-0.1, 0.5], [0.0, 0.0], 6.0, "none")


def limiter():
    """A controller whose output is limited inside of its own loop: z = clip(3 (r - x - z / 2), -1, 1)."""

    def wish(o, x, z, t):
        return 3 * (1.5 * o.sin(t) - x[0] - 0.5 * z[0])

    def f(level):
        return lambda o, x, z, t: ([z[0] - 0.3 * x[0]], [z[0] - (wish(o, x, z, t) if level is None else level)])

    m = swb.Model(states="a c")
    m.derivatives = [m.x[1] - 0.3 * m.x[0], m.x[1] - swb.clip(wish(HERE, [m.x[0]], [m.x[1]], m.t), -1, 1)]
    s = m.system()
    s.set_algebraic(1)
    exits = {
        "free": [(lambda o, x, z, t: wish(o, x, z, t) - 1, "high", None), (lambda o, x, z, t: -1 - wish(o, x, z, t), "low", None)],
        "high": [(lambda o, x, z, t: 1 - wish(o, x, z, t), "free", None)],
        "low": [(lambda o, x, z, t: wish(o, x, z, t) + 1, "free", None)],
    }
    return Problem(s, Hand(1, 1, {"free": f(None), "high": f(1.0), "low": f(-1.0)}, exits), [0.0], [0.0], 9.0, "free")


def check_valve():
    """Water that flows one way only between two tanks: q ≥ 0, q + q² is the head where it flows."""

    def f(flows):
        def g(o, x, z, t):
            return [0.3 * o.sin(t) - z[0], z[0] - 0.3 * x[1]], [z[0] + z[0] ** 2 - x[0] + x[1] if flows else z[0]]

        return g

    m = swb.Model(states="a b q")
    head = m.q + m.q**2 - m.a + m.b
    m.derivatives = [0.3 * swb.sin(m.t) - m.q, m.q - 0.3 * m.b, swb.minimum(m.q, head)]
    s = m.system()
    s.set_algebraic(1)
    exits = {"flow": [(lambda o, x, z, t: -z[0], "rest", None)], "rest": [(lambda o, x, z, t: x[0] - x[1], "flow", None)]}
    return Problem(s, Hand(2, 1, {"flow": f(1), "rest": f(0)}, exits), [1.0, 0.3], [0.4], 12.0, "flow")


def play():
    """Two inertias with play between them and a soft shaft: torque = 20 deadzone(twist - torque / 40, 0.1)."""

    def f(side):
        def g(o, x, z, t):
            twist = x[0] - z[0] / 40
            return [x[1] - x[2], o.sin(2 * t) - z[0], z[0] - 0.5 * x[2]], [z[0] - (20 * (twist - side * 0.1) if side else 0)]

        return g

    m = swb.Model(states="twist v w torque")
    twist = m.twist - m.torque / 40
    dead = swb.maximum(twist - 0.1, 0) + swb.minimum(twist + 0.1, 0)
    m.derivatives = [m.v - m.w, swb.sin(2 * m.t) - m.torque, m.torque - 0.5 * m.w, m.torque - 20 * dead]
    s = m.system()
    s.set_algebraic(1)
    exits = {
        "free": [(lambda o, x, z, t: x[0] - 0.1, "ahead", None), (lambda o, x, z, t: -0.1 - x[0], "back", None)],
        "ahead": [(lambda o, x, z, t: -z[0], "free", None)],
        "back": [(lambda o, x, z, t: z[0], "free", None)],
    }
    return Problem(s, Hand(3, 1, {"free": f(0), "ahead": f(1), "back": f(-1)}, exits), [0.0, 0.2, 0.0], [0.0], 6.0, "free")


def full_wave():
    """Two ideal diodes from the ends of a transformer with resistances to one capacitor."""

    def f(first, second):
        def g(o, x, z, t):
            e = 4 * o.sin(3 * t)
            eq = [x[0] + 0.3 * z[0] - e if first else z[0], x[0] + 0.3 * z[1] + e if second else z[1]]
            return [(z[0] + z[1] - x[0]) / 0.5], eq

        return g

    m = swb.Model(states="v i j")
    e = 4 * swb.sin(3 * m.t)
    m.derivatives = [
        (m.i + m.j - m.v) / 0.5,
        swb.minimum(m.i, m.v + 0.3 * m.i - e),
        swb.minimum(m.j, m.v + 0.3 * m.j + e),
    ]
    s = m.system()
    s.set_algebraic(2)
    exits = {
        "none": [
            (lambda o, x, z, t: 4 * o.sin(3 * t) - x[0], "first", None),
            (lambda o, x, z, t: -4 * o.sin(3 * t) - x[0], "second", None),
        ],
        "first": [(lambda o, x, z, t: -z[0], "none", None)],
        "second": [(lambda o, x, z, t: -z[1], "none", None)],
    }
    hand = Hand(1, 2, {"none": f(0, 0), "first": f(1, 0), "second": f(0, 1)}, exits)
    return Problem(s, hand, [1.0], [0.0, 0.0], 5.0, "none")


def inverter():
    """An inverter with a limit of its current that feeds a grid: the current is min(wish, limit) inside of the loop with the voltage."""

    def wish(o, x, z, t):
        return 1.2 * (0.4 - 0.3 * o.sin(t) + 0.4 * z[0] + 0.1 * z[0] ** 2) + x[0] - 2 * o.sin(t)

    def f(limited):
        def g(o, x, z, t):
            rise = 0.3 - 0.3 * o.sin(t) + 0.4 * z[0] + 0.1 * z[0] ** 2
            return [rise - 0.2 * x[0]], [z[0] - (1.0 if limited else wish(o, x, z, t))]

        return g

    m = swb.Model(states="a i")
    rhs, _ = f(True)(HERE, [m.a], [m.i], m.t)
    m.derivatives = [*rhs, m.i - swb.minimum(wish(HERE, [m.a], [m.i], m.t), 1.0)]
    s = m.system()
    s.set_algebraic(1)
    exits = {
        "free": [(lambda o, x, z, t: wish(o, x, z, t) - 1, "limited", None)],
        "limited": [(lambda o, x, z, t: 1 - wish(o, x, z, t), "free", None)],
    }
    return Problem(s, Hand(1, 1, {"free": f(False), "limited": f(True)}, exits), [-1.0], [0.0], 9.0, "free")


def freewheel():
    """A coil that a switch with a clock feeds and an ideal diode keeps going, both with resistances."""
    period = 0.5

    def f(closed, conducts):
        def g(o, x, z, t):
            # the node: what comes through the switch, and through the diode
            through = closed * (4 - z[1]) / 0.2 + z[0] - x[0] - 0.01 * z[1]
            return [(z[1] - 0.5 * x[0]) / 0.3], [through, -z[1] - 0.1 * z[0] if conducts else z[0]]

        return g

    m = swb.Model(states="coil i node")
    pulse = m.pwm(0.4, period)
    through = pulse * (4 - m.node) / 0.2 + m.i - m.coil - 0.01 * m.node
    m.derivatives = [(m.node - 0.5 * m.coil) / 0.3, through, swb.minimum(m.i, m.node + 0.1 * m.i)]
    s = m.system()
    s.set_algebraic(2)
    modes, exits = {}, {}
    for k in range(4):
        modes |= {f"on{k}": f(1.0, False), f"off{k}": f(0.0, True)}
        exits[f"on{k}"] = [(lambda o, x, z, t, k=k: t - (k + 0.4) * period, f"off{k}", None)]
        exits[f"off{k}"] = [(lambda o, x, z, t, k=k: t - (k + 1) * period, f"on{k + 1}", None)]
    modes["on4"] = f(1.0, False)
    return Problem(s, Hand(1, 2, modes, exits), [0.5], [0.0, 3.0], 2.1, "on0", skip=(0.0,))


def battery():
    """A battery that is charged with a current that its voltage limits, and taken off at a level."""

    def f(current):
        def g(o, x, z, t):
            open_voltage = 3 + x[0] + 0.1 * x[0] ** 3
            return [0.5 * z[0]], [z[0] + 0.2 * z[0] ** 3 - (4.5 - open_voltage) if current else z[0] + 0.3]

        return g

    def equation(o, x, z):
        return z[0] + 0.2 * z[0] ** 3 - (4.5 - (3 + x[0] + 0.1 * x[0] ** 3))

    m = swb.Model(states="charge i")
    full = m.hysteresis(m.charge, 1.0, 0.7)
    m.derivatives = [0.5 * m.i, (1 - full) * equation(HERE, [m.charge], [m.i]) + full * (m.i + 0.3)]
    s = m.system()
    s.set_algebraic(1)
    exits = {
        "on": [(lambda o, x, z, t: x[0] - 1.0, "off", None)],
        "off": [(lambda o, x, z, t: 0.7 - x[0], "on", None)],
    }
    return Problem(s, Hand(1, 1, {"on": f(True), "off": f(False)}, exits), [0.2], [1.0], 9.0, "on")


def loop():
    """A relay inside of its own loop: z + 2 sign z = 3 a. Where neither sign solves that, z is held at zero with the relay at 3 a / 2."""

    def f(relay):
        equation = lambda a, z: z if relay is None else z + 2 * relay - 3 * a  # noqa: E731
        return lambda o, x, z, t: ([2 * o.cos(2 * t) - z[0]], [equation(x[0], z[0])])

    m = swb.Model(states="a z")
    m.derivatives = [2 * swb.cos(2 * m.t) - m.z, m.z + 2 * swb.sign(m.z) - 3 * m.a]
    s = m.system()
    s.set_algebraic(1)
    exits = {
        "up": [(lambda o, x, z, t: -z[0], "held", None)],
        "held": [(lambda o, x, z, t: 1.5 * x[0] - 1, "up", None), (lambda o, x, z, t: -1.5 * x[0] - 1, "down", None)],
        "down": [(lambda o, x, z, t: z[0], "held", None)],
    }
    hand = Hand(1, 1, {"up": f(1), "held": f(None), "down": f(-1)}, exits)
    return Problem(s, hand, [1.0], [1.0], 6.3, "up")


def feedback():
    """A relay on a state that it reaches through an equation: it slides with the relay at what keeps the state."""

    def f(relay):
        equation = lambda y, z: z - 1.5 * y - 0.1 if relay is None else z + 0.3 * y + 0.1 * z**3 - relay  # noqa: E731
        return lambda o, x, z, t: ([1.5 * x[1] + 0.1 - z[0], o.cos(t)], [equation(x[1], z[0])])

    def weight(o, x, z, t):
        return z[0] + 0.3 * x[1] + 0.1 * z[0] ** 3

    m = swb.Model(states="a b z")
    m.derivatives = [1.5 * m.b + 0.1 - m.z, swb.cos(m.t), m.z + 0.3 * m.b + 0.1 * m.z**3 - swb.sign(m.a)]
    s = m.system()
    s.set_algebraic(1)
    exits = {
        "up": [(lambda o, x, z, t: -x[0], "slide", None)],
        "slide": [(lambda o, x, z, t: weight(o, x, z, t) - 1, "up", None), (lambda o, x, z, t: -weight(o, x, z, t) - 1, "down", None)],
        "down": [(lambda o, x, z, t: x[0], "slide", None)],
    }
    hand = Hand(2, 1, {"up": f(1), "slide": f(None), "down": f(-1)}, exits)
    return Problem(s, hand, [0.3, 0.1], [1.0], 9.0, "up")


def simple():
    """x' = u - p z, z + z³ = x + x³: z is x."""
    m = swb.Model(states="level flow", controls="inflow", parameters="gain")
    m.derivatives = [m.inflow - m.gain * m.flow, m.flow + m.flow**3 - m.level - m.level**3]
    s = m.system()
    s.set_algebraic(1)
    return s


def test_results_have_algebraic_states():
    s = simple()
    run = swb.simulate(s, {"level": 1, "flow": 0}, 2.0, u=[[0.0], [1.0]], p=[1.0], rtol=1e-10, atol=1e-12, sensitivity=True)
    t = np.linspace(0, 2, 41)
    exact = np.where(t < 1, np.exp(-t), 1 + (np.exp(-1) - 1) * np.exp(1 - t))
    assert np.allclose(run(t)[:, 0], exact, atol=1e-8) and np.allclose(run(t)[:, 1], exact, atol=1e-8)
    assert np.allclose(run.y[0], run.y[1], atol=1e-9)
    assert np.allclose(run.dx_dx0, [[np.exp(-2), 0], [np.exp(-2), 0]], atol=1e-8)
    runs = swb.simulate_batch(s, [[1.0, 0.0], [-2.0, 0.0], [0.5, 9.0]], 1.0, u=[0.0], p=[1.0], rtol=1e-10, atol=1e-12)
    ends = np.array([r.x_end for r in runs])
    assert np.allclose(ends, np.exp(-1) * np.array([[1, 1], [-2, -2], [0.5, 0.5]]), atol=1e-8)
    with swb.Integrator(s, adjoint=True, rtol=1e-10, atol=1e-12) as i:
        i.set_params([1.0])
        i.reinit([1.0, 0.0])
        i.advance(1.0)
        assert i.adjoint([0.0, 1.0]).x0 == pytest.approx([np.exp(-1), 0], abs=1e-8)
        g, _ = i.hvp([0.0, 1.0], p=[1.0])
        assert g.p == pytest.approx([np.exp(-1)], abs=1e-5)


def test_what_is_refused():
    s = simple()
    for wrong in (-1, 2, 3, 2**63):
        with pytest.raises(swb.SwitchbackError):
            s.set_algebraic(wrong)
    long = swb.System(2, f0=lambda x: [x[1], 0.0])
    long.set_algebraic(1, lambda x: [x[0] - x[1], 2.0])
    with pytest.raises(swb.SwitchbackError):
        swb.simulate(long, [1.0, 1.0], 1.0)
    for start in ([1.0], [1.0, np.nan], [1.0, np.inf], None):
        with pytest.raises((swb.SwitchbackError, TypeError, ValueError)):
            swb.simulate(s, start, 1.0, u=[0.0], p=[1.0])
    # no solution, no index 1, a function that raises
    m = swb.Model(states="a c")
    m.derivatives = [m.c, m.c**2 + m.a**2 + 1]
    none = m.system()
    none.set_algebraic(1)
    with pytest.raises(swb.NumericError, match="no consistent start"):
        swb.simulate(none, [1.0, 1.0], 1.0)
    m = swb.Model(states="a c")
    m.derivatives = [m.c, m.a - swb.sin(m.t)]
    high = m.system()
    high.set_algebraic(1)
    with pytest.raises(swb.StateError, match="index 1"):
        swb.simulate(high, [0.0, 1.0], 1.0)

    def equations(x):
        if x[0] < 0.5:
            raise ZeroDivisionError("on purpose")
        return [-x[1], x[1] - x[0]]

    broken = swb.System(2, f0=equations)
    broken.set_algebraic(1)
    with pytest.raises(ZeroDivisionError, match="on purpose"):
        swb.simulate(broken, [1.0, 1.0], 2.0)
    with pytest.raises(ZeroDivisionError, match="on purpose"):
        swb.simulate(broken, [0.0, 1.0], 2.0)


def test_relays_slide_through_an_equation():
    # z = sign(x), x' = 0.3 - z: from 1 / 0.7 on z is 0.3
    m = swb.Model(states="a c")
    m.derivatives = [0.3 - m.c, m.c - swb.sign(m.a)]
    s = m.system()
    s.set_algebraic(1)
    run = swb.simulate(s, [1.0, 1.0], 5.0, sensitivity=True)
    (begins,) = run.switches
    assert run.success and begins.t == pytest.approx(1 / 0.7, abs=1e-12)
    assert begins.kind == swb.EventKind.ENTER and list(begins.after) == [0, 1]
    assert run.x_end == pytest.approx([0, 0.3], abs=1e-12) and not run.dx_dx0.any()
    assert np.allclose(run(np.linspace(1.5, 5, 9)), [0, 0.3], rtol=0, atol=1e-12)


def test_relays_that_do_not_slide_end_in_words():
    # the relay acts on a state that the relay's own algebraic state only follows
    m = swb.Model(states="a b c")
    m.derivatives = [0.3 - m.c, m.b - m.a, m.c - swb.sign(m.b)]
    s = m.system()
    s.set_algebraic(2)
    run = swb.simulate(s, [1.0, 1.0, 1.0], 5.0)
    assert not run.success and run.t_end == pytest.approx(1 / 0.7, abs=1e-6)
    assert "no weights of two of them hold the surface" in run.reason


ALL = {
    "tank": tank,
    "relaxation": relaxation,
    "thermostat": thermostat,
    "pendulum": pendulum,
    "machine": machine,
    "motor": motor,
    "junction": junction,
    "rectifier": lambda: rectifier(1e-6, 3.0),
    "sharp rectifier": lambda: rectifier(1e-12, 2.0),
    "buck": buck,
    "relay": relay,
    "diode": diode,
    "doubler": doubler,
    "limiter": limiter,
    "check valve": check_valve,
    "play": play,
    "full wave": full_wave,
    "inverter": inverter,
    "freewheel": freewheel,
    "battery": battery,
    "loop": loop,
    "feedback": feedback,
}


@pytest.mark.parametrize("name", ALL)
def test_next_to_logic_by_hand(name):
    q = ALL[name]()
    x, z, events = q.hand.run(q.start, q.x0, q.z0, q.end)
    run = swb.simulate(q.model, [*q.x0, *q.z0], q.end, rtol=RTOL, atol=1e-10)
    assert run.success, run.reason
    found = [s.t for s in run.switches] + [j.t for j in run.jumps]
    times = sorted({round(t, 9) for t in found if t not in q.skip})
    assert len(events) >= 1 and len(times) == len(events), (times, events)
    assert np.allclose(times, events, rtol=0, atol=100 * RTOL * q.end)
    n = q.hand.nx + q.hand.nz
    exact = np.concatenate([x, z])
    assert np.allclose(run.x_end[:n], exact, rtol=100 * RTOL, atol=100 * RTOL * max(1, np.abs(exact).max()))


@pytest.mark.parametrize("name", ALL)
def test_derivatives_three_ways(name):
    """Forward, adjoint and differences, by the initial state, a little before the end, where nothing happens."""
    q = ALL[name]()
    n, nz, end = q.hand.nx, q.hand.nz, 0.9871 * q.end
    start = np.array([*q.x0, *q.z0], float)
    # sources have pulses that are short next to the steps of a capacitor at rest
    how = {"rtol": 1e-12, "atol": 1e-13, "h_max": q.end / 100}
    with swb.Integrator(q.model, adjoint=True, sensitivity=True, **how) as i:
        i.reinit(i.system._start(start, "x0"))
        i.advance(end)
        forward = np.array(i.run.dx_dx0)[: n + nz]
        adjoint = np.array([i.adjoint(np.eye(i.nx)[k]).x0 for k in range(n + nz)])
    assert np.allclose(forward, adjoint, rtol=1e-10, atol=1e-12) and not forward[:, n : n + nz].any()
    for c in range(n):
        h, moved = 1e-4 * max(1, abs(start[c])), np.zeros(n + nz)
        moved[c] = h
        a, b, d, e = (swb.simulate(q.model, start + k * moved, end, **how).x_end[: n + nz] for k in (-2, -1, 1, 2))
        assert np.allclose(forward[:, c], (a - 8 * b + 8 * d - e) / (12 * h), rtol=2e-7, atol=3e-8 * max(1, np.abs(forward).max()))


def complementary(d, q):
    """The solution of 0 ≤ l ⊥ d l + q ≥ 0, by trial of all cases."""
    small = 1e-9 * (1 + np.abs(q).max())
    for on in itertools.product([False, True], repeat=len(q)):
        on, l = np.array(on), np.zeros(len(q))
        if on.any():
            l[on] = np.linalg.solve(d[np.ix_(on, on)], -q[on])
        if l.min() >= -small and (d @ l + q).min() >= -small:
            return l
    raise AssertionError("no case fits")


@pytest.mark.parametrize("seed", range(9))
def test_linear_complementarity_systems(seed):
    """x' = A x + B l + E u, 0 ≤ l ⊥ C x + D l + F u ≥ 0: D symmetric, or not, or almost of lower rank. SciPy sees the kinks as they come."""
    r = np.random.default_rng(seed)
    n, k = int(r.integers(1, 4)), int(r.integers(2, 6))
    m = r.normal(size=(k, k))
    low = r.normal(size=(k, k - 1))
    d = [m @ m.T + 0.3 * np.eye(k), 0.3 * np.eye(k) + m - m.T, low @ low.T + 0.05 * np.eye(k)][seed % 3]
    a, b, c = r.normal(size=(n, n)) - 3 * np.eye(n), 0.5 * r.normal(size=(n, k)), r.normal(size=(k, n))
    e, f, x0 = r.normal(size=n), r.normal(size=k), r.normal(size=n)

    model = swb.Model(states=[f"x{i}" for i in range(n)] + [f"l{i}" for i in range(k)])
    x, l, u = list(model.x[:n]), list(model.x[n:]), swb.sin(6 * model.t)

    def product(row, values):
        return sum(float(p) * v for p, v in zip(row, values))

    w = [product(c[i], x) + product(d[i], l) + float(f[i]) * u for i in range(k)]
    rates = [product(a[i], x) + product(b[i], l) + float(e[i]) * u for i in range(n)]
    model.derivatives = rates + [swb.minimum(l[i], w[i]) for i in range(k)]
    system = model.system()
    system.set_algebraic(k)
    run = swb.simulate(system, [*x0, *np.zeros(k)], 3.0, rtol=1e-8, atol=1e-10)
    assert run.success, run.reason

    def multipliers(t, x):
        return complementary(d, c @ x + f * np.sin(6 * t))

    exact = scipy.integrate.solve_ivp(
        lambda t, x: a @ x + b @ multipliers(t, x) + e * np.sin(6 * t), (0, 3), x0, method="DOP853", rtol=1e-9, atol=1e-11, max_step=0.03
    ).y[:, -1]
    size = max(1, np.abs(run.y[:n]).max())
    assert np.allclose(run.x_end[:n], exact, rtol=0, atol=1e-6 * size)
    assert np.allclose(run.x_end[n:], multipliers(3.0, exact), rtol=0, atol=1e-5 * size)


def held(g, q):
    """The solution z, and the relays w, of z + g w = q with w in Sign z, by trial of all signs and of what is held."""
    for signs in itertools.product([-1, 0, 1], repeat=len(q)):
        on = np.array(signs)
        h, w = on == 0, on.astype(float)
        if h.any():
            w[h] = np.linalg.solve(g[np.ix_(h, h)], q[h] - g[np.ix_(h, ~h)] @ w[~h])
        z = np.where(h, 0, q - g @ w)
        if (np.abs(w) <= 1 + 1e-9).all() and (z * on >= -1e-9).all():
            return z, w
    raise AssertionError("no signs fit")


@pytest.mark.parametrize("seed", [0, 1, 2, 3, 5, 6, 7, 11])
def test_relays_inside_of_their_own_equations(seed):
    """z + G sign(z) = C x + f sin 3t, and the relays act on x too: where no signs solve that, some z are held at zero. SciPy sees the kinks as they
    come."""
    r = np.random.default_rng(seed)
    n, k = int(r.integers(1, 4)), int(r.integers(1, 4))
    m = r.normal(size=(k, k))
    g = [m @ m.T + 0.3 * np.eye(k), 0.4 * np.eye(k) + 0.5 * (m - m.T)][seed % 2]
    a, b, c = r.normal(size=(n, n)) - 3 * np.eye(n), 0.5 * r.normal(size=(n, k)), r.normal(size=(k, n))
    e, f, s, x0 = r.normal(size=n), 2 * r.normal(size=k), 0.5 * r.normal(size=(n, k)), r.normal(size=n)

    model = swb.Model(states=[f"x{i}" for i in range(n)] + [f"z{i}" for i in range(k)])
    x, z, u = model.x[:n], model.x[n:], swb.sin(3 * model.t)
    signs = np.array([swb.sign(v) for v in z])
    rates = a @ np.array(x) + b @ np.array(z) + e * u + s @ signs
    model.derivatives = [*rates, *(np.array(z) + g @ signs - c @ np.array(x) - f * u)]
    system = model.system()
    system.set_algebraic(k)
    run = swb.simulate(system, [*x0, *np.zeros(k)], 4.0, rtol=1e-8, atol=1e-10)
    assert run.success, run.reason
    assert any(len(switch.after) == 2 for switch in run.switches)

    def rhs(t, x):
        z, w = held(g, c @ x + f * np.sin(3 * t))
        return a @ x + b @ z + e * np.sin(3 * t) + s @ w

    exact = scipy.integrate.solve_ivp(rhs, (0, 4), x0, method="DOP853", rtol=1e-9, atol=1e-11, max_step=0.03).y[:, -1]
    size = max(1, np.abs(run.y).max())
    assert np.allclose(run.x_end[:n], exact, rtol=0, atol=2e-6 * size)
    assert np.allclose(run.x_end[n:], held(g, c @ exact + f * np.sin(12.0))[0], rtol=0, atol=2e-6 * size)


@pytest.mark.parametrize("name", ["forward", "adjoint"])
def test_derivatives_of_what_is_held(name):
    """By the initial state, next to differences, through entries and exits of both kinds of surfaces."""
    m = swb.Model(states="a b z w", parameters="level share")
    through = swb.sign(m.b + 0.1 * m.a**2)
    m.derivatives = [
        2 * swb.sin(2 * m.t) - 0.5 * m.a + 0.2 * m.z,
        0.5 * swb.cos(m.t + 1) + 0.3 * m.a - m.w - 0.1 * m.w**2,
        m.z + 0.3 * m.z**3 + m.level * swb.sign(m.z) - m.a,
        m.w + 0.1 * m.w**3 - (1.2 + 0.1 * m.w) * through - m.share * m.a,
    ]
    s = m.system()
    s.set_algebraic(2)
    how = {"rtol": 1e-12, "atol": 1e-13}

    def end(x0, p):
        return swb.simulate(s, x0, 3.7, p=p, **how).x_end

    x0, p = np.array([-0.4, 0.3, 0.1, 0.1]), np.array([0.6, 0.2])
    with swb.Integrator(s, adjoint=True, sensitivity=True, **how) as i:
        i.set_params(p)
        i.reinit(x0)
        i.advance(3.7)
        assert {w.subsystem for w in i.run.switches if w.kind == swb.EventKind.ENTER} == {0, 1}
        if name == "forward":
            by_x, by_p = i.run.dx_dx0, i.run.dx_dp
        else:
            rows = [i.adjoint(np.eye(4)[k]) for k in range(4)]
            by_x, by_p = np.array([r.x0 for r in rows]), np.array([r.p for r in rows])
    h = 1e-4
    for c in range(2):
        e = h * np.eye(4)[c]
        d = (end(x0 - 2 * e, p) - 8 * end(x0 - e, p) + 8 * end(x0 + e, p) - end(x0 + 2 * e, p)) / (12 * h)
        assert np.allclose(by_x[:, c], d, rtol=2e-7, atol=3e-8)
        e = h * np.eye(2)[c]
        d = (end(x0, p - 2 * e) - 8 * end(x0, p - e) + 8 * end(x0, p + e) - end(x0, p + 2 * e)) / (12 * h)
        assert np.allclose(by_p[:, c], d, rtol=2e-7, atol=3e-8)


def test_complementarity_systems_from_matrices():
    """A rectifier with two diodes, next to the solution in closed form of its phases: C v' = i + j - v / R, 0 ≤ i ⊥ v + r i - e ≥ 0."""
    c, r, load = 0.02, 0.5, 10.0
    s = swb.System.linear_complementarity(
        [[-1 / (load * c)]], [[1 / c, 1 / c]], [[1], [1]], [[r, 0], [0, r]], [[0, 0]], [[-1, 0], [1, 0]]
    )
    assert (s.nx, s.nu, s.n_subsystems) == (3, 1, 2)
    # e = 5 charges through the first diode, e = 1 leaves the capacitor alone, e = -4 charges through the second one
    u = [[5.0], [1.0], [-4.0]]
    run = swb.simulate(s, [0, 0, 0], 0.06, u=u, rtol=1e-11, atol=1e-13)
    rate = (1 / load + 1 / r) / c

    def charge(v, e):
        limit = e / r / (1 / load + 1 / r)
        return limit + (v - limit) * np.exp(-rate * 0.02)

    v = charge(0.0, 5.0)
    assert run(0.02)[0] == pytest.approx(v, abs=1e-9)
    v *= np.exp(-0.02 / (load * c))
    # the second diode conducts from the time at which the voltage has come down to 4
    wait = load * c * np.log(v / 4)
    if wait > 0:
        v = 4.0
    limit = 4 / r / (1 / load + 1 / r)
    v = limit + (v - limit) * np.exp(-rate * (0.02 - max(wait, 0)))
    assert run.x_end == pytest.approx([v, 0, (4 - v) / r], abs=1e-8)


def test_complementarity_of_functions():
    # 0 ≤ i ⊥ v + exp(i) - 1 - e ≥ 0 in two ways: with the state, and with a function that is the state
    def build(given):
        s = swb.System(2, nu=1, f0=lambda x: [x[1] - x[0], 0.0])
        s.set_algebraic(1)
        a = (lambda x: x[1]) if given else None
        s.add_complementarity(lambda x, u: x[0] + swb.exp(x[1]) - 1 - u[0], a=a)
        return s

    u = [[1.0], [-1.0], [0.5]]
    one, other = (swb.simulate(build(k), [0, 0], 3.0, u=u, rtol=1e-10, atol=1e-12) for k in (False, True))
    assert np.allclose(one.x_end, other.x_end, rtol=0, atol=1e-12)

    def rhs(e):
        return lambda t, x: np.log(np.maximum(1, 1 + e - x)) - x

    x = np.array([0.0])
    for (e,) in u:
        x = scipy.integrate.solve_ivp(rhs(e), (0, 1), x, method="DOP853", rtol=1e-11, atol=1e-13, max_step=0.01).y[:, -1]
    assert one.x_end[0] == pytest.approx(x[0], abs=1e-8)
    assert one.x_end[1] == pytest.approx(np.log(max(1, 1.5 - x[0])), abs=1e-8)


def test_what_complementarities_refuse():
    s = swb.System(2, f0=lambda x: [x[1], 0.0])
    with pytest.raises(swb.StateError, match="set_algebraic"):
        s.add_complementarity(lambda x: x[1])
    s.set_algebraic(1)
    for wrong in ([0], [1, 1], [2], [-1], [], [0.5], [np.nan], "1", [[1]], list(range(9))):
        with pytest.raises(swb.SwitchbackError):
            s.add_complementarity(lambda x: [x[1]] * np.size(wrong), rows=wrong)
    for b in (None, "b", object()):
        with pytest.raises((swb.SwitchbackError, TypeError, ValueError)):
            s.add_complementarity(b)
    with pytest.raises(swb.SwitchbackError):
        s.add_complementarity(lambda x: x[1], a=swb.Function.affine([0, 0], np.eye(2), nx=2))
    one = [[1.0]]
    for wrong in (
        (one, one, one, [[1.0, 0.0]]),
        ([[1.0, 2.0]], one, one, one),
        (one, [[1.0, 1.0]], one, one),
        (one, one, [1.0], one),
        (one, one, one, one, [[1.0]], [[1.0, 2.0]]),
        (one, one, one, one, [1.0], one),
        (one, one, one, one, [[]], [[]]),
        ([[np.nan]], one, one, one),
        (np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), one),
        ("a", one, one, one),
        (None, one, one, one),
    ):
        with pytest.raises((swb.SwitchbackError, TypeError, ValueError)):
            swb.System.linear_complementarity(*wrong)
    # D is zero: where x comes to zero, no equation determines the multiplier
    s = swb.System.linear_complementarity([[0.0]], one, one, [[0.0]], [[-1.0]])
    run = swb.simulate(s, [1.0, 0.0], 2.0)
    assert not run.success and run.t_end == pytest.approx(1.0, abs=1e-6)
