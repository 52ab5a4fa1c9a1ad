"""What a program says about its result; second derivatives in one piece; names; failures of callbacks."""

import ctypes
import json
import re
import threading
from pathlib import Path

import numpy as np
import pytest

import switchback_control as swb
from switchback_control import constraint as c

try:
    import scipy.sparse as sparse
except ImportError:
    sparse = None

INF = np.inf
TARGET = np.array([3.0, 1.0, -2.0])


def f(x):
    return (x - TARGET) @ (x - TARGET) + x[0] * x[2]


def gradient(x):
    return 2 * (x - TARGET) + np.array([x[2], 0, x[0]])


def rows(x):
    return [x[0] ** 2 + x[1], x[1] - x[2]]


def jacobian(x):
    return np.array([[2 * x[0], 1, 0], [0, 1, -1]])


def second(x, weight, y):
    h = 2 * weight * np.eye(3)
    h[0, 2] = h[2, 0] = weight
    h[0, 0] += 2 * y[0]
    return h


ENTRIES = ([0, 0, 1, 2], [0, 2, 1, 2])
ORDERED = ([2, 1, 0, 0], [2, 1, 2, 0])


def program(**more):
    return swb.Mpcc(
        3, f, rows, 2, pairs=[(0, c(1))], constraint_bounds=([-INF, 0], [4, INF]), start=[1, 1, 1],
        gradient=gradient, jacobian=jacobian, **more,
    )  # fmt: skip


def values(x, weight, y):
    h = second(x, weight, y)
    return h[ORDERED]


SECOND = {
    "dense": dict(hessian=second),
    "declared": dict(hessian=second, hessian_pattern=ENTRIES),
    "listed": dict(hessian=values, hessian_pattern=ORDERED),
    "by name": dict(hessian=lambda y, weight: second(np.zeros(3), weight, y)),
}
if sparse is not None:
    SHAPE = sparse.csc_matrix((np.ones(4), ENTRIES), (3, 3))

    def in_format(kind, part=lambda h: h):
        return lambda x, weight, y: sparse.coo_matrix(part(second(x, weight, y))).asformat(kind)

    for kind in ("csc", "csr", "coo"):
        SECOND[kind] = dict(hessian=in_format(kind), hessian_pattern=SHAPE)
    SECOND["upper"] = dict(hessian=in_format("csc", np.triu), hessian_pattern=SHAPE)


@pytest.fixture(scope="module")
def reference():
    return program().solve()


@pytest.mark.parametrize("kind", SECOND)
def test_hessian_of_the_lagrangian(kind, reference):
    r = program(**SECOND[kind]).solve()
    assert r.success and np.allclose(r.x, reference.x, atol=1e-7)
    assert r.objective == pytest.approx(reference.objective, abs=1e-8)
    # exact derivatives: one evaluation of the functions for each trial point, none for differences
    assert r.stats.evaluations <= reference.stats.evaluations + 5


@pytest.mark.skipif(sparse is None, reason="no scipy")
@pytest.mark.parametrize("kind", ["csc", "csr", "coo"])
def test_sparse_jacobians(kind, reference):
    pattern = sparse.coo_matrix(np.array([[1, 1, 0], [0, 1, 1]])).asformat(kind)
    p = swb.Mpcc(
        3, f, rows, 2, pairs=[(0, c(1))], constraint_bounds=([-INF, 0], [4, INF]), start=[1, 1, 1], gradient=gradient,
        jacobian=lambda x: sparse.coo_matrix(jacobian(x)).asformat(kind), jacobian_pattern=pattern,
    )  # fmt: skip
    assert np.allclose(p.solve().x, reference.x, atol=1e-7)


