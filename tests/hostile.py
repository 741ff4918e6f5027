"""Files broken at random, and files made to do harm; each case is a folder with one to read."""

from __future__ import annotations

import io
import json
import os
import re
import struct
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import trimesh
from PIL import Image

from regionik.worlds.documents.world_file import load_world, world_to_document
from tests.nasty import GOOD, TASK, broken
from tests.plans import every_solid, plan_to_document, synthetic_plan
from tests.scans import clouds, octomap_of
from tests.urdfs import CRANE

Files = Mapping[str, bytes]
KINDS = (
    *("world", "plan", "csv", "columns", "gcode", "urdf", "srdf", "map", "frames", "execution", "parts"),
    "scan",
)
READ = {"world": "w.yaml", "plan": "plan.json", "csv": "p.csv", "urdf": "r.urdf", "map": "m.yaml"}
READ |= {"columns": "t.csv", "gcode": "p.nc", "srdf": "r.srdf", "frames": "w.yaml", "execution": "w.yaml"}
READ["scan"] = "w.yaml"  # of a world with a point cloud or an octomap
READ["parts"] = "t.csv.parts/manifest.json"  # of a run of many targets that goes on
MANIFEST = {"world": "a digest", "targets": "another", "versions": {"regionik": "0.1.0"}}

TOKENS = [
    word.encode()
    for word in (
        *(
            "nan",
            "inf",
            "-1",
            "0",
            "1e308",
            "1e-308",
            "1e9",
            "9" * 30,
            "9" * 5000,
            "-0.0",
            "1e5",
            "0x10",
            "''",
        ),
        *(
            "null",
            "true",
            "[]",
            "{}",
            "[",
            "]",
            "{",
            "}",
            ",",
            ":",
            "\n",
            "  ",
            "\t",
            "- ",
            "#",
            '"',
            "<",
            ">",
        ),
        *(
            "&a ",
            "*a",
            "!!python/name:os.system ",
            "<<: ",
            "\x00",
            "../",
            "../../etc/passwd",
            "/dev/zero",
            ".",
        ),
        *("<!DOCTYPE a [<!ENTITY b 'c'>]>", "&b;", "file:///etc/passwd", "package://x/", "http://x/y.stl"),
        *("element vertex 99999999999\n", "f 1 2 99999999999\n", "mtllib ../x\n", "<box size='0 0 0'/>"),
    )
] + [b"\xff\xfe", b"\xef\xbb\xbf", b"\x80", bytes(80), b"\xff" * 4]
NUMBER = re.compile(rb"-?\d+\.?\d*(?:[eE][-+]?\d+)?")


def mutated(data: bytes, rng: np.random.Generator) -> bytes:
    """A file with one to four things changed."""
    for _ in range(rng.integers(1, 5)):
        data = CHANGES[rng.integers(len(CHANGES))](data, rng)
    return data


def _token(rng: np.random.Generator) -> bytes:
    return TOKENS[rng.integers(len(TOKENS))]


def _span(data: bytes, rng: np.random.Generator) -> tuple[int, int]:
    start = int(rng.integers(len(data) + 1))
    return start, min(len(data), start + int(rng.geometric(0.03)))


def _insert(data: bytes, rng: np.random.Generator) -> bytes:
    at = int(rng.integers(len(data) + 1))
    return data[:at] + _token(rng) + data[at:]


def _replace(data: bytes, rng: np.random.Generator) -> bytes:
    start, end = _span(data, rng)
    return data[:start] + _token(rng) + data[end:]


def _number(data: bytes, rng: np.random.Generator) -> bytes:
    found = list(NUMBER.finditer(data))
    if not found:
        return data
    one = found[rng.integers(len(found))]
    other = found[rng.integers(len(found))][0] if rng.random() < 0.3 else _token(rng)
    return data[: one.start()] + other + data[one.end() :]


def _flip(data: bytes, rng: np.random.Generator) -> bytes:
    changed = bytearray(data)
    if changed:
        changed[rng.integers(len(changed))] ^= 1 << int(rng.integers(8))
    return bytes(changed)


def _delete(data: bytes, rng: np.random.Generator) -> bytes:
    start, end = _span(data, rng)
    return data[:start] + data[end:]


