"""What stands on a base, and on its lifts, rejects places as the footprint does, from within and outside."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.affinity import affine_transform

import regionik as rik
from regionik.planners.driving.footprint import fits, slide_is_free
from regionik.scene import scene_of
from regionik.worlds.arrays import transform_points
from regionik.worlds.body import (
    BodyPrism,
    fixed_prisms,
    lift_for,
    lift_range,
    lifted_prisms,
    pivot_discs,
)
from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import Chain
from regionik.worlds.errors import FileNote, NoPlanFound
from regionik.worlds.joints import Joint
from regionik.worlds.links import BASE, LinkBox, LinkCapsule, LinkHull
from regionik.worlds.obstacles import Box, Cylinder, Mesh, Prism, Sphere
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, Rules, Target, World
from tests import examples
from tests.kinds import LinkSolid, Solid
from tests.maths import Array, pose, translation

FLOOR = Floor([[-4, -4], [4, -4], [4, 4], [-4, 4]])
TABLE = Box("table top", np.array([1.6, 0.8, 0.04]), np.array([1.0, 0.5, 0.73]), 0.3)


def with_column(
    robot: Robot, x: float = -0.1, y: float = 0.05, low: float = 0.14, high: float = 0.9
) -> Robot:
    size, middle = np.array([0.12, 0.2, high - low]), translation(x, y, (low + high) / 2)
    return replace(robot, base_solids=(LinkBox(BASE, "column", middle, size),))


def on_lift(robot: Robot, travel: float = 0.4) -> Robot:
    """The same arm on a lift, which carries a torso."""
    lift = Joint("lift", "prismatic", 0.0, travel, np.eye(4))
    torso = LinkBox(0, "torso", translation(0.0, 0.0, 0.25), np.array([0.3, 0.3, 0.3]))
    solids = (torso, *(replace(solid, link=solid.link + 1) for solid in robot.solids))
    chain = Chain((lift, *robot.chain.joints), robot.chain.T_last_tool)
    carry = np.concatenate([[0.0], robot.carry])
    return replace(robot, chain=chain, solids=solids, carry=carry, masses=(), visuals=())


def world(robot: Robot, *solids: Solid, target: tuple[float, float, float] = (1.0, 0.5, 0.3)) -> World:
    return World("w", robot, FLOOR, solids, (Target(np.array(target)),), Rules(clearance=0.05))


def placed(prism: BodyPrism, base: Array) -> shapely.Polygon:
    c, s = np.cos(base[2]), np.sin(base[2])
    return affine_transform(shapely.Polygon(prism.outline), [c, -s, s, c, base[0], base[1]])


def body_shadow(solid: Solid, prism: BodyPrism) -> shapely.Geometry:
    shadow = solid.shadow(prism.high, prism.low)
    return shapely.Point() if shadow is None else shadow.shape(64)


# --- prisms


@st.composite
def some_solid(draw: st.DrawFn) -> LinkSolid:
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    kind = draw(st.sampled_from(["box", "upright", "capsule", "hull"]))
    T = pose(rng.uniform(-0.5, 0.5, 3).tolist(), rng.uniform(-3, 3, 3).tolist())
    if kind == "box":
        return LinkBox(BASE, "s", T, rng.uniform(0.05, 0.8, 3))
    if kind == "upright":
        return LinkBox(BASE, "s", translation(*T[:3, 3]), rng.uniform(0.05, 0.8, 3))
    if kind == "capsule":
        return LinkCapsule(BASE, "s", T[:3, 3], T[:3, 3] + rng.uniform(-0.5, 0.5, 3), rng.uniform(0.02, 0.3))
    return LinkHull(BASE, "s", rng.uniform(-0.5, 0.5, (12, 3)))


@given(some_solid(), st.integers(0, 2**32 - 1))
@settings(max_examples=examples(60))
def test_a_solid_lies_in_its_outer_prisms_and_holds_its_inner_ones(solid: LinkSolid, seed: int) -> None:
    robot = replace(robot_named("youbot"), base_solids=(solid,))
    rng = np.random.default_rng(seed)
    corners = solid.corners
    weights = rng.dirichlet(np.full(len(corners), 0.3), 200)
    ball = rng.normal(size=(200, 3))
    ball *= (solid.radius * rng.random((200, 1)) ** (1 / 3)) / np.linalg.norm(ball, axis=1)[:, None]
    inside = weights @ corners + ball
    outer = fixed_prisms(robot, inside=False)
    for point in inside:
        assert any(
            one.low - 1e-9 <= point[2] <= one.high + 1e-9
            and shapely.Polygon(one.outline).distance(shapely.Point(point[:2])) < 1e-9
            for one in outer
        )
    for one in fixed_prisms(robot, inside=True):
        shape = shapely.Polygon(one.outline)
        spots = [*shape.exterior.coords, (shape.centroid.x, shape.centroid.y)]
        for z in (one.low, (one.low + one.high) / 2, one.high):
            assert all(solid.depth(np.array([x, y, z])) > -1e-9 for x, y in spots)


def test_an_upright_box_is_one_prism_from_either_side() -> None:
    robot = with_column(robot_named("youbot"))
    (outer,), (inner,) = (fixed_prisms(robot, inside=inside) for inside in (False, True))
    assert (outer.low, outer.high) == pytest.approx((0.14, 0.9))
    assert shapely.Polygon(outer.outline).area == pytest.approx(0.12 * 0.2)
    assert shapely.Polygon(outer.outline).symmetric_difference(shapely.Polygon(inner.outline)).area < 1e-12


@given(some_solid(), st.integers(0, 2**32 - 1))
@settings(max_examples=examples(60))
def test_the_link_on_a_pivot_holds_its_discs_however_it_turns(solid: LinkSolid, seed: int) -> None:
    rng, plain = np.random.default_rng(seed), robot_named("youbot")
    middle = translation(*(rng.normal(0.0, 0.02, 3) - solid.corners.mean(axis=0)))
    link = solid.moved(0, middle)
    assert not pivot_discs(replace(plain, solids=(link,)))  # the outermost may touch its target
    robot = replace(plain, solids=(link, plain.solids[-1]))
    discs = pivot_discs(robot)
    assert discs
    for turn in rng.uniform(-3, 3, 8):
        joints = np.concatenate([[turn], np.zeros(robot.chain.dof - 1)])
        T_link_base = np.linalg.inv(robot.T_base_arm @ robot.chain.frames(joints)[0])
        for one in discs:
            rims = [[x, y, z] for x, y in one.outline for z in (one.low, one.high)]
            assert all(link.depth(spot) > -1e-9 for spot in transform_points(T_link_base, np.array(rims)))


def test_no_base_stands_where_the_link_on_its_pivot_would_be_in_a_table_top() -> None:
    """The base is 0.14 m high and fits under the top, the arm's first link stands from 0.27 to 0.48 m."""
    low = Box("low table", np.array([1.6, 0.8, 0.04]), np.array([1.0, 0.5, 0.35]))
    robot = replace(robot_named("youbot"), mount=np.array([0.0, 0.0, 0.3, 0.0]))
    here = world(robot, low, target=(1.0, 0.3, 0.5))
    area = rik.admissible_area(here, here.task[0])
    assert area.inner.area > 0
    assert area.outer.intersection(shapely.box(0.2, 0.1, 1.8, 0.9)).area == 0.0


