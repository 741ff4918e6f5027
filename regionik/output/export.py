"""Plans and reach fields as files for other programs. The only file that imports rasterio."""

from __future__ import annotations

import io
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from regionik.output.ros2 import SUFFIXES, both_messages, joint_trajectory, message_text, path_message
from regionik.output.ros2_folder import ros2_files
from regionik.output.urdf import robot_to_urdf
from regionik.reachability.field import Field
from regionik.storage.files import csv_text, write_atomic, write_folder
from regionik.storage.plan_document import PARTS, feature, multipolygon
from regionik.timing.limits import tool_velocity
from regionik.timing.trajectory import is_timed, sample_plan, trajectory
from regionik.values import Plan
from regionik.worlds.arrays import Array
from regionik.worlds.errors import InputError

_BASE = ("base_x", "base_y", "base_yaw")


def export(
    plan: Plan,
    path: str | os.PathLike[str],
    format: str | None = None,
    *,
    rate: float | None = None,
    frame: str | None = None,
) -> None:
    """Write a plan for another program; the file is written whole or not at all.

    Parameters
    ----------
    plan : Plan
    path : path
        Messages become YAML or, where it ends in ``.json``, JSON. For ``ros2-folder`` a new folder.
    format : {"csv", "ros2", "joint-trajectory", "path", "ros2-folder", "geojson", "urdf"}, optional
        ``csv``: one row a state. ``joint-trajectory``, ``path``: one message of ROS 2 as ``ros2 topic pub``
        reads it, the arm's of a timed plan or the base's; ``ros2``: both and their types; ``ros2-folder``:
        these and others, parameters, a script that executes them and a bag. ``geojson``: areas, base path and
        set-points. ``urdf``: the robot. By default the suffix of ``path``.
    rate : float, optional
        Rows, points or poses a second of a timed plan, instead of one for each state [1/s].
    frame : str, optional
        Frame of the messages, ``map`` by default.

    Raises
    ------
    InputError
        When the format is unknown or does not go with the other arguments, the plan has no times that are
        needed, or the file cannot be written.
    """
    format = Path(path).suffix[1:].lower() if format is None else format
    check_options(format, path, rate, frame)
    options = Options(Path(path).suffix, rate, plan.world.frames.map if frame is None else frame)
    made = FORMATS[format].content(plan, options)
    if isinstance(made, dict):
        write_folder(path, made)
    else:
        write_atomic(path, made)


class Options(NamedTuple):
    """Suffix of the file, rows a second or None for one a state [1/s], frame of messages."""

    suffix: str
    rate: float | None
    frame: str


class Format(NamedTuple):
    """A format of `export`: the text of the file, or files of a folder; if it takes a rate, and a frame."""

    content: Callable[[Plan, Options], str | dict[str, str | bytes]]
    sampled: bool = False
    messages: bool = False
    folder: bool = False


def check_options(
    format: str, path: str | os.PathLike[str], rate: float | None = None, frame: str | None = None
) -> None:
    """Raise `InputError` where arguments of `export` do not go together; this needs no plan."""
    if format not in FORMATS:
        raise InputError(f"format {format}: expected one of {', '.join(FORMATS)}")
    chosen = FORMATS[format]
    if chosen.messages and not chosen.folder and Path(path).suffix.lower() not in SUFFIXES:
        raise InputError(f"{path}: expected a file name ending in {', '.join(SUFFIXES)} for format {format}")
    if rate is not None and not chosen.sampled:
        sampled = ", ".join(name for name, one in FORMATS.items() if one.sampled)
        raise InputError(f"rate: format {format} is not sampled; expected one of {sampled}")
    if rate is not None and not 0 < rate < np.inf:
        raise InputError(f"rate: expected a number above 0, got {rate:g}")
    if frame is not None and not chosen.messages:
        framed = ", ".join(name for name, one in FORMATS.items() if one.messages)
        raise InputError(f"frame: format {format} has none; expected one of {framed}")