def _repeat(data: bytes, rng: np.random.Generator) -> bytes:
    start, end = _span(data, rng)
    return data[:start] + data[start:end] * int(10 ** rng.uniform(0, 3)) + data[end:]


def _cut(data: bytes, rng: np.random.Generator) -> bytes:
    return data[: rng.integers(len(data) + 1)]


def _swap_lines(data: bytes, rng: np.random.Generator) -> bytes:
    lines = data.split(b"\n")
    i, k = rng.integers(len(lines), size=2)
    lines[i], lines[k] = lines[k], lines[i] if rng.random() < 0.5 else lines[k]
    return b"\n".join(lines)


CHANGES: tuple[Callable[[bytes, np.random.Generator], bytes], ...] = (
    *(_number,) * 4, *(_insert, _replace) * 2, _flip, _delete, _repeat, _cut, _swap_lines,
)  # fmt: skip


# --- good files to begin with


def samples(kind: str) -> list[Files]:
    """Good cases of a kind."""
    match kind:
        case "world":
            return _worlds()
        case "plan":
            worlds = (load_world("l_shape"), every_solid())
            plans = [plan_to_document(synthetic_plan(world)) for world in worlds]
            timed = json.loads(json.dumps(plans[0]))
            timed["world"]["speeds"] = {"joint_velocity": 1.0, "steering_velocity": 0.5}
            timed["states"] = [{**state, "time": 0.1 * k} for k, state in enumerate(timed["states"])]
            plans.append(timed)
            return [{"plan.json": json.dumps(one).encode()} for one in plans]
        case "csv":
            points = (
                "x,y,z\n# a\n1,2,3\n\n0.5,-1e-3,2\n",
                "1,2,3,0,0,1\n4,5,6,0,1,1\n",
                "1,2,3,0,0,0,1\n",
                "x,y,z,qx,qy,qz,qw\r\n# a\r\n1,2,3,0,0,0.6,0.8\r\n",
                "x,y,z,dx,dy,dz\n1,2,3,0,0,-1\n",
            )
            return [{"p.csv": text.encode()} for text in points]
        case "columns":
            tables = (
                '# a\nNo;X (mm);Y (mm);Z;qx;qy;qz;qw\n1;2;3;4;0;0;0;1\n\n2;"2";3;5;0;0;0.6;0.8\n',
                "X (mm);Y (mm);Z;qx;qy;qz;qw\r\n2;3;4;0;0;0;1\r\n",
            )
            return [{READ[kind]: text.encode()} for text in tables]
        case "gcode":
            programs = (
                "%\nO1 (a seam)\nG21 G90 G17\nN10 G0 X0 Y0 Z5\nG1 Z0 F100\nX10\nG2 X20 Y10 I0 J10\nM30\n",
                "g20g91\ng1x1y1 ; away\ng3x1y0r.6\ng18 g2 x1 z0 i.5 k0\n/g1x9\ng4 p1\n",
                "G90.1 G19\nG1 X0 Y1 Z1\nG2 Y1 Z1 J2 K1 X3\nG91.1 G54\n",
            )
            return [{READ[kind]: text.encode()} for text in programs]
        case "urdf":
            return [{"r.urdf": CRANE.replace("upper.stl", file).encode(), f"meshes/{file}": mesh}
                    for file, mesh in meshes().items()]  # fmt: skip
        case "srdf":
            return [{**_crane(), READ[kind]: SRDF.encode()}]
        case "frames":
            return [{"w.yaml": FRAMES.encode(), "p.csv": POSES}]
        case "execution":
            return [{"w.yaml": _with_rules(rules)} for rules in (EXECUTION, PARKING, PROCESS)]
        case "parts":
            return [{READ[kind]: json.dumps(MANIFEST).encode()}]
        case "scan":
            return [_scanned(name, data) for name, data in scans().items()]
        case _:
            return [
                {"m.yaml": MAP.replace("m.pgm", file).encode(), file: image}
                for file, image in images().items()
            ]


