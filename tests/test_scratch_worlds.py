"""Worlds built in Python from `import regionik as rik` alone: lists will do, and values print on one line."""

# mypy: disable-error-code="arg-type"

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

import regionik as rik

ROWS = [
    (0.0, 0.2, 0.0, math.pi / 2, -3.0, 3.0),
    (0.0, 0.0, 0.3, 0.0, 0.0, 3.0),
    (0.0, 0.0, 0.25, 0.0, -2.5, 2.5),
    (0.0, 0.0, 0.15, 0.0, -2.0, 2.0),
]
WEDGE = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]


def arm() -> rik.Robot:
    chain = rik.Chain.from_dh(ROWS)
    solids = [rik.LinkCapsule(k, f"link {k}", [-ROWS[k][2], 0, 0], [-0.05, 0, 0], 0.03) for k in (1, 2)]
    footprint = [[0.2, 0.15], [-0.2, 0.15], [-0.2, -0.15], [0.2, -0.15]]
    return rik.Robot("cart", "omni", footprint, [0.1, 0, 0.1, 0], chain, solids, body_height=0.2)


def hall() -> rik.World:
    return rik.World(
        name="hall",
        robot=arm(),
        floor=rik.Floor([[-1, -2], [4, -2], [4, 2], [-1, 2]]),
        obstacles=[
            rik.Box("crate", [0.4, 0.4, 0.15], [1.2, 0.7, 0.075]),
            rik.Cylinder("post", 0.1, 1.0, [2.5, 1.4, 0.5]),
            rik.Sphere("ball", 0.1, [3, -1.5, 0.1]),
            rik.Prism("shelf", [[3.5, 1], [4, 1], [4, 2]], 0.9, 1.0),
            rik.Mesh("wedge", np.add(WEDGE[0], [3, -1, 0]) * 0.9, WEDGE[1]),
        ],
        task=[rik.Target([0.6 + 0.1 * k, 0, 0.3]) for k in range(5)],
        rules=rik.Rules(clearance=0.05, tool_contact=0.0),
        start=rik.Start([0, 0, 0], [0, 1.0, -0.5, 0]),
    )


def test_a_world_of_lists_is_planned() -> None:
    plan = rik.plan(hall())
    assert rik.verify(plan).ok
    tools = [plan.world.robot.tool(at.base, at.joints)[:3, 3] for at in plan.setpoints]
    np.testing.assert_allclose(tools, [target.position for target in plan.world.task], atol=2e-3)


def test_what_is_left_out_of_a_robot_is_plain() -> None:
    robot = rik.Robot("cart", "omni", [[0, 0]], [0, 0, 0, 0], rik.Chain.from_dh(ROWS), ())
    assert (robot.body_height, robot.carry.tolist()) == (0.14, [0.0, 0.0, 0.0, 0.0])
    above_zero = [(*row[:4], 0.5, 1.0) for row in ROWS]
    robot = rik.Robot("cart", "omni", [[0, 0]], [0, 0, 0, 0], rik.Chain.from_dh(above_zero), ())
    assert robot.carry.tolist() == [0.5] * 4


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (hall, "World('hall', robot='cart', obstacles=5, set_points=5, mode='continuous')"),
        (arm, "Robot('cart', base='omni', joints=4, solids=2)"),
        (lambda: arm().chain, "Chain(joints=<4>, T_last_tool=<4 x 4 array>)"),
        (lambda: hall().floor, "Floor(polygon=<20 m2>, cells=0)"),
        (lambda: hall().obstacles[0], "Box('crate', size=[0.4, 0.4, 0.15], center=[1.2, 0.7, 0.075])"),
        (lambda: hall().obstacles[3], "Prism('shelf', polygon=<Polygon>, bottom=0.9, top=1.0)"),
        (lambda: hall().obstacles[4], "Mesh('wedge', vertices=<4 x 3 array>, faces=<4 x 3 array>)"),
        (lambda: hall().rules, "Rules(clearance=0.05, tool_contact=0.0)"),
        (lambda: hall().start, "Start(base=[0.0, 0.0, 0.0], joints=[0.0, 1.0, -0.5, 0.0])"),
        (lambda: hall().task[1], "Target(position=[0.7, 0.0, 0.3])"),
        (lambda: rik.Criteria(effort=[1, 2]), "Criteria(effort=(1.0, 2.0))"),
    ],
)
def test_values_print_on_one_line(value: Callable[[], object], said: str) -> None:
    assert repr(value()) == said


@pytest.mark.parametrize("name", ["pillar", "depot", "wall"])
def test_bundled_values_print_on_one_short_line(name: str) -> None:
    world = rik.load_world(name)
    parts = [world, world.robot, world.robot.chain, world.floor, world.rules, world.start]
    for value in (*parts, *world.solids, *world.task, *world.robot.solids, *world.robot.chain.joints):
        assert "\n" not in repr(value)
        assert len(repr(value)) < 200


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: rik.Floor([[0, 0], [1, 1], [1, 0], [0, 1]]), "floor: polygon: expected an outline that"),
        (lambda: rik.Floor([[0, 0], [1, 1]]), "floor: polygon: expected at least 3 corners, got 2"),
        (lambda: rik.Rules(clearance=-0.1), "clearance: must be at least 0, got -0.1"),
        (lambda: rik.Rules(step=0.0), "step: must be above 0, got 0"),
        (lambda: rik.Rules(step=math.nan), "step: must be above 0, got nan"),
        (lambda: rik.Rules(mode="parking"), "mode: expected one of continuous, stops, got 'parking'"),
        (lambda: rik.Rules(order="any"), "order: any needs rules.mode: stops"),
        (lambda: rik.Box("b", [1, 1], [0, 0, 0]), "b: size: expected 3 numbers, got shape (2,)"),
        (lambda: rik.Start([0, 0], [0]), "start: base: expected 3 numbers, got shape (2,)"),
        (lambda: rik.Target("here"), "target: position: expected numbers, got 'here'"),
        (
            lambda: rik.World("w", arm(), hall().floor, start=rik.Start([0, 0, 0], [0])),
            "start.joints: expected 4 values (joint_1, joint_2, joint_3, joint_4), got 1",
        ),
        (
            lambda: rik.World("w", arm(), hall().floor, [rik.Sphere("a", 1, [0, 0, 0])] * 2),
            "obstacles[1].name: expected a name of its own, 'a' is obstacles[0]",
        ),
        (
            lambda: rik.Robot("r", "boat", [[0, 0]], [0, 0, 0, 0], arm().chain, ()),
            "base: expected one of omni, differential, car, got 'boat'",
        ),
    ],
)
def test_values_that_cannot_be_are_refused_in_one_line(make: Callable[[], object], said: str) -> None:
    with pytest.raises(rik.InputError) as refused:
        make()
    assert str(refused.value).startswith(said)
    assert "\n" not in str(refused.value)
