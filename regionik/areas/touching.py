"""Ground for a base that touches its bounds: one that starts at its very clearance, or at the floor's edge.

Areas and drives keep `ROUNDING_MARGIN` off every bound, against rounding. A base that starts nearer than that
stands well all the same, and leaves from where it stands: its own drives are proven free without that margin.
"""

from __future__ import annotations

from dataclasses import replace

import shapely

from regionik.areas.ground import Ground
from regionik.areas.layers import ROUNDING_MARGIN, BodyLayer
from regionik.worlds.shadows import Shadow

BOUND_ROUNDING = 9e-10  # by which a base may pass a bound, for rounding; less than verification lets pass [m]


def without_rounding_margin(ground: Ground) -> Ground:
    """The ground with bounds that are `BOUND_ROUNDING` farther away once the margin is added."""
    floor = shapely.buffer(ground.floor, BOUND_ROUNDING, join_style="mitre")
    around = tuple(_looser(layer) for layer in ground.around)
    return replace(ground, floor=floor, base=_looser(ground.base), around=around)


def _looser(layer: BodyLayer) -> BodyLayer:
    """A layer that keeps its clearance without the margin."""
    left = max(0.0, layer.clearance - ROUNDING_MARGIN - BOUND_ROUNDING)
    shadows = tuple(_thinner(shadow, layer.clearance, left) for shadow in layer.shadows)
    return replace(layer, outline=replace(layer.outline, shadows=shadows, clearance=left))


def _thinner(shadow: Shadow, clearance: float, left: float) -> Shadow:
    """A shadow with what it asks for beyond what is left of a clearance [m].

    Where that is less than nothing it loses a rim; it is whole where it is too thin for that.
    """
    keep = clearance + shadow.more - ROUNDING_MARGIN - BOUND_ROUNDING
    shadow = replace(shadow, more=max(0.0, keep) - left if shadow.more else 0.0)
    by = max(0.0, -keep)
    if by <= shadow.radius:
        return replace(shadow, radius=shadow.radius - by)
    core = shapely.buffer(shadow.core, shadow.radius - by, join_style="mitre")
    return shadow if core.is_empty else replace(shadow, core=core, radius=0.0)