SRDF = """\
<robot name="crane">
  <group name="arm"><chain base_link="plate" tip_link="tool"/></group>
  <group_state name="tucked" group="arm">
    <joint name="lift" value="0.1"/><joint name="pivot" value="-0.5"/><joint name="elbow" value="1"/>
  </group_state>
  <group_state name="base" group="base"><joint name="world" value="0 0 0"/></group_state>
  <disable_default_collisions link="head"/>
  <enable_collisions link1="head" link2="fore"/>
  <disable_collisions link1="left" link2="right" reason="Never"/>
  <disable_collisions link1="torso" link2="base" reason="Adjacent"/>
</robot>
"""
FRAMES = """\
version: 1
robot: {name: youbot, tool: {position: [0, 0, 0.1], rpy: [0, 0.2, 0]}}
floor: {polygon: [[-1, -1], [4, -1], [4, 2], [-1, 2]]}
frames:
  map: odom
  tool0: flange
  part: {parent: table, position: [0.1, 0, 0.2], rpy: [0, 0, 0.5]}
  table: {position: [1, 1, 0.3], rpy: [0.1, 0, 1.57]}
obstacles:
  - {name: post, cylinder: {radius: 0.1, height: 1, center: [0, 0, 0.5]}, frame: {position: [3, 0, 0]}}
task:
  - {csv: p.csv, frame: part}
  - {csv: p.csv, frame: {position: [1, 0, 0], rpy: [0, 0, 1]}, scale: 0.5}
  - {points: [[0, 0, 0], [0.1, 0, 0]], frame: table, direction: [0, 0, -1], cone: 0.1}
rules: {clearance: 0.2}
"""
POSES = b"x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,1\n0.1,0,0,0,0,0.6,0.8\n"
EXECUTION = "execution: {base_error: 0.004, heading_error: 0.01, tool_error: 0.0005, arm_error: 0.01}"
PARKING = (
    "mode: stops, stop_criterion: probability, "
    "parking: {covariance: [[1.0e-4, 0, 0], [0, 1.0e-4, 1.0e-5], [0, 1.0e-5, 2.0e-4]], probability: 0.99}"
)
PROCESS = "criteria: {joint_margin: 0.1}, mode: stops, order: any, parking: {deviations: [0.01, 0, 0.02]}"


def _with_rules(rules: str) -> bytes:
    return broken("rules: {clearance: 0.2, step: 0.1}", f"rules: {{clearance: 0.2, {rules}}}").encode()


def _crane() -> Files:
    return {"r.urdf": CRANE.encode(), "meshes/upper.stl": meshes()["block.stl"]}


MAP = """\
image: m.pgm
resolution: 0.1
origin: [-1, -2, 0.1]
occupied_thresh: 0.65
free_thresh: 0.196
negate: 0
"""


def meshes() -> dict[str, bytes]:
    """One block in every format that is read."""
    block = trimesh.creation.box((400.0, 60.0, 80.0))
    made = {f"block.{kind}": block.export(file_type=kind) for kind in ("stl", "obj", "ply", "off")}
    made["text.stl"] = block.export(file_type="stl_ascii")
    made["text.ply"] = block.export(file_type="ply", encoding="ascii")
    corners = " ".join(f"{x:g}" for x in block.vertices.ravel())
    made["block.dae"] = (
        "<COLLADA><asset><unit meter='1'/></asset><library_geometries><geometry id='g'><mesh><source id='s'>"
        f"<float_array>{corners}</float_array></source><vertices><input semantic='POSITION' source='#s'/>"
        "</vertices></mesh></geometry></library_geometries><library_visual_scenes><visual_scene><node>"
        "<translate>1 2 3</translate><rotate>0 0 1 30</rotate><instance_geometry url='#g'/></node>"
        "</visual_scene></library_visual_scenes></COLLADA>"
    )
    return {name: data.encode() if isinstance(data, str) else data for name, data in made.items()}


def images() -> dict[str, bytes]:
    """One small map in every format that is read."""
    grey = np.full((12, 16), 254, dtype=np.uint8)
    grey[3:5, 2:9], grey[8, 8] = 0, 205
    made = {"m.pgm": grey, "m.png": grey, "rgba.png": np.dstack([grey] * 3 + [grey])}
    files = {}
    for name, pixels in made.items():
        stream = io.BytesIO()
        Image.fromarray(pixels).save(stream, "PPM" if name.endswith("pgm") else "PNG")
        files[name] = stream.getvalue()
    files["text.pgm"] = b"P2 4 3 255 " + b"254 0 205 254 " * 3
    return files


