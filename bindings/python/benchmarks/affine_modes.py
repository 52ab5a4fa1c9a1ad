"""Three systems of affine modes, each twice: as a model for the library, from the laws of the circuit, and as a table of modes with
their ways out for everybody else (CVODE, SciPy, the reference).

- buck: a step-down converter with voltage-mode control (D. Hamill, J. Deane, Modeling of chaotic DC-DC converters, 1992): the
  switch is closed where the amplified error of the voltage is below a ramp; diode and switch are resistors of 10 mOhm and 10 kOhm.
- boost: a step-up converter with peak current control at a light load: the clock closes the switch, the peak of the current
  opens it, the current comes to rest before the period ends, and from there on the coil is in series with 5 kOhm (2e-8 s beside
  periods of 2e-5 s).
- relay: relay feedback with sliding (P. Piiroinen, Yu. Kuznetsov, An event-driven method to simulate Filippov systems with accurate
  computing of sliding motions, ACM TOMS 34(3), 2008, equation (32), after M. di Bernardo, K. Johansson, F. Vasca, 2001).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

R_ON, R_OFF = 1e-2, 1e4  # what is closed and what is open


@dataclass
class Way:
    """Out of a mode to `target` where `weights @ x + constant + slope * (time since the last tick)` falls below zero."""

    target: int
    weights: np.ndarray
    constant: float = 0.0
    slope: float = 0.0


@dataclass
class Mode:
    """x' = a x + b; the mode behind a tick (-1: the same) and the state that is zero in this mode (-1: none)."""

    a: np.ndarray
    b: np.ndarray
    ways: list[Way]
    tick: int = -1
    zero: int = -1


@dataclass
class Problem:
    name: str
    modes: list[Mode]
    start: np.ndarray
    sizes: np.ndarray  # usual sizes of the states: errors and tolerances are relative to them
    end: float
    first: int = 0
    period: float = 0.0
    checks: int = 10
    method: str = "bdf"  # what CVODE does this with
    longest: float = 0.0  # steps of CVODE, so that it finds all switches
    extra: list[float] = field(default_factory=list)  # further states of the model at the start

    def times(self) -> np.ndarray:
        return self.end * np.arange(1, self.checks + 1) / self.checks

    def table(self) -> str:
        """For affine_modes.c."""
        number = lambda values: " ".join(repr(float(v)) for v in np.ravel(values))  # noqa: E731
        out = [f"{len(self.start)} {len(self.modes)} {self.period!r} {self.end!r} {self.checks} {self.first}", number(self.start)]
        for m in self.modes:
            out += [number(m.a), number(m.b), f"{m.tick} {m.zero} {len(m.ways)}"]
            out += [f"{w.target} {number(w.weights)} {w.constant!r} {w.slope!r}" for w in m.ways]
        return "\n".join([*out, number(self.sizes)])


L_BUCK, C_BUCK, LOAD_BUCK, V_BUCK, T_BUCK = 20e-3, 47e-6, 22.0, 24.0, 400e-6
GAIN, V_REF, RAMP = 8.4, 11.3, (3.8, 8.2)


def buck(periods: int = 100) -> Problem:
    def mode(closed: bool, conducts: bool, ways: list[Way]) -> Mode:
        gs, gd = 1 / (R_ON if closed else R_OFF), 1 / (R_ON if conducts else R_OFF)
        # the node between switch, diode and coil: (V - n) gs = n gd + i
        a = [[-1 / (gs + gd) / L_BUCK, -1 / L_BUCK], [1 / C_BUCK, -1 / (LOAD_BUCK * C_BUCK)]]
        return Mode(np.array(a), np.array([V_BUCK * gs / (gs + gd) / L_BUCK, 0.0]), ways)

    rise = (RAMP[1] - RAMP[0]) / T_BUCK
    opens = Way(1, np.array([0.0, -GAIN]), RAMP[0] + GAIN * V_REF, rise)
    closes = Way(0, np.array([0.0, GAIN]), -RAMP[0] - GAIN * V_REF, -rise)
    leak = V_BUCK / R_OFF
    blocks = Way(2, np.array([1.0, 0.0]), -leak)
    conducts = Way(1, np.array([-1.0, 0.0]), leak)
    modes = [mode(True, False, [opens]), mode(False, True, [closes, blocks]), mode(False, False, [closes, conducts])]
    return Problem(
        "buck", modes, np.array([0.5, 12.0]), np.array([1.0, 12.0]), (periods - 0.25) * T_BUCK, period=T_BUCK, extra=[0.0]
    )


