"""The same question as `jump_optima.py` asks, of twelve scenes whose contacts are curved, or sharp for the grid, with three sets of figures each.

Best costs stand in `jump_curved.tsv`: those of the default search (`--keep`) so far, so that they say what a change makes dearer and not yet what is
dear; `--best` adds those of every search and of the default one from three random guesses.

usage: jump_curved.py [--best | --keep] [--max-time SECONDS] [--only WORD]
"""

import math
from pathlib import Path

from jump_problems import Problems, main

import switchback_control as swb
from switchback_control import cos, exp, sin, sqrt, tanh

G = 9.81


def crane(vary, **options):
    """A trolley lifts a load by a slack rope off the ground and sets it on a platform with a rounded edge."""
    trolley, load, mu, edge = vary(1.0), 0.5 * vary(1.0), 0.4 * vary(1.0), 0.4
    s = swb.Scene("xc yc xl yl", u="fx fy", name="crane")
    (xc, yc, xl, yl), v = s.q, s.v
    s.inertia([trolley, trolley, load, load])
    s.force([s.u[0] - 0.5 * v[0], s.u[1] - trolley * G, -0.1 * v[2], -load * G])
    s.contact("rope", gap=0.6 - sqrt((xc - xl) ** 2 + (yc - yl) ** 2 + 1e-12))
    height = 0.1 * (tanh((xl - edge) / 0.05) + math.tanh(edge / 0.05))
    s.contact("ground", gap=yl - height, tangents=[xl], mu=mu)
    bounds = ([-20, -10], [20, 40])
    ocp = swb.Ocp(s, 1.5 * vary(1.0), 16, n_s=2, n_fe=1, initial_state=[0, 0.5] + [0] * 6, control_bounds=bounds, **options)
    ocp.set_lagrange(s.function(0.01 * (s.u[0] ** 2 + (s.u[1] - trolley * G) ** 2)))
    ocp.add_terminal(s.function([xl, v[2], v[3]]), [0.8, 0, 0], [0.8, 0, 0])
    return s, ocp


def seesaw(vary, **options):
    """A hammer strikes one end of a seesaw, which throws a ball from the other end up to a height."""
    hammer, beam, ball, e, height = vary(1.0), 0.1 * vary(1.0), 0.2 * vary(1.0), 0.2 * vary(1.0), 0.8 * vary(1.0)
    arm, tilt = 0.5, -0.3
    s = swb.Scene("yh a yb", u="F", name="seesaw")
    (yh, a, yb), v = s.q, s.v
    s.inertia([hammer, beam, ball])
    s.force([s.u[0] - hammer * G, -0.05 * v[1], -ball * G])
    s.contact("hammer", gap=yh + arm * sin(a), e=e)
    s.contact("ball", gap=yb - arm * sin(a), e=0.1)
    s.contact("stop of the ball's end", gap=a - tilt)
    s.contact("stop of the hammer's end", gap=-tilt - a)
    start = [0.5, tilt, arm * math.sin(tilt), 0, 0, 0]
    ocp = swb.Ocp(s, 1.2 * vary(1.0), 16, n_s=2, n_fe=1, initial_state=start, control_bounds=(-40, 40), **options)
    ocp.set_lagrange(s.function(0.01 * s.u[0] ** 2))
    ocp.add_terminal(s.function([yb]), [height], None)
    return s, ocp


def tray(vary, **options):
    """A sprung tray that is shaken moves a part along by friction."""
    own, part, mu, stiff, way = 2.0 * vary(1.0), 0.3 * vary(1.0), 0.35 * vary(1.0), 80 * vary(1.0), 0.3 * vary(1.0)
    s = swb.Scene("xt xp yp", u="F", name="tray")
    (xt, xp, yp), v = s.q, s.v
    s.inertia([own, part, part])
    s.force([s.u[0] - stiff * xt - v[0], 0, -part * G])
    s.contact("tray", gap=yp, tangents=[xp - xt], mu=mu)
    ocp = swb.Ocp(s, 1.5 * vary(1.0), 20, n_s=2, n_fe=1, initial_state=[0] * 6, control_bounds=(-40, 40), **options)
    ocp.set_lagrange(s.function(0.01 * s.u[0] ** 2))
    ocp.add_terminal(s.function([xp, v[1], xt]), [way, 0, 0], [way, 0, 0])
    return s, ocp


