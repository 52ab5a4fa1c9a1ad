"""Controls that choose among values."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import switchback_control as swb


def heater(stages: int = 6, values: object = (0, 1), dwell: float = 0.0, **options: object) -> swb.Ocp:
    """A room near 20 degrees by a heater that is on or off."""
    m = swb.Model("T", "on")
    m.derivatives = [4.0 * m.on - 0.2 * (m.T - 5.0)]
    m.choice("on", values, dwell)
    ocp = swb.Ocp(m, 6.0, stages, initial_state=[15.0], **options)
    ocp.set_lagrange(m.function((m.T - 20) ** 2 + 2.0 * m.on))
    return ocp


def cost(on: tuple[float, ...]) -> float:
    """What a sequence costs, from the closed form of the temperature: between two times `T = c + (T0 - c) exp(-0.2 t)`."""
    T, total, h = 15.0, 0.0, 6.0 / len(on)
    for u in on:
        c = 5.0 + 20.0 * u
        d, a = T - c, 0.2
        total += (c - 20) ** 2 * h + 2 * (c - 20) * d * (1 - np.exp(-a * h)) / a + d**2 * (1 - np.exp(-2 * a * h)) / (2 * a) + 2.0 * u * h
        T = c + d * np.exp(-a * h)
    return total


@pytest.mark.parametrize("values", [(0, 1), (0, 0.5, 1)])
def test_the_optimum_is_that_of_enumeration(values):
    r = heater(values=values, n_s=3).solve()
    best = min(cost(on) for on in itertools.product(values, repeat=6))
    assert r.success and r.optimality.verdict == "global"
    assert abs(r.cost - best) <= 1e-7 * best and abs(cost(tuple(r.controls[:, 0])) - best) <= 1e-9 * best
    assert r.optimality.gap <= 1e-6 and set(np.unique(r.controls)) <= set(values)


def test_values_are_held():
    r = heater(12, dwell=1.4, n_s=3).solve()
    u = r.controls[:, 0]
    runs = [len(list(g)) for _, g in itertools.groupby(u)]
    assert r.optimality.verdict == "global" and min(runs[1:-1], default=3) >= 3  # of stages of 0.5

    def held(on):
        inner = [len(list(g)) for _, g in itertools.groupby(on)][1:-1]
        return min(inner, default=3) >= 3

    best = min(cost(on) for on in itertools.product((0.0, 1.0), repeat=12) if held(on))
    assert abs(r.cost - best) <= 1e-6 * best


def test_choices_beside_modes_and_transitions():
    m = swb.Model("s v", "push")
    m.derivatives = [m.v, 2 * m.push - 0.5 * swb.sign(m.v) - 0.2 * m.v]
    m.choice("push", [-1, 0, 1])
    ocp = swb.Ocp(m, 3.0, 5, initial_state=[0, 0])
    ocp.set_lagrange(m.function((m.s - 1) ** 2 + 0.1 * m.push**2))
    r = ocp.solve()
    assert r.success and r.optimality.verdict == "global"
    # by simulations of all sequences, with the cost as a state
    w = swb.Model("s v J", "push")
    w.derivatives = [w.v, 2 * w.push - 0.5 * swb.sign(w.v) - 0.2 * w.v, (w.s - 1) ** 2 + 0.1 * w.push**2]
    every = itertools.product((-1.0, 0.0, 1.0), repeat=5)
    best = min(swb.simulate(w, [0, 0, 0], 3.0, u=np.array(u).reshape(5, 1), rtol=1e-8).x_end[2] for u in every)
    assert abs(r.cost - best) <= 1e-4 * best


def test_documents_keep_choices():
    ocp = heater(values=(1, 0), dwell=0.5)
    again = swb.Ocp.from_json(ocp.to_json())
    assert again.solve().cost == ocp.solve().cost
    m = swb.Model("T", "on")
    m.derivatives = [m.on - m.T]
    m.choice(m.on, [2, 1], 0.25)
    copy = swb.Model.from_json(m.to_json())
    assert copy.to_json() == m.to_json() and "choice: on is one of 1, 2, each held for 0.25" in copy.report()


def test_wrong_choices_say_what_to_do():
    m = swb.Model("T", "on")
    m.derivatives = [m.on - m.T]
    with pytest.raises(swb.SwitchbackError, match="no control"):
        m.choice("off", [0, 1])
    m.choice("on", [0, 0])
    with pytest.raises(swb.SwitchbackError, match="listed twice"):
        m.system()
    s = swb.System(1, 1, 0, f0=lambda x, u: [u[0] - x[0]])
    for given, text in ((([], 0.0), "needs values"), (([0, np.nan], 0.0), "needs values"), (([0, 1], -1.0), "dwell")):
        with pytest.raises(swb.SwitchbackError, match=text):
            s.add_choice(0, *given)
    with pytest.raises(swb.SwitchbackError, match="there are 1 controls"):
        s.add_choice(1, [0, 1])
    s.add_choice(0, [0, 1])
    with pytest.raises(swb.SwitchbackError, match="already"):
        s.add_choice(0, [0, 1])
    ocp = swb.Ocp(s, 1.0, 2, initial_state=[0.0], control_bounds=([0.2], [0.8]))
    with pytest.raises(swb.SwitchbackError, match="no value to choose between"):
        ocp.solve()
    with pytest.raises(swb.SwitchbackError, match="no value to choose between"):
        swb.Nmpc(ocp)


def test_a_guess_is_not_lost():
    ocp = heater(10, n_s=3, search_exact=0.0)
    best = heater(10, n_s=3).solve()
    ocp.set_control_guess(best.controls)
    r = ocp.solve()
    assert r.cost <= best.cost * (1 + 1e-8)
