"""Resampling unevenly spaced samples of a band-limited signal, without the error of straight lines."""

from __future__ import annotations

import numpy as np

NOISE_SHARE = 1e-8
"""Variance of the noise that the interpolation reckons with, relative to the signal's."""

_REACH_PERIODS = 12.0
"""Half the width of the neighbourhood, in periods of the slower of the two rates."""

_BATCH = 512


def resample(
    t_s: np.ndarray, values: np.ndarray, at_s: np.ndarray, *, band_hz: float, signal_band_hz: float
) -> np.ndarray:
    """Return the part of a signal below ``band_hz`` at other instants.

    Each output is the linear combination of its neighbours that has the least expected error for a signal
    with a flat spectrum up to ``signal_band_hz``. For evenly spaced samples this is the windowed sinc;
    unlike that it holds for jitter, drift and missing samples as well.

    Args:
        t_s: (n,) rising instants of the samples.
        values: (n, k).
        at_s: (m,) wanted instants.
        band_hz: the output's band limit.
        signal_band_hz: the input's; not above half its sample rate.

    Returns:
        (m, k); extrapolated where ``at_s`` leaves ``t_s``.

    Source: J. Yen, "On nonuniform sampling of bandwidth-limited signals", IRE Trans. Circuit Theory 1956
        (theorem 1 and the minimum-energy signal); A. Papoulis, "Signal analysis", 1977, section 6-2.
    """
    count = min(_neighbours(t_s, band_hz), len(t_s))
    first = np.clip(np.searchsorted(t_s, at_s) - count // 2, 0, len(t_s) - count)
    output = np.empty((len(at_s), values.shape[1]))
    for start in range(0, len(at_s), _BATCH):
        part = slice(start, start + _BATCH)
        index = first[part, None] + np.arange(count)
        weight = _weights(t_s[index] - at_s[part, None], band_hz, signal_band_hz)
        near = values[index]
        level = near.mean(axis=1, keepdims=True)  # a constant is reproduced exactly
        output[part] = level[:, 0] + np.einsum("mc,mck->mk", weight, near - level)
    return output


def _neighbours(t_s: np.ndarray, band_hz: float) -> int:
    rate_hz = 1.0 / float(np.median(np.diff(t_s)))
    return 2 * int(np.ceil(_REACH_PERIODS * max(1.0, rate_hz / (2.5 * band_hz))))


def _weights(distance_s: np.ndarray, band_hz: float, signal_band_hz: float) -> np.ndarray:
    """Return (m, c) weights of neighbours at ``distance_s`` (m, c) from each output."""
    between_s = distance_s[:, :, None] - distance_s[:, None, :]
    covariance = np.sinc(2 * signal_band_hz * between_s)
    covariance += NOISE_SHARE * np.eye(distance_s.shape[1])
    # The output holds only the power below band_hz: the share of the input's band that it keeps.
    cross = band_hz / signal_band_hz * np.sinc(2 * band_hz * distance_s)
    return np.linalg.solve(covariance, cross[:, :, None])[:, :, 0]
