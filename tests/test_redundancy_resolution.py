"""Joints along poses of the tool: on every pose, in short steps, clear, past where one posture gets stuck."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from regionik.planners.reach.serial_criteria import led_along, serial_thresholds
from regionik.planners.solvers.closed_form import postures_at
from regionik.planners.solvers.damped_least_squares import ORIENTATION, POSITION, Aim, Aims
from regionik.planners.solvers.redundancy_resolution import (
    PathSolving,
    resolve_redundancy,
    self_motion_along,
)
from regionik.planners.solvers.serial_chain import chain_frames, chain_jacobian, serial_arm
from regionik.worlds.chain import Chain
from tests import examples
from tests.maths import Array
from tests.random_arms import ARMS as KINDS
from tests.random_arms import random_arm
from tests.test_closed_form import ARMS

REACH, TOLERANCE, ANGLE = 0.9, 1e-5, 1e-5
LONGEST = 0.12


def line(chain: Chain, count: int, way: Array, joints: Array) -> Aims:
    """Poses along a straight way (3,), turned as in a posture."""
    T = chain.forward(joints)
    positions = T[:3, 3] + np.linspace(0, 1, count)[:, None] * way
    return Aims(
        positions,
        np.full(count, ORIENTATION),
        np.repeat(T[None, :3, :3], count, axis=0),
        np.zeros(count),
        np.full(count, ANGLE),
    )


def starts_of(chain: Chain, aims: Aims) -> Array:
    tool = np.eye(4)
    tool[:3, :3], tool[:3, 3] = aims.turns[0], aims.positions[0]
    return postures_at(chain, tool[None])[0]


def checked(chain: Chain, aims: Aims, joints: Array) -> None:
    """Every row meets its aim within limits, and no joint changes too much."""
    tools = chain.forward(joints)
    assert np.linalg.norm(tools[:, :3, 3] - aims.positions[: len(joints)], axis=1).max() <= TOLERANCE * 1.001
    off = np.einsum("kij,kij->k", tools[:, :3, :3], aims.turns[: len(joints)])
    assert np.arccos(np.clip((off - 1) / 2, -1, 1)).max() <= 1e-4
    assert (joints >= chain.lower - 1e-12).all()
    assert (joints <= chain.upper + 1e-12).all()
    assert np.abs(np.diff(joints, axis=0)).max(initial=0.0) <= LONGEST


POSTURE = np.array([0.1, 0.3, 0.2, -1.8, 0.1, 2.0, 0.4])


@pytest.mark.parametrize("most", [8, 64])
def test_joints_are_on_every_pose_in_short_steps(most: int) -> None:
    chain = ARMS["panda"]
    aims = line(chain, 20, np.array([0.1, 0.15, -0.1]), POSTURE)
    solving = PathSolving(REACH, TOLERANCE, np.full(7, LONGEST), most)
    found = resolve_redundancy(
        serial_arm(chain), aims, starts_of(chain, aims), solving, lambda here, there: True
    )
    assert len(found) == 20
    checked(chain, aims, found)


def test_the_elbow_turns_along_the_way_where_that_is_asked() -> None:
    """Each posture carried on as it is ends where it is not clear any more; self-motion gets past."""
    chain = ARMS["panda"]
    aims = line(chain, 30, np.array([0.0, 0.12, 0.0]), POSTURE)

    def clear(_: Array, joints: Array) -> bool:
        share = (chain.forward(joints)[1, 3] - aims.positions[0, 1]) / 0.12
        return bool(joints[2] > 0.3) if share < 0.27 else share < 0.74 or bool(joints[2] < -0.3)

    arm, starts = serial_arm(chain), starts_of(chain, aims)
    for start in starts:
        rows = np.zeros((30, 7))
        rows[0] = start
        count = led_along(arm, serial_thresholds(None, rows.shape[1]), aims, REACH, TOLERANCE, 60, rows)
        short = (np.abs(np.diff(rows[:count], axis=0)) <= LONGEST).all()
        assert count < 30 or not short or not all(clear(row, row) for row in rows)
    solving = PathSolving(REACH, TOLERANCE, np.full(7, LONGEST), 400)
    found = resolve_redundancy(arm, aims, starts, solving, clear)
    assert len(found) == 30
    assert all(clear(row, row) for row in found)
    checked(chain, aims, found)


def test_what_gets_no_further_ends_there() -> None:
    chain = ARMS["ur"]
    joints = np.array([0.2, -1.2, 1.4, -0.7, 1.2, 0.3])
    aims = line(chain, 40, np.array([2.0, 0.0, 0.0]), joints)
    solving = PathSolving(1.3, TOLERANCE, np.full(6, LONGEST), 64)
    found = resolve_redundancy(
        serial_arm(chain), aims, starts_of(chain, aims), solving, lambda here, there: True
    )
    assert 1 < len(found) < 40
    checked(chain, aims, found)


@settings(max_examples=examples(40))
@given(seed=st.integers(0, 10**6), kind=st.sampled_from([POSITION, ORIENTATION]))
def test_self_motion_leaves_the_tool_in_place(seed: int, kind: int) -> None:
    rng = np.random.default_rng(seed)
    chain = random_arm(KINDS[seed % len(KINDS)], rng) if seed % 3 else ARMS["panda"]
    arm = serial_arm(chain)
    low, high = np.maximum(chain.lower, -2.0), np.minimum(chain.upper, 2.0)
    joints = np.asarray(rng.uniform(low + 0.1 * (high - low), high - 0.1 * (high - low)))
    frames, J, drift = np.empty((chain.dof + 1, 4, 4)), np.empty((6, chain.dof)), np.empty(chain.dof)
    chain_frames(arm, joints, frames)
    chain_jacobian(arm, frames, J)
    aim = Aim(frames[-1, :3, 3].copy(), kind, frames[-1, :3, :3].copy(), 0.0)
    if self_motion_along(arm, aim, REACH, rng.normal(size=chain.dof), joints, drift):
        rows = 3 if kind == POSITION else 6
        least = np.linalg.svd(J[:rows], compute_uv=False).min()
        left = np.linalg.norm((J @ drift)[:rows])
        assert least < 1e-2 or left <= 0.05 * np.linalg.norm(drift)


def test_too_many_postures_become_few_on_whatever_side_of_zero_their_joints_are() -> None:
    chain = ARMS["panda"]
    aims = line(chain, 1, np.zeros(3), POSTURE)
    around = np.random.default_rng(1).normal(scale=0.3, size=(200, 7))
    solving = PathSolving(REACH, TOLERANCE, np.full(7, LONGEST), 1)
    found = resolve_redundancy(serial_arm(chain), aims, around, solving, lambda here, there: True)
    assert found.shape == (1, 7)