def test_what_a_lift_carries_takes_up_all_its_travel_and_surely_what_is_there_at_each_height() -> None:
    robot = on_lift(robot_named("youbot"), travel=0.1)
    rise = float(robot.mount[2])
    assert lift_range(robot) == (0.0, 0.1)
    (around,), (sure,) = (lifted_prisms(robot, (0.0, 0.1), inside=inside) for inside in (False, True))
    assert (around.low - rise, around.high - rise) == pytest.approx((0.1, 0.5))
    assert (sure.low - rise, sure.high - rise) == pytest.approx((0.2, 0.4))
    assert not lifted_prisms(on_lift(robot_named("youbot")), (0.0, 0.4), inside=True)


def test_a_target_allows_the_lifts_that_bring_the_tool_to_its_height() -> None:
    robot = on_lift(robot_named("youbot"))
    rng = np.random.default_rng(0)
    postures = rng.uniform(robot.chain.lower, robot.chain.upper, (500, robot.chain.dof))
    heights = robot.tool(np.zeros(3), postures)[:, 2, 3]
    for posture, z in zip(postures, heights.tolist(), strict=True):
        lift = lift_for(robot, z)
        assert lift is not None
        assert lift[0] - 1e-9 <= posture[0] <= lift[1] + 1e-9
    assert lift_for(robot, 5.0) is None


