"""GeoJSON (RFC 7946) in metres of the floor, not in longitude and latitude."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import shapely
from shapely.geometry import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry


def feature(geometry: Mapping[str, Any], properties: Mapping[str, Any]) -> dict[str, Any]:
    """A GeoJSON Feature."""
    return {"type": "Feature", "properties": dict(properties), "geometry": dict(geometry)}


def feature_collection(features: Iterable[dict[str, Any]]) -> dict[str, Any]:
    """A GeoJSON FeatureCollection."""
    return {"type": "FeatureCollection", "features": list(features)}


def multipolygon(geometry: BaseGeometry) -> dict[str, Any]:
    """The polygons of a geometry as a GeoJSON MultiPolygon, outer rings counter-clockwise."""
    polygons = _polygons(geometry)
    if not shapely.is_valid(MultiPolygon(polygons)):
        polygons = _polygons(shapely.union_all(shapely.make_valid(polygons)))
    coordinates = [
        [shapely.get_coordinates(ring).tolist() for ring in (polygon.exterior, *polygon.interiors)]
        for polygon in (shapely.orient_polygons(p) for p in polygons)
    ]
    return {"type": "MultiPolygon", "coordinates": coordinates}


def _polygons(geometry: BaseGeometry) -> list[Polygon]:
    """Polygons of any geometry, collections opened; points and lines of a touching boundary are dropped."""
    if isinstance(geometry, Polygon):
        return [] if geometry.is_empty else [geometry]
    return [polygon for part in getattr(geometry, "geoms", ()) for polygon in _polygons(part)]
