"""Robots from files: dynamics against links written by hand and other packages, and refusals by name."""

import numpy as np
import pytest

import switchback_control as swb
from switchback_control import _gaps
from switchback_control.multibody import Trees
from switchback_control.shapes import _Pair

ARM = """<robot name="arm">
  <link name="base"/>
  <link name="a">
    <inertial><origin xyz="0.1 0 0.2" rpy="0.1 0.2 0.3"/><mass value="1.5"/>
      <inertia ixx="0.1" iyy="0.12" izz="0.05" ixy="0.01" ixz="0" iyz="0"/></inertial>
    <visual><geometry><mesh filename="a.stl"/></geometry></visual>
    <collision><origin xyz="0.1 0.2 0.3"/><geometry><sphere radius="0.1"/></geometry></collision>
  </link>
  <link name="b">
    <inertial><origin xyz="0 0.1 0.2"/><mass value="0.7"/><inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin rpy="0 1.5707963267948966 0"/><geometry><capsule radius="0.05" length="0.4"/></geometry></collision>
    <collision><geometry><box size="0.1 0.2 0.3"/></geometry></collision>
  </link>
  <link name="tip"><inertial><mass value="0.2"/>
    <inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="tip" type="fixed"><parent link="b"/><child link="tip"/><origin xyz="0 0.2 0.3" rpy="0 0 1"/></joint>
  <joint name="turn" type="revolute">
    <parent link="base"/><child link="a"/><origin xyz="0 0 0.3" rpy="0.2 0 0"/><axis xyz="0 0 2"/>
    <limit lower="-1" upper="1.2" effort="5" velocity="1"/><dynamics damping="0.1" friction="0.05"/>
  </joint>
  <joint name="reach" type="prismatic">
    <parent link="a"/><child link="b"/><origin xyz="0 0.2 0.3" rpy="0.2 0.5 0"/><axis xyz="0 1 1"/>
    <limit lower="-0.5" upper="0.5" effort="5" velocity="1"/>
  </joint>
</robot>"""


def test_an_urdf_is_the_tree_it_describes(tmp_path):
    from switchback_control._spatial import of_angles

    w = swb.World.from_urdf(ARM, mu=0.3)
    assert [b.name for b in w.bodies] == ["base", "a", "b", "tip"]
    assert [j.name for j in w.joints] == ["base base", "turn", "reach", "tip joint"]
    turn = w.joints[1]
    assert turn.limits == (-1.0, 1.2) and turn.damping == 0.1 and turn.friction == 0.05
    hand = swb.World(space=True, mu=0.3)
    r = np.array(of_angles(0.1, 0.2, 0.3))
    inertia = r @ np.array([[0.1, 0.01, 0], [0.01, 0.12, 0], [0, 0, 0.05]]) @ r.T
    a = hand.link(1.5, inertia, name="a")
    hand.joint("hinge", None, a, [0, 0, 0.3], [-0.1, 0, -0.2], [0, 0, 1], turn=[0.2, 0, 0], damping=0.1, friction=0.05, name="turn")
    # b and its tip in one: moments about the common centre of mass
    places, masses = np.array([[0, 0.1, 0.2], [0, 0.2, 0.3]]), np.array([0.7, 0.2])
    middle = masses @ places / 0.9
    whole = np.diag([0.02, 0.02, 0.01]) + 0.001 * np.eye(3)
    for m, c in zip(masses, places - middle):
        whole = whole + m * (c @ c * np.eye(3) - np.outer(c, c))
    b = hand.link(0.9, whole, name="b")
    hand.joint("slider", a, b, [-0.1, 0.2, 0.1], -middle, [0, 1, 1], turn=[0.2, 0.5, 0], name="reach")
    for world in (w, hand):
        world.set("turn", 0.1, 0.2), world.set("reach", 0.05, -0.1)
    ends = []
    for world in (w, hand):
        run = world.simulate(0.2, rtol=1e-10, atol=1e-11)
        ends.append([[float(s.q), float(s.v)] for s in (world.trajectory(run, j, 0.2) for j in ("turn", "reach"))])
    assert np.array(ends[0]) == pytest.approx(np.array(ends[1]), abs=1e-9)
    # shapes: spots of a ball, two ends and eight corners
    w.floor(-5.0)
    assert len([c for c in w.scene.contacts if c.name.endswith("floor")]) == 11
    path = tmp_path / "arm.urdf"
    path.write_text(ARM, encoding="utf-8")
    assert len(swb.World.from_urdf(path).bodies) == 4


