"""A motion with its joints brought to the middle of their limits by whole turns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from regionik.moving.path_search import JoinedMotion
from regionik.scene import Scene
from regionik.worlds.arms import has_pivot, pivot_index
from regionik.worlds.arrays import Array
from regionik.worlds.robot import with_joint_margin


def brought_to_the_middle(scene: Scene, joined: JoinedMotion) -> JoinedMotion:
    """Return a motion whose joints that turn more than once stay as near to their middle as may be.

    Each is turned by the same whole turns in all states, which changes nothing else. A motion that begins
    where the world says is left as it is, and so is the pivot of an arm whose base faces its targets.
    """
    turns = whole_turns(scene, joined.motion.joints) if scene.start is None else np.zeros(1)
    if not turns.any():
        return joined
    motion = replace(joined.motion, joints=joined.motion.joints + turns)
    setpoints = tuple(replace(one, joints=one.joints + turns) for one in joined.setpoints)
    return replace(joined, motion=motion, setpoints=setpoints)


def whole_turns(scene: Scene, joints: Array) -> Array:
    """Turns (dof,) that bring each joint's values (n, dof), all together, nearest to its middle [rad]."""
    chain = with_joint_margin(scene.robot, scene.rules.criteria).chain
    some, low, high = chain.winding, joints.min(axis=0), joints.max(axis=0)
    if scene.rules.heading == "face_target" and has_pivot(chain):
        some = some & (np.arange(chain.dof) != pivot_index(chain))
    turns = np.zeros(chain.dof)
    away = (chain.lower[some] + chain.upper[some] - low[some] - high[some]) / 2
    turns[some] = 2 * np.pi * np.round(away / (2 * np.pi))
    fits = (low + turns >= chain.lower) & (high + turns <= chain.upper)
    return np.where(fits, turns, 0.0)
