"""All postures of an arm at a pose, in closed form: forward kinematics gives the pose, none is missing."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from regionik.planners.solvers.closed_form import EXACT_POLISH, decomposition, postures_at
from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import Chain
from tests import examples
from tests.maths import Array

H = np.pi / 2
UR: list[tuple[float, ...]] = [
    (0, 0.1807, 0, H, -6.2, 6.2), (0, 0, -0.6127, 0, -6.2, 6.2), (0, 0, -0.57155, 0, -3.1, 3.1),
    (0, 0.17415, 0, H, -6.2, 6.2), (0, 0.11985, 0, -H, -6.2, 6.2), (0, 0.11655, 0, 0, -6.2, 6.2),
]  # fmt: skip
PUMA: list[tuple[float, ...]] = [
    (0, 0, 0, H, -2.8, 2.8), (0, 0, 0.4318, 0, -3, 3), (0, 0.15, 0.0203, -H, -3, 3),
    (0, 0.4318, 0, H, -3, 3), (0, 0, 0, -H, -2, 2), (0, 0.06, 0, 0, -3, 3),
]  # fmt: skip
PANDA: list[tuple[float, ...]] = [
    (0, 0.333, 0, -H, -2.9, 2.9), (0, 0, 0, H, -1.76, 1.76), (0, 0.316, 0.0825, H, -2.9, 2.9),
    (0, 0, -0.0825, -H, -3.07, -0.07), (0, 0.384, 0, H, -2.9, 2.9), (0, 0, 0.088, H, -0.02, 3.75),
    (0, 0.107, 0, 0, -2.9, 2.9),
]  # fmt: skip
# Three axes that meet at the wrist, behind three of which no two meet or are parallel.
SKEWED: list[tuple[float, ...]] = [
    (0, 0.2, 0.1, 1.0, -3, 3), (0, 0.1, 0.35, 0.8, -3, 3), (0, 0.05, 0.06, -H, -3, 3),
    (0, 0.3, 0, H, -3, 3), (0, 0, 0, -H, -3, 3), (0, 0.1, 0, 0, -3, 3),
]  # fmt: skip
ROWS: dict[str, list[tuple[float, ...]]] = {"ur": UR, "puma": PUMA, "panda": PANDA, "skewed": SKEWED}
ARMS = {name: Chain.from_dh(rows) for name, rows in ROWS.items()}


def posture(chain: Chain, seed: int) -> Array:
    """A random posture, each joint in the middle turn of its limits."""
    low, high = np.maximum(chain.lower, -np.pi), np.minimum(chain.upper, np.pi)
    return np.random.default_rng(seed).uniform(low, high)


def rounded(chain: Chain, digits: int) -> Chain:
    """The chain as a file gives it that rounds its numbers."""
    rng = np.random.default_rng(0)
    joints = []
    for joint in chain.joints:
        T = joint.T_parent_joint.copy()
        T[:3, 3] += rng.uniform(-0.5, 0.5, 3) * 10.0**-digits
        joints.append(type(joint)(joint.name, joint.kind, joint.lower, joint.upper, T, joint.axis))
    return Chain(tuple(joints), chain.T_last_tool)


def off(chain: Chain, found: Array, tools: Array) -> float:
    return float(np.abs(chain.forward(found) - tools).max(initial=0.0))


@pytest.mark.parametrize("name", ["ur", "puma", "skewed"])
@settings(max_examples=examples(60), deadline=None)
@given(seed=st.integers(0, 10**6))
def test_a_posture_is_among_those_of_its_pose(name: str, seed: int) -> None:
    chain = ARMS[name]
    q = posture(chain, seed)
    tool = chain.forward(q)
    found, which = postures_at(chain, tool[None])
    assert (which == 0).all()
    assert off(chain, found, tool) <= 20 * EXACT_POLISH.error
    assert ((found >= chain.lower) & (found <= chain.upper)).all()
    apart = np.abs(np.remainder(found - q + np.pi, 2 * np.pi) - np.pi).max(axis=1)
    assert apart.min() <= 1e-5


@settings(max_examples=examples(40), deadline=None)
@given(seed=st.integers(0, 10**6))
def test_seven_joints_have_postures_all_along_the_sweep(seed: int) -> None:
    chain = ARMS["panda"]
    q = posture(chain, seed)
    tool = chain.forward(q)
    found, _ = postures_at(chain, tool[None])
    assert len(found) > 0
    assert off(chain, found, tool) <= 20 * EXACT_POLISH.error
    assert ((found >= chain.lower) & (found <= chain.upper)).all()


def test_poses_at_once_are_those_one_by_one() -> None:
    chain = ARMS["panda"]
    tools = chain.forward(np.array([posture(chain, seed) for seed in range(5)]))
    found, which = postures_at(chain, tools)
    assert (np.diff(which) >= 0).all()
    for k, tool in enumerate(tools):
        alone, _ = postures_at(chain, tool[None])
        assert found[which == k] == pytest.approx(alone, abs=1e-8)


@pytest.mark.parametrize("name", ["ur", "puma", "panda"])
def test_rounded_axes_are_met_to_the_last_digit(name: str) -> None:
    chain = rounded(ARMS[name], 4)
    tools = chain.forward(np.array([posture(chain, seed) for seed in range(20)]))
    found, which = postures_at(chain, tools)
    assert off(chain, found, tools[which]) <= 20 * EXACT_POLISH.error
    assert np.isin(np.arange(20), which).all()


def test_what_is_out_of_reach_has_no_postures() -> None:
    for chain in ARMS.values():
        tool = np.eye(4)
        tool[:3, 3] = 5.0, 0.0, 0.0
        assert len(postures_at(chain, tool[None])[0]) == 0


def test_arms_without_a_closed_form_are_told() -> None:
    assert decomposition(robot_named("youbot").chain) is None  # five joints
    twisted = [(0, 0.1, 0.1 + 0.02 * k, 0.7 + 0.2 * k, -3, 3) for k in range(6)]
    assert decomposition(Chain.from_dh(twisted)) is None
    assert decomposition(ARMS["ur"]) is not None


@pytest.mark.parametrize("name", ["ur", "puma"])
def test_a_stretched_wrist_is_no_gap(name: str) -> None:
    """Axes 4 and 6 are one line, or nearly: there is a posture all the same."""
    chain = ARMS[name]
    for bend in (0.0, 1e-9, 1e-5):
        q = np.array([0.3, -0.7, 1.1, 0.4, bend, 0.2])
        tool = chain.forward(q)
        found, _ = postures_at(chain, tool[None])
        assert len(found) > 0
        assert off(chain, found, tool) <= 20 * EXACT_POLISH.error
