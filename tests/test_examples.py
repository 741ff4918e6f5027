"""The numbered examples run from top to bottom, and so does the README's."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
EXAMPLES = sorted((ROOT / "examples").glob("[0-9]*.py"))
NOTEBOOKS = sorted((ROOT / "examples").glob("[0-9]*.ipynb"))

RUN_CELLS = """
import json, os
os.environ["MPLBACKEND"] = "agg"
from IPython.core.interactiveshell import InteractiveShell
shell, values = InteractiveShell.instance(), []
for code in json.load(open("cells.json")):
    done = shell.run_cell(code)
    done.raise_error()
    values += [] if done.result is None else [done.result]
shown = [shell.display_formatter.format(value)[0] for value in values]
print(sum("<svg" in data.get("text/html", "") for data in shown), "pictures of", len(values), "values")
"""


def run_script(script: Path, folder: Path) -> str:
    command = [sys.executable, "-W", "error", str(script), str(folder)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert not done.stderr
    return done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("script", EXAMPLES, ids=lambda path: path.stem)
def test_example_runs(script: Path, tmp_path: Path) -> None:
    assert run_script(script, tmp_path)


def test_examples_are_numbered_from_one() -> None:
    numbered = sorted(int(path.name[:2]) for path in [*EXAMPLES, *NOTEBOOKS])
    assert numbered == list(range(1, len(numbered) + 1))
    assert EXAMPLES
    assert NOTEBOOKS


@pytest.mark.slow
@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_runs_and_its_values_show_themselves(notebook: Path, tmp_path: Path) -> None:
    (tmp_path / "cells.json").write_text(json.dumps(code_of(notebook)))
    command = [sys.executable, "-c", RUN_CELLS]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "4 pictures of 5 values"  # an explanation is text
    assert (tmp_path / "pillar.html").stat().st_size > 500_000


def code_of(notebook: Path) -> list[str]:
    """Code of a notebook's cells, which are kept without what they said."""
    document = json.loads(notebook.read_text("utf-8"))
    assert (document["nbformat"], document["nbformat_minor"]) == (4, 5)
    cells = document["cells"]
    assert len({cell["id"] for cell in cells}) == len(cells)
    assert not any(cell.get("outputs") for cell in cells)
    return ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]


def test_readme_example_runs(tmp_path: Path) -> None:
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    script = tmp_path / "readme.py"
    script.write_text(
        "\n".join(blocks) + "\nassert answer.reachable.all() and area.polygon.area > 0 and report.ok\n"
    )
    run_script(script, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {
        "readme.py",
        "plan.json",
        "plan.html",
        "plan.svg",
        "arm.yaml",
    }
