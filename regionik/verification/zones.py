"""Proof that the base stays inside or outside the zones of its world, zone by zone."""

from __future__ import annotations

from collections.abc import Iterator

import shapely
from shapely.geometry.base import BaseGeometry

from regionik.verification.base_clearance import Region, footprint_hulls, verify_inside
from regionik.verification.motion import MotionSegments
from regionik.verification.proofs import Finding, StateNames, finding
from regionik.worlds.scene import World
from regionik.worlds.zones import Zone

AROUND = 100.0  # that the plane outside a zone goes on beyond it and the base [m]


def verify_zones(world: World, segments: MotionSegments, names: StateNames) -> Iterator[Finding]:
    """Yield one finding on all zones: the footprint stays inside those to keep in, outside the others."""
    if not world.zones:
        return
    plane = shapely.union_all(footprint_hulls(segments.robot, segments.motion.base)).envelope
    found = [
        verify_inside(_region(zone, plane, world.base_allowance), segments, names) for zone in world.zones
    ]
    yield finding(
        "zone", min(one.margin for one in found), [text for one in found for text in one.violations]
    )


def _region(zone: Zone, plane: BaseGeometry, allowance: float) -> Region:
    """Where a zone lets the footprint be, anywhere as far off its place as execution may take it."""
    if zone.keep == "in":
        ground = shapely.buffer(zone.polygon, -allowance, join_style="mitre")
        return Region("zone", f"outside the zone {zone.name}", f"in the zone {zone.name}", ground)
    around = shapely.buffer(shapely.union(plane, zone.polygon).envelope, AROUND, join_style="mitre")
    ground = shapely.difference(around, shapely.buffer(zone.polygon, allowance, join_style="mitre"))
    return Region("zone", f"in the zone {zone.name}", f"outside the zone {zone.name}", ground)
