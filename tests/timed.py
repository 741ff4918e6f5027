"""Timed motions looked at each millisecond, against the limits they were timed by."""

from __future__ import annotations

import numpy as np

import regionik as rik
from regionik.timing.trajectory import TrajectorySample, trajectory
from regionik.worlds.chain import Chain

SLACK = 1 + 1e-6


def each_millisecond(found: rik.Plan) -> TrajectorySample:
    motion = trajectory(found)
    return motion.sample(np.append(np.arange(0.0, motion.duration, 1e-3), motion.duration))


def check_limits(look: TrajectorySample, speeds: rik.Speeds, chain: Chain) -> None:
    """Assert that no speed or acceleration of joints, base or heading is exceeded."""
    velocity, acceleration = speeds.joint_limits(chain)
    assert (np.abs(look.joint_velocity) <= velocity * SLACK).all()
    assert (np.abs(look.joint_acceleration) <= acceleration * SLACK).all()
    assert np.hypot(*look.base_velocity[:, :2].T).max() <= speeds.base_velocity * SLACK
    assert np.hypot(*look.base_acceleration[:, :2].T).max() <= speeds.base_acceleration * SLACK
    assert np.abs(look.base_velocity[:, 2]).max() <= speeds.turn_velocity * SLACK
    assert np.abs(look.base_acceleration[:, 2]).max() <= speeds.turn_acceleration * SLACK
