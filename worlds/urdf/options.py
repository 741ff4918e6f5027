"""Numbers that tune what is read of a URDF file: how many solids and triangles stand for its meshes.

Solids that stand for a mesh contain it, with any of them; more keep nearer to it, and checks take longer.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class BoundingOptions:
    """Solids that stand for meshes and inertias."""

    max_excess: float = 1e-3  # by which one may stand out of what it bounds, if few corners do [m]
    max_corners: int = 48  # of a hull, as collision checks take each of them
    max_solids: int = 20  # of a robot, likewise
    min_saved_share: float = 0.08  # of a part's volume, that each further piece saves
    # The solid box of a mass and inertia is smaller than the link, which is hollow, or heavy in its middle.
    # Made wider so, it holds 88 in a hundred of 350 links of published robots.
    inertia_scale: float = 1.5  # times
    inertia_margin: float = 0.05  # and then to each side, if it is not smaller itself [m]
    max_sampled: int = 1000  # triangles of a mesh, where places to cut are compared
    max_surface: int = 20_000  # triangles, or points, above which a hull replaces the surface


@dataclass(frozen=True)
class DoubtOptions:
    """What of a file is told, as it is likely a mistake, and what counts as endless."""

    huge_mesh: float = 3.0  # at least [m]
    huge_mesh_share: float = 5.0  # and of the arm's length
    min_tool_depth: float = 1e-3  # of the tool point in its own link, from which on it is told [m]
    min_endless_travel: float = 200.0  # of a slide that is a base's, or of a turn [m] or [rad]


@dataclass(frozen=True)
class SeenOptions:
    """What is seen of a robot."""

    max_triangles: int = 12_000  # in all, coarse enough for a page
    max_mesh_triangles: int = 500_000  # of one that is read
    facets: int = 20  # round a circle
    grey: int = 0x8A939C  # where a file gives no colour


@dataclass(frozen=True)
class UrdfOptions:
    """All of them, by what they tune."""

    bounding: BoundingOptions = BoundingOptions()
    doubts: DoubtOptions = DoubtOptions()
    seen: SeenOptions = SeenOptions()


URDF = UrdfOptions()
