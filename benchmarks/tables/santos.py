"""Tables 2 to 6 and experiment 4 of Santos et al. (IEEE Access 2020), M-FABRIK.

Scenes that the paper only draws are those of the bundled worlds `free`, `pillar`, `wall` and `l_shape`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from benchmarks.tables import santos_printed as printed
from benchmarks.tables.santos_runs import (
    HIGH,
    LOW,
    OURS,
    RUNS,
    SMALL_STEPS,
    WIDE,
    Followed,
    Row,
    at_random,
    experiment,
    experiment_1,
    pruned_components,
    times_at_random,
)
from benchmarks.tables.table import Table, ahead
from regionik.worlds.arrays import Array


def tables() -> list[Table]:
    """Tables 2 to 6, and experiment 4."""
    followed = experiment_1()
    return [table_2(), table_3(), table_4(followed), table_5(followed), table_6(), experiment_4()]


def table_2() -> Table:
    """Times over random targets."""
    ours = [times_at_random(accuracy) for accuracy in printed.ACCURACIES]
    unit, theirs = ours[0][OURS], printed.TABLE_2[0][2]
    rows = (
        (
            f"{1000 * accuracy:g}",
            *(f"{value:.5f} ({value / theirs:.2f})" for value in row),
            *(f"{time / unit:.2f}" for time in measured.values()),
        )
        for accuracy, row, measured in zip(printed.ACCURACIES, printed.TABLE_2, ours, strict=True)
    )
    return Table(
        "Table 2",
        f"time for {RUNS} random targets",
        ("Accuracy [mm]", *(f"paper: {name} [s]" for name in printed.METHODS), *_ours(ours[0])),
        tuple(rows),
        (
            "In brackets, and for ours: as a multiple of M-FABRIK's time at 1 mm in the same run.",
            "Ours is one compiled call for all targets, the same for every method.",
            ahead(OURS, ours[0], "time at 1 mm"),
            "The paper's rivals go in small steps, each 0.0508 of a full one, as table 3 says. Ours are "
            "compiled as M-FABRIK is and take full ones, halved where they do not help, but for one column; "
            "the base is two more joints, and does not turn.",
        ),
    )


def table_3() -> Table:
    """Iterations over random targets."""
    ours = [at_random(accuracy) for accuracy in printed.ACCURACIES]
    rows = (
        (
            f"{1000 * accuracy:g}",
            *(f"{value:.2f}" for value in row),
            *(f"{batch.iterations.mean():.2f}" for batch in measured.values()),
        )
        for accuracy, row, measured in zip(printed.ACCURACIES, printed.TABLE_3, ours, strict=True)
    )
    met = ", ".join(
        f"{name} {min(int(row[name].converged.sum()) for row in ours)} of {RUNS}" for name in ours[0]
    )
    return Table(
        "Table 3",
        f"mean iterations for {RUNS} random targets",
        ("Accuracy [mm]", *(f"paper: {name}" for name in printed.METHODS), *_ours(ours[0])),
        tuple(rows),
        (
            "The paper gives neither its chain nor where targets and starts lie, and the rate depends almost "
            f"only on the target's height over the shoulder. Ours: x and y within {WIDE:g} m, heights of "
            f"{LOW:g} to {HIGH:g} m, start postures from the arm's limits, which are then ignored.",
            f"Targets met at every accuracy: {met}.",
            ahead(
                OURS, {name: batch.iterations.mean() for name, batch in ours[0].items()}, "iterations at 1 mm"
            ),
        ),
    )


def table_4(followed: Mapping[str, Followed]) -> Table:
    """Times of experiment 1."""
    unit = followed[OURS].seconds.mean()
    theirs = np.mean(printed.TABLE_4, axis=0)[2]
    ours = np.array([way.seconds for way in followed.values()]).T
    figures = np.array(printed.TABLE_4)
    rows = [
        (str(k), *_over(row, theirs), *(f"{time / unit:.2f}" for time in times))
        for k, (row, times) in enumerate(zip(figures, ours, strict=True), 1)
    ]
    total = (
        "total",
        *_over(np.array(printed.TABLE_4_TOTAL), theirs),
        *(f"{time / unit:.2f}" for time in ours.sum(0)),
    )
    speedup = printed.TABLE_4_TOTAL[0] / printed.TABLE_4_TOTAL[2]
    slower, small = ours.sum(0) / ours.sum(0)[-1], list(followed).index(SMALL_STEPS)
    return Table(
        "Table 4",
        "experiment 1, time for each set-point",
        ("Set-point", *(f"paper: {name} [s]" for name in printed.METHODS), *_ours(followed)),
        (*rows, total),
        (
            "In brackets, and for ours: as a multiple of M-FABRIK's mean time in the same run.",
            f"The paper's text makes M-FABRIK about 47 times faster than the pseudo-inverse; its totals say "
            f"{speedup:.1f}. Ours takes {slower[small]:.1f} times M-FABRIK's time in small steps, "
            f"{slower[0]:.1f} times in full ones.",
            "Ours are single calls from Python; what a call costs is most of every time here, and more for "
            "the rivals.",
            ahead(OURS, {name: way.seconds.sum() for name, way in followed.items()}, "total time"),
        ),
    )


def table_5(followed: Mapping[str, Followed]) -> Table:
    """Iterations of experiment 1."""
    ours = np.array([[one.iterations for one in way.found] for way in followed.values()]).T
    rows = [
        (str(k), *map(str, row), *map(str, counts))
        for k, (row, counts) in enumerate(zip(printed.TABLE_5, ours.tolist(), strict=True), 1)
    ]
    planned = sum(row.iterations or 0 for row in experiment("free"))
    total = ("total", *map(str, printed.TABLE_5_TOTAL), *map(str, ours.sum(0).tolist()))
    return Table(
        "Table 5",
        "experiment 1, iterations for each set-point",
        ("Set-point", *(f"paper: {name}" for name in printed.METHODS), *_ours(followed)),
        (*rows, total),
        (
            "The path and the first posture are read off a drawing (world `free`): counts at single "
            "set-points differ. No area holds the base here; a plan of the world, whose areas keep 5 mm "
            f"from the ends of the reach, takes {planned} iterations.",
            ahead(OURS, dict(zip(followed, ours.sum(0).tolist(), strict=True)), "iterations in all"),
        ),
    )


def table_6() -> Table:
    """Iterations of experiments 2 and 3."""
    pillar, wall = experiment("pillar"), experiment("wall")
    away = [1000 * row.miss for row in pillar if row.iterations is None]
    between = sum(figure[2] for figure in printed.TABLE_6_EXPERIMENT_2[10:13])
    added = sum(figure[1] for figure in printed.TABLE_6_EXPERIMENT_3)
    return Table(
        "Table 6",
        "experiments 2 and 3",
        ("Experiment", "Set-point", "paper: time [s]", "paper: iterations", "ours: iterations"),
        (
            *_beside("2", printed.TABLE_6_EXPERIMENT_2, printed.TABLE_6_TOTALS[0], pillar),
            *_beside("3", printed.TABLE_6_EXPERIMENT_3, printed.TABLE_6_TOTALS[1], wall),
        ),
        (
            "Scenes are read off drawings (worlds `pillar`, `wall`): counts at single set-points differ.",
            "At set-point 11 of experiment 2 the base goes round the obstacle: three intermediate "
            "configurations, in the paper and in ours. From ours the target is out of reach by "
            f"{min(away):.0f} to {max(away):.0f} mm, so the arm is carried; to iterate there, as the "
            f"pseudo-code says, would move the base away again. {between} iterations of the paper's total "
            "are theirs.",
            "In experiment 3 ours goes round a corner of the corridor before set-points 12 and 13, where the "
            "paper lists nothing; from there the tool would point out of its cone.",
            f"The paper's times of experiment 3 add up to {added:.6f} s, 1e-6 s more than its total.",
        ),
    )


def experiment_4() -> Table:
    """The path whose areas were made in advance, which the paper tells in two sentences."""
    pruned, rows = pruned_components("l_shape"), experiment("l_shape")
    at_setpoints = {row.setpoint: row.iterations or 0 for row in rows}  # the last of each; others lead there
    every = len(pruned)
    cut = every - int(pruned.sum())
    return Table(
        "Experiment 4",
        "areas of the whole path made in advance",
        ("", "paper", "ours"),
        (
            ("set-points", "–", str(len(at_setpoints))),
            (
                "components that lead nowhere, cut before anything moves",
                "drawn",
                f"{cut} of {every}",
            ),
            ("iterations of a configuration, mean", "4", f"{np.mean(list(at_setpoints.values())):.2f}"),
            ("time of a configuration, mean [s]", "0.009", "–"),
        ),
        ("The scene is read off a drawing (world `l_shape`); the paper tells neither path nor areas.",),
    )


def _beside(
    number: str, figures: Sequence[tuple[int, float, int]], total: tuple[float, int], ours: Sequence[Row]
) -> list[tuple[str, ...]]:
    """The rows of one experiment; intermediate configurations stand before the one at the set-point."""
    rows: list[tuple[str, ...]] = []
    for i in range(1, ours[-1].setpoint + 1):
        theirs = [(f"{time:.7f}", str(count)) for k, time, count in figures if k == i]
        mine = [row.iterations for row in ours if row.setpoint == i]
        theirs = [("–", "–")] * (len(mine) - len(theirs)) + theirs
        told = ["carried" if count is None else str(count) for count in mine]
        rows += [(number, str(i), *a, b) for a, b in zip(theirs, told, strict=True)]
    taken = sum(row.iterations or 0 for row in ours)
    return [*rows, (number, "total", f"{total[0]:.7f}", str(total[1]), str(taken))]


def _ours(measured: Mapping[str, Any]) -> tuple[str, ...]:
    return tuple(f"ours: {name}" for name in measured)


def _over(row: Array, unit: float) -> tuple[str, ...]:
    return tuple(f"{value:.7f} ({value / unit:.2f})" for value in row.tolist())