def test_a_floating_base_falls():
    with pytest.raises(swb.RangeError, match="base has no mass"):
        swb.World.from_urdf(ARM, floating=True)
    heavy = "<inertial><mass value='2'/><inertia ixx='1' iyy='1' izz='1'/></inertial>"
    w = swb.World.from_urdf(ARM.replace('<link name="base"/>', f'<link name="base">{heavy}</link>'), True, gravity=10.0)
    w.place("base", z=1.0)
    run = w.simulate(0.3, rtol=1e-10, atol=1e-11)
    s = w._states(run, np.array(0.3))
    height = sum(b.mass * s[b].z for b in w.bodies) / sum(b.mass for b in w.bodies)
    before = w._states(run, np.array(0.0))
    assert height - sum(b.mass * before[b].z for b in w.bodies) / sum(b.mass for b in w.bodies) == pytest.approx(-0.45, abs=1e-9)


def test_a_joint_that_mimics():
    link = "<link name='{}'><inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1'/></inertial></link>"
    joint = "<joint name='{0} axle' type='continuous'><parent link='base'/><child link='{0}'/><axis xyz='0 0 1'/>{1}</joint>"
    text = "<robot name='r'><link name='base'/>" + link.format("a") + link.format("b")
    text += joint.format("a", "") + joint.format("b", "<mimic joint='a axle' multiplier='-2' offset='0.1'/>") + "</robot>"
    w = swb.World.from_urdf(text, gravity=0.0)
    w.set("b axle", 0.1), w.force("a axle", lambda s: 2.5)
    run = w.simulate(1.0, rtol=1e-10, atol=1e-11)
    assert w.trajectory(run, "a axle", 1.0).v == pytest.approx(0.5, abs=1e-9)
    assert w.trajectory(run, "b axle", 1.0).v == pytest.approx(-1.0, abs=1e-9)


def test_an_urdf_against_pinocchio():
    pin = pytest.importorskip("pinocchio")
    w = swb.World.from_urdf(ARM)
    model = pin.buildModelFromXML(ARM)
    data = model.createData()
    trees = Trees.of(w.bodies, w.joints, {})
    rng = np.random.default_rng(1)
    for _ in range(5):
        q, v = rng.normal(size=2), rng.normal(size=2)
        frames = trees.frames(list(q), list(v))
        mass = pin.crba(model, data, q)
        mine = np.array(trees.inertia(frames), dtype=float)
        assert mine == pytest.approx(np.triu(mass) + np.triu(mass, 1).T, rel=1e-12)
        force = np.array(trees.force(frames, list(v), w.gravity, {}), dtype=float)
        assert force == pytest.approx(-pin.nonLinearEffects(model, data, q, v), rel=1e-12, abs=1e-12)


def changed(*pairs):
    text = ARM
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new, 1)
    return text


def test_cylinders_of_an_urdf():
    text = changed(("<sphere radius=\"0.1\"/>", "<cylinder radius='0.1' length='0.7'/>"))
    w = swb.World.from_urdf(text)
    (shape,) = [s for b in w.bodies for s in b.shapes if s.kind == "cylinder"]
    (before,) = [s for b in swb.World.from_urdf(ARM).bodies for s in b.shapes if s.kind == "sphere"]
    assert shape.size == (0.7, 0.1) and shape.radius == 0.0 and shape.at == pytest.approx(before.at)
    # along z in files
    assert shape.turn[:, 0] == pytest.approx(before.turn[:, 2], abs=1e-15)
    w.floor(-5.0)
    assert len([c for c in w.scene.contacts if "rim" in c.name]) == 2


