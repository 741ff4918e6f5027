"""Occupancy maps: cells, thresholds, placement, and files that are no maps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from shapely.geometry import Point, box

from regionik.worlds.bundled import DATA
from regionik.worlds.errors import FileNote, InputError
from regionik.worlds.readers.occupancy_map import MAX_CELLS, load_map
from regionik.worlds.scene import Floor
from tests import examples

KEYS = {
    "image": "map.pgm",
    "resolution": "0.5",
    "origin": "[0.0, 0.0, 0.0]",
    "negate": "0",
    "occupied_thresh": "0.65",
    "free_thresh": "0.196",
    "mode": "trinary",
}


def write_map(folder: Path, pixels: np.ndarray, image: str = "map.pgm", **changes: str | None) -> Path:
    Image.fromarray(pixels.astype(np.uint8)).save(folder / image)
    keys = {**KEYS, "image": image, **changes}
    path = folder / "map.yaml"
    path.write_text("".join(f"{key}: {value}\n" for key, value in keys.items() if value is not None))
    return path


def blocked_area(floor: Floor) -> float:
    return float(sum(cell.polygon.area for cell in floor.cells))


def test_row_0_of_the_image_is_the_far_side(tmp_path: Path) -> None:
    pixels = np.full((2, 3), 254)
    pixels[0, 2] = 0  # upper right
    floor = load_map(write_map(tmp_path, pixels), 0.8)
    assert floor.polygon.equals(box(0, 0, 1.5, 1.0))
    assert len(floor.cells) == 1
    cell = floor.cells[0]
    assert cell.polygon.equals(box(1.0, 0.5, 1.5, 1.0))
    assert (cell.bottom, cell.top) == (0.0, 0.8)
    assert cell.name == "map cells near (1.2, 0.8)"


def test_occupied_and_unknown_cells_block(tmp_path: Path) -> None:
    pixels = np.array([[0, 205, 254], [254, 254, 254]])
    path = write_map(tmp_path, pixels)
    assert blocked_area(load_map(path, 1.0)) == 0.5
    # With 0.25 every reader takes grey 205 for free, as 1 - 205/255 = 0.196.
    path = write_map(tmp_path, pixels, free_thresh="0.25")
    with pytest.warns(FileNote):
        assert blocked_area(load_map(path, 1.0)) == 0.25
    assert blocked_area(load_map(path, 1.0, free_thresh=0.196)) == 0.5


@pytest.mark.parametrize(("grey", "negate", "threshold", "kept"), [
    (205, False, "0.25", "0.196"), (50, True, "0.25", "0.196"), (128, False, "0.6", "0.498"),
])  # fmt: skip
def test_unseen_cells_that_count_as_free_are_told(
    grey: int, negate: bool, threshold: str, kept: str, tmp_path: Path
) -> None:
    pixels = np.full((4, 5), 1 if negate else 254)
    pixels[1, :3] = grey
    path = write_map(tmp_path, pixels, free_thresh=threshold, negate=str(int(negate)))
    told = rf"map.yaml: 3 cells of grey {grey}, .* free_thresh {threshold}; free_thresh: {kept} beside"
    with pytest.warns(FileNote, match=told):
        load_map(path, 1.0)
    assert blocked_area(load_map(path, 1.0, free_thresh=float(kept))) == 0.75  # nothing is told of these


def test_negate(tmp_path: Path) -> None:
    pixels = np.array([[255, 0, 0]])
    floor = load_map(write_map(tmp_path, pixels, negate="1"), 1.0)
    assert [cell.polygon.bounds for cell in floor.cells] == [(0.0, 0.0, 0.5, 0.5)]


def test_origin_and_yaw(tmp_path: Path) -> None:
    pixels = np.array([[0, 254]])
    floor = load_map(write_map(tmp_path, pixels, origin="[10.0, 20.0, 1.5707963267948966]"), 1.0)
    assert floor.polygon.symmetric_difference(box(9.5, 20, 10, 21)).area < 1e-12
    assert floor.cells[0].polygon.symmetric_difference(box(9.5, 20, 10, 20.5)).area < 1e-12


def test_corners_do_not_join_and_holes_stay_open(tmp_path: Path) -> None:
    pixels = np.full((4, 5), 254)
    pixels[0:3, 0:3] = 0
    pixels[1, 1] = 254  # a hole
    pixels[3, 3] = 0  # touches at a corner
    floor = load_map(write_map(tmp_path, pixels), 1.0)
    assert sorted(len(cell.polygon.interiors) for cell in floor.cells) == [0, 1]
    assert blocked_area(floor) == 9 * 0.25


@settings(max_examples=examples(60))
@given(st.integers(1, 12), st.integers(1, 12), st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.4, 2.9]))
def test_every_cell_is_where_its_pixel_says(
    tmp_path_factory: pytest.TempPathFactory, rows: int, columns: int, seed: int, yaw: float
) -> None:
    pixels = np.random.default_rng(seed).choice([0, 205, 254], size=(rows, columns))
    path = write_map(tmp_path_factory.mktemp("map"), pixels, origin=f"[1.0, -2.0, {yaw}]")
    floor = load_map(path, 1.0)
    assert all(cell.polygon.is_valid for cell in floor.cells)
    assert len({cell.name for cell in floor.cells}) == len(floor.cells)
    together = shapely.union_all([cell.polygon for cell in floor.cells])
    for row in range(rows):
        for column in range(columns):
            x, y = (column + 0.5) * 0.5, (rows - row - 0.5) * 0.5
            spot = Point(1 + x * np.cos(yaw) - y * np.sin(yaw), -2 + x * np.sin(yaw) + y * np.cos(yaw))
            assert together.contains(spot) == (pixels[row, column] != 254)


def test_png_and_plain_pgm_give_the_same_floor(tmp_path: Path) -> None:
    pixels = np.array([[0, 254, 254], [254, 205, 0]])
    png = load_map(write_map(tmp_path, pixels, "map.png"), 1.0)
    (tmp_path / "map.pgm").write_text("P2\n# made by hand\n3 2\n255\n0 254 254\n254 205 0\n")
    path = tmp_path / "plain.yaml"
    path.write_text((tmp_path / "map.yaml").read_text().replace("map.png", "map.pgm"))
    pgm = load_map(path, 1.0)
    assert [cell.polygon.wkb for cell in png.cells] == [cell.polygon.wkb for cell in pgm.cells]
    assert [cell.name for cell in png.cells] == [cell.name for cell in pgm.cells]


def test_transparent_pixels_are_unknown(tmp_path: Path) -> None:
    pixels = np.full((1, 2, 4), 255)
    pixels[0, 1, 3] = 0
    assert blocked_area(load_map(write_map(tmp_path, pixels, "map.png"), 1.0)) == 0.25


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"image": None}, "missing key 'image'"),
        ({"resolution": None}, "missing key 'resolution'"),
        ({"resolution": "0"}, "resolution: must be above 0"),
        ({"resolution": ".nan"}, "resolution: expected a finite number"),
        ({"origin": "[0, 0]"}, "origin: expected 3"),
        ({"occupied_thresh": "1.5"}, "occupied_thresh: must be at most 1"),
        ({"free_thresh": "0.7"}, "free_thresh: must be below occupied_thresh 0.65"),
        ({"mode": "raw"}, "mode: expected 'trinary', got 'raw'"),
        ({"image": "no.pgm"}, r"no\.pgm: there is no such file"),
        ({"image": "map.yaml"}, "expected a PGM or PNG image"),
    ],
)
def test_files_that_are_no_maps(changes: dict[str, str | None], message: str, tmp_path: Path) -> None:
    write_map(tmp_path, np.zeros((2, 2)))
    path = tmp_path / "map.yaml"
    keys = {**KEYS, **changes}
    path.write_text("".join(f"{key}: {value}\n" for key, value in keys.items() if value is not None))
    with pytest.raises(InputError, match=message) as caught:
        load_map(path, 1.0)
    assert len(str(caught.value).splitlines()) == 1


def test_images_cut_short_and_images_too_large(tmp_path: Path) -> None:
    path = write_map(tmp_path, np.zeros((50, 50)))
    whole = (tmp_path / "map.pgm").read_bytes()
    (tmp_path / "map.pgm").write_bytes(whole[:100])
    with pytest.raises(InputError, match="read whole"):
        load_map(path, 1.0)
    for side in (6_000, 12_000, 60_000):
        (tmp_path / "map.pgm").write_bytes(f"P5 {side} {side} 255\n".encode())
        with pytest.raises(InputError, match=f"at most {MAX_CELLS} cells"):
            load_map(path, 1.0)


def test_height_must_be_above_zero(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="height"):
        load_map(write_map(tmp_path, np.zeros((2, 2))), 0.0)


def test_the_depot_is_read_cell_by_cell() -> None:
    floor = load_map(DATA / "depot.yaml", 1.0, 0.196)
    pixels = np.asarray(Image.open(DATA / "depot.pgm"))
    assert blocked_area(floor) == pytest.approx((pixels < 254).sum() * 0.05**2)
    assert floor.polygon.bounds == pytest.approx((0, 0, 604 * 0.05, 307 * 0.05))
