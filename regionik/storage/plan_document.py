"""A plan as a JSON document: the same plan gives the same bytes.

Areas are GeoJSON (RFC 7946) in metres of the floor, not in longitude and latitude. Their corners are kept to
a tenth of a micrometre, and those left out that do not bend an outline (`stored_areas`).
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from regionik.storage.files import json_values
from regionik.values import Plan, Skipped, Stop
from regionik.worlds.documents.world_file import world_to_document
from regionik.worlds.errors import FileNote, InputError
from regionik.worlds.readers.text import MAX_BYTES

VERSIONS = (1, 2)  # that are read; the last is written. In 1 all features have three parts.
DECIMALS = 7  # of corners of areas [m]
COMPACT = (",", ":")  # separators within entries of long lists
MAX_CORNER_HEIGHT = 1e-8  # of one that does not bend an outline, over the line through its neighbours [m]
_AROUND = 3  # characters beside each member
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


def stored_areas(areas: Iterable[BaseGeometry]) -> NDArray[np.object_]:
    """Return areas as files keep them, (n,) MultiPolygons: few corners, of few digits.

    Those of a file come back as they are.

    >>> str(stored_areas([Polygon([(0, 0), (1 / 3, 0), (2 / 3, 0), (1, 1)])])[0])
    'MULTIPOLYGON (((0 0, 0.6666667 0, 1 1, 0 0)))'
    """
    shapes = _multipolygons(areas)
    fine = ~shapely.equals_exact(shapes, shapely.transform(shapes, _rounded))
    bent = shapely.simplify(shapes[fine], MAX_CORNER_HEIGHT)
    kept = shapely.transform(bent, _rounded)
    torn = ~shapely.is_valid(kept)  # where edges nearly meet
    kept[torn] = shapely.transform(shapely.set_precision(bent[torn], 10.0**-DECIMALS), _rounded)
    shapes[fine] = _multipolygons(kept)
    return shapes


def _multipolygons(shapes: Iterable[BaseGeometry]) -> NDArray[np.object_]:
    return np.array([MultiPolygon(_polygons(shape)) for shape in shapes], dtype=object)


def _rounded(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.round(corners, DECIMALS) + 0.0  # no negative zeros


def _polygons(geometry: BaseGeometry) -> list[Polygon]:
    """Polygons of any geometry, collections opened; points and lines of a touching boundary are dropped."""
    if isinstance(geometry, Polygon):
        return [] if geometry.is_empty else [geometry]
    return [polygon for part in getattr(geometry, "geoms", ()) for polygon in _polygons(part)]


def stored_figures(stats: Mapping[str, Any]) -> dict[str, Any]:
    """Return the figures of a plan that its file keeps: those that `regionik.verify` computes again.

    How the search went, bounds of stops and tours, and what a timing uses of its limits are not among them.

    >>> stored_figures({"states": 7, "base_moves": {"ompl": 1}, "stops": {"count": 2, "lower_bound": 2}})
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

    Areas are a GeoJSON FeatureCollection with one feature per set-point. Its geometry is a GeometryCollection
    of MultiPolygons, some of them perhaps empty: admissible, pruned unless that is all of the admissible one,
    rejected. There are no features where the document would exceed `MAX_BYTES` with them.

    Raises
    ------
    InputError
        Where it is too large even so: it could not be read back.

    Warns
    -----
    FileNote
        Where areas are left out.
    """
    members = {key: f"{json.dumps(key)}: {_text(key, value)}" for key, value in _members(plan)}
    if _size(members) > MAX_BYTES:
        members["areas"] = f'"areas": {_text("areas", iter(()))}'
        if (size := _size(members)) > MAX_BYTES:
            raise InputError(
                f"plan: a file of {size / 2**20:.1f} MB could not be read back, at most "
                f"{MAX_BYTES / 2**20:g} MB can, expected a task in parts of which each has a plan of its own"
            )
        what = "areas are left out of the plan file: with so many corners it could not be read back"
        warnings.warn(what, FileNote, stacklevel=2)
    text = ",\n".join(members.values())
    return f"{{\n{text}\n}}\n"


def _size(members: Mapping[str, str]) -> int:
    """Return the size of a document of these members, which is written in ASCII [bytes]."""
    return sum(len(text) + _AROUND for text in members.values())


def _members(plan: Plan) -> Iterator[tuple[str, Any]]:
    """Keys and values of the document; long lists are made entry by entry."""
    yield "version", VERSIONS[-1]
    yield "world", world_to_document(plan.world)
    yield "seed", int(plan.seed)
    yield "joint_names", list(plan.world.robot.chain.names)
    yield "setpoints", _setpoints(plan)
    yield "states", _states(plan)
    yield "areas", _areas(plan)
    yield "lift_offs", int(plan.lift_offs)
    yield "stops", [_stop_document(stop) for stop in plan.stops]
    yield "stats", json_values(stored_figures(plan.stats))
    yield "skipped", skipped_document(plan.skipped)


def skipped_document(skipped: Iterable[Skipped]) -> list[dict[str, Any]]:
    """Return the set-points that are left out, as JSON documents."""
    return [
        {
            "setpoint": one.setpoint,
            "target": _numbers(one.target.position),
            "direction": json_values(one.target.direction),
            "orientation": json_values(one.target.orientation),
            "cone": float(one.target.cone),
            "verdict": one.verdict,
            "reason": one.reason,
            "code": one.code,
            "name": one.target.name,
        }
        for one in skipped
    ]


def _stop_document(stop: Stop) -> dict[str, Any]:
    """A stop of a plan, all of whose set-points are verified."""
    document: dict[str, Any] = json_values(stop)
    del document["unconfirmed"]
    return document


def _text(key: str, value: Any) -> str:
    if key == "areas":
        return f'{{"type": "FeatureCollection", "features": {_text("features", value)}}}'
    if not isinstance(value, list | Iterator):
        return json.dumps(value, allow_nan=False)
    entries = ",\n".join(json.dumps(entry, allow_nan=False, separators=COMPACT) for entry in value)
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
    told = any(target.stroke is not None for target in plan.world.task)
    return (
        {
            "base": _numbers(state.base),
            "joints": _numbers(state.joints),
            "kind": state.kind,
            "setpoint": state.setpoint,
            "time": json_values(state.time),
            "tool": _numbers(tool),
            **({"tool_on": on} if told else {}),
        }
        for state, tool, on in zip(plan.motion, plan.tools(), plan.tool_on().tolist(), strict=True)
    )


def _areas(plan: Plan) -> Iterator[dict[str, Any]]:
    columns = [stored_areas(getattr(area, part) for area in plan.areas) for part in PARTS]
    for k, shapes in enumerate(zip(*columns, strict=True)):
        parts = {part: multipolygon(shape) for part, shape in zip(PARTS, shapes, strict=True)}
        if parts["pruned"] == parts["admissible"]:
            del parts["pruned"]
        geometry = {"type": "GeometryCollection", "geometries": list(parts.values())}
        yield feature(geometry, {"setpoint": k, "parts": list(parts)})
