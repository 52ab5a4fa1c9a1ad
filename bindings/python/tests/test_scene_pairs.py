"""Every pair of ingredients of a scene acts on one body; the reference is SciPy, from event to event, by the rules of Filippov and Newton."""

import itertools
import pathlib

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import switchback_control as swb

INGREDIENTS = ("contact", "dry joint", "constraint", "further state", "switch", "transition", "clock")
DOCS = pathlib.Path(__file__).resolve().parents[3] / "docs"
WALL, MARK, STRIKE, PERIOD, END = 1.0, 0.45, 0.3, 0.5, 2.05
START = [0.0, 1.5]
#     drive  F    k    v_ref  e    voltage
DATA = [0.6, 0.4, 1.2, 0.5, 0.6, 0.5]


def scene(chosen):
    """The body with what is chosen, and where position, velocity and the further state stand."""
    tied = "constraint" in chosen
    s = swb.Scene("x y" if tied else "x", p="drive F k v_ref e voltage", states="z" if "further state" in chosen else 0)
    x, v, p = s.q[0], s.v[0], s.p
    force = s.drive
    if "further state" in chosen:
        force = force + s.z
        s.state_rates([2.0 * (s.voltage - s.z)])
    if "switch" in chosen:
        force = force - s.k * swb.sign(v - s.v_ref)
    if "dry joint" in chosen:
        s.friction("joint", x, s.F)
    if tied:
        s.constraint("tie", s.q[1] - x)
    if "contact" in chosen:
        s.contact("wall", gap=WALL - x, e=s.e)
    if "transition" in chosen:
        beyond = s.discrete("beyond", 0)
        force = force - 1.1 * beyond
        rest = {s.v[1]: 0.7 * s.v[1]} if tied else {}
        s.transition(x > MARK, when={beyond: 0}, reset={v: 0.7 * v, **rest}, to={beyond: 1})
    if "clock" in chosen:
        rest = {s.v[1]: s.v[1] + 0.4} if tied else {}
        s.every(PERIOD, {v: v + 0.4, **rest}, offset=STRIKE)
    s.force([force, 0.0] if tied else [force])
    return s, (0, 2 if tied else 1)


def reference(chosen, start, p):
    """Position, velocity and further state at the end."""
    drive, bound, k, v_ref, e, voltage = p
    mass = 2.0 if "constraint" in chosen else 1.0
    steps = [(0.0, bound)] * ("dry joint" in chosen) + [(v_ref, k)] * ("switch" in chosen)
    strikes = list(np.arange(STRIKE, END, PERIOD)) if "clock" in chosen else []
    t, y, beyond, on = 0.0, np.array([*start, 0.0]), 0.0, None
    sides = [np.sign(y[1] - at) for at, _ in steps]

    def force(y, sides):
        push = drive + (y[2] if "further state" in chosen else 0.0) - 1.1 * beyond
        return push - sum(h * side for (_, h), side in zip(steps, sides))

    def beside(i, side):
        return [side if j == i else other for j, other in enumerate(sides)]

    for _ in range(200):
        if on is not None and not force(y, beside(on, -1.0)) > 0.0 > force(y, beside(on, 1.0)):
            sides[on] = 1.0 if force(y, beside(on, 1.0)) >= 0.0 else -1.0
            on = None
        own, held = list(sides), on
        events = []
        if held is None:
            for i, (at, _) in enumerate(steps):
                events.append((lambda _, y, i=i, at=at: own[i] * (y[1] - at), ("reach", i)))
        else:
            events.append((lambda _, y: force(y, beside(held, -1.0)), ("leave", -1.0)))
            events.append((lambda _, y: -force(y, beside(held, 1.0)), ("leave", 1.0)))
        if "contact" in chosen:
            events.append((lambda _, y: WALL - y[0], ("hit", 0)))
        if "transition" in chosen and beyond == 0.0:
            events.append((lambda _, y: MARK - y[0], ("mark", 0)))
        functions = []
        for f, _ in events:
            g = lambda t, y, f=f: f(t, y)
            g.terminal, g.direction = True, -1.0
            functions.append(g)
        until = strikes[0] if strikes else END
        rhs = lambda _, y: [y[1], 0.0 if held is not None else force(y, own) / mass, 2.0 * (voltage - y[2])]
        done = solve_ivp(rhs, (t, until), y, method="DOP853", rtol=1e-12, atol=1e-13, max_step=0.02, events=functions)
        t, y = done.t[-1], done.y[:, -1].copy()
        if done.status == 0:
            if not strikes:
                return y[: 3 if "further state" in chosen else 2]
            strikes.pop(0)
            y[1], on = y[1] + 0.4, None
        else:
            what, which = events[next(k for k, times in enumerate(done.t_events) if times.size)][1]
            if what == "reach":
                y[1], on = steps[which][0], which
                continue
            if what == "leave":
                sides[on], on = which, None
                continue
            if what == "hit":
                y[0], y[1] = WALL, -e * y[1]
            else:
                y[0], y[1], beyond = MARK, 0.7 * y[1], 1.0
            on = None
        sides = [np.sign(y[1] - at) for at, _ in steps]
    raise AssertionError("too many events")


