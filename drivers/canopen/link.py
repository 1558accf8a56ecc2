"""The port to a bus: send a frame, wait for the next one; real adapter and simulated segment look alike."""

from __future__ import annotations

from typing import Protocol

from drivers.canopen.frame import Frame


class Link(Protocol):
    """One host's connection to a CAN bus. Single-threaded: whoever drives the cycle also receives."""

    def now_ns(self) -> int:
        """Present time on the clock that stamps the frames [ns]."""
        ...

    def send(self, identifier: int, data: bytes) -> None:
        """Queue one frame.

        Raises:
            LinkError: the adapter did not take it.
        """
        ...

    def receive(self, deadline_ns: int) -> Frame | None:
        """The next frame, or None when none came before `deadline_ns`; own SYNCs come back as echo."""
        ...

    def start_sync(self, period_ns: int) -> bool:
        """Let the link produce SYNC by itself; False when it leaves that to the caller."""
        ...

    def stop_sync(self) -> None:
        """End a SYNC that `start_sync` began."""
        ...

    def close(self) -> None:
        """Release the adapter; a second call does nothing."""
        ...
