"""Reach fields: counts that areas confirm, slices that bulk answers confirm, files that read back."""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import rasterio
import shapely
from numpy.typing import NDArray

from regionik.cli.app import run
from regionik.output.export import write_field
from regionik.reachability.field import reach_field, reach_slice
from regionik.reachability.options import REACHABILITY
from regionik.reachability.reach import reach
from regionik.regions import admissible_area
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.errors import InputError
from regionik.worlds.limits import Criteria
from regionik.worlds.scene import Rules, Start, Target, World
from regionik.worlds.urdf.loader import load_robot
from tests.maths import Array

CELL = 0.1


def targets_in(world: World, count: int, low: float = 0.0, high: float = 0.7) -> Array:
    x0, y0, x1, y1 = world.floor.polygon.bounds
    return np.random.default_rng(1).uniform([x0, y0, low], [x1, y1, high], (count, 3))


def fixed(name: str, robot: str) -> World:
    """A world whose base must keep one heading, so that the first joint's limits show."""
    world = load_world(name)
    return replace(world, robot=load_robot(robot), rules=replace(world.rules, heading="fixed"))


WORLDS = {
    "free": load_world("free"),
    "l_shape": load_world("l_shape"),
    "headings": fixed("free", "youbot-real"),
    "criteria": replace(load_world("free"), rules=Rules(criteria=Criteria(0.012, 0.05))),
    "no plane": replace(load_world("free"), robot=load_robot("hinge5"), start=None),
}


def counted_by_areas(
    world: World, x: Array, y: Array, targets: list[Target], *, inner: bool
) -> NDArray[np.int64]:
    total = np.zeros((len(y), len(x)), dtype=np.int64)
    for target in targets:
        area = admissible_area(world, target)
        total += shapely.contains_xy(area.inner if inner else area.outer, x[None], y[:, None])
    return total


@pytest.mark.parametrize("name", WORLDS)
def test_counts_lie_between_inner_and_outer_areas(name: str) -> None:
    world = WORLDS[name]
    heights = (0.1, 0.1) if name == "no plane" else (0.0, 0.7)  # its bounds take seconds for each height
    targets = [Target(row) for row in targets_in(world, 25, *heights)]
    field = reach_field(world, targets, CELL)
    assert field.most == 25
    assert field.values.max() > 0
    assert (field.values >= counted_by_areas(world, field.x, field.y, targets, inner=True)).all()
    assert (field.values <= counted_by_areas(world, field.x, field.y, targets, inner=False)).all()
    assert (np.isnan(field.heading) | (field.values > 0)).all()


def test_directions_count_by_their_areas() -> None:
    world = WORLDS["l_shape"]
    targets = [Target(row, np.array([1.0, 0, 0]), 0.3) for row in targets_in(world, 25)]
    field = reach_field(world, targets, CELL)
    assert field.values.max() > 0
    assert np.array_equal(field.values, counted_by_areas(world, field.x, field.y, targets, inner=True))