def test_compiled_hessian_and_back(reference):
    calls = []

    def compiled(at, weight, y, out, data):
        calls.append(data)
        x, w = np.ctypeslib.as_array((ctypes.c_double * 3).from_address(ctypes.c_void_p.from_address(at + 8).value)), y
        h = second(x, weight, np.ctypeslib.as_array((ctypes.c_double * 2).from_address(w)))
        np.ctypeslib.as_array((ctypes.c_double * 4).from_address(out))[:] = [h[0, 0], h[1, 1], h[0, 2], h[2, 2]]
        return 0

    callback = swb._ffi.swb_lagrangian_fn(compiled)
    p = program()
    p.set_hessian(callback, ENTRIES, user_data=77)
    assert np.allclose(p.solve().x, reference.x, atol=1e-7)
    assert set(calls) == {77}
    n = len(calls)
    p.set_hessian(ctypes.cast(callback, ctypes.c_void_p).value, ENTRIES, keep=callback)
    assert p.solve().success and len(calls) > n
    n = len(calls)
    p.set_hessian(None)
    assert p.solve().success and len(calls) == n


def test_hessian_refusals():
    p = program()
    for arguments in (
        ("no function",),
        (second, (([0, 2], [0, 0]))),  # below the diagonal
        (second, ([0], [3])),
        (second, ([0, 0], [1, 1])),
        (second, np.ones(3)),
        (lambda z: z, None),
        (0, ENTRIES),
    ):
        with pytest.raises(swb.ArgumentError) as caught:
            p.set_hessian(*arguments)
        assert len(str(caught.value)) > 10
    with pytest.raises(swb.ArgumentError):
        program(hessian_pattern=ENTRIES)
    with pytest.raises(swb.ArgumentError):
        swb.Nlp(3, f, jacobian=jacobian)
    with pytest.raises(swb.ArgumentError):
        swb.Nlp(3, swb.Function(f, 3), gradient=gradient)
    p.set_hessian(lambda x: np.ones((2, 2)))
    with pytest.raises(swb.DimensionError, match="Lagrangian"):
        p.solve()
    p.set_hessian(lambda x: None)
    with pytest.raises(TypeError):
        p.solve()


def test_names_in_reports():
    p = swb.Mpcc(
        2, lambda x: -x.sum(), lambda x: x, 2, constraint_bounds=(1.0, 9.0), pairs=[(0, 1)], start=[1, 1],
        names=["feed", None], constraint_names=["low", "high \"one\""],
    )  # fmt: skip
    p.set_name(swb.Item.PAIR, 0, "valve ⊥ flow")
    assert [p.name(swb.Item.VARIABLE, i) for i in (0, 1)] == ["feed", "variable 1"]
    lines = []
    p.on_log(lambda level, line: lines.append(line))
    p.set(log_level="warning", portfolio="off", max_iter=5)
    r = p.solve()
    assert not r.success and any("valve" in line for line in lines)
    assert {w.name for w in r.worst(9)} >= {"valve ⊥ flow"} and len(r.worst(1)) == 1 and r.worst(0) == ()
    sizes = [w.value for w in r.violations]
    assert sizes == sorted(sizes, reverse=True) and sizes[-1] > 0
    assert "valve ⊥ flow" in r.report
    told = json.loads(r.to_json())
    assert told["schema"] == "switchback.mpcc/1" and told["outcome"] == r.message
    assert {w["name"] for w in told["worst"]} <= {"feed", None, "low", 'high "one"', "valve ⊥ flow"}
    assert told["residuals"]["unscaled"]["pair_min"] == r.residuals.pair_min
    assert told["settings"]["log_level"] == "warning"
    for call in (
        lambda: p.set_names(swb.Item.VARIABLE, ["a"]),
        lambda: p.set_names(7, ["a"]),
        lambda: p.set_name(swb.Item.CONSTRAINT, 2, "a"),
        lambda: p.set_name(swb.Item.CONSTRAINT, -1, "a"),
        lambda: p.set_name(swb.Item.PAIR, 0, 3.5),
        lambda: p.name(swb.Item.PAIR, 1),
    ):
        with pytest.raises(swb.ArgumentError):
            call()
    p.set_names(swb.Item.PAIR, [None])
    assert p.name(swb.Item.PAIR, 0) == "pair 0"


