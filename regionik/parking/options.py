"""Numbers that tune the search for stops: how much is tried, and how finely.

None of them decides what is true of a plan. More of each finds better stops, or some where there were none,
and takes longer.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class CoverOptions:
    """Base poses that are sampled for arms whose place determines no posture, and covers by them."""

    # The more poses, the fewer stops may do; but the arm is asked for its postures at each.
    poses_per_square_metre: int = 100  # of floor from which some set-point may be reached
    min_poses: int = 500
    max_poses: int = 6000
    # Then more are drawn around those that the prices of the linear cover favour, ever closer to them.
    max_rounds: int = 24
    max_futile_rounds: int = 5  # one after another in which the linear cover became no less
    max_favoured: int = 150  # poses, in a round
    poses_around: int = 2  # drawn around each of them
    first_deviation: float = 0.3  # of these from it [m]
    deviation_shrinkage: float = 0.8  # by which it is multiplied from round to round
    # A pose that proves to serve less than it may often lies but centimetres from one that does not.
    poses_beside: int = 8  # drawn beside it
    beside_deviation: float = 0.05  # of these from it [m]
    max_shrinkages: int = 8  # after so many they are drawn 5 cm around it, closer than those all over
    heading_deviation: float = 1.5  # of their headings, by the deviation of places [rad/m]
    poses_for_unserved: int = 40  # drawn in a round for a set-point that none serves
    # And in each of its known areas, often too small for one of the others to lie there
    poses_in_known: int = 10
    max_nodes: int = 200  # of branch and bound for a cover: a worse cover is a cover all the same
    max_covers: int = 60  # until it is known of all poses of one what they serve


@dataclass(frozen=True)
class CarrierOptions:
    """Postures carried along set-points on a fixed base, and round the rim of a circle to park in."""

    max_starts: int = 24  # postures at the first set-point
    max_continued: int = 24  # postures of a roadmap that are led on to a set-point that it does not join
    max_compared: int = 3  # of those that serve every set-point
    rim_directions: int = 8  # in which a posture is led out to the rim
    rim_steps: int = 4  # on the way there, each posture the start of the next
    rim_tolerance_share: float = 0.5  # of the tolerance, so that other solvers find the posture there too


@dataclass(frozen=True)
class PlaceOptions:
    """Places of one stop, and poses of it where poses were sampled."""

    max_pivot_places: int = 1500  # all over the areas of a side, where limits of the pivot split stops
    # Of a widest circle, so that shrunk areas, which are rounded, keep a place
    sure_circle_share: float = 0.99
    max_places: int = 24  # before the best of them is bettered
    max_slow_places: int = 6  # where a place gives the arm no posture, or its score takes as long
    max_poses: int = 48  # that are asked whether they serve the whole stop
    max_roomiest_poses: int = 3  # of these, the first, whose circles are measured
    # A pattern search halves its steps down to a millimetre, or sooner where each of them is slow.
    min_step: float = 1e-3  # [m]
    min_probability_step: float = 0.01  # where the criterion is the probability [m]
    min_probability_gain: float = 1e-4  # of a step


@dataclass(frozen=True)
class ProbabilityOptions:
    """Slices of yaw over which the probability of a stop after parking is summed up."""

    max_deviations: float = 5.5  # of the pose on either side: beyond them lie four in a hundred million
    min_slices: int = 12  # and twice as many, and so on, while that raises the bound
    max_slices: int = 96
    max_half_slice: float = 0.2  # at first, as the floor that is free all over a wide slice is little [rad]
    min_gain: float = 1e-4  # that twice the slices are worth
    estimate_slices: int = 6  # of an estimate, which is taken at their middles
    estimate_slack: float = 0.01  # by which it may be too low before nothing is proven at all
    circle_vertices: int = 144  # of a full circle: sides of an inner polygon cost probability


@dataclass(frozen=True)
class TourOptions:
    """Postures from which the tour of an arm at a stop chooses."""

    max_families: int = 8  # of postures at a set-point
    same_posture: float = 0.05  # less in every joint is no other posture [rad]
    max_continuation_rounds: int = 3  # in which postures along the tour are continued from the one before
    max_proof_rounds: int = 12  # then only postures that are known to hold are chosen
    max_rounds: int = 120  # in all, until every way round along the tour is known


@dataclass(frozen=True)
class WorkOptions:
    """The arm's work at one stop, which a search for motions may fail at."""

    max_places: int = 8  # of a stop, before it is split
    # The first, from which the way there is worth a search with base and arm at once
    max_whole_body_places: int = 2
    max_postures: int = 8  # at a set-point, continued from the one before
    max_arrivals: int = 3  # postures at the first that are worth a drive, where set-points have no order
    max_linked_motions: int = 4  # to the next set-point, where the tool may as well be lifted


@dataclass(frozen=True)
class ParkingOptions:
    """All of them, by what they tune."""

    cover: CoverOptions = CoverOptions()
    carrier: CarrierOptions = CarrierOptions()
    places: PlaceOptions = PlaceOptions()
    probability: ProbabilityOptions = ProbabilityOptions()
    tour: TourOptions = TourOptions()
    work: WorkOptions = WorkOptions()
    solve_tolerance_share: float = 0.1  # of the tolerance to which arms are solved again between set-points


PARKING = ParkingOptions()
