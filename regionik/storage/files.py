"""Files written atomically, whole or not at all, long ones in parts that a later run resumes; JSON values.

The parts of a long file lie in a folder beside it, each written atomically, with a manifest of what they were
made from. Once all of them exist, they are joined, the file is moved into place, and the folder is removed.
"""

from __future__ import annotations

import csv
import dataclasses
import fcntl
import io
import json
import math
import os
import re
import secrets
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from regionik.worlds.errors import InputError

_STEM = 60  # letters of a file's name kept in that of its temporary file: names have 255 bytes at most
_UNFINISHED, _MANIFEST, _JOINED = ".part", "manifest.json", "whole"
_PART = re.compile(r"(\d{8})-(\d+)of(\d+)")


def write_atomic(path: str | os.PathLike[str], content: str | bytes) -> None:
    """Write a file so that no reader ever sees half of it.

    An existing file is replaced, a link is followed. Text is written as UTF-8 with the line ends it has.
    Whatever keeps it from being written is an `InputError`.
    """
    target = Path(os.path.realpath(path))
    data = content.encode("utf-8") if isinstance(content, str) else content
    with _os_errors(path):
        if target.is_dir():
            raise InputError(f"{path}: expected a file to write, this is a folder")
        if not target.parent.is_dir():
            raise InputError(f"{path}: expected an existing folder, {target.parent} is not there")
        if target.exists() and not target.is_file():
            target.write_bytes(data)  # a pipe or a device cannot be replaced by a file
        else:
            _replace(target, data)


def write_folder(path: str | os.PathLike[str], files: Mapping[str, str | bytes]) -> None:
    """Write a new folder, whole or not at all: contents by their names in it, which may name folders.

    Something that is there already is an `InputError`, as is whatever else keeps it from being written.
    """
    target = Path(os.path.realpath(path))
    if target.exists():
        raise InputError(f"{path}: expected the name of a new folder, this is there already")
    if not target.parent.is_dir():
        raise InputError(f"{path}: expected an existing folder, {target.parent} is not there")
    with _os_errors(path):
        made = Path(
            tempfile.mkdtemp(prefix=f".{target.name[:_STEM]}.", suffix=_UNFINISHED, dir=target.parent)
        )
        try:
            for name, content in files.items():
                (made / name).parent.mkdir(exist_ok=True)
                (made / name).write_bytes(content.encode("utf-8") if isinstance(content, str) else content)
            made.chmod(0o755)
            made.rename(target)
        finally:
            shutil.rmtree(made, ignore_errors=True)


@contextmanager
def _os_errors(path: str | os.PathLike[str]) -> Iterator[None]:
    """Turn an `OSError` into an `InputError` of one line."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from None


def _replace(target: Path, data: bytes) -> None:
    """Write beside ``target`` and move over it; only a rename within one folder is atomic."""
    beside = target.with_name(f".{target.name[:_STEM]}.{secrets.token_hex(4)}{_UNFINISHED}")
    try:
        with open(beside, "xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(beside, target)
    finally:
        beside.unlink(missing_ok=True)


@dataclass(frozen=True)
class PartialFile:
    """A file that is being written in parts."""

    file: Path  # the parts are joined to it
    folder: Path  # it holds the parts written so far

    def counts(self) -> dict[int, tuple[int, int]]:
        """Return the counts of each part written so far by its number: rows that say yes, and all rows."""
        matches = filter(None, map(_PART.fullmatch, os.listdir(self.folder)))
        return {int(match[1]): (int(match[2]), int(match[3])) for match in matches}

    def write_part(self, number: int, data: bytes, yes: int, total: int) -> None:
        """Write one part atomically."""
        write_atomic(self.folder / f"{number:08d}-{yes}of{total}", data)

    def join(self, head: bytes) -> None:
        """Write the file, a head and all parts, and remove the folder."""
        joined, parts = self.folder / _JOINED, sorted(self.folder.iterdir())
        with _os_errors(self.file):
            with open(joined, "wb") as file:
                file.write(head)
                for part in filter(lambda path: _PART.fullmatch(path.name), parts):
                    with open(part, "rb") as data:
                        shutil.copyfileobj(data, file)
                file.flush()
                os.fsync(file.fileno())
            os.replace(joined, self.file)
            for path in self.folder.iterdir():
                if path.name != _MANIFEST:
                    path.unlink()
            (self.folder / _MANIFEST).unlink()  # the last: a folder without it holds nothing to resume
            self.folder.rmdir()


@contextmanager
def open_partial(output: Path, manifest: Mapping[str, object]) -> Iterator[PartialFile]:
    """Begin or resume a file in parts, kept in a folder that is called as it with ``.parts`` after it.

    ``manifest`` has all that the bytes of the file depend on, as JSON values, each by its name for messages.
    Parts made from something else, and another run that holds them, are an `InputError`.
    """
    file = Path(os.path.realpath(output))
    folder = file.with_name(f"{file.name}.parts")
    with _os_errors(output):
        folder.mkdir(exist_ok=True)
        lock = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(f"{folder}: another run is writing there") from None
        _check_manifest(folder, manifest)
        yield PartialFile(file, folder)
    finally:
        os.close(lock)


def _check_manifest(folder: Path, manifest: Mapping[str, object]) -> None:
    """Write the manifest of a new folder, or compare it with that of an existing one."""
    path = folder / _MANIFEST
    if not path.exists():
        if any(entry.suffix != _UNFINISHED for entry in folder.iterdir()):
            raise InputError(f"{folder}: holds other things than parts of answers; move it away")
        write_atomic(path, json.dumps(manifest, indent=2) + "\n")
        return
    try:
        written = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError):
        written = None
    if not isinstance(written, dict):
        raise InputError(f"{path}: is not the manifest of parts; remove the folder {folder} to start again")
    other = [name for name in manifest if written.get(name) != manifest[name]]
    if other:
        raise InputError(
            f"{folder}: holds parts of a run with another {' and another '.join(other)}; "
            "finish that one first, or remove the folder to start again"
        )


def json_values(value: Any) -> Any:
    """Any result as dicts, lists, strings, numbers, booleans and None.

    Dataclasses become dicts by their fields, geometries GeoJSON; NaN and infinities become None.
    """
    if isinstance(value, Mapping):
        return {str(key): json_values(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [json_values(item) for item in value]
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {one.name: json_values(getattr(value, one.name)) for one in dataclasses.fields(value)}
    if hasattr(value, "__geo_interface__"):
        return json_values(value.__geo_interface__)
    if hasattr(value, "tolist"):  # an array or a number of numpy
        return json_values(value.tolist())
    return value


def csv_text(rows: Iterable[Iterable[object]]) -> str:
    """Rows as CSV, None an empty cell."""
    text = io.StringIO(newline="")
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def json_text(value: Any) -> str:
    """A result as indented JSON, as it is written to files."""
    return json.dumps(json_values(value), indent=2, allow_nan=False) + "\n"
