"""Does the named physics predict a recording that was not used in the fit?"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy import interpolate

from identify.dataset import Dataset
from identify.diagnosis.augmented import Augmented, unaugmented
from identify.fit import Fit
from identify.physics.scene import Scene
from identify.robot import WRENCH_CHANNELS
from identify.rotations import FloatArray
from identify.smoothing import SmoothMotion, smooth
from identify.validation import ChannelPrediction, validate

_BLOCKS = 40  # of the recording, resampled whole: errors stay correlated inside
_DRAWS = 500


@dataclass(frozen=True)
class Gain:
    """Held-out error of one channel before and after.

    Attributes:
        before: RMS under the baseline [N.m or N].
        after: RMS with the named effects.
        noise: noise per sample.
        low: lower end of the 95 % bootstrap interval of before - after.
        high: upper end.
    """

    before: float
    after: float
    noise: float
    low: float
    high: float


@dataclass(frozen=True)
class HeldOut:
    """Held-out comparison.

    Attributes:
        channels: a gain each.
        notes: what the reader must know.
        predictions: channel predictions before.
        after: channel predictions after.
    """

    channels: dict[str, Gain]
    notes: tuple[str, ...] = field(default=())
    predictions: tuple[ChannelPrediction, ...] = field(default=())
    after: tuple[ChannelPrediction, ...] = field(default=())


def _effect_rows(fit: Fit, augmented: Augmented, motion: SmoothMotion) -> FloatArray:
    """Baseline change and effects on the recording's grid, drive rows then wrench rows, (rows, B)."""
    has_wrench = fit.model.kind != "internal"
    scene = Scene(
        fit.model, augmented.theta, augmented.scale, motion.t_s - motion.t_s[0], motion.q, motion.qd, motion.qdd, False, has_wrench
    )
    total = scene.prediction.copy()
    for item in augmented.additions:
        columns = item.effect.columns(scene, item.place, item.shape)
        total += np.tensordot(columns, item.values, axes=([1], [0]))
    return total


def _after(fit: Fit, augmented: Augmented, before: tuple[ChannelPrediction, ...], motion: SmoothMotion) -> list[ChannelPrediction]:
    """Predict the same channels by one interpolation for any set of effects, so that only the effects differ."""
    n = fit.model.robot.n
    names = fit.model.robot.joint_names + (WRENCH_CHANNELS if fit.model.kind != "internal" else ())
    rows = _effect_rows(fit, augmented, motion)
    result = []
    for item in before:
        index = names.index(item.channel)
        predicted = interpolate.interp1d(motion.t_s, rows[index], assume_sorted=True, fill_value="extrapolate")(item.t_s)
        measured = item.measured
        if index < n:
            measured = measured * fit.solution.scale[index] / augmented.scale[index]
        elif fit.model.robot.plate is not None and fit.model.robot.plate.tared:
            predicted = predicted + np.mean((measured - predicted)[item.scored])
        result.append(ChannelPrediction(item.channel, item.t_s, measured, predicted, item.scored, item.noise_std))
    return result


def _interval(before: FloatArray, after: FloatArray, rng: np.random.Generator) -> tuple[float, float]:
    """Block bootstrap of the drop in RMS."""
    pairs = [(np.sum(b**2), np.sum(a**2), len(b)) for b, a in zip(np.array_split(before, _BLOCKS), np.array_split(after, _BLOCKS), strict=True)]
    table = np.array(pairs)
    drawn = table[rng.integers(0, len(table), (_DRAWS, len(table)))].sum(axis=1)
    drops = np.sqrt(drawn[:, 0] / drawn[:, 2]) - np.sqrt(drawn[:, 1] / drawn[:, 2])
    low, high = np.quantile(drops, [0.025, 0.975])
    return float(low), float(high)


def held_out(fit: Fit, augmented: Augmented, data: Dataset, rng: np.random.Generator) -> HeldOut:
    """Predict another recording with and without the named effects.

    Args:
        fit: the baseline.
        augmented: the joint fit with the effects.
        data: the other recording.
        rng: for the bootstrap.

    Returns:
        RMS before and after, noise floor and bootstrap interval of every channel.
    """
    validation = validate(fit, data)
    motion = smooth(data.position, validation.bandwidth_hz)
    before = _after(fit, unaugmented(fit), validation.channels, motion)
    after = _after(fit, augmented, validation.channels, motion)
    gains = {}
    for old, new in zip(before, after, strict=True):
        low, high = _interval(
            (old.measured - old.predicted)[old.scored], (new.measured - new.predicted)[new.scored], rng
        )
        gains[old.channel] = Gain(old.rms, new.rms, old.noise_std, low, high)
    return HeldOut(gains, validation.notes, tuple(before), tuple(after))
