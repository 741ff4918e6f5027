"""Numbers that tune inverse kinematics and roadmaps of an arm: how much is tried, and how finely.

None of them decides what is true of a posture. More of each finds postures and ways where there were none,
and takes longer.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SolverOptions:
    """Solvers that bring an arm to a goal."""

    max_passes: int = 100  # from each start
    max_restarts: int = 10
    max_carry_steps: int = 60  # of damped least squares, when a posture is carried along
    max_other_starts: int = 48  # of other postures, where one cannot be led to meet the criteria
    max_nearest: int = (
        6  # postures of the reach that are tried where passes and restarts do not meet a target
    )
    same_posture: float = 0.05  # postures that differ by less in every joint are one [rad]
    pitch_samples: int = 41  # within a cone, of an arm in one vertical plane
    distance_samples: int = 50  # of its base from the target, on a free floor


@dataclass(frozen=True)
class PostureSearchOptions:
    """Clear postures at set-points from one base pose, each led on from others."""

    max_neighbors: int = 8  # targets that a posture is led on to
    max_starts: int = 4  # that the search at a target begins from
    pose_samples: int = 60  # postures tried about one that touches something, for a pose


@dataclass(frozen=True)
class RoadmapOptions:
    """Roadmaps of an arm on a fixed base."""

    drawn_postures: int = 300  # at random, for the arm alone
    max_tries: int = 4  # straight motions to a posture that are looked at
    max_stride: float = 1.0  # of RRTConnect, metres and radians together
    max_iterations: int = 1000  # of RRTConnect to a posture that no straight motion joins
    max_way_iterations: int = 300  # of RRTConnect for a way that may be shorter
    good_length_ratio: float = 1.5  # times the straight motion is short enough


@dataclass(frozen=True)
class ArmOptions:
    """All of them, by what they tune."""

    solver: SolverOptions = SolverOptions()
    search: PostureSearchOptions = PostureSearchOptions()
    roadmap: RoadmapOptions = RoadmapOptions()


POSTURES = ArmOptions()
