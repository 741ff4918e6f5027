"""A picture as plain values that any viewer can draw, and its colours."""

from __future__ import annotations

from dataclasses import dataclass

from regionik.view.animation import Track
from regionik.view.triangle_meshes import Triangles
from regionik.worlds.arrays import Array

FLOOR, NAVIGABLE, REJECTION = 0xF6F4EE, 0x4F93E8, 0xE5352B
PALE, STRONG, CURRENT = 0xB9E6AC, 0x43B14E, 0x0B7A31
SOLID, ROBOT, ARM, HEADING = 0x9AA0A6, 0x2B3440, 0x39434F, 0xF4F6F8
PATH, AHEAD, PASSED = 0x7A5230, 0xFF8A1F, 0x12A347
BASE_PATH, LIFTED = 0x1B3F8B, 0x9B30D9
REJECTED, MISSING = 0xEFA39E, 0xC1121F  # rejection as it looks on the floor; set-points without a place
CAUSE, MENDED = 0xC2185B, 0x00838F


@dataclass(frozen=True, eq=False)
class Body:
    """One mesh of one colour, or of one colour a face.

    Attributes
    ----------
    path : str
        Where it hangs in the scene.
    mesh : Triangles
    color : int
        0xRRGGBB
    opacity : float
    layer : int or None
        Flat areas lie on the floor in this order and hide nothing that comes later; None is a solid.
    lit : bool
        Whether light and shadow fall on it.
    colors : (m, 3) array or None
        Of faces, from 0 to 1; they replace ``color``.
    """

    path: str
    mesh: Triangles
    color: int
    opacity: float = 1.0
    layer: int | None = None
    lit: bool = True
    colors: Array | None = None


@dataclass(frozen=True, eq=False)
class Camera:
    """Where the eye is and what it looks at, both (3,) [m]."""

    eye: Array
    center: Array


@dataclass(frozen=True, eq=False)
class Picture:
    """Everything a viewer needs: bodies, poses of nodes, motion, camera and the words beside.

    Attributes
    ----------
    title : str
    facts : tuple of str
    legend : tuple of (color, words)
    bodies : tuple of Body
    poses : dict
        (4, 4) arrays by path; nodes that are not named stand at the identity of their parent.
    camera : Camera
    extent : float
        Radius about the camera's centre that holds the floor [m].
    tracks : tuple of Track
        The animation; empty where nothing moves. All tracks last equally long.
    """

    title: str
    facts: tuple[str, ...]
    legend: tuple[tuple[int, str], ...]
    bodies: tuple[Body, ...]
    poses: dict[str, Array]
    camera: Camera
    extent: float
    tracks: tuple[Track, ...] = ()
