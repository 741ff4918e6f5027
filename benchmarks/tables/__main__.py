"""Recompute every table of the papers and write them beside the printed figures.

Run: python -m benchmarks.tables [-o docs/tables.md]
"""

from __future__ import annotations

import argparse
from importlib import import_module
from pathlib import Path

from benchmarks.tables.table import markdown
from regionik.planners.kernels import compiled_at_once

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


def document() -> str:
    """The whole document."""
    parts = [PREFACE]
    for name, title in PAPERS.items():
        parts += [f"## {title}\n", *map(markdown, import_module(f"benchmarks.tables.{name}").tables())]
    return "\n".join(parts)


def main() -> None:
    parser = argparse.ArgumentParser(description="Recompute every table of the papers.")
    parser.add_argument("-o", "--out", type=Path, default=Path("docs/tables.md"), help="file to write")
    path = parser.parse_args().out
    with compiled_at_once():
        path.write_text(document(), encoding="utf-8")
    print(f"wrote {path}")


if __name__ == "__main__":
    main()
