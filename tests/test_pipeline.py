from dataclasses import replace

import numpy as np
import pytest
import shapely

from regionik.papers.comparison import compare
from regionik.pipeline import plan
from regionik.values import Plan
from regionik.verification.verifier import verify
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.errors import InputError, NoPlanFound
from regionik.worlds.joints import Joint
from regionik.worlds.obstacles import Box
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from tests.planned import planned
from tests.plans import plan_text


def base_line(found: Plan) -> shapely.LineString:
    return shapely.LineString(found.motion.base[:, :2])


@pytest.mark.parametrize("name", ["free", "pillar", "slab", "wall", "l_shape"])
def test_bundled_worlds_are_planned_whole(name: str) -> None:
    found = planned(name)
    tools = found.tools()[found.motion.kind == "setpoint"]
    targets = np.array([target.position for target in found.world.task])
    assert verify(found).ok
    assert np.linalg.norm(tools - targets, axis=1).max() <= 1e-3
    for solid in found.world.solids:
        shadow = solid.shadow(found.world.robot.body_height)
        assert shadow is None or shadow.distance(base_line(found)) >= 0.2


def test_experiment_1_takes_no_more_iterations_than_the_paper() -> None:
    found = planned("free")
    assert len(found.setpoints) == 21
    assert sum(one.iterations for one in found.setpoints) <= 78


@pytest.mark.parametrize(("name", "most"), [("free", 78), ("pillar", 60), ("slab", 60), ("l_shape", 160)])
def test_without_smoothing_every_set_point_is_as_m_fabrik_found_it(name: str, most: int) -> None:
    """In M-FABRIK's own iterations and with its own errors, not solved anew on the way."""
    world = load_world(name)
    found = plan(replace(world, rules=replace(world.rules, smooth=False)))
    (alone,) = compare(world, ["mfabrik-areas"]).scores
    iterations = [one.iterations for one in found.setpoints]
    assert np.mean(iterations) == pytest.approx(alone.iterations, abs=1e-12)
    assert sum(iterations) == found.stats["iterations"] <= most
    assert found.stats["largest_error"] == pytest.approx(alone.worst_error, abs=1e-9)
    assert found.stats["largest_error"] > 5e-5
    assert verify(found, world).ok  # the world as it is, which says nothing of smoothing
    assert planned(name).stats["largest_error"] < found.stats["largest_error"]


def test_experiment_2_bridges_the_far_pair() -> None:
    found = planned("pillar")
    between = found.motion.base[found.motion.setpoint == 9, :2]
    assert len(found.setpoints) == 15
    assert found.lift_offs == 1
    assert found.stats["base_moves"]["steps"] == 1
    assert len(np.unique(between.round(6), axis=0)) >= 3


def test_experiment_2b_drives_round_the_slab() -> None:
    found = planned("slab")
    assert found.stats["base_moves"]["shortest"] == 1
    assert len(found.setpoints) == 15


def test_experiment_3_keeps_the_tool_along_the_normal() -> None:
    found = planned("wall")
    frames = found.world.robot.tool(found.motion.base, found.motion.joints)
    angles = np.arccos(np.clip(frames[found.motion.kind == "setpoint", :3, 2] @ [0, -1, 0], -1, 1))
    assert len(angles) == 20
    assert np.rad2deg(angles).max() <= 15.0
    assert found.lift_offs == 0


def test_experiment_4_never_lifts_off() -> None:
    found = planned("l_shape")
    assert found.lift_offs == 0
    assert len(found.setpoints) == 40


def test_same_world_same_seed_same_bytes() -> None:
    assert plan_text(plan(load_world("slab"))) == plan_text(planned("slab"))


def changed(world: World, *, task: tuple[Target, ...] | None = None, **more: object) -> World:
    return replace(world, task=world.task if task is None else task, **more)  # type: ignore[arg-type]


def failure(world: World) -> NoPlanFound:
    with pytest.raises(NoPlanFound) as caught:
        plan(world)
    assert "\n" not in str(caught.value)
    return caught.value


