"""World files: what is read, what is refused, and that nothing is lost on the way back."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
import shapely
import trimesh
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import regionik as rik
from docs.schemas import world_schema
from regionik.view.page import html_page
from regionik.worlds.bundled import robot_named, world_names, world_path
from regionik.worlds.chain import Chain
from regionik.worlds.documents.world_file import RulesPart, load_world, world_from_document, world_to_document
from regionik.worlds.errors import FileNote, InputError
from regionik.worlds.joints import Joint
from regionik.worlds.limits import Criteria
from regionik.worlds.links import LinkBox, LinkCapsule, capsules_along
from regionik.worlds.obstacles import Box, Cylinder, Mesh, Prism, Sphere
from regionik.worlds.readers.text import MAX_BYTES, read_document
from regionik.worlds.robot import Robot
from regionik.worlds.scene import Rules, World
from tests import examples
from tests.maths import planar_pose
from tests.nasty import GOOD, NASTY, Nasty, broken

ROOT = Path(__file__).parent.parent


def good() -> dict[str, Any]:
    document: dict[str, Any] = yaml.safe_load(GOOD)
    return document


def through_json(document: dict[str, Any]) -> dict[str, Any]:
    again: dict[str, Any] = json.loads(json.dumps(document, allow_nan=False))
    return again


def assert_same(a: Any, b: Any) -> None:
    """Two worlds, or parts of them, are equal to the last bit."""
    assert type(a) is type(b)
    if isinstance(a, np.ndarray):
        assert a.dtype == b.dtype
        assert np.array_equal(a, b)
    elif isinstance(a, shapely.Geometry):
        assert shapely.equals_exact(a, b, 0.0)
    elif isinstance(a, tuple):
        assert len(a) == len(b)
        for one, other in zip(a, b, strict=True):
            assert_same(one, other)
    elif hasattr(a, "__dataclass_fields__"):
        for field in fields(a):
            assert_same(getattr(a, field.name), getattr(b, field.name))
    else:
        assert a == b


def assert_round_trip(world: World) -> None:
    document = through_json(world_to_document(world))
    again = world_from_document(document)
    assert_same(world, again)
    assert json.dumps(world_to_document(again)) == json.dumps(document)
    jsonschema.validate(document, world_schema())


@pytest.mark.parametrize("case", NASTY, ids=lambda case: case.name)
def test_broken_files_are_refused_in_one_line(case: Nasty, tmp_path: Path) -> None:
    path = tmp_path / f"broken{case.suffix}"
    path.write_text(case.text)
    with pytest.raises(InputError) as caught:
        load_world(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert len(message.splitlines()) == 1
    for part in case.expected:
        assert part in message


def test_there_are_many_kinds_of_broken_files() -> None:
    assert len({case.name for case in NASTY}) == len(NASTY) >= 20


def test_the_good_file_is_good(tmp_path: Path) -> None:
    (tmp_path / "good.yml").write_text(GOOD)
    world = load_world(tmp_path / "good.yml")
    assert (world.name, len(world.task), len(world.obstacles)) == ("good", 5, 2)
    assert world.rules == Rules(clearance=0.2, step=0.1)
    assert world.start is not None
    assert world.start.joints.tolist() == [0, 1, 0, 1, 0]


@pytest.mark.parametrize("name", world_names())
def test_bundled_worlds_come_back_equal_and_fit_the_schema(name: str) -> None:
    world = load_world(name)
    assert world.name == name
    assert world.about
    assert_round_trip(world)
    jsonschema.validate(read_document(world_path(name)), world_schema())


def test_committed_schema_is_the_current_one() -> None:
    committed = (ROOT / "docs" / "world.schema.json").read_text()
    assert committed == json.dumps(world_schema(), indent=2) + "\n"


def test_schema_is_a_schema_and_refuses_what_the_loader_refuses() -> None:
    jsonschema.Draft202012Validator.check_schema(world_schema())
    for text in (
        broken("yaw: 0.0", "jaw: 0.0"),
        broken("step: 0.1", "step: 0"),
        broken("version: 1", "version: 2"),
    ):
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(yaml.safe_load(text), world_schema())


def test_rules_of_the_grammar_are_the_rules_of_a_world() -> None:
    assert set(RulesPart.model_fields) == {field.name for field in fields(Rules)}
    assert Rules(**RulesPart().model_dump()) == Rules()


def test_every_solid_and_every_piece_come_back_equal(tmp_path: Path) -> None:
    trimesh.creation.box((0.1, 0.2, 0.3)).export(tmp_path / "block.stl")
    (tmp_path / "path.csv").write_text("x,y,z,dx,dy,dz\n100,200,300,1,2,3\n110,200,300,1,2,-3\n")
    document = good()
    document["about"] = "everything at once"
    document["floor"]["holes"] = [[[3.0, 1.0], [3.5, 1.0], [3.5, 1.5]]]
    document["obstacles"] += [
        {"name": "ball", "sphere": {"radius": 0.2, "center": [0.0, 0.1, 0.8]}},
        {"name": "shelf", "prism": {"polygon": [[2, -0.5], [3, -0.5], [3, -0.1]], "z": [0.9, 1.0]}},
        {
            "name": "ring",
            "prism": {
                "polygon": [[2, 1], [3, 1], [3, 2], [2, 2]],
                "holes": [[[2.2, 1.2], [2.8, 1.2], [2.8, 1.8]]],
                "z": [0, 1],
            },
        },
        {
            "name": "blade",
            "mesh": {"file": "block.stl", "position": [3, 1, 0.5], "rpy": [0.1, 0.2, 0.3], "scale": 2.0},
        },
    ]
    document["task"] += [
        {
            "arc": {"center": [0, 1, 0.3], "radius": 0.3, "from": -1.57, "to": 0.1, "count": 7},
            "direction": [0.3, 0.2, -1],
        },
        {"points": [[0, 1.5, 0.2], [0.1, 1.5, 0.2]], "orientation": [0.5, 0.5, 0.5, 0.5], "cone": 0.3},
        {"csv": "path.csv", "frame": {"position": [-1, 1, 0], "rpy": [0, 0, 1]}, "scale": 0.001, "cone": 0.7},
        {"points": [[0.3, 1.5, 0.2]]},
    ]
    document["rules"] |= {"max_lift_offs": 2, "heading": "fixed"}
    world = world_from_document(document, "everything", tmp_path)
    kinds = [Box, Cylinder, Sphere, Prism, Prism, Mesh]
    assert [type(solid) for solid in world.obstacles] == kinds
    assert len(world.task) == 5 + 7 + 2 + 2 + 1
    assert_round_trip(world)


def test_a_mesh_file_is_scaled_turned_and_moved(tmp_path: Path) -> None:
    trimesh.creation.box((2.0, 4.0, 6.0)).export(tmp_path / "block.stl")
    mesh = {"file": "block.stl", "position": [1, 2, 3], "rpy": [0, 0, np.pi / 2], "scale": 0.1}
    document = good() | {"obstacles": [{"name": "m", "mesh": mesh}]}
    solid = world_from_document(document, "w", tmp_path).obstacles[0]
    assert isinstance(solid, Mesh)
    assert len(solid.vertices) == 8
    np.testing.assert_allclose(solid.vertices.min(axis=0), [0.8, 1.9, 2.7], atol=1e-7)
    np.testing.assert_allclose(solid.vertices.max(axis=0), [1.2, 2.1, 3.3], atol=1e-7)


@pytest.mark.parametrize(
    ("suffix", "content"),
    [
        (".stl", b""),
        (".stl", b"solid x\nfacet"),
        (".ply", b"ply\nnonsense"),
        (".obj", b"v 1 2 x\n"),
        (".off", b"OFF\n9"),
    ],
)
def test_broken_meshes_are_refused(suffix: str, content: bytes, tmp_path: Path) -> None:
    (tmp_path / f"m{suffix}").write_bytes(content)
    document = good() | {"obstacles": [{"name": "m", "mesh": {"file": f"m{suffix}"}}]}
    with pytest.raises(InputError, match=r"obstacles\[0\].mesh.file: .*m\.") as caught:
        world_from_document(document, "w", tmp_path)
    assert len(str(caught.value).splitlines()) == 1


DH = [
    [0.3, 0.2, 0.05, 1.2, -2.0, 2.0],
    [0.0, 0.0, 0.3, 0.1, None, 1.0],
    [-0.4, 0.1, 0.2, -1.5707963267948966, -1, None],
]


def test_dh_robots() -> None:
    robot = {
        "dh": DH,
        "names": ["a", "b", "c"],
        "mount": [0.1, 0.2, 0.3, 0.4],
        "link_radius": 0.02,
        "carry": [1, 0, 1],
    }
    world = world_from_document(good() | {"robot": robot, "start": {"base": [0, 0, 0], "joints": [0, 0, 0]}})
    assert world.robot.chain.names == ("a", "b", "c")
    assert world.robot.chain.lower.tolist() == [-2.0, -np.inf, -1.0]
    assert {solid.radius for solid in world.robot.solids} == {0.02}
    assert_round_trip(world)
    ignoring = world_from_document(
        good() | {"robot": robot | {"limits": "ignore"}, "start": {"base": [0, 0, 0], "joints": [9, 9, 9]}}
    )
    assert np.isinf(ignoring.robot.chain.upper).all()
    assert_round_trip(ignoring)


@settings(max_examples=examples(40))
@given(
    st.lists(
        st.tuples(*[st.floats(-3.1, 3.1), st.floats(-1, 1), st.floats(-1, 1), st.floats(-3.1, 3.1)]),
        min_size=1,
        max_size=6,
    )
)
def test_any_dh_robot_comes_back_equal(rows: list[tuple[float, float, float, float]]) -> None:
    robot = {"dh": [[*row, -3.0, 3.0] for row in rows]}
    document = good() | {"robot": robot}
    del document["start"]
    assert_round_trip(world_from_document(document))


def test_other_chains_come_back_equal() -> None:
    joints = (
        Joint("lift", "prismatic", 0.0, 0.5, planar_pose(0.1, 0.2, 0.3, 0.4), np.array([0.0, 0.6, 0.8]), 0.3),
        Joint("turn", "revolute", -np.inf, np.inf, planar_pose(0.1, 0.0, -1.3), np.array([1.0, 2.0, 3.0])),
    )
    chain = Chain(joints, planar_pose(0.2, 0.0, 0.7))
    solids = (LinkCapsule(1, "hand", np.zeros(3), np.array([0.2, 0.0, 0.0]), 0.05),)
    robot = Robot(
        "own",
        "omni",
        np.array([[1.0, 0], [0, 1], [-1, 0]]),
        np.zeros(4),
        chain,
        solids,
        0.2,
        np.array([0.1, 4.0]),
    )
    plain = world_from_document({key: value for key, value in good().items() if key != "start"})
    assert_round_trip(World(plain.name, robot, plain.floor, plain.obstacles, plain.task, plain.rules))


PLACED = {
    "link": 0,
    "name": "case",
    "size": [0.1, 0.2, 0.3],
    "position": [0.4, 0.5, 0.6],
    "rpy": [0.1, 0.2, 3],
}
FRAMED = {"link": 2, "name": "jaw", "size": [1, 2, 3], "frame": planar_pose(0.1, 0.2, 0.7, 0.3).tolist()}
CAPSULE = {"link": 1, "name": "tube", "start": [0, 0, 0], "end": [0.3, 0, 0.1], "radius": 0.04}


def of_solids(*solids: dict[str, Any]) -> World:
    document = good() | {"robot": {"dh": DH, "solids": list(solids)}}
    del document["start"]
    return world_from_document(document)


def test_boxes_on_links_stand_where_the_file_has_them() -> None:
    placed, framed, tube = of_solids(PLACED, FRAMED, CAPSULE).robot.solids
    assert isinstance(placed, LinkBox)
    assert isinstance(framed, LinkBox)
    assert isinstance(tube, LinkCapsule)
    assert (placed.link, placed.name, placed.size.tolist()) == (0, "case", [0.1, 0.2, 0.3])
    turn = Rotation.from_euler("xyz", [0.1, 0.2, 3.0]).as_matrix()  # about fixed axes, x first
    np.testing.assert_allclose(placed.T_link_box[:3, :3], turn, atol=1e-15)
    assert placed.T_link_box[:3, 3].tolist() == [0.4, 0.5, 0.6]
    assert framed.T_link_box.tolist() == FRAMED["frame"]
    (plain,) = of_solids({"link": 0, "name": "case", "size": [1, 1, 1]}).robot.solids
    assert np.array_equal(np.abs(plain.corners), np.full((8, 3), 0.5))


@pytest.mark.parametrize(
    "solids", [(), (PLACED,), (FRAMED, CAPSULE), (CAPSULE, PLACED, FRAMED), (CAPSULE, CAPSULE | {"link": 2})]
)
def test_solids_of_links_come_back_equal(solids: tuple[dict[str, Any], ...]) -> None:
    world = of_solids(*solids)
    assert len(world.robot.solids) == len(solids)
    assert_round_trip(world)


@given(
    st.lists(st.floats(-3.2, 3.2), min_size=6, max_size=6),
    st.lists(st.floats(1e-9, 1e3), min_size=3, max_size=3),
)
def test_any_box_on_a_link_comes_back_equal(place: list[float], size: list[float]) -> None:
    world = of_solids(PLACED | {"position": place[:3], "rpy": place[3:], "size": size})
    (again,) = world_from_document(through_json(world_to_document(world))).robot.solids
    assert_same(world.robot.solids[0], again)


def test_bundled_robots_are_written_by_name() -> None:
    world = world_from_document(good())
    assert world_to_document(world)["robot"] == "youbot"
    ignoring = world_from_document(good() | {"robot": {"name": "youbot-real", "limits": "ignore"}})
    assert world_to_document(ignoring)["robot"] == {"name": "youbot-real", "limits": "ignore"}
    chain = Chain.from_dh([[0, 0.1, 0.2, 0, -1, 1]])
    changed = Robot(
        "youbot", "omni", np.zeros((1, 2)), np.zeros(4), chain, capsules_along(chain, 0.1), 0.1, np.zeros(1)
    )
    own = world_to_document(World("w", changed, world.floor, task=world.task))["robot"]
    assert own["dh"] == [[0, 0.1, 0.2, 0, -1, 1]]
    assert robot_named("youbot").chain.dof == 5


def test_yaml_numbers_words_and_keys(tmp_path: Path) -> None:
    text = broken("step: 0.1", "step: 1e-1").replace("post", "no").replace("pillar", "on")
    (tmp_path / "w.yaml").write_text(text)
    world = load_world(str(tmp_path / "w.yaml"))
    assert world.rules.step == 0.1
    assert [solid.name for solid in world.obstacles] == ["on", "no"]


def test_json_and_yaml_give_the_same_world(tmp_path: Path) -> None:
    (tmp_path / "w.yaml").write_text(GOOD)
    (tmp_path / "w.json").write_text(json.dumps(good()))
    assert_same(load_world(tmp_path / "w.yaml"), load_world(tmp_path / "w.json"))


def test_unknown_names_and_files() -> None:
    known = ", ".join(world_names())
    with pytest.raises(InputError, match=f"'pilar', did you mean 'pillar'. .*or one of {known}"):
        load_world("pilar")
    with pytest.raises(InputError, match="no such file"):
        load_world("nowhere/pillar.yaml")
    with pytest.raises(InputError, match=r"\.yaml, \.yml, \.json"):
        load_world("nowhere/pillar.txt")


@pytest.mark.parametrize("suffix", [".yaml", ".json"])
def test_large_files_are_refused_unread(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"large{suffix}"
    with path.open("wb") as stream:
        stream.truncate(MAX_BYTES + 1)
    with pytest.raises(InputError, match="expected at most"):
        load_world(path)


def test_folders_and_bytes_are_refused(tmp_path: Path) -> None:
    (tmp_path / "folder.yaml").mkdir()
    (tmp_path / "bytes.yaml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="cannot be read"):
        load_world(tmp_path / "folder.yaml")
    with pytest.raises(InputError, match="UTF-8"):
        load_world(tmp_path / "bytes.yaml")


def test_documents_from_programs_are_checked_too() -> None:
    documents: list[Any] = [{"version": object()}, {1: 2}, [], None, {"version": 1, "about": np.array([1])}]
    for document in documents:
        with pytest.raises(InputError, match=r"^here: "):
            world_from_document(document, "here")


def test_a_target_on_the_surface_is_no_mistake() -> None:
    touching = good() | {"task": [{"points": [[1.0, 0.1, 0.5], [1.3, 0.1, 1.0 - 5e-7]]}]}
    assert len(world_from_document(touching).task) == 2
    inside = good() | {"task": [{"points": [[1.3, 0.1, 1.0 - 2e-6]]}]}
    with pytest.raises(InputError, match="set-point 1 of 1 lies 2e-06 m inside 'pillar'"):
        world_from_document(inside)


def places(value: Any, here: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Every place in a document."""
    inner: Any = (
        value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    )
    return [here, *(place for key, item in inner for place in places(item, (*here, key)))]


