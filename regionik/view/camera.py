"""From where to look at a scene: obliquely from above, all of it in view, as little hidden as can be."""

from __future__ import annotations

import numpy as np

from regionik.view.picture import Camera
from regionik.view.triangle_meshes import outline
from regionik.worlds.arrays import Array
from regionik.worlds.scene import World

VIEW_ANGLE = np.radians(42.0)  # from bottom to top of the window
_ASPECT = 1.45  # narrower than common windows, so that words fit beside the scene
_MARGIN = 0.8  # about what happens [m]
_LOW = 0.3  # what ends below hides little [m]
# From the south first: north is up then, as on a drawing. Others, and steeper ones, only where they see more.
_AZIMUTHS = np.radians([-100.0, -60.0, -140.0, 80.0, 120.0, 40.0, 0.0, 180.0])
_ELEVATIONS = np.radians([48.0, 62.0, 76.0])


def camera_for(world: World, spots: Array) -> Camera:
    """A camera for a world in which the base visits ``spots`` (n, 2)."""
    targets = np.array([t.position for t in world.task]).reshape(-1, 3)
    low, high = _interest(world, np.vstack([targets[:, :2], spots]))
    top = max(0.3, float(targets[:, 2].max(initial=0.0)))
    corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (0.0, top)])
    center = np.array([*(low + high) / 2, 0.0])
    ways = [_toward(azimuth, elevation) for elevation in _ELEVATIONS for azimuth in _AZIMUTHS]
    eyes = [center + _distance(corners - center, way) * way for way in ways]
    some = targets[:: 1 + len(targets) // 60]
    floor = np.vstack([some[:, :2], spots[:: 1 + len(spots) // 60]])
    sights = np.vstack([some, np.column_stack([floor, np.zeros(len(floor))])])
    boxes = _boxes(world)
    hidden = [_hidden(boxes, eye, sights) for eye in eyes]
    return Camera(eyes[int(np.argmin(hidden))], center)


def _interest(world: World, spots: Array) -> tuple[Array, Array]:
    """Corners of the ground that matters: all that happens, and the floor around it."""
    x_low, y_low, x_high, y_high = world.floor.polygon.bounds
    first, last = spots.min(axis=0), spots.max(axis=0)
    low = np.minimum(np.maximum(first - _MARGIN, [x_low, y_low]), first)
    high = np.maximum(np.minimum(last + _MARGIN, [x_high, y_high]), last)
    return low, high


def _toward(azimuth: float, elevation: float) -> Array:
    """Unit vector from the scene to the eye."""
    flat = np.cos(elevation)
    return np.array([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)])


def _distance(corners: Array, back: Array) -> float:
    """How far back the eye must stand to see all corners (n, 3), given about the centre [m]."""
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    up = np.cross(back, right)
    tall = np.tan(VIEW_ANGLE / 2)
    need = np.maximum(np.abs(corners @ up) / tall, np.abs(corners @ right) / (tall * _ASPECT))
    return max(1.0, float((need + corners @ back).max()) * 1.04)


def _boxes(world: World) -> Array:
    """Bounding boxes (n, 2, 3) of what may hide something [m]; map cells hide alike all round."""
    boxes = []
    for solid in (obstacle for obstacle in world.obstacles if obstacle.z_range[1] > _LOW):
        x_low, y_low, x_high, y_high = outline(solid).bounds
        boxes.append([[x_low, y_low, solid.z_range[0]], [x_high, y_high, solid.z_range[1]]])
    return np.array(boxes).reshape(-1, 2, 3)


def _hidden(boxes: Array, eye: Array, sights: Array) -> int:
    """How many points (n, 3) lie behind boxes."""
    sides = boxes - eye
    way = sights[:, None, :] - eye
    way = np.where(np.abs(way) < 1e-12, 1e-12, way)
    # Slabs: a ray is inside a box between its last entry and its first exit. The point itself may touch.
    enter, leave = sides[None, :, 0] / way, sides[None, :, 1] / way
    first, last = np.minimum(enter, leave).max(axis=2), np.maximum(enter, leave).min(axis=2)
    return int(((first < last) & (first < 0.98) & (last > 0.0)).any(axis=1).sum())
