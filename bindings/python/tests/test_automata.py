"""Automata, hysteresis that drives hysteresis, and models with both as documents."""

from __future__ import annotations

import json
import math
import pickle
from pathlib import Path

import numpy
import pytest

import switchback_control as swb
from switchback_control.expr import Model, sign

SCENES = Path(__file__).resolve().parents[3] / "tests" / "data" / "reference" / "scenes"


def reference(name):
    """A problem with its solution in closed form, as numbers."""
    given = json.loads((SCENES / f"{name}.json").read_text())
    return {k: v if k in ("description", "kinds") else numpy.array(v, dtype=float) for k, v in given.items()}


def gear_box():
    """A car: v, the way s and the wear of its gear box; a driver who drives until 24 and coasts until 6."""
    m = Model(states="v s wear", parameters="a d e r")
    v, _, wear = m.x
    a, d, e, r = m.p
    gear = swb.Automaton(m, states="first second third", name="gear")
    driver = swb.Automaton(m, states=["drives", "coasts"], name="driver")
    for k, above in ((0, 10), (1, 18)):
        up = {v: (1 - e) * v, wear: wear + r * v**2}
        gear.edge(gear.states[k], gear.states[k + 1], when=v > above, given={driver: "drives"}, reset=up)
    gear.edge("second", "first", when=v < 7, reset={wear: wear + r})
    gear.edge("third", "second", when=v < 13, reset={wear: wear + r})
    driver.edge("drives", "coasts", when=v > 24)
    driver.edge("coasts", "drives", when=v < 6)
    force = a * gear.choose([3.0, 1.5, 1.0]) * driver.is_in("drives")
    m.derivatives = [force - d * v, v, 0.0]
    return m, gear, driver


def test_a_gear_box_with_a_driver():
    r = reference("gear_box")
    m, gear, driver = gear_box()
    run = swb.simulate(m, r["x0"], r["T"], p=r["p"], rtol=1e-12, atol=1e-12, sensitivity=True)
    assert run.success and not run.one_sided
    assert numpy.allclose([j.t for j in run.jumps], r["switches"], rtol=1e-11)
    assert numpy.allclose(run.x_end[:3], r["x_T"], rtol=1e-11)
    assert numpy.allclose(run.dx_dx0[:3, :3], r["dxT_dx0"], rtol=1e-9, atol=1e-9)
    assert numpy.allclose(run.dx_dp[:3], r["dxT_dp"], rtol=1e-9, atol=1e-9)
    assert (run.dx_dx0[:3, 3:] == 0).all(), "nothing depends smoothly on the discrete states"

    sequence = gear.sequence(run)
    assert sequence == run.discrete(gear)
    assert [i.value for i in sequence[:6]] == ["first", "second", "third", "second", "first", "second"]
    shifts = [t for t, kind in zip(r["switches"], r["kinds"]) if kind.startswith("gear")]
    assert numpy.allclose([i.start for i in sequence], [0.0, *shifts], rtol=1e-11)
    assert all(a.end == b.start for a, b in zip(sequence, sequence[1:])) and sequence[-1].end == run.t_end
    numbers = run.discrete("gear")
    assert [i[:2] for i in numbers] == [i[:2] for i in sequence] == [i[:2] for i in run.discrete(3)]
    assert [gear.states[int(i.value)] for i in numbers] == [i.value for i in sequence]
    assert run.discrete(driver.state) == run.discrete("driver") and run.discrete(driver)[1].value == "coasts"
    # the transitions of a run, in terms of the edges
    passed = {number: (source, target) for source, target, number in gear.edges}
    made = [passed[j.transition] for j in run.jumps if j.transition in passed]
    assert made == [(a.value, b.value) for a, b in zip(sequence, sequence[1:])]


def tanks():
    m = Model(states="h1 h2", parameters="q k1 k2 c lo hi b d")
    h1, h2 = m.x
    q, k1, k2, c, lo, hi, b, d = m.p
    pump, valve = m.discrete("pump"), m.discrete("valve")
    m.transition(h1 < lo - 0.25 * valve, when={pump: 0}, to={pump: 1})
    m.transition(h1 > hi - 0.25 * valve, when={pump: 1}, to={pump: 0})
    m.transition(h2 > b, when={valve: 0}, to={valve: 1})
    m.transition(h2 < d, when={valve: 1}, to={valve: 0})
    m.derivatives = [q * pump - k1 * h1, k1 * h1 - k2 * h2 - c * valve]
    return m


