"""Reach of targets in a scene as a table of areas, before the ground takes what it rejects."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from regionik.areas.ground import EVERY, united
from regionik.areas.layers import ROUNDING_MARGIN, Geometries
from regionik.areas.options import AREAS
from regionik.areas.reach_model import FineReachTable, ReachModel, ReachQuery, ReachTable
from regionik.areas.reachable import reach_model
from regionik.planners.progress import track
from regionik.postures.arm import goal_of
from regionik.postures.families import Family
from regionik.scene import Scene
from regionik.worlds.scene import Target


def reach_table(
    scene: Scene,
    targets: Sequence[Target],
    facings: Sequence[int],
    *,
    inner: bool,
    span: tuple[float, float] = EVERY,
    coarse: bool = False,
    proven: bool = False,
) -> ReachTable:
    """Reach of targets as rings and ring sectors, before rejection, the base's heading within a span.

    See `ReachQuery` for ``coarse`` and ``proven``.
    """
    margin = scene.rules.reach_margin if inner else None
    which, kinds, shapes = reach_table_of(
        scene, targets, ReachQuery(scene.rules, margin, span, tuple(facings), coarse=coarse, proven=proven)
    )
    if inner:
        shapes = _eroded(shapes, scene.world.axis_error)
    real = np.flatnonzero(~shapely.is_empty(shapes))
    return which[real], tuple(kinds[k] for k in real.tolist()), shapes[real]


def inner_reach_tables(
    scene: Scene,
    targets: Sequence[Target],
    facings: Sequence[int],
    spans: Sequence[tuple[float, float]],
    *,
    coarse: bool = False,
) -> list[ReachTable]:
    """Inner `reach_table` at several spans of headings: the very same where these make no difference."""
    known: dict[tuple[float, float], ReachTable] = {}
    found = []
    for span in track("headings", spans):
        heeded = heeds_headings(scene, targets, facings, span, coarse=coarse)
        asked = span if heeded else EVERY
        if asked not in known:
            known[asked] = reach_table(scene, targets, facings, inner=True, span=asked, coarse=coarse)
        found.append(known[asked])
    return found


def heeds_headings(
    scene: Scene,
    targets: Sequence[Target],
    facings: Sequence[int],
    span: tuple[float, float],
    *,
    coarse: bool = False,
) -> bool:
    """Return True where the inner reach of targets within a span of headings may not be that of all."""
    query = ReachQuery(scene.rules, scene.rules.reach_margin, span, tuple(facings), coarse=coarse)
    models = {scene.model(target): None for target in targets}
    return scene.lifted.matters or any(model.heeds_headings(query) for model in models)


def reach_table_of(scene: Scene, targets: Sequence[Target], query: ReachQuery) -> ReachTable:
    """`reach_table` as a query asks for them, whatever place an execution puts the arm axis off.

    Places from which a lift would bring its load too near to something are none; where no other is left to an
    inner area, those from which some part of its range does not.
    """
    alike: dict[ReachModel, list[int]] = {}
    for i, target in enumerate(targets):
        alike.setdefault(scene.model(target), []).append(i)
    which, shapes = np.empty(0, dtype=np.intp), np.empty(0, dtype=object)
    kinds: tuple[Family, ...] = ()
    for model, members in alike.items():
        rows = model.table([targets[i] for i in members], query)
        which = np.concatenate([which, np.array(members, dtype=np.intp)[rows[0]]])
        kinds, shapes = kinds + rows[1], np.concatenate([shapes, rows[2]])
    order = np.argsort(which, kind="stable")
    which, shapes = which[order], shapes[order]
    rows = which, tuple(kinds[k] for k in order), shapes
    return _without_lifted(scene, targets, query, rows) if scene.lifted.matters else rows


def _without_lifted(
    scene: Scene, targets: Sequence[Target], query: ReachQuery, rows: ReachTable
) -> ReachTable:
    """Rows less the places that what lifts carry rejects."""
    (which, kinds, whole), left = rows, rows[2].copy()
    heights = np.array([target.position[2] for target in targets])[which]
    for z in np.unique(heights).tolist():
        taken = scene.lifted.rejection(z, query.span, inner=query.inner)
        left[heights == z] = shapely.difference(whole[heights == z], taken)
    if not query.inner:
        return which, kinds, left
    ground = scene.ground.outer
    places, open_ = ground.subtract(whole), shapely.area(ground.subtract(left)) > 0
    for i in np.setdiff1d(which[shapely.area(places) > 0], which[open_]).tolist():
        for k in np.flatnonzero(which == i).tolist():
            left[k] = _by_parts_of_lifts(scene, targets[i], kinds[k], query, places[k])
    return which, kinds, left


def _by_parts_of_lifts(
    scene: Scene, target: Target, family: Family, query: ReachQuery, places: BaseGeometry
) -> BaseGeometry:
    """Places of some from which a part of the range of lifts does, what they carry clear in all of it."""
    found = [Polygon()]
    for part in scene.lifted.parts(float(target.position[2])):
        taken = scene.lifted.rejection_of(part, query.span, inner=True)
        if shapely.difference(places, taken).is_empty:
            continue
        _, kinds, shapes = scene.model_with_lift(target, part).table([target], query)
        own = [shape for kind, shape in zip(kinds, shapes, strict=True) if kind == family]
        found += [shapely.difference(shape, taken) for shape in own]
    return united(np.array(found, dtype=object))


def fine_reach(
    scene: Scene, target: Target, kinds: Sequence[Family], span: tuple[float, float], *, inner: bool
) -> FineReachTable:
    """Reach of one target without the rules' ``reach_margin``, with finer circles: families and shapes.

    Shapes lie within the true reach, or around it by the layer of the height, with the base's heading within
    a span.
    """
    query = ReachQuery(
        scene.rules, ROUNDING_MARGIN if inner else None, span, arcs=AREAS.fine_arc_points, coarse=not inner
    )
    families, shapes = reach_model(scene.robot, goal_of(target)).fine_table(target, kinds, query)
    return families, _eroded(shapes, scene.world.axis_error) if inner else shapes


def _eroded(shapes: Geometries, error: float) -> Geometries:
    """Places of the arm axis from which it stays in a shape wherever an execution puts it, (n,)."""
    left: Geometries = shapely.buffer(shapes, -error, join_style="mitre") if error > 0 else shapes
    return left
