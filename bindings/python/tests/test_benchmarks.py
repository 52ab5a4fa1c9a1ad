"""The benchmark of programs with complementarity pairs: its statistics, its processes, a run where the problems are."""

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import switchback_control as swb

FOLDER = Path(__file__).resolve().parents[1] / "benchmarks"
COLLECTION = Path(__file__).resolve().parent / "collection"
sys.path.insert(0, str(FOLDER))

import mpcc_compare  # noqa: E402
import mpcc_judge  # noqa: E402
import mpcc_profile  # noqa: E402
import mpcc_train  # noqa: E402
import optima  # noqa: E402
import optima_problems  # noqa: E402
import units  # noqa: E402


def result(objective, iterations=10, cpu=1.0, solved=True, **more):
    return {
        "solved": solved, "claimed": solved, "objective": objective, "violation": 0.0, "product": 0.0, "pair_min": 0.0,
        "iterations": iterations, "cpu": cpu, "outcome": "solved" if solved else "stalled", "x": [0.0],
    } | more  # fmt: skip


def test_figures_of_two_solvers():
    known = {"f": 2.0, "local": [3.0], "expect": "optimal"}
    problems = {
        "a:same": {"known": known},
        "a:relaxed": {},
        "b:worse": {"known": known},
        "b:lost": {},
        "b:infeasible": {"known": {"expect": "infeasible"}},
    }
    ours = {
        "a:same": result(2.0, 5, 0.5, polished="done"),
        "a:relaxed": result(0.0, 20, 0.25),
        "b:worse": result(3.0, 10, 1.0, pair_min=1e-3),
        "b:lost": result(0.0, solved=False, claimed=True),
        "b:infeasible": result(7.0, 10, 2.0),
    }
    peer = {name: result(2.0) for name in problems} | {"a:relaxed": result(-1e-3, branch=0.0)}
    record = mpcc_compare.compare(problems, ours, peer)
    s = record["summary"]
    assert (s["solved"], s["peer_solved"], s["only_peer"]) == (4, 5, ["b:lost"])
    assert s["claimed_but_not_solved"] == ["b:lost"]
    assert s["worse"] == ["b:worse"]
    assert s["no_worse"] == pytest.approx(2 / 3)
    assert s["no_worse_than_relaxed"] == pytest.approx(1 / 3)
    assert s["cpu_ratio"] == pytest.approx((2 * 4 * 1 * 0.5) ** 0.25)
    assert s["iteration_ratio"] == pytest.approx((2 * 0.5) ** 0.25)
    assert (s["exact"], s["identified"]) == (pytest.approx(2 / 3), pytest.approx(1 / 3))
    assert s["known"]["global"] == ["a:same"] and s["known"]["local"] == ["b:worse"]
    assert s["known"]["right"] == ["b:infeasible"]
    assert {f: v["problems"] for f, v in record["families"].items()} == {"a": 2, "b": 3}
    assert all("x" not in r["ours"] for r in record["problems"])
    assert "b:lost" in mpcc_compare.table(record)


def test_numbers_that_json_does_not_have():
    assert mpcc_compare.finite({"a": [float("nan"), 1.0], "b": float("inf")}) == {"a": [None, 1.0], "b": None}


def test_what_ipopt_solved_is_not_infeasible():
    cache = {"linf/adaptive/a:one": {"solved": True}, "adaptive/a:two": {"solved": False}, "adaptive/b:a:two": {"solved": True}}
    of = {n: mpcc_judge.with_peers({"file": "f", "known": {}}, n, cache) for n in ("a:one", "a:two", "three")}
    assert {n: mpcc_judge.known_feasible(entry) for n, entry in of.items()} == {"a:one": True, "a:two": False, "three": False}


def test_profile_counts_steps():
    steps = mpcc_profile.profile({"one": [1.0, 4.0, None, None], "two": [2.0, 1.0, 3.0, None]})
    assert steps["one"] == [(1.0, pytest.approx(1 / 3)), (4.0, pytest.approx(2 / 3))]
    assert steps["two"][-1] == (2.0, pytest.approx(1.0))


