"""The list of planted faults: each still has its place, and its tests."""

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
    assert all((ROOT / test).exists() for test in fault.tests)
