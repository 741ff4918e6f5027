"""How deep imports go: the longest chain of modules of which each imports the next, by their sources."""

from __future__ import annotations

import ast
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from pkgutil import walk_packages

import regionik

DEEPEST = 22  # modules


@cache
def sources() -> dict[str, Path]:
    """The file of every module of the product, packages aside."""
    found = {}
    for module in walk_packages(regionik.__path__, "regionik."):
        spec = find_spec(module.name)
        assert spec is not None
        assert spec.origin is not None
        found[module.name] = Path(spec.origin)
    return found


@cache
def imported(name: str) -> tuple[str, ...]:
    """Modules of the product that one imports as it is loaded, those for type checkers alone left out."""
    found = set()
    for node in ast.parse(sources()[name].read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{one.name}" for one in node.names)}
        elif isinstance(node, ast.Import):
            found |= {one.name for one in node.names}
    return tuple(sorted((found & sources().keys()) - {name}))


@cache
def chain(name: str) -> tuple[str, ...]:
    """The longest chain of imports from a module, itself the first."""
    return (name, *max(map(chain, imported(name)), key=len, default=()))


def test_no_chain_of_imports_is_longer_than_it_was() -> None:
    longest = max(map(chain, sources()), key=len)
    assert len(longest) > 10  # else the imports were not read
    assert len(longest) <= DEEPEST, " > ".join(longest)
