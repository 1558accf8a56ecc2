"""The run as the fitted model sees it: what the columns of an effect are made of.

All latent quantities (loads, currents, wrench) come from the fitted model, never from the noisy measurement.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identify.friction import drive_velocity
from identify.kinematics import LinkMotion, cross, link_motions
from identify.model import Model
from identify.regressor import rigid_columns
from identify.robot import Robot
from identify.rotations import FloatArray
from identify.structure import to_drives

_STEP = 1e-5  # relative step of the central differences along motions and geometry


@dataclass(frozen=True)
class Scene:
    """Motion and fitted model on one grid.

    Attributes:
        model: the fitted model.
        theta: its parameters, 0 where not identifiable, shape (P,).
        scale: K_nominal / K of every joint, shape (n,).
        t_s: grid instants from the start of the window [s], uniform, shape (B,).
        q: positions, shape (n, B).
        qd: velocities, shape (n, B).
        qdd: accelerations, shape (n, B).
        periodic: whether the grid is one period of a repeating motion.
        has_wrench: whether the base wrench was measured and is modelled.
        found: drive torques [N.m or N] of effects that have joined the model, shape (n, B); None for none.
    """

    model: Model
    theta: FloatArray
    scale: FloatArray
    t_s: FloatArray
    q: FloatArray
    qd: FloatArray
    qdd: FloatArray
    periodic: bool
    has_wrench: bool
    found: FloatArray | None = None

    @property
    def robot(self) -> Robot:
        """The chain."""
        return self.model.robot

    @property
    def rows(self) -> int:
        """Rows of a column: n drives, then six wrench channels where measured."""
        return self.robot.n + (6 if self.has_wrench else 0)

    @property
    def step_s(self) -> float:
        """Grid step [s]."""
        return float(self.t_s[1] - self.t_s[0])

    @cached_property
    def speed(self) -> FloatArray:
        """Drive speeds over their gear ratios (what friction acts on), shape (n, B)."""
        return drive_velocity(self.robot, self.qd)

    @cached_property
    def direction(self) -> FloatArray:
        """Sign of the drive speeds, shape (n, B)."""
        return np.sign(self.speed)

    @cached_property
    def motor_angle_rad(self) -> FloatArray:
        """Motor angles from the joints' zero, shape (n, B)."""
        return self.robot.motor_matrix @ self.q

    @cached_property
    def links(self) -> list[LinkMotion]:
        """Motion of every link's frame in the base frame (see :mod:`identify.kinematics`)."""
        return link_motions(self.robot, self.q, self.qd, self.qdd)

    @cached_property
    def prediction(self) -> FloatArray:
        """Fitted model: drive torques [N.m or N] under the estimated constants, then wrench, shape (rows, B)."""
        return self.predict(self.q, self.qd, self.qdd)

    @property
    def torque(self) -> FloatArray:
        """Fitted drive torques, shape (n, B)."""
        return self.prediction[: self.robot.n]

    @property
    def wrench(self) -> FloatArray:
        """Fitted base wrench in the plate's frame with the plate's offsets taken out, shape (6, B)."""
        return self.prediction[self.robot.n :] - self._plate_offsets[:, None]

    @cached_property
    def current_a(self) -> FloatArray:
        """Fitted motor currents [A], with the effects found so far; torques where no constant is known; (n, B)."""
        factors = np.array([j.drive.gear_ratio * (j.drive.torque_constant or 1.0) for j in self.robot.joints])
        torque = self.torque if self.found is None else self.torque + self.found
        return torque * (self.scale / factors)[:, None]

    @cached_property
    def load(self) -> FloatArray:
        """Rigid-body torque of the links on every drive, without friction, offset and rotor, shape (n, B).

        With the plate the links' gravity is known apart from a compensation spring and stands here whole; without
        it gravity and spring cannot be told apart and their sum stands here, with the offset: over a limited
        travel large amounts of offset and of the compensation's cosines cancel, and neither is known alone.
        """
        basis, count = self.model.basis, len(self.model.basis.columns)
        if self.model.kind != "combined":
            groups = ("inertial", "gravity_compensation")
            sprung = {joint.name for joint in self.robot.joints if joint.drive.gravity_harmonics}
            keep = np.array(
                [p.group in groups or (p.group == "offset" and p.joint in sprung) for p in self.model.parameters]
            )
            rows = self.model.drive_rows(self.q, self.qd, self.qdd)
            return np.tensordot(rows.columns[:, keep], self.theta[keep], axes=([1], [0]))
        links = to_drives(self.robot, rigid_columns(self.robot, self.q, self.qd, self.qdd, external=False).internal)
        inside = basis.columns < links.shape[1]  # base columns that are links, not rotors
        weights = (basis.mixing @ self.theta[:count])[inside]
        return np.tensordot(links[:, basis.columns[inside]], weights, axes=([1], [0]))

    @cached_property
    def _plate_offsets(self) -> FloatArray:
        result = np.zeros(6)
        offsets = [k for k, p in enumerate(self.model.parameters) if p.group == "plate"]
        if offsets:
            result[:] = self.theta[offsets]
        return result

    def predict(
        self, q: FloatArray, qd: FloatArray, qdd: FloatArray, model: Model | None = None
    ) -> FloatArray:
        """Evaluate the fitted model on another motion (directions of friction stay those of the scene).

        Args:
            q: positions, shape (n, B).
            qd: velocities, shape (n, B).
            qdd: accelerations, shape (n, B).
            model: another model with the same parameters, such as one of a changed geometry.

        Returns:
            Drive torques, then wrench, shape (rows, B).
        """
        model = model or self.model
        parts = []
        if model.kind != "external":
            rows = model.drive_rows(q, qd, qdd, sign=self.direction)
            parts.append(np.tensordot(rows.columns, self.theta, axes=([1], [0])) + rows.known)
        else:
            parts.append(np.zeros((self.robot.n, q.shape[1])))
        if self.has_wrench:
            rows = model.wrench_rows(q, qd, qdd)
            parts.append(np.tensordot(rows.columns, self.theta, axes=([1], [0])) + rows.known)
        return np.concatenate(parts)

    def ddt(self, series: FloatArray) -> FloatArray:
        """Differentiate smooth series along time, shape (..., B)."""
        if not self.periodic:
            return np.gradient(series, self.step_s, axis=-1)
        count = series.shape[-1]
        frequency = 2j * np.pi * np.fft.rfftfreq(count, self.step_s)
        if count % 2 == 0:
            frequency[-1] = 0.0
        return np.fft.irfft(np.fft.rfft(series, axis=-1) * frequency, count, axis=-1)

    def difference(self, series: FloatArray) -> FloatArray:
        """Differentiate series that jump: central difference over one step either side, shape (..., B)."""
        if not self.periodic:
            return np.gradient(series, self.step_s, axis=-1)
        return (np.roll(series, -1, axis=-1) - np.roll(series, 1, axis=-1)) / (2.0 * self.step_s)

    def integral(self, series: FloatArray) -> FloatArray:
        """Integrate zero-mean series along time from the zero-mean antiderivative, shape (..., B)."""
        centred = series - series.mean(axis=-1, keepdims=True)
        if not self.periodic:
            total = np.cumsum(centred, axis=-1) * self.step_s
            return total - total.mean(axis=-1, keepdims=True)
        count = series.shape[-1]
        frequency = 2j * np.pi * np.fft.rfftfreq(count, self.step_s)
        frequency[0] = np.inf
        return np.fft.irfft(np.fft.rfft(centred, axis=-1) / frequency, count, axis=-1)

    def along(self, dq: FloatArray, dqd: FloatArray | None = None, dqdd: FloatArray | None = None) -> FloatArray:
        """Derivative of all rows along a change of the links' motion.

        Args:
            dq: change of positions per unit coefficient, shape (n, B).
            dqd: change of velocities; from ``dq`` by :meth:`ddt` when not given.
            dqdd: change of accelerations; likewise.

        Returns:
            Shape (rows, B): what the model would add if the links moved by ``dq`` more than the encoders say.
        """
        dqd = self.ddt(dq) if dqd is None else dqd
        dqdd = self.ddt(dqd) if dqdd is None else dqdd
        size = max(np.abs(dq).max(initial=0.0), np.abs(dqd).max(initial=0.0), np.abs(dqdd).max(initial=0.0), 1e-12)
        h = _STEP / size
        ahead = self.predict(self.q + h * dq, self.qd + h * dqd, self.qdd + h * dqdd)
        behind = self.predict(self.q - h * dq, self.qd - h * dqd, self.qdd - h * dqdd)
        return (ahead - behind) / (2.0 * h)

    def with_robot(self, robot: Robot) -> FloatArray:
        """Rows predicted for the same parameters on a changed geometry or gravity.

        The change must leave the structure of the base parameters alone, so it must be small.
        """
        changed = Model(robot, self.model.kind, self.model.structure, self.model.parameters)
        return self.predict(self.q, self.qd, self.qdd, model=changed)

    def rotor_rows(self, joint: int) -> FloatArray:
        """Rows per unit inertia [kg.m2] of one joint's rotor, shape (rows, B)."""
        columns = rigid_columns(self.robot, self.q, self.qd, self.qdd)
        drive = to_drives(self.robot, columns.rotor_internal)[:, joint]
        return np.concatenate([drive, columns.rotor_external[:, joint]])[: self.rows]

    def force_rows(self, point_m: FloatArray, force: FloatArray, link: int) -> FloatArray:
        """Rows of a force from outside that acts on a link: the drives and the plate must hold it.

        Args:
            point_m: where it acts, base frame, shape (3, B).
            force: the force on the link, base frame [N], shape (3, B).
            link: index of the link.

        Returns:
            Shape (rows, B): drives -J'f, plate -X f in the plate's frame.
        """
        result = np.zeros((self.rows, force.shape[1]))
        joint_rows = np.zeros((self.robot.n, force.shape[1]))
        for k in range(link + 1):
            motion = self.links[k]
            if self.robot.joints[k].prismatic:
                joint_rows[k] = np.sum(motion.axis * force, axis=0)
            else:
                joint_rows[k] = np.sum(motion.axis * cross(point_m - motion.origin_m, force), axis=0)
        result[: self.robot.n] = -to_drives(self.robot, joint_rows)
        if self.has_wrench:
            plate = self.robot.plate
            assert plate is not None
            moment = cross(point_m - plate.translation_m[:, None], force)
            result[self.robot.n :] = -np.concatenate([plate.rotation.T @ force, plate.rotation.T @ moment])
        return result

