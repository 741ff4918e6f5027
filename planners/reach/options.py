"""Numbers that tune how the reach of arms is found: how much is drawn, and how finely grids are cut.

Kernels read numbers of their modules alone, so those of kernels stand there. What is proven holds with any of
these; finer ones find more of a reach, and take longer.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class LevelOptions:
    """Reach of an arm with an upright pivot at one height: walks inside, boxes outside."""

    batch: int = 24  # postures that walks start from
    max_batches: int = 6  # the last of which is one that adds nothing
    min_gain: float = 1e-4  # of distances, that a batch adds for another to follow [m]
    max_sectors: int = 6  # walks whose azimuths are told
    min_sector_change: float = 1.0  # of azimuth between them, where they reach the same distances [rad]
    max_boxes: int = 20_000  # for an outer bound, a few microseconds each
    max_layer_boxes: int = 5_000  # for that of a layer
    layer: float = 0.01  # of heights, whose targets share a first look [m]
    max_gap: float = 1e-3  # that the outer bound may stand off from the inner one [m]
    lever_share: float = 0.3  # of the arm's length from its wrist, at which a pose fixes two points
    # An arm that cannot rise: random postures, ever nearer to the nearest and the farthest, and ways between.
    samples: int = 128
    narrowings: int = 80
    halvings: int = 60


@dataclass(frozen=True)
class PoseOptions:
    """Reach of any arm for a pose of its tool, sampled on a grid about the target."""

    samples: int = 4096  # postures of the arm, drawn once
    nearest: int = 128  # of these, that are moved to a pose
    more: int = 512  # where the reach is small, or the heading fixed
    distances: int = 18  # cells of the grid
    bearings: int = 32
    finer: tuple[int, ...] = (3, 9)  # times as many cells, while the reach is thin
    small_share: float = 0.25  # of the grid filled, below which the reach counts as small
    thin_share: float = 0.25  # of whole cells among the postures found, below which it counts as thin
    halvings: int = 3  # of an edge at the rim, the last of them by a closed form where there is one
    tolerance: float = 1e-4  # of the tool's place [m]
    angle_share: float = 0.1  # of the cone, which a posture may miss it by
    max_heading_miss: float = 0.5  # of samples about the vertical, where the heading is kept [rad]
    bearings_around: int = 48  # of a set that is the same at all bearings
    # Shares of an edge by which a cut is moved where the places there have postures
    moved_cuts: tuple[float, float] = (0.125, 0.375)


@dataclass(frozen=True)
class SquareOptions:
    """Squares of places about a pose, each with a posture that is proven to hold all over it."""

    min_half_share: float = 0.005  # of the arm's length: half the side of squares that are not quartered
    max_quarterings: int = 5  # from the first squares to the least
    max_postures: int = 3  # that are tried on a square


@dataclass(frozen=True)
class ReachOptions:
    """All of them, by what they tune."""

    level: LevelOptions = LevelOptions()
    pose: PoseOptions = PoseOptions()
    squares: SquareOptions = SquareOptions()


REACH = ReachOptions()
