"""The table of speeds: its arithmetic, its two forms, and its groups on small sizes."""

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

from benchmarks.speed import __main__ as writer
from benchmarks.speed import areas, batch, solver
from benchmarks.speed.harness import Row, Size, Spread, Wanted, absent, against, counted, timed
from benchmarks.speed.report import as_json, as_markdown, machine, seconds

TINY = Size(rounds=3, share=0.001)


def spun(count: int) -> int:
    return sum(range(count))


def small(size: Size) -> Iterator[Row]:
    yield against("sum", "a longer sum", lambda: spun(1000), lambda: spun(20000), Wanted(5.0), size)
    yield timed("sum", "the clock", lambda: spun(100), Wanted(1e-9, at_least=False, unit="s"), size)
    yield counted("length", "the shortest", [1.0, 1.01, 1.5], Wanted(1.02, at_least=False, unit=""))
    yield absent("sum", "nobody", Wanted(2.0), "no such package")


def test_a_ratio_is_theirs_over_ours_for_one_piece() -> None:
    row = against(
        "sum", "a longer sum", lambda: spun(1000), lambda: spun(20000), Wanted(5.0), TINY, pieces=(1, 10)
    )
    assert row.ours is not None
    assert row.theirs is not None
    assert row.figure is not None
    assert 0.5 < row.figure.median < 10.0
    assert not Wanted(100.0).met(row.figure.median)
    assert row.figure.low <= row.figure.median <= row.figure.high
    assert row.figure.rounds == 3


@pytest.mark.parametrize(
    ("wanted", "figure", "met"),
    [
        (Wanted(2.0), 2.0, True),
        (Wanted(2.0), 1.99, False),
        (Wanted(1.1, at_least=False), 1.1, True),
        (Wanted(1.1, at_least=False), 1.2, False),
    ],
)
def test_a_row_is_met_by_its_median(wanted: Wanted, figure: float, met: bool) -> None:
    assert counted("a", "b", [0.0, figure, 9.0], wanted).met is met
    assert absent("a", "b", wanted, "gone").met is None
    assert counted("a", "b", [figure], None).met is None


def test_quartiles() -> None:
    assert Spread.of([4.0, 1.0, 2.0, 3.0, 5.0]) == Spread(3.0, 2.0, 4.0, 5)


@pytest.mark.parametrize(
    ("value", "text"),
    [(2.0, "2 s"), (3.5e-3, "3.5 ms"), (1.2345e-6, "1.23 µs"), (6.4e-8, "64 ns"), (0.0, "0 ns")],
)
def test_times_are_told_in_the_unit_that_suits(value: float, text: str) -> None:
    assert seconds(value) == text


def test_the_table_in_both_forms() -> None:
    groups = {"Sums": list(small(TINY))}
    data = json.loads(json.dumps(as_json(groups, machine())))
    assert [row["met"] for row in data["rows"]] == [True, False, True, None]
    assert all(row["group"] == "Sums" for row in data["rows"])
    assert data["machine"]["packages"]["numpy"] != "absent"
    text = as_markdown(groups, machine(), "# Speed\n")
    table = [line for line in text.splitlines() if line.startswith("|")]
    assert len(table) == 2 + 4
    assert {line.count("|") for line in table} == {8}
    assert [line.split("|")[-2].strip() for line in table[2:]] == ["met", "missed", "met", "-"]
    assert "- sum, nobody: absent: no such package" in text


def test_groups_left_out_are_kept_as_they_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, rows in (("first", small), ("second", lambda size: iter(list(small(size))[2:3]))):
        module = ModuleType(f"benchmarks.speed.{name}")
        module.__dict__["rows"] = rows
        monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setattr(writer, "GROUPS", {"first": "First", "second": "Second"})
    common = ["speed", "-o", str(tmp_path / "speed"), "--rounds", "2", "--share", "0.001"]
    monkeypatch.setattr(sys, "argv", [*common, "--only", "first"])
    writer.main()
    before = json.loads((tmp_path / "speed.json").read_text("utf-8"))["rows"]
    monkeypatch.setattr(sys, "argv", [*common, "--only", "second"])
    writer.main()
    after = json.loads((tmp_path / "speed.json").read_text("utf-8"))["rows"]
    assert after[:4] == before
    assert [row["group"] for row in after] == ["First"] * 4 + ["Second"]
    assert "## Second" in (tmp_path / "speed.md").read_text("utf-8")


def test_a_group_that_is_not_there_is_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["speed", "--only", "nobody"])
    with pytest.raises(SystemExit):
        writer.main()
    assert "no group nobody" in capsys.readouterr().err


def test_the_solver_against_others_on_small_sizes() -> None:
    rows = list(solver.rows(TINY))
    assert [row.rival for row in rows] == [*(name for name, *_ in solver.PEERS), "pytracik"]
    for row in rows:
        assert row.figure is None or row.figure.median > 0
        assert row.note


def test_batches_and_areas_on_small_sizes() -> None:
    rows = list(batch.rows(Size(rounds=2, share=0.02)))
    assert len(rows) == 3
    for row in rows:
        assert row.figure is not None
        assert row.figure.median > 0
    assert all("ours 100 %" in row.note for row in rows[:2])


def test_passes_with_shapely_are_the_solver_s_own() -> None:
    """`clamped` takes targets that both meet from one start, and asserts that their bases end together."""
    row = batch.clamped(Size(rounds=2, share=0.1))
    met, asked = (int(word) for word in row.note.split(" targets")[0].split(" of "))
    assert asked == 15
    assert met >= 12


@pytest.mark.slow
def test_a_long_path_is_planned_in_a_process_of_its_own() -> None:
    seconds, most = areas.planned_alone(300)
    assert seconds > 0
    assert 0 < most < 2  # GiB, of a path of 100,000 set-points
