from __future__ import annotations

import csv
import dataclasses
import json
import os
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import regionik as rik
from regionik.cli.plan import EXPORT_FORMATS
from regionik.output.export import FORMATS, export
from regionik.output.urdf import robot_to_urdf, roll_pitch_yaw
from regionik.timing.limits import tool_velocity
from regionik.timing.trajectory import TrajectorySample, trajectory
from regionik.values import Plan
from regionik.worlds.chain import Chain
from regionik.worlds.errors import InputError
from regionik.worlds.joints import Joint
from regionik.worlds.links import LinkBox, LinkCapsule
from regionik.worlds.robot import Robot
from tests.maths import Array, pose
from tests.plans import FOOTPRINT, every_solid, l_shape, synthetic_plan, timed, youbot


@pytest.fixture(scope="module")
def plan() -> Plan:
    return synthetic_plan(l_shape())


def awkward() -> Robot:
    """Tilted frames, a slide, an endless joint, a half-limited one, a joint that stands at gimbal lock."""
    rng = np.random.default_rng(5)
    frames = []
    for k in range(4):
        T = np.eye(4)
        T[:3, :3] = Rotation.from_euler(
            "xyz", [0.3, np.pi / 2, 0.7] if k == 2 else rng.uniform(-3, 3, 3)
        ).as_matrix()
        T[:3, 3] = rng.uniform(-0.3, 0.3, 3)
        frames.append(T)
    joints = (
        Joint("turn", "revolute", -np.inf, np.inf, frames[0], rng.normal(size=3)),
        Joint("lift", "prismatic", -0.2, 0.4, frames[1], rng.normal(size=3), velocity=0.5),
        Joint("bend", "revolute", -1.0, np.inf, frames[2], rng.normal(size=3)),
    )
    solids = (
        LinkCapsule(1, "rail", np.zeros(3), np.array([0.1, -0.2, 0.2]), 0.03),
        LinkBox(2, "upright", pose([0.0, 0.1, 0.2], [0.3, np.pi / 2, 0.7]), np.array([0.1, 0.2, 0.3])),
        LinkBox(2, "askew", pose([-0.1, 0.0, 0.3], [3.0, -0.4, -2.0]), np.array([1e-3, 0.2, 0.05])),
    )
    mount = np.array([0.1, -0.2, 0.4, 0.8])
    return Robot(
        "awkward", "omni", np.array(FOOTPRINT), mount, Chain(joints, frames[3]), solids, 0.3, np.zeros(3)
    )


def _numbers(text: str) -> Array:
    return np.array([float(word) for word in text.split()])


def _frame(element: ElementTree.Element) -> Array:
    origin = element.find("origin")
    T = np.eye(4)
    if origin is not None:
        T[:3, :3] = Rotation.from_euler("xyz", _numbers(origin.attrib["rpy"])).as_matrix()
        T[:3, 3] = _numbers(origin.attrib["xyz"])
    return T


def _link_of(root: ElementTree.Element, robot: Robot, k: int) -> ElementTree.Element:
    name = f"{robot.chain.names[k]}_link"
    (link,) = (element for element in root.iter("link") if element.attrib["name"] == name)
    return link


def link_frame(root: ElementTree.Element, link: str, values: dict[str, float]) -> Array:
    """Pose of a link by walking from it to the root: an independent reading of URDF."""
    T = np.eye(4)
    while link != "world":
        (joint,) = (j for j in root.iter("joint") if j.find("child").attrib["link"] == link)  # type: ignore[union-attr]
        move = np.eye(4)
        if joint.attrib["type"] != "fixed":
            axis = _numbers(joint.find("axis").attrib["xyz"]) * values[joint.attrib["name"]]  # type: ignore[union-attr]
            if joint.attrib["type"] == "prismatic":
                move[:3, 3] = axis
            else:
                move[:3, :3] = Rotation.from_rotvec(axis).as_matrix()
        T = _frame(joint) @ move @ T
        link = joint.find("parent").attrib["link"]  # type: ignore[union-attr]
    return T


@pytest.mark.parametrize("robot", [youbot(), youbot(FOOTPRINT, (0.143, 0.0, 0.11, 0.2)), awkward()])
def test_the_urdf_moves_as_the_robot_does(robot: Robot) -> None:
    root = ElementTree.fromstring(robot_to_urdf(robot, shapely.box(-5, -5, 5, 5)))
    rng = np.random.default_rng(1)
    for _ in range(100):
        base, joints = rng.uniform(-4, 4, 3), rng.uniform(-3, 3, robot.chain.dof)
        values = dict(
            zip(("base_x", "base_y", "base_yaw", *robot.chain.names), [*base, *joints], strict=True)
        )
        assert np.abs(link_frame(root, "tool", values) - robot.tool(base, joints)).max() < 1e-9


