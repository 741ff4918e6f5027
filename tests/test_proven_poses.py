"""Inner areas of poses that are proven: a posture from every place, and most of what is sampled."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry.base import BaseGeometry

from benchmarks.tables.goals import confirm
from regionik.areas.reach_model import ReachQuery
from regionik.planners.reach.pose_reach import pose_reach
from regionik.planners.reach.proven_poses import proven_pose_area
from regionik.planners.reach.square_proofs import holds_about, square_task
from regionik.planners.solvers.damped_least_squares import DIRECTION, ORIENTATION, Aim, polish_each
from regionik.planners.solvers.mfabrik_serial import in_arm_frame
from regionik.planners.solvers.rigid_bodies import span
from regionik.planners.solvers.serial_chain import serial_arm
from regionik.reach_table import reach_table_of
from regionik.regions import admissible_area
from regionik.scene import scene_of
from regionik.worlds.arms import pivot_index, with_pivot
from regionik.worlds.chain import Chain
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Target, World
from tests import examples
from tests.maths import Array
from tests.random_arms import ARMS as KINDS
from tests.random_arms import random_arm
from tests.test_closed_form import ARMS
from tests.test_pose_reach import HEIGHT, aim_of_posture

CONE = 0.02  # [rad]
MISSED = 1e-5  # metres, and radians beyond the cone
STARTS, STEPS = 4000, 200  # of damped least squares


def is_met(chain: Chain, aim: Aim, place: Array, yaw: float, seed: Array) -> bool:
    """Whether damped least squares, from a posture and from random ones, meets an aim within limits."""
    arm, seen = serial_arm(chain), in_arm_frame(place, yaw, HEIGHT, aim)
    low, high = np.maximum(chain.lower, -np.pi), np.minimum(chain.upper, np.pi)
    starts = np.random.default_rng(0).uniform(low, high, (STARTS, chain.dof))
    for postures in (seed[None].copy(), starts):
        errors, angles = polish_each(arm, seen, postures, span(arm), MISSED, MISSED, STEPS)
        for k in np.flatnonzero((errors <= MISSED) & (angles <= MISSED)):
            error, angle = confirm(chain, seen, postures[k])
            inside = (postures[k] >= chain.lower) & (postures[k] <= chain.upper)
            if error <= 2 * MISSED and angle <= aim.cone + 2 * MISSED and inside.all():
                return True
    return False


def places_in(area: BaseGeometry, count: int, seed: int) -> Array:
    """Places of an area, drawn evenly, and its outermost corner."""
    rng = np.random.default_rng(seed)
    x0, y0, x1, y1 = area.bounds
    found = rng.uniform([x0, y0], [x1, y1], (4000, 2))
    corners = shapely.get_coordinates(area)
    return np.concatenate([found[shapely.contains_xy(area, found)][: count - 1], corners[:1]])


def every_place_is_met(chain: Chain, aim: Aim, area: BaseGeometry, seed: int, count: int = 4) -> None:
    endless = list(chain.joints)
    pivot = pivot_index(chain)
    endless[pivot] = replace(endless[pivot], lower=-np.inf, upper=np.inf)  # the base turns for it
    free, found = Chain(tuple(endless), chain.T_last_tool), pose_reach(chain, HEIGHT, aim).grid
    for place in places_in(area, count, seed):
        near = np.argmin(np.linalg.norm(found.places - place, axis=1))
        assert is_met(free, aim, place, float(found.yaws[near]), found.postures[near]), place


@pytest.mark.parametrize(("name", "kind"), [("ur", DIRECTION), ("panda", ORIENTATION), ("puma", ORIENTATION)])
def test_most_of_a_sampled_area_is_proven_and_met(name: str, kind: int) -> None:
    chain = ARMS[name]
    for seed in range(1):
        aim, _ = aim_of_posture(chain, seed, kind, CONE)
        proven, sampled = proven_pose_area(chain, HEIGHT, aim), pose_reach(chain, HEIGHT, aim).area
        assert proven.area >= 0.75 * sampled.area
        every_place_is_met(chain, aim, proven, seed)


@settings(max_examples=examples(40), deadline=None)
@given(st.sampled_from(KINDS), st.sampled_from([DIRECTION, ORIENTATION]), st.integers(0, 10_000))
def test_proven_places_of_random_arms_are_met(kind: str, goal: int, seed: int) -> None:
    chain = with_pivot(random_arm(kind, np.random.default_rng(seed)))
    aim, _ = aim_of_posture(chain, seed, goal, CONE)
    area = proven_pose_area(chain, HEIGHT, aim)
    if not area.is_empty:
        every_place_is_met(chain, aim, area, seed, 2)


@settings(max_examples=examples(80), deadline=None)
@given(st.sampled_from(sorted(ARMS)), st.sampled_from([DIRECTION, ORIENTATION]), st.integers(0, 10_000))
def test_squares_as_large_as_proven_hold_postures_at_their_corners(name: str, kind: int, seed: int) -> None:
    """Limits are near: joints may turn by little about the posture in the middle."""
    chain = ARMS[name]
    aim, q = aim_of_posture(chain, seed, kind, 0.0)
    near = np.random.default_rng(seed).uniform(0.02, 0.6, chain.dof)
    joints = [replace(j, lower=v - by, upper=v + by) for j, v, by in zip(chain.joints, q, near, strict=True)]
    narrow = Chain(tuple(joints), chain.T_last_tool)
    task = square_task(narrow, HEIGHT, aim)
    low, high = 0.0, 1.0
    for _ in range(20):
        half = 0.5 * (low + high)
        low, high = (half, high) if holds_about(task, kind, q, half) <= near[0] else (low, half)
    for x, y in ((1, 1), (-1, 1), (-1, -1), (1, -1)):
        assert low == 0.0 or is_met(narrow, aim, low * np.array([x, y]), 0.0, q)


def test_in_a_window_is_proven_what_is_without_and_little_around_it() -> None:
    """Thousands of squares were united at every slice of yaw, to be cut to where a base may park."""
    first, *others = ARMS["ur"].joints
    chain = Chain((replace(first, lower=-0.4, upper=0.6), *others), ARMS["ur"].T_last_tool)
    aim, _ = aim_of_posture(chain, 3, ORIENTATION, CONE)
    every = proven_pose_area(chain, HEIGHT, aim, span=(0.0, 0.5))
    x, y = shapely.get_coordinates(every).mean(axis=0)
    window = shapely.box(x - 0.1, y - 0.05, x + 0.1, y + 0.05)
    some = proven_pose_area(chain, HEIGHT, aim, span=(0.0, 0.5), window=window.bounds)
    assert (every & window).area > 0
    assert (some & window).symmetric_difference(every & window).area < 1e-12
    assert 4 * shapely.get_num_coordinates(some) < shapely.get_num_coordinates(every)


@pytest.mark.slow
def test_headings_and_the_pivots_limits_bound_what_is_proven() -> None:
    """At one heading, with a pivot that turns a little, each place has a posture within its limits."""
    first, *others = ARMS["ur"].joints
    chain = Chain((replace(first, lower=-0.4, upper=0.6), *others), ARMS["ur"].T_last_tool)
    aim, _ = aim_of_posture(chain, 3, ORIENTATION, CONE)
    whole = proven_pose_area(chain, HEIGHT, aim)
    one = proven_pose_area(chain, HEIGHT, aim, 0.3)
    some = proven_pose_area(chain, HEIGHT, aim, span=(0.0, 0.5))
    assert 0 < one.area < whole.area
    assert 0 < proven_pose_area(chain, HEIGHT, aim, span=(0.3, 0.3)).area < some.area < whole.area
    found = pose_reach(chain, HEIGHT, aim, 0.3).grid
    for place in places_in(one, 6, 0):
        near = np.argmin(np.linalg.norm(found.places - place, axis=1))
        assert is_met(chain, aim, place, 0.3, found.postures[near])
    for place in places_in(some, 6, 1):
        near = np.argmin(np.linalg.norm(found.places - place, axis=1))
        assert any(is_met(chain, aim, place, yaw, found.postures[near]) for yaw in np.linspace(0, 0.5, 21))


def test_errors_of_the_heading_are_made_up_for_by_the_pivot() -> None:
    first, *others = ARMS["ur"].joints
    chain = Chain((replace(first, lower=-0.4, upper=0.6), *others), ARMS["ur"].T_last_tool)
    aim, _ = aim_of_posture(chain, 3, ORIENTATION, CONE)
    sure = proven_pose_area(chain, HEIGHT, aim, span=(0.3, 0.3), spare=0.1)
    assert sure.area > 0
    for heading in (0.21, 0.3, 0.39):
        assert (sure - proven_pose_area(chain, HEIGHT, aim, span=(heading, heading))).area < 1e-9


@pytest.mark.parametrize("seed", range(2))
def test_the_pivots_limits_hold_all_over_every_square(seed: int) -> None:
    """Of one branch of postures, at one heading: at the very corners of what is proven."""
    aim, q = aim_of_posture(ARMS["ur"], seed, ORIENTATION, CONE)
    near = np.array([0.1, 0.8, 0.8, 0.8, 0.8, 0.8])
    joints = [
        replace(j, lower=v - by, upper=v + by) for j, v, by in zip(ARMS["ur"].joints, q, near, strict=True)
    ]
    chain = Chain(tuple(joints), ARMS["ur"].T_last_tool)
    area = proven_pose_area(chain, HEIGHT, aim, span=(0.0, 0.0))
    assert area.area > 0
    for place in np.unique(shapely.get_coordinates(area), axis=0)[::7]:
        assert is_met(chain, aim, place, 0.0, q)


def test_a_base_that_turns_makes_up_for_a_pivot_that_does_not() -> None:
    first, *others = ARMS["ur"].joints
    chain = Chain((replace(first, lower=0.2, upper=0.2), *others), ARMS["ur"].T_last_tool)
    aim, _ = aim_of_posture(ARMS["ur"], 3, ORIENTATION, CONE)
    same = proven_pose_area(ARMS["ur"], HEIGHT, aim)
    assert proven_pose_area(chain, HEIGHT, aim).symmetric_difference(same).area < 0.01 * same.area


def test_nothing_is_proven_of_arms_with_too_few_joints() -> None:
    *first, last = ARMS["ur"].joints
    chain = Chain(tuple(first), last.T_parent_joint @ ARMS["ur"].T_last_tool)
    aim, _ = aim_of_posture(chain, 0, ORIENTATION, CONE)
    assert proven_pose_area(chain, HEIGHT, aim).is_empty


@pytest.mark.parametrize("name", ["ur", "panda"])
def test_areas_that_are_told_are_proven_and_lie_within_the_outer_one(name: str) -> None:
    chain = ARMS[name]
    tool = aim_of_posture(chain, 1, ORIENTATION, CONE)[0]
    square = np.array([[0.3, 0.3], [-0.3, 0.3], [-0.3, -0.3], [0.3, -0.3]])
    robot = Robot("r", "omni", square, np.array([0.0, 0.0, HEIGHT, 0.0]), chain, (), 0.3)
    target = Target(tool.position, orientation=tool.turn, cone=2 * CONE)
    world = World("w", robot, Floor(shapely.box(-5, -5, 5, 5)), (), (target,), Rules(clearance=0.0))
    area = admissible_area(world, target)
    assert area.inner.area > 0
    assert (area.inner - area.outer).area < 1e-9
    query = ReachQuery(world.rules, world.rules.reach_margin, (-np.inf, np.inf), proven=True)
    proven = shapely.union_all(reach_table_of(scene_of(world), [target], query)[2])
    assert (area.inner - proven).area < 1e-9