class Trouble:
    """A bench whose solvers do what their name says."""

    def run(self, solver, entry, options):
        if solver == "crash":
            os.kill(os.getpid(), signal.SIGTERM)
        if solver == "sleep":
            time.sleep(60)
        while solver == "hang":
            pass
        if solver == "raise":
            raise ValueError("no")
        return result(1.0)


def test_crash_and_hang_are_results(monkeypatch):
    monkeypatch.setattr(mpcc_train, "GRACE", 1.0)
    monkeypatch.setattr(mpcc_train, "PATIENCE", 3)
    tasks = [(kind, kind, {}, {}) for kind in ("sleep", "crash", "hang", "raise", "work")]
    sleep, crash, hang, raised, work = mpcc_train.run_all(Trouble(), tasks, jobs=2, limit=0.0)
    assert (crash["outcome"], crash["message"], crash["solved"]) == ("crash", f"exit code {-signal.SIGTERM}", False)
    assert (sleep["outcome"], hang["outcome"], hang["cpu"]) == ("hang", "hang", None)
    assert (raised["outcome"], raised["message"]) == ("exception", "ValueError: no")
    assert work["solved"]


def train(*arguments, **environment):
    return subprocess.run(
        [sys.executable, FOLDER / "mpcc_train.py", *arguments], capture_output=True, text=True, check=True,
        env={k: v for k, v in os.environ.items() if k != "SWITCHBACK_MPCC_PROBLEMS"} | environment,
    )  # fmt: skip


def test_without_problems_it_says_so(tmp_path):
    for run in (train(), train("--problems", str(tmp_path)), train(SWITCHBACK_MPCC_PROBLEMS=str(tmp_path))):
        assert run.stdout.startswith("left out: ") and "SWITCHBACK_MPCC_PROBLEMS" in run.stdout
        assert len(run.stdout.splitlines()) == 1


def changed_units(*options):
    command = [sys.executable, FOLDER / "mpcc_units.py", "--problems", COLLECTION, "--changes", "1", *options]
    return subprocess.run(command, capture_output=True, text=True, timeout=300)


@pytest.mark.parametrize("what", ["rows", "variables"])
def test_a_collection_in_other_units(what):
    """Small numbers, so that the local optimum stays the one it is."""
    run = changed_units("--only-what", what, "--exponent", "1")
    assert "3 of 3 the same (100.0%)" in run.stdout, run.stdout + run.stderr


def test_no_problem_in_other_units():
    run = changed_units("--only", "no such name")
    assert run.returncode == 1 and run.stdout.startswith("nothing to compare: 0 problems")


@pytest.mark.parametrize("members", ["auto", "rows"])
def test_a_collection_through_its_callbacks(members):
    options = ["--no-ipopt", "--repeat", "1", "--members", members, "--json", "-"]
    run = train(*options, SWITCHBACK_MPCC_PROBLEMS=str(COLLECTION))
    record = json.loads(run.stdout)
    assert len(record["problems"]) == 3
    for r in record["problems"]:
        assert r["ours"]["solved"] and r["known"] in ("global", "right"), r


def test_models_of_casadi_for_the_report(tmp_path):
    import model_eval

    model_eval.write(tmp_path)
    c2 = swb.casadi.load(tmp_path / "models.so", "sliding_mode_4", 4, 2)
    at = {"x": [0.4, 0.7, 0.0, 0.0], "u": [0.0, 0.0]}
    assert c2(**at) == pytest.approx(0.7 - 0.05 * 0.4**3, abs=1e-15)
    assert c2.hessian(**at)[0, 0] == pytest.approx(-0.3 * 0.4, abs=1e-15)
    files = {path.name for path in tmp_path.glob("*.casadi")}
    assert files == {f"{model}_{k}.casadi" for model, parts in model_eval.models().items() for k in range(len(parts))}
    records = [{"model": "m", "way": "tape", "value_ns": 1.0, "jacobian_ns": 2.0, "hessian_ns": 3.0, "solve_ratio": 1.0}]
    records += [{"model": "m", "evaluation_share": 0.125}]
    assert "1         2        3      6   1.000" in model_eval.table(records) and "m 12.5 %" in model_eval.table(records)