def test_a_target_too_high_is_named() -> None:
    world = load_world("pillar")
    high = Target(np.array([0.5, 0.0, 0.9]))
    why = failure(changed(world, task=(*world.task[:4], high))).explanation
    assert (why.verdict, why.setpoint) == ("unreachable", 4)
    assert "Set-point 5 of 5" in why.reason
    assert why.causes[0].kind == "reach"
    assert why.causes[0].margin == pytest.approx(0.9 - 0.147 - 0.5075)


def test_a_crowded_target_names_obstacle_and_clearance() -> None:
    world = load_world("pillar")
    plate = Box("plate", np.array([1.0, 1.0, 0.1]), np.array([1.3, 0.1, 0.05]))
    world = changed(world, task=world.task[:9])
    why = failure(changed(world, obstacles=(plate,))).explanation
    assert (why.verdict, why.setpoint) == ("unreachable", 8)
    assert [cause.name for cause in why.causes] == ["plate", "rules.clearance"]
    assert "plate" in why.reason
    amount = next(repair.amount for repair in why.repairs if repair.kind == "clearance")
    assert 0 < amount < 0.2
    plan(changed(world, obstacles=(plate,), rules=replace(world.rules, clearance=amount - 1e-3)))


def test_a_divider_breaks_the_ladder() -> None:
    world = load_world("pillar")
    divider = Box("divider", np.array([0.1, 3.0, 0.1]), np.array([1.1, 0.0, 0.05]))
    why = failure(changed(world, obstacles=(divider,))).explanation
    assert why.verdict == "ladder-broken"
    assert why.setpoint is not None
    assert [cause.name for cause in why.causes] == ["divider", "edge of the floor"]
    assert f"set-points {why.setpoint} and {why.setpoint + 1} of 15" in why.reason
    assert " m " in why.reason


def test_lift_offs_beyond_the_rules_are_refused() -> None:
    world = load_world("pillar")
    why = failure(changed(world, rules=replace(world.rules, max_lift_offs=0))).explanation
    assert (why.verdict, why.setpoint) == ("ladder-broken", 10)
    assert "lift-off" in [repair.kind for repair in why.repairs]
    assert "pillar" in why.reason


def test_a_start_inside_an_obstacle_is_refused() -> None:
    world = load_world("pillar")
    assert world.start is not None
    start = Start(np.array([1.3, 0.1, 0.0]), world.start.joints)
    why = failure(changed(world, start=start)).explanation
    assert why.verdict == "start-blocked"
    assert "inside pillar, 0.300 m deep" in why.reason
    assert why.causes[0].margin == pytest.approx(0.5)


def test_a_start_off_the_floor_is_refused() -> None:
    world = load_world("pillar")
    assert world.start is not None
    start = Start(np.array([9.0, 0.0, 0.0]), world.start.joints)
    assert "off the floor" in failure(changed(world, start=start)).explanation.reason


@pytest.mark.slow
def test_an_arm_that_would_touch_is_named() -> None:
    world = load_world("free")
    plate = Box("plate", np.array([0.02, 2.0, 0.3]), np.array([0.62, 0.0, 0.35]))
    floor = Floor(shapely.box(-2, -2, 3, 2))
    rules = Rules(heading="face_target", tool_contact=0.25, contact_depth=0.03, solid_floor=False)
    plated = World("plate", world.robot, floor, (plate,), world.task, rules, world.start)
    assert plan(plated).lift_offs <= 1
    why = failure(changed(plated, rules=replace(rules, avoidance=False))).explanation
    assert why.verdict == "plan-invalid"
    assert "plate" in why.reason
    assert "link" in why.reason
    assert why.causes[0].name == "plate"


def test_what_cannot_be_planned_yet_is_refused() -> None:
    world = load_world("pillar")
    with pytest.raises(InputError, match="at least one set-point"):
        plan(changed(world, task=()))
    chain = world.robot.chain
    endless = Joint("slide", "prismatic", -np.inf, np.inf, chain.joints[0].T_parent_joint)
    robot = replace(world.robot, chain=replace(chain, joints=(endless, *chain.joints[1:])))
    with pytest.raises(InputError, match="a sliding joint needs limits"):
        plan(changed(world, robot=robot))


def test_without_a_start_the_plan_begins_at_the_first_set_point() -> None:
    found = plan(changed(load_world("l_shape"), start=None))
    assert found.motion.kind[0] == "setpoint"
    assert found.lift_offs == 0
