"""The page of whole jobs: its two forms, sides run apart, and how a loop's states are judged."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import regionik as rik
from benchmarks.page import __main__ as writer
from benchmarks.page.outcomes import NOTHING, PROVEN, STATES, Job, Outcome, Topic, planned
from benchmarks.page.rasters import as_plan
from regionik.worlds.documents.world_file import load_world
from tests.harness.rasters import carried, raster
from tests.planned import planned as bundled_plan

OURS, THEIRS = Outcome(20.0, "planned", PROVEN), Outcome(2.0, "follows", STATES)
CITED = Outcome(None, "2 reconfigurations", NOTHING)


def few() -> dict[str, Topic]:
    won = Topic("Won", "A job.", [Job("wall", {"ours": THEIRS, "theirs": OURS})])
    lost = Topic("Lost", "Another.", [Job("panel", {"ours": OURS, "theirs": THEIRS, "cited": CITED})])
    return {"won": won, "lost": lost}


def written_by(monkeypatch: pytest.MonkeyPatch, out: Path, *words: str) -> str:
    monkeypatch.setattr(writer, "topics", lambda data: few())
    monkeypatch.setattr(sys, "argv", ["page", "-o", str(out), *words])
    writer.main()
    return out.with_suffix(".md").read_text("utf-8")


def test_losses_stand_as_wins_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = written_by(monkeypatch, tmp_path / "page")
    rows = [line for line in text.splitlines() if line.startswith("| ") and "processor time" not in line]
    assert rows == [
        "| wall | ours | 2 s | follows | collision-checked states |",
        "| wall | theirs | 20 s | planned | proven motion |",
        "| panel | ours | 20 s | planned | proven motion |",
        "| panel | theirs | 2 s | follows | collision-checked states |",
        "| panel | cited | not run here | 2 reconfigurations | nothing |",
    ]
    assert "missed" not in text
    assert "µs" not in text


def test_topics_left_out_are_kept_as_they_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out = tmp_path / "page"
    assert "## Lost" not in written_by(monkeypatch, out, "--only", "won")
    before = json.loads(out.with_suffix(".json").read_text("utf-8"))["won"]
    text = written_by(monkeypatch, out, "--only", "lost")
    assert json.loads(out.with_suffix(".json").read_text("utf-8"))["won"] == before
    assert text.index("## Won") < text.index("## Lost")


def test_a_topic_that_is_not_there_is_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["page", "--only", "nobody"])
    with pytest.raises(SystemExit):
        writer.main()
    assert "no topic nobody; there are rasters, placement, growth" in capsys.readouterr().err


def test_a_side_that_fails_says_why_in_its_row() -> None:
    found = writer._apart("rasters", 0, "nobody", None)
    assert found == Outcome(None, "KeyError: 'nobody'", NOTHING)


def test_the_page_of_the_repository_is_of_jobs_that_there_are() -> None:
    rows = json.loads(Path("docs/benchmarks.json").read_text("utf-8"))
    known = writer.topics(None)
    assert list(rows) == list(known)
    for name, topic in known.items():
        assert {row["job"] for row in rows[name]} == {job.what for job in topic.jobs}
    text = Path("docs/benchmarks.md").read_text("utf-8")
    assert all(f"## {topic.title}" in text for topic in known.values())


def test_what_has_no_plan_is_no_proof_unless_it_is_one() -> None:
    assert planned(load_world("free")).proves == PROVEN
    high = raster(carried("UR10e"), "open", 2, 1, 4.0)
    assert planned(high).proves == "proven that it cannot be done"


def test_states_of_a_loop_are_judged_by_their_motion() -> None:
    plan = bundled_plan("free")
    first = int(np.argmax(np.array(plan.motion.kind) == "setpoint"))
    states = np.hstack([plan.motion.base, plan.motion.joints])[first:]
    met = np.flatnonzero(np.array(plan.motion.kind)[first:] == "setpoint").tolist()
    world = replace(plan.world, start=None)
    assert {one.kind for one in rik.verify(as_plan(world, states, met)).violations} <= {"derived"}
    states[met[1]] += 0.3
    assert {one.kind for one in rik.verify(as_plan(world, states, met)).violations} > {"derived"}


def test_the_loop_follows_a_short_raster() -> None:
    pytest.importorskip("mink")
    from benchmarks.page.differential_loop import followed

    world = raster(carried("UR10e"), "open", 4, 2)
    states, met, _ = followed(world)
    assert len(met) == len(world.task)
    assert {one.kind for one in rik.verify(as_plan(world, states, met)).violations} <= {"derived"}
