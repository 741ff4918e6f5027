"""A picture as plain values that any viewer can draw."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from regionik.view.triangle_meshes import TriangleMesh
from regionik.worlds.arrays import Array

TrackKind = Literal["position", "turn", "color", "faces"]


class Color:
    """The colours of pictures, 0xRRGGBB."""

    FLOOR, NAVIGABLE, REJECTION = 0xF6F4EE, 0x4F93E8, 0xE5352B
    PALE, STRONG, CURRENT = 0xB9E6AC, 0x43B14E, 0x0B7A31  # areas: admissible, whole path, next set-point
    SOLID, ROBOT, ARM, HEADING = 0x9AA0A6, 0x2B3440, 0x39434F, 0xF4F6F8
    PATH, AHEAD, PASSED, MISSING = 0x7A5230, 0xFF8A1F, 0x12A347, 0xC1121F  # the tool path, its set-points
    BASE_PATH, LIFTED = 0x1B3F8B, 0x9B30D9
    REJECTED = 0xEFA39E  # opaque, as rejection looks on the floor
    CAUSE, REPAIR = 0xC2185B, 0x00838F


@dataclass(frozen=True, eq=False)
class SceneMesh:
    """One mesh of one colour, or of one colour a face.

    Attributes
    ----------
    path : str
        Its node in the scene.
    mesh : TriangleMesh
    color : int
        0xRRGGBB
    opacity : float
    layer : int or None
        Flat areas lie on the floor in this order and hide nothing of higher layers; None is a solid.
    lit : bool
        Whether light and shadow fall on it.
    colors : (m, 3) array or None
        Of faces, from 0 to 1; they replace ``color``.
    """

    path: str
    mesh: TriangleMesh
    color: int
    opacity: float = 1.0
    layer: int | None = None
    lit: bool = True
    colors: Array | None = None


@dataclass(frozen=True, eq=False)
class KeyframeTrack:
    """The animation of one property of a node.

    Attributes
    ----------
    path : str
    kind : {"position", "turn", "color", "faces"}
        Positions and turns of a node are interpolated between keys; the colour of a mesh, and which of its
        faces are drawn, jump at their keys.
    times : (n,) array
        [s]
    values : (n, k) array
        x, y, z [m]; quaternion x, y, z, w; red, green, blue from 0 to 1; first face and count.
    """

    path: str
    kind: TrackKind
    times: Array
    values: Array | NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Camera:
    """Position of the eye and of the point that it looks at, both (3,) [m]."""

    eye: Array
    center: Array


@dataclass(frozen=True, eq=False)
class Picture:
    """All that a viewer needs: meshes, poses of nodes, motion, camera and the text beside them.

    Attributes
    ----------
    title : str
    facts : tuple of str
    legend : tuple of (color, text)
    bodies : tuple of SceneMesh
    poses : dict
        (4, 4) arrays by path; nodes that are not named stand at the identity of their parent.
    camera : Camera
    extent : float
        Radius about the camera's centre that holds the floor [m].
    tracks : tuple of KeyframeTrack
        The animation; empty where nothing moves. All tracks have the same duration.
    """

    title: str
    facts: tuple[str, ...]
    legend: tuple[tuple[int, str], ...]
    bodies: tuple[SceneMesh, ...]
    poses: dict[str, Array]
    camera: Camera
    extent: float
    tracks: tuple[KeyframeTrack, ...] = ()


def count_noun(count: int, noun: str) -> str:
    """A number and its noun, in the plural where there is not one."""
    return f"{count} {noun}" + ("" if count == 1 else "s")
