"""A loop of differential inverse kinematics along a path, with collision limits: what a person writes first.

At each sample of the path a quadratic program (mink on MuJoCo, daqp) weighs the tool's frame, a little
posture and damping by each coordinate's speed, within the limits of joints, speed and distance. Starts are
tried in a fixed order until one follows the whole path. States are checked, what lies between them is not.
After a loop written for this project's comparison of rasters, with its weights and starts.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import islice
from xml.etree.ElementTree import SubElement, fromstring, tostring

import mink
import mujoco
import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from regionik.simulation.mjcf import BASE_JOINTS, model_text
from regionik.worlds.arrays import Array
from regionik.worlds.robot import Robot
from regionik.worlds.scene import World
from regionik.worlds.self_collision import BODY, self_collision_pairs

SAMPLE = 0.01  # from one sample of the path to the next [m]
MAX_STARTS = 40
BASE_SPEED, YAW_SPEED, JOINT_SPEED = 0.5, 1.0, 1.5  # [m/s], [rad/s]
NEAR, TURN = 2e-4, 2e-3  # of a sample, from the tool [m], [rad]
ROUNDS = 4  # of the quadratic program a sample
PACE = 0.1  # time of a sample, which the speed limits bound its motion by [s]
LARGEST = 0.03, 0.06  # motion of base and of any angle from state to state [m], [rad]
BETWEEN = 4e-4  # of the tool from its path halfway between two states [m]
HALVINGS = 6  # of a step whose motion is larger
POSTURE, DAMPING = 0.01, 0.03  # weights
NOTICE, SPARE = 0.08, 0.01  # distance from where on a solid counts, and kept beyond the rules [m]
PIECES = 3, 2  # of the platform: one distance a pair does not keep two parallel faces apart
AWAY = 0.9, 0.8, 1.0, 0.7, 1.1  # of the arm's root from the beginning of the path [m]
POSTURES = (
    (0.0, -1.2, 1.9, -0.7, 1.57, 0.0), (0.0, -2.2, 1.9, 0.3, -1.57, 0.0), (3.14, -1.9, -1.9, 0.7, 1.57, 0.0),
)  # fmt: skip


def followed(world: World) -> tuple[Array, list[int], int]:
    """Return states (n, 3 + dof) of the best start, the rows of the poses that it met, and starts tried."""
    return _Loop(world).run()


class _Loop:
    def __init__(self, world: World) -> None:
        self.world, self.model = world, mujoco.MjModel.from_xml_string(_model(world))
        self.path, self.pose_at = _samples(world)
        dof = world.robot.chain.dof
        self.fastest = np.array([BASE_SPEED, BASE_SPEED, YAW_SPEED, *[JOINT_SPEED] * dof])
        self.tool = mink.FrameTask("tool", "site", position_cost=1.0, orientation_cost=1.0)
        self.posture = mink.PostureTask(self.model, cost=np.r_[0, 0, 0, [POSTURE] * dof])
        self.damping = mink.DampingTask(self.model, DAMPING / self.fastest)
        names = [self.model.joint(k).name for k in range(self.model.njnt)]
        speeds = dict(zip(names, self.fastest.tolist(), strict=True))
        self.limits = [mink.ConfigurationLimit(self.model), mink.VelocityLimit(self.model, speeds)]
        self.pairs = []
        for pairs, least in self._pairs():
            around = least + SPARE
            limit = mink.CollisionAvoidanceLimit(
                self.model,
                pairs,
                gain=0.5,
                minimum_distance_from_collisions=around,
                collision_detection_distance=around + NOTICE,
            )
            first, second = np.array(limit.geom_id_pairs).T
            bounds = self.model.geom_rbound
            self.pairs.append((first, second, bounds[first] + bounds[second], least))
            self.limits.append(limit)
        self.configuration, self.probe = mink.Configuration(self.model), mink.Configuration(self.model)

    def _pairs(self) -> Iterator[tuple[list[tuple[list[str], list[str]]], float]]:
        """Pairs of groups of geoms, and how far they keep apart."""
        names = [self.model.geom(k).name for k in range(self.model.ngeom)]
        around = [name for name in names if name.startswith("solid")]

        def of(index: int) -> list[str]:
            return [name for name in names if name.partition(".")[0] == f"robot {index}"]

        arm = [name for k in range(len(self.world.robot.solids)) for name in of(k)]
        yield [(of(BODY), around)], self.world.rules.clearance
        yield [(arm, around)], self.world.rules.arm_clearance
        yield [(of(i), of(k)) for i, k in self_collision_pairs(self.world.robot)], 0.0

    def run(self) -> tuple[Array, list[int], int]:
        best, met, tried = np.empty((0, self.model.nq)), list[int](), 0
        for start in islice(_starts(self.world, self.path[0]), MAX_STARTS):
            tried += 1
            self.configuration.update(start)
            self.posture.set_target(start)
            if not self._reaches(self.path[0], PACE, 150) or self._touches():
                continue
            self.posture.set_target_from_configuration(self.configuration)
            states, done = [self.configuration.q.copy()], [0]
            for before, here in zip(self.path[:-1], self.path[1:], strict=True):
                if not self._follows(states, before, here, HALVINGS):
                    break
                done.append(len(states) - 1)
            now = [done[k] for k in self.pose_at if k < len(done)]
            if len(now) > len(met):
                best, met = np.array(states[: done[-1] + 1]), now
            if len(met) == len(self.pose_at):
                break
        return best, met, tried

    def _off(self) -> tuple[float, float]:
        error = self.tool.compute_error(self.configuration)
        return float(np.linalg.norm(error[:3])), float(np.linalg.norm(error[3:]))

    def _touches(self) -> bool:
        """Whether something is closer than the rules allow."""
        data = self.configuration.data
        for first, second, around, least in self.pairs:
            gap = np.linalg.norm(data.geom_xpos[first] - data.geom_xpos[second], axis=1)
            for a, b in zip(*(some[gap < around + least] for some in (first, second)), strict=True):
                if mujoco.mj_geomDistance(self.model, data, a, b, least + 0.01, None) < least:
                    return True
        return False

    def _reaches(self, target: mink.SE3, time: float, rounds: int) -> bool:
        """Whether the tool comes to a sample by steps of a time [s]."""
        self.tool.set_target(target)
        for _ in range(rounds):
            miss, turn = self._off()
            if miss < NEAR and turn < TURN:
                return True
            tasks = [self.tool, self.posture, self.damping]
            try:
                rates = mink.solve_ik(self.configuration, tasks, time, "daqp", limits=self.limits)
            except (mink.NoSolutionFound, mink.NotWithinConfigurationLimits):
                return False
            self.configuration.integrate_inplace(rates, time)
        miss, turn = self._off()
        return miss < 5 * NEAR and turn < 4 * TURN

    def _follows(self, states: list[Array], a: mink.SE3, b: mink.SE3, halvings: int) -> bool:
        """Whether the tool comes from a sample to the next; adds states, more than one where it is far."""
        before = states[-1]
        time = PACE * 0.5 ** (HALVINGS - halvings)
        if self._reaches(b, time, ROUNDS) and self._is_small(before, a, b) and not self._touches():
            states.append(self.configuration.q.copy())
            return True
        self.configuration.update(before)
        if not halvings:
            return False
        middle = a.interpolate(b, 0.5)
        return self._follows(states, a, middle, halvings - 1) and self._follows(
            states, middle, b, halvings - 1
        )

    def _is_small(self, before: Array, a: mink.SE3, b: mink.SE3) -> bool:
        """Whether the step from a state is short, and the tool near its path halfway."""
        now = self.configuration.q
        step = np.abs(now - before)
        if math.hypot(step[0], step[1]) > LARGEST[0] or step[2:].max() > LARGEST[1]:
            return False
        self.probe.update((now + before) / 2)
        start, end = a.translation(), b.translation()
        way = end - start
        spot = self.probe.get_transform_frame_to_world("tool", "site").translation() - start
        share = min(1.0, max(0.0, float(spot @ way) / max(float(way @ way), 1e-12)))
        return float(np.linalg.norm(spot - share * way)) < BETWEEN


def _model(world: World) -> str:
    """The world's MJCF: the platform in pieces, one body below the world, which mink would else pass over."""
    root = fromstring(model_text(world, 0.002))
    for unused in [*root.findall("contact"), *root.findall("actuator")]:
        root.remove(unused)
    scene = root.find("worldbody")
    assert scene is not None
    base = next(body for body in scene.findall("body") if body.get("name") == "base")
    scene.remove(base)
    track = SubElement(scene, "body", name="track")
    slide = next(joint for joint in base.findall("joint") if joint.get("name") == BASE_JOINTS[0])
    base.remove(slide)
    track.append(slide)
    SubElement(track, "inertial", pos="0 0 0", mass="1", diaginertia="1 1 1")
    track.append(base)
    whole = next(geom for geom in base.findall("geom") if geom.get("name") == f"robot {BODY}")
    base.remove(whole)
    low = world.robot.footprint.min(0)
    size = (world.robot.footprint.max(0) - low) / PIECES
    half = world.robot.body_height / 2
    for k, at in enumerate(np.ndindex(*PIECES)):
        x, y = low + size * (np.array(at) + 0.5)
        sizes = f"{size[0] / 2} {size[1] / 2} {half}"
        SubElement(base, "geom", name=f"robot {BODY}.{k}", type="box", size=sizes, pos=f"{x} {y} {half}")
    return tostring(root, encoding="unicode")


