"""Values show themselves: a line each, in notebooks a picture and some lines, and floors in axes."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import regionik as rik
from regionik.view.page import as_html, facts

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="module")
def values() -> dict[str, Any]:
    world = rik.load_world("free")
    return {
        "World": world,
        "Area": rik.admissible_area(world, world.task[0]),
        "Answer": rik.reach(world, [[0.5, 0.0, 0.3], [0.0, 0.0, 3.0]]),
        "Plan": rik.plan(world),
        "Stops": rik.stops("pillar"),
        "Field": rik.reach_field(world, [[0.5, 0.0, 0.3], [0.0, 0.0, 3.0]], cell=0.2),
    }


def test_every_value_is_one_line(values: dict[str, Any]) -> None:
    world, plan = values["World"], values["Plan"]
    more = [
        world.robot,
        world.floor,
        world.rules,
        world.task[0],
        plan.motion,
        plan.areas[0],
        rik.verify(plan),
    ]
    for value in [*values.values(), *more, rik.Solver(world.robot), rik.Speeds(), rik.Criteria()]:
        text = repr(value)
        assert text.startswith(type(value).__name__)
        assert "\n" not in text
        assert len(text) < 300


@pytest.mark.parametrize("name", ["World", "Area", "Answer", "Plan", "Stops", "Field"])
def test_notebooks_show_a_picture_and_some_lines(name: str, values: dict[str, Any]) -> None:
    page = ElementTree.fromstring(as_html(values[name]))
    assert [part.tag.rpartition("}")[2] for part in page] == ["svg", "pre"]
    lines = (page[1].text or "").splitlines()
    assert lines == facts(values[name])[: len(lines)]
    assert lines


def test_an_explanation_shows_its_reason_causes_and_repairs() -> None:
    found = rik.why("pillar", [1.3, 0.1, 0.9])
    assert found is not None
    (lines,) = ElementTree.fromstring(as_html(found))
    told = (lines.text or "").splitlines()
    assert told[0] == found.reason
    assert f"because of reach: {found.causes[0].name}" in told
    assert told[-1].removeprefix("- ") in {repair.text for repair in found.repairs}


def test_the_time_of_a_plan_is_told_only_where_it_is_timed(values: dict[str, Any]) -> None:
    plan = values["Plan"]
    assert "not timed" in facts(plan)
    timed = rik.retime(plan, rik.Speeds(base_velocity=0.5, joint_velocity=1.0))
    assert f"{timed.motion.time[-1]:.1f} s" in facts(timed)


@pytest.mark.parametrize("name", ["World", "Area", "Answer", "Plan", "Stops", "Field"])
def test_floors_are_drawn_into_axes(name: str, values: dict[str, Any]) -> None:
    axes = Figure().add_subplot()
    assert rik.plot_floor(values[name], axes) is axes
    assert axes.lines
    assert isinstance(rik.plot_floor(values[name]), Axes)


def test_only_a_plan_has_a_path_of_the_tool(values: dict[str, Any]) -> None:
    def keys(value: Any) -> set[str]:
        legend: Any = rik.plot_floor(value, Figure().add_subplot()).get_legend()
        return {text.get_text() for text in legend.get_texts() if "tool" in text.get_text()}

    assert keys(values["World"]) == {"tool path asked for"}
    assert keys(values["Plan"]) == {"path of the tool"}
    assert keys(values["Area"]) == set()  # of one target


def test_a_world_without_a_task_is_drawn_too(values: dict[str, Any]) -> None:
    bare = replace(values["World"], task=(), start=None)
    assert rik.plot_floor(bare).get_xlim()[0] <= bare.floor.polygon.bounds[0]
    assert "<svg" in as_html(bare)


def test_an_area_lies_where_its_axes_show_it(values: dict[str, Any]) -> None:
    axes, area = rik.plot_floor(values["Area"]), values["Area"].inner
    (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()
    low_x, low_y, high_x, high_y = area.bounds
    assert x0 <= low_x < high_x <= x1
    assert y0 <= low_y < high_y <= y1
    legend = axes.get_legend()
    assert legend is not None
    assert "admissible area" in {text.get_text() for text in legend.get_texts()}
    assert np.isclose(axes.get_aspect(), 1.0)


def test_ipython_shows_html() -> None:
    code = (
        "from IPython.core.interactiveshell import InteractiveShell\n"
        "shell = InteractiveShell.instance()\n"
        "import regionik as rik\n"
        "data, _ = shell.display_formatter.format(rik.load_world('free'))\n"
        "print(sorted(data), '<svg' in data['text/html'])\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "['text/html', 'text/plain'] True"
