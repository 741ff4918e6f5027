"""A plan as a JSON document: the same plan gives the same bytes."""

from __future__ import annotations

import dataclasses
import json
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from numpy.typing import ArrayLike
from shapely.geometry import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from regionik.worlds.format import world_to_document

if TYPE_CHECKING:
    from regionik.plan import Plan

VERSION = 1
PARTS = ("admissible", "pruned", "rejected")


def plan_to_document(plan: Plan) -> dict[str, Any]:
    """The plan as plain dicts, lists and numbers, in the layout of ``docs/plan.schema.json``.

    Areas are a GeoJSON FeatureCollection with one feature per set-point. Its geometry is a
    GeometryCollection of three MultiPolygons, some of them perhaps empty: admissible, pruned, rejected.
    """
    return {
        "version": VERSION,
        "world": world_to_document(plan.world),
        "seed": int(plan.seed),
        "joint_names": list(plan.world.robot.chain.names),
        "setpoints": _setpoints(plan),
        "states": _states(plan),
        "areas": {"type": "FeatureCollection", "features": _areas(plan)},
        "lift_offs": int(plan.lift_offs),
        "stops": plain(list(plan.stops)),
        "stats": plain(plan.stats),
    }


def plan_to_text(plan: Plan) -> str:
    """The document as JSON text, one set-point, state or feature a line."""
    return document_to_text(plan_to_document(plan))


def document_to_text(document: dict[str, Any]) -> str:
    """JSON text with one entry of every top-level list a line, for people and for diffs."""
    members = []
    for key, value in document.items():
        if key == "areas":
            text = f'{{"type": "FeatureCollection", "features": {_listing(value["features"])}}}'
        elif isinstance(value, list):
            text = _listing(value)
        else:
            text = json.dumps(value, allow_nan=False)
        members.append(f"{json.dumps(key)}: {text}")
    return "{\n" + ",\n".join(members) + "\n}\n"


def multipolygon(geometry: BaseGeometry) -> dict[str, Any]:
    """The polygons of a geometry as a GeoJSON MultiPolygon, outer rings counter-clockwise (RFC 7946)."""
    polygons = _polygons(geometry)
    if not shapely.is_valid(MultiPolygon(polygons)):
        polygons = _polygons(shapely.union_all(shapely.make_valid(polygons)))
    coordinates = [
        [shapely.get_coordinates(ring).tolist() for ring in (polygon.exterior, *polygon.interiors)]
        for polygon in (shapely.orient_polygons(p) for p in polygons)
    ]
    return {"type": "MultiPolygon", "coordinates": coordinates}


def plain(value: Any) -> Any:
    """Any result as JSON values; what is not finite becomes null, a geometry becomes GeoJSON."""
    if isinstance(value, BaseGeometry):
        return plain(shapely.geometry.mapping(value))
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, (np.ndarray, np.generic)):
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value


def _listing(entries: list[Any]) -> str:
    if not entries:
        return "[]"
    return "[\n" + ",\n".join(json.dumps(entry, allow_nan=False) for entry in entries) + "\n]"


def _polygons(geometry: BaseGeometry) -> list[Polygon]:
    """Polygons of any geometry, collections opened; points and lines of a touching boundary are dropped."""
    if isinstance(geometry, Polygon):
        return [] if geometry.is_empty else [geometry]
    return [polygon for part in getattr(geometry, "geoms", ()) for polygon in _polygons(part)]


def _numbers(values: ArrayLike) -> list[float]:
    numbers: list[float] = np.asarray(values, dtype=np.float64).tolist()
    return numbers


def _setpoints(plan: Plan) -> list[dict[str, Any]]:
    return [
        {
            "target": _numbers(target.position),
            "base": _numbers(setpoint.base),
            "joints": _numbers(setpoint.joints),
            "iterations": int(setpoint.iterations),
            "error": plain(float(setpoint.error)),
            "converged": bool(setpoint.converged),
        }
        for target, setpoint in zip(plan.world.task, plan.setpoints, strict=True)
    ]


def _states(plan: Plan) -> list[dict[str, Any]]:
    return [
        {
            "base": _numbers(state.base),
            "joints": _numbers(state.joints),
            "kind": state.kind,
            "setpoint": state.setpoint,
            "time": plain(state.time),
            "tool": _numbers(tool),
        }
        for state, tool in zip(plan.motion, plan.tools(), strict=True)
    ]


def _areas(plan: Plan) -> list[dict[str, Any]]:
    return [
        {
            "type": "Feature",
            "properties": {"setpoint": k, "parts": list(PARTS)},
            "geometry": {
                "type": "GeometryCollection",
                "geometries": [multipolygon(getattr(area, part)) for part in PARTS],
            },
        }
        for k, area in enumerate(plan.areas)
    ]
