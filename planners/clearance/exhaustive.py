"""Whether an arm on a fixed base has any free posture for a target: found, none, or undecided.

Branch and bound over boxes of joint values, the most promising box first. "None" is a proof, but for rounding
far below a nanometre: bounds that hold for every posture of a box ruled out each one (`planners.sway`,
`planners.branching`). "Found" carries a posture that other code has checked. A budget of boxes bounds the
work, so the same question always has the same answer.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from regionik.planners.clearance.branching import DONE, FOUND, FULL, SPENT, Boxes, admit, explore
from regionik.planners.clearance.ownbody import NO_OWN, Own
from regionik.planners.clearance.postures import Task, scratch_for
from regionik.planners.geometry.collision import Obstacles, capsule_distance
from regionik.planners.geometry.upright import uprights_from
from regionik.planners.reach.sway import PARALLEL, bones_from, longest_levers
from regionik.planners.solvers.serial_chain import SerialArm, serial_arm
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.chain import Chain
from regionik.worlds.errors import InputError
from regionik.worlds.robot import LinkCapsule

FIRST_SLOTS = 1024  # for boxes; doubled when they are full
ROUNDING = 1e-9  # [m]
PER_REFUSAL = 100  # boxes of the budget for each posture that the exact check refused: it is that much slower


@dataclass(frozen=True, eq=False)
class Verdict:
    """What a search came to.

    Attributes
    ----------
    kind : {"found", "none", "undecided"}
        A free posture, a proof that there is none, or a budget spent.
    joints : (n,) array or None
        The posture found [rad] or [m].
    boxes : int
        Boxes of joint values weighed.
    clearance : float
        The posture's least distance from the obstacles; where none was found, the largest one among the
        postures met that reach the target (meshes left aside), -inf where no posture was met [m].
    note : str
        One line in words.
    """

    kind: Literal["found", "none", "undecided"]
    joints: Array | None
    boxes: int
    clearance: float
    note: str


def search(
    chain: Chain,
    solids: Sequence[LinkCapsule],
    obstacles: Obstacles,
    target: ArrayLike,
    tolerance: float,
    clearance: float = 0.0,
    most: int = 2_000_000,
    own: Own = NO_OWN,
    accept: Callable[[Array], bool] | None = None,
) -> Verdict:
    """Decide whether any posture brings the tool to a target with every link clear.

    Parameters
    ----------
    chain : Chain
        Turning joints without a limit may turn all round; sliding joints need both limits.
    solids : sequence of LinkCapsule
        Solids of the links.
    obstacles : Obstacles
        In the arm's base frame. Meshes keep postures from being found, but rule no box out.
    target : (3,) array_like
        In the arm's base frame [m].
    tolerance : float
        How far from the target the tool may be [m].
    clearance : float
        Least distance of the links from the obstacles [m].
    most : int
        Budget of boxes.
    own : Own
        What the solids keep from each other and from a base; nothing by default.
    accept : callable, optional
        What else a posture (n,) must pass to be found; what it refuses is not ruled out by that.

    Returns
    -------
    Verdict

    Raises
    ------
    InputError
        When a number is out of its range, a solid is no capsule, or a sliding joint has no limit.

    Examples
    --------
    >>> from regionik.planners.geometry.collision import obstacles_from
    >>> from regionik.worlds.chain import chain_from_dh
    >>> arm = chain_from_dh([(0, 0, 1, 0, -3, 3), (0, 0, 1, 0, -3, 3)])
    >>> search(arm, [], obstacles_from([]), [1.2, 0.9, 0.0], 1e-3).kind
    'found'
    >>> search(arm, [], obstacles_from([]), [2.2, 0.9, 0.0], 1e-3).note
    'none: the target is 2.377 m from the first joint and the arm reaches 2.000 m'
    """
    goal = frozen(target, (3,), "target")
    _check(chain, solids, tolerance, clearance, most)
    why = _out_of_reach(chain, goal, tolerance + ROUNDING)
    if why:
        return Verdict("none", None, 0, -np.inf, f"none: {why}")
    solid = uprights_from([piece for piece in obstacles.pieces if piece.mesh is None])
    arm, bones = _bounded(chain), bones_from(chain, solids)
    task = Task(arm, bones, solid, goal, tolerance, clearance, own)
    return _Search(task, chain, solids, obstacles, accept or (lambda q: True)).run(most)


class _Search:
    """The compiled search, and the exact check of each posture that it finds."""

    def __init__(
        self,
        task: Task,
        chain: Chain,
        solids: Sequence[LinkCapsule],
        obstacles: Obstacles,
        accept: Callable[[Array], bool],
    ) -> None:
        self.task, self.chain, self.solids, self.obstacles = task, chain, solids, obstacles
        self.accept = accept
        self.best, self.refused = -np.inf, 0

    def run(self, most: int) -> Verdict:
        task, work, boxes = self.task, scratch_for(self.task.arm, self.task.bones), _first_box(self.task.arm)
        longest = task.bones.levers.max(0)
        word = FOUND if admit(task, work, boxes, 0) else DONE
        while True:
            if word == FOUND:
                q = frozen(boxes.best[1:], (self.chain.dof,), "joints")
                room, off = self._clearance(q), self._off(q)
                if room >= task.clearance and off <= task.tolerance and self.accept(q):
                    return self._verdict("found", q, boxes, room)
                self.refused += 1
                self.best = max(self.best, room if off <= task.tolerance else -np.inf)
            elif word == FULL:
                boxes = _doubled(boxes)
            elif word == SPENT or boxes.tally[0] == 0:
                kind: Literal["none", "undecided"] = "none"
                if word == SPENT or boxes.tally[2] > 0:
                    kind = "undecided"
                return self._verdict(kind, None, boxes, max(self.best, float(boxes.best[0])))
            word = explore(task, work, boxes, longest, most - PER_REFUSAL * self.refused)

    def _clearance(self, q: Array) -> float:
        """Least distance of all solids, meshes included, by the code that the rest of the house trusts."""
        least, frames = np.inf, self.chain.frames(q)
        for solid in self.solids:
            frame = frames[solid.link]
            start, end = solid.corners @ frame[:3, :3].T + frame[:3, 3]
            least = min(least, capsule_distance(self.obstacles, start, end, solid.radius).distance)
        return least

    def _off(self, q: Array) -> float:
        return float(np.linalg.norm(self.chain.forward(q)[:3, 3] - self.task.target))

    def _verdict(
        self, kind: Literal["found", "none", "undecided"], q: Array | None, boxes: Boxes, room: float
    ) -> Verdict:
        weighed, met = int(boxes.tally[1]), "no posture met reaches the target"
        if np.isfinite(room):
            met = f"the best posture met has a clearance of {room:.6g} m"
        if kind == "found":
            note = f"found: a posture with a clearance of {room:.6g} m, after {weighed} boxes"
        elif kind == "none":
            note = f"none: {weighed} boxes of joint values hold no free posture; {met}"
        else:
            left = int(boxes.tally[0] + boxes.tally[2])
            note = f"undecided: {left} boxes are left after {weighed}; {met}"
            if self.refused:
                note += f"; {self.refused} postures failed the exact check"
        return Verdict(kind, q, weighed, room, note)


def _check(
    chain: Chain, solids: Sequence[LinkCapsule], tolerance: float, clearance: float, most: int
) -> None:
    if not 0 < tolerance < np.inf:
        raise InputError(f"tolerance: expected a length above 0, got {tolerance}")
    if not 0 <= clearance < np.inf:
        raise InputError(f"clearance: expected a length of 0 or more, got {clearance}")
    if most < 1:
        raise InputError(f"most: expected at least one box, got {most}")
    for joint in chain.joints:
        if joint.kind == "prismatic" and not np.isfinite([joint.lower, joint.upper]).all():
            raise InputError(f"joint {joint.name}: a sliding joint needs both limits to be searched")
    for solid in solids:
        if len(solid.corners) != 2:
            raise InputError(
                f"{solid.name}: expected a capsule, got a solid with {len(solid.corners)} corners"
            )
        if not 0 <= solid.link < chain.dof:
            raise InputError(f"{solid.name}: link must be 0 to {chain.dof - 1}, got {solid.link}")


def _out_of_reach(chain: Chain, target: Array, tolerance: float) -> str:
    """Why no posture at all reaches the target, where one look tells; empty where it takes a search."""
    reach = longest_levers(chain, chain.dof - 1, chain.T_last_tool[:3, 3])[1]
    far = float(np.linalg.norm(target - chain.joints[0].T_parent_joint[:3, 3]))
    if far > reach + tolerance:
        return f"the target is {far:.3f} m from the first joint and the arm reaches {reach:.3f} m"
    frames = chain.frames(np.zeros(chain.dof))
    axes = np.array([frame[:3, :3] @ joint.axis for frame, joint in zip(frames, chain.joints, strict=False)])
    flat = np.linalg.norm(np.cross(axes, axes[0]), axis=1).max() < PARALLEL
    gap = abs(float(axes[0] @ (target - frames[-1, :3, 3])))
    if flat and gap > tolerance and all(joint.kind == "revolute" for joint in chain.joints):
        return f"the target is {gap:.3g} m off the plane in which the tool moves"
    return ""


def _bounded(chain: Chain) -> SerialArm:
    """The chain with one turn at most for each turning joint."""
    arm = serial_arm(chain)
    first = np.where(np.isfinite(arm.upper), arm.upper - 2 * np.pi, -np.pi)
    lower = np.where(np.isfinite(arm.lower), arm.lower, first)
    upper = np.where(arm.revolute, np.minimum(arm.upper, lower + 2 * np.pi), arm.upper)
    return arm._replace(lower=lower, upper=upper)


def _first_box(arm: SerialArm) -> Boxes:
    """All postures, in slot 0, not yet admitted."""
    n = len(arm.axis)
    low, high = np.zeros((FIRST_SLOTS, n)), np.zeros((FIRST_SLOTS, n))
    low[0], high[0] = arm.lower, arm.upper
    best = np.full(1 + n, -np.inf)
    return Boxes(low, high, np.zeros(FIRST_SLOTS), np.arange(FIRST_SLOTS), np.zeros(3, np.int64), best)


def _doubled(boxes: Boxes) -> Boxes:
    """The same search with twice the slots."""
    slots = len(boxes.heap)
    low, high, key = (np.concatenate([a, np.zeros_like(a)]) for a in (boxes.low, boxes.high, boxes.key))
    heap = np.concatenate([boxes.heap, np.arange(slots, 2 * slots)])
    return Boxes(low, high, key, heap, boxes.tally, boxes.best)
