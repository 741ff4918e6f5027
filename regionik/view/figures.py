"""Figures of plans, stops and reach fields; the only file that imports matplotlib."""

from __future__ import annotations

import io
import os
from collections.abc import Callable, Sequence
from pathlib import Path as FilePath
from typing import Any, TypeAlias

import matplotlib.style
import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path
from matplotlib.ticker import MaxNLocator
from shapely.geometry.base import BaseGeometry

from regionik.reachability.field import Field, SliceValue
from regionik.regions import Area
from regionik.storage.files import write_atomic
from regionik.values import Answer, Plan, Stop, Stops
from regionik.view.floor_view import (
    ZONE_WORDS,
    FloorView,
    floor_view,
    seen_from_above,
    stops_floor,
    window,
    zoned_floor,
)
from regionik.view.options import VIEW
from regionik.view.picture import Color, count_noun
from regionik.view.timeline import PlanCurves, plan_curves
from regionik.view.world_picture import AXES_WORDS, TURNING_WORDS
from regionik.worlds.arrays import Array
from regionik.worlds.errors import InputError
from regionik.worlds.scene import World

OPTIONS = VIEW.curves
OnFloor: TypeAlias = Plan | Stops | World | Area | Field | Answer

SUFFIXES = (".svg", ".png")
_HEAD: dict[str, Any] = {"fontsize": 13, "fontweight": "bold"}
_STYLE = {
    "axes.axisbelow": True, "axes.edgecolor": "#5f6b76", "axes.grid": True, "axes.labelsize": 9,
    "axes.spines.right": False, "axes.spines.top": False, "axes.titlelocation": "left", "axes.titlesize": 10,
    "figure.constrained_layout.h_pad": 0.08, "figure.constrained_layout.use": True,
    "font.size": 9, "grid.alpha": 0.35, "grid.linewidth": 0.5, "lines.linewidth": 1.2,
    "legend.columnspacing": 1.4, "legend.fontsize": 8.5, "legend.frameon": False, "legend.handlelength": 1.6,
    "svg.hashsalt": "regionik",  # without it names inside the file differ from run to run
    "xtick.labelsize": 8, "ytick.labelsize": 8,
}  # fmt: skip


def plot(plan: Plan, path: str | os.PathLike[str]) -> None:
    """Draw a plan into a file: joints, speeds and clearance along the way, and the floor.

    Curves of an untimed plan run over the numbers of its states, without speeds. The same plan gives the
    same bytes.

    Parameters
    ----------
    plan : Plan
    path : path
        Ends in ``.svg`` or ``.png``; written whole or not at all.

    Raises
    ------
    InputError
        When the path ends otherwise, or the file cannot be written.
    """
    _save(lambda: _figure(plan), path)


def plot_stops(world: World, stops: Sequence[Stop], path: str | os.PathLike[str]) -> None:
    """Draw the stops of a world on its floor into an ``.svg`` or ``.png`` file."""

    def made() -> Figure:
        floor = stops_floor(world, stops)
        figure = Figure(figsize=(OPTIONS.floor_width, _floor_height(floor) + 0.7))
        served, asked = sum(len(stop.setpoints) for stop in stops), len(world.task)
        some = f"{served} of " * (served < asked)
        facts = f"{some}{count_noun(asked, 'set-point')}, {count_noun(len(stops), 'stop')}"
        figure.suptitle(f"{world.name}: {facts}", **_HEAD)
        _floor(figure.add_subplot(), floor)
        return figure

    _save(made, path)


def plot_floor(what: OnFloor, axes: Axes | None = None) -> Axes:
    """Draw the floor of a plan, stops, a world, an area, a reach field or answers, seen from above.

    Parameters
    ----------
    what : Plan, Stops, World, Area, Field or Answer
        Of answers targets and bases are drawn, as they do not know their world.
    axes : matplotlib Axes, optional
        By default those of a new figure.

    Returns
    -------
    matplotlib Axes
    """
    drawn = axes or Figure(figsize=(OPTIONS.floor_width, OPTIONS.floor_width)).add_subplot()
    if isinstance(what, Answer):
        _answers(drawn, what)
    elif isinstance(what, Field):
        _field(drawn, what)
    else:
        _floor(drawn, floor_view(what))
    return drawn


