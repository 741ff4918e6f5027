"""The figures of the method page, drawn from what regionik itself computes: `make figures`."""

from __future__ import annotations

import sys
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

import matplotlib as mpl

mpl.use("svg")

import numpy as np
import shapely
from matplotlib import pyplot as plt
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from PIL import Image

import regionik as rik
from regionik import pipeline
from regionik.postures.families import BACK, FRONT
from regionik.pruning import Pruned, whole_path
from regionik.reach_table import reach_table
from regionik.scene import scene_of
from regionik.timing.limits import tool_velocity
from regionik.view.film import opened
from tests.pages import DOCS, play

REACH, KEPT, CUT, SOLID, GROWN, UNDECIDED = "#cfd8dc", "#2e7d32", "#a5d6a7", "#546e7a", "#ffab91", "#c62828"
SIZE = (1100, 720)  # of pictures of pages [pixels]
ASKED = rik.Speeds(
    tool_velocity=0.2, base_velocity=0.5, turn_velocity=1.5, joint_velocity=1.5,
    base_acceleration=1.0, turn_acceleration=3.0, joint_acceleration=3.0,
)  # fmt: skip
JERKS = {"base_jerk": 10.0, "turn_jerk": 30.0, "joint_jerk": 30.0}
SHOWN = 16  # the set-point of l_shape whose components are shown on the floor, counted from 0


def main(folder: Path) -> None:
    """Draw all figures into a folder."""
    mpl.rcParams.update({"svg.hashsalt": "regionik", "font.size": 9, "svg.fonttype": "none"})
    for name, draw in DRAWN.items():
        figure = draw()
        figure.savefig(folder / f"{name}.svg", metadata={"Date": None}, bbox_inches="tight")
        plt.close(figure)
    picture = BytesIO()
    motion().savefig(picture, format="png", dpi=100, bbox_inches="tight")
    save(picture.getvalue(), folder / "motion.png")
    shoot_tutorial(folder)
    shoot_panel(folder)


def shoot_tutorial(folder: Path) -> None:
    """Pictures of the tutorial's pages, as Chromium shows them, and of its figure."""
    with TemporaryDirectory() as scratch:
        for _ in play((DOCS / "tutorial.md").read_text("utf-8"), Path(scratch)):
            pass
        for name in ("free", "cell", "plan"):
            with opened(Path(scratch, f"{name}.html"), *SIZE) as page:
                page.evaluate("window.scrollTo(0, 0), motion && (play(false), seek(0.55 * end))")
                page.evaluate("new Promise((done) => setTimeout(done, 500))")
                save(page.screenshot(), folder / f"tutorial_{name}.png")
        rik.plot(rik.load_plan(Path(scratch, "timed.json")), Path(scratch, "timed.png"))
        save(Path(scratch, "timed.png").read_bytes(), folder / "tutorial_timed.png")
        with opened(Path(scratch, "plan.html")) as page:
            page.evaluate("jump(4)")
            page.evaluate("new Promise((done) => setTimeout(done, 500))")
            save(page.screenshot(), folder / "page.png")


def shoot_panel(folder: Path) -> None:
    """The page of the painted panel, half way along."""
    with TemporaryDirectory() as scratch:
        for _ in play((DOCS / "howto" / "paint.md").read_text("utf-8"), Path(scratch)):
            pass
        with opened(Path(scratch, "plan.html"), *SIZE) as page:
            page.evaluate("motion && (play(false), seek(0.3 * end))")
            page.evaluate("new Promise((done) => setTimeout(done, 500))")
            save(page.screenshot(), folder / "paint.png")


def save(picture: bytes, path: Path) -> None:
    """Write a PNG of 256 colours, a third as large."""
    Image.open(BytesIO(picture)).convert("RGB").quantize(256, dither=Image.Dither.NONE).save(
        path, optimize=True
    )


def area() -> Any:
    """Reach of a target, what is rejected, and what is left of it."""
    world = rik.load_world("pillar")
    target = world.task[8]
    side = scene_of(world).free_floor.anywhere.sides[0]
    _, _, rings = reach_table(scene_of(world), [target], (FRONT, BACK), inner=True, span=side.span)
    reach = shapely.union_all(rings)
    solids = shadows(world)
    figure, panels = plt.subplots(1, 3, figsize=(9.6, 3.4), sharex=True, sharey=True)
    for panel, title in zip(panels, ("reach", "rejection", "admissible area"), strict=True):
        panel.set_title(title)
        panel.set_aspect("equal")
    fill(panels[0], reach, REACH)
    fill(panels[1], world.floor.polygon - side.free, GROWN)
    fill(panels[2], reach, REACH)
    fill(panels[2], rik.admissible_area(world, target).inner, KEPT)
    for panel in panels:
        fill(panel, solids, SOLID)
        panel.plot(*target.position[:2], "w+", markersize=9)
        panel.set_xlim(target.position[0] - 0.9, target.position[0] + 0.9)
        panel.set_ylim(target.position[1] - 0.8, target.position[1] + 0.8)
    panels[0].set_ylabel("y [m]")
    for panel in panels:
        panel.set_xlabel("x [m]")
    return figure


