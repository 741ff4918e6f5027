"""Proof that every link keeps its distance from every solid.

At the middle of a part of a hop, a plane is laid square to the shortest way from a piece of a solid to the
link's axis. While the axis stays beyond the plane by its radius and the clearance, the link is clear; the
axis lies between its samples up to the sag that its acceleration allows.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from regionik.findings import Finding, Words, finding
from regionik.journey import Indices, Journey, Mask, Parts, Verdicts, prove, sag
from regionik.plan import Violation
from regionik.planners.collision import Obstacles, box_gaps, obstacles_from, separation
from regionik.worlds.arrays import Array
from regionik.worlds.scene import World

TOUCH = 1e-6  # [m]
SHORTEST = 1e-4  # motion of a link over half a part below which its halves are not looked at [m]
LOOK = 0.05  # how far beyond the clearance distances at states are measured for the margin [m]
ROWS = 1_000_000  # pairs of links and pieces whose boxes are compared together


@dataclass(frozen=True, eq=False)
class _Contact:
    """Where the last link may touch: near a set-point, what lies there.

    Attributes
    ----------
    trees : dict of int to cKDTree
        Set-points that lie on, in or near a solid, by the solid's index.
    reach : float
        ``tool_contact`` [m].
    """

    trees: dict[int, cKDTree]
    reach: float

    def allows(self, solid: Indices, tools: Array, bulge: Array) -> tuple[Mask, Mask]:
        """Whether the tool (m, samples, 3) is near a set-point of the solid: all along, and in the middle."""
        whole = np.zeros(len(solid), dtype=bool)
        middle = np.zeros(len(solid), dtype=bool)
        for k, tree in self.trees.items():
            mine = np.flatnonzero(solid == k)
            if not len(mine):
                continue
            centre = tools[mine, tools.shape[1] // 2]
            distance, nearest = tree.query(centre)
            away = np.linalg.norm(tools[mine] - tree.data[nearest][:, None], axis=-1).max(1)
            whole[mine] = away + bulge[mine] <= self.reach + TOUCH
            middle[mine] = distance <= self.reach + TOUCH
        return whole, middle


def _contact(world: World, obstacles: Obstacles) -> _Contact:
    """Give each set-point the one solid that it lies on or in, or is nearest to within ``tool_contact``."""
    owners: dict[int, list[Array]] = {}
    reach = world.rules.tool_contact
    for target in world.task:
        spot = target.position[None, None]
        near = np.unique(obstacles.owner[box_gaps(obstacles, spot, spot)[0] <= reach])
        distances = [(obstacles.solids[k].distance(target.position), int(k)) for k in near.tolist()]
        if distances and min(distances)[0] <= reach:
            owners.setdefault(min(distances)[1], []).append(target.position)
    return _Contact({k: cKDTree(np.array(spots)) for k, spots in sorted(owners.items())}, reach)


@dataclass(frozen=True, eq=False)
class _Links:
    """The robot's capsules on their way."""

    journey: Journey

    @property
    def radii(self) -> Array:
        return np.array([capsule.radius for capsule in self.journey.robot.solids])

    @property
    def last(self) -> Mask:
        """The capsules of the last link that has one."""
        links = np.array([capsule.link for capsule in self.journey.robot.solids])
        outermost: Mask = links == links.max()
        return outermost

    @cached_property
    def acceleration(self) -> Array:
        """Bound for any point of each capsule's axis, (capsules, hops): the larger of its ends."""
        return np.array(
            [
                np.maximum(
                    self.journey.acceleration(c.link, c.start), self.journey.acceleration(c.link, c.end)
                )
                for c in self.journey.robot.solids
            ]
        )

    def place(self, frames: Array) -> tuple[Array, Array]:
        """Ends of all axes in the world, (m, capsules, 2, 3), and the tool, (m, 3)."""
        ends = [
            frames[:, c.link, None, :3, 3]
            + np.stack([c.start, c.end]) @ frames[:, c.link, :3, :3].swapaxes(1, 2)
            for c in self.journey.robot.solids
        ]
        return np.stack(ends, axis=1), frames[:, -1, :3, 3]


