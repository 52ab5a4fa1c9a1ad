"""Events by name: what users of other packages expect of a run."""

import math
import pickle

import numpy as np
import pytest

import switchback_control as swb
from switchback_control.expr import Model, floor, mod, table


def oscillator():
    m = Model(states="q v", name="oscillator")
    m.derivatives = [m.v, -m.q]
    return m


def test_states_and_times_have_the_names_of_scipy():
    m = oscillator()
    run = swb.simulate(m, [0, 1], 7.0)
    assert run.y.shape == (2, len(run.t))
    assert run.y.base is not None and np.shares_memory(run.y, run.x)
    assert np.allclose(run.y[0], np.sin(run.t), atol=1e-7)
    assert len(run.t_events) == 0 and run.stopped_by is None


def test_events_of_a_run_by_name_and_number():
    m = oscillator()
    up = m.note(m.q > 0, name="up")
    m.note(m.v < 0)
    run = swb.simulate(m, [0, -1], 14.0, rtol=1e-10, atol=1e-12)
    assert up == 0 and run.t_events.keys() == ("up", "event 1")
    assert np.allclose(run.t_events["up"], [np.pi, 3 * np.pi], atol=1e-9)
    assert run.t_events[0] is not None and (run.t_events[0] == run.t_events["up"]).all()
    assert run.y_events["up"].shape == (2, 2) and np.allclose(run.y_events["up"], [[0, 1], [0, 1]], atol=1e-9)
    assert len(run.notes) == run.stats.notes == 4
    assert [n.event for n in run.notes] == [0, 1, 0, 1]
    with pytest.raises(KeyError, match="there is no event 'ub'.*up"):
        run.t_events["ub"]
    plain = swb.simulate(oscillator(), [0, -1], 14.0, rtol=1e-10, atol=1e-12)
    assert plain.stats.steps == run.stats.steps and (plain.x == run.x).all()


def test_switches_and_transitions_are_events_too():
    m = Model(states="q v")
    m.derivatives = [m.v, -9.81 - swb.sign(m.v)]
    m.transition(m.q < 0, reset={m.v: -0.8 * m.v}, name="bounce")
    run = swb.simulate(m, [1, 0], 2.0)
    assert run.t_events.keys() == ("bounce", "subsystem 0")
    assert (run.t_events["bounce"] == [j.t for j in run.jumps]).all()
    assert (run.t_events["subsystem 0"] == run.switch_times).all()
    assert np.abs(run.y_events["bounce"][:, 0]).max() < 1e-9 and (run.y_events["bounce"][:, 1] < 0).all()


def test_an_event_ends_a_run():
    m = Model(states="y v", parameters="c", name="drop")
    m.derivatives = [m.v, m.c * m.v**2 - 9.81]
    m.stop_at(m.y < 0, name="landed")
    m.stop_at(m.v < -50)
    landing = lambda y, c: math.acosh(math.exp(c * y)) / math.sqrt(9.81 * c)
    run = swb.simulate(m, [10, 0], 100.0, p=[0.1], rtol=1e-11, atol=1e-12, sensitivity=True)
    assert run.success and run.outcome == swb.RunOutcome.EVENT and run.stopped_by == "landed"
    assert "landed" in run.reason and abs(run.t_end - landing(10, 0.1)) < 1e-9
    assert run.t_events["landed"] == [run.t_end] and len(run.t_events[1]) == 0
    h = 1e-5
    by_c = (landing(10, 0.1 + h) - landing(10, 0.1 - h)) / (2 * h)
    assert abs(run.jump_derivatives[0][2] - by_c) < 1e-6
    speed = lambda c: swb.simulate(m, [10, 0], 100.0, p=[c], rtol=1e-11, atol=1e-12).x_end[1]
    assert abs(run.dx_dp[1, 0] - (speed(0.1 + h) - speed(0.1 - h)) / (2 * h)) < 1e-4
    assert np.abs(run.dx_dp[0]).max() < 1e-9 and np.abs(run.dx_dx0[0]).max() < 1e-9
    assert swb.simulate(m, [10, 0], 100.0, p=[1e-6]).stopped_by == "landed"
    assert swb.simulate(m, [500, 0], 100.0, p=[1e-6]).stopped_by == 1
    assert swb.simulate(m, [10, 0], 0.5, p=[0.1]).stopped_by is None
    batch = swb.simulate_batch(m, [[10, 0], [20, 0]], 100.0, p=[0.1])
    assert batch.success.all()