def _worlds() -> list[Files]:
    every = json.dumps(world_to_document(every_solid()), indent=1).encode()
    named = GOOD.replace("youbot", "{urdf: r.urdf, tip: tool}").replace("[0, 1, 0, 1, 0]", "[0.1, 0, 0]")
    with_mesh = (
        "\n  - {name: block, mesh: {file: meshes/block.stl, position: [3, 1, 0], scale: 0.001}}\nstart"
    )
    whole = {
        "w.yaml": named.replace("\nstart", with_mesh).replace(TASK, "{csv: p.csv}").encode(),
        "p.csv": b"0.5,1.5,0.3\n0.6,1.5,0.3\n",
        "r.urdf": CRANE.encode(),
        "meshes/upper.stl": meshes()["block.stl"],
        "meshes/block.stl": meshes()["block.stl"],
    }
    mapped = re.sub("floor: .*", "floor: {map: m.yaml}", GOOD).encode()
    return [
        {"w.yaml": GOOD.encode()},
        {"w.yaml": every},
        whole,
        {"w.yaml": mapped, "m.yaml": MAP.encode(), "m.pgm": images()["m.pgm"]},
    ]


# --- files made to do harm


def bombs(kind: str) -> dict[str, Files]:
    """Cases made to fill memory or time, to run code, or to read what they should not, by name."""
    made: dict[str, Callable[[], Mapping[str, bytes | Files]]] = {
        "world": _world_bombs,
        "plan": _plan_bombs,
        "csv": _csv_bombs,
        "columns": _columns_bombs,
        "gcode": _gcode_bombs,
        "urdf": _urdf_bombs,
        "srdf": _srdf_bombs,
        "map": _map_bombs,
        "frames": _frames_bombs,
        "execution": _execution_bombs,
        "parts": _parts_bombs,
        "scan": _scan_bombs,
    }
    return {
        name: {READ[kind]: files} if isinstance(files, bytes) else files
        for name, files in made[kind]().items()
    }


def _scanned(name: str, data: bytes) -> Files:
    kind = "octomap" if name.endswith("t") else "cloud"
    scan = f"\n  - {{name: scan, {kind}: {{file: {name}, z: [0.01, 2]}}, frame: {{rpy: [0, 0, 1]}}}}\nstart"
    return {"w.yaml": GOOD.replace("\nstart", scan).encode(), name: data}


def scans() -> dict[str, bytes]:
    """A few points, or cells, in every form that is read."""
    points = np.array([[3.0, 0.1 * k, 0.5] for k in range(6)])
    cells = [(40, k, 9) for k in range(6)]
    return {**clouds(points), "m.bt": octomap_of(cells, 0.05), "m.ot": octomap_of(cells, 0.05, binary=False)}


