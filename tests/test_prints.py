"""Prints of programs as slicers write them: each bead is laid with the nozzle down, and nothing else is."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from regionik.output.export import export
from regionik.pipeline import plan
from regionik.values import Plan
from regionik.verification.verifier import verify
from regionik.worlds.bundled import robot_named
from regionik.worlds.documents.world_file import load_world
from regionik.worlds.errors import FileNote
from regionik.worlds.robot import Robot
from tests.harness.rasters import carried
from tests.printed import beads_of, dense, extruded, farthest, printed
from tests.sliced import sliced

FED = "time", "extrusion", "extrusion_rate"
FLOOR = {"polygon": [[-3, -3], [5, -3], [5, 5], [-3, 5]]}
RULES = {"clearance": 0.05, "tool_contact": 0.1, "contact_depth": 0.035}


def print_of(program: str, robot: Robot, folder: Path, z: float = 0.0) -> Plan:
    """The plan of a program whose frame stands on the floor."""
    (folder / "part.gcode").write_text(program)
    asked = {
        "version": 1, "robot": "youbot", "floor": FLOOR, "rules": RULES,
        "speeds": {"base_velocity": 0.3, "tool_velocity": 0.05},
        "task": [
            {"gcode": "part.gcode", "frame": {"position": [0, 0, z]}, "direction": [0, 0, -1], "cone": 0.1}
        ],
    }  # fmt: skip
    (folder / "part.yaml").write_text(yaml.safe_dump(asked))
    with pytest.warns(FileNote, match="passed over"):
        world = load_world(folder / "part.yaml")
    found = plan(replace(world, robot=robot))
    assert verify(found).ok
    return found


def each_bead_is_printed(found: Plan, program: str, folder: Path, z: float = 0.0) -> None:
    """Each bead of the program is laid whole, with its filament, and the tool is on nowhere else."""
    export(found, folder / "rows.csv")
    pieces, beads = printed((folder / "rows.csv").read_text()), beads_of(program)
    assert len(pieces) == len(beads)
    allowed = found.world.rules.path_tolerance
    for piece, bead in zip(pieces, beads, strict=True):
        spots = piece[:, 1:4] - [0.0, 0.0, z]
        assert farthest(dense(bead.points), spots) < allowed
        assert farthest(spots, bead.points) < allowed
        assert extruded(piece, bead) == pytest.approx(bead.extruded, rel=0.02)
        assert piece[-1, 4] - piece[0, 4] == pytest.approx(bead.extruded, rel=1e-6)
    assert pieces[-1][-1, 4] == pytest.approx(sum(bead.extruded for bead in beads), rel=1e-6)
    ends = [(piece[0, 0], piece[-1, 0]) for piece in pieces]
    export(found, folder / "even.csv", rate=100.0)
    even = list(csv.DictReader((folder / "even.csv").read_text().splitlines()))
    for row in even:
        on = any(begin <= float(row["time"]) < end for begin, end in ends)
        assert row["tool_on"] == str(int(on))
        assert on or float(row["extrusion_rate"]) == 0.0
    time, fed, rate = np.array([[float(row[key]) for key in FED] for row in even]).T
    summed = np.concatenate([[0.0], np.cumsum(np.diff(time) * (rate[1:] + rate[:-1]) / 2)])
    assert np.abs(summed - fed).max() < 0.01 * fed[-1]


@pytest.mark.parametrize("kind", ["rrf"])
def test_each_bead_is_printed(kind: str, tmp_path: Path) -> None:
    program = sliced(kind, layers=1, moves=24, size=250.0, height=10.0)
    each_bead_is_printed(print_of(program, robot_named("youbot"), tmp_path), program, tmp_path)


DAILY = ("klipper", "UR10e")  # the others are as long


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "arm"),
    [
        pytest.param(kind, arm, marks=() if (kind, arm) == DAILY else pytest.mark.long)
        for kind in ("marlin", "klipper", "rrf")
        for arm in ("youbot", "UR10e")
    ],
)
def test_each_bead_of_a_print_is_printed(kind: str, arm: str, tmp_path: Path) -> None:
    robot, z = (carried(arm), 0.6) if arm == "UR10e" else (robot_named(arm), 0.0)
    program = sliced(kind, layers=2, moves=60, size=600.0, height=10.0)
    found = print_of(program, robot, tmp_path, z)
    assert found.lift_offs <= 3
    each_bead_is_printed(found, program, tmp_path, z)


@pytest.mark.slow
@pytest.mark.long
def test_fifty_thousand_moves_are_planned_as_layers(tmp_path: Path) -> None:
    program = sliced("rrf", layers=30, moves=835)
    found = print_of(program, robot_named("youbot"), tmp_path)
    assert (len(found.setpoints), found.lift_offs) == (50_160, 0)
    each_bead_is_printed(found, program, tmp_path)
