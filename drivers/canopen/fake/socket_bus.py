"""A bus between processes on one machine: fake drives on one end of a socket pair, the host on the other.

Unlike python-can's `virtual` it leaves the host's process alone with its own load, as a real bus does; unlike
its `udp_multicast` it never drops a frame: a full socket makes the sender wait.
"""

from __future__ import annotations

import heapq
import select
import socket
import struct
import time
from collections import deque
from collections.abc import Callable
from contextlib import AbstractContextManager

from drivers.canopen.fake.fleet import Fleet
from drivers.canopen.frame import ERROR_BUS_OFF, SYNC, Frame
from drivers.errors import BusOffError, LinkError

_FRAME = struct.Struct("<qHBB")  # stamp [ns], identifier, own echo, error; the data follow
_LONGEST_WAIT_NS = 20_000_000
_ECHO_NS = 150_000_000


class SocketLink:
    """The host's end: a `Link` whose SYNC echo carries the instant at which the drives saw the SYNC."""

    def __init__(self, end: socket.socket) -> None:
        self._end: socket.socket | None = end
        end.setblocking(False)
        self._poll = select.poll()
        self._poll.register(end, select.POLLIN)
        self._frames: deque[Frame] = deque()
        self._is_off = False

    def now_ns(self) -> int:
        """Monotonic time [ns]."""
        return time.monotonic_ns()

    def send(self, identifier: int, data: bytes) -> None:
        """Send one frame.

        Raises:
            LinkError: the other end has gone.
        """
        if self._is_off:
            raise BusOffError("a frame could not be sent")
        if self._end is None:
            raise LinkError("The simulated bus is closed; open it again before sending.")
        try:
            self._end.send(_FRAME.pack(0, identifier, 0, 0) + data)
        except OSError as error:
            raise LinkError(f"The simulated bus has gone ({error.strerror}); start the run again.") from None
        if identifier == SYNC and not self._is_off:
            self._await_echo(time.monotonic_ns() + _ECHO_NS)

    def _await_echo(self, deadline_ns: int) -> None:
        """Hold the bus until the simulated drives have seen the SYNC: a busy machine delays it, as a late
        SYNC that the stamps show, instead of losing answers that no real drive would have lost.
        """
        while (wait_ns := deadline_ns - time.monotonic_ns()) > 0:
            if not self._fetch():
                self._poll.poll(wait_ns * 1e-6)
            elif self._frames[-1].own:
                return

    def receive(self, deadline_ns: int) -> Frame | None:
        """The next frame, or None at the deadline."""
        while not self._frames:
            if not self._fetch():
                wait_ns = deadline_ns - time.monotonic_ns()
                if wait_ns <= 0 or self._end is None:
                    return None
                self._poll.poll(wait_ns * 1e-6)
                if not self._fetch():
                    return None
        return self._frames.popleft()

    def start_sync(self, period_ns: int) -> bool:
        """The host sends each SYNC itself."""
        return False

    def stop_sync(self) -> None:
        """Nothing to stop."""

    def close(self) -> None:
        """Leave the bus."""
        end, self._end = self._end, None
        if end is not None:
            end.close()

    def _fetch(self) -> bool:
        """Take one frame from the socket."""
        if self._end is None:
            return False
        try:
            raw = self._end.recv(64)
        except BlockingIOError:
            return False
        except OSError:
            raw = b""
        if not raw:
            raise LinkError("The simulated bus has gone; start the run again.")
        stamp_ns, identifier, own, error = _FRAME.unpack_from(raw)
        self._is_off |= bool(error and identifier & ERROR_BUS_OFF)
        self._frames.append(Frame(stamp_ns, identifier, raw[_FRAME.size :], bool(own), bool(error)))
        return True


def serve_fleet(
    end: socket.socket, fleet: Fleet, lock: AbstractContextManager[object],
    on_sync: Callable[[int], None] = lambda now_ns: None,
) -> None:
    """Give a fleet its frames and its time until the host leaves.

    Args:
        end: the drives' end.
        fleet: the drives.
        lock: held while the fleet, and what it moves, is touched.
        on_sync: told of every SYNC before the drives see it [ns].
    """
    Server(end, fleet, lock, on_sync).run()


class Server:
    """The loop behind `serve_fleet`."""

    def __init__(
        self, end: socket.socket, fleet: Fleet, lock: AbstractContextManager[object],
        on_sync: Callable[[int], None],
    ) -> None:
        self._end, self._fleet, self._lock, self._on_sync = end, fleet, lock, on_sync
        self._queue: list[tuple[int, int, int, bytes]] = []
        self._order = 0
        self._is_off = False

    def run(self) -> None:
        """Serve until the other end closes."""
        poll = select.poll()
        poll.register(self._end, select.POLLIN)
        self._end.setblocking(True)
        with self._lock:
            self._fleet.power_on(time.monotonic_ns())
        while True:
            self._send_due()
            now_ns = time.monotonic_ns()
            wake_ns = min(now_ns + _LONGEST_WAIT_NS, self._fleet.next_timer_ns)
            if self._queue:
                wake_ns = min(wake_ns, self._queue[0][0])
            ready = poll.poll(max(0.0, (wake_ns - now_ns) * 1e-6))
            if ready and not self._take(self._end.recv(64)):
                return
            if self._fleet.next_timer_ns <= time.monotonic_ns():
                with self._lock:
                    self._fleet.tick(time.monotonic_ns())

    def _take(self, raw: bytes) -> bool:
        """Hand one frame of the host to the drives; False when the host has left."""
        if not raw:
            return False
        if self._is_off:
            return True
        _, identifier, _, _ = _FRAME.unpack_from(raw)
        now_ns = time.monotonic_ns()
        if identifier == SYNC:
            self._end.send(_FRAME.pack(now_ns, SYNC, 1, 0))
            self._on_sync(now_ns)
        with self._lock:
            self._fleet.take(identifier, raw[_FRAME.size :], now_ns)
        if self._fleet.bus_off:
            self._is_off = True
            self._end.send(_FRAME.pack(now_ns, ERROR_BUS_OFF, 0, 1) + bytes(8))
        return True

    def _send_due(self) -> None:
        for ready_ns, identifier, data in self._fleet.outbox:
            self._order += 1
            heapq.heappush(self._queue, (ready_ns, self._order, identifier, data))
        self._fleet.outbox.clear()
        while self._queue and self._queue[0][0] <= time.monotonic_ns():
            _, _, identifier, data = heapq.heappop(self._queue)
            if not self._is_off:
                self._end.send(_FRAME.pack(time.monotonic_ns(), identifier, 0, 0) + data)
