"""Mobile manipulators: an arm on a driving base, and tools on its flange."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import get_args

import numpy as np
import shapely
from numpy.typing import ArrayLike
from shapely.geometry import MultiPoint, Polygon
from shapely.geometry.base import BaseGeometry

from regionik.worlds.arrays import Array, freeze, frozen, one_line
from regionik.worlds.chain import Chain, planar_pose
from regionik.worlds.drives import BaseDrive, BaseKind, drive_of
from regionik.worlds.errors import InputError
from regionik.worlds.limits import Criteria
from regionik.worlds.links import BASE, LinkMass, LinkSolid
from regionik.worlds.prepared import Prepared, made_once
from regionik.worlds.surfaces import VisualSurface

GRAVITY = 9.80665  # standard gravity [m/s2]
BODY_HEIGHT = 0.14  # of a base of which nothing else is known [m]


@dataclass(frozen=True, eq=False)
class Tool:
    """A tool on a robot's flange, which is the tool frame that the robot has without it.

    Attributes
    ----------
    T_flange_tool : (4, 4) array
        The new tool frame in the flange.
    solids : tuple of LinkCapsule, LinkBox or LinkHull
        In the flange; whatever link they name, they move with the last one.
    """

    T_flange_tool: Array
    solids: tuple[LinkSolid, ...] = ()

    def __post_init__(self) -> None:
        freeze(self, "tool", T_flange_tool=(4, 4))
        object.__setattr__(self, "solids", tuple(self.solids))

    __repr__ = one_line


@dataclass(frozen=True, eq=False)
class Robot(Prepared):
    """A mobile manipulator.

    Attributes
    ----------
    name : str
    base : {"omni", "differential", "car"}
    footprint : (n, 2) array
        Corners of the base's convex outline in the base frame [m]; one row is a point base.
    mount : (4,) array
        Arm base frame in the base frame: x, y, z [m], yaw [rad].
    chain : Chain
    solids : tuple of LinkCapsule, LinkBox or LinkHull
        Of the arm's links.
    body_height : float
        The base is its footprint up to this height [m].
    turning_radius : float
        Least turning radius of a car [m].
    gauge : float
        Distance between the wheels that drive a differential base, 0 where it is not known [m].
    carry : (dof,) array
        Joint values with which the arm is driven about, the tool lifted; by default zero, or the limits
        nearest to it.
    base_solids : tuple of LinkCapsule, LinkBox or LinkHull
        Other solids fixed to the base, such as a mast. They keep their distance from obstacles, and from the
        arm, as the arm's links do.
    unchecked : tuple of (str, str)
        Names of solids that need not keep apart, though no joint connects them. The base's own body
        is called "base of" and the robot's name.
    masses : tuple of LinkMass
        Of the arm's links; empty where they are not known.
    payload : float
        Mass held at the tool frame's origin [kg].
    visuals : tuple of VisualSurface
        What pictures show of links; of others they show the solids.

    Examples
    --------
    >>> chain = Chain.from_dh([(0, 0.2, 0, -np.pi / 2, -2, 2), (0, 0, 0.4, 0, -2, 2), (0, 0, 0.3, 0, -2, 2)])
    >>> from regionik.worlds.links import capsules_along
    >>> robot = Robot("lamp", "omni", [[0, 0]], [0, 0, 0.1, 0], chain, capsules_along(chain, 0.03))
    >>> robot
    Robot('lamp', base='omni', joints=3, solids=3)
    >>> robot.tool([1, 0, 0], [0, 0, 0])[:3, 3].round(6).tolist()
    [1.7, 0.0, 0.3]
    """

    name: str
    base: BaseKind
    footprint: Array
    mount: Array
    chain: Chain
    solids: tuple[LinkSolid, ...]
    body_height: float = BODY_HEIGHT
    carry: Array = field(default_factory=lambda: np.empty(0))
    turning_radius: float = 0.0
    gauge: float = 0.0
    base_solids: tuple[LinkSolid, ...] = ()
    unchecked: tuple[tuple[str, str], ...] = ()
    masses: tuple[LinkMass, ...] = ()
    payload: float = 0.0
    visuals: tuple[VisualSurface, ...] = ()

    def __post_init__(self) -> None:
        for key in ("solids", "base_solids", "unchecked", "masses", "visuals"):
            object.__setattr__(self, key, tuple(getattr(self, key)))
        if not np.size(self.carry):
            object.__setattr__(self, "carry", np.clip(0.0, self.chain.lower, self.chain.upper))
        for key, shape in (("footprint", (None, 2)), ("mount", (4,)), ("carry", (self.chain.dof,))):
            object.__setattr__(self, key, frozen(getattr(self, key), shape, key))
        if self.base not in get_args(BaseKind):
            raise InputError(f"base: expected one of {', '.join(get_args(BaseKind))}, got {self.base!r}")
        _check_footprint(self.footprint)
        if not 0 < self.body_height < np.inf:
            raise InputError(f"body_height: must be above 0, got {self.body_height:g}")
        if not 0 <= self.payload < np.inf:
            raise InputError(f"payload: must be at least 0, got {self.payload:g}")
        last = len(self.chain.joints) - 1
        _check_links("masses", self.masses, 0, last)
        _check_links("solids", self.solids, 0, last)
        _check_links("base_solids", self.base_solids, BASE, BASE)
        _check_links("visuals", self.visuals, BASE, last)

    def __repr__(self) -> str:
        sizes = f"joints={self.chain.dof}, solids={len(self.all_solids)}"
        return f"Robot({self.name!r}, base={self.base!r}, {sizes})"

    @cached_property
    def drive(self) -> BaseDrive:
        """Motion of the base."""
        return drive_of(self.base, self.turning_radius)

    @property
    def all_solids(self) -> tuple[LinkSolid, ...]:
        """Solids of the arm, then those fixed to the base."""
        return (*self.solids, *self.base_solids)

    @property
    def loads(self) -> tuple[LinkMass, ...]:
        """Masses of the links, and the payload at the tool."""
        if not self.payload:
            return self.masses
        last = len(self.chain.joints) - 1
        return (*self.masses, LinkMass(last, self.payload, self.chain.T_last_tool[:3, 3]))

    @property
    def T_base_arm(self) -> Array:
        """Arm base frame in the base frame, (4, 4)."""
        x, y, z, yaw = self.mount
        return planar_pose(x, y, yaw, z)

    def frames(self, base: ArrayLike, joints: ArrayLike) -> Array:
        """Return link and tool frames in the world, (..., n + 1, 4, 4), n counting all joints.

        Parameters
        ----------
        base : (..., 3) array_like
            x, y [m], yaw [rad].
        joints : (..., dof) array_like
        """
        return self.T_world_arm(np.asarray(base))[..., None, :, :] @ self.chain.frames(joints)

    def tool(self, base: ArrayLike, joints: ArrayLike) -> Array:
        """Return the tool frame in the world, (..., 4, 4)."""
        frame: Array = self.frames(base, joints)[..., -1, :, :]
        return frame

    @property
    def tip_depth(self) -> tuple[float, str]:
        """Depth of the tool point in a solid of its own link [m], and the solid's name; 0 in none."""
        tool = self.chain.T_last_tool[:3, 3]
        own = [solid for solid in self.solids if solid.link == len(self.chain.joints) - 1]
        return max([(0.0, ""), *((solid.depth(tool), solid.name) for solid in own)])

    def outline(self, base: Array) -> BaseGeometry:
        """Return the footprint on the floor, the base at a pose (3,)."""
        x, y, yaw = base.tolist()
        c, s = np.cos(yaw), np.sin(yaw)
        return shapely.convex_hull(shapely.multipoints(self.footprint @ np.array([[c, s], [-s, c]]) + (x, y)))

    def T_world_arm(self, base: Array) -> Array:
        """Return the arm base frame in the world, (..., 4, 4), for base poses (..., 3)."""
        T_world_base = np.zeros((*base.shape[:-1], 4, 4))
        c, s = np.cos(base[..., 2]), np.sin(base[..., 2])
        T_world_base[..., 0, 0], T_world_base[..., 0, 1] = c, -s
        T_world_base[..., 1, 0], T_world_base[..., 1, 1] = s, c
        T_world_base[..., 2, 2] = T_world_base[..., 3, 3] = 1.0
        T_world_base[..., :2, 3] = base[..., :2]
        T: Array = T_world_base @ self.T_base_arm
        return T