def ramp(vary, **options):
    """A sprung plunger shoots a ball up a curved ramp to a place where it comes to rest."""
    plunger, ball, e, steep, far = 0.5 * vary(1.0), 0.2 * vary(1.0), 0.3 * vary(1.0), 0.4 * vary(1.0), 0.9 * vary(1.0)
    s = swb.Scene("xp x y", u="F", name="ramp")
    (xp, x, y), v = s.q, s.v
    s.inertia([plunger, ball, ball])
    s.force([s.u[0] - 60 * xp - v[0], -0.05 * v[1], -ball * G])
    s.contact("plunger", gap=x - xp - 0.05, e=e)
    s.contact("ramp", gap=y - steep * (x - 0.05) ** 2)
    start = [0, 0.05, 0, 0, 0, 0]
    ocp = swb.Ocp(s, 1.2 * vary(1.0), 16, n_s=2, n_fe=1, initial_state=start, control_bounds=(-30, 30), **options)
    ocp.set_lagrange(s.function(0.01 * s.u[0] ** 2))
    ocp.add_terminal(s.function([x, v[1]]), [far, 0], [far, 0])
    return s, ocp


def sprung_leg(s, body, foot, stiff, damping, rest=0.5):
    """Forces on a body and a foot with a spring, a damper and the drive `u[1]` between them."""
    (_, yb, yf), v = s.q, s.v
    leg = s.u[1] + stiff * (rest - (yb - yf)) - damping * (v[1] - v[2])
    return [leg - body * G, -leg - foot * G]


def bump(vary, **options):
    """A hopper on a sprung leg crosses a rounded bump and comes to rest behind it."""
    body, foot, stiff, mu = 1.6 * vary(1.0), 0.4 * vary(1.0), 300 * vary(1.0), 0.6 * vary(1.0)
    s = swb.Scene("x yb yf", u="Fx Fl", name="bump")
    (x, yb, yf), v = s.q, s.v
    s.inertia([body + foot, body, foot])
    s.force([s.u[0] - 0.5 * v[0], *sprung_leg(s, body, foot, stiff, 4)])
    s.contact("floor", gap=yf - 0.12 * exp(-(((x - 0.5) / 0.1) ** 2)), tangents=[x], mu=mu)
    start = [0, 0.5 - body * G / stiff, 0.12 * math.exp(-25.0), 0, 0, 0]
    bounds = ([-15, -60], [15, 60])
    ocp = swb.Ocp(s, 1.2 * vary(1.0), 16, n_s=2, n_fe=1, initial_state=start, control_bounds=bounds, **options)
    ocp.add_path(s.function([yb - yf]), [0.2], [0.8])
    ocp.set_lagrange(s.function(0.1 * s.u[0] ** 2 + 0.02 * s.u[1] ** 2))
    ocp.add_terminal(s.function([x, v[0], v[1]]), [1.0, 0, 0], [1.0, 0, 0])
    return s, ocp


def step(vary, **options):
    """A body on a sprung leg jumps onto a step with a rounded edge, where its foot is to stand."""
    body, foot, stiff, high = 2.0 * vary(1.0), 0.4 * vary(1.0), 250 * vary(1.0), 0.3 * vary(1.0)
    s = swb.Scene("x yb yf", u="Fx Fl", name="step")
    (x, yb, yf), v = s.q, s.v
    s.inertia([body, body, foot])
    s.force([s.u[0] - 0.3 * v[0], *sprung_leg(s, body, foot, stiff, 3)])
    s.contact("floor", gap=yf - 0.5 * high * (tanh((x - 0.5) / 0.05) + math.tanh(0.5 / 0.05)))
    start = [0, 0.5 - body * G / stiff, 0, 0, 0, 0]
    bounds = ([-20, -60], [20, 60])
    ocp = swb.Ocp(s, 1.2 * vary(1.0), 16, n_s=2, n_fe=1, initial_state=start, control_bounds=bounds, **options)
    ocp.add_path(s.function([yb - yf]), [0.2], [0.8])
    ocp.set_lagrange(s.function(0.1 * s.u[0] ** 2 + 0.02 * s.u[1] ** 2))
    ocp.add_terminal(s.function([x, v[0], yf]), [1.0, 0, high], [1.0, 0, high])
    return s, ocp


