"""Arms on a vertical pivot, with lifts below it, and others: told apart, and planned for."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from regionik.areas.reachable import reach_model
from regionik.pipeline import plan
from regionik.reachability.reach import reach
from regionik.regions import admissible_area
from regionik.verification.verifier import verify
from regionik.worlds.arms import has_pivot, pivot_index, pivot_joints, reach_bound, with_pivot
from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import Chain
from regionik.worlds.errors import InputError
from regionik.worlds.joints import Joint
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from tests.bodies import on_lift, with_lift
from tests.kinds import BaseKind, Heading
from tests.maths import Array, rot_x, translation
from tests.measures import axis_of

LIFT = Joint("lift", "prismatic", 0.0, 0.3, np.eye(4))
PIVOT = Joint("pivot", "revolute", -3.0, 3.0, translation(0, 0, 0.2))
HINGE = Joint("hinge", "revolute", -2.0, 2.0, rot_x(np.pi / 2))


def chain_of(*joints: Joint) -> Chain:
    return Chain(joints, translation(0.3, 0, 0))


def test_the_pivot_is_the_first_joint_that_is_not_a_lift() -> None:
    down = Joint("down", "prismatic", -0.1, 0.1, np.eye(4), np.array([0.0, 0.0, -1.0]))
    assert pivot_index(chain_of(PIVOT, HINGE)) == 0
    assert pivot_index(chain_of(LIFT, PIVOT, HINGE)) == 1
    assert pivot_index(chain_of(LIFT, down, PIVOT, HINGE)) == 2
    assert not reach_model(on_lift(robot_named("youbot")), "point").exact


OTHERS = (
    Joint("cart", "prismatic", 0.0, 0.4, np.eye(4), np.array([1.0, 0.0, 0.0])),
    Joint("ramp", "prismatic", 0.0, 0.4, rot_x(0.1)),
    Joint("tilted", "revolute", -1.0, 1.0, rot_x(0.4)),
    Joint("upside down", "revolute", -2.5, 2.5, rot_x(np.pi)),
    Joint("beside", "revolute", -1.0, 1.0, translation(0.1, 0, 0)),
)
NAMES = [joint.name for joint in OTHERS]


@pytest.mark.parametrize("first", OTHERS, ids=NAMES)
def test_other_arms_are_behind_a_pivot_that_stands_still(first: Joint) -> None:
    for joints in ((first, HINGE), (LIFT, first, HINGE)):
        chain = chain_of(*joints)
        with pytest.raises(InputError, match="expected a first axis that is the vertical"):
            pivot_index(chain)
        whole = with_pivot(chain)
        assert pivot_index(whole) == 0
        assert (whole.joints[0].lower, whole.joints[0].upper) == (0.0, 0.0)
        q = np.full(chain.dof, 0.3)
        assert whole.forward(pivot_joints(chain, q)).tolist() == chain.forward(q).tolist()
        assert has_pivot(whole)
        assert pivot_joints(whole, np.ones((3, whole.dof))).tolist() == np.ones((3, whole.dof)).tolist()


def standing_on(first: Joint, base: BaseKind) -> Robot:
    """Three joints behind another, so that the tool has all ways to go."""
    hinge = Joint("upper", "revolute", -2.5, 2.5, translation(0, 0, 0.2) @ rot_x(np.pi / 2))
    elbow = Joint("fore", "revolute", -2.5, 2.5, translation(0.4, 0, 0) @ rot_x(0.2))
    wrist = Joint("hand", "revolute", -2.5, 2.5, translation(0.4, 0, 0) @ rot_x(np.pi / 2))
    chain = Chain((first, hinge, elbow, wrist), translation(0.1, 0.05, 0.1))
    corners = np.array([[0.3, 0.2], [-0.3, 0.2], [-0.3, -0.2], [0.3, -0.2]])
    mount = np.array([0.1, 0.0, 0.5, 0.3])
    return Robot("other", base, corners, mount, chain, (), 0.4, np.zeros(4), 0.6 if base == "car" else 0.0)


@pytest.mark.parametrize("base", ["omni", "differential", "car"])
@pytest.mark.parametrize("first", OTHERS, ids=NAMES)
def test_other_arms_are_planned_for(first: Joint, base: BaseKind) -> None:
    robot = standing_on(first, base)
    height = float(robot.tool(np.zeros(3), np.array([0.1, 0.5, 0.5, 0.2]))[2, 3])
    task = tuple(Target(np.array([x, 0.0, height])) for x in np.linspace(0, 1, 6))
    start = Start(np.array([-0.5, -1.0, 0.0]), robot.carry)
    floor = Floor(shapely.box(-2, -2, 3, 2))
    found = plan(World("other", robot, floor, (), task, Rules(clearance=0.05), start))
    assert verify(found).ok
    assert found.motion.joints.shape[1] == 4
    tools = robot.tool(found.motion.base, found.motion.joints)[found.motion.kind == "setpoint"]
    assert np.linalg.norm(tools[:, :3, 3] - [t.position for t in task], axis=1).max() <= 1e-3


@pytest.mark.parametrize("first", OTHERS, ids=NAMES)
def test_reach_of_other_arms_is_asked_for(first: Joint) -> None:
    """What random postures and headings reach is in the outer area; the inner one is solved where asked."""
    robot, rng = standing_on(first, "omni"), np.random.default_rng(3)
    low, high = robot.chain.lower, robot.chain.upper
    for q, yaw in zip(rng.uniform(low, high, (12, 4)), rng.uniform(-3, 3, 12), strict=True):
        tool = robot.tool(np.array([0.0, 0.0, yaw]), q)[:3, 3]
        world = World("other", robot, Floor(shapely.box(-3, -3, 3, 3)), (), (), Rules(clearance=0.0))
        area = admissible_area(world, tool)
        assert area.outer.distance(shapely.Point(axis_of(robot, np.array([0.0, 0.0, yaw])))) < 1e-6
        answer = reach(world, tool[None])
        assert answer.verdict[0] in (["reachable"] if area.inner.area > 0 else ["reachable", "undecided"])


def test_lifts_alone_are_refused() -> None:
    with pytest.raises(InputError, match="expected a first axis that is the vertical"):
        pivot_index(chain_of(LIFT))


def test_a_lift_without_end_is_refused() -> None:
    endless = Joint("lift", "prismatic", 0.0, np.inf, np.eye(4))
    with pytest.raises(InputError, match="lift: a sliding joint needs limits"):
        reach_bound(chain_of(endless, PIVOT, HINGE))


def test_a_lift_lengthens_the_span_by_half_its_travel() -> None:
    plain, lifted = reach_bound(chain_of(PIVOT, HINGE)), reach_bound(chain_of(LIFT, PIVOT, HINGE))
    assert lifted.height == pytest.approx(plain.height + 0.15)
    assert lifted.length == pytest.approx(plain.length + 0.15)
    assert lifted.radius == plain.radius


@pytest.mark.parametrize("heading", ["free", "face_target"])
@pytest.mark.parametrize("name", ["planar arm", "lifting arm"])
def test_an_arm_on_a_lift_is_planned_for(name: str, heading: Heading) -> None:
    """From below what the arm reaches with the lift down to above what it reaches without it."""
    robot = on_lift(robot_named("youbot-real") if name == "planar arm" else with_lift())
    path: Array = np.column_stack([np.full(5, 0.5), np.linspace(0, 0.3, 5), np.linspace(0.3, 0.95, 5)])
    task = tuple(Target(point) for point in path)
    start = Start(np.array([-0.7, 0.0, 0.0]), robot.carry)
    floor = Floor(shapely.box(-2, -2, 3, 2))
    found = plan(World("lifted", robot, floor, (), task, Rules(clearance=0.01, heading=heading), start))
    assert verify(found).ok
    assert found.lift_offs == 0
    assert np.ptp(found.motion.joints[:, 0]) > 0.05  # the lift is made use of
