"""A picture as plain values that any viewer can draw."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from regionik.view.options import VIEW
from regionik.view.triangle_meshes import TriangleMesh, shadow_polygon
from regionik.worlds.arrays import Array
from regionik.worlds.scene import World

OPTIONS = VIEW.camera

if TYPE_CHECKING:
    from regionik.view.timeline import Timeline

TrackKind = Literal["position", "turn", "color", "faces"]
# From the south first, as on a drawing with north up; others, and steeper ones, only where they see more.
_AZIMUTHS = np.radians([-100.0, -60.0, -140.0, 80.0, 120.0, 40.0, 0.0, 180.0])
_ELEVATIONS = np.radians([48.0, 62.0, 76.0])


class Color:
    """The colours of pictures, 0xRRGGBB; what lies on the floor is opaque, as swatches are."""

    FLOOR, NAVIGABLE, TURNING, REJECTION = 0xF6F4EE, 0x9ABFEB, 0xF3CF8E, 0xEC8179
    PALE, STRONG, CURRENT = 0xC5E9B9, 0x87CB8B, 0x439E59  # areas: admissible, whole path, next set-point
    ZONE = 0xD7C3DB  # floor on which a zone lets no base stand
    SOLID, ROBOT, WHEEL = 0x9AA0A6, 0x44546A, 0x1A1E24
    ARM, HEADING = 0x39434F, 0xF4F6F8
    PATH, AHEAD, PASSED, MISSING = 0x7A5230, 0xFF8A1F, 0x12A347, 0xC1121F  # the tool path, its set-points
    TOOL_AXIS, TRAVEL = 0x8A6D00, 0xC9A3EB
    AXIS_PATH, LIFTED, PARKING = 0x1B3F8B, 0x9B30D9, 0x0FA3A3
    CAUSE, REPAIR = 0xC2185B, 0x00838F


@dataclass(frozen=True, eq=False)
class SceneMesh:
    """A mesh of one colour, or with a colour for each face."""

    path: str  # its node in the scene
    mesh: TriangleMesh
    color: int  # 0xRRGGBB
    opacity: float = 1.0
    layer: int | None = None  # floor areas lie in this order and hide no higher layer; None: a solid
    lit: bool = True  # light and shadow fall on it
    colors: Array | None = None  # (m, 3) of faces, from 0 to 1; they replace ``color``
    label: str = ""  # in the legend; meshes of one label are one layer, those without are always shown
    name: str = ""  # told when it is clicked, by default the label
    numbers: tuple[int, ...] = ()  # of the set-points that follow one another in the mesh, all as large


class LegendEntry(NamedTuple):
    """A line of the legend: the colour drawn, its words, and the nodes that bear it."""

    color: int
    label: str
    paths: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class KeyframeTrack:
    """The animation of one property of a node.

    Positions and turns of a node are interpolated between keys; the colour of a mesh, and which of its faces
    are drawn, jump at their keys.
    """

    path: str
    kind: TrackKind
    times: Array  # (n,) [s]
    # (n, k) x, y, z [m]; quaternion x, y, z, w; red, green, blue from 0 to 1; first face and count
    values: Array | NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Camera:
    """Position of the eye and of the point that it looks at."""

    eye: Array  # (3,) [m]
    center: Array  # (3,) [m]
    half: Array  # (2,) half of the floor that it sees, along x and y [m]


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture for any viewer: meshes, poses of nodes, motion, camera and the text beside them."""

    title: str
    facts: tuple[str, ...]  # a few words each
    bodies: tuple[SceneMesh, ...]
    poses: dict[str, Array]  # (4, 4) of nodes, in their parent node
    camera: Camera
    extent: float  # radius about the camera's centre that holds the floor [m]
    tracks: tuple[KeyframeTrack, ...] = ()  # all end at the same time
    timeline: Timeline | None = None  # None where nothing moves
    setpoints: tuple[str, ...] = ()  # what people call each; none where nobody calls any

    @property
    def legend(self) -> tuple[LegendEntry, ...]:
        """Entries for all that is drawn and has a label, in the order of the bodies."""
        found: dict[str, list[SceneMesh]] = {}
        for body in self.bodies:
            if body.label and len(body.mesh.faces):
                found.setdefault(body.label, []).append(body)
        return tuple(
            LegendEntry(some[0].color, label, tuple(body.path for body in some))
            for label, some in found.items()
        )


def setpoint_names(world: World) -> tuple[str, ...]:
    """Return what people call each set-point; nothing where none has a name."""
    names = tuple(target.name for target in world.task)
    return names if any(names) else ()


