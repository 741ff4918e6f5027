"""How far a base is off its floor, or inside a solid: the distance of its worst point, wherever that lies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.affinity import rotate, translate

from regionik.explain.failures import blocked_start
from regionik.planners.geometry.offsets import deepest_inside, farthest_outside
from regionik.scene import scene_of
from regionik.values import Configuration, Motion, Plan
from regionik.verification.verifier import verify
from regionik.worlds.documents.world_file import world_from_document
from regionik.worlds.scene import World
from tests import examples

L_SHAPE = [[-2, -2], [2, -2], [2, 0], [0, 0], [0, 2], [-2, 2]]
GROUNDS = {
    "corner": shapely.Polygon(L_SHAPE),
    "hole": shapely.box(-2, -2, 2, 2) - shapely.box(-0.5, -0.1, 0.5, 0.1),
    "pieces": shapely.MultiPolygon([shapely.box(-2, -2, -0.1, 2), shapely.box(0.1, -2, 2, 2)]),
    "disc": shapely.Point(0, 0).buffer(0.8),
}


@pytest.mark.parametrize("name", GROUNDS)
@given(x=st.floats(-1, 1), y=st.floats(-1, 1), turn=st.floats(0, 180), long=st.floats(0.1, 1))
@settings(max_examples=examples(20))
def test_no_point_of_a_shape_is_farther_out_or_deeper_in(
    name: str, x: float, y: float, turn: float, long: float
) -> None:
    ground = GROUNDS[name]
    shape = translate(rotate(shapely.box(-long, -0.2, long, 0.2), turn, origin=(0, 0)), x, y)
    spots = np.stack(np.meshgrid(*(np.linspace(-2, 2, 81),) * 2), axis=-1).reshape(-1, 2)
    points = shapely.points(spots[shapely.contains_xy(shape, *spots.T)])
    out, deep = farthest_outside(shape, ground), deepest_inside(shape, ground)
    seen_out = float(shapely.distance(points, ground).max(initial=0.0))
    seen_deep = float((ground.covers(points) * shapely.distance(points, ground.boundary)).max(initial=0.0))
    for found, seen in ((out, seen_out), (deep, seen_deep)):
        assert seen <= found + 1e-5
        assert found <= seen + 0.08  # points of the grid are 0.05 apart, and none is on the rim


def standing(world: World, base: tuple[float, float, float]) -> Plan:
    """The plan of a robot that stands somewhere."""
    joints = world.robot.carry
    motion = Motion(
        np.array([base]),
        joints[None],
        np.array(["setpoint"]),
        np.zeros(1, dtype=np.int64),
        np.full(1, np.nan),
    )
    return Plan(world, 0, (Configuration(np.array(base), joints, 0.0, 0, True),), motion, (), 0)


def made(**more: object) -> World:
    return world_from_document(
        {
            "version": 1, "robot": "youbot-real", "task": [{"points": [[0.2, 0.2, 0.3]]}],
            "floor": {"polygon": L_SHAPE}, "rules": {"clearance": 0.0}, **more,
        }
    )  # fmt: skip


def test_a_base_over_an_inner_corner_is_off_the_floor_by_its_farthest_point() -> None:
    ahead = 0.58 / 2 * np.sqrt(0.5)  # of the middle of its front edge, the base heading across the corner
    (found,) = (v for v in verify(standing(made(), (0.0, 0.0, np.pi / 4))).violations if v.kind == "floor")
    assert found.amount == pytest.approx(ahead, abs=1e-3)
    assert f"by {found.amount:.4f} m" in found.text
    start = {"base": [0.0, 0.0, np.pi / 4], "joints": [0.0, 1.5, -1.0, 0.5, 0.0]}
    blocked = blocked_start(scene_of(made(start=start)))
    assert blocked is not None
    assert blocked.causes[0].margin == pytest.approx(ahead, abs=1e-3)


@pytest.mark.parametrize(
    ("solid", "deep"),
    [
        pytest.param({"box": {"center": [-1, -1, 0.1], "size": [0.4, 0.1, 0.2]}}, 0.05, id="within"),
        pytest.param({"box": {"center": [-1, -0.85, 0.1], "size": [0.4, 0.2, 0.2]}}, 0.1, id="partly"),
        pytest.param({"cylinder": {"center": [-1, -1, 0.1], "radius": 0.1, "height": 0.2}}, 0.1, id="round"),
    ],
)
def test_a_base_in_a_solid_is_as_deep_as_its_deepest_point(solid: dict[str, object], deep: float) -> None:
    world = made(obstacles=[{"name": "crate", **solid}])
    (found,) = (v for v in verify(standing(world, (-1.0, -1.0, 0.0))).violations if v.kind == "clearance")
    assert found.amount == pytest.approx(deep, abs=1e-3)
    assert f"{deep:.2f}" in found.text
    near = replace(world, rules=replace(world.rules, clearance=0.3))
    (found,) = (v for v in verify(standing(near, (-1.0, -1.0, 0.0))).violations if v.kind == "clearance")
    assert found.amount == pytest.approx(0.3 + deep, abs=1e-3)


def test_hundreds_of_states_off_the_floor_cost_no_more_than_the_worst() -> None:
    world = made()
    plan = standing(world, (0.0, 0.0, np.pi / 4))
    base = np.linspace([0.0, 0.0, np.pi / 4], [1.5, 1.5, np.pi / 4], 400)
    steps = np.array(["setpoint", *["transit"] * 399])
    motion = Motion(
        base, np.tile(world.robot.carry, (400, 1)), steps, np.zeros(400, dtype=np.int64), np.full(400, np.nan)
    )
    found = [v for v in verify(replace(plan, motion=motion)).violations if v.kind == "floor"]
    assert max(v.amount for v in found) == pytest.approx(1.5 + 0.29 * np.sqrt(0.5), abs=0.3)
