"""Proof that every link keeps its distance from every solid.

At the middle of a part of a hop, a plane is laid square to the shortest way from a piece of a solid to the
hull of the link's corners. While the corners stay beyond the plane by the link's radius and the clearance,
the link is clear; they lie between their samples up to the sag that their acceleration allows.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely

from regionik.planners.collision.convex_bodies import Piece, Separation
from regionik.planners.collision.distances import Obstacles, hull_separation, obstacles_from
from regionik.values import Violation
from regionik.verification.contact import SIGNS, TOUCH, Contact, Moved, contact_of, depth_of, touches
from regionik.verification.findings import Finding, Words, finding
from regionik.verification.motion import Indices, Journey, Mask, Parts, Verdicts, prove, sag
from regionik.worlds.arrays import Array
from regionik.worlds.scene import World

SHORTEST = 1e-4  # motion of a link over half a part below which its halves are not looked at [m]
LOOK = 0.05  # how far beyond the clearance distances at states are measured for the margin [m]
SHALLOW = 1e-8  # to which the depth of boxes in meshes is found [m]


@dataclass(frozen=True, eq=False)
class _Links:
    """The robot's solids on their way: all points within a radius of the hull of some corners."""

    journey: Journey

    @cached_property
    def corners(self) -> tuple[Array, ...]:
        """In the links' frames, of each solid (k, 3) [m]."""
        return tuple(solid.corners for solid in self.journey.robot.all_solids)

    @cached_property
    def radii(self) -> Array:
        return np.array([solid.radius for solid in self.journey.robot.all_solids])

    @property
    def last(self) -> Mask:
        """The solids of the last link that has one."""
        links = np.array([solid.link for solid in self.journey.robot.all_solids])
        outermost: Mask = links == links.max()
        return outermost

    @cached_property
    def acceleration(self) -> Array:
        """Bound for any point of each solid's hull, (solids, hops): the largest of its corners."""
        return np.array(
            [
                np.max([self.journey.acceleration(solid.link, corner) for corner in solid.corners], axis=0)
                for solid in self.journey.robot.all_solids
            ]
        )

    def place(self, base: Array, joints: Array) -> tuple[Array, Array]:
        """Corners of all solids in the world, (m, solids, k, 3), and the tool, (m, 3).

        Where a solid has fewer corners than k, its first one stands in for the rest.
        """
        robot = self.journey.robot
        arm = robot.frames(base, joints)
        T_world_base = robot.T_world_arm(base) @ np.linalg.inv(robot.T_base_arm)
        frames = np.concatenate([arm, T_world_base[:, None]], axis=1)  # the base last, at its index
        most = max(len(corners) for corners in self.corners)
        hulls = [
            frames[:, solid.link, None, :3, 3]
            + np.concatenate([corners, np.repeat(corners[:1], most - len(corners), axis=0)])
            @ frames[:, solid.link, :3, :3].swapaxes(1, 2)
            for solid, corners in zip(self.journey.robot.all_solids, self.corners, strict=True)
        ]
        return np.stack(hulls, axis=1), arm[:, -1, :3, 3]


def arm(world: World, journey: Journey, words: Words) -> list[Finding]:
    """Every link ``arm_clearance`` away from every solid, but for the tip of the last that touches its work.

    The second finding is of that contact.
    """
    if not world.solids or not world.robot.all_solids:
        return [finding("arm", np.inf, [])]
    return _Arm(world, journey, words, obstacles_from(world.solids)).check()


def _depth(piece: Piece, corners: Array) -> float:
    """How much a box that cuts a mesh must shrink, on all sides, to be free of it [m].

    Surfaces that cross have no distance that would tell a graze from a cut.
    """
    middle, half = corners.mean(0), (corners[[4, 2, 1]] - corners[0]) / 2
    sizes = np.linalg.norm(half, axis=1)
    low, high = 0.0, float(sizes.min())
    while high - low > SHALLOW:
        inset = (low + high) / 2
        shrunk = middle + SIGNS @ (half * (1 - inset / sizes)[:, None])
        low, high = (low, inset) if hull_separation(piece, shrunk).distance > 0 else (inset, high)
    return low


