"""URDF files: the arm is where the file says, nothing is lost, what is broken is one clear line."""

from __future__ import annotations

import socket
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

import regionik as rik
from regionik.cli import console
from regionik.output.urdf import robot_to_urdf
from regionik.worlds.bundled import robot_named
from regionik.worlds.documents.world_file import load_world, world_from_document, world_to_document
from regionik.worlds.errors import FileNote, InputError
from regionik.worlds.robot import Robot
from regionik.worlds.urdf.loader import load_robot
from tests import examples
from tests.maths import Array, planar_pose
from tests.test_export import awkward
from tests.urdfs import CRANE, crane, frames_of

inf = np.inf


def postures(robot: Robot, count: int = 20) -> Array:
    lower = np.where(np.isfinite(robot.chain.lower), robot.chain.lower, -4)
    upper = np.where(np.isfinite(robot.chain.upper), robot.chain.upper, 4)
    return np.random.default_rng(1).uniform(lower, upper, (count, robot.chain.dof))


def expected_tools(text: str, robot: Robot, joints: Array, root: str, tip: str) -> Array:
    tools = []
    for values in joints:
        frames = frames_of(text, dict(zip(robot.chain.names, values, strict=True)))
        tools.append(np.linalg.inv(frames[root]) @ frames[tip])
    return np.array(tools)


# --- the chain


def test_chain_limits_and_speeds(tmp_path: Path) -> None:
    robot = load_robot(crane(tmp_path), tip="tool")
    assert robot.name == "crane"
    assert robot.base == "omni"
    assert robot.chain.names == ("lift", "pivot", "elbow")
    assert [joint.kind for joint in robot.chain.joints] == ["prismatic", "revolute", "revolute"]
    assert [(j.lower, j.upper, j.velocity) for j in robot.chain.joints] == [
        (0.05, 0.35, 0.07),
        (-inf, inf, 2.0),
        (-1.5, 2.0, inf),  # a velocity of 0 is none
    ]


_BARE = pytest.mark.filterwarnings("ignore:.*are taken to stand still")


@_BARE
@pytest.mark.parametrize(
    ("root", "tip"), [("floor", "tool"), ("base", "fore"), ("torso", "tool"), ("plate", "fore")]
)
def test_the_tool_is_where_the_file_says(tmp_path: Path, root: str, tip: str) -> None:
    robot = load_robot(crane(tmp_path), root=root, tip=tip)
    joints = postures(robot)
    ours = robot.tool(np.zeros(3), joints)
    assert np.abs(ours - expected_tools(CRANE, robot, joints, root, tip)).max() < 1e-12


def test_mount_places_the_root_on_the_base(tmp_path: Path) -> None:
    mount = [0.3, -0.1, 0.2, 0.7]
    robot = load_robot(crane(tmp_path), root="base", tip="tool", mount=mount)
    joints = postures(robot)
    T_base_root = planar_pose(mount[0], mount[1], mount[3], mount[2])
    theirs = T_base_root @ expected_tools(CRANE, robot, joints, "base", "tool")
    assert np.abs(robot.tool(np.zeros(3), joints) - theirs).max() < 1e-12
    base = [1.0, 2.0, -0.4]
    assert np.allclose(robot.tool(base, joints), planar_pose(1.0, 2.0, -0.4) @ theirs, atol=1e-12)


@_BARE
def test_the_arm_stands_on_its_pivot_axis(tmp_path: Path) -> None:
    lifted = load_robot(crane(tmp_path), tip="tool", mount=[0.3, 0.1, 0.2, 0.7])
    frame = lifted.chain.frames(np.array([0.2, 1.0, 0.3]))[1]
    assert np.abs(frame[:2, 3]).max() < 1e-12
    plain = load_robot(crane(tmp_path), root="plate", tip="tool")
    T = plain.chain.joints[0].T_parent_joint
    assert T[:3, 3].tolist() == [0.0, 0.0, 0.0]
    assert plain.mount.tolist() == pytest.approx([0.01, 0.02, 0.03, 0.0])
    assert (T[:3, :3] @ plain.chain.joints[0].axis).tolist() == pytest.approx([0, 0, 1])


