"""What of a world matters near some places: of maps with thousands of blobs, those within the robot's reach.

Solids are left out, and large ones cut, well beyond all that the robot may touch or must keep clear of while
its tool or its base is at these places. Worlds with few solids stay as they are.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from regionik.areas.options import AREAS
from regionik.planners.collision.robot_bodies import span_about_tool
from regionik.worlds.arrays import Array
from regionik.worlds.obstacles import Prism
from regionik.worlds.scene import World


def is_large(world: World) -> bool:
    """True of a world with so many solids that it is worth the while to leave out those far away."""
    return len(world.solids) >= AREAS.min_cut_solids


def region_in_reach(world: World, places: Array, more: float) -> BaseGeometry:
    """Squares about places and start in which all lies that the robot may come near to, and more [m]."""
    robot, rules = world.robot, world.rules
    body = float(np.linalg.norm(robot.footprint, axis=1).max() + np.linalg.norm(robot.mount[:2]))
    near = max(world.widest_base_clearance, world.arm_clearance, rules.tool_contact) + rules.tolerance
    far = span_about_tool(robot) + 2 * body + near + AREAS.kept_width + more
    squares = [_squares(places[:, :2], far)]
    if world.start is not None:
        squares.append(_squares(world.start.base[None, :2], 2 * far))
    region: BaseGeometry = shapely.union_all(np.concatenate(squares))
    return region


def _squares(middle: Array, half: float) -> Array:
    boxes: Array = shapely.box(*(middle - half).T, *(middle + half).T)
    return boxes


def cut_to(world: World, region: BaseGeometry, *, floor: bool) -> World:
    """The world without solids that do not meet a region; as it is where that leaves most of it.

    With ``floor`` its floor is cut as well.
    """
    shapely.prepare(region)
    bounds = np.array([solid.bounds[:, :2].ravel() for solid in world.solids])
    meets = shapely.intersects(region, shapely.box(*bounds.T))
    if 2 * np.count_nonzero(meets) > len(meets):
        return world
    count = len(world.obstacles)
    obstacles = tuple(one for one, near in zip(world.obstacles, meets[:count], strict=True) if near)
    near_cells = (one for one, near in zip(world.floor.cells, meets[count:], strict=True) if near)
    cells = tuple(part for cell in near_cells for part in _parts(cell, region))
    polygon = world.floor.polygon
    if floor:
        polygon = shapely.intersection(polygon, region)
        if shapely.intersection(world.open_floor, region).area <= 0:
            return world
    return replace(world, floor=replace(world.floor, polygon=polygon, cells=cells), obstacles=obstacles)


def _parts(cell: Prism, region: BaseGeometry) -> list[Prism]:
    """A blob as it is, or what of a large one lies in a region."""
    if shapely.get_num_coordinates(cell.polygon) <= AREAS.min_cut_corners:
        return [cell]
    parts = [part for part in shapely.get_parts(shapely.intersection(cell.polygon, region)) if part.area > 0]
    names = [cell.name, *(f"{cell.name}, part {k}" for k in range(2, len(parts) + 1))]
    return [replace(cell, name=name, polygon=part) for name, part in zip(names, parts, strict=False)]
