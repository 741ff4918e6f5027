"""Proof that no link runs into another one, nor into the robot's own base.

Each pair is examined in the frame of its lower body, which is fixed there: only the joints between the two
count, wherever the base drives. In the middle of an interval a plane is laid between the two; while the
upper body's corners, and their deviation from their chords, stay beyond it, the two are apart. The gap of two
convex bodies along a unit direction is a lower bound of their distance, and the largest gap is the distance
itself (separating axis theorem): whatever direction the walk of GJK comes to, what is told is proven.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from regionik.planners.collision.gjk import hull_distance
from regionik.planners.progress import track
from regionik.values import Violation
from regionik.verification.motion import Indices, MotionSegments, PointBounds, chord_deviation
from regionik.verification.options import VERIFICATION
from regionik.verification.proofs import Finding, Intervals, IntervalVerdicts, StateNames, bisect, finding
from regionik.verification.tolerances import TOUCH
from regionik.worlds.arrays import Array
from regionik.worlds.obstacles import Prism
from regionik.worlds.robot import Robot
from regionik.worlds.self_collision import base_body, self_collision_pairs

OPTIONS = VERIFICATION.proofs


def verify_self_collision(segments: MotionSegments, names: StateNames) -> Finding:
    """No two links that could meet overlap, nor a link and the base's own body."""
    found = [
        _PairProof(segments, names, *pair).check()
        for pair in track("pairs of links", [*_pairs(segments.robot)])
    ]
    margin = min([margin for margin, _ in found], default=np.inf)
    return finding("self", margin, [violation for _, violations in found for violation in violations])


@dataclass(frozen=True, eq=False)
class RoundedHull:
    """All points within ``radius`` of the convex hull of ``corners``."""

    corners: Array  # (k, 3) [m]
    radius: float  # [m]

    def corners_in(self, T: Array) -> Array:
        """Corners (..., k, 3) in frames in which the body has the poses T (..., 4, 4)."""
        return self.corners @ T[..., :3, :3].swapaxes(-1, -2) + T[..., None, :3, 3]


class SignedDistances(NamedTuple):
    """Distances less both radii, and the unit directions, from fixed to moving, that prove them."""

    distance: Array  # (m,) [m], minus the penetration depth
    normal: Array  # (m, 3)


def prism_hull(prism: Prism) -> RoundedHull:
    """Upright prism over the convex hull of its polygon."""
    outline = np.asarray(prism.polygon.convex_hull.exterior.coords)[:-1]
    ends = [np.column_stack([outline, np.full(len(outline), z)]) for z in prism.z_range]
    return RoundedHull(np.vstack(ends), 0.0)


def gap_along(fixed: RoundedHull, corners: Array, normal: Array) -> Array:
    """Gap from the corners of a fixed hull to corners (m, k, 3) along normals (m, 3), (m,) [m]."""
    return np.einsum("mkj,mj->mk", corners, normal).min(-1) - (normal @ fixed.corners.T).max(-1)


def signed_distances(fixed: RoundedHull, moving: RoundedHull, T: Array) -> SignedDistances:
    """Signed distances of a fixed hull from a moving one, at its poses T (m, 4, 4) in the other's frame."""
    corners, own = moving.corners_in(T), np.ascontiguousarray(fixed.corners)
    normal = np.array([_normal(own, placed) for placed in corners]).reshape(-1, 3)
    return SignedDistances(gap_along(fixed, corners, normal) - fixed.radius - moving.radius, normal)


def _normal(fixed: Array, moving: Array) -> Array:
    """Direction from one hull to another along which their gap is largest; zeros where flat ones meet."""
    normal: Array = moving.mean(0) - fixed.mean(0)
    if hull_distance(moving, fixed, 0.0, normal, np.empty(3))[0] > 0:
        return normal
    try:
        faces = ConvexHull((moving[:, None] - fixed).reshape(-1, 3)).equations
    except QhullError:
        return np.zeros(3)
    return -faces[np.argmax(faces[:, 3]), :3]


@dataclass(frozen=True, eq=False)
class _Body:
    """A solid of the robot, in the frame of its link; the base is link -1."""

    name: str
    link: int
    hull: RoundedHull

    @cached_property
    def sphere(self) -> tuple[Array, float]:
        """Centre and radius of a bounding sphere."""
        centre: Array = self.hull.corners.mean(0)
        return centre, float(np.linalg.norm(self.hull.corners - centre, axis=1).max()) + self.hull.radius


