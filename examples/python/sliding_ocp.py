"""Optimal control through sliding modes: the cheapest way along two curves that catch the state.

    q' = -sign c(q) + v,  v' = u,  c = (q1 + 0.15 q2^2, q2 - 0.05 q1^3)
    min of the integral of |u|^2 + |v|^2 over [0, 4],  q(0) = (2 pi/3, pi/3),  q(4) = -(pi/6, pi/4)

The state reaches one curve, slides on it to where the curves cross, stays there for a while, and leaves for the goal.
The controls found are simulated again with another discretisation, to check the solution.

usage: sliding_ocp.py FOLDER_FOR_PLOTS
"""

import sys
from pathlib import Path

import numpy as np

import switchback_control as swb

T, STAGES = 4.0, 6
X0 = [2 * np.pi / 3, np.pi / 3, 0.0, 0.0]
GOAL = np.array([-np.pi / 6, -np.pi / 4])

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)

system = swb.System(nx=4, nu=2)
system.set_f0(swb.Function.affine(np.zeros(4), np.eye(4, 6, k=2), nx=4, nu=2))  # q' = v, v' = u
curves = [
    system.function(
        lambda x: x[0] + 0.15 * x[1] ** 2,
        jacobian=lambda x: [1.0, 0.3 * x[1], 0.0, 0.0],
        jacobian_pattern=([0, 0], [0, 1]),
        hessian=lambda weights: 0.3 * weights,
        hessian_pattern=([1], [1]),
    ),
    system.function(
        lambda x: x[1] - 0.05 * x[0] ** 3,
        jacobian=lambda x: [-0.15 * x[0] ** 2, 1.0, 0.0, 0.0],
        jacobian_pattern=([0, 0], [0, 1]),
        hessian=lambda x, weights: -0.3 * x[0] * weights,
        hessian_pattern=([0], [0]),
    ),
]
for i, curve in enumerate(curves):
    assert curve.check_derivatives(X0, [0.0, 0.0]), "wrong derivatives"
    system.add_subsystem([[-1.0], [1.0]], curve, signs=[1, -1], rows=[i])

rate = system.function(
    lambda x, u: u @ u + x[2:] @ x[2:],
    jacobian=lambda x, u: 2 * np.concatenate([x[2:], u]),
    jacobian_pattern=([0] * 4, [2, 3, 4, 5]),
    hessian=lambda weights: np.full(4, 2 * weights[0]),
    hessian_pattern=([2, 3, 4, 5], [2, 3, 4, 5]),
)
ocp = swb.Ocp(
    system,
    T,
    STAGES,
    lagrange=rate,
    initial_state=X0,
    state_bounds=([-np.inf, -np.inf, -2.0, -2.0], [np.inf, np.inf, 2.0, 2.0]),
    control_bounds=(-10.0, 10.0),
    n_s=2,
    n_fe=6,
)
ocp.add_terminal(swb.Function.affine(np.zeros(2), np.eye(2, 4), nx=4, nu=2), GOAL, GOAL)

result = ocp.solve()
stats = result.stats
print(f"{result.message}, cost {result.cost:.9f}, {stats.iterations} iterations, {stats.time_total:.3f} s")
print("controls:", *np.round(result.controls, 5).tolist())
for s in result.trajectory.switches:
    print(f"  t = {s.t:8.6f}  curve {s.subsystem + 1}: modes {s.before} -> {s.after}")

with swb.Simulator(system, n_s=4, n_fe=3) as sim:
    sim.set_state(X0)
    for u in result.controls:
        sim.set_controls(u)
        sim.run(T / STAGES, 20)
    print(f"simulated again: the goal is missed by {np.abs(sim.state[:2] - GOAL).max():.1e}")

result.plot(
    folder / "python_sliding_ocp.svg",
    names=["q1", "q2", "v1", "v2"],
    control_names=["u1", "u2"],
    title="Optimal control through two sliding modes",
)
