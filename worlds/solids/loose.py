"""Pairs of solids so much larger than what they stand for that they touch where the robot does not.

A box round a bent link reaches where the link is not. Where such solids would forbid many postures, in none
of which the real bodies are seen to touch, the pair need not keep apart; nor where next to no posture would
be left.
"""

from __future__ import annotations

from collections.abc import Sequence

from regionik.worlds.arrays import Array
from regionik.worlds.robot import Robot
from regionik.worlds.solids.selfpairs import link_frames, self_pairs
from regionik.worlds.solids.separation import Hull, apart

POSTURES = 2000
MANY = 0.1  # of these
NEARLY_ALL = 0.95


def loose_pairs(robot: Robot, bodies: Sequence[Array]) -> tuple[list[tuple[str, str]], list[str]]:
    """Names of pairs that need not keep apart, and notes on those of them whose bodies may touch.

    Parameters
    ----------
    robot : Robot
    bodies : sequence of (n, 3) arrays
        Corners of the hull of what each of ``robot.all_solids`` stands for, in its link's frame [m].
    """
    frames, solids = link_frames(robot, POSTURES), robot.all_solids
    bounds = [Hull(solid.corners, solid.radius) for solid in solids]
    pairs: list[tuple[str, str]] = []
    notes: list[str] = []
    for i, k in self_pairs(robot):
        if i < 0:
            continue
        T_i, T_k = frames[:, solids[i].link], frames[:, solids[k].link]
        touching = ~apart(bounds[i], T_i, bounds[k], T_k)
        share = touching.mean()
        if share < MANY:
            continue
        real = ~apart(Hull(bodies[i]), T_i[touching], Hull(bodies[k]), T_k[touching])
        if real.any() and share < NEARLY_ALL:
            continue
        pairs.append((solids[i].name, solids[k].name))
        if real.any():
            notes.append(
                f"what stands for {solids[i].name} and {solids[k].name} touches in {share:.0%} of postures, "
                f"they themselves in up to {real.sum() / POSTURES:.0%}: whether they touch is not asked"
            )
    return pairs, notes