# --- shadows between heights


@pytest.mark.parametrize("band", [(0.3, 0.1), (0.55, 0.45), (2.0, 0.9), (0.2, -1.0)])
def test_a_mesh_has_the_shadow_of_what_it_is_a_mesh_of(band: tuple[float, float]) -> None:
    size, center = np.array([0.4, 0.6, 1.0]), np.array([0.2, 0.1, 0.5])
    made = trimesh.creation.box(size, translation(*center))
    mesh, box = Mesh("m", made.vertices, made.faces).shadow(*band), Box("b", size, center).shadow(*band)
    assert mesh is not None
    assert box is not None
    assert mesh.core.symmetric_difference(box.core).area < 1e-6


def test_a_tube_of_mesh_keeps_its_hole_between_heights() -> None:
    made = trimesh.creation.annulus(0.3, 0.5, 2.0)
    shadow = Mesh("tube", made.vertices, made.faces).shadow(0.5, -0.5)
    assert shadow is not None
    assert not shadow.core.contains(shapely.Point(0, 0))
    assert shadow.core.area == pytest.approx(np.pi * (0.25 - 0.09), rel=0.02)


def test_a_ball_is_as_wide_as_it_is_between_two_heights() -> None:
    ball = Sphere("ball", 0.5, np.array([0.0, 0.0, 1.0]))
    for below, above, expected in ((0.7, 0.0, 0.4), (9.0, 1.3, 0.4), (1.2, 0.9, 0.5)):
        shadow = ball.shadow(below, above)
        assert shadow is not None
        assert shadow.radius == pytest.approx(expected)
    assert ball.shadow(0.5) is None


def test_what_only_touches_a_height_has_no_shadow_there() -> None:
    rug = Box("pipe", np.array([1, 1, 0.2]), np.array([0, 0, -0.1]))
    assert rug.shadow(0.14, 0.0) is None


# --- areas


@pytest.mark.parametrize("name", ["youbot", "youbot-real"])
def test_inner_floors_keep_columns_off_tables_and_outer_ones_leave_nothing_out(name: str) -> None:
    lamp = Cylinder("lamp", 0.05, 0.5, np.array([-1.5, -1.0, 0.9]))
    post = Cylinder("post", 0.05, 2.0, np.array([-1.5, 0.5, 1.0]))
    ball = Sphere("ball", 0.3, np.array([-1.0, 1.5, 1.0]))
    corner = shapely.box(-2, -2.5, 2, -2.2) | shapely.box(-2, -2.5, -1.7, 0)
    here = world(with_column(robot_named(name)), TABLE, lamp, post, ball, Prism("desk", corner, 0.7, 0.75))
    (column,) = fixed_prisms(here.robot, inside=False)
    shadows = [body_shadow(solid, column) for solid in here.solids]
    feet = [one.shape(64).buffer(0.05) for one in scene_of(here).ground.shadows]
    outline = shapely.convex_hull(shapely.multipoints(here.robot.footprint))
    rng = np.random.default_rng(1)
    offset = here.robot.mount[:2]
    taken = 0
    for inner, outer in zip(
        scene_of(here).free_floor.by_heading.sides, scene_of(here).free_floor.outer.sides, strict=True
    ):
        low, high = inner.span if np.isfinite(inner.span).all() else (-np.pi, np.pi)
        for x, y in rng.uniform(-3, 3, (40, 2)):
            yaw = rng.uniform(low, high)
            c, s = np.cos(yaw), np.sin(yaw)
            base = np.array([x - c * offset[0] + s * offset[1], y - s * offset[0] - c * offset[1], yaw])
            touches = any(placed(column, base).intersects(shadow) for shadow in shadows)
            assert not (touches and inner.free.contains(shapely.Point(x, y)))
            if not outer.free.contains(shapely.Point(x, y)):
                foot = affine_transform(outline, [c, -s, s, c, base[0], base[1]])
                assert touches or any(foot.intersects(shadow) for shadow in feet)
                taken += touches
    assert taken or name == "youbot-real"