def test_a_chain_that_lies_down_stands_at_its_first_joint(tmp_path: Path) -> None:
    robot = load_robot(crane(tmp_path), root="upper", tip="tool")
    assert robot.mount.tolist() == [0.4, 0.0, 0.0, 0.0]
    joints = postures(robot)
    theirs = expected_tools(CRANE, robot, joints, "upper", "tool")
    assert np.abs(robot.tool(np.zeros(3), joints) - theirs).max() < 1e-12


def test_limits_may_be_ignored(tmp_path: Path) -> None:
    path = crane(tmp_path, ('<limit lower="-1.5" upper="2" effort="1" velocity="0"/>', ""))
    with pytest.raises(InputError, match=r"joint elbow: expected <limit lower"):
        load_robot(path, tip="tool")
    robot = load_robot(path, tip="tool", limits="ignore")
    assert np.isinf([robot.chain.lower, robot.chain.upper]).all()
    assert robot.carry[0] == 0.05  # the lift's own limits still say where it may rest


def test_the_one_longest_arm_needs_no_tip(tmp_path: Path) -> None:
    with pytest.raises(
        InputError, match=r"2 arms have 4 moving joints: left, right; valid links: floor, base"
    ):
        load_robot(crane(tmp_path))
    text = (tmp_path / "crane" / "crane.urdf").read_text()
    a, b = text.index('  <joint name="grip"'), text.index('  <joint name="neck"')
    bare = text[:a] + text[b:]
    bare = "\n".join(
        line for line in bare.splitlines() if not line.startswith(('  <link name="left', '  <link name="ri'))
    )
    (tmp_path / "crane" / "bare.urdf").write_text(bare)
    robot = load_robot(tmp_path / "crane" / "bare.urdf")
    joints = postures(robot)
    theirs = expected_tools(bare, robot, joints, "floor", "tool")
    assert np.abs(robot.tool(np.zeros(3), joints) - theirs).max() < 1e-12


@st.composite
def chains(draw: st.DrawFn) -> tuple[str, int]:
    """URDF text of a random chain from link 0 to link n, and n."""
    number = st.floats(-3, 3).map(lambda value: round(value, 4))
    triple = st.tuples(number, number, number)
    kinds = draw(st.lists(st.sampled_from(["revolute", "continuous", "prismatic", "fixed"]), max_size=6))
    kinds.insert(draw(st.integers(0, len(kinds))), "revolute")
    parts = ['<link name="0"/>']
    for k, kind in enumerate(kinds):
        xyz, rpy, axis = (" ".join(map(str, draw(triple))) for _ in range(3))
        turn = axis if any(float(word) for word in axis.split()) else "1 0 0"
        parts.append(
            f'<link name="{k + 1}"/><joint name="j{k}" type="{kind}"><origin xyz="{xyz}" rpy="{rpy}"/>'
            f'<axis xyz="{turn}"/><parent link="{k}"/><child link="{k + 1}"/>'
            '<limit lower="-2" upper="1"/></joint>'
        )
    return f'<robot name="r">{"".join(draw(st.permutations(parts)))}</robot>', len(kinds)


@pytest.mark.filterwarnings("ignore:.*no arm link has a collision element", "ignore:.*the tool point lies")
@settings(max_examples=examples(60))
@given(chains())
def test_any_chain_is_where_the_file_says(
    tmp_path_factory: pytest.TempPathFactory, made: tuple[str, int]
) -> None:
    text, count = made
    path = tmp_path_factory.mktemp("chain") / "r.urdf"
    path.write_text(text)
    robot = load_robot(path)
    joints = postures(robot, 3)
    theirs = expected_tools(text, robot, joints, "0", str(count))
    assert np.abs(robot.tool(np.zeros(3), joints) - theirs).max() < 1e-11


