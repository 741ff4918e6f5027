"""The folder for ROS 2: its messages go over the wire and back, its script leads a base, its bag is read."""

from __future__ import annotations

import json
import math
import sys
import types
from dataclasses import replace
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from shapely.geometry import box

from regionik.cli.app import run
from regionik.output.export import export
from regionik.output.ros2 import bag_files, base_trajectory, message_text
from regionik.output.ros2_folder import arm_parameters, base_parameters, planning_scene, ros2_files
from regionik.timing.trajectory import sample_plan, trajectory
from regionik.values import Motion, Plan
from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import Chain
from regionik.worlds.errors import InputError, RobotNote
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Floor, FrameNames, World
from regionik.worlds.toolpath import rotation_from_quaternion
from regionik.worlds.urdf.loader import load_robot
from tests.maths import Array
from tests.plans import every_solid, l_shape, synthetic_plan, timed

# The interface of MoveIt's messages as far as the folder uses them.
COLLISION_OBJECT = """std_msgs/Header header
geometry_msgs/Pose pose
string id
shape_msgs/SolidPrimitive[] primitives
geometry_msgs/Pose[] primitive_poses
shape_msgs/Mesh[] meshes
geometry_msgs/Pose[] mesh_poses
"""
ROBOT_TRAJECTORY = """trajectory_msgs/JointTrajectory joint_trajectory
trajectory_msgs/MultiDOFJointTrajectory multi_dof_joint_trajectory
"""
STORE = get_typestore(Stores.ROS2_HUMBLE)
STORE.register(get_types_from_msg(COLLISION_OBJECT, "moveit_msgs/msg/CollisionObject"))
STORE.register(get_types_from_msg(ROBOT_TRAJECTORY, "moveit_msgs/msg/RobotTrajectory"))
PLAIN = {"string": "", "bool": False}
ROBOTS = ("youbot", "youbot-real", "pioneer-parm", "hinge5", "pioneer7")


def message(kind: str, document: dict[str, Any]) -> Any:
    """A message of the store; what the document lacks has its default, as with ``ros2 topic pub``."""
    fields = STORE.fielddefs[kind][1]
    assert set(document) <= {name for name, _ in fields}
    return STORE.types[kind](**{name: value_of(type_, document.get(name)) for name, type_ in fields})


def value_of(type_: Any, given: Any) -> Any:
    node, inner = type_[0].name, type_[1]
    if node == "NAME":
        return message(inner, given or {})
    if node == "BASE":
        return PLAIN.get(inner[0], 0) if given is None else given
    (element, of), _ = inner
    items = given if given is not None else []
    if element.name == "NAME":
        return [message(of, item) for item in items]
    return list(items) if of[0] == "string" else np.array(items, dtype=of[0])


def over_the_wire(kind: str, document: dict[str, Any]) -> Any:
    return STORE.deserialize_cdr(STORE.serialize_cdr(message(kind, document), kind), kind)


def seconds(moment: Any) -> float:
    return float(moment.sec + 1e-9 * moment.nanosec)


@pytest.fixture(scope="module")
def plan() -> Plan:
    return timed(synthetic_plan(l_shape()))


