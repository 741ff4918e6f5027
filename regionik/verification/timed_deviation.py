"""How far a timed motion may leave the proven one between the same states, bounded at every moment.

Proven are joints that move evenly from state to state, and a base that slides straight or rolls along an arc.
On a timed segment what moves most has come a share of its way; what any other coordinate is off that same
share of its own is a polynomial of time, and lies between the Bernstein coefficients of that.
"""

from __future__ import annotations

import numpy as np

from regionik.values import Violation
from regionik.verification.motion import MotionSegments
from regionik.verification.proofs import Finding, StateNames, finding
from regionik.verification.timed_segments import TimedSegments, bernstein_parts
from regionik.worlds.arrays import Array
from regionik.worlds.robot import Robot

BEYOND = 10.0  # times `Speeds.blend` to which bounds may come: they add up what all joints are off


def verify_deviation(
    segments: MotionSegments, course: TimedSegments, names: StateNames, blend: float, cone: float
) -> Finding:
    """No point of the robot leaves the proven motion by much more than the blend [m].

    The tool turns from it by no more than the narrowest ``cone`` [rad].
    """
    most = BEYOND * blend
    off = deviations(segments, course, most / cone)
    violations = [
        Violation(
            "timing", int(k), names.owner(int(k)), float(far - most),
            f"the timed motion may be {far:.4g} m off the one that is proven {names.segment(int(k))}",
        )
        for k, far in zip(course.moving.tolist(), off.tolist(), strict=True) if far > most
    ]  # fmt: skip
    return finding("timing", most - float(off.max(initial=0.0)), violations)


def deviations(segments: MotionSegments, course: TimedSegments, pointer: float) -> Array:
    """Upper bounds for how far points are off the proven motion, on each polynomial (moving,) [m].

    Points are those of all solids, and of lines as long as a ``pointer`` from the tool's point [m].
    """
    k, motion, robot = course.moving, course.polynomials, segments.robot
    levers = _levers(segments, pointer)
    coordinates = np.concatenate([motion.base, motion.joints], axis=2)
    change = course.change[k]
    leading = np.argmax(np.abs(change) * levers, axis=1)[:, None]
    share = np.take_along_axis(coordinates, leading[:, None], axis=2)
    share = share / np.take_along_axis(change, leading, axis=1)[:, None]
    off = _largest((coordinates - share * change[:, None]) * levers)
    beyond = np.maximum(_largest(2 * share - np.eye(1, share.shape[1]).T) - 1, 0.0) / 2
    found: Array = off + beyond * (np.abs(change) @ levers)
    if robot.drive.rolls:  # the way rolled goes where the heading points
        turned = _largest(coordinates[..., 1:2] - share * change[:, None, 1:2])
        found = found + _largest(motion.slip) + turned * (1 + 2 * beyond) * np.abs(change[:, 0])
    return found


def _levers(segments: MotionSegments, pointer: float) -> Array:
    """Upper bounds for the motion of any point by a unit of each coordinate of base and arm, (k,) [m]."""
    robot = segments.robot
    chain, n = robot.chain, len(robot.chain.joints)
    radii = np.zeros(n)
    for solid in robot.solids:
        farthest = float(np.linalg.norm(solid.corners, axis=1).max()) + solid.radius
        radii[solid.link] = max(radii[solid.link], farthest)
    radii[-1] = max(radii[-1], float(np.linalg.norm(chain.T_last_tool[:3, 3])) + pointer)
    by_joint, far = np.zeros(n), 0.0
    slides = np.abs(chain.joint_values(segments.motion.joints)).max(axis=0, initial=0.0)
    for k in reversed(range(n)):
        far = max(far, float(radii[k]))
        turns = chain.joints[k].kind == "revolute"
        by_joint[k] = far if turns else 1.0
        far += float(np.linalg.norm(chain.joints[k].T_parent_joint[:3, 3])) + (0.0 if turns else slides[k])
    by_turn = max(far + float(np.hypot(*robot.mount[:2])), _farthest_of_base(robot))
    return np.array([*[1.0] * (1 if robot.drive.rolls else 2), by_turn, *np.abs(chain.coupling).T @ by_joint])


def _farthest_of_base(robot: Robot) -> float:
    """Distance of the base's farthest point from its origin [m]."""
    corners = [robot.footprint, *(solid.corners[:, :2] for solid in robot.base_solids)]
    thick = max((solid.radius for solid in robot.base_solids), default=0.0)
    return float(np.linalg.norm(np.concatenate(corners), axis=1).max()) + thick


def _largest(polynomials: Array) -> Array:
    """Upper bounds for the sums of sizes of k polynomials (m, n, k) from 0 to 1, (m,)."""
    bounds = np.zeros(len(polynomials))
    for values in bernstein_parts(polynomials):
        bounds = np.maximum(bounds, np.abs(values).sum(axis=2).max(axis=1))
    return bounds
