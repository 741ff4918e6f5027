"""FABRIK with obstacle avoidance: two steps for every link that a pass lays into an obstacle.

The link is first aligned with its joint and the root (forward reaching) or the target (backward reaching). If
it still meets an obstacle it is rotated at random about its joint, and of the rotations that free it the
smallest is kept. Source: Tao et al. (2021), section 4; steps are numbered as in its procedure. The passes
here are those of FABRIK-R on rigid bodies, so that the arm may have any joints, in the plane or in space.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from regionik.planners.collision.distances import keeps_apart
from regionik.planners.collision.robot_bodies import NO_CONTACT, Bodies, ContactTargets
from regionik.planners.collision.robot_motion import BASE
from regionik.planners.geometry.angles import wrap
from regionik.planners.solvers.fabrikr import (
    Posture,
    backward_choice,
    backward_place,
    clamped_turn,
    forward_choice,
    forward_place,
    forward_start,
    place_behind,
    posture_of,
)
from regionik.planners.solvers.rigid_bodies import RigidBodies, arm_model
from regionik.planners.solvers.serial_chain import rotate_about
from regionik.worlds.arrays import Array, Index
from regionik.worlds.chain import Chain
from regionik.worlds.links import LinkHull
from regionik.worlds.polytopes import Polytope

MAX_ITERATIONS = 100  # as in the paper
_ROTATIONS = 10  # random rotations tried for one link, as in the paper
ROUNDING = 1e-9  # [rad]

LinkClear = Callable[[int, Array], bool]


@dataclass(frozen=True, eq=False)
class AvoidanceResult:
    """Outcome of FABRIK with obstacle avoidance."""

    joints: Array  # (dof,)
    error: float  # distance of the tool from the target [m]
    iterations: int  # passes, each forward and backward
    converged: bool  # the tool is on the target and every link was clear in the last backward pass


def avoid_obstacles(
    chain: Chain,
    target: Array,
    joints: Array,
    clear: LinkClear,
    *,
    tolerance: float,
    seed: int,
    most: int = MAX_ITERATIONS,
    rotations: int = _ROTATIONS,
) -> AvoidanceResult:
    """Bring the tool to a target with every link clear.

    Parameters
    ----------
    target : (3,) array
        In the arm's base frame [m].
    joints : (dof,) array
        Posture to start from, whether clear or not.
    clear : callable
        Whether link k may be at a pose (4, 4) in the arm's base frame.
    tolerance : float [m]
    seed : int
        Of the random rotations: same input, same answer.
    most, rotations : int
        Iterations, and random rotations tried for one link.
    """
    rng = np.random.default_rng(seed)
    passes = _AvoidingPasses(chain, target, joints, clear, lambda: rng.uniform(-np.pi, np.pi, rotations))
    error = np.inf
    for iteration in range(1, most + 1):
        passes.reach_forward()  # step 3
        clear_links = passes.reach_backward()  # step 4
        error = float(np.linalg.norm(passes.posture.outer[-1] - target))
        if error < tolerance and clear_links:  # step 5
            return AvoidanceResult(passes.joints, error, iteration, True)
    return AvoidanceResult(passes.joints, error, most, False)


class _AvoidingPasses:
    """Forward and backward reaching of one arm, its links checked and rotated by angles that are drawn."""

    def __init__(
        self, chain: Chain, target: Array, joints: Array, clear: LinkClear, draw: Callable[[], Array]
    ) -> None:
        self.bodies: RigidBodies = arm_model(chain).pointing
        self.posture: Posture = posture_of(self.bodies, np.asarray(joints, dtype=np.float64))
        self.target = np.asarray(target, dtype=np.float64)
        self.count = len(self.bodies.slide)
        self.rest = np.array(joints[self.count :], dtype=np.float64)
        self.link_clear, self.draw = clear, draw
        frames = chain.frames(self.joints)
        # Origin of each link seen from the far end of its body; links beyond the last body ride on it.
        ends = self.posture.inner[1:]
        self.origin = [self.posture.turns[k].T @ (frames[k, :3, 3] - ends[k]) for k in range(self.count)]
        last = np.linalg.inv(frames[self.count - 1])
        self.riders = [(k, last @ frames[k]) for k in range(self.count, chain.dof)]

    @property
    def joints(self) -> Array:
        return np.concatenate([self.posture.joints, self.rest])

    def reach_forward(self) -> None:
        """Step 3: from the target to the root."""
        last = self.count - 1
        forward_start(self.bodies, self.target, self.posture)
        if not self._clear(last):
            upright = self.posture.turns[last].copy()
            self._avoid(last, self._alignment(last, forward=True), lambda angle: self._roll(upright, angle))
        for k in range(last, 0, -1):
            value = forward_choice(self.bodies, k, self.posture)
            forward_place(self.bodies, k, value, self.posture)
            if not self._clear(k - 1):
                # The body behind a joint turns against it.
                angle = -self._alignment(k - 1, forward=True)
                self._avoid(k - 1, angle, self._rotation(k, value, forward_place))

    def reach_backward(self) -> bool:
        """Step 4: from the root to the tool; whether every link ended up clear."""
        clear = True
        for k in range(self.count):
            value = backward_choice(self.bodies, k, self.posture)
            backward_place(self.bodies, k, value, self.posture)
            if not self._clear(k):
                angle = self._alignment(k, forward=False)
                clear &= self._avoid(k, angle, self._rotation(k, value, backward_place))
        return clear

    def _avoid(self, body: int, alignment: float, rotate: Callable[[float], bool]) -> bool:
        """Steps 3.3-3.5, 4.3-4.5: align; else the smallest drawn rotation that frees; else stay aligned."""
        aligned = rotate(alignment)
        if aligned and self._clear(body):
            return True
        start = alignment if aligned else 0.0
        drawn = self.draw()
        for angle in drawn[np.argsort(np.abs(drawn), kind="stable")].tolist():
            if rotate(start + angle) and self._clear(body):
                return True
        rotate(start)
        return False

    def _rotation(self, k: int, value: float, place: Callable[..., None]) -> Callable[[float], bool]:
        """Make a function that moves joint k off a value by an angle, where its limits allow that."""
        arm, now = self.bodies.arm, float(value)

        def rotate(angle: float) -> bool:
            wanted = now + angle
            if not arm.revolute[k]:  # a slide goes over its travel, as far as it has ends
                travel = float(arm.upper[k] - arm.lower[k])
                wanted = now + angle / np.pi * (travel if np.isfinite(travel) else 0.0)
            value = clamped_turn(wanted, now, arm.lower[k], arm.upper[k]) if arm.revolute[k] else wanted
            if abs(wrap(value - wanted)) > ROUNDING or not arm.lower[k] <= value <= arm.upper[k]:
                return False
            place(self.bodies, k, value, self.posture)
            return True

        return rotate

    def _roll(self, upright: Array, angle: float) -> bool:
        """Rotate the last body about its own axis through the target."""
        last, spin = self.count - 1, np.empty((3, 3))
        rotate_about(upright @ self.bodies.arm.axis[self.bodies.last], angle, spin)
        self.posture.turns[last][:] = spin @ upright
        place_behind(self.bodies, last, self.posture)
        return True

    def _alignment(self, body: int, *, forward: bool) -> float:
        """Angle about its joint that aligns a body with the joint and the root, or the target."""
        posture, arm = self.posture, self.bodies.arm
        joint = min(body + 1, self.count - 1) if forward else body
        if not arm.revolute[joint]:
            return 0.0
        axis = posture.turns[joint] @ arm.axis[joint]
        ends = posture.inner if forward else posture.outer
        pivot, end = (ends[body + 1], ends[body]) if forward else (ends[body], ends[body + 1])
        link, line = end - pivot, (self.bodies.root if forward else self.target) - pivot
        link, line = link - (link @ axis) * axis, line - (line @ axis) * axis
        return float(np.arctan2(axis @ np.cross(link, line), link @ line))

    def _clear(self, body: int) -> bool:
        """True if a body, and what rides on it, is clear where it is."""
        T = np.eye(4)
        T[:3, :3] = self.posture.turns[body]
        T[:3, 3] = self.posture.inner[body + 1] + T[:3, :3] @ self.origin[body]
        if not self.link_clear(body, T):
            return False
        return body < self.count - 1 or all(self.link_clear(k, T @ ride) for k, ride in self.riders)


class _Near(NamedTuple):
    """Surroundings of one solid of a link, all of them in one frame."""

    corners: Array  # (k, 3) of the solid, in its link's frame [m]
    # hull of the corners, where it is known: made anew at each pose it takes milliseconds
    own: Polytope | None
    apart: float  # between those corners' hull and each piece [m]
    T: Array  # (4, 4) frame of the pieces <- the arm's base frame
    rows: Index  # of the pieces


def links_clear(
    bodies: Bodies, base: Array, tool: Array, margin: float, contact: ContactTargets | None = None
) -> Callable[[int, Array], bool]:
    """Make a check whether a link may be at a pose, for an arm on a base that stands still.

    Within a pass the links do not hang together, so they are not checked against each other.

    Parameters
    ----------
    base : (3,) array
        x, y [m], yaw [rad].
    tool : (3,) array
        Where the tool is going to be, in the world: it decides what may be touched [m].
    margin : float
        From the base, and from obstacles beyond the bodies' clearance [m].
    """
    robot = bodies.robot
    T_world_arm, around = robot.T_world_arm(base), whole_pieces(bodies)
    links: list[list[_Near]] = [[] for _ in robot.chain.joints]
    for k, solid in enumerate(robot.solids):
        free = (contact or NO_CONTACT).touchable(tool) if bodies.links.outermost[k] else []
        checked = around[bodies.links.pairs[k, around]]
        work = np.isin(bodies.hulls.owner[checked], free)
        own = np.flatnonzero(bodies.links.pairs[k] & (bodies.hulls.frame == BASE))
        corners, apart = solid.corners, solid.radius + margin
        whole = solid.polytope if isinstance(solid, LinkHull) else None
        core = bodies.links.core[slice(*bodies.links.first[k : k + 2])]
        least = float(bodies.links.core_radius[k])
        links[solid.link] += [
            _Near(corners, whole, apart + bodies.clearance, T_world_arm, checked[~work]),
            _Near(core, None, least, T_world_arm, checked[work]),
            _Near(corners, whole, apart, bodies.mobile.mount, own),
        ]
    return lambda link, T_arm_link: all(_clear(bodies, near, T_arm_link) for near in links[link])


def whole_pieces(bodies: Bodies) -> Index:
    """Rows of the world's pieces, each once, without the rows of a mesh's triangles."""
    rows, row = [], 0
    while row < bodies.hulls.world:
        rows.append(row)
        row = int(bodies.hulls.next[row])
    return np.array(rows, dtype=np.int64)


def _clear(bodies: Bodies, near: _Near, T_arm_link: Array) -> bool:
    T = near.T @ T_arm_link
    corners = near.corners @ T[:3, :3].T + T[:3, 3]
    boxes, low, high = bodies.hulls.boxes[near.rows], corners.min(0), corners.max(0)
    meet = (low - near.apart <= boxes[:, 1]).all(1) & (boxes[:, 0] <= high + near.apart).all(1)
    if not meet.any():
        return True
    own = None if near.own is None else near.own.moved(T)
    rows = near.rows[meet].tolist()
    return all(keeps_apart(bodies.pieces[m], corners, near.apart, own) for m in rows)
