"""The body of a robot above its footprint: what turns with the base and not with the arm, as upright prisms.

Columns, masts and screens are fixed to the base; torsos are carried by lifts, the sliding joints that stand
upright before all others. A solid is cut into bands of height. In each it lies within one prism and holds
another; what the first keeps clear of is clear of the solid, and what meets the second meets it. The link
that an upright pivot turns stands over the base as well, however it turns: it holds discs about the axis.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import shapely
from shapely.geometry import Polygon

from regionik.worlds.arrays import Array, transform_points
from regionik.worlds.chain import Chain
from regionik.worlds.links import LinkCapsule, LinkSolid
from regionik.worlds.prepared import made_once
from regionik.worlds.robot import Robot

Corners = tuple[tuple[float, float], ...]
Band = tuple[float, float]


@dataclass(frozen=True)
class _PrismOptions:
    """How finely solids are cut into prisms."""

    round_sides: int = 16  # of polygons that stand for round outlines
    disc_heights: tuple[float, ...] = (
        -0.8,
        0.0,
        0.8,
    )  # of the discs that stand for a ball from within, in radii
    min_inner_share: float = 0.7  # of the outer outline, from which a band is left whole
    max_inset_share: float = 0.02  # of the height of a leaning band, left out at either end
    min_band: float = 0.05  # height of a band that is cut [m]
    max_halvings: int = 2  # of a solid's height
    min_area: float = 1e-6  # of an outline [m2]
    disc_levels: int = 17  # heights of the link on a pivot at which its discs are taken


_PRISMS = _PrismOptions()
_UPRIGHT = 1e-9


@dataclass(frozen=True)
class BodyPrism:
    """A convex outline on the base from one height to another."""

    part: str  # name of the solid that it is of
    outline: Corners  # in the base frame [m]
    low: float  # [m]
    high: float  # [m]

    def lifted(self, low: float, high: float) -> BodyPrism:
        """Return the prism with its ends moved [m]."""
        return replace(self, low=self.low + low, high=self.high + high)


def fixed_prisms(robot: Robot, *, inside: bool) -> tuple[BodyPrism, ...]:
    """Return prisms around the solids that are fixed to the base, or inside them."""
    return _body_prisms(robot, inside=inside)[0]


def lifted_prisms(robot: Robot, lift: tuple[float, float], *, inside: bool) -> tuple[BodyPrism, ...]:
    """Return prisms around all that solids on lifts may take up, or inside what they take up at any lift.

    Parameters
    ----------
    robot : Robot
    lift : (low, high)
        How far all lifts together raise the arm, at least and at most [m].
    inside : bool
    """
    found = []
    least, most = lift_range(robot)
    for prism, (low, high) in _body_prisms(robot, inside=inside)[1]:
        # What the other lifts add is within their own limits.
        low, high = max(low, lift[0] - (most - high)), min(high, lift[1] - (least - low))
        moved = prism.lifted(high, low) if inside else prism.lifted(low, high)
        found += [moved] if moved.low < moved.high else []
    return tuple(found)


def pivot_discs(robot: Robot) -> tuple[BodyPrism, ...]:
    """Return discs about an upright first axis that the link on it holds in every posture.

    There are none of a link that is the outermost with a solid, as that may touch what the tool works on.
    """
    outermost = max((solid.link for solid in robot.solids), default=0)
    return _pivot_discs(robot) if outermost > 0 else ()


def lift_range(robot: Robot) -> tuple[float, float]:
    """Return how far the lifts raise the arm, at least and at most; (0, 0) where there are none [m]."""
    return [(0.0, 0.0), *(span for _, span in _lifts(robot))][-1]


def lift_for(robot: Robot, height: float, reach: float = 0.0) -> tuple[float, float] | None:
    """Return how far lifts may raise the arm with the tool at a height, and ``reach`` about it [m].

    None where no lift brings the tool there.
    """
    (low, high), (down, up) = lift_range(robot), _rise(robot)
    low, high = max(low, float(height - reach - up)), min(high, float(height + reach - down))
    return (low, high) if low <= high else None


def with_lift(robot: Robot, lift: tuple[float, float]) -> Robot:
    """Return the robot with its lifts limited to a part of their range, in which each has its share [m]."""
    least, most = lift_range(robot)
    low, high = ((end - least) / (most - least) for end in lift)
    joints = list(robot.chain.joints)
    for k, (T, _) in enumerate(_lifts(robot)):
        joint, is_up = joints[k], (T[:3, :3] @ joints[k].axis)[2] > 0
        ends = (low, high) if is_up else (1 - high, 1 - low)
        lower, upper = (joint.lower + end * (joint.upper - joint.lower) for end in ends)
        joints[k] = replace(joint, lower=lower, upper=upper)
    return replace(robot, chain=Chain(tuple(joints), robot.chain.T_last_tool))


def without_body(robot: Robot) -> Robot:
    """Return the robot without what stands over its base in every posture: a footprint and an arm."""
    count = sum(1 for _ in _lifts(robot)) or len(pivot_discs(robot)[:1])
    solids = tuple(solid for solid in robot.solids if solid.link >= count)
    return replace(robot, base_solids=(), solids=solids)


def _lifts(robot: Robot) -> Iterator[tuple[Array, tuple[float, float]]]:
    """Frame (4, 4) of the link on each lift, all of them at zero, and how far it is raised there [m]."""
    T, low, high = robot.T_base_arm, 0.0, 0.0
    for joint in robot.chain.joints:
        T = T @ joint.T_parent_joint
        up = float((T[:3, :3] @ joint.axis)[2])
        if joint.kind != "prismatic" or abs(up) < 1 - _UPRIGHT:
            return
        ends = sorted((up * joint.lower, up * joint.upper))
        low, high = low + ends[0], high + ends[1]
        yield T, (low, high)


@made_once
def _body_prisms(
    robot: Robot, *, inside: bool
) -> tuple[tuple[BodyPrism, ...], tuple[tuple[BodyPrism, Band], ...]]:
    """Prisms of the solids that are fixed to the base; and of those on lifts, these at zero.

    The latter with how far each is raised, at least and at most.
    """
    fixed = (_prisms(solid, np.eye(4), inside=inside) for solid in robot.base_solids)
    lifts = list(_lifts(robot))
    moving = [solid for solid in robot.solids if solid.link < len(lifts)]
    lifted = (
        (prism, lifts[solid.link][1])
        for solid in moving
        for prism in _prisms(solid, lifts[solid.link][0], inside=inside)
    )
    return tuple(prism for some in fixed for prism in some), tuple(lifted)


@made_once
def _pivot_discs(robot: Robot) -> tuple[BodyPrism, ...]:
    first = robot.chain.joints[0]
    T = robot.T_base_arm @ first.T_parent_joint
    if first.kind == "prismatic" or abs(float((T[:3, :3] @ first.axis)[2])) < 1 - _UPRIGHT:
        return ()
    return tuple(disc for solid in robot.solids if solid.link == 0 for disc in _discs(solid, T))


def _discs(solid: LinkSolid, T: Array) -> Iterator[BodyPrism]:
    """Yield discs about the axis of a pivot that a solid, its link's frame (4, 4), holds however it turns.

    What a convex solid holds at two heights it holds between them.
    """
    points, axis = _points(solid, T, inside=True), shapely.Point(T[:2, 3])
    levels = np.linspace(points[:, 2].min(), points[:, 2].max(), _PRISMS.disc_levels)
    radii = [_room_about(axis, points, z) for z in levels.tolist()]
    for (low, high), radius in zip(pairwise(levels.tolist()), map(min, pairwise(radii)), strict=True):
        if np.pi * radius**2 > _PRISMS.min_area:
            disc = axis.buffer(radius, quad_segs=_PRISMS.round_sides // 4)
            corners = shapely.get_coordinates(disc.exterior)[:-1].tolist()
            yield BodyPrism(solid.name, tuple(map(tuple, corners)), low, high)


def _room_about(axis: shapely.Point, points: Array, height: float) -> float:
    """Radius of the largest disc about a point in the section of a hull of points (n, 3) [m]."""
    section = shapely.convex_hull(shapely.multipoints(_section(points, height)))
    held = isinstance(section, Polygon) and section.contains(axis)
    return float(section.exterior.distance(axis)) if held else 0.0


def _rise(robot: Robot) -> tuple[float, float]:
    """Return the least and the greatest height of the tool where the lifts are at zero [m].

    Heights are known up to the first joint that is not upright; from there links count with their lengths.
    """
    chain, count = robot.chain, len(list(_lifts(robot)))
    T, low, high, level = robot.T_base_arm, 0.0, 0.0, True
    for k, joint in enumerate(chain.joints):
        step = T[:3, :3] @ joint.T_parent_joint[:3, 3]
        T = T @ joint.T_parent_joint
        up = float((T[:3, :3] @ joint.axis)[2])
        far = 0.0 if level else float(np.linalg.norm(step))
        low, high = low + (step[2] if level else -far), high + (step[2] if level else far)
        if joint.kind == "revolute":
            level = level and abs(up) >= 1 - _UPRIGHT
        elif k >= count:
            rise = (up * joint.lower, up * joint.upper) if level else (joint.lower, joint.upper)
            most = max(map(abs, rise))
            low, high = low + (min(rise) if level else -most), high + (max(rise) if level else most)
    step = T[:3, :3] @ chain.T_last_tool[:3, 3]
    far = float(np.linalg.norm(step))
    mount = float(robot.mount[2])
    return mount + low + (step[2] if level else -far), mount + high + (step[2] if level else far)


def _prisms(solid: LinkSolid, T: Array, *, inside: bool) -> tuple[BodyPrism, ...]:
    """Prisms around a solid, or inside it, its link where a transform (4, 4) puts it in the base frame."""
    points = _points(solid, T, inside=inside)
    low, high = float(points[:, 2].min()), float(points[:, 2].max())
    bands = _bands(points, low, high, _PRISMS.max_halvings, inside=inside)
    shapes = ((_common_section(points, *band) if inside else _outline(points, *band), band) for band in bands)
    return tuple(
        BodyPrism(solid.name, tuple(map(tuple, shapely.get_coordinates(shape.exterior)[:-1].tolist())), *band)
        for shape, band in shapes
        if isinstance(shape, Polygon) and shape.area > _PRISMS.min_area
    )


def _points(solid: LinkSolid, T: Array, *, inside: bool) -> Array:
    """Points (n, 3) whose hull holds a solid, or lies inside it, its link where (4, 4) puts it."""
    points = transform_points(T, solid.corners)
    if isinstance(solid, LinkCapsule):
        points = (points[:, None] + solid.radius * _ball(inside=inside)).reshape(-1, 3)
    return points


def _ball(*, inside: bool) -> Array:
    """Corners of a polytope inside the unit ball, or around it: a prism, as caps matter little."""
    sides = _PRISMS.round_sides
    turns = 2 * np.pi * np.arange(sides) / sides
    ring = np.column_stack([np.cos(turns), np.sin(turns)])
    levels = (
        [(z, np.sqrt(1 - z * z)) for z in _PRISMS.disc_heights]
        if inside
        else [(z, 1 / np.cos(np.pi / sides)) for z in (-1, 1)]
    )
    return np.concatenate([np.column_stack([far * ring, np.full(sides, z)]) for z, far in levels])


def _bands(points: Array, low: float, high: float, halvings: int, *, inside: bool) -> list[Band]:
    """Heights between which the outlines of a hull of points (n, 3) differ little."""
    taken, off = _outline(points, low, high).area, _PRISMS.max_inset_share * (high - low)
    for band in ((low, high), (low + off, high - off)):
        if _common_section(points, *band).area >= _PRISMS.min_inner_share * taken:
            return [band if inside else (low, high)]
    if not halvings or high - low < _PRISMS.min_band:
        return [(low, high)]
    middle = (low + high) / 2
    halves = ((low, middle), (middle, high))
    return [band for half in halves for band in _bands(points, *half, halvings - 1, inside=inside)]


def _outline(points: Array, low: float, high: float) -> Polygon:
    """Return the outline, from above, of the part of a hull of points (n, 3) between two heights."""
    between = points[(points[:, 2] > low) & (points[:, 2] < high), :2]
    return shapely.convex_hull(
        shapely.multipoints(np.vstack([_section(points, low), between, _section(points, high)]))
    )


def _common_section(points: Array, low: float, high: float) -> Polygon:
    """Return an area that every section of a hull of points (n, 3) between two heights contains."""
    return shapely.intersection(
        *(shapely.convex_hull(shapely.multipoints(_section(points, z))) for z in (low, high))
    )


def _section(points: Array, height: float) -> Array:
    """Points (m, 2) whose hull is the section of a hull of points (n, 3) at a height within it [m]."""
    below, above = points[points[:, 2] <= height], points[points[:, 2] >= height]
    rise = above[None, :, 2] - below[:, None, 2]
    share = (height - below[:, None, 2]) / np.where(rise > 0, rise, 1.0)
    return np.asarray(
        (below[:, None] + share[..., None] * (above[None] - below[:, None]))[..., :2].reshape(-1, 2)
    )
