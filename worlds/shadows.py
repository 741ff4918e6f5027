"""Shadows of solids on the floor, and what all solids share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from shapely.geometry.base import BaseGeometry

from regionik.worlds.arrays import Array, one_line
from regionik.worlds.errors import InputError


@dataclass(frozen=True)
class Shadow:
    """A floor area given exactly: all points within ``radius`` of ``core``.

    Discs keep their exact radius this way, so that growing them costs no accuracy.
    """

    core: BaseGeometry
    radius: float = 0.0
    more: float = 0.0  # what is kept from it beyond the clearance that others ask for, below 0 for less [m]

    @property
    def kept(self) -> float:
        """Distance from the core that is kept beyond the clearance that others ask for [m]."""
        return self.radius + self.more

    def distance(self, other: BaseGeometry) -> float:
        """Return the distance from a shape on the floor, 0 where they meet [m]."""
        return max(0.0, float(self.core.distance(other)) - self.radius)

    def shape(self, quad_segs: int = 16) -> BaseGeometry:
        """Return the area, its circles as polygons; for display."""
        return self.core.buffer(self.radius, quad_segs) if self.radius > 0 else self.core


class Obstacle:
    """Base of all solids; what they share, and what each of them gives.

    Attributes
    ----------
    name : str
    clearance : float or None
        Least distance of the base from it, in place of that of the rules; None for that of the rules [m].
    """

    name: str
    clearance: float | None

    def __post_init__(self) -> None:
        if self.clearance is not None and not 0 <= self.clearance < np.inf:
            raise InputError(f"{self.name}: clearance: must be at least 0, got {self.clearance:g}")

    @property
    def bounds(self) -> Array:
        """Corners of the upright box around the solid, low and high (2, 3) [m]."""
        raise NotImplementedError

    @property
    def z_range(self) -> tuple[float, float]:
        """Lowest and highest point [m]."""
        low, high = self.bounds[:, 2]
        return float(low), float(high)

    def shadow(self, below: float = np.inf, above: float = -np.inf) -> Shadow | None:
        """Return the floor area under the part between two heights [m]; None where there is no such part.

        What only touches one of the heights is no part: a rug may lie on the floor, and a pipe below it.
        """
        low, high = self.z_range
        return self._shadow(below, above) if low < below and high > above else None

    def _shadow(self, below: float, above: float) -> Shadow:
        raise NotImplementedError

    def distance(self, point: Array) -> float:
        """Return the signed distance of a point (3,), negative inside [m]."""
        raise NotImplementedError

    def transformed(self, T: Array) -> Self:
        """Return the solid moved by a transform (4, 4) that keeps z upright."""
        raise NotImplementedError

    __repr__ = one_line
