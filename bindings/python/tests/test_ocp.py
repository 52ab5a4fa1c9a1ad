"""Optimal control: known solutions, constraints, options, refusals."""

import numpy as np
import pytest

import switchback_control as swb
from models import TUTORIAL_COST, TUTORIAL_X0, sides, tutorial


def test_tutorial():
    r = tutorial().solve()
    assert r.success and r.cost == pytest.approx(TUTORIAL_COST, abs=1e-10) and r.stats.time_build > 0
    assert (r.certificate, r.optimality.kinks, r.optimality.reason) == ("local_optimum", [], "") and r.optimality.residual < 1e-3
    ocp = tutorial(ocp_start="homotopy")
    r = ocp.solve()
    assert r.success and r.polished == swb.Polished.DONE
    assert r.cost == pytest.approx(TUTORIAL_COST, abs=1e-10)
    assert r.trajectory.states[0, 0] == pytest.approx(TUTORIAL_X0, abs=1e-8)
    assert r.trajectory.switches[0].t == pytest.approx(-TUTORIAL_X0 / 3, abs=1e-8)
    assert r.controls.shape == (1, 0) and r.stats.n_pairs > 0 and r.stats.time_build > 0
    assert r.residuals.primal < 1e-9 and r.residuals.dual < 1e-6
    again = ocp.solve()
    assert again.stats.time_build == 0.0 and again.cost == pytest.approx(TUTORIAL_COST, abs=1e-10)
    ocp.set(max_iter=2)
    assert ocp.solve().outcome == swb.Outcome.MAX_ITER and not ocp.result.success
    assert np.isnan(ocp.result.cost) and np.isfinite(ocp.result.cost_reached) and "cost nan" in repr(ocp.result)
    ocp.set(max_iter=1000, max_time=0.0)
    assert ocp.solve().outcome == swb.Outcome.MAX_TIME
    assert "horizon=2" in repr(ocp)


def constrained():
    """x1' = x2 + push towards x1 = 0, x2' = u + p."""
    system = swb.System(2, 1, 1, f0=lambda x, u, p: [x[1], u[0] + p[0]])
    system.add_subsystem([[1.0], [-1.0]], lambda x: x[0], [-1, 1], rows=[0])
    ocp = swb.Ocp(system, 2.0, 4, lagrange=lambda x, u: u[0] ** 2 + x[1] ** 2, params=[0.1], initial_time=10.0)
    ocp.set_initial_state([-0.5, 0.0])
    ocp.add_terminal(lambda x: x, [0.25, 0.5], [0.25, 0.5])
    ocp.set_state_bounds([-1.0, -np.inf], [1.0, 1e20])
    ocp.set_control_bounds(-4.0, 4.0)
    return ocp


def test_constraints():
    ocp = constrained()
    ocp.set_state_guess([0.0, 2.0], [[-0.5, 0.0], [0.25, 0.5]])
    ocp.set_control_guess([1.0, 1.0, 0.0, -1.0])
    last = 0.0
    for at in ("control_grid", swb.PathAt.ELEMENTS, "stage_points"):
        ocp.add_path(lambda x: x[1], -2.0, 1.4, at=at)
        r = ocp.solve()
        assert r.success and r.cost >= last - 1e-6
        last = r.cost
    assert np.allclose(r.trajectory.states[-1], [0.25, 0.5], atol=1e-8)
    assert r.trajectory.t_start == pytest.approx(10.0) and r.trajectory.t_end == pytest.approx(12.0)
    assert r.trajectory.states[:, 1].max() <= 1.4 + 1e-7 and np.abs(r.controls).max() <= 4 + 1e-9
    assert r.controls.shape == (4, 1) and r.control_times.tolist() == [10.0, 10.5, 11.0, 11.5, 12.0]
    assert r.trajectory.control_stages.tolist() == sorted(r.trajectory.control_stages.tolist())


def test_models_are_systems():
    m = swb.Model(states="x", controls="u")
    m.derivatives = [m.u[0]]
    u = m.u[0]
    results = [
        swb.Ocp(s, 2.0, 2, lagrange=m.function([u * u]), initial_state=[1.0], control_bounds=(-1, 1), n_fe=1).solve()
        for s in (m, m.system())
    ]
    assert results[0].success and results[0].cost == results[1].cost == pytest.approx(0.0, abs=1e-12)
    assert results[0].accuracy.reached is True
    assert swb.simulate_fesd(m, [1.0], 1.0, 2, u=[0.5]).state[0] == pytest.approx(1.5, abs=1e-12)


def test_sensitivity():
    ocp = constrained()
    with pytest.raises(swb.StateError):
        ocp.sensitivity()
    ocp.solve()
    s = ocp.sensitivity()
    assert s.controls_x0.shape == (4, 1, 2) and s.controls_p.shape == (4, 1, 1)
    h = 1e-4

    def moved(dx0, dp):
        ocp.set_initial_state([-0.5 + dx0, 0.0])
        ocp.set_params([0.1 + dp])
        r = ocp.solve()
        return r.cost, r.controls

    by_x0, by_p = (s.cost_x0[0], s.controls_x0[..., 0], (h, 0.0)), (s.cost_p[0], s.controls_p[..., 0], (0.0, h))
    for value, controls, data in (by_x0, by_p):
        right, left = moved(*data), moved(*(-v for v in data))
        # the model has no derivatives: solutions are good to about 1e-9
        assert value == pytest.approx((right[0] - left[0]) / (2 * h), rel=1e-4, abs=1e-5)
        assert np.allclose(controls, (right[1] - left[1]) / (2 * h), rtol=1e-3, atol=1e-3)


