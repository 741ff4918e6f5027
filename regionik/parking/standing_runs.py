"""Configurations of runs from one place: of arms in no plane, where one place serves a whole run.

M-FABRIK goes on from the set-point before and does not look ahead. Where areas of a run with poses of the
tool share a place, the base may stand there, and what is left to choose is the arm's redundancy along all
of the run.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice

import numpy as np
import shapely
from shapely.geometry import Point
from shapely.geometry.base import BaseGeometry

from regionik.areas.ground import united
from regionik.areas.standing import Standing, into_span, spread
from regionik.moving.base_motion import Candidate
from regionik.parking.held_postures import PostureCarrier
from regionik.postures.arm import deviation, goals_between
from regionik.postures.poses import axis_of, pose_of
from regionik.pruning import Pruned
from regionik.scene import Scene
from regionik.values import Configuration
from regionik.worlds.arms import pivot_index, with_pivot
from regionik.worlds.arrays import Array
from regionik.worlds.scene import Target

PLACES = 3  # of the base that are tried besides the middle
QUARTERS = np.array([0.0, 0.5, -0.5, 1.0]) * np.pi  # headings tried, from the one that faces the run [rad]
TRIES, AGAIN = 8, 1  # poses of the base that are tried, and how many of them again
BEAMS = 48, 192  # postures carried on at once, at first and then
STRIDE, TURN = 0.02, 0.05  # longest way of the tool between two targets, and its largest turn [m], [rad]


def standing_runs(scene: Scene, pruned: Pruned, standing: Standing) -> dict[int, Candidate]:
    """Configurations of the runs that are done from one place, by set-point, each in a component around it.

    There are none where the base rolls or has to face its targets.
    """
    found = dict[int, Candidate]()
    bounds = [0, *pruned.breaks, len(scene.task)]
    faces = scene.rules.heading == "face_target"  # the base would have to turn
    if faces or scene.robot.drive.rolls or not scene.rules.avoidance:
        return found
    for first, end in zip(bounds[:-1], bounds[1:], strict=True):
        targets = scene.task[first:end]
        if any(one.direction is None or scene.model(one).exact for one in targets):
            continue
        shared = _shared(pruned, first, end)
        if shared is None:
            continue
        side, area = shared
        bases = islice(_bases(scene, area, standing.sides[side].span, targets), TRIES)
        for i, one in enumerate(_from_one(scene, *_laid_out(targets), list(bases)), first):
            found[i] = Candidate(one, _around(pruned, i, side, Point(axis_of(scene.robot, one.base))))
    return found


def _shared(pruned: Pruned, first: int, end: int) -> tuple[int, BaseGeometry] | None:
    """Side of the floor and the largest part that areas of a run share there; None for nothing."""
    ladder = pruned.ladder
    kept = [pruned.kept(i) for i in range(first, end)]
    best: tuple[int, BaseGeometry] | None = None
    for side in sorted({int(ladder.side[k]) for k in kept[0]}):
        own = [united(ladder.component[[k for k in some if ladder.side[k] == side]]) for some in kept]
        for part in shapely.get_parts(shapely.intersection_all(own)):
            if part.area > (0.0 if best is None else best[1].area):
                best = side, part
    return best


def _around(pruned: Pruned, i: int, side: int, axis: Point) -> int:
    """The component of a set-point around a place, or nearest to it."""
    some = [k for k in pruned.kept(i) if pruned.ladder.side[k] == side]
    return some[int(np.argmin(shapely.distance(pruned.ladder.component[some], axis)))]


def _from_one(
    scene: Scene, targets: list[Target], setpoints: list[int], bases: list[Array]
) -> list[Configuration]:
    """Configurations at the set-points of a run from one of some poses of the base; none where all get stuck.

    Those that get farthest with few postures are tried with more.
    """
    carrier = PostureCarrier(scene.world, scene.guard, targets)
    for most in BEAMS:
        far = []
        for base in bases:
            rows = carrier.resolved(base, most)
            if len(rows) == len(targets):
                return [_configuration(scene, targets[k], base, rows[k]) for k in setpoints]
            far.append(len(rows))
        farthest = np.argsort(far, kind="stable")[::-1][:AGAIN]
        bases = [bases[k] for k in farthest.tolist() if far[k] > 0]
    return []


def _configuration(scene: Scene, target: Target, base: Array, joints: Array) -> Configuration:
    tool = scene.robot.tool(base, joints)
    error = float(np.linalg.norm(tool[:3, 3] - target.position))
    good = error <= scene.rules.tolerance and deviation(target, tool[:3, :3]) <= target.cone
    return Configuration(base, joints, error, 0, good)


def _bases(
    scene: Scene, area: BaseGeometry, span: tuple[float, float], targets: Sequence[Target]
) -> Iterator[Array]:
    """Poses of the base in an area, the arm turned to the targets at first."""
    middle = shapely.maximum_inscribed_circle(area).coords[0]
    center = np.mean([target.position[:2] for target in targets], axis=0)
    robot, arm = scene.robot, with_pivot(scene.robot.chain)
    pivot = arm.active_joints[pivot_index(arm)]
    limited = bool(np.isfinite(pivot.upper - pivot.lower))
    ahead, quarters = ((pivot.lower + pivot.upper) / 2, QUARTERS) if limited else (0.0, QUARTERS[:1])
    for axis in np.vstack([middle, spread(area, PLACES, 0)]):
        facing = np.arctan2(*(center - axis)[::-1]) - robot.mount[3] - ahead
        yaws = [into_span(float(yaw), span) for yaw in facing + quarters]
        for yaw in dict.fromkeys(yaws):
            yield pose_of(robot, axis, yaw)


def _laid_out(targets: Sequence[Target]) -> tuple[list[Target], list[int]]:
    """Targets with others between them, so that neighbours are close, and where in these they are."""
    laid, setpoints = [targets[0]], [0]
    for a, b in zip(targets[:-1], targets[1:], strict=True):
        way, turn = float(np.linalg.norm(b.position - a.position)), _turn(a, b)
        count = max(1, int(np.ceil(max(way / STRIDE, turn / TURN))))
        laid += [*goals_between(a, b, np.arange(1, count) / count), b]
        setpoints.append(len(laid) - 1)
    return laid, setpoints


def _turn(a: Target, b: Target) -> float:
    """Angle that the tool turns by from one target to the next [rad]."""
    if a.orientation is not None and b.orientation is not None:
        return deviation(b, a.orientation)
    ways = [one.direction for one in (a, b) if one.direction is not None]
    return float(np.arccos(np.clip(ways[0] @ ways[-1], -1.0, 1.0)))
