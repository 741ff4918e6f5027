"""Check of the fields of a plan that follow from others: whoever reads a plan file relies on those.

Tool positions, errors, figures and margins are computed again. Areas cannot be computed without the planner's
own stages (`regionik.area_verification` does that); what is checked here is that they fit one another.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from functools import lru_cache
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from regionik.values import Plan, PlannedArea, Violation
from regionik.verification.motion import MotionSegments
from regionik.verification.proofs import Finding, StateNames, finding
from regionik.verification.tolerances import ROUNDING
from regionik.worlds.arrays import Array
from regionik.worlds.limits import Speeds

GRID = 1e-10  # of coordinates on which an overlay that looks wrong is computed again [m]

Geometries = NDArray[np.object_]


def verify_derived_fields(
    plan: Plan, segments: MotionSegments, names: StateNames, findings: Iterable[Finding]
) -> Finding:
    """Tool positions, errors, figures, margins and areas of the plan are those of its states and set-points.

    ``findings`` are those of the other checks, whose margins count.
    """
    margins = {found.kind: found.margin for found in findings if np.isfinite(found.margin)}
    violations = [
        *_wrong_tools(segments, names),
        *_wrong_errors(plan, names),
        *_wrong_figures(plan, segments),
        *_wrong_margins(plan.stats.get("margins"), margins),
        *_contradicting_areas(plan, names),
    ]
    return finding("derived", np.inf, violations)


def _wrong_tools(segments: MotionSegments, names: StateNames) -> Iterator[Violation]:
    """Tool positions read from a file that base and joints do not give."""
    motion = segments.motion
    if motion.tool is None:
        return
    computed = segments.robot.tool(motion.base, motion.joints)[:, :3, 3]
    off = np.linalg.norm(motion.tool - computed, axis=1)
    for k in np.flatnonzero(~(off <= ROUNDING)).tolist():
        text = f"the plan's tool position {names.state(k)} is {off[k]:.4g} m off the one of base and joints"
        yield Violation("derived", k, names.owner(k), float(off[k]), text)


def _wrong_errors(plan: Plan, names: StateNames) -> Iterator[Violation]:
    """Errors of set-points that are not the tool's distance from the target, and false convergence."""
    pairs = list(zip(plan.setpoints, plan.world.task, strict=False))
    if not pairs:
        return
    bases, joints = (np.array([getattr(found, key) for found, _ in pairs]) for key in ("base", "joints"))
    tools = plan.world.robot.tool(bases, joints)[:, :3, 3]
    errors = np.linalg.norm(tools - [target.position for _, target in pairs], axis=1).tolist()
    for i, ((found, _), error) in enumerate(zip(pairs, errors, strict=True)):
        if abs(found.error - error) > ROUNDING:
            text = f"the error at {names.setpoint(i)} is {error:.4g} m, the plan says {found.error:.4g} m"
            yield Violation("derived", None, i, abs(found.error - error), text)
        close = error <= plan.world.rules.tolerance + ROUNDING
        if found.converged != close:
            said = "converged" if found.converged else "did not converge"
            text = f"the plan says that {names.setpoint(i)} {said}, its tool is {error:.4g} m off"
            yield Violation("derived", None, i, 0.0, text)


def _wrong_figures(plan: Plan, segments: MotionSegments) -> Iterator[Violation]:
    """Figures in ``stats`` that set-points, states, stops, times and speeds do not give."""
    stats, motion = plan.stats, plan.motion
    computed: dict[str, float] = {"setpoints": len(plan.setpoints), "states": len(motion)}
    computed["base_travel"] = float(segments.base_length.sum())
    if plan.setpoints:
        computed["iterations"] = sum(found.iterations for found in plan.setpoints)
        computed["largest_error"] = max(found.error for found in plan.setpoints)
    for key, value in computed.items():
        yield from _differing(f"stats.{key}", stats.get(key), value)
    for key, inner, value in (
        ("timing", "duration", float(motion.time[-1])),
        ("timing", "blend", (plan.world.speeds or Speeds()).blend),
        ("stops", "count", float(len(plan.stops))),
    ):
        if isinstance(stats.get(key), dict):
            yield from _differing(f"stats.{key}.{inner}", stats[key].get(inner), value)
    order, count = stats.get("order"), len(plan.world.task)
    if order is not None and not plan.skipped and not is_order(order, count):
        text = f"the plan's stats.order does not name each of {count} set-points once"
        yield Violation("derived", None, None, 0.0, text)


