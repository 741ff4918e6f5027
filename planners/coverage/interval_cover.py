"""Interval cover: fewest runs of an ordered sequence of areas with one point in all areas of a run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

LEAST = 1e-10  # smaller intersections are none [m2]

Geometries = NDArray[np.object_]
Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Run:
    """Steps that can all be done from one point.

    Attributes
    ----------
    first, last : int
        Steps, both included.
    ends : dict of int to geometry
        By option of the last step the points from which it ends a chain of linked options.
    """

    first: int
    last: int
    ends: dict[int, BaseGeometry]


def fewest_runs(options: Geometries, offsets: Index, back: Sequence[Sequence[int]]) -> list[Run]:
    """Greedy runs, each as long as possible, from the first step on; no other cover has fewer.

    A point serves steps i to j where it lies in an option of each, each linked to the one before; it then
    serves every part of that run too. By induction the k-th greedy run ends no earlier than the k-th run of
    any other cover: that one begins no later, and the part of it from the beginning of the greedy run on is a
    run itself, so the greedy run goes at least as far.

    Parameters
    ----------
    options : (m,) array of geometry
        Areas of all steps, those of a step together, in the order of the steps.
    offsets : (n + 1,) array of int
        ``options[offsets[i]:offsets[i + 1]]`` are those of step i.
    back : sequence of sequences of int
        For each option those of the step before that it is linked to.

    Returns
    -------
    list of Run
        They end before a step that has no option at all.
    """
    found: list[Run] = []
    alive: dict[int, BaseGeometry] = {}
    for i in range(len(offsets) - 1):
        span = range(int(offsets[i]), int(offsets[i + 1]))
        ahead = _onward(options, span, back, alive) if alive else {}
        if ahead:
            found[-1] = Run(found[-1].first, i, ahead)
        else:
            ahead = {k: options[k] for k in span if options[k].area > LEAST}
            if not ahead:
                break
            found.append(Run(i, i, ahead))
        alive = ahead
    return found


def _onward(
    options: Geometries, span: range, back: Sequence[Sequence[int]], alive: dict[int, BaseGeometry]
) -> dict[int, BaseGeometry]:
    """Points from which the run goes on, by option of the next step."""
    ahead: dict[int, BaseGeometry] = {}
    for k in span:
        before = [alive[m] for m in back[k] if m in alive]
        if not before:
            continue
        points = before[0] if len(before) == 1 else shapely.union_all(before)
        shared = _polygons(points & options[k])
        if shared.area > LEAST:
            ahead[k] = shared
    return ahead


def _polygons(shape: BaseGeometry) -> BaseGeometry:
    """Polygons of a geometry."""
    if shapely.get_type_id(shape) in (3, 6):
        return shape
    parts = shapely.get_parts(shape)
    return shapely.multipolygons([part for part in parts if shapely.get_type_id(part) == 3])