@pytest.fixture(scope="module")
def folder(plan: Plan, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("ros") / "cell"
    export(plan, path, "ros2-folder", rate=20.0, frame="odom")
    return path


def document(folder: Path, name: str) -> dict[str, Any]:
    read: dict[str, Any] = yaml.safe_load((folder / f"{name}.yaml").read_text("utf-8"))
    return read


@pytest.mark.parametrize("name", ROBOTS)
def test_messages_read_back_are_the_plan(name: str, tmp_path: Path) -> None:
    plan = driving(robot_named(name))
    export(plan, tmp_path / "cell", "ros2-folder", rate=20.0, frame="odom")
    both = over_the_wire("moveit_msgs/msg/RobotTrajectory", document(tmp_path / "cell", "robot_trajectory"))
    arm, base = both.joint_trajectory, both.multi_dof_joint_trajectory
    path = over_the_wire("nav_msgs/msg/Path", document(tmp_path / "cell", "base_path"))
    times = np.array([seconds(point.time_from_start) for point in arm.points])
    assert np.array_equal(times, [seconds(point.time_from_start) for point in base.points])
    assert np.array_equal(times, [seconds(pose.header.stamp) for pose in path.poses])
    assert (base.joint_names, base.header.frame_id, path.header.frame_id) == (["base"], "odom", "odom")
    now = sample_plan(plan, 20.0).sample
    assert np.ptp(now.base[:, 0]) > 0.1
    assert np.ptp(now.joints) > 0.1
    far = [times - now.time]
    for k, (joint, moved, stop) in enumerate(zip(arm.points, base.points, path.poses, strict=True)):
        (place,), (rate,), (gain,) = moved.transforms, moved.velocities, moved.accelerations
        far += [joint.positions - now.joints[k], joint.velocities - now.joint_velocity[k]]
        far += [joint.accelerations - now.joint_acceleration[k]]
        far += [[twist.linear.x, twist.linear.y, twist.angular.z] - planned for twist, planned in (
            (rate, now.base_velocity[k]), (gain, now.base_acceleration[k])
        )]  # fmt: skip
        for spot, turn in ((place.translation, place.rotation), (stop.pose.position, stop.pose.orientation)):
            yaw = math.remainder(2 * math.atan2(turn.z, turn.w) - now.base[k, 2], 2 * math.pi)
            far.append(np.array([spot.x - now.base[k, 0], spot.y - now.base[k, 1], yaw]))
    assert np.abs(np.concatenate(far)).max() < 1e-9


def driving(robot: Robot) -> Plan:
    """A timed plan of a robot that drives ahead, turns and drives on, its arm moving all the time."""
    turn = np.linspace(0.0, 0.9, 4)[1:]
    base = [[x, 0.0, 0.0] for x in (0.0, 0.1, 0.2, 0.3)] + [[0.3, 0.0, yaw] for yaw in turn]
    base += [[0.3 + s * np.cos(0.9), s * np.sin(0.9), 0.9] for s in (0.1, 0.2, 0.3)]
    joints = robot.carry + np.linspace(0.0, 0.3, len(base))[:, None]
    kind, setpoint = np.array(["step"] * len(base)), np.zeros(len(base), dtype=np.int64)
    motion = Motion(np.array(base), joints, kind, setpoint, np.full(len(base), np.nan))
    made = synthetic_plan(l_shape())
    return timed(replace(made, world=replace(made.world, robot=robot, start=None), motion=motion))


def test_every_solid_is_in_the_scene() -> None:
    world = every_solid()
    scene = planning_scene(world, "map")
    assert scene["is_diff"]
    assert scene["robot_state"]["is_diff"]
    objects = scene["world"]["collision_objects"]
    assert [one["id"] for one in objects] == [solid.name for solid in world.solids]
    for solid, one in zip(world.solids, objects, strict=True):
        read = over_the_wire("moveit_msgs/msg/CollisionObject", one)
        low, high = solid.bounds
        assert len(read.primitives) + len(read.meshes) == 1
        if read.meshes:
            corners = np.array([[spot.x, spot.y, spot.z] for spot in read.meshes[0].vertices])
            assert np.abs([corners.min(0) - low, corners.max(0) - high]).max() < 1e-9
            assert max(triangle.vertex_indices.max() for triangle in read.meshes[0].triangles) < len(corners)
        else:
            middle = read.primitive_poses[0].position
            assert np.abs([middle.x, middle.y, middle.z] - (low + high) / 2).max() < 1e-9


def test_the_bag_is_read(plan: Plan, folder: Path) -> None:
    way = trajectory(plan)
    with Reader(folder / "bag") as bag:
        kinds = {connection.topic: connection.msgtype for connection in bag.connections}
        moved = {"/arm_trajectory", "/base_trajectory", "/base_path", "/tf", "/joint_states"}
        assert set(kinds) == moved | {"/robot_description", "/world"}
        seen = dict.fromkeys(kinds, 0)
        for connection, time, raw in bag.messages():
            read: Any = STORE.deserialize_cdr(raw, connection.msgtype)
            seen[connection.topic] += 1
            if connection.topic == "/joint_states":
                now = way.sample([min(time * 1e-9, way.duration)])
                assert np.abs(read.position - now.joints[0]).max() < 1e-8
                assert seconds(read.header.stamp) == pytest.approx(time * 1e-9, abs=1e-9)
            if connection.topic == "/tf":
                base, tool = read.transforms
                assert (base.child_frame_id, tool.child_frame_id) == ("base_link", "tool0")
                assert tool.header.frame_id == "base_link"
                now = way.sample([min(time * 1e-9, way.duration)])
                T_world_tool = plan.world.robot.tool(now.base[0], now.joints[0])
                assert np.abs(matrix(base.transform) @ matrix(tool.transform) - T_world_tool).max() < 1e-8
    assert seen["/tf"] == seen["/joint_states"] == len(document(folder, "base_path")["poses"])
    assert seen["/arm_trajectory"] == seen["/base_trajectory"] == seen["/base_path"] == 1


def test_any_reader_of_mcap_opens_the_bag(folder: Path) -> None:
    (path,) = (folder / "bag").glob("*.mcap")
    with path.open("rb") as file:
        read = [
            (schema and schema.name, channel.topic, one.log_time, one.data)
            for schema, channel, one in make_reader(file).iter_messages()
        ]
    with Reader(folder / "bag") as bag:
        same = [(one.msgtype, one.topic, time, bytes(raw)) for one, time, raw in bag.messages()]
    assert sorted(same) == sorted(read, key=lambda row: (row[0] or "", *row[1:]))
    assert len({topic for _, topic, _, _ in read}) == 7


def matrix(transform: Any) -> Array:
    """A geometry_msgs/Transform as (4, 4)."""
    place, turn = transform.translation, transform.rotation
    T = np.eye(4)
    T[:3, :3] = rotation_from_quaternion([turn.x, turn.y, turn.z, turn.w])
    T[:3, 3] = place.x, place.y, place.z
    return T


def test_parameters_name_the_robot(plan: Plan, folder: Path) -> None:
    arm = document(folder, "ros2_control")["arm_controller"]["ros__parameters"]
    assert arm["joints"] == list(plan.world.robot.chain.names)
    assert set(arm["joints"]) < set(arm["constraints"])
    follow = document(folder, "nav2")["controller_server"]["ros__parameters"]["FollowPath"]
    assert follow["motion_model"] == "Omni"
    assert follow["vx_max"] == document(folder, "settings")["base_velocity"] > 0


def script(folder: Path) -> Any:
    """The script as a module; what it needs of ROS it imports in its main function."""
    text = (folder / "execute_plan.py").read_text("utf-8")
    module = types.ModuleType("execute_plan")
    module.__file__ = str(folder / "execute_plan.py")
    exec(compile(text, "execute_plan.py", "exec"), module.__dict__)
    return module


@pytest.mark.parametrize("drive", ["omni", "differential", "car"])
def test_the_script_leads_a_base_along_its_trajectory(drive: str, folder: Path) -> None:
    module = script(folder)
    times = np.arange(0.0, 8.0, 0.05)
    speed, turn = 0.3, 0.2
    rows = [
        (
            t,
            speed / turn * math.sin(turn * t),
            speed / turn * (1 - math.cos(turn * t)),
            turn * t,
            speed * math.cos(turn * t),
            speed * math.sin(turn * t),
            turn,
        )
        for t in times.tolist()
    ]
    x, y, yaw = 0.05, -0.04, 0.1
    for t in np.arange(0.0, times[-1], 0.02).tolist():
        row = module.row_at(rows, t)
        ahead, left, spin = module.limited(module.base_command(row, (x, y, yaw), drive), (0.6, 1.0))
        assert drive == "omni" or left == 0.0
        x += 0.02 * (ahead * math.cos(yaw) - left * math.sin(yaw))
        y += 0.02 * (ahead * math.sin(yaw) + left * math.cos(yaw))
        yaw += 0.02 * spin
    assert math.hypot(x - rows[-1][1], y - rows[-1][2]) < 0.02
    assert abs(yaw - rows[-1][3]) < 0.03


def test_the_script_reads_the_base_of_its_folder(plan: Plan, folder: Path) -> None:
    rows = script(folder).rows_of(document(folder, "base_trajectory"))
    assert rows == script(folder).rows_of(base_trajectory(plan, 20.0))
    assert rows[-1][0] == pytest.approx(trajectory(plan).duration)


def test_the_script_knows_when_the_tool_is_on_its_path(plan: Plan, folder: Path) -> None:
    module, spans = script(folder), document(folder, "settings")["tool_on"]
    motion = plan.motion
    assert len(spans) == 2  # with the lift-off in the middle
    said = [module.is_on(spans, time) for time in motion.time.tolist()]
    assert said == (motion.kind != "transit").tolist()
    assert not module.is_on(spans, -1.0)
    assert not module.is_on(spans, motion.time[-1] + 1.0)


@pytest.mark.parametrize("name", ROBOTS)
def test_names_and_drives_of_robots_come_through(name: str) -> None:
    robot = robot_named(name)
    arm = arm_parameters(robot)["arm_controller"]["ros__parameters"]
    assert arm["joints"] == list(robot.chain.names)
    world = World("one", robot, Floor(box(-1, -1, 1, 1)), frames=FrameNames(base_link="cart/base_link"))
    found = base_parameters(world, "map")
    costmap = found["local_costmap"]["local_costmap"]["ros__parameters"]
    assert (costmap["global_frame"], costmap["robot_base_frame"]) == ("map", "cart/base_link")
    follow = found["controller_server"]["ros__parameters"]["FollowPath"]
    assert (follow["vy_max"] > 0) == (robot.base == "omni")


NAMES = ["Achse 1: Dreh", "J2 & <up>", "关节3", "it's #4", "on", "12", "1e3", "- a", "null", "a b", "{x", '"']


@pytest.mark.parametrize("loader", [yaml.SafeLoader, yaml.CSafeLoader])
def test_joints_may_have_any_names(loader: Any) -> None:
    """Parameters are YAML whose keys are those names, whichever parser reads them."""
    rows = [(0.0, 0.0, 0.1, 0.0, -1.0, 1.0)] * len(NAMES)
    robot = Robot("odd", "omni", np.zeros((1, 2)), np.zeros(4), Chain.from_dh(rows, NAMES), ())
    parameters = arm_parameters(robot)
    assert yaml.load(message_text(parameters, ".yaml"), Loader=loader) == parameters
    constraints = parameters["arm_controller"]["ros__parameters"]["constraints"]
    assert set(NAMES) < set(constraints)


def test_a_folder_is_new_and_the_same_bytes_again(plan: Plan, folder: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="expected the name of a new folder, this is there already"):
        export(plan, folder, "ros2-folder")
    export(plan, tmp_path / "again", "ros2-folder", rate=20.0, frame="odom")
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            assert path.read_bytes() == (tmp_path / "again" / path.relative_to(folder)).read_bytes(), path
    with pytest.raises(InputError, match="there"):
        export(plan, tmp_path / "no" / "where", "ros2-folder")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["again"]


def test_the_robot_is_described_as_it_is_moved(plan: Plan) -> None:
    robot, frames = plan.world.robot, plan.world.frames
    described = ros2_files(plan)["robot.urdf"]
    assert isinstance(described, str)
    with NamedTemporaryFile("w", suffix=".urdf") as file:
        file.write(described)
        file.flush()
        with pytest.warns(RobotNote, match="inside joint_5_link"):
            again = load_robot(file.name, tip="tool")
        assert ElementTree.parse(file.name).find("link").get("name") == frames.base_link  # type: ignore[union-attr]
    states = sample_plan(plan, 5.0).sample
    assert again.tool(states.base, states.joints) == pytest.approx(robot.tool(states.base, states.joints))
    taken = replace(frames, base_link="arm_base")
    with pytest.raises(InputError, match="base_link: arm_base is a link of the arm"):
        ros2_files(replace(plan, world=replace(plan.world, frames=taken)))


def test_layouts_show_what_the_bag_holds(plan: Plan, tmp_path: Path) -> None:
    world = replace(plan.world, obstacles=every_solid().obstacles)
    files = ros2_files(replace(plan, world=world), frame="odom")
    for name, content in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    said: dict[str, Any] = {}
    with Reader(tmp_path / "bag") as bag:
        kept: dict[str, Any] = {one.topic: one.ext for one in bag.connections}
        for one, _, data in bag.messages():
            said[one.topic] = STORE.deserialize_cdr(data, one.msgtype)
    assert said["/robot_description"].data == files["robot.urdf"]
    seen = yaml.safe_load(files["plan.rviz"])["Visualization Manager"]
    assert seen["Global Options"]["Fixed Frame"] == "odom"
    shown = [one.get("Topic", one.get("Description Topic")) for one in seen["Displays"]]
    shown = [one for one in shown if one]
    assert len(shown) == 3
    for asked in shown:
        (offered,) = kept[asked["Value"]].offered_qos_profiles
        assert (asked["Durability Policy"], offered.durability.name) == ("Transient Local", "TRANSIENT_LOCAL")
    panels = json.loads(files["foxglove.json"])["configById"]
    scene = panels["3D!scene"]
    assert {*scene["topics"], scene["layers"]["robot"]["topic"]} <= set(said)
    assert [one["label"] for one in panels["Plot!joints"]["paths"]] == list(world.robot.chain.names)
    *solids, path = said["/world"].markers
    assert [one.ns for one in solids] == [solid.name for solid in world.solids]
    for one, solid in zip(solids, world.solids, strict=True):
        corners = np.array([[p.x, p.y, p.z] for p in one.points])
        assert len(corners) % 3 == 0
        assert np.stack([corners.min(0), corners.max(0)]) == pytest.approx(solid.bounds, abs=0.03)
    assert [[p.x, p.y, p.z] for p in path.points] == [one.position.tolist() for one in world.task]


def test_the_launch_file_starts_what_the_folder_holds(plan: Plan, tmp_path: Path, monkeypatch: Any) -> None:
    started = list[dict[str, Any]]()
    stand_ins: dict[str, dict[str, Any]] = {
        "launch": {"LaunchDescription": list},
        "launch.actions": {"ExecuteProcess": lambda **asked: started.append(asked)},
        "launch_ros": {},
        "launch_ros.actions": {"Node": lambda **asked: started.append(asked)},
    }
    for name, members in stand_ins.items():
        module = types.ModuleType(name)
        module.__dict__.update(members)
        monkeypatch.setitem(sys.modules, name, module)
    export(plan, tmp_path / "cell", "ros2-folder", rate=5.0)
    path = tmp_path / "cell" / "view.launch.py"
    scope: dict[str, Any] = {"__file__": str(path)}
    exec(compile(path.read_text(), str(path), "exec"), scope)
    scope["generate_launch_description"]()
    publisher, rviz, player = started
    assert publisher["parameters"][0]["robot_description"] == (tmp_path / "cell/robot.urdf").read_text()
    assert all(Path(one).exists() for one in (rviz["arguments"][1], player["cmd"][3]))


def test_the_command_and_what_it_lacks(
    plan: Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file, made = tmp_path / "timed.json", tmp_path / "cell"
    plan.save(file)
    assert run(["export", str(file), "--format", "ros2-folder", "--rate", "5", "-o", str(made)]) == 0
    assert "execute_plan.py" in {path.name for path in made.iterdir()}
    assert run(["export", str(file), "--format", "ros2-folder", "-o", str(made)]) == 2
    assert "expected the name of a new folder" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "rosbags.rosbag2", None)
    with pytest.raises(InputError, match=r"a bag for ROS 2 needs regionik\[ros2\]"):
        bag_files([])
    with pytest.raises(InputError, match="it is not timed"):
        ros2_files(synthetic_plan(l_shape()))
