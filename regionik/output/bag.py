"""Bags for RViz and Foxglove: rosbag2 with MCAP storage. The only file that imports rosbags."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from regionik.output.ros2 import Message, nanoseconds, quaternion, stamp, vector
from regionik.timing.trajectory import TrajectorySample
from regionik.worlds.errors import InputError
from regionik.worlds.scene import World


class Event(NamedTuple):
    """A message, its type and its topic, at a time from the start [ns]."""

    time: int
    topic: str
    kind: str
    message: Message


def bag_files(events: Sequence[Event]) -> dict[str, bytes]:
    """Return the files of a rosbag2 with MCAP storage, by their names; this needs rosbags."""
    try:
        from rosbags.rosbag2 import StoragePlugin, Writer
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise InputError(f"a bag for ROS 2 needs regionik[ros2]: {error}") from None
    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds = {event.topic: event.kind for event in events}
    with tempfile.TemporaryDirectory() as place:
        bag = Path(place) / "bag"
        with Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            topics = {
                topic: writer.add_connection(topic, kind, typestore=store) for topic, kind in kinds.items()
            }
            for time, topic, kind, document in events:
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