junk = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-3, 10**20)
    | st.floats()
    | st.sampled_from(["", "a", "ignore", "x\ny", "\x00"]),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from(["name", "dh", "box", "z", "0"]), inner)
    ),
    max_leaves=6,
)


@pytest.mark.parametrize("value", [1.3407807929942597e154, -1e10, 10**20])
def test_numbers_too_large_to_square_are_refused(value: float) -> None:
    document = through_json(good())
    document["start"]["base"][0] = value
    with pytest.raises(InputError, match=r"start.base\[0\]: expected a finite number of at most 1e\+09"):
        world_from_document(document, "here")


@settings(max_examples=examples(300))
@given(st.data())
def test_whatever_stands_anywhere_is_read_or_refused_in_one_line(data: st.DataObject) -> None:
    document: Any = good()
    document["task"].append({"csv": "no.csv", "frame": {"rpy": [0, 0, 0]}})
    document["obstacles"].append(
        {"name": "m", "mesh": {"vertices": [[0, 0, 0]] * 4, "faces": [[0, 1, 2]] * 4}}
    )
    document["robot"] = {"dh": DH, "mount": [0, 0, 0, 0], "footprint": [[0, 0]], "carry": [0, 0, 0]}
    document["robot"]["solids"] = [CAPSULE, PLACED, FRAMED]
    document["start"]["joints"] = [0, 0, 0]
    document = through_json(document)  # lists of its own
    *way, last = data.draw(st.sampled_from(places(document)[1:]))
    part = document
    for key in way:
        part = part[key]
    part[last] = data.draw(junk)
    with pytest.raises(InputError) as caught:  # the CSV file is missing, whatever else is read
        world_from_document(document, "here")
    assert len(str(caught.value).splitlines()) == 1
    assert str(caught.value).startswith("here: ")


