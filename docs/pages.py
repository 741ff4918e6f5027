"""Pages that the build of the site writes: Python names, file formats, the plans of the gallery."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

DOCS = Path(__file__).parent
FORMATS = {
    "world-file.md": ("world.schema.json", "World files", "YAML or JSON, read by `regionik.load_world`."),
    "plan-file.md": ("plan.schema.json", "Plan files", "JSON, written by `regionik.Plan.save`."),
}
SECTIONS = {
    "Worlds": (
        "load_world",
        "World",
        "Floor",
        "Zone",
        "Start",
        "Target",
        "Rules",
        "Criteria",
        "Execution",
        "ParkingAccuracy",
        "Speeds",
    ),
    "Obstacles": ("Box", "Cylinder", "Sphere", "Prism", "Mesh"),
    "Robots": ("load_robot", "Robot", "Chain", "Joint", "LinkBox", "LinkCapsule", "LinkHull", "Tool"),
    "Areas and reach": (
        "admissible_area",
        "reach",
        "reach_field",
        "reach_slice",
        "write_field",
    ),
    "Plans": (
        "plan",
        "Plan",
        "load_plan",
        "save_plan",
        "export",
        "verify",
        "verify_answers",
        "verify_areas",
        "stops",
        "replan_stop",
        "why",
    ),
    "Time": ("retime", "trajectory", "point_to_point", "polynomial"),
    "Execution": ("simulate", "Noise"),
    "To look at": ("show", "to_html", "plot", "plot_floor"),
    "Inverse kinematics": ("Solver", "LiveSolver", "avoiding_fabrik", "base_steps", "compare"),
    "Errors": ("RegionikError", "InputError", "NoPlanFound"),
}
FIGURES = {
    "Areas and reach": ("area.svg", "Reach, rejection and admissible area of one set-point"),
    "Plans": ("ladder.svg", "The ladder of a path, and the components of one set-point on the floor"),
    "Time": ("motion.png", "The base's path, and the tool's speed on it"),
    "To look at": ("page.png", "The page of a plan"),
}
RESULTS = (
    "regionik.regions.Area",
    "regionik.reachability.reach.Answer",
    "regionik.values.Motion",
    "regionik.values.State",
    "regionik.values.Stop",
    "regionik.values.Stops",
    "regionik.values.Report",
    "regionik.reachability.field.Field",
    "regionik.simulation.run.SimulatedRun",
    "regionik.simulation.run.Contact",
    "regionik.worlds.errors.Explanation",
    "regionik.worlds.errors.Repair",
)


def on_files(files: Files, config: Any) -> Files:
    """Add the written pages to those that stand in the folder."""
    pages = api_pages() | {
        page: format_page(
            json.loads((DOCS / schema).read_text("utf-8")), title, f"{about} [The schema]({schema})."
        )
        for page, (schema, title, about) in FORMATS.items()
    }
    for name, text in pages.items():
        files.append(File.generated(config, name, content=text))
    return files


def on_post_build(config: Any) -> None:
    """Plan all bundled worlds and write the pages of the gallery."""
    import regionik as rik
    from regionik.worlds.bundled import world_names

    folder = Path(config["site_dir"]) / "gallery"
    folder.mkdir(exist_ok=True)
    for name in world_names():
        rik.to_html(rik.plan(rik.load_world(name)), folder / f"{name}.html")


def api_pages() -> dict[str, str]:
    """All public names, a page for each topic, and one that lists them."""
    from regionik import _HOME

    told = [name for names in SECTIONS.values() for name in names]
    if sorted(told) != sorted(_HOME):
        raise ValueError(f"SECTIONS: expected each public name once, not {sorted(set(told) ^ set(_HOME))}")
    overview = ["# Python", "", "`import regionik as rik`. Arrays go in and come out as numpy's.", ""]
    pages = {}
    for section, names in SECTIONS.items():
        page = f"api/{section.lower().replace(' ', '-')}.md"
        listed = ", ".join(f"[`{name}`]({page}#{_HOME[name]}.{name})" for name in names)
        overview.append(f"- [{section}]({page}): {listed}")
        pages[page] = _api_page(section, [f"{_HOME[name]}.{name}" for name in names])
    overview.append("- [What they give and take](api/results.md)")
    results = _api_page("What they give and take", RESULTS)
    return {"api.md": "\n".join(overview) + "\n", "api/results.md": results, **pages}


def _api_page(section: str, names: Iterable[str]) -> str:
    figure = [f"\n![{FIGURES[section][1]}](../figures/{FIGURES[section][0]})"] if section in FIGURES else []
    return "\n".join([f"# {section}", *figure, *(f"\n::: {name}" for name in names)]) + "\n"


def format_page(schema: dict[str, Any], title: str, about: str) -> str:
    """A JSON Schema as one table for the whole and one for each part."""
    lines = [f"# {title}", "", about]
    if "description" in schema:
        lines += ["", plain(schema["description"])]
    lines += ["", "## The whole", "", *table(schema)]
    for name, part in sorted(schema.get("$defs", {}).items()):
        lines += ["", f"## {name}"]
        if "description" in part:
            lines += ["", plain(part["description"])]
        lines += ["", *(table(part) if "properties" in part else [kind(part)])]
    return "\n".join(lines) + "\n"


def table(part: dict[str, Any]) -> list[str]:
    """The keys of a mapping, one a row."""
    needed = set(part.get("required", ()))
    rows = ["| key | value | default | meaning |", "|---|---|---|---|"]
    for key, value in part.get("properties", {}).items():
        default = "needed" if key in needed else default_of(value)
        rows.append(f"| `{key}` | {kind(value)} | {default} | {plain(value.get('description', ''))} |")
    return rows


def default_of(value: dict[str, Any]) -> str:
    """The default of a key; a part's defaults stand in its own table."""
    if isinstance(value.get("default"), dict):
        return "those of the part"
    return f"`{json.dumps(value['default'])}`" if "default" in value else ""


