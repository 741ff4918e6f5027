"""Proof that the tool's axis, and where it is asked for the whole tool frame, stays in its cone on the way.

Axes are points of the sphere, and frames, as unit quaternions, points of the sphere in four dimensions; on
it they lie half as far apart as the frames are turned. Both go along the shorter arc from one set-point to
the next.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from regionik.values import Violation
from regionik.verification.findings import Finding, OnPath, Words, finding, on_path
from regionik.verification.motion import Indices, Journey, Mask, Parts, Verdicts, prove, sag
from regionik.worlds.arrays import Array
from regionik.worlds.scene import World

BETWEEN = 1e-6  # [rad]
SHORTEST = 1e-4  # turn of the tool over half a part below which its halves are not looked at [rad]


def direction(world: World, journey: Journey, words: Words) -> Finding:
    """Tool axis within the cone along the path, where both set-points ask for a direction.

    Between two directions the axis may turn along the arc from one to the other; the wider cone counts. Where
    both ask for an orientation, the frame goes its own way and takes the axis along.
    """
    axes = [target.direction for target in world.task]
    on = on_path(len(world.task), journey)
    asked = _both(axes, on.hop_ends) & ~_both([target.orientation for target in world.task], on.hop_ends)
    if not asked.any():
        return finding("direction", np.inf, [])

    def point(hop: Indices, s: Array) -> Array:
        return journey.frames(hop, s)[:, -1, :3, 2]

    return _told(_bound(world, journey, on, asked, axes, point), words, "direction", "axis", 1.0)


def orientation(world: World, journey: Journey, words: Words) -> Finding:
    """Tool frame within the cone along the path, where both set-points ask for an orientation.

    Between two orientations the frame may turn evenly the shorter way; the wider cone counts.
    """
    turns = [target.orientation for target in world.task]
    on = on_path(len(world.task), journey)
    asked = _both(turns, on.hop_ends)
    if not asked.any():
        return finding("orientation", np.inf, [])
    frames = [None if turn is None else _quaternions(turn) for turn in turns]

    def point(hop: Indices, s: Array) -> Array:
        return _quaternions(journey.frames(hop, s)[:, -1, :3, :3])

    bound = _bound(world, journey, on, asked, frames, point)
    # q'' = (w' + w w / 2) q / 2, where |w'| is at most half the square of the bound of the turning rate |w|.
    end = _towards(bound.end, bound.start)
    halved = replace(bound, towards=_towards, end=end, cone=bound.cone / 2, bend=bound.bend / 2)
    return _told(halved, words, "orientation", "frame", 2.0)


def _both(asked: Sequence[Array | None], ends: Indices) -> Mask:
    """Hops between two set-points that both ask."""
    asks = np.array([one is not None for one in asked], dtype=np.bool_)
    both: Mask = asks[ends[:, 0]] & asks[ends[:, 1]]
    return both


def _bound(
    world: World,
    journey: Journey,
    on: OnPath,
    asked: Mask,
    points: Sequence[Array | None],
    point: Callable[[Indices, Array], Array],
) -> _Bound:
    """The hops asked for, with the points at both of their set-points."""
    cones, hops, ends = np.array([target.cone for target in world.task]), on.hop[asked], on.hop_ends[asked]
    start, end = (np.array([points[i] for i in side], dtype=np.float64) for side in ends.T)
    return _Bound(point, _as_it_is, hops, start, end, cones[ends].max(1), journey.swing[hops])


def _told(every: _Bound, words: Words, kind: str, what: str, scale: float) -> Finding:
    """What is off at states, and not proven between them; ``scale`` makes angles those of the tool."""
    sides = np.arange(len(every.hop))
    off = np.stack([every.off(sides, np.full(len(sides), s)) for s in (0.0, 1.0, 0.5)])
    bad = off[:2] > every.cone + BETWEEN / scale
    states: dict[int, tuple[float, float]] = {}
    for side, item in np.argwhere(bad).tolist():
        found = float(off[side, item]), float(every.cone[item])
        states[int(every.hop[item]) + side] = max(states.get(int(every.hop[item]) + side, found), found)

    def tell(state: int, where: str, angle: float, cone: float) -> Violation:
        how = f"is {scale * angle:.4f} rad off" if angle > cone else ""
        how = how or f"is not proven to stay, {scale * angle:.6f} rad off,"
        text = f"the tool's {what} {how} {where}; the cone allows {scale * cone:g} rad"
        return Violation(kind, state, words.owner(state), max(0.0, scale * (angle - cone)), text)

    told = [tell(k, words.state(k), *found) for k, found in states.items()]
    hops = every.take(~(bad[0] | bad[1]))
    outcome = prove(len(hops.hop), lambda parts: hops.look(parts, BETWEEN / scale, np.pi / scale))
    for item, s in {**outcome.failed, **outcome.stuck}.items():
        k, angle = int(hops.hop[item]), float(hops.off(np.array([item]), np.array([s]))[0])
        told.append(tell(k, words.hop(k), angle, float(hops.cone[item])))
    return finding(kind, scale * float((every.cone - off).min()), told)


@dataclass(frozen=True, eq=False)
class _Bound:
    """Hops on which a point of a sphere is bound, what is asked at both ends, and the cone round that arc."""

    point: Callable[[Indices, Array], Array]  # on hops, at parts of them, (m, d)
    towards: Callable[[Array, Array], Array]  # of points that mean the same, those nearest to others
    hop: Indices
    start: Array  # (n, d)
    end: Array  # (n, d)
    cone: Array  # (n,) [rad]
    bend: Array  # most that the point accelerates, (n,) [1 per hop^2]

    def take(self, which: Mask) -> _Bound:
        start, end, cone, bend = (row[which] for row in (self.start, self.end, self.cone, self.bend))
        return _Bound(self.point, self.towards, self.hop[which], start, end, cone, bend)

    def at(self, item: Indices, s: Array) -> Array:
        return self.towards(self.point(self.hop[item], s), self.start[item] + self.end[item])

    def off(self, item: Indices, s: Array) -> Array:
        """Angle between the point and the arc [rad]."""
        point = self.at(item, s)
        return angle_between(point, _nearest_on_arc(point, self.start[item], self.end[item]))

    def look(self, parts: Parts, slack: float, most: float) -> Verdicts:
        item, cone = parts.item, self.cone[parts.item]
        middle = self.at(item, parts.middle)
        # A part on which the sag is under 1 is too short for the point to come near to its opposite.
        low, high = (self.towards(self.point(self.hop[item], s), middle) for s in (parts.low, parts.high))
        swing = sag(self.bend[item], parts.high - parts.low)
        bulge = np.arcsin(np.minimum(swing, 1.0))
        core = _nearest_on_arc(middle, self.start[item], self.end[item])
        # Points within a narrow cone form a convex cone: a chord stays in it when its ends do.
        narrow = np.maximum(angle_between(low, core), angle_between(high, core))
        centre = angle_between(middle, core)
        moved = np.maximum(angle_between(low, middle), angle_between(high, middle))
        bound = np.minimum(
            np.where(narrow < np.pi / 2, narrow, np.inf), np.where(moved < np.pi / 2, centre + moved, np.inf)
        )
        proven = ((swing < 1) & (bound + bulge <= cone + slack)) | (cone >= most)
        return Verdicts(proven, centre > cone + slack, moved + 100 * swing < SHORTEST)


def angle_between(u: Array, v: Array) -> Array:
    """Angle between unit vectors, accurate near 0."""
    angle: Array = 2 * np.arctan2(np.linalg.norm(u - v, axis=-1), np.linalg.norm(u + v, axis=-1))
    return angle


def _nearest_on_arc(u: Array, a: Array, b: Array) -> Array:
    """Nearest point to u on the shorter arc from a to b."""
    rest = b - a * (a * b).sum(-1, keepdims=True)
    size = np.linalg.norm(rest, axis=-1, keepdims=True)
    side = rest / np.maximum(size, 1e-300)
    x, y = (u * a).sum(-1), (u * side).sum(-1)
    at = np.arctan2(y, x)
    between = (at >= 0) & (at <= np.arctan2(size[:, 0], (a * b).sum(-1)))
    usable = between & (size[:, 0] > 1e-9) & (np.hypot(x, y) > 1e-9)
    inner = np.cos(at)[:, None] * a + np.sin(at)[:, None] * side
    end = np.where((angle_between(u, a) <= angle_between(u, b))[:, None], a, b)
    core: Array = np.where(usable[:, None], inner, end)
    return core


def _as_it_is(points: Array, others: Array) -> Array:
    """Points of which each means something else."""
    return points


def _towards(points: Array, others: Array) -> Array:
    """Quaternions, of which opposite ones mean the same frame."""
    near: Array = np.where((points * others).sum(-1, keepdims=True) < 0, -points, points)
    return near


def _quaternions(frames: Array) -> Array:
    """Unit quaternions (..., 4) of rotation matrices (..., 3, 3), the real part first."""
    K = np.empty((*frames.shape[:-2], 4, 4))
    trace = np.trace(frames, axis1=-2, axis2=-1)
    K[..., 0, 0] = 1 + trace
    for i, (j, k) in enumerate(((1, 2), (2, 0), (0, 1))):
        K[..., 1 + i, 1 + i] = 1 + 2 * frames[..., i, i] - trace
        K[..., 0, 1 + i] = K[..., 1 + i, 0] = frames[..., k, j] - frames[..., j, k]
        K[..., 1 + j, 1 + k] = K[..., 1 + k, 1 + j] = frames[..., j, k] + frames[..., k, j]
    longest = np.argmax(np.linalg.norm(K, axis=-1), axis=-1)  # every row is a multiple of the quaternion
    row = np.take_along_axis(K, longest[..., None, None], axis=-2)[..., 0, :]
    unit: Array = row / np.linalg.norm(row, axis=-1, keepdims=True)
    return unit
