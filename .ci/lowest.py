"""Lowest versions that a project allows, as constraints for pip: ``lowest.py pyproject.toml [extra ...]``."""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path


def lowest(project: dict[str, object], extras: list[str]) -> list[str]:
    """One pin for each requirement with a lower bound."""
    optional = project["optional-dependencies"]
    wanted = [*project["dependencies"], *(one for extra in extras for one in optional[extra])]
    return [re.sub(r"^([A-Za-z0-9._-]+)>=([0-9.]+)$", r"\1==\2", one) for one in wanted if ">=" in one]


if __name__ == "__main__":
    file, *extras = sys.argv[1:]
    print("\n".join(lowest(tomllib.loads(Path(file).read_text("utf-8"))["project"], extras)))
