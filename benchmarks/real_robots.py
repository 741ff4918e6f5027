"""Worlds of real robots: arms on bases, or whole mobile manipulators, each at a line over a bench.

Their URDF files are not part of the project. They are found below folders by the ends of their paths, as
these packages and data sets have them: pybullet (xArm6), jrl (Fetch), hello-robot-stretch-urdf (Stretch),
example-robot-data (TIAGo), rtb-data (IRB 140), and the robots of B* (Panda, iiwa, Gen3, UR10e).
"""

from __future__ import annotations

import warnings
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from regionik.worlds.drives import BaseKind
from regionik.worlds.obstacles import Box
from regionik.worlds.scene import Floor, Rules, Target, World
from regionik.worlds.urdf.loader import load_robot

FLOOR = Floor(shapely.box(-3.0, -3.0, 4.0, 3.0))
BENCH = Box("bench", np.array([1.6, 0.4, 0.5]), np.array([0.8, 0.75, 0.25]))
LINE = np.linspace([0.4, 0.45, 0.75], [1.2, 0.5, 0.7], 5)
RULES = Rules(clearance=0.05, arm_clearance=0.005)


@dataclass(frozen=True)
class Cart:
    """A base of half a length and width [m] on which an arm is mounted at x, y, z [m]."""

    half_length: float
    half_width: float
    mount: tuple[float, float, float]


@dataclass(frozen=True)
class RealRobot:
    """A URDF file by the end of its path, its tip (None: the end of its one arm), and what carries it."""

    urdf: str
    tip: str | None
    base: BaseKind
    cart: Cart | None = None  # none of a file that has its own base

    def world(self, name: str, path: Path) -> World:
        """The world of the robot, read from a path."""
        cart = self.cart
        on_cart: dict[str, Any] = {}
        if cart:
            x, y = cart.half_length, cart.half_width
            on_cart = {
                "footprint": [(x, y), (-x, y), (-x, -y), (x, -y)],
                "mount": [*cart.mount, 0.0],
                "body_height": cart.mount[2],
            }
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            robot = load_robot(path, self.base, self.tip, **on_cart)
        return World(name, robot, FLOOR, (BENCH,), tuple(Target(spot) for spot in LINE), RULES)


REAL_ROBOTS = {
    "xarm6": RealRobot("xarm/xarm6_robot.urdf", "link6", "omni", Cart(0.3, 0.25, (0.1, 0, 0.3))),
    "panda": RealRobot(
        "franka_description/franka.urdf", "panda_link8", "differential", Cart(0.3, 0.25, (0.05, 0, 0.4))
    ),
    "gen3": RealRobot("kinova_gen3.urdf", "end_effector_link", "omni", Cart(0.3, 0.25, (0.1, 0, 0.4))),
    "iiwa": RealRobot(
        "iiwa_description/iiwa.urdf", "iiwa7_link_ee", "differential", Cart(0.48, 0.4, (0.1, 0, 0.3))
    ),
    "irb140": RealRobot("urdf/irb140.urdf", None, "omni", Cart(0.4, 0.4, (0.0, 0, 0.2))),
    "ur10e": RealRobot("ur10e_description/ur10e.urdf", "tool0", "omni", Cart(0.48, 0.4, (0.2, 0, 0.35))),
    "fetch": RealRobot("fetch/fetch.urdf", "gripper_link", "differential"),
    "stretch": RealRobot("RE2V0_tool_stretch_gripper.urdf", "link_grasp_center", "differential"),
    "tiago": RealRobot("tiago_description/robots/tiago.urdf", "arm_tool_link", "differential"),
}


def real_robots(folders: Iterable[Path], names: Collection[str] = ()) -> dict[str, World]:
    """Worlds by their names, of the robots whose files are below some folders; all where none is named."""
    files = [path.resolve() for folder in folders for path in sorted(folder.rglob("*.urdf"))]
    found = {}
    for name, robot in REAL_ROBOTS.items():
        path = next((path for path in files if path.as_posix().endswith(robot.urdf)), None)
        if path and (not names or name in names):
            found[name] = robot.world(name, path)
    return found
