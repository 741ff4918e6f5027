"""The arm goes round things: whole plans, judged by sampled distances that share nothing with the planner."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from regionik.moving import transit
from regionik.pipeline import plan
from regionik.values import Plan
from regionik.verification.verifier import verify
from regionik.worlds.arms import planar_arm
from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import Chain
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.errors import Explanation, InputError, NoPlanFound
from regionik.worlds.obstacles import Box, Cylinder
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from tests.bodies import LARGEST_BEND, with_lift
from tests.maths import Array, wrap
from tests.planned import planned

CROWDED = ("shelf", "pipe", "tao1")
YOUBOT = robot_named("youbot")
START = Start(np.zeros(3), YOUBOT.carry)


def between(found: Plan, parts: int) -> tuple[Array, Array]:
    """Base and joints at the states of a plan and at even parts of the way between them."""
    motion, shares = found.motion, np.linspace(0, 1, parts, endpoint=False)[:, None]
    base, joints = [motion.base[-1:]], [motion.joints[-1:]]
    for k in range(len(motion) - 1):
        drive = motion.base[k + 1] - motion.base[k]
        drive[2] = wrap(drive[2])
        base.append(motion.base[k] + shares * drive)
        joints.append(motion.joints[k] + shares * (motion.joints[k + 1] - motion.joints[k]))
    return np.concatenate(base), np.concatenate(joints)


def least_distance(found: Plan, parts: int = 6, along: int = 9) -> float:
    """From points along the axes of all links to all obstacles, less the links' radii."""
    frames = found.world.robot.frames(*between(found, parts))
    share = np.linspace(0, 1, along)[:, None]
    least = np.inf
    for link in found.world.robot.solids:
        axis = link.corners[0] + share * (link.corners[1] - link.corners[0])
        points = axis @ frames[:, link.link, :3, :3].swapaxes(1, 2) + frames[:, link.link, None, :3, 3]
        for solid in found.world.solids:
            gaps = [solid.distance(point) for point in points.reshape(-1, 3)]
            least = min(least, min(gaps) - link.radius)
    return least


def why_not(world: World) -> Explanation:
    with pytest.raises(NoPlanFound) as caught:
        plan(world)
    return caught.value.explanation


def unguarded(world: World) -> World:
    return replace(world, rules=replace(world.rules, avoidance=False))


def line(count: int) -> tuple[Target, ...]:
    return tuple(Target(np.array([x, 0.5, 0.3])) for x in np.linspace(0.3, 1.3, count))


@pytest.mark.parametrize("name", CROWDED)
def test_crowded_worlds_are_planned_whole(name: str) -> None:
    found = planned(name)
    assert verify(found).ok
    assert (found.motion.kind == "setpoint").sum() == len(found.world.task)
    assert least_distance(found) >= found.world.rules.arm_clearance


@pytest.mark.parametrize("name", [pytest.param("shelf", marks=pytest.mark.slow), "tao1"])
def test_without_avoidance_link_and_obstacle_are_named(name: str) -> None:
    world = load_world(name)
    why = why_not(unguarded(world))
    obstacles = [solid.name for solid in world.solids if solid.name in why.reason]
    links = [solid.name for solid in world.robot.solids if solid.name in why.reason]
    assert why.verdict == "plan-invalid"
    assert len(links) == 1
    assert why.causes[0].kind == "obstacle"
    assert why.causes[0].name in obstacles
    assert why.causes[0].margin is not None
    assert why.causes[0].margin > 0


@pytest.mark.parametrize("name", [*CROWDED, "free", "pillar", "wall", "l_shape"])
def test_nothing_jumps(name: str) -> None:
    motion = planned(name).motion
    bends = np.abs(np.diff(motion.joints, axis=0))
    turns = np.abs([wrap(turn) for turn in np.diff(motion.base[:, 2])])
    assert bends.max() <= LARGEST_BEND + 1e-9
    assert turns.max() <= LARGEST_BEND + 1e-9
    assert np.hypot(*np.diff(motion.base[:, :2], axis=0).T).max() <= planned(name).world.rules.step + 1e-9


