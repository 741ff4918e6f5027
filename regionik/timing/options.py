"""Numbers that tune the timing of motions: how finely paths are laid out, and how often limits are tightened.

None of them decides what a limit allows, as timed motions are verified. Finer ones save time of the robot
and take more of planning.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class CornerOptions:
    """Corners at which the robot rests, and those that are rounded."""

    rest_corner: float = np.radians(30)  # sharper ones are rested at [rad]
    rest_rounded_corner: float = np.radians(60)  # where corners are rounded first [rad]
    gentle_steering: float = 0.1  # change from segment to segment that a car makes as it rolls [rad]
    turn_share: float = 0.25  # of the narrowest cone, by which the smooth path may turn the tool
    min_spare_cone: float = 0.02  # of a set-point, with less of which its state stays where it is [rad]
    # By which points may cut corners with the tool lifted, where nothing is in the way [m]
    lifted_blend: float = 0.03
    min_rounded_share: float = 0.1  # of the blend: where states may move by less, they stay


@dataclass(frozen=True)
class RoundingOptions:
    """The smoothing spline that rounds corners."""

    min_ramp: float = 0.06  # of accelerations: corners are not rounded for quicker ones [s]
    period: float = 0.0125  # between states that are laid out, at most, where segments are short [s]
    min_segment_time: float = 0.001  # so that third differences stay finite [s]
    # Of weighing states, as the first spline that is near enough is not yet the smoothest
    min_rounds: int = 30
    max_rounds: int = 60
    # What a state weighs grows by a power of the part of its distance that it takes, within bounds.
    aimed_share: float = 0.9  # of the distance
    min_share: float = 0.5
    max_share: float = 4.0
    exponent: float = 1.5
    min_weight: float = 1e-3
    max_weight: float = 1e9
    min_lever: float = 0.05  # of a joint, so that none turns for nothing [m]
    straight_share: float = 0.15  # of the blend, by which the motion may leave lines between its states


@dataclass(frozen=True)
class InsertionOptions:
    """States inserted in a motion, for its smooth path to keep to it and for its timing."""

    max_rounds: int = 30  # of halving segments that the smooth path leaves
    # Of a segment, where it is compared with the smooth path
    compared_shares: tuple[float, ...] = (0.25, 0.5, 0.75)
    drawn_share: float = 0.9  # of the blend, by which states are put beside segments
    period: float = 0.02  # of the fine timing that shows where states are needed [s]
    max_velocity_error: float = 0.002  # of the squared path velocity between states that are kept, as a share
    # Segments are cut evenly, and those at their ends are halved, as accelerations change most there.
    max_parts: int = 16
    max_halvings: int = 8
    fewer_share: float = 0.1  # of even parts that are not made for each time that those at ends are halved


@dataclass(frozen=True)
class JerkOptions:
    """Jerk-limited timing: limits tightened over a time-optimal one, and splines that keep to its path."""

    max_rounds: int = 12  # of tightening limits
    max_futile_rounds: int = 6  # one after another
    max_stretches: int = 8  # of time, where limits are still exceeded
    min_stretch_time: float = 0.1  # over which such a stretch sets in, but for two ramps [s]
    period: float = 0.1  # between knots, at most, where motions between states are short [s]
    max_segment_knots: int = 4  # besides, on each segment of the path between states, of motions however slow
    max_halvings: int = 6  # of the time between states, until the splines keep to the path
    # Of the time of each piece, at which limits are checked
    checked_shares: tuple[float, ...] = (0.0, 0.25, 0.5, 0.75, 1.0)


@dataclass(frozen=True)
class SlowingOptions:
    """Limits that are exceeded between states: they are tightened there, then time is stretched."""

    excess: float = 1e-3  # of a limit that is left to stretching, as a share
    spare: float = 1e-4  # by which time is stretched more than needed, so that once does
    max_tightenings: int = 6  # of limits, over runs
    max_slowdowns: int = 8  # of the motion, after that
    # Of these, the first, about what is too fast alone, each twice as much as the last
    max_local_slowdowns: int = 4
    negligible: float = 0.002  # part by which the whole motion may as well be slower
    # Of a limit by bounds of `verify`, for which the motion is slowed; for more it rests
    max_slowed_excess: float = 0.05
    # Of its limit that steering takes, whose rate may peak between the shares checked
    steering_share: float = 0.95


@dataclass(frozen=True)
class RuleOptions:
    """Corners cut less, and states rested at, where the smooth motion breaks a rule of its plan."""

    narrowing: float = 5.0  # factor by which corners are cut less
    max_narrowings: int = 8
    # States next to one that breaks a rule at which to rest too, try by try: in the end at all of its run.
    rested_beside: tuple[int, ...] = (0, 0, 1, 4, 1_000_000, 1_000_000)
    min_states_apart: int = 20  # of two that break rules for reasons of their own
    # Of segments that a smooth path may leave for its states to count as dense
    max_strayed_share: float = 0.05


@dataclass(frozen=True)
class OptimisationOptions:
    """The time-optimal pass over a whole motion, base, joints and times together."""

    period: float = 0.1  # between states that are optimised, at most, as the motion was timed before [s]
    # Of the time between two of them, at whose ends clearances and tolerances are kept, and at last
    parts: int = 2
    last_parts: int = 5
    state_period: float = 0.02  # between those that are laid out of what is found, at most [s]
    max_tries: int = 5  # of what is found, with more distance where it breaks a rule
    cost: float = 30.0  # of what is missing of a clearance or of the tool's path [s/m]
    margin: float = 1e-3  # of clearances, where there is room [m]
    tool_share: float = 0.85  # of the tolerances of set-points and path that is used
    contact_share: float = 0.4  # of that of set-points, where the tool sinks in
    most_narrowed: float = 0.5  # part of the path's width that is given up near a state that breaks a rule
    corrected_share: float = 0.97  # of those of set-points, beyond which the tool is brought back at last
    cone_share: float = 0.95  # of cones
    same: float = 1e-9  # coordinates that differ by less are the same [m], [rad]
    damping: float = 1e-4  # of changes that bring the tool back to its set-points [m2]
    sides: int = 8  # of the polygon in the path's cross-section
    about: tuple[float, ...] = (
        0.4,
        1.0,
    )  # slopes of directions about the tool's, in which its speed is limited
    spare_distance: float = 0.003  # that is asked for besides near a state that breaks a rule [m]
    places_beside: int = 4  # on either side of it


@dataclass(frozen=True)
class FigureOptions:
    """What is told of a timed motion: how much of its limits it uses, and where a tool speed is not held."""

    max_parabolas: int = 2  # one after the other, to the top of what a piece uses
    pieces_at_once: int = 4_000  # a matter of memory
    min_speed_share: float = 0.99  # of the asked tool speed, from which it counts as held
    max_places: int = 20  # where it is not, that are told
    time_beside: float = 0.15  # of such a place, in which is looked for what keeps the tool back [s]


@dataclass(frozen=True)
class TimingOptions:
    """All of them, by what they tune."""

    corners: CornerOptions = CornerOptions()
    rounding: RoundingOptions = RoundingOptions()
    insertion: InsertionOptions = InsertionOptions()
    jerk: JerkOptions = JerkOptions()
    slowing: SlowingOptions = SlowingOptions()
    rules: RuleOptions = RuleOptions()
    optimisation: OptimisationOptions = OptimisationOptions()
    figures: FigureOptions = FigureOptions()
    max_rows: int = 1_000_000  # of a file of a trajectory
    # From zero to full acceleration of drives between two poses, where no jerk is given [s]
    default_ramp: float = 0.25


TIMING = TimingOptions()
