"""Numbers that tune the work of `verify`: how finely motions are cut, and how much is tried.

With coarser ones less is proven, so that a plan fails that may be good; no plan passes that a finer one would
refuse, but for promises that are drawn. What is let pass is in `tolerances`.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ProofOptions:
    """Motions between states, bisected until each part is proven or refuted."""

    # Half an interval over which nothing moves farther is not bisected: it counts as not proven.
    min_motion: float = 1e-4  # of a link or the tool [m] or [rad]
    min_base_motion: float = 1e-6  # of the footprint [m]
    intervals_at_once: int = 8192  # a matter of memory
    corners_at_once: int = 1_000_000  # times segments, likewise
    max_violations: int = 20  # of a kind that are told one by one
    margin_range: float = 0.05  # beyond what is asked, up to which distances at states are measured [m]
    speed_parts: int = 16  # of a piece of a timed motion, each with bounds of its own


@dataclass(frozen=True)
class SolidOptions:
    """Solids of the world, the large ones cut to what is near, and depths in them."""

    min_many: int = 500  # solids, or corners of one, of which those far from the motion are left out
    cell: float = 1.0  # to which places on the floor are rounded up, at least this far beyond the arm [m]
    box_depth_step: float = 1e-8  # to which depths of boxes in meshes are found [m]
    contact_depth_step: float = 1e-6  # and those of contacts [m]
    max_depth: float = 1.0  # in a mesh that is told [m]
    min_shrunk_share: float = 1e-3  # of the size of a hull that is shrunk, so that it stays a solid
    capsule_spheres: int = 33  # that cover one


@dataclass(frozen=True)
class PostureOptions:
    """Postures on a target, by damped least squares."""

    iterations: int = 40
    damping: float = 1e-3
    max_step: float = 0.3  # of a joint [rad] or [m]
    close_share: float = 0.05  # of the tolerance, at which iterations end, in metres as in radians


@dataclass(frozen=True)
class StopOptions:
    """What stops promise: work from all round the parking circle, and after parkings that are drawn."""

    rim_points: int = 8  # of a circle, where the arm is tried
    rim_steps: int = 4  # on the way out to each, each posture the start of the next
    max_restarts: int = 32  # from random postures, where the one led on fails
    max_parkings: int = 512  # after which the room of the base is looked at
    min_parkings: int = 64  # after which the arm is tried too
    max_parked_arms: int = 256  # targets that it is tried at, in all, but for these
    min_chance: float = 3e-5  # of as few good parkings as were counted, below which a promise does not hold


@dataclass(frozen=True)
class VerificationOptions:
    """All of them, by what they tune."""

    proofs: ProofOptions = ProofOptions()
    solids: SolidOptions = SolidOptions()
    postures: PostureOptions = PostureOptions()
    stops: StopOptions = StopOptions()


VERIFICATION = VerificationOptions()
