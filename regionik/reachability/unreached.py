"""Set-points of a task that `reach` does not reach, each with its reason."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from regionik.explain.several import as_setpoint
from regionik.reachability.reach import reached
from regionik.scene import Scene
from regionik.worlds.errors import SetpointFailure, Verdict


def unreached(scene: Scene, setpoints: Sequence[int]) -> Iterator[SetpointFailure]:
    """Those of some set-points that are not reached, as is proven or as far as is known."""
    if not setpoints:
        return
    answer = reached(scene, [scene.task[i] for i in setpoints])
    for k in np.flatnonzero(~answer.reachable).tolist():
        verdict: Verdict = "unreachable" if answer.verdict[k] == "unreachable" else "undecided"
        i = setpoints[k]
        yield SetpointFailure(i, verdict, as_setpoint(answer.reason[k], i, len(scene.task)))
