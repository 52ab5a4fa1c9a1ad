"""Paired comparisons on drawn problems: the generators, the statistics, a run of the program."""

import json
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

FOLDER = Path(__file__).resolve().parents[1] / "benchmarks"
sys.path.insert(0, str(FOLDER))

import families  # noqa: E402
import paired  # noqa: E402

NUMBERS = range(4)


def drawn(family, number):
    return families.instance(family, families.generator(family, 11, number))


def test_the_program_knows_all_families():
    assert paired.FAMILIES == list(families.FAMILIES) and set(paired.SCENES) < set(paired.FAMILIES)


@pytest.mark.parametrize("family", families.FAMILIES)
def test_problems_can_be_stated_and_have_a_solution(family):
    texts = set()
    for number in NUMBERS:
        problem = drawn(family, number)
        text = json.dumps(problem.data)
        assert text == json.dumps(drawn(family, number).data)
        # what goes through JSON is the same problem
        again = families.Problem(family, json.loads(text))
        ocp = again.make()
        guess = again.guess
        ocp.set_control_guess(guess)
        assert guess.shape == (ocp.n_stages, ocp.nu)
        low, high = again.state().control_bounds(again.data)
        assert np.all(guess >= low) and np.all(guess <= high)
        run = again.simulate()
        assert run.success and again.violation(run) < 1e-8
        assert math.isfinite(again.guess_cost) and again.guess_cost != 0
        texts.add(text)
    assert len(texts) == len(NUMBERS)


@pytest.mark.parametrize("number", NUMBERS)
def test_enumeration_agrees_with_the_simulation_of_the_guess(number):
    problem = drawn("onoff", number)
    of_guess = families.onoff.costs(problem.data, np.array(problem.data["guess"])[None])[0]
    assert of_guess == pytest.approx(problem.guess_cost, rel=1e-4)
    assert problem.optimum <= of_guess * (1 + 1e-12)


def test_the_cost_of_the_guess_is_what_a_solve_says_that_has_no_choice():
    data = json.loads(json.dumps(drawn("tanks", 0).data))
    data |= {"guess": [[1.0]] * data["stages"], "bounds": [[1.0 - 1e-9], [1.0 + 1e-9]], "room": 1.0}
    problem = families.Problem("tanks", data)
    assert families.complete(problem)
    assert problem.make().solve().cost == pytest.approx(problem.guess_cost, rel=1e-3)


def test_signs():
    assert paired.sign_test(0, 0) == 1.0
    assert paired.sign_test(5, 5) == 1.0
    assert paired.sign_test(0, 5) == paired.sign_test(5, 0) == 0.0625
    assert paired.sign_test(2, 8) == pytest.approx(0.109375, abs=1e-15)
    assert paired.sign_test(9, 1) == pytest.approx(22 / 1024, abs=1e-15)
    assert paired.sign_test(60, 40) == pytest.approx(0.056887933640980784, rel=1e-12)


def test_intervals_cover_the_mean():
    numbers = np.random.default_rng(3)
    runs, covered = 300, 0
    for _ in range(runs):
        mean, low, high = paired.geometric(np.exp(numbers.normal(0.3, 1.0, 50)), samples=400)
        assert low <= mean <= high
        covered += low <= math.exp(0.3) <= high
    # 95 % minus three deviations of such a count, and a little for samples of 50
    assert 0.90 <= covered / runs <= 0.99
    assert paired.geometric([0.5, 2.0])[0] == pytest.approx(1.0)
    assert math.isnan(paired.geometric([])[0])


def test_costs_that_differ():
    assert paired.lower(1.0, 1.02, 1.0) and not paired.lower(1.02, 1.0, 1.0)
    assert not paired.lower(1.0, 1.005, 1.0)
    assert paired.lower(1.0, None, 1.0) and not paired.lower(None, 1.0, 1.0) and not paired.lower(None, None, 1.0)
    assert not paired.lower(0.0, 1e-7, 1.0) and paired.lower(-1.0, -0.9, 1.0)


def arm(cost, **more):
    return {"solved": cost is not None, "answer": True, "cost": cost, "cpu": 1.0, "work": 10, "iterations": 5, "verdict": "kink", "outcome": "solved"} | more


def test_a_comparison():
    def record(family, base, new, guess=9.0):
        return {"family": family, "seed": 1, "number": 0, "guess_cost": guess, "arms": {"base": base, "new": new}}

    records = [
        record("a", arm(2.0), arm(1.0, work=20, cpu=4.0)),
        record("a", arm(2.0), arm(2.01, work=5)),
        record("b", arm(1.0), arm(None, verdict="unknown")),
        record("b", arm(10.0), arm(8.0)),
    ]
    c = paired.compare(records)
    assert (c["solved"], c["better"], c["worse"], c["p"]) == ([4, 3], 2, 1, 1.0)
    assert c["above_guess"] == [1, 1]
    assert c["work"][0] == pytest.approx(1.0) and c["cpu"][0] == pytest.approx(4 ** (1 / 3))
    assert c["verdicts"] == {"kink": [4, 3], "unknown": [0, 1]}
    text = paired.comparison_tables(records)
    assert "| all | 4 | 4 | 3 | 2 | 1 | 1 |" in text and text.count("\n| b | 1 | 0 |") == 2


def test_sources_are_judged_by_the_least_cost():
    records = [
        {"family": "a", "number": 0, "guess_cost": 3.0, "arms": {"default": arm(2.0), "other": arm(1.0)}},
        {"family": "a", "number": 1, "guess_cost": 3.0, "optimum": 0.5, "arms": {"default": arm(4.0), "other": arm(None)}},
    ]
    j = paired.judged(records, "default")
    assert (j["asked"], j["solved"], j["near"], j["above_guess"], j["worst"]) == (2, 2, 0, 1, 8.0)
    assert paired.judged(records, "other")["near"] == 1
    assert "| a | 1 | 0.5 | enumeration | 4 | 8 |" in paired.source_tables(records)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="solves are processes that are forked")
def test_a_build_against_itself(tmp_path):
    from switchback_control import _library

    out = tmp_path / "found.json"
    command = [sys.executable, FOLDER / "paired.py", "--base", _library.path, "--families", "regions,onoff", "--count", "1", "--seed", "3", "--json", out]
    run = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert run.returncode == 0, run.stdout + run.stderr
    assert run.stdout.startswith("seed 3\n")
    found = json.loads(out.read_text())["instances"]
    for r in found:
        base, new = r["arms"]["base"], r["arms"]["new"]
        assert base["solved"] and {**base, "cpu": 0} == {**new, "cpu": 0}
    assert "| all | 2 | 2 | 2 | 0 | 0 | 1 |" in run.stdout
    assert "1.00 (1.00 to 1.00)" in run.stdout


@pytest.mark.skipif(not hasattr(os, "fork"), reason="solves are processes that are forked")
def test_a_limit_ends_a_solve():
    from switchback_control import _library

    problem = drawn("friction", 2)
    base = paired.Arm("base", _library.path, None, {})
    try:
        answer = base.ask(do="solve", family="friction", data=problem.data, options={"mode_search": 100000}, limit=0.2)
        assert answer["outcome"] in ("stopped", "solved") and answer["cpu"] < 3.0
        assert base.ask(do="solve", family="friction", data=problem.data, options={"no_such": 1}, limit=1.0)["solved"] is False
    finally:
        base.close()
