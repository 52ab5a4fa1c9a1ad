"""Bodies in space beside MuJoCo and Drake: error at the end against seconds, on motions whose end is known.

usage: space_peers.py [--json FILE] [--figure FILE]

What is not installed (mujoco, drake) is left out. All read the same models, in MuJoCo's XML. MuJoCo and Drake go by steps of
fixed length, Switchback by tolerances; seconds are the least of three, without reading and writing the model, on one core.
MuJoCo's contacts are soft by design, its cones are elliptic here, and its solver has its own settings, as Drake's has (SAP).
"""

import argparse
import json
import os
import time

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

import switchback_control as swb

G, MU = 9.81, 0.2


def world(body, plane="", options=""):
    ground = f'<geom name="ground" type="plane" size="50 50 1" friction="{MU} 0 0" condim="3" {plane}/>'
    return f"""<mujoco model="peer"><option gravity="0 0 {-G}" cone="elliptic" impratio="10" {options}/><worldbody>
      {ground if plane is not None else ""}{body}</worldbody></mujoco>"""


def smooth(body):
    return world(body, None, 'integrator="RK4"')


BALL = f"""<body name="ball" pos="0 0 0.2"><freejoint/>
  <geom type="sphere" size="0.2" mass="3" friction="{MU} 0 0" condim="3"/></body>"""
SLOPE = np.arctan(0.9 * MU)
BOX = f"""<body name="box" pos="{0.05 * np.sin(SLOPE)} 0 {0.05 * np.cos(SLOPE)}" quat="{np.cos(SLOPE / 2)} 0 {np.sin(SLOPE / 2)} 0">
  <freejoint/><geom type="box" size="0.2 0.15 0.05" mass="2" friction="{MU} 0 0" condim="3"/></body>"""
CHAIN = "".join(
    f'<body name="link {k}" pos="{0.4 if k else 0} 0 0"><joint name="joint {k}" axis="{axis}"/>'
    f'<inertial pos="0.2 0 0" mass="1" diaginertia="0.002 0.015 0.015"/>'
    for k, axis in enumerate(("0 1 0", "0 0 1", "0 1 0", "1 1 0"))
) + "</body>" * 4
SPIN = """<body name="body"><freejoint/><inertial pos="0 0 0" mass="2" diaginertia="1 2 3"/></body>"""


def rolled(t):
    """The ball slides until its speed is 5/7 of that at the start, then it rolls."""
    until = 2.0 / (7 * MU * G)
    return until - 0.5 * MU * G * until**2 + 5 / 7 * (t - until)


# name, model, velocities at the start (world, then along the axes of the body), end, what is measured, what it should be
PROBLEMS = (
    ("ball that begins to roll", world(BALL), [1.0, 0, 0, 0, 0, 0], 2.0, lambda q: q[:1], [rolled(2.0)]),
    ("box held by friction on a slope", world(BOX, f'euler="0 {np.degrees(SLOPE)} 0"'), [0.0] * 6, 10.0,
     lambda q: q[:3], [0.05 * np.sin(SLOPE), 0.0, 0.05 * np.cos(SLOPE)]),
    ("tumbling body", world(SPIN, None, 'integrator="RK4"').replace(f"0 0 {-G}", "0 0 0"), [0, 0, 0, 0.02, 2.0, 0.01], 12.0,
     lambda q: q[3:7] * np.sign(q[3]), None),
    ("chain of four links", smooth(CHAIN), [0.5, 1.0, 0.0, 2.0], 3.0, lambda q: q, None),
)  # fmt: skip


def least(run):
    took = []
    for _ in range(3):
        start = time.perf_counter()
        result = run()
        took.append(time.perf_counter() - start)
    return result, min(took)


def switchback(model, v, end, tolerance):
    w = swb.World.from_mjcf(model, mu=MU)
    q0, v0 = w.start()
    system = w.scene.system()
    x = np.r_[q0, v]
    run, took = least(lambda: swb.simulate(system, x, end, rtol=tolerance, atol=1e-2 * tolerance, dense=False))
    assert run.success, run.reason
    return run.x_end[: len(q0)], took


