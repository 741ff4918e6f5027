"""Options at a set-point: clear, on target, in their component; and the evidence where there are none."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import islice

import numpy as np
import pytest
import shapely

from regionik.mfabrik import configurations
from regionik.moving.base_motion import Candidate
from regionik.moving.configuration_sampling import ConfigurationSampler
from regionik.moving.options import MOVING
from regionik.moving.path_following import ResolvedMotion
from regionik.pruning import Pruned, choose_chain, solvers_along, start_place, start_pose, whole_path
from regionik.scene import scene_of
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.scene import World
from tests.maths import wrap
from tests.measures import axis_of


@cache
def prepared(name: str) -> tuple[World, Pruned, tuple[Candidate, ...]]:
    world = load_world(name)
    free_space, _, pruned = whole_path(scene_of(world))
    chain = choose_chain(pruned, free_space, start_place(scene_of(world)))
    solvers = solvers_along(scene_of(world), pruned.ladder, free_space, chain)
    goals = configurations(world.task, solvers, start_pose(scene_of(world), pruned, chain[0]))
    return world, pruned, tuple(Candidate(goal, k) for goal, k in zip(goals, chain, strict=True))


def sampler(name: str) -> ConfigurationSampler:
    world, pruned, _ = prepared(name)
    return ConfigurationSampler(
        scene_of(world), scene_of(world).collision, pruned.ladder, scene_of(world).free_floor.anywhere, 0
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
        assert scene_of(world).collision.clear(at)
        assert np.linalg.norm(tool - world.task[i].position) <= world.rules.tolerance * (1 + 1e-9)
        assert pruned.ladder.component[spot.component].distance(axis) < 1e-9
        assert (at.joints >= robot.chain.lower - 1e-9).all()
        assert (at.joints <= robot.chain.upper + 1e-9).all()


@pytest.mark.parametrize(("name", "i"), [("shelf", 0), ("pipe", 5), ("l_shape", 3)])
def test_a_run_may_begin_at_headings_all_round_far_from_limits_first(name: str, i: int) -> None:
    world, pruned, nominal = prepared(name)
    looking, robot = (
        replace(sampler(name), resolved=ResolvedMotion(scene_of(world), scene_of(world).collision)),
        world.robot,
    )
    found = list(looking.far_from_limits(i, pruned.components_at(i), nominal[i].pose))
    turned = [wrap(float(one.pose.base[2] - nominal[i].pose.base[2])) for one in found]
    count = MOVING.sampling.max_headings
    heading = [int(np.rint(turn / (2 * np.pi / count))) % count for turn in turned]
    room = [float(robot.chain.room_to_limits(one.pose.joints)) for one in found]
    assert len(set(heading)) > count / 2
    for n, one in enumerate(found):
        axis = shapely.Point(axis_of(robot, one.pose.base))
        tool = robot.tool(one.pose.base, one.pose.joints)[:3, 3]
        assert scene_of(world).collision.clear(one.pose)
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
