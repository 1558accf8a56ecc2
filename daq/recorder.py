"""Between the cycle and the disk: a bounded ring, and a thread that writes, flushes and syncs."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from daq.log_writer import LogWriter
from daq.messages import CLOCK_SYNC_TOPIC
from daq.ports import AxisUnits, CycleSample, PlateSample
from daq.raw_records import write_drive_raw, write_plate_raw

_FLUSH_S = 0.5
"""A chunk ends this often, so that a killed process loses less than a second with all queues counted in."""

_SYNC_S = 1.0
"""Flushed chunks are forced onto the disk this often."""

_IDLE_S = 0.05
"""How long the writer sleeps between two looks at the ring: the loss at a kill grows by it."""

_CAPACITY = 1 << 14
"""Items in the ring: 15 s of a kilohertz, longer than any disk stalls."""


@dataclass(frozen=True)
class Scale:
    """What turns a cycle's raw numbers into the log's streams.

    Attributes:
        names: joints.
        units: one an axis.
        period_ns: bus period.
        offset_ns: from monotonic time to stamps.
        first: first cycle the streams show.
        stop: cycle after the last one.
    """

    names: tuple[str, ...]
    units: Sequence[AxisUnits]
    period_ns: int
    offset_ns: int
    first: int
    stop: int


@dataclass
class Tally:
    """What was written, for the proof."""

    cycles: int = 0
    joint_states: int = 0
    currents: int = 0
    plate_samples: int = 0
    overruns: int = 0
    plate: list[PlateSample] = field(default_factory=list)
    shown_ns: tuple[int, int] = (0, 0)  # stamps of the first and the last joint state


class Recorder:
    """Takes samples from the cycle without ever waiting for the disk.

    Args:
        writer: the open log, which belongs to the recorder's thread until `finish`.
        scale: of the raw numbers.
        patient: wait for room in a full ring (virtual time) instead of counting an overrun.
    """

    def __init__(self, writer: LogWriter, scale: Scale, patient: bool = False) -> None:
        self.writer, self.scale = writer, scale
        self.tally = Tally()
        self.failure: Exception | None = None
        self._patient = patient
        self._ring: deque[tuple[object, ...]] = deque()
        self._ended = threading.Event()
        self._room = threading.Event()
        self._events = self._syncs = 0
        self._flush_ns = 0
        self._synced_s = self._flushed_s = time.monotonic()
        self._dirty = False
        self._thread = threading.Thread(target=self._run, name="log writer", daemon=True)
        self._thread.start()

    def put_cycle(self, sample: CycleSample, received_ns: int) -> None:
        """Queue one cycle."""
        self._put((self._write_cycle, sample, received_ns))

    def put_plate(self, samples: Sequence[PlateSample]) -> None:
        """Queue samples of the plate."""
        self._put((self._write_plate, samples))

    def put_sync(self, device: str, ticks: int, read_ns: int, mapped_ns: int, uncertainty_s: float) -> None:
        """Queue a pair of clock readings: a device's own and the host's."""
        self._put((self._write_sync, device, ticks, read_ns, mapped_ns, uncertainty_s))

    def put_event(self, time_ns: int, name: str, severity: str, cycle: int, text: str) -> None:
        """Queue something that happened at a monotonic time."""
        self._put((self._write_event, time_ns, name, severity, cycle, text))

    def finish(self) -> None:
        """Write what is queued and end the thread; the writer then belongs to the caller."""
        self._ended.set()
        if self._thread is not threading.current_thread():
            self._thread.join()

    def _put(self, item: tuple[object, ...]) -> None:
        if len(self._ring) >= _CAPACITY:
            if not self._patient:
                self.tally.overruns += 1
                return
            while len(self._ring) >= _CAPACITY // 2 and self.failure is None:
                self._room.wait(_IDLE_S)
        self._ring.append(item)

    def _run(self) -> None:
        try:
            while True:
                is_last = self._ended.is_set()
                self._drain()
                self._flush_if_due()
                if is_last:
                    self.writer.flush()
                    return
                self._ended.wait(_IDLE_S)
        except Exception as error:  # handed over: the cycle looks at it every time
            self.failure = error
            self._room.set()

    def _drain(self) -> None:
        ring = self._ring
        while ring:
            write, *item = ring.popleft()
            write(*item)  # type: ignore[operator]
            self._dirty = True

    def _flush_if_due(self) -> None:
        now_s = time.monotonic()
        if self._dirty and not self._patient and now_s - self._flushed_s >= _FLUSH_S:
            self._flush(now_s)

    def _flush(self, now_s: float) -> None:
        self.writer.flush()
        self._flushed_s, self._dirty = now_s, False
        if now_s - self._synced_s >= _SYNC_S:
            self._synced_s = now_s
            self.writer.sync()

    def _write_cycle(self, sample: CycleSample, received_ns: int) -> None:
        scale, writer, tally = self.scale, self.writer, self.tally
        stamp_ns, log_ns = sample.sync_ns + scale.offset_ns, received_ns + scale.offset_ns
        write_drive_raw(writer, scale.names, sample, stamp_ns, log_ns)
        if sample.sync_ns >= self._flush_ns:  # chunks end at a tick boundary, in log time too
            self._flush_ns = sample.sync_ns + round(_FLUSH_S * 1e9)
            self._flush(time.monotonic())
        if sample.cycle < 0:
            return
        tally.cycles += 1
        if not scale.first <= sample.cycle < scale.stop:
            return
        self._write_streams(sample, stamp_ns, log_ns)

    def _write_streams(self, sample: CycleSample, stamp_ns: int, log_ns: int) -> None:
        """The streams proper: a sample that lacks a joint is left out, its number stays a hole."""
        scale, writer, tally = self.scale, self.writer, self.tally
        names, units, cycle = scale.names, scale.units, sample.cycle
        if None not in sample.position:
            position = [c * u.rad_per_count for c, u in zip(sample.position, units, strict=True)]  # type: ignore[operator]
            writer.write_joint_states(stamp_ns, log_ns, cycle, names, position)
            tally.shown_ns = (tally.shown_ns[0] or stamp_ns, stamp_ns)
            tally.joint_states += 1
        if None not in sample.current:
            current = [c * u.ampere_per_unit for c, u in zip(sample.current, units, strict=True)]  # type: ignore[operator]
            writer.write_motor_currents(stamp_ns, log_ns, cycle, names, current)
            tally.currents += 1
        target = [c * u.rad_per_count for c, u in zip(sample.target, units, strict=True)]
        writer.write_setpoints(stamp_ns + scale.period_ns, log_ns, cycle, names, target)

    def _write_plate(self, samples: Sequence[PlateSample]) -> None:
        for sample in samples:
            write_plate_raw(self.writer, sample, self.tally.plate_samples, self.scale.offset_ns)
            self.tally.plate_samples += 1
        self.tally.plate += samples

    def _write_sync(
        self, device: str, ticks: int, read_ns: int, mapped_ns: int, uncertainty_s: float
    ) -> None:
        stamp_ns = read_ns + self.scale.offset_ns
        self.writer.write_raw(
            CLOCK_SYNC_TOPIC, stamp_ns, stamp_ns, self._syncs, device=device, device_stamp=ticks,
            host_receive_ns=read_ns, mapped_ns=mapped_ns + self.scale.offset_ns, uncertainty_s=uncertainty_s,
        )
        self._syncs += 1

    def _write_event(self, time_ns: int, name: str, severity: str, cycle: int, text: str) -> None:
        stamp_ns = time_ns + self.scale.offset_ns
        self.writer.write_event(stamp_ns, stamp_ns, self._events, name, severity, max(cycle, 0), text)
        self._events += 1
