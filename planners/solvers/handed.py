"""Arrays of Python handed to a compiled call as they are, without the boxes that numba makes of them.

A compiled call gets the address of an object and looks itself whether it finds a plain row of floats there.
It trusts nothing but the layout of numpy's arrays, which numpy keeps for all who are compiled against it, and
`layout_is_known` looks whether that is what it is. The caller keeps the objects, and Python's lock: what is
compiled runs under it from the first look to the last, so that nobody resizes an array meanwhile.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable
from functools import cache
from typing import Any

import numba
import numpy as np
from numba import types

from regionik.planners.solvers.passes import fast
from regionik.worlds.arrays import Array

# Where an array holds its class, its numbers, how many axes, their lengths, its kind of number and its flags.
_CLASS, _DATA, _AXES, _LENGTHS, _KIND, _FLAGS = 8, 16, 24, 32, 56, 64
_PLAIN = 0x0001 | 0x0100  # in one piece, and where the processor wants it
_WORD = 8


_numba: Any = numba  # whose types say less than it takes
carray = _numba.carray
_pointer = _numba.types.CPointer


class Handed(types.Type):
    """An object of Python, of which what is compiled knows the address alone."""

    bitwidth = 8 * _WORD

    def __init__(self) -> None:
        super().__init__(name="Handed")


HANDED = Handed()


def _unboxed(kind: Any, thing: Any, c: Any) -> Any:
    return _numba.extending.NativeValue(c.builder.ptrtoint(thing, c.context.get_value_type(kind)))


_numba.extending.register_model(Handed)(_numba.extending.models.IntegerModel)
_numba.extending.unbox(Handed)(_unboxed)


def _address(typing: Any, thing: Any) -> Any:
    """Where a handed object lies."""
    return types.int64(thing), lambda context, builder, signature, given: given[0]


def _word_at(typing: Any, place: Any) -> Any:
    """Eight bytes at an address."""
    return _loaded(types.int64)


def _half_at(typing: Any, place: Any) -> Any:
    """Four bytes at an address."""
    return _loaded(types.int32)


def _loaded(kind: Any) -> Any:
    def code(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        pointer = context.get_value_type(_pointer(kind))
        return builder.load(builder.inttoptr(given[0], pointer))

    return kind(types.int64), code


def _floats_at(typing: Any, place: Any) -> Any:
    """A pointer to floats from an address."""

    def code(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        return builder.inttoptr(given[0], context.get_value_type(signature.return_type))

    return _pointer(types.float64)(types.int64), code


address: Callable[[Any], int] = _numba.extending.intrinsic(_address)
_word: Callable[[int], int] = _numba.extending.intrinsic(_word_at)
_half: Callable[[int], int] = _numba.extending.intrinsic(_half_at)
_floats: Callable[[int], Any] = _numba.extending.intrinsic(_floats_at)


@fast
def alike(thing: int, row: int) -> bool:
    """Whether at an address there is an array in one piece, of the kind and length of the one at ``row``."""
    if _word(thing + _CLASS) != _word(row + _CLASS) or _word(thing + _KIND) != _word(row + _KIND):
        return False
    plain: bool = _half(thing + _AXES) == 1 and (_half(thing + _FLAGS) & _PLAIN) == _PLAIN
    return plain and _word(_word(thing + _LENGTHS)) == _word(_word(row + _LENGTHS))


@fast
def row_at(thing: int) -> Array:
    """The array at an address, one of floats in one piece."""
    row: Array = carray(_floats(_word(thing + _DATA)), (_word(_word(thing + _LENGTHS)),))
    return row


@cache
def layout_is_known() -> bool:
    """Whether arrays lie in memory as this module takes them to."""
    row = np.zeros(3)
    if ctypes.sizeof(ctypes.c_void_p) != _WORD or row.__sizeof__() < _FLAGS + _WORD:
        return False
    seen = ctypes.string_at(id(row), _FLAGS + _WORD)
    words, halves = np.frombuffer(seen, np.int64), np.frombuffer(seen, np.int32)
    found = [words[at // _WORD] for at in (_CLASS, _DATA, _KIND)] + [
        halves[at // 4] for at in (_AXES, _FLAGS)
    ]
    if found != [id(np.ndarray), row.ctypes.data, id(row.dtype), 1, row.flags.num]:
        return False
    return ctypes.string_at(int(words[_LENGTHS // _WORD]), _WORD) == len(row).to_bytes(_WORD, sys.byteorder)
