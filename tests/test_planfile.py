from __future__ import annotations

import copy
import dataclasses
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import GeometryCollection, LineString, MultiPolygon, Point, Polygon, box

import regionik as rik
from regionik.output import plan_file
from regionik.output.export import plan_to_geojson
from regionik.output.plan_file import load_plan, plan_schema
from regionik.storage import plan_document
from regionik.storage.files import json_values
from regionik.storage.plan_document import multipolygon, plan_to_text
from regionik.values import Motion, Plan
from regionik.verification.verifier import verify
from regionik.view.figures import plot
from regionik.view.page import to_html
from regionik.worlds.errors import FileNote, InputError
from regionik.worlds.readers.text import MAX_BYTES
from tests.planned import planned
from tests.plans import every_solid, l_shape, plan_to_document, synthetic_plan

SCHEMA = Path(__file__).parents[1] / "docs" / "plan.schema.json"


@pytest.fixture(scope="module")
def plan() -> Plan:
    return synthetic_plan(l_shape(), seed=7)


@pytest.fixture(scope="module")
def document(plan: Plan) -> dict[str, Any]:
    return plan_to_document(plan)


def same(a: Any, b: Any) -> bool:
    """Equality of two values that may be arrays."""
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return bool(np.array_equal(a, b))
    return bool(a == b)