def test_gradients_of_a_run_that_an_event_ends():
    m = Model(states="y v", parameters="c")
    m.derivatives = [m.v, m.c * m.v**2 - 9.81]
    m.stop_at(m.y < 0)
    with swb.Integrator(m, adjoint=True, sensitivity="on", rtol=1e-10, atol=1e-12) as i:
        i.set_params([0.1])
        i.reinit([10, 0])
        assert i.advance(100) == swb.RunOutcome.EVENT
        g = i.adjoint([0.0, 1.0])
        run = i.run
    assert np.allclose(g.p, run.dx_dp[1], rtol=1e-7) and np.allclose(g.x0, run.dx_dx0[1], rtol=1e-7, atol=1e-9)


def test_joined_conditions():
    m = oscillator()
    n = m.discrete("n")
    m.transition((m.q > 0) & (m.v > 0), reset={n: n + 1}, edge=True)
    m.note((m.q > 0.5) | (m.v > 0.5), name="either")
    m.note(~((m.q < 0) | (m.v < 0)), name="neither")
    m.note(m.q < 2, name="never")
    # (sin t, cos t): in the first quadrant from the start, and again from every turn on
    run = swb.simulate(m, [math.sin(0.1), math.cos(0.1), 0], 20.0, rtol=1e-10, atol=1e-12)
    turns = 2 * np.pi * np.arange(1, 4) - 0.1
    assert run.x_end[2] == 3 and np.allclose(run.t_events[0], turns, atol=1e-8)
    assert np.allclose(run.t_events["neither"], turns, atol=1e-8)
    assert np.allclose(run.t_events["either"], turns - np.pi / 3, atol=1e-8)
    assert len(run.t_events["never"]) == 0
    again = Model.from_json(m.to_json())
    same = swb.simulate(again, [math.sin(0.1), math.cos(0.1), 0], 20.0, rtol=1e-10, atol=1e-12)
    assert same.t_events.keys() == run.t_events.keys() and (same.t_events["either"] == run.t_events["either"]).all()


def test_automata_take_joined_conditions():
    m = oscillator()
    mode = swb.Automaton(m, states="out in", name="mode")
    mode.edge("out", "in", when=(m.q > 0) & (m.v > 0))
    mode.edge("in", "out", when=(m.q < 0) | (m.v < 0))
    run = swb.simulate(m, [-1, 0, 0], 7.0, rtol=1e-10, atol=1e-12)
    stays = [i for i in run.discrete(mode) if i.value == "in"]
    assert len(stays) == 1
    assert abs(stays[0].start - np.pi / 2) < 1e-8 and abs(stays[0].end - np.pi) < 1e-8


def test_a_quantised_sampled_controller():
    h, lsb = 0.1, 0.02
    m = Model(states="q v", parameters="gain")
    measured = lsb * floor(m.q / lsb + 0.5)
    force = m.hold(swb.clip(-m.gain * measured - m.v, -0.4, 0.4), h, name="force")
    m.derivatives = [m.v, force - m.q]
    end = 50 * h - 1e-9
    run = swb.simulate(m, {"q": 1, "v": 0}, end, p=[2], rtol=1e-11, atol=1e-12, sensitivity=True)

    def by_hand(gain):
        q, v = 1.0, 0.0
        for _ in range(50):
            u = min(max(-gain * lsb * math.floor(q / lsb + 0.5) - v, -0.4), 0.4)
            c, s = math.cos(h), math.sin(h)
            q, v = u + (q - u) * c + v * s, v * c - (q - u) * s
        return np.array([q, v])

    assert np.abs(run.x_end[:2] - by_hand(2)).max() < 1e-8
    d = 1e-7
    assert np.abs(run.dx_dp[:2, 0] - (by_hand(2 + d) - by_hand(2 - d)) / (2 * d)).max() < 1e-5


