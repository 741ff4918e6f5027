"""Films of plans: the page of a plan, shot frame by frame in a headless Chromium.

Chromium is driven by the DevTools protocol over two pipes.
"""

from __future__ import annotations

import base64
import io
import json
import os
import select
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from regionik.planners.progress import track
from regionik.storage.files import write_atomic
from regionik.view.options import VIEW
from regionik.worlds.errors import EngineError, InputError

OPTIONS = VIEW.animation

PROGRAMS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
_FLAGS = (
    "--headless", "--no-sandbox", "--remote-debugging-pipe", "--use-angle=swiftshader", "--no-first-run",
    "--enable-unsafe-swiftshader", "--disable-gpu-sandbox", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--hide-scrollbars",
)  # fmt: skip
# Chromium reads from descriptor 3 and writes to 4, whatever numbers our ends have.
_AS_3_AND_4 = """
import fcntl, os, sys
ends = [fcntl.fcntl(int(number), fcntl.F_DUPFD, 10) for number in sys.argv[1:3]]
for end, number in zip(ends, (3, 4)):
    os.dup2(end, number)
os.execv(sys.argv[3], sys.argv[3:])
"""


def chromium() -> str | None:
    """Path of an installed Chromium or Chrome; None where there is none."""
    return next(filter(None, map(shutil.which, PROGRAMS)), None)


@contextmanager
def opened(page: Path, width: int = 1280, height: int = 800) -> Iterator[BrowserPage]:
    """Open a file in a browser that ends with the block.

    Without Chromium that is an `InputError`, without an answer of it an `EngineError`.
    """
    program = chromium()
    if program is None:
        raise InputError(f"this needs Chromium: expected one of {', '.join(PROGRAMS)} to be installed")
    their_input, to_browser = os.pipe()
    from_browser, their_output = os.pipe()
    with tempfile.TemporaryDirectory(prefix="regionik", ignore_cleanup_errors=True) as profile:
        flags = (*_FLAGS, f"--user-data-dir={profile}", f"--window-size={width},{height}", "about:blank")
        process = subprocess.Popen(
            [sys.executable, "-c", _AS_3_AND_4, str(their_input), str(their_output), program, *flags],
            pass_fds=(their_input, their_output),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C is ours to handle
        )
        os.close(their_input)
        os.close(their_output)
        try:
            found = BrowserPage(to_browser, from_browser)
            found.open(page, width, height)
            yield found
        finally:
            process.kill()
            process.wait()
            os.close(to_browser)
            os.close(from_browser)


