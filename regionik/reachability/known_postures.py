"""Configurations among the postures that a sampled reach began with, where its areas are too thin to show."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from regionik.areas.reachable import PosedReach
from regionik.planners.reach.pose_reach import PlacedPostures, pose_reach
from regionik.postures.arm import aim_of
from regionik.postures.poses import Pose, pose_of
from regionik.reachability.options import REACHABILITY
from regionik.reachability.target_search import TargetSearch
from regionik.worlds.arms import pivot_index
from regionik.worlds.arrays import Array

OPTIONS = REACHABILITY.configurations


def among_known(search: TargetSearch) -> Pose | None:
    """Return a confirmed configuration among the postures that the reach was sampled from, if one is found.

    An arm of few joints meets a pose with a small cone along a curve: areas made of whole cells, and drawn in
    by a margin, may hold nothing there.
    """
    model = search.scene.model(search.target)
    if not isinstance(model, PosedReach) or search.scene.rules.heading == "face_target":
        return None
    return next((pose for pose in _known(search, model) if search.confirms(pose)), None)


def _known(search: TargetSearch, model: PosedReach) -> Iterator[Pose]:
    """Yield configurations on target, each posture at values of its pivot that the base turns for."""
    scene, turned = search.scene, float(search.scene.robot.mount[3])
    is_fixed = scene.rules.heading == "fixed"
    heading = scene.free_floor.headings[0] + turned if is_fixed else None
    found = pose_reach(model.chain, model.height, aim_of(search.target), heading).seeds
    pivot = pivot_index(model.chain)
    for k in _spread(found):
        for value in [found.postures[k, pivot]] if is_fixed else _pivot_values(model, pivot):
            joints = np.array(found.postures[k])
            yaw = found.yaws[k] - turned + joints[pivot] - value
            joints[pivot] = value
            own = joints[len(joints) - scene.robot.chain.dof :]  # without a pivot that stands still
            yield Pose(pose_of(scene.robot, found.places[k], float(yaw)), own)


def _spread(known: PlacedPostures) -> list[int]:
    count = len(known.postures)
    return np.unique(np.linspace(0, count - 1, min(count, OPTIONS.max_reach_postures)).astype(int)).tolist()


def _pivot_values(model: PosedReach, pivot: int) -> Array:
    """Values all over the pivot's range, of one that turns without end over a whole turn [rad]."""
    lower, upper = float(model.chain.lower[pivot]), float(model.chain.upper[pivot])
    if not np.isfinite(upper - lower):
        lower, upper = -np.pi, np.pi
    shares = (np.arange(OPTIONS.pivot_values) + 0.5) / OPTIONS.pivot_values
    return np.unique(lower + shares * (upper - lower))
