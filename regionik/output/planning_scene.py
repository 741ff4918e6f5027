"""The solids of a world as a moveit_msgs/msg/PlanningScene, to be added to MoveIt's."""

from __future__ import annotations

from typing import Any

import numpy as np

from regionik.output.ros2 import FRAME, quaternion, vector
from regionik.view.triangle_meshes import obstacle_mesh
from regionik.worlds.arrays import Array
from regionik.worlds.obstacles import Box, Cylinder, Mesh, Prism, Solid, Sphere
from regionik.worlds.scene import World

_BOX, _SPHERE, _CYLINDER = 1, 2, 3  # of shape_msgs/msg/SolidPrimitive


def planning_scene(world: World, frame: str = FRAME) -> dict[str, Any]:
    """Return the message, a difference to the scene that is there; what it lacks has its default."""
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
