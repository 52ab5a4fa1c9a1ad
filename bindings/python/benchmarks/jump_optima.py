"""How often the default search of a scene ends at a cost that is more than one percent above the best known one.

Seven scenes whose contacts the guess (bodies at rest) says nothing of, each with eight sets of masses, distances, restitutions and
horizons drawn from a seed. `--best` looks for better optima by every search and from random guesses, and writes what it finds to
`jump_optima.tsv` beside this file where it is better than what stands there; without it every problem is solved once as a user would, and
compared, and with `--keep` what costs less is written, too.

usage: jump_optima.py [--best | --keep] [--max-time SECONDS] [--only WORD]
"""

from pathlib import Path

from jump_problems import Problems, main

import switchback_control as swb
from switchback_control import tanh

G = 9.81


def pile_driver(vary, **options):
    """A hammer that is only lifted falls on a pile that the soil holds by all but dry friction."""
    hammer, pile, e, way = vary(2.0), vary(3.0), 0.3 * vary(1.0), 0.15 * vary(1.0)
    s = swb.Scene("yh yp", u="F", name="pile driver")
    (yh, yp), (_, vp) = s.q, s.v
    soil = 4 * hammer * G
    s.inertia([hammer, pile])
    s.force([s.u[0] - hammer * G, -soil * tanh(vp / 0.1)])
    s.contact("head", gap=yh - yp, e=e)
    ocp = swb.Ocp(s, 2 * vary(1.0), 16, n_s=2, n_fe=1, initial_state=[0.1, 0, 0, 0], control_bounds=(0, 5 * hammer * G), **options)
    ocp.set_lagrange(s.function(0.01 * s.u[0] ** 2))
    ocp.add_terminal(s.function([yp]), None, [-way])
    return s, ocp


def hammer_and_nut(vary, **options):
    """A hammer drives a nut that dry friction holds in a wall, and is back at rest."""
    hammer, nut, e, way = vary(1.0), vary(0.5), 0.2 * vary(1.0), 0.1 * vary(1.0)
    s = swb.Scene("xh xn yn", u="F", name="hammer and nut")
    xh, xn, yn = s.q
    s.inertia([hammer, nut, nut])
    s.force([s.u[0], 0, -20])
    s.contact("blow", gap=xn - xh, e=e)
    s.contact("wall", gap=yn, tangents=[xn], mu=0.5)
    ocp = swb.Ocp(s, 2 * vary(1.0), 16, n_s=2, n_fe=1, initial_state=[-0.2, 0, 0, 0, 0, 0], control_bounds=(-30, 30), **options)
    ocp.set_lagrange(s.function(s.u[0] ** 2))
    ocp.add_terminal(s.function([xh, xn, s.v[0], s.v[1]]), [-0.2, way, 0, 0], [-0.2, way, 0, 0])
    return s, ocp


def stacked_blocks(vary, **options):
    """The upper of two blocks is to be elsewhere on the lower one, which is driven; both at rest at the end."""
    lower, upper, mu, way = vary(2.0), vary(1.0), 0.3 * vary(1.0), 0.3 * vary(1.0)
    s = swb.Scene("x1 x2 y2", u="F", name="stacked blocks")
    (x1, x2, y2), v = s.q, s.v
    s.inertia([lower, upper, upper])
    s.force([s.u[0], 0, -upper * G])
    s.contact("between", gap=y2, tangents=[x2 - x1], mu=mu)
    ocp = swb.Ocp(s, 2 * vary(1.0), 16, n_s=2, n_fe=1, initial_state=[0] * 6, control_bounds=(-60, 60), **options)
    ocp.set_lagrange(s.function(0.1 * s.u[0] ** 2))
    ocp.add_terminal(s.function([x2 - x1, v[0], v[1], x1]), [way, 0, 0, 0], [way, 0, 0, 0])
    return s, ocp


