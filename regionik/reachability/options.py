"""Numbers that tune what is told of the reach of targets: how much is searched, and how finely.

None of them decides what is true: with less a target is left undecided, with more it takes longer.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SearchOptions:
    """Searches of all postures of an arm at one target."""

    # From any base
    max_cells: int = 200_000  # of postures
    min_cells: int = 64  # of any such search: those that it may begin with
    known_cell: float = 0.05  # of distance and height, in which one posture is kept to begin with [m]
    targets_at_once: int = 500  # that a worker is given
    # Of a task in which one set-point lacks a clear posture, as each takes seconds: those that are asked, and
    # those not reached after which no more are
    max_setpoints_asked: int = 60
    max_setpoints_unreached: int = 40
    # From one base
    max_known_postures: int = 32  # of those that the arm knows, that are led on to the target
    max_held_cells: int = 4_000  # of postures of an arm in one plane
    max_held_boxes: int = 8_000  # of any other


@dataclass(frozen=True)
class ConfigurationOptions:
    """Search for a configuration with the base in an area, or held."""

    max_places: int = 12  # of the base, in an area where the arm touches something
    max_pitches: int = 24  # of the last link, at every place
    max_measured: int = 4  # postures at one place that touch something, whose distances are measured
    max_colliding: int = 400  # of these in all, after which no other place is tried
    max_sampled_places: int = 2  # where more postures of the arm are sampled
    max_samples: int = 50  # of them at each
    max_reach_postures: int = 24  # of those that a thin reach was sampled from, spread over all
    pivot_values: int = 7  # at which each of these is tried, where the base may turn for the pivot
    max_overlap: float = (
        0.1  # of the posture met there, beyond which none is: those that helped had 0.013 m [m]
    )


@dataclass(frozen=True)
class RefinementOptions:
    """Bisection of headings and tilts, where areas over wide spans of them leave a target undecided."""

    max_cells: int = 240
    first_cells: int = 8  # that a full turn is cut in, where it does not do as a whole
    min_cell_width: float = 1e-4  # narrower ones are not bisected [rad]
    min_disc: float = 1e-4  # in what a cell leaves open: smaller ones are not bisected [m]
    narrow_cell: float = 0.02  # from which on finer polygons for discs are worth their time [rad]
    disc_sides: int = 48
    narrow_disc_sides: int = 384
    max_rotated_share: float = 1.05  # of the circle round a footprint, by polygons round its rotations
    max_tries: int = 16  # inner areas that are searched for a configuration


@dataclass(frozen=True)
class FieldOptions:
    """Fields and slices of reach: grids of the floor."""

    max_cells: int = 40_000_000  # a matter of memory
    headings: int = 8  # of the best place, where the base has room to turn
    block: int = 8  # cells across, whose distance from a piece of floor is asked at once
    targets_at_once: int = 2000  # whose areas are made


@dataclass(frozen=True)
class ReachabilityOptions:
    """All of them, by what they tune."""

    search: SearchOptions = SearchOptions()
    configurations: ConfigurationOptions = ConfigurationOptions()
    refinement: RefinementOptions = RefinementOptions()
    field: FieldOptions = FieldOptions()


REACHABILITY = ReachabilityOptions()
