"""The list of planted faults: each still has its place, and its tests."""

import builtins
import symtable
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.mutations import FAULTS, ROOT, Fault, plant


def test_there_are_twenty() -> None:
    assert len({fault.name for fault in FAULTS}) == len(FAULTS) >= 20


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_every_fault_has_its_place(fault: Fault, tmp_path: Path) -> None:
    copy = tmp_path / fault.file
    copy.parent.mkdir(parents=True)
    copy.write_text((ROOT / fault.file).read_text())
    plant(fault, tmp_path)
    assert copy.read_text() != (ROOT / fault.file).read_text()
    assert set(unknown_names(copy.read_text())) == set(), "a name that nothing knows shows in any test"
    assert all((ROOT / test).exists() for test in fault.tests)


def unknown_names(source: str) -> Iterator[str]:
    """Names that functions of a module look up in it and that it has not."""
    module = symtable.symtable(source, "", "exec")
    known = {*dir(builtins), *module.get_identifiers(), "__file__"}
    tables = [module]
    for table in tables:
        tables += table.get_children()
        yield from (
            one.get_name() for one in table.get_symbols() if one.is_global() and one.get_name() not in known
        )
