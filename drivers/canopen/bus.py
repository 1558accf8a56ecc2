"""The drives of a robot as one thing: boot, enable, cycle, stop, close."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from types import TracebackType

from drivers.canopen.boot import BootedAxis, BootReport, configure_axis, find_nodes, open_node, start_nodes
from drivers.canopen.can_link import CanLink
from drivers.canopen.config import BusConfig
from drivers.canopen.descent import Descent
from drivers.canopen.exchange import Exchange
from drivers.canopen.frame import bus_load
from drivers.canopen.ladder import Event
from drivers.canopen.ledger import Ledger
from drivers.canopen.link import Link
from drivers.canopen.node import DriveNode
from drivers.canopen.objects import INTERPOLATED_POSITION
from drivers.canopen.power import ENABLE_OPERATION, Goal, PowerStage
from drivers.canopen.profile import common_period_us, load_profile
from drivers.canopen.report import CauseKind, SessionReport
from drivers.canopen.sample import CycleSample, Flag
from drivers.canopen.traffic import PRE_OPERATIONAL, RESET_COMMUNICATION, STOP, Traffic
from drivers.errors import (
    BusOffError,
    ConfigError,
    DriverError,
    DriveStoppedError,
    LinkError,
    StateTimeoutError,
)

_INTERPOLATE = 1 << 4  # control word bit 4 starts interpolation in mode 7
_LARGEST_COUNT = 2**31 - 1
_LARGEST_LOAD = 0.8  # of the wire, worst-case stuffing; SDO, heartbeats and retries need the rest


class Phase(Enum):
    """Where a session stands."""

    NEW = "new"
    BOOTED = "booted"
    RUNNING = "running"
    STOPPED = "stopped"
    CLOSED = "closed"


class DriveBus:
    """All drives on one CAN bus in cyclic synchronous position.

    Use it in a `with` statement: whatever happens inside, the drives are stopped by the ladder, their former
    settings are put back, and the link is released.

    Args:
        config: the bus, its axes and deadlines.
        link: a link to use instead of opening `config.can` (a simulated segment, for one).

    Raises:
        RateRefusedError: a drive does not offer the rate; nothing was sent yet.
        ConfigError: the wire cannot carry so many axes at that rate.
        LinkError: the adapter cannot be opened.
    """

    def __init__(self, config: BusConfig, link: Link | None = None) -> None:
        self.config = config
        self._profiles = tuple(load_profile(axis.profile) for axis in config.axes)
        self._period_us = common_period_us(self._profiles, config.rate_hz)
        _check_load(config)
        self.names = tuple(axis.name for axis in config.axes)
        self.phase = Phase.NEW
        self._ledger = Ledger(self.names, config.missing_in_row)
        self._link = link if link is not None else CanLink(config.can)
        self._traffic = Traffic(self._link, config, self._ledger)
        nodes = [axis.node for axis in config.axes]
        self._exchange = Exchange(self._traffic, nodes, self._profiles, self._period_us * 1000)
        self._nodes: list[DriveNode] = []
        self._axes: tuple[BootedAxis, ...] = ()
        self._stages: list[PowerStage] = []
        self._words: list[int] = []
        self._targets: list[int] = []
        self._last: CycleSample | None = None
        self._descent: Descent | None = None
        self._request: tuple[CauseKind, str] | None = None
        self._restore_failures: tuple[str, ...] = ()

    def boot(self) -> BootReport:
        """Find, identify and configure every drive, every write read back; nothing moves.

        Raises:
            NodeMissingError, IdentityError, ReadBackError, ModeRefusedError, SdoFailedError, LinkError.
        """
        self._expect(Phase.NEW)
        deadlines = self.config.deadlines
        self._nodes = [open_node(self._traffic, axis, deadlines.sdo_s) for axis in self.config.axes]
        find_nodes(self._traffic, deadlines.boot_s)
        self._axes = tuple(
            configure_axis(node, profile, self.config, self._period_us)
            for node, profile in zip(self._nodes, self._profiles, strict=True)
        )
        start_nodes(self._traffic, deadlines.boot_s)
        self._traffic.heartbeats.watch(self._link.now_ns())
        self._stages = [PowerStage(axis.name, _enable_bits(axis)) for axis in self._axes]
        self._words = [ENABLE_OPERATION | _enable_bits(axis) for axis in self._axes]
        self._targets = [axis.position for axis in self._axes]
        self.phase = Phase.BOOTED
        return BootReport(self._axes, self._period_us * 1000)

    def enable(self) -> CycleSample:
        """Start SYNC and lead every power stage to 'operation enabled' while holding position.

        Returns:
            The last sample before the first set point: where each axis stands.

        Raises:
            StateTimeoutError: a drive missed a deadline; all of them are stopped again.
            DriveStoppedError: something tripped meanwhile.
        """
        self._expect(Phase.BOOTED)
        self._ledger.armed = True
        self.phase = Phase.RUNNING
        deadline_ns = self._link.now_ns() + round(self.config.deadlines.enable_s * 1e9)
        for stage in self._stages:
            stage.aim(Goal.ENABLE, self._link.now_ns())
        try:
            self._exchange.start()
            sample = self._lead(deadline_ns)
        except StateTimeoutError as error:
            self._ledger.trip(CauseKind.STATE, str(error), self._link.now_ns())
            self._descend(Event.TRIP)
            raise
        except LinkError as error:
            raise self._link_failed(error) from None
        self._exchange.demanding = True
        return sample

    def cycle(self, targets_rad: Sequence[float]) -> CycleSample:
        """Run one SYNC cycle: send the set points, return what was sampled at the SYNC before them.

        Call it again without delay: set points belong right behind their SYNC.

        Args:
            targets_rad: set point of each axis [rad, joint side], reached one period later.

        Raises:
            ConfigError: a set point is not a number or beyond the drive's counts; nothing was sent.
            DriveStoppedError: there was a cause to stop; the ladder has stopped the drives, `report` tells.
        """
        if self.phase is not Phase.RUNNING:
            self._refuse_cycle()
        self._targets = self._counts(targets_rad)
        self._ledger.cycle += 1
        try:
            sample = self._exchange.step(self._ledger.cycle, self._words, self._targets)
        except LinkError as error:
            self._ledger.book_lost()
            raise self._link_failed(error) from None
        self._last = sample
        self._ledger.book(sample)
        if self._request is not None:
            self._ledger.trip(*self._request, self._link.now_ns())
        if self._ledger.tripped:
            raise self._stopped(self._descend(Event.TRIP, sample))
        return sample

    def request_stop(self, sentence: str, operator: bool = False) -> None:
        """Ask for the stop ladder at the next cycle; may be called from any thread ."""
        self._request = (CauseKind.OPERATOR if operator else CauseKind.EXTERNAL, sentence)

    def stop(self, reason: str | None = None) -> SessionReport:
        """End the session: disable as planned, or, with a `reason`, by the quick stop of the ladder."""
        if self.phase is Phase.RUNNING:
            if reason is not None:
                self._ledger.trip(CauseKind.OPERATOR, reason, self._link.now_ns())
            return self._descend(Event.FINISH if reason is None else Event.TRIP)
        return self.report()

    def halt(self) -> None:
        """Stop at once: NMT stop to every drive, whose reaction to it brings them to rest; then let go.

        Nothing is confirmed and no setting put back: for an operator who will not wait.
        """
        if self.phase is Phase.CLOSED:
            return
        try:
            self._traffic.command(STOP)
        except LinkError:
            pass  # a dead bus: the drives stop by the missing heartbeat of this host
        finally:
            self._exchange.halt()
            self._link.close()
            self.phase = Phase.CLOSED

    def close(self) -> SessionReport:
        """Stop what still runs, put every changed setting back, release the link, even on a dead bus."""
        if self.phase is Phase.CLOSED:
            return self.report()
        try:
            self.stop()
        finally:
            try:
                self._restore()
            finally:
                self._exchange.halt()
                self._link.close()
                self.phase = Phase.CLOSED
        return self.report()

    def report(self) -> SessionReport:
        """The session so far, or as it ended."""
        ledger, descent = self._ledger, self._descent
        flawed = ledger.tripped or ledger.missing or ledger.torn or not ledger.cycles
        unconfirmed = descent.unconfirmed if descent else ()
        return SessionReport(
            outcome="failed" if flawed or unconfirmed else "complete",
            cycles=ledger.cycles,
            missing=tuple(ledger.missing),
            torn=tuple(ledger.torn),
            irregular=tuple(ledger.irregular),
            late_syncs=tuple(ledger.late_syncs),
            causes=tuple(ledger.causes),
            emergencies=tuple(ledger.emergencies),
            error_frames=tuple(ledger.error_frames.items()),
            ladder=tuple(descent.ladder.history) if descent else (),
            unconfirmed=unconfirmed,
            tail=tuple(descent.tail) if descent else (),
            restore_failures=self._restore_failures,
        )

    @property
    def sync(self) -> int:
        """Number of the SYNC that was last on the bus, counted from 0 at `enable`."""
        return self._exchange.sync

    def __enter__(self) -> DriveBus:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if error is not None and self.phase is Phase.RUNNING:
                self.stop(f"The session was left by {kind.__name__ if kind else 'an error'}.")
        finally:
            self.close()

    def _counts(self, targets_rad: Sequence[float]) -> list[int]:
        if len(targets_rad) != len(self._axes):
            raise ConfigError(f"{len(self._axes)} set points are needed a cycle, {len(targets_rad)} came.")
        counts = []
        for axis, target_rad in zip(self._axes, targets_rad, strict=True):
            if not abs(target_rad) < _LARGEST_COUNT * abs(axis.units.rad_per_count):
                raise ConfigError(
                    f"The set point {target_rad} rad of {axis.name} cannot be sent: its drive counts 32 "
                    "bits; check the trajectory."
                )
            counts.append(axis.units.counts(target_rad))
        return counts

    def _lead(self, deadline_ns: int) -> CycleSample:
        while True:
            sample = self._enabling_step()
            if self._ledger.tripped:
                raise self._stopped(self._descend(Event.TRIP, sample))
            if all(stage.reached for stage in self._stages) and self._following(sample):
                return sample
            if self._link.now_ns() > deadline_ns:
                waiting = ", ".join(stage.axis for stage in self._stages if not stage.reached) or "an axis"
                raise StateTimeoutError(
                    f"Enabling took longer than {self.config.deadlines.enable_s:g} s: {waiting} does not "
                    "follow its set points; read the error code of that drive."
                )

    def _enabling_step(self) -> CycleSample:
        status = self._last.status_word if self._last else (None,) * len(self._stages)
        now_ns = self._link.now_ns()
        words = [stage.advance(word, now_ns) for stage, word in zip(self._stages, status, strict=True)]
        for axis, stage in enumerate(self._stages):
            position = self._last.position[axis] if self._last else None
            if not stage.reached and position is not None:
                self._targets[axis] = position  # until enabled the set point goes where the axis stands
        self._last = self._exchange.step(-1, words, self._targets)
        return self._last

    def _following(self, sample: CycleSample) -> bool:
        return sample.complete and all(
            not flags & Flag.FAULT
            and (not profile.has_follow_bit or bool((word or 0) & 1 << 12))
            for flags, word, profile in zip(sample.flags, sample.status_word, self._profiles, strict=True)
        )

    def _descend(self, event: Event, last: CycleSample | None = None) -> SessionReport:
        self._exchange.demanding = False
        self._descent = Descent(
            self.config.deadlines, self._traffic, self._exchange, self._stages, self.names
        )
        if last is not None:
            self._descent.tail.append(last)
        self._descent.run(event, self._targets, self._last)
        self._traffic.heartbeats.rest()
        self.phase = Phase.STOPPED
        return self.report()

    def _link_failed(self, error: LinkError) -> DriveStoppedError:
        kind = CauseKind.BUS_OFF if isinstance(error, BusOffError) else CauseKind.LINK
        self._traffic.bus_off |= kind is CauseKind.BUS_OFF
        self._ledger.trip(kind, str(error), self._link.now_ns())
        return self._stopped(self._descend(Event.NO_LINK if self._traffic.bus_off else Event.TRIP))

    def _stopped(self, report: SessionReport) -> DriveStoppedError:
        return DriveStoppedError(report.sentence, report)

    def _restore(self) -> None:
        self._ledger.armed = False
        if not self._nodes:
            return
        failures: list[str] = []
        if self._traffic.bus_off:
            self._restore_failures = ("The drives' settings were not put back: the bus was off.",)
            return
        try:
            self._traffic.command(PRE_OPERATIONAL)
            for node in self._nodes:
                failures += node.restore()
            self._traffic.command(RESET_COMMUNICATION)
        except DriverError as error:
            failures.append(str(error))
        self._restore_failures = tuple(failures)

    def _expect(self, phase: Phase) -> None:
        if self.phase is not phase:
            raise ConfigError(
                f"The drives are {self.phase.value}, not {phase.value}; boot, enable and cycle come in order."
            )

    def _refuse_cycle(self) -> None:
        if self.phase is Phase.STOPPED and self._ledger.tripped:
            raise self._stopped(self.report())
        self._expect(Phase.RUNNING)


def _enable_bits(axis: BootedAxis) -> int:
    return _INTERPOLATE if axis.mode == INTERPOLATED_POSITION else 0


def _check_load(config: BusConfig) -> None:
    load = bus_load(len(config.axes), config.rate_hz, config.can.bitrate_hz)
    if load > _LARGEST_LOAD:
        most = int(len(config.axes) * _LARGEST_LOAD / load)
        raise ConfigError(
            f"{len(config.axes)} axes at {config.rate_hz:g} Hz fill {load:.0%} of a bus with "
            f"{config.can.bitrate_hz} bit/s (limit {_LARGEST_LOAD:.0%}); "
            f"use at most {most} axes, a lower rate or a faster bus."
        )
