"""Sweeps: the same results on every executor, after a worker died, and after the sweep was cut off."""

import concurrent.futures
import os
import signal
import threading
from functools import partial

import numpy as np
import pytest

import switchback_control as swb
from models import tutorial
from switchback_control.expr import Model, sign

GRID = {"k": np.linspace(1.0, 2.0, 12), "mu": [0.1, 0.3]}


def job():
    m = Model(states="q v", parameters="k mu")
    m.derivatives = [m.v, -m.k * m.q - m.mu * sign(m.v)]
    return swb.Simulation(m, {"q": 1, "v": 0.1}, 3.0, p={"k": 1, "mu": 0.2})


@pytest.fixture(scope="module")
def serial():
    return swb.sweep(job(), GRID)


def same(a, b):
    assert a.points == b.points and a.results == b.results


def test_points_and_columns(serial):
    assert len(serial) == 24 and not serial.errors
    assert serial.columns == ["k", "mu", "q_end", "v_end", "t_end", "switches", "success"]
    one = swb.simulate(job().model, [1, 0.1], 3.0, p=[2.0, 0.3], dense=False)
    assert serial["q_end"][-1] == one.x_end[0] and serial["k"][-1] == 2.0 and serial["success"].all()
    same(swb.sweep(job(), serial.points), serial)
    with pytest.raises(KeyError, match="did you mean 'q_end'"):
        serial["q_ent"]


def test_other_executors(serial):
    with concurrent.futures.ThreadPoolExecutor(2) as threads:
        same(swb.sweep(job(), GRID, executor=threads, chunk=5), serial)


def dies(once, at, k, mu):
    """Kills its process at a point: the first time, where `once` names a file, or every time."""
    if at - 1e-9 < k < at + 1e-9 and mu == 0.1 and not (once and os.path.exists(once)):
        if once:
            open(once, "w").close()
        os.kill(os.getpid(), signal.SIGKILL)
    return {"sum": k + mu, "pid": 0}


def test_workers_that_die(tmp_path):
    """Of two processes one is killed once at one point; at another point every process is."""
    at = float(GRID["k"][5])
    found = swb.sweep(partial(dies, str(tmp_path / "died"), at), GRID, executor=2, store=tmp_path / "a.sqlite", chunk=3)
    same(found, swb.sweep(partial(dies, str(tmp_path / "died"), at), GRID))
    short = {"k": GRID["k"][4:7], "mu": [0.1]}
    found = swb.sweep(partial(dies, "", at), short, executor=1, retries=1)
    assert [p["k"] for p, _ in found.errors] == [at] and "the worker died" in found.errors[0][1]
    assert np.isfinite(found["sum"]).tolist() == [True, False, True]


def test_a_cluster_that_loses_a_worker(tmp_path):
    """Of two workers of Dask one is killed half way: the sweep is complete, and equal to the serial one."""
    distributed = pytest.importorskip("distributed")
    grid = {"k": np.linspace(1.0, 2.0, 40), "mu": [0.1, 0.3]}
    killed = []
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster, distributed.Client(cluster) as client:
        pids = list(client.run(os.getpid).values())

        def progress(done, total):
            if 2 * done >= total and not killed:
                killed.append(pids[0])
                os.kill(pids[0], signal.SIGKILL)

        found = swb.sweep(job(), grid, executor=client, chunk=2, progress=progress, store=tmp_path / "dask.sqlite")
    assert killed and not found.errors
    same(found, swb.sweep(job(), grid))
    same(found, swb.sweep(job(), grid, store=tmp_path / "dask.sqlite", progress=lambda *_: pytest.fail("nothing is missing")))


def test_a_sweep_that_was_cut_off_goes_on(tmp_path, serial):
    class Cut(Exception):
        pass

    def cut(done, total):
        if done >= 10:
            raise Cut

    with pytest.raises(Cut):
        swb.sweep(job(), GRID, store=tmp_path / "s.sqlite", chunk=2, progress=cut)
    steps = []
    same(swb.sweep(job(), GRID, store=tmp_path / "s.sqlite", progress=lambda done, total: steps.append(done)), serial)
    assert steps[0] > 10 and steps[-1] == 24  # only what was missing
    same(swb.sweep(job(), GRID, store=tmp_path / "s.sqlite", progress=lambda *_: pytest.fail("nothing is missing")), serial)
    with pytest.raises(swb.ArgumentError, match="results of another problem"):
        swb.sweep(partial(dies, "", 9.0), GRID, store=tmp_path / "s.sqlite")
    (tmp_path / "no.sqlite").write_text("this is no store of a sweep, it is a text" * 20)
    with pytest.raises(swb.ArgumentError, match="no store of a sweep"):
        swb.sweep(job(), GRID, store=tmp_path / "no.sqlite")


def test_optimal_control_problems():
    m = Model(states="q", controls="F", parameters="k")
    m.derivatives = [m.F - m.k * sign(m.q)]
    ocp = swb.Ocp(m, 1.0, 4, initial_state=[1.0], params=[0.5], lagrange=lambda x, u: x @ x + u @ u)
    found = swb.sweep(ocp, {"q": [0.5, 1.0], "k": [0.5, 1.0]})
    assert found["success"].all() and found["cost"][2] == ocp.solve().cost
    ends = swb.sweep(ocp, {"k": [0.5]}, outputs=lambda r: {"end": r.trajectory.states[-1, 0]})
    assert ends["end"][0] == ocp.result.trajectory.states[-1, 0]
    with swb.tracing(False):
        untraced = tutorial()
    with pytest.raises(swb.ArgumentError, match="cannot travel"):
        swb.sweep(untraced, {"x0": [1.0]})


def test_errors_are_results_and_mistakes_are_refused():
    def f(a):
        if a == 2:
            raise ValueError("two")
        return a**2

    found = swb.sweep(f, {"a": [1, 2, 3]})
    assert found.errors == [({"a": 2}, "ValueError: two")] and found["value"].tolist() == [1, None, 9]
    with pytest.raises(swb.ArgumentError, match="cannot travel"):
        swb.sweep(f, {"a": [1]}, executor=1)
    with pytest.raises(swb.ArgumentError, match="the model has no 'kk': did you mean 'k'"):
        swb.sweep(job(), {"kk": [1.0]})
    with pytest.raises(swb.ArgumentError, match="executor must be"):
        swb.sweep(job(), GRID, executor="dask")
    with pytest.raises(swb.ArgumentError, match="grid must be"):
        swb.sweep(job(), 3)
    for wrong in (None, swb.System(1)):
        with pytest.raises(swb.ArgumentError, match="takes a"):
            swb.sweep(wrong, GRID)
    assert threading.active_count() < 50


def test_progress_in_lines(capsys, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "tqdm.auto", None)
    swb.sweep(lambda a: a, {"a": range(40)}, progress=True, chunk=1)
    lines = capsys.readouterr().err.splitlines()
    assert lines[-1] == "40 of 40 points" and 10 <= len(lines) <= 12
