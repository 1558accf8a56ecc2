"""Exact linear dynamics between ticks: distinct poles, driven by a piecewise linear input."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

_LONG = 16  # samples from which one vectorised pass beats stepping


class PoleFilter:
    """Unit-gain low-pass prod(-p_i) / prod(s - p_i) with output, first and second derivative.

    Args:
        poles: distinct, in the left half plane, complex ones in pairs, at least two [rad/s].
        step_s: tick.
        width: number of parallel channels.
    """

    def __init__(self, poles: np.ndarray, step_s: float, width: int) -> None:
        pole = np.asarray(poles, dtype=complex)
        if len(pole) < 2:
            raise ValueError("a pole filter needs two poles, or its output has no second derivative")
        apart = pole[:, None] - pole[None, :] + np.eye(len(pole))
        self._pole = pole
        residue = np.prod(-pole) / np.prod(apart, axis=1)
        self._outputs = np.array([residue, residue * pole, residue * pole**2])
        self._through = float((residue * pole).sum().real)  # of the input to the second derivative
        decay = np.exp(pole * step_s)
        ramp = (decay - 1.0 - pole * step_s) / (pole**2 * step_s)
        self._decay, self._new, self._old = decay, ramp, (decay - 1.0) / pole - ramp
        self._mode = np.zeros((len(pole), width), dtype=complex)
        self._input = np.zeros(width)

    def settle(self, level: np.ndarray) -> None:
        """Start as if the input had been `level` (k,) for ever."""
        self._input = np.array(level, dtype=float)
        self._mode = -np.outer(1.0 / self._pole, level).astype(complex)

    def advance(self, level: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Take the next inputs (n, k); return output and its two derivatives (n, k) at the same ticks."""
        modes = self._long(level) if len(level) >= _LONG else self._short(level)
        self._mode, self._input = modes[:, -1].copy(), np.array(level[-1], dtype=float)
        flat = (self._outputs @ modes.reshape(len(modes), -1)).real.reshape(3, *level.shape)
        return flat[0], flat[1], flat[2] + self._through * level

    def _long(self, level: np.ndarray) -> np.ndarray:
        modes = np.empty((len(self._pole), *level.shape), dtype=complex)
        for index, decay in enumerate(self._decay):
            start = self._old[index] * self._input + decay * self._mode[index]
            weights = [self._new[index], self._old[index]]
            modes[index], _ = lfilter(weights, [1.0, -decay], level, axis=0, zi=start[None])
        return modes

    def _short(self, level: np.ndarray) -> np.ndarray:
        modes = np.empty((len(self._pole), *level.shape), dtype=complex)
        mode = self._mode
        decay = self._decay[:, None]
        inputs = np.concatenate([self._input[None], level])
        push = self._old[:, None, None] * inputs[:-1] + self._new[:, None, None] * inputs[1:]
        for index in range(len(level)):
            mode = decay * mode + push[:, index]
            modes[:, index] = mode
        return modes


def smooth_poles(bandwidth_hz: float) -> np.ndarray:
    """Four real poles around a bandwidth: acceleration stays continuous when the input jumps."""
    return -2.0 * np.pi * bandwidth_hz * np.array([0.85, 0.95, 1.06, 1.18])


def resonant_poles(frequency_hz: float, damping: float) -> np.ndarray:
    """The pole pair of a mass on a spring."""
    natural = 2.0 * np.pi * frequency_hz
    turning = 1j * np.sqrt(1.0 - damping**2)
    return np.array([natural * (-damping + turning), natural * (-damping - turning)])
