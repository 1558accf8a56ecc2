"""A CAN segment in virtual time: arbitration by identifier, frame times by length, a host at one end."""

from __future__ import annotations

import heapq
from collections import deque

from drivers.canopen.fake.faults import FaultKind
from drivers.canopen.fake.fleet import Fleet
from drivers.canopen.frame import ERROR_BUS_OFF, SYNC, Frame, worst_case_bits
from drivers.errors import BusOffError

_HOST, _DRIVES = True, False


class SimulatedSegment:
    """A `Link` whose time moves only while its host waits; the same session gives the same bytes each time.

    Args:
        fleet: the drives on the segment; they are switched on at time zero.
        bitrate_hz: of the wire.
        start_ns: the first instant on its clock [ns].
    """

    def __init__(self, fleet: Fleet, bitrate_hz: float = 1e6, start_ns: int = 1_000_000_000) -> None:
        self.fleet = fleet
        self.frames = 0  # frames that were on the wire
        self._now_ns = start_ns
        bit_ns = 1e9 / bitrate_hz
        self._duration_ns = tuple(round(worst_case_bits(length) * bit_ns) for length in range(9))
        self._events: list[tuple[int, int, int, bytes, bool]] = []  # ready, order, identifier, data, sender
        self._ready: list[tuple[int, int, bytes, bool]] = []  # identifier, order, data, sender
        self._flight: tuple[int, bytes, bool] | None = None
        self._flight_end_ns = 0
        self._order = 0
        self._host: deque[Frame] = deque()
        self._bus_off = False
        fleet.power_on(start_ns)
        self._fetch()

    def now_ns(self) -> int:
        """Virtual time [ns]."""
        return self._now_ns

    def send(self, identifier: int, data: bytes) -> None:
        """Offer one frame to the wire.

        Raises:
            BusOffError: after an injected bus-off.
        """
        if self._bus_off:
            raise BusOffError("a frame could not be sent")
        if identifier == SYNC and self._vanishes():
            self.fleet.sync += 1
            return
        self._order += 1
        heapq.heappush(self._ready, (identifier, self._order, data, _HOST))

    def receive(self, deadline_ns: int) -> Frame | None:
        """Let time pass until a frame reaches the host, at most until `deadline_ns`."""
        host = self._host
        while not host:
            if not self._advance(deadline_ns):
                return None
        return host.popleft()

    def start_sync(self, period_ns: int) -> bool:
        """The host sends each SYNC itself."""
        return False

    def stop_sync(self) -> None:
        """Nothing to stop."""

    def close(self) -> None:
        """The host leaves; the drives stay, see `run`."""

    def run(self, duration_ns: int) -> None:
        """Let the drives go on without a host for `duration_ns`."""
        end_ns = self._now_ns + duration_ns
        while self._advance(end_ns):
            pass

    def _vanishes(self) -> bool:
        plan = self.fleet.plan
        return bool(plan.faults) and plan.hits(
            FaultKind.VANISHED_SYNC, 0, plan.cycle(self.fleet.sync + 1)
        )

    def _advance(self, deadline_ns: int) -> bool:
        """Go on to the next thing that happens; False when the deadline comes first."""
        events, ready = self._events, self._ready
        now_ns = self._now_ns
        while events and events[0][0] <= now_ns:
            _, order, identifier, data, sender = heapq.heappop(events)
            heapq.heappush(ready, (identifier, order, data, sender))
        if self._flight is None and ready:
            identifier, _, data, sender = heapq.heappop(ready)
            self._flight = (identifier, data, sender)
            self._flight_end_ns = now_ns + self._duration_ns[len(data)]
        next_ns = self.fleet.next_timer_ns
        if self._flight is not None and self._flight_end_ns <= next_ns:
            next_ns = self._flight_end_ns
        if events and events[0][0] < next_ns:
            next_ns = events[0][0]
        if next_ns > deadline_ns:
            self._now_ns = max(now_ns, deadline_ns)
            return False
        self._now_ns = next_ns = max(next_ns, now_ns)
        if self._flight is not None and self._flight_end_ns <= next_ns:
            self._deliver()
        if self.fleet.next_timer_ns <= next_ns:
            self.fleet.tick(next_ns)
            self._fetch()
        return True

    def _deliver(self) -> None:
        assert self._flight is not None
        identifier, data, sender = self._flight
        self._flight = None
        self.frames += 1
        if sender is _DRIVES:
            if not self._bus_off:
                self._host.append(Frame(self._now_ns, identifier, data))
            return
        if identifier == SYNC:
            self._host.append(Frame(self._now_ns, SYNC, data, True))
        self.fleet.take(identifier, data, self._now_ns)
        self._fetch()
        if self.fleet.bus_off and not self._bus_off:
            self._go_off()

    def _go_off(self) -> None:
        """The host's controller leaves the bus: what it still wanted to send is gone."""
        self._bus_off = True
        self._ready = [entry for entry in self._ready if entry[3] is _DRIVES]
        heapq.heapify(self._ready)
        self._host.append(Frame(self._now_ns, ERROR_BUS_OFF, bytes(8), error=True))

    def _fetch(self) -> None:
        outbox = self.fleet.outbox
        if not outbox:
            return
        for ready_ns, identifier, data in outbox:
            self._order += 1
            heapq.heappush(self._events, (ready_ns, self._order, identifier, data, _DRIVES))
        outbox.clear()
