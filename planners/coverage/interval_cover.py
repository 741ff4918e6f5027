"""Fewest runs of an ordered sequence of areas such that one place lies in all areas of a run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

LEAST = 1e-10  # of what areas have in common, below which they have nothing in common [m2]

Geometries = NDArray[np.object_]
Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Run:
    """Steps that can all be done from one place.

    Attributes
    ----------
    first, last : int
        Steps, both included.
    ends : dict of int to geometry
        The options of the last step, each with the places from which it ends a chain of linked options.
    """

    first: int
    last: int
    ends: dict[int, BaseGeometry]


def fewest_runs(options: Geometries, rungs: Index, back: Sequence[Sequence[int]]) -> list[Run]:
    """Runs, each as long as it goes, from the first step on.

    A place serves steps i to j where it lies in an option of each, each linked to the one before. One that
    serves a run serves every part of it. So, whatever other runs cover the steps, the k-th of these ends no
    earlier than their k-th does, by induction: theirs begins no later than ours, and what of it is left
    at our beginning is a run that ours has gone at least as far as. None therefore needs fewer runs.

    Parameters
    ----------
    options : (m,) array of geometry
        Areas of all steps, those of a step together, in the order of the steps.
    rungs : (n + 1,) array of int
        ``options[rungs[i]:rungs[i + 1]]`` are those of step i.
    back : sequence of sequences of int
        For each option the options of the step before that it is linked to.

    Returns
    -------
    list of Run
        They end before a step that has no option at all.
    """
    found: list[Run] = []
    alive: dict[int, BaseGeometry] = {}
    for i in range(len(rungs) - 1):
        span = range(int(rungs[i]), int(rungs[i + 1]))
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
    """Places from which the run goes on, by option of the next step."""
    ahead: dict[int, BaseGeometry] = {}
    for k in span:
        before = [alive[m] for m in back[k] if m in alive]
        if not before:
            continue
        places = before[0] if len(before) == 1 else shapely.union_all(before)
        shared = _solid(places & options[k])
        if shared.area > LEAST:
            ahead[k] = shared
    return ahead


def _solid(shape: BaseGeometry) -> BaseGeometry:
    """The polygons of a geometry."""
    if shapely.get_type_id(shape) in (3, 6):
        return shape
    parts = shapely.get_parts(shape)
    return shapely.multipolygons([part for part in parts if shapely.get_type_id(part) == 3])
