"""Kernels: plain Python at first, compiled by numba where they prove hot, their machine code kept on disk.

numba takes seconds to compile what plain Python does in milliseconds: to compile all that a first plan of the
bundled world "pillar" calls takes 75 s of a processor, the plan itself one. So a kernel that Python calls
runs its machine code where there is some, in memory or on disk; else it runs as plain Python that counts its
own work, the expressions it evaluates, and is compiled once that has cost about half of what compiling does,
the work of earlier processes included. A call that gets there begins again: what it wrote into its arguments
is put back. No clock decides. Both ways give the same bits: `tests/test_kernels.py` says what a kernel may
use for that.
"""

from __future__ import annotations

import ast
import atexit
import inspect
import json
import os
import pickle
import textwrap
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from hashlib import sha256
from math import inf
from multiprocessing import parent_process
from pathlib import Path
from pickle import UnpicklingError
from types import CodeType
from typing import Any, Literal, TypeVar, cast

import numpy as np
from numba.core import config
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.dispatcher import Dispatcher, OmittedArg
from numba.core.registry import CPUDispatcher
from numba.core.types import unliteral
from numpy.typing import NDArray

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


COMPILING = 50_000  # expressions that plain Python evaluates while one of a kernel is compiled, about half

Function = TypeVar("Function", bound=Callable[..., Any])

_plain = CountedFunctions(lambda value: value.py_func if isinstance(value, Dispatcher) else None)
_at_once = False  # kernels are compiled before their first call
_listeners: list[Callable[[str], None]] = []
_work_here: Counter[str] = Counter()  # done as plain Python in this process, by kernel


class _SealedFiles(IndexDataCacheFile):
    """Files of machine code, each with its digest at its end: damaged code would end the process."""

    def _dump(self, obj: object) -> bytes:
        data: bytes = super()._dump(obj)  # type: ignore[no-untyped-call]
        return data + sha256(data).digest()

    def _load_index(self) -> dict[Any, str]:
        with suppress(FileNotFoundError), open(self._index_path, "rb") as file:
            if pickle.load(file) == self._version:
                _check_digest(file.read())
        return super()._load_index()  # type: ignore[no-untyped-call]

    def _load_data(self, name: str) -> object:
        _check_digest(Path(self._data_path(name)).read_bytes())  # type: ignore[no-untyped-call]
        return super()._load_data(name)  # type: ignore[no-untyped-call]


def _check_digest(data: bytes) -> None:
    """Refuse data that do not end with the digest of what stands before it."""
    size = sha256().digest_size
    if sha256(data[:-size]).digest() != data[-size:]:
        raise UnpicklingError("damaged")