def carts(vary, **options):
    """Of three carts the first is driven, and is to be back; the third is to be one further."""
    masses, es = [vary(1.0) for _ in range(3)], [min(1.0, 0.7 * vary(1.0)), 0.4 * vary(1.0)]
    s = swb.Scene("x1 x2 x3", u="F", name="three carts")
    (x1, x2, x3), (v1, v2, v3) = s.q, s.v
    s.inertia(masses)
    s.force([s.u[0] - 0.1 * v1, -0.3 * v2, -0.3 * v3])
    s.contact("1-2", gap=x2 - x1 - 0.2, e=es[0])
    s.contact("2-3", gap=x3 - x2 - 0.2, e=es[1])
    start = [0, 1, 2, 0, 0, 0]
    ocp = swb.Ocp(s, 3 * vary(1.0), 15, n_s=2, n_fe=2, initial_state=start, control_bounds=(-20, 20), **options)
    ocp.set_lagrange(s.function(s.u[0] ** 2))
    ocp.add_terminal(s.function([x1, x3]), [0, 3], [0, 3])
    return s, ocp


def paddle(vary, **options):
    """A ball is to be as high as it was, and at rest there, after it has fallen on a paddle that is driven and ends where it began."""
    e, mass, height = min(1.0, 0.8 * vary(1.0)), vary(1.0), vary(1.0)
    s = swb.Scene("yp yb", u="F", name="paddle")
    (yp, yb), v = s.q, s.v
    s.inertia([mass, 0.1])
    s.force([s.u[0], -0.1 * G])
    s.contact("paddle", gap=yb - yp, e=e)
    horizon = 2.4 * vary(1.0)
    ocp = swb.Ocp(s, horizon, 18, n_s=2, n_fe=1, initial_state=[0, height, 0, 0], control_bounds=(-50, 50), **options)
    ocp.set_lagrange(s.function(s.u[0] ** 2))
    ocp.add_terminal(s.function([yp, yb, v[0], v[1]]), [0, height, 0, 0], [0, height, 0, 0])
    return s, ocp


def fork(vary, **options):
    """A fork that is below a pallet on the floor lifts it in least time, to be at rest."""
    fork_mass, pallet, height, below = vary(1.0), vary(2.0), vary(1.0), 0.3 * vary(1.0)
    s = swb.Scene("yf yp", u="F", name="fork and pallet")
    (yf, yp), v = s.q, s.v
    s.inertia([fork_mass, pallet])
    s.force([s.u[0], -pallet * G])
    s.contact("fork", gap=yp - yf)
    s.contact("floor", gap=yp)
    limit = 3 * pallet * G
    ocp = swb.Ocp(s, 1.0, 12, n_s=2, n_fe=1, initial_state=[-below, 0, 0, 0], control_bounds=(-limit, limit), **options)
    ocp.set_free_time("horizon", 0.2, 5.0)
    ocp.set_mayer(s.function(s.t))
    ocp.add_terminal(s.function([yp, v[1]]), [height, 0], [height, 0])
    return s, ocp


def crate(vary, **options):
    """A pusher gives a crate on a rough table a push so that it bounces off a wall and stops short of it; the pusher is back at rest."""
    pusher, mass, mu, wall = vary(1.0), vary(1.0), 0.2 * vary(1.0), 0.5 * vary(1.0)
    s = swb.Scene("xp xc yc", u="F", name="crate and wall")
    (xp, xc, yc), v = s.q, s.v
    s.inertia([pusher, mass, mass])
    s.force([s.u[0], 0, -mass * G])
    s.contact("pusher", gap=xc - xp - 0.1, e=0.2)
    s.contact("wall", gap=wall - xc, e=0.7)
    s.contact("table", gap=yc, tangents=[xc], mu=mu)
    start = [-0.3, 0, 0, 0, 0, 0]
    ocp = swb.Ocp(s, 2.5 * vary(1.0), 16, n_s=2, n_fe=1, initial_state=start, control_bounds=(-30, 30), **options)
    ocp.set_lagrange(s.function(s.u[0] ** 2))
    goal = [0.6 * wall, 0, -0.3, 0]
    ocp.add_terminal(s.function([xc, v[1], xp, v[0]]), goal, goal)
    return s, ocp


SCENES = [pile_driver, hammer_and_nut, stacked_blocks, carts, paddle, fork, crate]

PROBLEMS = Problems(SCENES, variants=8, table=Path(__file__).with_name("jump_optima.tsv"), guesses=5)

if __name__ == "__main__":
    main(PROBLEMS)