def _scan_bombs() -> dict[str, bytes | Files]:
    far = b"0 0 0.5\n1e9 1e9 0.5\n"
    rng = np.random.default_rng(0)
    noise = rng.uniform([-9, -9, 0.1], [9, 9, 2], (300_000, 3)).astype("<f4").tobytes()
    head = (
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\n"
        "property float z\nend_header\n"
    )
    tree = b"# Octomap OcTree binary file\nid OcTree\nsize 1\nres 0.05\ndata\n"
    full = tree.replace(b"binary ", b"")
    made = {
        "many rows": ("p.xyz", b"1 2 3\n" * 30_000_000),
        "one long line": ("p.xyz", b"1 " * 60_000_000),
        "many columns": ("p.csv", b"1," * 60_000_000),
        "far apart": ("p.xyz", far),
        "more points than there are": ("p.ply", head.format(10**11).encode()),
        "some more points than there are": ("p.ply", head.format(3_000_000).encode() + noise),
        "noise": ("p.ply", head.format(300_000).encode() + noise),
        "no end of a head": ("p.ply", b"ply\n" + b"property float x\n" * 10_000_000),
        "wide records": (
            "p.pcd",
            b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 999999999\nPOINTS 1\nDATA binary\n",
        ),
        "a deep tree": ("m.bt", tree + b"\xff" * 1_000_000),
        "a wide tree": ("m.bt", tree + (b"\xff\xff" * 10 + b"\xaa\xaa" * 50) * 200_000),
        "a full tree": ("m.bt", tree + b"\xaa\xaa"),
        "a whole world": ("m.ot", full + b"\x00\x00\x80\x3f\x00"),
        "a deep full tree": ("m.ot", full + b"\x00\x00\x80\x3f\xff" * 1_000_000),
        "no cells": ("m.bt", tree),
        "tiny cells": ("m.bt", tree.replace(b"0.05", b"1e-300") + b"\xaa\xaa"),
    }  # fmt: skip
    world, points = _scanned("p.xyz", b"")["w.yaml"], b"0 0 0.5\n1 1 0.5\n"
    tiny = world.replace(b"z: [0.01", b"voxel: 1.0e-300, z: [0.01")
    return {
        **{name: _scanned(*one) for name, one in made.items()},
        "a pipe": {"w.yaml": world, "p.xyz": PIPE},
        "a device": _scanned("/dev/zero.xyz", b"")["w.yaml"],
        "a tiny voxel": {"w.yaml": tiny, "p.xyz": points},
    }


def _parts_bombs() -> dict[str, bytes | Files]:
    return {
        "deep": b"[" * 1_000_000,
        "deep mapping": b'{"world":' * 1_000_000,
        "a long number": b'{"world": ' + b"1" * 1_000_000 + b"}",
        "no text": b"\xff\xfe\x00",
        "a part that is none": {
            READ["parts"]: json.dumps(MANIFEST).encode(),
            "t.csv.parts/0_1_1.csv": b"\x00",
        },
    }


def _changed(old: str, new: str) -> bytes:
    return broken(old, new).encode()


def _world_bombs() -> dict[str, bytes | Files]:
    post = "  - {{name: p{0}, cylinder: {{radius: 0.1, height: 1.2, center: [{0}, 9, 0.6]}}}}\n"
    laughs = "a0: &a0 [x, x]\n" + "".join(f"a{k + 1}: &a{k + 1} [*a{k}, *a{k}]\n" for k in range(60))
    circle = [[round(float(np.cos(t)), 9), round(float(np.sin(t)), 9)] for t in np.linspace(0, 6.28, 100_000)]
    many = "\n".join(["  - {line: {from: [0, 1.5, 0.3], to: [1, 1.5, 0.3], count: 1000000}}"] * 200)
    every = world_to_document(every_solid())
    numbers = [[0.5, 1.5, 0.3]] * 1_000_000
    return {
        "aliases": laughs.encode(),
        "merge keys": (GOOD + "<<: *a\n").encode(),
        "code": _changed("version: 1", "version: !!python/object/apply:os.system ['touch ran']"),
        "deep": b"[" * 1_000_000,
        "deep mapping": b"{a: " * 1_000_000,
        "wide": b"version: [" + b"a," * 8_000_000 + b"a]",
        "wide rows": b"version:\n" + b"- 1\n" * 4_000_000,
        "many keys": b"".join(b"k%d: 1\n" % k for k in range(1_000_000)),
        "a long word": b"version: " + b"a" * 16_000_000,
        "a long number": b"version: " + b"1" * 16_000_000,
        "a long name": _changed("pillar", "p" * 15_000_000),
        "many obstacles": _changed("start", "".join(post.format(k) for k in range(100_000)) + "start"),
        "a round floor": _changed("[[-1, -1], [4, -1], [4, 2], [-1, 2]]", json.dumps(circle)),
        "many set-points": _changed(f"  - {TASK}", many),
        "many points": json.dumps({**every, "task": [{"points": numbers}]}).encode(),
        "a device as mesh": _changed("box: {size: [0.6, 0.6, 1.0], center: [1.3, 0.1, 0.5], yaw: 0.0}",
                                     "mesh: {file: /dev/zero.stl}"),
        "a device as path": _changed(TASK, "{csv: /dev/zero}"),
        "a device as map": _changed("{polygon: [[-1, -1], [4, -1], [4, 2], [-1, 2]]}", "{map: /dev/zero}"),
        "a pipe as path": {"w.yaml": _changed(TASK, "{csv: pipe}"), "pipe": PIPE},
        "a pipe as robot": {"w.yaml": _changed("youbot", "{urdf: pipe.urdf}"), "pipe.urdf": PIPE},
        "a pipe": PIPE,
        "a folder as path": _changed(TASK, "{csv: .}"),
    }  # fmt: skip


