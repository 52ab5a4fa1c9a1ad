"""Sliding modes of higher order as control engineers write them: what the theory says of where they end, at every tolerance.

Every run has to reach its end: through the accumulation of its switches, or by steps whose error is stated.
"""

import math

import numpy as np
import pytest
import switchback_control as swb
from switchback_control.expr import Model, cos, sign, sin, sqrt

TOLERANCES = [1e-4, 1e-6, 1e-8, 1e-10]


def root(a):
    return sqrt(abs(a)) * sign(a)


def run(model, x0, t_end, rtol):
    r = swb.simulate(model, x0, t_end, rtol=rtol, atol=1e-2 * rtol, dense=False)
    assert r.success, (rtol, r.outcome, r.t_end, r.reason)
    return r


def allowed(r, rtol):
    """A hundred times the tolerance, and what passages and limit sets say they have added."""
    return 1e2 * rtol * (1 + max((a.error for a in r.accumulations), default=0.0) / 10)


@pytest.mark.parametrize("rtol", TOLERANCES)
def test_a_differentiator_follows_the_derivative_of_its_signal(rtol):
    """Levant's differentiator of f(t) = sin 2t + 0.3 t with L > 4: from its convergence on x1 = f, x2 = f'."""
    for gain in (5.0, 8.0):
        m = Model(2)
        x = m.x
        e = x[0] - sin(2 * m.t) - 0.3 * m.t
        m.derivatives = [-1.5 * math.sqrt(gain) * root(e) + x[1], -1.1 * gain * sign(e)]
        r = run(m, [0.3, -0.4], 6.0, rtol)
        exact = [math.sin(12.0) + 1.8, 2 * math.cos(12.0) + 0.3]
        assert np.abs(np.subtract(r.x_end, exact)).max() <= allowed(r, rtol), (r.x_end, exact)


@pytest.mark.parametrize("rtol", TOLERANCES)
def test_an_observer_has_the_states_of_its_plant(rtol):
    """A super-twisting observer of a pendulum: position and velocity are those of the plant after finite time."""
    m = Model(4)
    x = m.x
    e = x[0] - x[2]
    m.derivatives = [x[1], -sin(x[0]) - 0.2 * x[1] + 0.5 * cos(m.t), x[3] + 2.6 * root(e), 3 * sign(e) - sin(x[0])]
    r = run(m, [0.5, -0.8, 0.0, 0.0], 6.0, rtol)
    assert abs(r.x_end[0] - r.x_end[2]) + abs(r.x_end[1] - r.x_end[3]) <= allowed(r, rtol), r.x_end


@pytest.mark.parametrize("rtol", TOLERANCES)
def test_coupled_channels_arrive_one_after_the_other(rtol):
    """Two super-twisting channels, and two twisting ones, that disturb each other: all states end at zero, and the second channel
    goes on switching while the first one slides already."""
    m = Model(4)
    x = m.x
    s, q = sign(x[0]), sign(x[2])
    first = -1.5 * root(x[0]) + x[1] + 0.2 * x[2]
    m.derivatives = [first, -1.3 * s + 0.4 * cos(2 * m.t), -2 * root(x[2]) + x[3] - 0.1 * x[0], -2 * q + 0.5 * sin(m.t)]
    r = run(m, [0.4, -0.3, 0.7, 0.5], 6.0, rtol)
    assert abs(r.x_end[0]) + abs(r.x_end[2]) <= allowed(r, rtol)
    m = Model(4)
    x = m.x
    m.derivatives = [
        x[1],
        -3 * sign(x[0]) - 1.2 * sign(x[1]) + 0.2 * x[2],
        x[3],
        -4 * sign(x[2]) - 1.5 * sign(x[3]) + 0.3 * sin(x[0]),
    ]
    r = run(m, [0.3, -0.5, -0.9, 0.2], 9.0, rtol)
    assert np.abs(r.x_end).max() <= allowed(r, rtol), r.x_end
    assert len(r.accumulations) <= 6 and len(r.switches) < 1000


