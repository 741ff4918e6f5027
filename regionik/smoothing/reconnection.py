"""Ways with the tool lifted, planned anew where smoothing has moved the ends of a run."""

from __future__ import annotations

from dataclasses import dataclass

from regionik.areas.standing import Standing
from regionik.moving.transit import TransitPlanner
from regionik.postures.poses import Pose, axis_of, columns, lifted_rows, transits
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
            here, there = _ends(new, now)
            if all(map(_same, _ends(old, was), (here, there))):
                continue
            way = self._way(here, there, [_pose(old, k) for k in range(was.start - 1, was.stop + 1)])
            if way is None:
                return None
            owner, drive = int(new.setpoint[now.start - 1]), self.planner.world.robot.drive
            rows = lifted_rows(here, way, there, owner, drive)
            parts += [new.part(done, now.start), *([columns(rows)] if rows else [])]
            done = now.stop
        return Motion.joined([*parts, new.part(done, len(new))])

    def _way(self, here: Pose, there: Pose, old: list[Pose]) -> list[Pose] | None:
        piece = self.standing.piece_at(axis_of(self.planner.world.robot, here.base), float(here.base[2]))
        return None if piece is None else self.planner.rejoined(here, old, there, piece)


def _ends(motion: Motion, rows: slice) -> tuple[Pose, Pose]:
    return _pose(motion, rows.start - 1), _pose(motion, rows.stop)


def _pose(motion: Motion, k: int) -> Pose:
    return Pose(motion.base[k], motion.joints[k])


def _same(one: Pose, other: Pose) -> bool:
    return bool((one.base == other.base).all() and (one.joints == other.joints).all())
