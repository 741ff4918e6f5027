"""Arrays as values: checked once, copied, read-only."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from regionik.worlds.errors import InputError

Array = NDArray[np.float64]


def frozen(values: ArrayLike, shape: Sequence[int | None], what: str) -> Array:
    """Copy ``values`` into a read-only float array of the given shape.

    Parameters
    ----------
    values : array_like
    shape : sequence of int or None
        Expected length of each axis; None takes any.
    what : str
        How the error message calls the array.

    Raises
    ------
    InputError
        When the shape differs or a value is not finite.
    """
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{what}: expected numbers, got {values!r}") from None
    wanted = tuple(shape)
    fits = array.shape == wanted or (
        array.ndim == len(wanted)
        and all(w is None or w == n for w, n in zip(wanted, array.shape, strict=True))
    )
    if not fits:
        text = " x ".join("n" if w is None else str(w) for w in wanted)
        raise InputError(f"{what}: expected {text} numbers, got shape {array.shape}")
    if not np.isfinite(array).all():
        raise InputError(f"{what}: every number must be finite, got {array.tolist()}")
    array.flags.writeable = False
    return array