def mujoco_steps(model, v, end, h):
    import mujoco

    m = mujoco.MjModel.from_xml_string(model)
    m.opt.timestep = h
    d = mujoco.MjData(m)
    n = round(end / h)

    def run():
        mujoco.mj_resetData(m, d)
        d.qvel[:] = v
        mujoco.mj_step(m, d, nstep=n)
        return d.qpos.copy()

    return least(run)


def drake_steps(model, v, end, h):
    from pydrake.all import AddMultibodyPlantSceneGraph, DiagramBuilder, DiscreteContactApproximation, Parser, Simulator

    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, h)
    plant.set_discrete_contact_approximation(DiscreteContactApproximation.kSap)
    Parser(plant).AddModelsFromString(model, "xml")
    plant.mutable_gravity_field().set_gravity_vector([0, 0, 0 if 'gravity="0 0 0"' in model else -G])
    plant.Finalize()
    diagram = builder.Build()
    floating = plant.num_positions() == 7

    def run():
        simulator = Simulator(diagram)
        context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
        if floating:
            q = start_of(model)
            plant.SetPositions(context, np.r_[q[3:], q[:3]])
            turn = swb.shapes.rotation(q[3:], "q")
            plant.SetVelocities(context, np.r_[turn @ v[3:], v[:3]])
        else:
            plant.SetVelocities(context, v)
        simulator.Initialize()
        simulator.AdvanceTo(end)
        q = plant.GetPositions(context)
        return np.r_[q[4:], q[:4]] if floating else q

    return least(run)


def start_of(model):
    q, _ = swb.World.from_mjcf(model).start()
    return q


def accurate(model, v, end):
    """The end by a run that is much finer than all others."""
    return switchback(model, v, end, 1e-13)[0]


METHODS = {
    "Switchback": (switchback, [10.0**-k for k in range(3, 12)]),
    "MuJoCo": (mujoco_steps, [1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5]),
    "Drake": (drake_steps, [1e-2, 3e-3, 1e-3, 3e-4, 1e-4]),
}


def measured():
    rows = []
    for name, model, v, end, what, exact in PROBLEMS:
        exact = np.array(what(accurate(model, v, end)) if exact is None else exact)
        for method, (run, settings) in METHODS.items():
            for setting in settings:
                try:
                    q, took = run(model, np.array(v, dtype=float), end, setting)
                except ImportError:
                    break
                error = float(np.abs(what(np.asarray(q)) - exact).max())
                rows.append({"problem": name, "method": method, "setting": setting, "error": error, "seconds": took})
                print(f"{name:34} {method:11} {setting:8.0e} {error:9.1e} {took:9.2e} s", flush=True)
    return rows


def figure(rows, path):
    import matplotlib.pyplot as plt

    fig, axes = plt.subplots(1, len(PROBLEMS), figsize=(13, 3.4), sharey=True, layout="constrained")
    for ax, (name, *_) in zip(axes, PROBLEMS):
        for k, method in enumerate(METHODS):
            own = [r for r in rows if r["problem"] == name and r["method"] == method]
            # an error of zero is drawn as rounding
            ax.loglog([r["seconds"] for r in own], [max(r["error"], 1e-16) for r in own], "o-", color=f"C{k}", label=method, markersize=3)
        ax.set_title(name, fontsize="small")
        ax.set_xlabel("seconds")
        ax.grid(True, alpha=0.3)
    axes[0].set_ylabel("error at the end")
    axes[0].legend(fontsize="small")
    fig.savefig(path)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json")
    parser.add_argument("--figure")
    given = parser.parse_args()
    found = measured()
    if given.json:
        with open(given.json, "w", encoding="utf-8") as file:
            json.dump(found, file, indent=0)
    if given.figure:
        figure(found, given.figure)
