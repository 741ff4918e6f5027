"""Closed-form inverse kinematics of the planar 3R arm, joint limits kept.

A position gives two equations for three angles, so the first angle is free. Its intervals are found without
search: solutions begin or end only where the elbow stretches or folds, or where a joint is at a limit, and
each of these follows from one law of cosines.

Source: the arm of de Souza et al. (paper 004), eqs. (2) and (3).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from regionik.papers.rivals.method import ArmMethod, SearchResult, arm_length, position_error
from regionik.planners.solvers.damped_least_squares import POSITION, Aim
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain
from regionik.worlds.errors import InputError

INSIDE = 1e-9  # share of an interval of angles kept from its ends, where rounding decides
PARALLEL = 1e-9  # tolerance of parallel axes
ROUNDING = 1e-13  # share of the arm's length
ANGLE_ROUNDING = 1e-7  # of a nearly straight elbow, the root of rounding [rad]


class Planar3R(ArmMethod):
    """Closed form of three parallel hinges; of all solutions, the one nearest to the start.

    Parameters
    ----------
    chain : Chain
        Three revolute joints about the z axis of the arm's base frame.

    Raises
    ------
    InputError
        For any other arm.
    """

    name = "algebraic"

    def __init__(self, chain: Chain, tolerance: float = 1e-3) -> None:
        super().__init__(chain, tolerance, 1e-3)
        frames = chain.frames(np.zeros(chain.dof))
        axes = [frame[:3, :3] @ joint.axis for frame, joint in zip(frames, chain.joints, strict=False)]
        hinges = chain.dof == 3 and all(joint.kind == "revolute" for joint in chain.joints)
        if not hinges or np.abs(np.array(axes) - [0.0, 0.0, 1.0]).max() > PARALLEL:
            raise InputError("algebraic: expected an arm of three hinges about the z axis of its base frame")
        points = frames[:, 0, 3] + 1j * frames[:, 1, 3]
        self._root, self._links = points[0], np.diff(points)

    def search(self, aim: Aim, joints: Array) -> SearchResult:
        """Return the solution nearest to the start; where there is none, the nearest miss."""
        if aim.kind != POSITION:
            raise InputError("algebraic: takes positions alone, and the target asks for more")
        target = complex(aim.position[0], aim.position[1]) - self._root
        found = []
        for q in [np.array(joints, dtype=np.float64), *self._solutions(target, float(joints[0]))]:
            error = position_error(self.chain, aim, q)
            exact = error <= ROUNDING * arm_length(self.chain)
            found.append((0.0 if exact else error, float(np.abs(q - joints).max()), error, tuple(q)))
        _, _, error, best = min(found)
        return SearchResult(np.array(best), error, 0.0, 0, 0)

    def _solutions(self, target: complex, first: float) -> Iterator[Array]:
        """The solution nearest to ``first`` in each interval of the first angle, for either elbow."""
        low, high = self.chain.lower[0], self.chain.upper[0]
        low, high = (low, high) if np.isfinite(high - low) else (first - np.pi, first + np.pi)
        ends = np.array(sorted({low, high, *self._interval_ends(target, low, high)}))
        for elbow in (1.0, -1.0):
            for a, b in zip(ends[:-1], ends[1:], strict=True):
                if self.posture(target, (a + b) / 2, elbow) is None:
                    continue
                spare = INSIDE * (b - a)
                q = self.posture(target, float(np.clip(first, a + spare, b - spare)), elbow)
                if q is not None:
                    yield q
            single = (self.posture(target, float(end), elbow) for end in ends)
            yield from (q for q in single if q is not None)

    def posture(self, target: complex, first: float, elbow: float) -> Array | None:
        """Return the posture (3,) with the first joint at ``first`` [rad], if it is within the limits.

        Parameters
        ----------
        target : complex
            x + iy from the first joint [m].
        elbow : {1, -1}
            Side to which the third joint bends.
        """
        l1, l2, l3 = self._links
        left = target - l1 * np.exp(1j * first)
        cosine = (abs(left) ** 2 - abs(l2) ** 2 - abs(l3) ** 2) / (2 * abs(l2) * abs(l3))
        if abs(cosine) > 1.0 + ANGLE_ROUNDING**2:
            return None
        bend = elbow * np.arccos(np.clip(cosine, -1.0, 1.0))
        third = bend + np.angle(l2) - np.angle(l3)
        second = np.angle(left) - np.angle(l2 + l3 * np.exp(1j * third)) - first
        q = np.array([first, second, third])
        q[1:] -= 2 * np.pi * np.round((q[1:] - self._mid_range()[1:]) / (2 * np.pi))
        within = (q >= self.chain.lower - ANGLE_ROUNDING) & (q <= self.chain.upper + ANGLE_ROUNDING)
        return np.clip(q, self.chain.lower, self.chain.upper) if within.all() else None

    def _mid_range(self) -> Array:
        lower, upper = self.chain.lower, self.chain.upper
        known = np.isfinite(lower) & np.isfinite(upper)
        return np.where(known, (np.where(known, lower, 0.0) + np.where(known, upper, 0.0)) / 2, 0.0)

    def _interval_ends(self, target: complex, low: float, high: float) -> Iterator[float]:
        """First angles within ``low`` to ``high`` at which solutions begin or end."""
        l1, l2, l3 = self._links
        limits = [(self.chain.lower[k], self.chain.upper[k]) for k in (1, 2)]
        laws = [(l1, abs(l2) + abs(l3)), (l1, abs(abs(l2) - abs(l3)))]
        laws += [(l1, abs(l2 + l3 * np.exp(1j * c))) for c in limits[1] if np.isfinite(c)]
        laws += [(l1 + l2 * np.exp(1j * c), abs(l3)) for c in limits[0] if np.isfinite(c)]
        for arm, radius in laws:
            for angle in _law_of_cosines(target, arm, radius):
                turns = np.arange(np.ceil((low - angle) / (2 * np.pi)), (high - angle) / (2 * np.pi))
                yield from (angle + 2 * np.pi * turns).tolist()


def _law_of_cosines(target: complex, arm: complex, radius: float) -> tuple[float, ...]:
    """Angles by which ``arm`` must turn to end at a distance from the target."""
    product = 2 * abs(target) * abs(arm)
    if product == 0.0:
        return ()
    cosine = (abs(target) ** 2 + abs(arm) ** 2 - radius**2) / product
    if abs(cosine) > 1.0 + ANGLE_ROUNDING**2:
        return ()
    off = float(np.arccos(np.clip(cosine, -1.0, 1.0)))
    straight = float(np.angle(target) - np.angle(arm))
    return straight - off, straight + off