def without_limits(robot: Robot) -> Robot:
    """Return the same robot with joints that turn without end (experiment 1 of the M-FABRIK paper)."""
    joints = tuple(replace(joint, lower=-np.inf, upper=np.inf) for joint in robot.chain.joints)
    return replace(robot, chain=Chain(joints, robot.chain.T_last_tool))


def with_tool(robot: Robot, tool: Tool) -> Robot:
    """Return the same robot with a tool on its flange.

    >>> from regionik.worlds.bundled import robot_named
    >>> pen = Tool(planar_pose(0.0, 0.0, 0.0, 0.1))
    >>> one = robot_named("youbot")
    >>> bare, tipped = (robot.chain.forward(np.zeros(5))[2, 3] for robot in (one, with_tool(one, pen)))
    >>> round(float(bare - tipped), 6)  # it points down
    0.1
    """
    last, T = len(robot.chain.joints) - 1, robot.chain.T_last_tool
    mounted = tuple(solid.moved(last, T) for solid in tool.solids)
    chain = Chain(robot.chain.joints, T @ tool.T_flange_tool)
    return replace(robot, chain=chain, solids=(*robot.solids, *mounted))


def check_turning_radius(base: BaseKind, radius: float) -> None:
    """Refuse cars without a least turning radius, and turning radii of bases that turn on the spot."""
    spins = drive_of(base).turns_on_the_spot
    if not spins and radius <= 0:
        raise InputError("turning_radius: a car needs its least turning radius, a length above 0 [m]")
    if spins and radius > 0:
        raise InputError(f"turning_radius: expected base car, as a base of kind {base} turns on the spot")


