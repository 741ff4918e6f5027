from __future__ import annotations

import base64
import dataclasses
import io
import os
import re
import subprocess
from pathlib import Path
from typing import Any
from urllib.error import URLError
from urllib.request import urlopen

import numpy as np
import pytest
import umsgpack
from PIL import Image

from regionik.cli.app import run
from regionik.values import Plan
from regionik.view import film, viewer
from regionik.view.film import BrowserPage, chromium, opened
from regionik.view.options import VIEW
from regionik.view.page import html_page, served, to_html
from regionik.view.plan_picture import picture_of_plan
from regionik.view.timeline import clearances
from regionik.view.viewer import picture_of
from regionik.view.world_picture import picture_of_world, shown_start
from regionik.worlds.errors import EngineError, InputError
from regionik.worlds.links import LinkBox
from regionik.worlds.scene import World
from tests.maths import Array, pose
from tests.plans import every_solid, l_shape, synthetic_plan, timed

REQUIRED = os.environ.get("REGIONIK_REQUIRE_BROWSER") == "1"
needs_browser = pytest.mark.skipif(
    chromium() is None and not REQUIRED, reason="no Chromium; REGIONIK_REQUIRE_BROWSER=1 demands one"
)


@pytest.fixture(scope="module")
def plan() -> Plan:
    return synthetic_plan(l_shape())


def commands(path: Path) -> list[dict[str, Any]]:
    lines = re.findall(r'^"([A-Za-z0-9+/=]+)",?$', path.read_text(encoding="utf-8"), re.MULTILINE)
    return [umsgpack.unpackb(base64.b64decode(line)) for line in lines]


