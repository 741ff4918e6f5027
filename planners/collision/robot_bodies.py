"""A robot and obstacles, prepared once for collision queries: hulls of links, of obstacles, of the base."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from regionik.planners.collision.convex_bodies import Piece, link_piece
from regionik.planners.collision.distances import obstacles_from
from regionik.planners.collision.robot_motion import BASE, WORLD, MobileArm
from regionik.planners.solvers.serial_chain import serial_arm
from regionik.worlds.arrays import Array, Index, Mask, frozen
from regionik.worlds.errors import InputError
from regionik.worlds.links import LinkHull, LinkSolid
from regionik.worlds.obstacles import Solid
from regionik.worlds.robot import Robot
from regionik.worlds.self_collision import BODY, base_body, off_floor, self_collision_pairs


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


_LEFT = 1e-3  # of the size of a hull that is drawn in, so that it stays a solid
SPARE, SHARE = 5e-4, 0.2  # that contacts keep from their depth: a length, or a share if that is less [m]


@dataclass(frozen=True, eq=False)
class ContactTargets:
    """Spots that the tool works on: there the solids of the last link that has one may touch obstacles."""

    spots: Array  # (m, 3) [m]
    owner: Index  # (m,) index of the obstacle that each spot belongs to
    reach: float  # distance of the tool from a spot within which its owner may be touched [m]

    def __post_init__(self) -> None:
        object.__setattr__(self, "spots", frozen(self.spots, (None, 3), "contact: spots"))
        owner = np.array(self.owner, dtype=np.int64)
        if owner.shape != (len(self.spots),):
            raise InputError(f"contact: expected one owner a spot, got {owner.shape} and {len(self.spots)}")
        owner.flags.writeable = False
        object.__setattr__(self, "owner", owner)
        object.__setattr__(self, "reach", float(frozen(self.reach, (), "contact: reach")))

    def touchable(self, tool: Array, off: float = 0.0) -> list[int]:
        """Obstacles that a tool may touch at a place (3,), or not farther off it than that [m]."""
        near = np.linalg.norm(self.spots - tool, axis=1) <= self.reach + off
        owners: list[int] = np.unique(self.owner[near]).tolist()
        return owners


NO_CONTACT = ContactTargets(np.zeros((0, 3)), np.zeros(0, dtype=np.int64), 0.0)


@dataclass(frozen=True, eq=False)
class Bodies:
    """A robot and obstacles, prepared for the queries of `proximity`; made by `bodies_from`."""

    robot: Robot
    obstacles: tuple[Solid, ...]  # the floor, where there is one, is the last
    floor: Solid | None  # what only some of the links keep clear of, see `off_floor`
    mobile: MobileArm
    links: LinkHulls
    hulls: Hulls
    pieces: tuple[Piece, ...]  # one for each row of ``hulls``, in its frame; triangles name their mesh
    clearance: float  # what links keep from obstacles beyond what they keep from each other and the base [m]
    depth: float  # how deep the tool may sink into what it touches [m]

    @cached_property
    def mesh_rows(self) -> tuple[int, ...]:
        """Rows that bound a whole mesh, inside which a solid may lie without touching its surface."""
        found, m = list[int](), 0
        while m < len(self.pieces):
            mesh = self.pieces[m].mesh
            found += [m] if mesh is not None and not mesh.sheet else []
            m = m + 1 if mesh is None else int(self.hulls.next[m])
        return tuple(found)

    def scene(self, contact: ContactTargets | None) -> RobotScene:
        """The record that kernels take, with where the tool may touch."""
        one = NO_CONTACT if contact is None else contact
        allowed = AllowedContact(one.spots, one.owner, one.reach, self.clearance, _planned(self.depth))
        return RobotScene(self.mobile, self.links, self.hulls, allowed)


class _HullEntry(NamedTuple):
    """A row of the table of hulls."""

    corners: Array
    piece: Piece
    frame: int
    owner: int
    skips: int = 0  # rows of triangles that follow


def bodies_from(
    robot: Robot,
    solids: Sequence[Solid],
    clearance: float = 0.0,
    depth: float = 0.0,
    floor: Solid | None = None,
) -> Bodies:
    """Prepare a robot and obstacles for collision queries.

    Parameters
    ----------
    clearance : float
        Every margin asked for later is kept beyond this from obstacles [m].
    depth : float
        How deep the tool may sink into what it touches [m].
    floor : Solid, optional
        One more solid, for the links that `off_floor` names.
    """
    solids = (*solids, *([] if floor is None else [floor]))
    around = obstacles_from(solids)
    owned = zip(around.pieces, around.owner.tolist(), strict=True)
    rows = [row for piece, k in owned for row in _hull_entries(piece, WORLD, k)]
    world = len(rows)
    body = base_body(robot)
    own = obstacles_from([body] if body else []).pieces
    rows += [row for piece in own for row in _hull_entries(piece, BASE, BODY)]
    checked = np.ones((len(robot.all_solids), world), dtype=np.bool_)
    if floor is not None:
        is_floor = np.array([row.owner == len(solids) - 1 for row in rows[:world]])
        checked[:, is_floor] = np.array(off_floor(robot), dtype=np.bool_)[:, None]
    pairs = np.hstack([checked, _self_pairs(robot, len(rows) - world)])
    rows += [_HullEntry(s.corners, link_piece(s), s.link, k) for k, s in enumerate(robot.all_solids)]
    return Bodies(
        robot,
        solids,
        floor,
        MobileArm(serial_arm(robot.chain), np.array(robot.T_base_arm), robot.drive.rolls),
        _link_hulls(robot, _planned(depth), pairs),
        _hulls(rows, world, clearance),
        tuple(row.piece for row in rows),
        clearance,
        depth,
    )


def near_bodies(bodies: Bodies, point: Array, far: float) -> Bodies:
    """The same bodies without pieces of obstacles whose boxes are farther than ``far`` from a point [m]."""
    hulls = bodies.hulls
    apart = np.maximum(np.maximum(hulls.boxes[:, 0] - point, point - hulls.boxes[:, 1]), 0.0)
    keep: Mask = np.linalg.norm(apart, axis=1) <= far
    keep[hulls.world :] = True
    skips = hulls.next - np.arange(len(keep)) - 1
    for m in np.flatnonzero(skips):  # triangles go with the hull that bounds them
        keep[m + 1 : hulls.next[m]] = keep[m]
    kept, counts = np.flatnonzero(keep), np.diff(hulls.first)
    left = Hulls(
        hulls.corners[np.repeat(keep, counts)],
        np.concatenate([[0], np.cumsum(counts[kept])]),
        hulls.disc[kept],
        hulls.ball[kept],
        hulls.frame[kept],
        hulls.owner[kept],
        np.arange(len(kept)) + 1 + skips[kept],
        hulls.boxes[kept],
        int(np.count_nonzero(keep[: hulls.world])),
    )
    # In C order, as kernels are compiled for each order that they meet.
    links = bodies.links._replace(pairs=np.take(bodies.links.pairs, kept, axis=1))
    return replace(bodies, links=links, hulls=left, pieces=tuple(bodies.pieces[m] for m in kept.tolist()))


def tool_span(robot: Robot, solid: int) -> float:
    """Bound of the distance of the tool from any point of one of ``robot.all_solids``, in any posture [m]."""
    one, chain = robot.all_solids[solid], robot.chain
    if one.link == len(chain.joints) - 1:
        return float(np.linalg.norm(one.corners - chain.T_last_tool[:3, 3], axis=1).max()) + one.radius
    return span_about_tool(robot)


def span_about_tool(robot: Robot) -> float:
    """Bound of the distance of the tool from any point of the robot's solids, in any posture [m]."""
    chain = robot.chain
    travel = [
        0.0 if joint.kind == "revolute" else max(abs(joint.lower), abs(joint.upper)) for joint in chain.joints
    ]
    steps = [*(joint.T_parent_joint[:3, 3] for joint in chain.joints), chain.T_last_tool[:3, 3]]
    lengths = np.linalg.norm(steps, axis=1) + [*travel, 0.0]
    to_tool = np.cumsum(lengths[::-1])[::-1]  # from the arm's base frame, then from each link's
    to_tool[0] += float(np.linalg.norm(robot.T_base_arm[:3, 3]))
    reached = (
        to_tool[max(solid.link, -1) + 1] + solid.radius + np.linalg.norm(solid.corners, axis=1).max()
        for solid in robot.all_solids
    )
    return float(max(reached, default=0.0))


