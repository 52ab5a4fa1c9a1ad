"""Scenes: references, derivatives against differences, forces and momentum, and what is refused and in which words."""

import json
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import switchback_control as swb
from switchback_control import ContactMode, ImpactKind, cos, sign, sin, sqrt

G = 9.81
TIGHT = {"rtol": 1e-12, "atol": 1e-13}
SCENES = Path(__file__).resolve().parents[3] / "tests" / "data" / "reference" / "scenes"


def reference(name):
    """A file of solutions that were found without this library."""
    return json.loads((SCENES / name).read_text())


def numbers(value):
    """All numbers of a list of texts, in its shape."""
    return np.array(value, dtype=float)


def ball(**contact):
    s = swb.Scene("y", name="ball")
    s.force([-G])
    s.contact("floor", gap=s.q[0], **contact)
    return s


def slider(mu=0.35):
    """A point on a rough floor with a horizontal force."""
    s = swb.Scene("x y", u="f", p="mu", name="slider")
    s.force([s.u[0], -G])
    s.contact("floor", gap=s.q[1], tangents=s.q[0], mu=s.p[0])
    return s


def two():
    s = swb.Scene("x y", name="two")
    s.force([0.0, -G])
    return s


# --- against closed forms -------------------------------------------------------------------------------


def test_a_ball_bounces_to_rest():
    e, first = 0.5, np.sqrt(2.0 / G)
    run = ball(e=e).simulate([1.0], [0.0], 2.0, sensitivity=True, **TIGHT)
    t, speed = first, G * first
    for i in run.impacts[:8]:
        assert i.t == pytest.approx(t, abs=1e-12) and i.rate_before == pytest.approx(-speed, abs=1e-11)
        assert i.rate_after == pytest.approx(e * speed, abs=1e-11) and i.normal == pytest.approx((1 + e) * speed)
        assert (i.contact, i.name, i.kind, i.tangential) == (0, "floor", ImpactKind.COLLISION, ())
        assert i.unique and not i.simultaneous and i.depth == pytest.approx(speed**2 / (2 * G))
        speed *= e
        t += 2 * speed / G
    assert run.impacts[-1].kind == ImpactKind.LAST
    assert run.accumulations[0].t == pytest.approx(first * (1 + e) / (1 - e), abs=1e-6)
    assert run.impact_derivatives[0] == pytest.approx([0.5 * first, 1 / G], abs=1e-12)
    assert run.impact_derivatives.shape == (len(run.impacts), 2)
    assert run.mode("floor", [0.1, 1.9]).tolist() == [ContactMode.OPEN, ContactMode.CLOSED]
    assert run.force("floor", [0.1, 1.9]) == pytest.approx(np.array([[0.0], [G]]), abs=1e-12)
    assert run.one_sided and not run.redundant
    assert run.x_end == pytest.approx([0.0, 0.0], abs=1e-12)


def test_derivatives_of_a_slider():
    """It falls, slides, sticks: state and derivatives of the reference; the impact takes along the friction."""
    r = reference("particle_slide_stop_stick.json")
    x0 = numbers(r["params"]["x0"])
    run = slider().simulate(x0[:2], x0[2:], 2.0, p=[0.35], u=[1.0], sensitivity=True, **TIGHT)
    assert run.x_end == pytest.approx(numbers(r["x_T"]), abs=1e-11)
    assert run.dx_dx0 == pytest.approx(numbers(r["dxT_dx0"]), abs=1e-10)
    i, want = run.impacts[0], r["impacts"][0]
    assert [i.t, i.normal, *i.tangential] == pytest.approx(numbers([want[k] for k in ("t", "Lambda_n", "Lambda_t")]))
    assert run.mode("floor", [0.1, 0.9, 1.9]).tolist() == [ContactMode.OPEN, ContactMode.SLIDES, ContactMode.CLOSED]
    normal, friction = run.force("floor", [0.9, 1.9]).T
    assert normal == pytest.approx([G, G]) and friction == pytest.approx([-0.35 * G, -1.0])


