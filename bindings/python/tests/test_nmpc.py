"""Controllers from Python: feedback of linear problems, closed loops, delays, what can go wrong."""

import re
import threading
from pathlib import Path

import numpy as np
import pytest

import switchback_control as swb

N, H = 15, 0.1


def integrator():
    m = swb.Model(states="q v", controls="a")
    m.derivatives = [m.x[1], m.u[0]]
    return m


def problem(m, limit=1.0, **bounds):
    ocp = swb.Ocp(m, N * H, N, rk_family="explicit", n_s=4, n_fe=1, control_bounds=(-limit, limit))
    ocp.add_least_squares(m.function([m.x[0], m.x[1], m.u[0]]), [2, 0.5, 0.3], np.zeros(3))
    ocp.add_least_squares(m.function([m.x[0], m.x[1]]), [5, 1], np.zeros(2), at="terminal")
    return ocp


def gain():
    """First gain of the Riccati recursion."""
    a, b = np.array([[1, H], [0, 1]]), np.array([[H * H / 2], [H]])
    q, r, p = H * np.diag([2, 0.5]), H * 0.3, np.diag([5.0, 1.0])
    for _ in range(N):
        k = np.linalg.solve(r + b.T @ p @ b, b.T @ p @ a)
        p = q + a.T @ p @ (a - b @ k)
    return k


def test_feedback_is_that_of_riccati():
    with swb.Nmpc(problem(integrator())) as c:
        assert (c.n, c.nx, c.nu) == (N, 2, 1)
        assert c.prepare().ready
        x = np.array([0.1, -0.05])
        u, info = c.feedback(x)
        assert info.source is swb.NmpcSource.QP and info.status is swb.NmpcQpStatus.SOLVED
        np.testing.assert_allclose(u, -gain() @ x, atol=1e-13)
        assert c.plan.x.shape == (N + 1, 2)
        np.testing.assert_allclose(c.plan.x[0], x, atol=1e-15)
        assert c.monitor.feedbacks == 1


@pytest.mark.parametrize("scheme", ["rti", "as_rti"])
def test_both_methods_for_quadratic_programs_agree(scheme):
    def run(method):
        with swb.Nmpc(problem(integrator()), scheme, qp_solver=method, shift=True) as c:
            return swb.closed_loop(c, integrator(), [1.5, 0.0], 40).x

    np.testing.assert_allclose(run("stagewise"), run("condensing"), atol=1e-9)
    with pytest.raises(swb.ArgumentError, match="qp_solver"):
        run("dense")


def test_changes_at_run_time_and_what_a_plan_says():
    with swb.Nmpc(problem(integrator())) as c:
        with pytest.raises(swb.StateError, match="prepare"):
            _ = c.gain
        c.prepare()
        np.testing.assert_allclose(c.gain, -gain(), atol=1e-12)
        c.set_control_bounds([-0.3], [0.2])
        u, _ = c.feedback([1.5, 0.0])
        assert u[0] == -0.3
        m = c.multipliers
        assert m.dynamics.shape == (N + 1, 2) and m.controls.shape == (N, 1) and len(m.rows) == len(m.nodes)
        assert m.controls[0, 0] < 0
        before = c.objective
        c.set_weights(0, [4.0, 1.0, 0.6])
        c.reset()
        c.prepare()
        c.feedback([1.5, 0.0])
        x, v = c.plan.x, c.plan.u[:, 0]
        cost = H * (x[:-1] ** 2 @ [4.0, 1.0] + 0.6 * v**2).sum() + x[-1] ** 2 @ [5.0, 1.0]
        np.testing.assert_allclose(c.objective, cost, rtol=1e-12)
        assert before > 0
        for call in (lambda: c.set_weights(0, [1.0, 2.0]), lambda: c.set_control_bounds([0, 0], [1, 1]), lambda: c.set_state_bounds([0], [1])):
            with pytest.raises(swb.DimensionError):
                call()
        with pytest.raises(swb.RangeError, match="lower"):
            c.set_control_bounds([1], [0])
        with pytest.raises(swb.RangeError, match="has no bound"):
            c.set_state_bounds([-1, -1], [1, 1])


