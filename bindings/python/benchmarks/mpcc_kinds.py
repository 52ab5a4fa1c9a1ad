"""Random problems of hysteresis, of driving in the least time, and of equilibria, discretised here.

usage: mpcc_kinds.py FOLDER [--hysteresis N] [--driving N] [--equilibria N] [--seed K]

Writes a folder as mpcc_contacts.py does: `--problems FOLDER --set-of hysteresis`, `driving` or `equilibria`. The solver was chosen
on none of them.

hysteresis  `thermostat`: a room and its walls, heated by what switches off and on at two temperatures; time-frozen with Voronoi
            cells, Stewart's form, FESD. `plays`: a driven mass and a sum of plays (backlash) that follows a path; implicit Euler.
driving     `gears`: a car whose acceleration depends on its speed reaches a place in the least time; FESD, Heaviside's or
            Stewart's form. `turbo`: a car whose turbo charger goes on at one speed and off at a lower one, time-frozen.
equilibria  `tolls`: revenue of tolls on some arcs of a network whose drivers take shortest paths. `capacities`: its arcs are widened
            at a cost. `leader`: quantities of a firm whose competitors, with limited capacities, answer to it (Cournot) in several
            markets. `nested`: a quadratic program above a convex quadratic program, random and sparse.
"""

from __future__ import annotations

import sys

import numpy as np

import mpcc_contacts
from mpcc_contacts import Program, Switched, sum1, switched, vertical


class Hysteresis(Switched):
    """Modes A and B that change at psi = 1 and psi = 0: the state w between them moves while physical time stands still. Cells of
    four points in the plane of psi and w; the mode is where a field that freezes and one that does not balance."""

    POINTS = np.array([[0.25, -0.25], [0.25, 0.25], [0.75, 0.75], [0.75, 1.25]])

    def indicators(self, x):
        plane = vertical(self.psi(x), x[self.clock - 1])
        return vertical(*(sum1((plane - point) ** 2) for point in self.POINTS))

    def field(self, cell, x, u):
        def gamma(s):
            return s**2 / (1.0 + s**2)

        a, b = self.modes(x, u)
        rest = np.zeros(self.clock - 1)
        down = vertical(rest, -gamma(self.psi(x) - 1.0), 0.0)
        up = vertical(rest, gamma(self.psi(x)), 0.0)
        return (2.0 * vertical(a, 0.0, 1.0) - down, down, up, 2.0 * vertical(b, 0.0, 1.0) - up)[cell]


class Room(Hysteresis):
    """Temperatures of room and walls above that outside, in 10 K; on below the lower, off above the upper one."""

    def __init__(self, rng: np.random.Generator):
        self.controls, self.clock, self.force = 1, 3, 1.0
        self.low = rng.uniform(1.5, 2.0)
        self.width = rng.uniform(0.1, 0.4)
        self.rates = rng.uniform([0.1, 0.2, 0.02], [0.4, 0.8, 0.1])  # to outside, to the walls, walls to outside
        self.heat = rng.uniform(1.5, 3.0) * self.rates[0] * (self.low + self.width)
        self.extra = rng.uniform(0.2, 0.8) * self.heat
        self.wanted = self.low + rng.uniform(0.0, 1.0) * self.width

    def psi(self, x):
        return (x[0] - self.low) / self.width

    def modes(self, x, u):
        loss = -self.rates[0] * x[0] - self.rates[1] * (x[0] - x[1]) + self.extra * u
        wall = 0.5 * self.rates[1] * (x[0] - x[1]) - self.rates[2] * x[1]
        return vertical(loss + self.heat, wall), vertical(loss, wall)

    def running(self, x, u):
        return 10.0 * (x[0] - self.wanted) ** 2 + 0.1 * sum1(u**2)


class Turbo(Hysteresis):
    """Place and speed in tens of metres; the turbo multiplies the acceleration."""

    def __init__(self, rng: np.random.Generator):
        self.controls, self.clock, self.ends, self.pace = 1, 3, False, (0.1, 10.0, 1.0)
        self.force = rng.uniform(0.3, 0.8)
        self.off, self.width = rng.uniform(0.6, 1.2), rng.uniform(0.3, 0.7)
        self.more = rng.uniform(2.0, 4.0)
        self.goal = rng.uniform(5.0, 18.0)
        self.drag = rng.uniform(0.0, 0.05)

    def psi(self, x):
        return (x[1] - self.off) / self.width

    def modes(self, x, u):
        return vertical(x[1], u - self.drag * x[1]), vertical(x[1], self.more * u - self.drag * x[1])

    def running(self, x, u):
        return 1e-3 * sum1(u**2)


