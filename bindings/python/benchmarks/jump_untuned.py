"""The same question as `jump_optima.py` asks, of twelve scenes that the search was not tuned on, with three sets of figures each.

Best costs, which stand in `jump_untuned.tsv`, are those of every search and of the default one from eight random guesses.

usage: jump_untuned.py [--best | --keep] [--max-time SECONDS] [--only WORD]
"""

from pathlib import Path

from jump_problems import Problems, main

import switchback_control as swb
from switchback_control import sin, sqrt

G = 9.81


def row_of_blocks(vary, **options):
    """A driven block is to knock the last of three others, which slide with drag, by a way, and to be back at rest."""
    masses, e, way = [vary(m) for m in (1.0, 0.5, 1.5, 0.7)], 0.5 * vary(1.0), 0.6 * vary(1.0)
    s = swb.Scene("x0 x1 x2 x3", u="F", name="row of blocks")
    x, v = s.q, s.v
    s.inertia(masses)
    s.force([s.u[0], *(-0.8 * w for w in v[1:])])
    for i in range(3):
        s.contact(f"{i}-{i + 1}", gap=x[i + 1] - x[i] - 0.1, e=e)
    start = [0, 0.4, 0.6, 0.8, 0, 0, 0, 0]
    ocp = swb.Ocp(s, 2.5 * vary(1.0), 15, n_s=2, n_fe=1, initial_state=start, control_bounds=(-25, 25), **options)
    ocp.set_lagrange(s.function(s.u[0] ** 2))
    ocp.add_terminal(s.function([x[0], v[0], x[3]]), [0, 0, 0.8 + way], [0, 0, 0.8 + way])
    return s, ocp


def throw(vary, **options):
    """A hand with a ball on it throws the ball to a place, with friction between them; the hand stays near."""
    hand, ball, mu, far = vary(1.0), 0.2 * vary(1.0), 0.8 * vary(1.0), 1.5 * vary(1.0)
    s = swb.Scene("xh yh xb yb", u="fx fy", name="throw")
    (xh, yh, xb, yb), v = s.q, s.v
    s.inertia([hand, hand, ball, ball])
    s.force([s.u[0], s.u[1], 0, -ball * G])
    s.contact("hand", gap=yb - yh, tangents=[xb - xh], mu=mu)
    ocp = swb.Ocp(s, 1.2 * vary(1.0), 15, n_s=2, n_fe=1, initial_state=[0] * 8, control_bounds=(-60, 60), **options)
    ocp.set_lagrange(s.function(0.01 * (s.u[0] ** 2 + s.u[1] ** 2)))
    ocp.add_path(s.function([xh, yh]), [-0.5, -0.6], [0.5, 0.6])
    ocp.add_terminal(s.function([xb, yb]), [far, 0.5], [far, 0.5])
    return s, ocp


def two_balls(vary, **options):
    """A paddle under two balls, the second higher than the first: both are where they were, going up or down, and so is the paddle, at rest."""
    paddle, e, low, high = vary(1.0), min(1.0, 0.85 * vary(1.0)), 0.5 * vary(1.0), 1.0 * vary(1.0)
    s = swb.Scene("yp ya yb", u="F", name="two balls")
    (yp, ya, yb), v = s.q, s.v
    s.inertia([paddle, 0.1, 0.1])
    s.force([s.u[0], -0.1 * G, -0.1 * G])
    s.contact("a", gap=ya - yp, e=e)
    s.contact("b", gap=yb - yp, e=e)
    start = [0, low, high, 0, 0, 0]
    ocp = swb.Ocp(s, 1.5 * vary(1.0), 18, n_s=2, n_fe=1, initial_state=start, control_bounds=(-40, 40), **options)
    ocp.set_lagrange(s.function(s.u[0] ** 2))
    ocp.add_terminal(s.function([yp, v[0], ya, yb]), [0, 0, low, high], [0, 0, low, high])
    return s, ocp


def two_boxes(vary, **options):
    """A pusher shoves one rough box into another; both are to stop at places of their own."""
    masses, mu, e = [vary(1.0) for _ in range(3)], 0.3 * vary(1.0), 0.2 * vary(1.0)
    s = swb.Scene("xp xa ya xb yb", u="F", name="two boxes")
    (xp, xa, ya, xb, yb), v = s.q, s.v
    s.inertia([masses[0], masses[1], masses[1], masses[2], masses[2]])
    s.force([s.u[0], 0, -masses[1] * G, 0, -masses[2] * G])
    s.contact("pusher", gap=xa - xp - 0.1)
    s.contact("boxes", gap=xb - xa - 0.2, e=e)
    s.contact("table a", gap=ya, tangents=[xa], mu=mu)
    s.contact("table b", gap=yb, tangents=[xb], mu=mu)
    start = [-0.3, 0, 0, 0.5, 0] + [0] * 5
    ocp = swb.Ocp(s, 2.0 * vary(1.0), 14, n_s=2, n_fe=1, initial_state=start, control_bounds=(-40, 40), **options)
    ocp.set_lagrange(s.function(0.1 * s.u[0] ** 2))
    goal = [0.6, 0.9, 0, 0]
    ocp.add_terminal(s.function([xa, xb, v[1], v[3]]), goal, goal)
    return s, ocp