@pytest.mark.parametrize("robot", [youbot(), awkward()])
def test_a_capsule_is_a_cylinder_and_two_balls_at_its_ends(robot: Robot) -> None:
    root = ElementTree.fromstring(robot_to_urdf(robot, shapely.box(-5, -5, 5, 5)))
    for solid in (solid for solid in robot.solids if isinstance(solid, LinkCapsule)):
        link = _link_of(root, robot, solid.link)
        (side,) = (c for c in link.findall("collision") if c.find("geometry/cylinder") is not None)
        cylinder = side.find("geometry/cylinder")
        assert cylinder is not None
        half = float(cylinder.attrib["length"]) / 2
        ends = [(_frame(side) @ [0, 0, z, 1])[:3] for z in (-half, half)]
        found = link.findall("collision")
        balls = [_frame(c)[:3, 3] for c in found if c.find("geometry/sphere") is not None]
        assert np.allclose(ends, [solid.start, solid.end], atol=1e-12)
        assert np.allclose(balls, [solid.start, solid.end], atol=1e-12)


def test_a_box_stays_a_box_on_its_link() -> None:
    robot = awkward()
    root = ElementTree.fromstring(robot_to_urdf(robot, shapely.box(-5, -5, 5, 5)))
    boxes = [solid for solid in robot.solids if isinstance(solid, LinkBox)]
    assert len(boxes) == 2
    count = [len(_link_of(root, robot, k).findall("collision")) for k in range(3)]
    assert count == [0, 3, len(boxes)]
    for box in boxes:
        found = _link_of(root, robot, box.link).findall("collision")
        (shape,) = (c for c in found if c.attrib["name"] == box.name)
        size = _numbers(shape.find("geometry/box").attrib["size"])  # type: ignore[union-attr]
        assert np.array_equal(size, box.size)
        assert np.abs(_frame(shape) - box.T_link_box).max() < 1e-12


@pytest.mark.parametrize(("radius", "length"), [(0.075, 0.02), (0.01, 0.4), (0.3, 0.05)])
def test_a_cylinder_comes_back_as_it_was(tmp_path: Path, radius: float, length: float) -> None:
    path = tmp_path / "pad.urdf"
    path.write_text(
        '<robot name="pad"><link name="base"/><link name="pad"><collision><origin xyz="0.1 0.2 0.3" '
        f'rpy="0.4 0.5 0.6"/><geometry><cylinder radius="{radius}" length="{length}"/></geometry></collision>'
        '</link><joint name="turn" type="continuous"><parent link="base"/><child link="pad"/></joint></robot>'
    )
    robot = rik.load_robot(path, tip="pad")
    text = robot_to_urdf(robot, shapely.box(-1, -1, 1, 1))
    (cylinder,) = ElementTree.fromstring(text).findall(".//collision/geometry/cylinder")
    assert float(cylinder.attrib["radius"]) == pytest.approx(radius, abs=1e-9)
    assert float(cylinder.attrib["length"]) == pytest.approx(length, abs=1e-9)
    path.write_text(text)
    again = rik.load_robot(path, root="base", tip="tool")
    assert np.abs(again.solids[0].corners - robot.solids[0].corners).max() < 1e-9


@pytest.mark.parametrize("robot", [awkward(), youbot()])
def test_what_collides_is_seen_in_colour(robot: Robot) -> None:
    root = ElementTree.fromstring(robot_to_urdf(robot, shapely.box(-5, -5, 5, 5)))
    assert root.find("link/visual") is not None
    for link in root.iter("link"):
        seen, solid = link.findall("visual"), link.findall("collision")
        assert len(seen) == len(solid)
        for one, other in zip(seen, solid, strict=True):
            assert one.find("material/color") is not None
            for part in ("origin", "geometry"):
                found = (element.find(part) for element in (one, other))
                texts = (ElementTree.tostring(element) for element in found if element is not None)
                assert len({ElementTree.canonicalize(text, strip_text=True) for text in texts}) == 1


