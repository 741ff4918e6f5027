"""The collision solids of a URDF robot: those that move with the arm, and those of its base."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from math import pi

import numpy as np

from regionik.worlds.arrays import Array
from regionik.worlds.bundled import LINK_RADIUS
from regionik.worlds.chain import Chain
from regionik.worlds.robot import BASE, LinkBox, LinkCapsule, LinkSolid, capsules_along
from regionik.worlds.urdf.base import Standing, standing
from regionik.worlds.urdf.bounding import cylinder_capsule, sphere_capsule
from regionik.worlds.urdf.covering import Part, covered, surface_part
from regionik.worlds.urdf.elements import Shape, UrdfFile
from regionik.worlds.urdf.meshes import Meshes

_CORNERS = 32  # of a prism round a cylinder
_SIGNS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])


@dataclass(frozen=True, eq=False)
class Placed:
    """A link that moves with a joint of the chain, or with the base.

    Attributes
    ----------
    name : str
    owner : int
        Index of the chain's joint that it moves with; -1 for the base.
    T_owner_link : (4, 4) array
        Its frame in the link that this joint moves; for the base, in the base frame.
    """

    name: str
    owner: int
    T_owner_link: Array


@dataclass(frozen=True, eq=False)
class Body:
    """What a robot is made of.

    Attributes
    ----------
    parts : tuple of Part
        What moves with the arm, each to have one solid.
    base : Standing
        What is fixed to the base.
    notes : tuple of str
        What could not be had and what stands for it.
    """

    parts: tuple[Part, ...]
    base: Standing
    notes: tuple[str, ...] = field(default=())


def body_of(file: UrdfFile, placed: Iterable[Placed], chain: Chain, height: float | None) -> Body:
    """Solids of links that move with the arm, and the base: cut at ``height``, where that is given [m].

    A box stays a box, a cylinder becomes the least capsule around it, a sphere a capsule of next to no
    length, a mesh a few boxes and capsules; where there are many, those of a link share some (`covering`).
    Where a mesh is missing or
    unreadable, a capsule of radius `LINK_RADIUS` from its joint to the next stands for it, and a note says
    so.

    Raises
    ------
    InputError
        When the file names a mesh that it may not.
    """
    meshes = Meshes(file.path)
    parts: list[Part] = []
    fixed: list[Part] = []
    notes: list[str] = []
    stand_ins: set[int] = set()
    for link in placed:
        shapes = file.links[link.name]
        for k, shape in enumerate(shapes):
            surface = meshes.surface(shape) if shape.kind == "mesh" else np.empty((0, 3, 3))
            if isinstance(surface, str):
                notes.append(_missing(shape, surface, link.owner, chain))
                stand_ins.add(link.owner)
                continue
            T = link.T_owner_link @ shape.T_link_shape
            name = link.name if len(shapes) == 1 else f"{link.name} {k + 1}"
            part = _part(link.owner, name, shape, _moved(surface, T), T)
            (fixed if link.owner == BASE else parts).append(part)
    pieces = [*covered(parts), *(_round(_stand_in(chain, owner)) for owner in sorted(stand_ins - {BASE}))]
    if not pieces:
        notes.append(
            f"no arm link has a collision element: capsules of radius {LINK_RADIUS:g} m stand for them"
        )
        pieces += [_round(capsule) for capsule in capsules_along(chain, LINK_RADIUS)]
    ordered = sorted(pieces, key=lambda part: part.link)
    return Body(tuple(ordered), standing(fixed, height), tuple(notes))


def _missing(shape: Shape, why: str, owner: int, chain: Chain) -> str:
    if owner == BASE:
        stands = "it is left out of the footprint"
    else:
        name = chain.names[owner]
        stands = f"a capsule of radius {LINK_RADIUS:g} m from joint {name} to the next stands for it"
    return f"{shape.place}: mesh {shape.file}: {why}; {stands}"


def _stand_in(chain: Chain, owner: int) -> LinkCapsule:
    """A capsule from a joint to the next one, or to the tool."""
    name = f"{chain.names[owner]} stand-in"
    T_next = chain.joints[owner + 1].T_parent_joint if owner + 1 < chain.dof else chain.T_last_tool
    if np.linalg.norm(T_next[:3, 3]) < LINK_RADIUS:
        return sphere_capsule(owner, name, np.zeros(3), 2 * LINK_RADIUS)
    return LinkCapsule(owner, name, np.zeros(3), T_next[:3, 3], LINK_RADIUS)


def _round(capsule: LinkCapsule) -> Part:
    """A capsule as a part."""
    around = np.concatenate([end + capsule.radius * _SIGNS for end in (capsule.start, capsule.end)])
    return Part(capsule.link, capsule.name, around, np.empty((0, 3, 3)), capsule)


def _part(owner: int, name: str, shape: Shape, surface: Array, T: Array) -> Part:
    if shape.kind == "mesh":
        return surface_part(owner, name, surface)
    return Part(owner, name, _moved(_corners(shape, T), T), surface, _solid(owner, name, shape, T))


def _solid(owner: int, name: str, shape: Shape, T: Array) -> LinkSolid:
    match shape.kind:
        case "box":
            return LinkBox(owner, name, T, np.array(shape.size))
        case "cylinder":
            return cylinder_capsule(owner, name, T, *shape.size)
        case _:
            return sphere_capsule(owner, name, T[:3, 3], *shape.size)


def _moved(points: Array, T: Array) -> Array:
    return points @ T[:3, :3].T + T[:3, 3]


def _corners(shape: Shape, T: Array) -> Array:
    """Points in the shape's frame whose hull contains it; round ones get a prism of `_CORNERS` sides."""
    if shape.kind == "box":
        box: Array = _SIGNS * np.array(shape.size) / 2
        return box
    radius = shape.size[0]
    half = shape.size[1] / 2 if shape.kind == "cylinder" else radius
    angles = np.arange(_CORNERS) * 2 * pi / _CORNERS
    ring = radius / np.cos(pi / _CORNERS) * np.column_stack([np.cos(angles), np.sin(angles)])
    prism = np.concatenate([np.column_stack([ring, np.full(_CORNERS, z)]) for z in (-half, half)])
    # A ball looks the same from everywhere: its prism stands upright, so that its height is the ball's.
    upright: Array = prism @ T[:3, :3] if shape.kind == "sphere" else prism
    return upright
