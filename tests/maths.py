"""Arrays, frames and angles that tests reckon with, so that none stands on the library's own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def translation(x: float, y: float, z: float) -> Array:
    """Return a pure translation, (4, 4)."""
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


def rot_x(angle: float) -> Array:
    return _rotation(angle, 1, 2)


def rot_y(angle: float) -> Array:
    return _rotation(angle, 2, 0)


def rot_z(angle: float) -> Array:
    return _rotation(angle, 0, 1)


def _rotation(angle: float, first: int, second: int) -> Array:
    """Return a turn from one axis towards another, (4, 4)."""
    T = np.eye(4)
    T[first, first] = T[second, second] = np.cos(angle)
    T[second, first] = np.sin(angle)
    T[first, second] = -T[second, first]
    return T


def pose(position: Sequence[float], rpy: Sequence[float]) -> Array:
    """Return the transform of a position [m] and roll, pitch, yaw [rad] about fixed axes, (4, 4)."""
    roll, pitch, yaw = rpy
    return translation(*position) @ rot_z(yaw) @ rot_y(pitch) @ rot_x(roll)


def planar_pose(x: float, y: float, yaw: float, z: float = 0.0) -> Array:
    """Return the frame at (x, y, z) turned by yaw about z, (4, 4)."""
    return translation(x, y, z) @ rot_z(yaw)


def wrap(angle: float) -> float:
    """Return an angle without its whole turns, in (-pi, pi]."""
    return float(angle - 2 * np.pi * np.ceil((angle - np.pi) / (2 * np.pi)))


def arc_end(x: float, y: float, yaw: float, length: float, turn: float) -> tuple[float, float, float]:
    """Return the pose at the end of an arc (or a line, or a turn on the spot); its heading is not wrapped."""
    half = 0.5 * turn
    chord = length * float(np.sinc(half / np.pi))
    return x + chord * float(np.cos(yaw + half)), y + chord * float(np.sin(yaw + half)), yaw + turn