def test_one_heading_serves_all_that_a_place_counts() -> None:
    free, robot = load_world("free"), load_robot("youbot-real")
    corridor = replace(free.floor, polygon=shapely.box(0, 0, 2, 0.7))
    world = replace(free, robot=robot, floor=corridor, task=(), start=None)
    targets = targets_in(world, 12)
    field = reach_field(world, targets, CELL)
    known = np.argwhere((field.values > 0) & ~np.isnan(field.heading))
    assert len(known)
    for row, column in known[:: max(1, len(known) // 5)]:
        start = Start(np.array([0, 0, field.heading[row, column]]), robot.carry)
        held = replace(world, rules=replace(world.rules, heading="fixed"), start=start)
        spot = shapely.Point(field.x[column], field.y[row])
        held_count = sum(admissible_area(held, target).outer.covers(spot) for target in targets)
        assert held_count >= field.values[row, column]


def test_no_targets_and_no_floor() -> None:
    assert reach_field(WORLDS["free"], np.empty((0, 3)), CELL).values.max() == 0
    narrow = replace(WORLDS["l_shape"], rules=replace(WORLDS["l_shape"].rules, clearance=50.0))
    assert reach_field(narrow, targets_in(narrow, 5), CELL).values.max() == 0
    assert reach_slice(narrow, 0.3, 0.5).values.max() <= 1


@pytest.mark.parametrize(("name", "height"), [("l_shape", 0.1), ("headings", 0.4)])
def test_a_slice_is_what_bulk_answers_say(name: str, height: float) -> None:
    world = replace(WORLDS[name], rules=replace(WORLDS[name].rules, avoidance=False))  # a slice sees no arm
    field = reach_slice(world, height, 0.45)
    x, y = (axis.ravel() for axis in np.meshgrid(field.x, field.y))
    answer = reach(world, np.column_stack([x, y, np.full(len(x), height)]))
    values = field.values.ravel()
    assert {0, 2} <= set(values.tolist())
    assert (values[answer.verdict == "unreachable"] < 2).all()  # a slice leaves some undecided
    assert (answer.verdict[values == 0] != "reachable").all()
    assert (values[answer.reachable] > 0).all()
    assert answer.reachable[values == 2].mean() > 0.97  # true circles hold more than their chords


def test_a_slice_above_the_arm_is_empty() -> None:
    field = reach_slice(WORLDS["free"], 5.0, 0.2)
    assert field.values.size > 0
    assert field.values.max() == 0


@pytest.mark.parametrize("cell", [0.0, -1.0, float("nan"), 1e-6])
def test_wrong_cells(cell: float) -> None:
    with pytest.raises(InputError, match="cell: "):
        reach_field(WORLDS["free"], [[0.5, 0, 0.3]], cell)
    assert REACHABILITY.field.max_cells > 10_000_000


def test_wrong_targets_and_heights() -> None:
    with pytest.raises(InputError, match="targets"):
        reach_field(WORLDS["free"], [[0, 0]])
    with pytest.raises(InputError, match="height"):
        reach_slice(WORLDS["free"], float("nan"))


# Files --------------------------------------------------------------------------------------------------


found = cache(lambda: reach_field(WORLDS["l_shape"], targets_in(WORLDS["l_shape"], 40), CELL))


def test_arrays_read_back(tmp_path: Path) -> None:
    write_field(found(), tmp_path / "f.npz")
    with np.load(tmp_path / "f.npz") as there:
        assert np.array_equal(there["values"], found().values)
        assert np.array_equal(there["x"], found().x)
        assert int(there["most"]) == 40
        assert np.isnan(there["height"])


def test_geotiff_reads_back(tmp_path: Path) -> None:
    write_field(found(), tmp_path / "f.tif")
    with rasterio.open(tmp_path / "f.tif") as there:
        assert np.array_equal(there.read(1)[::-1], found().values)
        x, y = there.xy(there.height - 1, 0)
        assert (x, y) == pytest.approx((found().x[0], found().y[0]))
        assert there.tags()["most"] == "40"
        assert there.crs is not None


@pytest.mark.parametrize("suffix", [".npz", ".tif", ".png", ".svg"])
def test_the_same_field_gives_the_same_bytes(suffix: str, tmp_path: Path) -> None:
    for name in ("one", "two"):
        write_field(found(), tmp_path / f"{name}{suffix}")
    data = (tmp_path / f"one{suffix}").read_bytes()
    assert data == (tmp_path / f"two{suffix}").read_bytes()
    assert len(data) > 500


def test_other_files_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match=r"\.npz, \.tif"):
        write_field(found(), tmp_path / "f.txt")
    monkeypatch.setitem(sys.modules, "rasterio", None)
    with pytest.raises(InputError, match=r"regionik\[geotiff\]"):
        write_field(found(), tmp_path / "f.tif")
    assert not list(tmp_path.iterdir())


def test_the_command(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    table, output = tmp_path / "t.csv", tmp_path / "f.npz"
    table.write_text("0.5,-0.1,0.3\n0.6,-0.2,0.3\n")
    assert run(["field", "free", "--targets", str(table), "--cell", "0.2", "-o", str(output)]) == 0
    assert "free: the best place reaches 2 of 2 targets, by areas alone" in capfd.readouterr().err
    assert run(["field", "free", "--height", "0.3", "--cell", "0.2", "-o", str(output)]) == 0
    with np.load(output) as there:
        assert float(there["height"]) == 0.3
    assert "at 0.3 m the tool reaches" in capfd.readouterr().err
    asked = ["field", "pillar", "--targets", str(table), "--cell", "0.2", "--check", "-o", str(output)]
    assert run(asked) == 0
    assert "yaw 0.000 rad, 2 have a posture that is clear" in capfd.readouterr().err
    with np.load(output) as there:
        assert str(there["meaning"]) == "targets reached, of 2, by areas alone"
    wrong = [
        (["--check", "-o", str(output)], "face_target turns the base"),
        (["--check", "--height", "0.3", "-o", str(output)], "--check and --height"),
        (["--targets", str(table), "--height", "0.3", "-o", str(output)], "--targets and --height"),
        (["-o", str(tmp_path / "f.txt")], ".npz"),
        (["--cell", "0", "-o", str(output)], "cell: must be above 0"),
        (["--targets", str(tmp_path / "no.csv"), "-o", str(output)], "there is no such file"),
    ]
    for arguments, words in wrong:
        assert run(["field", "free", *arguments]) == 2
        out, err = capfd.readouterr()
        assert (out, len(err.splitlines())) == ("", 1)
        assert words in err


def test_a_slice_asks_few_cells_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    world, points, made = load_world("pillar"), shapely.points, list[int]()

    def counting(*places: Array) -> NDArray[np.object_]:
        made.append(np.size(places[0]))
        return points(*places)

    monkeypatch.setattr(shapely, "points", counting)
    found = reach_slice(world, 0.25, cell=0.02)
    assert 0 < sum(made) < found.values.size  # of two reaches, from outside and from within
