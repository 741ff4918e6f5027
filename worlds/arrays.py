"""Arrays in frozen dataclasses: checked once, copied, read-only; and how such values print."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import MISSING, fields, is_dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from regionik.worlds.errors import InputError

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Mask = NDArray[np.bool_]

_YZX, _ZXY = [1, 2, 0], [2, 0, 1]
MAX_COORDINATE = 1e5  # of coordinates: numbers there are 1e-11 m apart, plans are proven to 1e-9 m [m]
_MAX_SHOWN = 6  # numbers of an array, or items of a tuple, that fit on a line


def cross(a: Array, b: Array) -> Array:
    """Cross products of rows (..., 3), without what `numpy.cross` takes to look at their shapes."""
    product: Array = a[..., _YZX] * b[..., _ZXY] - a[..., _ZXY] * b[..., _YZX]
    return product


def frozen(values: ArrayLike, shape: Sequence[int | None], what: str) -> Array:
    """Return values as a read-only float array of its own, or raise an `InputError` that names it ``what``.

    Its numbers are finite; ``shape`` is the length expected of each axis, None for any.
    """
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{what}: expected numbers, got {values!r}") from None
    if array.ndim != len(shape) or any(w not in (None, n) for w, n in zip(shape, array.shape, strict=True)):
        text = " x ".join("n" if w is None else str(w) for w in shape)
        raise InputError(f"{what}: expected {text} numbers, got shape {array.shape}")
    if not np.isfinite(array).all():
        raise InputError(f"{what}: every number must be finite, got {array.tolist()}")
    array.flags.writeable = False
    return array


def check_near_origin(coordinates: ArrayLike, what: str) -> None:
    """Refuse coordinates of places in the world that are too far from its origin to compute with."""
    far = float(np.abs(coordinates).max(initial=0.0))
    if far > MAX_COORDINATE:
        text = f"expected coordinates of at most {MAX_COORDINATE:g} m, so that what is proven holds"
        raise InputError(f"{what}: {text}, got {far:.9g} m: put the origin of the world nearer")


def frozen_faces(faces: ArrayLike, vertices: int, what: str) -> Index:
    """Return triangles (m, 3) of so many vertices as a read-only array of its own."""
    array = np.array(faces, dtype=np.int64)
    if array.ndim != 2 or array.shape[1] != 3 or (array < 0).any() or (array >= vertices).any():
        raise InputError(f"{what}: expected rows of three of its {vertices} vertices")
    array.flags.writeable = False
    return array


def freeze(value: object, owner: str, **shapes: Sequence[int | None]) -> None:
    """Freeze fields of a frozen dataclass in place, as `frozen` does; for its ``__post_init__``.

    ``owner`` is the name of the value in error messages.
    """
    for key, shape in shapes.items():
        object.__setattr__(value, key, frozen(getattr(value, key), shape, f"{owner}: {key}"))


def unit_vector(values: ArrayLike, what: str) -> Array:
    """Return a direction (3,) as a read-only unit vector; one that is a unit vector stays as it is."""
    vector = frozen(values, (3,), what)
    norm = float(np.linalg.norm(vector))
    if norm < 1e-9:
        raise InputError(f"{what} must not be zero")
    return vector if abs(norm - 1.0) <= 1e-12 else frozen(vector / norm, (3,), what)


def transform_points(T: Array, points: Array) -> Array:
    """Return points (n, 3), or one (3,), moved by a transform (4, 4)."""
    moved: Array = points @ T[:3, :3].T + T[:3, 3]
    return moved


def scalar_or_tuple(values: Any) -> Any:
    """Return a sequence of numbers as a tuple, so that it can be hashed; a number, or None, as it is."""
    return tuple(map(float, values)) if isinstance(values, Sequence | np.ndarray) else values


def one_line(value: Any) -> str:
    """Return a short form of a dataclass on one line; for its ``__repr__``.

    Its name comes first, fields at their defaults are left out, and of long arrays only the shape is shown.
    """
    shown = []
    for field in fields(value):
        item = getattr(value, field.name)
        default = field.default if field.default_factory is MISSING else field.default_factory()
        if field.repr and (default is MISSING or type(item) is not type(default) or _differ(item, default)):
            shown.append(repr(item) if field.name == "name" else f"{field.name}={_brief(item)}")
    return f"{type(value).__name__}({', '.join(shown)})"


def _differ(item: Any, default: Any) -> bool:
    return bool(np.any(item != default)) if np.shape(item) == np.shape(default) else True


def _brief(item: Any) -> str:
    if isinstance(item, np.ndarray):
        numbers = np.round(item, 6).tolist()
        return f"<{' x '.join(map(str, item.shape))} array>" if item.size > _MAX_SHOWN else str(numbers)
    if isinstance(item, tuple) and (len(item) > _MAX_SHOWN or any(map(is_dataclass, item))):
        return f"<{len(item)}>"
    if is_dataclass(item) and hasattr(item, "name"):
        return repr(item.name)
    return f"<{item.geom_type}>" if hasattr(item, "geom_type") else repr(item)
