"""Models of documents: fields they share, strict mappings, and the first error as one line."""

from __future__ import annotations

from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, Discriminator, FailFast, Field, ValidationError, model_validator
from pydantic_core import ErrorDetails, PydanticCustomError

from regionik.worlds.errors import located_error
from regionik.worlds.readers.text import clip

Model = TypeVar("Model", bound=BaseModel)
_Item = TypeVar("_Item")
Many = Annotated[list[_Item], FailFast()]  # of a million wrong ones only the first is reported

NAME_LENGTH = 200
OneLine = Annotated[str, Field(min_length=1, max_length=NAME_LENGTH, pattern=r"^[^\r\n\x00-\x1f]+$")]
FileName = Annotated[str, Field(min_length=1, pattern=r"^[^\r\n\x00]+$")]
Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Vec2 = Annotated[list[float], Field(min_length=2, max_length=2)]
Vec3 = Annotated[list[float], Field(min_length=3, max_length=3)]
Vec4 = Annotated[list[float], Field(min_length=4, max_length=4)]
Size3 = Annotated[list[Positive], Field(min_length=3, max_length=3)]
Matrix3 = Annotated[list[Vec3], Field(min_length=3, max_length=3)]
Matrix4 = Annotated[list[Vec4], Field(min_length=4, max_length=4)]


class Strict(BaseModel):
    """A mapping with known keys only, nothing converted, every number finite."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _keys(cls, value: Any) -> Any:
        """Name the valid keys, which pydantic's own message does not."""
        if not isinstance(value, dict):
            return value
        fields = {field.alias or name: field for name, field in cls.model_fields.items()}
        unknown = [key for key in value if key not in fields]
        if unknown and cls.model_config.get("extra") == "forbid":
            raise PydanticCustomError(
                "keys",
                "unknown key {key}, valid keys: {valid}",
                {"key": clip(unknown[0]), "valid": ", ".join(fields)},
            )
        for key, field in fields.items():
            if field.is_required() and key not in value:
                what = f", expected {field.description}" if field.description else ""
                raise PydanticCustomError("keys", "missing key {key}{what}", {"key": clip(key), "what": what})
        return value


def one_of(*kinds: str) -> Discriminator:
    """Return a discriminator of mappings by the one key that names their kind."""

    def tag(value: Any) -> str | None:
        found = [kind for kind in kinds if isinstance(value, dict) and kind in value]
        return f"<{found[0]}>" if len(found) == 1 else None

    return Discriminator(
        tag, custom_error_type="kind", custom_error_message=f"expected exactly one of {', '.join(kinds)}"
    )


def validated(model: type[Model], document: dict[str, Any], where: str) -> Model:
    """Return a document as a model; raise the first error as an `InputError` of one line."""
    try:
        return model.model_validate(document)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
    raise located_error(where, _place(first["loc"]), _expected(first))


def _place(loc: tuple[int | str, ...]) -> str:
    place = ""
    for step in loc:
        if isinstance(step, int):
            place += f"[{step}]"
        elif not step.startswith("<"):  # names of union members stand in angle brackets
            place += f".{step}" if place else step
    return place


_PHRASES = {
    "float_type": "expected a number, got {got}",
    "int_type": "expected a whole number, got {got}",
    "int_from_float": "expected a whole number, got {got}",
    "finite_number": "expected a finite number, got {got}",
    "string_type": "expected text, got {got}",
    "list_type": "expected a list, got {got}",
    "model_type": "expected a mapping of keys to values, got {got}",
    "dict_type": "expected a mapping of keys to values, got {got}",
    "bool_type": "expected true or false, got {got}",
    "too_short": "expected at least {min_length} values, got {actual_length}",
    "too_long": "expected at most {max_length} values, got {actual_length}",
    "string_too_short": "expected text that is not empty",
    "string_too_long": "expected at most {max_length} characters",
    "string_pattern_mismatch": "expected text on one line, got {got}",
    "greater_than": "must be above {gt:g}, got {got}",
    "greater_than_equal": "must be at least {ge:g}, got {got}",
    "less_than_equal": "must be at most {le:g}, got {got}",
    "literal_error": "expected {expected}, got {got}",
}


def _expected(error: ErrorDetails) -> str:
    phrase = _PHRASES.get(error["type"])
    if phrase is None:
        return error["msg"]
    context = error.get("ctx", {})
    if context.get("min_length", 0) > 1 and error["type"] == "too_short":
        phrase = "expected {min_length} values or more, got {actual_length}"
    return phrase.format(got=clip(error["input"]), **context)
