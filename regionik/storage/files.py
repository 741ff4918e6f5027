"""Files that are written whole or not at all."""

from __future__ import annotations

import fcntl
import os
import re
import secrets
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

from regionik.worlds.errors import InputError

_STEM = 60  # letters of a file's name in that of what is written beside it: names have 255 bytes at most


def write_whole(path: str | os.PathLike[str], content: str | bytes) -> None:
    """Write a file so that nobody ever sees half of it.

    Parameters
    ----------
    path : path
        Where to write; an existing file is replaced, a link is followed.
    content : str or bytes
        Text is written as UTF-8 with the line ends it has.

    Raises
    ------
    InputError
        When the folder is missing, the path names a folder, or writing is not allowed.
    """
    target = Path(os.path.realpath(path))
    data = content.encode("utf-8") if isinstance(content, str) else content
    try:
        if target.is_dir():
            raise InputError(f"{path}: expected a file to write, this is a folder")
        if not target.parent.is_dir():
            raise InputError(f"{path}: expected an existing folder, {target.parent} is not there")
        if target.exists() and not target.is_file():
            target.write_bytes(data)  # a pipe or a device cannot be replaced by a file
        else:
            _replace(target, data)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from None


def leftover(entry: str, name: str | None = None) -> bool:
    """Whether an entry of a folder was written beside a file (``name``, or any) and never moved to it."""
    stem = r".{1,60}" if name is None else re.escape(name[:_STEM])
    return re.fullmatch(rf"\.{stem}\.[0-9a-f]{{8}}\.part", entry, re.DOTALL) is not None


def _replace(target: Path, data: bytes) -> None:
    """Write beside ``target`` and move over it; only a rename within one folder is atomic."""
    _sweep(target)
    file = _beside(target)
    try:
        with file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
            os.replace(file.name, target)
    finally:
        Path(file.name).unlink(missing_ok=True)


def _beside(target: Path) -> BinaryIO:
    """A new file in the folder of ``target``, locked while it is open."""
    while True:
        file = open(target.with_name(f".{target.name[:_STEM]}.{secrets.token_hex(4)}.part"), "xb")  # noqa: SIM115
        with suppress(OSError):  # where a file system knows no locks nobody sweeps either
            fcntl.flock(file, fcntl.LOCK_EX)
        if os.path.exists(file.name):  # else it was taken for a leftover before it was locked
            return file
        file.close()


def _sweep(target: Path) -> None:
    """Remove what those left who were killed while they wrote ``target``: nobody holds its lock any more."""
    for entry in os.listdir(target.parent):
        if leftover(entry, target.name):
            with suppress(OSError), open(target.with_name(entry), "rb") as file:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                os.unlink(file.name)