def test_multipliers():
    ocp = constrained()
    with pytest.raises(swb.StateError):
        ocp.multipliers()
    r = ocp.solve()
    m, s = ocp.multipliers(), ocp.sensitivity()
    assert m.costates.shape == (5, 2) and m.controls.shape == (4, 1) and m.params.shape == (1,)
    assert m.costates[0] == pytest.approx(s.cost_x0, rel=1e-6) and m.initial_state == pytest.approx(-s.cost_x0, rel=1e-6)
    assert len(m.states.times) == len(m.states.values) and m.states.times[-1] == pytest.approx(r.trajectory.times[-1])
    assert m.costates[-1] == pytest.approx(sum(m.terminal), rel=1e-9)  # without a terminal cost, both states as the constraint
    assert all(p.values.shape[0] == len(p.times) for p in m.path) and m.relaxed == []


def sliding_ocp(n_s=2, n_fe=3, **options):
    """Two sliding modes at once; Python callables without derivatives."""
    system = swb.System(4, 2, f0=lambda x, u: [x[2], x[3], u[0], u[1]])
    system.add_subsystem([[-1.0], [1.0]], lambda x: x[0] + 0.15 * x[1] ** 2, [1, -1], rows=[0])
    system.add_subsystem([[-1.0], [1.0]], lambda x: x[1] - 0.05 * x[0] ** 3, [1, -1], rows=[1])
    ocp = swb.Ocp(
        system,
        4.0,
        6,
        lagrange=lambda x, u: u @ u + x[2:] @ x[2:],
        initial_state=[2 * np.pi / 3, np.pi / 3, 0, 0],
        state_bounds=([-np.inf, -np.inf, -2, -2], [np.inf, np.inf, 2, 2]),
        control_bounds=(-10, 10),
        n_s=n_s,
        n_fe=n_fe,
        **options,
    )
    goal = [-np.pi / 6, -np.pi / 4]
    ocp.add_terminal(lambda x: x[:2], goal, goal)
    return ocp


def test_sliding_modes():
    r = sliding_ocp(ocp_start="homotopy").solve()
    assert r.success and np.allclose(r.trajectory.states[-1, :2], [-np.pi / 6, -np.pi / 4], atol=1e-8)
    both = [r.trajectory.active_modes(k).all(axis=1) for k in (0, 1)]
    assert np.any(both[0] & both[1])


def test_refusals():
    ocp = constrained()
    with pytest.raises(swb.StateError, match="solve"):
        ocp.result
    inf = np.inf
    for call in (
        lambda: ocp.add_path(lambda x: x[1], 1.0, -1.0),
        lambda: ocp.add_path(lambda x: x[1], -1.0, 1.0, at="nowhere"),
        lambda: ocp.add_path(lambda x: x[1], -1.0, 1.0, at=7),
        lambda: ocp.add_path(lambda x: x, [0.0, 0.0], [1.0, 1.0, 1.0]),
        lambda: ocp.add_path(None, 0.0, 1.0),
        lambda: ocp.add_path(lambda x: x, np.nan, 1.0),
        lambda: ocp.add_terminal(swb.Function(lambda x: x, 3, n_out=3), 0.0, 1.0),
        lambda: ocp.set_lagrange(None),
        lambda: ocp.set_mayer(swb.Function(lambda x: x, 2, 1, 1, n_out=2)),
        lambda: ocp.set_params([]),
        lambda: ocp.set_params([np.nan]),
        lambda: ocp.set_params(None),
        lambda: ocp.set_initial_time(np.nan),
        lambda: ocp.set_initial_time(None),
        lambda: ocp.set_initial_state([0.0, np.nan]),
        lambda: ocp.set_initial_state([0.0]),
        lambda: ocp.set_initial_bounds([0.0], [1.0]),
        lambda: ocp.set_nominal([1.0, 1.0]),
        lambda: ocp.set_nominal({"x": [1.0]}),
        lambda: ocp.set_nominal({"x": [1.0, -1.0]}),
        lambda: ocp.set_nominal({"nobody": 1.0}),
        lambda: ocp.set_control_bounds([2.0], [1.0]),
        lambda: ocp.set_control_bounds(np.nan, 1.0),
        lambda: ocp.set_state_bounds("ab", None),
        lambda: ocp.set_control_guess([1.0, 2.0]),
        lambda: ocp.set_control_guess(None),
        lambda: ocp.set_control_guess([np.nan] * 4),
        lambda: ocp.set_state_guess([], np.empty((0, 2))),
        lambda: ocp.set_state_guess([1.0, 0.0], np.zeros((2, 2))),
        lambda: ocp.set_state_guess([0.0, 1.0], np.zeros((3, 2))),
        lambda: ocp.set_state_guess([[0.0]], np.zeros((1, 2))),
        lambda: ocp.on_iteration(3),
        lambda: ocp.on_log("print"),
        lambda: ocp.set(n_stages=3),
        lambda: ocp.set(n_s=30),
        lambda: ocp.set(n_s=None),
        lambda: swb.Ocp(sides(1.0, 2.0), -1.0, 1),
        lambda: swb.Ocp(sides(1.0, 2.0), inf, 1),
        lambda: swb.Ocp(sides(1.0, 2.0), np.nan, 1),
        lambda: swb.Ocp(sides(1.0, 2.0), 1.0, 0),
        lambda: swb.Ocp(sides(1.0, 2.0), 1.0, 1.5),
        lambda: swb.Ocp(None, 1.0, 1),
        lambda: swb.Ocp(sides(1.0, 2.0), 1.0, 1, control_bounds=3),
        lambda: swb.Ocp(sides(1.0, 2.0), 1.0, 1, settings=7),
    ):
        with pytest.raises(swb.ArgumentError) as caught:
            call()
        assert len(str(caught.value)) > 10
    assert ocp.solve().success  # nothing of it had an effect


