"""A stop replanned from where the base truly stands: the arm's motion solved again state by state.

Every state with the tool on its path keeps the tool there, by damped least squares from the joints that were
planned; states with the tool lifted keep their joints. `verify` then proves the whole.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from regionik.explain.constraints import setpoint_at
from regionik.explain.failures import invalid_plan
from regionik.parking.options import PARKING
from regionik.planners.geometry.angles import wrap
from regionik.planners.reach.serial_criteria import demand_of
from regionik.postures.arm import goal_between
from regionik.postures.poses import MotionState, Pose, axis_of, lift_offs, motion_stats, untimed_motion
from regionik.postures.serial_solver import serial_solver
from regionik.values import Configuration, Motion, Plan, Stop
from regionik.verification.verifier import verify
from regionik.worlds.arms import pivot_joints, turned_back
from regionik.worlds.arrays import Array, frozen
from regionik.worlds.errors import Cause, Explanation, InputError, NoPlanFound
from regionik.worlds.robot import with_joint_margin
from regionik.worlds.scene import Start, Target, World


def replan_stop(plan: Plan, stop: int, measured_pose: ArrayLike) -> Plan:
    """Plan the work of one stop again, from where the base truly stands.

    Parameters
    ----------
    plan : Plan
        With stops.
    stop : int
        Index of the stop, from 0.
    measured_pose : (3,) array_like
        x, y [m], yaw [rad] of the base.

    Returns
    -------
    Plan
        Of the stop's set-points alone, verified and not timed. It begins with the arm as it was to be when
        the base had come to rest.

    Raises
    ------
    InputError
        For a plan without that stop, or a pose that is not three finite numbers.
    NoPlanFound
        With the set-point that the arm does not reach from there, or the first check that does not hold.

    Examples
    --------
    >>> from dataclasses import replace
    >>> from regionik.pipeline import plan
    >>> from regionik.worlds.documents.world_file import load_world
    >>> world = load_world("pillar")
    >>> found = plan(replace(world, rules=replace(world.rules, mode="stops")))
    >>> again = replan_stop(found, 1, found.stops[1].base + [0.004, -0.003, 0.02])
    >>> len(again.setpoints) == len(found.stops[1].setpoints)
    True
    """
    base = frozen(measured_pose, (3,), "measured_pose")
    if not 0 <= stop < len(plan.stops):
        if not plan.stops:
            raise InputError("stop: the plan has no stops, expected one made with rules.mode: stops")
        raise InputError(f"stop: expected one of the plan's stops, 0 to {len(plan.stops) - 1}, got {stop}")
    known = plan.stops[stop]
    first, last = _states(plan.motion, known)
    states = list(_solved(plan, known, base, range(first, last + 1)))
    world = _alone(plan.world, known, states[0].pose)
    found = _assembled(world, plan.seed, states, replace(known, base=base, tolerance=0.0, probability=None))
    report = verify(found)
    if not report.ok:
        raise NoPlanFound(invalid_plan(world, report.violations))
    return replace(found, stats={**found.stats, "margins": report.margins})


def _states(motion: Motion, stop: Stop) -> tuple[int, int]:
    """First and last state of a stop: those that lead to its first set-point with the base at rest count."""
    done = np.flatnonzero(motion.kind == "setpoint")
    at = dict(zip(motion.setpoint[done].tolist(), done.tolist(), strict=True))
    first = at[stop.first]
    while first > 0 and np.abs(motion.base[first - 1] - stop.base).max() <= 1e-9:
        if motion.kind[first - 1] != "transit":
            break
        first -= 1
    return first, at[stop.last]


def _solved(plan: Plan, stop: Stop, base: Array, states: range) -> Iterator[MotionState]:
    """Yield the states of a stop with the base elsewhere, set-points counted from the stop's first."""
    motion, world = plan.motion, plan.world
    for k in states:
        kind, i, joints = str(motion.kind[k]), int(motion.setpoint[k]), motion.joints[k]
        if kind != "transit":
            target = world.task[i] if kind == "setpoint" else _target_between(plan, i, k)
            found = _least_change(world, target, base, _turned(world, stop, base, joints), kind)
            if found is None:
                raise NoPlanFound(_out_of_reach(world, i))
            joints = found
        yield MotionState(Pose(base, joints), kind, max(i - stop.first, -1))


def _target_between(plan: Plan, i: int, k: int) -> Target:
    """Target of a state between set-points i and i + 1: where their segment is nearest to its tool."""
    a, b = plan.world.task[i], plan.world.task[i + 1]
    tool = plan.world.robot.tool(plan.motion.base[k], plan.motion.joints[k])[:3, 3]
    way = b.position - a.position
    share = float(np.clip((tool - a.position) @ way / max(float(way @ way), 1e-12), 0.0, 1.0))
    return goal_between(a, b, share)


def _turned(world: World, stop: Stop, base: Array, joints: Array) -> Array:
    """Joints with the pivot turned back by what the base is turned, as far as its limits let it."""
    return turned_back(world.robot.chain, joints, wrap(base[2] - stop.base[2]))


def _least_change(world: World, target: Target, base: Array, joints: Array, kind: str) -> Array | None:
    """Joints near to given ones that meet a target with the base held; None where there are none."""
    robot, rules = with_joint_margin(world.robot, world.rules.criteria), world.rules
    tolerance = rules.tolerance * (1.0 if kind == "setpoint" else PARKING.solve_tolerance_share)
    demand = demand_of(robot, rules.criteria) if kind == "setpoint" else None
    arm = serial_solver(robot.chain, float(robot.mount[2]), tolerance, turns=False, demand=demand)
    yaw = float(base[2] + robot.mount[3])
    found = arm.least_change(target, axis_of(robot, base), yaw, pivot_joints(robot.chain, joints))
    return None if found is None else found.joints[len(found.joints) - robot.chain.dof :]


def _out_of_reach(world: World, i: int) -> Explanation:
    reason = (
        f"{setpoint_at(world.task, i)}: no posture near the planned one keeps the tool on its path there."
    )
    return Explanation("undecided", i, reason, (Cause("limits", world.robot.name),))


def _alone(world: World, stop: Stop, start: Pose) -> World:
    parking = world.rules.parking and replace(world.rules.parking, probability=None)
    rules = replace(world.rules, order="given", stop_tolerance=0.0, parking=parking)
    task = world.task[stop.first : stop.last + 1]
    return replace(world, task=task, rules=rules, start=Start(start.base, start.joints))


def _assembled(world: World, seed: int, states: Sequence[MotionState], stop: Stop) -> Plan:
    if states[0].kind != "transit":
        states = [MotionState(states[0].pose, "transit", -1), *states]
    motion = untimed_motion(states)
    done = np.flatnonzero(motion.kind == "setpoint")
    tools = world.robot.tool(motion.base[done], motion.joints[done])[:, :3, 3]
    errors = np.linalg.norm(tools - [target.position for target in world.task], axis=1)
    setpoints = tuple(
        Configuration(motion.base[k], motion.joints[k], float(error), 0, bool(error <= world.rules.tolerance))
        for k, error in zip(done.tolist(), errors, strict=True)
    )
    stats = {**motion_stats(world.robot.drive, setpoints, motion, {}), "stops": {"count": 1}}
    stops = (replace(stop, setpoints=tuple(range(len(setpoints)))),)
    return Plan(world, seed, setpoints, motion, (), lift_offs(motion), stops, stats)
