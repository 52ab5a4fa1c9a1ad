"""Scenes and projected systems as documents and back: alone, in simulations, and in optimal control problems."""

import json
import random

import numpy as np
import pytest

import switchback_control as swb
from switchback_control import expr


def everything():
    """A cart with a lamp, friction, a rod, a contact with friction and restitution, a switch, a further state, a counter and a clock."""
    s = swb.Scene("x y", u="push", p="load", name="all of it", states="heat")
    (x, y), (vx, vy) = s.q, s.v
    lamp = s.discrete("lamp", 0)
    s.inertia([2.0 + 0.1 * swb.sin(x) ** 2, 1.0 + s.p[0]])
    s.force([s.push - x - 0.3 * vx - 0.2 * swb.sign(vx - 0.4) + 0.1 * lamp + s.hold(-0.2 * vx, 0.35, name="held"), -9.81 + 0.1 * s.heat])
    s.state_rates([0.5 * vx**2 - s.heat])
    s.contact("floor", gap=y, tangents=x, mu=0.3, e=0.4, mu_s=0.35)
    s.friction("slide", x, 0.05, stiction=0.08)
    s.transition(x > 0.6, when={lamp: 0}, to={lamp: 1}, reset={vx: 0.5 * vx}, name="light")
    s.bounds("x", -5.0, np.inf)
    s.impact_law("sequential")
    return s


def pair():
    """Two masses that a constraint keeps together, over a floor."""
    s = swb.Scene("a b", u=1, name="pair")
    s.force([s.u[0] - s.q[0], -0.3 * s.v[1]])
    s.constraint("gear", s.q[1] - 2.0 * s.q[0])
    s.contact("stop", gap=s.q[0] + 0.4, e=0.6)
    return s


def ball(n=1):
    s = swb.Scene(n, u=n, name="balls")
    s.force([s.u[k] - 9.81 for k in range(n)])
    for k in range(n):
        s.contact(f"floor {k}", gap=s.q[k], e=0.7)
    return s


def play():
    m = swb.Projected("y z", u="in", p="width", name="play")
    y, z = m.x
    m.f([0.0, m.u[0] - z + 0.2 * y])
    m.constraint("upper", z - y + m.p[0])
    m.constraint("lower", y - z + m.p[0])
    return m


CASES = {
    "everything": (everything, [0.0, 0.5, 0.6, 0.0, 0.1], {"u": [1.3], "p": [0.2]}),
    "pair": (pair, [0.3, 0.6, -0.5, -1.0], {"u": [-0.6]}),
    "ball": (ball, [1.0, 0.0], {"u": [0.1]}),
    "play": (play, [0.0, 0.0], {"u": [0.8], "p": [0.1]}),
}


def motion(system, x0, **data):
    run = swb.simulate(system, x0, 2.0, rtol=1e-9, atol=1e-11, **data)
    assert run.success, run.reason
    return run


@pytest.mark.parametrize("name", CASES)
def test_a_scene_and_back_moves_by_the_same_bits(name):
    make, x0, data = CASES[name]
    first = make()
    text = first.to_json()
    again = type(first).from_json(text)
    assert again.name == first.name and again.names == first.names
    a, b = motion(first, x0, **data), motion(again, x0, **data)
    assert np.array_equal(a.x_end, b.x_end) and np.array_equal(a.t, b.t)
    assert [i.t for i in a.impacts] == [i.t for i in b.impacts] and [j.t for j in a.jumps] == [j.t for j in b.jumps]
    assert len(a.impacts) + len(a.jumps) + len(a.switches) > 0
    for c, d in zip(first.contacts, again.contacts):
        assert (c.name, len(c.tangents)) == (d.name, len(d.tangents))
        assert np.array_equal(a.force(c), b.force(d))


def test_a_scene_that_was_read_is_a_scene():
    """It can be added to, by its own variables."""
    again = swb.Scene.from_json(everything().to_json())
    assert again.nx == everything().nx
    again.contact("wall", gap=2.0 - again.q[0])
    k = again.transition(again.v[0] < -1.0, reset={again.v[0]: -0.5 * again.v[0]}, name="more")
    assert k == len(again._transitions) - 1
    run = motion(again, CASES["everything"][1], **CASES["everything"][2])
    assert run.mode("wall") is not None
    assert {"floor", "slide", "wall"} <= {c["name"] for c in again.report_data()["contacts"]}


def test_functions_that_are_called_are_supplied():
    spring = swb.Function(lambda x: [-np.sin(x[0])], nx=1, name="spring", trace=False)
    s = swb.Scene("y", name="ball")
    s.force([expr.external(spring, x=s.q)[0] - 1.0])
    s.contact("floor", gap=s.q[0], e=0.5)
    text = s.to_json()
    with pytest.raises(swb.StateError, match="spring"):
        swb.Scene.from_json(text)
    again = swb.Scene.from_json(text, [spring])
    assert np.array_equal(motion(s, [1.0, 0.0]).x_end, motion(again, [1.0, 0.0]).x_end)


