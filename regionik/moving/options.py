"""Numbers that tune the search for motions: how much is tried, and how finely.

None of them decides what is true of a motion: whatever is found is proven. More of each finds motions where
there were none, or shorter ones, and takes longer.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SamplingOptions:
    """Collision-free configurations at a set-point."""

    max_places: int = 24  # of the base, looked through in one component
    max_postures_per_place: int = 2  # offered at one of them
    max_pitches: int = 48  # of the last link, looked through at every place
    min_far_turn: float = 1.5  # of an endless joint, from which on the other way round is tried too [rad]
    max_starts: int = 8  # postures drawn from which others are sought at a base pose
    max_headings: int = 16  # of the base, from which base and joints may go on together
    # Components by heading: those looked through first, and what a turn to one counts against driving there
    max_near_components: int = 4
    turn_weight: float = 0.3  # [m/rad]
    # Where no posture is clear, the nearest ones are mended.
    max_futile_tries: int = 16  # one after another at one component
    max_mended: int = 4
    max_searched: int = 2  # of their places, at which all postures are looked for
    max_boxes: int = 20_000  # of postures weighed there


@dataclass(frozen=True)
class FollowingOptions:
    """States between two set-points, the tool on its path."""

    tool_stride: float = 0.05  # longest way of base or tool between two states [m]
    turn_stride: float = 0.1  # of the tool's frame [rad]
    # Of the tool where base and arm go on together, by the arm's reach: it bends less where it is long
    reach_stride: float = 0.06
    solve_tolerance_share: float = 0.1  # of the tolerance, so that motion between states has the rest
    sag_share: float = 0.3  # of the path tolerance, that motion between two states may use
    max_segment_halvings: int = 6  # before a segment counts as discontinuous
    max_proof_halvings: int = 3  # before a motion that is not proven clear counts as blocked
    max_hop_halvings: tuple[int, int] = (4, 0)  # of base and joints together, and of a base on wheels
    max_states_at_once: int = 16  # tried in one call: after one that fails the rest is tried anew


@dataclass(frozen=True)
class StateOptions:
    """States of base and joints solved together."""

    max_newton_steps: int = 20
    max_stalled_steps: int = 4  # that bring the tool no nearer
    tool_tolerance: float = 1e-6  # angles as lengths [m]
    spare_clearance: float = 0.002  # of what is near, left for the way between states [m]
    homeward_share: float = 0.2  # of the way home, that joints are wished to go in a step
    max_drawn_share: float = 0.7  # of the longest step of the base, that it is drawn to its guide in one
    # Of the way from the middle of a joint's range to its end, where it weighs most
    max_range_share: float = 0.999
    # Of a metre by which areas and clearances are missed; where an arm is too near the proof will say
    area_cost: float = 1.0
    arm_cost: float = 0.02


@dataclass(frozen=True)
class RunSearchOptions:
    """Runs of set-points, by search or grown from a configuration."""

    max_candidates: int = 16  # at the next set-point, or to begin a run from
    # Candidates tried in vain one after another: in any search, of a run that was stuck, and before base and
    # joints go on together
    max_stalled_candidates: int = 200
    max_resumed_candidates: int = 40
    max_base_first_candidates: int = 24
    max_whole_body_tries: int = 3  # candidates worth a search in the space of the whole robot
    # Set-points that runs may go through and get no farther: in any case, and times those of the farthest,
    # more on wheels
    min_setpoint_budget: int = 60
    setpoint_budget_factors: tuple[int, int] = (2, 12)
    min_limit_share: float = 0.1  # of a joint's range, left to its limits where a run goes back to
    # Runs on a base that stands still
    stationary_budget_factor: int = 4  # times as many set-points as there are
    max_stationary_places: int = 3  # besides the middle
    max_stationary_bases: int = 8


@dataclass(frozen=True)
class GuideOptions:
    """Base paths through the areas of a run; lengths by the arm's reach."""

    spacing: float = 0.06  # of places
    max_cells: int = 3  # that the base goes from a set-point to the next
    edge_margin: float = 0.15  # kept from the edges of areas where there is room
    edge_cost: float = 0.03  # of a place on an edge, beside squares of steps
    max_narrow: int = 6  # set-points with little room, from which runs are begun


@dataclass(frozen=True)
class TransitOptions:
    """Motion with the tool lifted."""

    retreat_directions: int = 16
    edge_inset: float = 0.002  # kept from the edge of what two areas share, where there is room [m]
    max_turn_part: float = 0.1  # of a turn about the arm axis, made of short slides of the base frame [rad]
    berths: tuple[float, ...] = (
        0.0,
        0.04,
        0.08,
        0.16,
    )  # kept from the free floor's edge beyond what is needed [m]
    max_fold_places: int = 3  # from where the robot is on
    # Of RRTConnect for base and arm, for the arm alone, and for a shorter way
    max_iterations: int = 3000
    max_arm_iterations: int = 1000
    max_round_iterations: int = 1000
    max_rounds: int = 16  # of such ways
    max_failed_rounds: int = 4  # in turn
    good_length_ratio: float = 1.1  # times the least way is short enough
    # Shortcuts that are looked at, and in vain one after another: for length, and for time
    max_shortcuts: int = 200
    max_failed_shortcuts: int = 60
    max_quicker_shortcuts: int = 100
    max_failed_quicker: int = 24
    min_saved_time: float = 0.02  # [s]


@dataclass(frozen=True)
class MovingOptions:
    """All of them, by what they tune."""

    sampling: SamplingOptions = SamplingOptions()
    following: FollowingOptions = FollowingOptions()
    solving: StateOptions = StateOptions()
    runs: RunSearchOptions = RunSearchOptions()
    guide: GuideOptions = GuideOptions()
    transits: TransitOptions = TransitOptions()


MOVING = MovingOptions()