@pytest.mark.parametrize("name", ["shelf", "pipe", "free", "wall", "l_shape"])
def test_the_elbow_does_not_flip_on_the_path(name: str) -> None:
    """It may go through straight, as where the wrist makes up for it, but not from one side to the other."""
    found = planned(name)
    elbow = planar_arm(found.world.robot.chain).bends(found.motion.joints)[:, 1]
    lifted = np.cumsum(found.motion.kind == "transit")
    spots = np.flatnonzero(found.motion.kind == "setpoint")
    unbroken = lifted[spots[1:]] == lifted[spots[:-1]]
    before, after = elbow[spots[:-1]], elbow[spots[1:]]
    flips = (np.sign(before) != np.sign(after)) & (np.abs(after - before) > 0.1) & unbroken
    assert unbroken.sum() >= len(spots) - 2
    assert not flips.any()


def boards(middle: Array, inside: float, low: float, high: float, sides: str) -> tuple[Box, ...]:
    """Boards 2 cm thick round a place: north, south, east, west, top, bottom."""
    (x, y), half, thick = middle, inside / 2, 0.02
    wide, z, off = inside + 2 * thick, (low + high) / 2, half + thick / 2
    places = {
        "north": ((wide, thick, high - low), (x, y + off, z)),
        "south": ((wide, thick, high - low), (x, y - off, z)),
        "east": ((thick, wide, high - low), (x + off, y, z)),
        "west": ((thick, wide, high - low), (x - off, y, z)),
        "top": ((wide, wide, thick), (x, y, high + thick / 2)),
        "bottom": ((wide, wide, thick), (x, y, low - thick / 2)),
    }
    return tuple(Box(name, np.array(places[name][0]), np.array(places[name][1])) for name in sides.split())


@pytest.mark.slow
def test_a_closed_cage_leaves_no_posture() -> None:
    cage = boards(np.array([0.8, 0.5]), 0.2, 0.3, 0.5, "north south east west top bottom")
    task = (Target(np.array([0.3, 0.5, 0.3])), Target(np.array([0.8, 0.5, 0.4])))
    world = World("cage", YOUBOT, Floor(shapely.box(-1, -1, 2, 2)), cage, task, Rules(clearance=0.05), START)
    why = why_not(world)
    words = why.reason.split()
    assert (why.verdict, why.setpoint) == ("no-posture", 1)
    assert "Set-point 2 of 2" in why.reason
    assert "link" in why.reason
    assert why.causes[0].kind == "obstacle"
    assert why.causes[0].name in {board.name for board in cage}
    assert why.causes[0].name in why.reason
    assert int(words[words.index("postures") - 1]) > 20
    assert int(words[words.index("places", words.index("postures")) - 1]) > 10


def bell() -> World:
    """A room of boards that hangs over the floor: the base drives under its rim, the arm does not."""
    room = boards(np.array([0.8, 0.5]), 1.2, 0.2, 0.9, "north south east west top")
    task = (Target(np.array([0.8, 0.5, 0.4])),)
    return World("bell", YOUBOT, Floor(shapely.box(-1, -1, 2, 2)), room, task, Rules(clearance=0.05), START)


def test_postures_that_cannot_be_got_to_are_told_from_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(transit, "OPTIONS", replace(transit.OPTIONS, max_iterations=200))
    why = why_not(bell())
    assert (why.verdict, why.setpoint) == ("no-posture", 0)
    assert "no way to one of them" in why.reason
    assert "link" in why.reason
    assert why.causes[0].name == "west"


def test_what_cannot_be_got_into_can_be_stood_in() -> None:
    inside = plan(replace(bell(), start=None))
    assert verify(inside).ok
    assert inside.lift_offs == 0


def past_a_board() -> World:
    """A board between the floor and the middle of the path, higher than the arm gets."""
    board = Box("board", np.array([0.02, 0.09, 1.2]), np.array([0.8, 0.405, 0.65]))
    floor = Floor(shapely.box(-0.2, -0.2, 1.8, 0.35))
    return World("board", YOUBOT, floor, (board,), line(11), Rules(clearance=0.05), START)


