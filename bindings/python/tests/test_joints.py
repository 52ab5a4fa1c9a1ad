"""Dry friction at joints, contacts that stick by more than they slide with, and constraints."""

import numpy as np
import pytest

import switchback_control as swb
from switchback_control import ContactMode, cos, sin, sqrt

TIGHT = {"rtol": 1e-11, "atol": 1e-11}
G = 9.81


def slider(force=None, np_=1, **friction):
    s = swb.Scene("x", p=np_, name="slider")
    s.force([-s.q[0] if force is None else force(s)])
    s.friction("guide", s.q[0], **{"bound": s.p[0] if np_ else 0.1, **friction})
    return s


def test_half_turns_lose_twice_the_friction():
    """x'' = -x -+ F: turns after pi, with amplitudes 1, 0.7, 0.4, 0.1; there the spring is weaker than the friction."""
    run = slider().simulate([1.0], [0.0], 20.0, p=[0.15], sensitivity=True, **TIGHT)
    assert run.x_end == pytest.approx([-0.1, 0.0], abs=1e-9)
    assert [s.t for s in run.switches] == pytest.approx([np.pi, 2 * np.pi, 3 * np.pi], abs=1e-9)
    assert run.dx_dx0[0] == pytest.approx([-1.0, 0.0], abs=1e-8)
    assert run.dx_dp[0] == pytest.approx([6.0], abs=1e-7)
    assert run.mode("guide", [1.0, 4.0, 15.0]).tolist() == [
        ContactMode.SLIDES_BACK,
        ContactMode.SLIDES,
        ContactMode.CLOSED,
    ]
    assert run.force("guide", [1.0, 4.0, 15.0]) == pytest.approx(np.array([[0, 0.15], [0, -0.15], [0, -0.1]]), abs=1e-9)


def stick_slip(f, f_s, v, n):
    """Times at which a mass starts and stops that a spring pulls whose end moves with v."""
    slide, out = 2 * np.pi - 2 * np.arctan((f_s - f) / v), [f_s / v]
    for k in range(1, 2 * n):
        out.append(out[-1] + (slide if k % 2 else 2 * (f_s - f) / v))
    return np.array(out)


def pulled(s):
    return 0.5 * s.t - s.q[0]


def test_stick_slip():
    f, f_s = 0.6, 1.0
    s = slider(pulled, stiction=f_s, bound=f)
    run = s.simulate([0.0], [0.0], 20.0, p=[0.0], **TIGHT)
    times = stick_slip(f, f_s, 0.5, 5)
    assert [w.t for w in run.switches] == pytest.approx(times[times < 20], abs=1e-8)
    # the friction of a contact
    s = swb.Scene("x y", name="block")
    s.force([pulled(s), -1.0])
    s.contact("floor", gap=s.q[1], tangents=s.q[0], mu=f, mu_s=f_s)
    run = s.simulate([0, 0], [0, 0], 20.0, **TIGHT)
    assert [w.t for w in run.switches] == pytest.approx(times[times < 20], abs=1e-8)
    steps = s.simulate_steps([0, 0], [0, 0], 9.0, h=1e-3)
    assert steps.x[-1] == pytest.approx(run(9.0), abs=5e-3)


def test_a_rod_is_a_pendulum():
    """A point on a rod: at the bottom after a quarter of the period, 4 K(sin(a/2)), which the arithmetic-geometric mean gives."""
    a0 = 2.0
    s = swb.Scene("x y", p="g", name="rod")
    x, y = s.q
    s.force([0.0, -s.p[0]])
    rod = s.constraint("rod", sqrt(x * x + y * y) - 1.0)
    one, m = 1.0, np.cos(a0 / 2)
    for _ in range(8):
        one, m = (one + m) / 2, np.sqrt(one * m)
    quarter = np.pi / (2 * one) / np.sqrt(G)
    start = [np.sin(a0), -np.cos(a0)]
    run = s.simulate(start, [0, 0], 4 * quarter, p=[G], sensitivity=True, **TIGHT)
    speed = np.sqrt(2 * G * (1 - np.cos(a0)))
    assert run(quarter) == pytest.approx([0, -1, -speed, 0], abs=1e-7)
    assert run(4 * quarter) == pytest.approx([*start, 0, 0], abs=1e-7)
    # the rod pulls: g (3 cos a - 2 cos a0)
    assert run.force(rod, [quarter])[0] == pytest.approx([-G * (3 - 2 * np.cos(a0))], abs=1e-6)
    assert run.mode(rod, [0.1, 1.0]).tolist() == [ContactMode.CLOSED] * 2


