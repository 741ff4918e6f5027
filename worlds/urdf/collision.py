"""Collision model of a URDF robot: the parts that move with the arm, and its base."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import pi

import numpy as np

from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain
from regionik.worlds.robot import BASE, LINK_RADIUS, LinkBox, LinkCapsule, LinkSolid, capsules_along
from regionik.worlds.urdf.base import BaseShape, base_shape
from regionik.worlds.urdf.bounding import cylinder_capsule, sphere_capsule
from regionik.worlds.urdf.decomposition import CollisionPart, decompose, mesh_part
from regionik.worlds.urdf.elements import CollisionShape, UrdfModel
from regionik.worlds.urdf.kinematic_tree import PlacedLink
from regionik.worlds.urdf.meshes import MeshFiles

_CORNERS = 32  # of a prism around a cylinder
_SIGNS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])


@dataclass(frozen=True, eq=False)
class CollisionModel:
    """Parts of a robot, each to be bounded by one solid."""

    parts: tuple[CollisionPart, ...]  # of the arm's links
    base: BaseShape
    notes: tuple[str, ...] = ()  # shapes that could not be read, and what replaces them


def collision_model(
    model: UrdfModel, links: Iterable[PlacedLink], chain: Chain, height: float | None
) -> CollisionModel:
    """Return the parts of links that move with the arm, and the base: cut at ``height``, where given [m].

    A box stays a box, a cylinder becomes the least capsule around it, a sphere a capsule of next to no
    length, a mesh a few boxes and capsules; where there are many, those of a link share some
    (`regionik.worlds.urdf.decomposition`). A mesh that is missing or unreadable is replaced by a capsule of
    radius `LINK_RADIUS` from its joint to the next, and noted.

    Raises
    ------
    InputError
        When the file names a mesh outside the folders that it may name.
    """
    meshes = MeshFiles(model.path)
    parts: list[CollisionPart] = []
    fixed: list[CollisionPart] = []
    notes: list[str] = []
    lacking: set[int] = set()
    for link in links:
        shapes = model.links[link.name]
        for k, shape in enumerate(shapes):
            surface = meshes.surface(shape) if shape.kind == "mesh" else np.empty((0, 3, 3))
            if isinstance(surface, str):
                notes.append(_missing(shape, surface, link.owner, chain))
                lacking.add(link.owner)
                continue
            T = link.T_owner_link @ shape.T_link_shape
            name = link.name if len(shapes) == 1 else f"{link.name} {k + 1}"
            part = _part(link.owner, name, shape, _moved(surface, T), T)
            (fixed if link.owner == BASE else parts).append(part)
    pieces = [
        *decompose(parts),
        *(_capsule_part(_stand_in(chain, owner)) for owner in sorted(lacking - {BASE})),
    ]
    if not pieces:
        notes.append(
            f"no arm link has a collision element: capsules of radius {LINK_RADIUS:g} m replace them"
        )
        pieces += [_capsule_part(capsule) for capsule in capsules_along(chain, LINK_RADIUS)]
    ordered = sorted(pieces, key=lambda part: part.link)
    return CollisionModel(tuple(ordered), base_shape(fixed, height), tuple(notes))


def _missing(shape: CollisionShape, why: str, owner: int, chain: Chain) -> str:
    if owner == BASE:
        instead = "it is left out of the footprint"
    else:
        name = chain.names[owner]
        instead = f"a capsule of radius {LINK_RADIUS:g} m from joint {name} to the next replaces it"
    return f"{shape.place}: mesh {shape.file}: {why}; {instead}"


def _stand_in(chain: Chain, owner: int) -> LinkCapsule:
    """Return a capsule from a joint to the next one, or to the tool."""
    name = f"{chain.names[owner]} stand-in"
    T_next = chain.joints[owner + 1].T_parent_joint if owner + 1 < chain.dof else chain.T_last_tool
    if np.linalg.norm(T_next[:3, 3]) < LINK_RADIUS:
        return sphere_capsule(owner, name, np.zeros(3), 2 * LINK_RADIUS)
    return LinkCapsule(owner, name, np.zeros(3), T_next[:3, 3], LINK_RADIUS)


def _capsule_part(capsule: LinkCapsule) -> CollisionPart:
    """Return a capsule as a part."""
    around = np.concatenate([end + capsule.radius * _SIGNS for end in (capsule.start, capsule.end)])
    return CollisionPart(capsule.link, capsule.name, around, np.empty((0, 3, 3)), capsule)


def _part(owner: int, name: str, shape: CollisionShape, surface: Array, T: Array) -> CollisionPart:
    if shape.kind == "mesh":
        return mesh_part(owner, name, surface)
    return CollisionPart(owner, name, _moved(_corners(shape, T), T), surface, _solid(owner, name, shape, T))


def _solid(owner: int, name: str, shape: CollisionShape, T: Array) -> LinkSolid:
    match shape.kind:
        case "box":
            return LinkBox(owner, name, T, np.array(shape.size))
        case "cylinder":
            return cylinder_capsule(owner, name, T, *shape.size)
        case _:
            return sphere_capsule(owner, name, T[:3, 3], *shape.size)


def _moved(points: Array, T: Array) -> Array:
    return points @ T[:3, :3].T + T[:3, 3]


def _corners(shape: CollisionShape, T: Array) -> Array:
    """Return points whose hull contains a shape, in its frame; of round ones a prism of `_CORNERS` sides."""
    if shape.kind == "box":
        box: Array = _SIGNS * np.array(shape.size) / 2
        return box
    radius = shape.size[0]
    half = shape.size[1] / 2 if shape.kind == "cylinder" else radius
    angles = np.arange(_CORNERS) * 2 * pi / _CORNERS
    ring = radius / np.cos(pi / _CORNERS) * np.column_stack([np.cos(angles), np.sin(angles)])
    prism = np.concatenate([np.column_stack([ring, np.full(_CORNERS, z)]) for z in (-half, half)])
    # The prism of a ball stands upright, so that its height is the ball's.
    upright: Array = prism @ T[:3, :3] if shape.kind == "sphere" else prism
    return upright
