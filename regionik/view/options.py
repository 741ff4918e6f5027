"""Numbers of the pictures: how much is drawn, how finely, how fast, and from where."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class AnimationOptions:
    """Key frames of motions, their pace, and films of them."""

    shown_speed: float = 0.25  # of base or tool, whichever moves farther, of plans that are not timed [m/s]
    min_duration: float = 10.0  # of these [s]
    max_duration: float = 60.0  # [s]
    end_pause: float = 1.5  # before it starts again [s]
    turn_radius: float = 0.2  # from the axis, of a point whose motion a turn counts as [m]
    min_step: float = 0.002  # so that no two states have the same time [m]
    max_frames: int = 2000  # in all
    frame_rate: int = 15  # of a timed plan, besides its states [1/s]
    film_rate: int = 10  # of frames [1/s]
    max_film_duration: float = 15.0  # longer motions are shown faster [s]
    film_size: tuple[int, int] = (960, 600)  # [pixels]
    browser_timeout: float = 120.0  # for one answer [s]
    poll_interval: float = 0.05  # of the live view [s]


@dataclass(frozen=True)
class CameraOptions:
    """Where a picture is first seen from."""

    view_angle: float = np.radians(42.0)  # from bottom to top of the window
    aspect: float = 1.45  # narrower than common windows, which leaves room for the legend
    margin: float = 0.8  # about set-points and base [m]
    min_hiding_height: float = 0.3  # lower obstacles hide little [m]


@dataclass(frozen=True)
class FloorOptions:
    """The floor seen from above."""

    detail: float = 0.002  # by which shapes are simplified: less is not seen [m]
    max_details: int = 2000  # across a picture
    shown_poses: int = 8  # at which the base is drawn
    margin: float = 0.3  # around all there is [m]
    margin_share: float = 0.15  # of its size, besides
    floor_edge: float = 0.1  # drawn beyond the floor [m]
    above_all: float = 100.0  # above every solid [m]


@dataclass(frozen=True)
class SceneOptions:
    """Solids, robots and marks in space."""

    facets: int = 24  # round a circle
    max_cut_corners: int = 3000  # of a floor area that is cut into triangles at once
    tube_sides: int = 5
    mark_radius: float = 0.014  # of set-points [m]
    shaft_radius: float = 0.008  # of arrows [m]
    tool_axis: float = 0.1  # length of the arrow that shows from where the tool comes [m]
    max_tool_axes: int = 200  # that are drawn
    max_wheel_radius: float = 0.05  # [m]
    point_base_radii: tuple[float, float] = (0.03, 0.16)  # of the body of a base that is a point [m]
    ghost_opacity: float = 0.35  # of a robot that stands nowhere in particular
    max_opaque_height: float = 0.6  # higher obstacles are drawn translucent [m]
    min_seen_share: float = 0.7  # of the footprint, from which visual surfaces show the whole base
    start_places: int = 48  # that are tried for a robot without a start
    min_start_distance: float = 0.3  # of these from the first set-point [m]


@dataclass(frozen=True)
class CurveOptions:
    """Curves of joints, speeds and distances over time."""

    samples: int = 600  # of a motion, at even times
    timed_samples: int = 1000  # of a timed plan, besides its states
    distance_stride: int = 2  # of samples, from one at which distances are measured to the next
    digits: int = 5
    min_room: float = 0.01  # so that rounding is not drawn as motion [m] or [rad], and a second
    limit_opacity: float = 0.45  # of what is beyond limits
    lifted_opacity: float = 0.13  # of intervals with the tool lifted
    joints_width: float = 4.2  # of a column of joints [in]
    floor_width: float = 7.2  # [in]
    row_height: float = 1.9  # of a curve [in]


@dataclass(frozen=True)
class BoardOptions:
    """The message board and the legend."""

    width: float = 1.6  # in half heights of the view
    font_size: int = 30  # [pixels]
    line_height: int = 40  # [pixels]
    padding: int = 14  # [pixels]
    line: int = 74  # letters
    max_lines: int = 5
    keys_in_row: int = 3  # of the legend
    key_size: int = 24  # height of their letters [pixels]
    ink: tuple[int, int, int] = (31, 41, 55)
    paper: tuple[int, int, int] = (250, 249, 245)


@dataclass(frozen=True)
class ViewOptions:
    """All of them, by what they are of."""

    animation: AnimationOptions = AnimationOptions()
    camera: CameraOptions = CameraOptions()
    floor: FloorOptions = FloorOptions()
    scene: SceneOptions = SceneOptions()
    curves: CurveOptions = CurveOptions()
    board: BoardOptions = BoardOptions()
    max_html_facts: int = 12  # lines below the picture of a value in a notebook


VIEW = ViewOptions()
