"""Plans as ROS 2 messages, in the YAML or JSON that ``ros2 topic pub`` reads.

Fields are those of trajectory_msgs/msg/JointTrajectory and MultiDOFJointTrajectory, and of nav_msgs/msg/Path.
"""

from __future__ import annotations

import json
import re
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from regionik.timing.trajectory import TrajectorySample, is_timed, sample_plan, trajectory
from regionik.values import Plan
from regionik.worlds.arrays import Array
from regionik.worlds.errors import InputError, located
from regionik.worlds.scene import World, check_frame_name

SUFFIXES = (".yaml", ".yml", ".json")
JOINT_TRAJECTORY, PATH = "trajectory_msgs/msg/JointTrajectory", "nav_msgs/msg/Path"
FRAME, BASE = "map", "base"
_SECOND = 1_000_000_000  # [ns]
_PLAIN_KEY = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_OTHER_THAN_TEXT = {"y", "n", "yes", "no", "on", "off", "true", "false", "null"}  # to YAML 1.1

Message = dict[str, Any]


def joint_trajectory(plan: Plan, rate: float | None = None, frame: str = FRAME) -> Message:
    """The arm's motion as a trajectory_msgs/msg/JointTrajectory, of a timed plan.

    Its stamp is zero, which tells controllers to start on receipt. Points come at a ``rate``, by default one
    for each state [1/s]. Times ascend strictly, as controllers require: of rows in the same nanosecond the
    last is kept.
    """
    points = [
        {
            "positions": sample.joints[k].tolist(),
            "velocities": sample.joint_velocity[k].tolist(),
            "accelerations": sample.joint_acceleration[k].tolist(),
            "effort": [],
            "time_from_start": moment,
        }
        for sample, k, moment in _distinct_moments(plan, rate)
    ]
    names = list(plan.world.robot.chain.names)
    return {"header": _header(frame, 0), "joint_names": names, "points": points}


def base_trajectory(plan: Plan, rate: float | None = None, frame: str = FRAME) -> Message:
    """The base's motion as a trajectory_msgs/msg/MultiDOFJointTrajectory, of the same moments as the arm's.

    Its one joint is called `BASE`. Velocities and accelerations are those in the frame, not the base's own.
    """
    points = [
        {
            "transforms": [{"translation": vector(x, y), "rotation": quaternion(yaw)}],
            "velocities": [_twist(sample.base_velocity[k])],
            "accelerations": [_twist(sample.base_acceleration[k])],
            "time_from_start": moment,
        }
        for sample, k, moment in _distinct_moments(plan, rate)
        for x, y, yaw in [sample.base[k].tolist()]
    ]
    return {"header": _header(frame, 0), "joint_names": [BASE], "points": points}


def _distinct_moments(plan: Plan, rate: float | None) -> Iterator[tuple[TrajectorySample, int, Message]]:
    """Samples of a timed plan, the row and its time from the start; of one nanosecond the last row."""
    trajectory(plan)  # raises what is missing where the plan is not timed
    sample = sample_plan(plan, rate).sample
    clock = nanoseconds(sample.time)
    for k in np.flatnonzero(np.append(np.diff(clock) > 0, True)).tolist():
        yield sample, k, stamp(int(clock[k]))


def path_message(plan: Plan, rate: float | None = None, frame: str = FRAME) -> Message:
    """The path of the base as a nav_msgs/msg/Path.

    Stamps of poses count from the start of the plan; they are zero where it is not timed. Poses of a timed
    plan come at a ``rate``, by default one for each state [1/s].
    """
    rows = sample_plan(plan, rate)
    clock = nanoseconds(rows.sample.time if is_timed(plan.motion) else np.zeros(len(rows)))
    poses = [
        {"header": _header(frame, moment), "pose": {"position": vector(x, y), "orientation": quaternion(yaw)}}
        for moment, (x, y, yaw) in zip(clock.tolist(), rows.sample.base.tolist(), strict=True)
    ]
    return {"header": _header(frame, 0), "poses": poses}