def tool_axes(world: World) -> Array:
    """Return arrows (k, 2, 3) along the tool's axis to set-points that ask for one, from the tool's side [m].

    Of many set-points only some have one.
    """
    scene = VIEW.scene
    aimed = [(target.position, target.direction) for target in world.task if target.direction is not None]
    if not aimed:
        return np.empty((0, 2, 3))
    tips, ways = np.array(aimed[:: -(-len(aimed) // scene.max_tool_axes)]).swapaxes(0, 1)
    return np.stack([tips - scene.tool_axis * ways, tips - scene.mark_radius * ways], axis=1)


def count_noun(count: int, noun: str) -> str:
    """Return a number and its noun, in the plural unless the number is one."""
    return f"{count} {noun}" + ("" if count == 1 else "s")


def camera_for(world: World, points: Array) -> Camera:
    """Return a camera for a world that sees its set-points and points (n, 3) of its robot [m]."""
    targets = np.array([t.position for t in world.task]).reshape(-1, 3)
    seen = np.vstack([targets, points])
    low, high = _ground_of_interest(world, seen[:, :2] if len(targets) else targets[:, :2])
    top = max(0.3, float(seen[:, 2].max(initial=0.0)))
    corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (0.0, top)])
    center = np.array([*(low + high) / 2, 0.0])
    directions = [_toward(azimuth, elevation) for elevation in _ELEVATIONS for azimuth in _AZIMUTHS]
    eyes = [center + _distance(corners - center, back) * back for back in directions]
    some = np.vstack([part[:: 1 + len(part) // 60] for part in (targets, points)])
    sights = np.vstack([some, some * (1.0, 1.0, 0.0)])
    boxes = _boxes(world)
    hidden = [_hidden(boxes, eye, sights) for eye in eyes]
    return Camera(eyes[int(np.argmin(hidden))], center, (high - low) / 2)


def _ground_of_interest(world: World, spots: Array) -> tuple[Array, Array]:
    """Corners of the floor around all spots (n, 2); of the whole floor where there are none."""
    x_low, y_low, x_high, y_high = world.floor.polygon.bounds
    if not len(spots):
        return np.array([x_low, y_low]), np.array([x_high, y_high])
    first, last = spots.min(axis=0), spots.max(axis=0)
    low = np.minimum(np.maximum(first - OPTIONS.margin, [x_low, y_low]), first)
    high = np.maximum(np.minimum(last + OPTIONS.margin, [x_high, y_high]), last)
    return low, high


def _toward(azimuth: float, elevation: float) -> Array:
    """Unit vector from the scene to the eye."""
    flat = np.cos(elevation)
    return np.array([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)])


def _distance(corners: Array, back: Array) -> float:
    """Distance of the eye from the centre to see all corners (n, 3), given relative to it [m]."""
    right, up, _ = camera_axes(back)
    tall = np.tan(OPTIONS.view_angle / 2)
    need = np.maximum(np.abs(corners @ up) / tall, np.abs(corners @ right) / (tall * OPTIONS.aspect))
    return max(1.0, float((need + corners @ back).max()) * 1.04)


def camera_axes(back: Array) -> tuple[Array, Array, Array]:
    """Unit vectors (3,) to the right of the view, upwards, and back to the eye, which is given."""
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    return right, np.cross(back, right), back


def _boxes(world: World) -> Array:
    """Bounding boxes (n, 2, 3) of obstacles [m]; map cells hide the same from everywhere."""
    boxes = []
    tall = (one for one in world.obstacles if one.z_range[1] > OPTIONS.min_hiding_height)
    for solid in tall:
        x_low, y_low, x_high, y_high = shadow_polygon(solid).bounds
        boxes.append([[x_low, y_low, solid.z_range[0]], [x_high, y_high, solid.z_range[1]]])
    return np.array(boxes).reshape(-1, 2, 3)


def _hidden(boxes: Array, eye: Array, sights: Array) -> int:
    """Number of points (n, 3) behind boxes, by the slab test."""
    sides = boxes - eye
    ray = sights[:, None, :] - eye
    ray = np.where(np.abs(ray) < 1e-12, 1e-12, ray)
    # A ray is inside a box between its last entry and its first exit. The point itself may touch.
    enter, leave = sides[None, :, 0] / ray, sides[None, :, 1] / ray
    first, last = np.minimum(enter, leave).max(axis=2), np.maximum(enter, leave).min(axis=2)
    return int(((first < last) & (first < 0.98) & (last > 0.0)).any(axis=1).sum())
