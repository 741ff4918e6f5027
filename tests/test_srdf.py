"""SRDF files beside URDF files, pairs and postures that they name, tools, and virtual bases."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

from regionik.worlds.bundled import robot_named
from regionik.worlds.documents.world_file import load_world, world_from_document, world_to_document
from regionik.worlds.errors import InputError
from regionik.worlds.links import LinkBox, LinkCapsule
from regionik.worlds.robot import Robot, Tool, with_tool
from regionik.worlds.self_collision import overhang, postures_clear, rest_posture, self_collision_pairs
from regionik.worlds.urdf.loader import load_robot
from tests.maths import pose
from tests.urdfs import crane

SRDF = """\
<robot name="crane">
  <virtual_joint name="world" type="planar" parent_frame="map" child_link="floor"/>
  <group name="arm"><chain base_link="floor" tip_link="tool"/></group>
  <group_state name="reach_out" group="arm">
    <joint name="lift" value="0.3"/><joint name="pivot" value="1"/><joint name="elbow" value="0.1"/>
  </group_state>
  <group_state name="arm_stowed" group="arm">
    <joint name="lift" value="0.06"/><joint name="pivot" value="0.5"/><joint name="elbow" value="1.2"/>
  </group_state>
  <group_state name="broken"><joint name="elbow" value="7"/><joint name="lift" value="0.1"/></group_state>
  <group_state name="open"><joint name="grip" value="0.02"/><joint name="world" value="0 0 0"/></group_state>
  <disable_collisions link1="torso" link2="fore" reason="Never"/>
  <disable_collisions link1="torso" link2="elsewhere" reason="Never"/>
