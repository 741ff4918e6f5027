"""Text, YAML and JSON files, and the models of their contents.

YAML is read by the core schema of YAML 1.2 (``1e-3`` is a number and ``no`` is a word), without aliases,
tags or duplicate keys.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, Discriminator, FailFast, Field, ValidationError, model_validator
from pydantic_core import ErrorDetails, PydanticCustomError

from regionik.worlds.errors import InputError, located_error

MAX_BYTES = 256 * 2**20  # of a file, which is read into memory as a whole
MAX_DEPTH = 40  # of nested lists and mappings, which are read by recursion
SUFFIXES = (".yaml", ".yml", ".json")
MAX_NUMBER = 1e9  # any length, angle or count in a file is smaller: squares and sums must not overflow

_Base: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class _Loader(_Base):  # type: ignore[misc]
    """Safe loader with the scalars of YAML 1.2 only."""

    yaml_implicit_resolvers: dict[str, Any] = {}  # noqa: RUF012

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen: set[str] = set()
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise yaml.MarkedYAMLError(problem="a key must be plain text", problem_mark=key.start_mark)
            if key.value in seen:
                raise yaml.MarkedYAMLError(
                    problem=f"key {key.value!r} is given twice", problem_mark=key.start_mark
                )
            seen.add(key.value)
        mapping: dict[Any, Any] = super().construct_mapping(node, deep=deep)
        return mapping


for _tag, _pattern, _first in (
    ("null", r"~|null|", ["~", "n", ""]),
    ("bool", r"true|false", ["t", "f"]),
    ("int", r"[-+]?(?:0|[1-9][0-9]*)", list("-+0123456789")),
    ("float", r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?", list("-+.0123456789")),
    ("float", r"[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)", list("-+.")),
):
    _Loader.add_implicit_resolver(f"tag:yaml.org,2002:{_tag}", re.compile(rf"^(?:{_pattern})$"), _first)


def name_as_text(name: str) -> str:
    """Return a file's name as one line of text; what the locale does not know of it is read as UTF-8."""
    text = name.encode("utf-8", "surrogateescape").decode("utf-8", "replace")
    return re.sub(r"[\x00-\x1f]", " ", text)


def file_in(folder: Path, name: str) -> Path:
    """Return the path of a file that a document names, as it is called where the locale is not UTF-8 too."""
    return folder / os.fsdecode(name.encode("utf-8", "surrogateescape"))


@contextmanager
def reading(path: Path, most: int | None = MAX_BYTES) -> Iterator[None]:
    """Turn what keeps a file of at most so many bytes from being read into an `InputError`.

    Folders, devices and pipes, which may have no end, are refused.
    """
    try:
        if path.exists() and not path.is_file():
            raise InputError(f"{path}: cannot be read: expected a file, this is a folder, a device or a pipe")
        size = path.stat().st_size
        if most is not None and size > most:
            raise InputError(f"{path}: expected at most {most / 2**20:g} MB, got {size / 2**20:.1f} MB")
        yield
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such file") from None
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: expected UTF-8 text, byte {error.start} is not") from None
    except (OSError, ValueError) as error:  # ValueError: a NUL in the path
        raise InputError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None


def read_text(path: Path) -> str:
    """Return the text of a UTF-8 file."""
    with reading(path):
        return path.read_text(encoding="utf-8-sig")


def is_file_name(name_or_path: str | Path, suffixes: tuple[str, ...]) -> bool:
    """Return True for paths, and for text that is one: by its suffix, or as it names a folder."""
    text = str(name_or_path)
    return isinstance(name_or_path, Path) or text.lower().endswith(suffixes) or "/" in text or "\\" in text


def read_document(path: Path) -> dict[str, Any]:
    """Return the keys and plain values of a YAML or JSON file."""
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"{path}: expected a file that ends in {', '.join(SUFFIXES)}")
    read = _json_value if suffix == ".json" else _yaml_value
    return plain_mapping(read(read_text(path), str(path)), str(path))