def floor_image(what: OnFloor) -> str:
    """Return the floor as SVG, for pages."""

    def made() -> Figure:
        figure = Figure(figsize=(OPTIONS.floor_width, OPTIONS.floor_width))
        axes = plot_floor(what, figure.add_subplot())
        shape = float(np.clip(np.ptp(axes.get_ylim()) / np.ptp(axes.get_xlim()), 0.2, 1.2))
        figure.set_figheight((OPTIONS.floor_width - 0.8) * shape + 1.6)  # and room for the legend
        return figure

    return _render(made, ".svg").decode("utf-8")


def _answers(ax: Axes, answer: Answer) -> None:
    """Targets by their verdict, and the bases found."""
    ax.plot(*answer.base[answer.reachable, :2].T, ".", color=_hex(Color.AXIS_PATH), label="base")
    colors = {"reachable": Color.STRONG, "unreachable": Color.REJECTION, "undecided": Color.PALE}
    for verdict, color in colors.items():
        spots = answer.targets[answer.verdict == verdict]
        if len(spots):
            ax.plot(*spots[:, :2].T, "o", color=_hex(color), label=verdict)
    ax.set(aspect="equal", adjustable="datalim", xlabel="x [m]", ylabel="y [m]")
    _legend(ax)


def _save(figure: Callable[[], Figure], path: str | os.PathLike[str]) -> None:
    suffix = FilePath(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"{path}: expected a file name ending in {', '.join(SUFFIXES)}")
    write_atomic(path, _render(figure, suffix))


def field_image(field: Field, suffix: str) -> bytes:
    """Return the bytes of an ``.svg`` or ``.png`` file of a reach field, the same for the same field."""
    return _render(lambda: _field_figure(field), suffix)


def _render(make: Callable[[], Figure], suffix: str) -> bytes:
    data = io.BytesIO()
    with matplotlib.style.context(["default", _STYLE]):  # independent of the user's own settings
        figure = make()
        _fix_layout(figure)
        figure.savefig(data, format=suffix[1:], dpi=130, metadata={"Date": None} if suffix == ".svg" else {})
    return data.getvalue()


def _field_figure(field: Field) -> Figure:
    low, high = _window_of(field)
    deep = (OPTIONS.floor_width - 1.2) * float(np.clip((high[1] - low[1]) / (high[0] - low[0]), 0.2, 2.0))
    figure = Figure(figsize=(OPTIONS.floor_width, deep + 1.8))
    _field(figure.add_subplot(), field)
    return figure


def _window_of(field: Field) -> tuple[Array, Array]:
    """Corners of what is shown of a field: all that is not zero, its targets and the floor about them."""
    floor, half = field.scene.floor.polygon, field.cell / 2
    rows, columns = np.nonzero(field.values)
    points = np.column_stack([field.x[columns], field.y[rows]])
    shown = [points - half, points + half, field.targets[:, :2], shapely.get_coordinates(floor)]
    return window(floor, shown)


def _field(ax: Axes, field: Field) -> None:
    """A field over its floor, with solids and targets."""
    floor, task = field.scene.floor.polygon, field.targets[:, :2]
    key: list[Patch | Line2D] = []
    _area(ax, floor, facecolor=_hex(Color.FLOOR), zorder=0)
    edge = shapely.get_coordinates(floor.exterior).T
    key += ax.plot(*edge, color=_hex(Color.ROBOT), linewidth=0.9, zorder=2, label="edge of the floor")
    key += _field_values(ax, field)
    solids = seen_from_above(field.scene)
    for label, area, color in (
        (ZONE_WORDS, zoned_floor(field.scene), Color.ZONE),
        ("obstacles", solids, Color.SOLID),
    ):
        if not area.is_empty:
            _area(ax, area, facecolor=_hex(color), zorder=3)
            key.append(Patch(facecolor=_hex(color), label=label))
    if len(task):
        key += _dots(ax, task, zorder=4, label="targets")
    title = field.meaning.partition(":")[0]  # of a slice, the legend names its values
    _finish_floor(ax, f"{field.world}: {title}", *_window_of(field), key, ncols=5)


