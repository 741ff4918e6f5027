"""Reach at a height: what is said to be in reach has a posture, what is said to be out of it has none."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from benchmarks.pivoted import KINDS, case
from regionik.planners.reach.level_reach import (
    inner_reach,
    likely_reach,
    merged,
    outer_layer,
    outer_reach,
    posture_at,
)
from regionik.planners.reach.meridian import (
    Meridian,
    hop_stray,
    meridian_of,
    to_level,
    tool_for,
    tool_motion,
    walk,
)
from regionik.planners.reach.outer_bounds import (
    bound,
    bounds_for,
    contract_to,
    spanned,
)
from regionik.planners.reach.rings import reach_intervals
from regionik.worlds.arms import pivot_index, planar_arm, reach_bound
from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import Chain, within_half_turns
from regionik.worlds.joints import Joint
from tests import examples
from tests.bodies import on_lift
from tests.maths import Array, rot_x, translation

SEEDS = st.integers(0, 10_000)
SERIAL = [k for k, kind in enumerate(KINDS) if kind in ("general", "lifted", "planar, lifted")]


def chain_of(seed: int) -> Chain:
    """Of a random arm that is not read as planar, or on a lift."""
    return case(len(KINDS) * seed + SERIAL[seed % len(SERIAL)]).world.robot.chain


def meridian(chain: Chain) -> Meridian:
    found = meridian_of(chain)
    assert found is not None
    return found


def posture(found: Meridian, rng: np.random.Generator) -> Array:
    return rng.uniform(*within_half_turns(found.lower, found.upper))


def tool_at(chain: Chain, rng: np.random.Generator) -> tuple[float, float]:
    """Distance and height of the tool in a random posture, by plain kinematics."""
    low = np.where(np.isfinite(chain.lower), chain.lower, -np.pi)
    high = np.where(np.isfinite(chain.upper), chain.upper, np.pi)
    x, y, z = chain.forward(rng.uniform(low, high))[:3, 3]
    return float(np.hypot(x, y)), float(z)


@settings(max_examples=examples(60))
@given(SEEDS)
def test_no_posture_is_outside_the_outer_reach(seed: int) -> None:
    chain = chain_of(seed)
    r, rise = tool_at(chain, np.random.default_rng(seed))
    assert any(low - 1e-9 <= r <= high + 1e-9 for low, high in outer_reach(chain, rise))


@settings(max_examples=examples(60))
@given(SEEDS, st.floats(0, 1), st.floats(-3, 3))
@example(2040, 0.0, 0.0)  # all axes upright: the arm has one height, and walks along it do not start
@example(2040, 0.5, 1.0)
def test_every_distance_of_the_inner_reach_has_a_posture(seed: int, share: float, azimuth: float) -> None:
    chain = chain_of(seed)
    _, rise = tool_at(chain, np.random.default_rng(seed))
    pivot = pivot_index(chain)
    start = np.clip(np.zeros(chain.dof), chain.lower, chain.upper)
    outer = outer_reach(chain, rise)
    for low, high in inner_reach(chain, rise):
        assert any(a <= low <= high <= b for a, b in outer)
        r = low + share * (high - low)
        point = np.array([r * np.cos(azimuth), r * np.sin(azimuth), rise])
        joints = posture_at(chain, point, start)
        np.testing.assert_allclose(chain.forward(joints)[:3, 3], point, atol=1e-7)
        others = np.arange(chain.dof) != pivot
        assert (joints >= chain.lower - 1e-12)[others].all()
        assert (joints <= chain.upper + 1e-12)[others].all()


@pytest.mark.parametrize("rise", [-0.2, 0.0, 0.147, 0.3, 0.5, 0.65])
def test_reach_is_that_of_the_exact_rings(rise: float) -> None:
    chain = robot_named("youbot").chain
    arm = planar_arm(chain)
    both = reach_intervals(arm, float(arm.shoulder[1]), np.array([rise]))[0]
    exact = merged([sorted(abs(end) for end in row) for row in both.tolist()])
    inner, outer = inner_reach(chain, rise), outer_reach(chain, rise)
    assert len(inner) == len(exact)
    for (a, b), (low, high) in zip(inner, exact, strict=True):
        assert low - 1e-9 <= a <= low + 2e-3
        assert high - 1e-4 <= b <= high + 1e-9
        assert any(c <= low <= high <= d and c >= a - 1e-3 and d <= b + 1e-3 for c, d in outer)


@pytest.mark.parametrize("rise", [0.0, 0.3, 0.75])
def test_a_lift_adds_the_reach_at_other_heights(rise: float) -> None:
    robot = robot_named("youbot-real")
    lifted = inner_reach(on_lift(robot, 0.3).chain, rise)
    bound = outer_reach(on_lift(robot, 0.3).chain, rise)
    for low in np.linspace(rise - 0.3, rise, 7):
        for a, b in inner_reach(robot.chain, float(low)):
            assert any(c <= a + 1e-3 and b - 1e-3 <= d for c, d in lifted)
            assert any(c <= a and b <= d for c, d in bound)


def test_bounds_meet_where_the_arm_is_simple() -> None:
    for name in ("hinge5", "dof10", "pioneer7"):
        chain = robot_named(name).chain
        span = reach_bound(chain)
        for share in (-0.6, 0.1, 0.8):
            rise = span.height + share * span.length
            ((low, high),) = inner_reach(chain, rise)
            assert low < 1e-3
            assert high == pytest.approx(span.length * np.sqrt(1 - share**2), abs=1e-4)
            assert outer_reach(chain, rise)[-1][1] <= high + 1e-3


@settings(max_examples=examples(80))
@given(SEEDS, st.floats(1e-3, 1.5))
@example(5108, 0.125)  # past the axis the tool was farther away than told
def test_a_box_bounds_all_of_its_postures(seed: int, width: float) -> None:
    rng = np.random.default_rng(seed)
    one = meridian(chain_of(seed))
    low, high = within_half_turns(one.lower, one.upper)
    centre, half = posture(one, rng), width * rng.uniform(0, 1, len(low))
    low, high = np.maximum(low, centre - half), np.minimum(high, centre + half)
    box, tool = bounds_for(one), tool_for(one)
    bound(one, low, high, box)
    for _ in range(20):
        joints = rng.uniform(low, high)
        tool_motion(one, joints, tool)
        r, z = tool.at
        layer = float(rng.uniform(0.0, 0.05))
        about = z + rng.uniform(-layer, layer)
        near, far, _, _ = spanned(box, about, layer)
        assert near <= r <= far
        away = np.linalg.norm(tool.frames[-1, :3, 3] - box.hub, axis=1)
        assert (box.keeps[:, 0] - 1e-9 <= away).all()
        assert (away <= box.keeps[:, 1] + 1e-9).all()
        assert contract_to(box, about, layer, max(0.0, r - 1e-4), r + 1e-4)
        assert (box.q + box.shift[0] - 1e-9 <= joints).all()
        assert (joints <= box.q + box.shift[1] + 1e-9).all()


@settings(max_examples=examples(40))
@given(SEEDS)
def test_speeds_and_bends_are_those_of_small_moves(seed: int) -> None:
    rng = np.random.default_rng(seed)
    one = meridian(chain_of(seed))
    joints, tool, step = posture(one, rng), tool_for(one), 1e-5
    ways = []
    for k in range(len(joints)):
        ends = []
        for side in (-1, 1):
            moved = joints.copy()
            moved[k] += side * step
            tool_motion(one, moved, tool)
            ends.append((*tool.at, *tool.J[:3].T.copy()))
        ways.append(ends)
    tool_motion(one, joints, tool)
    for k, (a, b) in enumerate(ways):
        if tool.at[0] > 0.05:
            assert (b[0] - a[0]) / (2 * step) == pytest.approx(tool.out[k], abs=1e-6)
        assert (b[1] - a[1]) / (2 * step) == pytest.approx(tool.up[k], abs=1e-6)
        for j in range(len(joints)):
            bent = float(np.linalg.norm(np.array(b[2 + j]) - np.array(a[2 + j]))) / (2 * step)
            assert bent <= one.bend[j, k] + 1e-6


@settings(max_examples=examples(40))
@given(SEEDS)
def test_a_hop_that_holds_can_be_put_right_all_along(seed: int) -> None:
    rng = np.random.default_rng(seed)
    one = meridian(chain_of(seed))
    tool = tool_for(one)
    here = posture(one, rng)
    tool_motion(one, here, tool)
    z = float(tool.at[1])
    there = np.clip(here + rng.uniform(-0.2, 0.2, len(here)), *within_half_turns(one.lower, one.upper))
    if not to_level(one, z, there, tool) or hop_stray(one, here, there, tool) < 0:
        return
    for share in np.linspace(0, 1, 11):
        middle = here + share * (there - here)
        assert to_level(one, z, middle, tool)
        assert (one.lower <= middle).all()
        assert (middle <= one.upper).all()


@settings(max_examples=examples(20))
@given(SEEDS)
def test_a_walk_turns_the_tool_no_farther_than_it_says(seed: int) -> None:
    rng = np.random.default_rng(seed)
    one = meridian(chain_of(seed))
    tool, m = tool_for(one), len(one.levers)
    start = posture(one, rng)
    tool_motion(one, start, tool)
    z, away = float(tool.at[1]), tool.away.copy()
    if tool.at[0] < 1e-6:
        return
    turns, last = np.empty(3), np.empty(m)
    walk(one, z, 1.0, start.copy(), tool, 40, np.inf, last, turns)
    for steps in (1, 2, 5, 20):
        there = start.copy()
        walk(one, z, 1.0, there, tool, steps, np.inf, last, np.empty(3))
        tool_motion(one, there, tool)
        turn = np.arctan2(away[0] * tool.away[1] - away[1] * tool.away[0], away @ tool.away)
        if tool.at[0] <= turns[0]:
            assert turns[1] - 1e-9 <= turn <= turns[2] + 1e-9


@settings(max_examples=examples(6))
@given(SEEDS)
def test_a_layer_holds_the_reach_of_each_of_its_heights(seed: int) -> None:
    rng = np.random.default_rng(seed)
    chain = chain_of(seed)
    for joints in [posture(meridian(chain), rng) for _ in range(3)]:
        one = meridian(chain)
        tool = tool_for(one)
        tool_motion(one, joints, tool)
        r, z = tool.at
        assert any(low - 1e-9 <= r <= high + 1e-9 for low, high in outer_layer(chain, float(z)))
        for low, high in likely_reach(chain, float(z)):
            assert any(a - 1e-9 <= low and high <= b + 1e-9 for a, b in outer_layer(chain, float(z)))


def test_no_hop_leads_across_a_limit_or_a_summit() -> None:
    """Elbow up and elbow down at the arm's top are apart, however near they look."""
    chain = Chain(
        (
            Joint("pivot", "revolute", -3, 3, np.eye(4)),
            Joint("hinge", "revolute", 0.5, 2.5, rot_x(np.pi / 2)),
        ),
        translation(1.0, 0, 0),
    )
    one = meridian(chain)
    z = float(np.sin(np.pi / 2 - 0.05))
    a, b = np.array([np.pi / 2 - 0.05]), np.array([np.pi / 2 + 0.05])
    assert hop_stray(one, a, b, tool_for(one)) < 0
    assert inner_reach(chain, z) == ()  # two distances, and nothing between them
    assert [round(high, 3) for _, high in outer_reach(chain, z)] == [0.05]


def test_what_cannot_rise_reaches_at_its_own_height_alone() -> None:
    pivot = Joint("pivot", "revolute", -3, 3, np.eye(4))
    assert inner_reach(Chain((pivot,), translation(0.4, 0, 0.2)), 0.2) == ()
    assert outer_reach(Chain((pivot,), translation(0.4, 0, 0.2)), 0.2)
    elbow = Joint("elbow", "revolute", -2, 2, translation(0.4, 0, 0))
    level = Chain((pivot, elbow), translation(0.3, 0, 0))
    bent = float(np.sqrt(0.4**2 + 0.3**2 + 2 * 0.4 * 0.3 * np.cos(2)))
    assert np.allclose(inner_reach(level, 0.0), [[bent, 0.7]], atol=1e-6)
    assert inner_reach(level, 0.01) == ()
    assert inner_reach(Chain((pivot, elbow), translation(0.3, 0, 0)), 0.1) == ()
