"""Proof that the tool meets its set-points and stays on the path between them."""

from __future__ import annotations

import numpy as np

from regionik.values import Violation
from regionik.verification.findings import Finding, Words, finding, on_path
from regionik.verification.motion import Indices, Journey, Parts, Verdicts, prove, sag
from regionik.verification.tool_axis import angle_between
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
        found.append(("axis", float(angle_between(R[:, 2], target.direction))))
    if target.orientation is not None:
        between = target.orientation.T @ R
        twist = np.array(
            [between[2, 1] - between[1, 2], between[0, 2] - between[2, 0], between[1, 0] - between[0, 1]]
        )
        found.append(("orientation", float(np.arctan2(np.linalg.norm(twist), np.trace(between) - 1))))
    return found


def path(world: World, journey: Journey, words: Words) -> Finding:
    """Tool within ``path_tolerance`` of the segment between two set-points, wherever it is not lifted."""
    limit = world.rules.path_tolerance
    spots = np.array([target.position for target in world.task])
    on = on_path(len(world.task), journey)

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
        k, e = np.repeat(hop[item], 3), np.repeat(ends[item : item + 1], 3, axis=0)
        points = journey.frames(k, np.array([0.0, s, 1.0]))[:, -1, :3, 3]
        o = float(stray(points, e).max())
        violations.append(_off_path(words, int(k[0]), words.hop(int(k[0])), o, limit))
    halfway = journey.frames(on.hop, np.full(len(on.hop), 0.5))[:, -1, :3, 3]
    seen = np.concatenate([off, stray(halfway, on.hop_ends)])
    return finding("path", limit - float(seen.max()) if len(seen) else np.inf, violations)


def _off_path(words: Words, state: int, where: str, off: float, limit: float) -> Violation:
    if off > limit:
        text = f"the tool is {off:.4f} m off the path {where} and not lifted; the rules allow {limit:g} m"
    else:
        proof = f"the tool is not proven to stay on the path {where}"
        text = f"{proof}: {off:.6f} m off, the rules allow {limit:g} m"
    return Violation("path", int(state), words.owner(int(state)), max(0.0, float(off - limit)), text)


def _length(vectors: Array) -> Array:
    length: Array = np.linalg.norm(vectors, axis=-1)
    return length


def _from_segment(points: Array, start: Array, end: Array) -> Array:
    along = end - start
    square = np.maximum((along**2).sum(-1), 1e-300)
    t = np.clip(((points - start) * along).sum(-1) / square, 0.0, 1.0)
    return _length(points - start - t[:, None] * along)