def test_columns_keep_their_clearance_above_and_below_too() -> None:
    shelf = Prism("shelf", shapely.box(0.5, 0.0, 1.5, 1.0), 0.92, 0.95)  # 2 cm over the column
    here = world(with_column(robot_named("youbot")), shelf)
    for clearance, meets in ((0.01, True), (0.05, False)):
        rules = replace(here.rules, arm_clearance=clearance)
        inner = scene_of(replace(here, rules=rules)).ground.inner.free
        assert inner.contains(shapely.Point(1.0, 0.5)) == meets


def test_a_target_over_a_table_is_reached_from_beside_it_alone() -> None:
    robot = robot_named("youbot")
    column = with_column(robot, x=0.0, y=0.0)
    bare, under = (rik.admissible_area(world(one, TABLE), [1.0, 0.5, 0.3]) for one in (robot, column))
    shadow = body_shadow(TABLE, fixed_prisms(column, inside=False)[0])
    assert bare.inner.intersection(shadow).area > 0.5
    assert under.inner.intersection(shadow).area == 0
    assert under.outer.intersection(shadow.buffer(-0.01)).area == 0
    assert under.inner.area > 0.01
    assert ("table top", "column") in {(part.name, part.part) for part in under.causes}
    assert under.inner.difference(under.outer.buffer(1e-9)).area == 0


def test_what_the_footprint_rejects_needs_no_layer_of_the_column() -> None:
    wall = Box("wall", np.array([2.0, 0.1, 2.0]), np.array([0.0, 1.0, 1.0]))
    inside = with_column(robot_named("youbot-real"), x=0.0, y=0.0)
    assert not scene_of(world(inside, wall)).ground.around
    assert len(scene_of(world(inside, wall, TABLE)).ground.around[0].names) == 1


def test_a_torso_on_a_lift_keeps_off_a_board_at_all_heights_that_the_target_allows() -> None:
    robot = on_lift(robot_named("youbot"), travel=0.1)
    board = Prism(
        "board", shapely.box(0.4, -0.5, 1.0, 0.5), 0.45, 0.5
    )  # the torso is 0.1 m lower, or under it
    area = rik.admissible_area(world(robot, board), [0.5, 0.0, 0.3])
    assert area.inner.distance(board.polygon) > 0.15 - 1e-6
    assert area.outer.intersection(board.polygon).area > 0.1
    assert area.inner.area > 0.1
    assert ("board", "torso") in {(part.name, part.part) for part in area.causes}
    shelf = replace(board, bottom=0.3)  # it is in the way at each height of the torso
    under = rik.admissible_area(world(robot, shelf), [0.5, 0.0, 0.3])
    assert under.outer.distance(board.polygon.buffer(-0.16)) > 0


def test_the_base_drives_with_its_column_among_table_tops() -> None:
    here = world(with_column(robot_named("youbot-real")), TABLE)
    room, (column,) = scene_of(here).footprint, fixed_prisms(here.robot, inside=False)
    shadow = body_shadow(TABLE, column)
    rng = np.random.default_rng(2)
    seen = {True: 0, False: 0}
    for start, goal in zip(*rng.uniform([-1, -1.5, -3], [3, 2.5, 3], (2, 300, 3)), strict=True):
        free = bool(slide_is_free(room, start, goal))
        turn = np.remainder(goal[2] - start[2] + np.pi, 2 * np.pi) - np.pi
        ways = start + np.linspace(0, 1, 60)[:, None] * [goal[0] - start[0], goal[1] - start[1], turn]
        if free:
            assert not any(placed(column, base).intersects(shadow) for base in ways)
        clear = [not placed(column, base).buffer(1e-5).intersects(shadow) for base in (start, goal)]
        assert [bool(fits(room, *base)) for base in (start, goal)] == clear
        seen[free] += 1
    assert min(seen.values()) > 20


