"""Files that are written whole or not at all."""

from __future__ import annotations

import os
import secrets
from pathlib import Path

from regionik.worlds.errors import InputError


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


def _replace(target: Path, data: bytes) -> None:
    """Write beside ``target`` and move over it; only a rename within one folder is atomic."""
    beside = target.with_name(f".{secrets.token_hex(8)}.part")
    try:
        with open(beside, "xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(beside, target)
    finally:
        beside.unlink(missing_ok=True)
