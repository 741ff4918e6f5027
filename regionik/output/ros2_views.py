"""How a plan's bag is looked at: solids and tool path as markers, and layouts for RViz and Foxglove."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from regionik.output.ros2 import Event, Message, message_text, quaternion, stamp, vector
from regionik.output.urdf import robot_description
from regionik.view.picture import Color
from regionik.view.triangle_meshes import obstacle_mesh
from regionik.worlds.arrays import Array
from regionik.worlds.scene import World

WORLD, ROBOT, PATH = "/world", "/robot_description", "/base_path"
_LAUNCH_TEXT = Path(__file__).with_name("view_launch.txt")
_LINE_STRIP, _TRIANGLE_LIST = 4, 11  # of visualization_msgs/msg/Marker
_LINE_WIDTH = 0.01  # of the tool path [m]
_OPACITY = 0.6  # of solids


def view_files(world: World, frame: str) -> dict[str, str]:
    """Return the robot's description, a launch file, and layouts of RViz and Foxglove, by their names."""
    return {
        "robot.urdf": robot_description(world.robot, world.frames.base_link),
        "view.launch.py": _LAUNCH_TEXT.read_text("utf-8"),
        "plan.rviz": message_text(rviz_config(frame), ".yaml"),
        "foxglove.json": message_text(foxglove_layout(world, frame), ".json"),
    }


def world_events(world: World, frame: str) -> list[Event]:
    """Return what does not move as messages: the robot's description, the solids and the tool path."""
    markers = [
        _marker(solid.name, frame, _TRIANGLE_LIST, mesh.vertices[mesh.faces.ravel()], Color.SOLID, _OPACITY)
        for solid in world.solids
        for mesh in [obstacle_mesh(solid)]
    ]
    path = np.array([target.position for target in world.task])
    markers.append(_marker("tool path", frame, _LINE_STRIP, path, Color.PATH, 1.0))
    description = robot_description(world.robot, world.frames.base_link)
    return [
        Event(0, ROBOT, "std_msgs/msg/String", {"data": description}, stays=True),
        Event(0, WORLD, "visualization_msgs/msg/MarkerArray", {"markers": markers}, stays=True),
    ]


def _marker(name: str, frame: str, kind: int, points: Array, color: int, opacity: float) -> Message:
    """Return a visualization_msgs/msg/Marker of points (n, 3), with all its fields."""
    size = _LINE_WIDTH if kind == _LINE_STRIP else 1.0
    red, green, blue = ((color >> shift & 255) / 255 for shift in (16, 8, 0))
    header = {"stamp": stamp(0), "frame_id": frame}
    return {
        "header": header, "ns": name, "id": 0, "type": kind, "action": 0,
        "pose": {"position": vector(0.0, 0.0), "orientation": quaternion(0.0)},
        "scale": vector(size, size, size),
        "color": {"r": red, "g": green, "b": blue, "a": opacity},
        "lifetime": stamp(0), "frame_locked": False,
        "points": [vector(*point) for point in points.tolist()], "colors": [],
        "texture_resource": "", "texture": {"header": header, "format": "", "data": []},
        "uv_coordinates": [], "text": "", "mesh_resource": "", "mesh_file": {"filename": "", "data": []},
        "mesh_use_embedded_materials": False,
    }  # fmt: skip


def rviz_config(frame: str) -> Message:
    """Return RViz's configuration: grid, robot, solids and tool path, the base's path, seen from above."""
    latched = {"Depth": 1, "Durability Policy": "Transient Local", "Reliability Policy": "Reliable"}
    displays = [
        _display("Grid", "Grid"),
        _display("RobotModel", "Robot", {"Description Source": "Topic"}, ROBOT, latched, "Description Topic"),
        _display("MarkerArray", "World", {}, WORLD, latched),
        _display("Path", "Base path", {"Line Style": "Billboards", "Line Width": 0.01}, PATH, latched),
        _display("TF", "Frames", {"Enabled": False, "Value": False}),
    ]
    camera = {"Class": "rviz_default_plugins/Orbit", "Distance": 5.0, "Pitch": 0.9, "Yaw": 4.7}
    return {
        "Panels": [{"Class": "rviz_common/Displays", "Name": "Displays"}],
        "Visualization Manager": {
            "Displays": displays,
            "Global Options": {"Fixed Frame": frame},
            "Tools": [{"Class": "rviz_default_plugins/MoveCamera"}],
            "Views": {"Current": camera},
        },
    }


def _display(
    kind: str,
    name: str,
    options: Message | None = None,
    topic: str = "",
    quality: Message | None = None,
    key: str = "Topic",
) -> Message:
    about = {"Class": f"rviz_default_plugins/{kind}", "Name": name, "Enabled": True, "Value": True}
    asked = {key: {"Value": topic, **(quality or {})}} if topic else {}
    return {**about, **(options or {}), **asked}


def foxglove_layout(world: World, frame: str) -> Message:
    """Return Foxglove's layout: the scene in three dimensions beside a plot of the joints."""
    robot: Message = {"layerId": "foxglove.Urdf", "label": "Robot", "sourceType": "topic", "topic": ROBOT}
    grid: Message = {
        "layerId": "foxglove.Grid",
        "label": "Grid",
        "frameId": frame,
        "size": 10,
        "divisions": 10,
    }
    layers = {"robot": robot, "grid": grid}
    scene = {
        "followTf": frame,
        "topics": {name: {"visible": True} for name in (WORLD, PATH, "/tf")},
        "layers": {
            name: {**layer, "instanceId": name, "visible": True, "order": k}
            for k, (name, layer) in enumerate(layers.items())
        },
    }
    return {
        "configById": {"3D!scene": scene, "Plot!joints": {"paths": _curves(world.robot.chain.names)}},
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": {"first": "3D!scene", "second": "Plot!joints", "direction": "row", "splitPercentage": 70},
    }


def _curves(names: Sequence[str]) -> list[Message]:
    """The position of each joint over time."""
    return [
        {
            "value": f"/joint_states.position[{k}]",
            "label": name,
            "enabled": True,
            "timestampMethod": "receiveTime",
        }
        for k, name in enumerate(names)
    ]
