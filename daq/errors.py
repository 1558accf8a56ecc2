"""What can go wrong while data are acquired, stored or read.

    DaqError                 exit 4
    ├── DataError            exit 4   the data are there but cannot be used
    │   ├── DamagedLogError           bytes are missing or changed, at a known offset
    │   ├── NotALogError              the file is something else
    │   └── MissingTopicError         the log lacks a stream that is needed
    ├── UsageError           exit 2   asked for something that cannot be
    └── HardwareError        exit 3   a device, a bus or a disk failed
"""

from __future__ import annotations


class DaqError(Exception):
    """Anything the acquisition package reports; its text is one sentence for the user."""

    exit_code = 4


class DataError(DaqError):
    """Data were found but are unusable."""

    exit_code = 4


class UsageError(DaqError):
    """The request itself cannot be met: a wrong argument, path or map file."""

    exit_code = 2


class HardwareError(DaqError):
    """A device, bus or disk did not do what it should."""

    exit_code = 3


class DamagedLogError(DataError):
    """A log whose bytes are cut short or changed."""

    def __init__(self, source: str, offset: int, reason: str) -> None:
        self.source, self.offset, self.reason = source, offset, reason
        super().__init__(
            f"{source} is damaged at byte {offset}: {reason}; "
            f"`residuum recover {source} -o whole.mcap` salvages what is intact."
        )


class NotALogError(DataError):
    """A file that is not an MCAP log at all."""

    def __init__(self, source: str, reason: str) -> None:
        self.source, self.reason = source, reason
        super().__init__(
            f"{source} is not an MCAP log: {reason}; give a log that `residuum record` or "
            "`residuum import` wrote."
        )


class MissingTopicError(DataError):
    """A log without a stream that the work needs."""

    def __init__(self, source: str, wanted: str, found: tuple[str, ...]) -> None:
        self.source, self.wanted, self.found = source, wanted, found
        there = ", ".join(found) if found else "no topic with messages"
        super().__init__(
            f"{source} holds no {wanted} (found: {there}); map its topics with `residuum import`."
        )
