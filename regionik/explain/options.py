"""Numbers that tune the search for what would help: which changes are tried, and how finely.

None of them decides whether a change helps: each is confirmed by the stage that refused. More of each finds
smaller changes, or some where there were none, and takes longer.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class AmountOptions:
    """The least amount of a change, or the shortest step, that helps."""

    scan_steps: int = 64  # of a first scan, as more of a change need not help more
    refined_steps: int = 16  # between one that does not help and one that does, again and again
    recheck_share: float = 0.01  # of an amount found, by which all that is below it is scanned once more
    missed_share: float = 0.02  # by which the least that holds may be missed where a test is slow
    confirmed_share: float = 0.97  # of an amount that holds, asked for too before that is taken
    # On what areas ask for, in turn, as the arm may ask for somewhat more.
    growth: tuple[float, ...] = (1.0, 1.01, 1.03, 1.06, 1.12, 1.25, 1.5, 2.0)
    steps_per_direction: int = 24  # of a scan along many directions at once
    max_close_directions: int = 4  # that are searched closely, of the foremost
    turns: tuple[float, ...] = (0.4, 0.2, 0.1, 0.05, 0.02)  # of the best direction, to better it [rad]
    slow_lengths: int = 6  # of steps, at which a slow test is made
    max_slow_tests: int = 8  # at about each of them


@dataclass(frozen=True)
class QuestionOptions:
    """Questions about a target, its arm, or a whole path."""

    proof_cells: int = 30_000  # of postures, looked at to prove a cause
    search_cells: int = 1_500  # and to find a posture with a change
    # Of moves that are tried with the arm [m]
    arm_move_lengths: tuple[float, ...] = (0.01, 0.03, 0.09, 0.27, 0.81)
    aside_factor: float = 1.05  # on a step by areas: where the arm needs more, others beside it are looked at
    plan_factors: tuple[float, ...] = (1.0, 1.05)  # on an amount by areas, tried in plans
    max_arm_steps: int = 4  # of one length that are asked with the arm, which takes seconds
    # Of steps of a target in space: the areas of an arm are those of one height, so each is tried.
    target_lengths: tuple[float, ...] = (0.05, 0.1, 0.15, 0.25, 0.4, 0.6, 1.0)  # [m]
    # Where areas are sampled, pose by pose [m]
    sampled_target_lengths: tuple[float, ...] = (0.1, 0.25, 0.6, 1.0)


@dataclass(frozen=True)
class PairOptions:
    """Two changes together: small ones, with each of which another is looked for."""

    amounts: tuple[float, ...] = (0.1, 0.3)  # [m] or [rad]
    directions: int = 8  # in which an obstacle is moved


@dataclass(frozen=True)
class TrialOptions:
    """Changes that are tried by planning again, where only a search has refused."""

    # Of a clearance, or of the radius of the circle to park in
    given_up_shares: tuple[float, ...] = (0.5, 1.0)
    move_lengths: tuple[float, ...] = (0.1, 0.3)  # [m]
    spare_tries: int = 100  # of searches, beside as many as half of those of the search that failed
    tries_per_setpoint: int = 2  # besides, of plans from a start that is mended
    max_planned_repairs: int = 2  # the smallest, with which the whole path is planned
    # Set-points of a path that is asked about where the part of it that failed can be planned
    max_whole_path: int = 4
    start_spare: float = 1e-3  # beyond what frees a start, so that the base can drive off [m]
    max_start_move: float = 2.0  # of the base or an obstacle [m]


@dataclass(frozen=True)
class ExplainOptions:
    """All of them, by what they tune."""

    amounts: AmountOptions = AmountOptions()
    questions: QuestionOptions = QuestionOptions()
    pairs: PairOptions = PairOptions()
    trials: TrialOptions = TrialOptions()
    grid: float = 1e-4  # of amounts, so that what is printed is what was checked [m] or [rad]
    min_gap: float = 1e-3  # of floor for the base: a narrower one is rounding of the floor [m]
    width_tolerance: float = 1e-4  # of the widest place of a floor [m]
    max_places_asked: int = 8  # the largest that are cut off, for a way between them
    max_listed: int = 12  # numbers of set-points, or spans of them, in a sentence


EXPLAIN = ExplainOptions()
