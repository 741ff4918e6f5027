"""Words of the grammar that the parts of a world file share."""

from __future__ import annotations

from typing import Annotated, Any, TypeVar

from pydantic import Discriminator, FailFast, Field

_Item = TypeVar("_Item")
Many = Annotated[list[_Item], FailFast()]  # no list of all that is wrong with a million of them

OneLine = Annotated[str, Field(min_length=1, max_length=200, pattern=r"^[^\r\n\x00-\x1f]+$")]
File = Annotated[str, Field(min_length=1, pattern=r"^[^\r\n\x00]+$")]
Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Vec2 = Annotated[list[float], Field(min_length=2, max_length=2)]
Vec3 = Annotated[list[float], Field(min_length=3, max_length=3)]
Vec4 = Annotated[list[float], Field(min_length=4, max_length=4)]
Size3 = Annotated[list[Positive], Field(min_length=3, max_length=3)]
Matrix3 = Annotated[list[Vec3], Field(min_length=3, max_length=3)]
Matrix4 = Annotated[list[Vec4], Field(min_length=4, max_length=4)]
Ring = Annotated[Many[Vec2], Field(min_length=3)]
Range = Annotated[list[float], Field(min_length=2, max_length=2)]
Count = Annotated[int, Field(ge=2, le=1_000_000)]


def one_of(*kinds: str) -> Discriminator:
    """Tell mappings apart by the one key that names their kind."""

    def tag(value: Any) -> str | None:
        found = [kind for kind in kinds if isinstance(value, dict) and kind in value]
        return f"<{found[0]}>" if len(found) == 1 else None

    return Discriminator(
        tag,
        custom_error_type="kind",
        custom_error_message=f"expected exactly one of {', '.join(kinds)}",
    )
