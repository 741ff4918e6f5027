"""Arms whose first joint is a vertical pivot: what can be said of all of them."""

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
def span_of(chain: Chain) -> Span:
    """Bound of the reach of an arm whose first joint is a vertical pivot.

    Raises
    ------
    InputError
        When the first joint is anything else, or a sliding joint has no end.
    """
    first = chain.joints[0]
    T = first.T_parent_joint
    upright = first.kind == "revolute" and (T[:3, :3] @ first.axis)[2] > 1 - _ALIGNED
    if not upright or np.hypot(*T[:2, 3]) > _ALIGNED:
        raise InputError(
            "robot: this arm cannot be planned for yet: its first axis must be the vertical through its base "
            "frame, pointing up"
        )
    steps = [joint.T_parent_joint[:3, 3] for joint in chain.joints[1:]] + [chain.T_last_tool[:3, 3]]
    first_step = T[:3, 3] + T[:3, :3] @ steps[0]
    endless = [
        j.name for j in chain.joints if j.kind == "prismatic" and not np.isfinite([j.lower, j.upper]).all()
    ]
    if endless:
        raise InputError(f"robot: joint {endless[0]}: a sliding joint needs limits to be planned for")
    travel = sum(max(abs(j.lower), abs(j.upper)) for j in chain.joints if j.kind == "prismatic")
    length = float(sum(np.linalg.norm(step) for step in steps[1:])) + travel
    return Span(float(np.hypot(*first_step[:2])), float(first_step[2]), length)
