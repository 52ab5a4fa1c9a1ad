"""Robots from files: trees of bodies with joints and shapes, as URDF or as MuJoCo's XML, and refusals of what they have besides."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy

from . import _spatial as sp
from .errors import ArgumentError, RangeError, UnsupportedError
from .shapes import Body, Shape, inertia_of, rotation

if TYPE_CHECKING:
    from .bodies import World

# What may be left out, and so is never left out without being asked for.
_URDF_PARTS = ("calibration", "contact", "damping", "friction", "gazebo", "limit", "mesh", "mimic",
               "safety_controller", "self_collision_checking", "self_filter", "sensor", "transmission")  # fmt: skip
_MJCF_PARTS = ("actuator", "armature", "damping", "equality", "frictionloss", "gravcomp", "hfield", "limit", "mesh",
               "sdf", "stiffness", "tendon")  # fmt: skip


def _source(given: Any, what: str) -> str:
    """The text of a document, or of the file at a path."""
    if isinstance(given, str) and given.lstrip().startswith("<"):
        return given
    if not isinstance(given, (str, os.PathLike)):
        raise ArgumentError(f"{what} is a path or a text, not {type(given).__name__}")
    with open(given, encoding="utf-8") as file:
        return file.read()


def _ignored(given: Iterable[str], known: tuple[str, ...]) -> set[str]:
    listed = {given} if isinstance(given, str) else set(given)
    unknown = sorted(str(g) for g in listed - set(known))
    if unknown:
        raise ArgumentError(f"'{unknown[0]}' cannot be ignored: what can is {', '.join(known)}")
    return listed


def _refuse(what: str, part: str, why: str = "is not taken") -> UnsupportedError:
    return UnsupportedError(f"{what}: {part} {why}; ignore=['{part}'] leaves it out")


def _took(world: World, name: str, mass: float, inertia: Any, shapes: list[Shape]) -> Body:
    """A link, which may have no mass of its own where a joint holds it to one that has."""
    if mass > 0.0:
        return world.link(mass, inertia, shapes, name)
    made = world.link(1.0, 1.0, shapes, name)
    world.bodies[-1] = made = replace(made, mass=0.0, inertia=numpy.zeros((3, 3)))
    return made


def _joint_name(world: World, name: str) -> str:
    """In files a joint may have the name of a link."""
    taken = {b.name for b in world.bodies} | {f.name for f in world.fixed} | {j.name for j in world.joints}
    return f"{name} joint" if name in taken else name


def _finish(world: World) -> World:
    """Checks that whatever moves has mass, and takes contacts with planes only, until others are named."""

    def mass(body: Body, firmly: bool) -> float:
        held, news = {body.name}, True
        while news:
            hangs = [j for j in world.joints if j.parent is not None and (j.kind == "fixed" or not firmly)]
            found = {j.body.name for j in hangs if j.parent is not None and j.parent.name in held} - held
            news, held = bool(found), held | found
        return sum(b.mass for b in world.bodies if b.name in held)

    for joint in world.joints:
        if joint.kind != "fixed" and not mass(joint.body, firmly=False):
            raise RangeError(f"what moves by joint {joint.name} has no mass: {joint.body.name} needs an inertia")
    hanging = {j.body.name for j in world.joints}
    for body in world.bodies:
        if body.name not in hanging and not mass(body, firmly=True):
            raise RangeError(f"{body.name} has no mass, and moves freely: it needs an inertia")
    world._families.append({b.name for b in world.bodies})
    return world


# --- URDF -----------------------------------------------------------------------------------------------


def _numbers(element: Any, key: str, n: int, default: str, what: str) -> numpy.ndarray:
    text = element.get(key, default)
    try:
        values = numpy.array([float(part) for part in text.split()])
    except ValueError:
        raise RangeError(f"{what}: {key} is '{text:.40}', expected {n} numbers") from None
    if values.shape != (n,) or not numpy.all(numpy.isfinite(values)):
        raise RangeError(f"{what}: {key} is '{text:.40}', expected {n} numbers")
    return values


def _number(element: Any, key: str, default: float | None, what: str) -> float:
    if element is None or element.get(key) is None:
        if default is None:
            raise RangeError(f"{what}: {key} is missing")
        return default
    return float(_numbers(element, key, 1, "", what)[0])


def _origin(element: Any, what: str) -> tuple[numpy.ndarray, numpy.ndarray]:
    origin = None if element is None else element.find("origin")
    if origin is None:
        return numpy.zeros(3), numpy.eye(3)
    at = _numbers(origin, "xyz", 3, "0 0 0", what)
    return at, numpy.array(sp.of_angles(*_numbers(origin, "rpy", 3, "0 0 0", what).tolist()))


def _urdf_shape(collision: Any, what: str, centre: numpy.ndarray, ignore: set[str]) -> list[Shape]:
    at, turn = _origin(collision, what)
    geometry = collision.find("geometry")
    shapes = [] if geometry is None else list(geometry)
    if len(shapes) != 1:
        raise RangeError(f"{what}: a collision has one geometry with one shape")
    (shape,) = shapes
    place = {"at": tuple((at - centre).tolist()), "turn": turn}
    if shape.tag == "sphere":
        return [Shape("sphere", (), _number(shape, "radius", None, what), **place)]
    if shape.tag == "box":
        return [Shape("box", tuple(_numbers(shape, "size", 3, "", what).tolist()), **place)]
    if shape.tag in ("capsule", "cylinder"):
        # along z in files, along x here
        place["turn"] = turn @ numpy.array(sp.of_angles(0.0, -0.5 * math.pi, 0.0))
        length, radius = (_number(shape, key, None, what) for key in ("length", "radius"))
        size, edge = ((length,), radius) if shape.tag == "capsule" else ((length, radius), 0.0)
        return [Shape(shape.tag, size, edge, **place)]
    if shape.tag in ignore:
        return []
    if shape.tag == "mesh":
        raise _refuse(what, shape.tag, "as a collision shape is not taken, only spheres, boxes, capsules and cylinders are")
    raise UnsupportedError(f"{what}: the shape '{shape.tag}' is not known")


def _urdf_link(world: World, link: Any, ignore: set[str]) -> tuple[Body, numpy.ndarray]:
    """The body of a link, and its centre of mass in the axes of the link."""
    name = link.get("name")
    what = f"link {name}"
    inertial = link.find("inertial")
    mass, inertia, centre = 0.0, None, numpy.zeros(3)
    if inertial is not None:
        centre, turn = _origin(inertial, what)
        mass = _number(inertial.find("mass"), "value", 0.0, what)
        if mass < 0.0:
            raise RangeError(f"{what}: its mass is {mass:g}")
        entries = inertial.find("inertia")
        if mass > 0.0:
            if entries is None:
                raise RangeError(f"{what}: it has a mass and no inertia")
            xx, yy, zz = (_number(entries, k, None, what) for k in ("ixx", "iyy", "izz"))
            xy, xz, yz = (_number(entries, k, 0.0, what) for k in ("ixy", "ixz", "iyz"))
            inertia = turn @ numpy.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn.T
            inertia = inertia_of(inertia, f"the inertia of {what}")
    shapes = [s for c in link.findall("collision") for s in _urdf_shape(c, what, centre, ignore)]
    for part in link:
        if part.tag not in ("inertial", "collision", "visual") and part.tag not in ignore:
            raise _unknown(part.tag, what)
    return _took(world, name, mass, inertia, shapes), centre


def _unknown(tag: Any, what: str) -> UnsupportedError:
    if isinstance(tag, str) and "xacro" in tag:
        return UnsupportedError(f"{what}: '{tag}' is a macro; expand the file with xacro first")
    if tag in _URDF_PARTS:
        return _refuse(what, tag)
    return UnsupportedError(f"{what}: '{tag}' is not known")


def _urdf_joint(world: World, joint: Any, bodies: dict[str, tuple[Body, numpy.ndarray]], ignore: set[str]) -> None:
    name, kind = joint.get("name"), joint.get("type")
    what = f"joint {name}"
    kinds = {"revolute": "hinge", "continuous": "hinge", "prismatic": "slider", "fixed": "fixed"}
    if kind not in kinds:
        raise UnsupportedError(f"{what}: the type {kind!r:.40} is not taken, only {', '.join(kinds)} are")
    for part in joint:
        known = ("origin", "parent", "child", "axis", "limit", "dynamics", "mimic")
        if part.tag not in known and part.tag not in ignore:
            raise _unknown(part.tag, what)
    (parent, from_centre), (child, to_centre) = (bodies[_link_of(joint, end, bodies)] for end in ("parent", "child"))
    at, turn = _origin(joint, what)
    extra: dict[str, Any] = {}
    axis = joint.find("axis")
    if kinds[kind] != "fixed":
        extra["axis"] = [1.0, 0.0, 0.0] if axis is None else _numbers(axis, "xyz", 3, "1 0 0", what)
        dynamics = joint.find("dynamics")
        for key in ("damping", "friction"):
            if dynamics is not None and key not in ignore:
                extra[key] = _number(dynamics, key, 0.0, what)
        limit = joint.find("limit")
        if kind != "continuous" and "limit" not in ignore:
            if limit is None:
                raise RangeError(f"{what}: a joint of type {kind} has a limit")
            extra["limits"] = _number(limit, "lower", 0.0, what), _number(limit, "upper", 0.0, what)
    world.joint(
        kinds[kind], parent, child, at - from_centre, -to_centre, turn=turn, name=_joint_name(world, name), loop=False, **extra
    )


def _link_of(joint: Any, end: str, bodies: Any) -> str:
    element = joint.find(end)
    link = None if element is None else element.get("link")
    if link not in bodies:
        raise RangeError(f"joint {joint.get('name')}: its {end} is {link!r}, which is no link of the robot")
    return link


def _in_order(joints: list[Any], root: str) -> list[Any]:
    """Joints such that each parent hangs already."""
    children: dict[str, list[Any]] = {}
    for joint in joints:
        children.setdefault(joint.find("parent").get("link"), []).append(joint)
    out, now = [], [root]
    while now:
        found = [j for link in now for j in children.get(link, [])]
        out += found
        now = [j.find("child").get("link") for j in found]
    return out


def read_urdf(world: World, source: Any, floating: bool, ignore: Iterable[str]) -> World:
    """See `World.from_urdf`."""
    skipped = _ignored(ignore, _URDF_PARTS)
    text = _source(source, "an URDF")
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise UnsupportedError("the URDF declares a document type or entities, which are not read")
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise ArgumentError(f"this is no URDF: {error}") from None
    if root.tag != "robot":
        raise ArgumentError(f"this is no URDF: its root is '{root.tag:.40}', expected 'robot'")
    for part in root:
        if part.tag not in ("link", "joint", "material") and part.tag not in skipped:
            raise _unknown(part.tag, "robot")
    links, joints = root.findall("link"), root.findall("joint")
    for element in links + joints:
        if not element.get("name"):
            raise RangeError(f"a {element.tag} of the robot has no name")
    names = [link.get("name") for link in links]
    if len(set(names)) != len(names) or not names:
        raise RangeError("the links of the robot need names, each its own" if names else "the robot has no links")
    bodies = {link.get("name"): _urdf_link(world, link, skipped) for link in links}
    held = [_link_of(j, "child", bodies) for j in joints]
    [_link_of(j, "parent", bodies) for j in joints]
    roots = [n for n in names if n not in held]
    if len(roots) != 1 or len(set(held)) != len(held):
        found = f"links without a parent are {', '.join(roots) or 'none'}"
        raise RangeError(f"the links of the robot are no tree: {found}, and no link may have two")
    if not floating:
        world.joint("fixed", None, roots[0], to=-bodies[roots[0]][1], name=f"{roots[0]} base")
    ordered = _in_order(joints, roots[0])
    if len(ordered) != len(joints):
        raise RangeError("the links of the robot are no tree: joints hang on each other in a circle")
    for joint in ordered:
        _urdf_joint(world, joint, bodies, skipped)
    places = {j.get("name"): w.name for j, w in zip(ordered, world.joints[0 if floating else 1 :])}
    for joint in ordered:
        mimic = joint.find("mimic")
        if mimic is not None and "mimic" not in skipped:
            _mimic(world, joint.get("name"), mimic, places)
    return _finish(world)


def _mimic(world: World, name: str, mimic: Any, places: dict[str, str]) -> None:
    of = mimic.get("joint")
    if of not in places:
        raise RangeError(f"joint {name}: it mimics {of!r}, which is no joint of the robot")
    factor, offset = (_number(mimic, k, d, f"joint {name}") for k, d in (("multiplier", 1.0), ("offset", 0.0)))
    mine, other = places[name], places[of]
    world.constraint(f"{name} mimic", lambda s: s[mine].q - factor * s[other].q - offset)


# --- MuJoCo's XML ---------------------------------------------------------------------------------------


def _mjcf_shape(m: Any, g: int, centre: numpy.ndarray, what: str, ignore: set[str]) -> list[Shape]:
    kinds = ("plane", "hfield", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh", "sdf")
    number = int(m.geom_type[g])
    kind = kinds[number] if number < len(kinds) else f"shape {number}"
    size = m.geom_size[g]
    turn = rotation(m.geom_quat[g], what)
    place = {"at": tuple((m.geom_pos[g] - centre).tolist()), "turn": turn}
    if kind == "sphere":
        return [Shape("sphere", (), float(size[0]), **place)]
    if kind == "ellipsoid":
        return [Shape("ellipsoid", tuple(size.tolist()), **place)]
    if kind == "box":
        return [Shape("box", tuple((2.0 * size).tolist()), **place)]
    if kind in ("capsule", "cylinder"):
        place["turn"] = turn @ numpy.array(sp.of_angles(0.0, -0.5 * math.pi, 0.0))
        radius, length = float(size[0]), 2.0 * float(size[1])
        return [Shape(kind, (length,), radius, **place) if kind == "capsule" else Shape(kind, (length, radius), **place)]
    if kind in ignore:
        return []
    raise _refuse(what, kind, "as a collision shape is not taken, only planes, spheres, boxes, capsules, cylinders and ellipsoids are")


def _mjcf_check(m: Any, mujoco: Any, ignore: set[str]) -> None:
    parts = (
        ("actuator", m.nu), ("equality", m.neq), ("tendon", m.ntendon), ("gravcomp", int(numpy.any(m.body_gravcomp))),
    )  # fmt: skip
    for part, n in parts:
        if n and part not in ignore:
            raise _refuse("the model", part)
    for part, n in (("flex", getattr(m, "nflex", 0)), ("mocap body", m.nmocap), ("plugin", m.nplugin)):
        if n:
            raise UnsupportedError(f"the model has a {part}, which is not taken")
    o = m.opt
    if o.density or o.viscosity or numpy.any(o.wind):
        raise UnsupportedError("the model is in a fluid (density, viscosity or wind), which is not taken")


def read_mjcf(world: World, source: Any, ignore: Iterable[str], gravity: bool) -> World:
    """See `World.from_mjcf`."""
    skipped = _ignored(ignore, _MJCF_PARTS)
    try:
        import mujoco
    except ImportError as error:
        raise ImportError("files of MuJoCo are read by MuJoCo: pip install mujoco") from error
    inline = isinstance(source, str) and source.lstrip().startswith("<")
    if not inline and not isinstance(source, (str, os.PathLike)):
        raise ArgumentError(f"a model of MuJoCo is a path or a text, not {type(source).__name__}")
    try:
        m = mujoco.MjModel.from_xml_string(source) if inline else mujoco.MjModel.from_xml_path(os.fspath(source))
    except ValueError as error:
        raise ArgumentError(f"MuJoCo does not read this: {error}") from None
    _mjcf_check(m, mujoco, skipped)
    if gravity:
        world.gravity = tuple(float(g) for g in m.opt.gravity)

    def name_of(kind: Any, k: int, word: str) -> str:
        return mujoco.mj_id2name(m, kind, k) or f"{word} {k}"

    geoms: dict[int, list[int]] = {}
    for g in range(m.ngeom):
        if m.geom_contype[g] or m.geom_conaffinity[g]:
            geoms.setdefault(int(m.geom_bodyid[g]), []).append(g)
    plane = int(mujoco.mjtGeom.mjGEOM_PLANE)
    bodies: list[Body | None] = [None]
    centres = [numpy.zeros(3)]
    for b in range(m.nbody):
        name = name_of(mujoco.mjtObj.mjOBJ_BODY, b, "body")
        centre = m.body_ipos[b] if b else numpy.zeros(3)
        solid = [g for g in geoms.get(b, []) if int(m.geom_type[g]) != plane]
        shapes = [s for g in solid for s in _mjcf_shape(m, g, centre, f"body {name}", skipped)]
        if b:
            turn = rotation(m.body_iquat[b], f"body {name}")
            bodies.append(_took(world, name, float(m.body_mass[b]), turn @ numpy.diag(m.body_inertia[b]) @ turn.T, shapes))
            centres.append(centre)
            _mjcf_joints(world, m, mujoco, b, bodies, centres, skipped)
        elif shapes:
            world.joint("fixed", None, _took(world, "world shapes", 0.0, None, shapes), name="world shapes base")
        for g in geoms.get(b, []):
            if int(m.geom_type[g]) == plane:
                normal = rotation(m.geom_quat[g], "a plane")[:, 2]
                free = world._name(None, "plane") if mujoco.mj_id2name(m, mujoco.mjtObj.mjOBJ_GEOM, g) is None else None
                label = free or name_of(mujoco.mjtObj.mjOBJ_GEOM, g, "plane")
                world.plane(normal, float(normal @ (m.geom_pos[g] - centre)), label, on=bodies[b])
    return _finish(world)


def _mjcf_joints(
    world: World, m: Any, mujoco: Any, b: int, bodies: list[Any], centres: list[Any], ignore: set[str]
) -> None:
    """The joints between a body and its parent; between several ones are links without mass."""
    parent, body, centre = int(m.body_parentid[b]), bodies[b], centres[b]
    at, turn = m.body_pos[b] - centres[parent], rotation(m.body_quat[b], f"body {body.name}")
    first, n = int(m.body_jntadr[b]), int(m.body_jntnum[b])
    if n == 0:
        world.joint("fixed", bodies[parent], body, at, -centre, turn=turn, name=f"{body.name} base")
        return
    before: Body | None = bodies[parent]
    for k in range(first, first + n):
        label = mujoco.mj_id2name(m, mujoco.mjtObj.mjOBJ_JOINT, k) or f"{body.name} joint {k - first + 1}"
        what = f"joint {label}"
        kind = ("free", "ball", "slider", "hinge")[int(m.jnt_type[k])]
        extra = _mjcf_extra(m, k, kind, what, ignore)
        if kind == "free":
            world.place(body, *(m.body_pos[b] + turn @ centre)[:2], z=(m.body_pos[b] + turn @ centre)[2], turn=turn)
            return
        last = k == first + n - 1
        after = body if last else _took(world, f"{body.name} {k - first + 1}", 0.0, None, [])
        anchor = m.jnt_pos[k]
        # the links between are where the body is while all joints are at zero
        place = at + turn @ anchor if before is bodies[parent] else anchor - centre
        made = world.joint(
            kind, before, after, place, anchor - centre, m.jnt_axis[k] if kind != "ball" else (0.0, 0.0, 1.0),
            turn=turn if before is bodies[parent] else None, name=_joint_name(world, label), loop=False, **extra,
        )  # fmt: skip
        stiffness = float(numpy.ravel(m.jnt_stiffness[k])[0])
        if stiffness and "stiffness" not in ignore:
            spring = float(m.qpos_spring[m.jnt_qposadr[k]])
            world.force(made, lambda s, made=made, c=stiffness, rest=spring: -c * (s[made].q - rest))
        before = after


def _mjcf_extra(m: Any, k: int, kind: str, what: str, ignore: set[str]) -> dict[str, Any]:
    """Stops, friction, damping and armature of a joint."""
    d, q = int(m.jnt_dofadr[k]), int(m.jnt_qposadr[k])
    size = {"free": 6, "ball": 3, "slider": 1, "hinge": 1}[kind]
    extra: dict[str, Any] = {}
    given = {"damping": m.dof_damping, "armature": m.dof_armature, "frictionloss": m.dof_frictionloss}
    for part, values in given.items():
        values = numpy.reshape(values, (m.nv, -1))
        if not numpy.any(values[d : d + size]) or part in ignore:
            continue
        if size > 1 or numpy.any(values[d, 1:]):
            raise _refuse(what, part, "of such a joint is not taken")
        extra["friction" if part == "frictionloss" else part] = float(values[d, 0])
    if m.jnt_limited[k] and "limit" not in ignore:
        if size > 1:
            raise _refuse(what, "limit", "of a ball is not taken")
        extra["limits"] = float(m.jnt_range[k][0]), float(m.jnt_range[k][1])
    stiffness = numpy.ravel(m.jnt_stiffness[k])
    if numpy.any(stiffness) and "stiffness" not in ignore and (size > 1 or numpy.any(stiffness[1:])):
        raise _refuse(what, "stiffness", "of such a joint is not taken")
    if size == 1 and m.qpos0[q]:
        raise UnsupportedError(f"{what}: it has a reference (ref) other than zero, which is not taken")
    return extra
