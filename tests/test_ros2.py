"""Messages for ROS 2, read back by a parser of others and compared with the plan."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_typestore

from regionik.output.export import export
from regionik.output.ros2 import joint_trajectory, message_text, nanoseconds, path_message, stamp
from regionik.timing.trajectory import trajectory
from regionik.values import Plan
from regionik.worlds.chain import Chain
from regionik.worlds.errors import InputError
from tests.maths import Array
from tests.plans import l_shape, synthetic_plan, timed

STORE = get_typestore(Stores.ROS2_HUMBLE)
TYPES = {"joint-trajectory": "trajectory_msgs/msg/JointTrajectory", "path": "nav_msgs/msg/Path"}


@pytest.fixture(scope="module")
def plan() -> Plan:
    return timed(synthetic_plan(l_shape()))


def message(name: str, fields: dict[str, Any]) -> Any:
    """A message of the store made of a document that must have its fields, all of them and no others."""
    definition = STORE.fielddefs[name][1]
    assert set(fields) == {field for field, _ in definition}
    return STORE.types[name](**{field: _value(kind, fields[field]) for field, kind in definition})


def _value(kind: Any, value: Any) -> Any:
    """A field as the store wants it; kinds are plain, another message, an array, a sequence."""
    node, inner = int(kind[0]), kind[1]
    if node == 2:
        return message(inner, value)
    if node == 4:
        (element, of), _ = inner
        if int(element) == 2:
            return [message(of, item) for item in value]
        assert not of[0].startswith("float") or all(type(item) is float for item in value)
        return list(value) if of[0] == "string" else np.array(value, dtype=of[0])
    types = {"string": str, "float64": float, "int32": int, "uint32": int}
    assert type(value) is types[inner[0]]
    return value


def read_back(plan: Plan, kind: str, file: Path, **asked: Any) -> Any:
    """A message that has gone to a file, from there into a message of the store, over the wire and back."""
    export(plan, file, kind, **asked)
    text = file.read_text(encoding="utf-8")
    document = yaml.safe_load(text)  # as ros2 topic pub does
    if file.suffix == ".json":
        assert json.loads(text) == document
    name = TYPES[kind]
    return STORE.deserialize_cdr(STORE.serialize_cdr(message(name, document), name), name)


def clock(message: Any) -> Array:
    """Time fields of a message as seconds."""
    assert 0 <= message.nanosec < 10**9
    seconds: Array = np.array(message.sec + 1e-9 * message.nanosec)
    return seconds


@pytest.mark.parametrize("suffix", [".yaml", ".json", ".yml"])
def test_a_joint_trajectory_comes_back(plan: Plan, suffix: str, tmp_path: Path) -> None:
    found = read_back(plan, "joint-trajectory", tmp_path / f"arm{suffix}")
    motion = plan.motion
    assert found.joint_names == list(plan.world.robot.chain.names)
    assert (found.header.frame_id, found.header.stamp.sec, found.header.stamp.nanosec) == ("map", 0, 0)
    sample = trajectory(plan).sample(motion.time)
    assert len(found.points) == len(motion)
    for k, point in enumerate(found.points):
        assert np.abs(point.positions - motion.joints[k]).max() < 1e-9
        assert np.abs(point.velocities - sample.joint_velocity[k]).max() < 1e-9
        assert np.abs(point.accelerations - sample.joint_acceleration[k]).max() < 1e-9
        assert abs(clock(point.time_from_start) - motion.time[k]) < 1e-9
        assert len(point.effort) == 0


@pytest.mark.parametrize("suffix", [".yaml", ".json"])
def test_a_path_comes_back(plan: Plan, suffix: str, tmp_path: Path) -> None:
    found = read_back(plan, "path", tmp_path / f"base{suffix}", frame="odom")
    assert found.header.frame_id == "odom"
    assert len(found.poses) == len(plan.motion)
    for state, posed in zip(plan.motion, found.poses, strict=True):
        where, turn = posed.pose.position, posed.pose.orientation
        assert posed.header.frame_id == "odom"
        assert max(abs(where.x - state.base[0]), abs(where.y - state.base[1]), abs(where.z)) < 1e-9
        yaw = 2 * np.arctan2(turn.z, turn.w) - state.base[2]
        assert abs(np.remainder(yaw + np.pi, 2 * np.pi) - np.pi) < 1e-9
        assert turn.x == turn.y == 0.0
        assert state.time is not None
        assert abs(clock(posed.header.stamp) - state.time) < 1e-9


@pytest.mark.parametrize("rate", [10.0, 7.3, 1e-3])
def test_a_rate_gives_even_times_and_the_end(plan: Plan, rate: float, tmp_path: Path) -> None:
    arm = read_back(plan, "joint-trajectory", tmp_path / "arm.yaml", rate=rate)
    base = read_back(plan, "path", tmp_path / "base.yaml", rate=rate)
    moving = trajectory(plan)
    times = np.array([clock(point.time_from_start) for point in arm.points])
    assert np.abs(times[:-1] - np.arange(len(times) - 1) / rate).max() < 1e-9
    assert abs(times[-1] - moving.duration) < 1e-9
    assert 0 < times[-1] - times[-2] <= 1 / rate + 1e-9
    sample = moving.sample(np.minimum(times, moving.duration))
    positions = np.array([point.positions for point in arm.points])
    assert np.abs(positions - sample.joints).max() < 1e-8  # times are whole nanoseconds
    spots = np.array([[p.pose.position.x, p.pose.position.y] for p in base.poses])
    assert np.abs(spots - sample.base[:, :2]).max() < 1e-8


@pytest.mark.parametrize("suffix", [".yaml", ".json"])
def test_the_bundle_holds_both_with_their_types(plan: Plan, suffix: str, tmp_path: Path) -> None:
    export(plan, tmp_path / f"plan{suffix}", "ros2", frame="world")
    both = yaml.safe_load((tmp_path / f"plan{suffix}").read_text())
    assert {key: entry["type"] for key, entry in both.items()} == {
        key.replace("-", "_"): name for key, name in TYPES.items()
    }
    assert both["joint_trajectory"]["message"] == joint_trajectory(plan, frame="world")
    assert both["path"]["message"] == path_message(plan, frame="world")


times = st.lists(st.floats(0, 2**31 - 2), min_size=1).map(sorted)


@given(times)
def test_nanoseconds_are_near_in_order_and_carried(times: list[float]) -> None:
    clock = nanoseconds(np.array(times))
    assert (np.diff(clock) >= 0).all()
    for time, count in zip(times, clock.tolist(), strict=True):
        whole, rest = divmod(time, 1.0)
        assert abs(count - int(whole) * 10**9 - rest * 1e9) <= 0.5 + 1e-6
        fields = stamp(count)
        assert 0 <= fields["nanosec"] < 10**9
        assert fields["sec"] * 10**9 + fields["nanosec"] == count


def test_what_rounds_to_a_second_is_a_second() -> None:
    assert [stamp(n) for n in nanoseconds(np.array([0.9999999996, 7.9999999999, 1.5])).tolist()] == [
        {"sec": 1, "nanosec": 0},
        {"sec": 8, "nanosec": 0},
        {"sec": 1, "nanosec": 500_000_000},
    ]


@pytest.mark.parametrize("time", [-1e-3, 2.0**31])
def test_times_that_no_stamp_holds_are_refused(time: float) -> None:
    with pytest.raises(InputError, match="times: expected 0 to 2147483646 s"):
        nanoseconds(np.array([0.0, time]))


numbers = st.floats(allow_nan=False, allow_infinity=False) | st.sampled_from([1e-07, 1e16, -1e-300, -0.0])
documents = st.recursive(
    st.lists(numbers, max_size=3) | numbers | st.text() | st.integers(),
    lambda inner: (
        st.dictionaries(st.sampled_from("abcd"), inner, min_size=1, max_size=3)
        | st.lists(st.dictionaries(st.sampled_from("xyz"), inner, min_size=1), min_size=1, max_size=3)
    ),
    max_leaves=12,
)


@given(st.dictionaries(st.sampled_from("abcd"), documents, min_size=1), st.sampled_from([".yaml", ".json"]))
def test_every_document_is_read_as_it_was(document: dict[str, Any], suffix: str) -> None:
    read = yaml.safe_load(message_text(document, suffix))
    assert read == document
    assert repr(read) == repr(document)  # which tells floats from integers and -0.0 from 0.0


def test_odd_joint_names_come_back(plan: Plan, tmp_path: Path) -> None:
    chain = plan.world.robot.chain
    odd = ["yes", "1e-07", 'a "b": {c}', "Gelenk ä", "#"]
    joints = tuple(dataclasses.replace(j, name=n) for j, n in zip(chain.joints, odd, strict=True))
    robot = dataclasses.replace(plan.world.robot, chain=Chain(joints, chain.T_last_tool))
    renamed = dataclasses.replace(plan, world=dataclasses.replace(plan.world, robot=robot))
    assert read_back(renamed, "joint-trajectory", tmp_path / "arm.yaml").joint_names == odd


def test_times_ascend_strictly_where_states_share_a_moment(plan: Plan) -> None:
    states = np.arange(len(plan.motion))
    twice = np.repeat(states, np.where((states == 0) | (states == states[-1]), 3, 1))  # where it rests
    names = [f.name for f in dataclasses.fields(plan.motion) if f.name not in ("tool", "tool_on")]
    columns = {name: getattr(plan.motion, name)[twice] for name in names}
    doubled = dataclasses.replace(plan, motion=dataclasses.replace(plan.motion, **columns))
    points = joint_trajectory(doubled)["points"]
    moments = [(p["time_from_start"]["sec"], p["time_from_start"]["nanosec"]) for p in points]
    assert len(points) == len(plan.motion) < len(doubled.motion)
    assert moments == sorted(set(moments))


def test_a_plan_without_times_has_a_path_but_no_trajectory(tmp_path: Path) -> None:
    untimed = synthetic_plan(l_shape())
    found = read_back(untimed, "path", tmp_path / "base.yaml")
    assert len(found.poses) == len(untimed.motion)
    assert all(clock(posed.header.stamp) == 0 for posed in found.poses)
    for kind, asked in (("joint-trajectory", {}), ("ros2", {}), ("path", {"rate": 5.0})):
        with pytest.raises(InputError, match="not timed"):
            export(untimed, tmp_path / "no.yaml", kind, **asked)  # type: ignore[arg-type]
    assert not (tmp_path / "no.yaml").exists()


WRONG: list[tuple[str, str, dict[str, Any], str]] = [
    ("path", "base.csv", {}, r"base.csv: expected a file name ending in .yaml, .yml, .json for format path"),
    ("ros2", "plan", {}, "expected a file name ending in .yaml"),
    ("path", "a.yaml", {"rate": 0.0}, "rate: expected a number above 0, got 0"),
    ("csv", "a.csv", {"rate": float("nan")}, "rate: expected a number above 0, got nan"),
    ("csv", "a.csv", {"rate": 1e9}, r"rate: expected at most \S+ 1/s for this plan, got 1e\+09"),
    ("geojson", "a.json", {"rate": 5.0}, "geojson is not sampled; expected one of csv, ros2, joint-traj"),
    ("csv", "a.csv", {"frame": "map"}, "frame: format csv has none; expected one of ros2, joint-trajectory"),
    ("path", "a.yaml", {"frame": ""}, "frame: expected the name of a frame"),
    ("path", "a.yaml", {"frame": "/map"}, "without a slash; got '/map'"),
]


@pytest.mark.parametrize(("kind", "name", "asked", "words"), WRONG)
def test_what_does_not_go_is_refused(
    plan: Plan, kind: str, name: str, asked: dict[str, Any], words: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=words) as caught:
        export(plan, tmp_path / name, kind, **asked)
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []
