"""World files, version 1: a World from YAML or JSON, and back."""

from __future__ import annotations

import warnings
from dataclasses import asdict, replace
from itertools import chain
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import ConfigDict, Field

from regionik.worlds.bundled import world_path
from regionik.worlds.documents.environment import (
    FloorPart,
    MoveItScene,
    ObstaclePart,
    ZonePart,
    floor_to_document,
    huge_meshes,
    read_floor,
    read_obstacle,
    solid_to_document,
    zone_to_document,
)
from regionik.worlds.documents.frames import FramesPart, read_frames
from regionik.worlds.documents.robots import RobotPart, read_robot, robot_to_document
from regionik.worlds.documents.tasks import PiecePart, read_task, task_to_document, without_repeats
from regionik.worlds.drives import BasePlanner
from regionik.worlds.errors import FileNote, InputError, located, located_error, read_each
from regionik.worlds.limits import Criteria, Execution, ParkingAccuracy, Speeds
from regionik.worlds.obstacles import Solid
from regionik.worlds.readers.text import (
    MAX_NAME_LENGTH,
    SUFFIXES,
    Many,
    Matrix3,
    NotNegative,
    OneLine,
    Positive,
    Strict,
    Vec3,
    is_file_name,
    join_names,
    name_as_text,
    plain_mapping,
    read_document,
    validated,
)
from regionik.worlds.robot import Robot, check_criteria
from regionik.worlds.scene import (
    FrameNames,
    Heading,
    Mode,
    Order,
    Rules,
    Start,
    StopCriterion,
    Target,
    World,
)

_MAX_TARGET_DEPTH = 1e-6  # a target this far inside a solid is taken for a mistake [m]


class StartPart(Strict):
    base: Vec3 = Field(description="x, y [m], yaw [rad]")
    joints: Many[float] = Field(description="one value a joint")


class CriteriaPart(Strict):
    """The fields of `regionik.worlds.limits.Criteria`, checked."""

    manipulability: NotNegative | None = Field(default=None, description="least manipulability [m3]")
    joint_margin: Annotated[float, Field(ge=0, lt=0.5)] | None = Field(
        default=None, description="least distance from both limits, as a share of a joint's range"
    )
    effort: Positive | list[Positive] | None = Field(
        default=None,
        description="largest torque from gravity, for all joints or for each [N m], [N] if sliding",
    )


class ExecutionPart(Strict):
    """The fields of `regionik.worlds.limits.Execution`, checked."""

    base_error: NotNegative = Field(default=Execution.base_error, description="of the base's place [m]")
    heading_error: NotNegative = Field(default=Execution.heading_error, description="of its heading [rad]")
    tool_error: NotNegative = Field(
        default=Execution.tool_error, description="of the tool on its path; below path_tolerance [m]"
    )
    arm_error: NotNegative | None = Field(
        default=None, description="of any point of the arm [m]; without it as much as base and tool are off"
    )


class ParkingPart(Strict):
    """The fields of `regionik.worlds.limits.ParkingAccuracy`, checked."""

    covariance: Matrix3 | None = Field(
        default=None, description="of x, y [m2], yaw [rad2] in the world's axes"
    )
    deviations: Vec3 | None = Field(
        default=None, description="standard deviations of x, y [m], yaw [rad], in place of a covariance"
    )
    probability: Annotated[float, Field(gt=0, lt=1)] | None = Field(
        default=None, description="least probability that a stop is still good for its set-points"
    )


class RulesPart(Strict):
    """The fields of `regionik.worlds.scene.Rules`, checked."""

    clearance: NotNegative = Rules.clearance
    arm_clearance: NotNegative = Rules.arm_clearance
    step: Positive = Rules.step
    heading: Heading = Rules.heading
    tolerance: Positive = Rules.tolerance
    path_tolerance: Positive = Rules.path_tolerance
    tool_contact: NotNegative = Rules.tool_contact
    contact_depth: NotNegative = Field(
        default=Rules.contact_depth,
        description="how deep the last link may sink into what the tool touches, beyond the tolerance; "
        "0 lets it touch only [m]",
    )
    reach_margin: NotNegative = Rules.reach_margin
    max_lift_offs: Annotated[int, Field(ge=0)] | None = Rules.max_lift_offs
    lift_within: bool = Field(
        default=Rules.lift_within,
        description="the tool may be lifted within a stroke that cannot be worked in one go",
    )
    avoidance: bool = Rules.avoidance
    smooth: bool = Field(
        default=Rules.smooth,
        description="base and arm go on together where they can, and their motion is made smooth; false: "
        "M-FABRIK's configurations as they were found, the base led on by Algorithm 2 and OMPL",
    )
    base_planner: BasePlanner = Field(
        default=Rules.base_planner,
        description="OMPL's planner of base moves that go round things, and of base and arm together; from "
        "RRTstar on they better their ways as long as they may, which takes longer",
    )
    solid_floor: bool = Field(
        default=Rules.solid_floor, description="the arm keeps clear of the floor, as of any other solid"
    )
    mode: Mode = Field(
        default=Rules.mode,
        description="continuous: the base drives while the tool works; stops: it stands still at as few "
        "stops as possible, and the tool is lifted while it drives between them",
    )
    order: Order = Field(
        default=Rules.order,
        description="of the set-points; any goes with mode stops, for drilling and the like",
    )
    stop_criterion: StopCriterion = Field(
        default=Rules.stop_criterion,
        description="best place of a stop: tolerance, the middle of the largest circle to park in; "
        "clearance, farthest from where the base may not be; manipulability, its least over the stop's "
        "set-points largest; effort, the largest joint torque that holds a load at the tool smallest; "
        "distance, the shortest way through all stops; probability, most probably good after parking",
    )
    stop_tolerance: NotNegative = Field(
        default=Rules.stop_tolerance, description="least radius of the circle to park in [m]"
    )
    criteria: CriteriaPart | None = None
    execution: ExecutionPart | None = None
    parking: ParkingPart | None = None
    skip_unreachable: bool = Field(
        default=Rules.skip_unreachable,
        description="leave out set-points that cannot be reached, and name them, in place of a refusal",
    )