def catch(vary, **options):
    """A ball flies at a cart with a tray before a spring wall; the cart catches it and stops with it."""
    cart, ball, e, speed = vary(2.0), 0.5 * vary(1.0), 0.4 * vary(1.0), 3.0 * vary(1.0)
    s = swb.Scene("x y xb yb", u="fx fy", name="catch")
    (x, y, xb, yb), v = s.q, s.v
    s.inertia([cart, cart, ball, ball])
    s.force([s.u[0], s.u[1], 0, -ball * G])
    s.contact("tray", gap=yb - y, tangents=[xb - x], mu=0.5, e=e)
    start = [1.5, 0, 0, 0.5, 0, 0, 1.5, speed]
    ocp = swb.Ocp(s, 1.8 * vary(1.0), 18, n_s=2, n_fe=1, initial_state=start, control_bounds=(-40, 40), **options)
    ocp.set_lagrange(s.function(0.1 * (s.u[0] ** 2 + (s.u[1]) ** 2)))
    ocp.add_terminal(s.function([xb - x, yb - y, *v]), [0] * 6, [0] * 6)
    return s, ocp


def pucks(vary, **options):
    """A driven puck plays another one off a cushion to a place on the other side."""
    masses, e, wall = [vary(1.0), vary(0.7)], min(1.0, 0.85 * vary(1.0)), 1.0 * vary(1.0)
    s = swb.Scene("x1 y1 x2 y2", u="fx fy", name="pucks")
    (x1, y1, x2, y2), v = s.q, s.v
    s.inertia([masses[0]] * 2 + [masses[1]] * 2)
    s.force([s.u[0] - 0.2 * v[0], s.u[1] - 0.2 * v[1], -0.2 * v[2], -0.2 * v[3]])
    s.contact("pucks", gap=sqrt((x1 - x2) ** 2 + (y1 - y2) ** 2 + 1e-12) - 0.2, e=e)
    s.contact("cushion", gap=wall - y2, e=0.7)
    start = [-0.8, -0.4, 0, 0, 0, 0, 0, 0]
    ocp = swb.Ocp(s, 2.0 * vary(1.0), 16, n_s=2, n_fe=1, initial_state=start, control_bounds=(-20, 20), **options)
    ocp.set_lagrange(s.function(s.u[0] ** 2 + s.u[1] ** 2))
    ocp.add_terminal(s.function([x2, y2, v[0], v[1]]), [1, 0, 0, 0], [1, 0, 0, 0])
    return s, ocp


def corridor(vary, **options):
    """A body between a lively and a dull wall swings a load without a drive, on a spring; the load is to be fast at a place."""
    body, load, stiff, room = vary(1.0), 0.5 * vary(1.0), 15 * vary(1.0), 0.5 * vary(1.0)
    s = swb.Scene("x z", u="F", name="corridor")
    (x, z), v = s.q, s.v
    pull = stiff * (z - x)
    s.inertia([body, load])
    s.force([s.u[0] + pull, -pull - 0.1 * v[1]])
    s.contact("lively", gap=room - x, e=0.9)
    s.contact("dull", gap=x + room, e=0.2)
    ocp = swb.Ocp(s, 3.0 * vary(1.0), 20, n_s=2, n_fe=1, initial_state=[0] * 4, control_bounds=(-6, 6), **options)
    ocp.set_lagrange(s.function(s.u[0] ** 2))
    ocp.add_terminal(s.function([z, v[1]]), [0.2, 4.0], [0.2, 4.0])
    return s, ocp


def relay_press(vary, **options):
    """A press whose valve opens and closes with hysteresis of the speed: to a place, at rest."""
    on, off, lift = 1.2 * vary(1.0), 0.5 * vary(1.0), 2.0 * vary(1.0)
    s = swb.Model(states="q v", controls="u", name="press")
    q, v = s.x
    u = s.u[0]
    open_valve = s.hysteresis(v, on=on, off=off, name="valve")
    s.derivatives = [v, (1 + lift * open_valve) * u - 0.4 * v]
    far = 4 * vary(1.0)
    ocp = swb.Ocp(s, 4.0 * vary(1.0), 16, n_s=2, n_fe=2, initial_state=[0, 0], control_bounds=(-4, 4), **options)
    ocp.set_lagrange(s.function(u**2))
    ocp.add_terminal(s.function([q, v]), [far, 0], [far, 0])
    return s, ocp


