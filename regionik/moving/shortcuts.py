"""Shortcuts of a motion with the tool lifted: straight motions of base and arm in place of longer ones.

As in Geraerts and Overmars, Creating high-quality paths for motion planning, 2007, between places drawn
anywhere on the motion.
"""

from __future__ import annotations

import numpy as np

from regionik.moving.base_motion import Driver, Interpolator
from regionik.postures.poses import Pose, distinct, pose_between

DETOUR = 1.02  # times the straight way, which is short enough
TRIES, PATIENCE = 200, 60  # shortcuts looked at, and how many of them in vain one after the other
SAVED = 1e-4  # by a shortcut at least [m]


def with_shortcuts(interpolator: Interpolator, driver: Driver, piece: int, poses: list[Pose]) -> list[Pose]:
    """Return a motion whose base goes no farther, with the same ends.

    Parameters
    ----------
    interpolator, driver
        Prove the arm clear and the base on the floor.
    piece
        Of the free floor.
    poses
        States of a clear motion, its ends included; a base on wheels keeps it as it is.
    """
    if driver.world.robot.drive.rolls:
        return poses
    rng, failed = np.random.default_rng(driver.seed), 0
    least = DETOUR * travel([poses[0], poses[-1]]) + SAVED
    u, v = 0.0, len(poses) - 1.0  # the whole first
    for _ in range(TRIES):
        if failed == PATIENCE or travel(poses) <= least:
            break
        shorter = _shortcut(interpolator, driver, piece, poses, u, v)
        poses, failed = (poses, failed + 1) if shorter is None else (shorter, 0)
        u, v = np.sort(rng.uniform(0, len(poses) - 1, 2)).tolist()
    return poses


def _shortcut(
    interpolator: Interpolator, driver: Driver, piece: int, poses: list[Pose], u: float, v: float
) -> list[Pose] | None:
    """The motion straight between two places, in states; None where that is not proven, or no shorter."""
    i, j = int(u), int(np.ceil(v))
    here, there = _at(driver, poses, u), _at(driver, poses, v)
    if travel([poses[i], here, there, poses[j]]) > travel(poses[i : j + 1]) - SAVED:
        return None
    states = driver.direct(here, there, piece)
    if states is None:
        return None
    part = distinct([poses[i], here, *states, there, poses[j]])
    if travel(part) > travel(poses[i : j + 1]) - SAVED or not interpolator.clear(part):
        return None
    return [*poses[:i], *part, *poses[j + 1 :]]


def _at(driver: Driver, poses: list[Pose], u: float) -> Pose:
    """Place on a motion, in states."""
    k = int(u)
    if u == k:
        return poses[k]
    return pose_between(poses[k], poses[k + 1], u - k, driver.world.robot.drive)


def travel(poses: list[Pose]) -> float:
    """How far the base goes from state to state [m]."""
    places = np.array([pose.base[:2] for pose in poses])
    return float(np.hypot(*np.diff(places, axis=0).T).sum())
