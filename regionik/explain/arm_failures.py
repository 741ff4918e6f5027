"""Explanations of failures of the arm: targets that solids bury, and postures that touch or lead nowhere."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import compress

import numpy as np

from regionik.explain.changes import lift_within, one_lift_off
from regionik.explain.constraints import setpoint_at, within_stroke
from regionik.explain.several import together
from regionik.planners.collision.distances import obstacles_from, solids_within
from regionik.scene import Scene
from regionik.worlds.errors import Cause, Explanation, Repair
from regionik.worlds.self_collision import off_floor

CORNER = 3**0.5  # how much deeper than its sides the corner of a box may be in a mesh


def target_in_solid(scene: Scene) -> Explanation | None:
    """Explain which set-points are too near to a solid for any posture, the first in full; None for none."""
    found = list(_targets_in_solids(scene))
    return together(found) if found else None


def _targets_in_solids(scene: Scene) -> Iterator[Explanation]:
    """Explanations of the set-points that are too near to a solid for any posture.

    Where the tool point lies inside its link, the ball of the link about it must keep the arm's clearance
    from every solid; into the one that the tool may touch it may sink no deeper than the rules allow. Where
    the tool point lies outside, a target deeper in a solid than the link is away brings the link into it.
    """
    tip, part = scene.robot.tip_depth
    if not tip:
        yield from _targets_buried(scene)
        return
    rules, solids = scene.rules, scene.world.solids
    if part in compress((solid.name for solid in scene.robot.all_solids), off_floor(scene.robot)):
        solids = scene.world.arm_solids
    need = tip + scene.world.arm_clearance - rules.tolerance
    look, obstacles = max(need, rules.tool_contact), obstacles_from(solids)
    for i, target in enumerate(scene.task):
        gaps = solids_within(obstacles, target.position, look)
        if gaps and rules.tool_contact > 0 and gaps[0][0] <= rules.tool_contact:
            gap, touched = gaps[0][0], solids[gaps[0][1]].name
            most, miss = rules.deepest_contact, rules.tolerance
            if tip - max(0.0, gap) > most + miss or -gap > CORNER * most + miss:
                sunk = max(tip - max(0.0, gap), -gap) - miss
                yield _too_deep(scene, i, touched, (part, tip), sunk)
                continue
            gaps = gaps[1:]
        if not gaps or gaps[0][0] >= need:
            continue
        gap, name = gaps[0][0], solids[gaps[0][1]].name
        missing = need + rules.tolerance - gap
        place = f"{gap:z.4f} m from {name}" if gap >= 0 else f"{-gap:z.4f} m deep in {name}"
        reason = (
            f"{setpoint_at(scene.task, i)} lies {place}: no posture keeps the last link ({part}), {tip:g} m "
            f"round about the tool, at the arm's clearance of {scene.world.arm_clearance:g} m from it. The "
            f"tool point would have to be {missing:.4f} m farther away."
        )
        repair = Repair("move-target", f"set-point {i + 1}", missing, f"move it {missing:.4f} m from {name}")
        yield Explanation("no-posture", i, reason, (_cause(scene, name, missing),), (repair,))


def _targets_buried(scene: Scene) -> Iterator[Explanation]:
    """Explanations of the set-points that lie so deep in a solid that the tool's link would be in it too."""
    robot, rules = scene.robot, scene.rules
    tool = robot.chain.T_last_tool[:3, 3]
    own = [solid for solid in robot.solids if solid.link == len(robot.chain.joints) - 1]
    away = [float(np.linalg.norm(one.corners - tool, axis=1).min()) - one.radius for one in own]  # at most
    if not away:
        return
    need = min(away) + CORNER * (rules.deepest_contact + rules.tolerance)
    for i, target in enumerate(scene.task):
        for solid in scene.world.solids:
            depth = -float(solid.distance(target.position))
            if depth <= need:
                continue
            reason = (
                f"{setpoint_at(scene.task, i)} lies {depth:.4f} m deep in {solid.name}: in every posture the "
                f"last link, {min(away):.4f} m from the tool point, is in it too. The tool point would "
                f"have to be at least {depth - need:.4f} m farther out."
            )
            yield Explanation("no-posture", i, reason, (Cause("obstacle", solid.name, depth - need),))
            break


def _too_deep(scene: Scene, i: int, name: str, last: tuple[str, float], need: float) -> Explanation:
    """Explain that the tool cannot touch a solid, as its link, a solid so deep about it, would sink in."""
    part, tip = last
    missing, rules = need - scene.rules.contact_depth, scene.rules
    reason = (
        f"{setpoint_at(scene.task, i)} cannot be touched: the last link ({part}), {tip:g} m round about the "
        f"tool, would sink at least {need:.4f} m into {name}, and the rules allow {rules.contact_depth:g} m "
        f"(rules.contact_depth). That rule would have to allow {missing:.4f} m more, or the link to end at "
        f"the tool point."
    )
    return Explanation("no-posture", i, reason, (_cause(scene, name, missing),))


