"""Xu's tracker against forward kinematics, the paper's two simulations, and the rolling of its wheels."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.tables.xu import circle
from regionik.papers.pitch_arm import HeightError, PitchArm, heights
from regionik.papers.pose_tracking import TrackedRun, TrackingRobot, track_runs
from regionik.worlds.chain import Chain
from tests.maths import Array, arc_end, planar_pose, rot_y, rot_z, translation

PARM = PitchArm(shoulder_out=0.06875, shoulder_up=0.12, upper=0.16, fore=0.13775 + 0.11321)
AHEAD = LIFT = 0.155
GAUGE = 0.32
LIMIT = np.pi / 2


def parm() -> Chain:
    h, inf = np.pi / 2, np.inf
    rows = [(0, 0.12, 0.06875, -h), (0, 0, 0.16, 0), (-h, 0, 0, -h), (0, 0.13775, 0, h), (0, 0, 0, -h)]
    chain = Chain.from_dh([(*row, -inf, inf) for row in rows])
    return Chain(chain.joints, chain.T_last_tool @ translation(0, 0, 0.11321))


def residuals(found: TrackedRun, poses: list[Array]) -> tuple[float, float]:
    chain = parm()
    mount = planar_pose(AHEAD, 0, 0, LIFT)
    tools = [
        planar_pose(*b) @ mount @ chain.forward(q) for b, q in zip(found.base, found.joints, strict=True)
    ]
    apart = [np.abs(tool - pose) for tool, pose in zip(tools, poses, strict=True)]
    return max(a[:3, 3].max() for a in apart), max(a[:3, :3].max() for a in apart)


def door(height: float) -> list[Array]:
    """Simulation 2: a knob 230 mm from the hinge, through a quarter turn; the tool's z axis up."""
    return [rot_z(np.radians(k)) @ translation(0.23, 0, height) @ rot_z(-np.pi / 2) for k in range(91)]


def robot(limit: float) -> TrackingRobot:
    """The arm on its base, joint 1 alone with limits."""
    upper = np.array([limit, *[np.inf] * 4])
    return TrackingRobot(PARM, AHEAD, LIFT, -upper, upper)


def follow(poses: list[Array], limit: float = LIMIT) -> TrackedRun:
    (found,) = track_runs(robot(limit), poses)
    return found


@pytest.mark.parametrize("limit", [LIMIT, 1e-9], ids=["pivot", "no-pivot"])
@pytest.mark.parametrize("poses", [circle(), door(0.495)], ids=["circle", "door"])
def test_every_pose_is_met(poses: list[Array], limit: float) -> None:
    found = follow(poses, limit)
    place, turn = residuals(found, poses)
    assert place < 1e-12
    assert turn < 1e-12
    assert np.abs(found.joints[:, 0]).max() <= limit
    assert np.abs(np.diff(found.joints, axis=0)).max() < 0.1


def test_the_printed_height_of_the_knob_is_refused_with_the_attainable_ones() -> None:
    with pytest.raises(
        HeightError, match=r"pose 1: height 0.34000 m .* attainable: 0.36596 to 0.68596 m"
    ) as why:
        follow(door(0.34))
    assert why.value.index == 0
    assert heights(PARM, -1.0) == pytest.approx((0.21096, 0.53096))


@given(st.floats(-2, 2), st.floats(-0.3, 0.3), st.floats(-3, 3))
def test_a_step_rolls_without_slip(bend: float, arc: float, yaw: float) -> None:
    """Integrated in small parts, each along the heading it has in its middle."""
    start = np.array([0.3, -0.2, yaw])
    n = 2000
    headings = yaw + bend * (np.arange(n) + 0.5) / n
    way = arc / n * np.array([np.cos(headings).sum(), np.sin(headings).sum()])
    np.testing.assert_allclose(
        [*arc_end(0.3, -0.2, yaw, arc, bend)], [*(start[:2] + way), yaw + bend], atol=1e-6
    )


@given(st.integers(0, 10_000))
def test_tools_that_lean_are_followed_too(seed: int) -> None:
    """Poses made by a rolling base and a moving arm are followed."""
    rng = np.random.default_rng(seed)
    chain, mount, poses = parm(), planar_pose(AHEAD, 0, 0, LIFT), []
    base, q = np.array([0.0, 0.0, rng.uniform(-3, 3)]), np.array([0.0, 0.3, -0.9, rng.uniform(-1, 1), 0.0])
    yaw = float(base[2])
    for _ in range(30):
        turn, length = rng.uniform(-0.03, 0.05), rng.uniform(0.0, 0.05)
        base = np.array(arc_end(base[0], base[1], base[2], length, turn))
        q[:4] += rng.uniform(-0.02, 0.02, 4)
        poses.append(planar_pose(*base) @ mount @ chain.forward(q))
    (found,) = track_runs(robot(LIMIT), poses, heading=yaw)
    assert max(residuals(found, poses)) < 1e-9
    assert np.abs(found.joints[:, 0]).max() <= LIMIT


@pytest.mark.parametrize("lean", [1e-12, 1e-9, 1e-6, 1e-3, 0.1])
def test_tools_that_hardly_lean_are_met_as_exactly(lean: float) -> None:
    poses = [pose @ rot_y(lean) for pose in door(0.495)]
    assert max(residuals(follow(poses), poses)) < 2e-9
