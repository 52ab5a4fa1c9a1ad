"""Which things of a world may touch: pairs that are not named, and shapes that cannot."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ._gaps import _Core, _shapes_of, _solids_of
from .errors import UnsupportedError
from .shapes import Body, Fixed

if TYPE_CHECKING:
    from .bodies import World


def all_pairs(world: World) -> list[tuple[Body, Body | Fixed]]:
    """All pairs of bodies, and of bodies and planes, but of what hangs together by joints or comes from one file."""
    families, still = [*world._families, *_linkages(world)], _still(world)
    shaped = [b for b in world.bodies if b._spots]

    def meet(a: Body, b: Body | None) -> bool:
        other = "" if b is None else b.name
        if a is b or any({a.name, other} <= f for f in families):
            return False
        return not (a.name in still and (b is None or other in still))

    planes = [(a, f) for a in shaped for f in world.fixed if meet(a, f.on)]
    return planes + [(a, b) for i, a in enumerate(shaped) for b in shaped[i + 1 :] if meet(a, b)]


def _linkages(world: World) -> list[set[str]]:
    """Names of bodies that joints connect with each other."""
    out: list[set[str]] = []
    for j in world.joints:
        ends = {j.body.name} | ({j.parent.name} if j.parent is not None else set())
        met = [s for s in out if s & ends]
        out = [s for s in out if not s & ends] + [ends.union(*met)]
    return out


def _still(world: World) -> set[str]:
    """Names of bodies that are held to the world firmly."""
    out: set[str] = set()
    for _ in world.joints:  # as often as a chain may be long
        found = {j.body.name for j in world.joints if j.kind == "fixed" and (j.parent is None or j.parent.name in out)}
        if found <= out:
            break
        out |= found
    return out


def _cores_of(body: Body) -> list[_Core]:
    """What has flat sides or straight edges, without its radius."""
    if body.shapes:
        return [s.core for s in _solids_of(body) if s.core is not None and s.kind != "ellipsoid"]
    return [core for _, cores in _shapes_of(body) for core in cores]


def check_shapes(a: Body, b: Body | Fixed) -> None:
    """Refuses pairs whose distance is not smooth, or that have none."""
    for body in (a, b):
        if isinstance(body, Body) and not body._spots:
            raise UnsupportedError(f"{body.name} has no shape: it touches nothing. Give the link shapes")
    if isinstance(b, Fixed):
        return
    bent = [any(s.squares is not None for s in body._spots) for body in (a, b)]
    cores = [_cores_of(body) for body in (a, b)]
    other = "Name the pairs that may touch, without this one"
    if all(s.radius == 0.0 and s.squares is None for s in a._spots + b._spots):
        if any(cores):
            raise UnsupportedError(
                f"{a.name} ({a.shape}) and {b.name} ({b.shape}) have sharp corners, whose distance has no direction where they touch: "
                f"give one of them a rounding, box(..., rounding=0.01), or a radius. {other}"
            )
        raise UnsupportedError(f"{a.name} and {b.name} are points: they do not touch. {other}")
    for body, round_, core, own in ((a, bent[0], b, cores[1]), (b, bent[1], a, cores[0])):
        if round_ and any(c.radius == 0.0 for c in own):
            raise UnsupportedError(
                f"{core.name} ({core.shape}) has sharp corners, whose distance from {body.name} has no direction where they touch: "
                f"give it a rounding or a radius. {other}"
            )
