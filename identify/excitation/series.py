"""The excitation: finite Fourier series of one fundamental for all joints (14)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from identify.rotations import FloatArray


@dataclass(frozen=True)
class FourierSeries:
    """q_j(t) = offset + sum_p cosine cos(p w t) + sine sin(p w t).

    Attributes:
        fundamental_hz: repetition rate of the motion [Hz].
        offset: [rad or m], shape (n,).
        cosine: shape (n, h).
        sine: shape (n, h).

    Source:
        Verdonck, Swevers, Samin 2001, Eq. (14).
    """

    fundamental_hz: float
    offset: FloatArray
    cosine: FloatArray
    sine: FloatArray

    @property
    def harmonics(self) -> int:
        """Number of lines."""
        return self.cosine.shape[1]

    @property
    def period_s(self) -> float:
        """Duration of one period [s]."""
        return 1.0 / self.fundamental_hz

    @property
    def omega_rad_s(self) -> FloatArray:
        """Angular frequencies of the lines [rad/s], shape (h,)."""
        return 2.0 * np.pi * self.fundamental_hz * np.arange(1, self.harmonics + 1)

    def grid_s(self, count: int) -> FloatArray:
        """Evenly spaced instants of one period, end excluded [s], shape (count,)."""
        return np.arange(count) * (self.period_s / count)

    def evaluate(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Evaluate position, velocity and acceleration.

        Args:
            t_s: instants [s], shape (N,).

        Returns:
            q, qd, qdd, each shape (n, N).
        """
        w = self.omega_rad_s
        phase = np.outer(w, t_s)
        cosines, sines = np.cos(phase), np.sin(phase)
        q = self.offset[:, None] + self.cosine @ cosines + self.sine @ sines
        qd = (self.sine * w) @ cosines - (self.cosine * w) @ sines
        qdd = -(self.cosine * w**2) @ cosines - (self.sine * w**2) @ sines
        return q, qd, qdd

    def derivative(self, order: int) -> FourierSeries:
        """Differentiate with respect to time, ``order`` times (order 0 drops nothing)."""
        if order == 0:
            return self
        w = self.omega_rad_s
        once = FourierSeries(self.fundamental_hz, np.zeros_like(self.offset), self.sine * w, -self.cosine * w)
        return once.derivative(order - 1)

    def amplitude(self, order: int = 0) -> FloatArray:
        """Bound of the order-th derivative's deviation from its mean, sum of line amplitudes, shape (n,)."""
        return np.hypot(self.cosine, self.sine) @ self.omega_rad_s**order

    def shrunk(self, factor: float, pose: FloatArray | None = None) -> FourierSeries:
        """Draw the whole motion towards a pose (its own offset by default) by a factor in [0, 1]."""
        offset = self.offset if pose is None else pose + factor * (self.offset - pose)
        return replace(self, offset=offset, cosine=factor * self.cosine, sine=factor * self.sine)

    def rounded(self, decimals: int = 10) -> FourierSeries:
        """Round the coefficients, so that a file holds exactly what was checked."""
        parts = [np.round(part, decimals) + 0.0 for part in (self.offset, self.cosine, self.sine)]
        return FourierSeries(self.fundamental_hz, *parts)
