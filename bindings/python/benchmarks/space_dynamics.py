"""Dynamics of a robot from its URDF beside Pinocchio's, at random states, and the time of an evaluation.

usage: space_dynamics.py [--floating] FILE.urdf

Needs pinocchio (pip install pin). What is not taken of the file is left out. Pinocchio's velocities of a free base are those of
the frame of the link, along its axes; here they are those of the centre of mass, along the axes of the world: accelerations are
compared in Pinocchio's.
"""

import argparse
import time

import numpy as np
import pinocchio as pin

import switchback_control as swb
from switchback_control.multibody import Trees
from switchback_control.robots import _URDF_PARTS

LEFT_OUT = [p for p in _URDF_PARTS if p not in ("damping", "friction")]


def against(w, trees, model, rng):
    """Relative differences of inertia and accelerations at a random state."""
    data = model.createData()
    q, v = rng.normal(size=trees.n_q), rng.normal(size=trees.n_v)
    states, _ = trees.states(q, v)
    other, to = np.zeros(model.nq), np.zeros((model.nv, trees.n_v))
    shift = np.zeros(model.nv)
    for h in trees.held:
        if h.joint is None:
            turn = np.array(states[h.body.name].rotation)
            # Pinocchio puts what is fixed to the base into it, its frame stays that of the link
            frame = model.frames[model.getFrameId(h.body.name)]
            centre = CENTRES[h.body.name]
            assert frame.placement.isIdentity()
            unit = q[3:7] / np.linalg.norm(q[3:7])
            other[:3], other[3:7] = q[:3] - turn @ centre, unit[[1, 2, 3, 0]]
            to[:3, :3], to[:3, 3:6], to[3:6, 3:6] = turn.T, pin.skew(centre), np.eye(3)
            shift[:3] = -np.cross(v[3:6], turn.T @ v[:3])
        elif h.n_v:
            name = h.joint.name if model.existJointName(h.joint.name) else h.joint.name.removesuffix(" joint")
            joint = model.joints[model.getJointId(name)]
            to[joint.idx_v, h.v] = 1.0
            angle = q[h.q]
            other[joint.idx_q : joint.idx_q + joint.nq] = [np.cos(angle), np.sin(angle)] if joint.nq == 2 else [angle]
    frames = trees.frames(list(q), list(v))
    mine = np.array(trees.inertia(frames), dtype=float)
    force = np.array(trees.force(frames, list(v), w.gravity, {}), dtype=float)
    full = pin.crba(model, data, other)
    full = np.triu(full) + np.triu(full, 1).T
    rates = to @ np.linalg.solve(mine, force) + shift
    its = np.linalg.solve(full, -pin.nonLinearEffects(model, data, other, to @ v))
    return abs(to.T @ full @ to - mine).max() / abs(mine).max(), abs(rates - its).max() / abs(its).max()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--floating", action="store_true")
    parser.add_argument("file")
    given = parser.parse_args()
    w = swb.World.from_urdf(given.file, given.floating, ignore=LEFT_OUT)
    CENTRES = {j.parent.name: np.zeros(3) for j in w.joints if j.parent is not None}
    free = [b.name for b in w.bodies if b.name not in {j.body.name for j in w.joints}]
    model = pin.buildModelFromUrdf(given.file, *([pin.JointModelFreeFlyer()] if given.floating else []))
    for name in free:
        import xml.etree.ElementTree as ElementTree

        origin = ElementTree.parse(given.file).getroot().find(f"link[@name='{name}']/inertial/origin")
        CENTRES[name] = np.array([float(c) for c in (origin.get("xyz") if origin is not None else "0 0 0").split()])
    trees = Trees.of(w.bodies, w.joints, {b.name: "free" for b in w.bodies})
    rng = np.random.default_rng(0)
    found = np.array([against(w, trees, model, rng) for _ in range(20)])
    print(f"{trees.n_v} velocities, inertia {found[:, 0].max():.1e}, accelerations {found[:, 1].max():.1e}")
    for name in free:
        w.place(name, z=1.0)
    x = np.concatenate(w.start()) + np.r_[np.zeros(trees.n_q), rng.normal(size=trees.n_v)]
    began = time.perf_counter()
    system = w.scene.system()
    built = time.perf_counter() - began
    stats = min((swb.simulate(system, x, 1.0, dense=False).stats for _ in range(5)), key=lambda s: s.time_total)
    print(f"written in {built:.2f} s, {1e6 * stats.time_total / stats.evaluations:.0f} us an evaluation, {stats.steps} steps a second")