@pytest.mark.parametrize("world", [l_shape, every_solid])
def test_a_plan_comes_back_the_same(world: Callable[[], Any], tmp_path: Path) -> None:
    plan = synthetic_plan(world(), seed=3)
    plan.save(tmp_path / "plan.json")
    back = load_plan(tmp_path / "plan.json")
    for key in ("base", "joints", "kind", "setpoint"):
        assert same(getattr(back.motion, key), getattr(plan.motion, key))
    assert np.isnan(back.motion.time).all()
    assert (back.seed, back.lift_offs, back.stats, back.stops) == (3, 1, plan.stats, ())
    for a, b in zip(back.setpoints, plan.setpoints, strict=True):
        assert all(same(getattr(a, f.name), getattr(b, f.name)) for f in dataclasses.fields(a))
    for ours, theirs in zip(back.areas, plan.areas, strict=True):
        for part in ("admissible", "pruned", "rejected"):
            a, b = getattr(ours, part), getattr(theirs, part)
            assert shapely.symmetric_difference(a, b, grid_size=1e-9).area < 1e-7
    back.save(tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == (tmp_path / "plan.json").read_bytes()


def test_a_plan_saves_itself_as_the_public_name_does(plan: Plan, tmp_path: Path) -> None:
    plan.save(tmp_path / "itself.json")
    rik.save_plan(plan, tmp_path / "by_name.json")
    assert (tmp_path / "itself.json").read_bytes() == (tmp_path / "by_name.json").read_bytes()
    with pytest.raises(InputError, match="nowhere"):
        plan.save(tmp_path / "nowhere" / "plan.json")


def test_values_load_no_files() -> None:
    code = "import sys, regionik.values; print(*sorted(m for m in sys.modules if m.startswith('regionik.')))"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert "regionik.values" in loaded
    assert not re.search(r"regionik\.(storage|output|worlds\.documents|worlds\.readers)", loaded)


def test_times_are_kept_and_nan_is_null(plan: Plan, tmp_path: Path) -> None:
    m = plan.motion
    time = np.linspace(0.0, 0.3, len(m))
    time[2] = np.nan
    timed = dataclasses.replace(
        plan,
        motion=Motion(m.base, m.joints, m.kind, m.setpoint, time),
        stats={"largest_error": np.inf, "states": np.int64(3), "base_moves": {"ompl": 1}},
    )
    timed.save(tmp_path / "plan.json")
    text = (tmp_path / "plan.json").read_text()
    assert "NaN" not in text
    assert "Infinity" not in text
    assert json.loads(text)["states"][2]["time"] is None
    assert np.array_equal(load_plan(tmp_path / "plan.json").motion.time, time, equal_nan=True)
    assert load_plan(tmp_path / "plan.json").stats == {"largest_error": None, "states": 3}


def test_the_document_is_what_the_schema_says(document: dict[str, Any], plan: Plan) -> None:
    jsonschema.Draft202012Validator.check_schema(plan_schema())
    jsonschema.validate(json.loads(plan_to_text(plan)), plan_schema())
    assert json.loads(plan_to_text(plan)) == document
    assert {*plan_schema()["required"], "skipped"} == set(document)


def three_parts(document: dict[str, Any]) -> dict[str, Any]:
    """The document with every pruned part written out."""
    said = copy.deepcopy(document)
    for feature in said["areas"]["features"]:
        parts, shapes = feature["properties"]["parts"], feature["geometry"]["geometries"]
        if parts == ["admissible", "rejected"]:
            parts.insert(1, "pruned")
            shapes.insert(1, shapes[0])
    return said


def test_a_file_of_version_1_is_read_the_same(document: dict[str, Any], tmp_path: Path) -> None:
    assert document["version"] == 2
    counts = {len(feature["properties"]["parts"]) for feature in document["areas"]["features"]}
    assert 2 in counts
    path = tmp_path / "plan.json"
    path.write_text(json.dumps({**three_parts(document), "version": 1}))
    assert plan_to_document(load_plan(path)) == document


def test_parts_are_those_that_a_feature_names(document: dict[str, Any], tmp_path: Path) -> None:
    said, path = three_parts(document), tmp_path / "plan.json"
    said["areas"]["features"][3]["properties"]["parts"] = ["admissible", "rejected"]
    path.write_text(json.dumps(said))
    with pytest.raises(InputError, match=r"features\[3\].geometry.geometries: expected 2, one for each part"):
        load_plan(path)


def test_areas_too_many_to_be_read_back_are_left_out(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    made = planned("slab")
    made.save(tmp_path / "plan.json")
    whole = (tmp_path / "plan.json").stat().st_size
    for module in (plan_document, plan_file):
        monkeypatch.setattr(module, "MAX_BYTES", whole - 1)
    with pytest.warns(FileNote, match="areas are left out"):
        made.save(tmp_path / "plan.json")
    back = load_plan(tmp_path / "plan.json")
    assert back.areas == ()
    assert verify(back).ok
    assert json.loads(plan_to_geojson(back))["features"]
    to_html(back, tmp_path / "page.html")
    plot(back, tmp_path / "plan.png")
    assert [path.stat().st_size > 1000 for path in sorted(tmp_path.iterdir())] == [True] * 3


def test_what_is_written_can_be_read(plan: Plan, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A file at the limit of its reader is read; one beyond is not written."""
    path, bare = tmp_path / "plan.json", dataclasses.replace(plan, areas=())
    bare.save(path)
    least = path.stat().st_size
    for module in (plan_document, plan_file):
        monkeypatch.setattr(module, "MAX_BYTES", least + 20)
    bare.save(path)
    assert load_plan(path).areas == ()
    path.unlink()
    for module in (plan_document, plan_file):
        monkeypatch.setattr(module, "MAX_BYTES", least - 20)
    told = r"MB could not be read back, at most \S+ MB can, expected a task in parts"
    with pytest.raises(InputError, match=told):
        bare.save(path)
    assert not path.exists()


def test_the_committed_schema_is_this_one() -> None:
    assert json.loads(SCHEMA.read_text(encoding="utf-8")) == plan_schema()


def test_states_carry_the_tool(document: dict[str, Any], plan: Plan) -> None:
    assert document["joint_names"] == [f"joint_{k}" for k in range(1, 6)]
    assert np.allclose([s["tool"] for s in document["states"]], plan.tools(), atol=1e-12)
    at = [s for s in document["states"] if s["kind"] == "setpoint"]
    assert [s["setpoint"] for s in at] == list(range(40))
    assert np.allclose([s["tool"] for s in at], [s["target"] for s in document["setpoints"]], atol=1e-9)


def _put(document: dict[str, Any], place: tuple[str | int, ...], value: Any) -> None:
    for step in place[:-1]:
        document = document[step]  # type: ignore[index]
    if value is _GONE:
        del document[place[-1]]  # type: ignore[arg-type]
    else:
        document[place[-1]] = value  # type: ignore[index]


_GONE = object()
_RING = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 0.5]]
_COORDINATES = ("areas", "features", 0, "geometry", "geometries", 0, "coordinates")

WRONG: list[tuple[tuple[str | int, ...], Any, str]] = [
    (("version",), 3, r"version: expected 1 or 2, got 3"),
    (("version",), 1.0, r"version: expected 1 or 2, got 1.0"),
    (("version",), True, r"version: expected 1 or 2, got true"),
    (("seed",), _GONE, r"missing key 'seed'"),
    (("seed",), "0", r"seed: expected a whole number, got '0'"),
    (("extra",), 1, r"unknown key 'extra', valid keys: version, world"),
    (("world",), [], r"world: expected a mapping of keys to values, got \[\]"),
    (("world", "robot"), "nobody", r"plan.json: world: robot"),
    (("lift_offs",), -1, r"lift_offs: must be at least 0, got -1"),
    (("joint_names", 0), "elbow", r"joint_names: expected \['joint_1'"),
    (("setpoints", 3, "base"), [0.0, 1.0], r"setpoints\[3\].base: "),
    (("setpoints", 3, "joints"), [0.0, 1.0], r"setpoints\[3\].joints: expected 5 numbers, got 2"),
    (("setpoints", 3, "target"), [0.0, 1.0, 2.0], r"setpoints\[3\].target: expected the world's"),
    (("setpoints", 39), _GONE, r"setpoints: expected 40, one for each target, got 39"),
    (("states",), [], r"states: expected at least one state"),
    (
        ("states", 5, "kind"),
        "flight",
        r"states\[5\].kind: expected 'setpoint', 'step' or 'transit', got 'flight'",
    ),
    (("states", 5, "setpoint"), 40, r"states\[5\].setpoint: expected 0 to 39, got 40"),
    (("states", 5, "setpoint"), 1.0, r"states\[5\].setpoint: expected a whole number, got 1.0"),
    (("states", 5, "base", 1), "x", r"states\[5\].base\[1\]: expected a number, got 'x'"),
    (("states", 5, "base", 1), float("inf"), r"every number must be finite, got Infinity"),
    (("states", 5, "joints", 1), float("nan"), r"every number must be finite, got NaN"),
    (("states", 5, "joints", 1), None, r"states\[5\].joints\[1\]: expected a number, got None"),
    (("states", 5, "tool"), _GONE, r"states\[5\]: missing key 'tool', expected x, y, z \[m\]"),
    (("areas", "type"), "Feature", r"areas.type: expected 'FeatureCollection'"),
    (("areas", "features", 1), _GONE, r"areas.features: expected 40, one for each target, got 39"),
    (
        ("areas", "features", 1, "properties", "setpoint"),
        0,
        r"areas.features\[1\].properties: expected set-point 1",
    ),
    (
        _COORDINATES,
        [[_RING]],
        r"features\[0\].geometry.geometries\[0\].coordinates\[0\]\[0\]: expected a closed ring",
    ),
    (
        _COORDINATES,
        [[[[0, 0], [1, 1], [1, 0], [0, 1], [0, 0]]]],
        r"expected simple polygons: Self-intersection",
    ),
    (_COORDINATES, [[]], r"coordinates\[0\]: "),
]


@pytest.mark.parametrize(("place", "value", "words"), WRONG)
def test_a_wrong_file_is_one_line_that_says_where(
    place: tuple[str | int, ...], value: Any, words: str, document: dict[str, Any], tmp_path: Path
) -> None:
    wrong = copy.deepcopy(document)
    _put(wrong, place, value)
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(wrong))
    with pytest.raises(InputError, match=words) as caught:
        load_plan(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "expected a plan in JSON"),
        (b"{", "expected a plan in JSON"),
        (b"\xff\xfe\x00", "expected a plan in JSON"),
        (b"[1]", "a JSON object, got list"),
        (b"{}", "version: expected 1 or 2, got null"),
        (b"[" * 200_000, "nested too deep"),
        (b'{"version": 1, "seed": 1e999}', "missing key 'world'"),
    ],
)
def test_what_is_no_plan_is_one_line(data: bytes, words: str, tmp_path: Path) -> None:
    path = tmp_path / "plan.json"
    path.write_bytes(data)
    with pytest.raises(InputError, match=words) as caught:
        load_plan(path)
    assert "\n" not in str(caught.value)


def test_missing_and_too_large_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match=r"none.json: there is no such file"):
        load_plan(tmp_path / "none.json")
    with pytest.raises(InputError, match=r"cannot be read: expected a file"):
        load_plan(tmp_path)
    huge = tmp_path / "huge.json"
    huge.touch()
    os.truncate(huge, MAX_BYTES + 1)
    with pytest.raises(InputError, match=r"expected at most 256 MB"):
        load_plan(huge)


@pytest.mark.parametrize(
    ("geometry", "area"),
    [
        (Polygon(), 0.0),
        (GeometryCollection([Point(0, 0), LineString([(0, 0), (1, 1)]), box(0, 0, 1, 1)]), 1.0),
        (GeometryCollection([MultiPolygon([box(0, 0, 1, 1), box(2, 0, 3, 1)])]), 2.0),
        (MultiPolygon([box(0, 0, 1, 1), box(1, 0, 2, 1)]), 2.0),  # share a side: no valid MultiPolygon
        (Polygon([(0, 0), (2, 2), (2, 0), (0, 2)]), 2.0),
        (box(0, 0, 3, 3) - box(1, 1, 2, 2), 8.0),
    ],
)
def test_areas_become_valid_multipolygons(geometry: shapely.Geometry, area: float) -> None:
    written = shapely.geometry.shape(multipolygon(geometry))
    assert written.is_valid
    assert written.area == pytest.approx(area)
    assert all(polygon.exterior.is_ccw for polygon in written.geoms)
    assert multipolygon(written) == multipolygon(geometry)


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=20,
)


@given(JSON)
def test_json_values_are_json_and_stay_as_they_are(value: Any) -> None:
    once = json_values(value)
    assert json.loads(json.dumps(once, allow_nan=False)) == once
    assert json_values(once) == once
