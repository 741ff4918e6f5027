"""Frames of a world file: their grammar, and their poses in the world."""

from __future__ import annotations

from dataclasses import fields
from typing import Annotated, Any

import numpy as np
from pydantic import Discriminator, Field, Tag

from regionik.worlds.arrays import Array
from regionik.worlds.chain import pose
from regionik.worlds.errors import InputError, located
from regionik.worlds.readers.text import OneLine, Strict, Vec3, join_names
from regionik.worlds.scene import FrameNames

WORLD = "map"  # the frame of all that names none
MAX_NAMES = 20  # names in a message
_NAMED = tuple(field.name for field in fields(FrameNames))


def _kind(value: Any) -> str:
    return "<name>" if isinstance(value, str) else "<pose>"


class FramePart(Strict):
    position: Vec3 = [0.0, 0.0, 0.0]
    rpy: Vec3 = [0.0, 0.0, 0.0]


class FrameOfWorld(FramePart):
    """The pose of a frame in another one of the file, by default in the world's."""

    parent: OneLine = Field(default=WORLD, description="name of a frame")


FramesPart = dict[
    OneLine,
    Annotated[
        Annotated[OneLine, Tag("<name>")] | Annotated[FrameOfWorld, Tag("<pose>")], Discriminator(_kind)
    ],
]
FrameReference = Annotated[
    Annotated[OneLine, Tag("<name>")] | Annotated[FramePart, Tag("<pose>")], Discriminator(_kind)
]
Poses = dict[str, Array]  # T_world_frame (4, 4) by the names of frames


def read_frames(part: FramesPart, where: str) -> tuple[FrameNames, Poses]:
    """Return the names of frames for exports, and the poses of the others in the world, (4, 4).

    ``map``, ``base_link`` and ``tool0`` are texts: what exports call them. All others are poses.
    """
    names: dict[str, str] = {}
    frames: dict[str, FrameOfWorld] = {}
    for key, value in part.items():
        with located(where, f"frames.{key}"):
            if isinstance(value, str) and key in _NAMED:
                names[key] = value
            elif isinstance(value, FrameOfWorld) and key not in _NAMED:
                frames[key] = value
            elif key in _NAMED:
                raise InputError("expected text, what exports call this frame")
            else:
                raise InputError(f"expected position and rpy; {', '.join(_NAMED)} alone are texts")
    with located(where, "frames."):
        called = FrameNames(**names)
    poses: Poses = {WORLD: np.eye(4)}
    for key in frames:
        with located(where, f"frames.{key}"):
            _add_pose(key, frames, poses)
    return called, {key: poses[key] for key in (WORLD, *frames)}


def frame_pose(reference: str | FramePart, poses: Poses) -> Array:
    """Return the pose of a frame in the world, (4, 4); an `InputError` lists the names that the file has."""
    if isinstance(reference, FramePart):
        return pose(reference.position, reference.rpy)
    if reference not in poses:
        raise InputError(f"frame: unknown frame {reference!r}, valid names: {join_names(poses, MAX_NAMES)}")
    return poses[reference]


def _add_pose(name: str, frames: dict[str, FrameOfWorld], poses: Poses) -> None:
    """Put the pose of a frame, and of those it is given in, among the poses in the world."""
    way: dict[str, None] = {}  # in order
    while name not in poses:
        if name not in frames:
            raise InputError(
                f"parent: unknown frame {name!r}, valid names: {join_names([WORLD, *frames], MAX_NAMES)}"
            )
        if name in way:
            circle = join_names([*way, name], MAX_NAMES)
            raise InputError(f"parent: expected no circle of frames, got {circle}")
        way[name] = None
        name = frames[name].parent
    for frame in reversed(way):
        part = frames[frame]
        poses[frame] = poses[part.parent] @ pose(part.position, part.rpy)
