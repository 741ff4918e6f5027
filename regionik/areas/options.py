"""Numbers that tune areas: how finely headings, arcs and shadows are cut.

Inner areas that are proven are inside the true ones, and outer ones outside, with any of these; finer ones
are nearer to them and take longer.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class AreaOptions:
    """All of them."""

    heading_slabs: int = 24  # of equal width in a full turn
    max_wall_directions: int = 4  # the longest: slabs end where a side of the footprint is along one
    # Of an outline's distances from the arm axis, that gains nothing by slabs [m]
    max_round_deviation: float = 0.01
    arc_points: int = 48  # vertices of a full circle
    fine_arc_points: int = 768  # in fine areas
    lift_step: float = 0.05  # to which ranges of lifts are widened, so that heights share their rejection [m]
    log2_samples: int = 14  # postures drawn where reach is sampled, as a power of two
    min_clear_postures: int = 100  # of these, clear of the robot itself: nothing is learnt of fewer
    # Large maps and shadows are cut to what is looked at; to cut small ones takes longer than it saves.
    min_cut_vertices: int = 400  # of shapes
    max_whole_vertices: int = 12  # of shadows that are left whole
    min_cut_solids: int = 500  # of worlds
    min_cut_corners: int = 100  # of a map's blob
    kept_width: float = 0.25  # around what is looked at, on all sides [m]
    max_driven: float = 2.0  # beyond what it reaches, by a base about a path: farther solids are left out [m]


AREAS = AreaOptions()
