"""Probability that a stop is still good for its set-points once the base has parked with an error.

The yaw is cut into slices. In each, places of the base are taken from which every set-point is reached and
the footprint has room at all headings of the slice; given the yaw, x and y are normal, and the probability of
those places is known in closed form. So the sum over slices is a lower bound, which thinner slices raise.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import shapely
from scipy.special import ndtr, ndtri, owens_t
from shapely.affinity import translate
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from regionik.areas.layers import ROUNDING_MARGIN
from regionik.areas.reach_model import ReachQuery
from regionik.explain.constraints import setpoint_at
from regionik.parking.options import PARKING
from regionik.planners.driving.heading_slabs import convex_scene, free_at_all, outline_scene
from regionik.planners.geometry.offsets import shrunk
from regionik.postures.poses import axis_of
from regionik.reach_table import reach_table_of
from regionik.scene import Scene
from regionik.worlds.arrays import Array
from regionik.worlds.errors import Cause, Explanation
from regionik.worlds.limits import ParkingAccuracy

OPTIONS = PARKING.probability

MIN_VARIANCE = 1e-14  # added in both directions, so that none is zero [m2]
EDGE_TOLERANCE = 1e-200  # distance of an edge from the mean that counts as none, in standard deviations


def parking_probability(scene: Scene, base: Array, setpoints: tuple[int, ...]) -> float:
    """Return a proven lower bound of the probability that a stop is good after parking.

    Good is a pose from which the arm reaches all the set-points within its limits, and at which the footprint
    keeps its clearance and the floor. The arm's clearance is not looked at. The base is to park at a pose
    (3,), in a world with ``rules.parking``.
    """
    error = _PoseError.of(scene)
    count = max(OPTIONS.min_slices, int(np.ceil(OPTIONS.max_deviations * error.yaw / OPTIONS.max_half_slice)))
    found = _summed(scene, base, setpoints, count, proven=True)
    while error.yaw > 0 and count < OPTIONS.max_slices:
        count *= 2
        better = max(found, _summed(scene, base, setpoints, count, proven=True))
        gain, found = better - found, better
        if gain < OPTIONS.min_gain:
            break
    return max(found - 1e-9, 0.0)


def likely_parking_probability(scene: Scene, base: Array, setpoints: tuple[int, ...]) -> float:
    """Return `parking_probability` as the middles of few slices have it: an estimate, not a bound."""
    return _summed(scene, base, setpoints, OPTIONS.estimate_slices, proven=False)


def is_probable(scene: Scene, base: Array, setpoints: tuple[int, ...]) -> bool:
    """True where a stop is proven to be as probably good after parking as the rules ask."""
    asked = scene.rules.parking
    if asked is None or asked.probability is None:
        return True
    if likely_parking_probability(scene, base, setpoints) < asked.probability - OPTIONS.estimate_slack:
        return False
    return parking_probability(scene, base, setpoints) >= asked.probability


def not_probable(scene: Scene, i: int, base: Array) -> Explanation:
    """Explain that set-point i has no place that is probable enough, by the best pose that was found."""
    asked = scene.rules.parking
    least = asked.probability if asked and asked.probability else 0.0
    known = parking_probability(scene, base, (i,))
    reason = (
        f"{setpoint_at(scene.task, i)}: a place to park is asked for that is good with a probability of "
        f"{least:g}; the best that was found is proven to be with {known:.4f}. "
        "A smaller covariance or probability of rules.parking would do."
    )
    return Explanation("undecided", i, reason, (Cause("floor", "room to park", None),))


class _PoseError(NamedTuple):
    """Normal error of a pose: of the yaw, and of x and y at a given yaw."""

    yaw: float  # standard deviation [rad]
    slope: Array  # (2,) shift of the mean of x and y by the yaw [m/rad]
    covariance: Array  # (2, 2) of x and y at a given yaw [m2]

    @classmethod
    def of(cls, scene: Scene) -> _PoseError:
        C = np.array((scene.rules.parking or ParkingAccuracy(np.zeros((3, 3)))).covariance)
        variance = float(C[2, 2])
        slope = C[:2, 2] / variance if variance > 0 else np.zeros(2)
        return cls(float(np.sqrt(variance)), slope, C[:2, :2] - variance * np.outer(slope, slope))

    def slices(self, count: int) -> tuple[Array, Array]:
        """Ends (n + 1,) of slices of yaw about its mean [rad], and their probabilities (n,).

        Bounds lose by a slice as its width times its probability: in sum least where widths go by the root of
        the density, which is that of a normal distribution wider by the root of two.
        """
        if self.yaw == 0:
            return np.zeros(2), np.ones(1)
        far = float(ndtr(OPTIONS.max_deviations / np.sqrt(2)))
        ends = np.sqrt(2) * ndtri(np.linspace(1 - far, far, count + 1))
        return self.yaw * ends, np.diff(ndtr(ends))


def _summed(scene: Scene, base: Array, setpoints: tuple[int, ...], count: int, *, proven: bool) -> float:
    """Sum over slices of yaw, of places that are good in all of each, or else in its middle."""
    error = _PoseError.of(scene)
    ends, weights = error.slices(count)
    far = OPTIONS.max_deviations * np.sqrt(np.maximum(np.diag(error.covariance), 0.0)) + ROUNDING_MARGIN
    total = 0.0
    for low, high, weight in zip(ends[:-1], ends[1:], weights, strict=True):
        middle, half = float(low + high) / 2, float(high - low) / 2 if proven else 0.0
        mean = base[:2] + error.slope * middle
        drift = half * float(np.hypot(*error.slope))  # of the mean, in the slice
        window = shapely.box(*(mean - far - drift), *(mean + far + drift))
        places = _good_places(scene, setpoints, float(base[2]) + middle, half, window)
        places = shrunk(places, drift, outside=False) if drift else places
        total += float(weight) * normal_probability(places, mean, error.covariance)
    return total


def _good_places(
    scene: Scene, setpoints: tuple[int, ...], yaw: float, half: float, window: Polygon
) -> BaseGeometry:
    """Places of the base in a window that are good at all headings within ``half`` of a yaw."""
    free = _reaching(scene, setpoints, yaw, half, window)
    if free.is_empty:
        return free
    outline, (x0, y0, x1, y1) = scene.robot.footprint, free.bounds
    far = float(np.hypot(*outline.T).max()) + ROUNDING_MARGIN
    near = scene.ground.cut_to(shapely.box(x0 - far, y0 - far, x1 + far, y1 + far))
    if near.floor.is_empty:
        return near.floor
    keep, ends = near.clearance + ROUNDING_MARGIN, (yaw - half, yaw + half)
    good = free_at_all(convex_scene(outline, near.floor, near.shadows, keep, window=free), *ends)
    for upper in near.upper(scene.robot.mount[:2]):
        good &= free_at_all(outline_scene(upper, near.floor), *ends)
    return good


def _reaching(
    scene: Scene, setpoints: tuple[int, ...], yaw: float, half: float, window: Polygon
) -> BaseGeometry:
    """Places of the base in a window from which all set-points are in reach, as `_good_places` has them."""
    errors, axis = scene.rules.errors, axis_of(scene.robot, np.array([0.0, 0.0, yaw]))
    # A fixed heading would have the reach of some arms sampled; that of the query is as fixed, and proven.
    turning = replace(errors, heading_error=errors.heading_error + half)
    rules = replace(scene.rules, heading="free", execution=turning)
    off = scene.world.axis_error + half * float(np.hypot(*axis))
    axes = translate(window, *axis).buffer(off, join_style="mitre")
    query = ReachQuery(
        rules, ROUNDING_MARGIN, (yaw, yaw), arcs=OPTIONS.circle_vertices, proven=True, window=axes.bounds
    )
    targets = [scene.task[i] for i in setpoints]
    which, _, shapes = reach_table_of(scene, targets, query)
    shapes = shapely.intersection(shapes, axes)
    areas = [shapely.union_all(shapes[which == n]) for n in range(len(targets))]
    common = shapely.intersection_all(areas)
    return translate(shrunk(common, off, outside=False) if off else common, *-axis)


def normal_probability(shape: BaseGeometry, mean: Array, covariance: Array) -> float:
    """Return the probability that a normal point lies in a shape, holes and parts and all.

    With variances of one, that of the triangle of an edge with the mean is the angle that it fills, less two
    values of Owen's T (Owen 1956, Tables for computing bivariate normal probabilities). The covariance (2, 2)
    is positive semidefinite [m2].

    Examples
    --------
    >>> half = shapely.box(0, -99, 99, 99)
    >>> round(normal_probability(half, np.zeros(2), np.eye(2)), 12)
    0.5
    """
    parts = shapely.get_parts(shape)
    rings = shapely.get_rings(shapely.orient_polygons(parts[shapely.get_dimensions(parts) == 2]))
    if not len(rings):
        return 0.0
    corners, ring = shapely.get_coordinates(rings, return_index=True)
    variances, axes = np.linalg.eigh(covariance)
    whitened = (corners - mean) @ axes / np.sqrt(np.maximum(variances, 0.0) + MIN_VARIANCE)
    same = ring[1:] == ring[:-1]
    a, b = whitened[:-1][same], whitened[1:][same]
    length = np.hypot(*(b - a).T)
    a, b, length = (rows[length > 0] for rows in (a, b, length))
    along, across = (b - a) / length[:, None], (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / length
    away = np.maximum(np.abs(across), EDGE_TOLERANCE)
    first, last = ((one * along).sum(axis=1) for one in (a, b))
    whole = _sector(away, last) - _sector(away, first)
    signed = float((np.sign(across) * whole).sum())
    return min(abs(signed), 1.0)  # the axes may mirror the shape


def _sector(away: Array, along: Array) -> Array:
    """Probability of the right triangle of the mean and a stretch of a line, by its distance and length."""
    found: Array = np.arctan2(along, away) / (2 * np.pi) - owens_t(away, along / away)
    return found
