"""A run whose process died becomes a log again: what is intact, the plate in time, the truth about it."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from daq.closing import during, wrench_stream
from daq.errors import DaqError
from daq.log_reader import read_raw, read_recording
from daq.messages import FORCE_PLATE_RAW_TOPIC
from daq.recording import Recording, Stream
from daq.recovery import Addition, Recovery, recover
from daq.timebase import Transport
from drivers.errors import DriverError
from drivers.force_plate.mounting import Mounting
from drivers.force_plate.port import PlateOnHostClock
from drivers.force_plate.protocols import protocol_named
from drivers.force_plate.sample import PlateSample

_NO_READING = 0


def salvage_run(source: str | Path, output: str | Path) -> Recovery:
    """Save a broken log; complete it where it is an unfinished run of this program.

    While a run lasts, its log holds the plate's raw samples only: their instants are known at its end.

    Args:
        source: the broken log.
        output: the whole log.

    Raises:
        daq.errors.DaqError: nothing can be saved, or a file cannot be read or written.
    """
    with tempfile.TemporaryDirectory() as folder:
        first = Path(folder) / "intact.mcap"
        found = recover(source, first)
        addition = _addition(first)
    if not addition.streams and not addition.metadata:
        return recover(source, output)
    recover(source, output, addition)
    return found


def _addition(path: Path) -> Addition:
    """What an unfinished run lacks; nothing for any other log."""
    try:
        recording = read_recording(path)
    except DaqError:
        return Addition()
    if recording.metadata.get("outcome") != "unfinished":
        return Addition()
    facts = {"outcome": "interrupted", "proof": "the process ended before the run was complete"}
    facts |= _periods(recording)
    wrench = _wrench(path, recording) if recording.wrench is None else None
    return Addition((wrench,) if wrench is not None else (), facts)


def _periods(recording: Recording) -> dict[str, str]:
    """The measured periods that are there in full."""
    facts = recording.metadata
    try:
        cycles = round(float(facts["sample_rate_hz"]) / float(facts["fundamental_hz"]))
        transient = int(facts["transient_periods"])
    except (KeyError, ValueError, ZeroDivisionError):
        return {}
    sequence = recording.joint_states.sequence.astype(np.int64)
    shown = int(sequence[-1] - sequence[0]) + 1
    return {"periods": str(max(0, shown // cycles - transient))}


def _wrench(path: Path, recording: Recording) -> Stream | None:
    facts = recording.metadata
    try:
        raw = read_raw(path, FORCE_PLATE_RAW_TOPIC)
        protocol = protocol_named(facts["plate_protocol"])
        plate = PlateOnHostClock(protocol, _transport(facts), _mounting(facts["plate_mounting"]))
        stream = plate.stream(_samples(raw))
    except (DaqError, DriverError, KeyError, ValueError):
        return None  # not a run with a plate, or one of another program
    offset_ns = int(facts["clock_offset_ns"])
    whole = wrench_stream(stream, offset_ns, np.asarray(raw["host_receive_ns"], dtype=np.int64))
    stamps = recording.joint_states.stamp_ns
    return during(whole, int(stamps[0]), int(stamps[-1]))


def _transport(facts: Mapping[str, str]) -> Transport:
    return Transport(
        facts["plate_transport"], period_s=float(facts["plate_transport_period_s"]),
        poll_s=float(facts["plate_transport_poll_s"]),
    )


def _mounting(text: str) -> Mounting:
    *numbers, kind = text.split()
    rows = np.array([float(number) for number in numbers]).reshape(3, 3).tolist()
    return Mounting(tuple(tuple(row) for row in rows), kind == "action")  # type: ignore[arg-type]


def _samples(raw: Mapping[str, np.ndarray]) -> list[PlateSample]:
    """The samples as the driver gave them; what the mapping does not need is left empty."""
    columns = (raw[key].tolist() for key in ("wrench", "device_stamp", "segment", "lost", "host_receive_ns"))
    return [
        PlateSample((), tuple(wrench), None, ticks, segment, lost, _NO_READING, False, True, None, read_ns)
        for wrench, ticks, segment, lost, read_ns in zip(*columns, strict=True)
    ]
