"""Classes of events on instances that are drawn: units that act nearly together, zeros of higher order, bodies at rest on a guard, surfaces of
time. What is right is known in closed form."""

import threading

import numpy as np
import pytest
import switchback_control as swb
from switchback_control import Model

# --- units that know nothing of each other ------------------------------------------------------------


def ramps(m, rng, spread):
    """Units that grow at one rate and fall by one where they reach it: how many do by the end, for every one."""
    starts, end = spread * rng.uniform(size=m.nx), rng.integers(2, 5) + 0.5
    m.derivatives = [1.0] * m.nx
    for v in m.x:
        m.transition(v > 1, reset={v: v - 1})
    return starts, end, np.floor(end + starts)


def neurons(m, rng, spread):
    """Leaky units that fire at one and begin again at zero: the first time and the period are logarithms."""
    drive = 1.3 + spread * rng.uniform(size=m.nx)
    starts, end = rng.uniform(0, 0.5) + spread * rng.uniform(size=m.nx), 5.0
    m.derivatives = [d - v for d, v in zip(drive, m.x)]
    for v in m.x:
        m.transition(v > 1, reset={v: 0.0})
    first, period = np.log((drive - starts) / (drive - 1)), np.log(drive / (drive - 1))
    return starts, end, 1 + np.floor((end - first) / period)


def thermostats(m, rng, spread):
    """Rooms that cool to 19.5 and are heated to 20.5, all of them in exponentials."""
    n = m.nx
    loss, starts, end = 1 + spread * rng.uniform(size=n), np.full(n, 18.0), 1.0
    heats = [m.hysteresis(20 - m.x[i], on=0.5, off=-0.5) for i in range(n)]
    for i in range(n):
        m.derivative(m.x[i], loss[i] * (5 - m.x[i]) + 30 * heats[i])
    hot = 5 + 30 / loss
    first, up = np.log((hot - 18) / (hot - 20.5)) / loss, np.log((hot - 19.5) / (hot - 20.5)) / loss
    down = np.log(15.5 / 14.5) / loss
    left = (end - first) / (up + down)
    # it is switched on at the start, then off, on, off
    return starts, end, 2 + 2 * np.floor(left) + (left % 1 > down / (up + down))


@pytest.mark.parametrize("kind", [ramps, neurons, thermostats])
@pytest.mark.parametrize("seed", range(10))
def test_units_that_act_nearly_together_do_not_accumulate(kind, seed):
    """However many there are, and however close they are: each acts as often as it does alone."""
    rng = np.random.default_rng([seed, len(kind.__name__)])
    m = Model(int(np.exp(rng.uniform(np.log(2), np.log(60)))))
    starts, end, counts = kind(m, rng, 10.0 ** rng.integers(-12, -2))
    run = swb.simulate(m, starts, end, rtol=10.0 ** rng.integers(-8, -3))
    assert run.success, run.reason
    assert len(run.jumps) == counts.sum()


# --- zeros of higher order ------------------------------------------------------------------------------

FLAT = {
    "u - sin u": lambda u, v: u - swb.sin(u),
    "sinh u - u": lambda u, v: swb.sinh(u) - u,
    "u - tanh u": lambda u, v: u - swb.tanh(u),
    "u³ (1 + v²)": lambda u, v: u * u * u * (1 + v * v),
    "u⁵ (2 + sin v)": lambda u, v: u**5 * (2 + swb.sin(v)),
    "u³ + u⁵": lambda u, v: u**3 + u**5,
}


def thrown(rng):
    """Height, speed and acceleration of a body, and when it is at zero."""
    h, v, a = rng.uniform(0.3, 2), rng.uniform(-2, 2), -rng.uniform(1, 10)
    return h, v, a, (-v - np.sqrt(v * v - 2 * a * h)) / a


@pytest.mark.parametrize("name", FLAT)
def test_a_zero_of_higher_order_is_passed_once_at_its_time(name):
    """As a guard and as a switching function; the time does not depend on how flat it is, unless the run says so."""
    rng = np.random.default_rng(len(name))
    for _ in range(8):
        (h, v, a, fall), tol = thrown(rng), 10.0 ** rng.uniform(-11, -3)
        end = fall + rng.uniform(0.2, 1)
        for as_guard in (True, False):
            m = Model(states="q w n")
            q, w, n = m.x
            flat = FLAT[name](q, w)
            m.derivatives = [w, a, 0.0 if as_guard else swb.where(flat < 0, 1.0, 0.0)]
            if as_guard:
                m.transition(flat < 0, reset={n: n + 1})
            run = swb.simulate(m, [h, v, 0], end, rtol=tol, atol=tol)
            times = [j.t for j in run.jumps] if as_guard else run.switch_times
            assert run.success and len(times) == 1, (run.reason, times)
            assert abs(times[0] - fall) < 1e-9 + 10 * tol or "flat" in run.reason
            assert abs(times[0] - fall) < 1e-6


