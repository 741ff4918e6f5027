"""Reach fields: number of targets reached from each place of the base, and tool positions in reach."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry.base import BaseGeometry

from regionik.areas.ground import Side
from regionik.areas.layers import ROUNDING_MARGIN
from regionik.areas.reach_model import ReachModel
from regionik.areas.reachable import reach_model
from regionik.postures.families import BACK, FRONT
from regionik.postures.poses import pose_of
from regionik.reach_table import reach_table
from regionik.reachability.options import REACHABILITY
from regionik.regions import checked_targets, path_areas
from regionik.scene import Scene, WorldSource, scene_of, world_of
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.errors import InputError
from regionik.worlds.robot import with_joint_margin
from regionik.worlds.scene import Target, World

OPTIONS = REACHABILITY.field

PROOF = "by areas alone"  # which do not look at what the arm would touch


class SliceValue(IntEnum):
    """What a slice says of a place."""

    UNREACHABLE = 0
    UNDECIDED = 1
    REACHABLE = 2


@dataclass(frozen=True, eq=False)
class Field:
    """Whole numbers on an even grid of the floor.

    Attributes
    ----------
    world : str
        Its name.
    x, y : (nx,), (ny,) array
        Middles of the cells, ascending [m].
    cell : float
        Side of a cell [m].
    values : (ny, nx) array of int
        Of places: how many targets are reached. Of a slice: 0 unreachable, 1 undecided, 2 reachable.
    most : int
        Targets in all; 2 of a slice.
    heading : (ny, nx) array
        Heading of the base that reaches so many; NaN where the base has room to turn, to another one for each
        target where its pivot asks for that, or nothing is reached [rad].
    scene : World
        Where it was counted.
    targets : (n, 3) array
        Positions that were asked for; none of a slice [m].
    height : float or None
        Of the tool, of a slice [m]; None for places of the arm axis.
    """

    world: str
    x: Array
    y: Array
    cell: float
    values: NDArray[np.int32]
    most: int
    heading: Array
    scene: World
    targets: Array
    height: float | None = None

    def __repr__(self) -> str:
        return f"Field({self.world}: {len(self.x)} x {len(self.y)} cells of {self.cell:g} m, {self.summary})"

    @property
    def meaning(self) -> str:
        """The meaning of the values, in a few words."""
        if self.height is None:
            return f"targets reached, of {self.most}, {PROOF}"
        return f"tool at {self.height:g} m, {PROOF}: 0 unreachable, 1 undecided, 2 reachable"

    @property
    def summary(self) -> str:
        """The result in one line."""
        if self.height is None:
            return f"the best place reaches {self.values.max(initial=0)} of {self.most} targets, {PROOF}"
        area = [
            float((self.values == value).sum()) * self.cell**2
            for value in (SliceValue.REACHABLE, SliceValue.UNDECIDED)
        ]
        found = f"the tool reaches {area[0]:.2f} m2, {area[1]:.2f} m2 are undecided"
        return f"at {self.height:g} m {found}, {PROOF}"

    @property
    def best(self) -> Array:
        """Base poses (n, 3) at the first place that reaches most targets; none of a slice or where none does.

        One at the heading there, or several all round where the base has room to turn.
        """
        if self.height is not None or not self.values.any():
            return np.empty((0, 3))
        row, column = np.unravel_index(int(self.values.argmax()), self.values.shape)
        axis, yaw = np.array([self.x[column], self.y[row]]), float(self.heading[row, column])
        count = OPTIONS.headings
        turns = [2 * np.pi * k / count for k in range(count)] if np.isnan(yaw) else [yaw]
        return np.array([pose_of(self.scene.robot, axis, turn) for turn in turns])


def reach_field(world: WorldSource, targets: ArrayLike | Sequence[Target], cell: float = 0.05) -> Field:
    """Number of targets that the arm reaches from each place of its axis on the floor.

    A target counts where its inner area holds the middle of the cell: base and body may stand there, and a
    posture within limits is on the target. Where the base has no room to turn, all that a place counts have
    one heading: the best. What the arm would touch is not looked at: `regionik.reach` from `Field.best` does.

    Parameters
    ----------
    world : World, or the name or file of one
    targets : (n, 3) array_like or sequence of Target
        Bare points leave the tool direction free [m].
    cell : float
        Side of a cell [m].

    Raises
    ------
    InputError
        For targets that are not n rows of three finite numbers, or a cell that is too small.

    Examples
    --------
    >>> found = reach_field("free", [[0.5, 0.0, 0.25], [0.7, 0.0, 0.25]], cell=0.2)
    >>> int(found.values.max()), found.most
    (2, 2)
    """
    world = world_of(world)
    asked, scene = checked_targets(targets), scene_of(world)
    x, y = _axes(world.floor.polygon.bounds, cell)
    best = np.zeros((len(y), len(x)), dtype=np.int32)
    heading = np.full(best.shape, np.nan)
    for side in scene.free_floor.turning.sides:
        free = _inside(side.free, x, y)
        count = _counted(scene, asked, side, free, x, y)
        better = count > best
        best[better] = count[better]
        heading[better] = np.mean(side.span) if np.isfinite(side.span).all() else np.nan
    points = np.array([target.position for target in _as_targets(asked)]).reshape(-1, 3)
    return Field(world.name, x, y, cell, best, len(asked), heading, world, points)


def reach_slice(world: WorldSource, height: float, cell: float = 0.05) -> Field:
    """Positions of the tool at one height that are reached from anywhere on the floor.

    Parameters
    ----------
    world : World, or the name or file of one
    height : float
        [m]
    cell : float
        Side of a cell [m].

    Returns
    -------
    Field
        Its values are 0 where the tool provably cannot be, 2 where base and arm can stand with the tool there
        (what the arm would touch is not looked at: `reach` does), 1 where neither is known.

    Raises
    ------
    InputError
        For a height that is not finite, or a cell that is too small.
    """
    world = world_of(world)
    z, scene = np.array([float(frozen([height], (1,), "height")[0])]), scene_of(world)
    outer, inner = _distances(scene, z, inner=False)[0], _distances(scene, z, inner=True)[0]
    far = float(outer.max(initial=0.0))
    x0, y0, x1, y1 = scene.floor.polygon.bounds
    x, y = _axes((x0 - far, y0 - far, x1 + far, y1 + far), cell)
    values = np.zeros((len(y), len(x)), dtype=np.int32)
    for side in scene.free_floor.outer.sides:
        values[_cells_within_spans(side, outer, x, y)] = SliceValue.UNDECIDED
    (side,) = scene.free_floor.anywhere.sides
    if _model(scene).turns_freely(scene.rules, side.span) and not scene.lifted.matters:
        values[_cells_within_spans(side, inner, x, y)] = SliceValue.REACHABLE
    else:
        values[_reachable_one_by_one(scene, float(z[0]), values, x, y)] = SliceValue.REACHABLE
    nowhere, none = np.full(values.shape, np.nan), np.empty((0, 3))
    return Field(world.name, x, y, cell, values, int(SliceValue.REACHABLE), nowhere, world, none, float(z[0]))


def _axes(bounds: tuple[float, float, float, float], cell: float) -> tuple[Array, Array]:
    """Middles of cells that cover a rectangle."""
    if not 0 < cell < np.inf:
        raise InputError(f"cell: must be above 0, got {cell}")
    x0, y0, x1, y1 = bounds
    wide, deep = np.ceil((x1 - x0) / cell - 1e-9), np.ceil((y1 - y0) / cell - 1e-9)
    if not wide * deep <= OPTIONS.max_cells:
        least = np.sqrt((x1 - x0) * (y1 - y0) / OPTIONS.max_cells)
        raise InputError(f"cell: expected at least {least:.2g} m for a floor of this size, got {cell:g}")
    x, y = np.arange(wide, dtype=np.float64), np.arange(deep, dtype=np.float64)
    return x0 + cell * (x + 0.5), y0 + cell * (y + 0.5)


def _inside(area: shapely.Geometry, x: Array, y: Array) -> NDArray[np.bool_]:
    shapely.prepare(area)
    found: NDArray[np.bool_] = shapely.contains_xy(area, x[None, :], y[:, None])
    return found


def _counted(
    scene: Scene, targets: Array | list[Target], side: Side, free: NDArray[np.bool_], x: Array, y: Array
) -> NDArray[np.int32]:
    """Targets reached from each free cell within one side's headings."""
    by_rings = _model(scene).turns_freely(scene.rules, side.span) and not scene.lifted.matters
    if isinstance(targets, list) or not by_rings:
        return _count_areas(scene, _as_targets(targets), side, free, x, y)
    return count_rings(targets[:, :2], _distances(scene, targets[:, 2], inner=True), x, y, free)


