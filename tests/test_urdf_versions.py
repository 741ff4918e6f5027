"""What URDF 1.1 and 1.2 added, limits of drives, and meshes: read as they are meant, or refused or told."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from regionik.cli import console
from regionik.output.urdf import robot_to_urdf
from regionik.timing.limits import MotionLimits
from regionik.worlds.documents.robots import robot_to_document
from regionik.worlds.documents.world_file import load_world, world_from_document, world_to_document
from regionik.worlds.errors import FileNote, InputError, RobotNote
from regionik.worlds.limits import Speeds
from regionik.worlds.links import LinkCapsule
from regionik.worlds.readers.meshes import read_geometries
from regionik.worlds.robot import Robot
from regionik.worlds.urdf.loader import load_robot
from tests.urdfs import crane

pytestmark = pytest.mark.filterwarnings("ignore::regionik.worlds.errors.RobotNote")

ELBOW_ORIGIN, FORE_ORIGIN = 'rpy="0.1 0.2 0.3"', 'rpy="0.2 0.3 0.4"'
ELBOW_LIMIT = '<limit lower="-1.5" upper="2" effort="1" velocity="0"/>'
LIFT_LIMIT = '<limit lower="0.05" upper="0.35" effort="1" velocity="0.07"/>'


def quaternion(*rpy: float) -> str:
    return f'quat_xyzw="{" ".join(map(repr, Rotation.from_euler("xyz", rpy).as_quat().tolist()))}"'


def test_quaternions_say_the_same_as_angles(tmp_path: Path) -> None:
    """Of joints, and of collision elements."""
    changes = (ELBOW_ORIGIN, quaternion(0.1, 0.2, 0.3)), (FORE_ORIGIN, quaternion(0.2, 0.3, 0.4))
    by_angles = load_robot(crane(tmp_path / "rpy"), tip="tool")
    turned = load_robot(crane(tmp_path / "quaternion", *changes), tip="tool")
    joints = np.array([0.1, 0.4, -0.7])
    np.testing.assert_allclose(turned.chain.frames(joints), by_angles.chain.frames(joints), atol=1e-12)
    boxes = [next(one for one in r.solids if one.name == "fore 1") for r in (turned, by_angles)]
    np.testing.assert_allclose(boxes[0].corners, boxes[1].corners, atol=1e-12)


VISUAL = '<visual><geometry><box size="9 9 9"/></geometry></visual>'
SEEN = '<visual><origin rot="0 0 1"/><geometry><box size="9 9 9"/></geometry></visual>'


@pytest.mark.parametrize(("old", "new", "told"), [
    (ELBOW_ORIGIN, 'rpyw="0.1 0.2 0.3"', "joint elbow: origin: unknown attribute 'rpyw', valid ones: xyz"),
    (FORE_ORIGIN, 'euler="0 0 1"', "link fore: origin: unknown attribute 'euler', valid ones: xyz"),
    (VISUAL, SEEN, "link torso: origin: unknown attribute 'rot'"),
    (ELBOW_ORIGIN, f'{ELBOW_ORIGIN} quat_xyzw="0 0 0 1"', "elbow: origin: expected one of rpy, quat_xyzw"),
    (ELBOW_ORIGIN, 'quat_xyzw="0 0 0 2"', "joint elbow: origin quat_xyzw: expected a unit quaternion"),
    (ELBOW_ORIGIN, 'quat_xyzw="0 0 1"', "origin quat_xyzw: expected 4 finite numbers"),
    ('<axis xyz="0 1 1"/>', '<axis xyz="0 1 1" rpy="1 0 0"/>', "joint elbow: axis: unknown attribute 'rpy'"),
    ('radius="0.05" length="0.6"', 'radius="0.05" length="0.6" axis="x"', "unknown attribute 'axis'"),
    ('multiplier="1"', 'multiplyer="1"', "joint grip_too: mimic: unknown attribute 'multiplyer'"),
    ('scale="0.001 0.001 0.001"', 'unit="mm"', "link upper: mesh: unknown attribute 'unit'"),
])  # fmt: skip
def test_what_may_place_or_size_things_otherwise_is_refused(
    old: str, new: str, told: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=r": line \d+: ") as caught:
        load_robot(crane(tmp_path, (old, new)), tip="tool")
    assert told in str(caught.value)


def test_a_capsule_stays_one(tmp_path: Path) -> None:
    path = crane(tmp_path, ('<sphere radius="0.04"/>', '<capsule radius="0.04" length="0.1"/>'))
    found = next(one for one in load_robot(path, tip="tool").solids if one.name == "fore 2")
    assert isinstance(found, LinkCapsule)
    assert found.radius == 0.04
    np.testing.assert_allclose(found.corners, [[0.2, 0, -0.05], [0.2, 0, 0.05]], atol=1e-12)


@pytest.mark.parametrize(("rpy", "extent", "top"), [
    ("0 0 0", (0.6, 0.6), 0.75), ("0 1.5707963267948966 0", (1.0, 0.6), 0.55),
])  # fmt: skip
def test_a_capsule_is_a_base(rpy: str, extent: tuple[float, float], top: float, tmp_path: Path) -> None:
    """Of radius 0.3 m and 1 m over all, its middle 0.25 m above the floor, upright and lying."""
    box = '<origin xyz="0 0 0.2"/><geometry><box size="0.6 0.4 0.2"/></geometry>'
    capsule = f'<origin xyz="0 0 0.2" rpy="{rpy}"/><geometry><capsule radius="0.3" length="0.4"/></geometry>'
    wheel = '<collision><geometry><cylinder radius="0.1" length="0.04"/></geometry></collision>'
    robot = load_robot(crane(tmp_path, (box, capsule), (wheel, "")), tip="tool", root="floor")
    assert robot.body_height == pytest.approx(top, abs=1e-9)
    np.testing.assert_allclose(np.ptp(robot.footprint, axis=0), extent, rtol=0.01)


def safety(limit: str, *soft: str) -> tuple[str, str]:
    return limit, f'{limit}<safety_controller k_velocity="20" {" ".join(soft)}/>'


LOW, HIGH = 'soft_lower_limit="{}"', 'soft_upper_limit="{}"'


@pytest.mark.parametrize(("soft", "expected"), [
    ((LOW.format(-0.2), HIGH.format(1.5)), (-0.2, 1.5)), ((LOW.format(-9), HIGH.format(9)), (-1.5, 2.0)),
    ((HIGH.format(1),), (-1.5, 1.0)), ((), (-1.5, 2.0)), ((LOW.format(0), HIGH.format(0)), (-1.5, 2.0)),
])  # fmt: skip
def test_soft_limits_count_where_they_are_given(
    soft: tuple[str, ...], expected: tuple[float, float], tmp_path: Path
) -> None:
    chain = load_robot(crane(tmp_path, safety(ELBOW_LIMIT, *soft)), tip="tool").chain
    assert (chain.lower[-1], chain.upper[-1]) == expected


def test_soft_limits_without_room_are_refused(tmp_path: Path) -> None:
    path = crane(tmp_path, safety(LIFT_LIMIT, LOW.format(0.3), HIGH.format(0.2)))
    with pytest.raises(InputError, match=r"joint lift: expected lower limit <= upper limit, got 0.3 and 0.2"):
        load_robot(path, tip="tool")


def accelerating(folder: Path, extra: str = 'acceleration="0.3" deceleration="0.2"') -> Robot:
    limit = ELBOW_LIMIT.replace("/>", f" {extra}/>")
    return load_robot(crane(folder, (ELBOW_LIMIT, limit)), tip="tool")


def test_accelerations_of_limits_are_kept_by_timing(tmp_path: Path) -> None:
    robot = accelerating(tmp_path)
    assert Speeds().joint_limits(robot.chain)[1].tolist() == [
        0.14,
        4.0,
        0.2,
    ]  # else full speed in half a second
    assert MotionLimits(robot, Speeds(joint_velocity=1.5)).joint_acceleration.tolist() == [3.0, 3.0, 0.2]
    assert Speeds(joint_acceleration=0.7).joint_limits(robot.chain)[1].tolist() == [0.7] * 3  # as asked
    plain = load_robot(crane(tmp_path / "plain"), tip="tool")
    assert Speeds().joint_limits(plain.chain)[1].tolist() == [0.14, 4.0, 2.0]


def test_a_joint_keeps_the_acceleration_of_what_follows_it(tmp_path: Path) -> None:
    limit = ELBOW_LIMIT.replace("/>", ' acceleration="0.2"/><mimic joint="lift" multiplier="-4"/>')
    chain = load_robot(crane(tmp_path, (ELBOW_LIMIT, limit)), tip="tool").chain
    assert chain.names == ("lift", "pivot")
    assert Speeds().joint_limits(chain)[1].tolist() == [0.05, 4.0]


def test_worlds_and_exports_keep_accelerations(tmp_path: Path) -> None:
    document = {
        "version": 1, "robot": robot_to_document(accelerating(tmp_path)), "task": [{"points": [[0.5, 0, 1]]}],
        "floor": {"polygon": [[-2, -2], [2, -2], [2, 2], [-2, 2]]},
    }  # fmt: skip
    again = world_from_document(world_to_document(world_from_document(document)))
    assert [joint.acceleration for joint in again.robot.chain.joints] == [np.inf, np.inf, 0.2]
    (tmp_path / "again.urdf").write_text(robot_to_urdf(again.robot, again.floor.polygon))
    exported = load_robot(tmp_path / "again.urdf", root="base", tip="tool")
    assert [joint.acceleration for joint in exported.chain.joints] == [np.inf, np.inf, 0.2]


def test_limits_of_jerk_are_told(tmp_path: Path) -> None:
    with pytest.warns(
        RobotNote, match=r"limits of jerk \(elbow\) are kept only where speeds.joint_jerk asks"
    ):
        accelerating(tmp_path, 'jerk="1.0"')


DAE = """<COLLADA><asset><unit meter="0.001"/></asset><library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a">{points}</float_array></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="{count}"><input semantic="VERTEX" source="#v" offset="0"/><p>{faces}</p></triangles>{more}
</mesh></geometry></library_geometries></COLLADA>"""


def bracket(folder: Path, suffix: str, more: str = "") -> Path:
    """A crane whose upper arm is an L of two boxes [mm]."""
    parts = [trimesh.creation.box((300.0, 40.0, 40.0)), trimesh.creation.box((40.0, 40.0, 300.0))]
    parts[1].apply_translation((170.0, 0.0, 130.0))
    mesh: Any = trimesh.util.concatenate(parts)
    scale = "1 1 1" if suffix == ".dae" else "0.001 0.001 0.001"  # COLLADA files know their unit
    path = crane(folder, ("upper.stl", f"l{suffix}"), ("0.001 0.001 0.001", scale))
    if suffix == ".dae":
        points, faces = (" ".join(map(repr, a.ravel().tolist())) for a in (mesh.vertices, mesh.faces))
        text = DAE.format(points=points, faces=faces, count=len(mesh.faces), more=more)
        (path.parent / "meshes" / "l.dae").write_text(text)
    else:
        mesh.export(path.parent / "meshes" / f"l{suffix}")
    return path


def test_collada_meshes_are_cut_as_others_are(tmp_path: Path) -> None:
    kinds = {}
    for suffix in (".dae", ".stl"):
        robot = load_robot(bracket(tmp_path / suffix[1:], suffix), tip="tool")
        kinds[suffix] = [(type(one), one.name) for one in robot.solids]
    assert kinds[".dae"] == kinds[".stl"]
    assert [name for _, name in kinds[".dae"] if name.startswith("upper")] == ["upper part 1", "upper part 2"]


@pytest.mark.parametrize("more", [
    '<tristrips count="1"/>', '<polygons count="1"><ph><p>0 1 2</p><h>3 4 5</h></ph></polygons>',
    '<triangles count="1"><p>0 1 2</p></triangles>',
])  # fmt: skip
def test_collada_faces_that_are_not_read_leave_the_hull(more: str, tmp_path: Path) -> None:
    path = bracket(tmp_path, ".dae", more)
    ((points, faces),) = read_geometries(path.parent / "meshes" / "l.dae")
    assert faces is None
    assert len(points) == 16
    upper = [one.name for one in load_robot(path, tip="tool").solids if one.name.startswith("upper")]
    assert upper == ["upper"]


SCALE = 'scale="0.001 0.001 0.001"'


def test_links_in_millimetres_are_told(tmp_path: Path) -> None:
    with pytest.warns(FileNote, match=r"crane.urdf: link upper is 400 m in size: perhaps in millimetres"):
        load_robot(crane(tmp_path, (SCALE, "")), tip="tool")


def test_every_command_tells_odd_sizes(tmp_path: Path) -> None:
    """What else is left out of a robot is told by ``plan`` alone."""
    crane(tmp_path, (SCALE, ""))
    (tmp_path / "w.yaml").write_text(
        "version: 1\nrobot: {urdf: crane/crane.urdf, tip: tool}\n"
        "floor: {polygon: [[-2, -2], [2, -2], [2, 2], [-2, 2]]}\ntask: [{points: [[0.5, 0, 1]]}]\n"
    )
    with pytest.warns(FileNote, match="upper is 400 m in size") as told:
        console.read_world(str(tmp_path / "w.yaml"), console.DelayedProgress())
    assert not any(issubclass(note.category, RobotNote) for note in told)


def test_obstacles_in_millimetres_are_told(tmp_path: Path) -> None:
    trimesh.creation.box((50.0, 30.0, 20.0)).apply_translation((0, 9, 10)).export(tmp_path / "clamp.stl")
    world = (
        "version: 1\nrobot: youbot\nfloor: {polygon: [[-2, -2], [2, -2], [2, 2], [-2, 2]]}\n"
        "task: [{points: [[0.5, 0, 30.3]]}]\n"
        "obstacles: [{name: clamp, mesh: {file: clamp.stl, scale: SCALE}}]\n"
    )
    (tmp_path / "w.yaml").write_text(world.replace("SCALE", "1.0"))
    with pytest.warns(FileNote, match=r"w.yaml: obstacle clamp is 50 m in size: perhaps in millimetres"):
        load_world(tmp_path / "w.yaml")
    (tmp_path / "w.yaml").write_text(world.replace("SCALE", "0.001"))
    load_world(tmp_path / "w.yaml")  # a warning would be an error
