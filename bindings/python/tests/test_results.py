"""Results: columns by name, copies, pickles, files, tables, plots with the names of the model, logs."""

import copy
import json
import logging
import pickle

import matplotlib.pyplot
import numpy as np
import pytest

import switchback_control as swb
from switchback_control.expr import Model, sign, where

TIMES = np.linspace(0.0, 6.0, 301)


def oscillator():
    """A spring, friction that holds, a push where q > 0.5, and a switch that is never reached."""
    m = Model(states="q v", controls="F", parameters="k", name="spring")
    m.derivatives = [m.v, -m.k * m.q - 0.4 * sign(m.v) + where(m.q > 0.5, m.F, 0) + where(m.q > 5, 1, 0)]
    return m


def simulated(**keywords):
    return swb.simulate(oscillator(), {"q": 1, "v": 0}, 6.0, u={"F": 0.1}, p={"k": 1}, **keywords)


@pytest.fixture(scope="module")
def optimal():
    m = oscillator()
    ocp = swb.Ocp(
        m,
        1.0,
        4,
        initial_state={"q": 1, "v": 0},
        params={"k": 1},
        control_bounds=({"F": -1}, {"F": 1}),
        lagrange=lambda x, u: x @ x + u @ u,
    )
    return ocp.solve()


# --- names --------------------------------------------------------------------------------------------


def test_numbers_by_name():
    m = oscillator()
    assert m.q == m["q"] == m.x[0] and m.F == m.u[0] and m.k == m.p[0]
    run = simulated()
    assert np.array_equal(run.x_end, swb.simulate(m, [1, 0], 6.0, u=[0.1], p=[1]).x_end)
    batch = swb.simulate_batch(m, {"q": [1.0, 2.0], "v": 0}, 6.0, u={"F": 0.1}, p={"k": 1})
    assert np.array_equal(batch.x[0], run.x_end)
    system = swb.System("q v", 0, "k", f0=lambda x, p: [x[1], -p[0] * x[0]])
    assert swb.simulate(system, {"v": 1, "q": 0}, 1.0, p={"k": 1}).x_end == pytest.approx([np.sin(1), np.cos(1)])
    fesd = swb.simulate_fesd(m, {"q": 1, "v": 0}, 1.0, 4, u={"F": 0.1}, p={"k": 1})
    assert fesd.state == pytest.approx(run(1.0), abs=1e-4)
    scene = swb.Scene("y", p="g")
    assert scene.y == scene.q[0] and scene.v_y == scene.v[0] and scene.g == scene.p[0]


def test_discrete_states_may_be_left_out():
    m = Model(states="T")
    on = m.hysteresis(-m.T, -18.0, -20.0, initial=1, name="heater")
    m.derivatives = [on * 4.0 - 0.1 * m.T]
    run = swb.simulate(m, {"T": 15.0}, 10.0)
    assert np.array_equal(run.x_end, swb.simulate(m, [15.0, 1.0], 10.0).x_end)
    assert m.heater == on and run["heater"][0] == 1.0
    # no mode switches, and the transitions are what there is to see
    assert run.switches == [] and f"0 switches, {len(run.jumps)} transitions>" in repr(run)
    rows = run.table().splitlines()[1:]
    assert [float(row.split()[0]) for row in rows] == pytest.approx([j.t for j in run.jumps], rel=1e-14)
    assert [row.split("  ")[-1] for row in rows[:2]] == ["heater: 1 -> 0", "heater: 0 -> 1"]
    assert pickle.loads(pickle.dumps(run)).table() == run.table()


# --- columns, copies, files ---------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["dp5", "dop853", "radau5"])
def test_copies_of_runs_are_the_same_solution(method):
    run = simulated(method=method)
    for other in (pickle.loads(pickle.dumps(run)), copy.copy(run), copy.deepcopy(run)):
        assert isinstance(other, swb.Run) and not other.closed
        assert np.abs(other(TIMES) - run(TIMES)).max() < 1e-13 * np.abs(run.x).max()
        # by Markov's inequality 2 n^2 / h times a rounding error of a few units, for degree n = 9 and the shortest step h
        assert np.abs(other(TIMES, 1) - run(TIMES, 1)).max() < 2 * 81 * 2e-15 / np.diff(run.t).min()
        assert other.table() == run.table() and other.stats == run.stats and other.mode_names == run.mode_names
        assert pickle.loads(pickle.dumps(other)).switches == run.switches
    with pytest.raises(swb.RangeError):
        other(7.0)


def test_copies_of_scenes_keep_contacts():
    scene = swb.Scene("y", name="ball")
    scene.force([-9.81])
    floor = scene.contact("floor", gap=scene.y, e=0.8)
    run = scene.simulate([1.0], [0.0], 5.0)
    other = pickle.loads(pickle.dumps(run))
    t = np.linspace(0.0, 5.0, 200)
    assert np.abs(other(t) - run(t)).max() < 1e-12
    assert np.array_equal(other.mode(floor, t), run.mode("floor", t))
    assert np.allclose(other.force("floor", t), run.force(floor, t), atol=1e-10)
    assert other.impacts == run.impacts and other.accumulations == run.accumulations
    rows = other.table().splitlines()[1:]
    times = [float(row.split()[0]) for row in rows]
    assert len(rows) == len(run.impacts) + len(run.switches) and times == sorted(times)
    assert "impact              0  floor: rate -4.42945 -> 3.54356" in rows[0] and f"{len(run.impacts)} impacts>" in repr(run)


