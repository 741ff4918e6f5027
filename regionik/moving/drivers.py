"""The table of drivers: which of them moves a kind of base."""

from __future__ import annotations

from collections.abc import Callable

from regionik.areas.standing import Standing
from regionik.moving.base_motion import Driver
from regionik.moving.interpolation import Interpolator
from regionik.moving.omnidirectional import AnyHeadingDriver, ByHeadingDriver
from regionik.moving.wheeled import CarDriver, DifferentialDriver
from regionik.worlds.drives import BaseKind
from regionik.worlds.scene import World


def driver_for(world: World, interpolator: Interpolator, standing: Standing, seed: int) -> Driver:
    """Return the driver that suits a base and where it may stand."""
    return DRIVERS[world.robot.drive.kind](world, interpolator, standing, seed)


def _omnidirectional(world: World, interpolator: Interpolator, standing: Standing, seed: int) -> Driver:
    """By heading only where not all headings are free alike."""
    driver = AnyHeadingDriver if len(standing.sides) == 1 else ByHeadingDriver
    return driver(world, interpolator, standing, seed)


DRIVERS: dict[BaseKind, Callable[[World, Interpolator, Standing, int], Driver]] = {
    "omni": _omnidirectional,
    "differential": DifferentialDriver,
    "car": CarDriver,
}
