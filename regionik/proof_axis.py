"""Proof that the tool's axis stays in its cone on the way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from regionik.findings import Finding, Words, finding
from regionik.journey import Indices, Journey, Mask, Parts, Verdicts, prove, sag
from regionik.on_path import on_path
from regionik.plan import Violation
from regionik.worlds.arrays import Array
from regionik.worlds.scene import World

BETWEEN = 1e-6  # [rad]
SHORTEST = 1e-4  # turn of the tool over half a part below which its halves are not looked at [rad]


def direction(world: World, journey: Journey, words: Words) -> Finding:
    """Tool axis within the cone along the path, where both set-points ask for a direction.

    Between two directions the axis may turn along the arc from one to the other; the wider cone counts.
    """
    on = on_path(len(world.task), journey)
    asked = np.array([target.direction is not None for target in world.task])[on.hop_ends].all(1)
    if not asked.any():
        return finding("direction", np.inf, [])
    ends = on.hop_ends[asked]
    axes = np.array([[0, 0, 1] if target.direction is None else target.direction for target in world.task])
    cones = np.array([target.cone for target in world.task])
    every = _Axis(journey, on.hop[asked], axes[ends[:, 0]], axes[ends[:, 1]], cones[ends].max(1))
    sides = np.arange(len(every.hop))
    off = np.stack([every.off(sides, np.full(len(sides), s)) for s in (0.0, 1.0, 0.5)])
    bad = off[:2] > every.cone + BETWEEN
    states: dict[int, tuple[float, float]] = {}
    for side, item in np.argwhere(bad).tolist():
        found = float(off[side, item]), float(every.cone[item])
        states[int(every.hop[item]) + side] = max(states.get(int(every.hop[item]) + side, found), found)
    told = [_tell(words, k, words.state(k), *found) for k, found in states.items()]
    hops = every.take(~(bad[0] | bad[1]))
    outcome = prove(len(hops.hop), hops.look)
    for item, s in {**outcome.failed, **outcome.stuck}.items():
        k, angle = int(hops.hop[item]), float(hops.off(np.array([item]), np.array([s]))[0])
        told.append(_tell(words, k, words.hop(k), angle, float(hops.cone[item])))
    return finding("direction", float((every.cone - off).min()), told)


def _tell(words: Words, state: int, where: str, angle: float, cone: float) -> Violation:
    how = f"is {angle:.4f} rad off" if angle > cone else f"is not proven to stay, {angle:.6f} rad off,"
    text = f"the tool's axis {how} {where}; the cone allows {cone:g} rad"
    return Violation("direction", state, words.owner(state), max(0.0, angle - cone), text)


@dataclass(frozen=True, eq=False)
class _Axis:
    """Hops on which the tool's axis is bound, the directions at both ends and the cone round their arc."""

    journey: Journey
    hop: Indices
    start: Array  # (n, 3)
    end: Array  # (n, 3)
    cone: Array  # (n,) [rad]

    def take(self, which: Mask) -> _Axis:
        return _Axis(self.journey, self.hop[which], self.start[which], self.end[which], self.cone[which])

    def axis(self, item: Indices, s: Array) -> Array:
        return self.journey.frames(self.hop[item], s)[:, -1, :3, 2]

    def off(self, item: Indices, s: Array) -> Array:
        """Angle between the tool's axis and the arc [rad]."""
        axis = self.axis(item, s)
        return angle_between(axis, _nearest_on_arc(axis, self.start[item], self.end[item]))

    def look(self, parts: Parts) -> Verdicts:
        item, cone = parts.item, self.cone[parts.item]
        low, middle, high = (self.axis(item, s) for s in (parts.low, parts.middle, parts.high))
        swing = sag(self.journey.swing[self.hop[item]], parts.high - parts.low)
        bulge = np.arcsin(np.minimum(swing, 1.0))
        core = _nearest_on_arc(middle, self.start[item], self.end[item])
        # Directions within a narrow cone form a convex cone: a chord stays in it when its ends do.
        narrow = np.maximum(angle_between(low, core), angle_between(high, core))
        centre = angle_between(middle, core)
        moved = np.maximum(angle_between(low, middle), angle_between(high, middle))
        bound = np.minimum(
            np.where(narrow < np.pi / 2, narrow, np.inf), np.where(moved < np.pi / 2, centre + moved, np.inf)
        )
        proven = ((swing < 1) & (bound + bulge <= cone + BETWEEN)) | (cone >= np.pi)
        return Verdicts(proven, centre > cone + BETWEEN, moved + 100 * swing < SHORTEST)


def angle_between(u: Array, v: Array) -> Array:
    """Angle between unit vectors, accurate near 0."""
    angle: Array = np.arctan2(np.linalg.norm(np.cross(u, v), axis=-1), (u * v).sum(-1))
    return angle


def _nearest_on_arc(u: Array, a: Array, b: Array) -> Array:
    """Nearest direction to u on the shorter arc from a to b."""
    normal = np.cross(a, b)
    square = (normal**2).sum(-1, keepdims=True)
    flat = u - normal * (u * normal).sum(-1, keepdims=True) / np.maximum(square, 1e-300)
    size = np.linalg.norm(flat, axis=-1)[:, None]
    inner = flat / np.maximum(size, 1e-12)
    between = ((np.cross(a, inner) * normal).sum(-1) >= 0) & ((np.cross(inner, b) * normal).sum(-1) >= 0)
    usable = between & (square[:, 0] > 1e-18) & (size[:, 0] > 1e-9)
    end = np.where((angle_between(u, a) <= angle_between(u, b))[:, None], a, b)
    core: Array = np.where(usable[:, None], inner, end)
    return core
