"""Results as JSON values; imports nothing heavy, so that every command may print them."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping
from typing import Any


def json_values(value: Any) -> Any:
    """Any result as dicts, lists, strings, numbers, booleans and None.

    Dataclasses become dicts by their fields, geometries GeoJSON; NaN and infinities become None.
    """
    if isinstance(value, Mapping):
        return {str(key): json_values(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [json_values(item) for item in value]
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {one.name: json_values(getattr(value, one.name)) for one in dataclasses.fields(value)}
    if hasattr(value, "__geo_interface__"):
        return json_values(value.__geo_interface__)
    if hasattr(value, "tolist"):  # an array or a number of numpy
        return json_values(value.tolist())
    return value


def json_text(value: Any) -> str:
    """A result as indented JSON, as it is written to files."""
    return json.dumps(json_values(value), indent=2, allow_nan=False) + "\n"
