"""Noise of a set of channels: colour of each by an autoregression, and covariance between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identify.rotations import FloatArray

_MAX_ORDER = 40


@dataclass(frozen=True)
class NoiseModel:
    """Stationary noise per sample: A(z) e = w, w white over time with covariance between channels.

    Attributes:
        filters: per channel the coefficients of A, first one 1.
        innovation: covariance of w, shape (c, c).
        std: marginal std per sample, shape (c,).
        dof: degrees of freedom the covariance rests on.
        replicated: True where it comes from repeats; False where from the residual of the fit itself.
    """

    filters: tuple[FloatArray, ...]
    innovation: FloatArray
    std: FloatArray
    dof: float
    replicated: bool

    def whiten(self, series: FloatArray) -> FloatArray:
        """Whiten periodic series over time and channels.

        Args:
            series: shape (c, N) or (c, P, N); the last axis is time, taken as periodic.

        Returns:
            Whitened array of the same shape.
        """
        filtered = np.empty_like(series)
        for channel, taps in enumerate(self.filters):
            filtered[channel] = circular_filter(taps, series[channel])
        root = np.linalg.inv(np.linalg.cholesky(self.innovation))
        return np.tensordot(root, filtered, axes=1)

    def colour_adjoint(self, series: FloatArray) -> FloatArray:
        """Apply the transpose of the noise's square root, so that x' S x = |colour_adjoint(x)|^2.

        Args:
            series: shape (c, P, N), the last axis time, taken as periodic.

        Returns:
            Array of the same shape.
        """
        count = series.shape[-1]
        spectrum = np.fft.rfft(series, axis=-1)
        for channel, taps in enumerate(self.filters):
            spectrum[channel] /= np.conj(np.fft.rfft(taps, count))
        root = np.linalg.cholesky(self.innovation)
        return np.tensordot(root.T, np.fft.irfft(spectrum, count, axis=-1), axes=1)

    def spectrum_at_zero(self) -> FloatArray:
        """Noise power at zero frequency per channel: N times the variance of a mean of N samples."""
        gains = np.array([taps.sum() for taps in self.filters])
        return np.diag(self.innovation) / gains**2

    def simulate(self, rng: np.random.Generator, count: int) -> FloatArray:
        """Draw periodic noise of one period, shape (c, count)."""
        root = np.linalg.cholesky(self.innovation)
        white = root @ rng.standard_normal((len(root), count))
        spectrum = np.fft.rfft(white, axis=1)
        for channel, taps in enumerate(self.filters):
            spectrum[channel] /= np.fft.rfft(taps, count)
        return np.fft.irfft(spectrum, count, axis=1)


def circular_filter(taps: FloatArray, series: FloatArray) -> FloatArray:
    """Filter periodic series (..., N) by a short causal filter."""
    result = taps[0] * series
    for lag in range(1, len(taps)):
        result += taps[lag] * np.roll(series, lag, axis=-1)
    return result


def _levinson_orders(autocovariance: FloatArray, count: int) -> FloatArray:
    """Fit autoregressions of all orders and return the taps of the order that BIC prefers.

    Source:
        Levinson's recursion: every order from the one before.
    """
    taps, variance = np.array([1.0]), float(autocovariance[0])
    best_taps, best_score = taps, count * np.log(variance)
    for order in range(1, len(autocovariance)):
        reflection = -float(taps @ autocovariance[order:0:-1]) / variance
        longer = np.append(taps, 0.0)
        taps = longer + reflection * longer[::-1]
        variance *= 1.0 - reflection**2
        if variance <= 0:
            break
        score = count * np.log(variance) + order * np.log(count)
        if score < best_score:
            best_taps, best_score = taps, score
    return best_taps


def autoregression(scatter: FloatArray) -> FloatArray:
    """Fit the colour of one channel.

    Args:
        scatter: replicates of zero-mean noise, shape (M, N), each row contiguous in time.

    Returns:
        Taps of the whitening filter, first one 1.

    Source:
        Yule-Walker equations on the pooled circular autocovariance, order by BIC.
    """
    repeats, count = scatter.shape
    size = min(_MAX_ORDER, count // 10)
    power = np.mean(np.abs(np.fft.rfft(scatter, axis=1)) ** 2, axis=0) / count
    autocovariance = np.fft.irfft(power, count)[: size + 1]
    if autocovariance[0] <= 0:
        return np.array([1.0])
    return _levinson_orders(autocovariance, repeats * count)


def noise_from_scatter(scatter: FloatArray, dof: float, replicated: bool = True) -> NoiseModel:
    """Estimate the noise from what differs between replicates.

    Args:
        scatter: deviation from the mean of the replicates, shape (c, M, N).
        dof: degrees of freedom of the scatter per channel, N (M - 1) for M replicates.
        replicated: whether the scatter comes from repeats.

    Returns:
        The noise model, per sample.

    Source:
        Verdonck, Swevers, Samin 2001, Eq. (16), with the unbiased divisor N (M - 1).
    """
    channels, repeats, count = scatter.shape
    correction = repeats * count / dof
    variance = np.mean(scatter**2, axis=(1, 2)) * correction
    floor = 1e-12 * max(float(variance.max(initial=0.0)), 1e-12)
    filters = tuple(autoregression(scatter[c]) if variance[c] > floor else np.array([1.0]) for c in range(channels))
    white = np.stack([circular_filter(filters[c], scatter[c]) for c in range(channels)]).reshape(channels, -1)
    innovation = white @ white.T / white.shape[1] * correction
    innovation[np.diag_indices(channels)] += floor
    return NoiseModel(filters, innovation, np.sqrt(variance), dof, replicated)
