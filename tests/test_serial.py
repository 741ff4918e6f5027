"""The compiled kinematics against the numpy reference and finite differences."""

import numpy as np
import pytest

from regionik.planners.solvers.serial_chain import chain_frames, chain_jacobian, serial_arm
from regionik.worlds.chain import Chain
from regionik.worlds.joints import Joint
from tests.maths import rot_x, rot_y, translation


def lifted_arm() -> Chain:
    """A torso lift, a pivot, and joints about odd axes."""
    frames = [
        translation(0.1, 0, 0.2),
        rot_x(0.3),
        translation(0, 0.2, 0.1) @ rot_y(-0.7),
        translation(0.3, 0, 0),
    ]
    axes = [[0, 0, 1.0], [0, 0, 1.0], [1.0, 2.0, -1.0], [0, 1.0, 0]]
    joints = [
        Joint(f"j{k}", "prismatic" if k == 0 else "revolute", -1.0, 1.0, T, np.array(axis))
        for k, (T, axis) in enumerate(zip(frames, axes, strict=True))
    ]
    return Chain(tuple(joints), translation(0.1, 0.2, 0.3))


def dh_arm() -> Chain:
    rows = [(0.3, 0.1, 0.2, 1.1, -3, 3), (-0.2, 0.0, 0.3, -0.4, -3, 3), (0.0, 0.2, 0.0, 1.57, -3, 3)]
    return Chain.from_dh(rows)


@pytest.mark.parametrize("chain", [lifted_arm(), dh_arm()], ids=["lift", "dh"])
def test_frames_are_those_of_the_reference(chain: Chain) -> None:
    rng = np.random.default_rng(0)
    arm, frames = serial_arm(chain), np.empty((chain.dof + 1, 4, 4))
    for q in rng.uniform(-1, 1, (50, chain.dof)):
        chain_frames(arm, q, frames)
        np.testing.assert_allclose(frames, chain.frames(q), atol=1e-14)


@pytest.mark.parametrize("chain", [lifted_arm(), dh_arm()], ids=["lift", "dh"])
def test_links_move_as_their_joints_do(chain: Chain) -> None:
    q = np.random.default_rng(2).uniform(-1, 1, (20, chain.dof))
    T = np.eye(4)
    for k, joint in enumerate(chain.joints):
        T = T @ joint.T_parent_joint @ joint.transform(q[:, k])
        np.testing.assert_allclose(chain.frames(q)[:, k], T, atol=1e-14)


@pytest.mark.parametrize("chain", [lifted_arm(), dh_arm()], ids=["lift", "dh"])
def test_jacobian_is_the_derivative(chain: Chain) -> None:
    rng = np.random.default_rng(1)
    arm, frames, J = serial_arm(chain), np.empty((chain.dof + 1, 4, 4)), np.empty((6, chain.dof))
    h = 1e-6
    for q in rng.uniform(-1, 1, (20, chain.dof)):
        chain_frames(arm, q, frames)
        chain_jacobian(arm, frames, J)
        here = chain.forward(q)
        for k in range(chain.dof):
            step = np.zeros(chain.dof)
            step[k] = h
            there = chain.forward(q + step)
            np.testing.assert_allclose((there - here)[:3, 3] / h, J[:3, k], atol=1e-5)
            spin = (there[:3, :3] @ here[:3, :3].T - np.eye(3)) / h
            np.testing.assert_allclose([spin[2, 1], spin[0, 2], spin[1, 0]], J[3:, k], atol=1e-5)
