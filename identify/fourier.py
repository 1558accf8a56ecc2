"""The measured trajectory as a finite Fourier series, with analytic derivatives (14)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from identify.dataset import Signal
from identify.filters import AntiAliasFilter
from identify.period import PeriodWindow
from identify.rotations import FloatArray

# chance that any line of pure noise is kept in a whole run: one false line at a high frequency is little
# motion but much acceleration, and would feign a misfit
_FALSE_LINES = 1e-3
_FLOOR_WIDTH = 41  # lines the noise floor is averaged over
_FIRST_LINES = 20
_PASSES = 3  # a strong line that the first fit lacks leaks into others until the fit has it


@dataclass(frozen=True)
class FourierTrajectory:
    """Joint motion q(t) = offset + sum cosine cos(l w t) + sine sin(l w t), t from ``start_s``.

    Attributes:
        period_s: period [s].
        start_s: instant of phase zero on the common time base [s].
        lines: harmonic numbers kept, shape (L,).
        offset: shape (n,).
        cosine: shape (n, L).
        sine: shape (n, L).
        noise_std: encoder noise per sample, shape (n,).
        samples: number of encoder samples the fit rests on.
    """

    period_s: float
    start_s: float
    lines: FloatArray
    offset: FloatArray
    cosine: FloatArray
    sine: FloatArray
    noise_std: FloatArray
    samples: int

    @property
    def omega_rad_s(self) -> FloatArray:
        """Angular frequencies of the lines [rad/s], shape (L,)."""
        return 2.0 * np.pi * self.lines / self.period_s

    @property
    def velocity_std(self) -> FloatArray:
        """Std of the fitted velocity at any instant, shape (n,)."""
        return self.noise_std * np.sqrt(2.0 / self.samples * np.sum(self.omega_rad_s**2))

    @property
    def acceleration_std(self) -> FloatArray:
        """Std of the fitted acceleration at any instant, shape (n,)."""
        return self.noise_std * np.sqrt(2.0 / self.samples * np.sum(self.omega_rad_s**4))

    def basis(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Cosines and sines of the lines at instants (N,), each shape (L, N)."""
        return _waves(self.lines, 2.0 * np.pi * (t_s - self.start_s) / self.period_s)

    def evaluate(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Evaluate position, velocity and acceleration.

        Args:
            t_s: instants on the common time base [s], shape (N,).

        Returns:
            q, qd, qdd, each shape (n, N).
        """
        cosines, sines = self.basis(t_s)
        w = self.omega_rad_s
        q = self.offset[:, None] + self.cosine @ cosines + self.sine @ sines
        qd = (self.sine * w) @ cosines - (self.cosine * w) @ sines
        qdd = -(self.cosine * w**2) @ cosines - (self.sine * w**2) @ sines
        return q, qd, qdd


def _waves(lines: FloatArray, phase: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Cosines and sines of integer multiples by repeated rotation: a trig call a sample, not a line."""
    base = np.exp(1j * phase)
    cosines, sines = np.empty((len(lines), len(phase))), np.empty((len(lines), len(phase)))
    power, current = np.ones_like(base), 0
    for row, line in enumerate(lines):
        step = int(line) - current
        power = power * (base if step == 1 else base**step)
        current = int(line)
        cosines[row], sines[row] = power.real, power.imag
    return cosines, sines


def fit_lines(position: Signal, window: PeriodWindow, lines: FloatArray) -> FourierTrajectory:
    """Fit given lines to the encoder samples at their own instants (least squares).

    Args:
        position: joint positions, already cut to whole periods.
        window: period and phase zero.
        lines: harmonic numbers, increasing, shape (L,).

    Returns:
        The trajectory, its noise from the residual of this fit.
    """
    phase = 2.0 * np.pi * (position.t_s - window.start_s) / window.period_s
    cosines, sines = _waves(lines, phase)
    design = np.vstack([np.ones((1, len(phase))), cosines, sines])
    gram, right = design @ design.T, design @ position.values.T
    solution = np.linalg.solve(gram, right)
    rest = position.values - solution.T @ design
    dof = max(len(phase) - len(design), 1)
    count = len(lines)
    return FourierTrajectory(
        window.period_s,
        window.start_s,
        np.asarray(lines),
        solution[0],
        solution[1 : 1 + count].T.copy(),
        solution[1 + count :].T.copy(),
        np.sqrt(np.sum(rest**2, axis=1) / dof),
        len(phase),
    )


def significant_lines(position: Signal, window: PeriodWindow, first: FourierTrajectory) -> FloatArray:
    """Choose lines from the encoder noise: those that stand out of the scatter between periods.

    Args:
        position: joint positions cut to whole periods.
        window: the periods.
        first: a first fit; its residual carries the lines it lacks.

    Returns:
        Harmonic numbers to keep, those of the first fit that are significant included.
    """
    rest = position.values - first.evaluate(position.t_s)[0]
    tables = _period_tables(position.t_s, rest, window)
    bins = tables.shape[2]
    keep = np.zeros(bins // 2 + 1, dtype=bool)
    chance = _FALSE_LINES / (len(rest) * len(keep))
    for joint, table in enumerate(tables):
        keep |= _lines_above_noise(np.fft.rfft(table, axis=1) / bins, first, joint, chance)
    keep[0] = False
    # beyond 0.4 of the sampling rate an averaged encoder has no motion to show
    keep[int(0.8 * bins / 2) :] = False
    return np.flatnonzero(keep)


def _period_tables(t_s: FloatArray, values: FloatArray, window: PeriodWindow) -> FloatArray:
    """Arrange samples (n, N) by period and nearest place in it, shape (n, M, bins); empty places are zero."""
    rate_hz = 1.0 / np.median(np.diff(t_s))
    bins = max(round(rate_hz * window.period_s), 8)
    phase = (t_s - window.start_s) / window.period_s * bins
    shift = np.angle(np.mean(np.exp(2j * np.pi * phase))) / (2.0 * np.pi)  # centre the samples in their bins
    index = np.round(phase - shift).astype(int) % (window.periods * bins)
    counts = np.maximum(np.bincount(index, minlength=window.periods * bins), 1)
    sums = [np.bincount(index, row, minlength=window.periods * bins) / counts for row in values]
    return np.array(sums).reshape(len(values), window.periods, bins)


def _lines_above_noise(
    spectra: FloatArray, first: FourierTrajectory, joint: int, chance: float
) -> FloatArray:
    """Lines whose mean over the periods exceeds its own scatter; spectra (M, lines), chance per line."""
    periods = len(spectra)
    mean = spectra.mean(axis=0)
    power = np.mean(np.abs(spectra - mean) ** 2, axis=0) * periods / max(periods - 1, 1)
    width = min(_FLOOR_WIDTH, len(power) // 2 * 2 - 1)
    kernel = np.ones(width) / width
    floor = np.convolve(np.pad(power, width // 2, mode="reflect"), kernel, mode="valid")[: len(power)]
    mean = mean.copy()
    mean[first.lines] += 0.5 * (first.cosine[joint] - 1j * first.sine[joint])
    # |line|^2 over the variance of the mean is exponential under noise; over an estimate of it F(2, 2 d)
    d = width * max(periods - 1, 1)
    threshold = d * (chance ** (-1.0 / d) - 1.0)
    return np.abs(mean) ** 2 > threshold * np.maximum(floor / periods, 1e-32)


def unfiltered(trajectory: FourierTrajectory, anti_alias: AntiAliasFilter | None) -> FourierTrajectory:
    """Undo the encoder stream's filter line by line (division by its complex gain)."""
    if anti_alias is None:
        return trajectory
    gain = anti_alias.response(trajectory.lines / trajectory.period_s)
    lines = (trajectory.cosine - 1j * trajectory.sine) / gain
    return replace(trajectory, cosine=lines.real, sine=-lines.imag)


def fit_trajectory(position: Signal, window: PeriodWindow, excited: int | None = None) -> FourierTrajectory:
    """Re-estimate the trajectory from the encoders, with as many lines as stand out of their noise.

    Args:
        position: joint positions of the whole run.
        window: its steady periods.
        excited: number of commanded harmonics, kept in any case.

    Returns:
        The trajectory.

    Source:
        Verdonck, Swevers, Samin 2001, section 4 (trajectory from the DFT of the averaged encoder readings).
    """
    cut = position.between(window.start_s, window.stop_s)
    nyquist = int(0.4 * position.rate_hz * window.period_s)
    first_count = max(1, min(max(_FIRST_LINES, excited or 0), nyquist))
    first = fit_lines(cut, window, np.arange(1, first_count + 1))
    commanded = np.arange(1, min(excited or 0, nyquist) + 1)
    for _ in range(_PASSES):
        lines = np.union1d(significant_lines(cut, window, first), commanded)
        lines = lines if len(lines) else np.array([1])
        unchanged = np.array_equal(lines, first.lines)
        first = first if unchanged else fit_lines(cut, window, lines)
        if unchanged:
            break
    return first