def _samples(world: World) -> tuple[list[mink.SE3], list[int]]:
    """The path in samples, and which of them are its poses."""
    spots = np.array([target.position for target in world.task])
    turns = Rotation.from_matrix(np.array([target.orientation for target in world.task]))
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(spots, axis=0), axis=1))])
    counts = np.maximum(1, np.ceil(np.diff(way) / SAMPLE - 1e-9)).astype(int)
    along = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(way[:-1], way[1:], counts, strict=True)]
    every = np.concatenate([*along, way[-1:]])
    points = np.column_stack([np.interp(every, way, axis) for axis in spots.T])
    quaternions = Slerp(way, turns)(every).as_quat(scalar_first=True)
    return [mink.SE3(row) for row in np.hstack([quaternions, points])], [0, *np.cumsum(counts).tolist()]


def _starts(world: World, first: mink.SE3) -> Iterator[Array]:
    """Base and posture, simple ones first: the arm's root at some distance before the first pose."""
    robot: Robot = world.robot
    T = first.as_matrix()
    inward = math.atan2(T[1, 2], T[0, 2])
    for posture in POSTURES:
        for facing in (0.0, math.pi / 2, -math.pi / 2):
            for away in AWAY:
                yaw = inward + facing
                spot = T[:2, 3] - away * np.array([math.cos(inward), math.sin(inward)])
                spot -= robot.mount[0] * np.array([math.cos(yaw), math.sin(yaw)])
                joints = np.array([posture[0] - facing, *posture[1:]])
                joints = np.clip(joints, robot.chain.lower + 0.05, robot.chain.upper - 0.05)
                yield np.r_[spot, yaw, joints]
