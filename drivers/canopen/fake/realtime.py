"""Fake drives in real time on any python-can interface; `virtual` needs neither kernel nor root."""

from __future__ import annotations

import heapq
import threading
import time
from types import TracebackType
from typing import Any

import can

from drivers.canopen.fake.fleet import Fleet
from drivers.canopen.frame import ERROR_BUS_OFF

_LONGEST_WAIT_NS = 20_000_000  # how soon the thread notices that it should end [ns]


class RealTimeFleet:
    """A thread that gives a fleet its frames and its time.

    Open the host's link first: python-can's virtual bus hands a frame to its listeners in the order in which
    they came, so the host then sees the echo of its SYNC before any answer to it.

    Args:
        fleet: the drives.
        channel: channel of the interface.
        interface: python-can's name of the interface.
    """

    def __init__(self, fleet: Fleet, channel: str, interface: str = "virtual") -> None:
        self.fleet = fleet
        self.failure: BaseException | None = None
        self._bus: Any = can.Bus(interface=interface, channel=channel)
        self._end = threading.Event()
        self._queue: list[tuple[int, int, int, bytes]] = []
        self._order = 0
        self._error_sent = False
        self._thread = threading.Thread(target=self._run, name="fake drives", daemon=True)

    def __enter__(self) -> RealTimeFleet:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end.set()
        self._thread.join()
        self._bus.shutdown()
        if self.failure is not None and error is None:
            raise self.failure

    def _run(self) -> None:
        try:
            self.fleet.power_on(time.monotonic_ns())
            while not self._end.is_set():
                self._turn()
        except BaseException as error:  # handed over to whoever leaves the `with`
            self.failure = error

    def _turn(self) -> None:
        self._send_due()
        now_ns = time.monotonic_ns()
        wake_ns = min(now_ns + _LONGEST_WAIT_NS, self.fleet.next_timer_ns)
        if self._queue:
            wake_ns = min(wake_ns, self._queue[0][0])
        message = self._bus.recv(max(0.0, (wake_ns - now_ns) * 1e-9))
        if message is not None and not message.is_error_frame and not self.fleet.bus_off:
            self.fleet.take(message.arbitration_id, bytes(message.data), time.monotonic_ns())
        if self.fleet.next_timer_ns <= time.monotonic_ns():
            self.fleet.tick(time.monotonic_ns())
        if self.fleet.bus_off and not self._error_sent:
            self._error_sent = True
            self._bus.send(can.Message(arbitration_id=ERROR_BUS_OFF, is_error_frame=True, data=bytes(8)))

    def _send_due(self) -> None:
        for ready_ns, identifier, data in self.fleet.outbox:
            self._order += 1
            heapq.heappush(self._queue, (ready_ns, self._order, identifier, data))
        self.fleet.outbox.clear()
        while self._queue and self._queue[0][0] <= time.monotonic_ns():
            _, _, identifier, data = heapq.heappop(self._queue)
            if not self.fleet.bus_off:
                message = can.Message(arbitration_id=identifier, data=data, is_extended_id=False)
                self._bus.send(message)
