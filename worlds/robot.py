"""The machine: a base on the floor and an arm mounted on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from regionik.worlds.arrays import Array, frozen
from regionik.worlds.chain import Chain, planar_pose
from regionik.worlds.errors import InputError
from regionik.worlds.masses import LinkMass

BaseKind = Literal["omni", "differential", "car"]

BASE = -1  # the link of solids that are fixed to the base; its frame is the base frame


@dataclass(frozen=True, eq=False)
class LinkCapsule:
    """The solid of one arm link: all points within ``radius`` of a segment.

    Attributes
    ----------
    link : int
        Index into ``Chain.frames``: the link that joint ``link`` moves; `BASE` for what is fixed to the base.
    name : str
    start, end : (3,) array
        Ends of the segment in the link's frame [m].
    radius : float
        [m]
    """

    link: int
    name: str
    start: Array
    end: Array
    radius: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", frozen(self.start, (3,), f"{self.name}: start"))
        object.__setattr__(self, "end", frozen(self.end, (3,), f"{self.name}: end"))
        if not 0 < self.radius < np.inf:
            raise InputError(f"{self.name}: radius must be above 0, got {self.radius}")

    @property
    def corners(self) -> Array:
        """The solid is all points within ``radius`` of the hull of these, in the link's frame (2, 3) [m]."""
        return np.stack([self.start, self.end])

    def depth(self, point: Array) -> float:
        """How deep a point (3,) of the link's frame lies in the solid, below 0 outside [m]."""
        along = self.end - self.start
        share = np.clip((point - self.start) @ along / max(float(along @ along), 1e-300), 0.0, 1.0)
        return float(self.radius - np.linalg.norm(point - self.start - share * along))


@dataclass(frozen=True, eq=False)
class LinkBox:
    """A box that moves with one arm link.

    Attributes
    ----------
    link : int
        Index into ``Chain.frames``: the link that joint ``link`` moves; `BASE` for what is fixed to the base.
    name : str
    T_link_box : (4, 4) array
        Middle and axes of the box in the link's frame.
    size : (3,) array
        [m]
    """

    link: int
    name: str
    T_link_box: Array
    size: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_link_box", frozen(self.T_link_box, (4, 4), f"{self.name}: frame"))
        object.__setattr__(self, "size", frozen(self.size, (3,), f"{self.name}: size"))
        if not (self.size > 0).all():
            raise InputError(f"{self.name}: size must be above 0, got {self.size.tolist()}")

    @property
    def radius(self) -> float:
        """A box is the hull of its corners and no more."""
        return 0.0

    @property
    def corners(self) -> Array:
        """In the link's frame (8, 3) [m]."""
        signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        corners: Array = (signs * self.size / 2) @ self.T_link_box[:3, :3].T + self.T_link_box[:3, 3]
        return corners

    def depth(self, point: Array) -> float:
        """How deep a point (3,) of the link's frame lies in the box, below 0 outside [m]."""
        seen = (point - self.T_link_box[:3, 3]) @ self.T_link_box[:3, :3]
        return float((self.size / 2 - np.abs(seen)).min())


LinkSolid = LinkCapsule | LinkBox


