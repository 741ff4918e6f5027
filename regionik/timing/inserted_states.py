"""States inserted in a motion: where its smooth path must keep to it, or its path acceleration changes."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from regionik.planners.geometry.rolling import without_slip
from regionik.timing.limits import MotionLimits
from regionik.timing.options import TIMING
from regionik.timing.parametrization import fastest_rates, fastest_times, path_of
from regionik.values import Motion
from regionik.worlds.arrays import Array, Index, Mask
from regionik.worlds.errors import InputError

OPTIONS = TIMING.insertion


def refined(limits: MotionLimits, motion: Motion) -> Motion:
    """Motion with states inserted on its smooth path where the path acceleration changes.

    A fine timing shows where: between two states that are kept its acceleration is nearly constant.
    """
    path = path_of(limits.robot, motion)
    alone = np.zeros(len(motion) - 1, dtype=np.int64)  # from rest to rest takes two segments
    alone[[a for a, b in path.runs if b == a + 1]] = 1
    motion = _subdivided(limits, motion, *evenly(alone))
    span = np.diff(fastest_times(limits, motion, tightenings=0))
    span[path_of(limits.robot, motion).lengths == 0] = 0.0  # a rest has a state at each end
    segment, share = graded(periods(span, OPTIONS.period), path_of(limits.robot, motion).rests)
    count, fine = np.bincount(segment, minlength=len(span)), _subdivided(limits, motion, segment, share)
    position, rate = fastest_rates(limits, fine, tightenings=0)
    first = np.concatenate([[0], np.cumsum(count + 1)])  # where the motion's own states are
    spans = [np.arange(a, b + 1) for a, b in pairwise(first.tolist())]
    kept = np.unique(np.concatenate([span[_knots(position[span], rate[span] ** 2)] for span in spans]))
    base = without_slip(limits.robot.drive, fine.base[kept], ~np.isin(kept, first))
    return Motion(base, fine.joints[kept], fine.kind[kept], fine.setpoint[kept], fine.time[kept])


def _knots(x: Array, y: Array) -> list[int]:
    """Points (n,) that a polyline through them must keep to be near all, both ends among them.

    The points are halved at the farthest one from the chord (Douglas and Peucker, 1973).
    """
    line = y[0] + (y[-1] - y[0]) * (x - x[0]) / max(x[-1] - x[0], np.finfo(float).tiny)
    off = np.abs(y - line) / np.maximum(y, line.max() * 1e-2 + np.finfo(float).tiny)
    k = int(np.argmax(off))
    if off[k] <= OPTIONS.max_velocity_error or not 0 < k < len(x) - 1:
        return [0, len(x) - 1]
    return [*_knots(x[: k + 1], y[: k + 1]), *(k + j for j in _knots(x[k:], y[k:])[1:])]


def blended(limits: MotionLimits, motion: Motion) -> Motion:
    """Motion with states inserted halfway until the smooth path keeps to the segments of this one.

    They are on the smooth path where that is near enough, else as near to it; those of wheels are on arcs.
    """
    found, way = motion, np.arange(len(motion), dtype=np.float64)  # of states along the segments
    for _ in range(OPTIONS.max_rounds):
        far = np.flatnonzero(_deviation(limits, motion, found, way) > limits.blend)
        if not len(far):
            return found
        middle = (way[far] + way[far + 1]) / 2
        q = _halfway(limits, found, far, _along(limits, motion, middle))
        found = with_states(found, far, q[:, :3], q[:, 3:])
        way = np.insert(way, far + 1, middle)
    raise InputError(
        f"blend: the smooth path does not come within {limits.blend:g} m of the plan's motion; ask for more"
    )


def strayed(limits: MotionLimits, motion: Motion) -> float:
    """Part of its segments that the smooth path through a motion's states leaves by more than the blend."""
    if len(motion) == 1:
        return 0.0
    off = _deviation(limits, motion, motion, np.arange(len(motion), dtype=np.float64))
    return float((off > limits.blend).mean())


def _along(limits: MotionLimits, motion: Motion, way: Array) -> Array:
    """Base and joints (m, 3 + dof) on the segments of a motion, at so many of them from its start (m,)."""
    path = path_of(limits.robot, motion)
    segment = np.clip(way.astype(np.int64), 0, len(motion) - 2)
    share = way - segment
    base = limits.robot.drive.between(path.base[segment], path.base[segment + 1], share)
    change = path.joints[segment + 1] - path.joints[segment]
    return np.column_stack([base, path.joints[segment] + share[:, None] * change])


def _halfway(limits: MotionLimits, motion: Motion, segment: Index, straight: Array) -> Array:
    """States (m, 3 + dof) halfway on segments: straight ones, drawn to the smooth path as far as may be."""
    if limits.robot.drive.rolls:
        return straight
    base, joints = path_of(limits.robot, motion).states_at(segment, np.full(len(segment), 0.5))
    smooth = np.column_stack([base, _within_range(limits, joints)])
    off = limits.displacement(straight, smooth)
    return straight + np.minimum(OPTIONS.drawn_share * limits.blend / off, 1.0)[:, None] * (smooth - straight)


def _within_range(limits: MotionLimits, joints: Array) -> Array:
    """Joints (m, dof) brought within their limits, which splines between states may pass."""
    return np.clip(joints, limits.robot.chain.lower, limits.robot.chain.upper)


