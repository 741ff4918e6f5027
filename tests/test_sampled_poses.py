"""Stops of arms whose posture no place gives, in any order: sampled poses, and roadmaps of the arm."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from itertools import combinations, permutations

import numpy as np
import pytest
import shapely

from regionik.moving.transit import TransitPlanner
from regionik.parking import arm_tour, sampled_poses
from regionik.parking.fewest_stops import park
from regionik.parking.parking_areas import StopGroup
from regionik.parking.posture_carrier import PostureCarrier
from regionik.parking.sampled_poses import PoseCover
from regionik.parking.stops import in_sequence
from regionik.pipeline import plan
from regionik.planners.coverage.set_cover import least_cover, overlay_faces, undominated
from regionik.planners.coverage.tours import VisitingOrder
from regionik.postures.arm_roadmap import FixedBasePostures, goes
from regionik.postures.poses import Pose
from regionik.scene import Scene, scene_of
from regionik.verification.verifier import verify
from regionik.worlds.errors import NoPlanFound
from regionik.worlds.limits import Speeds
from regionik.worlds.links import capsules_along
from regionik.worlds.obstacles import Box
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, StopCriterion, Target, World
from tests.test_closed_form import ARMS

RULES = Rules(clearance=0.05, mode="stops", order="any", stop_tolerance=0.01)


@lru_cache(maxsize=4)
def holes(columns: int, rows: int) -> World:
    """Points before the face of a panel that the tool meets square, by an arm of six joints."""
    chain = ARMS["ur"]
    outline, mount = 0.2 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]), np.array([0, 0, 0.5, 0])
    robot = Robot("ur", "omni", outline, mount, chain, capsules_along(chain, 0.04), 0.4)
    spots = [[x, 0.0, z] for x in np.arange(columns) * 0.5 for z in 0.7 + 0.2 * np.arange(rows)]
    task = tuple(Target(np.array(spot), direction=np.array([0.0, 1.0, 0.0]), cone=0.05) for spot in spots)
    panel = Box("panel", np.array([0.5 * columns + 1.0, 0.04, 1.2]), np.array([0.25 * columns, 0.12, 0.9]))
    floor = Floor(shapely.box(-1.0, -2.5, 0.5 * columns + 1.0, 0.05))
    return World("holes", robot, floor, (panel,), task, RULES)


@pytest.fixture
def few_poses(monkeypatch: pytest.MonkeyPatch) -> None:
    few = replace(sampled_poses.OPTIONS, min_poses=100, poses_per_square_metre=10, max_rounds=2)
    monkeypatch.setattr(sampled_poses, "OPTIONS", few)


@pytest.mark.slow
@pytest.mark.usefixtures("few_poses")
def test_a_way_that_is_not_found_is_told_as_such(monkeypatch: pytest.MonkeyPatch) -> None:
    """Postures at the second stop are known and clear; what is missing is the way there."""
    world = holes(7, 1)
    monkeypatch.setattr(TransitPlanner, "carried", lambda *_: None)
    monkeypatch.setattr(TransitPlanner, "folded", lambda *_: None)
    monkeypatch.setattr(TransitPlanner, "sampled", lambda *_: None)
    with pytest.raises(NoPlanFound) as caught:
        plan(replace(world, task=(world.task[0], world.task[-1])))
    assert "no way to one of them was found" in caught.value.explanation.reason


@pytest.mark.slow
@pytest.mark.usefixtures("few_poses")
def test_no_cover_by_the_poses_drawn_has_fewer() -> None:
    """What each pose serves is proven of all, where the cover asks for it only of those that it takes."""
    world = holes(6, 2)
    parking = park(scene_of(world))
    cover = PoseCover(scene_of(world), parking.parking_areas)
    found = cover.fewest()
    inside = np.zeros((len(cover._drawn), len(world.task)), dtype=bool)
    for row, pose in zip(inside, cover._drawn, strict=True):
        held = cover._joined(pose)
        row[list(held.served if held is not None else ())] = True
    served = {i for part in found for i in part.setpoints}
    assert served == set(np.flatnonzero(inside.any(axis=0)).tolist())
    assert len(found) == len(least_cover(inside[:, sorted(served)]).chosen) >= parking.lower


@pytest.mark.slow
@pytest.mark.usefixtures("few_poses")
def test_every_posture_of_a_stop_is_clear_and_joined_to_every_other() -> None:
    world = holes(4, 2)
    sequence, rng = in_sequence(scene_of(world), park(scene_of(world))), np.random.default_rng(0)
    collision = sequence.scene.collision
    for group in sequence.groups:
        held = group.postures
        assert held is not None
        assert held.roadmap is not None
        for i, joints in zip(group.setpoints, held.joints, strict=True):
            target, tool = sequence.scene.task[i], world.robot.tool(held.base, joints)
            assert np.linalg.norm(tool[:3, 3] - target.position) <= world.rules.tolerance
            assert target.direction is not None
            assert tool[:3, 2] @ target.direction >= np.cos(target.cone) - 1e-9
        for _ in range(6):
            a, b = held.joints[rng.integers(len(held.joints), size=2)]
            way = held.roadmap.way(collision, a, b)
            assert way is not None
            assert collision.passes([Pose(held.base, a), *way, Pose(held.base, b)])


def test_a_set_point_beyond_a_post_is_joined_by_a_way_round_it_or_another_posture() -> None:
    """No straight motion leads to the posture known there from that which the arm is driven in."""
    world = holes(2, 1)
    robot, base, rng = world.robot, np.array([0.0, -0.9, np.pi / 2]), np.random.default_rng(3)
    world = replace(world, task=tuple(replace(target, direction=None) for target in world.task))
    scene, joined = scene_of(world), 0
    carrier = PostureCarrier(world, scene.collision, world.task)
    found, postures = carrier.neighboring(base, np.arange(1))
    assert found.tolist() == [0]
    for turn in rng.uniform(1.0, 2.5, 6):
        there = postures[0] + turn * (np.arange(robot.chain.dof) == 0)
        middle = robot.tool(base, postures[0] + turn / 2 * (np.arange(robot.chain.dof) == 0))[:2, 3]
        post = Box("post", np.array([0.08, 0.08, 2.0]), np.array([*middle, 1.0]))
        spot = robot.tool(base, there)[:3, 3]
        among = replace(world, obstacles=(post,), task=(Target(spot),))
        carrier = PostureCarrier(among, scene_of(among).collision, among.task)
        if not carrier.serves(0, base, there) or goes(carrier.collision, base, carrier.root, there):
            continue
        held = carrier.joined(base, np.arange(1), there[None])
        assert held is not None
        assert held.roadmap is not None
        assert carrier.serves(0, base, held.joints[0])
        way = held.roadmap.way(carrier.collision, carrier.root, held.joints[0])
        assert way is not None
        assert carrier.collision.passes([Pose(base, carrier.root), *way, Pose(base, held.joints[0])])
        joined += 1
    assert joined >= 3


@pytest.mark.usefixtures("few_poses")
@pytest.mark.parametrize("criterion", ["tolerance", "distance"])
def test_a_panel_is_planned_by_as_many_stops_whatever_the_criterion(criterion: StopCriterion) -> None:
    world = holes(4, 2)
    found = plan(replace(world, rules=replace(RULES, stop_criterion=criterion)))
    assert verify(found).ok
    assert len(found.stops) == len(in_sequence(scene_of(world), park(scene_of(world))).groups)
    assert min(stop.tolerance for stop in found.stops) >= RULES.stop_tolerance * 0.999


@pytest.mark.usefixtures("few_poses")
def test_the_arm_goes_by_a_tour_that_no_order_of_its_postures_shortens() -> None:
    """Each motion as long as its slowest joint takes, out from the posture that it is driven in and back."""
    world = replace(holes(3, 2), speeds=Speeds(joint_velocity=(1.0, 0.5, 1.0, 1.0, 2.0, 0.2)))
    found, sequence = plan(world), in_sequence(scene_of(world), park(scene_of(world)))
    at, total, best = np.flatnonzero(found.motion.kind == "setpoint"), 0.0, 0.0
    for stop, group in zip(found.stops, sequence.groups, strict=True):
        assert group.postures is not None
        off = found.motion.joints[at[stop.first : stop.last + 1]] - group.postures.joints
        assert np.allclose(off, 2 * np.pi * np.round(off / (2 * np.pi)), atol=1e-3)  # rounded by the timing
        far = arm_times(group.postures, sequence.scene.world)
        ways = np.array([(0, *way, 0) for way in permutations(range(1, len(far)))])
        lengths = far[ways[:, :-1], ways[:, 1:]].sum(axis=1)
        total, best = total + lengths[0], best + lengths.min()
    tour = found.stats["tour"]
    assert tour["arm"] == pytest.approx(total)
    assert total == pytest.approx(best)


@pytest.mark.usefixtures("few_poses")
def test_a_tour_takes_no_posture_that_does_not_hold(monkeypatch: pytest.MonkeyPatch) -> None:
    toured, seen = arm_tour._toured, list[bool]()

    def watched(
        scene: Scene, group: StopGroup, held: FixedBasePostures
    ) -> tuple[FixedBasePostures, VisitingOrder]:
        made, order = toured(scene, group, held)
        seen.append(sorted(made.joints.tolist()) == sorted(held.joints.tolist()))
        return made, order

    monkeypatch.setattr(arm_tour, "_toured", watched)
    monkeypatch.setattr(PostureCarrier, "serves", lambda *_: False)  # of all but those known to hold
    world = holes(3, 2)
    in_sequence(scene_of(world), park(scene_of(world)))
    assert seen == [True] * len(seen) != []


def arm_times(held: FixedBasePostures, world: World) -> np.ndarray:
    """Times of the ways between postures, the first that which the arm is driven in, straight from there."""
    assert held.roadmap is not None
    assert world.speeds is not None
    joints, collision = np.vstack([held.roadmap.joints[:1], held.joints]), scene_of(world).collision
    far = np.zeros((len(joints), len(joints)))
    for a, b in combinations(range(len(joints)), 2):
        way = held.roadmap.way(collision, joints[a], joints[b]) if a else []
        assert way is not None
        states = np.array([joints[a], *(pose.joints for pose in way), joints[b]])
        times = np.abs(np.diff(states, axis=0)) / np.array(world.speeds.joint_velocity)
        far[a, b] = far[b, a] = times.max(axis=1).sum()
    return far


def test_of_areas_that_share_a_place_only_that_is_made(monkeypatch: pytest.MonkeyPatch) -> None:
    """Laid over each other, with many corners each, they had thousands of faces, all but two of no use."""
    made = list[int]()
    monkeypatch.setattr(shapely, "polygonize", lambda lines: made.append(len(lines)))
    rng = np.random.default_rng(2)
    centers = np.concatenate([at + rng.uniform(-0.2, 0.2, (60, 2)) for at in (0.0, 3.0)])
    found = overlay_faces(np.array([shapely.Point(at).buffer(1.0, 40) for at in centers], dtype=object))
    assert not made
    assert sorted(found.inside.tolist()) == [[False] * 60 + [True] * 60, [True] * 60 + [False] * 60]


@pytest.mark.parametrize("seed", range(6))
def test_groups_of_areas_have_the_faces_of_all_of_them(seed: int) -> None:
    """Of each group alone, some with a place that all share: no spot lies in more areas than a face tells."""
    rng = np.random.default_rng(seed)
    centers = np.concatenate(
        [at + rng.uniform(0, spread, (5, 2)) for at, spread in ((0, 0.3), (2, 0.8), (4, 1.5))]
    )
    areas = np.array([shapely.Point(at).buffer(0.4) for at in centers], dtype=object)
    found = overlay_faces(areas)
    spots = np.concatenate([centers, rng.uniform(-0.5, 6, (3000, 2))])
    inside = np.column_stack([shapely.contains_xy(area, spots) for area in areas])
    assert all((found.inside >= row).all(axis=1).any() for row in inside)
    assert undominated(found.inside).all()
    for face, row in zip(found.polygon, found.inside, strict=True):
        assert all(area.buffer(1e-9).covers(face) for area in areas[row])
