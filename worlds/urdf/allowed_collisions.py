"""Pairs of a URDF robot's solids that need not keep apart, from pairs of its file's links."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

from regionik.worlds.errors import InputError
from regionik.worlds.robot import Robot
from regionik.worlds.self_collision import base_name
from regionik.worlds.urdf.collision import CollisionModel
from regionik.worlds.urdf.elements import join_names
from regionik.worlds.urdf.srdf import LinkPair

NamePair = tuple[str, str]


def semantic_pairs(robot: Robot, body: CollisionModel, disabled: frozenset[LinkPair]) -> list[NamePair]:
    """Return pairs of names of solids all of whose links are pairwise disabled.

    A solid may be of several links; the base's own body is of all links that are fixed to the base.
    """
    sources = _sources(robot, body)
    return [
        (one, other)
        for one, other in combinations(sources, 2)
        if sources[one] != sources[other]
        and sources[one]
        and sources[other]
        and all(a == b or LinkPair((a, b)) in disabled for a in sources[one] for b in sources[other])
    ]


def named_pairs(robot: Robot, body: CollisionModel, named: Sequence[Sequence[str]]) -> list[NamePair]:
    """Return pairs of names of solids for pairs of names, each of a solid or of a link with all its solids.

    Raises
    ------
    InputError
        For a name that is neither; lists the valid ones.
    """
    sources = _sources(robot, body)
    links = sorted({link for some in sources.values() for link in some})

    def solids(name: str, k: int) -> list[str]:
        found = [name] if name in sources else [one for one, of in sources.items() if of == {name}]
        if not found and name not in links:
            text = f"expected names of links or solids ({join_names([*links, *sources], 20)}), got {name!r}"
            raise InputError(f"unchecked[{k}]: {text}")
        return found

    return [(a, b) for k, (one, other) in enumerate(named) for a in solids(one, k) for b in solids(other, k)]


def _sources(robot: Robot, body: CollisionModel) -> dict[str, frozenset[str]]:
    """Return the links that each solid, and the base's own body, is of, by the solid's name."""
    found = {part.solid.name: part.sources for part in (*body.parts, *body.base.parts)}
    return {base_name(robot): body.base.sources, **found}
