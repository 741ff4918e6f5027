"""Options at a set-point: clear, on target, in their component; and the evidence where there are none."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import islice
from typing import Any

import numpy as np
import pytest
import shapely

from regionik.areas.standing import spread
from regionik.mfabrik import configurations
from regionik.moving.base_motion import Candidate
from regionik.moving.configuration_sampling import HEADINGS, KEPT, PLACES, ConfigurationSampler, Evidence
from regionik.moving.path_following import ResolvedMotion
from regionik.moving.path_search import PathSearch
from regionik.planners.collision.proximity import Touch
from regionik.postures.poses import Pose
from regionik.pruning import Pruned, choose_chain, solvers_along, start_place, start_pose, whole_path
from regionik.scene import scene_of
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.scene import World
from tests.maths import wrap
from tests.measures import axis_of


@cache
def prepared(name: str) -> tuple[World, Pruned, tuple[Candidate, ...]]:
    world = load_world(name)
    standing, _, pruned = whole_path(scene_of(world))
    chain = choose_chain(pruned, standing, start_place(scene_of(world)))
    solvers = solvers_along(scene_of(world), pruned.ladder, standing, chain)
    goals = configurations(world.task, solvers, start_pose(scene_of(world), pruned, chain[0]))
    return world, pruned, tuple(Candidate(goal, k) for goal, k in zip(goals, chain, strict=True))


def sampler(name: str) -> ConfigurationSampler:
    world, pruned, _ = prepared(name)
    return ConfigurationSampler(
        scene_of(world), scene_of(world).guard, pruned.ladder, scene_of(world).free_floor.anywhere, 0
    )


@pytest.mark.parametrize(("name", "i"), [("shelf", 0), ("shelf", 12), ("pipe", 5), ("tao1", 0), ("tao3", 0)])
def test_every_option_is_clear_and_on_target(name: str, i: int) -> None:
    world, pruned, nominal = prepared(name)
    looking, robot = sampler(name), world.robot
    here = nominal[max(i - 1, 0)].pose
    options = list(islice(looking.options(i, [nominal[i].component], here, nominal[i]), 12))
    assert len(options) >= 3
    for spot in options:
        at = spot.pose
        tool = robot.tool(at.base, at.joints)[:3, 3]
        axis = shapely.Point(axis_of(robot, at.base))
        assert scene_of(world).guard.clear(at)
        assert np.linalg.norm(tool - world.task[i].position) <= world.rules.tolerance * (1 + 1e-9)
        assert pruned.ladder.component[spot.component].distance(axis) < 1e-9
        assert (at.joints >= robot.chain.lower - 1e-9).all()
        assert (at.joints <= robot.chain.upper + 1e-9).all()


@pytest.mark.parametrize(("name", "i"), [("shelf", 0), ("pipe", 5), ("l_shape", 3)])
def test_a_run_may_begin_at_headings_all_round_far_from_limits_first(name: str, i: int) -> None:
    world, pruned, nominal = prepared(name)
    looking, robot = (
        replace(sampler(name), resolved=ResolvedMotion(scene_of(world), scene_of(world).guard)),
        world.robot,
    )
    found = list(looking.roomy(i, pruned.kept(i), nominal[i].pose))
    turned = [wrap(float(one.pose.base[2] - nominal[i].pose.base[2])) for one in found]
    heading = [int(np.rint(turn / (2 * np.pi / HEADINGS))) % HEADINGS for turn in turned]
    room = [float(robot.chain.room_to_limits(one.pose.joints)) for one in found]
    assert len(set(heading)) > HEADINGS / 2
    for n, one in enumerate(found):
        axis = shapely.Point(axis_of(robot, one.pose.base))
        tool = robot.tool(one.pose.base, one.pose.joints)[:3, 3]
        assert scene_of(world).guard.clear(one.pose)
        assert np.linalg.norm(tool - world.task[i].position) <= world.rules.tolerance * (1 + 1e-9)
        assert pruned.ladder.component[one.component].distance(axis) < 1e-9
        assert all(room[k] >= room[n] for k in range(n) if heading[k] == heading[n])
    first = [n for n in range(len(found)) if heading[n] not in heading[:n]]
    assert first == list(range(len(first)))  # one of each heading before a second of any
    assert all(room[a] >= room[b] for a, b in zip(first[:-1], first[1:], strict=True))


def test_the_same_options_again() -> None:
    world, _, nominal = prepared("pipe")
    one, other = (
        list(islice(sampler("pipe").options(5, [nominal[5].component], nominal[4].pose, nominal[5]), 8))
        for _ in range(2)
    )
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a.pose.joints, b.pose.joints)
        np.testing.assert_array_equal(a.pose.base, b.pose.base)
    assert len(world.task) == 21


def test_without_avoidance_there_is_only_what_mfabrik_found() -> None:
    world, pruned, nominal = prepared("shelf")
    bare = replace(world, rules=replace(world.rules, avoidance=False))
    looking = ConfigurationSampler(
        scene_of(bare), scene_of(bare).guard, pruned.ladder, scene_of(world).free_floor.anywhere, 0
    )
    assert list(looking.options(3, [nominal[3].component], nominal[2].pose, nominal[3])) == [nominal[3]]
    assert not looking.evidence


def test_a_place_offers_the_postures_that_change_least() -> None:
    _, _, nominal = prepared("shelf")
    looking, here = sampler("shelf"), nominal[4].pose
    options = list(looking.options(5, [nominal[5].component], here, nominal[5]))
    elsewhere = options[-2 * KEPT :]
    axes = [tuple(axis_of(load_world("shelf").robot, spot.pose.base).round(9)) for spot in options]
    assert max(axes.count(axis) for axis in set(axes[2:])) <= KEPT
    assert len(elsewhere) == 2 * KEPT


def test_evidence_counts_what_was_looked_at_and_keeps_the_best() -> None:
    seen, off = Evidence(), np.zeros(3)
    for distance, kind in ((-0.2, "obstacle"), (0.01, "obstacle"), (-0.1, "obstacle")):
        seen.add(off, Touch(distance, 0, kind, 0, off, off), distance)  # type: ignore[arg-type]
    seen.add(off, Touch(np.inf, -1, "none", -1, off, off), np.inf)
    assert (seen.postures, seen.clear) == (4, 1)
    seen = Evidence()
    seen.add(off, Touch(-0.2, 0, "obstacle", 0, off, off), -0.2)
    seen.add(off, Touch(-0.1, 1, "obstacle", 0, off, off), -0.1)
    assert seen.best is not None
    assert seen.best.solid == 1


def test_a_search_is_told_as_evidence() -> None:
    world, pruned, nominal = prepared("shelf")
    shut = replace(world, rules=replace(world.rules, arm_clearance=0.2))
    looking = ConfigurationSampler(
        scene_of(shut), scene_of(shut).guard, pruned.ladder, scene_of(world).free_floor.anywhere, 0
    )
    here = Pose(np.zeros(3), world.robot.carry)
    assert list(looking.options(0, [nominal[0].component], here, nominal[0])) == []
    seen = looking.evidence[0]
    assert len(seen.places) > 1
    assert seen.postures > len(seen.places)
    assert seen.clear == 0
    assert seen.best is not None
    assert seen.best.kind == "obstacle"


def search_without_start(name: str, **rules: Any) -> PathSearch:
    """What is left of a search once it asks why not."""
    world, pruned, _ = prepared(name)
    asked = replace(world, rules=replace(world.rules, **rules))
    looking = ConfigurationSampler(
        scene_of(asked), scene_of(asked).guard, pruned.ladder, scene_of(world).free_floor.anywhere, 0
    )
    nobody: Any = None
    return PathSearch(scene_of(asked), looking, nobody, nobody)


def test_postures_that_are_clear_are_not_said_to_touch_nothing_at_best() -> None:
    search, off = search_without_start("shelf", mode="stops", stop_tolerance=0.01), np.zeros(3)
    seen = search.sampler.evidence[0] = Evidence()
    seen.add(off, Touch(-0.2, 0, "obstacle", 0, off, off), -0.2)
    seen.add(off, Touch(np.inf, -1, "none", -1, off, off), np.inf)
    reason = search.why_not(0, None).reason
    assert "touches nothing in 1 of 2 postures that were looked at" in reason
    assert "all round the circle of 0.01 m to park in" in reason
    assert "nothing is near" not in reason


def test_places_are_counted_wherever_postures_were_looked_at() -> None:
    search = search_without_start("shelf", arm_clearance=0.2)
    _, _, nominal = prepared("shelf")
    assert not search.sampler.clear(0, nominal[0].pose)
    assert "of 1 posture at 1 place that were looked at none is clear" in search.why_not(0, None).reason


def test_without_any_posture_no_number_of_them_is_told() -> None:
    assert (
        "no posture within the joint limits was found"
        in search_without_start("shelf").why_not(0, None).reason
    )


@pytest.mark.parametrize(
    "area",
    [
        pytest.param(shapely.box(-1, -1, 2, 1), id="box"),
        pytest.param(shapely.Point(0, 0).buffer(1) - shapely.Point(0, 0).buffer(0.95), id="ring"),
        pytest.param(shapely.LineString([(0, 0), (1, 1)]).buffer(1e-4), id="sliver"),
        pytest.param(shapely.box(3, 3, 3.001, 3.001), id="speck"),
    ],
)
def test_places_are_spread_inside(area: shapely.Polygon) -> None:
    for count in (1, 7, PLACES):
        points = spread(area, count, 3)
        assert 1 <= len(points) <= count
        assert shapely.covers(area, shapely.points(points)).all()
        np.testing.assert_array_equal(points, spread(area, count, 3))
        assert len(np.unique(points, axis=0)) == len(points)
    quarters = spread(shapely.box(0, 0, 1, 1), 24, 0) > 0.5
    assert len(np.unique(quarters, axis=0)) == 4
