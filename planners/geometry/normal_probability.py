"""Probability of polygons under a normal distribution, in closed form."""

from __future__ import annotations

import numpy as np
import shapely
from scipy.special import owens_t
from shapely.geometry.base import BaseGeometry

from regionik.worlds.arrays import Array

LEAST_VARIANCE = 1e-14  # added in both directions, so that none is zero [m2]
ON_EDGE = 1e-200  # distance of an edge from the mean that counts as none, in standard deviations


def normal_probability(shape: BaseGeometry, mean: Array, covariance: Array) -> float:
    """Return the probability that a normal point lies in a shape, holes and parts and all.

    With variances of one, that of the triangle of an edge with the mean is the angle that it fills, less two
    values of Owen's T (Owen 1956, Tables for computing bivariate normal probabilities).

    Parameters
    ----------
    shape : BaseGeometry
        Polygons [m].
    mean : (2,) array
        [m]
    covariance : (2, 2) array
        Positive semidefinite [m2].

    Examples
    --------
    >>> half = shapely.box(0, -99, 99, 99)
    >>> round(normal_probability(half, np.zeros(2), np.eye(2)), 12)
    0.5
    """
    parts = shapely.get_parts(shape)
    rings = shapely.get_rings(shapely.orient_polygons(parts[shapely.get_dimensions(parts) == 2]))
    if not len(rings):
        return 0.0
    corners, ring = shapely.get_coordinates(rings, return_index=True)
    variances, axes = np.linalg.eigh(covariance)
    whitened = (corners - mean) @ axes / np.sqrt(np.maximum(variances, 0.0) + LEAST_VARIANCE)
    same = ring[1:] == ring[:-1]
    a, b = whitened[:-1][same], whitened[1:][same]
    length = np.hypot(*(b - a).T)
    a, b, length = (rows[length > 0] for rows in (a, b, length))
    along, across = (b - a) / length[:, None], (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / length
    away = np.maximum(np.abs(across), ON_EDGE)
    first, last = ((one * along).sum(axis=1) for one in (a, b))
    whole = _sector(away, last) - _sector(away, first)
    signed = float((np.sign(across) * whole).sum())
    return min(abs(signed), 1.0)  # the axes may mirror the shape


def _sector(away: Array, along: Array) -> Array:
    """Probability of the right triangle of the mean and a stretch of a line, by its distance and length."""
    found: Array = np.arctan2(along, away) / (2 * np.pi) - owens_t(away, along / away)
    return found
