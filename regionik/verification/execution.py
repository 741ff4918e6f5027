"""Check that the arm takes up what an execution puts the base off its place."""

from __future__ import annotations

import numpy as np

from regionik.values import Plan, Violation
from regionik.verification.led_postures import postures_led_to
from regionik.verification.proofs import Finding, StateNames, finding
from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain
from regionik.worlds.scene import World

RIM_POINTS = 8  # places on the rim of the base's error where the arm is tried, at both ends of its turn


def verify_execution(plan: Plan, names: StateNames) -> Finding:
    """The arm reaches every set-point with the base as far off as ``rules.execution`` has it.

    It is tried from the rim of the base's error, by damped least squares from the plan's posture, within the
    joint limits. That nothing is touched is proven elsewhere, by clearances that hold the errors too.
    """
    offsets = _rim(plan.world)
    if not len(offsets):
        return finding("execution", np.inf, [])
    poses = np.array([one.base for one in plan.setpoints])[:, None] + offsets
    joints = np.repeat([one.joints for one in plan.setpoints], len(offsets), axis=0)
    targets = [target for target in plan.world.task for _ in offsets]
    led, missed = postures_led_to(plan.world, targets, poses.reshape(-1, 3), joints)
    excess = missed.reshape(-1, len(offsets))
    violations = []
    for i in np.flatnonzero(excess.max(axis=1) > 0).tolist():
        k, worst = int(excess[i].argmax()), float(excess[i].max())
        off, at_limit = offsets[k], _at_limit(plan.world.robot.chain, led[i * len(offsets) + k])
        text = f"with the base {np.hypot(off[0], off[1]):.4f} m and {abs(off[2]):.4f} rad off its place, "
        text += f"no posture near the planned one reaches {names.setpoint(i)}; the nearest misses its "
        text += f"tolerance by {worst:.4f} m or rad"
        if at_limit:
            text += f", {at_limit} at its limit, which criteria.joint_margin keeps it off"
        violations.append(Violation("execution", None, i, worst, text))
    return finding("execution", np.inf, violations)


def _at_limit(chain: Chain, joints: Array) -> str | None:
    """The first joint that is at one of its limits."""
    near = np.minimum(joints - chain.lower, chain.upper - joints) <= 0.0
    return next(
        (joint.name for joint, is_near in zip(chain.active_joints, near, strict=True) if is_near), None
    )


def _rim(world: World) -> Array:
    """Offsets (n, 3) of the base at the largest errors that the rules allow for; none where they are zero."""
    errors = world.rules.errors
    if not errors.base_error and not errors.heading_error:
        return np.empty((0, 3))
    angle = 2 * np.pi * np.arange(RIM_POINTS) / RIM_POINTS
    x, y = errors.base_error * np.cos(angle), errors.base_error * np.sin(angle)
    turns = np.unique([-errors.heading_error, errors.heading_error])
    return np.concatenate([np.column_stack([x, y, np.full(RIM_POINTS, turn)]) for turn in turns])
