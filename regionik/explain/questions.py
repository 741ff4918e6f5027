"""Questions that an explanation asks of changed worlds: about a target, the arm at a target, or a whole path.

A question knows the constraints that may be its causes, the test that rules a world out, the changes that may
mend it, and the oracle that decides whether one does. Oracles are stages above this folder, passed in.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from regionik.explain.changes import (
    Change,
    Move,
    allow_lift_offs,
    lift_within,
    lower_clearance,
    lower_clearances,
    move_obstacle,
    move_target,
    open_cone,
    raise_arm,
    repaired,
)
from regionik.explain.constraints import (
    ARM_CLEARANCE,
    LIFT_OFFS,
    LIFT_WITHIN,
    Constraint,
    arm_constraints_of,
    constraints_of,
    path_constraints_of,
    without_obstacle,
)
from regionik.explain.minimal_change import (
    GRID_SCAN,
    Holds,
    Scan,
    circle,
    confirmed,
    first_seen,
    grid_above,
    least_open,
    shortest_step,
    sphere,
)
from regionik.explain.options import EXPLAIN
from regionik.explain.steps import Steps, obstacle_steps, steps_around, target_steps
from regionik.planners.search.box_search import Verdict
from regionik.regions import has_no_known_place, have_known_places, is_ruled_out
from regionik.scene import Scene
from regionik.worlds.arms import reach_bound
from regionik.worlds.errors import Repair

OPTIONS = EXPLAIN.questions

if TYPE_CHECKING:
    from regionik.values import Answer


ARM_SCAN = Scan(1, 1.5 * EXPLAIN.grid, 0.05, grid_above)  # for what is asked with the arm
CHANGE_SCAN = Scan(1, 1e-5, 0.0)  # for what areas are asked
PATH_SCAN = Scan(12, EXPLAIN.grid, 0.01)  # for what whole paths are asked


@dataclass(frozen=True)
class Oracles:
    """Stages that decide on the one target of a world."""

    reach: Callable[[Scene], Answer]  # the answer of `reachability.reach` for the task
    # True where a configuration is found in the areas that hold at every heading: faster than ``reach``, and
    # stricter
    seen: Callable[[Scene], bool]
    # Verdict of a search of all postures from all places, with a budget of cells
    look: Callable[[Scene, int], Verdict]


def _named(causes: Sequence[Constraint]) -> list[str]:
    """Names of the obstacles among the causes."""
    return [one.name for one in causes if one.kind == "obstacle"]


def _obstacles(scene: Scene, causes: Sequence[Constraint]) -> Iterator[Move | None]:
    """Moves of the obstacles among the causes; moving any other does not help."""
    return (move_obstacle(scene, name) for name in _named(causes))


@dataclass(frozen=True)
class _OneTarget:
    """A question about the one target of a world."""

    scene: Scene
    who: str  # the target's name
    oracles: Oracles
    path: tuple[Scene, int]  # the world whose set-point this is, and which

    def leaves(self, repair: Repair) -> str:
        """Words on the first other set-point that a repair leaves without a known place, if any."""
        scene, i = self.path
        if len(scene.task) == 1:
            return ""
        after = repaired(scene, repair, i)
        for j in np.flatnonzero(~have_known_places(after, after.task)).tolist():
            if j != i and has_no_known_place(after.changed(task=(after.task[j],))):
                return f", with which set-point {j + 1} still has no known place"
        return ""

    def changed(self, repair: Repair) -> Scene:
        """Return the world with a repair made to its one target."""
        return repaired(self.scene, repair)

    def enters(self, after: Scene) -> bool:
        """Return True where the target is in a solid that it was not in."""
        old, new = self.scene.task[0].position, after.task[0].position
        solids = zip(self.scene.world.solids, after.world.solids, strict=True)
        return any(a.distance(old) >= 0 and b.distance(new) < 0 for a, b in solids)

    def holds(self, after: Scene) -> bool:
        """Return True where the target of a changed world is reachable, and newly in no solid."""
        if self.enters(after):
            return False
        known = have_known_places(after, after.task)[0] or not has_no_known_place(after)
        return bool(known and self.oracles.reach(after).reachable.all())  # sooner known than asked


# A target ----------------------------------------------------------------------------------------------


class TargetQuestion(_OneTarget):
    """Is the target in reach from some place for the base? Asked of areas, then of `Oracles.reach`."""

    @cached_property
    def proof(self) -> str:
        return "This is a proof: with these the outer area is empty." if is_ruled_out(self.scene) else ""

    @property
    def constraints(self) -> tuple[Constraint, ...]:
        return constraints_of(self.scene)

    def closed(self, scene: Scene) -> bool:
        return is_ruled_out(scene) if self.proof else has_no_known_place(scene)

    def changes(self, causes: Sequence[Constraint]) -> Iterator[Change | Move | None]:
        scene, target, span = self.scene, self.scene.task[0], reach_bound(self.scene.robot.chain)
        model = scene.model(target)
        yield from lower_clearances(scene, _named(causes))
        yield open_cone(scene, self.who)
        if model.exact:  # any other arm needs a search for each height
            height = float(target.position[2] - scene.robot.mount[2]) - span.height
            yield raise_arm(scene, max(0.0, height) + span.length)
        yield move_target(scene, self.who)
        yield from _obstacles(scene, causes)

    def least(self, change: Change) -> Repair | None:
        as_target = change.as_target
        if as_target is None:
            opens = CHANGE_SCAN.first(
                lambda one: bool(have_known_places(change.at(one), self.scene.task)[0]), change.most
            )
            return self._confirmed(change, opens or change.most)
        amount = least_open(
            lambda amounts: have_known_places(self.scene, [as_target(float(one)) for one in amounts]),
            change.most,
        )
        return None if amount is None else self._confirmed(change, amount)

    def _confirmed(self, change: Change, amount: float) -> Repair | None:
        """The repair by an amount found by areas, confirmed by asking whether the target is reachable."""
        found = confirmed(
            lambda one: self.holds(change.at(one)),
            amount,
            change.most,
            lambda one: self._seen(change.at(one)),
        )
        return None if found is None else change.repair(found)

    def _seen(self, after: Scene) -> bool:
        return not self.enters(after) and self.oracles.seen(after)

    def farthest(self, move: Move) -> float:
        """Length of the longest step that is tried [m]."""
        if move.kind == "move-target":
            return OPTIONS.target_lengths[-1]
        steps = obstacle_steps(move)
        return 0.0 if steps is None else steps.most

    def shortest(self, move: Move) -> Repair | None:
        """A short step of the target or an obstacle, confirmed."""
        if move.kind != "move-target":
            return self._by_areas(move, obstacle_steps(move))
        model, found = self.scene.model(self.scene.task[0]), None
        if model.is_proven(self.scene.rules):  # other reach is sampled pose by pose
            found = self._by_areas(move, target_steps(move))
        if found is not None and model.exact:  # areas of other arms are those of one height
            return found
        return self.around(move, np.inf if found is None else found.amount) or found

    def _holds_at(self, change: Change) -> Holds:
        return lambda amount: self.holds(change.at(amount))

    def _by_areas(self, move: Move, steps: Steps | None) -> Repair | None:
        """The shortest step found by areas, confirmed.

        Where the arm needs a longer one, so as to touch nothing, other directions are tried with the arm.
        """
        step = None if steps is None else shortest_step(steps.opens, steps.directions, steps.most)
        if steps is None or step is None:
            return None
        length, way = step
        first = self._confirmed(move.along(way, steps.most), length)
        longest = 2 * length if first is None else first.amount
        if longest <= OPTIONS.aside_factor * length:
            return first
        aside = first_seen(steps.opens, lambda by: self._seen(move.at(by)), steps.directions, length, longest)
        second = None if aside is None else self._confirmed(move.along(aside[1], longest), aside[0])
        return second or first

    def around(self, move: Move, longest: float) -> Repair | None:
        """A step of the target in space: of a few lengths the first at which one helps, then less of it."""
        steps, lengths = steps_around(move)
        low = 0.0
        for length in (one for one in lengths if one < longest):
            for way in steps.directions[steps.opens(length * steps.directions)][: OPTIONS.max_arm_steps]:
                change = move.along(way, length)
                if self.holds(change.at(length)):
                    return change.repair(ARM_SCAN.narrowed(self._holds_at(change), low, length))
            low = length
        return None


# The arm -----------------------------------------------------------------------------------------------


class ArmQuestion(_OneTarget):
    """Is the arm clear at the target from some place? Asked where all postures can be searched."""

    proof = "This is a proof: with these no posture from any place is clear."

    @property
    def constraints(self) -> tuple[Constraint, ...]:
        return arm_constraints_of(self.scene)

    def closed(self, scene: Scene) -> bool:
        """Return True where the target is proven to have no clear posture from any place."""
        return is_ruled_out(scene) or self.oracles.look(scene, OPTIONS.proof_cells) == Verdict.RULED_OUT

    def changes(self, causes: Sequence[Constraint]) -> Iterator[Change | Move | None]:
        yield lower_clearance(self.scene, ARM_CLEARANCE)
        yield open_cone(self.scene, self.who)
        yield raise_arm(self.scene, reach_bound(self.scene.robot.chain).length)
        yield move_target(self.scene, self.who)
        yield from _obstacles(self.scene, causes)

    def _seen(self, after: Scene) -> bool:
        """Return True where a clear posture is found in a changed world, the target newly in no solid."""
        if after.task[0].position[2] < 0 or self.enters(after):
            return False
        return self.oracles.look(after, OPTIONS.search_cells) == Verdict.PROVEN

    def least(self, change: Change) -> Repair | None:
        most = change.most
        amount = (
            GRID_SCAN.first(lambda one: self._seen(change.at(one)), most) if most >= EXPLAIN.grid else None
        )
        if amount is not None:
            amount = confirmed(lambda one: self.holds(change.at(one)), amount, most)
        return None if amount is None else change.repair(amount)

    def farthest(self, move: Move) -> float:
        """Length of the longest step that is tried [m]."""
        return OPTIONS.arm_move_lengths[-1]

    def shortest(self, move: Move) -> Repair | None:
        """A short step: of a few lengths the first at which some direction helps, then less of it."""
        directions = sphere(12) if move.kind == "move-target" else circle(12)
        for length in OPTIONS.arm_move_lengths:
            for way in directions:
                if self._seen(move.at(length * way)):
                    repair = self.least(move.along(way, length))
                    if repair is not None:
                        return repair
        return None


# A path ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class PathQuestion:
    """Does the ladder of areas span a world's path, and can it be planned?"""

    scene: Scene
    setpoint: int  # before which the ladder breaks
    spans: Callable[[Scene], bool]  # True where the areas of a world span its path
    plans: Callable[[Scene], bool]  # True where the path of a world can be planned
    proof = ""

    def leaves(self, repair: Repair) -> str:
        """Nothing: the path was planned with it."""
        return ""

    @property
    def constraints(self) -> tuple[Constraint, ...]:
        return path_constraints_of(self.scene)

    def closed(self, scene: Scene) -> bool:
        return not self.spans(scene)

    def changes(self, causes: Sequence[Constraint]) -> Iterator[Change | Move | None]:
        """Single changes; obstacles and mount stay where headings matter, as a test then takes seconds."""
        if any(one.name == LIFT_OFFS for one in causes):
            yield allow_lift_offs(self.scene, self.setpoint)
        if any(one.name == LIFT_WITHIN for one in causes):
            yield Change(self.scene, 1, lambda _: lift_within(self.scene, self.setpoint), counted=True)
        yield from lower_clearances(self.scene, _named(causes))
        if not self.scene.free_floor.turns_matter:
            yield from _obstacles(self.scene, causes)
            yield raise_arm(self.scene, reach_bound(self.scene.robot.chain).length)

    def least(self, change: Change) -> Repair | None:
        scan = PATH_SCAN
        if change.counted:
            scan = Scan(round(change.most), 1.0, 0.0)
        elif change.monotone:
            scan = replace(PATH_SCAN, steps=1)
        return self._planned(change, scan.first(self._spans_at(change), change.most))

    def _spans_at(self, change: Change) -> Holds:
        return lambda amount: self.spans(change.at(amount))

    def _planned(self, change: Change, amount: float | None) -> Repair | None:
        """The repair by an amount, or a little more, with which the path is planned."""
        if amount is None:
            return None
        factors = (1.0,) if change.counted else OPTIONS.plan_factors
        tried = [change.repair(amount * factor) for factor in factors]
        return next((one for one in tried if self.plans(repaired(self.scene, one))), None)

    def farthest(self, move: Move) -> float:
        """Length of the longest step that is tried: half the floor's diagonal [m]."""
        x0, y0, x1, y1 = self.scene.floor.polygon.bounds
        return float(np.hypot(x1 - x0, y1 - y0)) / 2

    def shortest(self, move: Move) -> Repair | None:
        """An obstacle moved in the direction in which that helps first."""
        if not self.spans(without_obstacle(self.scene, move.name)):
            return None
        best, first = self.farthest(move), None
        for way in circle(8):
            change = move.along(way, best)
            found = PATH_SCAN.first(self._spans_at(change), best)
            if found is not None and (first is None or found < best):
                best, first = found, change
        return None if first is None else self._planned(first, best)


Question = TargetQuestion | ArmQuestion | PathQuestion
