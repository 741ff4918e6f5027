"""Place and heading of the base in M-FABRIK, compiled.

Source: M-FABRIK (Santos et al., IEEE Access 2020), Algorithm 1, MoveToAdmArea and SetBaseOrientation.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from regionik.planners.geometry.angles import fit, wrap
from regionik.planners.geometry.polygons import clamp
from regionik.planners.kernels import compiled
from regionik.worlds.arrays import Array, Index

FREE, FACE_TARGET, FIXED = range(3)  # policies for the heading of the base
ROUNDING = 1e-9  # by which a heading may be outside its span [rad]


class BaseArea(NamedTuple):
    """Admissible area of the arm axis."""

    # vertices, rings: as `FlatPolygon` has them; without rings the whole floor is free
    vertices: Array
    rings: Index
    mobile: bool  # False holds the base where it is


@compiled
def move_to_area(area: BaseArea, x: float, y: float) -> tuple[float, float]:
    """The place where the area holds it, else the nearest place of the area (Alg. 1 l. 15-19)."""
    if len(area.rings) <= 1:
        return x, y
    return clamp(area.vertices, area.rings, x, y)


class Turning(NamedTuple):
    """Limits of pivot and base, which share a turn.

    A `FIXED` heading is that of its span where this has a single value, else the present one.
    """

    # lower, upper: limits of the pivot [rad]
    lower: float
    upper: float
    heading: int  # `FREE`, `FACE_TARGET` or `FIXED`
    # low, high: span of headings that the base keeps to [rad]
    low: float
    high: float


@compiled
def share_turn(plane: float, yaw: float, now: float, turning: Turning) -> tuple[float, float, bool]:
    """SetBaseOrientation (Alg. 1 l. 22): the turn to the arm's plane shared between pivot and base.

    Parameters
    ----------
    plane : float
        Sum of the base's heading and the pivot, whole turns aside [rad].
    yaw, now : float
        Present heading and pivot [rad].

    Returns
    -------
    pivot, heading [rad], True where the heading is within its span
    """
    lower, upper, heading, low, high = turning
    if heading == FACE_TARGET:
        pivot = min(max(0.0, lower), upper)
        yaw += wrap(plane - yaw - pivot)
        return pivot, yaw, abs(_into_span(yaw, low, high) - yaw) <= ROUNDING
    if heading == FIXED and low < high:  # the present one
        low, high = yaw, yaw
    yaw = _into_span(yaw, low, high)  # the base turns into its span, and on by what the pivot cannot take
    to = now + wrap(plane - yaw - now)
    pivot = min(max(to, lower), upper)
    yaw += to - pivot
    end = _into_span(yaw, low, high)
    if abs(end - yaw) <= ROUNDING:
        return pivot, yaw, True
    pivot, over = fit(plane - end, lower, upper)
    if over <= 0.0:
        return pivot, end, True
    end += wrap(plane - end - pivot)
    return pivot, end, abs(_into_span(end, low, high) - end) <= ROUNDING


@compiled
def _into_span(yaw: float, low: float, high: float) -> float:
    """The heading within a span that is nearest to a heading, the shorter way round from it [rad]."""
    half = 0.5 * (high - low)
    if half >= np.pi:
        return yaw
    off = -wrap(0.5 * (low + high) - yaw)
    return yaw if abs(off) <= half else yaw - off + (half if off > 0.0 else -half)
