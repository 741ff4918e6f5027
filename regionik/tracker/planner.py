"""Plans by Xu's tracker: a differential base and a pitch arm follow set-points of full orientation.

Every pose is met in closed form, so that only the heading of the base at the first pose and the elbow are
searched, until `verify` finds a plan valid. That choice alone keeps clear of solids; the tracker avoids
nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import shapely
from shapely.geometry import Point
from shapely.geometry.base import BaseGeometry

from regionik.areas.ground import ground_of
from regionik.explain.constraints import no_way_to, setpoint_at
from regionik.explain.failures import invalid_plan
from regionik.planners.driving.footprint_scene import FootprintScene, footprint_scene
from regionik.planners.driving.pitch_arm import HeightError, PitchArm, arm_share
from regionik.planners.driving.point_planner import NoPathError
from regionik.planners.driving.wheeled_planner import drive_differential
from regionik.postures.poses import LARGEST_BEND, Pose, Row, axis_of, columns, lift_offs, motion_stats
from regionik.tracker.pose_paths import SAME, TrackedPath, arm_of, same, tracked_paths
from regionik.values import Configuration, Motion, Plan, PlannedArea, Report
from regionik.verification.verifier import verify
from regionik.worlds.arrays import Array
from regionik.worlds.errors import Cause, Explanation, NoPlanFound
from regionik.worlds.scene import Target, World

Progress = Callable[[str, int, int], None]

DRAWN = 0.005  # half the drawn width of the curves that the axis may stand on [m]


def follows(world: World) -> bool:
    """True if the tracker can plan a world: wheels, a pitch arm ahead of them, and full orientations."""
    full = all(target.orientation is not None for target in world.task)
    return full and arm_of(world.robot) is not None


def follow(world: World, seed: int, progress: Progress) -> Plan:
    """Plan a world that the tracker can plan (`follows`).

    Raises
    ------
    NoPlanFound
        When a height is out of reach, or no heading of the base at the first set-point leads to a valid plan.
    """
    arm = arm_of(world.robot)
    assert arm is not None, "asked of a world that the tracker follows"
    progress("tracker", 0, 0)
    rejected = _Rejected(world)
    joiner = _RunJoiner(world, seed)
    try:
        for k, found in enumerate(tracked_paths(world, arm)):
            progress("tracker", k, 0)
            try:
                motion = joiner.motion(found)
            except NoPathError as error:
                rejected.no_way.append(str(error))
                continue
            made = _plan_of(world, seed, arm, motion, joiner.methods(found))
            report = verify(made)
            if report.ok:
                return replace(made, stats={**made.stats, "margins": report.margins})
            rejected.reports.append(report)
    except HeightError as error:
        raise NoPlanFound(_out_of_reach(world, error)) from None
    raise NoPlanFound(rejected.explanation())


@dataclass(frozen=True, eq=False)
class _RunJoiner:
    """Joins runs to one motion; between two the tool is lifted and the base driven."""

    world: World
    seed: int

    def motion(self, found: TrackedPath) -> Motion:
        """States of all runs and of the drives to them; raises NoPathError."""
        start, rows, k = self.world.start, [], 0
        here = None if start is None else Pose(start.base, start.joints)
        if here is not None:
            rows.append(Row(here, "transit", -1))
        for run in found.runs:
            poses = [Pose(base, joints) for base, joints in zip(run.base, run.joints, strict=True)]
            if here is not None:
                rows += [Row(pose, "transit", -1) for pose in self._between(here, poses[0])]
            for pose in poses:
                rows.append(Row(pose, "setpoint" if found.path.exact[k] else "step", found.path.owner[k]))
                k += 1
            here = poses[-1]
        if start is not None and same(start.base, start.joints, rows[1].pose.base, rows[1].pose.joints):
            del rows[0]
        return columns(rows)

    def methods(self, found: TrackedPath) -> dict[str, int]:
        """Steps tracked and drives between runs."""
        drives = len(found.runs) - (self.world.start is None)
        return {"tracker": sum(len(run.base) - 1 for run in found.runs)} | (
            {"drive": drives} if drives else {}
        )

    def _between(self, here: Pose, there: Pose) -> list[Pose]:
        """States between two poses with the tool lifted: fold the arm, drive, and unfold it."""
        if same(here.base, here.joints, there.base, there.joints):
            return []
        carry = self.world.robot.carry
        way = drive_differential(self._room, here.base, there.base, seed=self.seed)
        driven = [Pose(base, carry) for base in way.sample(self.world.rules.step * 0.999)]
        unfolded = _bent(Pose(there.base, carry), there)
        return [*_bent(here, driven[0]), *driven[:-1], *unfolded[:-1]]

    @property
    def _room(self) -> FootprintScene:
        ground, robot = ground_of(self.world), self.world.robot
        return footprint_scene(robot.footprint, ground.floor, ground.shadows, self.world.rules.clearance)


def _bent(here: Pose, there: Pose) -> list[Pose]:
    """States after the first up to the second, the base at rest."""
    change = there.joints - here.joints
    n = max(1, int(np.ceil(np.abs(change).max() / LARGEST_BEND)))
    return [Pose(here.base, here.joints + k / n * change) for k in range(n + 1)][1:]


def _plan_of(world: World, seed: int, arm: PitchArm, motion: Motion, methods: dict[str, int]) -> Plan:
    at = np.flatnonzero(motion.kind == "setpoint")
    tools = world.robot.tool(motion.base[at], motion.joints[at])[:, :3, 3]
    found = tuple(
        Configuration(
            motion.base[k], motion.joints[k], float(np.linalg.norm(tool - target.position)), 0, True
        )
        for k, tool, target in zip(at.tolist(), tools, world.task, strict=True)
    )
    free = shapely.union_all(ground_of(world).inner.pieces)
    areas = tuple(
        _area(world, arm, target, free, axis_of(world.robot, one.base))
        for target, one in zip(world.task, found, strict=True)
    )
    stats = motion_stats(world.robot.drive, found, motion, methods)
    return Plan(world, seed, found, motion, areas, lift_offs(motion), (), stats)


def _area(world: World, arm: PitchArm, target: Target, free: BaseGeometry, axis: Array) -> PlannedArea:
    """Positions of the axis for a set-point: curves and points, drawn `DRAWN` to either side.

    Under an upright tool a circle for each elbow, under a leaning one a point. The area for the whole path is
    the point that the plan takes.
    """
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = target.orientation, target.position
    lower, upper = world.robot.chain.lower - SAME, world.robot.chain.upper + SAME
    curves = []
    for elbow in (1, -1):
        for facing in (1, -1):
            share = arm_share(arm, T, float(world.robot.mount[2]), elbow=elbow, facing=facing)
            if (share.joints < lower[1:4]).any() or (share.joints > upper[1:4]).any():
                continue
            if share.upright:
                ring = Point(T[:2, 3])
                curves.append(
                    ring.buffer(abs(share.out) + DRAWN, 64) - ring.buffer(abs(share.out) - DRAWN, 64)
                )
            else:
                way = np.array([np.cos(share.turn), np.sin(share.turn)])
                curves.append(Point(T[:2, 3] - share.out * way).buffer(DRAWN))
    reach, taken = shapely.union_all(curves), Point(axis).buffer(DRAWN)
    return PlannedArea((reach & free) | taken, taken, reach - free - taken)


def _out_of_reach(world: World, error: HeightError) -> Explanation:
    """Explanation of a height that the arm does not attain."""
    i = error.index
    nearest = error.low if error.height < error.low else error.high
    off, which = abs(nearest - error.height), "low" if error.height < error.low else "high"
    low, high, asked, missing = (
        f"{1000 * value:.2f}" for value in (error.low, error.high, error.height, off)
    )
    who = setpoint_at(world.task, i)
    reason = (
        f"{no_way_to(who)}: with this very tool direction and its last joint at zero, as the tracker "
        f"keeps it, the arm attains heights of {low} to {high} mm, wherever the base stands; {asked} mm is "
        f"asked for, {missing} mm too {which}. Other postures are not ruled out."
    )
    return Explanation("undecided", i, reason, (Cause("reach", world.robot.name, off),))


@dataclass(frozen=True, eq=False)
class _Rejected:
    """Paths that gave no valid plan, and why."""

    world: World
    reports: list[Report] = field(default_factory=list)
    no_way: list[str] = field(default_factory=list)

    def explanation(self) -> Explanation:
        """First violation of the plan that stays valid for longest, or the first drive without a path."""
        tried = len(self.reports) + len(self.no_way)
        many = (
            f"{tried} ways to follow the set-points were tried, from all headings of the base and both elbows"
        )
        if self.reports:
            first = [min(report.violations, key=lambda v: v.state or 0) for report in self.reports]
            farthest = max(first, key=lambda violation: violation.state or 0)
            told = invalid_plan(self.world, [farthest])
            return replace(told, reason=f"{many}. Of the one that goes farthest: {farthest.text}.")
        if self.no_way:
            return Explanation("ladder-broken", 0, f"{many}. {self.no_way[0]}.", (Cause("floor", "floor"),))
        reason = (
            "No way was found to follow the set-points: from all headings of the base and both elbows that "
            "were tried some joint leaves its limits."
        )
        return Explanation("no-posture", None, reason, (Cause("limits", self.world.robot.name),))
