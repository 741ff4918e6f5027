"""The numbered examples run from top to bottom, and so does the README's."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
EXAMPLES = sorted((ROOT / "examples").glob("[0-9]*.py"))


def run_script(script: Path, folder: Path) -> str:
    command = [sys.executable, "-W", "error", str(script), str(folder)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert not done.stderr
    return done.stdout


@pytest.mark.parametrize("script", EXAMPLES, ids=lambda path: path.stem)
def test_example_runs(script: Path, tmp_path: Path) -> None:
    assert run_script(script, tmp_path)


def test_examples_are_numbered_from_one() -> None:
    assert [int(path.name[:2]) for path in EXAMPLES] == list(range(1, len(EXAMPLES) + 1))
    assert EXAMPLES


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