@pytest.mark.parametrize("chosen", list(itertools.combinations(INGREDIENTS, 2)) + [INGREDIENTS], ids="+".join)
def test_pair(chosen):
    s, (x, v) = scene(chosen)
    tied = "constraint" in chosen
    start = s._start([START[0]] * (1 + tied), [START[1]] * (1 + tied), [0.0] * ("further state" in chosen))
    e = swb.Integrator(s.system(), rtol=1e-11, atol=1e-12, sensitivity=True, adjoint=True)
    e.set_params(DATA)
    e.reinit(start)
    e.advance(END)
    assert e.outcome == swb.RunOutcome.REACHED, e.reason
    places = [x, v] + [4 if tied else 2] * ("further state" in chosen)
    np.testing.assert_allclose(e.state[places], reference(chosen, START, DATA), rtol=1e-7, atol=1e-8)
    # derivatives: forward, adjoint, and differences of the reference; changes of the start keep the tie
    n = len(start)
    run = e.run
    forward = np.concatenate([run.dx_dx0, run.dx_dp], axis=1)
    h = 1e-4
    for c in range(2 + len(DATA)):
        moved = []
        for by in (-2, -1, 1, 2):
            z = np.array([*START, *DATA])
            z[c] += by * h
            moved.append(reference(chosen, z[:2], z[2:]))
        slope = (moved[0] - 8 * moved[1] + 8 * moved[2] - moved[3]) / (12 * h)
        columns = [[x] + [1] * tied, [v] + [3] * tied][c] if c < 2 else [n + c - 2]
        np.testing.assert_allclose(forward[places][:, columns].sum(axis=1), slope, rtol=1e-5, atol=1e-5, err_msg=f"column {c}")
    for i in range(n):
        g = e.adjoint(np.eye(n)[i])
        np.testing.assert_allclose(np.concatenate([g.x0, g.p]), forward[i][: n + len(DATA)], rtol=1e-7, atol=1e-7)


def table(title):
    """Rows of a table of the page, by their names."""
    text = (DOCS / "scenes.md").read_text(encoding="utf-8")
    lines = text[text.index(f"| {title} |") :].split("\n\n")[0].splitlines()
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    assert rows[0][1:] == list(INGREDIENTS)
    return {row[0]: dict(zip(INGREDIENTS, row[1:])) for row in rows[2:]}


def test_the_page_has_the_pairs_that_are_tested():
    rows = table("next to")
    assert list(rows) == list(INGREDIENTS) and all(set(row.values()) == {"yes"} for row in rows.values())


METHODS = {
    "events (`simulate`)": lambda s, start: swb.simulate(s, start, 0.1, p=DATA),
    "time stepping (`simulate_steps`)": lambda s, start: swb.simulate_steps(s, start[: s.n_q], start[s.n_q : s.n_q + s.n_v], 0.1, p=DATA),
    "time-freezing (`freeze`)": lambda s, start: s.freeze(),
    "optimal control (`Ocp`)": lambda s, start: swb.Ocp(s, 1.0, 4, initial_state=start),
    "finite elements (`simulate_fesd`)": lambda s, start: swb.simulate_fesd(s.system(), start, 0.1, 2, p=DATA),
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("one", INGREDIENTS)
def test_the_page_says_who_follows_what(method, one):
    s, _ = scene((one,))
    if one == "contact":
        # restitution that is an expression is not what is asked here
        s = swb.Scene("x", p="drive F k v_ref e voltage")
        s.force([s.drive])
        s.contact("wall", gap=WALL - s.q[0])
    tied = one == "constraint"
    start = s._start([START[0]] * (1 + tied), [START[1]] * (1 + tied), [0.0] * (one == "further state"))
    call = METHODS[method]
    if table("follows")[method][one] == "no":
        with pytest.raises(swb.UnsupportedError, match="cannot follow|does not follow"):
            call(s, start)
    elif "steps" in method and one == "further state":
        swb.simulate_steps(s, start[:1], start[1:2], 0.1, states=[0.0], p=DATA)
    else:
        call(s, start)
