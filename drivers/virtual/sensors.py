"""What the sensors add: noise with colour and correlation, and quantisation; one generator a stream."""

from __future__ import annotations

import zlib

import numpy as np
from scipy.signal import lfilter


def stream_generator(seed: int, stream: str) -> np.random.Generator:
    """Random generator of one stream: streams stay alike when another one is left out."""
    return np.random.default_rng(np.random.SeedSequence([seed, zlib.crc32(stream.encode())]))


class ColouredNoise:
    """Gaussian noise of given std per channel, AR(1) in time, equally correlated between channels."""

    def __init__(self, std: np.ndarray, ar1: float, correlation: float, random: np.random.Generator) -> None:
        self._std, self._ar1, self._random = np.asarray(std, dtype=float), ar1, random
        width = len(self._std)
        self._mix = np.linalg.cholesky(
            (1.0 - correlation) * np.eye(width) + correlation * np.ones((width, width))
        )
        self._last = self._mix @ random.standard_normal(width)

    def next(self, count: int) -> np.ndarray:
        """Return the next `count` samples (n, width)."""
        fresh = self._random.standard_normal((count, len(self._std))) @ self._mix.T
        if self._ar1 == 0.0:
            return np.asarray(fresh * self._std)
        drive = np.sqrt(1.0 - self._ar1**2)
        coloured, _ = lfilter([drive], [1.0, -self._ar1], fresh, axis=0, zi=self._ar1 * self._last[None])
        self._last = coloured[-1]
        return np.asarray(coloured * self._std)


def quantise(values: np.ndarray, resolution: float) -> np.ndarray:
    """Round to the sensor's resolution; zero resolution leaves the values alone."""
    return values if resolution == 0.0 else np.round(values / resolution) * resolution


def current_noise_std_a(
    joint_torque_nm: tuple[float, ...], gear_ratio: np.ndarray, torque_constant_nm_a: np.ndarray
) -> np.ndarray:
    """Std of the current (k,) that makes the asked torque noise: torque / (n K)."""
    return np.asarray(joint_torque_nm, dtype=float) / (gear_ratio * torque_constant_nm_a)
