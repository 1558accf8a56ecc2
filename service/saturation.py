"""Samples at the end of a sensor's range: they say only that the truth lies beyond, so they are left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from daq.recording import Recording, Stream
from service.errors import LogError

_PILED = 4.0  # times as many samples as at the next value: a clipped channel piles up at its end, a peak does not
_FEWEST = 8  # samples there
_LEAST = 0.002  # and so much of the channel
_TOO_MUCH = 0.25  # of a channel: what is left cannot speak for the motion
_KEYS = ("current", "effort", "force", "torque")
_STILL = 1e-9  # a channel that hardly moves is constant, not clipped


def without_saturation(recording: Recording) -> tuple[Recording, tuple[str, ...]]:
    """Leave out the instants at which a measured channel sits at the end of its range.

    Args:
        recording: the log.

    Returns:
        The recording without them, and a warning for every channel concerned.

    Raises:
        LogError: a channel is clipped for so long that the rest cannot speak for the motion.
    """
    currents, first = _cleaned(recording.motor_currents, recording.source)
    wrench, second = _cleaned(recording.wrench, recording.source)
    states, third = recording.joint_states, ()
    if "effort" in states.data:
        states, third = _cleaned_states(states, recording.source)
    return replace(recording, joint_states=states, motor_currents=currents, wrench=wrench), (*first, *second, *third)


def _cleaned_states(states: Stream, source: str) -> tuple[Stream, tuple[str, ...]]:
    cleaned, warnings = _cleaned(states, source)
    assert cleaned is not None
    return cleaned, warnings


def _cleaned(stream: Stream | None, source: str) -> tuple[Stream | None, tuple[str, ...]]:
    if stream is None or len(stream) == 0:
        return stream, ()
    clipped = np.zeros(len(stream), dtype=bool)
    warnings = []
    for key in _KEYS:
        if key not in stream.data:
            continue
        for column, values in enumerate(stream.data[key].T):
            own, extremes = saturated(values)
            if not own.any():
                continue
            name = stream.names[column] if stream.names else f"{key}.{'xyz'[column]}"
            share = float(own.mean())
            bounds = " and ".join(f"{v:.4g}" for v in extremes)
            if share > _TOO_MUCH:
                raise LogError(
                    f"{source}: {stream.topic} {name} is clipped at {bounds} for {100 * share:.0f} % of the run; widen the sensor's range or "
                    "slow the motion, and record again."
                )
            warnings.append(
                f"{stream.topic} {name} is clipped at {bounds} for {100 * share:.2g} % of the run; those instants are left out of the fit."
            )
            clipped |= own
    return (_rows(stream, ~clipped) if clipped.any() else stream), tuple(warnings)


def saturated(values: np.ndarray) -> tuple[np.ndarray, list[float]]:
    """Find the samples of a channel (N,) that pile up at an extreme; also those extremes."""
    marked, extremes = np.zeros(len(values), dtype=bool), []
    if np.ptp(values) <= _STILL * max(float(np.abs(values).max()), 1.0):
        return marked, extremes
    levels, counts = np.unique(values, return_counts=True)
    for end, following in ((-1, -2), (0, 1)):
        piled = counts[end] >= max(_FEWEST, _LEAST * len(values))
        if piled and counts[end] > _PILED * counts[following]:
            marked |= values == levels[end]
            extremes.append(float(levels[end]))
    return marked, extremes


def _rows(stream: Stream, keep: np.ndarray) -> Stream:
    return replace(
        stream,
        stamp_ns=stream.stamp_ns[keep],
        log_time_ns=stream.log_time_ns[keep],
        sequence=stream.sequence[keep],
        data={key: values[keep] for key, values in stream.data.items()},
    )
