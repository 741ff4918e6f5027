"""Postures that put the tool of an arm on a target: in closed form, and densely.

Targets are in the arm's base frame; joint limits are left to the caller.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from regionik.worlds.arrays import Array


def sweep_youbot(goal: Array) -> Array:
    """Pitches of the last link a quarter of a degree apart, both elbows, the pivot either way."""
    pitch = np.radians(np.arange(0, 360, 0.25))
    rows = []
    for turn in (0.0, np.pi):
        pivot = np.arctan2(goal[1], goal[0]) + turn
        level = np.hypot(goal[0], goal[1]) * np.cos(turn) - 0.033
        wrist = np.column_stack([level - 0.2175 * np.cos(pitch), goal[2] - 0.147 - 0.2175 * np.sin(pitch)])
        for one, two, kept in _two_links(wrist, 0.155, 0.135):
            # The tool lies along the last axis, at right angles to link 3's x axis.
            rows.append((np.full(kept.sum(), pivot), one, two, pitch[kept] + np.pi / 2 - one - two))
    columns = [np.concatenate(column) for column in zip(*rows, strict=True)]
    return np.column_stack([*columns, np.zeros(len(columns[0]))])


def sweep_hinge5(goal: Array) -> Array:
    """Pivots a degree and pitches two degrees apart, both elbows, the last link to either side."""
    a, rows = 0.068, []
    pitch = np.radians(np.arange(0, 360, 2.0))
    for pivot in np.radians(np.arange(-180, 180, 1.0)):
        c, s = np.cos(pivot), np.sin(pivot)
        level, aside = c * goal[0] + s * goal[1], c * goal[1] - s * goal[0]
        if abs(aside) >= a:
            continue
        # The hinges' axis is the pivot frame's z, which the first alpha lays along (-s, c, 0); heights point
        # down in the hinges' plane, and the last joint turns the last link out of that plane.
        for last in (np.arcsin(-aside / a), np.pi - np.arcsin(-aside / a)):
            far = a * (1 + np.cos(last))
            wrist = np.column_stack([level - far * np.cos(pitch), a - goal[2] - far * np.sin(pitch)])
            for one, two, kept in _two_links(wrist, a, a):
                count = int(kept.sum())
                rows.append((np.full(count, pivot), one, two, pitch[kept] - one - two, np.full(count, last)))
    if not rows:
        return np.zeros((0, 5))
    return np.column_stack([np.concatenate(column) for column in zip(*rows, strict=True)])


def _two_links(wrist: Array, a: float, b: float) -> Sequence[tuple[Array, Array, Array]]:
    """Joint values that bring two links to points in their plane, either elbow, and which are reached."""
    cosine = ((wrist**2).sum(1) - a * a - b * b) / (2 * a * b)
    kept = np.abs(cosine) <= 1
    answers = []
    for side in (1.0, -1.0):
        two = side * np.arccos(cosine[kept])
        one = np.arctan2(wrist[kept, 1], wrist[kept, 0]) - np.arctan2(b * np.sin(two), a + b * np.cos(two))
        answers.append((one, two, kept))
    return answers


SWEEPS = {
    "youbot": sweep_youbot,
    "youbot-real": sweep_youbot,
    "boxes": sweep_youbot,
    "hinge5": sweep_hinge5,
}