def test_hysteresis_that_drives_hysteresis():
    r = reference("two_tanks")
    run = swb.simulate(tanks(), r["x0"], r["T"], p=r["p"], rtol=1e-12, atol=1e-12, sensitivity=True)
    assert numpy.allclose([j.t for j in run.jumps], r["switches"], rtol=1e-11)
    assert numpy.allclose(run.x_end, [*r["x_T"], *r["w_T"]], rtol=1e-11)
    assert numpy.allclose(run.dx_dp[:2], r["dxT_dp"], rtol=1e-9, atol=1e-9)
    # the valve closes, and the pump goes on at the same time, as its threshold is above the level now
    both = [j for j in run.jumps if j.simultaneous]
    assert len(both) == 10 and all(a.t == b.t and b.transition == 0 for a, b in zip(both[::2], both[1::2]))


def test_a_chain_of_hysteresis_switches_in_one_moment():
    """Each drives the next; all go on when the first does, and the last one resets the clock."""
    m = Model(states="x")
    x = m.x[0]
    chain = [m.hysteresis(x, on=1.0, off=0.0, name="w0")]
    for k in range(1, 6):
        chain.append(m.hysteresis(chain[-1], on=0.5, off=0.25, name=f"w{k}"))
    m.transition(x > 2.0 - chain[-1], reset={x: x - 1.5})
    m.derivative(x, 1.0)
    run = swb.simulate(m, [0.5], 2.25)
    assert run.success and [j.transition for j in run.jumps[:7]] == [0, 2, 4, 6, 8, 10, 12]
    now = run.jumps[0].t
    assert math.isclose(now, 0.5, rel_tol=1e-14) and all(j.t == now and j.simultaneous for j in run.jumps[:13])
    # behind the reset x is -0.5, so all go off at once, and on again at 1, at the time 2
    assert [j.transition for j in run.jumps[7:13]] == [1, 3, 5, 7, 9, 11]
    assert math.isclose(run.jumps[13].t, 2.0, rel_tol=1e-14) and len(run.jumps) == 26
    assert [i.value for i in run.discrete("w5")] == [0.0]
    assert math.isclose(run.x_end[0], -0.25, rel_tol=1e-14)


def test_states_of_others_are_conditions():
    m = Model(states="x")
    x = m.x[0]
    first = swb.Automaton(m, states="off on hot", name="first")
    second = swb.Automaton(m, states=3, initial=1, name="second")
    light = m.discrete("light")
    # the light is on from 1 on: what is switched off at 3 stays so, else it would come back at once and for ever
    first.edge("off", "on", when=x > 1, given={light: 0})
    first.edge(["on"], "hot", when=x > 2)
    first.edge(None, "off", when=x > 3)
    second.edge(1, 2, when=first.is_in("on", "hot"), to={light: 1})
    second.edge(2, 0, when=x > 1.5, given={first: ["hot"], "light": (0, 1)})
    m.derivative(x, 1.0)
    run = swb.simulate(m, [0.0], 4.0)
    assert [i.value for i in run.discrete(first)] == ["off", "on", "hot", "off"]
    assert numpy.allclose([i.start for i in run.discrete(first)], [0, 1, 2, 3], atol=1e-13)
    # it asks for hot, which begins at 2, where x is above 1.5 already
    assert [i.value for i in run.discrete(second)] == [1, 2, 0]
    assert numpy.allclose([i.start for i in run.discrete(second)], [0, 1, 2], atol=1e-13)
    assert [i.value for i in run.discrete("light")] == [0.0, 1.0]
    assert len(first.edges) == 4 and len(second.edges) == 4 and "first" in repr(first)


def test_indicators_are_exact():
    for n in (2, 3, 7, 40):
        m = Model(states="x")
        a = swb.Automaton(m, states=n, name="a")
        odd = a.is_in(*range(1, n, 2))
        values = [math.sqrt(k + 2.0) for k in range(n)]
        f = m.function([a.is_in(k) for k in range(n)] + [odd, a.choose(values), a.choose({0: m.x[0]}, otherwise=2.0)])
        for k in range(n):
            found = f([0.3, float(k)])
            assert found.tolist() == [float(i == k) for i in range(n)] + [k % 2, values[k], 0.3 if k == 0 else 2.0]
            # nothing depends on the place of a state beside the others
            assert (f.jacobian([0.3, float(k)])[:, 1] == 0).all()


