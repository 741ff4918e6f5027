"""Worlds: robot, floor, obstacles, start, set-points, rules, and names of frames."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from math import inf
from typing import Any, Literal, get_args

import numpy as np
from shapely.geometry import MultiPolygon, Polygon

from regionik.worlds.arrays import Array, Mask, check_near_origin, freeze, frozen, one_line, unit_vector
from regionik.worlds.drives import BasePlanner
from regionik.worlds.errors import InputError, located
from regionik.worlds.limits import Criteria, Execution, ParkingAccuracy, Speeds
from regionik.worlds.obstacles import Box, Prism, Solid, as_polygon
from regionik.worlds.robot import Robot
from regionik.worlds.strokes import check_strokes, worked_ways
from regionik.worlds.zones import Zone


@dataclass(frozen=True)
class FrameNames:
    """Names in messages and parameters: of the frames of the world, the base and the tool.

    >>> FrameNames(base_link="cart/base_link")
    FrameNames(map='map', base_link='cart/base_link', tool0='tool0')
    """

    map: str = "map"
    base_link: str = "base_link"
    tool0: str = "tool0"

    def __post_init__(self) -> None:
        for key, name in vars(self).items():
            with located("", key):
                check_frame_name(name)
        if len(set(vars(self).values())) < len(vars(self)):
            raise InputError(f"{', '.join(vars(self))}: expected a name of its own for each")


def check_frame_name(name: str) -> None:
    """Refuse what tf2 takes for no name of a frame, by an `InputError`."""
    if not name.strip() or name != name.strip() or name.startswith("/"):
        raise InputError(f"expected the name of a frame, as map or odom, without a slash; got {name!r}")


def checked_name(name: str) -> str:
    """Return the name of a set-point itself, once it is known to fit on a line."""
    if len(name) > MAX_TARGET_NAME or not name.isprintable():
        text = f"expected at most {MAX_TARGET_NAME} printable characters"
        raise InputError(f"{text}, got {name[:MAX_TARGET_NAME]!r}")
    return name


Heading = Literal["free", "face_target", "fixed"]
Mode = Literal["continuous", "stops"]
Order = Literal["given", "any"]
MAX_TARGET_NAME = 80  # [characters]
FLOOR_THICKNESS = 30.0  # thickness of the solid floor, and how far it goes on beyond the floor's edge [m]
StopCriterion = Literal["tolerance", "clearance", "manipulability", "effort", "distance", "probability"]


@dataclass(frozen=True, eq=False)
class Target:
    """One set-point of the tool.

    Attributes
    ----------
    position : (3,) array
        In the world [m].
    direction : (3,) array or None
        Unit tool axis (the tool frame's z); None leaves it free.
    cone : float
        Allowed deviation from ``direction`` [rad]. One of pi leaves the tool free: then there is neither a
        direction nor an orientation.
    orientation : (3, 3) array or None
        Full tool orientation; its third column is ``direction``.
    name : str
        What people call it, in messages, answers and files; empty for none.
    stroke : int or None
        0 for travel, else as in `regionik.worlds.strokes`; None for all of a task that tells none.
    speed : float or None
        Greatest speed of the tool while it works its way to it [m/s]; None for no bound of its own.
    flow : float or None
        Material fed per metre of that way, in any unit: of G-code, E in mm of filament; None for none.
    lead : bool
        True on the lead-in or lead-out of a stroke, to and from which the tool is down and does not work.

    Examples
    --------
    >>> Target([0.5, 0.2, 0.3], direction=[0, 0, -2], cone=0.1)
    Target(position=[0.5, 0.2, 0.3], direction=[0.0, 0.0, -1.0], cone=0.1)
    """

    position: Array
    direction: Array | None = None
    cone: float = 0.05
    orientation: Array | None = None
    name: str = ""
    stroke: int | None = None
    speed: float | None = None
    flow: float | None = None
    lead: bool = False

    def __post_init__(self) -> None:
        if self.name:
            with located("target", "name"):
                checked_name(self.name)
        freeze(self, "target", position=(3,))
        check_near_origin(self.position, "target: position")
        if self.orientation is not None:
            R = frozen(self.orientation, (3, 3), "target: orientation")
            object.__setattr__(self, "orientation", R)
            object.__setattr__(self, "direction", R[:, 2])
        if self.direction is not None:
            object.__setattr__(self, "direction", unit_vector(self.direction, "target: direction"))
        if not 0 < self.cone <= np.pi:
            raise InputError(f"target: cone must be above 0 and at most pi, got {self.cone}")
        if self.speed is not None and not 0 < self.speed < inf:
            raise InputError(f"target: speed must be above 0 and finite, got {self.speed}")
        if self.flow is not None and not 0 <= self.flow < inf:
            raise InputError(f"target: flow must be at least 0 and finite, got {self.flow}")
        if self.lead and not self.stroke:
            raise InputError(f"target: lead: expected a stroke from 1 on beside it, got {self.stroke}")
        if self.cone >= np.pi:
            for free in ("direction", "orientation"):
                object.__setattr__(self, free, None)

    __repr__ = one_line


@dataclass(frozen=True)
class Rules:
    """Rules that a plan must keep; lengths in metres.

    Attributes
    ----------
    clearance : float
        Least distance of the base from every solid that it could hit and that has none of its own.
    arm_clearance : float
        Least distance of the arm's links from every solid.
    step : float
        Longest base step between two states (rho of Algorithm 2).
    heading : {"free", "face_target", "fixed"}
    tolerance : float
        Largest distance of the tool from its set-point.
    path_tolerance : float
        Largest distance of the tool from the segment between set-points while it is on its way.
    tool_contact : float
        Distance from a set-point within which the tool may touch the solid that the set-point lies on; what
        of the last link is farther than this from the tool point keeps its clearance from that solid too.
    contact_depth : float
        Depth to which the last link may sink into what it touches, beyond the tolerance; 0 to touch only.
    reach_margin : float
        Kept from both ends of the reach, where the arm is stretched or folded.
    max_lift_offs : int or None
        Largest number of times that the tool may leave the path; None for any.
    lift_within : bool
        The tool may be lifted within a stroke that is not worked in one go, which else is refused.
    avoidance : bool
        Plans lead the arm around obstacles; without it a plan whose arm touches something is refused.
    smooth : bool
        Base and arm go on together where they can, and their motion is made smooth. Without it plans are the
        papers': configurations of M-FABRIK as they were found, the base led on by Algorithm 2 and OMPL.
    base_planner : {"RRTConnect", "BKPIECE1", "RRTstar", "InformedRRTstar", "BITstar", "AORRTC"}
        OMPL's planner, by its name there, of base moves that neither a straight way nor the floor's shortest
        path makes, and of moves of base and arm together. From RRTstar on they better their ways as long as
        they may, which takes longer.
    solid_floor : bool
        The arm keeps clear of the floor, the plane z = 0, as of any other solid.
    mode : {"continuous", "stops"}
        In mode ``continuous`` the base drives while the tool works; in mode ``stops`` it stands still at as
        few stops as possible, and the tool is lifted while it drives from one to the next.
    order : {"given", "any"}
        Order of the set-points: as given, or, in mode ``stops``, any that saves stops and distance.
    stop_criterion : {"tolerance", "clearance", "manipulability", "effort", "distance", "probability"}
        Best place of a stop: the middle of the largest circle in which the base may park; the farthest from
        where it may not be; the largest of the least manipulability (Yoshikawa's volume of the tool's
        velocities) over its set-points; the smallest of the largest torque with which the arm, itself
        without weight, holds a load at its tool; the places of the shortest way through all stops; or the
        most probably good for its set-points after parking.
    stop_tolerance : float
        Least radius of the circle in which the base may park at every stop [m].
    criteria : Criteria or None
        Criteria for the arm's posture at every set-point.
    execution : Execution or None
        Tracking errors with which the plan must still hold; None for a robot that is where the plan has it.
    parking : ParkingAccuracy or None
        Error with which the base parks at stops, and the least probability asked that the arm still does its
        work there; in mode ``stops``.
    skip_unreachable : bool
        Plans leave out the set-points that cannot be reached, as is proven or as far as is known, and name
        them; without it one such set-point refuses the whole plan.

    Examples
    --------
    >>> Rules(clearance=0.05, mode="stops")
    Rules(clearance=0.05, mode='stops')
    """

    clearance: float = 0.2
    arm_clearance: float = 0.0
    step: float = 0.1
    heading: Heading = "free"
    tolerance: float = 0.001
    path_tolerance: float = 0.01
    tool_contact: float = 0.05
    contact_depth: float = 0.0
    reach_margin: float = 0.005
    max_lift_offs: int | None = None
    lift_within: bool = False
    avoidance: bool = True
    smooth: bool = True
    base_planner: BasePlanner = "RRTConnect"
    solid_floor: bool = True
    mode: Mode = "continuous"
    order: Order = "given"
    stop_criterion: StopCriterion = "tolerance"
    stop_tolerance: float = 0.01
    criteria: Criteria | None = None
    execution: Execution | None = None
    parking: ParkingAccuracy | None = None
    skip_unreachable: bool = False

    def __post_init__(self) -> None:
        for key, value in vars(self).items():
            if isinstance(value, int | float) and not (
                0 <= value < inf and (value or key not in _ABOVE_ZERO)
            ):
                expected = "above 0" if key in _ABOVE_ZERO else "at least 0"
                raise InputError(f"{key}: must be {expected}, got {value:g}")
        for key, choices in _CHOICES.items():
            if getattr(self, key) not in get_args(choices):
                valid = ", ".join(get_args(choices))
                raise InputError(f"{key}: expected one of {valid}, got {getattr(self, key)!r}")
        if self.order == "any" and self.mode != "stops":
            raise InputError("order: any needs rules.mode: stops; in mode continuous it is given")
        if self.parking is not None and self.mode != "stops":
            raise InputError("parking: needs rules.mode: stops; in mode continuous there is none")
        if self.parking is None and self.stop_criterion == "probability":
            raise InputError("stop_criterion: probability goes with rules.parking")
        if self.mode == "stops" and self.heading == "face_target":
            text = "face_target turns the base at every set-point, but at a stop it stands still"
            raise InputError(f"heading: {text}; expected free or fixed")
        if self.planned_path_tolerance <= 0:
            text = f"must be below path_tolerance, {self.path_tolerance:g} m"
            raise InputError(f"execution: tool_error: {text}, got {self.errors.tool_error:g}")

    __repr__ = one_line

    @property
    def deepest_contact(self) -> float:
        """Depth to which the last link may sink into what it touches, the tool's tolerance included."""
        return self.contact_depth + self.tolerance

    @property
    def errors(self) -> Execution:
        """Tracking errors to allow for, zeros where there is no `execution`."""
        return self.execution or Execution()

    @property
    def planned_path_tolerance(self) -> float:
        """Tolerance of the path that remains for the plan, less the tool's tracking error [m]."""
        return self.path_tolerance - self.errors.tool_error


_ABOVE_ZERO = ("step", "tolerance", "path_tolerance")
_CHOICES: dict[str, Any] = {
    "heading": Heading,
    "mode": Mode,
    "order": Order,
    "stop_criterion": StopCriterion,
    "base_planner": BasePlanner,
}


@dataclass(frozen=True)
class Floor:
    """Area where the base may drive before obstacles are taken away.

    Attributes
    ----------
    polygon : Polygon
        Or its corners (n, 2) in order [m].
    cells : tuple of Prism
        Occupied and unknown parts of a map, as solids.

    Examples
    --------
    >>> Floor([[0, 0], [4, 0], [4, 3], [0, 3]])
    Floor(polygon=<12 m2>, cells=0)
    """

    polygon: Polygon
    cells: tuple[Prism, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "polygon", as_polygon(self.polygon, "floor: polygon"))
        object.__setattr__(self, "cells", tuple(self.cells))
        if any(cell.clearance is not None for cell in self.cells):
            raise InputError("floor: cells: expected that they keep the clearance of the rules")

    def __repr__(self) -> str:
        return f"Floor(polygon=<{self.polygon.area:g} m2>, cells={len(self.cells)})"


@dataclass(frozen=True, eq=False)
class Start:
    """Pose of the robot before it sets off.

    Attributes
    ----------
    base : (3,) array
        x, y [m], yaw [rad].
    joints : (dof,) array
        [rad] or [m]

    Examples
    --------
    >>> Start([0, 0, 1.5], [0, 1, 0, 1, 0])
    Start(base=[0.0, 0.0, 1.5], joints=[0.0, 1.0, 0.0, 1.0, 0.0])
    """

    base: Array
    joints: Array

    def __post_init__(self) -> None:
        freeze(self, "start", base=(3,), joints=(None,))
        check_near_origin(self.base[:2], "start: base")

    __repr__ = one_line


@dataclass(frozen=True, eq=False)
class World:
    """Everything that a plan depends on.

    Attributes
    ----------
    name : str
    robot : Robot
    floor : Floor
    obstacles : tuple of Solid
        Each under a name of its own.
    task : tuple of Target
        Set-points in order.
    rules : Rules
    start : Start or None
    about : str
        One line of description.
    speeds : Speeds or None
        Limits by which plans are timed; None leaves them without times, unless the robot has speeds.
    frames : FrameNames
        What exports call the frames of world, base and tool.
    zones : tuple of Zone
        Where the base stays inside or outside, all of them at once, each under a name of its own.

    Examples
    --------
    >>> from regionik.worlds.bundled import robot_named
    >>> floor = Floor([[-1, -1], [4, -1], [4, 2], [-1, 2]])
    >>> World("empty", robot_named("youbot"), floor, task=[Target([1, 0, 0.3])])
    World('empty', robot='youbot', obstacles=0, set_points=1, mode='continuous')
    """

    name: str
    robot: Robot
    floor: Floor
    obstacles: tuple[Solid, ...] = ()
    task: tuple[Target, ...] = ()
    rules: Rules = field(default_factory=Rules)
    start: Start | None = None
    about: str = ""
    speeds: Speeds | None = None
    frames: FrameNames = field(default_factory=FrameNames)
    zones: tuple[Zone, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "obstacles", tuple(self.obstacles))
        object.__setattr__(self, "zones", tuple(self.zones))
        object.__setattr__(self, "task", tuple(self.task))
        check_strokes([target.stroke for target in self.task], self.rules.order)
        places: dict[str, str] = {}
        named = (
            ("floor.cells", self.floor.cells),
            ("obstacles", self.obstacles),
            ("zones", self.zones),
        )
        for group, parts in named:
            for k, solid in enumerate(parts):
                place = f"{group}[{k}]"
                if places.setdefault(solid.name, place) != place:
                    text = f"expected a name of its own, {solid.name!r} is {places[solid.name]}"
                    raise InputError(f"{place}.name: {text}")
        if self.open_floor.is_empty:
            raise InputError(f"zones: expected that they leave some of the floor, got none of {self.floor}")
        dof = self.robot.chain.dof
        if self.start is not None and len(self.start.joints) != dof:
            names = ", ".join(self.robot.chain.names)
            raise InputError(f"start.joints: expected {dof} values ({names}), got {len(self.start.joints)}")

    def __repr__(self) -> str:
        sizes = f"obstacles={len(self.obstacles)}, set_points={len(self.task)}, mode={self.rules.mode!r}"
        return f"World({self.name!r}, robot={self.robot.name!r}, {sizes})"

    @cached_property
    def works(self) -> Mask:
        """True where the tool works its way to a set-point from the one before, (k,)."""
        leads = np.array([target.lead for target in self.task], dtype=bool)
        return worked_ways([target.stroke for target in self.task]) & ~leads & ~np.append(False, leads)[:-1]

    @cached_property
    def work_speeds(self) -> Array:
        """Greatest speed of the tool on its way to each set-point, infinite on travel, (k,) [m/s]."""
        told = np.array([inf if target.speed is None else target.speed for target in self.task])
        return np.where(worked_ways([target.stroke for target in self.task]), told, inf)

    @cached_property
    def work_flows(self) -> Array | None:
        """Material fed per metre on the way to each set-point, 0 on travel, (k,); None where none is told."""
        flows = [target.flow for target in self.task]
        if all(flow is None for flow in flows):
            return None
        return np.where(self.works, np.array([flow or 0.0 for flow in flows]), 0.0)

    @cached_property
    def base_allowance(self) -> float:
        """Distance by which any point of the footprint may be off its place in an execution [m]."""
        return self.rules.errors.base_allowance(float(np.linalg.norm(self.robot.footprint, axis=1).max()))

    @property
    def base_clearance(self) -> float:
        """Clearance of the base as planned: that of the rules and what execution may take of it [m]."""
        return self.rules.clearance + self.base_allowance

    def base_clearance_from(self, solid: Solid) -> float:
        """Clearance of the base from a solid as planned: its own, or that of the rules [m]."""
        own = self.rules.clearance if solid.clearance is None else solid.clearance
        return own + self.base_allowance

    @property
    def asks_alike(self) -> bool:
        """True where no solid asks for a clearance of its own."""
        return all(solid.clearance is None for solid in self.solids)

    @cached_property
    def widest_base_clearance(self) -> float:
        """The largest clearance of the base from any solid as planned [m]."""
        return max([self.base_clearance, *map(self.base_clearance_from, self.solids)])

    @cached_property
    def arm_clearance(self) -> float:
        """Clearance of the arm as planned: that of the rules and what execution may take of it [m]."""
        outer = [np.hypot(*one.corners[:, :2].T).max() + one.radius for one in self.robot.base_solids]
        lever = max([float(np.linalg.norm(self.robot.footprint, axis=1).max()), *map(float, outer)])
        return self.rules.arm_clearance + self.rules.errors.arm_allowance(lever)

    @property
    def axis_error(self) -> float:
        """Distance by which the arm axis may be off its place in an execution [m]."""
        return self.rules.errors.base_allowance(float(np.hypot(*self.robot.mount[:2])))

    @cached_property
    def drivable_floor(self) -> Polygon | MultiPolygon:
        """Floor on which the footprint stays as planned: what zones leave, less what execution may take."""
        if not self.base_allowance:
            return self.open_floor
        left: Polygon | MultiPolygon = self.open_floor.buffer(-self.base_allowance, join_style="mitre")
        return left

    @cached_property
    def open_floor(self) -> Polygon | MultiPolygon:
        """What zones leave of the floor."""
        left: Polygon | MultiPolygon = self.floor.polygon
        for zone in self.zones:
            left = zone.left_of(left)
        return left

    @cached_property
    def solids(self) -> tuple[Solid, ...]:
        """Obstacles and occupied map cells together, but for what a solid floor covers."""
        above = tuple(one for one in self.obstacles if one.z_range[1] > 0 or not self.rules.solid_floor)
        return (*above, *self.floor.cells)

    @cached_property
    def floor_slab(self) -> Box | None:
        """The solid floor below z = 0, which the arm keeps clear of; None where the rules leave it out."""
        if not self.rules.solid_floor:
            return None
        x0, y0, x1, y1 = self.floor.polygon.bounds
        size = np.array([x1 - x0 + 2 * FLOOR_THICKNESS, y1 - y0 + 2 * FLOOR_THICKNESS, FLOOR_THICKNESS])
        return Box("the floor", size, np.array([(x0 + x1) / 2, (y0 + y1) / 2, -FLOOR_THICKNESS / 2]))

    @property
    def arm_solids(self) -> tuple[Solid, ...]:
        """Solids that the arm keeps clear of: `solids` and, last, the floor."""
        return self.solids if self.floor_slab is None else (*self.solids, self.floor_slab)
