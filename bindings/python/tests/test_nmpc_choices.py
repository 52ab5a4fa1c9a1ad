"""Feedback with controls that choose among values: against all sequences at every sample."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import switchback_control as swb

linalg = pytest.importorskip("scipy.linalg")
optimize = pytest.importorskip("scipy.optimize")


class Loop:
    """A system that is affine in its states for every value of one choice, with what its stages cost."""

    def __init__(self, model, ocp, start, h, n, dwell, rates, cost):
        self.model, self.ocp, self.start, self.h, self.n, self.dwell = model, ocp, np.array(start, float), h, n, dwell
        self.cost = cost
        self.law = {}
        for u in (0, 1):
            a, b = rates(u)
            m = np.zeros((3, 3))
            m[:2, :2], m[:2, 2] = a, b
            e = linalg.expm(m * h)
            self.law[u] = e[:2, :2], e[:2, 2]

    def step(self, x, u):
        a, b = self.law[u]
        return a @ x + b

    def price(self, x, sequence):
        total = 0.0
        for u in sequence:
            total += self.h * self.cost(x, u)
            x = self.step(x, u)
        return total + self.cost(x, None)

    def best(self, x, last, held):
        """The least cost of all sequences that keep the dwell time after a value that was held for so long."""
        out = np.inf
        stack = [((), last, held)]
        while stack:
            begun, value, time = stack.pop()
            if len(begun) == self.n:
                out = min(out, self.price(x, begun))
                continue
            for u in (0, 1):
                if value is None:
                    stack.append(((*begun, u), u, np.inf))
                elif u == value:
                    stack.append(((*begun, u), u, time + self.h))
                elif time >= self.dwell - 1e-9:
                    stack.append(((*begun, u), u, self.h))
        return out


def converter():
    """A boost converter: the current of its inductor, the voltage of its capacitor, and a switch."""
    m = swb.Model(states="i v", controls="on", name="converter")
    m.derivatives = [1.0 - 0.1 * m.i - (1 - m.on) * m.v, (1 - m.on) * m.i - 0.5 * m.v]
    m.choice("on", [0, 1])
    ocp = swb.Ocp(m, 1.0, 8, initial_state=[0, 0])
    ocp.add_least_squares(m.function([m.v - 1.5, m.i - 1.25]), [1.0, 0.1], [0, 0])
    ocp.add_least_squares(m.function([m.v - 1.5, m.i - 1.25]), [1.0, 0.1], [0, 0], at="terminal")

    def rates(u):
        return np.array([[-0.1, u - 1.0], [1.0 - u, -0.5]]), np.array([1.0, 0.0])

    return Loop(m, ocp, [0, 0], 0.125, 8, 0.0, rates, lambda x, u: (x[1] - 1.5) ** 2 + 0.1 * (x[0] - 1.25) ** 2)


def room():
    """A room and its floor, which a heater warms that stays on or off for a while."""
    m = swb.Model(states="T floor", controls="heat", name="room")
    m.derivatives = [0.8 * (m.floor - m.T) - 0.2 * (m.T - 5), 6 * m.heat - 0.8 * (m.floor - m.T)]
    m.choice("heat", [0, 1], dwell=1.5)
    ocp = swb.Ocp(m, 5.0, 10, initial_state=[17, 17])
    ocp.add_least_squares(m.function([m.T - 20]), [1.0], [0])
    ocp.set_lagrange(m.function(2 * m.heat))

    def rates(u):
        return np.array([[-1.0, 0.8], [0.8, -0.8]]), np.array([1.0, 6.0 * u])

    return Loop(m, ocp, [17, 17], 0.5, 10, 1.5, rates, lambda x, u: 0.0 if u is None else (x[0] - 20) ** 2 + 2 * u)


@pytest.mark.parametrize("make", [converter, room])
@pytest.mark.parametrize("off", [0.0, 0.02])
def test_every_sample_has_the_best_of_all_sequences(make, off):
    loop, random = make(), np.random.default_rng(7)
    x, last, held, runs = loop.start, None, np.inf, []
    # the more a measured state differs from the predicted one, the more sequences may be the best there
    with swb.Nmpc(loop.ocp, shift=True, hysteresis=0.0, flips=24 if off else 4) as c:
        c.initialise(x)
        for _ in range(50):
            assert c.prepare().ready
            u, info = c.feedback(x)
            assert info.source is swb.NmpcSource.QP and u[0] in (0.0, 1.0)
            best, plan = loop.best(x, last, held), c.plan.u[:, 0].astype(int)
            assert plan[0] == u[0] and loop.price(x, plan) <= best * (1 + 1e-9)
            if last is not None and u[0] != last:
                assert held >= loop.dwell - 1e-9
                held = 0.0
            held, last = held + loop.h, int(u[0])
            runs.append(last)
            x = loop.step(x, last) * (1 + off * random.uniform(-1, 1, 2))
    assert 0 < sum(runs[20:]) < 30
    lengths = [len(list(g)) for _, g in itertools.groupby(runs)]
    assert min(lengths[1:-1]) >= (3 if loop.dwell else 1)


def test_other_controls_beside_choices():
    """A control in an interval and one that is on or off: the least over all sequences, each a bounded least-squares problem."""
    random, n, h = np.random.default_rng(3), 5, 0.25
    for _ in range(4):
        a, b, goal = random.uniform(-1, 0.5, (2, 2)), random.uniform(-1, 1, (2, 2)), random.uniform(-1, 1, 2)
        m = swb.Model(states="y z", controls="push on")
        m.derivatives = [a[i, 0] * m.y + a[i, 1] * m.z + b[i, 0] * m.push + 2 * b[i, 1] * m.on for i in range(2)]
        m.choice("on", [0, 1])
        ocp = swb.Ocp(m, n * h, n, initial_state=[0, 0], control_bounds=([-1, 0], [1, 1]))
        ocp.add_least_squares(m.function([m.y - goal[0], m.z - goal[1], m.push]), [1, 1, 0.1], np.zeros(3))
        ocp.add_least_squares(m.function([m.y - goal[0], m.z - goal[1]]), [2, 2], np.zeros(2), at="terminal")
        big = np.zeros((4, 4))
        big[:2, :2], big[:2, 2], big[:2, 3] = a, b[:, 0], 2 * b[:, 1]
        e = linalg.expm(big * h)
        phi, gamma, jump = e[:2, :2], e[:2, 2], e[:2, 3]

        def least(x):
            out = np.inf
            for sequence in itertools.product((0, 1), repeat=n):
                rows, rhs, by, free = [], [], np.zeros((2, n)), np.array(x, float)
                for k, on in enumerate(sequence):
                    rows += [np.sqrt(h) * by, np.sqrt(0.1 * h) * np.eye(n)[k : k + 1]]
                    rhs += [np.sqrt(h) * (goal - free), np.zeros(1)]
                    by, free = phi @ by, phi @ free + jump * on
                    by[:, k] += gamma
                found = optimize.lsq_linear(np.vstack([*rows, np.sqrt(2) * by]), np.concatenate([*rhs, np.sqrt(2) * (goal - free)]), (-1, 1))
                out = min(out, 2 * found.cost)
            return out

        x = random.uniform(-1, 1, 2)
        with swb.Nmpc(ocp, shift=True, hysteresis=0.0) as c:
            c.initialise(x)
            for _ in range(4):
                c.prepare()
                u, _ = c.feedback(x)
                assert c.objective <= least(x) * (1 + 1e-6) + 1e-12 and u[1] in (0.0, 1.0)
                x = phi @ x + gamma * u[0] + jump * u[1]


def test_what_was_chosen_is_kept_without_measurements():
    loop = room()
    with swb.Nmpc(loop.ocp, shift=True) as c:
        c.initialise(loop.start)
        x, chosen = loop.start, []
        for k in range(30):
            c.prepare()
            u, _ = c.feedback(x if k % 3 else [np.nan, np.nan])
            chosen.append(int(u[0]))
            x = loop.step(x, chosen[-1])
    lengths = [len(list(g)) for _, g in itertools.groupby(chosen)]
    assert set(chosen) == {0, 1} and min(lengths[1:-1]) >= 3


def test_bounds_of_choices_stay():
    loop = converter()
    with swb.Nmpc(loop.ocp) as c:
        with pytest.raises(swb.ArgumentError, match="chooses among values"):
            c.set_control_bounds([0], [0.5])
        c.initialise(loop.start)
    loop.ocp.settings.search_exact = 0
    with swb.Nmpc(loop.ocp, shift=True) as c:  # sequences next to the plan alone
        c.initialise([1.2, 1.4])
        c.prepare()
        u, _ = c.feedback([1.2, 1.4])
        assert u[0] in (0.0, 1.0) and set(np.unique(c.plan.u)) <= {0.0, 1.0}


def test_algebraic_equations_that_modes_stand_beside():
    """A mass on a stiffening spring whose force an equation says, with dry friction: the plan is the one of the same system without the equation."""

    def controller(algebraic):
        m = swb.Model(states="q v z" if algebraic else "q v", controls="push")
        spring = m.z if algebraic else m.q + 0.3 * m.q**3
        force = m.push - spring - 0.4 * swb.sign(m.v)
        m.derivatives = [m.v, force, m.z - m.q - 0.3 * m.q**3] if algebraic else [m.v, force]
        s = m.system()
        if algebraic:
            s.set_algebraic(1)
        start = [1.0, 0.0, 1.3] if algebraic else [1.0, 0.0]
        ocp = swb.Ocp(s, 2.0, 10, initial_state=start, control_bounds=(-2, 2))
        ocp.add_least_squares(m.function([spring - 0.2, m.v, m.push]), [1.0, 0.1, 0.05], np.zeros(3))
        return swb.Nmpc(ocp, shift=True)

    with controller(True) as dae, controller(False) as ode:
        x = np.array([1.0, 0.0])
        for c in (dae, ode):
            c.initialise(x)
        for _ in range(6):
            u = []
            for c in (dae, ode):
                c.prepare()
                u.append(c.feedback(x)[0])
            assert np.allclose(dae.plan.u, ode.plan.u, atol=1e-4) and np.allclose(u[0], u[1], atol=1e-4)
            x = ode.plan.x[1]
