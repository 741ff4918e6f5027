"""How large the code is, and what tests use of it: ``python -m tests.counts [TREE ...]``."""

from __future__ import annotations

import ast
import re
import sys
import tokenize
from collections.abc import Collection, Iterator, Mapping
from functools import cache
from io import StringIO
from pathlib import Path

from rich.console import Console
from rich.table import Table

from tests.faces import FACES

ROOMS = "regionik", "planners", "worlds"  # the last two are linked into the first
LINKED = "regionik/planners", "regionik/worlds"
PATCHED = re.compile(r"regionik(\.\w+)+")
CACHES = "lru_cache", "cache"
EMPTY = {getattr(tokenize, name) for name in ("COMMENT", "NL", "NEWLINE", "INDENT", "DEDENT", "ENDMARKER")}


def counts(tree: Path) -> dict[str, float]:
    """Return what is counted of a checkout."""
    modules = _modules(tree)
    parsed = {name: ast.parse(text) for name, text in modules.items()}
    lines = [line for text in modules.values() for line in text.splitlines()]
    public, tests, shares = _exported(parsed["regionik"]), _tests(tree), shares_of_tests(tree, FACES)
    return {
        "modules": len(modules),
        "lines": len(lines),
        "lines of code": sum(map(_lines_of_code, modules.values())),
        "import depth": _depth(parsed),
        "lru_cache and cache": sum(_caches(module) for module in parsed.values()),
        "module constants with a number": sum(1 for module in parsed.values() for _ in _constants(module)),
        "names without an underscore": sum(1 for module in parsed.values() for _ in _names(module)),
        "names of regionik itself": len(public),
        "lines of tests": sum(len(text.splitlines()) for name, text in tests.items() if ".test_" in name),
        "% of lines of test functions by public names": shares[0],
        "% of them by public names and faces": shares[1],
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


def _tests(tree: Path) -> dict[str, str]:
    """Return the texts of tests and of what helps them, by their dotted names."""
    paths = sorted((tree / "tests").rglob("*.py"))
    return {
        path.relative_to(tree).with_suffix("").as_posix().replace("/", "."): path.read_text("utf-8")
        for path in paths
    }


def shares_of_tests(tree: Path, allowed: Collection[str]) -> tuple[float, float]:
    """Return shares of lines of functions in test files [%].

    Those that use public names only, and those that use these and allowed ones ("regionik.scene.scene_of").
    A function uses what it names, and what functions, fixtures and constants use that it names, of its file
    or of one that helps it; a name that is patched by its path is used too.
    """
    known = {name: _Uses(ast.parse(text)) for name, text in _tests(tree).items()}
    public = set(_exported(ast.parse((tree / "regionik/__init__.py").read_text("utf-8"))))
    lines, by_public, by_allowed = 0, 0, 0
    for name, uses in known.items():
        for node in uses.functions if name.rpartition(".")[2].startswith("test_") else ():
            count = (node.end_lineno or node.lineno) - node.lineno + 1
            inner = {one for one in _reached(known, name, node.name) if not _is_public(one, public)}
            lines += count
            by_public += count * (not inner)
            by_allowed += count * inner.issubset(allowed)
    return round(100 * by_public / max(1, lines), 1), round(100 * by_allowed / max(1, lines), 1)


def _is_public(name: str, public: Collection[str]) -> bool:
    return name.rpartition(".")[2] in public


class _Uses:
    """What a file of tests defines, takes from elsewhere, and names in each of its definitions."""

    def __init__(self, module: ast.Module) -> None:
        self.functions = [node for node in module.body if isinstance(node, ast.FunctionDef)]
        self.taken = dict[str, str]()
        for node in ast.walk(module):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(("regionik", "tests")):
                self.taken |= {one.asname or one.name: f"{node.module}.{one.name}" for one in node.names}
        fixtures = {one.name for one in self.functions if "fixture" in map(_named, one.decorator_list)}
        self.named = dict[str, set[str]]()
        for node in module.body:
            for name in _defined(node):
                self.named[name] = self.named.get(name, set()) | set(_mentioned(node, fixtures))


def _defined(node: ast.stmt) -> Iterator[str]:
    """Yield names that a statement of a file gives a meaning to."""
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        yield node.name
    elif isinstance(node, ast.Assign | ast.AnnAssign):
        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
        yield from (one.id for target in targets for one in ast.walk(target) if isinstance(one, ast.Name))


def _mentioned(node: ast.AST, fixtures: Collection[str]) -> Iterator[str]:
    """Yield names, fixtures that are asked for, and paths of what is patched."""
    for one in ast.walk(node):
        if isinstance(one, ast.Name):
            yield one.id
        elif isinstance(one, ast.arg) and one.arg in fixtures:
            yield one.arg
        elif isinstance(one, ast.Constant) and PATCHED.fullmatch(str(one.value)):
            yield str(one.value)


def _reached(known: Mapping[str, _Uses], module: str, name: str) -> set[str]:
    """Return paths of all names of the package that one of a file of tests comes to use."""
    found, seen, ahead = set[str](), set[tuple[str, str]](), [(module, name)]
    while ahead:
        here = ahead.pop()
        if here in seen or here[0] not in known:
            continue
        seen.add(here)
        uses = known[here[0]]
        for one in uses.named.get(here[1], ()) if here[1] in uses.named else (here[1],):
            path = one if PATCHED.fullmatch(one) else uses.taken.get(one, "")
            if path.startswith("regionik"):
                found.add(path)
            elif path:
                ahead.append((path.rpartition(".")[0], path.rpartition(".")[2]))
            elif one in uses.named:
                ahead.append((here[0], one))
    return found


def main() -> None:
    trees = [Path(one) for one in sys.argv[1:]] or [Path()]
    columns = [counts(tree) for tree in trees]
    table = Table("", *(str(tree) for tree in trees), box=None)
    for key in columns[0]:
        table.add_row(key, *(f"{column[key]:,g}" for column in columns))
    Console().print(table)


if __name__ == "__main__":
    main()