@pytest.mark.parametrize("column", ["mu", "f"])
def test_derivatives_with_respect_to_inputs(column):
    def run(mu, f):
        return slider().simulate([0, 1.3], [3, -0.5], 1.0, p=[mu], u=[f], sensitivity=True, **TIGHT)

    d = 1e-6
    own = run(0.35, 1.0)
    if column == "mu":
        derivative, up, down = own.dx_dp[:, 0], run(0.35 + d, 1.0), run(0.35 - d, 1.0)
    else:
        derivative, up, down = own.dx_du[:, 0], run(0.35, 1.0 + d), run(0.35, 1.0 - d)
    assert np.max(np.abs(derivative)) > 0.1
    assert derivative == pytest.approx((up.x_end - down.x_end) / (2 * d), abs=1e-7)
    times = own.impact_derivatives[0][4 + (column == "f")]
    assert times == pytest.approx((up.impacts[0].t - down.impacts[0].t) / (2 * d), abs=1e-7)


def test_a_shaken_slope():
    r = reference("slope_sticks_between.json")
    angle, mu, f, w = (float(r[k]) for k in ("angle", "mu", "F", "w"))
    s = swb.Scene("s n")
    s.force([G * np.sin(angle) + f * sin(w * s.t), -G * np.cos(angle)])
    plane = s.contact("plane", s.q[1], [s.q[0]], mu=mu)
    x0 = numbers(r["x0"])
    run = s.simulate(x0[:2], x0[2:], float(r["T"]), sensitivity=True, **TIGHT)
    assert run.x_end == pytest.approx(numbers(r["x_T"]), abs=1e-10)
    assert run.dx_dx0 == pytest.approx(numbers(r["dxT_dx0"]), abs=1e-9)
    assert run.switch_times[-6:] == pytest.approx(numbers(r["events"])[1:], abs=1e-10)
    t = np.linspace(0.31, 3.99, 200)
    normal, friction = run.force(plane, t).T
    assert normal == pytest.approx(np.full(200, G * np.cos(angle)))
    sticks = run.mode(plane, t) == ContactMode.CLOSED
    assert 20 < sticks.sum() < 180
    assert np.all(np.abs(friction) <= mu * normal * (1 + 1e-12))
    assert friction[sticks] == pytest.approx(-(G * np.sin(angle) + f * np.sin(w * t[sticks])), abs=1e-9)


def test_balls_on_a_spring():
    r = reference("two_balls_spring.json")
    s = swb.Scene("a b")
    a, b = s.q
    spring = 1e4 * (b - a - 1.0)
    s.force([spring - G, -spring - G])
    s.contact("floor", a - 0.2, e=0.8)
    x0 = numbers(r["x0"])
    run = s.simulate(x0[:2], x0[2:], 1.0, sensitivity=True, **TIGHT)
    assert [i.t for i in run.impacts] == pytest.approx(numbers(r["impacts"]), abs=1e-11)
    assert run.x_end == pytest.approx(numbers(r["x_T"]), abs=1e-9)
    assert run.dx_dx0 == pytest.approx(numbers(r["dxT_dx0"]), abs=1e-7)
    assert run.impact_derivatives == pytest.approx(numbers(r["dtimes_dx0"]), abs=1e-9)


def test_a_table_is_left():
    r = reference("table_chatter.json")
    a, w, e = (float(r[k]) for k in ("A", "w", "e"))
    s = swb.Scene("y")
    s.force([-G])
    s.contact("table", s.q[0] - a * sin(w * s.t), e=e)
    x0 = numbers(r["x0"])
    run = s.simulate(x0[:1], x0[1:], float(r["T"]), rtol=1e-10, atol=1e-10)
    assert [i.t for i in run.impacts][:10] == pytest.approx(numbers(r["first_impacts"])[:10], abs=1e-9)
    assert run.accumulations[0].t == pytest.approx(float(r["log"][0][0]), abs=1e-8)
    assert run.switch_times[-1] == pytest.approx(float(r["log"][1][0]), abs=1e-8)
    assert run.x_end == pytest.approx(numbers(r["x_T"]), abs=1e-8)