def inner_outer() -> Any:
    """The two polygons of an area where they are farthest from each other."""
    world = rik.load_world("pillar")
    found = rik.admissible_area(world, world.task[8].position)
    between = found.outer - found.inner
    place = shapely.get_coordinates(shapely.maximum_inscribed_circle(between))[0]
    figure, (whole, near) = plt.subplots(1, 2, figsize=(8.4, 3.6))
    for panel in (whole, near):
        fill(panel, between, UNDECIDED)
        fill(panel, found.inner, KEPT)
        panel.set_aspect("equal")
        panel.set_xlabel("x [m]")
    whole.plot(*place, "ks", markersize=8, fillstyle="none")
    whole.set_ylabel("y [m]")
    whole.set_title("an area")
    half = 0.02
    near.set_xlim(place[0] - half, place[0] + half)
    near.set_ylim(place[1] - half, place[1] + half)
    near.set_title("40 mm of its edge")
    return figure


def ladder() -> Any:
    """Components by set-point, those that overlap joined, those that no whole traversal uses pale."""
    world = rik.load_world("l_shape")
    _, _, pruned = whole_path(scene_of(world))
    found = pruned.ladder
    place = _lanes(pruned)
    figure, (rungs, floor) = plt.subplots(2, 1, figsize=(8.4, 7.0), height_ratios=[1, 2], layout="tight")
    for a, b in found.edges:
        whole = bool(pruned.keep[a] and pruned.keep[b])
        rungs.plot(found.target[[a, b]] + 1, place[[a, b]], color=KEPT if whole else "#bdbdbd", linewidth=1)
    for kept, colour in ((False, "#bdbdbd"), (True, KEPT)):
        chosen = pruned.keep == kept
        rungs.plot(found.target[chosen] + 1, place[chosen], "o", color=colour, markersize=4)
    rungs.set_xlabel("set-point")
    rungs.set_ylabel("component")
    rungs.set_yticks(range(int(place.max()) + 1), range(1, int(place.max()) + 2))
    outline(floor, world.floor.polygon)
    here = found.target == SHOWN
    fill(floor, shapely.union_all(found.component[here & ~pruned.keep]), CUT)
    fill(floor, shapely.union_all(found.component[here & pruned.keep]), KEPT)
    fill(floor, shadows(world), SOLID)
    tool = np.array([target.position for target in world.task])
    floor.plot(tool[:, 0], tool[:, 1], "k.-", markersize=3, linewidth=0.8)
    floor.plot(*tool[SHOWN, :2], "k+", markersize=11)
    floor.set_title(f"set-point {SHOWN + 1}", fontsize=9)
    floor.set_aspect("equal")
    floor.set_xlabel("x [m]")
    floor.set_ylabel("y [m]")
    return figure


def motion() -> Any:
    """The base's path and the tool's speed in `depot`, as found, and as smoothed with limited jerk."""
    world = rik.load_world("depot")
    with patch.object(pipeline, "smooth_motion", lambda plan, standing: plan):
        found = rik.plan(world)
    figure = plt.figure(figsize=(9.6, 5.4), layout="constrained")
    floor, *speeds = figure.subplot_mosaic("AB;AC", width_ratios=[1, 1.3]).values()
    fill(floor, shadows(world), SOLID)
    for plan, name, asked, colour, panel in (
        (found, "as found", ASKED, UNDECIDED, speeds[0]),
        (rik.plan(world), "smoothed", replace(ASKED, **JERKS), KEPT, speeds[1]),
    ):
        floor.plot(*plan.motion.base[:, :2].T, color=colour, linewidth=0.8, label=name)
        timed = rik.retime(plan, asked)
        moving, figures = rik.trajectory(timed), timed.stats["timing"]["tool"]
        time = np.arange(0.0, moving.duration, 0.2)
        q, velocity, _ = moving.sample(time).columns
        speed = np.linalg.norm(tool_velocity(world.robot, q, velocity), axis=1)
        panel.plot(time, speed, color=colour, linewidth=0.6)
        panel.set_title(
            f"{name}: {moving.duration:.0f} s, {figures['asked']:g} m/s held for {figures['held']:.0%}",
            fontsize=9,
        )
        panel.set_ylim(0.0, 0.25)
        panel.set_ylabel("speed of the tool [m/s]")
    speeds[1].set_xlabel("time [s]")
    speeds[1].sharex(speeds[0])
    floor.set_aspect("equal")
    floor.set_xlabel("x [m]")
    floor.set_ylabel("y [m]")
    floor.legend(loc="lower center", ncols=2, frameon=False, bbox_to_anchor=(0.5, 1.0))
    return figure