FAR = 1e5 + 1.0


@pytest.mark.parametrize(
    ("change", "where"),
    [
        ({"floor": {"polygon": [[FAR, 0], [FAR + 4, 0], [FAR, 4]]}}, "floor.polygon"),
        ({"task": [{"points": [[0, 0, FAR]]}]}, "task[0]"),
        ({"start": {"base": [0, -FAR, 0], "joints": [0, 1.0, -1.0, 0.5, 0]}}, "start"),
        ({"obstacles": [{"name": "a", "sphere": {"center": [FAR, 0, 0], "radius": 1}}]}, "obstacles[0]"),
        ({"obstacles": [{"name": "a", "cylinder": {"center": [0, FAR, 0], "radius": 1, "height": 1}}]}, "a"),
        ({"obstacles": [{"name": "a", "box": {"center": [0, FAR, 0], "size": [1, 1, 1]}}]}, "a"),
        ({"obstacles": [{"name": "a", "prism": {"polygon": [[0, 0], [1, 0], [0, 1]], "z": [0, FAR]}}]}, "a"),
        ({"obstacles": [{"name": "a", "prism": {"polygon": [[0, 0], [FAR, 0], [0, 1]], "z": [0, 1]}}]}, "a"),
    ],
)
def test_places_beyond_what_is_computed_are_refused_in_one_line(change: dict[str, Any], where: str) -> None:
    with pytest.raises(InputError, match="expected coordinates of at most 100000 m") as refused:
        world_from_document({**good(), **change})
    assert where in str(refused.value)
    assert "\n" not in str(refused.value)


