"""The reason why not, where the arm is in its own way or something is in the arm's."""

from __future__ import annotations

import numpy as np

from regionik.planners.driving.footprint_planner import NarrowPassageError
from regionik.planners.driving.point_planner import NoPathError
from regionik.planners.geometry.collision import obstacles_from, solids_within
from regionik.reasons.explain import setpoint, spot
from regionik.worlds.errors import Cause, Explanation, Repair
from regionik.worlds.robot import LinkCapsule
from regionik.worlds.scene import World


def buried(world: World) -> Explanation | None:
    """Why the tool cannot be at some set-point at all, for what stands round it; None where nothing does.

    Where a link ends round in the tool, its radius and the arm's clearance must fit beside every solid but
    the one that the tool may touch.
    """
    tip = _tip_radius(world)
    if tip is None:
        return None
    rules = world.rules
    need = tip + rules.arm_clearance - rules.tolerance
    look, obstacles = max(need, rules.tool_contact), obstacles_from(world.solids)
    for i, target in enumerate(world.task):
        gaps = solids_within(obstacles, target.position, look)
        if gaps and rules.tool_contact > 0 and gaps[0][0] <= rules.tool_contact:
            gaps = gaps[1:]
        if not gaps or gaps[0][0] >= need:
            continue
        gap, name = gaps[0][0], world.solids[gaps[0][1]].name
        missing = need + rules.tolerance - gap
        place = f"{gap:z.4f} m from {name}" if gap >= 0 else f"{-gap:z.4f} m deep in {name}"
        reason = (
            f"{setpoint(i, len(world.task))} at {spot(target.position)} lies {place}: no posture keeps the "
            f"last link, {tip:g} m round about the tool, at the arm's clearance of {rules.arm_clearance:g} m "
            f"from it. The set-point would have to lie {missing:.4f} m farther away."
        )
        repair = Repair("move-target", f"set-point {i + 1}", missing, f"move it {missing:.4f} m from {name}")
        return Explanation("no-posture", i, reason, (Cause("obstacle", name, missing),), (repair,))
    return None


def _tip_radius(world: World) -> float | None:
    """Radius of the link that ends round in the tool, if there is one [m]."""
    chain = world.robot.chain
    tool = chain.T_last_tool[:3, 3]
    radii = [
        solid.radius
        for solid in world.robot.solids
        if solid.link == chain.dof - 1
        and isinstance(solid, LinkCapsule)
        and np.linalg.norm(solid.corners - tool, axis=1).min() < 1e-9
    ]
    return max(radii, default=None)


def blocked_arm(world: World, closest: str, cause: Cause) -> Explanation:
    """Why the arm cannot start in the posture that the world gives."""
    reason = f"The start is blocked: {closest}, and the arm's clearance is {world.rules.arm_clearance:g} m."
    return Explanation("start-blocked", None, reason, (cause,))


def arm_must_lift(world: World, i: int, obstruction: str, cause: Cause | None) -> Explanation:
    """Why the arm cannot go on to set-point i with as few lift-offs as the rules allow."""
    count = len(world.task)
    reason = (
        f"The path breaks between set-points {i} and {i + 1} of {count}: the base has places that serve "
        f"both, but no way on was found for the arm: {obstruction}; the tool would have to be lifted here, "
        f"and the rules allow {world.rules.max_lift_offs} lift-offs."
    )
    repair = Repair("lift-off", f"set-point {i + 1}", 1.0, f"allow a lift-off before set-point {i + 1}", "1")
    return Explanation("ladder-broken", i, reason, (cause or Cause("limits", world.robot.name),), (repair,))


def no_drive(world: World, i: int, refusal: NoPathError) -> Explanation:
    """Why the base does not get to any place that was looked at for set-point i."""
    kind = world.robot.drive.words
    reason = (
        f"{setpoint(i, len(world.task))} at {spot(world.task[i].position)} has admissible places for the "
        f"base, but {kind} was not found a way to the places that were looked at: {refusal}."
    )
    missing = refusal.across - refusal.passage if isinstance(refusal, NarrowPassageError) else None
    return Explanation("ladder-broken", i, reason, (Cause("base", world.robot.name, missing),))


def no_clear_posture(
    world: World, i: int, looked: tuple[int, int, int], closest: str, cause: Cause, *, cut_off: bool
) -> Explanation:
    """Why the arm cannot be at set-point i, or cannot get there, without touching something.

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
    who = f"{setpoint(i, len(world.task))} at {spot(world.task[i].position)}"
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
