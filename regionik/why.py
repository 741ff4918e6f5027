"""`why(world, target)`: what stands in the way, and what would mend it."""

from __future__ import annotations

from dataclasses import replace

from numpy.typing import ArrayLike

from regionik.pipeline import check, explained, whole_path
from regionik.reach import reach
from regionik.reasons import explain
from regionik.reasons.causes import no_inner
from regionik.repairs.arm import no_clear_posture, why_arm
from regionik.repairs.target import why_target
from regionik.seeking.any_base import can_search
from regionik.worlds.arrays import frozen
from regionik.worlds.errors import Cause, Explanation, NoPlanFound
from regionik.worlds.scene import Target, World


def why(world: World, target: Target | ArrayLike | None = None) -> Explanation | None:
    """Why a target, or a world's whole path, is out of reach, and the smallest changes that would mend it.

    Causes are irreducible: together they rule it out, and without any one of them the rest does not. For a
    target they rest on its outer area, which is a proof, or on the inner one where the outer is not empty;
    for a path on the ladder of inner areas. Each repair is made, and the target asked for or the path
    planned again, before it is told; the smallest comes first, lengths counted as parts of the arm's length,
    a cone's opening as a part of a half turn and a lift-off as one.

    Parameters
    ----------
    world : World
    target : Target or (3,) array_like, optional
        A bare point leaves the tool direction free [m]. By default the world's whole path is asked for: its
        start, the first set-point with an empty area, floor cut off, or more lift-offs than are allowed.
        Motion is not: what only the arm's obstacles or the base's wheels forbid is for `plan` to say.

    Returns
    -------
    Explanation or None
        None where nothing stands in the way.

    Raises
    ------
    InputError
        For a target that is not three finite numbers, or a world that cannot be planned for.

    Examples
    --------
    >>> from regionik.worlds.documents.world_file import load_world
    >>> found = why(load_world("pillar"), [0.5, 0.0, 0.7])
    >>> [(cause.kind, repair.kind) for cause, repair in zip(found.causes, found.repairs)]
    [('reach', 'move-target')]
    """
    if target is None:
        return _path(world)
    if not isinstance(target, Target):
        target = Target(frozen(target, (3,), "target"))
    asked = replace(world, task=(target,))
    answer = reach(asked, asked.task)
    if answer.reachable[0]:
        return None
    if no_inner(asked):
        return why_target(asked, 0, explain.no_place(asked, 0))
    reason = f"{answer.reason[0].rstrip('.')}."
    if answer.verdict[0] == "undecided":
        return Explanation("undecided", 0, reason, (Cause("limits", world.robot.name),))
    told = Explanation("unreachable", 0, reason, (Cause("limits", world.robot.name),))
    return why_arm(asked, 0, told) if can_search(asked) and no_clear_posture(asked) else told


def _path(world: World) -> Explanation | None:
    try:
        check(world)
        whole_path(world)
    except NoPlanFound as no:
        return explained(world, no.explanation)
    return None