def latch(vary, **options):
    """A bolt is pushed past a sprung latch, which falls behind it."""
    bolt, spring, stiff, e = 0.5 * vary(1.0), 0.1 * vary(1.0), 30 * vary(1.0), 0.1 * vary(1.0)
    s = swb.Scene("x y", u="F", name="latch")
    (x, y), v = s.q, s.v
    s.inertia([bolt, spring])
    s.force([s.u[0] - v[0], -stiff * y - 0.3 * v[1] - 1])
    bevel = tanh((x - 0.3) / 0.04) - tanh((x - 0.5) / 0.01) + math.tanh(0.3 / 0.04) - math.tanh(0.5 / 0.01)
    s.contact("bevel", gap=y - 0.05 * bevel, e=e)
    ocp = swb.Ocp(s, vary(1.0), 16, n_s=2, n_fe=1, initial_state=[0] * 4, control_bounds=(-15, 15), **options)
    ocp.set_lagrange(s.function(0.1 * s.u[0] ** 2))
    ocp.add_terminal(s.function([x, v[0]]), [0.7, 0], [0.7, 0])
    return s, ocp


def stairs(vary, **options):
    """A ball that bounces is pushed down two rounded steps and stops at their foot."""
    ball, drag, e, high = 0.4 * vary(1.0), 0.2 * vary(1.0), 0.4 * vary(1.0), 0.1 * vary(1.0)
    s = swb.Scene("x y", u="F", name="stairs")
    (x, y), v = s.q, s.v
    s.inertia([ball, ball])
    s.force([s.u[0] - drag * v[0], -ball * G])
    edges = (0.3, 0.7)
    s.contact("floor", gap=y + high * sum(tanh((x - at) / 0.03) + math.tanh(at / 0.03) for at in edges), e=e)
    ocp = swb.Ocp(s, 1.2 * vary(1.0), 16, n_s=2, n_fe=1, initial_state=[0] * 4, control_bounds=(-6, 6), **options)
    ocp.set_lagrange(s.function(s.u[0] ** 2))
    ocp.add_terminal(s.function([x, v[0]]), [1.0, 0], [1.0, 0])
    return s, ocp


def capsule(vary, **options):
    """A capsule drives itself along a rough floor by a sprung mass inside, which may strike its ends."""
    shell, inside, stiff, mu, e = vary(1.0), 0.5 * vary(1.0), 40 * vary(1.0), 0.3 * vary(1.0), 0.3 * vary(1.0)
    s = swb.Scene("xc yc xm", u="F", name="capsule")
    (xc, yc, xm), v = s.q, s.v
    s.inertia([shell, shell, inside])
    spring = stiff * (xm - xc)
    s.force([spring - s.u[0], -(shell + inside) * G, s.u[0] - spring])
    s.contact("floor", gap=yc, tangents=[xc], mu=mu)
    s.contact("front", gap=xc - xm + 0.12, e=e)
    s.contact("back", gap=xm - xc + 0.12, e=e)
    ocp = swb.Ocp(s, 2.0 * vary(1.0), 20, n_s=2, n_fe=1, initial_state=[0] * 6, control_bounds=(-12, 12), **options)
    ocp.set_lagrange(s.function(0.01 * s.u[0] ** 2))
    ocp.add_terminal(s.function([xc, v[0]]), [0.25, 0], [0.25, 0])
    return s, ocp


