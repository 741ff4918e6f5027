"""Execution of a timed plan in a physics simulation."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace

import numpy as np

from regionik.simulation.noise import Noise, PoseEstimate
from regionik.simulation.options import SIMULATION
from regionik.simulation.physics import STEP, Overlap, Physics
from regionik.simulation.reference import PERIOD, Reference, reference
from regionik.simulation.run import Contact, SimulatedRun
from regionik.simulation.tracking import Command, TrackingController
from regionik.timing.trajectory import Trajectory, trajectory
from regionik.values import Plan
from regionik.worlds.arrays import Array
from regionik.worlds.errors import InputError
from regionik.worlds.limits import Speeds
from regionik.worlds.robot import Robot
from regionik.worlds.scene import World
from regionik.worlds.self_collision import BODY, base_name

OPTIONS = SIMULATION.robot

SUBSTEPS = round(PERIOD / STEP)
_SHARE = 1 - math.exp(-STEP / OPTIONS.base_lag)  # of the way to the commanded speed that is made in a step


class BaseDrives:
    """Drives of a base: ``twist`` (3,) is what its wheels say, of the base in its own frame [m/s], [rad/s].

    A base that rolls is a unicycle, or a bicycle that steers: wheels whose contacts are solved for would slip
    by what the solver makes of friction, not by what is asked for. ``slips`` (n, 3) are factors of what the
    base does to what its wheels say, one row a second; ``curvature`` is what a car's wheels are turned to at
    first [1/m].
    """

    def __init__(self, robot: Robot, speeds: Speeds, slips: Array, curvature: float) -> None:
        self.twist = np.zeros(3)
        self._wheelbase = robot.turning_radius if not robot.drive.turns_on_the_spot else 0.0
        self._steering = math.atan(self._wheelbase * curvature)
        self._fastest = speeds.steering_velocity * STEP
        self._slips = slips
        self._steps = 0

    def step(self, command: Array, curvature: float, yaw: float) -> tuple[float, float, float]:
        """Go on by a step, asked for a twist (3,) and, of a car, a curvature [1/m]; the base's velocity.

        Of a base with a heading, in the world: x, y [m/s], yaw [rad/s].
        """
        twist, before = self.twist, self.twist.copy()
        twist += (command - twist) * _SHARE
        if self._wheelbase:
            wanted = math.atan(self._wheelbase * curvature)
            self._steering += min(max(wanted - self._steering, -self._fastest), self._fastest)
            twist[2] = twist[0] * math.tan(self._steering) / self._wheelbase
        # MuJoCo goes on by the speed that a step ends with: that has to be its middle's.
        gone = (before + twist) / 2 * self._slips[int(self._steps * STEP / SIMULATION.noise.slip_time)]
        ahead, left, turn = gone.tolist()
        self._steps += 1
        middle = yaw + turn * STEP / 2
        c, s = math.cos(middle), math.sin(middle)
        return c * ahead - s * left, s * ahead + c * left, turn


class SimulatedRobot:
    """A robot that carries out commands, one each `PERIOD`."""

    def __init__(self, world: World, way: Reference, slips: Array, tolerance: float) -> None:
        rows = np.linspace(0, len(way.time) - 1, min(len(way.time), OPTIONS.servo_postures)).astype(int)
        self.physics = Physics(world, way.base[0], way.joints[rows], OPTIONS.servo_frequency)
        self.contacts: dict[tuple[str, str], Contact] = {}  # by the names of the two solids
        self._world, self._deepest = world, world.rules.contact_depth + tolerance
        self._drives = BaseDrives(world.robot, world.speeds or Speeds(), slips, way.curvature[0])
        last = len(world.robot.chain.joints) - 1
        self._tips = {k for k, solid in enumerate(world.robot.solids) if solid.link == last}
        self._spots: dict[int, list[list[float]]] = {}
        self._added = np.zeros(world.robot.chain.dof)

    @property
    def twist(self) -> Array:
        """What the wheels say of the base's motion in its own frame, (3,) [m/s], [rad/s]."""
        return self._drives.twist

    def setpoints(self, way: Trajectory, rows: int) -> Array:
        """Set-points that the servos of all joints need for a plan of so many rows, one row each step."""
        times = np.minimum(STEP * np.arange((rows - 1) * SUBSTEPS), way.duration)
        return self.physics.setpoints(*way.sample(times).columns)

    def run(self, command: Command, setpoints: Array, time: float) -> Array:
        """Carry out a command from a time on [s]; the mean twist that the wheels say meanwhile, (3,).

        The set-points (SUBSTEPS, n) are those that the servos need for the plan; what the command adds, they
        add evenly.
        """
        physics, travelled = self.physics, np.zeros(3)
        rate = (command.added - self._added) / PERIOD
        coupling = self._world.robot.chain.coupling
        # Half of its lag is made up for: with all of it, it overshoots.
        first = self._added + rate / OPTIONS.servo_frequency
        for j, setpoint in enumerate(setpoints):
            velocity = self._drives.step(command.twist, command.curvature, float(physics.position[2]))
            physics.step(velocity, setpoint + coupling @ (first + rate * (j * STEP)))
            travelled += self.twist
            if physics.touching:
                self._keep_contacts(time + (j + 1) * STEP)
        self._added = command.added
        return travelled / len(setpoints)

    def _keep_contacts(self, time: float) -> None:
        for touch in self.physics.touches():
            if self._is_allowed(touch):
                continue
            other = self._robot_solid(touch.other) if touch.own else self._world.solids[touch.other].name
            names = self._robot_solid(touch.robot), other
            known = self.contacts.setdefault(names, Contact(time, *names, touch.depth))
            self.contacts[names] = replace(known, depth=max(known.depth, touch.depth))

    def _is_allowed(self, overlap: Overlap) -> bool:
        """True where the last link touches what a set-point at hand lies on, near the tool and not deep."""
        reach, tool = self._world.rules.tool_contact, self.physics.tool.tolist()
        if overlap.own or overlap.robot not in self._tips or overlap.depth > self._deepest:
            return False
        spots = self._worked_on(overlap.other)
        return math.dist(overlap.point, tool) <= reach and any(
            math.dist(spot, tool) <= reach for spot in spots
        )

    def _worked_on(self, solid: int) -> list[list[float]]:
        """Set-points that lie on a solid, or within ``tool_contact`` of it [m]."""
        if solid not in self._spots:
            reach, one = self._world.rules.tool_contact, self._world.solids[solid]
            spots = [target.position for target in self._world.task]
            self._spots[solid] = [spot.tolist() for spot in spots if one.distance(spot) <= reach]
        return self._spots[solid]

    def _robot_solid(self, index: int) -> str:
        robot = self._world.robot
        return base_name(robot) if index == BODY else robot.all_solids[index].name


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
