"""What M-FABRIK asks of an arm: to follow a target with its base, to hold its base, to show its self-motion.

Arms that work in one vertical plane are solved in it; all others as chains of rigid bodies by FABRIK-R. Both
take the pivot as endless: `mfabrik` shares its turn between joint and base.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from regionik.planners.geometry.angles import wrap
from regionik.planners.geometry.polygons import FlatPolygon
from regionik.planners.reach.tool_roll import roll_for, tool_turn, within_limits
from regionik.planners.solvers.base_placement import FIXED, Turning
from regionik.planners.solvers.fabrik import limit_vectors
from regionik.planners.solvers.mfabrik_planar import least_change, solve
from regionik.planners.solvers.planar_arm import PlaneArm, self_motion
from regionik.planners.solvers.planar_setup import PlanarSetup, Record, record_of
from regionik.planners.solvers.posture_criteria import COMFORT, Thresholds, meeting_posture, posture_spare
from regionik.postures.families import Family, families_of
from regionik.postures.serial_solver import MOST_PASSES, Reached
from regionik.postures.tool_goal import deviation
from regionik.worlds.arms import PlanarArm
from regionik.worlds.arrays import Array
from regionik.worlds.scene import Target

ANGLE_SLACK = 1e-9  # rounding allowed at the edge of a cone [rad]
LOOKED_THROUGH = 360  # pitches of the last link, for a posture that meets what is asked


class Arm(Protocol):
    """An arm on a base, the heading of its base frame given."""

    def reach(
        self, target: Target, axis: Array, yaw: float, joints: Array, area: FlatPolygon, mobile: bool
    ) -> Reached:
        """Bring the tool to a target; a mobile base follows inside the area, any other stays."""

    def reach_many(
        self, targets: Array, axes: Array, yaws: Array, joints: Array, area: FlatPolygon
    ) -> list[Reached]:
        """As `reach` with a mobile base, for rows of bare points and starts."""

    def least_change(self, target: Target, axis: Array, yaw: float, joints: Array) -> Reached | None:
        """The posture on target that changes least, the base held."""

    def self_motion(
        self, target: Target, axis: Array, yaw: float, joints: Array, tries: int
    ) -> list[Reached]:
        """Postures on target of many kinds, the base held."""


@dataclass(frozen=True, eq=False)
class PlaneSolver:
    """An arm in one vertical plane, solved there with its limits."""

    arm: PlanarArm
    height: float
    family: Family
    tolerance: float
    asked: Thresholds | None = None

    @cached_property
    def plane(self) -> PlaneArm:
        """The arm for kernels; its arrays may be written to, so that numba knows one type of them."""
        arm = self.arm
        shoulder = float(arm.shoulder[0]), float(arm.shoulder[1] + self.height)
        lengths, lower, upper = (np.array(part, order="C") for part in (arm.lengths, arm.lower, arm.upper))
        return PlaneArm(*shoulder, lengths, lower, upper)

    @cached_property
    def _restarts(self) -> Array:
        """Ten postures to restart from, spread over the limits: elbow up and down, folded, stretched."""
        lower = np.where(np.isfinite(self.arm.lower), self.arm.lower, -np.pi)
        upper = np.where(np.isfinite(self.arm.upper), self.arm.upper, np.pi)
        spread: Array = lower + _SPREAD * (upper - lower)
        return spread

    def setup(self, mount: Array, turning: Turning) -> Record:
        """The arm on a base as kernels take it; what postures must meet besides their target is left out.

        Parameters
        ----------
        mount : (4,) array
            Arm base in the base frame: x, y, z [m], yaw [rad].
        turning : Turning
        """
        arm, plane, family = self.arm, self.plane, self.family
        zero = float(arm.pivot_zero + mount[3])
        return record_of(
            PlanarSetup(
                np.array([plane.shoulder_r, plane.shoulder_z]), plane.lengths, plane.lower, plane.upper,
                limit_vectors(plane.lower, plane.upper), arm.sign, arm.offset, self._restarts, mount[:2],
                zero, turning, family.facing, family.pitch, self.tolerance, MOST_PASSES,
            )
        )  # fmt: skip

    @cached_property
    def _alone(self) -> Record:
        """The arm on its own base frame, which keeps its heading: the pivot is endless."""
        return self.setup(np.zeros(4), Turning(-np.inf, np.inf, FIXED, 0.0, 0.0))

    def _at_pitch(self, pitch: float) -> Record:
        """The same with the last link at another pitch."""
        setup = self._alone.copy()
        setup["pitch"] = pitch
        setup.flags.writeable = False
        return setup

    def reach(
        self, target: Target, axis: Array, yaw: float, joints: Array, area: FlatPolygon, mobile: bool
    ) -> Reached:
        """Bring the tool to a target; see `Arm`. Of the kinds of posture the first that meets it."""
        best: Reached | None = None
        for kind in self._kinds(target):
            base, q = np.array([*axis, yaw]), np.array(joints)
            if mobile and target.direction is not None and len(area.starts) <= 1:
                base[:2] = _swung(kind, target.position, axis)
            setup, position = self._at_pitch(kind.pitch), np.array(target.position)
            error, passes, _ = solve(setup, area.vertices, area.starts, mobile, position, base, q)
            angle = self._rolled(target, yaw, q, joints)
            found = self._meeting(kind, target, Reached(base[:2], q, error, passes, angle), yaw, joints)
            if self._worth(found) <= (False, False, self.tolerance):
                return found
            if best is None or self._worth(found) < self._worth(best):
                best = found
        assert best is not None
        return best

    @staticmethod
    def _worth(found: Reached) -> tuple[bool, bool, float]:
        """What a posture lacks, the gravest first."""
        return not found.meets, found.angle > ANGLE_SLACK, found.error

    def _meeting(self, kind: Family, target: Target, found: Reached, yaw: float, joints: Array) -> Reached:
        """The posture itself where it meets what is asked, else the nearest from the same place that does."""
        if self.asked is None or self._meets(found, COMFORT):
            return found
        r, plane_yaw = self._seen(target.position, found.axis)
        near, bends, z = self.arm.bends(joints), np.empty(3), float(target.position[2])
        if not meeting_posture(self.plane, self.asked, kind.pitch, r, z, near, bends, LOOKED_THROUGH):
            return replace(found, meets=False)
        q, angle = self._turned(target, bends, plane_yaw, yaw, joints)
        return replace(found, joints=q, error=0.0, angle=angle)

    def _meets(self, found: Reached, room: float) -> bool:
        if self.asked is None:
            return True
        return bool(posture_spare(self.plane, self.asked, self.arm.bends(found.joints)) > room)

    def reach_many(
        self, targets: Array, axes: Array, yaws: Array, joints: Array, area: FlatPolygon
    ) -> list[Reached]:
        """One after the other; see `Arm`."""
        rows = zip(map(Target, targets), axes, yaws.tolist(), joints, strict=True)
        return [self.reach(*row, area, True) for row in rows]

    def least_change(self, target: Target, axis: Array, yaw: float, joints: Array) -> Reached | None:
        """The posture on target whose bends change least; see `Arm`."""
        best, least = None, np.inf
        for kind in self._kinds(target):
            base, q = np.array([*axis, yaw]), np.array(joints)
            change, _ = least_change(self._at_pitch(kind.pitch), np.array(target.position), base, q)
            if change < least:
                best, least = Reached(axis, q, 0.0, 0, self._rolled(target, yaw, q, joints)), change
        return best if best is None or self._meets(best, 0.0) else None

    def self_motion(
        self, target: Target, axis: Array, yaw: float, joints: Array, tries: int
    ) -> list[Reached]:
        """Postures on target at ``tries`` pitches, the elbow either way; see `Arm`."""
        r, plane_yaw = self._seen(target.position, axis)
        found: list[Reached] = []
        for kind in self._kinds(target):
            bends = np.empty((2 * tries, 3))
            count = self_motion(self.plane, kind.pitch, r, target.position[2], tries, bends)
            for one in bends[:count]:
                q, angle = self._turned(target, one, plane_yaw, yaw, joints)
                found.append(Reached(axis, q, 0.0, 0, angle))
        return [one for one in found if self._meets(one, 0.0)]

    def _kinds(self, target: Target) -> tuple[Family, ...]:
        """The family, or where it leaves the pitch open, those that the asked direction allows."""
        if target.direction is None or np.isfinite(self.family.pitch):
            return (self.family,)
        return families_of(self.arm, target, (self.family.facing,), inner=True) or (self.family,)

    def _turned(
        self, target: Target, bends: Array, plane_yaw: float, yaw: float, near: Array
    ) -> tuple[Array, float]:
        """Joints of a posture, the tool rolled as asked, and the angle by which it leaves its cone."""
        q = np.array(near)
        q[0] = plane_yaw - yaw - self.arm.pivot_zero
        q[1:4] = self.arm.hinge_joints(bends, near)
        return q, self._rolled(target, yaw, q, near)

    def _rolled(self, target: Target, yaw: float, q: Array, near: Array) -> float:
        """Roll the tool as asked, in ``q``; the angle by which it leaves its cone."""
        if target.direction is None:
            return 0.0
        arm, plane_yaw = self.arm, yaw + self.arm.pivot_zero + float(q[0])
        pitch, roll = float(arm.bends(q).sum()), 0.0
        if arm.roll is not None:
            if target.orientation is not None:
                wanted = roll_for(arm, plane_yaw, pitch, target.orientation)
                q[arm.roll] = within_limits(arm, wanted, float(near[arm.roll]))
            roll = float(q[arm.roll])
        off = deviation(target, tool_turn(arm, plane_yaw, pitch, roll))
        return max(0.0, off - target.cone)

    def _seen(self, target: Array, axis: Array) -> tuple[float, float]:
        """Target in the plane, and the plane's direction."""
        dx, dy = target[:2] - axis
        facing = self.family.facing
        return facing * float(np.hypot(dx, dy)), float(np.arctan2(facing * dy, facing * dx))


def _swung(kind: Family, target: Array, axis: Array) -> Array:
    """The axis led round a target until the plane points as the family allows."""
    dx, dy = target[:2] - axis
    azimuth, away = (
        float(np.arctan2(kind.facing * dy, kind.facing * dx)),
        kind.facing * float(np.hypot(dx, dy)),
    )
    swing = float(wrap(azimuth - kind.azimuth))
    if abs(swing) <= kind.half:
        return axis
    azimuth = kind.azimuth + float(np.clip(swing, -kind.half, kind.half))
    place: Array = target[:2] - away * np.array([np.cos(azimuth), np.sin(azimuth)])
    return place


_SPREAD = np.array(
    [
        (0.5, 0.5, 0.5), (0.3, 0.2, 0.5), (0.7, 0.8, 0.5), (0.3, 0.7, 0.3), (0.6, 0.2, 0.8),
        (0.8, 0.3, 0.2), (0.1, 0.5, 0.5), (0.5, 0.1, 0.1), (0.5, 0.9, 0.9), (0.9, 0.5, 0.7),
    ]
)  # fmt: skip
