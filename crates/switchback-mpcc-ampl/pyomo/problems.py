"""Programs with complementarity constraints in Pyomo, and the values the literature has for them.

Those with the names of MacMPEC (S. Leyffer, MacMPEC: AMPL collection of MPECs, 2000) have the values of its list.
"""

import math

import pyomo.environ as pyo
from pyomo.mpec import Complementarity, complements


def pair(m, name, first, second):
    """`first` and `second`, two inequalities, one of which is an equation."""
    setattr(m, name, Complementarity(expr=complements(first, second)))


def model():
    return pyo.ConcreteModel()


def variables(m, name, starts, low=None, high=None):
    """A list of variables with these starting values and common bounds."""
    block = pyo.Var(range(len(starts)), initialize=dict(enumerate(starts)), bounds=(low, high))
    setattr(m, name, block)
    return [block[k] for k in range(len(starts))]


def bard1():
    m = model()
    (x, y) = variables(m, "x", [0, 0], 0)
    u = variables(m, "u", [0, 0, 0])
    m.f = pyo.Objective(expr=(x - 5) ** 2 + (2 * y + 1) ** 2)
    m.kkt = pyo.Constraint(expr=2 * (y - 1) - 1.5 * x + u[0] - 0.5 * u[1] + u[2] == 0)
    pair(m, "p0", 0 <= 3 * x - y - 3, u[0] >= 0)
    pair(m, "p1", 0 <= 0.5 * y - x + 4, u[1] >= 0)
    pair(m, "p2", 0 <= 7 - x - y, u[2] >= 0)
    return m, 17.0


def desilva():
    m = model()
    x, y, u = variables(m, "x", [0, 0], 0, 2), variables(m, "y", [0, 0]), variables(m, "u", [0, 0], 0)
    m.f = pyo.Objective(expr=x[0] ** 2 - 2 * x[0] + x[1] ** 2 - 2 * x[1] + y[0] ** 2 + y[1] ** 2)
    m.kkt = pyo.Constraint([0, 1], rule=lambda _, k: 2 * (y[k] - x[k]) + 2 * (y[k] - 1) * u[k] == 0)
    for k in range(2):
        pair(m, f"p{k}", 0 <= 0.25 - (y[k] - 1) ** 2, u[k] >= 0)
    return m, -1.0


def gauvin():
    m = model()
    m.x, m.y, m.u = pyo.Var(bounds=(0, 15), initialize=7.5), pyo.Var(bounds=(0, None)), pyo.Var(bounds=(0, None))
    m.f = pyo.Objective(expr=m.x**2 + (m.y - 10) ** 2)
    pair(m, "p0", 0 <= 4 * (m.x + 2 * m.y - 30) + m.u, m.y >= 0)
    pair(m, "p1", 0 <= 20 - m.x - m.y, m.u >= 0)
    return m, 20.0


def jr1():
    m = model()
    x, y = variables(m, "z", [0, 0])
    m.f = pyo.Objective(expr=(x - 1) ** 2 + y**2)
    pair(m, "p", 0 <= y - x, y >= 0)
    return m, 0.5


def jr2():
    m = model()
    x, y = variables(m, "z", [0, 0])
    m.f = pyo.Objective(expr=x**2 + (y - 1) ** 2)
    pair(m, "p", 0 <= y - x, y >= 0)
    return m, 0.5


def of_two(objective, value, start=(1, 1)):
    """A program in the two members of a pair."""
    m = model()
    x, y = variables(m, "z", start, 0)
    m.f = pyo.Objective(expr=objective(x, y))
    pair(m, "p", x >= 0, y >= 0)
    return m, value


def kth1():
    return of_two(lambda x, y: x + y, 0.0)


def kth2():
    return of_two(lambda x, y: x + (y - 1) ** 2, 0.0)


def kth3():
    return of_two(lambda x, y: 0.5 * (x - 1) ** 2 + (y - 1) ** 2, 0.5)


def ralph2():
    return of_two(lambda x, y: x**2 + y**2 - 4 * x * y, 0.0)


def scholtes3():
    return of_two(lambda x, y: 0.5 * ((x - 1) ** 2 + (y - 1) ** 2), 0.5, start=(1e-4, 1e-4))


def ralph1():
    m = model()
    x, y = variables(m, "x", [0, 0], 0)
    m.f = pyo.Objective(expr=2 * x - y)
    pair(m, "p", y >= 0, y >= x)
    return m, 0.0