def test_what_is_not_taken_of_an_urdf_is_refused_by_name():
    mesh = changed(("<sphere radius=\"0.1\"/>", "<mesh filename='a.stl'/>"))
    gazebo = changed(("</robot>", "<gazebo/></robot>"))
    for text, part, words in ((mesh, "mesh", "link a: mesh"), (gazebo, "gazebo", "robot: gazebo")):
        with pytest.raises(swb.UnsupportedError, match=rf"{words}.*ignore=\['{part}'\]"):
            swb.World.from_urdf(text)
        assert len(swb.World.from_urdf(text, ignore=[part]).bodies) == 4
    for text, error, words in (
        ("<robot", swb.ArgumentError, "no URDF"),
        ("<world/>", swb.ArgumentError, "root is 'world'"),
        ("<!DOCTYPE robot [<!ENTITY a 'b'>]><robot/>", swb.UnsupportedError, "entities"),
        ("<robot name='r'/>", swb.RangeError, "no links"),
        (changed(('link name="tip"', 'link name="b"')), swb.RangeError, "each its own"),
        (changed(('<link name="base"/>', "<link/>")), swb.RangeError, "no name"),
        (changed(('<parent link="b"/>', '<parent link="c"/>')), swb.RangeError, "its parent is 'c'"),
        (changed(('<parent link="base"/>', '<parent link="b"/>')), swb.RangeError, "no tree"),
        (changed(('<child link="tip"/>', '<child link="b"/>')), swb.RangeError, "no tree"),
        (changed(('<mass value="1.5"/>', '<mass value="heavy"/>')), swb.RangeError, "value is 'heavy'"),
        (changed(('<mass value="1.5"/>', '<mass value="-1"/>')), swb.RangeError, "its mass is -1"),
        (changed(('ixx="0.1"', 'ixx="-0.1"')), swb.RangeError, "inertia of link a is not positive"),
        (changed(('ixx="0.1"', "")), swb.RangeError, "ixx is missing"),
        (changed(('rpy="0.2 0 0"', 'rpy="0.2 0"')), swb.RangeError, "rpy is '0.2 0'"),
        (changed(('<axis xyz="0 0 2"/>', '<axis xyz="0 0 0"/>')), swb.RangeError, "needs a direction"),
        (changed(('type="revolute"', 'type="planar"')), swb.UnsupportedError, "'planar' is not taken"),
        (changed(("<dynamics ", "<motor/><dynamics ")), swb.UnsupportedError, "'motor' is not known"),
        (changed(("<link name=\"base\"/>", "<link name=\"base\"/><xacro:macro xmlns:xacro='http://www.ros.org/wiki/xacro'/>")), swb.UnsupportedError, "xacro"),
        (changed(('<mass value="0.2"/>', ""), ('type="fixed"', 'type="continuous"')), swb.RangeError, "has no mass"),
        (changed(("<dynamics ", "<mimic joint='elbow'/><dynamics ")), swb.RangeError, "'elbow', which is no joint"),
        (changed(("lower=\"-1\"", "lower=\"2\"")), swb.RangeError, "less than"),
    ):
        with pytest.raises(error, match=words):
            swb.World.from_urdf(text)
    for call, error, words in (
        (lambda: swb.World.from_urdf(3), swb.ArgumentError, "path or a text"),
        (lambda: swb.World.from_urdf(ARM, ignore=["wheels"]), swb.ArgumentError, "'wheels' cannot be ignored"),
        (lambda: swb.World.from_urdf("nowhere.urdf"), FileNotFoundError, "nowhere"),
    ):
        with pytest.raises(error, match=words):
            call()


MODEL = """<mujoco>
  <option gravity="0.1 0.2 -9.7"/>
  <worldbody>
    <geom name="ground" type="plane" size="1 1 1" pos="0 0 -4"/>
    <body name="a" pos="0 0 1" euler="10 20 30">
      <joint name="one" type="hinge" axis="0 1 0.2" pos="0.1 0 0.2" damping="0.1" armature="0.02" range="-60 80" limited="true"/>
      <joint name="two" type="hinge" axis="1 0 0" pos="0 0.1 0"/>
      <geom type="capsule" size="0.05 0.3" pos="0 0 -0.3"/>
      <geom type="ellipsoid" size="0.1 0.2 0.15" euler="0 40 0" pos="0.1 0 0"/>
      <body name="b" pos="0 0 -0.6" quat="0.9 0.1 0.2 0.3">
        <joint name="ball" type="ball" pos="0 0.02 0"/>
        <geom type="box" size="0.1 0.05 0.2" pos="0 0 -0.2"/>
        <body name="c" pos="0 0 -0.4"><joint name="slide" type="slide" axis="1 1 0" stiffness="20" frictionloss="0.1"/>
          <geom type="sphere" size="0.08"/></body>
      </body>
    </body>
  </worldbody>
</mujoco>"""


