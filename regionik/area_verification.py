"""Check of the areas that a plan carries, by the stages that plan them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import shapely
from shapely.geometry import Point

from regionik.pipeline import areas_follow_motion, check_world
from regionik.planners.geometry.offsets import shrunk
from regionik.postures.poses import axis_of
from regionik.pruning import whole_path
from regionik.reachability.reach import answers_for
from regionik.regions import outer_areas, planned_areas
from regionik.scene import Scene, scene_of
from regionik.storage.plan_document import PARTS, stored_areas
from regionik.values import Plan, PlannedArea, Report, Violation
from regionik.worlds.arrays import Array
from regionik.worlds.errors import NoPlanFound

ROUNDING = 1e-6  # by which areas may differ [m2], or a base may stand outside [m]
GRID = 1e-9  # of corners of the overlay of areas that differ [m]


def verify_areas(plan: Plan) -> Report:
    """Check a plan's areas against its world, by the planner's own stages; `regionik.verify` does the rest.

    The areas of a continuous plan are computed again. Those of stops and of Xu's tracker depend on the search
    that found the motion: of them each set-point's base must stand in the pruned part. Set-points that are
    left out as unreachable are asked for again.

    Parameters
    ----------
    plan : Plan

    Returns
    -------
    Report
        Without margins. Areas of very long paths are not kept in files, and not looked at then.

    Raises
    ------
    InputError
        For a world that cannot be planned for.
    """
    violations = tuple(_reachable(plan))
    if plan.areas:
        scene = scene_of(plan.world)
        found = _bases_outside(plan) if areas_follow_motion(scene) else _differences(plan, scene)
        violations += tuple(found)
    return Report(not violations, {}, violations)


def _reachable(plan: Plan) -> Iterator[Violation]:
    """Set-points that are left out as proven unreachable, and are not."""
    for one in plan.skipped:
        if one.verdict != "unreachable":
            continue
        alone = scene_of(plan.world).changed(task=(one.target,))
        room = outer_areas(alone, alone.task)[0]
        if alone.rules.mode == "stops":
            room = shrunk(room, alone.rules.stop_tolerance, outside=True)
        if not room.is_empty and answers_for(alone, alone.task).reachable[0]:
            text = f"set-point {one.setpoint + 1} as given is left out as unreachable, and can be reached"
            yield Violation("areas", None, None, 0.0, text)


def _differences(plan: Plan, scene: Scene) -> Iterator[Violation]:
    """Parts of areas that are not as the world gives them, near its path or as a whole."""
    near = scene.about_path()
    if near is scene or any(_differences_in(plan, near)):
        yield from _differences_in(plan, scene)


def _differences_in(plan: Plan, scene: Scene) -> Iterator[Violation]:
    """Parts of areas that are not as a scene gives them, the plan's or what of it is near."""
    try:
        check_world(scene)
        free_space, areas, pruned = whole_path(scene)
    except NoPlanFound as no:
        yield Violation("areas", None, no.explanation.setpoint, 0.0, no.explanation.reason)
        return
    expected = planned_areas(scene, areas, free_space, pruned.left)[: len(plan.areas)]
    off = np.column_stack([_off(plan.areas[: len(expected)], expected, part) for part in PARTS])
    for i, k in np.argwhere(off > ROUNDING).tolist():
        text = f"{PARTS[k]} area differs by {off[i, k]:.4g} m2 from its world's"
        yield _violation(plan, i, float(off[i, k]), text)


def _off(areas: Sequence[PlannedArea], expected: Sequence[PlannedArea], part: str) -> Array:
    """How much of a part of areas, as files keep them, differs from what is expected, (n,) [m2]."""
    found, wanted = (
        shapely.normalize(stored_areas(getattr(area, part) for area in some)) for some in (areas, expected)
    )
    other = ~shapely.equals_exact(found, wanted)
    off = np.zeros(len(found))
    off[other] = shapely.area(shapely.symmetric_difference(found[other], wanted[other], grid_size=GRID))
    return off


def _bases_outside(plan: Plan) -> Iterator[Violation]:
    """Set-points whose base stands outside the pruned area."""
    for i, (found, area) in enumerate(zip(plan.setpoints, plan.areas, strict=False)):
        off = float(area.pruned.distance(Point(axis_of(plan.world.robot, found.base))))
        if not off <= ROUNDING:
            yield _violation(plan, i, off, f"base stands {off:.4g} m outside the pruned area")


def _violation(plan: Plan, i: int, amount: float, text: str) -> Violation:
    count = len(plan.world.task)
    return Violation("areas", None, i, amount, f"set-point {i + 1} of {count}: the plan's {text}")
