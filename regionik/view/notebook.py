"""Values as notebooks show them: the floor from above, and a few lines."""

from __future__ import annotations

from html import escape
from typing import Any

from regionik.regions import Area
from regionik.timing.trajectory import is_timed
from regionik.values import Answer, Plan
from regionik.view.figures import floor_image
from regionik.worlds.scene import World

_LINES = 5


def as_html(value: Plan | World | Area | Answer) -> str:
    """Return a picture of the floor and a few lines as HTML."""
    picture = floor_image(value)
    lines = "\n".join(facts(value)[:_LINES])
    return f"<div>{picture[picture.index('<svg') :]}<pre>{escape(lines)}</pre></div>"


def facts(value: Plan | World | Area | Answer) -> list[str]:
    """Return lines on a value, the most telling first."""
    if isinstance(value, Plan):
        margins: dict[str, Any] = value.stats.get("margins", {})
        timed = f"{value.motion.time[-1]:.1f} s" if is_timed(value.motion) else "not timed"
        spare = ", ".join(f"{name} {least:.3g}" for name, least in margins.items())
        return [repr(value), repr(value.world), repr(value.motion), timed, spare]
    if isinstance(value, World):
        return [value.about or value.name, *map(repr, (value, value.robot, value.floor, value.rules))]
    if isinstance(value, Area):
        return [repr(value), repr(value.world), *(f"rejected: {part.name}" for part in value.causes)]
    reasons = dict.fromkeys(reason for reason in value.reason if reason)
    return [repr(value), *reasons]
