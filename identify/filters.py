"""Anti-alias filters of the streams, so that a delay one stream has and another lacks is undone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import signal

from identify.rotations import FloatArray


@dataclass(frozen=True)
class AntiAliasFilter:
    """Low-pass of one stream: an analogue Butterworth, a pure delay, or both.

    Attributes:
        order: of the Butterworth, 0 for none.
        cutoff_hz: its cut-off.
        delay_s: pure delay added.
    """

    order: int = 0
    cutoff_hz: float = 1.0
    delay_s: float = 0.0

    def response(self, frequency_hz: FloatArray) -> FloatArray:
        """Complex gain at given frequencies.

        Args:
            frequency_hz: shape (K,).

        Returns:
            Complex gains, shape (K,).
        """
        gain = np.exp(-2j * np.pi * frequency_hz * self.delay_s)
        if self.order:
            zeros, poles, k = signal.butter(self.order, 2.0 * np.pi * self.cutoff_hz, analog=True, output="zpk")
            gain = gain * signal.freqs_zpk(zeros, poles, k, 2.0 * np.pi * frequency_hz)[1]
        return gain

    @property
    def delay_at_zero_s(self) -> float:
        """Group delay for slow signals [s]; 20.4 ms for the 8th-order, 40 Hz filter of the literature."""
        if not self.order:
            return self.delay_s
        step = 1e-4 * self.cutoff_hz
        return float(-np.angle(self.response(np.array([step]))[0]) / (2.0 * np.pi * step))

    def apply_periodic(self, series: FloatArray, period_s: float) -> FloatArray:
        """Filter periodic series whose last axis covers one period, shape (..., B)."""
        count = series.shape[-1]
        gain = self.response(np.fft.rfftfreq(count, period_s / count))
        if count % 2 == 0:
            gain[-1] = gain[-1].real  # a real series has no phase at half its rate
        return np.fft.irfft(np.fft.rfft(series, axis=-1) * gain, count, axis=-1)

    def apply(self, series: FloatArray, rate_hz: float) -> FloatArray:
        """Filter series that do not repeat, shape (..., N); its ends are padded by their own values."""
        pad = int(np.ceil(20.0 * rate_hz * max(self.delay_at_zero_s, 1.0 / rate_hz)))
        width = [(0, 0)] * (series.ndim - 1) + [(pad, pad)]
        padded = np.pad(series, width, mode="edge")
        filtered = self.apply_periodic(padded, padded.shape[-1] / rate_hz)
        return filtered[..., pad : pad + series.shape[-1]]

    def undo(self, series: FloatArray, rate_hz: float) -> FloatArray:
        """Advance a series by the filter's slow delay, for motion well inside the pass band, shape (..., N)."""
        return AntiAliasFilter(delay_s=-self.delay_at_zero_s).apply(series, rate_hz)