def test_urdf_limits_and_base() -> None:
    root = ElementTree.fromstring(robot_to_urdf(awkward(), shapely.box(-1, -2, 3, 4)))
    kinds = {j.attrib["name"]: j.attrib["type"] for j in root.iter("joint")}
    assert kinds["base_yaw"] == kinds["turn"] == "continuous"
    assert (kinds["base_x"], kinds["lift"], kinds["bend"], kinds["mount"]) == (
        "prismatic",
        "prismatic",
        "revolute",
        "fixed",
    )
    limits = {
        j.attrib["name"]: limit.attrib for j in root.iter("joint") if (limit := j.find("limit")) is not None
    }
    assert (float(limits["base_y"]["lower"]), float(limits["base_y"]["upper"])) == (-2.0, 4.0)
    assert (float(limits["lift"]["lower"]), float(limits["lift"]["velocity"])) == (-0.2, 0.5)
    assert all(np.isfinite(float(v)) for limit in limits.values() for v in limit.values())
    box = root.find("link[@name='base']/collision/geometry/box")
    assert box is not None
    assert np.allclose(_numbers(box.attrib["size"]), [0.58, 0.38, 0.3])
    point = ElementTree.fromstring(robot_to_urdf(youbot(), shapely.box(0, 0, 1, 1)))
    assert point.find("link[@name='base']/collision") is None


def test_names_of_the_virtual_joints_are_ours() -> None:
    robot = youbot()
    joints = (dataclasses.replace(robot.chain.joints[0], name="base_x"), *robot.chain.joints[1:])
    taken = dataclasses.replace(robot, chain=Chain(joints, robot.chain.T_last_tool))
    with pytest.raises(InputError, match="joint base_x cannot be exported"):
        robot_to_urdf(taken, shapely.box(0, 0, 1, 1))


@given(st.tuples(*[st.floats(-7, 7)] * 3), st.sampled_from([None, np.pi / 2, -np.pi / 2]))
def test_roll_pitch_yaw_comes_back(angles: tuple[float, float, float], pitch: float | None) -> None:
    if pitch is not None:
        angles = (angles[0], pitch, angles[2])
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("xyz", angles).as_matrix()
    back = Rotation.from_euler("xyz", roll_pitch_yaw(T)).as_matrix()
    assert np.abs(back - T[:3, :3]).max() < 1e-9


def test_csv_has_one_row_a_state(plan: Plan, tmp_path: Path) -> None:
    export(plan, tmp_path / "plan.csv", "csv")
    rows = list(csv.DictReader((tmp_path / "plan.csv").read_text().splitlines()))
    assert len(rows) == len(plan.motion)
    for k, (row, state, tool) in enumerate(zip(rows, plan.motion, plan.tools(), strict=True)):
        assert (int(row["index"]), row["kind"], row["time"]) == (k, state.kind, "")
        assert row["setpoint"] == ("" if state.setpoint is None else str(state.setpoint))
        assert [float(row[f"base_{c}"]) for c in ("x", "y", "yaw")] == state.base.tolist()
        assert [float(row[name]) for name in plan.world.robot.chain.names] == state.joints.tolist()
        assert [float(row[f"tool_{c}"]) for c in "xyz"] == tool.tolist()


@pytest.mark.parametrize("world", [l_shape(), every_solid()])
def test_geojson_has_areas_path_and_points(world: object, tmp_path: Path) -> None:
    plan = synthetic_plan(world)  # type: ignore[arg-type]
    export(plan, tmp_path / "plan.geojson", "geojson")
    features = json.loads((tmp_path / "plan.geojson").read_text())["features"]
    by_part: dict[str, list[dict[str, object]]] = {}
    for feature in features:
        by_part.setdefault(feature["properties"]["part"], []).append(feature)
    count = len(plan.world.task)
    assert {part: len(found) for part, found in by_part.items()} == {
        "admissible": count,
        "pruned": count,
        "rejected": count,
        "base-path": 1,
        "setpoint": count,
    }
    for part in ("admissible", "pruned", "rejected"):
        for k, feature in enumerate(by_part[part]):
            assert feature["properties"] == {"part": part, "setpoint": k}
            assert shapely.equals(shapely.geometry.shape(feature["geometry"]), getattr(plan.areas[k], part))
    path = shapely.geometry.shape(by_part["base-path"][0]["geometry"])
    assert np.array_equal(shapely.get_coordinates(path), plan.motion.base[:, :2])
    points = [shapely.geometry.shape(f["geometry"]) for f in by_part["setpoint"]]
    assert np.array_equal(
        shapely.get_coordinates(points, include_z=True), [t.position for t in plan.world.task]
    )