def test_criteria_and_masses_go_both_ways(tmp_path: Path) -> None:
    text = GOOD.replace(
        "robot: youbot",
        "robot: {name: youbot, masses: [{link: 1, mass: 1.5, center: [0.08, 0, 0]}], payload: 0.5}",
    ).replace("step: 0.1", "step: 0.1, criteria: {manipulability: 0.01, effort: [9, 8, 7, 6, 5]}")
    path = tmp_path / "a.yaml"
    path.write_text(text)
    world = load_world(path)
    assert world.rules.criteria == Criteria(0.01, None, (9.0, 8.0, 7.0, 6.0, 5.0))
    assert [(one.link, one.mass) for one in world.robot.loads] == [(1, 1.5), (4, 0.5)]
    assert_round_trip(world)
    jsonschema.validate(world_to_document(world), world_schema())


def test_every_key_of_a_world_file_is_described() -> None:
    schema = world_schema()
    parts = {"": schema, **schema["$defs"]}
    assert not [
        (part, key)
        for part, content in parts.items()
        for key, value in content.get("properties", {}).items()
        if not value.get("description") and "$ref" not in value
    ]
    rules = schema["$defs"]["RulesPart"]["properties"]
    assert rules["clearance"]["description"].startswith("least distance of the base from every solid")


