"""Ways with the tool lifted, planned anew where smoothing has moved the ends of a run."""

from __future__ import annotations

from dataclasses import dataclass

from regionik.areas.standing import Standing
from regionik.moving.transit import TransitPlanner
from regionik.postures.poses import Pose, Row, axis_of, columns, pose_between, transits
from regionik.values import Motion


@dataclass(frozen=True, eq=False)
class Reconnection:
    """Moves the robot with its tool lifted to where runs begin now."""

    planner: TransitPlanner
    standing: Standing

    def joined(self, old: Motion, new: Motion) -> Motion | None:
        """The new motion, its ways with the tool lifted led to where they have to be now; None without one.

        They are those of the old motion, which has as many, where their ends have not moved.
        """
        parts, done = list[Motion](), 0
        for was, now in zip(transits(old), transits(new), strict=True):
            if all(map(_same, _ends(old, was), _ends(new, now))):
                continue
            way = self._way(*_ends(new, now), lifted=now.start > 1)
            if way is None:
                return None
            owner = int(new.setpoint[now.start - 1])
            rows = [Row(pose, "transit", owner) for pose in way]
            parts += [new.part(done, now.start), *([columns(rows)] if rows else [])]
            done = now.stop
        return Motion.joined([*parts, new.part(done, len(new))])

    def _way(self, here: Pose, there: Pose, lifted: bool) -> list[Pose] | None:
        robot = self.planner.world.robot
        piece = self.standing.piece_at(axis_of(robot, here.base), float(here.base[2]))
        if piece is None:
            return None
        way = self.planner.folded(here, there, piece)
        if way is None:
            way = self.planner.sampled(here, there, piece)
        way = None if way is None else self.planner.shortened(here, way, there, piece)
        return [pose_between(here, there, 0.5, robot.drive)] if way == [] and lifted else way


def _ends(motion: Motion, rows: slice) -> tuple[Pose, Pose]:
    here, there = (Pose(motion.base[k], motion.joints[k]) for k in (rows.start - 1, rows.stop))
    return here, there


def _same(one: Pose, other: Pose) -> bool:
    return bool((one.base == other.base).all() and (one.joints == other.joints).all())