@pytest.mark.filterwarnings("ignore:.*the tool point lies 0.0.* m inside")
@pytest.mark.filterwarnings("ignore:.*base.* and joint_2_link 3 touch in 8")  # of the youBot, as its own do
@pytest.mark.parametrize("robot", [awkward(), robot_named("youbot-real"), robot_named("pioneer7")])
def test_what_we_export_we_read_back(tmp_path: Path, robot: Robot) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(robot_to_urdf(robot, shapely.box(-5, -5, 5, 5)))
    again = load_robot(path, root="base", tip="tool")
    joints = postures(robot)
    bases = np.random.default_rng(2).uniform(-2, 2, (len(joints), 3))
    assert np.abs(again.tool(bases, joints) - robot.tool(bases, joints)).max() < 1e-9
    assert again.chain.names == robot.chain.names
    assert again.chain.lower.tolist() == robot.chain.lower.tolist()
    assert again.chain.upper.tolist() == robot.chain.upper.tolist()
    assert [j.velocity for j in again.chain.joints] == [j.velocity for j in robot.chain.joints]
    if len(robot.footprint) > 1:
        ours, theirs = (shapely.MultiPoint(r.footprint).envelope for r in (robot, again))
        assert ours.symmetric_difference(theirs).area < 1e-12
        assert again.body_height == pytest.approx(robot.body_height)
    with_base = load_robot(path, tip="tool", footprint=[[0, 0]], body_height=0.1)
    assert with_base.chain.names == ("base_x", "base_y", "base_yaw", *robot.chain.names)


# --- the door


def test_load_robot_is_public_and_knows_the_bundled() -> None:
    assert rik.load_robot is load_robot
    assert rik.load_robot("youbot").name == "youbot"
    robot = load_robot("youbot", base="differential", footprint=[[0.2, 0.1], [-0.2, 0.1], [-0.2, -0.1]])
    assert (robot.base, len(robot.footprint)) == ("differential", 3)
    assert load_robot("youbot", mount=[0.1, 0, 0, 0], body_height=0.3).body_height == 0.3


def test_a_car_says_its_turning_radius(tmp_path: Path) -> None:
    path = crane(tmp_path)
    assert load_robot(path, base="car", tip="tool", turning_radius=0.7).turning_radius == 0.7
    with pytest.raises(InputError, match="turning_radius: a car needs"):
        load_robot(path, base="car", tip="tool")
    with pytest.raises(InputError, match="turning_radius: expected base car"):
        load_robot(path, tip="tool", turning_radius=0.7)


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"tip": "tol"}, "tip: unknown link 'tol', valid links: floor, base, wheel"),
        ({"root": "rot", "tip": "tool"}, "root: unknown link 'rot', valid links: floor"),
        ({"root": "head", "tip": "tool"}, "valid roots: floor, base, torso, plate, upper, fore"),
        ({"root": "floor", "tip": "base"}, "no joint moves between floor and base, valid tips: wheel, torso"),
        ({"tip": "tool", "base": "hover"}, "base: expected one of omni, differential, car"),
        ({"tip": "tool", "limits": "none"}, "limits: expected ignore"),
        ({"tip": "tool", "footprint": [[0, 0], [1, 0]]}, "footprint: expected one point or at least three"),
        (
            {"tip": "tool", "footprint": [[0, 0], [1, 0], [0.1, 0.1], [0, 1]]},
            "footprint: expected the corners",
        ),
        ({"tip": "tool", "footprint": "wide"}, "footprint: expected numbers"),
        ({"tip": "tool", "mount": [0, 0, 0]}, "mount: expected 4 numbers"),
        ({"tip": "tool", "mount": [0, 0, 1e12, 0]}, "mount: expected numbers of at most 1e+09"),
        ({"tip": "tool", "body_height": 0}, "body_height: must be above 0, got 0"),
        ({"tip": "tool", "body_height": float("nan")}, "body_height: every number must be finite"),
        ({"tip": "tool", "carry": [0.1]}, "carry: expected 3 values"),
        ({"tip": "tool", "carry": [0, 0, 0]}, "carry[0]: lift must be within its limits 0.05 to 0.35"),
    ],
)
def test_wrong_options(tmp_path: Path, options: dict[str, Any], expected: str) -> None:
    path = crane(tmp_path)
    with pytest.raises(InputError) as caught:
        load_robot(path, **options)
    assert expected in str(caught.value)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "options", "expected"),
    [
        ("tiagoo", {}, "valid names: youbot"),
        ("tiagoo", {}, "expected a path that ends in .urdf, .xml"),
        ("youbot", {"tip": "tool"}, "youbot: tip: a bundled robot has no links"),
        ("nowhere/robot.urdf", {}, "there is no such file"),
        ("robot.urdf.xacro", {}, "xacro robot.urdf.xacro > robot.urdf"),
        ("nowhere/it's.xacro", {}, """xacro 'it'"'"'s.xacro' > 'it'"'"'s.urdf'"""),
        ("nowhere/robot.sdf", {}, "expected a file that ends in .urdf, .xml"),
    ],
)
def test_wrong_names(name: str, options: dict[str, Any], expected: str) -> None:
    with pytest.raises(InputError) as caught:
        load_robot(name, **options)
    assert expected in str(caught.value)