def by_hand() -> Any:
    """M-FABRIK's distance by iteration, its configurations laid over each other, and tracks of two wheels."""
    figure, (distance, floor, tracks) = plt.subplots(1, 3, figsize=(11.5, 3.6), layout="constrained")
    world = rik.load_world("free")
    assert world.start is not None
    here, solver = world.start, rik.Solver(world.robot, tolerance=1e-6)
    base, joints = here.base, here.joints
    for target in world.task:
        distance.semilogy(1000 * solver.history(target.position, base, joints), color=KEPT, linewidth=0.7)
        found = solver(target.position, base, joints)
        base, joints = found.base, found.joints
    distance.set_xlabel("iteration")
    distance.set_ylabel("tool from set-point [mm]")
    distance.set_title("free: each set-point from the one before", fontsize=9)
    world = rik.load_world("l_shape")
    fill(floor, shadows(world), SOLID)
    for found in rik.plan(replace(world, rules=replace(world.rules, smooth=False))).setpoints[::3]:
        links = world.robot.frames(found.base[None], found.joints[None])[0, :, :2, 3]
        floor.plot(*links.T, color=KEPT, linewidth=1.2, alpha=0.6)
        floor.plot(*found.base[:2], "o", color=KEPT, markersize=7, alpha=0.4)
    floor.plot(
        *np.array([target.position[:2] for target in world.task]).T, "k.-", markersize=3, linewidth=0.6
    )
    floor.set_title("l_shape: configurations of M-FABRIK", fontsize=9)
    plan = rik.plan(rik.load_world("circle"))
    x, y, yaw = plan.motion.base.T
    for side, colour in ((0.5, UNDECIDED), (-0.5, KEPT)):
        off = side * plan.world.robot.gauge
        tracks.plot(x - off * np.sin(yaw), y + off * np.cos(yaw), color=colour, linewidth=1)
    tracks.plot(*plan.tools()[:, :2].T, "k", linewidth=0.6)
    tracks.set_title("circle: wheels and tool by Xu's tracker", fontsize=9)
    for panel in (floor, tracks):
        panel.set_aspect("equal")
        panel.set_xlabel("x [m]")
        panel.set_ylabel("y [m]")
    return figure


def _lanes(pruned: Pruned) -> np.ndarray:
    """Height of each component in its rung: the kept ones below."""
    found = pruned.ladder
    lane = np.zeros(len(found.target))
    for i in range(found.count):
        rows = np.flatnonzero(found.target == i)
        lane[rows[np.argsort(~pruned.keep[rows], kind="stable")]] = np.arange(len(rows))
    return lane


def fill(panel: Any, shape: Any, colour: str) -> None:
    """Fill polygons, holes left open."""
    parts = shapely.get_parts(shapely.set_precision(shape, 10.0**-6))
    rings = [ring for part in parts for ring in (part.exterior, *part.interiors)]
    if not rings:
        return
    paths = [Outline(shapely.get_coordinates(ring), closed=True) for ring in rings]
    panel.add_patch(PathPatch(Outline.make_compound_path(*paths), facecolor=colour, edgecolor="none"))
    panel.autoscale_view()


def shadows(world: rik.World) -> Any:
    """Floor under the obstacles."""
    found = [solid.shadow(np.inf) for solid in world.solids]
    return shapely.union_all([one.core.buffer(one.radius) for one in found if one is not None])


def outline(panel: Any, shape: Any) -> None:
    """The edge of the floor."""
    panel.plot(*shapely.get_coordinates(shape.exterior).T, color="#90a4ae", linewidth=1)


DRAWN = {"area": area, "inner_outer": inner_outer, "ladder": ladder, "by_hand": by_hand}

if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "figures")
