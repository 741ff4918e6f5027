"""A free posture of an arm on a fixed base for a target: found, ruled out, or open.

Branch and bound over boxes of joint values (`posture_boxes`), those first whose centre is farthest from the
obstacles. Ruled out is a proof, but for rounding far below a nanometre. A posture found is checked by the
collision code of the rest of the planner. A budget of boxes bounds the work, so that the same question always
has the same answer.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from regionik.planners.collision.convex_bodies import inner_capsule
from regionik.planners.collision.distances import Obstacles, nearest_distance, obstacles_from
from regionik.planners.collision.robot_bodies import NO_CONTACT, Bodies, ContactTargets
from regionik.planners.collision.upright_solids import uprights_from
from regionik.planners.search.box_search import JUDGED, Verdict, begin, proven, reopen, verdict_of
from regionik.planners.search.motion_bounds import MAX_PARALLEL_SINE, link_capsules, longest_levers
from regionik.planners.search.posture_boxes import (
    NO_SELF_CLEARANCE,
    FixedBase,
    SelfClearance,
    explore_postures,
    fixed_base_for,
    judge_postures,
    posture_in,
)
from regionik.planners.solvers.serial_chain import SerialArm, serial_arm
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.chain import Chain
from regionik.worlds.errors import InputError
from regionik.worlds.links import LinkCapsule, LinkSolid
from regionik.worlds.obstacles import Mesh
from regionik.worlds.self_collision import base_body, off_floor, self_collision_pairs

VERDICT_NAMES = {Verdict.PROVEN: "found", Verdict.RULED_OUT: "none", Verdict.OPEN: "undecided"}
ROUNDING = 1e-9  # [m]
_BOXES_PER_REFUSAL = 100  # boxes of the budget for each posture that the exact check refuses, as it is slower


@dataclass(frozen=True, eq=False)
class FixedBaseResult:
    """Outcome of a search for a free posture."""

    verdict: Verdict  # PROVEN by a free posture, RULED_OUT, or OPEN where the budget is spent
    joints: Array | None  # (n,) the posture found [rad] or [m]
    boxes: int  # boxes of joint values judged
    # the posture's least distance from the obstacles; where none was found, the largest one among the
    # postures met that reach the target (meshes left aside), -inf where no posture was met [m]
    clearance: float


def search_fixed_base(
    chain: Chain,
    solids: Sequence[LinkCapsule],
    obstacles: Obstacles,
    target: ArrayLike,
    tolerance: float,
    clearance: float = 0.0,
    most: int = 2_000_000,
    own: SelfClearance = NO_SELF_CLEARANCE,
    accept: Callable[[Array], bool] | None = None,
) -> FixedBaseResult:
    """Search for a posture that brings the tool to a target with every link clear.

    Parameters
    ----------
    chain : Chain
        Turning joints without a limit may turn all round; others, and those that others mimic, need limits.
    obstacles : Obstacles
        In the arm's base frame. Meshes keep postures from being found, but rule no box out.
    target : (3,) array_like
        In the arm's base frame [m].
    tolerance : float
        Allowed distance of the tool from the target [m].
    clearance : float
        Of the links from the obstacles [m].
    most : int
        Budget of boxes.
    own : SelfClearance
        Of the links from each other and from a base; none by default.
    accept : callable, optional
        A further test of a posture (n,); one that fails it is not ruled out.

    Raises
    ------
    InputError
        When a number is out of its range, a solid is no capsule, or a joint lacks its limits.

    Examples
    --------
    >>> from regionik.planners.collision.distances import obstacles_from
    >>> arm = Chain.from_dh([(0, 0, 1, 0, -3, 3), (0, 0, 1, 0, -3, 3)])
    >>> search_fixed_base(arm, [], obstacles_from([]), [1.2, 0.9, 0.0], 1e-3).verdict.name
    'PROVEN'
    >>> search_fixed_base(arm, [], obstacles_from([]), [2.2, 0.9, 0.0], 1e-3).verdict.name
    'RULED_OUT'
    """
    goal = frozen(target, (3,), "target")
    _check(chain, solids, tolerance, clearance, most)
    if _out_of_reach(chain, goal, tolerance + ROUNDING):
        return FixedBaseResult(Verdict.RULED_OUT, None, 0, -np.inf)
    whole = uprights_from([piece for piece in obstacles.pieces if piece.mesh is None])
    arm, capsules = _bounded(chain), link_capsules(chain, solids)
    task = fixed_base_for(arm, capsules, whole, goal, tolerance, clearance, own)

    def checked(q: Array) -> tuple[float, bool]:
        off = np.linalg.norm(chain.forward(q)[:3, 3] - goal)
        room, met = _clearance(chain, solids, obstacles, q), bool(off <= tolerance)
        return room if met else -np.inf, met and room >= clearance and (accept is None or accept(q))

    return _first_accepted(task, checked, most)


def _first_accepted(
    task: FixedBase, checked: Callable[[Array], tuple[float, bool]], most: int
) -> FixedBaseResult:
    """Search until the exact check, of clearance [m] and acceptance, passes a posture."""
    boxes = begin(judge_postures, task, task.arm.lower[None], task.arm.upper[None])
    best, refused = -np.inf, 0
    while True:
        for slot in proven(boxes)[::-1].tolist():
            q = frozen(posture_in(task, boxes.low[slot], boxes.high[slot]), (len(task.arm.lower),), "joints")
            room, good = checked(q)
            if good:
                return FixedBaseResult(Verdict.PROVEN, q, int(boxes.tally[JUDGED]), room)
            refused, best = refused + 1, max(best, room)
            reopen(boxes, slot)
        boxes = explore_postures(task, boxes, most - _BOXES_PER_REFUSAL * refused)
        if (verdict := verdict_of(boxes)) != Verdict.PROVEN:
            room = max(best, float(task.best[0]))
            return FixedBaseResult(verdict, None, int(boxes.tally[JUDGED]), room)


def _clearance(chain: Chain, solids: Sequence[LinkCapsule], obstacles: Obstacles, q: Array) -> float:
    """Least distance of all solids, meshes included, by the collision code of the planner."""
    least, frames = np.inf, chain.frames(q)
    for solid in solids:
        frame = frames[solid.link]
        start, end = solid.corners @ frame[:3, :3].T + frame[:3, 3]
        least = min(least, nearest_distance(obstacles, start, end, solid.radius))
    return least


def _check(
    chain: Chain, solids: Sequence[LinkCapsule], tolerance: float, clearance: float, most: int
) -> None:
    if not 0 < tolerance < np.inf:
        raise InputError(f"tolerance: expected a length above 0, got {tolerance}")
    if not 0 <= clearance < np.inf:
        raise InputError(f"clearance: expected a length of 0 or more, got {clearance}")
    if most < 1:
        raise InputError(f"most: expected at least one box, got {most}")
    if chain.unbounded:
        raise InputError(f"{chain.unbounded} to be searched")
    for solid in solids:
        if len(solid.corners) != 2:
            raise InputError(
                f"{solid.name}: expected a capsule, got a solid with {len(solid.corners)} corners"
            )
        if not 0 <= solid.link < len(chain.joints):
            raise InputError(f"{solid.name}: link must be 0 to {len(chain.joints) - 1}, got {solid.link}")


def _out_of_reach(chain: Chain, target: Array, tolerance: float) -> bool:
    """True if no posture reaches the target, where lengths alone decide."""
    reach = longest_levers(chain, len(chain.joints) - 1, chain.T_last_tool[:3, 3])[1]
    far = float(np.linalg.norm(target - chain.joints[0].T_parent_joint[:3, 3]))
    if far > reach + tolerance:
        return True
    frames = chain.frames(np.zeros(chain.dof))
    axes = np.array([frame[:3, :3] @ joint.axis for frame, joint in zip(frames, chain.joints, strict=False)])
    flat = np.linalg.norm(np.cross(axes, axes[0]), axis=1).max() < MAX_PARALLEL_SINE
    gap = abs(float(axes[0] @ (target - frames[-1, :3, 3])))
    return bool(flat) and gap > tolerance and all(joint.kind == "revolute" for joint in chain.joints)


def _bounded(chain: Chain) -> SerialArm:
    """The chain with one turn at most for each turning joint."""
    arm = serial_arm(chain)
    first = np.where(np.isfinite(arm.upper), arm.upper - 2 * np.pi, -np.pi)
    lower = np.where(np.isfinite(arm.lower), arm.lower, first)
    upper = np.where(chain.turning, np.minimum(arm.upper, lower + 2 * np.pi), arm.upper)
    return arm._replace(lower=lower, upper=upper)


MAX_REDUNDANT_JOINTS = 2  # joints beyond those that the target takes, up to which a search may come to an end
MIN_LEVER = 1e-9  # a joint that moves no point farther than this does not count [m]


@dataclass(frozen=True, eq=False)
class PostureTask:
    """A target for an arm on a base that stands still among obstacles."""

    bodies: Bodies  # robot and obstacles
    base: Array  # (3,) x, y [m], yaw [rad]
    target: Array  # (3,) in the world [m]
    contact: ContactTargets | None = None  # what may be touched
    tolerance: float = 1e-3  # how far from the target the tool may be [m]
    # kept by solids from each other, from the base, and from obstacles beyond the bodies' clearance [m]
    margin: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "base", frozen(self.base, (3,), "base"))
        object.__setattr__(self, "target", frozen(self.target, (3,), "target"))


def search_postures(task: PostureTask, accept: Callable[[Array], bool], most: int) -> FixedBaseResult:
    """Search all postures of the arm by branch and bound.

    Boxes of links count as the capsules inside them; meshes, the floor, what is fixed to the base, and what
    the tool may touch at the target count as nothing. So RULED_OUT stays a proof, and ``accept`` judges
    whether a posture (dof,) that is found is clear of everything. The arm's chain must not be ``unbounded``;
    ``most`` is the budget of boxes.
    """
    bodies, robot = task.bodies, task.bodies.robot
    T = _inverse(robot.T_world_arm(task.base))
    free = (task.contact or NO_CONTACT).touchable(task.target, task.tolerance)
    solids = [
        solid.transformed(T)
        for k, solid in enumerate(bodies.obstacles)
        if k not in free and solid is not bodies.floor and not isinstance(solid, Mesh)
    ]
    inner = [inner_capsule(solid) for solid in robot.solids]
    goal = T[:3, :3] @ task.target + T[:3, 3]
    room = task.margin + bodies.clearance
    own = _self_clearance(bodies, task.margin)
    return search_fixed_base(
        robot.chain, inner, obstacles_from(solids), goal, task.tolerance, room, most, own, accept
    )


def solid_at_target(
    bodies: Bodies, target: Array, tolerance: float, margin: float, contact: ContactTargets | None
) -> str:
    """Name of the solid that the end of the last link is in, or too near to, in every posture; or empty."""
    chain, free = bodies.robot.chain, (contact or NO_CONTACT).touchable(target, tolerance)
    ends = []  # of each solid: how far the obstacle must be from the target at least, to touch nothing
    for solid, heeds in zip(map(inner_capsule, bodies.robot.solids), off_floor(bodies.robot), strict=False):
        if solid.link == len(chain.joints) - 1:
            off = np.linalg.norm(solid.corners - chain.T_last_tool[:3, 3], axis=1).min()
            ends.append((solid.radius - tolerance - float(off), heeds))
    for k, one in enumerate(bodies.obstacles):
        end = max((end for end, heeds in ends if heeds or one is not bodies.floor), default=-np.inf)
        gap, near = one.distance(target), end + margin + bodies.clearance
        if k in free:  # a tool below the surface takes its link along, deeper by as much
            near = end - bodies.depth - (tolerance if gap < 0 else 0.0)
        if gap < near - MIN_LEVER:
            return one.name
    return ""


def _self_clearance(bodies: Bodies, margin: float) -> SelfClearance:
    """The clearance of the arm from itself and its base, in the arm's base frame."""
    robot = bodies.robot
    count = len(robot.solids)
    links_only = [pair for pair in self_collision_pairs(robot) if pair[0] >= 0 and pair[1] < count]
    pairs = np.array(links_only, dtype=np.int64).reshape(-1, 2)
    links = np.array([solid.link for solid in robot.solids], dtype=np.int64)
    outwards = links[pairs[:, 0]] <= links[pairs[:, 1]]
    heeds = np.array([k for i, k in self_collision_pairs(robot) if i < 0], dtype=np.int64)
    body, T = base_body(robot), _inverse(robot.T_base_arm)
    pieces = obstacles_from([] if body is None else [body.transformed(T)]).pieces
    return SelfClearance(
        np.where(outwards[:, None], pairs, pairs[:, ::-1]), uprights_from(pieces), heeds, margin
    )