def test_grazing():
    """Derivatives grow where an orbit hardly touches."""
    r = reference("grazing.json")
    z, f, w, e = (float(r[k]) for k in "zFwe")
    s = swb.Scene("x", p="stop")
    x, v = s.q[0], s.v[0]
    s.force([f * cos(w * s.t) - x - 2 * z * v])
    s.contact("stop", s.p[0] - x, e=e)
    x0 = numbers(r["x0_on_steady_state"])
    for row in r["rows"][:3]:
        depth = float(row["stop_below_amplitude"])
        at = float(r["steady_amplitude"]) - depth
        run = s.simulate(x0[:1], x0[1:], 6.0, p=[at], sensitivity=True, rtol=1e-13, atol=1e-14)
        assert run.impacts[0].t == pytest.approx(float(row["impacts"][0]), abs=1e-9)
        assert -run.impacts[0].rate_before == pytest.approx(float(row["v_minus"][0]), rel=1e-6)
        assert run.impacts[0].depth == pytest.approx(depth, rel=0.5)
        assert run.dx_dx0 == pytest.approx(numbers(row["dxT_dx0"]), rel=1e-5)
    missed = s.simulate(x0[:1], x0[1:], 6.0, p=[float(r["steady_amplitude"]) + 1e-3], **TIGHT)
    assert not missed.impacts


@pytest.mark.parametrize("case", ["3 equal e=1", "3 equal e=1/2", "masses 1,2,3 e=1", "masses 1,2,3 e=4/5"])
@pytest.mark.parametrize("law", ["newton", "sequential"])
def test_cradles(case, law):
    """Three balls, two of which touch: velocities behind the impact as rational numbers; momentum stays."""
    r = reference("cradle.json")["cases"][case]
    masses = [1.0, 2.0, 3.0] if case.startswith("masses") else [1.0] * 3
    e = float(Fraction(case.split("e=")[1]))
    s = swb.Scene(3)
    s.inertia(masses)
    s.force([0.0] * 3)
    for k in range(2):
        s.contact(f"{k}-{k + 1}", s.q[k + 1] - s.q[k] - 1.0, e=e)
    s.impact_law(law)
    run = s.simulate([-0.25, 1.0, 2.0], [1.0, 0.0, 0.0], 0.2501, **TIGHT)
    v = run.x_end[3:]
    assert v == pytest.approx([float(Fraction(c)) for c in r["newton_moreau" if law == "newton" else "pairwise_left_first"]])
    assert v @ masses == pytest.approx(masses[0])
    if law == "newton":
        struck = [i for i in run.impacts if i.normal > 1e-12]  # rounding may bring another about
        assert [i.normal for i in struck] == pytest.approx([float(Fraction(c)) for c in r["impulses"]])
        assert all(i.simultaneous for i in struck)


def test_a_puck_in_space():
    r = reference("cone_3d.json")
    mu, f, w = (float(r[k]) for k in ("mu", "F", "w"))
    s = swb.Scene("x y z", name="puck")
    s.force([f * cos(w * s.t), f * sin(w * s.t), -G])
    s.contact("floor", s.q[2], [s.q[0], s.q[1]], mu=mu)
    x0 = numbers(r["x0"])
    run = s.simulate(x0[:3], x0[3:], 1.0, **TIGHT)
    assert run.x_end == pytest.approx(numbers(r["x_T"]), abs=1e-9)
    i, log = run.impacts[0], r["log"][0]
    assert [i.t, i.normal, *i.tangential] == pytest.approx([float(log[0]), float(log[2]), *map(float, log[3])], abs=1e-9)
    slides = run.force("floor", np.linspace(0.3, 0.5, 9))
    assert np.hypot(slides[:, 1], slides[:, 2]) == pytest.approx(mu * slides[:, 0])
    assert run.force("floor", 0.9) == pytest.approx([G, -f * np.cos(w * 0.9), -f * np.sin(w * 0.9)], abs=1e-9)


