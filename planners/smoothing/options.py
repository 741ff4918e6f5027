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


@dataclass(frozen=True)
class LeastTimeOptions:
    """Rounds of a linear program in states and times, and what it leaves to the timing that follows."""

    max_rounds: int = 30
    # Of long motions there are fewer: so many states in all rounds, and at least so many rounds
    max_work: int = 9000
    min_rounds: int = 4
    accuracy: float = 1e-6  # of a round's residuals: the next one mends what is left
    max_last_rounds: int = 4  # that mend what is missed
    # Largest change of a coordinate in the first round, in the first of the last ones, in any, and in one
    # after which there is none [m] or [rad]
    first_trust: float = 0.1
    last_trust: float = 0.02
    max_trust: float = 0.2
    min_trust: float = 2e-3
    growth: float = 2.0  # of the trust after a round that gains
    shrinking: float = 0.4  # and after one that does not
    rate_time: float = 0.2  # in which rates change by the trust at most [s]
    # By which spans of time change in a round, at the first trust, and by which beside one another's
    span_share: float = 0.15
    neighbour_share: float = 0.03
    min_gain: float = 4e-3  # of the time in a round, by its part
    patience: int = 2  # rounds in turn that gain less, after which it ends
    # Costs that choose among motions that take the same time: of squared changes of coordinates by the trust
    # region, and of squared accelerations by their limits [s]
    change_cost: float = 1e-2
    bend_cost: float = 1e-5
    sides: int = 16  # of the polygon for the disc of the base's speeds and accelerations
    excess_cost: float = 2.0  # of shares by which sections exceed limits, against their time
    # Parts of costs by which rounds are judged, as the next one mends what is exceeded or missed
    excess_share: float = 0.15
    missed_share: float = 0.03
    most_excess: float = 100.0  # of limits of acceleration, where motions begin with corners


PATH_SMOOTHING = PathSmoothingOptions()
LEAST_TIME = LeastTimeOptions()
