"""Proof that a base on wheels rolls: nowhere sideways, and no tighter than a car turns."""

from __future__ import annotations

import numpy as np

from regionik.plan import Violation
from regionik.proofs.findings import Finding, Words, finding
from regionik.proofs.journey import Journey

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
