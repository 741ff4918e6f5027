"""Arms on a vertical pivot, with lifts below it: told apart, and planned for."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from regionik.pipeline import plan
from regionik.verify import verify
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain, Joint, rot_x, translation
from regionik.worlds.errors import InputError
from regionik.worlds.library import robot_named
from regionik.worlds.pivot import is_planar, pivot_of, span_of
from regionik.worlds.scene import Floor, Heading, Rules, Start, Target, World
from tests.bodies import on_lift, with_lift

LIFT = Joint("lift", "prismatic", 0.0, 0.3, np.eye(4))
PIVOT = Joint("pivot", "revolute", -3.0, 3.0, translation(0, 0, 0.2))
HINGE = Joint("hinge", "revolute", -2.0, 2.0, rot_x(np.pi / 2))


def chain_of(*joints: Joint) -> Chain:
    return Chain(joints, translation(0.3, 0, 0))


def test_the_pivot_is_the_first_joint_that_is_not_a_lift() -> None:
    down = Joint("down", "prismatic", -0.1, 0.1, np.eye(4), np.array([0.0, 0.0, -1.0]))
    assert pivot_of(chain_of(PIVOT, HINGE)) == 0
    assert pivot_of(chain_of(LIFT, PIVOT, HINGE)) == 1
    assert pivot_of(chain_of(LIFT, down, PIVOT, HINGE)) == 2
    assert not is_planar(on_lift(robot_named("youbot")).chain)


@pytest.mark.parametrize(
    "first",
    [
        Joint("cart", "prismatic", 0.0, 1.0, np.eye(4), np.array([1.0, 0.0, 0.0])),
        Joint("ramp", "prismatic", 0.0, 1.0, rot_x(0.1)),
        Joint("tilted", "revolute", -1.0, 1.0, rot_x(0.1)),
        Joint("upside down", "revolute", -1.0, 1.0, rot_x(np.pi)),
        Joint("beside", "revolute", -1.0, 1.0, translation(0.1, 0, 0)),
    ],
)
def test_other_arms_are_refused(first: Joint) -> None:
    for joints in ((first, HINGE), (LIFT, first, HINGE)):
        with pytest.raises(InputError, match="first axis must be the vertical"):
            span_of(chain_of(*joints))


def test_lifts_alone_are_refused() -> None:
    with pytest.raises(InputError, match="first axis must be the vertical"):
        pivot_of(chain_of(LIFT))


def test_a_lift_without_end_is_refused() -> None:
    endless = Joint("lift", "prismatic", 0.0, np.inf, np.eye(4))
    with pytest.raises(InputError, match="lift: a sliding joint needs limits"):
        span_of(chain_of(endless, PIVOT, HINGE))


def test_a_lift_lengthens_the_span_by_half_its_travel() -> None:
    plain, lifted = span_of(chain_of(PIVOT, HINGE)), span_of(chain_of(LIFT, PIVOT, HINGE))
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
