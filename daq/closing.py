"""The end of a run's log: the plate on the common time base, the proof, the final name."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from daq.log_writer import FRAMES, LogWriter
from daq.messages import WRENCH, WRENCH_TOPIC
from daq.ports import DriveReport, Plate, PlateRest, PlateStream
from daq.recorder import Recorder
from daq.recording import Stream
from daq.run_report import Missing, RunReport
from daq.run_state import RunState
from daq.trajectory import Plan

_MARGIN_NS = 10_000_000
"""A sample or two beyond either end, so that interpolation needs no extrapolation."""


@dataclass(frozen=True)
class Ending:
    """Everything that is left when hardware is at rest."""

    plan: Plan | None
    drives: DriveReport
    recorder: Recorder | None
    writer: LogWriter | None
    plate: Plate | None
    before: PlateRest | None
    after: PlateRest | None
    causes: Sequence[str]
    notes: Sequence[str]
    is_aborted: bool


def close_log(ending: Ending) -> tuple[RunReport, Exception | None]:
    """Write plate and proof, give the log its final name; return the account and what failed on the way.

    A run that never moved leaves no log. A log that cannot be finished stays beside its final name.
    """
    writer, recorder = ending.writer, ending.recorder
    if writer is None or recorder is None:
        return _report(ending, "", None, ending.causes), None
    if not recorder.tally.cycles:
        with contextlib.suppress(Exception):
            writer.file.abandon(keep=False)
        return _report(ending, "", None, ending.causes), None
    try:
        if recorder.failure is not None:
            raise recorder.failure
        stream = _write_plate(ending, writer, recorder)
        report = _report(ending, str(writer.file.path), stream, ending.causes)
        writer.add_metadata(_metadata(ending, report, stream))
        writer.close()
        return report, None
    except Exception as error:
        with contextlib.suppress(Exception):
            writer.file.abandon(keep=True)
        causes = ending.causes if str(error) in ending.causes else [*ending.causes, str(error)]
        return _report(ending, str(writer.file.partial), None, causes), error


def _write_plate(ending: Ending, writer: LogWriter, recorder: Recorder) -> PlateStream | None:
    samples, plan = recorder.tally.plate, ending.plan
    if ending.plate is None or plan is None or not samples:
        return None
    stream = ending.plate.stream(samples)
    whole = wrench_stream(stream, recorder.scale.offset_ns, np.array([s.read_ns for s in samples]))
    writer.write_streams([during(whole, *recorder.tally.shown_ns)])
    return stream


def during(stream: Stream, first_ns: int, last_ns: int) -> Stream:
    """The part of a stream from just before the joint states begin to just after they end."""
    low, high = np.searchsorted(stream.stamp_ns, (first_ns - _MARGIN_NS, last_ns + _MARGIN_NS))
    part = slice(int(low), int(high))
    return replace(
        stream, stamp_ns=stream.stamp_ns[part], log_time_ns=stream.log_time_ns[part],
        sequence=stream.sequence[part], data={key: values[part] for key, values in stream.data.items()},
    )


def wrench_stream(plate: PlateStream, offset_ns: int, read_ns: np.ndarray) -> Stream:
    """The log's wrench stream from the plate's samples on the host's clock."""
    return Stream(
        topic=WRENCH_TOPIC,
        schema=WRENCH,
        names=(),
        frame_id=FRAMES[WRENCH_TOPIC],
        stamp_ns=plate.stamp_ns + offset_ns,
        log_time_ns=read_ns + offset_ns,
        sequence=plate.sequence.astype(np.uint32),
        data={"force": plate.wrench[:, :3], "torque": plate.wrench[:, 3:]},
    )


def _report(ending: Ending, log: str, stream: PlateStream | None, causes: Sequence[str]) -> RunReport:
    drives, recorder = ending.drives, ending.recorder
    tally = recorder.tally if recorder is not None else None
    facts = {
        "log": log,
        "planned": ending.plan.cycles if ending.plan is not None else 0,
        "cycles": drives.cycles,
        "written": tally.cycles if tally else 0,
        "missing": tuple(Missing(entry.cycle, entry.axis) for entry in drives.missing),
        "torn": tuple(Missing(entry.cycle, entry.axis) for entry in drives.torn),
        "irregular": tuple(sorted({entry.cycle for entry in drives.irregular})),
        "late_syncs": tuple(drives.late_syncs),
        "overruns": tally.overruns if tally else 0,
        "plate_samples": tally.plate_samples if tally else 0,
        "plate_lost": stream.lost if stream is not None else 0,
        "causes": tuple(causes),
        "notes": tuple(ending.notes),
        "unconfirmed": tuple(drives.unconfirmed),
        "restore_failures": tuple(drives.restore_failures),
    }
    if ending.is_aborted:
        return RunReport(RunState.ABORTED, **facts)
    report = RunReport(RunState.RECORDED, **facts)
    return report if report.is_whole and not causes else RunReport(RunState.FAILED, **facts)


def _metadata(ending: Ending, report: RunReport, stream: PlateStream | None) -> dict[str, str]:
    table = report.metadata()
    plan = ending.plan
    if plan is not None and plan.periods:
        table["periods"] = str(plan.whole_periods(report.cycles))
    if stream is not None:
        table["plate_time_base"] = stream.method
        table["plate_uncertainty_s"] = f"{float(stream.uncertainty_s.max()):.3g}"
    for name, rest in (("before", ending.before), ("after", ending.after)):
        if rest is not None:
            table[f"plate_rest_{name}"] = " ".join(f"{value:.6g}" for value in rest.mean)
    return table
