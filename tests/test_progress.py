"""Progress of stages: what is told, in which order, and to whom."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from regionik.pipeline import plan, why
from regionik.planners.progress import listening, tell, track
from regionik.worlds.documents.world_file import load_world

Row = tuple[str, int, int]


@given(st.lists(st.integers(), max_size=9), st.integers(0, 9))
def test_items_come_in_order_and_the_stage_ends(items: list[int], end: int) -> None:
    told: list[Row] = []
    with listening(lambda *row: told.append(row)):
        some = list[int]()
        for item in track("stage", items):
            if len(some) == end:
                break
            some.append(item)
    assert some == items[:end]
    assert told[-1] == ("stage", len(items), len(items))
    assert [done for _, done, _ in told[:-1]] == list(range(len(told) - 1))


def test_the_innermost_listener_hears_and_nobody_need_listen() -> None:
    outer: list[Row] = []
    inner: list[Row] = []
    tell("before", 0, 1)
    with listening(lambda *row: outer.append(row)):
        with listening(None):
            tell("one", 0, 1)
        with listening(lambda *row: inner.append(row)):
            tell("two", 0, 1)
        tell("three", 0, 1)
    assert (outer, inner) == ([("one", 0, 1), ("three", 0, 1)], [("two", 0, 1)])


def assert_stages_end(told: list[Row]) -> None:
    last = {stage: (done, total) for stage, done, total in told}
    assert all(done == total for done, total in last.values()), last
    for (one, a, n), (other, b, m) in pairwise(told):
        assert one != other or n != m or b >= a or b == 0  # on and on, or anew


def test_every_stage_of_a_plan_tells_how_far_it_is() -> None:
    told: list[Row] = []
    found = plan(load_world("free"), progress=lambda *row: told.append(row))
    stages = {stage for stage, _, _ in told}
    assert {"headings", "configurations", "run", "motion", "verify", "smoothing", "rounds"} <= stages
    assert sum(stage == "run" for stage, _, _ in told) > len(found.setpoints)  # as it grows
    assert ("motion", len(found.setpoints), len(found.setpoints)) in told
    assert_stages_end(told)


def test_causes_are_told_before_repairs_and_sentences_as_they_are_known() -> None:
    world = load_world("pillar")
    task = (replace(world.task[0], position=np.array([0.5, 0.0, 0.7])),)
    told: list[Row] = []
    said: list[str] = []
    why(replace(world, task=task), say=said.append, progress=lambda *row: told.append(row))
    stages = list(dict.fromkeys(stage for stage, _, _ in told))
    assert stages.index("causes") < stages.index("repairs")
    assert len(said) >= 3
    assert said[-1].startswith("This would mend it")
    assert_stages_end(told)