def _field_values(ax: Axes, field: Field) -> list[Patch]:
    """Draw the cells that are not zero: counts by a scale up to the largest, verdicts by a legend."""
    half = field.cell / 2
    edges = (field.x[0] - half, field.x[-1] + half, field.y[0] - half, field.y[-1] + half)
    place: dict[str, Any] = {"origin": "lower", "extent": edges, "interpolation": "nearest"}
    if field.height is None:
        most = max(1, int(field.values.max(initial=0)))
        counts = np.ma.masked_equal(field.values, 0)
        shown = ax.imshow(counts, cmap="viridis", vmin=min(1, most - 1), vmax=most, **place)
        scale = ax.figure.colorbar(shown, cax=ax.inset_axes((1.04, 0.0, 0.04, 1.0)), label="targets reached")
        scale.ax.yaxis.set_major_locator(MaxNLocator(8, integer=True))
        return []
    key = []
    verdicts = (
        (SliceValue.UNDECIDED, "undecided", Color.TURNING),
        (SliceValue.REACHABLE, "reachable", Color.STRONG),
    )
    for value, label, color in verdicts:
        if (field.values == value).any():
            cells = np.ma.masked_not_equal(field.values, value)
            ax.imshow(cells, cmap=ListedColormap([_hex(color)]), **place)
            key.append(Patch(facecolor=_hex(color), label=label))
    return key


def _figure(plan: Plan) -> Figure:
    curves, floor, dof = plan_curves(plan), floor_view(plan), plan.world.robot.chain.dof
    panels, high = 2 if curves.timed else 1, _floor_height(floor)
    wide = OPTIONS.joints_width * panels + OPTIONS.floor_width
    figure = Figure(figsize=(wide, max(1.3 * dof, high + OPTIONS.row_height * panels) + 0.7))
    facts = [count_noun(len(plan.setpoints), "set-point"), count_noun(plan.lift_offs, "lift-off")]
    untimed = f"{count_noun(len(plan.motion), 'state')}, not timed"
    facts.append(f"{curves.states[-1]:.1f} s" if curves.timed else untimed)
    figure.suptitle(f"{plan.world.name}: {', '.join(facts)}", **_HEAD)
    sides = figure.add_gridspec(1, 2, width_ratios=[OPTIONS.joints_width * panels, OPTIONS.floor_width])
    _joints(figure, sides[0], plan, curves)
    ticks = Line2D([], [], color=_hex(Color.AHEAD), marker="|", markersize=7, ls="", label="set-points")
    beyond = Patch(facecolor=_hex(Color.SOLID), alpha=OPTIONS.limit_opacity, label="beyond the limits")
    lifted = Patch(facecolor=_hex(Color.LIFTED), alpha=OPTIONS.lifted_opacity, label="tool lifted")
    handles = [ticks, beyond, *([lifted] if len(curves.lifted) else [])]
    figure.legend(handles=handles, loc="outside lower left", ncols=3)
    grid = sides[1].subgridspec(1 + panels, 1, height_ratios=[high, *[OPTIONS.row_height] * panels])
    _floor(figure.add_subplot(grid[0]), floor)
    if curves.timed:
        _speeds(figure.add_subplot(grid[1]), curves)
    _clearance(figure.add_subplot(grid[-1]), plan, curves)
    return figure


def _floor_height(floor: FloorView) -> float:
    """Height of a panel of the floor, with its legend [in]."""
    width, height = (floor.high - floor.low).tolist()
    return (OPTIONS.floor_width - 0.8) * float(np.clip(height / width, 0.3, 1.0)) + 1.2


def _fix_layout(figure: Figure) -> None:
    """Lay the panels out once and round their positions: the solver's last digits vary between runs."""
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    for ax in figure.axes:
        x, y, width, height = (round(share, 5) for share in ax.get_position(original=True).bounds)
        ax.set_position((x, y, width, height))


def _joints(figure: Figure, place: SubplotSpec, plan: Plan, curves: PlanCurves) -> None:
    """A row for each joint: its value and, of a timed plan, its velocity, each with its limits."""
    joints = plan.world.robot.chain.active_joints
    grid = place.subgridspec(len(joints), 2 if curves.timed else 1)
    for k, joint in enumerate(joints):
        unit = "rad" if joint.kind == "revolute" else "m"
        columns = [(joint.name, unit, curves.joints, joint.lower, joint.upper)]
        if curves.timed:
            name, most = f"{joint.name}, velocity", joint.velocity
            columns.append((name, f"{unit}/s", curves.velocities, -most, most))
        for column, (name, unit, values, lower, upper) in enumerate(columns):
            ax = figure.add_subplot(grid[k, column])
            _curve(ax, curves, values[:, k], (lower, upper))
            _shared_axis(ax, curves, last=k + 1 == len(joints))
            ax.set(title=name, ylabel=f"[{unit}]")


