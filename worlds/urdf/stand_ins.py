"""What stands in for links whose meshes cannot be read: something of their size, rather than nothing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from regionik.worlds.arrays import Array, transform_points
from regionik.worlds.chain import Chain
from regionik.worlds.links import BASE, CUBE_CORNERS, LINK_RADIUS, LinkBox, LinkCapsule
from regionik.worlds.urdf.bounding import sphere_capsule
from regionik.worlds.urdf.elements import CollisionShape, Inertial, UrdfModel
from regionik.worlds.urdf.kinematic_tree import PlacedLink

# The solid box of a mass and inertia is smaller than the link, which is hollow, or heavy in its middle. Made
# wider so, it holds 88 in a hundred of 350 links of published robots.
WIDER, MORE = 1.5, 0.05  # times, and then to each side, if it is not smaller itself [m]


def arm_stand_in(chain: Chain, owner: int) -> LinkCapsule:
    """Return a capsule from a joint of the arm to the next one, or to the tool."""
    name, end = f"{chain.joints[owner].name} stand-in", chain.link_vectors[owner]
    if np.linalg.norm(end) < LINK_RADIUS:
        return sphere_capsule(owner, name, np.zeros(3), 2 * LINK_RADIUS)
    return LinkCapsule(owner, name, np.zeros(3), end, LINK_RADIUS)


def base_stand_in(model: UrdfModel, link: PlacedLink) -> LinkBox:
    """Return a box round a link of the base: its frame, the joints on it, and how its mass is spread."""
    spots = [np.zeros(3), *(one.T_parent_joint[:3, 3] for one in model.joints if one.parent == link.name)]
    inertial = model.inertials.get(link.name)
    if inertial is not None and inertial.tensor.any():
        points = np.vstack([*spots, _inertia_box(inertial)])
    else:
        points = np.concatenate([spot + LINK_RADIUS * CUBE_CORNERS for spot in spots])
    low, high = points.min(axis=0), points.max(axis=0)
    T = np.eye(4)
    T[:3, 3] = (low + high) / 2
    return LinkBox(BASE, f"{link.name} stand-in", link.T_owner_link @ T, high - low)


def _inertia_box(inertial: Inertial) -> Array:
    """Corners (8, 3) in the link's frame of the solid box of a mass and its moments, made wider."""
    moments, axes = np.linalg.eigh(inertial.tensor)
    spread = np.clip(moments.sum() - 2 * moments, 0.0, None) / (2 * inertial.mass)  # variance along each axis
    half = np.sqrt(3 * spread)
    corners = (WIDER * half + min(MORE, float(half.max()))) * CUBE_CORNERS
    return transform_points(inertial.T_link_inertial, corners @ axes.T)


def missing_note(why: str, meshes: Sequence[tuple[CollisionShape, PlacedLink]], chain: Chain) -> str:
    """Return the note of all meshes that are missing for one reason, of the base or of the arm."""
    (shape, link), *others = meshes
    if link.owner == BASE:
        instead = "a box of the size of its mass and joints stands in for it"
    else:
        name = chain.names[link.owner]
        instead = f"a capsule of radius {LINK_RADIUS:g} m from joint {name} to the next replaces it"
    more = f"; likewise of {', '.join(dict.fromkeys(one.name for _, one in others))}" if others else ""
    return f"{shape.place}: mesh {shape.file}: {why}; {instead}{more}"
