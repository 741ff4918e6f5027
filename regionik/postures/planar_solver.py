"""An arm that works in one vertical plane, solved there by M-FABRIK with its limits; see `Arm`."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from regionik.planners.geometry.angles import TWO_PI, wrap
from regionik.planners.geometry.cones import pitches_within
from regionik.planners.geometry.polygons import FlatPolygon
from regionik.planners.reach.rings import FREE
from regionik.planners.solvers.base_placement import FIXED, BaseArea, Turning, move_to_area
from regionik.planners.solvers.fabrik import Pair
from regionik.planners.solvers.mfabrik_planar import PlanarSetup, least_change, links_of, solve_planar
from regionik.planners.solvers.planar_kinematics import (
    MAX_TILT,
    PlanarLinkage,
    critical_posture,
    fitted_bends,
    nearest_of,
    self_motion,
)
from regionik.planners.solvers.posture_criteria import (
    COMFORT,
    Thresholds,
    posture_margin,
    posture_within_thresholds,
)
from regionik.postures.arm import ANGLE_SLACK, CONE_SHARE, UNTOLD, ArmSolution, deviation
from regionik.postures.families import (
    Family,
    families_of,
    roll_for,
    roll_within_limits,
    tool_turn,
    within_cone,
)
from regionik.postures.options import POSTURES
from regionik.worlds.arms import PlanarArm
from regionik.worlds.arrays import Array
from regionik.worlds.chain import JOINT_SPARE, SPARE_SHARE, within_half_turns
from regionik.worlds.scene import Target

OPTIONS = POSTURES.solver


@dataclass(frozen=True, eq=False)
class PlanarSolver:
    """Solver of an arm in one vertical plane, for one family of postures."""

    arm: PlanarArm
    plane: PlanarLinkage  # the arm for kernels, heights counted from the floor
    family: Family
    tolerance: float  # [m]
    thresholds: Thresholds | None = None  # of manipulability and effort, which postures must meet

    @property
    def _restarts(self) -> Array:
        """Ten postures to restart from, spread over the limits: elbow up and down, folded, stretched."""
        lower, upper = within_half_turns(self.arm.lower, self.arm.upper)
        return lower + _SPREAD * (upper - lower)

    def setup(self, mount: Array, turning: Turning) -> PlanarSetup:
        """Return the arm on a base as kernels take it, without the thresholds.

        The mount (4,) is the arm's base in the base frame: x, y, z [m], yaw [rad].
        """
        arm, family = self.arm, self.family
        zero = float(arm.pivot_zero + mount[3])
        return PlanarSetup(
            self.plane, links_of(self.plane), arm.sign, arm.offset, self._restarts, mount[:2], zero, turning,
            family.facing, family.pitch, self.tolerance, OPTIONS.max_passes,
        )  # fmt: skip

    @cached_property
    def _alone(self) -> PlanarSetup:
        """The arm on its own base frame, which keeps its heading: the pivot is endless."""
        return self.setup(np.zeros(4), Turning(-np.inf, np.inf, FIXED, -np.inf, np.inf))

    def reach(
        self,
        target: Target,
        axis: Array,
        yaw: float,
        joints: Array,
        area: FlatPolygon,
        mobile: bool,
        history: Array = UNTOLD,
    ) -> ArmSolution:
        """Bring the tool to a target; see `Arm`. Of the kinds of posture the first that meets it."""
        if not mobile and target.direction is not None and not self._holds_direction(target, axis):
            leaning = self._leaning(target, axis, yaw, joints)
            if leaning is not None:
                return leaning
        best: ArmSolution | None = None
        for kind in self._kinds(target):
            base, q = np.array([*axis, yaw]), np.array(joints)
            if mobile and target.direction is not None and len(area.starts) <= 1:
                base[:2] = _swung(kind, target.position, axis)
            setup, position = self._alone._replace(pitch=kind.pitch), np.array(target.position)
            places = BaseArea(area.vertices, area.starts, mobile)
            error, passes, _ = solve_planar(setup, places, position, base, q, history)
            angle = self._rolled(target, yaw, q, joints)
            found = self._meeting(kind, target, ArmSolution(base[:2], q, error, passes, angle), yaw, joints)
            if self._worth(found) <= (False, False, self.tolerance):
                return found
            if best is None or self._worth(found) < self._worth(best):
                best = found
        assert best is not None
        spots = self._places(target, axis, area, mobile) if target.direction is not None else iter(())
        others = (self._leaning(target, spot, yaw, joints) for spot in spots)
        return next((one for one in others if one is not None), best)

    def _holds_direction(self, target: Target, axis: Array) -> bool:
        """True if some posture from a place points the tool exactly as asked, not only within its cone."""
        (r, _), z = self._seen(target.position, axis), float(target.position[2])
        pitches, bends = np.array([kind.pitch for kind in self._kinds(target)]), np.zeros(3)
        return bool(np.isfinite(nearest_of(self.plane, pitches, r, z, np.zeros(3), bends)))

    def _places(self, target: Target, axis: Array, area: FlatPolygon, mobile: bool) -> Iterator[Array]:
        """Places to lean from: the nearest of the area, on a free floor those on a line to the target."""
        if not mobile:
            yield axis
        elif len(area.starts) > 1:
            x, y = move_to_area(BaseArea(area.vertices, area.starts, mobile), float(axis[0]), float(axis[1]))
            yield np.array([x, y])
        else:
            far = float(self.plane.lengths.sum()) + abs(self.plane.shoulder_r)
            for kind in self._kinds(target):
                start = _swung(kind, target.position, axis)
                yield start
                ahead = start - target.position[:2]
                ahead /= max(float(np.hypot(*ahead)), 1e-12)
                yield from target.position[:2] + np.outer(
                    (np.arange(OPTIONS.distance_samples) + 0.5) / OPTIONS.distance_samples * far, ahead
                )

    def _leaning(self, target: Target, axis: Array, yaw: float, joints: Array) -> ArmSolution | None:
        """A posture on target from a place that has the tool within its cone, near to the one given.

        Half of the cone is left for the way between two states where that can be.
        """
        r, plane_yaw = self._seen(target.position, axis)
        for cone in (CONE_SHARE * target.cone, within_cone(target.cone), target.cone):
            pitches = self._pitches(target, cone, plane_yaw)
            if pitches is None:
                continue
            ranges = [pitches]
            if target.orientation is not None:  # not every pitch suits the roll
                ranges += [(tool, tool) for tool in np.linspace(*pitches, OPTIONS.pitch_samples).tolist()]
            for some in ranges:
                bends = self._bends_within(some, r, float(target.position[2]), self.arm.bends(joints))
                if bends is not None:
                    q, angle = self._turned(target, bends, plane_yaw, yaw, joints)
                    if angle <= ANGLE_SLACK:
                        return ArmSolution(axis, q, 0.0, 0, angle)
        return None

    @staticmethod
    def _pitches(target: Target, cone: float, plane_yaw: float) -> tuple[float, float] | None:
        """Lowest and highest pitch that points within a cone, with the plane in a direction [rad]."""
        assert target.direction is not None
        x, y, z = target.direction.tolist()
        found = pitches_within(math.atan2(z, math.hypot(x, y)), cone, plane_yaw - math.atan2(y, x))
        return None if found is None else (found[0] - found[1], found[0] + found[1])

    @cached_property
    def _off_limits(self) -> PlanarLinkage:
        """The arm with bends that keep off their limits."""
        lower, upper = self.plane.lower, self.plane.upper
        spare = np.minimum(JOINT_SPARE, SPARE_SHARE * (upper - lower))
        return self.plane._replace(lower=lower + spare, upper=upper - spare)

    def _bends_within(self, pitches: Pair, r: float, z: float, near: Array) -> Array | None:
        """Bends (3,) near to given ones that put the tool at (r, z), its link at a pitch of a range."""
        bends, (low, high) = np.empty(3), pitches
        if self.thresholds is not None:
            found = posture_within_thresholds(self.plane, self.thresholds, pitches, r, z, near, bends)
            return bends if found else None
        middle = (low + high) / 2
        present = middle + float(wrap(float(near.sum()) - middle))
        about = np.clip(present + MAX_TILT * np.linspace(-1.0, 1.0, OPTIONS.pitch_samples), low, high)
        tools = np.concatenate([about, np.linspace(low, high, OPTIONS.pitch_samples)])
        for plane in (self._off_limits, self.plane):
            if np.isfinite(nearest_of(plane, tools, r, z, near, bends)):
                return bends
        found, a, b, c = critical_posture(self.plane, low, high, r, z)  # it hides between two pitches
        return np.array(fitted_bends(self.plane, a, b, c)) if found else None

    @staticmethod
    def _worth(solution: ArmSolution) -> tuple[bool, bool, float]:
        """Return the shortcomings of a posture, the gravest first."""
        return not solution.meets, solution.angle > ANGLE_SLACK, solution.error

    def _meeting(
        self, kind: Family, target: Target, solution: ArmSolution, yaw: float, joints: Array
    ) -> ArmSolution:
        """Return the posture if it meets the thresholds, else the nearest from the same place that does."""
        if self.thresholds is None or self._meets(solution, COMFORT):
            return solution
        r, plane_yaw = self._seen(target.position, solution.axis)
        near, bends, z = self.arm.bends(joints), np.empty(3), float(target.position[2])
        pitches = (kind.pitch, kind.pitch) if np.isfinite(kind.pitch) else FREE
        if not posture_within_thresholds(self.plane, self.thresholds, pitches, r, z, near, bends):
            return replace(solution, meets=False)
        q, angle = self._turned(target, bends, plane_yaw, yaw, joints)
        return replace(solution, joints=q, error=0.0, angle=angle)

    def _meets(self, solution: ArmSolution, room: float) -> bool:
        if self.thresholds is None:
            return True
        return bool(posture_margin(self.plane, self.thresholds, self.arm.bends(solution.joints)) > room)

    def least_change(self, target: Target, axis: Array, yaw: float, joints: Array) -> ArmSolution | None:
        """The posture on target whose bends change least; see `Arm`."""
        best, least = None, np.inf
        for kind in self._kinds(target):
            base, q = np.array([*axis, yaw]), np.array(joints)
            setup = self._alone._replace(pitch=kind.pitch)
            change, _ = least_change(setup, np.array(target.position), base, q)
            angle = self._rolled(target, yaw, q, joints)
            if change < least and angle <= ANGLE_SLACK:
                best, least = ArmSolution(axis, q, 0.0, 0, angle), change
        if best is None and target.direction is not None:
            best = self._leaning(target, axis, yaw, joints)
        return best if best is None or self._meets(best, 0.0) else None

    def self_motion(
        self, target: Target, axis: Array, yaw: float, joints: Array, tries: int
    ) -> list[ArmSolution]:
        """Postures on target at ``tries`` pitches, the elbow either way; see `Arm`."""
        r, plane_yaw = self._seen(target.position, axis)
        tools = self._tools(target, plane_yaw, tries)
        bends = np.empty((2 * len(tools), 3))
        count = self_motion(self.plane, tools, r, float(target.position[2]), bends)
        found: list[ArmSolution] = []
        for one in bends[:count]:
            q, angle = self._turned(target, one, plane_yaw, yaw, joints)
            found.append(ArmSolution(axis, q, 0.0, 0, angle))
        return [one for one in found if self._meets(one, 0.0)]

    def _tools(self, target: Target, plane_yaw: float, tries: int) -> Array:
        """Pitches of the last link, ``tries`` to the full turn: as asked, and all over the cone [rad]."""
        pitches = np.array([kind.pitch for kind in self._kinds(target)])
        if target.direction is None:
            return TWO_PI * np.arange(tries) / tries if np.isnan(pitches).any() else pitches
        ends = self._pitches(target, within_cone(target.cone), plane_yaw)
        if ends is None:
            return pitches
        count = math.ceil(tries * (ends[1] - ends[0]) / TWO_PI)
        return np.append(pitches, ends[0] + (ends[1] - ends[0]) * (np.arange(count) + 0.5) / count)

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
    """Return the axis moved round a target until the plane points as the family allows."""
    dx, dy = kind.facing * (target[:2] - axis)
    azimuth, away = float(np.arctan2(dy, dx)), kind.facing * float(np.hypot(dx, dy))
    widest = kind.bands[0]
    swing = float(wrap(azimuth - widest.azimuth))
    if abs(swing) <= widest.half:
        return axis
    azimuth = widest.azimuth + float(np.clip(swing, -widest.half, widest.half))
    return target[:2] - away * np.array([np.cos(azimuth), np.sin(azimuth)])


_SPREAD = np.array(
    [
        (0.5, 0.5, 0.5), (0.3, 0.2, 0.5), (0.7, 0.8, 0.5), (0.3, 0.7, 0.3), (0.6, 0.2, 0.8),
        (0.8, 0.3, 0.2), (0.1, 0.5, 0.5), (0.5, 0.1, 0.1), (0.5, 0.9, 0.9), (0.9, 0.5, 0.7),
    ]
)  # fmt: skip