def steered(scene, jumps="auto", system=None):
    ocp = swb.Ocp(system or scene, 1.2, 4, n_fe=2, control_bounds=(-2, 2), params=[0.1] * scene.np, jumps=jumps)
    x, u = scene.x, scene.u[0]
    ocp.set_initial_state([0.8, -0.5] if scene.n_q else [0.25, 0.3])
    ocp.set_lagrange(scene.function(x[0] ** 2 + 0.5 * x[1] ** 2 + 0.2 * u**2))
    ocp.set_mayer(scene.function(2.0 * (x[0] - 0.2) ** 2))
    return ocp


def hopper():
    s = swb.Scene("q", u="push", name="hopper")
    s.force([s.push - s.q[0] - 0.4 * s.v[0]])
    s.contact("stop", gap=s.q[0] - 0.45, e=0.5)
    return s


@pytest.mark.parametrize("make, jumps", [(hopper, "auto"), (hopper, "modes"), (play, "auto")])
def test_an_optimal_control_problem_of_a_scene_and_back(make, jumps):
    ocp = steered(make(), jumps)
    text = ocp.to_json()
    again = swb.Ocp.from_json(text)
    assert again.to_json() == text
    r, s = ocp.solve(), again.solve()
    assert r.success and s.success and s.cost == r.cost and np.array_equal(r.controls, s.controls)
    assert s.accuracy.cost == r.accuracy.cost
    if r.contacts is not None:
        assert s.contacts.table() == r.contacts.table() and s.contacts.names == ["stop"]


def test_choices_and_transitions_of_systems_are_kept():
    m = play()
    system = m.system()
    system.add_choice(0, [-1.0, 1.0])
    ocp = swb.Ocp(system, 1.2, 4, n_fe=2, params=[0.1], initial_state=[0.25, 0.3])
    ocp.set_lagrange(m.function(m.x[0] ** 2 + (m.x[1] - 0.2) ** 2))
    again = swb.Ocp.from_json(ocp.to_json())
    r, s = ocp.solve(), again.solve()
    assert r.success and s.cost == r.cost and set(np.unique(s.controls)) <= {-1.0, 1.0}


def test_a_simulation_by_finite_elements_and_back():
    m = play()
    sim = swb.Simulator(m, n_fe=2, n_s=3)
    sim.set_params([0.1])
    sim.set_controls([0.8])
    sim.set_state([0.0, 0.0])
    text = sim.to_json(1.0, 10)
    again, duration, steps = swb.Simulator.from_json(text)
    assert again.to_json(1.0, 10) == text
    assert sim.run(1.0, 10) == again.run(duration, steps) == 0
    assert np.array_equal(sim.state, again.state)


def test_many_contacts_share_what_is_alike():
    """Bodies alike share functions, which are written once."""
    few, many = (len(steered_balls(n).to_json()) for n in (5, 20))
    assert many < 6 * few


def steered_balls(n):
    s = ball(n)
    ocp = swb.Ocp(s, 0.5, 2)
    ocp.set_initial_state([1.0] * n + [0.0] * n)
    ocp.set_mayer(s.function(s.q[0]))
    return ocp


def test_the_wrong_kind_of_document_is_refused():
    text, model = play().to_json(), swb.Model(states="x")
    model.derivatives = [-model.x[0]]
    with pytest.raises(swb.ArgumentError, match="Projected"):
        swb.Scene.from_json(text)
    with pytest.raises(swb.ArgumentError, match="Scene"):
        swb.Projected.from_json(ball().to_json())
    with pytest.raises(swb.RangeError, match="a scene"):
        swb.Model.from_json(text)
    with pytest.raises(swb.RangeError, match="a model"):
        swb.Scene.from_json(model.to_json())
    with pytest.raises(swb.RangeError):
        swb.Scene.from_json("{}")


def broken(rng, value):
    """A document with one thing changed."""
    if isinstance(value, dict) and value and rng.random() < 0.9:
        key = rng.choice(sorted(value))
        return {**value, key: broken(rng, value[key])} if rng.random() < 0.9 else {k: v for k, v in value.items() if k != key}
    if isinstance(value, list) and value and rng.random() < 0.9:
        k = rng.randrange(len(value))
        return [*value[:k], broken(rng, value[k]), *value[k + 1 :]] if rng.random() < 0.8 else value[:k] + value[k + 1 :]
    return rng.choice([0, 1, 2, -1, 7, 1e300, 2**40, "x", [], {}, None, True, [0], "contact", 0.5])


@pytest.mark.parametrize("seed", range(3))
def test_documents_with_something_changed_end_with_an_object_or_an_error(seed):
    rng = random.Random(seed)
    readers = [(swb.Scene.from_json, everything().to_json()), (swb.Projected.from_json, play().to_json())]
    readers += [(swb.Ocp.from_json, steered(make()).to_json()) for make in (hopper, play)]
    for read, text in readers:
        data, kept = json.loads(text), 0
        for _ in range(150):
            try:
                found = read(json.dumps(broken(rng, data)))
                if isinstance(found, swb.Scene | swb.Projected):
                    found.system()
                kept += 1
            except (swb.SwitchbackError, OverflowError, MemoryError):
                pass
        assert kept < 150
