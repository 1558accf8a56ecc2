"""The lossless streams: what the wire carried, with every clock that saw it; nothing scaled or filled in."""

from __future__ import annotations

from collections.abc import Sequence

from daq.log_writer import LogWriter
from daq.messages import DRIVE_RAW_TOPIC, FORCE_PLATE_RAW_TOPIC
from daq.ports import CycleSample, PlateSample

NO_COUNT = -(2**31)
"""Stands in ``/drive/raw`` for a count that did not arrive (a drive never reports this one)."""

NO_STATUS = 2**32 - 1
"""Stands for a status word that did not arrive; real ones have 16 bits."""

NO_CYCLE = 2**32 - 1
"""The cycle of samples taken while the drives were enabled or stopped."""


def write_drive_raw(
    writer: LogWriter, names: Sequence[str], sample: CycleSample, stamp_ns: int, log_time_ns: int
) -> None:
    """Log one cycle of all drives; its sequence is the number of its SYNC."""
    writer.write_raw(
        DRIVE_RAW_TOPIC, stamp_ns, log_time_ns, sample.sync,
        name=names,
        device_stamp=sample.sync,
        host_receive_ns=sample.sync_ns,
        cycle=sample.cycle if sample.cycle >= 0 else NO_CYCLE,
        position=_counts(sample.position),
        velocity=_counts(sample.velocity),
        current=_counts(sample.current),
        status_word=[NO_STATUS if word is None else word for word in sample.status_word],
        demand=_counts(sample.demand),
        target=sample.target,
        flags=sample.flags,
        receive_ns=[0 if stamp is None else stamp for stamp in sample.stamp_ns],
    )


def _counts(values: Sequence[int | None]) -> Sequence[int]:
    return [NO_COUNT if value is None else value for value in values]


def write_plate_raw(writer: LogWriter, sample: PlateSample, number: int, offset_ns: int) -> None:
    """Log one sample of the plate; its stamp is its arrival, its sequence counts arrivals."""
    arrived_ns = sample.read_ns + offset_ns
    is_integer = all(isinstance(value, int) for value in sample.raw)
    writer.write_raw(
        FORCE_PLATE_RAW_TOPIC, arrived_ns, arrived_ns, number,
        device_stamp=sample.ticks,
        host_receive_ns=sample.read_ns,
        counter=sample.counter or 0,
        status_word=sample.status,
        counts=sample.raw if is_integer else (),
        values=() if is_integer else sample.raw,
        temperature=sample.temperature_c if sample.temperature_c is not None else float("nan"),
        segment=sample.segment,
        lost=sample.lost,
        wrench=sample.wrench,
    )
