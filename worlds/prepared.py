"""What is made of an object once is kept on it, and goes when it goes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from functools import wraps
from typing import Any, Concatenate, ParamSpec, TypeVar, cast

P = ParamSpec("P")
Owner = TypeVar("Owner", bound="Prepared")
Made = TypeVar("Made")

_MADE = "_made"


class Prepared:
    """A frozen dataclass that keeps what is made of it."""

    def once(self: Owner, make: Callable[Concatenate[Owner, P], Made], *args: P.args, **kw: P.kwargs) -> Made:
        """Return what a function makes of the object and of hashable values, made once."""
        made = vars(self).setdefault(_MADE, {})
        key = (make, args, *sorted(kw.items()))
        if key not in made:
            made[key] = make(self, *args, **kw)
        found: Made = made[key]
        return found

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields alone: for a copy, the rest is made anew."""
        return {one.name: getattr(self, one.name) for one in fields(cast(Any, self))}


def made_once(make: Callable[Concatenate[Owner, P], Made]) -> Callable[Concatenate[Owner, P], Made]:
    """Have a function keep on its first argument what it makes of it and of hashable values."""

    @wraps(make)
    def made(owner: Owner, /, *args: P.args, **kwargs: P.kwargs) -> Made:
        return owner.once(make, *args, **kwargs)

    return made
