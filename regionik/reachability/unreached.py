"""Set-points of a task that `reach` does not reach, each with its reason."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from regionik.explain.several import as_setpoint
from regionik.reachability.options import REACHABILITY
from regionik.reachability.reach import answers_for
from regionik.scene import Scene
from regionik.worlds.errors import SetpointFailure, Verdict

OPTIONS = REACHABILITY.search


def unreached(scene: Scene, setpoints: Sequence[int]) -> Iterator[SetpointFailure]:
    """Those of some set-points that are not reached, as is proven or as far as is known."""
    if not setpoints:
        return
    answer = answers_for(scene, [scene.task[i] for i in setpoints])
    for k in np.flatnonzero(~answer.reachable).tolist():
        verdict: Verdict = "unreachable" if answer.verdict[k] == "unreachable" else "undecided"
        i = setpoints[k]
        yield SetpointFailure(i, verdict, as_setpoint(answer.reason[k], i, len(scene.task)), answer.code[k])


def first_unreached(
    scene: Scene,
    setpoints: Sequence[int],
    most: int = OPTIONS.max_setpoints_asked,
    enough: int = OPTIONS.max_setpoints_unreached,
) -> tuple[list[SetpointFailure], list[int]]:
    """The first of some set-points that are not reached, and those that were not looked at.

    No more are looked at than ``most``, nor after ``enough`` are not reached.
    """
    found, begin = list[SetpointFailure](), 0
    while begin < min(most, len(setpoints)) and len(found) < enough:
        end = min(begin + enough - len(found), most)
        found += unreached(scene, setpoints[begin:end])
        begin = end
    return found, list(setpoints[begin:])
