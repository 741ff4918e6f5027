"""Admissible areas of very many targets, bounded by true arcs: no polygon is made.

Polygons are made where areas are drawn or cut further, by `regionik.regions`. These are the same areas
without the chords of their circles, so a little larger and still inner ones: the rules' margin is kept from
both ends of the true reach. They answer what is asked of areas in bulk: how large they are, whether they hold
a place, which place of theirs is nearest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from regionik.areas.ground import Side
from regionik.areas.reach_model import ReachQuery
from regionik.areas.reachable import model_of, planar_reach
from regionik.areas.standing import anywhere
from regionik.planners.geometry.cells import Cells, cells_of
from regionik.planners.geometry.ringarcs import Outline, Sectors, holds, measures, nearest_place, outlines
from regionik.postures.families import BACK, FRONT, Family
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.criteria import with_joint_margin
from regionik.worlds.errors import InputError
from regionik.worlds.scene import Target, World

CELL = 0.2  # in which edges of the floor are looked up [m]


@dataclass(frozen=True, eq=False)
class ExactAreas:
    """Inner areas of many targets, one row for each target, family and reach interval.

    Attributes
    ----------
    target : (m,) array of int
        Ascending.
    family : tuple of Family
        One for each row.
    rings : Sectors
        Reach of each row, the margin taken off.
    floor : Cells
        Where the axis may stand.
    outline : Outline
        Boundary of each row; those of rows that are empty have no pieces.
    """

    target: NDArray[np.intp]
    family: tuple[Family, ...]
    rings: Sectors
    floor: Cells
    outline: Outline

    @cached_property
    def measure(self) -> Array:
        """Area of each row, (m,) [m2]."""
        found: Array = measures(self.outline, self.rings.center)
        return found

    def holds(self, row: int, place: ArrayLike) -> bool:
        """Whether the area of a row holds a place (2,) [m]."""
        x, y = frozen(place, (2,), "place").tolist()
        return bool(holds(self.floor, self.rings, row, x, y))

    def nearest(self, row: int, place: ArrayLike) -> Array | None:
        """The place of a row's area that is nearest to a place (2,); None where it is empty [m]."""
        x, y = frozen(place, (2,), "place").tolist()
        if self.outline.first[row] == self.outline.first[row + 1]:
            return None
        return np.array(nearest_place(self.floor, self.rings, self.outline, row, x, y))


def exact_areas(
    world: World,
    targets: Sequence[Target] | None = None,
    facings: Sequence[int] = (FRONT, BACK),
    side: Side | None = None,
) -> ExactAreas:
    """Inner areas of many targets, for an arm in one vertical plane.

    Parameters
    ----------
    world : World
    targets : sequence of Target, optional
        The world's task by default.
    facings : sequence of int
        Which of `FRONT` and `BACK` to take.
    side : Side, optional
        Where the base may stand; by default at every heading.

    Raises
    ------
    InputError
        For an arm that does not meet a target in one plane.

    Examples
    --------
    >>> from regionik.worlds.library import load_world
    >>> areas = exact_areas(load_world("pillar"))
    >>> bool((areas.measure > 0).any())
    True
    """
    asked, side = world.task if targets is None else targets, side or anywhere(world).sides[0]
    if not all(model_of(world, target).exact for target in asked):
        raise InputError(f"{world.name}: exact areas are those of an arm that works in one vertical plane")
    rules, model = world.rules, planar_reach(with_joint_margin(world.robot, world.rules.criteria))
    which, families, reach = model.rings(
        asked, ReachQuery(rules, rules.reach_margin, side.span, tuple(facings))
    )
    margin = rules.reach_margin
    rings = Sectors(*(np.ascontiguousarray(column) for column in reach))
    rings = rings._replace(low=rings.low + margin, high=rings.high - margin)
    floor = _cells(side)
    return ExactAreas(which, families, rings, floor, outlines(floor, rings))


@lru_cache(maxsize=8)
def _cells(side: Side) -> Cells:
    return cells_of(side.free, CELL)