def _check_footprint(corners: Array) -> None:
    """Refuse outlines that are neither one point nor convex."""
    if len(corners) == 1:
        return
    if len(corners) < 3:
        raise InputError(f"footprint: expected one point or at least three corners, got {len(corners)}")
    outline = Polygon(corners)
    hull = MultiPoint(corners).convex_hull
    if not outline.is_valid or outline.area <= 0 or hull.area - outline.area > 1e-9 * hull.area:
        raise InputError("footprint: expected the corners of a convex outline, in order")


def _check_links(
    what: str, parts: Sequence[LinkSolid | LinkMass | VisualSurface], low: int, high: int
) -> None:
    wrong = next((k for k, part in enumerate(parts) if not low <= part.link <= high), None)
    if wrong is not None:
        expected = f"a link from {low} to {high}" if low < high else f"link {low}"
        raise InputError(f"{what}[{wrong}].link: expected {expected}, got {parts[wrong].link}")


def check_criteria(criteria: Criteria, robot: Robot) -> None:
    """Refuse criteria of effort for a robot without masses, or for another number of joints."""
    if criteria.effort is None:
        return
    dof = robot.chain.dof
    if isinstance(criteria.effort, tuple) and len(criteria.effort) != dof:
        raise InputError(
            f"criteria: effort: expected one limit, or {dof} ({', '.join(robot.chain.names)}), "
            f"got {len(criteria.effort)}"
        )
    if not robot.loads:
        raise InputError(
            f"criteria: effort: {robot.name} has no masses: give robot.masses or robot.payload in the "
            "world file, or inertial elements in its URDF"
        )


def with_joint_margin(robot: Robot, criteria: Criteria | None) -> Robot:
    """Return the robot with its joint limits narrowed by the joint margin of the criteria."""
    margin = None if criteria is None else criteria.joint_margin
    return robot if not margin else _narrowed(robot, margin)


@made_once
def _narrowed(robot: Robot, margin: float) -> Robot:
    joints = tuple(
        replace(one, lower=one.lower + margin * span, upper=one.upper - margin * span)
        if np.isfinite(span := one.upper - one.lower)
        else one
        for one in robot.chain.joints
    )
    return replace(robot, chain=Chain(joints, robot.chain.T_last_tool))