def tether(vary, **options):
    """A cart pulls a sledge by a slack rope and brings it, with drag, to a place from which the cart is gone on."""
    cart, sledge, rope, far = vary(1.0), vary(2.0), 0.6 * vary(1.0), 1.5 * vary(1.0)
    s = swb.Scene("xc xs", u="F", name="tether")
    (xc, xs), v = s.q, s.v
    s.inertia([cart, sledge])
    s.force([s.u[0] - 0.2 * v[0], -1.0 * v[1]])
    s.contact("rope", gap=rope - (xc - xs), e=0.3)
    s.contact("bumper", gap=xc - xs - 0.1, e=0.5)
    ocp = swb.Ocp(s, 2.5 * vary(1.0), 16, n_s=2, n_fe=1, initial_state=[0.2, 0, 0, 0], control_bounds=(-30, 30), **options)
    ocp.set_lagrange(s.function(s.u[0] ** 2))
    ocp.add_terminal(s.function([xs, v[1], v[0]]), [far, 0, 0], [far, 0, 0])
    return s, ocp


def ball_screw(vary, **options):
    """A motor moves a table by a screw with backlash; the table lies on dry friction and is to stop at a place."""
    motor, table, play, mu = vary(0.5), vary(2.0), 0.05 * vary(1.0), 0.1 * vary(1.0)
    s = swb.Scene("xm xt yt", u="F", name="ball screw")
    (xm, xt, yt), v = s.q, s.v
    s.inertia([motor, table, table])
    s.force([s.u[0] - 0.3 * v[0], 0, -table * G])
    s.contact("front", gap=xt - xm + play, e=0.2)
    s.contact("back", gap=xm - xt + play, e=0.2)
    s.contact("bed", gap=yt, tangents=[xt], mu=mu)
    ocp = swb.Ocp(s, 1.5 * vary(1.0), 15, n_s=2, n_fe=1, initial_state=[0] * 6, control_bounds=(-40, 40), **options)
    ocp.set_lagrange(s.function(0.1 * s.u[0] ** 2))
    goal = [0.5, 0, 0.5, 0]
    ocp.add_terminal(s.function([xt, v[1], xm, v[0]]), goal, goal)
    return s, ocp


def kick(vary, **options):
    """A leg on a hip kicks a ball, which rolls with drag, to a target beyond a step up by a bounce of a wall; the leg stops."""
    length, inertia, ball, e = 0.5, 0.3 * vary(1.0), 0.4 * vary(1.0), 0.6 * vary(1.0)
    far = 2.0 * vary(1.0)
    s = swb.Scene("a x", u="T", name="kick")
    (a, x), v = s.q, s.v
    s.inertia([inertia, ball])
    s.force([s.u[0] - 3 * sin(a), -0.3 * v[1]])
    s.contact("foot", gap=x - length * sin(a) - 0.1, e=e)
    s.contact("wall", gap=far - x, e=0.6)
    start = [-0.3, 0.3, 0, 0]
    ocp = swb.Ocp(s, 2.0 * vary(1.0), 16, n_s=2, n_fe=1, initial_state=start, control_bounds=(-15, 15), **options)
    ocp.set_lagrange(s.function(s.u[0] ** 2))
    goal = [0.75 * far, 0, 0]
    ocp.add_terminal(s.function([x, a, v[0]]), goal, goal)
    return s, ocp


def hop(vary, **options):
    """A body on a leg with a spring and a drive between them hops up to a height within the time, and no matter where the foot is."""
    body, foot, stiff, height = vary(2.0), 0.5 * vary(1.0), 300 * vary(1.0), 1.0 * vary(1.0)
    s = swb.Scene("yb yf", u="F", name="hop")
    (yb, yf), v = s.q, s.v
    leg = s.u[0] + stiff * (0.5 - (yb - yf)) - 2 * (v[0] - v[1])
    s.inertia([body, foot])
    s.force([leg - body * G, -leg - foot * G])
    s.contact("floor", gap=yf, e=0.0)
    ocp = swb.Ocp(s, 1.6 * vary(1.0), 20, n_s=2, n_fe=1, initial_state=[0.5 - body * G / stiff, 0, 0, 0], control_bounds=(-60, 60), **options)
    ocp.add_path(s.function([yb - yf]), [0.2], [0.8])
    ocp.set_lagrange(s.function(0.1 * s.u[0] ** 2))
    ocp.add_terminal(s.function([yb]), [height], None)
    return s, ocp


SCENES = [row_of_blocks, throw, two_balls, two_boxes, catch, pucks, corridor, relay_press, tether, ball_screw, kick, hop]

if __name__ == "__main__":
    main(Problems(SCENES, variants=3, table=Path(__file__).with_name("jump_untuned.tsv"), guesses=8))