def test_the_arm_is_lifted_past_what_it_cannot_pass() -> None:
    found = planned("past a board", past_a_board)
    assert found.lift_offs == 1
    assert verify(found).ok
    assert least_distance(found) >= 0.0
    assert plan(replace(past_a_board(), obstacles=())).lift_offs == 0


def test_what_can_be_gone_round_takes_no_lift_off() -> None:
    post = Cylinder("post", 0.03, 0.8, np.array([0.8, 0.4, 0.6]))
    found = plan(replace(past_a_board(), obstacles=(post,)))
    assert found.lift_offs == 0
    assert verify(found).ok


@pytest.mark.slow
def test_lift_offs_that_the_arm_forces_are_bounded_by_the_rules() -> None:
    world = past_a_board()
    why = why_not(replace(world, rules=replace(world.rules, max_lift_offs=0)))
    assert why.verdict == "ladder-broken"
    assert why.causes[0].name == "board"
    assert "lift-off" in {one.kind for one in why.repairs}
    assert "rules allow 0" in why.reason
    assert plan(replace(world, rules=replace(world.rules, max_lift_offs=1))).lift_offs == 1


def test_the_arm_keeps_off_its_own_base() -> None:
    robot = robot_named("youbot-real")
    start = Start(np.array([-0.143, 0, 0]), robot.carry)
    low = (Target(np.array([0.178, 0.05, 0.072])),)
    floor = Floor(shapely.box(-0.48, -0.48, 0.5, 0.5))
    world = World("low", robot, floor, (), low, Rules(heading="face_target"), start)
    why = why_not(unguarded(world))
    assert why.verdict == "plan-invalid"
    assert "own base" in why.reason
    assert verify(plan(world)).ok


def test_an_arm_on_a_lift_works_over_a_table() -> None:
    robot = replace(with_lift(), mount=np.zeros(4))
    table = Box("table", np.array([0.8, 0.3, 0.02]), np.array([0.9, 0.45, 0.5]))
    task = tuple(Target(np.array([x, 0.5, 0.6])) for x in np.linspace(0.5, 1.2, 8))
    start = Start(np.array([0.3, -0.4, 0.0]), robot.carry)
    world = World("lift", robot, Floor(shapely.box(-1, -1, 2, 1)), (table,), task, Rules(), start)
    found = plan(world)
    assert verify(found).ok
    assert least_distance(found) >= 0.0


def test_an_arm_that_cannot_be_where_it_starts_is_told() -> None:
    lamp = Cylinder("lamp", 0.1, 0.1, np.array([0.0, 0.0, 0.6]))
    world = World("lamp", YOUBOT, Floor(shapely.box(-1, -1, 2, 2)), (lamp,), line(3), Rules(), START)
    why = why_not(world)
    assert (why.verdict, why.setpoint) == ("start-blocked", None)
    assert why.causes[0].name == "lamp"
    assert "link 5" in why.reason
    assert plan(replace(world, start=None)).lift_offs == 0


def test_a_robot_that_starts_at_the_edge_of_its_floor_gets_away() -> None:
    """Where only its heading keeps the base on the floor, the arm must still find its way round things."""
    robot = robot_named("youbot-real")
    start = Start(np.array([-0.7, 0.0, 0.0]), robot.carry)
    lid = Box("lid", np.array([0.5, 0.8, 0.02]), np.array([-0.2, 0.0, 0.5]))
    floor = Floor(shapely.box(-1.0, -1, 2, 1))
    task = tuple(Target(np.array([x, 0.1, 0.3])) for x in np.linspace(0.3, 0.8, 4))
    found = plan(World("edge", robot, floor, (lid,), task, Rules(clearance=0.01), start))
    assert verify(found).ok
    assert least_distance(found) >= 0.0


def test_a_slide_without_end_is_refused() -> None:
    robot = replace(with_lift(), mount=np.zeros(4))
    lift = replace(robot.chain.joints[1], upper=np.inf)
    chain = Chain((robot.chain.joints[0], lift, *robot.chain.joints[2:]), robot.chain.T_last_tool)
    floor = Floor(shapely.box(-1, -1, 2, 1))
    with pytest.raises(InputError, match="lift: a sliding joint needs limits"):
        plan(World("endless", replace(robot, chain=chain), floor, (), line(3), Rules()))