def _self_pairs(robot: Robot, body: int) -> Mask:
    """Table of the solids of links that are checked against hulls of the base's body and of all solids."""
    count = len(robot.all_solids)
    pairs = np.zeros((count, body + count), dtype=np.bool_)
    for i, k in self_collision_pairs(robot):
        if i < 0:
            pairs[k, :body] = True
        else:
            still, moving = sorted((i, k), key=lambda s: robot.all_solids[s].link)
            pairs[moving, body + still] = True
    return pairs


def _hull_entries(piece: Piece, frame: int, owner: int) -> list[_HullEntry]:
    if piece.mesh is None:
        return [_HullEntry(piece.corners, piece, frame, owner)]
    triangles = piece.mesh.vertices[piece.mesh.faces]
    parts = [_HullEntry(corners, piece, frame, owner) for corners in triangles]
    return [_HullEntry(piece.corners, piece, frame, owner, len(parts)), *parts]


def _link_hulls(robot: Robot, depth: float, pairs: Mask) -> LinkHulls:
    solids, frames = robot.all_solids, robot.chain.frames(np.zeros(robot.chain.dof))
    tools = [np.linalg.solve(T, frames[-1])[:3, 3] for T in frames]
    cores = [core_of(solid, depth, tools[solid.link]) for solid in solids]
    links = np.array([solid.link for solid in solids], dtype=np.int64)
    corners = [solid.corners for solid in solids]
    return LinkHulls(
        np.concatenate([np.zeros((0, 3)), *corners]),
        np.cumsum([0, *(len(c) for c in corners)]),
        np.array([solid.radius for solid in solids], dtype=np.float64),
        links,
        np.concatenate([np.zeros((0, 3)), *(core for core, _ in cores)]),
        np.array([radius for _, radius in cores], dtype=np.float64),
        links == links.max(initial=-1),
        pairs,
    )


