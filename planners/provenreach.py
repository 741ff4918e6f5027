"""Reach of any arm on a vertical pivot, proven both ways: where postures exist, and where none can.

A posture that reaches one distance proves a whole interval round it: by Kantorovich's theorem Newton's method
comes from it to every target within a distance that the Jacobian's smallest singular value, a bound of its
change, and the room up to the joints' limits allow. What such intervals leave over is searched by branch and
bound over all postures, halved until it is ruled out or narrower than a millimetre.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from regionik.planners.bodies import span
from regionik.planners.collision import obstacles_from
from regionik.planners.exhaustive import search
from regionik.planners.inverse import ArmSolver, spread_postures
from regionik.planners.serial import SerialArm, chain_frames, chain_jacobian, serial_arm
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain
from regionik.worlds.pivot import span_of

SAMPLES = 48  # distances looked at first, up to the bound of the reach
NARROW = 1e-3  # width below which what is open at an end is left open [m]
STARTS = 24  # postures tried at one distance
PASSES = 60  # from each
SPREADS = (0.3, 0.3, 0.1, 0.1, 0.03)  # how far postures are varied to prove more [rad]
BOXES = 4000  # of postures weighed for one piece of the outer reach
EXACT = 1e-9  # of the postures that prove something [m]
NEAR_LIMIT = 0.1  # joints nearer to a limit may be held there [rad] or [m]

Interval = tuple[float, float]


@lru_cache(maxsize=4096)
def inner_reach(chain: Chain, height: float, z: float) -> tuple[Interval, ...]:
    """Distances between pivot axis and target at each of which a posture exists.

    The pivot turns without end, as the base turns where it cannot.

    Parameters
    ----------
    chain : Chain
    height : float
        Of the arm's base frame over the floor [m].
    z : float
        Height of the target over the floor [m].
    """
    bound = _bound(chain, height, z)
    if bound <= 0:
        return ()
    endless = _endless(chain)
    prover = _Prover(endless, z - height)
    found: list[Interval] = []
    knots = np.linspace(0.0, bound, SAMPLES)
    proven = [prover.prove(rho, float(knots[1]) / 2) for rho in knots.tolist()]
    for k in range(SAMPLES - 1):
        found += prover.between(float(knots[k]), proven[k], float(knots[k + 1]), proven[k + 1])
    found += [one for one in proven if one is not None]
    return _united(found)


@lru_cache(maxsize=4096)
def outer_reach(chain: Chain, height: float, z: float) -> tuple[Interval, ...]:
    """Distances beyond which no posture reaches; see `inner_reach`."""
    bound = _bound(chain, height, z)
    if bound <= 0:
        return ()
    inner, endless = inner_reach(chain, height, z), _endless(chain)
    edges = [0.0, *(edge for one in inner for edge in one), bound]
    left = list(inner)
    for low, high in zip(edges[::2], edges[1::2], strict=True):
        left += _not_ruled_out(endless, low, high, z - height)
    return _united(left)


def _not_ruled_out(chain: Chain, low: float, high: float, z: float) -> list[Interval]:
    """Parts of an interval that branch and bound does not rule out."""
    if high <= low:
        return []
    middle, radius = (low + high) / 2, (high - low) / 2
    verdict = search(chain, [], obstacles_from([]), [middle, 0.0, z], radius + EXACT, most=BOXES)
    if verdict.kind == "none":
        return []
    if high - low <= NARROW:
        return [(low, high)]
    return _not_ruled_out(chain, low, middle, z) + _not_ruled_out(chain, middle, high, z)


class _Prover:
    """Intervals of distances that single postures prove."""

    def __init__(self, chain: Chain, z: float) -> None:
        self.arm: SerialArm = serial_arm(chain)
        self.solver = ArmSolver(chain, tolerance=EXACT, most_passes=PASSES, restarts=0)
        self.z = z
        self.change = _jacobian_change(self.arm)
        self.rng = np.random.default_rng(0)
        self.starts = spread_postures(chain, span(self.arm), STARTS, 0)
        self.last = self.starts[:0]

    def prove(self, rho: float, need: float) -> Interval | None:
        """The interval that a posture at a distance proves, looked for until it is as wide as needed."""
        best, radius = self._best(rho, np.vstack([self.last, self.starts[:4]]))
        if best is None:
            best, radius = self._best(rho, self.starts)
        for spread in SPREADS:
            if best is None or radius >= need:
                break
            near = best + self.rng.normal(0.0, spread, (STARTS, len(best)))
            other, wider = self._best(rho, near)
            if wider > radius:
                best, radius = other, wider
        if best is None or radius <= 0:
            return None
        self.last = best[None]
        return max(0.0, rho - radius), rho + radius

    def between(self, a: float, left: Interval | None, b: float, right: Interval | None) -> list[Interval]:
        """Intervals proven between two distances, halving what is left open."""
        low, high = a if left is None else left[1], b if right is None else right[0]
        if (high - low <= NARROW and (left is None or right is None)) or high <= low or b - a <= NARROW / 16:
            return []
        middle = (a + b) / 2
        if left is None and right is None:
            return []
        found = self.prove(middle, (b - a) / 4)
        more = self.between(a, left, middle, found) + self.between(middle, found, b, right)
        return more if found is None else [found, *more]

    def _best(self, rho: float, starts: Array) -> tuple[Array | None, float]:
        """Of the postures come to from some starts, the one that proves most."""
        answers = self.solver.batch(np.tile([rho, 0.0, self.z], (len(starts), 1)), starts)
        found = answers.joints[answers.converged]
        radii = [self._radius(joints) for joints in found]
        k = int(np.argmax(radii)) if radii else -1
        return (found[k], radii[k]) if radii else (None, 0.0)

    def _radius(self, joints: Array) -> float:
        """Distance of the targets that Newton's method is sure to reach from a posture (Kantorovich)."""
        n = len(joints)
        frames, J = np.empty((n + 1, 4, 4)), np.empty((6, n))
        chain_frames(self.arm, joints, frames)
        chain_jacobian(self.arm, frames, J)
        room = np.minimum(joints - self.arm.lower, self.arm.upper - joints)
        free = [np.ones(n, dtype=bool), room > NEAR_LIMIT]
        return max(self._with_free(J[:3, use], room[use]) for use in free) - 2 * EXACT

    def _with_free(self, J: Array, room: Array) -> float:
        if J.shape[1] < 3:
            return 0.0
        sigma = float(np.linalg.svd(J, compute_uv=False)[2])
        # Newton's steps go no farther than twice the first one, and it converges while this is at most 1/2.
        return min(0.5 * sigma * sigma / self.change, 0.5 * sigma * float(room.min(initial=np.inf)))


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


def _bound(chain: Chain, height: float, z: float) -> float:
    """Distance beyond which the lengths of the links alone forbid to reach; 0 where they do at every one."""
    span = span_of(chain)
    square = span.length**2 - (z - height - span.height) ** 2
    return 0.0 if square < 0 else span.radius + float(np.sqrt(square))


@lru_cache(maxsize=64)
def _endless(chain: Chain) -> Chain:
    pivot = replace(chain.joints[0], lower=-np.inf, upper=np.inf)
    return Chain((pivot, *chain.joints[1:]), chain.T_last_tool)


def _united(intervals: list[Interval]) -> tuple[Interval, ...]:
    """The union, in order."""
    together: list[Interval] = []
    for low, high in sorted(intervals):
        if together and low <= together[-1][1]:
            together[-1] = together[-1][0], max(together[-1][1], high)
        else:
            together.append((low, high))
    return tuple(together)
