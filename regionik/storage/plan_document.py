"""A plan as a JSON document: the same plan gives the same bytes.

Areas are GeoJSON (RFC 7946) in metres of the floor, not in longitude and latitude.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from numpy.typing import ArrayLike
from shapely.geometry import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from regionik.storage.files import json_values
from regionik.worlds.documents.world_file import world_to_document

if TYPE_CHECKING:
    from regionik.values import Plan

VERSION = 1
CORNERS_LIMIT = 5_000_000  # of the areas in a file; with more it could not be read back
PARTS = ("admissible", "pruned", "rejected")
FIGURES: Mapping[str, tuple[str, ...]] = {  # of ``Plan.stats`` that files keep, and which parts, () for all
    "setpoints": (), "iterations": (), "states": (), "base_travel": (), "largest_error": (), "margins": (),
    "order": (), "stops": ("count",), "timing": ("duration", "blend"),
}  # fmt: skip


def feature(geometry: Mapping[str, Any], properties: Mapping[str, Any]) -> dict[str, Any]:
    """Return a GeoJSON Feature."""
    return {"type": "Feature", "properties": dict(properties), "geometry": dict(geometry)}


def feature_collection(features: Iterable[dict[str, Any]]) -> dict[str, Any]:
    """Return a GeoJSON FeatureCollection."""
    return {"type": "FeatureCollection", "features": list(features)}


def multipolygon(geometry: BaseGeometry) -> dict[str, Any]:
    """Return the polygons of a geometry as a GeoJSON MultiPolygon, outer rings counter-clockwise."""
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


def kept_figures(stats: Mapping[str, Any]) -> dict[str, Any]:
    """Return the figures of a plan that its file keeps: those that `regionik.verify` computes again.

    How the search went, bounds of stops and tours, and what a timing uses of its limits are not among them.

    >>> kept_figures({"states": 7, "base_moves": {"ompl": 1}, "stops": {"count": 2, "lower_bound": 2}})
    {'states': 7, 'stops': {'count': 2}}
    """
    kept: dict[str, Any] = {}
    for key, parts in FIGURES.items():
        if key in stats:
            value = stats[key]
            some = parts and isinstance(value, Mapping)
            kept[key] = {part: value[part] for part in parts if part in value} if some else value
    return kept


def plan_to_text(plan: Plan) -> str:
    """The plan as JSON, in the layout of ``docs/plan.schema.json``: a line a set-point, state or feature.

    Areas are a GeoJSON FeatureCollection with one feature per set-point. Its geometry is a
    GeometryCollection of three MultiPolygons, some of them perhaps empty: admissible, pruned, rejected.
    There are no features where the areas have more than `CORNERS_LIMIT` corners.
    """
    members = ",\n".join(f"{json.dumps(key)}: {_text(key, value)}" for key, value in _members(plan))
    return f"{{\n{members}\n}}\n"


def keeps_areas(plan: Plan) -> bool:
    """Return whether the plan's areas have few enough corners for a file that can be read back."""
    shapes = [getattr(area, part) for area in plan.areas for part in PARTS]
    return bool(shapely.get_num_coordinates(shapes).sum() <= CORNERS_LIMIT)


def _members(plan: Plan) -> Iterator[tuple[str, Any]]:
    """Keys and values of the document; long lists are made entry by entry."""
    yield "version", VERSION
    yield "world", world_to_document(plan.world)
    yield "seed", int(plan.seed)
    yield "joint_names", list(plan.world.robot.chain.names)
    yield "setpoints", _setpoints(plan)
    yield "states", _states(plan)
    yield "areas", _areas(plan) if keeps_areas(plan) else iter(())
    yield "lift_offs", int(plan.lift_offs)
    yield "stops", json_values(plan.stops)
    yield "stats", json_values(kept_figures(plan.stats))


def _text(key: str, value: Any) -> str:
    if key == "areas":
        return f'{{"type": "FeatureCollection", "features": {_text("features", value)}}}'
    if not isinstance(value, list | Iterator):
        return json.dumps(value, allow_nan=False)
    entries = ",\n".join(json.dumps(entry, allow_nan=False) for entry in value)
    return f"[\n{entries}\n]" if entries else "[]"


def _numbers(values: ArrayLike) -> list[float]:
    numbers: list[float] = np.asarray(values, dtype=np.float64).tolist()
    return numbers


def _setpoints(plan: Plan) -> Iterator[dict[str, Any]]:
    return (
        {
            "target": _numbers(target.position),
            "base": _numbers(setpoint.base),
            "joints": _numbers(setpoint.joints),
            "iterations": int(setpoint.iterations),
            "error": json_values(float(setpoint.error)),
            "converged": bool(setpoint.converged),
        }
        for target, setpoint in zip(plan.world.task, plan.setpoints, strict=True)
    )


def _states(plan: Plan) -> Iterator[dict[str, Any]]:
    return (
        {
            "base": _numbers(state.base),
            "joints": _numbers(state.joints),
            "kind": state.kind,
            "setpoint": state.setpoint,
            "time": json_values(state.time),
            "tool": _numbers(tool),
        }
        for state, tool in zip(plan.motion, plan.tools(), strict=True)
    )


def _areas(plan: Plan) -> Iterator[dict[str, Any]]:
    for k, area in enumerate(plan.areas):
        parts = [multipolygon(getattr(area, part)) for part in PARTS]
        geometry = {"type": "GeometryCollection", "geometries": parts}
        yield feature(geometry, {"setpoint": k, "parts": list(PARTS)})