@pytest.mark.parametrize("name", FLAT)
def test_a_zero_of_higher_order_comes_again(name):
    """Bounces, and oscillations, for which a guard is left below zero and comes back."""
    rng = np.random.default_rng(len(name) + 1)
    for _ in range(3):
        h, c, g, tol = rng.uniform(0.5, 2), rng.uniform(0.5, 0.9), rng.uniform(5, 10), 10.0 ** rng.uniform(-10, -5)
        m = Model(states="q w")
        q, w = m.x
        m.derivatives = [w, -g]
        m.transition(FLAT[name](q, w) < 0, reset={w: -c * w})
        times, speed = [np.sqrt(2 * h / g)], np.sqrt(2 * h * g)
        while len(times) < 6:
            speed *= c
            times.append(times[-1] + 2 * speed / g)
        run = swb.simulate(m, [h, 0], 0.5 * (times[4] + times[5]), rtol=tol, atol=tol)
        assert run.success, run.reason
        np.testing.assert_allclose([j.t for j in run.jumps], times[:5], atol=1e-7 + 100 * tol)

        rate = rng.uniform(1, 5)
        m = Model(states="q w n")
        q, w, n = m.x
        m.derivatives = [w, -rate * rate * q, 0]
        m.transition(FLAT[name](q, w) < 0, reset={n: n + 1})
        run = swb.simulate(m, [0.7, 0, 0], 6 * np.pi / rate, rtol=tol, atol=tol)
        assert run.success, run.reason
        np.testing.assert_allclose([j.t for j in run.jumps], (np.arange(3) + 0.25) * 2 * np.pi / rate, atol=1e-7 + 100 * tol)


@pytest.mark.parametrize("name", FLAT)
def test_the_time_of_a_zero_of_higher_order_has_derivatives(name):
    rng = np.random.default_rng(len(name) + 2)
    for _ in range(3):
        h, g = rng.uniform(0.5, 2), rng.uniform(5, 10)
        m = Model(states="q w y z")
        q, w, y, z = m.x
        m.derivatives = [w, -g, swb.where(FLAT[name](q, w) < 0, 3.0, 1.0), 0]
        m.transition(FLAT[name](q, w) < 0, reset={z: m.t})
        fall = np.sqrt(2 * h / g)
        run = swb.simulate(m, [h, 0, 0, 0], 2 * fall, sensitivity=True)
        # the time of the fall changes by this with the height
        by_height = 1 / (g * fall)
        np.testing.assert_allclose(run.dx_dx0[2:, 0], [-2 * by_height, by_height], rtol=1e-5)


# --- rest on a guard ------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(10))
def test_a_body_that_friction_holds_on_a_guard_does_not_pass_it(seed):
    """Rounding of a velocity that is zero is no motion; what leaves the guard later does so freely."""
    rng = np.random.default_rng(seed)
    for _ in range(3):
        # where the body is, along a direction of the plane and across it, with friction along both
        turn, limit = rng.uniform(0, 2 * np.pi), rng.uniform(0.5, 2)
        c, s = np.cos(turn), np.sin(turn)
        size = 10.0 ** rng.uniform(-3, 3)
        m = Model(states="q r a b")
        q, r, a, b = m.x
        along, across = c * a + s * b, c * b - s * a
        push = limit * (0.6 + 0.3 * swb.sin(rng.uniform(1, 5) * m.t))
        f, g = size * (push - limit * swb.sign(along)), size * (0.5 * push - limit * swb.sign(across))
        m.derivatives = [a, b, c * f - s * g, s * f + c * g]
        back = rng.uniform(0.1, 0.9)
        m.transition(c * q + s * r < 0, reset={a: a - (1 + back) * c * along, b: b - (1 + back) * s * along})
        run = swb.simulate(m, [0, 0, 0, 0], 10.0, rtol=10.0 ** rng.uniform(-9, -4))
        assert run.success, run.reason
        assert not run.jumps
        np.testing.assert_allclose(run.x_end, 0, atol=1e-9 * size)