def _plan_to_csv(plan: Plan, rate: float | None = None) -> str:
    """Return a table with a row for each state, in order; indices count from 0, empty cells have no value.

    ``tool_on`` is 1 where the tool works from a row to the next, else 0. Rows of a timed plan end with
    velocities and accelerations of base and joints, and the tool's speed; where the task tells a flow, with
    what is fed by then and, of a timed plan, how fast.
    ``rate`` gives rows at even times instead [1/s]; see `sample_plan`.
    """
    rows, robot = sample_plan(plan, rate), plan.world.robot
    sample, timed = rows.sample, is_timed(plan.motion)
    moving = [*_BASE, *robot.chain.names]
    header = ["index", "kind", "setpoint", "name", "tool_on", "time", *moving, "tool_x", "tool_y", "tool_z"]
    columns = [sample.base, sample.joints, robot.tool(sample.base, sample.joints)[:, :3, 3]]
    if timed:
        header += [f"{name}_{order}" for order in ("velocity", "acceleration") for name in moving]
        header.append("tool_speed")
        speed = np.linalg.norm(tool_velocity(robot, *sample.columns[:2]), axis=1)
        columns += [sample.base_velocity, sample.joint_velocity]
        columns += [sample.base_acceleration, sample.joint_acceleration, speed[:, None]]
    if rows.extrusion is not None:
        header.append("extrusion")
        columns.append(rows.extrusion[:, None])
    if rows.extrusion_rate is not None and timed:
        header.append("extrusion_rate")
        columns.append(rows.extrusion_rate[:, None])
    owners = [(None, "") if i < 0 else (i, plan.world.task[i].name) for i in rows.setpoint.tolist()]
    times = (None if np.isnan(time) else time for time in sample.time.tolist())
    works = rows.tool_on.astype(int).tolist()
    cells = zip(rows.kind, owners, works, times, np.hstack(columns).tolist(), strict=True)
    lines = (
        [k, kind, *owner, on, time, *numbers] for k, (kind, owner, on, time, numbers) in enumerate(cells)
    )
    return csv_text([header, *lines])


def plan_to_geojson(plan: Plan) -> str:
    """Return a FeatureCollection in metres of the world frame, not in longitude and latitude.

    Property ``part`` tells features apart: ``admissible``, ``pruned`` and ``rejected`` areas and
    ``setpoint`` points, each with its ``setpoint`` index and ``stroke``, one ``base-path`` line, and each
    ``zone`` with its ``name`` and ``keep``. The line of a timed plan has in ``time`` when the base is at each
    of its positions [s].
    """
    areas = [
        feature(multipolygon(getattr(area, part)), {"part": part, "setpoint": k})
        for k, area in enumerate(plan.areas)
        for part in PARTS
    ]
    points = [
        feature(
            {"type": "Point", "coordinates": target.position.tolist()},
            {"part": "setpoint", "setpoint": k, "name": target.name, "stroke": target.stroke},
        )
        for k, target in enumerate(plan.world.task)
    ]
    zones = [
        feature(
            multipolygon(zone.polygon),
            {"part": "zone", "setpoint": None, "name": zone.name, "keep": zone.keep},
        )
        for zone in plan.world.zones
    ]
    every = [*areas, _base_path(plan), *points, *zones]
    features = ",\n".join(json.dumps(one, allow_nan=False) for one in every)
    return f'{{"type": "FeatureCollection", "features": [\n{features}\n]}}\n'


def _base_path(plan: Plan) -> dict[str, Any]:
    drive, motion = plan.world.robot.drive, plan.motion
    times: Array | None = None
    if is_timed(motion):
        times = np.interp(drive.cuts(motion.base), np.arange(len(motion)), motion.time)
        track = trajectory(plan).sample(times).base[:, :2]
    else:
        track = drive.trace(motion.base)
    rows = slice(None) if len(track) > 1 else [0, 0]  # a line needs two positions
    stamps = {} if times is None else {"time": times[rows].tolist()}
    line = {"type": "LineString", "coordinates": track[rows].tolist()}
    return feature(line, {"part": "base-path", "setpoint": None, **stamps})


