"""Numbers that tune the programs by which a path of states is made smooth."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PathSmoothingOptions:
    """Rounds of a quadratic program about the states found so far, and what it costs."""

    max_rounds: int = 60
    min_gain: float = 2e-2  # of the cost in a round, by its part
    patience: int = 2  # rounds in turn that gain less, after which it ends
    # Largest change of a coordinate in a round, and in one after which it ends [m] or [rad]
    first_trust: float = 0.3
    min_trust: float = 1e-3
    max_refinements: int = 8  # of the equations at last
    step_shares: tuple[float, ...] = (
        1.0,
        0.5,
        0.25,
        0.1,
    )  # of such a step, tried until less is missed
    miss_weight: float = 1e4  # of what the equations miss, against the mean of the roughness
    length_cost: float = 0.05  # of motion itself, against its bending along a metre of path
    lifted_length: float = 0.15  # of path, that a motion with the tool lifted counts as [m]
    corner_weight: float = 0.02  # of bending where the tool's own path has a corner


PATH_SMOOTHING = PathSmoothingOptions()
