"""What `plan` refuses `why` explains, with the same verdict and causes, and with repairs where one helps."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from regionik.explain import tried_changes
from regionik.explain.changes import repaired
from regionik.explain.failures import blocked_start
from regionik.parking.stops import stops
from regionik.pipeline import plan, why
from regionik.planners.tries import count_tries, counted
from regionik.reachability.reach import reach
from regionik.reachability.unreached import first_unreached
from regionik.scene import Scene, scene_of
from regionik.view.page import to_html
from regionik.view.world_picture import picture_of_explanation
from regionik.worlds.chain import Chain
from regionik.worlds.errors import Cause, Explanation, NoPlanFound
from regionik.worlds.joints import Joint
from regionik.worlds.links import capsules_along
from regionik.worlds.obstacles import Box
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from tests import MINUTES
from tests.maths import translation
from tests.test_random_worlds import random_world
from tests.test_skipping import SPOTS, hall

TUBE = tuple(  # round the first set-point, too high for the base to touch
    Box(f"side {k}", np.array([0.02, 0.5, 0.4]), np.array([*way, 0.4]), k * np.pi / 2)
    for k, way in enumerate(((0.2, 0.0), (0.0, 0.2), (-0.2, 0.0), (0.0, -0.2)))
)
POST = Box("post", np.array([0.4, 0.4, 0.5]), np.array([-0.6, 0.0, 0.25]))


def refused(world: World) -> Explanation:
    """Return why a world is not planned, by both doors."""
    with pytest.raises(NoPlanFound) as no:
        plan(world)
    return told_by_why(world, no.value.explanation)


def told_by_why(world: World, found: Explanation) -> Explanation:
    """Return why a world is not planned, which `why` says too."""
    told = why(world)
    assert told is not None
    assert (told.verdict, told.setpoint, told.causes) == (found.verdict, found.setpoint, found.causes)
    assert found.causes
    assert "mend" in found.reason or found.repairs
    return found


def test_a_plan_that_does_not_hold_is_explained() -> None:
    found = refused(replace(hall(SPOTS[0], avoidance=False), obstacles=TUBE))
    assert found.verdict == "plan-invalid"
    assert found.causes[0].name.startswith("side ")


def test_a_target_out_of_reach_is_explained() -> None:
    assert refused(hall((0.5, 0.0, 2.0))).verdict == "unreachable"


def test_a_blocked_start_is_mended_by_a_short_step() -> None:
    world = hall(SPOTS[0], SPOTS[2])
    start = Start(np.array([-0.5, 0.0, 0.0]), world.robot.carry)
    found = refused(replace(world, obstacles=(POST,), start=start))
    assert found.verdict == "start-blocked"
    assert {repair.kind for repair in found.repairs} == {"move-start", "move-obstacle"}
    for repair in found.repairs:
        assert repair.amount == pytest.approx(0.15, abs=0.01)
        after = repaired(scene_of(replace(world, obstacles=(POST,), start=start)), repair)
        assert blocked_start(after) is None
        assert plan(after.world)


@pytest.mark.parametrize("count", [1, 60])
def test_a_blocked_start_is_mended_with_a_number_of_tries_that_goes_with_the_path(count: int) -> None:
    world = replace(hall(*SPOTS[:1] * count), obstacles=(POST,))
    world = replace(world, start=Start(np.array([-0.5, 0.0, 0.0]), world.robot.carry))
    scene, asked = scene_of(world), list[Scene]()
    quick = blocked_start(scene)
    assert quick is not None

    def blocked(changed: Scene) -> bool:
        asked.append(changed)
        return blocked_start(changed) is not None

    def endless(_: Scene) -> bool:
        while True:
            count_tries()

    with counted() as tries:
        found = tried_changes.mended_start(scene, quick, blocked, endless)
    assert len(asked) < 10  # worlds made for it: each would be cut into ground again
    assert tries.made <= tried_changes.tries_for(scene) + len(found.repairs)
    assert found.repairs
    assert all("did not show whether the path is planned" in one.text for one in found.repairs)


def test_an_obstacle_that_frees_no_start_between_two_is_no_repair() -> None:
    world = hall(SPOTS[0])
    posts = (POST, replace(POST, name="other"))
    start = Start(np.array([-0.5, 0.0, 0.0]), world.robot.carry)
    found = refused(replace(world, obstacles=posts, start=start))
    assert {repair.kind for repair in found.repairs} == {"move-start"}


def test_few_set_points_are_looked_at_closely_and_the_others_are_named() -> None:
    world = hall(*[(0.5, 0.0, 0.3 if k % 3 else 2.0 + k) for k in range(20)])
    failures, left = first_unreached(scene_of(world), range(20), 15, 3)
    assert [one.setpoint for one in failures] == [0, 3, 6]
    assert left == list(range(7, 20))
    assert first_unreached(scene_of(world), range(1, 20), 2, 3) == ([], list(range(3, 20)))


def test_too_little_room_to_park_is_mended_by_a_smaller_circle() -> None:
    world = hall(SPOTS[0], SPOTS[2], mode="stops", stop_tolerance=0.5)
    found = refused(world)
    assert [(repair.kind, repair.name) for repair in found.repairs] == [
        ("stop-tolerance", "rules.stop_tolerance")
    ]
    assert found.repairs[0].amount < 0.5
    assert stops(repaired(scene_of(world), found.repairs[0]).world)


def test_an_arm_that_cannot_keep_its_posture_round_the_circle_is_mended_by_a_smaller_one() -> None:
    """Its base turned one way, a crane has its tool in one vertical plane, and none beside it."""
    world = craned(stop_tolerance=0.01)
    found = refused(world)
    assert found.verdict == "no-posture"
    assert "kept all round the circle of 0.01 m to park in" in found.reason
    assert "stop-tolerance" in {repair.kind for repair in found.repairs}
    for repair in found.repairs:
        assert plan(repaired(scene_of(world), repair).world)


def craned(stop_tolerance: float) -> World:
    """One target for a lift, a hinge and a slide, set off to the side, on a base that turns on the spot."""
    joints = (
        Joint("lift", "prismatic", 0.0, 0.4, np.eye(4), np.array([0.0, 0.0, 1.0])),
        Joint("hinge", "revolute", -2.0, 2.5, translation(0.0, 0.02, 0.0), np.array([0.0, 1.0, 0.0])),
        Joint("slide", "prismatic", 0.0, 0.2, translation(0.0, 0.0, 0.28), np.array([1.0, 0.0, 0.0])),
    )
    chain = Chain(joints, translation(0.29, 0.0, 0.1))
    mount, links = np.array([0.0, 0.0, 0.34, 0.0]), capsules_along(chain, 0.03)
    robot = Robot("crane", "omni", np.zeros((1, 2)), mount, chain, links, 0.3)
    tool = robot.tool(np.array([0.3, 0.2, 0.5]), np.array([0.3, 1.4, 0.1]))
    target = Target(tool[:3, 3], direction=tool[:3, 2], cone=0.3)
    rules = Rules(mode="stops", stop_tolerance=stop_tolerance)
    return World("crane", robot, Floor([[-2, -2], [2, -2], [2, 2], [-2, 2]]), (), (target,), rules)


@pytest.mark.parametrize(
    "seeds", [pytest.param((4, 24), marks=pytest.mark.slow), pytest.param(range(60), marks=MINUTES)]
)
def test_both_doors_say_the_same(seeds: range) -> None:
    verdicts = set()
    for seed in seeds:
        try:
            plan(random_world(seed))
        except NoPlanFound as no:
            verdicts.add(told_by_why(random_world(seed), no.explanation).verdict)
    assert {"unreachable", "start-blocked"} <= verdicts


# Changes farther away, and pairs of them ---------------------------------------------------------------


def test_two_small_changes_where_no_single_one_does() -> None:
    plate = Box("plate", np.array([8.0, 8.0, 0.1]), np.array([0.0, 0.0, 0.05]))
    world = hall()
    target = Target(np.array([0.2, 0.0, 0.9]))
    found = why(replace(world, obstacles=(plate,)), target)
    assert found is not None
    (repair,) = found.repairs
    assert len(repair.also) == 1
    assert repair.text.count(" m") >= 2
    after = repaired(scene_of(replace(world, obstacles=(plate,), task=(target,))), repair)
    assert reach(after.world, after.task).reachable.all()
    for single in (replace(repair, also=()), repair.also[0]):
        alone = repaired(scene_of(replace(world, obstacles=(plate,), task=(target,))), single)
        assert not reach(alone.world, alone.task).reachable.any()


def test_what_was_tried_is_said_where_nothing_helps() -> None:
    narrow = replace(hall(), floor=replace(hall().floor, polygon=hall().floor.polygon.buffer(-0.9)))
    found = why(narrow, [30.0, 0.0, 0.3])
    assert found is not None
    assert found.repairs or "No single change that was tried mends it. Tried were, at most: " in found.reason


@pytest.mark.parametrize("made", [40, 400])
def test_repairs_are_tried_with_hardly_more_tries_than_the_search_made(
    made: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tried_changes, "OPTIONS", replace(tried_changes.OPTIONS, spare_tries=5))
    world = replace(hall(*SPOTS), obstacles=TUBE)
    quick = Explanation("no-posture", 1, "It is closed.", tuple(Cause("obstacle", one.name) for one in TUBE))

    def closed(_: Scene) -> bool:
        for _k in range(10):
            count_tries()
        return False

    with counted() as tries:
        found = tried_changes.mended_motion(scene_of(world), quick, closed, made)
    assert tries.made <= made + 2 * 5
    assert not found.repairs
    assert ("Tried were" in found.reason) == (made == 400)  # nothing is said to be tried that was not


def test_the_page_shows_sentence_and_causes(tmp_path: Path) -> None:
    world, target = hall(), Target(np.array([0.0, 0.0, 2.0]))
    found = why(world, target)
    assert found is not None
    to_html(picture_of_explanation(world, found, target), tmp_path / "why.html")
    page = (tmp_path / "why.html").read_text()
    assert found.reason.split(". ")[0] in page
    assert "in the way: youbot" in page