class _KernelCache(FunctionCache):
    """Machine code on disk; where it cannot be written or read, each process compiles for itself.

    It is that of a kernel and of all kernels inside, for which numba itself would look at one file alone.
    What is in a damaged file is compiled anew: broken pickles raise whatever they like.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)  # type: ignore[no-untyped-call]
        stats = [os.stat(file) for file in sorted(_plain.files(function))]
        stamp = [(one.st_mtime, one.st_size) for one in stats]
        self._cache_file = _SealedFiles(self.cache_path, self._impl.filename_base, stamp)  # type: ignore[no-untyped-call]

    def save_overload(self, sig: object, data: object) -> None:
        with suppress(OSError):
            super().save_overload(sig, data)  # type: ignore[no-untyped-call]

    def load_overload(self, sig: object, target_context: object) -> object:
        if self._known():
            with suppress(Exception):
                return super().load_overload(sig, target_context)  # type: ignore[no-untyped-call]
        return None

    def holds(self, kernel: Kernel, arguments: tuple[Any, ...]) -> bool:
        """True if there is machine code for arguments of these types."""
        known = self._known()
        if not known:
            return False
        types = tuple(kernel.typeof_pyval(value) for value in arguments)
        return self._index_key(types, kernel.targetctx.codegen()) in known  # type: ignore[no-untyped-call]

    def _known(self) -> Mapping[Any, str]:
        """Machine code that there is; an index that is damaged, or of types that are gone, is given up."""
        with suppress(OSError):
            try:
                return self._cache_file._load_index()  # type: ignore[no-untyped-call]
            except OSError:
                raise
            except Exception:
                self.flush()  # type: ignore[no-untyped-call]
        return {}


_Dispatcher: Any = CPUDispatcher  # it has more than its types say


class Kernel(_Dispatcher):  # type: ignore[misc]
    """A function that runs as plain Python until it has done as much work as compiling it costs."""

    _work = 0.0  # done as plain Python, in earlier processes too
    _opened = False  # its place on disk was looked for

    def compile(self, sig: Any) -> Any:
        """Compile for arguments of these types; numbers written in a call are as any others."""
        self._open()
        return super().compile(tuple(map(unliteral, sig)))

    def _compile_for_args(self, *args: Any, **kws: Any) -> Any:
        """Return what to call for arguments that there is no machine code for in memory."""
        if self._is_stored(args):
            return super()._compile_for_args(*args, **kws)
        if not _at_once and self._work < self._worth_compiling:
            return self._run_plainly
        if not isinstance(self._cache, _KernelCache):
            _warn_uncached()
        for listener in _listeners:
            listener(self.__name__)
        return super()._compile_for_args(*args, **kws)

    @property
    def _worth_compiling(self) -> int:
        return COMPILING * _plain.size(self.py_func)

    @property
    def _full_name(self) -> str:
        return f"{self.py_func.__module__}.{self.__name__}"

    def _run_plainly(self, *args: Any) -> Any:
        """Run as plain Python; a call that turns out long is begun again as machine code."""
        given = [value.value if isinstance(value, OmittedArg) else value for value in args]
        before, function = _plain.work[0], _plain.counted(self.py_func)
        saved = [(array, array.copy()) for array in _writable_arrays(given)]
        _plain.work[1] = before + self._worth_compiling - self._work
        try:
            with np.errstate(all="ignore"):  # what is compiled does not warn
                return _as_compiled(function(*given))
        except TooMuchWork:
            for array, values in saved:
                array[...] = values
        finally:
            done = _plain.work[0] - before
            self._work += done
            _work_here[self._full_name] += int(done)
            _plain.work[1] = np.inf
        return self(*given)

    def _is_stored(self, arguments: tuple[Any, ...]) -> bool:
        self._open()
        return isinstance(self._cache, _KernelCache) and self._cache.holds(self, arguments)

    def _open(self) -> None:
        """Find the place on disk on first use: to look for one that can be written takes time."""
        if not self._opened:
            self._opened = True
            self._work += _work_before().get(self._full_name, 0)
            with suppress(RuntimeError):  # there is no folder that can be written
                self._cache = _KernelCache(self.py_func)


def compiled(function: Function, error_model: Literal["python", "numpy"] = "python") -> Function:
    """Make a kernel of a function; type checkers still see the function.

    While machine code runs others may: the thread that ends the process after Ctrl-C, for one. All that
    decides on rounding is said, as a kernel else takes it from the one that calls it first, and keeps it.
    """
    if config.DISABLE_JIT:  # type: ignore[attr-defined]
        return function
    options = {"nopython": True, "nogil": True, "error_model": error_model, "fastmath": False}
    return cast(Function, Kernel(function, targetoptions=options))


@contextmanager
def compiled_at_once(listener: Callable[[str], None] | None = None) -> Iterator[None]:
    """Compile every kernel that is called before it runs; ``listener`` is told its name."""
    global _at_once
    before, _at_once = _at_once, True
    heard = [] if listener is None else [listener]
    _listeners.extend(heard)
    try:
        yield
    finally:
        _at_once = before
        for one in heard:
            _listeners.remove(one)


def tell_compiling(listener: Callable[[str], None]) -> None:
    """Tell a listener the name of every kernel that is compiled from now on."""
    _listeners.append(listener)


def plain_work() -> float:
    """Return how many expressions kernels have evaluated as plain Python in this process."""
    return _plain.work[0]


def cache_folder() -> str | None:
    """Return the folder in which machine code is kept; None where no folder can be written."""
    try:
        return str(_KernelCache(_as_compiled).cache_path)
    except RuntimeError:
        return None


def _writable_arrays(values: Sequence[Any]) -> Iterator[NDArray[Any]]:
    """Arrays among values and in tuples of them."""
    for value in values:
        if isinstance(value, np.ndarray) and value.flags.writeable:
            yield value
        elif isinstance(value, tuple):
            yield from _writable_arrays(value)


def _as_compiled(result: Any) -> Any:
    """Scalars as machine code returns them: numbers of Python, not of numpy."""
    if isinstance(result, np.generic):
        return result.item()
    if isinstance(result, tuple):
        parts = map(_as_compiled, result)
        return type(result)(*parts) if hasattr(result, "_fields") else tuple(parts)
    return result


def _work_path() -> Path | None:
    """File of the work that kernels have done as plain Python; None where no folder can be written."""
    folder = cache_folder()
    return None if folder is None else Path(folder, "kernel_work.json")


@cache
def _work_before() -> dict[str, int]:
    """Work that each kernel has done as plain Python in earlier processes."""
    path = _work_path()
    if path is not None:
        with suppress(OSError, ValueError, RecursionError):
            found = json.loads(path.read_bytes())
            if isinstance(found, dict):  # what else is damaged in it counts for nothing
                return {name: work for name, work in found.items() if type(work) is int and work > 0}
    return {}


@atexit.register
def _keep_work() -> None:
    """Add the work of this process to that of earlier ones; one of two that end at once may be lost."""
    path = _work_path() if _work_here else None
    if path is not None:
        _work_before.cache_clear()
        with suppress(OSError):
            new = path.with_suffix(f".{os.getpid()}")
            new.write_text(json.dumps(Counter(_work_before()) + _work_here), encoding="utf-8")
            new.replace(path)


@cache
def _warn_uncached() -> None:
    """Warn once, and not again in worker processes, that every run compiles its kernels anew."""
    if parent_process() is None:
        warnings.warn(
            "compiled kernels cannot be kept on disk, so every run compiles them anew: "
            "set NUMBA_CACHE_DIR to a folder that can be written",
            stacklevel=3,
        )
