from __future__ import annotations

import os
from pathlib import Path

import pytest

from regionik.storage.files import write_atomic
from regionik.worlds.errors import InputError


def test_writes_bytes_and_text_as_they_are(tmp_path: Path) -> None:
    write_atomic(tmp_path / "a", "é\n\r\n")
    write_atomic(str(tmp_path / "b"), b"\x00\xff")
    assert (tmp_path / "a").read_bytes() == "é\n\r\n".encode()
    assert (tmp_path / "b").read_bytes() == b"\x00\xff"


def test_replaces_and_leaves_nothing_beside(tmp_path: Path) -> None:
    target = tmp_path / "plan.json"
    write_atomic(target, "old" * 1000)
    write_atomic(target, "new")
    assert target.read_text() == "new"
    assert os.listdir(tmp_path) == ["plan.json"]


def test_an_interrupted_write_keeps_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target = tmp_path / "plan.json"
    write_atomic(target, "old")

    def interrupted(fd: int) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "fsync", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_atomic(target, "new")
    assert target.read_text() == "old"
    assert os.listdir(tmp_path) == ["plan.json"]


def test_follows_links_and_writes_into_pipes(tmp_path: Path) -> None:
    (tmp_path / "far").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "far" / "file")
    write_atomic(tmp_path / "link", "x")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "far" / "file").read_text() == "x"
    write_atomic(os.devnull, "x")
    assert not Path(os.devnull).is_file()


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("none/plan.json", "expected an existing folder"),
        ("", "this is a folder"),
        ("x" * 300, "cannot be written"),
    ],
)
def test_what_cannot_be_written_is_one_line(tmp_path: Path, path: str, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        write_atomic(tmp_path / path, "x")
    assert "\n" not in str(caught.value)
