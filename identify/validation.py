"""How well a fit predicts another recording."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy import interpolate

from identify.blocks import nominal_torque
from identify.dataset import Dataset, Signal
from identify.errors import UnusableDataError
from identify.fit import Fit
from identify.friction import drive_velocity
from identify.model import Rows
from identify.parameters import plate_parameters
from identify.robot import WRENCH_CHANNELS
from identify.rotations import FloatArray
from identify.smoothing import SmoothMotion, smooth

# speeds within so many of their std have no known direction; quick enough to leave few samples out
_SLOW = 5.0


@dataclass(frozen=True)
class ChannelPrediction:
    """Prediction of one channel of another recording.

    Attributes:
        channel: its name.
        t_s: instants on the recording's time base, shape (K,).
        measured: under the estimated torque constants [N.m or N], shape (K,).
        predicted: shape (K,).
        scored: False at rest, where friction may take any value up to Coulomb, and near gaps, shape (K,).
        noise_std: noise per sample expected from the fit's replicates [N.m or N].
    """

    channel: str
    t_s: FloatArray
    measured: FloatArray
    predicted: FloatArray
    scored: FloatArray
    noise_std: float

    @property
    def rms(self) -> float:
        """RMS of the prediction error over the scored samples."""
        rest = (self.measured - self.predicted)[self.scored]
        return float(np.sqrt(np.mean(rest**2))) if rest.size else float("nan")

    @property
    def relative_error(self) -> float:
        """100 |u - u_hat| / |u| over the scored samples [%]."""
        u = self.measured[self.scored]
        return float(100.0 * np.linalg.norm(u - self.predicted[self.scored]) / max(np.linalg.norm(u), 1e-300))


@dataclass(frozen=True)
class Validation:
    """Predictions of all channels.

    Attributes:
        channels: one prediction each.
        bandwidth_hz: of the filter that gave the accelerations.
        notes: what the reader must know.
    """

    channels: tuple[ChannelPrediction, ...]
    bandwidth_hz: float
    notes: tuple[str, ...] = field(default=())

    @property
    def rms(self) -> dict[str, float]:
        """RMS error a channel."""
        return {item.channel: item.rms for item in self.channels}


def validate(fit: Fit, data: Dataset, bandwidth_hz: float | None = None) -> Validation:
    """Predict a recording that was not used in the fit.

    Args:
        fit: the fit.
        data: the other recording, joints in the robot's order.
        bandwidth_hz: of the differentiating filter; chosen from the spectrum when None.

    Returns:
        The predictions.

    Raises:
        UnusableDataError: the recording has none of the channels of the model.
    """
    motion = smooth(data.position, bandwidth_hz)
    items: list[ChannelPrediction] = []
    notes: list[str] = []
    if fit.model.kind != "external" and data.drive_signal is not None:
        items += _drive_channels(fit, data, motion)
        share = 1.0 - np.mean([item.scored.mean() for item in items])
        notes.append(f"{100 * share:.1f} % of the joint samples are at rest or reversing, where friction has no known direction: not scored.")
    if fit.model.kind != "internal" and data.wrench is not None:
        items += _wrench_channels(fit, data, motion)
        if plate_parameters(fit.model.robot):
            notes.append("The plate is tared before each run: its six offsets are taken anew from this recording.")
    if not items:
        raise UnusableDataError(f"{data.source} has no channel that the {fit.model.kind} model predicts; record currents or wrench.")
    return Validation(tuple(items), motion.bandwidth_hz, tuple(notes))


def _inside(signal: Signal, motion: SmoothMotion) -> Signal:
    return signal.between(motion.t_s[0], np.nextafter(motion.t_s[-1], np.inf))


def _predict(rows: Rows, theta: FloatArray) -> FloatArray:
    return np.tensordot(rows.columns, theta, axes=([1], [0])) + rows.known


def _filtered(fit: Fit, data: Dataset, stream: str, motion: SmoothMotion, t_s: FloatArray, rows_of: object) -> FloatArray:
    """Predict at instants; through the stream's anti-alias filter where it has one."""
    anti_alias = data.filters.get(stream)
    theta = np.where(fit.solution.identifiable[: len(fit.model.parameters)], fit.solution.theta, 0.0)
    if anti_alias is None:
        return _predict(rows_of(*motion.at(t_s)), theta)  # type: ignore[operator]
    series = _predict(rows_of(motion.q, motion.qd, motion.qdd), theta)  # type: ignore[operator]
    return interpolate.CubicSpline(motion.t_s, anti_alias.apply(series, motion.rate_hz), axis=1)(t_s)


def _drive_channels(fit: Fit, data: Dataset, motion: SmoothMotion) -> list[ChannelPrediction]:
    model, robot = fit.model, fit.model.robot
    signal = _inside(nominal_torque(model, data), motion)
    predicted = _filtered(fit, data, "current", motion, signal.t_s, model.drive_rows)
    speed = drive_velocity(robot, motion.at(signal.t_s)[1])
    speed_std = np.abs(robot.drive_matrix) @ motion.velocity_std
    noise = fit.noise_std
    result = []
    for k, joint in enumerate(robot.joints):
        rubs = bool(joint.drive.friction)
        scored = motion.valid_at(signal.t_s) & ((np.abs(speed[k]) > _SLOW * speed_std[k]) | (not rubs))
        measured = signal.values[k] / fit.solution.scale[k]
        result.append(ChannelPrediction(joint.name, signal.t_s, measured, predicted[k], scored, noise[joint.name]))
    return result


def _wrench_channels(fit: Fit, data: Dataset, motion: SmoothMotion) -> list[ChannelPrediction]:
    assert data.wrench is not None
    signal = _inside(data.wrench, motion)
    predicted = _filtered(fit, data, "wrench", motion, signal.t_s, fit.model.wrench_rows)
    scored = motion.valid_at(signal.t_s)
    if plate_parameters(fit.model.robot):
        predicted = predicted + np.mean((signal.values - predicted)[:, scored], axis=1, keepdims=True)
    noise = fit.noise_std
    return [
        ChannelPrediction(channel, signal.t_s, signal.values[k], predicted[k], scored, noise[channel])
        for k, channel in enumerate(WRENCH_CHANNELS)
    ]