def scholtes1():
    m = model()
    m.x, m.y, m.z = pyo.Var(bounds=(0, None), initialize=1), pyo.Var(initialize=1), pyo.Var(bounds=(0, None), initialize=1)
    m.f = pyo.Objective(expr=(m.x + 1) ** 2 + (m.y - 2.5) ** 2 + (m.z + 1) ** 2)
    pair(m, "p", 0 <= m.y - pyo.exp(m.x) - pyo.exp(m.z), m.x >= 0)
    return m, 2.0


def scholtes2():
    m = model()
    m.x = pyo.Var(bounds=(0, None), initialize=1)
    y, z = variables(m, "y", [1, 1])
    m.f = pyo.Objective(expr=(m.x + 1) ** 2 + y**2 + 10 * (z + 1) ** 2)
    m.sign = pyo.Constraint(expr=z >= 0)
    pair(m, "p", 0 <= y - pyo.exp(m.x) - pyo.exp(z), m.x >= 0)
    return m, 15.0


def scholtes4():
    m = model()
    x, y = variables(m, "x", [0, 1], 0)
    m.z = pyo.Var(initialize=0)
    m.f = pyo.Objective(expr=x + y - m.z)
    m.first, m.second = pyo.Constraint(expr=m.z <= 4 * x), pyo.Constraint(expr=m.z <= 4 * y)
    pair(m, "p", x >= 0, y >= 0)
    return m, 0.0


def scholtes5():
    m = model()
    x, y, z = variables(m, "x", [1, 1, 1], 0)
    m.f = pyo.Objective(expr=(x - 1) ** 2 + (y - 2) ** 2 + (z + 1) ** 2)
    pair(m, "p", x >= 0, z >= 0)
    pair(m, "q", y >= 0, z >= 0)
    return m, 1.0


def stackelberg1():
    m = model()
    m.x, m.y = pyo.Var(bounds=(0, 200), initialize=100), pyo.Var(bounds=(0, None), initialize=50)
    m.f = pyo.Objective(expr=0.5 * m.x**2 + 0.5 * m.x * m.y - 95 * m.x)
    pair(m, "p", 0 <= 2 * m.y + 0.5 * m.x - 100, m.y >= 0)
    return m, -9800 / 3


def outrata(objective, slope, value):
    """Problems 3.1 and 3.2 of Outrata, SIAM J. Optim. 4 (1994)."""
    m = model()
    x = variables(m, "x", [0, 0, 0, 0], 0)
    m.y = pyo.Var(bounds=(0, 10), initialize=0)
    m.f = pyo.Objective(expr=objective(x))
    pair(m, "p0", 0 <= (1 + 0.2 * m.y) * x[0] - (3 + 1.333 * m.y) - 0.333 * x[2] + 2 * x[0] * x[3], x[0] >= 0)
    pair(m, "p1", 0 <= (1 + slope * m.y) * x[1] - m.y + x[2] + 2 * x[1] * x[3], x[1] >= 0)
    pair(m, "p2", 0 <= 0.333 * x[0] - x[1] + 1 - 0.1 * m.y, x[2] >= 0)
    pair(m, "p3", 0 <= 9 + 0.1 * m.y - x[0] ** 2 - x[1] ** 2, x[3] >= 0)
    return m, value


def outrata31():
    return outrata(lambda x: 0.5 * ((x[0] - 3) ** 2 + (x[1] - 4) ** 2), 0.1, 3.2077)


def outrata32():
    return outrata(lambda x: 0.5 * ((x[0] - 3) ** 2 + (x[1] - 4) ** 2 + (x[2] - 1) ** 2), 0.1, 3.4494)


def qpec1():
    m = model()
    x, y = variables(m, "x", [1] * 10), variables(m, "y", [1] * 20)
    m.f = pyo.Objective(expr=sum((v + 1) ** 2 for v in x) + sum((v - 2) ** 2 for v in y))
    for k in range(20):
        if k < 10:
            pair(m, f"p{k}", 0 <= y[k] - x[k], y[k] >= 0)
        else:
            pair(m, f"p{k}", 0 <= y[k], y[k] >= 0)
    return m, 80.0