@pytest.mark.parametrize("rtol", TOLERANCES)
def test_surfaces_with_roots_are_reached(rtol):
    """Terminal sliding modes, whose switching functions contain roots of states that change their sign: x = 0 in finite time."""
    for surface, gain in ((lambda x: x[1] + 0.9 * root(x[0]), 3.5), (lambda x: x[1] + 1.0 * root(x[0]), 4.0)):
        m = Model(2)
        x = m.x
        m.derivatives = [x[1], -gain * sign(surface(x)) + 0.3 * sin(3 * m.t)]
        r = run(m, [0.7, -0.4], 5.0, rtol)
        # the time of arrival is known to the root of what is known of the state
        assert abs(r.x_end[0]) <= allowed(r, rtol) + 1e-6 and abs(r.x_end[1]) <= 1e-2


@pytest.mark.parametrize("rtol", TOLERANCES)
def test_fullers_problem_ends_at_the_origin(rtol):
    m = Model(2)
    x = m.x
    m.derivatives = [x[1], -sign(x[0] + 0.4446 * x[1] * abs(x[1]))]
    r = run(m, [0.8, -0.3], 6.0, rtol)
    assert np.abs(r.x_end).max() <= allowed(r, rtol), r.x_end


def test_a_function_with_a_branch_that_ends_at_the_surface_keeps_its_values():
    """sqrt |x| has the same value on both sides as ever, and a mode that ends at the surface is not left without one."""
    m = Model(1)
    m.derivatives = [-root(m.x[0])]
    r = run(m, [0.25], 0.5, 1e-10)
    # sqrt x = 1/2 - t/2
    assert abs(r.x_end[0] - 0.0625) < 1e-9


def test_the_policy_to_stop_still_stops():
    m = Model(2)
    x = m.x
    m.derivatives = [x[1], -3 * sign(x[0]) - 1.2 * sign(x[1])]
    r = swb.simulate(m, [1, 0], 8.0, zeno="stop", dense=False)
    assert not r.success and "zeno" in str(r.outcome)


def nonsingular_terminal(b, k):
    model = Model(2)
    x = model.x
    surface = x[0] + abs(x[1]) * sqrt(abs(x[1])) * sign(x[1]) / b
    model.derivatives = [x[1], 0.4 * sin(3 * model.t) - k * sign(surface)]
    return model


def nested():
    """A. Levant, Int. J. Control 76 (2003) 924-941, the nested controller of order three."""
    model = Model(3)
    x = model.x
    first = x[1] + abs(x[0]) ** (2 / 3) * sign(x[0])
    inner = (abs(x[1]) ** 3 + abs(x[0]) ** 2) ** (1 / 6)
    model.derivatives = [x[1], x[2], 0.2 * sin(model.t) - 5 * sign(x[2] + 2 * inner * sign(first))]
    return model


def coupled_super_twisting():
    model = Model(4)
    x = model.x
    s, r = sign(x[0]), sign(x[2])
    model.derivatives = [
        -1.5 * sqrt(abs(x[0])) * s + x[1] + 0.2 * x[2],
        -1.3 * s + 0.4 * cos(2 * model.t),
        -2 * sqrt(abs(x[2])) * r + x[3] - 0.1 * x[0],
        -2 * r + 0.5 * sin(model.t),
    ]
    return model


@pytest.mark.parametrize("rtol", [1e-4, 1e-7, 1e-10, 1e-11])
@pytest.mark.parametrize("b, k, start", [(0.8, 2.5, [0.4, 0.3]), (1.2, 3.0, [-0.9, 0.5]), (1.9, 3.5, [0.2, -0.8])])
def test_terminal_sliding_comes_to_rest_in_bounded_work(b, k, start, rtol):
    r = run(nonsingular_terminal(b, k), start, 5.0, rtol)
    # the exact motion rests in zero; errors are relative to the tolerances
    stated = max((a.error for a in r.accumulations), default=0.0)
    assert max(abs(v) for v in r.x_end) <= 1e-2 * rtol * max(10.0, 3.0 * stated)
    assert r.stats.evaluations < 400_000


