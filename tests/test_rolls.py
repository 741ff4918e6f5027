"""The roll about a planar arm's last link: against the chain's own kinematics, and against brute force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from regionik.postures.families import out_of_roll, roll_for, roll_within_limits, swings, tool_turn
from regionik.worlds.arms import PlanarArm, planar_arm
from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import Chain
from tests.maths import Array, wrap

CHAIN = robot_named("youbot").chain
ARM = planar_arm(CHAIN)


def turned_over() -> PlanarArm:
    """The tool looks back along the roll joint, which so turns it the other way."""
    joints = (*CHAIN.joints[:4], replace(CHAIN.joints[4], axis=-CHAIN.joints[4].axis))
    return planar_arm(Chain(joints, CHAIN.T_last_tool))


def limited(rng: np.random.Generator) -> PlanarArm:
    if rng.random() < 0.3:
        return ARM
    lower, upper = np.sort(rng.uniform(-3, 3, 2)).tolist()
    return replace(ARM, roll_lower=lower, roll_upper=upper)


def lead(turn: Array, rng: np.random.Generator) -> tuple[float, float]:
    """Yaw and pitch at which a planar arm has the axis of an orientation, its plane along it or against."""
    x, y, z = turn[:, 2].tolist()
    yaw, pitch = float(np.arctan2(y, x)), float(np.arctan2(z, np.hypot(x, y)))
    return (yaw, pitch) if rng.random() < 0.5 else (yaw + np.pi, np.pi - pitch)


def test_the_turn_of_the_tool_is_that_of_the_chain() -> None:
    rng = np.random.default_rng(0)
    other = turned_over()
    assert other.roll_sign == -ARM.roll_sign
    for q in rng.uniform(CHAIN.lower, CHAIN.upper, (100, 5)):
        yaw, pitch, turn = ARM.pivot_zero + q[0], float(ARM.bends(q).sum()), CHAIN.forward(q)[:3, :3]
        np.testing.assert_allclose(tool_turn(ARM, yaw, pitch, q[4]), turn, atol=1e-9)
        np.testing.assert_allclose(tool_turn(other, yaw, pitch, -q[4]), turn, atol=1e-9)
        assert wrap(roll_for(ARM, yaw, pitch, turn) - q[4]) == pytest.approx(0.0, abs=1e-9)
        assert wrap(roll_for(other, yaw, pitch, turn) + q[4]) == pytest.approx(0.0, abs=1e-9)


def test_no_roll_brings_the_tool_nearer() -> None:
    rng = np.random.default_rng(1)
    for turn in Rotation.from_quat(rng.normal(size=(40, 4))).as_matrix():
        yaw, pitch = rng.uniform(-3, 3, 2).tolist()
        rolls = np.append(np.linspace(-np.pi, np.pi, 73), roll_for(ARM, yaw, pitch, turn))
        off = [Rotation.from_matrix(tool_turn(ARM, yaw, pitch, q).T @ turn).magnitude() for q in rolls]
        assert min(off) == pytest.approx(off[-1], abs=1e-7)


@pytest.mark.parametrize("slack", [0.0, 0.2])
def test_swings_are_those_that_the_roll_keeps_up_with(slack: float) -> None:
    rng = np.random.default_rng(2)
    for turn in Rotation.from_quat(rng.normal(size=(150, 4))).as_matrix():
        arm, (yaw, pitch), half = limited(rng), lead(turn, rng), float(rng.uniform(0.1, np.pi))
        spans = [span[1:] for span in swings(arm, yaw, pitch, half, turn, slack)]
        for swing in rng.uniform(-half, half, 30):
            wanted = roll_for(arm, yaw + swing, pitch, turn)
            keeps = abs(wrap(roll_within_limits(arm, wanted, 0.0) - wanted)) <= slack
            edge = min((abs(abs(swing - middle) - wide) for middle, wide in spans), default=np.inf)
            assert keeps == any(abs(swing - middle) <= wide for middle, wide in spans) or edge < 1e-6


def test_swings_at_a_range_of_pitches_are_those_kept_up_with_at_every_one() -> None:
    rng, kept = np.random.default_rng(4), 0
    for turn in Rotation.from_quat(rng.normal(size=(300, 4))).as_matrix():
        arm, (yaw, pitch), half = limited(rng), lead(turn, rng), float(rng.uniform(0.1, np.pi))
        middle = 0.0 if np.cos(pitch) > 0 else np.pi
        low, high = np.sort(middle + rng.uniform(-np.pi / 2, np.pi / 2, 2)).tolist()
        for _, at, wide in swings(arm, yaw, pitch, half, turn, 0.05, (low, high)):
            kept += 1
            for swing, other in rng.uniform((at - wide, low), (at + wide, high), (20, 2)):
                wanted = roll_for(arm, yaw + swing, other, turn)
                assert abs(wrap(roll_within_limits(arm, wanted, 0.0) - wanted)) <= 0.05 + 1e-7
    assert kept > 30


def test_what_is_out_of_the_roll_is_met_by_no_posture() -> None:
    rng, out = np.random.default_rng(3), 0
    for turn in Rotation.from_quat(rng.normal(size=(150, 4))).as_matrix():
        arm, (yaw, pitch) = limited(rng), lead(turn, rng)
        half, cone = float(rng.uniform(0.05, 0.6)), float(rng.uniform(0.05, 0.4))
        if not out_of_roll(arm, yaw, pitch, half, turn, cone):
            continue
        out += 1
        for _ in range(40):
            roll = rng.uniform(arm.roll_lower, arm.roll_upper)
            swing, tilt = rng.uniform(-half, half), rng.uniform(-cone, cone)
            if abs(np.arcsin(np.sin(pitch)) + tilt) > np.pi / 2:
                continue
            have = tool_turn(arm, yaw + swing, pitch + (tilt if np.cos(pitch) > 0 else -tilt), roll)
            assert Rotation.from_matrix(have.T @ turn).magnitude() > cone
    assert out > 10


def test_an_arm_without_a_roll_has_one_turn() -> None:
    *hinged, roll = CHAIN.joints
    chain = Chain(tuple(hinged), roll.T_parent_joint @ CHAIN.T_last_tool)
    arm = planar_arm(chain)
    assert arm.roll is None
    turn = tool_turn(arm, 0.3, 0.4, 1.0)
    np.testing.assert_allclose(turn, tool_turn(arm, 0.3, 0.4, 0.0))
    assert roll_within_limits(arm, roll_for(arm, 0.3, 0.4, turn), 0.0) == 0.0
    assert swings(arm, 0.3, 0.4, 0.5, turn) == ()
    assert len(swings(arm, 0.3, 0.4, 0.5, turn, 0.1)) == 1
