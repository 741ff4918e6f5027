"""Shortcuts of a motion with the tool lifted, of base and arm together or of the base alone.

The second kind are partial shortcuts (Geraerts and Overmars, Creating high-quality paths for motion planning,
2007): the arm does what it did, while the base goes straight.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from regionik.moving.base_motion import Driver, Interpolator
from regionik.postures.poses import Pose, distinct, turn_to
from regionik.worlds.arrays import Array

DETOUR = 1.05  # times the straight way, which is short enough
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
    least = DETOUR * travel([poses[0], poses[-1]])
    for _ in range(TRIES):
        far = travelled(poses)
        if far[-1] <= least + SAVED or failed == PATIENCE:
            break
        i, j = _drawn_part(far, rng, whole=failed == 0)
        shorter = _shortcut(interpolator, driver, piece, poses[i : j + 1])
        failed = failed + 1 if shorter is None else 0
        poses = poses if shorter is None else [*poses[:i], *shorter, *poses[j + 1 :]]
    return distinct(poses)


def _drawn_part(far: Array, rng: np.random.Generator, whole: bool) -> tuple[int, int]:
    """First and last state of a part: drawn among states, which are dense where the arm moves too."""
    if whole:
        return 0, len(far) - 1
    i, j = sorted(rng.integers(0, len(far), 2).tolist())
    return i, j


def _shortcut(interpolator: Interpolator, driver: Driver, piece: int, poses: list[Pose]) -> list[Pose] | None:
    """States from the first to the last, the base going less far; None where none is proven."""
    here, there = poses[0], poses[-1]
    if travel(poses) < travel([here, there]) + SAVED:
        return None
    direct = driver.direct(here, there, piece)
    if direct is not None:
        straight = [here, *direct, there]
        if travel(straight) < travel(poses) - SAVED and interpolator.clear(straight):
            return straight
    for share in (travelled(poses), np.arange(len(poses))):  # the arm moves where it did, or as the base goes
        moved = _base_straight(poses, share / share[-1])
        on_floor = all(driver.direct(a, b, piece) == [] for a, b in pairwise(moved))
        if on_floor and interpolator.clear(moved):
            return moved
    return None


def _base_straight(poses: list[Pose], share: Array) -> list[Pose]:
    """The same states of the arm, the base at shares (n,) of the straight way."""
    start, end = poses[0].base, poses[-1].base
    bases = start + share[:, None] * turn_to(start, end)
    inner = [replace(pose, base=base) for pose, base in zip(poses[1:-1], bases[1:-1], strict=True)]
    return [poses[0], *inner, poses[-1]]


def travel(poses: list[Pose]) -> float:
    """How far the base goes from state to state [m]."""
    return float(travelled(poses)[-1])


def travelled(poses: list[Pose]) -> Array:
    """How far the base has come at each state, (n,) [m]."""
    places = np.array([pose.base[:2] for pose in poses])
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(places, axis=0).T))])
