"""The pages: what they tell to run says what they show, links lead somewhere, the menu has them all."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
import yaml

from regionik.worlds.bundled import world_names
from tests.pages import DOCS, PLAYED, blocks, play

ROOT = DOCS.parent
WRITTEN = {"api.md", "world-file.md", "plan-file.md"}  # by docs/pages.py, when the site is built
PAGES = {path.relative_to(DOCS).as_posix(): path for path in sorted(DOCS.rglob("*.md"))}
SECONDS = re.compile(r"in [\d.]+ s$", re.MULTILINE)
NUMBER = re.compile(r"-?\d+(?:\.\d+)?")
CLOSE = 0.006  # numbers on other machines


def alike(told: str, said: str) -> bool:
    """Whether the words are the same, and decimals close; seconds that a command took do not count."""
    told, said = (" ".join(SECONDS.sub("in s", text).split()) for text in (told, said))
    ours, theirs = NUMBER.findall(told), NUMBER.findall(said)
    return NUMBER.sub("#", told) == NUMBER.sub("#", said) and all(
        a == b or ("." in a and abs(float(a) - float(b)) <= CLOSE) for a, b in zip(ours, theirs, strict=True)
    )


SLOW = {"tutorial.md", "howto/criteria.md", "howto/paint.md"}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow) if name in SLOW else name for name in PLAYED]
)
def test_a_page_says_what_its_commands_say(name: str, tmp_path: Path) -> None:
    for block, said in play((DOCS / name).read_text("utf-8"), tmp_path):
        assert alike(block.text, said), said


def test_pages_have_something_to_run() -> None:
    without = {name for name in PLAYED if not blocks((DOCS / name).read_text("utf-8"))}
    assert without == {"howto/live.md", "howto/coming_from.md"}  # a watch until Ctrl-C; tables of words


def test_alike_is_strict_where_it_matters() -> None:
    assert alike("0.12 m in 3.4 s", "0.121  m in 9.9 s")
    assert not alike("2 stops", "3 stops")
    assert not alike("0.12 m", "0.13 m")
    assert not alike("it holds", "it does not hold")


def anchors(text: str) -> set[str]:
    """Anchors of a page's headings, as the site makes them."""
    bare = re.sub(r"```.*?```", "", text, flags=re.DOTALL)
    heads = re.findall(r"^#+ (.+)$", bare, re.MULTILINE)
    return {re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", head).strip().lower()) for head in heads}


def defined(name: str) -> set[str]:
    """Anchors of a page that is written when the site is built."""
    if name == "api.md":
        return set()
    schema = json.loads((DOCS / f"{name.partition('-')[0]}.schema.json").read_text("utf-8"))
    return {part.lower() for part in schema["$defs"]}


@pytest.mark.parametrize(
    "path", [*PAGES.values(), ROOT / "README.md", ROOT / "CONTRIBUTING.md"], ids=lambda p: p.name
)
def test_links_lead_somewhere(path: Path) -> None:
    text = re.sub(r"```.*?```", "", path.read_text("utf-8"), flags=re.DOTALL)
    for link in re.findall(r"\]\(([^)\s]+)\)", text):
        if link.startswith("https://"):
            continue
        place, _, anchor = link.partition("#")
        target = (path.parent / place).resolve() if place else path
        if target.parent == DOCS and target.name in WRITTEN:
            assert not anchor or anchor in defined(target.name), link
            continue
        assert target.exists(), link
        assert not anchor or anchor in anchors(target.read_text("utf-8")), link


def test_the_menu_names_all_pages() -> None:
    menu = re.findall(r"[\w/-]+\.md", str(yaml.safe_load((ROOT / "mkdocs.yml").read_text("utf-8"))["nav"]))
    assert len(menu) == len(set(menu))
    by_topic = {page for page in menu if page.startswith("api/")}  # others fail the build
    assert set(menu) - by_topic == set(PAGES) | WRITTEN


def test_the_gallery_has_all_bundled_worlds() -> None:
    page = (DOCS / "gallery.md").read_text("utf-8")
    assert set(re.findall(r'<a href="gallery/(\w+)\.html" target="live">', page)) == set(world_names())


def test_lowest_versions_are_the_bounds_of_the_project() -> None:
    scope: dict[str, object] = {"__name__": "lowest"}
    exec((ROOT / ".ci" / "lowest.py").read_text("utf-8"), scope)
    project = {"dependencies": ["a-b>=1.2", "c"], "optional-dependencies": {"x": ["d>=3"], "y": ["e>=4"]}}
    assert scope["lowest"](project, ["x"]) == ["a-b==1.2", "d==3"]  # type: ignore[operator]