def _plan_bombs() -> dict[str, bytes | Files]:
    document = plan_to_document(synthetic_plan(load_world("l_shape")))
    many = {**document, "states": document["states"][:1] * 150_000}
    ring = [[[[0.0, 0.0], *[[1.0, k / 1e5] for k in range(200_000)], [0.0, 1.0], [0.0, 0.0]]]]
    parts = document["areas"]["features"][0]["geometry"]["geometries"]
    parts[0] = {"type": "MultiPolygon", "coordinates": ring}
    return {
        "deep": b"[" * 10_000_000,
        "wide": b"[" + b"[]," * 20_000_000 + b"[]]",
        "wide mappings": b"[" + b"{}," * 20_000_000 + b"{}]",
        "a long number": b'{"version": ' + b"1" * 10_000_000 + b"}",
        "an exponent": b'{"version": 1e999999999}',
        "many states": json.dumps(many).encode(),
        "a long ring": json.dumps(document).encode(),
        "not text": b"\xff" * 1000,
        "a pipe": PIPE,
    }


def _csv_bombs() -> dict[str, bytes | Files]:
    return {
        "commas": b"," * 60_000_000,
        "one long line": b"1" * 60_000_000,
        "rows": b"1,2,3\n" * 10_000_000,
        "turns": b"1,2,3,0,0,0,1\n" * 4_000_000,
        "rows and gaps": b"1,2,3\n\n" * 8_000_000,
        "comments": b"#\n" * 30_000_000,
        "empty lines": b"\n" * 60_000_000,
        "zeros": bytes(60_000_000),
        "a pipe": PIPE,
    }


def _columns_bombs() -> dict[str, bytes | Files]:
    head = b"X (mm);Y (mm);Z;qx;qy;qz;qw\n"
    return {
        "a quote without end": head + b'"' + b"1;" * 30_000_000,
        "titles": b"a;" * 30_000_000,
        "rows": head + b"1;2;3;0;0;0;1\n" * 4_000_000,
        "empty lines": head + b"\n" * 60_000_000,
        "zeros": bytes(60_000_000),
        "a pipe": PIPE,
    }


def _gcode_bombs() -> dict[str, bytes | Files]:
    return {
        "a large circle": b"G1 X1\nG2 I1e9\n",
        "a circle of a million metres": b"G1 X1\nG2 I999999999\n",
        "circles": b"G1 X1\n" + b"G2 I100000\n" * 900_000,
        "words": b"X1" * 30_000_000,
        "brackets": b"(" * 60_000_000,
        "comments": b"(a)" * 20_000_000,
        "moves": b"G1 X1\nX2\n" * 5_000_000,
        "a long number": b"X" + b"1" * 900,
        "zeros": bytes(60_000_000),
        "a pipe": PIPE,
    }


