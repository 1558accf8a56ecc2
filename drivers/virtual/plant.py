"""The virtual plant: from setpoints to what encoders, drives and plate truly see."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from drivers.virtual.effects.effect import HOOKS, Effect, EffectSpec
from drivers.virtual.effects.registry import make_effects
from drivers.virtual.errors import PlantError
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.rigid import RigidLoads, RigidPlant
from drivers.virtual.servo import Moments, Servo
from drivers.virtual.spring import spring_torque


class VirtualPlant:
    """Arm, drives and plate without sensor noise; all quantities of one instant belong to one motion.

    Args:
        spec: the plant.
        effects: what is added to it, applied in this order.
        start_q: joint angles (k,) at the start, at rest; zero where not given.
        start_s: time of the start.
        period_s: interpolation period of the setpoints.
        keep_s: how much of the past stays available.
    """

    def __init__(
        self,
        spec: PlantSpec,
        effects: Sequence[EffectSpec] = (),
        start_q: np.ndarray | None = None,
        start_s: float = 0.0,
        period_s: float = 4e-3,
        keep_s: float = 30.0,
    ) -> None:
        self.effects = make_effects(effects, spec)
        self.nominal = spec
        for effect in self.effects:
            spec = effect.alter(spec)
        self.spec = spec
        self.rigid = RigidPlant(spec)
        rest = np.zeros(len(spec.joints)) if start_q is None else np.asarray(start_q, dtype=float)
        self._servo = Servo(self.nominal, rest, start_s, period_s, keep_s)
        for index, effect in enumerate(self.effects):
            effect.key = f"{index}:{effect.name}"
            effect.begin(self._servo.step_s, self._servo.history, self.rigid)
        self._last: Moments | None = None
        self._last_loads: RigidLoads | None = None
        self._hooks = {hook: [e for e in self.effects if e.has(hook)] for hook in HOOKS}
        self._tick_effects = self._using("tick")
        self._load_effects = [effect for effect in self.effects if effect.needs_loads]
        self._tick(self._servo.at(np.array([start_s])))
        self._constant = np.array([joint.torque_constant_nm_a for joint in spec.joints])
        self._coulomb = np.array([joint.coulomb_nm for joint in spec.joints])
        self._viscous = np.array([joint.viscous_nm_s for joint in spec.joints])
        self._offset = np.array([joint.offset_nm for joint in spec.joints])
        self._springs = [(i, joint.spring) for i, joint in enumerate(spec.joints) if joint.spring is not None]
        self._to_motor = np.linalg.inv(self.rigid.coupling)  # (k, k): motor torque = joint torque @ this

    def _using(self, hook: str) -> list[Effect]:
        return self._hooks[hook]

    @property
    def time_s(self) -> float:
        """Time up to which the motion is known."""
        return self._servo.end_s

    @property
    def period_s(self) -> float:
        """Interpolation period of the setpoints."""
        return self._servo.step_s * self._servo.ticks_per_period

    def follow(self, setpoints: np.ndarray) -> None:
        """Move through the next setpoints (m, k), one an interpolation period.

        Raises:
            PlantError: The setpoints have another width or are not finite.
        """
        points = np.atleast_2d(np.asarray(setpoints, dtype=float))
        if points.shape[1] != len(self.spec.joints) or not np.isfinite(points).all():
            raise PlantError(
                f"Setpoints of {self.spec.name} must be finite and {len(self.spec.joints)} wide, "
                f"got {points.shape}."
            )
        self._last = None  # the history's ticks may move
        self._tick(self._servo.follow(points))
        self._servo.history.forget()

    def _tick(self, moments: Moments) -> None:
        if not self._tick_effects:
            return
        loads = self.rigid.inverse(moments.q, moments.qd, moments.qdd) if self._load_effects else None
        for effect in self._tick_effects:
            effect.tick(moments, loads)

    def moments(self, t_s: np.ndarray) -> Moments:
        """Return the motors' motion at any known instants (n,); the last answer is kept."""
        instants = np.asarray(t_s, dtype=float)
        if self._last is None or not np.array_equal(self._last.t_s, instants):
            self._last, self._last_loads = self._servo.at(instants), None
        return self._last

    def link_motion(self, moments: Moments) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Angles, speeds and accelerations (n, k) of the links, which follow the motors through the gears."""
        q, qd, qdd = moments.q, moments.qd, moments.qdd
        for effect in self._using("deviation"):
            extra = effect.deviation(moments)
            q, qd, qdd = q + extra[0], qd + extra[1], qdd + extra[2]
        return q, qd, qdd

    def loads(self, moments: Moments) -> RigidLoads:
        """Joint torques and plate wrench of the rigid bodies, rotors and outside forces."""
        if moments is self._last and self._last_loads is not None:
            return self._last_loads
        loads = self._loads(moments)
        if moments is self._last:
            self._last_loads = loads
        return loads

    def _loads(self, moments: Moments) -> RigidLoads:
        outside = [force for effect in self._using("outside") for force in effect.outside(moments)]
        tilting = any(effect.needs_tilting for effect in self.effects)
        q, qd, qdd = self.link_motion(moments)
        return self.rigid.inverse(q, qd, qdd, (moments.qd, moments.qdd), outside, tilting)

    def torques(self, moments: Moments) -> np.ndarray:
        """Torque (n, k) the motors must bring to the joint side, with friction, springs and offsets."""
        loads = self.loads(moments)
        torque = (
            loads.joint_nm + self._coulomb * moments.direction + self._viscous * moments.qd + self._offset
        )
        for index, spring in self._springs:
            torque[:, index] += spring_torque(spring, moments.q[:, index])
        for effect in self._using("torque"):
            torque += effect.torque(moments, loads)
        return torque

    def currents(self, t_s: np.ndarray) -> np.ndarray:
        """Motor currents (n, k) that samples stamped `t_s` hold, without noise."""
        instants = self._instants("current", t_s)
        if instants.ndim == 1:
            return self._currents(self.moments(instants))
        columns = [self._currents(self.moments(instants[:, j]))[:, j] for j in range(instants.shape[1])]
        return np.stack(columns, axis=1)

    def _currents(self, moments: Moments) -> np.ndarray:
        current = (self.torques(moments) @ self._to_motor) / self._constant
        for effect in self._using("current"):
            current = effect.current(moments, current)
        return current

    def encoders(self, t_s: np.ndarray) -> np.ndarray:
        """Encoder readings (n, k) that samples stamped `t_s` hold, without noise."""
        moments = self.moments(self._instants("encoder", t_s))
        reading = moments.q
        for effect in self._using("encoder"):
            reading = effect.encoder(moments, reading)
        return reading

    def wrench(self, t_s: np.ndarray) -> np.ndarray:
        """Six plate channels (n, 6) that samples stamped `t_s` hold, without noise; call in order of time."""
        moments = self.moments(self._instants("wrench", t_s))
        wrench = self.loads(moments).wrench
        if self.spec.plate is not None:
            wrench = wrench + np.array(self.spec.plate.offsets)
        for effect in self._using("plate"):
            wrench = effect.plate(moments.t_s, wrench)
        return wrench

    def _instants(self, stream: str, t_s: np.ndarray) -> np.ndarray:
        instants = np.asarray(t_s, dtype=float)
        for effect in self._using("instants"):
            instants = effect.instants(stream, instants)
        return instants
