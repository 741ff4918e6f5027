"""Proof that the tool meets its set-points and stays on the path between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from regionik.findings import Finding, Words, finding
from regionik.journey import Indices, Journey, Parts, Verdicts, prove, sag
from regionik.plan import Violation
from regionik.worlds.arrays import Array
from regionik.worlds.scene import Target, World

EXACT = 1e-9  # at states [m] or [rad]
BETWEEN = 1e-6  # between states [m] or [rad]
SHORTEST = 1e-4  # motion of the tool over half a part below which its halves are not looked at [m] or [rad]


def setpoints(world: World, journey: Journey, words: Words) -> Finding:
    """Tool on every set-point, turned as it should be."""
    allowed = world.rules.tolerance
    violations: list[Violation] = []
    margins = [np.inf]
    states = np.flatnonzero(journey.motion.kind == "setpoint")
    tools = journey.robot.tool(journey.motion.base[states], journey.motion.joints[states])
    for k, tool in zip(states.tolist(), tools, strict=True):
        i = int(journey.motion.setpoint[k])
        if i < 0:
            continue
        target = world.task[i]
        off = float(np.linalg.norm(tool[:3, 3] - target.position))
        margins.append(allowed - off)
        if off > allowed + EXACT:
            text = f"the tool is {off:.4f} m off {words.setpoint(i)}; the rules allow {allowed:g} m"
            violations.append(Violation("setpoint", k, i, off - allowed, text))
        for what, angle in _deviations(target, tool[:3, :3]):
            if angle > target.cone + EXACT:
                text = (
                    f"the tool's {what} is {angle:.4f} rad off at {words.setpoint(i)}; "
                    f"its cone allows {target.cone:g} rad"
                )
                violations.append(Violation("setpoint", k, i, angle - target.cone, text))
    return finding("setpoint", min(margins), violations)


def _deviations(target: Target, R: Array) -> list[tuple[str, float]]:
    found = []
    if target.direction is not None:
        found.append(("axis", float(_angle(R[:, 2], target.direction))))
    if target.orientation is not None:
        between = target.orientation.T @ R
        twist = np.array(
            [between[2, 1] - between[1, 2], between[0, 2] - between[2, 0], between[1, 0] - between[0, 1]]
        )
        found.append(("orientation", float(np.arctan2(np.linalg.norm(twist), np.trace(between) - 1))))
    return found


@dataclass(frozen=True, eq=False)
class _OnPath:
    """States and hops on which the tool must be on the path, and the two set-points it is between."""

    state: Indices
    state_ends: Indices  # (n, 2) set-points
    hop: Indices
    hop_ends: Indices  # (m, 2)


def _on_path(world: World, journey: Journey) -> _OnPath:
    """What binds the tool: all but transits. Before the first set-point and past the last it holds one."""
    motion = journey.motion
    n, last = len(motion), len(world.task) - 1
    is_setpoint = motion.kind == "setpoint"
    behind = np.maximum.accumulate(np.where(is_setpoint, np.arange(n), -1))
    i = np.where(behind >= 0, motion.setpoint[behind], -1)
    ends = np.column_stack([np.maximum(i, 0), np.minimum(i + 1, last)])
    step = np.flatnonzero(motion.kind == "step")
    on = motion.kind != "transit"
    hop = np.flatnonzero(on[:-1] & on[1:])
    # A hop between set-points that are not neighbours is out of order already: nothing to measure it by.
    arrives = np.where(is_setpoint[hop + 1], motion.setpoint[hop + 1], ends[hop, 1])
    follows = (arrives == ends[hop, 1]) & (i[hop] >= np.where(is_setpoint[hop], 0, -1))
    return _OnPath(step, ends[step], hop[follows], ends[hop[follows]])


def path(world: World, journey: Journey, words: Words) -> Finding:
    """Tool within ``path_tolerance`` of the segment between two set-points, wherever it is not lifted."""
    limit = world.rules.path_tolerance
    spots = np.array([target.position for target in world.task])
    on = _on_path(world, journey)

    def stray(points: Array, ends: Indices) -> Array:
        return _from_segment(points, spots[ends[:, 0]], spots[ends[:, 1]])

    tools = journey.robot.tool(journey.motion.base, journey.motion.joints)[:, :3, 3]
    off = stray(tools[on.state], on.state_ends)
    violations = [
        _off_path(words, k, words.state(k), o, limit)
        for k, o in zip(on.state, off, strict=True)
        if o > limit + BETWEEN
    ]
    bad = {v.state for v in violations}
    clean = np.array([int(k) not in bad and int(k) + 1 not in bad for k in on.hop], dtype=bool)
    hop, ends = on.hop[clean], on.hop_ends[clean]

    def look(parts: Parts) -> Verdicts:
        h, e = hop[parts.item], ends[parts.item]
        low, middle, high = (
            journey.frames(h, s)[:, -1, :3, 3] for s in (parts.low, parts.middle, parts.high)
        )
        bulge = sag(journey.tool_acceleration[h], parts.high - parts.low)
        # Points near a segment are a convex set: a chord stays in it when its ends do.
        worst = np.maximum(stray(low, e), stray(high, e))
        moved = np.maximum(_length(low - middle), _length(high - middle))
        return Verdicts(
            worst + bulge <= limit + BETWEEN,
            np.maximum(worst, stray(middle, e)) > limit + BETWEEN,
            moved + 100 * bulge < SHORTEST,
        )

    outcome = prove(len(hop), look)
    for item, s in {**outcome.failed, **outcome.stuck}.items():
        k = hop[item : item + 1]
        point = journey.frames(k, np.array([s]))[:, -1, :3, 3]
        o = float(stray(point, ends[item : item + 1])[0])
        violations.append(_off_path(words, int(k[0]), words.hop(int(k[0])), o, limit))
    return finding("path", limit - off.max(initial=0.0) if len(on.hop) else np.inf, violations)


def _off_path(words: Words, state: int, where: str, off: float, limit: float) -> Violation:
    if off > limit:
        text = f"the tool is {off:.4f} m off the path {where} and not lifted; the rules allow {limit:g} m"
    else:
        proof = f"the tool is not proven to stay on the path {where}"
        text = f"{proof}: {off:.6f} m off, the rules allow {limit:g} m"
    return Violation("path", int(state), words.owner(int(state)), max(0.0, float(off - limit)), text)


def direction(world: World, journey: Journey, words: Words) -> Finding:
    """Tool axis within the cone along the path, where both set-points ask for a direction.

    Between two directions the axis may turn along the arc from one to the other.
    """
    has = np.array([target.direction is not None for target in world.task])
    axes = np.array([np.zeros(3) if target.direction is None else target.direction for target in world.task])
    cones = np.array([target.cone for target in world.task])
    on = _on_path(world, journey)
    asked = has[on.hop_ends].all(1)
    hop, ends = on.hop[asked], on.hop_ends[asked]
    cone = cones[ends].max(1)
    least = [np.inf]

    def look(parts: Parts) -> Verdicts:
        h, e, c = hop[parts.item], ends[parts.item], cone[parts.item]
        low, middle, high = (
            journey.frames(h, s)[:, -1, :3, 2] for s in (parts.low, parts.middle, parts.high)
        )
        swing = np.minimum(sag(journey.swing[h], parts.high - parts.low), 1.0)
        # Directions within a narrow cone round the arc's nearest direction are convex as points of a cone.
        core = _nearest_on_arc(middle, axes[e[:, 0]], axes[e[:, 1]])
        worst = np.maximum(_angle(low, core), _angle(high, core))
        centre = np.maximum.reduce([_off_arc(u, axes[e[:, 0]], axes[e[:, 1]]) for u in (low, middle, high)])
        least.append(float((c - centre).min(initial=np.inf)))
        bound = worst + np.arcsin(swing)
        moved = np.maximum(_angle(low, middle), _angle(high, middle))
        narrow = bound < np.pi / 2
        wide = (
            _angle(middle, core) + moved + np.arcsin(swing) <= c + BETWEEN
        )  # cones wider than a right angle
        return Verdicts(
            ((bound <= c + BETWEEN) & narrow) | wide | (c >= np.pi - EXACT),
            centre > c + BETWEEN,
            moved + 100 * swing < SHORTEST,
        )

    outcome = prove(len(hop), look)
    violations = []
    for item, s in {**outcome.failed, **outcome.stuck}.items():
        k, e = hop[item : item + 1], ends[item : item + 1]
        axis = journey.frames(k, np.array([s]))[:, -1, :3, 2]
        angle = float(_off_arc(axis, axes[e[:, 0]], axes[e[:, 1]])[0])
        how = (
            f"is {angle:.4f} rad off"
            if item in outcome.failed
            else f"is not proven to stay, {angle:.6f} rad off,"
        )
        text = f"the tool's axis {how} {words.hop(int(k[0]))}; the cone allows {cone[item]:g} rad"
        violations.append(
            Violation("direction", int(k[0]), words.owner(int(k[0])), max(0.0, angle - cone[item]), text)
        )
    return finding("direction", min(least), violations)


def _length(vectors: Array) -> Array:
    length: Array = np.linalg.norm(vectors, axis=-1)
    return length


def _from_segment(points: Array, start: Array, end: Array) -> Array:
    along = end - start
    square = np.maximum((along**2).sum(-1), 1e-300)
    t = np.clip(((points - start) * along).sum(-1) / square, 0.0, 1.0)
    return _length(points - start - t[:, None] * along)


def _angle(u: Array, v: Array) -> Array:
    """Angle between unit vectors, accurate near 0."""
    angle: Array = np.arctan2(_length(np.cross(u, v)), (u * v).sum(-1))
    return angle


def _off_arc(u: Array, a: Array, b: Array) -> Array:
    return _angle(u, _nearest_on_arc(u, a, b))


def _nearest_on_arc(u: Array, a: Array, b: Array) -> Array:
    """Nearest direction to u on the shorter arc from a to b."""
    normal = np.cross(a, b)
    square = (normal**2).sum(-1, keepdims=True)
    flat = u - normal * (u * normal).sum(-1, keepdims=True) / np.maximum(square, 1e-300)
    size = _length(flat)[:, None]
    inner = flat / np.maximum(size, 1e-12)
    between = ((np.cross(a, inner) * normal).sum(-1) >= 0) & ((np.cross(inner, b) * normal).sum(-1) >= 0)
    usable = between & (square[:, 0] > 1e-18) & (size[:, 0] > 1e-9)
    end = np.where((_angle(u, a) <= _angle(u, b))[:, None], a, b)
    core: Array = np.where(usable[:, None], inner, end)
    return core
