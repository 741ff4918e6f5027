"""A watched world file: what is sent when it changes, and what is said."""

from __future__ import annotations

import io
import os
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml
from PIL import Image

from regionik.cli.app import run
from regionik.view import live
from regionik.view.picture import LegendEntry
from regionik.view.viewer import text_image
from regionik.view.world_picture import GHOST_WORDS
from regionik.worlds.documents.world_file import load_world, world_to_document
from regionik.worlds.errors import InputError
from tests.test_whatif import crowded


class Recorder:
    """Stands for a viewer: keeps what it is sent."""

    def __init__(self) -> None:
        self.sent: list[dict[str, Any]] = []
        self.window = SimpleNamespace(send=lambda command: self.sent.append(command.lower()))

    def drawn(self) -> list[str]:
        paths = [one["path"] for one in self.sent if one["type"] == "set_object"]
        return [path.removeprefix("/meshcat/") for path in paths]


def save(path: Path, document: dict[str, Any]) -> None:
    """As editors save: another file put in its place."""
    fresh = path.with_suffix(".tmp")
    fresh.write_text(yaml.safe_dump(document))
    os.replace(fresh, path)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    save(tmp_path / "hall.yaml", world_to_document(crowded()))
    return tmp_path / "hall.yaml"


def test_only_what_changes_is_sent_again(path: Path) -> None:
    viewer, document = Recorder(), world_to_document(load_world(path))
    told: list[str] = []
    drawn: list[list[str]] = []

    def changes() -> Iterator[None]:
        assert {"floor/all", "obstacles/0", "areas/strong", "robot/base", "message"} <= set(viewer.drawn())
        viewer.sent.clear()
        document["obstacles"][3]["box"]["center"][:2] = [5.6, 0.4]
        save(path, document)
        yield
        drawn.append(viewer.drawn())
        viewer.sent.clear()
        path.write_text("robot: [")
        yield
        drawn.append(viewer.drawn())
        viewer.sent.clear()
        document["obstacles"].pop()
        save(path, document)
        yield
        assert "/meshcat/obstacles/14" in [one["path"] for one in viewer.sent if one["type"] == "delete"]

    live.watch(path, viewer, told.append, changes())
    assert set(drawn[0]) <= {"obstacles/3", "floor/rejected/3", "areas/strong", "areas/pale", "message"}
    assert {"obstacles/3", "message"} <= set(drawn[0])
    assert drawn[1] == ["message"]
    assert len(told) == 4
    assert str(path) in told[2]
    assert "\n" not in told[2]
    assert told[3].startswith(told[0])


def test_a_file_that_is_no_world_at_first_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "x.yaml").write_text("robot: x\n")
    with pytest.raises(InputError, match=r"x\.yaml"):
        live.watch(tmp_path / "x.yaml", Recorder(), print, iter(()))
    document = world_to_document(crowded())
    del document["task"]
    save(tmp_path / "y.yaml", document)
    with pytest.raises(InputError, match="task"):
        live.watch(tmp_path / "y.yaml", Recorder(), print, iter(()))


def test_a_save_is_seen_in_place_and_by_replacement(path: Path) -> None:
    seen = live.file_changes(path)
    document = path.read_text()

    def later(act: Any) -> None:
        thread = threading.Timer(0.2, act)
        thread.start()
        next(seen)
        thread.join()

    later(lambda: path.write_text(document + "\n"))
    later(lambda: save(path, yaml.safe_load(document)))

    def away() -> None:
        path.unlink()
        time.sleep(0.2)
        path.write_text(document)

    later(away)


def test_a_save_before_the_first_picture_is_drawn_is_seen(path: Path) -> None:
    """The first areas take seconds; what is saved meanwhile was not looked at until the next save."""
    seen = live.file_changes(path)
    path.write_text(path.read_text() + "\n")
    next(seen)


def test_the_command_needs_a_file(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["show", "pillar", "--live"]) == 2
    assert "--live watches a world file" in capsys.readouterr().err


def test_no_word_of_the_legend_is_cut_off() -> None:
    legend = [LegendEntry(0, label, ()) for label in ("free floor", GHOST_WORDS, "set-points")]
    board = np.asarray(Image.open(io.BytesIO(text_image("All is well.", legend)[0])))
    assert (board[:, -8:] == board[0, 0]).all()