def test_floor_and_mod_of_numbers_and_of_expressions():
    assert floor(2.7) == 2 and mod(-1, 3) == 2
    m = Model(states="s")
    m.derivatives = [m.s % 1.0]
    with pytest.raises(swb.UnsupportedError, match="hold the value"):
        m.system()
    n = Model(states="s")
    n.derivatives = [0 * n.s + 1]
    n.every(1.0, {n.s: n.s % 1.0 + n.s // 2 + np.floor(n.s)}, offset=0.5)
    run = swb.simulate(n, [3.0], 0.9)
    assert abs(run.x_end[0] - (0.5 + 1 + 3 + 0.4)) < 1e-12
    with pytest.raises(swb.UnsupportedError, match="floor"):
        n.function(floor(n.s))


def test_tables_of_time_know_their_knots():
    hours = np.arange(0.0, 24.5, 0.5)
    data = np.sin(17 * hours**2)
    for kind in ("lines", "steps"):
        values = data if kind == "lines" else np.append(data, 0.3)
        exact = np.trapezoid(data, hours) if kind == "lines" else 0.5 * values[1:-1].sum()
        m = Model(states="a b")
        w = table(m.t, hours, values, kind)
        m.derivatives = [w, w - m.b]
        known = swb.simulate(m, [0, 0], 24.0)
        assert abs(known.x_end[0] - exact) < 1e-9
        assert np.isin(hours, known.t).all()
        # of a state that is the time nothing is known before
        f = Model(states="a b clock")
        w = table(f.clock, hours, values, kind)
        f.derivatives = [w, w - f.b, 1]
        assert 3 * known.stats.evaluations < swb.simulate(f, [0, 0, 0], 24.0).stats.evaluations


def test_known_times_of_a_system():
    with swb.tracing(False):
        s = swb.System(1, f0=lambda x, t: [1.0 if t < 0.3 else -2.0])
    s.add_known_times(0.3, jumps=True)
    run = swb.simulate(s, [0], 1.0)
    assert abs(run.x_end[0] - (0.3 - 1.4)) < 1e-12 and run.stats.rejections == 0
    with pytest.raises(swb.RangeError, match="finite"):
        s.add_known_times([np.nan])


def test_events_of_a_system_of_functions():
    s = swb.System(1, f0=lambda x: [1.0 + 0 * x[0]])
    s.note(lambda x: x[0] - 0.25, name="quarter")
    s.stop_at(lambda x: 0.5 - x[0], "falling", name="half")
    run = swb.simulate(s, [0], 1.0)
    assert abs(run.t_end - 0.5) < 1e-12 and run.stopped_by == "half"
    assert np.allclose(run.t_events["quarter"], 0.25)
    with pytest.raises(swb.RangeError, match="'half' already"):
        s.note(lambda x: x[0], name="half")


def test_copies_and_files_keep_events(tmp_path):
    m = oscillator()
    m.note(m.q > 0, name="up")
    m.stop_at(m.v > 0.5, name="fast")
    run = swb.simulate(m, [0, -1], 14.0)
    run.save(tmp_path / "run.json")
    for copy in (pickle.loads(pickle.dumps(run)), swb.load(tmp_path / "run.json")):
        assert copy.stopped_by == "fast" and copy.success
        assert (copy.t_events["up"] == run.t_events["up"]).all() and (copy.y_events["up"] == run.y_events["up"]).all()
        assert copy.t_events.keys() == run.t_events.keys()


def test_bad_events_are_refused_with_words():
    m = oscillator()
    m.note(m.q > 0, name="up")
    with pytest.raises(swb.ArgumentError, match="'up' already"):
        m.stop_at(m.q > 1, name="up")
    with pytest.raises(swb.ArgumentError, match="never passes zero"):
        m.stop_at(1.0)
    with pytest.raises(swb.ArgumentError, match="must be a text"):
        m.note(m.q > 0, name=3)
    with pytest.raises(swb.DimensionError):
        m.note(m.x)
    k = oscillator()
    k.stop_at(abs(k.q) - 1)
    with pytest.raises(swb.UnsupportedError):
        k.system()
    o = oscillator()
    o.stop_at(o.q > 1)
    with pytest.raises(swb.UnsupportedError, match="stops"):
        swb.Ocp(o, 1.0, 3, initial_state=[0, 0]).solve()
    with pytest.raises(TypeError, match="events are part of the model|no keyword"):
        try:
            swb.simulate(oscillator(), [0, 1], 1.0, events=[lambda t, y: y[0]])
        except swb.ArgumentError as error:
            raise TypeError(str(error)) from None


@pytest.mark.parametrize("method", ["auto", "dp5", "radau5"])
@pytest.mark.parametrize("kind", ["steps", "lines", "spline"])
def test_derivatives_go_through_knots(kind, method):
    values = [0.5, 3.0, -0.5] + [0.2] * (kind == "steps")
    m = Model(states="q v", parameters="a b")
    m.derivatives = [m.v, m.a * table(2 * m.t - 0.3, [0.4, 1.0, 2.9], values, kind) - m.b * swb.sign(m.v) - m.q]
    options = {"rtol": 1e-11, "atol": 1e-12, "method": method}
    p, weights = np.array([1.3, 0.4]), np.array([1.0, 0.5])
    with swb.Integrator(m, adjoint=1, sensitivity="on", **options) as i:
        i.set_params(p)
        i.reinit([0.1, 0.0])
        i.advance(3.0)
        found, run = i.adjoint(weights).p, i.run
    end = lambda p: swb.simulate(m, [0.1, 0.0], 3.0, p=p, **options).x_end @ weights
    h = 1e-6
    differences = [(end(p + h * e) - end(p - h * e)) / (2 * h) for e in np.eye(2)]
    assert found == pytest.approx(differences, abs=1e-6) and weights @ run.dx_dp == pytest.approx(found, abs=1e-9)


def test_code_in_c_has_what_rounds():
    m = oscillator()
    m.transition(m.q < 0, reset={m.v: swb.clip(-m.v, 0, 1.5) + 0.1 * floor(3 * m.v)})
    assert "floor(" in m.c_code()


@pytest.mark.parametrize("kind", ["smooth", "friction", "sliding", "bounces"])
def test_notes_are_where_transitions_of_edges_are(kind):
    """The same conditions as notes, which are found on the dense output, and as transitions, which end steps."""
    rng = np.random.default_rng(5)
    compared = 0
    for trial in range(12):
        a = rng.normal(size=7)

        def made(counted):
            m = Model(states="q v w")
            q, v, w = m.x
            force = [v, -q * (1 + 0.3 * a[0] ** 2) - 0.1 * v + a[2] * swb.sin(3 * a[1] * m.t), a[3] * q - w]
            force[1] = force[1] - (0.4 * swb.sign(v) if kind == "friction" else 0)
            force[2] = force[2] - (1.5 * swb.sign(w - 0.2 * swb.sin(m.t)) if kind == "sliding" else 0)
            m.derivatives = force
            if kind == "bounces":
                m.transition(q < -0.3, reset={v: -0.7 * v})
            f, g = q + 0.5 * w - 0.2 * a[4], v * w - 0.3 * a[5] * q
            events = []
            for when in (f > 0, (f > 0) & (g > 0), (f > 0) | (g < 0), ~((f > 0) & (g > 0)), swb.sin(6 * q) + 0.3 * a[6] > 0):
                if counted:
                    n = m.discrete()
                    events.append(m.transition(when, reset={n: n + 1}, edge=True))
                else:
                    events.append(m.note(when))
            return m, events

        start, tol = rng.normal(size=3), (1e-6, 1e-9)[trial % 2]
        options = {"rtol": tol, "atol": tol, "method": ("auto", "dp5", "radau5")[trial % 3]}
        (m, jumps), (n, notes) = made(True), made(False)
        first, second = (swb.simulate(k, start, 10.0, **options) for k in (m, n))
        for j, k in zip(jumps, notes):
            assert len(first.t_events[j]) == len(second.t_events[k]), (trial, j, first.t_events[j], second.t_events[k])
            assert np.abs(first.t_events[j] - second.t_events[k]).max(initial=0) < 1e3 * tol
            compared += len(second.t_events[k])
    assert compared > 100


def test_dense_output_of_a_long_run_keeps_the_last_steps():
    """The run oscillates for ten thousand steps, of which a hundred are kept."""
    m = Model(2)
    m.derivatives = [m.x[1], -m.x[0]]
    end = 2000.0
    whole, last = [
        swb.simulate(m, [1, 0], end, rtol=1e-6, h_max=0.2, dense_steps=kept) for kept in (0, 100)
    ]
    assert whole.stats.steps >= 10000 and last.stats.steps == whole.stats.steps
    for back in (0.0, 0.7, 10.0):
        assert np.array_equal(last(end - back), whole(end - back))
    with pytest.raises(swb.SwitchbackError, match="raise dense_steps"):
        last(end - 30.0)
