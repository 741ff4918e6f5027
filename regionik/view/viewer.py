"""Pictures of worlds and plans in MeshCat, live in the browser or as one offline file.

MeshCat takes a second to import, so that only drawing imports it.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from regionik.storage.files import write_whole
from regionik.values import Plan
from regionik.view import triangle_meshes
from regionik.view.animation import Track
from regionik.view.camera import VIEW_ANGLE
from regionik.view.child_process import end, started
from regionik.view.html_page import page
from regionik.view.labels import lettered
from regionik.view.picture import Body, Camera, Picture
from regionik.view.plan_picture import picture_of_plan
from regionik.view.world_picture import picture_of_world
from regionik.worlds.arrays import Array
from regionik.worlds.chain import translation
from regionik.worlds.errors import EngineError
from regionik.worlds.scene import World

_ROOT = "/meshcat"
BOARD = 1.6  # width of the words, of half the height of what is seen
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


def show(what: Plan | World | Picture, open_browser: bool = True) -> Any:
    """Show a plan or a world live in the browser.

    A helper process serves the picture. It ends with this Python process; `stop` ends it before.

    Parameters
    ----------
    what : Plan, World or Picture
    open_browser : bool
        Whether to open a browser; the address is printed in any case.

    Returns
    -------
    meshcat.Visualizer
        For more drawing; its ``url()`` is the address.
    """
    visualizer = blank()
    for command in _commands(_picture(what)):
        visualizer.window.send(command)
    if open_browser:
        visualizer.open()
    return visualizer


def blank() -> Any:
    """A helper process that serves an empty scene; the address is printed."""
    process = started("meshcat.servers.zmqserver")
    told: dict[str, str] = {}
    assert process.stdout is not None
    for line in process.stdout:
        key, _, told[key] = line.strip().partition("=")
        if "web_url" in told:
            break
    else:
        end(process)
        raise EngineError("the server of MeshCat did not start")
    print(f"You can open the visualizer by visiting the following URL:\n{told['web_url']}")
    visualizer = _meshcat("meshcat.visualizer")
    window = visualizer.ViewerWindow.__new__(visualizer.ViewerWindow)  # its own would start its own server
    window.server_proc, window.zmq_url, window.web_url = process, told["zmq_url"], told["web_url"]
    window.connect_zmq()
    return visualizer.Visualizer(window=window)


def stage(visualizer: Any, picture: Picture) -> None:
    """Set light and camera of a picture; nothing throws a shadow, for a board of words would."""
    for command in (*_stage(picture), _property("/Lights/Sun/<object>", "castShadow", False)):
        visualizer.window.send(command)


def draw(visualizer: Any, bodies: Sequence[Body], poses: Mapping[str, Array]) -> None:
    """Draw bodies, in the place of those of the same path, and put nodes where they belong."""
    for path, T in poses.items():
        visualizer.window.send(_transform(f"{_ROOT}/{path}", T))
    for body in bodies:
        for command in _body(body, body.path):
            visualizer.window.send(command)


def write(visualizer: Any, text: str, camera: Camera) -> None:
    """Write words on a board near the eye, in the place of those written before."""
    geometry = _meshcat("meshcat.geometry")
    png, aspect = lettered(text)
    away = camera.eye - camera.center
    back = away / np.linalg.norm(away)
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    up = np.cross(back, right)
    width = 0.5 * float(np.linalg.norm(away)) * np.tan(VIEW_ANGLE / 2) * BOARD
    middle = camera.center + 0.5 * away + (0.94 * width / BOARD - width / aspect / 2) * up
    T = np.eye(4)
    T[:3, 0], T[:3, 1], T[:3, 2], T[:3, 3] = right, up, back, middle
    board = geometry.Box([width, width / aspect, 1e-4])
    paint = geometry.MeshBasicMaterial(map=geometry.ImageTexture(image=geometry.PngImage(png)))
    drawn = geometry.Mesh(board, paint).lower()
    visualizer.window.send(_Command("set_object", f"{_ROOT}/words", {"object": drawn}))
    visualizer.window.send(_transform(f"{_ROOT}/words", T))


def erase(visualizer: Any, path: str) -> None:
    """Take a body away."""
    visualizer.window.send(_Command("delete", f"{_ROOT}/{path}"))


def stop(visualizer: Any) -> None:
    """End the helper process of `show` and wait until it is gone."""
    visualizer.window.zmq_socket.close(linger=0)  # a call on a dead server would wait for ever
    end(visualizer.window.server_proc)


def to_html(what: Plan | World | Picture, path: str | os.PathLike[str]) -> None:
    """Write one HTML file that shows a plan, animated, or a world, with no server and no network.

    The same plan gives the same bytes.

    Raises
    ------
    InputError
        When the file cannot be written.
    """
    write_whole(path, page_of(what))


def page_of(what: Plan | World | Picture) -> str:
    """The text of that file."""
    picture = _picture(what)
    pack = import_module("umsgpack").packb
    commands = [pack(command.lower()) for command in _commands(picture)]
    return page(picture, commands, _viewer_script())


def _picture(what: Plan | World | Picture) -> Picture:
    if isinstance(what, Picture):
        return what
    return picture_of_plan(what) if isinstance(what, Plan) else picture_of_world(what)


def _meshcat(module: str) -> ModuleType:
    """Import a module of MeshCat, which itself imports what is deprecated: nothing a user could mend."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        return import_module(module)


