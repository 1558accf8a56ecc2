"""What a log holds, as arrays: the streams of one run on one time base."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Stream:
    """All samples of one topic at their own instants, in file order, never resampled.

    Attributes:
        topic: topic name.
        schema: message type, such as ``sensor_msgs/msg/JointState``.
        names: joint names in column order, empty for the wrench.
        frame_id: frame the values are expressed in.
        stamp_ns: (n,) int64 sampling instants.
        log_time_ns: (n,) int64 instants of reception by the host.
        sequence: (n,) uint32 as the device counted; a hole is a lost sample.
        data: ``position``, ``velocity``, ``effort`` or ``current`` (n, k), ``force``, ``torque`` (n, 3).
    """

    topic: str
    schema: str
    names: tuple[str, ...]
    frame_id: str
    stamp_ns: np.ndarray
    log_time_ns: np.ndarray
    sequence: np.ndarray
    data: Mapping[str, np.ndarray]

    def __len__(self) -> int:
        return len(self.stamp_ns)


@dataclass(frozen=True)
class Recording:
    """One run as it was logged: streams, the run's metadata and the files it carried along."""

    source: str
    joint_states: Stream
    motor_currents: Stream | None
    wrench: Stream | None
    setpoints: Stream | None
    metadata: Mapping[str, str]
    attachments: Mapping[str, bytes]
    sha256: str
    warnings: tuple[str, ...]

    @property
    def streams(self) -> tuple[Stream, ...]:
        """The streams that are there, joint states first."""
        rest = (self.motor_currents, self.wrench, self.setpoints)
        return (self.joint_states, *(stream for stream in rest if stream is not None))
