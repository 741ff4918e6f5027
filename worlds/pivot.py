"""Arms on a vertical pivot, on vertical lifts below it or not: what can be said of all of them.

An arm without one turns as its base turns: `pivoted` puts a pivot that stands still before it, and whoever
places the base gives that pivot's turn to the base.
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
class Span:
    """A ball, turned about the pivot, that the tool never leaves.

    Attributes
    ----------
    radius, height : float
        Middle of the ball: distance from the pivot axis and height over the arm's base frame [m].
    length : float
        [m]
    """

    radius: float
    height: float
    length: float


@lru_cache(maxsize=64)
def pivoted(chain: Chain) -> Chain:
    """The chain where it has a vertical pivot, else the chain behind one that stands still.

    That one is the vertical through the arm's base frame; joint values get a zero before them, `behind`.
    """
    try:
        pivot_of(chain)
    except InputError:
        still = Joint("(base)", "revolute", 0.0, 0.0, np.eye(4), np.array([0.0, 0.0, 1.0]))
        return Chain((still, *chain.joints), chain.T_last_tool)
    return chain


def behind(chain: Chain, joints: Array) -> Array:
    """Joint values (..., dof) of a chain as those of `pivoted`."""
    more = pivoted(chain).dof - chain.dof
    return np.concatenate([np.zeros((*joints.shape[:-1], more)), joints], axis=-1)


@lru_cache(maxsize=64)
def pivot_of(chain: Chain) -> int:
    """Which joint is the vertical pivot: the first one, or the first after joints that lift it.

    Raises
    ------
    InputError
        When what comes first is anything else, as never in a chain that is `pivoted`.

    Examples
    --------
    >>> from regionik.worlds.bundled import robot_named
    >>> pivot_of(robot_named("youbot").chain)
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
def span_of(chain: Chain) -> Span:
    """Bound of the reach of an arm, turned about the pivot that it has or is `pivoted` by.

    Raises
    ------
    InputError
        When a sliding joint has no end.
    """
    chain = pivoted(chain)
    pivot = pivot_of(chain)
    endless = [
        j.name for j in chain.joints if j.kind == "prismatic" and not np.isfinite([j.lower, j.upper]).all()
    ]
    if endless:
        raise InputError(f"robot: joint {endless[0]}: a sliding joint needs limits to be planned for")
    steps = [joint.T_parent_joint[:3, 3] for joint in chain.joints[1:]] + [chain.T_last_tool[:3, 3]]
    middle = np.zeros(chain.dof)
    middle[:pivot] = (chain.lower[:pivot] + chain.upper[:pivot]) / 2
    T_pivot = chain.frames(middle)[pivot]
    first_step = T_pivot[:3, 3] + T_pivot[:3, :3] @ steps[pivot]
    slides = [j for j in chain.joints[pivot:] if j.kind == "prismatic"]
    travel = sum(max(abs(j.lower), abs(j.upper)) for j in slides)
    travel += float((chain.upper[:pivot] - chain.lower[:pivot]).sum()) / 2
    length = float(sum(np.linalg.norm(step) for step in steps[pivot + 1 :])) + travel
    return Span(float(np.hypot(*first_step[:2])), float(first_step[2]), length)
