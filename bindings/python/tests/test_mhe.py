"""Moving horizon estimation against references that the library did not compute."""

import numpy as np
import pytest
from scipy import linalg, optimize

import switchback_control as swb

H = 0.1


def rk4(f, x, u):
    a = np.array(f(x, u))
    b = np.array(f(x + H / 2 * a, u))
    c = np.array(f(x + H / 2 * b, u))
    return x + H / 6 * (a + 2 * b + 2 * c + np.array(f(x + H * c, u)))


def estimator(f, y, n, x0, *, nu=1, bounds=None, **options):
    """A window of n samples; f(x, u, module) and y(x, module) are rates and measurements."""
    m = swb.Model(len(x0), nu)
    x, u = list(m.x), list(m.u)
    m.derivatives = f(x, u, swb)
    ocp = swb.Ocp(m, n * H, n)
    ocp.set_initial_state(x0)
    if bounds is not None:
        ocp.set_state_bounds(*bounds)
    return swb.Mhe(ocp, m.function(y(x, swb)), rk_family="explicit", n_s=4, steps=1, **options)


class Full:
    """All samples at once: states before the first measurement and noise of every stage, by scipy."""

    def __init__(self, f, y, x0, initial, process, measurement):
        self.f, self.y, self.x0 = (lambda x, u: f(x, u, np)), (lambda x: np.array(y(x, np))), np.array(x0, float)
        self.initial, self.process, self.measurement = (np.array(v, float) for v in (initial, process, measurement))
        self.noisy = np.flatnonzero(self.process)

    def states(self, z, us):
        x = self.x0 + self.initial * z[: len(self.x0)]
        out = [x]
        w = z[len(self.x0) :].reshape(len(us), len(self.noisy))
        for u, own in zip(us, w):
            x = rk4(self.f, x, u)
            x[self.noisy] += self.process[self.noisy] * own
            out.append(x)
        return np.array(out)

    def residuals(self, z, us, ys):
        gaps = [(y - self.y(x)) / self.measurement for x, y in zip(self.states(z, us), ys)]
        gaps = np.concatenate(gaps)
        return np.concatenate([z, gaps[np.isfinite(gaps)]])

    def solve(self, us, ys, start=None):
        z = np.zeros(len(self.x0) + len(us) * len(self.noisy)) if start is None else start
        found = optimize.least_squares(self.residuals, z, args=(us, ys), xtol=1e-15, ftol=1e-15, gtol=1e-13)
        return self.states(found.x, us)


def record(f, y, x0, us, measurement, seed, process=None, lost=()):
    r = np.random.default_rng(seed)
    x, ys, xs = np.array(x0, float), [], []
    for k in range(len(us) + 1):
        xs.append(x)
        ys.append(np.array(y(x, np)) + np.array(measurement) * r.standard_normal(len(measurement)))
        if k in lost:
            ys[-1][:] = np.nan
        if k < len(us):
            x = rk4(lambda x, u: f(x, u, np), x, us[k])
            if process is not None:
                x = x + np.array(process) * r.standard_normal(len(x))
    return np.array(xs), ys


def play(mhe, us, ys):
    out = []
    for k, y in enumerate(ys):
        if k:
            mhe.prepare(us[k - 1])
        out.append(mhe.estimate(y)[0])
    return np.array(out)


def pendulum(x, u, m):
    return [x[1], u[0] - 4.0 * m.sin(x[0]) - x[2] * x[1], 0.0 * x[2]]


def angle(x, m):
    return [m.sin(x[0]), m.cos(x[0])]


PENDULUM = dict(initial=[0.5, 0.5, 0.5], process=[0.0, 0.02, 0.0], measurement=[0.05, 0.05])


def reaction(x, u, m):
    """2 A -> B and back, in partial pressures (E. Haseltine, J. Rawlings, 2005)."""
    rate = 0.16 * x[0] * x[0] - 0.0064 * x[1]
    return [-2.0 * rate, rate]


def pressure(x, m):
    return [x[0] + x[1]]


REACTION = dict(initial=[3.0, 3.0], process=[0.01, 0.01], measurement=[0.1])