def _curve(ax: Axes, curves: PlanCurves, values: Array, limits: tuple[float, float]) -> None:
    """A joint's curve; beyond its limits the panel is shaded."""
    ends = [limit for limit in limits if np.isfinite(limit)]
    low, high = min([*values, *ends]), max([*values, *ends])
    pad = max(0.08 * (high - low), OPTIONS.min_room)
    ax.set_ylim(low - pad, high + pad)
    for limit, beyond in zip(limits, (low - pad, high + pad), strict=True):
        if np.isfinite(limit):
            ax.axhspan(limit, beyond, facecolor=_hex(Color.SOLID), alpha=OPTIONS.limit_opacity, linewidth=0)
    width = 0.6 + 0.6 * _crowding(1500, curves.states)
    ax.plot(curves.along, values, color=_hex(Color.AXIS_PATH), linewidth=width)
    ax.yaxis.set_major_locator(MaxNLocator(4))


def _shared_axis(ax: Axes, curves: PlanCurves, last: bool) -> None:
    """Draw what all curves share: the abscissa, set-points as ticks, lifted intervals shaded."""
    ax.set_xlim(curves.states[0], max(curves.states[-1], curves.states[0] + 1e-3))
    for start, end in curves.lifted.tolist():
        ax.axvspan(start, end, facecolor=_hex(Color.LIFTED), alpha=OPTIONS.lifted_opacity, linewidth=0)
    ticks: dict[str, Any] = {"transform": ax.get_xaxis_transform(), "color": _hex(Color.AHEAD), "zorder": 3}
    ax.vlines(curves.setpoints, 0.0, 0.06, linewidth=_crowding(100, curves.setpoints), **ticks)
    if last:
        ax.set_xlabel("time [s]" if curves.timed else "state, from 1 (the plan is not timed)")
    else:
        ax.tick_params(labelbottom=False)


def _speeds(ax: Axes, curves: PlanCurves) -> None:
    ax.plot(curves.along, curves.speeds["tool"], color=_hex(Color.PASSED), linewidth=1.6, label="tool")
    ax.plot(curves.along, curves.speeds["base"], color=_hex(Color.AXIS_PATH), linewidth=0.8, label="base")
    ax.set(title="speed", ylabel="[m/s]", ylim=(0.0, None))
    _shared_axis(ax, curves, last=False)
    _legend(ax)


def _clearance(ax: Axes, plan: Plan, curves: PlanCurves) -> None:
    world, found = plan.world, curves.clearances
    lines = (
        ("base to solids", found.base, Color.AXIS_PATH, "-", world.asks_alike * world.base_clearance),
        ("arm to solids", found.arm, Color.AHEAD, "-", world.arm_clearance),
        ("arm to itself", found.own, Color.ARM, ":", 0.0),
    )
    shown = [line for line in lines if np.isfinite(line[1]).any()]
    for label, values, color, style, least in shown:
        ax.plot(curves.states, values, color=_hex(color), linestyle=style, label=label)
        if least > 0:
            ax.axhline(least, color=_hex(color), linestyle="--", linewidth=0.9)
    if any(least > 0 for *_, least in shown):
        ax.plot([], [], color=_hex(Color.SOLID), linestyle="--", linewidth=0.9, label="asked for")
    ax.set(title="clearance", ylabel="[m]")
    ax.set_ylim(bottom=min(0.0, *(float(values.min()) for _, values, *_ in lines)))
    _shared_axis(ax, curves, last=True)
    _legend(ax)


def _legend(ax: Axes) -> None:
    """The legend of the curves, above them and beside the title: of more than three in two rows."""
    count = len(ax.get_legend_handles_labels()[0])
    if count:
        ncols = 3 if count <= 3 else 2
        ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=ncols, borderaxespad=0.0)


