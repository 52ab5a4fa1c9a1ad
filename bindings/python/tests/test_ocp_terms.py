"""Optimal control: free lengths and parameters, least squares, relaxed constraints, both ends, warm starts."""

import numpy as np
import pytest

import switchback_control as swb


def rest_to_rest(n_stages: int, **options) -> swb.Ocp:
    system = swb.System(2, 1, f0=lambda x, u: (x[1], u[0]))
    ocp = swb.Ocp(system, 1.0, n_stages, initial_state=[0, 0], **options)
    ocp.add_terminal(lambda x: x, [1, 0], [1, 0])
    return ocp


def test_the_fastest_way_is_bang_bang():
    ocp = rest_to_rest(2, n_fe=1, control_bounds=(-2, 1), lagrange=lambda x: 1.0)
    ocp.set_free_time("stages", 0.1, 5.0)
    r = ocp.solve()
    assert r.success and np.allclose(r.durations, [2 / 3**0.5, 1 / 3**0.5], atol=1e-6)
    assert np.allclose(r.control_times, [0, 2 / 3**0.5, 3**0.5], atol=1e-6)
    assert r.accuracy.reached and r.accuracy.terminal < 1e-8 and len(r.mismatch) == 2
    ocp.set_free_time(swb.FreeTime.HORIZON, 0.1, 5.0)
    assert ocp.solve().cost == pytest.approx(2.0, abs=1e-6)


def test_linear_controls_reach_the_continuous_optimum():
    ocp = rest_to_rest(3, n_fe=1, n_s=3, lagrange=lambda u: u[0] ** 2)
    ocp.set_linear_controls()
    ocp.set_durations([0.2, 0.5, 0.3])
    r = ocp.solve()
    assert r.success and r.cost == pytest.approx(12.0, abs=1e-6)
    assert np.allclose(r.controls[1:], r.control_ends[:-1], atol=1e-6)


def test_friction_is_estimated_from_measurements():
    system = swb.System(2, 0, 1, f0=lambda x: (x[1], 0.0))
    friction = swb.Function.affine([0, 0], [[0, 0, -1], [0, 0, 1]], nx=2, nu=0, np=1)
    system.add_subsystem(friction, lambda x: x[1], [1, -1], rows=[1])
    mu, n = 0.37, 8
    t = 4 * np.arange(1, n + 1) / n
    data = np.where(t < 1 / mu, t - mu * t**2 / 2, 0.5 / mu)
    ocp = swb.Ocp(system, 4.0, n, initial_state=[0, 1], params=[0.6], n_fe=2)
    ocp.set_param_bounds(0.05, 2.0)
    ocp.add_least_squares(lambda x: x[0], 1.0, data.reshape(-1, 1), at="control_grid")
    r = ocp.solve()
    assert r.success and r.params == pytest.approx([mu], abs=1e-6)


def test_a_free_parameter_needs_derivatives():
    system = swb.System(1, 0, 1, f0=lambda x: -x[0])
    ocp = swb.Ocp(system, 1.0, 1, mayer=lambda x: x[0] ** 2)
    ocp.set_param_bounds(-1, 1)
    with pytest.raises(swb.ArgumentError, match="parameter 0 is free, but no function"):
        ocp.solve()
    # one that takes it is differentiated by it
    system = swb.System(1, 0, 1, f0=lambda p: p[0])
    ocp = swb.Ocp(system, 1.0, 1, mayer=lambda x: (x[0] - 0.25) ** 2, initial_state=[0])
    ocp.set_param_bounds(-1, 1)
    r = ocp.solve()
    assert r.success and r.params[0] == pytest.approx(0.25, abs=1e-6)


def test_relaxed_constraints_report_their_violation():
    ocp = swb.Ocp(swb.System(1, 1, f0=lambda u: u[0]), 1.0, 4, n_fe=1, initial_state=[0], control_bounds=(-1, 1))
    ocp.add_relaxed(lambda x: x[0], 2, 2, norm="linf", weight=10)
    ocp.set_lagrange(lambda u: 0.1 * u[0] ** 2)
    r = ocp.solve()
    assert r.success and r.violation == pytest.approx(1.0, abs=1e-6) and r.cost == pytest.approx(0.1, abs=1e-6)
    with pytest.raises(swb.ArgumentError, match="one of l1, l2, linf"):
        ocp.add_relaxed(lambda x: x[0], 2, 2, norm="l7")