# --- surfaces of time -----------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(10))
def test_surfaces_of_time_alone(seed):
    """A product of times is crossed at each of them, however slowly, and derivatives are those of a linear equation."""
    rng = np.random.default_rng(seed)
    for _ in range(4):
        n, rate = int(rng.integers(2, 6)), rng.uniform(0.1, 2)
        times = np.cumsum(10.0 ** rng.uniform(-1, 0, n))
        end, values = times[-1] * rng.uniform(1, 1.5) + 0.1, rng.uniform(-3, 3, 2)
        m = Model(states="q")
        product = 1.0 if seed % 2 else 1 + 0.5 * swb.sin(3 * m.t)
        for time in times:
            product = product * (m.t - time)
        m.derivatives = [-rate * m.x[0] + swb.where(product < 0, *values)]
        run = swb.simulate(m, [1.0], end, rtol=1e-10, atol=1e-10, sensitivity=True)
        assert run.success, run.reason
        np.testing.assert_allclose(run.switch_times, times, atol=1e-11)
        points, want = [0.0, *times, end], np.exp(-rate * end)
        for k, (start, stop) in enumerate(zip(points[:-1], points[1:])):
            value = values[(n - k + 1) % 2]
            want += value / rate * (np.exp(-rate * (end - stop)) - np.exp(-rate * (end - start)))
        np.testing.assert_allclose(run.x_end, want, atol=1e-8)
        np.testing.assert_allclose(run.dx_dx0, np.exp(-rate * end), rtol=1e-7)
        assert run.stats.accumulations == 0


# --- many surfaces that slide -----------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(6))
def test_many_rooms_that_slide_are_no_accumulation(seed):
    """Rooms that relays keep at their temperatures, and lose them in the heat of the day: each slides when and as long as it does with others at
    tight tolerances."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(20, 60))
    loss, power, wanted = 1 + 0.2 * rng.uniform(size=n), 9 + rng.uniform(size=n), 20 + 0.4 * rng.uniform(size=n)
    m = Model(n)
    x = list(m.x)
    flow = [0 * x[0]] * n
    for i in range(n - 1):
        between = 0.5 * (x[i + 1] - x[i])
        flow[i], flow[i + 1] = flow[i] + between, flow[i + 1] - between
    outside = 8 + 10 * swb.sin(1.3 * m.t)
    m.derivatives = [loss[i] * (outside - x[i]) + flow[i] + power[i] * (1 - swb.sign(x[i] - wanted[i])) for i in range(n)]
    starts = 18 + 2 * np.sin(2.1 * np.arange(n))
    runs = [swb.simulate(m, starts, 6.0, rtol=tol, atol=1e-2 * tol) for tol in (1e-4, 1e-9)]
    coarse, fine = runs
    assert coarse.success and coarse.stats.accumulations == 0, coarse.reason
    assert len(coarse.switches) == len(fine.switches)
    assert coarse.stats.steps < 100 + 3 * len(coarse.switches)
    np.testing.assert_allclose(coarse.x_end, fine.x_end, atol=0.05)


# --- ends next to an event --------------------------------------------------------------------------------


def test_the_dense_output_reaches_the_end_behind_an_event_by_rounding():
    """A ramp is reset at multiples of its period, to rounding of its own; so does the run end."""
    for k in range(3, 60):
        period = 1e-4
        m = Model(states="ramp n")
        m.derivatives = [1 / period, 0.0]
        m.transition(m.ramp > 1, reset={m.ramp: m.ramp - 1, m.n: m.n + 1})
        end = period * k
        run = swb.simulate(m, [0, 0], end)
        assert run.t_end == end
        # in a state before the jump or behind it
        ramp, n = run(end)
        assert abs(n + ramp - k) < 1e-9 and abs(run.x_end[0] + run.x_end[1] - k) < 1e-9


def test_a_run_that_is_interrupted_among_transitions_of_one_time_goes_on():
    """Two hundred hystereses start cold: what an interrupt leaves of their transitions is made by the next call."""
    n, end = 200, 0.02

    def made(interrupts):
        m = Model(n)
        heats = [m.hysteresis(20 - v, on=0.5, off=-0.5) for v in m.x[:n]]
        for v, h in zip(m.x[:n], heats):
            m.derivative(v, 5 - v + 30 * h)
        run = swb.Integrator(m, rtol=1e-6, sensitivity=True)
        start = np.zeros(m.system().nx)
        start[:n] = np.linspace(15, 18, n)
        run.reinit(start)
        stops = 0
        while run.time < end or stops < interrupts:
            timer = threading.Timer(0.002, run.interrupt)
            if stops < interrupts:
                timer.start()
            run.advance(end)
            timer.cancel()
            stops += 1
            assert stops < 1000
        return run

    plain, stopped = made(0), made(10)
    assert len(stopped.run.jumps) == len(plain.run.jumps) == n
    np.testing.assert_allclose(stopped.state, plain.state, rtol=1e-12)
    np.testing.assert_allclose(stopped.run.dx_dx0, plain.run.dx_dx0, atol=1e-9)
