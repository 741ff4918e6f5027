"""Whether the base is turned as the rules want it: not at all, or so that the arm faces each set-point."""

from __future__ import annotations

import numpy as np

from regionik.values import Violation
from regionik.verification.findings import Finding, Words, finding
from regionik.verification.motion import Journey, wrapped
from regionik.worlds.arms import pivot_index, with_pivot
from regionik.worlds.scene import World

TURNED = 1e-6  # by which a base may be turned that is not to turn [rad]


def heading(world: World, journey: Journey, words: Words) -> Finding:
    """Headings under ``rules.heading``, within a microradian; hops turn no further than their ends.

    A base that faces its targets has the pivot of its arm straight ahead, or as near to it as its limits
    allow, in the states that are set-points. A fixed heading is that of the first state.
    """
    motion, chain, rules = journey.motion, world.robot.chain, world.rules
    if rules.heading == "fixed" and rules.mode == "continuous":
        off = np.abs(wrapped(motion.base[:, 2] - motion.base[0, 2]))
        text = "the base is turned by {:.4g} rad {}; its heading is fixed"
    elif rules.heading == "face_target" and with_pivot(chain) is chain:
        pivot = pivot_index(chain)
        ahead = np.clip(0.0, chain.lower[pivot], chain.upper[pivot])
        off = np.where(motion.kind == "setpoint", np.abs(wrapped(motion.joints[:, pivot] - ahead)), 0.0)
        text = "the base faces {:.4g} rad past its target {}"
    else:
        return finding("heading", np.inf, [])
    told = [
        Violation("heading", k, words.owner(k), float(off[k]), text.format(off[k], words.state(k)))
        for k in np.flatnonzero(off > TURNED).tolist()
    ]
    return finding("heading", np.inf, told)


EXACT = 1e-9  # [m]; a radius is looked at as the way over a turn, and to this part of it


def wheels(journey: Journey, words: Words) -> Finding:
    """No slip across the wheels on any hop, and no arc tighter than the turning radius of a car.

    The wheels stand beside the middle of the base. On a hop it may go along its heading in the middle of the
    turn and nowhere else; a car goes at least its turning radius times the turn. The margin is that of slip,
    or the way that a car's tightest hop has to spare if that is less.
    """
    if not journey.robot.drive.rolls or not journey.hops:
        return finding("wheels", np.inf, [])
    slip = np.linalg.norm(journey.slide, axis=1)
    told = [
        _tell(words, k, float(slip[k]), f"the base slips {slip[k]:.3g} m sideways {words.hop(k)}")
        for k in np.flatnonzero(slip > EXACT).tolist()
    ]
    margin = EXACT - float(slip.max())
    radius, turn = journey.robot.drive.turning_radius, np.abs(journey.turn)
    if radius > 0:
        short = turn * radius * (1 - EXACT) - np.abs(journey.arc)
        margin = min(margin, -float(short[turn * radius > EXACT].max(initial=-np.inf)))
        for k in np.flatnonzero(short > EXACT).tolist():
            how = f"turns {turn[k]:.4f} rad on {abs(journey.arc[k]):.4f} m {words.hop(k)}"
            text = f"the car {how}; its turning radius is {radius:g} m"
            told.append(_tell(words, k, float(short[k]), text))
    return finding("wheels", margin, told)


def _tell(words: Words, hop: int, amount: float, text: str) -> Violation:
    return Violation("wheels", hop, words.owner(hop), amount, text)
