"""What each solid of a robot is near to, against distances of one state and solid at a time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from regionik.moving.state_constraints import StateConstraints
from regionik.planners.collision.proximity import NearPairs, near_pairs
from regionik.planners.collision.robot_motion import WORLD
from regionik.scene import scene_of
from regionik.worlds.documents.world_file import load_world
from tests.bodies import Guarded
from tests.maths import Array
from tests.test_proximity import AHEAD, CLUTTER, ROBOTS, distance_of, prepared, push, states

WITHIN = 0.1


def pairs_of(among: Guarded, base: Array, joints: Array) -> NearPairs:
    collision = among.scene.collision
    return near_pairs(collision.bodies, np.array(base), np.array(joints), collision.contact, WITHIN)


@pytest.mark.parametrize("name", ROBOTS)
def test_the_nearest_of_all_pairs_is_what_is_nearest(name: str) -> None:
    among = prepared(name)
    base, joints = states(among.robot, 150, 31)
    near, seen = pairs_of(among, base, joints), 0
    assert (near.room < WITHIN).all()
    for k, (b, q) in enumerate(zip(base, joints, strict=True)):
        proximity, room = among.nearest(b, q, WITHIN), near.room[near.state == k]
        assert len(room) > 0 or proximity.kind == "none"
        if proximity.kind != "none":
            seen += 1
            if proximity.distance > 0:
                assert room.min() == pytest.approx(proximity.distance, abs=1e-6)
            else:  # of several that a solid overlaps the one it is deepest in is not sought
                assert room.min() <= 1e-9
    assert seen > 50


@pytest.mark.parametrize("name", ROBOTS)
def test_each_solid_is_told_of_the_nearest_obstacle_and_the_nearest_part_of_the_robot(name: str) -> None:
    """Points lie on one solid of the link, and the nearest obstacle is so far from there."""
    among = prepared(name)
    base, joints = states(among.robot, 60, 32)
    near, robot = pairs_of(among, base, joints), among.robot
    frames = robot.frames(base, joints)[near.state]
    assert {WORLD} < set(near.other.tolist())
    for k in np.flatnonzero(near.room > 1e-6).tolist():
        on_link = [n for n, solid in enumerate(robot.solids) if solid.link == near.link[k]]
        gaps = [abs(distance_of(robot, frames[k], n, near.point[k])) for n in on_link]
        assert min(gaps) == pytest.approx(0.0, abs=1e-6)
        assert np.linalg.norm(near.normal[k]) == pytest.approx(1.0)
        there = near.point[k] - near.room[k] * near.normal[k]
        if near.other[k] == WORLD:
            assert min(solid.distance(near.point[k]) for solid in CLUTTER) == pytest.approx(
                near.room[k], abs=1e-6
            )
            assert min(solid.distance(there) for solid in CLUTTER) == pytest.approx(0.0, abs=1e-6)
        elif near.other[k] >= 0:
            parts = [n for n, solid in enumerate(robot.solids) if solid.link == near.other[k]]
            gaps = [abs(distance_of(robot, frames[k], n, there)) for n in parts]
            assert min(gaps) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("name", ROBOTS)
def test_what_the_robot_is_to_itself_hides_no_obstacle(name: str) -> None:
    among, bodies = prepared(name), prepared(name).scene.collision.bodies
    base, joints = states(among.robot, 150, 34)
    pairs = bodies.links.pairs.copy()
    pairs[:, bodies.hulls.world :] = False
    alone = replace(bodies, links=bodies.links._replace(pairs=pairs))
    whole = pairs_of(among, base, joints)
    some = near_pairs(alone, base, joints, among.scene.collision.contact, WITHIN)
    assert len(some.room) < len(whole.room)
    for one, other in zip(whole, some, strict=True):
        assert (one[whole.other == WORLD] == other).all()


def keys(near: NearPairs) -> list[tuple[int, int, int]]:
    return list(zip(near.state.tolist(), near.link.tolist(), near.other.tolist(), strict=True))


def test_distances_change_as_the_half_spaces_say() -> None:
    world = load_world("pillar")
    collision = scene_of(world).collision
    rng, robot, seen = np.random.default_rng(33), world.robot, 0
    base = np.column_stack([rng.uniform(-1.5, 1.5, (300, 2)), rng.uniform(-3, 3, 300)])
    joints = rng.uniform(robot.chain.lower, robot.chain.upper, (300, robot.chain.dof))
    at = np.column_stack([base, joints])
    constraints = StateConstraints(robot, collision, None, np.empty(0, dtype=object), np.zeros(1))
    step = 1e-6 * rng.normal(size=at.shape)
    near, after = constraints.near(at), constraints.near(at + step)
    change = constraints.approach(near, at)
    later = dict(zip(keys(after), after.room.tolist(), strict=True))
    for k, key in enumerate(keys(near)):
        if near.room[k] > 1e-3 and key in later:
            seen += abs(later[key] - near.room[k] - change[k] @ step[key[0]]) < 1e-9
    assert seen > 0.9 * np.count_nonzero(near.room > 1e-3) > 50


@pytest.mark.parametrize("mesh", [False, True])
def test_what_may_be_touched_is_not_near(mesh: bool) -> None:
    (among, x), (shy, _) = push(0.0, mesh), push(0.0, mesh, tool_contact=0.0)
    at = np.array([[x, 0.0, 0.0]]), AHEAD[None]
    assert WORLD in pairs_of(shy, *at).other
    assert WORLD not in pairs_of(among, *at).other


def test_a_mesh_is_as_near_as_the_box_it_draws() -> None:
    one, other = (push(0.0, mesh, tool_contact=0.0)[0] for mesh in (False, True))
    base = push(-0.03)[1] - np.column_stack([np.linspace(0.0, 0.05, 20), *np.zeros((2, 20))])
    joints = np.tile(AHEAD, (20, 1))
    assert pairs_of(other, base, joints).room == pytest.approx(pairs_of(one, base, joints).room, abs=1e-6)