def _urdf_bombs() -> dict[str, bytes | Files]:
    laughs = "".join(f'<!ENTITY a{k + 1} "{f"&a{k};" * 10}">' for k in range(30))
    head = '<!DOCTYPE r [<!ENTITY a0 "ha">%s]><robot name="&a30;"/>'
    links = "".join(f'<link name="l{k}"/>' for k in range(3000))
    joint = (
        '<joint name="j{0}" type="revolute"><parent link="l{0}"/><child link="l{1}"/><axis xyz="0 0 1"/>'
        '<limit lower="-1" upper="1" velocity="1" effort="1"/></joint>'
    )
    chain = "".join(joint.format(k, k + 1) for k in range(2999))
    solid = '<collision><geometry><mesh filename="meshes/block.stl"/></geometry></collision>'
    crane = CRANE.replace('<link name="plate"/>', f'<link name="plate">{solid * 900}</link>')
    block = meshes()["block.stl"]
    return {
        **_with_meshes(),
        "entities": (head % laughs).encode(),
        "an entity from a file": b'<!DOCTYPE r [<!ENTITY a SYSTEM "file:///etc/passwd">]><robot name="&a;"/>',
        "deep": b"<a>" * 1_000_000,
        "wide": b"<robot name='a'>" + b"<a/>" * 3_000_000,
        "attributes": b"<robot " + b" ".join(b"a%d='1'" % k for k in range(1_000_000)) + b"/>",
        "a long name": b"<robot name='" + b"a" * 16_000_000 + b"'/>",
        "a long chain": f'<robot name="a">{links}{chain}</robot>'.encode(),
        "many solids": {"r.urdf": crane.encode(), "meshes/upper.stl": block, "meshes/block.stl": block},
        "a pipe": PIPE,
    }


def _srdf_bombs() -> dict[str, bytes | Files]:
    states = "<group_state name='a{0}' group='arm'><joint name='lift' value='0.1'/></group_state>"
    pairs = "<disable_collisions link1='left' link2='x{}'/>"
    laughs = "".join(f'<!ENTITY a{k + 1} "{f"&a{k};" * 10}">' for k in range(30))
    made = {
        "entities": f'<!DOCTYPE r [<!ENTITY a0 "ha">{laughs}]><robot name="&a30;"/>'.encode(),
        "deep": b"<a>" * 1_000_000,
        "wide": b"<robot name='a'>" + b"<a/>" * 3_000_000,
        "many postures": ("<robot>" + "".join(map(states.format, range(150_000))) + "</robot>").encode(),
        "many pairs": ("<robot>" + "".join(map(pairs.format, range(250_000))) + "</robot>").encode(),
        "a long value": SRDF.replace("-0.5", "1 " * 5_000_000).encode(),
        "a long name": SRDF.replace("tucked", "a" * 10_000_000).encode(),
        "a pipe": PIPE,
    }
    return {name: {**_crane(), READ["srdf"]: data} for name, data in made.items()}


def _frames_bombs() -> dict[str, bytes | Files]:
    chained = "".join(f"  f{k}: {{parent: f{k + 1}}}\n" for k in range(20_000))
    made = {
        "a circle": FRAMES.replace("table: {", "table: {parent: part, "),
        "a long chain": FRAMES.replace("obstacles", chained + "  f20000: {}\nobstacles"),
        "many": FRAMES.replace("obstacles", "".join(f"  g{k}: {{}}\n" for k in range(100_000)) + "obstacles"),
        "far away": FRAMES.replace("[1, 1, 0.3]", "[1.0e+308, 1.0e+308, 0.3]"),
        "a long name": FRAMES.replace("odom", "o" * 10_000_000),
    }
    return {name: {"w.yaml": text.encode(), "p.csv": POSES} for name, text in made.items()}


def _execution_bombs() -> dict[str, bytes | Files]:
    huge = "covariance: [[1.0e+300, 0, 0], [0, 1.0e+300, 0], [0, 0, 1.0e+300]]"
    return {
        "errors without bound": _with_rules("execution: {base_error: 1.0e+308, tool_error: 1.0e+308}"),
        "a heading of turns": _with_rules("execution: {heading_error: 1.0e+9}"),
        "a covariance without bound": _with_rules(f"mode: stops, parking: {{{huge}}}"),
        "no covariance": _with_rules("mode: stops, parking: {covariance: [[1, 2, 0], [2, 1, 0], [0, 0, 1]]}"),
        "nothing": _with_rules("mode: stops, parking: {}"),
    }


def _with_meshes() -> dict[str, Files]:
    made: dict[str, Files] = {}
    for name, data in _mesh_bombs().items():
        file = f"m{name[-4:]}"
        robot = CRANE.replace("upper.stl", file).encode()
        made[f"mesh: {name}"] = {"r.urdf": robot, f"meshes/{file}": data}
    return made


