"""What is counted of the code, on a tree of a few lines whose counts are known."""

from importlib import import_module
from pathlib import Path

import pytest

from tests.counts import counts, main, shares_of_tests
from tests.faces import FACES

ROOT = Path(__file__).parent.parent
LEAST = 60.0  # of lines of test functions, by public names and faces [%]: it may rise and must not fall
MOST_FACES = 36

FILES = {
    "regionik/__init__.py": '"""A package."""\n\n__all__ = ["walk"]\n',
    "regionik/walks.py": (
        '"""Walks."""\n\nfrom functools import lru_cache\nfrom regionik.worlds.steps import STEP, step\n\n\n'
        "@lru_cache\ndef walk():\n    # far\n    return step(\n        STEP\n    )\n"
        "\n\ndef _hidden():\n    return 1\n"
    ),
    "worlds/__init__.py": "",
    "worlds/steps.py": '"""Steps."""\n\nSTEP = 0.5\nNAMES = "a", "b"\n\n\ndef step(size):\n    return size\n',
    "planners/__init__.py": "",
    "tests/helping.py": "from regionik.worlds.steps import step\n\n\ndef stepped():\n    return step(1)\n",
    "tests/test_walks.py": (
        "from regionik.walks import _hidden, walk\nfrom tests.helping import stepped\n"
        "\n\ndef test_walk():\n    assert walk()\n\n\n"
        "def helper():\n    return _hidden()\n\n\ndef test_hidden():\n    assert helper()\n"
        "\n\ndef test_step():\n    assert stepped()\n"
        '\n\ndef test_patched(monkeypatch):\n    monkeypatch.delattr("regionik.walks._hidden")\n'
    ),
}


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def test_counts_of_a_known_tree(tree: Path) -> None:
    found = counts(tree)
    assert found["modules"] == 5
    assert found["lines of code"] == 1 + (2 + 2 + 3 + 2) + (2 + 2)  # comments and docstrings left out
    assert found["import depth"] == 2
    assert found["lru_cache and cache"] == 1
    assert found["module constants with a number"] == 1
    assert found["names without an underscore"] == 2
    assert found["names of regionik itself"] == 1
    assert found["% of lines of test functions by public names"] == pytest.approx(20.0)


def test_what_helpers_and_patches_use_is_used(tree: Path) -> None:
    step, hidden = "regionik.worlds.steps.step", "regionik.walks._hidden"
    shares = [shares_of_tests(tree, faces)[1] for faces in ((), (step,), (hidden,), (step, hidden))]
    assert shares == [20.0, 40.0, 80.0, 100.0]


def test_tests_go_through_public_names_and_a_few_faces() -> None:
    assert len(FACES) <= MOST_FACES
    assert all(hasattr(import_module(one.rpartition(".")[0]), one.rpartition(".")[2]) for one in FACES)
    assert shares_of_tests(ROOT, FACES)[1] >= LEAST


def test_two_trees_are_two_columns(
    tree: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.argv", ["counts", str(tree), str(tree)])
    main()
    row = next(line for line in capsys.readouterr().out.splitlines() if "modules" in line)
    assert row.split() == ["modules", "5", "5"]