def test_models_with_automata_are_documents():
    m, gear, driver = gear_box()
    r = reference("gear_box")
    options = {"p": r["p"], "rtol": 1e-9, "atol": 1e-9, "sensitivity": True}
    run = swb.simulate(m, r["x0"], 30.0, **options)
    document = m.to_json()
    for again in (Model.from_json(document), pickle.loads(pickle.dumps(m))):
        assert again.names == m.names and again.report() == m.report() and again.nx == m.nx
        other = swb.simulate(again, r["x0"], 30.0, **options)
        assert (other.x_end == run.x_end).all() and (other.dx_dp == run.dx_dp).all()
        assert [(j.t, j.transition, *j.after) for j in other.jumps] == [(j.t, j.transition, *j.after) for j in run.jumps]
        assert (other.jump_derivatives == run.jump_derivatives).all()
        assert other.discrete("gear") == run.discrete("gear")
        same = swb.Automaton.of(again, "gear")
        assert same.states == gear.states and same.edges == gear.edges and same.sequence(other) == gear.sequence(run)
        with pytest.raises(swb.ArgumentError, match="automata of gear, driver"):
            swb.Automaton.of(again, "v")
        with pytest.raises(swb.ArgumentError, match="already"):
            same.edge("third", "second", again.x[0] < 13, reset={"wear": 0.0})
        # it can be changed as the one that was written
        again.transition(again.x[0] > 9, reset={"v": 1.0})
        assert len(swb.simulate(again, r["x0"], 30.0, p=r["p"]).jumps) > len(run.jumps)
        assert again.to_json() != document
    report = m.report_data()
    assert report["discrete"] == ["gear", "driver"] and len(report["transitions"]) == 6
    assert "while driver = 0" in report["transitions"][0]
    # what was written before there were names of states, or transitions, has none
    old = json.loads(document)
    assert old["model"].pop("value_names") == [["first", "second", "third"], ["drives", "coasts"]]
    nameless = Model.from_json(json.dumps(old))
    assert (swb.simulate(nameless, r["x0"], 30.0, **options).x_end == run.x_end).all()
    with pytest.raises(swb.ArgumentError, match="no named values"):
        swb.Automaton.of(nameless, "gear")
    del old["model"]["transitions"], old["model"]["discrete"]
    plain = Model.from_json(json.dumps(old))
    assert not swb.simulate(plain, [*r["x0"], 0, 0], 1.0, p=r["p"]).jumps


def test_hostile_documents_are_refused_in_words():
    document = json.loads(tanks().to_json())
    for change, word in [
        (lambda m: m["transitions"][0]["to"].append({"state": 2, "value": 1.0}), "twice"),
        (lambda m: m["transitions"][0]["from"][0].update(state=99), "state 99"),
        (lambda m: m["transitions"][1].update(direction="sideways"), "sideways"),
        (lambda m: m["transitions"][1].update(reset=[0]), "transition 1"),
        (lambda m: m["transitions"][2]["expressions"].update(roots=[4000]), "transition 2"),
        (lambda m: m.update(discrete=[0.0] * 9), "9 discrete states"),
        (lambda m: m.update(value_names=[[], [], ["a"]]), "no discrete state 2"),
        (lambda m: m.update(value_names=[["a", "a"]]), "two values"),
        (lambda m: m.update(value_names=[["a\nb"]]), "no name"),
        (lambda m: m.update(discrete=[0.0] * 3), "h2 is discrete"),
        (lambda m: m["transitions"][0]["to"][0].update(value=None), "null"),
    ]:
        bad = json.loads(json.dumps(document))
        change(bad["model"])
        with pytest.raises(swb.SwitchbackError, match=word):
            Model.from_json(json.dumps(bad))


def test_c_code_has_guards_and_resets():
    code = gear_box()[0].c_code()
    assert "guard0" in code and "reset0" in code and "guard5" in code and "reset5" not in code


