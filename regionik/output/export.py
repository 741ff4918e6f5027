"""Plans as files for other programs: CSV, ROS 2 messages, GeoJSON, URDF."""

from __future__ import annotations

import csv
import io
import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from regionik.output.ros2 import FRAME, MESSAGES, SUFFIXES, to_text
from regionik.output.urdf import robot_to_urdf
from regionik.storage.files import write_whole
from regionik.storage.plan_document import PARTS, multipolygon
from regionik.timing.limits import tool_velocity
from regionik.timing.sampling import instants, is_timed
from regionik.timing.trajectory import trajectory
from regionik.values import Plan
from regionik.worlds.arrays import Array
from regionik.worlds.errors import InputError

FORMATS = ("csv", "ros2", "joint-trajectory", "path", "geojson", "urdf")
_SAMPLED = ("csv", *MESSAGES)
_BASE = ("base_x", "base_y", "base_yaw")


def export(
    plan: Plan,
    format: str,
    path: str | os.PathLike[str],
    *,
    rate: float | None = None,
    frame: str | None = None,
) -> None:
    """Write a plan for another program; the file is written whole or not at all.

    Parameters
    ----------
    plan : Plan
    format : {"csv", "ros2", "joint-trajectory", "path", "geojson", "urdf"}
        ``csv``: one row a state. ``joint-trajectory``, ``path``: one message of ROS 2 as ``ros2 topic pub``
        reads it, the arm's of a timed plan or the base's; ``ros2``: both and their types. ``geojson``: areas,
        base path and set-points. ``urdf``: the robot.
    path : path
        Messages become YAML or, where it ends in ``.json``, JSON.
    rate : float, optional
        Rows, points or poses a second of a timed plan, instead of one for each state [1/s].
    frame : str, optional
        Frame of the messages, ``map`` by default.

    Raises
    ------
    InputError
        When the format is unknown or does not go with what else is asked for, the plan has no times that are
        needed, or the file cannot be written.
    """
    check_asked(format, path, rate, frame)
    if format in MESSAGES:
        text = to_text(MESSAGES[format](plan, rate, FRAME if frame is None else frame), Path(path).suffix)
    elif format == "csv":
        text = plan_to_csv(plan, rate)
    else:
        text = plan_to_geojson(plan) if format == "geojson" else plan_to_urdf(plan)
    write_whole(path, text)


def check_asked(
    format: str, path: str | os.PathLike[str], rate: float | None = None, frame: str | None = None
) -> None:
    """Raise `InputError` where what is asked of `export` does not go together; no plan is needed for that."""
    if format not in FORMATS:
        raise InputError(f"format {format}: expected one of {', '.join(FORMATS)}")
    if format in MESSAGES and Path(path).suffix.lower() not in SUFFIXES:
        raise InputError(f"{path}: expected a file name ending in {', '.join(SUFFIXES)} for format {format}")
    if rate is not None and format not in _SAMPLED:
        raise InputError(f"rate: format {format} is not sampled; expected one of {', '.join(_SAMPLED)}")
    if rate is not None and not 0 < rate < np.inf:
        raise InputError(f"rate: expected a number above 0, got {rate:g}")
    if frame is not None and format not in MESSAGES:
        raise InputError(f"frame: format {format} has none; expected one of {', '.join(MESSAGES)}")


def plan_to_csv(plan: Plan, rate: float | None = None) -> str:
    """One row a state, in order; indices count from 0, what a state does not have is left empty.

    Rows of a timed plan go on with velocities and accelerations of base and joints, and the tool's speed.
    ``rate`` gives rows at even times instead [1/s]; see `instants`.
    """
    rows, robot = instants(plan, rate), plan.world.robot
    sample, timed = rows.sample, is_timed(plan.motion)
    moving = [*_BASE, *robot.chain.names]
    head = ["index", "kind", "setpoint", "time", *moving, "tool_x", "tool_y", "tool_z"]
    columns = [sample.base, sample.joints, robot.tool(sample.base, sample.joints)[:, :3, 3]]
    if timed:
        head += [f"{name}_{what}" for what in ("velocity", "acceleration") for name in moving]
        head.append("tool_speed")
        speed = np.linalg.norm(tool_velocity(robot, *sample.columns[:2]), axis=1)
        columns += [sample.base_velocity, sample.joint_velocity]
        columns += [sample.base_acceleration, sample.joint_acceleration, speed[:, None]]
    sheet = io.StringIO()
    writer = csv.writer(sheet, lineterminator="\n")
    writer.writerow(head)
    owners, numbers = rows.setpoint.tolist(), np.hstack(columns).tolist()
    for k, (kind, owner, time) in enumerate(zip(rows.kind, owners, sample.time.tolist(), strict=True)):
        writer.writerow([k, kind, "" if owner < 0 else owner, "" if np.isnan(time) else time, *numbers[k]])
    return sheet.getvalue()


def plan_to_geojson(plan: Plan) -> str:
    """A FeatureCollection in metres of the world frame (not longitude and latitude).

    Property ``part`` tells features apart: ``admissible``, ``pruned`` and ``rejected`` areas and
    ``setpoint`` points, each with its ``setpoint`` index, and one ``base-path`` line. The line of a timed
    plan has in ``time`` when the base is at each of its positions [s].
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
    path = _base_path(plan)
    features = ",\n".join(json.dumps(feature, allow_nan=False) for feature in [*areas, path, *points])
    return f'{{"type": "FeatureCollection", "features": [\n{features}\n]}}\n'


def plan_to_urdf(plan: Plan) -> str:
    """The planned robot with its base as virtual joints; see `robot_to_urdf`."""
    return robot_to_urdf(plan.world.robot, plan.world.floor.polygon)


def _base_path(plan: Plan) -> dict[str, Any]:
    drive, motion = plan.world.robot.drive, plan.motion
    times: Array | None = None
    if is_timed(motion):
        times = np.interp(drive.cuts(motion.base), np.arange(len(motion)), motion.time)
        track = trajectory(plan).sample(times).base[:, :2]
    else:
        track = drive.trace(motion.base)
    twice = slice(None) if len(track) > 1 else [0, 0]  # a line needs two positions
    line = {"type": "LineString", "coordinates": track[twice].tolist()}
    if times is None:
        return _feature(line, part="base-path", setpoint=None)
    return _feature(line, part="base-path", setpoint=None, time=times[twice].tolist())


def _feature(geometry: dict[str, Any], **properties: str | int | list[float] | None) -> dict[str, Any]:
    return {"type": "Feature", "properties": properties, "geometry": geometry}