@pytest.mark.parametrize("end", ["npz", "json"])
def test_files(tmp_path, end, optimal):
    run, path = simulated(), tmp_path / f"result.{end}"
    run.save(path)
    other = swb.load(path)
    assert np.array_equal(other(TIMES), copy.copy(run)(TIMES)) and other.switches == run.switches and other.success
    optimal.save(path)
    other = swb.load(path)
    assert repr(other) == repr(optimal) and np.array_equal(other["F"], optimal["F"])
    assert np.allclose(other.trajectory(0.3), optimal.trajectory(0.3), rtol=1e-13)
    assert other.stats == optimal.stats and other.outcome is swb.Outcome.SOLVED
    assert other.optimality.verdict == optimal.optimality.verdict
    with pytest.raises(swb.ArgumentError, match="npz or .json"):
        run.save(tmp_path / "result.txt")


def test_files_that_are_none(tmp_path):
    for name, content in (("a.json", b"{}"), ("b.json", b"["), ("c.npz", b"PK"), ("d.json", b'{"format":"x","version":1,"arrays":[]}')):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(swb.SwitchbackError, match="holds no result|not of"):
            swb.load(tmp_path / name)
    document = {"format": "switchback result", "version": 1, "arrays": [], "result": {"$object": "Popen", "state": {}}}
    (tmp_path / "e.json").write_text(json.dumps(document))
    with pytest.raises(swb.ArgumentError, match="Popen"):
        swb.load(tmp_path / "e.json")


def test_columns_and_tables(optimal):
    run = simulated()
    data = run.to_dict()
    assert np.array_equal(data["q"], run.x[:, 0]) and np.all(data["F"] == 0.1) and data["outcome"] == "reached"
    assert optimal["F"].shape == optimal["q"].shape == optimal.trajectory.times.shape
    assert optimal["F"][0] == optimal.controls[0, 0] and optimal["F"][-1] == optimal.controls[-1, 0]
    with pytest.raises(KeyError, match="did you mean 'q'"):
        run["qq"]
    assert "q" in run and "qq" not in run and "q" in oscillator()
    with pytest.raises(TypeError):
        iter(run)
    assert "q > 0.5 -> q < 0.5" in run.table() and "sliding (v > 0, v < 0)" in run.table()
    assert "<table>" in run._repr_html_() and "reached" in run._repr_html_()
    for result in (run, optimal, optimal.trajectory, simulated(dense=False), swb.Nlp(1, lambda x: x @ x).solve()):
        assert len(repr(result)) < 120 and "\n" not in repr(result)
    try:
        import pandas
    except ImportError:
        with pytest.raises(ImportError, match="pip install pandas"):
            run.to_pandas()
    else:
        frame = run.to_pandas()
        assert isinstance(frame, pandas.DataFrame) and list(frame.columns) == ["q", "v", "F"] and frame.index.name == "t"


def test_plots_have_the_names_of_the_model(optimal):
    figure = simulated().plot()
    texts = [t.get_text() for ax in figure.axes for t in (ax.get_legend().get_texts() if ax.get_legend() else [])]
    assert texts == ["q", "v"]
    modes = [t.get_text() for t in figure.axes[-1].get_yticklabels()]
    assert modes == ["v > 0", "v < 0", "q > 0.5", "q < 0.5", "q > 5", "q < 5"]
    assert any(p.get_facecolor()[:3] == (0.5, 0.5, 0.5) for p in figure.axes[0].patches)  # sliding
    assert [t.get_text() for t in optimal.plot().axes[0].get_legend().get_texts()] == ["q", "v"]
    m = oscillator()
    run = swb.simulate(m, [1, 0], 6.0, u=[[0.0], [1.0], [2.0]], p=[1])
    assert run.plot().axes[1].get_ylabel() == "control F" and run["F"][-1] == 2.0
    copy.copy(run).plot()
    matplotlib.pyplot.close("all")


def test_modes_of_subsystems_that_never_switch():
    run = simulated()
    assert run.active(2) == [(0.0, 6.0, (1,))]


# --- logs ---------------------------------------------------------------------------------------------


def test_verbose_prints(capsys):
    simulated(verbose=True)
    assert "outcome = reached" in capsys.readouterr().out
    swb.Nlp(1, lambda x: x @ x, verbose=True).solve()
    assert "objective" in capsys.readouterr().out
    simulated()
    assert capsys.readouterr().out == ""
    with pytest.raises(swb.ArgumentError, match="verbose"):
        simulated(verbose="loud")


def test_logs_go_to_logging(caplog):
    with caplog.at_level(logging.DEBUG, logger="switchback"):
        simulated()
    assert any("kind = cross" in r.message for r in caplog.records) and caplog.records[-1].levelno == logging.INFO
    caplog.clear()
    simulated(log_level="info")
    simulated()
    assert len(caplog.records) <= 1
