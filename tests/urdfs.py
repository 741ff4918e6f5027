"""Small URDF files of our own, and a second reading of where their links are."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import trimesh
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from regionik.worlds.links import LinkBox, LinkHull
from tests.kinds import LinkSolid
from tests.maths import Array

CRANE = """\
<?xml version="1.0"?>
<robot name="crane" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <!-- a base on two wheels, a lift, a pivot, an elbow; a head and two fingers that no chain drives -->
  <link name="floor"/>
  <link name="base">
    <collision><origin xyz="0 0 0.2"/><geometry><box size="0.6 0.4 0.2"/></geometry></collision>
  </link>
  <link name="wheel">
    <collision><geometry><cylinder radius="0.1" length="0.04"/></geometry></collision>
  </link>
  <link name="torso">
    <visual><geometry><box size="9 9 9"/></geometry></visual>
    <collision><origin xyz="0 0 -0.2"/><geometry><cylinder radius="0.05" length="0.6"/></geometry></collision>
  </link>
  <link name="plate"/>
  <link name="upper">
    <collision>
      <origin xyz="0.1 0 0" rpy="0 0 0.3"/>
      <geometry><mesh filename="meshes/upper.stl" scale="0.001 0.001 0.001"/></geometry>
    </collision>
  </link>
  <link name="fore">
    <collision>
      <origin xyz="0.1 0 0" rpy="0.2 0.3 0.4"/><geometry><box size="0.2 0.05 0.06"/></geometry>
    </collision>
    <collision><origin xyz="0.2 0 0"/><geometry><sphere radius="0.04"/></geometry></collision>
  </link>
  <link name="tool"/>
  <link name="left"><collision><geometry><box size="0.02 0.01 0.05"/></geometry></collision></link>
  <link name="right"><collision><geometry><box size="0.02 0.01 0.05"/></geometry></collision></link>
  <link name="head"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <joint name="stand" type="fixed"><origin xyz="0 0 0.05"/><parent link="floor"/><child link="base"/></joint>
  <joint name="axle" type="continuous">
    <origin xyz="0.1 0.25 0.05" rpy="1.5707963267948966 0 0"/><parent link="base"/><child link="wheel"/>
    <axis xyz="0 0 1"/>
  </joint>
  <joint name="lift" type="prismatic">
    <origin xyz="0.1 0.02 0.6"/><parent link="base"/><child link="torso"/><axis xyz="0 0 2"/>
    <limit lower="0.05" upper="0.35" effort="1" velocity="0.07"/>
  </joint>
  <joint name="bolts" type="fixed">
    <origin xyz="0.05 0 0.1" rpy="0 0 0.5"/><parent link="torso"/><child link="plate"/>
  </joint>
  <joint name="pivot" type="continuous">
    <origin xyz="0.01 0.02 0.03" rpy="3.141592653589793 0 0"/><parent link="plate"/><child link="upper"/>
    <axis xyz="0 0 -1"/><limit effort="1" velocity="2"/>
  </joint>
  <joint name="elbow" type="revolute">
    <origin xyz="0.4 0 0" rpy="0.1 0.2 0.3"/><parent link="upper"/><child link="fore"/><axis xyz="0 1 1"/>
    <limit lower="-1.5" upper="2" effort="1" velocity="0"/>
  </joint>
  <joint name="flange" type="fixed">
    <origin xyz="0.25 0 0" rpy="0 1.5707963267948966 0"/><parent link="fore"/><child link="tool"/>
  </joint>
  <joint name="grip" type="prismatic">
    <origin xyz="0 0.02 0.03"/><parent link="tool"/><child link="left"/><axis xyz="0 1 0"/>
    <limit lower="0.01" upper="0.04" effort="1" velocity="1"/>
  </joint>
  <joint name="grip_too" type="prismatic">
    <origin xyz="0 -0.02 0.03"/><parent link="tool"/><child link="right"/><axis xyz="0 -1 0"/>
    <limit lower="0" upper="0.04" effort="1" velocity="1"/><mimic joint="grip" multiplier="1" offset="0.005"/>
  </joint>
  <joint name="neck" type="revolute">
    <origin xyz="0 0 0.3"/><parent link="torso"/><child link="head"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/>
  </joint>
  <transmission name="t"><joint name="lift"><hardwareInterface>x</hardwareInterface></joint></transmission>
</robot>
"""
UPPER_SIZE = (400.0, 60.0, 80.0)  # of meshes/upper.stl [mm]


def crane(folder: Path, *changes: tuple[str, str]) -> Path:
    """The crane's file with its mesh beside it, each change made once."""
    text = CRANE
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    package = folder / "crane"
    (package / "meshes").mkdir(parents=True, exist_ok=True)
    (package / "package.xml").write_text("<package/>")
    trimesh.creation.box(UPPER_SIZE).export(package / "meshes" / "upper.stl")
    path = package / "crane.urdf"
    path.write_text(text)
    return path


def frames_of(text: str, values: Mapping[str, float]) -> dict[str, Array]:
    """Every link's frame in the root, joints at ``values`` or zero: a second reading."""
    root = ElementTree.fromstring(text)
    joints = root.findall("joint")
    children = {_link(joint, "child") for joint in joints}
    frames = {
        name: np.eye(4) for link in root.findall("link") if (name := link.attrib["name"]) not in children
    }
    while len(frames) < len(root.findall("link")):
        for joint in joints:
            parent, child = _link(joint, "parent"), _link(joint, "child")
            if parent in frames and child not in frames:
                moved = _motion(joint, values.get(joint.attrib["name"], 0.0))
                frames[child] = frames[parent] @ origin_of(joint) @ moved
    return frames


def origin_of(element: ElementTree.Element) -> Array:
    origin = element.find("origin")
    given = {} if origin is None else origin.attrib
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("xyz", [float(w) for w in given.get("rpy", "0 0 0").split()]).as_matrix()
    T[:3, 3] = [float(w) for w in given.get("xyz", "0 0 0").split()]
    return T


def depth(solid: LinkSolid, points: Array) -> Array:
    """How far points (n, 3) of the link's frame stick out of a solid (n,); at most 0 inside."""
    if isinstance(solid, LinkBox):
        local = (points - solid.T_link_box[:3, 3]) @ solid.T_link_box[:3, :3]
        outside: Array = (np.abs(local) - solid.size / 2).max(1)
        return outside
    if isinstance(solid, LinkHull):
        planes = ConvexHull(solid.corners).equations
        beyond: Array = (points @ planes[:, :3].T + planes[:, 3]).max(1)
        return beyond
    along = solid.end - solid.start
    share = np.clip((points - solid.start) @ along / (along @ along), 0, 1)
    away: Array = np.linalg.norm(points - solid.start - share[:, None] * along, axis=1)
    return away - solid.radius


def _link(joint: ElementTree.Element, role: str) -> str:
    end = joint.find(role)
    assert end is not None
    return end.attrib["link"]


def _motion(joint: ElementTree.Element, value: float) -> Array:
    given = joint.find("axis")
    axis = np.array([float(w) for w in ("1 0 0" if given is None else given.attrib["xyz"]).split()])
    axis /= np.linalg.norm(axis)
    T = np.eye(4)
    if joint.attrib["type"] == "prismatic":
        T[:3, 3] = value * axis
    elif joint.attrib["type"] in ("revolute", "continuous"):
        T[:3, :3] = Rotation.from_rotvec(value * axis).as_matrix()
    return T
