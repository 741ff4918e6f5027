"""MuJoCo: a robot and its world, stepped in time. The only file that imports mujoco."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from regionik.simulation.mjcf import model_text
from regionik.simulation.options import SIMULATION
from regionik.worlds.arrays import Array
from regionik.worlds.errors import EngineError, InputError
from regionik.worlds.scene import World

STEP = SIMULATION.step
BASE_STIFFNESS = 10 / STEP  # rate at which the base takes on the speed of its wheels, their grip [1/s]
_NAME = re.compile(r"(robot|solid) (-?\d+)")


@dataclass(frozen=True, eq=False)
class Overlap:
    """Two solids that overlap."""

    robot: int  # index in ``robot.all_solids``, -1 for the base's body
    other: int  # index in ``world.solids``, or of the robot where ``own`` is true
    own: bool  # the robot touches itself
    point: Array  # (3,) in the world [m]
    depth: float  # [m]


class Physics:
    """The state of a robot in its world: ``position`` and ``velocity`` (3 + n,) of x, y, yaw and all joints.

    A joint that mimics another has a servo of its own, which is set to follow.

    Parameters
    ----------
    world : World
    base : (3,) array
        At first.
    joints : (n, dof) array
        Postures of the motion to come, the first one first: drives are made for the most inertia among them.
    servo : float
        Natural frequency of the joints' servos, critically damped [rad/s].

    Raises
    ------
    InputError
        When MuJoCo is not installed.
    """

    def __init__(self, world: World, base: Array, joints: Array, servo: float) -> None:
        try:
            import mujoco
        except ImportError as error:
            raise InputError(f"a simulation needs regionik[simulate]: {error}") from None
        self._engine, self._servo, self._name = mujoco, servo, world.robot.name
        self._chain = world.robot.chain
        moving = [k for k, joint in enumerate(self._chain.joints, 3) if joint.mimic is None]
        self._active, joints = [0, 1, 2, *moving], self._chain.joint_values(joints)
        try:
            self._model = mujoco.MjModel.from_xml_string(model_text(world, STEP))
        except ValueError as error:
            raise EngineError(f"MuJoCo does not take the model of {world.name}: {error}") from error
        self._data = mujoco.MjData(self._model)
        self._solids = [self._solid(k) for k in range(self._model.ngeom)]
        self._set_drives(base, joints, servo)
        self._data.qpos[:] = np.concatenate([base, joints[0]])
        self._data.qvel[:] = 0.0
        self._data.ctrl[3:] = joints[0]  # set to anything else, servos would tear at the robot at once
        mujoco.mj_forward(self._model, self._data)
        self.position: Array = self._data.qpos
        self.velocity: Array = self._data.qvel
        self._before: Array = self._data.qvel.copy()  # the step
        self.tool: Array = self._data.site_xpos[0]

    @property
    def state(self) -> tuple[Array, Array]:
        """Position and velocity (3 + dof,) of x, y, yaw and the active joints."""
        return self.position[self._active], self.velocity[self._active]

    def step(self, base_velocity: tuple[float, float, float], joints: Array) -> None:
        """Go on by `STEP`.

        The wheels drive the base at a velocity in the world, x, y [m/s] and yaw [rad/s]; ``joints`` (n,) are
        set-points of the servos.
        """
        control = self._data.ctrl
        control[0], control[1], control[2] = base_velocity
        control[3:] = joints
        self._before[:] = self.velocity
        self._engine.mj_step(self._model, self._data)

    def setpoints(self, position: Array, velocity: Array, acceleration: Array) -> Array:
        """Set-points of the servos of all joints at which the robot makes a motion, a row for each step.

        A servo that is set to q + 2 q' / w + f / k makes the motion q where it needs the force f for it, at
        stiffness k (computed-torque feed-forward). Position, velocity and acceleration are those of base and
        joints, (n, 3 + dof). The state is not changed.
        """
        model, data, engine = self._model, self._engine.MjData(self._model), self._engine
        position = np.column_stack([position[:, :3], self._chain.joint_values(position[:, 3:])])
        velocity, acceleration = (
            np.column_stack([rates[:, :3], rates[:, 3:] @ self._chain.coupling.T])
            for rates in (velocity, acceleration)
        )
        forces = np.zeros(position.shape)
        felt = model.opt.disableflags
        model.opt.disableflags |= engine.mjtDisableBit.mjDSBL_CONTACT | engine.mjtDisableBit.mjDSBL_LIMIT
        for k, now in enumerate(zip(position, velocity, acceleration, strict=True)):
            data.qpos, data.qvel, data.qacc = now
            engine.mj_inverse(model, data)
            forces[k] = data.qfrc_inverse
        model.opt.disableflags = felt
        # The damping of a step is that of the speed at its end.
        lead = 2 / self._servo * (velocity + STEP * acceleration)
        found: Array = (position + lead)[:, 3:] + forces[:, 3:] / model.actuator_gainprm[3:, 0]
        return found

    @property
    def touching(self) -> bool:
        """True while any two solids overlap that a plan may or may not let touch."""
        return bool(self._data.ncon)

    def touches(self) -> list[Overlap]:
        """Solids that overlap now."""
        contact = self._data.contact
        pairs, depths, points = contact.geom.tolist(), (-contact.dist).tolist(), contact.pos
        found = []
        for (one, other), depth, point in zip(pairs, depths, points, strict=True):
            (kind, first), (other_kind, second) = sorted((self._solids[one], self._solids[other]))
            if depth > 0:
                found.append(Overlap(first, second, kind == other_kind, point, depth))
        return found

    def refresh(self) -> None:
        """Bring the tool to the present position: a step leaves it where it was before.

        Raises
        ------
        EngineError
            Where the motion has left all bounds.
        """
        if not np.isfinite(self.position).all():
            raise EngineError(f"MuJoCo: the motion of {self._name} is not finite")
        self._engine.mj_kinematics(self._model, self._data)

    def tool_velocity(self) -> Array:
        """Velocity of the tool point in the world, (3,) [m/s]."""
        jacobian = np.zeros((3, self._model.nv))
        self._engine.mj_comPos(self._model, self._data)
        self._engine.mj_jacSite(self._model, self._data, jacobian, None, 0)
        # The speed that a step ends with is that of its middle. `qacc` would not do: it knows no implicit
        # damping, and is several times too much where the base is stiff.
        found: Array = jacobian @ (self.velocity + (self.velocity - self._before) / 2)
        return found

    def _solid(self, geom: int) -> tuple[str, int]:
        found = _NAME.match(self._model.geom(geom).name)
        assert found is not None
        return found[1], int(found[2])

    def _set_drives(self, base: Array, joints: Array, servo: float) -> None:
        """Gains of the drives, for the most inertia that each has on its way."""
        model, data, most = self._model, self._data, np.zeros(self._model.nv)
        whole = np.zeros((model.nv, model.nv))
        for posture in joints:
            data.qpos[:] = np.concatenate([base, posture])
            self._engine.mj_forward(model, data)
            self._engine.mj_fullM(model, data, whole)
            most = np.maximum(most, np.diag(whole))
        stiffness, damping = most * servo**2, most * 2 * servo
        damping[:3] = most[:3] * BASE_STIFFNESS
        model.actuator_gainprm[:, 0] = np.where(np.arange(model.nu) < 3, damping, stiffness)
        model.actuator_biasprm[3:, 1] = -stiffness[3:]
        model.actuator_biasprm[:, 2] = -damping