def test_messages_have_names():
    p = program(names=["flow", None, None])
    with pytest.raises(swb.RangeError, match="flow has lower bound 2"):
        p.set_bounds([2, 0, 0], [1, 1, 1])
    with pytest.raises(swb.RangeError, match="bound of constraint 1 is NaN"):
        p.set_constraint_bounds([0, np.nan], None)


def test_options_that_shape_the_solver(reference):
    p = program()
    before = p.solve()
    p.set(ordering="natural")
    after = p.solve()
    assert after.stats.time_build > 0 and np.allclose(after.x, before.x, atol=1e-7)
    assert p.solve().stats.time_build == 0.0


def test_residuals_are_those_of_the_functions():
    # a row of gradient 1e4 is scaled by the solver
    p = swb.Nlp(2, lambda x: x @ x, lambda x: 1e4 * x.sum(), 1, constraint_bounds=(1e4, 1e4), start=[3, 0])
    r = p.solve()
    y = r.multipliers.constraints
    assert np.allclose(2 * r.x + 1e4 * y, 0, atol=1e-7) and r.residuals.dual < 1e-7
    assert r.residuals.primal == pytest.approx(abs(1e4 * r.x.sum() - 1e4), abs=1e-12)
    assert r.scaled_residuals.primal <= r.residuals.primal
    assert r.linear_stats.n >= 3 and r.linear_stats.factorisations >= r.stats.iterations


def test_a_variable_in_two_pairs_has_the_multipliers_of_both():
    target = np.array([-1.0, 2.0, 3.0])
    r = swb.minimize_mpcc(lambda x: (x - target) @ (x - target), [1, 1, 1], [(0, 1), (0, 2)])
    assert r.success and np.allclose(r.x, [0, 2, 3], atol=1e-7)
    assert np.allclose(2 * (r.x - target), r.z, atol=1e-6) and r.nu.sum() == pytest.approx(r.z[0])
    assert len(r.y) == 0


def test_warnings():
    r = swb.minimize_mpcc(
        lambda x: x @ x, [1, 2], constraints=lambda x: [x.sum(), 2 * x.sum(), 1e-10 * x[0]], n_constraints=3,
        jacobian=lambda x: [[1, 1], [2, 2], [1e-10, 0]],
        constraint_bounds=([1, 2, -1], [1, 2, 1]), constraint_names=["one", "two", "tiny"],
    )  # fmt: skip
    text = " ".join(r.warnings)
    assert r.success and "two" in text and "dependent" in text and "tiny" in text and "size" in text
    assert swb.minimize_mpcc(f, [0, 0, 0]).warnings == []


@pytest.mark.parametrize("which", ["hessian", "gradient", "rows"])
@pytest.mark.parametrize("fatal", [True, False])
def test_callbacks_that_fail_at_the_third_iteration(which, fatal, reference):
    """An exception ends the solve and comes out of it; a point without value is survived."""
    at, failures = [0], []

    class Broken(Exception):
        pass

    def failing(g):
        def h(*arguments):
            if at[0] >= 3 and (fatal or not failures):
                failures.append(1)
                raise Broken(which) if fatal else swb.Undefined("third iteration")
            return g(*arguments)

        return h

    parts = {"hessian": second, "gradient": gradient, "rows": rows}
    parts[which] = failing(parts[which])
    g, h, s = parts["gradient"], parts["rows"], parts["hessian"]
    p = swb.Mpcc(
        3, f, lambda x: h(x), 2, pairs=[(0, c(1))], constraint_bounds=([-INF, 0], [4, INF]), start=[1, 1, 1],
        gradient=lambda x: g(x), jacobian=jacobian, hessian=lambda x, weight, y: s(x, weight, y),
        on_iteration=lambda i: at.__setitem__(0, at[0] + 1),
    )  # fmt: skip
    if fatal:
        with pytest.raises(Broken):
            p.solve()
        assert len(failures) == 1
        at[0] = -10000
        assert p.solve().success
    else:
        try:
            r = p.solve()
        except swb.NonfiniteError:
            assert which != "rows", "a shorter step avoids a point without value"
            r = None
        assert failures == [1]
        if which == "rows":
            assert r.success and np.allclose(r.x, reference.x, atol=1e-6)