class SpeedsPart(Strict):
    """The fields of `regionik.worlds.limits.Speeds`, checked."""

    joint_velocity: Positive | list[Positive] | None = None
    joint_acceleration: Positive | list[Positive] | None = None
    joint_jerk: Positive | list[Positive] | None = None
    base_velocity: Positive = Speeds.base_velocity
    base_acceleration: Positive = Speeds.base_acceleration
    base_jerk: Positive | None = Speeds.base_jerk
    turn_velocity: Positive = Speeds.turn_velocity
    turn_acceleration: Positive = Speeds.turn_acceleration
    turn_jerk: Positive | None = Speeds.turn_jerk
    steering_velocity: Positive = Speeds.steering_velocity
    wheel_velocity: Positive | None = Speeds.wheel_velocity
    tool_velocity: Positive | None = Speeds.tool_velocity
    blend: Positive = Speeds.blend


class WorldDocument(Strict):
    """A regionik world file, version 1. Metres, radians; right-handed, z up."""

    model_config = ConfigDict(title="regionik world file")

    version: Literal[1] = Field(description="1, the version of this format")
    name: OneLine | None = None
    about: OneLine | None = None
    robot: RobotPart = Field(description="a bundled name, or a mapping with one of name, dh, urdf, chain")
    floor: FloorPart = Field(description="{polygon: [[x, y], ...]} or {map: file}")
    obstacles: Many[ObstaclePart] = []
    moveit_scene: MoveItScene | None = Field(default=None, description="more obstacles, of MoveIt")
    zones: Many[ZonePart] = Field(default=[], description="where the base stays inside or outside")
    frames: FramesPart = Field(
        default={}, description="poses by name; map, base_link, tool0: their names in exports"
    )
    start: StartPart | None = None
    task: Annotated[Many[PiecePart], Field(min_length=1)] = Field(description="set-points")
    rules: RulesPart = RulesPart()
    speeds: SpeedsPart | None = Field(default=None, description="limits by which plans are timed")


def load_world(name_or_path: str | Path) -> World:
    """Return a bundled world by its name, or the world of a .yaml, .yml or .json file.

    Parameters
    ----------
    name_or_path : str or Path
        One of the names that ``regionik worlds`` lists, or a path with one of these suffixes. Files that a
        world file names (URDF, maps, CSV) are relative to it.

    Returns
    -------
    World

    Raises
    ------
    InputError
        One line: the file, the place in it, what was expected and the valid choices.

    Warns
    -----
    FileNote
        Where set-points of a path are given twice in a row, which are taken once.

    Examples
    --------
    >>> world = load_world("pillar")
    >>> len(world.task), world.obstacles[0].name
    (15, 'pillar')
    """
    is_file = is_file_name(name_or_path, SUFFIXES)
    path = Path(name_or_path) if is_file else world_path(str(name_or_path))
    document = read_document(path)
    if {"states", "setpoints"} <= set(document):
        raise InputError(f"{path}: expected a world, this is a plan: regionik show {path} shows it")
    world = world_from_document(document, str(path), path.parent)
    if world.rules.mode == "stops":
        return world
    task, again = without_repeats(world.task)
    if not again:
        return world
    names = join_names((str(k + 1) for k in again), 12)
    what = (
        f"set-point {names} is the one before it"
        if len(again) == 1
        else f"set-points {names} are those before"
    )
    warnings.warn(f"{path}: {what} given again: taken once", FileNote, stacklevel=2)
    return replace(world, task=task)


