"""A long file written in parts, so that a run that was killed goes on where it ended.

Parts lie in a folder beside the file, each written whole, with a manifest of what they were made from. When
all are there they are joined, the file is moved to its place at once, and the folder goes.
"""

from __future__ import annotations

import fcntl
import json
import os
import re
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from regionik.storage.files import leftover, write_whole
from regionik.worlds.errors import InputError

_MANIFEST, _WHOLE = "manifest.json", "whole"
_PART = re.compile(r"(\d{8})-(\d+)of(\d+)")


@dataclass(frozen=True)
class Parts:
    """The parts of a file that are there.

    Attributes
    ----------
    file : Path
        What they will be joined to.
    folder : Path
    """

    file: Path
    folder: Path

    def found(self) -> dict[int, tuple[int, int]]:
        """Number of each part that is there, with its count of yes and of all."""
        return {k: counts for k, counts, _ in self._parts()}

    def put(self, k: int, data: bytes, yes: int, total: int) -> None:
        """Write part ``k``, whole or not at all."""
        write_whole(self.folder / f"{k:08d}-{yes}of{total}", data)

    def join(self, head: bytes) -> None:
        """Write the file from a head and all parts, and remove these."""
        whole = self.folder / _WHOLE
        parts = self._parts()
        with _writing(self.file):
            with open(whole, "wb") as file:
                file.write(head)
                for _, _, part in parts:
                    with open(part, "rb") as data:
                        shutil.copyfileobj(data, file)
                file.flush()
                os.fsync(file.fileno())
            os.replace(whole, self.file)
            for path in self.folder.iterdir():
                if path.name != _MANIFEST:
                    path.unlink()
            (self.folder / _MANIFEST).unlink()  # the last: without it a folder holds nothing
            self.folder.rmdir()

    def _parts(self) -> list[tuple[int, tuple[int, int], Path]]:
        matched = [(_PART.fullmatch(path.name), path) for path in sorted(self.folder.iterdir())]
        return [
            (int(match[1]), (int(match[2]), int(match[3])), path)
            for match, path in matched
            if match is not None
        ]


@contextmanager
def parts_of(output: Path, manifest: Mapping[str, object]) -> Iterator[Parts]:
    """Parts of a file, those of an earlier run among them; nobody else works on them meanwhile.

    Parameters
    ----------
    output : Path
        Where the file will be; the folder is called as it, with ``.parts`` after it.
    manifest : mapping
        All that the bytes of the file depend on, as JSON knows it, each by its name for messages.

    Raises
    ------
    InputError
        When parts of other things are there, another run is at work on them, or writing is not allowed.
    """
    file = Path(os.path.realpath(output))
    folder = file.with_name(f"{file.name}.parts")
    with _writing(output):
        folder.mkdir(exist_ok=True)
        lock = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(f"{folder}: another run is writing there") from None
        _agree(folder, manifest)
        yield Parts(file, folder)
    finally:
        os.close(lock)


def _agree(folder: Path, manifest: Mapping[str, object]) -> None:
    """Begin a folder, or make sure that it was begun for the same."""
    path = folder / _MANIFEST
    if not path.exists():
        if any(not leftover(entry.name) for entry in folder.iterdir()):
            raise InputError(f"{folder}: holds other things than parts of answers; move it away")
        write_whole(path, json.dumps(manifest, indent=2) + "\n")
        return
    try:
        there = json.loads(path.read_bytes())
    except (OSError, ValueError):
        there = None
    if not isinstance(there, dict):
        raise InputError(f"{path}: is not the manifest of parts; remove the folder {folder} to begin anew")
    other = [name for name in manifest if there.get(name) != manifest[name]]
    if other:
        raise InputError(
            f"{folder}: holds parts of a run with another {' and another '.join(other)}; "
            "finish that one first, or remove the folder to begin anew"
        )


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from None
