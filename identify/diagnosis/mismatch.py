"""Does a held-out recording show the same robot? Another load, another arm and a moved plate tell themselves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from identify.dataset import Dataset
from identify.diagnosis.held_out import HeldOut
from identify.fit import Fit
from identify.inertia import PARAMETERS
from identify.robot import WRENCH_CHANNELS
from identify.rotations import FloatArray
from identify.smoothing import smooth
from identify.validation import ChannelPrediction

_MOST = 6000  # samples looked at
_GAIN = 300.0  # chi-square that a cause must explain; held-out errors are coloured, so far above its distribution
_EXPLAINS = 0.5  # share of the error beyond noise that one cause must explain to be named
_FAILS = 0.4  # error over signal from which a prediction is no prediction
_VISIBLE = 0.5  # of the noise: RMS a cause must reach in some channel


@dataclass(frozen=True)
class Mismatch:
    """Why a held-out recording is not of the fitted robot as it was.

    Attributes:
        kind: ``payload``, ``plate_moved`` or ``other_robot``.
        sentence: what was seen and what to do.
    """

    kind: str
    sentence: str


@dataclass(frozen=True)
class _Errors:
    """Held-out errors in units of the noise, scored samples only.

    Attributes:
        rest: one vector a channel.
        excess: chi-square beyond the noise.
    """

    channels: list[ChannelPrediction]
    picked: list[FloatArray]
    rest: list[FloatArray]

    @property
    def excess(self) -> float:
        return float(sum(float(r @ r) - len(r) for r in self.rest))


def mismatches(fit: Fit, held_out: HeldOut, other: Dataset) -> tuple[Mismatch, ...]:
    """Look for another load, another robot or a moved plate behind a held-out recording's errors.

    Args:
        fit: the baseline.
        held_out: predictions of the recording, named effects included: what they explain is no mismatch.
        other: the held-out recording.

    Returns:
        What was seen, the most explanatory alone; empty where the recording may be used.
    """
    errors = _errors(list(held_out.after))
    if errors.excess <= 0.0:
        return ()
    motion = smooth(other.position)
    found = [_payload(fit, errors, motion.at), _moved(fit, errors)]
    named = sorted((item for item in found if item is not None), key=lambda item: -item[0])
    if named:
        return (named[0][1],)
    other_robot = _other_robot(errors, other.source)
    return (other_robot,) if other_robot is not None else ()


def _errors(channels: list[ChannelPrediction]) -> _Errors:
    picked, rest = [], []
    for item in channels:
        scored = np.flatnonzero(item.scored & np.isfinite(item.measured - item.predicted))
        scored = scored[:: max(1, len(scored) // _MOST)]
        error = (item.measured - item.predicted)[scored] / max(item.noise_std, 1e-12)
        picked.append(scored)
        rest.append(error)
    return _Errors(channels, picked, rest)


def _explained(errors: _Errors, columns: list[FloatArray]) -> tuple[float, FloatArray, float]:
    """Gain, coefficients, largest RMS in a channel of columns (N, k) in units of the noise."""
    stacked, target = np.vstack(columns), np.concatenate(errors.rest)
    norms = np.linalg.norm(stacked, axis=0)
    safe = np.where(norms > 0, norms, 1.0)
    left, values, right = np.linalg.svd(stacked / safe, full_matrices=False)
    seen = values > 1e-6 * values.max(initial=1e-300)
    toward = left[:, seen].T @ target
    solution = (right[seen].T @ (toward / values[seen])) / safe
    largest = max((float(np.sqrt(np.mean((c @ solution) ** 2))) for c in columns if len(c)), default=0.0)
    return float(toward @ toward), solution, largest


def _worth_naming(gain: float, largest: float, excess: float) -> bool:
    return gain > _GAIN and gain > _EXPLAINS * excess and largest > _VISIBLE


def _payload(fit: Fit, errors: _Errors, at) -> tuple[float, Mismatch] | None:  # noqa: ANN001
    model = fit.model
    link = model.robot.link_names[-1]
    turn = np.array([[p.definition.get(f"{link}.{name}", 0.0) for name in PARAMETERS] for p in model.parameters])
    centred = [p.group == "plate" for p in model.parameters]
    columns = []
    for item, picked, in zip(errors.channels, errors.picked, strict=True):
        motion = at(item.t_s[picked])
        joint = item.channel not in WRENCH_CHANNELS
        rows = model.drive_rows(*motion) if joint else model.wrench_rows(*motion)
        index = (model.robot.joint_names if joint else WRENCH_CHANNELS).index(item.channel)
        own = rows.columns[index].T @ turn
        if not joint and any(centred):
            own = own - own.mean(axis=0)  # the tare takes the mean out of the error too
        columns.append(own / max(item.noise_std, 1e-12))
    gain, _, largest = _explained(errors, columns)
    if not _worth_naming(gain, largest, errors.excess):
        return None
    sentence = (
        f"The held-out recording carries another load at {link} than the run: a change of that link alone explains "
        f"{100 * min(gain / errors.excess, 1.0):.0f} % of what it is mispredicted by. It is not used as proof; record it with the "
        "run's load, or identify it on its own and compare with --against."
    )
    return gain, Mismatch("payload", sentence)


def _moved(fit: Fit, errors: _Errors) -> tuple[float, Mismatch] | None:
    """A rigid change of the plate's pose between the runs: the wrench in another frame."""
    there = {item.channel: k for k, item in enumerate(errors.channels)}
    if not all(channel in there for channel in WRENCH_CHANNELS):
        return None
    index = [there[channel] for channel in WRENCH_CHANNELS]
    picked = errors.picked[index[0]]
    if any(len(errors.picked[k]) != len(picked) for k in index):
        return None
    predicted = np.stack([errors.channels[k].predicted[picked] for k in index])
    measured = np.stack([errors.channels[k].measured[picked] for k in index])
    noise = np.array([max(errors.channels[k].noise_std, 1e-12) for k in index])
    turn, shift, gain, largest = _pose(predicted, measured, noise)
    wrench = _Errors([], [], [errors.rest[k] for k in index])
    if not _worth_naming(gain, largest, max(wrench.excess, 1.0)):
        return None
    words = ", ".join(f"{axis} {1000 * value:+.0f} mm" for axis, value in zip("xyz", shift, strict=True))
    turned = np.degrees(turn)
    sentence = (
        f"The force plate has moved against the robot between the run and the held-out recording: its wrench fits after a turn of "
        f"{np.linalg.norm(turned):.2g} degrees (about z {turned[2]:+.2g}) and a shift of {words}. The plate's channels of the held-out "
        "recording are not used as proof; bring the plate back, or record both with one setting."
    )
    return gain, Mismatch("plate_moved", sentence)


