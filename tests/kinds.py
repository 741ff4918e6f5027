"""Kinds of things that tests hand about, as worlds name them."""

from typing import Literal

from regionik.worlds.links import LinkBox, LinkCapsule, LinkHull
from regionik.worlds.obstacles import Box, Cylinder, Mesh, Prism, Sphere

Solid = Box | Cylinder | Sphere | Prism | Mesh
LinkSolid = LinkCapsule | LinkBox | LinkHull
BaseKind = Literal["omni", "differential", "car"]
Heading = Literal["free", "face_target", "fixed"]
Mode = Literal["continuous", "stops"]
Goal = Literal["point", "direction", "orientation"]
