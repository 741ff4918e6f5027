"""Parts of robots that move with a link: the solids that it is checked by, and its mass."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from regionik.worlds.arrays import Array, freeze, one_line, transform_points
from regionik.worlds.chain import Chain
from regionik.worlds.errors import InputError, located
from regionik.worlds.polytopes import Polytope, polytope
from regionik.worlds.prepared import Prepared

BASE = -1  # the link of solids that are fixed to the base; its frame is the base frame
CUBE_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])  # of side 2
MIN_HULL_ROWS, MAX_HULL_CORNERS = 9, 256  # corners of a hull, at least and at most
LINK_RADIUS = 0.035  # of a link of which nothing else is known [m]


@dataclass(frozen=True, eq=False)
class LinkMass:
    """A mass that moves with one arm link."""

    link: int  # index into ``Chain.frames``: the link that joint ``link`` moves
    mass: float  # [kg]
    center: Array  # (3,) centre of mass in the link's frame [m]

    def __post_init__(self) -> None:
        freeze(self, "mass", center=(3,))
        if not 0 < self.mass < np.inf:
            raise InputError(f"mass: expected a finite number above 0, got {self.mass}")

    __repr__ = one_line


@dataclass(frozen=True, eq=False)
class LinkCapsule(Prepared):
    """A capsule that moves with one arm link: all points within ``radius`` of a segment.

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
        freeze(self, self.name, start=(3,), end=(3,))
        if not 0 < self.radius < np.inf:
            raise InputError(f"{self.name}: radius must be above 0, got {self.radius}")

    __repr__ = one_line

    @property
    def corners(self) -> Array:
        """Ends of the segment (2, 3): the solid is all points within ``radius`` of their hull [m]."""
        return np.stack([self.start, self.end])

    def moved(self, link: int, T: Array) -> LinkCapsule:
        """Return the same solid on a link, moved by a transform (4, 4)."""
        start, end = transform_points(T, self.corners)
        return LinkCapsule(link, self.name, start, end, self.radius)

    def depth(self, point: Array) -> float:
        """Return the depth of a point (3,) of the link's frame in the solid, negative outside [m]."""
        along = self.end - self.start
        share = np.clip((point - self.start) @ along / max(float(along @ along), 1e-300), 0.0, 1.0)
        return float(self.radius - np.linalg.norm(point - self.start - share * along))


@dataclass(frozen=True, eq=False)
class LinkBox(Prepared):
    """A box that moves with one arm link.

    Attributes
    ----------
    link : int
        Index into ``Chain.frames``: the link that joint ``link`` moves; `BASE` for what is fixed to the base.
    name : str
    T_link_box : (4, 4) array
        Frame of the box, in its middle and along its sides, in the link's frame.
    size : (3,) array
        [m]
    """

    link: int
    name: str
    T_link_box: Array
    size: Array
    radius: ClassVar[float] = 0.0  # the solid is the hull of its corners

    def __post_init__(self) -> None:
        freeze(self, self.name, T_link_box=(4, 4), size=(3,))
        if not (self.size > 0).all():
            raise InputError(f"{self.name}: size must be above 0, got {self.size.tolist()}")

    __repr__ = one_line

    @property
    def corners(self) -> Array:
        """Corners in the link's frame (8, 3) [m]."""
        return transform_points(self.T_link_box, CUBE_CORNERS * self.size / 2)

    def moved(self, link: int, T: Array) -> LinkBox:
        """Return the same solid on a link, moved by a transform (4, 4)."""
        return LinkBox(link, self.name, T @ self.T_link_box, self.size)

    def depth(self, point: Array) -> float:
        """Return the depth of a point (3,) of the link's frame in the box, negative outside [m]."""
        seen = (point - self.T_link_box[:3, 3]) @ self.T_link_box[:3, :3]
        return float((self.size / 2 - np.abs(seen)).min())


@dataclass(frozen=True, eq=False)
class LinkHull(Prepared):
    """A convex hull that moves with one arm link.

    Attributes
    ----------
    link : int
        Index into ``Chain.frames``: the link that joint ``link`` moves; `BASE` for what is fixed to the base.
    name : str
    corners : (n, 3) array
        In the link's frame [m]. At least `MIN_HULL_ROWS` rows, the first again where fewer are given: two
        rows are a segment, and eight a box, wherever corners stand for a solid.
    """

    link: int
    name: str
    corners: Array
    radius: ClassVar[float] = 0.0  # the solid is the hull of its corners

    def __post_init__(self) -> None:
        freeze(self, self.name, corners=(None, 3))
        if not 4 <= len(self.corners) <= MAX_HULL_CORNERS:
            raise InputError(
                f"{self.name}: expected 4 to {MAX_HULL_CORNERS} corners, got {len(self.corners)}"
            )
        again = np.repeat(self.corners[:1], max(0, MIN_HULL_ROWS - len(self.corners)), axis=0)
        object.__setattr__(self, "corners", np.concatenate([self.corners, again]))
        freeze(self, self.name, corners=(None, 3))
        with located("", self.name):
            _ = self.polytope

    __repr__ = one_line

    @cached_property
    def polytope(self) -> Polytope:
        """Faces and edges."""
        return polytope(self.corners)

    def moved(self, link: int, T: Array) -> LinkHull:
        """Return the same solid on a link, moved by a transform (4, 4)."""
        return LinkHull(link, self.name, transform_points(T, self.corners))

    def depth(self, point: Array) -> float:
        """Return the depth of a point (3,) of the link's frame in the hull, negative outside [m]."""
        return float(self.polytope.depth(point))


LinkSolid = LinkCapsule | LinkBox | LinkHull


def capsules_along(chain: Chain, radius: float) -> tuple[LinkCapsule, ...]:
    """Return one capsule a link, from its joint to the next or to the tool; links of no length have none."""
    return tuple(
        LinkCapsule(k, f"link {k + 1} ({name})", np.zeros(3), end, radius)
        for k, (name, end) in enumerate(zip((j.name for j in chain.joints), chain.link_vectors, strict=True))
        if np.linalg.norm(end) > 1e-9
    )