def _planned(depth: float) -> float:
    """The depth of contacts that are planned, a little less, so that other code can prove them [m]."""
    return depth - min(SPARE, SHARE * depth)


def core_of(solid: LinkSolid, depth: float, tool: Array) -> tuple[Array, float]:
    """Corners (k, 3) and radius of what is left of a solid that is taken off to a depth on all sides [m].

    Where nothing would be left, it is a point as far from the tool, (3,) in the link's frame, as it may be. A
    hull is drawn in towards the mean of its corners, to a speck at most.
    """
    corners, middle = solid.corners, solid.corners.mean(0)
    if isinstance(solid, LinkHull):
        return middle + (corners - middle) * max(_LEFT, 1.0 - depth / solid.depth(middle)), 0.0
    sides = corners[[4, 2, 1] if len(corners) == 8 else [1]] - corners[0]
    half = np.maximum(np.linalg.norm(sides, axis=1) / 2, 1e-12)
    axes = sides / (2 * half[:, None])
    off = max(0.0, depth - solid.radius)
    left = np.maximum(0.0, 1.0 - off / half)
    aside = np.clip(-np.clip((tool - middle) @ axes.T / half, -1, 1) * np.maximum(off - half, 0), -half, half)
    return middle + ((corners - middle) @ axes.T * left + aside) @ axes, max(0.0, solid.radius - depth)


def _hulls(rows: Sequence[_HullEntry], world: int, clearance: float) -> Hulls:
    disc = np.array([row.piece.disc for row in rows])
    ball = np.array([row.piece.ball for row in rows])
    ball[:world] += clearance
    low = np.array([row.corners.min(0) for row in rows]).reshape(-1, 3)
    high = np.array([row.corners.max(0) for row in rows]).reshape(-1, 3)
    grown = np.column_stack([disc + ball, disc + ball, ball])
    return Hulls(
        np.concatenate([np.zeros((0, 3)), *(row.corners for row in rows)]),
        np.cumsum([0, *(len(row.corners) for row in rows)]),
        disc,
        ball,
        np.array([row.frame for row in rows], dtype=np.int64),
        np.array([row.owner for row in rows], dtype=np.int64),
        np.array([m + 1 + row.skips for m, row in enumerate(rows)], dtype=np.int64),
        np.stack([low - grown, high + grown], axis=1),
        world,
    )