def _ros2(message: Callable[[Plan, float | None, str], dict[str, Any]]) -> Format:
    def text(plan: Plan, options: Options) -> str:
        return message_text(message(plan, options.rate, options.frame), options.suffix)

    return Format(text, sampled=True, messages=True)


FORMATS = {
    "csv": Format(lambda plan, options: _plan_to_csv(plan, options.rate), sampled=True),
    "ros2": _ros2(both_messages),
    "joint-trajectory": _ros2(joint_trajectory),
    "path": _ros2(path_message),
    "ros2-folder": Format(
        lambda plan, options: ros2_files(plan, options.rate, options.frame), True, True, folder=True
    ),
    "geojson": Format(lambda plan, _: plan_to_geojson(plan)),
    "urdf": Format(lambda plan, _: robot_to_urdf(plan.world.robot, plan.world.floor.polygon)),
}


# The floor has metres and no place on the Earth.
_LOCAL_FRAME = 'LOCAL_CS["floor",UNIT["metre",1],AXIS["x",EAST],AXIS["y",NORTH]]'


def write_field(field: Field, path: str | os.PathLike[str]) -> None:
    """Write a field to an ``.npz``, ``.tif``, ``.png`` or ``.svg`` file; the same field gives the same bytes.

    Parameters
    ----------
    field : Field
    path : path
        An ``.npz`` holds the arrays x, y, values, heading, the numbers cell, most, height, and as its meaning
        what values are and what they rest on.

    Raises
    ------
    InputError
        When the suffix is another, what it needs is not installed, or the file cannot be written.
    """
    from regionik.view.figures import SUFFIXES as PICTURES  # loads matplotlib
    from regionik.view.figures import field_image

    suffix = Path(path).suffix.lower()
    if suffix == ".npz":
        data = _arrays(field)
    elif suffix in (".tif", ".tiff"):
        data = _geotiff(field)
    elif suffix in PICTURES:
        data = field_image(field, suffix)
    else:
        raise InputError(f"{path}: expected a file name ending in .npz, .tif, .tiff, {', '.join(PICTURES)}")
    write_atomic(path, data)


def _arrays(field: Field) -> bytes:
    data = io.BytesIO()
    np.savez_compressed(
        data,
        x=field.x,
        y=field.y,
        values=field.values,
        heading=field.heading,
        cell=np.float64(field.cell),
        most=np.int64(field.most),
        height=np.float64(np.nan if field.height is None else field.height),
        meaning=np.str_(field.meaning),
    )
    return data.getvalue()


def _geotiff(field: Field) -> bytes:
    """Return a GeoTIFF with one band of whole numbers, north up, in metres of the floor."""
    try:
        from rasterio import Affine
        from rasterio.crs import CRS
        from rasterio.io import MemoryFile
    except ModuleNotFoundError as error:
        raise InputError(f"a GeoTIFF needs regionik[geotiff]: {error}") from None
    rows, columns = field.values.shape
    left, top = field.x[0] - field.cell / 2, field.y[-1] + field.cell / 2
    corner = Affine(field.cell, 0.0, left, 0.0, -field.cell, top)
    with MemoryFile() as memory:
        with memory.open(
            driver="GTiff", width=columns, height=rows, count=1, dtype="int32", transform=corner,
            crs=CRS.from_wkt(_LOCAL_FRAME), compress="deflate",
        ) as image:  # fmt: skip
            image.write(field.values[::-1], 1)
            image.update_tags(world=field.world, most=field.most, meaning=field.meaning)
        data: bytes = memory.read()
    return data
