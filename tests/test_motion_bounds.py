"""Bounds on motion between states against differences of positions, for chains of both kinds of joints."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from regionik.verification.motion import MotionSegments, chord_deviation
from tests.bodies import motion_through, random_robot
from tests.kinds import BaseKind
from tests.maths import Array

H = 1e-4  # step of the differences [segments]
SEGMENTS = 8


def random_segments(seed: int, dof: int, kind: BaseKind = "omni") -> MotionSegments:
    rng = np.random.default_rng([seed, dof])
    base = rng.uniform(-1, 1, (SEGMENTS + 1, 3)) * [0.3, 0.3, 2.0]
    joints = rng.normal(scale=rng.choice([0.1, 0.5, 1.5], size=dof), size=(SEGMENTS + 1, dof))
    return MotionSegments(replace(random_robot(rng, dof), base=kind), motion_through(base, joints))


def seen(
    segments: MotionSegments, lower: int | None, link: int, point: Array, segment: int, s: Array
) -> Array:
    """Positions of a point fixed to a link, in a lower link's frame or in the world (None)."""
    rows = np.full(len(s), segment)
    frames = segments.frames_at(rows, s)
    T = frames[:, link] if lower is None else segments.link_pose(lower, link, segments.joints_at(rows, s))
    if lower is not None and lower >= 0:
        assert pytest.approx(np.linalg.inv(frames[:, lower]) @ frames[:, link], abs=1e-12) == T
    positions: Array = T[:, :3, :3] @ point + T[:, :3, 3]
    return positions


@pytest.mark.parametrize("kind", ["omni", "differential"])
@pytest.mark.parametrize("dof", [1, 2, 3, 5, 8])
@pytest.mark.parametrize("seed", range(4))
def test_no_point_is_faster_or_sharper_than_its_bounds(seed: int, dof: int, kind: BaseKind) -> None:
    segments = random_segments(seed, dof, kind)
    rng = np.random.default_rng(seed)
    s = np.linspace(H, 1 - H, 25)
    for lower in (None, *range(-1, dof - 1)):
        link = int(rng.integers(-1 if lower is None else lower, dof - 1)) + 1
        point = rng.uniform(-0.4, 0.4, 3)
        bounds = segments.relative_bounds(-1 if lower is None else lower, link, point)
        limit = segments.acceleration_bound(link, point) if lower is None else bounds.acceleration
        for segment in range(SEGMENTS):
            before, now, after = (seen(segments, lower, link, point, segment, s + d) for d in (-H, 0, H))
            bent = np.linalg.norm(before - 2 * now + after, axis=1).max() / H**2
            assert bent <= limit[segment] * (1 + 1e-6) + 1e-6
            if lower is None:
                continue
            fast = np.linalg.norm(after - before, axis=1).max() / (2 * H)
            assert fast <= bounds.speed[segment] * (1 + 1e-6) + 1e-9
            mount = float(np.linalg.norm(segments.robot.mount[:3])) if lower < 0 else 0.0
            assert np.linalg.norm(now, axis=1).max() <= bounds.distance[segment] + mount + 1e-12


def test_bounds_of_many_points_are_those_of_each() -> None:
    segments, points = random_segments(0, 4, "omni"), np.random.default_rng(0).normal(size=(5, 3))
    for lower in (-1, 1):
        each = [segments.relative_bounds(lower, 3, point) for point in points]
        for whole, alone in zip(
            segments.relative_bounds(lower, 3, points), zip(*each, strict=True), strict=True
        ):
            np.testing.assert_allclose(whole, alone, rtol=1e-14)


@pytest.mark.parametrize("kind", ["omni", "differential"])
def test_bounds_are_of_the_size_of_the_motion(kind: BaseKind) -> None:
    """A bound that is never nearly reached would prove nothing worth having."""
    tightest = 0.0
    for seed in range(6):
        segments = random_segments(seed, 3, kind)
        point = np.array([0.1, 0.2, 0.0])
        limit = chord_deviation(segments.acceleration_bound(2, point), np.ones(1))
        s = np.linspace(0, 1, 60)
        for segment in range(SEGMENTS):
            points = seen(segments, None, 2, point, segment, s)
            chord = points[0] + s[:, None] * (points[-1] - points[0])
            off = np.linalg.norm(points - chord, axis=1).max()
            assert off <= limit[segment] + 1e-12
            tightest = max(tightest, float(off / limit[segment]))
    assert tightest > 0.3


def test_two_links_that_no_joint_between_moves_are_still() -> None:
    segments = random_segments(1, 4)
    joints = np.array(segments.motion.joints)
    joints[:, 2:] = joints[0, 2:]
    segments = MotionSegments(segments.robot, motion_through(segments.motion.base, joints))
    bounds = segments.relative_bounds(1, 3, np.ones(3))
    assert not bounds.acceleration.any()
    assert not bounds.speed.any()
    assert segments.relative_bounds(0, 3, np.ones(3)).speed.all()
