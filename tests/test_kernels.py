"""Kernels: plain Python until they prove hot, the same bits either way, and machine code that is kept."""

from __future__ import annotations

import ast
import math
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import regionik as rik
from regionik.planners import kernels
from regionik.planners.kernels import CountedFunctions, compiled, compiled_at_once
from regionik.worlds.arrays import Array
from tests import MINUTES

ROOT = Path(__file__).parent.parent
# What numpy or Python rounds otherwise than the machine code of numba, and what to use in its place.
OTHERWISE = {
    **{f"np.{name}": f"math.{name}" for name in ("sin", "cos", "tan", "exp", "log", "sinh", "cosh", "tanh")},
    "np.arcsin": "math.asin", "np.arccos": "math.acos", "np.arctan": "math.atan", "np.arctan2": "math.atan2",
    "np.power": "a product", "math.hypot": "np.hypot", "math.pow": "a product", "np.linalg": "a loop",
    "np.sum": "a loop", "np.dot": "a loop", "np.mean": "a loop", "np.prod": "a loop",
    "np.linspace": "np.arange",
}  # fmt: skip
SUMMED = {"counts", "parts", "pieces"}  # of whole numbers


def kernel_definitions() -> Iterator[tuple[str, ast.FunctionDef]]:
    for path in sorted([*(ROOT / "planners").rglob("*.py"), *(ROOT / "regionik/papers").rglob("*.py")]):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.FunctionDef):
                decorators = " ".join(map(ast.unparse, node.decorator_list))
                if "compiled" in decorators or "_shared" in decorators:
                    yield f"{path.name}: {node.name}", node


def rounded_otherwise(definition: ast.FunctionDef) -> Iterator[str]:
    """Words on what a kernel should not use."""
    for node in ast.walk(definition):
        text = ast.unparse(node) if isinstance(node, ast.expr) else ""
        if isinstance(node, ast.Attribute) and text in OTHERWISE:
            yield f"{text}: expected {OTHERWISE[text]}"
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.MatMult):
            yield f"{text}: expected a loop"
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow) and "0.5 **" not in text:
            yield f"{text}: expected `squared`"  # powers of two are exact
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            of = ast.unparse(node.func.value)
            if node.func.attr in ("sum", "mean", "dot", "prod", "std") and of not in SUMMED:
                yield f"{text}: expected a loop"


def test_kernels_use_nothing_that_plain_python_rounds_otherwise() -> None:
    found = {name: list(rounded_otherwise(definition)) for name, definition in kernel_definitions()}
    assert len(found) > 300
    assert not {name: words for name, words in found.items() if words}


def test_what_is_rounded_otherwise_is_found() -> None:
    (bad,) = ast.parse("def f(x, y):\n    return np.sin(x) + x**2 + (x @ y) + y.sum()").body
    assert isinstance(bad, ast.FunctionDef)
    assert len(list(rounded_otherwise(bad))) == 4