WARM = {
    "s stationary": dict(objective=lambda x: (x[0] - 1) ** 2 + (x[1] + 2) ** 2 + x[0] * x[1], pairs=[(0, 1)], n=2),
    "m stationary": dict(
        objective=lambda x: 2 * x[0] - x[1], constraints=lambda x: [x[1] - x[0]], n_constraints=1,
        bounds=([0, -INF], None), pairs=[(1, c(0))], n=2,
    ),
    "variable in two pairs": dict(objective=lambda x: (x - TARGET) @ (x - TARGET), pairs=[(0, 1), (0, 2)], n=3),
    "no pairs": dict(
        objective=lambda x: x @ x + x[0], constraints=lambda x: [x.sum(), x[0] * x[1]], n_constraints=2, n=2,
        constraint_bounds=([1, -INF], [1, 0.1]),
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", WARM)
def test_a_solve_from_the_solution_takes_a_step_or_two(kind):
    arguments = dict(WARM[kind])
    p = swb.Mpcc(arguments.pop("n"), arguments.pop("objective"), **arguments)
    r = p.solve()
    assert r.success
    again = p.resolve()
    assert again.success and again.stats.iterations <= 3 and np.allclose(again.x, r.x, atol=1e-7)
    assert again.stats.time_build == 0.0 and again.stationarity == r.stationarity
    p.set_warm_start(r.x, r.y, r.z)
    warm = p.solve()
    assert warm.success and warm.stats.iterations <= 3 and np.allclose(warm.x, r.x, atol=1e-7)
    p.set_start(np.ones(p.n))
    assert p.solve().stats.iterations == pytest.approx(r.stats.iterations, abs=8)


def test_a_solve_after_a_change_of_parameters():
    p = swb.Mpcc(2, lambda x, p: (x - p) @ (x - p), np=2, pairs=[(0, 1)], params=[3.0, 1.0])
    cold = p.solve()
    assert cold.b_stationary and cold.stationarity == "S"
    p.set_params([3.1, 1.2])
    near = p.resolve()
    assert np.allclose(near.x, [3.1, 0], atol=1e-8) and near.stats.iterations <= 3
    # as far as that the other branch is better: what is found is a stationary point in any case
    p.set_params([0.5, 9.0])
    far = p.resolve()
    assert far.success and far.b_stationary and min(far.x) == 0.0


def test_warm_start_refusals():
    p = program()
    for arguments in (
        ([1.0, 2.0],),
        ([1.0, 2.0, np.nan],),
        ([1.0] * 3, [1.0]),
        ([1.0] * 3, [1.0, np.inf]),
        ([1.0] * 3, None, [1.0]),
        (None,),
    ):
        with pytest.raises(swb.ArgumentError):
            p.set_warm_start(*arguments)
    with pytest.raises(swb.StateError):
        p.resolve()
    p.set_warm_start([1.0, 2.0, 0.0])
    assert p.solve().success
    p.set_bounds([0, 0, 0], [1, 1, 1])
    assert p.resolve().success


def test_certificates():
    # no multipliers of the right sign, and no descent
    r = swb.minimize_mpcc(
        lambda x: x[0] + x[1] - x[2], [1, 1, 1], [(0, 1)], lambda x: [4 * x[0] - x[2], 4 * x[1] - x[2]],
        n_constraints=2, constraint_bounds=(0, None),
    )  # fmt: skip
    assert r.success and np.allclose(r.x, 0, atol=1e-7)
    assert r.stationarity == "M" and r.certificate.sharp and r.b_stationary is True and r.certificate.biactive == 1
    told = json.loads(r.to_json())["certificate"]
    assert (told["stationarity"], told["b_stationary"], told["doubt"]) == ("M", "yes", "none")
    assert "B-stationary: yes" in r.report
    off = swb.minimize_mpcc(lambda x: (x - 1) @ (x - 1), [1, 1], [(0, 1)], certify="off")
    assert off.success and off.stationarity == "unknown" and off.b_stationary is None


def test_infeasible_programs_name_what_conflicts():
    lines = []
    r = swb.minimize_mpcc(
        lambda x: x @ x, [1, 1, 1], [(0, 1)], lambda x: [x[0] + x[1], x[0] + x[1], x[2]], n_constraints=3,
        constraint_bounds=([3, 0, 0], [9, 1, 1]), constraint_names=["demand", "supply", "other"],
        on_log=lambda level, line: lines.append(line), log_level="warning",
    )  # fmt: skip
    assert r.outcome == swb.Outcome.INFEASIBLE
    weights = {i.name: i.value for i in r.conflict.items}
    assert weights == {"demand": pytest.approx(-1), "supply": pytest.approx(1)}
    assert r.conflict.gap == pytest.approx(2) and r.conflict.residual < 1e-6
    assert any("conflict" in line and "demand" in line for line in lines)
    told = json.loads(r.to_json())["conflict"]
    assert {i["name"] for i in told["items"]} == {"demand", "supply"} and told["gap"] == pytest.approx(2)
    assert "demand" in r.report
    solved = program().solve()
    assert solved.conflict is None and json.loads(solved.to_json())["conflict"] is None


def test_conflicts_without_pairs():
    r = swb.minimize_mpcc(
        lambda x: x @ x, [1, 1], [], lambda x: [x[0] + x[1], x[0] + x[1]], n_constraints=2,
        constraint_bounds=([3, -1], [9, 1]), constraint_names=["demand", "supply"],
    )  # fmt: skip
    assert r.outcome == swb.Outcome.INFEASIBLE
    weights = {i.name: i.value for i in r.conflict.items}
    assert weights == {"demand": pytest.approx(-1), "supply": pytest.approx(1)}
    assert r.conflict.gap == pytest.approx(2) and r.conflict.residual < 1e-6


def test_unbounded():
    r = swb.minimize_mpcc(lambda x: -x.sum(), [1, 1], [(0, 1)])
    assert r.outcome == swb.Outcome.DIVERGING and r.message == "diverging"


def test_interrupt():
    p = program(on_iteration=lambda i: p.interrupt() if i.iter == 2 else None)
    r = p.solve()
    assert r.outcome == swb.Outcome.STOPPED and r.stats.iterations <= 4
    p.on_iteration(None)
    assert p.solve().success


def test_two_threads_with_two_programs(reference):
    found = []

    def work():
        found.append([program(hessian=second).solve().x for _ in range(5)])

    threads = [threading.Thread(target=work) for _ in range(2)]
    for t in threads:
        t.start()
    for t in threads:
        t.join()
    assert len(found) == 2 and np.array_equal(found[0], found[1])
    assert np.allclose(found[0], reference.x, atol=1e-7)


PAGE = Path(__file__).resolve().parents[3] / "docs" / "mpcc.md"


@pytest.mark.skipif(not PAGE.exists(), reason="no page here")
def test_the_page():
    text = PAGE.read_text(encoding="utf-8")
    code = re.findall(r"```python\n(.*?)```", text, flags=re.S)[0]
    found = {}
    exec(code, found)
    told = json.loads(found["result"].to_json())
    for key in told:
        assert re.search(rf"^\| .*\b{key.replace('_', '.*')}\b.* \|", text, flags=re.M), key
    for key in told["certificate"]:
        assert key.replace("_", "\\_") in text, key
