"""A timed plan as a folder for ROS 2: messages of arm, base and world, parameters, a script and a bag."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from regionik.output.ros2 import (
    FRAME,
    Event,
    Message,
    bag_files,
    base_trajectory,
    joint_trajectory,
    message_text,
    motion_events,
    path_message,
    quaternion,
    vector,
)
from regionik.output.ros2_views import view_files, world_events
from regionik.timing.trajectory import PlanSamples, sample_plan
from regionik.values import Plan
from regionik.view.triangle_meshes import obstacle_mesh
from regionik.worlds.arrays import Array
from regionik.worlds.limits import Speeds
from regionik.worlds.obstacles import Box, Cylinder, Mesh, Prism, Solid, Sphere
from regionik.worlds.robot import Robot
from regionik.worlds.scene import World

RATE = 50.0  # of trajectories, where none is asked for [1/s]
ARM, BASE_MOTION, PATH, SCENE = "arm_trajectory", "base_trajectory", "base_path", "planning_scene"
EXTRUSION = "extrusion"
SCRIPT = "execute_plan.py"
_SCRIPT_TEXT = Path(__file__).with_name("execute_plan.txt")
# Of nav2's MPPI controller.
_MOTION_MODELS = {"omni": "Omni", "differential": "DiffDrive", "car": "Ackermann"}
_MAX_JOINT_ERROR = 0.05  # joint error at which the arm's controller gives up [rad], [m]
_GOAL_TOLERANCE = 0.01  # joint error that counts as arrived [rad], [m]
_MAX_DELAY = 1.0  # by which the arm may come late [s]
_BOX, _SPHERE, _CYLINDER = 1, 2, 3  # of shape_msgs/msg/SolidPrimitive

README = """Made by regionik from the plan of world {world}: {duration:.2f} s, frame {frame}.

arm_trajectory.yaml   trajectory_msgs/msg/JointTrajectory
base_trajectory.yaml  trajectory_msgs/msg/MultiDOFJointTrajectory, of the same moments
base_path.yaml        nav_msgs/msg/Path, its stamps count from the start
robot_trajectory.yaml moveit_msgs/msg/RobotTrajectory, of both
planning_scene.yaml   moveit_msgs/msg/PlanningScene, the world's solids as a difference
ros2_control.yaml     parameters of a controller manager with a trajectory controller for the arm
nav2.yaml             parameters of nav2's controller server and local costmap for the base
settings.yaml         what execute_plan.py asks of the base, and from when to when the tool works [s]
execute_plan.py       sends the arm's trajectory, leads the base along its own, stops both where one fails,
                      and says on /tool_on when the tool works{fed}
bag/                  rosbag2 (MCAP) of /tf, /joint_states, the messages above, the robot and the solids
view.launch.py        starts RViz with plan.rviz and plays the bag: ros2 launch ./view.launch.py
robot.urdf            the robot, its base as the root link, its solids as they collide
foxglove.json         a layout for Foxglove, beside which the bag is opened
"""
FED = """,
                      on /extrusion how much is fed by then, on /extrusion_rate how fast
extrusion.yaml        the same, moment by moment"""


def ros2_files(plan: Plan, rate: float | None = None, frame: str = FRAME) -> dict[str, str | bytes]:
    """Return the files of the folder by their names, of a timed plan; this needs rosbags.

    Points come at a ``rate`` [1/s]; ``frame`` is that of the base's motion and the solids.
    """
    rate = RATE if rate is None else rate
    robot, speeds = plan.world.robot, plan.world.speeds or Speeds()
    arm, base = joint_trajectory(plan, rate, frame), base_trajectory(plan, rate, frame)
    path = path_message(plan, rate, frame)
    documents = {
        ARM: arm,
        BASE_MOTION: base,
        PATH: path,
        "robot_trajectory": {"joint_trajectory": arm, "multi_dof_joint_trajectory": base},
        SCENE: planning_scene(plan.world, frame),
        "ros2_control": arm_parameters(robot),
        "nav2": base_parameters(plan.world, frame),
        "settings": {
            "drive": robot.base,
            "base_frame": plan.world.frames.base_link,
            "base_velocity": float(speeds.base_velocity),
            "turn_velocity": float(speeds.turn_velocity),
            "tool_on": _tool_spans(plan),
        },
    }
    rows = sample_plan(plan, rate)
    fed = list(_fed(rows))
    if fed:
        documents[EXTRUSION] = {"points": fed}
    texts = {f"{name}.yaml": message_text(document, ".yaml") for name, document in documents.items()}
    about = README.format(
        world=plan.world.name, duration=float(plan.motion.time[-1]), frame=frame, fed=FED * bool(fed)
    )
    events = [
        Event(0, f"/{ARM}", "trajectory_msgs/msg/JointTrajectory", arm),
        Event(0, f"/{BASE_MOTION}", "trajectory_msgs/msg/MultiDOFJointTrajectory", base),
        Event(0, f"/{PATH}", "nav_msgs/msg/Path", path, stays=True),
        *world_events(plan.world, frame),
        *motion_events(plan.world, rows.sample, frame),
    ]
    bag = {f"bag/{name}": content for name, content in bag_files(events).items()}
    texts |= {SCRIPT: _SCRIPT_TEXT.read_text("utf-8"), "README.txt": about, **view_files(plan.world, frame)}
    return {**texts, **bag}


def _fed(rows: PlanSamples) -> Iterator[Message]:
    """Yield what is fed by each moment of a timed plan and how fast; nothing where its task tells no flow."""
    if rows.extrusion is not None and rows.extrusion_rate is not None:
        columns = rows.sample.time, rows.extrusion, rows.extrusion_rate
        for time, fed, rate in zip(*(column.tolist() for column in columns), strict=True):
            yield {"time": time, "extrusion": fed, "extrusion_rate": rate}


def _tool_spans(plan: Plan) -> list[Message]:
    """Times from when to when the tool of a timed plan works, one after the other [s]."""
    switched = np.diff(np.concatenate([[False], plan.tool_on(), [False]]))
    times = plan.motion.time[np.flatnonzero(switched)].reshape(-1, 2).tolist()
    return [{"from": begin, "to": done} for begin, done in times]


def arm_parameters(robot: Robot) -> Message:
    """Parameters of ros2_control's controller manager and its joint_trajectory_controller."""
    tolerances = {
        name: {"trajectory": _MAX_JOINT_ERROR, "goal": _GOAL_TOLERANCE} for name in robot.chain.names
    }
    arm = {
        "joints": list(robot.chain.names),
        "command_interfaces": ["position"],
        "state_interfaces": ["position", "velocity"],
        "constraints": {"goal_time": _MAX_DELAY, "stopped_velocity_tolerance": _GOAL_TOLERANCE, **tolerances},
    }
    manager = {
        "update_rate": 100,
        "joint_state_broadcaster": {"type": "joint_state_broadcaster/JointStateBroadcaster"},
        "arm_controller": {"type": "joint_trajectory_controller/JointTrajectoryController"},
    }
    return {"controller_manager": {"ros__parameters": manager}, "arm_controller": {"ros__parameters": arm}}