def forces(count):
    return [np.array([2.0 * np.sin(0.4 * k)]) for k in range(count)]


def test_a_pendulum_with_unknown_damping():
    us = forces(60)
    xs, ys = record(pendulum, angle, [0.8, 0.0, 0.3], us, PENDULUM["measurement"], 1, [0, 0.02, 0], lost=(7, 8, 30))
    start = [0.5, 0.3, 0.6]
    full = Full(pendulum, angle, start, *PENDULUM.values()).solve(us, ys)
    # a window that is as long as the record is the full information
    with estimator(pendulum, angle, 60, start, iterations=50, tol=1e-12, **PENDULUM) as mhe:
        found = play(mhe, us, ys)
        np.testing.assert_allclose(mhe.states, full, atol=1e-7)
        whole = found[-1]
        assert mhe.noise.shape == (60, 1) and mhe.states.shape == (61, 3)
        # its covariance is the inverse of the matrix of the normal equations, by differences
        own = Full(pendulum, angle, start, *PENDULUM.values())
        z = np.concatenate([(mhe.states[0] - start) / PENDULUM["initial"], mhe.noise.ravel() / 0.02])
        jac = optimize._numdiff.approx_derivative(own.residuals, z, args=(us, ys), method="3-point")
        last = optimize._numdiff.approx_derivative(lambda z: own.states(z, us)[-1], z, method="3-point")
        np.testing.assert_allclose(mhe.covariance, last @ np.linalg.solve(jac.T @ jac, last.T), rtol=1e-4, atol=1e-9)
    # one iteration per sample with a short window is as good as what it knows
    with estimator(pendulum, angle, 10, start, **PENDULUM) as mhe:
        short = play(mhe, us, ys)[-1]
        deviations = np.sqrt(np.diag(mhe.covariance))
    assert np.all(np.abs(short - whole) < 0.3 * deviations)
    assert abs(short[2] - 0.3) < 4.0 * deviations[2] < 0.4


def test_a_reaction_with_bounds():
    """Without bounds the partial pressures of this reactor may become negative; the estimate with them is that of all samples."""
    us = [np.zeros(0)] * 40
    start = [0.1, 4.5]
    xs, ys = record(reaction, pressure, [3.0, 1.0], us, REACTION["measurement"], 3)
    options = dict(nu=0, bounds=([0.0, 0.0], [np.inf, np.inf]), **REACTION)
    with estimator(reaction, pressure, 40, start, iterations=100, tol=1e-12, **options) as mhe:
        play(mhe, us, ys)
        states = mhe.states
    own = Full(reaction, pressure, start, *REACTION.values())

    def cost(z):
        return 0.5 * np.sum(own.residuals(z, us, ys) ** 2)

    z = np.concatenate([(states[0] - start) / REACTION["initial"], ((states[1:] - np.array([rk4(lambda x, u: reaction(x, u, np), x, u) for x, u in zip(states, us)])) / 0.01).ravel()])
    np.testing.assert_allclose(own.states(z, us), states, atol=1e-9)
    assert np.all(states > -1e-8)
    # scipy finds nothing better from there, nor from the truth
    for begin in (z, np.concatenate([(xs[0] - start) / REACTION["initial"], np.zeros(80)])):
        found = optimize.least_squares(own.residuals, begin, args=(us, ys), xtol=1e-14, ftol=1e-14)
        inside = np.all(own.states(found.x, us) > 0)
        assert not inside or cost(z) <= found.cost * (1 + 1e-6)
    with estimator(reaction, pressure, 10, start, iterations=3, **options) as mhe:
        estimates = play(mhe, us, ys)
    assert np.all(estimates > -1e-9) and np.all(np.abs(estimates[-1] - xs[-1]) < 0.2)


