"""Kinds of solids that tests hand about."""

from regionik.worlds.links import LinkBox, LinkCapsule, LinkHull
from regionik.worlds.obstacles import Box, Cylinder, Mesh, Prism, Sphere

Solid = Box | Cylinder | Sphere | Prism | Mesh
LinkSolid = LinkCapsule | LinkBox | LinkHull
