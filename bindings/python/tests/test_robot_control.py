"""Optimal control of robots by shooting: the examples, and pushes of random boxes against the same motion as one mass."""

import numpy as np
import pytest
import switchback_control as swb
from models import example


def test_states_of_a_world_are_expressions_of_its_scene():
    w = swb.World(gravity=10.0)
    ball = w.disc(0.1, mass=1.0, name="ball")
    w.place(ball, y=1.0, vx=2.0)
    f = w.scene.function([w.states[ball].x, w.states["ball"].vx])
    assert f(np.concatenate(w.start())).tolist() == [0.0, 2.0]


def test_an_arm_moves_a_ball_over_a_table():
    pick = example("pick_and_place")
    w = pick.arm()
    r = pick.problem(w, [0.5, -0.3], [0.35, 0.35], search_samples=0).solve()
    assert r.success, r.message
    x0 = r.trajectory(0.0)
    run = w.scene.simulate(x0[:7], x0[7:], 1.2, u=r.controls, rtol=1e-9, atol=1e-10)
    t = np.linspace(0.0, 1.2, 61)
    load = w.trajectory(run, "load", t)
    np.testing.assert_allclose([load.x[-1], load.y[-1], load.z[-1]], [0.35, 0.35, pick.RADIUS], atol=1e-5)
    np.testing.assert_allclose(run.x_end[7:], 0.0, atol=1e-4)  # of rates of several per second
    assert load.z.min() > pick.RADIUS - 1e-6
    assert np.abs(r.controls).max() <= 1.0 + 1e-9


def test_a_hand_that_may_swing_strikes():
    push = example("pushed_box")
    s, ocp = push.problem()
    swings, stays = ocp.solve(), push.problem(swings=False)[1].solve()
    one_mass, _ = push.together()
    assert stays.success and stays.optimality.verdict == "local_optimum"
    assert 0.99 * one_mass < stays.cost < one_mass * (1 + 1e-9)
    assert swings.success and swings.cost < stays.cost and len(swings.contacts.impacts) >= 1
    run = s.simulate([0.0, 0.0], [0.0, 0.0], push.HORIZON, u=swings.controls, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(run.x_end[[0, 2]], [push.WAY, 0.0], atol=1e-5)


@pytest.mark.parametrize("seed", range(12))
def test_a_hand_that_pushes_takes_the_box_with_it(seed):
    """Boxes, hands, floors, ways and grids at random: no control without a bound is known to break friction, so the guess has to push."""
    draw = np.random.default_rng(seed)
    push = example("pushed_box")
    push.BOX, push.HAND, push.MU = draw.uniform(0.5, 5.0), draw.uniform(0.2, 2.0), draw.uniform(0.05, 0.6)
    # slow enough for friction to stop the box
    push.HORIZON = draw.uniform(0.8, 2.0)
    push.WAY = draw.uniform(0.2, 0.9) * push.MU * push.G * push.HORIZON**2 / 6
    stages = int(draw.integers(5, 15))
    r = push.problem(stages, swings=False)[1].solve()
    assert r.success, r.message
    # no dearer than to move all the time, where the hand need not be pulled back for that
    cost, u = push.together(stages, whole=True)
    assert u is None or u.min() < 0.0 or r.cost <= cost * (1 + 1e-6)
