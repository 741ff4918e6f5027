"""Proof that every link keeps its distance from every solid.

In the middle of an interval a plane is laid perpendicular to the shortest line from a convex piece of a solid
to the hull of the link's corners. While the corners stay beyond the plane by the link's radius and the
clearance, the link is clear; between samples they leave their chords by at most the chord deviation.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import shapely

from regionik.planners.collision.convex_bodies import Piece, Separation
from regionik.planners.collision.distances import (
    Obstacles,
    hull_separation,
    obstacles_among,
    obstacles_from,
)
from regionik.values import Violation
from regionik.verification.contact import (
    SIGNS,
    SweptSolid,
    ToolContact,
    is_allowed,
    mesh_depth,
    shrunk_weights,
    tool_contact,
)
from regionik.verification.motion import Indices, Mask, MotionSegments, chord_deviation
from regionik.verification.options import VERIFICATION
from regionik.verification.proofs import Finding, Intervals, IntervalVerdicts, StateNames, bisect, finding
from regionik.verification.tolerances import TOUCH
from regionik.worlds.arrays import Array
from regionik.worlds.obstacles import Prism, Solid
from regionik.worlds.polytopes import polytope
from regionik.worlds.scene import World
from regionik.worlds.self_collision import off_floor

PROOFS, SOLIDS = VERIFICATION.proofs, VERIFICATION.solids


@dataclass(frozen=True, eq=False)
class _LinkSolids:
    """The robot's solids along a motion: all points within a radius of the hull of some corners."""

    segments: MotionSegments

    @cached_property
    def corners(self) -> tuple[Array, ...]:
        """Of each solid (k, 3), in its link's frame [m]."""
        return tuple(solid.corners for solid in self.segments.robot.all_solids)

    @cached_property
    def radii(self) -> Array:
        return np.array([solid.radius for solid in self.segments.robot.all_solids])

    @property
    def last(self) -> Mask:
        """Solids of the last link that has any."""
        links = np.array([solid.link for solid in self.segments.robot.all_solids])
        return links == links.max()

    @cached_property
    def acceleration(self) -> Array:
        """Upper bound for any point of each solid, (solids, segments): the largest of its corners'."""
        bound = self.segments.acceleration_bound
        solids = self.segments.robot.all_solids
        return np.array([np.max([bound(solid.link, p) for p in solid.corners], axis=0) for solid in solids])

    def place(self, base: Array, joints: Array) -> tuple[Array, Array]:
        """Corners of all solids in the world, (m, solids, k, 3), and the tool, (m, 3).

        Of a solid with fewer corners than k the first one is repeated.
        """
        robot = self.segments.robot
        arm = robot.frames(base, joints)
        T_world_base = robot.T_world_arm(base) @ np.linalg.inv(robot.T_base_arm)
        frames = np.concatenate([arm, T_world_base[:, None]], axis=1)  # the base last, at its index
        most = max(len(corners) for corners in self.corners)
        hulls = [
            frames[:, solid.link, None, :3, 3]
            + np.concatenate([corners, np.repeat(corners[:1], most - len(corners), axis=0)])
            @ frames[:, solid.link, :3, :3].swapaxes(1, 2)
            for solid, corners in zip(robot.all_solids, self.corners, strict=True)
        ]
        return np.stack(hulls, axis=1), arm[:, -1, :3, 3]


def verify_arm_clearance(world: World, segments: MotionSegments, names: StateNames) -> list[Finding]:
    """Every link keeps ``arm_clearance`` from every solid, but for the tip of the last that touches its work.

    The second finding is of that contact.
    """
    if not world.arm_solids or not world.robot.all_solids:
        return [finding("arm", np.inf, [])]
    return _ArmProof(world, segments, names, _obstacles(world, segments)).check()


