"""Numbers that tune searches for paths of a base: how much is tried before a path is good enough."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class DrivingOptions:
    """Paths by RRTConnect and shortcuts, and through slabs of heading where these give up or wind."""

    max_iterations: int = 8000  # of RRTConnect in an attempt
    max_attempts: int = 3  # of which the cheapest is kept
    # Of the shortest path if nothing were in the way, up to which no other attempt is made
    short_cost_ratio: float = 1.25
    shortcut_poses: tuple[int, ...] = (24, 31, 40)  # along a path, between which shortcuts are tried, in turn
    turn_weight: float = 0.2  # of a turn on the spot, against driving [m/rad]
    heading_slabs: int = 48
    good_cost_ratio: float = 1.1  # a path at most so much dearer than another one is as good
    passage_halvings: int = 24  # of the bisection for the narrowest passage


DRIVING = DrivingOptions()
