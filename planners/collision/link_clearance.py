"""Clearance of single links at any pose: what FABRIK with obstacle avoidance asks while it moves an arm.

Within a pass the links do not hang together, so links are not checked against each other.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from regionik.planners.collision.convex_bodies import Piece
from regionik.planners.collision.distances import bounding_boxes, keeps_apart
from regionik.planners.collision.robot_bodies import NO_CONTACT, Bodies, ContactTargets
from regionik.planners.collision.robot_motion import BASE
from regionik.worlds.arrays import Array, Index
from regionik.worlds.links import LinkHull
from regionik.worlds.polytopes import Polytope


class _Near(NamedTuple):
    """Surroundings of one solid of a link, all of them in one frame."""

    corners: Array  # (k, 3) of the solid, in its link's frame [m]
    own: (
        Polytope | None
    )  # hull of the corners, where it is known: made anew at each pose it takes milliseconds
    apart: float  # between those corners' hull and each piece [m]
    T: Array  # (4, 4) frame of the pieces <- the arm's base frame
    pieces: tuple[Piece, ...]
    low: Array  # (m, 3) corners of boxes that the hull must meet to come too near to a piece [m]
    high: Array  # (m, 3)


def links_clear(
    bodies: Bodies, base: Array, tool: Array, margin: float, contact: ContactTargets | None = None
) -> Callable[[int, Array], bool]:
    """Make a check whether a link may be at a pose, for an arm on a base that stands still.

    Parameters
    ----------
    base : (3,) array
        x, y [m], yaw [rad].
    tool : (3,) array
        Where the tool is going to be, in the world: it decides what may be touched [m].
    margin : float
        From the base, and from obstacles beyond the bodies' clearance [m].
    contact : ContactTargets, optional
        What the outermost link may touch.

    Returns
    -------
    callable
        Takes a link and a pose (4, 4) in the arm's base frame; tells whether the link's solids keep clear of
        obstacles and of the base.
    """
    robot = bodies.robot
    T_world_arm, around = robot.T_world_arm(base), whole_pieces(bodies)
    links: list[list[_Near]] = [[] for _ in robot.chain.joints]
    for k, solid in enumerate(robot.solids):
        free = (contact or NO_CONTACT).touchable(tool) if bodies.links.outermost[k] else []
        checked = around[bodies.links.pairs[k, around]]
        work = np.isin(bodies.hulls.owner[checked], free)
        own = np.flatnonzero(bodies.links.pairs[k] & (bodies.hulls.frame == BASE))
        corners, apart = solid.corners, solid.radius + margin
        whole = solid.polytope if isinstance(solid, LinkHull) else None
        core = bodies.links.core[slice(*bodies.links.first[k : k + 2])]
        least = float(bodies.links.core_radius[k])
        links[solid.link] += [
            _near(bodies, corners, whole, checked[~work], T_world_arm, apart + bodies.clearance),
            _near(bodies, core, None, checked[work], T_world_arm, least),
            _near(bodies, corners, whole, own, bodies.mobile.mount, apart),
        ]
    return lambda link, T_arm_link: all(_clear(near, T_arm_link) for near in links[link])


def whole_pieces(bodies: Bodies) -> Index:
    """Rows of the world's pieces, each once, without the rows of a mesh's triangles."""
    rows, row = [], 0
    while row < bodies.hulls.world:
        rows.append(row)
        row = int(bodies.hulls.next[row])
    return np.array(rows, dtype=np.int64)


def _near(bodies: Bodies, corners: Array, own: Polytope | None, rows: Index, T: Array, apart: float) -> _Near:
    pieces = tuple(bodies.pieces[m] for m in rows)
    low, high = bounding_boxes(pieces)
    return _Near(corners, own, apart, T, pieces, low - apart, high + apart)


def _clear(near: _Near, T_arm_link: Array) -> bool:
    if not near.pieces:
        return True
    T = near.T @ T_arm_link
    corners = near.corners @ T[:3, :3].T + T[:3, 3]
    meet = (corners.min(0) <= near.high).all(1) & (near.low <= corners.max(0)).all(1)
    if not meet.any():
        return True
    own = None if near.own is None else near.own.moved(T)
    return all(keeps_apart(near.pieces[m], corners, near.apart, own) for m in np.flatnonzero(meet).tolist())
