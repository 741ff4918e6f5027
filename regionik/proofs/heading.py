"""Whether the base is turned as the rules want it: not at all, or so that the arm faces each set-point."""

from __future__ import annotations

import numpy as np

from regionik.plan import Violation
from regionik.proofs.findings import Finding, Words, finding
from regionik.proofs.journey import Journey, wrapped
from regionik.worlds.pivot import pivot_of, pivoted
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
    elif rules.heading == "face_target" and pivoted(chain) is chain:
        pivot = pivot_of(chain)
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
