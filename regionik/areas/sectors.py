"""Rings and ring sectors as polygons, within their true shapes or around them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from regionik.areas.ground import GUARD, Geometries
from regionik.worlds.arrays import Array

ARC_POINTS = 48  # vertices of a full circle


class Sectors(NamedTuple):
    """Rings and ring sectors.

    Attributes
    ----------
    center : (n, 2) array
    low, high : (n,) array
        Radii, 0 <= low < high [m].
    azimuth, half : (n,) array
        Middle and half of each sector; whole rings where half a turn or more [rad].
    """

    center: Array
    low: Array
    high: Array
    azimuth: Array
    half: Array


def ring_sectors(
    centers: Array, low: Array, high: Array, azimuth: Array, half: Array, margin: float | None, arcs: int
) -> Geometries:
    """Rings and ring sectors as polygons: within the true shape where a margin is given, else around it.

    Parameters
    ----------
    centers : (n, 2) array
    low, high : (n,) array
        Radii [m].
    azimuth, half : (n,) array
        Middle and half of each sector; whole rings where half a turn or more [rad].
    margin : float or None
        Kept from both radii [m].
    arcs : int
        Vertices of a full circle or sector.
    """
    out = np.empty(len(centers), dtype=object)
    full = half >= np.pi
    step = 2 * np.where(full, np.pi, half) / arcs
    outwards = 1.0 / np.cos(step / 2)
    far, near = high * outwards, low
    if margin is not None:
        far, near = high - margin, (low + margin) * outwards
    if full.any():
        out[full] = _rings(centers[full], far[full], near[full], arcs)
    part = ~full
    angles = (azimuth - half)[part, None] + step[part, None] * np.arange(arcs + 1)
    unit = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    rim = centers[part, None] + far[part, None, None] * unit
    hole = centers[part, None] + near[part, None, None] * unit
    out[part] = shapely.polygons(np.concatenate([rim, hole[:, ::-1]], axis=1))
    return out


def wide_enough(low: Array, high: Array, margin: float | None, arcs: int) -> NDArray[np.bool_]:
    """Rings (n,) that have a polygon within: one thinner than its chords has none."""
    real: NDArray[np.bool_] = low + high > 0
    if margin is not None:
        real &= (low + margin) / np.cos(np.pi / arcs) + GUARD < high - margin
    return real


def _rings(centers: Array, far: Array, near: Array, arcs: int) -> Geometries:
    """Whole rings; discs where there is no hole."""
    turns = 2 * np.pi / arcs * np.arange(arcs)
    unit = np.column_stack([np.cos(turns), np.sin(turns)])
    unit = np.vstack([unit, unit[:1]])
    rims = shapely.linearrings(centers[:, None] + far[:, None, None] * unit)
    holed = near > GUARD
    holes = shapely.linearrings(centers[holed, None] + near[holed, None, None] * unit)
    rings = np.empty(len(centers), dtype=object)
    rings[holed] = shapely.polygons(rims[holed], holes=holes[:, None])
    rings[~holed] = shapely.polygons(rims[~holed])
    return rings
