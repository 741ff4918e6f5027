"""A robot and what it keeps away from, as records that kernels take."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from regionik.planners.collision.robot_motion import MobileArm
from regionik.worlds.arrays import Array, Index


class LinkHulls(NamedTuple):
    """The solids of links: all points within ``radius`` of the hulls of corners in the links' frames.

    Attributes
    ----------
    corners : (c, 3) array
        [m]
    first : (n + 1,) array of int
        Solid k has corners ``first[k]:first[k + 1]``.
    radius : (n,) array
        [m]
    link : (n,) array of int
        ``BASE`` for what is fixed to the base.
    core : (c, 3) array
        Corners of what is left of each solid when the depth that a contact may have is taken off: all points
        within ``core_radius`` of their hull [m].
    core_radius : (n,) array
        [m]
    outermost : (n,) array of bool
        Of the last link that has a solid.
    pairs : (n, m) array of bool
        Which hulls a solid is checked against.
    """

    corners: Array
    first: Index
    radius: Array
    link: Index
    core: Array
    core_radius: Array
    outermost: NDArray[np.bool_]
    pairs: NDArray[np.bool_]


class Hulls(NamedTuple):
    """Solids that links keep away from: all points within a disc (level) and a ball of hulls of corners.

    The surface of a mesh is a row for its hull, which only bounds it, and a row for each triangle.

    Attributes
    ----------
    corners : (c, 3) array
        [m]
    first : (m + 1,) array of int
    disc, ball : (m,) array
        Those of the world include the clearance [m].
    frame : (m,) array of int
        Link that carries the hull, ``BASE`` or ``WORLD``; those of the world come first.
    owner : (m,) array of int
        Obstacle, solid of the robot, or -1 for the base's own body.
    next : (m,) array of int
        Row to go on with where this one is clear: beyond the triangles if it bounds some.
    boxes : (m, 2, 3) array
        Low and high along the axes of the hull's frame, disc and ball included [m].
    world : int
        Rows of the world.
    """

    corners: Array
    first: Index
    disc: Array
    ball: Array
    frame: Index
    owner: Index
    next: Index
    boxes: Array
    world: int


class AllowedContact(NamedTuple):
    """Contacts allowed to the outermost solids: with obstacles, the tool within ``reach`` of their spots.

    What of them is farther than ``reach`` from the tool keeps the clearance.
    """

    spots: Array  # (n, 3) [m]
    owner: Index  # (n,)
    reach: float  # [m]
    clearance: float  # [m]
    depth: float  # of a contact, at the most [m]


class RobotScene(NamedTuple):
    """A robot and what it keeps away from, as values for kernels."""

    robot: MobileArm
    links: LinkHulls
    hulls: Hulls
    contact: AllowedContact
