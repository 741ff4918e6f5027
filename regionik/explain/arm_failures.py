"""Explanations of where the arm is in its own way, or something is in the arm's."""

from __future__ import annotations

from regionik.explain.changes import one_lift_off
from regionik.explain.sentences import setpoint_at
from regionik.planners.collision.distances import obstacles_from, solids_within
from regionik.planners.driving.footprint_planner import NarrowPassageError
from regionik.planners.driving.point_planner import NoPathError
from regionik.worlds.errors import Cause, Explanation, Repair
from regionik.worlds.scene import World

CORNER = 3**0.5  # how much deeper than its sides the corner of a box may be in a mesh


def buried(world: World) -> Explanation | None:
    """Explain which set-point is too near to a solid for any posture; None where none is.

    Where the tool lies inside its link, what is round about it must fit beside every solid with the arm's
    clearance; into the one that the tool may touch it sinks no deeper than the rules allow.
    """
    tip, _ = world.robot.tip_depth
    if not tip:
        return None
    rules = world.rules
    need = tip + rules.arm_clearance - rules.tolerance
    look, obstacles = max(need, rules.tool_contact), obstacles_from(world.solids)
    for i, target in enumerate(world.task):
        gaps = solids_within(obstacles, target.position, look)
        if gaps and rules.tool_contact > 0 and gaps[0][0] <= rules.tool_contact:
            gap, touched = gaps[0][0], world.solids[gaps[0][1]].name
            most, miss = rules.deepest_contact, rules.tolerance
            if tip - max(0.0, gap) > most + miss or -gap > CORNER * most + miss:
                return _too_deep(world, i, touched, tip, max(tip - max(0.0, gap), -gap) - miss)
            gaps = gaps[1:]
        if not gaps or gaps[0][0] >= need:
            continue
        gap, name = gaps[0][0], world.solids[gaps[0][1]].name
        missing = need + rules.tolerance - gap
        place = f"{gap:z.4f} m from {name}" if gap >= 0 else f"{-gap:z.4f} m deep in {name}"
        reason = (
            f"{setpoint_at(world.task, i)} lies {place}: no posture keeps the "
            f"last link, {tip:g} m round about the tool, at the arm's clearance of {rules.arm_clearance:g} m "
            f"from it. The set-point would have to lie {missing:.4f} m farther away."
        )
        repair = Repair("move-target", f"set-point {i + 1}", missing, f"move it {missing:.4f} m from {name}")
        return Explanation("no-posture", i, reason, (Cause("obstacle", name, missing),), (repair,))
    return None


def _too_deep(world: World, i: int, name: str, tip: float, need: float) -> Explanation:
    """Why the tool cannot touch a solid: what of its link is round about it would sink in too deep."""
    missing, rules = need - world.rules.contact_depth, world.rules
    reason = (
        f"{setpoint_at(world.task, i)} cannot be touched: the last link, "
        f"{tip:g} m round about the tool, would sink at least {need:.4f} m into {name}, and the rules allow "
        f"{rules.contact_depth:g} m (contact_depth). That rule would have to allow {missing:.4f} m more, or "
        f"the link to end at the tool point."
    )
    return Explanation("no-posture", i, reason, (Cause("obstacle", name, missing),))


def blocked_arm(world: World, closest: str, cause: Cause) -> Explanation:
    """Explain why the arm cannot start in the posture that the world gives."""
    reason = f"The start is blocked: {closest}, and the arm's clearance is {world.rules.arm_clearance:g} m."
    return Explanation("start-blocked", None, reason, (cause,))


def arm_must_lift(world: World, i: int, obstruction: str, cause: Cause | None) -> Explanation:
    """Explain why the arm cannot go on to set-point i with as few lift-offs as the rules allow."""
    count = len(world.task)
    reason = (
        f"The path breaks between set-points {i} and {i + 1} of {count}: the base has places that serve "
        f"both, but no way on was found for the arm: {obstruction}; the tool would have to be lifted here, "
        f"and the rules allow {world.rules.max_lift_offs} lift-offs."
    )
    return Explanation(
        "ladder-broken", i, reason, (cause or Cause("limits", world.robot.name),), (one_lift_off(world, i),)
    )


def no_drive(world: World, i: int, refusal: NoPathError) -> Explanation:
    """Explain why the base does not get to any place that was looked at for set-point i."""
    kind = world.robot.drive.words
    reason = (
        f"{setpoint_at(world.task, i)} has admissible places for the "
        f"base, but {kind} was not found a way to the places that were looked at: {refusal}."
    )
    missing = refusal.across - refusal.passage if isinstance(refusal, NarrowPassageError) else None
    return Explanation("ladder-broken", i, reason, (Cause("base", world.robot.name, missing),))


def no_clear_posture(
    world: World, i: int, looked: tuple[int, int, int], closest: str, cause: Cause, *, cut_off: bool
) -> Explanation:
    """Explain why the arm cannot be at set-point i, or cannot get there, without touching something.

    Parameters
    ----------
    world : World
    i : int
    looked : (places, postures, proven)
        How many places of the base and postures were looked at, and at how many there is proven to be none.
    closest : str
        What the posture that came nearest to being clear touches, in words.
    cause : Cause
    cut_off : bool
        Clear postures exist, but no way to them was found.
    """
    who = setpoint_at(world.task, i)
    rule = f"the arm's clearance is {world.rules.arm_clearance:g} m"
    if cut_off:
        reason = (
            f"{who} has postures in which the arm touches nothing, but no way to one of them was found on "
            f"which it touches nothing either; on the straight way {closest}, and {rule}."
        )
    else:
        reason = (
            f"{who} has admissible places for the base, but in none of the {looked[1]} postures at "
            f"{looked[0]} places that were looked at is the arm clear: at best {closest}, and {rule}."
        )
        if looked[2]:
            reason += f" At {looked[2]} of the places it is proven that there is none."
    return Explanation("no-posture", i, reason, (cause,))
