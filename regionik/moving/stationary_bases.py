"""Stationary base poses for a whole run, in the intersection of the areas of its set-points."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry import Point
from shapely.geometry.base import BaseGeometry

from regionik.areas.free_space import FreeSpace, into_span, spread
from regionik.areas.ground import united
from regionik.ladder import Ladder, Mask
from regionik.moving.options import MOVING
from regionik.planners.geometry.angles import wrap
from regionik.postures.poses import axis_of, pose_of
from regionik.scene import Scene
from regionik.worlds.arms import pivot_index, with_pivot
from regionik.worlds.arrays import Array
from regionik.worlds.scene import Target

OPTIONS = MOVING.runs
# headings tried, from the one that faces the run [rad]
HEADINGS_TRIED = np.array([0.0, 0.5, -0.5, 1.0]) * np.pi
SAME_HEADING = 1e-6  # headings nearer to one another than this are one [rad]


class StationaryBase(NamedTuple):
    """A base pose (3,) on one side of the free space."""

    pose: Array
    side: int


def stationary_bases(
    scene: Scene, ladder: Ladder, keep: Mask, free_space: FreeSpace, first: int, end: int
) -> Iterator[StationaryBase]:
    """Yield base poses for a run of set-points with tool poses, the likeliest first.

    There are none for arms whose place determines the posture, nor for bases that roll or face targets.
    """
    targets = scene.task[first:end]
    moves = scene.rules.heading == "face_target" or scene.robot.drive.rolls
    if moves or any(one.direction is None or scene.model(one).exact for one in targets):
        return
    shared = _shared(ladder, keep, first, end)
    if shared is not None:
        side, area = shared
        found = _bases(scene, area, free_space.sides[side].span, targets)
        for pose in islice(found, OPTIONS.max_stationary_bases):
            yield StationaryBase(pose, side)


def component_around(scene: Scene, ladder: Ladder, keep: Mask, i: int, base: StationaryBase) -> int:
    """Return the component of set-point i around a base, or nearest to it."""
    axis = Point(axis_of(scene.robot, base.pose))
    some = [k for k in ladder.components_at(keep, i) if ladder.side[k] == base.side]
    return some[int(np.argmin(shapely.distance(ladder.component[some], axis)))]


def _shared(ladder: Ladder, keep: Mask, first: int, end: int) -> tuple[int, BaseGeometry] | None:
    """Return the side and the largest common part of a run's areas; None if they have none in common."""
    kept = [ladder.components_at(keep, i) for i in range(first, end)]
    best: tuple[int, BaseGeometry] | None = None
    for side in sorted({int(ladder.side[k]) for k in kept[0]}):
        own = [united(ladder.component[[k for k in some if ladder.side[k] == side]]) for some in kept]
        for part in shapely.get_parts(shapely.intersection_all(own)):
            if part.area > (0.0 if best is None else best[1].area):
                best = side, part
    return best


def _bases(
    scene: Scene, area: BaseGeometry, span: tuple[float, float], targets: Sequence[Target]
) -> Iterator[Array]:
    """Yield base poses in an area, those with the arm facing the targets first."""
    middle = shapely.maximum_inscribed_circle(area).coords[0]
    center = np.mean([target.position[:2] for target in targets], axis=0)
    robot, arm = scene.robot, with_pivot(scene.robot.chain)
    pivot = arm.active_joints[pivot_index(arm)]
    limited = bool(np.isfinite(pivot.upper - pivot.lower))
    ahead, quarters = (
        ((pivot.lower + pivot.upper) / 2, HEADINGS_TRIED) if limited else (0.0, HEADINGS_TRIED[:1])
    )
    for axis in np.vstack([middle, spread(area, OPTIONS.max_stationary_places, 0)]):
        facing = np.arctan2(*(center - axis)[::-1]) - robot.mount[3] - ahead
        yaws = list[float]()
        for wished in facing + quarters:
            yaw = into_span(float(wished), span)
            if all(abs(wrap(yaw - other)) > SAME_HEADING for other in yaws):
                yaws.append(yaw)
                yield pose_of(robot, axis, yaw)
