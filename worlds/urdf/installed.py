"""URDF files that come with installed packages, by the robot's name. Nothing is imported or downloaded."""

from __future__ import annotations

import os
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, files
from pathlib import Path

from regionik.worlds.bundled import robot_names
from regionik.worlds.errors import InputError, suggestion
from regionik.worlds.readers.text import is_file_name, join_names
from regionik.worlds.urdf.elements import SUFFIXES

DISTRIBUTION = "example-robot-data"  # on PyPI: some forty robots with their meshes
_ENDINGS = ("_robot", "_description")  # of file names, that the name of a robot may lack


def urdf_file(name_or_path: str | Path) -> Path:
    """Return the path of a URDF file; what is not one is taken for a name, as by `installed_urdf`."""
    if is_file_name(name_or_path, (*SUFFIXES, ".xacro")):
        return Path(name_or_path)
    try:
        return installed_urdf(str(name_or_path))
    except InputError as error:
        raise InputError(f"{error}; or expected a path that ends in {', '.join(SUFFIXES)}") from None


def installed_urdf(name: str) -> Path:
    """Return the URDF file of a robot in an installed package.

    It is looked for in the package example-robot-data, then in the ``share`` folders of a ROS 2 environment
    (``AMENT_PREFIX_PATH``), and has the robot's name, or that and ``_robot`` or ``_description``.

    Raises
    ------
    InputError
        For a name that no bundled robot and no file has, with the valid ones.
    """
    found = dict[str, Path]()
    for path in (*_distributed(), *_shared()):
        found.setdefault(path.stem, path)
    for stem in (name, *(name + ending for ending in _ENDINGS)):
        if stem in found:
            return found[stem]
    valid = [*robot_names(), *sorted(found)]
    more = "" if found else f"; the package {DISTRIBUTION}, where it is installed, has more"
    near = suggestion(name, valid) or ","
    raise InputError(f"unknown robot {name!r}{near} valid names: {join_names(valid)}{more}")


def _distributed() -> Iterator[Path]:
    """Yield the URDF files of the distribution; none where it is not installed."""
    try:
        listed = files(DISTRIBUTION) or []
    except PackageNotFoundError:
        return
    yield from sorted(Path(str(one.locate())) for one in listed if one.suffix == SUFFIXES[0])


def _shared() -> Iterator[Path]:
    """Yield the URDF files that packages of a ROS 2 environment share."""
    for prefix in filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)):
        yield from sorted(Path(prefix, "share").glob(f"*/*/*{SUFFIXES[0]}"))