def kind(value: dict[str, Any]) -> str:
    """What a value may be, in words."""
    if "$ref" in value:
        name = value["$ref"].rpartition("/")[2]
        return f"[{name}](#{name.lower()})"
    for choice in ("anyOf", "oneOf"):
        if choice in value:
            return " or ".join(dict.fromkeys(kind(one) for one in value[choice]))
    if "enum" in value or "const" in value:
        return " or ".join(f"`{json.dumps(one)}`" for one in value.get("enum", [value.get("const")]))
    if value.get("type") == "array":
        return _list(value)
    if value.get("type") == "object" and isinstance(value.get("additionalProperties"), dict):
        return f"a mapping to {kind(value['additionalProperties'])}"
    words = {"number": "number", "integer": "whole number", "string": "text", "boolean": "true or false"}
    name = words.get(value.get("type", ""), value.get("type", "anything"))
    bounds = ", ".join(_bounds(value))
    return f"{name} {bounds}" if bounds else str(name)


def _list(value: dict[str, Any]) -> str:
    least, most = value.get("minItems"), value.get("maxItems")
    if "prefixItems" in value:
        return "list of " + ", ".join(kind(one) for one in value["prefixItems"])
    count = f"{least} " if least is not None and least == most else f"{least} or more " if least else ""
    return f"list of {count}({kind(value.get('items', {}))})"


def _bounds(value: dict[str, Any]) -> Iterator[str]:
    for key, word in {
        "exclusiveMinimum": "above",
        "minimum": "at least",
        "exclusiveMaximum": "below",
        "maximum": "at most",
    }.items():
        if key in value:
            yield f"{word} {value[key]:.6g}" if isinstance(value[key], float) else f"{word} {value[key]}"


def plain(text: str) -> str:
    """Text that a table cell and Markdown leave as it is."""
    return " ".join(
        text.replace("``", "`").replace("|", "\\|").replace("[", "\\[").replace("{", "&#123;").split()
    )