L_BOOST, C_BOOST, LOAD_BOOST, V_BOOST, T_BOOST, PEAK = 100e-6, 100e-6, 115.0, 12.0, 20e-6, 1.0


def boost(periods: int = 1000) -> Problem:
    def mode(closed: bool, conducts: bool, ways: list[Way]) -> Mode:
        gs, gd = 1 / (R_ON if closed else R_OFF), 1 / (R_ON if conducts else R_OFF)
        # the node between coil, switch and diode: i = n gs + (n - v) gd
        row_n = np.array([1.0, gd]) / (gs + gd)
        a = [-row_n / L_BOOST, (gd * (row_n - [0.0, 1.0]) - [0.0, 1 / LOAD_BOOST]) / C_BOOST]
        return Mode(np.array(a), np.array([V_BOOST / L_BOOST, 0.0]), ways, tick=0)

    peak = Way(1, np.array([-1.0, 0.0]), PEAK)
    blocks = Way(2, np.array([1.0, -1 / R_OFF]))
    conducts = Way(1, np.array([-1.0, 1 / R_OFF]))
    modes = [mode(True, False, [peak]), mode(False, True, [blocks]), mode(False, False, [conducts])]
    return Problem(
        "boost", modes, np.array([0.0, 12.0]), np.array([1.0, 24.0]), (periods - 0.25) * T_BOOST, period=T_BOOST, extra=[0.0, 1.0]
    )


OMEGA, DAMPING, ZERO = 25.0, 0.05, 1.0
RELAY_A = np.array([[-(2 * DAMPING * OMEGA + 1), 1, 0], [-(2 * DAMPING * OMEGA + OMEGA**2), 0, 1], [-(OMEGA**2), 0, 0]])
RELAY_B = np.array([1.0, -2 * ZERO, 1.0])


def relay(end: float = 20.0) -> Problem:
    held = -RELAY_A[0] / RELAY_B[0]  # the control that holds x0 at zero, as a function of the state
    onto = np.array([1.0, 0.0, 0.0])
    sliding = RELAY_A + np.outer(RELAY_B, held)
    modes = [
        Mode(RELAY_A, -RELAY_B, [Way(2, onto)]),
        Mode(RELAY_A, RELAY_B, [Way(2, -onto)]),
        Mode(sliding, np.zeros(3), [Way(0, held, 1.0), Way(1, -held, 1.0)], zero=0),
    ]
    return Problem("relay", modes, np.array([0.0, -0.001, -0.02]), np.array([0.05, 0.5, 5.0]), end, first=2, method="adams")


PROBLEMS = {"buck": buck, "boost": boost, "relay": relay}


def model(name: str):
    """The model for the library, without the tables above."""
    from switchback_control.expr import Model, sign, where

    if name == "relay":
        m = Model(3)
        rates = [sum(float(a) * m.x[j] for j, a in enumerate(row) if a) for row in RELAY_A]
        m.derivatives = [r - float(b) * sign(m.x[0]) for r, b in zip(rates, RELAY_B)]
        return m
    if name == "buck":
        m = Model("i v clock")
        i, v, clock = m.x
        m.transition(clock > 1, reset={clock: clock - 1})
        error, ramp = GAIN * (v - V_REF), RAMP[0] + (RAMP[1] - RAMP[0]) * clock
        gs = where(error < ramp, 1 / R_ON, 1 / R_OFF)
        gd = where(V_BUCK * gs < i, 1 / R_ON, 1 / R_OFF)  # its voltage without current
        node = (V_BUCK * gs - i) / (gs + gd)
        m.derivatives = [(node - v) / L_BUCK, (i - v / LOAD_BUCK) / C_BUCK, 1 / T_BUCK]
        return m
    m = Model("i v clock")
    i, v, clock = m.x
    closed = m.discrete("closed", 1.0)
    m.transition(clock > 1, reset={clock: clock - 1}, to={closed: 1})
    m.transition(i > PEAK, when={closed: 1}, to={closed: 0})
    gs = 1 / R_OFF + closed * (1 / R_ON - 1 / R_OFF)
    gd = where(i > v * gs, 1 / R_ON, 1 / R_OFF)
    node = (i + v * gd) / (gs + gd)
    m.derivatives = [(V_BOOST - node) / L_BOOST, ((node - v) * gd - v / LOAD_BOOST) / C_BOOST, 1 / T_BOOST]
    return m