SEAM = """version: 1
robot: youbot
floor: {polygon: [[-1, -1], [3, -1], [3, 2], [-1, 2]]}
task:
  - {line: {from: [0.3, 0, 0.3], to: [1.0, 0, 0.3], count: 8}AIM}
  - {arc: {center: [1.0, 0.5, 0.3], radius: 0.5, from: -1.5707963267948966, to: 0, count: 12}AIM}
  - {points: [[1.5, 0.5, 0.3], [1.5, 0.6, 0.3], [1.5, 0.6000004, 0.3], [1.5, 0.7, 0.3], [1.5, 0.6, 0.3]]OTHER}
"""


@pytest.mark.parametrize(("aim", "other", "again"), [
    ("", "", "9, 21, 23"), (", direction: [0, 0, -1]", ", direction: [0, 0, -1]", "9, 21, 23"),
    ("", ", direction: [0, 0, -1]", "9, 23"),
    (", orientation: [1, 0, 0, 0]", ", orientation: [1, 0, 0, 0]", "9, 21, 23"),
    (", orientation: [1, 0, 0, 0]", ", orientation: [0, 1, 0, 0]", "9, 23"),
    (", direction: [0, 0, -1], cone: 0.1", ", direction: [0, 0, -1], cone: 0.2", "9, 23"),
])  # fmt: skip
def test_a_set_point_given_twice_in_a_row_is_taken_once(
    aim: str, other: str, again: str, tmp_path: Path
) -> None:
    """Where pieces meet, and within one; not where the tool turns, nor where the path comes back."""
    path = tmp_path / "seam.world.yaml"
    path.write_text(SEAM.replace("AIM", aim).replace("OTHER", other))
    with pytest.warns(FileNote, match=rf"seam.world.yaml: set-points {again} are those before given again"):
        world = load_world(path)
    removed = again.count(",") + 1
    assert len(world.task) == 25 - removed
    again_read = world_from_document(through_json(world_to_document(world)))
    assert len(again_read.task) == 25 - removed
    path.write_text(f"{path.read_text()}rules: {{mode: stops}}\n")
    assert len(load_world(path).task) == 25  # an arm may be asked to come twice


@pytest.mark.parametrize(
    "asked",
    [
        lambda world: rik.plan(world).setpoints[0].base.tolist(),
        rik.why,
        lambda world: [(stop.first, stop.last) for stop in rik.stops(world)],
        lambda world: rik.admissible_area(world, [0.5, 0.0, 0.25]).inner.wkt,
        lambda world: rik.reach(world, [[0.5, 0.0, 0.25]]).base.tolist(),
        lambda world: rik.reach_field(world, [[0.5, 0.0, 0.25]], 0.3).values.tolist(),
        lambda world: rik.reach_slice(world, 0.25, 0.3).values.tolist(),
        html_page,
    ],
)
def test_doors_take_a_world_or_its_name_or_its_file(asked: Callable[[Any], Any], tmp_path: Path) -> None:
    text = world_path("free").read_text("utf-8").replace("face_target", "free")
    (tmp_path / "free.yaml").write_text(text, "utf-8")
    world = load_world(tmp_path / "free.yaml")
    assert asked(world) == asked(tmp_path / "free.yaml") == asked(str(tmp_path / "free.yaml"))
    assert asked("pillar") == asked(load_world("pillar"))
    with pytest.raises(rik.InputError, match="world: expected a World, or the name or file of one, got int"):
        asked(5)
