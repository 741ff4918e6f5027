import numpy as np
import pytest

from regionik.worlds.arms import planar_arm
from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import Chain
from regionik.worlds.errors import InputError


def test_bends_place_the_tool_where_forward_kinematics_does() -> None:
    chain = robot_named("youbot").chain
    arm = planar_arm(chain)
    rng = np.random.default_rng(0)
    for q in rng.uniform(chain.lower, chain.upper, (200, chain.dof)):
        angles = np.cumsum(arm.bends(q))
        r, z = arm.shoulder + arm.lengths @ np.column_stack([np.cos(angles), np.sin(angles)])
        yaw = q[0] + arm.pivot_zero
        tool = chain.forward(q)
        np.testing.assert_allclose(tool[:3, 3], [r * np.cos(yaw), r * np.sin(yaw), z], atol=1e-12)
        np.testing.assert_allclose(arm.hinge_joints(arm.bends(q), q), q[1:4], atol=1e-12)


def test_candle_of_the_paper() -> None:
    tool = robot_named("youbot").chain.forward(np.deg2rad([0, 90, 0, 90, 0]))[:3, 3]
    np.testing.assert_allclose(tool, [0.033, 0, 0.147 + 0.155 + 0.135 + 0.2175], atol=1e-12)


@pytest.mark.parametrize(
    ("rows", "word"),
    [
        ([(0, 0.1, 0, np.pi / 2, -1, 1)], "hinges"),
        ([(0, 0.1, 0, 0, -1, 1), (0, 0, 0.2, 0, -1, 1)], "horizontal"),
        ([(0, 0.1, 0, np.pi / 2, -1, 1), (0, 0.05, 0.2, 0, -1, 1), (0, 0, 0.2, 0, -1, 1)], "three"),
    ],
)
def test_other_arms_are_refused_in_one_line(rows: list[tuple[float, ...]], word: str) -> None:
    with pytest.raises(InputError, match=word) as caught:
        planar_arm(Chain.from_dh(rows))
    assert "\n" not in str(caught.value)


def test_a_chain_needs_joints() -> None:
    with pytest.raises(InputError, match="at least one joint"):
        Chain((), np.eye(4))


def test_a_roll_beside_the_last_link_is_refused() -> None:
    chain = robot_named("youbot").chain
    aside = chain.T_last_tool.copy()
    aside[0, 3] = 0.01
    with pytest.raises(InputError, match="roll about the last link"):
        planar_arm(Chain(chain.joints, aside))
