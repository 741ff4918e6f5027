"""Xu et al.: its equations against forward kinematics, and its two simulations.

The paper prints no table: it shows both simulations as curves. What it prints in numbers, and what follows
from its equations, stands beside ours.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.tables.table import Table
from regionik.papers.pitch_arm import arm_share, heights
from regionik.papers.pose_tracking import TrackingRobot, track_runs
from regionik.papers.tracker import tracking_robot
from regionik.planners.geometry.angles import wrap
from regionik.worlds.arrays import Array
from regionik.worlds.bundled import robot_named
from regionik.worlds.chain import Chain, planar_pose
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.drives import wheel_travel

ROBOT = robot_named("pioneer-parm")
SPEED = 0.5  # of a wheel at most, as printed [m/s]
KNOB = 0.34  # printed height of the knob over the floor [m]
HELD = 1e-9  # to either side, for a joint that is held [rad]
ROUNDING = 1e-9  # differences below are not told [mm] or [rad]
RUNS, SEED = 1000, 1


def tracked_robot() -> TrackingRobot:
    """The robot as the tracker reads it."""
    found = tracking_robot(ROBOT)
    assert found is not None, "the paper's own robot"
    return found


@dataclass(frozen=True, eq=False)
class Simulation:
    """A simulation followed exactly.

    Attributes
    ----------
    place, turn : float
        Largest errors over the poses [m], and of elements of the orientation.
    joints : (n, 5) array
        [rad]
    wheel : float
        Longest way of a wheel in a step [m].
    duration : float
        Of the path with the faster wheel at its limit [s].
    slip : float
        What the base moves across its heading in a step at most [m].
    paper_slip : (n - 1,) array
        The same for each step by the paper's rule for the heading, with joint 1 at zero [m].
    """

    place: float
    turn: float
    joints: Array
    wheel: float
    duration: float
    slip: float
    paper_slip: Array


def chord_heading_slip(robot: TrackingRobot, poses: Sequence[Array]) -> Array:
    """Sideways slip of each step under the paper's own rule for the heading, (n - 1,) [m].

    The heading at a pose lies along the chord of the tool's path that led there, and joint 1 stands at zero;
    no wheel can roll the part of the step across the mean of its two headings.
    """
    shares = [arm_share(robot.arm, pose, robot.lift, k) for k, pose in enumerate(poses)]
    spots = np.array([pose[:2, 3] for pose in poses])
    way = np.diff(spots, axis=0)
    yaw = np.unwrap(np.arctan2(way[:, 1], way[:, 0]))
    yaw = np.insert(yaw, 0, yaw[0] - (yaw[1] - yaw[0] if len(yaw) > 1 else 0.0))
    out = np.array([share.out for share in shares])[:, None]
    base = spots - (robot.ahead + out) * np.column_stack([np.cos(yaw), np.sin(yaw)])
    mean = (yaw[1:] + yaw[:-1]) / 2
    moved = np.diff(base, axis=0)
    slip: Array = moved[:, 1] * np.cos(mean) - moved[:, 0] * np.sin(mean)
    return slip


def circle() -> list[Array]:
    """Poses of simulation 1, equations 13 and 14."""
    poses = []
    for t in range(1, 361):
        angle, pose = np.radians(t), np.diag([1.0, -1.0, -1.0, 1.0])
        pose[:3, 3] = 2.5 - 2 * np.sin(angle), 2.5 + 2 * np.cos(angle), (55 + t / 20) / 1000
        poses.append(pose)
    return poses


def door() -> list[Array]:
    """Poses of simulation 2, as the bundled world `door` reads them."""
    poses = []
    for target in load_world("door").task:
        pose = np.eye(4)
        assert target.orientation is not None
        pose[:3, :3], pose[:3, 3] = target.orientation, target.position
        poses.append(pose)
    return poses


def simulation(poses: list[Array], pivot: float) -> Simulation:
    """Poses followed with joint 1 within plus and minus ``pivot`` [rad]."""
    limits = np.array([pivot, *[np.inf] * 4])
    robot = replace(tracked_robot(), lower=-limits, upper=limits)
    (found,) = track_runs(robot, poses)
    mount = planar_pose(robot.ahead, 0, 0, robot.lift)
    tools = [
        planar_pose(*base) @ mount @ ROBOT.chain.forward(joints)
        for base, joints in zip(found.base, found.joints, strict=True)
    ]
    apart = np.abs(np.array(tools) - np.array(poses))
    wheels = np.abs(wheel_travel(found.base, ROBOT.gauge)).max(axis=1)
    return Simulation(
        float(apart[:, :3, 3].max()),
        float(apart[:, :3, :3].max()),
        found.joints,
        float(wheels.max()),
        float(wheels.sum() / SPEED),
        float(np.abs(sideways(found.base)).max()),
        np.abs(chord_heading_slip(robot, poses)),
    )


def sideways(base: Array) -> Array:
    """What bases (n, 3) move across the mean heading of each step [m]; rolling along an arc is none."""
    moved, way = np.diff(base[:, :2], axis=0), (base[1:, 2] + base[:-1, 2]) / 2
    return np.asarray(moved[:, 1] * np.cos(way) - moved[:, 0] * np.sin(way))


def equations() -> dict[str, float]:
    """How far each of the paper's equations is off forward kinematics at most [rad] or [m].

    Over random postures with joint 5 at zero. Equation 9 has four cases, by cos(q4) and cos(q2 + q3).
    """
    rng, chain = np.random.default_rng(SEED), ROBOT.chain
    joints = np.column_stack([rng.uniform(-np.pi, np.pi, (RUNS, 4)), np.zeros(RUNS)])
    square = rng.choice([-np.pi / 2, np.pi / 2], (RUNS, 2))
    rolled, pitched = joints.copy(), joints.copy()
    rolled[:, 3] = square[:, 0]  # cos(q4) = 0
    pitched[:, 2] = square[:, 1] - pitched[:, 1]  # cos(q2 + q3) = 0
    both = pitched.copy()
    both[:, 3] = square[:, 0]
    return {
        "(7), height and z of the axes": _apart(chain, joints, _seven),
        "(9), cos q4 = 0, cos q23 ≠ 0": _apart(chain, rolled, _nine_1),
        "(9), cos q4 = 0, cos q23 = 0": _apart(chain, both, _nine_2),
        "(9), cos q4 ≠ 0, cos q23 ≠ 0, as printed": _apart(chain, joints, _nine_3_printed),
        "(9), cos q4 ≠ 0, cos q23 ≠ 0, a and o along y": _apart(chain, joints, _nine_3),
        "(9), cos q4 ≠ 0, cos q23 = 0": _apart(chain, pitched, _nine_4),
        "(10)": _apart(chain, pitched, _ten),
    }


def _apart(chain: Chain, joints: Array, equation: Callable[[Array, Array], Array]) -> float:
    return float(np.abs(equation(joints, chain.forward(joints))).max())


def _turned(angle: Array, joint: Array) -> Array:
    return np.array([wrap(value) for value in (angle - joint).tolist()])


def _seven(q: Array, T: Array) -> Array:
    part, q23 = tracked_robot().arm, q[:, 1] + q[:, 2]
    height = part.shoulder_up - part.fore * np.sin(q23) - part.upper * np.sin(q[:, 1])
    z = [np.cos(q23) * np.cos(q[:, 3]), -np.cos(q23) * np.sin(q[:, 3]), -np.sin(q23), height]
    return np.asarray(np.column_stack(z) - T[:, 2])


def _nine_1(q: Array, T: Array) -> Array:
    c23 = np.cos(q[:, 1] + q[:, 2])
    return _turned(np.arctan2(T[:, 0, 0] * np.sign(np.sin(q[:, 3])), T[:, 0, 2] / c23), q[:, 0])


def _nine_2(q: Array, T: Array) -> Array:
    s4, s23 = np.sin(q[:, 3]), np.sin(q[:, 1] + q[:, 2])
    return _turned(np.arctan2(T[:, 0, 0] * np.sign(s4), -T[:, 0, 1] * np.sign(s23 * s4)), q[:, 0])


def _nine_3(q: Array, T: Array, cosine: int = 1) -> Array:
    """With elements of row ``cosine`` in the second argument: the paper prints those of row 0."""
    s4, c4 = np.sin(q[:, 3]), np.cos(q[:, 3])
    s23, c23 = np.sin(q[:, 1] + q[:, 2]), np.cos(q[:, 1] + q[:, 2])
    along = -T[:, cosine, 2] * s23 * s4 / (c23 * c4) - T[:, cosine, 1] / c4
    return _turned(np.arctan2(T[:, 1, 2] / c23, along), q[:, 0])


def _nine_3_printed(q: Array, T: Array) -> Array:
    return _nine_3(q, T, cosine=0)


def _nine_4(q: Array, T: Array) -> Array:
    s4, c4, up = np.sin(q[:, 3]), np.cos(q[:, 3]), np.sign(np.sin(q[:, 1] + q[:, 2]))
    across = (T[:, 1, 0] * c4 - T[:, 1, 1] * s4) * up
    return _turned(np.arctan2(across, -T[:, 1, 0] * s4 - T[:, 1, 1] * c4), q[:, 0])


def _ten(q: Array, T: Array) -> Array:
    s1, c1, s23 = np.sin(q[:, 0]), np.cos(q[:, 0]), np.sin(q[:, 1] + q[:, 2])
    n, o = T[:, 0, 0], T[:, 0, 1]
    return _turned(np.arctan2(n * s1 - o * c1 * s23, n * c1 * s23 + o * s1), q[:, 3])


def knob_heights() -> tuple[float, float]:
    """Heights over the floor that the tool attains with its axis straight up [m]."""
    robot = tracked_robot()
    low, high = heights(robot.arm, -1.0)
    return low + robot.lift, high + robot.lift


def tables() -> list[Table]:
    """The equations and both simulations."""
    low, high = (1000 * height for height in knob_heights())
    both = [
        _told("Simulation 1", "a circle of 2 m, the tool straight down", circle(), ()),
        _told(
            "Simulation 2",
            "a door with its knob 230 mm from the hinge, the tool's z axis up",
            door(),
            (
                f"The paper's knob is at {1000 * KNOB:g} mm; over the floor a tool that points up attains "
                f"{low:.2f} to {high:.2f} mm only. Over the arm's base frame the printed height is in reach: "
                "ours is there, 495 mm over the floor. Where the hinge stands, and how far the door opens, "
                "is not printed: a quarter turn.",
            ),
        ),
    ]
    return [table_of_equations(), *both]


def table_of_equations() -> Table:
    """Equations against forward kinematics."""
    return Table(
        "Equations 7, 9 and 10",
        f"largest difference from forward kinematics over {RUNS} random postures",
        ("Equation, case", "off [m] or [rad]"),
        tuple((name, _bound(off) if off < ROUNDING else f"{off:.2f}") for name, off in equations().items()),
        (
            "Misprint: the third case of equation 9 has a and o along x in its second argument. Along y it "
            "is right, as all others are printed.",
        ),
    )


def _told(number: str, title: str, poses: list[Array], notes: tuple[str, ...]) -> Table:
    """What a simulation comes to, with joint 1 in its range and held at zero."""
    kinds = [simulation(poses, pivot) for pivot in (np.pi / 2, HELD)]
    degrees = [np.degrees(one.joints) for one in kinds]
    slip = 1000 * kinds[0].paper_slip

    def span(joint: int) -> list[str]:
        return [f"{q[:, joint].min() + 0.0:.2f} to {q[:, joint].max() + 0.0:.2f}" for q in degrees]

    return Table(
        number,
        f"{title}, {len(poses)} poses",
        ("", "paper", "ours: joint 1 within ±90°", "ours: joint 1 at 0°"),
        (
            ("position off by at most [mm]", "–", *(_bound(1000 * one.place) for one in kinds)),
            ("orientation off by at most [rad]", "–", *(_bound(one.turn) for one in kinds)),
            *((f"joint {k + 1} [deg]", "–", *span(k)) for k in range(1, 4)),
            ("way of a wheel in a step, at most [mm]", "–", *(f"{1000 * one.wheel:.2f}" for one in kinds)),
            (
                "the whole path at 0.5 m/s of the faster wheel [s]",
                "–",
                *(f"{one.duration:.2f}" for one in kinds),
            ),
            (
                "sideways slip of the base in a step [mm]",
                f"{slip.min():.2f} to {slip.max():.2f}",
                *(_bound(1000 * one.slip) for one in kinds),
            ),
        ),
        (
            "The paper shows curves. Its slip is computed from its rule, by which the heading lies along the "
            "last chord of the tool's path: no wheels can roll that. Ours go from pose to pose along an arc.",
            *notes,
        ),
    )


def _bound(value: float) -> str:
    """Rounding differs between machines: all that is not seen as more than it is told as a bound."""
    return f"below {ROUNDING:.0e}" if value < ROUNDING else f"{value:.1e}"
