"""The JSON Schema of world files, with words on each key: those of the values they make, and others."""

from __future__ import annotations

import inspect
import re
from typing import Any

from regionik.worlds.documents.world_file import WorldDocument
from regionik.worlds.joints import Joint
from regionik.worlds.limits import Speeds
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Rules

_MADE = {  # part -> the class that it makes
    "ChainRobot": Robot,
    "DhRobot": Robot,
    "JointPart": Joint,
    "NamedRobot": Robot,
    "RulesPart": Rules,
    "SpeedsPart": Speeds,
    "UrdfRobot": Robot,
}
_COMMON = {
    "about": "one line for lists of worlds",
    "angle_unit": "of the table's roll, pitch, yaw",
    "base": "how the base drives",
    "carry": "joints with which the arm is driven about, or a posture of the SRDF file; else a clear one",
    "cloud": "file of scanned points, read as boxes of the cells that have points in them",
    "cells": "cells of a map that are occupied or unknown",
    "chord": "largest distance of an arc from the chords it is cut into [m]",
    "columns": "titles of the columns of a table to read, whatever else it has; left out, these names",
    "cone": "allowed deviation from the direction [rad]",
    "criteria": "what is asked of postures beyond reaching the set-point",
    "parking": "error of the base's pose after parking at a stop, and the probability asked of stops",
    "execution": "largest errors of the robot against its plan, which then holds wherever it is within them",
    "csv": "file of x, y, z, and perhaps a name, and a tool axis, a normal, a quaternion or roll, pitch, yaw",
    "delimiter": "what stands between columns; left out, what the first line has most often",
    "dh": "rows of theta, d [m], a [m], alpha [rad]",
    "direction": "tool axis at all set-points of the piece; of a table with normals, which way these point",
    **dict.fromkeys(("dx", "dy", "dz"), "title of the column of a component of the tool axis"),
    **dict.fromkeys(("nx", "ny", "nz"), "title of the column of a component of the surface's normal"),
    **dict.fromkeys(("roll", "pitch"), "title of the column of an angle about a fixed axis"),
    "follow": "the tool axis turns with the arc",
    "footprint": "corners of the base's convex outline in the base frame [m]; one point is a point base",
    "frame": "in which the numbers are given: its name, or its pose; left out, the world",
    "free_thresh": "cells less likely occupied than this are free",
    "gcode": "file of straight moves and arcs, G0 to G3",
    "heading": "which way the base faces while the tool works",
    "height": "of occupied cells [m]",
    "holes": "outlines cut out [m]",
    "ignore": "links whose collision elements do not count",
    "joint": "name of a joint of the same chain that mimics no other",
    "joints": "from the base to the tool",
    "kind": "turns or slides",
    "limits": "ignore: joints turn without end",
    "link_radius": "of the capsules along the links [m]",
    "mesh": "file of triangles, and where it stands",
    "name": "in messages and pictures",
    "names": "of the joints",
    "multiplier": "by which it follows that joint",
    "octomap": "file of OctoMap, read as boxes of its occupied cells",
    "offset": "its value where that joint is at zero [rad] or [m]",
    "obstacles": "named solids that the robot keeps away from",
    "orientation": "of the tool at all set-points of the piece: quaternion x, y, z, w, or rotation matrix",
    "phase": "of the wave at its start [rad]",
    "points": "x, y, z of each set-point [m]",
    "position": "x, y, z [m]",
    **dict.fromkeys(("qx", "qy", "qz", "qw"), "title of the column of a component of the quaternion"),
    "root": "link that stands for the base",
    "rpy": "roll, pitch, yaw [rad]",
    "scale": "that numbers of the file are multiplied by",
    "solids": "capsules, boxes and hulls of the links",
    "srdf": "file of MoveIt's with postures and pairs that need not keep apart",
    "start": "where base and arm stand at first; left out, anywhere",
    "tip": "link at the end of the arm",
    "tool": "what is mounted on the flange",
    "unchecked": "pairs of links or solids that need not keep apart",
    "unit": "of the table's x, y, z; left out, m",
    "urdf": "file of the robot",
    "x_axis": "along_path: the tool's x axis, square to its z axis, goes along the path",
    "yaw": "turn about the vertical [rad]",
}


def world_schema() -> dict[str, Any]:
    """Return the JSON Schema of a world file."""
    schema = WorldDocument.model_json_schema()
    describe_keys(schema)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def describe_keys(schema: dict[str, Any]) -> None:
    """Give every key of a schema and of its parts that has no description one."""
    parts = {"": schema, **schema.get("$defs", {})}
    for part, content in parts.items():
        words = (attribute_words(_MADE[part]) if part in _MADE else {}) | _COMMON
        if part.startswith("Sine"):
            words["axis"] = "direction in which the wave swings"
        for key, value in content.get("properties", {}).items():
            if key in words:
                value.setdefault("description", words[key])


def attribute_words(made: type) -> dict[str, str]:
    """Return what the docstring of a class says of each attribute."""
    text = inspect.cleandoc(made.__doc__ or "")
    section = re.search(r"Attributes\n-+\n(.*?)(?:\n\n|\Z)", text, re.DOTALL)
    if section is None:
        return {}
    entries = re.findall(r"^(\S[^:\n]*) : [^\n]*\n((?:    .*\n?)+)", section[1] + "\n", re.MULTILINE)
    return {name.strip(): _sentence(words) for names, words in entries for name in names.split(",")}


def _sentence(words: str) -> str:
    text = " ".join(words.split())
    return text[:1].lower() + text[1:].removesuffix(".")
