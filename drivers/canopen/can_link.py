"""A link over python-can: any of its interfaces, chosen by name."""

from __future__ import annotations

import time
from collections import deque
from typing import Any

import can

from drivers.canopen.config import CanConfig
from drivers.canopen.frame import SYNC, Frame
from drivers.errors import LinkError

#: Receive stamps further than this from their arrival are not on this machine's clock.
_FOREIGN_STAMP_NS = 500_000_000

#: The wall clock is slewed together with the monotonic one; a change of their distance is a step.
_STEP_NS = 1_000_000


class CanLink:
    """One python-can bus behind the `Link` port.

    Frames are stamped on the monotonic clock: the kernel's wall-clock stamp is moved over by the offset
    between both clocks, which is taken again when the wall clock was stepped (`clock_steps` counts them).
    """

    def __init__(self, config: CanConfig) -> None:
        self.clock_steps = 0
        self._config = config
        self._bus: Any = _open_bus(config)
        self._synthetic: deque[Frame] = deque()
        self._sync_task: Any = None
        self._offset_ns = time.monotonic_ns() - time.time_ns()

    def now_ns(self) -> int:
        """Monotonic time [ns]."""
        return time.monotonic_ns()

    def send(self, identifier: int, data: bytes) -> None:
        """Queue one frame.

        Raises:
            LinkError: the adapter is closed or did not take the frame.
        """
        try:
            self._opened().send(can.Message(arbitration_id=identifier, data=data, is_extended_id=False))
        except can.CanError as error:
            raise LinkError(
                f"Sending on {self._where} failed ({error}); check the cable and the bit rate."
            ) from None
        if identifier == SYNC and not self._config.own_echo:
            self._synthetic.append(Frame(self.now_ns(), SYNC, bytes(data), own=True))

    def receive(self, deadline_ns: int) -> Frame | None:
        """The next frame that concerns a session, or None at the deadline."""
        while True:
            if self._synthetic:
                return self._synthetic.popleft()
            message = self._wait(deadline_ns)
            if message is None:
                return None
            frame = self._frame(message)
            if frame is not None:
                return frame

    def start_sync(self, period_ns: int) -> bool:
        """Start SYNC in the kernel's broadcast manager when configured; any former one is ended first."""
        if not self._config.kernel_sync:
            return False
        self.stop_sync()
        message = can.Message(arbitration_id=SYNC, data=b"", is_extended_id=False)
        try:
            self._sync_task = self._opened().send_periodic(message, period_ns * 1e-9)
        except can.CanError as error:
            raise LinkError(f"{self._where} could not start a periodic SYNC ({error}).") from None
        return True

    def stop_sync(self) -> None:
        """End the periodic SYNC."""
        if self._sync_task is not None:
            self._sync_task.stop()
            self._sync_task = None

    def close(self) -> None:
        """Stop SYNC and release the adapter."""
        self.stop_sync()
        bus, self._bus = self._bus, None
        if bus is not None:
            bus.shutdown()

    @property
    def _where(self) -> str:
        return f"CAN interface {self._config.interface} channel {self._config.channel}"

    def _opened(self) -> Any:
        if self._bus is None:
            raise LinkError(f"{self._where} is closed; open it again before sending.")
        return self._bus

    def _wait(self, deadline_ns: int) -> Any:
        timeout_s = max(0.0, (deadline_ns - time.monotonic_ns()) * 1e-9)
        try:
            return self._opened().recv(timeout_s)
        except can.CanError as error:
            raise LinkError(f"Reading from {self._where} failed ({error}); is the interface up?") from None

    def _frame(self, message: Any) -> Frame | None:
        if message.is_remote_frame:
            return None
        own = not message.is_rx
        if own and message.arbitration_id != SYNC:
            return None
        stamp_ns = self._stamp_ns(message.timestamp)
        return Frame(stamp_ns, message.arbitration_id, bytes(message.data), own, message.is_error_frame)

    def _stamp_ns(self, timestamp_s: float) -> int:
        arrival_ns = time.monotonic_ns()
        offset_ns = arrival_ns - time.time_ns()
        if abs(offset_ns - self._offset_ns) > _STEP_NS:
            again_ns = time.monotonic_ns() - time.time_ns()  # rules out a pause between the two readings
            if abs(again_ns - self._offset_ns) > _STEP_NS:
                self._offset_ns = again_ns
                self.clock_steps += 1
        stamp_ns = round(timestamp_s * 1e9) + self._offset_ns
        known = abs(arrival_ns - stamp_ns) < _FOREIGN_STAMP_NS
        return min(stamp_ns, arrival_ns) if known else arrival_ns


def _open_bus(config: CanConfig) -> Any:
    try:
        return can.Bus(
            interface=config.interface,
            channel=config.channel,
            bitrate=config.bitrate_hz,
            receive_own_messages=config.own_echo,
            **config.options,
        )
    except (can.CanError, OSError, ValueError, TypeError, ImportError) as error:
        raise LinkError(
            f"CAN interface {config.interface} channel {config.channel} could not be opened ({error}); "
            "check its name, its driver and that it is up."
        ) from None