def test_the_reason_names_the_column_and_why_takes_it_away() -> None:
    wide = Box("table top", np.array([3.0, 3.0, 0.04]), np.array([0.0, 0.0, 0.73]))
    under = world(with_column(robot_named("youbot")), wide, target=(0.0, 0.0, 0.3))
    with pytest.raises(NoPlanFound) as refused:
        rik.plan(under)
    found = refused.value.explanation
    assert found.verdict == "unreachable"
    assert "column of youbot, which the base carries, would touch table top" in found.reason
    names = {cause.name for cause in found.causes}
    assert {"table top", "what stands on the base"} <= names
    answer = rik.reach(under, [[0.0, 0.0, 0.3]])
    assert answer.verdict.tolist() == ["unreachable"]


# --- files

LINK = '<link name="{0}"><collision><origin xyz="{1}"/><geometry>{2}</geometry></collision></link>'
JOINT = (
    '<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/><origin xyz="{4}"/><axis xyz="{5}"/>'
    '<limit lower="{6}" upper="{7}" velocity="1" effort="1"/></joint>'
)


def two_arms(folder: Path, torso: str = '<box size="0.2 0.2 0.6"/>', inertial: str = "") -> Path:
    box = '<box size="0.06 0.06 0.3"/>'
    links = [
        LINK.format("base", "0 0 0.1", '<box size="0.5 0.4 0.2"/>'),
        LINK.format("torso", "0 0 0.3", torso).replace("<collision>", f"{inertial}<collision>", 1),
        *(
            LINK.format(f"{side}_{part}", "0 0 0.15", box)
            for side in ("left", "right")
            for part in ("a", "b")
        ),
    ]
    joints = [JOINT.format("stand", "fixed", "base", "torso", "-0.1 0 0.2", "0 0 1", 0, 0)]
    for side, y in (("left", 0.2), ("right", -0.2)):
        joints += [
            JOINT.format(f"{side}_1", "revolute", "torso", f"{side}_a", f"0.1 {y} 0.5", "0 0 1", -2, 2),
            JOINT.format(f"{side}_2", "revolute", f"{side}_a", f"{side}_b", "0 0 0.3", "0 1 0", -2, 2),
        ]
    path = folder / "two.urdf"
    path.write_text(f'<robot name="two">{"".join(links + joints)}</robot>')
    return path


def test_a_second_arm_stands_on_the_base_as_it_rests(tmp_path: Path) -> None:
    path = two_arms(tmp_path)
    with pytest.warns(FileNote, match=r"joints of the base .*right_1.* stand still"):
        robot = rik.load_robot(path, tip="left_b")
    assert max(solid.corners[:, 2].max() for solid in robot.base_solids) > 1.2
    assert any("right" in solid.name for solid in robot.base_solids)
    path.with_suffix(".srdf").write_text(
        '<robot name="two"><group_state name="home" group="right"><joint name="right_2" value="1.5708"/>'
        "</group_state></robot>"
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FileNote)
        folded = rik.load_robot(path, tip="left_b")
    highest = max(solid.corners[:, 2].max() for solid in folded.base_solids if "right" in solid.name)
    assert highest == pytest.approx(1.03, abs=0.02)


def test_a_torso_without_its_mesh_still_stands_there(tmp_path: Path) -> None:
    inertial = (
        '<inertial><origin xyz="0 0 0.3"/><mass value="10"/><inertia ixx="0.33" iyy="0.33" izz="0.067" '
        'ixy="0" ixz="0" iyz="0"/></inertial>'
    )  # of the solid box
    path = two_arms(tmp_path, '<mesh filename="gone.stl"/>', inertial)
    with pytest.warns(FileNote) as told:
        robot = rik.load_robot(path, tip="left_b")
    assert any(
        "mesh gone.stl" in str(one.message) and "its mass and joints" in str(one.message) for one in told
    )
    outline = shapely.Polygon(robot.footprint)
    for x, y, z in np.array([[x, y, z] for x in (-0.2, 0.0) for y in (-0.1, 0.1) for z in (0.25, 0.8)]):
        held = z < robot.body_height and outline.contains(shapely.Point(x, y))
        assert held or any(solid.depth(np.array([x, y, z])) > 0 for solid in robot.base_solids)
