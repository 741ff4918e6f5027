"""How far the arm goes on the tool's path, next to RoboPlan's Cartesian planner from the same posture.

RoboPlan follows the path by resolved rates of base and arm together, to 5 mm, and knows neither obstacles nor
where a base may stand. Its motion is therefore looked at here, at every sample: what is left of the distances
that the world demands of the footprint from the shadows of solids, and of the arm from solids, itself and its
base. Where one of them is below zero its motion is none for this world, and the ratio says what keeping off
costs, not who moves less.

Printed for each world, of both: travel of all joints [rad] and of the base's axis [m], and the processor time
of planning once more [s], in turns in one process; lift-offs; the ratio of the arms' travel; and what
RoboPlan's motion leaves of each distance [m]. The package `roboplan` is wanted.

Run: python -m benchmarks.bench_travel [WORLD ...]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import TypeVar

import numpy as np
from roboplan.cartesian_planning import CartesianPathPlanner, CartesianPlannerOptions
from roboplan.core import CartesianPath, JointConfiguration, Scene, loadUrdfSceneDescriptionFromXml

from regionik.output.urdf import robot_to_urdf
from regionik.pipeline import search
from regionik.scene import scene_of
from regionik.values import Motion
from regionik.view.timeline import clearances
from regionik.worlds.arrays import Array
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.robot import Robot
from regionik.worlds.scene import World

T = TypeVar("T")
WORLDS = ("free", "pillar", "shelf", "pipe")
WITHIN = 0.005  # of the path, its own default [m]


def timed(work: Callable[[], T]) -> tuple[T, float]:
    """What it gives once everything is warm, and the processor time of that [s]."""
    work()
    begin = time.process_time()
    return work(), time.process_time() - begin


def on_path(motion: Motion) -> tuple[Array, Array]:
    """Base poses and joints from the first set-point on."""
    first = int(np.argmax(motion.kind == "setpoint"))
    return motion.base[first:], motion.joints[first:]


def endless(robot: Robot) -> Array:
    """Which coordinates of base and arm are two numbers there, cosine and sine."""
    chain = robot.chain
    joints = np.array([joint.kind == "revolute" for joint in chain.joints])
    return np.array([False, False, True, *(joints & np.isinf(chain.upper - chain.lower))])


def theirs(world: World, base: Array, joints: Array) -> Callable[[], tuple[Array, Array]]:
    """RoboPlan's motion for the path of a world from a posture on its first set-point."""
    scene = Scene("world", loadUrdfSceneDescriptionFromXml(robot_to_urdf(world.robot, world.floor.polygon)))
    turning = endless(world.robot)
    row = np.concatenate(
        [[np.cos(v), np.sin(v)] if turns else [v] for v, turns in zip([*base, *joints], turning, strict=True)]
    )
    start = JointConfiguration(scene.getJointNames(), row)
    frames = np.tile(scene.forwardKinematics(row, "tool"), (len(world.task), 1, 1))
    frames[:, :3, 3] = [target.position for target in world.task]
    path = CartesianPath(["world"], ["tool"], [list(frames)])
    options = CartesianPlannerOptions(
        orientation_cost=0.0, max_orientation_error=np.inf, max_position_error=WITHIN
    )

    def planned() -> tuple[Array, Array]:
        rows = np.array(CartesianPathPlanner(scene, options).plan(path, start).positions)
        if rows.shape[1] > len(turning):
            columns = np.cumsum([0, *(1 + turning[:-1])])
            angle = np.arctan2(rows[:, np.minimum(columns + 1, rows.shape[1] - 1)], rows[:, columns])
            rows = np.where(turning, np.unwrap(angle, axis=0), rows[:, columns])
        return rows[:, :3], rows[:, 3:]

    return planned


def travel(motion: tuple[Array, Array]) -> tuple[float, float]:
    """Of the joints [rad] and of the base's axis [m]."""
    base, joints = (np.diff(part, axis=0) for part in motion)
    return float(np.abs(joints).sum()), float(np.hypot(*base[:, :2].T).sum())


def line(name: str) -> str:
    world = load_world(name)
    plan, spent = timed(lambda: search(scene_of(world)))
    ours = on_path(plan.motion)
    other, their_time = timed(theirs(world, ours[0][0], ours[1][0]))
    (arm, base), (their_arm, their_base) = travel(ours), travel(other)
    found, kept = clearances(world, *other), world.rules.arm_clearance
    left = [found.base.min() - world.rules.clearance, found.arm.min() - kept, found.own.min() - kept]
    return (
        f"{name:8} {arm:6.2f} {base:6.2f} {plan.lift_offs:5} {spent:8.3f} {their_arm:6.2f} {their_base:6.2f} "
        f"{their_time:8.3f} {arm / their_arm:6.2f} {' '.join(f'{one:8.3f}' for one in left)}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("worlds", nargs="*", default=WORLDS)
    print("         regionik                      RoboPlan                       left of distances")
    print("world       arm   base lifts  plan[s]    arm   base  plan[s]  ratio     base      arm      own")
    for name in parser.parse_args().worlds:
        print(line(name), flush=True)


if __name__ == "__main__":
    main()