</robot>
"""


def crane_with(folder: Path, srdf: str, name: str = "crane.srdf") -> Path:
    path = crane(folder)
    (path.parent / name).parent.mkdir(exist_ok=True)
    (path.parent / name).write_text(srdf)
    return path


def pairs(robot: Robot) -> set[frozenset[str]]:
    return {frozenset(names) for names in robot.unchecked}


def test_the_file_beside_gives_pairs_and_the_posture_to_rest_in(tmp_path: Path) -> None:
    robot = load_robot(crane_with(tmp_path, SRDF), tip="tool")
    assert robot.carry.tolist() == [0.06, 0.5, 1.2]
    assert pairs(robot) >= {frozenset({"torso", "fore 1"}), frozenset({"torso", "fore 2"})}
    assert frozenset({"torso", "left"}) not in pairs(robot)
    names = [solid.name for solid in robot.all_solids]
    assert not any({names[i], names[k]} == {"torso", "fore 1"} for i, k in self_collision_pairs(robot))
    assert load_robot(crane_with(tmp_path, SRDF), tip="tool", carry="reach_out").carry.tolist() == [
        0.3,
        1,
        0.1,
    ]
    assert load_robot(crane_with(tmp_path, SRDF), tip="tool", carry=[0.1, 0, 0]).carry.tolist() == [0.1, 0, 0]


def test_a_file_may_be_named_or_lie_in_the_folder_srdf(tmp_path: Path) -> None:
    path = crane_with(tmp_path, SRDF, "other.srdf")
    named = load_robot(path, tip="tool", srdf=path.parent / "other.srdf")
    (path.parent / "urdf").mkdir()
    (path.parent / "srdf").mkdir()
    moved = path.rename(path.parent / "urdf" / "crane.urdf")
    (path.parent / "other.srdf").rename(path.parent / "srdf" / "crane.srdf")
    moved.write_text(moved.read_text().replace('filename="meshes', 'filename="../meshes'))
    assert load_robot(moved, tip="tool").unchecked == named.unchecked


def test_all_pairs_of_a_link_and_those_taken_back(tmp_path: Path) -> None:
    text = """<robot name="crane"><disable_default_collisions link="fore"/>
    <enable_collisions link1="fore" link2="torso"/></robot>"""
    disabled = pairs(load_robot(crane_with(tmp_path, text), tip="tool"))
    assert frozenset({"fore 1", "head"}) in disabled
    assert frozenset({"fore 1", "torso"}) not in disabled


BROKEN = {
    "<model/>": "line 1: expected <robot> as first element",
    '<robot><disable_collisions link1="torso"/></robot>': 'line 1: disable_collisions: expected link2="..."',
    '<robot><group_state><joint name="lift"/></group_state></robot>': "line 1: group_state: expected a name",
    SRDF.replace('"0.3"', '"high"'): "line 5: group_state reach_out: joint lift: expected one finite number",
    SRDF.replace('"0.3"', '""'): "line 5: group_state reach_out: joint lift: expected one finite number",
    '<robot><disable_collisions link1="a" link2="b"/></robot>': "names a, b, none of which is in crane.urdf",
    "<robot": "not valid XML",
}


@pytest.mark.parametrize(("text", "expected"), BROKEN.items())
def test_broken_files_are_one_clear_line(tmp_path: Path, text: str, expected: str) -> None:
    with pytest.raises(InputError) as caught:
        load_robot(crane_with(tmp_path, text), tip="tool")
    assert str(caught.value).startswith(str(tmp_path / "crane" / "crane.srdf"))
    assert expected in str(caught.value)
    assert "\n" not in str(caught.value)


def test_wrong_names_are_told_with_the_valid_ones(tmp_path: Path) -> None:
    path = crane_with(tmp_path, SRDF)
    with pytest.raises(
        InputError, match="carry: unknown posture 'tuck', valid postures: reach_out, arm_stowed"
    ):
        load_robot(path, tip="tool", carry="tuck")
    with pytest.raises(InputError, match=r"posture broken\[2\]: elbow must be within its limits"):
        load_robot(path, tip="tool", carry="broken")
    with pytest.raises(
        InputError, match=r"unchecked\[0\]: expected names of links or solids \(.*fore.*got 'x'"
    ):
        load_robot(path, tip="tool", unchecked=[("torso", "x")])
    with pytest.raises(InputError, match="there is no such file"):
        load_robot(path, tip="tool", srdf=tmp_path / "none.srdf")
    with pytest.raises(InputError, match=r"expected a file that ends in \.srdf"):
        load_robot(path, tip="tool", srdf=path)
    with pytest.raises(InputError, match="youbot: srdf: a bundled robot has no links"):
        load_robot("youbot", srdf=path)
    with pytest.raises(InputError, match="youbot: carry: expected joint values"):
        load_robot("youbot", carry="tuck")


def test_a_resting_posture_in_which_links_touch_is_passed_over(tmp_path: Path) -> None:
    inside = SRDF.replace('name="elbow" value="1.2"', 'name="elbow" value="-1.5"').replace(
        '<disable_collisions link1="torso" link2="fore" reason="Never"/>', ""
    )
    path = crane_with(tmp_path, inside)
    path.write_text(
        path.read_text().replace('xyz="0.4 0 0" rpy="0.1 0.2 0.3"', 'xyz="0.1 0 0" rpy="0.1 0.2 0.3"')
    )
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        robot = load_robot(path, tip="tool")
    assert postures_clear(robot, robot.carry[None], 0.0).all()
    touching = [str(w.message) for w in said if "links touch in posture" in str(w.message)]
    assert bool(touching) == (robot.carry.tolist() not in ([0.06, 0.5, -1.5], [0.3, 1.0, 0.1]))


def test_without_a_named_posture_the_arm_rests_clear_and_closer_in_than_at_zeros(tmp_path: Path) -> None:
    robot = load_robot(crane(tmp_path), tip="tool")
    again = load_robot(crane(tmp_path), tip="tool")
    assert robot.carry.tolist() == again.carry.tolist()
    assert postures_clear(robot, robot.carry[None], 0.0).all()
    zeros = np.clip(np.zeros(3), robot.chain.lower, robot.chain.upper)
    at_rest, at_zeros = overhang(robot, np.stack([robot.carry, zeros]))
    assert at_rest < at_zeros - 0.05


@pytest.mark.parametrize("name", ["youbot", "hinge5", "pioneer7"])
def test_rest_postures_are_clear_and_within_limits(name: str) -> None:
    robot = robot_named(name)
    rest = rest_posture(robot)
    assert rest is not None
    robot.chain.check_limits(rest.tolist(), "rest")
    assert postures_clear(robot, rest[None], 0.0).all()


def test_a_tool_moves_the_tool_frame_and_its_solids_go_with_the_last_link() -> None:
    arm = robot_named("youbot")
    T = pose([0.0, 0.02, 0.1], [0.1, 0.2, 0.3])
    pen = LinkCapsule(0, "pen", np.zeros(3), np.array([0, 0.02, 0.08]), 0.01)
    block = LinkBox(0, "grip", pose([0, 0, 0.03], [0, 0, 0.4]), np.array([0.05, 0.1, 0.02]))
    robot = with_tool(arm, Tool(T, (pen, block)))
    joints = np.array([0.3, 0.5, 0.4, -0.2, 1.0])
    assert robot.chain.forward(joints) == pytest.approx(arm.chain.forward(joints) @ T)
    ours = robot.chain.frames(joints)[4] @ np.append(robot.solids[-2].corners[1], 1)
    assert ours == pytest.approx(arm.chain.forward(joints) @ [0, 0.02, 0.08, 1])
    assert [solid.link for solid in robot.solids[-2:]] == [4, 4]


TOOL = {
    "position": [0.0, 0.0, 0.1],
    "rpy": [0.0, 0.3, 0.0],
    "solids": [
        {"name": "pen", "start": [0.0, 0.0, 0.0], "end": [0.0, 0.0, 0.08], "radius": 0.01},
        {"name": "grip", "size": [0.05, 0.1, 0.02], "position": [0.0, 0.0, 0.03]},
    ],
}


def test_any_robot_of_a_world_file_takes_a_tool(tmp_path: Path) -> None:
    path = crane_with(tmp_path, SRDF)
    document = world_to_document(load_world("slab"))
    document.pop("start", None)
    dh = world_to_document(load_world("shelf"))["robot"]
    urdf = {"urdf": str(path), "tip": "tool", "carry": "arm_stowed", "unchecked": [["upper", "left"]]}
    for robot in ({"name": "youbot"}, dh if isinstance(dh, dict) else {"name": "hinge5"}, urdf):
        plain = world_from_document({**document, "robot": robot}).robot
        tooled = world_from_document({**document, "robot": {**robot, "tool": TOOL}})
        zeros = np.clip(np.zeros(plain.chain.dof), plain.chain.lower, plain.chain.upper)
        expected = plain.chain.forward(zeros) @ pose([0, 0, 0.1], [0, 0.3, 0])
        assert tooled.robot.chain.forward(zeros) == pytest.approx(expected)
        assert [solid.name for solid in tooled.robot.solids[-2:]] == ["pen", "grip"]
        again = world_from_document(world_to_document(tooled)).robot
        assert again.chain.forward(zeros) == pytest.approx(expected, abs=1e-15)
        assert again.unchecked == tooled.robot.unchecked
        assert again.carry.tolist() == tooled.robot.carry.tolist()
    bent = {
        **TOOL,
        "solids": [{"name": "pen", "radius": 0.01, "start": [0, 0, 0], "end": [0, 0, 0.1], "link": 2}],
    }
    with pytest.raises(InputError, match=r"robot.tool.solids\[0\]: unknown key 'link'"):
        world_from_document({**document, "robot": {"name": "youbot", "tool": bent}})


VIRTUAL = """\
<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/><axis xyz="{4}"/>
<limit lower="-999999" upper="999999" effort="1" velocity="1"/></joint><link name="{2}"/>"""


@pytest.mark.parametrize(
    "joints",
    [
        [("x", "prismatic", "1 0 0"), ("y", "prismatic", "0 1 0"), ("yaw", "revolute", "0 0 1")],
        [("yaw", "revolute", "0 0 1"), ("x", "prismatic", "1 0 0")],
        [("plane", "planar", "0 0 1")],
    ],
)
def test_a_virtual_base_is_no_part_of_the_arm(tmp_path: Path, joints: list[tuple[str, str, str]]) -> None:
    links = [f"v{k}" for k in range(len(joints))] + ["floor"]
    text = "".join(
        VIRTUAL.format(n, kind, links[k], links[k + 1], axis) for k, (n, kind, axis) in enumerate(joints)
    )
    plain = load_robot(crane(tmp_path), tip="tool")
    robot = load_robot(crane(tmp_path, ("</robot>", text + "</robot>")), tip="tool")
    assert robot.chain.names == plain.chain.names
    assert robot.footprint.tolist() == plain.footprint.tolist()
    with pytest.raises(
        InputError, match="only the joints of a virtual base move floor, expected a tip behind"
    ):
        load_robot(crane(tmp_path, ("</robot>", text + "</robot>")), tip="floor")