@dataclass(frozen=True, eq=False)
class _Pairs:
    """A state or hop, a solid of a link and a piece of another solid that come close."""

    row: Indices
    link: Indices
    piece: Indices

    def take(self, which: Mask) -> _Pairs:
        return _Pairs(self.row[which], self.link[which], self.piece[which])


_Key = tuple[int, int, int]  # state or hop, solid of a link, other solid
_Close = tuple[float, bool]  # least gap [m], and whether the tool may touch there
_NONE = (np.inf, False)


@dataclass(frozen=True, eq=False)
class _Arm:
    world: World
    journey: Journey
    words: Words
    obstacles: Obstacles

    @cached_property
    def links(self) -> _Links:
        return _Links(self.journey)

    @cached_property
    def contact(self) -> Contact:
        return contact_of(self.world, self.obstacles)

    @cached_property
    def shadows(self) -> shapely.STRtree:
        """Boxes round the pieces, as they are seen from above."""
        return shapely.STRtree(shapely.box(*self.obstacles.low[:, :2].T, *self.obstacles.high[:, :2].T))

    @property
    def limit(self) -> float:
        return self.world.rules.arm_clearance

    def check(self) -> list[Finding]:
        motion = self.journey.motion
        hulls, tools = self.links.place(motion.base, motion.joints)
        still = self._close(hulls, np.full(hulls.shape[:2], LOOK))
        gap = self._gaps(hulls[still.row, still.link], still)
        bulge = np.zeros(len(gap))
        exempt = self._exempt(still, tools[still.row][:, None], bulge)[1]
        gap, fits = self._touching(still, hulls[still.row, still.link], tools[still.row], gap, exempt)
        violations = self._violations(still, gap, exempt, fits)
        hops = self._close(
            np.concatenate([hulls[:-1], hulls[1:]], axis=2), sag(self.links.acceleration.T, np.ones(1))
        )
        hit = {(v[0] + d, *v[1:]) for v in violations for d in (0, -1)}
        solid = self.obstacles.owner[hops.piece].tolist()
        rows = zip(hops.row.tolist(), hops.link.tolist(), solid, strict=True)
        hops = hops.take(np.array([row not in hit for row in rows], dtype=bool))
        outcome = prove(len(hops.row), lambda parts: self._look(hops, parts))
        told = [self._tell(key, self.words.state(key[0]), *found) for key, found in violations.items()]
        told += self._untold(hops, {**outcome.stuck, **outcome.failed})
        free = min(LOOK, float(gap[~exempt].min(initial=np.inf)) - self.limit)
        deep = min(LOOK, float(gap[exempt].min(initial=np.inf)) + self.contact.depth)
        return [
            finding("arm", free, [v for v in told if v.kind == "arm"]),
            finding("contact", deep if exempt.any() else np.inf, [v for v in told if v.kind == "contact"]),
        ]

    def _close(self, points: Array, bulge: Array) -> _Pairs:
        """Pairs whose boxes come within the clearance; points (n, solids, k, 3), bulge (n, solids)."""
        count = points.shape[1]
        low, high = points.min(2).reshape(-1, 3), points.max(2).reshape(-1, 3)
        within = (self.links.radii + self.limit + bulge).reshape(-1)
        around = shapely.box(*(low[:, :2] - within[:, None]).T, *(high[:, :2] + within[:, None]).T)
        row, piece = self.shadows.query(around)
        apart = np.maximum(low[row] - self.obstacles.high[piece], self.obstacles.low[piece] - high[row])
        gap = np.linalg.norm(np.maximum(apart, 0.0), axis=1)
        close = (gap == 0) | (gap < within[row])
        row, piece = row[close], piece[close]
        order = np.lexsort([piece, row])
        return _Pairs(row[order] // count, row[order] % count, piece[order])

    def _gaps(self, corners: Array, pairs: _Pairs) -> Array:
        """Distances between link solids, given by their corners (m, k, 3), and pieces."""
        rows = range(len(pairs.row))
        found = [self._separation(pairs.link[m], pairs.piece[m], corners[m]).distance for m in rows]
        return np.array(found) - self.links.radii[pairs.link]

    def _separation(self, link: int, piece: int, corners: Array) -> Separation:
        """Signed distance of the hull of a link's corners from a piece."""
        own = corners[: len(self.links.corners[link])]
        met, other = hull_separation(self.obstacles.pieces[piece], own), self.obstacles.pieces[piece]
        if met.distance > 0 or other.mesh is None or self.links.radii[link] > 0:
            return met
        return met._replace(distance=min(met.distance, -_depth(other, own)))

    def _exempt(self, pairs: _Pairs, tools: Array, bulge: Array) -> tuple[Mask, Mask]:
        last = self.links.last[pairs.link]
        owner = np.where(last, self.obstacles.owner[pairs.piece], -1)
        return self.contact.allows(owner, tools, bulge)

    def _touching(
        self, pairs: _Pairs, hulls: Array, tools: Array, gap: Array, exempt: Mask
    ) -> tuple[Array, Mask]:
        """Gaps of pairs at rest, and which of them touch as the rules let them.

        Corners (m, k, 3), tools (m, 3), gaps (m,), and where the tool may touch (m,).
        """
        gap, fits = gap.copy(), np.zeros(len(gap), dtype=bool)
        for m in np.flatnonzero(exempt & (gap < self.limit)).tolist():
            piece = self.obstacles.pieces[pairs.piece[m]]
            still = self._moved(int(pairs.link[m]), hulls[m, None], tools[m, None])
            fits[m] = touches(self.contact, still, piece)
            if gap[m] < 0 and piece.mesh is not None:
                gap[m] = -depth_of(self.contact, still, piece)
        return gap, fits

    def _moved(
        self, link: int, hulls: Array, tools: Array, bulge: float = 0.0, tool_bulge: float = 0.0
    ) -> Moved:
        own = np.broadcast_to(hulls, (3, *hulls.shape[1:]))[:, : len(self.links.corners[link])]
        return Moved(own, float(self.links.radii[link]), np.broadcast_to(tools, (3, 3)), bulge, tool_bulge)

    def _look(self, hops: _Pairs, parts: Parts) -> Verdicts:
        item = parts.item
        pairs = _Pairs(hops.row[item], hops.link[item], hops.piece[item])
        hulls, tools = self._samples(pairs, parts)  # (m, 3 samples, k corners, 3), (m, 3 samples, 3)
        length = parts.high - parts.low
        bulge = sag(self.links.acceleration[pairs.link, pairs.row], length)
        tool_bulge = sag(self.journey.tool_acceleration[pairs.row], length)
        whole, middle = self._exempt(pairs, tools, tool_bulge)
        moved = np.linalg.norm(hulls - hulls[:, 1:2], axis=-1).max((1, 2))
        need = self.links.radii[pairs.link] + self.limit + bulge - TOUCH
        proven = self._boxes_apart(hulls, pairs.piece, need)
        failed = np.zeros(len(item), dtype=bool)
        for m in np.flatnonzero(~proven).tolist():
            found = self._separation(pairs.link[m], pairs.piece[m], hulls[m, 1])
            piece = self.obstacles.pieces[pairs.piece[m]]
            beyond = float((hulls[m] @ found.normal).min() - piece.support(found.normal))
            if piece.mesh is not None:  # a plane goes round the hull of a mesh; there may be room within
                beyond = max(beyond, found.distance - moved[m])
            proven[m] = beyond >= need[m]
            if whole[m] and not proven[m]:
                part = self._moved(int(pairs.link[m]), hulls[m], tools[m], bulge[m], tool_bulge[m])
                proven[m] = touches(self.contact, part, piece)
            failed[m] = found.distance < need[m] - bulge[m]
            if middle[m] and failed[m]:
                still = self._moved(int(pairs.link[m]), hulls[m, 1:2], tools[m, 1:2])
                failed[m] = not touches(self.contact, still, piece)
        return Verdicts(proven, failed, moved + 100 * bulge < SHORTEST)

    def _samples(self, pairs: _Pairs, parts: Parts) -> tuple[Array, Array]:
        """Corners and tool at both ends and the middle of parts; parts that pairs share are placed once."""
        keys = np.column_stack([pairs.row, parts.low, parts.high])
        once, index = np.unique(keys, axis=0, return_inverse=True)
        hop = once[:, 0].astype(np.int64)
        hulls, tools = [], []
        for s in (once[:, 1], (once[:, 1] + once[:, 2]) / 2, once[:, 2]):
            corners, tool = self.links.place(self.journey.base(hop, s), self.journey.joints(hop, s))
            hulls.append(corners[index, pairs.link])
            tools.append(tool[index])
        return np.stack(hulls, axis=1), np.stack(tools, axis=1)

    def _boxes_apart(self, hulls: Array, piece: Indices, need: Array) -> Mask:
        low, high = hulls.min((1, 2)), hulls.max((1, 2))
        gap = np.maximum(np.maximum(low - self.obstacles.high[piece], self.obstacles.low[piece] - high), 0.0)
        apart: Mask = (np.linalg.norm(gap, axis=1) >= need) & (gap > 0).any(1)
        return apart

    def _violations(self, pairs: _Pairs, gap: Array, exempt: Mask, fits: Mask) -> dict[_Key, _Close]:
        """Least gap of each state, link and solid too close, and whether the tool may touch there."""
        worst: dict[_Key, _Close] = {}
        for m in np.flatnonzero((gap < self.limit - TOUCH) & ~fits).tolist():
            key = int(pairs.row[m]), int(pairs.link[m]), int(self.obstacles.owner[pairs.piece[m]])
            worst[key] = min(worst.get(key, _NONE), (float(gap[m]), bool(exempt[m])))
        return worst

    def _untold(self, hops: _Pairs, where: dict[int, float]) -> list[Violation]:
        """Violations between states, one for each hop, link and solid."""
        worst: dict[_Key, _Close] = {}
        for item, s in where.items():
            one = _Pairs(*(column[item : item + 1] for column in (hops.row, hops.link, hops.piece)))
            here = self.journey.base(one.row, np.array([s])), self.journey.joints(one.row, np.array([s]))
            hulls, tools = self.links.place(*here)
            own = hulls[:, one.link[0]]
            near = self._exempt(one, tools[:, None], np.zeros(1))[1]
            gap = float(self._touching(one, own, tools, self._gaps(own, one), near)[0][0])
            key = int(one.row[0]), int(one.link[0]), int(self.obstacles.owner[one.piece[0]])
            worst[key] = min(worst.get(key, _NONE), (gap, bool(near[0])))
        return [self._tell(key, self.words.hop(key[0]), *found) for key, found in worst.items()]

    def _tell(self, key: _Key, where: str, gap: float, near: bool) -> Violation:
        state, link, solid = key
        part, name = self.world.robot.all_solids[link].name, self.world.solids[solid].name
        if near:
            return self._tell_contact(state, f"{part} touches {name} {where}", gap)
        if gap < 0:
            how = f"{part} overlaps {name} by {-gap:z.4f} m {where}"
        elif gap < self.limit:
            how = f"{part} comes within {gap:z.4f} m of {name} {where}"
        else:
            how = f"{part} is not proven clear of {name} {where}, {gap:.6f} m away"
        text = f"{how}; the arm's clearance is {self.limit:g} m"
        return Violation("arm", state, self.words.owner(state), max(0.0, self.limit - gap), text)

    def _tell_contact(self, state: int, what: str, gap: float) -> Violation:
        depth, reach = self.contact.depth, self.contact.reach
        deeper = -gap - depth
        if deeper > TOUCH:
            text = f"{what}, {-gap:z.4f} m deep; it may sink in {depth:.4g} m (contact_depth and tolerance)"
        else:
            text = f"{what} with parts that are not proven to lie within {reach:g} m of the tool point"
            text += f" (tool_contact), or to keep the arm's clearance of {self.limit:g} m from it"
        return Violation("contact", state, self.words.owner(state), max(0.0, deeper), text)