def test_a_page_is_one_small_file_made_without_a_server(
    plan: Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def started(*_: object, **__: object) -> None:
        raise AssertionError("a process was started")

    monkeypatch.setattr(subprocess, "Popen", started)
    to_html(plan, tmp_path / "plan.html")
    assert (tmp_path / "plan.html").stat().st_size < 8e6
    text = (tmp_path / "plan.html").read_text(encoding="utf-8")
    assert not re.findall(r"<(?:script|link|img)[^>]*(?:src|href)=", text)
    assert "<title>l_shape - regionik</title>" in text
    assert "40 set-points · 1 lift-off · not timed<" in text
    to_html(plan, tmp_path / "again.html")
    assert (tmp_path / "again.html").read_bytes() == (tmp_path / "plan.html").read_bytes()


def test_every_animated_thing_is_there_and_all_last_equally_long(plan: Plan, tmp_path: Path) -> None:
    to_html(plan, tmp_path / "plan.html")
    sent = commands(tmp_path / "plan.html")
    assert [c["type"] for c in sent].count("set_animation") == 1
    meshes = {f"{c['path']}/<object>" for c in sent if c["type"] == "set_object"}
    nodes = {c["path"] for c in sent if c["type"] == "set_transform"}
    animation = sent[-1]["animations"]
    tracks = [(a["path"], track) for a in animation for track in a["clip"]["tracks"]]
    assert len({track["keys"][-1]["time"] for _, track in tracks}) == 1
    for path, track in tracks:
        times = [key["time"] for key in track["keys"]]
        assert times[0] == 0.0
        assert (np.diff(times) >= 0).all()
        assert len(times) <= 1.1 * VIEW.animation.max_frames
        assert path in (nodes if track["type"] in ("vector3", "quaternion") else meshes)


def test_no_matrix_or_mesh_has_anything_but_numbers(tmp_path: Path) -> None:
    drawn: tuple[Plan | World, ...] = (l_shape(), every_solid(), synthetic_plan(every_solid()))
    for k, what in enumerate(drawn):
        to_html(what, tmp_path / f"{k}.html")
        for command in commands(tmp_path / f"{k}.html"):
            if command["type"] == "set_transform":
                assert len(command["matrix"]) == 16
                assert np.isfinite(command["matrix"]).all()
            for geometry in command.get("object", {}).get("geometries", []):
                data = geometry["data"]["attributes"]["position"]["array"].data
                assert np.isfinite(np.frombuffer(data, dtype=np.float32)).all()


def _pose(picture_poses: dict[str, Array], path: str) -> Array:
    T, node = np.eye(4), ""
    for step in path.split("/"):
        node = f"{node}/{step}".lstrip("/")
        T = T @ picture_poses.get(node, np.eye(4))
    return T


@pytest.mark.parametrize("world", [l_shape(), every_solid()])
def test_the_tool_hangs_where_the_robot_has_it(world: World) -> None:
    plan = synthetic_plan(world)
    picture = picture_of_plan(plan)
    tip = next(body.path for body in picture.bodies if body.path.endswith("tool/tip"))
    first = plan.world.robot.tool(plan.motion.base[0], plan.motion.joints[0])
    assert np.allclose(_pose(picture.poses, tip), first, atol=1e-12)


def test_the_picture_holds_what_the_plan_has(plan: Plan) -> None:
    picture = picture_of_plan(plan)
    bodies = {body.path: body for body in picture.bodies}
    tracks = {(track.path, track.kind): track for track in picture.tracks}
    count = tracks["task/passed", "faces"].values[:, 1]
    assert (count[0], count[-1]) == (0, len(bodies["task/passed"].mesh.faces))
    assert (np.diff(count) >= 0).all()
    assert tracks["tool/trace", "faces"].values[-1, 1] == len(bodies["tool/trace"].mesh.faces)
    nexts = tracks["areas/next", "faces"].values
    assert nexts.sum(axis=1).max() == len(bodies["areas/next"].mesh.faces)
    assert any(entry.label == "tool lifted" for entry in picture.legend)


def test_work_and_travel_are_drawn_apart(plan: Plan) -> None:
    """Faces of a path are as many for each of its ways."""
    count = len(plan.world.task)
    parted = count // 4, count // 2
    strokes = [1] * parted[0] + [0] * (parted[1] - parted[0]) + [2] * (count - parted[1])
    task = tuple(dataclasses.replace(one, stroke=k) for one, k in zip(plan.world.task, strokes, strict=True))
    whole = {body.path: body for body in picture_of_plan(plan).bodies}
    shown = picture_of_plan(dataclasses.replace(plan, world=dataclasses.replace(plan.world, task=task)))
    bodies = {body.path: body for body in shown.bodies}
    sides = len(whole["task/path"].mesh.faces) // (count - 1)
    assert len(bodies["task/travel"].mesh.faces) == sides * (parted[1] - parted[0] + 1)
    assert len(bodies["task/path"].mesh.faces) == sides * (count - 2 - parted[1] + parted[0])
    assert len(bodies["tool/trace"].mesh.faces) + len(bodies["tool/travel"].mesh.faces) == len(
        whole["tool/trace"].mesh.faces
    )
    assert len(bodies["tool/lifted"].mesh.faces) == len(whole["tool/lifted"].mesh.faces)
    assert not {"task/travel", "tool/travel"} & whole.keys()
    assert {"travel asked for", "tool on travel"} <= {entry.label for entry in shown.legend}


def test_a_world_without_task_start_or_obstacles_is_drawn() -> None:
    world = l_shape()
    bare = World("bare", world.robot, world.floor)
    picture = picture_of_world(bare)
    assert picture.tracks == ()
    assert {"floor/all", "robot/base"} <= {body.path for body in picture.bodies}
    assert np.allclose(picture.camera.center[:2], world.floor.polygon.centroid.coords[0], atol=1e-9)


def test_boxes_on_links_are_drawn_where_the_robot_has_them() -> None:
    world = every_solid()
    box = LinkBox(3, "hand", pose([0.02, 0.0, 0.1], [0.3, 0.2, 0.1]), np.array([0.1, 0.2, 0.06]))
    other = LinkBox(4, "finger", np.eye(4), np.array([0.05, 0.05, 0.3]))
    robot = dataclasses.replace(world.robot, solids=(*world.robot.solids[:2], box, other))
    picture = picture_of_world(dataclasses.replace(world, robot=robot))
    (drawn,) = (body for body in picture.bodies if body.path.endswith("joint_3/link"))
    pose_at = shown_start(dataclasses.replace(world, robot=robot))
    assert pose_at is not None
    base, joints = pose_at
    T_world_link = robot.frames(base, joints)[3]
    T_world_drawn = _pose(picture.poses, drawn.path.rsplit("/", 1)[0])
    seen, true = (
        points @ T[:3, :3].T + T[:3, 3]
        for points, T in ((drawn.mesh.vertices, T_world_drawn), (box.corners, T_world_link))
    )
    apart = np.linalg.norm(seen[:, None] - true[None], axis=2)
    assert apart.min(axis=0).max() < 1e-12
    assert apart.min(axis=1).max() < 1e-12


def test_names_are_shown_as_text(tmp_path: Path) -> None:
    world = l_shape()
    named = World("<script>alert(1)</script>", world.robot, world.floor, about='"&"')
    to_html(named, tmp_path / "world.html")
    text = (tmp_path / "world.html").read_text(encoding="utf-8")
    assert "<script>alert" not in text
    assert "&lt;script&gt;alert(1)&lt;/script&gt;" in text


def test_a_missing_folder_is_one_line(plan: Plan, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="expected an existing folder"):
        to_html(plan, tmp_path / "none" / "plan.html")


def test_show_serves_and_stop_ends_it(plan: Plan) -> None:
    visualizer = viewer.show(plan, open_browser=False)
    process = visualizer.window.server_proc
    try:
        assert visualizer.url().startswith("http://127.0.0.1")
        visualizer["more"].set_transform(np.eye(4))  # the server answers
        assert process.poll() is None
    finally:
        viewer.stop(visualizer)
    assert process.poll() is not None


def shares(image: Image.Image) -> dict[str, float]:
    """Share of pixels of every kind of colour, the legend and the controls left out."""
    rgb = np.asarray(image.convert("RGB"), dtype=float)[280:] / 255
    r, g, b = rgb[..., 0], rgb[..., 1], rgb[..., 2]
    return {
        "green": float(((g > r + 0.1) & (g > b + 0.1)).mean()),
        "red": float(((r > g + 0.15) & (r > b + 0.15)).mean()),
        "blue": float(((b > r + 0.15) & (b > g + 0.05)).mean()),
        "grey": float(((rgb.max(axis=-1) - rgb.min(axis=-1) < 0.06) & (r > 0.3) & (r < 0.8)).mean()),
    }


@needs_browser
def test_a_browser_shows_a_world(tmp_path: Path) -> None:
    to_html(every_solid(), tmp_path / "page.html")
    with opened(tmp_path / "page.html") as browser:
        settle(browser)
        assert_colors(browser, red=0.04, blue=0.1, grey=0.02)
        assert not browser.evaluate("!document.getElementById('dock').hidden")
        assert "WebGL" not in browser.evaluate("document.body.innerText")
        assert browser.complaints == []


def drag(browser: BrowserPage, *points: tuple[float, float]) -> None:
    """Press the mouse at the first point of the window, move it over all, release it at the last."""
    held = {"button": "left", "buttons": 1, "clickCount": 1}
    kinds = ("mousePressed", *("mouseMoved" for _ in points[1:]), "mouseReleased")
    for kind, (x, y) in zip(kinds, (*points, points[-1]), strict=True):
        browser.send("Input.dispatchMouseEvent", type=kind, x=x, y=y, **held)


def press(browser: BrowserPage, key: str) -> None:
    """Press and release a key, by its name in events of the browser."""
    for kind in ("keyDown", "keyUp"):
        browser.send("Input.dispatchKeyEvent", type=kind, key=key)


def settle(browser: BrowserPage) -> None:
    """Wait until what was asked for is drawn."""
    browser.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def told(browser: BrowserPage) -> dict[str, str]:
    """The lines of the read-outs."""
    lines = browser.evaluate("document.getElementById('readout').innerText").splitlines()
    return dict(line.split("\t") for line in lines)


def assert_colors(browser: BrowserPage, **least: float) -> None:
    found = shares(Image.open(io.BytesIO(browser.screenshot())))
    assert all(found[color] >= share for color, share in least.items()), found


def place(browser: BrowserPage, element: str) -> tuple[float, float, float, float]:
    """Left, top, width and height of an element [pixels]."""
    browser.evaluate(f"found = {element}.getBoundingClientRect()")
    x, y, width, height = browser.evaluate("[found.x, found.y, found.width, found.height]")
    return x, y, width, height


def number(text: str) -> float:
    return float(text.split()[0])


@needs_browser
def test_the_controls_of_a_page_tell_what_the_plan_holds(tmp_path: Path) -> None:
    plan = timed(synthetic_plan(l_shape()))
    to_html(plan, tmp_path / "page.html")
    motion, end = plan.motion, float(plan.motion.time[-1])
    distances = clearances(plan.world, motion.base, motion.joints)
    with opened(tmp_path / "page.html") as browser:
        settle(browser)
        assert_colors(browser, green=0.02, red=0.01, blue=0.1)
        beside = browser.evaluate("document.querySelector('#curves .values').innerText")
        assert all(joint.name in beside for joint in plan.world.robot.chain.joints)
        cut = "[...document.querySelectorAll('#curves .values')].some((e) => e.scrollHeight > e.clientHeight)"
        assert not browser.evaluate(cut)

        x, y, width, height = place(browser, "document.getElementById('bar')")
        drag(browser, *((x + share * width, y + height / 2) for share in (0.01, 0.3, 0.5)))
        lines = told(browser)
        assert number(lines["time"]) == pytest.approx(end / 2, abs=2 * end / width)
        at = np.interp(number(lines["time"]), motion.time, distances.base)
        assert number(lines["base to solids"]) == pytest.approx(at, abs=0.03)
        assert number(lines["tool speed"]) > 0

        browser.evaluate("jump(11)")
        for i in (11, 12):  # the arrow goes on to the next
            k = int(np.flatnonzero(motion.setpoint == i)[0])
            lines = told(browser)
            assert lines["at set-point"] == f"{i + 1} of 40"
            assert number(lines["time"]) == pytest.approx(motion.time[k], abs=0.006)
            assert number(lines["base to solids"]) == pytest.approx(distances.base[k], abs=0.0006)
            assert number(lines["arm to solids"]) == pytest.approx(distances.arm[k], abs=0.0006)
            assert number(lines["area"]) == pytest.approx(plan.areas[i].pruned.area, abs=0.0006)
            assert number(lines["joint_2"].replace("\u00b0", "")) == pytest.approx(
                np.degrees(motion.joints[k, 1]), abs=0.06
            )
            press(browser, "ArrowRight")

        press(browser, " ")
        browser.evaluate(PLAYED_ON)
        assert number(told(browser)["time"]) > motion.time[k]

        browser.evaluate("document.querySelector('#layers input').click()")
        first = picture_of_plan(plan).legend[0].paths[0]
        assert browser.evaluate(f"nodeOf({first!r}).visible") is False

        press(browser, "t")
        settle(browser)
        assert browser.evaluate("viewer.camera.position.y > 100 * Math.abs(viewer.camera.position.z)")
        x, y = browser.evaluate(PROJECTED)
        drag(browser, (x, y))
        assert browser.evaluate("document.getElementById('tip').innerText") == "set-point 30"
        assert told(browser)["at set-point"] == "30 of 40"
        assert browser.complaints == []


# Done when time has gone on.
PLAYED_ON = """new Promise((done) => {
  const begun = player.time, look = () => player.time > begun ? done() : requestAnimationFrame(look);
  look();
})"""
# Where in the window the mark of set-point 30 is, from its vertices.
PROJECTED = """(() => {
  const mark = nodeOf("task/ahead"), all = mark.geometry.attributes.position, own = all.count / 40;
  const middle = new MeshCat.THREE.Vector3(), corner = new MeshCat.THREE.Vector3();
  for (let k = 29 * own; k < 30 * own; k++) middle.add(corner.fromBufferAttribute(all, k));
  middle.divideScalar(own).applyMatrix4(mark.matrixWorld).project(viewer.camera);
  const box = pane.getBoundingClientRect();
  return [box.x + box.width * (1 + middle.x) / 2, box.y + box.height * (1 - middle.y) / 2];
})()"""


@pytest.mark.slow
@needs_browser
def test_a_film_is_a_moving_picture(tmp_path: Path) -> None:
    plan = synthetic_plan(l_shape())
    brief = dataclasses.replace(timed(plan, rate=9.0))
    film.film(html_page(brief), tmp_path / "plan.gif")
    with Image.open(tmp_path / "plan.gif") as image:
        assert getattr(image, "n_frames", 1) >= 2
        assert image.size == VIEW.animation.film_size
    with pytest.raises(InputError, match=r"expected a file name ending in \.gif, \.mp4"):
        film.film(html_page(brief), tmp_path / "plan.avi")


@pytest.fixture
def without_webgl(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Put a Chromium on the path that draws nothing in three dimensions."""
    program = tmp_path / "bin" / "chromium"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec "{chromium()}" --disable-3d-apis "$@"\n')
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{program.parent}{os.pathsep}{os.environ['PATH']}")


@pytest.mark.slow
@needs_browser
@pytest.mark.usefixtures("without_webgl")
def test_a_page_without_webgl_says_so_and_tells_the_rest(tmp_path: Path) -> None:
    plan = timed(synthetic_plan(l_shape()))
    for what in (plan, plan.world):
        to_html(what, tmp_path / "page.html")
        with opened(tmp_path / "page.html") as browser:
            settle(browser)
            assert browser.complaints == []
            said = browser.evaluate("document.body.innerText")
            assert "This browser has no WebGL, so the scene is not drawn" in said
            assert all(label in said for _, label, _ in picture_of(what).legend)
            assert not browser.evaluate("document.querySelector('#layers input').checkVisibility()")
            if what is plan:
                assert "the time bar, the figures and the curves work" in said
                browser.evaluate("jump(11)")
                assert told(browser)["at set-point"] == "12 of 40"
                x, y, width, height = place(browser, "document.getElementById('bar')")
                drag(browser, (x + width / 2, y + height / 2))
                end = float(plan.motion.time[-1])
                assert number(told(browser)["time"]) == pytest.approx(end / 2, abs=2 * end / width)


@needs_browser
@pytest.mark.usefixtures("without_webgl")
def test_without_webgl_a_film_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(EngineError, match="Chromium has no WebGL here, which a film is drawn with"):
        film.film(html_page(timed(synthetic_plan(l_shape()))), tmp_path / "plan.gif")
    assert not (tmp_path / "plan.gif").exists()


def test_without_a_browser_a_film_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    with pytest.raises(InputError, match="this needs Chromium: expected one of chromium"):
        film.film(html_page(synthetic_plan(l_shape())), tmp_path / "plan.gif")
    with pytest.raises(InputError, match="an MP4 needs ffmpeg"):
        film.film(html_page(synthetic_plan(l_shape())), tmp_path / "plan.mp4")
    assert list(tmp_path.iterdir()) == []


def test_the_command_writes_a_page_of_a_world_and_refuses_what_it_cannot(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "pillar.html"
    assert run(["show", "pillar", "-o", str(page)]) == 0
    assert "<title>pillar - regionik</title>" in page.read_text("utf-8")
    refused = {
        ("pillar", "-o", "x.txt"): "expected a file name ending in .html, .gif, .mp4",
        ("pillar", "-o", "x.gif"): "expected a plan to film, this is a world",
        ("pillar", "-o", "x.html", "--live"): "--live watches a world file and writes none",
    }
    for arguments, words in refused.items():
        assert run(["show", *arguments]) == 2
        assert words in capsys.readouterr().err


def test_a_served_page_is_the_page_and_ends_with_the_block() -> None:
    with served("<p>\u00e9</p>") as address, urlopen(address, timeout=5.0) as answer:
        assert answer.read().decode() == "<p>\u00e9</p>"
    with pytest.raises(URLError):
        urlopen(address, timeout=5.0)