def _pose(predicted: FloatArray, measured: FloatArray, noise: FloatArray) -> tuple[FloatArray, FloatArray, float, float]:
    """Rotation vector [rad] and shift [m] that turn the predicted wrench into the measured one, offsets free."""
    rotation, shift = Rotation.identity(), np.zeros(3)
    start = _centred(measured - predicted) / noise[:, None]
    for _ in range(12):
        force, torque = rotation.apply(predicted[:3].T).T, rotation.apply(predicted[3:].T).T
        torque = torque - np.cross(shift, force, axis=0)
        rest = _centred(measured - np.vstack([force, torque])) / noise[:, None]
        columns = np.stack([_pose_column(axis, force, torque) for axis in range(6)], axis=-1)
        columns = (columns - columns.mean(axis=1, keepdims=True)) / noise[:, None, None]
        step = np.linalg.lstsq(columns.reshape(-1, 6), rest.ravel(), rcond=1e-8)[0]
        rotation, shift = Rotation.from_rotvec(step[:3]) * rotation, shift + step[3:]
        if np.abs(step).max() < 1e-6:
            break
    change = start - rest
    largest = float(np.sqrt(np.mean(change**2, axis=1)).max())
    return rotation.as_rotvec(), shift, float(np.sum(start**2) - np.sum(rest**2)), largest


def _centred(values: FloatArray) -> FloatArray:
    return values - values.mean(axis=1, keepdims=True)


def _pose_column(axis: int, force: FloatArray, torque: FloatArray) -> FloatArray:
    """Change of the wrench (6, N) with a turn or a shift along an axis."""
    unit = np.zeros((3, 1))
    unit[axis % 3] = 1.0
    if axis < 3:
        return np.vstack([np.cross(unit, force, axis=0), np.cross(unit, torque, axis=0)])
    return np.vstack([np.zeros_like(force), -np.cross(unit, force, axis=0)])


def _other_robot(errors: _Errors, source: str) -> Mismatch | None:
    """Channels whose error is as large as what they measure."""
    failed = []
    for item, picked, rest in zip(errors.channels, errors.picked, errors.rest, strict=True):
        size = float(np.std(item.measured[picked])) if len(picked) else 0.0
        error = float(np.sqrt(np.mean(rest**2))) * item.noise_std if len(rest) else 0.0
        if error > 5.0 * item.noise_std and error > _FAILS * size:
            failed.append(item.channel)
    if 2 * len(failed) < len(errors.channels):
        return None
    sentence = (
        f"{source} is not predicted at all ({', '.join(failed)} are off by as much as they measure): it is a recording of another robot "
        "or of one that was changed. It is not used as proof; give a recording of this robot."
    )
    return Mismatch("other_robot", sentence)
