"""Execution of a timed plan in a physics simulation."""

from __future__ import annotations

from collections import deque

import numpy as np

from regionik.simulation.noise import Noise, PoseEstimate
from regionik.simulation.physics import Physics
from regionik.simulation.reference import PERIOD, reference
from regionik.simulation.run import SimulatedRun
from regionik.simulation.simulated_robot import SUBSTEPS, SimulatedRobot
from regionik.simulation.tracking import TrackingController
from regionik.timing.trajectory import trajectory
from regionik.values import Plan
from regionik.worlds.arrays import Array
from regionik.worlds.errors import InputError
from regionik.worlds.speeds import Speeds


def simulate(
    plan: Plan, noise: Noise | None = None, *, seed: int = 0, tolerance: float | None = None
) -> SimulatedRun:
    """Execute a timed plan in MuJoCo: a controller tracks it, and the run says how well.

    Parameters
    ----------
    plan : Plan
        A timed one.
    noise : Noise, optional
        By default there is none: the robot knows where it is, and its wheels do not slip.
    seed : int
        The same plan, noise and seed give the same run.
    tolerance : float, optional
        Largest distance of the tool from where the plan has it at that moment, while it is on its path; by
        default the ``path_tolerance`` of the world's rules [m].

    Raises
    ------
    InputError
        For a plan that is not timed, a tolerance that is not above 0, and where MuJoCo is not installed.
    """
    world, noise = plan.world, noise or Noise()
    allowed = world.rules.path_tolerance if tolerance is None else tolerance
    if not 0 < allowed < np.inf:
        raise InputError(f"tolerance: must be above 0, got {allowed:g}")
    way, rng = reference(plan), np.random.default_rng(seed)
    robot = SimulatedRobot(world, way, noise.slips(float(way.time[-1]), rng), allowed)
    controller = TrackingController(world.robot, world.speeds or Speeds(), way)
    setpoints = robot.setpoints(trajectory(plan), len(way.time))
    localization, rows = _Localization(noise, rng), list[tuple[Array, ...]]()
    estimate, joints = noise.start(way.base[0], rng), way.joints[0]
    for k, now in enumerate(way.time[:-1].tolist()):
        estimate = localization.corrected(estimate, robot.physics.position[:3])
        rows.append(_row(robot.physics, estimate))
        command = controller.command(k, estimate.pose, robot.twist, joints)
        said = robot.run(command, setpoints[k * SUBSTEPS : (k + 1) * SUBSTEPS], now)
        estimate, joints = estimate.moved(said, PERIOD, noise.slip), command.joints
    rows.append(_row(robot.physics, estimate))
    contacts = tuple(sorted(robot.contacts.values(), key=lambda contact: contact.time))
    base, poses, covariance, joints, velocity, tool, speed = map(np.array, zip(*rows, strict=True))
    return SimulatedRun(plan, way, base, poses, covariance, joints, velocity, tool, speed, contacts, allowed)


class _Localization:
    """Localisation that comes late and noisily, or exactly where there is no noise."""

    def __init__(self, noise: Noise, rng: np.random.Generator) -> None:
        self._noise, self._rng = noise, rng
        self._every = max(1, round(1 / (noise.rate * PERIOD)))
        self._past: deque[tuple[Array, Array]] = deque(maxlen=round(noise.delay / PERIOD) + 1)
        self._calls = 0

    def corrected(self, estimate: PoseEstimate, pose: Array) -> PoseEstimate:
        """Return the estimate of the base pose (3,), which it has now, once each `PERIOD`."""
        if not self._noise:
            return PoseEstimate(pose.copy())
        self._past.append((pose.copy(), estimate.pose))
        due = self._calls % self._every == 0 and len(self._past) == self._past.maxlen
        self._calls += 1
        if not due:
            return estimate
        deviations, (seen, then) = self._noise.deviations, self._past[0]
        return estimate.corrected(seen + deviations * self._rng.standard_normal(3), then, deviations)


def _row(physics: Physics, estimate: PoseEstimate) -> tuple[Array, ...]:
    """What a run keeps of the present, in the order of the columns of `SimulatedRun`."""
    physics.refresh()
    position, velocity = physics.state
    base, joints = np.split(position, [3])
    speed = np.linalg.norm(physics.tool_velocity())
    tool = physics.tool.copy()
    return base, estimate.pose, estimate.covariance, joints, velocity, tool, np.array(speed)