# --- world files

WORLD = """\
version: 1
robot: {urdf: robots/crane/crane.urdf, tip: tool, mount: [0, 0, 0.1, 0], body_height: 0.5}
floor: {polygon: [[-3, -3], [3, -3], [3, 3], [-3, 3]]}
task: [{points: [[1, 0, 0.8]]}]
"""


def test_a_world_file_names_a_urdf_and_a_document_holds_it(tmp_path: Path) -> None:
    path = crane(tmp_path / "robots")
    (tmp_path / "site.yaml").write_text(WORLD)
    world = load_world(tmp_path / "site.yaml")
    document = world_to_document(world)
    path.unlink()
    again = world_from_document(document)
    assert world_to_document(again) == document
    direct = load_robot(crane(tmp_path / "robots"), tip="tool", mount=[0, 0, 0.1, 0], body_height=0.5)
    joints = postures(direct)
    for robot in (world.robot, again.robot):
        assert np.array_equal(robot.tool(np.zeros(3), joints), direct.tool(np.zeros(3), joints))
        assert (robot.name, robot.body_height) == ("crane", 0.5)
        assert [j.velocity for j in robot.chain.joints] == [0.07, 2.0, inf]
        assert np.array_equal(robot.footprint, direct.footprint)
        assert [(s.link, s.name, s.radius) for s in robot.solids] == [
            (s.link, s.name, s.radius) for s in direct.solids
        ]
        assert all(
            np.array_equal(a.corners, b.corners) for a, b in zip(robot.solids, direct.solids, strict=True)
        )


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"tip": "tol"}, "robot: {file}: tip: unknown link 'tol'"),
        ({"urdf": "robots/nothing.urdf"}, "nothing.urdf: there is no such file"),
        ({"carry": [0, 0, 0]}, "robot: {file}: carry[0]: lift"),
        ({"colour": "red"}, "robot: unknown key 'colour', valid keys: urdf, tip, root"),
    ],
)
def test_world_files_say_what_is_wrong_with_their_robot(
    tmp_path: Path, change: dict[str, Any], expected: str
) -> None:
    file = crane(tmp_path / "robots")
    document = yaml.safe_load(WORLD)
    document["robot"] |= change
    with pytest.raises(InputError) as caught:
        world_from_document(document, "site.yaml", tmp_path)
    assert expected.format(file=file) in str(caught.value)
    assert str(caught.value).startswith("site.yaml: robot")


# --- broken files


@dataclass(frozen=True)
class Broken:
    name: str
    text: str | bytes
    expected: str


def changed(old: str, new: str) -> str:
    assert CRANE.count(old) == 1, old
    return CRANE.replace(old, new)


def declared(doctype: str, link: str = "&lol;") -> str:
    return f'<!DOCTYPE robot [{doctype}]>\n<robot name="r"><link name="{link}"/></robot>'