class Gears(Switched):
    """Place and speed; the faster, the less or the more the engine does."""

    def __init__(self, rng: np.random.Generator):
        self.controls, self.force = 1, 1.0
        self.pace = (0.05, 20.0, 1.0)
        count = int(rng.integers(1, 3))
        self.speeds = np.cumsum(rng.uniform(0.5, 1.5, count))
        self.pull = rng.uniform(0.5, 3.0, count + 1)
        self.drag = rng.uniform(0.0, 0.1)
        self.goal = rng.uniform(3.0, 15.0)

    def functions(self, x):
        return x[1] - vertical(*self.speeds)

    def field(self, passed, x, u):
        return vertical(x[1], self.pull[sum(passed)] * u - self.drag * x[1] ** 2)

    def running(self, x, u):
        return 1.0 + 1e-3 * sum1(u**2)


def thermostat(p: Program, rng: np.random.Generator) -> None:
    """A heated room through the horizon."""
    model = Room(rng)
    sizes = int(rng.integers(5, 13)), int(rng.integers(2, 4)), rng.uniform(3.0, 6.0)
    on = rng.random() < 0.5
    start = np.array([model.low + model.width * rng.uniform(-1.0 if on else 0.1, 0.9 if on else 2.0), rng.uniform(1.0, 1.5), 0.0 if on else 1.0, 0.0])
    x, cost = switched(p, rng, sizes, start, model)
    p.cost += cost + 10.0 * (x[0] - model.wanted) ** 2


def turbo(p: Program, rng: np.random.Generator) -> None:
    """From rest to rest in the least physical time."""
    model = Turbo(rng)
    x, cost = switched(p, rng, (int(rng.integers(6, 13)), 3, 5.0), np.zeros(4), model)
    p.rows(x[:2] - vertical(model.goal, 0.0))
    p.cost += x[3] + cost


def gears(p: Program, rng: np.random.Generator) -> None:
    """From rest to rest in the least time."""
    model = Gears(rng)
    x, cost = switched(p, rng, (int(rng.integers(6, 21)), int(rng.integers(2, 4)), 5.0), np.zeros(2), model)
    p.rows(x - vertical(model.goal, 0.0))
    p.cost += cost


def plays(p: Program, rng: np.random.Generator) -> None:
    """A driven mass and plays behind it, whose weighted sum follows a path."""
    ca = p.ca
    n, horizon, count = int(rng.integers(20, 61)), rng.uniform(3.0, 8.0), int(rng.integers(1, 4))
    h = horizon / n
    width = np.sort(rng.uniform(0.05, 0.6, count))
    weight = rng.dirichlet(np.ones(count))
    drag, force = rng.uniform(0.1, 1.0), rng.uniform(5.0, 20.0)
    height, speed = rng.uniform(0.5, 1.5), rng.uniform(1.0, 3.0)
    back = rng.random() < 0.5  # does the load push back?
    q, v, z = ca.DM(0.0), ca.DM(0.0), ca.DM.zeros(count)
    for k in range(n):
        u = p.variables(1, -force, force)
        qn, vn = p.variables(1, -5.0, 5.0), p.variables(1, -20.0, 20.0)
        zn = p.variables(count, -5.0, 5.0)
        up, down = p.variables(count, 0.0, np.inf, 0.01), p.variables(count, 0.0, np.inf, 0.01)
        p.rows(qn - q - h * vn)
        p.rows(vn - v - h * (u - drag * vn) + (0.5 * ca.sum1(up - down) if back else 0.0))
        p.rows(zn - z - up + down)
        p.pair(up, width - qn + zn)
        p.pair(down, width + qn - zn)
        p.cost += h * (1e-3 * u**2 + (ca.dot(weight, zn) - height * np.sin(speed * (k + 1) * h)) ** 2)
        q, v, z = qn, vn, zn


class Network:
    """Arcs of a network, times on them, and drivers from one node to another who take what is shortest."""

    def __init__(self, p: Program, rng: np.random.Generator):
        nodes = int(rng.integers(5, 11))
        arcs = {(i, (i + 1) % nodes) for i in range(nodes)} | {((i + 1) % nodes, i) for i in range(nodes)}
        while len(arcs) < int(2.6 * nodes):
            i, j = rng.choice(nodes, 2, replace=False)
            arcs.add((int(i), int(j)))
        self.arcs = sorted(arcs)
        self.nodes, count = nodes, len(self.arcs)
        self.free = rng.uniform(1.0, 5.0, count)
        self.capacity = rng.uniform(1.0, 4.0, count)
        trips = int(rng.integers(1, 6))
        self.trips = [tuple(map(int, rng.choice(nodes, 2, replace=False))) for _ in range(trips)]
        self.demand = rng.uniform(0.5, 3.0, trips)

    def flows(self, p: Program, toll, wider):
        """Flows in equilibrium with tolls and wider arcs, and the times."""
        ca, count = p.ca, len(self.arcs)
        flows = [p.variables(count, 0.0, np.inf, self.demand.sum() / len(self.trips) / 2) for _ in self.trips]
        total = sum(flows)
        time = self.free * (1.0 + 0.15 * (total / (self.capacity + wider)) ** 4)
        tail, head = ([a[i] for a in self.arcs] for i in range(2))
        for flow, (origin, target), demand in zip(flows, self.trips, self.demand):
            label = p.variables(self.nodes - 1, -np.inf, np.inf, self.free.mean())  # time to the target
            others = [i for i in range(self.nodes) if i != target]
            to_go = [label[others.index(i)] if i != target else ca.SX(0.0) for i in range(self.nodes)]
            p.pair(flow, time + toll - ca.vertcat(*(to_go[i] for i in tail)) + ca.vertcat(*(to_go[j] for j in head)))
            for i in others:
                out = sum((flow[k] for k in range(count) if tail[k] == i), start=ca.SX(0.0))
                into = sum((flow[k] for k in range(count) if head[k] == i), start=ca.SX(0.0))
                p.rows(out - into, *2 * [demand if i == origin else 0.0])
        return total, time


