"""Pictures in MeshCat, as commands to its viewer or on its server; the only file that imports it."""

from __future__ import annotations

import atexit
import io
import os
import subprocess
import sys
import textwrap
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from regionik.scene import WorldSource, world_of
from regionik.values import Plan
from regionik.view import triangle_meshes
from regionik.view.options import VIEW
from regionik.view.picture import Camera, KeyframeTrack, LegendEntry, Picture, SceneMesh, camera_axes
from regionik.view.plan_picture import picture_of_plan
from regionik.view.world_picture import picture_of_world
from regionik.worlds.arrays import Array
from regionik.worlds.chain import translation
from regionik.worlds.errors import EngineError

OPTIONS = VIEW.board

_ROOT = "/meshcat"
_FOREVER = 1_000_000  # repetitions of the animation
_STEPS = 2300  # three.js: a value jumps at its key
# Property, type of its values, whether it jumps. Values of type string are handed on as they are, which is
# how the drawn part of a mesh, an object, can be animated.
_THREE = {
    "position": (".position", "vector3", False),
    "turn": (".quaternion", "quaternion", False),
    "color": (".material.color", "color", True),
    "faces": (".geometry[drawRange]", "string", True),
}
_DEFAULT_VIEW_ANGLE = np.radians(75.0)  # of MeshCat's camera
# The server exits with this process: its stdin closes, however the parent ends.
_EXIT_WITH_PARENT = """
import os, runpy, sys, threading
def exit_with_parent():
    sys.stdin.read()
    os._exit(0)
threading.Thread(target=exit_with_parent, daemon=True).start()
module = sys.argv.pop()
runpy.run_module(module, run_name="__main__", alter_sys=True)
"""


def show(what: Plan | WorldSource | Picture, open_browser: bool = True) -> Any:
    """Show a plan or a world live in the browser.

    A helper process serves the picture. It ends with this Python process; `stop` ends it before.

    Parameters
    ----------
    what : Plan, Picture, World, or the name or file of one
    open_browser : bool
        The address is printed in any case.

    Returns
    -------
    meshcat.Visualizer
        For more drawing; its ``url()`` is the address.
    """
    visualizer = start_server()
    for command in _scene_commands(picture_of(what)):
        visualizer.window.send(command)
    if open_browser:
        visualizer.open()
    return visualizer


def picture_of(what: Plan | WorldSource | Picture) -> Picture:
    """The picture of a plan or a world; a picture as it is."""
    if isinstance(what, Picture):
        return what
    return picture_of_plan(what) if isinstance(what, Plan) else picture_of_world(world_of(what))


def start_server() -> Any:
    """Start a helper process that serves an empty scene, print its address, and return its visualizer."""
    process = _start_process("meshcat.servers.zmqserver")
    urls: dict[str, str] = {}
    assert process.stdout is not None
    for line in process.stdout:
        key, _, urls[key] = line.strip().partition("=")
        if "web_url" in urls:
            break
    else:
        _end_process(process)
        raise EngineError("the server of MeshCat did not start")
    print(f"You can open the visualizer by visiting the following URL:\n{urls['web_url']}")
    visualizer = _meshcat("meshcat.visualizer")
    window = visualizer.ViewerWindow.__new__(visualizer.ViewerWindow)  # its own would start its own server
    window.server_proc, window.zmq_url, window.web_url = process, urls["zmq_url"], urls["web_url"]
    window.connect_zmq()
    return visualizer.Visualizer(window=window)


def stop(visualizer: Any) -> None:
    """End the helper process of `show` and wait until it is gone."""
    visualizer.window.zmq_socket.close(linger=0)  # a call on a dead server would wait for ever
    _end_process(visualizer.window.server_proc)


def _start_process(module: str) -> subprocess.Popen[str]:
    """Start a module of a package as a process, whose output is read from ``stdout``."""
    package = find_spec(module.partition(".")[0])
    path = [] if package is None or package.origin is None else [str(Path(package.origin).parents[1])]
    # A session of its own keeps Ctrl-C from it; nobody reads what it writes on stderr.
    process = subprocess.Popen(
        [sys.executable, "-u", "-P", "-W", "ignore", "-c", _EXIT_WITH_PARENT, module],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(path)},
        start_new_session=True,
        text=True,
    )
    atexit.register(_end_process, process)
    return process


def _end_process(process: subprocess.Popen[str]) -> None:
    process.kill()
    process.wait()
    for stream in (process.stdin, process.stdout):
        if stream is not None:
            stream.close()


def set_scene(visualizer: Any, picture: Picture) -> None:
    """Set lights and camera of a picture; nothing casts a shadow, for the message board would."""
    for command in (*_lights_and_camera(picture), _property("/Lights/Sun/<object>", "castShadow", False)):
        visualizer.window.send(command)


def draw_meshes(visualizer: Any, meshes: Sequence[SceneMesh], poses: Mapping[str, Array]) -> None:
    """Draw meshes, in place of those of the same paths, and set the poses of nodes."""
    for path, T in poses.items():
        visualizer.window.send(_transform(f"{_ROOT}/{path}", T))
    for mesh in meshes:
        for command in _mesh_commands(mesh, mesh.path):
            visualizer.window.send(command)