def test_redundant_contacts_share():
    """Three legs in a row on one floor: the motion is unique, the forces are those of least norm."""
    s = swb.Scene("y phi", name="bench")
    s.inertia([2.0, 0.5])
    s.force([-2.0 * G, 0.0])
    for k in (-1, 0, 1):
        s.contact(f"leg {k}", s.q[0] + k * sin(s.q[1]))
    run = s.simulate([0.0, 0.0], [0.0, 0.0], 1.0)
    assert run.redundant and run.x_end == pytest.approx(np.zeros(4), abs=1e-12)
    forces = [run.force(c, 0.5)[0] for c in s.contacts]
    assert forces == pytest.approx([2.0 * G / 3] * 3, abs=1e-9)


def test_friction_of_painleve():
    """A rod that slides with too much friction stops without a collision."""
    s = swb.Scene("x y th", name="rod")
    x, y, th = s.q
    s.inertia([1.0, 1.0, 1.0 / 12.0])
    s.force([0.0, -G, 0.0])
    s.contact("end", y - 0.5 * cos(th), [x - 0.5 * sin(th)], mu=2.0)
    angle = 0.6
    run = s.simulate([0.0, 0.5 * np.cos(angle), angle], [-3.0, 0.0, 0.0], 0.05)
    if not run.impacts:  # the paradox needs the other direction
        run = s.simulate([0.0, 0.5 * np.cos(angle), angle], [3.0, 0.0, 0.0], 0.05)
    assert run.impacts[0].kind == ImpactKind.PAINLEVE and run.impacts[0].t == pytest.approx(0.0, abs=1e-9)
    assert run.impacts[0].normal > 0 and run.success


def test_rates_of_coordinates():
    """A coordinate with another scale: its rate is given."""
    s = swb.Scene("y", "v")
    s.rates([1000.0 * s.v[0]])  # millimetres
    s.force([-G])
    s.contact("floor", 1e-3 * s.q[0], e=1.0)
    run = s.simulate([1000.0], [0.0], 2.0 * np.sqrt(2.0 / G), **TIGHT)
    assert len(run.impacts) == 1 and run.x_end == pytest.approx([1000.0, 0.0], abs=1e-7)


def test_bounds_may_be_infinite():
    """One side is enough for a proof; nothing is known of the other."""
    inf = float("inf")
    s = two()
    s.contact("floor", s.q[1])
    s.contact("top", 10.0 - s.q[1])
    s.bounds("y", 0.0, inf)
    assert "left out" not in s.report()
    s.bounds("y", -inf, 5.0)
    assert [c["name"] for c in s.report_data()["contacts"]] == ["floor"]
    run = s.simulate([0.0, 1.0], [0.0, 0.0], 0.2)
    assert run.success
    with pytest.raises(swb.StateError, match="outside of the bounds"):
        s.simulate([0.0, 1.0], [0.0, 20.0], 2.0)
    s.bounds("y", -inf, inf)
    assert len(s.report_data()["contacts"]) == 2 and s.simulate([0.0, 1.0], [0.0, 11.0], 2.0).success


def test_friction_where_sliding_begins_in_space():
    """Just behind the end of sticking friction opposes the way it will go, although there is no velocity yet."""
    mu, push = 0.3, 4.0
    s = swb.Scene("x y z")
    growing = push * (1 - swb.exp(-s.t))
    s.force([growing * cos(3 * s.t), growing * sin(3 * s.t), -G])
    s.contact("table", s.q[2], [s.q[0], s.q[1]], mu=mu)
    run = s.simulate([0.0] * 3, [0.0] * 3, 3.0, **TIGHT)
    exact = -np.log(1 - mu * G / push)
    assert run.switch_times == pytest.approx([exact], abs=1e-11)
    before, behind = run.force("table", [run.switch_times[0], np.nextafter(run.switch_times[0], 9.0)])
    along = [np.cos(3 * exact), np.sin(3 * exact)]
    assert before == pytest.approx([G, -mu * G * along[0], -mu * G * along[1]], abs=1e-8)
    assert behind == pytest.approx(before, abs=1e-6)