def test_a_skate_on_a_slope():
    """phi = w t, speed g/w sin(w t): x = g/(2 w^2) sin^2, y = g/(2 w^2) (w t - sin(2 w t)/2)."""
    w, g, t = 1.3, 2.0, 4.0
    s = swb.Scene("x y phi", name="skate")
    vx, vy, _ = s.v
    s.force([g, 0.0, 0.0])
    s.constraint("edge", sin(s.q[2]) * vx - cos(s.q[2]) * vy)
    run = s.simulate([0, 0, 0], [0, 0, w], t, **TIGHT)
    c = g / (2 * w * w)
    assert run.x_end[:3] == pytest.approx([c * np.sin(w * t) ** 2, c * (w * t - 0.5 * np.sin(2 * w * t)), w * t], abs=1e-8)


NONSENSE = {
    "negative bound": (lambda: slider(bound=-0.1).system(), swb.RangeError, "must not be negative"),
    "bound nan": (lambda: slider(bound=float("nan")).system(), swb.SwitchbackError, "nan|NaN|negative"),
    "sticks by less": (lambda: slider(bound=0.2, stiction=0.1).system(), swb.RangeError, "must not be less"),
    "bound text": (lambda: slider(bound="a"), swb.ArgumentError, "expression or a number"),
    "bound none": (lambda: slider(bound=None), swb.ArgumentError, "expression or a number"),
    "bound list": (lambda: slider(bound=[0.1, 0.2]), swb.DimensionError, "shape"),
    "no name": (lambda: slider().friction("", 1.0, 1.0), swb.ArgumentError, "must be a text"),
    "nothing slides": (lambda: _with(lambda s: s.friction("b", 1.0, 1.0)).system(), swb.RangeError, "does not depend"),
    "not linear": (lambda: _with(lambda s: s.friction("b", s.v[0] ** 2, 1.0)).system(), swb.RangeError, "linear"),
    "twice": (lambda: _with(lambda s: s.friction("guide", s.q[0], 1.0)), swb.StateError, "name of its own"),
    "contact without tangents": (
        lambda: _with(lambda s: s.contact("floor", s.q[0], mu_s=0.3)),
        swb.ArgumentError,
        "cannot stick",
    ),
    "mu_s below mu": (
        lambda: _with(lambda s: s.contact("floor", s.q[0], tangents=2 * s.q[0], mu=0.4, mu_s=0.3)).system(),
        swb.RangeError,
        "must not be less",
    ),
    "constraint that is not linear": (
        lambda: _with(lambda s: s.constraint("c", s.v[0] ** 2)).system(),
        swb.RangeError,
        "must be linear",
    ),
    "constraint of nothing": (lambda: _with(lambda s: s.constraint("c", s.t)).system(), swb.RangeError, "does not depend"),
    "constraint text": (lambda: _with(lambda s: s.constraint("c", "x")), swb.ArgumentError, "expression or a number"),
    "wrong start": (
        lambda: _with(lambda s: s.constraint("c", s.q[0] - 1.0)).simulate([0.5], [0.0], 1.0, p=[0.1]),
        swb.RangeError,
        "not satisfied at the start",
    ),
    "wrong speed": (
        lambda: _with(lambda s: s.constraint("c", s.q[0] - 1.0)).simulate([1.0], [0.1], 1.0, p=[0.1]),
        swb.RangeError,
        "not satisfied at the start",
    ),
    "time-freezing": (lambda: slider(np_=0, bound=0.1).freeze(), swb.UnsupportedError, "guide"),
}


