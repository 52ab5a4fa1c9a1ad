"""Models and problems as documents."""

import copy
import json
import pickle

import numpy as np
import pytest
import switchback_control as swb
from switchback_control import expr
from switchback_control.expr import Model, cos, sign, where


def slider():
    m = Model(states="q v", controls="u", parameters="k", name="slider")
    (q, v), u, k = m.x, m.u[0], m.p[0]
    m.derivatives = [v, u - k * q - 0.3 * sign(v) + where((q > 1) & (v > 0), cos(q), 0.1)]
    m.try_at([0.5, 0.1], p=[2.0])
    return m


def test_models_return():
    m = slider()
    again = Model.from_json(m.to_json())
    assert again.to_json() == m.to_json()
    assert (again.name, again.names, again.nx, again.nu, again.np) == ("slider", [["q", "v"], ["u"], ["k"]], 2, 1, 1)
    assert again.report() == m.report() and again.counts() == m.counts()
    run = {"x0": [0.5, 1.0], "duration": 2.0, "n_steps": 8, "u": [0.1], "p": [2.0]}
    ends = [swb.simulate_fesd(s.system(), **run).state for s in (m, again)]
    assert (ends[0] == ends[1]).all()
    # what returns can be written on with
    again.derivative(again.x[0], again.derivatives[0] - sign(again.x[0]))
    assert again.counts().switching_functions == m.counts().switching_functions + 1


def test_pickles_and_copies():
    m = slider()
    for again in (pickle.loads(pickle.dumps(m)), copy.deepcopy(m)):
        assert again.to_json() == m.to_json() and again.graph is not m.graph
    f = swb.Function(lambda x: [x[0] ** 2], nx=1, name="square")
    m = Model(states=1)
    m.derivatives = [expr.external(f, x=m.x)[0]]
    with pytest.raises(TypeError, match="from_json"):
        pickle.dumps(m)
    assert Model.from_json(m.to_json(), [f]).to_json() == m.to_json()
    with pytest.raises(swb.StateError, match="'square'"):
        Model.from_json(m.to_json())
    with pytest.raises(swb.ArgumentError, match="Function"):
        Model.from_json(m.to_json(), [lambda x: x])


def test_problems_return():
    m = Model(states="x")
    x = m.x[0]
    m.derivatives = [2 - sign(x)]
    f = m.function(x**2, "L"), m.function((x - 5 / 3) ** 2, "M")
    problem = swb.Ocp(m.system(), 2.0, 1, lagrange=f[0], mayer=f[1], initial_bounds=(-2.0, -0.5), n_s=3)
    again = swb.Ocp.from_json(problem.to_json())
    assert again.to_json() == problem.to_json()
    results = [o.solve() for o in (problem, again)]
    assert results[0].outcome is swb.Outcome.SOLVED
    assert results[0].cost == results[1].cost
    assert again.horizon == 2.0 and again.n_stages == 1 and again.nx == 1


def test_simulations_return_from_where_they_stand():
    simulator = swb.Simulator(slider().system(), n_s=3)
    simulator.set_params([2.0])
    simulator.set_state([0.5, 1.0], t=0.25)
    simulator.run(0.5, 2)
    document = simulator.to_json(1.5, 6)
    again, duration, n_steps = swb.Simulator.from_json(document)
    assert (duration, n_steps, again.time) == (1.5, 6, 0.75)
    assert again.to_json(1.5, 6) == document
    for s in (simulator, again):
        assert s.run(duration, n_steps) is swb.Outcome.SOLVED
    assert (again.state == simulator.state).all()


def test_callbacks_are_supplied():
    system = swb.System(nx=1)
    psi = swb.Function(lambda x: [x[0]], 1, name="psi", trace=False)
    modes = swb.Function(lambda x: [[1.0], [3.0]], 1, n_out=(2, 1), name="modes", trace=False)
    system.add_subsystem(modes=modes, psi=psi, signs=[1, -1])
    document = swb.Ocp(system, 2.0, 1, initial_state=[-1.0]).to_json()
    with pytest.raises(swb.StateError, match="supply it"):
        swb.Ocp.from_json(document)
    assert swb.Ocp.from_json(document, [psi, modes]).to_json() == document


@pytest.mark.parametrize(
    "change, error, message",
    [
        (lambda d: d.update(version=7), swb.UnsupportedError, "version 7"),
        (lambda d: d.update(format="x"), swb.RangeError, "format"),
        (lambda d: d.pop("model"), swb.RangeError, "one of"),
        (lambda d: d["model"].pop("derivatives"), swb.RangeError, "derivatives"),
        (lambda d: d["model"]["derivatives"]["nodes"].insert(0, ["sin", 3]), swb.RangeError, "node 0"),
        (lambda d: d["model"].update(extra=1), swb.RangeError, "extra"),
    ],
)
def test_refusals(change, error, message):
    data = json.loads(slider().to_json())
    change(data)
    with pytest.raises(error, match=message):
        Model.from_json(json.dumps(data))


def test_other_texts_are_refused():
    for text in ("", "[]", "[" * 100_000, "null", '{"model": 3}', "NaN"):
        with pytest.raises(swb.RangeError):
            Model.from_json(text)
    with pytest.raises(swb.ArgumentError):
        Model.from_json(7)
    with pytest.raises(swb.RangeError, match="read it with Model.from_json"):
        swb.Ocp.from_json(slider().to_json())


def test_nothing_leaks(live):
    before = live()
    m = Model.from_json(slider().to_json())
    s, _, _ = swb.Simulator.from_json(swb.Simulator(m.system()).to_json(1.0, 2))
    del m, s
    assert live() == before
