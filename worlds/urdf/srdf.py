"""SRDF files, MoveIt's companions of URDF files: named postures, and links that need not keep apart."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np

from regionik.worlds.arrays import Array
from regionik.worlds.chain import Chain
from regionik.worlds.errors import InputError, located, located_error
from regionik.worlds.readers.text import clip, join_names
from regionik.worlds.readers.xml import Element, finite_numbers, name_of, read_xml
from regionik.worlds.robot import Robot
from regionik.worlds.self_collision import base_name
from regionik.worlds.urdf.collision import CollisionModel
from regionik.worlds.urdf.elements import UrdfModel

SUFFIX = ".srdf"
# Words in names of postures in which arms are carried, those that say so most plainly first.
RESTING = ("carry", "transport", "stow", "tuck", "fold", "rest", "park", "home", "ready", "default")

LinkPair = frozenset[str]
NamePair = tuple[str, str]


@dataclass(frozen=True)
class SemanticModel:
    """The parts of an SRDF file that regionik uses."""

    # joint values by the names of ``group_state`` elements and of joints [rad] or [m], in the file's order
    postures: Mapping[str, Mapping[str, float]]
    disabled: frozenset[LinkPair]  # links that need not keep apart

    def posture(self, name: str, chain: Chain) -> Array:
        """Return the values (dof,) of a named posture; joints it leaves out rest at zero or the nearest."""
        if name not in self.postures:
            known = join_names(self.postures, 20) or "none, as no SRDF file has a <group_state> of its joints"
            raise InputError(f"carry: unknown posture {clip(name)}, valid postures: {known}")
        values = self.postures[name]
        joints = np.clip(np.zeros(chain.dof), chain.lower, chain.upper)
        given = [k for k, joint in enumerate(chain.names) if joint in values]
        joints[given] = [values[chain.names[k]] for k in given]
        chain.check_limits(joints.tolist(), f"posture {name}")
        return joints

    def resting_postures(self, chain: Chain) -> list[str]:
        """Return names of postures to carry an arm in, the best first: as `RESTING` has them, then others.

        They give more than half of the arm's joints, all within their limits.
        """
        usable = [name for name in self.postures if self._is_usable(name, chain)]
        return sorted(
            usable,
            key=lambda name: next(
                (k for k, word in enumerate(RESTING) if word in name.lower()), len(RESTING)
            ),
        )

    @property
    def at_rest(self) -> dict[str, float]:
        """Values of joints in the postures that are named as resting ones, the plainest name first."""
        values: dict[str, float] = {}
        for word in RESTING:
            for name, posture in self.postures.items():
                if word in name.lower():
                    values = {**posture, **values}
        return values

    def _is_usable(self, name: str, chain: Chain) -> bool:
        given = sum(joint in self.postures[name] for joint in chain.names)
        try:
            self.posture(name, chain)
        except InputError:
            return False
        return 2 * given > chain.dof


NO_SEMANTICS = SemanticModel({}, frozenset())


def srdf_beside(urdf: Path) -> Path | None:
    """Return the SRDF file of a URDF file's stem, in its folder or in the folder ``srdf`` beside that one."""
    name = urdf.with_suffix(SUFFIX).name
    places = (urdf.parent / name, urdf.parent.parent / "srdf" / name)
    return next((path for path in places if path.is_file()), None)


def read_srdf(path: Path, model: UrdfModel) -> SemanticModel:
    """Return postures and disabled pairs of an SRDF file, of the joints and links that a URDF file has.

    Names that the URDF file lacks are left out, as one SRDF file often serves variants of a robot. Pairs are
    those of ``disable_collisions``, and of all links of ``disable_default_collisions`` with every other, less
    those of ``enable_collisions``. Where a name is given to several postures (of several groups) their joints
    are put together.
    """
    if path.suffix.lower() != SUFFIX:
        raise located_error(str(path), "", f"expected a file that ends in {SUFFIX}")
    root = read_xml(path, "robot")
    with located(str(path), ""):
        _check_same_robot(root, model)
        return SemanticModel(_postures(root, model), _disabled(root, model.links))


def _check_same_robot(root: Element, model: UrdfModel) -> None:
    """Refuse the file of another robot: one that names links or joints, of which the URDF file has none."""
    named = {link for element in root.all("disable_collisions") for link in _pair(element)}
    named |= {name_of(joint, "joint") for joint in root.inside("group_state", "joint")}
    if named and not named & {*model.links, *(joint.name for joint in model.joints)}:
        text = f"it names {join_names(sorted(named), 4)}, none of which is in {model.path.name}"
        raise InputError(f"{text}: expected the SRDF file of this robot")


def _postures(root: Element, model: UrdfModel) -> dict[str, dict[str, float]]:
    known = {joint.name for joint in model.joints}
    found: dict[str, dict[str, float]] = {}
    for state in root.all("group_state"):
        name = name_of(state, "group_state")
        for element in state.all("joint"):
            joint = name_of(element, "joint")
            place = f"line {element.line}: group_state {name}: joint {joint}"
            text = element.attributes.get("value", "")
            values = finite_numbers(text, max(1, len(text.split())), place)
            if len(values) == 1 and joint in known:  # joints of the base have three or seven
                found.setdefault(name, {})[joint] = values[0]
    return found


def _disabled(root: Element, links: Iterable[str]) -> frozenset[LinkPair]:
    known = set(links)
    silent = {_link(element, "link") for element in root.all("disable_default_collisions")} & known
    pairs = {LinkPair(pair) for pair in combinations(known, 2) if silent & set(pair)} if silent else set()
    pairs -= {_pair(element) for element in root.all("enable_collisions")}
    pairs |= {pair for element in root.all("disable_collisions") if (pair := _pair(element)) <= known}
    return frozenset(pairs)


def _pair(element: Element) -> LinkPair:
    return LinkPair((_link(element, "link1"), _link(element, "link2")))


def _link(element: Element, key: str) -> str:
    name = element.attributes.get(key, "").strip()
    if not name:
        raise element.error(f'{element.tag}: expected {key}="..."')
    return name


# --- pairs of links as pairs of solids


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
    """Return pairs of names of solids for pairs of names, each of a solid or a link with all its solids."""
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
