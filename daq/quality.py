"""What a recording is fit for, in words and numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from daq.checks import Problem, check_recording, counts_samples
from daq.period import Period, find_period, lag_difference, moving_joints
from daq.recording import Recording, Stream
from daq.stream_quality import StreamQuality, stream_quality

PERIODIC = "fit for periodic identification"
NON_PERIODIC = "fit for non-periodic identification only"
UNFIT = "unfit"
_LOSS_LIMIT = 0.05  # beyond, the samples that are left say more about the bus than about the robot
_RATE_TOLERANCE = 1e-3  # of a claimed fundamental frequency
_MIN_PERIODS = 2  # noise is what differs between periods


@dataclass(frozen=True)
class Quality:
    """The inspection of a recording.

    Attributes:
        source: the log.
        verdict: what it is fit for.
        reasons: why, in words.
        problems: what makes it unusable.
        notes: what is worth knowing and stops nothing.
        streams: each stream's sampling and channels.
        period: the repetition of the motion, if any.
        claimed_hz: the fundamental frequency its metadata state.
        repeatability: channel to the rms a single period deviates, where there is a common period.
        standing: joints that do not move.
        metadata: the run's record.
    """

    source: str
    verdict: str
    reasons: tuple[str, ...]
    problems: tuple[Problem, ...]
    notes: tuple[str, ...]
    streams: tuple[StreamQuality, ...]
    period: Period | None
    claimed_hz: float | None
    repeatability: Mapping[str, float]
    standing: tuple[str, ...]
    metadata: Mapping[str, str]

    @property
    def fit(self) -> bool:
        """Whether the recording can be used at all."""
        return self.verdict != UNFIT

    def to_json(self) -> dict[str, Any]:
        """The inspection as plain data; numbers that are not finite become null."""
        return {"schema_version": 1, **_plain(asdict(self))}


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return value


def inspect_recording(recording: Recording) -> Quality:
    """Judge a recording: is it sane, does it repeat, what may be done with it."""
    problems = check_recording(recording)
    joints = recording.joint_states
    blocking = {problem.code for problem in problems}
    streams = () if "empty" in blocking else tuple(_streams(recording))
    usable = not blocking & {"empty", "not_finite", "absurd", "backward", "repeated"}
    claimed = _claimed_hz(recording)
    period = find_period(joints, claimed) if usable else None
    moves = moving_joints(joints) if usable else np.ones(len(joints.names), bool)
    standing = tuple(name for name, moved in zip(joints.names, moves, strict=True) if not moved)
    verdict, reasons = _verdict(recording, problems, streams, period, standing)
    repeatability = _repeatability(recording, period) if period and period.common else {}
    notes = (*recording.warnings, *_notes(streams, period, claimed, standing))
    return Quality(recording.source, verdict, reasons, tuple(problems), notes, streams, period, claimed,
                   repeatability, standing, dict(recording.metadata))


def _streams(recording: Recording) -> list[StreamQuality]:
    joints = recording.joint_states
    counted = counts_samples(recording, joints)
    return [stream_quality(joints, counted)] + [
        stream_quality(stream, counts_samples(recording, stream), joints, counted)
        for stream in recording.streams[1:]
    ]


def _claimed_hz(recording: Recording) -> float | None:
    try:
        value = float(recording.metadata["fundamental_hz"])
    except (KeyError, ValueError):
        return None
    return value if math.isfinite(value) and value > 0 else None


def _verdict(
    recording: Recording, problems: list[Problem], streams: tuple[StreamQuality, ...],
    period: Period | None, standing: tuple[str, ...],
) -> tuple[str, tuple[str, ...]]:
    against = [problem.sentence for problem in problems] + _against_use(recording, streams, standing)
    if against:
        return UNFIT, tuple(against)
    if period is None:
        return NON_PERIODIC, ("No moving joint repeats its motion: noise cannot be told from physics "
                              "by comparing periods.",)
    if not period.common:
        return NON_PERIODIC, (
            f"{_list(period.repeating)} repeat after {period.period_s:.4g} s but {_list(period.other)} do "
            f"not: that is not a period of the motion.",)
    if period.periods < _MIN_PERIODS:
        return NON_PERIODIC, (f"The motion repeats after {period.period_s:.4g} s, but fewer than "
                              f"{_MIN_PERIODS} whole periods were recorded.",)
    return PERIODIC, (f"All moving joints repeat after {period.period_s:.6g} s, {period.periods} whole "
                      f"periods.",)


def _against_use(
    recording: Recording, streams: tuple[StreamQuality, ...], standing: tuple[str, ...]
) -> list[str]:
    found = []
    if len(standing) == len(recording.joint_states.names):
        found.append("No joint moves: there is nothing to identify from.")
    has_effort = "effort" in recording.joint_states.data
    if recording.motor_currents is None and recording.wrench is None and not has_effort:
        found.append("There are neither motor currents nor efforts nor a force plate: no cause of the motion "
                     "was recorded.")
    for stream in streams:
        if stream.loss_share > _LOSS_LIMIT:
            found.append(f"{stream.topic} lost {stream.loss_share:.1%} of its samples: "
                         f"repair the bus first.")
        frozen = tuple(name for name in stream.frozen if not name.startswith("velocity"))
        if frozen and stream.topic != "/joint_setpoints":
            found.append(f"{stream.topic}: {_list(frozen)} never changes: the channel is not measured.")
    return found


def _notes(
    streams: tuple[StreamQuality, ...], period: Period | None, claimed: float | None,
    standing: tuple[str, ...],
) -> list[str]:
    notes = []
    for stream in streams:
        if stream.lost:
            notes.append(f"{stream.topic} lost {stream.lost} samples in {stream.gap_count} gaps "
                         f"({stream.holes} by its own count), the longest "
                         f"{stream.gaps[0].length_s * 1e3:.3g} ms.")
        if stream.saturated:
            notes.append(f"{stream.topic}: {_list(stream.saturated)} is clipped at its extreme: those "
                         f"samples hide the true value.")
        if stream.stuck:
            notes.append(f"{stream.topic}: {_list(stream.stuck)} stands still to the last bit for more than "
                         f"half a second.")
    if standing:
        notes.append(f"{_list(standing)} did not move.")
    if claimed and period and period.common and abs(claimed * period.period_s - 1) > _RATE_TOLERANCE:
        notes.append(f"The metadata state {claimed:.6g} Hz but the motion repeats at "
                     f"{1 / period.period_s:.6g} Hz.")
    elif claimed and not (period and period.common):
        notes.append(f"The metadata state a fundamental of {claimed:.6g} Hz but the motion has no common "
                     f"period.")
    return notes


def _repeatability(recording: Recording, period: Period) -> dict[str, float]:
    """Channel to the rms by which a single period deviates, over the repeating stretch."""
    out: dict[str, float] = {}
    start_ns = recording.joint_states.stamp_ns[0]
    for stream in recording.streams:
        for key, values in stream.data.items():
            spread = _deviation(stream, values, period, int(start_ns))
            for name, value in zip(stream.names or ("x", "y", "z"), spread, strict=True):
                out[f"{stream.topic} {key} {name}"] = float(value)
    return out


def _deviation(stream: Stream, values: np.ndarray, period: Period, start_ns: int) -> np.ndarray:
    t = (stream.stamp_ns - start_ns) * 1e-9
    instants, change = lag_difference(t, values, period.period_s)
    inside = (instants >= period.start_s) & (instants <= period.start_s + period.length_s - period.period_s)
    if not inside.any():
        return np.full(values.shape[1], np.nan)
    return np.sqrt((change[inside] ** 2).mean(axis=0) / 2)


def _list(names: tuple[str, ...]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