def test_bounds_leave_contacts_out():
    s = two()
    floor = s.contact("floor", s.q[1])
    top = s.contact("top", 10.0 - s.q[1])
    s.bounds("y", -1.0, 5.0)
    assert [c["name"] for c in s.report_data()["contacts"]] == ["floor"]
    assert "left out: contact top" in s.report() and "at least 5" in s.report()
    run = s.simulate([0.0, 1.0], [0.0, 0.0], 0.2)
    assert run.force(floor, 0.1) == pytest.approx([0.0])
    with pytest.raises(swb.ArgumentError, match="no contact 'top'"):
        run.force(top)
    with pytest.raises(swb.StateError, match="outside of the bounds"):
        s.simulate([0.0, 1.0], [0.0, 20.0], 2.0)


# --- nonsense -------------------------------------------------------------------------------------------


def _inertia(values):
    s = two()
    s.inertia(values)
    s.contact("floor", s.q[1])
    return s.simulate([0, 1], [0, 0], 1)


def _contact(make, mu=0.3):
    s = two()
    s.contact("floor", *make(s), mu=mu)
    return s.system()


def _force(make):
    s = two()
    s.force(make(s))
    return s.system()


def _same():
    s = two()
    s.contact("floor", s.q[1])
    s.contact("ground", s.q[1])


def _name_twice():
    s = two()
    s.contact("floor", s.q[1])
    s.contact("floor", s.q[1] - 1)


def _parameter(value):
    s = swb.Scene("y", p="e")
    s.force([-G])
    s.contact("floor", s.q[0], e=s.p[0])
    return s.simulate([1], [0], 1, p=[value])


def _controlled():
    s = swb.Scene("y", u="f")
    s.force([-G])
    s.contact("floor", s.q[0] - s.u[0])
    return s.system()


def _foreign():
    a, b = ball(), ball()
    return a.simulate([1], [0], 1).force(b.contacts[0])


def _unforced():
    s = swb.Scene("x y")
    s.force([0.0])


def _no_force():
    return swb.Scene("x y").system()


def _rates():
    s = swb.Scene("x y", "v")
    s.force([0])
    return s.system()


def _bounds(*arguments):
    two().bounds(*arguments)


def _tangents_twice():
    s = swb.Scene("x y z")
    s.force([0, 0, -G])
    s.contact("floor", s.q[2], [s.q[0], s.q[0]], mu=0.3)
    return s.system()


def _run():
    return ball().simulate([1], [0], 1)


