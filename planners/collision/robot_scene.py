"""A robot and what it keeps away from, as records that kernels take."""

from __future__ import annotations

from typing import NamedTuple

from regionik.planners.collision.robot_motion import MobileArm
from regionik.worlds.arrays import Array, Index, Mask


class LinkHulls(NamedTuple):
    """The solids of links: all points within ``radius`` of the hulls of corners in the links' frames."""

    corners: Array  # (c, 3) [m]
    first: Index  # (n + 1,) solid k has corners ``first[k]:first[k + 1]``
    radius: Array  # (n,) [m]
    link: Index  # (n,) ``BASE`` for what is fixed to the base
    # (c, 3) corners of what is left of each solid when the depth that a contact may have is taken off: all
    # points within ``core_radius`` of their hull [m]
    core: Array
    core_radius: Array  # (n,) [m]
    outermost: Mask  # (n,) of the last link that has a solid
    pairs: Mask  # (n, m) which hulls a solid is checked against


class Hulls(NamedTuple):
    """Solids that links keep away from: all points within a disc (level) and a ball of hulls of corners.

    The surface of a mesh is a row for its hull, which only bounds it, and a row for each triangle.
    """

    corners: Array  # (c, 3) [m]
    first: Index  # (m + 1,)
    # disc, ball: (m,) those of the world include the clearance [m]
    disc: Array
    ball: Array
    frame: Index  # (m,) link that carries the hull, ``BASE`` or ``WORLD``; those of the world come first
    owner: Index  # (m,) obstacle, solid of the robot, or -1 for the base's own body
    next: Index  # (m,) row to go on with where this one is clear: beyond the triangles if it bounds some
    boxes: Array  # (m, 2, 3) low and high along the axes of the hull's frame, disc and ball included [m]
    world: int  # rows of the world


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
