"""Names that exports give to the frames of a world and its robot."""

from __future__ import annotations

from dataclasses import dataclass

from regionik.worlds.errors import InputError, located


@dataclass(frozen=True)
class FrameNames:
    """Names in messages and parameters: of the frames of the world, the base and the tool.

    >>> FrameNames(base_link="cart/base_link")
    FrameNames(map='map', base_link='cart/base_link', tool0='tool0')
    """

    map: str = "map"
    base_link: str = "base_link"
    tool0: str = "tool0"

    def __post_init__(self) -> None:
        for key, name in vars(self).items():
            with located("", key):
                check_frame_name(name)
        if len(set(vars(self).values())) < len(vars(self)):
            raise InputError(f"{', '.join(vars(self))}: expected a name of its own for each")


def check_frame_name(name: str) -> None:
    """Refuse what tf2 takes for no name of a frame, by an `InputError`."""
    if not name.strip() or name != name.strip() or name.startswith("/"):
        raise InputError(f"expected the name of a frame, as map or odom, without a slash; got {name!r}")