NONSENSE = {
    "M not symmetric": (lambda: _inertia([[1, 0.5], [0.2, 1]]), swb.RangeError, r"not symmetric: entry \(1, 0\) is 0.2"),
    "M indefinite": (lambda: _inertia([[1, 2], [2, 1]]), swb.RangeError, "inertia matrix is not positive definite"),
    "M negative": (lambda: _inertia([1, -1]), swb.RangeError, "inertia matrix is not positive definite"),
    "M of a wrong shape": (lambda: _inertia([1, 2, 3]), swb.DimensionError, r"\(2,\), a diagonal, or \(2, 2\)"),
    "e below 0": (lambda: _parameter(-0.1), swb.RangeError, "floor .* restitution -0.1 .*between 0 and 1"),
    "e above 1": (lambda: ball(e=1.1).system(), swb.RangeError, "restitution of contact floor is 1.1.*between 0 and 1"),
    "e not a number": (lambda: ball(e=np.nan).system(), swb.RangeError, "restitution of contact floor is NaN"),
    "mu below 0": (lambda: _contact(lambda s: (s.q[1], s.q[0]), -0.1), swb.RangeError, "friction of contact floor is -0.1"),
    "mu without tangents": (lambda: _contact(lambda s: (s.q[1],)), swb.ArgumentError, "friction and no tangents"),
    "overlap": (lambda: ball().simulate([-0.25], [0], 1), swb.RangeError, "gap of contact floor is -0.25 at the start"),
    "gap of velocities": (lambda: _contact(lambda s: (s.q[1] + s.v[0],), 0), swb.RangeError, "gap .*depends on velocities"),
    "gap of controls": (_controlled, swb.RangeError, "gap of contact floor, y - f, depends on velocities or controls"),
    "gap that is a number": (lambda: _contact(lambda s: (1.0,), 0), swb.RangeError, "does not depend on anything that moves"),
    "gap of time": (lambda: _contact(lambda s: (s.t,), 0), swb.RangeError, "does not depend on anything that moves"),
    "gap that is a text": (lambda: _contact(lambda s: ("y",), 0), swb.ArgumentError, "gap of contact floor .* not 'y'"),
    "gap that is an array": (lambda: _contact(lambda s: (s.q,), 0), swb.DimensionError, r"gap .* array of shape \(2,\)"),
    "gap that is a condition": (lambda: _contact(lambda s: (s.q[1] > 0,), 0), swb.RangeError, "floor is a condition"),
    "gap that switches": (lambda: _contact(lambda s: (abs(s.q[1]),), 0), swb.UnsupportedError, "gap .*switches where y"),
    "the same gap": (_same, swb.StateError, "ground has the gap of contact floor"),
    "the same name": (_name_twice, swb.StateError, "contact floor already"),
    "the same tangent": (_tangents_twice, swb.RangeError, "direction of the normal or of the other tangent"),
    "a tangent like the normal": (lambda: _contact(lambda s: (s.q[1], s.q[1])), swb.RangeError, "direction of the normal"),
    "a tangent that is not linear": (lambda: _contact(lambda s: (s.q[1], s.v[0] ** 2)), swb.RangeError, "must be linear"),
    "three tangents": (lambda: _contact(lambda s: (s.q[1], [s.q[0]] * 3)), swb.RangeError, "floor has 3 tangents"),
    "an array as tangent": (lambda: _contact(lambda s: (s.q[1], s.q)), swb.DimensionError, "list of single expressions"),
    "NaN in the state": (lambda: ball().simulate([np.nan], [0], 1), swb.RangeError, "state 0 is NaN"),
    "infinite state": (lambda: ball().simulate([1], [np.inf], 1), swb.RangeError, "state 1 is inf"),
    "forces missing": (_no_force, swb.StateError, "no force on v_x"),
    "too few forces": (_unforced, swb.DimensionError, r"force has shape \(1,\), expected \(2,\)"),
    "a condition as force": (lambda: _force(lambda s: [s.v[0] > 0, 0]), swb.DimensionError, "conditions and values"),
    "rates missing": (_rates, swb.StateError, "2 coordinates and 1 velocities"),
    "coordinates of one name": (lambda: swb.Scene("y y"), swb.ArgumentError, "two variables are called 'y'"),
    "a velocity like a coordinate": (lambda: swb.Scene("y", "y"), swb.ArgumentError, "two variables are called 'y'"),
    "no such coordinate": (lambda: _bounds("z", 0, 1), swb.ArgumentError, "'z' is no coordinate"),
    "bounds the wrong way round": (lambda: _bounds("x", 1, 0), swb.RangeError, "are 1 and 0: the lower comes first"),
    "bounds that are no numbers": (lambda: _bounds("x", np.nan, 0), swb.RangeError, "bounds .*NaN.*-inf or inf"),
    "bounds without a number between": (lambda: _bounds("x", np.inf, np.inf), swb.RangeError, "the lower comes first"),
    "no such law": (lambda: two().impact_law("poisson"), swb.ArgumentError, "newton, sequential, not 'poisson'"),
    "q0 too long": (lambda: ball().simulate([1, 2], [0], 1), swb.DimensionError, r"q0 has shape \(2,\)"),
    "v0 too short": (lambda: ball().simulate([1], [], 1), swb.DimensionError, r"v0 has shape \(0,\)"),
    "no such contact": (lambda: _run().mode("ground"), swb.ArgumentError, "no contact 'ground' in this run, only floor"),
    "no contact of this number": (lambda: _run().force(7), swb.DimensionError, "no contact 7"),
    "contact of another scene": (_foreign, swb.ArgumentError, "contact 'floor' is one of another scene"),
    "force behind the end": (lambda: _run().force("floor", 2.0), swb.RangeError, "2 is outside of the run"),
    "a gap that is negative at the start of a control problem": (
        lambda: swb.Ocp(ball(), 1.0, 4, initial_state=[-1.0, 0.0]).solve(),
        swb.RangeError,
        "the gap of contact floor is -1",
    ),
    "no such search for jumps": (lambda: swb.Ocp(ball(), 1.0, 4, jumps="magic"), swb.ArgumentError, "magic"),
    "finite elements": (lambda: swb.simulate_fesd(ball(), [1, 0], 1.0, 4), swb.UnsupportedError, "cannot follow contacts"),
    "undefined force": (lambda: _force(lambda s: [np.nan, 0]), swb.NonfiniteError, "NaN"),
}


