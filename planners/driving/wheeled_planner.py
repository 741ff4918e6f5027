"""Paths of a base on wheels between two poses: differential drives, and cars with a turning radius."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from regionik.planners.driving.arcs import Segment, WheeledPath, path_of_motions, wrapped
from regionik.planners.driving.footprint_scene import FootprintScene, fits
from regionik.planners.driving.point_planner import NoPathError
from regionik.planners.driving.pose_planner import ITERATIONS, direct, plan_poses, pose_text
from regionik.planners.driving.steering import (
    DUBINS,
    NEGLIGIBLE,
    REEDS_SHEPP,
    SPIN,
    SPIN_AHEAD,
    Steering,
)
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.errors import InputError

TURN_WEIGHT = 0.2  # cost of a turn on the spot against driving [m/rad]


def drive_differential(
    scene: FootprintScene, start: ArrayLike, goal: ArrayLike, *, seed: int, reverse: bool = True
) -> WheeledPath:
    """Drive a base that turns on the spot: turns and straight lines.

    Parameters
    ----------
    scene : FootprintScene
    start, goal : (3,) array_like
        x, y [m], yaw [rad].
    seed : int
        Of the sampling planner, 0 or above. Same input, same path.
    reverse : bool
        Drive backwards where that turns less.

    Returns
    -------
    WheeledPath
        Lines and turns, each proven free.

    Raises
    ------
    NoPathError
        When none was found, or the footprint does not fit at start or goal.
    InputError
        When the seed is negative or a pose is not three numbers.

    Examples
    --------
    >>> from shapely import box
    >>> from regionik.planners.driving.footprint_scene import footprint_scene
    >>> scene = footprint_scene([[-0.1, -0.1], [0.1, -0.1], [0, 0.1]], box(0, 0, 2, 1))
    >>> path = drive_differential(scene, [0.5, 0.5, 0], [1.5, 0.5, 1], seed=0)
    >>> [segment.kind for segment in path.segments], path.length, path.turning
    (['line', 'turn'], 1.0, 1.0)
    """
    return _planned(scene, Steering(SPIN if reverse else SPIN_AHEAD, 0.0, TURN_WEIGHT), start, goal, seed)


def drive_car(
    scene: FootprintScene,
    start: ArrayLike,
    goal: ArrayLike,
    *,
    turning_radius: float,
    seed: int,
    reverse: bool = True,
) -> WheeledPath:
    """Drive a car: lines and arcs of its turning radius.

    Parameters
    ----------
    scene : FootprintScene
        The footprint's origin is the middle of the axle that does not steer.
    start, goal : (3,) array_like
        x, y [m], yaw [rad].
    turning_radius : float
        [m]
    seed : int
        Of the sampling planner, 0 or above. Same input, same path.
    reverse : bool
        Curves of Reeds and Shepp; those of Dubins without it.

    Returns
    -------
    WheeledPath
        Lines and arcs, each proven free; the shortest curve where that is free.

    Raises
    ------
    NoPathError
        When none was found, or the footprint does not fit at start or goal.
    InputError
        When the turning radius is not above 0, the seed is negative or a pose is not three numbers.

    Examples
    --------
    >>> from shapely import box
    >>> from regionik.planners.driving.footprint_scene import footprint_scene
    >>> scene = footprint_scene([[-0.1, -0.1], [0.1, -0.1], [0, 0.1]], box(0, 0, 4, 4))
    >>> path = drive_car(scene, [1, 1, 0], [1, 1.5, 0], turning_radius=0.5, seed=0)
    >>> round(path.length, 3), path.reversals
    (1.318, 2)
    """
    if not 0 < turning_radius < np.inf:
        raise InputError(f"turning_radius: expected a length above 0, got {turning_radius}")
    base = Steering(REEDS_SHEPP if reverse else DUBINS, float(turning_radius), 0.0)
    return _planned(scene, base, start, goal, seed)


def _planned(
    scene: FootprintScene, base: Steering, start: ArrayLike, goal: ArrayLike, seed: int
) -> WheeledPath:
    """The direct motion, or else the path that RRTConnect finds."""
    if seed < 0:
        raise InputError(f"seed: expected a whole number from 0 up, got {seed}")
    a, b = np.array(frozen(start, (3,), "start")), np.array(frozen(goal, (3,), "goal"))
    for what, pose in (("start", a), ("goal", b)):
        if not fits(scene, *pose):
            raise NoPathError(f"{what} {pose_text(pose)}: the footprint does not fit there", a[:2], b[:2])
    if np.hypot(*(b - a)[:2]) <= NEGLIGIBLE and abs(wrapped(b[2] - a[2])) <= NEGLIGIBLE:
        return WheeledPath(a, (), "still")
    if direct(scene, base, a, b) is not None:
        return _steered(scene, base, np.stack([a, b]), "straight")
    poses, _ = plan_poses(scene, base, a, b, seed)
    if poses is None:
        kind = f"a turning radius of {base.radius:g} m" if base.radius else "turns on the spot"
        ends = f"from {pose_text(a)} to {pose_text(b)}"
        reason = f"no way with {kind} {ends} was found in {ITERATIONS} iterations"
        raise NoPathError(reason, a[:2], b[:2])
    return _steered(scene, base, poses, "ompl")


def _steered(scene: FootprintScene, base: Steering, poses: Array, method: str) -> WheeledPath:
    """Path steered from pose to pose; each part begins at its pose, so that rounding does not add up."""
    segments: list[Segment] = []
    for p, q in zip(poses[:-1], poses[1:], strict=True):
        motions = direct(scene, base, p, q)
        segments += path_of_motions(p, [] if motions is None else motions, method).segments
    return WheeledPath(poses[0], tuple(segments), method)
