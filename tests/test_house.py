"""The house rules that no other tool holds."""

from __future__ import annotations

import ast
import re
import tomllib
from collections import Counter
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
ROOMS = ("worlds", "planners", "regionik")
SOURCES = sorted({path.resolve() for room in ROOMS for path in (ROOT / room).glob("**/*.py")})
SCRIPTS = sorted(path for room in ("benchmarks", "examples") for path in (ROOT / room).glob("**/*.py"))
ENGINES = {
    "ompl": {"planners/driving/sampling.py"},
    "fcl": {"planners/collision/meshes.py"},
    "meshcat": {"regionik/view/viewer.py"},
    "piqp": {"planners/smoothing/quadratic_program.py"},
    "toppra": {"planners/timing/time_optimal.py"},
    "matplotlib": {"regionik/view/figures.py"},
    "typer": {
        "regionik/cli/app.py",
        "regionik/cli/compare.py",
        "regionik/cli/console.py",
        "regionik/cli/plan.py",
        "regionik/cli/reach.py",
        "regionik/cli/simulate.py",
        "regionik/cli/tables.py",
    },
    "pygad": {"regionik/papers/rivals/genetic.py"},
    "sklearn": {"regionik/papers/rivals/network.py"},
    "pandas": {"regionik/values.py"},
    "distributed": {"regionik/executors.py"},
    "rasterio": {"regionik/output/export.py"},
    "rosbags": {"regionik/output/ros2.py"},
    "mujoco": {"regionik/simulation/physics.py"},
}


def room_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


@pytest.mark.parametrize("engine", ENGINES)
def test_one_engine_one_file(engine: str) -> None:
    imports = re.compile(rf"^\s*(?:import|from) {engine}\b|\(\"{engine}[.\"]", re.MULTILINE)
    users = {room_of(path) for path in SOURCES if imports.search(path.read_text())}
    assert users == ENGINES[engine]


@pytest.mark.parametrize("path", SCRIPTS, ids=room_of)
def test_programs_import_what_there_is(path: Path) -> None:
    """Of regionik: other modules are there only where they were asked for."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "regionik":
            module = import_module(str(node.module))
            missing = [name.name for name in node.names if not hasattr(module, name.name)]
            assert all(find_spec(f"{node.module}.{name}") for name in missing), missing


def test_no_path_of_a_machine() -> None:
    texts = {room_of(path): path.read_text() for path in [*SOURCES, ROOT / "Makefile", ROOT / ".ci" / "run"]}
    assert not [name for name, text in texts.items() if re.search(r"/(?:home|root|tmp|work|Users)/", text)]


def test_the_wheel_holds_every_room() -> None:
    packages = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"]
    rooms = {room_of(path.parent).replace("/", ".") for path in SOURCES}
    assert {name.removeprefix("regionik.") for name in packages} == {
        "worlds.data",  # files only
        *(room.removeprefix("regionik.") for room in rooms),
    }


def test_design_names_every_folder() -> None:
    design = (ROOT / "docs" / "design.md").read_text()
    folders = {path.parent.name for path in SOURCES} - set(ROOMS)
    assert not [name for name in sorted(folders) if f"`{name}/`" not in design]


def test_no_two_classes_have_one_name() -> None:
    trees = [ast.parse(path.read_text()) for path in SOURCES]
    names = Counter(node.name for tree in trees for node in ast.walk(tree) if isinstance(node, ast.ClassDef))
    assert not [name for name, count in names.items() if count > 1]


def test_readme_names_every_bundled_world() -> None:
    readme = (ROOT / "README.md").read_text()
    names = {path.name.removesuffix(".world.yaml") for path in (ROOT / "worlds/data").glob("*.world.yaml")}
    assert names
    rows = re.findall(r"^\| ((?:`\w+`(?:, )?)+) \|", readme, re.MULTILINE)
    assert names == {name for row in rows for name in re.findall(r"`(\w+)`", row)}


def test_constraints_lock_every_dependency() -> None:
    locked = {line.partition("==")[0] for line in (ROOT / "constraints.txt").read_text().splitlines()}
    listed = re.findall(r'^  "([A-Za-z0-9-]+)>=', (ROOT / "pyproject.toml").read_text(), re.MULTILINE)
    assert {name.lower() for name in listed} <= locked
    assert len(listed) > 10