def _obstacles(world: World, segments: MotionSegments) -> Obstacles:
    """The solids, or of many those that the arm may come near to or a tool may touch, large ones cut."""
    solids = world.arm_solids
    if len(solids) < SOLIDS.min_many and all(_corners(solid) < SOLIDS.min_many for solid in solids):
        return obstacles_from(solids)
    low, high = _places(world, segments)
    bounds = np.array([solid.bounds[:, :2].ravel() for solid in solids])
    tree = shapely.STRtree(shapely.box(*low.T, *high.T))
    near = np.unique(tree.query(shapely.box(*bounds.T))[0]).tolist()
    region = _cells_around(low, high)
    return obstacles_among(solids, ((k, part) for k in near for part in _parts(solids[k], region)))


def _places(world: World, segments: MotionSegments) -> tuple[Array, Array]:
    """Boxes on the floor in which the arm moves, and in which its tool may touch, (n, 2) each [m]."""
    links = _LinkSolids(segments)
    bulge = chord_deviation(links.acceleration, np.ones(1)).max(initial=PROOFS.margin_range)
    within = links.radii.max() + world.arm_clearance + bulge
    hulls = links.place(segments.motion.base, segments.motion.joints)[0][..., :2]
    low, high = hulls.min((1, 2)) - within, hulls.max((1, 2)) + within
    task = np.array([target.position[:2] for target in world.task]).reshape(-1, 2)
    touched = world.rules.tool_contact
    low = np.concatenate([low, np.minimum(low[:-1], low[1:]), task - touched])
    high = np.concatenate([high, np.maximum(high[:-1], high[1:]), task + touched])
    return low, high


def _cells_around(low: Array, high: Array) -> shapely.Geometry:
    """Union of boxes, each grown to whole cells with one more on every side."""
    corners = np.floor(low / SOLIDS.cell) - 1, np.ceil(high / SOLIDS.cell) + 1
    cells = np.unique(np.concatenate(corners, axis=1), axis=0)
    return shapely.union_all(shapely.box(*(cells * SOLIDS.cell).T))


def _corners(solid: Solid) -> int:
    return int(shapely.get_num_coordinates(solid.polygon)) if isinstance(solid, Prism) else 0


def _parts(solid: Solid, region: shapely.Geometry) -> list[Solid]:
    """The solid, or of a prism with many corners what lies in a region: cuts are a cell and more off."""
    if not isinstance(solid, Prism) or _corners(solid) < SOLIDS.min_many:
        return [solid]
    parts = shapely.get_parts(shapely.intersection(solid.polygon, region))
    return [replace(solid, polygon=part) for part in parts if part.area > 0]


def _depth(piece: Piece, corners: Array) -> float:
    """Length by which a box or hull that cuts a mesh must shrink on all sides to be free of it [m].

    The distance of surfaces that cross is 0 for a graze as for a cut.
    """
    low, high = 0.0, _thickness(corners)
    while high - low > SOLIDS.box_depth_step:
        inset = (low + high) / 2
        shrunk = shrunk_weights(corners, inset, corners.mean(0)) @ corners
        low, high = (low, inset) if hull_separation(piece, shrunk).distance > 0 else (inset, high)
    return low


def _thickness(corners: Array) -> float:
    """Length by which a box or hull, by its corners, shrinks to nothing [m]."""
    if len(corners) > len(SIGNS):
        return float(polytope(corners).depth(corners.mean(0)))
    return float(np.linalg.norm(corners[[4, 2, 1]] - corners[0], axis=1).min()) / 2


@dataclass(frozen=True, eq=False)
class _ClosePairs:
    """States or segments in which a solid of a link comes close to a piece of an obstacle."""

    row: Indices
    link: Indices
    piece: Indices

    def take(self, which: Mask | Indices) -> _ClosePairs:
        return _ClosePairs(self.row[which], self.link[which], self.piece[which])


_Key = tuple[int, int, int]  # state or segment, solid of a link, obstacle
_Nearest = tuple[float, bool]  # least distance [m], and whether the tool may touch there