@pytest.fixture(scope="module", autouse=True)
def as_users_have_it() -> Iterator[None]:
    """Kernels run as plain Python first, as they do outside of tests."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kernels, "_at_once", False)
        yield


def unkept(function: Any) -> Any:
    """A kernel that looks for no machine code on disk."""
    kernel: Any = compiled(function)
    kernel._opened = True
    return kernel


class Pair(NamedTuple):
    first: float
    second: int


def _inner(x: float) -> float:
    return math.sin(x) * x


inner = compiled(_inner)


def _outer(values: Array, times: int) -> tuple[float, Pair]:
    total = 0.0
    for _ in range(times):
        for k in range(len(values)):
            total += inner(values[k])
    return total, Pair(total, times)


cold, hot = unkept(_outer), compiled(_outer)


@given(st.lists(st.floats(-1e3, 1e3), max_size=20))
def test_both_ways_give_the_same_bits_and_types(values: list[float]) -> None:
    numbers = np.array(values)
    plain = cold(numbers, 3)
    with compiled_at_once():
        machine = hot(numbers, 3)
    assert plain == machine
    assert repr(plain) == repr(machine)  # floats of Python, not of numpy
    assert isinstance(plain[1], Pair)
    assert not cold.signatures


def test_a_kernel_is_compiled_once_it_has_worked_as_much_as_compiling_costs(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    kernel, heard, calls = unkept(_inner), list[str](), 0
    monkeypatch.setattr(kernels, "COMPILING", 3)
    monkeypatch.setattr(kernels, "_listeners", [heard.append])
    monkeypatch.setattr(kernels, "_warn_uncached", lambda: None)
    while not heard:
        assert kernel(2.0) == math.sin(2.0) * 2.0
        calls += 1
    assert calls > 3
    assert heard == ["_inner"]
    assert kernel.signatures
    assert kernel(2.0) == math.sin(2.0) * 2.0


def _halved(values: Array, pair: tuple[Array, float]) -> int:
    for _ in range(10):
        for k in range(len(values)):
            values[k] *= 0.5
            pair[0][k] += values[k]
    return len(values)


def test_a_long_call_is_begun_again_as_machine_code(monkeypatch: pytest.MonkeyPatch) -> None:
    heard = list[str]()
    monkeypatch.setattr(kernels, "COMPILING", 3)
    monkeypatch.setattr(kernels, "_listeners", [heard.append])
    monkeypatch.setattr(kernels, "_warn_uncached", lambda: None)
    start = np.arange(50.0)
    plain, compiled_later = (start.copy(), np.zeros(50)), (start.copy(), np.zeros(50))
    _halved(plain[0], (plain[1], 0.0))
    assert unkept(_halved)(compiled_later[0], (compiled_later[1], 0.0)) == 50
    assert heard == ["_halved"]
    assert np.array_equal(plain, compiled_later)


WRAPPED = (
    "import sys\n"
    "from regionik.planners.geometry.angles import wrap\n"
    "from regionik.planners.kernels import compiled_at_once\n"
    "if sys.argv[1:]:\n"
    "    with compiled_at_once():\n"
    "        wrap(4.0)\n"
    "print(wrap(4.0).hex(), len(wrap.signatures))\n"
)


def wrapped(kept: Path, *arguments: str) -> str:
    """Say what a process that keeps its machine code in a folder finds, and whether that was machine code."""
    there = {**os.environ, "NUMBA_CACHE_DIR": str(kept), "NUMBA_DISABLE_JIT": "0"}
    command = [sys.executable, "-W", "error", "-c", WRAPPED, *arguments]
    return subprocess.run(
        command, cwd=ROOT, env=there, capture_output=True, text=True, check=True
    ).stdout.strip()


BITS = (4.0 - 2 * math.pi).hex()


def test_machine_code_on_disk_is_used_at_once(tmp_path: Path) -> None:
    assert wrapped(tmp_path) == f"{BITS} 0"
    assert wrapped(tmp_path, "at once") == f"{BITS} 1"
    assert wrapped(tmp_path) == f"{BITS} 1"


DAMAGED = """
import pickle, sys
from pathlib import Path
import numba
from regionik.planners.geometry.angles import wrap
from regionik.planners.kernels import compiled, compiled_at_once

def hits() -> int:
    kernel = compiled(wrap.py_func)
    with compiled_at_once():
        assert kernel(4.0) == wrap(4.0)
    return sum(kernel.stats.cache_hits.values())

def flipped(data: bytes) -> bytes:
    k = len(data) // 2
    return data[:k] + bytes([data[k] ^ 0x55]) + data[k + 1 :]

print(hits(), hits())
gone = b"cregionik.planners.kernels\\nGone\\n."  # types of an earlier version
version = pickle.dumps(numba.__version__)
for ending in ("nbi", "nbc"):
    (path,) = Path(sys.argv[1]).rglob(f"*wrap*.{ending}")
    whole = path.read_bytes()
    for damaged in (
        b"", whole[:-1], flipped(whole), version + gone, pickle.dumps((1, 2)),
    ):
        path.write_bytes(damaged)
        print(hits(), hits())
