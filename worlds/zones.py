"""Zones of the floor: where the base stays inside, or outside."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import shapely
from shapely.geometry import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from regionik.worlds.errors import InputError
from regionik.worlds.obstacles import as_polygon

Keep = Literal["in", "out"]
ON_EDGE = 1e-9  # by which a base may pass the edge of a zone, for rounding [m]


@dataclass(frozen=True)
class Zone:
    """Part of the floor that the base must stay inside, or outside, wherever it is; the arm may be over it.

    Attributes
    ----------
    name : str
    keep : {"in", "out"}
        Where the footprint stays; it may touch the edge.
    polygon : Polygon
        Or its corners (n, 2) in order [m].

    Examples
    --------
    >>> Zone("walkway", "out", [[1, 0], [2, 0], [2, 3], [1, 3]])
    Zone(name='walkway', keep='out', polygon=<3 m2>)
    """

    name: str
    keep: Keep
    polygon: Polygon

    def __post_init__(self) -> None:
        if self.keep not in get_args(Keep):
            valid = ", ".join(get_args(Keep))
            raise InputError(f"{self.name}: keep: expected one of {valid}, got {self.keep!r}")
        object.__setattr__(self, "polygon", as_polygon(self.polygon, f"{self.name}: polygon"))
        if not isinstance(self.polygon, Polygon):
            raise InputError(f"{self.name}: polygon: expected one polygon: a zone for each")

    def __repr__(self) -> str:
        return f"Zone(name={self.name!r}, keep={self.keep!r}, polygon=<{self.polygon.area:g} m2>)"

    def left_of(self, floor: BaseGeometry) -> Polygon | MultiPolygon:
        """The polygons that it leaves of a floor."""
        cut = shapely.intersection if self.keep == "in" else shapely.difference
        parts = shapely.get_parts(cut(floor, self.polygon))
        parts = parts[shapely.area(parts) > 0]
        one: Polygon | MultiPolygon = parts[0] if len(parts) == 1 else MultiPolygon(list(parts))
        return one

    def allows(self, shape: BaseGeometry, off: float = 0.0) -> bool:
        """Return True where a shape may be, though anywhere so far ``off`` its place [m]."""
        if self.keep == "in":
            return bool(shapely.buffer(self.polygon, ON_EDGE - off, join_style="mitre").covers(shape))
        if off > 0:
            return bool(self.polygon.distance(shape) >= off - ON_EDGE)
        return not bool(self.polygon.buffer(-ON_EDGE, join_style="mitre").intersects(shape))
