"""Plans as files for other programs: CSV, GeoJSON, URDF."""

from __future__ import annotations

import csv
import io
import json
import os
from typing import Any

from regionik.files import write_whole
from regionik.plan import Plan
from regionik.plandocument import PARTS, multipolygon
from regionik.rolling import trace
from regionik.urdf_text import robot_to_urdf
from regionik.worlds.errors import InputError


def export(plan: Plan, format: str, path: str | os.PathLike[str]) -> None:
    """Write a plan for another program; the file is written whole or not at all.

    Parameters
    ----------
    plan : Plan
    format : {"csv", "geojson", "urdf"}
        ``csv``: one row a state. ``geojson``: areas, base path and set-points. ``urdf``: the robot.
    path : path

    Raises
    ------
    InputError
        When the format is unknown or the file cannot be written.
    """
    if format not in _WRITERS:
        raise InputError(f"format {format}: expected one of {', '.join(FORMATS)}")
    write_whole(path, _WRITERS[format](plan))


def plan_to_csv(plan: Plan) -> str:
    """One row a state, in order; indices count from 0, what a state does not have is left empty."""
    sheet = io.StringIO()
    writer = csv.writer(sheet, lineterminator="\n")
    names = plan.world.robot.chain.names
    head = ["index", "kind", "setpoint", "time", "base_x", "base_y", "base_yaw", *names]
    writer.writerow([*head, "tool_x", "tool_y", "tool_z"])
    for k, (state, tool) in enumerate(zip(plan.motion, plan.tools(), strict=True)):
        numbers = [*state.base.tolist(), *state.joints.tolist(), *tool.tolist()]
        writer.writerow([k, state.kind, state.setpoint, state.time, *numbers])
    return sheet.getvalue()


def plan_to_geojson(plan: Plan) -> str:
    """A FeatureCollection in metres of the world frame (not longitude and latitude).

    Property ``part`` tells features apart: ``admissible``, ``pruned`` and ``rejected`` areas and
    ``setpoint`` points, each with its ``setpoint`` index, and one ``base-path`` line.
    """
    areas = [
        _feature(multipolygon(getattr(area, part)), part=part, setpoint=k)
        for k, area in enumerate(plan.areas)
        for part in PARTS
    ]
    points = [
        _feature({"type": "Point", "coordinates": target.position.tolist()}, part="setpoint", setpoint=k)
        for k, target in enumerate(plan.world.task)
    ]
    track = trace(plan.world.robot.base, plan.motion.base).tolist()
    if len(track) == 1:  # a line needs two positions
        track = track * 2
    path = _feature({"type": "LineString", "coordinates": track}, part="base-path", setpoint=None)
    features = ",\n".join(json.dumps(feature, allow_nan=False) for feature in [*areas, path, *points])
    return f'{{"type": "FeatureCollection", "features": [\n{features}\n]}}\n'


def plan_to_urdf(plan: Plan) -> str:
    """The planned robot with its base as virtual joints; see `robot_to_urdf`."""
    return robot_to_urdf(plan.world.robot, plan.world.floor.polygon)


def _feature(geometry: dict[str, Any], **properties: str | int | None) -> dict[str, Any]:
    return {"type": "Feature", "properties": properties, "geometry": geometry}


_WRITERS = {"csv": plan_to_csv, "geojson": plan_to_geojson, "urdf": plan_to_urdf}
FORMATS = tuple(_WRITERS)
