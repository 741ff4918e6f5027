"""Films of plans: the page of a plan, shot frame by frame in a browser."""

from __future__ import annotations

import io
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from PIL import Image

from regionik.planners.progress import track
from regionik.storage.files import write_atomic
from regionik.view.browser import BrowserPage, opened
from regionik.worlds.errors import EngineError, InputError

FILMS = (".gif", ".mp4")
RATE, LONGEST = 10, 15.0  # frames a second, length of a film [s]
SIZE = (960, 600)  # [pixels]


def film(page: str, path: str | os.PathLike[str]) -> None:
    """Write a film of a plan's page (`regionik.view.page.html_page`), an animated GIF or an MP4.

    Motions longer than `LONGEST` are shown faster. Both need Chromium, an MP4 needs ffmpeg too. The file is
    written whole or not at all.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in FILMS:
        raise InputError(f"{path}: expected a file name ending in {', '.join(FILMS)}")
    if suffix == ".mp4" and shutil.which("ffmpeg") is None:
        raise InputError(f"{path}: an MP4 needs ffmpeg, which is not installed; a .gif does not")
    with tempfile.TemporaryDirectory(prefix="regionik") as folder:
        shown = Path(folder, "plan.html")
        shown.write_text(page, "utf-8")
        with opened(shown, *SIZE) as browser:
            frames = list(_frames(browser))
        write_atomic(path, _gif(frames) if suffix == ".gif" else _mp4(frames, Path(folder, "film.mp4")))


def _frames(browser: BrowserPage) -> Iterator[bytes]:
    """Shoot the page at even times, each frame a PNG."""
    browser.evaluate("film()")
    end = float(browser.evaluate("end"))
    count = max(2, round(RATE * min(end, LONGEST)))
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
        data, "GIF", save_all=True, append_images=drawn[1:], duration=1000 // RATE, loop=0, optimize=False
    )
    return data.getvalue()


def _mp4(frames: list[bytes], scratch: Path) -> bytes:
    command = ["ffmpeg", "-y", "-f", "image2pipe", "-framerate", str(RATE), "-c:v", "png", "-i", "-"]
    command += ["-pix_fmt", "yuv420p", "-movflags", "+faststart", str(scratch)]
    done = subprocess.run(command, input=b"".join(frames), capture_output=True, check=False)
    if done.returncode:
        words = done.stderr.decode("utf-8", "replace").strip().splitlines()
        raise EngineError(f"ffmpeg: {words[-1] if words else 'it failed'}")
    return scratch.read_bytes()