def test_a_controller_in_c_is_refused_with_what_to_do(tmp_path):
    with swb.Nmpc(problem(integrator()), qp_solver="condensing") as c:
        with pytest.raises(swb.StateError, match="stagewise"):
            c.write_c(tmp_path)
    with swb.Nmpc(problem(integrator()), qp_solver="stagewise") as c:
        with pytest.raises(swb.RangeError, match="letters"):
            c.write_c(tmp_path, prefix="a-b")
        with pytest.raises(swb.ArgumentError, match="precision"):
            c.write_c(tmp_path, precision="half")
        assert not list(tmp_path.iterdir())
        paths = c.write_c(tmp_path / "new", precision="float")
        assert all(p.stat().st_size > 0 for p in paths)
        assert "typedef float controller_real" in paths[0].read_text()


@pytest.mark.parametrize("scheme", ["rti", "mli", "as_rti", "asc"])
@pytest.mark.parametrize("level", ["a", "b", "c", "d", "d1", "d2"])
def test_every_scheme_stabilises(scheme, level):
    m, seen = integrator(), []
    with swb.Nmpc(problem(m), scheme, level, shift=True) as c:
        loop = swb.closed_loop(c, m, [1.5, 0.0], 60, cost=lambda x, u, t: x @ x, progress=lambda *n: seen.append(n))
    assert np.abs(loop.x[-1]).max() < 0.05
    assert set(loop.sources) == {swb.NmpcSource.QP}
    assert loop.u.min() == -1.0
    assert seen[-1] == (60, 60) and len(seen) == 60


def test_delays_and_mismatch():
    m, heavier = integrator(), swb.Model(states="q v", controls="a")
    heavier.derivatives = [heavier.x[1], 0.8 * heavier.u[0] - 0.1 * heavier.x[1]]
    with swb.Nmpc(problem(m)) as c:
        loop = swb.closed_loop(c, heavier, [1.0, 0.0], 80, delay=2, noise=[1e-3, 1e-3])
        assert np.abs(loop.x[-1]).max() < 0.1
        again = swb.Nmpc(problem(m))
        assert np.array_equal(swb.closed_loop(again, heavier, [1.0, 0.0], 80, delay=2, noise=[1e-3, 1e-3]).x, loop.x)


def test_a_plant_with_dry_friction():
    m, rough = integrator(), swb.Model(states="q v", controls="a")
    rough.derivatives = [rough.x[1], rough.u[0] - 0.05 * swb.sign(rough.x[1])]
    with swb.Nmpc(problem(m)) as c:
        loop = swb.closed_loop(c, rough, [1.0, 0.0], 60)
    assert np.abs(loop.x[-1]).max() < 0.1


def test_references_and_parameters():
    m = swb.Model(states="q", controls="u", parameters="d")
    m.derivatives = [m.u[0] + m.p[0]]
    ocp = swb.Ocp(m, 1.0, 10, rk_family="gauss_legendre", n_s=2, n_fe=2)
    ocp.add_least_squares(m.function([m.x[0], m.u[0]]), [10, 0.1], np.zeros(2))
    with swb.Nmpc(ocp) as c:
        c.set_params([0.5])
        c.set_references(0, [1.0, -0.5])
        x = np.zeros(1)
        for _ in range(40):
            c.prepare()
            u, _ = c.feedback(x)
            x = x + 0.1 * (u + 0.5)
        assert abs(x[0] - 1.0) < 1e-3 and abs(u[0] + 0.5) < 1e-2
        with pytest.raises(swb.DimensionError):
            c.set_params([1.0, 2.0])
        with pytest.raises(swb.SwitchbackError):
            c.set_references(3, [1.0])


def test_there_is_always_a_control():
    with swb.Nmpc(problem(integrator())) as c:
        c.initialise([1.0, 0.0])
        plan = c.plan.u[:, 0]
        for k in range(N + 3):
            c.prepare()
            u, info = c.feedback([np.nan, 0.0])
            assert info.source is (swb.NmpcSource.PLAN if k < N else swb.NmpcSource.HOLD)
            assert u[0] == plan[min(k, N - 1)]


