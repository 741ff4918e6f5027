"""Poses of bases on wheels moved the least that they roll from one to the next."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from regionik.planners.geometry.rolling import without_slip
from regionik.worlds.drives import drive_of
from tests import examples
from tests.maths import Array


def wave(seed: int) -> Array:
    """Poses along a smooth way, headings nearly along it."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, 1.0, 29)
    yaw = rng.normal() + rng.normal() * t + 0.3 * rng.normal() * np.sin(4 * t)
    ahead = 0.05 * np.column_stack([np.cos(yaw), np.sin(yaw)])
    return np.column_stack([np.cumsum(ahead, axis=0), yaw])


@settings(max_examples=examples(30), deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_no_hop_slips_and_what_is_held_stays(seed: int) -> None:
    base, drive = wave(seed), drive_of("differential")
    free = np.ones(len(base), dtype=bool)
    free[::7] = False
    rolled = without_slip(drive, base, free)
    assert np.abs(drive.slip(base)[0]).max() > 1e-6
    assert np.abs(drive.slip(rolled)[0]).max() < 1e-13
    assert np.array_equal(rolled[~free], base[~free])
    assert np.abs(rolled - base).max() < 0.05


@settings(max_examples=examples(30), deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_slip_changes_as_its_derivative_says(seed: int) -> None:
    base, drive = wave(seed), drive_of("differential")
    slip, by_pose = drive.slip(base)
    step = 1e-6 * np.random.default_rng(seed).normal(size=base.shape)
    change = (by_pose * np.stack([step[:-1], step[1:]], axis=1)).sum(axis=(1, 2))
    assert np.allclose(drive.slip(base + step)[0] - slip, change, atol=1e-11)


def test_a_base_that_goes_every_way_keeps_its_poses() -> None:
    base = wave(1)
    assert without_slip(drive_of("omni"), base, np.ones(len(base), dtype=bool)) is base