def both_messages(plan: Plan, rate: float | None = None, frame: str = FRAME) -> Message:
    """Both messages, each with its type, under ``joint_trajectory`` and ``path``."""
    return {
        "joint_trajectory": {"type": JOINT_TRAJECTORY, "message": joint_trajectory(plan, rate, frame)},
        "path": {"type": PATH, "message": path_message(plan, rate, frame)},
    }


def message_text(message: Message, suffix: str) -> str:
    """A message as a JSON document, or as YAML for any other suffix.

    Parsers of YAML 1.1 read both alike: every float has the decimal point that these require.
    """
    if suffix.lower() == ".json":
        return _flow(message) + "\n"
    return "\n".join(_block(message, "")) + "\n"


def vector(x: float, y: float, z: float = 0.0) -> Message:
    """Fields of geometry_msgs/msg/Vector3 and Point."""
    return {"x": x, "y": y, "z": z}


def quaternion(yaw: float) -> Message:
    """Fields of geometry_msgs/msg/Quaternion of a turn about z."""
    return {"x": 0.0, "y": 0.0, "z": float(np.sin(yaw / 2)), "w": float(np.cos(yaw / 2))}


def _twist(rates: Array) -> Message:
    """Rates of x, y and yaw as the fields of geometry_msgs/msg/Twist."""
    x, y, turn = rates.tolist()
    return {"linear": vector(x, y), "angular": vector(0.0, 0.0, turn)}


def _header(frame: str, clock: int) -> Message:
    with located("", "frame"):
        check_frame_name(frame)
    return {"stamp": stamp(clock), "frame_id": frame}


def nanoseconds(times: Array) -> NDArray[np.int64]:
    """Times (n,) [s], rounded to whole nanoseconds."""
    if len(times) and (times.min() < 0 or times.max() >= 2**31 - 1):
        raise InputError(f"times: expected 0 to {2**31 - 2} s, got {times.min():g} to {times.max():g}")
    # Whole seconds are exact; taken apart, the rest keeps its digits.
    whole = np.floor(times)
    return whole.astype(np.int64) * _SECOND + np.rint((times - whole) * _SECOND).astype(np.int64)


def stamp(clock: int) -> Message:
    """Nanoseconds as the fields of builtin_interfaces/msg/Time and Duration."""
    seconds, rest = divmod(clock, _SECOND)
    return {"sec": seconds, "nanosec": rest}


def _flow(value: Any) -> str:
    match value:
        case dict():
            return "{" + ", ".join(f"{json.dumps(key)}: {_flow(item)}" for key, item in value.items()) + "}"
        case list():
            return "[" + ", ".join(map(_flow, value)) + "]"
        case float():
            text = repr(value)
            # 1e-07 is a number to JSON but a word to YAML 1.1, which wants 1.0e-07.
            return text if "." in text else text.replace("e", ".0e")
        case str():
            # YAML neither joins pairs of surrogates nor takes characters that cannot be printed.
            quoted = json.dumps(value, ensure_ascii=False)
            return "".join(c if c.isprintable() or ord(c) > 0xFFFF else f"\\u{ord(c):04x}" for c in quoted)
        case _:
            return json.dumps(value)


def _key(name: str) -> str:
    """A key as it is where every YAML reads it as that text, else quoted: names of joints may be anything."""
    plain = _PLAIN_KEY.fullmatch(name) and name.lower() not in _OTHER_THAN_TEXT
    return name if plain else _flow(name)


def _block(value: Message, indent: str) -> Iterator[str]:
    """Lines of a YAML mapping; lists of mappings go on in blocks, all that holds no mapping on one line."""
    for name, item in value.items():
        key = _key(name)
        if isinstance(item, list) and item and isinstance(item[0], dict):
            yield f"{indent}{key}:"
            for entry in item:
                first, *others = _block(entry, f"{indent}  ")
                yield f"{indent}- {first.lstrip()}"
                yield from others
        elif isinstance(item, dict) and any(isinstance(part, dict | list) for part in item.values()):
            yield f"{indent}{key}:"
            yield from _block(item, f"{indent}  ")
        elif isinstance(item, dict):
            inside = ", ".join(f"{_key(one)}: {_flow(part)}" for one, part in item.items())
            yield f"{indent}{key}: {{{inside}}}"
        else:
            yield f"{indent}{key}: {_flow(item)}"


