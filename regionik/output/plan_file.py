"""Plans kept in files: ``plan.json``, its schema, and the way back to a `Plan`."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import shapely
from pydantic import Field
from shapely.geometry import MultiPolygon, Polygon

from regionik.storage.files import write_atomic
from regionik.storage.plan_document import (
    PARTS,
    VERSIONS,
    plan_to_text,
    stored_figures,
)
from regionik.values import Configuration, Motion, Plan, PlannedArea, Skipped, Stop
from regionik.worlds.documents.world_file import world_from_document
from regionik.worlds.errors import InputError, ReasonCode, Verdict, located
from regionik.worlds.readers.text import MAX_BYTES, MAX_NUMBER, Many, Strict, reading, validated
from regionik.worlds.scene import StopCriterion, Target, World

Number = Annotated[float, Field(ge=-MAX_NUMBER, le=MAX_NUMBER)]
Index = Annotated[int, Field(ge=0)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Three = Annotated[list[Number], Field(min_length=3, max_length=3)]
Position = Annotated[list[Number], Field(min_length=2, max_length=2)]
Ring = Annotated[Many[Position], Field(min_length=4, description="closed: the last position is the first")]


class SetpointRecord(Strict):
    """Base and arm that put the tool on one target."""

    target: Three = Field(description="x, y, z [m]")
    base: Three = Field(description="x, y [m], yaw [rad]")
    joints: Many[Number] = Field(description="in the order of joint_names [rad] or [m]")
    iterations: Index
    error: Number | None = Field(description="distance of the tool from the target [m]")
    converged: bool


class StateRecord(Strict):
    """One moment of the motion.

    Between neighbours the base turns the shorter way and joints move linearly. A base on wheels rolls along
    one arc, or turns on the spot; an omnidirectional one moves straight.
    """

    base: Three = Field(description="x, y [m], yaw [rad]")
    joints: Many[Number] = Field(description="in the order of joint_names [rad] or [m]")
    kind: Literal["setpoint", "step", "transit"]
    setpoint: Index | None = Field(description="counts from 0")
    time: Number | None = Field(description="[s]")
    tool: Three = Field(description="x, y, z [m]")
    tool_on: bool | None = Field(
        default=None, description="the tool works from here to the next state; where the task tells strokes"
    )


class MultiPolygonRecord(Strict):
    """A GeoJSON MultiPolygon on the floor [m]; it may be empty."""

    type: Literal["MultiPolygon"]
    coordinates: Many[Annotated[Many[Ring], Field(min_length=1)]]


class PartsRecord(Strict):
    """A GeoJSON GeometryCollection: the parts that the properties name, in their order."""

    type: Literal["GeometryCollection"]
    geometries: Annotated[list[MultiPolygonRecord], Field(min_length=2, max_length=3)]


class PropertiesRecord(Strict):
    """Properties of an area feature."""

    setpoint: Index = Field(description="counts from 0")
    parts: Annotated[list[Literal["admissible", "pruned", "rejected"]], Field(min_length=2, max_length=3)] = (
        Field(description="in this order; without pruned where that is all of the admissible part")
    )


class AreaRecord(Strict):
    """Floor areas of one set-point."""

    type: Literal["Feature"]
    properties: PropertiesRecord
    geometry: PartsRecord


class AreasRecord(Strict):
    """A GeoJSON FeatureCollection, one feature per set-point in order, or none where they are too many."""

    type: Literal["FeatureCollection"]
    features: Many[AreaRecord]


class StopRecord(Strict):
    """A place at which the base stands still while the arm does some set-points."""

    base: Three = Field(description="x, y [m], yaw [rad]")
    setpoints: Annotated[Many[Index], Field(min_length=1)] = Field(description="they follow one another")
    tolerance: NotNegative = Field(description="radius of the circle to park in, at this heading [m]")
    criterion: StopCriterion = Field(description="what made this the best place of the stop")
    probability: Annotated[float, Field(ge=0, le=1)] | None = Field(
        default=None, description="lower bound: the stop is good for its set-points after parking"
    )


class SkippedRecord(Strict):
    """A set-point of the world as given that the plan leaves out."""

    setpoint: Index = Field(description="its index in the task as given; counts from 0")
    target: Three = Field(description="x, y, z [m]")
    direction: Three | None = Field(default=None, description="unit tool axis")
    orientation: Annotated[list[Three], Field(min_length=3, max_length=3)] | None = Field(
        default=None, description="rows of the tool's rotation matrix"
    )
    cone: Annotated[float, Field(gt=0, le=np.pi)] = Field(
        default=Target.cone, description="allowed deviation from the direction [rad]"
    )
    verdict: Verdict = Field(description="as in an explanation of why not")
    reason: str
    code: ReasonCode = Field(default="", description="the reason in a word")
    name: str = Field(default="", description="of the target")


class PlanRecord(Strict):
    """A whole-path plan of regionik. Metres, radians, seconds; right-handed, z up, x forward."""

    version: Literal[1, 2]
    world: dict[str, Any] = Field(description="the world file, embedded: a plan can be verified alone")
    seed: int
    joint_names: Many[str]
    setpoints: Many[SetpointRecord] = Field(description="one for each target of the world, in order")
    states: Many[StateRecord] = Field(description="the whole motion in order")
    areas: AreasRecord
    lift_offs: Index = Field(description="runs of transits after the first set-point")
    stops: Many[StopRecord] = Field(description="base stops in mode stops; empty otherwise")
    stats: dict[str, Any] = Field(description="figures that verify computes again; others are not read")
    skipped: Many[SkippedRecord] = Field(
        default=[], description="set-points of the task as given that rules.skip_unreachable leaves out"
    )


def save_plan(plan: Plan, path: str | os.PathLike[str]) -> None:
    """Write a plan to a file, whole or not at all; `load_plan` reads it back.

    Parameters
    ----------
    plan : Plan
    path : path
        The file that is written: JSON, which holds the world and the robot in full.

    Raises
    ------
    InputError
        When the file cannot be written, or is too large to be read back.

    Warns
    -----
    FileNote
        When areas are left out, as the file could not be read back with them.
    """
    write_atomic(path, plan_to_text(plan))


def load_plan(path: str | os.PathLike[str]) -> Plan:
    """Read a plan that `save_plan` wrote.

    Only the form of the file is checked; `regionik.verify` checks the plan.

    Parameters
    ----------
    path : path
        A plan file: JSON, which holds the world and the robot in full.

    Returns
    -------
    Plan
        The plan with the world that it was made for. Its areas are empty where the file has none.

    Raises
    ------
    InputError
        One line: file, place, what was expected.
    """
    where = str(path)
    record = _record(_read(Path(path)), where)
    world = world_from_document(record.world, f"{where}: world", Path(path).parent)
    for place, expected, got in _mismatches(record, world):
        raise InputError(f"{where}: {place}: expected {expected}, got {got}")
    return Plan(
        world=world,
        seed=record.seed,
        setpoints=tuple(_configuration(s) for s in record.setpoints),
        motion=_motion(record, world),
        areas=tuple(_area(a, f"{where}: areas.features[{k}]") for k, a in enumerate(record.areas.features)),
        lift_offs=record.lift_offs,
        stops=tuple(_stop(s) for s in record.stops),
        stats=stored_figures(record.stats),
        skipped=tuple(_skipped(s, f"{where}: skipped[{k}]") for k, s in enumerate(record.skipped)),
    )


def plan_schema() -> dict[str, Any]:
    """JSON Schema of ``plan.json`` (draft 2020-12), as committed in ``docs/plan.schema.json``."""
    schema = PlanRecord.model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema, "title": "regionik plan"}


def _read(path: Path) -> Any:
    with reading(path, MAX_BYTES):
        data = path.read_bytes()
    try:
        return json.loads(data, parse_constant=_refuse_constant)
    except RecursionError:
        raise InputError(f"{path}: expected a plan in JSON, this is nested too deep") from None
    except ValueError as error:
        raise InputError(f"{path}: expected a plan in JSON: {error}") from None


def _refuse_constant(constant: str) -> None:
    raise ValueError(f"every number must be finite, got {constant}")


def _record(document: Any, where: str) -> PlanRecord:
    if not isinstance(document, dict):
        raise InputError(f"{where}: expected a plan, a JSON object, got {type(document).__name__}")
    if "robot" in document and "states" not in document:
        raise InputError(f"{where}: expected a plan, this is a world: regionik plan {where} makes one of it")
    version = document.get("version")
    if version not in VERSIONS or type(version) is not int:
        expected = " or ".join(map(str, VERSIONS))
        raise InputError(f"{where}: version: expected {expected}, got {json.dumps(version)[:40]}")
    return validated(PlanRecord, document, where)


def _mismatches(record: PlanRecord, world: World) -> Iterator[tuple[str, object, object]]:
    """Mismatches of a plan and its world: place, what was expected, what is there."""
    names, count = list(world.robot.chain.names), len(world.task)
    if record.joint_names != names:
        yield "joint_names", names, record.joint_names
    areas = record.areas.features
    for place, number in (("setpoints", len(record.setpoints)), ("areas.features", len(areas) or count)):
        if number != count:
            yield place, f"{count}, one for each target", number
    for k, (setpoint, target) in enumerate(zip(record.setpoints, world.task, strict=True)):
        if not np.allclose(setpoint.target, target.position, rtol=0.0, atol=1e-9):
            yield f"setpoints[{k}].target", f"the world's {target.position.tolist()}", setpoint.target
    for k, area in enumerate(areas):
        properties, parts = area.properties, tuple(area.properties.parts)
        if properties.setpoint != k or parts not in (PARTS, (PARTS[0], PARTS[2])):
            expected = f"set-point {k}, parts {list(PARTS)}, perhaps without pruned"
            yield f"areas.features[{k}].properties", expected, f"{properties.setpoint}, {properties.parts}"
        elif len(area.geometry.geometries) != len(parts):
            expected = f"{len(parts)}, one for each part"
            yield f"areas.features[{k}].geometry.geometries", expected, len(area.geometry.geometries)
    if not record.states:
        yield "states", "at least one state", "none"
    joints = {"setpoints": [s.joints for s in record.setpoints], "states": [s.joints for s in record.states]}
    for place, rows in joints.items():
        for k, row in enumerate(rows):
            if len(row) != len(names):
                yield f"{place}[{k}].joints", f"{len(names)} numbers", len(row)
    indices = [(f"stops[{k}].setpoints", max(stop.setpoints)) for k, stop in enumerate(record.stops)]
    indices += [(f"states[{k}].setpoint", state.setpoint or 0) for k, state in enumerate(record.states)]
    for place, index in indices:
        if index >= count:
            yield place, f"0 to {count - 1}", index


def _configuration(record: SetpointRecord) -> Configuration:
    error = np.nan if record.error is None else record.error
    base, joints = np.array(record.base, dtype=np.float64), np.array(record.joints, dtype=np.float64)
    return Configuration(base, joints, error, record.iterations, record.converged)


def _stop(record: StopRecord) -> Stop:
    base = np.array(record.base, dtype=np.float64)
    return Stop(base, tuple(record.setpoints), record.tolerance, record.criterion, record.probability)


def _skipped(record: SkippedRecord, where: str) -> Skipped:
    direction, orientation = (
        None if value is None else np.array(value, dtype=np.float64)
        for value in (record.direction, record.orientation)
    )
    with located(where, ""):
        position = np.array(record.target, dtype=np.float64)
        target = Target(position, direction, record.cone, orientation, record.name)
    return Skipped(record.setpoint, target, record.verdict, record.reason, record.code)


def _motion(record: PlanRecord, world: World) -> Motion:
    states, on = record.states, [s.tool_on for s in record.states]
    return Motion(
        base=np.array([s.base for s in states], dtype=np.float64),
        joints=np.array([s.joints for s in states], dtype=np.float64).reshape(-1, world.robot.chain.dof),
        kind=np.array([s.kind for s in states]),
        setpoint=np.array([-1 if s.setpoint is None else s.setpoint for s in states], dtype=np.int64),
        time=np.array([np.nan if s.time is None else s.time for s in states]),
        tool=np.array([s.tool for s in states], dtype=np.float64),
        tool_on=None if None in on else np.array(on),
    )


def _area(record: AreaRecord, where: str) -> PlannedArea:
    shapes = [
        _multipolygon(part, f"{where}.geometry.geometries[{k}]")
        for k, part in enumerate(record.geometry.geometries)
    ]
    return PlannedArea(shapes[0], shapes[-2], shapes[-1])  # pruned is the admissible part unless given


def _multipolygon(record: MultiPolygonRecord, where: str) -> MultiPolygon:
    for p, polygon in enumerate(record.coordinates):
        for r, ring in enumerate(polygon):
            if ring[0] != ring[-1]:
                raise InputError(f"{where}.coordinates[{p}][{r}]: expected a closed ring, its ends differ")
    shape = MultiPolygon([Polygon(outer, holes) for outer, *holes in record.coordinates])
    if not shape.is_valid:
        raise InputError(f"{where}: expected simple polygons: {shapely.is_valid_reason(shape)}")
    return shape
