"""Mesh files that a URDF file names: their paths and surfaces."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from regionik.worlds.arrays import Array, Index
from regionik.worlds.errors import InputError, located_error
from regionik.worlds.readers.meshes import COLLADA, Surface, read_geometries, read_mesh, read_surfaces
from regionik.worlds.readers.text import MAX_NUMBER
from regionik.worlds.urdf.bounding import convex_hull, hull_triangles, outer_hull
from regionik.worlds.urdf.elements import CollisionShape
from regionik.worlds.urdf.options import URDF

OPTIONS = URDF.bounding

_SCHEME = re.compile(r"([A-Za-z][A-Za-z0-9+.-]*):/?/?")
_PACKAGE = "package"
_TOO_LARGE = f"expected finite numbers of at most {MAX_NUMBER:g} in size"


@dataclass(frozen=True)
class MeshFiles:
    """Surfaces of mesh files below a URDF file's package, each file read once.

    The package is the nearest folder above the URDF file that holds a ``package.xml``, or the folder above
    the URDF file's own. ``package://name/rest`` is looked up in every folder above of that name, then in
    folders of that name beside the package and inside it; other names are relative to the URDF file, or to a
    folder above it. Nothing outside the named package is read, and nothing is fetched over a network.
    """

    path: Path  # the URDF file
    _surfaces: dict[Path, Array | str] = field(default_factory=dict)

    def surface(self, shape: CollisionShape) -> Array | str:
        """Return triangles (m, 3, 3) around a mesh, in the shape's frame [m], or why there are none.

        A file outside the folders that may be named is an `InputError`.
        """
        found = self._find(shape)
        if isinstance(found, str):
            return found
        if found not in self._surfaces:
            self._surfaces[found] = _read(found)
        surface = self._surfaces[found]
        if isinstance(surface, str):
            return surface
        scaled: Array = surface * np.array(shape.size)
        return scaled if np.abs(scaled).max() <= MAX_NUMBER else _TOO_LARGE

    def colored(self, shape: CollisionShape) -> list[Surface]:
        """Return the triangles of a mesh by their colours, in the shape's frame [m]."""
        found = self._find(shape)
        if isinstance(found, str):
            raise located_error(str(self.path), shape.place, found)
        if found.suffix.lower() == COLLADA:
            pieces = read_surfaces(found)
        else:
            points, faces = read_mesh(found)
            pieces = [Surface(points[faces], None)]
        return [Surface(one.triangles * np.array(shape.size), one.color) for one in pieces]

    def _find(self, shape: CollisionShape) -> Path | str:
        folder = Path(os.path.realpath(self.path)).parent
        name = os.fsdecode(shape.file.encode("utf-8"))
        scheme = _SCHEME.match(name)
        if scheme is not None and scheme[1].lower() == _PACKAGE:
            package, _, rest = name[scheme.end() :].partition("/")
            places = [(top, top / rest) for top in _packages(folder, package)]
            if not places:
                return f"there is no folder {package} beside or above the URDF file's package"
        elif scheme is None or scheme[1].lower() == "file":
            rest = name if scheme is None else "/" + name[scheme.end() :].lstrip("/")
            places = [(_package_root(folder), up / rest) for up in (folder, *folder.parents)]
        else:
            raise self._refused(shape, "expected package://name/file or a file relative to the URDF file")
        allowed = [(top, Path(os.path.realpath(file))) for top, file in places]
        inside = [file for top, file in allowed if file.is_relative_to(top)]
        if not inside:
            raise self._refused(shape, f"expected a file below {allowed[0][0]}")
        return next((file for file in inside if os.path.isfile(file)), "there is no such file")

    def _refused(self, shape: CollisionShape, text: str) -> InputError:
        return located_error(str(self.path), shape.place, f"mesh {shape.file!r}: {text}")


def _package_root(folder: Path) -> Path:
    """Return the folder below which a URDF file in ``folder`` may name files."""
    marked = (above for above in (folder, *folder.parents) if (above / "package.xml").is_file())
    return next(marked, folder.parent if folder.parent != folder.parent.parent else folder)


def _packages(folder: Path, name: str) -> list[Path]:
    """Return the folders that ``package://name`` may mean, the likeliest first."""
    if not name or name in (".", "..") or "\\" in name:
        return []
    above = [folder, *folder.parents]
    root = _package_root(folder)
    workspace = [top for top in above[: above.index(root) + 2] if top != top.parent]
    beside = [Path(os.path.realpath(top / name)) for top in workspace if (top / name).is_dir()]
    return [top for top in above if top.name == name] + beside


def _read(path: Path) -> Array | str:
    """Return the triangles of a mesh; of its hull where the file has only points, or too many triangles."""
    pieces: list[tuple[Array, Index | None]]
    try:
        pieces = read_geometries(path) if path.suffix.lower() == COLLADA else [read_mesh(path)]
    except InputError as error:
        return str(error).removeprefix(f"{path}: ")
    points = np.concatenate([points for points, _ in pieces])
    if not np.isfinite(points).all() or np.abs(points).max() > MAX_NUMBER:
        return _TOO_LARGE
    if sum(0 if faces is None else len(faces) for _, faces in pieces) > OPTIONS.max_surface:
        return _hull(points)
    return np.concatenate([_hull(some) if faces is None else some[faces] for some, faces in pieces])


def _hull(points: Array) -> Array:
    return hull_triangles(convex_hull(points) if len(points) <= OPTIONS.max_surface else outer_hull(points))
