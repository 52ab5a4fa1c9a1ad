"""Path constraints between the points at which a program imposes them."""

import numpy as np
import pytest

import switchback_control as swb
from switchback_control.expr import Model

STAGES, HORIZON = 6, 3.0


def past_a_disc(seed, at):
    """A mass in the plane from rest to rest with least effort; the straight line passes through a disc."""
    g = np.random.default_rng(seed)
    radius, centre = g.uniform(0.4, 1.2), (g.uniform(1.5, 3.5), g.uniform(-0.5, 0.5))
    m = Model(states="px py vx vy", controls="ax ay")
    (px, py, vx, vy), (ax, ay) = m.x, m.u
    m.derivatives = [vx, vy, ax, ay]
    effort = m.function([ax * ax + ay * ay])
    ocp = swb.Ocp(m, HORIZON, STAGES, lagrange=effort, initial_state=[0.0] * 4, control_bounds=(-20, 20))
    ocp.add_terminal(m.function([px, py, vx, vy]), [5.0, 0, 0, 0], [5.0, 0, 0, 0])
    ocp.add_path(m.function([(px - centre[0]) ** 2 + (py - centre[1]) ** 2]), [radius**2], [np.inf], at=at)
    return ocp, centre, radius


def deepest(controls, centre, radius):
    """By how much, and when, constant accelerations lead into the disc: the motion is a parabola in every stage."""
    h, z, found = HORIZON / STAGES, np.zeros(4), (0.0, 0.0)
    s = np.linspace(0, h, 4001)
    for k, (ax, ay) in enumerate(controls):
        x, y = z[0] + z[2] * s + ax * s * s / 2, z[1] + z[3] * s + ay * s * s / 2
        off = radius**2 - (x - centre[0]) ** 2 - (y - centre[1]) ** 2
        found = max(found, (off.max(), k * h + s[off.argmax()]))
        z = np.array([x[-1], y[-1], z[2] + ax * h, z[3] + ay * h])
    return found


@pytest.mark.parametrize("at", ["control_grid", "stage_points"])
def test_a_constraint_holds_between_its_points_or_the_answer_says_where_it_does_not(at):
    for seed in range(3):
        ocp, centre, radius = past_a_disc(seed, at)
        r = ocp.solve()
        off, when = deepest(r.controls, centre, radius)
        a = r.accuracy
        assert r.success and abs(a.along_violation - off) < 1e-3 * radius**2
        if off > 1e-2:
            assert abs(a.along_time - when) < 0.05 and (a.along_constraint, a.along_row) == (0, 0)
            assert r.certificate == "unknown" and "path constraint 0" in r.message
        # points are added by default
        assert off < 1e-2 * radius**2


def test_added_points_leave_nothing_behind():
    ocp, _, _ = past_a_disc(1, "control_grid")
    first = ocp.solve()
    warm = ocp.solve(warm=True)
    again = ocp.solve()
    assert np.isclose(warm.cost, first.cost, rtol=1e-9)
    assert again.cost == first.cost and np.array_equal(again.controls, first.controls)


def test_transitions_are_looked_at_on_both_sides():
    # a saw tooth, which nothing moves: s = 0.25 + t up to 1 at t = 0.75, then from 0 on
    m = Model(states="s", controls="u", name="saw")
    m.transition(m.s > 1.0, reset={m.s: m.s - 1.0})
    m.derivatives = [1.0 + 0.0 * m.u[0]]
    ocp = swb.Ocp(m, 1.0, 2, lagrange=m.function(m.u[0] ** 2), initial_state=[0.25], control_bounds=(-1, 1))
    ocp.add_path(m.s, -np.inf, 0.8)
    r = ocp.solve()
    assert r.success and len(r.jumps) == 1
    assert r.accuracy.along_violation == pytest.approx(0.2, abs=1e-6) and r.accuracy.along_time == pytest.approx(0.75, abs=1e-6)
    assert "path constraint 0" in r.message and r.certificate == "unknown"


def still(kind):
    """A system with the state sin t beside what events follow in another way, and a path constraint that holds at the ends of the horizon only."""
    if kind == "algebraic":
        m = Model(states="s c z", controls="u")
        m.derivatives = [m.c, -m.z + 0.0 * m.u[0], m.z - m.s]
        system, start = m.system(), [0.0, 1.0, 0.0]
        system.set_algebraic(1)
    else:
        m = swb.Projected("s", u="u")
        m.f([swb.cos(m.t) + 0.0 * m.u[0]])
        m.constraint("far", 5.0 - m.x[0])
        system, start = m.system(), [0.0]
    ocp = swb.Ocp(system, 2 * np.pi, 1, lagrange=m.function(m.u[0] ** 2), initial_state=start, control_bounds=(-1, 1), n_fe=8, n_s=4)
    ocp.add_path(m.x[0], -np.inf, 0.5)
    return ocp


@pytest.mark.parametrize("kind", ["algebraic", "projected"])
def test_other_simulations_look_between_the_points(kind):
    a = still(kind).solve().accuracy
    assert a.along_violation == pytest.approx(0.5, abs=2e-3) and a.along_time == pytest.approx(np.pi / 2, abs=0.1)
