"""Numbers that tune plain geometry: how round offsets are, and how finely pieces are cut.

What is said to be inside or outside is, with any of them.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class OffsetOptions:
    """Shapes grown and shrunk by a distance, and circles that fit in them."""

    quadrant_segments: int = 12  # of an arc
    shallow_share: float = 0.01  # of the distance: how deep bays may be that are filled
    max_halvings: int = 5  # of sides of an offset that are not seen to be as near as they should be
    max_easings: int = 6  # times that GEOS is asked for less, before nothing is grown or taken away
    easing: float = 1.2  # times what an offset reaches too far, by which less is asked for
    shrinkage: float = 0.7  # of a circle for which something does not hold
    min_circle: float = 1e-4  # radius below which it is only its middle [m]
    depth_error: float = 1e-5  # by which the distance of a place from an edge may be told too small [m]
    # That are halved: on a ridge, as far from the edge all along, more tell nothing new
    max_squares: int = 300


@dataclass(frozen=True)
class ConeOptions:
    """Directions within a cone, as pitches at ever wider swings."""

    # What pitches may leave out of those at the next smaller swing: a share of the cone, within bounds.
    left_out_share: float = 1 / 6
    min_left_out: float = 0.02  # [rad]
    max_left_out: float = 0.1  # [rad]
    min_swing_share: float = 1 / 64  # of the widest swing, below which two are not parted


@dataclass(frozen=True)
class GeometryOptions:
    """All of them, by what they tune."""

    offsets: OffsetOptions = OffsetOptions()
    cones: ConeOptions = ConeOptions()
    max_piece_corners: int = 16  # of convex pieces, as collision checks take each of them
    rolling_rounds: int = 10  # of Newton's method, for states of wheels that do not slip
    rolling_length_cost: float = 1e-6  # of motion itself, against its bending


GEOMETRY = GeometryOptions()