def tolls(p: Program, rng: np.random.Generator) -> None:
    """The most revenue."""
    net = Network(p, rng)
    tolled = rng.choice(len(net.arcs), max(1, len(net.arcs) // 4), replace=False)
    most = rng.uniform(2.0, 8.0)
    rates = p.variables(len(tolled), 0.0, most, 0.1 * most)
    toll = p.ca.SX.zeros(len(net.arcs))
    for k, arc in enumerate(tolled):
        toll[int(arc)] = rates[k]
    total, _ = net.flows(p, toll, 0.0)
    p.cost -= p.ca.dot(toll, total)


def capacities(p: Program, rng: np.random.Generator) -> None:
    """The least time of all drivers with what widening costs."""
    net = Network(p, rng)
    count = len(net.arcs)
    wider = p.variables(count, 0.0, 5.0, 0.1)
    price = rng.uniform(0.5, 3.0, count)
    total, time = net.flows(p, 0.0, wider)
    p.cost += p.ca.dot(total, time) + p.ca.dot(price, wider) + 0.05 * p.ca.sumsqr(wider)


def leader(p: Program, rng: np.random.Generator) -> None:
    """The most profit of the firm that moves first."""
    ca = p.ca
    markets, firms = int(rng.integers(3, 11)), int(rng.integers(4, 16))
    top, slope = rng.uniform(5.0, 20.0, markets), rng.uniform(0.1, 1.0, markets)
    own = p.variables(markets, 0.0, 50.0, 1.0)
    total = ca.SX(own)
    quantities = [p.variables(markets, 0.0, np.inf, 1.0) for _ in range(firms)]
    total = total + sum(quantities)
    price = top - slope * total
    for q in quantities:
        cost, rise, capacity = rng.uniform(0.5, 8.0) + rng.uniform(0.0, 2.0, markets), rng.uniform(0.0, 0.5), rng.uniform(1.0, 10.0)
        scarce = p.variables(1, 0.0, np.inf, 0.1)
        p.pair(q, cost + rise * ca.sum1(q) - price + slope * q + scarce)
        p.pair(scarce, capacity - ca.sum1(q))
    if rng.random() < 0.5:
        p.rows(ca.sum1(own), 0.0, rng.uniform(2.0, 10.0))
    cost = rng.uniform(0.5, 4.0, markets)
    p.cost += ca.dot(cost - price, own) + 0.05 * ca.sumsqr(own)


def nested(p: Program, rng: np.random.Generator) -> None:
    """A quadratic program above a convex one."""
    ca = p.ca
    upper, lower = int(rng.integers(5, 31)), int(rng.integers(10, 61))
    rows = int(rng.integers(lower // 3, lower))

    def sparse(m: int, n: int):
        return rng.normal(size=(m, n)) * (rng.random((m, n)) < min(1.0, 4.0 / n))

    x = p.variables(upper, -10.0, 10.0)
    y = p.variables(lower, 0.0, np.inf, 1.0)
    weights = p.variables(rows, 0.0, np.inf, 0.1)
    root = sparse(lower, lower)
    hessian = root.T @ root + rng.uniform(0.01, 1.0) * np.eye(lower)
    cross, slope = sparse(lower, upper), rng.normal(size=lower)
    matrix, from_x = sparse(rows, lower), sparse(rows, upper)
    slack = rng.uniform(0.0, 3.0, rows) - from_x @ x + np.abs(matrix).sum(axis=1) - matrix @ y
    p.pair(weights, slack)
    p.pair(y, hessian @ y + slope + cross @ x + matrix.T @ weights)
    if rng.random() < 0.5:
        p.rows(ca.sum1(y), 0.0, 0.5 * lower)
    p.cost += 0.5 * ca.sumsqr(x - rng.normal(size=upper)) + 0.5 * ca.sumsqr(y - rng.uniform(0.0, 2.0, lower))


FAMILIES = {"hysteresis": (thermostat, plays), "driving": (gears, turbo), "equilibria": (tolls, capacities, leader, nested)}


if __name__ == "__main__":
    sys.exit(mpcc_contacts.main(FAMILIES, __doc__))
