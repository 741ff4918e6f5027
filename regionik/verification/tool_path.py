"""Proof that the tool meets its set-points and stays on the path between them, in position and direction.

Positions: points within a distance of a line segment are a convex set, so a chord of the tool's motion stays
in it when its ends do; the tool itself stays within the chord deviation of the chord. Directions are points
of the unit sphere, and orientations, as unit quaternions, points of the sphere in four dimensions, on which
two lie half as far apart as the angle between them; the points within a cone narrower than a right angle
about an axis form a convex cone, of which the same holds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from regionik.values import Motion, Violation
from regionik.verification.motion import Indices, Mask, MotionSegments, chord_deviation
from regionik.verification.options import VERIFICATION
from regionik.verification.proofs import Finding, Intervals, IntervalVerdicts, StateNames, bisect, finding
from regionik.verification.tolerances import BETWEEN, EXACT
from regionik.worlds.arrays import Array
from regionik.worlds.scene import Target, World

OPTIONS = VERIFICATION.proofs


def verify_setpoints(world: World, segments: MotionSegments, names: StateNames) -> Finding:
    """The tool is within ``tolerance`` of every set-point, and within the cone of its direction."""
    allowed, motion = world.rules.tolerance, segments.motion
    violations: list[Violation] = []
    margins = [np.inf]
    states = np.flatnonzero((motion.kind == "setpoint") & (motion.setpoint >= 0))
    tools = segments.robot.tool(motion.base[states], motion.joints[states])
    for k, tool in zip(states.tolist(), tools, strict=True):
        i = int(motion.setpoint[k])
        target = world.task[i]
        off = float(np.linalg.norm(tool[:3, 3] - target.position))
        margins.append(allowed - off)
        if off > allowed + EXACT:
            text = f"the tool is {off:.4f} m off {names.setpoint(i)}; the rules allow {allowed:g} m"
            violations.append(Violation("setpoint", k, i, off - allowed, text))
        for what, angle in tool_deviations(target, tool[:3, :3]):
            if angle > target.cone + EXACT:
                text = f"the tool's {what} is {angle:.4f} rad off at {names.setpoint(i)}; "
                text += f"its cone allows {target.cone:g} rad"
                violations.append(Violation("setpoint", k, i, angle - target.cone, text))
    return finding("setpoint", min(margins), violations)


def tool_deviations(target: Target, R: Array) -> list[tuple[str, float]]:
    """Angles between a tool frame (3, 3) and what a target asks of it, by name [rad]."""
    found = []
    if target.direction is not None:
        found.append(("axis", float(angle_between(R[:, 2], target.direction))))
    if target.orientation is not None:
        D = target.orientation @ R.T
        twist = D[2, 1] - D[1, 2], D[0, 2] - D[2, 0], D[1, 0] - D[0, 1]  # 2 sin(angle) along the axis
        found.append(("orientation", float(np.arctan2(np.linalg.norm(twist), np.trace(D) - 1.0))))
    return found


def _bound_to_path(setpoints: int, motion: Motion) -> tuple[Indices, Indices]:
    """Segments on which the tool must be on the path, all but transits, and the set-points at its ends.

    Those are given from each state on, (states, 2). Before the first set-point and past the last the tool
    holds that one.
    """
    n, last = len(motion), setpoints - 1
    is_setpoint = motion.kind == "setpoint"
    previous = np.maximum.accumulate(np.where(is_setpoint, np.arange(n), -1))
    i = np.where(previous >= 0, motion.setpoint[previous], -1)
    ends = np.column_stack([np.maximum(i, 0), np.minimum(i + 1, last)])
    on_path = motion.kind != "transit"
    bound = np.flatnonzero(on_path[:-1] & on_path[1:])
    # A segment between set-points that are not neighbours is reported as out of order: no path to measure by.
    arrives = np.where(is_setpoint[bound + 1], motion.setpoint[bound + 1], ends[bound, 1])
    in_order = (arrives == ends[bound, 1]) & (i[bound] >= np.where(is_setpoint[bound], 0, -1))
    return bound[in_order], ends


def verify_path(world: World, segments: MotionSegments, names: StateNames) -> Finding:
    """The tool is within ``path_tolerance`` of the line between two set-points wherever it is not lifted."""
    limit = world.rules.planned_path_tolerance
    positions = np.array([target.position for target in world.task])
    bound, ends = _bound_to_path(len(world.task), segments.motion)

    def deviation(points: Array, state: Indices) -> Array:
        return _distance_to_line_segment(points, *(positions[side] for side in ends[state].T))

    steps = np.flatnonzero(segments.motion.kind == "step")
    tools = segments.robot.tool(segments.motion.base, segments.motion.joints)[:, :3, 3]
    off = deviation(tools[steps], steps)
    violations = [
        _off_path(names, int(k), names.state(int(k)), float(o), limit)
        for k, o in zip(steps, off, strict=True)
        if o > limit + BETWEEN
    ]
    bad = [v.state for v in violations if v.state is not None]
    segment = bound[~np.isin(bound, bad) & ~np.isin(bound + 1, bad)]

    def examine(intervals: Intervals) -> IntervalVerdicts:
        k = segment[intervals.item]
        low, middle, high = (
            segments.frames_at(k, s)[:, -1, :3, 3] for s in (intervals.low, intervals.middle, intervals.high)
        )
        bulge = chord_deviation(segments.tool_acceleration_bound[k], intervals.length)
        worst = np.maximum(deviation(low, k), deviation(high, k))
        moved = np.maximum(np.linalg.norm(low - middle, axis=-1), np.linalg.norm(high - middle, axis=-1))
        return IntervalVerdicts(
            worst + bulge <= limit + BETWEEN,
            np.maximum(worst, deviation(middle, k)) > limit + BETWEEN,
            moved + 100 * bulge < OPTIONS.min_motion,
        )

    for item, s in bisect(len(segment), examine).items():
        k, thrice = int(segment[item]), np.repeat(segment[item], 3)
        points = segments.frames_at(thrice, np.array([0.0, s, 1.0]))[:, -1, :3, 3]
        found = float(deviation(points, thrice).max())
        violations.append(_off_path(names, k, names.segment(k), found, limit))
    halfway = segments.frames_at(bound, np.full(len(bound), 0.5))[:, -1, :3, 3]
    seen = np.concatenate([off, deviation(halfway, bound)])
    return finding("path", limit - float(seen.max()) if len(seen) else np.inf, violations)


def _off_path(names: StateNames, state: int, where: str, off: float, limit: float) -> Violation:
    if off > limit:
        text = f"the tool is {off:.4f} m off the path {where} and not lifted; the rules allow {limit:g} m"
    else:
        proof = f"the tool is not proven to stay on the path {where}"
        text = f"{proof}: {off:.6f} m off, the rules allow {limit:g} m"
    return Violation("path", state, names.owner(state), max(0.0, off - limit), text)


def _distance_to_line_segment(points: Array, start: Array, end: Array) -> Array:
    along = end - start
    square = np.maximum((along**2).sum(-1), 1e-300)
    t = np.clip(((points - start) * along).sum(-1) / square, 0.0, 1.0)
    return np.linalg.norm(points - start - t[:, None] * along, axis=-1)


def verify_direction(world: World, segments: MotionSegments, names: StateNames) -> Finding:
    """The tool's axis stays within the cone along the path where both set-points ask for a direction.

    Between two directions it may turn along the arc from one to the other; the wider cone counts. Where both
    ask for an orientation, `verify_orientation` checks the whole frame instead.
    """
    axes = [target.direction for target in world.task]
    bound, ends = _bound_to_path(len(world.task), segments.motion)
    framed = _both_given([target.orientation for target in world.task], ends[bound])
    asked = bound[_both_given(axes, ends[bound]) & ~framed]
    if not len(asked):
        return finding("direction", np.inf, [])

    def axis_at(segment: Indices, s: Array) -> Array:
        return segments.frames_at(segment, s)[:, -1, :3, 2]

    start, end, cone = _arcs(world, ends[asked], axes)
    acceleration = segments.tool_axis_acceleration_bound[asked]
    motion = _SphereMotion(axis_at, lambda axes, _: axes, asked, start, end, cone, acceleration)
    return _within_cones(motion, names, "direction", "axis", 1.0)


def verify_orientation(world: World, segments: MotionSegments, names: StateNames) -> Finding:
    """The tool frame stays within the cone along the path where both set-points ask for an orientation.

    Between two orientations it may turn at constant rate the shorter way; the wider cone counts.
    """
    wanted = [target.orientation for target in world.task]
    bound, ends = _bound_to_path(len(world.task), segments.motion)
    asked = bound[_both_given(wanted, ends[bound])]
    if not len(asked):
        return finding("orientation", np.inf, [])
    quaternions = [None if R is None else _quaternions(R) for R in wanted]

    def quaternion_at(segment: Indices, s: Array) -> Array:
        return _quaternions(segments.frames_at(segment, s)[:, -1, :3, :3])

    start, end, cone = _arcs(world, ends[asked], quaternions)
    # q'' = (w' + w w / 2) q / 2, where |w'| is at most half the square of the bound of the turning rate |w|.
    acceleration = segments.tool_axis_acceleration_bound[asked] / 2
    end = _same_sign(end, start)
    motion = _SphereMotion(quaternion_at, _same_sign, asked, start, end, cone / 2, acceleration)
    return _within_cones(motion, names, "orientation", "frame", 2.0)


def _both_given(values: Sequence[Array | None], ends: Indices) -> Mask:
    """Segments both of whose set-points ask for something."""
    given = np.array([value is not None for value in values], dtype=np.bool_)
    return given[ends[:, 0]] & given[ends[:, 1]]


def _arcs(world: World, ends: Indices, points: Sequence[Array | None]) -> tuple[Array, Array, Array]:
    """Both ends of arcs between set-points, (n, d) each, and their cones (n,) [rad]."""
    start, end = (np.array([points[i] for i in side], dtype=np.float64) for side in ends.T)
    cone = np.array([target.cone for target in world.task])[ends].max(1)
    return start, end, cone


def _within_cones(motion: _SphereMotion, names: StateNames, kind: str, what: str, scale: float) -> Finding:
    """Finding of a motion on a sphere; ``scale`` turns angles on the sphere into those of the tool."""
    rows = np.arange(len(motion.segment))
    off = np.stack([motion.deviation(rows, np.full(len(rows), s)) for s in (0.0, 1.0, 0.5)])
    bad = off[:2] > motion.cone + BETWEEN / scale
    states: dict[int, tuple[float, float]] = {}
    for side, item in np.argwhere(bad).tolist():
        found = float(off[side, item]), float(motion.cone[item])
        state = int(motion.segment[item]) + side
        states[state] = max(states.get(state, found), found)

    def violation(state: int, where: str, angle: float, cone: float) -> Violation:
        how = f"is not proven to stay, {scale * angle:.6f} rad off,"
        if angle > cone:
            how = f"is {scale * angle:.4f} rad off"
        text = f"the tool's {what} {how} {where}; the cone allows {scale * cone:g} rad"
        return Violation(kind, state, names.owner(state), max(0.0, scale * (angle - cone)), text)

    violations = [violation(k, names.state(k), *found) for k, found in states.items()]
    good = np.flatnonzero(~(bad[0] | bad[1]))

    def examine(intervals: Intervals) -> IntervalVerdicts:
        return motion.examine(intervals._replace(item=good[intervals.item]), BETWEEN / scale, np.pi / scale)

    for n, s in bisect(len(good), examine).items():
        one = good[n : n + 1]
        k, angle = int(motion.segment[one[0]]), float(motion.deviation(one, np.array([s]))[0])
        violations.append(violation(k, names.segment(k), angle, float(motion.cone[one[0]])))
    return finding(kind, scale * float((motion.cone - off).min()), violations)


@dataclass(frozen=True, eq=False)
class _SphereMotion:
    """Motion of a point on a unit sphere, and the cone about the arc that it must stay in."""

    at_segment: Callable[[Indices, Array], Array]  # points (m, d) at shares of segments
    nearest_sign: Callable[[Array, Array], Array]  # of points that mean the same, those nearest to others
    segment: Indices  # (n,)
    start: Array  # (n, d) of the arc
    end: Array  # (n, d) of the arc
    cone: Array  # (n,) [rad]
    acceleration: Array  # (n,) upper bound for the point's acceleration [1 per segment^2]

    def at(self, item: Indices, s: Array) -> Array:
        return self.nearest_sign(self.at_segment(self.segment[item], s), self.start[item] + self.end[item])

    def deviation(self, item: Indices, s: Array) -> Array:
        """Angle between the point and the arc [rad]."""
        point = self.at(item, s)
        return angle_between(point, _nearest_on_arc(point, self.start[item], self.end[item]))

    def examine(self, intervals: Intervals, slack: float, widest: float) -> IntervalVerdicts:
        item, cone = intervals.item, self.cone[intervals.item]
        middle = self.at(item, intervals.middle)
        # Where the deviation is below 1 the interval is too short for the point to come near its opposite.
        low, high = (
            self.nearest_sign(self.at_segment(self.segment[item], s), middle)
            for s in (intervals.low, intervals.high)
        )
        chord = chord_deviation(self.acceleration[item], intervals.length)
        bulge = np.arcsin(np.minimum(chord, 1.0))
        core = _nearest_on_arc(middle, self.start[item], self.end[item])
        ends = np.maximum(angle_between(low, core), angle_between(high, core))
        centre = angle_between(middle, core)
        moved = np.maximum(angle_between(low, middle), angle_between(high, middle))
        by_ends = np.where(ends < np.pi / 2, ends, np.inf)  # narrow cones are convex
        by_middle = np.where(moved < np.pi / 2, centre + moved, np.inf)
        proven = (chord < 1) & (np.minimum(by_ends, by_middle) + bulge <= cone + slack)
        return IntervalVerdicts(
            proven | (cone >= widest), centre > cone + slack, moved + 100 * chord < OPTIONS.min_motion
        )


def angle_between(u: Array, v: Array) -> Array:
    """Angle between unit vectors, accurate near 0."""
    return 2 * np.arctan2(np.linalg.norm(u - v, axis=-1), np.linalg.norm(u + v, axis=-1))


def _nearest_on_arc(u: Array, a: Array, b: Array) -> Array:
    """Nearest points to u on the shorter arcs from a to b, (m, d) each."""
    rest = b - a * (a * b).sum(-1, keepdims=True)
    size = np.linalg.norm(rest, axis=-1, keepdims=True)
    side = rest / np.maximum(size, 1e-300)
    x, y = (u * a).sum(-1), (u * side).sum(-1)
    angle = np.arctan2(y, x)
    between = (angle >= 0) & (angle <= np.arctan2(size[:, 0], (a * b).sum(-1)))
    usable = between & (size[:, 0] > 1e-9) & (np.hypot(x, y) > 1e-9)
    inner = np.cos(angle)[:, None] * a + np.sin(angle)[:, None] * side
    end = np.where((angle_between(u, a) <= angle_between(u, b))[:, None], a, b)
    return np.where(usable[:, None], inner, end)


def _same_sign(quaternions: Array, others: Array) -> Array:
    """Quaternions on the side of others: opposite ones are the same frame."""
    return np.where((quaternions * others).sum(-1, keepdims=True) < 0, -quaternions, quaternions)


def _quaternions(R: Array) -> Array:
    """Unit quaternions (..., 4) of rotation matrices (..., 3, 3), the real part first.

    All rows of the matrix K = 4 q q^T are multiples of q; the longest is the most accurate.
    """
    K = np.empty((*R.shape[:-2], 4, 4))
    trace = np.trace(R, axis1=-2, axis2=-1)
    K[..., 0, 0] = 1 + trace
    for i, (j, k) in enumerate(((1, 2), (2, 0), (0, 1))):
        K[..., 1 + i, 1 + i] = 1 + 2 * R[..., i, i] - trace
        K[..., 0, 1 + i] = K[..., 1 + i, 0] = R[..., k, j] - R[..., j, k]
        K[..., 1 + j, 1 + k] = K[..., 1 + k, 1 + j] = R[..., j, k] + R[..., k, j]
    longest = np.argmax(np.linalg.norm(K, axis=-1), axis=-1)
    row = np.take_along_axis(K, longest[..., None, None], axis=-2)[..., 0, :]
    return row / np.linalg.norm(row, axis=-1, keepdims=True)
