"""Pages of plans and worlds that need no server and no network, a small server for them, and notebooks."""

from __future__ import annotations

import base64
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from html import escape
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from string import Template
from threading import Thread
from typing import Any

from regionik.reachability.field import Field
from regionik.regions import Area
from regionik.scene import WorldSource
from regionik.storage.files import write_atomic
from regionik.timing.trajectory import is_timed
from regionik.values import Plan, Stops
from regionik.view.figures import OnFloor, floor_image
from regionik.view.options import VIEW
from regionik.view.picture import Picture
from regionik.view.timeline import timeline_document
from regionik.view.viewer import packed_commands, picture_of, viewer_script
from regionik.worlds.errors import Explanation
from regionik.worlds.scene import World

_PAGE, _SCRIPT = (Path(__file__).with_name(name) for name in ("page.html", "page.js"))


def to_html(what: Plan | WorldSource | Picture, path: str | os.PathLike[str]) -> None:
    """Write a plan, animated, or a world as one HTML file that needs no server and no network.

    The page has a time bar, curves of joints, speeds and clearances, the figures at each set-point, layers
    to switch off and a view from above. The same plan gives the same bytes.

    Parameters
    ----------
    what : Plan, Picture, World, or the name or file of one
    path : path
        The page; written whole or not at all.

    Raises
    ------
    InputError
        When the file cannot be written.
    """
    write_atomic(path, html_page(what))


def html_page(what: Plan | WorldSource | Picture) -> str:
    """Return the text of the file that `to_html` writes."""
    picture = picture_of(what)
    commands = (base64.b64encode(command).decode("ascii") for command in packed_commands(picture))
    return Template(_PAGE.read_text("utf-8")).substitute(
        title=escape(picture.title),
        facts=escape(" · ".join(picture.facts)),
        viewer=viewer_script(),
        commands=",\n".join(f'"{command}"' for command in commands),
        # Nothing in a name may end the script that it stands in.
        data=json.dumps(_page_document(picture), separators=(",", ":")).replace("<", "\\u003c"),
        script=_SCRIPT.read_text("utf-8"),
    )


def _page_document(picture: Picture) -> dict[str, Any]:
    """Return what the script of a page knows of its picture, as JSON."""
    layers = [
        {"color": f"#{color:06x}", "label": label, "paths": list(paths)}
        for color, label, paths in picture.legend
    ]
    names = {
        body.path: [body.name or body.label, list(body.numbers)]
        for body in picture.bodies
        if len(body.mesh.faces) and (body.name or body.label)
    }
    motion = None if picture.timeline is None else timeline_document(picture.timeline)
    half, setpoints = picture.camera.half.tolist(), list(picture.setpoints)
    return {"layers": layers, "names": names, "half": half, "motion": motion, "setpoints": setpoints}


@contextmanager
def served(page: str) -> Iterator[str]:
    """Serve the text of a page on this machine while the block runs; the value is its address."""
    data = page.encode()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header("Content-Type", "text/html; charset=utf-8")
            self.send_header("Content-Length", str(len(data)))
            self.end_headers()
            self.wfile.write(data)

        def log_message(self, format: str, *values: Any) -> None:
            """Keep the terminal clean."""

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/"
    finally:
        server.shutdown()
        server.server_close()


def as_html(value: OnFloor | Explanation) -> str:
    """Return a few lines as HTML, and above them a picture of the floor, but for an explanation."""
    lines = "\n".join(facts(value)[: VIEW.max_html_facts])
    image = "" if isinstance(value, Explanation) else floor_image(value)
    return f"<div>{image[image.find('<svg') :]}<pre style='white-space: pre-wrap'>{escape(lines)}</pre></div>"


def facts(value: OnFloor | Explanation) -> list[str]:
    """Return lines on a value, the most telling first."""
    if isinstance(value, Explanation):
        repairs = [f"- {repair.text}" for repair in value.repairs]
        return [value.reason, *(f"because of {cause.kind}: {cause.name}" for cause in value.causes), *repairs]
    if isinstance(value, Stops):
        return [repr(value), *map(repr, value)]
    if isinstance(value, Field):
        return [repr(value)]
    if isinstance(value, Plan):
        margins: dict[str, Any] = value.stats.get("margins", {})
        timed = f"{value.motion.time[-1]:.1f} s" if is_timed(value.motion) else "not timed"
        spare = ", ".join(f"{name} {least:.3g}" for name, least in margins.items())
        return [repr(value), repr(value.world), repr(value.motion), timed, spare]
    if isinstance(value, World):
        return [value.about or value.name, *map(repr, (value, value.robot, value.floor, value.rules))]
    if isinstance(value, Area):
        return [repr(value), repr(value.world), *(f"rejected: {part.name}" for part in value.causes)]
    reasons = dict.fromkeys(reason for reason in value.reason if reason)
    return [repr(value), *reasons]
