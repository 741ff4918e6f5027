"""What is asked of a robot's numbers, wherever they come from."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from shapely.geometry import MultiPoint, Polygon

from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain
from regionik.worlds.drives import BaseKind, drive_of
from regionik.worlds.readers.validation import wrong


def check_limits(chain: Chain, values: Sequence[float], where: str, place: str) -> None:
    """Refuse the first joint value outside its limits."""
    for k, (joint, value) in enumerate(zip(chain.joints, values, strict=True)):
        if not joint.lower <= value <= joint.upper:
            limits = f"{joint.lower:.6g} to {joint.upper:.6g}"
            text = f"{joint.name} must be within its limits {limits}, got {value:.6g}"
            raise wrong(where, f"{place}[{k}]", text)


def carried(values: Sequence[float] | None, chain: Chain, where: str, place: str) -> Array:
    """Joint values to drive about with; by default zero, or the limits nearest to it."""
    if values is None:
        return np.clip(np.zeros(chain.dof), chain.lower, chain.upper)
    if len(values) != chain.dof:
        raise wrong(where, place, f"expected {chain.dof} values, one a joint, got {len(values)}")
    check_limits(chain, values, where, place)
    return np.array(values)


def check_turning(base: BaseKind, radius: float, where: str, place: str) -> None:
    """Refuse cars that do not say how tightly they turn, and radii of bases that turn on the spot."""
    spins = drive_of(base).turns_on_the_spot
    if not spins and radius <= 0:
        raise wrong(where, place, "a car needs its least turning radius, a length above 0 [m]")
    if spins and radius > 0:
        raise wrong(where, place, f"expected base car, as a base of kind {base} turns on the spot")


def check_footprint(corners: Sequence[Sequence[float]], where: str, place: str) -> None:
    """Refuse outlines that are neither one point nor convex."""
    if len(corners) == 1:
        return
    if len(corners) == 2:
        raise wrong(where, place, "expected one point or at least three corners, got 2")
    outline = Polygon(corners)
    hull = MultiPoint(corners).convex_hull
    if not outline.is_valid or outline.area <= 0 or hull.area - outline.area > 1e-9 * hull.area:
        raise wrong(where, place, "expected the corners of a convex outline, in order")