def draw_message(visualizer: Any, text: str, camera: Camera, legend: Sequence[LegendEntry] = ()) -> None:
    """Draw a text, and a legend below it, on a board near the eye, in place of the one before."""
    geometry = _meshcat("meshcat.geometry")
    png, aspect = text_image(text, legend)
    offset = camera.eye - camera.center
    distance = float(np.linalg.norm(offset))
    right, up, back = camera_axes(offset / distance)
    width = 0.5 * distance * np.tan(VIEW.camera.view_angle / 2) * OPTIONS.width
    middle = camera.center + 0.5 * offset + (0.94 * width / OPTIONS.width - width / aspect / 2) * up
    T = np.eye(4)
    T[:3, 0], T[:3, 1], T[:3, 2], T[:3, 3] = right, up, back, middle
    board = geometry.Box([width, width / aspect, 1e-4])
    paint = geometry.MeshBasicMaterial(map=geometry.ImageTexture(image=geometry.PngImage(png)))
    drawn = geometry.Mesh(board, paint).lower()
    visualizer.window.send(_Command("set_object", f"{_ROOT}/message", {"object": drawn}))
    visualizer.window.send(_transform(f"{_ROOT}/message", T))


def text_image(text: str, legend: Sequence[LegendEntry] = ()) -> tuple[bytes, float]:
    """A PNG of a text, broken into lines, with a legend below it, and its width over its height.

    >>> png, aspect = text_image("All is well.")
    >>> png[1:4], aspect > 10
    (b'PNG', True)
    """
    lines = textwrap.wrap(text, OPTIONS.line, max_lines=OPTIONS.max_lines, placeholder=" ...") or [""]
    font = ImageFont.load_default(OPTIONS.font_size)
    widest = max(font.getlength("n" * OPTIONS.line) * 0.95, *map(font.getlength, lines))
    width = 2 * OPTIONS.padding + int(widest)
    small = ImageFont.load_default(OPTIONS.key_size)
    longest = max((small.getlength(entry.label) for entry in legend), default=0.0)
    keys = max(1, min(OPTIONS.keys_in_row, int((width - OPTIONS.padding) // (longest + 50))))  # in a row
    rows = len(lines) + -(-len(legend) // keys)
    image = Image.new("RGB", (width, 2 * OPTIONS.padding + OPTIONS.line_height * rows), OPTIONS.paper)
    pen = ImageDraw.Draw(image)
    for k, line in enumerate(lines):
        y = OPTIONS.padding + k * OPTIONS.line_height
        pen.text((OPTIONS.padding, y), line, font=font, fill=OPTIONS.ink)
    for k, entry in enumerate(legend):
        x = OPTIONS.padding + k % keys * (width // keys)
        y = OPTIONS.padding + (len(lines) + k // keys) * OPTIONS.line_height
        pen.rectangle((x, y + 8, x + 24, y + 32), fill=f"#{entry.color:06x}")
        pen.text((x + 34, y + 4), entry.label, font=small, fill=OPTIONS.ink)
    data = io.BytesIO()
    image.save(data, "PNG")
    return data.getvalue(), image.width / image.height


def delete_node(visualizer: Any, path: str) -> None:
    """Remove a node from the scene."""
    visualizer.window.send(_Command("delete", f"{_ROOT}/{path}"))


def packed_commands(picture: Picture) -> list[bytes]:
    """The commands that draw a picture, as MeshCat's viewer reads them."""
    pack = import_module("umsgpack").packb
    return [pack(command.lower()) for command in _scene_commands(picture, play=False)]


def viewer_script() -> str:
    """MeshCat's viewer, in JavaScript."""
    server = _meshcat("meshcat.servers.zmqserver")
    return Path(server.VIEWER_ROOT, "main.min.js").read_text(encoding="utf-8")


def _meshcat(module: str) -> ModuleType:
    """Import a module of MeshCat without its deprecation warnings, which users cannot act on."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        return import_module(module)


@dataclass(frozen=True)
class _Command:
    """A message to the viewer, in the form that a MeshCat window sends.

    MeshCat's own commands cannot set ``renderOrder`` or ``castShadow`` (they lower the case of keys), nor
    make a value jump.
    """

    type: str
    path: str
    content: dict[str, Any] = field(default_factory=dict)

    def lower(self) -> dict[str, Any]:
        return {"type": self.type, "path": self.path, **self.content}


def _scene_commands(picture: Picture, play: bool = True) -> Iterator[_Command]:
    """Yield all commands in order; the animation last, for it binds to nodes that exist.

    MeshCat plays it by its own clock, or leaves that to others.
    """
    yield from _lights_and_camera(picture)
    for path, T in picture.poses.items():
        yield _transform(f"{_ROOT}/{path}", T)
    for k, body in enumerate(b for b in picture.bodies if len(b.mesh.faces)):
        yield from _mesh_commands(body, k)
    if picture.tracks:
        yield _animation(picture.tracks, play)


def _lights_and_camera(picture: Picture) -> Iterator[_Command]:
    """Light that casts shadows, and the camera."""
    for hidden in ("Background", "Grid", "Axes", "Lights/PointLightNegativeX", "Lights/PointLightPositiveX"):
        yield _property(f"/{hidden}", "visible", False)
    yield _property("/Lights/AmbientLight/<object>", "intensity", 0.62)
    yield _Command("set_object", "/Lights/Sun", {"object": _sun(picture.extent)})
    # The camera orbits the origin, so the scene is moved there.
    yield _transform(_ROOT, translation(*-picture.camera.center))
    offset = picture.camera.eye - picture.camera.center
    camera = "/Cameras/default/rotated/<object>"
    # MeshCat's camera lives in a frame whose y axis points up.
    yield _property(camera, "position", [float(offset[0]), float(offset[2]), float(-offset[1])])
    zoom = float(np.tan(_DEFAULT_VIEW_ANGLE / 2) / np.tan(VIEW.camera.view_angle / 2))
    yield _property(camera, "zoom", zoom)


def _sun(extent: float) -> dict[str, Any]:
    """A distant light whose shadows cover the whole floor."""
    position = 3.0 * extent * np.array([-0.35, -0.45, 1.0])
    camera = {"uuid": "sun-camera", "type": "OrthographicCamera", "zoom": 1, "near": 0.1, "far": 8.0 * extent}
    camera |= {"left": -extent, "right": extent, "top": extent, "bottom": -extent}
    shadow = {"bias": -0.0005, "radius": 2, "mapSize": [4096, 4096], "camera": camera}
    light = {"uuid": "sun", "type": "DirectionalLight", "color": 0xFFFFFF, "intensity": 0.45}
    return {
        "metadata": {"version": 4.5, "type": "Object"},
        "geometries": [],
        "materials": [],
        "object": {**light, "matrix": translation(*position).T.flatten().tolist(), "shadow": shadow},
    }


def _mesh_commands(body: SceneMesh, k: int | str) -> Iterator[_Command]:
    geometry_module = _meshcat("meshcat.geometry")
    mesh, colors = body.mesh, None
    if body.colors is not None:  # one a face: no vertex may be shared
        mesh, colors = triangle_meshes.split_vertices(mesh), np.repeat(body.colors, 3, axis=0)
    geometry = geometry_module.TriangularMeshGeometry(*mesh, colors)
    kind = geometry_module.MeshLambertMaterial if body.lit else geometry_module.MeshBasicMaterial
    flat = body.layer is not None
    material = kind(
        color=0xFFFFFF if colors is not None else body.color,
        opacity=body.opacity,
        transparent=flat or body.opacity < 1.0,
        vertexColors=colors is not None,
        depthWrite=body.opacity == 1.0 and not flat,
    )
    drawing = geometry_module.Mesh(geometry, material)
    # MeshCat draws random names; numbers give the same picture the same bytes.
    geometry.uuid, material.uuid, drawing.uuid = f"geometry-{k}", f"material-{k}", f"mesh-{k}"
    drawn = drawing.lower()
    # Translucent meshes are drawn after all that lies on the floor.
    drawn["object"]["renderOrder"] = 100 if body.layer is None else body.layer
    path = f"{_ROOT}/{body.path}"
    yield _Command("set_object", path, {"object": drawn})
    if flat or not body.lit or body.opacity < 1.0:
        yield _property(f"{path}/<object>", "castShadow", False)


def _animation(tracks: tuple[KeyframeTrack, ...], play: bool) -> _Command:
    by_path: dict[str, list[KeyframeTrack]] = {}
    for track in tracks:
        by_path.setdefault(track.path, []).append(track)
    animations = []
    for path, group in by_path.items():
        # Transforms belong to the node, everything else to the mesh that hangs in it.
        own = group[0].kind in ("position", "turn")
        target = f"{_ROOT}/{path}" if own else f"{_ROOT}/{path}/<object>"
        clip = {"fps": 1, "name": "default", "tracks": [_track_document(track) for track in group]}
        animations.append({"path": target, "clip": clip})
    # A live server sends nodes in the order of their creation: this one is the last.
    options = {"play": play, "repetitions": _FOREVER}
    return _Command("set_animation", "/animation", {"animations": animations, "options": options})


def _track_document(track: KeyframeTrack) -> dict[str, Any]:
    values = track.values.tolist()
    if track.kind == "faces":
        values = [{"start": 3 * start, "count": 3 * count} for start, count in values]
    keys = [{"time": t, "value": v} for t, v in zip(np.round(track.times, 5).tolist(), values, strict=True)]
    name, kind, jumps = _THREE[track.kind]
    return {"name": name, "type": kind, "keys": keys, **({"interpolation": _STEPS} if jumps else {})}


def _property(path: str, key: str, value: Any) -> _Command:
    return _Command("set_property", path, {"property": key, "value": value})


def _transform(path: str, T: Array) -> _Command:
    columns = np.asarray(T, dtype=np.float64).T.flatten().tolist()
    return _Command("set_transform", path, {"matrix": columns})