class Event(NamedTuple):
    """A message, its type and its topic, at a time from the start [ns]."""

    time: int
    topic: str
    kind: str
    message: Message
    stays: bool = False  # said again to who listens later ("transient local")


def bag_files(events: Sequence[Event]) -> dict[str, bytes]:
    """Return the files of a rosbag2 with MCAP storage, by their names; this needs rosbags."""
    try:
        from rosbags import interfaces as ros
        from rosbags.rosbag2 import StoragePlugin, Writer
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise InputError(f"a bag for ROS 2 needs regionik[ros2]: {error}") from None
    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds = {event.topic: event.kind for event in events}
    stay, never = {event.topic for event in events if event.stays}, ros.QosTime(0, 0)
    latched = ros.Qos(
        ros.QosHistory.KEEP_LAST, 1, ros.QosReliability.RELIABLE, ros.QosDurability.TRANSIENT_LOCAL,
        never, never, ros.QosLiveliness.AUTOMATIC, never, False,
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as place:
        bag = Path(place) / "bag"
        with Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            topics = {
                topic: writer.add_connection(
                    topic, kind, typestore=store, offered_qos_profiles=[latched] if topic in stay else []
                )
                for topic, kind in kinds.items()
            }
            for time, topic, kind, document, _ in events:
                message = _ros_message(store, kind, document)
                writer.write(topics[topic], time, store.serialize_cdr(message, kind))
        return {path.name: path.read_bytes() for path in sorted(bag.iterdir())}


def motion_events(world: World, sample: TrajectorySample, frame: str) -> list[Event]:
    """Return the motion of a world's robot as /tf and /joint_states."""
    robot, frames = world.robot, world.frames
    names = list(robot.chain.names)
    T_base_tool = robot.tool(np.zeros_like(sample.base), sample.joints)
    turns = Rotation.from_matrix(T_base_tool[:, :3, :3]).as_quat()
    found: list[Event] = []
    for k, time in enumerate(nanoseconds(sample.time).tolist()):
        header = {"stamp": stamp(time), "frame_id": frame}
        x, y, yaw = sample.base[k].tolist()
        place = {"translation": vector(x, y), "rotation": quaternion(yaw)}
        moved = {"header": header, "child_frame_id": frames.base_link, "transform": place}
        turn = dict(zip("xyzw", turns[k].tolist(), strict=True))
        tool = {
            "header": {"stamp": stamp(time), "frame_id": frames.base_link},
            "child_frame_id": frames.tool0,
            "transform": {"translation": vector(*T_base_tool[k, :3, 3].tolist()), "rotation": turn},
        }
        joints = {
            "header": {"stamp": stamp(time), "frame_id": ""},
            "name": names,
            "position": sample.joints[k].tolist(),
            "velocity": sample.joint_velocity[k].tolist(),
            "effort": [],
        }
        found.append(Event(time, "/tf", "tf2_msgs/msg/TFMessage", {"transforms": [moved, tool]}))
        found.append(Event(time, "/joint_states", "sensor_msgs/msg/JointState", joints))
    return found


def _ros_message(store: Any, kind: str, document: Message) -> Any:
    """Return a message of a type store, made of a document with all its fields."""
    fields = {name: _field(store, type_, document[name]) for name, type_ in store.fielddefs[kind][1]}
    return store.types[kind](**fields)


def _field(store: Any, type_: Any, value: Any) -> Any:
    """Return a field's value as the store wants it: plain, a message, or a sequence of either."""
    node, inner = type_
    if node.name == "NAME":
        return _ros_message(store, inner, value)
    if node.name not in ("SEQUENCE", "ARRAY"):
        return value
    element, name = inner[0]
    if element.name == "NAME":
        return [_ros_message(store, name, item) for item in value]
    return list(value) if name[0] == "string" else np.array(value, dtype=name[0])