def plain_mapping(value: Any, where: str) -> dict[str, Any]:
    """Return ``value`` itself, once it is known to be a mapping of plain values, none beyond `MAX_NUMBER`."""
    if not isinstance(value, dict):
        raise InputError(f"{where}: expected a mapping of keys to values, got {clip(value)}")
    _plain(value, where, "", 0)
    return value


def clip(value: Any) -> str:
    """Return a short one-line form of a value for messages."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else f"{text[:57]}..."


def is_number(word: str) -> bool:
    """True if a word of a text is a number."""
    try:
        float(word)
    except ValueError:
        return False
    return True


def join_names(names: Iterable[str], most: int = 60) -> str:
    """Return names for a message, only the first ``most`` where there are more."""
    known = list(names)
    rest = len(known) - most
    return ", ".join(known[:most]) + (f" and {rest} more" if rest > 0 else "")


def _plain(value: Any, where: str, place: str, depth: int) -> None:
    at = f"{where}: {place}" if place else where
    if depth > MAX_DEPTH:
        raise InputError(f"{where}: expected at most {MAX_DEPTH} levels of nesting")
    if isinstance(value, dict):
        for key, item in value.items():
            if not isinstance(key, str):
                raise InputError(f"{at}: expected text as key, got {clip(key)}")
            _plain(item, where, f"{place}.{key}" if place else key, depth + 1)
    elif isinstance(value, list):
        for k, item in enumerate(value):
            _plain(item, where, f"{place}[{k}]", depth + 1)
    elif isinstance(value, int | float):
        if not abs(value) <= MAX_NUMBER:
            raise InputError(
                f"{at}: expected a finite number of at most {MAX_NUMBER:g} in size, got {clip(value)}"
            )
    elif value is not None and not isinstance(value, str):
        raise InputError(f"{at}: expected numbers, text, lists and mappings, got {type(value).__name__}")


def _json_value(text: str, where: str) -> Any:
    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        mapping = dict(pairs)
        if len(mapping) < len(pairs):
            keys = [key for key, _ in pairs]
            twice = next(key for key in keys if keys.count(key) > 1)
            raise InputError(f"{where}: key {clip(twice)} is given twice")
        return mapping

    try:
        return json.loads(text, object_pairs_hook=once)
    except json.JSONDecodeError as error:
        raise InputError(f"{where}: line {error.lineno}: not valid JSON: {error.msg}") from None
    except (RecursionError, ValueError):  # ValueError: a number of thousands of digits
        raise InputError(f"{where}: not valid JSON: nested too deeply, or a number is too long") from None


def _yaml_value(text: str, where: str) -> Any:
    try:
        _scan(text, where)
        return yaml.load(text, Loader=_Loader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        line = f"line {mark.line + 1}: " if mark else ""
        raise InputError(f"{where}: {line}not valid YAML: {_flat(error.problem)}") from None
    except yaml.YAMLError as error:
        raise InputError(f"{where}: not valid YAML: {_flat(error)}") from None
    except ValueError:  # a number of thousands of digits
        raise InputError(f"{where}: not valid YAML: a number is too long") from None


def _scan(text: str, where: str) -> None:
    """Refuse aliases and deep nesting before anything is built from them."""
    depth = 0
    for event in yaml.parse(text, Loader=_Base):
        if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None):
            mark = event.start_mark
            line = f"line {mark.line + 1}: " if mark else ""
            raise InputError(
                f"{where}: {line}YAML anchors and aliases are not supported, write the value out"
            )
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
        if depth > MAX_DEPTH:
            raise InputError(f"{where}: expected at most {MAX_DEPTH} levels of nesting")


def _flat(value: object) -> str:
    return " ".join(str(value).split())


# --- models of documents

Model = TypeVar("Model", bound=BaseModel)
_Item = TypeVar("_Item")
Many = Annotated[list[_Item], FailFast()]  # of a million wrong ones only the first is reported

MAX_NAME_LENGTH = 200
OneLine = Annotated[str, Field(min_length=1, max_length=MAX_NAME_LENGTH, pattern=r"^[^\r\n\x00-\x1f]+$")]
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