def test_constraints_that_cannot_be_met():
    m = integrator()
    ocp = problem(m)
    ocp.set_state_bounds([-np.inf, -0.2], [np.inf, 0.2])
    with swb.Nmpc(ocp) as c:
        c.prepare()
        u, info = c.feedback([0.0, 3.0])
        assert info.source is swb.NmpcSource.SOFT_QP and u[0] == -1.0
        c.prepare()
        _, info = c.feedback([0.0, 0.1])
        assert info.source is swb.NmpcSource.QP
        assert np.abs(c.plan.x[1:, 1]).max() <= 0.2 * (1 + 1e-9)


@pytest.mark.parametrize("seed", range(30))
def test_a_controller_starts_at_rest(seed):
    """Pendulums at rest up to 0, 1e-9, ..., in any unit, with and without bounds of the control: what is left of steps is rounding."""
    rng = np.random.default_rng(seed)
    k, d, angle = rng.uniform(0.5, 4), rng.uniform(0, 0.5), rng.uniform(-2, 2)
    unit, price = 10.0 ** rng.uniform(-4, 4), 10.0 ** rng.uniform(-4, 0)
    goal = angle * unit
    m = swb.Model(states="q v", controls="F")
    q, v = m.x
    m.derivatives = [v, unit * (m.u[0] - swb.sin(k * q / unit) + np.sin(k * angle)) - d * v]
    bounds = {"control_bounds": (-1, 1)} if seed % 2 else {}
    ocp = swb.Ocp(m, 2.0, int(rng.integers(5, 25)), rk_family="explicit", n_s=4, n_fe=1, **bounds)
    ocp.add_least_squares(m.function([q, v, m.u[0]]), [1 / unit**2, 0.1 / unit**2, price], [goal, 0, 0])
    ocp.set_state_guess([0], [[goal, 0]])
    with swb.Nmpc(ocp) as c:
        for off in (0.0, 1e-7, 1e-9, 1e-12, 1e-15):
            c.reset()
            assert c.initialise([goal * (1 + off), 0.0], 50) <= 6, off
            # no farther from zero than a law of the size of 1/sqrt(price) takes it
            assert abs(c.plan.u[0, 0]) <= 1e2 * (off + 1e-14) * (1 + price**-0.5) * max(1, k) * abs(angle), off
    with swb.Nmpc(ocp, "asc", inner=50) as c:
        for off in (1e-2, 0.0, 1e-9, 1e-9, 1e-12):
            x = [goal * (1 + off), 0.0]
            assert c.prepare(x).inner <= 8, off
            c.feedback(x)


def test_level_c_is_as_good_as_level_d_with_few_jacobians():
    """Pendulums that are swung up from a plan that knows nothing of it: the matrices of the first linearisation are of no use."""
    cost, jacobians = {"rti": 0.0, "mli": 0.0}, {"rti": 0, "mli": 0}
    for seed in range(8):
        rng = np.random.default_rng(seed)
        k, d, a = rng.uniform(2, 12), rng.uniform(0, 0.5), rng.uniform(1, 4)
        limit = rng.uniform(0.6, 2) * k
        m = swb.Model(states="q w", controls="T")
        q, w = m.x
        m.derivatives = [w, k * swb.sin(q) - d * w + m.u[0] * (1 + 0.3 * swb.cos(a * q))]
        ocp = swb.Ocp(m, 1.6, 20, rk_family="explicit", n_s=4, n_fe=1, control_bounds=(-limit, limit))
        ocp.add_least_squares(m.function([q, w, m.u[0]]), [5, 0.5, 0.02], np.zeros(3))
        ocp.add_least_squares(m.function([q, w]), [30, 3], np.zeros(2), at="terminal")
        x0 = [rng.uniform(2, 3.6), rng.uniform(-1, 1)]
        for scheme, level in (("rti", "d"), ("mli", "c")):
            with swb.Nmpc(ocp, scheme, level, shift=True) as c:
                loop = swb.closed_loop(c, m, x0, 40, cost=lambda x, u, t: 5 * x[0] ** 2 + 0.5 * x[1] ** 2 + 0.02 * u[0] ** 2)
                cost[scheme] += loop.cost
                jacobians[scheme] += c.monitor.jacobians
    # 1.09 and 0.12; with the first matrices for ever 2.2
    assert cost["mli"] < 1.2 * cost["rti"]
    assert jacobians["mli"] < 0.25 * jacobians["rti"]