class BrowserPage:
    """One page of a browser."""

    def __init__(self, to_browser: int, from_browser: int) -> None:
        self.complaints: list[str] = []  # errors that scripts of the page did not catch
        self._to, self._from = to_browser, from_browser
        self._unread = b""
        self._sent = 0
        self._session: dict[str, str] = {}

    def open(self, page: Path, width: int, height: int) -> None:
        """Show a file and wait until it is loaded."""
        target = self.send("Target.createTarget", url="about:blank")["targetId"]
        attached = self.send("Target.attachToTarget", targetId=target, flatten=True)
        self._session = {"sessionId": attached["sessionId"]}
        self.send("Runtime.enable")
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.send("Emulation.setDeviceMetricsOverride", **size)
        self.send("Page.navigate", url=page.resolve().as_uri())
        end = time.monotonic() + OPTIONS.browser_timeout
        while self.evaluate("document.readyState + location.protocol") != "completefile:":
            if time.monotonic() > end:
                raise EngineError(f"Chromium did not load {page} within {OPTIONS.browser_timeout:g} s")
            time.sleep(0.05)

    def send(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Call a method of the DevTools protocol and return its result."""
        self._sent += 1
        message = {"id": self._sent, "method": method, "params": parameters, **self._session}
        data = json.dumps(message).encode() + b"\0"
        while data:
            data = data[os.write(self._to, data) :]
        while True:
            answer = self._read()
            if answer.get("method") == "Runtime.exceptionThrown":
                self.complaints.append(_complaint(answer["params"]["exceptionDetails"]))
            if answer.get("id") == self._sent:
                if "error" in answer:
                    raise EngineError(f"Chromium: {method}: {answer['error'].get('message')}")
                result: dict[str, Any] = answer["result"]
                return result

    def _read(self) -> dict[str, Any]:
        while b"\0" not in self._unread:
            ready, _, _ = select.select([self._from], [], [], OPTIONS.browser_timeout)
            data = os.read(self._from, 1 << 16) if ready else b""
            if not data:
                raise EngineError("Chromium does not answer" if not ready else "Chromium ended")
            self._unread += data
        line, _, self._unread = self._unread.partition(b"\0")
        message: dict[str, Any] = json.loads(line)
        return message

    def evaluate(self, expression: str) -> Any:
        """Return the value of a JavaScript expression."""
        found = self.send("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in found:
            raise EngineError(f"Chromium: {_complaint(found['exceptionDetails'])}")
        return found["result"].get("value")

    def screenshot(self) -> bytes:
        """Return what the page shows, as PNG."""
        return base64.b64decode(self.send("Page.captureScreenshot", format="png")["data"])


def _complaint(details: dict[str, Any]) -> str:
    return str(details.get("exception", {}).get("description") or details.get("text"))


FILMS = (".gif", ".mp4")


def film(page: str, path: str | os.PathLike[str]) -> None:
    """Write a film of a plan's page (`regionik.view.page.html_page`), an animated GIF or an MP4.

    Motions longer than 15 s are shown faster. Both need Chromium, an MP4 needs ffmpeg too. The file
    is written whole or not at all.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in FILMS:
        raise InputError(f"{path}: expected a file name ending in {', '.join(FILMS)}")
    if suffix == ".mp4" and shutil.which("ffmpeg") is None:
        raise InputError(f"{path}: an MP4 needs ffmpeg, which is not installed; a .gif does not")
    with tempfile.TemporaryDirectory(prefix="regionik") as folder:
        shown = Path(folder, "plan.html")
        shown.write_text(page, "utf-8")
        with opened(shown, *OPTIONS.film_size) as browser:
            frames = list(_frames(browser))
        write_atomic(path, _gif(frames) if suffix == ".gif" else _mp4(frames, Path(folder, "film.mp4")))


def _frames(browser: BrowserPage) -> Iterator[bytes]:
    """Shoot the page at even times, each frame a PNG."""
    if browser.evaluate("document.body.classList.contains('undrawn')"):
        raise EngineError("Chromium has no WebGL here, which a film is drawn with")
    browser.evaluate("film()")
    end = float(browser.evaluate("end"))
    count = max(2, round(OPTIONS.film_rate * min(end, OPTIONS.max_film_duration)))
    for moment in track("film", np.linspace(0.0, end, count).tolist()):
        browser.evaluate(
            f"seek({moment}); new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
        )
        yield browser.screenshot()


def _gif(frames: list[bytes]) -> bytes:
    images = [Image.open(io.BytesIO(frame)).convert("RGB") for frame in frames]
    palette = images[len(images) // 2].quantize(256)  # one for all: colours do not flicker
    drawn = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    data = io.BytesIO()
    drawn[0].save(
        data,
        "GIF",
        save_all=True,
        append_images=drawn[1:],
        duration=1000 // OPTIONS.film_rate,
        loop=0,
        optimize=False,
    )
    return data.getvalue()


def _mp4(frames: list[bytes], scratch: Path) -> bytes:
    command = [
        "ffmpeg",
        "-y",
        "-f",
        "image2pipe",
        "-framerate",
        str(OPTIONS.film_rate),
        "-c:v",
        "png",
        "-i",
        "-",
    ]
    command += ["-pix_fmt", "yuv420p", "-movflags", "+faststart", str(scratch)]
    done = subprocess.run(command, input=b"".join(frames), capture_output=True, check=False)
    if done.returncode:
        words = done.stderr.decode("utf-8", "replace").strip().splitlines()
        raise EngineError(f"ffmpeg: {words[-1] if words else 'it failed'}")
    return scratch.read_bytes()
