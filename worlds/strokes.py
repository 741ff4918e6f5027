"""Strokes of a path: what the tool works in one go, and the travel between.

Neighbouring set-points of one number from 1 on are one stroke: between them the tool works and stays down.
0 is travel: the tool goes along, does not work, and may be lifted.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from regionik.worlds.arrays import Index, Mask
from regionik.worlds.errors import InputError

Strokes = Sequence[int | None]  # of set-points in order; None throughout where a task tells none


def numbered_strokes(works: Mask) -> Index:
    """Return the stroke of each of n points, of a path that is worked on some of its n - 1 segments.

    >>> numbered_strokes(np.array([True, True, False, False, True])).tolist()
    [1, 1, 1, 0, 2, 2]
    """
    before, after = np.append(False, works), np.append(works, False)
    return np.where(before | after, np.cumsum(after & ~before), 0)


def within_strokes(strokes: Strokes) -> Mask:
    """Return which of n set-points go on with the stroke of the one before, (n,).

    >>> within_strokes([1, 1, 0, 0, 2, 2, 3]).tolist()
    [False, True, False, False, False, True, False]
    """
    return np.array([k > 0 and bool(one) and one == strokes[k - 1] for k, one in enumerate(strokes)], bool)


def worked_ways(strokes: Strokes) -> Mask:
    """Return to which of n set-points the tool works its way from the one before: to all, if none is told."""
    return np.arange(len(strokes)) > 0 if None in strokes else within_strokes(strokes)


def stroke_span(within: Mask, k: int) -> tuple[int, int]:
    """Return the first set-point of the stroke that set-point k is of, and the one after its last.

    >>> stroke_span(within_strokes([0, 7, 7, 7, 0]), 2)
    (1, 4)
    """
    first = k - int(np.argmin(within[k::-1]))
    after = np.flatnonzero(~within[k + 1 :])
    return first, k + 1 + int(after[0]) if len(after) else len(within)


def split_strokes(strokes: Strokes, kept: Sequence[int]) -> Iterator[int | None]:
    """Yield the strokes of some set-points, in ascending order: what follows a gap is a stroke of its own.

    >>> list(split_strokes([1, 1, 1, 1, 2, 2], [0, 1, 3, 4, 5]))
    [1, 1, 3, 2, 2]
    """
    within, new = within_strokes(strokes), max((one or 0 for one in strokes), default=0)
    last, number, seen = -1, None, set[int | None]()
    for k in kept:
        if not within[k] or strokes[k] not in seen:
            number = strokes[k]
        elif last != k - 1:
            number = new = new + 1
        last = k
        seen.add(strokes[k])
        yield number


def check_strokes(strokes: Strokes, order: str) -> None:
    """Refuse strokes of which some are not told, or that are not in one piece, by an `InputError`."""
    wrong = [one for one in strokes if one is not None and (type(one) is not int or one < 0)]
    if wrong:
        raise InputError(f"task: stroke: expected whole numbers of at least 0, got {wrong[0]!r}")
    if None in strokes and any(one is not None for one in strokes):
        raise InputError(f"task: set-point {strokes.index(None) + 1}: stroke: expected one, as others have")
    within, seen = within_strokes(strokes), set[int | None]()
    if order == "any" and within.any():
        number = strokes[int(np.argmax(within))]
        raise InputError(f"rules: order: any would take stroke {number} apart, expected given")
    for k in np.flatnonzero(~within).tolist():
        if strokes[k] and strokes[k] in seen:
            text = f"expected neighbours of stroke {strokes[k]} alone, others were between"
            raise InputError(f"task: set-point {k + 1}: stroke: {text}")
        seen.add(strokes[k])