@pytest.mark.parametrize("seed", range(4))
def test_a_switch_by_time_and_control_is_that_of_a_clock(seed):
    """A valve with duty cycle `d`: time as it is and as a state are the same loop, or the message says that derivatives are no numbers."""
    rng = np.random.default_rng(seed)
    goal, gain, x0 = rng.uniform(0.5, 0.9), rng.uniform(1.5, 2.5), rng.uniform(0.1, 0.3)
    found = []
    for clock in (True, False):
        m = swb.Model(states="level time" if clock else "level", controls="d")
        level, t = m.x[0], m.x[1] if clock else m.t
        valve = swb.where(swb.cos(2 * np.pi * (t - 0.5)) > swb.cos(np.pi * m.u[0]), 1.0, 0.0)
        m.derivatives = [-0.5 * level + gain * valve] + [1.0] * clock
        ocp = swb.Ocp(m, 3.0, 3, n_fe=3, control_bounds=(0.1, 0.5), settings={"rtol": 1e-8, "atol": 1e-10})
        ocp.add_least_squares(m.function([level]), [1], [goal])
        ocp.add_least_squares(m.function([level]), [5], [goal], at="terminal")
        start = [x0, 0.0] if clock else [x0]
        with swb.Nmpc(ocp, "as_rti", shift=True) as c:
            try:
                c.initialise(start)
            except swb.NumericError as e:
                assert not clock and "stage 0" in str(e)
                # without a linearisation the plan answers
                assert not c.prepare().ready
                assert c.feedback(start)[1].source is swb.NmpcSource.PLAN
                return
            found.append(swb.closed_loop(c, m, start, 4).u)
    np.testing.assert_allclose(found[1], found[0], atol=1e-4)


def test_closed_loops_know_the_names_of_the_plant():
    m = integrator()
    with swb.Nmpc(problem(m)) as c:
        assert swb.closed_loop(c, m, [0.1, 0], 2).names == (["q", "v"], ["a"])
        assert list(swb.closed_loop(c, m, [0.1, 0], 2)._series()[1]) == ["q", "v", "a"]
        c.reset()
        free = swb.closed_loop(c, lambda x, u, p, t: x, [0.1, 0], 2)
        assert list(free._series()[1]) == ["x0", "x1", "u0"]


@pytest.mark.parametrize("seed", range(4))
def test_controls_without_a_price(seed):
    """Masses that stick, several at once, with controls that cost nothing and at first move nothing."""
    rng = np.random.default_rng(seed)
    n, friction = 1, rng.uniform(0.3, 2)
    m = swb.Model(states=2 * n, controls=n)
    q, v, force = m.x[:n], m.x[n:], m.u
    m.derivatives = [*v, *(force[i] - friction * swb.sign(v[i]) for i in range(n))]
    ocp = swb.Ocp(m, 1.0, 8, control_bounds=(-4 * friction, 4 * friction), settings={"rtol": 1e-6, "atol": 1e-8})
    ocp.add_least_squares(m.function([*q, *v]), [2] * n + [0.1] * n, np.zeros(2 * n))
    ocp.add_least_squares(m.function([*q, *v]), [20] * n + [1] * n, np.zeros(2 * n), at="terminal")
    x0 = np.concatenate([rng.uniform(0.3, 1, n), np.zeros(n)])
    with swb.Nmpc(ocp, "as_rti", shift=True) as c:
        c.initialise(x0)
        loop = swb.closed_loop(c, m, x0, 10)
    assert set(loop.sources) == {swb.NmpcSource.QP}
    assert np.abs(loop.x[-1, :n]).max() < 0.5 * np.abs(x0[:n]).max()