def test_nonsense_is_refused_in_words():
    m = Model(states="v")
    v = m.x[0]
    a = swb.Automaton(m, states="idle heat", name="a")
    b = swb.Automaton(m, states=2, name="b")
    other = swb.Automaton(Model(states="v"), states=2)
    a.edge("idle", "heat", when=v > 1)
    a.edge("heat", "idle", when=b.is_in(1))
    n = len(m._transitions)
    for call, word in [
        (lambda: swb.Automaton(m, states=1), "two states at least"),
        (lambda: swb.Automaton(m, states=-3), "two states at least"),
        (lambda: swb.Automaton(m, states="on on"), "one name"),
        (lambda: swb.Automaton(m, states=["on", 3]), "names, or their number"),
        (lambda: swb.Automaton(m, states="on off", initial="of"), "its states are on, off"),
        (lambda: swb.Automaton("model", states=2), "belongs to a Model"),
        (lambda: swb.Automaton(m, states=2, name="a"), "already"),
        (lambda: a.edge("idle", "hot", when=v > 1), "no state 'hot', its states are idle, heat"),
        (lambda: a.edge("cold", "heat", when=v > 1), "source"),
        (lambda: a.edge([], "heat", when=v > 1), "empty"),
        (lambda: a.edge(0, "heat", when=v > 1), "no state 0"),
        (lambda: a.edge("idle", "heat"), "no condition"),
        (lambda: a.edge("idle", "heat", when=True), "comparison"),
        (lambda: a.edge("idle", "heat", when=3.0), "comparison"),
        (lambda: a.edge("idle", "heat", when=v > 1), "from idle to heat already"),
        (lambda: a.edge(None, "heat", when=v - 1.0), "already"),
        (lambda: a.edge("heat", "idle", given={b: 1}), "already"),
        (lambda: a.edge("idle", "idle", when=v > 2), "changes nothing"),
        (lambda: a.edge("idle", "heat", when=v > 2, given={b: 7}), "no state 7"),
        (lambda: a.edge("idle", "heat", when=v > 2, given=[b]), "dictionary"),
        (lambda: a.edge("idle", "heat", when=v > 2, given={a: "idle"}), "source does"),
        (lambda: a.edge("idle", "heat", when=b.is_in(1), given={b: 0}), "different states"),
        (lambda: a.edge("idle", "heat", when=v > 2, given={other: 0}), "another model"),
        (lambda: a.edge("idle", "heat", when=v > 2, given={"speed": 0}), "no state of the model"),
        (lambda: a.edge("idle", "heat", when=v > 2, given={b: 0, b.state: 1}), "twice"),
        (lambda: a.edge("idle", "heat", when=v > 2, reset={a.state: 1}), "target of the edge"),
        (lambda: a.edge("idle", "heat", when=v > 2, to={"a": 1}), "target of the edge"),
        (lambda: a.edge("idle", "heat", when=v > 2, reset=[v]), "dictionary"),
        (lambda: a.edge("idle", "heat", when=v > 2, to=[1]), "dictionary"),
        (lambda: a.edge("idle", "heat", when=v > 2, reset={v: v > 1}), "a condition"),
        (lambda: a.edge("idle", "heat", when=v > other.model.x[0]), "two graphs"),
        (lambda: a.is_in("warm"), "no state 'warm'"),
        (lambda: a.is_in(), "empty"),
        (lambda: a.choose([1.0]), "1 values for 2 states"),
        (lambda: a.choose({"idle": 1.0}), "no value for heat"),
        (lambda: a.choose([1.0, 2.0], otherwise=3.0), "dictionary"),
    ]:
        with pytest.raises(swb.ArgumentError, match=word):
            call()
        assert len(m._transitions) == n, word
    m.derivative(v, 1.0)
    run = swb.simulate(m, [0.0], 2.0)
    for state, word in [("speed", "no state"), (9, "no state 9"), (other.state, "no state"), (1.5, "no state")]:
        with pytest.raises(swb.ArgumentError, match=word):
            run.discrete(state)
    with pytest.raises(swb.ArgumentError, match="switch"):
        a.edge("idle", "heat", when=sign(v) > 0.5)
        m.system()


def test_a_log_that_is_full_is_no_sequence():
    m = Model(states="x")
    w = m.hysteresis(m.x[0], on=0.5, off=-0.5, name="w")
    m.derivative(m.x[0], 1 - 2 * w)
    run = swb.simulate(m, [0.0], 50.0, max_switches=10)
    assert run.stats.jumps > len(run.jumps)
    with pytest.raises(swb.StateError, match="max_switches"):
        run.discrete("w")
