"""Reach of any arm on a vertical pivot, proven both ways: where postures exist, and where none can.

The half-plane of distance from the pivot axis and height is cut into squares, each of which is proven to be
reached everywhere, proven not to be reached anywhere, or halved down to a few millimetres. One posture proves
a square: by Kantorovich's theorem Newton's method comes from it to every target within a distance that the
Jacobian's smallest singular value, a bound of its change, and the room up to the joints' limits allow. Branch
and bound over all postures rules squares out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from regionik.planners.bodies import span
from regionik.planners.collision import obstacles_from
from regionik.planners.exhaustive import search
from regionik.planners.flat import compiled
from regionik.planners.inverse import spread_postures
from regionik.planners.polish import POSITION, Aim, polish
from regionik.planners.serial import SerialArm, chain_frames, chain_jacobian, serial_arm
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain
from regionik.worlds.pivot import span_of

COARSE = 12  # squares along the arm's reach at first
FINEST = 0.004  # side of the smallest squares [m]
STARTS = 48  # postures from which any square is tried
VARIED = 16  # variations of the posture that served the larger square
EXACT = 1e-9  # of the postures that prove something [m]
STEPS = 60  # of damped least squares
BOXES = 3000  # of postures weighed to rule one square out

Interval = tuple[float, float]


@dataclass(frozen=True, eq=False)
class ReachMap:
    """Squares of distance and height, seen from the arm's base frame.

    Attributes
    ----------
    inner, open : (m, 3) array
        Distance and height of the middle, and half the side, of squares that are reached everywhere, and of
        those that could not be decided [m].
    """

    inner: Array
    open: Array

    def intervals(self, z: float, *, inner: bool) -> tuple[Interval, ...]:
        """Distances that are reached for certain at a height, or (outer) that may be."""
        squares = self.inner if inner else np.vstack([self.inner, self.open])
        met = squares[np.abs(squares[:, 1] - z) <= squares[:, 2]]
        return united((float(r - half), float(r + half)) for r, _, half in met)


@lru_cache(maxsize=32)
def reach_map(chain: Chain) -> ReachMap:
    """The reach of an arm whose first joint is a vertical pivot, taken as endless; kept for the last chains."""
    pivot = replace(chain.joints[0], lower=-np.inf, upper=np.inf)
    endless = Chain((pivot, *chain.joints[1:]), chain.T_last_tool)
    bound, arm = span_of(chain), serial_arm(endless)
    far = bound.radius + bound.length
    side = far / COARSE
    rows = np.arange(-COARSE - 1, COARSE + 1) + 0.5
    squares = np.array(
        [[(k + 0.5) * side, bound.height + row * side, side / 2] for k in range(COARSE) for row in rows]
    )
    starts = spread_postures(endless, span(arm), STARTS, 0)
    vary = np.random.default_rng(1).normal(0.0, 0.25, (VARIED, chain.dof))
    near = np.full((len(squares), chain.dof), np.nan)
    inner, undecided = [], []
    while len(squares):
        proven, near = _proven(arm, squares, near, starts, vary)
        inner.append(squares[proven])
        squares, near = squares[~proven], near[~proven]
        left = np.array([not _ruled_out(endless, square, bound.height, far) for square in squares], dtype=bool)
        squares, near = squares[left], near[left]
        small = squares[:, 2] <= FINEST / 2
        undecided.append(squares[small])
        squares, near = _quartered(squares[~small]), np.repeat(near[~small], 4, axis=0)
    return ReachMap(np.concatenate(inner), np.concatenate(undecided))


def united(intervals: object) -> tuple[Interval, ...]:
    """The union of intervals, in order."""
    together: list[Interval] = []
    for low, high in sorted(intervals):  # type: ignore[call-overload]
        if together and low <= together[-1][1] + EXACT:
            together[-1] = together[-1][0], max(together[-1][1], high)
        else:
            together.append((low, high))
    return tuple(together)


def _quartered(squares: Array) -> Array:
    half = squares[:, 2] / 2
    signs = np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]])
    parts = np.empty((len(squares), 4, 3))
    parts[..., :2] = squares[:, None, :2] + signs * half[:, None, None]
    parts[..., 2] = half[:, None]
    return parts.reshape(-1, 3)


def _ruled_out(chain: Chain, square: Array, height: float, far: float) -> bool:
    """Whether no posture comes into a square: at once where the links are too short, else by search."""
    r, z, half = square.tolist()
    if np.hypot(max(0.0, r - half), max(0.0, abs(z - height) - half)) > far:
        return True
    reach = half * np.sqrt(2.0) + EXACT
    return search(chain, [], obstacles_from([]), [r, 0.0, z], reach, most=BOXES).kind == "none"


def _proven(arm: SerialArm, squares: Array, near: Array, starts: Array, vary: Array) -> tuple[Array, Array]:
    """Which squares a posture proves, and the best posture of each (NaN where none was found)."""
    change, reach = _jacobian_change(arm), span(arm)
    radii, best = np.zeros(len(squares)), near.copy()
    _prove_all(arm, squares, near, starts, vary, change, reach, radii, best)
    return radii >= squares[:, 2] * np.sqrt(2.0), best


@compiled
def _prove_all(
    arm: SerialArm,
    squares: Array,
    near: Array,
    starts: Array,
    vary: Array,
    change: float,
    reach: float,
    radii: Array,
    best: Array,
) -> None:
    """Look for a posture that proves each square: the old one, its variations, then all starts."""
    n = near.shape[1]
    trial, turn = np.empty(n), np.eye(3)
    for i in range(len(squares)):
        need = squares[i, 2] * np.sqrt(2.0)
        aim = Aim(np.array([squares[i, 0], 0.0, squares[i, 1]]), POSITION, turn)
        known = not np.isnan(near[i, 0])
        first = 0 if known else len(vary) + 1
        found = False
        for k in range(first, len(vary) + 1 + len(starts)):
            if k == 0:
                trial[:] = near[i]
            elif k <= len(vary):
                trial[:] = best[i] + vary[k - 1]
            else:
                trial[:] = starts[k - 1 - len(vary)]
            for j in range(n):
                trial[j] = min(max(trial[j], arm.lower[j]), arm.upper[j])
            error, _, _ = polish(arm, aim, trial, reach, EXACT, 1.0, STEPS)
            if error <= EXACT:
                radius = _radius(arm, trial, change) - 2.0 * EXACT
                if radius > radii[i] or not found:
                    radii[i], found = radius, True
                    best[i] = trial
                if radius >= need:
                    break


@compiled
def _radius(arm: SerialArm, joints: Array, change: float) -> float:
    """Distance of the targets that Newton's method is sure to reach from a posture (Kantorovich).

    Its steps go no farther than twice the first, and it converges while inverse, change and first step
    multiply to at most 1/2. Joints near a limit are held where that proves more.
    """
    n = len(joints)
    frames, J = np.empty((n + 1, 4, 4)), np.empty((6, n))
    chain_frames(arm, joints, frames)
    chain_jacobian(arm, frames, J)
    best = 0.0
    for held in range(n):
        # Hold the joints with the least room, one more each time.
        limit = np.inf if held == 0 else -1.0
        if held > 0:
            rooms = np.empty(n)
            for k in range(n):
                rooms[k] = min(joints[k] - arm.lower[k], arm.upper[k] - joints[k])
            limit = np.sort(rooms)[held - 1]
        A, room = np.zeros((3, 3)), np.inf
        for k in range(n):
            own = min(joints[k] - arm.lower[k], arm.upper[k] - joints[k])
            if held > 0 and own <= limit:
                continue
            room = min(room, own)
            for i in range(3):
                for j in range(3):
                    A[i, j] += J[i, k] * J[j, k]
        sigma2 = np.linalg.eigvalsh(A)[0]
        if sigma2 <= 0.0:
            break
        sigma = np.sqrt(sigma2)
        best = max(best, min(0.5 * sigma2 / change, 0.5 * sigma * room))
        if not np.isfinite(room):
            break
    return best


def _jacobian_change(arm: SerialArm) -> float:
    """Bound of the Jacobian's change for a unit change of all joints together (Frobenius norm).

    The derivative of column j by joint k is at most the length of the arm beyond the later of the two joints,
    or 1 where that one slides.
    """
    n = len(arm.axis)
    steps = [np.linalg.norm(arm.fixed[k, :3, 3]) for k in range(1, n)] + [np.linalg.norm(arm.tool[:3, 3])]
    slides = [
        0.0 if arm.revolute[k] else max(abs(float(arm.lower[k])), abs(float(arm.upper[k]))) for k in range(n)
    ]
    beyond = np.cumsum((np.array(steps) + np.array(slides))[::-1])[::-1]
    weight = np.where(arm.revolute, beyond, 1.0)
    return float(np.sqrt(sum((2 * k + 1) * weight[k] ** 2 for k in range(n))))