def test_a_model_of_mujoco_has_its_dynamics():
    mujoco = pytest.importorskip("mujoco")
    w = swb.World.from_mjcf(MODEL, ignore=["frictionloss"])
    assert w.gravity == pytest.approx((0.1, 0.2, -9.7))
    m = mujoco.MjModel.from_xml_string(MODEL)
    d = mujoco.MjData(m)
    trees = Trees.of(w.bodies, w.joints, {})
    rng = np.random.default_rng(3)
    m.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT
    for _ in range(5):
        q, v = rng.normal(size=trees.n_q), rng.normal(size=trees.n_v)
        d.qpos[:], d.qvel[:] = q, v
        d.qpos[2:6] /= np.linalg.norm(q[2:6])
        mujoco.mj_forward(m, d)
        full = np.zeros((m.nv, m.nv))
        for row, unit in zip(full, np.eye(m.nv)):
            mujoco.mj_mulM(m, d, row, unit)
        frames = trees.frames(list(q), list(v))
        mine = np.array(trees.inertia(frames), dtype=float)
        mine[0, 0] += 0.02
        assert mine == pytest.approx(full, rel=1e-9, abs=1e-9)
        force = np.array(trees.force(frames, list(v), w.gravity, {}), dtype=float)
        assert force == pytest.approx(-d.qfrc_bias, rel=1e-9, abs=1e-9)
    one = w.joints[0]
    assert one.limits == pytest.approx((-np.pi / 3, np.radians(80))) and one.damping == 0.1 and one.armature == 0.02
    w.set("ball", [0.1, 0.2, 0.3])
    run = w.simulate(0.3)
    assert run.success and len([c for c in w.scene.contacts if c.name.endswith("ground")]) == 2 + 1 + 8 + 1


def test_cylinders_of_mujoco_have_its_distances():
    """Distances of shapes that are turned at random, next to those that MuJoCo finds by its own method (Gilbert, Johnson and Keerthi)."""
    mujoco = pytest.importorskip("mujoco")
    size = {"cylinder": "0.3 0.5", "ellipsoid": "0.5 0.2 0.3", "box": "0.4 0.2 0.3", "capsule": "0.1 0.5", "sphere": "0.2"}
    rng = np.random.default_rng(17)
    for first, second in [("cylinder", k) for k in size] + [("ellipsoid", k) for k in ("box", "capsule", "sphere")]:
        bodies = "".join(f'<body><freejoint/><geom type="{k}" size="{size[k]}" mass="1"/></body>' for k in (first, second))
        m = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>")
        w = swb.World.from_mjcf(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>")
        a, b = w.bodies
        touches = [t for t in _gaps.touches_of(_Pair(a, b, 0.0, 0.0))]
        d, seen = mujoco.MjData(m), 0
        for _ in range(30):
            at = [*np.zeros(3), *rng.normal(size=4), *rng.normal(size=3) * rng.uniform(0.4, 1.5), *rng.normal(size=4)]
            d.qpos[:] = at
            mujoco.mj_forward(m, d)
            exact = mujoco.mj_geomDistance(m, d, 0, 1, 10.0, np.zeros(6))
            if exact < 0.02:
                continue
            seen += 1
            s = w.scene._layout.read(np.concatenate([at, np.zeros(12)]), None, None, 0.0)
            assert min(float(t.geometry(s)[0]) for t in touches) == pytest.approx(exact, abs=2e-6)
        assert seen > 8


def test_what_is_not_taken_of_a_model_of_mujoco():
    pytest.importorskip("mujoco")
    for old, new, words in (
        ("</worldbody>", '</worldbody><actuator><motor joint="one"/></actuator>', r"actuator.*ignore=\['actuator'\]"),
        ("</worldbody>", '</worldbody><equality><joint joint1="one" joint2="two"/></equality>', "equality"),
        ('name="ball" type="ball"', 'name="ball" type="ball" damping="1"', "joint ball: damping of such a joint"),
        ("<option ", '<option density="1.2" ', "fluid"),
        ('name="two" type="hinge"', 'name="two" type="hinge" ref="10"', "reference"),
    ):
        with pytest.raises(swb.UnsupportedError, match=words):
            swb.World.from_mjcf(MODEL.replace(old, new, 1))
    with pytest.raises(swb.ArgumentError, match="does not read"):
        swb.World.from_mjcf("<mujoco><nothing/></mujoco>")
    with pytest.raises(swb.ArgumentError, match="cannot be ignored"):
        swb.World.from_mjcf(MODEL, ignore="wheels")
    with pytest.raises(swb.ArgumentError, match="path or a text"):
        swb.World.from_mjcf(3)


def test_without_mujoco(monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(ImportError, match="pip install mujoco"):
        swb.World.from_mjcf(MODEL)
