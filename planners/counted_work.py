"""Functions that count their own work: the expressions they evaluate, in loops and in functions they call."""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Callable
from math import inf
from types import CodeType
from typing import Any

_COUNTER, _TOO_MUCH = "_work_of_kernels", "_TooMuchWork"


class TooMuchWork(Exception):
    """A function has done more than it was allowed; its arguments may be half changed."""


class CountedFunctions:
    """Twins of functions that count.

    Parameters
    ----------
    unwrap : callable
        Takes a value that a function knows by a name; returns the function to count in its place, or None.

    Attributes
    ----------
    work : list of float
        Expressions evaluated so far, and at how many `TooMuchWork` is raised.

    Examples
    --------
    >>> import math
    >>> counted = CountedFunctions(lambda value: None)
    >>> counted.size(math.comb), counted.work
    (1, [0, inf])
    """

    def __init__(self, unwrap: Callable[[Any], Callable[..., Any] | None]) -> None:
        self.work: list[float] = [0, inf]
        self._unwrap = unwrap
        self._twins: dict[Any, Callable[..., Any]] = {}
        self._sizes: dict[Any, int] = {}

    def counted(self, function: Any) -> Callable[..., Any]:
        """Return a function that does the same and adds what it does to ``work``.

        Globals are those of the function when it is first asked for. What has no source is not counted.
        """
        if function not in self._twins:
            self._twins[function] = function
            tree = _tree(function)
            if tree is not None:
                self._twins[function] = self._twin(function, tree)
        return self._twins[function]

    def size(self, function: Any) -> int:
        """Number of expressions in a function and in all that it calls."""
        if function not in self._sizes:
            self._sizes[function] = 1
            tree = _tree(function)
            if tree is not None:
                own = sum(isinstance(node, ast.expr) for node in ast.walk(tree))
                self._sizes[function] = own + sum(map(self.size, self._called(function).values()))
        return self._sizes[function]

    def files(self, function: Any) -> set[str]:
        """Files of a function and of all that it calls."""
        found, left = set[Any](), [function]
        while left:
            one = left.pop()
            if one not in found:
                found.add(one)
                left += self._called(one).values()
        return {one.__code__.co_filename for one in found}

    def _twin(self, function: Any, tree: ast.Module) -> Callable[..., Any]:
        counting = ast.fix_missing_locations(_Counting().visit(tree))
        names = {**function.__globals__, _COUNTER: self.work, _TOO_MUCH: TooMuchWork}
        exec(compile(counting, function.__code__.co_filename, "exec"), names)
        twin: Callable[..., Any] = names[function.__name__]
        self._twins[function] = twin  # before those it calls, which may call it
        names.update({name: self.counted(called) for name, called in self._called(function).items()})
        return twin

    def _called(self, function: Any) -> dict[str, Any]:
        """Functions to count that a function knows, by their names."""
        known = function.__globals__
        found = {name: self._unwrap(known[name]) for name in _names(function.__code__) if name in known}
        return {name: called for name, called in found.items() if called is not None}


_COUNT = f"{_COUNTER}[0] += {{}}\nif {_COUNTER}[0] > {_COUNTER}[1]: raise {_TOO_MUCH}"


class _Counting(ast.NodeTransformer):
    """Adds to a function, and to the body of each of its loops, lines that count its expressions."""

    def _counted(self, node: Any) -> Any:
        own = ast.parse(_COUNT.format(_expressions(node))).body
        self.generic_visit(node)
        node.body = own + node.body
        return node

    visit_FunctionDef = visit_For = visit_While = _counted


def _tree(function: Any) -> ast.Module | None:
    """Return a function's source as a tree, without decorators and annotations; None where there is none."""
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    except (OSError, TypeError, SyntaxError):
        return None
    definition = tree.body[0]
    if not isinstance(definition, ast.FunctionDef) or definition.name != function.__name__:
        return None  # the file is another one by now
    ast.increment_lineno(tree, function.__code__.co_firstlineno - 1)
    definition.decorator_list, definition.returns = [], None
    for argument in ast.walk(definition.args):
        if isinstance(argument, ast.arg):
            argument.annotation = None
    return tree


def _expressions(node: ast.AST) -> int:
    """Number of expressions in a node, those in loops inside it left out."""
    inside = [child for child in ast.iter_child_nodes(node) if not isinstance(child, (ast.For, ast.While))]
    return sum(isinstance(child, ast.expr) + _expressions(child) for child in inside)


def _names(code: CodeType) -> set[str]:
    """Return the names that code looks up, comprehensions in it too."""
    inner = [_names(part) for part in code.co_consts if isinstance(part, CodeType)]
    return set(code.co_names).union(*inner)
