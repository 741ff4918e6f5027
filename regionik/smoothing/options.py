"""Numbers that tune smoothing: how finely motions are laid out, and how often a smoothed one is tried.

None of them decides what is true of a motion: each one is verified, and where none holds the plan keeps its
own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class LayoutOptions:
    """States along a run, laid out to be smoothed."""

    min_run_states: int = 3
    max_states: int = 1500  # smoothed at once
    # A run of so many states is begun with its set-points alone, unless they are more than a share of them.
    min_long_run: int = 400
    max_setpoint_share: float = 0.6
    near_trust: float = 0.03  # of the first round, where it was begun with fewer states [m] or [rad]
    max_near_distance: float = 0.025  # set-points farther apart have a state between them [m]
    min_stride: float = 1e-3  # along the path, where the tool rests or nearly so [m]
    step_share: float = 0.7  # of the longest step of the base, that it takes in the mean
    base_share: float = 0.4  # of the base's way that counts as way along the path, where the tool rests
    min_corner_turn: float = 0.7  # of the tool's path [rad]
    max_limit_change: float = 0.3  # of a coordinate, in a state that is led off its limits [m] or [rad]
    # About states that failed: those on either side smoothed anew, and what leaving areas costs there
    window: int = 40
    stiffer_area_cost: float = 30.0


@dataclass(frozen=True)
class SmoothingTrialOptions:
    """Smoothed plans that are tried until one holds."""

    # Of the tool from state to state, the first on long paths alone; where these fail those found may do [m]
    strides: tuple[float, ...] = (0.05, 0.025, math.inf)
    long_path: float = 10.0  # [m]
    max_tries: int = 7
    spare_distance: float = 0.005  # that states are asked for beside one that fails [m]
    states_beside: int = 6  # on either side of one that fails, which are held closer
    narrowing_factor: float = 0.5  # by which they are


@dataclass(frozen=True)
class SmoothingOptions:
    """All of them, by what they tune."""

    layout: LayoutOptions = LayoutOptions()
    trials: SmoothingTrialOptions = SmoothingTrialOptions()


SMOOTHING = SmoothingOptions()
