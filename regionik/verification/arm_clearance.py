"""Proof that every link keeps its distance from every solid.

A plane is laid on a face of a convex piece of a solid, or in the middle of an interval perpendicular to the
shortest line from the piece to the hull of the link's corners. While the corners stay beyond the plane by the
link's radius and the clearance, the link is clear; between samples they leave their chords by at most the
chord deviation.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import shapely

from regionik.planners.collision.convex_bodies import Piece, Separation
from regionik.planners.collision.distances import Obstacles, hull_separation
from regionik.values import Violation
from regionik.verification.contact import (
    SIGNS,
    SweptSolids,
    ToolContact,
    is_allowed,
    mesh_depth,
    planes_prove,
    shrunk_weights,
    tool_contact,
)
from regionik.verification.motion import Indices, Mask, MotionSegments, chord_deviation
from regionik.verification.moved_solids import LinkSolids, obstacles_near
from regionik.verification.options import VERIFICATION
from regionik.verification.proofs import Finding, Intervals, IntervalVerdicts, StateNames, bisect, finding
from regionik.verification.tolerances import TOUCH
from regionik.worlds.arrays import Array
from regionik.worlds.polytopes import polytope
from regionik.worlds.scene import World
from regionik.worlds.self_collision import off_floor

PROOFS, SOLIDS = VERIFICATION.proofs, VERIFICATION.solids


def verify_arm_clearance(world: World, segments: MotionSegments, names: StateNames) -> list[Finding]:
    """Every link keeps ``arm_clearance`` from every solid, but for the tip of the last that touches its work.

    The second finding is of that contact.
    """
    if not world.arm_solids or not world.robot.all_solids:
        return [finding("arm", np.inf, [])]
    return _ArmProof(world, segments, names, obstacles_near(world, segments)).check()


def _depth(piece: Piece, corners: Array) -> float:
    """Length by which a box or hull that cuts a mesh must shrink on all sides to be free of it [m].

    The distance of surfaces that cross is 0 for a graze as for a cut.
    """
    low, high = 0.0, _thickness(corners)
    while high - low > SOLIDS.box_depth_step:
        inset = (low + high) / 2
        shrunk = shrunk_weights(corners[None], inset, corners.mean(0)[None])[0] @ corners
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

    def take(self, which: Mask | Indices | list[int]) -> _ClosePairs:
        return _ClosePairs(self.row[which], self.link[which], self.piece[which])


class _SweptPairs(NamedTuple):
    """Close pairs over parts of segments, at samples of each: corners of the links' solids, and the tool.

    Between samples corners leave their chords by at most ``bulge``, the tool by ``tool_bulge`` [m].
    """

    pairs: _ClosePairs
    hulls: Array  # (m, samples, k, 3) [m]
    tools: Array  # (m, samples, 3) [m]
    bulge: Array  # (m,)
    tool_bulge: Array  # (m,)

    def take(self, which: Mask | Indices | list[int]) -> _SweptPairs:
        return _SweptPairs(self.pairs.take(which), *(column[which] for column in self[1:]))


_Key = tuple[int, int, int]  # state or segment, solid of a link, obstacle
_Nearest = tuple[float, bool]  # least distance [m], and whether the tool may touch there


@dataclass(frozen=True, eq=False)
class _ArmProof:
    world: World
    segments: MotionSegments
    names: StateNames
    obstacles: Obstacles

    @cached_property
    def links(self) -> LinkSolids:
        return LinkSolids(self.segments)

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
        """Distances of corners (m, k, 3), where the tools (m, 3) may touch, and contacts that are allowed.

        The least distances of both kinds and those of what is too close are exact, others lower bounds.
        """
        may_touch = self._may_touch(pairs, tools[:, None], np.zeros(len(tools)))[1]
        parts = _SweptPairs(pairs, hulls[:, None], tools[:, None], *np.zeros((2, len(tools))))
        gap, allowed = self._by_faces(parts, self.links.radii[pairs.link] + self.limit, may_touch)
        distance = gap - self.links.radii[pairs.link]
        close = np.flatnonzero((distance < self.limit) & ~allowed)
        distance[close] = self._distances(parts.take(close), may_touch[close])
        for m in close[may_touch[close] & (distance[close] < self.limit)].tolist():
            allowed[m] = is_allowed(self.contact, *self._one(parts, m))
        for which in (may_touch, ~may_touch):
            rows, least = np.flatnonzero(which), np.inf
            for m in rows[np.argsort(distance[rows], kind="stable")]:
                if distance[m] >= least:
                    break
                distance[m] = self._distances(parts.take([m]), may_touch[[m]])[0]
                least = min(least, distance[m])
        return distance, may_touch, allowed

    def _distances(self, parts: _SweptPairs, may_touch: Mask) -> Array:
        """Signed distances (m,) in the middle [m]; of a mesh that may be touched how deep it is sunk into."""
        pairs, corners = parts.pairs, parts.hulls[:, parts.hulls.shape[1] // 2]
        rows = range(len(pairs.row))
        found = [self._separation(pairs.link[m], pairs.piece[m], corners[m]).distance for m in rows]
        distance = np.array(found) - self.links.radii[pairs.link]
        for m in np.flatnonzero(may_touch & (distance < min(0.0, self.limit))).tolist():
            swept, piece = self._one(parts, m)
            if piece.mesh is not None:
                distance[m] = -mesh_depth(self.contact, swept, piece)
        return distance

    def _by_faces(self, parts: _SweptPairs, needed: Array, touching: Mask) -> tuple[Array, Mask]:
        """How far planes on pieces' faces keep hulls apart (m,), at least, and contacts they prove allowed.

        Contacts are looked at of hulls that are ``touching`` and not kept apart as far as is ``needed`` [m].
        """
        gap, allowed = np.full(len(needed), -np.inf), np.zeros(len(needed), dtype=bool)
        for rows, link, piece in self._alike(parts):
            swept, heights = self._swept(parts, link, rows), piece.support(piece.normals)
            apart = (swept.hulls @ piece.normals.T).min((1, 2)) - heights
            gap[rows] = apart.max(1)
            touch = np.flatnonzero(touching[rows] & (gap[rows] < needed[rows]))
            if len(touch):
                some = swept.take(touch)
                cores = some.shrunk(self.contact)
                k = np.argmax((cores @ piece.normals.T).min((1, 2)) - heights, axis=1)
                proven = planes_prove(self.contact, some, cores, piece.normals[k], heights[k])
                allowed[rows[touch]] = proven
        return gap, allowed

    def _alike(self, parts: _SweptPairs) -> Iterator[tuple[Indices, int, Piece]]:
        """Rows of pairs of one solid of a link and one piece that has faces, not too many at once."""
        if not len(parts.pairs.row):
            return
        keys = np.column_stack([parts.pairs.link, parts.pairs.piece])
        order = np.lexsort(keys.T[::-1])
        ends = 1 + np.flatnonzero((np.diff(keys[order], axis=0) != 0).any(1))
        for rows in np.split(order, ends):
            link, piece = int(keys[rows[0], 0]), self.obstacles.pieces[keys[rows[0], 1]]
            if len(piece.normals):
                corners = len(self.links.corners[link])
                size = parts.hulls.shape[1] * corners * max(corners, len(piece.normals))
                for block in np.array_split(rows, 1 + len(rows) * size // PROOFS.corners_at_once):
                    yield block, link, piece

    def _one(self, parts: _SweptPairs, m: int) -> tuple[SweptSolids, Piece]:
        """The solid of one pair and its piece."""
        swept = self._swept(parts, int(parts.pairs.link[m]), np.array([m]))
        return swept, self.obstacles.pieces[parts.pairs.piece[m]]

    def _swept(self, parts: _SweptPairs, link: int, rows: Indices) -> SweptSolids:
        hulls, radius = (
            parts.hulls[rows][:, :, : len(self.links.corners[link])],
            float(self.links.radii[link]),
        )
        return SweptSolids(hulls, radius, parts.tools[rows], parts.bulge[rows], parts.tool_bulge[rows])

    def _examine(self, every: _ClosePairs, intervals: Intervals) -> IntervalVerdicts:
        pairs = every.take(intervals.item)
        hulls, tools = self._samples(pairs, intervals)  # (m, 3 samples, k corners, 3), (m, 3 samples, 3)
        bulge = chord_deviation(self.links.acceleration[pairs.link, pairs.row], intervals.length)
        tool_bulge = chord_deviation(self.segments.tool_acceleration_bound[pairs.row], intervals.length)
        always, middle = self._may_touch(pairs, tools, tool_bulge)
        moved = np.linalg.norm(hulls - hulls[:, 1:2], axis=-1).max((1, 2))
        needed = self.links.radii[pairs.link] + self.limit + bulge - TOUCH
        proven = self._boxes_apart(hulls, pairs.piece, needed)
        left, parts = np.flatnonzero(~proven), _SweptPairs(pairs, hulls, tools, bulge, tool_bulge)
        gap, allowed = self._by_faces(parts.take(left), needed[left], always[left])
        proven[left] = (gap >= needed[left]) | allowed
        refuted = np.zeros(len(proven), dtype=bool)
        for m in np.flatnonzero(~proven).tolist():
            found = self._separation(pairs.link[m], pairs.piece[m], hulls[m, 1])
            swept, piece = self._one(parts, m)
            nearest = float((hulls[m] @ found.normal).min() - piece.support(found.normal))
            if piece.mesh is not None:  # the plane bounds the hull of the mesh, which may have room inside
                nearest = max(nearest, found.distance - moved[m])
            proven[m] = nearest >= needed[m] or (always[m] and is_allowed(self.contact, swept, piece))
            refuted[m] = found.distance < needed[m] - bulge[m]
            if middle[m] and refuted[m]:
                still = SweptSolids(swept.hulls[:, 1:2], swept.radius, swept.tools[:, 1:2], *np.zeros((2, 1)))
                refuted[m] = not is_allowed(self.contact, still, piece)
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
        may_touch = self._may_touch(pairs, tools[:, None], np.zeros(len(tools)))[1]
        parts = _SweptPairs(pairs, own[:, None], tools[:, None], *np.zeros((2, len(tools))))
        nearest = self._nearest(pairs, self._distances(parts, may_touch), may_touch)
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