def world_from_document(document: dict[str, Any], where: str = "world", folder: Path | None = None) -> World:
    """Return the world of a document of plain values, as a world file has them.

    ``where`` is the name of the document in error messages, and the world's where it gives none. File names
    are relative to a ``folder``, the working directory by default.
    """
    model = validated(WorldDocument, plain_mapping(document, where), where)
    folder = Path() if folder is None else folder
    robot = read_robot(model.robot, where, folder)
    floor = read_floor(model.floor, where, folder)
    parts = enumerate(model.obstacles)
    frames, poses = read_frames(model.frames, where)
    groups = [read_obstacle(part, where, f"obstacles[{k}]", folder, poses) for k, part in parts]
    for note in huge_meshes(model.obstacles, groups, floor):
        warnings.warn(f"{where}: {note}", FileNote, stacklevel=3)
    obstacles = tuple(chain.from_iterable(groups))
    if model.moveit_scene is not None:
        obstacles += model.moveit_scene.solids(where, folder, poses)
    zones = read_each(where, "zones", model.zones, ZonePart.zone)
    task, places = read_task(model.task, where, folder, poses)
    rules = _rules(model.rules, robot, where)
    start = None if model.start is None else Start(np.array(model.start.base), np.array(model.start.joints))
    speeds = None if model.speeds is None else _speeds(model.speeds, robot, where)
    name = model.name or name_as_text(Path(where).name).partition(".")[0][:MAX_NAME_LENGTH] or "world"
    with located(where, ""):
        about = model.about or ""
        world = World(name, robot, floor, obstacles, task, rules, start, about, speeds, frames, zones)
        if start is not None:
            robot.chain.check_limits(start.joints.tolist(), "start.joints")
    _check_targets(task, places, world.solids, where)
    return world


def world_to_document(world: World) -> dict[str, Any]:
    """Return a document that holds the whole world: no other file is needed to read it back.

    Maps become prisms, meshes lists of triangles, generated tool paths lists of points. Reading it back
    gives an equal world, to the last bit.
    """
    document: dict[str, Any] = {"version": 1, "name": world.name}
    if world.about:
        document["about"] = world.about
    document["robot"] = robot_to_document(world.robot)
    document["floor"] = floor_to_document(world.floor)
    document["obstacles"] = [solid_to_document(solid) for solid in world.obstacles]
    if world.zones:
        document["zones"] = [zone_to_document(zone) for zone in world.zones]
    if world.start is not None:
        document["start"] = {"base": world.start.base.tolist(), "joints": world.start.joints.tolist()}
    document["task"] = task_to_document(world.task)
    document["rules"] = _plain(asdict(world.rules))
    if world.frames != FrameNames():
        document["frames"] = asdict(world.frames)
    if world.speeds is not None:
        document["speeds"] = _plain(asdict(world.speeds))
    return document


def _rules(part: RulesPart, robot: Robot, where: str) -> Rules:
    criteria = None
    if part.criteria is not None:
        with located(where, "rules"):
            criteria = Criteria(**part.criteria.model_dump())
            check_criteria(criteria, robot)
    with located(where, "rules."):
        execution = None if part.execution is None else Execution(**part.execution.model_dump())
        parking = None if part.parking is None else _parking(part.parking)
        parts = {"criteria": criteria, "execution": execution, "parking": parking}
        return Rules(**{**part.model_dump(), **parts})


def _parking(part: ParkingPart) -> ParkingAccuracy:
    if (part.covariance is None) == (part.deviations is None):
        raise InputError("parking: expected one of covariance, deviations")
    if part.deviations is not None and min(part.deviations) < 0:
        raise InputError(f"parking: deviations: must be at least 0, got {min(part.deviations):g}")
    covariance = part.covariance or np.diag(np.square(part.deviations or ()))
    return ParkingAccuracy(covariance, part.probability)


def _speeds(part: SpeedsPart, robot: Robot, where: str) -> Speeds:
    with located(where, "speeds"):
        speeds = Speeds(**part.model_dump())
        speeds.joint_limits(robot.chain)
        speeds.joint_jerks(robot.chain)
    return speeds


def _check_targets(
    task: tuple[Target, ...], places: list[str], solids: tuple[Solid, ...], where: str
) -> None:
    """Refuse set-points that lie inside a solid."""
    points = np.array([target.position for target in task])
    for solid in solids:
        low, high = solid.bounds
        for i in np.flatnonzero(((points > low) & (points < high)).all(axis=1)):
            depth = -solid.distance(points[i])
            if depth > _MAX_TARGET_DEPTH:
                text = (
                    f"set-point {i + 1} of {len(task)} lies {depth:.6g} m inside {solid.name!r}, "
                    "expected it on the surface or outside"
                )
                raise located_error(where, places[i], text)


def _plain(value: Any) -> Any:
    """Return plain values with lists instead of tuples."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, tuple) else value