def reference(p: Problem) -> tuple[np.ndarray, int]:
    """States at the checks and the number of switches, by exponentials of matrices: pieces of 1/100 of a period (of 1/25 for a
    problem without clock) tell where a way out lies, or has a minimum that may be below zero; Brent's method finds it."""
    from scipy.linalg import expm
    from scipy.optimize import brentq

    n = len(p.start)
    piece = (p.period or 1 / 25) / 100
    # states, time since the tick, one
    generators, guards = [], []
    for m in p.modes:
        g = np.zeros((n + 2, n + 2))
        g[:n, :n], g[:n, -1], g[n, -1] = m.a, m.b, 1.0
        generators.append(g)
        guards.append(np.array([[*w.weights, w.slope, w.constant] for w in m.ways]))
    by_piece = [expm(piece * g) for g in generators]

    def enter(mode: int, z: np.ndarray) -> int:
        while True:
            if p.modes[mode].zero >= 0:
                z[p.modes[mode].zero] = 0.0
            below = np.flatnonzero(guards[mode] @ z < 0)
            if not below.size:
                return mode
            mode = p.modes[mode].ways[below[0]].target

    def zero(f, a: float, b: float) -> float:
        return float(brentq(f, a, b, xtol=1e-15 * p.end, rtol=1e-15)) if f(a) > 0 else a

    def way_out(mode: int, z: np.ndarray, after: np.ndarray, h: float) -> tuple[float, int] | None:
        rows, rates = guards[mode], guards[mode] @ generators[mode]
        g0, g1, slope0, slope1 = rows @ z, rows @ after, rates @ z, rates @ after
        dips = (slope0 < 0) & (slope1 > 0) & (np.minimum(g0, g1) < h * np.minimum(-slope0, slope1))
        found = None
        for k in np.flatnonzero((g1 < 0) | dips):
            value = lambda s, k=k: rows[k] @ expm(s * generators[mode]) @ z  # noqa: E731
            end = h
            if g1[k] >= 0:
                end = zero(lambda s, k=k: -(rates[k] @ expm(s * generators[mode]) @ z), 0.0, h)
                if value(end) >= -1e-13 * np.abs(rows[k]) @ np.abs(z):
                    continue  # a way out that has just been left, to rounding
            at = zero(value, 0.0, end)
            if at == 0.0 and g0[k] > -1e-13 * np.abs(rows[k]) @ np.abs(z) and slope0[k] > 0:
                continue
            beyond = 1e-16 * p.end
            while value(at) >= 0:  # rounding must not leave it on this side
                at, beyond = at + beyond, 2 * beyond
            if found is None or at < found[0]:
                found = (at, int(k))
        return found

    z = np.array([*p.start, 0.0, 1.0])
    mode, t, ticks, switches, states = enter(p.first, z), 0.0, 0, 0, []
    for at in p.times():
        while t < at:
            tick = (ticks + 1) * p.period if p.period else np.inf
            stop = min(tick, at)
            last = stop - t <= piece * (1 + 1e-9)
            h = stop - t if last else piece
            after = (expm(h * generators[mode]) if last else by_piece[mode]) @ z
            found, before = way_out(mode, z, after, h), mode
            if found is not None:
                z = expm(found[0] * generators[mode]) @ z
                t += found[0]
                mode = enter(p.modes[mode].ways[found[1]].target, z)
            else:
                z, t = after, stop if last else t + h
                if t == tick:
                    ticks += 1
                    z[n] = 0.0
                    mode = enter(mode if p.modes[mode].tick < 0 else p.modes[mode].tick, z)
            switches += mode != before
        states.append(z[:n].copy())
    return np.array(states), switches