def arm(world: World, journey: Journey, words: Words) -> Finding:
    """Every link ``arm_clearance`` away from every solid, but for the last where it may touch its work."""
    if not world.solids or not world.robot.solids:
        return finding("arm", np.inf, [])
    return _Arm(world, journey, words, obstacles_from(world.solids)).check()


@dataclass(frozen=True, eq=False)
class _Pairs:
    """A state or hop, a capsule and a piece that come close."""

    row: Indices
    capsule: Indices
    piece: Indices

    def take(self, which: Mask) -> _Pairs:
        return _Pairs(self.row[which], self.capsule[which], self.piece[which])


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
    def contact(self) -> _Contact:
        return _contact(self.world, self.obstacles)

    @property
    def limit(self) -> float:
        return self.world.rules.arm_clearance

    def check(self) -> Finding:
        motion = self.journey.motion
        ends, tools = self.links.place(self.journey.robot.frames(motion.base, motion.joints))
        still = self._close(ends, np.full(ends.shape[:2], LOOK))
        gap = self._gaps(ends[still.row, still.capsule], still)
        bulge = np.zeros(len(gap))
        exempt = self._exempt(still, tools[still.row][:, None], bulge)[1]
        violations = self._violations(still, gap, exempt)
        hops = self._close(
            np.concatenate([ends[:-1], ends[1:]], axis=2), sag(self.links.acceleration.T, np.ones(1))
        )
        hit = {(v[0] + d, *v[1:]) for v in violations for d in (0, -1)}
        solid = self.obstacles.owner[hops.piece].tolist()
        rows = zip(hops.row.tolist(), hops.capsule.tolist(), solid, strict=True)
        hops = hops.take(np.array([row not in hit for row in rows], dtype=bool))
        outcome = prove(len(hops.row), lambda parts: self._look(hops, parts))
        told = [self._tell(key, self.words.state(key[0]), g) for key, g in violations.items()]
        told += self._untold(hops, {**outcome.stuck, **outcome.failed})
        return finding("arm", min(LOOK, float(gap[~exempt].min(initial=np.inf)) - self.limit), told)

    def _close(self, points: Array, bulge: Array) -> _Pairs:
        """Pairs whose boxes come within the clearance; points (n, capsules, k, 3), bulge (n, capsules)."""
        n, count = points.shape[:2]
        low, high = points.min(2).reshape(-1, 1, 3), points.max(2).reshape(-1, 1, 3)
        within = (self.links.radii + self.limit + bulge).reshape(-1)
        stride = max(1, ROWS // len(self.obstacles.pieces))
        found = []
        for k in range(0, n * count, stride):
            gaps = box_gaps(self.obstacles, low[k : k + stride], high[k : k + stride])
            row, piece = np.nonzero(gaps < within[k : k + stride, None])
            found.append(np.column_stack([row + k, piece]))
        pairs = np.concatenate(found) if found else np.zeros((0, 2), dtype=np.int64)
        return _Pairs(pairs[:, 0] // count, pairs[:, 0] % count, pairs[:, 1])

    def _gaps(self, axes: Array, pairs: _Pairs) -> Array:
        """Distances between capsules, given by their axes (m, 2, 3), and pieces."""
        pieces = self.obstacles.pieces
        axis_gaps = [
            separation(pieces[k], a, b).distance for k, (a, b) in zip(pairs.piece.tolist(), axes, strict=True)
        ]
        return np.array(axis_gaps) - self.links.radii[pairs.capsule]

    def _exempt(self, pairs: _Pairs, tools: Array, bulge: Array) -> tuple[Mask, Mask]:
        last = self.links.last[pairs.capsule]
        owner = np.where(last, self.obstacles.owner[pairs.piece], -1)
        return self.contact.allows(owner, tools, bulge)

    def _look(self, hops: _Pairs, parts: Parts) -> Verdicts:
        item = parts.item
        pairs = _Pairs(hops.row[item], hops.capsule[item], hops.piece[item])
        axes, tools = self._samples(pairs, parts)  # (m, 3 samples, 2 ends, 3), (m, 3 samples, 3)
        length = parts.high - parts.low
        bulge = sag(self.links.acceleration[pairs.capsule, pairs.row], length)
        whole, middle = self._exempt(pairs, tools, sag(self.journey.tool_acceleration[pairs.row], length))
        moved = np.linalg.norm(axes - axes[:, 1:2], axis=-1).max((1, 2))
        need = self.links.radii[pairs.capsule] + self.limit + bulge - TOUCH
        proven = whole | self._boxes_apart(axes, pairs.piece, need)
        failed = np.zeros(len(item), dtype=bool)
        pieces = self.obstacles.pieces
        for m in np.flatnonzero(~proven).tolist():
            piece = pieces[pairs.piece[m]]
            found = separation(piece, axes[m, 1, 0], axes[m, 1, 1])
            beyond = float((axes[m] @ found.normal).min() - piece.support(found.normal))
            proven[m] = max(beyond, found.distance - moved[m]) >= need[m]
            failed[m] = found.distance < need[m] - bulge[m] and not middle[m]
        return Verdicts(proven, failed, moved + 100 * bulge < SHORTEST)

    def _samples(self, pairs: _Pairs, parts: Parts) -> tuple[Array, Array]:
        """Axes and tool at both ends and the middle of parts; parts that pairs share are placed once."""
        keys = np.column_stack([pairs.row, parts.low, parts.high])
        once, index = np.unique(keys, axis=0, return_inverse=True)
        hop = once[:, 0].astype(np.int64)
        axes, tools = [], []
        for s in (once[:, 1], (once[:, 1] + once[:, 2]) / 2, once[:, 2]):
            ends, tool = self.links.place(self.journey.frames(hop, s))
            axes.append(ends[index, pairs.capsule])
            tools.append(tool[index])
        return np.stack(axes, axis=1), np.stack(tools, axis=1)

    def _boxes_apart(self, axes: Array, piece: Indices, need: Array) -> Mask:
        low, high = axes.min((1, 2)), axes.max((1, 2))
        gap = np.maximum(np.maximum(low - self.obstacles.high[piece], self.obstacles.low[piece] - high), 0.0)
        apart: Mask = (np.linalg.norm(gap, axis=1) >= need) & (gap > 0).any(1)
        return apart

    def _violations(self, pairs: _Pairs, gap: Array, exempt: Mask) -> dict[tuple[int, int, int], float]:
        """Least gap of each state, capsule and solid that are too close."""
        worst: dict[tuple[int, int, int], float] = {}
        for m in np.flatnonzero((gap < self.limit - TOUCH) & ~exempt).tolist():
            key = int(pairs.row[m]), int(pairs.capsule[m]), int(self.obstacles.owner[pairs.piece[m]])
            worst[key] = min(worst.get(key, np.inf), float(gap[m]))
        return worst

    def _untold(self, hops: _Pairs, where: dict[int, float]) -> list[Violation]:
        """Violations between states, one for each hop, capsule and solid."""
        worst: dict[tuple[int, int, int], float] = {}
        for item, s in where.items():
            one = _Pairs(*(column[item : item + 1] for column in (hops.row, hops.capsule, hops.piece)))
            ends, _ = self.links.place(self.journey.frames(one.row, np.array([s])))
            gap = float(self._gaps(ends[:, one.capsule[0]], one)[0])
            key = int(one.row[0]), int(one.capsule[0]), int(self.obstacles.owner[one.piece[0]])
            worst[key] = min(worst.get(key, np.inf), gap)
        return [self._tell(key, self.words.hop(key[0]), gap) for key, gap in worst.items()]

    def _tell(self, key: tuple[int, int, int], where: str, gap: float) -> Violation:
        state, capsule, solid = key
        link, name = self.world.robot.solids[capsule].name, self.world.solids[solid].name
        if gap < 0:
            how = f"{link} overlaps {name} by {-gap:.4f} m {where}"
        elif gap < self.limit:
            how = f"{link} comes within {gap:.4f} m of {name} {where}"
        else:
            how = f"{link} is not proven clear of {name} {where}, {gap:.6f} m away"
        text = f"{how}; the arm's clearance is {self.limit:g} m"
        return Violation("arm", state, self.words.owner(state), max(0.0, self.limit - gap), text)