def cam(vary, **options):
    """A cam turns once under a sprung follower, which may leave it, and stops."""
    wheel, follower, stiff, lift, e = 0.05 * vary(1.0), 0.3 * vary(1.0), 80 * vary(1.0), 0.05 * vary(1.0), 0.2 * vary(1.0)
    s = swb.Scene("a y", u="T", name="cam")
    (a, y), v = s.q, s.v
    s.inertia([wheel, follower])
    s.force([s.u[0] - 0.02 * v[0], -stiff * y - follower * G - 0.4 * v[1]])
    s.contact("cam", gap=y - lift * (1 - cos(a)) - 0.4 * lift * (1 - cos(2 * a)), e=e)
    ocp = swb.Ocp(s, vary(1.0), 16, n_s=2, n_fe=1, initial_state=[0] * 4, control_bounds=(-3, 3), **options)
    ocp.set_lagrange(s.function(s.u[0] ** 2))
    ocp.add_terminal(s.function([a, v[0]]), [2 * math.pi, 0], [2 * math.pi, 0])
    return s, ocp


def jaws(vary, **options):
    """Two jaws on a carriage grip a part by friction and lift it off a table."""
    jaw, carriage, part, mu, high = 0.3 * vary(1.0), vary(1.0), 0.5 * vary(1.0), 0.7 * vary(1.0), 0.3 * vary(1.0)
    s = swb.Scene("a b c x y", u="Fa Fb lift", name="jaws")
    (a, b, c, x, y), v = s.q, s.v
    s.inertia([jaw, jaw, carriage, part, part])
    s.force([s.u[0] - 0.5 * v[0], s.u[1] - 0.5 * v[1], s.u[2] - carriage * G, 0, -part * G])
    s.contact("left", gap=x - a - 0.1, tangents=[y - c], mu=mu)
    s.contact("right", gap=b - x - 0.1, tangents=[y - c], mu=mu)
    s.contact("table", gap=y)
    start = [-0.2, 0.2, 0, 0, 0] + [0] * 5
    bounds = ([-30, -30, -40], [30, 30, 40])
    ocp = swb.Ocp(s, 1.6 * vary(1.0), 16, n_s=2, n_fe=1, initial_state=start, control_bounds=bounds, **options)
    ocp.set_lagrange(s.function(0.001 * (s.u[0] ** 2 + s.u[1] ** 2 + (s.u[2] - carriage * G) ** 2)))
    ocp.add_terminal(s.function([y, v[4], v[3]]), [high, 0, 0], [high, 0, 0])
    return s, ocp


def ratchet(vary, **options):
    """A sprung pawl pushes a rack on by a tooth and comes back over the next one."""
    pitch, deep = 0.2, 0.04
    pawl, tip, rack, stiff, drag = 0.5 * vary(1.0), 0.2 * vary(1.0), vary(1.0), 40 * vary(1.0), 3 * vary(1.0)
    s = swb.Scene("xp yp xr", u="F", name="ratchet")
    (xp, yp, xr), v = s.q, s.v
    s.inertia([pawl, tip, rack])
    s.force([s.u[0] - 0.5 * v[0], -stiff * yp - 0.5 * v[1] - 3, -drag * v[2]])
    at = 2 * math.pi * (xp - xr) / pitch
    # the valley in front of a tooth: where the slope of the profile is zero and its value -1
    valley = -0.5 * math.pi
    for _ in range(50):
        valley = -0.5 * math.pi + 0.6 * math.cos(valley)
    start = valley * pitch / (2 * math.pi)
    s.contact("tooth", gap=yp - deep * (sin(at - 0.6 * cos(at)) + 1))
    ocp = swb.Ocp(s, 2.0 * vary(1.0), 20, n_s=2, n_fe=1, initial_state=[start] + [0] * 5, control_bounds=(-20, 20), **options)
    ocp.set_lagrange(s.function(0.1 * s.u[0] ** 2))
    goal = [pitch, start, 0, 0]
    ocp.add_terminal(s.function([xr, xp, v[0], v[2]]), goal, goal)
    return s, ocp


SCENES = [crane, seesaw, tray, ramp, bump, step, latch, stairs, capsule, cam, jaws, ratchet]

if __name__ == "__main__":
    main(Problems(SCENES, variants=3, table=Path(__file__).with_name("jump_curved.tsv"), guesses=3))