def test_monitors():
    seen, lines = [], []
    ocp = tutorial(log_level="debug", on_iteration=seen.append, on_log=lambda level, line: lines.append((level, line)))
    r = ocp.solve()
    assert r.success and len(seen) >= r.stats.iterations // 2
    assert seen[0].iter == 0 and seen[-1].phase in " rpj" and all(i.inf_pr >= 0 for i in seen)
    assert {"info", "debug"} <= {level for level, _ in lines} and all("=" in line for _, line in lines)
    ocp.on_iteration(lambda i: i.iter == 3)
    ocp.on_log(None)
    assert ocp.solve().outcome == swb.Outcome.STOPPED
    ocp.on_iteration(None)
    assert ocp.solve().success


def test_print_iteration(capsys):
    tutorial(on_iteration=swb.print_iteration).solve()
    assert "inf_pr" in capsys.readouterr().out


def rest_to_rest(bound):
    """From rest to rest over a distance of 1 in a time of 1, which takes an acceleration of 4."""
    m = swb.Model(states="q v", controls="u")
    m.derivatives = [m.x[1], m.u[0]]
    ocp = swb.Ocp(m, 1.0, 10, initial_state=[0.0, 0.0], control_bounds=(-bound, bound))
    ocp.add_terminal(m.function([m.x[0], m.x[1]]), [1.0, 0.0], [1.0, 0.0])
    return ocp


def test_what_cannot_be_met_is_infeasible():
    assert rest_to_rest(5.0).solve().success
    r = rest_to_rest(2.0).solve()
    assert r.outcome == swb.Outcome.INFEASIBLE and np.isnan(r.cost)
    assert "off by 0.5000 at best" in r.message


@pytest.mark.parametrize(
    ("make", "start"),
    [(swb.sqrt, -2.0), (swb.log, -2.0), (lambda x: 1 / x, 0.0), (swb.asin, -2.0)],
    ids=["sqrt", "log", "1/x", "asin"],
)
def test_undefined_points_of_expressions_are_named(make, start):
    m = swb.Model(states="x", controls="u")
    m.derivatives = [make(m.x[0]) + m.u[0]]
    ocp = swb.Ocp(m, 1.0, 4, initial_state=[start], control_bounds=(-1.0, 1.0))
    ocp.set_lagrange(m.function([m.x[0] ** 2]))
    with pytest.raises(swb.NonfiniteError, match="of the right-hand side .* start elsewhere") as e:
        ocp.solve()
    assert "linear systems" not in str(e.value)


def test_nominal_sizes_by_name_and_as_lists():
    """A state that begins at zero, ends at zero and has no bounds: its size is told. The answer does not depend on it."""
    m = swb.Model(states="q v", controls="force")
    (q, v), u = m.x, m.u[0]
    m.derivatives = [v, u - 0.3 * swb.sign(v)]

    def solve(**options):
        ocp = swb.Ocp(m, 2.0, 4, initial_state=[0, 0], control_bounds=(-4, 4), **options)
        ocp.set_lagrange(m.function([u**2]))
        ocp.add_terminal(m.function([q, v]), [1, 0], [1, 0])
        return ocp, ocp.solve()

    plain = solve()[1]
    assert plain.success
    for nominal in ({"q": 1.0, "v": 2.0, "force": 4.0}, {"x": [1.0, np.nan]}, {"u": [3.0], "q": 1e-2}):
        ocp, r = solve(nominal=nominal)
        assert r.success and r.cost == pytest.approx(plain.cost, rel=1e-8)
        again = swb.Ocp.from_json(ocp.to_json())
        assert "nominal" in ocp.to_json() and again.solve().cost == pytest.approx(plain.cost, rel=1e-8)
    with pytest.raises(swb.ArgumentError, match="forse"):
        solve(nominal={"forse": 1.0})
