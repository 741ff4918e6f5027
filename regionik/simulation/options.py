"""Numbers that tune simulated executions: controller, drives, and what robots do not tell of themselves."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ControllerOptions:
    """The controller that tracks a plan."""

    period: float = 0.01  # of its commands [s]
    base_gain: float = 2.0  # at which the base is led back to its place [1/s]
    way_back: float = 0.3  # on which a base that rolls comes back to its path [m]
    min_steered_speed: float = 1e-2  # slower cars steer as the plan has it [m/s]
    # Before and after the tool is on its path, in which the arm begins and ends to hold it there [s]
    fade_time: float = 1.0
    turn_length: float = 0.05  # that counts as much as a radian of the tool's orientation [m]
    max_added: float = 0.2  # of a joint's deviation from the plan, endless near singular postures [rad], [m]
    damping: float = 0.015  # share of the arm's length that counts as much as a radian of its deviation


@dataclass(frozen=True)
class RobotOptions:
    """What a robot file does not tell of drives and masses."""

    base_lag: float = 0.1  # in which the base takes on a speed: the time constant of its drives [s]
    servo_frequency: float = 100.0  # natural, of the joints' servos [rad/s]
    servo_postures: int = 50  # of the plan, for which the servos are made
    base_mass: float = 50.0  # of all that does not move with the arm [kg]
    base_inertia: float = 5.0  # [kg m2]
    bare_mass: float = 0.1  # of a link without solids and without a known mass [kg]
    bare_inertia: float = 1e-4  # [kg m2]
    density: float = 1000.0  # of links whose masses are not known [kg/m3]
    shell: float = 1e-3  # thickness of a mesh's triangles [m]


@dataclass(frozen=True)
class NoiseOptions:
    """Slip of the wheels and errors of the localisation, drawn again and again."""

    slip_time: float = 1.0  # for which a draw of the slip lasts [s]
    localisation_time: float = 10.0  # for which the robot has localised itself before it sets off [s]


@dataclass(frozen=True)
class RunOptions:
    """What is told and shown of a run."""

    rows_at_once: int = 1000  # a matter of memory
    error_grid: float = 1e-4  # to which suggested errors are rounded up [m], [rad]
    speed_band: float = 0.02  # share of the nominal tool speed within which the tool's counts as held
    max_frames: int = 1500  # of its animation


@dataclass(frozen=True)
class SimulationOptions:
    """All of them, by what they tune."""

    controller: ControllerOptions = ControllerOptions()
    robot: RobotOptions = RobotOptions()
    noise: NoiseOptions = NoiseOptions()
    run: RunOptions = RunOptions()
    step: float = 0.002  # of the solver [s]


SIMULATION = SimulationOptions()
