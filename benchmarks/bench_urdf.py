"""Real robots from installed packages: does each arm load, and is it where pinocchio says?

Prints a line a robot: joints, solids, what was said while loading, seconds to load, and the largest
difference between our tool frame and pinocchio's over 1000 random postures within limits. Robots and programs
that are not installed are named as absent. Needs: pip install pin example-robot-data rtb-data

Run: python -m benchmarks.bench_urdf [postures]
"""

from __future__ import annotations

import sys
import time
import warnings
from importlib import metadata
from pathlib import Path

import numpy as np

import regionik as rik
from regionik.worlds.arrays import Array
from regionik.worlds.robot import Robot

ERD, RTB = "example-robot-data", "rtb-data"
# name, package, end of the file's path, root (None: the file's), tip
ARMS = (
    ("TIAGo", ERD, "tiago_description/robots/tiago.urdf", None, "arm_tool_link"),
    ("TIAGo without hand", ERD, "tiago_description/robots/tiago_no_hand.urdf", None, "arm_tool_link"),
    ("TIAGo dual, left", ERD, "tiago_description/robots/tiago_dual.urdf", None, "arm_left_tool_link"),
    ("TIAGo Pro, left", ERD, "tiago_pro_description/robots/tiago_pro.urdf", None, "arm_left_tool_link"),
    ("UR5", ERD, "ur_description/urdf/ur5_robot.urdf", None, "tool0"),
    ("UR10", ERD, "ur_description/urdf/ur10_robot.urdf", None, "tool0"),
    ("Panda", ERD, "panda_description/urdf/panda.urdf", None, "panda_hand_tcp"),
    ("xArm7", ERD, "xarm_description/urdf/xarm7.urdf", None, None),
    ("Kinova", ERD, "kinova_description/robots/kinova.urdf", None, "j2s6s200_end_effector"),
    ("Z1 on B1", ERD, "b1_description/urdf/b1-z1.urdf", None, None),
    ("PR2, right", ERD, "pr2_description/urdf/pr2.urdf", None, "r_gripper_tool_frame"),
    ("Baxter, left", ERD, "baxter_description/urdf/baxter.urdf", None, "left_gripper"),
    ("KUKA KR16", RTB, "kuka_kr16/urdf/kr16_2.urdf", None, None),
    ("KUKA iiwa 14", RTB, "kuka_lbr_iiwa/urdf/lbr_iiwa_14_r820.urdf", None, None),
    ("Puma 560", RTB, "urdf/puma560_robot.urdf", None, None),
)


def installed(package: str, end: str) -> Path | None:
    """A file of an installed package by the end of its path."""
    try:
        files = metadata.files(package) or []
    except metadata.PackageNotFoundError:
        return None
    return next((Path(str(file.locate())) for file in files if str(file).endswith(end)), None)


def postures(robot: Robot, count: int) -> Array:
    lower = np.where(np.isfinite(robot.chain.lower), robot.chain.lower, -np.pi)
    upper = np.where(np.isfinite(robot.chain.upper), robot.chain.upper, np.pi)
    return np.random.default_rng(0).uniform(lower, upper, (count, robot.chain.dof))


def pinocchio_tools(path: Path, root: str | None, tip: str, names: tuple[str, ...], joints: Array) -> Array:
    """Tool frames (n, 4, 4) in the root link, by pinocchio; all other joints at zero."""
    import pinocchio as pin

    model = pin.buildModelFromUrdf(str(path))
    data = model.createData()
    tool = model.getFrameId(tip)
    top = model.getFrameId(root) if root else 0
    frames = np.empty((len(joints), 4, 4))
    for k, values in enumerate(joints):
        q = pin.neutral(model)
        for name, value in zip(names, values, strict=True):
            joint = model.joints[model.getJointId(name)]
            q[joint.idx_q : joint.idx_q + joint.nq] = (
                [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
            )
        pin.framesForwardKinematics(model, data, q)
        frames[k] = (data.oMf[top].inverse() * data.oMf[tool]).homogeneous
    return frames


def line(name: str, path: Path, root: str | None, tip: str | None, count: int) -> str:
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        begun = time.perf_counter()
        try:
            robot = rik.load_robot(path, root=root, tip=tip)
        except rik.InputError as error:
            return f"{name:20} {error}"
        took = time.perf_counter() - begun
    parts = f"{robot.chain.dof:2} joints, {len(robot.solids):3} solids, {len(robot.base_solids)} on the base"
    about = f"{name:20} {parts}, {len(said):2} warnings, {took:5.2f} s"
    base = f"footprint of {len(robot.footprint):2} corners, {robot.body_height:5.3f} m high"
    try:
        joints = postures(robot, count)
        theirs = pinocchio_tools(path, root, tip or _end(robot, path), robot.chain.names, joints)
    except ModuleNotFoundError:
        return f"{about}; {base}; pinocchio is absent"
    apart = np.abs(robot.tool(np.zeros(3), joints) - theirs).max()
    return "\n".join([f"{about}; {base}; against pinocchio {apart:.1e}", *(f"    {w.message}" for w in said)])


def _end(robot: Robot, path: Path) -> str:
    """The tip that was chosen where none was given: the leaf behind the chain's last joint."""
    from regionik.worlds.urdf.elements import read_urdf
    from regionik.worlds.urdf.kinematic_tree import kinematic_path

    return kinematic_path(read_urdf(path), None, None).tip


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    for name, package, end, root, tip in ARMS:
        path = installed(package, end)
        print(
            f"{name:20} absent: {package}" if path is None else line(name, path, root, tip, count), flush=True
        )


if __name__ == "__main__":
    main()