def is_searchable(chain: Chain, solids: tuple[LinkSolid, ...]) -> bool:
    """True where a search of all postures may come to an end."""
    return not chain.unbounded and _redundant_joints(chain, solids) <= MAX_REDUNDANT_JOINTS


def _redundant_joints(chain: Chain, solids: tuple[LinkSolid, ...]) -> int:
    """Number of joints that move tool or solids, less the directions in which they can move the tool."""
    points = [(len(chain.joints) - 1, chain.T_last_tool[:3, 3])]
    points += [(solid.link, end) for solid in solids for end in inner_capsule(solid).corners]
    levers = np.array([longest_levers(chain, link, point)[0] for link, point in points]).max(0)
    moving = np.abs(chain.coupling).T @ levers > MIN_LEVER
    frames = chain.frames(np.arange(1.0, chain.dof + 1.0))  # no special posture
    columns = chain.point_jacobian(frames, frames[-1, :3, 3], len(chain.joints))
    return int(moving.sum()) - int(np.linalg.matrix_rank(columns, tol=MIN_LEVER))


def _inverse(T: Array) -> Array:
    inverse = np.eye(4)
    inverse[:3, :3], inverse[:3, 3] = T[:3, :3].T, -T[:3, :3].T @ T[:3, 3]
    return inverse
