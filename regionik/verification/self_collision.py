"""Proof that no link runs into another one, nor into the robot's own base.

Each pair is looked at in the frame of its lower body, which stands still there: only the joints between the
two count, and wherever the base drives makes no difference. At the middle of a part of a hop a plane is laid
between the two; while the moving one's corners, and their sag, stay beyond it, the two are apart.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from regionik.values import Violation
from regionik.verification.convex_distance import Gap, Hull, beyond, gaps, hull_of, hull_of_prism, plane_gaps
from regionik.verification.findings import Finding, Words, finding
from regionik.verification.motion import Bounds, Indices, Journey, Parts, Verdicts, prove, sag
from regionik.worlds.arrays import Array
from regionik.worlds.robot import Robot
from regionik.worlds.self_collision import base_body, self_collision_pairs

TOUCH = 1e-6  # [m]
SHORTEST = 1e-4  # motion of a link over half a part below which its halves are not looked at [m]
LOOK = 0.05  # up to where distances at states are measured for the margin [m]


def itself(journey: Journey, words: Words) -> Finding:
    """No overlap of two links that could meet, nor of a link and the base's own body."""
    found = [_Pair(journey, words, *bodies).check() for bodies in _bodies(journey.robot)]
    margin = min([margin for margin, _ in found], default=np.inf)
    return finding("self", margin, [violation for _, told in found for violation in told])


@dataclass(frozen=True, eq=False)
class _Body:
    """A solid of the robot, in the frame of its link; the base is link -1."""

    name: str
    link: int
    hull: Hull

    @cached_property
    def ball(self) -> tuple[Array, float]:
        """Centre and radius of a ball round the solid."""
        centre: Array = self.hull.corners.mean(0)
        return centre, float(np.linalg.norm(self.hull.corners - centre, axis=1).max()) + self.hull.radius


def _bodies(robot: Robot) -> Iterator[tuple[_Body, _Body]]:
    """The pairs that could meet, the body nearer to the base first."""
    body = base_body(robot)
    base = [] if body is None else [_Body("the robot's own base", -1, hull_of_prism(body))]
    links = [_Body(solid.name, solid.link, hull_of(solid)) for solid in robot.all_solids]
    for pair in self_collision_pairs(robot):
        if -1 in pair and not base:
            continue
        one, other = sorted((base[0] if k < 0 else links[k] for k in pair), key=lambda b: b.link)
        yield one, other


@dataclass(frozen=True, eq=False)
class _Pair:
    """Two bodies; the lower one is still in its own frame."""

    journey: Journey
    words: Words
    lower: _Body
    upper: _Body

    def check(self) -> tuple[float, list[Violation]]:
        """Least distance up to `LOOK`, and what is wrong."""
        near = self._ball_gaps()
        state = np.flatnonzero(near < LOOK)
        gap = self._least_gaps(self._place(self.journey.motion.joints[state]))
        hits = {k: g for k, g in zip(state.tolist(), gap.tolist(), strict=True) if g < -TOUCH}
        near[state] = gap
        hops = np.flatnonzero(np.minimum(near[:-1], near[1:]) < self.motion.speed / 2)
        hops = hops[[not {k, k + 1} & hits.keys() for k in hops.tolist()]]
        outcome = prove(len(hops), lambda parts: self._look(hops[parts.item], parts))
        told = [self._tell(k, self.words.state(k), g) for k, g in hits.items()]
        for item, s in {**outcome.stuck, **outcome.failed}.items():
            k, T = int(hops[item]), self._at(hops[item : item + 1], np.array([s]))
            told.append(self._tell(k, self.words.hop(k), float(self._gaps(T).distance[0])))
        return min(LOOK, float(gap.min(initial=np.inf))), told

    @cached_property
    def motion(self) -> Bounds:
        """Bounds for any point of the upper body in the lower one's frame."""
        lower, upper = self.lower.link, self.upper.link
        bounds = [self.journey.bounds_between(lower, upper, corner) for corner in self.upper.hull.corners]
        return Bounds(*(np.max(column, axis=0) for column in zip(*bounds, strict=True)))

    def _place(self, joints: Array) -> Array:
        return self.journey.between(self.lower.link, self.upper.link, joints)

    def _at(self, hop: Indices, s: Array) -> Array:
        return self._place(self.journey.joints(hop, s))

    def _gaps(self, T: Array) -> Gap:
        return gaps(self.lower.hull, self.upper.hull, T)

    def _ball_gaps(self) -> Array:
        """Lower bounds of the distances at states, from balls round the bodies, (states,)."""
        (still, r), (moving, rr) = self.lower.ball, self.upper.ball
        T = self._place(self.journey.motion.joints)
        away: Array = np.linalg.norm(T[:, :3, :3] @ moving + T[:, :3, 3] - still, axis=1) - r - rr
        return away

    def _least_gaps(self, T: Array) -> Array:
        """Signed distances; of poses that are neither nearest nor overlap, no more than a lower bound."""
        found: Array = plane_gaps(self.lower.hull, self.upper.hull, T).distance
        if not len(T):
            return found
        first = int(found.argmin())
        least = float(self._gaps(T[first : first + 1]).distance[0])
        open_ = found < max(0.0, least)
        found[open_] = self._gaps(T[open_]).distance
        return found

    def _look(self, hop: Indices, parts: Parts) -> Verdicts:
        lower, upper = self.lower.hull, self.upper.hull
        T = np.stack([self._at(hop, s) for s in (parts.low, parts.middle, parts.high)], axis=1)
        corners = upper.placed(T)  # (m, 3 samples, k, 3)
        moved = np.linalg.norm(corners - corners[:, 1:2], axis=-1).max((1, 2))
        bulge = sag(self.motion.acceleration[hop], parts.high - parts.low)
        flat = corners.reshape(len(hop), -1, 3)
        need = bulge - TOUCH
        apart = lower.radius + upper.radius
        found = plane_gaps(lower, upper, T[:, 1])
        proven = beyond(lower, flat, found.normal) - apart >= need
        failed = np.zeros(len(hop), dtype=bool)
        rest = np.flatnonzero(~proven)
        found = self._gaps(T[rest, 1])
        plane = beyond(lower, flat[rest], found.normal) - apart
        proven[rest] = np.maximum(plane, found.distance - moved[rest]) >= need[rest]
        failed[rest] = found.distance < -TOUCH
        return Verdicts(proven, failed, moved + 100 * bulge < SHORTEST)

    def _tell(self, state: int, where: str, gap: float) -> Violation:
        one, other = self.upper.name, self.lower.name
        if gap < 0:
            text = f"{one} overlaps {other} by {-gap:z.4f} m {where}"
        else:
            text = f"{one} is not proven clear of {other} {where}, {gap:.6f} m away"
        return Violation("self", state, self.words.owner(state), max(0.0, -gap), text)