def _floor(ax: Axes, floor: FloorView) -> None:
    """The floor from above, drawn from below upwards."""
    strong, pale, rejected = floor.words
    layers = (
        ("free floor", floor.free, Color.NAVIGABLE),
        (TURNING_WORDS, floor.turning, Color.TURNING),
        (rejected, floor.rejected, Color.REJECTION),
        (ZONE_WORDS, floor.zones, Color.ZONE),
        (pale, floor.pale, Color.PALE),
        (strong, floor.strong, Color.STRONG),
        ("obstacles", floor.solids, Color.SOLID),
    )
    _area(ax, floor.all, facecolor=_hex(Color.FLOOR))
    key: list[Patch | Line2D] = []
    for label, area, color in layers:
        if not area.is_empty:
            paint: dict[str, Any] = {"facecolor": _hex(color)}
            paint |= {"hatch": "////", "edgecolor": "#ffffff80"} if label == rejected else {}
            _area(ax, area, **paint)
            key.append(Patch(linewidth=0, label=label, **paint))
    if len(floor.tool_path) > 1:
        label = "tool path asked for" if floor.driven else "order of the set-points"
        moves = floor.driven and len(floor.axis_path)  # as a plan does, not a world nor stops alone
        label, color = ("path of the tool", Color.PASSED) if moves else (label, Color.PATH)
        key += ax.plot(*floor.tool_path.T, color=_hex(color), linewidth=1.0, label=label)
    if len(floor.axis_path):
        driven = {"linestyle": "-", "linewidth": 1.6, "label": "path of the arm's axis"}
        joined = {"linestyle": ":", "linewidth": 1.0, "label": "order of the stops"}
        line: dict[str, Any] = driven if floor.driven else joined
        key += ax.plot(*floor.axis_path.T, color=_hex(Color.AXIS_PATH), zorder=5, **line)
    if len(floor.tool_axes):
        start, end = floor.tool_axes.swapaxes(0, 1)
        drawn: dict[str, Any] = {"color": _hex(Color.TOOL_AXIS), "zorder": 3}
        ax.quiver(*start.T, *(end - start).T, angles="xy", scale_units="xy", scale=1, width=0.002, **drawn)
        key.append(Line2D([], [], linewidth=1.0, label=AXES_WORDS, **drawn))
    key += _dots(ax, floor.setpoints, label="set-points")
    if not floor.circles.is_empty:
        _area(ax, floor.circles, zorder=5, facecolor=_hex(Color.PARKING))
        key.append(Patch(linewidth=0, label="circles to park in", facecolor=_hex(Color.PARKING)))
    for outline, stroke in zip(floor.footprints, floor.headings, strict=True):
        _area(ax, outline, facecolor="white", alpha=0.5, zorder=4)
        ax.plot(*shapely.get_coordinates(outline).T, color=_hex(Color.ROBOT), linewidth=0.9, zorder=4)
        ax.plot(*stroke.T, color=_hex(Color.ROBOT), linewidth=2.4, solid_capstyle="butt", zorder=4)
    if len(floor.headings):
        where = "the base at some set-points" if len(floor.axis_path) else "the base at the start"
        key.append(Line2D([], [], color=_hex(Color.ROBOT), linewidth=0.9, label=where))
    _finish_floor(ax, "floor, by places of the arm's axis", floor.low, floor.high, key, ncols=3)


def _finish_floor(
    ax: Axes, title: str, low: Array, high: Array, key: list[Patch | Line2D], ncols: int
) -> None:
    """Title, window and legend of a floor."""
    ax.grid(visible=False)
    ax.set(title=title, xlabel="x [m]", ylabel="y [m]", aspect="equal")
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    ax.legend(handles=key, loc="upper center", bbox_to_anchor=(0.5, 0.0), borderaxespad=4.5, ncols=ncols)


def _dots(ax: Axes, points: Array, **more: Any) -> list[Line2D]:
    """Set-points or targets (n, 2), smaller where there are many."""
    size = max(2.0, 4.0 * _crowding(60, points))
    return ax.plot(*points.T, "o", color=_hex(Color.AHEAD), markersize=size, mew=0, **more)


def _area(ax: Axes, area: BaseGeometry, **paint: Any) -> None:
    rings = [ring for part in shapely.get_parts(area) for ring in (part.exterior, *part.interiors)]
    if rings:
        outline = Path.make_compound_path(*(Path(shapely.get_coordinates(r), closed=True) for r in rings))
        # As an artist, not as a patch, which would scan the whole outline for limits that are given.
        ax.add_artist(PathPatch(outline, linewidth=0, **paint))


def _crowding(most: int, marks: Array) -> float:
    """Scale of marks and lines where there are more than ``most`` of them."""
    return max(0.1, min(1.0, most / max(len(marks), 1)))


def _hex(color: int) -> str:
    return f"#{color:06x}"
