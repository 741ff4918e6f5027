"""Why not, where the arm would touch something from everywhere."""

from dataclasses import replace

import numpy as np
import pytest

from regionik.explain.changes import repaired
from regionik.explain.constraints import ARM_CLEARANCE, arm_constraints_of
from regionik.pipeline import plan, why
from regionik.reachability.reach import reach
from regionik.scene import scene_of
from regionik.worlds.bundled import robot_named
from regionik.worlds.errors import Explanation, NoPlanFound
from regionik.worlds.obstacles import Sphere
from regionik.worlds.scene import Rules, Target, World
from tests.test_any_base import HALL, kept_heading, level
from tests.why_cases import smaller

SPOT = np.array([0.0, 0.0, 0.3])


def in_a_ball(radius: float, arm_clearance: float = 0.0, depth: float = 0.3) -> World:
    """A target that the last link may reach into as deep as told, and no other; see `tests.test_any_base`."""
    rules = Rules(clearance=0.05, tool_contact=0.3, contact_depth=depth, arm_clearance=arm_clearance)
    ball = Sphere("ball", radius, SPOT)
    return World("ball", robot_named("youbot"), HALL, (ball,), (Target(SPOT),), rules)


CASES = {
    "looking back over the base": (
        replace(kept_heading(), task=(level(0.05, 0.7),)),
        {"footprint of the base", "rules.heading", "tool direction", "links and base of the robot"},
        {"cone", "move-target"},
    ),
    "in a ball": (in_a_ball(0.245), {"ball"}, {"move-obstacle", "move-target"}),
    "beside a ball that the arm keeps off": (
        in_a_ball(0.17, arm_clearance=0.05),
        {"ball", ARM_CLEARANCE},
        {"clearance", "move-obstacle", "move-target"},
    ),
    "in a ball that nothing may enter": (
        in_a_ball(0.17, arm_clearance=0.05, depth=0.0),
        {"ball"},
        {"move-obstacle", "move-target"},
    ),
}


# Its causes and repairs are those of the ball that nothing may enter.
LIKE_ANOTHER = {"in a ball": pytest.mark.slow}


@pytest.fixture(
    scope="module", params=[pytest.param(name, marks=LIKE_ANOTHER.get(name, ())) for name in CASES]
)
def case(request: pytest.FixtureRequest) -> tuple[World, Explanation, set[str], set[str]]:
    world, causes, repairs = CASES[request.param]
    found = why(world, world.task[0])
    assert found is not None
    return world, found, causes, repairs


def test_causes_are_those_that_one_would_name(case: tuple[World, Explanation, set[str], set[str]]) -> None:
    _, found, causes, repairs = case
    assert found.verdict == "unreachable"
    assert {cause.name for cause in found.causes} == causes
    assert repairs <= {repair.kind for repair in found.repairs}


def test_causes_rule_it_out_together_and_no_fewer_do(
    case: tuple[World, Explanation, set[str], set[str]],
) -> None:
    world, found, _, _ = case
    names = {cause.name for cause in found.causes}

    def answer(kept: set[str]) -> str:
        left = world
        for one in arm_constraints_of(scene_of(world)):
            if one.name not in kept:
                left = one.relax(scene_of(left)).world
        return str(reach(left, left.task).verdict[0])

    assert answer(names) == "unreachable"
    for name in names:
        assert answer(names - {name}) == "reachable"


@pytest.mark.slow
def test_repairs_help_and_smaller_ones_do_not(case: tuple[World, Explanation, set[str], set[str]]) -> None:
    world, found, _, _ = case
    for repair in found.repairs:
        changed = repaired(scene_of(world), repair)
        assert reach(changed.world, changed.task).reachable.all(), repair.text
        for less in smaller(world, repair)[2::4]:
            assert not reach(less, less.task).reachable.any(), repair.text


def test_a_plan_says_so_too() -> None:
    world = CASES["looking back over the base"][0]
    with pytest.raises(NoPlanFound, match="This is a proof: with these no posture") as failure:
        plan(world)
    assert "self" in {cause.kind for cause in failure.value.explanation.causes}
