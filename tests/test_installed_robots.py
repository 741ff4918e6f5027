"""Robots by name, of packages that are installed: here of one that is made for the test."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

import regionik as rik

ROOT = Path(__file__).parents[1]
CART = (ROOT / "docs" / "files" / "cart.urdf").read_text("utf-8")
KIND = "share/example-robot-data/robots"


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of packages in which example-robot-data has a robot, and a ROS 2 environment another."""
    monkeypatch.syspath_prepend(str(tmp_path))
    names = [f"{KIND}/arm_description/urdf/lab_arm_robot.urdf", f"{KIND}/arm_description/README.md"]
    for name in (*names, "ros/share/other_description/urdf/other.urdf"):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(CART)
    about = tmp_path / "example_robot_data-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: example-robot-data\nVersion: 1.0\n")
    (about / "RECORD").write_text("".join(f"{name},,\n" for name in names))
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "ros"))
    return tmp_path


@pytest.mark.parametrize("name", ["lab_arm", "lab_arm_robot", "other"])
@pytest.mark.usefixtures("installed")
def test_robots_of_installed_packages_go_by_their_names(name: str) -> None:
    assert rik.load_robot(name, base="differential").base == "differential"


@pytest.mark.parametrize("robot", ["lab_arm", {"urdf": "lab_arm", "base": "differential"}])
def test_world_files_name_them_too(robot: object, installed: Path) -> None:
    path = installed / "w.yaml"
    floor = {"polygon": [[0, 0], [2, 0], [2, 2], [0, 2]]}
    path.write_text(
        yaml.safe_dump({"version": 1, "robot": robot, "floor": floor, "task": [{"points": [[1, 1, 0.5]]}]})
    )
    own = rik.load_robot(installed / KIND / "arm_description/urdf/lab_arm_robot.urdf")
    assert rik.load_world(path).robot.chain.names == own.chain.names


@pytest.mark.usefixtures("installed")
def test_a_name_that_is_not_known_is_answered_with_those_that_are() -> None:
    with pytest.raises(
        rik.InputError, match=r"'lab_arms', did you mean 'lab_arm_robot'\? valid names: youbot, .*other"
    ):
        rik.load_robot("lab_arms")


def test_without_a_package_it_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("regionik.worlds.urdf.installed.DISTRIBUTION", "no-such-package")
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    with pytest.raises(
        rik.InputError, match="pioneer-parm; the package no-such-package, where it is installed, has"
    ):
        rik.load_robot("ur10")