def test_an_unknown_format_names_the_valid_ones(plan: Plan, tmp_path: Path) -> None:
    assert tuple(FORMATS) == EXPORT_FORMATS
    with pytest.raises(InputError, match=f"format dxf: expected one of {', '.join(FORMATS)}"):
        export(plan, tmp_path / "plan.dxf", "dxf")
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("format", [name for name, one in FORMATS.items() if not one.folder])
def test_the_same_plan_gives_the_same_bytes(format: str, tmp_path: Path) -> None:
    for name in ("a.yaml", "b.yaml"):
        export(timed(synthetic_plan(l_shape())), tmp_path / name, format)
    assert (tmp_path / "a.yaml").read_bytes() == (tmp_path / "b.yaml").read_bytes()


def test_csv_of_a_timed_plan_goes_on_with_velocities_and_accelerations(tmp_path: Path) -> None:
    plan = timed(synthetic_plan(l_shape()))
    export(plan, tmp_path / "timed.csv", "csv")
    export(synthetic_plan(l_shape()), tmp_path / "plain.csv")
    rows = list(csv.DictReader((tmp_path / "timed.csv").read_text().splitlines()))
    (plain, *others) = (tmp_path / "plain.csv").read_text().splitlines()
    moving = ["base_x", "base_y", "base_yaw", *plan.world.robot.chain.names]
    more = [f"{name}_{what}" for what in ("velocity", "acceleration") for name in moving]
    assert list(rows[0]) == [*plain.split(","), *more, "tool_speed"]
    assert len(rows) == len(others) == len(plan.motion)
    sample = trajectory(plan).sample(plan.motion.time)
    found = np.array([[float(row[name]) for name in more] for row in rows])
    parts = [sample.base_velocity, sample.joint_velocity, sample.base_acceleration, sample.joint_acceleration]
    assert np.array_equal(found, np.hstack(parts))
    assert np.array_equal([float(row["time"]) for row in rows], plan.motion.time)
    for row, state in zip(rows, plan.motion, strict=True):
        assert [float(row[name]) for name in moving] == [*state.base.tolist(), *state.joints.tolist()]


def test_csv_at_a_rate_says_where_on_the_way_it_is(tmp_path: Path) -> None:
    plan = timed(synthetic_plan(l_shape()))
    export(plan, tmp_path / "even.csv", "csv", rate=50.0)
    rows = list(csv.DictReader((tmp_path / "even.csv").read_text().splitlines()))
    times, motion = np.array([float(row["time"]) for row in rows]), plan.motion
    assert np.allclose(np.diff(times[:-1]), 0.02)
    assert times[-1] == motion.time[-1]
    assert (rows[0]["kind"], rows[0]["setpoint"]) == ("transit", "")
    assert (rows[-1]["kind"], rows[-1]["setpoint"]) == ("setpoint", str(len(plan.world.task) - 1))
    for row, time in zip(rows[1:-1], times[1:-1], strict=True):
        ahead = int(np.searchsorted(motion.time, time))
        lifted = "transit" in motion.kind[ahead - 1 : ahead + 1]
        assert row["kind"] == ("transit" if lifted else "step")
        passed = motion.setpoint[:ahead][motion.kind[:ahead] == "setpoint"]
        assert row["setpoint"] == ("" if lifted else str(passed[-1]))


@pytest.mark.parametrize("robot", [youbot(FOOTPRINT, (0.143, 0.0, 0.11, 0.2)), awkward()])
def test_the_tool_moves_as_its_positions_do(robot: Robot) -> None:
    rng = np.random.default_rng(3)
    base, joints, drive, bend = (rng.uniform(-2, 2, (20, n)) for n in (3, robot.chain.dof) * 2)
    sample = TrajectorySample(np.zeros(20), base, joints, drive, bend, 0 * drive, 0 * bend)
    half = 1e-6
    ends = [robot.tool(base + s * drive, joints + s * bend)[:, :3, 3] for s in (-half, half)]
    assert np.abs(tool_velocity(robot, *sample.columns[:2]) - (ends[1] - ends[0]) / (2 * half)).max() < 1e-7


def test_geojson_of_a_timed_plan_says_when_the_base_is_where(tmp_path: Path) -> None:
    plan = timed(synthetic_plan(l_shape()))
    export(plan, tmp_path / "plan.geojson", "geojson")
    features = json.loads((tmp_path / "plan.geojson").read_text())["features"]
    (path,) = (f for f in features if f["properties"]["part"] == "base-path")
    times, line = path["properties"]["time"], np.array(path["geometry"]["coordinates"])
    assert times == plan.motion.time.tolist()
    assert np.abs(line - plan.motion.base[:, :2]).max() < 1e-9
