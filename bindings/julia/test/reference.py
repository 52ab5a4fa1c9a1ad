"""Write what Python finds with the same library, for the tests of the Julia package to compare with.

usage: reference.py OUTPUT
"""

import json
import sys
from pathlib import Path

import numpy as np

import switchback_control as swb
from switchback_control.expr import Model, sign, where


def stick_slip():
    m = Model(states="q v")
    q, v = m.x
    m.derivatives = [v, -q + where(v > 0.2, -1 / (0.8 + v), 1 / (1.2 - v))]
    r = swb.simulate(m, [-0.8, -1.0], 40.0, rtol=1e-11, atol=1e-11, sensitivity=True)
    return {
        "x_end": r.x_end.tolist(),
        "times": r.switch_times.tolist(),
        "kinds": [s.kind.name.lower() for s in r.switches],
        "before": [[m + 1 for m in s.before] for s in r.switches],
        "after": [[m + 1 for m in s.after] for s in r.switches],
        "dx_dx0": r.dx_dx0.tolist(),
        "switch_derivatives": r.switch_derivatives.tolist(),
    }


def sliding_ocp():
    m = Model(states=4, controls=2)
    q1, q2, v1, v2 = m.x
    m.derivatives = [v1 - sign(q1 + 0.15 * q2**2), v2 - sign(q2 - 0.05 * q1**3), m.u[0], m.u[1]]
    inf, goal = np.inf, [-np.pi / 6, -np.pi / 4]
    ocp = swb.Ocp(
        m,
        4.0,
        6,
        lagrange=m.function(m.u @ m.u + v1**2 + v2**2),
        initial_state=[2 * np.pi / 3, np.pi / 3, 0, 0],
        state_bounds=([-inf, -inf, -2, -2], [inf, inf, 2, 2]),
        control_bounds=(-10, 10),
        n_s=2,
        n_fe=6,
    )
    ocp.add_terminal(m.function([q1, q2]), goal, goal)
    r = ocp.solve()
    return {"cost": r.cost, "controls": r.controls.tolist()}


def main(path: str) -> None:
    Path(path).write_text(json.dumps({"stick_slip": stick_slip(), "sliding_ocp": sliding_ocp()}), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1])