@dataclass(frozen=True, eq=False)
class Robot:
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
    solids : tuple of LinkCapsule or LinkBox
        Of the arm's links.
    body_height : float
        The base is its footprint up to this height [m].
    turning_radius : float
        Least turning radius of a car [m].
    gauge : float
        Distance between the wheels that drive a differential base, 0 where it is not known [m].
    carry : (dof,) array
        Joint values in which the arm is driven about with the tool lifted.
    base_solids : tuple of LinkCapsule or LinkBox
        What else is fixed to the base, a mast for instance. It keeps off things as links of the arm do, which
        in their turn keep off it.
    unchecked : tuple of (str, str)
        Names of solids that need not keep apart, though they do not follow one another. The base's own body
        goes by "base of" and the robot's name.
    masses : tuple of LinkMass
        Of the arm's links; none where they are not known.
    payload : float
        What the tool carries at its frame's origin [kg].
    """

    name: str
    base: BaseKind
    footprint: Array
    mount: Array
    chain: Chain
    solids: tuple[LinkSolid, ...]
    body_height: float
    carry: Array
    turning_radius: float = 0.0
    gauge: float = 0.0
    base_solids: tuple[LinkSolid, ...] = ()
    unchecked: tuple[tuple[str, str], ...] = ()
    masses: tuple[LinkMass, ...] = ()
    payload: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "footprint", frozen(self.footprint, (None, 2), "footprint"))
        object.__setattr__(self, "mount", frozen(self.mount, (4,), "mount"))
        object.__setattr__(self, "carry", frozen(self.carry, (self.chain.dof,), "carry"))
        if len(self.footprint) not in (1,) and len(self.footprint) < 3:
            raise InputError("footprint: expected one point or at least three corners")
        if not 0 < self.body_height < np.inf:
            raise InputError(f"body_height must be above 0, got {self.body_height}")
        if not 0 <= self.payload < np.inf:
            raise InputError(f"payload must be at least 0, got {self.payload}")
        astray = next((one.link for one in self.masses if not 0 <= one.link < self.chain.dof), None)
        if astray is not None:
            raise InputError(f"masses: expected a link from 0 to {self.chain.dof - 1}, got {astray}")
        for solids, what, low, high in (
            (self.solids, "solids", 0, self.chain.dof - 1),
            (self.base_solids, "base_solids", BASE, BASE),
        ):
            wrong = next((solid for solid in solids if not low <= solid.link <= high), None)
            if wrong is not None:
                text = f"{wrong.name}: expected a link from {low} to {high}, got {wrong.link}"
                raise InputError(f"{what}: {text}")

    @property
    def all_solids(self) -> tuple[LinkSolid, ...]:
        """The arm's solids, then those fixed to the base."""
        return (*self.solids, *self.base_solids)

    @property
    def loads(self) -> tuple[LinkMass, ...]:
        """All that gravity pulls at: the masses of the links, and the payload at the tool."""
        if not self.payload:
            return self.masses
        return (*self.masses, LinkMass(self.chain.dof - 1, self.payload, self.chain.T_last_tool[:3, 3]))

    @property
    def T_base_arm(self) -> Array:
        x, y, z, yaw = self.mount
        return planar_pose(x, y, yaw, z)

    def frames(self, base: ArrayLike, joints: ArrayLike) -> Array:
        """Link and tool frames in the world, (..., dof + 1, 4, 4).

        Parameters
        ----------
        base : (..., 3) array_like
            x, y [m], yaw [rad].
        joints : (..., dof) array_like
        """
        return self.T_world_arm(np.asarray(base))[..., None, :, :] @ self.chain.frames(joints)

    def tool(self, base: ArrayLike, joints: ArrayLike) -> Array:
        """Tool frame in the world, (..., 4, 4)."""
        frame: Array = self.frames(base, joints)[..., -1, :, :]
        return frame

    @property
    def tip_depth(self) -> tuple[float, str]:
        """How deep the tool point lies in a solid of its own link [m], and the solid's name; 0 in none."""
        tool = self.chain.T_last_tool[:3, 3]
        own = [solid for solid in self.solids if solid.link == self.chain.dof - 1]
        return max([(0.0, ""), *((solid.depth(tool), solid.name) for solid in own)])

    def T_world_arm(self, base: Array) -> Array:
        """Arm base frame in the world, (..., 4, 4), for base poses (..., 3)."""
        T_world_base = np.zeros((*base.shape[:-1], 4, 4))
        c, s = np.cos(base[..., 2]), np.sin(base[..., 2])
        T_world_base[..., 0, 0], T_world_base[..., 0, 1] = c, -s
        T_world_base[..., 1, 0], T_world_base[..., 1, 1] = s, c
        T_world_base[..., 2, 2] = T_world_base[..., 3, 3] = 1.0
        T_world_base[..., :2, 3] = base[..., :2]
        T: Array = T_world_base @ self.T_base_arm
        return T


def capsules_along(chain: Chain, radius: float) -> tuple[LinkCapsule, ...]:
    """One capsule a link, from its joint to the next joint (or the tool); links of no length have none."""
    capsules = []
    for k, joint in enumerate(chain.joints):
        T_next = chain.joints[k + 1].T_parent_joint if k + 1 < chain.dof else chain.T_last_tool
        end = T_next[:3, 3]
        if np.linalg.norm(end) > 1e-9:
            capsules.append(LinkCapsule(k, f"link {k + 1} ({joint.name})", np.zeros(3), end, radius))
    return tuple(capsules)
