"""An arm that works in one vertical plane, solved there by M-FABRIK with its limits; see `Arm`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from regionik.planners.geometry.angles import wrap
from regionik.planners.geometry.polygons import FlatPolygon
from regionik.planners.solvers.base_placement import FIXED, Turning
from regionik.planners.solvers.fabrik import limit_vectors
from regionik.planners.solvers.mfabrik_planar import least_change, solve_planar
from regionik.planners.solvers.planar_kinematics import PlanarLinkage, self_motion
from regionik.planners.solvers.planar_setup import PlanarSetup, Record, record_of
from regionik.planners.solvers.posture_criteria import (
    COMFORT,
    Thresholds,
    posture_margin,
    posture_within_thresholds,
)
from regionik.postures.arm import ANGLE_SLACK, MOST_PASSES, Reached, deviation
from regionik.postures.families import Family, families_of, roll_for, roll_within_limits, tool_turn
from regionik.worlds.arms import PlanarArm
from regionik.worlds.arrays import Array
from regionik.worlds.chain import within_half_turns
from regionik.worlds.scene import Target


@dataclass(frozen=True, eq=False)
class PlanarSolver:
    """Solver of an arm in one vertical plane, for one family of postures."""

    arm: PlanarArm
    plane: PlanarLinkage  # the arm for kernels, heights counted from the floor
    family: Family
    tolerance: float  # [m]
    asked: Thresholds | None = None  # of manipulability and effort, which postures must meet

    def setup(self, mount: Array, turning: Turning) -> Record:
        """Return the arm on a base as kernels take it, without the thresholds.

        The mount (4,) is the arm's base in the base frame: x, y, z [m], yaw [rad].
        """
        arm, plane, family = self.arm, self.plane, self.family
        zero = float(arm.pivot_zero + mount[3])
        lower, upper = within_half_turns(arm.lower, arm.upper)
        return record_of(
            PlanarSetup(
                np.array([plane.shoulder_r, plane.shoulder_z]), plane.lengths, plane.lower, plane.upper,
                limit_vectors(plane.lower, plane.upper), arm.sign, arm.offset,
                lower + _RESTARTS * (upper - lower), mount[:2], zero, turning, family.facing,
                family.pitch, self.tolerance, MOST_PASSES,
            )
        )  # fmt: skip

    @cached_property
    def _alone(self) -> Record:
        """The arm on its own base frame, which keeps its heading: the pivot is endless."""
        return self.setup(np.zeros(4), Turning(-np.inf, np.inf, FIXED, -np.inf, np.inf))

    def _at_pitch(self, pitch: float) -> Record:
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
            error, passes, _ = solve_planar(setup, area.vertices, area.starts, mobile, position, base, q)
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
        """Shortcomings of a posture, the gravest first."""
        return not found.meets, found.angle > ANGLE_SLACK, found.error

    def _meeting(self, kind: Family, target: Target, found: Reached, yaw: float, joints: Array) -> Reached:
        """The posture where it meets the thresholds, else the nearest from the same place that does."""
        if self.asked is None or self._meets(found, COMFORT):
            return found
        r, plane_yaw = self._seen(target.position, found.axis)
        near, bends, z = self.arm.bends(joints), np.empty(3), float(target.position[2])
        if not posture_within_thresholds(self.plane, self.asked, kind.pitch, r, z, near, bends):
            return replace(found, meets=False)
        q, angle = self._turned(target, bends, plane_yaw, yaw, joints)
        return replace(found, joints=q, error=0.0, angle=angle)

    def _meets(self, found: Reached, room: float) -> bool:
        if self.asked is None:
            return True
        return bool(posture_margin(self.plane, self.asked, self.arm.bends(found.joints)) > room)

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
                q[arm.roll] = roll_within_limits(arm, wanted, float(near[arm.roll]))
            roll = float(q[arm.roll])
        off = deviation(target, tool_turn(arm, plane_yaw, pitch, roll))
        return max(0.0, off - target.cone)

    def _seen(self, target: Array, axis: Array) -> tuple[float, float]:
        """Target in the plane, and the plane's direction."""
        facing = self.family.facing
        dx, dy = facing * (target[:2] - axis)
        return facing * float(np.hypot(dx, dy)), float(np.arctan2(dy, dx))


def _swung(kind: Family, target: Array, axis: Array) -> Array:
    """The axis led round a target until the plane points as the family allows."""
    dx, dy = kind.facing * (target[:2] - axis)
    azimuth, away = float(np.arctan2(dy, dx)), kind.facing * float(np.hypot(dx, dy))
    swing = float(wrap(azimuth - kind.azimuth))
    if abs(swing) <= kind.half:
        return axis
    azimuth = kind.azimuth + float(np.clip(swing, -kind.half, kind.half))
    return target[:2] - away * np.array([np.cos(azimuth), np.sin(azimuth)])


# Postures to restart from, as shares of the limits: elbow up and down, folded, stretched.
_RESTARTS = np.array(
    [
        (0.5, 0.5, 0.5), (0.3, 0.2, 0.5), (0.7, 0.8, 0.5), (0.3, 0.7, 0.3), (0.6, 0.2, 0.8),
        (0.8, 0.3, 0.2), (0.1, 0.5, 0.5), (0.5, 0.1, 0.1), (0.5, 0.9, 0.9), (0.9, 0.5, 0.7),
    ]
)  # fmt: skip