def count_rings(
    centers: Array, spans: list[Array], x: Array, y: Array, free: NDArray[np.bool_]
) -> NDArray[np.int32]:
    """Count, for each free cell, the centers (n, 2) that are as far off as one of their spans (k, 2) says."""
    count = np.zeros(free.shape, dtype=np.int32)
    for (cx, cy), own in zip(centers, spans, strict=False):
        far = own[:, 1].max(initial=0.0)
        rows, columns = np.flatnonzero(np.abs(y - cy) <= far), np.flatnonzero(np.abs(x - cx) <= far)
        off = np.hypot(x[columns] - cx, y[rows, None] - cy)[..., None]
        count[np.ix_(rows, columns)] += ((own[:, 0] <= off) & (off <= own[:, 1])).any(axis=-1)
    count[~free] = 0
    return count


def _model(scene: Scene) -> ReachModel:
    """The reach of bare points."""
    return reach_model(with_joint_margin(scene.robot, scene.rules.criteria), "point")


def _as_targets(targets: Array | list[Target]) -> list[Target]:
    return targets if isinstance(targets, list) else [Target(row) for row in targets]


def _count_areas(
    scene: Scene, targets: list[Target], side: Side, free: NDArray[np.bool_], x: Array, y: Array
) -> NDArray[np.int32]:
    """Count where headings or tool directions bound the reach: cells within its polygons."""
    count = np.zeros(free.shape, dtype=np.int32)
    for k in range(0, len(targets), OPTIONS.targets_at_once):
        which, _, shapes = reach_table(
            scene, targets[k : k + OPTIONS.targets_at_once], (FRONT, BACK), inner=True, span=side.span
        )
        for rows in np.split(shapes, np.flatnonzero(np.diff(which)) + 1) if len(which) else []:
            x0, y0, x1, y1 = shapely.total_bounds(rows)
            columns = slice(*np.searchsorted(x, (x0, x1)))
            lines = slice(*np.searchsorted(y, (y0, y1)))
            met = np.zeros((lines.stop - lines.start, columns.stop - columns.start), dtype=bool)
            for shape in rows:
                met |= _inside(shape, x[columns], y[lines])
            count[lines, columns] += met & free[lines, columns]
    return count


