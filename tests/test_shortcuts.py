"""Shortcuts of motions with the tool lifted: laws of what comes out, for random motions that wind."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from regionik.moving.shortcuts import GOOD_COST_RATIO, MIN_SAVED_LENGTH, PACES, Clock, Shortcuts, travel
from regionik.moving.transit import TransitPlanner
from regionik.pipeline import search
from regionik.postures.poses import Pose, arrays
from regionik.scene import scene_of
from regionik.verification.verifier import verify
from regionik.worlds.obstacles import Box
from tests import examples
from tests.kinds import BaseKind
from tests.opinion.judge import detours
from tests.soak import told
from tests.soaked import soaked_world
from tests.test_transit import HERE, THERE, carrier, check, posed, rolling, world_of

PILLAR = Box("pillar", np.array([0.2, 0.2, 0.5]), np.array([0.0, 0.0, 0.25]))
LID = Box("lid", np.array([0.6, 0.6, 0.02]), np.array([0.6, 0.0, 0.4]))
FLAT = np.array([0.0, 0.3, 0.0, 1.2, 0.0])  # under the lid


def wound(planner: TransitPlanner, corners: list[Pose]) -> list[Pose]:
    """A clear motion straight from corner to corner, those left out that are not reached so."""
    poses = corners[:1]
    for there in corners[1:]:
        states = planner.driver.direct(poses[-1], there, 0)
        if states is not None and planner.collision.passes([poses[-1], *states, there]):
            poses += [*states, there]
    return poses


@settings(max_examples=examples(60))
@given(st.integers(0, 10**6))
def test_the_base_goes_no_farther_and_all_stays_clear(seed: int) -> None:
    rng = np.random.default_rng(seed)
    world = world_of("youbot", PILLAR)
    planner = carrier(world)
    spans = rng.uniform(-1.0, 1.0, (12, 5)) * [0.9, 0.9, 3.0, 0.5, 0.2]
    first = posed(world, np.array([-0.9, -0.9, 0.0]))
    poses = wound(planner, [first, *(posed(world, row[:3], *row[3:]) for row in spans)])
    short = Shortcuts(planner.collision, planner.driver, 0).shorter(poses)
    check(world, short[0], short[1:-1], short[-1])
    assert short[0] is poses[0]
    assert short[-1] is poses[-1]
    assert travel(short) <= travel(poses) + 1e-12
    again = Shortcuts(planner.collision, planner.driver, 0).shorter(poses)
    assert [pose.base.tolist() for pose in again] == [pose.base.tolist() for pose in short]


@settings(max_examples=examples(60))
@given(st.integers(0, 10**6), st.sampled_from(["omni", "differential", "car"]))
def test_a_quicker_motion_keeps_clear_and_its_base_goes_no_farther(seed: int, base: BaseKind) -> None:
    rng = np.random.default_rng(seed)
    world = world_of("youbot", PILLAR) if base == "omni" else rolling(base)
    planner, clock = carrier(world), Clock(scene_of(world))
    spans = rng.uniform(-1.0, 1.0, (2, 5)) * [0.9, 0.9, 3.0, 0.9, 0.4]
    here, there = (posed(world, row[:3], *row[3:]) for row in spans)
    way = planner.folded(here, there, 0) if all(map(planner.collision.proves, (here, there))) else None
    if way is None:
        return
    poses = [here, *way, there]
    quick = Shortcuts(planner.collision, planner.driver, 0).quicker(poses)
    assert clock.whole(quick) <= clock.whole(poses)
    assert travel(quick) <= travel(poses) + 1e-9
    if base == "omni":
        check(world, here, quick[1:-1], there)
        return
    drive, (old, new) = world.robot.drive, (arrays(motion)[0] for motion in (poses, quick))
    assert np.abs(drive.slip(new)[0]).max() < 1e-9
    assert drive.travel(new) == pytest.approx(drive.travel(old), abs=1e-9)
    trace = shapely.LineString(drive.trace(old))
    assert shapely.distance(trace, shapely.points(new[:, :2])).max() < 1e-3
    assert planner.collision.passes(quick)


@pytest.mark.parametrize("base", ["differential", "car"])
def test_wheels_roll_on_however_the_arm_moves(base: BaseKind) -> None:
    world = rolling(base)
    planner, drive = carrier(world), world.robot.drive
    arc = drive.between(
        np.zeros((11, 3)), np.array([0.8, 0.3, 2 * np.arctan2(0.3, 0.8)]), np.linspace(0, 1, 11)
    )
    bends = np.linspace(-0.9, 0.9, 14)  # a zigzag beside the drive, then the drive
    poses = [posed(world, arc[0], bend, 0.2 * (-1) ** k) for k, bend in enumerate(bends)]
    poses += [Pose(place, poses[-1].joints) for place in arc[1:]]
    assert planner.collision.passes(poses)
    shortcuts, clock = Shortcuts(planner.collision, planner.driver, 0), Clock(scene_of(world))
    quick = shortcuts.quicker(poses)
    assert clock.whole(quick) < 0.8 * clock.whole(poses)
    for other in (quick, *(shortcuts._between(poses, *paces) for paces in PACES)):
        assert not other or np.abs(drive.slip(arrays(other)[0])[0]).max() < 1e-9


def test_base_and_arm_go_at_once() -> None:
    """Where there is room a motion takes little longer than that of the slower part alone."""
    world = world_of("youbot")
    planner, clock = carrier(world), Clock(scene_of(world))
    here, there = posed(world, HERE, 0.9, -0.4), posed(world, THERE, -0.9, 0.4)
    way = planner.folded(here, there, 0)
    assert way is not None
    quick = Shortcuts(planner.collision, planner.driver, 0).quicker([here, *way, there])
    alone = Pose(there.base, here.joints), Pose(here.base, there.joints)  # of the base, of the arm
    assert clock.whole(quick) <= 1.1 * max(clock.whole([here, one]) for one in alone)


def test_over_open_floor_the_base_goes_straight() -> None:
    world = world_of("youbot")
    planner = carrier(world)
    places = [(0.0, 0.0), (0.6, 0.8), (-0.5, 0.9), (0.3, 0.0)]
    poses = wound(planner, [posed(world, np.array([*place, 0.0])) for place in places])
    short = Shortcuts(planner.collision, planner.driver, 0).shorter(poses)
    assert travel(short) <= GOOD_COST_RATIO * 0.3 + MIN_SAVED_LENGTH


def test_a_base_that_drew_back_to_fold_goes_little_farther_than_it_must() -> None:
    world = world_of("youbot", LID)
    here, there = Pose(np.array([0.25, 0.0, 0.0]), FLAT), Pose(np.array([0.25, 0.3, 0.0]), FLAT + 0.1)
    planner = carrier(world)
    way = planner.folded(here, there, 0)
    assert way is not None
    short = planner.shortened(here, way, there, 0)
    check(world, here, short, there)
    assert travel([here, *short, there]) <= 1.1 * travel([here, there])


@pytest.mark.parametrize(
    ("kind", "seed", "most"),
    [("overhead", 404, 1.1), ("made", 132, 1.1), pytest.param("ground", 817, 1.3, marks=pytest.mark.slow)],
)
def test_where_shortcuts_do_not_help_other_ways_are_looked_for(kind: str, seed: int, most: float) -> None:
    """The base drew back as the arm could not fold, went round as its circle, or had to turn its arm by."""
    plan = search(scene_of(soaked_world(kind, seed)))
    assert verify(plan).ok
    assert max(detours(*told(plan)).values()) < most


def test_a_merged_motion_has_few_states() -> None:
    """A motion that is merged with others does not gather the states of all of them."""
    world = world_of("youbot", PILLAR)
    planner = carrier(world)
    round_it = [(-0.6, -0.6, 0.0), (-0.6, 0.6, 0.0), (0.6, 0.6, 0.0), (0.6, 0.6, 0.0)]
    bends = [0.0, 0.0, 0.0, 0.8]
    corners = wound(
        planner, [posed(world, np.array(place), bend) for place, bend in zip(round_it, bends, strict=True)]
    )
    rows, shares = np.hstack(arrays(corners)), np.linspace(0, len(corners) - 1, 40 * len(corners))
    dense = np.column_stack([np.interp(shares, np.arange(len(rows)), column) for column in rows.T])
    quick = Shortcuts(planner.collision, planner.driver, 0).quicker([Pose(row[:3], row[3:]) for row in dense])
    assert len(quick) <= 2 * len(corners)
    check(world, quick[0], quick[1:-1], quick[-1])
