"""Recompute every table of the papers and write them beside the printed figures.

Run: python -m benchmarks.tables [-o docs/tables.md]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

from benchmarks.tables.table import markdown
from regionik.planners.kernels import compiled_at_once
from regionik.storage.files import write_atomic
from regionik.worlds.errors import InputError

PAPERS = {
    "santos": "M-FABRIK (Santos et al., IEEE Access 2020)",
    "fabrikr": "FABRIK-R (Santos et al., IEEE Access 2021)",
    "xu": "A differential base with an arm of five joints (Xu et al.)",
    "tao": "FABRIK that avoids obstacles (Tao et al., 2021)",
    "de_souza": "An arm of three joints by algebra, genes and a network (de Souza et al.)",
}
PREFACE = """\
# Every table of the papers

Recomputed by `make tables`: the paper's figure, ours, and a line where they differ. A dash stands where a
paper prints nothing, or where this code has no such method.

Counts, distances and angles are seeded and do not change from run to run. Of times only ratios within one run
are told, each a median over repeats; they vary, and the papers' were taken with other code on other machines.
Each table is a test as well, but for its times: `tests/test_table_*.py`.
"""


MISSING = "Not computed: "  # begins what stands in a paper's place where a rival's package is missing


def paper(name: str) -> str:
    """The section of a paper."""
    try:
        return "\n".join(map(markdown, import_module(f"benchmarks.tables.{name}").tables()))
    except InputError as error:
        return f"{MISSING}{error}.\n"


def documents() -> Iterator[str]:
    """The document as it grows paper by paper."""
    text = PREFACE
    for name, title in PAPERS.items():
        text = f"{text}\n## {title}\n\n{paper(name)}"
        yield text


def main() -> int:
    parser = argparse.ArgumentParser(description="Recompute every table of the papers.")
    parser.add_argument("-o", "--out", type=Path, default=Path("docs/tables.md"), help="file to write")
    path = parser.parse_args().out
    text = ""
    with compiled_at_once():
        for text in documents():
            write_atomic(path, text)
    print(f"wrote {path}" + (", not all of it: see there" if MISSING in text else ""))
    return 1 if MISSING in text else 0


if __name__ == "__main__":
    sys.exit(main())