def least_violation(a, b, x0, bound, rows, limit, n):
    """Sum of |x_i| - bound over rows and nodes that no controls can make less: a linear program."""
    scipy = pytest.importorskip("scipy.optimize")
    nx, nu = b.shape
    state, effect, out, rhs = x0.copy(), np.zeros((nx, n * nu)), [], []
    for k in range(n):
        state, effect = a @ state, a @ effect
        effect[:, k * nu : (k + 1) * nu] += b
        for i in rows:
            for sign in (1, -1):
                out.append(sign * effect[i])
                rhs.append(bound - sign * state[i])
    cost = np.concatenate([np.zeros(n * nu), np.ones(len(rhs) // 2)])
    slack = -np.repeat(np.eye(len(rhs) // 2), 2, axis=0)
    box = [(-limit, limit)] * (n * nu) + [(0, None)] * (len(rhs) // 2)
    return scipy.linprog(cost, np.hstack([np.array(out), slack]), rhs, bounds=box).fun


@pytest.mark.parametrize("seed", range(30))
def test_bounds_that_cannot_be_met_cost_little(seed):
    """Chains of masses in any unit whose speeds are bounded: violations are the least ones, and the work stays that of a warm start."""
    rng = np.random.default_rng(seed)
    n, masses, h = 12, int(rng.integers(1, 4)), 0.2
    unit, weight = 10.0 ** rng.uniform(-3, 3), 10.0 ** rng.uniform(-3, 3)
    stiff, limit, bound = rng.uniform(0.5, 5), rng.uniform(0.2, 1), rng.uniform(0.05, 0.4)
    m = swb.Model(states=2 * masses, controls=1)
    q, v = m.x[:masses], m.x[masses:]
    force = [(q[i - 1] if i else 0) - 2 * q[i] + (q[i + 1] if i + 1 < masses else 0) for i in range(masses)]
    m.derivatives = [*v, *(stiff * f + (unit * m.u[0] if i == masses - 1 else 0) for i, f in enumerate(force))]
    ocp = swb.Ocp(m, n * h, n, rk_family="explicit", n_s=4, n_fe=1, control_bounds=(-limit, limit))
    squares = m.function([*(x / unit for x in m.x), m.u[0]])
    ocp.add_least_squares(squares, [weight] * (2 * masses) + [0.1 * weight], np.zeros(2 * masses + 1))
    ocp.set_state_bounds([-np.inf] * masses + [-bound * unit] * masses, [np.inf] * masses + [bound * unit] * masses)
    a = np.zeros((2 * masses, 2 * masses))
    a[:masses, masses:] = np.eye(masses)
    a[masses:, :masses] = stiff * (np.eye(masses, k=1) + np.eye(masses, k=-1) - 2 * np.eye(masses))
    b = np.zeros((2 * masses, 1))
    b[-1, 0] = 1
    series = sum(np.linalg.matrix_power(a * h, i) / np.prod(range(1, i + 2)) for i in range(4))
    a, b = np.eye(2 * masses) + a * h @ series, h * series @ b
    x0 = np.concatenate([rng.uniform(-1, 1, masses), rng.uniform(-1, 1, masses) * bound * 3])
    most = 6 * (n + n * masses)
    with swb.Nmpc(ocp) as c:
        for k in range(6):
            x = x0 * (1 + 0.1 * k)
            assert c.prepare().ready
            u, info = c.feedback(unit * x)
            assert info.source in (swb.NmpcSource.QP, swb.NmpcSource.SOFT_QP)
            assert info.iterations <= most
            speeds = np.abs(c.plan.x[1:, masses:]) / unit
            found = np.maximum(speeds - bound, 0).sum()
            free = np.maximum(np.abs(x[masses:]) - bound, 0).sum() + bound
            least = least_violation(a, b, x, bound, range(masses, 2 * masses), limit, n)
            assert found <= least + 1e-2 * (least + free)
            assert (info.source is swb.NmpcSource.QP) == (found < 1e-7)


def test_what_controllers_do_not_know():
    m = swb.Model(states="q", controls="u")
    m.derivatives = [m.u[0] - swb.sign(m.x[0])]
    for level in "abc":
        with pytest.raises(swb.UnsupportedError, match="switch"):
            swb.Nmpc(swb.Ocp(m, 1.0, 5), level=level)
    with pytest.raises(swb.UnsupportedError, match="switch"):
        swb.Nmpc(swb.Ocp(m, 1.0, 5), "mli")
    with pytest.raises(swb.RangeError, match="hysteresis"):
        swb.Nmpc(problem(integrator()), hysteresis=-1.0)
    with pytest.raises(swb.ArgumentError, match="Ocp"):
        swb.Nmpc(m)
    with pytest.raises(swb.ArgumentError, match="scheme"):
        swb.Nmpc(problem(integrator()), "fast")


def dry_mass(friction=1.0):
    m = swb.Model(states="q v", controls="a")
    m.derivatives = [m.x[1], m.u[0] - friction * swb.sign(m.x[1])]
    return m


def dry_loop(flips, friction=1.0, delay=0, noise=None):
    m = dry_mass()
    ocp = swb.Ocp(m, N * H, N, control_bounds=(-4, 4))
    ocp.add_least_squares(m.function([m.x[0], m.x[1], m.u[0]]), [2, 0.1, 0.01], np.zeros(3))
    ocp.add_least_squares(m.function([m.x[0], m.x[1]]), [20, 1], np.zeros(2), at="terminal")
    ocp.set_state_guess([0.0], [[1.0, 0.0]])
    with swb.Nmpc(ocp, "as_rti", shift=True, flips=flips) as c:
        c.initialise([1.0, 0.0])
        return swb.closed_loop(c, dry_mass(friction), [1.0, 0.0], 40, delay=delay, noise=noise), c.monitor


def test_a_mass_that_sticks_breaks_away():
    loop, monitor = dry_loop(flips=4)
    assert abs(loop.x[-1, 0]) < 0.05 and loop.x[-1, 1] == 0.0
    assert monitor.alternatives > 0 and set(loop.sources) == {swb.NmpcSource.QP}
    # no derivative says that a larger force would move it
    loop, monitor = dry_loop(flips=0)
    assert np.all(loop.x[:, 0] == 1.0) and monitor.alternatives == monitor.flips == 0


@pytest.mark.parametrize("friction, delay, noise", [(1.2, 0, None), (0.8, 0, None), (1.0, 2, None), (1.0, 0, [1e-3, 1e-3])])
def test_friction_that_is_not_that_of_the_model(friction, delay, noise):
    loop, _ = dry_loop(4, friction, delay, noise)
    last = loop.u[-15:, 0]
    assert abs(loop.x[-1, 0]) < 0.1
    # the force does not change its side from sample to sample
    assert np.sum((last[1:] * last[:-1] < 0) & (np.minimum(abs(last[1:]), abs(last[:-1])) > 0.8)) <= 1


def test_the_page_runs(monkeypatch):
    """The code of docs/nmpc.md, as a reader would type it."""
    page = Path(__file__).resolve().parents[3] / "docs" / "nmpc.md"
    if not page.exists():
        pytest.skip("the documentation is not part of this package")
    monkeypatch.setattr(swb.nmpc.ClosedLoop, "plot", lambda *_: None)
    names = {"__name__": "page"}
    blocks = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.S)
    assert len(blocks) >= 3
    for block in blocks:
        # a busy machine may take a millisecond away
        exec(compile(block.replace("deadline=1e-3", "deadline=1.0"), str(page), "exec"), names)
    assert abs(names["x"][0]) < 0.02 and names["info"].source is swb.NmpcSource.QP


def test_preparations_on_a_thread_change_nothing():
    m = integrator()
    with swb.Nmpc(problem(m), "as_rti") as plain, swb.Nmpc(problem(m), "as_rti") as other:
        with pytest.raises(swb.StateError):
            other.wait()
        x = np.array([0.4, -0.1])
        for k in range(10):
            plain.prepare()
            assert other.prepare_async()
            if k % 2:
                assert other.wait().ready
            u, v = plain.feedback(x)[0], other.feedback(x)[0]
            assert u == v
            x = x + H * np.array([x[1], u[0]])
        # functions in Python are called by the thread that calls the library
        calls = []

    def rates(x, u):
        calls.append(threading.get_ident())
        return [x[1], u[0]]

    system = swb.System(2, 1)
    system.set_f0(swb.Function(rates, 2, 1, n_out=2, trace=False))
    ocp = swb.Ocp(system, N * H, N, rk_family="explicit", n_s=4, n_fe=1, control_bounds=(-1, 1))
    ocp.add_least_squares(swb.Function(lambda x, u: [x[0], x[1], u[0]], 2, 1, n_out=3), [2, 0.5, 0.3], np.zeros(3))
    with swb.Nmpc(ocp) as c:
        calls.clear()
        assert c.prepare_async()
        assert calls and set(calls) == {threading.get_ident()}
        assert c.wait().ready
