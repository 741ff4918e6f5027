"""Arms on a vertical pivot, on vertical lifts below it or not: what can be said of all of them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from regionik.worlds.chain import Chain
from regionik.worlds.errors import InputError
from regionik.worlds.planar import planar_arm

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
def is_planar(chain: Chain) -> bool:
    """Whether the arm works in one vertical plane, as `planar_arm` reads it."""
    try:
        planar_arm(chain)
    except InputError:
        return False
    return True


@lru_cache(maxsize=64)
def pivot_of(chain: Chain) -> int:
    """Which joint is the vertical pivot: the first one, or the first after joints that lift it.

    Raises
    ------
    InputError
        When what comes first is anything else.

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
        "robot: this arm cannot be planned for yet: its first axis must be the vertical through its base "
        "frame, pointing up; only sliding joints that lift it may come before"
    )


@lru_cache(maxsize=64)
def span_of(chain: Chain) -> Span:
    """Bound of the reach of an arm on a vertical pivot.

    Raises
    ------
    InputError
        When the arm has no such pivot, or a sliding joint has no end.
    """
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
