"""Many solves in one call, and single ones inside an area, against rivals of our own."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import shapely

from benchmarks.speed.harness import Row, Size, Wanted, against, timed
from benchmarks.speed.mobile import TOLERANCE, Task, mobile_chain, task
from benchmarks.speed.rivals import damped_steps, passes_with_shapely
from regionik.mfabrik import Solver
from regionik.regions import admissible_area
from regionik.worlds.arrays import Array
from regionik.worlds.obstacles import Cylinder
from regionik.worlds.scene import Floor, Rules, Target, World

MANY = 100_000
CLAMPED = 150
PILLARS, RADIUS = 30, 0.05  # [m]


def rows(size: Size) -> Iterator[Row]:
    """Batches, then areas."""
    yield from batches(size)
    yield clamped(size)


def batches(size: Size) -> Iterator[Row]:
    """The whole batch, checked and converted, against compiled damped least squares with nothing about it."""
    some = task(size.count(MANY))
    solver = Solver(some.robot, tolerance=TOLERANCE)
    count = len(some.targets)
    limits = limits_of(some)
    for name, bounds, wanted in (
        ("compiled full-step DLS, no limits", np.full_like(limits, np.inf) * [-1, 1], Wanted(2.0)),
        ("compiled full-step DLS, clipped to limits", limits, None),
    ):
        error, within = damped(some, solver, bounds)
        met = 100 * (error <= TOLERANCE).mean()
        own = 100 * solver.batch(*some[1:]).converged.mean()
        note = (
            f"DLS solves {met:.4g} %, {100 * within.mean():.4g} % within limits; ours {own:.4g} %, all "
            f"within limits"
        )
        yield against(
            f"one of a batch of {count:,}, joints to joints",
            name,
            lambda: solver.batch(*some[1:]),
            lambda bounds=bounds: damped(some, solver, bounds),  # type: ignore[misc]
            wanted,
            size,
            pieces=(count, count),
            note=note,
        )


def limits_of(some: Task) -> Array:
    """Limits of base and arm (3 + dof, 2)."""
    chain = mobile_chain(some.robot)
    return np.column_stack([chain.lower, chain.upper])


def damped(some: Task, solver: Solver, bounds: Array) -> tuple[Array, Array]:
    """Errors [m] of damped least squares, and whether its joints are within limits."""
    assert solver._setup is not None
    bases, joints, errors = some.bases.copy(), some.joints.copy(), np.empty(len(some.targets))
    damped_steps(solver._setup, bounds, some.targets, bases, joints, TOLERANCE, errors)
    lower, upper = limits_of(some)[3:].T
    return errors, ((joints >= lower) & (joints <= upper)).all(axis=1)


def world_of(some: Task) -> World:
    """A hall of three metres with thin pillars."""
    spots = np.random.default_rng(1).uniform(-1.4, 1.4, (PILLARS, 2))
    solids = (Cylinder(f"pillar {k}", RADIUS, 1.0, np.array([x, y, 0.5])) for k, (x, y) in enumerate(spots))
    floor, rules = Floor(shapely.box(-1.5, -1.5, 1.5, 1.5)), Rules(clearance=0.1)
    return World("hall", some.robot, floor, tuple(solids), (), rules)


def clamped(size: Size) -> Row:
    """One solve from Python inside the area of its target, against the same passes with shapely between them.

    Of the targets those count that the first start of both meets, so that both do the same passes.
    """
    some = task(size.count(CLAMPED))
    world, cases, passes, corners = world_of(some), [], 0, 0
    for case in zip(*some[1:], strict=True):
        area = admissible_area(world, Target(case[0])).inner
        if area.is_empty:
            continue
        solver, edge = Solver(some.robot, area, TOLERANCE), area.boundary
        assert solver._setup is not None
        shapely.prepare([area, edge])
        theirs = (solver._setup, area, edge, *case, TOLERANCE)
        found, (error, used, x, y) = solver(*case), passes_with_shapely(*theirs)
        if found.converged and error <= TOLERANCE and found.iterations == used:
            assert np.hypot(*(found.base[:2] - [x, y])) < 1e-9, "both must do the same"
            cases.append((solver, case, theirs))
            passes, corners = passes + used, corners + shapely.get_num_coordinates(area)

    def ours() -> None:
        for solver, case, _ in cases:
            solver(*case)

    def rival() -> None:
        for _, _, given in cases:
            passes_with_shapely(*given)

    count = max(1, len(cases))
    note = f"{len(cases)} of {len(some.targets)} targets, {passes / count:.3g} passes each, areas of "
    note += f"{corners / count:.3g} corners on average"
    what = f"one solve from Python, clamped to its area among {PILLARS} pillars"
    name, wanted = "the same passes with shapely calls", Wanted(15.0)
    row = against(what, name, ours, rival, wanted, size, pieces=(count, count), note=note)
    if row.met or row.ours is None:
        return row
    free = Solver(some.robot, tolerance=TOLERANCE)
    alone = timed("", "", lambda: [free(*case) for _, case, _ in cases], None, Size(rounds=5)).ours
    assert alone is not None
    share = f"of ours {1e9 * row.ours.median:.0f} ns: {1e9 * alone.median / count:.0f} without an area"
    return replace(row, note=f"{note}; {share}, the rest in asking its edges")