def test_both_ends_elements_stage_parameters_and_warm_starts():
    f0 = swb.Function.affine([0], [[-1, 1, 1]], nx=1, nu=1, np=1)
    ocp = swb.Ocp(swb.System(1, 1, 1, f0=f0), 1.0, 3, lagrange=lambda u: u[0] ** 2)
    ocp.add_periodic()
    ocp.set_elements([1, 2, 1])
    ocp.set_stage_params([[1.0], [2.0], [3.0]])
    ocp.add_boundary(lambda x: x[0] - 2.0, 0.5, 0.5)
    r = ocp.solve()
    first, last = r.trajectory.states[0], r.trajectory.states[-1]
    assert r.success and np.allclose(first, 2.5) and np.allclose(first, last)
    warm = ocp.solve(warm=True)
    assert warm.success and warm.stats.iterations <= r.stats.iterations
    ocp.shift()
    assert ocp.solve().success
    with pytest.raises(swb.RangeError):
        ocp.add_periodic([3])
    with pytest.raises(swb.DimensionError):
        ocp.set_elements([1, 2])


def test_what_has_no_solution_says_why(tmp_path):
    r = rest_to_rest(10, n_fe=1, control_bounds=(-2, 2)).solve()
    assert not r.success
    assert "row 0 cannot be met: off by 0.5000 at best" in r.message and "off by" in repr(r)
    plt = pytest.importorskip("matplotlib.pyplot")
    figure = r.plot(title="out of reach")
    plt.close(figure)
    assert "off by 0.5000" in figure.get_suptitle().replace("\n", " ")
    assert rest_to_rest(10, n_fe=1, control_bounds=(-5, 5)).solve().message == ""
    # two gates in one stage of two elements
    system = swb.System(2, 1, f0=lambda x, u: (1.0, u[0]))
    for at in (2.3, 2.6):
        system.add_subsystem(lambda: (1.0, 0.0), lambda x, at=at: x[0] - at, [1, -1], rows=[1])
    cost = lambda x, u: u[0] ** 2 + x[1] ** 2
    ocp = swb.Ocp(system, 4.0, 4, initial_state=[0, 0], lagrange=cost, n_fe=2, ocp_start="homotopy")
    assert "2 switches in the stage" in ocp.solve().message
    ocp.set_elements([2, 2, 3, 2])
    assert ocp.solve().message == ""


def test_one_of_two_controls_is_zero():
    system = swb.System(1, 2, f0=lambda u: [u[0] - 2 * u[1]])
    ocp = swb.Ocp(system, 1.0, 4, initial_state=[0], lagrange=lambda u: (u[0] - 1) ** 2 + (u[1] - 1) ** 2, n_fe=1)
    ocp.set_mayer(lambda x: (x[0] - 0.5) ** 2)
    ocp.add_complementarity(lambda u: u[0], lambda u: u[1])
    r = ocp.solve()
    assert r.success and r.polished == swb.Polished.DONE
    assert np.abs(r.controls.min(axis=1)).max() < 1e-10
    down = np.mean(r.controls[:, 0] < 1e-10)
    miss = (0.5 - 3 * down) / (2 + 3 * down)
    assert r.cost == pytest.approx(1 + miss**2 * (2 + 3 * down), abs=1e-6)
    with pytest.raises(swb.ArgumentError, match="at must be one of"):
        ocp.add_complementarity(lambda u: u[0], lambda u: u[1], at="nowhere")


def test_a_ball_bounces_between_two_phases():
    fall = swb.System(2, 0, f0=lambda x: (x[1], -9.81))

    def flight(state: int) -> swb.Ocp:
        ocp = swb.Ocp(fall, 0.5, 1, n_fe=1)
        ocp.set_free_time("horizon", 0.0, 5.0)
        ocp.add_terminal(lambda x: x[state], 0, 0)
        return ocp

    down, up = flight(0), flight(1)
    down.set_initial_state([1, 0])
    up.set_state_guess([0.0], [[0.0, 1.0]])
    both = swb.MultiPhase([down, up])
    with pytest.raises(swb.StateError):
        both.result
    both.link(0, lambda x: (x[2] - x[0], x[3] + 0.5 * x[1]), [0, 0], [0, 0])
    r = both.solve()
    assert r.success and r.message == "" and r.link_violation < 1e-8 and r.error < 1e-6
    time = (2 / 9.81) ** 0.5
    assert np.allclose(r.phases[1].trajectory.states[-1], [0.25, 0.0], atol=1e-6)
    assert np.allclose([p.durations[0] for p in r.phases], [time, time / 2], atol=1e-6)
    assert r.phases[1].control_times[0] == pytest.approx(time, abs=1e-6)
    assert r is both.result and "2 phases" in repr(both)
    with pytest.raises(swb.ArgumentError, match="phase must be"):
        both.link(1, lambda x: x[0])
    with pytest.raises(swb.ArgumentError, match="phases must be problems"):
        swb.MultiPhase([fall])
    with pytest.raises(swb.DimensionError):
        swb.MultiPhase([])