_ELBOW = '<limit lower="-1.5" upper="2" effort="1" velocity="0"/>'
_JOINT = '<joint name="{0}" type="fixed"><parent link="{1}"/><child link="{2}"/></joint></robot>'
_BOMB = "".join(f'<!ENTITY l{k + 1} "{f"&l{k};" * 10}">' for k in range(9))
BROKEN = (
    Broken("empty", "", "line 1: not valid XML: no element found"),
    Broken("not xml", "robot: crane", "line 1: not valid XML"),
    Broken("cut short", CRANE[: len(CRANE) // 2], "not valid XML"),
    Broken("cut in a tag", CRANE[: CRANE.index("<geometry")] + "<geom", "not valid XML"),
    Broken("latin-1", CRANE.replace("crane", "gr\xfce").encode("latin-1"), "expected UTF-8 text"),
    Broken("utf-16", CRANE.encode("utf-16"), "expected UTF-8 text"),
    Broken("zeros", b"\0" * 100, "not valid XML"),
    Broken("deep", "<robot>" * 100_000, "levels of nesting"),
    Broken("html", "<html><body/></html>", "line 1: expected <robot> as first element, got <html>"),
    Broken("sdf", '<sdf version="1.6"><model/></sdf>', "expected <robot> as first element, got <sdf>"),
    Broken("entity bomb", declared('<!ENTITY l0 "lol">' + _BOMB, "&l9;"), "leave out <!DOCTYPE 'robot'"),
    Broken(
        "outer entity", declared('<!ENTITY lol SYSTEM "file:///etc/hostname">'), "document types and entities"
    ),
    Broken("unknown entity", '<robot name="r"><link name="&lol;"/></robot>', "undefined entity"),
    Broken(
        "xacro",
        changed('<link name="plate"/>', '<xacro:plate p="1"/>'),
        "xacro crane.urdf > crane.expanded.urdf",
    ),
    Broken(
        "xacro value", changed('radius="0.05"', 'radius="${r}"'), "xacro is not supported, expand it first"
    ),
    Broken("no name", changed('<robot name="crane"', "<robot"), "line 2: robot: expected a name"),
    Broken("no links", '<robot name="r"/>', "expected at least one <link>"),
    Broken("link twice", changed('name="plate"/>', 'name="torso"/>'), "link torso: this name is given twice"),
    Broken(
        "joint twice", changed('<joint name="neck"', '<joint name="lift"'), "joint lift: this name is given"
    ),
    Broken(
        "long name", changed('<link name="plate"/>', f'<link name="{"p" * 500}"/>'), "at most 120 printable"
    ),
    Broken("line break", changed('<link name="plate"/>', '<link name="p&#10;q"/>'), "printable characters"),
    Broken(
        "unknown parent",
        changed('<parent link="fore"/>', '<parent link="for"/>'),
        "joint flange: unknown parent link 'for', valid links: floor, base",
    ),
    Broken("no child", changed('<child link="fore"/>', ""), 'joint elbow: expected <child link="..."/>'),
    Broken(
        "no root", CRANE.replace("</robot>", _JOINT.format("back", "tool", "floor")), "no link is the root"
    ),
    Broken(
        "two roots",
        changed('<link name="plate"/>', '<link name="plate"/><link name="moon"/>'),
        "expected one root link, got 2: floor, moon",
    ),
    Broken(
        "loop",
        CRANE.replace(
            "</robot>",
            '<link name="m"/><link name="n"/><joint name="mn" type="fixed">'
            '<parent link="m"/><child link="n"/></joint>' + _JOINT.format("nm", "n", "m"),
        ),
        "links form a loop: ",
    ),
    Broken(
        "two parents",
        CRANE.replace("</robot>", _JOINT.format("also", "base", "tool")),
        "joint also: link tool is already the child of joint flange",
    ),
    Broken(
        "unknown type",
        changed('name="elbow" type="revolute"', 'name="elbow" type="hinge"'),
        "joint elbow: unknown type 'hinge', valid types: revolute, continuous, prismatic, fixed",
    ),
    Broken(
        "no type", changed('name="elbow" type="revolute"', 'name="elbow"'), "joint elbow: unknown type ''"
    ),
    Broken(
        "floating",
        changed('name="elbow" type="revolute"', 'name="elbow" type="floating"'),
        "joint elbow: a floating joint cannot be part of the arm, valid types: revolute",
    ),
    Broken(
        "mimic",
        changed(_ELBOW, _ELBOW + '<mimic joint="grip"/>'),
        "it copies joint grip (mimic), which does not move by itself between",
    ),
    Broken(
        "mimic of none",
        changed('<mimic joint="grip"', '<mimic joint="grab"'),
        "unknown joint 'grab', valid joints",
    ),
    Broken("no limit", changed(_ELBOW, ""), "joint elbow: expected <limit lower="),
    Broken(
        "nothing below the limit",
        changed(_ELBOW, '<limit lower="1e7" upper="1e8"/>'),
        "lower: expected a number below 1e",
    ),
    Broken(
        "nothing above the limit of a finger",
        changed('<limit lower="0.01" upper="0.04" effort="1" velocity="1"/>', '<limit upper="-inf"/>'),
        "upper: expected a number above -1e",
    ),
    Broken("half a limit", changed(_ELBOW, '<limit lower="-1"/>'), "joint elbow: expected <limit lower="),
    Broken(
        "limits crossed",
        changed(_ELBOW, '<limit lower="2" upper="-1"/>'),
        "joint elbow: expected lower limit <= upper limit, got 2 and -1",
    ),
    Broken(
        "limit nan",
        changed(_ELBOW, '<limit lower="nan" upper="1"/>'),
        "limit lower: expected a number, got 'nan'",
    ),
    Broken("slow", changed('velocity="0.07"', 'velocity="-1"'), "joint lift: velocity must not be below 0"),
    Broken(
        "zero axis",
        changed('<axis xyz="0 1 1"/>', '<axis xyz="0 0 0"/>'),
        "joint elbow: axis must not be zero",
    ),
    Broken(
        "nan axis",
        changed('<axis xyz="0 1 1"/>', '<axis xyz="0 nan 1"/>'),
        "joint elbow: axis xyz: expected 3 finite numbers",
    ),
    Broken(
        "inf origin",
        changed('xyz="0.25 0 0"', 'xyz="inf 0 0"'),
        "joint flange: origin xyz: expected 3 finite",
    ),
    Broken(
        "overflow", changed('xyz="0.25 0 0"', 'xyz="1e999 0 0"'), "expected 3 finite numbers of at most 1e+09"
    ),
    Broken("huge", changed('xyz="0.25 0 0"', 'xyz="1e12 0 0"'), "expected 3 finite numbers of at most 1e+09"),
    Broken("two numbers", changed('xyz="0.25 0 0"', 'xyz="0.25 0"'), "got '0.25 0'"),
    Broken("words", changed('xyz="0.25 0 0"', "xyz=\"1 __import__('os') 2\""), "expected 3 finite numbers"),
    Broken(
        "box of none", changed('size="0.6 0.4 0.2"', 'size="0.6 0 0.2"'), "link base: box: every size must be"
    ),
    Broken(
        "no radius",
        changed('sphere radius="0.04"', "sphere"),
        "link fore: sphere radius: expected one finite",
    ),
    Broken(
        "cone",
        changed('sphere radius="0.04"', 'cone radius="0.04"'),
        "expected one of box, cylinder, sphere, capsule, mesh",
    ),
    Broken("no geometry", changed('<geometry><sphere radius="0.04"/></geometry>', ""), "got nothing"),
    Broken(
        "nameless mesh", changed('filename="meshes/upper.stl"', ""), "link upper: mesh: expected a filename"
    ),
    Broken("flat mesh", changed("0.001 0.001 0.001", "1 0 1"), "link upper: mesh scale must not be zero"),
)


@pytest.mark.parametrize("case", BROKEN, ids=lambda case: case.name)
def test_broken_files_are_one_clear_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, case: Broken
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("a URDF file made a connection")

    path = crane(tmp_path)
    path.write_bytes(case.text if isinstance(case.text, bytes) else case.text.encode())
    monkeypatch.setattr(socket.socket, "connect", refuse)
    with pytest.raises(InputError) as caught:
        load_robot(path, tip="tool" if CRANE[:300] in str(case.text) else None)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert case.expected in message
    assert "\n" not in message
    assert len(message) < len(str(path)) + 1200


@pytest.mark.filterwarnings("ignore::UserWarning")
@settings(max_examples=examples(150))
@given(st.integers(0, len(CRANE)), st.integers(0, 40), st.text(max_size=5))
def test_a_spoilt_file_loads_or_is_refused(
    tmp_path_factory: pytest.TempPathFactory, start: int, length: int, put: str
) -> None:
    path = tmp_path_factory.getbasetemp() / "spoilt" / "spoilt.urdf"
    path.parent.mkdir(exist_ok=True)
    text = CRANE[:start] + put + CRANE[start + length :]
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    try:
        load_robot(path, tip="tool")
        said = ""
    except InputError as error:
        said = str(error)
    assert "\n" not in said


def test_masses_are_those_of_all_that_moves_with_a_joint(tmp_path: Path) -> None:
    """A bolted plate, a motor and a finger count with the link they hang on; what has no mass does not."""
    path = tmp_path / "arm.urdf"
    joint = (
        '<joint name="{0}" type="{1}"><origin xyz="{2}"/><parent link="{3}"/><child link="{4}"/>{5}</joint>'
    )
    turns = '<axis xyz="0 0 1"/><limit lower="-1" upper="1"/>'
    inertial = '<inertial><origin xyz="{1}" rpy="0 0 1"/><mass value="{0}"/></inertial>'
    weights = {
        "base": inertial.format(50, "0 0 0"),
        "arm": inertial.format(2, "0.1 0 0")
        + '<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision>',
        "motor": inertial.format(1, "0 0 0"),
        "tool": "<inertial/>",
        "finger": inertial.format(0.5, "0 0 0.1"),
    }
    path.write_text(
        '<robot name="arm">'
        + "".join(f'<link name="{name}">{text}</link>' for name, text in weights.items())
        + joint.format("pivot", "revolute", "0 0 0.2", "base", "arm", turns)
        + joint.format("bolts", "fixed", "0.3 0 0", "arm", "motor", "")
        + joint.format("wrist", "revolute", "0.3 0 0.1", "arm", "tool", turns)
        + joint.format("grip", "prismatic", "0 0.02 0", "tool", "finger", '<limit lower="0" upper="0.01"/>')
        + "</robot>"
    )
    robot = load_robot(path, tip="tool", payload=0.25)
    (arm, tool), load = robot.masses, robot.loads[-1]
    assert (arm.link, arm.mass, tool.link, tool.mass) == (0, 3.0, 1, 0.5)
    np.testing.assert_allclose(arm.center, [0.5 / 3, 0, 0], atol=1e-12)
    np.testing.assert_allclose(tool.center, [0, 0.02, 0.1], atol=1e-12)
    assert (load.link, load.mass) == (1, 0.25)
    np.testing.assert_allclose(load.center, np.zeros(3), atol=1e-12)
    path.write_text(path.read_text().replace('value="2"', 'value="-2"'))
    with pytest.raises(InputError, match="link arm: mass must not be below 0, got -2"):
        load_robot(path, tip="tool")


def test_notes_on_a_robot_are_said_by_plan_alone(tmp_path: Path) -> None:
    (tmp_path / "crane.urdf").write_text(crane(tmp_path).read_text())  # apart from its meshes
    (tmp_path / "w.yaml").write_text(
        "version: 1\nrobot: {urdf: crane.urdf, tip: tool}\n"
        "floor: {polygon: [[-2, -2], [2, -2], [2, 2], [-2, 2]]}\ntask: [{points: [[0.5, 0, 1]]}]\n"
    )
    progress = console.DelayedProgress()
    with pytest.warns(FileNote, match="upper.stl: there is no such file; a capsule .* replaces it"):
        noted = console.read_world_to_plan(str(tmp_path / "w.yaml"), progress)
    quiet = console.read_world(str(tmp_path / "w.yaml"), progress)  # a warning would be an error
    assert quiet.robot.chain.names == noted.robot.chain.names
