"""The table of small worlds: every kind of arm, base, floor, task and refusal, made from seeds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, replace
from functools import partial
from typing import Any

import numpy as np
import shapely

from regionik.worlds.bundled import robot_named, world_names
from regionik.worlds.documents.world_file import load_world, world_to_document
from regionik.worlds.drives import BaseKind
from regionik.worlds.obstacles import Box
from regionik.worlds.scene import Floor, Rules, Start, Target, World
from regionik.worlds.speeds import Speeds
from tests.furnished import furnished_world
from tests.harness.rasters import bent_panel, carried, raster
from tests.soaked import soaked_world
from tests.witnesses import witness

Maker = Callable[[], World]


def document_of(world: World) -> dict[str, Any]:
    """Return a world as its file has it, without the usual rules: older trees may not know all of them."""
    document, usual = world_to_document(world), asdict(Rules())
    rules = {key: value for key, value in document["rules"].items() if value != usual[key]}
    return {**document, "rules": rules}


def bundled(name: str, most: int | None = None, speeds: Speeds | None = None, **rules: Any) -> World:
    """Return a bundled world, or its first set-points, under other rules."""
    world = load_world(name)
    return replace(
        world, task=world.task[:most], rules=replace(world.rules, **rules), speeds=speeds or world.speeds
    )


def by(robot: str, base: BaseKind, name: str, **rules: Any) -> World:
    """Return a bundled world done by a bundled robot on another base, which starts anywhere."""
    rolling = replace(robot_named(robot), base=base, turning_radius=0.4 if base == "car" else 0.0)
    return replace(bundled(name, **rules), robot=rolling, start=None)


HALL = Floor(shapely.box(-1.0, -1.0, 4.0, 1.0))
SPOTS = ((0.0, 0.0, 0.3), (0.5, 0.0, 2.0), (1.0, 0.1, 0.3), (1.5, 0.0, 0.3), (6.5, 0.0, 0.3), (2.0, 0.0, 0.3))
POST = Box("post", np.array([0.4, 0.4, 0.5]), np.array([-0.6, 0.0, 0.25]))
TUBE = tuple(  # round the first set-point, too high for the base to touch
    Box(f"side {k}", np.array([0.02, 0.5, 0.4]), np.array([*way, 0.4]), k * np.pi / 2)
    for k, way in enumerate(((0.2, 0.0), (0.0, 0.2), (-0.2, 0.0), (0.0, -0.2)))
)


def hall(chosen: tuple[int, ...], obstacles: tuple[Box, ...] = (), **rules: Any) -> World:
    """Return some of `SPOTS` on a wide floor; the second is too high, the fifth off the floor."""
    task = tuple(Target(np.array(SPOTS[k])) for k in chosen)
    return World("hall", robot_named("youbot"), HALL, obstacles, task, Rules(clearance=0.05, **rules))


def blocked() -> World:
    """Return a hall whose start stands in a post."""
    world = hall((0, 2), (POST,))
    return replace(world, start=Start(np.array([-0.5, 0.0, 0.0]), world.robot.carry))


def parted() -> World:
    """Return a path through two rooms that a door too narrow for the base joins."""
    rooms = HALL.polygon - shapely.box(0.5, -0.9, 0.8, 1.0)
    return replace(hall((0, 2, 3, 5)), floor=Floor(rooms))


def _made() -> dict[str, Maker]:
    """Return makers by name; a name says what the world has."""
    table: dict[str, Maker] = {
        **{name: partial(bundled, name) for name in world_names() if name != "depot"},
        "depot-cut": partial(bundled, "depot", 60),
        "l_shape-stops": partial(bundled, "l_shape", mode="stops"),
        "l_shape-stops-any": partial(bundled, "l_shape", mode="stops", order="any"),
        "l_shape-tool-speed": partial(bundled, "l_shape", speeds=Speeds(tool_velocity=0.1)),
        "pillar-stops-near": partial(bundled, "pillar", mode="stops", stop_criterion="distance"),
        "shelf-stops": partial(bundled, "shelf", mode="stops", stop_criterion="clearance"),
        "pipe-stops-any": partial(bundled, "pipe", mode="stops", order="any"),
        "wall-stops": partial(bundled, "wall", mode="stops"),
        "free-fixed-heading": partial(bundled, "free", heading="fixed"),
        "pillar-facing": partial(bundled, "pillar", heading="face_target"),
        "pillar-no-lift-off": partial(bundled, "pillar", max_lift_offs=0),
        "free-differential": partial(by, "youbot-real", "differential", "free"),
        "free-car": partial(by, "youbot-real", "car", "free"),
        "l_shape-differential": partial(by, "youbot-real", "differential", "l_shape", clearance=0.05),
        "depot-stops": partial(bundled, "depot", 60, mode="stops"),
        "free-pioneer7": partial(by, "pioneer7", "omni", "free"),
        "free-dof10": partial(by, "dof10", "differential", "free"),
        "unreachable": partial(hall, (0, 1, 2)),
        "off-the-floor": partial(hall, (3, 4, 5), mode="stops"),
        "skipping": partial(hall, tuple(range(6)), skip_unreachable=True),
        "skipping-stops": partial(hall, tuple(range(6)), skip_unreachable=True, mode="stops", order="any"),
        "start-blocked": blocked,
        "no-posture": partial(hall, (0,), TUBE),
        "no-room-to-park": partial(hall, (0, 2), mode="stops", stop_tolerance=0.5),
        "two-rooms": parted,
    }
    for arm, clutter in RASTERS:
        table[f"raster-{arm.split()[-1].lower()}-{clutter}"] = partial(_raster, arm, clutter)
    for base in ("differential", "car"):
        table[f"raster-ur10e-{base}"] = partial(_raster, "UR10e", "open", base, 8, 1)
    for arm in ("UR10e", "Panda"):
        table[f"panel-{arm.lower()}"] = partial(_panel, arm)
    for kind, seeds in WITNESSES.items():
        table |= {f"witness-{kind.replace(' ', '-')}-{seed}": partial(_witness, kind, seed) for seed in seeds}
    for kind, seeds in RANDOM.items():
        table |= {f"random-{kind}-{seed}": partial(soaked_world, kind, seed) for seed in seeds}
    return table | {f"furnished-{seed}": partial(furnished_world, seed) for seed in FURNISHED}


def _raster(arm: str, clutter: Any, base: BaseKind = "omni", columns: int = 10, rows: int = 2) -> World:
    return raster(carried(arm, base), clutter, columns, rows)


def _panel(arm: str) -> World:
    return bent_panel(carried(arm), 6, 2)


def _witness(kind: str, seed: int) -> World:
    return witness(kind, seed).world


RASTERS = (
    ("UR10e", "open"), ("UR10e", "clutter"), ("UR10e", "bollard"),
    ("LBR iiwa", "clutter"), ("Panda", "open"), ("Panda", "clutter"), ("Panda", "bollard"),
)  # fmt: skip
WITNESSES = {  # kinds of arms and seeds; of bases, floors and tasks they have all
    "wrists": (1, 2, 3, 4, 5),
    "offsets": (1, 2, 3, 5),
    "slides": (1, 2, 3, 4, 5),
    "tilted": (1, 2, 3, 4, 5),
    "urdf arms": (1, 2, 3, 4),
}
RANDOM = {  # kinds of `tests.soaked` and seeds
    "floor": (1, 2, 4, 5),
    "overhead": (2, 4, 5),
    "made": (2, 4),
    "wheels": (2, 3, 5),
    "urdf": (2,),
    "stops": (1, 2, 3),
    "ground": (1, 2, 5),
}
FURNISHED = (1, 2, 3, 5)
WORLDS = _made()
SHORT = (
    "free", "door", "pillar", "shelf", "l_shape-stops-any", "raster-ur10e-clutter", "raster-ur10e-car",
    "witness-slides-3", "witness-tilted-5", "random-stops-2", "furnished-3", "unreachable", "skipping-stops",
)  # fmt: skip
