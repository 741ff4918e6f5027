"""Motion with the tool lifted: the arm is folded, the base drives over free floor, the arm unfolds.

Where it cannot fold, it goes on as the base drives. Where nothing so simple gets there, RRTConnect looks for
ways of base and arm together, unless the base is on wheels, then for ways of the arm alone before a drive and
after it, and for the drive of a carried arm that no berth from the floor's edge keeps clear.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice, pairwise

import numpy as np

from regionik.moving.base_motion import Driver
from regionik.moving.options import MOVING
from regionik.moving.shortcuts import GOOD_COST_RATIO, MIN_SAVED_LENGTH, Clock, Shortcuts, travel
from regionik.planners.collision.proximity import Proximity
from regionik.planners.driving.point_planner import NoPathError, drive_point
from regionik.planners.driving.sampling import PlanningProblem, connect
from regionik.postures.arm_roadmap import arm_path, joint_box, shortened
from regionik.postures.collision_checker import CollisionChecker
from regionik.postures.options import POSTURES
from regionik.postures.poses import Pose, arm_states, axis_of, distinct, pose_of
from regionik.scene import Scene
from regionik.worlds.arms import has_pivot, pivot_index
from regionik.worlds.arrays import Array
from regionik.worlds.drives import displacement
from regionik.worlds.robot import Robot

WITHDRAWALS = (0.0, 0.1, 0.2, 0.4, 0.6)  # how far the base draws back before the arm folds [m]
OPTIONS = MOVING.transits
MAX_LEG = 1e3  # longer than any leg of a way [m]


@dataclass(frozen=True, eq=False)
class TransitPlanner:
    """Moves the robot with its tool lifted."""

    scene: Scene
    collision: CollisionChecker
    driver: Driver
    # Why the base found no way, one for each time it did not
    refusals: list[NoPathError] = field(default_factory=list)
    _missed: dict[str, int] = field(default_factory=dict)  # how often the arm did not come to be carried so

    def sampled(self, here: Pose, there: Pose, piece: int) -> list[Pose] | None:
        """States strictly between two poses, on a way found in the space of the whole robot or of its arm."""
        direct = self.driver.direct(here, there, piece)
        if direct is not None and self.collision.passes([here, *direct, there]):
            self.driver.count("straight")
            return direct
        try:
            lead = self.driver.onto(here, piece)
        except NoPathError:
            return None
        if not self.collision.passes(lead):
            return None
        way, method = None, "whole body"
        if not self.scene.robot.drive.rolls:
            body = WholeBodyPlanner(self.scene, self.collision, self.driver, piece)
            way = body.way(lead[-1], there, self.driver.seed, OPTIONS.max_iterations)
        if way is None:
            way, method = self._arm_first(lead[-1], there, piece), "arm alone"
        if way is None:
            return None
        self.driver.count(method)
        return [*lead[1:], *way]

    def _arm_first(self, here: Pose, there: Pose, piece: int) -> list[Pose] | None:
        """States strictly between two poses: the arm moves, the base drives with it still, the arm moves on.

        The arm is driven as it is carried, or as it is at either end, what did not work before last; it moves
        where the robot stands, or where the base has drawn back to.
        """
        places = OPTIONS.max_fold_places
        leaving, coming = (list(islice(self._stations(at, piece), places)) for at in (here, there))
        carried = {"carry": self.scene.robot.carry, "here": here.joints, "there": there.joints}
        for name in sorted(carried, key=lambda name: self._missed.get(name, 0)):
            joints = carried[name]
            folds = [(out, way) for out in leaving if (way := self.arm_way(out[-1], joints)) is not None]
            self._missed[name] = self._missed.get(name, 0) + (not folds)
            for back in coming if folds else ():
                unfold = self.arm_way(back[-1], joints)
                if unfold is None:
                    continue
                for out, fold in folds:
                    start, end = Pose(out[-1].base, joints), Pose(back[-1].base, joints)
                    drive = self.carried(start, end, piece)
                    if drive is None and name == "carry" and len(out) == len(back) == 1:
                        drive = self._searched(start, end, piece)
                    if drive is not None:
                        return [*out, *fold, *drive, *unfold[::-1], *back[::-1]][1:-1]
        return None

    def arm_way(self, here: Pose, joints: Array) -> list[Pose] | None:
        """States after a pose, to the last with other joints, the base standing; None for none."""
        if not self.collision.proves(Pose(here.base, joints)):
            return None
        if np.array_equal(here.joints, joints):
            return []
        seed, most = self.driver.seed, OPTIONS.max_arm_iterations
        path = arm_path(self.collision, here.base, here.joints, joints, seed, most)
        if path is None:
            return None
        poses = [Pose(here.base, q) for q in path]
        return [row for a, b in pairwise(poses) for row in [*arm_states(a, b), b]]

    def _stations(self, at: Pose, piece: int) -> Iterator[list[Pose]]:
        """Clear motions of the base with a still arm, from a pose on: none first, then the nearest back."""
        yield [at]
        for far in WITHDRAWALS[1:]:
            ways = ([at, *back] for back in self.driver.retreats(at, far, piece))
            yield from islice((way for way in ways if self.collision.passes(way)), 1)

    def folded(self, here: Pose, there: Pose, piece: int) -> list[Pose] | None:
        """States strictly between two poses on one piece of free floor; None where the arm cannot pass so.

        The arm is folded at once where that keeps it clear, else after drawing back; it unfolds likewise.
        Else it goes from posture to posture as the base drives.
        """
        try:
            lead = self.driver.onto(here, piece)
            route = self.driver.route(lead[-1], there, piece)
        except NoPathError as refusal:
            self.refusals.append(refusal)
            return None
        plain = [*lead[1:], *self._carried(lead[-1], there, route)]
        if self.collision.passes([here, *plain, there]):
            return plain
        if not self.collision.passes(lead):
            return None
        way = self._withdrawn(lead[-1], there, piece)
        if way is None:
            way = self.driver.states(lead[-1], there, route)
            way = way if self.collision.passes([lead[-1], *way, there]) else None
        return None if way is None else [*lead[1:], *way]

    def _withdrawn(self, here: Pose, there: Pose, piece: int) -> list[Pose] | None:
        """States strictly between two poses, the arm folded and unfolded where the base has drawn back."""
        out, back = (self._withdrawal(at, piece) for at in (here, there))
        if out is None or back is None:
            return None
        drive = self.carried(out[-1], back[-1], piece)
        return None if drive is None else [*out, *drive, *back[::-1]]

    def shortened(self, here: Pose, way: list[Pose], there: Pose, piece: int) -> list[Pose]:
        """States strictly between two poses, on a way whose base goes no farther than on the one given.

        Where shortcuts alone do not make it short, other ways of base and arm are looked for that are shorter
        by so much that the arm may move more for it.
        """
        shortcuts = Shortcuts(self.collision, self.driver, piece)
        return shortcuts.quicker(self._shortest(shortcuts, [here, *way, there]))[1:-1]

    def rejoined(self, here: Pose, old: list[Pose], there: Pose, piece: int) -> list[Pose] | None:
        """States strictly between two poses, on an old way whose ends are near to them or a new one.

        The quicker of both, where neither is clear one that is searched for; none where the base would go
        farther round than before.
        """
        lead, tail = self.driver.direct(here, old[0], piece), self.driver.direct(old[-1], there, piece)
        folded, shortcuts = self.folded(here, there, piece), Shortcuts(self.collision, self.driver, piece)
        ways = [] if folded is None else [[here, *folded, there]]
        if lead is not None and tail is not None:
            ways.append(distinct([here, *lead, *old, *tail, there]))
        clear = [shortcuts.quicker(shortcuts.shorter(way)) for way in ways if self.collision.passes(way)]
        best = min(clear, key=Clock(self.scene).whole)[1:-1] if clear else self.sampled(here, there, piece)
        if best is None:
            return None
        way = self.shortened(here, best, there, piece)
        longest = max(OPTIONS.good_length_ratio, self._detour(old))
        return way if self._detour([here, *way, there]) <= longest else None

    def _detour(self, poses: list[Pose]) -> float:
        """How far the base goes, the least way for its arm axis being 1."""
        return travel(poses) / (self._least(poses[0], poses[-1]) + MIN_SAVED_LENGTH)

    def _shortest(self, shortcuts: Shortcuts, poses: list[Pose]) -> list[Pose]:
        """The shortest motion found with the same ends."""
        here, there, best, failed = poses[0], poses[-1], shortcuts.shorter(poses), 0
        if (
            self.scene.robot.drive.rolls
            or travel(best) <= OPTIONS.good_length_ratio * travel([here, there]) + MIN_SAVED_LENGTH
        ):
            return best
        least = self._least(here, there)
        enough = OPTIONS.good_length_ratio * least + MIN_SAVED_LENGTH
        for k in range(OPTIONS.max_rounds):
            if failed == OPTIONS.max_failed_rounds or travel(best) <= enough:
                break
            most = travel(best) / GOOD_COST_RATIO
            body = WholeBodyPlanner(self.scene, self.collision, self.driver.shaped(), shortcuts.piece, most)
            seed = self.driver.seed * OPTIONS.max_rounds + k
            other = body.way(here, there, seed, OPTIONS.max_round_iterations)
            short = best if other is None else shortcuts.shorter([here, *other, there])
            best, failed = (short, 0) if travel(short) <= most else (best, failed + 1)
        return best

    def _least(self, here: Pose, there: Pose) -> float:
        """Shortest way of the arm axis over outer free floor, which no heading and no posture makes shorter.

        Less what the base may save by turns about its axis at both ends [m].
        """
        robot = self.scene.robot
        a, b = (axis_of(robot, pose.base) for pose in (here, there))
        try:
            way = drive_point(self.scene.ground.outer.free, a, b, step=MAX_LEG).points
        except NoPathError:  # an end is off it by rounding
            way = np.array([a, b])
        turned = 2 * np.hypot(*robot.mount[:2])
        return max(travel([here, there]), float(np.hypot(*np.diff(way, axis=0).T).sum() - turned))

    def swung(self, here: Pose, there: Pose, _: int) -> list[Pose] | None:
        """States strictly between two postures on a base that stands: straight, or by the carry posture."""
        for between in ((), (lifted(self.scene.robot, here), lifted(self.scene.robot, there))):
            stations = distinct([here, *between, there])
            way = [row for a, b in pairwise(stations) for row in [*arm_states(a, b), b]]
            if self.collision.passes([here, *way]):
                return way[:-1]
        return None

    def driven(self, here: Pose, there: Pose, piece: int) -> list[Pose] | None:
        """States strictly between two poses: folded, else driven with the arm as it is at one of them."""
        way = self.folded(here, there, piece)
        for joints in (here.joints, there.joints) if way is None else ():
            start, end = Pose(here.base, joints), Pose(there.base, joints)
            leaving, coming = self.swung(here, start, piece), self.swung(end, there, piece)
            if leaving is None or coming is None:
                continue
            drive = self.carried(start, end, piece)
            if drive is not None:
                return distinct([here, *leaving, start, *drive, end, *coming, there])[1:-1]
        return way

    def round_about(self, here: Pose, there: Pose, _: int) -> list[Pose] | None:
        """States strictly between two postures on a base that stands, on a way found in the joints' space."""
        found = self.arm_way(here, there.joints)
        return None if found is None else found[:-1]

    def obstruction(self, here: Pose, there: Pose, piece: int) -> Proximity | None:
        """First obstruction of an arm that is folded, driven and unfolded without looking."""
        lead = self.driver.onto(here, piece)
        route = self.driver.route(lead[-1], there, piece)
        poses = [*lead, *self._carried(lead[-1], there, route), there]
        met = next(
            (proximity for proximity in map(self.collision.nearest, poses) if proximity.kind != "none"), None
        )
        # a proof only tells that it ended, not how deep
        return met or self.collision.first_obstruction(poses)

    def _carried(self, here: Pose, there: Pose, route: Array) -> list[Pose]:
        """Fold where the robot stands, drive in the carry posture, unfold; short ways without folding."""
        if len(route) <= 2:
            return self.driver.states(here, there, route)
        raised, lowered = lifted(self.scene.robot, here), lifted(self.scene.robot, there)
        drive = self.driver.states(raised, lowered, route)
        return [*arm_states(here, raised), raised, *drive, lowered, *arm_states(lowered, there)]

    def carried(self, here: Pose, there: Pose, piece: int) -> list[Pose] | None:
        """States strictly between two poses: a still arm, given the widest berth needed."""
        try:
            lead = self.driver.onto(here, piece)
            for berth in OPTIONS.berths:
                route = self.driver.route(lead[-1], there, piece, berth)
                drive = [*lead[1:], *self.driver.states(lead[-1], there, route)]
                if self.collision.passes([here, *drive, there]):
                    return drive
        except NoPathError:
            pass
        return None

    def _searched(self, here: Pose, there: Pose, piece: int) -> list[Pose] | None:
        """States strictly between two poses: a still arm, kept clear by where the base goes and turns."""
        if self.scene.robot.drive.rolls:
            return None
        body = WholeBodyPlanner(self.scene, self.collision, self.driver.shaped(), piece, is_still=True)
        return body.way(here, there, self.driver.seed, OPTIONS.max_iterations)

    def _withdrawal(self, here: Pose, piece: int) -> list[Pose] | None:
        """The shortest clear way from a pose to the carry posture: back with a still arm, then fold."""
        for far in WITHDRAWALS:
            for back in self.driver.retreats(here, far, piece):
                folded = lifted(self.scene.robot, back[-1])
                way = [*back, *arm_states(back[-1], folded), folded]
                if self.collision.passes([here, *way]):
                    return way
        return None