def _cause(scene: Scene, name: str, missing: float) -> Cause:
    slab = scene.world.floor_slab
    return Cause("floor" if slab is not None and name == slab.name else "obstacle", name, missing)


def no_posture(scene: Scene, i: int) -> Explanation:
    """Explain that M-FABRIK found no posture although the area is not empty."""
    reason = (
        f"{setpoint_at(scene.task, i)} has admissible places for the base, but no posture within the joint "
        f"limits was found at heading policy '{scene.rules.heading}'."
    )
    return Explanation("no-posture", i, reason, (Cause("limits", scene.robot.name, None),))


def no_clear_posture(
    scene: Scene, i: int, looked: tuple[int, int, int], closest: str, cause: Cause, *, cut_off: bool
) -> Explanation:
    """Explain why the arm cannot be at set-point i, or cannot get there, without touching something.

    ``looked`` counts the places and postures looked at, and the places where there is proven to be none;
    ``closest`` tells of the contact of the posture nearest to being clear. With ``cut_off`` clear postures
    exist, but no way to them was found.
    """
    who = setpoint_at(scene.task, i)
    rule = f"the arm's clearance is {scene.world.arm_clearance:g} m"
    if cut_off:
        reason = (
            f"{who} has postures in which the arm touches nothing, but no way to one of them was found on "
            f"which it touches nothing either; on the straight way {closest}, and {rule}."
        )
    else:
        reason = (
            f"{who} has admissible places for the base, but of {_counted(looked[1], 'posture')} at "
            f"{_counted(looked[0], 'place')} that were looked at none is clear: at best {closest}, and "
            f"{rule}."
        )
        if looked[2]:
            reason += f" At {looked[2]} of the places it is proven that there is none."
    return Explanation("no-posture", i, reason, (cause,))


def no_fitting_posture(scene: Scene, i: int, clear: int, postures: int) -> Explanation:
    """Explain that some postures at set-point i are clear, and none is what else the rules ask for."""
    rules, asked = scene.rules, list[str]()
    if rules.criteria is not None:
        asked.append("meets the rules' criteria")
    if rules.mode == "stops" and rules.stop_tolerance:
        asked.append(f"can be kept all round the circle of {rules.stop_tolerance:g} m to park in")
    wanted = (
        " and ".join(asked) or f"is proven to keep the arm's clearance of {scene.world.arm_clearance:g} m"
    )
    reason = (
        f"{setpoint_at(scene.task, i)} has admissible places for the base, and the arm touches nothing in "
        f"{clear} of {_counted(postures, 'posture')} that were looked at, but none was found that also "
        f"{wanted}."
    )
    return Explanation("no-posture", i, reason, (Cause("limits", scene.robot.name, None),))


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}{'s'[: count != 1]}"


def blocked_arm(scene: Scene, closest: str, cause: Cause) -> Explanation:
    """Explain why the arm cannot start in the posture that the world gives."""
    reason = f"The start is blocked: {closest}, and the arm's clearance is {scene.world.arm_clearance:g} m."
    return Explanation("start-blocked", None, reason, (cause,))


def arm_must_lift(scene: Scene, i: int, obstruction: str, cause: Cause | None) -> Explanation:
    """Explain why the arm cannot go on to set-point i with as few lift-offs as the rules allow."""
    told = f"and the rules allow {scene.rules.max_lift_offs} lift-offs."
    return _arm_stuck(scene, i, obstruction, cause, told, one_lift_off(scene, i))


def arm_must_lift_within(scene: Scene, i: int, obstruction: str, cause: Cause | None) -> Explanation:
    """Explain why the arm cannot work the stroke that set-point i is of in one go."""
    told = within_stroke(scene.task, i)
    return _arm_stuck(scene, i, obstruction, cause, told, lift_within(scene, i))


def _arm_stuck(
    scene: Scene, i: int, obstruction: str, cause: Cause | None, told: str, repair: Repair
) -> Explanation:
    reason = (
        f"The path breaks between set-points {i} and {i + 1} of {len(scene.task)}: the base has places that "
        f"serve both, but no way on was found for the arm: {obstruction}; the tool would have to be lifted "
        f"here, {told}"
    )
    cause = cause or Cause("limits", scene.robot.name)
    return Explanation("ladder-broken", i, reason, (cause,), (repair,))