@pytest.mark.parametrize("rtol", [1e-4, 1e-7, 1e-11])
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("make, states, end", [(nested, 3, 6.0), (coupled_super_twisting, 4, 6.0)])
def test_what_arrives_in_sets_of_higher_order_takes_bounded_work(make, states, end, seed, rtol):
    start = [math.sin(1.7 + 3.1 * seed + 2.3 * i) for i in range(states)]
    r = run(make(), start, end, rtol)
    assert r.stats.evaluations < 400_000
    # all of them come to rest in zero before, but for the integrators of the channels
    stated = sum(a.error for a in r.accumulations)
    surfaces = [r.x_end[0]] if states == 3 else [r.x_end[0], r.x_end[2]]
    assert max(abs(v) for v in surfaces) <= 1e-2 * rtol * max(100.0, 3.0 * stated)


def seen_by_a_differentiator(acceleration):
    """A plant `x'' = acceleration(estimates, t)` whose control sees what a super-twisting differentiator estimates of it."""
    m = Model(4)
    x = m.x
    e = x[2] - x[0]
    m.derivatives = [x[1], acceleration(x, m.t), x[3] - 3.5 * root(e), -5 * sign(e)]
    return m


@pytest.mark.parametrize("rtol", [*TOLERANCES, 1e-11])
@pytest.mark.parametrize("a, b, start", [(2.6, 0.9, [-0.6, 0.7, 0.2, -0.4]), (2.2, 0.75, [0.8, -0.3, -0.5, 0.6])])
def test_relays_on_an_estimate_switch_while_its_differentiator_slides(a, b, start, rtol):
    """Twisting on an estimated velocity: the weights that keep the differentiator on its signal jump with the relays and decide the
    rate of the estimate. As twisting with the velocity itself, it brings everything to zero."""
    m = seen_by_a_differentiator(lambda x, t: -a * sign(x[0]) - b * sign(x[3]) + 0.2 * sin(t))
    r = run(m, start, 9.0, rtol)
    assert np.abs(r.x_end).max() <= 1e-2 * rtol * max(100.0, 3.0 * sum(v.error for v in r.accumulations)), r.x_end
    # passages by steps may be necessary before the differentiator slides, with errors that do not matter then
    assert all(v.error <= 1e3 for v in r.accumulations), r.accumulations
    assert len(r.switches) < 3000 and r.stats.evaluations < 200_000


@pytest.mark.parametrize("rtol", TOLERANCES)
def test_a_relay_on_an_estimate_slides_within_the_limit_set_of_its_differentiator(rtol):
    """v + 2 x = 0 of the estimates, and so of the plant: x halves in every log(2) / 2."""
    m = seen_by_a_differentiator(lambda x, t: -2.5 * sign(x[3] + 2 * x[2]) + 0.3 * cos(2 * t))
    one, two = (run(m, [0.5, -0.2, 0.1, 0.3], end, rtol) for end in (5.0, 6.0))
    assert abs(two.x_end[1] + 2 * two.x_end[0]) <= allowed(two, rtol)
    assert abs(two.x_end[0] - one.x_end[0] * math.exp(-2)) <= allowed(two, rtol)
    assert all(a.error <= 1e3 for a in two.accumulations)


def block_with_friction(m, q, v, friction, force):
    return [v, -q - friction * sign(v) + force[0] * sin(force[1] * m.t)]


OBSERVED = {"nothing": lambda e, d: [], "its error": lambda e, d: [abs(e)], "the error of its velocity": lambda e, d: [abs(d)]}


