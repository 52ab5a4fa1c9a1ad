"""Scenes that switch and jump beside contacts, joints, constraints and further states, against SciPy with events by hand."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import switchback_control as swb
from switchback_control.expr import step_table


def by_hand(phase, x, p, end):
    """Integrates phase by phase. `phase(t, x, p)` gives a right-hand side and a list of (event function, state behind it)."""
    t, x = 0.0, np.array(x, dtype=float)
    for _ in range(200):
        rhs, events = phase(t, x, p)
        functions = []
        for f, _ in events:
            g = lambda s, y, f=f: f(s, y)
            g.terminal, g.direction = True, -1.0
            functions.append(g)
        done = solve_ivp(rhs, (t, end), x, method="DOP853", rtol=1e-12, atol=1e-13, max_step=0.02, events=functions)
        t, x = done.t[-1], done.y[:, -1].copy()
        if done.status == 0:
            return x
        k = next(k for k, times in enumerate(done.t_events) if times.size)
        x = events[k][1](x)
    raise AssertionError("too many phases")


def check(s, x0, p, end, phase, columns):
    """The end of a run, and its derivatives with respect to `columns` of start and parameters."""
    system = s.system()
    run = swb.simulate(system, x0, end, p=p, rtol=1e-11, atol=1e-12, sensitivity=True, adjoint=True)
    assert run.success, run.reason
    expected = by_hand(phase, x0, p, end)
    np.testing.assert_allclose(run.x[-1], expected, rtol=1e-7, atol=1e-8)
    full = np.concatenate([x0, p])
    h = 1e-4
    for c in columns:
        moved = []
        for by in (-2 * h, -h, h, 2 * h):
            z = full.copy()
            z[c] += by
            moved.append(by_hand(phase, z[: len(x0)], z[len(x0) :], end))
        a, b, d, e = moved
        slope = (a - 8 * b + 8 * d - e) / (12 * h)
        forward = np.concatenate([run.dx_dx0, run.dx_dp], axis=1)[:, c]
        np.testing.assert_allclose(forward, slope, rtol=1e-5, atol=1e-5)
    return run


# The first program: a contact, a dry joint, a relay and the current of a motor.
def press():
    s = swb.Scene("x", p="ref F", states="i", name="press")
    x, v, i = s.q[0], s.v[0], s.i
    s.force([4.0 * i])
    s.state_rates([(12.0 * swb.sign(2.0 * (s.ref - v) - i) - 2.0 * i - 4.0 * v) / 0.1])
    s.friction("rail", x, s.F)
    s.contact("stop", gap=0.3 - x, e=0.4)
    return s


def press_phase(t, y, p):
    x, v, i = y
    ref, most = p
    tiny = 1e-9
    pressed = x > 0.3 - tiny and abs(v) < tiny
    stuck = abs(v) < tiny and (abs(4.0 * i) <= most or pressed and i > 0)
    side = 0.0 if stuck else np.sign(v) if abs(v) > tiny else np.sign(i)

    def accelerate(y):
        return 0.0 if stuck else 4.0 * y[2] - most * side

    psi = lambda y: 2.0 * (ref - y[1]) - y[2]
    sign = 0.0 if abs(psi(y)) < tiny else np.sign(psi(y))
    # on the surface the current follows 2 (ref - v), and its weight is what that takes
    weight = lambda y: (0.1 * -2.0 * accelerate(y) + 2.0 * y[2] + 4.0 * y[1]) / 12.0
    slides = sign == 0.0 and abs(weight(y)) < 1.0
    if sign == 0.0 and not slides:
        sign = np.sign(weight(y))

    def rhs(_, y):
        w = weight(y) if slides else sign
        return [0.0 if stuck else y[1], accelerate(y), (12.0 * w - 2.0 * y[2] - 4.0 * y[1]) / 0.1]

    events = []
    same = lambda y: y
    if slides:
        events += [(lambda _, y: 1.0 - weight(y), same), (lambda _, y: 1.0 + weight(y), same)]
    else:
        onto = lambda y: np.array([y[0], y[1], 2.0 * (ref - y[1])])
        events.append((lambda _, y: sign * psi(y), onto))
    if stuck and not pressed:
        events.append((lambda _, y: most - 4.0 * abs(y[2]), lambda y: np.array([y[0], 0.0, y[2] * (1 + 1e-12)])))
    elif not stuck:
        if v * side > tiny:
            events.append((lambda _, y: side * y[1], lambda y: np.array([y[0], 0.0, y[2]])))
        if side > 0:
            events.append((lambda _, y: 0.3 - y[0], lambda y: np.array([0.3, -0.4 * y[1], y[2]])))
    return rhs, events


def test_contact_joint_relay_and_current():
    run = check(press(), [0.0, 0.0, 0.0], [0.5, 1.0], 1.2, press_phase, [0, 2, 3, 4])
    assert len(run.impacts) > 3
    names = [c["name"] for c in press().report_data()["contacts"] if c["kind"] == "switch"]
    assert len(names) == 1 and names[0] in press().report()
    # where it slides the weight is neither 1 nor -1
    t = 0.5 * (run.impacts[0].t + run.switch_times[run.switch_times < run.impacts[0].t][-1])
    assert abs(run.force(names[0], t)[1]) < 0.9 and run.mode(names[0], t) == swb.ContactMode.CLOSED
    run.plot_contacts(contacts=["stop", names[0]])


def test_relay_and_constraint():
    """A bead on a circle, whose angular velocity a relay holds as long as it is strong enough."""
    s = swb.Scene("x y", p="k w", name="bead")
    x, y = s.q
    omega = x * s.v[1] - y * s.v[0]
    torque = s.k * swb.sign(s.w - omega)
    s.force([-y * torque, x * torque - 9.0])
    s.constraint("circle", x * x + y * y - 1.0)

    # theta'' = -9 cos theta + k w with the angle from the x axis; the third number is the weight, 0 where it is what holds
    def phase(t, z, p):
        k, w = p
        pull = lambda z: -9.0 * np.cos(z[0])
        if z[2] == 0.0:
            leave = lambda side: (lambda _, z: k - side * pull(z), lambda z: np.array([z[0], w, -side]))
            return (lambda _, z: [z[1], 0.0, 0.0]), [leave(1.0), leave(-1.0)]
        away = 1e-7  # a surface that is left counts once the state has gone away
        arrive = lambda s, z: z[2] * (w - z[1]) if s > t + away else 1.0
        return (lambda _, z: [z[1], pull(z) + k * z[2], 0.0]), [(arrive, lambda z: np.array([z[0], w, 0.0]))]

    end = 2.0
    run = swb.simulate(s.system(), [0.0, -1.0, 0.0, 0.0], end, p=[6.0, 1.5], rtol=1e-11, atol=1e-12)
    assert run.success, run.reason
    theta, rate, _ = by_hand(phase, [-np.pi / 2, 0.0, 1.0], [6.0, 1.5], end)
    c, n = np.cos(theta), np.sin(theta)
    np.testing.assert_allclose(run.x[-1], [c, n, -n * rate, c * rate], rtol=1e-6, atol=1e-7)
    assert len(run.switches) >= 2


def test_table_and_bounces():
    """Steps of a table of the height under a ball that bounces."""
    s = swb.Scene("y", p="e", name="table")
    y = s.q[0]
    s.force([step_table(y, [0.4, 0.8], [-9.0, -3.0, -20.0])])
    s.contact("floor", gap=y, e=s.e)

    def phase(t, z, p):
        going = np.sign(z[1]) if z[1] else -1.0
        ahead = z[0] + 1e-9 * going
        pull = -9.0 if ahead < 0.4 else -3.0 if ahead < 0.8 else -20.0
        same = lambda z: z
        events = [(lambda _, z: going * z[1], lambda z: np.array([z[0], 0.0]))] if going > 0 else []
        for at in (0.4, 0.8):
            if going * (at - ahead) > 0:
                events.append((lambda _, z, at=at: going * (at - z[0]), lambda z, at=at: np.array([at, z[1]])))
        if going < 0:
            events.append((lambda _, z: z[0], lambda z: np.array([0.0, -p[0] * z[1]])))
        return (lambda _, z: [z[1], pull]), events

    check(s, [1.0, 0.0], [0.7], 1.8, phase, [0, 2])


def test_two_relays_slide_together():
    """Two velocities, each held by its relay, which push each other: what both weights are is one linear system."""
    s = swb.Scene("a b", p="k", name="two")
    a, b = s.v
    one, other = swb.sign(1.0 - a), swb.sign(b + 0.5)
    s.force([s.k * one + 0.5 * other + s.t, 0.4 * one - 2.0 * other])

    def phase(t, z, p):
        pa, pb = 1.0 - z[2], z[3] + 0.5
        free = [k for k, v in enumerate((pa, pb)) if abs(v) < 1e-10]
        m = np.array([[p[0], 0.5], [0.4, -2.0]])
        fixed = np.array([0.0 if k in free else np.sign(v) for k, v in enumerate((pa, pb))])

        def weights(t):
            w = fixed.copy()
            if free:
                need = -(m @ fixed)[free] - np.array([t, 0.0])[free]
                w[free] = np.linalg.solve(m[np.ix_(free, free)], need)
            return w

        assert np.abs(weights(t)).max() <= 1.0
        rhs = lambda t, z: [z[2], z[3], *(m @ weights(t) + [t, 0.0])]
        events = []
        if 0 not in free:
            events.append((lambda _, z: fixed[0] * (1.0 - z[2]), lambda z: np.array([z[0], z[1], 1.0, z[3]])))
        if 1 not in free:
            events.append((lambda _, z: fixed[1] * (z[3] + 0.5), lambda z: np.array([z[0], z[1], z[2], -0.5])))
        return rhs, events

    run = check(s, [0.0, 0.0, 0.0, 0.5], [3.0], 1.5, phase, [0, 2, 3, 4])
    names = [c["name"] for c in s.report_data()["contacts"]]
    first, second = (run.force(n, 1.4)[1] for n in names)
    assert abs(first) < 1.0 and abs(second) < 1.0


def test_controls_that_change_while_a_relay_slides():
    s = swb.Scene("x", u="push", name="pushed")
    s.force([s.push - 2.0 * swb.sign(s.v[0])])
    e = swb.Integrator(s.system())
    e.reinit([0.0, 1.0])
    for end, push in ((1.0, 0.5), (2.0, -1.0), (3.0, 3.0), (4.0, 0.0)):
        e.set_controls([push])
        e.advance(end)
    # stops at 2/3, held until 2, driven with 1 until 3, and stopped again
    np.testing.assert_allclose(e.state, [1.0 / 3.0 + 0.5 + 0.25, 0.0], rtol=1e-7, atol=1e-9)


def test_a_batch_and_a_record():
    s = press()
    starts = np.array([[0.0, 0.0, 0.0], [0.05, 0.1, 0.2]])
    each = [swb.simulate(s.system(), x, 0.8, p=[0.5, 1.0]).x[-1] for x in starts]
    found = swb.simulate_batch(s.system(), starts, 0.8, p=[0.5, 1.0])
    np.testing.assert_allclose(found.x, each, rtol=1e-9)


def test_a_gripper_lets_go():
    """A discrete state, a guard, a bounce: closed form in `tests/scene_transitions.rs`, here by SciPy."""
    s = swb.Scene("y", p="e", name="gripper")
    held = s.discrete("held", 1)
    y = s.q[0]
    s.force([-10.0 * (1.0 - held)])
    s.contact("floor", gap=y, e=s.e)
    s.transition(y > 1.2, when={held: 1}, to={held: 0}, name="let go")
    assert "held 1 -> 0 where y - 1.2 becomes positive" in s.report()

    def phase(t, z, p):
        fall = 0.0 if z[2] else -10.0
        events = [(lambda _, z: 1.2 - z[0], lambda z: np.array([1.2, z[1], 0.0]))] if z[2] else []
        if not z[2]:
            events.append((lambda _, z: z[0] if z[1] < 0 else 1.0, lambda z: np.array([0.0, -p[0] * z[1], 0.0])))
        return (lambda _, z: [z[1], fall, 0.0]), events

    run = check(s, [0.5, 1.0, 1.0], [0.8], 2.0, phase, [0, 1, 3])
    assert len(run.jumps) == 1
    # the discrete state may be left out
    np.testing.assert_allclose(s.simulate([0.5], [1.0], 2.0, p=[0.8]).x[-1], run.x[-1], atol=1e-6)
    assert swb.simulate(s, [0.5, 1.0], 2.0, p=[0.8]).x[-1][2] == 0.0


def test_pulses_drive_a_motor_against_a_stop():
    """Sampled control by pulses, a current, dry friction, and a stop that is hit."""
    s = swb.Scene("x", states="i", name="pulsed")
    duty = s.hold(0.2 + 0.5 * (0.5 - s.q[0]), 0.2)
    pulse = s.pwm(duty, 0.1)
    s.force([3.0 * s.i])
    s.state_rates([(6.0 * pulse - s.i - s.v[0]) / 0.2])
    s.friction("rail", s.q[0], 0.4)
    s.contact("stop", gap=0.25 - s.q[0], e=0.5)
    end = 0.85  # three impacts; behind that they accumulate
    run = swb.simulate(s.system(), s._start([0.0], [0.0], [0.0]), end, rtol=1e-11, atol=1e-12)
    assert run.success, run.reason

    # between the times at which pulses begin or end nothing but friction and the stop switches
    x, held = np.zeros(3), 0.0
    for k in range(9):
        start = 0.1 * k
        if k % 2 == 0:
            held = 0.2 + 0.5 * (0.5 - x[0])
        for on, a, b in ((1.0, start, min(start + 0.1 * held, end)), (0.0, start + 0.1 * held, min(start + 0.1, end))):
            if b <= a:
                continue

            def phase(t, z, p, on=on):
                stuck = abs(z[1]) < 1e-10 and 3.0 * abs(z[2]) <= 0.4
                side = np.sign(z[1]) if abs(z[1]) >= 1e-10 else np.sign(z[2])
                rhs = lambda _, z: [z[1] * (not stuck), 0.0 if stuck else 3.0 * z[2] - 0.4 * side, (6.0 * on - z[2] - z[1]) / 0.2]
                events = []
                if stuck:
                    events.append((lambda _, z: 0.4 - 3.0 * abs(z[2]), lambda z: np.array([z[0], 0.0, z[2] * (1 + 1e-12)])))
                elif abs(z[1]) >= 1e-10:
                    events.append((lambda _, z: side * z[1], lambda z: np.array([z[0], 0.0, z[2]])))
                events.append((lambda _, z: 0.25 - z[0], lambda z: np.array([0.25, -0.5 * z[1], z[2]])))
                return rhs, events

            x = by_hand(phase, x, [], b - a)
    assert len(run.impacts) == 3
    np.testing.assert_allclose(run.x[-1][:3], x, rtol=1e-6, atol=1e-8)


def test_hysteresis_and_relay():
    """A heater with hysteresis feeds a drive whose velocity a relay holds."""
    s = swb.Scene("x", states="z", name="heated")
    heat = s.hysteresis(-s.z, -0.8, -1.2, initial=1)
    s.force([s.z - 2.0 * swb.where(s.v[0] > 0.2, 1.0, 0.0)])
    s.state_rates([2.0 * heat - s.z])
    run = s.simulate([0.0], [0.0], 3.0, states=[0.0], rtol=1e-10, atol=1e-12)
    # z rises to 1.2 in ln 2.5, falls to 0.8 in ln 1.5, and so on
    times = np.log(2.5) + np.concatenate([[0.0], np.cumsum(np.tile([np.log(1.5), np.log(1.5)], 3))])
    np.testing.assert_allclose([j.t for j in run.jumps], times[times < 3.0], rtol=1e-8)
    np.testing.assert_allclose(run.x[-1][1], 0.2, atol=1e-9)


def test_events_of_a_scene():
    s = swb.Scene("y", name="ball")
    s.force([-10.0])
    s.contact("floor", gap=s.q[0], e=0.5)
    s.note(s.q[0] > 1.0, name="high")
    s.stop_at(s.v[0] < -2.5, name="fast")
    run = s.simulate([0.0], [10.0], 9.0, rtol=1e-10, atol=1e-12)
    assert run.stopped_by == "fast"
    np.testing.assert_allclose(run.t_end, 1.25, rtol=1e-9)
    assert len(run.notes) == 1


def _force(make):
    s = swb.Scene("x", u="u", p="p")
    s.force([make(s)])
    return s


def _gap():
    s = _force(lambda s: 0.0)
    s.contact("c", gap=s.q[0] + swb.sign(s.q[0]))
    return s.system()


def _inertia():
    s = _force(lambda s: 0.0)
    s.inertia([2.0 + swb.sign(s.q[0])])
    return s.system()


def _bound():
    s = _force(lambda s: 0.0)
    s.friction("joint", s.q[0], 2.0 + swb.sign(s.v[0]))
    return s.system()


def _projected():
    s = swb.Projected("x")
    s.f([swb.sign(s.x[0])])
    return swb.simulate_fesd(s, [1.0], 1.0, 4)


def _guard(make, when=None):
    s = _force(lambda s: 0.0)
    s.transition(make(s), when=when, reset={s.v[0]: 0.0})
    return s.system()


def _twice():
    s = swb.Scene("x")
    s.discrete("w")
    s.discrete("w")


def _rates():
    s = swb.Scene("x", states="z")
    s.discrete("w")
    s.state_rates([0.0, 0.0])


def _jumping():
    s = _force(lambda s: 0.0)
    s.transition(s.q[0] > 1.0, reset={s.v[0]: -s.v[0]})
    return s


RELAY = lambda s: -swb.sign(s.v[0])
NONSENSE = {
    "a gap that switches": (_gap, swb.UnsupportedError, "only forces and the rates"),
    "an inertia that switches": (_inertia, swb.UnsupportedError, "only forces and the rates"),
    "a bound that switches": (_bound, swb.UnsupportedError, "only forces and the rates"),
    "finite elements of a projected system that switches": (_projected, swb.UnsupportedError, "switch at"),
    "floor in a force": (lambda: _force(lambda s: swb.floor(s.v[0])).system(), swb.UnsupportedError, "has floor"),
    "time stepping": (lambda: _force(RELAY).simulate_steps([0], [1], 1), swb.UnsupportedError, "switch at v_x = 0"),
    "time-freezing": (lambda: _force(RELAY).freeze(), swb.UnsupportedError, "switch at v_x = 0.*switch of forces"),
    "jumps by time stepping": (lambda: _jumping().simulate_steps([0], [1], 1), swb.UnsupportedError, "cannot follow transitions"),
    "jumps in time-freezing": (lambda: _jumping().freeze(), swb.UnsupportedError, "time-freezing cannot follow transitions"),
    "a guard that switches": (lambda: _guard(lambda s: abs(s.q[0]) > 1.0), swb.UnsupportedError, "switches itself"),
    "a guard without variables": (lambda: _guard(lambda s: 1.0), swb.ArgumentError, "never passes zero"),
    "a state of another scene": (lambda: _guard(lambda s: s.q[0] > 1.0, {"z": 1.0}), swb.ArgumentError, "no state of the scene"),
    "a discrete state twice": (lambda: _twice(), swb.ArgumentError, "variable 'w' already"),
    "a discrete state that is NaN": (lambda: swb.Scene("x").discrete("w", np.nan), swb.RangeError, "initial value"),
    "rates of discrete states": (lambda: _rates(), swb.DimensionError, "state_rates has shape"),
    "finite elements": (lambda: swb.simulate_fesd(_force(RELAY), [0, 1], 1.0, 4), swb.UnsupportedError, "cannot follow"),
}


@pytest.mark.parametrize("what", NONSENSE)
def test_nonsense(what):
    call, error, words = NONSENSE[what]
    with pytest.raises(error, match=words):
        call()


def test_products_that_vanish_together_are_named():
    s = swb.Scene("x")
    s.force([swb.where(s.q[0] > 0, swb.where(s.v[0] > 0, -2.0, -1.0), 1.0)])
    run = s.simulate([0.0], [0.0], 1.0)
    assert not run.success and "multiply each other" in run.reason
    assert s.simulate([0.1], [0.1], 0.2).success


def test_resets_that_bodies_do_not_allow():
    s = swb.Scene("y")
    s.force([-10.0])
    s.contact("floor", gap=s.q[0])
    s.transition(s.q[0] < 0.2, reset={s.q[0]: -0.3})
    run = s.simulate([1.0], [0.0], 1.0)
    assert not run.success and "overlap" in run.reason and "floor" in run.reason