def _deviation(limits: MotionLimits, motion: Motion, fine: Motion, way: Array) -> Array:
    """Upper bound for any point's distance on the smooth path from a motion's segments, (n - 1,) [m].

    That path is through the states of a finer motion, which are at ways (n,) along those segments. Infinite
    where joints pass their limits. Wheels slip only as much as headings are off, which the distance bounds.
    """
    off = np.zeros(len(fine) - 1)
    path, segment = path_of(limits.robot, fine), np.arange(len(off))
    for share in OPTIONS.compared_shares:
        q, _, _ = path.evaluate(path.position[:-1] + share * path.lengths, segment)
        straight = _along(limits, motion, way[:-1] + share * np.diff(way))
        off = np.maximum(off, limits.displacement(q, straight))
        past = np.abs(q[:, 3:] - _within_range(limits, q[:, 3:])).max(axis=1, initial=0.0)
        off[past > 1e-5] = np.inf
    return off


def with_rests(motion: Motion, states: Index) -> tuple[Motion, Index]:
    """Motion that gives some states twice, at which the robot then rests, and which state each of its is."""
    inner = states[states < len(motion) - 1]
    own = np.sort(np.append(np.arange(len(motion)), inner))
    return with_states(motion, inner, motion.base[inner], motion.joints[inner]), own


def _subdivided(limits: MotionLimits, motion: Motion, segment: Index, share: Array) -> Motion:
    """Motion with states inserted at shares of segments (m,), in their order, next to its smooth path."""
    base, joints = path_of(limits.robot, motion).states_at(segment, share)
    return with_rolled_states(limits, motion, segment, base, _within_range(limits, joints))


def periods(span: Array, period: float) -> Index:
    """Parts at most a period long of times (n,), at least one."""
    return np.maximum(np.ceil(span / period).astype(np.int64), 1)


def evenly(count: Index) -> tuple[Index, Array]:
    """Segments of so many states (n - 1,) evenly inserted in each, and their shares of these, (m,) each."""
    shares = [np.arange(1, n + 1) / (n + 1) for n in count.tolist()]
    return np.repeat(np.arange(len(count)), count), np.concatenate([np.empty(0), *shares])


def graded(parts: Index, ends: Mask, most: int | Index = OPTIONS.max_parts) -> tuple[Index, Array]:
    """Segments and shares of states inserted for so many even parts of each (n - 1,), but not for many more.

    Beyond ``most`` parts there are no more, but those at ``ends`` (n,) are halved again and again, and fewer
    are between: there velocities change. So a motion that takes long has no more states than others.
    """
    even = np.minimum(parts, most)
    halvings = np.ceil(np.log2(np.maximum(parts / even, 1.0)))
    halvings = np.clip(halvings, 0, OPTIONS.max_halvings).astype(np.int64)
    even = np.ceil(even * (1 - OPTIONS.fewer_share * halvings)).astype(np.int64)
    shares = [np.empty(0)]
    for count, first, last in zip(even.tolist(), halvings * ends[:-1], halvings * ends[1:], strict=True):
        near, far = (0.5 ** np.arange(times, 0, -1) / count for times in (first, last))
        shares.append(np.concatenate([near, np.arange(1, count) / count, 1 - far[::-1]]))
    segment = np.repeat(np.arange(len(parts)), [len(one) for one in shares[1:]])
    return segment, np.concatenate(shares)


def halved(segment: Index, share: Array, some: Mask) -> tuple[Index, Array]:
    """The same states with one more halfway between any two of them in some segments (n - 1,)."""
    at = np.concatenate([np.arange(len(some)), segment])
    start = np.concatenate([np.zeros(len(some)), share])
    order = np.lexsort([start, at])
    at, start = at[order], start[order]
    end = np.append(np.where(at[1:] == at[:-1], start[1:], 1.0), 1.0)
    segment = np.concatenate([segment, at[some[at]]])
    share = np.concatenate([share, ((start + end) / 2)[some[at]]])
    order = np.lexsort([share, segment])
    return segment[order], share[order]


def with_rolled_states(
    limits: MotionLimits, motion: Motion, segment: Index, base: Array, joints: Array
) -> Motion:
    """`with_states`, the inserted ones moved to where wheels roll from one to the next."""
    found = with_states(motion, segment, base, joints)
    inserted = np.insert(np.zeros(len(motion), dtype=bool), segment + 1, True)
    return replace(found, base=without_slip(limits.robot.drive, found.base, inserted))


def with_states(motion: Motion, segment: Index, base: Array, joints: Array) -> Motion:
    """Motion with states inserted in segments, in the order given, of the kind that the segment is."""
    from_setpoint = np.asarray(motion.kind[segment] == "setpoint")  # then the next state says the kind
    lead = np.where(from_setpoint, segment + 1, segment)
    between = from_setpoint & (motion.kind[lead] == "setpoint")
    kind = np.where(between, "step", motion.kind[lead])
    setpoint = np.where(between, motion.setpoint[segment], motion.setpoint[lead])
    return Motion(
        base=np.insert(motion.base, segment + 1, base, axis=0),
        joints=np.insert(motion.joints, segment + 1, joints, axis=0),
        kind=np.insert(motion.kind, segment + 1, kind),
        setpoint=np.insert(motion.setpoint, segment + 1, setpoint),
        time=np.full(len(motion) + len(segment), np.nan),
    )
