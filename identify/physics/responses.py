"""Linear responses of series along the run: delays, lags and resonances."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from identify.physics.scene import Scene
from identify.rotations import FloatArray


def _line_rad_s(scene: Scene) -> FloatArray:
    """Angular frequencies of a periodic grid's lines [rad/s]."""
    return 2.0 * np.pi * np.fft.rfftfreq(len(scene.t_s), scene.step_s)


def _through(scene: Scene, series: FloatArray, response: FloatArray) -> FloatArray:
    return np.fft.irfft(np.fft.rfft(series, axis=-1) * response, len(scene.t_s), axis=-1)


def delayed(scene: Scene, series: FloatArray, delay_s: float) -> FloatArray:
    """A smooth series as it was a delay earlier (later where negative).

    Args:
        scene: the scene.
        series: shape (..., B).
        delay_s: the delay [s].

    Returns:
        Shape (..., B).
    """
    if scene.periodic:
        return _through(scene, series, np.exp(-1j * delay_s * _line_rad_s(scene)))
    rows = [np.interp(scene.t_s - delay_s, scene.t_s, row) for row in series.reshape(-1, len(scene.t_s))]
    return np.reshape(rows, series.shape)


def lagging(scene: Scene, series: FloatArray, time_constant_s: float) -> FloatArray:
    """A series through a first-order lag of unit gain, settled at the start.

    Args:
        scene: the scene.
        series: shape (B,).
        time_constant_s: of the lag [s].

    Returns:
        Shape (B,).
    """
    if scene.periodic:
        return _through(scene, series, 1.0 / (1.0 + 1j * time_constant_s * _line_rad_s(scene)))
    keep = np.exp(-scene.step_s / time_constant_s)
    return lfilter([1.0 - keep], [1.0, -keep], series, zi=[keep * series[0]])[0]


def resonant(scene: Scene, series: FloatArray, frequency_hz: float, damping: float) -> FloatArray:
    """A series through a resonance of unit static gain, settled at the start.

    Args:
        scene: the scene.
        series: shape (B,).
        frequency_hz: undamped natural frequency [Hz].
        damping: damping ratio.

    Returns:
        Shape (B,).
    """
    natural = 2.0 * np.pi * frequency_hz
    if scene.periodic:
        line = _line_rad_s(scene) / natural
        return _through(scene, series, 1.0 / (1.0 - line**2 + 2j * damping * line))
    pole = np.exp((-damping + 1j * np.sqrt(1.0 - damping**2)) * natural * scene.step_s)
    feedback = np.array([1.0, -2.0 * pole.real, abs(pole) ** 2])
    gain = feedback.sum()
    held = series[0]
    return held + lfilter([gain], feedback, series - held)
