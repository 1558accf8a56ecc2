"""The virtual robot behind fake drives and a fake plate: commands in, noisy samples out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from drivers.virtual.effects.effect import EffectSpec
from drivers.virtual.errors import PlantError
from drivers.virtual.plant import VirtualPlant
from drivers.virtual.plant_file import PlantSpec
from drivers.virtual.record import current_noise, wrench_noise
from drivers.virtual.sensors import quantise, stream_generator


class VirtualRobot:
    """A plant with drives that interpolate position commands, and its sensors.

    The drives take one target each interpolation period (the last commanded one where the host is late) and
    reach it one period later. Time only moves when `advance_to` is called.

    Args:
        spec: the plant.
        effects: effects on top of it.
        seed: of the sensor noise.
        command_period_s: interpolation period of the drives, the bus' SYNC period.
        start_q: joint angles (k,) at rest; zero where not given.
        keep_s: how long the past can still be sampled.
    """

    def __init__(
        self,
        spec: PlantSpec,
        effects: Sequence[EffectSpec] = (),
        seed: int = 0,
        command_period_s: float = 4e-3,
        start_q: np.ndarray | None = None,
        keep_s: float = 2.0,
    ) -> None:
        self.spec = spec
        start = np.zeros(len(spec.joints)) if start_q is None else np.array(start_q, dtype=float)
        self._rest_s = 0.25  # at rest before zero: effects may look back
        self.plant = VirtualPlant(spec, effects, start, -self._rest_s, command_period_s, keep_s)
        self._target = start
        self.time_s = -self._rest_s
        self._encoder_random = stream_generator(seed, "encoder noise")
        self._current_noise = current_noise(spec, stream_generator(seed, "current noise"))
        self._wrench_noise = wrench_noise(spec, stream_generator(seed, "wrench noise"))
        self.advance_to(0.0)

    def command_position(self, q: Sequence[float] | np.ndarray) -> None:
        """Set the drives' targets (k,) [rad or m].

        Raises:
            PlantError: The target has another width or is not finite.
        """
        target = np.array(q, dtype=float)
        if target.shape != self._target.shape or not np.isfinite(target).all():
            raise PlantError(f"A target of {self.spec.name} is {len(self._target)} finite numbers, got {q}.")
        self._target = target

    def command_joint(self, index: int, q: float) -> None:
        """Set one drive's target [rad or m]."""
        target = self._target.copy()
        target[index] = q
        self.command_position(target)

    @property
    def target(self) -> np.ndarray:
        """The drives' present targets (k,)."""
        return self._target.copy()

    def advance_to(self, t_s: float) -> None:
        """Let time pass until `t_s`.

        Raises:
            PlantError: That time has passed already.
        """
        if t_s < self.time_s - 1e-9:
            raise PlantError(f"Time cannot run back from {self.time_s:.6f} s to {t_s:.6f} s.")
        behind_s = t_s - self.plant.time_s
        if behind_s > 1e-9:
            steps = int(np.ceil(behind_s / self.plant.period_s - 1e-6))
            self.plant.follow(np.tile(self._target, (steps, 1)))
        self.time_s = t_s

    def step(self, dt_s: float) -> None:
        """Let time pass by `dt_s`."""
        self.advance_to(self.time_s + dt_s)

    def sample_encoders(self, t_s: float | None = None) -> np.ndarray:
        """Encoder readings (k,) [rad or m], now or at an earlier instant."""
        noise = self.spec.noise
        true = self.plant.encoders(self._instant(t_s))[0]
        noisy = true + noise.encoder_rad * self._encoder_random.standard_normal(true.shape)
        return quantise(noisy, noise.encoder_resolution_rad)

    def sample_currents(self, t_s: float | None = None) -> np.ndarray:
        """Motor currents (k,) [A], now or at an earlier instant."""
        noisy = self.plant.currents(self._instant(t_s))[0] + self._current_noise.next(1)[0]
        return quantise(noisy, self.spec.noise.current_resolution_a)

    def sample_wrench(self, t_s: float | None = None) -> np.ndarray:
        """Six plate channels [N, N.m], now or at an earlier instant; call in order of time."""
        noisy = self.plant.wrench(self._instant(t_s))[0] + self._wrench_noise.next(1)[0]
        return quantise(noisy, self.spec.noise.wrench_resolution)

    def read_joint(self, index: int) -> tuple[float, float]:
        """Encoder reading and motor current of one joint, now."""
        return float(self.sample_encoders()[index]), float(self.sample_currents()[index])

    def read_wrench(self) -> np.ndarray:
        """Six plate channels, now."""
        return self.sample_wrench()

    def _instant(self, t_s: float | None) -> np.ndarray:
        return np.array([self.time_s if t_s is None else t_s])
