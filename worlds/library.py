"""Everything that comes with regionik, by name."""

from __future__ import annotations

from regionik.worlds.bundled import robot_named, robot_names, world_names, world_path
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.urdf.loader import load_robot

__all__ = ["load_robot", "load_world", "robot_named", "robot_names", "world_names", "world_path"]