def test_a_linear_system_has_the_kalman_filter():
    a = np.array([[0.0, 1.0], [-2.0, -0.3]])
    phi = linalg.expm(a * H)
    phi4 = sum(np.linalg.matrix_power(a * H, k) / np.prod(range(1, k + 1)) for k in range(5))
    assert abs(phi - phi4).max() < 1e-6
    f, y = (lambda x, u, m: [x[1], -2.0 * x[0] - 0.3 * x[1]]), (lambda x, m: [x[0]])
    noise = dict(initial=[1.0, 1.0], process=[0.02, 0.05], measurement=[0.1])
    us = [np.zeros(0)] * 50
    _, ys = record(f, y, [1.0, 0.5], us, [0.1], 5, [0.02, 0.05], lost=(3, 20, 21))
    with estimator(f, y, 5, [0.0, 0.0], nu=0, **noise) as mhe:
        found = play(mhe, us, ys)
        covariance = mhe.covariance
    x, p, h = np.zeros(2), np.eye(2), np.array([[1.0, 0.0]])
    for k, y in enumerate(ys):
        if k:
            x, p = phi4 @ x, phi4 @ p @ phi4.T + np.diag([0.02, 0.05]) ** 2
        if np.isfinite(y[0]):
            gain = p @ h.T / (h @ p @ h.T + 0.01)
            x, p = x + gain @ (y - h @ x), p - gain @ h @ p
        np.testing.assert_allclose(found[k], x, atol=1e-10)
    np.testing.assert_allclose(covariance, p, atol=1e-10)


def test_a_controller_with_an_estimator():
    """A mass under an unknown load, of which the position alone is seen: the controller is told of the load and gets to the goal."""
    n = 20
    m = swb.Model(states="q v", controls="u", parameters="load")
    q, v, u, load = m.x[0], m.x[1], m.u[0], m.p[0]
    m.derivatives = [v, u - load]
    ocp = swb.Ocp(m, n * H, n, params=[0.0], control_bounds=(-3, 3))
    ocp.set_initial_state([0.0, 0.0])
    ocp.add_least_squares(m.function([q, v, u - load]), [1.0, 0.1, 0.05], [1.0, 0.0, 0.0])
    ocp.add_least_squares(m.function([q, v]), [10.0, 1.0], [1.0, 0.0], at="terminal")

    def run(told):
        f, y = (lambda x, u, m: [x[1], u[0] - x[2], 0.0 * x[2]]), (lambda x, m: [x[0]])
        noise = dict(initial=[0.1, 0.5, 2.0], process=[0.0, 0.01, 0.01], measurement=[0.002])
        with swb.Nmpc(ocp, "rti") as c, estimator(f, y, 10, [0.0, 0.0, 0.0], **noise) as mhe:
            r = np.random.default_rng(2)
            tell = (lambda c, k, t: c.set_params([mhe.states[-1][2]])) if told else None
            return swb.closed_loop(
                c, lambda x, u, p, t: rk4(lambda x, u: np.array([x[1], u[0] - 1.2]), x, u), [0.0, 0.0], 60,
                measure=lambda x, t: [x[0] + 0.002 * r.standard_normal()], estimator=mhe, before=tell,
            )  # fmt: skip

    loop, blind = run(True), run(False)
    assert loop.estimates.shape == (60, 3) and loop.measured.shape == (60, 1)
    assert abs(loop.estimates[-1, 2] - 1.2) < 0.05
    assert abs(loop.x[-1, 0] - 1.0) < 0.02 < 0.1 < abs(blind.x[-1, 0] - 1.0)


def test_what_is_wrong_is_said():
    f, y = (lambda x, u, m: [x[1], u[0]]), (lambda x, m: [x[0]])
    noise = dict(initial=1.0, process=0.0, measurement=[0.1])
    with estimator(f, y, 5, [0.0, 0.0], **noise) as mhe:
        with pytest.raises(swb.DimensionError, match="measurements"):
            mhe.estimate([0.0, 1.0])
        mhe.estimate([0.0])
        with pytest.raises(swb.StateError, match="prepare"):
            mhe.estimate([0.0])
        with pytest.raises(swb.DimensionError):
            mhe.prepare([0.0, 0.0])
        assert mhe.nw == 0 and mhe.noise.shape == (0, 0)
    with pytest.raises(swb.RangeError, match="positive"):
        estimator(f, y, 5, [0.0, 0.0], initial=0.0, process=0.0, measurement=[0.1])
    with pytest.raises(swb.ArgumentError):
        swb.Mhe(None, None, initial=1.0, process=1.0, measurement=1.0)
    m = swb.Model(2, 1)
    m.derivatives = [m.x[1], m.u[0]]
    ocp = swb.Ocp(m, 1.0, 5)
    with pytest.raises(swb.StateError, match="initial state"):
        swb.Mhe(ocp, m.function([m.x[0]]), initial=1.0, process=0.0, measurement=0.1)
    ocp.set_initial_state([0.0, 0.0])
    ocp.add_least_squares(m.function([m.x[0]]), [1.0])
    with pytest.raises(swb.UnsupportedError, match="costs"):
        swb.Mhe(ocp, m.function([m.x[0]]), initial=1.0, process=0.0, measurement=0.1)


