"""Documents against models: the first thing wrong, as one line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator
from pydantic_core import ErrorDetails, PydanticCustomError

from regionik.worlds.errors import InputError
from regionik.worlds.readers.text import clip

Model = TypeVar("Model", bound=BaseModel)

LARGEST = 1e9  # any length, angle or count in a file is smaller


class Strict(BaseModel):
    """A mapping with known keys only, nothing converted, every number finite."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _keys(cls, value: Any) -> Any:
        """Say which keys there are; pydantic's own message would not."""
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


def checked(model: type[Model], document: dict[str, Any], where: str) -> Model:
    """The document as a model; the first error as an `InputError` of one line."""
    try:
        return model.model_validate(document)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
    raise wrong(where, _place(first["loc"]), _expected(first))


def bounded(value: Any, where: str, place: tuple[int | str, ...] = ()) -> None:
    """Refuse numbers so large that squares and sums of them would overflow."""
    if isinstance(value, dict):
        for key, item in value.items():
            bounded(item, where, (*place, key))
    elif isinstance(value, list):
        for k, item in enumerate(value):
            bounded(item, where, (*place, k))
    elif isinstance(value, int | float) and abs(value) > LARGEST:
        raise wrong(
            where, _place(place), f"expected a number of at most {LARGEST:g} in size, got {clip(value)}"
        )


def wrong(where: str, place: str, text: str) -> InputError:
    """``where: place: text`` on one line."""
    parts = (where, place, text)
    return InputError(": ".join(" ".join(part.split()) for part in parts if part))


@contextmanager
def at(where: str, place: str) -> Iterator[None]:
    """Say where, when a value inside is refused."""
    try:
        yield
    except InputError as error:
        raise wrong(where, place, str(error)) from None


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
