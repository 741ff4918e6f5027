"""The world: robot, floor, obstacles, start, task and rules."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from shapely.geometry import Polygon

from regionik.worlds.arrays import Array, frozen
from regionik.worlds.criteria import Criteria
from regionik.worlds.errors import InputError
from regionik.worlds.obstacles import Prism, Solid
from regionik.worlds.robot import Robot
from regionik.worlds.speeds import Speeds

Heading = Literal["free", "face_target", "fixed"]
Mode = Literal["continuous", "stops"]
Order = Literal["given", "any"]
StopCriterion = Literal["tolerance", "clearance", "manipulability", "effort", "distance"]


@dataclass(frozen=True, eq=False)
class Target:
    """One set-point of the tool.

    Attributes
    ----------
    position : (3,) array
        [m], in the world.
    direction : (3,) array or None
        Unit tool axis (the tool frame's z); None leaves it free.
    cone : float
        Allowed deviation from ``direction`` [rad].
    orientation : (3, 3) array or None
        Full tool orientation; its third column is ``direction``.
    """

    position: Array
    direction: Array | None = None
    cone: float = 0.05
    orientation: Array | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", frozen(self.position, (3,), "target: position"))
        if self.orientation is not None:
            R = frozen(self.orientation, (3, 3), "target: orientation")
            object.__setattr__(self, "orientation", R)
            object.__setattr__(self, "direction", R[:, 2])
        if self.direction is not None:
            direction = frozen(self.direction, (3,), "target: direction")
            norm = float(np.linalg.norm(direction))
            if norm < 1e-9:
                raise InputError("target: direction must not be zero")
            if abs(norm - 1.0) > 1e-12:  # a unit vector stays as it is, so that files read back equal
                direction = frozen(direction / norm, (3,), "direction")
            object.__setattr__(self, "direction", direction)
        if not 0 < self.cone <= np.pi:
            raise InputError(f"target: cone must be above 0 and at most pi, got {self.cone}")


@dataclass(frozen=True)
class Rules:
    """What a plan must keep; lengths in metres.

    Attributes
    ----------
    clearance : float
        Base to every solid it could hit.
    arm_clearance : float
        Arm links to every solid.
    step : float
        Longest base step between two states (rho of Algorithm 2).
    heading : {"free", "face_target", "fixed"}
    tolerance : float
        Tool to set-point.
    path_tolerance : float
        Tool to the segment between set-points while it is on its way.
    tool_contact : float
        Distance from a set-point within which the tool may touch the solid that the set-point lies on; what
        of the last link is farther than this from the tool point keeps its clearance from that solid too.
    contact_depth : float
        How deep the last link may sink into what it touches, beyond the tolerance; 0 lets it touch only.
    reach_margin : float
        Kept from both ends of the reach, where the arm is stretched or folded.
    max_lift_offs : int or None
        How often the tool may leave the path; None is no bound.
    avoidance : bool
        Whether plans take the arm round things; without it a plan whose arm touches something is refused.
    mode : {"continuous", "stops"}
        Whether the base goes along with the tool, or stands still at as few stops as there can be and the
        tool is lifted while it drives from one to the next.
    order : {"given", "any"}
        Whether set-points are done in their order, or, in mode ``stops``, in whichever saves stops and way.
    stop_criterion : {"tolerance", "clearance", "manipulability", "effort", "distance"}
        Which place of a stop is best: the middle of the largest circle in which the base may park; the
        farthest from where it may not be; that of the largest least manipulability (Yoshikawa's volume of
        the tool's velocities) over its set-points; that of the smallest largest torque with which the arm,
        itself without weight, holds a load at its tool; or the places of the shortest way through all stops.
    stop_tolerance : float
        Radius of the circle in which the base may park at every stop, at the least [m].
    criteria : Criteria or None
        What the arm's posture at every set-point must be good for.
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
    avoidance: bool = True
    mode: Mode = "continuous"
    order: Order = "given"
    stop_criterion: StopCriterion = "tolerance"
    stop_tolerance: float = 0.01
    criteria: Criteria | None = None

    @property
    def deepest_contact(self) -> float:
        """Depth to which the last link may sink into what it touches, the tool's tolerance included."""
        return self.contact_depth + self.tolerance


@dataclass(frozen=True)
class Floor:
    """Where the base may drive before obstacles are taken away.

    ``cells`` are the occupied and unknown parts of a map, as solids.
    """

    polygon: Polygon
    cells: tuple[Prism, ...] = ()


@dataclass(frozen=True, eq=False)
class Start:
    """Where the robot stands at first."""

    base: Array  # (3,) x, y [m], yaw [rad]
    joints: Array  # (dof,)

    def __post_init__(self) -> None:
        object.__setattr__(self, "base", frozen(self.base, (3,), "start: base"))
        object.__setattr__(self, "joints", frozen(self.joints, (None,), "start: joints"))


@dataclass(frozen=True, eq=False)
class World:
    """Everything a plan depends on.

    Attributes
    ----------
    name : str
    about : str
        One line for people.
    robot : Robot
    floor : Floor
    obstacles : tuple of Solid
    task : tuple of Target
        Set-points in order.
    rules : Rules
    start : Start or None
    speeds : Speeds or None
        What plans are timed by; None leaves them without times, unless the robot has speeds.
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

    @property
    def solids(self) -> tuple[Solid, ...]:
        """Obstacles and occupied map cells together."""
        return (*self.obstacles, *self.floor.cells)
