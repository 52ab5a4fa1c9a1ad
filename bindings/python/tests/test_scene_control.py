"""Optimal control of scenes with states beside coordinates and velocities, against the same problems without contacts and with transitions."""

import numpy as np
import pytest
import switchback_control as swb

HORIZON, STAGES = 2.0, 8
START = [0.0, 0.0, 0.0]


def motor(wall: float, restitution: float = 0.8) -> swb.Scene:
    """A cart pushed by the current of a motor, with a wall in front of it."""
    s = swb.Scene("x", u="U", states="i")
    (x,), (v,), (i,), (u,) = s.q, s.v, s.states, s.u
    s.force([3.0 * i - 0.2 * v])
    s.state_rates([(u - i) / 0.3])
    s.contact("wall", gap=wall - x, e=restitution)
    return s


def free() -> swb.Model:
    """The same without the wall."""
    m = swb.Model(states="q v i", controls="U")
    m.derivatives = [m.v, 3.0 * m.i - 0.2 * m.v, (m.U - m.i) / 0.3]
    return m


def ask(model, end, **options):
    ocp = swb.Ocp(model, HORIZON, STAGES, initial_state=START, control_bounds=(-20, 20), **options)
    x = (model.q[0], model.v[0]) if isinstance(model, swb.Scene) else (model.q, model.v)
    u = model.u[0] if isinstance(model, swb.Scene) else model.U
    ocp.set_lagrange(model.function(u**2))
    ocp.add_terminal(model.function([x[0], x[1]]), end, end)
    return ocp


@pytest.mark.parametrize("end", [[1.0, 0.0], [-0.5, 1.0]])
@pytest.mark.parametrize("wall", [10.0, 1e3, 1e5])
def test_a_wall_that_is_far_away_changes_nothing(wall, end):
    """Nor does it say how large coordinates are: the target does."""
    far = ask(motor(wall), end).solve()
    smooth = ask(free(), end).solve()
    assert far.success and smooth.success, far.message
    assert far.cost == pytest.approx(smooth.cost, rel=1e-7)
    assert np.array(far.controls).ravel() == pytest.approx(np.array(smooth.controls).ravel(), abs=1e-5)


def test_an_impact_leaves_the_current_as_it_is():
    """The same problem with a transition in the place of the contact, whose program is another one."""
    m = free()
    m.transition(m.q > 1.0, reset={m.v: -0.8 * m.v})
    end = [0.3, -2.5]
    bounce, reset = ask(motor(1.0), end).solve(), ask(m, end).solve()
    assert bounce.success and reset.success, bounce.message
    assert len(bounce.contacts.impacts) == len(reset.jumps) == 1
    assert bounce.cost == pytest.approx(reset.cost, rel=1e-6)
    run = motor(1.0).simulate([0.0], [0.0], HORIZON, states=[0.0], u=bounce.controls, rtol=1e-10, atol=1e-10)
    assert run.x_end[:2] == pytest.approx(end, abs=1e-6)


@pytest.mark.parametrize("unit", [1e-3, 1e3])
def test_the_unit_of_a_state_changes_nothing(unit):
    """The current in thousandths or thousands of its unit."""
    s = swb.Scene("x", u="U", states="i")
    (x,), (v,), (i,), (u,) = s.q, s.v, s.states, s.u
    s.force([3.0 * unit * i - 0.2 * v])
    s.state_rates([(u / unit - i) / 0.3])
    s.contact("wall", gap=1.0 - x, e=0.8)
    end = [0.3, -2.5]
    assert ask(s, end).solve().cost == pytest.approx(ask(motor(1.0), end).solve().cost, rel=1e-6)


def test_what_is_not_followed_is_said():
    s = motor(1.0)
    with pytest.raises(swb.UnsupportedError, match="beside coordinates and velocities"):
        ask(s, [0.3, -2.5], jumps="freezing").solve()
    with pytest.raises(swb.DimensionError):
        swb.Ocp(s, 1.0, 4, initial_state=[0.0, 0.0])