def _pairs(robot: Robot) -> Iterator[tuple[_Body, _Body]]:
    """The pairs that could meet, the body nearer to the base first."""
    bodies = [_Body(one.name, one.link, RoundedHull(one.corners, one.radius)) for one in robot.all_solids]
    if (own := base_body(robot)) is not None:  # last, as pairs have it
        bodies.append(_Body("the robot's own base", -1, prism_hull(own)))
    for pair in self_collision_pairs(robot):
        lower, upper = sorted((bodies[k] for k in pair), key=lambda body: body.link)
        yield lower, upper


@dataclass(frozen=True, eq=False)
class _PairProof:
    segments: MotionSegments
    names: StateNames
    lower: _Body
    upper: _Body

    def check(self) -> tuple[float, list[Violation]]:
        """Least distance up to a few centimetres, and the violations."""
        near = self._sphere_distances()
        state = np.flatnonzero(near < OPTIONS.margin_range)
        distance = self._signed_distances(self._poses(self.segments.motion.joints[state])).distance
        hits = {k: d for k, d in zip(state.tolist(), distance.tolist(), strict=True) if d < -TOUCH}
        near[state] = distance
        segment = np.flatnonzero(np.minimum(near[:-1], near[1:]) < self._bounds.speed / 2)
        segment = segment[[not {k, k + 1} & hits.keys() for k in segment.tolist()]]
        unproven = bisect(len(segment), lambda intervals: self._examine(segment[intervals.item], intervals))
        violations = [self._violation(k, self.names.state(k), d) for k, d in hits.items()]
        for item, s in unproven.items():
            k, T = int(segment[item]), self._poses_at(segment[item : item + 1], np.array([s]))
            found = float(self._signed_distances(T).distance[0])
            violations.append(self._violation(k, self.names.segment(k), found))
        return min(OPTIONS.margin_range, float(distance.min(initial=np.inf))), violations

    @cached_property
    def _bounds(self) -> PointBounds:
        """Bounds for any point of the upper body in the lower one's frame: the largest of its corners'."""
        corners = self.upper.hull.corners
        count = min(len(corners), 1 + len(corners) * len(self.segments) // OPTIONS.corners_at_once)
        bounds = [
            self.segments.relative_bounds(self.lower.link, self.upper.link, some)
            for some in np.array_split(corners, count)
        ]
        most = ([part.max(axis=0) for part in column] for column in zip(*bounds, strict=True))
        return PointBounds(*(np.max(column, axis=0) for column in most))

    def _poses(self, joints: Array) -> Array:
        return self.segments.link_pose(self.lower.link, self.upper.link, joints)

    def _poses_at(self, segment: Indices, s: Array) -> Array:
        return self._poses(self.segments.joints_at(segment, s))

    def _signed_distances(self, T: Array) -> SignedDistances:
        return signed_distances(self.lower.hull, self.upper.hull, T)

    def _sphere_distances(self) -> Array:
        """Lower bounds of the distances at states, from bounding spheres, (states,) [m]."""
        (fixed, r_fixed), (moving, r_moving) = self.lower.sphere, self.upper.sphere
        T = self._poses(self.segments.motion.joints)
        centre = T[:, :3, :3] @ moving + T[:, :3, 3]
        return np.linalg.norm(centre - fixed, axis=1) - r_fixed - r_moving

    def _examine(self, segment: Indices, intervals: Intervals) -> IntervalVerdicts:
        shares = (intervals.low, intervals.middle, intervals.high)
        T = np.stack([self._poses_at(segment, s) for s in shares], axis=1)
        corners = self.upper.hull.corners_in(T)  # (m, 3 samples, k, 3)
        moved = np.linalg.norm(corners - corners[:, 1:2], axis=-1).max((1, 2))
        bulge = chord_deviation(self._bounds.acceleration[segment], intervals.length)
        found = self._signed_distances(T[:, 1])
        swept = gap_along(self.lower.hull, corners.reshape(len(segment), -1, 3), found.normal)
        gap = swept - self.lower.hull.radius - self.upper.hull.radius
        proven = np.maximum(gap, found.distance - moved) >= bulge - TOUCH
        return IntervalVerdicts(proven, found.distance < -TOUCH, moved + 100 * bulge < OPTIONS.min_motion)

    def _violation(self, state: int, where: str, distance: float) -> Violation:
        one, other = self.upper.name, self.lower.name
        if distance < 0:
            text = f"{one} overlaps {other} by {-distance:z.4f} m {where}"
        else:
            text = f"{one} is not proven clear of {other} {where}, {distance:.6f} m away"
        return Violation("self", state, self.names.owner(state), max(0.0, -distance), text)
