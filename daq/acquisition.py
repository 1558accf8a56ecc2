"""One run, from preflight to a log that proves itself; hardware is restored whatever happens."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from daq.closing import Ending, close_log
from daq.errors import HardwareError
from daq.host_clock import Epoch
from daq.limits import Limits, Watch
from daq.log_writer import LogWriter
from daq.ports import BootReport, Clock, Drives, Plate, PlateRest, PlateSample
from daq.preflight import Check, expected_bytes, motion_checks, output_checks, require
from daq.realtime import keeping_time
from daq.recorder import Recorder, Scale
from daq.run_report import RunReport
from daq.run_state import RunEvent, RunState, RunStatus
from daq.trajectory import Plan

_SYNC_NS = 1_000_000_000
"""How often clocks are compared and logged."""

_OVERLOADED = 3
"""Overloaded plate samples in a row that stop the drives: one may be a spike, three are a load."""


class AbortedError(Exception):
    """Somebody asked to stop; never leaves this package."""


@dataclass(frozen=True)
class Job:
    """What is to be recorded.

    Attributes:
        path: the log's final name.
        plan: makes the set points from where the arm stands (k,) and the bus period [s].
        limits: what must be kept.
        metadata: of the run, without what the plan and the proof add.
        attachments: files to carry along.
        patient: virtual time, which can wait for the disk.
        checks: further named checks, made before anything is opened.
    """

    path: Path
    plan: Callable[[np.ndarray, float], Plan]
    limits: Limits
    metadata: Mapping[str, str]
    attachments: Mapping[str, bytes] = field(default_factory=dict)
    patient: bool = False
    checks: Callable[[], Iterable[Check]] = tuple


@dataclass(frozen=True)
class Progress:
    """How far a run is.

    Attributes:
        state: of the run.
        cycle: set points sent.
        cycles: set points of the motion, 0 until it is known.
        remaining_s: of the motion, on the bus' clock.
    """

    state: RunState
    cycle: int
    cycles: int
    remaining_s: float


class Acquisition:
    """Records one run; `execute` belongs to one thread, `abort` and `progress` to any.

    Args:
        job: what to record.
        drives: the robot's drives, not yet booted.
        clock: the host's time.
        plate: the force plate, if there is one.
        status: the run's state, with its listeners.
    """

    def __init__(
        self, job: Job, drives: Drives, clock: Clock, plate: Plate | None = None,
        status: RunStatus | None = None,
    ) -> None:
        self.job, self.drives, self.clock, self.plate = job, drives, clock, plate
        self.status = status or RunStatus()
        self.causes: list[str] = []
        self.notes: list[str] = []
        self.error: Exception | None = None  # the first failure, with its exit code
        self.plan: Plan | None = None
        self.cycle = 0
        self._abort: str | None = None
        self._writer: LogWriter | None = None
        self._recorder: Recorder | None = None
        self._before: PlateRest | None = None
        self._after: PlateRest | None = None
        self._last_ns = self._last_plate_ns = 0
        self._overloaded = 0
        self._granted = ""
        self._kept = -1  # the last cycle handed to the recorder

    def abort(self, reason: str) -> None:
        """Ask for the stop ladder; what was recorded is kept. May be called from any thread, repeatedly."""
        if self._abort is None:
            self._abort = reason

    def progress(self) -> Progress:
        """How far the run is."""
        plan, cycle = self.plan, self.cycle
        if plan is None:
            return Progress(self.status.state, 0, 0, 0.0)
        return Progress(self.status.state, cycle, plan.cycles, (plan.cycles - cycle) * plan.period_s)

    def execute(self) -> RunReport:
        """Run from start to end.

        Returns:
            The account; failures are in it and not raised.

        Raises:
            KeyboardInterrupt: the operator insisted: the drives were halted at once, the unfinished log
                lies beside its final name.
        """
        with keeping_time(not self.job.patient) as granted:
            self._granted = granted
            try:
                self._try_to_run()
                self._settle()
            except BaseException:
                self._give_up()
                raise
        return self._close()

    def _try_to_run(self) -> None:
        try:
            self._prepare()
            self._move()
        except AbortedError as request:
            self._note_cause(str(request), RunEvent.ABORT)
        except Exception as error:
            self._fail(error)

    def _prepare(self) -> None:
        self.status.advance(RunEvent.STARTED)
        self._heed_abort()
        require(self.job.checks())
        if self.plate is not None:
            self.notes += self.plate.start()
            self._before = self.plate.rest()
        self._heed_abort()
        boot = self.drives.boot()
        start = np.array([axis.position * axis.units.rad_per_count for axis in boot.axes])
        plan = self.plan = self.job.plan(start, boot.period_ns * 1e-9)
        require((
            *motion_checks(plan, self.job.limits),
            *output_checks(self.job.path, expected_bytes(plan, self.plate is not None)),
        ))
        self._open_log(plan, boot)
        self._heed_abort()
        self.status.advance(RunEvent.PASSED)

    def _open_log(self, plan: Plan, boot: BootReport) -> None:
        self._epoch = Epoch(self.clock)
        offset_ns = self._epoch.offset_ns
        plate = {f"plate_{key}": value for key, value in (self.plate.facts() if self.plate else {}).items()}
        metadata = {
            **self.job.metadata, **plan.metadata(), **plate, "outcome": "unfinished",
            "scheduling": self._granted or "ordinary", "clock_offset_ns": str(offset_ns),
            "sync_period_ns": str(boot.period_ns),
        }
        self._writer = LogWriter(self.job.path, metadata, self.job.attachments)
        self._scale = Scale(
            plan.joints, [axis.units for axis in boot.axes], boot.period_ns, offset_ns, plan.first, plan.stop
        )
        self._recorder = Recorder(self._writer, self._scale, self.job.patient)
        self._event("armed", "info", f"{plan.cycles} cycles planned, {plan.duration_s:.1f} s")

    def _move(self) -> None:
        plan, recorder = self.plan, self._recorder
        assert plan is not None and recorder is not None
        sample = self.drives.enable()
        recorder.put_cycle(sample, self.clock.now_ns())
        self.status.advance(RunEvent.ENABLED)
        self._event("moving", "info", "the drives follow their set points")
        rows = plan.q.tolist()
        watch = Watch(self.job.limits)
        for target in rows:
            self._one_cycle(target, watch, recorder)
        self.drives.stop()
        self.status.advance(RunEvent.MOVED)

    def _one_cycle(self, target: Sequence[float], watch: Watch, recorder: Recorder) -> None:
        watch.commanded(target)
        sample = self.drives.cycle(target)
        self.cycle += 1
        received_ns = self.clock.now_ns()
        recorder.put_cycle(sample, received_ns)
        self._kept = sample.cycle
        if self.plate is not None:
            self._take_plate(self.plate.poll(), recorder)
        if received_ns - self._last_ns >= _SYNC_NS:
            self._look_at_wall_clock(received_ns, recorder)
        reason = watch.measured([
            None if counts is None else counts * units.rad_per_count
            for counts, units in zip(sample.position, self._scale.units, strict=True)
        ], sample.sync_ns)
        if reason is not None:
            raise HardwareError(reason)
        if recorder.failure is not None:
            raise recorder.failure
        self._heed_abort()

    def _take_plate(self, samples: Sequence[PlateSample], recorder: Recorder) -> None:
        if not samples:
            return
        assert self.plate is not None
        recorder.put_plate(samples)
        for sample in samples:
            self._overloaded = self._overloaded + 1 if sample.is_overloaded else 0
            mapped_ns, uncertainty_s = self.plate.live(sample)
            if self._overloaded >= _OVERLOADED:
                raise HardwareError("The force plate is overloaded: a channel is at or beyond its range; "
                                    "choose a larger range or a gentler excitation.")
        last = samples[-1]
        if last.read_ns - self._last_plate_ns >= _SYNC_NS:
            self._last_plate_ns = last.read_ns
            recorder.put_sync("force_plate", last.ticks, last.read_ns, mapped_ns, uncertainty_s)

    def _look_at_wall_clock(self, now_ns: int, recorder: Recorder) -> None:
        self._last_ns = now_ns
        wall_ns = self.clock.wall_ns()
        recorder.put_sync("wall_clock", wall_ns, now_ns, now_ns, 0.0)
        step_s = self._epoch.step_s()
        if step_s is not None:
            text = f"The host's wall clock was stepped by {step_s:+.3f} s; the log keeps its own time."
            self.notes.append(text)
            self._event("clock_step", "warning", text)

    def _heed_abort(self) -> None:
        if self._abort is not None:
            raise AbortedError(self._abort)

    def _fail(self, error: Exception) -> None:
        self.error = self.error or error
        self._note_cause(str(error), RunEvent.FAULT)

    def _note_cause(self, sentence: str, event: RunEvent) -> None:
        """The drives' own first cause comes first: what the run saw may only follow from it."""
        for cause in self.drives.report().causes:
            if cause.sentence not in self.causes:
                self.causes.append(cause.sentence)
        if not any(cause in sentence for cause in self.causes):
            self.causes.append(sentence)
        if event is RunEvent.ABORT or self.status.state is not RunState.FINALISING:
            self.status.advance(event, sentence)
        self._event(event.name.lower(), "error", sentence)

    def _settle(self) -> None:
        """Stop and restore everything; each step is tried whatever became of the one before."""
        if self.status.state is not RunState.FINALISING or self.causes:
            self._attempt(lambda: self.drives.stop(self.causes[0] if self.causes else "The run failed."))
        self._attempt(self._keep_tail)
        self._attempt(self.drives.close)
        if self.plate is not None:
            self._attempt(self._last_look_at_plate)
            self._attempt(self.plate.stop)
        if self._recorder is not None:
            self._recorder.finish()
            if self._recorder.failure is not None and not self.causes:
                self._fail(self._recorder.failure)

    def _attempt(self, step: Callable[[], object]) -> None:
        try:
            step()
        except Exception as error:
            self._fail(error)

    def _keep_tail(self) -> None:
        """What was sampled while the drives stopped, the cycle that made them stop included."""
        if self._recorder is None:
            return
        for sample in self.drives.report().tail:
            if not 0 <= sample.cycle <= self._kept:
                self._recorder.put_cycle(sample, self.clock.now_ns())

    def _last_look_at_plate(self) -> None:
        assert self.plate is not None
        if self._recorder is None:
            return
        self._recorder.put_plate(self.plate.poll())
        if not self.causes and self._before is not None:
            self._after = self.plate.rest()
            drift = self.plate.drift(self._before, self._after)
            if drift:
                self.notes.append(drift)
                self._event("plate_drift", "warning", drift)

    def _event(self, name: str, severity: str, text: str) -> None:
        if self._recorder is not None:
            self._recorder.put_event(self.clock.now_ns(), name, severity, self.cycle, text)

    def _close(self) -> RunReport:
        ending = Ending(
            plan=self.plan, drives=self.drives.report(), recorder=self._recorder, writer=self._writer,
            plate=self.plate, before=self._before, after=self._after, causes=self.causes, notes=self.notes,
            is_aborted=self.status.state is RunState.ABORTING,
        )
        report, error = close_log(ending)
        self.error = self.error or error
        final = RunEvent.COMPLETE if report.state is RunState.RECORDED else RunEvent.SETTLED
        self.status.advance(final, report.sentence)
        return report

    def _give_up(self) -> None:
        """The operator insisted, or the program itself is at fault: halt at once, leave the partial log."""
        for step in (self.drives.halt, self.plate.stop if self.plate else None):
            if step is not None:
                with contextlib.suppress(Exception):  # the reason to leave is already being raised
                    step()
        if self._recorder is not None:
            self._recorder.finish()
        if self._writer is not None:
            with contextlib.suppress(Exception):
                self._writer.abort()
        for event in (RunEvent.ABORT, RunEvent.SETTLED):
            if not self.status.is_final:
                self.status.advance(event, "halted at once")