@pytest.mark.parametrize("cost", OBSERVED)
@pytest.mark.parametrize("rtol", TOLERANCES)
@pytest.mark.parametrize("seed", range(3))
def test_an_observer_stays_on_a_plant_that_sticks_and_slips(seed, rtol, cost):
    """A super-twisting observer of a block with dry friction, and costs with kinks in what its limit set holds at zero: the plant does not know
    of it, so that the plant alone says where all four states are, and every switch of the plant leaves the limit set where it is."""
    rng = np.random.default_rng(seed)
    gains, friction = rng.uniform([2, 3], [4, 6]), rng.uniform(0.2, 0.5)
    force, start = rng.uniform([0.3, 0.8], [0.7, 2.0]), rng.uniform(-1, 1, 4)
    plant = Model(2)
    plant.derivatives = block_with_friction(plant, *plant.x, friction, force)
    exact = run(plant, start[:2], 10.0, 1e-13)

    m = Model(4 + len(OBSERVED[cost](0, 0)))
    q, v, q_hat, v_hat = (m.x[i] for i in range(4))
    e = q - q_hat
    observer = [v_hat + gains[0] * root(e), gains[1] * sign(e) - q_hat]
    m.derivatives = block_with_friction(m, q, v, friction, force) + observer + OBSERVED[cost](e, v - v_hat)
    r = run(m, [*start, *(0.0 for _ in OBSERVED[cost](0, 0))], 10.0, rtol)

    # rounding of e of 1e-16 is worth its root in a rate; it makes switches of its own from 1e-10 on
    bound = max(allowed(r, rtol), 4 * math.sqrt(np.finfo(float).eps))
    assert np.abs(r.x_end[:4] - np.tile(exact.x_end, 2)).max() <= bound, (r.x_end, exact.x_end)
    # nothing is gone through by steps over a time that could be seen
    assert sum(a.until - a.t for a in r.accumulations if a.steps) < 1e-3
    # switches that go on behind a point do not accumulate there
    assert not [(a.t, s.t) for a in r.accumulations for s in r.switches if a.t < s.t < a.until]
    assert rtol < 1e-9 or len(r.switches) <= len(exact.switches) + 60


@pytest.mark.parametrize("rtol", TOLERANCES)
def test_an_observer_stays_on_a_plant_that_makes_transitions(rtol):
    """An observer of a body that a relay with hysteresis drives: its transitions move nothing that the limit set of the observer ties."""

    def driven(m, x):
        return [x[1], -0.4 * x[1] + 0.8 - 1.6 * m.hysteresis(x[0], on=0.3, off=-0.3)]

    plant, m = Model(2), Model(4)
    plant.derivatives = driven(plant, plant.x)
    x = [m.x[i] for i in range(4)]
    e = x[0] - x[2]
    m.derivatives = driven(m, x) + [x[3] + 3 * root(e), 6 * sign(e)]
    exact, r = run(plant, [1.0, 0.2], 15.0, 1e-13), run(m, [1.0, 0.2, 0.0, 0.0], 15.0, rtol)
    assert len(r.jumps) == len(exact.jumps) > 4
    # switches of the observer are those on its way to the plant
    assert len(r.switches) < 40 and all(s.t < exact.jumps[1].t for s in r.switches)
    assert np.abs(r.x_end[:4] - np.tile(exact.x_end[:2], 2)).max() <= max(allowed(r, rtol), 4 * math.sqrt(np.finfo(float).eps))


@pytest.mark.parametrize("rtol", TOLERANCES)
def test_what_accumulates_behind_a_transition_is_not_the_transition(rtol):
    """Twisting that a transition switches on at t = 0.5 comes to rest in zero; the transition happens once."""
    m = Model(2)
    on = m.hysteresis(m.t, on=0.5, off=-1.0)
    m.derivatives = [m.x[1], -on * (3 * sign(m.x[0]) + 1.5 * sign(m.x[1]))]
    r = run(m, [0.4, 0.3], 8.0, rtol)
    assert len(r.jumps) == 1
    assert np.abs(r.x_end[:2]).max() <= allowed(r, rtol)