def _with(change):
    s = slider()
    change(s)
    return s


def _plain(change):
    s = swb.Scene("x")
    s.force([0.0])
    change(s)
    return s


@pytest.mark.parametrize("what", NONSENSE)
def test_nonsense(what):
    call, error, words = NONSENSE[what]
    with pytest.raises(error, match=words):
        call()


def test_a_scene_survives_what_it_refuses():
    s = slider()
    first = s.simulate([1.0], [0.0], 20.0, p=[0.15])
    for call in (
        lambda: s.friction("guide", s.q[0], 1.0),
        lambda: s.constraint("guide", s.q[0]),
        lambda: s.contact("guide", s.q[0]),
        lambda: s.bounds("x", 1.0, 0.0),
    ):
        with pytest.raises(swb.SwitchbackError):
            call()
        assert s.simulate([1.0], [0.0], 20.0, p=[0.15]).x_end == pytest.approx(first.x_end, abs=0)


def test_a_negative_bound_ends_the_run():
    with pytest.raises(swb.RangeError, match="must not be negative"):
        slider().simulate([0.0], [1.0], 1.0, p=[-1.0])
    s = swb.Scene("x", name="slider")
    s.force([0.0])
    s.friction("guide", s.q[0], 0.1 - s.t)
    with pytest.raises(swb.StateError, match="must not be negative"):
        s.simulate([0.0], [1.0], 1.0)


def test_a_run_of_joints_is_saved(tmp_path):
    run = slider().simulate([1.0], [0.0], 20.0, p=[0.15])
    run.save(tmp_path / "run.npz")
    again = swb.load(tmp_path / "run.npz")
    assert again.x_end == pytest.approx(run.x_end)


def motor():
    s = swb.Scene("angle", u="U", states="current", name="motor")
    s.inertia([0.3])
    s.force([0.7 * s.current])
    s.state_rates([(s.U - 0.5 * s.current - 0.7 * s.v[0]) / 0.2])
    s.friction("bearing", s.q[0], 1.1)
    return s


def test_a_motor_breaks_away():
    """i = U/R (1 - exp(-R t/L)) until 0.7 i = 1.1."""
    run = motor().simulate([0.0], [0.0], 1.5, states=[0.0], u=[2.0], **TIGHT)
    assert run.switches[0].t == pytest.approx(-0.4 * np.log(1 - 1.1 * 0.5 / (0.7 * 2.0)), abs=1e-9)
    steps = motor().simulate_steps([0.0], [0.0], 1.5, h=1e-3, states=[0.0], u=[2.0])
    assert steps.x[-1] == pytest.approx(run.x_end, abs=5e-3)
    assert steps.v.shape == (len(steps.t), 1) and steps.states[-1] == pytest.approx(run.x_end[2:], abs=5e-3)
    assert run["current"][-1] == run.x_end[2]


def test_states_are_refused_where_they_do_not_belong():
    s = motor()
    with pytest.raises(swb.DimensionError, match="states"):
        s.simulate([0.0], [0.0], 1.0, u=[2.0])
    with pytest.raises(swb.DimensionError, match="shape"):
        s.state_rates([0.0, 1.0])
    s.constraint("wrong", s.q[0] - s.current)
    with pytest.raises(swb.RangeError, match="depends on states beside"):
        s.system()
    s = swb.Scene("x", states=1)
    s.force([0.0])
    with pytest.raises(swb.StateError, match="no rate of"):
        s.system()


def test_states_have_a_drawing_of_their_own(tmp_path):
    run = motor().simulate([0.0], [0.0], 1.5, states=[0.0], u=[2.0])
    run.save(tmp_path / "run.npz")
    for r in (run, swb.load(tmp_path / "run.npz")):
        labels = [ax.get_ylabel() for ax in r.plot().axes]
        assert "states" in labels and "velocities" in labels