@dataclass(frozen=True, eq=False)
class _ArmProof:
    world: World
    segments: MotionSegments
    names: StateNames
    obstacles: Obstacles

    @cached_property
    def links(self) -> _LinkSolids:
        return _LinkSolids(self.segments)

    @cached_property
    def contact(self) -> ToolContact:
        return tool_contact(self.world, self.obstacles)

    @cached_property
    def _floor_boxes(self) -> shapely.STRtree:
        """Bounding boxes of the pieces, projected onto the floor."""
        return shapely.STRtree(shapely.box(*self.obstacles.low[:, :2].T, *self.obstacles.high[:, :2].T))

    @cached_property
    def _heeded(self) -> Mask:
        """Which solids keep clear of which pieces: of the floor those that can be off it."""
        on_floor = self.obstacles.owner == (-1 if self.world.floor_slab is None else len(self.world.solids))
        return np.array(off_floor(self.world.robot))[:, None] | ~on_floor

    @property
    def limit(self) -> float:
        return self.world.arm_clearance

    def check(self) -> list[Finding]:
        motion = self.segments.motion
        hulls, tools = self.links.place(motion.base, motion.joints)
        states = self._close_pairs(hulls, np.full(hulls.shape[:2], PROOFS.margin_range))
        own, tool = hulls[states.row, states.link], tools[states.row]
        distance, may_touch, allowed = self._measured(states, own, tool)
        bad = np.flatnonzero((distance < self.limit - TOUCH) & ~allowed)
        too_close = self._nearest(states.take(bad), distance[bad], may_touch[bad])
        swept = np.concatenate([hulls[:-1], hulls[1:]], axis=2)
        pairs = self._close_pairs(swept, chord_deviation(self.links.acceleration.T, np.ones(1)))
        hit = {(key[0] + step, *key[1:]) for key in too_close for step in (0, -1)}
        pairs = pairs.take(np.array([key not in hit for key in self._keys(pairs)], dtype=bool))
        unproven = bisect(len(pairs.row), lambda intervals: self._examine(pairs, intervals))
        found = [self._violation(key, self.names.state(key[0]), *near) for key, near in too_close.items()]
        found += self._violations_between(pairs, unproven)
        free = min(PROOFS.margin_range, float(distance[~may_touch].min(initial=np.inf)) - self.limit)
        deep = np.inf
        if may_touch.any():
            deep = min(PROOFS.margin_range, float(distance[may_touch].min()) + self.contact.depth)
        margins = {"arm": free, "contact": deep}
        return [finding(kind, least, [v for v in found if v.kind == kind]) for kind, least in margins.items()]

    def _close_pairs(self, points: Array, bulge: Array) -> _ClosePairs:
        """Pairs whose bounding boxes come within the clearance.

        Points (n, solids, k, 3) leave their hull by at most bulge (n, solids) [m].
        """
        count = points.shape[1]
        low, high = points.min(2).reshape(-1, 3), points.max(2).reshape(-1, 3)
        within = (self.links.radii + self.limit + bulge).reshape(-1)
        around = shapely.box(*(low[:, :2] - within[:, None]).T, *(high[:, :2] + within[:, None]).T)
        row, piece = self._floor_boxes.query(around)
        apart = np.maximum(low[row] - self.obstacles.high[piece], self.obstacles.low[piece] - high[row])
        gap = np.linalg.norm(np.maximum(apart, 0.0), axis=1)
        close = ((gap == 0) | (gap < within[row])) & self._heeded[row % count, piece]
        row, piece = row[close], piece[close]
        order = np.lexsort([piece, row])
        return _ClosePairs(row[order] // count, row[order] % count, piece[order])

    def _separation(self, link: int, piece: int, corners: Array) -> Separation:
        """Signed distance of the hull of a link's corners from a piece."""
        own, other = corners[: len(self.links.corners[link])], self.obstacles.pieces[piece]
        found = hull_separation(other, own)
        if found.distance > 0 or other.mesh is None or self.links.radii[link] > 0:
            return found
        return found._replace(distance=min(found.distance, -_depth(other, own)))

    def _may_touch(self, pairs: _ClosePairs, tools: Array, bulge: Array) -> tuple[Mask, Mask]:
        """Masks of pairs that may be in contact: all the time, and in the middle."""
        solid = np.where(self.links.last[pairs.link], self.obstacles.owner[pairs.piece], -1)
        return self.contact.near_setpoint(solid, tools, bulge)

    def _measured(self, pairs: _ClosePairs, hulls: Array, tools: Array) -> tuple[Array, Mask, Mask]:
        """Distances of corners (m, k, 3), where the tools (m, 3) may touch, and contacts that are allowed."""
        rows = range(len(pairs.row))
        found = [self._separation(pairs.link[m], pairs.piece[m], hulls[m]).distance for m in rows]
        distance = np.array(found) - self.links.radii[pairs.link]
        may_touch = self._may_touch(pairs, tools[:, None], np.zeros(len(rows)))[1]
        allowed = np.zeros(len(rows), dtype=bool)
        for m in np.flatnonzero(may_touch & (distance < self.limit)).tolist():
            piece = self.obstacles.pieces[pairs.piece[m]]
            at_rest = self._swept(int(pairs.link[m]), hulls[m, None], tools[m, None])
            allowed[m] = is_allowed(self.contact, at_rest, piece)
            if distance[m] < 0 and piece.mesh is not None:
                distance[m] = -mesh_depth(self.contact, at_rest, piece)
        return distance, may_touch, allowed

    def _swept(
        self, link: int, hulls: Array, tools: Array, bulge: float = 0.0, tool_bulge: float = 0.0
    ) -> SweptSolid:
        own = np.broadcast_to(hulls, (3, *hulls.shape[1:]))[:, : len(self.links.corners[link])]
        radius = float(self.links.radii[link])
        return SweptSolid(own, radius, np.broadcast_to(tools, (3, 3)), bulge, tool_bulge)

    def _examine(self, every: _ClosePairs, intervals: Intervals) -> IntervalVerdicts:
        pairs = every.take(intervals.item)
        hulls, tools = self._samples(pairs, intervals)  # (m, 3 samples, k corners, 3), (m, 3 samples, 3)
        bulge = chord_deviation(self.links.acceleration[pairs.link, pairs.row], intervals.length)
        tool_bulge = chord_deviation(self.segments.tool_acceleration_bound[pairs.row], intervals.length)
        always, middle = self._may_touch(pairs, tools, tool_bulge)
        moved = np.linalg.norm(hulls - hulls[:, 1:2], axis=-1).max((1, 2))
        needed = self.links.radii[pairs.link] + self.limit + bulge - TOUCH
        proven = self._boxes_apart(hulls, pairs.piece, needed)
        refuted = np.zeros(len(proven), dtype=bool)
        for m in np.flatnonzero(~proven).tolist():
            found = self._separation(pairs.link[m], pairs.piece[m], hulls[m, 1])
            piece = self.obstacles.pieces[pairs.piece[m]]
            gap = float((hulls[m] @ found.normal).min() - piece.support(found.normal))
            if piece.mesh is not None:  # the plane bounds the hull of the mesh, which may have room inside
                gap = max(gap, found.distance - moved[m])
            proven[m] = gap >= needed[m]
            if always[m] and not proven[m]:
                swept = self._swept(int(pairs.link[m]), hulls[m], tools[m], bulge[m], tool_bulge[m])
                proven[m] = is_allowed(self.contact, swept, piece)
            refuted[m] = found.distance < needed[m] - bulge[m]
            if middle[m] and refuted[m]:
                at_rest = self._swept(int(pairs.link[m]), hulls[m, 1:2], tools[m, 1:2])
                refuted[m] = not is_allowed(self.contact, at_rest, piece)
        return IntervalVerdicts(proven, refuted, moved + 100 * bulge < PROOFS.min_motion)

    def _samples(self, pairs: _ClosePairs, intervals: Intervals) -> tuple[Array, Array]:
        """Corners and tool at both ends and the middle; an interval that pairs share is placed once."""
        keys = np.column_stack([pairs.row, intervals.low, intervals.high])
        once, index = np.unique(keys, axis=0, return_inverse=True)
        segment = once[:, 0].astype(np.int64)
        hulls, tools = [], []
        for s in (once[:, 1], (once[:, 1] + once[:, 2]) / 2, once[:, 2]):
            corners, tool = self._placed_at(segment, s)
            hulls.append(corners[index, pairs.link])
            tools.append(tool[index])
        return np.stack(hulls, axis=1), np.stack(tools, axis=1)

    def _placed_at(self, segment: Indices, s: Array) -> tuple[Array, Array]:
        return self.links.place(self.segments.base_at(segment, s), self.segments.joints_at(segment, s))

    def _boxes_apart(self, hulls: Array, piece: Indices, needed: Array) -> Mask:
        low, high = hulls.min((1, 2)), hulls.max((1, 2))
        gap = np.maximum(np.maximum(low - self.obstacles.high[piece], self.obstacles.low[piece] - high), 0.0)
        return (np.linalg.norm(gap, axis=1) >= needed) & (gap > 0).any(1)

    def _keys(self, pairs: _ClosePairs) -> Iterator[_Key]:
        solid = self.obstacles.owner[pairs.piece].tolist()
        return zip(pairs.row.tolist(), pairs.link.tolist(), solid, strict=True)

    def _nearest(self, pairs: _ClosePairs, distance: Array, may_touch: Mask) -> dict[_Key, _Nearest]:
        """Least distance for each state or segment, link and solid, and whether the tool may touch there."""
        nearest: dict[_Key, _Nearest] = {}
        for key, *near in zip(self._keys(pairs), distance.tolist(), may_touch.tolist(), strict=True):
            nearest[key] = min(nearest.get(key, (np.inf, False)), (near[0], near[1]))
        return nearest

    def _violations_between(self, every: _ClosePairs, where: dict[int, float]) -> list[Violation]:
        """Violations between states, one for each segment, link and solid."""
        if not where:
            return []
        pairs = every.take(np.array(list(where)))
        hulls, tools = self._placed_at(pairs.row, np.array(list(where.values())))
        own = hulls[np.arange(len(hulls)), pairs.link]
        nearest = self._nearest(pairs, *self._measured(pairs, own, tools)[:2])
        return [self._violation(key, self.names.segment(key[0]), *near) for key, near in nearest.items()]

    def _violation(self, key: _Key, where: str, distance: float, may_touch: bool) -> Violation:
        state, link, solid = key
        part, name = self.world.robot.all_solids[link].name, self.world.arm_solids[solid].name
        if may_touch:
            return self._contact_violation(state, f"{part} touches {name} {where}", distance)
        if distance < 0:
            how = f"{part} overlaps {name} by {-distance:z.4f} m {where}"
        elif distance < self.limit:
            how = f"{part} comes within {distance:z.4f} m of {name} {where}"
        else:
            how = f"{part} is not proven clear of {name} {where}, {distance:.6f} m away"
        text = f"{how}; the arm's clearance is {self.limit:g} m"
        return Violation("arm", state, self.names.owner(state), max(0.0, self.limit - distance), text)

    def _contact_violation(self, state: int, what: str, distance: float) -> Violation:
        depth, reach = self.contact.depth, self.contact.reach
        deeper = -distance - depth
        if deeper > TOUCH:
            text = f"{what}, {-distance:z.4f} m deep; "
            text += f"it may sink in {depth:.4g} m (contact_depth and tolerance)"
        else:
            text = f"{what} with parts that are not proven to lie within {reach:g} m of the tool point"
            text += f" (tool_contact), or to keep the arm's clearance of {self.limit:g} m from it"
        return Violation("contact", state, self.names.owner(state), max(0.0, deeper), text)