@pytest.mark.parametrize("what", NONSENSE)
def test_nonsense(what):
    call, error, words = NONSENSE[what]
    with pytest.raises(error, match=words):
        call()


def test_nonsense_in_runs():
    s = swb.Scene("y")
    s.force([sqrt(s.q[0] - 2)])
    run = s.simulate([1], [0], 1)
    assert not run.success and "not defined" in run.reason
    bare = ball().simulate([1], [0], 1, dense=False)
    with pytest.raises(swb.StateError, match="dense"):
        bare.force("floor", 0.5)
    plain = swb.simulate(swb.System(1, f0=lambda x: -x), [1.0], 1.0)
    with pytest.raises(swb.ArgumentError, match="not that of a scene"):
        plain.mode(0)


def test_a_scene_survives_its_mistakes():
    """What is refused leaves the scene as it was."""
    s = ball(e=0.5)
    for call in (
        lambda: s.contact("top", s.v[0]),
        lambda: s.contact("floor", s.q[0]),
        lambda: s.force([1.0, 2.0]),
        lambda: s.bounds("y", 1.0, 0.0),
    ):
        try:
            call()
        except swb.SwitchbackError:
            pass
    try:
        s.system()
    except swb.RangeError as error:
        assert "top" in str(error)  # it is named until it is gone
    assert ball(e=0.5).simulate([1.0], [0.0], 0.6).impacts[0].name == "floor"


def test_everything_is_freed(live):
    before = live()
    s = ball(e=0.5)
    run = s.simulate([1.0], [0.0], 1.0)
    assert live() != before
    del run, s
    assert live() == before


def test_an_arm_by_its_energies():
    """Two links by inertia and potential: the equations of a textbook, and energy that is kept."""
    s = swb.Scene("a b", "va vb", u="torque")
    c = np.cos(s.q[1])
    height = 2.0 * np.sin(s.q[0]) + np.sin(s.q[0] + s.q[1])
    s.lagrange([[3.0 + 2.0 * c, 1.0 + c], [1.0 + c, 1.0]], potential=9.81 * height, force=[s.u[0], 0.0])
    run = s.simulate([0.3, 0.5], [0.0, 1.0], 2.0, u=[0.0], rtol=1e-10, atol=1e-11)
    q, v = run.x[:, :2], run.x[:, 2:]
    c = np.cos(q[:, 1])
    kinetic = 0.5 * ((3 + 2 * c) * v[:, 0] ** 2 + 2 * (1 + c) * v[:, 0] * v[:, 1] + v[:, 1] ** 2)
    energy = kinetic + 9.81 * (2 * np.sin(q[:, 0]) + np.sin(q[:, 0] + q[:, 1]))
    assert np.ptp(energy) < 1e-7
    # written out
    other = swb.Scene("a b", "va vb", u="torque")
    a, b = other.q
    va, vb = other.v
    c, d = np.cos(b), np.sin(b)
    other.inertia([[3.0 + 2.0 * c, 1.0 + c], [1.0 + c, 1.0]])
    g1, g2 = 9.81 * (2 * np.cos(a) + np.cos(a + b)), 9.81 * np.cos(a + b)
    other.force([other.u[0] + d * (2 * va * vb + vb**2) - g1, -d * va**2 - g2])
    same = other.simulate([0.3, 0.5], [0.0, 1.0], 2.0, u=[0.0], rtol=1e-10, atol=1e-11)
    assert same.x_end == pytest.approx(run.x_end, abs=1e-8)
    with pytest.raises(swb.DimensionError, match="q' = v"):
        swb.Scene("a b", "v").lagrange([1.0])
    diagonal = swb.Scene("x y")
    diagonal.lagrange([2.0, 1.0], potential=2.0 * diagonal.q[0])
    assert diagonal.simulate([0.0, 0.0], [0.0, 1.0], 1.0).x_end == pytest.approx([-0.5, 1.0, -1.0, 1.0])


