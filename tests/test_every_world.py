"""Every bundled world goes the whole way by the command: plan, verify, retime, every export, show."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from regionik.cli.app import run
from regionik.cli.plan import EXPORT_FORMATS
from regionik.worlds.bundled import world_names
from tests.planned import planned

SUFFIXES = {"csv": ".csv", "geojson": ".geojson", "urdf": ".urdf", "path": ".json", "ros2-folder": ""}
QUICK = ("free", "tao3")  # the others take minutes together


@pytest.mark.parametrize(
    "name", [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in world_names()]
)
def test_a_bundled_world_goes_the_whole_way(name: str, tmp_path: Path) -> None:
    def done(*arguments: object) -> bool:
        return run([str(argument) for argument in arguments]) == 0

    plan, timed = tmp_path / "plan.json", tmp_path / "timed.json"
    if name in QUICK:
        assert done("plan", name, "-o", plan, "--html", tmp_path / "plan.html")
    else:  # the plan that other tests have too: the command adds the files alone
        planned(name).save(plan)
    assert done("verify", plan, "--world", name)
    assert done("retime", plan, "-o", timed)
    assert done("verify", timed, "--world", name)
    assert json.loads(timed.read_bytes())["stats"]["timing"]["duration"] > 0
    for kind in EXPORT_FORMATS:
        written = tmp_path / f"{kind}{SUFFIXES.get(kind, '.yaml')}"
        assert done("export", timed, "--format", kind, "-o", written), kind
        assert written.exists()
    for shown in (plan, timed, name):
        page = tmp_path / f"{Path(str(shown)).stem}.shown.html"
        assert done("show", shown, "-o", page)
        assert "<title>" in page.read_text(encoding="utf-8")
