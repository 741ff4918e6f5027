"""Room for a base that touches its bounds: one that starts exactly at its clearance, or at the floor's edge.

Areas and drives keep `GUARD` off every bound, against rounding. A base that starts nearer than that stands
well all the same, and leaves from where it stands: its own drives are proven free without the guard.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import shapely

from regionik.areas.ground import Ground, ground_of
from regionik.areas.layers import GUARD, BodyLayer
from regionik.areas.standing import room_for, scene_on
from regionik.planners.driving.footprint import fits
from regionik.planners.driving.footprint_scene import FootprintScene
from regionik.worlds.arrays import Array
from regionik.worlds.obstacles import Shadow
from regionik.worlds.scene import World

TOUCH = 9e-10  # by which a base may pass a bound, for rounding; less than verification lets pass [m]


def ground_between(world: World, *bases: Array) -> Ground:
    """Ground for a drive between base poses (3,): without its guard where one of them touches a bound."""
    if all(fits(room_for(world), *base) for base in bases):
        return ground_of(world)
    leaves = all(fits(_touching_room(world), *base) for base in bases)
    return _touching_ground(world) if leaves else ground_of(world)


def room_between(world: World, *bases: Array) -> FootprintScene:
    """Footprint and all it must keep clear of on a drive between base poses (3,), as `ground_between`."""
    touching = ground_between(world, *bases) is not ground_of(world)
    return _touching_room(world) if touching else room_for(world)


@lru_cache(maxsize=8)
def _touching_room(world: World) -> FootprintScene:
    return scene_on(world, _touching_ground(world))


@lru_cache(maxsize=8)
def _touching_ground(world: World) -> Ground:
    """The ground with bounds that are `TOUCH` farther away once the guard is added."""
    ground = ground_of(world)
    floor = shapely.buffer(ground.floor, TOUCH, join_style="mitre")
    around = tuple(_looser(layer) for layer in ground.around)
    return replace(ground, floor=floor, base=_looser(ground.base), around=around)


def _looser(layer: BodyLayer) -> BodyLayer:
    """A layer that keeps its clearance without the guard."""
    left = layer.clearance - GUARD - TOUCH
    shadows = tuple(_thinner(shadow, max(0.0, -left)) for shadow in layer.shadows)
    return replace(layer, outline=replace(layer.outline, shadows=shadows, clearance=max(0.0, left)))


def _thinner(shadow: Shadow, by: float) -> Shadow:
    """A shadow without a rim [m]; whole where it is too thin for that."""
    if by <= shadow.radius:
        return replace(shadow, radius=shadow.radius - by)
    core = shapely.buffer(shadow.core, shadow.radius - by, join_style="mitre")
    return shadow if core.is_empty else replace(shadow, core=core, radius=0.0)