def least_by_lp(price, n, horizon, limit):
    """Least sum of `h max(a)` over prices `a(u) = k u`, by a linear program: from rest to rest at a distance of 1 with forces constant by stage."""
    linprog = pytest.importorskip("scipy.optimize").linprog
    h = horizon / n
    later = h * np.arange(n - 1, -1, -1)
    reach = np.stack([h * (h / 2 + later), np.full(n, h)])  # what a force adds to position and velocity
    rows = [np.hstack([k * np.eye(n), -np.eye(n)]) for k in (*price, 0.0)]
    r = linprog(
        np.hstack([np.zeros(n), np.full(n, h)]), np.vstack(rows), np.zeros(n * len(rows)), np.hstack([reach, 0 * reach]), [1.0, 0.0],
        bounds=[(-limit, limit)] * n + [(0, None)] * n,
    )  # fmt: skip
    assert r.success
    return r.fun


@pytest.mark.parametrize("price", [(1.0, -1.0), (2.0,), (1.0, -0.25)])
def test_costs_with_kinks(price):
    """`abs`, `maximum` and sums of them in costs are what a linear program says, without modes, and from a document again."""
    m = swb.Model(states="q v", controls="u")
    u = m.u[0]
    m.derivatives = [m.v, u]
    cost = swb.maximum(*(k * u for k in price), 0) if len(price) == 1 else swb.maximum(*(k * u for k in price))
    ocp = swb.Ocp(m, 3.0, 15, initial_state=[0, 0], control_bounds=(-1, 1), lagrange=cost)
    ocp.add_terminal(m.x, [1, 0], [1, 0])
    r = ocp.solve()
    expected = least_by_lp(price, 15, 3.0, 1.0)
    assert r.cost == pytest.approx(expected, abs=1e-9) and r.optimality.verdict == "local_optimum"
    assert r.stats.n_pairs == 0 and abs(r.accuracy.cost_error) < 1e-9
    assert swb.Ocp.from_json(ocp.to_json()).solve().cost == pytest.approx(expected, abs=1e-9)


def test_costs_with_kinks_beside_transitions_phases_and_feedback():
    m = swb.Model(states="room", controls="u")
    u = m.u[0]
    hot = m.hysteresis(m.room, on=22.0, off=18.0)
    m.derivatives = [-0.2 * (m.room - 15) + u - 2.0 * hot]
    ocp = swb.Ocp(m, 6.0, 12, n_fe=3, initial_state=[17], control_bounds=(0, 3))
    ocp.set_lagrange(swb.maximum(u - 1, 0) + 0.1 * u)
    ocp.set_mayer(2 * abs(m.room - 21))
    r = ocp.solve()
    by_stage = 0.5 * (np.maximum(r.controls - 1, 0) + 0.1 * r.controls).sum() + 2 * abs(r.trajectory(6.0)[0] - 21)
    assert r.cost == pytest.approx(by_stage, abs=1e-8) and abs(r.accuracy.cost_error) < 1e-6

    m = swb.Model(states="q v", controls="u")
    u = m.u[0]
    m.derivatives = [m.v, u]
    ways = [swb.Ocp(m, 1.5, 5, control_bounds=(-1, 1), lagrange=abs(u)) for _ in range(2)]
    ways[0].set_initial_state([0, 0])
    ways[1].add_terminal(m.x, [1, 0], [1, 0])
    both = swb.MultiPhase(ways)
    both.link_continuous(0)
    r = both.solve()
    assert r.cost == pytest.approx(least_by_lp((1.0, -1.0), 10, 3.0, 1.0), abs=1e-8)

    ocp = swb.Ocp(m, 3.0, 15, initial_state=[0, 0], control_bounds=(-1, 1), lagrange=abs(u) + 0.1 * m.q**2 + 0.1 * m.v**2)
    ocp.set_mayer(5 * m.q**2 + 5 * m.v**2)
    with swb.Nmpc(ocp) as c:
        loop = swb.closed_loop(c, m, [1.0, 0.0], 40)
    assert np.abs(loop.x[-1]).max() < 0.2
    # it coasts: no smooth cost has forces that are zero
    assert (np.abs(loop.u) < 1e-6).sum() >= 5


@pytest.mark.parametrize("norm", ["l1", "l2"])
def test_violations_next_to_clocks_are_those_of_the_states(norm):
    # a clock strikes at the start: the stage before it has no length, and its slack no price
    m = swb.Model(states="q", controls="u", name="sampled")
    m.derivatives = [m.hold(-1.0 * m.q, 0.25) + m.u[0]]
    ocp = swb.Ocp(m, 1.2, 4, lagrange=m.function(m.u[0] ** 2), initial_state=[1.0], control_bounds=(-0.1, 0.1))
    ocp.add_relaxed(m.q, 1.3, np.inf, at="control_grid", norm=norm, weight=5.0)
    r = ocp.solve()
    assert r.success and r.jumps[0].t == 0.0
    ends = r.trajectory(np.cumsum(r.durations))[:, 0]
    assert r.violation == pytest.approx(1.3 - ends.min(), abs=1e-5)