def lifted(robot: Robot, at: Pose) -> Pose:
    """Carry posture with the pivot left where it is, so that the arm folds in its own plane."""
    q = np.array(robot.carry)
    if has_pivot(robot.chain):
        q[pivot_index(robot.chain)] = at.joints[pivot_index(robot.chain)]
    return Pose(at.base, q)


@dataclass(frozen=True, eq=False)
class WholeBodyPlanner:
    """The space of arm axis, heading and joints over one piece of free floor, for an omnidirectional base.

    Where the base shall go less than ``most``, it keeps to the ellipse round both ends that this allows: the
    informed set of Gammell, Srinivasa and Barfoot, Informed RRT*, 2014.
    """

    scene: Scene
    collision: CollisionChecker
    driver: Driver
    piece: int
    most: float = np.inf  # [m]
    is_still: bool = False  # the arm, which is the same at both ends

    def way(self, here: Pose, there: Pose, seed: int, iterations: int) -> list[Pose] | None:
        """States strictly between two poses, with clear straight motions from turn to turn."""
        start, goal = self._row(here, here), self._row(there, here)
        problem = PlanningProblem(
            *self._box(start, goal), start, goal,
            lambda q: travel([here, at := self._pose(q), there]) < self.most
            and self.driver.inside(at, self.piece) and self.collision.proves(at),
            lambda p, q: self._goes(self._pose(p), self._pose(q)), self.scene.rules.base_planner,
        )  # fmt: skip
        path = connect(problem, seed=seed, iterations=iterations, stride=POSTURES.roadmap.max_stride)
        if path is None:
            return None
        poses = shortened([here, *(self._pose(q) for q in path[1:-1]), there], self._goes)
        ways = (self.driver.direct(a, b, self.piece) or [] for a, b in pairwise(poses))
        return [row for way, b in zip(ways, poses[1:], strict=True) for row in [*way, b]][:-1]

    def _goes(self, here: Pose, there: Pose) -> bool:
        """True if a straight motion stays on the free floor and keeps the arm clear."""
        states = self.driver.direct(here, there, self.piece)
        return states is not None and self.collision.passes([here, *states, there])

    def _row(self, pose: Pose, near: Pose) -> Array:
        """A pose as axis, heading and joints in one row, the heading within half a turn of another's."""
        yaw = near.base[2] + displacement(near.base, pose.base)[2]
        return np.array([*axis_of(self.scene.robot, pose.base), yaw, *pose.joints])

    def _pose(self, q: Array) -> Pose:
        """Pose of a row as `_row` makes them, its heading the fixed one where the rules ask for that."""
        scene = self.scene
        start = scene.start if scene.rules.heading == "fixed" else None
        yaw = q[2] if start is None else start.base[2]
        return Pose(pose_of(scene.robot, q[:2], float(yaw)), q[3:])

    def _box(self, start: Array, goal: Array) -> tuple[Array, Array]:
        """Bounds to sample within: the floor's extent, a turn about the start's heading, joint limits."""
        ends = np.stack([start, goal])
        low, high = ends.min(axis=0), ends.max(axis=0)
        scene, extent = self.scene, self.driver.extent(self.piece)
        reach = self.most / 2 + np.hypot(*scene.robot.mount[:2])
        low[:2] = np.maximum(extent[0], ends[:, :2].mean(axis=0) - reach)
        high[:2] = np.minimum(extent[1], ends[:, :2].mean(axis=0) + reach)
        if scene.rules.heading != "fixed":
            low[2], high[2] = start[2] - np.pi, start[2] + np.pi
        joints = start[3:], goal[3:]
        low[3:], high[3:] = joints if self.is_still else joint_box(scene.robot.chain, *joints)
        return low, high
