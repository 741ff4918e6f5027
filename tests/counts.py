"""How large the code is, and what tests use of it: ``python -m tests.counts [TREE ...]``."""

from __future__ import annotations

import ast
import sys
import tokenize
from collections.abc import Iterator, Mapping
from functools import cache
from io import StringIO
from pathlib import Path

from rich.console import Console
from rich.table import Table

ROOMS = "regionik", "planners", "worlds"  # the last two are linked into the first
LINKED = "regionik/planners", "regionik/worlds"
CACHES = "lru_cache", "cache"
EMPTY = {getattr(tokenize, name) for name in ("COMMENT", "NL", "NEWLINE", "INDENT", "DEDENT", "ENDMARKER")}


def counts(tree: Path) -> dict[str, float]:
    """Return what is counted of a checkout."""
    modules = _modules(tree)
    parsed = {name: ast.parse(text) for name, text in modules.items()}
    lines = [line for text in modules.values() for line in text.splitlines()]
    public = _exported(parsed["regionik"])
    return {
        "modules": len(modules),
        "lines": len(lines),
        "lines of code": sum(map(_lines_of_code, modules.values())),
        "import depth": _depth(parsed),
        "lru_cache and cache": sum(_caches(module) for module in parsed.values()),
        "module constants with a number": sum(1 for module in parsed.values() for _ in _constants(module)),
        "names without an underscore": sum(1 for module in parsed.values() for _ in _names(module)),
        "names of regionik itself": len(public),
        "lines of tests": sum(len(text.splitlines()) for text in _tests(tree)),
        "% of lines of test functions by public names": _public_share(tree, public),
    }


def _modules(tree: Path) -> dict[str, str]:
    """Return the texts of modules by their dotted names."""
    found = {}
    for room in ROOMS:
        for path in sorted((tree / room).rglob("*.py")):
            inside = path.relative_to(tree).with_suffix("").as_posix()
            if not inside.startswith(LINKED):
                dotted = inside.replace("/", ".").removesuffix(".__init__")
                found[dotted if room == "regionik" else f"regionik.{dotted}"] = path.read_text("utf-8")
    return found


def _lines_of_code(text: str) -> int:
    """Return the number of lines on which anything but comments and docstrings stands."""
    code, texts = set[int](), set[int]()
    for token in tokenize.generate_tokens(StringIO(text).readline):
        if token.type not in EMPTY:
            code |= set(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            texts |= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return len(code - texts)


def _depth(parsed: Mapping[str, ast.Module]) -> int:
    """Return how many modules the longest chain of imports at their tops has, each module but once."""
    below = {name: sorted(set(_imported(module, parsed))) for name, module in parsed.items()}

    @cache
    def depth(name: str) -> int:
        return 1 + max((depth(one) for one in below[name] if one != name), default=0)

    return max(map(depth, below))


def _imported(module: ast.Module, known: Mapping[str, object]) -> Iterator[str]:
    """Yield modules of the tree that a module imports when it is loaded."""
    for node in module.body:
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in known)
        elif isinstance(node, ast.ImportFrom) and node.module:
            inner = [f"{node.module}.{alias.name}" for alias in node.names]
            yield from (
                name if name in known else node.module
                for name in inner
                if name in known or node.module in known
            )


def _caches(module: ast.Module) -> int:
    """Return how many functions keep what they returned."""
    functions = (node for node in ast.walk(module) if isinstance(node, ast.FunctionDef))
    return sum(any(_named(one) in CACHES for one in node.decorator_list) for node in functions)


def _named(node: ast.expr) -> str:
    node = node.func if isinstance(node, ast.Call) else node
    return node.attr if isinstance(node, ast.Attribute) else getattr(node, "id", "")


def _constants(module: ast.Module) -> Iterator[str]:
    """Yield names in capitals that a module sets to something with a number in it."""
    for node in module.body:
        if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None:
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names = [one.id for target in targets for one in ast.walk(target) if isinstance(one, ast.Name)]
            if any(_is_number(one) for one in ast.walk(node.value)):
                yield from (name for name in names if name.isupper())


def _is_number(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and type(node.value) in (int, float)


def _names(module: ast.Module) -> Iterator[str]:
    """Yield functions and classes of a module that others may use."""
    for node in module.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
            yield node.name


def _exported(module: ast.Module) -> tuple[str, ...]:
    """Return ``__all__``."""
    for node in module.body:
        if isinstance(node, ast.Assign) and any(getattr(one, "id", "") == "__all__" for one in node.targets):
            return tuple(ast.literal_eval(node.value))
    return ()


def _tests(tree: Path) -> list[str]:
    return [path.read_text("utf-8") for path in sorted((tree / "tests").rglob("test_*.py"))]


def _public_share(tree: Path, public: tuple[str, ...]) -> float:
    """Return the share of lines of functions in test files that use public names only [%].

    A function that calls one of its file that uses others does not.
    """
    all_lines = public_lines = 0
    for module in map(ast.parse, _tests(tree)):
        functions = [node for node in module.body if isinstance(node, ast.FunctionDef)]
        used = {one.name: {n.id for n in ast.walk(one) if isinstance(n, ast.Name)} for one in functions}
        inner = set(_taken_from_inside(module)) - set(public)
        while more := {name for name, names in used.items() if names & inner} - inner:
            inner |= more
        lines = {one.name: (one.end_lineno or one.lineno) - one.lineno + 1 for one in functions}
        all_lines += sum(lines.values())
        public_lines += sum(count for name, count in lines.items() if name not in inner)
    return round(100 * public_lines / max(1, all_lines), 1)


def _taken_from_inside(module: ast.Module) -> Iterator[str]:
    """Yield names that a test file imports from modules of the package."""
    for node in ast.walk(module):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("regionik."):
            yield from (alias.asname or alias.name for alias in node.names)


def main() -> None:
    trees = [Path(one) for one in sys.argv[1:]] or [Path()]
    columns = [counts(tree) for tree in trees]
    table = Table("", *(str(tree) for tree in trees), box=None)
    for key in columns[0]:
        table.add_row(key, *(f"{column[key]:,g}" for column in columns))
    Console().print(table)


if __name__ == "__main__":
    main()
