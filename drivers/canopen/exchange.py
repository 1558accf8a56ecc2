"""One cycle on the wire: set points out, SYNC, the answers of the interval in, judged axis by axis."""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Sequence

from drivers.canopen.assembler import Harvest
from drivers.canopen.frame import RPDO1, SYNC
from drivers.canopen.power import BIT_FAULT, BIT_FOLLOWING_ERROR, BIT_FOLLOWS, State, state_of
from drivers.canopen.profile import DriveProfile
from drivers.canopen.sample import CycleSample, Flag
from drivers.canopen.schedule import SyncSchedule
from drivers.canopen.traffic import Traffic

_SET_POINT = struct.Struct("<Hi")
_NO_SYNC = int(Flag.NO_SYNC)


class Exchange:
    """The cyclic exchange with all drives.

    Set points leave right after SYNC k and act at SYNC k+1; the sample of SYNC k is closed when the echo of
    SYNC k+1 is seen, because only then is it certain that nothing more belongs to it.
    """

    def __init__(
        self, traffic: Traffic, nodes: Sequence[int], profiles: Sequence[DriveProfile], period_ns: int
    ) -> None:
        self.sync = -1  # SYNCs sent so far, less one
        self.demanding = False  # set points are to be followed by every axis
        self._traffic = traffic
        self._identifiers = [RPDO1 + node for node in nodes]
        self._profiles = profiles
        self._period_ns = period_ns
        self._schedule: SyncSchedule | None = None
        self._sync_ns = 0
        self._sync_seen = True
        self._late = False
        self._by_itself = False
        depth = 2 + max(profile.demand_lag_cycles for profile in profiles)
        self._sent: deque[tuple[int, ...]] = deque(maxlen=depth)

    def start(self) -> None:
        """Send the first SYNC."""
        self._by_itself = self._traffic.link.start_sync(self._period_ns)
        self._schedule = SyncSchedule(self._period_ns, self._traffic.link.now_ns())
        self._next_sync(self._schedule)
        self._traffic.assembler.close()

    def halt(self) -> None:
        """End a SYNC that the link produces by itself."""
        self._traffic.link.stop_sync()

    def step(self, cycle: int, words: Sequence[int], targets: Sequence[int]) -> CycleSample:
        """Send set points, run to the next SYNC, and return the sample of the interval that it ends.

        Args:
            cycle: number to give the sample.
            words: control word of each axis.
            targets: set point of each axis [counts].

        Raises:
            LinkError: the adapter failed on the way.
        """
        assert self._schedule is not None, "start() comes before step()"
        sync, sync_ns, seen, late = self.sync, self._sync_ns, self._sync_seen, self._late
        self._send(words, targets)
        self._schedule.hold_until(self._traffic.link.now_ns() + self._period_ns // 2)
        self._next_sync(self._schedule)
        harvest = self._traffic.assembler.close()
        sample = self._sample(harvest, cycle, sync, sync_ns, late, tuple(targets), seen)
        self._sent.append(tuple(targets))
        self._traffic.check_heartbeats()
        return sample

    def _send(self, words: Sequence[int], targets: Sequence[int]) -> None:
        send, pack = self._traffic.link.send, _SET_POINT.pack
        for identifier, word, target in zip(self._identifiers, words, targets, strict=True):
            send(identifier, pack(word, target))

    def _next_sync(self, schedule: SyncSchedule) -> None:
        traffic = self._traffic
        if self._by_itself:
            self._await_sync()
            return
        traffic.run_until(schedule.due_ns)
        traffic.echo_ns = None
        sent_ns = traffic.link.now_ns()
        traffic.link.send(SYNC, b"")
        echo_ns = traffic.wait_echo(sent_ns + self._period_ns // 2)
        self._note_sync(echo_ns, sent_ns, schedule.sent(sent_ns))

    def _await_sync(self) -> None:
        """The link produces SYNC: wait for the next one, and judge it by its distance to the last."""
        traffic, before_ns = self._traffic, self._sync_ns
        traffic.echo_ns = None
        traffic.beat()
        echo_ns = traffic.wait_echo(traffic.link.now_ns() + 3 * self._period_ns // 2)
        now_ns = traffic.link.now_ns()
        late = self.sync >= 0 and (echo_ns or now_ns) - before_ns > 6 * self._period_ns // 5
        self._note_sync(echo_ns, now_ns, late)

    def _note_sync(self, echo_ns: int | None, otherwise_ns: int, late: bool) -> None:
        self._sync_seen = echo_ns is not None
        self._sync_ns = echo_ns if echo_ns is not None else otherwise_ns
        self._late = late
        self.sync += 1

    def _sample(
        self,
        harvest: Harvest,
        cycle: int,
        sync: int,
        sync_ns: int,
        late: bool,
        targets: tuple[int, ...],
        seen: bool,
    ) -> CycleSample:
        flags = harvest.flags
        for axis, (status, motion) in enumerate(zip(harvest.status, harvest.motion, strict=True)):
            if status is not None:
                flags[axis] |= self._status_flags(axis, status[0])
            if motion is not None and self.demanding:
                flags[axis] |= self._torn(axis, motion[0])
            if not seen:
                flags[axis] |= _NO_SYNC
        return CycleSample(
            cycle,
            sync,
            sync_ns,
            tuple([s[0] if s else None for s in harvest.status]),
            tuple([s[1] if s else None for s in harvest.status]),
            tuple([s[2] if s else None for s in harvest.status]),
            tuple([m[0] if m else None for m in harvest.motion]),
            tuple([m[1] if m else None for m in harvest.motion]),
            harvest.stamp_ns,
            tuple(flags),
            targets,
            late,
        )

    def _status_flags(self, axis: int, word: int) -> int:
        if not self.demanding:
            return Flag.FAULT if word & 0x4F in (0x08, 0x0F) else 0
        follows = word & BIT_FOLLOWS or not self._profiles[axis].has_follow_bit
        if follows and not word & (BIT_FAULT | BIT_FOLLOWING_ERROR) and state_of(word) is State.ENABLED:
            return 0
        flags = 0
        if word & BIT_FAULT:
            flags |= Flag.FAULT
        if word & BIT_FOLLOWING_ERROR:
            flags |= Flag.FOLLOWING_ERROR
        return flags or Flag.NOT_FOLLOWING

    def _torn(self, axis: int, demand: int) -> int:
        profile = self._profiles[axis]
        position = len(self._sent) - 1 - profile.demand_lag_cycles
        if position < 0:
            return 0
        return Flag.TORN if abs(demand - self._sent[position][axis]) > profile.demand_tolerance_counts else 0
