"""What a plan prints beside what its program asks: both are read here with nothing of regionik.

A program is followed through G0 and G1 alone; a plan is the table that `regionik.export` writes of it.
"""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tests.maths import Array

WORD = re.compile(r"([GMXYZEF])(-?\d+(?:\.\d+)?)")


@dataclass(frozen=True)
class Bead:
    """Points one after the other (n, 3) [m], and what is extruded on the way [mm of filament]."""

    points: Array
    extruded: float

    @property
    def length(self) -> float:
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())


def beads_of(program: str) -> list[Bead]:
    """The beads that a printer lays that follows a program: moves on which E grows, one after the other."""
    at, fed, absolute = np.full(3, np.nan), 0.0, True
    beads: list[tuple[list[Array], float]] = []
    laying = False
    for line in program.splitlines():
        words = dict(WORD.findall(line.partition(";")[0])) if re.match(r"[GM]\d", line) else {}
        code = re.match(r"[GM]\d+", line)
        if code and code[0] in ("M82", "M83"):
            absolute = code[0] == "M82"
        if code and code[0] == "G91":
            break  # footers alone move so
        if code and code[0] == "G92":
            fed = float(words["E"])
        if not code or code[0] not in ("G0", "G1"):
            continue
        more = float(words.get("E", fed if absolute else 0.0)) - (fed if absolute else 0.0)
        fed += more
        to = np.array([float(words[axis]) / 1000 if axis in words else at[k] for k, axis in enumerate("XYZ")])
        if more > 0 and not np.array_equal(to, at, equal_nan=True):
            beads += [] if laying else [([at], 0.0)]
            points, sum_ = beads[-1]
            beads[-1] = [*points, to], sum_ + more
        if not np.array_equal(to, at, equal_nan=True):
            laying = more > 0
        at = to
    return [Bead(np.array(points), sum_) for points, sum_ in beads]


def printed(table: str) -> list[Array]:
    """What a plan lays: time, place of the tool and what is fed (n, 5) of each piece that it is on for."""
    pieces: list[list[list[float]]] = []
    on = False
    for row in csv.DictReader(table.splitlines()):
        spot = [float(row[key]) for key in ("time", "tool_x", "tool_y", "tool_z", "extrusion")]
        if on:
            pieces[-1].append(spot)
        if row["tool_on"] == "1" and not on:
            pieces.append([spot])
        on = row["tool_on"] == "1"
    return [np.array(piece) for piece in pieces]


def extruded(piece: Array, bead: Bead) -> float:
    """What comes out over a piece, of a nozzle that feeds as much a length as the bead has [mm]."""
    speeds = np.linalg.norm(np.diff(piece[:, 1:4], axis=0), axis=1) / np.maximum(np.diff(piece[:, 0]), 1e-12)
    return float((speeds * np.diff(piece[:, 0])).sum()) * bead.extruded / bead.length


def farthest(points: Array, line: Array) -> float:
    """The largest distance of points (n, 3) from a line through others (m, 3) [m]."""
    nearest = np.full(len(points), np.inf)
    for a, b in pairwise(line):
        along = b - a
        share = np.clip((points - a) @ along / max(float(along @ along), 1e-300), 0.0, 1.0)
        nearest = np.minimum(nearest, np.linalg.norm(points - a - share[:, None] * along, axis=1))
    return float(nearest.max())


def dense(line: Array, step: float = 0.002) -> Array:
    """Points along a line through others, so far apart at most [m]."""
    parts = [
        a + np.linspace(0, 1, 1 + int(np.ceil(np.linalg.norm(b - a) / step)))[:, None] * (b - a)
        for a, b in pairwise(line)
    ]
    return np.concatenate(parts)