def _distances(scene: Scene, heights: Array, *, inner: bool) -> list[Array]:
    """Distances from the arm axis at which the tool is in reach, (k, 2) for each height, at any heading."""
    found = _model(scene).distances(scene.rules.criteria, heights, inner=inner)
    if not inner:
        return found
    keep = scene.rules.reach_margin + scene.world.axis_error + ROUNDING_MARGIN
    kept = [some + (keep, -keep) for some in found]
    return [some[some[:, 0] < some[:, 1]] for some in kept]


def _cells_within_spans(side: Side, spans: Array, x: Array, y: Array) -> NDArray[np.bool_]:
    """Cells with some free place at a distance within one of the spans.

    The distances to a connected piece of floor are all those between the nearest and the farthest.
    """
    met, most = np.zeros((len(y), len(x)), dtype=bool), float(spans.max(initial=0.0))
    for piece in side.pieces:
        x0, y0, x1, y1 = piece.bounds
        columns = slice(*np.searchsorted(x, (x0 - most - ROUNDING_MARGIN, x1 + most + ROUNDING_MARGIN)))
        rows = slice(*np.searchsorted(y, (y0 - most - ROUNDING_MARGIN, y1 + most + ROUNDING_MARGIN)))
        across, up = x[columns], y[rows]
        if not (len(across) and len(up)):
            continue
        farthest = np.zeros((len(up), len(across)))
        for corner_x, corner_y in shapely.get_coordinates(piece.convex_hull).tolist():
            np.maximum(farthest, np.hypot(across - corner_x, up[:, None] - corner_y), out=farthest)
        for near, far in spans.tolist():
            met[rows, columns] |= near_piece(piece, across, up, far) & (farthest >= near)
    return met


def near_piece(piece: BaseGeometry, x: Array, y: Array, far: float) -> NDArray[np.bool_]:
    """Cells (ny, nx) that are no farther than ``far`` from a piece of floor [m].

    Blocks of cells are looked at first, and single cells only where the edge of what is met may cross.
    """
    shapely.prepare(piece)
    (middle_x, half_x), (middle_y, half_y) = _blocks(x), _blocks(y)
    half = np.hypot(half_x, half_y[:, None]) + ROUNDING_MARGIN
    middles = shapely.points(*np.meshgrid(middle_x, middle_y))
    whole = shapely.dwithin(piece, middles, far - half) & (far > half)
    some = shapely.dwithin(piece, middles, far + half) & ~whole
    block = np.ix_(np.arange(len(y)) // OPTIONS.block, np.arange(len(x)) // OPTIONS.block)
    found: NDArray[np.bool_] = whole[block]
    row, column = np.nonzero(some[block])
    found[row, column] = shapely.dwithin(piece, shapely.points(x[column], y[row]), far)
    return found


def _blocks(line: Array) -> tuple[Array, Array]:
    """Middles of blocks of ascending values, and how far the values of each lie from it at most."""
    first = line[:: OPTIONS.block]
    last = line[np.minimum(np.arange(len(first)) * OPTIONS.block + OPTIONS.block, len(line)) - 1]
    return (first + last) / 2, (last - first) / 2


def _reachable_one_by_one(
    scene: Scene, height: float, values: NDArray[np.int32], x: Array, y: Array
) -> NDArray[np.bool_]:
    """Cells with an inner area, among those whose outer area is not empty."""
    met = np.zeros(values.shape, dtype=bool)
    rows, columns = np.nonzero(values)
    for k in range(0, len(rows), OPTIONS.targets_at_once):
        row, column = rows[k : k + OPTIONS.targets_at_once], columns[k : k + OPTIONS.targets_at_once]
        points = np.column_stack([x[column], y[row], np.full(len(row), height)])
        areas = path_areas(scene, _as_targets(points))
        good = np.unique(areas.target[shapely.area(areas.inner) > 0])
        met[row[good], column[good]] = True
    return met