def heights(e, samples, r, sigma=1e-3):
    """What is measured of a ball that falls from a height of one metre on a floor, exactly but for noise: parabolas and their bounces."""
    g, t, v, y, out = 9.81, 0.0, 0.0, 1.0, []
    for k in range(samples):
        left = k * H - t
        while (hit := (v + np.sqrt(v * v + 2 * g * y)) / g) <= left:
            v, y, left, t = -e * (v - g * hit), 0.0, left - hit, t + hit
        out.append(y + v * left - g * left**2 / 2 + sigma * r.standard_normal())
    return np.array(out)


def ball_with_a_contact():
    """A restitution may depend on coordinates: it is one that does not move."""
    s = swb.Scene("y e", name="ball")
    s.inertia([1.0, 1.0])
    s.force([-9.81, 0.0])
    s.contact("floor", gap=s.q[0], e=s.q[1])
    return s, s.q[0], ("y", "e", "v", "rest")


def ball_with_a_transition():
    m = swb.Model(states="y v e", name="ball")
    y, v, e = m.x
    m.derivatives = [v, -9.81 + 0 * y, 0 * e]
    m.transition(y < 0, reset={v: -e * v})
    return m, y, ("y", "v", "e")


@pytest.mark.parametrize("ball", [ball_with_a_contact, ball_with_a_transition])
@pytest.mark.parametrize("e", [0.65, 0.8, 0.9])
def test_the_restitution_of_a_ball_that_bounces(ball, e):
    model, height, names = ball()
    ocp = swb.Ocp(model, 6 * H, 6, settings={"rtol": 1e-8, "atol": 1e-10})
    start, initial, process = {"y": 1.0, "e": 0.75}, {"y": 1e-2, "v": 1e-2, "e": 0.1, "rest": 1e-9}, {"v": 1e-3}
    ocp.set_initial_state([start.get(n, 0.0) for n in names])
    ocp.set_state_bounds([0.1 if n == "e" else -np.inf for n in names], [1.0 if n == "e" else np.inf for n in names])
    deviations = {"initial": [initial[n] for n in names], "process": [process.get(n, 0.0) for n in names], "measurement": 1e-3}
    with swb.Mhe(ocp, model.function([height]), iterations=5, **deviations) as mhe:
        found, sources = [], set()
        for k, y in enumerate(heights(e, 21, np.random.default_rng(3))):
            if k:
                mhe.prepare([])
            x, info = mhe.estimate([y])
            found.append(x[names.index("e")])
            sources.add(info.source)
        # nothing is known before the first bounce, after 0.45 s
        assert np.allclose(found[:5], 0.75, atol=1e-6)
        assert abs(found[-1] - e) < 5e-3 and abs(found[8] - e) < 2e-2, found
        assert sources <= {swb.NmpcSource.QP}


def test_discrete_states_have_no_deviations():
    m = swb.Model(states="level on", name="relay")
    m.derivatives = [1 - m.x[0], 0 * m.x[1]]
    m.transition(m.x[0] > 0.5, when={m.x[1]: 0}, to={m.x[1]: 1})
    ocp = swb.Ocp(m, 1.0, 5)
    ocp.set_initial_state([0.0, 0.0])
    with pytest.raises(swb.UnsupportedError, match="discrete states"):
        swb.Mhe(ocp, m.function([m.x[0]]), initial=1.0, process=0.0, measurement=0.1)
