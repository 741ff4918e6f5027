"""Results that take long to make, kept on disk by all that they are made from.

A result goes by the digest of what it was made from, of this package's source and of the engines' versions,
so that none outlives a change of any. Files hold numbers and names and no code, and each is moved into place
whole. One that is damaged, of another user or of another result is passed over and replaced; where no folder
can be written nothing is kept. Of too many, those that were not used for longest go.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
from base64 import b64decode, b64encode
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import fields, is_dataclass
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np

FOLDER_VARIABLE = "REGIONIK_CACHE_DIR"  # names the folder; set to nothing, nothing is kept
MAX_FILES, MAX_BYTES = 500, 100_000_000  # of the folder

_KEPT, _UNFINISHED = ".kept.json", ".kept.part"
_ENGINES = "numpy", "scipy", "shapely", "trimesh"
_NUMBERS = ("<f8", "<i8")  # of arrays

Made = TypeVar("Made")


def cached(name: str, given: object, make: Callable[[], Made], classes: Sequence[type] = ()) -> Made:
    """Return what a pure function makes of values, from disk where it is there.

    Parameters
    ----------
    name : str
        Of the function.
    given : object
        All that the result depends on: arrays, texts, numbers, None, and tuples, mappings, sets of texts and
        dataclasses of these.
    make : callable
        Makes the result, of the same kinds but for mappings; what it raises is raised.
    classes : sequence of type
        Dataclasses that may be in the result.
    """
    folder, versions = cache_folder(), _versions()
    if folder is None or versions is None:
        return make()
    key = sha256(json.dumps([name, versions, _packed(given)]).encode()).hexdigest()
    path = folder / f"{key}{_KEPT}"
    with suppress(Exception):  # whatever else may be in a file of that name, it is made anew
        return cast(Made, _read(path, key, {one.__name__: one for one in classes}))
    made = make()
    with suppress(OSError):
        _write(path, key, _packed(made))
    return made


def cache_folder() -> Path | None:
    """Return the folder of results, which need not be there yet; None where nothing is to be kept."""
    given = os.environ.get(FOLDER_VARIABLE)
    if given is not None:
        return Path(given) if given else None
    base = os.environ.get("XDG_CACHE_HOME", "")
    if not os.path.isabs(base):
        base = os.path.expanduser("~/Library/Caches" if sys.platform == "darwin" else "~/.cache")
    return Path(base, "regionik") if os.path.isabs(base) else None


def _versions() -> list[str] | None:
    """Return the digest of this package's source, and the engines' versions; None where one is not known."""
    source, here = sha256(), Path(__file__).parent
    files = sorted(here.rglob("*.py"))
    with suppress(OSError, PackageNotFoundError):
        for path in files:
            source.update(path.relative_to(here).as_posix().encode() + path.read_bytes())
        return [source.hexdigest(), *map(version, _ENGINES)] if files else None
    return None


def _read(path: Path, key: str, classes: Mapping[str, type]) -> Any:
    with open(path, "rb") as file:
        if os.fstat(file.fileno()).st_uid != os.geteuid():
            raise PermissionError(f"{path}: of another user")
        digest, content = file.readline().strip(), file.read()
    if sha256(content).hexdigest().encode() != digest:
        raise ValueError(f"{path}: damaged")
    of, packed = json.loads(content)
    if of != key:
        raise ValueError(f"{path}: of another result")
    with suppress(OSError):
        os.utime(path)
    return _unpacked(packed, classes)


def _write(path: Path, key: str, packed: Any) -> None:
    """Write a file whole, and remove the oldest ones beyond the bounds of the folder."""
    content = json.dumps([key, packed]).encode()
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(suffix=_UNFINISHED, dir=path.parent)
    try:
        with open(handle, "wb") as file:
            file.write(sha256(content).hexdigest().encode() + b"\n" + content)
        os.replace(name, path)
    finally:
        Path(name).unlink(missing_ok=True)
    _trim(path.parent)


def _trim(folder: Path) -> None:
    found = []
    for path in (*folder.glob(f"*{_KEPT}"), *folder.glob(f"*{_UNFINISHED}")):
        with suppress(FileNotFoundError):  # another process has removed it
            stat = path.stat()
            found.append((stat.st_mtime, stat.st_size, path))
    total = 0
    for count, (_, size, path) in enumerate(sorted(found, reverse=True), 1):
        total += size
        if count > MAX_FILES or total > MAX_BYTES:
            path.unlink(missing_ok=True)


def _packed(value: Any) -> Any:
    """Return a value as JSON has it, floats and arrays to the bit."""
    if isinstance(value, np.ndarray):
        array = np.ascontiguousarray(value)
        data = b64encode(array.tobytes()).decode()
        return {"array": data, "dtype": array.dtype.str, "shape": array.shape}
    if is_dataclass(value) and not isinstance(value, type):
        return {type(value).__name__: [_packed(getattr(value, one.name)) for one in fields(value)]}
    if isinstance(value, Mapping):
        return {"items": [[key, _packed(item)] for key, item in value.items()]}
    if isinstance(value, frozenset):
        return {"set": sorted(map(_packed, value), key=json.dumps)}
    if isinstance(value, list | tuple):
        return [_packed(item) for item in value]
    return value.item() if isinstance(value, np.generic) else value


def _unpacked(packed: Any, classes: Mapping[str, type]) -> Any:
    if isinstance(packed, list):
        return tuple(_unpacked(item, classes) for item in packed)
    if not isinstance(packed, dict):
        return packed
    if "array" in packed:
        dtype = _NUMBERS[_NUMBERS.index(packed["dtype"])]
        return np.frombuffer(b64decode(packed["array"]), dtype).reshape(packed["shape"]).copy()
    if "set" in packed:
        return frozenset(_unpacked(packed["set"], classes))
    ((name, values),) = packed.items()
    return classes[name](*_unpacked(values, classes))