def _mesh_bombs() -> dict[str, bytes]:
    ply = "ply\nformat {} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n" \
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n"  # fmt: skip
    zipped = zlib.compress(bytes(10_000_000))
    corners, many = b"v 1.5 2.5 3.5\n", 4_000_000
    node = "<node><instance_geometry url='#g'/>" + "<instance_geometry url='#g'/>" * 1000 + "</node>"
    return {
        "a count.stl": bytes(80) + struct.pack("<I", 2**32 - 1) + bytes(50),
        "a count.ply": ply.format("binary_little_endian", 10**12).encode() + bytes(100),
        "a count in text.ply": ply.format("ascii", 10**12).encode() + b"0 0 0\n",
        "a count.off": b"OFF\n99999999999 99999999999 0\n0 0 0\n",
        "an index.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99999999999\n",
        "another file.obj": b"mtllib ../../../../etc/passwd\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
        "zipped.stl": b"PK\x03\x04" + zipped,
        "long.obj": corners * many + b"f 1 2 3\n",
        "faces.obj": corners * 9 + b"f 1 2 3\n" * many,
        "long.off": b"OFF\n%d 1 0\n" % many + b"1 2 3\n" * many + b"3 0 1 2\n",
        "long.stl": b"solid a\n" + b"facet normal 0 0 1\nouter loop\n" + b"vertex 1 2 3\n" * many,
        "binary.stl": bytes(80) + struct.pack("<I", 1_000_000) + os.urandom(50) * 1_000_000,
        "shown often.dae": meshes()["block.dae"].replace(b"<node>", node.encode() * 90 + b"<node>"),
        "numbers.dae": meshes()["block.dae"].replace(b"<float_array>", b"<float_array>" + b"1 " * 9_000_000),
        "a pipe.stl": PIPE,
    }


def _map_bombs() -> dict[str, bytes | Files]:
    def mapped(file: str, data: bytes) -> Files:
        return {"m.yaml": MAP.replace("m.pgm", file).encode(), file: data}

    checks = b"P5 5000 5000 255\n" + bytes([0, 255] * 12_500_000)
    noise = np.random.default_rng(0).integers(0, 2, 4_000_000, dtype=np.uint8) * 255
    png = [b"IHDR" + struct.pack(">IIBBBBB", 50_000, 50_000, 8, 0, 0, 0, 0)]
    big = [*png, b"IDAT" + zlib.compress(bytes(100_000_000)), b"IEND"]
    text = b"zTXta\0\0" + zlib.compress(bytes(300_000_000))
    size = b"IHDR" + struct.pack(">IIBBBBB", 4, 4, 8, 0, 0, 0, 0)
    wordy = [size, text, b"IDAT" + zlib.compress(bytes(20)), b"IEND"]
    return {
        "a huge image": mapped("m.png", _png(big)),
        "text in an image": mapped("m.png", _png(wordy)),
        "a huge header": mapped("m.pgm", b"P5 1000000 1000000 255\n"),
        "a huge header in text": mapped("m.pgm", b"P2 99999999999 1 255\n1"),
        "zeros in text": mapped("m.pgm", b"P2 5000 5000 255\n" + b"0 " * 25_000_000),
        "checks": mapped("m.pgm", checks),
        "noise": mapped("m.pgm", b"P5 2000 2000 255\n" + noise.tobytes()),
        "stripes": mapped("m.pgm", b"P5 5000 5000 255\n" + (bytes([0]) * 5000 + bytes([255]) * 5000) * 2500),
        "a device": {"m.yaml": MAP.replace("m.pgm", "/dev/zero").encode()},
        "a pipe": mapped("m.pgm", PIPE),
        "itself": {"m.yaml": MAP.replace("m.pgm", "m.yaml").encode()},
    }


def _png(chunks: list[bytes]) -> bytes:
    body = b"".join(
        struct.pack(">I", len(one) - 4) + one + struct.pack(">I", zlib.crc32(one)) for one in chunks
    )
    return b"\x89PNG\r\n\x1a\n" + body


PIPE = b"a pipe that nobody writes to"  # stands for one in `write`


def write(files: Files, folder: Path) -> None:
    """Put a case into a folder."""
    for name, data in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if data == PIPE:
            os.mkfifo(path)
        else:
            path.write_bytes(data)