def test_backlash():
    """A driven wheel takes another one with it once it has gone through the play, and the other way round."""
    s = swb.Scene("a b", u="torque")
    s.force([s.u[0], 0.0])
    lower, upper = s.backlash("teeth", s.q[0] - s.q[1], 0.2, e=0.0)
    run = s.simulate([0.0, 0.0], [0.0, 0.0], 2.0, u=[1.0], rtol=1e-10, atol=1e-11)
    hit = np.sqrt(0.2)  # where a is 0.1
    assert [(i.name, i.t) for i in run.impacts] == [("teeth upper", pytest.approx(hit, abs=1e-9))]
    together = 0.5 * hit + 0.5 * (2.0 - hit)
    assert run.x_end[2:] == pytest.approx([together, together], abs=1e-8)
    assert run.force(upper, 1.5)[0] == pytest.approx(0.5, abs=1e-9) and (lower.name, upper.name) == ("teeth lower", "teeth upper")
    back = s.simulate([0.0, 0.0], [0.0, 0.0], 2.0, u=[-1.0])
    assert back.impacts[0].name == "teeth lower"
    for width in (0.0, -1.0):
        with pytest.raises(swb.RangeError, match="positive"):
            s.backlash("more", s.q[0], width)


def test_what_rests_against_friction_takes_one_step():
    """A hand that presses on a box which friction holds: nothing depends on the time, so nothing has to be tried."""
    s = swb.Scene("box hand", u="push")
    s.inertia([2.0, 0.5])
    s.force([0.0, s.u[0]])
    s.friction("floor", s.q[0], 6.0)
    s.contact("touch", s.q[0] - s.q[1])
    run = s.simulate([0.0, 0.0], [0.0, 0.0], 1.2, u=[2.0])
    assert run.stats.steps == 1 and not run.x_end.any()


@pytest.mark.parametrize("seed", range(4))
def test_bodies_at_rest_side_by_side_stay_whatever_rounding_says(seed):
    """A pusher and two boxes on a slope they stick to; their velocities, and the force of the pusher, are rounding."""
    masses = (0.7, 0.8, 0.9)
    s = swb.Scene("a x0 y0 x1 y1", u="f", name="pusher and boxes")
    s.inertia(np.diag([masses[0], masses[1], masses[1], masses[2], masses[2]]))
    s.force([s.u[0], -0.03 * masses[1], -masses[1], -0.03 * masses[2], -masses[2]])
    a, x0, y0, x1, y1 = s.q
    s.contact("pusher", gap=x0 - a, e=0.2)
    s.contact("boxes", gap=x1 - x0, e=0.2)
    s.contact("table 0", gap=y0, tangents=x0, mu=0.5)
    s.contact("table 1", gap=y1, tangents=x1, mu=0.5)
    rng = np.random.default_rng(seed)

    def rounding():
        return rng.normal() * 1e-16 * rng.integers(0, 2)

    for _ in range(150):
        x = rng.uniform(0.01, 1.0)
        first = [x + x * rounding(), x + x * rounding(), 0.0, x, 0.0, rounding(), rounding(), 0.0, rounding(), 0.0]
        first[0], first[3] = min(first[0], first[1]), max(first[3], first[1])
        pull = rng.normal() * 10 ** rng.uniform(-16, -9)
        run = swb.simulate(s, first, 0.3, u=[pull], rtol=1e-8, atol=1e-8)
        assert run.success, (first, pull, run.reason)
        assert np.abs(run.x_end - first).max() < 1e-8