def base_parameters(world: World, frame: str) -> Message:
    """Parameters of nav2's controller server, with the MPPI controller, and of its local costmap."""
    robot, speeds = world.robot, world.speeds or Speeds()
    forward, turn = float(speeds.base_velocity), float(speeds.turn_velocity)
    follow: Message = {
        "plugin": "nav2_mppi_controller::MPPIController",
        "motion_model": _MOTION_MODELS[robot.base],
        "vx_max": forward,
        "vx_min": -forward,
        "vy_max": forward if robot.base == "omni" else 0.0,
        "wz_max": turn,
        "ax_max": float(speeds.base_acceleration),
        "ax_min": -float(speeds.base_acceleration),
        "az_max": float(speeds.turn_acceleration),
    }
    if robot.base == "car":
        follow["AckermannConstraints"] = {"min_turning_r": float(robot.turning_radius)}
    server = {"controller_frequency": 20.0, "controller_plugins": ["FollowPath"], "FollowPath": follow}
    base_frame = world.frames.base_link
    costmap: Message = {"global_frame": frame, "robot_base_frame": base_frame, "rolling_window": True}
    if len(robot.footprint) > 2:
        costmap["footprint"] = str(np.round(robot.footprint, 6).tolist())
    inflation = {
        "plugin": "nav2_costmap_2d::InflationLayer",
        "inflation_radius": max([world.rules.clearance, *(solid.clearance or 0.0 for solid in world.solids)]),
    }
    costmap |= {"plugins": ["inflation_layer"], "inflation_layer": inflation}
    return {
        "controller_server": {"ros__parameters": server},
        "local_costmap": {"local_costmap": {"ros__parameters": costmap}},
    }


def planning_scene(world: World, frame: str = FRAME) -> dict[str, Any]:
    """Return a world's solids as a moveit_msgs/msg/PlanningScene, to be added to MoveIt's.

    It is a difference to the scene that is there; what it lacks has its default.
    """
    objects = [_collision_object(solid, frame) for solid in world.solids]
    return {
        "name": world.name,
        "is_diff": True,
        "robot_state": {"is_diff": True},
        "world": {"collision_objects": objects},
    }


def _collision_object(solid: Solid, frame: str) -> dict[str, Any]:
    """Return a moveit_msgs/msg/CollisionObject: a primitive where there is one, else a mesh."""
    document: dict[str, Any] = {"header": {"frame_id": frame}, "id": solid.name}
    match solid:
        case Box():
            shape, pose = _primitive(_BOX, solid.size), _pose(solid.center, solid.yaw)
        case Sphere():
            shape, pose = _primitive(_SPHERE, np.array([solid.radius])), _pose(solid.center)
        case Cylinder():
            sizes = np.array([solid.height, solid.radius])
            shape, pose = _primitive(_CYLINDER, sizes), _pose(solid.center)
        case Prism() | Mesh():
            mesh = obstacle_mesh(solid)
            triangles = [{"vertex_indices": corners} for corners in mesh.faces.tolist()]
            shape = {"triangles": triangles, "vertices": [vector(*one) for one in mesh.vertices.tolist()]}
            return {**document, "meshes": [shape], "mesh_poses": [_pose(np.zeros(3))]}
    return {**document, "primitives": [shape], "primitive_poses": [pose]}


def _primitive(kind: int, dimensions: Array) -> dict[str, Any]:
    return {"type": kind, "dimensions": dimensions.tolist()}


def _pose(position: Array, yaw: float = 0.0) -> dict[str, Any]:
    return {"position": vector(*position.tolist()), "orientation": quaternion(yaw)}