def _viewer_script() -> str:
    server = _meshcat("meshcat.servers.zmqserver")
    return Path(server.VIEWER_ROOT, "main.min.js").read_text(encoding="utf-8")


@dataclass(frozen=True)
class _Command:
    """A message to the viewer, in the form that a MeshCat window sends.

    MeshCat's own commands cannot set ``renderOrder`` or ``castShadow`` (they lower the case of keys), nor
    say that a value jumps.
    """

    type: str
    path: str
    content: dict[str, Any] = field(default_factory=dict)

    def lower(self) -> dict[str, Any]:
        return {"type": self.type, "path": self.path, **self.content}


def _commands(picture: Picture) -> Iterator[_Command]:
    """All that must be sent, in order; the animation last, for it binds to what is there."""
    yield from _stage(picture)
    for path, T in picture.poses.items():
        yield _transform(f"{_ROOT}/{path}", T)
    for k, body in enumerate(b for b in picture.bodies if len(b.mesh.faces)):
        yield from _body(body, k)
    if picture.tracks:
        yield _animation(picture.tracks)


def _stage(picture: Picture) -> Iterator[_Command]:
    """Light with shadows, and the camera."""
    for hidden in ("Background", "Grid", "Axes", "Lights/PointLightNegativeX", "Lights/PointLightPositiveX"):
        yield _property(f"/{hidden}", "visible", False)
    yield _property("/Lights/AmbientLight/<object>", "intensity", 0.62)
    yield _Command("set_object", "/Lights/Sun", {"object": _sun(picture.extent)})
    # The camera circles about the origin, so that the scene moves there instead.
    yield _transform(_ROOT, translation(*-picture.camera.center))
    offset = picture.camera.eye - picture.camera.center
    camera = "/Cameras/default/rotated/<object>"
    # MeshCat's camera lives in a frame whose y axis points up.
    yield _property(camera, "position", [float(offset[0]), float(offset[2]), float(-offset[1])])
    yield _property(camera, "zoom", float(np.tan(_DEFAULT_VIEW_ANGLE / 2) / np.tan(VIEW_ANGLE / 2)))


def _sun(extent: float) -> dict[str, Any]:
    """A light from far away whose shadows reach over the whole floor."""
    away = 3.0 * extent * np.array([-0.35, -0.45, 1.0])
    box = {
        "left": -extent,
        "right": extent,
        "top": extent,
        "bottom": -extent,
        "near": 0.1,
        "far": 8.0 * extent,
    }
    shadow_camera = {"uuid": "sun-camera", "type": "OrthographicCamera", "zoom": 1, **box}
    shadow = {"bias": -0.0005, "radius": 2, "mapSize": [4096, 4096], "camera": shadow_camera}
    light = {"uuid": "sun", "type": "DirectionalLight", "color": 0xFFFFFF, "intensity": 0.45}
    return {
        "metadata": {"version": 4.5, "type": "Object"},
        "geometries": [],
        "materials": [],
        "object": {**light, "matrix": translation(*away).T.flatten().tolist(), "shadow": shadow},
    }


def _body(body: Body, k: int | str) -> Iterator[_Command]:
    geometry_module = _meshcat("meshcat.geometry")
    mesh, colors = body.mesh, None
    if body.colors is not None:  # one a face: no vertex may be shared
        mesh, colors = triangle_meshes.unshared(mesh), np.repeat(body.colors, 3, axis=0)
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
    # MeshCat names things at random; numbers make the same picture the same bytes.
    geometry.uuid, material.uuid, drawing.uuid = f"geometry-{k}", f"material-{k}", f"mesh-{k}"
    drawn = drawing.lower()
    # What can be seen through comes after all that lies on the floor.
    drawn["object"]["renderOrder"] = 100 if body.layer is None else body.layer
    path = f"{_ROOT}/{body.path}"
    yield _Command("set_object", path, {"object": drawn})
    if flat or not body.lit or body.opacity < 1.0:
        yield _property(f"{path}/<object>", "castShadow", False)


def _animation(tracks: tuple[Track, ...]) -> _Command:
    by_path: dict[str, list[Track]] = {}
    for track in tracks:
        by_path.setdefault(track.path, []).append(track)
    animations = []
    for path, group in by_path.items():
        # Transforms belong to the node, everything else to the mesh that hangs in it.
        own = group[0].kind in ("position", "turn")
        target = f"{_ROOT}/{path}" if own else f"{_ROOT}/{path}/<object>"
        clip = {"fps": 1, "name": "default", "tracks": [_lowered(track) for track in group]}
        animations.append({"path": target, "clip": clip})
    # A live server sends nodes in the order of their making: this one was made last.
    options = {"play": True, "repetitions": _FOREVER}
    return _Command("set_animation", "/animation", {"animations": animations, "options": options})


def _lowered(track: Track) -> dict[str, Any]:
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
