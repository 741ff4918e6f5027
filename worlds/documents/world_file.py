"""World files: a World from YAML or JSON, and back.

The grammar is in `regionik.worlds.documents.world_schema`; `world_schema` gives it as a JSON Schema.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from regionik.worlds.bundled import world_path
from regionik.worlds.documents.world_reader import build_world
from regionik.worlds.documents.world_schema import WorldDocument
from regionik.worlds.documents.world_writer import document_of
from regionik.worlds.readers.text import SUFFIXES, plain_mapping, read_document
from regionik.worlds.readers.validation import bounded, checked
from regionik.worlds.scene import World


def load_world(name_or_path: str | Path) -> World:
    """A bundled world by its name, or a world from a .yaml, .yml or .json file.

    Raises
    ------
    InputError
        One line: the file, the place in it, what was expected and the valid choices.

    Examples
    --------
    >>> world = load_world("pillar")
    >>> len(world.task), world.obstacles[0].name
    (15, 'pillar')
    """
    text = str(name_or_path)
    is_file = isinstance(name_or_path, Path) or text.lower().endswith(SUFFIXES) or "/" in text or "\\" in text
    path = Path(text) if is_file else world_path(text)
    return world_from_document(read_document(path), str(path), path.parent)


def world_from_document(document: dict[str, Any], where: str = "world", folder: Path | None = None) -> World:
    """World of a document of plain values.

    Parameters
    ----------
    document : dict
        What a world file holds.
    where : str
        How messages call the document; also the world's name, where it gives none.
    folder : Path, optional
        What relative file names are relative to; the working directory by default.

    Raises
    ------
    InputError
        One line: ``where``, the place in the document, what was expected and the valid choices.
    """
    plain = plain_mapping(document, where)
    model = checked(WorldDocument, plain, where)
    bounded(plain, where)
    return build_world(model, where, Path() if folder is None else folder)


def world_to_document(world: World) -> dict[str, Any]:
    """A document that holds the whole world: no other file is needed to read it back.

    Maps become prisms, meshes lists of triangles, generated tool paths lists of points. Reading it back
    gives an equal world, to the last bit.
    """
    return document_of(world)


def world_schema() -> dict[str, Any]:
    """JSON Schema of a world file."""
    schema = WorldDocument.model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}