def test_documents_of_the_optimal_control_problems_are_those_that_are_stored():
    assert optima_problems.differences() == []


def test_costs_beside_the_documents_are_those_on_record():
    stored = [line.split("\t") for line in optima.COSTS.read_text().splitlines()]
    wanted = optima.costs()
    assert [row[:1] + row[2:] for row in stored] == [row[:1] + row[2:] for row in wanted]
    numbers = [[float(row[1] or "nan") for row in rows[1:]] for rows in (stored, wanted)]
    assert numbers[0] == pytest.approx(numbers[1], rel=1e-12, nan_ok=True)


def test_gaps_of_optima():
    assert optima.gap(2.0, None) != optima.gap(2.0, None)
    assert optima.gap(1e-9, 0.0) == 0.0
    assert optima.gap(-0.9, -1.0) == pytest.approx(0.1)
    assert optima.gap(3.3, 3.0) == pytest.approx(0.1)


def test_a_problem_with_a_known_answer():
    r = optima.solve("friction_move_02")
    assert r["solved"] and optima.gap(r["cost"], optima.reference("friction_move_02", {})) < 1e-9
    assert optima.summary([r], {}).startswith("1 problems: 1 solved, 1 polished, 1 of 1 within")


@pytest.mark.parametrize("name", ["switched_lq", "gearbox_fuel", "landing"])
def test_units_do_not_matter(name):
    """The same problem in random units has the same optimum, by a similar way: sizes are rounded to powers of two."""
    document = json.loads((units.DOCUMENTS / f"{name}.json").read_text())
    own = units.solve(document)
    numbers = random.Random(name)
    for _ in range(3):
        change = units.Units(document["ocp"], numbers, 6.0)
        one = units.solve(units.in_units(document, change))
        assert (one["outcome"], one["certificate"]) == ("solved", own["certificate"])
        assert one["cost"] / change.cost == pytest.approx(own["cost"], rel=1e-6)
        assert 0.5 <= one["iterations"] / own["iterations"] <= 2.0


def test_collections_of_programs(tmp_path):
    pytest.importorskip("casadi")
    files = FOLDER.parents[2] / "crates" / "switchback-mpcc-ampl" / "tests" / "data"
    (tmp_path / "integer.nl").write_text("b3 1 1 0\n")
    command = [sys.executable, FOLDER / "mpcc_collections.py", "textbook", "boxes", "bilevel", "bent", "quadratic", files, tmp_path]
    command += ["--count", "1", "--seed", "3", "--solvers", "switchback,scholtes", "--json", tmp_path / "out.json"]
    told = subprocess.run([*command, "--profile", tmp_path / "profile.svg"], capture_output=True, text=True, check=True).stdout
    assert "integer" in told and "not read: a binary file" in told
    results = json.loads((tmp_path / "out.json").read_text())["results"]
    assert (tmp_path / "profile.svg").read_text().startswith("<svg")
    found = {r["name"]: r for r in results["switchback"]}
    assert len(results["switchback"]) == 17 and all(r["solved"] for r in results["switchback"])
    for name, f in {"bard1": 17.0, "gauvin-savard": 20.0, "jr1": 0.5, "kth3": 0.5, "scale": 1.0}.items():
        assert abs(found[name]["objective"] - f) < 1e-6
    # both solvers see the same functions
    both = [(r["objective"], p["objective"]) for r, p in zip(*results.values()) if p["solved"]]
    assert len(both) >= 12 and sum(abs(a - b) < 1e-3 * (1 + abs(a)) for a, b in both) >= 10