def df1():
    m = model()
    m.x, m.y = pyo.Var(bounds=(-1, 2), initialize=0), pyo.Var(bounds=(0, None), initialize=0)
    m.f = pyo.Objective(expr=(m.x - 1 - m.y) ** 2)
    m.first = pyo.Constraint(expr=m.x**2 <= 2)
    m.second = pyo.Constraint(expr=(m.x - 1) ** 2 + (m.y - 1) ** 2 <= 3)
    pair(m, "p", 0 <= m.y - m.x**2 + 1, m.y >= 0)
    return m, 0.0


def gnash(gamma, value):
    """A leader and four followers in an oligopoly; Outrata, Zowe, Math. Program. 68 (1995)."""
    c, beta, capacity = [10, 8, 6, 4, 2], [1.2, 1.1, 1.0, 0.9, 0.8], 150
    m = model()
    q, u = variables(m, "q", [75] * 5, 0, capacity), variables(m, "u", [0] * 4, 0)
    total = sum(q)
    price = (5000 / total) ** (1 / gamma)
    cost = c[0] * q[0] + beta[0] / (1 + beta[0]) * 5 ** (-1 / beta[0]) * q[0] ** ((1 + beta[0]) / beta[0])
    m.f = pyo.Objective(expr=q[0] * price - cost, sense=pyo.maximize)
    for i in range(1, 5):
        marginal = c[i] + 5 ** (-1 / beta[i]) * q[i] ** (1 / beta[i])
        pair(m, f"p{i}", 0 <= marginal - price + q[i] * price / (gamma * total) + u[i - 1], q[i] >= 0)
        pair(m, f"q{i}", 0 <= capacity - q[i], u[i - 1] >= 0)
    return m, -value


def gnash10():
    return gnash(1.0, -343.34526)


def portfolio():
    """Track an index under a lower level that is a quadratic program on the simplex, as portfl-i of MacMPEC does.

    The target is the portfolio of known risk: the optimum is zero.
    """
    n = 6
    risk = [[2.0 + (i == j) * (1 + i) + 0.3 * math.cos(i * j) for j in range(n)] for i in range(n)]
    risk = [[0.5 * (risk[i][j] + risk[j][i]) for j in range(n)] for i in range(n)]
    target = [0.5, 0.3, 0.2, 0.0, 0.0, 0.0]
    at_target = [sum(risk[i][j] * target[j] for j in range(n)) for i in range(n)]
    m = model()
    r = variables(m, "r", [1.0] * n, 0, 20)
    x, z = variables(m, "x", [1 / n] * n, 0), variables(m, "z", [1.0] * n, 0)
    m.t = pyo.Var(initialize=0.0)
    m.f = pyo.Objective(expr=sum((x[i] - target[i]) ** 2 for i in range(n)))
    m.budget = pyo.Constraint(expr=sum(x) == 1)
    m.kkt = pyo.Constraint(range(n), rule=lambda _, i: sum(risk[i][j] * x[j] for j in range(n)) - r[i] - m.t - z[i] == 0)
    for i in range(n):
        pair(m, f"p{i}", x[i] >= 0, z[i] >= 0)
    assert max(at_target) - min(at_target) < 20
    return m, 0.0


def box():
    """`-1 <= x <= 1` with `F = x - t`: the projection of `t` on the box, which is asked to be next to 3."""
    m = model()
    m.x, m.t = pyo.Var(bounds=(-1, 1), initialize=0.0), pyo.Var(bounds=(-2, 2), initialize=0.5)
    m.f = pyo.Objective(expr=(m.x - 3) ** 2 + 0.1 * (m.t - 0.5) ** 2)
    # Pyomo writes no complementarity with two bounds by itself: this is what its writer looks for
    m.p = pyo.Constraint(expr=m.x - m.t == 0)
    m.p._complementarity, m.p._vid = 3, id(m.x)
    return m, 4 + 0.1 * 0.25


def upper():
    """A variable below its upper bound 2, complementary to a function that is not positive there: `x = min(t, 2)`."""
    m = model()
    m.x, m.t = pyo.Var(initialize=0.0), pyo.Var(bounds=(0, 5), initialize=1.0)
    m.f = pyo.Objective(expr=(m.x - 3) ** 2 + 0.1 * (m.t - 4) ** 2)
    pair(m, "p", m.x <= 2, m.x - m.t <= 0)
    return m, 1.0


ALL = [
    bard1, desilva, gauvin, jr1, jr2, kth1, kth2, kth3, ralph1, ralph2, scholtes1, scholtes2, scholtes3, scholtes4, scholtes5,
    stackelberg1, outrata31, outrata32, qpec1, df1, gnash10, portfolio, box, upper,
]
