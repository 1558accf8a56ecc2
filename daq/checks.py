"""Is a recording sane? Every reason to refuse it, one sentence each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from daq.recording import Recording, Stream

ABSURD = 1e100  # large in any unit of angle, current or force: a decoder's or parser's garbage
EPOCH_END_NS = 365 * 86_400 * 1_000_000_000  # a stamp in the year 1970 was never set
JUMP_S = 0.1  # longer than any bus or host stall that keeps its sequence count
JUMP_INTERVALS = 10
_SECOND = 1e9


@dataclass(frozen=True)
class Problem:
    """A reason to refuse a recording.

    Attributes:
        code: ``empty``, ``not_finite``, ``absurd``, ``epoch``, ``repeated``, ``backward``, ``jump`` or
            ``apart``.
        topic: the stream it is in.
        count: how many samples are concerned.
        row: the first of them, counted from 0.
        sentence: what, where and what to do.
    """

    code: str
    topic: str
    count: int
    row: int
    sentence: str

    def __str__(self) -> str:
        return self.sentence


def check_recording(recording: Recording) -> list[Problem]:
    """Everything that makes a recording unusable; an empty list where all is well."""
    found: list[Problem] = []
    for stream in recording.streams:
        found += _stream_problems(stream, counts_samples(recording, stream))
    if not any(problem.code in ("epoch", "empty") for problem in found):
        found += _apart(recording)
    return found


def counts_samples(recording: Recording, stream: Stream) -> bool:
    """Whether the log numbered the stream's samples itself."""
    missing = f"{stream.topic} carries no sequence count"
    return not any(text.startswith(missing) for text in recording.warnings)


def unwrapped(sequence: np.ndarray) -> np.ndarray:
    """(n,) int64 sample numbers, the device's 32-bit counter unwrapped."""
    steps = np.diff(sequence.astype(np.uint32)).astype(np.int32)
    return np.concatenate([[0], np.cumsum(steps, dtype=np.int64)])


def interval_ns(stream: Stream) -> float:
    """The typical time between two samples, 0 where there are none."""
    steps = np.diff(stream.stamp_ns)
    steps = steps[steps > 0]
    return float(np.median(steps)) if len(steps) else 0.0


def _stream_problems(stream: Stream, counted: bool) -> list[Problem]:
    if len(stream) < 2:
        return [Problem("empty", stream.topic, len(stream), 0,
                        f"{stream.topic} has {len(stream)} samples, too few for anything: "
                        f"record again.")]
    return [*_value_problems(stream), *_stamp_problems(stream), *_jumps(stream, counted)]


def _value_problems(stream: Stream) -> Iterator[Problem]:
    for key, values in stream.data.items():
        with np.errstate(invalid="ignore"):
            absurd = np.abs(values) > ABSURD
        for code, bad, what in (("not_finite", ~np.isfinite(values), "is NaN or infinite"),
                                ("absurd", absurd & np.isfinite(values), f"is beyond {ABSURD:g}")):
            if not bad.any():
                continue
            rows = np.flatnonzero(bad.any(axis=1))
            column = stream.names[int(np.argmax(bad[rows[0]]))] if stream.names else f"{key}"
            yield Problem(code, stream.topic, len(rows), int(rows[0]),
                          f"{stream.topic}: {key} of {column} {what} in {len(rows)} samples, first in "
                          f"sample {rows[0]} ({_when(stream, rows[0])}); drop those samples or record again.")


def _stamp_problems(stream: Stream) -> Iterator[Problem]:
    steps = np.diff(stream.stamp_ns)
    kinds = (
        ("epoch", np.flatnonzero(stream.stamp_ns < EPOCH_END_NS),
         "lie in the year 1970: the clock was not set; import the recording with a start time"),
        ("repeated", np.flatnonzero(steps == 0) + 1,
         "repeat the stamp before them: samples were stored twice or stamped on a coarse clock"),
        ("backward", np.flatnonzero(steps < 0) + 1,
         "have a stamp earlier than the sample before: the clock stepped back or the samples are shuffled"),
    )
    for code, rows, what in kinds:
        if len(rows):
            yield Problem(code, stream.topic, len(rows), int(rows[0]),
                          f"{stream.topic}: the stamps of {len(rows)} samples, first of sample {rows[0]}, "
                          f"{what}.")


def _jumps(stream: Stream, counted: bool) -> Iterator[Problem]:
    """Time that passed without a sample missing: the clock jumped."""
    interval = interval_ns(stream)
    if not counted or not interval:
        return
    excess = np.diff(stream.stamp_ns) - np.maximum(np.diff(unwrapped(stream.sequence)), 1) * interval
    rows = np.flatnonzero(excess > max(JUMP_S * _SECOND, JUMP_INTERVALS * interval)) + 1
    if len(rows):
        yield Problem("jump", stream.topic, len(rows), int(rows[0]),
                      f"{stream.topic}: the stamps jump ahead by {excess[rows[0] - 1] / _SECOND:.3g} s at "
                      f"sample {rows[0]} ({len(rows)} such jumps) though no sample is missing "
                      f"there: the clock was stepped; record again.")


def _apart(recording: Recording) -> Iterator[Problem]:
    """Streams that hardly share any time cannot be fitted together."""
    joints = recording.joint_states.stamp_ns
    for stream in recording.streams[1:]:
        first = max(joints.min(), stream.stamp_ns.min())
        last = min(joints.max(), stream.stamp_ns.max())
        shared = (last - first) / max(1, joints.max() - joints.min())
        if shared < 0.5:
            yield Problem("apart", stream.topic, len(stream), 0,
                          f"{stream.topic} shares only {max(shared, 0):.0%} of the joint states' time: "
                          f"the clocks differ or a stream stopped; put both on one time base.")


def _when(stream: Stream, row: int) -> str:
    return f"{(int(stream.stamp_ns[row]) - int(stream.stamp_ns[0])) / _SECOND:.3f} s after the start"