def is_order(order: Any, count: int) -> bool:
    """Return whether a value names each of so many set-points once."""
    whole = isinstance(order, Sequence) and all(type(i) is int for i in order)
    return whole and sorted(order) == list(range(count))


def _wrong_margins(stated: Any, margins: dict[str, float]) -> Iterator[Violation]:
    if not isinstance(stated, dict):
        return
    for kind, value in stated.items():
        if kind not in margins:
            text = f"the plan's stats.margins.{kind} is {value!s:.40}, nothing of the kind was measured"
            yield Violation("derived", None, None, 0.0, text)
        else:
            yield from _differing(f"stats.margins.{kind}", value, margins[kind])


def _differing(name: str, stated: Any, computed: float) -> Iterator[Violation]:
    """Violation where the plan states a number, and not the one computed."""
    if stated is None:
        return
    off = np.inf
    if isinstance(stated, int | float):
        with suppress(OverflowError):  # of integers that files may hold
            off = abs(float(stated) - computed)
    if not off <= ROUNDING * max(1.0, abs(computed)):
        text = f"the plan's {name} is {stated!s:.40}, found {computed:.6g}"
        yield Violation("derived", None, None, off, text)


def _contradicting_areas(plan: Plan, names: StateNames) -> Iterator[Violation]:
    """Pruned areas that are not part of the admissible ones, and rejected ones that are."""
    if not plan.areas:
        return
    if len(plan.areas) != len(plan.world.task):
        text = f"the plan has areas of {len(plan.areas)} set-points, its world has {len(plan.world.task)}"
        yield Violation("derived", None, None, 0.0, text)
        return
    outside, both = _overlaps(tuple(plan.areas))
    for off, what in ((outside, "pruned area lies outside"), (both, "rejected area lies inside")):
        for i in np.flatnonzero(off > ROUNDING).tolist():
            text = f"{off[i]:.4g} m2 of the {what} the admissible area of {names.setpoint(i)}"
            yield Violation("derived", None, i, float(off[i]), text)


@lru_cache(maxsize=1)  # smoothing and timing change the motion alone, and verify it anew
def _overlaps(areas: tuple[PlannedArea, ...]) -> tuple[Array, Array]:
    """What is pruned and not admissible, and rejected and admissible, of each set-point, (n,) [m2]."""
    admissible, pruned, rejected = (
        np.array([getattr(area, part) for area in areas], dtype=object)
        for part in ("admissible", "pruned", "rejected")
    )
    outside, cut = np.zeros(len(pruned)), ~shapely.equals_exact(pruned, admissible)
    outside[cut] = _overlay_area(shapely.difference, pruned[cut], admissible[cut])
    return outside, _overlay_area(shapely.intersection, rejected, admissible)


def _overlay_area(overlay: Callable[..., Geometries], ones: Geometries, others: Geometries) -> Array:
    """Areas (n,) of the overlay of geometries; what is not nothing is computed once more on a grid.

    GEOS overlays floating coordinates, and where edges nearly coincide a whole face may come out wrong:
    polygons that only touch had 0.05 m2 in common, and none with the two exchanged. Or it finds no overlay.
    """
    try:
        areas: Array = shapely.area(overlay(ones, others))
    except shapely.GEOSException:
        areas = np.full(len(ones), np.inf)
    doubtful = areas > ROUNDING
    areas[doubtful] = shapely.area(overlay(ones[doubtful], others[doubtful], grid_size=GRID))
    return areas
