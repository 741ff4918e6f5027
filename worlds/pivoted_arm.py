"""Arms on a vertical pivot, with or without vertical lifts below it: pivot, and bound of the reach.

An arm without such a pivot turns with its base: `with_pivot` puts one that stands still before it, and where
the base is placed its turn is given to the base.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain, Joint
from regionik.worlds.errors import InputError

_ALIGNED = 1e-9


@dataclass(frozen=True)
class ReachBound:
    """A ball swept about the pivot that the tool never leaves."""

    # centre of the ball: distance from the pivot axis, and height over the arm's base frame [m]
    radius: float
    height: float
    length: float  # radius of the ball [m]


@lru_cache(maxsize=64)
def with_pivot(chain: Chain) -> Chain:
    """Return the chain itself where it has a vertical pivot, else the chain behind one that stands still.

    That pivot is the vertical through the arm's base frame. `pivot_joints` gives joint values to match.
    """
    try:
        pivot_index(chain)
    except InputError:
        still = Joint("(base)", "revolute", 0.0, 0.0, np.eye(4), np.array([0.0, 0.0, 1.0]))
        return Chain((still, *chain.joints), chain.T_last_tool)
    return chain


def pivot_joints(chain: Chain, joints: Array) -> Array:
    """Return joint values (..., dof) of a chain as those of the chain `with_pivot`, zero for its pivot."""
    more = with_pivot(chain).dof - chain.dof
    return np.concatenate([np.zeros((*joints.shape[:-1], more)), joints], axis=-1)


@lru_cache(maxsize=64)
def pivot_index(chain: Chain) -> int:
    """Return the index of the vertical pivot: the first joint, or the first after joints that lift it.

    Raises
    ------
    InputError
        When the chain has no such pivot; a chain `with_pivot` always has.

    Examples
    --------
    >>> from regionik.worlds.bundled import robot_named
    >>> pivot_index(robot_named("youbot").chain)
    0
    """
    for k, (joint, T) in enumerate(zip(chain.joints, chain.frames(np.zeros(chain.dof)), strict=False)):
        upward = float((T[:3, :3] @ joint.axis)[2])
        if joint.kind == "revolute" and upward > 1 - _ALIGNED and np.hypot(*T[:2, 3]) <= _ALIGNED:
            return k
        if joint.kind == "revolute" or abs(upward) < 1 - _ALIGNED:
            break
    raise InputError(
        "robot: expected a first axis that is the vertical through the arm's base frame, pointing up; only "
        "sliding joints that lift it may come before"
    )


@lru_cache(maxsize=64)
def reach_bound(chain: Chain) -> ReachBound:
    """Return a bound of an arm's reach, about its pivot or the one that `with_pivot` gives it.

    Raises
    ------
    InputError
        When a sliding joint has no limits.
    """
    chain = with_pivot(chain)
    pivot = pivot_index(chain)
    slides = [joint for joint in chain.joints if joint.kind == "prismatic"]
    endless = [joint.name for joint in slides if not np.isfinite([joint.lower, joint.upper]).all()]
    if endless:
        raise InputError(f"robot: joint {endless[0]}: a sliding joint needs limits to be planned for")
    steps = [joint.T_parent_joint[:3, 3] for joint in chain.joints[1:]] + [chain.T_last_tool[:3, 3]]
    middle = np.zeros(chain.dof)
    middle[:pivot] = (chain.lower[:pivot] + chain.upper[:pivot]) / 2
    T_pivot = chain.frames(middle)[pivot]
    first_step = T_pivot[:3, 3] + T_pivot[:3, :3] @ steps[pivot]
    behind = [joint for joint in chain.joints[pivot:] if joint.kind == "prismatic"]
    travel = sum(max(abs(joint.lower), abs(joint.upper)) for joint in behind)
    travel += float((chain.upper[:pivot] - chain.lower[:pivot]).sum()) / 2
    length = float(sum(np.linalg.norm(step) for step in steps[pivot + 1 :])) + travel
    return ReachBound(float(np.hypot(*first_step[:2])), float(first_step[2]), length)