"""


def test_damaged_machine_code_is_compiled_anew(tmp_path: Path) -> None:
    there = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "NUMBA_DISABLE_JIT": "0"}
    command = [sys.executable, "-W", "error", "-c", DAMAGED, str(tmp_path)]
    ran = subprocess.run(command, cwd=ROOT, env=there, capture_output=True, text=True, check=True)
    assert ran.stdout.splitlines() == ["0 1"] * 11


def test_machine_code_is_made_anew_where_a_kernel_inside_has_changed(tmp_path: Path) -> None:
    kernel = "from regionik.planners.kernels import *\n{}\n@compiled\ndef {}(x: int) -> int:\n    return {}\n"
    (tmp_path / "outer.py").write_text(kernel.format("from inner import one", "two", "one(x) + 1"))
    there = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kept"), "NUMBA_DISABLE_JIT": "0"}
    there["PYTHONPATH"] = os.pathsep.join([str(tmp_path), str(ROOT)])
    code = "from outer import *\nwith compiled_at_once():\n    print(two(1))\n"
    for body, expected in (("x", "2"), ("x + 10", "12"), ("x", "2")):
        (tmp_path / "inner.py").write_text(kernel.format("", "one", body))
        ran = subprocess.run(
            [sys.executable, "-B", "-c", code],
            cwd=tmp_path, env=there, capture_output=True, text=True, check=True,
        )  # fmt: skip
        assert ran.stdout.strip() == expected


def test_the_work_of_earlier_processes_counts(tmp_path: Path) -> None:
    code = (
        "import sys\n"
        "from regionik.planners import kernels\n"
        "from regionik.planners.geometry.angles import wrap\n"
        "kernels.COMPILING = 10_000\n"
        "for _ in range(int(sys.argv[1])):\n"
        "    wrap(4.0)\n"
        "print(len(wrap.signatures))\n"
    )
    there = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "NUMBA_DISABLE_JIT": "0"}

    def compiled_after(calls: int) -> bool:
        command = [sys.executable, "-W", "error", "-c", code, str(calls)]
        ran = subprocess.run(command, cwd=ROOT, env=there, capture_output=True, text=True, check=True)
        return ran.stdout.strip() == "1"

    assert not compiled_after(5_000)
    (kept,) = tmp_path.rglob("kernel_work.json")
    assert not compiled_after(5)
    for damaged in (
        "broken",
        "[1]",
        "[" * 10_000,
        '{"regionik.planners.geometry.angles.wrap": "much"}',
        "\0",
    ):
        kept.write_text(damaged)
        assert not compiled_after(5)
    assert not compiled_after(9_000)
    assert compiled_after(5_000)


WORLDS = [
    pytest.param("free", marks=pytest.mark.slow),
    *(pytest.param(name, marks=MINUTES) for name in ("pillar", "shelf", "pipe", "circle")),
]


@pytest.mark.parametrize("name", WORLDS)
def test_plans_have_the_same_bytes_however_their_kernels_run(name: str, tmp_path: Path) -> None:
    code = f"import regionik as rik; rik.plan(rik.load_world({name!r})).save({str(tmp_path / 'cold.json')!r})"
    there = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "NUMBA_DISABLE_JIT": "0"}
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, env=there, check=True)
    with compiled_at_once():
        rik.plan(rik.load_world(name)).save(tmp_path / "hot.json")
    assert (tmp_path / "cold.json").read_bytes() == (tmp_path / "hot.json").read_bytes()


def _squares(count: int) -> int:
    total = 0
    for k in range(count):
        total += _square(k)
    return total


def _square(k: int) -> int:
    return k * k


def test_counted_functions_do_the_same_and_count_their_loops() -> None:
    counted = CountedFunctions(lambda value: _square if value is _square else None)
    twin = counted.counted(_squares)
    work = []
    for count in (0, 10, 20):
        before = counted.work[0]
        assert twin(count) == _squares(count)
        work.append(counted.work[0] - before)
    assert 0 < work[0] < work[1]
    assert work[2] - work[1] == work[1] - work[0]
    assert counted.size(_squares) > counted.size(_square) > 1
